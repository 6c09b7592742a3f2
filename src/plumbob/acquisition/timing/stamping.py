"""One frame's time, in the three ways that formats allow.

A device clock gives it in exact integers, with the device's own steps. A frame counter gives a whole number of periods,
and the clock that they make is led to the line beneath the host's times, so slowly that no step shows it. Without any
counter the step is one frame, or as many as the place in the stream shows; frames that were lost without a trace in the
stream show as a delay that lasts.

Every frame's time depends on the frames before it and on what came with it, never on how they were handed over.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.acquisition.timing.counter import ANOTHER_HOST, advance, begin_again, make_up
from plumbob.acquisition.timing.delay import Ints, begin_line, is_doubtful, line_at, settle
from plumbob.acquisition.timing.spec import (
    BROKEN,
    COUNT,
    DRIFT,
    DUPLICATE,
    EXTRA,
    FRACTION,
    FRAME,
    FRAME_BYTES,
    FRAME_MODULUS,
    FRAME_SIGN,
    FRAMES,
    GAPS,
    HOST,
    LATEST,
    LEARN_SINCE,
    LEARNT,
    LOST,
    MISSING,
    MODULUS,
    NOW,
    ODD,
    ORIGIN,
    PLACE,
    REMAINDER,
    REOPENED,
    RESET,
    ROUGH,
    SHIFT,
    SIGN,
    SINCE,
    STAMP,
    STARTED,
    STEP,
    SUSPECT,
    TALLY,
    TICK,
    TICK_DENOMINATOR,
    TICK_REST,
    TICK_WHOLE,
    TYPICAL,
    UNSURE,
    UNUSED,
)
from plumbob.core._jit import njit
from plumbob.core.check import Floats
from plumbob.core.flags import GAP, TIME_FAULT

_HASTE: Final = 2e-3  # of a step: by more no step is made longer or shorter
_SHORT, _LONG = 1e9, 30e9  # ns: time constants towards the line, when it is new and when it is old
_AGE: Final = 0.25  # time constant over age
_LEARN_TIME: Final = 500_000_000  # ns
_LEARN_FRAMES: Final = 8
_ALL_ODD: Final = 8
_MEMORY: Final = 1.0 / 16.0


@njit
def stamp_frames(
    n: Ints,
    r: Floats,
    histogram: Ints,
    host_ns: Ints,
    place: Ints,
    count: Ints,
    frame: Ints,
    t_ns: Ints,
    step: Ints,
    words: NDArray[np.uint32],
    lost: Ints,
    kinds: NDArray[np.uint8],
) -> None:
    """Stamp frames in order; the last five arrays take what comes out."""
    for k in range(host_ns.size):
        kind = stamp_frame(n, r, histogram, host_ns[k], place[k], count[k], frame[k])
        t_ns[k], step[k], lost[k], kinds[k] = n[STAMP], n[STEP], n[MISSING], kind
        words[k] = _flags_of(n, kind)


@njit
def _flags_of(n: Ints, kind: int) -> int:
    """Flags of the frame; counts it."""
    n[FRAMES] += 1
    for bit in range(8):
        n[TALLY + bit] += (kind >> bit) & 1
    word = TIME_FAULT if kind & (UNUSED | UNSURE) else 0
    if n[MISSING] > 0 or kind & (RESET | BROKEN):
        n[LOST] += n[MISSING]
        n[GAPS] += 1
        word |= GAP
    return int(word)


@njit
def stamp_frame(n: Ints, r: Floats, histogram: Ints, host_ns: int, place: int, count: int, frame: int) -> int:
    """Move STAMP on to the next frame, and MISSING to what is lost before it; returns what became of the frame."""
    n[MISSING], n[STEP] = 0, 0
    if n[STARTED] == 0:
        return _start(n, r, host_ns, place, count, frame)
    host = _never_back(n, r, int(host_ns))
    if r[TICK] == 0.0:
        kind = _learn(n, r, host, place, count)
    elif n[TICK_DENOMINATOR] > 0:
        kind = _by_clock(n, r, histogram, host, count, frame)
    else:
        kind = _by_frames(n, r, histogram, host, place, count)
    if kind & UNUSED:
        return kind
    kind |= BROKEN if n[REOPENED] else 0
    n[REOPENED], n[PLACE] = 0, place
    return kind


@njit
def _start(n: Ints, r: Floats, host_ns: int, place: int, count: int, frame: int) -> int:
    """Begin at the first frame, at its host time."""
    n[STARTED], n[REOPENED] = 1, 0
    n[ORIGIN] = n[LATEST] = n[HOST] = n[STAMP] = n[LEARN_SINCE] = host_ns
    n[COUNT], n[FRAME], n[PLACE] = count, frame, place
    begin_line(r, 0.0, 0.0)
    return 0


@njit
def _never_back(n: Ints, r: Floats, host_ns: int) -> int:
    """Host time that goes on where the host's clock has been set back; how long that took, nobody knows."""
    host = host_ns + n[SHIFT]
    if host < n[LATEST]:
        resumed = n[LATEST] + int(r[TYPICAL])
        n[SHIFT] += resumed - host
        host = resumed
        n[REOPENED] = ANOTHER_HOST
    n[LATEST] = host
    return int(host)


@njit
def _by_clock(n: Ints, r: Floats, histogram: Ints, host: int, count: int, frame: int) -> int:
    """Take the device's own time, in exact arithmetic."""
    kind = advance(n, r, histogram, count, host)
    if kind & UNUSED:
        if kind == DUPLICATE and n[FRAME_MODULUS] > 0:
            n[FRAME] = frame  # another frame in the same tick
        return kind
    if kind & RESET:
        passed = float(n[EXTRA])
        n[STAMP] += n[EXTRA]
        n[REMAINDER] = 0
        n[MISSING] = _missed(r, passed)
        n[FRAME] = frame
        return kind
    passed = n[STEP] * r[TICK]
    n[STAMP] += _exactly(n)
    n[MISSING] = _missed_frames(n, r, passed, frame)
    _learn_pace(n, r, passed)
    return kind


@njit
def _learn_pace(n: Ints, r: Floats, passed: float) -> None:
    """Follow the time from frame to frame; steps that do not fit change it only when there is nothing else any more."""
    if abs(passed - r[TYPICAL]) <= 0.5 * r[TYPICAL]:
        r[TYPICAL] += _MEMORY * (passed - r[TYPICAL])
        n[ODD] = 0
        return
    n[ODD] += 1
    if n[ODD] == _ALL_ODD:
        r[TYPICAL], n[ODD] = passed, 0


@njit
def _exactly(n: Ints) -> int:
    """STEP counts in whole nanoseconds; what is left over is kept."""
    turns = n[STEP] // n[TICK_DENOMINATOR]
    rest = n[STEP] - turns * n[TICK_DENOMINATOR]
    over = rest * n[TICK_REST] + n[REMAINDER]
    carried = over // n[TICK_DENOMINATOR]
    n[REMAINDER] = over - carried * n[TICK_DENOMINATOR]
    return int(n[STEP] * n[TICK_WHOLE] + turns * n[TICK_REST] + carried)


@njit
def _missed(r: Floats, passed: float) -> int:
    """Frames that time says are missing."""
    if r[TYPICAL] == 0.0:
        r[TYPICAL] = passed
    return int(max(math.floor(passed / r[TYPICAL] + 0.5) - 1, 0))


@njit
def _missed_frames(n: Ints, r: Floats, passed: float, frame: int) -> int:
    """Frames that the frame counter says are missing, with as many turns as time says; without a counter, time says."""
    by_time = _missed(r, passed)
    if n[FRAME_MODULUS] == 0:
        return by_time
    forward = int((n[FRAME_SIGN] * (frame - n[FRAME])) % n[FRAME_MODULUS])
    n[FRAME] = frame
    expected = passed / r[TYPICAL]
    turns = max(math.floor((expected - forward) / n[FRAME_MODULUS] + 0.5), 0)
    total = int(forward + turns * n[FRAME_MODULUS])
    return total - 1 if 1 <= total <= 2.0 * expected + 8.0 else by_time


@njit
def _by_frames(n: Ints, r: Floats, histogram: Ints, host: int, place: int, count: int) -> int:
    """Count periods, from the frame counter or from the place in the stream."""
    counted = n[MODULUS] > 1
    kind = advance(n, r, histogram, count, host) if counted else _by_place(n, r, histogram, host, place)
    if kind & UNUSED:
        return kind
    if kind & RESET:
        n[STAMP] += n[EXTRA]
        n[MISSING] = _missed(r, float(n[EXTRA]))
        r[FRACTION] = 0.0
    else:
        n[STAMP] += _lead(n, r, n[STEP] * r[TICK])
        n[MISSING] = n[STEP] - 1
    return kind


@njit
def _by_place(n: Ints, r: Floats, histogram: Ints, host: int, place: int) -> int:
    """Without a counter: the next frame, unless bytes between the two, or a lasting delay, tell of more."""
    if n[REOPENED]:
        return begin_again(n, r, host, 0)
    frames = _frames_in(n, place)
    early = line_at(r, r[NOW] + frames * r[TICK]) - float(host - n[ORIGIN])
    n[STEP] = frames if early <= 0.5 * r[TICK] else 1  # what is too early for frames was noise
    r[NOW] += n[STEP] * r[TICK]
    lasting = settle(n, r, histogram, host)
    if lasting > 0.0:
        return make_up(n, r, lasting)
    return SUSPECT if is_doubtful(n, r) else 0


@njit
def _frames_in(n: Ints, place: int) -> int:
    """Frames that the bytes since the last one have room for."""
    if n[FRAME_BYTES] == 0:
        return 1
    return int(max((2 * (place - n[PLACE]) + n[FRAME_BYTES]) // (2 * n[FRAME_BYTES]), 1))


@njit
def _lead(n: Ints, r: Floats, nominal: float) -> int:
    """Length of a step of so much nominal time, ns, led towards the line; what is below a nanosecond is kept."""
    step = nominal + nominal * r[DRIFT]
    behind = line_at(r, r[NOW]) - float(n[STAMP] - n[ORIGIN]) - r[FRACTION] - step
    slowly = min(max(_AGE * (r[NOW] - r[SINCE]), _SHORT), _LONG)
    haste = _HASTE * nominal
    step += r[FRACTION] + min(max(behind * min(nominal / slowly, 1.0), -haste), haste)
    whole = max(math.floor(step), 1)
    r[FRACTION] = step - whole
    return int(whole)


@njit
def _learn(n: Ints, r: Floats, host: int, place: int, count: int) -> int:
    """Take the host's times while the period is being measured; frames of one read cannot be told apart in time."""
    if n[REOPENED]:
        n[LEARNT], n[LEARN_SINCE] = 0, host
    step = _frames_in(n, place)
    if n[MODULUS] > 1:
        step = int((n[SIGN] * (count - n[COUNT])) % n[MODULUS])
        if step == 0:
            return DUPLICATE
    known = host > n[STAMP]
    n[LEARNT] += step if host > n[LEARN_SINCE] else 0  # what the first read brings may have waited
    n[COUNT], n[HOST] = count, host
    n[STAMP] = host if known else n[STAMP] + 1
    if host - n[LEARN_SINCE] >= _LEARN_TIME and n[LEARNT] >= _LEARN_FRAMES:
        r[TICK] = r[TYPICAL] = (host - n[LEARN_SINCE]) / n[LEARNT]
        r[ROUGH] = 1.0
        begin_line(r, r[NOW], float(host - n[ORIGIN]))
    return 0 if known else UNSURE
