"""Samples as they arrive: missing values bridged, steps cut, calm found, by nothing that comes later.

However a stream is cut into parts, its steps are the same to the bit, since samples are taken one after the other.
"""

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.kernels import kernel
from plumbob.data import ImuData
from plumbob.filters.input_checks import NO_DIGIT, least_change, watch
from plumbob.filters.layout import DIGITS, OWN
from plumbob.filters.layout import LAST as WATCHED
from plumbob.filters.smoother import keyframes
from plumbob.filters.smoother.inertial import farthest
from plumbob.filters.smoother.keyframes import ABSENT, AROUND, CORRELATED, LOST, UNKNOWN_FORCE, Bools, unless
from plumbob.filters.smoother.model import Params, hides_rest

RECENT: Final = 31  # steps of whose lengths the median is the usual one

LAST: Final = 0  # time of the last sample that was kept, s; NaN before the first
KEY: Final = 1  # and of the last keyframe
ARRIVED: Final = 2  # and of the last sample that arrived
MISSED: Final = 3  # variances that bridged rates and forces add to the step, rad² and (m/s)²
PUSHED: Final = 4
COUNT: Final = 5  # lengths of steps that are known
STEP: Final = 6  # usual one where the keyframe began, s; infinity before
KNOWN: Final = 7  # samples with a rate
BLIND: Final = 8  # for how long no force says anything in the step, s
LEAST: Final = 9  # smallest change of a rate, rad/s
GYR: Final = 10  # of each triad, what follows; then of the other
ACC: Final = 27
TIME: Final = 3  # behind its last value, 3: its time,
GIVEN: Final = 4  # and what has been assumed since then, as an integral, 3, with its variance
ADDED: Final = 7
NUMBER: Final = 8  # values so far, their mean, 3, and mean square: of all, and lately
ALL: Final = 9
LATELY: Final = 13
SQUARE: Final = 3
PLACES: Final = 44


@kernel
def usual_step(state: Floats, recent: Floats) -> float:
    """Median length of the last steps, s."""
    n = min(int(state[COUNT]), RECENT)
    if n <= 0:
        return 0.0
    row = np.empty(RECENT)
    for i in range(n):
        at = i
        while at > 0 and row[at - 1] > recent[i]:
            row[at] = row[at - 1]
            at -= 1
        row[at] = recent[i]
    return float(0.5 * (row[(n - 1) // 2] + row[n // 2]))


@kernel
def learn(state: Floats, at: int, dt: float, values: Floats) -> None:
    """Take a value into mean and mean square."""
    state[at + NUMBER] += 1.0
    share = 1.0 / state[at + NUMBER]
    take(state, at + ALL, share, values)
    take(state, at + LATELY, max(share, min(2.0 * dt / AROUND, 1.0)), values)  # as old as a window's, on average


@kernel
def take(state: Floats, place: int, share: float, values: Floats) -> None:
    """Take a value into a mean and a mean square with this share."""
    square = 0.0
    for i in range(3):
        state[place + i] += share * (values[i] - state[place + i])
        square += values[i] ** 2
    state[place + SQUARE] += share * (square - state[place + SQUARE])


@kernel
def mean_place(at: int, missing: float) -> int:
    """Place of the mean of a triad: lately, or of all that came where nothing came for longer than that."""
    return at + (LATELY if missing <= AROUND else ALL)


@kernel
def lasting_mean(state: Floats, place: int, mean: Floats) -> float:
    """Write the mean that will last, as `keyframes.lasting_mean` has it; returns the variance of an axis about it."""
    square, mean2 = state[place + SQUARE], state[place] ** 2 + state[place + 1] ** 2 + state[place + 2] ** 2
    share = max(1.0 - (square - mean2) * 2.0 * CORRELATED / max(AROUND * mean2, 1e-30), 0.0)
    for i in range(3):
        mean[i] = share * state[place + i]
    return max(square - share * (2.0 - share) * mean2, 0.0) / 3.0  # type: ignore[no-any-return]


@kernel
def foresee(state: Floats, at: int, since: float, dt: float, out: Floats) -> float:
    """Value of a triad at a time after its last one, s; returns the variance of its integral since then."""
    mean = np.empty(3)
    variance = lasting_mean(state, mean_place(at, since), mean)
    before, now = math.exp(-(since - dt) / CORRELATED), math.exp(-since / CORRELATED)
    for i in range(3):
        out[i] = mean[i] + (state[at + i] - mean[i]) * CORRELATED * (before - now) / dt
        state[at + GIVEN + i] += out[i] * dt
    share = 2.0 * since / CORRELATED - 3.0 + 4.0 * now - now * now
    return variance * CORRELATED * CORRELATED * share


@kernel
def bridge_to(state: Floats, at: int, since: float, dt: float, usual: float, values: Floats, out: Floats) -> float:
    """Value that makes the integral since the last one that of `keyframes.bridge`; returns its variance."""
    covered = min(usual, dt)
    missing = max(since - covered, 0.0)
    x, ends, mean = missing / (2.0 * CORRELATED), 0.0, np.empty(3)
    variance = lasting_mean(state, mean_place(at, missing), mean)
    decay = math.exp(-2.0 * x)
    share = (1.0 - decay) / ((1.0 + decay) * x) if x > 0.0 else 1.0
    for i in range(3):
        last = state[at + i]
        ends += 0.5 * ((last - mean[i]) ** 2 + (values[i] - mean[i]) ** 2) / 3.0
        line = mean[i] + share * (0.5 * (last + values[i]) - mean[i])
        out[i] = (missing * line - state[at + GIVEN + i] + covered * values[i]) / dt
    return max(variance, ends) * 2.0 * CORRELATED * missing * (1.0 - share)


@kernel
def hold(state: Floats, at: int, t: float, dt: float, values: Floats, out: Floats) -> float:
    """Value of a triad, or what may be in its place where there is none; returns the variance that this adds.

    Infinite for a force where nothing says anything any more.
    """
    since = t - state[at + TIME] if not math.isnan(state[at + TIME]) else math.inf
    if math.isnan(values[0]):
        if since == math.inf:
            for i in range(3):
                out[i] = 0.0
            return math.inf
        variance = foresee(state, at, since, dt, out)
        more = max(variance - state[at + ADDED], 0.0)
        state[at + ADDED] += more
        return math.inf if at == ACC and since > 2.0 * CORRELATED else more
    more = 0.0
    for i in range(3):
        out[i] = values[i]
    if since < math.inf and dt > 0.0 and (since > dt or dt > ABSENT * state[STEP]):
        variance = bridge_to(state, at, since, dt, state[STEP], values, out)
        more = max(variance - state[at + ADDED], 0.0)
        if at == ACC and since - min(state[STEP], dt) > 2.0 * CORRELATED:
            more = math.inf
    learn(state, at, since if since < math.inf else 0.0, values)
    for i in range(3):
        state[at + i], state[at + GIVEN + i] = values[i], 0.0
    state[at + TIME], state[at + ADDED] = t, 0.0
    return more  # type: ignore[no-any-return]


@kernel
def close(
    state: Floats, recent: Floats, end: int, gap: bool, k: int, last: NDArray[np.int64], gaps: Bools, variance: Floats
) -> int:
    """End the step at a sample."""
    last[k], gaps[k] = end, gap
    variance[k, 0], variance[k, 1] = state[MISSED], state[PUSHED] + (UNKNOWN_FORCE * state[BLIND]) ** 2
    variance[k, 2] = state[LEAST]
    state[MISSED], state[PUSHED], state[BLIND] = 0.0, 0.0, 0.0
    state[STEP] = usual_step(state, recent)
    return k + 1


@kernel
def arrive(
    state: Floats, recent: Floats, t: Floats, gyr: Floats, acc: Floats, spacing: float, begin: int, mask: Bools,
    gyr_out: Floats, acc_out: Floats, long: Bools, last: NDArray[np.int64], gaps: Bools, variance: Floats,
) -> int:  # fmt: skip
    """Take samples one after the other; returns how many steps they end.

    Samples are counted from `begin`, those that are kept; `long` says which of them end a step that lacks samples.
    What ends each step, whether it is a gap, and the variances that bridged values add with the last digit of the rates
    so far, are written from the front of the last three.
    """
    n, steps = begin, 0
    for i in range(t.size):
        if not math.isnan(state[ARRIVED]):
            recent[int(state[COUNT]) % RECENT] = t[i] - state[ARRIVED]
            state[COUNT] += 1.0
        state[ARRIVED] = t[i]
        has_rate, first = not math.isnan(gyr[i, 0]), math.isnan(state[LAST])
        state[KNOWN] += 1.0 if has_rate else 0.0
        dt = 0.0 if first else t[i] - state[LAST]
        # a hole that cannot be bridged has ended for the samples that are left out when a rate comes again
        mask[i] = has_rate or not (first or state[GYR + ADDED] > LOST * LOST)
        if not mask[i]:
            continue
        if state[GYR + NUMBER] > 0.0:
            state[LEAST] = least_change(
                state[LEAST], 0, gyr[i, 0] - state[GYR], gyr[i, 1] - state[GYR + 1], gyr[i, 2] - state[GYR + 2]
            )
        missed = hold(state, GYR, t[i], dt, gyr[i], gyr_out[n - begin])
        pushed = hold(state, ACC, t[i], dt, acc[i], acc_out[n - begin])
        long[n - begin] = not first and dt > ABSENT * state[STEP]
        gap = has_rate and not first and missed > LOST * LOST
        if gap and not math.isnan(acc[i, 0]):
            for j in range(3):  # what it was before says nothing, and it shows the tilt
                acc_out[n - begin, j] = acc[i, j]
        if gap and state[LAST] > state[KEY]:
            steps = close(state, recent, n - 1, False, steps, last, gaps, variance)
        state[MISSED] += min(missed, math.pi**2)
        if pushed == math.inf:
            state[BLIND] += dt
        else:
            state[PUSHED] += pushed
        if not first and (gap or t[i] - state[KEY] >= spacing - 1e-6):
            steps = close(state, recent, n, gap, steps, last, gaps, variance)
            state[KEY] = t[i]
        if first:
            state[KEY], state[MISSED], state[PUSHED], state[BLIND] = t[i], 0.0, 0.0, 0.0
        state[LAST] = t[i]
        n += 1
    return steps


@kernel
def watch_on(
    x: Floats, before: float, t: Floats, gyr: Floats, acc: Floats, mag: Floats, word: NDArray[np.uint32]
) -> None:
    """Flag what has been stuck for too long, sample by sample."""
    for i in range(t.size):
        dt = t[i] - (before if i == 0 else t[i - 1])
        word[i] = watch(
            x, dt, gyr[i, 0], gyr[i, 1], gyr[i, 2], acc[i, 0], acc[i, 1], acc[i, 2], mag[i, 0], mag[i, 1], mag[i, 2]
        )


class SampleWatch:
    """Flags what is stuck or beyond its range, from sample to sample; `state` is that of `watch`.

    `digits` are the last digits of the triads where they are known before.
    """

    def __init__(self, digits: Sequence[float] | None = None) -> None:
        self.state = np.zeros(OWN)
        self._before: float | None = None
        self.state[WATCHED : WATCHED + 3] = np.nan
        if digits is not None:
            self.state[DIGITS : DIGITS + 3] = digits

    def words(self, t: Floats, gyr: Floats, acc: Floats, mag: Floats) -> NDArray[np.uint32]:
        """Flags of the next samples, (N,)."""
        word = np.empty(t.size, dtype=np.uint32)
        if t.size:
            watch_on(self.state, t[0] if self._before is None else self._before, t, gyr, acc, mag, word)
            self._before = float(t[-1])
        return word


def watched(imu: ImuData) -> ImuData:
    """The same samples with the flags of what is stuck or beyond its range."""
    triads = keyframes.trusted(imu, mag=True)
    digits = [min(keyframes.last_digit(values, i), NO_DIGIT) for i, values in enumerate(triads)]
    return imu.flagged(SampleWatch(digits).words(np.ascontiguousarray(imu.t), *triads))


@kernel
def calm_from(
    first: int, time: Floats, gap: Bools, rate: Floats, force: Floats, p_time: float, p_rate: float, p_force: float,
    around: Floats, quiet: Bools,
) -> None:  # fmt: skip
    """Whether the window that ends with each step, from the first of them, is calm and whole; the mean rate in it."""
    low, spread = np.empty(2, dtype=np.int64), np.empty(1)
    for k in range(first, gap.size):
        quiet[k - first] = calm_at(k, time, gap, rate, force, p_time, p_rate, p_force, around, low, spread)


@kernel
def calm_at(
    k: int, time: Floats, gap: Bools, rate: Floats, force: Floats, p_time: float, p_rate: float, p_force: float,
    around: Floats, low: NDArray[np.int64], spread: Floats,
) -> bool:  # fmt: skip
    """Whether the window that ends with step k is calm and whole; the mean rate in it is written."""
    begin = k
    while begin > 0 and time[k + 1] - time[begin - 1] <= p_time and not gap[begin]:
        begin -= 1
    count = k + 1 - begin
    mean = np.zeros((1, 3))
    for axis in range(3):
        total, pull = 0.0, 0.0
        for i in range(begin, k + 1):
            total += rate[i, axis]
            pull += force[i, axis]
        around[k, axis] = total / count
        mean[0, axis] = pull / count
    low[0], low[1] = begin, k + 1
    farthest(rate, around[k : k + 1], low[:1], low[1:], spread)
    shaken = spread[0] >= p_rate
    farthest(force, mean, low[:1], low[1:], spread)
    is_full = time[k + 1] - time[begin] >= p_time - (time[k + 1] - time[k])
    return is_full and not gap[begin] and not shaken and spread[0] < p_force


class Rolling:
    """Rows that are added behind and let go before, counted from the first that there ever was."""

    def __init__(self, like: NDArray[Any]) -> None:
        self._rows, self.begin, self.end = like[:0].copy(), 0, 0

    def add(self, rows: NDArray[Any]) -> None:
        """Add rows behind."""
        held = self.end - self.begin
        if held + len(rows) > len(self._rows):
            room = np.empty((2 * (held + len(rows)), *rows.shape[1:]), dtype=self._rows.dtype)
            room[:held] = self._rows[:held]
            self._rows = room
        self._rows[held : held + len(rows)] = rows
        self.end += len(rows)

    def before(self, row: int) -> None:
        """Let go what lies before a row."""
        self._rows = self._rows[row - self.begin : self.end - self.begin].copy()
        self.begin = row

    def __getitem__(self, which: slice) -> NDArray[Any]:
        return self._rows[which.start - self.begin : which.stop - self.begin]


class Arriving:
    """A stream's samples without holes, and the steps that they complete; rows are counted from the first ever.

    `word` (N,): flags of the sensors that are stuck, at each of the last samples.
    """

    def __init__(self, p: Params, *, mag: bool) -> None:
        self._p, self._mag = p, mag
        self._state, self._recent = np.zeros(PLACES), np.zeros(RECENT)
        self._state[[LAST, KEY, ARRIVED, GYR + TIME, ACC + TIME]] = np.nan
        self._state[[STEP, LEAST]] = math.inf
        self._watch, self.word = SampleWatch(), np.zeros(0, dtype=np.uint32)
        none, flag, place = np.zeros((0, 3)), np.zeros(0, dtype=bool), np.zeros(0, dtype=np.int64)
        self._t, self._gyr, self._acc, self._field = Rolling(none[:, 0]), *(Rolling(none) for _ in range(3))
        self._last, self._gap, self._variance = Rolling(place), Rolling(flag), Rolling(none)
        self._time, self._rate, self._force = Rolling(none[:, 0]), Rolling(none), Rolling(none)
        self._quiet, self._around = Rolling(flag), Rolling(none)

    @property
    def samples(self) -> int:
        """Samples that were kept, of all that came."""
        return self._t.end

    @property
    def rated(self) -> bool:
        """Whether two samples had a rate."""
        return bool(self._state[KNOWN] > 1.0)

    @property
    def steps(self) -> int:
        """Steps that are complete."""
        return self._gap.end

    @property
    def longest(self) -> float:
        """Longest step that lacks no sample, s."""
        return ABSENT * float(self._state[STEP])

    @property
    def key(self) -> float:
        """Time at which the step began that is not complete, s."""
        return float(self._state[KEY])

    def watched(self) -> Floats | None:
        """Copy of what is watched for stuck sensors; None where the last sample had no rate."""
        return self._watch.state.copy() if self._state[GYR + TIME] == self._state[ARRIVED] else None

    def take(self, imu: ImuData) -> Bools:
        """Take the next samples; says which of them are kept: not those in a hole of the gyroscope."""
        t, (gyr, acc, field) = np.ascontiguousarray(imu.t), keyframes.trusted(imu, mag=self._mag)
        n, begin = t.size, self.samples
        self.word = self._watch.words(t, gyr, acc, field)
        if self.word.any():
            gyr, acc, field = (
                unless(*args) for args in zip((gyr, acc, field), (self.word,) * 3, keyframes.WRONG, strict=True)
            )
        mask, filled, long = np.empty(n, dtype=bool), np.empty((2, n, 3)), np.empty(n, dtype=bool)
        last, gap, variance = np.empty(2 * n, dtype=np.int64), np.empty(2 * n, dtype=bool), np.empty((2 * n, 3))
        steps = arrive(
            self._state, self._recent, t, gyr, acc, self._p.keyframe, begin, mask, filled[0], filled[1], long, last,
            gap, variance,
        )  # fmt: skip
        count = int(np.count_nonzero(mask))
        self._t.add(t[mask])
        self._gyr.add(filled[0, :count])
        self._acc.add(filled[1, :count])
        self._field.add(np.where(long[:count, np.newaxis], np.nan, field[mask]))
        if not begin and count:
            self._last.add(np.zeros(1, dtype=np.int64))
            self._time.add(t[mask][:1])
        self._add_steps(last[:steps], gap[:steps], variance[:steps])
        return mask

    def _add_steps(self, last: NDArray[np.int64], gap: Bools, variance: Floats) -> None:
        if not last.size:
            return
        old, p = self.steps, self._p
        self._last.add(last)
        self._gap.add(gap)
        self._variance.add(variance)
        self._time.add(self._t[int(last[0]) : int(last[-1]) + 1][last - last[0]])
        first = self._last[old : self.steps + 1]
        rows, count = slice(int(first[0]) + 1, int(first[-1]) + 1), np.diff(first)[:, np.newaxis]
        for means, values in ((self._rate, self._gyr), (self._force, self._acc)):  # whatever came with a step
            means.add(np.add.reduceat(values[rows], first[:-1] - first[0]) / count)
        begin = self._gap.begin
        quiet, steps = np.empty(last.size, dtype=bool), slice(begin, self.steps)
        self._around.add(np.empty((last.size, 3)))
        calm_from(
            old - begin, self._time[begin : self.steps + 1], self._gap[steps], self._rate[steps], self._force[steps],
            p.rest_time, p.rest_rate, p.rest_force, self._around[steps], quiet,
        )  # fmt: skip
        self._quiet.add(quiet & ~hides_rest(p, variance[:, 2]))

    def before(self, step: int) -> None:
        """Let go what lies before a step, once that is half of what is held."""
        if step - self._gap.begin <= (self.steps - self._gap.begin) // 2:
            return
        sample = self.first(step)
        self._last.before(step)
        for rows in (self._t, self._gyr, self._acc, self._field):
            rows.before(sample)
        for rows in (self._gap, self._variance, self._time, self._rate, self._force, self._quiet, self._around):
            rows.before(step)

    def time(self, step: int) -> float:
        """Time at which a step begins, s, or the one before it ends."""
        return float(self._time[step : step + 1][0])

    def from_(self, time: float) -> int:
        """First step that begins at a time or later, of those that are held."""
        held = self._time[self._time.begin : self._time.end]
        return self._time.begin + int(np.searchsorted(held, time))

    def first(self, step: int) -> int:
        """Sample with which a step begins."""
        return int(self._last[step : step + 1][0])

    def gaps(self, steps: slice) -> Bools:
        """Which steps are gaps."""
        return self._gap[steps]

    def quiet(self, steps: slice) -> tuple[Bools, Floats]:
        """Which steps end a calm window, and the mean rates in them."""
        return self._quiet[steps], self._around[steps]

    def rows(self, rows: slice) -> tuple[Floats, Floats]:
        """Times and rates of samples."""
        return self._t[rows], self._gyr[rows]

    def all_rows(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Times, rates, specific forces and fields of all samples that are held."""
        rows = slice(self._t.begin, self.samples)
        return self._t[rows], self._gyr[rows], self._acc[rows], self._field[rows]

    def frames(self, steps: slice) -> keyframes.Keyframes:
        """Samples and steps, as the smoother takes them."""
        first = self._last[steps.start : steps.stop + 1]
        rows = slice(int(first[0]), int(first[-1]) + 1)
        variance = self._variance[steps]
        return keyframes.Keyframes(
            self._t[rows], self._gyr[rows], self._acc[rows], self._field[rows], first - first[0], self._gap[steps],
            np.ascontiguousarray(variance[:, 0]), np.ascontiguousarray(variance[:, 1]),
            np.arange(rows.start, rows.stop), float(variance[-1, 2]),
        )  # fmt: skip
