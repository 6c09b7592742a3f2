"""Values that pile up at the end of a range, which cuts the tail of the noise off."""

from typing import Final, NamedTuple

import numpy as np

from plumbob.check import Floats

RATIO: Final = 2.0
"""The outermost level is a pile if it occurs more often than so many times the next one; the tail of noise thins."""
FEWEST: Final = 8
"""Visits of a pile; slow noise may stay at its outermost level for long, but not again and again."""
SHARE: Final = 1e-4
"""Part of all samples that a pile has."""


class Pile(NamedTuple):
    """Outermost value, how often it occurs, and how often the next one inside it does."""

    value: float
    size: int
    inside: int


def clipped(values: Floats) -> list[Pile]:
    """Piles at the smallest and at the largest value.

    Of noise much smaller than a converter's step any level can be the outermost: do not ask then.
    """
    levels, counts = np.unique(values, return_counts=True)
    if levels.size < 3:
        return []
    ends = [Pile(float(levels[i]), int(counts[i]), int(counts[k])) for i, k in ((0, 1), (-1, -2))]
    return [pile for pile in ends if _piled(pile, values)]


def _piled(pile: Pile, values: Floats) -> bool:
    if pile.size <= RATIO * pile.inside or pile.size < SHARE * values.size:
        return False
    there = values == pile.value
    return int(np.count_nonzero(there[1:] & ~there[:-1])) + int(there[0]) >= FEWEST
