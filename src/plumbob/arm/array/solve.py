"""Least squares of small systems, row by row: three numbers of a body, or six, seen by any number of sensor axes."""

import math
from typing import Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.kernels import kernel
from plumbob.rotations.kernels import Vec

SINGULAR: Final = 1e-9
"""A pivot that is less than this share of its own diagonal says that the axes do not span the unknowns."""


@kernel
def factor(a: Floats, size: int) -> bool:
    """Cholesky factor of a symmetric matrix (size, size) in place, lower half; False where it is singular."""
    for j in range(size):
        diagonal = a[j, j]
        for k in range(j):
            a[j, j] -= a[j, k] * a[j, k]
        if not a[j, j] > SINGULAR * diagonal:
            return False
        a[j, j] = math.sqrt(a[j, j])
        for i in range(j + 1, size):
            for k in range(j):
                a[i, j] -= a[i, k] * a[j, k]
            a[i, j] /= a[j, j]
    return True


@kernel
def solve(a: Floats, b: Floats, size: int) -> None:
    """Replace b by the solution, of a factor made by `factor`."""
    for i in range(size):
        for k in range(i):
            b[i] -= a[i, k] * b[k]
        b[i] /= a[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            b[i] -= a[k, i] * b[k]
        b[i] /= a[i, i]


@kernel
def inverse3(a: Floats, out: Floats) -> bool:
    """Inverse of a symmetric matrix (3, 3), by cofactors; False where it is singular."""
    c00 = a[1, 1] * a[2, 2] - a[1, 2] * a[1, 2]
    c01 = a[0, 2] * a[1, 2] - a[0, 1] * a[2, 2]
    c02 = a[0, 1] * a[1, 2] - a[0, 2] * a[1, 1]
    det = a[0, 0] * c00 + a[0, 1] * c01 + a[0, 2] * c02
    if not det > SINGULAR * a[0, 0] * a[1, 1] * a[2, 2]:
        return False
    s = 1.0 / det
    out[0, 0], out[0, 1], out[0, 2] = s * c00, s * c01, s * c02
    out[1, 1] = s * (a[0, 0] * a[2, 2] - a[0, 2] * a[0, 2])
    out[1, 2] = s * (a[0, 1] * a[0, 2] - a[0, 0] * a[1, 2])
    out[2, 2] = s * (a[0, 0] * a[1, 1] - a[0, 1] * a[0, 1])
    out[1, 0], out[2, 0], out[2, 1] = out[0, 1], out[0, 2], out[1, 2]
    return True


@kernel
def add_axis(a: Floats, c0: float, c1: float, c2: float, w: float) -> None:
    """Add an axis c of weight w to the upper half of the normal equations of three unknowns."""
    a[0, 0] += w * c0 * c0
    a[0, 1] += w * c0 * c1
    a[0, 2] += w * c0 * c2
    a[1, 1] += w * c1 * c1
    a[1, 2] += w * c1 * c2
    a[2, 2] += w * c2 * c2


@kernel
def times(m: Floats, b0: float, b1: float, b2: float) -> Vec:
    """Product of a matrix (3, 3) and a vector."""
    return (
        m[0, 0] * b0 + m[0, 1] * b1 + m[0, 2] * b2,
        m[1, 0] * b0 + m[1, 1] * b1 + m[1, 2] * b2,
        m[2, 0] * b0 + m[2, 1] * b1 + m[2, 2] * b2,
    )


@kernel
def combine_rows(y: Floats, axes: Floats, weight: Floats, x: Floats, residual: Floats) -> None:
    """Vector x (N, 3), body axes, of all sensor axes, and what each axis measures beyond it, (N, U, 3).

    `y` (N, U, 3): values of the sensor axes, NaN is left out; `axes` (U, 3, 3): direction of sensor axis k of unit u in
    body axes; `weight` (U, 3): inverse variances. Results are NaN where the axes that are left do not span the body.
    """
    a, inverse = np.zeros((3, 3)), np.zeros((3, 3))
    for i in range(y.shape[0]):
        a[:, :] = 0.0
        b0 = b1 = b2 = 0.0
        for u in range(y.shape[1]):
            for k in range(3):
                value = y[i, u, k]
                if math.isnan(value):
                    continue
                c0, c1, c2, w = axes[u, k, 0], axes[u, k, 1], axes[u, k, 2], weight[u, k]
                add_axis(a, c0, c1, c2, w)
                b0 += w * c0 * value
                b1 += w * c1 * value
                b2 += w * c2 * value
        if not inverse3(a, inverse):
            x[i, 0] = x[i, 1] = x[i, 2] = math.nan
        else:
            x[i, 0], x[i, 1], x[i, 2] = times(inverse, b0, b1, b2)
        for u in range(y.shape[1]):
            for k in range(3):
                residual[i, u, k] = y[i, u, k] - (
                    axes[u, k, 0] * x[i, 0] + axes[u, k, 1] * x[i, 1] + axes[u, k, 2] * x[i, 2]
                )


@kernel
def force_rows(
    y: Floats, axes: Floats, weight: Floats, levers: Floats, rate: Floats, turn: Floats, turn_weight: float,
    x: Floats, residual: Floats, a: Floats, b: Floats,
) -> None:  # fmt: skip
    """Specific force of the reference point and angular acceleration together, of accelerometers at levers.

    Each axis measures c·(f + ω̇ × r + ω × (ω × r)). The rate ω is known; the angular acceleration is an unknown that
    the gyroscopes know with a variance of 1 / `turn_weight`, and the accelerometers too where their levers span it.

    As in `combine_rows`, and `levers` (U, 3): from the reference point to each accelerometer, body axes, m; `rate`,
    `turn` (N, 3): angular rate and acceleration of the gyroscopes, body axes; `a` (6, 6), `b` (6,): room to work in.
    """
    for i in range(y.shape[0]):
        w0, w1, w2 = rate[i, 0], rate[i, 1], rate[i, 2]
        a[:, :] = 0.0
        for k in range(3):
            has_turn = not math.isnan(turn[i, k])
            a[3 + k, 3 + k] = turn_weight if has_turn else 1e-6 * turn_weight
            b[k], b[3 + k] = 0.0, turn_weight * turn[i, k] if has_turn else 0.0
        for u in range(y.shape[1]):
            r0, r1, r2 = levers[u, 0], levers[u, 1], levers[u, 2]
            along = w0 * r0 + w1 * r1 + w2 * r2
            size = w0 * w0 + w1 * w1 + w2 * w2
            p0, p1, p2 = w0 * along - size * r0, w1 * along - size * r1, w2 * along - size * r2
            for k in range(3):
                c0, c1, c2, w = axes[u, k, 0], axes[u, k, 1], axes[u, k, 2], weight[u, k]
                value = y[i, u, k] - (c0 * p0 + c1 * p1 + c2 * p2)
                if math.isnan(value):
                    continue
                h3, h4, h5 = r1 * c2 - r2 * c1, r2 * c0 - r0 * c2, r0 * c1 - r1 * c0  # c·(ω̇ × r) = ω̇·(r × c)
                add(a, b, w, value, c0, c1, c2, h3, h4, h5)
        if factor(a, 6):
            solve(a, b, 6)
        else:
            b[:] = math.nan
        x[i, 0], x[i, 1], x[i, 2] = b[0], b[1], b[2]
        for u in range(y.shape[1]):
            r0, r1, r2 = levers[u, 0], levers[u, 1], levers[u, 2]
            along = w0 * r0 + w1 * r1 + w2 * r2
            size = w0 * w0 + w1 * w1 + w2 * w2
            f0 = b[0] + b[4] * r2 - b[5] * r1 + w0 * along - size * r0
            f1 = b[1] + b[5] * r0 - b[3] * r2 + w1 * along - size * r1
            f2 = b[2] + b[3] * r1 - b[4] * r0 + w2 * along - size * r2
            for k in range(3):
                residual[i, u, k] = y[i, u, k] - (axes[u, k, 0] * f0 + axes[u, k, 1] * f1 + axes[u, k, 2] * f2)


@kernel
def add(
    a: Floats, b: Floats, w: float, value: float, h0: float, h1: float, h2: float, h3: float, h4: float, h5: float
) -> None:
    """Add one equation h·x = value of weight w to the lower half of the normal equations of six unknowns."""
    b[0] += w * h0 * value
    b[1] += w * h1 * value
    b[2] += w * h2 * value
    b[3] += w * h3 * value
    b[4] += w * h4 * value
    b[5] += w * h5 * value
    a[0, 0] += w * h0 * h0
    a[1, 0] += w * h1 * h0
    a[1, 1] += w * h1 * h1
    a[2, 0] += w * h2 * h0
    a[2, 1] += w * h2 * h1
    a[2, 2] += w * h2 * h2
    a[3, 0] += w * h3 * h0
    a[3, 1] += w * h3 * h1
    a[3, 2] += w * h3 * h2
    a[3, 3] += w * h3 * h3
    a[4, 0] += w * h4 * h0
    a[4, 1] += w * h4 * h1
    a[4, 2] += w * h4 * h2
    a[4, 3] += w * h4 * h3
    a[4, 4] += w * h4 * h4
    a[5, 0] += w * h5 * h0
    a[5, 1] += w * h5 * h1
    a[5, 2] += w * h5 * h2
    a[5, 3] += w * h5 * h3
    a[5, 4] += w * h5 * h4
    a[5, 5] += w * h5 * h5
