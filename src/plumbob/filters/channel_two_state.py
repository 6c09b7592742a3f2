"""Kalman filter of one rate channel with two states, rate and angular acceleration: the scalar filter without its lag.

The angular acceleration is taken for a random walk, so a rate that grows evenly is followed without any error, and only
a change of the acceleration is followed late. Like every filter of one channel it knows nothing of the bias.

When to choose it: for a quiet rate of a body that speeds up and slows down, such as a turntable's.

=========  =============  =======  ================================================================
symbol     name           unit     meaning
=========  =============  =======  ================================================================
ω          x[RATE]        rad/s    rate
α          x[ACC]         rad/s²   angular acceleration
P          x[P00] …       –        their covariance: P00, P01, P11
q          jerk           rad/s²   √q of one second: how far the angular acceleration wanders in it
R          noise          rad/s    √R: noise of one sample
=========  =============  =======  ================================================================

F = [1 dt; 0 1] and Q = q [dt³/3 dt²/2; dt²/2 dt]: a white jerk of constant density q, integrated over the step exactly
[BarShalom2001] sec. 6.2.2 (there of position and velocity), so steps may be uneven. While samples are missing the rate
goes on with its last acceleration.

Departures from [Chen2013]: the second state. The paper's one-state filter is `channel_scalar`.
"""

import math
from typing import Annotated, Final, NamedTuple

from plumbob.core.check import Floats
from plumbob.core.kernels import kernel
from plumbob.core.params import Spec
from plumbob.core.units import Quantity, deg, dps
from plumbob.filters.layout import BLIND, LEVEL, OWN, RATE, STAGE

SUMMARY: Final = "Kalman filter of each rate and its angular acceleration, without lag on a ramp"
REFERENCES: Final = ("BarShalom2001", "Chen2013")
NEEDS: Final = ("gyr",)

DENSITY: Final = 0
R: Final = 1
START: Final = 2

ACC: Final = OWN
P00: Final = OWN + 1
P01: Final = OWN + 2
P11: Final = OWN + 3


class Params(NamedTuple):
    """What the filter takes the channel for."""

    jerk: Annotated[
        float,
        Spec(
            Quantity.ANGULAR_ACCELERATION,
            "how far the angular acceleration wanders in one second, 1 σ; raise it to follow its changes faster",
            0,
            1e4,
        ),
    ] = deg(0.05)
    noise: Annotated[float, Spec(Quantity.RATE, "noise of one sample, 1 σ; raise it to smooth more", 1e-9, 1e3)] = dps(
        0.1
    )
    start: Annotated[
        float, Spec(Quantity.ANGULAR_ACCELERATION, "how large the angular acceleration is at first, 1 σ", 0, 1e4)
    ] = deg(10.0)


def coefficients(params: Params) -> tuple[float, ...]:
    """Coefficients of the kernel."""
    return params.jerk**2, params.noise**2, params.start**2


def own_state(params: Params) -> int:
    """How many own numbers evolve."""
    return 4


@kernel
def predict(c: Floats, x: Floats, dt: float) -> None:
    """Carry state and covariance over a step."""
    x[RATE] += dt * x[ACC]
    x[P00] += dt * (2.0 * x[P01] + dt * x[P11]) + c[DENSITY] * dt * dt * dt / 3.0  # [BarShalom2001] sec. 6.2.2
    x[P01] += dt * x[P11] + c[DENSITY] * dt * dt / 2.0
    x[P11] += c[DENSITY] * dt


@kernel
def correct(c: Floats, x: Floats, y: float) -> None:
    """Take up a measured rate."""
    innovation, variance = y - x[RATE], x[P00] + c[R]
    k0, k1 = x[P00] / variance, x[P01] / variance  # [BarShalom2001] sec. 5.2.3
    x[RATE] += k0 * innovation
    x[ACC] += k1 * innovation
    x[P11] -= k1 * x[P01]
    x[P01] *= 1.0 - k0
    x[P00] *= 1.0 - k0


@kernel
def step(c: Floats, x: Floats, dt: float, y: float) -> None:
    """Take one sample; one that is missing is only predicted."""
    if x[STAGE] == BLIND:
        if not math.isnan(y):
            x[RATE], x[ACC], x[STAGE] = y, 0.0, LEVEL
            x[P00], x[P01], x[P11] = c[R], 0.0, c[START]
        return
    predict(c, x, dt)
    if not math.isnan(y):
        correct(c, x, y)
