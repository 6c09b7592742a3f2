"""Samples, the keyframes at which the smoother corrects, and the way back to an attitude at each sample."""

import math
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.kernels import kernel
from plumbob.core.units import deg
from plumbob.data import ImuData
from plumbob.filters.input_checks import DIGIT, ROUNDING
from plumbob.rotations.kernels import quat_exp, quat_mul, quat_unit, rotate

CORRELATED: Final = 0.3
"""For how long rates and forces of a body in motion stay alike, s: first-order Gauss–Markov processes about their mean.
What they miss in 20 ms to 5 s, on recordings of hands, people, machines and a quadrotor, is 0.6 to 1.7 of that."""
AROUND: Final = 3.0
"""Their mean and spread are taken over this to both sides, s, or over as long as nothing was measured."""
ABSENT: Final = 1.5  # a step longer than so many usual ones lacks at least a sample
LOST: Final = deg(15.0)
"""Where the bridge over a gap is less sure than this, rad, the first seconds behind it show the tilt better."""
HELD: Final = 0.5
"""A specific force that is known to no better than this share of the next says nothing of how the body moves."""
UNKNOWN_FORCE: Final = 5.0  # standard deviation of a specific force that was not measured for long, m/s²

WRONG: Final = (
    flags.GYR_CLIPPED | flags.GYR_STUCK | flags.GYR_INVALID,
    flags.ACC_CLIPPED | flags.ACC_STUCK,
    flags.MAG_CLIPPED | flags.MAG_STUCK,
)
"""Of each triad, the flags that say that a value is not what it was."""
TOGETHER: Final = 0.025
"""The passes take samples together that lie within this, s: the turn between them is theirs, and what corrects a rate
of 1000 °/s differs by a hundredth over it."""
BLOCK: Final = 4096  # samples that are turned at a time where temporaries would be larger than the result

Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Keyframes:
    """Samples without holes, and the steps that they are taken in."""

    t: Floats  # (N,), time, s
    # gyr, acc: (N, 3), rate and specific force, bridged where there was none
    gyr: Floats
    acc: Floats
    mag: Floats  # (N, 3), field; NaN where there was none
    first: NDArray[np.int64]  # (K + 1,), sample of each keyframe
    gap: Bools  # (K,), steps without samples, behind which the tilt starts again
    missed: Floats  # (K,), variance of the attitude, rad², that bridged rates add to each step
    pushed: Floats  # (K,), variance of the level velocity, (m/s)², that bridged forces add
    # (N,), place of each sample in the recording: those in a hole of the gyroscope are left out
    rows: NDArray[np.int64]
    digit: float  # last digit of the rates, rad/s
    scatter: Floats | float = 0.0  # (N,), mean square by which fields that were taken together differed, µT²
    time: Floats = field(init=False)  # of the keyframes, s, (K + 1,)
    step: Floats = field(init=False)  # length of each step, s, (K,)

    def __post_init__(self) -> None:
        object.__setattr__(self, "time", self.t[self.first])
        object.__setattr__(self, "step", np.diff(self.time))

    @classmethod
    def from_imu(cls, imu: ImuData, spacing: float, *, mag: bool = True) -> Self | None:
        """Keyframes at least `spacing` apart, s; None where fewer than two samples have a rate."""
        t, (gyr, acc, fields) = np.asarray(imu.t), trusted(imu, mag=mag)
        if np.count_nonzero(~np.isnan(gyr[:, 0])) < 2:
            return None
        rates = bridge(t, gyr)
        rows = np.flatnonzero(~rates.lost)
        t, acc, fields = t[rows], acc[rows], fields[rows]
        forces, missed = bridge(t, acc), rates.variance[rows]
        digit, force_digit = last_digit(gyr, 0), last_digit(acc, 1)
        fields[rates.long[rows]] = np.nan  # nobody knows at which attitude it was measured
        first, gap = _steps(t, spacing, missed > LOST**2)
        # each step by itself: in a difference of running sums a short hole would vanish beside a long one
        pushed = np.add.reduceat(np.where(forces.blind, 0.0, forces.variance), first[:-1] + 1)
        pushed += np.add.reduceat(UNKNOWN_FORCE * forces.blind * np.diff(t, prepend=t[0]), first[:-1] + 1) ** 2
        missed = np.add.reduceat(missed, first[:-1] + 1)
        missed += np.add.reduceat(hidden(t, rates.values[rows], digit), first[:-1] + 1)
        pushed += np.add.reduceat(hidden(t, forces.values, force_digit), first[:-1] + 1)
        return cls(t, rates.values[rows], forces.values, fields, first, gap, missed, pushed, rows, digit)

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

    def together(self) -> Self:
        """The same steps with the samples in each taken together, each as long as `TOGETHER`, the first by itself."""
        count = np.diff(self.first)
        parts = np.clip(np.round(self.step / TOGETHER).astype(np.int64), 1, count)
        if (parts == count).all():
            return self
        place = np.arange(1, self.t.size) - np.repeat(self.first[:-1], count)
        count, number = np.repeat(count, count), np.repeat(parts, count)
        last = np.concatenate(([0], np.flatnonzero(place * number // count > (place - 1) * number // count) + 1))
        gyr, acc, mag = (values[last] for values in (self.gyr, self.acc, self.mag))
        scatter = np.zeros(last.size)
        gather(self.t, self.gyr, self.acc, self.mag, last, gyr, acc, mag, scatter)
        first = np.concatenate(([0], np.cumsum(parts)))
        rows = self.rows[last]
        return replace(self, t=self.t[last], gyr=gyr, acc=acc, mag=mag, first=first, rows=rows, scatter=scatter)

    def part(self, steps: slice) -> Self:
        """Some steps, one behind the other."""
        begin, end, _ = steps.indices(self.gap.size)
        first = self.first[begin : end + 1]
        rows = slice(int(first[0]), int(first[-1]) + 1)
        return replace(
            self, t=self.t[rows], gyr=self.gyr[rows], acc=self.acc[rows], mag=self.mag[rows], first=first - first[0],
            gap=self.gap[steps], missed=self.missed[steps], pushed=self.pushed[steps], rows=self.rows[rows],
        )  # fmt: skip

    def without(self, field: Floats) -> Self:
        """Keyframes whose samples are rid of a field in body axes, (K, 3), that each step has of its own."""
        per_sample = np.repeat(field, np.diff(self.first), axis=0)
        mag = self.mag.copy()
        mag[1:] -= per_sample[: len(mag) - 1]
        return replace(self, mag=mag)


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


class Bridge(NamedTuple):
    """Values (N, 3) without holes, and what is unknown of them at each sample.

    `variance` is that of their integral over the step that the sample ends, (N,); `long` says which end a step that
    lacks samples, `blind` where what was measured before and behind says nothing any more, and `lost` which have no
    value in a hole that cannot be bridged.
    """

    values: Floats
    variance: Floats
    long: Bools
    blind: Bools
    lost: Bools


def bridge(t: Floats, values: Floats) -> Bridge:
    """Bridge what was not measured, rows without a value or no rows at all, by what came before and behind.

    Of a Gauss–Markov process about a mean m, ends a and b and what lies between them are normal together: over δ the
    mean is m + (tanh x / x) ((a + b) / 2 − m), and the variance of the integral 2 T δ (1 − tanh x / x) that of the
    process, with x = δ / 2T.
    """
    n, valid, each = len(t), np.flatnonzero(~np.isnan(values[:, 0])), np.arange(len(t))
    no, variance = np.zeros(n, dtype=bool), np.zeros(n)
    if valid.size < 2:
        return Bridge(np.zeros((n, 3)), variance, no, ~no, ~no)
    span, outside = np.diff(t[valid]), (each < valid[0]) | (each > valid[-1])
    usual = float(np.median(span))
    short = span > ABSENT * usual
    is_hole = short | (np.diff(valid) > 1)
    holes = np.flatnonzero(is_hole)
    if not holes.size and not outside.any():
        return Bridge(np.ascontiguousarray(values), variance, no, no, no)
    mean, spread = lasting_mean(t[valid], values[valid], holes, np.maximum(span[holes], AROUND))
    missing = np.where(short[holes], span[holes] - usual, 0.0)
    x = missing / (2.0 * CORRELATED)
    share = np.where(x > 0.0, np.tanh(x) / np.maximum(x, 1e-300), 1.0)
    total = spread**2 * 2.0 * CORRELATED * missing * (1.0 - share)
    # rows in a hole, and the one that ends it
    after = np.searchsorted(valid, each)
    rows = np.flatnonzero(~outside & (after > 0))
    rows = rows[is_hole[after[rows] - 1]]
    hole = np.searchsorted(holes, after[rows] - 1)
    begin, end, apart = valid[holes[hole]], valid[holes[hole] + 1], total[hole] > LOST**2
    lost = outside.copy()
    lost[rows] = apart & (rows < end)
    step = np.where(apart & (rows == end), span[holes[hole]], t[rows] - t[rows - 1])
    covered = np.where(rows == end, np.minimum(usual, step), 0.0)  # of the value that ends the hole
    middle = (t[rows] - covered - 0.5 * (step - covered) - t[begin] + 0.5 * usual) / span[holes[hole]]
    line = values[begin] + middle[:, np.newaxis] * (values[end] - values[begin])
    line = mean[hole] + share[hole, np.newaxis] * (line - mean[hole])
    out = values.copy()
    out[: valid[0]], out[valid[-1] + 1 :] = values[valid[0]], values[valid[-1]]
    out[rows] = line + (covered / step)[:, np.newaxis] * (values[end] - line)
    variance[rows] = total[hole] * (step - covered) / np.where(missing[hole] > 0.0, missing[hole], np.inf)
    blind, long = outside.copy(), no.copy()
    blind[rows] = x[hole] > 1.0
    long[rows] = (rows == end) & (step > ABSENT * usual)
    return Bridge(out, variance, long, blind, lost)


def last_digit(values: Floats, triad: int) -> float:
    """Smallest change of an axis of a triad (N, 3), beyond rounding; infinite where each has one value."""
    change = np.abs(np.diff(values[~np.isnan(values[:, 0])], axis=0))
    return float(change.min(initial=math.inf, where=change > ROUNDING * DIGIT[triad]))


def hidden(t: Floats, values: Floats, digit: float) -> Floats:
    """What a last digit hides of values (N, 3): variance that it adds to the integral of an axis at each sample, (N,).

    While a value stays the same, so does what is cut off, evenly between ± half a digit.
    """
    variance = np.zeros(len(t))
    if not math.isfinite(digit):
        return variance
    step = np.diff(t, prepend=t[0])
    for axis in range(3):
        run = np.cumsum(np.diff(values[:, axis], prepend=values[0, axis]) != 0.0)
        variance += np.bincount(run, step)[run]
    return digit**2 / 12.0 * variance / 3.0 * step


def lasting_mean(t: Floats, values: Floats, place: NDArray[np.int64], reach: Floats) -> tuple[Floats, Floats]:
    """Mean (n, 3) that will last, and spread (n,) about it, around steps behind some values, as far as each reaches.

    A mean over a few times `CORRELATED` is drawn towards none by as much as it is uncertain: [JamesStein1961].
    """
    low, high = np.searchsorted(t, t[place] - reach), np.searchsorted(t, t[place + 1] + reach, side="right")
    mean, square = sum_between(values, low, high, mean=True), sum_between((values**2).sum(axis=1), low, high, mean=True)
    mean2, span = (mean**2).sum(axis=1), t[high - 1] - t[low] - (t[place + 1] - t[place])
    share = np.maximum(1.0 - (square - mean2) * 2.0 * CORRELATED / np.maximum(span * mean2, 1e-30), 0.0)
    mean *= share[:, np.newaxis]
    ends = 0.5 * ((values[place] - mean) ** 2 + (values[place + 1] - mean) ** 2).sum(axis=1)
    spread: Floats = np.sqrt(np.maximum(square - share * (2.0 - share) * mean2, ends) / 3.0)
    return mean, spread


def _steps(t: Floats, spacing: float, again: Bools) -> tuple[NDArray[np.int64], Bools]:
    """Keyframes, and which steps between them are gaps: those that end with such a sample."""
    reach = np.searchsorted(t, t + spacing - 1e-6)
    keyframes, i = [0], 0
    while i < t.size - 1:
        i = min(max(int(reach[i]), i + 1), t.size - 1)
        keyframes.append(i)
    before = np.flatnonzero(again[1:])
    first = np.unique(np.concatenate((keyframes, before, before + 1)))
    gap = np.zeros(first.size - 1, dtype=bool)
    gap[np.searchsorted(first, before)] = True
    return first.astype(np.int64), gap


def sum_between(values: Floats, low: NDArray[np.int64], high: NDArray[np.int64], *, mean: bool = False) -> Floats:
    """Sums (K, …) of values (N, …), or means, from row `low` to before row `high` of each stretch."""
    width = math.prod(values.shape[1:])
    sums = np.empty((len(low), *values.shape[1:]))
    differences(values.reshape(-1, width), low, high, np.zeros((len(values) + 1, width)), sums.reshape(-1, width))
    return sums / (high - low).reshape(-1, *(1,) * (values.ndim - 1)) if mean else sums


@kernel
def differences(
    values: Floats, low: NDArray[np.int64], high: NDArray[np.int64], total: Floats, out: Floats
) -> None:  # fmt: skip
    """Differences (K, n) of the running sums of values (N, n), which are written down too, (N + 1, n), zeros first."""
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            total[i + 1, j] = total[i, j] + values[i, j]
    for k in range(low.size):
        for j in range(values.shape[1]):
            out[k, j] = total[high[k], j] - total[low[k], j]


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


@kernel
def gather(
    t: Floats, gyr: Floats, acc: Floats, mag: Floats, last: NDArray[np.int64], rate: Floats, force: Floats,
    field: Floats, scatter: Floats,
) -> None:  # fmt: skip
    """Take the samples behind each of `last` up to the next one together.

    Their rate is that of their turn, force and field are the means as they would be measured in the middle of it.
    """
    q, total = np.empty(4), np.zeros(7)
    for k in range(1, last.size):
        q[0], q[1], q[2], q[3] = 1.0, 0.0, 0.0, 0.0
        total[:] = 0.0
        count, span = 0, t[last[k]] - t[last[k - 1]]
        for s in range(last[k - 1] + 1, last[k] + 1):
            dt = t[s] - t[s - 1]
            half = 0.5 * dt
            turned_by(q, half * gyr[s, 0], half * gyr[s, 1], half * gyr[s, 2])
            fx, fy, fz = rotate(q[0], q[1], q[2], q[3], acc[s, 0], acc[s, 1], acc[s, 2])
            total[0], total[1], total[2] = total[0] + dt * fx, total[1] + dt * fy, total[2] + dt * fz
            if not math.isnan(mag[s, 0]):
                count += 1
                total[6] += mag[s, 0] ** 2 + mag[s, 1] ** 2 + mag[s, 2] ** 2
                fx, fy, fz = rotate(q[0], q[1], q[2], q[3], mag[s, 0], mag[s, 1], mag[s, 2])
                total[3], total[4], total[5] = total[3] + fx, total[4] + fy, total[5] + fz
            turned_by(q, half * gyr[s, 0], half * gyr[s, 1], half * gyr[s, 2])
        sine = math.sqrt(q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
        per = 2.0 * math.atan2(sine, q[0]) / (sine * span) if sine > 1e-8 else 2.0 / span
        for i in range(3):
            rate[k, i] = per * q[1 + i]
        half = 0.5 * span
        e0, e1, e2, e3 = quat_exp(-half * rate[k, 0], -half * rate[k, 1], -half * rate[k, 2])
        force[k, 0], force[k, 1], force[k, 2] = rotate(
            e0, e1, e2, e3, total[0] / span, total[1] / span, total[2] / span
        )
        per = 1.0 / count if count else math.nan
        field[k, 0], field[k, 1], field[k, 2] = rotate(e0, e1, e2, e3, per * total[3], per * total[4], per * total[5])
        if count:
            scatter[k] = per * total[6] - field[k, 0] ** 2 - field[k, 1] ** 2 - field[k, 2] ** 2


def between(frames: Keyframes, moving: Bools, q_k: Floats, rate: Floats) -> Floats:
    """Attitude at every sample, (N, 4): the gyroscope's way from keyframe to keyframe, what it misses spread evenly.

    `frames`: samples and steps; `moving` (K,): steps in which the gyroscope is followed; in others the attitude goes
    the shortest way; `q_k` (K + 1, 4): attitude at the keyframes; `rate` (N, 3): corrected rates, rad/s.
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
