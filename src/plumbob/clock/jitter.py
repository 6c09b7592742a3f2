"""Histograms of delays: sixteen bins to each doubling, so that a quantile is known to 6 %, in bounded memory.

A time base has two in one array: of all frames, and of those that shaped its line.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob._jit import njit

BINS: Final = 16 * 58
"""Up to 10¹⁸ ns; everything below 32 ns has a bin of its own."""


@njit
def bin_of(delay: float) -> int:
    """Bin of a delay, ns."""
    value = int(min(max(delay, 0.0), 1e18))
    octave = 0
    while value >= 32:
        value >>= 1
        octave += 1
    return 16 * octave + value


@njit
def middle_of(place: int) -> float:
    """Delay in the middle of a bin, ns."""
    octave = max(place // 16 - 1, 0)
    return (place - 16 * octave + 0.5) * 2.0**octave if octave else float(place)


@njit
def quantile(histogram: NDArray[np.int64], first: int, share: float) -> float:
    """Delay that this share of the frames keeps, ns, in the histogram that begins there; 0 where there are none."""
    total = 0
    for place in range(BINS):
        total += histogram[first + place]
    reached = 0
    for place in range(BINS):
        reached += histogram[first + place]
        if reached > 0 and reached >= share * total:
            return middle_of(place)
    return 0.0
