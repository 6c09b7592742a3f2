"""Rates that stay at one extreme value: a gyroscope at the end of a range that nothing declares."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.check import Floats
from plumbob.units import dps

FAST: Final = float(dps(50.0))
"""Rate from which on a flat top is a range, rad/s: slower, coarse steps repeat themselves, and no part ends there."""

FLAT: Final = 4
"""Equal values in a row that make a flat top; of a sensor slower than the recording, that many of its own."""


def flat_tops(gyr: Floats, where: Sequence[slice]) -> NDArray[np.bool_]:
    """Samples of measured rates (N, 3), rad/s, in a flat top of a motion between stretches at rest, (N,)."""
    marks = np.zeros(len(gyr), dtype=np.bool_)
    for first, second in pairwise(where):
        for column in gyr[first.stop : second.start].T:
            marks[first.stop : second.start] |= _flat_top(column)
    return marks


def _flat_top(rate: Floats) -> NDArray[np.bool_]:
    """Where the rate about one axis (n,) repeats its extreme."""
    starts = np.flatnonzero(np.concatenate(([True], rate[1:] != rate[:-1])))[: rate.size]
    lasting = np.diff(np.append(starts, rate.size))
    if not rate.size or not np.isfinite(rate).any():
        return np.zeros(rate.size, dtype=np.bool_)
    value = rate[starts]
    extreme = (value == np.nanmax(rate)) | (value == np.nanmin(rate))
    flat = extreme & (np.abs(value) > FAST) & (lasting >= FLAT * np.median(lasting))
    return np.repeat(flat, lasting)
