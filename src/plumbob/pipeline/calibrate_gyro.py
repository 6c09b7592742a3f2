"""From a capture to the calibration of a gyroscope: which fit, and what each is given."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from plumbob import flags
from plumbob.calib.fitted import Fitted
from plumbob.calib.gyr.ferraris import fit_ferraris
from plumbob.calib.gyr.ferraris_parts import find_parts
from plumbob.calib.gyr.hand import fit_hand
from plumbob.calib.gyr.known import UNCALIBRATED
from plumbob.calib.gyr.motions import find_motions
from plumbob.calib.gyr.preset import fit_trackball
from plumbob.calib.gyr.rest import fit_rest
from plumbob.calib.gyr.temperature import fit_temperature
from plumbob.calib.still import stills
from plumbob.cards import TriadCalibration
from plumbob.check import Floats
from plumbob.errors import CalibrationError
from plumbob.pipeline.calibration import Capture


def gyro_at_rest(capture: Capture) -> dict[str, Fitted]:
    """Bias of the gyroscope from what of the capture is at rest."""
    imu = capture.imu
    clipped, known = _clipped(capture, flags.GYR_CLIPPED), _known(capture)
    fit = fit_rest(
        imu.t, _gyr(capture), acc=imu.acc, mag=_mag(capture), temp_c=imu.temp_c, clipped=clipped, known=known
    )
    return {"gyr": fit}


def gyro_by_hand(capture: Capture) -> dict[str, Fitted]:
    """Bias and matrix of the gyroscope from hand motion between poses at rest."""
    imu = capture.imu
    if imu.acc is None:
        raise CalibrationError("hand motion calibrates a gyroscope against the accelerometer, and there is no acc.")
    fit = fit_hand(
        imu.t,
        _gyr(capture),
        imu.acc,
        acc_calibrated=capture.base is not None and capture.base.acc is not None,
        mag=_mag(capture),
        temp_c=imu.temp_c,
        clipped=_clipped(capture, flags.GYR_CLIPPED),
        known=_known(capture),
    )
    return {"gyr": fit}


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
    found = find_parts(imu.t, imu.acc, _gyr(capture)) if parts is None else parts
    clipped = _clipped(capture, flags.GYR_CLIPPED | flags.ACC_CLIPPED)
    fits = fit_ferraris(imu.t, imu.acc, _gyr(capture), found, angle=angle, clipped=clipped)
    if _known(capture).bias_per_k.any():
        told = "The card's polynomial of temperature is gone; 'plumbob calibrate temperature' finds it again."
        fits["gyr"] = replace(fits["gyr"], remarks=(*fits["gyr"].remarks, told))
    return fits


def gyro_of_trackball(capture: Capture) -> dict[str, Fitted]:
    """Bias at rest with the coefficients that the trackball paper takes for every part."""
    imu, clipped = capture.imu, _clipped(capture, flags.GYR_CLIPPED)
    fit = fit_trackball(imu.t, _gyr(capture), acc=imu.acc, mag=_mag(capture), temp_c=imu.temp_c, clipped=clipped)
    return {"gyr": fit}


def gyro_over_temperature(capture: Capture) -> dict[str, Fitted]:
    """Polynomial of the gyroscope's bias from a soak at rest."""
    imu = capture.imu
    clipped, known = _clipped(capture, flags.GYR_CLIPPED), _known(capture)
    fit = fit_temperature(
        imu.t, _gyr(capture), imu.temp_c, acc=imu.acc, mag=_mag(capture), clipped=clipped, known=known
    )
    return {"gyr": fit}


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


def _mag(capture: Capture) -> Floats | None:
    return None if capture.imu.mag is None else capture.imu.usable("mag")


def _known(capture: Capture) -> TriadCalibration:
    """Gyroscope of the card so far."""
    return UNCALIBRATED if capture.base is None or capture.base.gyr is None else capture.base.gyr


def _clipped(capture: Capture, mark: int) -> NDArray[np.bool_]:
    return np.asarray((capture.imu.flags & np.uint32(mark)) != 0)
