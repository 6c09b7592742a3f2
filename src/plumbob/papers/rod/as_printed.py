"""The paper's filter by its own equations: 7 × 7 matrices, and a switch for each of its misprints.

It is the second way to what `plumbob.filters.ekf7` does with 28 entries and a detector of rest. Here every equation
stands as [Li2012] has it, and each of the forms that cannot be right can be switched on, to see what it does.
State x is q_nb (wxyz) and the gyroscope bias X, rad/s; navigation frame NED; body axes forward, right, down.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.kernels import kernel
from plumbob.core.units import deg, dps, g
from plumbob.data import ImuData
from plumbob.rotations.kernels import quat_mul

START: Final = deg(2.0), dps(1.0)
"""Standard deviations of the attitude and of the bias at the start; the paper gives none."""
GYRO_NOISE: Final = dps(0.05)
"""White noise of the gyroscope, rad/s/√Hz, of the data sheet; the paper gives none."""
BIAS_WALK: Final = dps(0.003)
"""Random walk of its bias, rad/s²/√Hz; the paper gives none."""
ACC_SD: Final = g(0.1)
"""Standard deviation of a specific force, m/s²; the paper gives none."""


class Form(NamedTuple):
    """Which form of each equation is computed; the defaults are the corrected ones.

    `predicted`: P⁻ = ΦPΦᵀ + Q before the gain, of which the paper's list of steps has nothing; `half_angle`: cos(|W|/2)
    and sin(|W|/2) in (10), printed are cos|W| and sin|W|; `specific_force`: h(q) is −g_b, as f_b = −g_b at rest,
    printed is +g_b in (11); `normalised`: q is brought to length 1 after each step, which the paper does not say;
    `joseph`: P = (I−KH)P⁻(I−KH)ᵀ + KRKᵀ, printed is (I−KH)P⁻; `single`: state and covariance are kept in single
    precision;
    `carried`: P is turned with the quaternion when that is corrected and normalised, as `plumbob.filters.ekf7` does;
    the paper leaves it.
    """

    predicted: bool = True
    half_angle: bool = True
    specific_force: bool = True
    normalised: bool = True
    joseph: bool = False
    single: bool = False
    carried: bool = False


class Run(NamedTuple):
    """Attitudes (N, 4) of length 1, length (N,) of q before it is brought to 1, and covariance (7, 7) at the end."""

    q_nb: Floats
    length: Floats
    p: Floats


def level_angles(g_b: Floats) -> tuple[Floats, Floats]:
    """Roll and pitch (N,), rad, of gravity in body axes (N, 3), by (7) and (8) with atan2."""
    roll = np.arctan2(g_b[:, 1], g_b[:, 2])  # departs from [Li2012] (7): atan2, as atan knows no roll beyond 90°
    pitch = np.arctan2(-g_b[:, 0], np.hypot(g_b[:, 1], g_b[:, 2]))  # [Li2012] (8)
    return roll, pitch


def printed_angles(q: Floats) -> Floats:
    """Roll, pitch and yaw, rad, of a quaternion (4,) as (1) to (3) are printed."""
    q0, q1, q2, q3 = q
    roll = math.atan2(2.0 * (q2 * q3 - q0 * q1), 1.0 - 2.0 * (q1 * q1 + q2 * q2))
    pitch = math.asin(-2.0 * (q1 * q3 - q0 * q2))  # [Li2012] (2): it is right
    yaw = math.atan2(2.0 * (q1 * q2 - q0 * q3), 1.0 - 2.0 * (q2 * q2 + q3 * q3))
    return np.array([roll, pitch, yaw])


def omega(w: Floats) -> Floats:
    """Ω (4, 4) of a rate or rotation vector w (3,): Ω q = q ⊗ (0, w)."""
    x, y, z = w
    return np.array([[0.0, -x, -y, -z], [x, 0.0, z, -y], [y, -z, 0.0, x], [z, y, -x, 0.0]])


def transition(q: Floats, w: Floats, dt: float) -> Floats:
    """Φ (7, 7) as step (1) prints it, from a quaternion (4,) and the rate less the bias (3,), rad/s."""
    q0, q1, q2, q3 = q
    phi = np.eye(7)
    phi[:4, :4] += 0.5 * dt * omega(w)
    phi[:4, 4:] = 0.5 * dt * np.array([[q1, -q0, -q3, q2], [q2, q3, -q0, -q1], [q3, -q2, q1, -q0]]).T
    return phi


def observed(q: Floats) -> Floats:
    """Specific force at rest (3,), m/s², of a quaternion (4,) of any length: (11) with the sign of specific force."""
    q0, q1, q2, q3 = q
    g_b = [2.0 * (q1 * q3 - q0 * q2), 2.0 * (q2 * q3 + q0 * q1), q0 * q0 - q1 * q1 - q2 * q2 + q3 * q3]
    return -G0 * np.array(g_b)


def observation(q: Floats) -> Floats:
    """H (3, 7) of step (3), without the slips of the print."""
    q0, q1, q2, q3 = q
    h = np.zeros((3, 7))
    h[:, :4] = -2.0 * G0 * np.array([[-q2, q3, -q0, q1], [q1, q0, q3, q2], [q0, -q1, -q2, q3]])
    return h


def literal(imu: ImuData, acc_sd: Floats | float = ACC_SD, form: Form | None = None, *, rest: int = 100) -> Run:
    """Run the filter over samples at an even rate that begin at rest, body axes forward, right, down.

    `acc_sd`: standard deviation of each specific force, one or (N,), m/s²; `rest`: samples at rest at the begin whose
    mean gives the first attitude.
    """
    form = form or Form()
    assert imu.gyr is not None
    assert imu.acc is not None
    roll, pitch = level_angles(-imu.acc[:rest].mean(axis=0, keepdims=True))
    (cr, sr), (cp, sp) = ((math.cos(0.5 * a), math.sin(0.5 * a)) for a in (float(roll[0]), float(pitch[0])))
    x = np.array([cr * cp, sr * cp, cr * sp, -sr * sp, 0.0, 0.0, 0.0])
    angle, bias = START
    p = np.diag([0.25 * angle**2] * 4 + [bias**2] * 3)
    q_nb, length = np.empty((len(imu), 4)), np.empty(len(imu))
    dt = (imu.t[-1] - imu.t[0]) / (len(imu) - 1)
    var = np.broadcast_to(np.asarray(acc_sd, dtype=np.float64) ** 2, len(imu)).copy()
    filtered(
        x, p, imu.gyr, imu.acc, var, dt, GYRO_NOISE**2 * dt, BIAS_WALK**2 * dt, form.predicted, form.half_angle,
        form.specific_force, form.normalised, form.joseph, form.carried, form.single, q_nb,
        length,
    )  # fmt: skip
    return Run(q_nb, length, p)


@kernel
def filtered(
    x: Floats, p: Floats, gyr: Floats, acc: Floats, var: Floats, dt: float,
    angle_var: float, walk_var: float, predicted: bool, half_angle: bool, specific_force: bool, normalised: bool,
    joseph: bool, carried: bool, single: bool, q_nb: Floats, length: Floats,
) -> None:  # fmt: skip
    """Take all samples; x (7,) and p (7, 7) are the state, q_nb (N, 4) and length (N,) what comes out."""
    phi, h, ph, k, i_kh = np.zeros((7, 7)), np.zeros((3, 7)), np.zeros((7, 3)), np.zeros((7, 3)), np.zeros((7, 7))
    work, s, inverse, e = np.zeros((7, 7)), np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3)
    store(x, p, single)
    for n in range(gyr.shape[0]):
        if n > 0:
            set_transition(phi, x, gyr[n, 0] - x[4], gyr[n, 1] - x[5], gyr[n, 2] - x[6], dt)
            if predicted:  # departs from [Li2012]: P⁻ = ΦPΦᵀ + Q
                sandwich(phi, p, work)
                store(x, p, single)
                add_noise(p, x, angle_var, walk_var)
            turn(x, dt * (gyr[n, 0] - x[4]), dt * (gyr[n, 1] - x[5]), dt * (gyr[n, 2] - x[6]), half_angle)
            store(x, p, single)
        q0, q1, q2, q3 = float(x[0]), float(x[1]), float(x[2]), float(x[3])
        sign = -1.0 if specific_force else 1.0  # departs from [Li2012] (11): the sign of specific force
        set_observation(h, e, x, acc[n, 0], acc[n, 1], acc[n, 2], sign)
        gain(p, h, var[n], ph, s, inverse, k)
        for i in range(7):
            x[i] += k[i, 0] * e[0] + k[i, 1] * e[1] + k[i, 2] * e[2]  # [Li2012] step (5)
        store(x, p, single)
        shrink(p, k, h, var[n], joseph, i_kh, work)
        store(x, p, single)
        size = math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + x[3] * x[3])
        length[n] = size
        for i in range(4):
            q_nb[n, i] = x[i] / size
            if normalised:  # departs from [Li2012]: normalised
                x[i] = x[i] / size
        store(x, p, single)
        if carried:  # departs from [Li2012]: P goes with the quaternion
            e0, e1, e2, e3 = quat_mul(q0, -q1, -q2, -q3, x[0], x[1], x[2], x[3])
            set_turn(phi, e0, e1, e2, e3)
            sandwich(phi, p, work)
            store(x, p, single)


@kernel
def store(x: Floats, p: Floats, single: bool) -> None:
    """Round state and covariance to single precision, where they are kept so."""
    if single:
        for i in range(7):
            x[i] = float(np.float32(x[i]))
            for j in range(7):
                p[i, j] = float(np.float32(p[i, j]))


@kernel
def set_transition(phi: Floats, x: Floats, wx: float, wy: float, wz: float, dt: float) -> None:
    """Set Φ as `transition` has it."""
    half = 0.5 * dt
    for i in range(7):
        for j in range(7):
            phi[i, j] = 1.0 if i == j else 0.0
    phi[0, 1], phi[0, 2], phi[0, 3] = -half * wx, -half * wy, -half * wz  # [Li2012] step (1)
    phi[1, 0], phi[1, 2], phi[1, 3] = half * wx, half * wz, -half * wy
    phi[2, 0], phi[2, 1], phi[2, 3] = half * wy, -half * wz, half * wx
    phi[3, 0], phi[3, 1], phi[3, 2] = half * wz, half * wy, -half * wx
    phi[0, 4], phi[1, 4], phi[2, 4], phi[3, 4] = half * x[1], -half * x[0], -half * x[3], half * x[2]
    phi[0, 5], phi[1, 5], phi[2, 5], phi[3, 5] = half * x[2], half * x[3], -half * x[0], -half * x[1]
    phi[0, 6], phi[1, 6], phi[2, 6], phi[3, 6] = half * x[3], -half * x[2], half * x[1], -half * x[0]


@kernel
def set_turn(phi: Floats, e0: float, e1: float, e2: float, e3: float) -> None:
    """Set (7, 7) to what a turn by e does with the covariance: q ⊗ e for the quaternion."""
    for i in range(7):
        for j in range(7):
            phi[i, j] = 1.0 if i == j else 0.0
    phi[0, 0], phi[0, 1], phi[0, 2], phi[0, 3] = e0, -e1, -e2, -e3
    phi[1, 0], phi[1, 1], phi[1, 2], phi[1, 3] = e1, e0, e3, -e2
    phi[2, 0], phi[2, 1], phi[2, 2], phi[2, 3] = e2, -e3, e0, e1
    phi[3, 0], phi[3, 1], phi[3, 2], phi[3, 3] = e3, e2, -e1, e0


@kernel
def sandwich(a: Floats, p: Floats, work: Floats) -> None:
    """Set p to a p aᵀ, all (7, 7)."""
    for i in range(7):
        for j in range(7):
            total = 0.0
            for m in range(7):
                total += a[i, m] * p[m, j]
            work[i, j] = total
    for i in range(7):
        for j in range(i, 7):
            total = 0.0
            for m in range(7):
                total += work[i, m] * a[j, m]
            p[i, j] = total
            p[j, i] = total


@kernel
def add_noise(p: Floats, x: Floats, angle_var: float, walk_var: float) -> None:
    """Add Q: ¼ angle_var Ξ Ξᵀ for the quaternion, walk_var for the bias."""
    size = x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + x[3] * x[3]
    for i in range(4):
        for j in range(4):
            p[i, j] += 0.25 * angle_var * ((size if i == j else 0.0) - x[i] * x[j])
    for i in range(4, 7):
        p[i, i] += walk_var


@kernel
def turn(x: Floats, wx: float, wy: float, wz: float, half_angle: bool) -> None:
    """Turn q by W, rad."""
    size = math.sqrt(wx * wx + wy * wy + wz * wz)
    angle = 0.5 * size if half_angle else size  # departs from [Li2012] (10): the half angle, which it lacks
    c = math.cos(angle)
    s = math.sin(angle) / size if size > 0.0 else 0.0
    x[0], x[1], x[2], x[3] = quat_mul(x[0], x[1], x[2], x[3], c, s * wx, s * wy, s * wz)  # [Li2012] (10)


@kernel
def set_observation(h: Floats, e: Floats, x: Floats, ax: float, ay: float, az: float, sign: float) -> None:
    """Set H as `observation` has it, and the innovation; `sign` −1 is that of specific force."""
    q0, q1, q2, q3 = float(x[0]), float(x[1]), float(x[2]), float(x[3])
    g2 = 2.0 * sign * G0
    h[0, 0], h[0, 1], h[0, 2], h[0, 3] = -g2 * q2, g2 * q3, -g2 * q0, g2 * q1  # [Li2012] step (3)
    h[1, 0], h[1, 1], h[1, 2], h[1, 3] = g2 * q1, g2 * q0, g2 * q3, g2 * q2
    h[2, 0], h[2, 1], h[2, 2], h[2, 3] = g2 * q0, -g2 * q1, -g2 * q2, g2 * q3
    e[0] = ax - g2 * (q1 * q3 - q0 * q2)  # [Li2012] (11)
    e[1] = ay - g2 * (q2 * q3 + q0 * q1)
    e[2] = az - 0.5 * g2 * (q0 * q0 - q1 * q1 - q2 * q2 + q3 * q3)


@kernel
def gain(p: Floats, h: Floats, var: float, ph: Floats, s: Floats, inverse: Floats, k: Floats) -> None:
    """Set K to P⁻Hᵀ(HP⁻Hᵀ + R)⁻¹."""
    for i in range(7):
        for j in range(3):
            ph[i, j] = p[i, 0] * h[j, 0] + p[i, 1] * h[j, 1] + p[i, 2] * h[j, 2] + p[i, 3] * h[j, 3]
    for i in range(3):
        for j in range(3):
            s[i, j] = h[i, 0] * ph[0, j] + h[i, 1] * ph[1, j] + h[i, 2] * ph[2, j] + h[i, 3] * ph[3, j]
        s[i, i] += var
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            c, d = (j + 1) % 3, (j + 2) % 3
            inverse[j, i] = s[a, c] * s[b, d] - s[a, d] * s[b, c]  # cofactors of a cyclic 3 × 3 matrix need no sign
    det = s[0, 0] * inverse[0, 0] + s[0, 1] * inverse[1, 0] + s[0, 2] * inverse[2, 0]
    for i in range(7):
        for j in range(3):
            total = 0.0
            for m in range(3):
                total += ph[i, m] * inverse[m, j]
            k[i, j] = total / det  # [Li2012] step (4)


@kernel
def shrink(p: Floats, k: Floats, h: Floats, var: float, joseph: bool, i_kh: Floats, work: Floats) -> None:
    """Set P to (I−KH)P⁻, or by Joseph's form."""
    for i in range(7):
        for j in range(7):
            i_kh[i, j] = (1.0 if i == j else 0.0) - (k[i, 0] * h[0, j] + k[i, 1] * h[1, j] + k[i, 2] * h[2, j])
    if joseph:
        sandwich(i_kh, p, work)
        for i in range(7):
            for j in range(7):
                p[i, j] += var * (k[i, 0] * k[j, 0] + k[i, 1] * k[j, 1] + k[i, 2] * k[j, 2])
        return
    for i in range(7):
        for j in range(7):
            total = 0.0
            for m in range(7):
                total += i_kh[i, m] * p[m, j]
            work[i, j] = total  # [Li2012] step (6)
    for i in range(7):
        for j in range(7):
            p[i, j] = work[i, j]
