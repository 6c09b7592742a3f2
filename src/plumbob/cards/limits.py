"""What a calibration of a working sensor keeps to: a card beyond was edited wrongly, or found from wrong data."""

from datetime import datetime
from typing import Any, Final

import numpy as np

from plumbob.cards.file import require_text
from plumbob.check import Floats
from plumbob.constants import IMPOSSIBLE_ACCELERATION, IMPOSSIBLE_FIELD, IMPOSSIBLE_RATE
from plumbob.errors import CalibrationError

GAINS: Final = (0.1, 10.0)
"""Smallest and largest gain of a matrix; a unit in another scale is a matter of its profile."""

_BIASES: Final = {"rad/s": IMPOSSIBLE_RATE, "m/s2": IMPOSSIBLE_ACCELERATION, "uT": IMPOSSIBLE_FIELD}
_ROUNDING: Final = 1e-6  # of a covariance, relative to the standard deviations; inverses leave less
_RESIDUE: Final = 1e-12  # of the largest variance: what products leave where a parameter has no variance of its own


def require_matrix(matrix: Floats) -> None:
    """Refuse a matrix (3, 3) that is singular, amplifies as no sensor does, or mirrors."""
    if not np.linalg.cond(matrix) < 1e3:
        raise CalibrationError(f"matrix is singular or nearly so: {matrix.tolist()}.")
    gains = np.linalg.svd(matrix, compute_uv=False)
    if gains[-1] < GAINS[0] or gains[0] > GAINS[1]:
        raise CalibrationError(
            f"matrix must have gains from {GAINS[0]:g} to {GAINS[1]:g}, not {gains[-1]:.3g} to {gains[0]:.3g}: "
            "the units of the recording are wrong; declare them in its profile and calibrate again."
        )
    if np.linalg.det(matrix) < 0.0:
        raise CalibrationError(
            "matrix is left-handed: its determinant is negative, as where an axis has the wrong sign or two are "
            "exchanged. Declare the axes in the profile (axes, mirrored) and calibrate again."
        )


def require_bias(bias: Floats, unit: str) -> None:
    """Refuse a bias (3,) beyond what any sensor measures in this unit."""
    most = _BIASES.get(unit, np.inf)
    if (np.abs(bias) > most).any():
        raise CalibrationError(
            f"bias must be within ±{most:g} {unit}, beyond which no sensor measures, but it is {bias}."
        )


def require_covariance(covariance: Floats) -> None:
    """Refuse a covariance that is not symmetric to rounding."""
    sd = np.sqrt(np.diag(covariance))
    allowed = _ROUNDING * np.outer(sd, sd) + _RESIDUE * sd.max() ** 2
    with np.errstate(over="ignore"):
        beyond = np.abs(covariance - covariance.T) - allowed
    if (beyond > 0.0).any():
        i, j = np.unravel_index(int(beyond.argmax()), beyond.shape)
        raise CalibrationError(
            f"covariance must be symmetric, but entries ({i}, {j}) and ({j}, {i}) are {covariance[i, j]:g} and "
            f"{covariance[j, i]:g}."
        )


def require_dates(**dates: Any) -> None:
    """Refuse what is no date, or date and time, of ISO 8601; an empty text says that it is not known."""
    require_text(**dates)
    for name, value in dates.items():
        try:
            datetime.fromisoformat(value or "2000-01-01")
        except ValueError as error:
            raise CalibrationError(f"{name} must be ISO 8601, as 2026-11-21, but it is {value!r}.") from error


def texts(name: str, value: Any) -> tuple[str, ...]:
    """Tuple of texts, from a list or a tuple."""
    if not isinstance(value, list | tuple) or not all(isinstance(one, str) for one in value):
        raise CalibrationError(f"{name} must be a list of texts, but it is {value!r}.")
    return tuple(value)
