"""From a static record to the figures of a data sheet: `plumbob allan`, in Python and on the command line."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plumbob.core import check
from plumbob.core.errors import ShapeError
from plumbob.core.units import Quantity, given
from plumbob.core.version import __version__
from plumbob.data import TRIADS, ImuData
from plumbob.data.cards import CalibrationCard, NoiseCard
from plumbob.files import Recording
from plumbob.files.notes import unsaved
from plumbob.noise.characterise import Taus, characterise
from plumbob.noise.findings import Analysis
from plumbob.noise.static import StaticReport
from plumbob.noise.static_record import StaticRecord, check_static, load_static, static_of, static_of_numbers
from plumbob.report import Report, Reported

Note = Callable[[str], None]
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, eq=False, repr=False)
class Noise(Reported):
    """Noise of a unit, found from a static record.

    Attributes
    ----------
    record : StaticRecord
        What was analysed.
    static : StaticReport
        Whether it was static, and what was left out of it.
    analyses : tuple of Analysis
        One for each channel.
    calibration : str or None
        Device of the calibration card that was applied first.
    """

    record: StaticRecord
    static: StaticReport
    analyses: tuple[Analysis, ...]
    calibration: str | None = None

    def facts(self) -> Mapping[str, str]:
        """Record, length and channels."""
        length = {a.name: a.curve.count * a.curve.dt for a in self.analyses}
        return {
            "record": self.record.path.name,
            "length": f"{max(length.values(), default=0.0):.0f} s",
            "channels": ", ".join(a.name for a in self.analyses),
        }

    def card(self, device: str | None = None, source: str | None = None) -> NoiseCard:
        """Noise card of the unit, for the simulator and the filters; errors as of `NoiseCard`."""
        from plumbob.noise.card import noise_card

        return noise_card(self.analyses, device=device or self.record.path.stem, source=source or self.source)

    @property
    def source(self) -> str:
        """Where the figures come from."""
        return f"Allan analysis of {self._named}, plumbob {__version__}"

    @property
    def _named(self) -> str:
        """Name of the record, and the card that was applied."""
        return self.record.path.name + ("" if self.calibration is None else f", calibrated with {self.calibration}")

    def report(self, *, device: str | None = None) -> Report:
        """Data sheet; further tables of its text are "methods" and "curve"."""
        from plumbob.noise.report import datasheet

        named = {"device": device or self.record.path.stem, "record": self._named, "made by": f"plumbob {__version__}"}
        return datasheet(self.analyses, facts=list(named.items()))

    def summary(self) -> dict[str, Any]:
        """All figures with their units, as JSON can hold them."""
        from plumbob.noise.report import numbers

        return {"file": str(self.record.path), "calibration": self.calibration, **numbers(self.analyses)}


def allan(
    record: str | Path | Recording | ImuData | NDArray[Any],
    *,
    rate: float | str | None = None,
    scale: str | None = None,
    triads: Sequence[str] = TRIADS,
    start: float | str | None = None,
    stop: float | str | None = None,
    skip: Sequence[tuple[float, float]] = (),
    taus: Taus = None,
    calibration: CalibrationCard | str | Path | None = None,
    profile: str | Path | None = None,
    kind: str | None = None,
    columns: int | None = None,
    note: Note | None = None,
    progress: Progress | None = None,
) -> Noise:
    """Analyse the noise of a unit at rest.

    Parameters
    ----------
    record : path, Recording, ImuData or array (N,) or (N, k)
        A recording of a unit at rest, or a file or array of plain numbers.
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
    calibration : CalibrationCard or path, optional
        Card of a recording's unit, applied first.
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
    opened, report, applied = open_static(
        record, rate=rate, scale=scale, triads=triads, start=start, stop=stop, skip=skip, calibration=calibration,
        profile=profile, kind=kind, columns=columns, note=note, progress=progress,
    )  # fmt: skip
    told = None if progress is None else lambda done: progress("noise", done, opened.size)
    return Noise(opened, report, tuple(characterise(opened, report, taus=taus, progress=told)), applied)


def open_static(
    record: str | Path | Recording | ImuData | NDArray[Any],
    *,
    rate: float | str | None = None,
    scale: str | None = None,
    triads: Sequence[str] = TRIADS,
    start: float | str | None = None,
    stop: float | str | None = None,
    skip: Sequence[tuple[float, float]] = (),
    calibration: CalibrationCard | str | Path | None = None,
    profile: str | Path | None = None,
    kind: str | None = None,
    columns: int | None = None,
    note: Note | None = None,
    progress: Progress | None = None,
) -> tuple[StaticRecord, StaticReport, str | None]:
    """Open a record and judge whether it is static; arguments and errors as of `allan`.

    Returns
    -------
    StaticRecord, StaticReport, str or None
        The channels, what was found in them, and the name of the card that was applied.
    """
    card = None if calibration is None else CalibrationCard.of(calibration)
    applied = Path(calibration).name if isinstance(calibration, str | Path) else card.device if card else None
    hertz, first, last = (
        given(name, value, quantity)
        for name, value, quantity in (
            ("rate", rate, Quantity.FREQUENCY), ("start", start, Quantity.TIME), ("stop", stop, Quantity.TIME)
        )
    )  # fmt: skip
    if isinstance(record, np.ndarray):
        opened = static_of_numbers(record, hertz, scale)
    elif isinstance(record, Recording | ImuData):
        whole = record if isinstance(record, Recording) else unsaved(record, "samples")
        opened = static_of(whole, Path(whole.name), card, triads, (first, last), hertz)
    else:
        opened = load_static(
            check.path("record", record), rate=hertz, scale=scale, profile=None if profile is None else Path(profile),
            card=card, triads=triads, start=first, stop=last, kind=kind, columns=columns,
        )  # fmt: skip
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
