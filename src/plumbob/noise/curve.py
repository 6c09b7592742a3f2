"""A deviation over averaging time with its intervals: what every later step of the analysis looks at."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.noise.deviation import deviation
from plumbob.noise.edf import ONE_SIGMA, edf, interval, skew_edf
from plumbob.noise.factors import Factors, factors_of, kind_of, log_factors
from plumbob.noise.identify import identify


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
