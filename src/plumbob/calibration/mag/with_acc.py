"""Magnetometer beside an accelerometer at rest or in slow motion: the whole matrix, its turn in the case included."""

import math
from typing import Final

import numpy as np

from plumbob.calibration.ellipsoid.autocorrelation import alike
from plumbob.calibration.ellipsoid.ellipsoid_fit import Shape
from plumbob.calibration.ellipsoid.scale import radius_of, to_size
from plumbob.calibration.fit import Fitted
from plumbob.calibration.mag.alone import fit_mag
from plumbob.calibration.mag.arguments import (
    finite_rows,
    forces,
    require_strength,
    require_tilt_range,
    unequal,
    wrong_field,
)
from plumbob.calibration.mag.dip_fit import PARAMETERS, DipFit, fit_dip
from plumbob.calibration.mag.field_gradient import unevenness
from plumbob.calibration.mag.outcome import (
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
from plumbob.calibration.predicted import TILT_RANGE, heading_sd
from plumbob.calibration.rejection import CaptureRefusedError, Reason, refuse
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.text import measured
from plumbob.core.units import deg, to_deg

FEWEST: Final = PARAMETERS + 1
"""Fewest samples or poses."""

UNSTEADY: Final = deg(5.0)
"""Scatter of the vertical from which on the accelerometer did not measure gravity, rad."""

_GRAVITY: Final = 0.1  # departure of gravity, of itself
_SOME: Final = 20_000
_ADVICE: Final = "Hold the unit still in each attitude, or turn it slowly, and capture again."


def fit_mag_acc(mag: Floats, acc: Floats, *, strength: float | None = None, tilt_range: float = TILT_RANGE) -> Fitted:
    """Fit bias and full matrix so that the field has one strength and one dip.

    The vertical of the accelerometer shows what the length of the field cannot: how the magnetometer is turned against
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
    ShapeError
        If samples are not finite, or not as many of both sensors.
    ParameterError
        If another argument is outside its range.
    """
    require_strength(strength)
    require_tilt_range(tilt_range)
    mag = finite_rows("mag", mag)
    acc = forces(acc, len(mag))
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
    directions, radius = (points - fit.centre) @ fit.matrix.T, radius_of(fit.matrix)
    shared = alike(fit.residuals, directions, fit.used)
    field = unevenness(fit.residuals[:, 0], directions, fit.used, lengths=False)
    matrix, independent = to_size(fit.matrix, fit.covariance, strength)
    left = fit.residuals[fit.used, 0]
    covariance = field.counted(
        independent, memory=shared.memory, residuals=left, matrix=matrix, radius=radius, turned=False
    )
    size = strength or radius
    sd, even = (
        heading_sd(matrix, c, size=size, dip=fit.dip, tilt_range=tilt_range)
        for c in (covariance, independent * shared.memory)
    )
    doubt = Doubt.of(sd, even, field, shared)
    refuse(_reasons(fit, doubt, strength))
    calibration = calibration_of(
        matrix=matrix,
        bias=fit.centre,
        covariance=covariance,
        residuals=fit.residuals[:, 0],
        used=fit.used,
        radius=radius,
        strength=strength,
        method="magnetometer with accelerometer: ellipsoid, turn and dip, 13 parameters",
        condition=fit.condition,
        heading_sd=sd,
        tilt_range=tilt_range,
        directions=points - fit.centre,
    )
    dip_sd = fit.dip_sd * math.sqrt(shared.memory + field.spread(left))
    remarks = (*_remarks(fit, dip_sd, strength, size, stride), *uneven_told(doubt))
    return Fitted(calibration, points, fit.residuals[:, 0], fit.used, remarks)


def turn_of(matrix: Floats) -> float:
    """Angle of the rotation in a matrix (3, 3), rad."""
    return math.acos(min(1.0, max(-1.0, 0.5 * (float(np.trace(rotation_in(matrix))) - 1.0))))


def rotation_in(matrix: Floats) -> Floats:
    """Rotation (3, 3) in a matrix: the factor that is left beside a symmetric one."""
    u, _, vt = np.linalg.svd(matrix)
    return np.asarray(u @ vt)


def _wrong_gravity(force: Floats) -> list[Reason]:
    typical = float(np.median(force))
    if abs(typical / G0 - 1.0) <= _GRAVITY:
        return []
    what = f"the specific force is {typical:.3g} m/s² in the median, but gravity is {G0:.3g} m/s²."
    return [Reason("wrong-gravity", what, "Check the accelerometer's unit and range, and calibrate it first.")]


def _reasons(fit: DipFit, doubt: Doubt, strength: float | None) -> list[Reason]:
    found = [
        outliers(fit.used, "Move less, and look for moving iron and switched currents nearby."),
        _unsteady(fit.down_sd),
        uncertain(doubt, "Turn the unit through all attitudes: each face and edge up."),
        *where_known(doubt.sd, unequal(fit.matrix), wrong_field(radius_of(fit.matrix), strength)),
    ]
    return [reason for reason in found if reason is not None]


def _unsteady(sd: float) -> Reason | None:
    if sd <= UNSTEADY:
        return None
    what = f"the vertical of the accelerometer scatters by {to_deg(sd):.2g}° about the field's dip."
    return Reason("not-still", what, _ADVICE)


def _remarks(fit: DipFit, dip_sd: float, strength: float | None, size: float, stride: int) -> tuple[str, ...]:
    dip, sd = to_deg(fit.dip), to_deg(dip_sd)
    told = [
        f"Dip of the field [°]: {measured(dip, dip - sd, dip + sd)}; "
        f"the magnetometer is turned by {to_deg(turn_of(fit.matrix)):.2g}° against the accelerometer.",
        f"Noise: {fit.mag_sd:.2g} µT of the field, {to_deg(fit.down_sd):.2g}° of the vertical.",
    ]
    return (*told, *own_scale(strength, size), *thinned(stride), *set_aside(fit.used))
