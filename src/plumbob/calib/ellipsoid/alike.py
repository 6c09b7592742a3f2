"""How many samples of a capture count as one: errors that stay while the unit turns do not average out.

A least-squares covariance takes every sample for a new one. Noise has a memory, so neighbours are not new; it is looked
for from sample to sample, and from one `visit` of a direction to the next.

An uneven field is worse. Let the field change by G per metre, and the sensor sit at l, in its own axes, off the point
about which the unit is turned. The length of the field then errs by ``(G b̂)·(R l)``, R the attitude and b̂ the field's
direction. The part of ``G b̂`` across the field is seen: it stays in the residuals, slowly changing. The part along it
is not: it is a hard iron of that size along l, for as long as the capture may last. For a G of no preferred direction
the two are about equal, so the slow part of the residuals tells how large the unseen error is: as large as if there had
been 4.5 samples. What visits share because noise was filtered, by its memory from sample to sample, is no such part.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob._jit import njit
from plumbob.calib.ellipsoid.norm_fit import NormFit
from plumbob.check import Floats
from plumbob.units import deg

VISIT: Final = deg(15.0)
"""Turn of the measured vector that begins another visit, rad: more than noise, less than a field bends over."""

LONG: Final = 100
"""Residuals from which on their memory is looked for."""

FEWEST_VISITS: Final = 20
"""Visits from which on the same is done with them."""

SLOW: Final = 4.5
"""Samples that errors which stay count as: an axis of a sphere's centre has the variance 3σ²/N, and the unseen one ⅔ of
the slow power per axis, for a gradient G that is symmetric, traceless and normal."""

_CHANCE: Final = 3.0  # standard deviations of a correlation by chance
_STAYING: Final = 0.999  # correlation beyond which a memory is not told from a constant


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


def visits(directions: Floats) -> NDArray[np.intp]:
    """Where each visit begins: the first of the vectors (N, D) that is more than `VISIT` off the last one's first."""
    unit = np.ascontiguousarray(directions / np.linalg.norm(directions, axis=1, keepdims=True))
    return np.flatnonzero(_begins(unit, math.cos(VISIT)))


def memory(residuals: Floats, starts: NDArray[np.intp]) -> float:
    """How many neighbouring residuals (N,) count as one, by themselves or by the means of visits; at least 1.

    (1 + ρ)/(1 − ρ) of a first-order process, ρ the correlation of neighbours.
    """
    of_samples = _together(_correlation(residuals - residuals.mean())) if len(residuals) >= LONG else 1.0
    if len(starts) < FEWEST_VISITS:
        return of_samples
    means = _means(residuals, starts)
    if (stays := _correlation(means)) == 0.0:
        return of_samples
    return max(of_samples, _together(stays) * _per_sample(float(means @ means) / len(means), residuals) / len(means))


def _unevenness(residuals: Floats, starts: NDArray[np.intp]) -> float:
    """How many residuals (N,) count as one, if what visits share beyond what noise does is an uneven field."""
    if len(starts) < FEWEST_VISITS:
        return 1.0
    means, power = _means(residuals, starts), float(residuals @ residuals) / len(residuals)
    shared = float(means[1:] @ means[:-1]) / (len(means) - 1)
    shared -= power * _of_noise(_correlation(residuals), len(residuals) / len(means))
    if not shared > _CHANCE * float(means @ means) / len(means) ** 1.5:
        return 1.0
    return max(1.0, _per_sample(shared, residuals) / SLOW)


def _means(residuals: Floats, starts: NDArray[np.intp]) -> Floats:
    return np.asarray(np.add.reduceat(residuals, starts) / np.diff(starts, append=len(residuals)))


def _of_noise(rho: float, size: float) -> float:
    """Covariance of the means of neighbouring visits of a size, of a first-order process of correlation ρ and power 1.

    Of ρ^(j + k + 1), j samples before the border and k after it, the mean over all pairs.
    """
    return rho * ((1.0 - rho**size) / (size * (1.0 - rho))) ** 2 if rho < 1.0 else 1.0


def _per_sample(variance: float, residuals: Floats) -> float:
    """Variance as a multiple of that of the mean of residuals (N,), were they independent."""
    return variance * len(residuals) ** 2 / float(residuals @ residuals)


def _correlation(values: Floats) -> float:
    """Correlation of neighbours among values (N,); 0 where chance explains it."""
    power = float(values @ values)
    rho = float(values[1:] @ values[:-1]) / power if power > 0.0 else 0.0
    return rho if rho > _CHANCE / math.sqrt(len(values)) else 0.0


def _together(rho: float) -> float:
    """How many neighbours of a first-order process count as one."""
    return (1.0 + rho) / (1.0 - min(rho, _STAYING))


@njit
def _begins(unit: Floats, cosine: float) -> NDArray[np.bool_]:
    """Samples (N,) of unit vectors (N, D) with which a visit begins."""
    found = np.zeros(len(unit), dtype=np.bool_)
    first = 0
    for i in range(len(unit)):
        along = 0.0
        for j in range(unit.shape[1]):
            along += unit[i, j] * unit[first, j]
        if i == 0 or along < cosine:
            found[i] = True
            first = i
    return found
