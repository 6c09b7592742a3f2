"""Gyroscope integration by the exact exponential, with the coning term; no correction.

The rate between two samples is a parabola through the last three (a straight line after the start, a gap or a jump of
the step). Its integral and the first non-commuting term, [Bortz1971] (4), make the rotation vector of the step:
``∫ω dt + Δt²/12 (ω₀×ω₁)``. A straight line alone would drift under coning, because the error of the trapezoidal rule
turns with the body: 0.5° in ten minutes at 5°, 1 Hz and 100 Hz sampling, against 0.0007° here.

For rates that are already means over the step (a sensor that gives angle increments) choose ``mean_rate=on``: the last
sample alone then spans the step, with the coning term of neighbouring increments.

What a calibration card leaves of the gyroscope's errors grows with time and turning: with ``δ = d + E ω`` the attitude
is off by ``∫ R δ dt`` since the start, and where an axis is read late by τ_i, by ``∫ R τ_i ω̇_i e_i dt``, which grows as
``−τ_i ∫ R (ω × e_i) ω_i dt``. The claim counts that and nothing else: no noise, and no error of the start.

When to choose it: to see what the gyroscope alone can do, for short manoeuvres, and as the truth of other integrators.

Departures from [Bortz1971]: the non-commuting integral is cut after its first term.
"""

from typing import Annotated, Final, NamedTuple

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.kernels import kernel
from plumbob.core.params import Spec
from plumbob.core.units import Quantity
from plumbob.filters.input_checks import admit
from plumbob.filters.layout import HEADED, OWN, OWN_C, RATE, STAGE, Q
from plumbob.filters.start import initialise
from plumbob.rotations.kernels import Vec, cross, quat_exp, quat_mul, quat_unit, rotate

SUMMARY: Final = "gyroscope integration, exact exponential with coning term"
REFERENCES: Final = ("Bortz1971",)
NEEDS: Final = ("gyr",)
STATE: Final = 49

MEAN_RATE: Final = OWN_C
OLDER: Final = OWN  # rate of the sample before the last, rad/s, 3
STEP: Final = OWN + 3  # step between those two, s; 0 where there is none
# ∫ R (I, ωᵀ ⊗ I, [ω]× diag ω) dt, row by row of R: how the attitude leans by d, E and τ in navigation axes, 3 × 15
LEAN: Final = OWN + 4
SENSITIVITY: Final = slice(LEAN, LEAN + 45)


class Params(NamedTuple):
    """How to read a rate sample."""

    mean_rate: Annotated[
        bool, Spec(Quantity.RATIO, "a sample is the mean rate since the one before, not the rate at its time")
    ] = False


def coefficients(params: Params) -> tuple[float, ...]:
    """Own coefficients of the kernel."""
    return (1.0 if params.mean_rate else 0.0,)


@kernel
def increment(x: Floats, dt: float, px: float, py: float, pz: float, gx: float, gy: float, gz: float) -> Vec:
    """Integral of the rate over a step dt that begins at p and ends at g, rad; the sample before p bends it."""
    before = x[STEP]
    if not 0.0 < dt < 2.0 * before:  # a parabola may not be stretched far beyond its points
        half = 0.5 * dt
        return half * (px + gx), half * (py + gy), half * (pz + gz)
    # Integral over [0, dt] of the parabola through the rates at −before, 0 and dt
    old = -dt * dt * dt / (6.0 * before * (before + dt))
    new = dt * (dt / 3.0 + 0.5 * before) / (before + dt)
    mid = dt - old - new
    return (
        old * x[OLDER] + mid * px + new * gx,
        old * x[OLDER + 1] + mid * py + new * gy,
        old * x[OLDER + 2] + mid * pz + new * gz,
    )


@kernel
def turn(x: Floats, rx: float, ry: float, rz: float) -> None:
    """Turn the attitude by a rotation vector in body axes."""
    e0, e1, e2, e3 = quat_exp(rx, ry, rz)
    q0, q1, q2, q3 = quat_mul(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], e0, e1, e2, e3)
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = quat_unit(q0, q1, q2, q3)


@kernel
def lean(x: Floats, dt: float, rx: float, ry: float, rz: float) -> None:
    """Add what errors of the rates turn in a step by r: constant ones, those in proportion, and axes that are late."""
    for i in range(3):
        wx, wy, wz = (1.0 if i == 0 else 0.0), (1.0 if i == 1 else 0.0), (1.0 if i == 2 else 0.0)
        nx, ny, nz = rotate(x[Q], -x[Q + 1], -x[Q + 2], -x[Q + 3], wx, wy, wz)  # row i of R
        at = LEAN + 15 * i
        for j in range(3):
            entry = nx if j == 0 else ny if j == 1 else nz
            x[at + j] += dt * entry
            x[at + 3 + 3 * j] += rx * entry
            x[at + 4 + 3 * j] += ry * entry
            x[at + 5 + 3 * j] += rz * entry
        if dt > 0.0:
            ax, ay, az = cross(nx, ny, nz, rx, ry, rz)  # R (ω × e_j), row i
            x[at + 12] += ax * rx / dt
            x[at + 13] += ay * ry / dt
            x[at + 14] += az * rz / dt


def sensitivity(q_nb: Floats, entries: Floats) -> Floats:
    """How the attitude error in body axes answers to d, E and τ of the gyroscope, row by row, (N, 3, 15)."""
    from plumbob.rotations import dcm_from_quat

    turned: Floats = np.swapaxes(dcm_from_quat(q_nb), 1, 2) @ entries.reshape(-1, 3, 15)
    return turned


@kernel
def step(
    c: Floats, x: Floats, dt: float, flags_in: int,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float, mx: float, my: float, mz: float,
) -> int:  # fmt: skip
    """Take one sample; accelerometer and magnetometer only give the start."""
    px, py, pz = x[RATE], x[RATE + 1], x[RATE + 2]
    word, dt, gx, gy, gz = admit(c, x, dt, gx, gy, gz)
    if c[MEAN_RATE] != 0.0:
        rx, ry, rz = dt * gx, dt * gy, dt * gz
    else:
        rx, ry, rz = increment(x, dt, px, py, pz, gx, gy, gz)
    kx, ky, kz = cross(px, py, pz, gx, gy, gz)
    twelfth = dt * dt / 12.0
    lean(x, dt, rx, ry, rz)
    turn(x, rx + twelfth * kx, ry + twelfth * ky, rz + twelfth * kz)  # [Bortz1971] (4)
    x[OLDER], x[OLDER + 1], x[OLDER + 2], x[STEP] = px, py, pz, dt
    if x[STAGE] < HEADED:
        word |= initialise(c, x, ax, ay, az, mx, my, mz)
    return word
