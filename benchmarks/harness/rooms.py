"""Calibrations of magnetometers in real rooms: the heading error that they predict, beside that by a reference."""

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.harness.room import Room, room_of
from plumbob.calibration.calibrate_mag import calibrate_mag
from plumbob.calibration.fit import HEADING, CaptureRefusedError
from plumbob.core.errors import DecodeError, ParameterError, PlumbobError, ShapeError
from plumbob.core.units import to_deg
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.cards import TriadCalibration
from plumbob.fleet.experiments.trials import read_trial

WAYS: Final = {"alone": "none", "chosen": "auto"}
"""What may help, by what it is called: nothing, and what is chosen without being told."""

SHORTEST: Final = 1.0
"""Shortest window that is calibrated, s."""

_ALL: Final = "all"


@dataclass(frozen=True, slots=True)
class Outcome:
    """One calibration: heading errors in degrees, by the reference and as predicted; or the kind of its refusal."""

    off_deg: float | None = None
    predicted_deg: float | None = None
    refused: str | None = None
    grade: str | None = None

    @property
    def ratio(self) -> float | None:
        """Error over predicted error; None where it was refused."""
        return self.off_deg / self.predicted_deg if self.off_deg is not None and self.predicted_deg else None

    def text(self) -> str:
        """Cell of a table."""
        if self.off_deg is None or self.predicted_deg is None:
            return f"{self.refused:>15}"
        return f"{self.off_deg:6.2f} (±{self.predicted_deg:.2f}) "


@dataclass(frozen=True, slots=True)
class Trial:
    """One recording or window: unevenness in µT, heading error in degrees without a calibration, calibrations by way.

    `apart` is the heading difference, root mean square, between each calibration and that of the window before, over
    what both predict; of windows only.
    """

    uneven: float
    raw_deg: float
    outcomes: dict[str, Outcome]
    apart: Mapping[str, float] | None = None


@dataclass(frozen=True, slots=True)
class Share:
    """Cards of one grade: how many, error over predicted, root mean square and worst, and how many are beyond.

    `beyond` counts those whose error is larger than the grade allows, `worse` those worse than no card.
    """

    cards: int
    ratio: float
    worst: float
    beyond: int
    worse: int


@dataclass(frozen=True, slots=True)
class Rooms:
    """What was found.

    Attributes
    ----------
    trials : dict
        By recording, and window.
    skipped : dict
        Files that are no trial, and why.
    window : float or None
        Length of the windows, s; None for whole recordings.
    """

    trials: dict[str, Trial]
    skipped: dict[str, str]
    window: float | None = None

    def ratio(self, way: str) -> float | None:
        """Root mean square of error over predicted error; None where all was refused."""
        return _rms([r for trial in self.trials.values() if (r := trial.outcomes[way].ratio) is not None])

    def apart(self, way: str) -> float | None:
        """Root mean square of `Trial.apart`; None where no neighbours were calibrated."""
        return _rms([t.apart[way] for t in self.trials.values() if t.apart is not None and way in t.apart])

    def shares(self, way: str) -> dict[str, Share]:
        """Cards by grade, and all of them."""
        grades = (*HEADING._fields, _ALL)
        return {grade: share for grade in grades if (share := self._share(way, grade)) is not None}

    def refusals(self, way: str) -> dict[str, int]:
        """How many were refused, by kind."""
        kinds = (trial.outcomes[way].refused for trial in self.trials.values())
        return dict(Counter(kind for kind in kinds if kind is not None).most_common())

    def summary(self) -> dict[str, Any]:
        """Ready for JSON."""
        trials = {
            name: {
                "uneven_uT": trial.uneven,
                "raw_deg": trial.raw_deg,
                **{way: asdict(outcome) for way, outcome in trial.outcomes.items()},
            }
            for name, trial in self.trials.items()
        }
        return {
            "window_s": self.window,
            "trials": trials,
            "ratio": {way: self.ratio(way) for way in WAYS},
            "grades": {way: {grade: asdict(share) for grade, share in self.shares(way).items()} for way in WAYS},
            "apart": {way: self.apart(way) for way in WAYS},
            "refused": {way: self.refusals(way) for way in WAYS},
            "skipped": self.skipped,
        }

    def text(self) -> str:
        """Table of the trials, what the cards of each grade are worth, and what was refused."""
        width = max(map(len, (*self.trials, "error over predicted, rms")))
        head = f"{'heading error, degrees':{width}} {'room, µT':>9} {'raw':>6}" + "".join(f"{way:>16}" for way in WAYS)
        lines = [head]
        for name, trial in self.trials.items():
            cells = " ".join(trial.outcomes[way].text() for way in WAYS)
            lines.append(f"{name:{width}} {trial.uneven:9.2f} {trial.raw_deg:6.2f} {cells}")
        lines += ["", *self.by_grade(), ""]
        cells = "".join(f"{_told(self.ratio(way)):>16}" for way in WAYS)
        lines.append(f"{'error over predicted, rms':{width}} {'':9} {'':6}{cells}")
        return "\n".join([*lines, *(f"skipped {name}: {why}" for name, why in self.skipped.items())])

    def _share(self, way: str, grade: str) -> Share | None:
        limit = getattr(HEADING, grade, math.inf)
        cards = [
            (ratio, outcome.off_deg, trial.raw_deg)
            for trial in self.trials.values()
            if (outcome := trial.outcomes[way]).grade is not None
            and grade in {outcome.grade, _ALL}
            and outcome.off_deg is not None
            and (ratio := outcome.ratio) is not None
        ]
        if not cards:
            return None
        ratios, off, raw = np.array(cards).T
        beyond, worse = int(np.count_nonzero(off > to_deg(limit))), int(np.count_nonzero(off > raw))
        return Share(len(cards), float(np.sqrt(np.mean(ratios**2))), float(ratios.max()), beyond, worse)

    def by_grade(self) -> Iterator[str]:
        """Lines of what the cards of each grade are worth, and of what was refused."""
        told = ("cards", "error over predicted: rms", "worst", "beyond the grade", "worse than no card")
        yield f"{'':14}" + "  ".join(told)
        for way in WAYS:
            for grade, share in self.shares(way).items():
                cells = (str(share.cards), f"{share.ratio:.2f}", f"{share.worst:.2f}", str(share.beyond))
                worse = f"{share.worse} ({100.0 * share.worse / share.cards:.0f} %)"
                yield f"{way:7} {grade:6}" + "  ".join(
                    f"{cell:>{len(column)}}" for cell, column in zip((*cells, worse), told, strict=True)
                )
            if refused := self.refusals(way):
                yield f"{way:7} refused: " + ", ".join(f"{count} {kind}" for kind, count in refused.items())
            if (apart := self.apart(way)) is not None:
                yield f"{way:7} windows that follow each other differ by {apart:.2f} of what both predict (rms)"


def measure_rooms(
    files: Sequence[Path], *, window: float | None = None, progress: Callable[[int], None] | None = None
) -> Rooms:
    """Calibrate the magnetometer of each recording that carries a reference.

    Parameters
    ----------
    files : sequence of Path
        Recordings; one without magnetometer or reference is skipped with its reason.
    window : float, optional
        Calibrate windows of this length each, s, beside the reference of the whole recording; what is left at its end
        does not count.
    progress : callable, optional
        Called with 1 after each file.

    Raises
    ------
    DecodeError
        If no file is a trial.
    ParameterError
        If the window is too short.
    """
    if window is not None and not SHORTEST <= window < math.inf:
        raise ParameterError(f"window must be at least {SHORTEST:g} s, but it is {window:g} s.")
    trials: dict[str, Trial] = {}
    skipped: dict[str, str] = {}
    for path in files:
        try:
            imu, reference = read_trial(path)
            room = room_of(imu, reference)
            if window is not None:
                _require_one_truth(imu, reference, room)
            trials |= _trials(path.stem, imu, room, window)
        except PlumbobError as error:
            skipped[path.name] = str(error)
        if progress:
            progress(1)
    if not trials:
        raise DecodeError("no file holds both a magnetometer and a reference. " + "; ".join(skipped.values()))
    return Rooms(trials, skipped, window)


def _require_one_truth(imu: ImuData, reference: AttitudeTrack, room: Room) -> None:
    """Refuse a recording whose halves the reference calibrates differently: a magnet moved, and nothing is true."""
    middle = len(imu) // 2
    try:
        one, two = (room_of(half, reference).calibration for half in (imu[:middle], imu[middle:]))
    except ShapeError:  # a half that was not turned enough says nothing
        return
    apart = room.apart(one, two)
    if apart > HEADING.fair:
        raise ShapeError(
            f"a magnet moved: the reference calibrates the halves {to_deg(apart):.1f}° apart, and windows have no truth"
        )


def trial_of(room: Room, imu: ImuData) -> Trial:
    """Calibrate a magnetometer in each of `WAYS`, beside the truth that a room tells."""
    return _trial(room, _calibrated(imu))


def _trials(name: str, imu: ImuData, room: Room, window: float | None) -> dict[str, Trial]:
    """Recording, or each of its windows, by name."""
    if window is None:
        return {name: trial_of(room, imu)}
    parts = {f"{name} {start:g} s": _calibrated(part) for start, part in windows(imu, window)}
    found = {label: _trial(room, fits) for label, fits in parts.items()}
    for (_, before), (label, fits) in pairwise(parts.items()):
        found[label] = _trial(room, fits, before)
    return found


def windows(imu: ImuData, length: float) -> Iterator[tuple[float, ImuData]]:
    """Windows of a recording that follow each other, with the start of each, s; the last, shorter one is left out."""
    count = int((imu.t[-1] - imu.t[0] + 1e-6) // length)
    edges = np.searchsorted(imu.t, imu.t[0] + length * np.arange(count + 1))
    for k, (first, stop) in enumerate(pairwise(edges.tolist())):
        if stop > first:
            yield k * length, imu[first:stop]


Fits = Mapping[str, TriadCalibration | str]
"""By way: a calibration, or the kind of its refusal."""


def _trial(room: Room, fits: Fits, before: Fits | None = None) -> Trial:
    outcomes = {way: _outcome(room, fit) for way, fit in fits.items()}
    apart = None if before is None else _apart(room, before, fits)
    return Trial(room.unevenness, float(to_deg(room.heading_off(None))), outcomes, apart)


def _calibrated(imu: ImuData) -> Fits:
    return {way: _fit(imu, helper) for way, helper in WAYS.items()}


def _fit(imu: ImuData, helper: str) -> TriadCalibration | str:
    try:
        return calibrate_mag(imu, with_=helper).calibration
    except CaptureRefusedError as refused:
        return refused.reasons[0].kind


def _outcome(room: Room, fit: TriadCalibration | str) -> Outcome:
    if isinstance(fit, str):
        return Outcome(refused=fit)
    predicted, quality = _predicted(fit), fit.quality
    off, grade = float(to_deg(room.heading_off(fit))), None if quality is None else quality.grade
    return Outcome(off, None if predicted is None else float(to_deg(predicted)), grade=grade)


def _apart(room: Room, before: Fits, after: Fits) -> dict[str, float]:
    """How far calibrations are apart, over what both predict, by way; of those that were made."""
    found = {}
    for way in WAYS:
        one, two = before[way], after[way]
        if isinstance(one, str) or isinstance(two, str):
            continue
        sds = _predicted(one), _predicted(two)
        if sds[0] and sds[1]:
            found[way] = room.apart(one, two) / math.hypot(sds[0], sds[1])
    return found


def _predicted(fit: TriadCalibration) -> float | None:
    """Heading error that a calibration predicts, rad."""
    return None if fit.quality is None else fit.quality.heading_sd


def _rms(values: Sequence[float]) -> float | None:
    return math.sqrt(sum(v * v for v in values) / len(values)) if values else None


def _told(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"
