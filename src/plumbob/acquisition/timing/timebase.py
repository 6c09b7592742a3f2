"""The time base of one source: takes what came with each frame, gives each frame its time."""

from collections import deque
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.acquisition.timing.counter import ANOTHER_HOST
from plumbob.acquisition.timing.delay import line_at
from plumbob.acquisition.timing.report import Stamps, TimeReport, delays
from plumbob.acquisition.timing.spec import (
    DRIFT,
    FRAME_BYTES,
    FRAME_MODULUS,
    FRAME_SIGN,
    FRAMES,
    GAPS,
    INFERRED,
    INFERRED_NS,
    LATEST,
    LOST,
    MODULUS,
    NOW,
    ORIGIN,
    REALS,
    REOPENED,
    SHIFT,
    SIGN,
    SPEED,
    STAMP,
    STARTED,
    TALLY,
    TICK,
    TICK_DENOMINATOR,
    TICK_REST,
    TICK_WHOLE,
    TYPICAL,
    WHOLES,
    WORST,
    Counter,
    TimeSpec,
)
from plumbob.acquisition.timing.stamping import stamp_frames
from plumbob.core import flags
from plumbob.core.errors import ShapeError
from plumbob.core.time import BINS

REMEMBERED: Final = 1000
"""Gaps that a report lists."""


class TimeBase:
    """Gives frames their times, in order, once each.

    Parameters
    ----------
    spec : TimeSpec
        What the frames bring to tell the time by.

    Notes
    -----
    The result does not depend on how frames are handed over: one call with all of them gives the same bits as many
    calls. Memory is bounded.
    """

    def __init__(self, spec: TimeSpec) -> None:
        self.spec = spec
        self._whole = np.zeros(WHOLES, dtype=np.int64)
        self._real = np.zeros(REALS)
        self._histogram = np.zeros(2 * BINS, dtype=np.int64)
        self._gaps: deque[tuple[int, int, int]] = deque(maxlen=REMEMBERED)
        configure(self._whole, self._real, spec)

    def stamp(
        self,
        t_ns: NDArray[np.int64],
        place: NDArray[np.int64],
        *,
        clock: ArrayLike | None = None,
        frames: ArrayLike | None = None,
    ) -> Stamps:
        """Stamp the next frames.

        Parameters
        ----------
        t_ns : int64 (N,)
            Host time of the read that brought each frame's first byte, ns.
        place : int64 (N,)
            Offset of each frame's first byte in the stream.
        clock, frames : integers (N,), optional
            What the device clock and the frame counter say; required where `spec` names them. Only the bits that it
            names count.

        Raises
        ------
        ShapeError
            If the arrays do not fit each other, hold no integers, or a counter is missing.
        """
        host = _integers("t_ns", t_ns, None)
        size = host.shape[0]
        counter = self._counts("clock", clock, self.spec.clock, size)
        second = self._counts("frames", frames, self.spec.frames, size)
        before = int(self._whole[STAMP])
        out = Stamps(
            np.empty(size, np.int64), np.empty(size, np.int64), np.empty(size, np.uint32),
            np.empty(size, np.int64), np.empty(size, np.uint8),
        )  # fmt: skip
        stamp_frames(
            self._whole, self._real, self._histogram,
            host, _integers("place", place, size), second if self.spec.clock is None else counter, second,
            out.t_ns, out.step, out.flags, out.lost, out.kind,
        )  # fmt: skip
        self._remember(before, out)
        return out

    def reopened(self, t_ns: int) -> None:
        """Say that the source was opened again at that host time, ns: before the next frame there is a gap."""
        n = self._whole
        if n[STARTED]:
            back = max(int(n[LATEST] - n[SHIFT]) - t_ns, 0)  # another clock, after a restart of the host
            n[SHIFT] += back
            n[REOPENED] = ANOTHER_HOST if back else 1

    def report(self) -> TimeReport:
        """What the frames so far have shown."""
        n, r = self._whole, self._real
        tally = [int(count) for count in n[TALLY : TALLY + 8]]
        known = self.spec.clock is not None or self.spec.rate is not None
        duplicates, late, ahead, resets, wrapped, suspects, broken, unsure = tally
        return TimeReport(
            mode=self.spec.mode,
            frames=int(n[FRAMES]),
            rate=self._rate(tally[0] + tally[1] + tally[2]),
            drift_ppm=1e6 * float(r[DRIFT]) if known else float("nan"),
            delays=delays(self._histogram, float(r[WORST])),
            offset=(int(n[STAMP] - n[ORIGIN]) - line_at(r, float(r[NOW]))) / 1e9,
            lost=int(n[LOST]),
            duplicates=duplicates,
            late=late,
            ahead=ahead,
            resets=resets,
            wraps_by_host=wrapped,
            suspects=suspects,
            reopened=broken,
            unsure=unsure,
            inferred=int(n[INFERRED]),
            inferred_time=int(n[INFERRED_NS]) / 1e9,
            gap_count=int(n[GAPS]),
            gaps=tuple(self._gaps),
        )

    def _rate(self, unused: int) -> float:
        """Frames in a second of the host: on average by a device clock, else as the line says."""
        n, r = self._whole, self._real
        period = float(r[TYPICAL])
        if self.spec.clock is not None:
            steps = int(n[FRAMES] + n[LOST]) - unused - 1
            period = int(n[STAMP] - n[ORIGIN]) / steps if steps > 0 else 0.0
        return 1e9 / (period * (1.0 + float(r[DRIFT]))) if period else float("nan")

    def _counts(self, name: str, counts: ArrayLike | None, counter: Counter | None, size: int) -> NDArray[np.int64]:
        if counter is None:
            return np.zeros(size, dtype=np.int64)
        if counts is None:
            raise ShapeError(f"{name} is missing; the time comes from a counter of {counter.bits} bits.")
        return _integers(name, counts, size)

    def _remember(self, before: int, stamps: Stamps) -> None:
        for k in np.flatnonzero(stamps.flags & flags.GAP)[-REMEMBERED:].tolist():
            start = int(stamps.t_ns[k - 1]) if k else before
            self._gaps.append((start, int(stamps.t_ns[k]), int(stamps.lost[k])))


def configure(whole: NDArray[np.int64], real: NDArray[np.float64], spec: TimeSpec) -> None:
    """Write into a state what does not change."""
    counter = spec.clock or spec.frames
    whole[MODULUS] = 1 if counter is None else counter.modulus
    whole[SIGN] = -1 if counter is not None and counter.down else 1
    whole[FRAME_BYTES] = spec.frame_bytes or 0
    period = 1e9 / spec.rate if spec.rate else 0.0
    real[TICK] = real[TYPICAL] = period
    real[SPEED] = spec.speed
    if spec.clock is not None and spec.clock.tick is not None:
        tick = spec.clock.tick
        whole[TICK_WHOLE], rest = divmod(tick.numerator, tick.denominator)
        whole[TICK_REST], whole[TICK_DENOMINATOR] = rest, tick.denominator
        real[TICK] = float(tick)
        if spec.frames is not None:
            whole[FRAME_MODULUS] = spec.frames.modulus
            whole[FRAME_SIGN] = -1 if spec.frames.down else 1


def _integers(name: str, value: ArrayLike, size: int | None) -> NDArray[np.int64]:
    """Return `value` as int64; of 64 unsigned bits the lowest 62."""
    array: NDArray[Any] = np.asarray(value)
    if array.ndim != 1 or array.dtype.kind not in "iu" or (size is not None and array.shape[0] != size):
        many = "one per frame" if size is None else f"{size}, one per frame"
        raise ShapeError(f"{name} must be a row of integers, {many}, but it is {array.dtype} {array.shape}.")
    if array.dtype == np.uint64:
        array = array & np.uint64(2**62 - 1)
    return np.ascontiguousarray(array, dtype=np.int64)
