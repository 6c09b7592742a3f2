"""Coefficients read off lines of fixed slope, as papers and data sheets do it: [Ou2017] steps 5 to 7.

Where the curve runs along a slope of −1, −1/2, 0, +1/2 or +1, a line of just that slope is laid through it and read
where its term has its coefficient. This is biased wherever two terms overlap, which is nearly everywhere: it is here to
be compared with. The ± is IEEE Std 952's 1/√(2(N/n − 1)) at the averaging time where the line is read; it is a
statement about one value of the curve, not about a coefficient.
"""

import math

import numpy as np
from numpy.typing import NDArray

from plumbob.check import Floats
from plumbob.noise.curve import Curve
from plumbob.noise.findings import Coefficient, Estimates
from plumbob.noise.terms import TERMS, Term
from plumbob.runs import runs

_WITHIN = 0.15  # of the slope
_DECADES = 0.3  # that a line needs
_LEAST_EDF = 4.0  # less is not a slope but chance
_REACH = 0.15  # decades to either side over which the local slope is taken


def lines(curve: Curve, *, first: int = 1) -> Estimates:
    """Read off every term whose slope the curve shows.

    Parameters
    ----------
    curve : Curve
        Overlapping Allan deviation.
    first : int
        Smallest averaging factor to use.
    """
    used = (curve.n >= first) & (curve.edf >= _LEAST_EDF) & (curve.dev > 0.0)
    if np.count_nonzero(used) < 3:
        return Estimates("lines", {})
    x, y = np.log10(curve.tau[used]), np.log10(curve.dev[used])
    slope = _local_slope(x, y)
    found = {}
    for letter, term in TERMS.items():
        run = _longest_run(np.abs(slope - term.slope) <= _WITHIN)
        if run is not None and x[run.stop - 1] - x[run.start] >= _DECADES:
            height = float(np.mean(y[run] - term.slope * x[run]))
            found[letter] = _read(curve, term, height)
    return Estimates("lines", found)


def _read(curve: Curve, term: Term, height: float) -> Coefficient:
    value = 10.0**height / math.sqrt(term.share)
    tau = read_at(term)
    samples = tau / curve.dt
    if not 1.0 <= samples <= 0.5 * curve.count:
        return Coefficient(value)
    error = 1.0 / math.sqrt(2.0 * (curve.count / samples - 1.0))
    return Coefficient(value, value * (1.0 - error), value * (1.0 + error))


def read_at(term: Term) -> float:
    """Averaging time that the ± of a line belongs to, s; [Ou2017] takes √3 s for the flat line too."""
    return math.sqrt(3.0) if term.read_at is None else term.read_at


def _local_slope(x: Floats, y: Floats) -> Floats:
    """Slope of a straight line through the points within `_REACH` of each."""
    found = np.empty(x.size)
    for i in range(x.size):
        near = np.abs(x - x[i]) <= _REACH
        near[max(i - 1, 0) : i + 2] = True
        dx = x[near] - np.mean(x[near])
        found[i] = np.dot(dx, y[near]) / np.dot(dx, dx)
    return found


def _longest_run(inside: NDArray[np.bool_]) -> slice | None:
    return slice(*max(found, key=lambda r: r[1] - r[0])) if (found := runs(inside)) else None
