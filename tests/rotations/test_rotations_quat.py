"""Quaternion algebra: the axioms of a group, and of its action on vectors."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra import numpy as hnp

from plumbob import rotations as rot
from plumbob.core.errors import ShapeError

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
