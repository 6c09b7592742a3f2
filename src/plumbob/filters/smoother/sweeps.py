"""The filter forward over keyframes, and the sweep backward that makes its estimates those of the whole recording.

Forward it is an error-state Kalman filter whose measurements are scalars. Backward it is the smoother of Bryson and
Frazier in Bierman's form, [Bierman1973]: it carries what the later measurements say of the state, λ with its covariance
Λ, and inverts nothing; the smoothed estimate is x − P λ with the covariance P − P Λ P. A state without noise needs no
care, nor does a keyframe at which the tilt starts again: nothing passes it backward.

Sums are written out because a product of small matrices is slower than its arithmetic.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.kernels import kernel
from plumbob.filters.smoother.keyframes import Keyframes, turned_by
from plumbob.filters.smoother.model import BEND, KEPT, SIZE, TH, A, B, M, ModelVariances, V
from plumbob.rotations.kernels import quat_exp, quat_mul, quat_unit, rows

BLOCK: Final = 2400  # steps of which all is kept at a time, 4 kB each: a recording of a day would need a gigabyte
MEASURED: Final = 8  # scalar measurements at a keyframe, at most: level velocity (2), heading, rates at rest (3),
EAST: Final = 0
HEADING: Final = 2
RATE: Final = 3
TILT: Final = 6
"""and the tilt (2), before all others."""
RESIDUAL: Final = 0
INVERSE: Final = 1  # one over the variance of an innovation; zero where nothing was measured
TERMS: Final = 2

TURN: Final = 0  # what a step does to the errors: time integral of R, row by row, 9
SCALED: Final = 9  # of R times the rate, 27
LIFT: Final = 36  # of the specific force upwards, m/s
FADE: Final = 37  # by how much the deflection of the field fades
KIND: Final = 38
TIME: Final = 39  # length of the step, s
LASTING: Final = 40  # share of the level velocity that lasts over it
FORGOTTEN: Final = 41  # whether that may be any at its end
STEP: Final = 42

MOVING: Final = 0
RESTING: Final = 1
AGAIN: Final = 2
SEVERED: Final = 3
"""Something else was decided at the end of the step: nothing passes backward."""

FORCE: Final = 0  # means over a step in navigation axes: specific force, 3
FIELD: Final = 3  # and field, 3, of so many samples
COUNT: Final = 6
RAW: Final = 7  # mean rate as measured, body axes, 3
ROUGH: Final = 10  # mean square of the rate
MEANS: Final = 11

HUBER: Final = 9.0  # an innovation beyond this many variances counts with the noise that would make it so many
UNUSED: Final = 1e6  # a heading of this variance, rad², is not used
REST_JITTER: Final = 1e-10  # variance that the attitude gains at rest, rad²/s


@kernel
def corrected_by(q: Floats, rx: float, ry: float, rz: float) -> None:
    """Turn an attitude by a rotation vector in navigation axes."""
    e0, e1, e2, e3 = quat_exp(rx, ry, rz)  # [Sola2017] sec. 7
    a0, a1, a2, a3 = quat_mul(e0, e1, e2, e3, q[0], q[1], q[2], q[3])
    q[0], q[1], q[2], q[3] = quat_unit(a0, a1, a2, a3)


@kernel
def correct(attitude: Floats, now: Floats) -> None:
    """Take the error of the attitude into it."""
    corrected_by(attitude, now[TH], now[TH + 1], now[TH + 2])
    now[TH], now[TH + 1], now[TH + 2] = 0.0, 0.0, 0.0


@kernel
def corrected_rate(x: Floats, gx: float, gy: float, gz: float) -> tuple[float, float, float]:
    """Rate without bias, scale and misalignment."""
    return (
        gx - x[B] - (x[M] * gx + x[M + 1] * gy + x[M + 2] * gz),
        gy - x[B + 1] - (x[M + 3] * gx + x[M + 4] * gy + x[M + 5] * gz),
        gz - x[B + 2] - (x[M + 6] * gx + x[M + 7] * gy + x[M + 8] * gz),
    )


@kernel
def integrate(
    i: int, last: int, t: Floats, gyr: Floats, acc: Floats, mag: Floats, kind: int, q: Floats, x: Floats,
    f: Floats, mean: Floats,
) -> float:  # fmt: skip
    """Follow the samples behind i, up to and with `last`; returns the integral of the squared acceleration.

    A sample is taken for the mean since the one before it, and so at half of its step.
    """
    for k in range(STEP):
        f[k] = 0.0
    for k in range(MEANS):
        mean[k] = 0.0
    acceleration2 = 0.0
    for s in range(i + 1, last + 1):
        dt = t[s] - t[s - 1]
        gx, gy, gz = gyr[s, 0], gyr[s, 1], gyr[s, 2]
        wx, wy, wz = corrected_rate(x, gx, gy, gz)
        half = 0.5 * dt if kind != RESTING else 0.0
        turned_by(q, half * wx, half * wy, half * wz)
        r00, r01, r02, r10, r11, r12, r20, r21, r22 = rows(q[0], q[1], q[2], q[3])
        gyr_row(f, 0, dt, r00, r01, r02, gx, gy, gz)
        gyr_row(f, 1, dt, r10, r11, r12, gx, gy, gz)
        gyr_row(f, 2, dt, r20, r21, r22, gx, gy, gz)
        ax, ay, az = acc[s, 0] - x[A], acc[s, 1] - x[A + 1], acc[s, 2] - x[A + 2]
        ux, uy, uz = r00 * ax + r01 * ay + r02 * az, r10 * ax + r11 * ay + r12 * az, r20 * ax + r21 * ay + r22 * az
        mean[FORCE] += dt * ux
        mean[FORCE + 1] += dt * uy
        mean[FORCE + 2] += dt * uz
        acceleration2 += dt * (ux * ux + uy * uy + (uz - G0) * (uz - G0))
        mean[RAW] += dt * gx
        mean[RAW + 1] += dt * gy
        mean[RAW + 2] += dt * gz
        mean[ROUGH] += dt * (gx * gx + gy * gy + gz * gz)
        mx, my, mz = mag[s, 0], mag[s, 1], mag[s, 2]
        if not math.isnan(mx):
            mean[FIELD] += r00 * mx + r01 * my + r02 * mz
            mean[FIELD + 1] += r10 * mx + r11 * my + r12 * mz
            mean[FIELD + 2] += r20 * mx + r21 * my + r22 * mz
            mean[COUNT] += 1.0
        turned_by(q, half * wx, half * wy, half * wz)
    for k in range(FIELD, COUNT):
        mean[k] /= max(mean[COUNT], 1.0)
    f[LIFT], f[KIND], f[TIME] = mean[FORCE + 2], kind, t[last] - t[i]
    return acceleration2


@kernel
def gyr_row(f: Floats, i: int, dt: float, r0: float, r1: float, r2: float, gx: float, gy: float, gz: float) -> None:
    """Row i of what errors of the gyroscope do to the attitude: θ' = −R (δb + δM ω), [Sola2017] sec. 5.3."""
    r0, r1, r2 = dt * r0, dt * r1, dt * r2
    turn, scaled = TURN + 3 * i, SCALED + 9 * i
    f[turn] += r0
    f[turn + 1] += r1
    f[turn + 2] += r2
    f[scaled] += r0 * gx
    f[scaled + 1] += r0 * gy
    f[scaled + 2] += r0 * gz
    f[scaled + 3] += r1 * gx
    f[scaled + 4] += r1 * gy
    f[scaled + 5] += r1 * gz
    f[scaled + 6] += r2 * gx
    f[scaled + 7] += r2 * gy
    f[scaled + 8] += r2 * gz


@kernel
def scale_velocity(p: Floats, by: float) -> None:
    """P ← S P Sᵀ of v ← s v."""
    for i in (V, V + 1):
        for j in range(SIZE):
            p[i, j] *= by
        for j in range(SIZE):
            p[j, i] *= by


@kernel
def propagate_velocity(p: Floats, f: Floats) -> None:
    """P ← F P Fᵀ of v ← s v + lift (θ_y, −θ_x) − R δa: a wrong tilt takes gravity for an acceleration, a bias too."""
    lift = f[LIFT]
    scale_velocity(p, f[LASTING])
    for j in range(SIZE):
        p[V, j] += lift * p[TH + 1, j] - f[TURN] * p[A, j] - f[TURN + 1] * p[A + 1, j] - f[TURN + 2] * p[A + 2, j]
        p[V + 1, j] -= lift * p[TH, j] + f[TURN + 3] * p[A, j] + f[TURN + 4] * p[A + 1, j] + f[TURN + 5] * p[A + 2, j]
    for j in range(SIZE):
        p[j, V] += lift * p[j, TH + 1] - f[TURN] * p[j, A] - f[TURN + 1] * p[j, A + 1] - f[TURN + 2] * p[j, A + 2]
        p[j, V + 1] -= lift * p[j, TH] + f[TURN + 3] * p[j, A] + f[TURN + 4] * p[j, A + 1] + f[TURN + 5] * p[j, A + 2]


@kernel
def propagate_attitude(p: Floats, f: Floats) -> None:
    """P ← F P Fᵀ of θ ← θ − R (δb + δM ω)."""
    for i in range(3):
        for m in range(12):
            c, of = f[TURN + 3 * i + m] if m < 3 else f[SCALED + 9 * i + m - 3], B + m if m < 3 else M + m - 3
            for j in range(SIZE):
                p[TH + i, j] -= c * p[of, j]
    for j in range(SIZE):
        for i in range(3):
            turn, scaled, c = TURN + 3 * i, SCALED + 9 * i, p[j, TH + i]
            for m in range(3):
                c -= f[turn + m] * p[j, B + m]
            for m in range(9):
                c -= f[scaled + m] * p[j, M + m]
            p[j, TH + i] = c


@kernel
def heading_from(q: Floats, other: Floats) -> float:
    """Turn about the vertical, rad, that brings the heading of an attitude to that of another one."""
    w = other[0] * q[0] + other[1] * q[1] + other[2] * q[2] + other[3] * q[3]
    z = other[3] * q[0] - other[0] * q[3] + other[2] * q[1] - other[1] * q[2]
    return 2.0 * math.atan2(z, w)


@kernel
def start_again(attitude: Floats, start: Floats, p: Floats, p0: Floats, x: Floats, missed: float) -> None:
    """Behind a gap: the tilt of a start, and of its heading and the one that was bridged the one that is known better.

    Nothing else is forgotten.
    """
    heading2, by = p[TH + 2, TH + 2] + missed, 0.0
    if heading2 < p0[TH + 2, TH + 2]:
        by = heading_from(start, attitude)
    else:
        heading2 = p0[TH + 2, TH + 2]
    for i in range(4):
        attitude[i] = start[i]
    corrected_by(attitude, 0.0, 0.0, by)
    for i in (TH, TH + 1, TH + 2, V, V + 1):
        for j in range(SIZE):
            p[i, j], p[j, i] = 0.0, 0.0
        p[i, i] = heading2 if i == TH + 2 else p0[i, i]
    x[V], x[V + 1] = 0.0, 0.0


@kernel
def predict(
    p: Floats, now: Floats, f: Floats, mean: Floats, spread2: float, missed: float, pushed: float, lasting: float,
    noise: ModelVariances,
) -> None:  # fmt: skip
    """State and covariance over a step that was followed, moving or at rest."""
    dt = f[TIME]
    f[LASTING] = lasting
    now[V] = lasting * now[V] + mean[FORCE]
    now[V + 1] = lasting * now[V + 1] + mean[FORCE + 1]
    propagate_velocity(p, f)
    if f[KIND] == MOVING:
        propagate_attitude(p, f)
        wander = noise.gyr * dt + noise.nonlinearity * mean[ROUGH] + missed
    else:
        wander = REST_JITTER * dt
    shake = noise.acc * (dt + 0.5 * spread2) + pushed
    for i in range(3):
        p[TH + i, TH + i] += wander
    p[V, V] += shake
    p[V + 1, V + 1] += shake


@kernel
def fade(p: Floats, x: Floats, by: float, var: float) -> None:
    """Let the deflection of the field go back to none: first-order Gauss–Markov."""
    for j in range(SIZE):
        p[BEND, j] *= by
    for j in range(SIZE):
        p[j, BEND] *= by
    x[BEND] *= by
    p[BEND, BEND] += var * (1.0 - by * by)


@kernel
def update(p: Floats, x: Floats, gain: Floats, term: Floats, column: Floats, residual: float, s: float) -> None:
    """State and covariance by a scalar whose column P Hᵀ and innovation variance are given; keeps what goes back."""
    s = max(s, residual * residual / HUBER)
    inverse = 1.0 / s  # [BarShalom2001] sec. 5.2.3
    for i in range(SIZE):
        gain[i] = inverse * column[i]
        x[i] += gain[i] * residual
    for i in range(SIZE):
        k = gain[i]
        for j in range(SIZE):
            p[i, j] -= k * column[j]
    term[RESIDUAL], term[INVERSE] = residual, inverse


@kernel
def update_one(
    p: Floats, x: Floats, gain: Floats, term: Floats, column: Floats, i: int, residual: float, var: float
) -> None:
    """Update by a measurement of one state."""
    for j in range(SIZE):
        column[j] = p[i, j]
    update(p, x, gain, term, column, residual, column[i] + var)


@kernel
def zero_velocity_update(p: Floats, x: Floats, gain: Floats, term: Floats, column: Floats, var: float) -> None:
    """The level velocity is zero, but for what the body moves."""
    for i in range(2):
        update_one(p, x, gain[EAST + i], term[EAST + i], column, V + i, -x[V + i], var)


@kernel
def zero_rate_update(
    p: Floats, x: Floats, gain: Floats, term: Floats, column: Floats, mean: Floats, dt: float, var: float
) -> None:
    """At rest the attitude stays, and the gyroscope measures its bias."""
    for i in range(3):
        update_one(p, x, gain[RATE + i], term[RATE + i], column, B + i, mean[RAW + i] / dt - x[B + i], var)


@kernel
def heading_update(p: Floats, x: Floats, gain: Floats, term: Floats, column: Floats, mean: Floats, var: float) -> None:
    """Heading by the direction of the mean field in navigation axes; its deflection shares the innovation.

    What is uncertain in the tilt turns the level part of a steep field; it is counted as noise, so that a field never
    says anything of the tilt.
    """
    hx, hy, hz = mean[FIELD], mean[FIELD + 1], mean[FIELD + 2]
    angle = math.atan2(hx, hy) - x[TH + 2] - x[BEND]
    if angle > math.pi:
        angle -= 2.0 * math.pi
    elif angle < -math.pi:
        angle += 2.0 * math.pi
    for j in range(SIZE):
        column[j] = p[TH + 2, j] + p[BEND, j]
    var += hz * hz / (hx * hx + hy * hy) * p[TH + 1, TH + 1]  # [Schmidt1966]
    update(p, x, gain[HEADING], term[HEADING], column, angle, column[TH + 2] + column[BEND] + var)


@kernel
def forward(
    t: Floats, gyr: Floats, acc: Floats, mag: Floats, first: NDArray[np.int64], kind: NDArray[np.int64],
    missed: Floats, pushed: Floats, density: Floats, lasting: Floats, heading_var: Floats, q_start: Floats,
    p0: Floats, noise: ModelVariances, attitude: Floats, now: Floats, p: Floats,
    q: Floats, x: Floats, cov: Floats, gain: Floats, term: Floats, step: Floats, mean: Floats,
) -> None:  # fmt: skip
    """Filter forward: attitude, state and covariance after every keyframe, and what the way back needs of each step.

    `attitude`, `now` and `p` are those before the first step, and are left as those after the last.
    """
    column = np.zeros(SIZE)
    keep(0, attitude, now, p, q, x, cov)
    for k in range(first.size - 1):
        f, u, last = step[k], mean[k], first[k + 1]
        for i in range(MEASURED):
            term[k, i, INVERSE] = 0.0
        spread2 = integrate(first[k], last, t, gyr, acc, mag, kind[k], attitude, now, f, u)
        dt = f[TIME]
        f[FADE] = math.exp(-dt / noise.bend_time)
        if kind[k] == AGAIN:
            u[COUNT] = 0.0
            start_again(attitude, q_start[k + 1], p, p0, now, missed[k])
        else:
            predict(p, now, f, u, spread2, missed[k], pushed[k], lasting[k], noise)
        for i in range(3):
            p[B + i, B + i] += noise.walk * dt
        fade(p, now, f[FADE], noise.bend)
        if kind[k] != AGAIN:
            zero_velocity_update(p, now, gain[k], term[k], column, density[k] / dt)
        if kind[k] == RESTING:
            zero_rate_update(p, now, gain[k], term[k], column, u, dt, noise.rest / dt)
        if u[COUNT] > 0.0 and heading_var[k] < UNUSED:
            heading_update(p, now, gain[k], term[k], column, u, heading_var[k])
        for i in range(3):
            u[FORCE + i] /= dt
        correct(attitude, now)
        keep(k + 1, attitude, now, p, q, x, cov)


@kernel
def keep(k: int, attitude: Floats, now: Floats, p: Floats, q: Floats, x: Floats, cov: Floats) -> None:
    """Write down what is known at a keyframe; of the covariance as many of the first states as there is room for."""
    for i in range(4):
        q[k, i] = attitude[i]
    for i in range(SIZE):
        x[k, i] = now[i]
    for i in range(cov.shape[1]):
        for j in range(cov.shape[2]):
            cov[k, i, j] = p[i, j]


@kernel
def back_through(lam: Floats, big: Floats, y: Floats, gain: Floats, term: Floats, first: int, second: int) -> None:
    """λ and Λ before a scalar measurement of one state, or of the sum of two, from those after it."""
    inverse = term[INVERSE]
    gradient, curvature = 0.0, inverse
    for i in range(SIZE):
        y[i] = 0.0
    for j in range(SIZE):
        k = gain[j]
        gradient += k * lam[j]
        for i in range(SIZE):
            y[i] += k * big[j, i]
    for i in range(SIZE):
        curvature += gain[i] * y[i]
    gradient += term[RESIDUAL] * inverse
    lam[first] -= gradient  # [Bierman1973]: λ ← (I − K H)ᵀ λ − Hᵀ r / s
    for j in range(SIZE):
        big[first, j] -= y[j]
        big[j, first] -= y[j]
    big[first, first] += curvature
    if second >= 0:
        lam[second] -= gradient
        for j in range(SIZE):
            big[second, j] -= y[j]
            big[j, second] -= y[j]
        big[second, second] += curvature
        big[first, second] += curvature
        big[second, first] += curvature


@kernel
def back_over_attitude(lam: Floats, big: Floats, f: Floats) -> None:
    """λ ← Fᵀ λ and Λ ← Fᵀ Λ F of θ ← θ − R (δb + δM ω)."""
    for i in range(3):
        for m in range(12):
            c, of = f[TURN + 3 * i + m] if m < 3 else f[SCALED + 9 * i + m - 3], B + m if m < 3 else M + m - 3
            lam[of] -= c * lam[TH + i]
            for j in range(SIZE):
                big[of, j] -= c * big[TH + i, j]
    for j in range(SIZE):
        for i in range(3):
            turn, scaled, c = TURN + 3 * i, SCALED + 9 * i, big[j, TH + i]
            for m in range(3):
                big[j, B + m] -= f[turn + m] * c
            for m in range(9):
                big[j, M + m] -= f[scaled + m] * c


@kernel
def back_over_velocity(lam: Floats, big: Floats, f: Floats) -> None:
    """λ ← Fᵀ λ and Λ ← Fᵀ Λ F of v ← s v + lift (θ_y, −θ_x) − R δa."""
    lift = f[LIFT]
    lam[TH + 1] += lift * lam[V]
    lam[TH] -= lift * lam[V + 1]
    for j in range(SIZE):
        big[TH + 1, j] += lift * big[V, j]
        big[TH, j] -= lift * big[V + 1, j]
    for m in range(3):
        cx, cy = f[TURN + m], f[TURN + 3 + m]
        lam[A + m] -= cx * lam[V] + cy * lam[V + 1]
        for j in range(SIZE):
            big[A + m, j] -= cx * big[V, j] + cy * big[V + 1, j]
    for j in range(SIZE):
        vx, vy = big[j, V], big[j, V + 1]
        big[j, TH + 1] += lift * vx
        big[j, TH] -= lift * vy
        for m in range(3):
            big[j, A + m] -= f[TURN + m] * vx + f[TURN + 3 + m] * vy
    lam[V], lam[V + 1] = f[LASTING] * lam[V], f[LASTING] * lam[V + 1]
    scale_velocity(big, f[LASTING])


@kernel
def forget(lam: Floats, big: Floats, first: int, end: int) -> None:
    """What later measurements say of some states does not pass backward."""
    for i in range(first, end):
        lam[i] = 0.0
        for j in range(SIZE):
            big[i, j], big[j, i] = 0.0, 0.0


@kernel
def back_over(lam: Floats, big: Floats, f: Floats) -> None:
    """From behind a step to before it; where the attitude started again nothing of it passes."""
    lam[BEND] *= f[FADE]
    for j in range(SIZE):
        big[BEND, j] *= f[FADE]
    for j in range(SIZE):
        big[j, BEND] *= f[FADE]
    if f[FORGOTTEN] > 0.0 or f[KIND] == AGAIN:
        forget(lam, big, V, V + 2)
    if f[KIND] == AGAIN:
        forget(lam, big, TH, TH + 3)
        return
    if f[KIND] == MOVING:
        back_over_attitude(lam, big, f)
    back_over_velocity(lam, big, f)


@kernel
def smooth_state(k: int, lam: Floats, q: Floats, x: Floats, cov: Floats, d: Floats, q_s: Floats, x_s: Floats) -> None:
    """Attitude and the first states of the whole recording: x − P λ."""
    for i in range(KEPT):
        d[i] = 0.0
        for j in range(SIZE):
            d[i] -= cov[k, i, j] * lam[j]  # [Bierman1973]
        x_s[k, i] = x[k, i] + d[i] if i >= B else 0.0
    for i in range(4):
        q_s[k, i] = q[k, i]
    corrected_by(q_s[k], d[TH], d[TH + 1], d[TH + 2])


@kernel
def smooth_covariance(cov: Floats, big: Floats, product: Floats, out: Floats) -> None:
    """Covariance of attitude and bias of the whole recording: P − P Λ P."""
    for i in range(6):
        for j in range(SIZE):
            product[i, j] = 0.0
        for m in range(SIZE):
            c = cov[i, m]
            for j in range(SIZE):
                product[i, j] += c * big[m, j]
    for i in range(6):
        for j in range(i + 1):
            s = cov[i, j]
            for m in range(SIZE):
                s -= product[i, m] * cov[j, m]  # [Bierman1973]
            out[i, j], out[j, i] = s, s


@kernel
def backward(
    q: Floats, x: Floats, cov: Floats, gain: Floats, term: Floats, step: Floats, lam: Floats, big: Floats,
    q_s: Floats, x_s: Floats, cov_s: Floats,
) -> None:  # fmt: skip
    """Smooth: attitude, the first states, and the covariance of attitude and bias, (6, 6), at every keyframe.

    `lam` and `big` are λ and Λ at the last keyframe, and are left as those at the first.
    """
    y, d, product = np.zeros(SIZE), np.zeros(KEPT), np.zeros((6, SIZE))
    for k in range(q.shape[0] - 1, -1, -1):
        smooth_state(k, lam, q, x, cov, d, q_s, x_s)
        if cov_s.shape[0]:
            smooth_covariance(cov[k], big, product, cov_s[k])
        if k > 0:
            back_to_the_last(lam, big, y, gain[k - 1], term[k - 1], step[k - 1])


@kernel
def back_to_the_last(lam: Floats, big: Floats, y: Floats, gain: Floats, term: Floats, f: Floats) -> None:
    """From behind the measurements of a keyframe to behind those of the one before, last first."""
    if f[KIND] == SEVERED:
        forget(lam, big, 0, SIZE)
        return
    if term[HEADING, INVERSE] > 0.0:
        back_through(lam, big, y, gain[HEADING], term[HEADING], TH + 2, BEND)
    for i in (2, 1, 0):
        if term[RATE + i, INVERSE] > 0.0:
            back_through(lam, big, y, gain[RATE + i], term[RATE + i], B + i, -1)
    for i in (1, 0):
        if term[EAST + i, INVERSE] > 0.0:
            back_through(lam, big, y, gain[EAST + i], term[EAST + i], V + i, -1)
    for i in (1, 0):
        if term[TILT + i, INVERSE] > 0.0:
            back_through(lam, big, y, gain[TILT + i], term[TILT + i], TH + i, -1)
    back_over(lam, big, f)


class Last(NamedTuple):
    """Attitude (4,), state (21,) and covariance (21, 21) at a keyframe, by what came before it."""

    attitude: Floats
    state: Floats
    cov: Floats

    def with_prior(self, mean: Floats, before: Floats, after: Floats) -> tuple[Self, Floats]:
        """The same measurements with another prior of scale and misalignment, not narrower, and of the mean zero.

        What they say is the posterior without its prior, of this `mean` and variances `before`, (9,); the variances
        `after` are then those of the prior. Returns the change of the state too.
        """
        information = 1.0 / before - 1.0 / after
        gain = self.cov[:, M:] @ np.linalg.inv(np.eye(9) - information[:, np.newaxis] * self.cov[M:, M:])
        cov = self.cov + gain @ (information[:, np.newaxis] * self.cov[M:])
        shift = cov[:, M:] @ (information * self.state[M:] - mean / before)
        attitude, state = self.attitude.copy(), self.state + shift
        correct(attitude, state)
        return type(self)(attitude, state, 0.5 * (cov + cov.T)), shift


class Way(NamedTuple):
    """The way forward over some steps, as the way back needs it; 4 kB a step.

    Of each keyframe: attitude (K + 1, 4), state (K + 1, 21) and covariance of the first with all (K + 1, 8, 21); of
    each step: gain (K, 8, 21) and term (K, 8, 2) of each measurement, and what the step does to errors (K, 42).
    """

    q: Floats
    x: Floats
    cov: Floats
    gain: Floats
    term: Floats
    step: Floats

    @classmethod
    def joined(cls, ways: Sequence[Self]) -> Self:
        """Steps one after the other."""
        columns = [list(column) for column in zip(*ways, strict=True)]
        keyframes = (np.concatenate([column[0][:1], *(rows[1:] for rows in column)]) for column in columns[:3])
        return cls(*keyframes, *(np.concatenate(column) for column in columns[3:]))

    def part(self, begin: int, end: int) -> Self:
        """Some of the steps, in the same memory."""
        return type(self)(*(rows[begin : end + 1] for rows in self[:3]), *(rows[begin:end] for rows in self[3:]))

    def back(self, lam: Floats, big: Floats) -> tuple[Floats, Floats, Floats]:
        """What `backward` finds: attitude (K + 1, 4), first states (K + 1, 8) and covariance (K + 1, 6, 6)."""
        n = len(self.q)
        q_s, x_s, cov_s = np.empty((n, 4)), np.empty((n, KEPT)), np.empty((n, 6, 6))
        backward(*self, lam, big, q_s, x_s, cov_s)
        return q_s, x_s, cov_s


@dataclass(frozen=True, slots=True)
class Sweep:
    """What a pass forward and backward found."""

    q: Floats  # (K + 1, 4), smoothed attitude at the keyframes, body to ENU
    x: Floats  # (K + 1, 8), smoothed error (zero), bias, level velocity
    cov: Floats  # (K + 1, 6, 6), covariance of attitude (navigation axes) and bias; empty where it was not asked for
    matrix: Floats  # (9,), scale and misalignment of the gyroscope
    unit_cov: Floats  # (12, 12), covariance of the last bias of the gyroscope and `matrix`
    # force, field: (K, 3), mean specific force and field of each step in smoothed navigation axes, m/s² and µT
    force: Floats
    field: Floats
    moved: tuple[float, float]  # sums of r²/s and of log s, of level velocities foretold with variances s
    last: Last  # what the pass forward knew at the last keyframe, from where another one can go on
    way: Way | None  # the way forward; None where that is longer than `BLOCK`

    @property
    def bias(self) -> Floats:
        """Bias of the gyroscope at the keyframes, rad/s, (K + 1, 3)."""
        return self.x[:, B : B + 3]


def sweep(
    frames: Keyframes, kind: NDArray[np.int64], density: Floats, lasting: Floats, heading_var: Floats, q_start: Floats,
    bias: Floats, matrix: Floats, p0: Floats, noise: ModelVariances, *, first: Floats | None = None,
    covariance: bool = True,
) -> Sweep:  # fmt: skip
    """Forward and backward over a recording.

    What the way back needs is kept of one block of steps alone: the way forward is gone again from the start of each.

    `frames`: samples and the steps between keyframes; `kind` (K,): of each step: moving, at rest, or with a new start
    at its end; `density` (K,): of the level velocity, m²/s: what the body moves, as white noise; `lasting` (K,): share
    of the level velocity that lasts over each step: see `Speed.lasting`; `heading_var` (K,): variance of the heading
    that the mean field of each step shows, rad²; `q_start` (K + 1, 4): attitude to start from, at the first keyframe
    and where it starts again; `bias` (3,), `matrix` (9,): first bias of the gyroscope, rad/s, its scale and
    misalignment; `p0` (21, 21): covariance where the attitude starts; `noise`: of the model; `first` (21, 21): and that
    at the first keyframe, if it is another one; `covariance`: smooth the covariance too, which takes as long as all the
    rest.
    """
    n = kind.size
    q, mean, most = np.empty((n + 1, 4)), np.empty((n, MEANS)), min(n, BLOCK)
    x, cov, gain = np.empty((most + 1, SIZE)), np.empty((most + 1, KEPT, SIZE)), np.empty((most, MEASURED, SIZE))
    term, step = np.empty((most, MEASURED, TERMS)), np.empty((most, STEP))
    q_s, x_s, cov_s = np.empty((n + 1, 4)), np.empty((n + 1, KEPT)), np.empty((n + 1 if covariance else 0, 6, 6))

    def ahead(begin: int, attitude: Floats, now: Floats, p: Floats) -> Way:
        steps, points, count = slice(begin, begin + BLOCK), slice(begin, begin + BLOCK + 1), min(BLOCK, n - begin)
        block = Way(q[points], x[: count + 1], cov[: count + 1], gain[:count], term[:count], step[:count])
        forward(
            frames.t, frames.gyr, frames.acc, frames.mag, frames.first[points], kind[steps], frames.missed[steps],
            frames.pushed[steps], density[steps], lasting[steps], heading_var[steps], q_start[points], p0, noise,
            attitude, now, p, *block, mean[steps],
        )  # fmt: skip
        return block

    attitude, now, p = q_start[0].copy(), np.zeros(SIZE), (p0 if first is None else first).copy()
    now[B : B + 3], now[M:] = bias, matrix
    begins, starts, foretold = range(0, n, BLOCK), [], np.empty((n, 2, 2))
    for begin in begins:
        starts.append((attitude.copy(), now.copy(), p.copy()))
        block = ahead(begin, attitude, now, p)
        foretold[begin : begin + BLOCK] = block.term[:, EAST : EAST + 2, [RESIDUAL, INVERSE]]
    last = Last(attitude.copy(), now.copy(), 0.5 * (p + p.T))
    lam, big = np.zeros(SIZE), np.zeros((SIZE, SIZE))
    for begin, start in zip(reversed(begins), reversed(starts), strict=True):
        if begin != begins[-1]:
            block = ahead(begin, *start)
        points = slice(begin, begin + BLOCK + 1)
        backward(*block, lam, big, q_s[points], x_s[points], cov_s[points])
    from plumbob.rotations import quat_conjugate, quat_multiply, quat_rotate

    change = quat_multiply(q_s[1:], quat_conjugate(q[1:]))
    force = quat_rotate(change, mean[:, FORCE : FORCE + 3])
    field = quat_rotate(change, mean[:, FIELD : FIELD + 3])
    field[mean[:, COUNT] == 0.0] = np.nan
    residual, inverse = foretold[foretold[..., 1] > 0.0].T
    moved = float(residual**2 @ inverse), -float(np.log(inverse).sum())
    unit = [*range(B, B + 3), *range(M, M + 9)]
    unit_cov = p[np.ix_(unit, unit)]
    unit_cov = 0.5 * (unit_cov + unit_cov.T)
    way = block if n <= BLOCK else None
    return Sweep(q_s, x_s, cov_s, now[M:], unit_cov, force, field, moved, last, way)
