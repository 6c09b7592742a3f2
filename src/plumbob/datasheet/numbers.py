"""Coefficients, limits and lengths of time as a data sheet prints them."""

import math

from plumbob.digits import measured, number, places, rounded
from plumbob.noise.findings import Coefficient
from plumbob.units import Quantity, from_si, written


def coefficient(c: Coefficient, unit: str) -> str:
    """Cell of a table: the value with its uncertainty, or the limit below which it lies."""
    value, lo, hi, upper = (from_si(v, unit) for v in (c.value, c.lo, c.hi, c.upper))
    if c.observable:
        return measured(value, lo, hi)
    return f"< {number(upper, 2)}" if math.isfinite(upper) else "not observable"


def with_unit(text: str, unit: str) -> str:
    """Number in a sentence, with its unit; nothing follows bare numbers, whose unit is 1."""
    return text if unit == Quantity.RATIO.value else f"{text} {written(unit)}"


def in_unit(unit: str) -> str:
    """What follows the name of a quantity in a sentence: `` in °/h``; nothing for bare numbers."""
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
