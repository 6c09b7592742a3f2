"""Is a sensor stuck? Noise makes a working one say something new all the time; the same bits again and again do not.

This runs before every filter's step and only flags: what to make of it is the filter's choice. A slow magnetometer
whose value is repeated until the next one comes is not stuck, and neither is one that is absent in between.
"""

import math

from plumbob import flags
from plumbob._jit import njit
from plumbob.check import Floats
from plumbob.filters.layout import LAST, SAME

LONG = 0.25
"""A triad that repeats itself for longer than this, s, and for `MANY` samples, is stuck."""
MANY = 25.0
"""Three axes of noise that is small against the last digit repeat some times; 25 times at a stretch they do not."""


_MIX_Y, _MIX_Z = math.sqrt(2.0), math.sqrt(3.0)  # no combination of whole steps of the axes gives the same sum


@njit
def _repeats(x: Floats, triad: int, dt: float, vx: float, vy: float, vz: float) -> bool:
    """One number stands for the three axes; it stays the same where they do, and practically only there."""
    said = vx + _MIX_Y * vy + _MIX_Z * vz
    if said != x[LAST + triad]:
        if math.isnan(said):  # absent: the clock goes on
            x[SAME + triad] += dt
        else:
            x[LAST + triad], x[SAME + triad] = said, 0.0
        return False
    x[SAME + triad] += dt
    return bool(x[SAME + triad] > LONG and x[SAME + triad] > MANY * dt)


@njit
def watch(
    x: Floats, dt: float,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float, mx: float, my: float, mz: float,
) -> int:  # fmt: skip
    """Flags of the triads that are stuck."""
    found = 0
    if _repeats(x, 0, dt, gx, gy, gz):
        found |= flags.GYR_STUCK
    if _repeats(x, 1, dt, ax, ay, az):
        found |= flags.ACC_STUCK
    if _repeats(x, 2, dt, mx, my, mz):
        found |= flags.MAG_STUCK
    return found
