"""Whether a measured field turns as a gyroscope says: a mirrored or wrongly turned magnetometer does not.

A field that is constant in space changes in the axes of the unit as ``du/dt = −ω × u``. Both sides are integrated over
a tenth of a second, which no noise has to be differentiated for, and the change is regressed on what the rates predict.
"""

from typing import Final, NamedTuple

import numpy as np

from plumbob.core.check import Floats

LEAST_SLOPE: Final = 0.5
"""Slope of the measured change on the predicted one below which an axis is swapped or has the wrong sign: right axes
make 1, a wrong sign of one axis makes −1/3 where the unit turns about all axes alike."""

MOST_UNKNOWN: Final = 0.05
"""Standard deviation beyond which a regression tells nothing."""

_WINDOW: Final = 0.1
_LONGEST: Final = 0.3
_CHUNK: Final = 20_000


class Agreement(NamedTuple):
    """Slope of the field's change on the one that the rates predict, and the bias (3,) of the rates, rad/s."""

    slope: float
    rate_bias: Floats


def agreement(t: Floats, mag: Floats, gyr: Floats) -> Agreement | None:
    """How the field's change agrees with the one that the rates predict; None where the capture does not tell.

    Neither needs to be calibrated: constant biases of both are found too.

    Parameters
    ----------
    t : ndarray (N,)
        Time, s.
    mag, gyr : ndarray (N, 3)
        Field, µT, and rates, rad/s; rows with NaN do not count.
    """
    rows, change = _windows(t, mag, gyr)
    along = rows[:, :, [0, 4, 8]].sum(axis=2)
    columns = np.concatenate((along[:, :, np.newaxis], rows[:, :, 9:]), axis=2)
    found = _solved(columns, change)
    if found is None or found[1][0] > MOST_UNKNOWN:
        return None
    return Agreement(float(found[0][0]), np.asarray(-found[0][1:4] / found[0][0]))


def turn(t: Floats, field: Floats, gyr: Floats) -> Floats | None:
    """Rotation matrix (3, 3) of the gyroscope's axes to those of a calibrated field; None where nothing shows it.

    Parameters
    ----------
    t : ndarray (N,)
        Time, s.
    field, gyr : ndarray (N, 3)
        Calibrated field, µT, and rates, rad/s, of which a constant bias is found too; rows with NaN do not count.
    """
    rows, change = _windows(t, field, gyr)
    found = _solved(rows[:, :, :12], change)
    if found is None or found[1][:9].max() > MOST_UNKNOWN:
        return None
    u, _, vt = np.linalg.svd(found[0][:9].reshape(3, 3))
    return np.asarray(u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt)


def _windows(t: Floats, mag: Floats, gyr: Floats) -> tuple[Floats, Floats]:
    """Derivatives (n, 3, 18) of the change of each window, and the change (n, 3).

    Columns: gain of the rates, row by row; their bias; hard iron; the product of both biases.
    """
    known = np.isfinite(mag).all(axis=1) & np.isfinite(gyr).all(axis=1)
    if not known.any():
        return np.zeros((0, 3, 18)), np.zeros((0, 3))
    t, mag, gyr = t[known], mag[known], gyr[known]
    size = max(1, round(_WINDOW / float(np.median(np.diff(t))))) if len(t) > 1 else 1
    step = size * max(1, _CHUNK // size)
    parts = [
        _chunk(t[a : a + step + 1], mag[a : a + step + 1], gyr[a : a + step + 1], size) for a in range(0, len(t), step)
    ]
    return np.concatenate([rows for rows, _ in parts]), np.concatenate([change for _, change in parts])


def _chunk(t: Floats, mag: Floats, gyr: Floats, size: int) -> tuple[Floats, Floats]:
    count = (len(t) - 1) // size
    edges = np.arange(count + 1) * size
    kept = np.diff(t[edges]) <= _LONGEST
    last = int(edges[-1])
    at = _derivatives(mag[: last + 1], gyr[: last + 1])
    each = 0.5 * (at[1:] + at[:-1]) * np.diff(t[: last + 1])[:, np.newaxis, np.newaxis]
    rows = each.reshape(count, size, 3, at.shape[2]).sum(axis=1)
    return rows[kept], np.diff(mag[edges], axis=0)[kept]


def _derivatives(mag: Floats, gyr: Floats) -> Floats:
    """Derivatives (N, 3, 18) of the change of the field per second, at each sample."""
    by_field, by_rate = _cross(mag), _cross(gyr)
    gain = (by_field[:, :, :, np.newaxis] * gyr[:, np.newaxis, np.newaxis, :]).reshape(len(mag), 3, 9)
    constant = np.broadcast_to(np.eye(3), (len(mag), 3, 3))
    return np.concatenate((gain, by_field, by_rate, constant), axis=2)


def _cross(vectors: Floats) -> Floats:
    """Matrices (N, 3, 3) that make the cross product with vectors (N, 3)."""
    x, y, z = vectors.T
    nothing = np.zeros(len(vectors))
    return np.stack((nothing, -z, y, z, nothing, -x, -y, x, nothing), axis=1).reshape(-1, 3, 3)


def _solved(columns: Floats, change: Floats) -> tuple[Floats, Floats] | None:
    """Solution and its standard deviations; None where the columns do not tell it."""
    rows, right = columns.reshape(-1, columns.shape[2]), change.ravel()
    scale = np.linalg.norm(rows, axis=0)
    if len(right) <= 2 * rows.shape[1] or not np.all(scale > 0.0):
        return None
    scaled = rows / scale
    normal = scaled.T @ scaled
    if np.linalg.cond(normal) > 1.0 / np.finfo(np.float64).eps:
        return None
    found = np.linalg.solve(normal, scaled.T @ right)
    left = right - scaled @ found
    variance = float(left @ left) / (len(right) - len(found))
    return found / scale, np.sqrt(variance * np.diag(np.linalg.inv(normal))) / scale
