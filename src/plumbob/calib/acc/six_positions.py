"""The classic calibration of an accelerometer: each axis held up and down, bias and scale from the pairs.

For axis i, f₊ measured with it up and f₋ with it down: bias (f₊ + f₋)/2, gain (f₊ − f₋)/2 over gravity.
"""

import math
from typing import Final

import numpy as np

from plumbob.calib.ellipsoid.norm_fit import NormFit, Shape
from plumbob.calib.ellipsoid.quadric import Ellipsoid
from plumbob.calib.regions import REGIONS
from plumbob.check import Floats
from plumbob.units import deg

NEAR: Final = deg(15.0)
"""How far from upright a face may be held, rad."""


def faces(poses: Floats) -> list[int] | None:
    """Which of six poses (6, 3) is +x, −x, +y, −y, +z, −z; None where they are not one of each within `NEAR`."""
    cosines = REGIONS[:6] @ (poses / np.linalg.norm(poses, axis=1, keepdims=True)).T
    found = np.argmax(cosines, axis=1)
    one_each = len(poses) == 6 and len(set(found.tolist())) == 6 and cosines.max(axis=1).min() >= math.cos(NEAR)
    return found.tolist() if one_each else None


def six_positions(poses: Floats, *, noise: float = 0.0) -> NormFit | None:
    """Bias and scale by pairs; None where the poses are not the six faces within 15°.

    It cannot see misalignment, and it takes faces for upright: a face held at the angle θ reads low by 1 − cos θ, 1.4 %
    at 10° and 0.004 % at 0.5°. `norm_fit` with the shape of the axes takes the same poses and does not mind the tilt.

    Parameters
    ----------
    poses : ndarray (6, 3)
        Mean specific force of each pose, of any unit.
    noise : float
        Standard deviation of a mean, same unit; what the lengths scatter after the fit is added to it.
    """
    order = faces(poses)
    if order is None:
        return None
    read = poses[order].reshape(3, 2, 3)
    up, down = np.diag(read[:, 0]), np.diag(read[:, 1])
    bias, gain = 0.5 * (up + down), 0.5 * (up - down)
    ellipsoid = Ellipsoid(bias, np.diag(1.0 / gain))
    residuals = _distances(poses, ellipsoid)
    sd = math.hypot(noise, float(np.sqrt(np.mean(residuals**2))))
    variance = 0.5 * sd**2  # of half the sum, and of half the difference
    covariance = np.diag(np.concatenate((np.full(3, variance), variance / gain**4, np.zeros(3))))
    used = np.ones(6, dtype=np.bool_)
    return NormFit(Shape.AXES, ellipsoid, covariance, sd, residuals, used, 1.0, float(residuals @ residuals))


def _distances(poses: Floats, ellipsoid: Ellipsoid) -> Floats:
    """Orthogonal distances from an ellipsoid along the axes, to first order."""
    scaled = (poses - ellipsoid.centre) @ ellipsoid.shape
    size = np.linalg.norm(scaled, axis=1)
    slope = np.linalg.norm(scaled @ ellipsoid.shape, axis=1) / size
    return np.asarray((size - 1.0) / slope)
