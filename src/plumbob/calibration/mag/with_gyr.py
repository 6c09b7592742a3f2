"""Magnetometer beside a gyroscope: for motion that is too restricted to see the ellipsoid, as of a ship or a car."""

import math
from typing import Final

import numpy as np

from plumbob.calibration.ellipsoid.scale import to_size_of
from plumbob.calibration.fit import Fitted
from plumbob.calibration.mag.alone import unturned
from plumbob.calibration.mag.arguments import (
    require_gain_sd,
    require_strength,
    require_tilt_range,
    unequal,
    with_rates,
    wrong_field,
)
from plumbob.calibration.mag.gyro_aided import PARAMETERS, FieldFit, fit_turned_field
from plumbob.calibration.mag.outcome import (
    DIP,
    STEEL,
    Doubt,
    calibration_of,
    outliers,
    own_scale,
    set_aside,
    thinned,
    uncertain,
    uneven_told,
    where_known,
)
from plumbob.calibration.mag.with_acc import turn_of
from plumbob.calibration.predicted import TILT_RANGE, heading_sd
from plumbob.calibration.rejection import CaptureRefusedError, Reason, refuse
from plumbob.core.check import Floats
from plumbob.core.errors import CalibrationError
from plumbob.core.units import dps, to_deg, to_dps

GAIN_SD: Final = 0.002
"""Standard deviation of each entry of a calibrated gyroscope's gain matrix."""

SHEET_GAIN_SD: Final = 0.02
"""The same of one that was not calibrated: data sheets say 2 to 3 % of scale, and 2 % across the axes."""

LONGEST_GAP: Final = 0.5
"""Longest time without a rate, s."""

WORST_WALK: Final = float(dps(0.1))
"""Random walk of the attitude above which it is not the gyroscope's noise, rad/√s."""

_FEWEST: Final = 2 * PARAMETERS
_SOME: Final = 4000  # samples of the field; more of them share its unevenness
_ADVICE: Final = (
    "Turn through all headings, several times and both ways, and roll and pitch as far as can be: circles and figures "
    "of eight for a minute."
)
_FIRST: Final = "Calibrate the gyroscope first, scale and axes: the field cannot be known better than it turns."


def fit_mag_gyr(
    t: Floats,
    mag: Floats,
    gyr: Floats,
    *,
    acc: Floats | None = None,
    strength: float | None = None,
    gyr_gain_sd: float = GAIN_SD,
    tilt_range: float = TILT_RANGE,
) -> Fitted:
    """Fit bias and full matrix so that the field is one vector as the gyroscope turns.

    Parameters
    ----------
    t : ndarray (N,)
        Time, s, increasing.
    mag : ndarray (N, 3)
        Measured field, µT; NaN where there is none.
    gyr : ndarray (N, 3)
        Rates, rad/s, finite; their constant bias is found too, and how much later the field is measured. Their axes
        become those of the magnetometer.
    acc : ndarray (N, 3), optional
        Specific force, m/s², whose mean over the capture shows the vertical, and so the dip for the predicted error.
    strength : float, optional
        Strength of the field at the place, µT; without it, the sensor's own scale is kept on average.
    gyr_gain_sd : float
        Standard deviation of each entry of the gyroscope's gain matrix, relative; 0 where it is exact.
    tilt_range : float
        Inclination up to which the predicted heading error holds, rad.

    Raises
    ------
    CaptureRefusedError
        If the capture cannot determine the calibration, with the reasons.
    CalibrationError
        If rates are missing for too long.
    ClockError
        If the time does not increase.
    ShapeError
        If rates are not finite, or the arguments have not as many samples each.
    ParameterError
        If another argument is outside its range.
    """
    require_strength(strength)
    require_gain_sd(gyr_gain_sd)
    require_tilt_range(tilt_range)
    t, mag, gyr, acc = with_rates(t, mag, gyr, acc)
    present = np.flatnonzero(np.isfinite(mag).all(axis=1))
    stride = max(1, -(-len(present) // _SOME))
    seen = present[::stride]
    _require_rates(t)
    refuse(_unfit(mag[seen]))
    first = "" if gyr_gain_sd <= GAIN_SD else f"{_FIRST} "
    fit = fit_turned_field(t, mag[seen], gyr, seen, gyr_gain_sd=gyr_gain_sd)
    if fit is None or not np.linalg.det(fit.distortion) > 0.0:
        what = "no bias, matrix and field fit what magnetometer and gyroscope measured."
        raise CaptureRefusedError(Reason("ill-conditioned", what, first + _ADVICE))
    matrix, covariance = to_size_of(fit.distortion, fit.covariance, strength)
    radius = float(np.cbrt(np.linalg.det(fit.distortion)))
    size, dip = strength or radius, _dip(fit, None if acc is None else acc[seen])
    sd = heading_sd(matrix, covariance, size=size, dip=dip, tilt_range=tilt_range)
    doubt = _doubt(fit, sd)
    refuse(_reasons(fit, doubt, radius, strength, first))
    calibration = calibration_of(
        matrix=matrix,
        bias=fit.bias,
        covariance=covariance,
        residuals=fit.residuals,
        used=fit.used,
        radius=radius,
        strength=strength,
        method=f"magnetometer with gyroscope: one field, {PARAMETERS} parameters delay included, and random walk",
        condition=fit.condition,
        heading_sd=sd,
        tilt_range=tilt_range,
        directions=mag[seen] - fit.bias,
    )
    remarks = (*_remarks(fit, strength, size, dip, acc is not None, stride), *uneven_told(doubt))
    return Fitted(calibration, mag[seen], fit.residuals, fit.used, remarks)


def _require_rates(t: Floats) -> None:
    gap = float(np.diff(t).max()) if len(t) > 1 else 0.0
    if gap > LONGEST_GAP:
        raise CalibrationError(
            f"rates are missing for {gap:.2g} s, and the field can be followed across {LONGEST_GAP:g} s at most; "
            "cut the capture there with --from or --to, or choose another helper than the gyroscope."
        )


def _unfit(mag: Floats) -> list[Reason]:
    if len(mag) < _FEWEST:
        return [Reason("too-few", f"{len(mag)} samples of the field, but {_FEWEST} are needed.", _ADVICE)]
    rest = unturned(mag, _ADVICE)
    return [] if rest is None else [rest]


def _dip(fit: FieldFit, acc: Floats | None) -> float:
    """Dip of the field, rad: by the mean specific force in the axes of the start, or an assumed one."""
    if acc is None:
        return DIP
    up = np.nanmean(np.einsum("nij,nj->ni", fit.turns, acc), axis=0)
    return float(-np.arcsin(np.clip(up @ fit.field_s / np.linalg.norm(up), -1.0, 1.0)))


def _doubt(fit: FieldFit, sd: float) -> Doubt:
    """What is predicted, and why; the field is shown to be uneven where most of it is seen, and counts."""
    shown = 2.0 * fit.field.seen**2 > fit.field.sd**2 and fit.alike.unevenness > fit.alike.memory
    return Doubt(sd, sd * math.sqrt(fit.alike.memory / fit.alike.factor), fit.field, fit.alike.memory, shown)


def _reasons(fit: FieldFit, doubt: Doubt, radius: float, strength: float | None, first: str) -> list[Reason]:
    """Reasons to refuse a fit; `first` is what to do before anything else."""
    found = [
        _wandering(fit.walk),
        outliers(fit.used, first + STEEL),
        uncertain(doubt, first + _ADVICE),
        *where_known(doubt.sd, unequal(fit.distortion), wrong_field(radius, strength)),
    ]
    return [reason for reason in found if reason is not None]


def _wandering(walk: float) -> Reason | None:
    if walk <= WORST_WALK:
        return None
    what = f"field and rates only agree if the attitude walks by {to_dps(walk):.2g}°/√s, which no gyroscope does."
    keep = "Keep iron and magnets away, check the gyroscope's unit and range, and calibrate it first."
    return Reason("magnet-moved", what, keep)


def _remarks(
    fit: FieldFit, strength: float | None, size: float, dip: float, measured: bool, stride: int
) -> tuple[str, ...]:
    bias = ", ".join(f"{value:.3f}" for value in to_dps(fit.gyr_bias).tolist())
    told = [
        f"Gyroscope: bias {bias} °/s, random walk {to_dps(fit.walk):.2g}°/√s; the magnetometer is turned by "
        f"{to_deg(turn_of(fit.distortion)):.2g}° against it.",
        f"The magnetometer answers {1e3 * fit.delay:.1f} ms later than the gyroscope.",
        f"Dip of the field: {to_deg(dip):.1f}°, {'by the mean specific force' if measured else 'assumed'}.",
    ]
    return (*told, *own_scale(strength, size), *thinned(stride), *set_aside(fit.used))
