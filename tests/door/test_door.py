"""The front door: what a verb prints and writes is what the function of the same words gives, from any kind of data."""

import json

import numpy as np
import pytest

import plumbob
from plumbob.calibration.calibrate import KINDS, options_of
from plumbob.core.errors import ParameterError
from tests.battery.commandline import ok

SIM = {"frame": "NED", "sensors": "mpu6000+hmc5983", "module": "drawn"}


@pytest.fixture(scope="module")
def sea(tmp_path_factory):
    file = tmp_path_factory.mktemp("door") / "sea.parquet"
    made = plumbob.simulate("buoy", duration=12.0, seed=1, **(SIM | {"module": "calibrated"}))
    plumbob.write(file, plumbob.Recording(imu=made.imu, track=made.truth))
    return file


@pytest.fixture(scope="module")
def poses(tmp_path_factory):
    file = tmp_path_factory.mktemp("door") / "poses.parquet"
    plumbob.write(file, plumbob.simulate("poses", seed=1, **SIM).imu)
    return file


def test_every_public_name_is_there():
    assert [name for name in plumbob.__all__ if getattr(plumbob, name, None) is None] == []


def test_run_is_estimate(sea, tmp_path):
    printed = json.loads(ok("run", sea, "--filter", "mahony", "--out", tmp_path / "a.parquet", "--json").stdout)
    result = plumbob.estimate(sea, "mahony")
    assert result.summary() == {name: printed[name] for name in result.summary()}
    assert plumbob.read(tmp_path / "a.parquet").track.q_nb.tobytes() == result.track.q_nb.tobytes()
    assert plumbob.evaluate(result, sea).summary()["total_rmse_deg"] == printed["errors"]["total_rmse_deg"]


def test_estimate_takes_files_recordings_and_samples_alike(sea):
    recording = plumbob.read(sea)
    tracks = [plumbob.estimate(given, "mahony").track for given in (sea, str(sea), recording, recording.imu)]
    assert len({track.q_nb.tobytes() for track in tracks}) == 1


def test_notes_come_as_they_are_found_and_stand_in_the_result(sea):
    said, done = [], []
    result = plumbob.estimate(sea, "mekf", note=said.append, progress=lambda *counts: done.append(counts))
    assert tuple(said) == result.notes
    assert isinstance(said, list)
    assert done[0] == (0, 1200) and done[-1] == (1200, 1200)


def test_calibrate_is_calibrate(poses, tmp_path):
    ok("calibrate", "accel", poses, "--out", tmp_path / "card.json")
    found = plumbob.calibrate(poses, "accel")
    ours, theirs = found.card.acc, plumbob.CalibrationCard.load(tmp_path / "card.json").acc
    assert np.array_equal(ours.matrix, theirs.matrix) and np.array_equal(ours.bias, theirs.bias)
    again = plumbob.calibrate(plumbob.read(poses).imu, "mag", calibration=found.card)
    assert set(again.card.parts) == {"acc", "mag"}


def test_units_are_text_or_si(poses):
    by_text, by_number = (plumbob.calibrate(poses, "accel", gravity=given) for given in ("9.81 m/s2", 9.81))
    assert np.array_equal(by_text.card.acc.matrix, by_number.card.acc.matrix)


@pytest.mark.parametrize("kind", KINDS)
def test_an_option_that_a_kind_does_not_have_is_refused_with_those_that_it_has(poses, kind):
    with pytest.raises(ParameterError, match="has no option 'shap'") as refused:
        plumbob.calibrate(poses, kind, shap="auto")
    assert all(name in str(refused.value) for name in options_of(kind))


def test_allan_is_allan(tmp_path):
    still = plumbob.simulate("static", duration=60.0, seed=2, **SIM).imu
    plumbob.write(tmp_path / "rest.parquet", still)
    printed = json.loads(ok("allan", tmp_path / "rest.parquet", "--triads", "gyr", "--json").stdout)
    told = plumbob.allan(tmp_path / "rest.parquet", triads=("gyr",)).summary()
    assert json.loads(json.dumps(told)) == printed
    of_array = plumbob.allan(still.gyr, rate="100 Hz", scale="1 rad/s")
    of_samples = plumbob.allan(still, triads=("gyr",))
    assert [a.sd for a in of_array.analyses] == pytest.approx([a.sd for a in of_samples.analyses], rel=1e-12)


@pytest.mark.parametrize("given", [3, None])
def test_what_is_no_data_is_refused(given):
    for use in (plumbob.read, lambda what: plumbob.calibrate(what, "accel"), plumbob.allan,
                lambda what: plumbob.estimate(what, "mahony")):  # fmt: skip
        with pytest.raises(ParameterError, match="must be the path of a file"):
            use(given)
