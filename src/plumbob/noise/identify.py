"""Which power law the noise follows at each averaging time, identified by the deviation itself.

Noise of spectrum f^α has a squared deviation ∝ τ^−(α + 1) [Riley2008], so its local slope in a log-log plot shows α,
once it is compared with the slopes of noise as it is sampled, which are less steep at the first few n. Where the slope
lies between those of two noises, both are there, in proportion. Quantization is an exception, as it falls as fast as
τ^−2 and not τ^−3, but in the modified deviation.

The slope is that of a weighted straight line through all points. Each counts by what is known of it and by how far
the curve may have bent on the way, so that well-known points are judged by their neighbours alone, and the longest
averaging times, which are a difference or two, by shorter ones. No samples are needed: a stream that is over can be
judged too.

Each value enters with what is known of the logarithm of a χ² variable [Bartlett1946]: its mean, which is below the
logarithm of the mean, and its variance.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import psi, zeta

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.noise.edf import edf, log_variance
from plumbob.noise.factors import Kind, kind_of

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
