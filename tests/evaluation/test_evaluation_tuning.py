"""Tuning: a known optimum is found, what does not generalise is said, and nothing is promised from one recording."""

import json
import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from plumbob import Frame, Recording, estimate, evaluate, files, simulate, tune
from plumbob.core.errors import DecodeError, ParameterError, ShapeError
from plumbob.core.params import describe
from plumbob.filters import load
from plumbob.fleet.experiments import tuning
from plumbob.fleet.experiments.tuning import Range
from tests.helpers.commandline import call, ok, refused


def recording(seed, *, duration=12.0, sensors="mpu6000+hmc5983"):
    run = simulate("buoy", frame=Frame.ENU, sensors=sensors, unit="calibrated", seed=seed, duration=duration)
    return Recording(imu=run.imu, track=run.truth, name=f"buoy {seed}")


@pytest.fixture(scope="module")
def several():
    return [recording(seed) for seed in range(1, 6)]


@pytest.fixture(scope="module")
def found(several):
    return tune(several, "madgwick", metric="inclination", budget=24)


@pytest.fixture(scope="module")
def folder(tmp_path_factory, several):
    place = tmp_path_factory.mktemp("trials")
    for one in several:
        files.write(place / f"{one.name.replace(' ', '_')}.parquet", one)
    return place


def error(one, values):
    track = estimate(one.imu, filter="madgwick", params=values, frame=Frame.ENU)
    return evaluate(track, one.track).summary()["inclination_rmse_deg"]


def test_the_optimum_is_that_of_a_wide_scan(several, found):
    """40 values of beta over its range; the mean of logarithms of the errors that `evaluate` gives."""
    scan = np.geomspace(0.041 / 100.0, 4.1, 40)
    means = [np.mean([math.log(error(one, {"beta": float(beta)})) for one in several]) for beta in scan]
    best = float(scan[int(np.argmin(means))])
    step = scan[1] / scan[0]
    (beta,) = found.parameters
    assert best / step < beta.value < best * step
    assert math.log(found.train_tuned_deg) < min(means) + 0.005


def test_errors_are_those_that_evaluate_gives_and_the_same_once_more(several, found):
    (beta,) = found.parameters
    for one, row in zip(several, found.recordings, strict=True):
        assert row.default_deg == pytest.approx(error(one, {}), rel=1e-9)
        assert row.fitted_deg == pytest.approx(error(one, {"beta": beta.value}), rel=1e-9)
        assert row.tuned_deg == pytest.approx(error(one, {"beta": beta.folds[row.fold - 1]}), rel=1e-9)
    again = tune(several, "madgwick", metric="inclination", budget=24)
    assert again.summary() == found.summary()


@pytest.mark.parametrize("metric", tuning.METRICS)
def test_every_metric_and_alignment_is_that_of_evaluate_and_fitting_is_never_worse_than_the_defaults(several, metric):
    one = several[0]
    for align in ((), ("heading",)):
        got = tune([one], "mahony", metric=metric, budget=4, align=align)
        track = estimate(one.imu, filter="mahony", params=got.params, frame=Frame.ENU)
        told = evaluate(track, one.track, align=align).summary()[f"{metric}_rmse_deg"]
        assert got.recordings[0].fitted_deg == pytest.approx(told, rel=1e-9)
        assert got.train_tuned_deg <= got.train_default_deg


def test_a_gain_that_generalises_is_shown(found):
    """Its interval is Student's of pairs: of the five changes' logarithms, with t(0.975, 4) = 2.7764."""
    assert found.proven
    assert found.gain[1] < found.gain[0] < found.gain[2] < 0.0
    assert found.held_tuned_deg < found.held_default_deg
    default, tuned = (np.log([getattr(row, of) for row in found.recordings]) for of in ("default_deg", "tuned_deg"))
    change = tuned - default
    half = 2.776445 * np.std(change, ddof=1) / math.sqrt(5.0)
    assert found.held_default_deg == pytest.approx(math.exp(default.mean()))
    assert found.held_tuned_deg == pytest.approx(math.exp(tuned.mean()))
    assert found.gain == pytest.approx(np.expm1(change.mean() + half * np.array([0.0, -1.0, 1.0])), rel=1e-5)


def test_what_only_noise_prefers_is_not_a_gain():
    """The rest detector's waiting time does nothing on a buoy in motion: whatever is fitted, nothing is gained."""
    several = [recording(seed, duration=8.0) for seed in range(1, 5)]
    got = tune(several, "vqf", params=["mag_reject", "rest_after"], budget=8)
    assert not got.proven and got.verdict().startswith("Keep the defaults")


def test_groups_are_held_out_together(several):
    of = [
        replace(one, imu=one.imu.corrected(meta=replace(one.imu.meta, device=device)))
        for one, device in zip(several, "aabb", strict=False)
    ]
    got = tune(of, "madgwick", budget=4, group_by="device")
    assert (got.folds, [row.fold for row in got.recordings]) == (2, [1, 1, 2, 2])
    assert tune(of[:2], "madgwick", budget=4, group_by="device").folds == 0  # one device: nothing is left to hold out
    dealt, again = ([row.fold for row in tune(several, "madgwick", budget=4, folds=2).recordings] for _ in range(2))
    assert sorted(dealt) in ([1, 1, 1, 2, 2], [1, 1, 2, 2, 2])
    assert dealt == again


def test_a_held_out_recording_does_not_move_what_is_held_out_against_it(several):
    """A fold's parameters are those of the others alone, to the bit."""
    odd = several[2].imu.corrected(meta=several[2].imu.meta, gyr=several[2].imu.gyr + 0.03)  # a bias wants a large gain
    got = tune([*several[:2], replace(several[2], imu=odd)], "madgwick", metric="inclination", budget=16)
    alone = tune(several[:2], "madgwick", metric="inclination", budget=16)
    assert not got.skipped, got.skipped
    assert got.parameters[0].folds[2] == alone.parameters[0].value
    assert got.parameters[0].value != alone.parameters[0].value  # else this would show nothing


def test_one_recording_promises_nothing(several, tmp_path):
    got = tune(several[0], "madgwick", budget=8)
    assert (got.folds, got.gain, got.gap, got.proven) == (0, None, None, False)
    assert all(it in got.text() for it in ("Nothing can be said of other recordings", "none: nothing can be held out"))
    with pytest.raises(ParameterError, match=r"is not written\. Nothing can be said"):
        got.write(tmp_path / "p.toml")
    assert not (tmp_path / "p.toml").exists()
    assert got.write(tmp_path / "p.toml", unproven=True).is_file()


def test_places_of_a_range_are_even_in_logarithms_and_one_at_its_end_is_said(several):
    beta = next(p for p in describe(load("madgwick").Params) if p.name == "beta")
    one = Range(beta, 0.01, 1.0)
    assert (one.value_at(0.5), one.place(0.1)) == (pytest.approx(0.1), pytest.approx(0.5))
    bare = Recording(imu=several[0].imu, track=None, name="bare")
    low = ["beta=1e-5 1/s..1e-4 1/s"]
    got = tune([*several[:2], bare], "madgwick", params=low, budget=8, metric="inclination")
    assert (got.parameters[0].at_end, set(got.skipped)) == ("high", {"bare"})


@pytest.mark.parametrize(("settings", "words"), [
    ({"params": ["zeta"]}, "zeta is 0 1/s by default, so that its range must be given"),
    ({"params": ["gain"]}, "has no parameter 'gain' that could be tuned; it has beta, zeta"),
    ({"params": ["beta=1"]}, "a range must be written as beta=LOW..HIGH"),
    ({"params": ["beta=2 1/s..1 1/s"]}, "must rise from above 0"),
    ({"params": ["beta", "beta"]}, "beta is named twice"),
    ({"params": ["beta"], "fixed": {"beta": 0.1}}, "both to be tuned and given"),
    ({"fixed": {"gain": 1.0}}, "has no parameter 'gain'"),
    ({"budget": 1}, "budget must be a whole number of at least 4"),
    ({"folds": 9}, "there are only 2"),
    ({"metric": "yaw"}, "metric must be one of"),
    ({"group_by": "moon"}, "group_by must be one of"),
])  # fmt: skip
def test_wrong_settings_are_refused_with_what_to_do(several, settings, words):
    with pytest.raises((ParameterError, ShapeError), match=words):
        tune(several[:2], "madgwick", **{"budget": 4, **settings})
    bare = Recording(imu=several[0].imu, track=None, name="bare")
    with pytest.raises(DecodeError, match="no recording with sensor data and a reference"):
        tune(bare, "madgwick", budget=4)


def test_the_command_line_writes_what_run_reads(folder, tmp_path):
    out, page, track = (tmp_path / name for name in ("tuned.toml", "tuned.html", "t.parquet"))
    how = ("--filter", "madgwick", "--metric", "inclination", "--budget", "12")
    ok("benchmark", "tune", folder, *how, "--out", out, "--html", page)
    assert page.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    content = out.read_text(encoding="utf-8")
    assert content.count("sha256 ") == 5
    assert set(tomllib.loads(content)) == {"madgwick"}
    ok("run", sorted(folder.iterdir())[0], "--filter", "madgwick", "--params", out, "--out", track)
    beta = tomllib.loads(content)["madgwick"]["beta"].split()[0]
    assert f"beta={beta}" in files.read(track).track.source
    for filter_ in ("madgwick", "nothing"):
        refused("benchmark", "tune", tmp_path / "empty", "--filter", filter_)


def test_exit_code_3_where_nothing_is_shown_and_no_file_is_written(folder, tmp_path):
    out = tmp_path / "tuned.toml"
    words = ("benchmark", "tune", sorted(folder.iterdir())[0], "--filter", "madgwick", "--budget", "4", "--out", out)
    assert call(*words).returncode == 3
    assert not out.exists()
    done = call(*words, "--unproven", "--json")
    assert (done.returncode, json.loads(done.stdout)["gain"]) == (3, None)
    assert "Nothing can be said of other recordings" in out.read_text(encoding="utf-8")
    assert call(*words, "--unproven").returncode == 1  # it exists
