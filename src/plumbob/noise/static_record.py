"""From a file to channels that a noise analysis can take: recordings with their own time, or plain numbers with a rate.

What a file does not say is never guessed: the rate and the scale of plain numbers must be given and not contradict
what the numbers themselves show. Of a recording the longest stretch without a gap is taken, at each sensor's own rate.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core import check, units
from plumbob.core.check import Floats
from plumbob.core.errors import ClockError, ParameterError, ShapeError, UnitError
from plumbob.core.findings import Note, info, warning
from plumbob.core.time import GAP_FACTOR
from plumbob.core.units import Quantity
from plumbob.data import TRIAD_FLAGS, TRIADS, ImuData
from plumbob.data.cards import UNITS, CalibrationCard
from plumbob.data.plausibility import bursts
from plumbob.data.recording import Recording, recalibrated
from plumbob.noise.artefacts import find_step
from plumbob.noise.static import FEWEST_SAMPLES, StaticCheck, StaticReport, judge

if TYPE_CHECKING:
    from plumbob.files.numbers import Numbers

# Noise in a data sheet's units.
ANALYSED: Final = (Quantity.RATE, Quantity.ACCELERATION, Quantity.FIELD, Quantity.RATIO)

_EXAMPLE: Final = (
    "such as '0.00875 deg/s' for counts of 0.00875 °/s, '1 deg/s' for °/s, or '1' for numbers without a unit"
)
_TRIAD_OF: Final = {Quantity.RATE: "gyr", Quantity.ACCELERATION: "acc", Quantity.FIELD: "mag"}
_SAME: Final = 0.01


@dataclass(frozen=True, eq=False)
class Channels:
    """Channels of one sensor at one rate."""

    names: tuple[str, ...]  # such as "gyr x"
    quantity: Quantity  # what they measure
    dt: float  # sampling time, s
    start: float  # time of the first sample in the file's own time, s
    triad: bool  # whether they are the axes of one sensor
    # (N, k), the samples, in inside units; or a file of numbers that are scaled as they are read
    source: "Floats | Numbers" = field(repr=False)
    factor: float = 1.0  # what 1 in the source is worth inside
    rows: tuple[int, int | None] = (0, None)  # first row of the source, and the one after the last

    def blocks(self, progress: Callable[[int], None] | None = None) -> Iterator[Floats]:
        """Samples (n, k) in inside units, block by block, from the start each time; as `Numbers.blocks`."""
        if isinstance(self.source, np.ndarray):
            yield self.source
            return
        first, end = self.rows
        place = 0
        for block in self.source.blocks(progress):
            wanted = block[max(0, first - place) : None if end is None else max(0, end - place)]
            place += len(block)
            if len(wanted):
                yield wanted if self.factor == 1.0 else wanted * self.factor
            if end is not None and place >= end:
                return

    def read(self) -> Floats:
        """All samples at once, (N, k); not copied where they are in memory."""
        if isinstance(self.source, np.ndarray):
            return self.source
        return np.concatenate([np.empty((0, len(self.names))), *self.blocks()])


@dataclass(frozen=True, eq=False)
class StaticRecord:
    """What a file holds for a noise analysis."""

    path: Path  # the file
    size: int  # its bytes, of which `Channels.blocks` reports the progress
    groups: tuple[Channels, ...]  # one for each sensor that can be used
    refused: Mapping[str, str]  # sensors or channels that cannot, and why
    notes: tuple[Note, ...]  # what was done to the data, and what a reader must know
    device: str = ""  # what the file calls the unit


def check_static(
    record: StaticRecord, progress: Callable[[int], None] | None = None, *, skip: Sequence[tuple[float, float]] = ()
) -> StaticReport:
    """Judge whether a record is static, in one pass over it; times in the report are those of the file."""
    checks = []
    for group in record.groups:
        sensor = StaticCheck(group.names, group.dt, quantity=group.quantity, triad=group.triad, start=group.start)
        for block in group.blocks(progress):
            sensor.add(block)
        checks.append(sensor)
    return judge(*checks, skip=skip)


def static_channels(
    recording: Recording,
    file: Path,
    card: CalibrationCard | None = None,
    triads: Sequence[str] = TRIADS,
    between: tuple[float | None, float | None] = (None, None),
    rate: float | None = None,
    size: int = 0,
) -> StaticRecord:
    """Channels of a recording that has been read; `file` is what messages call it, arguments as of `load_static`."""
    if card is not None:
        recording = recalibrated(recording, card)
    imu = recording.imu
    if imu is None or not set(triads) & set(imu.triads):
        has = "no samples" if imu is None else f"only {', '.join(imu.triads)}"
        raise ParameterError(f"{file} has {has}, but the analysis asks for {', '.join(triads)}.")
    start, stop = between
    first = 0 if start is None else int(np.searchsorted(imu.t, start))
    end = len(imu) if stop is None else int(np.searchsorted(imu.t, stop))
    if end - first < FEWEST:
        raise ParameterError(
            f"{file} lasts from {imu.t[0]:g} s to {imu.t[-1]:g} s, so from {start} to {stop} s it has "
            f"{max(0, end - first)} samples."
        )
    part, dt, notes = _even(imu[first:end], file)
    sensors = _Sensors(notes=notes)
    for name in imu.triads:
        if name in triads:
            _take(part, name, sensors)
    if not sensors.groups:
        raise ShapeError(f"{file}: no sensor can be used: {'; '.join(f'{k} {v}' for k, v in sensors.refused.items())}.")
    if rate is not None and abs(rate * dt - 1.0) > _SAME:
        raise ParameterError(
            f"{file}: its time stamps say {1.0 / dt:.6g} Hz, but the rate given is {rate:g} Hz; leave the rate out, or "
            "correct the time in its profile."
        )
    device = "" if imu.meta.device == "unknown" else imu.meta.device
    return StaticRecord(file, size, tuple(sensors.groups), sensors.refused, (*recording.notes, *sensors.notes), device)


def static_of_plain(
    numbers: "Numbers", rate: float | None, scale: str | None, between: tuple[float | None, float | None]
) -> StaticRecord:
    """Channels of numbers without time or unit; arguments and errors as of `plumbob.allan`."""
    file = numbers.path
    if rate is None or scale is None:
        needed = {"rate": (rate, "samples per second"), "scale": (scale, _EXAMPLE)}
        missing = " and their ".join(f"{name} ({what})" for name, (value, what) in needed.items() if value is None)
        raise ParameterError(
            f"{file} holds plain numbers: give their {missing}. For a table with time and units give --profile "
            "FILE.toml instead."
        )
    size, unit = _scale(scale)
    group = _plain_channels(file, numbers, numbers.columns, rate, size, unit, between)
    notes = _scaled_twice(file, next(numbers.blocks()), size, unit)
    return StaticRecord(file, numbers.size, (group,), {}, (*numbers.notes, *notes))


def static_of_numbers(values: ArrayLike, rate: float | None, scale: str | None) -> StaticRecord:
    """Channels of an array (N,) or (N, k); errors as of `load_static`."""
    samples = check.floats("record", values)
    samples = samples[:, np.newaxis] if samples.ndim == 1 else samples
    if samples.ndim != 2 or not len(samples):
        raise ShapeError(f"record must be samples (N,) or (N, k), but its shape is {samples.shape}.")
    name = Path("record")
    if rate is None or scale is None:
        raise ParameterError(f"an array needs its rate, Hz, and its scale, {_EXAMPLE}. Give both.")
    group = _plain_channels(name, samples, samples.shape[1], rate, *_scale(scale))
    return StaticRecord(name, samples.nbytes, (replace(group, source=samples * group.factor, factor=1.0),), {}, ())


def _plain_channels(
    file: Path, source: "Floats | Numbers", count: int, rate: float, size: float, unit: str,
    between: tuple[float | None, float | None] = (None, None),
) -> Channels:  # fmt: skip
    """Columns of numbers whose unit is `size` of a unit; three of one sensor's quantity are its axes."""
    if not 0.0 < rate < math.inf:
        raise ParameterError(f"rate must be a positive number of samples per second, but it is {rate}.")
    start, stop = between
    first = 0 if start is None else max(0, round(start * rate))
    end = None if stop is None else round(stop * rate)
    entry = units.unit(unit)
    triad = count == 3 and entry.quantity in _TRIAD_OF
    names = (file.stem,) if count == 1 else tuple(f"column {i}" for i in range(1, count + 1))
    if triad:
        names = tuple(f"{_TRIAD_OF[entry.quantity]} {axis}" for axis in "xyz")
    return Channels(names, entry.quantity, 1.0 / rate, first / rate, triad, source, size * entry.factor, (first, end))


def _scale(scale: str) -> tuple[float, str]:
    """Number and unit of a scale."""
    number, name = units.split(scale)
    unit = name or str(Quantity.RATIO)
    if units.unit(unit).quantity not in ANALYSED:
        names = ", ".join(quantity.name.lower() for quantity in ANALYSED)
        raise UnitError(f"the scale '{scale}' is of {units.unit(unit).quantity.name.lower()}, but must be of {names}.")
    if not 0.0 < float(number) < math.inf:
        raise UnitError(f"the scale '{scale}' must be more than 0.")
    return float(number), unit


def _scaled_twice(file: Path, values: Floats, size: float, unit: str) -> tuple[str, ...]:
    """Refuse numbers that the scale would scale once more; a note where they only look so."""
    steps = [find_step(column) for column in np.ascontiguousarray(values.T)]
    if size != 1.0 and any(abs(step / size - 1.0) < _SAME for step in steps):
        raise UnitError(
            f"{file}: its numbers are multiples of {size:g}, the number of the scale '{size:g} {unit}', so they are "
            f"scaled already. If they are in {unit}, the scale is '1 {unit}'; if they are not, give the file of counts."
        )
    finite = values[np.isfinite(values)]
    if size != 1.0 and (finite != np.round(finite)).any():
        return (f"the numbers are not whole counts, but the scale is {size:g} {unit}: they may be scaled already",)
    return ()


MISSING: Final = 1.5  # a step longer than so many usual ones lacks a sample
UNEVEN: Final = 0.35  # scatter of the steps, as a part of one; stamps in whole milliseconds at 600 Hz scatter by 0.28
# Distance of a stamp from a line through all, in steps, if none is missing: half a step is as late as a row can be
# noted before the next, and the line itself is off a little.
ON_LINE: Final = 0.6
# Energy of the changes of these distances over their own: 2 by chance, about 1 beside a lost row.
INDEPENDENT: Final = 1.5
FEWEST: Final = 3


@dataclass
class _Sensors:
    """What a recording has."""

    # triads, or those of their axes, that can be used: evenly spaced, without a missing sample
    groups: list[Channels] = field(default_factory=list)
    refused: dict[str, str] = field(default_factory=dict)  # triads and channels that cannot, and why
    notes: list[Note] = field(default_factory=list)  # what was done


def _even(imu: ImuData, file: Path) -> tuple[ImuData, float, list[Note]]:
    """Longest stretch in which no sample is missing, its mean step, and what to say of it."""
    step, place, late = np.diff(imu.t), np.arange(len(imu)) - 0.5 * (len(imu) - 1), imu.t - imu.t.mean()
    even = float(place @ late) / float(place @ place)
    off = late - even * place
    changes = np.diff(off)
    if np.abs(off).max() <= ON_LINE * even and changes @ changes >= INDEPENDENT * (off @ off):  # each stamp by itself
        dt = float(step.mean())
        return imu, dt, [info("static.sampling_time_jittered", dt=dt, jitter=step.std())]
    if (reason := bursts(imu.t)) is not None:
        raise ClockError(f"{file}: {reason}.")
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
    notes: list[Note] = [info("static.sampling_time", dt=dt, median=np.median(inside), jitter=inside.std())]
    if breaks.size:
        notes.append(
            warning(
                "static.missing",
                count=breaks.size,
                first=imu.t[breaks[0]],
                longest=step.max(),
                start=part.t[0],
                stop=part.t[-1],
            )
        )
    return part, dt, notes


def _longest(breaks: NDArray[np.int64], count: int) -> tuple[int, int]:
    """Longest part of `count` rows, as (first, end), that is cut after the rows `breaks`."""
    edges = np.concatenate(([0], breaks + 1, [count]))
    i = int(np.argmax(np.diff(edges)))
    return int(edges[i]), int(edges[i + 1])


def _take(imu: ImuData, name: str, sensors: _Sensors) -> None:
    _, clipped, invalid = TRIAD_FLAGS[name]
    impossible = (imu.flags & np.uint32(invalid)) != 0
    values: Floats = getattr(imu, name)
    if impossible.any():
        values = np.where(impossible[:, np.newaxis], np.nan, values)
    given = ~np.isnan(values).all(axis=0)
    for axis in np.flatnonzero(~given).tolist():
        sensors.refused[f"{name} {'xyz'[axis]}"] = "has no value"
    places = np.flatnonzero(~np.isnan(values[:, given]).any(axis=1)) if given.any() else np.empty(0, dtype=int)
    rows = _own_rows(places, imu, name, sensors) if places.size else None
    if rows is None:
        return
    # axes at the end of their range; all where the range is not known
    size = np.abs(values[rows[(imu.flags[rows] & np.uint32(clipped)) != 0]])
    full_scale = imu.meta.full_scale(name)
    at_end = np.ones_like(size, dtype=bool) if full_scale is None else size >= 0.999 * full_scale
    for axis in np.flatnonzero(at_end.any(axis=0)).tolist():
        count = int(np.count_nonzero(at_end[:, axis]))
        sensors.refused[f"{name} {'xyz'[axis]}"] = f"is at the end of its range in {count} of {rows.size} samples"
    axes = np.flatnonzero(given & ~at_end.any(axis=0)).tolist()
    if axes:
        names = tuple(f"{name} {'xyz'[axis]}" for axis in axes)
        start, end = float(imu.t[rows[0]]), float(imu.t[rows[-1]])
        is_whole = rows.size == len(imu) and len(axes) == values.shape[1]  # and then no copy
        dt, samples = (end - start) / (rows.size - 1), values if is_whole else values[rows][:, axes]
        sensors.groups.append(Channels(names, Quantity(UNITS[name]), dt, start, len(names) == 3, samples))


def _own_rows(places: NDArray[np.int64], imu: ImuData, name: str, sensors: _Sensors) -> NDArray[np.int64] | None:
    """Rows of a triad's longest stretch at its own rate, which may be a part of the recording's."""
    step = np.diff(places)
    every = int(np.median(step)) if step.size else 0
    most = every if every == 1 else every + 1  # stamps of a slower clock fall now on this row, now on the next
    breaks = np.flatnonzero(step > most)
    first, end = _longest(breaks, places.size)
    if end - first < FEWEST or (step < every - 1).any() or (breaks.size and end - first < FEWEST_SAMPLES):
        counts = f"{places.size} values in {len(imu)} rows"
        even = f", at most {end - first} of them evenly"
        sensors.refused[name] = f"comes unevenly, {counts}{even}" if places.size >= FEWEST else f"has only {counts}"
        return None
    rows = places[first:end]
    if every > 1:
        rate = (rows.size - 1) / (imu.t[rows[-1]] - imu.t[rows[0]])
        sensors.notes.append(info("static.own_rate", name=name, every=every, rate=rate))
    if breaks.size:
        sensors.notes.append(
            warning("static.lacks_values", name=name, count=breaks.size, start=imu.t[rows[0]], stop=imu.t[rows[-1]])
        )
    return rows
