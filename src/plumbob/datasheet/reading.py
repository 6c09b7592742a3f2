"""What is read off an analysis: the least deviation, how far a curve can be trusted, and rows for a table."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.noise.curve import Curve
from plumbob.noise.findings import Analysis, Coefficient
from plumbob.noise.terms import TERMS, variance

TRUSTED = 2.0
"""Degrees of freedom below which a deviation scatters by more than half of itself: pictures fade it."""

NOISE = {
    2: "quantization",
    1: "flicker of the integral",
    0: "white",
    -1: "flicker",
    -2: "random walk",
    -3: "flicker walk",
    -4: "random run",
}
"""Kinds of noise by the exponent of their spectrum."""


class Lowest(NamedTuple):
    """Least deviation with its interval, at the averaging time tau, s; `risen` tells whether a later one is higher."""

    tau: float
    dev: float
    lo: float
    hi: float
    risen: bool


class Point(NamedTuple):
    """Where a coefficient is read off: averaging time, s, and deviation there."""

    letter: str
    tau: float
    dev: float


def trusted(curve: Curve) -> NDArray[np.bool_]:
    """Points (m,) with enough degrees of freedom to be believed."""
    return np.asarray(curve.edf >= TRUSTED)


def lowest(analysis: Analysis) -> Lowest | None:
    """Deviation whose interval ends lowest, so that scatter at the end of a record is not taken for a minimum.

    Of the whole curve, masked or not: it is what was measured. None where no point has a finite interval.
    """
    curve = analysis.curve
    use = np.flatnonzero(np.isfinite(curve.hi))
    if not use.size:
        return None
    i = int(use[np.argmin(curve.hi[use])])
    tau, dev, lo, hi = (float(a[i]) for a in (curve.tau, curve.dev, curve.lo, curve.hi))
    return Lowest(tau, dev, lo, hi, risen=bool(np.any(curve.lo[i:] > hi)))


def points(analysis: Analysis) -> list[Point]:
    """Where the observable coefficients are read off their lines; B at the least deviation, where there is one."""
    least = lowest(analysis)
    found = []
    for letter, c in shown(analysis).items():
        tau = TERMS[letter].read_at or (least and least.tau)
        if tau is not None:
            found.append(Point(letter, tau, math.sqrt(float(variance(letter, c.value, tau)))))
    return found


def shown(analysis: Analysis) -> dict[str, Coefficient]:
    """Coefficients that this record shows, by letter."""
    return {letter: c for letter, c in analysis.terms.items() if c.observable and c.value > 0.0}


def rows(curve: Curve, limit: int) -> NDArray[np.intp]:
    """Rows of a curve for a table of at most so many: all, or some evenly spaced in the logarithm of τ."""
    if curve.n.size <= limit:
        return np.arange(curve.n.size)
    wanted = np.geomspace(curve.n[0], curve.n[-1], limit)
    return np.unique(np.clip(np.searchsorted(curve.n, wanted), 0, curve.n.size - 1))


def noise_name(alpha: float) -> str:
    """Kind of noise in words."""
    return NOISE.get(round(alpha), f"f^{alpha:.0f}")
