"""The line beneath all points (device time, host time): delays are only positive, so the earliest arrivals tell.

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

from plumbob._jit import njit
from plumbob.check import Floats
from plumbob.clock.layout import (
    BEST_X,
    BEST_Y,
    BLOCK,
    BLOCK_END,
    BLOCK_SINCE,
    BLOCK_X,
    BLOCK_Y,
    CAPACITY,
    DRIFT,
    HULL_X,
    HULL_Y,
    LINE_X,
    LINE_Y,
    POINTS,
    PRIOR,
    ROUGH,
    SCATTER,
    SINCE,
    SINCE_HOST,
)

_SHORTEST: Final = 50e6  # ns
_LONGEST: Final = 3.2e9  # 50 ms doubled six times
_YOUNG: Final = 10e9  # ns, in which a drift of more than _SAFE is sooner a backlog that drains
_SAFE: Final = 0.05
_FASTEST, _SLOWEST = -0.9, 9.0  # ten times, or a tenth of, what is nominal
_WINDOW: Final = 1.25 * CAPACITY * _LONGEST  # a block before that is forgotten, even if few came since


@njit
def line_at(r: Floats, x: float) -> float:
    """Host time at which a frame of device time x arrives at the earliest, ns since the first."""
    return float(r[LINE_Y] + (x - r[LINE_X]) + (x - r[LINE_X]) * r[DRIFT])


@njit
def begin_line(r: Floats, x: float, y: float) -> None:
    """Forget all points but keep the drift, which is the oscillator's."""
    r[LINE_X], r[LINE_Y] = x, y
    r[PRIOR], r[SINCE], r[SINCE_HOST] = r[DRIFT], x, y
    r[SCATTER], r[POINTS] = 0.0, 0.0
    r[BLOCK], r[BLOCK_END] = _SHORTEST, x + _SHORTEST
    r[BEST_X], r[BEST_Y], r[BLOCK_SINCE] = x, y, y


@njit
def observe(r: Floats, x: float, y: float) -> float:
    """Take a point and return its delay, ns; x must not fall."""
    if x >= r[BLOCK_END] and y >= r[BLOCK_SINCE] + 0.5 * r[BLOCK]:  # a backlog is not spread over blocks
        _keep_block(r)
        _fit(r)
        r[BLOCK_END] = x + r[BLOCK]
        r[BEST_X], r[BEST_Y], r[BLOCK_SINCE] = x, y, y
    else:
        across = x - r[BEST_X]
        if y - r[BEST_Y] < across + across * r[DRIFT]:
            r[BEST_X], r[BEST_Y] = x, y
    delay = y - line_at(r, x)
    if delay < 0.0:
        r[LINE_Y] += delay
        return 0.0
    return delay


@njit
def _keep_block(r: Floats) -> None:
    """Remember the lowest point of the block that ends."""
    count = int(r[POINTS])
    if count == CAPACITY and r[BLOCK] < _LONGEST:
        _pair_blocks(r)
        count = CAPACITY // 2
    old = 1 if count == CAPACITY else 0
    while old < count and r[BLOCK_X + old] < r[BEST_X] - _WINDOW:
        old += 1
    for k in range(old, count):
        r[BLOCK_X + k - old], r[BLOCK_Y + k - old] = r[BLOCK_X + k], r[BLOCK_Y + k]
    count -= old
    r[BLOCK_X + count], r[BLOCK_Y + count] = r[BEST_X], r[BEST_Y]
    r[POINTS] = count + 1.0


@njit
def _pair_blocks(r: Floats) -> None:
    """Make one block of each two."""
    for k in range(CAPACITY // 2):
        a, b = 2 * k, 2 * k + 1
        across = r[BLOCK_X + b] - r[BLOCK_X + a]
        lower = b if r[BLOCK_Y + b] - r[BLOCK_Y + a] < across + across * r[DRIFT] else a
        r[BLOCK_X + k], r[BLOCK_Y + k] = r[BLOCK_X + lower], r[BLOCK_Y + lower]
    r[BLOCK] *= 2.0


@njit
def _fit(r: Floats) -> None:
    """Draw the line anew: slope from the hull, height from the lowest point."""
    last = int(r[POINTS]) - 1
    if last >= 2:
        slope = _slope_in_the_middle(r, _hull(r))
        feigned = 4.0 * _raise_line(r, slope) / (last + 1.0)
        span = r[BLOCK_X + last] - r[BLOCK_X]
        moved = (slope - r[PRIOR]) * span
        believed = 1.0 - (feigned / moved) ** 2 if abs(moved) > feigned else 0.0
        r[DRIFT] = r[PRIOR] + believed * (slope - r[PRIOR])
    elif last == 0:
        r[PRIOR] = r[DRIFT]  # after a long silence
    r[SCATTER] = _raise_line(r, r[DRIFT])


@njit
def _hull(r: Floats) -> int:
    """Corners of the lower convex hull of the blocks' points, from left to right; returns how many."""
    corners = 0
    for k in range(int(r[POINTS])):
        x, y = r[BLOCK_X + k], r[BLOCK_Y + k]
        while corners >= 2:
            a, b = corners - 2, corners - 1
            left = (r[HULL_X + b] - r[HULL_X + a]) * (y - r[HULL_Y + a])
            right = (r[HULL_Y + b] - r[HULL_Y + a]) * (x - r[HULL_X + a])
            if left > right:
                break
            corners -= 1
        r[HULL_X + corners], r[HULL_Y + corners] = x, y
        corners += 1
    return corners


@njit
def _slope_in_the_middle(r: Floats, corners: int) -> float:
    """Slope less 1 of the hull's edge in the middle of the window, in host time: a backlog that drains is short."""
    middle = 0.5 * (r[HULL_Y] + r[HULL_Y + corners - 1])
    k = 1
    while r[HULL_Y + k] < middle:
        k += 1
    across = r[HULL_X + k] - r[HULL_X + k - 1]
    slope = (r[HULL_Y + k] - r[HULL_Y + k - 1] - across) / across
    if r[ROUGH] == 0.0 and r[HULL_Y + corners - 1] - r[SINCE_HOST] < _YOUNG:
        return float(min(max(slope, -_SAFE), _SAFE))
    return float(min(max(slope, _FASTEST), _SLOWEST))


@njit
def _raise_line(r: Floats, slope: float) -> float:
    """Lay the line of that slope against the blocks' points from below; returns their mean height above it, ns."""
    count = int(r[POINTS])
    x, y = r[BLOCK_X + count - 1], r[BLOCK_Y + count - 1]
    least, total = math.inf, 0.0
    for k in range(count):
        across = r[BLOCK_X + k] - x
        height = r[BLOCK_Y + k] - y - across - across * slope
        least = min(least, height)
        total += height
    r[LINE_X], r[LINE_Y] = x, y + least
    return float(total / count - least)
