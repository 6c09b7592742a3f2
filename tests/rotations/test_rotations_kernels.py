"""Scalar kernels against the array functions; compiled and as plain Python."""

import math

import numpy as np
import pytest

from plumbob.rotations import dcm_from_quat, kernels, quat_from_rotvec, quat_multiply, quat_normalize, quat_rotate

EPS = np.finfo(float).eps


@pytest.fixture(params=["compiled", "py_func"])
def run(request):
    """Call a kernel row by row, on Python floats."""

    def rows(kernel, *tables):
        call = getattr(kernel, request.param)
        return np.array([call(*map(float, row)) for row in np.concatenate(tables, axis=1)])

    return rows


@pytest.fixture
def vectors():
    return np.random.default_rng(13).normal(size=(1000, 3))


def test_shared_formulas_give_the_same_bits(run, quats, vectors):
    other = quats[::-1]
    assert np.array_equal(run(kernels.quat_mul, quats, other), quat_multiply(quats, other))
    assert np.array_equal(run(kernels.rotate, quats, vectors), quat_rotate(quats, vectors))
    assert np.array_equal(run(kernels.cross, vectors, vectors[::-1]), np.cross(vectors, vectors[::-1]))
    np.testing.assert_allclose(run(kernels.third_row, quats), dcm_from_quat(quats)[:, 2], rtol=0, atol=2 * EPS)


def test_twins_agree_to_rounding(run, quats, vectors):
    """Where the array function is written otherwise, the two differ by their own roundings: 2 EPS each."""
    scaled = quats * np.logspace(-100, 100, 1000)[:, np.newaxis]
    np.testing.assert_allclose(run(kernels.quat_unit, scaled), quat_normalize(scaled), rtol=4 * EPS, atol=0)
    for size in (1e-9, 9e-3, 1.1e-2, 1.0):
        r = size * vectors
        np.testing.assert_allclose(run(kernels.quat_exp, r), quat_from_rotvec(r), rtol=4 * EPS, atol=EPS)


def test_what_has_no_direction_becomes_the_identity_and_nan_stays_nan(run):
    """A kernel that turns NaN into a number hides a lost sample."""
    nan, inf = math.nan, math.inf
    for q in ((0.0,) * 4, (nan, 0.0, 0.0, 1.0), (1.0, inf, 0.0, 0.0), (inf, -inf, nan, 0.0)):
        assert np.array_equal(run(kernels.quat_unit, [q]), [[1, 0, 0, 0]])
    assert np.isnan(run(kernels.rotate, [[1.0, 0, 0, 0]], [[nan, nan, nan]])).all()
    assert np.isnan(run(kernels.quat_exp, [[nan, 0, 0]]))[0, :2].all()


def test_a_turn_is_the_same_however_many_steps_it_takes(run):
    """1e5 steps of exp compose to one: the norm drifts by a random walk of roundings, √n EPS, here under n EPS/100."""
    n, q = 20_000, (1.0, 0.0, 0.0, 0.0)
    step = run(kernels.quat_exp, [[1e-4, 2e-4, -1e-4]])[0].tolist()
    mul = kernels.quat_mul.py_func
    for _ in range(n):
        q = mul(*q, *step)
    whole = run(kernels.quat_exp, [[1e-4 * n, 2e-4 * n, -1e-4 * n]])[0]
    assert abs(math.sqrt(sum(c * c for c in q)) - 1) <= n * EPS
    assert np.abs(np.array(q) - whole * np.sign(whole @ q)).max() <= n * EPS
