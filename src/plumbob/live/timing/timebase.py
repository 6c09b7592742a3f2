"""The time base of one source: takes what came with each frame, gives each frame its time.

A device clock gives it in exact integers, with the device's own steps. A frame counter gives a whole number of periods,
and the clock that they make is led to the line beneath the host's times, so slowly that no step shows it. Without any
counter the step is one frame, or as many as the place in the stream shows; frames that were lost without a trace in the
stream show as a delay that lasts.

Every frame's time depends on the frames before it and on what came with it, never on how they were handed over.
"""

import math
from collections import deque
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.errors import ShapeError
from plumbob.core.flags import GAP, TIME_FAULT
from plumbob.core.kernels import kernel
from plumbob.core.time import BINS
from plumbob.data.recording import Stamps, TimeReport, delays
from plumbob.live.timing import spec as state
from plumbob.live.timing.counter import ANOTHER_HOST, advance, begin_again, make_up
from plumbob.live.timing.delay import Ints, begin_line, is_doubtful, line_at, settle

_HASTE: Final = 2e-3  # of a step: by more no step is made longer or shorter
_SHORT, _LONG = 1e9, 30e9  # ns: time constants towards the line, when it is new and when it is old
_AGE: Final = 0.25  # time constant over age
_LEARN_TIME: Final = 500_000_000  # ns
_LEARN_FRAMES: Final = 8
_ALL_ODD: Final = 8
_MEMORY: Final = 1.0 / 16.0


@kernel
def stamp_frames(
    n: Ints, r: Floats, histogram: Ints, host_ns: Ints, place: Ints, count: Ints, frame: Ints, t_ns: Ints, step: Ints,
    words: NDArray[np.uint32], lost: Ints, kinds: NDArray[np.uint8],
) -> None:  # fmt: skip
    """Stamp frames in order; the last five arrays take what comes out."""
    for k in range(host_ns.size):
        kind = stamp_frame(n, r, histogram, host_ns[k], place[k], count[k], frame[k])
        t_ns[k], step[k], lost[k], kinds[k] = n[state.STAMP], n[state.STEP], n[state.MISSING], kind
        words[k] = _frame_flags(n, kind)


@kernel
def _frame_flags(n: Ints, kind: int) -> int:
    """Flags of the frame; counts it."""
    n[state.FRAMES] += 1
    for bit in range(8):
        n[state.TALLY + bit] += (kind >> bit) & 1
    word = TIME_FAULT if kind & (state.UNUSED | state.UNSURE) else 0
    if n[state.MISSING] > 0 or kind & (state.RESET | state.BROKEN):
        n[state.LOST] += n[state.MISSING]
        n[state.GAPS] += 1
        word |= GAP
    return int(word)


@kernel
def stamp_frame(n: Ints, r: Floats, histogram: Ints, host_ns: int, place: int, count: int, frame: int) -> int:
    """Move STAMP on to the next frame, and MISSING to what is lost before it; returns what became of the frame."""
    n[state.MISSING], n[state.STEP] = 0, 0
    if n[state.STARTED] == 0:
        return _start(n, r, host_ns, place, count, frame)
    host = _never_back(n, r, int(host_ns))
    if r[state.TICK] == 0.0:
        kind = _learn(n, r, host, place, count)
    elif n[state.TICK_DENOMINATOR] > 0:
        kind = _by_clock(n, r, histogram, host, count, frame)
    else:
        kind = _by_frames(n, r, histogram, host, place, count)
    if kind & state.UNUSED:
        return kind
    kind |= state.BROKEN if n[state.REOPENED] else 0
    n[state.REOPENED], n[state.PLACE] = 0, place
    return kind


@kernel
def _start(n: Ints, r: Floats, host_ns: int, place: int, count: int, frame: int) -> int:
    """Begin at the first frame, at its host time."""
    n[state.STARTED], n[state.REOPENED] = 1, 0
    n[state.ORIGIN] = n[state.LATEST] = n[state.HOST] = n[state.STAMP] = n[state.LEARN_SINCE] = host_ns
    n[state.COUNT], n[state.FRAME], n[state.PLACE] = count, frame, place
    begin_line(r, 0.0, 0.0)
    return 0


@kernel
def _never_back(n: Ints, r: Floats, host_ns: int) -> int:
    """Host time that goes on where the host's clock has been set back; how long that took, nobody knows."""
    host = host_ns + n[state.SHIFT]
    if host < n[state.LATEST]:
        resumed = n[state.LATEST] + int(r[state.TYPICAL])
        n[state.SHIFT] += resumed - host
        host = resumed
        n[state.REOPENED] = ANOTHER_HOST
    n[state.LATEST] = host
    return int(host)


@kernel
def _by_clock(n: Ints, r: Floats, histogram: Ints, host: int, count: int, frame: int) -> int:
    """Take the device's own time, in exact arithmetic."""
    kind = advance(n, r, histogram, count, host)
    if kind & state.UNUSED:
        if kind == state.DUPLICATE and n[state.FRAME_MODULUS] > 0:
            n[state.FRAME] = frame  # another frame in the same tick
        return kind
    if kind & state.RESET:
        passed = float(n[state.EXTRA])
        n[state.STAMP] += n[state.EXTRA]
        n[state.REMAINDER] = 0
        n[state.MISSING] = _missed(r, passed)
        n[state.FRAME] = frame
        return kind
    passed = n[state.STEP] * r[state.TICK]
    lead = _exactly(n)
    n[state.STAMP] += lead
    n[state.MISSING] = _missed_frames(n, r, passed, frame)
    _learn_pace(n, r, passed)
    return kind


@kernel
def _learn_pace(n: Ints, r: Floats, passed: float) -> None:
    """Follow the time from frame to frame; steps that do not fit change it only when there is nothing else any more."""
    if abs(passed - r[state.TYPICAL]) <= 0.5 * r[state.TYPICAL]:
        r[state.TYPICAL] += _MEMORY * (passed - r[state.TYPICAL])
        n[state.ODD] = 0
        return
    n[state.ODD] += 1
    if n[state.ODD] == _ALL_ODD:
        r[state.TYPICAL], n[state.ODD] = passed, 0


@kernel
def _exactly(n: Ints) -> int:
    """STEP counts in whole nanoseconds; what is left over is kept."""
    turns = n[state.STEP] // n[state.TICK_DENOMINATOR]
    rest = n[state.STEP] - turns * n[state.TICK_DENOMINATOR]
    over = rest * n[state.TICK_REST] + n[state.REMAINDER]
    carried = over // n[state.TICK_DENOMINATOR]
    n[state.REMAINDER] = over - carried * n[state.TICK_DENOMINATOR]
    return int(n[state.STEP] * n[state.TICK_WHOLE] + turns * n[state.TICK_REST] + carried)


@kernel
def _missed(r: Floats, passed: float) -> int:
    """Frames that time says are missing."""
    if r[state.TYPICAL] == 0.0:
        r[state.TYPICAL] = passed
    return int(max(math.floor(passed / r[state.TYPICAL] + 0.5) - 1, 0))


@kernel
def _missed_frames(n: Ints, r: Floats, passed: float, frame: int) -> int:
    """Frames that the frame counter says are missing, with as many turns as time says; without a counter, time says."""
    by_time = _missed(r, passed)
    if n[state.FRAME_MODULUS] == 0:
        return by_time
    forward = int((n[state.FRAME_SIGN] * (frame - n[state.FRAME])) % n[state.FRAME_MODULUS])
    n[state.FRAME] = frame
    expected = passed / r[state.TYPICAL]
    turns = max(math.floor((expected - forward) / n[state.FRAME_MODULUS] + 0.5), 0)
    total = int(forward + turns * n[state.FRAME_MODULUS])
    return total - 1 if 1 <= total <= 2.0 * expected + 8.0 else by_time


@kernel
def _by_frames(n: Ints, r: Floats, histogram: Ints, host: int, place: int, count: int) -> int:
    """Count periods, from the frame counter or from the place in the stream."""
    counted = n[state.MODULUS] > 1
    kind = advance(n, r, histogram, count, host) if counted else _by_place(n, r, histogram, host, place)
    if kind & state.UNUSED:
        return kind
    if kind & state.RESET:
        n[state.STAMP] += n[state.EXTRA]
        n[state.MISSING] = _missed(r, float(n[state.EXTRA]))
        r[state.FRACTION] = 0.0
    else:
        lead = _lead(n, r, n[state.STEP] * r[state.TICK])
        n[state.STAMP] += lead
        n[state.MISSING] = n[state.STEP] - 1
    return kind


@kernel
def _by_place(n: Ints, r: Floats, histogram: Ints, host: int, place: int) -> int:
    """Without a counter: the next frame, unless bytes between the two, or a lasting delay, tell of more."""
    if n[state.REOPENED]:
        return begin_again(n, r, host, 0)
    frames = _frames_in(n, place)
    early = line_at(r, r[state.NOW] + frames * r[state.TICK]) - float(host - n[state.ORIGIN])
    n[state.STEP] = frames if early <= 0.5 * r[state.TICK] else 1  # what is too early for frames was noise
    r[state.NOW] += n[state.STEP] * r[state.TICK]
    lasting = settle(n, r, histogram, host)
    if lasting > 0.0:
        return make_up(n, r, lasting)
    return state.SUSPECT if is_doubtful(n, r) else 0


@kernel
def _frames_in(n: Ints, place: int) -> int:
    """Frames that the bytes since the last one have room for."""
    if n[state.FRAME_BYTES] == 0:
        return 1
    return int(max((2 * (place - n[state.PLACE]) + n[state.FRAME_BYTES]) // (2 * n[state.FRAME_BYTES]), 1))


@kernel
def _lead(n: Ints, r: Floats, nominal: float) -> int:
    """Length of a step of so much nominal time, ns, led towards the line; what is below a nanosecond is kept."""
    step = nominal + nominal * r[state.DRIFT]
    behind = line_at(r, r[state.NOW]) - float(n[state.STAMP] - n[state.ORIGIN]) - r[state.FRACTION] - step
    slowly = min(max(_AGE * (r[state.NOW] - r[state.SINCE]), _SHORT), _LONG)
    haste = _HASTE * nominal
    step += r[state.FRACTION] + min(max(behind * min(nominal / slowly, 1.0), -haste), haste)
    step_ns = max(math.floor(step), 1)
    r[state.FRACTION] = step - step_ns
    return int(step_ns)


@kernel
def _learn(n: Ints, r: Floats, host: int, place: int, count: int) -> int:
    """Take the host's times while the period is being measured; frames of one read cannot be told apart in time."""
    if n[state.REOPENED]:
        n[state.LEARNT], n[state.LEARN_SINCE] = 0, host
    step = _frames_in(n, place)
    if n[state.MODULUS] > 1:
        step = int((n[state.SIGN] * (count - n[state.COUNT])) % n[state.MODULUS])
        if step == 0:
            return state.DUPLICATE
    newer = host > n[state.STAMP]
    n[state.LEARNT] += step if host > n[state.LEARN_SINCE] else 0  # what the first read brings may have waited
    n[state.COUNT], n[state.HOST] = count, host
    n[state.STAMP] = host if newer else n[state.STAMP] + 1
    if host - n[state.LEARN_SINCE] >= _LEARN_TIME and n[state.LEARNT] >= _LEARN_FRAMES:
        r[state.TICK] = r[state.TYPICAL] = (host - n[state.LEARN_SINCE]) / n[state.LEARNT]
        r[state.ROUGH] = 1.0
        begin_line(r, r[state.NOW], float(host - n[state.ORIGIN]))
    return 0 if newer else state.UNSURE


REMEMBERED: Final = 1000  # gaps that a report lists


class TimeBase:
    """Gives frames their times, in order, once each; memory is bounded.

    The result does not depend on how frames are handed over: one call with all of them gives the same bits as many
    calls.
    """

    def __init__(self, spec: state.TimeSpec) -> None:
        self.spec = spec
        self._whole = np.zeros(state.WHOLES, dtype=np.int64)
        self._real = np.zeros(state.REALS)
        self._histogram = np.zeros(2 * BINS, dtype=np.int64)
        self._gaps: deque[tuple[int, int, int]] = deque(maxlen=REMEMBERED)
        configure(self._whole, self._real, spec)

    def stamp(
        self, t_ns: NDArray[np.int64], place: NDArray[np.int64], *, clock: ArrayLike | None = None,
        frames: ArrayLike | None = None,
    ) -> Stamps:  # fmt: skip
        """Stamp the next frames, of which `clock` and `frames` say what the device clock and the frame counter count.

        `t_ns` (N,): host time, ns, of the read that brought each frame's first byte; `place` (N,): its offset in the
        stream.
        """
        host = _integers("t_ns", t_ns, None)
        size = host.shape[0]
        counter = self._counts("clock", clock, self.spec.clock, size)
        second = self._counts("frames", frames, self.spec.frames, size)
        before = int(self._whole[state.STAMP])
        out = Stamps(
            np.empty(size, np.int64), np.empty(size, np.int64), np.empty(size, np.uint32),
            np.empty(size, np.int64), np.empty(size, np.uint8),
        )  # fmt: skip
        stamp_frames(
            self._whole, self._real, self._histogram,
            host, _integers("place", place, size), second if self.spec.clock is None else counter, second,
            out.t_ns, out.step, out.flags, out.lost, out.kind,
        )  # fmt: skip
        for k in np.flatnonzero(out.flags & flags.GAP)[-REMEMBERED:].tolist():
            start = int(out.t_ns[k - 1]) if k else before
            self._gaps.append((start, int(out.t_ns[k]), int(out.lost[k])))
        return out

    def reopened(self, t_ns: int) -> None:
        """Say that the source was opened again at that host time, ns: before the next frame there is a gap."""
        n = self._whole
        if n[state.STARTED]:
            back = max(int(n[state.LATEST] - n[state.SHIFT]) - t_ns, 0)  # another clock, after a restart of the host
            n[state.SHIFT] += back
            n[state.REOPENED] = ANOTHER_HOST if back else 1

    def report(self) -> TimeReport:
        """What the frames so far have shown."""
        n, r = self._whole, self._real
        tally = [int(count) for count in n[state.TALLY : state.TALLY + 8]]
        has_rate = self.spec.clock is not None or self.spec.rate is not None
        duplicates, late, ahead, resets, wrapped, suspects, broken, unsure = tally
        return TimeReport(
            mode=self.spec.mode,
            frames=int(n[state.FRAMES]),
            rate=self._rate(tally[0] + tally[1] + tally[2]),
            drift_ppm=1e6 * float(r[state.DRIFT]) if has_rate else float("nan"),
            delays=delays(self._histogram, float(r[state.WORST])),
            offset=(int(n[state.STAMP] - n[state.ORIGIN]) - line_at(r, float(r[state.NOW]))) / 1e9,
            lost=int(n[state.LOST]),
            duplicates=duplicates,
            late=late,
            ahead=ahead,
            resets=resets,
            wraps_by_host=wrapped,
            suspects=suspects,
            reopened=broken,
            unsure=unsure,
            inferred=int(n[state.INFERRED]),
            inferred_time=int(n[state.INFERRED_NS]) / 1e9,
            gap_count=int(n[state.GAPS]),
            gaps=tuple(self._gaps),
        )

    def _rate(self, unused: int) -> float:
        """Frames in a second of the host: on average by a device clock, else as the line says."""
        n, r = self._whole, self._real
        period = float(r[state.TYPICAL])
        if self.spec.clock is not None:
            steps = int(n[state.FRAMES] + n[state.LOST]) - unused - 1
            period = int(n[state.STAMP] - n[state.ORIGIN]) / steps if steps > 0 else 0.0
        return 1e9 / (period * (1.0 + float(r[state.DRIFT]))) if period else float("nan")

    def _counts(
        self, name: str, counts: ArrayLike | None, counter: state.Counter | None, size: int
    ) -> NDArray[np.int64]:
        if counter is None:
            return np.zeros(size, dtype=np.int64)
        if counts is None:
            raise ShapeError(f"{name} is missing; the time comes from a counter of {counter.bits} bits.")
        return _integers(name, counts, size)


def configure(ints: NDArray[np.int64], real: NDArray[np.float64], spec: state.TimeSpec) -> None:
    """Write into a state what does not change."""
    counter = spec.clock or spec.frames
    ints[state.MODULUS] = 1 if counter is None else counter.modulus
    ints[state.SIGN] = -1 if counter is not None and counter.down else 1
    ints[state.FRAME_BYTES] = spec.frame_bytes or 0
    period = 1e9 / spec.rate if spec.rate else 0.0
    real[state.TICK] = real[state.TYPICAL] = period
    real[state.SPEED] = spec.speed
    if spec.clock is not None and spec.clock.tick is not None:
        tick = spec.clock.tick
        ints[state.TICK_WHOLE], rest = divmod(tick.numerator, tick.denominator)
        ints[state.TICK_REST], ints[state.TICK_DENOMINATOR] = rest, tick.denominator
        real[state.TICK] = float(tick)
        if spec.frames is not None:
            ints[state.FRAME_MODULUS] = spec.frames.modulus
            ints[state.FRAME_SIGN] = -1 if spec.frames.down else 1


def _integers(name: str, value: ArrayLike, size: int | None) -> NDArray[np.int64]:
    """Return `value` as int64; of 64 unsigned bits the lowest 62."""
    array: NDArray[Any] = np.asarray(value)
    if array.ndim != 1 or array.dtype.kind not in "iu" or (size is not None and array.shape[0] != size):
        many = "one per frame" if size is None else f"{size}, one per frame"
        raise ShapeError(f"{name} must be a row of integers, {many}, but it is {array.dtype} {array.shape}.")
    if array.dtype == np.uint64:
        array = array & np.uint64(2**62 - 1)
    return np.ascontiguousarray(array, dtype=np.int64)
