"""Versatile quaternion-based filter, our own writing of [Laidig2023]: a slow horizon in an almost inertial frame.

The gyroscope alone turns a frame that drifts by its bias only. In that frame the specific force is smoothed over
seconds, so that accelerations average out while gravity stays; what is left of the tilt turns the drifting frame level.
The heading is corrected by the field in the level plane, by a first-order filter, where the field is that of the Earth.
The gyroscope bias is learned at rest from the mean rate, and in motion from the turn of the smoothed horizon.

When to choose it: as the default for anything that moves, where a covariance is not needed. It has one setting per
question (how long do accelerations last: tau_acc; how far is the field to be trusted: tau_mag) and needs no noise
figures.

=============  ==============  ========  ======================================================
symbol         name            unit      meaning
=============  ==============  ========  ======================================================
q_S            x[GYRO]         1         body to the drifting frame, by the gyroscope alone
q_I            x[TILT]         1         drifting frame to a level one with z up
δ              x[TURN]         1         half-angle cosine and sine of the turn to north
b              x[BIAS]         rad/s     gyroscope bias
P              x[COV]          rad²/s²   its covariance, upper triangle
=============  ==============  ========  ======================================================

Departures from [Laidig2023]: the low-passes are exact for any step (the paper's are bilinear and want equal steps), and
so are all other time constants; sensors may be absent, at any rate; what the bias is learned from in motion is limited
in length, not axis by axis, so that no heading is special; a steady rate is rest where it is near the bias, for what is
known of it, or where gravity and the field are seen to stand still (the paper's is rest up to the largest bias).
Added: stuck, clipped and jumping sensors are kept out; where the rate was unknown for long enough to matter, horizon
and heading begin again as at the start, and what was missed before counts less as the horizon is corrected; a smoothed
specific force that is not g is not followed for a while; a bias that jumps is noticed by the corrections that it keeps
calling for, and at rest by gravity and a field that do not turn.

A slow turn whose rate is within what is known of the bias, at the start up to 1.7 °/s, is still taken for rest. With a
magnetometer the heading is then late by the rate times tau_mag, or twice that, and the bias is put right when the turn
ends. Without one, about the vertical, it is put right by a rest that is longer, or, after 10 s of such a turn, only
when the bias has become uncertain again.
"""

import math
from typing import Annotated, Final, NamedTuple

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.kernels import kernel
from plumbob.core.params import Spec
from plumbob.core.units import Quantity, deg, dps
from plumbob.filters.field import FIELD_SIZE, disturbed
from plumbob.filters.input_checks import (
    GRAVITY_SIZE,
    GUARD_SIZE,
    HOLD,
    JUMP_SD,
    LEAN,
    LEAN_TAU,
    admit_rate,
    may_be_gravity,
    only_gravity,
    refused,
    trusted,
    usable,
)
from plumbob.filters.layout import (
    BIAS,
    BLIND,
    COUNT,
    HEADED,
    HELD,
    LEVEL,
    NORTH_X,
    NORTH_Y,
    OWN,
    OWN_C,
    STAGE,
    UP,
    Q,
    kept_weights,
    smooth,
)
from plumbob.filters.settling import (
    REST_SIZE,
    RestAfter,
    RestForce,
    RestRate,
    at_rest,
    mean_force,
    mean_rate,
    mean_speed,
)
from plumbob.filters.start import angle_to, has_heading, initialise, upright
from plumbob.rotations.kernels import cross, quat_exp, quat_mul, quat_unit, rotate

SUMMARY: Final = "versatile quaternion-based filter (Laidig and Seel 2023), own writing, guarded against bad input"
REFERENCES: Final = ("Laidig2023",)
NEEDS: Final = ("gyr", "acc")

TAU_ACC: Final = OWN_C
TAU_MAG: Final = OWN_C + 1
BIAS_START: Final = OWN_C + 2
BIAS_MAX: Final = OWN_C + 3
BIAS_MOVING: Final = OWN_C + 4
BIAS_RESTING: Final = OWN_C + 5
REST_RATE: Final = OWN_C + 6
REST_FORCE: Final = OWN_C + 7
REST_AFTER: Final = OWN_C + 8
REJECT: Final = OWN_C + 9

GYRO: Final = OWN  # 4
TILT: Final = OWN + 4  # 4
TURN: Final = OWN + 8  # 2
FORCE: Final = OWN + 10  # smoothed specific force in the drifting frame, y and w of each axis, 6
ROWS: Final = OWN + 16  # smoothed matrix of body to level, y and w, 18
BLURRED: Final = OWN + 34  # smoothed level part of the bias, y and w, 4
COV: Final = OWN + 38  # 6
WEIGHTS: Final = OWN + 44  # of the low-pass, with the step that they are for, 5
LOOKS: Final = OWN + 49  # specific forces since the start, for their mean until tau_acc is over
LOOKED: Final = OWN + 50  # for how long, s
ACC_AGE: Final = OWN + 51  # since the last specific force, s
MAG_AGE: Final = OWN + 52  # since the last field, s
FIRST_GAIN: Final = OWN + 53  # gain of the heading at the start: 1, 1/2, 1/3 … then 0
REJECTED: Final = OWN + 54  # for how long the field has been rejected, s
GATED: Final = OWN + 55  # for how long the horizon has been, s
MISSED: Final = OWN + 56  # angle that may have been missed since the rate was last known, rad
MISSED2: Final = OWN + 57  # square of what was missed before, rad²
LEANING: Final = OWN + 58  # mean level specific force, x and y, m/s², 2
QUIET: Final = OWN + 60  # since the averages began, s
ALARMED: Final = OWN + 61  # for how long a bias that has jumped is learned in haste, s
STOOD: Final = OWN + 62  # since the body was last seen to stand: its turn, if the rate is one, rad, 3;
STOOD_FOR: Final = OWN + 65  # the time, s; and then
STOOD_FORCE: Final = OWN + 66  # the mean specific force, m/s², 3,
STOOD_FIELD: Final = OWN + 69  # and the field, µT, 3
LATEST: Final = OWN + 72  # last field in body axes, µT, 3
RESTED: Final = OWN + 75  # for how long rest has shown the bias, s
REST: Final = OWN + 76
GRAVITY: Final = REST + REST_SIZE
FIELD: Final = GRAVITY + GRAVITY_SIZE
GUARD: Final = FIELD + FIELD_SIZE
STATE: Final = GUARD + GUARD_SIZE - OWN

FORGET: Final = 100.0  # a bias that is not seen is as uncertain as at the start after about this, s
FORGET_RATE: Final = dps(0.1)  # and drifts by this meanwhile, rad/s
BLIND_WEIGHT: Final = 1e-4  # weight of the assumption that the unseen part of the bias, about the vertical, is zero
REJECT_SLOW: Final = 2.0  # a field that is rejected for too long is followed, but so many times more slowly
GATE_BAND: Final = 0.08 * G0  # a smoothed specific force farther from g than this, m/s², is not gravity alone
GATE_FOR: Final = 15.0  # it is not followed for so long, s
REST_BAND: Final = dps(0.2)
"""A steady rate is rest where it is this near to the bias, rad/s, and three standard deviations, or"""
SEEN_TURN2: Final = deg(5.0) ** 2
"""where gravity and field stand, and a turn would have moved them by the root of this, rad²,"""
SEEN_SHARE2: Final = 0.05
"""and by the root of this of its angle, so that it is not one about gravity alone; or"""
PROVEN_REST: Final = 10.0
"""where it lasts longer than the rest that showed the bias, if that was shorter than this, s: a hand may turn so."""
FRESH: Final = 1.0  # a field is that of now for so long, s
LONGEST_LOOK: Final = 0.2
"""A specific force stands for this time before it at most, s: whether the unit rested while none came is not known."""
MISSED_LIMIT2: Final = deg(3.0) ** 2
"""Where the attitude may be off by more than the root of this, rad², it begins again."""
LEAN_AFTER: Final = 5.0  # a horizon that leans is not looked for within this of a new start, s
HASTE: Final = 0.05  # a bias that has jumped is learned with so much of the usual noise,
HASTE_FOR: Final = 30.0
"""for so long, s."""


BIAS_PRIOR: Final = "bias_start"  # parameter that is the standard deviation of the bias at the start


class Params(NamedTuple):
    """Settings; the defaults are the paper's, but for the largest bias."""

    tau_acc: Annotated[
        float, Spec(Quantity.TIME, "smoothing of the specific force; longer where accelerations last longer", 0.05, 600)
    ] = 3.0
    tau_mag: Annotated[
        float, Spec(Quantity.TIME, "time constant of the heading; longer where the field is disturbed", 0.05, 6000)
    ] = 9.0
    bias_start: Annotated[float, Spec(Quantity.RATE, "standard deviation of the bias at the start", 1e-6, 1)] = dps(0.5)
    bias_max: Annotated[float, Spec(Quantity.RATE, "largest bias", 1e-6, 1)] = dps(10.0)
    bias_moving: Annotated[
        float,
        Spec(Quantity.RATE, "standard deviation that the bias reaches in motion; smaller learns more slowly", 1e-7, 1),
    ] = dps(0.1)
    bias_resting: Annotated[float, Spec(Quantity.RATE, "standard deviation that the bias reaches at rest", 1e-7, 1)] = (
        dps(0.03)
    )
    rest_rate: RestRate = dps(2.0)
    rest_force: RestForce = 0.5
    rest_after: RestAfter = 1.5
    mag_reject: Annotated[
        float,
        Spec(
            Quantity.TIME, "longest time for which a disturbed field is not followed; 0: it is always followed", 0, 1e6
        ),
    ] = 60.0


def coefficients(params: Params) -> tuple[float, ...]:
    """Own coefficients of the kernel."""
    return tuple(params)


@kernel
def begin(c: Floats, x: Floats) -> None:
    """Take the attitude as it is, and start all averages again; the bias stays."""
    q0, q1, q2, q3 = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    if c[UP] < 0.0:  # the level frame has z up: half a turn about x
        q0, q1, q2, q3 = q1, -q0, q3, -q2
    x[GYRO], x[GYRO + 1], x[GYRO + 2], x[GYRO + 3] = q0, q1, q2, q3
    x[TILT], x[TILT + 1], x[TILT + 2], x[TILT + 3] = 1.0, 0.0, 0.0, 0.0
    x[TURN], x[TURN + 1] = 1.0, 0.0
    average_anew(c, x)


@kernel
def average_anew(c: Floats, x: Floats) -> None:
    """Follow the next specific force at once, then the mean, then the low-pass; and so the heading."""
    x[LOOKS], x[LOOKED], x[GATED], x[MISSED], x[MISSED2] = 0.0, 0.0, 0.0, 0.0, 0.0
    x[LEANING], x[LEANING + 1], x[QUIET] = 0.0, 0.0, 0.0
    x[FIRST_GAIN], x[REJECTED] = 1.0, c[REJECT]


@kernel
def reset_bias(x: Floats, sd: float) -> None:
    """Know the bias to a standard deviation, rad/s, and nothing better."""
    for k in range(6):
        x[COV + k] = 0.0
    x[COV], x[COV + 3], x[COV + 5] = sd * sd, sd * sd, sd * sd


@kernel
def turn(x: Floats, dt: float, gx: float, gy: float, gz: float) -> None:
    """Turn the body in the drifting frame."""
    e0, e1, e2, e3 = quat_exp(dt * (gx - x[BIAS]), dt * (gy - x[BIAS + 1]), dt * (gz - x[BIAS + 2]))  # [Laidig2023]
    q0, q1, q2, q3 = quat_mul(x[GYRO], x[GYRO + 1], x[GYRO + 2], x[GYRO + 3], e0, e1, e2, e3)
    x[GYRO], x[GYRO + 1], x[GYRO + 2], x[GYRO + 3] = quat_unit(q0, q1, q2, q3)


@kernel
def miss(x: Floats, missed: float) -> bool:
    """Count an angle that may have been missed, rad; returns whether all of it is too much.

    While the rate is not known, angles add up; those of one time and another are independent, and their squares do.
    """
    if missed > 0.0:
        x[MISSED] += missed
    elif x[MISSED] > 0.0:
        x[MISSED2] += x[MISSED] * x[MISSED]
        x[MISSED] = 0.0
    return bool(x[MISSED] * x[MISSED] + x[MISSED2] > MISSED_LIMIT2)


@kernel
def make_up(c: Floats, x: Floats, dt: float) -> None:
    """What was missed decays as the horizon is corrected."""
    if x[MISSED] + x[MISSED2] > 0.0:
        decay = math.exp(-dt / c[TAU_ACC])
        x[MISSED] *= decay
        x[MISSED2] *= decay * decay


@kernel
def average(x: Floats, place: int, first: bool, v: float) -> None:
    """Smooth one number: its mean at first, then the low-pass."""
    if first:
        x[place] += (v - x[place]) / x[LOOKS]
        x[place + 1] = 0.0
    else:
        x[place], x[place + 1] = smooth(
            x[WEIGHTS], x[WEIGHTS + 1], x[WEIGHTS + 2], x[WEIGHTS + 3], x[place], x[place + 1], v
        )


@kernel
def horizon(c: Floats, x: Floats, dt: float, first: bool, ax: float, ay: float, az: float) -> tuple[bool, float, float]:
    """Smooth the specific force and turn the drifting frame level; returns whether it did, and the turn about x and y.

    Where the smoothed specific force is not g, the tilt is not followed, for `GATE_FOR` at most.
    """
    fx, fy, fz = rotate(x[GYRO], x[GYRO + 1], x[GYRO + 2], x[GYRO + 3], ax, ay, az)
    average(x, FORCE, first, fx)  # [Laidig2023]: smoothed where the gyroscope keeps it still
    average(x, FORCE + 2, first, fy)
    average(x, FORCE + 4, first, fz)
    fx, fy, fz = x[FORCE], x[FORCE + 2], x[FORCE + 4]
    norm = math.sqrt(fx * fx + fy * fy + fz * fz)
    if not abs(norm - G0) <= GATE_BAND:  # departs from [Laidig2023]: what is not g is not followed for a while
        x[GATED] += dt
        if x[GATED] < GATE_FOR:
            return False, 0.0, 0.0
    else:
        x[GATED] = max(0.0, x[GATED] - dt)
    s = 1.0 / norm
    ex, ey, ez = rotate(x[TILT], x[TILT + 1], x[TILT + 2], x[TILT + 3], s * fx, s * fy, s * fz)
    u0, u1, u2, u3 = upright(1.0, ex, ey, ez)  # [Laidig2023]
    t0, t1, t2, t3 = quat_mul(u0, u1, u2, u3, x[TILT], x[TILT + 1], x[TILT + 2], x[TILT + 3])
    x[TILT], x[TILT + 1], x[TILT + 2], x[TILT + 3] = quat_unit(t0, t1, t2, t3)
    return True, ey, -ex


@kernel
def look(x: Floats, h0: float, h1: float, h2: float, residual: float, var: float, limit: float) -> None:
    """One Kalman update of the bias with a scalar that sees it along h."""
    p0 = x[COV] * h0 + x[COV + 1] * h1 + x[COV + 2] * h2
    p1 = x[COV + 1] * h0 + x[COV + 3] * h1 + x[COV + 4] * h2
    p2 = x[COV + 2] * h0 + x[COV + 4] * h1 + x[COV + 5] * h2
    s = 1.0 / (h0 * p0 + h1 * p1 + h2 * p2 + var)  # [Laidig2023]
    k0, k1, k2 = s * p0, s * p1, s * p2
    residual = min(max(residual, -limit), limit)
    x[BIAS] = min(max(x[BIAS] + k0 * residual, -limit), limit)
    x[BIAS + 1] = min(max(x[BIAS + 1] + k1 * residual, -limit), limit)
    x[BIAS + 2] = min(max(x[BIAS + 2] + k2 * residual, -limit), limit)
    x[COV] -= k0 * p0
    x[COV + 1] -= k0 * p1
    x[COV + 2] -= k0 * p2
    x[COV + 3] -= k1 * p1
    x[COV + 4] -= k1 * p2
    x[COV + 5] -= k2 * p2


@kernel
def drift(c: Floats, x: Floats, dt: float) -> float:
    """Let the bias grow uncertain again, up to its start, at once after a jump; returns by how much it should."""
    grown = FORGET_RATE * FORGET_RATE * dt / FORGET
    most = c[BIAS_START] * c[BIAS_START]
    for k in (0, 3, 5):
        if x[ALARMED] > 0.0:
            x[COV + k] = max(x[COV + k], most)
        elif x[COV + k] < most:
            x[COV + k] += grown
    return grown


@kernel
def learn_resting(c: Floats, x: Floats, grown: float) -> None:
    """At rest the mean rate is the bias."""
    level = c[BIAS_RESTING] * c[BIAS_RESTING]
    var = level * level / grown + level  # [Laidig2023]: with it, P settles at the wanted level
    mx, my, mz = mean_rate(x, REST)
    limit = c[BIAS_MAX]
    look(x, 1.0, 0.0, 0.0, mx - x[BIAS], var, limit)
    look(x, 0.0, 1.0, 0.0, my - x[BIAS + 1], var, limit)
    look(x, 0.0, 0.0, 1.0, mz - x[BIAS + 2], var, limit)


@kernel
def like(d: float, var: float) -> bool:
    """True where two rates differ by no more than the band and three standard deviations."""
    beyond = abs(d) - REST_BAND
    return not (beyond > 0.0 and beyond * beyond > 9.0 * var)


@kernel
def stand(x: Floats) -> None:
    """Keep gravity and the field as they are now, to see whether they turn."""
    x[STOOD], x[STOOD + 1], x[STOOD + 2], x[STOOD_FOR] = 0.0, 0.0, 0.0, 0.0
    x[STOOD_FORCE], x[STOOD_FORCE + 1], x[STOOD_FORCE + 2] = mean_force(x, REST)
    fresh = 1.0 if x[MAG_AGE] < FRESH else 0.0
    for k in range(3):
        x[STOOD_FIELD + k] = fresh * x[LATEST + k]


@kernel
def seen_turn(x: Floats, then: int, nx: float, ny: float, nz: float) -> tuple[float, float]:
    """Square of the angle, rad², by which a turn would have moved a vector that is now n, and how much of it is seen.

    A vector u that stands in space moves by u × φ in body axes while they turn by φ.
    """
    ux, uy, uz = x[then], x[then + 1], x[then + 2]
    size2 = ux * ux + uy * uy + uz * uz
    if not size2 > 0.0:
        return 0.0, 0.0
    vx, vy, vz = cross(ux, uy, uz, x[STOOD], x[STOOD + 1], x[STOOD + 2])
    expected2 = vx * vx + vy * vy + vz * vz
    return expected2 / size2, (vx * (nx - ux) + vy * (ny - uy) + vz * (nz - uz)) / size2


@kernel
def rests(c: Floats, x: Floats, dt: float) -> int:
    """Flags of a steady rate: of rest, or none where it may be a slow turn.

    A rate that is not like the bias may be a bias that has jumped. If gravity and the field would have turned by
    enough, they show it. A turn about gravity, without a field, is not seen: the bias stays, unless it was learned in
    a short rest, for that may have been a slow turn itself.
    """
    mx, my, mz = mean_rate(x, REST)
    ex, ey, ez = mx - x[BIAS], my - x[BIAS + 1], mz - x[BIAS + 2]
    if like(ex, x[COV]) and like(ey, x[COV + 3]) and like(ez, x[COV + 5]):
        stand(x)
        x[RESTED] += dt
        return flags.AT_REST
    x[STOOD] += dt * ex
    x[STOOD + 1] += dt * ey
    x[STOOD + 2] += dt * ez
    x[STOOD_FOR] += dt
    fx, fy, fz = mean_force(x, REST)
    expected2, part = seen_turn(x, STOOD_FORCE, fx, fy, fz)
    if x[MAG_AGE] < FRESH:
        w, p = seen_turn(x, STOOD_FIELD, x[LATEST], x[LATEST + 1], x[LATEST + 2])
        expected2, part = expected2 + w, part + p
    turn2 = x[STOOD] * x[STOOD] + x[STOOD + 1] * x[STOOD + 1] + x[STOOD + 2] * x[STOOD + 2]
    if expected2 > max(SEEN_TURN2, SEEN_SHARE2 * turn2):
        if part > 0.5 * expected2:
            stand(x)
            return 0
        reset_bias(x, JUMP_SD)
        x[RESTED] = 0.0
        return flags.AT_REST | flags.INCONSISTENT
    var = c[BIAS_START] * c[BIAS_START]
    if 0.0 < x[RESTED] < min(x[STOOD_FOR], PROVEN_REST) and like(mx, var) and like(my, var) and like(mz, var):
        reset_bias(x, c[BIAS_START])
        x[RESTED] = 0.0
        return flags.AT_REST
    return 0


@kernel
def seen_along(x: Floats, row: int, y: float) -> tuple[float, float, float, float]:
    """Direction in which a row of the smoothed matrix sees the bias, and what is left of y."""
    h0, h1, h2 = x[ROWS + 6 * row], x[ROWS + 6 * row + 2], x[ROWS + 6 * row + 4]
    return h0, h1, h2, y - h0 * x[BIAS] - h1 * x[BIAS + 1] - h2 * x[BIAS + 2]


@kernel
def learn_moving(c: Floats, x: Floats, dt: float, grown: float, vx: float, vy: float) -> None:
    """In motion, what is left of the bias calls for turns v of the horizon, rad."""
    level = c[BIAS_MOVING] * c[BIAS_MOVING]
    var = level * level / grown + level  # [Laidig2023]
    if x[ALARMED] > 0.0:
        var *= HASTE
        x[ALARMED] -= dt
    limit = c[BIAS_MAX]
    yy = x[BLURRED + 2] - vy / dt
    h0, h1, h2, rx = seen_along(x, 0, x[BLURRED] - vx / dt)
    _, _, _, ry = seen_along(x, 1, yy)
    length2, cut = rx * rx + ry * ry, 0.0
    if length2 > limit * limit:
        cut = 1.0 - limit / math.sqrt(length2)  # departs from [Laidig2023]: one for both, not axis by axis
    look(x, h0, h1, h2, rx - cut * rx, var, limit)
    h0, h1, h2, residual = seen_along(x, 1, yy - cut * ry)
    look(x, h0, h1, h2, residual, var, limit)
    h0, h1, h2, rz = seen_along(x, 2, 0.0)
    look(x, h0, h1, h2, rz, var / BLIND_WEIGHT, limit)  # [Laidig2023]


@kernel
def blur(x: Floats, first: bool) -> None:
    """Smooth the matrix of body to level, and the bias seen through it, as the specific force is smoothed."""
    q0, q1, q2, q3 = quat_mul(
        x[TILT], x[TILT + 1], x[TILT + 2], x[TILT + 3], x[GYRO], x[GYRO + 1], x[GYRO + 2], x[GYRO + 3]
    )
    b0, b1, b2 = x[BIAS], x[BIAS + 1], x[BIAS + 2]
    bx, by, _ = rotate(q0, q1, q2, q3, b0, b1, b2)
    average(x, BLURRED, first, bx)
    average(x, BLURRED + 2, first, by)
    for column in range(3):
        vx, vy, vz = rotate(
            q0, q1, q2, q3, 1.0 if column == 0 else 0.0, 1.0 if column == 1 else 0.0, 1.0 if column == 2 else 0.0
        )
        average(x, ROWS + 2 * column, first, vx)
        average(x, ROWS + 6 + 2 * column, first, vy)
        average(x, ROWS + 12 + 2 * column, first, vz)


@kernel
def heading(c: Floats, x: Floats, dt: float, turning: float, hx: float, hy: float, v: float) -> int:
    """Turn towards north, given the level and the vertical part of the field in the level frame."""
    cos, sin = x[TURN], x[TURN + 1]
    cos2, sin2 = cos * cos - sin * sin, 2.0 * cos * sin
    hx, hy = cos2 * hx - sin2 * hy, sin2 * hx + cos2 * hy
    if not has_heading(hx, hy, v):
        return flags.MAG_GATED
    bad = disturbed(x, FIELD, min(dt, 1.0), turning, math.sqrt(hx * hx + hy * hy), v)
    error = angle_to(hx, hy, c[NORTH_X], c[UP] * c[NORTH_Y])
    gain = 1.0 - math.exp(-dt / c[TAU_MAG])  # [Laidig2023]
    word = 0
    if bad and c[REJECT] > 0.0 and x[FIRST_GAIN] == 0.0:
        word = flags.MAG_GATED
        if x[REJECTED] < c[REJECT]:
            x[REJECTED] += dt
            return word
        gain /= REJECT_SLOW
    elif not bad:
        x[REJECTED] = max(0.0, x[REJECTED] - REJECT_SLOW * dt)
    if x[FIRST_GAIN] > gain:
        gain = x[FIRST_GAIN]
        x[FIRST_GAIN] = gain / (gain + 1.0)  # [Laidig2023]
    else:
        x[FIRST_GAIN] = 0.0
    w, _, _, z = quat_exp(0.0, 0.0, gain * error)
    cos, sin = w * cos - z * sin, w * sin + z * cos
    s = 1.5 - 0.5 * (cos * cos + sin * sin)  # norm 1 to the last bits, so that a long run keeps it
    x[TURN], x[TURN + 1] = s * cos, s * sin
    return word


@kernel
def leans(x: Floats, dt: float, ax: float, ay: float, az: float) -> bool:
    """True where the specific force, which is gravity alone, stands askew in the level frame; not soon again."""
    fx, fy, fz = rotate(x[GYRO], x[GYRO + 1], x[GYRO + 2], x[GYRO + 3], ax, ay, az)
    fx, fy, _ = rotate(x[TILT], x[TILT + 1], x[TILT + 2], x[TILT + 3], fx, fy, fz)
    gain = dt / (dt + LEAN_TAU)
    x[LEANING] += gain * (fx - x[LEANING])
    x[LEANING + 1] += gain * (fy - x[LEANING + 1])
    x[QUIET] += dt
    lean2 = x[LEANING] * x[LEANING] + x[LEANING + 1] * x[LEANING + 1]
    return bool(x[QUIET] > LEAN_AFTER and lean2 > LEAN * LEAN)


@kernel
def follow_gravity(
    c: Floats, x: Floats, held: bool, gx: float, gy: float, gz: float, ax: float, ay: float, az: float
) -> int:
    """Turn level, and learn the bias; the rate is only looked at for rest, and not where it was held for long."""
    dt, x[ACC_AGE] = min(x[ACC_AGE], LONGEST_LOOK), 0.0
    if held:
        gx = math.nan
    word = 0
    if at_rest(x, REST, dt, c[REST_RATE], c[REST_FORCE], c[BIAS_MAX], c[REST_AFTER], gx, gy, gz, ax, ay, az):
        word = rests(c, x, dt)
    else:
        stand(x)
    kept_weights(x, WEIGHTS, dt, c[TAU_ACC])
    if only_gravity(x, GRAVITY, dt, ax, ay, az) and not held and leans(x, dt, ax, ay, az):
        average_anew(c, x)
        reset_bias(x, JUMP_SD)
        x[ALARMED] = HASTE_FOR
        word |= flags.INCONSISTENT
    first = x[LOOKED] < c[TAU_ACC]
    x[LOOKS] += 1.0
    x[LOOKED] += dt
    followed, vx, vy = horizon(c, x, dt, first, ax, ay, az)
    blur(x, first)
    if not followed:
        return word & flags.INCONSISTENT | flags.ACC_GATED
    make_up(c, x, dt)
    if dt == 0.0 or x[LOOKS] == 1.0:
        return word
    grown = drift(c, x, dt)
    if word & flags.AT_REST:
        learn_resting(c, x, grown)
    else:
        learn_moving(c, x, dt, grown, vx, vy)
    return word


@kernel
def compose(c: Floats, x: Floats, q0: float, q1: float, q2: float, q3: float) -> None:
    """Attitude in the navigation frame from that in the level frame, q."""
    cos, sin = x[TURN], x[TURN + 1]
    q0, q1, q2, q3 = quat_mul(cos, 0.0, 0.0, sin, q0, q1, q2, q3)  # [Laidig2023]
    if c[UP] < 0.0:
        q0, q1, q2, q3 = -q1, q0, -q3, q2
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = q0, q1, q2, q3


@kernel
def start(c: Floats, x: Floats, ax: float, ay: float, az: float, mx: float, my: float, mz: float) -> int:
    """Begin with the first specific force that may be gravity, or with an attitude that was given."""
    if x[STAGE] == HEADED:
        begin(c, x)
        x[FIRST_GAIN] = 0.0
        return 0
    if x[STAGE] < LEVEL and not may_be_gravity(ax, ay, az):
        return flags.NOT_CONVERGED | flags.HEADING_FREE
    word = initialise(c, x, ax, ay, az, mx, my, mz)
    begin(c, x)
    return word


@kernel
def step(
    c: Floats, x: Floats, dt: float, flags_in: int,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float, mx: float, my: float, mz: float,
) -> int:  # fmt: skip
    """Take one sample."""
    word, dt, gx, gy, gz, missed = admit_rate(c, x, GUARD, dt, flags_in, gx, gy, gz)
    ax, ay, az = trusted(x, 1, flags_in, flags.ACC_STUCK | flags.ACC_CLIPPED, ax, ay, az)
    mx, my, mz = trusted(x, 2, flags_in, flags.MAG_STUCK | flags.MAG_CLIPPED, mx, my, mz)
    if x[COUNT] == 1.0:
        reset_bias(x, c[BIAS_START])
        begin(c, x)  # so that there is an attitude, if not a true one, until gravity is seen
    if x[COUNT] == 1.0 or x[STAGE] == BLIND:
        word |= start(c, x, ax, ay, az, mx, my, mz)
    turn(x, dt, gx, gy, gz)
    if miss(x, missed):
        word |= flags.NOT_CONVERGED
        if may_be_gravity(ax, ay, az):
            average_anew(c, x)
    x[ACC_AGE] += dt
    x[MAG_AGE] += dt
    if x[STAGE] >= LEVEL and usable(ax, ay, az):
        held = word & flags.GYR_HELD != 0 and not 0.0 < x[HELD] <= HOLD  # one that is missing for a moment goes on
        word |= follow_gravity(c, x, held, gx, gy, gz, ax, ay, az)
    else:
        word |= refused(flags.ACC_GATED, ax, ay, az)
    q0, q1, q2, q3 = quat_mul(
        x[TILT], x[TILT + 1], x[TILT + 2], x[TILT + 3], x[GYRO], x[GYRO + 1], x[GYRO + 2], x[GYRO + 3]
    )
    if x[STAGE] >= LEVEL and usable(mx, my, mz):
        hx, hy, hz = rotate(q0, q1, q2, q3, mx, my, mz)
        word |= heading(c, x, x[MAG_AGE], mean_speed(x, REST), hx, hy, hz)
        x[MAG_AGE], x[LATEST], x[LATEST + 1], x[LATEST + 2] = 0.0, mx, my, mz
    else:
        word |= refused(flags.MAG_GATED, mx, my, mz)
    if x[STAGE] < HEADED:
        word |= flags.HEADING_FREE
    compose(c, x, q0, q1, q2, q3)
    return word
