"""What the matrix of a calibration says about the sensing axes: gains, and where the axes point."""

from typing import NamedTuple

import numpy as np

from plumbob.cards import TriadCalibration
from plumbob.check import Floats

_ROUNDING = 8.0 * np.finfo(float).eps  # of the inverse of a matrix near 1


class SensingAxes(NamedTuple):
    """Axes of a triad as its inverse matrix has them: row i of ``inv(matrix)`` is what axis i answers to.

    Attributes
    ----------
    scale : ndarray (3,)
        Gain of each axis minus 1: 0.01 reads 1 % too much.
    scale_sd : ndarray (3,) or None
        Standard deviations to first order, where the covariance is known.
    misalignment : ndarray (3,)
        Angle between each sensing axis and the axis of the case that it is called after, rad.
    skew : ndarray (3,)
        Angles between the sensing axes x and y, x and z, y and z, less a right angle, rad.
    """

    scale: Floats
    scale_sd: Floats | None
    misalignment: Floats
    skew: Floats


def sensing_axes(calibration: TriadCalibration) -> SensingAxes:
    """Gains and directions of a triad's axes."""
    response = np.asarray(np.linalg.inv(calibration.matrix), dtype=np.float64)
    gain = np.linalg.norm(response, axis=1)
    unit = np.asarray(response / gain[:, np.newaxis], dtype=np.float64)
    across = np.sqrt(np.maximum(0.0, 1.0 - np.diag(unit) ** 2))
    between = unit @ unit.T
    return SensingAxes(
        scale=_cleaned(gain - 1.0),
        scale_sd=_gain_sd(calibration, response, unit),
        misalignment=np.arctan2(np.where(across > np.sqrt(_ROUNDING), across, 0.0), np.diag(unit)),
        skew=_cleaned(-np.arcsin(between[[0, 0, 1], [1, 2, 2]])),
    )


def _gain_sd(calibration: TriadCalibration, response: Floats, unit: Floats) -> Floats | None:
    """From dR = −R dM R: the gain of axis i changes by −R_ik dM_kl (R_l · u_i)."""
    if calibration.covariance is None:
        return None
    slopes = np.einsum("ik,lj,ij->ikl", response, response, unit).reshape(3, 9)
    variance = np.einsum("ia,ab,ib->i", slopes, calibration.covariance[3:, 3:], slopes)
    return np.asarray(np.sqrt(np.maximum(0.0, variance)))


def _cleaned(values: Floats) -> Floats:
    return np.asarray(np.where(np.abs(values) > _ROUNDING, values, 0.0))
