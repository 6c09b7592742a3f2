"""A counter of n bits, made to count on: what each frame's count means, beside the host's time.

A count says where in its turn the counter is, forwards or back. The host's time says which of the two is possible: no
frame arrives before it was made, and a delay is seldom longer than usual. Where a gap may be longer than a turn, the
host's time also says how many turns it was; a frame that follows the last one closely, but late, has waited in a queue
until `plumbob.clock.delay` proves the contrary. A count that contradicts the host is not followed: it is late, or
ahead, and its frame not used. Only when `_RISING` such counts in a row are in order among themselves has the counter
begun anew.
"""

import math
from typing import Final

from plumbob._jit import njit
from plumbob.check import Floats
from plumbob.clock.delay import LEARNING, Ints, is_doubtful, settle, turn
from plumbob.clock.hull import begin_line, line_at
from plumbob.clock.layout import (
    AHEAD,
    CHAIN,
    CHAIN_COUNT,
    COUNT,
    DUPLICATE,
    EXTRA,
    HOST,
    INFERRED,
    INFERRED_NS,
    LATE,
    MODULUS,
    NOW,
    ORIGIN,
    REOPENED,
    RESET,
    SIGN,
    SINCE,
    STEP,
    SUSPECT,
    SUSPECTS,
    TICK,
    TYPICAL,
    USUAL,
    WRAPPED,
)

ANOTHER_HOST: Final = 2
"""Value of REOPENED where host times before and after do not belong together."""

_RISING: Final = 4
_CLOSE: Final = 0.3  # frames: by so much may steps differ where none is missing
_FIRST: Final = 1e9  # ns
_BEHIND: Final = 16.0  # frames: farther back, nothing comes late
_SLACK: Final = 1e6  # ns
_UNSURE: Final = 1e-3  # of the time passed: what two clocks may differ by
_NO: Final = -1


@njit
def advance(n: Ints, r: Floats, histogram: Ints, count: int, host_ns: int) -> int:
    """Take the next frame's count.

    STEP is set to the counts since the last accepted frame; after a reset EXTRA, ns, stands in its place. Returns what
    became of the frame.
    """
    n[STEP], n[EXTRA] = 0, 0
    forward = int((n[SIGN] * (count - n[COUNT])) % n[MODULUS])
    delay = float(host_ns - n[ORIGIN]) - line_at(r, r[NOW] + forward * r[TICK])
    close = _is_next(r, forward * r[TICK])
    back = (n[MODULUS] - forward) * r[TICK] if forward else 0.0
    if _impossible(n, r, forward, delay, host_ns) and not close:
        kind = LATE if back <= _BEHIND * r[TYPICAL] else AHEAD
        return begin_again(n, r, host_ns, count) if _insists(n, r, count) else kind
    turns = _turns(n, r, delay, close and not n[REOPENED])
    if forward == 0 and turns <= 0:
        return DUPLICATE
    if turns == _NO and n[REOPENED]:
        return begin_again(n, r, host_ns, count)
    n[CHAIN], n[COUNT] = 0, count
    n[STEP] = forward + max(turns, 0) * n[MODULUS]
    r[NOW] += n[STEP] * r[TICK]
    if n[REOPENED] == ANOTHER_HOST:
        begin_line(r, r[NOW], float(host_ns - n[ORIGIN]))
    lasting = settle(n, r, histogram, host_ns)
    if lasting > 0.0:
        return make_up(n, r, lasting)
    return (WRAPPED if turns > 0 else 0) | (SUSPECT if is_doubtful(n, r) else 0)


@njit
def _is_next(r: Floats, ahead: float) -> bool:
    """Whether a step is that to the very next frame, whatever the host says."""
    if r[TYPICAL] == 0.0:
        return 0.0 < ahead <= _FIRST
    return bool(abs(ahead - r[TYPICAL]) <= _CLOSE * r[TYPICAL])


@njit
def _slack(n: Ints, r: Floats, passed: float) -> float:
    """How early a frame may seem to be, because the line is not yet where it belongs, ns."""
    if r[NOW] - r[SINCE] < LEARNING:
        return float(min(_FIRST, 0.25 * turn(n, r)))
    return float(_SLACK + 0.5 * r[TYPICAL] + _UNSURE * passed)


@njit
def _impossible(n: Ints, r: Floats, forward: int, delay: float, host_ns: int) -> bool:
    """Whether so many counts forward would be in the future, or a little way back is all but certain."""
    ahead = forward * r[TICK]
    passed = float(host_ns - n[HOST])
    if delay < -_slack(n, r, passed):
        return True
    nearly = (n[MODULUS] - forward) * r[TICK] <= 0.5 * _BEHIND * r[TYPICAL]
    return bool(nearly and ahead > passed + _BEHIND * r[TYPICAL])


@njit
def _insists(n: Ints, r: Floats, count: int) -> bool:
    """Count the frames that contradict in a row, in order among themselves; True when they are enough."""
    after = int((n[SIGN] * (count - n[CHAIN_COUNT])) % n[MODULUS])
    follows = n[CHAIN] > 0 and after > 0 and after * r[TICK] <= _BEHIND * r[TYPICAL]
    n[CHAIN] = n[CHAIN] + 1 if follows else 1
    n[CHAIN_COUNT] = count
    return bool(n[CHAIN] >= _RISING or n[REOPENED])


@njit
def _turns(n: Ints, r: Floats, delay: float, close: bool) -> int:
    """Turns that the counter has made unseen, by the host's time; −1 where no number of them explains the delay."""
    whole = turn(n, r)
    if delay < 0.5 * whole:
        return 0
    if close:
        return _NO
    turns = math.floor((delay + _SLACK) / whole)
    return int(turns) if delay - turns * whole <= min(r[USUAL], 0.5 * whole) else _NO


@njit
def make_up(n: Ints, r: Floats, lasting: float) -> int:
    """Add the turns that a lasting delay shows, or begin again where it is no number of turns."""
    whole = turn(n, r)
    turns = math.floor(lasting / whole + 0.5)
    fits = abs(lasting - turns * whole) <= r[USUAL]
    by_turns = turns > 0 and (fits or n[MODULUS] == 1)
    n[INFERRED] += 1
    n[INFERRED_NS] += int(turns * whole if by_turns else lasting)
    if by_turns:
        n[STEP] += turns * n[MODULUS]
        r[NOW] += turns * whole
        return WRAPPED
    r[NOW] += lasting
    n[EXTRA] = int(n[STEP] * r[TICK] + lasting)
    n[STEP] = 0
    begin_line(r, r[NOW], float(n[HOST] - n[ORIGIN]))
    return RESET


@njit
def begin_again(n: Ints, r: Floats, host_ns: int, count: int) -> int:
    """Go on from the host's time, because the count does not say how long it has been."""
    n[STEP] = 0
    n[EXTRA] = max(host_ns - n[HOST], 1)
    n[CHAIN], n[SUSPECTS] = 0, 0
    n[COUNT], n[HOST] = count, host_ns
    r[NOW] += float(n[EXTRA])
    begin_line(r, r[NOW], float(host_ns - n[ORIGIN]))
    return RESET
