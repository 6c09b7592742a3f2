"""An array's units on one time line, and what they say as arrays that kernels take: values, directions, weights."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ClockError, ParameterError, ShapeError
from plumbob.core.time import GAP_FACTOR
from plumbob.data import TRIADS, ImuData
from plumbob.data.array import ImuArray, UnitMount
from plumbob.data.cards import NoiseCard
from plumbob.data.cards.noise import TriadNoise
from plumbob.data.imu import TRIAD_FLAGS

USUAL: Final = {"gyr": 1e-4, "acc": 3e-3, "mag": 0.1}
"""White noise of a common MEMS unit, rad/s/√Hz, m/s²/√Hz, µT/√Hz, where no card says it."""
WEIGHTS: Final = ("noise", "range", "equal")
_END = 0.999  # the last code below full scale is already the end


def axis_values(imu: ImuData, triad: str) -> Floats:
    """Values of a unit's sensor axes (N, 3); NaN where absent or invalid, and on each axis at the end of its range."""
    values: Floats | None = getattr(imu, triad)
    if values is None:
        return np.full((len(imu), 3), np.nan)
    _, clipped, invalid = TRIAD_FLAGS[triad]
    out = np.zeros(values.shape, dtype=bool)
    bad = (imu.flags & np.uint32(invalid)) != 0
    if bad.any():
        out[bad] = True
    at_end = (imu.flags & np.uint32(clipped)) != 0
    if at_end.any():
        full_scale = imu.meta.full_scale(triad)
        largest = np.abs(values[at_end])
        if full_scale is None:  # which axis it was is not known
            out[at_end] = True
        else:
            out[at_end] = largest >= _END * full_scale
    return np.where(out, np.nan, values) if out.any() else values


def stacked(array: ImuArray, triad: str) -> Floats:
    """Values of the sensor axes of all units (N, U, 3), in the axes of each unit, as `axis_values`."""
    return np.stack([axis_values(imu, triad) for imu in array.units.values()], axis=1)


def directions(mounts: Mapping[str, UnitMount]) -> Floats:
    """Direction of axis k of unit u in body axes (U, 3, 3)."""
    return np.ascontiguousarray([mount.dcm.T for mount in mounts.values()])


def levers(mounts: Mapping[str, UnitMount]) -> Floats:
    """Lever arms (U, 3), m."""
    return np.array([mount.lever_b for mount in mounts.values()])


def densities(mounts: Mapping[str, UnitMount], triad: str) -> Floats:
    """White noise of each axis (U, 3); where a card lacks it that of the others, and a usual one where all do."""
    density = np.full((len(mounts), 3), np.nan)
    for u, mount in enumerate(mounts.values()):
        noise = None if mount.noise is None else getattr(mount.noise, triad)
        if noise is not None and (noise.n_rpsd > 0.0).all():
            density[u] = noise.n_rpsd
    finite = np.isfinite(density)
    density[~finite] = float(np.sqrt(np.mean(density[finite] ** 2))) if finite.any() else USUAL[triad]
    return density


def with_noise(array: ImuArray) -> ImuArray:
    """The array; where no unit has a noise card, with the white noise that its values show, if that is above the usual.

    It is that of the second differences of what a unit measures beyond the mean of all, in which motion, biases and
    scale errors cancel, by their median, so that a fault of less than half the time does not count.
    """
    if any(mount.noise is not None for mount in array.mounts.values()):
        return array
    root, noises = float(np.sqrt(nominal_step(array))), {}
    for triad in TRIADS:
        body = array.stacked(triad)
        there = np.isfinite(body)
        count = there.sum(axis=1, keepdims=True)
        mean = np.where(there, body, 0.0).sum(axis=1, keepdims=True) / np.maximum(count, 1)
        beyond = np.diff(np.where(count > 1, body - mean, np.nan), n=2, axis=0)
        for u, name in enumerate(array.names):
            steps = np.abs(beyond[:, u][np.isfinite(beyond[:, u])])
            others = 1.0 - 1.0 / len(array.names)  # share of a unit's own variance that is beyond the mean
            sd = 1.4826 * float(np.median(steps)) / np.sqrt(6.0 * others) if steps.size else 0.0
            noises[name, triad] = TriadNoise(np.full(3, max(sd * root, USUAL[triad])), np.zeros(3), np.zeros(3))
    cards = {
        name: NoiseCard(name, "its own samples", **{triad: noises[name, triad] for triad in TRIADS})
        for name in array.names
    }
    return ImuArray(array.units, {k: replace(mount, noise=cards[k]) for k, mount in array.mounts.items()})


def weighting(array: ImuArray, triad: str, by: str) -> Floats:
    """Weights of the sensor axes (U, 3), by "noise": inverse variances of the noise cards; by "range": inverse squares.

    For a wider range has the coarser steps; a range that is not known is an error; by "equal": one for all.
    """
    check.one_of("weights", by, WEIGHTS)
    if by == "noise":
        return 1.0 / densities(array.mounts, triad) ** 2
    if by == "equal":
        return np.ones((len(array.units), 3))
    weights = []
    for name, imu in array.units.items():
        full_scale = imu.meta.full_scale(triad)
        if full_scale is None and getattr(imu, triad) is not None:
            raise ParameterError(
                f"weights by range need the {triad}_range of every unit, but '{name}' does not have one. "
                "Take weights='noise' or 'equal'."
            )
        weights.append(np.ones(3) if full_scale is None else 1.0 / full_scale**2)
    return np.array(weights)


def combined_noise(array: ImuArray, name: str) -> NoiseCard | None:
    """Noise card of the virtual unit: inverse variances add up; None where no unit has a card."""
    if all(mount.noise is None for mount in array.mounts.values()):
        return None
    parts: dict[str, TriadNoise] = {}
    axes = directions(array.mounts)
    for triad in TRIADS:
        if not any(getattr(imu, triad) is not None for imu in array.units.values()):
            continue
        if not any(m.noise is not None and getattr(m.noise, triad) is not None for m in array.mounts.values()):
            continue
        has = np.array([getattr(imu, triad) is not None for imu in array.units.values()])
        weight = np.where(has[:, np.newaxis], 1.0 / densities(array.mounts, triad) ** 2, 0.0)
        normal = np.einsum("uk,uki,ukj->ij", weight, axes, axes)
        if np.linalg.matrix_rank(normal) < 3:
            continue
        gains = np.einsum("ij,uk,ukj->iuk", np.linalg.inv(normal), weight, axes)  # of the body's axes
        slow = {letter: _slow(array.mounts, triad, letter) for letter in ("b", "k_rpsd")}
        parts[triad] = TriadNoise(
            n_rpsd=np.sqrt(np.diag(np.linalg.inv(normal))),
            b=np.sqrt(np.einsum("iuk,uk->i", gains**2, slow["b"] ** 2)),
            k_rpsd=np.sqrt(np.einsum("iuk,uk->i", gains**2, slow["k_rpsd"] ** 2)),
        )
    if not parts:
        return None
    return NoiseCard(name, f"{len(array.units)} units combined", **parts)


def _slow(mounts: Mapping[str, UnitMount], triad: str, letter: str) -> Floats:
    noises = [None if m.noise is None else getattr(m.noise, triad) for m in mounts.values()]
    return np.array([np.zeros(3) if noise is None else getattr(noise, letter) for noise in noises])


def nominal_step(array: ImuArray) -> float:
    """Time between two samples, s: the median, or what the meta says where there is one sample only."""
    if len(array) > 1:
        return float(np.median(np.diff(array.t)))
    rate = next(iter(array.units.values())).meta.rate_nominal
    return 0.01 if rate is None else 1.0 / rate


def joined(units: Mapping[str, ImuData], mounts: Mapping[str, UnitMount] | None = None) -> ImuArray:
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
