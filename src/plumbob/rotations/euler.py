"""Euler angles in one sequence only, ZYX: yaw ψ about z, then pitch θ about y, then roll φ about x.

Angles are always given together, in that order, on a last axis of 3, in radians. What yaw 0 means depends on the
navigation frame: x is North in NED and NWU, East in ENU. Pitch is positive nose up in NED with a forward-right-down
body, and nose down in ENU or NWU with a forward-left-up body: the sign follows the axes, not the aircraft.

Gimbal policy: within `GIMBAL_MARGIN` of pitch ±90° only yaw ∓ roll is defined; there roll is set to 0 and yaw carries
the sum, so that the angles still give back the same rotation. `near_gimbal` tells where that happened.
"""

import numpy as np
from numpy.typing import ArrayLike

from plumbob import check
from plumbob.check import Floats
from plumbob.rotations import kernels
from plumbob.rotations.quat import by_component

GIMBAL_MARGIN = 1e-6
"""Distance from pitch ±90°, rad, inside which roll is set to 0. Double precision resolves pitch to about 1e-8 there."""


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
    q0, q1, q2, q3 = np.moveaxis(check.last_axis("q", q, 4), -1, 0)
    down_x, down_y, down_z = np.moveaxis(by_component(kernels.third_row, check.floats("q", q)), -1, 0)
    pitch = np.arctan2(-down_x, np.hypot(down_y, down_z))  # stays accurate near ±90°, where asin does not
    gimbal = _gimbal(pitch)
    yaw = np.arctan2(2.0 * (q1 * q2 + q0 * q3), q0 * q0 + q1 * q1 - q2 * q2 - q3 * q3)
    yaw = np.where(gimbal, np.arctan2(2.0 * (q0 * q3 - q1 * q2), q0 * q0 - q1 * q1 + q2 * q2 - q3 * q3), yaw)
    roll = np.where(gimbal, 0.0, np.arctan2(down_y, down_z))
    return np.stack((yaw, pitch, roll), axis=-1)


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
    """True where pitch is so near ±90° that yaw and roll cannot be told apart."""
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
