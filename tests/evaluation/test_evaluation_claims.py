"""Standard deviations of inclination and heading that a covariance claims, and what a report says of a claim."""

import math

import numpy as np
import pytest

from plumbob.evaluation.metrics import attitude_errors
from plumbob.rotations import dcm_from_quat, quat_from_euler_zyx, quat_from_rotvec, quat_multiply
from plumbob.rotations.frames import claimed_sd

N = 20_000
SD = np.array([0.004, 0.003, 0.02])  # about the level axes and the vertical, rad


def claimed(q):
    """Covariance in body axes of errors with the deviations `SD` about the navigation axes."""
    c_nb = dcm_from_quat(q)
    return np.swapaxes(c_nb, 1, 2) @ np.diag(SD**2) @ c_nb


def test_they_are_those_about_the_axes_of_the_navigation_frame_and_nothing_before_the_start():
    q = quat_from_euler_zyx(np.array([[0.0, 0.0, 0.0], [2.0, -1.2, 3.0], [-1.0, 1.5, 0.4]]))
    inclination, heading = claimed_sd(q, claimed(q))
    np.testing.assert_allclose(inclination, 0.005, rtol=1e-12)  # √(4² + 3²) = 5
    np.testing.assert_allclose(heading, 0.02, rtol=1e-12)
    # A state of zeros is no certainty.
    q = quat_from_euler_zyx(np.zeros((3, 3)))
    cov = np.stack((np.zeros((3, 3)), -np.eye(3), np.full((3, 3), np.nan)))
    for sd in claimed_sd(q, cov):
        assert np.isnan(sd).all()


def test_errors_have_the_rms_that_is_claimed(motion):
    """Of N errors as claimed, the rms scatters by 1/√(2N) or 0.5 %; to that come terms of second order, 0.02²."""
    q = motion(np.arange(N) / 100.0)
    about_n = np.random.default_rng(5).normal(size=(N, 3)) * SD
    found = attitude_errors(quat_multiply(quat_from_rotvec(about_n), q), q)
    inclination, heading = claimed_sd(q, claimed(q))
    for name, sd in (("inclination", inclination), ("heading", heading)):
        assert math.sqrt(np.mean(found[name] ** 2)) == pytest.approx(sd[0], rel=5.0 / math.sqrt(2 * N) + 4e-4)
