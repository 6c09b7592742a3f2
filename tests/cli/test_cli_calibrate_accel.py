"""plumbob calibrate accel on files."""

import math

import numpy as np
import pytest

from plumbob import CalibrationCard, ImuData, ImuMeta
from plumbob import files as io
from plumbob.calibration.acc import normal_gravity
from plumbob.calibration.predicted import REGIONS
from plumbob.core.constants import G0
from plumbob.core.units import deg
from tests.helpers.commandline import answer, refused, typed
from tests.helpers.pose_capture import BIAS, GAIN, NOISE, pose_capture, symmetric

UP = np.array([0.2, -0.35, 0.9]) / np.linalg.norm([0.2, -0.35, 0.9])


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Captures of 18 poses and of a level unit, and a minute at rest in another attitude."""
    folder = tmp_path_factory.mktemp("accel")
    io.write(folder / "poses.parquet", pose_capture(REGIONS))
    io.write(folder / "level.parquet", pose_capture(np.tile([0.0, 0.0, 1.0], (6, 1))))
    rng = np.random.default_rng(9)
    acc = G0 * GAIN @ UP + BIAS + NOISE * rng.standard_normal((6000, 3))
    io.write(folder / "rest.parquet", ImuData(t=0.01 * np.arange(6000), acc=acc, gyr=np.zeros((6000, 3)), meta=META))
    return folder


META = ImuMeta(device="bench-1")


def test_from_a_capture_to_a_right_horizon(files, tmp_path):
    """Lengths leave a turn of the axes free; but for that, the inclination is right, and without the card it is not."""
    card = tmp_path / "card.json"
    assert "18 poses were found at rest" in typed(f"calibrate accel poses.parquet --out {card}", cwd=files).stdout
    model = CalibrationCard.load(card).acc
    assert model.reference == G0
    seen = symmetric(np.linalg.inv(GAIN)) @ GAIN @ UP  # what is up but for the turn
    words = "run rest.parquet --filter mahony --frame ENU --params kp=0.5,ki=0.03,gate=off"
    with_card, without = (answer(words, *more, cwd=files) for more in (("--calibration", card), ()))
    # what the filter leaves of the noise of a minute at rest comes on top of the calibration's own error
    assert angle(with_card, seen) < 4.0 * model.quality.tilt_sd + deg(0.02)
    assert angle(without, seen) > deg(1.0)


def angle(report, up):
    last = report["last_attitude_deg"]
    roll, pitch = deg(last["roll"]), deg(last["pitch"])
    told = np.array([-math.sin(pitch), math.cos(pitch) * math.sin(roll), math.cos(pitch) * math.cos(roll)])
    return float(np.arcsin(np.linalg.norm(np.cross(told, up))))


def test_json_and_the_options_of_gravity(files):
    words = "calibrate accel poses.parquet"
    plain = answer(words, cwd=files)
    assert (plain["refused"], plain["card"]["acc"]["quality"]["grade"]) == ([], "good")
    local = answer(f"{words} --latitude '52.5 deg' --height '40 m'", cwd=files)["card"]["acc"]
    assert local["reference"] == normal_gravity(deg(52.5), 40.0)
    given = answer(f"{words} --gravity '9.8123 m/s2' --shape axes", cwd=files)["card"]["acc"]
    assert given["reference"] == 9.8123
    assert given["matrix"][0][1] == 0.0


def test_level_only_and_another_unit_than_declared_are_refused_and_leave_no_card(files, tmp_path):
    out = tmp_path / "card.json"
    refusal = answer(f"calibrate accel level.parquet --out {out}", cwd=files, code=1)
    assert refusal["refused"][0]["kind"] == "too-few-regions"
    assert "REFUSED, too-few-regions" in typed(f"calibrate accel level.parquet --out {out}", cwd=files, code=1).stderr
    assert not out.exists()
    six = answer("calibrate accel poses.parquet --shape six", cwd=files, code=1)
    assert "18 poses are not the six faces" in str(six["refused"])
    # 1 g written as 1 m/s²
    imu = pose_capture(REGIONS)
    table = np.column_stack((imu.t, imu.acc / G0))
    head = "t [s],acc_x [m/s2],acc_y [m/s2],acc_z [m/s2]"
    np.savetxt(tmp_path / "g.csv", table, delimiter=",", header=head, comments="", fmt="%.9g")
    assert refused("calibrate", "accel", tmp_path / "g.csv", "--device", "bench-1")
