"""From a file at rest to the figures of a data sheet: `plumbob allan`, in Python and on the command line."""

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plumbob import files
from plumbob.core import check
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.files import existing_file
from plumbob.core.units import Quantity, given
from plumbob.data import TRIADS, ImuData
from plumbob.data.cards import CalibrationCard
from plumbob.data.recording import Recording, unsaved
from plumbob.door.reading import read
from plumbob.files.numbers import SUFFIXES, TEXT_SUFFIXES, open_numbers
from plumbob.files.profile import profiles_beside
from plumbob.noise.allan import Noise, Taus, changes, characterise
from plumbob.noise.static import StaticReport
from plumbob.noise.static_record import StaticRecord, check_static, static_channels, static_of_numbers, static_of_plain

Note = Callable[[str], None]
Progress = Callable[[str, int, int], None]


def allan(
    *records: str | Path | Recording | ImuData | NDArray[Any],
    label: Sequence[str] = (),
    rate: float | str | None = None,
    scale: str | None = None,
    triads: Sequence[str] = TRIADS,
    start: float | str | None = None,
    stop: float | str | None = None,
    skip: Sequence[tuple[float, float]] = (),
    taus: Taus = None,
    calibration: Sequence[Path | str | CalibrationCard | None] | CalibrationCard | str | Path | None = None,
    profile: str | Path | None = None,
    kind: str | None = None,
    columns: int | None = None,
    note: Note | None = None,
    progress: Progress | None = None,
) -> Noise:
    """Analyse the noise of a unit at rest, or of several records beside each other.

    Further records are compared with the first one: coefficients that differ by more than chance, the ratio of the
    curves at equal averaging times, and the filter between them where there is one.

    Parameters
    ----------
    *records : path, Recording, ImuData or array (N,) or (N, k)
        Recordings of a unit at rest, or files or arrays of plain numbers.
    label : sequence of str, optional
        What each of several records is called; by default as its file.
    rate : float or str, optional
        Samples per second, Hz, of plain numbers; a recording must agree with it.
    scale : str, optional
        What 1 is in plain numbers, such as ``"0.00875 deg/s"``; ``"1"`` for numbers without a unit.
    triads : sequence of str
        Which sensors of a recording.
    start, stop : float or str, optional
        Part of the record: s, or text with a unit.
    skip : sequence of (float, float)
        Times to leave out, s.
    taus : sequence of float, "all" or None
        Averaging times of the curve, s.
    calibration : CalibrationCard or path, or sequence of them, optional
        Card of a recording's unit, applied first: one for all records, or one for each, "none" for none.
    profile : path, optional
        What the columns of a text file mean.
    kind, columns : optional
        As in `plumbob.files.open_numbers`.
    note : callable, optional
        Called with each note as soon as it is known.
    progress : callable, optional
        Called with what is being done, the bytes done, and of all.

    Returns
    -------
    Noise

    Raises
    ------
    ShapeError
        If no sensor of the record is static.
    ParameterError, UnitError
        If rate or scale is missing, wrong or contradicted by the record.
    ClockError
        If its samples are uneven.
    DecodeError
        If a file cannot be read.
    """
    cards = (
        [calibration] if calibration is None or isinstance(calibration, str | Path | CalibrationCard) else calibration
    )
    if not records:
        raise ParameterError("there is no record to analyse. Give one, or several to compare.")
    for name, few in (("label", len(label) or len(records)), ("calibration", len(cards))):
        if few != len(records) and (few > 1 or name == "label"):
            raise ParameterError(f"{name} is for {few} records, but there are {len(records)}. Give one for each.")
    noises: list[Noise] = []
    for i, record in enumerate(records):
        card = cards[i % len(cards)]
        opened = open_static(
            record, rate=rate, scale=scale, triads=triads, start=start, stop=stop, skip=skip,
            calibration=None if card == "none" else card, profile=profile, kind=kind, columns=columns, note=note,
            progress=progress,
        )  # fmt: skip
        stem = opened[0].path.stem
        name = label[i] if label else f"{stem} {i + 1}" if stem in [each.label for each in noises] else stem
        advance = None if progress is None else partial(progress, "noise" if len(records) == 1 else f"noise of {name}")
        analyses = characterise(*opened[:2], taus=taus, progress=advance)
        change = changes((noises[0].record, noises[0].static), opened[:2], taus=taus) if noises else {}
        noises.append(Noise(*opened[:2], tuple(analyses), opened[2], name, changes=change))
    return replace(noises[0], beside=tuple(noises[1:]))


def open_static(
    record: str | Path | Recording | ImuData | NDArray[Any],
    *,
    skip: Sequence[tuple[float, float]] = (),
    calibration: CalibrationCard | str | Path | None = None,
    note: Note | None = None,
    progress: Progress | None = None,
    **how: Any,
) -> tuple[StaticRecord, StaticReport, str | None]:
    """Channels of a record, what was found in them, and the name of the card that was applied.

    Arguments and errors as of `allan`; `how` it is opened is the others of them.
    """
    card = None if calibration is None else CalibrationCard.of(calibration)
    applied = Path(calibration).name if isinstance(calibration, str | Path) else card.device if card else None
    quantities = {"rate": Quantity.FREQUENCY, "start": Quantity.TIME, "stop": Quantity.TIME}
    hertz, first, last = (given(name, how.pop(name, None), quantity) for name, quantity in quantities.items())
    if isinstance(record, np.ndarray):
        opened = static_of_numbers(record, hertz, how.get("scale"))
    elif isinstance(record, Recording | ImuData):
        recording = record if isinstance(record, Recording) else unsaved(record, "samples")
        opened = static_channels(recording, Path(recording.name), card, how.get("triads", TRIADS), (first, last), hertz)
    else:
        path = check.path("record", record)
        opened = load_static(path, rate=hertz, card=card, start=first, stop=last, **how)
    report = check_static(
        opened, None if progress is None else lambda done: progress("checking", done, opened.size), skip=skip
    )
    say = note or (lambda line: None)
    name = opened.path.name
    for line in (*opened.notes, *(f"{sensor} left out: {why}" for sensor, why in opened.refused.items())):
        say(f"{name}: {line}")
    if all(report.refused(*group.names) for group in opened.groups):
        for finding in report.errors[1:]:
            say(str(finding))
        raise ShapeError(f"{opened.path} is not a static record: {report.errors[0]}")
    for finding in report.errors:
        say(f"{name}: left out: {finding}")
    return opened, report, applied


def load_static(
    path: str | os.PathLike[str],
    *,
    rate: float | None = None,
    scale: str | None = None,
    profile: str | Path | None = None,
    card: CalibrationCard | None = None,
    triads: Sequence[str] = TRIADS,
    start: float | None = None,
    stop: float | None = None,
    kind: str | None = None,
    columns: int | None = None,
) -> StaticRecord:
    """Open a file; a recording is read, plain numbers are read in blocks when they are asked for.

    A text is a recording where a profile is given or lies beside it, or its form is known, as a phone app's; otherwise
    it is plain numbers.

    Arguments and errors as of `allan`, but that quantities are numbers in SI and the card is read.
    """
    folder = check.path("path", path).is_dir() and files.is_recording(Path(path))
    file = Path(path) if folder else existing_file(path)
    if start is not None and stop is not None and not start < stop:
        raise ParameterError(f"start must be before stop, but they are {start:g} s and {stop:g} s.")
    profile = None if profile is None else Path(profile)
    if is_recording(file, profile, kind):
        if scale is not None or columns is not None:
            raise ParameterError(f"{file} is a recording with units of its own; leave scale and columns out.")
        recording = read(file, profile=profile).of_unit(None)
        return static_channels(recording, file, card, triads, (start, stop), rate, size=file.stat().st_size)
    if card is not None:
        raise ParameterError(f"{file} holds plain numbers, but a calibration card corrects a recording with units.")
    return static_of_plain(open_numbers(file, kind=kind, columns=columns), rate, scale, (start, stop))


def is_recording(file: Path, profile: Path | None, kind: str | None) -> bool:
    """Whether a file brings its own time and units; otherwise its numbers need a rate and a scale."""
    if kind is not None:
        return False
    suffix = file.suffix.lower()
    if suffix in TEXT_SUFFIXES:
        described = profile is not None or bool(profiles_beside(file))
        return described or files.is_known_log(file)
    return suffix not in SUFFIXES and files.is_recording(file)
