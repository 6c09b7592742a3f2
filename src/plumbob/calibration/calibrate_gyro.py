"""From a capture to the calibration of a gyroscope: at rest, by hand, in a Ferraris session or over temperature."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.calibrate_accel import calibrate_accel
from plumbob.calibration.calibrate_mag import calibrate_mag
from plumbob.calibration.calibration import Capture, capture, card_of
from plumbob.calibration.fit import CaptureRefusedError, Fitted
from plumbob.calibration.gyr.ferraris import find_parts, fit_ferraris, fit_trackball
from plumbob.calibration.gyr.hand import fit_hand
from plumbob.calibration.gyr.motion_fit import find_motions
from plumbob.calibration.gyr.plausible import UNCALIBRATED, Rates
from plumbob.calibration.gyr.rest import fit_rest
from plumbob.calibration.gyr.temperature import fit_temperature
from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import CalibrationError
from plumbob.data import TITLES
from plumbob.data.cards import TriadCalibration
from plumbob.quality.static_periods import stills


def gyro_at_rest(capture: Capture) -> dict[str, Fitted]:
    """Bias of the gyroscope from what of the capture is at rest."""
    return {"gyr": fit_rest(_rates(capture))}


def gyro_by_hand(capture: Capture) -> dict[str, Fitted]:
    """Bias and matrix of the gyroscope from hand motion between poses at rest."""
    return {"gyr": fit_hand(_rates(capture))}


def gyro_by_choice(capture: Capture) -> dict[str, Fitted]:
    """By hand where the capture has motions that tilt the unit between poses at rest, else at rest."""
    moved = _has_motions(capture)
    fit = (gyro_by_hand if moved else gyro_at_rest)(capture)["gyr"]
    why = (
        "The capture has motions between poses at rest, so scale and axes were found too (--method hand)."
        if moved
        else "The capture has no motion between poses at rest, so only the bias was found (--method rest)."
    )
    return {"gyr": replace(fit, remarks=(why, *fit.remarks))}


def ferraris_session(capture: Capture, parts: Mapping[str, slice] | None, *, angle: float) -> dict[str, Fitted]:
    """Accelerometer and gyroscope from a Ferraris session; its parts are looked for where they are None."""
    imu = capture.imu
    if imu.acc is None:
        raise CalibrationError("a Ferraris session needs acc and gyr, and there is no acc.")
    located = find_parts(imu.t, imu.acc, _gyr(capture)) if parts is None else parts
    clipped = _clipped(capture, flags.GYR_CLIPPED | flags.ACC_CLIPPED)
    fits = fit_ferraris(imu.t, imu.acc, _gyr(capture), located, angle=angle, clipped=clipped)
    if _gyr_base(capture).bias_per_k.any():
        remark = "The card's polynomial of temperature is gone; 'plumbob calibrate temperature' finds it again."
        fits["gyr"] = replace(fits["gyr"], remarks=(*fits["gyr"].remarks, remark))
    return fits


def gyro_of_trackball(capture: Capture) -> dict[str, Fitted]:
    """Bias at rest with the coefficients that the trackball paper takes for every part."""
    return {"gyr": fit_trackball(_rates(capture))}


def gyro_over_temperature(capture: Capture) -> dict[str, Fitted]:
    """Polynomial of the gyroscope's bias from a soak at rest."""
    return {"gyr": fit_temperature(_rates(capture))}


def _has_motions(capture: Capture) -> bool:
    imu = capture.imu
    if imu.acc is None:
        return False
    motions, spoilt = find_motions(imu.t, _gyr(capture), imu.acc, stills(imu.t, imu.acc, _gyr(capture)))
    return bool(motions) or any(spoilt.values())


def _gyr(capture: Capture) -> Floats:
    if capture.imu.gyr is None:
        raise CalibrationError("the capture has no gyr.")
    return capture.imu.gyr


def _rates(capture: Capture) -> Rates:
    imu = capture.imu
    return Rates(
        imu.t,
        _gyr(capture),
        acc=imu.acc,
        mag=None if imu.mag is None else imu.usable("mag"),
        temp_c=imu.temp_c,
        clipped=_clipped(capture, flags.GYR_CLIPPED),
        known=_gyr_base(capture),
        acc_calibrated=capture.base is not None and capture.base.acc is not None,
    )


def _gyr_base(capture: Capture) -> TriadCalibration:
    """Gyroscope of the card so far."""
    return UNCALIBRATED if capture.base is None or capture.base.gyr is None else capture.base.gyr


def _clipped(capture: Capture, mark: int) -> NDArray[np.bool_]:
    return np.asarray((capture.imu.flags & np.uint32(mark)) != 0)


def calibrate_by_hand(
    whole: Capture, *, gravity: float = G0, strength: float | None = None, dip: float | None = None, force: bool = False
) -> dict[str, Fitted]:
    """Fit accelerometer, then gyroscope, then magnetometer, each with those before it calibrated.

    The capture is one of poses at rest with quick turns between them. A triad that it lacks is left out; if one cannot
    be calibrated, none is, because the others may rest on what is wrong with it.

    Parameters
    ----------
    whole : Capture
        The capture, none of its triads calibrated, with the card so far.
    gravity : float
        At the place, m/s².
    strength, dip : float, optional
        Of the magnetic field at the place, µT and rad.
    force : bool
        As in `calibrate_mag`.

    Returns
    -------
    dict of str to Fitted
        By triad, in the order in which they were found.

    Raises
    ------
    CaptureRefusedError
        If a triad cannot be calibrated; the reasons name it, and what can be calibrated without it.
    CalibrationError
        If the capture has no accelerometer.
    """
    with _named("acc"):
        fits = {"acc": calibrate_accel(_on(whole, {}, "acc").imu, gravity=gravity)}
    if whole.imu.gyr is not None:
        with _named("gyr"):
            fits |= gyro_by_choice(_on(whole, fits, "gyr"))
    if whole.imu.mag is not None:
        with _named("mag"):
            on = _on(whole, fits, "mag")
            fits["mag"] = calibrate_mag(
                on.imu,
                strength=strength,
                dip=dip,
                acc_calibrated=on.acc_calibrated,
                gyr_calibrated=on.gyr_calibrated,
                force=force,
            )
    return fits


_ALONE = {
    "acc": "The other triads are calibrated by the accelerometer, so it comes first.",
    "gyr": "'plumbob calibrate accel' alone would do with this capture.",
    "mag": "'plumbob calibrate accel', then 'gyro', would do with this capture.",
}


def _on(source: Capture, fits: dict[str, Fitted], triad: str) -> Capture:
    """Capture of one triad, on the card so far with what has been fitted."""
    return capture(source.imu, triads=(triad,), device=source.device, base=card_of(source, fits))


@contextmanager
def _named(triad: str) -> Iterator[None]:
    """Name the triad in a refusal, and what can be done without it."""
    try:
        yield
    except CaptureRefusedError as refused:
        reasons = [replace(reason, text=f"{TITLES[triad]}: {reason.text}") for reason in refused.reasons]
        last = replace(reasons[-1], advice=f"{reasons[-1].advice} {_ALONE[triad]}")
        raise CaptureRefusedError(*reasons[:-1], last) from refused
