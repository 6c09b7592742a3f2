"""Maximum likelihood of a triad that measures a vector of one length in many directions: gravity, or the Earth's field.

The model is ``|T (m − b)| = 1`` with T symmetric: length alone cannot tell a rotation of the triad. What is squared and
summed is the orthogonal distance of each sample from the ellipsoid, ``(|T (m − b)| − 1) / |T n|``, n the direction of
T (m − b): an error in the unit of the measurement, whose noise is the same all around. Dividing by the gradient also
removes the false minimum T → 0, b → ∞ of the plain norm. Large errors are weighted down as of a Cauchy distribution,
with the weights and the constant of 95 % efficiency of [Holland1977]; what then is an outlier is set aside, and the
rest is fitted by plain least squares, so that the covariance means what it says.
"""

from enum import Enum
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob._jit import njit
from plumbob.calib.ellipsoid.deletion import outlying
from plumbob.calib.ellipsoid.quadric import Ellipsoid
from plumbob.calib.normal import inverse_of
from plumbob.check import Floats

CAUCHY: Final = 2.385
"""Constant of 95 % efficiency on normal errors [Holland1977]."""

FALSE_ALARM: Final = 1e-3
"""Probability that a capture without outliers loses a sample."""

MAD: Final = 1.482602218505602  # standard deviation over median absolute deviation of a normal distribution
_STEPS: Final = 200
_SOME: Final = 20_000  # samples on which outliers are told and a start is found; the result is that of all
_FEW: Final = 60  # samples up to which outliers are told by trying all groups of them
_ROUNDS: Final = 6
_ROUND: Final = 20
_ENOUGH: Final = 1e-5  # of the parameters' standard deviations
_EXACT: Final = 1e-13  # of the vectors' size, where there is no noise


class Shape(Enum):
    """What the ellipsoid may be; the value is the number of parameters, three of them for the centre."""

    SPHERE = 4
    AXES = 6
    ELLIPSOID = 9


_SYMMETRIC: Final = {  # columns: parameters; rows: xx, yy, zz, xy, xz, yz of T
    Shape.SPHERE: np.array([[1.0], [1.0], [1.0], [0.0], [0.0], [0.0]]),
    Shape.AXES: np.eye(6)[:, :3],
    Shape.ELLIPSOID: np.eye(6),
}


class NormFit(NamedTuple):
    """Fit of a shape.

    Attributes
    ----------
    shape : Shape
        What was fitted.
    ellipsoid : Ellipsoid
        Centre b, in the unit of the measurement, and T, its inverse unit.
    covariance : ndarray (9, 9)
        Of b and of xx, yy, zz, xy, xz, yz of T; zero for what the shape has not.
    sd : float
        Standard deviation of the residuals, parameters counted, unit of the measurement.
    residuals : ndarray (N,)
        Orthogonal distances, positive outward.
    used : ndarray (N,) of bool
        False for outliers.
    condition : float
        Of the normal matrix scaled to a diagonal of one.
    cost : float
        Sum of the squares of the residuals that are used.
    """

    shape: Shape
    ellipsoid: Ellipsoid
    covariance: Floats
    sd: float
    residuals: Floats
    used: NDArray[np.bool_]
    condition: float
    cost: float


@njit
def accumulate(
    points: Floats, p: Floats, soft: float, use: NDArray[np.bool_], residuals: Floats, normal: Floats
) -> float:
    """Residuals (N,) and the normal equations (9, 10) of a step from p (9,); gives the cost.

    `soft` is the size of Cauchy's weights, or infinite for plain least squares.
    """
    normal[:] = 0.0
    cost = 0.0
    bx, by, bz, xx, yy, zz, xy, xz, yz = p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7], p[8]
    row = np.empty(9)
    for i in range(points.shape[0]):
        dx, dy, dz = points[i, 0] - bx, points[i, 1] - by, points[i, 2] - bz
        ux = xx * dx + xy * dy + xz * dz
        uy = xy * dx + yy * dy + yz * dz
        uz = xz * dx + yz * dy + zz * dz
        size = np.sqrt(ux * ux + uy * uy + uz * uz)
        nx, ny, nz = ux / size, uy / size, uz / size
        gx = xx * nx + xy * ny + xz * nz
        gy = xy * nx + yy * ny + yz * nz
        gz = xz * nx + yz * ny + zz * nz
        slope = np.sqrt(gx * gx + gy * gy + gz * gz)
        r = (size - 1.0) / slope
        residuals[i] = r
        if not use[i]:
            continue
        wx, wy, wz = gx / slope, gy / slope, gz / slope
        tx = xx * wx + xy * wy + xz * wz
        ty = xy * wx + yy * wy + yz * wz
        tz = xz * wx + yz * wy + zz * wz
        along = tx * nx + ty * ny + tz * nz
        # r depends on the parameters through T (m − b), whose length and direction both count, and through T itself
        ax, ay, az = (
            nx - r * (tx - along * nx) / size,
            ny - r * (ty - along * ny) / size,
            nz - r * (tz - along * nz) / size,
        )
        row[0] = -(xx * ax + xy * ay + xz * az) / slope
        row[1] = -(xy * ax + yy * ay + yz * az) / slope
        row[2] = -(xz * ax + yz * ay + zz * az) / slope
        row[3] = (ax * dx - r * wx * nx) / slope
        row[4] = (ay * dy - r * wy * ny) / slope
        row[5] = (az * dz - r * wz * nz) / slope
        row[6] = (ax * dy + ay * dx - r * (wx * ny + wy * nx)) / slope
        row[7] = (ax * dz + az * dx - r * (wx * nz + wz * nx)) / slope
        row[8] = (ay * dz + az * dy - r * (wy * nz + wz * ny)) / slope
        ratio = r / soft
        weight = 1.0 / (1.0 + ratio * ratio)
        cost += r * r if soft == np.inf else soft * soft * np.log1p(ratio * ratio)
        for j in range(9):
            scaled = weight * row[j]
            for k in range(j + 1):
                normal[j, k] += scaled * row[k]
            normal[j, 9] += scaled * r
    return cost


def fit_norm(
    vectors: Floats, shape: Shape, start: Ellipsoid, *, robust: bool = True, noise: float = 0.0
) -> NormFit | None:
    """Fit a shape; None where no ellipsoid comes out.

    Parameters
    ----------
    vectors : ndarray (N, 3)
        Measured vectors, finite, more than `shape.value` of them; as many do where `noise` is known.
    shape : Shape
        What to fit.
    start : Ellipsoid
        Where to start, such as `quadric.fit_quadric` gives.
    robust : bool
        Whether outliers are looked for.
    noise : float
        Known standard deviation of a vector's length: a smaller one of the residuals is luck.
    """
    middle, size = start.centre, 3.0 / float(np.trace(start.shape))
    points = np.ascontiguousarray((vectors - middle) / size)
    descent = _Descent(points, shape, _parameters(start.shape * size))
    if robust and len(points) <= _FEW:
        descent.set_aside_groups()
    elif robust:
        some = _Descent(np.ascontiguousarray(points[:: max(1, len(points) // _SOME)]), shape, descent.p)
        for _ in range(_ROUNDS):  # the scale of the weights settles with the fit
            some.run(CAUCHY * some.scale(), steps=_ROUND)
        descent.p = some.p
        descent.set_aside()
    return descent.result(middle, size, noise) if descent.run(np.inf) else None


def linearised(vectors: Floats, ellipsoid: Ellipsoid) -> tuple[Floats, Floats]:
    """Derivatives (N, 9) of the orthogonal distances by centre and shape, and the distances (N,), near an ellipsoid."""
    centre, shape = ellipsoid
    arm = vectors - centre
    inside = arm @ shape
    size = np.linalg.norm(inside, axis=1, keepdims=True)
    n = inside / size
    gradient = n @ shape
    slope = np.linalg.norm(gradient, axis=1, keepdims=True)
    (x, y, z), (a, b, c) = arm.T, n.T
    bend = np.stack((a * x, b * y, c * z, a * y + b * x, a * z + c * x, b * z + c * y), axis=1)
    return np.hstack((-gradient, bend)) / slope, ((size - 1.0) / slope)[:, 0]


class _Descent:
    """Levenberg's and Marquardt's steps in the space of a shape's parameters."""

    def __init__(self, points: Floats, shape: Shape, start: Floats) -> None:
        self.points, self.shape, self.p = points, shape, start
        self.used = np.ones(len(points), dtype=np.bool_)
        self.residuals, self.normal = np.empty(len(points)), np.empty((9, 10))
        space = np.zeros((9, shape.value))
        space[:3, :3] = np.eye(3)
        space[3:, 3:] = _SYMMETRIC[shape]
        self.space = space
        self.p = space @ np.linalg.lstsq(space, start, rcond=None)[0]

    def run(self, soft: float, *, steps: int = _STEPS) -> bool:
        """Go to the minimum; False where it was not reached."""
        self.cost, damping = self._at(self.p, soft), 1e-6
        for _ in range(steps):
            a, g = self._equations()
            step = -np.linalg.lstsq(a + damping * np.diag(np.diag(a)), g, rcond=None)[0]
            if float(np.sqrt(step @ a @ step)) < _ENOUGH * np.sqrt(self.cost / len(self.points)) + _EXACT:
                return True
            trial, kept = self.p + self.space @ step, self.normal.copy()
            cost = self._at(trial, soft) if _is_shape(trial) else np.inf
            if cost < self.cost:
                self.p, self.cost, damping = trial, cost, max(0.1 * damping, 1e-12)
            else:
                self.normal[:], damping = kept, 10.0 * max(damping, 1e-6)
        return False

    def scale(self) -> float:
        """Standard deviation of the residuals by their median, parameters counted."""
        self._at(self.p, np.inf)
        free = max(1, len(self.points) - self.shape.value)
        typical = MAD * float(np.median(np.abs(self.residuals)))
        return max(typical * float(np.sqrt(len(self.points) / free)), 1e-12)

    def set_aside(self) -> None:
        """Mark as outliers what no normal error of this scale explains."""
        scale = self.scale()
        self.used = np.abs(self.residuals) <= self._limit(len(self.points) - self.shape.value) * scale

    def set_aside_groups(self) -> None:
        """Mark outliers among few samples, of which a median says little: each pulls the fit to itself."""
        while self.run(np.inf):
            kept = np.flatnonzero(self.used)
            rows, left = linearised(self.points[kept], Ellipsoid(self.p[:3], _matrix(self.p[3:])))
            worst = outlying(rows @ self.space, left, false_alarm=FALSE_ALARM, rounding=_EXACT)
            if not worst.size:
                return
            self.used[kept[worst]] = False

    def _limit(self, free: int) -> float:
        """Residual over its standard deviation that one of all samples exceeds by chance with `FALSE_ALARM`."""
        from scipy.stats import t

        return float(t.ppf(1.0 - 0.5 * FALSE_ALARM / len(self.points), max(1, free)))

    def result(self, middle: Floats, size: float, noise: float) -> NormFit | None:
        """Take the scaling back."""
        self.cost = self._at(self.p, np.inf)
        a, _ = self._equations()
        free = int(np.count_nonzero(self.used)) - self.shape.value
        if free < 0 or (free == 0 and not noise > 0.0):
            return None
        inverse = inverse_of(a)
        sd = max(noise / size, float(np.sqrt(self.cost / free)) if free else 0.0)
        back = np.concatenate((np.full(3, size), np.full(6, 1.0 / size)))
        cov = self.space @ inverse.matrix @ self.space.T
        return NormFit(
            self.shape,
            Ellipsoid(middle + size * self.p[:3], _matrix(self.p[3:]) / size),
            sd * sd * cov * np.outer(back, back),
            float(sd * size),
            self.residuals * size,
            self.used,
            inverse.condition,
            float(self.cost * size * size),
        )

    def _at(self, p: Floats, soft: float) -> float:
        return accumulate(self.points, p, soft, self.used, self.residuals, self.normal)

    def _equations(self) -> tuple[Floats, Floats]:
        """Normal matrix and gradient of the shape's own parameters."""
        lower = np.tril(self.normal[:, :9])
        whole = lower + np.tril(lower, -1).T
        return self.space.T @ whole @ self.space, self.space.T @ self.normal[:, 9]


def _parameters(shape: Floats) -> Floats:
    """Parameters (9,) of a symmetric matrix about the origin."""
    return np.concatenate((np.zeros(3), np.diag(shape), [shape[0, 1], shape[0, 2], shape[1, 2]]))


def _matrix(t: Floats) -> Floats:
    """Symmetric matrix of xx, yy, zz, xy, xz, yz."""
    xx, yy, zz, xy, xz, yz = t.tolist()
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _is_shape(p: Floats) -> bool:
    return bool(np.isfinite(p).all() and np.linalg.eigvalsh(_matrix(p[3:]))[0] > 0.0)
