"""Sensitivity to specific force from poses at rest."""

import numpy as np
import pytest

from plumbob.calibration.gyr.hand import fit_hand
from plumbob.calibration.gyr.motion_fit import FEWEST_RATES as FEWEST
from plumbob.calibration.gyr.motion_fit import coupling_at_rest
from plumbob.calibration.gyr.plausible import Rates
from plumbob.core.constants import G0
from plumbob.core.units import dps, g
from tests.helpers.gyro_sessions import hand

G = dps(0.1) / g(1.0) * np.array([[0.5, -0.3, 0.2], [0.9, 1.0, -0.7], [0.0, 0.4, -0.2]])
BIAS = dps(np.array([1.0, -12.0, 3.0]))


def poses(rng, count, noise, matrix=G):
    forces = rng.normal(size=(count, 3))
    forces *= G0 / np.linalg.norm(forces, axis=1, keepdims=True)
    return BIAS + forces @ matrix.T + noise * rng.normal(size=(count, 3)), forces


def test_without_noise_it_comes_back():
    found = coupling_at_rest(*poses(np.random.default_rng(0), 20, 0.0))
    np.testing.assert_allclose(found.matrix, G, rtol=0, atol=1e-12)


def test_errors_are_as_large_as_said():
    """Nine entries of 40 captures: mean square over the variance said, 1.06 for t of 36, ± √(2 / 360)."""
    rng, squares = np.random.default_rng(1), []
    for _ in range(40):
        found = coupling_at_rest(*poses(rng, 40, dps(0.01)))
        squares.append(((found.matrix - G) / found.sd) ** 2)
    assert 0.8 < np.mean(squares) < 1.3


def test_where_there_is_none_none_is_found():
    """By its significance of 1 %: of 200 captures, more than 8 have a probability of 2e-4."""
    rng = np.random.default_rng(2)
    found = [coupling_at_rest(*poses(rng, 30, dps(0.01), 0.0 * G)) for _ in range(200)]
    assert sum(one is not None for one in found) <= 8


def test_few_poses_and_poses_of_one_kind_tell_nothing():
    rng = np.random.default_rng(3)
    assert coupling_at_rest(*poses(rng, FEWEST - 1, 0.0)) is None
    rates, forces = poses(rng, 30, dps(0.01))
    level = np.tile([0.0, 0.0, G0], (30, 1)) + 0.01 * forces
    assert coupling_at_rest(rates, level) is None


@pytest.mark.parametrize("calibrated", [True, False])
def test_hand_motion_finds_it_with_a_calibrated_accelerometer_only(calibrated):
    session = hand(5)
    fit = fit_hand(Rates(session.t, session.gyr + session.acc @ G.T, session.acc, acc_calibrated=calibrated))
    made = fit.calibration
    if not calibrated:
        assert not made.g_sensitivity.any()
        return
    assert np.abs((made.g_sensitivity - G) / made.g_sensitivity_sd).max() < 4.5
    assert np.abs((made.bias - session.bias) / made.bias_sd).max() < 5.0
    assert any("depends on specific force" in remark for remark in fit.remarks)
