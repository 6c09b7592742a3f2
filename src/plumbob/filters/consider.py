"""What errors of the calibration do to an attitude: a consider analysis, [Schmidt1966].

A filter's covariance knows its noises. What the calibration leaves, ``δ = d + E u`` in each vector u, is the same all
the time, so it does not average out, and a filter that does not estimate it should at least count it: the covariance
that is claimed is ``P + J P_cal Jᵀ``, with P that of the filter, P_cal that of the parameters p = (d, E) and J = ∂θ/∂p
the sensitivity of the estimate. The estimate itself stays what it is, to the bit.

J is that of an attitude whose tilt is that of the accelerometer and whose heading is that of the magnetometer, which
every filter here comes to while the body keeps its attitude. While it turns faster than the filter corrects, the error
is a mean over attitudes and the claim too large, never too small.

With up = s e_z, the horizon of a wrong specific force is off by ``θ_x = −s δ_y/g, θ_y = s δ_x/g`` in the navigation
frame, and the heading of a field of level part H along n and vertical part h_z by ``θ_z = (h_z/H) n·θ + (e_z×n)·δ/H``:
a wrong horizon takes some of the vertical field for level.

Departures from [Schmidt1966]: J is that of the settled filter, instead of one that is carried along with its gains.
"""

import numpy as np

from plumbob.cards.left import Half, whole_of
from plumbob.check import Floats
from plumbob.constants import G0
from plumbob.rotations import dcm_from_quat

_STEEPEST = 0.05
"""A field whose level part is less than this of it, is taken to have that: at a magnetic pole nothing is linear."""


def considered(q_nb: Floats, field: Floats, up: float, north: tuple[float, float], acc: Half, mag: Half) -> Floats:
    """What the calibration adds to the covariance of the attitude error in body axes, (N, 3, 3), rad².

    Parameters
    ----------
    q_nb : ndarray (N, 4)
        Attitudes.
    field : ndarray (N, 2)
        Level and vertical part of the field, along navigation z, µT; zero where no field tells the heading.
    up : float
        +1 where navigation z points up, −1 where it points down.
    north : (float, float)
        Level direction that the magnetometer calls north, in the navigation frame.
    acc, mag : tuple of float
        Upper halves of the covariances of (d, E).
    """
    c_nb = dcm_from_quat(q_nb)
    level, steep = field[:, 0], field[:, 1]
    seen = level > 0.0
    level = np.where(seen, np.maximum(level, _STEEPEST * np.abs(steep)), 1.0)
    steep = np.where(seen, steep, 0.0)
    nx, ny = north
    force = _sensitivity(c_nb, np.array([0.0, 0.0, up * G0]) + np.zeros((len(q_nb), 3)))
    turn = np.empty_like(force)  # ∂θ/∂p of the accelerometer in the navigation frame, (N, 3, 12)
    turn[:, 0] = -up / G0 * force[:, 1]
    turn[:, 1] = up / G0 * force[:, 0]
    turn[:, 2] = (steep / level)[:, np.newaxis] * (nx * turn[:, 0] + ny * turn[:, 1])
    h_n = np.stack((level * nx, level * ny, steep), axis=1)
    across = _sensitivity(c_nb, h_n)
    course = np.zeros_like(across)
    course[:, 2] = (seen / level)[:, np.newaxis] * (nx * across[:, 1] - ny * across[:, 0])
    c_bn = np.swapaxes(c_nb, 1, 2)
    return _spread(c_bn @ turn, acc) + _spread(c_bn @ course, mag)


def _sensitivity(c_nb: Floats, vectors_n: Floats) -> Floats:
    """∂δ/∂p in the navigation frame, (N, 3, 12), of vectors (N, 3) in it: R (I, uᵀ ⊗ I) row by row."""
    u_b = (np.swapaxes(c_nb, 1, 2) @ vectors_n[..., np.newaxis])[..., 0]
    matrix = c_nb[:, :, :, np.newaxis] * u_b[:, np.newaxis, np.newaxis, :]
    return np.concatenate((c_nb, matrix.reshape(-1, 3, 9)), axis=2)


def _spread(sensitivity: Floats, half: Half) -> Floats:
    if not any(half):
        return np.zeros((len(sensitivity), 3, 3))
    found: Floats = sensitivity @ whole_of(half) @ np.swapaxes(sensitivity, 1, 2)
    return 0.5 * (found + np.swapaxes(found, 1, 2))
