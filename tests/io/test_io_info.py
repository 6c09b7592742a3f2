"""What `plumbob info` says of a file."""

import json

import numpy as np
import pytest
from io_samples import make_imu, make_track

from plumbob import io
from plumbob.cli.main import main
from plumbob.data import ImuMeta
from plumbob.errors import ShapeError
from plumbob.io.findings import TOPICS


@pytest.fixture
def info(capsys):
    def run(*words):
        assert main(["info", *map(str, words)]) == 0
        return capsys.readouterr()

    return run


def test_facts_on_the_terminal(tmp_path, info):
    t = np.arange(12) * 0.01
    t[6:] += 0.5
    out = info(io.write(tmp_path / "a.parquet", make_imu(t=t))).out
    assert "declination  -3.495°" in out  # −0.061 rad
    assert "range ±34.907" in out
    assert "1 gaps, longest step 0.51 s" in out


def test_what_is_not_known_is_not_printed(tmp_path, info):
    out = info(io.write(tmp_path / "a.parquet", make_imu(rows=1, meta=ImuMeta()))).out
    for word in ("declination", "range", "longest step", "note"):
        assert word not in out


def test_provenance_on_the_terminal_and_findings_once(tmp_path, info):
    file = tmp_path / "log.csv"
    file.write_text("t,x,y,z\n0,0,0,-9.8\n0.01,0,0,-9.9\n0.02,0,0,-9.", encoding="utf-8")
    file.with_suffix(".toml").write_text(
        """separator = ","
header.names = true
time = { column = "t", unit = "s" }
acc = { columns = ["x", "y", "z"], unit = "m/s2", sign = "gravity" }
""",
        encoding="utf-8",
    )
    said = info(file)
    for part in ("the last,", "log.toml", "acc was negated"):
        assert part in said.out
    assert "calibration: " in said.err
    assert not any(topic in said.out for topic in TOPICS)
    assert any("acc was negated" in note for note in json.loads(info(file, "--json").out)["notes"])


def test_a_triad_without_a_usable_sample(tmp_path, info):
    acc = np.full((12, 3), 1e6)
    file = io.write(tmp_path / "a.parquet", make_imu(acc=acc, meta=ImuMeta(unit_check=False)))
    assert "acc          no usable sample" in info(file).out
    triad = json.loads(info(file, "--json").out)["sensors"]["triads"]["acc"]
    assert triad == {"unit": "m/s2", "samples": 0, "range": None, "mean": None, "std": None, "norm_median": None}


def test_declination_in_json(tmp_path, info):
    file = io.write(tmp_path / "a.parquet", make_imu())
    assert json.loads(info(file, "--json").out)["sensors"]["declination_deg"] == pytest.approx(np.degrees(-0.061))


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_notes_to_write_are_lines_and_not_letters(tmp_path, suffix):
    file = tmp_path / f"a.{suffix}"
    for what in (make_imu(), make_track(), io.Recording(imu=make_imu())):
        with pytest.raises(ShapeError, match="notes must be a sequence of lines of text, but got 'text'"):
            io.write(file, what, notes="text")
    assert not file.exists()
