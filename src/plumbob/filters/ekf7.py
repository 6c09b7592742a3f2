"""Seven-state Kalman filter of the rod paper: quaternion and gyroscope bias, corrected by gravity.

The gyroscope turns the quaternion in closed form; the accelerometer corrects quaternion and bias as far as it measures
gravity. Its noise has two sizes, at rest and in motion, and a detector tells the two apart: at rest the accelerometer
is believed, in motion it is averaged. The magnetometer sets the heading once, at the start; nothing corrects it later.

This is an extended Kalman filter on the four components of the quaternion, as the paper has it, and not an error-state
filter of three angles: the length of q is a fourth direction, which the size of gravity observes.

When to choose it: tilt of a body that stops now and then, where the heading does not matter. Where a magnetometer
shall hold the heading it is the wrong filter. The default noises are those of the paper's sensor; give a noise card or
``gyro_noise`` and ``bias_walk`` of yours, and calibrate an offset of the gyroscope beyond ``rest_rate`` away first, or
rest is never found.

=========  ===============  =============  =====================================================
symbol     name             unit           meaning
=========  ===============  =============  =====================================================
q          x[Q]             1              attitude q_nb
X          x[BIAS]          rad/s          gyroscope bias
P_qq       x[P_QQ]          1              covariance of q, its 10 upper entries by rows
P_qb       x[P_QB]          rad/s          covariance of q and X, 12 entries by rows
P_bb       x[P_BB]          (rad/s)²       covariance of X, its 6 upper entries by rows
W          –                rad            (ω − X) Δt
N          gyro_noise       rad/s/√Hz      white noise of the gyroscope
K          bias_walk        rad/s²/√Hz     random walk of its bias
√R         acc_rest, ...    m/s²/√Hz       noise of the accelerometer at rest and in motion
=========  ===============  =============  =====================================================

Departures from [Li2012]: W carries the half angle that (10) lacks; P is predicted before the gain is formed, which the
paper leaves out, with the noises N and K; gravity is predicted with the sign of specific force, in any level frame; q
is normalised after every step. Φ holds the exact derivatives of (10), whose first order is the paper's
I + Δt/2 [Ω | Ψ]. The three axes are corrected one after the other, which gives what the paper's one matrix gives. In
motion, the noise is never taken to be smaller than what the norm of the specific force misses of g, so that one blow
does not tip the horizon; and where the rate is missing, the quaternion becomes uncertain. As the heading is not
corrected, its variance would grow beyond what the other entries of P can be told from: it is held near 1 rad².

The paper's own switch is ``hard_switch=on``: at rest, tilt and bias are those of the mean specific force and rate, and
the Kalman filter waits. Its covariance then stays what it was, which leaves the filter wrong about its bias after a
rest; ``reset=on`` sets it to that of the means. The paper gives no thresholds and no
noises: all defaults are this project's.
"""

import math
from typing import Annotated, Any, Final, NamedTuple

import numpy as np

from plumbob import flags
from plumbob._jit import njit
from plumbob.cards import NoiseCard
from plumbob.check import Floats
from plumbob.constants import G0
from plumbob.filters.admission import admit, refused, usable
from plumbob.filters.alignment import initialise, level
from plumbob.filters.layout import BIAS, HEADED, OWN, OWN_C, STAGE, UP, Q
from plumbob.params import Spec
from plumbob.rotations.kernels import Quat, half_angle, quat_mul, quat_unit, third_row
from plumbob.units import Quantity, deg, dps, g

SUMMARY: Final = "quaternion and bias Kalman filter with a rest detector (rod paper); heading is free"
REFERENCES: Final = ("Li2012",)
NEEDS: Final = ("gyr", "acc")
STATE: Final = 39

GYRO_VAR: Final = OWN_C  # N²
WALK_VAR: Final = OWN_C + 1  # K²
REST_VAR: Final = OWN_C + 2
MOTION_VAR: Final = OWN_C + 3
START_ANGLE: Final = OWN_C + 4  # variance
START_BIAS: Final = OWN_C + 5  # variance
REST_RATE2: Final = OWN_C + 6
REST_FORCE: Final = OWN_C + 7
REST_TIME: Final = OWN_C + 8
HARD: Final = OWN_C + 9
RESET: Final = OWN_C + 10

P_QQ: Final = OWN
P_QB: Final = OWN + 10
P_BB: Final = OWN + 22
QUIET: Final = OWN + 28  # for how long nothing has moved, s
MEAN_ACC: Final = OWN + 29
MEAN_GYR: Final = OWN + 32
ABOUT: Final = OWN + 35  # attitude that P is about, 4
COVARIANCE: Final = slice(P_QQ, P_QB)

HEADING_LIMIT: Final = 1.0
"""Variance that the heading may reach, rad²; no sensor speaks of it, so no other figure depends on it."""
LOST_RATE: Final = 1.0
"""Scatter of a rate that is not there, rad/s."""


class Params(NamedTuple):
    """Noises as root power spectral densities, uncertainties at the start, and what counts as rest."""

    gyro_noise: Annotated[float, Spec(Quantity.RATE_NOISE, "N, white noise of the gyroscope", 0, 1)] = dps(0.05)
    bias_walk: Annotated[float, Spec(Quantity.RATE_WALK, "K, random walk of its bias", 0, 1)] = dps(0.003)
    acc_rest: Annotated[
        float, Spec(Quantity.ACCELERATION_NOISE, "noise of the accelerometer at rest; 3 mg/√Hz: 0.03 g at 100 Hz", 1e-9)
    ] = g(0.003)
    acc_motion: Annotated[
        float, Spec(Quantity.ACCELERATION_NOISE, "the same in motion; raise it where the body accelerates long", 1e-9)
    ] = g(0.01)
    start_angle: Annotated[
        float, Spec(Quantity.ANGLE, "standard deviation of tilt and heading at the start", 1e-6, 1)
    ] = deg(2.0)
    start_bias: Annotated[float, Spec(Quantity.RATE, "standard deviation of the bias at the start", 0, 10)] = dps(1.0)
    rest_rate: Annotated[float, Spec(Quantity.RATE, "at rest the rate, less the bias, is below this", 0, 100)] = dps(
        3.0
    )
    rest_force: Annotated[float, Spec(Quantity.ACCELERATION, "at rest the specific force is this near g", 0, 1e3)] = g(
        0.1
    )
    rest_time: Annotated[
        float, Spec(Quantity.TIME, "rest is what has been quiet for so long; also the time of the means", 1e-3, 1e3)
    ] = 1.0
    hard_switch: Annotated[
        bool, Spec(Quantity.RATIO, "at rest take tilt and bias from the means instead of filtering, as the paper does")
    ] = False
    reset: Annotated[
        bool, Spec(Quantity.RATIO, "set the covariance too when the hard switch sets tilt and bias; the paper does not")
    ] = False


def coefficients(params: Params) -> tuple[float, ...]:
    """Own coefficients of the kernel."""
    return (
        params.gyro_noise**2, params.bias_walk**2, params.acc_rest**2, params.acc_motion**2,
        params.start_angle**2, params.start_bias**2,
        params.rest_rate**2, params.rest_force, params.rest_time,
        1.0 if params.hard_switch else 0.0, 1.0 if params.reset else 0.0,
    )  # fmt: skip


def from_noise(card: NoiseCard) -> dict[str, Any] | None:
    """N and K of the gyroscope, the quadratic mean of its axes; a figure that the card gives as zero keeps its default.

    The accelerometer's noise is not taken from a card: what disturbs it is how the body moves.
    """
    if card.gyr is None:
        return None
    n, k = (math.sqrt(float(np.mean(v**2))) for v in (card.gyr.n_rpsd, card.gyr.k_rpsd))
    return {name: value for name, value in (("gyro_noise", n), ("bias_walk", k)) if value > 0.0}


def covariance(q_nb: Floats, entries: Floats) -> Floats:
    """Covariance of the attitude error as a rotation vector in body axes, (N, 3, 3), rad²: 4 Ξᵀ P_qq Ξ."""
    rows, columns = np.triu_indices(4)
    p = np.empty((len(entries), 4, 4))
    p[:, rows, columns] = p[:, columns, rows] = entries
    q0, q1, q2, q3 = q_nb.T
    xi = np.array([[-q1, -q2, -q3], [q0, -q3, q2], [q3, q0, -q1], [-q2, q1, q0]])
    found: Floats = 4.0 * np.einsum("ain,nab,bjn->nij", xi, p, xi)
    return found


@njit
def set_covariance(x: Floats, angle_var: float, bias_var: float) -> None:
    """Make the attitude uncertain by angle_var in every direction, the bias by bias_var, and the two independent."""
    for k in range(P_QQ, P_BB + 6):
        x[k] = 0.0
    p = 0.25 * angle_var  # a turn by θ moves q by θ/2
    x[P_QQ], x[P_QQ + 4], x[P_QQ + 7], x[P_QQ + 9] = p, p, p, p
    x[P_BB], x[P_BB + 3], x[P_BB + 5] = bias_var, bias_var, bias_var
    x[ABOUT], x[ABOUT + 1], x[ABOUT + 2], x[ABOUT + 3] = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]


@njit
def bias_derivative(
    q0: float, q1: float, q2: float, q3: float, dt: float, wx: float, wy: float, wz: float, w: float, s: float
) -> tuple[Quat, Quat, Quat]:
    """Columns of ∂(q ⊗ exp W)/∂X, where W = (ω − X) Δt, w = cos |W|/2 and s = sin(|W|/2)/|W|."""
    angle2 = wx * wx + wy * wy + wz * wz
    small = angle2 * (1.0 / 960.0 - angle2 / 107520.0) - 1.0 / 24.0
    r = small if angle2 < 1e-4 else (0.5 * w - s) / angle2  # ds/d|W| / |W|, by its series as in `half_angle`
    u0, u1, u2, u3 = quat_mul(q0, q1, q2, q3, 0.5 * dt * s, -dt * r * wx, -dt * r * wy, -dt * r * wz)
    s = -dt * s  # for W = 0 this leaves Δt/2 Ψ of [Li2012], step (1)
    return (
        (wx * u0 - s * q1, wx * u1 + s * q0, wx * u2 + s * q3, wx * u3 - s * q2),
        (wy * u0 - s * q2, wy * u1 - s * q3, wy * u2 + s * q0, wy * u3 + s * q1),
        (wz * u0 - s * q3, wz * u1 + s * q2, wz * u2 - s * q1, wz * u3 + s * q0),
    )


@njit
def spread_to_bias(
    x: Floats, e0: float, e1: float, e2: float, e3: float, bx: Quat, by: Quat, bz: Quat
) -> tuple[Quat, Quat, Quat]:
    """Predict P_qb to A P_qb + B P_bb, with A M = M ⊗ e by columns; returns the columns of A P_qb + ½ B P_bb."""
    x0, x1, x2, x3 = quat_mul(x[P_QB], x[P_QB + 3], x[P_QB + 6], x[P_QB + 9], e0, e1, e2, e3)
    y0, y1, y2, y3 = quat_mul(x[P_QB + 1], x[P_QB + 4], x[P_QB + 7], x[P_QB + 10], e0, e1, e2, e3)
    z0, z1, z2, z3 = quat_mul(x[P_QB + 2], x[P_QB + 5], x[P_QB + 8], x[P_QB + 11], e0, e1, e2, e3)
    pxx, pxy, pxz = 0.5 * x[P_BB], 0.5 * x[P_BB + 1], 0.5 * x[P_BB + 2]
    pyy, pyz, pzz = 0.5 * x[P_BB + 3], 0.5 * x[P_BB + 4], 0.5 * x[P_BB + 5]
    fx0, fy0, fz0 = _mixed(bx[0], by[0], bz[0], pxx, pxy, pxz, pyy, pyz, pzz)
    fx1, fy1, fz1 = _mixed(bx[1], by[1], bz[1], pxx, pxy, pxz, pyy, pyz, pzz)
    fx2, fy2, fz2 = _mixed(bx[2], by[2], bz[2], pxx, pxy, pxz, pyy, pyz, pzz)
    fx3, fy3, fz3 = _mixed(bx[3], by[3], bz[3], pxx, pxy, pxz, pyy, pyz, pzz)
    dx = x0 + fx0, x1 + fx1, x2 + fx2, x3 + fx3
    dy = y0 + fy0, y1 + fy1, y2 + fy2, y3 + fy3
    dz = z0 + fz0, z1 + fz1, z2 + fz2, z3 + fz3
    x[P_QB], x[P_QB + 1], x[P_QB + 2] = dx[0] + fx0, dy[0] + fy0, dz[0] + fz0
    x[P_QB + 3], x[P_QB + 4], x[P_QB + 5] = dx[1] + fx1, dy[1] + fy1, dz[1] + fz1
    x[P_QB + 6], x[P_QB + 7], x[P_QB + 8] = dx[2] + fx2, dy[2] + fy2, dz[2] + fz2
    x[P_QB + 9], x[P_QB + 10], x[P_QB + 11] = dx[3] + fx3, dy[3] + fy3, dz[3] + fz3
    return dx, dy, dz


@njit
def _mixed(
    bx: float, by: float, bz: float, pxx: float, pxy: float, pxz: float, pyy: float, pyz: float, pzz: float
) -> tuple[float, float, float]:
    """One row of B times the symmetric P."""
    return bx * pxx + by * pxy + bz * pxz, bx * pxy + by * pyy + bz * pyz, bx * pxz + by * pyz + bz * pzz


@njit
def spread_turn(
    x: Floats, e0: float, e1: float, e2: float, e3: float,
    bx: Quat, by: Quat, bz: Quat, dx: Quat, dy: Quat, dz: Quat,
) -> None:  # fmt: skip
    """Predict P_qq to A P_qq Aᵀ + D Bᵀ + B Dᵀ."""
    p0, p1, p2, p3 = x[P_QQ], x[P_QQ + 1], x[P_QQ + 2], x[P_QQ + 3]
    p11, p12, p13 = x[P_QQ + 4], x[P_QQ + 5], x[P_QQ + 6]
    p22, p23, p33 = x[P_QQ + 7], x[P_QQ + 8], x[P_QQ + 9]
    y00, y10, y20, y30 = quat_mul(p0, p1, p2, p3, e0, e1, e2, e3)  # columns of A P_qq
    y01, y11, y21, y31 = quat_mul(p1, p11, p12, p13, e0, e1, e2, e3)
    y02, y12, y22, y32 = quat_mul(p2, p12, p22, p23, e0, e1, e2, e3)
    y03, y13, y23, y33 = quat_mul(p3, p13, p23, p33, e0, e1, e2, e3)
    z00, z01, z02, z03 = quat_mul(y00, y01, y02, y03, e0, e1, e2, e3)  # rows of A P_qq Aᵀ
    _, z11, z12, z13 = quat_mul(y10, y11, y12, y13, e0, e1, e2, e3)
    _, _, z22, z23 = quat_mul(y20, y21, y22, y23, e0, e1, e2, e3)
    _, _, _, z33 = quat_mul(y30, y31, y32, y33, e0, e1, e2, e3)
    bx0, bx1, bx2, bx3 = bx
    by0, by1, by2, by3 = by
    bz0, bz1, bz2, bz3 = bz
    dx0, dx1, dx2, dx3 = dx
    dy0, dy1, dy2, dy3 = dy
    dz0, dz1, dz2, dz3 = dz
    x[P_QQ] = z00 + 2.0 * (bx0 * dx0 + by0 * dy0 + bz0 * dz0)
    x[P_QQ + 1] = z01 + (bx0 * dx1 + by0 * dy1 + bz0 * dz1) + (bx1 * dx0 + by1 * dy0 + bz1 * dz0)
    x[P_QQ + 2] = z02 + (bx0 * dx2 + by0 * dy2 + bz0 * dz2) + (bx2 * dx0 + by2 * dy0 + bz2 * dz0)
    x[P_QQ + 3] = z03 + (bx0 * dx3 + by0 * dy3 + bz0 * dz3) + (bx3 * dx0 + by3 * dy0 + bz3 * dz0)
    x[P_QQ + 4] = z11 + 2.0 * (bx1 * dx1 + by1 * dy1 + bz1 * dz1)
    x[P_QQ + 5] = z12 + (bx1 * dx2 + by1 * dy2 + bz1 * dz2) + (bx2 * dx1 + by2 * dy1 + bz2 * dz1)
    x[P_QQ + 6] = z13 + (bx1 * dx3 + by1 * dy3 + bz1 * dz3) + (bx3 * dx1 + by3 * dy1 + bz3 * dz1)
    x[P_QQ + 7] = z22 + 2.0 * (bx2 * dx2 + by2 * dy2 + bz2 * dz2)
    x[P_QQ + 8] = z23 + (bx2 * dx3 + by2 * dy3 + bz2 * dz3) + (bx3 * dx2 + by3 * dy2 + bz3 * dz2)
    x[P_QQ + 9] = z33 + 2.0 * (bx3 * dx3 + by3 * dy3 + bz3 * dz3)


@njit
def add_noise(x: Floats, angle_var: float, walk_var: float) -> None:
    """Make every turn of the attitude more uncertain by angle_var, the bias by walk_var; the length of q is kept."""
    p = 0.25 * angle_var
    q0, q1, q2, q3 = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    x[P_QQ] += p * (1.0 - q0 * q0)  # Ξ Ξᵀ = 1 − q qᵀ
    x[P_QQ + 1] -= p * (q0 * q1)
    x[P_QQ + 2] -= p * (q0 * q2)
    x[P_QQ + 3] -= p * (q0 * q3)
    x[P_QQ + 4] += p * (1.0 - q1 * q1)
    x[P_QQ + 5] -= p * (q1 * q2)
    x[P_QQ + 6] -= p * (q1 * q3)
    x[P_QQ + 7] += p * (1.0 - q2 * q2)
    x[P_QQ + 8] -= p * (q2 * q3)
    x[P_QQ + 9] += p * (1.0 - q3 * q3)
    x[P_BB] += walk_var
    x[P_BB + 3] += walk_var
    x[P_BB + 5] += walk_var


@njit
def predict(x: Floats, dt: float, gx: float, gy: float, gz: float, angle_var: float, walk_var: float) -> None:
    """Turn the attitude by the rate less the bias, and P with it: P⁻ = Φ P Φᵀ + Q."""
    wx, wy, wz = dt * (gx - x[BIAS]), dt * (gy - x[BIAS + 1]), dt * (gz - x[BIAS + 2])  # [Li2012] (9)
    w, s = half_angle(wx * wx + wy * wy + wz * wz)
    q0, q1, q2, q3 = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    bx, by, bz = bias_derivative(q0, q1, q2, q3, dt, wx, wy, wz, w, s)
    q0, q1, q2, q3 = quat_mul(q0, q1, q2, q3, w, s * wx, s * wy, s * wz)  # [Li2012] (10)
    e0, e1, e2, e3 = quat_mul(x[ABOUT], -x[ABOUT + 1], -x[ABOUT + 2], -x[ABOUT + 3], q0, q1, q2, q3)
    dx, dy, dz = spread_to_bias(x, e0, e1, e2, e3, bx, by, bz)
    spread_turn(x, e0, e1, e2, e3, bx, by, bz, dx, dy, dz)
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = q0, q1, q2, q3
    x[ABOUT], x[ABOUT + 1], x[ABOUT + 2], x[ABOUT + 3] = q0, q1, q2, q3
    add_noise(x, angle_var, walk_var)


@njit
def correct(x: Floats, h0: float, h1: float, h2: float, h3: float, target: float, var: float) -> None:
    """Take up one number that should be h·q, and is target, with the scalar form of steps (4) to (6) of [Li2012]."""
    k0 = x[P_QQ] * h0 + x[P_QQ + 1] * h1 + x[P_QQ + 2] * h2 + x[P_QQ + 3] * h3
    k1 = x[P_QQ + 1] * h0 + x[P_QQ + 4] * h1 + x[P_QQ + 5] * h2 + x[P_QQ + 6] * h3
    k2 = x[P_QQ + 2] * h0 + x[P_QQ + 5] * h1 + x[P_QQ + 7] * h2 + x[P_QQ + 8] * h3
    k3 = x[P_QQ + 3] * h0 + x[P_QQ + 6] * h1 + x[P_QQ + 8] * h2 + x[P_QQ + 9] * h3
    kx = x[P_QB] * h0 + x[P_QB + 3] * h1 + x[P_QB + 6] * h2 + x[P_QB + 9] * h3
    ky = x[P_QB + 1] * h0 + x[P_QB + 4] * h1 + x[P_QB + 7] * h2 + x[P_QB + 10] * h3
    kz = x[P_QB + 2] * h0 + x[P_QB + 5] * h1 + x[P_QB + 8] * h2 + x[P_QB + 11] * h3
    scale = 1.0 / (h0 * k0 + h1 * k1 + h2 * k2 + h3 * k3 + var)
    e = scale * (target - (h0 * x[Q] + h1 * x[Q + 1] + h2 * x[Q + 2] + h3 * x[Q + 3]))
    x[Q] += e * k0
    x[Q + 1] += e * k1
    x[Q + 2] += e * k2
    x[Q + 3] += e * k3
    x[BIAS] += e * kx
    x[BIAS + 1] += e * ky
    x[BIAS + 2] += e * kz
    s0, s1, s2, s3, sx, sy, sz = scale * k0, scale * k1, scale * k2, scale * k3, scale * kx, scale * ky, scale * kz
    x[P_QQ] -= s0 * k0
    x[P_QQ + 1] -= s0 * k1
    x[P_QQ + 2] -= s0 * k2
    x[P_QQ + 3] -= s0 * k3
    x[P_QQ + 4] -= s1 * k1
    x[P_QQ + 5] -= s1 * k2
    x[P_QQ + 6] -= s1 * k3
    x[P_QQ + 7] -= s2 * k2
    x[P_QQ + 8] -= s2 * k3
    x[P_QQ + 9] -= s3 * k3
    x[P_QB] -= s0 * kx
    x[P_QB + 1] -= s0 * ky
    x[P_QB + 2] -= s0 * kz
    x[P_QB + 3] -= s1 * kx
    x[P_QB + 4] -= s1 * ky
    x[P_QB + 5] -= s1 * kz
    x[P_QB + 6] -= s2 * kx
    x[P_QB + 7] -= s2 * ky
    x[P_QB + 8] -= s2 * kz
    x[P_QB + 9] -= s3 * kx
    x[P_QB + 10] -= s3 * ky
    x[P_QB + 11] -= s3 * kz
    x[P_BB] -= sx * kx
    x[P_BB + 1] -= sx * ky
    x[P_BB + 2] -= sx * kz
    x[P_BB + 3] -= sy * ky
    x[P_BB + 4] -= sy * kz
    x[P_BB + 5] -= sz * kz


@njit
def correct_gravity(x: Floats, up: float, ax: float, ay: float, az: float, var: float) -> None:
    """Take up a specific force as gravity, all three axes seen from the predicted attitude.

    h is quadratic in q, so that H q = 2 h, and the innovation f − h(q) is (f + h) − H q.
    """
    h = 2.0 * up * G0
    h0, h1, h2, h3 = h * x[Q], h * x[Q + 1], h * x[Q + 2], h * x[Q + 3]
    fx, fy, fz = third_row(x[Q], x[Q + 1], x[Q + 2], x[Q + 3])  # [Li2012] (11), with the sign of specific force
    half = 0.5 * h
    correct(x, -h2, h3, -h0, h1, ax + half * fx, var)  # rows of [Li2012], step (3)
    correct(x, h1, h0, h3, h2, ay + half * fy, var)
    correct(x, h0, -h1, -h2, h3, az + half * fz, var)


@njit
def hold_heading(x: Floats) -> None:
    """Halve the error of the heading, with all that depends on it, where its variance has reached the limit."""
    if x[P_QQ] + x[P_QQ + 4] + x[P_QQ + 7] + x[P_QQ + 9] < 0.25 * HEADING_LIMIT:
        return
    v0, v1, v2, v3 = -x[ABOUT + 3], -x[ABOUT + 2], x[ABOUT + 1], x[ABOUT]  # 2 ∂q/∂heading
    y0 = x[P_QQ] * v0 + x[P_QQ + 1] * v1 + x[P_QQ + 2] * v2 + x[P_QQ + 3] * v3
    y1 = x[P_QQ + 1] * v0 + x[P_QQ + 4] * v1 + x[P_QQ + 5] * v2 + x[P_QQ + 6] * v3
    y2 = x[P_QQ + 2] * v0 + x[P_QQ + 5] * v1 + x[P_QQ + 7] * v2 + x[P_QQ + 8] * v3
    y3 = x[P_QQ + 3] * v0 + x[P_QQ + 6] * v1 + x[P_QQ + 8] * v2 + x[P_QQ + 9] * v3
    var = v0 * y0 + v1 * y1 + v2 * y2 + v3 * y3
    if 4.0 * var < HEADING_LIMIT:
        return
    bx = 0.5 * (x[P_QB] * v0 + x[P_QB + 3] * v1 + x[P_QB + 6] * v2 + x[P_QB + 9] * v3)
    by = 0.5 * (x[P_QB + 1] * v0 + x[P_QB + 4] * v1 + x[P_QB + 7] * v2 + x[P_QB + 10] * v3)
    bz = 0.5 * (x[P_QB + 2] * v0 + x[P_QB + 5] * v1 + x[P_QB + 8] * v2 + x[P_QB + 11] * v3)
    # S P Sᵀ with S = 1 − ½ v vᵀ is P − v dᵀ − d vᵀ
    d0, d1, d2, d3 = (
        0.5 * y0 - 0.125 * var * v0,
        0.5 * y1 - 0.125 * var * v1,
        0.5 * y2 - 0.125 * var * v2,
        0.5 * y3 - 0.125 * var * v3,
    )
    x[P_QQ] -= 2.0 * v0 * d0
    x[P_QQ + 1] -= v0 * d1 + v1 * d0
    x[P_QQ + 2] -= v0 * d2 + v2 * d0
    x[P_QQ + 3] -= v0 * d3 + v3 * d0
    x[P_QQ + 4] -= 2.0 * v1 * d1
    x[P_QQ + 5] -= v1 * d2 + v2 * d1
    x[P_QQ + 6] -= v1 * d3 + v3 * d1
    x[P_QQ + 7] -= 2.0 * v2 * d2
    x[P_QQ + 8] -= v2 * d3 + v3 * d2
    x[P_QQ + 9] -= 2.0 * v3 * d3
    x[P_QB], x[P_QB + 1], x[P_QB + 2] = x[P_QB] - v0 * bx, x[P_QB + 1] - v0 * by, x[P_QB + 2] - v0 * bz
    x[P_QB + 3], x[P_QB + 4], x[P_QB + 5] = x[P_QB + 3] - v1 * bx, x[P_QB + 4] - v1 * by, x[P_QB + 5] - v1 * bz
    x[P_QB + 6], x[P_QB + 7], x[P_QB + 8] = x[P_QB + 6] - v2 * bx, x[P_QB + 7] - v2 * by, x[P_QB + 8] - v2 * bz
    x[P_QB + 9], x[P_QB + 10], x[P_QB + 11] = x[P_QB + 9] - v3 * bx, x[P_QB + 10] - v3 * by, x[P_QB + 11] - v3 * bz


@njit
def resting(
    c: Floats, x: Floats, dt: float, excess: float,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float,
) -> bool:  # fmt: skip
    """Tell rest from motion: neither rate nor specific force has moved for the rest time."""
    wx, wy, wz = gx - x[BIAS], gy - x[BIAS + 1], gz - x[BIAS + 2]
    if not (abs(excess) < c[REST_FORCE] and wx * wx + wy * wy + wz * wz < c[REST_RATE2]):
        x[QUIET] = 0.0
        return False
    x[QUIET] += dt
    if c[HARD] != 0.0 and dt > 0.0:
        weight = dt / min(x[QUIET], c[REST_TIME])  # a plain mean at first, then one that forgets
        x[MEAN_ACC] += weight * (ax - x[MEAN_ACC])
        x[MEAN_ACC + 1] += weight * (ay - x[MEAN_ACC + 1])
        x[MEAN_ACC + 2] += weight * (az - x[MEAN_ACC + 2])
        x[MEAN_GYR] += weight * (gx - x[MEAN_GYR])
        x[MEAN_GYR + 1] += weight * (gy - x[MEAN_GYR + 1])
        x[MEAN_GYR + 2] += weight * (gz - x[MEAN_GYR + 2])
    return bool(x[QUIET] >= c[REST_TIME])


@njit
def take_means(c: Floats, x: Floats) -> None:
    """Set tilt and bias to the means at rest; the heading stays."""
    l0, l1, l2, l3 = level(c[UP], x[MEAN_ACC], x[MEAN_ACC + 1], x[MEAN_ACC + 2])  # [Li2012] (7), (8)
    t0, _, _, t3 = quat_mul(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], l0, -l1, -l2, -l3)
    t0, _, _, t3 = quat_unit(t0, 0.0, 0.0, t3)
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = quat_mul(t0, 0.0, 0.0, t3, l0, l1, l2, l3)
    x[BIAS], x[BIAS + 1], x[BIAS + 2] = x[MEAN_GYR], x[MEAN_GYR + 1], x[MEAN_GYR + 2]
    if c[RESET] != 0.0:
        set_covariance(x, c[REST_VAR] / (c[REST_TIME] * G0 * G0), c[GYRO_VAR] / c[REST_TIME])


@njit
def start(c: Floats, x: Floats, ax: float, ay: float, az: float, mx: float, my: float, mz: float) -> int:
    """Take up tilt and heading; P then starts again, but what is known of the bias stays."""
    before = x[STAGE]
    missing = initialise(c, x, ax, ay, az, mx, my, mz) if before < HEADED else 0
    if x[P_QQ] == 0.0:
        set_covariance(x, c[START_ANGLE], c[START_BIAS])
    elif x[STAGE] != before:
        xx, xy, xz, yy, yz, zz = x[P_BB], x[P_BB + 1], x[P_BB + 2], x[P_BB + 3], x[P_BB + 4], x[P_BB + 5]
        set_covariance(x, c[START_ANGLE], 0.0)
        x[P_BB], x[P_BB + 1], x[P_BB + 2], x[P_BB + 3], x[P_BB + 4], x[P_BB + 5] = xx, xy, xz, yy, yz, zz
    return missing


@njit
def motion_var(c: Floats, x: Floats, dt: float, excess: float) -> float:
    """Variance of the accelerometer in motion; it falls to that of rest as the quiet lasts, so that rest is no jump."""
    moving = 1.0 - x[QUIET] / c[REST_TIME]
    return max((c[REST_VAR] + (c[MOTION_VAR] - c[REST_VAR]) * (moving * moving)) / dt, excess * excess)


@njit
def step(
    c: Floats, x: Floats, dt: float, seen: int,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float, mx: float, my: float, mz: float,
) -> int:  # fmt: skip
    """Take one sample."""
    found, dt, gx, gy, gz = admit(c, x, dt, gx, gy, gz)
    angle_var = c[GYRO_VAR] * dt
    if found & flags.GYR_HELD:
        angle_var += (LOST_RATE * dt) ** 2
        x[QUIET] = 0.0
    sees = usable(ax, ay, az)
    excess = (ax * ax + ay * ay + az * az - G0 * G0) / (2.0 * G0) if sees else 0.0
    rest = sees and resting(c, x, dt, excess, gx, gy, gz, ax, ay, az)
    held = rest and c[HARD] != 0.0
    if not held:
        predict(x, dt, gx, gy, gz, angle_var, c[WALK_VAR] * dt)
    if x[STAGE] < HEADED or x[P_QQ] == 0.0:
        found |= start(c, x, ax, ay, az, mx, my, mz)
    if held:
        take_means(c, x)
    elif not sees:
        found |= refused(flags.ACC_GATED, ax, ay, az)
    elif dt > 0.0:
        var = c[REST_VAR] / dt if rest else motion_var(c, x, dt, excess)
        correct_gravity(x, c[UP], ax, ay, az, var)
        hold_heading(x)
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = quat_unit(x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    return found | flags.AT_REST if rest else found
