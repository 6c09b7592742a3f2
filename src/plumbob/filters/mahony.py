"""PI complementary filter with a norm gate: the drifting-buoy paper's filter, in the form of [Mahony2008].

Gravity and the magnetic field, as the present attitude predicts them in body axes, are compared with the measured
directions; the vector products are fed back to the rate with a proportional gain, and to a bias with an integral gain.

This is the direct form with vector measurements, [Mahony2008] (48), and not the passive filter on a reconstructed
attitude. It has no start-up gain ramp and no limit on the bias, as the buoy paper has none.

When to choose it: to reproduce the paper, or where code must fit in a small controller. The paper's Kp = 0.5 1/s is
about ten times too high for a buoy in waves: its corner lies at 0.08 Hz, just below the swell.

=========  ==========  =======  =====================================================
symbol     name        unit     meaning
=========  ==========  =======  =====================================================
q          x[Q]        1        attitude q_nb
b          x[BIAS]     rad/s    gyroscope bias, minus the integral term of the paper
Kp         kp          1/s      proportional gain, rad/s per rad
Ki         ki          1/s²     integral gain
ε          gate        m/s²     largest difference of the specific force from g
=========  ==========  =======  =====================================================

Departures from [Yu2018]: signs and indices of its equation (3) corrected; q is normalised after every step; e is the
vector sum of the two vector products, not of their moduli; ε carries its unit (as the reported reduction fits ε in g).
The magnetic reference is the measured field turned level and to north, so a dip angle is not needed. [Mahony2008] §V
"""

import math
from typing import Annotated, Final, NamedTuple

from plumbob import flags
from plumbob._jit import njit
from plumbob.check import Floats
from plumbob.constants import G0
from plumbob.filters.admission import admit, usable
from plumbob.filters.alignment import initialise, up_in_body
from plumbob.filters.layout import BIAS, HEADED, NORTH_X, NORTH_Y, OWN_C, STAGE, UP, Q
from plumbob.params import Spec
from plumbob.rotations.kernels import Vec, cross, quat_mul, quat_unit, rotate
from plumbob.units import Quantity

SUMMARY: Final = "PI complementary filter with a norm gate (drifting-buoy paper; Mahony 2008)"
REFERENCES: Final = ("Mahony2008", "Yu2018")
NEEDS: Final = ("gyr", "acc")
STATE: Final = 0

KP: Final = OWN_C
KI: Final = OWN_C + 1
GATE: Final = OWN_C + 2


class Params(NamedTuple):
    """Gains of the PI regulator and the accelerometer's gate; the defaults are the buoy paper's."""

    kp: Annotated[float, Spec(Quantity.GAIN, "proportional gain; lower it where the body accelerates", 0, 100)] = 0.5
    ki: Annotated[float, Spec(Quantity.GAIN_RATE, "integral gain, learns the gyroscope bias; 0: none", 0, 100)] = 0.03
    gate: Annotated[
        float | None,
        Spec(Quantity.ACCELERATION, "use the accelerometer only where its norm is this near g; off: always", 0, 1e3),
    ] = 0.08 * G0


def coefficients(params: Params) -> tuple[float, ...]:
    """Own coefficients of the kernel."""
    return params.kp, params.ki, math.inf if params.gate is None else params.gate


@njit
def tilt_error(c: Floats, x: Floats, ax: float, ay: float, az: float) -> tuple[int, float, float, float]:
    """Turn that would bring the predicted up direction onto the specific force; zero and a flag where it is gated."""
    if not usable(ax, ay, az):
        return flags.ACC_GATED, 0.0, 0.0, 0.0
    norm = math.sqrt(ax * ax + ay * ay + az * az)
    if not abs(norm - G0) <= c[GATE]:  # [Yu2018] (15)
        return flags.ACC_GATED, 0.0, 0.0, 0.0
    ux, uy, uz = up_in_body(c[UP], x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    ex, ey, ez = cross(ax, ay, az, ux, uy, uz)  # [Mahony2008] (48c)
    scale = 1.0 / norm
    return 0, scale * ex, scale * ey, scale * ez


@njit
def field_error(c: Floats, x: Floats, mx: float, my: float, mz: float) -> tuple[int, float, float, float]:
    """Turn that would bring the predicted field direction onto the measured one; zero and a flag where it is absent."""
    if not usable(mx, my, mz):
        return flags.MAG_GATED, 0.0, 0.0, 0.0
    q0, q1, q2, q3 = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    hx, hy, hz = rotate(q0, q1, q2, q3, mx, my, mz)
    level = math.sqrt(hx * hx + hy * hy)
    bx, by, bz = rotate(q0, -q1, -q2, -q3, level * c[NORTH_X], level * c[NORTH_Y], hz)
    ex, ey, ez = cross(mx, my, mz, bx, by, bz)  # [Mahony2008] (48c)
    scale = 1.0 / (mx * mx + my * my + mz * mz)
    return 0, scale * ex, scale * ey, scale * ez


@njit
def regulate(c: Floats, x: Floats, dt: float, ex: float, ey: float, ez: float) -> Vec:
    """Correction of the rate by the PI law, and the bias that it learns."""
    x[BIAS] -= c[KI] * dt * ex  # [Yu2018] (7)
    x[BIAS + 1] -= c[KI] * dt * ey
    x[BIAS + 2] -= c[KI] * dt * ez
    return c[KP] * ex - x[BIAS], c[KP] * ey - x[BIAS + 1], c[KP] * ez - x[BIAS + 2]


@njit
def integrate(x: Floats, dt: float, wx: float, wy: float, wz: float) -> None:
    """First-order step of the quaternion, normalised."""
    half = 0.5 * dt
    d0, d1, d2, d3 = quat_mul(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], 0.0, half * wx, half * wy, half * wz)  # [Yu2018] (3)
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = quat_unit(x[Q] + d0, x[Q + 1] + d1, x[Q + 2] + d2, x[Q + 3] + d3)


@njit
def step(
    c: Floats, x: Floats, dt: float,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float, mx: float, my: float, mz: float,
) -> int:  # fmt: skip
    """Take one sample."""
    found, dt, gx, gy, gz = admit(c, x, dt, gx, gy, gz)
    if found & flags.TIME_FAULT:
        return found
    if x[STAGE] < HEADED:
        found |= initialise(c, x, ax, ay, az, mx, my, mz)
    acc_flag, tx, ty, tz = tilt_error(c, x, ax, ay, az)
    mag_flag, fx, fy, fz = field_error(c, x, mx, my, mz)
    px, py, pz = regulate(c, x, dt, tx + fx, ty + fy, tz + fz)
    integrate(x, dt, gx + px, gy + py, gz + pz)
    return found | acc_flag | mag_flag
