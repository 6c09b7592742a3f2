"""The small filter behind an array: attitude and the bias of the mean rate, from the directions of gravity and field.

A multiplicative extended Kalman filter of six states, ``q_true = exp(θ) ⊗ q`` in the navigation frame, with the noise of
the cards and nothing else: it takes each specific force as gravity and each field as the Earth's, both with white noise.
With the trackers of each unit's parity it is the full filter of an array with a bias for each unit, where they are
equal. While the mean rate is nothing but noise and what the bias may be, the body rests: the attitude stays, and the
rate is the bias. What misses the size of gravity, or of the mean field, counts as noise too.

When to choose it: an array that turns slowly in a field that nothing disturbs, as the teaching arm's. Where the body
accelerates or the field is bent, the project's other filters and the smoother are better.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core._jit import njit
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import dps
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.cards import NoiseCard
from plumbob.filters.start import angle_to, has_heading, level, turn_about_vertical
from plumbob.rotations import Frame, North, dcm_from_quat
from plumbob.rotations.kernels import quat_exp, quat_mul, quat_unit, rotate, rows

NAME: Final = "directions"
SIZE: Final = 6
REST_TAU: Final = 1.0
"""The rate is averaged over this, s, to tell whether the body rests,"""
REST: Final = 16.0
"""and rests where its square stays below so many variances: a turn that nobody could tell from rest."""
TREMOR: Final = 0.1
"""What still moves at rest, as a share of the gyroscope's noise."""


class Params(NamedTuple):
    """Noise of the virtual unit, SI."""

    gyr_noise: float = dps(0.01)
    gyr_walk: float = dps(0.001)
    bias_start: float = dps(0.5)
    acc_noise: float = 0.003
    mag_noise: float = 0.1


def params_of(noise: NoiseCard | None, bias_start: float) -> Params:
    """Parameters from the card of a virtual unit, and the standard deviation of its bias."""
    found = Params(bias_start=bias_start)
    if noise is None:
        return found
    known = {f"{name}_noise": one.n_rms for name in ("gyr", "acc", "mag") if (one := getattr(noise, name)) is not None}
    if noise.gyr is not None and noise.gyr.k_rms > 0.0:
        known["gyr_walk"] = noise.gyr.k_rms
    return found._replace(**{name: value for name, value in known.items() if value > 0.0})


@njit
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


@njit
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


@njit
def at_rest(p: Floats, var: float, r0: float, r1: float, r2: float) -> bool:
    """True where a mean rate, of this variance and less the bias, is nothing but noise and what the bias may still be."""
    return (
        r0 * r0 < REST * (var + p[3, 3]) and r1 * r1 < REST * (var + p[4, 4]) and r2 * r2 < REST * (var + p[5, 5])
    )


@njit
def run(
    t: Floats, gyr: Floats, acc: Floats, mag: Floats, noise: Floats, up: float, north: Floats,
    p: Floats, q_nb: Floats, bias: Floats, cov: Floats, headed: NDArray[np.bool_],
) -> None:  # fmt: skip
    """Attitude (N, 4), bias (N, 3) and covariance in navigation axes (N, 3, 3); `p` (6, 6) is room to work in."""
    q0, q1, q2, q3 = 1.0, 0.0, 0.0, 0.0
    b0 = b1 = b2 = 0.0
    state, h, gain, turned = np.zeros(SIZE), np.zeros(3), np.zeros(SIZE), np.zeros((3, 3))
    stage, looks, level_mean, down_mean, last = 0, 0.0, 0.0, 0.0, t[0]
    w0 = w1 = w2 = m0 = m1 = m2 = mean_var = 0.0
    for i in range(t.shape[0]):
        dt = t[i] - last
        last = t[i]
        if not (math.isnan(gyr[i, 0]) or math.isnan(gyr[i, 1]) or math.isnan(gyr[i, 2])):
            w0, w1, w2 = gyr[i, 0], gyr[i, 1], gyr[i, 2]
            spread = noise[0] * noise[0] * dt
        else:
            spread = 1.0 * dt  # the last rate goes on
        step = dt if dt > 0.0 else (t[1] - t[0] if t.shape[0] > 1 else 0.01)
        mix = 1.0 if i == 0 else 1.0 - math.exp(-step / REST_TAU)
        mean_var = (1.0 - mix) * (1.0 - mix) * mean_var + mix * mix * noise[0] * noise[0] / step
        m0, m1, m2 = m0 + mix * (w0 - m0), m1 + mix * (w1 - m1), m2 + mix * (w2 - m2)
        rests = stage > 0 and at_rest(p, mean_var, m0 - b0, m1 - b1, m2 - b2)
        for k in range(SIZE):
            state[k] = 0.0
        if rests and dt > 0.0:  # the attitude stays, and the rate is the bias
            var = noise[0] * noise[0] / step
            for k in range(SIZE):
                p[k, k] += (TREMOR * TREMOR * noise[0] * noise[0] if k < 3 else noise[1] * noise[1]) * dt
            if spread < dt:
                update_bias(p, state, 0, w0 - b0, var, gain)
                update_bias(p, state, 1, w1 - b1, var, gain)
                update_bias(p, state, 2, w2 - b2, var, gain)
        elif stage > 0 and dt > 0.0:
            r = rows(q0, q1, q2, q3)
            e0, e1, e2, e3 = quat_exp(dt * (w0 - b0), dt * (w1 - b1), dt * (w2 - b2))
            q0, q1, q2, q3 = quat_mul(q0, q1, q2, q3, e0, e1, e2, e3)
            q0, q1, q2, q3 = quat_unit(q0, q1, q2, q3)
            for j in range(3):
                for k in range(3):
                    turned[j, k] = -dt * r[3 * j + k]
            propagate(p, turned, spread, noise[1] * noise[1] * dt)
        a0, a1, a2 = acc[i, 0], acc[i, 1], acc[i, 2]
        size = math.sqrt(a0 * a0 + a1 * a1 + a2 * a2)
        if size > 0.0:  # not where it is NaN
            var = noise[3] * noise[3] / step
            if stage == 0:
                q0, q1, q2, q3 = level(up, a0 / size, a1 / size, a2 / size)
                p[0, 0] = p[1, 1] = var / (G0 * G0)
                p[2, 2] = 3.0
                for k in range(3, SIZE):
                    p[k, k] = noise[2] * noise[2]
                stage = 1
            else:
                f0, f1, _ = rotate(q0, q1, q2, q3, a0, a1, a2)
                var += (size - G0) * (size - G0)
                h[0], h[1], h[2] = 0.0, -G0 * up, 0.0
                update(p, state, h, f0, var, gain)
                h[0], h[1] = G0 * up, 0.0
                update(p, state, h, f1, var, gain)
        h0, h1, h2 = rotate(q0, q1, q2, q3, mag[i, 0], mag[i, 1], mag[i, 2])
        if stage > 0 and has_heading(h0, h1, h2):
            var = noise[4] * noise[4] / step
            wide = math.sqrt(h0 * h0 + h1 * h1)
            if stage == 1:
                q0, q1, q2, q3 = turn_about_vertical(angle_to(h0, h1, north[0], north[1]), q0, q1, q2, q3)
                tilt = p[0, 0]
                for j in range(3):
                    p[2, j] = p[j, 2] = 0.0
                p[2, 2] = (var + h2 * h2 * tilt) / (wide * wide)
                for j in range(2):
                    p[2, j] = p[j, 2] = h2 / wide * north[j] * tilt
                stage, looks, level_mean, down_mean = 2, 1.0, wide, h2
            else:
                looks += 1.0
                level_mean += (wide - level_mean) / min(looks, 1000.0)
                down_mean += (h2 - down_mean) / min(looks, 1000.0)
                var += (wide - level_mean) * (wide - level_mean) if abs(wide - level_mean) > 4.0 * math.sqrt(var) else 0.0
                h[0], h[1], h[2] = down_mean * north[0], down_mean * north[1], -level_mean
                update(p, state, h, north[0] * h1 - north[1] * h0, var, gain)
        e0, e1, e2, e3 = quat_exp(state[0], state[1], state[2])
        q0, q1, q2, q3 = quat_mul(e0, e1, e2, e3, q0, q1, q2, q3)
        q0, q1, q2, q3 = quat_unit(q0, q1, q2, q3)
        b0 += state[3]
        b1 += state[4]
        b2 += state[5]
        q_nb[i, 0], q_nb[i, 1], q_nb[i, 2], q_nb[i, 3] = q0, q1, q2, q3
        bias[i, 0], bias[i, 1], bias[i, 2] = b0, b1, b2
        headed[i] = stage == 2
        for j in range(3):
            for k in range(3):
                cov[i, j, k] = p[j, k]


@njit
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

    Parameters
    ----------
    imu : ImuData
        Virtual unit, body axes.
    frame : Frame
        Navigation frame of the result.
    params : Params
        Its noise.
    """
    count, declination = len(imu), imu.meta.declination
    angle = declination or 0.0
    north = math.cos(angle) * frame.north + math.sin(angle) * frame.east
    q_nb, bias, cov = np.empty((count, 4)), np.empty((count, 3)), np.empty((count, 3, 3))
    headed = np.zeros(count, dtype=bool)
    gyr, acc, mag = (np.ascontiguousarray(imu.usable(name)) for name in ("gyr", "acc", "mag"))
    run(
        imu.t, gyr, acc, mag, np.array(params, dtype=np.float64), float(frame.up[2]), np.array(north[:2]),
        np.zeros((SIZE, SIZE)), q_nb, bias, cov, headed,
    )  # fmt: skip
    c_nb = dcm_from_quat(q_nb)
    cov_b = np.swapaxes(c_nb, 1, 2) @ cov @ c_nb
    cov_b = 0.5 * (cov_b + np.swapaxes(cov_b, 1, 2))
    zero = North.FREE if not headed.any() else North.MAGNETIC if declination is None else North.TRUE
    return AttitudeTrack(
        t=imu.t, q_nb=q_nb, frame=frame, north=zero, bias_b=bias, cov_b=cov_b, flags=imu.flags, source=NAME
    )
