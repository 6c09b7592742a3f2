"""Multiplicative extended Kalman filter with a consistent covariance: attitude, gyroscope bias, level velocity.

The attitude error is a small rotation in the *navigation* frame, ``q_true = exp(θ) ⊗ q``, [Sola2017] sec. 7. There
gravity and north are constant, so each measurement sees fixed states, is a scalar, and nothing is inverted.

A body that stays about where it is cannot keep an acceleration: its velocity is bounded. So the level specific force is
integrated to a velocity, and the one measurement of the tilt is that this velocity is zero, but for the speed that the
body has. A wrong tilt makes the velocity run away at once; a wave, a step or a stroke does not. This is how vertical
reference units at sea are aided. The speed is learned from how the velocity varies (adaptive noise), and `speed_lasts`
says how long it lasts, so that the claim does not depend on the rate and holds in motion.

The field gives the heading alone: a disturbance never tips the horizon, though what is uncertain in the tilt is counted
in the heading (a consider update). At rest the rate is the bias: a zero-rate update, with the noise that it shares with
the integration accounted for.

When to choose it: where the uncertainty matters as much as the attitude: to fuse on, to gate, to know when a result is
good enough; at sea; and where noise figures of the sensor are known (`NoiseCard`). A vehicle that keeps accelerating or
turning has no bounded velocity: give it a larger speed_lasts, or choose another filter.

=======  ===============  ==============  ====================================================
symbol   name             unit            meaning
=======  ===============  ==============  ====================================================
q        x[Q]             1               attitude q_nb
b        x[BIAS]          rad/s           gyroscope bias
v        x[ERROR + V]     m/s             level velocity, navigation x and y
P        x[COV]           mixed           covariance of (θ, b, v), 8 × 8 row by row, upper half
=======  ===============  ==============  ====================================================

Departures from [Sola2017]: the reset after a correction is of first order in θ (its Jacobian is taken as the identity);
measurements are the level velocity and the heading, not whole vectors. Not an invariant filter: the bias is in body
axes.
"""

import math
from typing import TYPE_CHECKING, Annotated, Final, NamedTuple

import numpy as np

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.kernels import kernel
from plumbob.core.params import Spec
from plumbob.core.units import Quantity, deg, dps
from plumbob.filters.field import FIELD_SIZE, disturbed, has_ref, unlike2
from plumbob.filters.input_checks import (
    GRAVITY_SIZE,
    GUARD_SIZE,
    JUMP_SD,
    LEAN,
    LEAN_TAU,
    admit_rate,
    keeps_accelerating,
    may_be_gravity,
    only_gravity,
    refused,
    trusted,
    usable,
)
from plumbob.filters.integrate import turn
from plumbob.filters.layout import BIAS, COUNT, HEADED, LEVEL, NORTH_X, NORTH_Y, OWN, OWN_C, STAGE, UP, Q
from plumbob.filters.settling import REST_SIZE, RestAfter, RestForce, RestRate, at_rest, mean_speed
from plumbob.filters.start import angle_to, has_heading, initialise, upright
from plumbob.rotations.kernels import Vec, cross, quat_exp, quat_mul, quat_unit, rotate, rows

if TYPE_CHECKING:
    from plumbob.data.cards import NoiseCard

SUMMARY: Final = "multiplicative EKF: attitude, bias and bounded velocity, with a consistent covariance; gates, rest"
REFERENCES: Final = ("Sola2017",)
NEEDS: Final = ("gyr", "acc")

N: Final = 8
TH: Final = 0  # first place of each error in (θ, b, v)
B: Final = 3
V: Final = 6

GYR_VAR: Final = OWN_C  # (rad/s)²/Hz
WALK_VAR: Final = OWN_C + 1  # (rad/s²)²/Hz
SCALE_VAR: Final = OWN_C + 2  # rad²/s per (rad/s)²
BIAS_START: Final = OWN_C + 3
ACC_VAR: Final = OWN_C + 4  # (m/s²)²/Hz
SPEED_VAR: Final = OWN_C + 5  # (m/s)²
SPEED_LASTS: Final = OWN_C + 6
MAG_VAR: Final = OWN_C + 7  # µT²/Hz
BEND_VAR: Final = OWN_C + 8  # rad²
REST_RATE: Final = OWN_C + 9
REST_FORCE: Final = OWN_C + 10
REST_AFTER: Final = OWN_C + 11
REJECT: Final = OWN_C + 12
BEND_LASTS: Final = OWN_C + 13  # twice the time that a disturbance lasts, s

COV: Final = OWN  # 64, of which the upper half is used
HEADING: Final = 2 * N + 2  # place of the heading's variance among them
ERROR: Final = OWN + 64  # what a step's measurements have found: θ, then b and v themselves, 8
COLUMN: Final = OWN + 72  # P Hᵀ of a measurement, 8
MEAN: Final = OWN + 80  # slow mean of the velocity, x and y, m/s, 2
SPEED2: Final = OWN + 82  # learned variance of the velocity, (m/s)²
ACC_AGE: Final = OWN + 83  # since the last specific force, s
MAG_AGE: Final = OWN + 84  # since the last field, s
REJECTED: Final = OWN + 85  # for how long the field has been rejected, s
GATED: Final = OWN + 86  # for how long the velocity has been beyond the gate, s
FORCE: Final = OWN + 87  # mean specific force in navigation axes, m/s², 3
STEP_TURN: Final = OWN + 90  # what a rate's error does to the attitude's in this step, row by row, 9
SINCE: Final = OWN + 99  # since the velocity was last called back, s
NIS: Final = OWN + 100  # last squared innovations over their variances, of the velocity and the heading, 2
FIELDS: Final = OWN + 102  # fields since the last look: how many, and their sum in navigation axes, µT, 4
REST: Final = OWN + 106
GRAVITY: Final = REST + REST_SIZE
FIELD: Final = GRAVITY + GRAVITY_SIZE
GUARD: Final = FIELD + FIELD_SIZE
STATE: Final = GUARD + GUARD_SIZE - OWN

COVARIANCE: Final = slice(COV, COV + 3 * N)

HUBER: Final = 9.0  # an innovation beyond this many variances counts with the noise that would make it so many
HUBER_INVERSE: Final = 1.0 / HUBER
GATE: Final = 25.0  # beyond this many the sample is flagged as gated
OFTEN: Final = 0.025  # corrections are slow: none is made twice within this, s; it would cost time and tell nothing
MEAN_TAU: Final = 3.0
"""The velocity is taken about its mean over this, s: a wrong tilt moves the mean, the body's motion the rest;"""
SPEED_TAU: Final = 3.0
"""and its variance is learned over this, s."""
GATE_FOR: Final = 1.0  # a velocity that has been beyond the gate for so long, s, begins anew
START_TILT: Final = deg(5.0)  # standard deviation of the first tilt, rad: an acceleration of 0.09 g
START_HEADING: Final = deg(5.0)  # and of the first heading
START_SPEED: Final = 0.3  # speed that is expected at the start, m/s; what it is, is learned
LOST: Final = deg(8.0) ** 2
"""With a larger variance of the tilt, rad², the linear update is no good: it is taken up anew."""
DOUBTFUL: Final = deg(6.0) ** 2  # with a larger variance of the tilt, rad², the attitude is not converged
FREE: Final = 3.0  # no heading is more uncertain than this, rad²
REST_BIAS: Final = dps(5.0)  # a mean rate beyond this, rad/s, is no bias, and the unit not at rest
REST_BAND: Final = dps(0.2)
"""Nor is it if it differs from the bias by more than this, rad/s, and three standard deviations."""
SHORTEST: Final = 1e-6  # a measurement at no distance in time counts as one at this, s


BIAS_PRIOR: Final = "bias_start"  # parameter that is the standard deviation of the bias at the start


class Params(NamedTuple):
    """Noise of the sensors, and how the body and its surroundings behave; all independent of the rate."""

    gyr_noise: Annotated[float, Spec(Quantity.RATE_NOISE, "white noise of the gyroscope", 1e-9, 1)] = dps(0.01)
    gyr_walk: Annotated[float, Spec(Quantity.RATE_WALK, "random walk of its bias", 0, 1)] = dps(0.003)
    gyr_scale: Annotated[
        float, Spec(Quantity.RATIO, "uncertainty of its scale and alignment, as a share of the rate", 0, 0.5)
    ] = 0.003
    bias_start: Annotated[float, Spec(Quantity.RATE, "standard deviation of its bias at the start", 1e-9, 1)] = dps(0.5)
    acc_noise: Annotated[float, Spec(Quantity.ACCELERATION_NOISE, "white noise of the accelerometer", 1e-6, 10)] = 0.003
    speed: Annotated[
        float, Spec(Quantity.SPEED, "least level speed that is always expected; more is learned", 1e-3, 1e3)
    ] = 0.05
    speed_lasts: Annotated[float, Spec(Quantity.TIME, "for how long a speed lasts before it turns back", 1e-3, 600)] = (
        0.3
    )
    mag_noise: Annotated[float, Spec(Quantity.FIELD, "white noise of the magnetometer, µT/√Hz", 1e-4, 100)] = 0.1
    mag_bend: Annotated[
        float, Spec(Quantity.ANGLE, "how far the field's direction is off where its size and dip are right", 0, 2)
    ] = deg(2.0)
    mag_lasts: Annotated[float, Spec(Quantity.TIME, "for how long a disturbance of the field lasts", 1e-3, 6000)] = 5.0
    rest_rate: RestRate = dps(2.0)
    rest_force: RestForce = 0.5
    rest_after: RestAfter = 1.5
    mag_reject: Annotated[
        float, Spec(Quantity.TIME, "longest time for which a disturbed field is not used; 0: it is always used", 0, 1e6)
    ] = 60.0


def coefficients(params: Params) -> tuple[float, ...]:
    """Own coefficients of the kernel."""
    p = params
    return (
        p.gyr_noise**2, p.gyr_walk**2, p.gyr_scale**2, p.bias_start, p.acc_noise**2, p.speed**2, p.speed_lasts,
        p.mag_noise**2, p.mag_bend**2, p.rest_rate, p.rest_force, p.rest_after, p.mag_reject, 2.0 * p.mag_lasts,
    )  # fmt: skip


def from_noise(card: "NoiseCard") -> dict[str, float]:
    """Noise parameters from a card: root mean squares over the axes; what it does not hold keeps its default."""
    params = {}
    for name, noise in (("gyr", card.gyr), ("acc", card.acc), ("mag", card.mag)):
        if noise is not None:
            params[f"{name}_noise"] = noise.n_rms
    if card.gyr is not None:
        params["gyr_walk"] = card.gyr.k_rms
    return {name: value for name, value in params.items() if value > 0.0}


def covariance(q_nb: Floats, entries: Floats) -> Floats:
    """Covariance of the attitude error in body axes, (N, 3, 3), rad², from the first three rows of P, (N, 24)."""
    from plumbob.rotations import dcm_from_quat

    upper = np.triu(entries.reshape(-1, 3, N)[:, :, :3])
    in_n = upper + np.swapaxes(np.triu(upper, 1), 1, 2)
    c_nb = dcm_from_quat(q_nb)
    turned: Floats = np.swapaxes(c_nb, 1, 2) @ in_n @ c_nb
    return turned


@kernel
def know(x: Floats, i: int, sd: float) -> None:
    """Know one error to a standard deviation, uncorrelated with the others."""
    for j in range(N):
        x[COV + N * min(i, j) + max(i, j)] = 0.0
    x[COV + (N + 1) * i] = sd * sd


@kernel
def know_tilt(x: Floats, sd: float) -> None:
    """Know both tilts, rad, and that the body stands."""
    know(x, TH, sd)
    know(x, TH + 1, sd)
    stop(x)
    x[FIELDS], x[FIELDS + 1], x[FIELDS + 2], x[FIELDS + 3] = 0.0, 0.0, 0.0, 0.0  # seen with the old tilt


@kernel
def know_heading(x: Floats, lean_x: float, lean_y: float) -> None:
    """Know the heading from one field: it has the tilt's error in it, as the field leans."""
    for k in (0, 1, 3, 4, 5, 6, 7):
        x[COV + N * min(2, k) + max(2, k)] = -lean_x * pair(x, 0, k) - lean_y * pair(x, 1, k)
    x[COV + HEADING] = START_HEADING * START_HEADING - lean_x * pair(x, 0, 2) - lean_y * pair(x, 1, 2)


@kernel
def know_bias(x: Floats, sd: float) -> None:
    """Know the bias, rad/s."""
    for i in range(B, B + 3):
        know(x, i, sd)


@kernel
def pair(x: Floats, i: int, j: int) -> float:
    """Entry i, j of P."""
    entry: float = x[COV + N * min(i, j) + max(i, j)]
    return entry


@kernel
def carry(x: Floats) -> None:
    """P ← F P Fᵀ of θ ← θ − D δb, with D in x[STEP_TURN]."""
    for i in range(3):
        d0, d1, d2 = x[STEP_TURN + 3 * i], x[STEP_TURN + 3 * i + 1], x[STEP_TURN + 3 * i + 2]
        for j in range(i, 3):
            row = COV + N * j + B
            x[COV + N * i + j] -= d0 * x[row] + d1 * x[row + 1] + d2 * x[row + 2]
    for i in range(3):
        d0, d1, d2 = x[STEP_TURN + 3 * i], x[STEP_TURN + 3 * i + 1], x[STEP_TURN + 3 * i + 2]
        for j in range(B, N):
            x[COV + N * i + j] -= d0 * pair(x, B, j) + d1 * pair(x, B + 1, j) + d2 * pair(x, B + 2, j)
    for j in range(3):
        d0, d1, d2 = x[STEP_TURN + 3 * j], x[STEP_TURN + 3 * j + 1], x[STEP_TURN + 3 * j + 2]
        for i in range(j + 1):
            row = COV + N * i + B
            x[COV + N * i + j] -= d0 * x[row] + d1 * x[row + 1] + d2 * x[row + 2]


@kernel
def push(x: Floats, p: float) -> None:
    """P ← F P Fᵀ of v ← v + p (θ_y, −θ_x): a wrong tilt takes gravity for an acceleration."""
    vx, vy = COV + V, COV + V + 1  # columns of v in row 0
    x[vx + N * V] += p * (2.0 * x[vx + N] + p * x[COV + N + 1])
    x[vy + N * V] += p * (x[vy + N] - x[vx] - p * x[COV + 1])
    x[vy + N * V + N] += p * (p * x[COV] - 2.0 * x[vy])
    for k in range(V):
        x[vx + N * k] += p * pair(x, 1, k)
        x[vy + N * k] -= p * pair(x, 0, k)


@kernel
def spread(x: Floats, missed: float) -> None:
    """Add an angle that may have been missed to the standard deviation of the attitude; both tilts alike."""
    tilt = 2.0 * missed * math.sqrt(0.5 * (x[COV] + x[COV + N + 1])) + missed * missed
    x[COV] += tilt
    x[COV + N + 1] += tilt
    x[COV + HEADING] += 2.0 * missed * math.sqrt(x[COV + HEADING]) + missed * missed


_SIXTH: Final = 1.0 / 6.0


@kernel
def effect(dt: float, ux: float, uy: float, uz: float, rx: float, ry: float, rz: float) -> Vec:
    """Row r of Δt R J(u), with u the turn of the step and J the right Jacobian of so(3), to second order in u."""
    ax, ay, az = cross(rx, ry, rz, ux, uy, uz)
    bx, by, bz = cross(ax, ay, az, ux, uy, uz)
    return (
        dt * (rx - 0.5 * ax + _SIXTH * bx),  # [Sola2017] (192): r [u]× = r × u
        dt * (ry - 0.5 * ay + _SIXTH * by),
        dt * (rz - 0.5 * az + _SIXTH * bz),
    )


@kernel
def predict(
    c: Floats, x: Floats, dt: float, missed: float, gx: float, gy: float, gz: float,
    r00: float, r01: float, r02: float, r10: float, r11: float, r12: float, r20: float, r21: float, r22: float,
) -> None:  # fmt: skip
    """Covariance of attitude and bias over a step at whose end the attitude is R."""
    ux, uy, uz = dt * (gx - x[BIAS]), dt * (gy - x[BIAS + 1]), dt * (gz - x[BIAS + 2])
    x[STEP_TURN], x[STEP_TURN + 1], x[STEP_TURN + 2] = effect(dt, ux, uy, uz, r00, r01, r02)
    x[STEP_TURN + 3], x[STEP_TURN + 4], x[STEP_TURN + 5] = effect(dt, ux, uy, uz, r10, r11, r12)
    x[STEP_TURN + 6], x[STEP_TURN + 7], x[STEP_TURN + 8] = effect(dt, ux, uy, uz, r20, r21, r22)
    carry(x)
    noise = dt * (c[GYR_VAR] + c[SCALE_VAR] * (gx * gx + gy * gy + gz * gz))
    for i in range(3):
        x[COV + (N + 1) * i] += noise
        x[COV + (N + 1) * (B + i)] += c[WALK_VAR] * dt
    if missed > 0.0:
        spread(x, missed)
    x[COV + HEADING] = min(x[COV + HEADING], FREE)


@kernel
def update(x: Floats, residual: float, s: float) -> None:
    """State and covariance by the column P Hᵀ and the innovation's variance s."""
    inverse = 1.0 / s  # [BarShalom2001] sec. 5.2.3
    for i in range(N):
        gain = inverse * x[COLUMN + i]
        x[ERROR + i] += gain * residual
        for j in range(i, N):
            x[COV + N * i + j] -= gain * x[COLUMN + j]


@kernel
def stand_still(x: Floats, axis: int, var: float) -> None:
    """The velocity along a navigation axis is zero, but for the variance."""
    for k in range(N):
        x[COLUMN + k] = pair(x, V + axis, k)
    update(x, -x[ERROR + V + axis], x[COLUMN + V + axis] + var)


@kernel
def point_north(x: Floats, lean_x: float, lean_y: float, angle: float, var: float) -> float:
    """Heading angle that a field shows through a tilt; it corrects heading and bias. Returns its squared innovation.

    Tilt and velocity are only considered: their entries of P among themselves stay, as Joseph's form with a gain of
    zero for them leaves them.
    """
    for k in range(N):
        x[COLUMN + k] = lean_x * pair(x, 0, k) + lean_y * pair(x, 1, k) + pair(x, 2, k)
    s = lean_x * x[COLUMN] + lean_y * x[COLUMN + 1] + x[COLUMN + 2] + var
    residual = angle - lean_x * x[ERROR] - lean_y * x[ERROR + 1] - x[ERROR + 2]
    nis: float = residual * residual / s
    x[NIS + 1] = nis
    inverse = 1.0 / max(s, residual * residual * HUBER_INVERSE)
    for i in range(TH + 2, V):  # [Schmidt1966]: tilt and velocity are considered
        gain = inverse * x[COLUMN + i]
        x[ERROR + i] += gain * residual
        for j in range(i, N):
            x[COV + N * i + j] -= gain * x[COLUMN + j]
        x[COV + i] -= gain * x[COLUMN]
        x[COV + N + i] -= gain * x[COLUMN + 1]
    return nis


@kernel
def zero_rate(x: Floats, axis: int, rate: float, noise: float, dt: float, r0: float, r1: float, r2: float) -> None:
    """At rest a rate is bias and noise, the same noise that this step's turn has; r is the axis in navigation."""
    for k in range(N):
        x[COLUMN + k] = pair(x, B + axis, k)
    x[COLUMN] -= noise * r0
    x[COLUMN + 1] -= noise * r1
    x[COLUMN + 2] -= noise * r2
    residual = rate - x[ERROR + B + axis]
    update(x, residual, max(x[COLUMN + B + axis] + noise / dt, residual * residual * HUBER_INVERSE))


@kernel
def may_be_bias(x: Floats) -> bool:
    """True where the mean rate is near the bias, for what is known of it; a slow turn is not."""
    for k in range(3):
        beyond = abs(x[REST + 2 * k] - x[BIAS + k]) - REST_BAND
        if beyond > 0.0 and beyond * beyond > HUBER * x[COV + (N + 1) * (B + k)]:
            return False
    return True


@kernel
def inject(x: Floats) -> None:
    """Move the errors that were found into attitude and bias."""
    e0, e1, e2, e3 = quat_exp(x[ERROR], x[ERROR + 1], x[ERROR + 2])  # [Sola2017] sec. 7
    q0, q1, q2, q3 = quat_mul(e0, e1, e2, e3, x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = quat_unit(q0, q1, q2, q3)
    # departs from [Sola2017]: the Jacobian of the reset is the identity
    x[ERROR], x[ERROR + 1], x[ERROR + 2] = 0.0, 0.0, 0.0
    x[BIAS], x[BIAS + 1], x[BIAS + 2] = x[ERROR + 3], x[ERROR + 4], x[ERROR + 5]


@kernel
def learn_speed(x: Floats, dt: float) -> None:
    """Learn how fast the body moves, from the velocity about its mean, so that a wrong tilt does not pass for speed."""
    slow, gain = dt / (dt + MEAN_TAU), dt / (dt + SPEED_TAU)
    dx, dy = x[ERROR + V] - x[MEAN], x[ERROR + V + 1] - x[MEAN + 1]
    x[MEAN] += slow * dx
    x[MEAN + 1] += slow * dy
    x[SPEED2] += gain * (0.5 * (dx * dx + dy * dy) - x[SPEED2])


@kernel
def call_back(x: Floats, density: float) -> float:
    """The level velocity is zero, give or take; returns the squared innovation over its variance, for both axes."""
    var = density / x[SINCE]
    vx, vy = x[ERROR + V], x[ERROR + V + 1]
    place = COV + (N + 1) * V
    sxx, sxy, syy = x[place] + var, x[place + 1], x[place + N + 1] + var
    nis: float = (syy * vx * vx - 2.0 * sxy * vx * vy + sxx * vy * vy) / (sxx * syy - sxy * sxy)
    var *= max(1.0, nis * HUBER_INVERSE)
    stand_still(x, 0, var)
    stand_still(x, 1, var)
    x[SINCE], x[NIS] = 0.0, nis
    return nis


@kernel
def follow_gravity(c: Floats, x: Floats, dt: float, fx: float, fy: float, fz: float) -> int:
    """Integrate a specific force in navigation axes, the last one dt ago, and call the velocity back."""
    gravity = only_gravity(x, GRAVITY, dt, fx, fy, fz)
    slow = dt / (dt + LEAN_TAU)
    x[FORCE] += slow * (fx - x[FORCE])
    x[FORCE + 1] += slow * (fy - x[FORCE + 1])
    x[FORCE + 2] += slow * (fz - x[FORCE + 2])
    push(x, dt * c[UP] * G0)
    x[COV + (N + 1) * V] += c[ACC_VAR] * dt
    x[COV + (N + 1) * V + N + 1] += c[ACC_VAR] * dt
    x[ERROR + V] += dt * fx
    x[ERROR + V + 1] += dt * fy
    learn_speed(x, dt)
    if gravity and leans(x):
        level_again(c, x, x[FORCE], x[FORCE + 1], x[FORCE + 2])
        know_bias(x, JUMP_SD)
        know(x, TH + 2, math.sqrt(FREE))
        return flags.INCONSISTENT
    x[SINCE] += dt
    if x[SINCE] < OFTEN:
        return 0
    runs_off = keeps_accelerating(x, GRAVITY, x[SINCE], x[FORCE], x[FORCE + 1], x[FORCE + 2])
    nis = call_back(x, 2.0 * c[SPEED_LASTS] * max(x[SPEED2], c[SPEED_VAR]))
    if nis < GATE and not runs_off:
        x[GATED] = 0.0
        return 0
    x[GATED] += max(dt, OFTEN)
    if runs_off or x[GATED] > GATE_FOR:
        stop(x)
    return flags.ACC_GATED


@kernel
def stop(x: Floats) -> None:
    """Begin again with a velocity of zero."""
    know(x, V, 0.0)
    know(x, V + 1, 0.0)
    x[ERROR + V], x[ERROR + V + 1], x[MEAN], x[MEAN + 1], x[GATED] = 0.0, 0.0, 0.0, 0.0, 0.0


@kernel
def leans(x: Floats) -> bool:
    """True where the mean specific force stands askew."""
    return bool(x[FORCE] * x[FORCE] + x[FORCE + 1] * x[FORCE + 1] > LEAN * LEAN)


@kernel
def follow_field(c: Floats, x: Floats, dt: float, turning: float, hx: float, hy: float, hz: float) -> int:
    """Heading from a field in navigation axes, the last one dt ago."""
    if not has_heading(hx, hy, hz):
        return flags.MAG_GATED
    level2 = hx * hx + hy * hy
    level = math.sqrt(level2)
    if disturbed(x, FIELD, min(dt, 1.0), turning, level, hz) and c[REJECT] > 0.0 and has_ref(x, FIELD):
        x[REJECTED] += dt
        if x[REJECTED] < c[REJECT]:
            return flags.MAG_GATED
    else:
        x[REJECTED] = max(0.0, x[REJECTED] - 2.0 * dt)
    nx, ny = c[NORTH_X], c[NORTH_Y]
    angle = angle_to(hx, hy, nx, ny)
    # Along north, where the field is expected, and not along its noise, which would be in gain and innovation alike
    lean_x, lean_y = -hz / level * nx, -hz / level * ny
    if x[COV + HEADING] > 9.0 * START_HEADING * START_HEADING:  # one look knows more: begin anew with it
        x[ERROR + TH + 2] += angle
        know_heading(x, lean_x, lean_y)
        return 0
    var = (c[BEND_LASTS] * (c[BEND_VAR] + unlike2(x, FIELD, c[MAG_VAR])) + c[MAG_VAR] / level2) / max(dt, SHORTEST)
    nis = point_north(x, lean_x, lean_y, angle, var)
    return flags.MAG_GATED if nis > GATE else 0


@kernel
def look_at_field(c: Floats, x: Floats) -> int:
    """Heading from the mean of the fields since the last look."""
    s = 1.0 / x[FIELDS]
    hx, hy, hz = s * x[FIELDS + 1], s * x[FIELDS + 2], s * x[FIELDS + 3]
    word = follow_field(c, x, x[MAG_AGE], mean_speed(x, REST), hx, hy, hz)
    x[FIELDS], x[FIELDS + 1], x[FIELDS + 2], x[FIELDS + 3], x[MAG_AGE] = 0.0, 0.0, 0.0, 0.0, 0.0
    return word


@kernel
def take_field(
    c: Floats, x: Floats, dt: float,
    r00: float, r01: float, r02: float, r10: float, r11: float, r12: float, r20: float, r21: float, r22: float,
    mx: float, my: float, mz: float,
) -> int:  # fmt: skip
    """Add a field to those since the last look, and look where that is long ago."""
    if usable(mx, my, mz):
        x[FIELDS] += 1.0
        x[FIELDS + 1] += r00 * mx + r01 * my + r02 * mz
        x[FIELDS + 2] += r10 * mx + r11 * my + r12 * mz
        x[FIELDS + 3] += r20 * mx + r21 * my + r22 * mz
    elif x[FIELDS] == 0.0:
        return refused(flags.MAG_GATED, mx, my, mz)
    return look_at_field(c, x) if x[MAG_AGE] > OFTEN or dt == 0.0 else 0


@kernel
def start(c: Floats, x: Floats, ax: float, ay: float, az: float, mx: float, my: float, mz: float) -> int:
    """Take up what is missing: tilt from a specific force that may be gravity, heading from a field."""
    if x[STAGE] < LEVEL and not may_be_gravity(ax, ay, az):
        return flags.NOT_CONVERGED | flags.HEADING_FREE
    before = x[STAGE]
    word = initialise(c, x, ax, ay, az, mx, my, mz)
    if before < LEVEL:
        know_tilt(x, START_TILT)
        know(x, TH + 2, math.sqrt(FREE))
        x[FORCE], x[FORCE + 1], x[FORCE + 2] = 0.0, 0.0, c[UP] * G0
        x[SPEED2] = START_SPEED * START_SPEED
    if x[STAGE] == HEADED:
        hx, hy, hz = rotate(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], mx, my, mz)
        s = -hz / (hx * hx + hy * hy)
        know_heading(x, s * hx, s * hy)
    return word


@kernel
def begin(c: Floats, x: Floats) -> None:
    """Covariance before the first sample."""
    know_bias(x, c[BIAS_START])
    if x[STAGE] >= LEVEL:  # an attitude that was given
        know_tilt(x, START_TILT)
        know(x, TH + 2, START_HEADING if x[STAGE] == HEADED else math.sqrt(FREE))
        x[FORCE + 2], x[SPEED2] = c[UP] * G0, START_SPEED * START_SPEED


@kernel
def level_again(c: Floats, x: Floats, fx: float, fy: float, fz: float) -> None:
    """Turn the specific force, in navigation axes, up by the shortest way, and know the tilt as at the start."""
    if not may_be_gravity(fx, fy, fz):
        return
    s = 1.0 / math.sqrt(fx * fx + fy * fy + fz * fz)
    e0, e1, e2, e3 = upright(c[UP], s * fx, s * fy, s * fz)
    q0, q1, q2, q3 = quat_mul(e0, e1, e2, e3, x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = quat_unit(q0, q1, q2, q3)
    know_tilt(x, START_TILT)
    x[FORCE], x[FORCE + 1], x[FORCE + 2] = 0.0, 0.0, c[UP] * G0


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
        begin(c, x)
    turn(x, dt * (gx - x[BIAS]), dt * (gy - x[BIAS + 1]), dt * (gz - x[BIAS + 2]))
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rows(x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    predict(c, x, dt, missed, gx, gy, gz, r00, r01, r02, r10, r11, r12, r20, r21, r22)
    x[ACC_AGE] += dt
    x[MAG_AGE] += dt
    if x[STAGE] < HEADED:
        word |= start(c, x, ax, ay, az, mx, my, mz)
        if x[STAGE] < LEVEL:
            return word
        r00, r01, r02, r10, r11, r12, r20, r21, r22 = rows(x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    x[ERROR + B], x[ERROR + B + 1], x[ERROR + B + 2] = x[BIAS], x[BIAS + 1], x[BIAS + 2]
    resting = False
    if usable(ax, ay, az):
        fx = r00 * ax + r01 * ay + r02 * az
        fy = r10 * ax + r11 * ay + r12 * az
        fz = r20 * ax + r21 * ay + r22 * az
        if x[COV] + x[COV + N + 1] > 2.0 * LOST:
            level_again(c, x, fx, fy, fz)
            word |= flags.INCONSISTENT
        else:
            word |= follow_gravity(c, x, x[ACC_AGE], fx, fy, fz)
        if word & flags.INCONSISTENT:  # the attitude is another one
            r00, r01, r02, r10, r11, r12, r20, r21, r22 = rows(x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
        resting = at_rest(
            x, REST, x[ACC_AGE], c[REST_RATE], c[REST_FORCE], REST_BIAS, c[REST_AFTER],
            math.nan if word & flags.GYR_HELD else gx, gy, gz, ax, ay, az,
        )  # fmt: skip
        x[ACC_AGE] = 0.0
    else:
        word |= refused(flags.ACC_GATED, ax, ay, az)
    word |= take_field(c, x, dt, r00, r01, r02, r10, r11, r12, r20, r21, r22, mx, my, mz)
    if resting and dt > 0.0 and may_be_bias(x):
        word |= flags.AT_REST
        x[SPEED2] = 0.0
        zero_rate(x, 0, gx, c[GYR_VAR], dt, r00, r10, r20)
        zero_rate(x, 1, gy, c[GYR_VAR], dt, r01, r11, r21)
        zero_rate(x, 2, gz, c[GYR_VAR], dt, r02, r12, r22)
    inject(x)
    if x[COV] + x[COV + N + 1] > 2.0 * DOUBTFUL:
        word |= flags.NOT_CONVERGED
    return word
