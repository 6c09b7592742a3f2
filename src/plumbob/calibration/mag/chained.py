"""Attitudes that a gyroscope's rates lead to, how they lean by its errors, and how large these can be."""

import math
from typing import Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.units import deg, dps
from plumbob.rotations import dcm_from_quat, quat_from_rotvec, quat_multiply

TURN_SD: Final = float(deg(0.25))
"""Standard deviation of a turn of a gyroscope's axes together about each, rad, without a card: 0.4 % across."""

_BIAS_SD: Final = float(dps(10.0))  # rad/s; no MEMS gyroscope is off by more, and most by less
_DELAY_SD: Final = 0.02  # s; periods of 10 ms, and filters of as much again
_EXACT: Final = 1e-6  # gain that counts as known


def chained(angles: Floats) -> Floats:
    """Attitudes (N + 1, 4) that rotations (N, 3) in turning axes lead to."""
    q = quat_from_rotvec(np.vstack((np.zeros(3), angles)))
    reach = 1
    while reach < len(q):  # products of 2, 4, 8, … rotations up to each one
        q[reach:] = quat_multiply(q[:-reach], q[reach:])
        reach *= 2
    return np.asarray(q / np.linalg.norm(q, axis=1, keepdims=True))


def by_error(turns: Floats, angles: Floats, dt: Floats) -> Floats:
    """How attitudes (N, 3, 3) lean by bias and gain of a gyroscope that measures angles (N, 3) in dt (N, 1)."""
    by_gain = np.einsum("nij,nk->nijk", turns, angles).reshape(-1, 3, 9)
    return np.concatenate((-turns * dt[:, np.newaxis], by_gain), axis=2)


def leaning(turns: Floats, angles: Floats, measured: Floats, dt: Floats) -> Floats:
    """How attitudes (N, 3, 3) lean since the first, (N, 3, 12), by bias and gain of a gyroscope, by Simpson's rule.

    Parameters
    ----------
    turns : ndarray (N, 3, 3)
        Attitudes.
    angles, measured : ndarray (N - 1, 3)
        Rotations between them, rad, and as the gyroscope measured them.
    dt : ndarray (N - 1, 1)
        Times between them, s.
    """
    middle = turns[:-1] @ dcm_from_quat(quat_from_rotvec(0.5 * angles))
    each = by_error((turns[:-1] + 4.0 * middle + turns[1:]) / 6.0, measured, dt)
    return np.concatenate((np.zeros((1, 3, 12)), np.cumsum(each, axis=0)))


def tightness(gain_sd: float) -> Floats:
    """Inverse covariance (13, 13) of what a gyroscope's bias, gain matrix and the delay can be.

    A turn of all its axes together is less than what a data sheet grants each, because they share a die or a package.
    """
    gain_sd = max(gain_sd, _EXACT)
    found = np.diag(1.0 / np.repeat((_BIAS_SD, np.inf, _DELAY_SD), (3, 9, 1)) ** 2)
    other = np.eye(9)[np.arange(9).reshape(3, 3).T.ravel()]  # the entry on the other side of the diagonal
    turn_sd = min(gain_sd, math.sqrt(2.0) * TURN_SD)
    found[3:12, 3:12] = 0.5 * ((np.eye(9) + other) / gain_sd**2 + (np.eye(9) - other) / turn_sd**2)
    return found


def inverse_of(normal: Floats) -> Floats:
    """Inverse of a normal matrix; what it does not determine gets a huge variance, not none."""
    spread = np.sqrt(np.diag(normal))
    sizes, axes = np.linalg.eigh(normal / np.outer(spread, spread))
    inverse = (axes / np.maximum(sizes, 1e-14 * sizes[-1])) @ axes.T
    return np.asarray(inverse / np.outer(spread, spread))
