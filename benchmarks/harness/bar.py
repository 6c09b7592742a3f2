"""Bars: figures that a working system must reach, with their limits."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Bar:
    """A figure and the limits that it should keep."""

    name: str
    value: float
    low: float
    high: float

    @property
    def met(self) -> bool:
        """True where it keeps them."""
        return self.low <= self.value <= self.high

    def summary(self) -> dict[str, Any]:
        """Ready for JSON; None for a figure or a limit that is infinite."""
        numbers = {"value": self.value, "low": self.low, "high": self.high}
        told = {name: number if math.isfinite(number) else None for name, number in numbers.items()}
        return {"name": self.name, **told, "met": self.met}


def bar_lines(bars: Iterable[Bar]) -> Iterator[str]:
    """Table of bars; one that is not met says so."""
    listed = list(bars)
    wide = max([52, *(len(bar.name) + 1 for bar in listed)])
    yield f"{'bar':{wide}}{'figure':>9}  limits"
    for b in listed:
        yield f"{b.name:{wide}}{b.value:9.4f}  {b.low:g} to {b.high:g}{'' if b.met else '  MISSED'}"
