"""One recording, what its time base gave, and the notes of what was found in it or inferred.

Most of it is found in the data at each reading and never stored; what only the reading of a live line shows is stored.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from shlex import quote
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core import check, flags
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.findings import Finding, as_findings, info, lasting, warning
from plumbob.core.text import FactsText
from plumbob.core.time import quantile
from plumbob.core.units import QUANTITY_BY_TRIAD
from plumbob.data import AttitudeTrack, ImuData, calibration_told
from plumbob.data.array import ImuArray, named_unit
from plumbob.data.imu import TRIAD_FLAGS
from plumbob.data.plausibility import ALL_AXES, NOT_KNOWN, STUCK_SAMPLES, doubts, statistics, stuck_runs

if TYPE_CHECKING:
    from plumbob.data.cards import CalibrationCard


@dataclass(frozen=True, slots=True)
class Stamps:
    """Times of frames, one entry each."""

    # Time on the host's monotonic clock, ns. Increases from frame to frame, except where TIME_FAULT is set.
    t_ns: NDArray[np.int64]
    # counts of the device clock, or frames, since the last frame that was used, with all turns of the counter; 0 where
    # there is no count
    step: NDArray[np.int64]
    # `flags.GAP` where frames are missing before this one, or time starts again; `flags.TIME_FAULT` where the frame
    # repeats or contradicts others: its time is that of the frame before, and must not be used
    flags: NDArray[np.uint32]
    # frames missing before this one: exact where there is a counter, else what time has room for
    lost: NDArray[np.int64]
    kind: NDArray[np.uint8]  # what became of the frame: bits named in `plumbob.live.timing.counter`, 0 for most


@dataclass(frozen=True, slots=True)
class Delays:
    """How much later than the earliest ones frames arrive, s; quantiles are good to 6 %."""

    p50: float
    p99: float
    worst: float


@dataclass(frozen=True, slots=True)
class TimeReport:
    """What the stamps of one source have shown."""

    mode: str  # where the time comes from: ``"clock"``, ``"frames"`` or ``"host"``
    frames: int  # that were stamped, with and without faults
    rate: float  # measured, Hz of the host's seconds; NaN while not known
    # host seconds per device second, less one: positive for a device that runs slow; NaN where neither a device clock
    # nor a nominal rate says how long its second is
    drift_ppm: float
    delays: Delays  # of the frames' arrivals
    offset: float  # by how much the latest stamp is later than the earliest possible arrival of its frame, s
    lost: int  # frames that are missing
    # duplicates, late, ahead: frames that repeat the last, come after their successor, or claim a time to come; unused
    duplicates: int
    late: int
    ahead: int
    resets: int  # how often time began again, because counts no longer fit the host's time
    wraps_by_host: int  # how often it alone decided how many turns of a counter, or how many frames, had passed
    suspects: int  # frames so late that a turn of the counter, or a frame, may be missing before them
    reopened: int  # how often the source was opened again, or the host's clock set back
    unsure: int  # frames stamped before the rate was known, that shared a read with others
    # inferred: gaps, or steps of time, that nothing but a lasting delay of the host spoke for: no count, no byte, no
    # event; and their length in all, s
    inferred: int
    inferred_time: float
    gap_count: int
    gaps: tuple[tuple[int, int, int], ...]  # the latest: time before and after, ns, and frames lost

    @classmethod
    def joined(cls, reports: Sequence["TimeReport"]) -> "TimeReport":
        """One report of a source that was started again and again: counts in all, the rest as the last has it."""
        counts: dict[str, Any] = {name: sum(getattr(report, name) for report in reports) for name in _COUNTS}
        gaps = tuple(gap for report in reports for gap in report.gaps)
        return replace(reports[-1], **counts, gaps=gaps)


_COUNTS: Final = (
    "frames", "lost", "duplicates", "late", "ahead", "resets", "wraps_by_host", "suspects", "reopened", "unsure",
    "inferred", "inferred_time", "gap_count",
)  # fmt: skip


def delays(histogram: NDArray[np.int64], worst: float) -> Delays:
    """Quantiles of a histogram of delays in ns, in seconds."""
    return Delays(
        min(quantile(histogram, 0, 0.5), worst) / 1e9, min(quantile(histogram, 0, 0.99), worst) / 1e9, worst / 1e9
    )


@dataclass(frozen=True, eq=False, repr=False)
class Recording(FactsText):
    """What one file holds.

    Parameters
    ----------
    imu : ImuData or None
        The samples.
    track : AttitudeTrack or None
        With samples: the reference that belongs to them. Alone: an estimate or a reference.
    name : str
        Short name, usually the stem of the file.
    notes : tuple of Finding
        Where the data come from, what was done to them, and what was seen in them; lines of text may be given.
    array : ImuArray or None
        The samples of several units, where it holds these; then `imu` is None.

    Raises
    ------
    ShapeError
        If there is neither, or the notes are neither findings nor lines of text.
    """

    imu: ImuData | None = None
    track: AttitudeTrack | None = None
    name: str = ""
    notes: tuple[Any, ...] = ()
    array: ImuArray | None = None

    def __post_init__(self) -> None:
        """Refuse a recording of nothing."""
        if self.imu is None and self.track is None and self.array is None:
            raise ShapeError("a recording needs imu, track or both, but neither was given.")
        if self.imu is not None and self.array is not None:
            raise ShapeError("a recording holds the samples of one unit or those of an array, but both were given.")
        for name, expected in (("imu", ImuData), ("track", AttitudeTrack), ("array", ImuArray)):
            if getattr(self, name) is not None:
                check.kind(name, getattr(self, name), expected)
        object.__setattr__(self, "notes", as_findings("notes", self.notes))

    def facts(self) -> Mapping[str, str]:
        """Name, samples, attitude, and how many notes there are."""
        parts = {"samples": self.imu or self.array, "attitude": self.track}
        held = {name: part.facts()["samples"] for name, part in parts.items() if part is not None}
        held |= {} if self.array is None else {"units": ", ".join(self.array.names)}
        return {"name": self.name or "not named", **held, "notes": str(len(self.notes))}

    def of_unit(self, unit: str | None) -> "Recording":
        """One unit alone, by its name or its number from 1; a recording of one unit is its own.

        The attitude beside several units is left out: it is that of one of them, or of their body.

        Raises
        ------
        ParameterError
            If there is no such unit, or none is named and there are several.
        """
        if self.array is None and unit is None:
            return self
        if self.array is None:
            raise ParameterError(f"{self.name or 'the recording'} holds one unit without a name; leave --unit out.")
        names = ", ".join(self.array.names)
        if unit is None:
            first = self.array.names[0]
            raise ParameterError(
                f"{self.name or 'the recording'} holds the units {names}. Name one with --unit, or write it to a file "
                f"of its own: plumbob convert FILE NEW.parquet --unit {quote(first)}."
            )
        name = named_unit(self.array.names, unit)
        imu = self.array.units[name]
        notes = (*lasting(self.notes), info("source.unit", unit=name, units=names), *findings(imu))
        return replace(self, imu=imu, track=None, array=None, notes=notes)


def unsaved(imu: ImuData, name: str) -> Recording:
    """Recording of samples that no file holds, with what is found in them, by their device's name or another."""
    return Recording(imu=imu, name=imu.meta.device or name, notes=findings(imu))


def recalibrated(recording: Recording, card: "CalibrationCard") -> Recording:
    """Recording with the card of this very unit applied to its samples, and what is then found in them in its notes.

    An attitude that comes with them stays as it is.
    """
    from plumbob.data.calibrated import apply_card, temperature_beyond

    if recording.imu is None:
        raise ShapeError(f"{recording.name} holds an attitude but no samples that a calibration card could correct.")
    imu = apply_card(card, recording.imu)
    return replace(
        recording, imu=imu, notes=(*lasting(recording.notes), *findings(imu), *temperature_beyond(card, imu))
    )


EARTH_FIELD: Final = (22.0, 67.0)  # [Alken2021]: smallest and largest flux density at the surface of the Earth, µT

STUCK_FOR: Final = 1.0
"""A sensor that repeats its value to the bit for so long is stuck, s: noise changes the last digit before."""


def findings(imu: ImuData) -> tuple[Finding, ...]:
    """Calibration, the magnetic field, clipped and invalid samples, gaps, stuck sensors, and `doubts`."""
    notes, bits = list[Finding](), imu.flags
    if imu.meta.calibration is None:
        notes.append(warning("samples.uncalibrated"))
    if "mag" in imu.triads:
        low, high = EARTH_FIELD
        typical = float(np.nan_to_num(statistics(imu, "mag").norm, nan=math.inf))
        if not low <= typical <= high:
            notes.append(warning("samples.field", median=typical, low=low, high=high))
    for place, code in ((1, "samples.clipped"), (2, "samples.invalid")):
        for name in imu.triads:
            if count := int(np.count_nonzero(bits & np.uint32(TRIAD_FLAGS[name][place]))):
                notes.append(warning(code, sensor=name, count=count, samples=len(imu)))
            elif place == 1 and (piles := (stats := statistics(imu, name)).piles):
                values = tuple(f"{axis} {pile.value:.4g}" for axis, of in piles.items() for pile in of)
                unit, samples = QUANTITY_BY_TRIAD[name].value, len(imu)
                notes.append(
                    warning("samples.piled", sensor=name, values=values, unit=unit, count=stats.piled, samples=samples)
                )
    if count := int(np.count_nonzero(bits & np.uint32(flags.GAP))):
        longest = int(np.diff(imu.t_ns).max()) / 1e9
        notes.append(warning("samples.gaps", count=count, samples=len(imu), longest=longest))
    return (*notes, *_stuck(imu), *doubts(imu))


def all_findings(recording: Recording) -> tuple[Finding, ...]:
    """Findings of the samples; of several units, each once, with the units that it is about if not all."""
    if recording.array is None:
        return () if recording.imu is None else findings(recording.imu)
    of: dict[Finding, list[str]] = {}
    for name, unit in recording.array.units.items():
        for finding in findings(unit):
            of.setdefault(finding, []).append(name)
    every = len(recording.array.names)
    return tuple(finding if len(names) == every else finding.on(*names) for finding, names in of.items())


def inferred(report: TimeReport) -> tuple[Finding, ...]:
    """Finding about gaps that nothing but the host's delays spoke for; none where there are none."""
    if not report.inferred:
        return ()
    code = "host" if report.mode == "host" else "clock"
    rate = "" if math.isfinite(report.drift_ppm) else "yes"
    seconds = report.inferred_time
    return (warning(f"reading.inferred_gaps_{code}", count=report.inferred, seconds=seconds, no_rate=rate),)


def stored_notes(recording: Recording) -> tuple[Finding, ...]:
    """Notes as a file keeps them: those that last, and whether the sensor values are calibrated."""
    units = (recording.imu,) if recording.array is None else recording.array.units.values()
    cards = dict.fromkeys(calibration_told(unit.meta.calibration) for unit in units if unit is not None)
    return (*lasting(recording.notes), *(info("samples.calibration", card=card) for card in cards))


def _stuck(imu: ImuData) -> Iterator[Finding]:
    for name in imu.triads:
        axes = statistics(imu, name).repeats
        repeats = axes[axes != NOT_KNOWN]
        again = repeats == ALL_AXES
        # one axis never changes while others do: a wire, a register or a column is missing
        if repeats.size >= STUCK_SAMPLES and np.mean(again[1:]) <= 0.5:
            for i, axis in enumerate("xyz"):
                if (repeats[1:] >> i & 1).all():
                    mean = float(statistics(imu, name).mean[i])
                    yield warning("samples.stuck_axis", sensor=name, axis=axis, value=mean)
        if again.size - np.count_nonzero(again) < 2:  # it never changes: a simulation without noise, at rest
            continue
        if not (stretches := stuck_runs(again)).size:
            continue
        t, (starts, ends) = imu.t, np.flatnonzero(axes != NOT_KNOWN)[stretches.T - [[0], [1]]]
        seconds = t[ends] - t[starts]
        i = int(np.argmax(seconds))
        if seconds[i] >= STUCK_FOR:
            start = int(starts[i])
            alive = imu[start : start + 1].usable(name).any()
            count = int(np.count_nonzero(seconds >= STUCK_FOR))
            yield warning(
                "samples.stuck" if alive else "samples.stuck_at_zero",
                sensor=name, seconds=float(seconds[i]), start=float(t[start]), count=count if count > 1 else None,
            )  # fmt: skip
