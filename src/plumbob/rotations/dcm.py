"""Direction cosine matrices: ``v_n = C_nb @ v_b``, last two axes of (3, 3)."""

import numpy as np
from numpy.typing import ArrayLike

from plumbob import check
from plumbob.check import Floats
from plumbob.errors import ShapeError


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
        raise ShapeError("c has determinant −1: it mirrors, as a left-handed set of axes does, and is no rotation.")
    return _pivoted(m)


def _pivoted(m: Floats) -> Floats:
    """Read the row of 4 q qᵀ with the largest diagonal entry, [Shepperd1978]."""
    m00, m11, m22 = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    w, x, y, z = 1 + m00 + m11 + m22, 1 + m00 - m11 - m22, 1 - m00 + m11 - m22, 1 - m00 - m11 + m22
    wx, wy, wz = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    xy, xz, yz = m[..., 0, 1] + m[..., 1, 0], m[..., 0, 2] + m[..., 2, 0], m[..., 1, 2] + m[..., 2, 1]
    rows = np.stack((w, wx, wy, wz, wx, x, xy, xz, wy, xy, y, yz, wz, xz, yz, z), axis=-1).reshape((*w.shape, 4, 4))
    pivot = np.argmax(np.stack((w, x, y, z), axis=-1), axis=-1)
    q = np.take_along_axis(rows, pivot[..., np.newaxis, np.newaxis], axis=-2)[..., 0, :]
    q = q / np.sqrt(np.sum(q * q, axis=-1, keepdims=True))
    return np.asarray(np.where(q[..., :1] < 0.0, -q, q))
