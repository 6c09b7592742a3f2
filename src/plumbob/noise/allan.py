"""Overlapping Allan deviation of rates, and how much each value of it can be trusted.

The cumulative sum θ of N rates has N + 1 points, and for averages over n samples [Riley2008]::

    σ²(n) = Σ (θ[k + 2n] − 2 θ[k + n] + θ[k])² / (2 n² (N − 2n + 1)),  k = 0 … N − 2n

so σ has the unit of the rates and needs no sampling time; its averaging time is τ = n Δt. The mean is removed before
the sum: it cancels in every difference, but would take its digits.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob import check
from plumbob._jit import njit
from plumbob.check import Floats
from plumbob.errors import ParameterError, ShapeError


def overlapping_adev(rate: ArrayLike, n: ArrayLike) -> Floats:
    """Overlapping Allan deviation at some averaging factors.

    Parameters
    ----------
    rate : array_like (N,) or (N, k)
        Evenly spaced samples, without any missing; each column is a channel of its own.
    n : array_like (m,)
        How many samples are averaged, whole numbers from 1 to N / 2.

    Returns
    -------
    ndarray (m,) or (m, k)
        In the unit of the rates.

    Raises
    ------
    ShapeError
        If a sample is not finite.
    ParameterError
        If a factor is no whole number, or the record is too short for it.
    """
    samples = check.floats("rate", rate)
    if samples.ndim not in {1, 2}:
        raise ShapeError(f"rate must have shape (N,) or (N, k), but its shape is {samples.shape}.")
    bad = np.argwhere(~np.isfinite(samples))
    if bad.size:
        place = ", ".join(map(str, bad[0]))
        raise ShapeError(
            f"rate[{place}] is not finite ({len(bad)} such values), but an Allan deviation needs every sample: "
            "take a stretch without gaps."
        )
    factors = _factors(n, samples.shape[0])
    columns = samples.reshape(samples.shape[0], -1).T
    found = np.array([_of_channel(column, factors) for column in columns]).T
    return np.ascontiguousarray(found.reshape(factors.size, *samples.shape[1:]))


def independent_differences(count: int, n: int) -> float:
    """Degrees of freedom of σ²(n) from `count` samples of white noise.

    The differences of θ overlap, and for white noise their correlation is known exactly: it falls from 1 in a straight
    line to −1/2 at a shift of n, and returns to 0 at 2n. A χ² variable with these degrees of freedom has the variance
    that σ² then has; 1 is a single difference, whose Allan deviation scatters by 76 %.

    Parameters
    ----------
    count : int
        Samples in the record.
    n : int
        How many are averaged.

    Raises
    ------
    ParameterError
        If n is no whole number from 1 to count / 2.
    """
    factor = int(_factors([n], count)[0])
    terms = count - 2 * factor + 1
    shift = np.arange(1, min(terms, 2 * factor))
    correlation = np.where(shift <= factor, 1.0 - 1.5 * shift / factor, 0.5 * shift / factor - 1.0)
    return float(terms / (1.0 + 2.0 * np.sum((1.0 - shift / terms) * correlation**2)))


def _factors(n: ArrayLike, count: int) -> NDArray[np.int64]:
    factors = check.column("n", n)
    fit = (factors >= 1.0) & (2.0 * factors <= count) & (factors == np.floor(factors))
    if not fit.all():
        i = int(np.argmin(fit))
        raise ParameterError(
            f"n[{i}] = {factors[i]:g}, but of {count} samples whole numbers from 1 to {count // 2} can be averaged."
        )
    return factors.astype(np.int64)


def _of_channel(rate: Floats, factors: NDArray[np.int64]) -> Floats:
    angle = np.concatenate(([0.0], np.cumsum(rate - np.mean(rate))))
    return np.array([_deviation(angle, n) for n in factors.tolist()])


@njit
def _deviation(angle: Floats, n: int) -> float:
    terms = angle.shape[0] - 2 * n
    first, middle, last = angle[:terms], angle[n : n + terms], angle[2 * n :]
    total = 0.0
    for k in range(terms):
        difference = last[k] - 2.0 * middle[k] + first[k]
        total += difference * difference
    return math.sqrt(total / (2.0 * n * n * terms))
