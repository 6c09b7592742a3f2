"""Direction cosine matrices."""

import itertools

import numpy as np
import pytest

from plumbob.core.errors import ShapeError
from plumbob.rotations import dcm_from_quat, quat_angle, quat_from_dcm, quat_from_rotvec, quat_rotate

EPS = np.finfo(float).eps


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


def test_matrix_times_vector_is_rotation_of_vector(quats):
    """[Sola2017] (115)."""
    v = np.random.default_rng(5).normal(size=(1000, 3))
    turned = (dcm_from_quat(quats) @ v[..., np.newaxis])[..., 0]
    np.testing.assert_allclose(turned, quat_rotate(quats, v), rtol=0, atol=16 * EPS * np.abs(v).max())


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
