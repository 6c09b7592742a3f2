"""Gradient-descent filter of the 2010 report: the gyroscope turns, and a step of constant size down the error corrects.

The error is how far the up direction and the field, as the attitude predicts them in body axes, lie from the measured
unit vectors. Its gradient is normalised, so the correction has the speed β whatever the error: steady, but it never
rests (at rest the attitude moves by up to 2βΔt), and large errors are taken back slowly.

This is the 2010 report [Madgwick2010], not the filter of the later thesis and of x-io Fusion, which has another
feedback, start-up gain and rejection.

When to choose it: to compare with what others run.

=========  ==========  =======  =====================================================
symbol     name        unit     meaning
=========  ==========  =======  =====================================================
q          x[Q]        1        attitude q_nb
b          x[BIAS]     rad/s    gyroscope bias, learned only if ζ > 0
β          beta        1/s      speed of the correction of q
ζ          zeta        1/s      speed of learning the bias
=========  ==========  =======  =====================================================

Departures from [Madgwick2010]: any level navigation frame; a sensor that is absent leaves its half of
the error out; the start is taken from the first samples instead of the identity.
"""

import math
from typing import Annotated, Final, NamedTuple

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.kernels import kernel
from plumbob.core.params import Spec
from plumbob.core.units import Quantity
from plumbob.filters.input_checks import admit, refused, usable
from plumbob.filters.layout import BIAS, HEADED, NORTH_X, NORTH_Y, OWN_C, STAGE, UP, Q
from plumbob.filters.start import initialise
from plumbob.rotations.kernels import Quat, quat_mul, quat_unit, rotate

SUMMARY: Final = "gradient descent of the 2010 report (Madgwick), with optional bias"
REFERENCES: Final = ("Madgwick2010",)
NEEDS: Final = ("gyr", "acc")
STATE: Final = 0

BETA: Final = OWN_C
ZETA: Final = OWN_C + 1


class Params(NamedTuple):
    """Speeds of the two corrections; β defaults to the report's optimum with a magnetometer."""

    beta: Annotated[
        float, Spec(Quantity.GAIN, "speed of the correction, √(3/4) of the gyroscope's error in rad/s", 0, 100)
    ] = 0.041
    zeta: Annotated[
        float, Spec(Quantity.GAIN, "speed of learning the bias, √(3/4) of its drift in rad/s²; 0: none", 0, 100)
    ] = 0.0


def coefficients(params: Params) -> tuple[float, ...]:
    """Own coefficients of the kernel."""
    return params.beta, params.zeta


@kernel
def gradient(
    w: float, x: float, y: float, z: float, dx: float, dy: float, dz: float, sx: float, sy: float, sz: float
) -> Quat:
    """Gradient Jᵀf over (w, x, y, z) of half the squared distance between the direction d, seen in the body, and s."""
    f0 = dx * (1.0 - 2.0 * (y * y + z * z)) + 2.0 * (dy * (w * z + x * y) + dz * (x * z - w * y)) - sx
    f1 = 2.0 * dx * (x * y - w * z) + dy * (1.0 - 2.0 * (x * x + z * z)) + 2.0 * dz * (w * x + y * z) - sy
    f2 = 2.0 * (dx * (w * y + x * z) + dy * (y * z - w * x)) + dz * (1.0 - 2.0 * (x * x + y * y)) - sz
    # [Madgwick2010] (21), (22): f above, columns of its Jacobian below, both without their common factor 2
    return (
        f0 * (dy * z - dz * y) + f1 * (dz * x - dx * z) + f2 * (dx * y - dy * x),
        f0 * (dy * y + dz * z) + f1 * (dx * y - 2.0 * dy * x + dz * w) + f2 * (dx * z - dy * w - 2.0 * dz * x),
        f0 * (dy * x - 2.0 * dx * y - dz * w) + f1 * (dx * x + dz * z) + f2 * (dx * w + dy * z - 2.0 * dz * y),
        f0 * (dy * w - 2.0 * dx * z + dz * x) + f1 * (dz * y - dx * w - 2.0 * dy * z) + f2 * (dx * x + dy * y),
    )


@kernel
def tilt_gradient(c: Floats, x: Floats, ax: float, ay: float, az: float) -> tuple[int, float, float, float, float]:
    """Gradient that the accelerometer gives, or zero and a flag."""
    if not usable(ax, ay, az):
        return refused(flags.ACC_GATED, ax, ay, az), 0.0, 0.0, 0.0, 0.0
    s = 1.0 / math.sqrt(ax * ax + ay * ay + az * az)
    g0, g1, g2, g3 = gradient(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], 0.0, 0.0, c[UP], s * ax, s * ay, s * az)
    return 0, g0, g1, g2, g3


@kernel
def field_gradient(c: Floats, x: Floats, mx: float, my: float, mz: float) -> tuple[int, float, float, float, float]:
    """Gradient that the magnetometer gives, or zero and a flag; its reference is its own field turned to north."""
    if not usable(mx, my, mz):
        return refused(flags.MAG_GATED, mx, my, mz), 0.0, 0.0, 0.0, 0.0
    s = 1.0 / math.sqrt(mx * mx + my * my + mz * mz)
    mx, my, mz = s * mx, s * my, s * mz
    hx, hy, hz = rotate(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], mx, my, mz)
    level = math.sqrt(hx * hx + hy * hy)  # [Madgwick2010] (45), (46)
    g0, g1, g2, g3 = gradient(
        x[Q], x[Q + 1], x[Q + 2], x[Q + 3], level * c[NORTH_X], level * c[NORTH_Y], hz, mx, my, mz
    )
    return 0, g0, g1, g2, g3


@kernel
def learn_bias(c: Floats, x: Floats, dt: float, e0: float, e1: float, e2: float, e3: float) -> None:
    """Move the bias along the error's rate of turn."""
    k = 2.0 * c[ZETA] * dt
    _, wx, wy, wz = quat_mul(x[Q], -x[Q + 1], -x[Q + 2], -x[Q + 3], e0, e1, e2, e3)  # [Madgwick2010] (47)
    x[BIAS] += k * wx  # [Madgwick2010] (48)
    x[BIAS + 1] += k * wy
    x[BIAS + 2] += k * wz


@kernel
def step(
    c: Floats, x: Floats, dt: float, flags_in: int,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float, mx: float, my: float, mz: float,
) -> int:  # fmt: skip
    """Take one sample."""
    word, dt, gx, gy, gz = admit(c, x, dt, gx, gy, gz)
    if x[STAGE] < HEADED:
        word |= initialise(c, x, ax, ay, az, mx, my, mz)
    acc_flag, t0, t1, t2, t3 = tilt_gradient(c, x, ax, ay, az)
    mag_flag, m0, m1, m2, m3 = field_gradient(c, x, mx, my, mz)
    e0, e1, e2, e3 = t0 + m0, t1 + m1, t2 + m2, t3 + m3
    norm = math.sqrt(e0 * e0 + e1 * e1 + e2 * e2 + e3 * e3)
    if norm > 0.0:
        e0, e1, e2, e3 = e0 / norm, e1 / norm, e2 / norm, e3 / norm  # [Madgwick2010] (44)
    learn_bias(c, x, dt, e0, e1, e2, e3)
    half, step_ = 0.5 * dt, c[BETA] * dt
    wx, wy, wz = half * (gx - x[BIAS]), half * (gy - x[BIAS + 1]), half * (gz - x[BIAS + 2])
    d0, d1, d2, d3 = quat_mul(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], 0.0, wx, wy, wz)
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = quat_unit(
        x[Q] + d0 - step_ * e0, x[Q + 1] + d1 - step_ * e1, x[Q + 2] + d2 - step_ * e2, x[Q + 3] + d3 - step_ * e3
    )  # [Madgwick2010] (42), (43)
    return word | acc_flag | mag_flag
