"""Exponential and logarithm, against exact rational arithmetic, differences and each other."""

import math
from fractions import Fraction

import numpy as np
import pytest

from plumbob.rotations import kernels, quat_angle, quat_from_rotvec, rotvec_from_quat, skew

EPS = np.finfo(float).eps
SWITCH = 0.01  # rad, below which both are series
# Both sides of both switches (0.01 rad and 1 rad), and what lies between and beyond.
ANGLES = [1e-12, 1e-8, 1e-4, 5e-3, 0.05, 0.3, 2.0, 3.0, math.pi] + [
    float(np.nextafter(at, side)) if near == 0 else at * (1 + near)
    for at in (SWITCH, 1.0)
    for near, side in ((0, 0), (0, 9), (-1e-6, None), (1e-6, None))
]


def sin_series(x, k0=0, terms=40):
    """Sum of (−1)^k x^(2k) / (2k + 1 + k0)!, exact but for a remainder below (π²)^40 / 81! < 1e-80."""
    return sum((-1) ** k * Fraction(x) ** (2 * k) / math.factorial(2 * k + 1 + k0) for k in range(terms))


def cos_series(x, terms=40):
    return sum((-1) ** k * Fraction(x) ** (2 * k) / math.factorial(2 * k) for k in range(terms))


def ulps(value, exact):
    return abs(float((Fraction(float(value)) - exact) / exact)) / EPS


@pytest.mark.parametrize("angle", ANGLES)
def test_exponential_is_right_to_the_last_bits(angle):
    """[Sola2017] (101)."""
    half = Fraction(angle) / 2
    w, x = cos_series(half), half * sin_series(half)
    for q in (
        quat_from_rotvec([angle, 0, 0]),
        kernels.quat_exp(angle, 0.0, 0.0),
        kernels.quat_exp.py_func(angle, 0, 0),
    ):
        # Roundings: the half angle's square, its root, sine, quotient and product. At π the cosine is 6e-17 itself.
        assert ulps(q[1], x) <= 3 and abs(float(Fraction(float(q[0])) - w)) <= 1.5 * EPS


@pytest.mark.parametrize("angle", ANGLES)
def test_logarithm_is_right_to_the_last_bits(angle):
    """Against the angle that the rounded quaternion really has: atan's series about the angle that was meant."""
    q = quat_from_rotvec([angle, 0, 0])
    half = Fraction(angle) / 2
    w, x = Fraction(float(q[0])), Fraction(float(q[1]))
    # tan(true − half), by the difference formula; smaller than EPS, so that it is its own arc.
    s, c = half * sin_series(half), cos_series(half)
    exact = 2 * (half + (x * c - w * s) / (w * c + x * s))
    assert ulps(rotvec_from_quat(q)[0], exact) <= 3


@pytest.mark.parametrize("at", [SWITCH, 1.0])
def test_no_jump_at_a_switch(at):
    """Neighbouring angles on the two sides of a switch give the same to rounding."""
    axis = np.array([0.48, -0.6, 0.64])
    below, above = at * (1 - 1e-15) * axis, at * (1 + 1e-15) * axis
    assert np.linalg.norm(below) < at <= np.linalg.norm(above)
    assert np.abs(quat_from_rotvec(below) - quat_from_rotvec(above)).max() <= 2e-15 + 4 * EPS


def test_bijection_with_quaternions(rotvec):
    q = quat_from_rotvec(rotvec)
    assert np.abs(np.sum(q * q, axis=-1) - 1.0).max(initial=0) <= 4 * EPS
    # At π the rotation vector may come back with the other sign: the same rotation.
    back = quat_from_rotvec(rotvec_from_quat(q))
    assert quat_angle(q, back).max(initial=0) <= 4 * EPS


@pytest.mark.parametrize("size", [0.0, 1e-300, 1e-160, 1e-20, 1e-12, 1e-8, 1e-4, 1.0, 3.0, math.pi - 1e-8])
def test_rotation_vectors_come_back_with_all_their_digits(size):
    r = size * np.array([0.48, -0.6, 0.64])
    expected = 4 * EPS * size
    # Next to π the angle hangs on the small scalar part, which is right to EPS of 1.
    assert np.abs(rotvec_from_quat(quat_from_rotvec(r)) - r).max() <= expected + (2 * EPS if size > 3 else 0)


def test_logarithm_takes_the_shorter_way_for_either_sign_and_keeps_what_is_absent(quats):
    r = rotvec_from_quat(quats)
    assert np.array_equal(r, rotvec_from_quat(-quats)) and np.linalg.norm(r, axis=1).max() <= np.pi * (1 + EPS)
    for axis in np.eye(3):
        assert np.array_equal(rotvec_from_quat([0.0, *axis]), np.pi * axis)
        assert np.array_equal(rotvec_from_quat([-0.0, *axis]), np.pi * axis)
    q = np.array([[1.0, 0, 0, 0], [np.nan] * 4])
    assert np.isnan(rotvec_from_quat(q)).tolist() == [[False] * 3, [True] * 3]
    assert np.isnan(quat_from_rotvec([[0.0, 0, 0], [np.nan] * 3])).tolist() == [[False] * 4, [True] * 4]


def test_rotation_vectors_beyond_pi_are_welcome():
    """A filter may integrate more than a turn: exp(r (1 + 2π/|r|)) = exp(r), with the other sign."""
    r = np.array([0.3, -0.2, 0.5])
    more = r * (1 + 2 * np.pi / np.linalg.norm(r))
    np.testing.assert_allclose(quat_from_rotvec(more), -quat_from_rotvec(r), atol=8 * EPS)


def test_skew_is_the_vector_product():
    a, b = np.random.default_rng(3).normal(size=(2, 3, 2, 3))
    np.testing.assert_allclose((skew(a) @ b[..., np.newaxis])[..., 0], np.cross(a, b), rtol=0, atol=4 * EPS * 10)
    assert np.array_equal(skew(a), -np.swapaxes(skew(a), -1, -2))
