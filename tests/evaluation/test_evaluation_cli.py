"""plumbob eval as a user meets it; the exit codes and one-line errors that all verbs share are tested with them."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from plumbob import ImuData, Recording
from plumbob import files as io
from plumbob.rotations import North, quat_from_euler_zyx, quat_multiply
from tests.helpers.commandline import call, ok, refused

PAIR = ("estimate.parquet", "truth.parquet")


@pytest.fixture
def files(reference, tmp_path, monkeypatch):
    """An estimate, a reference, and a recording with that reference, in the working directory."""
    monkeypatch.chdir(tmp_path)
    imu = ImuData(t=reference.t, gyr=np.zeros((len(reference), 3)))
    for name in PAIR:
        io.write(name, reference)
    io.write("recording.parquet", Recording(imu=imu, track=reference))
    (tmp_path / "link.parquet").symlink_to("truth.parquet")
    return tmp_path


@pytest.mark.parametrize(("words", "told"), [
    (("truth.parquet", "truth.parquet"), "both estimate and reference"),
    (("truth.parquet", "./truth.parquet"), "both estimate and reference"),
    (("truth.parquet", "link.parquet"), "both estimate and reference"),
    ((*PAIR, "--html", "page.parquet"), ".html or .htm"),
    ((*PAIR, "--html", "page"), ".html or .htm"),
    ((*PAIR, "--html", "./truth.parquet"), "is an input"),
    ((*PAIR, "--lang", "zh"), "--lang is for --html or --plot"),
    ((*PAIR, "--settle", "10deg"), "not a unit of time"),
    ((*PAIR, "--align", "heading,north"), "north"),
])  # fmt: skip
def test_what_is_refused_leaves_all_files_as_they_were(files, words, told):
    before = {path.name: path.read_bytes() for path in files.iterdir()}
    assert told in refused("eval", *words)
    assert {path.name: path.read_bytes() for path in files.iterdir()} == before


def test_page_and_figures_in_chinese(files):
    ok("eval", *PAIR, "--html", "page.HTM", "--plot", "figures.svg", "--lang", "zh")
    assert "总误差</th>" in (files / "page.HTM").read_text(encoding="utf-8")
    assert ">总误差 [°]</text>" in (files / "figures.svg").read_text(encoding="utf-8")


@pytest.mark.parametrize("form", [[], ["--json"]])
def test_numbers_come_before_the_missing_plots(files, monkeypatch, form):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    done = call("eval", *PAIR, "--html", "page.html", *form)
    assert done.returncode == 1
    assert "matplotlib" in done.stderr
    assert (json.loads(done.stdout)["total_rmse_deg"] < 1e-9) if form else ("inclination" in done.stdout)
    assert not (files / "page.html").exists()


@pytest.mark.parametrize(("settle", "max_gap"), [("10", "0.5"), ("10s", "500ms"), ("10 s", "0.5 s")])
def test_times_are_read_with_and_without_their_unit(files, settle, max_gap):
    done = ok("eval", "recording.parquet", "truth.parquet", "--json", "--settle", settle, "--max-gap", max_gap)
    summary = json.loads(done.stdout)
    assert (summary["settings"]["settle_s"], summary["settings"]["max_gap_s"]) == (10.0, 0.5)
    assert summary["samples"]["left_out"] == {"settling": 1000}
    assert "note: recording.parquet holds sensor data: it looks like a recording with its reference" in done.stderr


def turned(track, degrees, **changes):
    """A track that is turned about the vertical, against the clock in ENU."""
    q = quat_multiply(quat_from_euler_zyx(np.radians([degrees, 0.0, 0.0])), track.q_nb)
    return replace(track, q_nb=q, **changes)


def test_a_declination_bridges_magnetic_and_true_north_and_what_is_aligned_is_what_was_asked_for(files, reference):
    """10° east: magnetic north lies clockwise of true north, so true headings are 10° more, yaws in ENU 10° less."""
    io.write("true.parquet", turned(reference, -10.0, north=North.TRUE))
    words = ("eval", "estimate.parquet", "true.parquet", "--json")
    for declination, error in (("10deg", 0.0), ("0 deg", 10.0), ("-10 deg", 20.0), ("-10deg", 20.0)):
        summary = json.loads(ok(*words, "--declination", declination).stdout)
        assert summary["heading_rmse_deg"] == pytest.approx(error, abs=1e-6)
    assert "declination" in refused(*words[:3])
    # A reference turned by 20° about the vertical: an error of heading, unless that is aligned.
    io.write("turned.parquet", turned(reference, 20.0))
    for align, error in (((), 20.0), (("--align", "time"), 20.0), (("--align", " time, heading"), 0.0)):
        summary = json.loads(ok("eval", "estimate.parquet", "turned.parquet", "--json", *align).stdout)
        assert summary["heading_rmse_deg"] == pytest.approx(error, abs=1e-3)
        assert summary["inclination_rmse_deg"] == pytest.approx(0.0, abs=1e-3)


def test_help_needs_no_numpy():
    code = (
        "import sys, contextlib; from plumbob.cli.main import main\n"
        "with contextlib.suppress(SystemExit): main(['--help'])\n"
        "sys.exit('numpy' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, check=False).returncode == 0
