"""Calibrations of magnetometers in real rooms: the heading error that they predict, beside that by a reference."""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from plumbob.benchmark.accuracy import read_trial
from plumbob.benchmark.room import Room, room_of
from plumbob.calib.refusal import CaptureRefusedError
from plumbob.data import ImuData
from plumbob.errors import DecodeError, PlumbobError
from plumbob.pipeline.calibrate_mag import calibrate_mag
from plumbob.units import to_deg

WAYS: Final = {"alone": "none", "chosen": "auto"}
"""What may help, by what it is called: nothing, and what is chosen without being told."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """One calibration: heading errors in degrees, by the reference and as predicted; or the kind of its refusal."""

    off_deg: float | None = None
    predicted_deg: float | None = None
    refused: str | None = None

    def text(self) -> str:
        """Cell of a table."""
        if self.off_deg is None or self.predicted_deg is None:
            return f"{self.refused:>15}"
        return f"{self.off_deg:6.2f} (±{self.predicted_deg:.2f}) "


@dataclass(frozen=True, slots=True)
class Trial:
    """One recording: unevenness in µT, heading error in degrees without a calibration, and the calibrations by way."""

    uneven: float
    raw_deg: float
    outcomes: dict[str, Outcome]


@dataclass(frozen=True, slots=True)
class Rooms:
    """What was found.

    Attributes
    ----------
    trials : dict
        By recording.
    skipped : dict
        Files that are no trial, and why.
    """

    trials: dict[str, Trial]
    skipped: dict[str, str]

    def ratio(self, way: str) -> float | None:
        """Root mean square of error over predicted error; None where all was refused."""
        found = [trial.outcomes[way] for trial in self.trials.values()]
        ratios = [o.off_deg / o.predicted_deg for o in found if o.off_deg is not None and o.predicted_deg]
        return math.sqrt(sum(r * r for r in ratios) / len(ratios)) if ratios else None

    def as_dict(self) -> dict[str, Any]:
        """Ready for JSON."""
        trials = {
            name: {
                "uneven_uT": trial.uneven,
                "raw_deg": trial.raw_deg,
                **{way: asdict(outcome) for way, outcome in trial.outcomes.items()},
            }
            for name, trial in self.trials.items()
        }
        return {"trials": trials, "ratio": {way: self.ratio(way) for way in WAYS}, "skipped": self.skipped}

    def text(self) -> str:
        """Table."""
        width = max(map(len, (*self.trials, "error over predicted, rms")))
        head = f"{'heading error, degrees':{width}} {'room, µT':>9} {'raw':>6}" + "".join(f"{way:>16}" for way in WAYS)
        lines = [head]
        for name, trial in self.trials.items():
            cells = " ".join(trial.outcomes[way].text() for way in WAYS)
            lines.append(f"{name:{width}} {trial.uneven:9.2f} {trial.raw_deg:6.2f} {cells}")
        ratios = (self.ratio(way) for way in WAYS)
        cells = "".join(f"{'–' if ratio is None else f'{ratio:.2f}':>16}" for ratio in ratios)
        lines.append(f"{'error over predicted, rms':{width}} {'':9} {'':6}{cells}")
        return "\n".join([*lines, *(f"skipped {name}: {why}" for name, why in self.skipped.items())])


def measure_rooms(files: Sequence[Path], *, progress: Callable[[int], None] | None = None) -> Rooms:
    """Calibrate the magnetometer of each recording that carries a reference.

    Parameters
    ----------
    files : sequence of Path
        Recordings; one without magnetometer or reference is skipped with its reason.
    progress : callable, optional
        Called with 1 after each file.

    Raises
    ------
    DecodeError
        If no file is a trial.
    """
    trials: dict[str, Trial] = {}
    skipped: dict[str, str] = {}
    for path in files:
        try:
            imu, reference = read_trial(path)
            trials[path.stem] = _trial(imu, room_of(imu, reference))
        except PlumbobError as error:
            skipped[path.name] = str(error)
        if progress:
            progress(1)
    if not trials:
        raise DecodeError("no file holds both a magnetometer and a reference. " + "; ".join(skipped.values()))
    return Rooms(trials, skipped)


def _trial(imu: ImuData, room: Room) -> Trial:
    outcomes = {way: _outcome(imu, room, helper) for way, helper in WAYS.items()}
    return Trial(room.unevenness, float(to_deg(room.heading_off(None))), outcomes)


def _outcome(imu: ImuData, room: Room, helper: str) -> Outcome:
    try:
        found = calibrate_mag(imu, with_=helper).calibration
    except CaptureRefusedError as refused:
        return Outcome(refused=refused.reasons[0].kind)
    predicted = None if found.quality is None else found.quality.heading_sd
    return Outcome(float(to_deg(room.heading_off(found))), None if predicted is None else float(to_deg(predicted)))
