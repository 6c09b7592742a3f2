"""Quaternions, scalar first (wxyz) of Hamilton: product, rotation, mean, and to and from SciPy.

Quaternion arrays: Hamilton, scalar first (wxyz), last axis of 4, any leading shape.

``q_nb`` takes body coordinates to navigation coordinates: ``v_n = quat_rotate(q_nb, v_b)``. Adjacent letters cancel:
``q_ns = quat_multiply(q_nb, q_bs)``. Other orders enter and leave only through `quat_from_xyzw` and `quat_to_xyzw`.

The group SO(3): exponential, logarithm and the Jacobians between a rotation vector and its rotation.

The Jacobians follow [Sola2018]: ``exp(r + d) ≈ exp(r) exp(Jr(r) d)`` and ``exp(r + d) ≈ exp(Jl(r) d) exp(r)``.
"""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
    step = rotvec_from_quat(quat_multiply(quat_conjugate(a), b))
    return quat_multiply(a, quat_from_rotvec(step * np.asarray(fraction, dtype=np.float64)[..., np.newaxis]))


def quat_from_xyzw(quat_xyzw: ArrayLike) -> Floats:
    """Reorder quaternions that carry their scalar last (SciPy's default, ROS, three.js)."""
    return np.ascontiguousarray(np.roll(check.last_axis("quat_xyzw", quat_xyzw, 4), 1, axis=-1))


def quat_to_xyzw(q: ArrayLike) -> Floats:
    """Reorder to scalar last, for SciPy's default, ROS or three.js."""
    return np.ascontiguousarray(np.roll(check.last_axis("q", q, 4), -1, axis=-1))


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


_SMALL2 = 1e-4  # squared angle below which the exponential and the first Jacobian term use their series
# The other terms lose 1/angle² of their digits to cancellation, so their series serve up to 1 rad. Both end where the
# next term is below 1e-17 of the sum: 1/(2k+3)! with alternating signs, and |B(2k+2)|/(2k+2)!, B the Bernoulli numbers.
_THIRD = tuple((-1) ** k / math.factorial(2 * k + 3) for k in range(9))
_COTANGENT = (
    1 / 12, 1 / 720, 1 / 30240, 1 / 1209600, 1 / 47900160, 691 / 1307674368000, 1 / 74724249600,
    3617 / 10670622842880000, 43867 / 5109094217170944000, 174611 / 802857662698291200000,
    77683 / 14101100039391805440000,
)  # fmt: skip


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


def right_jacobian(rotvec: ArrayLike) -> Floats:
    """Right Jacobian Jr of SO(3), shape (..., 3, 3): ``exp(r + d) ≈ exp(r) exp(Jr d)``."""
    r = check.last_axis("rotvec", rotvec, 3)
    a, b = _jacobian_terms(r)
    w = skew(r)
    return np.asarray(np.eye(3) - a * w + b * (w @ w))  # [Sola2018] (143)


def left_jacobian(rotvec: ArrayLike) -> Floats:
    """Left Jacobian Jl(r) = Jr(−r), shape (..., 3, 3): ``exp(r + d) ≈ exp(Jl d) exp(r)``."""
    return right_jacobian(-check.last_axis("rotvec", rotvec, 3))  # [Sola2018] (145)


def right_jacobian_inverse(rotvec: ArrayLike) -> Floats:
    """Inverse of the right Jacobian, shape (..., 3, 3), for angles below 2π."""
    r = check.last_axis("rotvec", rotvec, 3)
    angle2 = np.sum(r * r, axis=-1)
    small = angle2 < 1.0
    angle = np.sqrt(np.where(small, 1.0, angle2))
    closed = (1.0 - 0.5 * angle * np.cos(0.5 * angle) / np.sin(0.5 * angle)) / (angle * angle)
    c = np.where(small, _series(_COTANGENT, angle2, small), closed)[..., np.newaxis, np.newaxis]
    w = skew(r)
    return np.asarray(np.eye(3) + 0.5 * w + c * (w @ w))  # [Sola2018] (144)


def left_jacobian_inverse(rotvec: ArrayLike) -> Floats:
    """Inverse of the left Jacobian, shape (..., 3, 3), for angles below 2π."""
    return right_jacobian_inverse(-check.last_axis("rotvec", rotvec, 3))  # [Sola2018] (146)


def _jacobian_terms(r: Floats) -> tuple[Floats, Floats]:
    angle2 = np.sum(r * r, axis=-1)
    small = angle2 < _SMALL2
    angle = np.sqrt(np.where(small, 1.0, angle2))
    half_sinc = np.sin(0.5 * angle) / angle
    a = np.where(small, 0.5 - angle2 * (1 / 24 - angle2 / 720), 2.0 * half_sinc * half_sinc)
    small = angle2 < 1.0
    angle = np.sqrt(np.where(small, 1.0, angle2))
    b = np.where(small, _series(_THIRD, angle2, small), (angle - np.sin(angle)) / angle**3)
    return a[..., np.newaxis, np.newaxis], b[..., np.newaxis, np.newaxis]


def _series(coefficients: tuple[float, ...], angle2: Floats, small: NDArray[np.bool_]) -> Floats:
    return np.asarray(np.polynomial.polynomial.polyval(np.where(small, angle2, 0.0), coefficients))
