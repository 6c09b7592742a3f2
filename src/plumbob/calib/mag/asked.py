"""What the fits of a magnetometer are asked with, checked at their door: samples, and figures in SI units and µT."""

import math

import numpy as np
from numpy.typing import ArrayLike

from plumbob import check
from plumbob.check import Floats
from plumbob.errors import ParameterError, ShapeError


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
        raise ShapeError(f"acc tells the vertical, but acc[{i}] is zero, which has none; leave such samples out.")
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
