"""A whole unit from one capture by hand: each triad by its own fit, on what was found before."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from plumbob.calib.fitted import Fitted
from plumbob.calib.refusal import CaptureRefusedError
from plumbob.constants import G0
from plumbob.data import TITLES
from plumbob.pipeline.calibrate_accel import calibrate_accel
from plumbob.pipeline.calibrate_gyro import gyro_by_choice
from plumbob.pipeline.calibrate_mag import calibrate_mag
from plumbob.pipeline.calibration import Capture, capture, card_of


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


def _on(whole: Capture, fits: dict[str, Fitted], triad: str) -> Capture:
    """Capture of one triad, on the card so far with what has been fitted."""
    return capture(whole.imu, triads=(triad,), device=whole.device, base=card_of(whole, fits))


@contextmanager
def _named(triad: str) -> Iterator[None]:
    """Name the triad in a refusal, and what can be done without it."""
    try:
        yield
    except CaptureRefusedError as refused:
        reasons = [replace(one, text=f"{TITLES[triad]}: {one.text}") for one in refused.reasons]
        last = replace(reasons[-1], advice=f"{reasons[-1].advice} {_ALONE[triad]}")
        raise CaptureRefusedError(*reasons[:-1], last) from refused
