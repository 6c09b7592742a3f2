"""What a gyroscope's calibration has beside the part that is being fitted, and the covariance that a fit fills."""

from typing import Final

import numpy as np

from plumbob.calib.model import temperature_drift
from plumbob.cards import UNITS, TriadCalibration
from plumbob.check import Floats
from plumbob.errors import CalibrationError

UNCALIBRATED: Final = TriadCalibration(np.eye(3), np.zeros(3), UNITS["gyr"], UNITS["gyr"])
"""A gyroscope of which nothing is known but its data sheet."""


def without_known(gyr: Floats, known: TriadCalibration, *, temp_c: Floats | None, acc: Floats | None) -> Floats:
    """Rates less what temperature and specific force are known to add, (N, 3); the bias stays.

    Parameters
    ----------
    gyr : ndarray (N, 3)
        Measured rates, rad/s.
    known : TriadCalibration
        Calibration so far.
    temp_c : ndarray (N,) or None
        Temperature, °C; needed where `known` has a polynomial.
    acc : ndarray (N, 3) or None
        Calibrated specific force, m/s²; needed where `known` has a g-sensitivity.

    Raises
    ------
    CalibrationError
        If one that is needed is missing.
    """
    left = gyr
    if known.bias_per_k.any():
        if temp_c is None:
            raise CalibrationError("the card so far corrects the gyroscope for temperature; record temp_c too.")
        left = left - temperature_drift(known, temp_c)
    if known.g_sensitivity.any():
        if acc is None:
            raise CalibrationError("the card so far corrects the gyroscope for specific force; record acc too.")
        left = left - acc @ known.g_sensitivity.T
    return left


def new_bias_covariance(known: TriadCalibration, bias: Floats) -> Floats:
    """Covariance (12, 12) after the bias was found anew, with covariance (3, 3), and the matrix was kept."""
    whole = np.zeros((12, 12))
    if known.covariance is not None:
        whole[3:, 3:] = known.covariance[3:, 3:]
    whole[:3, :3] = bias
    return whole


def inverse_covariance(matrix: Floats, inverse: Floats) -> Floats:
    """Covariance (9, 9) of an inverse, row by row, from that of the matrix: d(A⁻¹) = −A⁻¹ dA A⁻¹.

    Parameters
    ----------
    matrix : ndarray (9, 9)
        Covariance of A, row by row.
    inverse : ndarray (3, 3)
        A⁻¹.
    """
    change = np.kron(inverse, inverse.T)
    return np.asarray(change @ matrix @ change.T)
