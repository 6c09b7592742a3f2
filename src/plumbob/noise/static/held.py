"""Values that are repeated because a sensor is slower than the rows in which it is written."""

from typing import Final

import numpy as np

from plumbob.check import Floats

SHARE: Final = 0.8
"""Part of the runs of equal values that must be alike. Coarse noise repeats itself too, but in runs of any length: of
those that halve in number from each length to the next, 38 % last for two or three samples."""


def held(values: Floats) -> int:
    """How often each value comes in a row, if nearly all come equally often, give or take one; else 1."""
    starts = np.flatnonzero(np.diff(values) != 0.0)
    if starts.size < 10:
        return 1
    runs = np.diff(starts)
    usual = int(np.median(runs))
    alike = max(np.mean((runs == usual) | (runs == other)) for other in (usual - 1, usual + 1))
    return usual if usual > 1 and alike >= SHARE else 1
