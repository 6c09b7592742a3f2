"""Rotations: Hamilton quaternions, scalar first, ``q_nb`` from body to navigation; everything in radians."""

from plumbob.rotations.average import quat_mean
from plumbob.rotations.dcm import dcm_from_quat, quat_from_dcm
from plumbob.rotations.euler import body_rate_from_euler_zyx, euler_zyx_from_quat, near_gimbal, quat_from_euler_zyx
from plumbob.rotations.frames import (
    Frame,
    North,
    assert_same,
    axes_letters,
    body_axes,
    change_frame,
    every_axes,
    frame_rotation,
    in_body_axes,
    signed_axes,
)
from plumbob.rotations.quat import (
    IDENTITY,
    quat_angle,
    quat_conjugate,
    quat_continuous,
    quat_from_xyzw,
    quat_multiply,
    quat_normalize,
    quat_rotate,
    quat_slerp,
    quat_to_xyzw,
)
from plumbob.rotations.scipy_bridge import quat_from_rotation, rotation_from_quat
from plumbob.rotations.so3 import (
    left_jacobian,
    left_jacobian_inverse,
    quat_from_rotvec,
    right_jacobian,
    right_jacobian_inverse,
    rotvec_from_quat,
    skew,
)

__all__ = [
    "IDENTITY",
    "Frame",
    "North",
    "assert_same",
    "axes_letters",
    "body_axes",
    "body_rate_from_euler_zyx",
    "change_frame",
    "dcm_from_quat",
    "euler_zyx_from_quat",
    "every_axes",
    "frame_rotation",
    "in_body_axes",
    "left_jacobian",
    "left_jacobian_inverse",
    "near_gimbal",
    "quat_angle",
    "quat_conjugate",
    "quat_continuous",
    "quat_from_dcm",
    "quat_from_euler_zyx",
    "quat_from_rotation",
    "quat_from_rotvec",
    "quat_from_xyzw",
    "quat_mean",
    "quat_multiply",
    "quat_normalize",
    "quat_rotate",
    "quat_slerp",
    "quat_to_xyzw",
    "right_jacobian",
    "right_jacobian_inverse",
    "rotation_from_quat",
    "rotvec_from_quat",
    "signed_axes",
    "skew",
]
