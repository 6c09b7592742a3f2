"""A smooth motion with a formula, and tracks of it."""

import numpy as np
import pytest

from plumbob.data import AttitudeTrack
from plumbob.rotations import Frame, North, quat_from_euler_zyx


def _motion(t):
    """Attitude (N, 4) of a body that tilts up to 58° and turns through all headings, at rates up to about 100 °/s."""
    yaw = 0.4 * t + 0.9 * np.sin(0.9 * t)
    pitch = 0.5 * np.sin(1.1 * t + 0.3) + 0.3 * np.sin(2.7 * t)
    roll = 0.8 * np.sin(0.77 * t) * np.cos(0.2 * t)
    return quat_from_euler_zyx(np.stack((yaw, pitch, roll), axis=-1))


def _track(t, q_nb, **fields):
    return AttitudeTrack(t=t, q_nb=q_nb, **{"frame": Frame.ENU, "north": North.MAGNETIC, **fields})


@pytest.fixture(scope="session")
def motion():
    return _motion


@pytest.fixture(scope="session")
def track():
    return _track


@pytest.fixture(scope="session")
def t():
    return np.arange(2000) / 100.0


@pytest.fixture(scope="session")
def reference(t):
    return _track(t, _motion(t), source="truth")
