"""Coefficients and limits as a data sheet prints them, and which triads a recording has."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.errors import ShapeError
from plumbob.core.text import measured, number, places, rounded
from plumbob.core.units import Quantity, from_si, written
from plumbob.data import TITLES
from plumbob.noise.curve import Curve
from plumbob.noise.findings import Analysis, Coefficient
from plumbob.noise.terms import TERMS, variance


def coefficient(c: Coefficient, unit: str) -> str:
    """Cell of a table: the value with its uncertainty, or the limit below which it lies."""
    value, lo, hi, upper = (from_si(v, unit) for v in (c.value, c.lo, c.hi, c.upper))
    if c.observable:
        return measured(value, lo, hi)
    return f"< {number(upper, 2)}" if math.isfinite(upper) else "not observable"


def with_unit(text: str, unit: str) -> str:
    """Number in a sentence, with its unit; nothing follows plain numbers, whose unit is 1."""
    return text if unit == Quantity.RATIO.value else f"{text} {written(unit)}"


def in_unit(unit: str) -> str:
    """What follows the name of a quantity in a sentence: `` in °/h``; nothing for plain numbers."""
    return "" if unit == Quantity.RATIO.value else f" in {written(unit)}"


def verdict(c: Coefficient, unit: str) -> str:
    """The same in words, with the unit."""
    if c.observable:
        return with_unit(coefficient(c, unit), unit)
    limit = from_si(c.upper, unit)
    bound = f"; < {with_unit(number(limit, 2), unit)} (95 %)" if math.isfinite(limit) else ""
    return f"not observable{bound}; to show half of it takes a record of {longer(c)}"


def longer(c: Coefficient) -> str:
    """How long a record would have to be to show half of the limit of a coefficient that is not observable."""
    return "more than a year" if c.hours is None else length(3600.0 * c.hours)


def length(seconds: float) -> str:
    """Length of time with two digits."""
    unit, size = next(pair for pair in (("h", 3600.0), ("min", 60.0), ("s", 0.0)) if seconds >= 2.0 * pair[1])
    value = seconds / (size or 1.0)
    return f"{rounded(value, places(value))} {unit}" if value > 0.0 else "0 s"


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
    """Least deviation with its interval, at the averaging time tau, s; `risen` shows whether a later one is higher."""

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


AXES = ("x", "y", "z")


class Triad(NamedTuple):
    """Channels of one sensor.

    Attributes
    ----------
    name : str
        What their names share, such as "gyr"; the whole name of a channel that stands alone.
    channels : mapping of str to Analysis
        By axis; the axis is empty for a channel that stands alone.
    """

    name: str
    channels: Mapping[str, Analysis]

    @property
    def title(self) -> str:
        """Name for a heading."""
        return TITLES.get(self.name, self.name)

    @property
    def quantity(self) -> Quantity:
        """What its samples measure."""
        return self.first.quantity

    @property
    def first(self) -> Analysis:
        """The first of its channels."""
        return next(iter(self.channels.values()))


def triads(analyses: Sequence[Analysis]) -> list[Triad]:
    """Sort channels into triads by their names: "gyr x", "gyr y" and "gyr z" are axes of "gyr".

    Raises
    ------
    ShapeError
        If there is no analysis, two share a name, or the axes of a triad measure different quantities.
    """
    if not analyses:
        raise ShapeError("a report needs at least one analysis, but analyses is empty.")
    found: dict[str, dict[str, Analysis]] = {}
    for analysis in analyses:
        head, _, last = analysis.name.rpartition(" ")
        name, axis = (head, last) if head and last in AXES else (analysis.name, "")
        channels = found.setdefault(name, {})
        if axis in channels:
            raise ShapeError(f"two analyses are named '{analysis.name}'; give each channel a name of its own.")
        channels[axis] = analysis
    for name, channels in found.items():
        measured = {analysis.quantity for analysis in channels.values()}
        if len(measured) > 1:
            raise ShapeError(
                f"the axes of '{name}' measure {', '.join(sorted(measured))}; a triad measures one quantity."
            )
    return [Triad(name, channels) for name, channels in found.items()]
