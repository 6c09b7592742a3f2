"""Recordings of several units on one time line, and units whose clocks are late put right."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ClockError, ShapeError
from plumbob.core.time import GAP_FACTOR
from plumbob.data import ImuData
from plumbob.data.array import ImuArray, UnitMount

Imus = Mapping[str, ImuData]


def joined(units: Imus, mounts: Mapping[str, UnitMount] | None = None) -> ImuArray:
    """Put recordings with time lines of their own on that of the first, by linear interpolation, never across a gap.

    Parameters
    ----------
    units : mapping of str to ImuData
        By name; times count from the same start, or from the `t0_ns` of each, where all have one.
    mounts : mapping of str to UnitMount, optional
        How each sits on the body. A clock offset is taken into account, and is zero in the result.

    Returns
    -------
    ImuArray
        NaN where a unit has no samples on both sides of an instant.

    Raises
    ------
    ShapeError
        If there is no unit.
    ClockError
        If a unit has no sample within the time of the first.
    """
    if not units:
        raise ShapeError("an array needs at least one unit, but none was given.")
    mounts = dict(mounts or {})
    first = check.kind("unit", next(iter(units.values())), ImuData)
    epochs = [imu.meta.t0_ns for imu in units.values()]
    absolute = all(epochs)
    resampled = {}
    for name, imu in units.items():
        mount = mounts.get(name, UnitMount())
        start = (imu.meta.t0_ns - first.meta.t0_ns) * 1e-9 if absolute else 0.0
        taken = imu.t + start + mount.clock_offset
        resampled[name] = imu if imu is first and mount.clock_offset == 0.0 else _resampled(name, imu, taken, first.t)
        mounts[name] = replace(mount, clock_offset=0.0)
    return ImuArray(resampled, mounts)


def aligned(array: ImuArray) -> ImuArray:
    """The same array with the clock offsets of its mounts put right, which are zero in the result."""
    if all(mount.clock_offset == 0.0 for mount in array.mounts.values()):
        return array
    units = {
        name: imu if (late := array.mounts[name].clock_offset) == 0.0 else _resampled(name, imu, imu.t + late, imu.t)
        for name, imu in array.units.items()
    }
    return ImuArray(units, {name: replace(mount, clock_offset=0.0) for name, mount in array.mounts.items()})


def _resampled(name: str, imu: ImuData, taken: Floats, t: Floats) -> ImuData:
    """Samples that were taken at `taken` (M,), as they would have been at t (N,)."""
    if taken[-1] < t[0] or taken[0] > t[-1]:
        raise ClockError(
            f"unit '{name}' was recorded from {taken[0]:.6g} s to {taken[-1]:.6g} s, but the first one from "
            f"{t[0]:.6g} s to {t[-1]:.6g} s: they have no time in common. Do their clocks count from the same start?"
        )
    triads = {triad: _interpolated(t, taken, getattr(imu, triad)) for triad in imu.triads}
    present = {triad: values for triad, values in triads.items() if np.isfinite(values).any()}
    if not present:
        raise ClockError(f"unit '{name}' has no values at the times of the first unit. Do they overlap?")
    temp_c = None if imu.temp_c is None else np.interp(t, taken, imu.temp_c)
    meta = replace(imu.meta, unit_check=False)
    nearest = np.clip(np.searchsorted(taken, t), 0, taken.size - 1)
    before = np.maximum(nearest - 1, 0)
    return ImuData(t, **present, temp_c=temp_c, flags=imu.flags[nearest] | imu.flags[before], meta=meta)


def _interpolated(t: Floats, taken: Floats, values: Floats) -> Floats:
    """Values (M, 3) at the times t, linear between those that are there; NaN beyond them and in gaps."""
    there = np.isfinite(values).all(axis=1)
    resampled = np.full((t.size, 3), np.nan)
    times = taken[there]
    if times.size < 2:
        return resampled
    right = np.clip(np.searchsorted(times, t), 1, times.size - 1)
    step = times[right] - times[right - 1]
    close = (t >= times[0]) & (t <= times[-1]) & (step <= GAP_FACTOR * float(np.median(np.diff(times))))
    share = ((t - times[right - 1]) / step)[:, np.newaxis]
    between = (1.0 - share) * values[there][right - 1] + share * values[there][right]
    resampled[close] = between[close]
    return resampled
