"""Turns between poses, and the least squares of a gyroscope's bias and matrix from them [Tedaldi2014].

Departures from [Tedaldi2014]: the integration is exact on SO(3) instead of Runge-Kutta of the fourth order; its
derivative is formed along with it, so that a few steps of Gauss and Newton suffice; the bias takes part with what the
rest says about it; the axes are all the accelerometer's, none is fixed to the gyroscope's own.

Sensitivity of a gyroscope to specific force, from its bias in poses at rest: it costs no table.

At rest the rate is the bias plus G times gravity, so poses of all directions tell G. Gravity is the only force there is
at rest, and the vertical part of the Earth's rotation goes with it: up to 0.0042 °/s per g on the diagonal.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.fit import invert
from plumbob.calibration.gyr.drift import accumulate, rotation_vectors
from plumbob.core.check import Floats
from plumbob.core.units import deg
from plumbob.rotations import dcm_from_quat, skew

SMALLEST: Final = float(deg(15.0))
"""Smallest change of the direction of gravity that makes a motion, rad."""


@dataclass(frozen=True, eq=False, slots=True)
class TurnBetweenPoses:
    """One motion between two poses.

    Attributes
    ----------
    rate : ndarray (N, 3)
        Measured rates from the last instant at rest to the next first one, rad/s.
    dt : ndarray (N−1,)
        Steps, s.
    before, after : ndarray (3,)
        Directions of the specific force at rest, unit vectors.
    """

    rate: Floats
    dt: Floats
    before: Floats
    after: Floats


def find_motions(
    t: Floats, gyr: Floats, acc: Floats, where: Sequence[slice], clipped: NDArray[np.bool_] | None = None
) -> tuple[list[TurnBetweenPoses], dict[str, int]]:
    """Motions between stretches at rest that tilted the unit, and how many were left out, by reason."""
    motions, spoilt = [], {"clipping": 0, "gap": 0}
    step = 1.5 * float(np.median(np.diff(t)))
    for first, second in pairwise(where):
        span = slice(first.stop - 1, second.start + 1)
        before, after = _direction(acc[first]), _direction(acc[second])
        if float(before @ after) > np.cos(SMALLEST):
            continue
        dt = np.diff(t[span])
        if clipped is not None and clipped[span].any():
            spoilt["clipping"] += 1
        elif dt.max() > step or not np.isfinite(gyr[span]).all():
            spoilt["gap"] += 1
        else:
            motions.append(TurnBetweenPoses(gyr[span], dt, before, after))
    return motions, spoilt


def _direction(acc: Floats) -> Floats:
    mean = acc.mean(axis=0)
    return np.asarray(mean / np.linalg.norm(mean))


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


def fit_motions(motions: Sequence[TurnBetweenPoses], rest_bias: Floats, rest_sd: Floats) -> MotionFit:
    """Least squares over bias and matrix, with outliers set aside once.

    Parameters
    ----------
    motions : sequence of TurnBetweenPoses
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


def _least_squares(
    motions: Sequence[TurnBetweenPoses], rest_bias: Floats, rest_sd: Floats, used: NDArray[np.bool_]
) -> MotionFit:
    """Gauss and Newton, in which the bias at rest is one more measurement of the bias."""
    parameters = np.concatenate((rest_bias, np.eye(3).ravel()))
    weight = np.zeros((12, 12))
    free = 2.0 * np.count_nonzero(used) - 9.0  # a unit vector has two components
    floor = np.finfo(np.float64).eps
    for step in range(_STEPS):
        residuals, slope = _misses(motions, parameters)
        noise = max(float(np.sum(residuals[used] ** 2)) / free, floor)
        held = noise / np.maximum(rest_sd, floor) ** 2
        # Before the first step the misses are those of an uncalibrated unit and say nothing of the noise.
        weight[:3, :3] = np.diag(held if step else np.full(3, 1.0 / floor))
        rows, misses = slope[used].reshape(-1, 12), residuals[used].ravel()
        normal = rows.T @ rows + weight  # departs from [Tedaldi2014]: the bias at rest is one more measurement
        away = np.concatenate((rest_bias - parameters[:3], np.zeros(9)))
        inverse = invert(normal).matrix  # bias and matrix, whose sizes differ by many powers of ten, count alike
        parameters = parameters + inverse @ (rows.T @ misses + weight @ away)
    residuals, _ = _misses(motions, parameters)
    matrix = rows[:, 3:].T @ rows[:, 3:]
    scale = np.sqrt(np.maximum(np.diag(matrix), floor))
    condition = float(np.linalg.cond(matrix / np.outer(scale, scale)))
    return MotionFit(parameters[3:].reshape(3, 3), parameters[:3], noise * inverse, residuals, used, condition)


def _misses(motions: Sequence[TurnBetweenPoses], parameters: Floats) -> tuple[Floats, Floats]:
    """Measured less predicted direction after each motion (m, 3), and the prediction's derivative (m, 3, 12)."""
    bias, matrix = parameters[:3], parameters[3:].reshape(3, 3)
    each = [_predicted(motion, bias, matrix) for motion in motions]
    # [Tedaldi2014]
    residuals = np.array([motion.after - after for motion, (after, _) in zip(motions, each, strict=True)])
    return residuals, np.array([slope for _, slope in each])


def _predicted(motion: TurnBetweenPoses, bias: Floats, matrix: Floats) -> tuple[Floats, Floats]:
    """Direction after a motion (3,), and its derivative by bias and matrix (3, 12).

    With R from the axes now to those before, after = Rᵀ before. A change δω of the rates turns R by δθ = ∫ R δω dt in
    the axes before, so that after changes by Rᵀ (before × δθ).
    """
    open_rate = motion.rate - bias
    quat = np.empty((len(open_rate), 4))
    accumulate(rotation_vectors(open_rate @ matrix.T, motion.dt), quat)  # departs from [Tedaldi2014]: exact on SO(3)
    turned = dcm_from_quat(quat)
    share = np.append(0.5 * motion.dt, 0.0) + np.append(0.0, 0.5 * motion.dt)  # the trapezoidal rule
    by_matrix = np.einsum("kai,kj,k->aij", turned, open_rate, share, optimize=True).reshape(3, 9)
    by_bias = -np.einsum("kai,k->ai", turned, share) @ matrix
    back = turned[-1].T
    return back @ motion.before, back @ skew(motion.before) @ np.hstack((by_bias, by_matrix))


def typical_miss(motions: Sequence[TurnBetweenPoses], bias: Floats, matrix: Floats) -> float:
    """Median angle, rad, by which gravity comes out wrong after a motion."""
    residuals, _ = _misses(motions, np.concatenate((bias, matrix.ravel())))
    return float(np.median(np.linalg.norm(residuals, axis=1)))


FEWEST_RATES: Final = 12
"""Fewest poses: each axis has four parameters, and what they leave must tell noise."""

SIGNIFICANCE: Final = 0.01
"""Probability of finding a sensitivity where there is none."""

_NARROW: Final = 30.0  # condition number of constant and directions; poses of all kinds have 2 to 4


class Coupling(NamedTuple):
    """G (3, 3), rad/s per m/s², its standard deviations (3, 3), and the chance that noise made it."""

    matrix: Floats
    sd: Floats
    chance: float


def coupling_at_rest(rates: Floats, forces: Floats) -> Coupling | None:
    """G of the mean rates and forces of poses at rest; None where they cannot tell, or show none.

    Parameters
    ----------
    rates : ndarray (K, 3)
        Mean measured rate of each pose, rad/s.
    forces : ndarray (K, 3)
        Mean calibrated specific force of each pose, m/s².
    """
    from scipy.special import fdtrc

    if len(rates) < FEWEST_RATES:
        return None
    size = float(np.linalg.norm(forces, axis=1).mean())
    rows = np.column_stack((np.ones(len(forces)), forces / size))
    if np.linalg.cond(rows) > _NARROW:
        return None
    solution, *_ = np.linalg.lstsq(rows, rates, rcond=None)
    freedom = len(rates) - 4
    squares = np.sum((rates - rows @ solution) ** 2)
    gained = np.sum((rates - rates.mean(axis=0)) ** 2) - squares
    chance = float(fdtrc(9.0, 3.0 * freedom, gained / 9.0 / max(squares / (3.0 * freedom), 1e-300)))
    if chance >= SIGNIFICANCE:
        return None
    noise = np.sum((rates - rows @ solution) ** 2, axis=0) / freedom
    spread = np.sqrt(np.outer(noise, np.diag(np.linalg.inv(rows.T @ rows))[1:]))
    return Coupling(np.asarray(solution[1:].T / size, dtype=np.float64), np.asarray(spread / size), chance)
