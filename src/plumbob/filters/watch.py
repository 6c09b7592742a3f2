"""Is a sensor stuck? Noise makes a working one say something new all the time; the same bits again and again do not.

This runs before every filter's step and only flags: what to make of it is the filter's choice. A slow magnetometer
whose value is repeated until the next one comes is not stuck, and neither is one that is absent in between.
"""

import math

from plumbob import flags
from plumbob._jit import njit
from plumbob.check import Floats
from plumbob.filters.layout import COUNT, LAST, SAME

LONG = 0.25
"""A triad that repeats itself for longer than this, s, and for `MANY` samples, is stuck."""
MANY = 25.0
"""Three axes of noise that is small against the last digit repeat some times; 25 times at a stretch they do not."""


@njit
def _repeats(x: Floats, triad: int, dt: float, vx: float, vy: float, vz: float) -> bool:
    last, same = LAST + 3 * triad, SAME + triad
    if math.isnan(vx):  # absent, the clock goes on
        x[same] += dt
        return False
    if vx == x[last] and vy == x[last + 1] and vz == x[last + 2]:
        x[same] += dt
        return bool(x[same] > LONG and x[same] > MANY * dt)
    x[last], x[last + 1], x[last + 2], x[same] = vx, vy, vz, 0.0
    return False


@njit
def watch(
    x: Floats, dt: float,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float, mx: float, my: float, mz: float,
) -> int:  # fmt: skip
    """Flags of the triads that are stuck; a sample out of time is not looked at."""
    if not dt > 0.0 and x[COUNT] > 0.0:
        return 0
    found = 0
    if _repeats(x, 0, dt, gx, gy, gz):
        found |= flags.GYR_STUCK
    if _repeats(x, 1, dt, ax, ay, az):
        found |= flags.ACC_STUCK
    if _repeats(x, 2, dt, mx, my, mz):
        found |= flags.MAG_STUCK
    return found
