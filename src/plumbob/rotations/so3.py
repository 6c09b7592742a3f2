"""The group SO(3): exponential, logarithm and the Jacobians between a rotation vector and its rotation.

The Jacobians follow [Sola2018]: ``exp(r + d) ≈ exp(r) exp(Jr(r) d)`` and ``exp(r + d) ≈ exp(Jl(r) d) exp(r)``.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core import check
from plumbob.core.check import Floats

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
