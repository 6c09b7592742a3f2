"""From fits to a card: remarks stay with what they are about."""

from dataclasses import replace

import numpy as np
import pytest

from plumbob.calibration.calibration import Capture, card_of
from plumbob.calibration.fit import Fitted
from plumbob.calibration.mount import Mounted
from plumbob.data import ImuData, ImuMeta
from plumbob.data.cards import UNITS, CalibrationCard, Mount, TriadCalibration

STALE = (
    "It was found with the axes that the accelerometer had before its calibration of 2026-11-21: calibrate it again."
)


def fitted(name, *, gain=1.01, remarks=()):
    model = TriadCalibration(gain * np.eye(3), np.zeros(3), UNITS[name], UNITS[name], method=f"{name} known")
    return Fitted(model, np.zeros((1, 3)), np.zeros(1), np.ones(1, dtype=bool), remarks)


def captured(base=None):
    imu = ImuData(t=[0.0, 1.0], acc=np.full((2, 3), 5.0), meta=ImuMeta(device="unit 7"))
    return Capture(imu, "unit 7", base, "2026-11-21")


MOUNTED = Mounted(Mount([1.0, 0.0, 0.0, 0.0]), ("nothing shows the heading.",))


def test_remarks_of_fits_and_of_a_mounting_are_on_the_card():
    card = card_of(captured(), {"mag": fitted("mag", remarks=("the dip is 62°.",))}, mounted=MOUNTED)
    assert card.mag.remarks == ("the dip is 62°.",)
    assert card.mount.remarks == ("nothing shows the heading.",)
    assert CalibrationCard.from_text(card.text(), "card.json").mag.remarks == ("the dip is 62°.",)


def test_they_stay_when_the_card_grows():
    first = card_of(captured(), {"acc": fitted("acc", remarks=("pose 3 was moved.",))})
    grown = card_of(captured(first), {"mag": fitted("mag")}, mounted=MOUNTED)
    assert grown.acc.remarks == ("pose 3 was moved.",)
    assert (grown.mag.remarks, grown.mount.remarks) == ((), MOUNTED.remarks)


@pytest.mark.parametrize("had_acc", [False, True])
def test_a_new_accelerometer_makes_what_hangs_on_it_old(had_acc):
    older = {"gyr": fitted("gyr", remarks=("it was cold.",)), "mag": fitted("mag")}
    first = card_of(captured(), older | ({"acc": fitted("acc")} if had_acc else {}), mounted=MOUNTED)
    grown = card_of(captured(first), {"acc": fitted("acc")})
    assert grown.acc.remarks == ()
    assert grown.gyr.remarks == ("it was cold.", STALE)
    assert grown.mag.remarks == (STALE,)
    assert grown.mount.remarks == (*MOUNTED.remarks, STALE)
    later = card_of(replace(captured(grown), date="2027-01-01"), {"acc": fitted("acc"), "mag": fitted("mag")})
    assert later.mag.remarks == ()
    assert later.gyr.remarks == ("it was cold.", STALE.replace("2026-11-21", "2027-01-01"))


def test_a_bias_at_rest_does_not_hang_on_the_accelerometer():
    first = card_of(captured(), {"gyr": fitted("gyr", gain=1.0)})
    assert card_of(captured(first), {"acc": fitted("acc")}).gyr.remarks == ()
