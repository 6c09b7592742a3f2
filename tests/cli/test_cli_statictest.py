"""plumbob calibrate statictest as a user meets it, from captures to JSON and page."""

import math

import pytest

from plumbob.data.cards import CalibrationCard
from tests.helpers.commandline import answer, typed

UNIT = "--frame NED --sensors mpu6000+hmc5983 --unit random --seed 3 --rate 20Hz"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("statictest")
    typed(f"sim table36 {UNIT} --out a.parquet --card card.json", cwd=folder)
    return folder


def test_triads_that_the_card_leaves_uncalibrated_are_named_and_the_reference_may_be_elsewhere(folder):
    typed("calibrate statictest a.parquet --calibration card.json --html whole.html", cwd=folder)
    CalibrationCard.load(folder / "card.json").without("gyr", "mag").save(folder / "acc.json")
    typed("calibrate statictest a.parquet --calibration acc.json --html acc.html", cwd=folder)
    pages = [(folder / f"{name}.html").read_text() for name in ("whole", "acc")]
    assert ["NOT calibrated: gyr, mag" in page for page in pages] == [False, True]
    assert [page.count("<svg") for page in pages] == [1, 1]
    typed("sim table36 --frame NED --rate 20Hz --out truth.parquet", cwd=folder)
    report = answer("calibrate statictest a.parquet --reference truth.parquet --calibration card.json", cwd=folder)
    for figures in report["summary"].values():
        assert figures["max_after_deg"] < 0.25  # a perfect card leaves the noise
        assert figures["max_before_deg"] > 1.0


def test_from_captures_by_hand_to_the_static_test(folder):
    typed(f"sim faces {UNIT} --set edges=on,wobble=3deg --out faces.parquet", cwd=folder)
    typed("calibrate accel faces.parquet --out hand-acc.json", cwd=folder)
    typed("calibrate mag faces.parquet --calibration hand-acc.json --out hand.json", cwd=folder)
    summary = answer("calibrate statictest a.parquet --calibration hand.json --align mounting", cwd=folder)["summary"]
    # poses show the accelerometer no turn of its own, which --align mounting takes off; what is left are the predicted
    # errors of both triads and the noise of a rest: 0.2 µT over the level 32 µT, of 45 samples, 0.05°
    card = CalibrationCard.load(folder / "hand.json")
    sd = math.degrees(math.hypot(card.mag.quality.heading_sd, card.acc.quality.tilt_sd, 0.2 / 32.0 / math.sqrt(45)))
    assert max(figures["max_after_deg"] for figures in summary.values()) < 4.0 * sd
    assert summary["yaw"]["max_before_deg"] > 10.0 * sd
