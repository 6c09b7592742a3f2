"""Whether a field turns as a gyroscope says."""

import numpy as np
import pytest

from plumbob.calibration.mag.axes import LEAST_SLOPE, agreement, turn
from plumbob.rotations import dcm_from_quat, quat_from_rotvec
from tests.helpers.mag_scene import field, rates, trajectory, unit_of

BIAS = np.radians([15.0, -5.0, 2.0])


@pytest.fixture(scope="module")
def scene():
    rng = np.random.default_rng(51)
    unit = unit_of(rng)
    t, q_nb, true = trajectory(rng, tilt=np.pi)
    return unit, t, field(rng, unit, q_nb), rates(rng, true) + BIAS


def test_a_field_that_is_not_calibrated_turns_with_a_gyroscope_that_is_not(scene):
    _, t, mag, gyr = scene
    found = agreement(t, mag, gyr)
    assert 0.8 < found.slope < 1.2  # soft iron of 10 to 20 %
    np.testing.assert_allclose(found.rate_bias, BIAS, atol=0.2 * np.radians(20.0))  # as much of the mean rate


@pytest.mark.parametrize("mirror", [np.diag([1.0, 1.0, -1.0]), np.eye(3)[[1, 0, 2]], np.eye(3)[[0, 2, 1]]])
def test_a_mirrored_one_does_not(scene, mirror):
    _, t, mag, gyr = scene
    assert agreement(t, mag @ mirror.T, gyr).slope < LEAST_SLOPE


def test_all_axes_negated_turn_as_before(scene):
    _, t, mag, gyr = scene
    assert agreement(t, -mag, gyr).slope == pytest.approx(agreement(t, mag, gyr).slope, rel=1e-9)


def test_the_turn_of_a_calibrated_field_is_found(scene):
    unit, t, mag, gyr = scene
    turned = dcm_from_quat(quat_from_rotvec(np.radians([10.0, -20.0, 30.0])))
    found = turn(t, (mag - unit.bias) @ unit.matrix.T @ turned.T, gyr)
    np.testing.assert_allclose(found, turned, atol=0.005)  # 0.03 to 0.3° at this noise


def test_missing_rows_do_not_count(scene):
    _, t, mag, gyr = scene
    some = mag.copy()
    some[::3] = np.nan
    assert agreement(t, some, gyr).slope == pytest.approx(agreement(t, mag, gyr).slope, abs=0.01)


def test_what_does_not_turn_tells_nothing(scene):
    _, t, mag, gyr = scene
    rng = np.random.default_rng(1)
    still = [20.0, 0.0, 40.0] + 0.2 * rng.normal(size=mag.shape)
    assert agreement(t, still, BIAS + 1e-3 * rng.normal(size=gyr.shape)) is None
    assert turn(t[:5], mag[:5], gyr[:5]) is None
