"""Exponential, logarithm and Jacobians, against exact rational arithmetic, differences and each other."""

import math
from fractions import Fraction

import numpy as np
import pytest

from plumbob.rotations import (
    dcm_from_quat,
    kernels,
    left_jacobian,
    left_jacobian_inverse,
    quat_angle,
    quat_from_rotvec,
    quat_multiply,
    quaternions,
    right_jacobian,
    right_jacobian_inverse,
    rotvec_from_quat,
    skew,
)

EPS = np.finfo(float).eps
SWITCH = math.sqrt(quaternions._SMALL2)
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
        assert ulps(q[1], x) <= 3
        assert abs(float(Fraction(float(q[0])) - w)) <= 1.5 * EPS


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


@pytest.mark.parametrize("angle", ANGLES)
def test_jacobian_terms_are_right_to_the_last_bits(angle):
    a, b = quaternions._jacobian_terms(np.array([angle, 0.0, 0.0]))
    half = sin_series(Fraction(angle) / 2)  # (1 − cos x)/x² = sin²(x/2)/x² · 2 = (sin(x/2)/(x/2))²/2
    assert ulps(a.item(), half * half / 2) <= 3
    assert ulps(b.item(), sin_series(angle, k0=2)) <= 4  # (x − sin x)/x³ = Σ (−1)^k x^2k/(2k + 3)!


def _cotangent(angle):
    """(1 − x/2 cot(x/2))/x²: the term of the inverse Jacobian, read off its entry for an axis along x."""
    return (1.0 - right_jacobian_inverse(np.array([angle, 0.0, 0.0]))[1, 1]) / angle**2


@pytest.mark.parametrize("angle", [a for a in ANGLES if a > 0.9])
def test_inverse_jacobian_term_is_right_to_the_last_bits(angle):
    half = Fraction(angle) / 2
    exact = (1 - cos_series(half) / sin_series(half)) / Fraction(angle) ** 2
    # 1 − (1 − c x²) leaves EPS/2 of 1, that is EPS/2/(c x²) of c, for which c ≥ 1/12; the cotangent likewise.
    assert ulps(_cotangent(angle), exact) <= 3 * (1 + 12 / angle**2)


def bernoulli(count):
    """Bernoulli numbers by their recursion: Σ_k C(m + 1, k) B_k = 0."""
    b = [Fraction(1)]
    for m in range(1, count):
        b.append(-sum(math.comb(m + 1, k) * b[k] for k in range(m)) / (m + 1))
    return b


def test_series_coefficients_derived_anew():
    numbers = bernoulli(26)
    expected = [float(abs(numbers[2 * k + 2]) / math.factorial(2 * k + 2)) for k in range(len(quaternions._COTANGENT))]
    assert list(quaternions._COTANGENT) == expected  # x/2 cot(x/2) = 1 − Σ |B_2k| x^2k/(2k)!, Abramowitz-Stegun 4.3.70
    assert list(quaternions._THIRD) == [float(Fraction((-1) ** k, math.factorial(2 * k + 3))) for k in range(9)]


@pytest.mark.parametrize("coefficients", [quaternions._THIRD, quaternions._COTANGENT])
def test_series_are_long_enough(coefficients):
    """At their far end, 1 rad, the first term left out does not reach half a rounding of the sum."""
    ratio = abs(coefficients[-1] / coefficients[-2])  # falls from term to term
    assert abs(coefficients[-1]) * ratio < 0.25 * EPS * coefficients[0]


@pytest.mark.parametrize("at", [SWITCH, 1.0])
def test_no_jump_at_a_switch(at):
    """Neighbouring angles on the two sides of a switch give the same to rounding."""
    axis = np.array([0.48, -0.6, 0.64])
    below, above = at * (1 - 1e-15) * axis, at * (1 + 1e-15) * axis
    assert np.linalg.norm(below) < at <= np.linalg.norm(above)
    for call in (quat_from_rotvec, right_jacobian, left_jacobian, right_jacobian_inverse, left_jacobian_inverse):
        assert np.abs(call(below) - call(above)).max() <= 2e-15 + 4 * EPS, call


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


def test_logarithm_at_exactly_pi():
    for axis in np.eye(3):
        assert np.array_equal(rotvec_from_quat([0.0, *axis]), np.pi * axis)
        assert np.array_equal(rotvec_from_quat([-0.0, *axis]), np.pi * axis)


def test_logarithm_takes_the_shorter_way_for_either_sign(quats):
    r = rotvec_from_quat(quats)
    assert np.array_equal(r, rotvec_from_quat(-quats))
    assert np.linalg.norm(r, axis=1).max() <= np.pi * (1 + EPS)


def test_absent_stays_absent():
    q = np.array([[1.0, 0, 0, 0], [np.nan] * 4])
    assert np.isnan(rotvec_from_quat(q)).tolist() == [[False] * 3, [True] * 3]
    assert np.isnan(quat_from_rotvec([[0.0, 0, 0], [np.nan] * 3])).tolist() == [[False] * 4, [True] * 4]


def test_rotation_vectors_beyond_pi_are_welcome():
    """A filter may integrate more than a turn: exp(r (1 + 2π/|r|)) = exp(r), with the other sign."""
    r = np.array([0.3, -0.2, 0.5])
    more = r * (1 + 2 * np.pi / np.linalg.norm(r))
    np.testing.assert_allclose(quat_from_rotvec(more), -quat_from_rotvec(r), atol=8 * EPS)


H = EPS ** (1 / 3)  # best step of a central difference
DIFFERENCE = 8 * (H**2 + EPS / H)  # its truncation and its rounding


@pytest.mark.parametrize("side", ["right", "left"])
def test_jacobians_against_differences(rotvec, side):
    """[Sola2018] (143), (145)."""
    q = quat_from_rotvec(rotvec)
    inverse = q * [1, -1, -1, -1]
    columns = []
    for d in H * np.eye(3):
        turns = []
        for sign in (1, -1):
            turned = quat_from_rotvec(rotvec + sign * d)
            apart = quat_multiply(inverse, turned) if side == "right" else quat_multiply(turned, inverse)
            turns.append(rotvec_from_quat(apart))
        columns.append((turns[0] - turns[1]) / (2 * H))
    jacobian = right_jacobian(rotvec) if side == "right" else left_jacobian(rotvec)
    assert jacobian.shape == (*rotvec.shape, 3)
    assert np.abs(np.stack(columns, axis=-1) - jacobian).max(initial=0) <= DIFFERENCE


def test_jacobians_and_their_inverses(rotvec):
    """[Sola2018] (143) to (146)."""
    for jacobian, inverse in ((right_jacobian, right_jacobian_inverse), (left_jacobian, left_jacobian_inverse)):
        # Entries up to π/2, a dozen roundings each.
        assert np.abs(jacobian(rotvec) @ inverse(rotvec) - np.eye(3)).max(initial=0) <= 16 * EPS


def test_jacobians_rebuild_the_rotation(rotvec):
    c = dcm_from_quat(quat_from_rotvec(rotvec))
    # Entries of the factors up to π: a dozen roundings.
    assert np.abs(np.eye(3) + skew(rotvec) @ left_jacobian(rotvec) - c).max(initial=0) <= 32 * EPS
    assert np.abs(left_jacobian(rotvec) @ right_jacobian_inverse(rotvec) - c).max(initial=0) <= 32 * EPS
    assert np.array_equal(left_jacobian(rotvec), np.swapaxes(right_jacobian(rotvec), -1, -2))


def test_skew_is_the_vector_product():
    a, b = np.random.default_rng(3).normal(size=(2, 3, 2, 3))
    np.testing.assert_allclose((skew(a) @ b[..., np.newaxis])[..., 0], np.cross(a, b), rtol=0, atol=4 * EPS * 10)
    assert np.array_equal(skew(a), -np.swapaxes(skew(a), -1, -2))
