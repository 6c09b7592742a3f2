"""Classic complementary filter: the gyroscope for what is fast, accelerometer and compass for what is slow.

At each sample the gyroscope turns the attitude on. Then the tilt goes the share ``w = 1 − exp(−Δt/τ)`` of the way to
what the accelerometer shows, and the heading its own share of the way to what the compass shows. About one axis this is
the filter that everybody knows, ``θ ← (1 − w)(θ + ωΔt) + w θₐ``: a high-pass for the gyroscope and a low-pass for the
other sensors with one time constant τ, which together pass the angle unchanged. [Higgins1975] shows that it is the
steady state of a Kalman filter.

The share depends on the step alone: two steps of 5 ms do what one of 10 ms does. A weight of 0.98 at 100 Hz, as it is
often written, means τ = 0.5 s, and another τ at any other rate.

It learns no bias: a bias b of the gyroscope about a level axis leaves a tilt error of b τ. It has no gate either: what
accelerates for longer than τ tilts it. Where that matters take ``mahony``, or a Kalman filter.

When to choose it: a first filter with two parameters whose meaning is plain, for bodies that are mostly at rest or
turn faster than they accelerate.

=========  ===========  =======  =====================================================
symbol     name         unit     meaning
=========  ===========  =======  =====================================================
q          x[Q]         1        attitude q_nb
τ          tau_tilt     s        time constant of roll and pitch
τ          tau_heading  s        time constant of the heading
=========  ===========  =======  =====================================================

Departures from [Higgins1975] and from the textbook: what is blended is a quaternion, turned along the shortest arc, and
not Euler angles one by one, so that there is no singularity at pitch 90°, no jump between +180° and −180°, and body
rates are not taken for rates of Euler angles. The compass is levelled with the blended tilt, which is steadier than the
accelerometer's. The rate between two samples is taken as a straight line.
"""

import math
from typing import Annotated, Final, NamedTuple

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.kernels import kernel
from plumbob.core.params import Spec
from plumbob.core.units import Quantity
from plumbob.filters.input_checks import admit, refused, usable
from plumbob.filters.integrate import turn
from plumbob.filters.layout import HEADED, OWN_C, RATE, STAGE, UP, Q
from plumbob.filters.start import heading_offset, initialise, turn_about_vertical, up_in_body
from plumbob.rotations.kernels import Vec, cross, quat_unit

SUMMARY: Final = "classic complementary filter, time constants for tilt and heading"
REFERENCES: Final = ("Higgins1975",)
NEEDS: Final = ("gyr", "acc")
STATE: Final = 0

TAU_TILT: Final = OWN_C
TAU_HEADING: Final = OWN_C + 1


class Params(NamedTuple):
    """Time constants: what is faster comes from the gyroscope, what is slower from the other sensors."""

    tau_tilt: Annotated[
        float, Spec(Quantity.TIME, "time constant of roll and pitch; raise it where the body accelerates", 1e-3, 1e6)
    ] = 5.0
    tau_heading: Annotated[
        float, Spec(Quantity.TIME, "time constant of the heading; raise it where iron disturbs the field", 1e-3, 1e6)
    ] = 15.0


def coefficients(params: Params) -> tuple[float, ...]:
    """Own coefficients of the kernel."""
    return params.tau_tilt, params.tau_heading


@kernel
def share(dt: float, tau: float) -> float:
    """Part of a difference that goes within a step dt, where it decays with the time constant τ."""
    return -math.expm1(-dt / tau)  # [Higgins1975]: the gain of the steady state


@kernel
def predict(x: Floats, dt: float, px: float, py: float, pz: float, gx: float, gy: float, gz: float) -> None:
    """Turn the attitude by a rate that goes straight from p to g within the step."""
    half = 0.5 * dt
    turn(x, half * (px + gx), half * (py + gy), half * (pz + gz))


@kernel
def arc(sx: float, sy: float, sz: float, ux: float, uy: float, uz: float) -> Vec:
    """Shortest turn of the body, rad, that brings the unit vector u in its axes onto the direction s.

    Zero where they are exactly opposite: no axis is better than another, and noise soon decides.
    """
    rx, ry, rz = cross(sx, sy, sz, ux, uy, uz)
    sine = math.sqrt(rx * rx + ry * ry + rz * rz)
    if not sine > 0.0:
        return 0.0, 0.0, 0.0
    scale = math.atan2(sine, sx * ux + sy * uy + sz * uz) / sine
    return scale * rx, scale * ry, scale * rz


@kernel
def correct_tilt(c: Floats, x: Floats, dt: float, ax: float, ay: float, az: float) -> int:
    """Go part of the way to the accelerometer's tilt; a flag where it has none. The heading stays."""
    if not usable(ax, ay, az):
        return refused(flags.ACC_GATED, ax, ay, az)
    ux, uy, uz = up_in_body(c[UP], x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    rx, ry, rz = arc(ax, ay, az, ux, uy, uz)
    w = share(dt, c[TAU_TILT])
    turn(x, w * rx, w * ry, w * rz)  # departs from [Higgins1975]: along the shortest arc, not by Euler angles
    return 0


@kernel
def correct_heading(c: Floats, x: Floats, dt: float, mx: float, my: float, mz: float) -> int:
    """Go part of the way to the compass heading; a flag where there is none. The tilt stays."""
    if not usable(mx, my, mz):
        return refused(flags.MAG_GATED, mx, my, mz)
    headed, angle = heading_offset(c, x[Q], x[Q + 1], x[Q + 2], x[Q + 3], mx, my, mz)
    if not headed:
        return flags.MAG_GATED
    w = share(dt, c[TAU_HEADING])
    q0, q1, q2, q3 = turn_about_vertical(w * angle, x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = quat_unit(q0, q1, q2, q3)
    return 0


@kernel
def step(
    c: Floats, x: Floats, dt: float, flags_in: int,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float, mx: float, my: float, mz: float,
) -> int:  # fmt: skip
    """Take one sample."""
    px, py, pz = x[RATE], x[RATE + 1], x[RATE + 2]
    word, dt, gx, gy, gz = admit(c, x, dt, gx, gy, gz)
    predict(x, dt, px, py, pz, gx, gy, gz)
    if x[STAGE] < HEADED:
        word |= initialise(c, x, ax, ay, az, mx, my, mz)
    word |= correct_tilt(c, x, dt, ax, ay, az)
    return word | correct_heading(c, x, dt, mx, my, mz)
