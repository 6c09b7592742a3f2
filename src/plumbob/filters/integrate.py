"""Gyroscope integration by the exact exponential, with the coning term; no correction.

Between two samples the rate is taken to change linearly. Its rotation vector is then the mean rate times the step plus
the first non-commuting term, [Bortz1971] (4) for a linear rate: ``Δt (ω₀+ω₁)/2 + Δt² (ω₀×ω₁)/12``. For rates that are
already means over the step (a sensor that gives angle increments) choose ``mean_rate=on``: the last sample alone then
spans the step.

When to choose it: to see what the gyroscope alone can do, for short manoeuvres, and as the truth of other integrators.

Departures: none; the truncation error is of fourth order in the step.
"""

from typing import Annotated, Final, NamedTuple

from plumbob import flags
from plumbob._jit import njit
from plumbob.check import Floats
from plumbob.filters.admission import admit
from plumbob.filters.alignment import initialise
from plumbob.filters.layout import HEADED, OWN_C, RATE, STAGE, Q
from plumbob.filters.params import Spec
from plumbob.rotations.kernels import cross, quat_exp, quat_mul, quat_unit
from plumbob.units import Quantity

SUMMARY: Final = "gyroscope integration, exact exponential with coning term"
REFERENCES: Final = ("Bortz1971",)
NEEDS: Final = ("gyr",)
STATE: Final = 0

MEAN_RATE: Final = OWN_C


class Params(NamedTuple):
    """How to read a rate sample."""

    mean_rate: Annotated[
        bool, Spec(Quantity.RATIO, "a sample is the mean rate since the one before, not the rate at its time")
    ] = False


def coefficients(params: Params) -> tuple[float, ...]:
    """Own coefficients of the kernel."""
    return (1.0 if params.mean_rate else 0.0,)


@njit
def turn(x: Floats, dt: float, px: float, py: float, pz: float, gx: float, gy: float, gz: float) -> None:
    """Turn the attitude by rates that go linearly from p to g within the step."""
    kx, ky, kz = cross(px, py, pz, gx, gy, gz)
    half, twelfth = 0.5 * dt, dt * dt / 12.0
    e0, e1, e2, e3 = quat_exp(
        half * (px + gx) + twelfth * kx, half * (py + gy) + twelfth * ky, half * (pz + gz) + twelfth * kz
    )  # [Bortz1971] (4)
    q0, q1, q2, q3 = quat_mul(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], e0, e1, e2, e3)
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = quat_unit(q0, q1, q2, q3)


@njit
def step(
    c: Floats, x: Floats, dt: float,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float, mx: float, my: float, mz: float,
) -> int:  # fmt: skip
    """Take one sample; accelerometer and magnetometer only give the start."""
    px, py, pz = x[RATE], x[RATE + 1], x[RATE + 2]
    found, dt, gx, gy, gz = admit(c, x, dt, gx, gy, gz)
    if found & flags.TIME_FAULT:
        return found
    if c[MEAN_RATE] != 0.0:
        px, py, pz = gx, gy, gz
    turn(x, dt, px, py, pz, gx, gy, gz)
    if x[STAGE] < HEADED:
        found |= initialise(c, x, ax, ay, az, mx, my, mz)
    return found
