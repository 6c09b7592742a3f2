"""Text for people: control characters shown, numbers with their digits, counts, and how an object shows itself."""

import math
import re
import textwrap
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from functools import reduce
from operator import xor

WIDTH = 80
_STEERING = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069]")


def visible(text: str, keep: str = "") -> str:
    """Text of a file as it may be shown: what would steer a terminal, or turn the reading, is written as an escape.

    Control characters of `keep` stay, as line breaks where the text has several lines.
    """
    if text.isprintable():
        return text
    return _STEERING.sub(lambda c: c[0] if c[0] in keep else c[0].encode("unicode_escape").decode("ascii"), text)


def listed(remarks: Iterable[str]) -> list[str]:
    """Remarks, each with a dash, broken at `WIDTH`."""
    wrapper = textwrap.TextWrapper(WIDTH, initial_indent="- ", subsequent_indent="  ", break_on_hyphens=False)
    return [line for remark in remarks for line in wrapper.wrap(remark)]


def first_words(words: Sequence[str], most: int) -> str:
    """The first so many of some words, and how many more there are."""
    return ", ".join(words[:most]) + (f" and {len(words) - most} more" if len(words) > most else "")


def sentence_checksum(body: str) -> str:
    """Exclusive or of the bytes between ``$`` and ``*`` of a sentence, two hexadecimal digits [NMEA 0183]."""
    return f"{reduce(xor, body.encode(), 0):02X}"


def counted(count: int, noun: str, plural: str = "") -> str:
    """Count with its noun: ``1 sample``, ``2 samples``; a plural that is not the noun with an s is given."""
    return f"{count} {noun if count == 1 else plural or noun + 's'}"


def closest(word: object, words: Iterable[str]) -> str:
    """Question whether another word was meant, after a full stop; empty where none is like it."""
    from difflib import get_close_matches

    near = get_close_matches(str(word), list(words), 1)
    return f" Did you mean '{near[0]}'?" if near else ""


def p_value(p: float) -> str:
    """Probability of a test as it is printed: ``p = 0.032``, or ``p < 0.001``."""
    return "p < 0.001" if p < 1e-3 else f"p = {p:.2g}"


ALIKE = 1.1  # up to this ratio, the two sides of an interval are printed as one ±, the larger of them

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


class FactsText(ABC):
    """Mixin of what says of itself in `facts` what a reader wants to know first."""

    __slots__ = ()

    @abstractmethod
    def facts(self) -> Mapping[str, str]:
        """What it is, by name; no value is longer than a few words."""

    def __repr__(self) -> str:
        return one_line(type(self).__name__, self.facts())

    def _repr_html_(self) -> str:
        return small_table(type(self).__name__, self.facts())


def one_line(kind: str, facts: Mapping[str, str]) -> str:
    """Facts as an object shows itself: ``<Kind: name value; name value>``."""
    return f"<{kind}: {visible('; '.join(f'{name} {value}' for name, value in facts.items()))}>"


def small_table(kind: str, facts: Mapping[str, str]) -> str:
    """Facts as a notebook shows them, in HTML."""
    from html import escape

    rows = "".join(
        f"<tr><th>{escape(visible(name))}</th><td>{escape(visible(value))}</td></tr>" for name, value in facts.items()
    )
    return f"<table><caption>{escape(kind)}</caption>{rows}</table>"
