"""What a reference says: its error has the stated root mean square, half of it constant, half forgotten in its time."""

import math

import numpy as np
import pytest

from plumbob.core.units import deg
from plumbob.rotations import euler_zyx_from_quat, quat_angle, quat_from_euler_zyx
from plumbob.simulation.errors import AttitudeErrors

RATE, COUNT, RUNS = 10.0, 1000, 400
ERRORS = AttitudeErrors(heading=deg(0.8), tilt=deg(0.2))
ANGLES = np.tile([0.5, -0.3, 0.2], (COUNT, 1))
STATED = deg(np.array([0.8, 0.2, 0.2]))


@pytest.fixture(scope="module")
def off():
    """Errors (runs, N, 3), rad."""
    q_nb = quat_from_euler_zyx(ANGLES)
    return np.array([ERRORS.said(q_nb, seed=seed, rate=RATE) for seed in range(RUNS)]) - ANGLES


def test_root_mean_square_over_runs_is_what_is_stated_half_of_it_varies_and_angles_are_independent(off):
    rms = np.sqrt((off[:, ::100] ** 2).mean(axis=(0, 1)))
    # half of the square is drawn once a run, half ten times a run: 4 standard deviations of the mean square
    allowed = 4.0 * math.sqrt(2.0 * (0.25 / RUNS + 0.25 / (10 * RUNS)))
    np.testing.assert_allclose(rms**2, STATED**2, rtol=allowed)
    first = np.sqrt((off[:, 0] ** 2).mean(axis=0))  # no settling: the first value has it already
    np.testing.assert_allclose(first**2, STATED**2, rtol=4.0 * math.sqrt(2.0 / RUNS))
    apart = np.array([0, 100, 500])  # 0, 10 and 50 s
    found = [((off[:, k:] - off[:, : COUNT - k]) ** 2).mean(axis=(0, 1)) for k in apart]
    expected = STATED**2 * (1.0 - np.exp(-apart / RATE / 10.0))[:, np.newaxis]  # 2 · half · (1 - exp(-Δt/time))
    np.testing.assert_allclose(found, expected, rtol=0.2)
    assert np.abs(np.corrcoef(off[:, 0].T) - np.eye(3)).max() < 4.0 / math.sqrt(RUNS)


def test_a_pitch_beyond_the_vertical_is_one_from_the_other_side_and_no_errors_say_the_truth():
    steep = np.tile([0.5, deg(89.99), 0.2], (COUNT, 1))
    said = ERRORS.said(quat_from_euler_zyx(steep), seed=2, rate=RATE)
    assert (np.abs(said[:, 1]) <= 0.5 * math.pi).all()
    assert quat_angle(quat_from_euler_zyx(said), quat_from_euler_zyx(steep)).max() < deg(8.0)
    q_nb = quat_from_euler_zyx(ANGLES)
    np.testing.assert_allclose(AttitudeErrors(0.0, 0.0).said(q_nb, seed=1, rate=RATE), ANGLES, atol=1e-12)
    np.testing.assert_array_equal(*(ERRORS.said(q_nb, seed=1, rate=RATE) for _ in range(2)))
    short = ERRORS.said(q_nb[:500], seed=1, rate=RATE)
    np.testing.assert_array_equal(short, ERRORS.said(q_nb, seed=1, rate=RATE)[:500])
    assert euler_zyx_from_quat(q_nb).shape == short.shape[:0] + (COUNT, 3)
