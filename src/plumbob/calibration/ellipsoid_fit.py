"""The ellipsoid on which samples of one vector lie: start by a quadric, orthogonal distances, outliers.

One by one is not enough: two outliers hide each other, for the misfit that is left without the one is that of the
other. So pairs and threes are tried as well, all of them, in closed form: deleting a set S of samples from a linear
fit with the hat matrix H lowers the sum of squares by e_Sᵀ (I − H_SS)⁻¹ e_S.

Algebraic fits of an ellipsoid to measured vectors: closed forms, from sums alone.

They need no start and cost one pass, and their error is that of noise squared: the maximum likelihood in `norm_fit`
starts from here. The axis-aligned one is the buoy paper's [Yu2018].

Maximum likelihood of a triad that measures a vector of one length in many directions: gravity, or the Earth's field.

The model is ``|T (m − b)| = 1`` with T symmetric: length alone cannot tell a rotation of the triad. What is squared and
summed is the orthogonal distance of each sample from the ellipsoid, ``(|T (m − b)| − 1) / |T n|``, n the direction of
T (m − b): an error in the unit of the measurement, whose noise is the same all around. Dividing by the gradient also
removes the false minimum T → 0, b → ∞ of the plain norm. Large errors are weighted down as of a Cauchy distribution,
with the weights and the constant of 95 % efficiency of [Holland1977]; what then is an outlier is set aside, and the
rest is fitted by plain least squares, so that the covariance means what it says.

Which ellipsoid a capture asks for: the smallest whose misfit noise explains, by an F-test.

Where the axes of the soft iron are those of the sensor, six parameters are better known than nine; where they are not,
six are wrong by degrees. A capture that cannot determine the nine cannot tell either, so the choice is only trusted as
far as the full shape is.
"""

import math
from enum import Enum
from itertools import combinations
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.fit import invert
from plumbob.core.check import Floats
from plumbob.core.kernels import kernel
from plumbob.core.text import p_value


class Ellipsoid(NamedTuple):
    """Vectors m with ``|shape @ (m − centre)| = 1``; `shape` is symmetric and positive definite."""

    centre: Floats
    shape: Floats

    def to_sphere(self, vectors: Floats) -> Floats:
        """Vectors (N, 3) as they lie about the unit sphere that becomes of the ellipsoid."""
        return (vectors - self.centre) @ self.shape


def fit_axes(vectors: Floats) -> Ellipsoid | None:
    """Ellipsoid along the axes, 6 parameters, by least squares of [Yu2018] (13), (14); None where it is none."""
    x, y, z = vectors.T
    rows = np.column_stack((-y * y, -z * z, 2.0 * x, 2.0 * y, 2.0 * z, np.ones_like(x)))  # [Yu2018] (12)
    w, *_ = np.linalg.lstsq(rows, x * x, rcond=None)  # [Yu2018] (13)
    ey2, ez2 = float(w[0]), float(w[1])
    if not (ey2 > 0.0 and ez2 > 0.0):
        return None
    centre = np.array([w[2], w[3] / ey2, w[4] / ez2])  # [Yu2018] (11)
    radius2 = float(w[5] + centre[0] ** 2 + ey2 * centre[1] ** 2 + ez2 * centre[2] ** 2)
    if not radius2 > 0.0:
        return None
    return Ellipsoid(centre, np.diag(np.sqrt(np.array([1.0, ey2, ez2]) / radius2)))  # [Yu2018] (14): with its first /R


@kernel
def square_sums(vectors: Floats, middle: Floats, size: float, sums: Floats) -> None:
    """Add the products of the ten terms of a quadric, of vectors brought to the origin and to length 1, to `sums`."""
    row = np.empty(10)
    for n in range(vectors.shape[0]):
        x, y, z = vectors[n, 0] - middle[0], vectors[n, 1] - middle[1], vectors[n, 2] - middle[2]
        x, y, z = x / size, y / size, z / size
        row[0], row[1], row[2] = x * x, y * y, z * z
        row[3], row[4], row[5] = 2.0 * x * y, 2.0 * x * z, 2.0 * y * z
        row[6], row[7], row[8], row[9] = 2.0 * x, 2.0 * y, 2.0 * z, 1.0
        for j in range(10):
            for k in range(j + 1):
                sums[j, k] += row[j] * row[k]


def fit_quadric(vectors: Floats) -> Ellipsoid | None:
    """General ellipsoid, 9 parameters, by least squares on vectors (N, 3) brought to the origin and to length 1.

    Without that, the constraint of the fit depends on where the ellipsoid lies, and captures of small tilt fail.
    """
    middle = vectors.mean(axis=0)
    size = float(np.sqrt(np.mean(np.sum((vectors - middle) ** 2, axis=1))))
    if not size > 0.0:
        return None
    sums = np.zeros((10, 10))
    square_sums(vectors, middle, size, sums)
    a, b, c, d, e, f, g, h, i, k = np.linalg.eigh(sums)[1][:, 0].tolist()  # eigh reads the lower triangle
    form = np.array([[a, d, e], [d, b, f], [e, f, c]])
    if np.linalg.matrix_rank(form) < 3:
        return None
    centre = -np.linalg.solve(form, [g, h, i])
    level = float(centre @ form @ centre - k)
    sizes, axes = np.linalg.eigh(form / level if level else form)
    if not (sizes > 0.0).all():
        return None
    return Ellipsoid(middle + size * centre, (axes * np.sqrt(sizes)) @ axes.T / size)


CAUCHY: Final = 2.385  # [Holland1977]: of 95 % efficiency on normal errors
FALSE_ALARM: Final = 1e-3  # probability that a capture without outliers loses a sample
MAD: Final = 1.482602218505602  # standard deviation over median absolute deviation of a normal distribution
_STEPS: Final = 200
_SOME: Final = 20_000  # samples on which outliers are told and a start is found; the result is that of all
_FEW: Final = 60  # samples up to which outliers are told by trying all groups of them
_ROUNDS: Final = 6
_ROUND: Final = 20
_ENOUGH: Final = 1e-5  # of the parameters' standard deviations
_EXACT: Final = 1e-13  # of the vectors' size, where there is no noise


class Shape(Enum):
    """What the ellipsoid may be; the value is the number of parameters, three of them for the centre.

    An ellipse lies across the third axis, along which all vectors are zero.
    """

    SPHERE = 4
    ELLIPSE = 5
    AXES = 6
    ELLIPSOID = 9


_ENTRIES: Final = np.array([[3, 6, 7], [6, 4, 8], [7, 8, 5]])  # of T among the parameters: b; xx, yy, zz, xy, xz, yz
_SYMMETRIC: Final = {  # columns: parameters; rows: xx, yy, zz, xy, xz, yz of T
    Shape.SPHERE: np.array([[1.0], [1.0], [1.0], [0.0], [0.0], [0.0]]),
    Shape.AXES: np.eye(6)[:, :3],
    Shape.ELLIPSE: np.eye(6)[:, [0, 1, 3]],
    Shape.ELLIPSOID: np.eye(6),
}


class NormFit(NamedTuple):
    """Fit of a shape."""

    shape: Shape  # what was fitted
    ellipsoid: Ellipsoid  # centre b, in the unit of the measurement, and T, its inverse unit
    covariance: Floats  # (9, 9), of b and of xx, yy, zz, xy, xz, yz of T; zero for what the shape has not
    sd: float  # standard deviation of the residuals, parameters counted, unit of the measurement
    residuals: Floats  # (N,), orthogonal distances, positive outward
    used: NDArray[np.bool_]  # (N,), false for outliers
    condition: float  # of the normal matrix scaled to a diagonal of one
    cost: float  # sum of the squares of the residuals that are used


@kernel
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
        size = math.sqrt(ux * ux + uy * uy + uz * uz)
        nx, ny, nz = ux / size, uy / size, uz / size
        gx = xx * nx + xy * ny + xz * nz
        gy = xy * nx + yy * ny + yz * nz
        gz = xz * nx + yz * ny + zz * nz
        slope = math.sqrt(gx * gx + gy * gy + gz * gz)
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
        weight = 1.0 / (1.0 + ratio * ratio)  # [Holland1977]: weights of Cauchy
        cost += r * r if soft == math.inf else soft * soft * math.log1p(ratio * ratio)
        for j in range(9):
            scaled = weight * row[j]
            for k in range(j + 1):
                normal[j, k] += scaled * row[k]
            normal[j, 9] += scaled * r
    return cost


def fit_norm(
    vectors: Floats, shape: Shape, start: Ellipsoid, *, robust: bool = True, noise: float = 0.0
) -> NormFit | None:
    """Fit a shape to finite vectors (N, 3), more than `shape.value` of them; None where no ellipsoid comes out.

    As many do where `noise`, the standard deviation of a vector's length, is known: a smaller one of the residuals is
    luck. It starts where `fit_quadric` or another fit ends; a `robust` one looks for outliers.
    """
    from scipy.stats import t

    middle, size = start.centre, 3.0 / float(np.trace(start.shape))
    points = np.ascontiguousarray((vectors - middle) / size)
    sides = start.shape * size
    descent = _Descent(points, shape, np.concatenate((np.zeros(3), np.diag(sides), sides[[0, 0, 1], [1, 2, 2]])))
    if robust and len(points) <= _FEW:
        descent.set_aside_groups()
    elif robust:
        some = _Descent(np.ascontiguousarray(points[:: max(1, len(points) // _SOME)]), shape, descent.p)
        for _ in range(_ROUNDS):  # the scale of the weights settles with the fit
            some.run(CAUCHY * some.scale(), steps=_ROUND)
        descent.p, count = some.p, len(points)
        # outliers are what no normal error of this scale explains: one of all would, with `FALSE_ALARM`
        limit = float(t.ppf(1.0 - 0.5 * FALSE_ALARM / count, max(1, count - shape.value))) * descent.scale()
        descent.used = np.abs(descent.residuals) <= limit
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
        self.residuals = np.empty(len(points))
        centre = shape.value - _SYMMETRIC[shape].shape[1]  # of the centre
        self.space = np.zeros((9, shape.value))
        self.space[:centre, :centre] = np.eye(centre)
        self.space[3:, centre:] = _SYMMETRIC[shape]
        fixed = np.zeros(9)
        fixed[5] = float(shape is Shape.ELLIPSE)
        self.p = fixed + self.space @ np.linalg.lstsq(self.space, start, rcond=None)[0]

    def run(self, soft: float, *, steps: int = _STEPS) -> bool:
        """Go to the minimum; False where it was not reached."""
        now, damping = self._evaluate(self.p, soft), 1e-6
        for _ in range(steps):
            cost, a, g = now
            step = -np.linalg.lstsq(a + damping * np.diag(np.diag(a)), g, rcond=None)[0]  # [Marquardt1963]
            if float(np.sqrt(step @ a @ step)) < _ENOUGH * np.sqrt(cost / len(self.points)) + _EXACT:
                return True
            trial = self.p + self.space @ step
            positive = np.isfinite(trial).all() and np.linalg.eigvalsh(trial[_ENTRIES])[0] > 0.0
            if positive and (after := self._evaluate(trial, soft))[0] < cost:
                self.p, now, damping = trial, after, max(0.1 * damping, 1e-12)
            else:
                damping = 10.0 * max(damping, 1e-6)
        return False

    def scale(self) -> float:
        """Standard deviation of the residuals by their median, parameters counted."""
        self._evaluate(self.p, np.inf)
        free = max(1, len(self.points) - self.shape.value)
        typical = MAD * float(np.median(np.abs(self.residuals)))
        return max(typical * float(np.sqrt(len(self.points) / free)), 1e-12)

    def set_aside_groups(self) -> None:
        """Mark outliers among few samples, of which a median says little: each pulls the fit to itself."""
        while self.run(np.inf):
            indices = np.flatnonzero(self.used)
            rows, residuals = linearised(self.points[indices], Ellipsoid(self.p[:3], self.p[_ENTRIES]))
            worst = outlying(rows @ self.space, residuals, false_alarm=FALSE_ALARM, rounding=_EXACT)
            if not worst.size:
                return
            self.used[indices[worst]] = False

    def result(self, middle: Floats, size: float, noise: float) -> NormFit | None:
        """Take the scaling back."""
        cost, a, _ = self._evaluate(self.p, np.inf)
        free = int(np.count_nonzero(self.used)) - self.shape.value
        if free < 0 or (free == 0 and not noise > 0.0):
            return None
        inverse, condition = invert(a)
        sd = max(noise / size, float(np.sqrt(cost / free)) if free else 0.0)
        back = np.concatenate((np.full(3, size), np.full(6, 1.0 / size)))
        cov = self.space @ inverse @ self.space.T
        return NormFit(
            self.shape,
            Ellipsoid(middle + size * self.p[:3], self.p[_ENTRIES] / size),
            sd * sd * cov * np.outer(back, back),
            float(sd * size),
            self.residuals * size,
            self.used,
            condition,
            float(cost * size * size),
        )

    def _evaluate(self, p: Floats, soft: float) -> tuple[float, Floats, Floats]:
        """Cost, normal matrix and gradient of the shape's parameters at p; leaves the residuals."""
        normal = np.empty((9, 10))
        cost = accumulate(self.points, p, soft, self.used, self.residuals, normal)
        lower = np.tril(normal[:, :9])
        return cost, self.space.T @ (lower + np.tril(lower, -1).T) @ self.space, self.space.T @ normal[:, 9]


LARGEST: Final = 3  # most samples that are deleted at once
_ALONE: Final = 1e-6  # determinant of I − H_SS below which nothing else knows some parameter


def outlying(rows: Floats, left: Floats, *, false_alarm: float, rounding: float) -> NDArray[np.int64]:
    """Indices of the smallest group of outliers; empty where no group is beyond chance.

    `rows` (N, p) are derivatives of the residuals `left` (N,) by the parameters; normal errors lose a sample with the
    probability `false_alarm`; residuals of the standard deviation `rounding` are rounding errors only.
    """
    from scipy.stats import f

    q, _ = np.linalg.qr(rows)
    spare = np.eye(len(left)) - q @ q.T
    residuals = spare @ left  # what the curvature of the model makes of the rest would pass for misfit
    cost = float(residuals @ residuals)
    for count in range(1, LARGEST + 1):
        free = len(residuals) - rows.shape[1] - count
        if free < 2:
            break
        groups = np.array(list(combinations(range(len(residuals)), count)))
        # [Cook1982]: what the deletion of each group takes off the sum of squares
        inner, of_group = spare[groups[:, :, np.newaxis], groups[:, np.newaxis, :]], residuals[groups]
        alone = np.linalg.det(inner) < _ALONE
        inner[alone] = np.eye(count)
        gains = np.einsum("mi,mi->m", of_group, np.linalg.solve(inner, of_group[:, :, np.newaxis])[:, :, 0])
        gains = np.where(alone, 0.0, gains)
        best = int(np.argmax(gains))
        rest = max((cost - float(gains[best])) / free, rounding**2)
        if f.sf(gains[best] / count / rest, count, free) * len(groups) * LARGEST < false_alarm:
            return np.asarray(groups[best])
    return np.zeros(0, dtype=np.int64)


# centre and matrix, row by row, by centre and xx, yy, zz, xy, xz, yz
_SYMMETRIC_PARTS: Final = np.eye(9)[[0, 1, 2, *_ENTRIES.ravel().tolist()]]


def mean_radius(matrix: Floats, *, axes: int = 3) -> float:
    """Length that a matrix (3, 3) brings to 1, on average over so many axes, in the sensor's own scale."""
    return float(abs(np.linalg.det(matrix)) ** (-1.0 / axes))


def scaled(fit: NormFit, size: float | None, *, alike: float) -> tuple[Floats, Floats]:
    """Matrix and covariance of a calibration from a symmetric fit, as `to_size`.

    The covariance is widened by how many samples count as one (`alike`). An ellipse leaves the third axis as measured.
    """
    spread = _SYMMETRIC_PARTS @ (fit.covariance * alike) @ _SYMMETRIC_PARTS.T
    if fit.shape is not Shape.ELLIPSE:
        return to_size(fit.ellipsoid.shape, spread, size)
    matrix, covariance = to_size(fit.ellipsoid.shape, spread, size, axes=2)
    matrix[2, 2], covariance[11], covariance[:, 11] = 1.0, 0.0, 0.0
    return matrix, covariance


def to_size(matrix: Floats, covariance: Floats, size: float | None, *, axes: int = 3) -> tuple[Floats, Floats]:
    """Matrix (3, 3) of a calibration, and covariance (12, 12) of bias and matrix, from those of a fit to length 1.

    `size` is the length of the calibrated vector; where None, the matrix gets the determinant 1, and so keeps the
    sensor's scale: of so many `axes`, others being known.
    """
    factor = size or mean_radius(matrix, axes=axes)
    by_fit = np.eye(9)
    if not size:
        by_fit -= np.outer(matrix.ravel(), np.linalg.inv(matrix).T.ravel()) / axes
    jacobian = np.eye(12)
    jacobian[3:, 3:] = factor * by_fit
    return factor * matrix, jacobian @ covariance @ jacobian.T


def distortion_to_size(distortion: Floats, covariance: Floats, size: float | None) -> tuple[Floats, Floats]:
    """The same from the inverse of the matrix, and the covariance of bias and that: how a field of 1 is measured."""
    inverse = np.asarray(np.linalg.inv(distortion), dtype=np.float64)
    jacobian = np.eye(12)
    jacobian[3:, 3:] = -np.kron(inverse, inverse.T)
    return to_size(inverse, jacobian @ covariance @ jacobian.T, size)


SIGNIFICANCE: Final = 0.01  # probability of taking a larger shape where the smaller one is true
SPARE: Final = 3  # samples more than parameters, for residuals to say anything


class ShapeChoice(NamedTuple):
    """What was chosen, and the full shape that it was held against; the same where nothing smaller did."""

    fit: NormFit
    full: NormFit
    why: str


def first_ellipsoid(vectors: Floats) -> Ellipsoid:
    """Ellipsoid to start from (N, 3): the best closed form that gives one."""
    some = vectors[:: max(1, len(vectors) // _SOME)]
    if fitted := fit_quadric(some) or fit_axes(some):
        return fitted
    middle = some.mean(axis=0)  # else a sphere about the mean
    size = float(np.sqrt(np.mean(np.sum((some - middle) ** 2, axis=1))))
    return Ellipsoid(middle, np.eye(3) / max(size, 1e-12))


def choose(vectors: Floats, shape: Shape | None = None) -> ShapeChoice | None:
    """Fit of the smallest shape that the vectors (N, 3) do not contradict, or of the one that is asked for.

    None where that cannot be fitted, or the full one to which the others are held.
    """
    if shape is not None:
        single = fit_norm(vectors, shape, first_ellipsoid(vectors))
        return single and ShapeChoice(single, single, "asked for")
    some = vectors[:: max(1, len(vectors) // _SOME)]
    enough = len(some) >= Shape.ELLIPSOID.value + SPARE
    full = fit_norm(some, Shape.ELLIPSOID, first_ellipsoid(some)) if enough else None
    if full is None:
        return None
    from scipy.stats import f

    fit, tests, used = full, [], some[full.used]
    for fewer in (Shape.AXES, Shape.SPHERE):
        smaller = fit_norm(used, fewer, full.ellipsoid, robust=False)
        chance = 0.0  # of a misfit as large as the smaller shape's, if it were true
        if smaller is not None and fit.cost > 0.0:
            more, free = fit.shape.value - fewer.value, len(used) - fit.shape.value
            chance = float(f.sf(max(0.0, smaller.cost - fit.cost) / more / (fit.cost / free), more, free))
        elif smaller is not None:
            chance = 0.0 if smaller.cost > 0.0 else 1.0
        tests.append(f"{fewer.name.lower()} against {fit.shape.name.lower()}: {p_value(chance)}")
        if smaller is None or chance < SIGNIFICANCE:
            break
        fit = smaller
    why = "; ".join(tests)
    # the choice of a part is fitted to all vectors, with the outliers of the full shape
    general = full if len(full.used) == len(vectors) else fit_norm(vectors, Shape.ELLIPSOID, full.ellipsoid)
    if general is None or fit.shape is Shape.ELLIPSOID:
        return general and ShapeChoice(general, general, why)
    smaller = fit_norm(vectors[general.used], fit.shape, fit.ellipsoid, robust=False)
    if smaller is None:
        return None
    residuals = general.residuals.copy()
    residuals[general.used] = smaller.residuals
    return ShapeChoice(smaller._replace(residuals=residuals, used=general.used), general, why)
