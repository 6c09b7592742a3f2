"""The average of rotations against closed forms."""

import numpy as np
import pytest

from plumbob.core.errors import ShapeError
from plumbob.rotations import quat_angle, quat_from_rotvec, quat_mean, quat_multiply, quat_slerp

EPS = np.finfo(float).eps
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
REFUSED = [
    *(((q,), NOTHING) for q in (np.zeros((0, 4)), [[np.nan] * 4], [[1, 0, 0, np.nan]])),
    *(((q,), TWO) for q in (np.eye(4), np.eye(4)[:2], quat_from_rotvec([[0, 0, 0], [np.pi, 0, 0]]))),
    *(((np.eye(4)[:2], [1.0, bad]), "weights must be finite and ≥ 0") for bad in (-1.0, np.nan, np.inf)),
    ((np.eye(4), [1.0]), "weights must have one entry"),
]


@pytest.mark.parametrize(("given", "says"), REFUSED)
def test_what_has_no_average_is_refused(given, says):
    with pytest.raises(ShapeError, match=says):
        quat_mean(*given)
