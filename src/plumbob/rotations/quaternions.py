"""Quaternions, scalar first (wxyz) of Hamilton: product, rotation, mean, and to and from SciPy.

Quaternion arrays: Hamilton, scalar first (wxyz), last axis of 4, any leading shape.

``q_nb`` takes body coordinates to navigation coordinates: ``v_n = quat_rotate(q_nb, v_b)``. Adjacent letters cancel:
``q_ns = quat_multiply(q_nb, q_bs)``. Other orders enter and leave only through `quat_from_xyzw` and `quat_to_xyzw`.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from plumbob.core import check
from plumbob.core._jit import Kernel
from plumbob.core.check import Floats
from plumbob.core.errors import ShapeError
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
    return by_component(kernels.quat_mul, qa, qb)


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
    return by_component(kernels.rotate, qa, va)


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
    from plumbob.rotations.so3 import quat_from_rotvec, rotvec_from_quat

    step = rotvec_from_quat(quat_multiply(quat_conjugate(a), b))
    return quat_multiply(a, quat_from_rotvec(step * np.asarray(fraction, dtype=np.float64)[..., np.newaxis]))


def quat_from_xyzw(quat_xyzw: ArrayLike) -> Floats:
    """Reorder quaternions that carry their scalar last (SciPy's default, ROS, three.js)."""
    return np.ascontiguousarray(np.roll(check.last_axis("quat_xyzw", quat_xyzw, 4), 1, axis=-1))


def quat_to_xyzw(q: ArrayLike) -> Floats:
    """Reorder to scalar last, for SciPy's default, ROS or three.js."""
    return np.ascontiguousarray(np.roll(check.last_axis("q", q, 4), -1, axis=-1))


def quat_continuous(q: ArrayLike) -> Floats:
    """Choose signs along the first axis so that neighbours lie on the same half of the sphere; rotations stay.

    Parameters
    ----------
    q : array_like (N, 4)
        Unit quaternions; NaN rows keep their NaN and break the chain.
    """
    array = check.rows("q", q, 4)
    flips = np.sum(array[1:] * array[:-1], axis=1) < 0.0
    sign = np.where(np.cumsum(np.concatenate(([False], flips))) % 2 == 1, -1.0, 1.0)
    return array * sign[:, np.newaxis]


def by_component(kernel: Kernel[..., Any], *arrays: Floats) -> Floats:
    """Run a branch-free scalar kernel on whole arrays: their last axes are its arguments, its results the last axis."""
    return np.stack(kernel.py_func(*(a[..., i] for a in arrays for i in range(a.shape[-1]))), axis=-1)


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
