"""Rates of a recording, compensated and filtered: `plumbob run --filter scalar`, and `plumbob.filter_rates`.

The steps are those of the trackball paper [Chen2013]: what temperature and specific force contribute is taken off, then
the constant that a stretch at rest shows, and each axis goes through a filter of rates (`plumbob.filters.channel`). The
result is samples, not an attitude: a filter of attitudes may take them, and then shows what the filter of rates did.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from plumbob.calibration.gyr.drift import CompensatedRates
from plumbob.core import check, flags
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.findings import Finding, as_json
from plumbob.core.text import FactsText, counted
from plumbob.core.units import to_dps
from plumbob.data import ImuData, calibration_told
from plumbob.data.calibrated import apply_card
from plumbob.data.cards import CalibrationCard, TriadCalibration
from plumbob.data.recording import Recording
from plumbob.door.estimate import opened_samples
from plumbob.files import write
from plumbob.filters.channel import RateFilter

_OF_RATES = np.uint32(flags.GYR_HELD | flags.GYR_ABSENT | flags.GYR_CLIPPED | flags.GYR_INVALID | flags.GAP)


@dataclass(frozen=True, eq=False, repr=False)
class FilteredRates(FactsText):
    """A recording whose gyroscope has been compensated for `drift` and filtered; `notes` say it, a line each."""

    recording: Recording
    filter: str
    drift: TriadCalibration
    notes: tuple[Finding, ...]

    @property
    def imu(self) -> ImuData:
        """The samples."""
        assert self.recording.imu is not None
        return self.recording.imu

    def facts(self) -> Mapping[str, str]:
        """Recording, filter and length."""
        name = self.filter.partition("(")[0]
        return {"recording": self.recording.name, "filter": name, "samples": str(len(self.imu))}

    def summary(self) -> dict[str, Any]:
        """What JSON has of it; rates in degrees per second."""
        return {
            "samples": len(self.imu),
            "duration_s": float(self.imu.t[-1] - self.imu.t[0]),
            "filter": self.filter,
            "calibration": self.imu.meta.calibration,
            "constant_dps": to_dps(self.drift.bias).tolist(),
            "notes": as_json(self.notes),
            "flags": flags.counts(self.imu.flags),
        }

    def text(self) -> str:
        """What a reader wants to know first, a line each."""
        lines = [f"calibration  {calibration_told(self.imu.meta.calibration)}"]
        lines += [f"{topic:12} {text}" for topic, _, text in (str(note).partition(": ") for note in self.notes)]
        for name, count in flags.counts(self.imu.flags & _OF_RATES).items():
            share = 100.0 * count / len(self.imu)
            lines.append(f"flag         {name}: {counted(count, 'sample')} ({share:.2f} %)")
        return "\n".join(lines)

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the recording; errors as of `plumbob.write`."""
        write(path, self.recording, overwrite=overwrite)


def filter_rates(
    recording: str | Path | Recording | ImuData,
    filter: str,
    *,
    params: Mapping[str, Any] | None = None,
    drift: str | None = None,
    rest: tuple[float | str, float | str] | None = None,
    calibration: CalibrationCard | str | Path | None = None,
    profile: str | Path | None = None,
    unit: str | None = None,
    out: str | Path | None = None,
    overwrite: bool = False,
    note: Callable[[str], None] | None = None,
) -> FilteredRates:
    """Compensate and filter the rates of a recording, each axis for itself.

    Parameters
    ----------
    recording : path, Recording or ImuData
        Sensor data; a file of any format that `plumbob.read` takes.
    filter : str
        Filter of rates: "scalar", "two_state" or "moving_average"; the last one with a window of one sample changes
        nothing.
    params : mapping, optional
        Its parameters: numbers in SI, or text with a unit, as ``{"noise": "0.1 deg/s"}``.
    drift : {"chen2013"}, optional
        What is taken off first; "chen2013" names the trackball paper's figures, which are not those of your unit. A
        part whose sensor the recording lacks is left out, with a note.
    rest : (float, float) or (str, str), optional
        Begin and end of a stretch at rest, s or text with a unit: the mean there is taken off, too.
    calibration : CalibrationCard or path, optional
        Card of this unit, applied in place of a drift model.
    profile : path, optional
        What the columns of a text file mean.
    unit : str, optional
        Which of several units in the file, by name or number from 1.
    out : path, optional
        Where to write the recording.
    overwrite : bool
        Whether a file that lies there may be replaced.
    note : callable, optional
        Called with each note as soon as it is known; the result holds them too.

    Returns
    -------
    FilteredRates

    Raises
    ------
    ShapeError
        If the recording has no gyroscope.
    ParameterError
        If the filter, a parameter or the drift model is not known, two arguments say the same, or nothing was recorded
        in `rest`.
    CalibrationError
        If a card is for another unit, or the samples are calibrated already.
    DecodeError
        If a file cannot be read.
    """
    label, source, imu = opened_samples(recording, profile, unit, load=True, carded=calibration is None)
    if imu.gyr is None:
        raise ShapeError(f"{label} has no gyroscope, whose rates are filtered.")
    notes: list[Finding] = []

    def say(finding: Finding) -> None:
        notes.append(finding)
        if note is not None:
            note(str(finding))

    rates = CompensatedRates(RateFilter(filter, channels=3, params=params), drift=drift, rest=rest, say=say)
    if calibration is not None:
        if drift is not None:
            raise ParameterError("drift and calibration both subtract the bias. Give one of them.")
        imu = apply_card(CalibrationCard.of(calibration), imu)
    imu = rates.take(imu)
    made = replace(source, imu=imu, notes=(*source.notes, *(finding.on("rates") for finding in notes)))
    result = FilteredRates(made, rates.filter.describe(), rates.drift, tuple(notes))
    if out is not None:
        result.save(check.path("out", out), overwrite=overwrite)
    return result
