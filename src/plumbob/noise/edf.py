"""Equivalent degrees of freedom: how many independent squares an estimated deviation is worth.

The square of a deviation is a mean of M squares of differences z that overlap and are correlated. A χ² variable with
the same mean and variance has, for Gaussian noise [Greenhall2003]::

    edf = M / Σ (1 − |j|/M) ρ(j)²,  |j| < M

with ρ(j) the correlation of z with itself j differences later. Noise of spectrum f^α (of the samples, not of their
integral), α whole, is taken to be fractionally integrated white noise, density |2 sin(πfΔt)|^α, whose cumulative sum
has a generalised autocovariance in closed form [Hosking1981]; Greenhall and Riley take continuous noise instead, which
is the same for n ≫ 1. For white noise, quantization of the angle and a random walk in steps, this is exact at every n.

Interval of a deviation: from the distribution of its square, by that distribution's first three moments.

The square is a sum of independent squares with weights λ, the eigenvalues of the correlation matrix of the differences.
Were they equal, it were a χ² variable with edf = (Σλ)²/Σλ² degrees of freedom, as is mostly assumed. But near the end
of a record, where the differences overlap almost wholly, one of them outweighs all others; χ² then finds small values
far too likely, and an interval of 68 % holds the truth in up to 81 %. A χ² variable that is shifted and scaled to have
the right skewness too mends this [Imhof1961]; where the weights are equal, nothing changes.
"""

from collections.abc import Callable
from functools import lru_cache
from math import comb
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import gammaincinv, psi

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.noise.factors import SHAPES, Kind, factors_of

ONE_SIGMA: Final = 0.682689492137086
"""Share of a normal distribution within one standard deviation: the confidence of every ± of this package."""
_LONG = 10  # from so many averaging times on, a longer record adds weights but does not change how they differ
_SIZE = 64  # of the matrix


def interval(dev: Floats, freedom: Floats, skew: Floats, confidence: float = ONE_SIGMA) -> tuple[Floats, Floats]:
    """Ends of an interval that errs on either side equally often.

    Parameters
    ----------
    dev : ndarray (...,)
        The deviation.
    freedom, skew : ndarray (...,)
        Degrees of freedom of χ² variables whose variance is that of dev², and whose skewness (`skew_edf`).
    confidence : float
        Share of such intervals that hold the truth.

    Returns
    -------
    lo, hi : ndarray (...,)

    Raises
    ------
    ParameterError
        If the confidence is not between 0 and 1.
    """
    if not 0.0 < confidence < 1.0:
        raise ParameterError(f"confidence must be between 0 and 1, but it is {confidence}.")
    scale = 1.0 / np.sqrt(freedom * skew)  # [Imhof1961]
    ends = [2.0 * gammaincinv(0.5 * skew, 0.5 * (1.0 + side * confidence)) for side in (1.0, -1.0)]
    lo, hi = (dev / np.sqrt(1.0 + scale * (end - skew)) for end in ends)
    return lo, hi


def skew_edf(kind: str, alpha: ArrayLike, count: int, n: ArrayLike) -> Floats:
    """Degrees of freedom of the χ² variable that is as skewed as the square of a deviation; `edf` or fewer.

    Parameters
    ----------
    kind, alpha, count, n
        As of `plumbob.noise.edf`.
    """
    return np.asarray(edf(kind, alpha, count, n) * along(_share, kind, alpha, count, n))


@lru_cache(maxsize=4096)
def _share(kind: str, alpha: float, count: int, n: int) -> float:
    """(Σλ²)⁴ / ((Σλ)² (Σλ³)²) of evenly spaced differences: `skew_edf` over `edf`."""
    rho = between_levels(SHAPES[kind], alpha, lambda level: _spaced(kind, level, count, n))
    place = np.arange(rho.size)
    matrix = rho[np.abs(place - place[:, np.newaxis])]
    squared = matrix @ matrix
    return float(np.trace(squared) ** 4 / (rho.size * np.sum(squared * matrix)) ** 2)


@lru_cache(maxsize=1024)
def _spaced(kind: str, level: int, count: int, n: int) -> Floats:
    """ρ of evenly spaced differences in noise of one level."""
    shape = SHAPES[kind]
    stride = 1 if shape.overlapping else n
    terms = min(shape.terms(count, n), _LONG * n // stride)
    lag = np.round(np.linspace(0.0, terms - 1.0, min(terms, _SIZE))) * stride
    return check.read_only(correlation(shape, level, n, lag))


_TOTAL: Final = ((1.5, 1.17, 0.93), (0.0, 0.22, 0.36))  # [Riley2008] Table 7: b and c of b T/τ − c, α = 0, −1, −2
_TOTAL_FROM = 8  # the table is of n ≫ 1; at 8, Allan's overlapping edf of white noise is 2 % below its own limit
_KNOTS = 256
_NEAR = 8  # lags next to a multiple of n that are all summed
_RATIO = 1.1  # of neighbouring lags beyond: the edf comes out 0.3 % low at most


def edf(kind: str, alpha: ArrayLike, count: int, n: ArrayLike) -> Floats:
    """Equivalent degrees of freedom of the square of a deviation.

    For α between two whole ones, of both noises together: the Allan deviation of a sensor whose quantization gives way
    to white noise falls less and less steeply, and so passes all α from 2 to 0.

    Of more than 256 overlapping factors, 256 are computed, and the logarithm is interpolated between them; α may then
    change with n only slowly.

    Parameters
    ----------
    kind : {"oadev", "adev", "mdev", "ohdev", "hdev", "totdev"}
        Which deviation.
    alpha : array_like (..., m) or ()
        Exponent of the spectrum f^α of the samples at each factor, −2 (Hadamard: −4) to 2. But for the modified
        deviation 1 is half white noise (0), half quantization (2).
    count : int
        Samples of the record.
    n : array_like (m,)
        Averaging factors, whole numbers from 1; increasing where there are more than 256.

    Returns
    -------
    ndarray (..., m)
        At least 1.

    Raises
    ------
    ParameterError
        If an exponent is outside the range of the kind, or a factor no whole number or too long for the record.
    """
    return along(_of_one, kind, alpha, count, n)


def along(
    of_one: Callable[[str, float, int, int], float], kind: str, alpha: ArrayLike, count: int, n: ArrayLike
) -> Floats:
    """``of_one(kind, alpha, count, n)`` at every factor, of so many at some and between them, as `edf` says."""
    factors = factors_of(kind, count, n)
    exponent = _exponents(kind, alpha, factors.size)
    knots = _knots(SHAPES[kind], factors)
    rows = exponent.reshape(-1, factors.size)
    found = np.array([[of_one(kind, float(row[i]), count, int(factors[i])) for i in knots] for row in rows])
    if knots.size < factors.size:
        found = np.array([np.exp(np.interp(np.log(factors), np.log(factors[knots]), np.log(row))) for row in found])
    return found.reshape(exponent.shape)


def _exponents(kind: str, alpha: ArrayLike, size: int) -> Floats:
    exponent = check.floats("alpha", alpha)
    lowest, *_, highest = SHAPES[kind].levels
    if not ((exponent >= lowest) & (exponent <= highest)).all():
        raise ParameterError(f"alpha of {kind} must lie between {lowest} and {highest}, but it is {exponent}.")
    return np.broadcast_to(exponent, np.broadcast_shapes(exponent.shape, (size,)))


def _knots(shape: Kind, n: NDArray[np.int64]) -> NDArray[np.intp]:
    """Places of the factors to compute at; what is disjoint changes by leaps, and is computed at all."""
    if not shape.overlapping or n.size <= _KNOTS:
        return np.arange(n.size)
    if not (np.diff(n) > 0).all():
        raise ParameterError(f"n must increase where more than {_KNOTS} factors are asked for; sort them first.")
    return np.unique(np.searchsorted(n, np.round(np.geomspace(n[0], n[-1], _KNOTS))))


@lru_cache(maxsize=4096)
def _of_one(kind: str, alpha: float, count: int, n: int) -> float:
    shape = SHAPES[kind]
    terms = shape.terms(count, n)
    lags = _lags_of(kind, count, n)
    rho = between_levels(shape, alpha, lambda level: _at_lags(kind, level, count, n))
    weighted = (1.0 - lags / terms) * rho**2  # [Greenhall2003]
    # between neighbouring lags the summand is a straight line; a sum of its whole places is its trapezoid
    found = float(terms / (np.sum(np.diff(lags) * (weighted[1:] + weighted[:-1])) + weighted[-1]))
    return found * _gain_of_total(alpha, count, n) if kind == "totdev" and n >= _TOTAL_FROM else found


@lru_cache(maxsize=1024)
def _lags_of(kind: str, count: int, n: int) -> Floats:
    shape = SHAPES[kind]
    return check.read_only(_lags(shape, n, shape.terms(count, n) - 1))


@lru_cache(maxsize=1024)  # channels of one record, and rounds of a fit, differ in α only
def _at_lags(kind: str, level: int, count: int, n: int) -> Floats:
    shape = SHAPES[kind]
    return check.read_only(correlation(shape, level, n, _lags_of(kind, count, n) * (1 if shape.overlapping else n)))


def _gain_of_total(alpha: float, count: int, n: int) -> float:
    """Of the total deviation's edf over that of Allan's overlapping one; none where the angle is quantized."""
    red = min(alpha, 0.0)
    b, c = (np.interp(-red, (0.0, 1.0, 2.0), column) for column in _TOTAL)  # [Riley2008] Table 7
    gain = max((b * count / n - c) / _of_one("oadev", red, count, n), 1.0)
    return float(gain ** (1.0 - 0.5 * max(alpha, 0.0)))


def _lags(shape: Kind, n: int, last: int) -> Floats:
    """Lags to sum at, in differences: dense near multiples of n, where the correlation has its kinks and peaks."""
    if not shape.overlapping:
        return np.arange(min(shape.order + 1, last) + 1.0)
    steps = max(2, int(np.log(max(n / (2 * _NEAR), 1.0)) / np.log(_RATIO)))
    near = np.concatenate((np.arange(_NEAR), np.round(np.geomspace(_NEAR, max(n / 2, _NEAR), steps))))
    near = near[near <= n]
    beyond = (np.arange(shape.order + 1)[:, np.newaxis] * n + np.concatenate((near, n - near))).ravel()
    return np.unique(np.concatenate((beyond[beyond < last], [min(last, (shape.order + 1) * n)])))


def correlation(shape: Kind, level: int, n: int, shift: Floats) -> Floats:
    """ρ of two differences whose beginnings lie `shift` samples apart, in noise of one level; shift[0] must be 0."""
    found = _covariance(shape, level, n, shift)
    return np.asarray(found / found[0])


def between_levels(shape: Kind, alpha: float, of_level: Callable[[int], Floats]) -> Floats:
    """ρ of noise that may lie between two levels, from ρ of a level.

    Of both together: what they are, the upper one making up as much of dev² as α is on its way.
    """
    upper = next(level for level in shape.levels if level >= alpha)
    if upper == alpha:
        return of_level(upper)
    lower = max(level for level in shape.levels if level < alpha)
    share = (alpha - lower) / (upper - lower)
    return np.asarray(share * of_level(upper) + (1.0 - share) * of_level(lower))


def log_variance(shape: Kind, level: int, n: NDArray[np.int64]) -> Floats:
    """Logarithm of the square of the deviation of noise of one level, up to a constant, at the factors n."""
    found = np.abs(_covariance(shape, level, n, np.zeros(n.size)))
    return np.asarray(np.log(found) - 2.0 * (1 + shape.averaged) * np.log(n))


def _covariance(shape: Kind, level: int, n: int | NDArray[np.int64], shift: Floats) -> Floats:
    """Of two differences, up to a factor."""
    order = shape.order + shape.averaged  # an average over n points is a difference of order 1 of the next sum
    steps = np.arange(-order, order + 1)
    binomial = np.array([(-1.0) ** step * comb(2 * order, order + step) for step in steps.tolist()])
    return np.asarray(
        binomial @ _autocovariance(2 - level + 2 * shape.averaged, np.abs(shift + n * steps[:, np.newaxis]))
    )


def _autocovariance(twice_d: int, k: Floats) -> Floats:
    """Generalised autocovariance at whole lags k ≥ 0 of white noise that was integrated d times.

    It is Γ(k + d) / Γ(k + 1 − d), up to a factor and a polynomial that differences take away [Hosking1981]. For d half
    way between whole numbers all of this is such a polynomial, ∏ (k² − i²) over i = ½ … d − 1, and its derivative by d
    takes its place.
    """
    if twice_d == 0:
        return np.asarray(k == 0.0, dtype=np.float64)
    d = 0.5 * twice_d
    product = np.prod([k**2 - i**2 for i in np.arange(d - 1.0, 0.25, -1.0)], axis=0)  # [Hosking1981]
    return np.asarray(product * (k if twice_d % 2 == 0 else psi(k + d) + psi(k + 1.0 - d)))
