"""Agreement with scipy.spatial.transform.Rotation, an independent program."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from plumbob.core.errors import ShapeError
from plumbob.rotations import (
    dcm_from_quat,
    euler_zyx_from_quat,
    quat_angle,
    quat_from_dcm,
    quat_from_euler_zyx,
    quat_from_rotation,
    quat_from_rotvec,
    quat_mean,
    quat_multiply,
    quat_rotate,
    quat_slerp,
    rotation_from_quat,
    rotvec_from_quat,
)

EPS = np.finfo(float).eps
BOTH = 16 * EPS  # the roundings of the two programs


@pytest.fixture
def theirs(quats):
    return Rotation.from_quat(quats[:, [1, 2, 3, 0]])


def test_bridge(quats, theirs):
    assert quat_angle(quat_from_rotation(rotation_from_quat(quats)), quats).max() <= BOTH
    assert (rotation_from_quat(quats) * theirs.inv()).magnitude().max() <= BOTH
    assert rotation_from_quat(quats[0]).single
    assert quat_from_rotation(rotation_from_quat(quats[0])).shape == (4,)
    with pytest.raises(ShapeError, match="has norm 2"):
        rotation_from_quat([2.0, 0, 0, 0])


def test_product_matrix_and_vectors(quats, theirs):
    """[Sola2017] (115)."""
    assert quat_angle(quat_multiply(quats, quats[::-1]), quat_from_rotation(theirs * theirs[::-1])).max() <= BOTH
    assert np.abs(dcm_from_quat(quats) - theirs.as_matrix()).max() <= BOTH
    assert quat_angle(quat_from_dcm(theirs.as_matrix()), quats).max() <= BOTH
    v = np.random.default_rng(1).normal(size=(1000, 3))
    assert np.abs(quat_rotate(quats, v) - theirs.apply(v)).max() <= BOTH * np.abs(v).max()


def test_exponential_and_logarithm(quats, theirs):
    for size in (1e-12, 1e-4, 1.0, np.pi):
        rotvec = size * quats[:20, 1:] / np.linalg.norm(quats[:20, 1:], axis=1, keepdims=True)
        assert quat_angle(quat_from_rotvec(rotvec), quat_from_rotation(Rotation.from_rotvec(rotvec))).max() <= BOTH
    assert np.abs(rotvec_from_quat(quats) - theirs.as_rotvec()).max() <= np.pi * BOTH


def test_euler(quats, theirs):
    away = np.abs(euler_zyx_from_quat(quats)[:, 1]) < 1.5  # there both have their digits: cos 1.5 = 0.07
    ours, expected = euler_zyx_from_quat(quats[away]), theirs[away].as_euler("ZYX")
    assert np.count_nonzero(away) > 900
    assert np.abs((ours - expected + np.pi) % (2 * np.pi) - np.pi).max() <= 14 * BOTH
    assert quat_angle(quat_from_euler_zyx(expected), quats[away]).max() <= BOTH


def test_mean_and_slerp(quats, theirs):
    near = quat_multiply(quats[0], quat_from_rotvec(0.2 * np.random.default_rng(1).normal(size=(50, 3))))
    weights = np.linspace(0.1, 1.0, 50)
    assert quat_angle(quat_mean(near, weights), quat_from_rotation(rotation_from_quat(near).mean(weights))) <= 4 * BOTH
    fractions = np.linspace(0, 1, 7)
    path = Slerp([0, 1], theirs[:2])(fractions)
    assert quat_angle(quat_slerp(quats[0], quats[1], fractions), quat_from_rotation(path)).max() <= BOTH
