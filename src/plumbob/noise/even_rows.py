"""Evenly spaced samples of the sensors of a recording: the longest stretch without a gap, at each sensor's own rate."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import ClockError, ParameterError, ShapeError
from plumbob.core.text import counted
from plumbob.core.time import GAP_FACTOR
from plumbob.data import TRIAD_FLAGS, ImuData
from plumbob.data.cards import UNITS
from plumbob.data.plausibility import bursts
from plumbob.noise.static import FEWEST_SAMPLES

MISSING: Final = 1.5
"""A step longer than so many usual ones lacks a sample."""
UNEVEN: Final = 0.35
"""Largest scatter of the steps, as a part of one; stamps in whole milliseconds at 600 Hz scatter by 0.28."""
ON_LINE: Final = 0.6
"""Farthest that a stamp may lie from a straight line through all, as a part of a step, if none is missing: half a step
is as late as a row can be noted before the next one is due, and the line itself is off a little."""
INDEPENDENT: Final = 1.5
"""Least energy of the changes of these distances over their own: 2 if each is by chance, about 1 beside a lost row,
after which all are shifted."""
FEWEST: Final = 3


@dataclass(frozen=True, eq=False)
class Sensor:
    """Evenly spaced samples of one triad, or of those of its axes that can be used.

    Attributes
    ----------
    names : tuple of str
        Such as "gyr x".
    unit : str
        Of the values.
    dt : float
        Sampling time, s.
    start : float
        Time of the first sample, s.
    values : ndarray (N, k)
        Without a missing one.
    """

    names: tuple[str, ...]
    unit: str
    dt: float
    start: float
    values: Floats


@dataclass
class Sensors:
    """What a recording has.

    Attributes
    ----------
    dt : float
        Sampling time of its rows, s.
    sensors : list of Sensor
        Those that can be used.
    refused : dict
        Triads and channels that cannot, and why.
    notes : list of str
        What was done.
    """

    dt: float
    sensors: list[Sensor] = field(default_factory=list)
    refused: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def triads_of(
    imu: ImuData | None, file: Path, triads: Sequence[str], between: tuple[float | None, float | None]
) -> Sensors:
    """Take the sensors of a recording apart.

    Parameters
    ----------
    imu : ImuData or None
        The samples.
    file : Path
        Its name for errors.
    triads : sequence of str
        Which ones.
    between : (float or None, float or None)
        From when to when, s.

    Raises
    ------
    ParameterError
        If it has none of the triads, or no sample between the times.
    ClockError
        If the samples are not evenly spaced.
    ShapeError
        If no sensor can be used.
    """
    if imu is None or not set(triads) & set(imu.triads):
        has = "no samples" if imu is None else f"only {', '.join(imu.triads)}"
        raise ParameterError(f"{file} has {has}, but the analysis asks for {', '.join(triads)}.")
    part, dt, notes = _even(_cut(imu, file, between), file)
    found = Sensors(dt, notes=notes)
    for name in imu.triads:
        if name in triads:
            _take(part, name, found)
    if not found.sensors:
        raise ShapeError(f"{file}: no sensor can be used: {'; '.join(f'{k} {v}' for k, v in found.refused.items())}.")
    return found


def _cut(imu: ImuData, file: Path, between: tuple[float | None, float | None]) -> ImuData:
    start, stop = between
    first = 0 if start is None else int(np.searchsorted(imu.t, start))
    end = len(imu) if stop is None else int(np.searchsorted(imu.t, stop))
    if end - first < FEWEST:
        raise ParameterError(
            f"{file} lasts from {imu.t[0]:g} s to {imu.t[-1]:g} s, so from {start} to {stop} s it has "
            f"{max(0, end - first)} samples."
        )
    return imu[first:end]


def _even(imu: ImuData, file: Path) -> tuple[ImuData, float, list[str]]:
    """Longest stretch in which no sample is missing, its mean step, and what to say of it."""
    step = np.diff(imu.t)
    if _jittered(imu.t):
        dt = float(step.mean())
        return imu, dt, [f"sampling time {dt:.6g} s from the time stamps (none missing; jitter {step.std():.2g} s)"]
    if (told := bursts(imu.t)) is not None:
        raise ClockError(f"{file}: {told}.")
    usual = float(step[step <= GAP_FACTOR * np.median(step)].mean())
    breaks = np.flatnonzero(step > MISSING * usual)
    first, end = _longest(breaks, len(imu))
    part = imu[first:end]
    inside = step[first : end - 1]
    if inside.size == 0 or inside.std() > UNEVEN * inside.mean():
        raise ClockError(
            f"{file}: the steps between samples scatter by {step.std() / usual:.0%} of their mean, {usual:.4g} s, but "
            "an Allan deviation needs even ones; record with the device's own clock, or resample."
        )
    dt = float(inside.mean())
    notes = [
        f"sampling time {dt:.6g} s from the time stamps (median {np.median(inside):.6g} s, jitter {inside.std():.2g} s)"
    ]
    if breaks.size:
        notes.append(
            f"samples are missing at {counted(breaks.size, 'place')} (the first after {imu.t[breaks[0]]:.6g} s, the "
            f"longest for {step.max():.4g} s); only the longest stretch without, {part.t[0]:.6g} s to "
            f"{part.t[-1]:.6g} s, is used"
        )
    return part, dt, notes


def _jittered(t: Floats) -> bool:
    """Whether the stamps only scatter about even times, each by itself."""
    place = np.arange(t.size) - 0.5 * (t.size - 1)
    late = t - t.mean()
    dt = float(place @ late) / float(place @ place)
    off = late - dt * place
    changes = np.diff(off)
    return bool(np.abs(off).max() <= ON_LINE * dt and changes @ changes >= INDEPENDENT * (off @ off))


def _longest(breaks: NDArray[np.int64], count: int) -> tuple[int, int]:
    """Longest part of `count` rows, as (first, end), that is cut after the rows `breaks`."""
    edges = np.concatenate(([0], breaks + 1, [count]))
    i = int(np.argmax(np.diff(edges)))
    return int(edges[i]), int(edges[i + 1])


def _take(imu: ImuData, name: str, found: Sensors) -> None:
    _, _, invalid = TRIAD_FLAGS[name]
    impossible = (imu.flags & np.uint32(invalid)) != 0
    values = np.where(impossible[:, np.newaxis], np.nan, getattr(imu, name))
    given = ~np.isnan(values).all(axis=0)
    for axis in np.flatnonzero(~given).tolist():
        found.refused[f"{name} {'xyz'[axis]}"] = "has no value"
    places = np.flatnonzero(~np.isnan(values[:, given]).any(axis=1)) if given.any() else np.empty(0, dtype=int)
    rows = _own_rows(places, imu, name, found) if places.size else None
    if rows is None:
        return
    clipped = _clipped(imu, name, values, rows, found)
    axes = [axis for axis in np.flatnonzero(given).tolist() if axis not in clipped]
    if axes:
        names = tuple(f"{name} {'xyz'[axis]}" for axis in axes)
        dt = float(imu.t[rows[-1]] - imu.t[rows[0]]) / (rows.size - 1)
        found.sensors.append(Sensor(names, UNITS[name], dt, float(imu.t[rows[0]]), values[rows][:, axes]))


def _own_rows(places: NDArray[np.int64], imu: ImuData, name: str, found: Sensors) -> NDArray[np.int64] | None:
    """Rows of a triad's longest stretch at its own rate, which may be a part of the recording's."""
    step = np.diff(places)
    every = int(np.median(step)) if step.size else 0
    most = every if every == 1 else every + 1  # stamps of a slower clock fall now on this row, now on the next
    breaks = np.flatnonzero(step > most)
    first, end = _longest(breaks, places.size)
    if end - first < FEWEST or (step < every - 1).any() or (breaks.size and end - first < FEWEST_SAMPLES):
        told = f"{places.size} values in {len(imu)} rows"
        even = f", at most {end - first} of them evenly"
        found.refused[name] = f"comes unevenly, {told}{even}" if places.size >= FEWEST else f"has only {told}"
        return None
    rows = places[first:end]
    if every > 1:
        rate = (rows.size - 1) / (imu.t[rows[-1]] - imu.t[rows[0]])
        found.notes.append(f"{name} comes every {every} rows; it is analysed at its own rate, {rate:.6g} Hz")
    if breaks.size:
        found.notes.append(
            f"{name} lacks values at {counted(breaks.size, 'place')}; only its longest stretch without, "
            f"{imu.t[rows[0]]:.6g} s to {imu.t[rows[-1]]:.6g} s, is used"
        )
    return rows


def _clipped(imu: ImuData, name: str, values: Floats, rows: NDArray[np.int64], found: Sensors) -> set[int]:
    """Axes at the end of their range; all where the range is not known."""
    _, clipped, _ = TRIAD_FLAGS[name]
    marked = rows[(imu.flags[rows] & np.uint32(clipped)) != 0]
    if not marked.size:
        return set()
    size = np.abs(values[marked])
    full_scale = imu.meta.full_scale(name)
    at_end = np.ones_like(size, dtype=bool) if full_scale is None else size >= 0.999 * full_scale
    for axis in np.flatnonzero(at_end.any(axis=0)).tolist():
        count = int(np.count_nonzero(at_end[:, axis]))
        found.refused[f"{name} {'xyz'[axis]}"] = f"is at the end of its range in {count} of {rows.size} samples"
    return set(np.flatnonzero(at_end.any(axis=0)).tolist())
