"""The small filter behind an array: attitude and bias of the mean rate, from the directions of gravity and field.

A multiplicative extended Kalman filter of six states, ``q_true = exp(θ) ⊗ q`` in navigation axes, with the noise
of the cards and nothing else: each specific force is gravity and each field the Earth's, both with white noise.
With the trackers of each unit's parity it is the full filter of an array with a bias for each unit, where they are
equal. While the mean rate is nothing but noise and what the bias may be, the body rests: the attitude stays, and the
rate is the bias. What misses the size of gravity, or of the mean field, by more than `SEEN` standard deviations counts
as noise too.

When to choose it: an array that turns slowly in a field that nothing disturbs, as the teaching arm's. Where the body
accelerates or the field is bent, the project's other filters and the smoother are better.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.kernels import kernel
from plumbob.core.units import dps
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.cards import NoiseCard
from plumbob.filters.integrate import turn
from plumbob.filters.start import angle_to, has_heading, level, turn_about_vertical
from plumbob.rotations import Frame, North, dcm_from_quat
from plumbob.rotations.kernels import quat_exp, quat_mul, quat_unit, rotate, rows

NAME: Final = "directions"
SIZE: Final = 6
REST_TAU: Final = 1.0  # the rate is averaged over this, s, to tell whether the body rests,
REST: Final = 16.0  # and rests where its square stays below so many variances: a turn that nobody could tell from rest
FREE: Final = 3.0  # variance of a heading that nothing has shown, rad²
LOOKED: Final = 1000.0  # level and down parts of the field are means of so many looks
Q, BIAS, RATE, MEAN, MEAN_VAR, STAGE, LOOKS, WIDE, DOWN, STATE = 0, 4, 7, 10, 13, 14, 15, 16, 17, 18
"""Places: attitude, bias, last rate, its mean and the variance of that, what is known, and of the field."""
SEEN: Final = 4.0  # a miss of so many standard deviations is not noise; a smaller one is in the variance already
TREMOR: Final = 0.1  # what still moves at rest, as a share of the gyroscope's noise


class Params(NamedTuple):
    """Noise of the virtual unit, SI."""

    gyr_noise: float = dps(0.01)
    gyr_walk: float = dps(0.001)
    bias_start: float = dps(0.5)
    acc_noise: float = 0.003
    mag_noise: float = 0.1


def noise_params(noise: NoiseCard | None, bias_start: float) -> Params:
    """Parameters from the card of a virtual unit, and the standard deviation of its bias."""
    params = Params(bias_start=bias_start)
    if noise is None:
        return params
    rms = {f"{name}_noise": part.n_rms for name in ("gyr", "acc", "mag") if (part := getattr(noise, name)) is not None}
    if noise.gyr is not None and noise.gyr.k_rms > 0.0:
        rms["gyr_walk"] = noise.gyr.k_rms
    return params._replace(**{name: value for name, value in rms.items() if value > 0.0})


@kernel
def update(p: Floats, state: Floats, h: Floats, residual: float, var: float, gain: Floats) -> None:
    """Take up one number; `state` is (θ, b) as far as this row has changed it, and h has zeros for the bias."""
    s, e = var, residual
    for i in range(SIZE):
        gain[i] = p[i, 0] * h[0] + p[i, 1] * h[1] + p[i, 2] * h[2]
    for i in range(3):
        s += h[i] * gain[i]
        e -= h[i] * state[i]
    for i in range(SIZE):
        state[i] += gain[i] * e / s
    for i in range(SIZE):
        for j in range(SIZE):
            p[i, j] -= gain[i] * gain[j] / s


@kernel
def update_bias(p: Floats, state: Floats, k: int, residual: float, var: float, gain: Floats) -> None:
    """Take up a rate of the body at rest, which is its bias."""
    s = p[3 + k, 3 + k] + var
    e = (residual - state[3 + k]) / s
    for i in range(SIZE):
        gain[i] = p[i, 3 + k]
    for i in range(SIZE):
        state[i] += gain[i] * e
        for j in range(SIZE):
            p[i, j] -= gain[i] * gain[j] / s


@kernel
def at_rest(p: Floats, var: float, r0: float, r1: float, r2: float) -> bool:
    """True where a mean rate, of this variance and less the bias, is only noise and what the bias may still be."""
    x: bool = r0 * r0 < REST * (var + p[3, 3])
    y: bool = r1 * r1 < REST * (var + p[4, 4])
    z: bool = r2 * r2 < REST * (var + p[5, 5])
    return x and y and z


@kernel
def step_time(
    x: Floats, p: Floats, state: Floats, gain: Floats, turned: Floats, noise: Floats, dt: float, step: float,
    gx: float, gy: float, gz: float,
) -> None:  # fmt: skip
    """Let a step pass with the rate g, or the last one where it is absent; at rest the rate is the bias."""
    has_rate = not (math.isnan(gx) or math.isnan(gy) or math.isnan(gz))
    if has_rate:
        x[RATE], x[RATE + 1], x[RATE + 2] = gx, gy, gz
    white = noise[0] * noise[0]
    mix = 1.0 if x[MEAN_VAR] == 0.0 else 1.0 - math.exp(-step / REST_TAU)
    x[MEAN_VAR] = (1.0 - mix) * (1.0 - mix) * x[MEAN_VAR] + mix * mix * white / step
    for k in range(3):
        x[MEAN + k] += mix * (x[RATE + k] - x[MEAN + k])
    if x[STAGE] == 0.0 or dt <= 0.0:
        return
    if at_rest(p, x[MEAN_VAR], x[MEAN] - x[BIAS], x[MEAN + 1] - x[BIAS + 1], x[MEAN + 2] - x[BIAS + 2]):
        for k in range(SIZE):
            p[k, k] += (TREMOR * TREMOR * white if k < 3 else noise[1] * noise[1]) * dt
        if has_rate:
            for k in range(3):
                update_bias(p, state, k, x[RATE + k] - x[BIAS + k], white / step, gain)
        return
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rows(x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    turn(x, dt * (x[RATE] - x[BIAS]), dt * (x[RATE + 1] - x[BIAS + 1]), dt * (x[RATE + 2] - x[BIAS + 2]))
    turned[0, 0], turned[0, 1], turned[0, 2] = -dt * r00, -dt * r01, -dt * r02
    turned[1, 0], turned[1, 1], turned[1, 2] = -dt * r10, -dt * r11, -dt * r12
    turned[2, 0], turned[2, 1], turned[2, 2] = -dt * r20, -dt * r21, -dt * r22
    propagate(p, turned, (white if has_rate else 1.0) * dt, noise[1] * noise[1] * dt)


@kernel
def see_gravity(
    x: Floats, p: Floats, state: Floats, h: Floats, gain: Floats, noise: Floats, up: float, step: float,
    ax: float, ay: float, az: float,
) -> None:  # fmt: skip
    """Take up a specific force as gravity; the first one gives the tilt."""
    size = math.sqrt(ax * ax + ay * ay + az * az)
    if not size > 0.0:  # absent
        return
    var = noise[3] * noise[3] / step
    if x[STAGE] == 0.0:
        x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = level(up, ax / size, ay / size, az / size)
        p[0, 0] = p[1, 1] = var / (G0 * G0)
        p[2, 2] = FREE
        for k in range(3, SIZE):
            p[k, k] = noise[2] * noise[2]
        x[STAGE] = 1.0
        return
    fx, fy, _ = rotate(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], ax, ay, az)
    if abs(size - G0) > SEEN * math.sqrt(var):
        var += (size - G0) * (size - G0)
    h[0], h[1], h[2] = 0.0, -G0 * up, 0.0
    update(p, state, h, fx, var, gain)
    h[0], h[1] = G0 * up, 0.0
    update(p, state, h, fy, var, gain)


@kernel
def see_field(
    x: Floats, p: Floats, state: Floats, h: Floats, gain: Floats, noise: Floats, north: Floats, step: float,
    mx: float, my: float, mz: float,
) -> None:  # fmt: skip
    """Take up a field's azimuth; the first one gives the heading, and its level and down parts are learned."""
    hx, hy, hz = rotate(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], mx, my, mz)
    if x[STAGE] == 0.0 or not has_heading(hx, hy, hz):
        return
    var, wide = noise[4] * noise[4] / step, math.sqrt(hx * hx + hy * hy)
    if x[STAGE] == 1.0:
        q0, q1, q2, q3 = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
        angle = angle_to(hx, hy, north[0], north[1])
        x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = turn_about_vertical(angle, q0, q1, q2, q3)
        tilt = p[0, 0]
        p[2, 2] = (var + hz * hz * tilt) / (wide * wide)
        for j in range(2):
            p[2, j] = p[j, 2] = hz / wide * north[j] * tilt
        x[STAGE], x[LOOKS], x[WIDE], x[DOWN] = 2.0, 1.0, wide, hz
        return
    x[LOOKS] = min(x[LOOKS] + 1.0, LOOKED)
    x[WIDE] += (wide - x[WIDE]) / x[LOOKS]
    x[DOWN] += (hz - x[DOWN]) / x[LOOKS]
    if abs(wide - x[WIDE]) > SEEN * math.sqrt(var):
        var += (wide - x[WIDE]) * (wide - x[WIDE])
    h[0], h[1], h[2] = x[DOWN] * north[0], x[DOWN] * north[1], -x[WIDE]
    update(p, state, h, north[0] * hy - north[1] * hx, var, gain)


@kernel
def inject(x: Floats, state: Floats) -> None:
    """Move what the measurements of a row have found to attitude and bias."""
    e0, e1, e2, e3 = quat_exp(state[0], state[1], state[2])
    q0, q1, q2, q3 = quat_mul(e0, e1, e2, e3, x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = quat_unit(q0, q1, q2, q3)
    for k in range(3):
        x[BIAS + k] += state[3 + k]


@kernel
def run(
    t: Floats, gyr: Floats, acc: Floats, mag: Floats, noise: Floats, up: float, north: Floats, first_step: float,
    x: Floats, p: Floats, room: Floats, q_nb: Floats, bias: Floats, cov: Floats,
) -> None:  # fmt: skip
    """Attitude (N, 4), bias (N, 3) and covariance in navigation axes (N, 3, 3); `room` is (6, 6)."""
    state, h, gain, turned = room[0], room[1], room[2], room[3:]
    for i in range(t.shape[0]):
        dt = t[i] - t[i - 1] if i > 0 else 0.0
        step = dt if dt > 0.0 else first_step
        for k in range(SIZE):
            state[k] = 0.0
        step_time(x, p, state, gain, turned, noise, dt, step, gyr[i, 0], gyr[i, 1], gyr[i, 2])
        see_gravity(x, p, state, h, gain, noise, up, step, acc[i, 0], acc[i, 1], acc[i, 2])
        see_field(x, p, state, h, gain, noise, north, step, mag[i, 0], mag[i, 1], mag[i, 2])
        inject(x, state)
        for k in range(4):
            q_nb[i, k] = x[Q + k]
        for j in range(3):
            bias[i, j] = x[BIAS + j]
            for k in range(3):
                cov[i, j, k] = p[j, k]


@kernel
def propagate(p: Floats, turned: Floats, spread: float, walk: float) -> None:
    """Covariance after a step in which the bias turns the attitude by `turned` (3, 3)."""
    for j in range(3):  # the upper right block first, for the upper left needs the old one
        for k in range(j, 3):
            change = 0.0
            for m in range(3):
                change += turned[j, m] * p[3 + m, k] + p[j, 3 + m] * turned[k, m]
                for n in range(3):
                    change += turned[j, m] * p[3 + m, 3 + n] * turned[k, n]
            p[j, k] += change
            if j != k:
                p[k, j] = p[j, k]
    for j in range(3):
        for k in range(3):
            change = 0.0
            for m in range(3):
                change += turned[j, m] * p[3 + m, 3 + k]
            p[j, 3 + k] += change
    for j in range(3):
        p[j, j] += spread
        p[3 + j, 3 + j] += walk
        for k in range(3):
            p[3 + k, j] = p[j, 3 + k]


def track_directions(imu: ImuData, frame: Frame, params: Params) -> AttitudeTrack:
    """Attitude at every sample of a virtual unit, each from the samples before it.

    Headings are true where the recording knows its declination, and magnetic where it does not.
    """
    count, declination = len(imu), imu.meta.declination
    angle = declination or 0.0
    north = math.cos(angle) * frame.north + math.sin(angle) * frame.east
    q_nb, bias, cov = np.empty((count, 4)), np.empty((count, 3)), np.empty((count, 3, 3))
    gyr, acc, mag = (np.ascontiguousarray(imu.usable(name)) for name in ("gyr", "acc", "mag"))
    step = float(np.median(np.diff(imu.t))) if count > 1 else 1.0 / (imu.meta.rate_nominal or 100.0)
    x = np.zeros(STATE)
    x[Q] = 1.0
    run(
        imu.t, gyr, acc, mag, np.array(params, dtype=np.float64), float(frame.up[2]), np.array(north[:2]), step,
        x, np.zeros((SIZE, SIZE)), np.zeros((SIZE, SIZE)), q_nb, bias, cov,
    )  # fmt: skip
    c_nb = dcm_from_quat(q_nb)
    cov_b = np.swapaxes(c_nb, 1, 2) @ cov @ c_nb
    cov_b = 0.5 * (cov_b + np.swapaxes(cov_b, 1, 2))
    zero = North.FREE if x[STAGE] < 2.0 else North.MAGNETIC if declination is None else North.TRUE
    return AttitudeTrack(
        t=imu.t, q_nb=q_nb, frame=frame, north=zero, bias_b=bias, cov_b=cov_b, flags=imu.flags, source=NAME
    )
