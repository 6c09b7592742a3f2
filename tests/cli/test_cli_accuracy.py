"""plumbob benchmark accuracy with other libraries, as a user meets it."""

import json
import sys

import pytest

from plumbob import Frame, files
from plumbob.cli.main import main
from plumbob.simulation import simulate


@pytest.fixture
def folder(tmp_path):
    run = simulate("buoy", frame=Frame.ENU, sensors="ideal", unit="calibrated", seed=1, duration=10.0)
    files.write(tmp_path / "a.parquet", files.Recording(imu=run.imu, track=run.truth, name="a"))
    return str(tmp_path)


def run(capsys, *words):
    """Exit code, standard output and standard error."""
    code = main(["benchmark", "accuracy", *words])
    return code, *capsys.readouterr()


def test_json_has_the_peers_beside_our_filters(capsys, folder):
    pytest.importorskip("vqf")
    code, out, _ = run(capsys, folder, "--filters", "mahony,integrate", "--peers", "vqf", "--json")
    found = json.loads(out)
    assert code == 0
    parts = {"settings", "align", "calibration", "trials", "mean", "skipped", "absent"}
    assert set(found) == parts | {"changes", "folders", "coverage", "against", "differences", "better"}
    names = {"mahony", "integrate", "vqf.VQF", "vqf.BasicVQF", "vqf.offlineVQF"}
    assert set(found["settings"]) == set(found["trials"]["a"]) == set(found["mean"]) == names
    keys = {"total_rmse_deg", "heading_rmse_deg", "inclination_rmse_deg"}
    assert all(set(errors) == keys for errors in found["mean"].values())
    assert found["absent"] == {}


def test_peers_that_are_absent_are_named_and_the_others_run(capsys, folder, monkeypatch):
    monkeypatch.setitem(sys.modules, "ahrs", None)  # Python's own way to say that there is none
    code, out, _ = run(capsys, folder, "--filters", "mahony", "--peers", "ahrs")
    assert code == 0
    assert "\n- left out: ahrs: " in out


def test_a_change_is_made_and_named_and_the_estimators_are_compared(capsys, folder):
    words = (folder, "--filters", "mekf,vqf", "--against", "mekf", "--bias", "1dps", "--no-mag")
    out = run(capsys, *words, "--align", "heading", "--calibrated")[1]
    assert "changed     bias 1dps, no_mag, seed 1" in out
    lines = out.splitlines()
    head, trial, _, better = lines[
        (at := lines.index("Total RMSE of mekf, and what others have more [°]") + 1) : at + 4
    ]
    assert head.split() == ["mekf", "vqf"]
    assert better.split() == ["better", "in", "1" if trial.split()[-1].startswith("-") else "0", "of", "1"]


def test_a_start_behind_the_end_leaves_no_motion(capsys, folder):
    code, out, err = run(capsys, folder, "--filters", "mahony", "--start", "20s")
    assert (code, out, "there is no motion in it" in err) == (1, "", True)
