"""From fits to a card: remarks stay with what they are about."""

from dataclasses import replace

import numpy as np
import pytest

from plumbob.calibration.calibration import Capture, card_of
from plumbob.calibration.fit import Fitted, Mounted
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


DIP = ("the dip is 62°.",)
MOUNTED = Mounted(Mount([1.0, 0.0, 0.0, 0.0]), ("nothing shows the heading.",))


def said(part):
    return tuple(map(str, part.remarks))


def test_remarks_of_fits_and_of_a_mounting_are_on_the_card_and_stay_when_it_grows():
    card = card_of(captured(), {"mag": fitted("mag", remarks=("the dip is 62°.",))}, mounted=MOUNTED)
    read = CalibrationCard.from_text(card.text(), "card.json")
    assert [said(part) for part in (card.mag, card.mount, read.mag)] == [DIP, MOUNTED.remarks, DIP]
    grown = card_of(captured(card), {"acc": fitted("acc", remarks=("pose 3 was moved.",))}, mounted=MOUNTED)
    assert (said(grown.acc), said(grown.mount)) == (("pose 3 was moved.",), MOUNTED.remarks)
    assert len(card_of(captured(card), {"mag": fitted("mag")}).mag.remarks) == 0
    assert (
        card_of(captured(card_of(captured(), {"gyr": fitted("gyr", remarks=DIP)})), {}).gyr.remarks[0].values["text"]
        == DIP[0]
    )


@pytest.mark.parametrize("had_acc", [False, True])
def test_a_new_accelerometer_makes_what_hangs_on_it_old(had_acc):
    older = {"gyr": fitted("gyr", remarks=("it was cold.",)), "mag": fitted("mag")}
    first = card_of(captured(), older | ({"acc": fitted("acc")} if had_acc else {}), mounted=MOUNTED)
    grown = card_of(captured(first), {"acc": fitted("acc")})
    later = card_of(replace(captured(grown), date="2027-01-01"), {"acc": fitted("acc"), "mag": fitted("mag")})
    assert {name: said(getattr(grown, name)) for name in ("acc", "gyr", "mag", "mount")} == {
        "acc": (), "gyr": ("it was cold.", STALE), "mag": (STALE,), "mount": (*MOUNTED.remarks, STALE),
    }  # fmt: skip
    assert said(later.gyr) == ("it was cold.", STALE.replace("2026-11-21", "2027-01-01"))
    at_rest = card_of(captured(), {"gyr": fitted("gyr", gain=1.0)})  # a bias at rest does not hang on it
    assert len(later.mag.remarks) == len(card_of(captured(at_rest), {"acc": fitted("acc")}).gyr.remarks) == 0
