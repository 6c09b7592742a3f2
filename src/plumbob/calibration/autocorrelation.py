"""How many independent samples a capture is worth: segments of one direction, and what errors share.

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

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.kernels import kernel
from plumbob.core.units import deg

# Turn of the vector that begins another visit, rad: more than noise, less than a field bends over.
VISIT: Final = deg(15.0)

FEWEST_VISITS: Final = 12  # fewest visits whose memory is looked for, and what stays within them
STAYING: Final = 0.999  # correlation of neighbours beyond which a memory is not told from a constant
_CHANCE: Final = 3.0  # standard deviations of a correlation by chance
_STAYING_NOISE: Final = 0.97  # the same by differences of neighbours
_DOUBT: Final = 1.5  # factor that noise's share is trusted to
_LONG_VISIT: Final = 6  # samples that have a first and a last third


def visits(directions: Floats) -> NDArray[np.intp]:
    """Where each visit begins: the first of the vectors (N, D) that is more than `VISIT` off the last one's first."""
    unit = np.ascontiguousarray(directions / np.linalg.norm(directions, axis=1, keepdims=True))
    begins = np.zeros(len(unit), dtype=np.bool_)
    _begins(unit, math.cos(VISIT), begins)
    return np.flatnonzero(begins)


def visit_means(residuals: Floats, starts: NDArray[np.intp]) -> Floats:
    """Means (K,) of residuals (N,) over visits."""
    return np.asarray(np.add.reduceat(residuals, starts) / np.diff(starts, append=len(residuals)))


def correlation(values: Floats) -> float:
    """Correlation of neighbours among values (N,); 0 where chance explains it."""
    power = float(values @ values)
    rho = float(values[1:] @ values[:-1]) / power if power > 0.0 else 0.0
    return rho if rho > _CHANCE / math.sqrt(len(values)) else 0.0


class Staying(NamedTuple):
    """What residuals keep while the unit turns, beyond noise, as variances."""

    variance: float  # kept within visits, or from one to the next, beyond chance; 0 where it is nothing
    neighbours: float  # shared from each visit to the next, significant or not
    chance: float  # standard deviation of that by chance


class _Process(NamedTuple):
    """Power of a first-order process, and correlation of its neighbours."""

    power: float
    rho: float


def staying(residuals: Floats, starts: NDArray[np.intp]) -> Staying:
    """What residuals (N,) keep within visits, of which there are two at least, and from one to the next."""
    noise, means = _noise(residuals), visit_means(residuals, starts)
    neighbours = _shared(means[:-1], means[1:], noise, size=len(residuals) / len(means), gap=0.0)
    variance = neighbours.variance if neighbours.surely else 0.0
    ends = np.append(starts[1:], len(residuals))
    long = ends - starts >= _LONG_VISIT
    if long.any():  # first and last third of each visit that is long enough
        starts, ends = starts[long], ends[long]
        third = (ends - starts) // 3
        sums = np.concatenate(([0.0], np.cumsum(residuals)))
        first, last = (sums[starts + third] - sums[starts]) / third, (sums[ends] - sums[ends - third]) / third
        gap = float(np.mean(ends - starts - 2 * third))
        within = _shared(first, last, noise, size=float(np.mean(third)), gap=gap)
        variance = max(variance, within.variance if within.surely else 0.0)
    return Staying(variance, max(0.0, neighbours.variance), neighbours.chance)


class _Shared(NamedTuple):
    """Covariance beyond noise, its standard deviation by chance, and whether it is surely beyond both."""

    variance: float
    chance: float
    surely: bool


def _shared(first: Floats, second: Floats, noise: tuple[_Process, ...], *, size: float, gap: float) -> _Shared:
    """What means (K,) over stretches of a size share with those (K,) a gap behind them, both in samples.

    Of a first-order process of correlation ρ and power 1, the means of two stretches have the covariance ``ρ^(gap + 1)
    ((1 − ρ^size) / (size (1 − ρ)))²``.
    """
    of_noise = min(
        power * float(rho ** (gap + 1.0) * ((1.0 - rho**size) / (size * (1.0 - rho))) ** 2) for power, rho in noise
    )
    covariance = float(np.mean(first * second))
    chance = math.sqrt(float(np.mean(first**2) * np.mean(second**2)) / len(first))
    surely = len(first) >= FEWEST_VISITS and covariance - _DOUBT * of_noise > _CHANCE * chance
    return _Shared(covariance - of_noise, chance, surely)


def _noise(residuals: Floats) -> tuple[_Process, ...]:
    """What the noise of residuals (N,) may be, of which the one that makes less be shared holds.

    It is told by the correlation of neighbours, in which what stays passes for a long memory, and by differences over
    one and two samples, in which motion of the errors does.
    """
    power = float(residuals @ residuals) / len(residuals)
    first, second = (0.5 * float(np.mean((residuals[k:] - residuals[:-k]) ** 2)) for k in (1, 2))
    rho = min(max(second / first - 1.0, 0.0), _STAYING_NOISE) if first > 0.0 else 0.0
    return _Process(power, min(correlation(residuals), STAYING)), _Process(min(first / (1.0 - rho), power), rho)


@kernel
def _begins(unit: Floats, cosine: float, begins: NDArray[np.bool_]) -> None:
    """Mark the samples (N,) of unit vectors (N, D) with which a visit begins."""
    first = 0
    for i in range(unit.shape[0]):
        along = 0.0
        for j in range(unit.shape[1]):
            along += unit[i, j] * unit[first, j]
        if i == 0 or along < cosine:
            begins[i] = True
            first = i


LONG: Final = 100  # fewest residuals whose memory is looked for
# Samples that errors which stay count as: an axis of a sphere's centre has the variance 3σ²/N, and the unseen one ⅔ of
# the slow power per axis, for a gradient G that is symmetric, traceless and normal.
SLOW: Final = 4.5

_TAKEN_UP: Final = 9  # visits whose errors the parameters take up


class Alike(NamedTuple):
    """How many samples count as one, at least 1: as neighbours, and as errors that never average out."""

    memory: float
    unevenness: float = 1.0

    @property
    def factor(self) -> float:
        """What a covariance that takes them for independent is too small by."""
        return max(self.memory, self.unevenness)


def alike(residuals: Floats, directions: Floats, used: NDArray[np.bool_]) -> Alike:
    """How many residuals (N,) or (N, C) of lengths or angles, in order of time, count as one; the worst of C equations.

    By the fitted vectors (N, 3) or (N, 2), of any length, and which samples were fitted.
    """
    columns, starts = residuals.reshape(len(residuals), -1)[used].T, visits(directions[used])
    count, stays = len(starts), 1.0  # if what stays while the unit turns is an uneven field
    if count >= FEWEST_VISITS:
        lasting = [(c, v) for c in columns if (v := staying(c, starts).variance) > 0.0]
        stays = max([1.0, *(_per_sample(v * count / (count - _TAKEN_UP), c) / SLOW for c, v in lasting)])
    return Alike(max(memory(column, starts) for column in columns), stays)


def memory(residuals: Floats, starts: NDArray[np.intp]) -> float:
    """How many neighbouring residuals (N,) count as one, by themselves or by the means of visits; at least 1.

    (1 + ρ)/(1 − ρ) of a first-order process, ρ the correlation of neighbours.
    """
    means = visit_means(residuals, starts) if len(starts) >= FEWEST_VISITS else np.zeros(1)
    neighbours = correlation(residuals - residuals.mean()) if len(residuals) >= LONG else 0.0, correlation(means)
    of_samples, of_means = ((1.0 + rho) / (1.0 - min(rho, STAYING)) for rho in neighbours)
    if neighbours[1] == 0.0:
        return of_samples
    return max(of_samples, of_means * _per_sample(float(means @ means) / len(means), residuals) / len(means))


def memory_of_each(residuals: Floats) -> float:
    """How many neighbouring residuals (N, C) count as one, by themselves; of C equations, the worst counts."""
    return max(memory(column, np.zeros(1, dtype=np.intp)) for column in residuals.T)


def _per_sample(variance: float, residuals: Floats) -> float:
    """Variance as a multiple of that of the mean of residuals (N,), were they independent."""
    return variance * len(residuals) ** 2 / float(residuals @ residuals)
