"""Fuzzy regulator of the teaching-arm paper [HuangJiang]: a correction from an error and its integral, by 7 × 7 rules.

Like the paper it works in degrees: error in deg, integral in deg s, correction in deg/s. Who calls it with radians
gets a gain 57 times too small, which at rest even looks better, for it lets less noise through.

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
from typing import Final

from plumbob._jit import njit

E_FACTOR: Final = 3.0
E_END: Final = 6.0
I_END: Final = 3.0
U_END: Final = 9.0
SETS: Final = 3  # on each side of the one in the middle
SPACING: Final = E_END / (SETS * E_FACTOR)
"""Distance of two neighbouring sets of the error, deg."""


@njit
def wind(integral: float, error: float, dt: float) -> float:
    """Integral of the error, deg s, stopped at the ends of its universe: beyond them the rules would not see it."""
    return min(max(integral + error * dt, -I_END), I_END)


@njit
def grades(value: float, end: float) -> tuple[int, float]:
    """Lower of the two neighbouring sets, −3 to 2, to which a value belongs, and its grade in the upper one.

    Its grade in the lower set is what is missing to one, and zero in all others.
    """
    place = (SETS / end) * min(max(value, -end), end)
    lower = min(math.floor(place), SETS - 1)
    return lower, place - lower


@njit
def conclusion(e: int, i: int, near: float, far: float, ki: float) -> float:
    """What the rule of error set e and integral set i, each −3 to 3, concludes, deg/s."""
    size = far if abs(e) == SETS else abs(e) * near
    u = (size if e > 0 else -size) + ki * i
    return min(max(u, -U_END), U_END)


@njit
def regulate(error: float, integral: float, near: float, far: float, ki: float) -> float:
    """Correction, deg/s, of an error, deg, whose integral is given, deg s.

    `near` and `far` are the conclusions, deg/s, for errors of 2/3 deg and of 2 deg; `ki` is the gain of the integral,
    1/s².
    """
    e, upper_e = grades(E_FACTOR * error, E_END)
    i, upper_i = grades(integral, I_END)
    lower_e, lower_i = 1.0 - upper_e, 1.0 - upper_i
    return (
        lower_e * lower_i * conclusion(e, i, near, far, ki)
        + lower_e * upper_i * conclusion(e, i + 1, near, far, ki)
        + upper_e * lower_i * conclusion(e + 1, i, near, far, ki)
        + upper_e * upper_i * conclusion(e + 1, i + 1, near, far, ki)
    )
