"""Estimating from file to file: numbers, notes and bytes are those of the whole, nothing is half, memory is bounded."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import plumbob
from plumbob import CalibrationCard, ImuData, Recording, flags
from plumbob.core.errors import ClockError, DecodeError, UnitError
from plumbob.data import ImuMeta, imu, plausibility
from plumbob.data.cards import TriadCalibration
from plumbob.files import parquet, read
from plumbob.filters import offline
from plumbob.filters.smoother import samples
from tests.helpers import full_disk
from tests.helpers.motion import noisy

GYR = TriadCalibration(np.eye(3) * 1.01, np.full(3, 1e-3), "rad/s", "rad/s", g_sensitivity=np.full((3, 3), 1e-4))
CARD = CalibrationCard("unknown", "2026-01-01", "a test", gyr=GYR)


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Stretches, chunks, blocks and row groups of other sizes, so that all their borders differ."""
    monkeypatch.setattr("plumbob.filters.smoother.live.MARGIN", 2.0)  # first: what is imported later would keep it
    monkeypatch.setattr("plumbob.filters.smoother.smoothing.AT_ONCE", 700)
    for module, name, value in (
        *((samples, "LONG", 12.0), (samples, "CORE", 6.0), (samples, "MARGIN", 2.0), (offline, "CHUNK", 700)),
        *((imu, "BLOCK", 333), (plausibility, "BLOCK", 333), (parquet, "GROUP", 400), (parquet, "ALIKE", 3)),
    ):
        monkeypatch.setattr(module, name, value)


def sea(n=4000):
    """Forty seconds: a gap that begins at a row group's border, one within, a stuck magnetometer, values at the end of
    the range and impossible ones, a slow magnetometer, and flags that the source knew.
    """
    one = noisy(n, seed=5)
    t = one.t.copy()
    t[400:] += 0.7
    t[2111:] += 3.0
    gyr, acc, mag = one.gyr.copy(), one.acc.copy(), one.mag.copy()
    gyr[900:904], acc[1200, 1], mag[3000:3150], mag[::3] = 40.0, np.inf, mag[3000], np.nan
    known = np.zeros(n, dtype=np.uint32)
    known[50] = flags.TIME_FAULT
    return ImuData(
        t=t, gyr=gyr, acc=acc, mag=mag, flags=known, temp_c=np.linspace(20.0, 30.0, n), meta=ImuMeta(gyr_range=40.0)
    )


@pytest.fixture
def file(tmp_path):
    return plumbob.write(tmp_path / "sea.parquet", sea())


def numbers(track):
    return [None if a is None else a.tobytes() for a in (track.t, track.q_nb, track.bias_b, track.cov_b, track.flags)]


@pytest.mark.parametrize(
    "how", [{}, {"lag": "2 s"}, {"causal": True}, {"filter": "mahony"}, {"calibration": CARD}], ids=str
)
def test_to_a_file_it_is_the_estimate_in_memory(file, how, tmp_path):
    """To the bit, with the same notes, report and card; and the file is the one that is written of the whole."""
    whole = plumbob.estimate(file, frame="ENU", **how)
    done = []
    pieces = plumbob.estimate(file, frame="ENU", out=tmp_path / "a.parquet", progress=lambda *n: done.append(n), **how)
    assert numbers(pieces.track) == numbers(whole.track)
    assert pieces.notes == whole.notes
    assert pieces.summary() == whole.summary()
    assert pieces.text() == whole.text()
    assert how or pieces.card().text() == whole.card().text()
    assert (done[-1], len(done) > 4) == ((4000, 4000), True)
    whole.save(tmp_path / "b.parquet")
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()
    # what `sea` was given is found: else the comparisons above compare nothing
    for topic in ("clipped: gyr", "invalid: acc", "gaps: samples are missing before 2 of 4000", "stuck: mag"):
        assert any(topic in str(note) for note in whole.notes)


@pytest.mark.parametrize("suffix", [".parquet", ".csv"])
def test_what_is_in_memory_is_written_too(tmp_path, suffix):
    imu = sea()[:1500]
    result = plumbob.estimate(imu, "mahony", frame="ENU", out=tmp_path / f"a{suffix}")
    again = plumbob.estimate(imu, "mahony", frame="ENU").track
    for track in (result.track, plumbob.read(tmp_path / f"a{suffix}").track):
        assert track.q_nb == pytest.approx(again.q_nb, abs=1e-12)  # digits of a text


@pytest.mark.parametrize("error", [KeyboardInterrupt, SystemExit])
@pytest.mark.parametrize("lies", [False, True], ids=["new", "replaced"])
def test_an_interrupted_estimate_leaves_nothing(file, tmp_path, error, lies):
    """As SIGINT and SIGTERM come, while half is written: what lay there is as it was."""
    out = tmp_path / "a.parquet"
    if lies:
        out.write_bytes(b"old")

    def stop(done, total):
        if done > total // 2:
            raise error

    before = sorted(tmp_path.iterdir())
    with pytest.raises(error):
        plumbob.estimate(file, frame="ENU", out=out, overwrite=True, progress=stop)
    assert sorted(tmp_path.iterdir()) == before
    assert not lies or out.read_bytes() == b"old"


def test_a_full_disk_leaves_nothing(file, tmp_path):
    before = sorted(tmp_path.iterdir())
    match = r"a\.parquet cannot be written: .*Nothing was changed there"
    with full_disk(100_000), pytest.raises(DecodeError, match=match):  # the track has some 400 kB
        plumbob.estimate(file, "mekf", frame="ENU", out=tmp_path / "a.parquet")
    assert sorted(tmp_path.iterdir()) == before
    raw = bytearray(file.read_bytes())  # neither is anything left by a file that is refused before it is estimated
    with pytest.raises(plumbob.errors.ParameterError, match="exists already"):
        plumbob.estimate(file, "mahony", frame="ENU", out=file)
    assert file.read_bytes() == raw
    raw[len(raw) // 3] ^= 16
    file.write_bytes(raw)
    with pytest.raises(DecodeError, match=r"sea\.parquet: .*use an intact copy"):
        plumbob.estimate(file, frame="ENU", out=tmp_path / "a.parquet")
    assert sorted(tmp_path.iterdir()) == before


def held(imu):
    values = (imu.t, imu.gyr, imu.acc, imu.mag, imu.temp_c, imu.flags)
    return [None if a is None else a.tobytes() for a in values], imu.meta, imu.triads, len(imu)


def test_samples_that_stay_are_those_that_are_read(tmp_path):
    """More rows than are read at once."""
    file = plumbob.write(tmp_path / "sea.parquet", sea(66_000))
    whole, stays = read(file), read(file, whole=False)
    assert isinstance(stays.imu, parquet.Stored)
    assert held(stays.imu) == held(whole.imu)
    assert stays.notes == whole.notes
    rng = np.random.default_rng(1)
    for _ in range(10):  # forward and back
        low, high = np.sort(rng.choice(66_001, 2, replace=False))
        assert held(stays.imu[low:high]) == held(whole.imu[low:high])


def test_an_attitude_beside_the_samples_brings_both_to_memory(tmp_path):
    imu = sea()[:900]
    both = Recording(imu=imu, track=plumbob.estimate(imu, "mahony", frame="ENU").track)
    plumbob.write(tmp_path / "a.parquet", both)
    assert type(read(tmp_path / "a.parquet", whole=False).imu) is ImuData
    result = plumbob.estimate(tmp_path / "a.parquet", frame="ENU", out=tmp_path / "b.parquet")
    assert numbers(plumbob.read(tmp_path / "b.parquet").track) == numbers(result.track)


@pytest.mark.parametrize(("change", "error"), [
    (lambda c: c["t_ns"].__setitem__(1700, c["t_ns"][1699]), ClockError),
    (lambda c: c["acc_x"].__imul__(50.0), UnitError),
    (lambda c: c["gyr_y"].__setitem__(slice(None), 1e4), UnitError),
    (lambda c: [c[f"mag_{i}"].__setitem__(slice(None), np.nan) for i in "xyz"], plumbob.errors.ShapeError),
], ids=["time", "acc", "gyr", "mag"])  # fmt: skip
def test_the_whole_is_refused_in_the_same_words(tmp_path, monkeypatch, change, error):
    """A file with other columns, and a checksum that fits them."""
    to_columns, said = parquet.layout.to_columns, []

    def damaged(recording):
        columns = to_columns(recording)
        change(columns)
        return columns

    monkeypatch.setattr(parquet.layout, "to_columns", damaged)
    file = plumbob.write(tmp_path / "damaged.parquet", replace(sea(), meta=ImuMeta()))
    for whole in (True, False):
        with pytest.raises(error) as caught:
            read(file, whole=whole)
        said.append(str(caught.value))
    assert said[0] == said[1]


# ru_maxrss would not do: a child inherits that of the process that started it.
PEAK = """
import sys
from pathlib import Path
import pyarrow.parquet
from plumbob.cli.main import main
from plumbob.filters.smoother import Smoother
def most():
    return float(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0]) / 1024
libraries = most()
assert main(sys.argv[1:]) == 0
print(most() - libraries)
"""


def repeated(path, times, n=360_000):
    """An hour's samples at 100 Hz, again and again; their steps are uneven, so that they take a quarter longer."""
    one = noisy(n, seed=2)
    lasts = one.t[-1] + 0.01
    plumbob.files.parquet.write_parquet(
        path, (Recording(imu=replace(one, t=one.t + lasts * k)) for k in range(times)), overwrite=True
    )


@pytest.mark.long(reason="seven hours at 100 Hz are smoothed, 60 s")
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="only Linux says what a process took at most")
def test_memory_does_not_grow_with_the_recording(tmp_path, monkeypatch):
    """One, two and four hours; the whole, and its track, would take 90 MB an hour. The first call compiles kernels."""
    monkeypatch.undo()
    peak = []
    for hours in (1, 2, 4):
        repeated(tmp_path / "long.parquet", hours)
        words = ["run", tmp_path / "long.parquet", "--frame", "ENU", "--out", tmp_path / "track.parquet", "--force"]
        done = subprocess.run(
            [sys.executable, "-c", PEAK, *map(str, words)], check=False, capture_output=True, text=True, env=os.environ
        )
        assert done.returncode == 0, done.stderr
        peak.append(float(done.stdout.splitlines()[-1]))
        assert len(plumbob.read(tmp_path / "track.parquet").track) == hours * 360_000
    assert peak[2] < peak[1] + 15.0, peak
    assert peak[2] < 150.0, peak
