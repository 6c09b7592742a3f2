"""Magnetometer of a capture: which samples count, and which of the fits says most about them."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.ellipsoid_fit import Shape
from plumbob.calibration.fit import CaptureRefusedError, Fitted, Reason, refuse
from plumbob.calibration.mag.axes import LEAST_SLOPE, agreement
from plumbob.calibration.mag.checks import clipped, stuck
from plumbob.calibration.mag.ellipsoid import fit_mag, fit_mag_level, unturned
from plumbob.calibration.mag.in_use import fit_mag_in_use
from plumbob.calibration.mag.with_acc import FEWEST, fit_mag_acc
from plumbob.calibration.mag.with_gyr import GAIN_SD, SHEET_GAIN_SD, fit_mag_gyr
from plumbob.calibration.mag_checks import require_field_turns, told_by_others, without_gain, wrong_axes
from plumbob.calibration.predicted import TILT_RANGE
from plumbob.core import check, flags
from plumbob.core.constants import G0
from plumbob.core.errors import CalibrationError, ParameterError
from plumbob.core.findings import info, warning
from plumbob.core.units import dps, to_deg, to_dps
from plumbob.data import ImuData
from plumbob.quality.static_periods import stills

HELPERS: Final = ("auto", "none", "acc", "gyr")  # what may help the magnetometer
# Besides "auto", and "level" for what only turns level.
SHAPES: Final = {"sphere": Shape.SPHERE, "axes": Shape.AXES, "ellipsoid": Shape.ELLIPSOID}

# Departure of the specific force from gravity, of itself, beyond which a sample tells no vertical: 1.7° at worst.
STEADY: Final = 0.03

SLOW: Final = float(dps(15.0))  # rad/s; beyond, delays between the sensors turn the vertical that a sample tells
LEAST_SLOW: Final = 0.1  # share of slow samples above which the accelerometer helps without being told so
LONG: Final = 300.0  # shortest record that may be that of a unit at work, s
TRUSTED: Final = 0.01  # median of that departure up to which a capture's specific force is taken for gravity unasked


def calibrate_mag(
    imu: ImuData,
    *,
    with_: str = "auto",
    shape: str = "auto",
    strength: float | None = None,
    dip: float | None = None,
    tilt_range: float = TILT_RANGE,
    acc_calibrated: bool = False,
    gyr_calibrated: bool = False,
    in_use: bool = False,
    force: bool = False,
) -> Fitted:
    """Calibrate the magnetometer of a capture, whose accelerometer should be calibrated.

    The accelerometer shows, where its specific force is gravity, how the magnetometer is turned against it; the
    gyroscope how the field turns, which needs little inclination. With "auto" the accelerometer helps where its
    specific force is gravity in most samples of slow turning, nothing where it is not or a smaller shape than the
    ellipsoid is asked for, and the gyroscope where the capture is poor or refused otherwise. The dip of the place, rad,
    must agree with what the capture says. `gyr_calibrated`: a card with scale and axes was applied. `in_use`: a long
    record of a unit at work, which nobody turned for the purpose. `force`: make a calibration that would rather harm
    than help, with a remark not to use it.
    """
    _require_choices(with_, shape, in_use=in_use)
    mag, acc = imu.usable("mag"), imu.usable("acc")
    present, at_end = np.isfinite(mag).all(axis=1), (imu.flags & np.uint32(flags.MAG_CLIPPED)) != 0
    refuse(clipped(at_end[present]))
    use = np.asarray(present & ~at_end)
    if shape == "level":
        level = fit_mag_level(mag[use], acc=acc[use], strength=strength, dip=dip)
        return replace(level, remarks=(info("calibration.mag_level"), *level.remarks))
    field = mag[use]
    if len(field) > 0:  # an axis may be dead, or the unit have lain still
        turning = "Turn the unit slowly through all attitudes: each face and each edge once up."
        refuse(stuck(field) or unturned(field, turning))
    slow = _slow(imu)
    with np.errstate(invalid="ignore"):
        upright = np.abs(np.linalg.norm(acc, axis=1) / G0 - 1.0) <= STEADY
    steady = use & slow & upright
    work = _Work(imu, use, steady, shape, strength, dip, tilt_range, acc_calibrated, gyr_calibrated)
    auto = with_ == shape == "auto" and not in_use and imu.gyr is not None
    try:
        helper, why = work.helper(with_, slow, in_use=in_use)
        fit = work.fit(helper)
    except CaptureRefusedError as refused:
        if not auto or refused.reasons[0].kind in _FINAL:
            raise work.with_axes(refused, rates=in_use or with_ == "gyr") from None
        fit, why = _rescued(work, helper, refused)
    doubt = without_gain(imu, fit, steady, dip)
    if auto and (doubt is not None or (quality := fit.calibration.quality) is None or quality.grade == "poor"):
        other = _bettered(work, fit)
        if other is not None:
            fit, why = other
            doubt = without_gain(imu, fit, steady, dip)
    if doubt is not None and not force:
        refuse(doubt)
    warning = () if doubt is None else (f"DO NOT USE: {doubt.text}",)
    return replace(fit, remarks=(*warning, why, *fit.remarks))


_FINAL: Final = {"mirrored", "turned-axes", "wrong-field"}  # refusals that no other fit can help


@dataclass(frozen=True, eq=False)
class _Work:
    """A capture, its samples that count and those with a vertical, and what is asked for."""

    imu: ImuData
    use: NDArray[np.bool_]
    steady: NDArray[np.bool_]
    shape: str
    strength: float | None
    dip: float | None
    tilt_range: float
    acc_calibrated: bool
    gyr_calibrated: bool

    def helper(self, with_: str, slow: NDArray[np.bool_], *, in_use: bool) -> tuple[str, str]:
        """What helps, and why, in words."""
        imu, use, steady = self.imu, self.use, self.steady
        if in_use:
            if imu.gyr is None:
                raise CalibrationError(
                    "calibration in use needs gyr, which the record lacks; turn the unit by hand instead."
                )
            return "in use", "Fitted in use, as asked for: with the gyroscope, from moment to moment."
        if with_ not in {"auto", "none", *imu.triads}:
            raise CalibrationError(f"the capture has no {with_} to help the magnetometer; choose with none.")
        if with_ == "gyr":
            return "gyr", "Fitted with the gyroscope, as asked for."
        count, all_, calm = (int(np.count_nonzero(which)) for which in (steady, use, use & slow))
        text = f"{count} of {all_} samples have a specific force within {100.0 * STEADY:.0f} % of gravity"
        if imu.gyr is not None:
            text += f" and turn by less than {to_dps(SLOW):.0f}°/s"
        if with_ == "acc":
            if count < FEWEST:
                what = f"{text}; at least {FEWEST} are needed."
                refuse(Reason("not-still", what, "Turn the unit slowly, calibrate the accelerometer first."))
            return "acc", f"Fitted with the accelerometer, as asked for: {text}."
        without = "Fitted without the accelerometer"
        force = np.linalg.norm(imu.usable("acc")[use & slow], axis=1)
        departure = np.abs(force[np.isfinite(force)] / G0 - 1.0)
        typical = float(np.median(departure)) if departure.size else math.inf
        if with_ == "none" or imu.acc is None:
            why = f"Fitted without other sensors: {'as asked for' if with_ == 'none' else 'there is no acc'}."
        elif self.shape not in {"auto", "ellipsoid"}:
            why = "Fitted without other sensors: they need the whole matrix, and a smaller shape is asked for."
        elif calm < max(FEWEST, LEAST_SLOW * all_):
            why = f"{without}, because the unit turned too fast: {text}."
        elif count >= FEWEST and 2 * count > calm and typical <= TRUSTED:
            return "acc", f"Fitted with the accelerometer, whose specific force is gravity: {text}."
        else:
            doubt = f"{text}, and the median departure is {100.0 * typical:.1f} %"
            why = f"{without}, which moved or is not calibrated: {doubt}."
        return "none", why

    def fit(self, helper: str) -> Fitted:
        """Fit with a helper, or none, and what other sensors say about it."""
        mag, acc = self.imu.usable("mag"), self.imu.usable("acc")
        if helper == "none":
            fit = fit_mag(
                mag[self.use],
                shape=SHAPES.get(self.shape),
                strength=self.strength,
                acc=acc[self.use],
                dip=self.dip,
                tilt_range=self.tilt_range,
            )
        elif helper == "acc":
            fit = fit_mag_acc(mag[self.steady], acc[self.steady], strength=self.strength, tilt_range=self.tilt_range)
            if not self.acc_calibrated:
                fit = replace(fit, remarks=(warning("calibration.uncalibrated_force"), *fit.remarks))
        else:
            fit = self._with_rates(in_use=helper == "in use")
        remarks = told_by_others(self.imu, fit, self.steady, helper=helper, dip=self.dip)
        return replace(fit, remarks=(*remarks, *fit.remarks))

    def _with_rates(self, *, in_use: bool) -> Fitted:
        """Fit to the samples that have a rate."""
        gyr = self.imu.usable("gyr")
        valid = np.isfinite(gyr).all(axis=1)
        mag = np.where(self.use[:, np.newaxis], self.imu.usable("mag"), np.nan)
        force = self.imu.usable("acc")[valid]
        fit: Callable[..., Fitted] = partial(fit_mag_in_use, dip=self.dip) if in_use else fit_mag_gyr
        return fit(
            self.imu.t[valid], mag[valid], gyr[valid], acc=force if np.isfinite(force).all(axis=1).any() else None,
            strength=self.strength, gyr_gain_sd=GAIN_SD if self.gyr_calibrated else SHEET_GAIN_SD,
            tilt_range=self.tilt_range,
        )  # fmt: skip

    def with_axes(self, refused: CaptureRefusedError, *, rates: bool) -> CaptureRefusedError:
        """Refusal that names wrong axes too, first where they mirror: these may be why a fit was refused."""
        if refused.reasons[0].kind in _FINAL:
            return refused
        mag = np.where(self.use[:, np.newaxis], self.imu.usable("mag"), np.nan)
        wrong = wrong_axes(self.imu, mag, dip=self.dip)
        if rates and not wrong:
            require_field_turns(self.imu, mag)
        mirrored = [reason for reason in wrong if reason.kind == "mirrored"]
        turned = [reason for reason in wrong if reason.kind != "mirrored"]
        return CaptureRefusedError(*mirrored, *refused.reasons, *turned)

    def advising(self, refused: CaptureRefusedError, advice: str) -> CaptureRefusedError:
        """Refusal with another advice, and of a long record with rates that it may be one in use."""
        if self.imu.gyr is not None and self.imu.t[-1] - self.imu.t[0] >= LONG:
            advice = f"{advice} If it is a long record of a unit at work, say --in-use, in Python in_use=True."
        return CaptureRefusedError(replace(refused.reasons[0], advice=advice), *refused.reasons[1:])


def _rescued(work: _Work, helper: str, refused: CaptureRefusedError) -> tuple[Fitted, str]:
    """Fit of a capture that the accelerometer did not help, or that saw too few directions; else the last refusal."""
    if helper == "acc" and not work.steady[work.use].all():
        count, kind = int(np.count_nonzero(work.steady)), refused.reasons[0].kind
        why = f"Fitted without the accelerometer, because the {count} samples with a vertical are refused as {kind}."
        try:
            return work.fit("none"), why
        except CaptureRefusedError as without:
            refused = without
    first = refused.reasons[0]
    if first.kind in {"level-ring", "cone"}:
        advice = f"{first.advice} If it leaned by some degrees, and that is all it can, choose the gyroscope to help."
        if first.kind == "level-ring":
            advice += " A vehicle that stays level has the shape 'level' (--shape level)."
        raise work.with_axes(work.advising(refused, advice), rates=False)
    if first.kind not in {"too-few-regions", "uneven-field"}:
        raise work.with_axes(refused, rates=False)
    try:
        return work.fit("gyr"), f"Fitted with the gyroscope, because otherwise {first.text}"
    except CalibrationError:
        raise work.with_axes(work.advising(refused, first.advice), rates=False) from None


def _bettered(work: _Work, fit: Fitted) -> tuple[Fitted, str] | None:
    """Fit with the gyroscope, and why, where it leaves less of a heading error than a poor one; None elsewhere."""
    try:
        other = work.fit("gyr")
    except CalibrationError:
        return None
    both = (each.calibration.quality for each in (fit, other))
    before, after = (math.inf if q is None or q.heading_sd is None else to_deg(q.heading_sd) for q in both)
    if not after < before:
        return None
    return other, f"Fitted with the gyroscope: predicted heading error {after:.2g}° instead of {before:.2g}°."


def _require_choices(with_: str, shape: str, *, in_use: bool) -> None:
    check.one_of("with_", with_, HELPERS)
    check.one_of("shape", shape, ("auto", *SHAPES, "level"))
    if in_use and (with_ not in {"auto", "gyr"} or shape not in {"auto", "ellipsoid"}):
        raise ParameterError(
            "in use, the gyroscope helps to find the whole matrix, so with_ must be auto or gyr and shape auto or "
            f"ellipsoid, but they are {with_} and {shape}; leave them out."
        )
    if with_ in {"acc", "gyr"} and shape not in {"auto", "ellipsoid"}:
        raise ParameterError(
            f"with {with_} the whole matrix is found, so shape must be auto or ellipsoid, but it is {shape}; "
            "choose with none for another shape."
        )


def _slow(imu: ImuData) -> NDArray[np.bool_]:
    """Samples (N,) in which the unit turns slowly, by the gyroscope; all where there is none."""
    valid = np.asarray(np.isfinite(imu.usable("gyr")).all(axis=1))
    if not valid.any():
        return np.ones(len(imu), dtype=np.bool_)
    t, rate = imu.t[valid], imu.usable("gyr")[valid]
    fit = agreement(t, imu.usable("mag")[valid], rate)  # the field tells the bias, for even turning looks like rest
    if fit is not None and fit.slope > LEAST_SLOPE:
        bias = fit.rate_bias
    else:
        rests = stills(t, imu.usable("acc")[valid], rate)
        bias = np.median(np.concatenate([rate[rest] for rest in rests]), axis=0) if rests else np.zeros(3)
    size = np.linalg.norm(np.subtract(rate, bias), axis=1)
    return np.asarray(np.interp(imu.t, t, size) < SLOW)
