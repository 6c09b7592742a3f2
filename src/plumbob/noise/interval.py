"""Interval of a deviation: from the distribution of its square, by that distribution's first three moments.

The square is a sum of independent squares with weights λ, the eigenvalues of the correlation matrix of the differences.
Were they equal, it were a χ² variable with edf = (Σλ)²/Σλ² degrees of freedom, as is mostly assumed. But near the end
of a record, where the differences overlap almost wholly, one of them outweighs all others; χ² then finds small values
far too likely, and an interval of 68 % holds the truth in up to 81 %. A χ² variable that is shifted and scaled to have
the right skewness too mends this [Imhof1961]; where the weights are equal, nothing changes.
"""

from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import gammaincinv

from plumbob import check
from plumbob.check import Floats
from plumbob.errors import ParameterError
from plumbob.noise.edf import along, between_levels, correlation, edf
from plumbob.noise.kinds import SHAPES

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
    scale = 1.0 / np.sqrt(freedom * skew)
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
