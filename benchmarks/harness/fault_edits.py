"""How cases damage a stream: each edit is given the stream and the rows of the fault, and works in place."""

from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from benchmarks.harness.fault_scene import GRAVITY_N, RATE, Stream, clip

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


def scale(triad: str, factor: float) -> Edit:
    """Multiply, up to the end of the range."""

    def edit(stream: Stream, rows: slice) -> None:
        values = getattr(stream, triad)
        values[rows] = clip(triad, factor * values[rows])

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
