"""Without a lag, between two looks at the past: a filter on the models of the smoother that goes on from the last look.

Rest, speed and the weight of each field come from what was before. What contradicts itself is doubted: the covariance
grows by the angle in question, and the look that comes next decides.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.kernels import kernel
from plumbob.core.units import deg
from plumbob.filters.smoother.field import (
    APART,
    HEADING2,
    LASTS,
    LEAST_LEVEL,
    STEEPEST,
    TILT2,
    TURNING,
    Reference,
    contradict,
    on_earth,
    white_noise,
)
from plumbob.filters.smoother.inertial import (
    ANY_SPEED,
    LEAK,
    REST_SPEED,
    SHORTEST,
    SPEED_TIMES,
    TINY,
    USUAL_SPEED,
    WIDE,
    WINDOW,
)
from plumbob.filters.smoother.keyframes import Bools, turned_by
from plumbob.filters.smoother.model import KEPT, SIZE, TH, B, ModelVariances, Params, V
from plumbob.filters.smoother.samples import GATED
from plumbob.filters.smoother.stationary import CLEAR, HOLDS, MISLED, STOOD, UNTIL, means, stands, take_bias
from plumbob.filters.smoother.sweeps import (
    COUNT,
    FADE,
    FIELD,
    FORCE,
    FORGOTTEN,
    HUBER,
    INVERSE,
    KIND,
    MEANS,
    MEASURED,
    MOVING,
    RAW,
    RESTING,
    SEVERED,
    STEP,
    TERMS,
    TILT,
    TIME,
    Way,
    correct,
    corrected_by,
    corrected_rate,
    fade,
    heading_update,
    integrate,
    keep,
    predict,
    update_one,
    zero_rate_update,
    zero_velocity_update,
)
from plumbob.filters.start import angle_to, turn_about_vertical, upright
from plumbob.rotations.kernels import quat_mul, quat_unit, rotate

LOST: Final = deg(20.0)  # a tilt that would be off by more than this, rad, is sought again, as at a start in motion

SPEED2: Final = 0  # what is learned of the motion: mean squares of level speed and force, velocity, and so upwards,
FORCE2: Final = 1
EAST_SPEED: Final = 2
NORTH_SPEED: Final = 3
RISE: Final = 4
PEAK2: Final = 5  # and the largest square of the speed, fading
LEARNED: Final = 6

OTHER: Final = 0  # a field that contradicts the one of the place: its mean, east, north and up, µT
SEEN: Final = 3  # for how long it stays as it is, s, and by how much the unit has turned in it since, rad
TURNED: Final = 4
TAKEN: Final = 5  # whether it has become the one of the place
BEGAN: Final = 6  # and since when it had been seen, s
DOUBT: Final = 7  # its azimuth, rad, as long as the field of the place is not seen again
CONTRARY: Final = 8
STEADY: Final = 0.5
"""A field that contradicts one that no turn has proven, and stays for so long, s, may be that of the place as well;"""
TAKES: Final = deg(30.0)
"""once the unit has turned in it by this, rad, it is: what surrounds a unit where it lies is not the place."""
ALIKE: Final = 2.0  # it stays as it is within so many spreads of the field
TAKEN_SD: Final = deg(5.0)  # the heading is then known to this, rad


class LocalField(NamedTuple):
    """The field of the place as the filter takes it: level and vertical part, spread, µT, and white noise, µT²/Hz.

    `lasted` is for how long the unit turned or lay in it, s.
    """

    level: float
    vertical: float
    spread: float
    white2: float
    lasted: float

    @classmethod
    def from_reference(cls, reference: Reference | None, p: Params, lasted: float) -> "LocalField":
        """Of a reference; without a level part where there is none."""
        if reference is None:
            return cls(0.0, 0.0, 1.0, 1.0, 0.0)
        return cls(reference.level, reference.vertical, reference.spread(p), white_noise(p, reference) ** 2, lasted)


@kernel
def velocity_density(learned: Floats, mean: Floats, dt: float, least: float, untold: bool) -> float:
    """Spectral density of the level velocity, m²/s, by how the body has moved up to now; a held force says nothing."""
    if untold:
        learned[EAST_SPEED] = learned[NORTH_SPEED] = learned[RISE] = 0.0
    else:
        fading = math.exp(-dt / LEAK)
        learned[EAST_SPEED] = learned[EAST_SPEED] * fading + mean[FORCE]
        learned[NORTH_SPEED] = learned[NORTH_SPEED] * fading + mean[FORCE + 1]
        learned[RISE] = learned[RISE] * fading + mean[FORCE + 2] - G0 * dt
        share = 1.0 - math.exp(-dt / WINDOW)
        speed2 = 0.5 * (learned[EAST_SPEED] ** 2 + learned[NORTH_SPEED] ** 2)
        force2 = 0.5 * (mean[FORCE] ** 2 + mean[FORCE + 1] ** 2) / (dt * dt)
        learned[SPEED2] += share * (speed2 - learned[SPEED2])
        learned[FORCE2] += share * (force2 - learned[FORCE2])
        learned[PEAK2] = max(learned[SPEED2], learned[PEAK2] * fading)
    return 2.0 * lasts(learned) * max(learned[SPEED2], least * least)  # type: ignore[no-any-return]


@kernel
def lasts(learned: Floats) -> float:
    """For how long a level velocity lasts, s, as `level_speed` has it."""
    force = max(math.sqrt(learned[FORCE2]), 1e-3)
    return min(max(SPEED_TIMES * math.sqrt(learned[SPEED2]) / force, SHORTEST), LEAK)


@kernel
def lasting(learned: Floats, dt: float) -> float:
    """Share of the level velocity that lasts over a step, as `Speed.lasting` has it."""
    share = learned[PEAK2] / (learned[PEAK2] + USUAL_SPEED * USUAL_SPEED)
    return math.exp(-dt / LEAK * share)


@kernel
def with_doubts(p: Floats, all2: float, tilt2: float, heading2: float, cov: Floats) -> None:
    """Covariance of the attitude (3, 3) with what is in doubt counted, rad²: all of it, its tilt, its heading."""
    for i in range(3):
        for j in range(3):
            cov[i, j] = p[TH + i, TH + j]
    cov[0, 0] += all2 + tilt2
    cov[1, 1] += all2 + tilt2
    cov[2, 2] += all2 + heading2


@kernel
def begin_anew(standing: Floats, time: float, attitude: Floats, now: Floats, p: Floats, learned: Floats) -> None:
    """Take the mean force of the last seconds for up, known to `LOST`: bias or scale are others."""
    level, gravity = math.hypot(learned[EAST_SPEED], learned[NORTH_SPEED]), LEAK * G0 + learned[RISE]
    turn = math.atan2(level, gravity) / level
    corrected_by(attitude, turn * learned[NORTH_SPEED], -turn * learned[EAST_SPEED], 0.0)
    for i in range(3):
        p[TH + i, TH + i] += LOST * LOST
    for i in (V, V + 1):
        now[i] = 0.0
        for j in range(SIZE):
            p[i, j] = p[j, i] = 0.0
        p[i, i] = USUAL_SPEED * USUAL_SPEED
    learned[:] = 0.0
    standing[MISLED], standing[UNTIL] = time, time + HOLDS


@kernel
def unlikely_tilt(learned: Floats) -> float:
    """Variance of the tilt, rad², by a level velocity beyond the usual: it may be gravity in a wrong attitude.

    Then the mean force is as large as gravity; where its upward part alone is, the body gathers speed.
    """
    speed2, gravity = learned[EAST_SPEED] ** 2 + learned[NORTH_SPEED] ** 2, LEAK * G0
    tilted = math.sqrt(speed2 + (gravity + learned[RISE]) ** 2) - gravity
    odds = (tilted * tilted - learned[RISE] ** 2) / (2.0 * USUAL_SPEED * USUAL_SPEED)
    share = 1.0 / (1.0 + math.exp(min(odds, 50.0)))
    return share * max(speed2 - USUAL_SPEED * USUAL_SPEED, 0.0) / gravity**2  # type: ignore[no-any-return]


@kernel
def wrong_tilt(doubt: Floats, learned: Floats) -> float:
    """Variance of the tilt, rad², by fields that contradict it, as far as gravity allows.

    A tilt that has been wrong for some seconds is a level velocity that has grown since, by as much as `LEAK` keeps.
    """
    speed2 = 0.5 * (learned[EAST_SPEED] ** 2 + learned[NORTH_SPEED] ** 2) + USUAL_SPEED * USUAL_SPEED
    allowed2 = speed2 / (G0 * min(max(doubt[LASTS], SHORTEST), LEAK)) ** 2
    return doubt[TILT2] * allowed2 / (doubt[TILT2] + allowed2)  # type: ignore[no-any-return]


@kernel
def disputed(
    doubt: Floats, mean: Floats, dt: float, field: LocalField, p: Floats, learned: Floats
) -> tuple[float, float]:
    """Variances of tilt and heading, rad², by a step whose field contradicts that of the place beyond what is claimed.

    The attitude may be wrong, or another field that of the place: by Laplace's rule of succession, of the seconds in
    which either was seen, one in (s + 2) is the next [Laplace1774].
    """
    elsewhere2 = 0.0
    if mean[COUNT] > 0.0 and field.level > 0.0:
        level2, tilt2 = field.level * field.level, 0.5 * (p[TH, TH] + p[TH + 1, TH + 1])
        spread2 = field.spread * field.spread + level2 * p[TH + 2, TH + 2] + (level2 + field.vertical**2) * tilt2
        spread, step = math.sqrt(spread2), mean[FIELD : FIELD + 3]
        elsewhere2 = contradict(doubt, step, dt, field.level, field.vertical, spread)
        elsewhere2 *= (doubt[LASTS] + 1.0) / (field.lasted + doubt[LASTS] + 2.0)
    return wrong_tilt(doubt, learned), doubt[HEADING2] + elsewhere2


@kernel
def field_weight(mean: Floats, field: LocalField, tilt2: float, heading2: float) -> float:
    """How far the mean field of a step is believed, 0 to 1, by size, dip and direction; as `weights` has it.

    Dip and direction say the less against it the larger the variances of tilt and heading are, rad².
    """
    if mean[COUNT] == 0.0:
        return 0.0
    level = math.hypot(mean[FIELD], mean[FIELD + 1])
    if not level > STEEPEST * field.level or field.level == 0.0:
        return 0.0
    half = field.level * math.sin(0.5 * math.atan2(mean[FIELD], mean[FIELD + 1]))
    spread2, level2 = field.spread * field.spread, field.level * field.level
    share = 1.0 + (level - field.level) ** 2 / (spread2 + field.vertical * field.vertical * tilt2)
    share += (mean[FIELD + 2] - field.vertical) ** 2 / (spread2 + level2 * tilt2)
    share += max(half * half - HUBER * 0.25 * level2 * heading2, 0.0) / spread2
    return 1.0 / (share * share)  # type: ignore[no-any-return]


@kernel
def onward(
    t: Floats, gyr: Floats, acc: Floats, mag: Floats, first: NDArray[np.int64], gap: Bools, quiet: Bools,
    around: Floats, missed: Floats, pushed: Floats, untold: Bools, noise: ModelVariances, field: LocalField,
    rest_band: float, rest_time: float, least_speed: float, proven: bool, attitude: Floats, now: Floats, p: Floats,
    learned: Floats, against: Floats, other: Floats, standing: Floats, doubt: Floats, q: Floats, x: Floats,
    way_cov: Floats, gain: Floats, term: Floats, step: Floats, cov: Floats, word: NDArray[np.uint32], weight: Floats,
) -> None:  # fmt: skip
    """Filter on over some keyframes: the `Way`, covariance of the attitude at each with doubts, and what each step was.

    `attitude`, `now`, `p` and `learned` are those before the first step, and are left as those after the last;
    `against` is the time for which the unit turned in other fields than that of the place, `other` such a field, and
    `stationary` what contradicts the gyroscope.
    """
    column, mean, vectors, rate = np.zeros(SIZE), np.zeros(MEANS), np.empty(9), np.empty(3)
    keep(0, attitude, now, p, q, x, way_cov)
    for k in range(first.size - 1):
        f = step[k]
        for i in range(MEASURED):
            term[k, i, INVERSE] = 0.0
        kind = MOVING if gap[k] else step_kind(quiet[k], around[k], now, rest_band)
        spread2 = integrate(first[k], first[k + 1], t, gyr, acc, mag, kind, attitude, now, f, mean)
        dt = f[TIME]
        f[FADE] = math.exp(-dt / noise.bend_time)
        weight[k], f[FORGOTTEN] = 0.0, 1.0 if gap[k] or untold[k] else 0.0
        predict(p, now, f, mean, spread2, missed[k], pushed[k], lasting(learned, dt), noise)
        for i in range(3):
            p[B + i, B + i] += noise.walk * dt
        fade(p, now, f[FADE], noise.bend)
        if gap[k]:
            forget_velocity(p, now)
            fx, fy, fz = acc[first[k + 1], 0], acc[first[k + 1], 1], acc[first[k + 1], 2]
            east, north, up = rotate(attitude[0], attitude[1], attitude[2], attitude[3], fx, fy, fz)
            tilt_update(p, now, gain[k], term[k], column, east, north, up)
        else:
            weight[k] = measure(
                p, now, gain[k], term[k], column, mean, dt, kind, learned, least_speed, untold[k], noise, field
            )  # fmt: skip
        rate[0], rate[1], rate[2] = corrected_rate(now, mean[RAW] / dt, mean[RAW + 1] / dt, mean[RAW + 2] / dt)
        turning = math.sqrt(rate[0] ** 2 + rate[1] ** 2 + rate[2] ** 2) if kind == MOVING else 0.0
        if weight[k] < GATED and field.level > 0.0:
            against[0] += min(turning / TURNING, 1.0) * dt  # as `turning_time` has it
        correct(attitude, now)
        doubt2, end = 0.0, t[first[k + 1]]
        if kind == MOVING:
            means(acc, mag, first[k], first[k + 1], vectors)
            doubt2 = stands(standing, vectors, attitude, rate, dt, end)
        else:
            standing[STOOD] = 0.0
        if doubt2 > CLEAR * CLEAR and quiet[k]:
            take_bias(standing, end, attitude, now, p, rest_band, rest_time)
            learned[:] = 0.0
            f[KIND] = SEVERED
        if not proven and contradicted(other, mean, dt, turning, field, weight[k], gap[k]):
            turn_heading_by(other[DOUBT], attitude, now, p, learned)
            p[TH + 2, TH + 2] += TAKEN_SD**2
            field = taken(other, field)
            other[TAKEN], other[BEGAN], other[SEEN], other[DOUBT] = 1.0, end - other[SEEN], 0.0, 0.0
            proven, f[KIND] = True, SEVERED
        tilt2 = unlikely_tilt(learned)
        if tilt2 > LOST * LOST:
            begin_anew(standing, end, attitude, now, p, learned)
            tilt2, f[KIND] = 0.0, SEVERED
        keep(k + 1, attitude, now, p, q, x, way_cov)
        wrong_tilt2, heading2 = disputed(doubt, mean, dt, field, p, learned)
        with_doubts(p, doubt2, tilt2 + wrong_tilt2, heading2 + other[DOUBT] ** 2, cov[k + 1])
        word[k] = (flags.AT_REST if kind == RESTING else 0) | (flags.INCONSISTENT if end < standing[UNTIL] else 0)


@kernel
def measure(
    p: Floats, now: Floats, gain: Floats, term: Floats, column: Floats, mean: Floats, dt: float, kind: int,
    learned: Floats, least_speed: float, untold: bool, noise: ModelVariances, field: LocalField,
) -> float:  # fmt: skip
    """Take in what a step shows of velocity, rest and heading; returns how far its field was believed."""
    density = velocity_density(learned, mean, dt, least_speed, untold)
    if untold:
        forget_velocity(p, now)
    else:
        if kind == RESTING:
            speed2 = 0.5 * (learned[EAST_SPEED] ** 2 + learned[NORTH_SPEED] ** 2)
            density = 2.0 * max(lasts(learned) * speed2, SHORTEST * REST_SPEED**2)
        tilt_update(p, now, gain, term, column, mean[FORCE] / dt, mean[FORCE + 1] / dt, mean[FORCE + 2] / dt)
        zero_velocity_update(p, now, gain, term, column, density / dt)
    if kind == RESTING:
        zero_rate_update(p, now, gain, term, column, mean, dt, noise.rest / dt)
    weight = field_weight(mean, field, 0.5 * (p[TH, TH] + p[TH + 1, TH + 1]), p[TH + 2, TH + 2])
    if weight > 0.0:
        heading_update(p, now, gain, term, column, mean, field.white2 / (field.level * field.level * dt * weight))
    return weight


@kernel
def tilt_update(
    p: Floats, now: Floats, gain: Floats, term: Floats, column: Floats, east: float, north: float, up: float
) -> None:
    """A tilt that is less sure than that of a start in motion: a force, in navigation axes, is up, as there."""
    if p[TH, TH] + p[TH + 1, TH + 1] < 2.0 * WIDE * WIDE:
        return
    level = math.hypot(east, north)
    turn = math.atan2(level, up) / max(level, 1e-9)
    var = WIDE * WIDE + (math.hypot(level, up) / G0 - 1.0) ** 2
    update_one(p, now, gain[TILT], term[TILT], column, TH, turn * north - now[TH], var)
    update_one(p, now, gain[TILT + 1], term[TILT + 1], column, TH + 1, -turn * east - now[TH + 1], var)


@kernel
def forget_velocity(p: Floats, now: Floats) -> None:
    """The level velocity may be any: a held force turns with the body, and adds up to nonsense."""
    for i in (V, V + 1):
        now[i] = 0.0
        for j in range(SIZE):
            p[i, j] = p[j, i] = 0.0
        p[i, i] = ANY_SPEED**2


@kernel
def step_kind(quiet: bool, around: Floats, now: Floats, rest_band: float) -> int:
    """Kind of a step: at rest where it ends a calm window whose mean rate is the bias."""
    off2 = 0.0
    for i in range(3):
        off2 += (around[i] - now[B + i]) ** 2
    return RESTING if quiet and off2 < rest_band * rest_band else MOVING


@kernel
def taken(other: Floats, field: LocalField) -> LocalField:
    """Another field as the one of the place."""
    return LocalField(math.hypot(other[OTHER], other[OTHER + 1]), other[OTHER + 2], field.spread, field.white2, 0.0)


@kernel
def contradicted(
    other: Floats, mean: Floats, dt: float, rate: float, field: LocalField, weight: float, again: bool
) -> bool:
    """Whether the unit has turned enough in another field for that to be the one of the place."""
    if field.level == 0.0 or not on_earth(math.hypot(mean[FIELD], mean[FIELD + 1]), mean[FIELD + 2]):
        return False
    if again or mean[COUNT] == 0.0 or weight >= GATED:
        other[SEEN], other[DOUBT] = 0.0, 0.0
        return False
    see_other(other, mean, dt, rate, field)
    level = math.hypot(other[OTHER], other[OTHER + 1])
    return bool(other[SEEN] > STEADY and other[TURNED] > TAKES and level > LEAST_LEVEL)


@kernel
def see_other(other: Floats, mean: Floats, dt: float, rate: float, field: LocalField) -> None:
    """Follow a field that contradicts the one of the place; one that changes is not the one that was seen before."""
    east, north, up = mean[FIELD], mean[FIELD + 1], mean[FIELD + 2]
    apart2 = east**2 + (north - field.level) ** 2 + (up - field.vertical) ** 2
    off2 = (east - other[OTHER]) ** 2 + (north - other[OTHER + 1]) ** 2 + (up - other[OTHER + 2]) ** 2
    if other[SEEN] == 0.0 or off2 > (ALIKE * field.spread) ** 2 or apart2 < (APART * field.spread) ** 2:
        other[SEEN], other[TURNED] = 0.0, 0.0
    if other[SEEN] > STEADY:
        other[TURNED] += rate * dt
    other[SEEN] += dt
    share = dt / min(other[SEEN], 1.0)
    for i in range(3):
        other[OTHER + i] += min(share, 1.0) * (mean[FIELD + i] - other[OTHER + i])
    if other[SEEN] > STEADY:
        other[DOUBT] = math.atan2(other[OTHER], other[OTHER + 1])


@kernel
def first_attitudes(acc: Floats, mag: Floats, spread: float, q: Floats, var: Floats) -> None:
    """Turn what the gyroscope has of the first samples, (N, 4), up and north by all of them up to each.

    The mean force is up, and the mean field of a place points north: `var` (N, 2) becomes what tilt and heading are
    known to, rad², by the size of that force and the `spread` of fields, µT.
    """
    force, field, fields = np.zeros(3), np.zeros(3), 0
    for i in range(acc.shape[0]):
        a0, a1, a2, a3 = q[i, 0], q[i, 1], q[i, 2], q[i, 3]
        x, y, z = rotate(a0, a1, a2, a3, acc[i, 0], acc[i, 1], acc[i, 2])
        force[0], force[1], force[2] = force[0] + x, force[1] + y, force[2] + z
        if not math.isnan(mag[i, 0]):
            x, y, z = rotate(a0, a1, a2, a3, mag[i, 0], mag[i, 1], mag[i, 2])
            field[0], field[1], field[2], fields = field[0] + x, field[1] + y, field[2] + z, fields + 1
        size = max(math.sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2), TINY)
        u0, u1, u2, u3 = upright(1.0, force[0] / size, force[1] / size, force[2] / size)
        a0, a1, a2, a3 = quat_mul(u0, u1, u2, u3, a0, a1, a2, a3)
        var[i, 0], var[i, 1] = WIDE * WIDE + (size / (G0 * (i + 1)) - 1.0) ** 2, math.pi**2
        east, north, up = rotate(u0, u1, u2, u3, field[0], field[1], field[2])
        level = math.hypot(east, north)
        if fields and on_earth(level / fields, up / fields) and level > STEEPEST * abs(up):
            a0, a1, a2, a3 = turn_about_vertical(angle_to(east, north, 0.0, 1.0), a0, a1, a2, a3)
            var[i, 1] = ((fields * spread) ** 2 + up * up * var[i, 0]) / (level * level)
        q[i, 0], q[i, 1], q[i, 2], q[i, 3] = quat_unit(a0, a1, a2, a3)


@kernel
def turn_heading_by(by: float, attitude: Floats, now: Floats, p: Floats, learned: Floats) -> None:
    """Count headings from elsewhere: turn all that has a direction about the vertical, rad."""
    c, s = math.cos(0.5 * by), math.sin(0.5 * by)
    w, x, y, z = attitude[0], attitude[1], attitude[2], attitude[3]
    attitude[0], attitude[1], attitude[2], attitude[3] = c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w
    c, s = math.cos(by), math.sin(by)
    for i in (TH, V):
        now[i], now[i + 1] = c * now[i] - s * now[i + 1], s * now[i] + c * now[i + 1]
        for j in range(SIZE):
            p[i, j], p[i + 1, j] = c * p[i, j] - s * p[i + 1, j], s * p[i, j] + c * p[i + 1, j]
        for j in range(SIZE):
            p[j, i], p[j, i + 1] = c * p[j, i] - s * p[j, i + 1], s * p[j, i] + c * p[j, i + 1]
    east, north = learned[EAST_SPEED], learned[NORTH_SPEED]
    learned[EAST_SPEED], learned[NORTH_SPEED] = c * east - s * north, s * east + c * north


@kernel
def between_keyframes(
    t: Floats, gyr: Floats, first: NDArray[np.int64], early: Bools, gap: Bools, q_k: Floats, x: Floats, q: Floats,
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
            if not gap[k]:
                dt = t[s] - t[s - 1]
                wx, wy, wz = corrected_rate(x[k], gyr[s, 0], gyr[s, 1], gyr[s, 2])
                turned_by(now, dt * wx, dt * wy, dt * wz)
            for i in range(4):
                q[s, i] = now[i]


class Room(NamedTuple):
    """What `onward` writes of some steps.

    Their way, the covariance of the attitude with doubts (K + 1, 3, 3), rad², flags (K,), and how far the field of each
    was believed (K,).
    """

    way: Way
    cov: Floats
    word: NDArray[np.uint32]
    weight: Floats

    @classmethod
    def empty(cls, n: int) -> "Room":
        """For n steps."""
        q, x, cov = np.empty((n + 1, 4)), np.empty((n + 1, SIZE)), np.empty((n + 1, KEPT, SIZE))
        way = Way(q, x, cov, np.empty((n, MEASURED, SIZE)), np.empty((n, MEASURED, TERMS)), np.empty((n, STEP)))
        return cls(way, np.empty((n + 1, 3, 3)), np.empty(n, dtype=np.uint32), np.empty(n))
