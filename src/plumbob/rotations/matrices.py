"""Rotation matrices and ZYX Euler angles: yaw ψ about z, then pitch θ about y, then roll φ about x.

Angles are always given together, in that order, on a last axis of 3, in radians. What yaw 0 means depends on the
navigation frame: x is North in NED and NWU, East in ENU. Pitch is positive nose up in NED with a forward-right-down
body, and nose down in ENU or NWU with a forward-left-up body: the sign follows the axes, not the aircraft.

Gimbal policy: within `GIMBAL_MARGIN` of pitch ±90° only yaw ∓ roll is defined; there roll is set to 0 and yaw carries
the sum. Yaw is always computed for the roll that is returned, so that the angles give back the same rotation: to
rounding outside the margin, to twice the margin inside. `near_gimbal` shows where that happened.
"""

import numpy as np
from numpy.typing import ArrayLike

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ShapeError
from plumbob.rotations import kernels
from plumbob.rotations.quaternions import by_component, quat_rotate


def dcm_from_quat(q: ArrayLike) -> Floats:
    """Matrices, shape (..., 3, 3), of unit quaternions, shape (..., 4)."""
    q0, q1, q2, q3 = np.moveaxis(check.last_axis("q", q, 4), -1, 0)
    rows = (
        q0 * q0 + q1 * q1 - q2 * q2 - q3 * q3, 2.0 * (q1 * q2 - q0 * q3), 2.0 * (q1 * q3 + q0 * q2),
        2.0 * (q1 * q2 + q0 * q3), q0 * q0 - q1 * q1 + q2 * q2 - q3 * q3, 2.0 * (q2 * q3 - q0 * q1),
        2.0 * (q1 * q3 - q0 * q2), 2.0 * (q2 * q3 + q0 * q1), q0 * q0 - q1 * q1 - q2 * q2 + q3 * q3,
    )  # fmt: skip
    return np.stack(rows, axis=-1).reshape((*q0.shape, 3, 3))  # [Sola2017] (115)


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


GIMBAL_MARGIN = 1e-8
"""Distance from pitch ±90°, rad, inside which roll is set to 0. There rounding leaves roll about 1e-8 rad uncertain."""


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
    down_x, down_y, down_z = np.moveaxis(by_component(kernels.third_row, array), -1, 0)
    pitch = np.arctan2(-down_x, np.hypot(down_y, down_z))  # stays accurate near ±90°, where asin does not
    roll = np.where(_gimbal(pitch), 0.0, np.arctan2(down_y + 0.0, down_z))  # + 0.0: −0 would turn π into −π
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
    down_x, down_y, down_z = np.moveaxis(by_component(kernels.third_row, check.last_axis("q", q, 4)), -1, 0)
    return np.asarray(_gimbal(np.arctan2(-down_x, np.hypot(down_y, down_z))))


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


def _gimbal(pitch: Floats) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    return np.abs(np.abs(pitch) - 0.5 * np.pi) < GIMBAL_MARGIN
