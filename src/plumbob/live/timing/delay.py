"""Whether a frame is late because it waited or because others before it are missing, by hulls of the delays.

A stall of the host makes frames late, and then they come in a burst and the delay falls back. Frames that were lost
without a trace in any counter make all that follow late, for good. So a delay that is longer than usual makes a frame
suspect; only when the delay has stayed, without falling, through `_PATIENCE` of the host's time and `_ENOUGH` frames,
is it taken for time that has passed unseen. The other order, to believe at once and repent, would need a clock that
goes backwards.

The line beneath all points (device time, host time): delays are only positive, so the earliest arrivals tell.

A frame arrives at ``host = offset + (1 + drift) · device + delay``, and ``delay ≥ 0``. Of each block of device time the
lowest point is kept. The lower convex hull of at most 64 blocks gives the line: its slope is that of the edge in the
middle of the window, which minimises the sum of the delays, and its height is the highest that stays below all points.
Blocks begin short and double their length whenever 64 are full, so the line is there after a fraction of a second; at
three seconds they stop, and the window slides, so that it follows a drift that changes with temperature.

What this is not: a regression, which averages the delays in, or a Kalman filter, which takes them for symmetric. The
least delay itself cannot be seen from one end, and remains in the offset. Nor can a delay be seen that changes as
steadily as a clock drifts.

Departures from [Zhang2002]: the window slides, in blocks; its middle is that of the host's time, so that a backlog that
drains weighs little; a drift counts only as far as its displacement over the window exceeds what the scatter of the
blocks' lowest points can feign.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.kernels import kernel
from plumbob.core.time import BINS, bin_index, quantile
from plumbob.live.timing import spec as state

_SHORTEST: Final = 50e6  # ns
_LONGEST: Final = 3.2e9  # 50 ms doubled six times
_YOUNG: Final = 10e9  # ns, in which a drift of more than _SAFE is sooner a backlog that drains
_SAFE: Final = 0.05
_FASTEST, _SLOWEST = -0.9, 9.0  # ten times, or a tenth of, what is nominal
_WINDOW: Final = 1.25 * state.CAPACITY * _LONGEST  # a block before that is forgotten, even if few came since


@kernel
def line_at(r: Floats, x: float) -> float:
    """Host time at which a frame of device time x arrives at the earliest, ns since the first."""
    return float(r[state.LINE_Y] + (x - r[state.LINE_X]) + (x - r[state.LINE_X]) * r[state.DRIFT])


@kernel
def begin_line(r: Floats, x: float, y: float) -> None:
    """Forget all points but keep the drift, which is the oscillator's."""
    r[state.LINE_X], r[state.LINE_Y] = x, y
    r[state.PRIOR], r[state.SINCE], r[state.SINCE_HOST] = r[state.DRIFT], x, y
    r[state.SCATTER], r[state.POINTS] = 0.0, 0.0
    r[state.BLOCK], r[state.BLOCK_END] = _SHORTEST, x + _SHORTEST
    r[state.BEST_X], r[state.BEST_Y], r[state.BLOCK_SINCE] = x, y, y


@kernel
def observe(r: Floats, x: float, y: float) -> float:
    """Take a point and return its delay, ns; x must not fall."""
    if (
        x >= r[state.BLOCK_END] and y >= r[state.BLOCK_SINCE] + 0.5 * r[state.BLOCK]
    ):  # a backlog is not spread over blocks
        _keep_block(r)
        _fit(r)
        r[state.BLOCK_END] = x + r[state.BLOCK]
        r[state.BEST_X], r[state.BEST_Y], r[state.BLOCK_SINCE] = x, y, y
    else:
        across = x - r[state.BEST_X]
        if y - r[state.BEST_Y] < across + across * r[state.DRIFT]:
            r[state.BEST_X], r[state.BEST_Y] = x, y
    delay = y - line_at(r, x)
    if delay < 0.0:
        r[state.LINE_Y] += delay
        return 0.0
    return delay


@kernel
def _keep_block(r: Floats) -> None:
    """Remember the lowest point of the block that ends."""
    count = int(r[state.POINTS])
    if count == state.CAPACITY and r[state.BLOCK] < _LONGEST:
        _pair_blocks(r)
        count = state.CAPACITY // 2
    old = 1 if count == state.CAPACITY else 0
    while old < count and r[state.BLOCK_X + old] < r[state.BEST_X] - _WINDOW:
        old += 1
    for k in range(old, count):
        r[state.BLOCK_X + k - old], r[state.BLOCK_Y + k - old] = r[state.BLOCK_X + k], r[state.BLOCK_Y + k]
    count -= old
    r[state.BLOCK_X + count], r[state.BLOCK_Y + count] = r[state.BEST_X], r[state.BEST_Y]
    r[state.POINTS] = count + 1.0


@kernel
def _pair_blocks(r: Floats) -> None:
    """Make one block of each two."""
    for k in range(state.CAPACITY // 2):
        a, b = 2 * k, 2 * k + 1
        across = r[state.BLOCK_X + b] - r[state.BLOCK_X + a]
        lower = b if r[state.BLOCK_Y + b] - r[state.BLOCK_Y + a] < across + across * r[state.DRIFT] else a
        r[state.BLOCK_X + k], r[state.BLOCK_Y + k] = r[state.BLOCK_X + lower], r[state.BLOCK_Y + lower]
    r[state.BLOCK] *= 2.0


@kernel
def _fit(r: Floats) -> None:
    """Draw the line anew: slope from the hull, height from the lowest point."""
    last = int(r[state.POINTS]) - 1
    if last >= 2:
        slope = _slope_in_the_middle(r, _hull(r))
        feigned = 4.0 * _raise_line(r, slope) / (last + 1.0)
        span = r[state.BLOCK_X + last] - r[state.BLOCK_X]
        moved = (slope - r[state.PRIOR]) * span
        believed = 1.0 - (feigned / moved) ** 2 if abs(moved) > feigned else 0.0
        r[state.DRIFT] = r[state.PRIOR] + believed * (slope - r[state.PRIOR])
    elif last == 0:
        r[state.PRIOR] = r[state.DRIFT]  # after a long silence
    r[state.SCATTER] = _raise_line(r, r[state.DRIFT])


@kernel
def _hull(r: Floats) -> int:
    """Corners of the lower convex hull of the blocks' points, from left to right; returns how many."""
    corners = 0
    for k in range(int(r[state.POINTS])):
        x, y = r[state.BLOCK_X + k], r[state.BLOCK_Y + k]
        while corners >= 2:
            a, b = corners - 2, corners - 1
            left = (r[state.HULL_X + b] - r[state.HULL_X + a]) * (y - r[state.HULL_Y + a])  # [Zhang2002]
            right = (r[state.HULL_Y + b] - r[state.HULL_Y + a]) * (x - r[state.HULL_X + a])
            if left > right:
                break
            corners -= 1
        r[state.HULL_X + corners], r[state.HULL_Y + corners] = x, y
        corners += 1
    return corners


@kernel
def _slope_in_the_middle(r: Floats, corners: int) -> float:
    """Slope less 1 of the hull's edge in the middle of the window, in host time: a backlog that drains is short."""
    # departs from [Zhang2002]: the edge in the middle gives the slope
    middle = 0.5 * (r[state.HULL_Y] + r[state.HULL_Y + corners - 1])
    k = 1
    while r[state.HULL_Y + k] < middle:
        k += 1
    across = r[state.HULL_X + k] - r[state.HULL_X + k - 1]
    slope = (r[state.HULL_Y + k] - r[state.HULL_Y + k - 1] - across) / across
    if r[state.ROUGH] == 0.0 and r[state.HULL_Y + corners - 1] - r[state.SINCE_HOST] < _YOUNG:
        return float(min(max(slope, -_SAFE), _SAFE))
    return float(min(max(slope, _FASTEST), _SLOWEST))


@kernel
def _raise_line(r: Floats, slope: float) -> float:
    """Lay the line of that slope against the blocks' points from below; returns their mean height above it, ns."""
    count = int(r[state.POINTS])
    x, y = r[state.BLOCK_X + count - 1], r[state.BLOCK_Y + count - 1]
    least, total = math.inf, 0.0
    for k in range(count):
        across = r[state.BLOCK_X + k] - x
        height = r[state.BLOCK_Y + k] - y - across - across * slope
        least = min(least, height)
        total += height
    r[state.LINE_X], r[state.LINE_Y] = x, y + least
    return float(total / count - least)


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
LEARNING: Final = 2e9  # time in which a new line may still be far off, ns

_FORMING: Final = 12e9  # ns of the host's time, in which a new line may have to tilt


@kernel
def turn(n: Ints, r: Floats) -> float:
    """Time of one turn of the counter, ns; of one frame where there is no counter."""
    return float(n[state.MODULUS] * r[state.TICK])


@kernel
def _limit(n: Ints, r: Floats) -> float:
    """Delay above which a frame is suspect, ns: half of what could be missing unseen.

    Where a read brings several frames, the least delay drifts with the beat between frames and reads, and then jumps by
    up to a frame, exactly as if one were lost: there it takes two.
    """
    if n[state.MODULUS] > 1:
        return float(min(0.5 * turn(n, r), _STOPPED))
    beat = r[state.TICK] if r[state.USUAL] > 0.5 * r[state.TICK] else 0.0
    return float(max(0.5 * r[state.TICK], 4.0 * r[state.SCATTER], _LEAST) + beat)


@kernel
def _is_told(n: Ints, r: Floats, delay: float, host_ns: int) -> bool:
    """Whether the line takes a frame: not one out of a backlog, which would bend it, unless all are like that."""
    if float(host_ns - n[state.ORIGIN]) - r[state.SINCE_HOST] < _FORMING and (
        r[state.ROUGH] > 0.0
        or delay < r[state.TOLD_DELAY] + _limit(n, r)  # a rate that is not as nominal shows little by little
    ):
        return True
    if n[state.ASIDE] > 0 and host_ns - n[state.ASIDE_SINCE] > _CHANGED * r[state.SPEED]:
        return True
    return bool(delay < min(_limit(n, r), max(_BACKLOG * r[state.USUAL], _LITTLE)))


@kernel
def settle(n: Ints, r: Floats, histogram: Ints, host_ns: int) -> float:
    """Take the frame at NOW into the line, unless it is suspect; returns a delay that has lasted, ns, else 0."""
    y = float(host_ns - n[state.ORIGIN])
    delay = y - line_at(r, r[state.NOW])
    if _is_told(n, r, delay, host_ns):
        n[state.ASIDE] = 0
        delay = r[state.TOLD_DELAY] = observe(r, r[state.NOW], y)
        histogram[BINS + bin_index(delay)] += 1
    else:
        n[state.ASIDE_SINCE] = n[state.ASIDE_SINCE] if n[state.ASIDE] > 0 else host_ns
        n[state.ASIDE] += 1
    if n[state.FRAMES] % _REVIEW == 0 or r[state.USUAL] == 0.0:
        r[state.USUAL] = max(1.25 * quantile(histogram, BINS, 0.99), _LEAST)
    n[state.HOST] = host_ns
    histogram[bin_index(delay)] += 1
    r[state.WORST] = max(r[state.WORST], delay)
    if delay < _limit(n, r):
        n[state.SUSPECTS] = 0
        return 0.0
    return _wait(n, r, delay, host_ns)


@kernel
def is_doubtful(n: Ints, r: Floats) -> bool:
    """Whether the last frame has been suspect for some time."""
    return bool(n[state.SUSPECTS] > 0 and n[state.HOST] - n[state.SUSPECT_SINCE] >= _DOUBT * r[state.SPEED])


@kernel
def _wait(n: Ints, r: Floats, delay: float, host_ns: int) -> float:
    """Count a suspect frame; returns the least delay once it has lasted, ns, else 0."""
    least = r[state.SUSPECT_DELAY] if n[state.SUSPECTS] > 0 else math.inf
    if delay < least - max(0.5 * r[state.TYPICAL], 0.01 * delay):
        n[state.SUSPECT_SINCE] = host_ns
    r[state.SUSPECT_DELAY] = min(least, delay)
    n[state.SUSPECTS] += 1
    if n[state.SUSPECTS] < _ENOUGH or host_ns - n[state.SUSPECT_SINCE] < _PATIENCE * r[state.SPEED]:
        return 0.0
    n[state.SUSPECTS] = 0
    return float(r[state.SUSPECT_DELAY])
