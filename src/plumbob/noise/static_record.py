"""From a file to channels that a noise analysis can take: recordings with their own time, or plain numbers with a rate.

What a file does not say is never guessed: the rate and the scale of plain numbers must be given and not contradict
what the numbers themselves show.
"""

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from plumbob import files
from plumbob.core import check, units
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError, UnitError
from plumbob.core.files import existing_file, sidecars
from plumbob.core.units import Quantity
from plumbob.data import TRIADS
from plumbob.data.cards import CalibrationCard
from plumbob.files import Recording
from plumbob.files.numbers import SUFFIXES, TEXT_SUFFIXES, Numbers, open_numbers
from plumbob.filters.offline import recalibrated
from plumbob.noise.even_rows import triads_of
from plumbob.noise.static import StaticCheck, StaticReport, find_step, judge
from plumbob.session.reading import read

ANALYSED: Final = (Quantity.RATE, Quantity.ACCELERATION, Quantity.FIELD, Quantity.RATIO)
"""Quantities whose noise has a data sheet's units."""

_EXAMPLE: Final = (
    "such as '0.00875 deg/s' for counts of 0.00875 °/s, '1 deg/s' for °/s, or '1' for numbers without a unit"
)
_TRIAD_OF: Final = {Quantity.RATE: "gyr", Quantity.ACCELERATION: "acc", Quantity.FIELD: "mag"}
_SAME: Final = 0.01


@dataclass(frozen=True, eq=False)
class Channels:
    """Channels of one sensor at one rate.

    Attributes
    ----------
    names : tuple of str
        Such as "gyr x".
    quantity : Quantity
        What they measure.
    dt : float
        Sampling time, s.
    start : float
        Time of the first sample in the file's own time, s.
    triad : bool
        Whether they are the axes of one sensor.
    source : ndarray (N, k) or Numbers
        The samples, in inside units; or a file of numbers that are scaled as they are read.
    factor : float
        What 1 in the source is worth inside.
    rows : (int, int or None)
        First row of the source, and the one after the last.
    """

    names: tuple[str, ...]
    quantity: Quantity
    dt: float
    start: float
    triad: bool
    source: "Floats | Numbers" = field(repr=False)
    factor: float = 1.0
    rows: tuple[int, int | None] = (0, None)

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
        """All samples at once, (N, k)."""
        return np.concatenate([np.empty((0, len(self.names))), *self.blocks()])


@dataclass(frozen=True, eq=False)
class StaticRecord:
    """What a file holds for a noise analysis.

    Attributes
    ----------
    path : Path
        The file.
    size : int
        Its bytes, of which `Channels.blocks` reports the progress.
    groups : tuple of Channels
        One for each sensor that can be used.
    refused : mapping of str to str
        Sensors or channels that cannot, and why.
    notes : tuple of str
        What was done to the data, and what a reader must know.
    """

    path: Path
    size: int
    groups: tuple[Channels, ...]
    refused: Mapping[str, str]
    notes: tuple[str, ...]


def load_static(
    path: str | os.PathLike[str],
    *,
    rate: float | None = None,
    scale: str | None = None,
    profile: Path | None = None,
    card: CalibrationCard | None = None,
    triads: Sequence[str] = TRIADS,
    start: float | None = None,
    stop: float | None = None,
    kind: str | None = None,
    columns: int | None = None,
) -> StaticRecord:
    """Open a file; a recording is read, plain numbers are read in blocks when they are asked for.

    A text is a recording where a profile is given or lies beside it, and plain numbers otherwise.

    Parameters
    ----------
    path : path
        The file.
    rate : float, optional
        Samples per second: needed for plain numbers; a recording must agree with it.
    scale : str, optional
        What 1 is in a file of plain numbers, such as ``"0.00875 deg/s"``; ``"1"`` for numbers without a unit.
    profile : Path, optional
        What a text recording does not say about itself.
    card : CalibrationCard, optional
        Calibration of a recording's unit, applied first.
    triads : sequence of str
        Which sensors of a recording.
    start, stop : float, optional
        Part of the record, s.
    kind, columns : optional
        As in `plumbob.files.open_numbers`.

    Raises
    ------
    ParameterError
        If the rate or the scale is missing, contradicts the file, or is for the other kind of file.
    UnitError
        If the scale is not a unit whose noise is analysed, or the numbers are scaled already.
    ClockError, ShapeError
        If a recording's samples are uneven, or no sensor of it can be used.
    DecodeError
        If the file is not what it claims to be.
    """
    file = existing_file(path)
    if start is not None and stop is not None and not start < stop:
        raise ParameterError(f"start must be before stop, but they are {start:g} s and {stop:g} s.")
    if is_recording(file, profile, kind):
        if scale is not None or columns is not None:
            raise ParameterError(f"{file} is a recording with units of its own; leave scale and columns out.")
        return _of_recording(file, profile, card, triads, (start, stop), rate)
    if card is not None:
        raise ParameterError(f"{file} holds plain numbers, but a calibration card corrects a recording with units.")
    return _of_numbers(open_numbers(file, kind=kind, columns=columns), rate, scale, (start, stop))


def check_static(
    record: StaticRecord,
    progress: Callable[[int], None] | None = None,
    *,
    skip: Sequence[tuple[float, float]] = (),
) -> StaticReport:
    """Judge whether a record is static, in one pass over it; times in the report are those of the file.

    Parameters
    ----------
    record : StaticRecord
        Channels, as `load_static` opens them.
    progress : callable, optional
        Is given the bytes that are done.
    skip : sequence of (float, float)
        Times to leave out of an analysis whatever they hold, s.
    """
    checks = []
    for group in record.groups:
        one = StaticCheck(group.names, group.dt, quantity=group.quantity, triad=group.triad, start=group.start)
        for block in group.blocks(progress):
            one.add(block)
        checks.append(one)
    return judge(*checks, skip=skip)


def is_recording(file: Path, profile: Path | None, kind: str | None) -> bool:
    """Whether a file brings its own time and units; otherwise its numbers need a rate and a scale."""
    if kind is not None:
        return False
    suffix = file.suffix.lower()
    if suffix in TEXT_SUFFIXES:
        return profile is not None or any(beside.is_file() for beside in sidecars(file))
    return suffix not in SUFFIXES and suffix in (".mcap", *(s for form in files.FORMATS for s in form.suffixes))


def _of_recording(
    file: Path,
    profile: Path | None,
    card: CalibrationCard | None,
    triads: Sequence[str],
    between: tuple[float | None, float | None],
    rate: float | None,
) -> StaticRecord:
    return static_of(read(file, profile=profile), file, card, triads, between, rate, size=file.stat().st_size)


def static_of(
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
    found = triads_of(recording.imu, file, triads, between)
    if rate is not None and abs(rate * found.dt - 1.0) > _SAME:
        raise ParameterError(
            f"{file}: its time stamps say {1.0 / found.dt:.6g} Hz, but the rate given is {rate:g} Hz; leave the rate "
            "out, or correct the time in its profile."
        )
    groups = tuple(
        Channels(s.names, Quantity(s.unit), s.dt, s.start, len(s.names) == 3, s.values) for s in found.sensors
    )
    return StaticRecord(file, size, groups, found.refused, (*recording.notes, *found.notes))


def _of_numbers(
    numbers: Numbers, rate: float | None, scale: str | None, between: tuple[float | None, float | None]
) -> StaticRecord:
    file = numbers.path
    if rate is None or scale is None:
        asked = {"rate": (rate, "samples per second"), "scale": (scale, _EXAMPLE)}
        missing = " and their ".join(f"{name} ({what})" for name, (value, what) in asked.items() if value is None)
        raise ParameterError(
            f"{file} holds plain numbers: give their {missing}. For a table with time and units give --profile "
            "FILE.toml instead."
        )
    if not 0.0 < rate < math.inf:
        raise ParameterError(f"rate must be a positive number of samples per second, but it is {rate}.")
    size, unit = _scale(scale)
    notes = _scaled_twice(file, next(iter(numbers)), size, unit)
    start, stop = between
    first = 0 if start is None else max(0, round(start * rate))
    end = None if stop is None else round(stop * rate)
    count = numbers.columns
    known = units.unit(unit)
    names = _names(file, count, known.quantity)
    triad = count == 3 and known.quantity in _TRIAD_OF
    group = Channels(names, known.quantity, 1.0 / rate, first / rate, triad, numbers, size * known.factor, (first, end))
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
    if not 0.0 < rate < math.inf:
        raise ParameterError(f"rate must be a positive number of samples per second, but it is {rate}.")
    size, unit = _scale(scale)
    known = units.unit(unit)
    names = _names(name, samples.shape[1], known.quantity)
    triad = len(names) == 3 and known.quantity in _TRIAD_OF
    group = Channels(names, known.quantity, 1.0 / rate, 0.0, triad, samples * (size * known.factor))
    return StaticRecord(name, samples.nbytes, (group,), {}, ())


def _names(file: Path, count: int, quantity: Quantity) -> tuple[str, ...]:
    """Names of columns; three of one sensor's quantity are taken for its axes."""
    if count == 1:
        return (file.stem,)
    if count == 3 and quantity in _TRIAD_OF:
        return tuple(f"{_TRIAD_OF[quantity]} {axis}" for axis in "xyz")
    return tuple(f"column {i}" for i in range(1, count + 1))


def _scale(scale: str) -> tuple[float, str]:
    """Number and unit of a scale."""
    number, name = units.split(scale)
    unit = name or str(Quantity.RATIO)
    if units.unit(unit).quantity not in ANALYSED:
        known = ", ".join(quantity.name.lower() for quantity in ANALYSED)
        raise UnitError(f"the scale '{scale}' is of {units.unit(unit).quantity.name.lower()}, but must be of {known}.")
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
