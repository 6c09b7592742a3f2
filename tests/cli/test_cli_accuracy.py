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


def test_the_means_stand_together_at_the_end_of_the_text(capsys, folder):
    out = run(capsys, folder, "--filters", "mahony,tilt_compass")[1]
    assert out.splitlines()[-4].startswith("Mean RMSE of 1 trial [°]")
    assert [line.split()[0] for line in out.splitlines()[-2:]] == ["mahony", "tilt_compass"]
    alone = run(capsys, folder, "--filters", "mahony")[1]
    assert alone.splitlines()[-1].split()[0] == "mean"


def test_peers_that_are_absent_are_named_and_the_others_run(capsys, folder, monkeypatch):
    monkeypatch.setitem(sys.modules, "ahrs", None)  # Python's own way to say that there is none
    code, out, _ = run(capsys, folder, "--filters", "mahony", "--peers", "ahrs")
    assert code == 0
    assert "\n- left out: ahrs: " in out


def test_an_unknown_peer_is_one_clear_line(capsys, folder):
    code, out, err = run(capsys, folder, "--filters", "mahony", "--peers", "px4")
    assert (code, out) == (1, "")
    assert "there is no peer 'px4'" in err


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


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--gaps", "five"), "gaps needs their number and length, as 5x1s"),
        (("--wrong-field", "1,2,3uT"), "wrong_field needs field and times"),
        (("--bias", "1,2dps"), "has 2 numbers"),
        (("--bias", "6"), "needs a unit"),
        (("--between", "3s"), "--between needs two times"),
        (("--against", "vqf"), "there is no 'vqf' to compare with"),
        (("--start", "20s"), "there is no motion in it"),
    ],
)
def test_what_cannot_be_done_is_one_clear_line(capsys, folder, words, said):
    code, out, err = run(capsys, folder, "--filters", "mahony", *words)
    assert (code, out) == (1, "")
    assert said in err
