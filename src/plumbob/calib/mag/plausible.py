"""What a magnetometer that works cannot be: reasons to refuse a result, whichever fit gave it."""

from typing import Final

import numpy as np

from plumbob.calib.refusal import Reason
from plumbob.check import Floats

WEAKEST, STRONGEST = 15.0, 90.0
"""Strengths that the Earth's field may have in a sensor's own scale, µT: 22 to 67 µT with a third of error."""

_MOST_UNEQUAL: Final = 3.0


def stuck(mag: Floats) -> Reason | None:
    """Reason to refuse a field (N, 3), µT, one or two axes of which always read the same; None where none does."""
    same = np.ptp(mag, axis=0) == 0.0
    if not same.any() or same.all():
        return None
    axes = " and ".join("xyz"[i] for i in np.flatnonzero(same))
    read = " and ".join(f"{value:.4g}" for value in mag[0, same].tolist())
    return Reason(
        "implausible",
        f"{axes} of the magnetometer always {'reads' if same.sum() == 1 else 'read'} {read} µT.",
        "That axis is defect, or the profile names a wrong column; look at the recording with 'plumbob info'.",
    )


def unequal(matrix: Floats) -> Reason | None:
    """Reason to refuse a matrix (3, 3) whose gains differ too much between directions."""
    gains = np.linalg.svd(matrix, compute_uv=False)
    ratio = float(gains[0] / gains[-1])
    if ratio <= _MOST_UNEQUAL:
        return None
    return Reason(
        "implausible",
        f"the sensitivity would differ by a factor of {ratio:.1f} between directions.",
        "Look for steel right beside the sensor, and for a defect axis; then capture anew through all attitudes.",
    )


def wrong_field(radius: float, strength: float | None) -> Reason | None:
    """Reason to refuse a field that measures `radius` in the sensor's own scale, µT, where it is `strength`."""
    low, high = (WEAKEST, STRONGEST) if strength is None else (0.6 * strength, 1.6 * strength)
    if low <= radius <= high:
        return None
    return Reason(
        "wrong-field",
        f"the field measures {radius:.3g} µT in the sensor's own scale, but {low:.3g} to {high:.3g} µT can be.",
        "Check the unit and the gain of the magnetometer, and that the capture was not taken beside a magnet.",
    )
