"""Maximum likelihood of an ellipse: two axes of a magnetometer that is only turned about the third.

The model is ``|T (m − b)| = 1`` with T symmetric, 2 × 2, and what is squared and summed is the distance from the
ellipse, its derivatives taken at the nearest point of the ellipse. Large residuals are weighted down as of a Cauchy
distribution first; what then is an outlier is set aside, and the rest is fitted by plain least squares.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.calib.ellipsoid.norm_fit import CAUCHY, FALSE_ALARM, MAD
from plumbob.calib.normal import inverse_of
from plumbob.check import Floats

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
    """Fit an ellipse; None where none comes out.

    Parameters
    ----------
    points : ndarray (N, 2)
        Measured vectors, finite, more than five.
    """
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
    left, rows = _residuals(p, scaled)
    inverse = inverse_of(rows[used].T @ rows[used])
    back = np.array([size, size, 1.0 / size, 1.0 / size, 1.0 / size])
    variance = float(left[used] @ left[used]) / free
    return EllipseFit(
        middle + size * p[:2],
        _matrix(p) / size,
        variance * inverse.matrix * np.outer(back, back),
        left * size,
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
    left = (size - 1.0) / slope
    (x, y), (a, b) = (arm - left * gradient / slope).T, n.T
    rows = np.column_stack((-gradient, a * x, b * y, a * y + b * x)) / slope
    return left[:, 0], rows


def _minimum(p: Floats, points: Floats, used: NDArray[np.bool_], *, robust: bool = False) -> tuple[Floats, bool]:
    """Parameters (5,) of least cost, and whether the steps settled."""
    for _ in range(_STEPS):
        left, rows = (values[used] for values in _residuals(p, points))
        sd = max(MAD * float(np.median(np.abs(left))), _EXACT)
        weight = 1.0 / (1.0 + (left / (CAUCHY * sd)) ** 2) if robust else np.ones_like(left)
        weighted = rows * weight[:, np.newaxis]
        normal = weighted.T @ rows
        step = -np.linalg.lstsq(normal, weighted.T @ left, rcond=None)[0]
        p = p + step
        if not np.isfinite(p).all():
            return p, False
        if math.sqrt(float(step @ normal @ step)) < _ENOUGH * sd + _EXACT:
            return p, True
    return p, False


def _likely(left: Floats) -> NDArray[np.bool_]:
    """Samples (N,) that noise explains."""
    from scipy.stats import t

    free = max(1, len(left) - PARAMETERS)
    sd = max(MAD * float(np.median(np.abs(left))) * math.sqrt(len(left) / free), _EXACT)
    return np.asarray(np.abs(left) <= float(t.ppf(1.0 - 0.5 * FALSE_ALARM / len(left), free)) * sd)
