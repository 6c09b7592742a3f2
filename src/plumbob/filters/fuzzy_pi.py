"""Complementary filter whose rate is corrected by fuzzy rules, by a PI law, or by their mean: the teaching-arm paper.

The error is formed at the attitude that the gyroscope predicts for the time of the sample: the vector products of
measured and predicted up direction and field, added. Each axis has its own regulator. With ``fuzzy`` and ``pi`` on, the
mean of both corrections is taken, as the paper takes it of its two sets of sensors, here with one set for both; with
both off, nothing is corrected.

The fuzzy regulator infers by products and the height method, in degrees. The paper prints no rules. The default table
(``slope=0.3, far=3deg/s``) is one that comes near the paper's figures at rest. It is slow to forget a large error, and
so is the PI law alone: what their integrals have taken up meanwhile goes out as slowly as they learn a bias.
``sum_table=on`` takes another natural table, where the numbers of both sets are added: its gain is 4.5 1/s near zero
and 3 1/s² for the integral, it forgets 10° in seconds and is noisier at rest. With ``slope=4.5, far=9deg/s`` the table
is as steep, but its integral weak. A gain of K needs steps well below 2/K.

This is not the whole of the paper: neither the array of six units nor the Kalman filter behind it. What one set of
sensors does at rest is printed by::

    plumbob benchmark scenario arm --set turn=0deg --sensors arm --unit random --frame NED --filters integrate,fuzzy_pi

and what it does in the paper's turn without ``--set`` and with ``--sensors arm:turn``; ``--params fuzzy_pi.fuzzy=off``
leaves the PI law alone. The noise of these sensors is assumed: with what the paper states, its errors would be 15
times smaller, and without a regulator 30 000 times.

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

Fuzzy regulator of the teaching-arm paper [HuangJiang]: a correction from an error and its integral, by 7 × 7 rules.

Like the paper it works in degrees: error in deg, integral in deg s, correction in deg/s. Who calls it with radians
gets a gain 57 times too small, which at rest even looks better, because it lets less noise through.

==============  =============================  =====================================================================
universe        from                           sets: seven triangles, each down to zero at its neighbours' centres
==============  =============================  =====================================================================
E, [−6, 6]      3 × error                      centres −6, −4, … 6, that is each 2/3 deg
I, [−3, 3]      1 × integral                   centres −3, −2, … 3, that is each 1 deg s
U, [−9, 9]      correction is 1 × U            centres as the rules conclude them
==============  =============================  =====================================================================

A value beyond its universe counts as its end. The rule of E set e and I set i, numbered −3 to 3, concludes
``U = c(e) + ki·i``, cut to ±9, where c is odd: 0, near, 2 near, far. Inference is by product, and the correction is the
mean of the conclusions with the rules' strengths as weights (height method). As the triangles of a universe add up to
one, this is bilinear interpolation between the rules. It is not Mamdani's minimum and centre of area, which gives other
numbers from the same table: there the output never reaches the end of its universe.
"""

import math
from typing import Annotated, Final, NamedTuple

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.core.kernels import kernel
from plumbob.core.params import Spec
from plumbob.core.units import Quantity, dps, to_dps
from plumbob.filters.complementary import predict
from plumbob.filters.input_checks import admit, refused, usable
from plumbob.filters.integrate import turn
from plumbob.filters.layout import BIAS, HEADED, OWN, OWN_C, RATE, STAGE, UP, Q
from plumbob.filters.mahony import field_error
from plumbob.filters.start import initialise, up_in_body
from plumbob.rotations.kernels import cross

E_FACTOR: Final = 3.0
E_END: Final = 6.0
I_END: Final = 3.0
U_END: Final = 9.0
SETS: Final = 3  # on each side of the one in the middle
SPACING: Final = E_END / (SETS * E_FACTOR)  # distance of two neighbouring sets of the error, deg


@kernel
def wind(integral: float, error: float, dt: float) -> float:
    """Integral of the error, deg s, stopped at the ends of its universe: beyond them the rules would not see it."""
    return min(max(integral + error * dt, -I_END), I_END)


@kernel
def grades(value: float, end: float) -> tuple[int, float]:
    """Lower of the two neighbouring sets, −3 to 2, to which a value belongs, and its grade in the upper one.

    Its grade in the lower set is what is missing to one, and zero in all others.
    """
    place = (SETS / end) * min(max(value, -end), end)
    lower = min(math.floor(place), SETS - 1)
    return lower, place - lower


@kernel
def conclusion(e: int, i: int, near: float, far: float, ki: float) -> float:
    """What the rule of error set e and integral set i, each −3 to 3, concludes, deg/s."""
    size = far if abs(e) == SETS else abs(e) * near
    u = (size if e > 0 else -size) + ki * i
    return min(max(u, -U_END), U_END)


@kernel
def regulate(error: float, integral: float, near: float, far: float, ki: float) -> float:
    """Correction, deg/s, of an error, deg, whose integral is given, deg s.

    `near` and `far` are the conclusions, deg/s, for errors of 2/3 deg and of 2 deg; `ki` is the gain of the integral,
    1/s².
    """
    e, upper_e = grades(E_FACTOR * error, E_END)  # [HuangJiang]: factors 3, 1, 1 and universes ±6, ±3, ±9
    i, upper_i = grades(integral, I_END)
    lower_e, lower_i = 1.0 - upper_e, 1.0 - upper_i
    return (
        lower_e * lower_i * conclusion(e, i, near, far, ki)
        + lower_e * upper_i * conclusion(e, i + 1, near, far, ki)
        + upper_e * lower_i * conclusion(e + 1, i, near, far, ki)
        + upper_e * upper_i * conclusion(e + 1, i + 1, near, far, ki)
    )


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

    Raises ParameterError if a large error would be corrected less than a small one.
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


@kernel
def tilt_error(c: Floats, x: Floats, ax: float, ay: float, az: float) -> tuple[int, float, float, float]:
    """Turn that would bring the predicted up direction onto the specific force; zero and a flag where it is absent."""
    if not usable(ax, ay, az):
        return refused(flags.ACC_GATED, ax, ay, az), 0.0, 0.0, 0.0
    scale = 1.0 / math.sqrt(ax * ax + ay * ay + az * az)
    ux, uy, uz = up_in_body(c[UP], x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    ex, ey, ez = cross(scale * ax, scale * ay, scale * az, ux, uy, uz)  # [HuangJiang]: e = a × Rᵀaₙ + m × Rᵀmₙ
    return 0, ex, ey, ez


@kernel
def by_rules(c: Floats, x: Floats, axis: int, dt: float, e: float) -> float:
    """Correction of the rate about one axis by the fuzzy rules, which think in degrees, rad/s."""
    error = math.degrees(e)
    x[WOUND + axis] = wind(x[WOUND + axis], error, dt)
    return math.radians(regulate(error, x[WOUND + axis], c[NEAR], c[FAR], c[RULE_KI]))


@kernel
def by_pi(c: Floats, x: Floats, axis: int, dt: float, e: float) -> float:
    """Correction of the rate about one axis by the PI law, rad/s."""
    x[INTEGRAL + axis] += dt * e
    u: float = c[KP] * e + c[KI] * x[INTEGRAL + axis]  # [HuangJiang]
    return u


@kernel
def correction(c: Floats, x: Floats, axis: int, dt: float, e: float) -> float:
    """Correction of the rate about one axis beyond the bias known before, rad/s; learns the bias too."""
    bias = x[BIAS + axis]
    fuzzy = by_rules(c, x, axis, dt, e)
    linear = by_pi(c, x, axis, dt, e)
    u = c[FUZZY] * fuzzy + c[PI] * linear  # [HuangJiang] (20)
    steady = c[FUZZY] * math.radians(c[RULE_KI] * x[WOUND + axis]) + c[PI] * (c[KI] * x[INTEGRAL + axis])
    # departs from [HuangJiang]: the prediction takes off the bias known so far
    x[BIAS + axis] = -steady  # what would remain of u without an error
    more: float = u + bias
    return more


@kernel
def step(
    c: Floats, x: Floats, dt: float, flags_in: int,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float, mx: float, my: float, mz: float,
) -> int:  # fmt: skip
    """Take one sample."""
    px, py, pz = x[RATE], x[RATE + 1], x[RATE + 2]
    word, dt, gx, gy, gz = admit(c, x, dt, gx, gy, gz)
    bx, by, bz = x[BIAS], x[BIAS + 1], x[BIAS + 2]
    predict(x, dt, px - bx, py - by, pz - bz, gx - bx, gy - by, gz - bz)
    if x[STAGE] < HEADED:
        word |= initialise(c, x, ax, ay, az, mx, my, mz)
    acc_flag, tx, ty, tz = tilt_error(c, x, ax, ay, az)
    mag_flag, fx, fy, fz = field_error(c, x, mx, my, mz)
    ux = correction(c, x, 0, dt, tx + fx)
    uy = correction(c, x, 1, dt, ty + fy)
    uz = correction(c, x, 2, dt, tz + fz)
    turn(x, dt * ux, dt * uy, dt * uz)  # departs from [HuangJiang]: an exact turn, about the predicted attitude
    return word | acc_flag | mag_flag
