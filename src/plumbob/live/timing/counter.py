"""A counter of n bits, made to count on: what each frame's count means, beside the host's time.

A count says where in its turn the counter is, forwards or back. The host's time says which of the two is possible: no
frame arrives before it was made, and a delay is seldom longer than usual. Where a gap may be longer than a turn, the
host's time also says how many turns it was; a frame that follows the last one closely, but late, has waited in a queue
until `timing.delay` proves the contrary. A count that contradicts the host is not followed: it is late, or
ahead, and its frame not used. Only when `_RISING` such counts in a row are in order among themselves has the counter
begun again.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.core.kernels import kernel
from plumbob.live.timing import spec as state
from plumbob.live.timing.delay import LEARNING, Ints, begin_line, is_doubtful, line_at, settle, turn

ANOTHER_HOST: Final = 2  # value of REOPENED where host times before and after do not belong together

_RISING: Final = 4
_CLOSE: Final = 0.3  # frames: by so much may steps differ where none is missing
_FIRST: Final = 1e9  # ns
_BEHIND: Final = 16.0  # frames: farther back, nothing comes late
_SLACK: Final = 1e6  # ns
_UNSURE: Final = 1e-3  # of the time passed: what two clocks may differ by
_NO: Final = -1


@kernel
def advance(n: Ints, r: Floats, histogram: Ints, count: int, host_ns: int) -> int:
    """Take the next frame's count.

    STEP is set to the counts since the last accepted frame; after a reset EXTRA, ns, stands in its place. Returns what
    became of the frame.
    """
    n[state.STEP], n[state.EXTRA] = 0, 0
    forward = int((n[state.SIGN] * (count - n[state.COUNT])) % n[state.MODULUS])
    delay = float(host_ns - n[state.ORIGIN]) - line_at(r, r[state.NOW] + forward * r[state.TICK])
    close = _is_next(r, forward * r[state.TICK])
    back = (n[state.MODULUS] - forward) * r[state.TICK] if forward else 0.0
    if _impossible(n, r, forward, delay, host_ns) and not close:
        kind = state.LATE if back <= _BEHIND * r[state.TYPICAL] else state.AHEAD
        return begin_again(n, r, host_ns, count) if _insists(n, r, count) else kind
    turns = _turns(n, r, delay, close and not n[state.REOPENED])
    if forward == 0 and turns <= 0:
        return state.DUPLICATE
    if turns == _NO and n[state.REOPENED]:
        return begin_again(n, r, host_ns, count)
    n[state.CHAIN], n[state.COUNT] = 0, count
    n[state.STEP] = forward + max(turns, 0) * n[state.MODULUS]
    r[state.NOW] += n[state.STEP] * r[state.TICK]
    if n[state.REOPENED] == ANOTHER_HOST:
        begin_line(r, r[state.NOW], float(host_ns - n[state.ORIGIN]))
    lasting = settle(n, r, histogram, host_ns)
    if lasting > 0.0:
        return make_up(n, r, lasting)
    return (state.WRAPPED if turns > 0 else 0) | (state.SUSPECT if is_doubtful(n, r) else 0)


@kernel
def _is_next(r: Floats, ahead: float) -> bool:
    """Whether a step is that to the very next frame, whatever the host says."""
    if r[state.TYPICAL] == 0.0:
        return 0.0 < ahead <= _FIRST
    return bool(abs(ahead - r[state.TYPICAL]) <= _CLOSE * r[state.TYPICAL])


@kernel
def _slack(n: Ints, r: Floats, passed: float) -> float:
    """How early a frame may seem to be, because the line is not yet where it belongs, ns."""
    if r[state.NOW] - r[state.SINCE] < LEARNING:
        return float(min(_FIRST, 0.25 * turn(n, r)))
    return float(_SLACK + 0.5 * r[state.TYPICAL] + _UNSURE * passed)


@kernel
def _impossible(n: Ints, r: Floats, forward: int, delay: float, host_ns: int) -> bool:
    """Whether so many counts forward would be in the future, or a little way back is all but certain."""
    ahead = forward * r[state.TICK]
    passed = float(host_ns - n[state.HOST])
    if delay < -_slack(n, r, passed):
        return True
    nearly = (n[state.MODULUS] - forward) * r[state.TICK] <= 0.5 * _BEHIND * r[state.TYPICAL]
    return bool(nearly and ahead > passed + _BEHIND * r[state.TYPICAL])


@kernel
def _insists(n: Ints, r: Floats, count: int) -> bool:
    """Count the frames that contradict in a row, in order among themselves; True when they are enough."""
    after = int((n[state.SIGN] * (count - n[state.CHAIN_COUNT])) % n[state.MODULUS])
    follows = n[state.CHAIN] > 0 and after > 0 and after * r[state.TICK] <= _BEHIND * r[state.TYPICAL]
    n[state.CHAIN] = n[state.CHAIN] + 1 if follows else 1
    n[state.CHAIN_COUNT] = count
    return bool(n[state.CHAIN] >= _RISING or n[state.REOPENED])


@kernel
def _turns(n: Ints, r: Floats, delay: float, close: bool) -> int:
    """Turns that the counter has made unseen, by the host's time; −1 where no number of them explains the delay."""
    turn_ns = turn(n, r)
    if delay < 0.5 * turn_ns:
        return 0
    if close:
        return _NO
    turns = math.floor((delay + _SLACK) / turn_ns)
    return int(turns) if delay - turns * turn_ns <= min(r[state.USUAL], 0.5 * turn_ns) else _NO


@kernel
def make_up(n: Ints, r: Floats, lasting: float) -> int:
    """Add the turns that a lasting delay shows, or begin again where it is not a number of turns."""
    turn_ns = turn(n, r)
    turns = math.floor(lasting / turn_ns + 0.5)
    fits = abs(lasting - turns * turn_ns) <= r[state.USUAL]
    by_turns = turns > 0 and (fits or n[state.MODULUS] == 1)
    n[state.INFERRED] += 1
    n[state.INFERRED_NS] += int(turns * turn_ns if by_turns else lasting)
    if by_turns:
        n[state.STEP] += turns * n[state.MODULUS]
        r[state.NOW] += turns * turn_ns
        return state.WRAPPED
    r[state.NOW] += lasting
    n[state.EXTRA] = int(n[state.STEP] * r[state.TICK] + lasting)
    n[state.STEP] = 0
    begin_line(r, r[state.NOW], float(n[state.HOST] - n[state.ORIGIN]))
    return state.RESET


@kernel
def begin_again(n: Ints, r: Floats, host_ns: int, count: int) -> int:
    """Go on from the host's time, because the count does not say how long it has been."""
    n[state.STEP] = 0
    n[state.EXTRA] = max(host_ns - n[state.HOST], 1)
    n[state.CHAIN], n[state.SUSPECTS] = 0, 0
    n[state.COUNT], n[state.HOST] = count, host_ns
    r[state.NOW] += float(n[state.EXTRA])
    begin_line(r, r[state.NOW], float(host_ns - n[state.ORIGIN]))
    return state.RESET


class CountedTime:
    """Counts ticks of the frames' clock, else their counter and the rate, else one period for each frame.

    Valid where nothing can be lost, or where what is lost shows in a count: a step is taken for the shorter way round a
    turn, one that goes back for none, and how long the device was silent is not known. The result does not depend on
    how frames are handed over.
    """

    def __init__(self, spec: state.TimeSpec) -> None:
        if spec.clock is None and spec.rate is None:
            raise ParameterError("without a clock in the frame, time can only be counted at a rate; give the rate.")
        self._spec = spec
        self._last: int | None = None
        self._total = 0

    def after_first(
        self, place: NDArray[np.int64], *, clock: ArrayLike | None = None, frames: ArrayLike | None = None
    ) -> NDArray[np.int64]:
        """Times (N,) of the next frames since the first of all, ns; parameters as of `TimeBase.stamp`."""
        spec = self._spec
        if spec.clock is not None and spec.clock.tick is not None:
            ticks = self._counted(_as_int64(clock), spec.clock)
            return np.asarray(ticks * spec.clock.tick.numerator // spec.clock.tick.denominator)
        passed = self._placed(place) if spec.frames is None else self._counted(_as_int64(frames), spec.frames)
        return np.asarray(np.rint(passed * (1e9 / float(spec.rate or 1.0))), dtype=np.int64)

    def _counted(self, counts: NDArray[np.int64], counter: state.Counter) -> NDArray[np.int64]:
        half, turn = counter.modulus // 2, counter.modulus
        steps = self._steps(counts) * (-1 if counter.down else 1)
        return self._sum(np.maximum((steps + half) % turn - half, 0))

    def _placed(self, place: NDArray[np.int64]) -> NDArray[np.int64]:
        """Frames that the bytes from one to the next have room for: a damaged one among them has its time."""
        steps, length = self._steps(place), self._spec.frame_bytes
        room = np.ones_like(steps) if length is None else np.maximum((2 * steps + length) // (2 * length), 1)
        return self._sum(np.where(steps > 0, room, 0))

    def _steps(self, counts: NDArray[np.int64]) -> NDArray[np.int64]:
        before = counts[:1] if self._last is None else np.array([self._last])
        self._last = int(counts[-1]) if counts.size else self._last
        return np.diff(counts, prepend=before)

    def _sum(self, steps: NDArray[np.int64]) -> NDArray[np.int64]:
        totals = self._total + np.cumsum(steps)
        self._total = int(totals[-1]) if totals.size else self._total
        return np.asarray(totals, dtype=np.int64)


def _as_int64(counts: ArrayLike | None) -> NDArray[np.int64]:
    """Counts as int64, of which a turn's lowest bits are what they were."""
    return np.asarray(counts).astype(np.int64)
