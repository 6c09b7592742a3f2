"""Streams with clocks of their own on one time line: the gyroscope's stamps lead, and no row is made up.

A log that keeps each sensor in a table of its own has no common rows. Rows of all stamps would hold a number of one
sensor and NaN of the others, and no filter could integrate them. Here the leading stream's stamps are the rows:

- a stream of at least half its rate is interpolated linearly between its two neighbours, where these are not farther
  apart than a gap; a stream of more than 1.5 times its rate is averaged over each step first, as picking single samples
  of it would fold its vibration;
- a slower stream keeps its own values, each at the row that is nearest in time; the rows between are NaN, which the
  filters take as 'no new value'.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ClockError, ShapeError
from plumbob.core.findings import Finding, info, warning
from plumbob.core.time import GAP_FACTOR, LONGEST, interpolated, is_gap
from plumbob.data import TRIADS, ImuData, ImuMeta
from plumbob.data.imu import known_rows
from plumbob.data.recording import Recording
from plumbob.files.stamps import time_line, without_leaps

_SLOW, _FAST = 0.5, 1.5


@dataclass(frozen=True, eq=False)
class Readings:
    """What one sensor said, by its own clock."""

    t_ns: ArrayLike  # stamps (N,), ns, of a clock that all streams of a recording share
    values: ArrayLike  # (N, 3) or (N,), SI: rad/s, m/s², µT, °C; NaN where there is none


class Joined(NamedTuple):
    """Samples on one time line, the stamps of its rows (N,), ns, by the streams' clock, and notes of what was done."""

    imu: ImuData
    rows_ns: NDArray[np.int64]
    notes: tuple[Finding, ...]


def joined(streams: Mapping[str, Readings], *, meta: ImuMeta, epoch_ns: int | None = None) -> Joined:
    """Samples of several sensors on the time line of the gyroscope, or of the fastest where there is none.

    `epoch_ns` is the UTC of the stamp 0, None where it is unknown. ShapeError if no triad is among the streams, or
    shapes differ; ClockError if the time of one begins again.
    """
    ordered, notes = dict[str, tuple[NDArray[np.int64], Floats]](), list[Finding]()
    for name, stream in streams.items():
        ordered[name] = _ordered(name, stream, notes)
    triads = [name for name in TRIADS if name in ordered and ordered[name][0].size]
    if not triads:
        raise ShapeError(f"a recording needs a stream of gyr, acc or mag, but it has {', '.join(streams) or 'none'}.")
    lead = "gyr" if "gyr" in triads else max(triads, key=lambda name: ordered[name][0].size)
    rows = ordered[lead][0]
    columns: dict[str, Any] = {}
    for name, (stamps, values) in ordered.items():
        if not stamps.size:
            notes.append(info("source.no_sample", name=name))
            continue
        columns[name], how = _resampled(rows, stamps, values)
        if how:
            notes.append(info("source.own_stamps", name=name, count=stamps.size, how=how, sensor=lead))
    t0_ns = 0 if epoch_ns is None else int(rows[0]) + epoch_ns
    imu = ImuData(t=(rows - rows[0]) / 1e9, meta=replace(meta, t0_ns=t0_ns), **columns)
    return Joined(imu, rows, tuple(notes))


def joined_recordings(parts: Sequence[Recording], name: str) -> Recording:
    """One recording of sensors that have a file, a topic or rows of their own, by UTC or the clock of their stamps.

    Only rows of the leading sensor between the first and the last sample of the others are kept. ShapeError if two hold
    the same triad; ClockError if they do not overlap in time.
    """
    samples = [part.imu for part in parts if part.imu is not None]
    absolute = all(imu.meta.t0_ns for imu in samples)
    streams: dict[str, Readings] = {}
    ranges: dict[str, Any] = {}
    for imu in samples:
        stamps = imu.t_ns + (imu.meta.t0_ns if absolute else 0)
        for triad in imu.triads:
            if triad in streams:
                raise ShapeError(f"{triad} occurs in two of the parts; leave one out, or read them one by one.")
            streams[triad] = Readings(stamps, getattr(imu, triad))
            ranges[f"{triad}_range"] = getattr(imu.meta, f"{triad}_range")
        if imu.temp_c is not None:
            streams.setdefault("temp_c", Readings(stamps, imu.temp_c))
    stamps_by_sensor = [np.asarray(stream.t_ns, dtype=np.int64) for stream in streams.values()]
    begin = max(int(stamps.min()) for stamps in stamps_by_sensor)
    end = min(int(stamps.max()) for stamps in stamps_by_sensor)
    if begin >= end:
        raise ClockError(
            f"the sensors do not overlap in time: one begins {(begin - end) / 1e9:.6g} s after another has ended. "
            "They are of different recordings, or on clocks that nothing relates."
        )
    together = joined(streams, meta=replace(samples[0].meta, **ranges), epoch_ns=0 if absolute else None)
    dense = [
        known_rows(getattr(together.imu, name)) for name in ("gyr", "acc") if getattr(together.imu, name) is not None
    ]
    first, last = np.flatnonzero(np.logical_and.reduce(dense) if dense else together.rows_ns >= begin)[[0, -1]]
    imu = together.imu[int(first) : int(last) + 1]
    t0_ns = int(together.rows_ns[first]) if absolute else 0
    imu = replace(imu, t=imu.t - imu.t[0], meta=replace(imu.meta, t0_ns=t0_ns))
    notes = dict.fromkeys((*(note for part in parts for note in part.notes), *together.notes))
    return Recording(imu=imu, name=name, notes=tuple(notes))


def _ordered(name: str, stream: Readings, notes: list[Finding]) -> tuple[NDArray[np.int64], Floats]:
    """Stamps that increase, with their values, and a note where they had to be made so."""
    stamps = np.asarray(stream.t_ns, dtype=np.int64)
    values = np.asarray(stream.values, dtype=np.float64)
    if stamps.ndim != 1 or values.shape[:1] != stamps.shape:
        raise ShapeError(f"{name} has values {values.shape} for stamps {stamps.shape}; each stamp needs one row.")
    if not stamps.size:
        return stamps, values
    stamps, leaps = without_leaps(stamps)
    if leaps:
        notes.append(warning("reading.clock_leaps", count=leaps).on(name))
    if (span := (int(stamps.max()) - int(stamps.min())) / 1e9) >= LONGEST:
        raise ClockError(
            f"{name}: its stamps span {span:.4g} s, but a recording has {LONGEST:.0f} s at most; some "
            "stamps are wrong, or they are not in the unit that the format says."
        )
    line = time_line(stamps)
    notes += (finding.on(name) for finding in line.notes)
    return line.t_ns, values


def _resampled(rows: NDArray[np.int64], stamps: NDArray[np.int64], values: Floats) -> tuple[Floats, str]:
    """Values at the rows, and how they came there; nothing where the stamps are the same."""
    if np.array_equal(rows, stamps):
        return values, ""
    step, spacing = _step(rows), _step(stamps)
    if spacing * _SLOW > step:
        return _nearest(rows, stamps, values, step), "each at the nearest row"
    averaged = step > spacing * _FAST
    return (
        interpolated(rows, stamps, _averaged(stamps, values, step, spacing) if averaged else values),
        f"{'averaged over a step and ' if averaged else ''}interpolated linearly",
    )


def _step(stamps: NDArray[np.int64]) -> float:
    """Median step, ns."""
    return float(np.median(np.diff(stamps))) if stamps.size > 1 else np.inf


def _nearest(rows: NDArray[np.int64], stamps: NDArray[np.int64], values: Floats, step: float) -> Floats:
    """Each value at the row nearest in time, not farther than a gap's worth of rows; the last one of a row counts."""
    sampled = np.full((rows.size, *values.shape[1:]), np.nan)
    after = np.clip(np.searchsorted(rows, stamps), 0, rows.size - 1)
    before = np.maximum(after - 1, 0)
    place = np.where(np.abs(rows[before] - stamps) <= np.abs(rows[after] - stamps), before, after)
    near = np.abs(rows[place] - stamps) <= GAP_FACTOR * step
    sampled[place[near]] = values[near]
    return sampled


def _averaged(stamps: NDArray[np.int64], values: Floats, step: float, spacing: float) -> Floats:
    """Mean over a window of one step of the rows about each stamp; windows do not cross gaps."""
    width = max(3, 2 * round(step / spacing / 2) + 1)
    means = np.copy(values)
    for part in _parts(stamps):
        piece = values[part]
        if len(piece) >= width:
            windows = np.lib.stride_tricks.sliding_window_view(piece, width, axis=0)
            means[part.start + width // 2 : part.stop - width // 2] = windows.mean(axis=-1)
    return means


def _parts(stamps: NDArray[np.int64]) -> Iterator[slice]:
    """Stretches without a gap."""
    breaks = np.flatnonzero(is_gap(np.diff(stamps))) + 1
    ends = [0, *breaks.tolist(), stamps.size]
    yield from (slice(a, b) for a, b in pairwise(ends))


def seconds_to_ns(name: str, seconds: ArrayLike) -> NDArray[np.int64]:
    """Integer ns of seconds (N,), which float64 keeps to .24 µs since 1970; ClockError if one is no time."""
    values = check.column(name, seconds)
    if not np.isfinite(values).all() or np.abs(values).max(initial=0.0) > 9.2e9:
        raise ClockError(f"{name} holds numbers that are not times in seconds; check the column.")
    return np.round(values * 1e9).astype(np.int64)
