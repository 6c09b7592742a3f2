"""Coefficients by non-negative least squares on the Allan variance, weighted by its degrees of freedom.

The Allan variance is linear in the squares of the coefficients, so no start is needed and none comes out imaginary.
Values at neighbouring averaging times are far from independent; the intervals know that: they come from the covariance
of the whole curve under the fitted spectrum. For K and R the likelihood says more (`plumbob.noise.likelihood`).
"""

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.noise.curve import Curve
from plumbob.noise.edf import edf
from plumbob.noise.findings import Band, Coefficient, Estimates, GaussMarkov, Sinusoid
from plumbob.noise.likelihood import CLEAR
from plumbob.noise.spectrum import LETTERS, sampled_densities
from plumbob.noise.terms import TERMS, allan_transfer, grid, variance

_ROUNDS = 6
_SAMPLED_TO = 64  # from so many samples on, sampled flicker noise has its flat line to 0.1 %


def least_squares(curve: Curve, *, first: int = 1, others: Sequence[Sinusoid | Band | GaussMarkov] = ()) -> Estimates:
    """Fit Q, N, B, K and R to a curve.

    Parameters
    ----------
    curve : Curve
        Overlapping Allan deviation.
    first : int
        Smallest averaging factor to use.
    others : sequence of Sinusoid, Band or GaussMarkov
        What else is in the curve, already known.
    """
    used = curve.n >= first
    n, tau = curve.n[used], curve.tau[used]
    if n.size <= len(TERMS):
        return Estimates("least squares", {})
    known = np.sum([other.variance(tau) for other in others] + [np.zeros(tau.size)], axis=0)
    columns = _columns(n, curve.dt)
    measured = curve.dev[used] ** 2
    squares, inverse = _solve(columns, measured, known, curve.edf[used], lambda model: _freedom(curve, n, model))
    model: Floats = columns @ squares + known
    covariance: Floats = inverse @ _covariance(curve, n, squares, model) @ inverse.T
    sd = np.sqrt(np.diag(covariance))
    return Estimates("least squares", {k: _coefficient(v, s) for k, v, s in zip(TERMS, squares, sd, strict=True)})


def _columns(n: NDArray[np.int64], dt: float) -> Floats:
    """Allan variance (m, 5) of each term for a coefficient of 1, sampled flicker noise at few samples included."""
    columns = np.stack([variance(letter, 1.0, n * dt) for letter in TERMS], axis=1)  # [Chen2013] (14)
    few = n < _SAMPLED_TO
    if few.any():
        frequency, width = grid(_SAMPLED_TO, dt)
        flicker = sampled_densities(frequency, dt)[LETTERS.index("B")]
        columns[few, list(TERMS).index("B")] = allan_transfer(n[few], frequency, dt) @ (flicker * width)
    return np.asarray(columns)


def _freedom(curve: Curve, n: NDArray[np.int64], model: Floats) -> Floats:
    """Degrees of freedom of the model's noise at each factor, told from its own slope, which does not scatter."""
    slope = np.gradient(np.log(model), np.log(n)) if n.size > 1 else np.zeros(1)
    return edf(curve.kind, np.clip(-slope - 1.0, -2.0, 2.0), curve.count, n)


def _solve(
    columns: Floats, measured: Floats, known: Floats, freedom: Floats, freedom_of: Callable[[Floats], Floats]
) -> tuple[Floats, Floats]:
    """Squares of the coefficients (5,), and the matrix (5, m) that makes them of the measured variances.

    The weights are those of the model, not of the measured values: a value that came out low would otherwise count
    more.
    """
    model = measured
    for _ in range(_ROUNDS):
        weight = np.sqrt(0.5 * freedom) / model
        weighted = weight[:, np.newaxis] * columns
        scale = np.sqrt(np.sum(weighted**2, axis=0))
        squares = _not_negative(weighted / scale, weight * (measured - known)) / scale
        model = np.maximum(columns @ squares + known, 1e-3 * measured)
        freedom = freedom_of(model)
    inverse = np.linalg.pinv(weighted / scale) / scale[:, np.newaxis] * weight
    return squares, np.asarray(inverse)


def _not_negative(columns: Floats, wanted: Floats) -> Floats:
    """Least squares without negative coefficients: the best of those sets of columns whose own solution has none.

    Among the 31 sets of five columns is the one that an active-set search would end at, and SciPy's would import its
    optimisation.
    """
    rotation, columns = np.linalg.qr(columns)
    wanted = rotation.T @ wanted  # what lies outside the columns is left over by all sets
    best, least = np.zeros(wanted.size), float(wanted @ wanted)
    for size in range(wanted.size, 0, -1):
        for chosen in map(list, combinations(range(wanted.size), size)):
            found = np.linalg.lstsq(columns[:, chosen], wanted, rcond=None)[0]
            left = wanted - columns[:, chosen] @ found
            if (found > 0.0).all() and left @ left < least:
                best, least = np.zeros(best.size), float(left @ left)
                best[chosen] = found
    return best


def _covariance(curve: Curve, n: NDArray[np.int64], squares: Floats, model: Floats) -> Floats:
    """Covariance (m, m) of the Allan variances: variances by degrees of freedom, correlations by common frequencies."""
    density = squares[: len(LETTERS)] @ sampled_densities(grid(curve.count, curve.dt)[0], curve.dt)
    shares = _transfer(tuple(n.tolist()), curve.count, curve.dt) * density
    product = shares @ shares.T
    norm = np.sqrt(np.maximum(np.diag(product), np.finfo(float).tiny))
    sd = model * np.sqrt(2.0 / _freedom(curve, n, model))
    return np.asarray(product / np.outer(norm, norm) * np.outer(sd, sd))


@lru_cache(maxsize=2)
def _transfer(n: tuple[int, ...], count: int, dt: float) -> Floats:
    """What each frequency adds to each Allan variance, times the root of its width; the same for all channels."""
    frequency, width = grid(count, dt)
    return allan_transfer(np.array(n), frequency, dt) * np.sqrt(width)


def _coefficient(square: float, sd: float) -> Coefficient:
    """Root of a square with its interval: the ends are those of the square."""
    lo, hi, upper = (math.sqrt(max(square + k * sd, 0.0)) for k in (-1.0, 1.0, 1.645))
    return Coefficient(math.sqrt(square), lo, hi, upper, bool(square > 0.0 and square >= CLEAR * sd))
