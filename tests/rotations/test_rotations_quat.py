"""Quaternion algebra: the axioms of a group, and of its action on vectors."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra import numpy as hnp

from plumbob.core.errors import ShapeError
from plumbob.rotations import (
    IDENTITY,
    dcm_from_quat,
    quat_angle,
    quat_chained,
    quat_conjugate,
    quat_from_rotvec,
    quat_from_xyzw,
    quat_multiply,
    quat_normalize,
    quat_rotate,
    quat_slerp,
    quat_to_xyzw,
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
    associated = quat_multiply(quat_multiply(a, b), c) - quat_multiply(a, quat_multiply(b, c))
    assert np.abs(associated).max() <= 2 * PRODUCT
    assert np.array_equal(quat_multiply(a, IDENTITY), a)
    assert np.array_equal(quat_multiply(IDENTITY, a), a)
    assert np.abs(quat_multiply(a, quat_conjugate(a)) - IDENTITY).max() <= PRODUCT
    both = quat_rotate(quat_multiply(a, b), v) - quat_rotate(a, quat_rotate(b, v))
    assert np.abs(both).max() <= 6 * PRODUCT * np.linalg.norm(v)
    scale = np.linalg.norm(v) * np.linalg.norm(w)
    rv, rw = quat_rotate(a, v), quat_rotate(a, w)
    assert abs(rv @ rw - v @ w) <= 6 * PRODUCT * scale
    assert np.abs(np.cross(rv, rw) - quat_rotate(a, np.cross(v, w))).max() <= 12 * PRODUCT * scale
    assert np.array_equal(quat_rotate(-a, v), rv) and quat_angle(a, -a) <= PRODUCT


def test_hamilton_and_not_jpl():
    """[Sola2017] (12)."""
    i, j, k = np.eye(4)[1:]
    assert np.array_equal(quat_multiply(i, j), k)  # Hamilton: ij = k; JPL has ij = −k
    assert np.array_equal(quat_multiply(j, i), -k)
    assert np.array_equal(quat_multiply(np.stack((i, j, k)), np.stack((i, j, k))), [-np.eye(4)[0]] * 3)
    quarter = [np.sqrt(0.5), 0, 0, np.sqrt(0.5)]  # cos 45°, sin 45° about z: active, so that x goes to y
    np.testing.assert_allclose(quat_rotate(quarter, [1, 0, 0]), [0, 1, 0], atol=2 * EPS)


def test_shapes_broadcast_and_an_angle_is_the_length_of_the_rotation_vector(rotvec):
    q = quat_from_rotvec(rotvec)
    shape = q.shape[:-1]
    assert quat_multiply(q, q).shape == quat_normalize(q).shape == quat_conjugate(q).shape == (*shape, 4)
    assert quat_rotate(q, [1.0, 0.0, 0.0]).shape == (*shape, 3)
    assert quat_multiply(IDENTITY, q).shape == (*shape, 4)
    assert np.shape(quat_angle(q, IDENTITY)) == shape
    assert quat_to_xyzw(q).shape == (*shape, 4)
    one_to_many = quat_rotate(q[..., np.newaxis, :], np.eye(3))
    np.testing.assert_allclose(np.swapaxes(one_to_many, -1, -2), dcm_from_quat(q), atol=PRODUCT)
    np.testing.assert_allclose(quat_angle(q, IDENTITY), np.linalg.norm(rotvec, axis=-1), rtol=4 * EPS, atol=0)


@pytest.mark.parametrize("size", [1e-300, 1e-20, 1e-12, 1e-9])
def test_angle_between_neighbours_keeps_its_digits(size, quats):
    """Products of four numbers up to 1 leave EPS of noise, whatever the angle: arccos would leave √EPS = 1.5e-8."""
    near = quat_multiply(quats, quat_from_rotvec([0.0, size, 0.0]))
    assert np.abs(quat_angle(quats, near) - size).max() <= 4 * EPS


NO_ROTATION = ([0, 0, 0, 0], [1, np.inf, 0, 0], [0, 0, 0, -np.inf], [1e200, 0, 0, 0])
NO_QUATERNION = (np.zeros(3), np.zeros((4, 3)), 1.0, np.zeros(5), np.ma.zeros(4), [1, 2, 3, "4"], 1j)
REFUSED = [
    *((quat_normalize, [[1, 0, 0, 0], q], "norm zero or infinity") for q in NO_ROTATION),
    *(
        (call, bad, "^q ")
        for call in (quat_conjugate, quat_normalize, dcm_from_quat, quat_to_xyzw)
        for bad in NO_QUATERNION
    ),
]


@pytest.mark.parametrize(("call", "q", "says"), REFUSED)
def test_refused(call, q, says):
    with pytest.raises(ShapeError, match=says):
        call(q)


def test_normalize_keeps_absent_absent_xyzw_is_an_order_and_inputs_are_left_alone(quats):
    q = quat_normalize([[0, 0, 0, 2.0], [np.nan] * 4])
    assert np.array_equal(q, [[0, 0, 0, 1], [np.nan] * 4], equal_nan=True)
    assert np.array_equal(quat_from_xyzw([1, 2, 3, 4]), [4, 1, 2, 3])
    assert np.array_equal(quat_to_xyzw([4, 1, 2, 3]), [1, 2, 3, 4])
    before = quats.copy()
    for call in (quat_conjugate, quat_normalize, quat_to_xyzw, quat_from_xyzw, dcm_from_quat):
        result = call(quats)
        assert not np.shares_memory(result, quats)
    assert np.array_equal(before, quats)
    with pytest.raises(ValueError, match="read-only"):
        IDENTITY[0] = 0.0


class TestSlerp:
    def test_constant_rate_and_ends(self, quats):
        a, b = quats[:500], quats[500:]
        fractions = np.linspace(0.0, 1.0, 11)
        path = quat_slerp(a, b, fractions[:, np.newaxis])
        assert path.shape == (11, 500, 4)
        steps = quat_angle(path[1:], path[:-1])
        whole = quat_angle(a, b)
        assert (whole <= np.pi).all()
        assert np.abs(steps - whole / 10).max() <= 2 * PRODUCT
        assert np.array_equal(quat_slerp(a, b, 0.0), a)
        assert quat_angle(quat_slerp(a, b, 1.0), b).max() <= 2 * PRODUCT
        assert quat_angle(quat_slerp(quats, quats, 0.3), quats).max() <= 2 * PRODUCT

    def test_takes_the_shorter_arc_for_either_sign_and_one_of_the_two_of_a_half_turn(self):
        b = quat_from_rotvec([0, 0, 1.0])
        for end in (b, -b):
            np.testing.assert_allclose(quat_slerp(IDENTITY, end, 0.5), quat_from_rotvec([0, 0, 0.5]), atol=PRODUCT)
        middle = quat_slerp(IDENTITY, [0.0, 0.0, 1.0, 0.0], 0.5)
        assert abs(quat_angle(middle, IDENTITY) - np.pi / 2) <= PRODUCT


def test_chained_rotations_are_their_product_in_order():
    turns = np.random.default_rng(3).normal(size=(13, 3))
    q = np.array([1.0, 0.0, 0.0, 0.0])
    for i, turn in enumerate(turns, start=1):
        q = quat_multiply(q, quat_from_rotvec(turn))
        assert quat_chained(turns)[i] == pytest.approx(q, abs=1e-14)
