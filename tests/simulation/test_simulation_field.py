"""The Earth's field: strength, dip and declination are what is asked for, in every frame."""

import math

import numpy as np
import pytest

from plumbob.rotations import Frame
from plumbob.simulation import earth_field

FRAMES = list(Frame)


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("dip", [-1.2, 0.0, 0.9])
@pytest.mark.parametrize("declination", [-0.3, 0.0, 0.2])
def test_strength_dip_and_declination_come_back(frame, dip, declination):
    field = earth_field(frame, strength=48.0, dip=dip, declination=declination)
    east, north, up = (field @ getattr(frame, name) for name in ("east", "north", "up"))
    assert np.linalg.norm(field) == pytest.approx(48.0, rel=1e-14)
    assert math.atan2(-up, math.hypot(east, north)) == pytest.approx(dip, abs=1e-14)  # positive down
    assert math.atan2(east, north) == pytest.approx(declination, abs=1e-14)  # positive to the east
