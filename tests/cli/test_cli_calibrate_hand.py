"""plumbob calibrate hand on files."""

import numpy as np
import pytest

from plumbob import CalibrationCard, apply_card
from plumbob import files as io
from plumbob.core.constants import G0
from plumbob.rotations import Frame, quat_conjugate, quat_rotate
from tests.helpers.commandline import answer, typed

UNIT = "--frame NED --sensors mpu6000+hmc5983 --unit random --seed 5"
SLOWLY = "--set number=24,move=2s,mag_rate=20Hz"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Captures of one unit: by hand, and of turning level; and the card of the first."""
    folder = tmp_path_factory.mktemp("hand")
    typed(f"sim poses {UNIT} {SLOWLY} --out poses.parquet --card truth.json", cwd=folder)
    typed(f"sim levelring {UNIT} --duration 20s --out ring.parquet", cwd=folder)
    typed("calibrate hand poses.parquet --strength '50 uT' --out card.json", cwd=folder)
    return folder


def test_one_capture_gives_the_whole_card(folder):
    card, truth = (CalibrationCard.load(folder / name) for name in ("card.json", "truth.json"))
    assert list(card.parts) == list(truth.parts) == ["gyr", "acc", "mag"]
    # the hand finds no g-sensitivity, so the sheet's 0.1 °/s/g along each axis may stand in the gyroscope's bias
    for name, slack in (("acc", 0.0), ("mag", 0.0), ("gyr", np.radians(0.1) * np.sqrt(3.0))):
        off = getattr(card, name).bias - getattr(truth, name).bias
        assert (np.abs(off) < 5.0 * getattr(card, name).bias_sd + slack).all(), name


def test_hand_and_mounting_give_the_horizon_of_the_body(folder, tmp_path):
    """Poses leave a turn of the axes open, which the mounting takes; then gravity is where it is, in any pose."""
    hand = folder / "card.json"
    typed(f"sim raise {UNIT} --out raise.parquet", cwd=tmp_path)
    typed(f"calibrate mount raise.parquet --frame NED --calibration {hand} --out card.json", cwd=tmp_path)
    typed(f"sim bands {UNIT} --out bands.parquet", cwd=tmp_path)
    card = CalibrationCard.load(tmp_path / "card.json")
    without, mounted = (tilt_errors(tmp_path / "bands.parquet", each) for each in (CalibrationCard.load(hand), card))
    noise = 4e-3 * np.sqrt(2.0 / 200.0)  # 0.4 mg/√Hz by the sheet, at 100 Hz, on two axes, in a mean of 200
    assert mounted.max() < 4.0 * np.sqrt(card.acc.quality.tilt_sd**2 + np.square(card.mount.sd).sum() + noise**2)
    assert without.max() > 2.0 * mounted.max()


def tilt_errors(path, card):
    """Angles between measured and true vertical, one for each pose."""
    recording = io.read(path)
    imu, truth = apply_card(card, recording.imu), recording.track
    rests = [slice(first + 50, first + 250) for first in range(0, len(imu), 400)]  # 2 of 3 s, after each move of 1 s
    force = np.array([imu.acc[rest].mean(axis=0) for rest in rests])
    up = np.array([quat_rotate(quat_conjugate(truth.q_nb[rest.start]), Frame.NED.up) for rest in rests])
    return np.arctan2(np.linalg.norm(np.cross(force, up), axis=1), (force * up).sum(axis=1))


def test_what_the_recording_lacks_is_said_and_turning_level_is_refused(tmp_path, folder):
    unit = UNIT.replace("+hmc5983", "")
    typed(f"sim poses {unit} --set number=18 --out nomag.parquet", cwd=tmp_path)
    report = answer("calibrate hand nomag.parquet", cwd=tmp_path)
    assert (report["card"]["mag"], set(report["remarks"])) == (None, {"acc", "gyr"})
    card = tmp_path / "card.json"
    done = typed(f"calibrate hand ring.parquet --out {card}", cwd=folder, code=1)
    assert ("REFUSED, too-few-regions" in done.stderr, card.exists()) == (True, False)


def test_the_place_tells_gravity_and_field(folder):
    pytest.importorskip("pygeomag", reason="the extra geomag is not installed")
    typed(f"sim poses {UNIT} {SLOWLY},strength=31.8uT,dip=-30deg --out equator.parquet", cwd=folder)
    card = answer("calibrate hand equator.parquet --place 0,0", cwd=folder)["card"]
    assert card["acc"]["reference"] == pytest.approx(9.7803253359, abs=1e-10)  # at the equator, by GRS 80 and WGS 84
    assert 30.0 < card["mag"]["reference"] < 33.0  # 31.8 µT at 0° N 0° E in 2025 by the World Magnetic Model
    given = answer("calibrate hand poses.parquet --gravity '9.81 m/s2'", cwd=folder)["card"]
    assert (given["acc"]["reference"], CalibrationCard.load(folder / "card.json").acc.reference) == (9.81, G0)
