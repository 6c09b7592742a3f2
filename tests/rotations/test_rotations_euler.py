"""Yaw, pitch and roll: signs, ranges, and the policy at pitch ±90°."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import example, given

from plumbob import rotations as rot
from plumbob.core.errors import ShapeError
from plumbob.rotations.frames import claimed_sd, euler_sd
from plumbob.rotations.quaternions import GIMBAL_MARGIN
from tests.helpers import examples

EPS = np.finfo(float).eps
ROUNDING = 16 * EPS  # a dozen products of sines and cosines, there and back
DEG = np.pi / 180

angles = st.floats(-np.pi, np.pi)
pitches = st.floats(-np.pi / 2, np.pi / 2)


def rebuilt(q):
    return rot.quat_angle(q, rot.quat_from_euler_zyx(rot.euler_zyx_from_quat(q)))


def apart(angles, others):
    return np.abs((np.subtract(angles, others) + np.pi) % (2 * np.pi) - np.pi)


@pytest.mark.parametrize(("angles_deg", "axis", "expected"), [
    # in NED, body forward-right-down: what a pilot says
    ((90, 0, 0), [1, 0, 0], [0, 1, 0]),  # heading 90°: the nose points east
    ((0, 90, 0), [1, 0, 0], [0, 0, -1]),  # pitch +90°: the nose points up; in ENU and NWU, where z is up, down
    ((0, 0, 90), [0, 1, 0], [0, 0, 1]),  # roll +90°: the right wing points down
    ((90, 0, 90), [0, 1, 0], [0, 0, 1]),
    ((90, 90, 0), [0, 0, 1], [0, 1, 0]),  # then pitched up: the belly faces east, where the nose was
])  # fmt: skip
def test_signs_in_ned(angles_deg, axis, expected):
    turned = rot.quat_rotate(rot.quat_from_euler_zyx(np.multiply(angles_deg, DEG)), axis)
    np.testing.assert_allclose(turned, expected, atol=4 * EPS)


@given(angles, pitches, angles)
@example(0.0, 0.0, 0.0)
@example(np.pi, 0.0, np.pi)
@example(3.0, np.pi / 2, -1.0)
@example(3.0, -np.pi / 2, -1.0)
@examples(0.5)
def test_ranges_and_reconstruction(yaw, pitch, roll):
    """Up to a pitch of 1.5 rad, cos = 0.07, an error of the quaternion reaches yaw and roll 14 times magnified."""
    q = rot.quat_from_euler_zyx([yaw, pitch, roll])
    back = rot.euler_zyx_from_quat(q)
    assert (np.abs(back) <= [np.pi, np.pi / 2, np.pi]).all()
    assert rebuilt(q) <= (2 * GIMBAL_MARGIN if rot.near_gimbal(q) else ROUNDING)
    if abs(pitch) <= 1.5:
        assert apart(back, [yaw, pitch, roll]).max() <= 14 * ROUNDING


def test_bijection(rotvec):
    q = rot.quat_from_rotvec(rotvec)
    assert rot.euler_zyx_from_quat(q).shape == rotvec.shape
    assert rot.near_gimbal(q).shape == rotvec.shape[:-1]
    assert rebuilt(q).max(initial=0) <= ROUNDING


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("yaw", [0.5, -2.0, np.pi])
@pytest.mark.parametrize("roll", [0.0, -0.4, 3.0])
@pytest.mark.parametrize("off", [0.0, 1e-16, 0.9, 1.1, 10.0, 1e6], ids="off={}".format)
def test_around_the_gimbal(sign, yaw, roll, off):
    """`off` counts in margins from ±90°; below 1 the policy holds, above it does not, and the rotation is the same."""
    pitch = sign * (np.pi / 2 - off * GIMBAL_MARGIN)
    q = rot.quat_from_euler_zyx([yaw, pitch, roll])
    back = rot.euler_zyx_from_quat(q)
    inside = off < 1
    assert bool(rot.near_gimbal(q)) is inside
    # Inside, roll goes into yaw, which moves the body x axis by at most 2 sin(roll/2) times the distance.
    assert rebuilt(q) <= ROUNDING + (2 * off * GIMBAL_MARGIN if inside else 0)
    assert abs(back[1] - pitch) <= 4 * EPS
    if inside:
        assert back[2] == 0.0
        assert apart(back[0], yaw - sign * roll) <= ROUNDING + 2 * off * GIMBAL_MARGIN
    else:
        assert apart(back[[0, 2]], [yaw, roll]).max() <= 4 * EPS / (off * GIMBAL_MARGIN) + ROUNDING


@pytest.mark.parametrize(("q", "expected"), [
    ([1, 0, 0, 0], [0, 0, 0]),
    ([0, 1, 0, 0], [0, 0, np.pi]),
    ([0, 0, 0, 1], [np.pi, 0, 0]),
    ([0, 0, 1, 0], [np.pi, 0, np.pi]),
    ([-1, -0.0, -0.0, -0.0], [0, 0, 0]),
    ([-0.0, 1, -0.0, -0.0], [0, 0, np.pi]),
    ([-0.0, 1, -0.0, 0.0], [0, 0, np.pi]),
    ([-0.0, -0.0, -0.0, 1], [np.pi, 0, 0]),
])  # fmt: skip
def test_half_turns_are_plus_pi(q, expected):
    """Angles lie in (−π, π], whatever the sign of a zero."""
    assert np.array_equal(rot.euler_zyx_from_quat(q), expected) and rebuilt(np.array(q, dtype=float)) <= ROUNDING


def test_both_signs_have_the_same_angles_and_absent_stays_absent(quats):
    assert np.array_equal(rot.euler_zyx_from_quat(quats), rot.euler_zyx_from_quat(-quats))
    assert np.isnan(rot.euler_zyx_from_quat([np.nan] * 4)).all()
    assert not rot.near_gimbal([np.nan] * 4)


def test_body_rate_against_differences_and_of_a_level_turn():
    """ω_b dt = log(q(t − dt/2)⁻¹ q(t + dt/2)) for angles that move at constant rates."""
    rng = np.random.default_rng(2)
    angle = rng.uniform([-3, -1.4, -3], [3, 1.4, 3], (200, 3))
    rate = rng.normal(size=(200, 3))
    h = EPS ** (1 / 3)
    before, after = (rot.quat_from_euler_zyx(angle + s * h / 2 * rate) for s in (-1, 1))
    measured = rot.rotvec_from_quat(rot.quat_multiply(rot.quat_conjugate(before), after)) / h
    scale = 1 + np.abs(rate).max() ** 3  # third derivatives of the angles' sines and cosines
    assert np.abs(rot.body_rate_from_euler_zyx(angle, rate) - measured).max() <= 8 * scale * (h**2 + EPS / h)
    np.testing.assert_array_equal(rot.body_rate_from_euler_zyx([0.3, 0, 0], [0.1, 0, 0]), [0, 0, 0.1])
    # Banked by 90° the turn is a pitch rate, pitched up by 90° a roll rate with the other sign.
    np.testing.assert_allclose(rot.body_rate_from_euler_zyx([0, 0, np.pi / 2], [0.1, 0, 0]), [0, 0.1, 0], atol=EPS)
    np.testing.assert_allclose(rot.body_rate_from_euler_zyx([0, np.pi / 2, 0], [0.1, 0, 0]), [-0.1, 0, 0], atol=EPS)
    with pytest.raises(ShapeError, match="yaw_pitch_roll must have shape"):
        rot.quat_from_euler_zyx([0.0, 0.0])
    with pytest.raises(ShapeError, match="rates must have shape"):
        rot.body_rate_from_euler_zyx([0.0, 0.0, 0.0], 1.0)


COV = np.array([[4.0, 1.0, -0.5], [1.0, 2.0, 0.3], [-0.5, 0.3, 3.0]]) * 1e-6


@pytest.mark.parametrize("angles", [(0.0, 0.0, 0.0), (2.0, 0.3, -0.4), (-1.0, -1.2, 2.5), (0.5, 1.4, -3.0)])
def test_they_are_the_spread_of_the_angles_of_attitudes_that_stray_so(angles):
    """20 000 drawn errors in body axes; the spread of so many is known to 0.5 % (1 sd), and 5 sd are allowed."""
    rng = np.random.default_rng(1)
    q = rot.quat_from_euler_zyx(np.array([angles]))
    errors = rng.multivariate_normal(np.zeros(3), COV, size=20_000)
    spread = np.std(rot.euler_zyx_from_quat(rot.quat_multiply(q, rot.quat_from_rotvec(errors))), axis=0)
    np.testing.assert_allclose(euler_sd(q, COV[np.newaxis])[0], spread, rtol=0.025)


def test_of_a_level_body_that_of_the_yaw_is_that_of_the_heading_and_of_no_variance_there_is_none():
    q = rot.quat_from_euler_zyx([[1.0, 0.0, 0.0]])
    assert euler_sd(q, COV[np.newaxis])[0, 0] == pytest.approx(claimed_sd(q, COV[np.newaxis])[1][0])
    assert np.isnan(euler_sd(rot.quat_from_euler_zyx([[1.0, 0.2, 0.0]]), np.zeros((1, 3, 3)))).all()
