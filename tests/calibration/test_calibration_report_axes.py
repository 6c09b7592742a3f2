"""Gains and directions of planted sensing axes, and their standard deviations against small changes."""

import numpy as np
import pytest

from plumbob.calibration.report import sensing_axes
from plumbob.core.units import deg
from tests.helpers.certificate_samples import acc_calibration, covariance, mag_calibration

EPS = np.finfo(float).eps


def test_planted_axes_are_found():
    axes = sensing_axes(mag_calibration())
    assert axes.scale == pytest.approx([0.02, 0.0, 0.0], abs=8 * EPS)
    assert axes.misalignment == pytest.approx([0.0, deg(1.0), 0.0], abs=1e-12)  # √(1 − cos²) of 1° keeps 12 digits
    assert axes.skew == pytest.approx([-deg(1.0), 0.0, 0.0], abs=16 * EPS)  # y leans towards x: less than 90°


def test_a_turned_triad_is_misaligned_but_not_skewed():
    """A turn by 2° about z moves x and y, keeps z and all angles between axes."""
    c, s = np.cos(deg(2.0)), np.sin(deg(2.0))
    axes = sensing_axes(acc_calibration(matrix=[[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]))
    assert axes.misalignment == pytest.approx([deg(2.0), deg(2.0), 0.0], abs=1e-12)
    assert np.array_equal(axes.scale, [0.0, 0.0, 0.0])
    assert np.array_equal(axes.skew, [0.0, 0.0, 0.0])


def test_a_perfect_triad_has_no_errors():
    axes = sensing_axes(acc_calibration())
    assert not np.concatenate([axes.scale, axes.misalignment, axes.skew]).any()
    assert axes.scale_sd is None


def test_standard_deviations_of_the_gains_follow_the_matrix():
    """To first order: the gain of axis i of (M + h e_k e_lᵀ)⁻¹ over h, by central differences."""
    half = np.random.default_rng(5).normal(size=(12, 12)) * 1e-3
    model = mag_calibration(covariance=half @ half.T)
    h, slopes = 1e-6, np.zeros((3, 9))
    for k in range(9):
        step = h * np.eye(9)[k].reshape(3, 3)
        up, down = (np.linalg.norm(np.linalg.inv(model.matrix + sign * step), axis=1) for sign in (1.0, -1.0))
        slopes[:, k] = (up - down) / (2.0 * h)
    expected = np.sqrt(np.diag(slopes @ model.covariance[3:, 3:] @ slopes.T))
    # rounding eps/h and curvature h² of numbers near 1
    assert sensing_axes(model).scale_sd == pytest.approx(expected, rel=10 * EPS / h)


def test_a_diagonal_matrix_has_the_gains_of_its_inverse():
    """s = 1/m, and sd(s) = sd(m)/m²."""
    axes = sensing_axes(acc_calibration(matrix=np.diag([0.5, 1.0, 2.0]), covariance=covariance(0.0, 1e-3)))
    assert axes.scale == pytest.approx([1.0, 0.0, -0.5], abs=4 * EPS)
    assert axes.scale_sd == pytest.approx([4e-3, 1e-3, 2.5e-4], rel=8 * EPS)
