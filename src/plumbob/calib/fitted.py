"""What a fit of one triad gives: the calibration, and what each sample says about it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from plumbob.cards import TriadCalibration
from plumbob.check import Floats


@dataclass(frozen=True, eq=False)
class Fitted:
    """Fit of one triad.

    Attributes
    ----------
    calibration : TriadCalibration
        The result, with covariance and quality.
    measured : ndarray (N, 3)
        What was fitted: samples, or means of poses or plateaus, unit of the triad.
    residuals : ndarray (N,) or (N, 3)
        What the fit leaves of each, in the unit of the triad.
    used : ndarray (N,) of bool
        False for outliers.
    remarks : tuple of str
        What to know about it, each a sentence.
    """

    calibration: TriadCalibration
    measured: Floats
    residuals: Floats
    used: NDArray[np.bool_]
    remarks: tuple[str, ...] = ()
