"""What `plumbob info` says of a file."""

import json
import math

import numpy as np
import pyarrow.parquet as pq
import pytest

import plumbob
from plumbob import AttitudeTrack, Frame, ImuData, ImuMeta, North, files, flags
from plumbob.reporting import info
from tests.helpers.commandline import ok
from tests.helpers.io_samples import make_imu


def facts(path):
    return plumbob.info(path).summary()


def test_figures_of_time_and_of_a_triad(tmp_path):
    """By hand: steps of 10, 30 and 10 ms, whose mean is 50/3 ms and whose scatter is √(800)/3 ms = 9.43 ms.

    The forces have the mean (1, −1, 6.25), and the sizes 4, 5, √82 and √98, whose median is the middle of 5 and √82.
    """
    acc = [[0.0, 0.0, 4.0], [0.0, -4.0, 3.0], [0.0, 1.0, 9.0], [4.0, -1.0, 9.0]]
    imu = make_imu(rows=4, t=[5.0, 5.01, 5.04, 5.05], acc=acc, mag=None, temp_c=None)
    file = files.write(tmp_path / "a.parquet", imu)
    found = facts(file)["sensors"]
    scatter_us = 1e3 * math.sqrt(800.0) / 3.0
    assert found["time"] == pytest.approx(
        {
            "samples": 4,
            "duration_s": 0.05,
            "rate_hz": 100.0,
            "jitter_us": scatter_us,
            "gaps": 0,
            "longest_step_s": 0.03,
            "start_utc": "2023-11-14T22:13:20.123456Z",
        }
    )
    assert found["triads"]["acc"]["mean"] == pytest.approx([1.0, -1.0, 6.25])
    assert found["triads"]["acc"]["std"] == pytest.approx([math.sqrt(v) for v in (3.0, 3.5, 7.6875)])
    assert found["triads"]["acc"]["norm_median"] == pytest.approx(0.5 * (5.0 + math.sqrt(82.0)))
    out = ok("info", file).stdout
    assert json.loads(ok("info", file, "--json").stdout)["sensors"] == found
    assert "time         4 samples, 0.050 s, 100 Hz, jitter 9.43e+03 µs, 0 gaps, longest step 0.03 s" in out
    assert "acc          4 samples in m/s2, range ±156.91, |acc| median 7.0277" in out
    assert "mean [1, -1, 6.25], std [1.732, 1.871, 2.773]" in out


def test_what_is_marked_or_not_known_does_not_count(tmp_path):
    """Three of five attitudes are known, two are scored, and two samples carry a flag."""
    q = np.tile([1.0, 0.0, 0.0, 0.0], (5, 1))
    q[[1, 4]] = np.nan
    track = AttitudeTrack(
        t=np.arange(5.0), q_nb=q, frame=Frame.ENU, north=North.TRUE, score=np.array([True, False, True, False, False])
    )
    file = files.write(tmp_path / "t.parquet", track)
    found = facts(file)["attitude"]
    assert (found["known_samples"], found["scored_samples"], found["north"]) == (3, 2, "true")
    assert "known        3 samples, scored 2" in ok("info", file).stdout
    acc = np.tile([0.0, 0.0, 9.8], (5, 1))
    acc[2] = [0.0, 0.0, 1e6]  # no accelerometer measures that
    marks = np.array([0, flags.ACC_CLIPPED, 0, flags.ACC_CLIPPED, 0], dtype=np.uint32)
    imu = make_imu(rows=5, acc=acc, flags=marks, mag=None, meta=ImuMeta(unit_check=False))
    out = ok("info", files.write(tmp_path / "a.parquet", imu)).stdout
    assert "flag         acc-clipped: 2 samples" in out
    assert "acc          4 samples" in out


def test_provenance_on_the_terminal_and_findings_once(tmp_path):
    file = tmp_path / "log.csv"
    file.write_text("t,x,y,z\n0,0,0,-9.8\n0.01,0,0,-9.9\n0.02,0,0", encoding="utf-8")
    file.with_suffix(".toml").write_text(
        """separator = ","
header.names = true
time = { column = "t", unit = "s" }
acc = { columns = ["x", "y", "z"], unit = "m/s2", sign = "gravity" }
""",
        encoding="utf-8",
    )
    said = ok("info", file)
    for part in ("log.toml", "acc was negated"):
        assert part in said.stdout
    for part in ("cut: line 4, the last, is cut", "calibration: "):
        assert said.stderr.count(part) == 1
    noted = [line for line in said.stdout.splitlines() if line.startswith("note ")]
    assert noted
    assert not any("cut: " in line or "calibration: " in line for line in noted)
    assert [note["code"] for note in facts(file)["notes"]].count("source.acc_negated") == 1


def test_a_triad_without_a_usable_sample_and_the_declination(tmp_path):
    acc = np.full((12, 3), 1e6)
    file = files.write(tmp_path / "a.parquet", make_imu(acc=acc, meta=ImuMeta(unit_check=False, declination=-0.061)))
    out = ok("info", file).stdout
    assert "acc          no usable sample" in out
    assert "declination  -3.495°" in out
    sensors = facts(file)["sensors"]
    none = {"unit": "m/s2", "samples": 0, "range": None, "mean": None, "std": None, "norm_median": None}
    assert sensors["triads"]["acc"] == none
    assert sensors["declination_deg"] == pytest.approx(np.degrees(-0.061))


def test_a_file_is_not_read_again_and_again(tmp_path, monkeypatch):
    """Checksum, units, statistics, turning, rests, conventions need a pass each of what they look at: 112 columns."""
    n = 40_000
    noise = np.random.default_rng(0).normal(0.0, 0.1, (3, n, 3)) + np.array([0.0, 5.0, 20.0])[:, np.newaxis, np.newaxis]
    file = files.write(tmp_path / "a.parquet", ImuData(0.01 * np.arange(n), *noise, temp_c=np.full(n, 21.0)))
    count, batches = 0, pq.ParquetFile.iter_batches

    def counted(*args, **how):
        nonlocal count
        for batch in batches(*args, **how):
            count += batch.num_rows * batch.num_columns
            yield batch

    monkeypatch.setattr(pq.ParquetFile, "iter_batches", counted)
    monkeypatch.setattr(info, "READ_WHOLE", 0)  # as of a file that is too large for that
    facts(file)
    assert 10 < count / n < 113
