"""How cases damage a stream: each edit is given the stream and the rows of the fault, and works in place."""

from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from benchmarks.harness.fault_scene import FIELD_N, GRAVITY_N, RATE, Stream, clip
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.rotations import quat_from_rotvec, quat_rotate

Edit = Callable[[Stream, slice], None]


def nothing(stream: Stream, rows: slice) -> None:
    """Leave the stream as it is: the motion is the fault."""


def put(value: float, *triads: str) -> Edit:
    """Say one number on all axes."""

    def edit(stream: Stream, rows: slice) -> None:
        for name in triads:
            getattr(stream, name)[rows] = value

    return edit


def put_axis(triad: str, value: float) -> Edit:
    """Say one number on x."""

    def edit(stream: Stream, rows: slice) -> None:
        getattr(stream, triad)[rows, 0] = value

    return edit


def scale(triad: str, factor: ArrayLike) -> Edit:
    """Multiply by one number or one for each axis, up to the end of the range."""

    def edit(stream: Stream, rows: slice) -> None:
        values = getattr(stream, triad)
        values[rows] = clip(triad, np.asarray(factor) * values[rows])

    return edit


def add(triad: str, vector_b: ArrayLike) -> Edit:
    """Add a vector in body axes, up to the end of the range."""

    def edit(stream: Stream, rows: slice) -> None:
        values = getattr(stream, triad)
        values[rows] = clip(triad, values[rows] + np.asarray(vector_b))

    return edit


def add_n(triad: str, vector_n: ArrayLike) -> Edit:
    """Add a vector of the navigation frame."""

    def edit(stream: Stream, rows: slice) -> None:
        getattr(stream, triad)[rows] += stream.seen(rows, np.asarray(vector_n, dtype=np.float64))

    return edit


def free_fall(stream: Stream, rows: slice) -> None:
    """Take gravity's reaction away, and leave the noise."""
    stream.acc[rows] -= stream.seen(rows, GRAVITY_N)


def turn_field(rate: float) -> Edit:
    """Turn the field about the vertical, from the fault on, rad/s."""

    def edit(stream: Stream, rows: slice) -> None:
        angle = rate * (stream.t[rows] - stream.t[rows.start])
        turned = quat_rotate(quat_from_rotvec(np.outer(angle, GRAVITY_N / G0)), FIELD_N)
        stream.mag[rows] += stream.seen(rows, turned - FIELD_N)

    return edit


def grow(triad: str, vector_b: ArrayLike, seconds: float) -> Edit:
    """Add a vector in body axes that grows from nothing within some seconds, and stays."""

    def edit(stream: Stream, rows: slice) -> None:
        values = getattr(stream, triad)
        values[rows] = clip(triad, values[rows] + np.outer(_since(stream, rows, seconds), np.asarray(vector_b)))

    return edit


def fade(triad: str, axes: ArrayLike, seconds: float) -> Edit:
    """Let axes, one for each of the three that is to, go to zero within some seconds, and stay there."""

    def edit(stream: Stream, rows: slice) -> None:
        getattr(stream, triad)[rows] *= 1.0 - np.outer(_since(stream, rows, seconds), np.asarray(axes))

    return edit


def _since(stream: Stream, rows: slice, seconds: float) -> Floats:
    """Time since the fault began in units of some seconds, up to 1."""
    return np.asarray(np.minimum((stream.t[rows] - stream.t[rows.start]) / seconds, 1.0))


def stick(triad: str, dither: float = 0.0) -> Edit:
    """Repeat the last value of z before the fault, and let one bit of this size flicker."""

    def edit(stream: Stream, rows: slice) -> None:
        values = getattr(stream, triad)
        bits = np.random.default_rng(0).integers(0, 2, values[rows].shape[0])
        values[rows, 2] = values[rows.start - 1, 2] + dither * bits

    return edit


def swap(triad: str) -> Edit:
    """Exchange x and y."""

    def edit(stream: Stream, rows: slice) -> None:
        values = getattr(stream, triad)
        values[rows] = values[rows][:, [1, 0, 2]]

    return edit


def late(triad: str, count: int) -> Edit:
    """Say what was some samples ago."""

    def edit(stream: Stream, rows: slice) -> None:
        values = getattr(stream, triad)
        values[rows] = values[rows.start - count : rows.stop - count].copy()

    return edit


def saturate(triad: str, end: float) -> Edit:
    """Cut off at an end that no flag knows of."""

    def edit(stream: Stream, rows: slice) -> None:
        values = getattr(stream, triad)
        values[rows] = np.clip(values[rows], -end, end)

    return edit


def wrap_around(triad: str, end: float) -> Edit:
    """Go on at the other end of the range, as an integer does that has no more bits."""

    def edit(stream: Stream, rows: slice) -> None:
        values = getattr(stream, triad)
        values[rows] = np.mod(values[rows] + end, 2.0 * end) - end

    return edit


def shocks(size: float) -> Edit:
    """Push along x for two samples in each second, up to the end of the range."""

    def edit(stream: Stream, rows: slice) -> None:
        for first in range(rows.start, rows.stop, round(RATE)):
            add("acc", [size, 0.0, 0.0])(stream, slice(first, first + 2))

    return edit


def stuck(*triads: str) -> Edit:
    """Repeat the last value before the fault."""

    def edit(stream: Stream, rows: slice) -> None:
        for name in triads:
            values = getattr(stream, name)
            values[rows] = values[rows.start - 1]

    return edit


def mag_against_acc(strength: float) -> Edit:
    """Turn the field exactly opposite to the measured specific force."""

    def edit(stream: Stream, rows: slice) -> None:
        acc = stream.acc[rows]
        stream.mag[rows] = -strength * acc / np.linalg.norm(acc, axis=1, keepdims=True)

    return edit


def skip_mag(stream: Stream, rows: slice) -> None:
    """Send samples without a magnetometer."""
    stream.has_mag[rows] = False


def slow_mag(fill: Literal["skip", "nan", "zero", "hold"]) -> Edit:
    """Keep every tenth magnetic sample, and fill the others."""

    def edit(stream: Stream, rows: slice) -> None:
        index = np.arange(rows.start, rows.stop)
        kept = index - (index - rows.start) % 10
        missing = index != kept
        if fill == "skip":
            stream.has_mag[index[missing]] = False
        elif fill == "hold":
            stream.mag[index] = stream.mag[kept]
        else:
            stream.mag[index[missing]] = np.nan if fill == "nan" else 0.0

    return edit


def equal_stamps(stream: Stream, rows: slice) -> None:
    """Give all samples the stamp of the first."""
    stream.t[rows] = stream.t[rows.start]


def shift_stamps(seconds: float) -> Edit:
    """Set the clock, from the fault on."""

    def edit(stream: Stream, rows: slice) -> None:
        stream.t[rows.start :] += seconds

    return edit


def slow_clock(factor: float) -> Edit:
    """Let the clock run slower by a factor; behind the fault it is right again, but for what it has lost."""

    def edit(stream: Stream, rows: slice) -> None:
        begin = stream.t[rows.start]
        lost = (1.0 - factor) * (stream.t[rows] - begin)
        stream.t[rows] -= lost
        stream.t[rows.stop :] -= lost[-1]

    return edit


def lose_stamps(stream: Stream, rows: slice) -> None:
    """Make stamps NaN."""
    stream.t[rows] = np.nan


def jitter(stream: Stream, rows: slice) -> None:
    """Move each stamp by up to half a step, so that their order stays."""
    count = stream.t[rows].size
    stream.t[rows] += np.random.default_rng(0).uniform(-0.5, 0.5, count) / RATE


def lose(stream: Stream, rows: slice) -> None:
    """Drop the samples."""
    stream.take(np.delete(np.arange(stream.t.size), rows))


def thin(count: int) -> Edit:
    """Keep one sample of so many."""

    def edit(stream: Stream, rows: slice) -> None:
        index = np.arange(stream.t.size)
        inside = (index >= rows.start) & (index < rows.stop)
        stream.take(index[~inside | ((index - rows.start) % count == 0)])

    return edit


def behind_gap(count: int, then: Edit) -> Edit:
    """Drop the first samples of the fault, and damage the others."""

    def edit(stream: Stream, rows: slice) -> None:
        first = rows.start + count
        then(stream, slice(first, rows.stop))
        lose(stream, slice(rows.start, first))

    return edit


def again(count: int) -> Edit:
    """Send each second a block of so many samples twice, with the same stamps."""

    def edit(stream: Stream, rows: slice) -> None:
        index = np.arange(stream.t.size)
        starts = range(rows.start, rows.stop, round(RATE))
        blocks = [index[first : first + count] for first in starts]
        ends = np.repeat([first + count for first in starts], count)
        stream.take(np.insert(index, ends, np.concatenate(blocks)))

    return edit


def duplicate(stream: Stream, rows: slice) -> None:
    """Send every sample twice."""
    times = np.ones(stream.t.size, dtype=np.int64)
    times[rows] = 2
    stream.take(np.repeat(np.arange(stream.t.size), times))


def swap_pairs(stream: Stream, rows: slice) -> None:
    """Exchange the first with the second, the third with the fourth, and so on."""
    index = np.arange(stream.t.size)
    index[rows] = index[rows].reshape(-1, 2)[:, ::-1].ravel()
    stream.take(index)
