"""Complementary filter whose rate is corrected by fuzzy rules, by a PI law, or by their mean: the teaching-arm paper.

The error is formed at the attitude that the gyroscope predicts for the time of the sample: the vector products of
measured and predicted up direction and field, added. Each axis has its own regulator. With ``fuzzy`` and ``pi`` on, the
mean of both corrections is taken, as the paper takes it of its two sets of sensors, here with one set for both; with
both off, nothing is corrected.

The fuzzy regulator is described in `plumbob.filters.fuzzy`: product inference, height method, degrees. The paper prints
no rules. The default table (``slope=0.3, far=3deg/s``) is one that comes near the paper's figures at rest. It is slow
to forget a large error, and so is the PI law alone: what their integrals have taken up meanwhile goes out as slowly as
they learn a bias. ``sum_table=on`` takes another natural table, where the numbers of both sets are added: its gain is
4.5 1/s near zero and 3 1/s² for the integral, it forgets 10° in seconds and is noisier at rest. With
``slope=4.5, far=9deg/s`` the table is as steep, but its integral weak. A gain of K needs steps well below 2/K.

This is not the whole of the paper: neither the array of six units nor the Kalman filter behind it. What one set of
sensors does at rest is printed by::

    plumbob benchmark scenario arm --set turn=0deg --sensors arm --module drawn --frame NED --filters integrate,fuzzy_pi

and what it does in the paper's turn without ``--set`` and with ``--sensors arm:turn``; ``--params fuzzy_pi.fuzzy=off``
leaves the PI law alone. The noise of these sensors is assumed: with what the paper states, its errors would be 50 to
5000 times smaller.

When to choose it: to reproduce the paper; with a steep table, where large errors must be forgotten quickly.

=========  ============  =======  =====================================================
symbol     name          unit     meaning
=========  ============  =======  =====================================================
q          x[Q]          1        attitude q_nb
b          x[BIAS]       rad/s    what the integrals take for the gyroscope's bias
∫e         x[INTEGRAL]   rad s    integral of the PI law, without limit as in the paper
I          x[WOUND]      deg s    integral of the rules, stopped at ±3
P          kp            1/s      proportional gain of the PI law
I          ki            1/s²     integral gain of the PI law, and of the default table
=========  ============  =======  =====================================================

Departures from [HuangJiang]: its frame "east, north, down" is north, east, down, and any level frame here; the error
belongs to the predicted attitude, not to that of the sample before, which would lag in a turn. The prediction takes
off the bias known so far, and what u has beyond that follows, both as exact turns; otherwise an attitude without error
would be turned away from itself by b Δt. The magnetic reference is the measured field turned level and to north, so a
dip angle is not needed. The paper's K = 0.8 is a gain of 0.8 1/s, a corner at 0.13 Hz and not at 15 Hz.
"""

import math
from typing import Annotated, Final, NamedTuple

from plumbob import flags
from plumbob._jit import njit
from plumbob.check import Floats
from plumbob.errors import ParameterError
from plumbob.filters.admission import admit, refused, usable
from plumbob.filters.alignment import initialise, up_in_body
from plumbob.filters.complementary import predict
from plumbob.filters.fuzzy import I_END, SETS, SPACING, U_END, regulate, wind
from plumbob.filters.integrate import turn
from plumbob.filters.layout import BIAS, HEADED, OWN, OWN_C, RATE, STAGE, UP, Q
from plumbob.filters.mahony import field_error
from plumbob.params import Spec
from plumbob.rotations.kernels import cross
from plumbob.units import Quantity, dps, to_dps

SUMMARY: Final = "rate corrected by fuzzy rules, a PI law or their mean (teaching-arm paper)"
REFERENCES: Final = ("HuangJiang",)
NEEDS: Final = ("gyr", "acc")
STATE: Final = 6

FUZZY: Final = OWN_C  # share of the fuzzy correction
PI: Final = OWN_C + 1  # share of the PI law's
KP: Final = OWN_C + 2
KI: Final = OWN_C + 3
NEAR: Final = OWN_C + 4  # of the rules, deg/s
FAR: Final = OWN_C + 5  # of the rules, deg/s
RULE_KI: Final = OWN_C + 6  # of the rules, 1/s²
INTEGRAL: Final = OWN
WOUND: Final = OWN + 3

_SUM_NEAR = U_END / SETS  # one set further, in E or in I, is one set further in U
_SUM_KI = _SUM_NEAR / (I_END / SETS)


class Params(NamedTuple):
    """Regulators and their gains; the defaults are the paper's, and for the rules those that reproduce it best."""

    fuzzy: Annotated[bool, Spec(Quantity.RATIO, "correct by the fuzzy rules; with pi, by the mean of both")] = True
    pi: Annotated[bool, Spec(Quantity.RATIO, "correct by the PI law; with fuzzy, by the mean of both")] = True
    kp: Annotated[float, Spec(Quantity.GAIN, "proportional gain of the PI law", 0, 100)] = 0.8
    ki: Annotated[
        float, Spec(Quantity.GAIN_RATE, "integral gain, of the PI law and of the rules", 0, U_END / I_END)
    ] = 0.02
    slope: Annotated[
        float, Spec(Quantity.GAIN, "gain of the rules for errors up to 4/3°", 0, U_END / (2 * SPACING))
    ] = 0.3
    far: Annotated[
        float, Spec(Quantity.RATE, "correction by the rules from 2° on; raise it to recover faster", 0, dps(U_END))
    ] = dps(3.0)
    sum_table: Annotated[
        bool,
        Spec(Quantity.RATIO, "rules that add up error and integral, 4.5 1/s and 3 1/s2, for slope, far and their ki"),
    ] = False


def coefficients(params: Params) -> tuple[float, ...]:
    """Own coefficients of the kernel.

    Raises
    ------
    ParameterError
        If a large error would be corrected less than a small one.
    """
    both = max(1, params.fuzzy + params.pi)
    near, far, rule_ki = params.slope * SPACING, to_dps(params.far), params.ki
    if params.sum_table:
        near, far, rule_ki = _SUM_NEAR, U_END, _SUM_KI
    if far < 2.0 * near:
        raise ParameterError(
            f"fuzzy_pi: far must be at least 4/3° × slope, {2.0 * near:g} deg/s, but it is {far:g} deg/s; "
            "raise far or lower slope."
        )
    return params.fuzzy / both, params.pi / both, params.kp, params.ki, near, far, rule_ki


@njit
def tilt_error(c: Floats, x: Floats, ax: float, ay: float, az: float) -> tuple[int, float, float, float]:
    """Turn that would bring the predicted up direction onto the specific force; zero and a flag where it is absent."""
    if not usable(ax, ay, az):
        return refused(flags.ACC_GATED, ax, ay, az), 0.0, 0.0, 0.0
    scale = 1.0 / math.sqrt(ax * ax + ay * ay + az * az)
    ux, uy, uz = up_in_body(c[UP], x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    ex, ey, ez = cross(scale * ax, scale * ay, scale * az, ux, uy, uz)  # [HuangJiang] e = a × Rᵀaₙ + m × Rᵀmₙ
    return 0, ex, ey, ez


@njit
def by_rules(c: Floats, x: Floats, axis: int, dt: float, e: float) -> float:
    """Correction of the rate about one axis by the fuzzy rules, which think in degrees, rad/s."""
    error = math.degrees(e)
    x[WOUND + axis] = wind(x[WOUND + axis], error, dt)
    return math.radians(regulate(error, x[WOUND + axis], c[NEAR], c[FAR], c[RULE_KI]))


@njit
def by_pi(c: Floats, x: Floats, axis: int, dt: float, e: float) -> float:
    """Correction of the rate about one axis by the PI law, rad/s."""
    x[INTEGRAL + axis] += dt * e
    u: float = c[KP] * e + c[KI] * x[INTEGRAL + axis]
    return u


@njit
def correction(c: Floats, x: Floats, axis: int, dt: float, e: float) -> float:
    """Correction of the rate about one axis beyond the bias known before, rad/s; learns the bias too."""
    known = x[BIAS + axis]
    u = c[FUZZY] * by_rules(c, x, axis, dt, e) + c[PI] * by_pi(c, x, axis, dt, e)
    kept = c[FUZZY] * math.radians(c[RULE_KI] * x[WOUND + axis]) + c[PI] * (c[KI] * x[INTEGRAL + axis])
    x[BIAS + axis] = -kept  # what would remain of u without an error
    more: float = u + known
    return more


@njit
def step(
    c: Floats, x: Floats, dt: float, seen: int,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float, mx: float, my: float, mz: float,
) -> int:  # fmt: skip
    """Take one sample."""
    px, py, pz = x[RATE], x[RATE + 1], x[RATE + 2]
    found, dt, gx, gy, gz = admit(c, x, dt, gx, gy, gz)
    bx, by, bz = x[BIAS], x[BIAS + 1], x[BIAS + 2]
    predict(x, dt, px - bx, py - by, pz - bz, gx - bx, gy - by, gz - bz)
    if x[STAGE] < HEADED:
        found |= initialise(c, x, ax, ay, az, mx, my, mz)
    acc_flag, tx, ty, tz = tilt_error(c, x, ax, ay, az)
    mag_flag, fx, fy, fz = field_error(c, x, mx, my, mz)
    ux = correction(c, x, 0, dt, tx + fx)
    uy = correction(c, x, 1, dt, ty + fy)
    uz = correction(c, x, 2, dt, tz + fz)
    turn(x, dt * ux, dt * uy, dt * uz)
    return found | acc_flag | mag_flag
