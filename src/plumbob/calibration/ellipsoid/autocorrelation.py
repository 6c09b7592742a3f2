"""How many samples of a capture count as one: errors that stay while the unit turns do not average out.

A least-squares covariance takes every sample for a new one. Noise has a memory, so neighbours are not new; it is looked
for from sample to sample, and from one `visit` of a direction to the next.

An uneven field is worse. Let the field change by G per metre, and the sensor sit at l, in its own axes, off the point
about which the unit is turned. The length of the field then errs by ``(G b̂)·(R l)``, R the attitude and b̂ the field's
direction. The part of ``G b̂`` across the field is seen: it stays in the residuals, slowly changing. The part along it
is not: it is a hard iron of that size along l, for as long as the capture may last. For a G of no preferred direction
the two are about equal, so the slow part of the residuals shows how large the unseen error is: as large as if there had
been 4.5 samples. What a visit shares with itself and with the next one because noise was filtered, by its memory from
sample to sample, is not such a part.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.ellipsoid.ellipsoid_fit import NormFit
from plumbob.calibration.ellipsoid.segments import FEWEST_VISITS, STAYING, correlation, means_of, staying, visits
from plumbob.core.check import Floats

LONG: Final = 100
"""Residuals from which on their memory is looked for."""

SLOW: Final = 4.5
"""Samples that errors which stay count as: an axis of a sphere's centre has the variance 3σ²/N, and the unseen one ⅔ of
the slow power per axis, for a gradient G that is symmetric, traceless and normal."""

_TAKEN_UP: Final = 9  # visits whose errors the parameters take up


class Alike(NamedTuple):
    """How many samples count as one, at least 1: as neighbours, and as errors that never average out."""

    memory: float
    unevenness: float = 1.0

    @property
    def factor(self) -> float:
        """What a covariance that takes them for independent is too small by."""
        return max(self.memory, self.unevenness)


def alike_in(fit: NormFit, vectors: Floats) -> Alike:
    """How many of the vectors (N, 3) that an ellipsoid was fitted to count as one, as `alike`."""
    return alike(fit.residuals, (vectors - fit.ellipsoid.centre) @ fit.ellipsoid.shape, fit.used)


def alike(residuals: Floats, directions: Floats, used: NDArray[np.bool_]) -> Alike:
    """How many residuals of lengths or angles count as one.

    Parameters
    ----------
    residuals : ndarray (N,) or (N, C)
        What a fit leaves of each sample, in order of time; of C equations, the worst counts.
    directions : ndarray (N, 3) or (N, 2)
        Fitted vectors, of any length.
    used : ndarray (N,) of bool
        Samples that were fitted.
    """
    columns, starts = residuals.reshape(len(residuals), -1)[used].T, visits(directions[used])
    memories, stays = zip(*((memory(column, starts), _unevenness(column, starts)) for column in columns), strict=True)
    return Alike(max(memories), max(stays))


def memory(residuals: Floats, starts: NDArray[np.intp]) -> float:
    """How many neighbouring residuals (N,) count as one, by themselves or by the means of visits; at least 1.

    (1 + ρ)/(1 − ρ) of a first-order process, ρ the correlation of neighbours.
    """
    of_samples = _together(correlation(residuals - residuals.mean())) if len(residuals) >= LONG else 1.0
    if len(starts) < FEWEST_VISITS:
        return of_samples
    means = means_of(residuals, starts)
    if (stays := correlation(means)) == 0.0:
        return of_samples
    return max(of_samples, _together(stays) * _per_sample(float(means @ means) / len(means), residuals) / len(means))


def memory_of_each(residuals: Floats) -> float:
    """How many neighbouring residuals (N, C) count as one, by themselves; of C equations, the worst counts."""
    return max(memory(column, np.zeros(1, dtype=np.intp)) for column in residuals.T)


def _unevenness(residuals: Floats, starts: NDArray[np.intp]) -> float:
    """How many residuals (N,) count as one, if what stays while the unit turns is an uneven field."""
    count = len(starts)
    if count < FEWEST_VISITS:
        return 1.0
    if not (stays := staying(residuals, starts)) > 0.0:
        return 1.0
    return max(1.0, _per_sample(stays * count / (count - _TAKEN_UP), residuals) / SLOW)


def _per_sample(variance: float, residuals: Floats) -> float:
    """Variance as a multiple of that of the mean of residuals (N,), were they independent."""
    return variance * len(residuals) ** 2 / float(residuals @ residuals)


def _together(rho: float) -> float:
    """How many neighbours of a first-order process count as one."""
    return (1.0 + rho) / (1.0 - min(rho, STAYING))
