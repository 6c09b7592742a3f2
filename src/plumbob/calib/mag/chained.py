"""Attitudes that a gyroscope's rates lead to, and how they lean by its errors."""

import numpy as np

from plumbob.check import Floats
from plumbob.rotations import quat_from_rotvec, quat_multiply


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
