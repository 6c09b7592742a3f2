"""A card in which nearly everything is set, and the fits that it was made of."""

import numpy as np
import pytest

from plumbob.core.units import deg
from plumbob.data.cards import CalibrationCard, Mount
from plumbob.rotations import quat_from_euler_zyx
from tests.helpers.certificate_samples import gyr_calibration, gyr_fit, mag_calibration, mag_fit

REMARKS = ("the dip is 62.1° ± 0.3°.",)


@pytest.fixture(scope="session")
def card():
    """Everything but the accelerometer."""
    mount = Mount(
        quat_from_euler_zyx(deg(np.array([90.0, 2.0, -1.0]))), sd=deg(np.array([0.1, 0.1, 0.5])), method="hung"
    )
    return CalibrationCard("unit 7", "2026-11-21", "ellipsoid; rate table; hung", gyr=gyr_calibration(),
                           mag=mag_calibration(remarks=REMARKS), mount=mount, software="plumbob 0")  # fmt: skip


@pytest.fixture(scope="session")
def fits(card):
    return {"mag": mag_fit(card.mag, remarks=REMARKS), "gyr": gyr_fit(card.gyr)}
