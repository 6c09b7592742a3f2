"""Algebraic fits of an ellipsoid to measured vectors: closed forms, from sums alone.

They need no start and cost one pass, and their error is that of noise squared: the maximum likelihood in `norm_fit`
starts from here. The axis-aligned one is the buoy paper's [Yu2018].
"""

from typing import NamedTuple

import numpy as np

from plumbob._jit import njit
from plumbob.check import Floats


class Ellipsoid(NamedTuple):
    """Vectors m with ``|shape @ (m − centre)| = 1``; `shape` is symmetric and positive definite."""

    centre: Floats
    shape: Floats


def fit_axes(vectors: Floats) -> Ellipsoid | None:
    """Ellipsoid along the axes, 6 parameters, by least squares of [Yu2018] (13), (14); None where it is none.

    Parameters
    ----------
    vectors : ndarray (N, 3)
        Measured vectors, of any size about the same; finite.
    """
    x, y, z = vectors.T
    rows = np.column_stack((-y * y, -z * z, 2.0 * x, 2.0 * y, 2.0 * z, np.ones_like(x)))
    w, *_ = np.linalg.lstsq(rows, x * x, rcond=None)  # [Yu2018] (13)
    ey2, ez2 = float(w[0]), float(w[1])
    if not (ey2 > 0.0 and ez2 > 0.0):
        return None
    centre = np.array([w[2], w[3] / ey2, w[4] / ez2])
    radius2 = float(w[5] + centre[0] ** 2 + ey2 * centre[1] ** 2 + ez2 * centre[2] ** 2)
    if not radius2 > 0.0:
        return None
    return Ellipsoid(centre, np.diag(np.sqrt(np.array([1.0, ey2, ez2]) / radius2)))  # [Yu2018] (14) with its first /R


@njit
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
    """General ellipsoid, 9 parameters, by least squares on vectors brought to the origin and to length 1.

    Without that, the constraint of the fit depends on where the ellipsoid lies, and captures of small tilt fail.

    Parameters
    ----------
    vectors : ndarray (N, 3)
        Measured vectors; finite.
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
