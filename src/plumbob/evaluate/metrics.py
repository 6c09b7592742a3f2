"""Errors of an attitude against a reference, sample by sample.

Total, heading and inclination are those of the BROAD benchmark [Laidig2021]: with e = q_est ⊗ q_ref⁻¹ in a navigation
frame whose z axis is vertical, e = (w, x, y, z) is a turn about the vertical after a tilt, and

=============  ==========================  ========================================================
total          2 acos |w|                  angle of e
heading        2 atan |z / w|              angle of the turn about the vertical
inclination    2 acos √(w² + z²)           angle between the vertical and where the estimate puts it
=============  ==========================  ========================================================

all in [0, π], independent of the sign of a quaternion and the same in ENU, NED and NWU. They are computed by atan2:
acos loses half of the digits of a small angle.

Yaw, pitch and roll errors are signed, estimate minus reference, in (−π, π]. They are differences of Euler angles, not
angles of a rotation: near pitch ±90° a small rotation is a large difference, so yaw and roll are left out there.
"""

import numpy as np

from plumbob.check import Floats
from plumbob.rotations import euler_zyx_from_quat, quat_conjugate, quat_multiply
from plumbob.units import deg

QUANTITIES = ("total", "heading", "inclination", "yaw", "pitch", "roll")
NEEDS_HEADING = ("total", "heading", "yaw")
"""Quantities that mean nothing unless both headings count from the same zero."""

GIMBAL_GUARD = deg(5.0)
"""Distance of a pitch from ±90°, rad, inside which yaw and roll are not scored: there they magnify an error by 11.5."""


def attitude_errors(q_est: Floats, q_ref: Floats) -> dict[str, Floats]:
    """Errors of an estimate, one array (N,) in rad for each of `QUANTITIES`.

    Parameters
    ----------
    q_est, q_ref : array_like (N, 4)
        Attitudes at the same times, in the same frame, whose z axis is vertical. NaN where not known.

    Returns
    -------
    dict of str to ndarray (N,)
        NaN where one of the two is not known; yaw and roll also where one of the two is within `GIMBAL_GUARD` of
        pitch ±90°.
    """
    w, x, y, z = np.abs(np.moveaxis(error_quat(q_est, q_ref), -1, 0))
    return {
        "total": 2.0 * np.arctan2(np.sqrt(x * x + y * y + z * z), w),
        "heading": 2.0 * np.arctan2(z, w),
        "inclination": 2.0 * np.arctan2(np.hypot(x, y), np.hypot(w, z)),
        **_euler_errors(q_est, q_ref),
    }


def error_quat(q_est: Floats, q_ref: Floats) -> Floats:
    """Error e = q_est ⊗ q_ref⁻¹ in the navigation frame, (N, 4)."""
    return quat_multiply(q_est, quat_conjugate(q_ref))


def total_rmse(q_est: Floats, q_ref: Floats) -> float:
    """Root mean square of the total error, rad, of attitudes that are all known."""
    return float(np.sqrt(np.mean(attitude_errors(q_est, q_ref)["total"] ** 2)))


def wrap(angle: Floats) -> Floats:
    """Bring angles, rad, to (−π, π]."""
    return np.pi - np.mod(np.pi - angle, 2.0 * np.pi)


def _euler_errors(q_est: Floats, q_ref: Floats) -> dict[str, Floats]:
    est, ref = euler_zyx_from_quat(q_est), euler_zyx_from_quat(q_ref)
    yaw, pitch, roll = np.moveaxis(wrap(est - ref), -1, 0)
    steepest = np.maximum(np.abs(est[:, 1]), np.abs(ref[:, 1]))
    steep = steepest > 0.5 * np.pi - GIMBAL_GUARD
    return {"yaw": np.where(steep, np.nan, yaw), "pitch": pitch, "roll": np.where(steep, np.nan, roll)}
