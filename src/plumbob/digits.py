"""Numbers as people print them: two digits of the uncertainty say how many digits the value has."""

import math

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
        decimals = places(max(above, below))
        text = f"{rounded(value, decimals)} ± {rounded(max(above, below), decimals)}"
    else:
        decimals = places(min(side for side in (above, below) if side > 0.0))
        text = f"{rounded(value, decimals)} +{rounded(above, decimals)} -{rounded(below, decimals)}"
    return f"({text})e{power}" if power else text


def number(value: float, digits: int = 3) -> str:
    """Value alone, with so many digits; a dash where it is not known."""
    if not math.isfinite(value):
        return "-"
    if value == 0.0:
        return "0"
    power = _power(abs(value))
    value /= 10.0**power
    text = rounded(value, digits - 1 - math.floor(math.log10(abs(value))))
    return f"{text}e{power}" if power else text


def places(uncertainty: float) -> int:
    """Decimals that show two digits of an uncertainty, as it is once rounded."""
    return 1 - math.floor(math.log10(float(f"{uncertainty:.1e}")))


def rounded(value: float, decimals: int) -> str:
    """Value with so many decimals; fewer than none round to tens, hundreds and so on."""
    return f"{round(value, decimals):.{max(0, decimals)}f}"


def _power(size: float) -> int:
    return 0 if size == 0.0 or PLAIN[0] <= size < PLAIN[1] else math.floor(math.log10(size))
