"""Arguments that the magnetometer fits share, and reasons to refuse a result, whichever fit gave it."""

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from plumbob.calibration.fit import Reason
from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError


def finite_rows(name: str, value: ArrayLike, count: int | None = None) -> Floats:
    """Return samples (N, 3) as float64; of one length with the field where `count` is given, and all finite."""
    rows = check.rows(name, value, 3)
    if count is not None and len(rows) != count:
        raise ShapeError(f"{name} must have one row per sample of the field ({count}), but it has {len(rows)}.")
    finite = np.isfinite(rows).all(axis=1)
    if not finite.all():
        i = int(np.argmin(finite))
        raise ShapeError(f"{name} must be finite, but {name}[{i}] = {rows[i].tolist()}; leave such samples out.")
    return rows


def forces(value: ArrayLike, count: int) -> Floats:
    """Return specific forces (N, 3), m/s², as float64: as many as of the field, finite, and none of them zero."""
    acc = finite_rows("acc", value, count)
    nothing = ~acc.any(axis=1)
    if nothing.any():
        i = int(np.argmax(nothing))
        raise ShapeError(f"acc gives the vertical, but acc[{i}] is zero and has no direction. Leave such samples out.")
    return acc


def require_strength(strength: float | None) -> None:
    """Refuse a strength of the field, µT, that is not above zero; None passes."""
    if strength is not None and not 0.0 < strength < math.inf:
        raise ParameterError(
            f"strength must be above 0 µT, but it is {strength:g} µT; leave it out where it is not known."
        )


def require_dip(dip: float | None) -> None:
    """Refuse a dip, rad, of a vertical field or beyond; None passes."""
    if dip is not None and not abs(dip) < math.pi / 2.0:
        raise ParameterError(
            f"dip must lie between -π/2 and π/2 rad, but it is {dip:g} rad; turn degrees into radians first."
        )


def require_tilt_range(tilt_range: float) -> None:
    """Refuse a largest inclination, rad, that is not from level to upright."""
    if not 0.0 <= tilt_range <= math.pi / 2.0:
        raise ParameterError(
            f"tilt_range must be from 0 to π/2 rad, but it is {tilt_range:g} rad; turn degrees into radians first."
        )


def require_gain_sd(gyr_gain_sd: float) -> None:
    """Refuse a standard deviation of a gyroscope's gain outside 0 to 1, as a share of the gain."""
    if not 0.0 <= gyr_gain_sd <= 1.0:
        raise ParameterError(
            f"gyr_gain_sd must be from 0 to 1, a share of the gain, but it is {gyr_gain_sd:g}; divide percents by 100."
        )


def with_rates(
    t: ArrayLike, mag: ArrayLike, gyr: ArrayLike, acc: ArrayLike | None
) -> tuple[Floats, Floats, Floats, Floats | None]:
    """Return time (N,), field (N, 3), rates and specific force, as float64: rates finite, of the others some."""
    t = check.column("t", t)
    if t.size:
        check.increasing_time("t", t)
    mag = check.rows("mag", mag, 3, t.size)
    gyr = finite_rows("gyr", check.rows("gyr", gyr, 3, t.size))
    if acc is None:
        return t, mag, gyr, None
    acc = check.rows("acc", acc, 3, t.size)
    if not np.isfinite(acc).all(axis=1).any():
        raise ShapeError("acc must have a finite sample at least, but it has none; leave it out.")
    return t, mag, gyr, acc


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
        "That axis is defective, or the profile names a wrong column; look at the recording with 'plumbob info'.",
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
        "Look for steel right beside the sensor, and for a defective axis; then capture again through all attitudes.",
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
