"""Magnetometer of a vehicle that only turns level: an ellipse in two axes, for headings while level."""

import math
from typing import Final

import numpy as np

from plumbob.calibration.autocorrelation import alike
from plumbob.calibration.ellipsoid_fit import Ellipsoid, NormFit, Shape, fit_norm, mean_radius, scaled
from plumbob.calibration.fit import CaptureRefusedError, Fitted, Reason, refuse
from plumbob.calibration.mag import checks
from plumbob.calibration.mag.checks import Doubt, FieldEstimate
from plumbob.calibration.mag.field_gradient import Unevenness
from plumbob.calibration.predicted import heading_sd
from plumbob.core.check import Floats
from plumbob.core.findings import Note, info, warning
from plumbob.core.units import deg, to_deg

WIDEST_GAP: Final = deg(90.0)
"""Largest gap between the headings that were seen, rad."""

LEANING: Final = deg(10.0)
"""Inclination above which a unit is not level, rad."""

_FEWEST: Final = 4 * Shape.ELLIPSE.value
_WEAKEST: Final = 2.0  # µT of level field, of which nobody can tell a heading
_THICKEST: Final = 0.1  # scatter over radius
_ADVICE: Final = "Drive a full circle or more on level ground, away from iron."


def fit_ellipse(points: Floats) -> NormFit | None:
    """Fit an ellipse to more than five finite points (N, 2); None where none comes out."""
    middle, size = points.mean(axis=0), math.sqrt(float(np.sum(np.var(points, axis=0))))
    if not size > 0.0:
        return None
    start = Ellipsoid(np.append(middle, 0.0), np.eye(3) / size)
    fit = fit_norm(np.insert(points, 2, 0.0, axis=1), Shape.ELLIPSE, start)
    if fit is not None:
        fit.ellipsoid.shape[2, 2] = 1.0  # the upright axis stays as measured
    return fit


def fit_mag_level(
    mag: Floats, *, acc: Floats | None = None, strength: float | None = None, dip: float | None = None
) -> Fitted:
    """Fit an ellipse to the two level axes; the third stays as measured.

    Errors as of `fit_mag`.

    Parameters
    ----------
    mag : ndarray (N, 3)
        Measured field, µT, in order of time; finite.
    acc : ndarray (N, 3), optional
        Specific force at the same instants, m/s², finite: it shows which axis is upright, else the one
        along which the field changed least, and whether the unit was level.
    strength, dip : float, optional
        Strength of the field at the place, µT, and its dip, rad: both together give the level field. Without them, the
        sensor's own scale is kept on average.
    """
    checks.require_figures(strength=strength, dip=dip)
    mag = checks.finite_rows("mag", mag)
    acc = None if acc is None else checks.forces(acc, len(mag))
    if len(mag) < _FEWEST:
        refuse([Reason("too-few", f"{len(mag)} samples, but {_FEWEST} are needed.", _ADVICE)])
    axis = _upright(mag, acc)
    order = [*(i for i in range(3) if i != axis), axis]
    points = mag[:, order[:2]]
    fit = fit_ellipse(points)
    if fit is None:
        raise CaptureRefusedError(Reason("too-few-regions", "no ellipse fits the field of the level axes.", _ADVICE))
    shape, wanted = fit.ellipsoid.shape, None if strength is None or dip is None else strength * math.cos(dip)
    radius = mean_radius(shape, axes=2)
    shared = alike(fit.residuals, (points - fit.ellipsoid.centre[:2]) @ shape[:2, :2], fit.used)
    matrix, independent = scaled(fit, wanted, alike=1.0)
    sd, even = (
        heading_sd(
            matrix, c * independent, size=(wanted or radius) / math.cos(checks.DIP), dip=checks.DIP, tilt_range=0.0
        )
        for c in (shared.factor, shared.memory)
    )
    doubt = Doubt.from_fit(sd, even, Unevenness(), shared)
    back = np.argsort(order)
    rows = np.concatenate((back, 3 + (3 * back[:, np.newaxis] + back).ravel()))
    estimate = FieldEstimate(
        matrix[np.ix_(back, back)], fit.ellipsoid.centre[back], (shared.factor * independent)[np.ix_(rows, rows)],
        fit.residuals, fit.used, radius, fit.condition, wanted, solid=False,
    )  # fmt: skip
    axes = " and ".join("xyz"[i] for i in order[:2])
    return estimate.finished(
        mag,
        sd,
        tilt_range=0.0,
        method=f"magnetometer level only: ellipse of {axes}, {fit.shape.value} parameters",
        reasons=_reasons(fit, points, radius, doubt),
        remarks=(*_remarks(axis, radius, wanted), *estimate.remarks(), *checks.uneven_told(doubt)),
    )


def _upright(mag: Floats, acc: Floats | None) -> int:
    """Axis that stood upright."""
    if acc is None:
        return int(np.argmin(mag.std(axis=0)))
    mean = acc.mean(axis=0)
    axis = int(np.argmax(np.abs(mean)))
    lean = math.acos(min(1.0, abs(float(mean[axis])) / float(np.linalg.norm(mean))))
    along = np.median(np.abs(acc[:, axis]) / np.linalg.norm(acc, axis=1))
    worst = max(lean, math.acos(min(1.0, float(along))))
    if worst > LEANING:
        what = f"the unit leaned by {to_deg(worst):.0f}° from its {'xyz'[axis]} axis upright; 10° may be."
        refuse([Reason("not-level", what, "Stay on level ground, or use a fit of all three axes.")])
    return axis


def _gap(fit: NormFit, points: Floats) -> float:
    """Largest angle without a sample, rad."""
    x, y = ((points[fit.used] - fit.ellipsoid.centre[:2]) @ fit.ellipsoid.shape[:2, :2]).T
    course = np.sort(np.arctan2(y, x))
    return float(np.diff(course, append=course[0] + 2.0 * np.pi).max())


def _reasons(fit: NormFit, points: Floats, radius: float, doubt: Doubt) -> tuple[Reason | None, ...]:
    return (
        _open(_gap(fit, points)),
        _thick(float(np.sqrt(np.mean(fit.residuals[fit.used] ** 2))) / radius),
        checks.outliers(fit.used, checks.STEEL),
        checks.uncertain(doubt, _ADVICE),
        *checks.where_known(doubt.sd, _weak(radius), checks.unequal(fit.ellipsoid.shape[:2, :2])),
    )


def _open(gap: float) -> Reason | None:
    if gap <= WIDEST_GAP:
        return None
    what = f"headings cover {360.0 - to_deg(gap):.0f}°; 270° are needed."
    return Reason("too-few-regions", what, _ADVICE)


def _thick(scatter: float) -> Reason | None:
    if scatter <= _THICKEST:
        return None
    what = f"the field of the level axes scatters by {100.0 * scatter:.0f} % of its size about the ellipse."
    return Reason("not-level", what, "Stay on level ground, or use a fit of all three axes.")


def _weak(radius: float) -> Reason | None:
    if _WEAKEST <= radius <= checks.STRONGEST:
        return None
    what = f"the level field measures {radius:.3g} µT; {_WEAKEST:g} to {checks.STRONGEST:g} µT can be."
    return Reason("wrong-field", what, "Check the unit and the gain of the magnetometer.")


def _remarks(axis: int, radius: float, wanted: float | None) -> tuple[Note, ...]:
    scale = () if wanted is not None else (info("calibration.level_field", radius=radius),)
    only = warning("calibration.only_level", axis="xyz"[axis], per_degree=to_deg(10.0 * deg(1.0) / radius))
    return (only, info("calibration.upright_turn"), *scale)
