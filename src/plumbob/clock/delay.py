"""Is a frame late because it waited, or because others before it are missing? Only patience tells.

A stall of the host makes frames late, and then they come in a burst and the delay falls back. Frames that were lost
without a trace in any counter make all that follow late, for good. So a delay that is longer than usual makes a frame
suspect; only when the delay has stayed, without falling, through `_PATIENCE` of the host's time and `_ENOUGH` frames,
is it taken for time that has passed unseen. The other order, to believe at once and repent, would need a clock that
goes backwards.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob._jit import njit
from plumbob.check import Floats
from plumbob.clock.hull import line_at, observe
from plumbob.clock.jitter import BINS, bin_of, quantile
from plumbob.clock.layout import (
    ASIDE,
    ASIDE_SINCE,
    FRAMES,
    HOST,
    MODULUS,
    NOW,
    ORIGIN,
    ROUGH,
    SCATTER,
    SINCE_HOST,
    SPEED,
    SUSPECT_DELAY,
    SUSPECT_SINCE,
    SUSPECTS,
    TICK,
    TOLD_DELAY,
    TYPICAL,
    USUAL,
    WORST,
)

Ints = NDArray[np.int64]

_PATIENCE: Final = 500_000_000  # ns; a backlog that still drains keeps falling, and starts the wait again
_DOUBT: Final = 125_000_000  # ns
_CHANGED: Final = 5_000_000_000  # ns of longer delays: this is how it is now
_BACKLOG: Final = 4.0  # usual delays
_LITTLE: Final = 20e6  # ns
_REVIEW: Final = 256  # frames from one look at the usual delay to the next
_ENOUGH: Final = 4
_STOPPED: Final = 1e9  # ns: a device that is so late, for so long, has stood still
_LEAST: Final = 1e6  # ns: a busy host delays all frames by as much for a while
LEARNING: Final = 2e9
"""Time in which a new line may still be far off, ns."""

_FORMING: Final = 12e9  # ns of the host's time, in which a new line may have to tilt


@njit
def turn(n: Ints, r: Floats) -> float:
    """Time of one turn of the counter, ns; of one frame where there is no counter."""
    return float(n[MODULUS] * r[TICK])


@njit
def _limit(n: Ints, r: Floats) -> float:
    """Delay from which on a frame is suspect, ns: half of what could be missing unseen.

    Where a read brings several frames, the least delay drifts with the beat between frames and reads, and then jumps by
    up to a frame, exactly as if one were lost: there it takes two.
    """
    if n[MODULUS] > 1:
        return float(min(0.5 * turn(n, r), _STOPPED))
    beat = r[TICK] if r[USUAL] > 0.5 * r[TICK] else 0.0
    return float(max(0.5 * r[TICK], 4.0 * r[SCATTER], _LEAST) + beat)


@njit
def _is_told(n: Ints, r: Floats, delay: float, host_ns: int) -> bool:
    """Whether the line takes a frame: not one out of a backlog, which would bend it, unless all are like that."""
    if float(host_ns - n[ORIGIN]) - r[SINCE_HOST] < _FORMING and (
        r[ROUGH] > 0.0 or delay < r[TOLD_DELAY] + _limit(n, r)  # a rate that is not as nominal shows little by little
    ):
        return True
    if n[ASIDE] > 0 and host_ns - n[ASIDE_SINCE] > _CHANGED * r[SPEED]:
        return True
    return bool(delay < min(_limit(n, r), max(_BACKLOG * r[USUAL], _LITTLE)))


@njit
def settle(n: Ints, r: Floats, histogram: Ints, host_ns: int) -> float:
    """Take the frame at NOW into the line, unless it is suspect; returns a delay that has lasted, ns, else 0."""
    y = float(host_ns - n[ORIGIN])
    delay = y - line_at(r, r[NOW])
    if _is_told(n, r, delay, host_ns):
        n[ASIDE] = 0
        delay = r[TOLD_DELAY] = observe(r, r[NOW], y)
        histogram[BINS + bin_of(delay)] += 1
    else:
        n[ASIDE_SINCE] = n[ASIDE_SINCE] if n[ASIDE] > 0 else host_ns
        n[ASIDE] += 1
    if n[FRAMES] % _REVIEW == 0 or r[USUAL] == 0.0:
        r[USUAL] = max(1.25 * quantile(histogram, BINS, 0.99), _LEAST)
    n[HOST] = host_ns
    histogram[bin_of(delay)] += 1
    r[WORST] = max(r[WORST], delay)
    if delay < _limit(n, r):
        n[SUSPECTS] = 0
        return 0.0
    return _wait(n, r, delay, host_ns)


@njit
def is_doubtful(n: Ints, r: Floats) -> bool:
    """Whether the last frame has been suspect for some time."""
    return bool(n[SUSPECTS] > 0 and n[HOST] - n[SUSPECT_SINCE] >= _DOUBT * r[SPEED])


@njit
def _wait(n: Ints, r: Floats, delay: float, host_ns: int) -> float:
    """Count a suspect frame; returns the least delay once it has lasted, ns, else 0."""
    least = r[SUSPECT_DELAY] if n[SUSPECTS] > 0 else math.inf
    if delay < least - max(0.5 * r[TYPICAL], 0.01 * delay):
        n[SUSPECT_SINCE] = host_ns
    r[SUSPECT_DELAY] = min(least, delay)
    n[SUSPECTS] += 1
    if n[SUSPECTS] < _ENOUGH or host_ns - n[SUSPECT_SINCE] < _PATIENCE * r[SPEED]:
        return 0.0
    n[SUSPECTS] = 0
    return float(r[SUSPECT_DELAY])
