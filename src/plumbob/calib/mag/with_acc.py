"""Magnetometer beside an accelerometer at rest or in slow motion: the whole matrix, its turn in the case included."""

import math
from typing import Final

import numpy as np

from plumbob.calib.ellipsoid.norm_fit import Shape
from plumbob.calib.fitted import Fitted
from plumbob.calib.grades import HEADING, grade_of
from plumbob.calib.mag.alone import MOST_OUTLIERS, fit_mag, memory
from plumbob.calib.mag.dip_fit import PARAMETERS, DipFit, fit_dip
from plumbob.calib.mag.plausible import unequal, wrong_field
from plumbob.calib.predicted import TILT_RANGE, heading_sd
from plumbob.calib.refusal import CaptureRefusedError, Reason, refuse
from plumbob.calib.regions import filled
from plumbob.cards import UNITS, Quality, TriadCalibration
from plumbob.check import Floats
from plumbob.constants import G0
from plumbob.units import deg, to_deg

FEWEST: Final = PARAMETERS + 1
"""Fewest samples or poses."""

UNSTEADY: Final = deg(5.0)
"""Scatter of the vertical from which on the accelerometer did not measure gravity, rad."""

_GRAVITY: Final = 0.1  # departure of gravity, of itself
_SOME: Final = 20_000
_ADVICE: Final = "Hold the unit still in each attitude, or turn it slowly, and capture anew."


def fit_mag_acc(mag: Floats, acc: Floats, *, strength: float | None = None, tilt_range: float = TILT_RANGE) -> Fitted:
    """Fit bias and full matrix so that the field has one strength and one dip.

    The vertical of the accelerometer tells what the length of the field cannot: how the magnetometer is turned against
    it. Captures of small tilt gain too, for the dip says about the upright axis what the length hardly does.

    Parameters
    ----------
    mag : ndarray (N, 3)
        Measured field, µT, in order of time; finite.
    acc : ndarray (N, 3)
        Calibrated specific force at the same instants, m/s², at rest or nearly; finite. Its axes become those of the
        magnetometer.
    strength : float, optional
        Strength of the field at the place, µT; without it, the sensor's own scale is kept on average.
    tilt_range : float
        Inclination up to which the predicted heading error holds, rad.

    Raises
    ------
    CaptureRefusedError
        If the capture cannot determine the calibration, with the reasons.
    """
    if len(mag) < FEWEST:
        what = f"{len(mag)} samples, but the joint fit needs {FEWEST} at least."
        refuse([Reason("too-few", what, "Hold the unit in more attitudes: 18 faces and edges, or turn it slowly.")])
    force = np.linalg.norm(acc, axis=1)
    refuse(_wrong_gravity(force))
    alone = fit_mag(mag, shape=Shape.ELLIPSOID, acc=acc, tilt_range=tilt_range)
    stride = -(-len(mag) // _SOME)
    points, down = mag[::stride], -(acc / force[:, np.newaxis])[::stride]
    fit = fit_dip(points, down, alone.calibration.bias, alone.calibration.matrix, alone.used[::stride])
    if fit is None:
        what = "no bias, matrix and dip fit the field and the vertical of the accelerometer."
        raise CaptureRefusedError(Reason("ill-conditioned", what, _ADVICE))
    matrix, covariance = to_strength(fit.matrix, fit.covariance * _memory(fit), strength)
    size = strength or _radius(fit.matrix)
    sd = heading_sd(matrix, covariance, size=size, dip=fit.dip, tilt_range=tilt_range)
    refuse(_reasons(fit, sd, strength))
    calibration = TriadCalibration(
        matrix=matrix,
        bias=fit.centre,
        unit_in=UNITS["mag"],
        unit_out=UNITS["mag"],
        residual_rms=float(np.sqrt(np.mean(fit.residuals[fit.used, 0] ** 2))) * size / _radius(fit.matrix),
        covariance=covariance,
        reference=strength,
        method="magnetometer with accelerometer: ellipsoid, turn and dip, 13 parameters",
        quality=Quality(
            grade=grade_of(sd, HEADING) or "poor",
            samples=int(np.count_nonzero(fit.used)),
            outliers=int(np.count_nonzero(~fit.used)),
            regions=int(np.count_nonzero(filled((points - fit.centre)[fit.used]))),
            condition=fit.condition,
            heading_sd=sd,
            tilt_range=tilt_range,
        ),
    )
    return Fitted(calibration, points, fit.residuals[:, 0], fit.used, _remarks(fit, strength, size, stride))


def to_strength(matrix: Floats, covariance: Floats, strength: float | None) -> tuple[Floats, Floats]:
    """Matrix (3, 3) of a calibration, and covariance (12, 12) of bias and matrix, from those of a fit to length 1.

    Parameters
    ----------
    matrix, covariance : ndarray (3, 3), (12, 12)
        Of the fit; the matrix in the inverse unit of the measurement.
    strength : float or None
        Length of the calibrated vector; where None, the matrix gets the determinant 1, and so keeps the sensor's scale.
    """
    size = strength or _radius(matrix)
    by_fit = np.eye(9)
    if not strength:
        by_fit -= np.outer(matrix.ravel(), np.linalg.inv(matrix).T.ravel()) / 3.0
    whole = np.eye(12)
    whole[3:, 3:] = size * by_fit
    return size * matrix, whole @ covariance @ whole.T


def turn_of(matrix: Floats) -> float:
    """Angle of the rotation in a matrix (3, 3), rad: of the factor that is left beside a symmetric one."""
    u, _, vt = np.linalg.svd(matrix)
    return math.acos(min(1.0, max(-1.0, 0.5 * (float(np.trace(u @ vt)) - 1.0))))


def _radius(matrix: Floats) -> float:
    """Strength of the field in the sensor's own scale, µT."""
    return float(1.0 / np.cbrt(np.linalg.det(matrix)))


def _memory(fit: DipFit) -> float:
    return max(memory(fit.residuals[fit.used, column]) for column in range(2))


def _wrong_gravity(force: Floats) -> list[Reason]:
    typical = float(np.median(force))
    if abs(typical / G0 - 1.0) <= _GRAVITY:
        return []
    what = f"the specific force is {typical:.3g} m/s² in the median, but gravity is {G0:.3g} m/s²."
    return [Reason("wrong-gravity", what, "Check the accelerometer's unit and range, and calibrate it first.")]


def _reasons(fit: DipFit, sd: float, strength: float | None) -> list[Reason]:
    reasons = []
    share = float(np.mean(~fit.used))
    if share > MOST_OUTLIERS:
        what = f"{100.0 * share:.0f} % of the samples do not fit the others; {100.0 * MOST_OUTLIERS:.0f} % may."
        reasons.append(Reason("outliers", what, "Move less, and look for moving iron and switched currents nearby."))
    if fit.down_sd > UNSTEADY:
        what = f"the vertical of the accelerometer scatters by {to_deg(fit.down_sd):.2g}° about the field's dip."
        reasons.append(Reason("not-still", what, _ADVICE))
    if sd > HEADING.poor:
        what = f"the capture leaves a heading error of {to_deg(sd):.2g}° (1 sd)."
        reasons.append(Reason("ill-conditioned", what, "Turn the unit through all attitudes: each face and edge up."))
    found = (unequal(fit.matrix), wrong_field(_radius(fit.matrix), strength))
    return reasons + [reason for reason in found if reason is not None]


def _remarks(fit: DipFit, strength: float | None, size: float, stride: int) -> tuple[str, ...]:
    told = [
        f"Dip of the field: {to_deg(fit.dip):.2f} ± {to_deg(fit.dip_sd):.2g}°; "
        f"the magnetometer is turned by {to_deg(turn_of(fit.matrix)):.2g}° against the accelerometer.",
        f"Noise: {fit.mag_sd:.2g} µT of the field, {to_deg(fit.down_sd):.2g}° of the vertical.",
    ]
    if strength is None:
        told.append(f"Field strength: {size:.4g} µT, the sensor's own scale; only the directions are calibrated.")
    if stride > 1:
        told.append(f"Of the samples, each {stride}th was fitted.")
    if (count := int(np.count_nonzero(~fit.used))) > 0:
        told.append(f"{count} of {len(fit.used)} samples were set aside as outliers.")
    return tuple(told)
