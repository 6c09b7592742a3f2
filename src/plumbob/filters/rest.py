"""Is the unit at rest? Then the mean of the gyroscope is its bias.

Rate and specific force are smoothed over half a second; rest is when both stay near their smooth selves for a while and
the rate is small enough to be a bias, [Laidig2023] section on rest detection.
"""

import math
from typing import Annotated

from plumbob.core._jit import njit
from plumbob.core.check import Floats
from plumbob.core.params import Spec
from plumbob.core.units import Quantity
from plumbob.filters.layout import kept_weights, smooth
from plumbob.rotations.kernels import Vec

RestRate = Annotated[float, Spec(Quantity.RATE, "at rest, the rate stays this near to its mean", 0, 10)]
RestForce = Annotated[
    float, Spec(Quantity.ACCELERATION, "at rest, the specific force stays this near to its mean", 0, 100)
]
RestAfter = Annotated[float, Spec(Quantity.TIME, "stillness after which rest begins", 0, 600)]

TAU = 0.5
"""Smoothing time, s."""
REST_SIZE = 18  # y and w of three rates and three specific forces; weights and their step; time at rest
_FORCE, _WEIGHTS, _STEP, _STILL = 6, 12, 16, 17


@njit
def _channel(x: Floats, place: int, p: float, q: float, r: float, s: float, v: float) -> float:
    y, w = smooth(p, q, r, s, x[place], x[place + 1], v)
    x[place], x[place + 1] = y, w
    return v - y


@njit
def _triad(x: Floats, place: int, p: float, q: float, r: float, s: float, vx: float, vy: float, vz: float) -> float:
    """Smooth a vector; returns the square of its distance from its smooth self."""
    ex = _channel(x, place, p, q, r, s, vx)
    ey = _channel(x, place + 2, p, q, r, s, vy)
    ez = _channel(x, place + 4, p, q, r, s, vz)
    return ex * ex + ey * ey + ez * ez


@njit
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


@njit
def mean_rate(x: Floats, at: int) -> Vec:
    """Smoothed rate, rad/s."""
    return x[at], x[at + 2], x[at + 4]


@njit
def mean_speed(x: Floats, at: int) -> float:
    """Size of the smoothed rate, rad/s."""
    wx, wy, wz = mean_rate(x, at)
    return math.sqrt(wx * wx + wy * wy + wz * wz)
