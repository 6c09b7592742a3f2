"""Magnetometer of a vehicle that only turns level: an ellipse in two axes, for headings while level.

Maximum likelihood of an ellipse: two axes of a magnetometer that is only turned about the third.

The model is ``|T (m − b)| = 1`` with T symmetric, 2 × 2, and what is squared and summed is the distance from the
ellipse, its derivatives taken at the nearest point of the ellipse. Large residuals are weighted down as of a Cauchy
distribution first; what then is an outlier is set aside, and the rest is fitted by plain least squares.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.autocorrelation import alike
from plumbob.calibration.ellipsoid_fit import CAUCHY, FALSE_ALARM, MAD
from plumbob.calibration.fit import CaptureRefusedError, Fitted, Reason, invert, refuse
from plumbob.calibration.mag.checks import (
    DIP,
    STEEL,
    STRONGEST,
    Doubt,
    finite_rows,
    forces,
    mag_calibration,
    outliers,
    require_figures,
    set_aside,
    uncertain,
    unequal,
    uneven_told,
    where_known,
)
from plumbob.calibration.mag.field_gradient import Unevenness
from plumbob.calibration.predicted import heading_sd
from plumbob.core.check import Floats
from plumbob.core.findings import Note, info, warning
from plumbob.core.units import deg, to_deg

PARAMETERS: Final = 5
"""Centre, and xx, yy, xy of T."""

_STEPS: Final = 100
_ENOUGH: Final = 1e-4  # of the parameters' standard deviations
_EXACT: Final = 1e-12  # of the ellipse's size, where there is no noise


class EllipseFit(NamedTuple):
    """Fit of an ellipse.

    Attributes
    ----------
    centre, shape : ndarray (2,), (2, 2)
        b, in the unit of the measurement, and T, its inverse unit.
    covariance : ndarray (5, 5)
        Of b and of xx, yy, xy of T.
    residuals : ndarray (N,)
        Distances, positive outward.
    used : ndarray (N,) of bool
        False for outliers.
    condition : float
        Of the normal matrix scaled to a diagonal of one.
    """

    centre: Floats
    shape: Floats
    covariance: Floats
    residuals: Floats
    used: NDArray[np.bool_]
    condition: float


def fit_ellipse(points: Floats) -> EllipseFit | None:
    """Fit an ellipse to more than five finite points (N, 2); None where none comes out."""
    middle = points.mean(axis=0)
    size = math.sqrt(float(np.mean(np.sum((points - middle) ** 2, axis=1))))
    start = _algebraic((points - middle) / size) if size > 0.0 else None
    if start is None:
        return None
    scaled = (points - middle) / size
    used = np.ones(len(points), dtype=np.bool_)
    p, _ = _minimum(start, scaled, used, robust=True)
    used = _likely(_residuals(p, scaled)[0])
    p, settled = _minimum(p, scaled, used)
    free = int(np.count_nonzero(used)) - PARAMETERS
    if not settled or free < 1 or not np.linalg.eigvalsh(_matrix(p))[0] > 0.0:
        return None
    residuals, rows = _residuals(p, scaled)
    inverse = invert(rows[used].T @ rows[used])
    back = np.array([size, size, 1.0 / size, 1.0 / size, 1.0 / size])
    variance = float(residuals[used] @ residuals[used]) / free
    return EllipseFit(
        middle + size * p[:2],
        _matrix(p) / size,
        variance * inverse.matrix * np.outer(back, back),
        residuals * size,
        used,
        inverse.condition,
    )


def _algebraic(points: Floats) -> Floats | None:
    """Parameters (5,) of the conic of least squares; None where it is no ellipse."""
    x, y = points.T
    rows = np.column_stack((x * x, y * y, 2.0 * x * y, 2.0 * x, 2.0 * y, np.ones_like(x)))
    a, b, c, d, e, f = np.linalg.eigh(rows.T @ rows)[1][:, 0].tolist()
    form = np.array([[a, c], [c, b]])
    if not a * b > c * c:
        return None
    centre = -np.linalg.solve(form, [d, e])
    sizes, axes = np.linalg.eigh(form / float(centre @ form @ centre - f))
    if not (sizes > 0.0).all():
        return None
    shape = (axes * np.sqrt(sizes)) @ axes.T
    return np.array([*centre, shape[0, 0], shape[1, 1], shape[0, 1]])


def _matrix(p: Floats) -> Floats:
    return np.array([[p[2], p[4]], [p[4], p[3]]])


def _residuals(p: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Distances (N,) and their derivatives (N, 5) at the nearest points."""
    matrix = _matrix(p)
    arm = points - p[:2]
    u = arm @ matrix
    size = np.linalg.norm(u, axis=1, keepdims=True)
    n = u / size
    gradient = n @ matrix
    slope = np.linalg.norm(gradient, axis=1, keepdims=True)
    distance = (size - 1.0) / slope
    (x, y), (a, b) = (arm - distance * gradient / slope).T, n.T
    rows = np.column_stack((-gradient, a * x, b * y, a * y + b * x)) / slope
    return distance[:, 0], rows


def _minimum(p: Floats, points: Floats, used: NDArray[np.bool_], *, robust: bool = False) -> tuple[Floats, bool]:
    """Parameters (5,) of least cost, and whether the steps settled."""
    for _ in range(_STEPS):
        residuals, rows = (values[used] for values in _residuals(p, points))
        sd = max(MAD * float(np.median(np.abs(residuals))), _EXACT)
        weight = 1.0 / (1.0 + (residuals / (CAUCHY * sd)) ** 2) if robust else np.ones_like(residuals)  # [Holland1977]
        weighted = rows * weight[:, np.newaxis]
        normal = weighted.T @ rows
        step = -np.linalg.lstsq(normal, weighted.T @ residuals, rcond=None)[0]
        p = p + step
        if not np.isfinite(p).all():
            return p, False
        if math.sqrt(float(step @ normal @ step)) < _ENOUGH * sd + _EXACT:
            return p, True
    return p, False


def _likely(residuals: Floats) -> NDArray[np.bool_]:
    """Samples (N,) that noise explains."""
    from scipy.stats import t

    free = max(1, len(residuals) - PARAMETERS)
    sd = max(MAD * float(np.median(np.abs(residuals))) * math.sqrt(len(residuals) / free), _EXACT)
    return np.asarray(np.abs(residuals) <= float(t.ppf(1.0 - 0.5 * FALSE_ALARM / len(residuals), free)) * sd)


WIDEST_GAP: Final = deg(90.0)
"""Largest gap between the headings that were seen, rad."""

LEANING: Final = deg(10.0)
"""Inclination above which a unit is not level, rad."""

_FEWEST: Final = 4 * PARAMETERS
_WEAKEST: Final = 2.0  # µT of level field, of which nobody can tell a heading
_THICKEST: Final = 0.1  # scatter over radius
_ADVICE: Final = "Drive a full circle or more on level ground, away from iron."


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
    require_figures(strength=strength, dip=dip)
    mag = finite_rows("mag", mag)
    acc = None if acc is None else forces(acc, len(mag))
    if len(mag) < _FEWEST:
        refuse([Reason("too-few", f"{len(mag)} samples, but {_FEWEST} are needed.", _ADVICE)])
    axis = _upright(mag, acc)
    level = [i for i in range(3) if i != axis]
    fit = fit_ellipse(mag[:, level])
    if fit is None:
        raise CaptureRefusedError(Reason("too-few-regions", "no ellipse fits the field of the level axes.", _ADVICE))
    radius = float(1.0 / np.sqrt(np.linalg.det(fit.shape)))
    wanted = None if strength is None or dip is None else strength * math.cos(dip)
    directions = (mag[:, level] - fit.centre) @ fit.shape
    shared = alike(fit.residuals, directions, fit.used)
    matrix, independent = _model(fit, level, wanted)
    covariance = shared.factor * independent
    sd, even = (
        _level_sd(matrix, c, [*level, axis], size=wanted or radius) for c in (covariance, independent * shared.memory)
    )
    doubt = Doubt.from_fit(sd, even, Unevenness(), shared)
    refuse(_reasons(fit, mag[:, level], radius, doubt))
    bias = np.zeros(3)
    bias[level] = fit.centre
    calibration = mag_calibration(
        matrix=matrix,
        bias=bias,
        covariance=covariance,
        residuals=fit.residuals,
        used=fit.used,
        radius=radius,
        strength=wanted,
        method=f"magnetometer level only: ellipse of {' and '.join('xyz'[i] for i in level)}, {PARAMETERS} parameters",
        condition=fit.condition,
        heading_sd=sd,
        tilt_range=0.0,
    )
    return Fitted(
        calibration, mag, fit.residuals, fit.used, (*_remarks(fit, axis, radius, wanted), *uneven_told(doubt))
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


def _model(fit: EllipseFit, level: list[int], wanted: float | None) -> tuple[Floats, Floats]:
    """Matrix (3, 3) and covariance (12, 12) of bias and matrix; the upright axis as measured."""
    size = wanted or float(1.0 / np.sqrt(np.linalg.det(fit.shape)))
    matrix = np.eye(3)
    matrix[np.ix_(level, level)] = size * fit.shape
    i, j = level
    jacobian = np.zeros((12, PARAMETERS))
    jacobian[i, 0] = jacobian[j, 1] = 1.0
    for column, (a, b) in enumerate(((0, 0), (1, 1), (0, 1)), start=2):
        change = np.zeros((2, 2))
        change[a, b] = change[b, a] = 1.0
        scale = 0.0 if wanted else float(np.trace(np.linalg.solve(fit.shape, change))) / 2.0
        entry = size * (change - scale * fit.shape)
        for row, col, value in ((i, i, entry[0, 0]), (j, j, entry[1, 1]), (i, j, entry[0, 1]), (j, i, entry[1, 0])):
            jacobian[3 + 3 * row + col, column] = value
    return matrix, jacobian @ fit.covariance @ jacobian.T


def _level_sd(matrix: Floats, covariance: Floats, order: list[int], *, size: float) -> float:
    """Standard deviation of the heading while level, rad; `order` names the axes, the upright one last."""
    rows = np.concatenate((order, 3 + (3 * np.array(order)[:, np.newaxis] + order).ravel()))
    placed = matrix[np.ix_(order, order)], covariance[np.ix_(rows, rows)]
    return heading_sd(*placed, size=size / math.cos(DIP), dip=DIP, tilt_range=0.0)


def _gap(fit: EllipseFit, points: Floats) -> float:
    """Largest angle without a sample, rad."""
    x, y = ((points[fit.used] - fit.centre) @ fit.shape).T
    course = np.sort(np.arctan2(y, x))
    return float(np.diff(course, append=course[0] + 2.0 * np.pi).max())


def _reasons(fit: EllipseFit, points: Floats, radius: float, doubt: Doubt) -> list[Reason]:
    scatter = float(np.sqrt(np.mean(fit.residuals[fit.used] ** 2))) / radius
    reasons = [
        _open(_gap(fit, points)),
        _thick(scatter),
        outliers(fit.used, STEEL),
        uncertain(doubt, _ADVICE),
        *where_known(doubt.sd, _weak(radius), unequal(fit.shape)),
    ]
    return [reason for reason in reasons if reason is not None]


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
    if _WEAKEST <= radius <= STRONGEST:
        return None
    what = f"the level field measures {radius:.3g} µT; {_WEAKEST:g} to {STRONGEST:g} µT can be."
    return Reason("wrong-field", what, "Check the unit and the gain of the magnetometer.")


def _remarks(fit: EllipseFit, axis: int, radius: float, wanted: float | None) -> tuple[Note, ...]:
    per_degree = to_deg(10.0 * deg(1.0) / radius)
    remarks: list[Note] = [
        warning("calibration.only_level", axis="xyz"[axis], per_degree=per_degree),
        info("calibration.upright_turn"),
    ]
    if wanted is None:
        remarks.append(info("calibration.level_field", radius=radius))
    return (*remarks, *set_aside(fit.used))
