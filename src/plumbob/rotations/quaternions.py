"""Rotations as arrays: quaternions, rotation vectors, matrices and ZYX Euler angles, each from the others.

Quaternions: Hamilton, scalar first (wxyz), last axis of 4, any leading shape.

``q_nb`` takes body coordinates to navigation coordinates: ``v_n = quat_rotate(q_nb, v_b)``. Adjacent letters cancel:
``q_ns = quat_multiply(q_nb, q_bs)``. Other orders enter and leave only through `quat_from_xyzw` and `quat_to_xyzw`.

The group SO(3): exponential, logarithm and the Jacobians between a rotation vector and its rotation.

The Jacobians follow [Sola2018]: ``exp(r + d) ≈ exp(r) exp(Jr(r) d)`` and ``exp(r + d) ≈ exp(Jl(r) d) exp(r)``.

Rotation matrices and ZYX Euler angles: yaw ψ about z, then pitch θ about y, then roll φ about x.

Angles are always given together, in that order, on a last axis of 3, in radians. What yaw 0 means depends on the
navigation frame: x is North in NED and NWU, East in ENU. Pitch is positive nose up in NED with a forward-right-down
body, and nose down in ENU or NWU with a forward-left-up body: the sign follows the axes, not the aircraft.

Gimbal policy: within `GIMBAL_MARGIN` of pitch ±90° only yaw ∓ roll is defined; there roll is set to 0 and yaw carries
the sum. Yaw is always computed for the roll that is returned, so that the angles give back the same rotation: to
rounding outside the margin, to twice the margin inside. `near_gimbal` shows where that happened.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ShapeError
from plumbob.core.kernels import Kernel
from plumbob.rotations import kernels

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

IDENTITY: Floats = check.read_only(np.array([1.0, 0.0, 0.0, 0.0]))


def quat_multiply(a: ArrayLike, b: ArrayLike) -> Floats:
    """Hamilton product a ⊗ b, with broadcasting.

    Parameters
    ----------
    a, b : array_like (..., 4)
        Quaternions, wxyz.

    Returns
    -------
    ndarray (..., 4)
    """
    qa, qb = check.last_axis("a", a, 4), check.last_axis("b", b, 4)
    return _by_row(kernels.multiply_rows, qa, qb)


def quat_conjugate(q: ArrayLike) -> Floats:
    """Conjugate: of a unit quaternion, the inverse; ``q_bn = quat_conjugate(q_nb)``."""
    conjugate: Floats = check.last_axis("q", q, 4) * np.array([1.0, -1.0, -1.0, -1.0])
    return conjugate


def quat_normalize(q: ArrayLike) -> Floats:
    """Scale to norm 1.

    Raises
    ------
    ShapeError
        If a norm is zero or infinite; NaN (absent) stays NaN.
    """
    array = check.last_axis("q", q, 4)
    with np.errstate(over="ignore"):
        norm = np.sqrt(np.sum(array * array, axis=-1, keepdims=True))
    if bool(np.any((norm == 0.0) | np.isinf(norm))):
        raise ShapeError("q holds a quaternion of norm zero or infinity, which is not a rotation.")
    return np.asarray(array / norm)


def quat_rotate(q: ArrayLike, v: ArrayLike) -> Floats:
    """Turn vectors: ``v_n = quat_rotate(q_nb, v_b)``, with broadcasting.

    Parameters
    ----------
    q : array_like (..., 4)
        Unit quaternions, wxyz.
    v : array_like (..., 3)
        Vectors.

    Returns
    -------
    ndarray (..., 3)
    """
    qa, va = check.last_axis("q", q, 4), check.last_axis("v", v, 3)
    return _by_row(kernels.rotate_rows, qa, va)


def quat_angle(a: ArrayLike, b: ArrayLike) -> Floats:
    """Angle of the rotation between a and b, rad in [0, π]; exact for tiny angles, and a ≡ −a."""
    d = quat_multiply(quat_conjugate(a), b)
    return np.asarray(2.0 * np.arctan2(np.sqrt(np.sum(d[..., 1:] ** 2, axis=-1)), np.abs(d[..., 0])))


def quat_slerp(a: ArrayLike, b: ArrayLike, fraction: ArrayLike) -> Floats:
    """Interpolate along the shorter arc from a (fraction 0) to b (fraction 1), at constant rate.

    Parameters
    ----------
    a, b : array_like (..., 4)
        Unit quaternions, wxyz.
    fraction : array_like (...)
        Place between them.
    """
    step = rotvec_from_quat(quat_multiply(quat_conjugate(a), b))
    return quat_multiply(a, quat_from_rotvec(step * np.asarray(fraction, dtype=np.float64)[..., np.newaxis]))


def quat_from_xyzw(quat_xyzw: ArrayLike) -> Floats:
    """Reorder quaternions that carry their scalar last (SciPy's default, ROS, three.js)."""
    return np.ascontiguousarray(np.roll(check.last_axis("quat_xyzw", quat_xyzw, 4), 1, axis=-1))


def quat_to_xyzw(q: ArrayLike) -> Floats:
    """Reorder to scalar last, for SciPy's default, ROS or three.js."""
    return np.ascontiguousarray(np.roll(check.last_axis("q", q, 4), -1, axis=-1))


def _by_row(kernel: Kernel[[Floats, Floats, Floats], None], a: Floats, b: Floats) -> Floats:
    """Run a kernel of quaternions (N, 4) and others (N, n) on arrays of any leading shape; results are like others."""
    if a.shape[:-1] != b.shape[:-1]:
        shape = np.broadcast_shapes(a.shape[:-1], b.shape[:-1])
        a, b = np.broadcast_to(a, (*shape, a.shape[-1])), np.broadcast_to(b, (*shape, b.shape[-1]))
    out = np.empty(b.shape)
    kernel(a.reshape(-1, a.shape[-1]), b.reshape(-1, b.shape[-1]), out.reshape(-1, b.shape[-1]))
    return out


def quat_mean(q: ArrayLike, weights: ArrayLike | None = None) -> Floats:
    """Rotation with the least weighted sum of squared chordal distances to the given ones, [Markley2007] (12).

    Parameters
    ----------
    q : array_like (N, 4)
        Unit quaternions, wxyz; signs do not matter. Rows that are NaN are left out.
    weights : array_like (N,), optional
        Weights ≥ 0.

    Returns
    -------
    ndarray (4,)
        Unit quaternion with scalar part ≥ 0.

    Raises
    ------
    ShapeError
        If nothing is left to average, or the average is not unique (rotations spread evenly).
    """
    array = check.rows("q", q, 4)
    w = np.ones(array.shape[0]) if weights is None else check.column("weights", weights, array.shape[0])
    if not ((w >= 0.0) & (w < np.inf)).all():
        raise ShapeError(f"weights must be finite and ≥ 0, but they hold {w[~((w >= 0.0) & (w < np.inf))][0]:g}.")
    keep = np.isfinite(array).all(axis=1) & (w > 0.0)
    if not keep.any():
        raise ShapeError("q holds no finite quaternion with a positive weight, so there is nothing to average.")
    values, vectors = np.linalg.eigh((array[keep] * w[keep, np.newaxis]).T @ array[keep])  # [Markley2007] (12)
    if values[-1] - values[-2] < 1e-9 * values[-1]:
        raise ShapeError("the rotations are spread so evenly that their average is not unique.")
    mean: Floats = vectors[:, -1]
    return -mean if mean[0] < 0.0 else mean


def rotation_from_quat(q: ArrayLike) -> "Rotation":
    """SciPy rotation of unit quaternions in this project's order, wxyz, shape (4,) or (N, 4)."""
    from scipy.spatial.transform import Rotation

    array = check.last_axis("q", q, 4)
    check.unit_norm("q", array)
    return Rotation.from_quat(quat_to_xyzw(array))


def quat_from_rotation(rotation: "Rotation") -> Floats:
    """Unit quaternions, wxyz, of a SciPy rotation."""
    return quat_from_xyzw(rotation.as_quat())


_SMALL2 = 1e-4  # squared angle below which the exponential uses its series


def quat_from_rotvec(rotvec: ArrayLike) -> Floats:
    """Exponential map.

    Parameters
    ----------
    rotvec : array_like (..., 3)
        Rotation vectors, rad.

    Returns
    -------
    ndarray (..., 4)
        Unit quaternions, wxyz.
    """
    r = check.last_axis("rotvec", rotvec, 3)
    angle2 = np.sum(r * r, axis=-1)
    small = angle2 < _SMALL2
    angle = np.sqrt(np.where(small, 1.0, angle2))
    s = np.where(small, 0.5 - angle2 * (1 / 48 - angle2 * (1 / 3840 - angle2 / 645120)), np.sin(0.5 * angle) / angle)
    w = np.where(small, 1.0 - angle2 * (1 / 8 - angle2 * (1 / 384 - angle2 / 46080)), np.cos(0.5 * angle))
    return np.concatenate((w[..., np.newaxis], s[..., np.newaxis] * r), axis=-1)  # [Sola2017] (101)


def quat_chained(turns: Floats) -> Floats:
    """Attitudes (N + 1, 4) that rotation vectors (N, 3), rad, lead to, each in the axes that those before it turned."""
    q = quat_from_rotvec(np.vstack((np.zeros(3), turns)))
    reach = 1
    while reach < len(q):  # products of 2, 4, 8, … rotations up to each one
        q[reach:] = quat_multiply(q[:-reach], q[reach:])
        reach *= 2
    return np.asarray(q / np.linalg.norm(q, axis=1, keepdims=True))


def rotvec_from_quat(q: ArrayLike) -> Floats:
    """Logarithm of unit quaternions: the rotation vector of angle at most π, rad, shape (..., 3); q ≡ −q."""
    array = check.last_axis("q", q, 4)
    array = np.where(array[..., :1] < 0.0, -array, array)
    v = array[..., 1:]
    sin_half = np.sqrt(np.sum(v * v, axis=-1))
    small = sin_half < 1e-8  # there the scalar is 1 to the last bit, and angle = 2 |v|
    safe = np.where(small, 1.0, sin_half)
    scale = np.where(small, 2.0, 2.0 * np.arctan2(safe, array[..., 0]) / safe)
    return np.asarray(scale[..., np.newaxis] * v)


def skew(v: ArrayLike) -> Floats:
    """Matrices of the vector product: ``skew(a) @ b = a × b``, shape (..., 3, 3)."""
    x, y, z = np.moveaxis(check.last_axis("v", v, 3), -1, 0)
    zero = np.zeros_like(x)
    return np.stack((zero, -z, y, z, zero, -x, -y, x, zero), axis=-1).reshape((*x.shape, 3, 3))


def wrap(angle: Floats) -> Floats:
    """Bring angles, rad, to (−π, π]."""
    return np.pi - np.mod(np.pi - angle, 2.0 * np.pi)


def dcm_from_quat(q: ArrayLike) -> Floats:
    """Matrices, shape (..., 3, 3), of unit quaternions, shape (..., 4)."""
    array = check.last_axis("q", q, 4)
    c = np.empty((*array.shape[:-1], 3, 3))
    kernels.matrix_rows(array.reshape(-1, 4), c.reshape(-1, 9))
    return c


def quat_from_dcm(c: ArrayLike, *, tolerance: float = 1e-6) -> Floats:
    """Unit quaternions, scalar part ≥ 0, of rotation matrices.

    Parameters
    ----------
    c : array_like (..., 3, 3)
        Proper rotation matrices.
    tolerance : float
        Largest allowed entry of ``C Cᵀ − I``.

    Raises
    ------
    ShapeError
        If a matrix is not orthogonal or mirrors (determinant −1).
    """
    m = check.last_axis("c", c, 3)
    if m.ndim < 2 or m.shape[-2] != 3:
        raise ShapeError(f"c must have shape (..., 3, 3), but its shape is {m.shape}.")
    defect = float(np.max(np.abs(m @ np.swapaxes(m, -1, -2) - np.eye(3)), initial=0.0))
    if not defect <= tolerance:
        raise ShapeError(f"c is not orthogonal: C Cᵀ − I reaches {defect:.3g}, more than {tolerance:g}.")
    if bool(np.any(np.linalg.det(m) < 0.0)):
        raise ShapeError("c has determinant −1: it mirrors, as a left-handed set of axes does, and is not a rotation.")
    return _pivoted(m)


def _pivoted(m: Floats) -> Floats:
    """Read the row of 4 q qᵀ with the largest diagonal entry, [Shepperd1978]."""
    m00, m11, m22 = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    w, x, y, z = 1 + m00 + m11 + m22, 1 + m00 - m11 - m22, 1 - m00 + m11 - m22, 1 - m00 - m11 + m22
    wx, wy, wz = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    xy, xz, yz = m[..., 0, 1] + m[..., 1, 0], m[..., 0, 2] + m[..., 2, 0], m[..., 1, 2] + m[..., 2, 1]
    rows = np.stack((w, wx, wy, wz, wx, x, xy, xz, wy, xy, y, yz, wz, xz, yz, z), axis=-1).reshape((*w.shape, 4, 4))
    pivot = np.argmax(np.stack((w, x, y, z), axis=-1), axis=-1)  # [Shepperd1978]
    q = np.take_along_axis(rows, pivot[..., np.newaxis, np.newaxis], axis=-2)[..., 0, :]
    q = q / np.sqrt(np.sum(q * q, axis=-1, keepdims=True))
    return np.asarray(np.where(q[..., :1] < 0.0, -q, q))


GIMBAL_MARGIN = 1e-8  # of pitch from ±90°, rad: inside, roll is about 1e-8 rad uncertain and set to 0


def euler_zyx_from_quat(q: ArrayLike) -> Floats:
    """Yaw, pitch, roll of unit quaternions.

    Parameters
    ----------
    q : array_like (..., 4)
        Unit quaternions, wxyz; for q_nb the angles turn the navigation frame into the body frame.

    Returns
    -------
    ndarray (..., 3)
        Yaw in (−π, π], pitch in [−π/2, π/2], roll in (−π, π], rad.
    """
    array = check.last_axis("q", q, 4)
    down_x, down_y, down_z = np.moveaxis(dcm_from_quat(array)[..., 2, :], -1, 0)
    pitch = np.arctan2(-down_x, np.hypot(down_y, down_z))  # stays accurate near ±90°, where asin does not
    gimbal = np.abs(np.abs(pitch) - 0.5 * np.pi) < GIMBAL_MARGIN
    roll = np.where(gimbal, 0.0, np.arctan2(down_y + 0.0, down_z))  # + 0.0: −0 would turn π into −π
    # Undo the roll: the y axis is then level, and its heading is yaw at every pitch.
    level_y = quat_rotate(array, np.stack((np.zeros_like(roll), np.cos(roll), -np.sin(roll)), axis=-1))
    return np.stack((np.arctan2(0.0 - level_y[..., 0], level_y[..., 1]), pitch, roll), axis=-1)


def quat_from_euler_zyx(yaw_pitch_roll: ArrayLike) -> Floats:
    """Unit quaternions, shape (..., 4), of yaw, pitch and roll, shape (..., 3), rad."""
    half = 0.5 * check.last_axis("yaw_pitch_roll", yaw_pitch_roll, 3)
    (cy, cp, cr), (sy, sp, sr) = np.moveaxis(np.cos(half), -1, 0), np.moveaxis(np.sin(half), -1, 0)
    return np.stack(
        (
            cy * cp * cr + sy * sp * sr,
            cy * cp * sr - sy * sp * cr,
            cy * sp * cr + sy * cp * sr,
            sy * cp * cr - cy * sp * sr,
        ),
        axis=-1,
    )


def near_gimbal(q: ArrayLike) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """True where pitch is so near ±90° that yaw and roll cannot be separated."""
    down_x, down_y, down_z = np.moveaxis(dcm_from_quat(q)[..., 2, :], -1, 0)
    pitch = np.arctan2(-down_x, np.hypot(down_y, down_z))
    return np.asarray(np.abs(np.abs(pitch) - 0.5 * np.pi) < GIMBAL_MARGIN)


def body_rate_from_euler_zyx(yaw_pitch_roll: ArrayLike, rates: ArrayLike) -> Floats:
    """Angular rate of the body in body axes, rad/s, from the angles and their time derivatives.

    Parameters
    ----------
    yaw_pitch_roll : array_like (..., 3)
        Angles, rad.
    rates : array_like (..., 3)
        Their derivatives in the same order, rad/s.
    """
    _, pitch, roll = np.moveaxis(check.last_axis("yaw_pitch_roll", yaw_pitch_roll, 3), -1, 0)
    dyaw, dpitch, droll = np.moveaxis(check.last_axis("rates", rates, 3), -1, 0)
    sp, cp, sr, cr = np.sin(pitch), np.cos(pitch), np.sin(roll), np.cos(roll)
    return np.stack((droll - dyaw * sp, dpitch * cr + dyaw * sr * cp, -dpitch * sr + dyaw * cr * cp), axis=-1)
