"""Rates to a rotation, against a motion in closed form."""

import numpy as np
import pytest

from plumbob.calibration.gyr.drift import accumulate, rotation_vectors
from plumbob.rotations import quat_angle, quat_from_rotvec, quat_multiply

A, B, T = 3.0, 2.0, 1.5  # turning with a about the fixed z and with b about the body's x


def turned(n):
    t = np.linspace(0.0, T, n + 1)
    rate = np.stack((np.full_like(t, B), A * np.sin(B * t), A * np.cos(B * t)), axis=1)
    q = np.empty((n + 1, 4))
    accumulate(rotation_vectors(rate, np.diff(t)), q)
    return q[-1]


@pytest.mark.parametrize("n", [50, 200])
def test_a_precession_ends_where_its_closed_form_does(n):
    true = quat_multiply(quat_from_rotvec([0.0, 0.0, A * T]), quat_from_rotvec([B * T, 0.0, 0.0]))
    error = float(quat_angle(true, turned(n)))
    bound = (T / n) ** 2 / 12.0 * T * A * B**2  # of the trapezoidal rule, |ω''| = a b²
    assert 1e-3 * bound < error <= bound


def test_a_constant_rate_is_exact():
    rate = np.tile([0.3, -2.0, 1.0], (40, 1))
    q = np.empty((40, 4))
    accumulate(rotation_vectors(rate, np.full(39, 0.1)), q)
    true = quat_from_rotvec(3.9 * rate[0])
    assert abs(abs(float(q[-1] @ true)) - 1.0) <= 39 * 8 * np.finfo(float).eps
