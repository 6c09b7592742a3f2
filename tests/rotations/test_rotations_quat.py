"""Quaternions: kernels, averages, and direction cosine matrices."""

import itertools
import math

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra import numpy as hnp

from plumbob import rotations as rot
from plumbob.core.errors import ShapeError
from plumbob.rotations import (
    dcm_from_quat,
    kernels,
    quat_angle,
    quat_from_dcm,
    quat_from_rotvec,
    quat_mean,
    quat_multiply,
    quat_normalize,
    quat_rotate,
    quat_slerp,
)

EPS = np.finfo(float).eps
PRODUCT = 8 * EPS  # a component takes 7 roundings of EPS/2 on numbers up to 1; twice that, for the inputs' own norms

unit_quats = (
    hnp.arrays(float, 4, elements=st.floats(-1, 1, allow_subnormal=False))
    .filter(lambda q: np.linalg.norm(q) > 1e-3)
    .map(lambda q: q / np.linalg.norm(q))
)
vectors = hnp.arrays(float, 3, elements=st.integers(-(10**9), 10**9).map(lambda n: n / 1e6))


@given(unit_quats, unit_quats, unit_quats, vectors, vectors)
def test_a_group_and_its_action_on_vectors(a, b, c, v, w):
    associated = rot.quat_multiply(rot.quat_multiply(a, b), c) - rot.quat_multiply(a, rot.quat_multiply(b, c))
    assert np.abs(associated).max() <= 2 * PRODUCT
    assert np.array_equal(rot.quat_multiply(a, rot.IDENTITY), a)
    assert np.array_equal(rot.quat_multiply(rot.IDENTITY, a), a)
    assert np.abs(rot.quat_multiply(a, rot.quat_conjugate(a)) - rot.IDENTITY).max() <= PRODUCT
    both = rot.quat_rotate(rot.quat_multiply(a, b), v) - rot.quat_rotate(a, rot.quat_rotate(b, v))
    assert np.abs(both).max() <= 6 * PRODUCT * np.linalg.norm(v)
    scale = np.linalg.norm(v) * np.linalg.norm(w)
    rv, rw = rot.quat_rotate(a, v), rot.quat_rotate(a, w)
    assert abs(rv @ rw - v @ w) <= 6 * PRODUCT * scale
    assert np.abs(np.cross(rv, rw) - rot.quat_rotate(a, np.cross(v, w))).max() <= 12 * PRODUCT * scale
    assert np.array_equal(rot.quat_rotate(-a, v), rv) and rot.quat_angle(a, -a) <= PRODUCT


def test_hamilton_and_not_jpl():
    """[Sola2017] (12)."""
    i, j, k = np.eye(4)[1:]
    assert np.array_equal(rot.quat_multiply(i, j), k)  # Hamilton: ij = k; JPL has ij = −k
    assert np.array_equal(rot.quat_multiply(j, i), -k)
    assert np.array_equal(rot.quat_multiply(np.stack((i, j, k)), np.stack((i, j, k))), [-np.eye(4)[0]] * 3)
    quarter = [np.sqrt(0.5), 0, 0, np.sqrt(0.5)]  # cos 45°, sin 45° about z: active, so that x goes to y
    np.testing.assert_allclose(rot.quat_rotate(quarter, [1, 0, 0]), [0, 1, 0], atol=2 * EPS)


def test_shapes_broadcast_and_an_angle_is_the_length_of_the_rotation_vector(rotvec):
    q = rot.quat_from_rotvec(rotvec)
    shape = q.shape[:-1]
    assert rot.quat_multiply(q, q).shape == rot.quat_normalize(q).shape == rot.quat_conjugate(q).shape == (*shape, 4)
    assert rot.quat_rotate(q, [1.0, 0.0, 0.0]).shape == (*shape, 3)
    assert rot.quat_multiply(rot.IDENTITY, q).shape == (*shape, 4)
    assert np.shape(rot.quat_angle(q, rot.IDENTITY)) == shape
    assert rot.quat_to_xyzw(q).shape == (*shape, 4)
    one_to_many = rot.quat_rotate(q[..., np.newaxis, :], np.eye(3))
    np.testing.assert_allclose(np.swapaxes(one_to_many, -1, -2), rot.dcm_from_quat(q), atol=PRODUCT)
    np.testing.assert_allclose(rot.quat_angle(q, rot.IDENTITY), np.linalg.norm(rotvec, axis=-1), rtol=4 * EPS, atol=0)


@pytest.mark.parametrize("size", [1e-300, 1e-20, 1e-12, 1e-9])
def test_angle_between_neighbours_keeps_its_digits(size, quats):
    """Products of four numbers up to 1 leave EPS of noise, whatever the angle: arccos would leave √EPS = 1.5e-8."""
    near = rot.quat_multiply(quats, rot.quat_from_rotvec([0.0, size, 0.0]))
    assert np.abs(rot.quat_angle(quats, near) - size).max() <= 4 * EPS


NO_ROTATION = ([0, 0, 0, 0], [1, np.inf, 0, 0], [0, 0, 0, -np.inf], [1e200, 0, 0, 0])
NO_QUATERNION = (np.zeros(3), np.zeros((4, 3)), 1.0, np.zeros(5), np.ma.zeros(4), [1, 2, 3, "4"], 1j)
REFUSED = [
    *((rot.quat_normalize, [[1, 0, 0, 0], q], "norm zero or infinity") for q in NO_ROTATION),
    *(
        (call, bad, "^q ")
        for call in (rot.quat_conjugate, rot.quat_normalize, rot.dcm_from_quat, rot.quat_to_xyzw)
        for bad in NO_QUATERNION
    ),
]


@pytest.mark.parametrize(("call", "q", "says"), REFUSED)
def test_refused(call, q, says):
    with pytest.raises(ShapeError, match=says):
        call(q)


def test_normalize_keeps_absent_absent_xyzw_is_an_order_and_inputs_are_left_alone(quats):
    q = rot.quat_normalize([[0, 0, 0, 2.0], [np.nan] * 4])
    assert np.array_equal(q, [[0, 0, 0, 1], [np.nan] * 4], equal_nan=True)
    assert np.array_equal(rot.quat_from_xyzw([1, 2, 3, 4]), [4, 1, 2, 3])
    assert np.array_equal(rot.quat_to_xyzw([4, 1, 2, 3]), [1, 2, 3, 4])
    before = quats.copy()
    for call in (rot.quat_conjugate, rot.quat_normalize, rot.quat_to_xyzw, rot.quat_from_xyzw, rot.dcm_from_quat):
        result = call(quats)
        assert not np.shares_memory(result, quats)
    assert np.array_equal(before, quats)
    with pytest.raises(ValueError, match="read-only"):
        rot.IDENTITY[0] = 0.0


class TestSlerp:
    def test_constant_rate_and_ends(self, quats):
        a, b = quats[:500], quats[500:]
        fractions = np.linspace(0.0, 1.0, 11)
        path = rot.quat_slerp(a, b, fractions[:, np.newaxis])
        assert path.shape == (11, 500, 4)
        steps = rot.quat_angle(path[1:], path[:-1])
        whole = rot.quat_angle(a, b)
        assert (whole <= np.pi).all()
        assert np.abs(steps - whole / 10).max() <= 2 * PRODUCT
        assert np.array_equal(rot.quat_slerp(a, b, 0.0), a)
        assert rot.quat_angle(rot.quat_slerp(a, b, 1.0), b).max() <= 2 * PRODUCT
        assert rot.quat_angle(rot.quat_slerp(quats, quats, 0.3), quats).max() <= 2 * PRODUCT

    def test_takes_the_shorter_arc_for_either_sign_and_one_of_the_two_of_a_half_turn(self):
        b = rot.quat_from_rotvec([0, 0, 1.0])
        for end in (b, -b):
            np.testing.assert_allclose(
                rot.quat_slerp(rot.IDENTITY, end, 0.5), rot.quat_from_rotvec([0, 0, 0.5]), atol=PRODUCT
            )
        middle = rot.quat_slerp(rot.IDENTITY, [0.0, 0.0, 1.0, 0.0], 0.5)
        assert abs(rot.quat_angle(middle, rot.IDENTITY) - np.pi / 2) <= PRODUCT


def test_chained_rotations_are_their_product_in_order():
    turns = np.random.default_rng(3).normal(size=(13, 3))
    q = np.array([1.0, 0.0, 0.0, 0.0])
    for i, turn in enumerate(turns, start=1):
        q = rot.quat_multiply(q, rot.quat_from_rotvec(turn))
        assert rot.quat_chained(turns)[i] == pytest.approx(q, abs=1e-14)


MEAN = 64 * EPS  # an eigenvector of a 4 × 4 matrix with gaps of order 1


def test_of_one_is_itself_and_of_two_half_way(quats):
    for a, b in zip(quats[:20], quats[20:40], strict=True):
        assert quat_angle(quat_mean(a[np.newaxis]), a) <= MEAN
        assert all(quat_mean(mean_of)[0] >= 0.0 for mean_of in ([-a], [a, b], [a, -a, -b]))
        gap = abs(a @ b)  # the two eigenvalues are 1 ± |a·b|
        assert quat_angle(quat_mean([a, b]), quat_slerp(a, b, 0.5)) <= MEAN / gap


def test_about_one_axis_is_the_circular_mean_and_weights_count_like_repetitions():
    """[Markley2007] (12): max Σ w (q·q_i)² with angles 2φ = α gives tan α = Σ w sin α_i / Σ w cos α_i."""
    rng = np.random.default_rng(4)
    angle, weight, axis = rng.uniform(-1.5, 1.5, 50), rng.uniform(0.1, 3.0, 50), np.array([0.48, -0.6, 0.64])
    expected = np.arctan2(np.sum(weight * np.sin(angle)), np.sum(weight * np.cos(angle)))
    mean = quat_mean(quat_from_rotvec(angle[:, np.newaxis] * axis), weight)
    assert quat_angle(mean, quat_from_rotvec(expected * axis)) <= MEAN
    a, b = quat_from_rotvec([[0.2, 0, 0], [0, 0.4, 0]])
    assert quat_angle(quat_mean([a, b], [3, 1]), quat_mean([a, a, a, b])) <= MEAN
    assert quat_angle(quat_mean([a, b], [0, 1]), b) <= MEAN
    assert np.array_equal(quat_mean([a, [np.nan] * 4, b]), quat_mean([a, b]))


def test_signs_do_not_matter_and_turning_all_turns_the_average(quats):
    near = quat_multiply(quats[0], quat_from_rotvec(0.1 * np.random.default_rng(1).normal(size=(100, 3))))
    flipped = near * np.where(np.arange(100) % 3 == 0, -1.0, 1.0)[:, np.newaxis]
    assert np.array_equal(quat_mean(near), quat_mean(flipped))
    near = quat_from_rotvec(0.3 * np.random.default_rng(1).normal(size=(100, 3)))
    mean = quat_mean(near)
    assert quat_angle(quat_mean(quat_multiply(quats[5], near)), quat_multiply(quats[5], mean)) <= MEAN
    assert quat_angle(quat_mean(quat_multiply(near, quats[5])), quat_multiply(mean, quats[5])) <= MEAN


NOTHING, TWO = "nothing to average", "not unique"
AVERAGE_REFUSED = [
    *(((q,), NOTHING) for q in (np.zeros((0, 4)), [[np.nan] * 4], [[1, 0, 0, np.nan]])),
    *(((q,), TWO) for q in (np.eye(4), np.eye(4)[:2], quat_from_rotvec([[0, 0, 0], [np.pi, 0, 0]]))),
    *(((np.eye(4)[:2], [1.0, bad]), "weights must be finite and ≥ 0") for bad in (-1.0, np.nan, np.inf)),
    ((np.eye(4), [1.0]), "weights must have one entry"),
]


@pytest.mark.parametrize(("given", "says"), AVERAGE_REFUSED)
def test_what_has_no_average_is_refused(given, says):
    with pytest.raises(ShapeError, match=says):
        quat_mean(*given)


def test_bijection_with_quaternions_by_proper_rotations(rotvec):
    q = quat_from_rotvec(rotvec)
    c = dcm_from_quat(q)
    assert c.shape == (*rotvec.shape, 3)
    assert np.abs(c @ np.swapaxes(c, -1, -2) - np.eye(3)).max(initial=0) <= 8 * EPS
    assert np.abs(np.linalg.det(c) - 1).max(initial=0) <= 8 * EPS
    back = quat_from_dcm(c)
    assert back.shape == q.shape
    assert quat_angle(q, back).max(initial=0) <= 8 * EPS  # entries of the matrix are right to 3 EPS
    assert (back[..., 0] >= 0).all()


def test_the_24_right_angle_rotations_are_exact_and_tolerance_is_on_the_orthogonality():
    """All proper signed permutation matrices: every pivot of the conversion, and all 180° turns."""
    proper = [
        c
        for order in itertools.permutations(range(3))
        for signs in itertools.product((1.0, -1.0), repeat=3)
        if np.linalg.det(c := np.diag(signs)[:, order]) > 0
    ]
    assert len(proper) == 24
    assert np.abs(dcm_from_quat(quat_from_dcm(proper)) - proper).max() <= 2 * EPS
    tilted = np.eye(3)
    tilted[0, 1] = 5e-4
    with pytest.raises(ShapeError, match=r"reaches 0\.0005"):
        quat_from_dcm(tilted)
    np.testing.assert_allclose(quat_from_dcm(tilted, tolerance=1e-3), [1, 0, 0, -1.25e-4], atol=1e-7)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("off", [0.0, 1e-16, 1e-12, 1e-9, 1e-8, 1e-5])
def test_next_to_half_turns_nothing_is_lost(axis, off):
    """A conversion that always divides by the scalar part loses all digits here."""
    q = quat_from_rotvec((np.pi - off) * np.eye(3)[axis])
    assert quat_angle(quat_from_dcm(dcm_from_quat(q)), q) <= 8 * EPS


@pytest.mark.parametrize(("c", "says"), [
    (np.diag([1.0, 1.0, -1.0]), "determinant −1"),
    (-np.eye(3), "determinant −1"),
    (1.001 * np.eye(3), "not orthogonal"),
    (np.zeros((3, 3)), "not orthogonal"),
    (np.full((3, 3), np.nan), "not orthogonal"),
    (np.eye(4), r"shape \(\.\.\., 3\)"),
    (np.ones(3), r"shape \(\.\.\., 3, 3\)"),
    (np.ones((2, 3)), r"shape \(\.\.\., 3, 3\)"),
])  # fmt: skip
def test_refuses_what_is_no_rotation(c, says):
    with pytest.raises(ShapeError, match=says):
        quat_from_dcm(c)


@pytest.fixture(params=["compiled", "py_func"])
def run(request):
    """Call a kernel row by row, on Python floats."""

    def rows(kernel, *tables):
        call = getattr(kernel, request.param)
        return np.array([call(*map(float, row)) for row in np.concatenate(tables, axis=1)])

    return rows


@pytest.fixture
def kernels_vectors():
    return np.random.default_rng(13).normal(size=(1000, 3))


def test_shared_formulas_give_the_same_bits(run, quats, kernels_vectors):
    other = quats[::-1]
    assert np.array_equal(run(kernels.quat_mul, quats, other), quat_multiply(quats, other))
    assert np.array_equal(run(kernels.rotate, quats, kernels_vectors), quat_rotate(quats, kernels_vectors))
    assert np.array_equal(
        run(kernels.cross, kernels_vectors, kernels_vectors[::-1]), np.cross(kernels_vectors, kernels_vectors[::-1])
    )
    np.testing.assert_allclose(run(kernels.third_row, quats), dcm_from_quat(quats)[:, 2], rtol=0, atol=2 * EPS)


def test_twins_agree_to_rounding(run, quats, kernels_vectors):
    """Where the array function is written otherwise, the two differ by their own roundings: 2 EPS each."""
    scaled = quats * np.logspace(-100, 100, 1000)[:, np.newaxis]
    np.testing.assert_allclose(run(kernels.quat_unit, scaled), quat_normalize(scaled), rtol=4 * EPS, atol=0)
    for size in (1e-9, 9e-3, 1.1e-2, 1.0):
        r = size * kernels_vectors
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
