"""From a fit to length 1 to a calibration: the size of what was measured, and the covariance that goes with it."""

from typing import Final

import numpy as np

from plumbob.calibration.ellipsoid.ellipsoid_fit import NormFit
from plumbob.core.check import Floats

_SYMMETRIC: Final = np.zeros((12, 9))  # centre and matrix, row by row, by centre and xx, yy, zz, xy, xz, yz
_SYMMETRIC[:3, :3] = np.eye(3)
for _column, (_i, _j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)), start=3):
    _SYMMETRIC[3 + 3 * _i + _j, _column] = _SYMMETRIC[3 + 3 * _j + _i, _column] = 1.0


def radius_of(matrix: Floats) -> float:
    """Length that a matrix (3, 3) brings to 1, on average, in the sensor's own scale."""
    return float(1.0 / np.cbrt(np.linalg.det(matrix)))


def scaled(fit: NormFit, size: float | None, *, alike: float) -> tuple[Floats, Floats]:
    """Matrix and covariance of a calibration from a symmetric fit, as `to_size`.

    Parameters
    ----------
    fit : NormFit
        The fit.
    size : float or None
        As in `to_size`.
    alike : float
        How many samples count as one, by which the covariance is widened.
    """
    known = _SYMMETRIC @ (fit.covariance * alike) @ _SYMMETRIC.T
    return to_size(fit.ellipsoid.shape, known, size)


def to_size(matrix: Floats, covariance: Floats, size: float | None) -> tuple[Floats, Floats]:
    """Matrix (3, 3) of a calibration, and covariance (12, 12) of bias and matrix, from those of a fit to length 1.

    Parameters
    ----------
    matrix, covariance : ndarray (3, 3), (12, 12)
        Of the fit; the matrix in the inverse unit of the measurement.
    size : float or None
        Length of the calibrated vector; where None, the matrix gets the determinant 1, and so keeps the sensor's scale.
    """
    factor = size or radius_of(matrix)
    by_fit = np.eye(9)
    if not size:
        by_fit -= np.outer(matrix.ravel(), np.linalg.inv(matrix).T.ravel()) / 3.0
    whole = np.eye(12)
    whole[3:, 3:] = factor * by_fit
    return factor * matrix, whole @ covariance @ whole.T


def to_size_of(distortion: Floats, covariance: Floats, size: float | None) -> tuple[Floats, Floats]:
    """The same from the inverse of the matrix, and the covariance of bias and that: how a field of 1 is measured."""
    inverse = np.asarray(np.linalg.inv(distortion), dtype=np.float64)
    whole = np.eye(12)
    whole[3:, 3:] = -np.kron(inverse, inverse.T)
    return to_size(inverse, whole @ covariance @ whole.T, size)
