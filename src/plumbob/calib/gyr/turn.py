"""Rotation that rates at discrete instants add up to, on SO(3)."""

import numpy as np

from plumbob._jit import njit
from plumbob.check import Floats
from plumbob.rotations.kernels import quat_exp, quat_mul


def rotation_vectors(rate: Floats, dt: Floats) -> Floats:
    """Rotation vectors (N−1, 3), rad, between instants with rates (N, 3), rad/s, and steps (N−1,), s.

    Exact where the rate changes linearly, up to the third order of the step: half the sum, and ω₁ × ω₂ dt²/12 for the
    turn of the axis itself [Bortz1971].
    """
    first, second, step = rate[:-1], rate[1:], dt[:, np.newaxis]
    return np.asarray(0.5 * step * (first + second) + step**2 / 12.0 * np.cross(first, second))


@njit
def accumulate(r: Floats, q: Floats) -> None:
    """Attitudes q (N, 4) from the identity on by rotation vectors r (N−1, 3) in the axes of the body."""
    q[0, 0], q[0, 1], q[0, 2], q[0, 3] = 1.0, 0.0, 0.0, 0.0
    for i in range(r.shape[0]):
        w, x, y, z = quat_exp(r[i, 0], r[i, 1], r[i, 2])
        a, b, c, d = quat_mul(q[i, 0], q[i, 1], q[i, 2], q[i, 3], w, x, y, z)
        q[i + 1, 0], q[i + 1, 1], q[i + 1, 2], q[i + 1, 3] = a, b, c, d
