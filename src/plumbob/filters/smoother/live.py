"""Without a lag: the past is smoothed now and then, and a filter goes on from where that ends, on the same models.

What a few samples cannot tell (the first tilt, a bias that no rest shows, which of two fields belongs to the place) is
decided by all of the past together, each time again, and so no rule has to be right at once. In between nothing is
decided: the filter takes rest, speed and the weight of each field from what came before. The past is smoothed soon
after a start or a gap, then ever more seldom, and at once when the fields of a turning unit contradict the one of the
place. That one is proven by the time in which the unit turned in it: another must be seen for longer.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core import flags
from plumbob.core._jit import njit
from plumbob.core.check import Floats
from plumbob.core.units import deg
from plumbob.data import ImuData
from plumbob.data.cards.left import Half
from plumbob.filters.smoother.field import APART, LEAST_TURNING, REST_SHARE, STEEPEST, TURNING, Reference, white_noise
from plumbob.filters.smoother.inertial import (
    LEAK,
    LONGEST,
    REST_SPEED,
    SHORTEST,
    SPEED_TIMES,
    WINDOW,
    Calm,
    calm_so_far,
    speed_of,
)
from plumbob.filters.smoother.keyframes import Bools, Keyframes, turned_by
from plumbob.filters.smoother.model import SIZE, TH, B, M, Noise, Params, V
from plumbob.filters.smoother.passes import Known, Smoothed, smooth
from plumbob.filters.smoother.remarks import remarks_so_far
from plumbob.filters.smoother.samples import (
    CORE,
    DOUBTFUL,
    GATED,
    MARGIN,
    Part,
    Piece,
    covariance_of,
    everywhere,
    unknown,
)
from plumbob.filters.smoother.sweeps import (
    AGAIN,
    COUNT,
    FADE,
    FIELD,
    FORCE,
    MEANS,
    MEASURED,
    MOVING,
    RESTING,
    STEP,
    TERMS,
    TIME,
    Last,
    correct,
    corrected_rate,
    fade,
    heading_update,
    integrate,
    predict,
    zero_rate_update,
    zero_velocity_update,
)
from plumbob.rotations import quat_conjugate, quat_from_rotvec, quat_multiply

SOONEST: Final = 0.25
"""The past is smoothed for the first time after this, s, then each time later by"""
GROWS: Final = 1.5
EVERY: Final = 10.0
"""up to this, s."""
LEAST_PAUSE: Final = 2.0
"""And at once, but not sooner than this, s,"""
AGAINST: Final = 2.0
"""when the unit has turned for so long, s, in fields that are not the one of the place."""
PROVEN: Final = 3.0
"""The field of the place counts for so many times the time in which the unit turned in it,"""
YOUNG: Final = 10.0
"""beyond this, s: what surrounds a unit where it is picked up is not the place."""
ANY_ATTITUDE: Final = 10.0
"""Variance that a gap adds to the attitude, rad²."""
UNCERTAIN_HEADING: Final = deg(20.0)
"""With a larger standard deviation of a heading that a field gives, rad, the attitude is not converged."""
BLOCK: Final = 1.0
"""The filter goes on for so long at a time, s."""

SPEED2: Final = 0  # what is learned of the motion: mean squares of level speed and force, and the velocity
FORCE2: Final = 1
EAST_SPEED: Final = 2
NORTH_SPEED: Final = 3
LEARNED: Final = 4


class Field(NamedTuple):
    """The field of the place as the filter takes it: level and vertical part, spread, µT, and white noise, µT²/Hz."""

    level: float
    vertical: float
    spread: float
    white2: float

    @classmethod
    def of(cls, reference: Reference | None, p: Params) -> "Field":
        """Of a reference; without a level part where there is none."""
        if reference is None:
            return cls(0.0, 0.0, 1.0, 1.0)
        return cls(reference.level, reference.vertical, reference.spread(p), white_noise(p, reference) ** 2)


@njit
def velocity_density(learned: Floats, mean: Floats, dt: float, least: float) -> float:
    """Spectral density of the level velocity, m²/s, by how the body has moved up to now."""
    fading = math.exp(-dt / LEAK)
    learned[EAST_SPEED] = learned[EAST_SPEED] * fading + mean[FORCE]
    learned[NORTH_SPEED] = learned[NORTH_SPEED] * fading + mean[FORCE + 1]
    share = 1.0 - math.exp(-dt / WINDOW)
    speed2 = 0.5 * (learned[EAST_SPEED] ** 2 + learned[NORTH_SPEED] ** 2)
    force2 = 0.5 * (mean[FORCE] ** 2 + mean[FORCE + 1] ** 2) / (dt * dt)
    learned[SPEED2] += share * (speed2 - learned[SPEED2])
    learned[FORCE2] += share * (force2 - learned[FORCE2])
    speed = math.sqrt(learned[SPEED2])
    lasts = min(max(SPEED_TIMES * speed / max(math.sqrt(learned[FORCE2]), 1e-3), SHORTEST), LONGEST)
    return 2.0 * lasts * max(speed, least) ** 2


@njit
def field_weight(mean: Floats, field: Field) -> float:
    """How far the mean field of a step is believed, 0 to 1, by size, dip and direction; as `weights` has it."""
    if mean[COUNT] == 0.0:
        return 0.0
    level = math.hypot(mean[FIELD], mean[FIELD + 1])
    if not level > STEEPEST * field.level or field.level == 0.0:
        return 0.0
    half = field.level * math.sin(0.5 * math.atan2(mean[FIELD], mean[FIELD + 1]))
    off2 = (level - field.level) ** 2 + (mean[FIELD + 2] - field.vertical) ** 2 + half * half
    share = 1.0 + off2 / (field.spread * field.spread)
    return 1.0 / (share * share)  # type: ignore[no-any-return]


@njit
def onward(
    t: Floats, gyr: Floats, acc: Floats, mag: Floats, first: NDArray[np.int64], gap: Bools, quiet: Bools,
    around: Floats, missed: Floats, pushed: Floats, noise: Noise, field: Field, rest_band: float, least_speed: float,
    attitude: Floats, now: Floats, p: Floats, learned: Floats,
    q: Floats, x: Floats, cov: Floats, kind: NDArray[np.int64], weight: Floats,
) -> None:  # fmt: skip
    """Filter on over some keyframes: attitude, state and covariance of the attitude at each, and what each step was.

    `attitude`, `now`, `p` and `learned` are those before the first step, and are left as those after the last.
    """
    column, gain, term = np.zeros(SIZE), np.zeros((MEASURED, SIZE)), np.zeros((MEASURED, TERMS))
    f, mean = np.zeros(STEP), np.zeros(MEANS)
    write(0, attitude, now, p, q, x, cov)
    for k in range(first.size - 1):
        off2 = 0.0
        for i in range(3):
            off2 += (around[k, i] - now[B + i]) ** 2
        kind[k] = RESTING if quiet[k] and off2 < rest_band * rest_band else MOVING
        if gap[k]:
            kind[k] = AGAIN
        spread2 = integrate(first[k], first[k + 1], t, gyr, acc, mag, kind[k], attitude, now, f, mean)
        dt = f[TIME]
        f[FADE] = math.exp(-dt / noise.bend_time)
        weight[k] = 0.0
        if kind[k] == AGAIN:
            for i in (TH, TH + 1, TH + 2, V, V + 1):
                p[i, i] += ANY_ATTITUDE
        else:
            predict(p, now, f, mean, spread2, missed[k], pushed[k], noise)
        for i in range(3):
            p[B + i, B + i] += noise.walk * dt
        fade(p, now, f[FADE], noise.bend)
        if kind[k] != AGAIN:
            density = velocity_density(learned, mean, dt, least_speed)
            if kind[k] == RESTING:
                density = 2.0 * SHORTEST * REST_SPEED**2
            zero_velocity_update(p, now, gain, term, column, density / dt)
            if kind[k] == RESTING:
                zero_rate_update(p, now, gain, term, column, mean, dt, noise.rest / dt)
            weight[k] = field_weight(mean, field)
            if weight[k] > 0.0:
                var = field.white2 / (field.level * field.level * dt * weight[k])
                heading_update(p, now, gain, term, column, mean, var)
        correct(attitude, now)
        write(k + 1, attitude, now, p, q, x, cov)


@njit
def write(k: int, attitude: Floats, now: Floats, p: Floats, q: Floats, x: Floats, cov: Floats) -> None:
    """Write down what is known at a keyframe."""
    for i in range(4):
        q[k, i] = attitude[i]
    for i in range(SIZE):
        x[k, i] = now[i]
    for i in range(3):
        for j in range(3):
            cov[k, i, j] = p[TH + i, TH + j]


@njit
def between_keyframes(
    t: Floats, gyr: Floats, first: NDArray[np.int64], early: Bools, q_k: Floats, x: Floats, kind: NDArray[np.int64],
    q: Floats,
) -> None:  # fmt: skip
    """Attitude at every sample, from the keyframe before it by the gyroscope.

    A keyframe that came early, because nothing followed it, changes what comes after it alone.
    """
    now = np.empty(4)
    for k in range(first.size):
        for i in range(4):
            now[i] = q_k[k, i]
            if k == 0 or not early[k - 1]:
                q[first[k], i] = now[i]
        last = first[k + 1] if k < first.size - 1 else first[k]
        for s in range(first[k] + 1, last + 1):
            if kind[k] == MOVING:
                dt = t[s] - t[s - 1]
                wx, wy, wz = corrected_rate(x[k], gyr[s, 0], gyr[s, 1], gyr[s, 2])
                turned_by(now, dt * wx, dt * wy, dt * wz)
            for i in range(4):
                q[s, i] = now[i]


@dataclass(slots=True)
class Running:
    """The filter between two looks at the past.

    Attributes
    ----------
    last : Last
        What it knows now.
    learned : ndarray (4,)
        What it has learned of the motion.
    found : Smoothed
        What the last look found.
    field : Field
        The field of the place.
    iron : ndarray (3,)
        Field that turns with the sensor, µT.
    noise : Noise
        Of the model.
    since : float
        Time of that look, s.
    kind, weight : int, float
        Of the last step.
    against : float
        For how long since the look the unit turned in other fields, s.
    """

    last: Last
    learned: Floats
    found: Smoothed
    field: Field
    iron: Floats
    noise: Noise
    since: float
    kind: int
    weight: float
    against: float = 0.0


@dataclass(slots=True)
class Proven:
    """The field of the place, and for how long the unit turned and rested in it, s."""

    reference: Reference | None = None
    turning: float = 0.0
    rest: float = 0.0

    def known(self, unit: Floats | None, turned: float) -> Known:
        """What a look at the past takes for known, in which the unit turned for this time, s."""
        if turned < LEAST_TURNING:
            seen = self.turning + self.rest
        else:
            seen = max(self.turning + min(self.rest, REST_SHARE * self.turning) - YOUNG, 0.0)
        return Known(unit=unit, reference=self.reference, seen=(PROVEN - 1.0) * seen)

    def see(self, frames: Keyframes, found: Smoothed, p: Params) -> None:
        """Take what a look at the past found; another field must be proven again."""
        reference, before = found.reference, self.reference
        if reference is None:
            return
        turning = float(turning_time(frames, found.sweep.bias[1:], found.resting) @ found.weight)
        rest = float((frames.step * found.resting) @ found.weight)
        apart = math.inf if before is None else reference.apart(before)
        if apart > APART * p.mag_spread:
            self.turning, self.rest = turning, rest
        else:
            self.turning, self.rest = max(self.turning, turning), max(self.rest, rest)
        self.reference = reference


def turning_time(frames: Keyframes, bias: Floats | float, resting: Bools) -> Floats:
    """For how long the field of each step counts as one in which the unit turns, (K,), s."""
    rate = np.linalg.norm(frames.mean(frames.gyr) - bias, axis=1)
    return np.where(resting, 0.0, np.minimum(rate / TURNING, 1.0) * frames.step)


def live_parts(
    data: ImuData, p: Params, known: Known, *, mag: bool
) -> Iterator[tuple[Piece, Smoothed | None, list[str]]]:
    """What is known of each sample of a recording by nothing that comes after it, the last look, and remarks."""
    t, proven, begin = np.asarray(data.t), Proven(), 0
    q_last = np.array([1.0, 0.0, 0.0, 0.0])
    while begin < t.size:
        low, end = (int(i) for i in np.searchsorted(t, (t[begin] - MARGIN, t[begin] + CORE)))
        whole, core = data[low:end], slice(begin - low, end - low)
        frames, found, told = Keyframes.of(whole, p.keyframe, mag=mag, ahead=False), None, list[str]()
        if frames is None:
            part = unknown(whole, q_last, np.zeros(3))
        else:
            way = _Way(frames, p, known.unit, proven, q_last, data.meta.left)
            way.go(int(np.searchsorted(frames.time, t[begin], side="right")) - 1 if begin else 0)
            found = None if way.running is None else way.running.found
            part = everywhere(whole, frames, way.part(whole))
            told = remarks_so_far(frames, t[begin:end], part.flags[core])
        own = part.rows(core)
        free = (own.flags & flags.HEADING_FREE) != 0
        piece = Piece(whole.t[core], own, len(free) if free.all() else int(np.argmin(free)), frames is not None)
        q_last, begin = piece.part.q[-1].copy(), end
        yield piece, found, told


class _Way:
    """The way over the keyframes of a stretch, and what is known of its samples."""

    def __init__(
        self, frames: Keyframes, p: Params, unit: Floats | None, proven: Proven, q: Floats, left: tuple[Half, Half]
    ) -> None:
        n = frames.t.size
        self.left = left
        self.frames, self.p, self.unit, self.proven = frames, p, unit, proven
        self.calm: Calm = calm_so_far(frames, p)
        self.running: Running | None = None
        self.anchor: tuple[int, Floats] | None = None
        self.rate = np.zeros((n, 3))
        lost = np.full(n, flags.NOT_CONVERGED | flags.HEADING_FREE, dtype=np.uint32)
        self.known = Part(np.tile(q, (n, 1)), np.zeros((n, 3)), np.tile(math.pi**2 * np.eye(3), (n, 1, 1)), lost)

    def go(self, k: int) -> None:
        """From a keyframe to the last one."""
        time, gap = self.frames.time, self.frames.gap
        pause, due = SOONEST, time[k] + (SOONEST if k == 0 else 0.0)
        if k:
            self.anchor = (k, self.known.q[self.frames.first[k]].copy())
        while k < gap.size:
            if time[k] >= due - 1e-9 or self.contradicted(time[k]):
                pause = min(pause * GROWS, EVERY)
                due = time[k] + pause
                self.look(k)
            until = due if self.running is None else min(due, time[k] + BLOCK)
            end = min(max(int(np.searchsorted(time, until, side="right")) - 1, k + 1), gap.size)
            holes = np.flatnonzero(gap[k:end])
            end = end if not holes.size else k + int(holes[0]) + 1
            self.on(k, end)
            k = end
            if gap[k - 1]:
                pause, due = SOONEST, time[k] + SOONEST
                if self.running is not None:
                    self.anchor = (k, self.running.last.attitude.copy())

    def contradicted(self, now: float) -> bool:
        """Whether the unit has turned for long in fields that are not the one of the place."""
        running = self.running
        return running is not None and running.against > AGAINST and now - running.since > LEAST_PAUSE

    def look(self, k: int) -> None:
        """Smooth the past, and go on from there."""
        time, p = self.frames.time, self.p
        past = slice(int(np.searchsorted(time, time[k] - MARGIN)), k)
        if past.stop - past.start < 3:
            return
        frames = self.frames.part(past)
        turned = float(turning_time(frames, 0.0, self.calm.quiet[past]).sum())
        found = smooth(frames, p, self.proven.known(self.unit, turned))
        self.proven.see(frames, found, p)
        last, force = found.sweep.last, np.where(frames.gap[:, np.newaxis], 0.0, found.sweep.force[:, :2])
        if found.reference is None and self.anchor is not None:
            place, attitude = self.anchor
            by = _heading_between(found.sweep.q[max(place - past.start, 0)], attitude)
            last, force = _turned(last, by), force @ _level_turn(by).T
        self.anchor = (k, last.attitude.copy())
        back = time[k] - frames.time[1:]
        velocity = (force * (frames.step * np.exp(-back / LEAK))[:, np.newaxis]).sum(axis=0)
        force2 = float(np.mean(0.5 * (force[back < WINDOW] ** 2).sum(axis=1)))
        learned = np.array([speed_of(frames, force).speed[-1] ** 2, force2, *velocity])
        iron = np.zeros(3) if found.attached is None else found.attached.field[-1]
        bend = 0.0 if found.reference is None else found.reference.bend(p)
        self.running = Running(
            last, learned, found, Field.of(found.reference, p), iron, Noise.of(p, bend), time[k],
            RESTING if found.resting[-1] else MOVING, float(found.weight[-1]),
        )  # fmt: skip

    def on(self, k: int, end: int) -> None:
        """Filter on from a keyframe to another one."""
        running = self.running
        if running is None:
            return
        frames, p, n = self.frames.part(slice(k, end)), self.p, end - k
        q, x, cov = np.empty((n + 1, 4)), np.empty((n + 1, SIZE)), np.empty((n + 1, 3, 3))
        kind, weight = np.empty(n, dtype=np.int64), np.empty(n)
        onward(
            frames.t, frames.gyr, frames.acc, frames.mag - running.iron, frames.first, frames.gap,
            self.calm.quiet[k:end], self.calm.mean[k:end], frames.missed, frames.pushed, running.noise, running.field,
            p.rest_band, p.speed, *running.last, running.learned, q, x, cov, kind, weight,
        )  # fmt: skip
        early = frames.step < p.keyframe - 1e-6
        fine = np.empty((frames.t.size, 4))
        between_keyframes(frames.t, frames.gyr, frames.first, early, q, x, kind, fine)
        place = np.searchsorted(frames.first, np.arange(frames.t.size), side="right") - 1
        place[frames.first[1:][early]] -= 1
        bias, matrix = x[place, B : B + 3], x[place, M:].reshape(-1, 3, 3)
        rate = frames.gyr - bias - np.einsum("nij,nj->ni", matrix, frames.gyr)
        found, kinds = running.found, np.concatenate(([running.kind], kind))
        weights = np.concatenate(([running.weight], weight))
        running.kind, running.weight = int(kind[-1]), float(weight[-1])
        word = self._flags(found, kinds[place], weights[place], cov[place])
        known = Part(fine, bias, covariance_of(fine, cov[place], found, rate, p, self.left), word)
        skip = int(k > 0 and self.frames.time[k] - self.frames.time[k - 1] < p.keyframe - 1e-6)
        rows = slice(int(self.frames.first[k]) + skip, int(self.frames.first[end]) + 1)
        self.rate[rows] = rate[skip:]
        self.known.put(rows, known.rows(slice(skip, None)))
        if found.reference is not None:
            others = turning_time(frames, x[1:, B : B + 3], kind != MOVING) @ (weight < GATED)
            running.against += float(others)

    @staticmethod
    def _flags(found: Smoothed, kind: NDArray[np.int64], weight: Floats, cov: Floats) -> NDArray[np.uint32]:
        """What to know of each sample."""
        word = np.where(kind == RESTING, flags.AT_REST, 0)
        lost = cov[:, 0, 0] + cov[:, 1, 1] > 2.0 * DOUBTFUL**2
        if found.reference is None:
            word |= flags.HEADING_FREE
        else:
            word |= np.where(weight < GATED, flags.MAG_GATED, 0)
            lost |= cov[:, 2, 2] + found.heading_var > UNCERTAIN_HEADING**2
        return (word | np.where(lost, flags.NOT_CONVERGED, 0)).astype(np.uint32)

    def part(self, data: ImuData) -> Part:
        """What is known of the samples."""
        q = self.known.q
        if self.p.latency:
            q = quat_multiply(q, quat_from_rotvec(self.p.latency * self.rate))
        return self.known._replace(q=q, flags=np.asarray(data.flags)[self.frames.rows] | self.known.flags)


def _heading_between(q: Floats, other: Floats) -> float:
    """Turn about the vertical, rad, that brings the heading of an attitude (4,) to that of another one."""
    turn = quat_multiply(other, quat_conjugate(q))
    return 2.0 * math.atan2(float(turn[3]), float(turn[0]))


def _level_turn(by: float) -> Floats:
    c, s = math.cos(by), math.sin(by)
    return np.array([[c, -s], [s, c]])


def _turned(last: Last, by: float) -> Last:
    """What is known, with a heading that counts from elsewhere."""
    turn = np.eye(SIZE)
    for i in (TH, V):
        turn[i : i + 2, i : i + 2] = _level_turn(by)
    attitude = quat_multiply(np.array([math.cos(0.5 * by), 0.0, 0.0, math.sin(0.5 * by)]), last.attitude)
    return Last(np.asarray(attitude), turn @ last.state, turn @ last.cov @ turn.T)
