"""Numbers as a data sheet prints them: two digits of the uncertainty say how many digits the value has."""

import math

from plumbob.noise.findings import Coefficient
from plumbob.units import Quantity, from_si, written

ALIKE = 1.1
"""Up to this ratio, the two sides of an interval are printed as one ±, the larger of them."""

PLAIN = (1e-4, 1e6)  # magnitudes that are written without a power of ten


def measured(value: float, lo: float, hi: float) -> str:
    """Value with its uncertainty: ``1.234 ± 0.056``, or ``1.23 +0.56 −0.34`` where the sides differ."""
    if not (math.isfinite(lo) and math.isfinite(hi)):
        return number(value)
    above, below = hi - value, value - lo
    if not 0.0 < max(above, below) < math.inf:
        return number(value)
    power = _power(max(abs(value), above, below))
    scale = 10.0**power
    value, above, below = value / scale, above / scale, below / scale
    if max(above, below) <= ALIKE * min(above, below):
        places = _places(max(above, below))
        text = f"{_rounded(value, places)} ± {_rounded(max(above, below), places)}"
    else:
        places = _places(min(side for side in (above, below) if side > 0.0))
        text = f"{_rounded(value, places)} +{_rounded(above, places)} -{_rounded(below, places)}"
    return f"({text})e{power}" if power else text


def number(value: float, digits: int = 3) -> str:
    """Value alone, with so many digits; a dash where it is not known."""
    if not math.isfinite(value):
        return "-"
    if value == 0.0:
        return "0"
    power = _power(abs(value))
    value /= 10.0**power
    text = _rounded(value, digits - 1 - math.floor(math.log10(abs(value))))
    return f"{text}e{power}" if power else text


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
    return f"{_rounded(value, _places(value))} {unit}" if value > 0.0 else "0 s"


def _places(uncertainty: float) -> int:
    """Decimals that show two digits of it, as it is once rounded."""
    return 1 - math.floor(math.log10(float(f"{uncertainty:.1e}")))


def _rounded(value: float, places: int) -> str:
    """Value with so many decimals; fewer than none round to tens, hundreds and so on."""
    return f"{round(value, places):.{max(0, places)}f}"


def _power(size: float) -> int:
    return 0 if size == 0.0 or PLAIN[0] <= size < PLAIN[1] else math.floor(math.log10(size))
