"""plumbob calibrate hand: real processes, real files."""

import json

import numpy as np
import pytest

from plumbob import files as io
from plumbob.core.constants import G0
from plumbob.data.calibrated import apply_card
from plumbob.data.cards import CalibrationCard
from plumbob.rotations import Frame, quat_conjugate, quat_rotate
from tests.helpers.commandline import ok, plumbob, refused

UNIT = ("--frame", "NED", "--sensors", "mpu6000+hmc5983", "--unit", "random", "--seed", 5)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Captures of one unit: by hand, and of turning level."""
    folder = tmp_path_factory.mktemp("hand")
    slowly = ("--set", "number=24,move=2s,mag_rate=20Hz")
    ok("sim", "poses", *UNIT, *slowly, "--out", folder / "poses.parquet", "--card", folder / "truth.json")
    ok("sim", "levelring", *UNIT, "--duration", "20s", "--out", folder / "ring.parquet")
    return folder


def test_one_capture_gives_the_whole_card(files, tmp_path):
    card = tmp_path / "card.json"
    told = ok("calibrate", "hand", files / "poses.parquet", "--strength", "50 uT", "--out", card).stdout
    assert "24 poses were found at rest" in told
    assert "against the accelerometer" in told
    assert "NOT in this card" not in told
    found, truth = CalibrationCard.load(card), CalibrationCard.load(files / "truth.json")
    assert list(found.parts) == list(truth.parts) == ["gyr", "acc", "mag"]
    # the hand finds no g-sensitivity, so the sheet's 0.1 °/s/g along each axis may stand in the gyroscope's bias
    for name, slack in (("acc", 0.0), ("mag", 0.0), ("gyr", np.radians(0.1) * np.sqrt(3.0))):
        off = getattr(found, name).bias - getattr(truth, name).bias
        assert (np.abs(off) < 5.0 * getattr(found, name).bias_sd + slack).all(), name


def test_hand_and_mounting_give_the_horizon_of_the_body(files, tmp_path):
    """Poses leave a turn of the axes open, which the mounting takes; then gravity is where it is, in any pose."""
    hand, card = tmp_path / "hand.json", tmp_path / "card.json"
    ok("calibrate", "hand", files / "poses.parquet", "--out", hand)
    ok("sim", "raise", *UNIT, "--out", tmp_path / "raise.parquet")
    ok("calibrate", "mount", tmp_path / "raise.parquet", "--frame", "NED", "--calibration", hand, "--out", card)
    ok("sim", "bands", *UNIT, "--out", tmp_path / "bands.parquet")
    without, whole = (tilt_errors(tmp_path / "bands.parquet", CalibrationCard.load(one)) for one in (hand, card))
    found = CalibrationCard.load(card)
    noise = 4e-3 * np.sqrt(2.0 / 200.0)  # 0.4 mg/√Hz by the sheet, at 100 Hz, on two axes, in a mean of 200
    assert whole.max() < 4.0 * np.sqrt(found.acc.quality.tilt_sd**2 + np.square(found.mount.sd).sum() + noise**2)
    assert without.max() > 2.0 * whole.max()


def tilt_errors(path, card):
    """Angles between measured and true vertical, one for each pose."""
    recording = io.read(path)
    imu, truth = apply_card(card, recording.imu), recording.track
    rests = [slice(first + 50, first + 250) for first in range(0, len(imu), 400)]  # 2 of 3 s, after each move of 1 s
    force = np.array([imu.acc[rest].mean(axis=0) for rest in rests])
    up = np.array([quat_rotate(quat_conjugate(truth.q_nb[rest.start]), Frame.NED.up) for rest in rests])
    return np.arctan2(np.linalg.norm(np.cross(force, up), axis=1), (force * up).sum(axis=1))


def test_what_the_recording_lacks_is_said(files, tmp_path):
    no_mag = tmp_path / "nomag.parquet"
    ok("sim", "poses", "--frame", "NED", "--sensors", "mpu6000", "--unit", "random", "--set", "number=18", "--seed", 5,
       "--out", no_mag)  # fmt: skip
    done = ok("calibrate", "hand", no_mag, "--json")
    assert "note: the recording has no magnetometer, which is left out" in done.stderr
    told = json.loads(done.stdout)
    assert told["card"]["mag"] is None
    assert set(told["remarks"]) == {"acc", "gyr"}


def test_turning_level_is_refused_and_no_card_is_written(files, tmp_path):
    card = tmp_path / "card.json"
    done = plumbob("calibrate", "hand", files / "ring.parquet", "--out", card)
    assert done.returncode == 1
    assert "REFUSED, too-few-regions" in done.stderr
    assert "accelerometer: no pose had" in done.stderr
    assert not card.exists()


def test_the_place_tells_gravity_and_field(files):
    pytest.importorskip("pygeomag", reason="the extra geomag is not installed")
    words = ("calibrate", "hand", files / "poses.parquet", "--json")
    there = ("--set", "number=24,move=2s,mag_rate=20Hz,strength=31.8uT,dip=-30deg")
    ok("sim", "poses", *UNIT, *there, "--out", files / "equator.parquet")
    told = json.loads(ok("calibrate", "hand", files / "equator.parquet", "--json", "--place", "0,0").stdout)["card"]
    assert told["acc"]["reference"] == pytest.approx(9.7803253359, abs=1e-10)  # at the equator, by GRS 80 and WGS 84
    assert 30.0 < told["mag"]["reference"] < 33.0  # 31.8 µT at 0° N 0° E in 2025 by the World Magnetic Model
    assert json.loads(ok(*words, "--gravity", "9.81 m/s2").stdout)["card"]["acc"]["reference"] == 9.81
    assert json.loads(ok(*words).stdout)["card"]["acc"]["reference"] == G0
    assert "Give one" in refused("calibrate", "hand", files / "poses.parquet", "--place", "0,0", "--latitude", "0 deg")
