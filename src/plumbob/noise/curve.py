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
"""

import math
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import psi, zeta

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.noise.deviation import deviation
from plumbob.noise.edf import ONE_SIGMA, edf, interval, log_variance, skew_edf
from plumbob.noise.factors import Factors, Kind, factors_of, kind_of, log_factors

PER_OCTAVE = 1.5
"""Values of a curve that are worth independent ones, in each octave; nearer ones share their noise."""
BEND = 0.125 * math.log(2.0) ** 2
"""What ln σ² may lie off a straight line one octave away; it grows with the distance squared. The second derivative of
ln σ² over ln τ is 1/4 at most where noises meet whose slopes differ by 1. More would let a curve's scatter choose its
noise, and intervals of pure noise would hold less often."""
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
    factors, deviation = _checked(n, dev)
    knots = _knots(factors)
    octave = np.log2(factors[knots])
    log_variance = 2.0 * np.log(deviation[knots])
    shape = kind_of(kind)
    half = 0.5 * edf(kind, -1.0, count, factors[knots])  # how it falls with n hardly depends on α
    slope = _local_slope(octave, log_variance - psi(half) + np.log(half), zeta(2.0, half))  # [Bartlett1946]
    alpha = _alpha(shape, factors[knots].astype(np.int64), slope)
    return np.asarray(np.interp(np.log2(factors), octave, alpha))


def _checked(n: ArrayLike, dev: ArrayLike) -> tuple[Floats, Floats]:
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
    return factors, deviation


def _knots(factors: Floats) -> NDArray[np.intp]:
    """Places of the factors that are looked at, of the many that a curve of every n has."""
    step = np.floor(np.log2(factors) * _KNOTS_PER_OCTAVE)
    return np.flatnonzero(np.diff(step, prepend=-1.0) > 0.0)


def _alpha(shape: Kind, n: NDArray[np.int64], slope: Floats) -> Floats:
    """Exponent of the noise, or of two together, that is as steep from n to 2n."""
    rise = [log_variance(shape, level, 2 * n) - log_variance(shape, level, n) for level in shape.levels]
    fall = -np.transpose(rise) / np.log(2.0)  # [Riley2008]
    return np.array([np.interp(-one, row, shape.levels) for one, row in zip(slope, fall, strict=True)])


def _local_slope(octave: Floats, value: Floats, variance: Floats) -> Floats:
    """Slope of `value` over the natural logarithm of n at every point."""
    share = np.minimum(PER_OCTAVE * np.gradient(octave), 1.0)  # what a point tells that its neighbours do not
    distance = octave - octave[:, np.newaxis]
    weight = share / (variance + (BEND * distance**2) ** 2)
    middle = (weight * distance).sum(axis=1) / weight.sum(axis=1)
    lever = weight * (distance - middle[:, np.newaxis])
    return np.asarray((lever @ value) / (lever * distance).sum(axis=1) / math.log(2.0))


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

    def at(self, n: NDArray[np.int64]) -> Self:
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
    grid = grid[grid <= kind_of(kind).longest(count)]
    wanted = grid if n is None else np.unique(factors_of(kind, count, n))
    factors = np.union1d(grid, wanted)
    return [curve_of(dev, factors, count, dt, kind=kind).at(wanted) for dev in deviation(samples, factors, kind).T]


def with_noise(of: Curve, alpha: ArrayLike) -> Curve:
    """Curve with the intervals of noise that is known better than from its own slopes.

    Parameters
    ----------
    of : Curve
        The curve.
    alpha : array_like (m,)
        Exponent of the spectrum at each averaging factor; brought into the range of the kind.
    """
    levels = kind_of(of.kind).levels
    known = np.clip(check.column("alpha", alpha, of.n.size), levels[0], levels[-1])
    return _judged(of.kind, of.dt, of.count, of.n, of.dev, known, of.confidence)


def curve_of(
    dev: ArrayLike, n: ArrayLike, count: int, dt: float, *, kind: str = "oadev", confidence: float = ONE_SIGMA
) -> Curve:
    """Curve of one channel from its deviation alone, as a stream leaves it.

    Parameters
    ----------
    dev : array_like (m,)
        The deviation.
    n : array_like (m,)
        Averaging factors, increasing, at least two; the noise is identified by the slope between them.
    count : int
        Samples of the record.
    dt : float
        Sampling time, s.
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
    factors = factors_of(kind, count, n)
    alpha = identify(kind, count, factors, dev)
    return _judged(kind, dt, count, factors, check.column("dev", dev), alpha, confidence)


def _judged(kind: str, dt: float, count: int, n: Factors, dev: Floats, alpha: Floats, confidence: float) -> Curve:
    """Curve with the intervals of noise of these exponents."""
    freedom = edf(kind, alpha, count, n)
    lo, hi = interval(dev, freedom, skew_edf(kind, alpha, count, n), confidence)
    return Curve(kind, dt, count, n, dev, alpha, freedom, lo, hi, confidence)
