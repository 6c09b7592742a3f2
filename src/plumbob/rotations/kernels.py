"""Scalar rotation kernels: the one home of each formula, used by the filters' steps and by the array functions.

Hamilton product, scalar first. A quaternion is four floats, a vector three. What goes over the rows of arrays is for
:mod:`plumbob.rotations.quaternions`.
"""

import math

from plumbob.core.check import Floats
from plumbob.core.kernels import kernel

Vec = tuple[float, float, float]
Quat = tuple[float, float, float, float]


@kernel
def quat_mul(a0: float, a1: float, a2: float, a3: float, b0: float, b1: float, b2: float, b3: float) -> Quat:
    """Hamilton product a ⊗ b."""
    return (
        a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3,  # [Sola2017] (12)
        a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2,
        a0 * b2 - a1 * b3 + a2 * b0 + a3 * b1,
        a0 * b3 + a1 * b2 - a2 * b1 + a3 * b0,
    )


@kernel
def cross(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> Vec:
    """Vector product a × b."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@kernel
def rotate(q0: float, q1: float, q2: float, q3: float, vx: float, vy: float, vz: float) -> Vec:
    """Turn v by the unit quaternion q: with q_nb, body coordinates become navigation coordinates."""
    tx = 2.0 * (q2 * vz - q3 * vy)
    ty = 2.0 * (q3 * vx - q1 * vz)
    tz = 2.0 * (q1 * vy - q2 * vx)
    return (
        vx + q0 * tx + (q2 * tz - q3 * ty),
        vy + q0 * ty + (q3 * tx - q1 * tz),
        vz + q0 * tz + (q1 * ty - q2 * tx),
    )


@kernel
def rows(
    q0: float, q1: float, q2: float, q3: float
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Rows of the matrix of q, one after the other: with q_nb, the navigation axes seen in the body."""
    xx, yy, zz = 2.0 * q1 * q1, 2.0 * q2 * q2, 2.0 * q3 * q3
    xy, xz, yz = 2.0 * q1 * q2, 2.0 * q1 * q3, 2.0 * q2 * q3
    wx, wy, wz = 2.0 * q0 * q1, 2.0 * q0 * q2, 2.0 * q0 * q3
    return (
        1.0 - (yy + zz), xy - wz, xz + wy,  # [Sola2017] (115)
        xy + wz, 1.0 - (xx + zz), yz - wx,
        xz - wy, yz + wx, 1.0 - (xx + yy),
    )  # fmt: skip


@kernel
def third_row(q0: float, q1: float, q2: float, q3: float) -> Vec:
    """Third row of the matrix of q: with q_nb, the navigation z axis seen in the body."""
    return (
        2.0 * (q1 * q3 - q0 * q2),  # [Sola2017] (115)
        2.0 * (q2 * q3 + q0 * q1),
        q0 * q0 - q1 * q1 - q2 * q2 + q3 * q3,
    )


@kernel
def quat_unit(q0: float, q1: float, q2: float, q3: float) -> Quat:
    """Scale q to norm 1; a zero or non-finite q becomes the identity."""
    n = q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3
    if abs(n - 1.0) < 1e-8:  # one Newton step of 1/√n, whose error is below 1e-16 here, without root and division
        s = 1.5 - 0.5 * n
    elif n > 0.0 and n < math.inf:
        s = 1.0 / math.sqrt(n)
    else:
        return 1.0, 0.0, 0.0, 0.0
    return q0 * s, q1 * s, q2 * s, q3 * s


@kernel
def half_angle(angle2: float) -> tuple[float, float]:
    """cos(θ/2) and sin(θ/2)/θ from θ² (rad²)."""
    if angle2 < 1e-4:  # below 0.01 rad: the next term of each series is under 1e-16
        s = 0.5 - angle2 * (1.0 / 48.0 - angle2 * (1.0 / 3840.0 - angle2 / 645120.0))
        w = 1.0 - angle2 * (1.0 / 8.0 - angle2 * (1.0 / 384.0 - angle2 / 46080.0))
    else:
        angle = math.sqrt(angle2)
        s = math.sin(0.5 * angle) / angle
        w = math.cos(0.5 * angle)
    return w, s


@kernel
def quat_exp(rx: float, ry: float, rz: float) -> Quat:
    """Unit quaternion of a rotation vector r, rad."""
    w, s = half_angle(rx * rx + ry * ry + rz * rz)
    return w, s * rx, s * ry, s * rz  # [Sola2017] (101)


@kernel
def multiply_rows(a: Floats, b: Floats, out: Floats) -> None:
    """Hamilton products of rows, (N, 4)."""
    for i in range(out.shape[0]):
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = quat_mul(
            a[i, 0], a[i, 1], a[i, 2], a[i, 3], b[i, 0], b[i, 1], b[i, 2], b[i, 3]
        )


@kernel
def rotate_rows(q: Floats, v: Floats, out: Floats) -> None:
    """Turn vectors (N, 3) by quaternions (N, 4)."""
    for i in range(out.shape[0]):
        out[i, 0], out[i, 1], out[i, 2] = rotate(q[i, 0], q[i, 1], q[i, 2], q[i, 3], v[i, 0], v[i, 1], v[i, 2])


@kernel
def matrix_rows(q: Floats, out: Floats) -> None:
    """Matrices, row by row, (N, 9), of quaternions (N, 4); a norm other than 1 scales them by its square."""
    for i in range(out.shape[0]):
        q0, q1, q2, q3 = q[i, 0], q[i, 1], q[i, 2], q[i, 3]
        out[i, 0] = q0 * q0 + q1 * q1 - q2 * q2 - q3 * q3  # [Sola2017] (115)
        out[i, 1], out[i, 2] = 2.0 * (q1 * q2 - q0 * q3), 2.0 * (q1 * q3 + q0 * q2)
        out[i, 3], out[i, 5] = 2.0 * (q1 * q2 + q0 * q3), 2.0 * (q2 * q3 - q0 * q1)
        out[i, 4] = q0 * q0 - q1 * q1 + q2 * q2 - q3 * q3
        out[i, 6], out[i, 7], out[i, 8] = third_row(q0, q1, q2, q3)
