"""What may enter a filter: time steps and rates are judged before they change any state."""

import math

from plumbob import flags
from plumbob._jit import njit
from plumbob.check import Floats
from plumbob.constants import G0
from plumbob.filters.layout import BLIND, COUNT, HELD, MAX_GAP, RATE, STAGE

HOLD = 0.1
"""A missing rate is taken to go on as it was for this long, s; then it counts as zero. Lost packets are shorter."""

_MAX_ANGLE2 = math.pi * math.pi  # a turn of more than half a revolution in one step has no unique axis


@njit
def admit(c: Floats, x: Floats, dt: float, gx: float, gy: float, gz: float) -> tuple[int, float, float, float, float]:
    """Judge one step.

    Returns
    -------
    tuple
        Flags, then the step, s, and the rate, rad/s, to integrate.
    """
    x[COUNT] += 1.0
    found = 0
    if dt > c[MAX_GAP]:  # what happened meanwhile is unknown: start again, never integrate a jump
        found = flags.GAP
        x[STAGE] = BLIND
        dt = 0.0
    size2 = gx * gx + gy * gy + gz * gz
    if size2 * (dt * dt) < _MAX_ANGLE2 and size2 < math.inf:
        x[RATE], x[RATE + 1], x[RATE + 2] = gx, gy, gz
        x[HELD] = 0.0
        return found, dt, gx, gy, gz
    x[HELD] += dt
    if x[HELD] > HOLD:
        x[RATE], x[RATE + 1], x[RATE + 2] = 0.0, 0.0, 0.0
    return found | flags.GYR_HELD, dt, x[RATE], x[RATE + 1], x[RATE + 2]


@njit
def judge(
    known: int, vx: float, vy: float, vz: float, limit: float, absent: int, invalid: int
) -> tuple[int, float, float, float]:
    """Flags of one sample of a triad, and its values, NaN where they cannot be used; as `ImuData` judges them."""
    if math.isnan(vx) or math.isnan(vy) or math.isnan(vz):
        return absent, math.nan, math.nan, math.nan
    if known or abs(vx) > limit or abs(vy) > limit or abs(vz) > limit:
        return invalid, math.nan, math.nan, math.nan
    return 0, vx, vy, vz


@njit
def refused(flag: int, vx: float, vy: float, vz: float) -> int:
    """Flag of a vector that is there but was not used; none for NaN, which other flags explain."""
    return 0 if math.isnan(vx) or math.isnan(vy) or math.isnan(vz) else flag


@njit
def off_gravity(ax: float, ay: float, az: float) -> float:
    """By how much a specific force is longer or shorter than g, m/s²; NaN for NaN."""
    return abs(math.sqrt(ax * ax + ay * ay + az * az) - G0)


@njit
def usable(vx: float, vy: float, vz: float) -> bool:
    """True for a vector that has a direction: finite and not zero."""
    size2 = vx * vx + vy * vy + vz * vz
    return size2 > 1e-12 and size2 < math.inf  # 1e-6 m/s² or µT is far below any sensor's last digit
