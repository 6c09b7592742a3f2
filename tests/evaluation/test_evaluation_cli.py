"""plumbob eval as a user meets it; the exit codes and one-line errors that all verbs share are tested with them."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from plumbob import ImuData
from plumbob import files as io
from plumbob.cli.main import main
from plumbob.files import Recording
from plumbob.rotations import North, quat_from_euler_zyx, quat_multiply


@pytest.fixture
def files(reference, tmp_path, monkeypatch):
    """An estimate, a reference, and a recording with that reference, in the working directory."""
    monkeypatch.chdir(tmp_path)
    imu = ImuData(t=reference.t, gyr=np.zeros((len(reference), 3)))
    io.write("estimate.parquet", reference)
    io.write("truth.parquet", reference)
    io.write("recording.parquet", Recording(imu=imu, track=reference))
    return tmp_path


def run(capsys, *words):
    """Exit code, standard output and standard error."""
    code = main(["eval", *words])
    return code, *capsys.readouterr()


def refused(capsys, *words):
    code, out, err = run(capsys, *words)
    assert (code, out) == (1, "")
    assert err.count("\n") == 1
    return err


@pytest.mark.parametrize("again", ["truth.parquet", "./truth.parquet", "link.parquet"])
def test_a_file_is_not_judged_by_itself(files, capsys, again):
    (files / "link.parquet").symlink_to("truth.parquet")
    assert "both estimate and reference" in refused(capsys, "truth.parquet", again)


def test_a_recording_in_place_of_the_estimate_is_remarked(files, capsys):
    remark = "note: recording.parquet holds sensor data: it looks like a recording with its reference"
    assert remark in run(capsys, "recording.parquet", "truth.parquet")[2]
    assert remark not in run(capsys, "estimate.parquet", "recording.parquet")[2]


@pytest.mark.parametrize("name", ["page.parquet", "page"])
def test_a_page_has_the_name_of_a_page(files, capsys, name):
    assert ".html or .htm" in refused(capsys, "estimate.parquet", "truth.parquet", "--html", name)
    assert not (files / name).exists()


def test_page_and_figures_in_chinese(files, capsys):
    words = ("estimate.parquet", "truth.parquet", "--html", "page.html", "--plot", "figures.svg", "--lang", "zh")
    code, out, _ = run(capsys, *words)
    assert code == 0
    assert out.splitlines()[-2:] == ["page         page.html", "figures      figures.svg"]
    assert "总误差</th>" in (files / "page.html").read_text(encoding="utf-8")
    assert ">总误差 [°]</text>" in (files / "figures.svg").read_text(encoding="utf-8")
    assert "--lang is for --html or --plot" in refused(capsys, "estimate.parquet", "truth.parquet", "--lang", "zh")


def test_a_page_does_not_replace_an_input(files, capsys):
    before = (files / "truth.parquet").read_bytes()
    assert "is an input" in refused(capsys, "estimate.parquet", "truth.parquet", "--html", "./truth.parquet")
    assert (files / "truth.parquet").read_bytes() == before


@pytest.mark.parametrize("name", ["page.html", "page.HTM"])
def test_a_page_is_written(files, capsys, name):
    code, out, _ = run(capsys, "estimate.parquet", "truth.parquet", "--html", name)
    assert code == 0
    assert out.endswith(f"page         {name}\n")
    assert (files / name).read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


@pytest.mark.parametrize("form", [[], ["--json"]])
def test_numbers_come_before_the_missing_plots(files, capsys, monkeypatch, form):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    code, out, err = run(capsys, "estimate.parquet", "truth.parquet", "--html", "page.html", *form)
    assert code == 1
    assert "matplotlib" in err
    assert (json.loads(out)["total_rmse_deg"] < 1e-9) if form else ("inclination" in out)
    assert not (files / "page.html").exists()


@pytest.mark.parametrize(("settle", "max_gap"), [("10", "0.5"), ("10s", "500ms"), ("10 s", "0.5 s")])
def test_times_are_read_with_and_without_their_unit(files, capsys, settle, max_gap):
    words = ("estimate.parquet", "truth.parquet", "--json", "--settle", settle, "--max-gap", max_gap)
    summary = json.loads(run(capsys, *words)[1])
    assert summary["settings"]["settle_s"] == 10.0
    assert summary["settings"]["max_gap_s"] == 0.5
    assert summary["samples"]["left_out"] == {"settling": 1000}


def turned(track, degrees, **changes):
    """A track that is turned about the vertical, against the clock in ENU."""
    q = quat_multiply(quat_from_euler_zyx(np.radians([degrees, 0.0, 0.0])), track.q_nb)
    return replace(track, q_nb=q, **changes)


def test_a_declination_bridges_magnetic_and_true_north(files, capsys, reference):
    """10° east: magnetic north lies clockwise of true north, so true headings are 10° more, yaws in ENU 10° less."""
    io.write("true.parquet", turned(reference, -10.0, north=North.TRUE))
    words = ("estimate.parquet", "true.parquet", "--json")
    for declination, error in (("10deg", 0.0), ("0 deg", 10.0), ("-10 deg", 20.0), ("-10deg", 20.0)):
        summary = json.loads(run(capsys, *words, "--declination", declination)[1])
        assert summary["heading_rmse_deg"] == pytest.approx(error, abs=1e-6)
    assert "declination" in refused(capsys, *words[:2])


def test_what_is_aligned_is_what_was_asked_for(files, capsys, reference):
    """A reference turned by 20° about the vertical: an error of heading, unless that is aligned."""
    io.write("turned.parquet", turned(reference, 20.0))
    words = ("estimate.parquet", "turned.parquet", "--json")
    for align, error in (((), 20.0), (("--align", "time"), 20.0), (("--align", " time, heading"), 0.0)):
        summary = json.loads(run(capsys, *words, *align)[1])
        assert summary["heading_rmse_deg"] == pytest.approx(error, abs=1e-3)
        assert summary["inclination_rmse_deg"] == pytest.approx(0.0, abs=1e-3)
    assert "north" in refused(capsys, *words[:2], "--align", "heading,north")


def test_a_time_in_another_unit_is_refused(files, capsys):
    assert "not a unit of time" in refused(capsys, "estimate.parquet", "truth.parquet", "--settle", "10deg")


def test_help_needs_no_numpy():
    code = (
        "import sys, contextlib; from plumbob.cli.main import main\n"
        "with contextlib.suppress(SystemExit): main(['eval', '--help'])\n"
        "sys.exit('numpy' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, check=False).returncode == 0
