"""Whether a start without a given attitude was right, by what the accelerometer says afterwards.

A filter that starts by itself takes the first specific force for gravity. A body that accelerates at that moment makes
its tilt wrong, by 40° where it accelerates by 0.84 g, and no covariance and no later sample taken alone shows it. So
the start is on trial: the specific force in navigation axes, averaged so that accelerations cancel, must point up, and
keep pointing up. A start from a unit at rest needs no trial: its first specific force has the size of gravity, and it
does not turn. Of an uncalibrated one neither is known well, but it stays for a second as it was when it began.

This runs after the step of every filter, reads its attitude, changes nothing that the step reads, and is one comparison
once the trial is over.

What errors of the calibration do to an attitude: a consider analysis, [Schmidt1966].

A filter's covariance knows its noises. What the calibration leaves, ``δ = d + E u`` in each vector u, is the same all
the time, so it does not average out, and a filter that does not estimate it should at least count it: the covariance
that is claimed is ``P + J P_cal Jᵀ``, with P that of the filter, P_cal that of the parameters p = (d, E) and J = ∂θ/∂p
the sensitivity of the estimate. The estimate itself stays what it is, to the bit.

J is that of an attitude whose tilt is that of the accelerometer and whose heading is that of the magnetometer, which
every filter here comes to while the body keeps its attitude. While it turns faster than the filter corrects, the error
is a mean over attitudes and the claim too large, never too small.

With up = s e_z, the horizon of a wrong specific force is off by ``θ_x = −s δ_y/g, θ_y = s δ_x/g`` in the navigation
frame, and the heading of a field of level part H along n and vertical part h_z by ``θ_z = (h_z/H) n·θ + (e_z×n)·δ/H``:
a wrong horizon takes some of the vertical field for level.

Departures from [Schmidt1966]: J is that of the settled filter, instead of one that is carried along with its gains.

Is the unit at rest? Then the mean of the gyroscope is its bias.

Rate and specific force are smoothed over half a second; rest is when both stay near their smooth selves for a while and
the rate is small enough to be a bias, [Laidig2023] section on rest detection.
"""

import math
from typing import Annotated, Final

import numpy as np

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.kernels import kernel
from plumbob.core.params import Spec
from plumbob.core.units import Quantity, deg
from plumbob.data.cards.residuals import Half, full_covariance
from plumbob.filters.input_checks import HOLD, off_gravity, usable
from plumbob.filters.layout import TRIAL, TRIAL_TIME, UP, Q, kept_weights, smooth
from plumbob.rotations.kernels import Vec, rotate, rows

RestRate = Annotated[float, Spec(Quantity.RATE, "at rest, the rate stays this near to its mean", 0, 10)]
RestForce = Annotated[
    float, Spec(Quantity.ACCELERATION, "at rest, the specific force stays this near to its mean", 0, 100)
]
RestAfter = Annotated[float, Spec(Quantity.TIME, "stillness after which rest begins", 0, 600)]

TAU = 0.5  # smoothing time, s
REST_SIZE = 18  # y and w of three rates and three specific forces; weights and their step; time at rest
_FORCE, _WEIGHTS, _STEP, _STILL = 6, 12, 16, 17


@kernel
def _channel(x: Floats, place: int, p: float, q: float, r: float, s: float, v: float) -> float:
    y, w = smooth(p, q, r, s, x[place], x[place + 1], v)
    x[place], x[place + 1] = y, w
    return v - y


@kernel
def _triad(x: Floats, place: int, p: float, q: float, r: float, s: float, vx: float, vy: float, vz: float) -> float:
    """Smooth a vector; returns the square of its distance from its smooth self."""
    ex = _channel(x, place, p, q, r, s, vx)
    ey = _channel(x, place + 2, p, q, r, s, vy)
    ez = _channel(x, place + 4, p, q, r, s, vz)
    return ex * ex + ey * ey + ez * ez


@kernel
def at_rest(
    x: Floats, at: int, dt: float, rate_limit: float, force_limit: float, bias_limit: float, after: float,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float,
) -> bool:  # fmt: skip
    """Take one sample, and say whether both triads have been still for longer than `after`, s.

    A sample without a rate or a specific force ends the rest.
    """
    if math.isnan(ax) or math.isnan(gx) or dt == 0.0:
        x[at + _STILL] = 0.0
        return False
    if x[at + _STEP] == 0.0:
        x[at], x[at + 2], x[at + 4] = gx, gy, gz
        x[at + _FORCE], x[at + _FORCE + 2], x[at + _FORCE + 4] = ax, ay, az
    p, q, r, s = kept_weights(x, at + _WEIGHTS, dt, TAU)
    rate2 = _triad(x, at, p, q, r, s, gx, gy, gz)
    force2 = _triad(x, at + _FORCE, p, q, r, s, ax, ay, az)
    small = abs(x[at]) <= bias_limit and abs(x[at + 2]) <= bias_limit and abs(x[at + 4]) <= bias_limit
    if rate2 < rate_limit * rate_limit and force2 < force_limit * force_limit and small:  # [Laidig2023]
        x[at + _STILL] += dt
    else:
        x[at + _STILL] = 0.0
    return bool(x[at + _STILL] >= after)


@kernel
def mean_rate(x: Floats, at: int) -> Vec:
    """Smoothed rate, rad/s."""
    return x[at], x[at + 2], x[at + 4]


@kernel
def mean_force(x: Floats, at: int) -> Vec:
    """Smoothed specific force, m/s²."""
    return x[at + _FORCE], x[at + _FORCE + 2], x[at + _FORCE + 4]


@kernel
def mean_speed(x: Floats, at: int) -> float:
    """Size of the smoothed rate, rad/s."""
    wx, wy, wz = mean_rate(x, at)
    return math.sqrt(wx * wx + wy * wy + wz * wz)


_STEEPEST = 0.05
"""A field whose level part is less than this of it, is taken to have that: at a magnetic pole nothing is linear."""


def considered(q_nb: Floats, field: Floats, up: float, north: tuple[float, float], acc: Half, mag: Half) -> Floats:
    """What the calibration adds to the covariance of the attitude error in body axes, (N, 3, 3), rad².

    `q_nb` (N, 4): attitudes; `field` (N, 2): level and vertical part of the field, along navigation z, µT; zero where
    no field gives the heading; `up`: +1 where navigation z points up, −1 where it points down; `north`: level direction
    that the magnetometer calls north, in the navigation frame; `acc`, `mag`: upper halves of the covariances of (d, E).
    """
    cov = np.zeros((len(q_nb), 3, 3))
    for of_mag, half in enumerate((acc, mag)):
        if any(half):
            consider(q_nb, field, up, *north, full_covariance(half), bool(of_mag), cov)
    return cov


@kernel
def consider(
    q_nb: Floats, field: Floats, up: float, nx: float, ny: float, residual: Floats, of_mag: bool, cov: Floats
) -> None:  # fmt: skip
    """Add to covariances what a calibration leaves of one triad, (12, 12) of its (d, E)."""
    r, turn, vector, both = np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    for n in range(cov.shape[0]):
        has_field = field[n, 0] > 0.0
        if of_mag and not has_field:
            continue
        level, steep = max(field[n, 0], _STEEPEST * abs(field[n, 1])), field[n, 1]
        lean = steep / level if has_field else 0.0
        r[0, 0], r[0, 1], r[0, 2], r[1, 0], r[1, 1], r[1, 2], r[2, 0], r[2, 1], r[2, 2] = rows(
            q_nb[n, 0], q_nb[n, 1], q_nb[n, 2], q_nb[n, 3]
        )
        for j in range(3):
            x, y, z = r[0, j], r[1, j], r[2, j]
            tx, ty, tz = -up / G0 * y, up / G0 * x, 0.0  # θ by an error along it
            if of_mag:
                vector[j] = level * (nx * x + ny * y) + steep * z
                tx, ty, tz = 0.0, 0.0, (nx * y - ny * x) / level
            else:
                vector[j] = up * G0 * z
                tz = lean * (nx * tx + ny * ty)
            for i in range(3):
                turn[i, j] = r[0, i] * tx + r[1, i] * ty + r[2, i] * tz
        for i in range(3):
            for j in range(3):
                s = residual[i, j]  # of d + E u
                for k in range(3):
                    s += vector[k] * (residual[i, 3 + 3 * j + k] + residual[3 + 3 * i + k, j])
                    for m in range(3):
                        s += vector[k] * vector[m] * residual[3 + 3 * i + k, 3 + 3 * j + m]
                both[i, j] = s
        for i in range(3):  # [Schmidt1966]
            sx = turn[i, 0] * both[0, 0] + turn[i, 1] * both[1, 0] + turn[i, 2] * both[2, 0]
            sy = turn[i, 0] * both[0, 1] + turn[i, 1] * both[1, 1] + turn[i, 2] * both[2, 1]
            sz = turn[i, 0] * both[0, 2] + turn[i, 1] * both[1, 2] + turn[i, 2] * both[2, 2]
            for j in range(3):
                cov[n, i, j] += sx * turn[j, 0] + sy * turn[j, 1] + sz * turn[j, 2]


def error_sensitivity(c_nb: Floats, vectors_n: Floats) -> Floats:
    """∂δ/∂p in the navigation frame, (N, 3, 12), of vectors (N, 3) in it: R (I, uᵀ ⊗ I) row by row."""
    u_b = (np.swapaxes(c_nb, 1, 2) @ vectors_n[..., np.newaxis])[..., 0]
    matrix = c_nb[:, :, :, np.newaxis] * u_b[:, np.newaxis, np.newaxis, :]
    return np.concatenate((c_nb, matrix.reshape(-1, 3, 9)), axis=2)


def residual_covariance(sensitivity: Floats, half: Half) -> Floats:
    """Covariance (N, 3, 3) that errors of this covariance, by its upper half, cause with this sensitivity."""
    if not any(half):
        return np.zeros((len(sensitivity), 3, 3))
    errors = full_covariance(half)
    sensitivity = sensitivity[:, :, : len(errors)]
    cov: Floats = sensitivity @ errors @ np.swapaxes(sensitivity, 1, 2)  # [Schmidt1966]
    return 0.5 * (cov + np.swapaxes(cov, 1, 2))


MEAN_TAU: Final = 2.0  # the specific force is averaged over this, s;
UPRIGHT: Final = math.tan(deg(3.0))
"""its mean points up if it leans by less than this, as a tangent,"""
UPRIGHT_FOR: Final = 3.0
"""and the attitude is converged after so long of that, s;"""
LONGEST: Final = 60.0
"""or after this, s, by a filter that corrects its tilt: every one has then forgotten its start."""
SIZE_BAND: Final = 0.02 * G0  # a first specific force this near to g, m/s², and
REST_TURN: Final = 0.1
"""a first rate below this, rad/s, are those of a unit at rest: it is converged at once."""

STEADY_FOR: Final = 1.0  # a unit rests that for this long, s, stays as it was in its first sample:
STEADY: Final = 0.02 * G0, 0.02
"""specific force, m/s², and rate, rad/s, are within this of it on each axis, and"""
STEADY_BAND: Final = 0.1 * G0, 0.35
"""off by no more than an uncalibrated part may be at rest: 0.1 g in size, 20 °/s on each axis (MPU-6000 data sheet)."""

_ON, _LOOKED, _AGE, _ELAPSED, _UPRIGHT, _MEAN_FORCE, _STEADY, _FIRST = 0, 1, 2, 3, 4, 5, 8, 9  # places from TRIAL
TRIAL_SIZE: Final = 15
_UNUSED: Final = flags.ACC_STUCK | flags.ACC_CLIPPED


def trial_time(needs: tuple[str, ...]) -> float:
    """Longest trial, s, of a filter that needs these triads."""
    if "gyr" not in needs:
        return 0.0  # each sample is a start of its own, and no better later
    return LONGEST if "acc" in needs else math.inf  # a filter that integrates keeps a wrong tilt, and so the flag


@kernel
def begin(x: Floats) -> None:
    """Put the attitude on trial."""
    for k in range(TRIAL_SIZE):
        x[TRIAL + k] = 0.0
    x[TRIAL + _ON] = 1.0


@kernel
def average(c: Floats, x: Floats, ax: float, ay: float, az: float) -> bool:
    """Average a specific force in navigation axes; returns whether the mean points up."""
    fx, fy, fz = rotate(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], ax, ay, az)
    age = x[TRIAL + _AGE]
    gain = age / (age + MEAN_TAU) if x[TRIAL + _LOOKED] > 0.0 else 1.0
    at = TRIAL + _MEAN_FORCE
    x[at] += gain * (fx - x[at])
    x[at + 1] += gain * (fy - x[at + 1])
    x[at + 2] += gain * (fz - x[at + 2])
    x[TRIAL + _LOOKED], x[TRIAL + _AGE] = 1.0, 0.0
    return bool(math.sqrt(x[at] * x[at] + x[at + 1] * x[at + 1]) < UPRIGHT * (c[UP] * x[at + 2]))


@kernel
def stands(gx: float, gy: float, gz: float, ax: float, ay: float, az: float) -> bool:
    """True for a rate and a specific force of a unit at rest, as far as one sample can tell; not for NaN."""
    turns = math.sqrt(gx * gx + gy * gy + gz * gz)
    return off_gravity(ax, ay, az) < SIZE_BAND and turns < REST_TURN


@kernel
def may_rest(gx: float, gy: float, gz: float, ax: float, ay: float, az: float) -> bool:
    """True for a rate and a specific force that an uncalibrated unit at rest may have; not for NaN."""
    size, turn = STEADY_BAND
    slow = abs(gx) < turn and abs(gy) < turn and abs(gz) < turn
    return slow and off_gravity(ax, ay, az) < size


@kernel
def steady(
    x: Floats, first: bool, since: float, gx: float, gy: float, gz: float, ax: float, ay: float, az: float
) -> bool:
    """Follow a unit that is as it was when it began; returns whether it has been so for long enough."""
    at = TRIAL + _FIRST
    if first:
        x[TRIAL + _STEADY] = -1.0
        if may_rest(gx, gy, gz, ax, ay, az):
            x[TRIAL + _STEADY] = 0.0
            x[at], x[at + 1], x[at + 2], x[at + 3], x[at + 4], x[at + 5] = gx, gy, gz, ax, ay, az
        return False
    if x[TRIAL + _STEADY] < 0.0:
        return False
    force, turn = STEADY
    turns = abs(gx - x[at]) < turn and abs(gy - x[at + 1]) < turn and abs(gz - x[at + 2]) < turn
    leans = abs(ax - x[at + 3]) < force and abs(ay - x[at + 4]) < force and abs(az - x[at + 5]) < force
    x[TRIAL + _STEADY] = x[TRIAL + _STEADY] + min(since, HOLD) if turns and leans else -1.0
    return bool(x[TRIAL + _STEADY] >= STEADY_FOR)


@kernel
def converged(
    c: Floats, x: Floats, dt: float, flags_in: int,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float,
) -> bool:  # fmt: skip
    """Take one sample of a trial, and say whether it is over."""
    first = x[TRIAL + _LOOKED] == 0.0
    x[TRIAL + _AGE] += dt
    x[TRIAL + _ELAPSED] += dt
    if usable(ax, ay, az) and not flags_in & _UNUSED:
        since = x[TRIAL + _AGE]
        if steady(x, first, since, gx, gy, gz, ax, ay, az):
            return True
        if not average(c, x, ax, ay, az):
            x[TRIAL + _UPRIGHT] = 0.0
        elif not first:
            x[TRIAL + _UPRIGHT] += min(since, HOLD)  # what was not seen is no evidence
        elif stands(gx, gy, gz, ax, ay, az):
            return True
    return bool(x[TRIAL + _UPRIGHT] >= UPRIGHT_FOR or x[TRIAL + _ELAPSED] >= c[TRIAL_TIME])


@kernel
def settle(
    c: Floats, x: Floats, dt: float, flags_in: int, blind: bool, word: int,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float,
) -> int:  # fmt: skip
    """Flag of an attitude on trial; a blind step, or one whose filter says that it is not converged, begins one."""
    if blind or word & flags.NOT_CONVERGED:
        begin(x)
        dt = 0.0
    if x[TRIAL + _ON] == 0.0:
        return 0
    if word & flags.NOT_CONVERGED == 0 and converged(c, x, dt, flags_in, gx, gy, gz, ax, ay, az):
        x[TRIAL + _ON] = 0.0
        return 0
    return flags.NOT_CONVERGED
