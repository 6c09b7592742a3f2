"""PI complementary filter with a norm gate: the drifting-buoy paper's filter, in the form of [Mahony2008].

Gravity and the magnetic field, as the present attitude predicts them in body axes, are compared with the measured
directions; the vector products are fed back to the rate with a proportional gain, and to a bias with an integral gain.

This is the direct form with vector measurements, [Mahony2008] (48), and not the passive filter on a reconstructed
attitude. There is no limit on the bias, as the buoy paper has none.

When to choose it: to reproduce the paper, or where code must fit in a small controller. The paper's Kp = 0.5 1/s is
about ten times too high for a buoy in waves: its corner lies at 0.08 Hz, just below the swell. With gains for waves
(Kp 0.05, Ki 0.001) a start in motion takes minutes to forget; ``quick_start=on`` shortens that.

=========  ==========  =======  =====================================================
symbol     name        unit     meaning
=========  ==========  =======  =====================================================
q          x[Q]        1        attitude q_nb
b          x[BIAS]     rad/s    gyroscope bias, minus the integral term of the paper
Kp         kp          1/s      proportional gain, rad/s per rad
Ki         ki          1/s²     integral gain
ε          gate        m/s²     largest difference of the specific force from g
t          x[ELAPSED]  s        time since tilt was first taken up
=========  ==========  =======  =====================================================

Departures from [Yu2018]: signs and indices of its equation (3) corrected; q is normalised after every step; e is the
vector sum of the two vector products, not of their moduli; ε carries its unit (as the reported reduction fits ε in g).
The magnetic reference is the measured field turned level and to north, so a dip angle is not needed. Added: the quick
start, off by default, which replaces Kp by 1/t (the gain that averages all looks at gravity and field since the start)
and Ki by 0 until 1/t has fallen to Kp.
"""

import math
from typing import Annotated, Final, NamedTuple

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.kernels import kernel
from plumbob.core.params import Spec
from plumbob.core.units import Quantity
from plumbob.filters.input_checks import admit, refused, usable
from plumbob.filters.layout import BIAS, BLIND, HEADED, NORTH_X, NORTH_Y, OWN, OWN_C, STAGE, UP, Q
from plumbob.filters.start import initialise, up_in_body
from plumbob.rotations.kernels import Vec, cross, quat_mul, quat_unit, rows

SUMMARY: Final = "PI complementary filter with a norm gate (drifting-buoy paper; Mahony 2008)"
REFERENCES: Final = ("Mahony2008", "Yu2018")
NEEDS: Final = ("gyr", "acc")
STATE: Final = 1

KP: Final = OWN_C
KI: Final = OWN_C + 1
GATE: Final = OWN_C + 2
QUICK: Final = OWN_C + 3
ELAPSED: Final = OWN


class Params(NamedTuple):
    """Gains of the PI regulator and the accelerometer's gate; the defaults are the buoy paper's."""

    kp: Annotated[float, Spec(Quantity.GAIN, "proportional gain; lower it where the body accelerates", 0, 100)] = 0.5
    ki: Annotated[float, Spec(Quantity.GAIN_RATE, "integral gain, learns the gyroscope bias; 0: none", 0, 100)] = 0.03
    gate: Annotated[
        float | None,
        Spec(Quantity.ACCELERATION, "use the accelerometer only where its norm is this near g; off: always", 0, 1e3),
    ] = 0.08 * G0
    quick_start: Annotated[
        bool,
        Spec(Quantity.RATIO, "average at first, with gain 1/t, until that has fallen to kp; for a start in motion"),
    ] = False


def coefficients(params: Params) -> tuple[float, ...]:
    """Own coefficients of the kernel."""
    gate = math.inf if params.gate is None else params.gate
    return params.kp, params.ki, gate, 1.0 if params.quick_start else 0.0


@kernel
def tilt_error(c: Floats, x: Floats, ax: float, ay: float, az: float) -> tuple[int, float, float, float]:
    """Turn that would bring the predicted up direction onto the specific force; zero and a flag where it is gated."""
    if not usable(ax, ay, az):
        return refused(flags.ACC_GATED, ax, ay, az), 0.0, 0.0, 0.0
    norm = math.sqrt(ax * ax + ay * ay + az * az)
    if not abs(norm - G0) <= c[GATE]:  # [Yu2018] (15)
        return flags.ACC_GATED, 0.0, 0.0, 0.0
    ux, uy, uz = up_in_body(c[UP], x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    ex, ey, ez = cross(ax, ay, az, ux, uy, uz)  # [Mahony2008] (48c)
    scale = 1.0 / norm
    return 0, scale * ex, scale * ey, scale * ez


@kernel
def field_error(c: Floats, x: Floats, mx: float, my: float, mz: float) -> tuple[int, float, float, float]:
    """Turn that would bring the predicted field direction onto the measured one; zero and a flag where it is absent."""
    if not usable(mx, my, mz):
        return refused(flags.MAG_GATED, mx, my, mz), 0.0, 0.0, 0.0
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rows(x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    hx, hy, hz = r00 * mx + r01 * my + r02 * mz, r10 * mx + r11 * my + r12 * mz, r20 * mx + r21 * my + r22 * mz
    level = math.sqrt(hx * hx + hy * hy)
    nx, ny = c[NORTH_X], c[NORTH_Y]
    lx, ly, lz = cross(mx, my, mz, nx * r00 + ny * r10, nx * r01 + ny * r11, nx * r02 + ny * r12)
    vx, vy, vz = cross(mx, my, mz, r20, r21, r22)
    scale = 1.0 / (mx * mx + my * my + mz * mz)
    # [Mahony2008] (48c): m × b with b = level · north + hz · z
    return 0, scale * (level * lx + hz * vx), scale * (level * ly + hz * vy), scale * (level * lz + hz * vz)


@kernel
def regulate(c: Floats, x: Floats, dt: float, ex: float, ey: float, ez: float) -> Vec:
    """Correction of the rate by the PI law, and the bias that it learns."""
    kp, ki = c[KP], c[KI]
    if c[QUICK] != 0.0:
        x[ELAPSED] += dt
        if x[ELAPSED] > 0.0 and kp * x[ELAPSED] < 1.0:
            kp, ki = 1.0 / x[ELAPSED], 0.0
    x[BIAS] -= ki * dt * ex  # [Yu2018] (7)
    x[BIAS + 1] -= ki * dt * ey
    x[BIAS + 2] -= ki * dt * ez
    return kp * ex - x[BIAS], kp * ey - x[BIAS + 1], kp * ez - x[BIAS + 2]


@kernel
def integrate(x: Floats, dt: float, wx: float, wy: float, wz: float) -> None:
    """First-order step of the quaternion, normalised."""
    half = 0.5 * dt
    d0, d1, d2, d3 = quat_mul(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], 0.0, half * wx, half * wy, half * wz)  # [Yu2018] (3)
    # departs from [Yu2018] (3): normalised
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = quat_unit(x[Q] + d0, x[Q + 1] + d1, x[Q + 2] + d2, x[Q + 3] + d3)


@kernel
def step(
    c: Floats, x: Floats, dt: float, flags_in: int,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float, mx: float, my: float, mz: float,
) -> int:  # fmt: skip
    """Take one sample."""
    word, dt, gx, gy, gz = admit(c, x, dt, gx, gy, gz)
    if x[STAGE] < HEADED:
        if x[STAGE] == BLIND:
            x[ELAPSED] = 0.0
        word |= initialise(c, x, ax, ay, az, mx, my, mz)
    acc_flag, tx, ty, tz = tilt_error(c, x, ax, ay, az)
    mag_flag, fx, fy, fz = field_error(c, x, mx, my, mz)
    px, py, pz = regulate(c, x, dt, tx + fx, ty + fy, tz + fz)  # [Yu2018]: the errors of both sensors are added
    integrate(x, dt, gx + px, gy + py, gz + pz)
    return word | acc_flag | mag_flag
