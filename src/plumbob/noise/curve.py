"""A deviation over averaging time with its intervals: what every later step of the analysis looks at.

Which power law the noise follows at each averaging time is identified by the deviation itself. Noise of spectrum f^α
has a squared deviation ∝ τ^−(α + 1) [Riley2008], so its local slope in a log-log plot shows α, once it is compared with
the slopes of noise as it is sampled, which are less steep at the first few n. Where the slope lies between those of two
noises, both are there, in proportion. Quantization is an exception, as it falls as fast as τ^−2 and not τ^−3, but in
the modified deviation.

The slope is that of a weighted straight line through all points. Each counts by what is known of it and by how far
the curve may have bent on the way, so that well-known points are judged by their neighbours alone, and the longest
averaging times, which are a difference or two, by shorter ones. No samples are needed: a stream that is over can be
judged too.

Each value enters with what is known of the logarithm of a χ² variable [Bartlett1946]: its mean, which is below the
logarithm of the mean, and its variance.

Equivalent degrees of freedom: how many independent squares an estimated deviation is worth.

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

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from math import comb
from typing import Final, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import gammaincinv, psi, zeta

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.noise.factors import (
    SHAPES,
    DeviationKind,
    checked_factors,
    deviation,
    log_factors,
    longest_factor,
)

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
        As of `plumbob.noise.curve`.
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
    factors = checked_factors(kind, count, n)
    exponent = check.floats("alpha", alpha)
    lowest, *_, highest = SHAPES[kind].levels
    if not ((exponent >= lowest) & (exponent <= highest)).all():
        raise ParameterError(f"alpha of {kind} must lie between {lowest} and {highest}, but it is {exponent}.")
    exponent = np.broadcast_to(exponent, np.broadcast_shapes(exponent.shape, (factors.size,)))
    knots = np.arange(factors.size)
    if SHAPES[kind].overlapping and factors.size > _KNOTS:  # what is disjoint changes by leaps, and is computed at all
        if not (np.diff(factors) > 0).all():
            raise ParameterError(f"n must increase where more than {_KNOTS} factors are asked for; sort them first.")
        knots = np.unique(np.searchsorted(factors, np.round(np.geomspace(factors[0], factors[-1], _KNOTS))))
    rows = exponent.reshape(-1, factors.size)
    table = np.array([[of_one(kind, float(row[i]), count, int(factors[i])) for i in knots] for row in rows])
    if knots.size < factors.size:
        table = np.array([np.exp(np.interp(np.log(factors), np.log(factors[knots]), np.log(row))) for row in table])
    return table.reshape(exponent.shape)


@lru_cache(maxsize=4096)
def _of_one(kind: str, alpha: float, count: int, n: int) -> float:
    shape = SHAPES[kind]
    terms = shape.terms(count, n)
    lags = _lags(kind, count, n)
    rho = between_levels(shape, alpha, lambda level: _at_lags(kind, level, count, n))
    weighted = (1.0 - lags / terms) * rho**2  # [Greenhall2003]
    # between neighbouring lags the summand is a straight line; a sum of its whole places is its trapezoid
    freedom = float(terms / (np.sum(np.diff(lags) * (weighted[1:] + weighted[:-1])) + weighted[-1]))
    return freedom * _gain_of_total(alpha, count, n) if kind == "totdev" and n >= _TOTAL_FROM else freedom


@lru_cache(maxsize=1024)
def _lags(kind: str, count: int, n: int) -> Floats:
    """Lags to sum at, in differences: dense near multiples of n, where the correlation has its kinks and peaks."""
    shape = SHAPES[kind]
    last = shape.terms(count, n) - 1
    if not shape.overlapping:
        return check.read_only(np.arange(min(shape.order + 1, last) + 1.0))
    steps = max(2, int(np.log(max(n / (2 * _NEAR), 1.0)) / np.log(_RATIO)))
    near = np.concatenate((np.arange(_NEAR), np.round(np.geomspace(_NEAR, max(n / 2, _NEAR), steps))))
    near = near[near <= n]
    beyond = (np.arange(shape.order + 1)[:, np.newaxis] * n + np.concatenate((near, n - near))).ravel()
    return check.read_only(np.unique(np.concatenate((beyond[beyond < last], [min(last, (shape.order + 1) * n)]))))


@lru_cache(maxsize=1024)  # channels of one record, and rounds of a fit, differ in α only
def _at_lags(kind: str, level: int, count: int, n: int) -> Floats:
    shape = SHAPES[kind]
    return check.read_only(correlation(shape, level, n, _lags(kind, count, n) * (1 if shape.overlapping else n)))


def _gain_of_total(alpha: float, count: int, n: int) -> float:
    """Of the total deviation's edf over that of Allan's overlapping one; none where the angle is quantized."""
    red = min(alpha, 0.0)
    b, c = (np.interp(-red, (0.0, 1.0, 2.0), column) for column in _TOTAL)  # [Riley2008] Table 7
    gain = max((b * count / n - c) / _of_one("oadev", red, count, n), 1.0)
    return float(gain ** (1.0 - 0.5 * max(alpha, 0.0)))


def correlation(shape: DeviationKind, level: int, n: int, shift: Floats) -> Floats:
    """ρ of two differences whose beginnings lie `shift` samples apart, in noise of one level; shift[0] must be 0."""
    covariance = _covariance(shape, level, n, shift)
    return np.asarray(covariance / covariance[0])


def between_levels(shape: DeviationKind, alpha: float, of_level: Callable[[int], Floats]) -> Floats:
    """ρ of noise that may lie between two levels, from ρ of a level.

    Of both together: what they are, the upper one making up as much of dev² as α is on its way.
    """
    upper = next(level for level in shape.levels if level >= alpha)
    if upper == alpha:
        return of_level(upper)
    lower = max(level for level in shape.levels if level < alpha)
    share = (alpha - lower) / (upper - lower)
    return np.asarray(share * of_level(upper) + (1.0 - share) * of_level(lower))


def log_variance(shape: DeviationKind, level: int, n: NDArray[np.int64]) -> Floats:
    """Logarithm of the square of the deviation of noise of one level, up to a constant, at the factors n."""
    covariance = np.abs(_covariance(shape, level, n, np.zeros(n.size)))
    return np.asarray(np.log(covariance) - 2.0 * (1 + shape.averaged) * np.log(n))


def _covariance(shape: DeviationKind, level: int, n: int | NDArray[np.int64], shift: Floats) -> Floats:
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


PER_OCTAVE = 1.5  # values of a curve that are worth independent ones, in each octave; nearer ones share their noise
# What ln σ² may lie off a straight line one octave away; it grows with the distance squared. The second derivative of
# ln σ² over ln τ is 1/4 at most where noises meet whose slopes differ by 1; more would let scatter choose the noise.
BEND = 0.125 * math.log(2.0) ** 2
_KNOTS_PER_OCTAVE = 16


def identify(kind: str, count: int, n: ArrayLike, dev: ArrayLike) -> Floats:
    """Exponent of the spectrum at each averaging factor of one channel.

    Parameters
    ----------
    kind : {"oadev", "adev", "mdev", "ohdev", "hdev", "totdev"}
        Which deviation.
    count : int
        Samples of the record.
    n : array_like (m,)
        Averaging factors, increasing, at least two.
    dev : array_like (m,)
        The deviation.

    Returns
    -------
    ndarray (m,)
        α of the samples' spectrum f^α, between the exponents that the kind of deviation can tell: 2 quantization of the
        angle, 0 white, −1 flicker, −2 random walk, Hadamard's also −3 and −4; between them two noises together. Only
        the modified deviation shows flicker of the angle, 1.

    Raises
    ------
    ShapeError
        If a deviation is not finite or zero, as that of a constant record is.
    ParameterError
        If there are fewer than two factors, or they do not increase.
    """
    factors = check.column("n", n)
    deviation = check.column("dev", dev, factors.size)
    if factors.size < 2 or not (np.diff(factors) > 0.0).all():
        raise ParameterError(
            f"n must be two averaging factors or more, increasing, to identify the noise, but it is {factors}."
        )
    bad = np.flatnonzero(~(np.isfinite(deviation) & (deviation > 0.0)))
    if bad.size:
        raise ShapeError(
            f"dev[{bad[0]}] = {deviation[bad[0]]} ({bad.size} such values), but the deviation of noise is positive: "
            "is the record constant, or a steady drift?"
        )
    step = np.floor(np.log2(factors) * _KNOTS_PER_OCTAVE)
    knots = np.flatnonzero(np.diff(step, prepend=-1.0) > 0.0)  # some of the many factors that a curve of every n has
    octave = np.log2(factors[knots])
    log_square = 2.0 * np.log(deviation[knots])
    half, shape = 0.5 * edf(kind, -1.0, count, factors[knots]), SHAPES[kind]  # how it falls with n hardly depends on α
    share = np.minimum(PER_OCTAVE * np.gradient(octave), 1.0)  # what a point tells that its neighbours do not
    distance = octave - octave[:, np.newaxis]
    weight = share / (zeta(2.0, half) + (BEND * distance**2) ** 2)  # [Bartlett1946]
    middle = (weight * distance).sum(axis=1) / weight.sum(axis=1)
    lever = weight * (distance - middle[:, np.newaxis])
    value = log_square - psi(half) + np.log(half)
    slope = (lever @ value) / (lever * distance).sum(axis=1) / math.log(2.0)
    integers = factors[knots].astype(np.int64)
    rise = [log_variance(shape, level, 2 * integers) - log_variance(shape, level, integers) for level in shape.levels]
    fall = -np.transpose(rise) / np.log(2.0)  # [Riley2008]: of noise of each level, or of two together, from n to 2n
    alpha = [np.interp(-steepness, row, shape.levels) for steepness, row in zip(slope, fall, strict=True)]
    return np.asarray(np.interp(np.log2(factors), octave, alpha))


@dataclass(frozen=True, eq=False)
class Curve:
    """Deviation of one channel.

    Attributes
    ----------
    kind : str
        Which deviation, one of `plumbob.noise.KINDS`.
    dt : float
        Sampling time Δt, s.
    count : int
        Samples N of the record.
    n : ndarray (m,) of int64
        Averaging factors, increasing; τ = n Δt.
    dev : ndarray (m,)
        The deviation, in the unit of the samples.
    alpha : ndarray (m,)
        Identified exponent of the spectrum f^α of the samples: 2 quantization, 0 white, −1 flicker, −2 random walk.
    edf : ndarray (m,)
        Equivalent degrees of freedom of dev².
    lo, hi : ndarray (m,)
        Ends of the interval of confidence `confidence`.
    confidence : float
        Of the interval.
    """

    kind: str
    dt: float
    count: int
    n: NDArray[np.int64]
    dev: Floats
    alpha: Floats
    edf: Floats
    lo: Floats
    hi: Floats
    confidence: float = ONE_SIGMA

    @property
    def tau(self) -> Floats:
        """Averaging times, s."""
        return np.asarray(self.n * self.dt)

    @property
    def ieee(self) -> Floats:
        """IEEE Std 952's relative error 1/√(2(N/n − 1)): of disjoint averages, one formula for every noise."""
        return np.asarray(1.0 / np.sqrt(2.0 * (self.count / self.n - 1.0)))  # [IEEE952]

    def only(self, n: NDArray[np.int64]) -> Self:
        """Only the averaging factors n (m,), which the curve must have."""
        place = np.searchsorted(self.n, n)
        return replace(self, **{name: getattr(self, name)[place] for name in ("n", "dev", "alpha", "edf", "lo", "hi")})


def curve(rate: ArrayLike, dt: float, n: ArrayLike | None = None, *, kind: str = "oadev") -> Curve:
    """Deviation of one channel, with its noise identified and intervals.

    Parameters
    ----------
    rate : array_like (N,)
        Evenly spaced samples, without any missing.
    dt : float
        Sampling time, s.
    n : array_like (m,), optional
        Averaging factors; evenly spaced in their logarithm without. The noise is identified with the help of the latter
        in any case, so that even a single factor gets an interval.
    kind : {"oadev", "adev", "mdev", "ohdev", "hdev", "totdev"}
        Which deviation.

    Raises
    ------
    ShapeError
        If a sample is not finite, or all are equal.
    ParameterError
        If the record is too short, a factor does not fit it, or dt is not above 0.
    """
    return curves(check.column("rate", rate)[:, np.newaxis], dt, n, kind=kind)[0]


def curves(rate: ArrayLike, dt: float, n: ArrayLike | None = None, *, kind: str = "oadev") -> list[Curve]:
    """`curve` of each channel of samples (N, k)."""
    samples = check.floats("rate", rate)
    if samples.ndim != 2:
        raise ShapeError(f"rate must have shape (N, k), but its shape is {samples.shape}.")
    count = samples.shape[0]
    grid = log_factors(count)
    grid = grid[grid <= longest_factor(kind, count)]
    wanted = grid if n is None else np.unique(checked_factors(kind, count, n))
    factors = np.union1d(grid, wanted)
    made = [make_curve(dev, factors, count, dt, kind=kind) for dev in deviation(samples, factors, kind).T]
    return made if n is None else [each.only(wanted) for each in made]


def make_curve(
    dev: ArrayLike, n: ArrayLike, count: int, dt: float, *, kind: str = "oadev", confidence: float = ONE_SIGMA,
    alpha: ArrayLike | None = None,
) -> Curve:  # fmt: skip
    """Curve of one channel from its deviation alone, as a stream leaves it.

    Parameters
    ----------
    dev : array_like (m,)
        The deviation.
    n : array_like (m,)
        Averaging factors, increasing, at least two.
    count : int
        Samples of the record.
    dt : float
        Sampling time, s.
    alpha : array_like (m,), optional
        Exponents of the noise where they are known better than from the slopes between the factors.
    kind : {"oadev", "adev", "mdev", "ohdev", "hdev", "totdev"}
        Which deviation.
    confidence : float
        Of the intervals.

    Raises
    ------
    ShapeError
        If a deviation is not finite or zero.
    ParameterError
        If a factor does not fit the record, or dt or the confidence is out of range.
    """
    if not 0.0 < dt < np.inf:
        raise ParameterError(f"dt must be a sampling time above 0 s, but it is {dt}.")
    factors = checked_factors(kind, count, n)
    measured, levels = check.column("dev", dev, factors.size), SHAPES[kind].levels
    exponents = identify(kind, count, factors, measured) if alpha is None else np.clip(alpha, levels[0], levels[-1])
    freedom = edf(kind, exponents, count, factors)
    lo, hi = interval(measured, freedom, skew_edf(kind, exponents, count, factors), confidence)
    return Curve(kind, dt, count, factors, measured, exponents, freedom, lo, hi, confidence)
