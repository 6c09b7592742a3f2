"""Seven-state Kalman filter of the rod paper: quaternion and gyroscope bias, corrected by gravity.

The gyroscope turns the quaternion in closed form; the accelerometer corrects quaternion and bias as far as it measures
gravity. Its noise has two sizes, at rest and in motion, and a detector separates the two: at rest the accelerometer
is believed, in motion it is averaged. The magnetometer sets the heading once, at the start; nothing corrects it later.

This is an extended Kalman filter on the four components of the quaternion, as the paper has it, and not an error-state
filter of three angles: the length of q is a fourth direction, which the size of gravity observes.

When to choose it: tilt of a body that stops now and then, where the heading does not matter. Where a magnetometer
is to hold the heading it is the wrong filter. The default noises are those of the paper's sensor; give a noise card or
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
I + Δt/2 [Ω | Ψ]. P stays about the predicted quaternion until the next prediction carries it on, so that turns about
the vertical, which gravity never shows, stay what they are. In motion, the noise is never taken to be smaller than what
the norm of the specific force misses of g, so that one blow does not tip the horizon; where the rate is missing, the
attitude becomes uncertain. As the heading is not corrected, its variance would grow until rounding hides the other
entries of P: it is held near 1 rad².

The paper's own switch is ``hard_switch=on``: at rest, tilt and bias are those of the mean specific force and rate, and
the Kalman filter waits. Its covariance then stays what it was, which leaves the filter wrong about its bias after a
rest; ``reset=on`` sets it to that of the means. The paper gives no thresholds and no
noises: all defaults are this project's.
"""

from typing import TYPE_CHECKING, Annotated, Any, Final, NamedTuple

import numpy as np

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.kernels import kernel
from plumbob.core.params import Spec
from plumbob.core.units import Quantity, deg, dps, g
from plumbob.filters.input_checks import admit, refused, usable
from plumbob.filters.layout import BIAS, HEADED, OWN, OWN_C, STAGE, UP, Q
from plumbob.filters.quaternion_bias import (
    P_BB,
    P_QB,
    P_QQ,
    PLACES_END,
    correct_gravity,
    hold_heading,
    predict,
    set_covariance,
)
from plumbob.filters.start import initialise, level
from plumbob.rotations.kernels import quat_mul, quat_unit

if TYPE_CHECKING:
    from plumbob.data.cards import NoiseCard

SUMMARY: Final = "quaternion and bias Kalman filter with a rest detector (rod paper); heading is free"
REFERENCES: Final = ("Li2012",)
NEEDS: Final = ("gyr", "acc")
STATE: Final = PLACES_END - OWN + 7

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

QUIET: Final = PLACES_END  # for how long nothing has moved, s
MEAN_ACC: Final = PLACES_END + 1
MEAN_GYR: Final = PLACES_END + 4
COVARIANCE: Final = slice(P_QQ, P_QB)

LOST_RATE: Final = 1.0  # scatter of a rate that is not there, rad/s


BIAS_PRIOR: Final = "start_bias"  # parameter that is the standard deviation of the bias at the start


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
        float,
        Spec(
            Quantity.TIME,
            "time of quiet after which the unit is at rest; also the averaging time of the means",
            1e-3,
            1e3,
        ),
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


def from_noise(card: "NoiseCard") -> dict[str, Any] | None:
    """N and K of the gyroscope, the quadratic mean of its axes; a figure that the card gives as zero keeps its default.

    The accelerometer's noise is not taken from a card: what disturbs it is how the body moves.
    """
    if card.gyr is None:
        return None
    params = {"gyro_noise": card.gyr.n_rms, "bias_walk": card.gyr.k_rms}
    return {name: value for name, value in params.items() if value > 0.0}


def covariance(q_nb: Floats, entries: Floats) -> Floats:
    """Covariance of the attitude error as a rotation vector in body axes, (N, 3, 3), rad²: 4 Ξᵀ P_qq Ξ."""
    rows, columns = np.triu_indices(4)
    p = np.empty((len(entries), 4, 4))
    p[:, rows, columns] = p[:, columns, rows] = entries
    q0, q1, q2, q3 = q_nb.T
    xi = np.moveaxis(np.array([[-q1, -q2, -q3], [q0, -q3, q2], [q3, q0, -q1], [-q2, q1, q0]]), 2, 0)
    cov: Floats = 4.0 * (np.swapaxes(xi, 1, 2) @ (p @ xi))
    return cov


@kernel
def resting(
    c: Floats, x: Floats, dt: float, excess: float,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float,
) -> bool:  # fmt: skip
    """Distinguish rest from motion: neither rate nor specific force has moved for the rest time."""
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


@kernel
def take_means(c: Floats, x: Floats) -> None:
    """Set tilt and bias to the means at rest; the heading stays."""
    l0, l1, l2, l3 = level(c[UP], x[MEAN_ACC], x[MEAN_ACC + 1], x[MEAN_ACC + 2])  # [Li2012] (7), (8)
    t0, _, _, t3 = quat_mul(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], l0, -l1, -l2, -l3)
    t0, _, _, t3 = quat_unit(t0, 0.0, 0.0, t3)
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = quat_mul(t0, 0.0, 0.0, t3, l0, l1, l2, l3)
    x[BIAS], x[BIAS + 1], x[BIAS + 2] = x[MEAN_GYR], x[MEAN_GYR + 1], x[MEAN_GYR + 2]  # [Li2012]
    if c[RESET] != 0.0:
        set_covariance(x, c[REST_VAR] / (c[REST_TIME] * G0 * G0), c[GYRO_VAR] / c[REST_TIME])


@kernel
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


@kernel
def motion_var(c: Floats, x: Floats, dt: float, excess: float) -> float:
    """Variance of the accelerometer in motion; it falls to that of rest as the quiet lasts, without a jump."""
    moving = 1.0 - x[QUIET] / c[REST_TIME]
    var: float = max((c[REST_VAR] + (c[MOTION_VAR] - c[REST_VAR]) * (moving * moving)) / dt, excess * excess)
    return var


@kernel
def step(
    c: Floats, x: Floats, dt: float, flags_in: int,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float, mx: float, my: float, mz: float,
) -> int:  # fmt: skip
    """Take one sample."""
    word, dt, gx, gy, gz = admit(c, x, dt, gx, gy, gz)
    angle_var = c[GYRO_VAR] * dt
    if word & flags.GYR_HELD:
        angle_var += (LOST_RATE * dt) ** 2
        x[QUIET] = 0.0
    sees = usable(ax, ay, az)
    excess = (ax * ax + ay * ay + az * az - G0 * G0) / (2.0 * G0) if sees else 0.0
    rest = sees and resting(c, x, dt, excess, gx, gy, gz, ax, ay, az)
    held = rest and c[HARD] != 0.0
    if not held:
        predict(x, dt, gx, gy, gz, angle_var, c[WALK_VAR] * dt)
    if x[STAGE] < HEADED or x[P_QQ] == 0.0:
        word |= start(c, x, ax, ay, az, mx, my, mz)
    if held:
        take_means(c, x)
    elif not sees:
        word |= refused(flags.ACC_GATED, ax, ay, az)
    elif dt > 0.0:
        var = c[REST_VAR] / dt if rest else motion_var(c, x, dt, excess)
        correct_gravity(x, c[UP], ax, ay, az, var)
        hold_heading(x)
    # departs from [Li2012]: normalised
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = quat_unit(x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    return word | flags.AT_REST if rest else word
