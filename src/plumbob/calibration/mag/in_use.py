"""Magnetometer of a unit at work: hard iron, soft iron and the gyroscope's bias from hours of field and rates alone."""

from typing import Final

import numpy as np

from plumbob.calibration.ellipsoid.ellipsoid_fit import distortion_to_size
from plumbob.calibration.fit import CaptureRefusedError, Fitted, Reason, refuse
from plumbob.calibration.mag.checks import (
    DIP,
    STEEL,
    Doubt,
    dip_angle,
    mag_calibration,
    outliers,
    own_scale,
    require_figures,
    set_aside,
    stuck,
    uncertain,
    unequal,
    where_known,
    with_rates,
    wrong_field,
)
from plumbob.calibration.mag.field_gradient import Unevenness
from plumbob.calibration.mag.in_use_fit import FEWEST_WINDOWS, LENGTH, InUseFit, fit_in_use
from plumbob.calibration.mag.with_acc import turn_angle
from plumbob.calibration.mag.with_gyr import GAIN_SD
from plumbob.calibration.predicted import TILT_RANGE, heading_sd
from plumbob.core.check import Floats
from plumbob.core.units import to_deg, to_dps

MOST_OUTLIERS: Final = 0.3
"""Share of outliers above which a record is refused: a unit at work passes steel, which nobody can keep away."""

_ADVICE: Final = (
    "Take a longer record, in which the unit turns through all headings and leans as far as it ever does; or turn it "
    "by hand through all attitudes, and leave --in-use out."
)


def fit_mag_in_use(
    t: Floats,
    mag: Floats,
    gyr: Floats,
    *,
    acc: Floats | None = None,
    strength: float | None = None,
    dip: float | None = None,
    gyr_gain_sd: float = GAIN_SD,
    tilt_range: float = TILT_RANGE,
) -> Fitted:
    """Fit bias and full matrix so that the field turns, from moment to moment, as the gyroscope says.

    Neither need the field stay what it was, nor the gyroscope's bias: what `fit_mag_gyr` rests on, and what does not
    hold over hours of work. The idea is that of MAGYC [Rodriguez2024], but nothing is differentiated here.

    Parameters
    ----------
    t : ndarray (N,)
        Time, s, increasing; where rates are missing for long, nothing is concluded.
    mag : ndarray (N, 3)
        Measured field, µT; NaN where there is none.
    gyr : ndarray (N, 3)
        Rates, rad/s, finite; their bias is found too, every ten minutes, and how much later the field is measured.
        Their axes become those of the magnetometer.
    acc : ndarray (N, 3), optional
        Specific force, m/s², which shows the dip for the predicted error; NaN where there is none.
    strength : float, optional
        Strength of the field at the place, µT; without it, the sensor's own scale is kept on average.
    dip : float, optional
        Dip of the field, rad, for the predicted error.
    gyr_gain_sd : float
        Standard deviation of each entry of the gyroscope's gain matrix, relative; 0 where it is exact.
    tilt_range : float
        Inclination up to which the predicted heading error holds, rad.

    Raises
    ------
    CaptureRefusedError
        If the record cannot determine the calibration, with the reasons.
    ClockError
        If the time does not increase.
    ShapeError
        If rates are not finite, or the arguments have not as many samples each.
    ParameterError
        If another argument is outside its range.
    """
    require_figures(strength=strength, dip=dip, gyr_gain_sd=gyr_gain_sd, tilt_range=tilt_range)
    t, mag, gyr, acc = with_rates(t, mag, gyr, acc)
    fields = mag[np.isfinite(mag).all(axis=1)]
    refuse([dead] if len(fields) and (dead := stuck(fields)) is not None else [])
    fit = fit_in_use(t, mag, gyr, gyr_gain_sd=gyr_gain_sd)
    if fit is None:
        raise CaptureRefusedError(_unsettled(t))
    matrix, covariance = distortion_to_size(fit.distortion, fit.covariance, strength)
    radius = float(np.cbrt(np.linalg.det(fit.distortion)))
    size, dip = strength or radius, _dip((mag - fit.bias) @ matrix.T, acc) if dip is None else dip
    sd = heading_sd(matrix, covariance, size=size, dip=dip, tilt_range=tilt_range)
    refuse(_reasons(fit, sd, radius, strength))
    calibration = mag_calibration(
        matrix=matrix,
        bias=fit.bias,
        covariance=covariance,
        residuals=fit.residuals,
        used=fit.used,
        radius=radius,
        strength=strength,
        method="magnetometer in use, with gyroscope: the field from moment to moment",
        condition=fit.condition,
        heading_sd=sd,
        tilt_range=tilt_range,
        directions=fit.fields - fit.bias,
    )
    remarks = (*_remarks(fit, float(t[-1] - t[0]), size), *own_scale(strength, size), *set_aside(fit.used))
    return Fitted(calibration, fit.fields, fit.residuals, fit.used, remarks)


def _unsettled(t: Floats) -> Reason:
    """Reason to refuse a record to which nothing could be fitted."""
    lasting, needed = float(t[-1] - t[0]) if len(t) else 0.0, FEWEST_WINDOWS * LENGTH
    if lasting < needed:
        return Reason("too-few", f"{lasting:.3g} s of field and rates, but {needed:g} s are needed.", _ADVICE)
    what = f"no bias and matrix fit how the field turned in {lasting:.3g} s, beside the rates."
    return Reason("ill-conditioned", what, _ADVICE)


def _reasons(fit: InUseFit, sd: float, radius: float, strength: float | None) -> list[Reason]:
    reasons = [
        outliers(fit.used, STEEL, MOST_OUTLIERS),
        uncertain(Doubt(sd, sd, Unevenness(), 1.0, shown=False), _ADVICE),
        *where_known(sd, unequal(fit.distortion), wrong_field(radius, strength)),
    ]
    return [reason for reason in reasons if reason is not None]


def _remarks(fit: InUseFit, lasting: float, size: float) -> tuple[str, ...]:
    bias = ", ".join(f"{value:.3f}" for value in to_dps(fit.gyr_bias.mean(axis=0)).tolist())
    most = to_dps(float(np.max(np.ptp(fit.gyr_bias, axis=0))))
    moved = f", which moved by {most:.2g} °/s at most" if len(fit.gyr_bias) > 1 else ""
    duration = f"{lasting / 3600.0:.3g} h" if lasting >= 3600.0 else f"{lasting / 60.0:.3g} min"
    return (
        f"In use: {fit.windows} windows of {LENGTH:g} s in {duration}; from one to the next the field walks by "
        f"{fit.walk * size:.2g} µT along each axis.",
        f"Gyroscope: bias {bias} °/s{moved}; the magnetometer is turned by {to_deg(turn_angle(fit.distortion)):.2g}° "
        f"against it, and answers {1e3 * fit.delay:.1f} ms later.",
    )


def _dip(field: Floats, acc: Floats | None) -> float:
    """Dip of a calibrated field (N, 3), rad, by the specific force; an assumed one without it."""
    if acc is None:
        return DIP
    valid = np.isfinite(field).all(axis=1) & np.isfinite(acc).all(axis=1) & acc.any(axis=1)
    return dip_angle(field[valid], acc[valid]) if valid.any() else DIP
