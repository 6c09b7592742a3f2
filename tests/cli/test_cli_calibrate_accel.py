"""plumbob calibrate accel: real processes, real files."""

import json
import math

import numpy as np
import pytest

from plumbob import CalibrationCard, ImuData, ImuMeta
from plumbob import files as io
from plumbob.calibration.acc.poses import normal_gravity
from plumbob.calibration.predicted import REGIONS
from plumbob.core.constants import G0
from plumbob.core.units import deg
from tests.cli.test_cli import GOOD_PARAMS
from tests.helpers.commandline import ok, plumbob, refused
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
    told = ok("calibrate", "accel", files / "poses.parquet", "--out", card).stdout
    assert "18 poses were found at rest" in told
    assert "calibrate mount" in told
    model = CalibrationCard.load(card).acc
    assert model.reference == G0
    seen = symmetric(np.linalg.inv(GAIN)) @ GAIN @ UP  # what is up but for the turn
    words = ("run", files / "rest.parquet", "--filter", "mahony", "--frame", "ENU", "--params", GOOD_PARAMS, "--json")
    with_card, without = (json.loads(ok(*words, *more).stdout) for more in (("--calibration", card), ()))
    # what the filter leaves of the noise of a minute at rest comes on top of the calibration's own error
    assert angle(with_card, seen) < 4.0 * model.quality.tilt_sd + deg(0.02)
    assert angle(without, seen) > deg(1.0)


def angle(report, up):
    last = report["last_attitude_deg"]
    roll, pitch = deg(last["roll"]), deg(last["pitch"])
    told = np.array([-math.sin(pitch), math.cos(pitch) * math.sin(roll), math.cos(pitch) * math.cos(roll)])
    return float(np.arcsin(np.linalg.norm(np.cross(told, up))))


def test_json_and_the_options_of_gravity(files):
    words = ("calibrate", "accel", files / "poses.parquet", "--json")
    plain = json.loads(ok(*words).stdout)
    assert plain["refused"] == []
    assert plain["card"]["acc"]["quality"]["grade"] == "good"
    local = json.loads(ok(*words, "--latitude", "52.5 deg", "--height", "40 m").stdout)["card"]["acc"]
    assert local["reference"] == normal_gravity(deg(52.5), 40.0)
    given = json.loads(ok(*words, "--gravity", "9.8123 m/s2", "--shape", "axes").stdout)["card"]["acc"]
    assert given["reference"] == 9.8123
    assert given["matrix"][0][1] == 0.0


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("--gravity", "9.8"), "needs a unit"),
        (("--gravity", "9.81 g"), "gravity on Earth"),
        (("--gravity", "9.8 m/s2", "--latitude", "50 deg"), "Give one"),
        (("--height", "40 m"), "needs latitude"),
        (("--latitude", "95 deg"), "latitude is from"),
        (("--from", "200s"), "nothing lies"),
    ],
)
def test_options_that_make_no_sense_are_refused(files, words, why):
    assert why in refused("calibrate", "accel", files / "poses.parquet", *words)


def test_level_only_is_refused_and_leaves_no_card(files, tmp_path):
    out = tmp_path / "card.json"
    done = plumbob("calibrate", "accel", files / "level.parquet", "--out", out)
    assert done.returncode == 1
    assert "REFUSED, too-few-regions" in done.stderr
    assert "no pose had +x, −x, +y, −y, −z up" in done.stderr
    assert not out.exists()
    done = plumbob("calibrate", "accel", files / "level.parquet", "--out", out, "--json")
    assert done.returncode == 1
    assert json.loads(done.stdout)["refused"][0]["kind"] == "too-few-regions"


def test_six_wants_six_faces(files):
    done = plumbob("calibrate", "accel", files / "poses.parquet", "--shape", "six")
    assert done.returncode == 1
    assert "18 poses are not the six faces" in done.stderr


def test_values_in_another_unit_than_declared_are_refused(files, tmp_path):
    """1 g written as 1 m/s²."""
    imu = pose_capture(REGIONS)
    table = np.column_stack((imu.t, imu.acc / G0))
    head = "t [s],acc_x [m/s2],acc_y [m/s2],acc_z [m/s2]"
    np.savetxt(tmp_path / "g.csv", table, delimiter=",", header=head, comments="", fmt="%.9g")
    assert refused("calibrate", "accel", tmp_path / "g.csv", "--device", "bench-1")


def test_a_truncated_file_is_refused(files, tmp_path):
    whole = (files / "poses.parquet").read_bytes()
    (tmp_path / "cut.parquet").write_bytes(whole[: len(whole) // 2])
    assert "cut.parquet" in refused("calibrate", "accel", tmp_path / "cut.parquet")
