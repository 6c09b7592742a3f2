"""Extended Kalman filter on the quaternion alone: the filter that ends the arm-teaching paper's chain.

Rate turns the four components of q to first order; the directions of specific force and magnetic field, as the
predicted attitude sees them in body axes, are compared with the measured unit vectors. There is no bias in the state.

When to choose it: to reproduce the paper, or behind something that has removed the bias. A constant bias b leaves a
constant error, and the directions are believed alike at rest and in motion.

=========  ===============  =============  =====================================================
symbol     name             unit           meaning
=========  ===============  =============  =====================================================
q          x[Q]             1              attitude q_nb
P          x[P]             1              covariance of q, its 10 upper entries by rows
Q          gyro_noise       rad/s/√Hz      white noise N of the rate; the paper's variance is N²/Δt
R          direction_sd     1              scatter of a direction over 0.1 s; the paper's variance is its square
P0         start_sd         1              scatter of each component of q at the start
m_D        x[FIELD_Z]       1              part of the field's direction along the navigation z axis, if it is learned
=========  ===============  =============  =====================================================

Noises are independent of the rate, and are the paper's Q = 1e-4 (rad/s)² and R = 1e-3 at its own step of 0.1 s: a
direction that is measured n times in 0.1 s may scatter √n times as much each time.

Departures from [HuangJiang]: specific force points up, in any level frame, where the paper's gravity points down; q is
normalised, after the prediction (with P, whose first-order growth is thus undone) and after the correction. The paper
takes the field [m_N, 0, m_D] as known; so does ``dip``, without which the dip is learned as the mean of what is seen.
The reference may thus be made of the measurements, and no covariance is claimed. The six numbers are corrected one
after the other about the same prediction, which gives what one matrix of six gives. A sensor that is absent leaves its
half out.
"""

import math
from typing import Annotated, Final, NamedTuple

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.kernels import kernel
from plumbob.core.params import Spec
from plumbob.core.units import Quantity
from plumbob.filters.input_checks import admit, refused, usable
from plumbob.filters.layout import HEADED, NORTH_X, NORTH_Y, OWN, OWN_C, STAGE, UP, Q
from plumbob.filters.start import initialise
from plumbob.rotations.kernels import Vec, quat_mul, quat_unit, rotate

SUMMARY: Final = "quaternion Kalman filter on two directions (arm-teaching paper), without bias"
REFERENCES: Final = ("HuangJiang",)
NEEDS: Final = ("gyr", "acc")
STATE: Final = 12

GYRO_VAR: Final = OWN_C  # N²
DIRECTION_VAR: Final = OWN_C + 1
START_VAR: Final = OWN_C + 2
SIN_DIP: Final = OWN_C + 3  # NaN where it is to be learned
P: Final = OWN
FIELD_Z: Final = OWN + 10
LOOKED: Final = OWN + 11  # for how long the field has been seen, s, at most DIP_MEMORY

PAPER_STEP: Final = 0.1  # sampling interval of the paper, s
DIP_MEMORY: Final = 100.0
"""A dip that is learned is the mean over so long, s: longer than motion, shorter than a walk into another room."""


class Params(NamedTuple):
    """Noises; the defaults are the paper's Q, R and P0 at its own step."""

    gyro_noise: Annotated[
        float, Spec(Quantity.RATE_NOISE, "N, white noise of the rate; raise it to follow the directions faster", 0, 1)
    ] = math.sqrt(1e-4 * PAPER_STEP)
    direction_sd: Annotated[
        float,
        Spec(Quantity.RATIO, "scatter of a measured direction over 0.1 s; raise it where the body accelerates", 1e-6),
    ] = math.sqrt(1e-3)
    start_sd: Annotated[
        float, Spec(Quantity.RATIO, "standard deviation of each component of q at the start", 1e-6, 1)
    ] = math.sqrt(1e-3)
    dip: Annotated[
        float | None,
        Spec(Quantity.ANGLE, "angle of the field below the horizontal, if it is known; off: learned", -1.57, 1.57),
    ] = None


def coefficients(params: Params) -> tuple[float, ...]:
    """Own coefficients of the kernel."""
    dip = math.nan if params.dip is None else math.sin(params.dip)
    return params.gyro_noise**2, params.direction_sd**2 * PAPER_STEP, params.start_sd**2, dip


@kernel
def start_covariance(x: Floats, var: float) -> None:
    """Make every component of q uncertain alike."""
    for k in range(P, P + 10):
        x[k] = 0.0
    x[P], x[P + 4], x[P + 7], x[P + 9] = var, var, var, var


@kernel
def predict(x: Floats, dt: float, wx: float, wy: float, wz: float, noise: float) -> None:
    """q⁻ = F q, P⁻ = F P Fᵀ + Γ Q Γᵀ with F = I + Δt/2 Ω(ω) and Γ = Δt/2 Ξ(q), scaled so that q keeps its length."""
    half = 0.5 * dt
    e1, e2, e3 = half * wx, half * wy, half * wz  # F v is v ⊗ (1, ω Δt/2)
    q0, q1, q2, q3 = quat_mul(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], 1.0, e1, e2, e3)  # [HuangJiang]
    p01, p02, p03, p12, p13, p23 = x[P + 1], x[P + 2], x[P + 3], x[P + 5], x[P + 6], x[P + 8]
    y00, y10, y20, y30 = quat_mul(x[P], p01, p02, p03, 1.0, e1, e2, e3)  # columns of F P
    y01, y11, y21, y31 = quat_mul(p01, x[P + 4], p12, p13, 1.0, e1, e2, e3)
    y02, y12, y22, y32 = quat_mul(p02, p12, x[P + 7], p23, 1.0, e1, e2, e3)
    y03, y13, y23, y33 = quat_mul(p03, p13, p23, x[P + 9], 1.0, e1, e2, e3)
    z00, z01, z02, z03 = quat_mul(y00, y01, y02, y03, 1.0, e1, e2, e3)  # rows of F P Fᵀ
    _, z11, z12, z13 = quat_mul(y10, y11, y12, y13, 1.0, e1, e2, e3)
    _, _, z22, z23 = quat_mul(y20, y21, y22, y23, 1.0, e1, e2, e3)
    _, _, _, z33 = quat_mul(y30, y31, y32, y33, 1.0, e1, e2, e3)
    back = 1.0 / (1.0 + e1 * e1 + e2 * e2 + e3 * e3)
    q0, q1, q2, q3 = quat_unit(q0, q1, q2, q3)  # departs from [HuangJiang]: normalised, and P with it
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = q0, q1, q2, q3
    x[P], x[P + 1] = back * z00 + noise * (1.0 - q0 * q0), back * z01 - noise * (q0 * q1)  # Ξ Ξᵀ = 1 − q qᵀ
    x[P + 2], x[P + 3] = back * z02 - noise * (q0 * q2), back * z03 - noise * (q0 * q3)
    x[P + 4], x[P + 5] = back * z11 + noise * (1.0 - q1 * q1), back * z12 - noise * (q1 * q2)
    x[P + 6], x[P + 7] = back * z13 - noise * (q1 * q3), back * z22 + noise * (1.0 - q2 * q2)
    x[P + 8], x[P + 9] = back * z23 - noise * (q2 * q3), back * z33 + noise * (1.0 - q3 * q3)


@kernel
def correct(x: Floats, h0: float, h1: float, h2: float, h3: float, target: float, var: float) -> None:
    """Take up one number that should be h·q, and is target."""
    k0 = x[P] * h0 + x[P + 1] * h1 + x[P + 2] * h2 + x[P + 3] * h3
    k1 = x[P + 1] * h0 + x[P + 4] * h1 + x[P + 5] * h2 + x[P + 6] * h3
    k2 = x[P + 2] * h0 + x[P + 5] * h1 + x[P + 7] * h2 + x[P + 8] * h3
    k3 = x[P + 3] * h0 + x[P + 6] * h1 + x[P + 8] * h2 + x[P + 9] * h3
    scale = 1.0 / (h0 * k0 + h1 * k1 + h2 * k2 + h3 * k3 + var)  # [HuangJiang]
    e = scale * (target - (h0 * x[Q] + h1 * x[Q + 1] + h2 * x[Q + 2] + h3 * x[Q + 3]))
    x[Q] += e * k0
    x[Q + 1] += e * k1
    x[Q + 2] += e * k2
    x[Q + 3] += e * k3
    s0, s1, s2, s3 = scale * k0, scale * k1, scale * k2, scale * k3
    x[P] -= s0 * k0
    x[P + 1] -= s0 * k1
    x[P + 2] -= s0 * k2
    x[P + 3] -= s0 * k3
    x[P + 4] -= s1 * k1
    x[P + 5] -= s1 * k2
    x[P + 6] -= s1 * k3
    x[P + 7] -= s2 * k2
    x[P + 8] -= s2 * k3
    x[P + 9] -= s3 * k3


@kernel
def correct_direction(
    x: Floats, q0: float, q1: float, q2: float, q3: float,
    dx: float, dy: float, dz: float, sx: float, sy: float, sz: float, var: float,
) -> None:  # fmt: skip
    """Take up that the direction d of the navigation frame was seen as the unit vector s, about the prediction q.

    h = q* ⊗ d ⊗ q is quadratic in q, so that H q = 2 h, and the innovation s − h, after what other numbers have changed
    in x, is (s + h) − H x. The rows of H are those of 2 (q* ⊗ d) ⊗ ….
    """
    t0, t1, t2, t3 = quat_mul(q0, -q1, -q2, -q3, 0.0, dx, dy, dz)
    _, hx, hy, hz = quat_mul(t0, t1, t2, t3, q0, q1, q2, q3)  # [HuangJiang]
    t0, t1, t2, t3 = 2.0 * t0, 2.0 * t1, 2.0 * t2, 2.0 * t3
    correct(x, t1, t0, -t3, t2, sx + hx, var)
    correct(x, t2, t3, t0, -t1, sy + hy, var)
    correct(x, t3, -t2, t1, t0, sz + hz, var)


@kernel
def field_reference(c: Floats, x: Floats, dt: float, mx: float, my: float, mz: float) -> Vec:
    """Direction of the field in the navigation frame: north, and down by the dip, known or the mean of all looks."""
    z = -c[UP] * c[SIN_DIP]
    if math.isnan(z):
        _, _, hz = rotate(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], mx, my, mz)
        x[LOOKED] = min(x[LOOKED] + dt, DIP_MEMORY)
        x[FIELD_Z] += dt / x[LOOKED] * (hz - x[FIELD_Z])  # departs from [HuangJiang]: the dip is learned
        z = x[FIELD_Z]
    size = math.sqrt(max(1.0 - z * z, 0.0))
    return size * c[NORTH_X], size * c[NORTH_Y], z


@kernel
def correct_all(
    c: Floats, x: Floats, dt: float, ax: float, ay: float, az: float, mx: float, my: float, mz: float
) -> int:
    """Take up both directions about the same prediction; returns flags of what could not be used."""
    word = 0
    var = c[DIRECTION_VAR] / dt
    q0, q1, q2, q3 = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    if usable(mx, my, mz):
        s = 1.0 / math.sqrt(mx * mx + my * my + mz * mz)
        mx, my, mz = s * mx, s * my, s * mz
        dx, dy, dz = field_reference(c, x, dt, mx, my, mz)
        correct_direction(x, q0, q1, q2, q3, dx, dy, dz, mx, my, mz, var)
    else:
        word |= refused(flags.MAG_GATED, mx, my, mz)
    if usable(ax, ay, az):
        s = 1.0 / math.sqrt(ax * ax + ay * ay + az * az)
        correct_direction(x, q0, q1, q2, q3, 0.0, 0.0, c[UP], s * ax, s * ay, s * az, var)
    else:
        word |= refused(flags.ACC_GATED, ax, ay, az)
    return word


@kernel
def step(
    c: Floats, x: Floats, dt: float, flags_in: int,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float, mx: float, my: float, mz: float,
) -> int:  # fmt: skip
    """Take one sample."""
    word, dt, gx, gy, gz = admit(c, x, dt, gx, gy, gz)
    predict(x, dt, gx, gy, gz, 0.25 * c[GYRO_VAR] * dt)
    before = x[STAGE]
    if before < HEADED:
        word |= initialise(c, x, ax, ay, az, mx, my, mz)
    if x[P] == 0.0 or x[STAGE] != before:
        start_covariance(x, c[START_VAR])
    if dt > 0.0:
        word |= correct_all(c, x, dt, ax, ay, az, mx, my, mz)
        x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = quat_unit(x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    return word
