"""Samples, the keyframes at which the smoother corrects, and the way back to an attitude at each sample."""

from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.kernels import kernel
from plumbob.core.units import deg
from plumbob.data import ImuData
from plumbob.rotations.kernels import quat_exp, quat_mul, quat_unit

LONGEST: Final = 0.105
"""A longer step than this, s, and than three usual ones, is a gap: the attitude starts again behind it. Ten samples a
second, and their rounding, are none."""
USUAL: Final = 3.0
HELD: Final = 0.5
"""A specific force that is known to no better than this share of the next says nothing of how the body moves."""
UNKNOWN_FORCE: Final = 5.0
"""Standard deviation of a specific force that was not measured, m/s²."""
UNKNOWN_RATE: Final = 0.3
"""Standard deviation of a rate that was not measured, as a share of the mean rate of the samples around it."""
AROUND: Final = 15
"""Samples of that mean."""
LEAST_RATE: Final = deg(2.0)
"""Least mean rate that is assumed for it, rad/s."""
SWING: Final = 3.0
"""Frequency of the motion that a straight line over a short hole misses, Hz: less than is unknown in a long one."""

WRONG: Final = (
    flags.GYR_CLIPPED | flags.GYR_STUCK | flags.GYR_INVALID,
    flags.ACC_CLIPPED | flags.ACC_STUCK,
    flags.MAG_CLIPPED | flags.MAG_STUCK,
)
"""Of each triad, the flags that say that a value is not what it was."""
BLOCK: Final = 4096
"""Samples that are turned at a time where temporaries would be larger than the result."""

Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Keyframes:
    """Samples without holes, and the steps that they are taken in.

    Attributes
    ----------
    t : ndarray (N,)
        Time, s.
    gyr, acc : ndarray (N, 3)
        Rate and specific force, interpolated where there was none.
    mag : ndarray (N, 3)
        Field; NaN where there was none.
    first : ndarray (K + 1,)
        Sample of each keyframe.
    gap : ndarray (K,) of bool
        Steps without samples, behind which the attitude starts again.
    missed : ndarray (K,)
        Variance of the attitude, rad², that interpolated rates add to each step.
    pushed : ndarray (K,)
        Variance of the level velocity, (m/s)², that interpolated forces add.
    rows : ndarray (N,)
        Place of each sample in the recording: those in a hole of the gyroscope are left out.
    """

    t: Floats
    gyr: Floats
    acc: Floats
    mag: Floats
    first: NDArray[np.int64]
    gap: Bools
    missed: Floats
    pushed: Floats
    rows: NDArray[np.int64]

    @classmethod
    def from_imu(cls, imu: ImuData, spacing: float, *, mag: bool = True) -> Self | None:
        """Keyframes at least `spacing` apart, s; None where fewer than two samples have a rate."""
        t, (gyr, acc, field) = np.asarray(imu.t), trusted(imu, mag=mag)
        longest = longest_step(t)
        if np.count_nonzero(~np.isnan(gyr[:, 0])) < 2:
            return None
        rows = np.flatnonzero(~_holes(t, np.isnan(gyr[:, 0]), longest))
        t, gyr, acc, field = t[rows], gyr[rows], acc[rows], np.ascontiguousarray(field[rows])
        first, gap = _steps(t, spacing, longest)
        no_rate, no_force = np.isnan(gyr[:, 0]), np.isnan(acc[:, 0])
        gyr, acc = filled(t, gyr), filled(t, acc)
        dt = np.diff(t, prepend=t[0])
        largest = np.pad(np.abs(gyr).max(axis=1), AROUND // 2, mode="edge")
        rates = np.maximum(np.convolve(largest, np.full(AROUND, 1.0 / AROUND), mode="valid"), LEAST_RATE)
        # each step by itself: in a difference of running sums a short hole would vanish beside a long one
        missed = np.add.reduceat(np.minimum(UNKNOWN_RATE, _bow(t, no_rate)) * rates * dt, first[:-1] + 1) ** 2
        pushed = np.add.reduceat(np.minimum(1.0, _bow(t, no_force)) * UNKNOWN_FORCE * dt, first[:-1] + 1) ** 2
        return cls(t, gyr, acc, field, first, gap, missed, pushed, rows)

    @property
    def time(self) -> Floats:
        """Times of the keyframes, s, (K + 1,)."""
        return self.t[self.first]

    @property
    def step(self) -> Floats:
        """Length of each step, s, (K,)."""
        return np.diff(self.time)

    @property
    def middle(self) -> Floats:
        """Middle of each step, s, (K,)."""
        return 0.5 * (self.time[1:] + self.time[:-1])

    @property
    def starts(self) -> NDArray[np.int64]:
        """Keyframes at which the attitude starts."""
        return np.concatenate(([0], np.flatnonzero(self.gap) + 1))

    @property
    def untold(self) -> Bools:
        """Steps of which no force says how the body moves, (K,)."""
        mask: Bools = self.gap | (self.pushed > (HELD * UNKNOWN_FORCE * self.step) ** 2)
        return mask

    def drifting(self) -> Self:
        """The same with forces that are wrong for as long as they are held: the velocity drifts off evenly."""
        dt, untold = self.step, self.untold & ~self.gap
        since = np.cumsum(np.where(untold, dt, 0.0))
        since -= np.maximum.accumulate(np.where(untold, 0.0, since))
        grown = UNKNOWN_FORCE**2 * dt * np.maximum(2.0 * since - dt, 0.0)  # of (force · time)²
        return replace(self, pushed=np.where(untold, np.maximum(self.pushed, grown), self.pushed))

    def mean(self, values: Floats) -> Floats:
        """Mean over the samples of each step, (K, …), of values (N, …)."""
        return sum_between(values, self.first[:-1] + 1, self.first[1:] + 1, mean=True)

    def pieces(self, length: float) -> NDArray[np.intp]:
        """Number of the piece of the record, each of this length, s, in which each step lies, (K,)."""
        piece: NDArray[np.intp] = ((self.middle - self.t[0]) // length).astype(np.intp)
        return piece

    def without(self, field: Floats) -> Self:
        """Keyframes whose samples are rid of a field in body axes, (K, 3), that each step has of its own."""
        per_sample = np.repeat(field, np.diff(self.first), axis=0)
        mag = self.mag.copy()
        mag[1:] -= per_sample[: len(mag) - 1]
        return replace(self, mag=mag)


def longest_step(t: Floats) -> float:
    """Step beyond which there is a gap, s."""
    return max(LONGEST, USUAL * float(np.median(np.diff(t)))) if t.size > 1 else LONGEST


def trusted(imu: ImuData, *, mag: bool) -> tuple[Floats, Floats, Floats]:
    """Rate, force and field of the samples, (N, 3) each, NaN where one is missing or is not what it was."""
    flag = np.asarray(imu.flags)
    gyr, acc = unless(imu.usable("gyr"), flag, WRONG[0]), unless(imu.usable("acc"), flag, WRONG[1])
    if not mag or "mag" not in imu.triads:
        return gyr, acc, np.full_like(gyr, np.nan)
    return gyr, acc, unless(imu.usable("mag"), flag, WRONG[2])


def unless(values: Floats, flag: NDArray[np.uint32], bits: int) -> Floats:
    """Values, NaN where one is missing or a flag says that it is not what it was."""
    bad = ((flag & bits) != 0) | ~np.isfinite(values).all(axis=1)
    return np.where(bad[:, np.newaxis], np.nan, values) if bad.any() else np.ascontiguousarray(values)


def _holes(t: Floats, missing: Bools, longest: float) -> Bools:
    """Samples in a stretch without a rate that is longer than a gap, or at an end of the recording."""
    if not missing.any():
        return missing
    rated = np.flatnonzero(~missing)
    place = np.searchsorted(rated, np.arange(t.size))
    before, after = np.where(place > 0, rated[np.maximum(place - 1, 0)], -1), rated[np.minimum(place, rated.size - 1)]
    outside = (before < 0) | (place >= rated.size)
    return missing & (outside | (t[after] - t[np.maximum(before, 0)] > longest))


def _steps(t: Floats, spacing: float, longest: float) -> tuple[NDArray[np.int64], Bools]:
    """Keyframes, and which steps between them are gaps."""
    reach = np.searchsorted(t, t + spacing - 1e-6)
    keyframes, i = [0], 0
    while i < t.size - 1:
        i = min(max(int(reach[i]), i + 1), t.size - 1)
        keyframes.append(i)
    before = np.flatnonzero(np.diff(t) > longest)
    first = np.unique(np.concatenate((keyframes, before, before + 1)))
    gap = np.zeros(first.size - 1, dtype=bool)
    gap[np.searchsorted(first, before)] = True
    return first.astype(np.int64), gap


def filled(t: Floats, values: Floats) -> Floats:
    """Values, on straight lines over what is missing."""
    valid = ~np.isnan(values[:, 0])
    if valid.all():
        return np.ascontiguousarray(values)
    if not valid.any():
        return np.zeros_like(values)
    return np.stack([np.interp(t, t[valid], values[valid, i]) for i in range(3)], axis=1)


def _bow(t: Floats, missing: Bools) -> Floats:
    """How far a sine of unit size, of frequency `SWING`, leaves a straight line over the hole of each sample, (N,)."""
    valid = np.flatnonzero(~missing)
    if not valid.size:
        return np.full(t.size, np.inf)
    place = np.searchsorted(valid, np.arange(t.size))
    before, after = valid[np.maximum(place - 1, 0)], valid[np.minimum(place, valid.size - 1)]
    return np.where(missing, (2.0 * np.pi * SWING * (t[after] - t[before])) ** 2 / 8.0, 0.0)


def sum_between(values: Floats, low: NDArray[np.int64], high: NDArray[np.int64], *, mean: bool = False) -> Floats:
    """Sums (K, …) of values (N, …), or means, from row `low` to before row `high` of each stretch."""
    total = np.zeros((len(values) + 1, *values.shape[1:]))
    np.cumsum(values, axis=0, out=total[1:])
    sums: Floats = total[high] - total[low]
    return sums / (high - low).reshape(-1, *(1,) * (values.ndim - 1)) if mean else sums


@kernel
def turned_by(q: Floats, rx: float, ry: float, rz: float) -> None:
    """Turn an attitude by a rotation vector in body axes."""
    e0, e1, e2, e3 = quat_exp(rx, ry, rz)
    a0, a1, a2, a3 = quat_mul(q[0], q[1], q[2], q[3], e0, e1, e2, e3)
    q[0], q[1], q[2], q[3] = quat_unit(a0, a1, a2, a3)


@kernel
def path(t: Floats, gyr: Floats, q: Floats) -> None:
    """Attitude at every sample by the gyroscope alone, from the identity."""
    for k in range(4):
        q[0, k] = 1.0 if k == 0 else 0.0
    for i in range(1, t.size):
        dt = t[i] - t[i - 1]
        for k in range(4):
            q[i, k] = q[i - 1, k]
        turned_by(q[i], dt * gyr[i, 0], dt * gyr[i, 1], dt * gyr[i, 2])


def between(frames: Keyframes, moving: Bools, q_k: Floats, rate: Floats) -> Floats:
    """Attitude at every sample, (N, 4): the gyroscope's way from keyframe to keyframe, what it misses spread evenly.

    Parameters
    ----------
    frames : Keyframes
        Samples and steps.
    moving : ndarray (K,) of bool
        Steps in which the gyroscope is followed; in others the attitude goes the shortest way.
    q_k : ndarray (K + 1, 4)
        Attitude at the keyframes.
    rate : ndarray (N, 3)
        Corrected rates, rad/s.
    """
    from plumbob.rotations import quat_conjugate, quat_from_rotvec, quat_multiply, rotvec_from_quat

    free = np.empty((frames.t.size, 4))
    step = np.repeat(np.arange(moving.size), np.diff(frames.first))  # of samples 1, 2, …
    path(frames.t, np.where(np.concatenate(([False], moving[step]))[:, np.newaxis], rate, 0.0), free)
    # From the free path to the keyframes: constant in each step but for a rotation that grows evenly
    change = quat_multiply(q_k, quat_conjugate(free[frames.first]))
    grow = rotvec_from_quat(quat_multiply(change[1:], quat_conjugate(change[:-1])))
    time, length = frames.time, frames.step
    free[0] = q_k[0]
    for begin in range(0, step.size, BLOCK):  # temporaries are larger
        rows, k = slice(begin + 1, begin + BLOCK + 1), step[begin : begin + BLOCK]
        share = (frames.t[rows] - time[k]) / length[k]
        here = quat_multiply(quat_from_rotvec(share[:, np.newaxis] * grow[k]), change[k])
        free[rows] = quat_multiply(here, free[rows])
    return free
