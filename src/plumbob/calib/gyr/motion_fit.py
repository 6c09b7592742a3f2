"""Least squares of a gyroscope's bias and matrix from motions between poses [Tedaldi2014].

Departures from [Tedaldi2014]: the integration is exact on SO(3) instead of Runge-Kutta of the fourth order; its
derivative is formed along with it, so that a few steps of Gauss and Newton suffice; the bias takes part with what the
rest says about it; the axes are all the accelerometer's, none is fixed to the gyroscope's own.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.calib.gyr.motions import Motion
from plumbob.calib.gyr.turn import accumulate, rotation_vectors
from plumbob.calib.normal import inverse_of
from plumbob.check import Floats
from plumbob.rotations import dcm_from_quat, skew

FEWEST: Final = 9
"""Fewest motions: each gives two equations, and some must be left to show what they are worth."""

FAR: Final = 5.0
"""Robust standard deviations from which on a motion is an outlier."""

_STEPS: Final = 8


@dataclass(frozen=True, eq=False, slots=True)
class MotionFit:
    """Fit of the motions.

    Attributes
    ----------
    matrix, bias : ndarray (3, 3), (3,)
        Of the gyroscope: ``rate = matrix @ (measured − bias)``, rad/s.
    covariance : ndarray (12, 12)
        Of bias and matrix, row by row.
    residuals : ndarray (m, 3)
        Measured less predicted direction of gravity after each motion, of unit vectors.
    used : ndarray (m,) of bool
        False for outliers.
    condition : float
        Of the normal matrix of the matrix' entries, scaled to a diagonal of one.
    """

    matrix: Floats
    bias: Floats
    covariance: Floats
    residuals: Floats
    used: NDArray[np.bool_]
    condition: float

    @property
    def bias_sd(self) -> Floats:
        """Standard deviations (3,) of the bias, rad/s."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[:3]))

    @property
    def matrix_sd(self) -> Floats:
        """Standard deviations (3, 3) of the matrix."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[3:]).reshape(3, 3))


def fit_motions(motions: Sequence[Motion], rest_bias: Floats, rest_sd: Floats) -> MotionFit:
    """Least squares over bias and matrix, with outliers set aside once.

    Parameters
    ----------
    motions : sequence of Motion
        `FEWEST` at least.
    rest_bias, rest_sd : ndarray (3,)
        Bias at rest, which is one more measurement, and its standard deviation, rad/s.
    """
    used = np.ones(len(motions), dtype=bool)
    fit = _least_squares(motions, rest_bias, rest_sd, used)
    size = np.linalg.norm(fit.residuals, axis=1)
    far = FAR * 1.4826 * float(np.median(size))
    if (size > far).any() and np.count_nonzero(size <= far) >= FEWEST:
        fit = _least_squares(motions, rest_bias, rest_sd, size <= far)
    return fit


def _least_squares(motions: Sequence[Motion], rest_bias: Floats, rest_sd: Floats, used: NDArray[np.bool_]) -> MotionFit:
    """Gauss and Newton, in which the bias at rest is one more measurement of the bias."""
    parameters = np.concatenate((rest_bias, np.eye(3).ravel()))
    weight = np.zeros((12, 12))
    free = 2.0 * np.count_nonzero(used) - 9.0  # a unit vector has two components
    floor = np.finfo(np.float64).eps
    for step in range(_STEPS):
        left, slope = _misses(motions, parameters)
        noise = max(float(np.sum(left[used] ** 2)) / free, floor)
        held = noise / np.maximum(rest_sd, floor) ** 2
        # Before the first step the misses are those of an uncalibrated unit and say nothing of the noise.
        weight[:3, :3] = np.diag(held if step else np.full(3, 1.0 / floor))
        rows, misses = slope[used].reshape(-1, 12), left[used].ravel()
        normal = rows.T @ rows + weight
        away = np.concatenate((rest_bias - parameters[:3], np.zeros(9)))
        inverse = inverse_of(normal).matrix  # bias and matrix, whose sizes differ by many powers of ten, count alike
        parameters = parameters + inverse @ (rows.T @ misses + weight @ away)
    left, _ = _misses(motions, parameters)
    matrix = rows[:, 3:].T @ rows[:, 3:]
    scale = np.sqrt(np.maximum(np.diag(matrix), floor))
    condition = float(np.linalg.cond(matrix / np.outer(scale, scale)))
    return MotionFit(parameters[3:].reshape(3, 3), parameters[:3], noise * inverse, left, used, condition)


def _misses(motions: Sequence[Motion], parameters: Floats) -> tuple[Floats, Floats]:
    """Measured less predicted direction after each motion (m, 3), and the prediction's derivative (m, 3, 12)."""
    bias, matrix = parameters[:3], parameters[3:].reshape(3, 3)
    each = [_predicted(motion, bias, matrix) for motion in motions]
    left = np.array([motion.after - after for motion, (after, _) in zip(motions, each, strict=True)])
    return left, np.array([slope for _, slope in each])


def _predicted(motion: Motion, bias: Floats, matrix: Floats) -> tuple[Floats, Floats]:
    """Direction after a motion (3,), and its derivative by bias and matrix (3, 12).

    With R from the axes now to those before, after = Rᵀ before. A change δω of the rates turns R by δθ = ∫ R δω dt in
    the axes before, so that after changes by Rᵀ (before × δθ).
    """
    open_rate = motion.rate - bias
    quat = np.empty((len(open_rate), 4))
    accumulate(rotation_vectors(open_rate @ matrix.T, motion.dt), quat)
    turned = dcm_from_quat(quat)
    share = np.append(0.5 * motion.dt, 0.0) + np.append(0.0, 0.5 * motion.dt)  # the trapezoidal rule
    by_matrix = np.einsum("kai,kj,k->aij", turned, open_rate, share, optimize=True).reshape(3, 9)
    by_bias = -np.einsum("kai,k->ai", turned, share) @ matrix
    back = turned[-1].T
    return back @ motion.before, back @ skew(motion.before) @ np.hstack((by_bias, by_matrix))


def typical_miss(motions: Sequence[Motion], bias: Floats, matrix: Floats) -> float:
    """Median angle, rad, by which gravity comes out wrong after a motion."""
    left, _ = _misses(motions, np.concatenate((bias, matrix.ravel())))
    return float(np.median(np.linalg.norm(left, axis=1)))
