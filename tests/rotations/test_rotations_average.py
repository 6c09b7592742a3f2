"""The average of rotations against closed forms."""

import numpy as np
import pytest

from plumbob.core.errors import ShapeError
from plumbob.rotations import quat_angle, quat_from_rotvec, quat_mean, quat_multiply, quat_slerp

EPS = np.finfo(float).eps
MEAN = 64 * EPS  # an eigenvector of a 4 × 4 matrix with gaps of order 1


def test_one_rotation_is_its_own_average(quats):
    for q in quats[:20]:
        assert quat_angle(quat_mean(q[np.newaxis]), q) <= MEAN
        assert quat_mean(-q[np.newaxis])[0] >= 0


def test_of_two_is_half_way(quats):
    for a, b in zip(quats[:20], quats[20:40], strict=True):
        gap = abs(a @ b)  # the two eigenvalues are 1 ± |a·b|
        assert quat_angle(quat_mean([a, b]), quat_slerp(a, b, 0.5)) <= MEAN / gap


def test_about_one_axis_is_the_circular_mean():
    """[Markley2007] (12): max Σ w (q·q_i)² with angles 2φ = α gives tan α = Σ w sin α_i / Σ w cos α_i."""
    rng = np.random.default_rng(4)
    angle, weight, axis = rng.uniform(-1.5, 1.5, 50), rng.uniform(0.1, 3.0, 50), np.array([0.48, -0.6, 0.64])
    expected = np.arctan2(np.sum(weight * np.sin(angle)), np.sum(weight * np.cos(angle)))
    mean = quat_mean(quat_from_rotvec(angle[:, np.newaxis] * axis), weight)
    assert quat_angle(mean, quat_from_rotvec(expected * axis)) <= MEAN


def test_signs_do_not_matter(quats):
    near = quat_multiply(quats[0], quat_from_rotvec(0.1 * np.random.default_rng(1).normal(size=(100, 3))))
    flipped = near * np.where(np.arange(100) % 3 == 0, -1.0, 1.0)[:, np.newaxis]
    assert np.array_equal(quat_mean(near), quat_mean(flipped))


def test_turning_all_turns_the_average(quats):
    near = quat_from_rotvec(0.3 * np.random.default_rng(1).normal(size=(100, 3)))
    mean = quat_mean(near)
    assert quat_angle(quat_mean(quat_multiply(quats[5], near)), quat_multiply(quats[5], mean)) <= MEAN
    assert quat_angle(quat_mean(quat_multiply(near, quats[5])), quat_multiply(mean, quats[5])) <= MEAN


def test_weights_count_like_repetitions():
    a, b = quat_from_rotvec([[0.2, 0, 0], [0, 0.4, 0]])
    assert quat_angle(quat_mean([a, b], [3, 1]), quat_mean([a, a, a, b])) <= MEAN
    assert quat_angle(quat_mean([a, b], [0, 1]), b) <= MEAN


def test_absent_rows_are_left_out():
    q = quat_from_rotvec([[0.2, 0, 0], [0, 0.4, 0]])
    assert np.array_equal(quat_mean([q[0], [np.nan] * 4, q[1]]), quat_mean(q))


@pytest.mark.parametrize("q", [np.zeros((0, 4)), [[np.nan] * 4], [[1, 0, 0, np.nan]]])
def test_nothing_to_average(q):
    with pytest.raises(ShapeError, match="nothing to average"):
        quat_mean(q)


@pytest.mark.parametrize("q", [np.eye(4), np.eye(4)[:2], quat_from_rotvec([[0, 0, 0], [np.pi, 0, 0]])])
def test_no_unique_average(q):
    with pytest.raises(ShapeError, match="not unique"):
        quat_mean(q)


@pytest.mark.parametrize("bad", [-1.0, np.nan, np.inf])
def test_weights_must_be_weights(bad):
    with pytest.raises(ShapeError, match="weights must be finite and ≥ 0"):
        quat_mean(np.eye(4)[:2], [1.0, bad])


def test_one_weight_for_each():
    with pytest.raises(ShapeError, match="weights must have one entry"):
        quat_mean(np.eye(4), [1.0])
