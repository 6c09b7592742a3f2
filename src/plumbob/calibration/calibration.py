"""From a recording of a capture to a calibration card: what the fits are given, and what becomes of their results."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from plumbob.calibration.fit import Fitted, Mounted, numbers
from plumbob.core import __version__
from plumbob.core.errors import CalibrationError, ParameterError
from plumbob.core.findings import Finding, warning
from plumbob.core.result import Reported
from plumbob.data import ImuData
from plumbob.data.calibrated import apply_card
from plumbob.data.cards import CalibrationCard

SOFTWARE = f"plumbob {__version__}"
_UNNAMED = "unknown"


@dataclass(frozen=True, eq=False)
class Capture:
    """A recording that was made to calibrate a unit."""

    imu: ImuData  # samples; triads of the card so far are applied, others are as measured
    device: str  # the unit that the card will belong to
    base: CalibrationCard | None  # the card so far, which the new one completes
    date: str  # day of the capture, ISO 8601
    found: tuple[Finding, ...] = ()  # what the reader found wrong with the recording

    def calibrated(self, triad: str) -> bool:
        """Whether the card so far has a triad; of the gyroscope, a matrix that was found: a bias gives no scale."""
        part = getattr(self.base, triad, None)
        sd = getattr(part, "matrix_sd", None)
        return part is not None if triad == "acc" else sd is not None and bool((sd > 0.0).any())

    @property
    def dated(self) -> bool:
        """Whether the recording has its time, so that `date` is its day and not today."""
        return bool(self.imu.meta.t0_ns)


def capture(
    imu: ImuData,
    *,
    triads: tuple[str, ...],
    if_present: tuple[str, ...] = (),
    span: tuple[float, float] | None = None,
    device: str | None = None,
    base: CalibrationCard | None = None,
) -> Capture:
    """Samples of a capture with the card so far applied to every triad but those that are calibrated again.

    The recording must have the `triads`; those `if_present` are calibrated too where it has them. `device` names the
    unit where the recording does not.
    """
    if imu.meta.calibration is not None:
        raise CalibrationError(
            f"the recording is already calibrated, with {imu.meta.calibration}; a calibration needs what was measured."
        )
    missing = [name for name in triads if name not in imu.triads]
    if missing:
        raise CalibrationError(f"the recording has no {', '.join(missing)}, only {', '.join(imu.triads)}.")
    unit = unit_of(imu.meta.device, device, base)
    named = replace(imu, meta=replace(imu.meta, device=unit))
    used = named
    if span is not None:
        first, stop = imu.t.searchsorted(span).tolist()
        if stop <= first:
            raise ParameterError(
                f"nothing lies from {span[0]:g} to {span[1]:g} s; the recording goes to {float(imu.t[-1]):g} s."
            )
        used = named[first:stop]
    others = None if base is None else base.without("mount", *triads, *if_present)
    applies = others is not None and any(name in others.parts for name in imu.triads)
    # the day of the recording where its time is known, else today
    when = datetime.fromtimestamp(imu.meta.t0_ns / 1e9, UTC) if imu.meta.t0_ns else datetime.now(UTC)
    calibrated = apply_card(others, used) if others is not None and applies else used
    return Capture(calibrated, unit, base, when.date().isoformat())


def card_of(capture: Capture, fits: Mapping[str, Fitted], *, mounted: Mounted | None = None) -> CalibrationCard:
    """Card of fits by triad and a mounting, with their remarks, and what the card so far has of others.

    Where the accelerometer is calibrated again, others that were found with its axes as they were say so; where the
    magnetometer is, the field of its loads is kept.
    """
    dated = {n: replace(fit.calibration, date=capture.date, remarks=fit.remarks) for n, fit in fits.items()}
    before = capture.base and capture.base.mag
    if before and "mag" in dated and dated["mag"].per_load is None:  # a load adds the same, whatever bias and matrix
        load = {name: getattr(before, name) for name in ("per_load", "per_load_sd", "loads")}
        dated["mag"] = replace(dated["mag"], **load)
    mount = None if mounted is None else replace(mounted.mount, date=capture.date, remarks=mounted.remarks)
    methods = dict.fromkeys([*(part.method for part in dated.values()), *([mount.method] if mount else [])])
    new = CalibrationCard(
        device=capture.device, date=capture.date, method="; ".join(methods), mount=mount, software=SOFTWARE, **dated
    )
    return new if capture.base is None else _outdated(capture.base, new).merged(new)


def unit_of(named: str, device: str | None, base: CalibrationCard | None) -> str:
    """Unit of a recording, by itself, `device` or the card so far; CalibrationError if none says it, or they differ."""
    names = {name for name in (named, device, base and base.device) if name and name != _UNNAMED}
    if len(names) > 1:
        raise CalibrationError(
            f"recording, --device and card name different units: {', '.join(sorted(names))}. A card is for one unit."
        )
    if not names:
        raise CalibrationError(
            "the recording does not say which unit it is of, and a card belongs to one unit. Name it by device = "
            "in the profile of a text file, or with --device."
        )
    return names.pop()


def _outdated(base: CalibrationCard, new: CalibrationCard) -> CalibrationCard:
    """Card so far, with a remark on what stays of it and hangs on an accelerometer that is calibrated anew."""
    if new.acc is None:
        return base
    free = base.gyr is not None and not base.gyr.matrix_found  # a bias at rest needs no axes
    parts = base.without("acc", *(["gyr"] if free else []), *new.parts).parts
    note = warning("calibration.stale_axes", date=new.acc.date)
    remarks = {name: (*(r for r in part.remarks if r.code != note.code), note) for name, part in parts.items()}
    return replace(base, **{name: replace(part, remarks=remarks[name]) for name, part in parts.items()})


@dataclass(frozen=True, eq=False, repr=False)
class Calibrated(Reported):
    """What a calibration found.

    Attributes
    ----------
    card : CalibrationCard
        The card so far, completed; it corrects every later recording of the unit.
    fits : mapping of str to Fitted
        By triad: the fit, with residuals, grade and remarks.
    capture : Capture
        What it was found from.
    """

    card: CalibrationCard
    fits: Mapping[str, Fitted]
    capture: Capture

    def facts(self) -> Mapping[str, str]:
        """Unit, and the grade of each part."""
        grades = {name: getattr(fit.calibration.quality, "grade", None) or "found" for name, fit in self.fits.items()}
        return {"device": self.card.device} | (grades or {"mount": "found"})

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the card; errors as of `CalibrationCard.save`."""
        self.card.save(path, overwrite=overwrite)

    def summary(self) -> dict[str, Any]:
        """All figures, as JSON can hold them."""
        return numbers(self.card, self.fits)
