"""What may enter a filter: time steps, rates and samples are judged before they change any state.

Is a sensor stuck? Noise makes a working one say something new all the time; the same bits again and again do not.

This runs before every filter's step and only flags: what to make of it is the filter's choice. A slow magnetometer
whose value is repeated until the next one comes is not stuck, and neither is one that is absent in between.

What the modern filters let in: nothing stuck or clipped, no spike; and how far the attitude may have run off.

`admission` judges one sample by itself. Here the rate is also compared with the one before: a jump that no body makes
in one step is held back for one sample, and made up for if the next sample confirms it. And where the rate is not
known (absent, clipped, stuck, or skipped by a gap), the angle that may have been missed is counted, so that a filter
can open its gains or begin again instead of trusting a wrong attitude.
"""

import math
from typing import Final

from plumbob.core import flags
from plumbob.core._jit import njit
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import deg, dps
from plumbob.filters.axis_checks import CLIPPED, LONG, MANY, STUCK, WRAPPED, axis_flags
from plumbob.filters.layout import BLIND, COUNT, HELD, LAST, MAX_GAP, RATE, SAME, STAGE
from plumbob.rotations.kernels import Vec

_MIX_Y, _MIX_Z = math.sqrt(2.0), math.sqrt(3.0)  # no combination of whole steps of the axes gives the same sum


@njit
def as_one(vx: float, vy: float, vz: float) -> float:
    """One number for the three axes; it stays the same where they do, and practically only there."""
    return vx + _MIX_Y * vy + _MIX_Z * vz


@njit
def or_zero(value: float) -> float:
    """Zero for NaN."""
    return 0.0 if math.isnan(value) else value


@njit
def _repeats(x: Floats, triad: int, dt: float, vx: float, vy: float, vz: float) -> bool:
    said = as_one(vx, vy, vz)
    if said != x[LAST + triad]:
        if math.isnan(said):  # absent: the clock goes on
            x[SAME + triad] += dt
        else:
            x[LAST + triad], x[SAME + triad] = said, 0.0
        return False
    x[SAME + triad] += dt
    return bool(x[SAME + triad] > LONG and x[SAME + triad] > MANY * dt)


@njit
def watch(
    x: Floats, dt: float,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float, mx: float, my: float, mz: float,
) -> int:  # fmt: skip
    """Flags of the triads that are stuck, or that have an axis which is stuck or beyond its range."""
    found, gyr = 0, axis_flags(x, 0, dt, gx, gy, gz)
    if _repeats(x, 0, dt, gx, gy, gz) or gyr & STUCK:
        found |= flags.GYR_STUCK
    if _repeats(x, 1, dt, ax, ay, az) or axis_flags(x, 1, dt, ax, ay, az):
        found |= flags.ACC_STUCK
    if _repeats(x, 2, dt, mx, my, mz) or axis_flags(x, 2, dt, mx, my, mz):
        found |= flags.MAG_STUCK
    if gyr & CLIPPED:
        found |= flags.GYR_CLIPPED
    if gyr & WRAPPED:
        found |= flags.GYR_INVALID
    return found


JUMP: Final = 1000.0
"""A rate that changes faster than this, rad/s², is a spike until the next sample confirms it."""
UNKNOWN_RATE: Final = 2.0
"""How fast a body may turn, rad/s, of which nothing is known."""
UNKNOWN_CHANGE: Final = 20.0
"""How fast a rate may change, rad/s², of which nothing is known."""
LONG_STEP: Final = 0.15
"""In a step longer than this, s, the rate may have been anything between its ends."""

STALE: Final = deg(2.0)
"""A vector that is the same after this turn, rad, is an old one."""

START_BAND: Final = 0.3 * G0
"""An attitude is taken up only from a specific force this near to g, m/s²."""
JUMP_SD: Final = dps(5.0)
"""Standard deviation of a bias that has jumped, rad/s; a horizon that leans tells of it."""

LEAN: Final = 0.15 * G0
"""A specific force whose mean is level by more than this, m/s²,"""
LEAN_TAU: Final = 1.0
"""over this, s, leans."""
LONGER: Final = 0.01 * G0
"""An acceleration that makes it lean makes it longer by √(1 + 0.15²) − 1 of g: more than this, m/s²."""
SIZE_TAU: Final = 30.0
"""What the size of gravity is to this sensor is learned over this, s."""
STEADY: Final = 0.03 * G0
"""A specific force whose size has varied by less than this, m/s²,"""
STEADY_TAU: Final = 3.0
"""over this, s, is that of a body which does not accelerate."""
KEEPS_ON: Final = 0.06 * G0
"""If its mean is longer than gravity by this, m/s², over the same time, the body keeps accelerating."""
GRAVITY_SIZE: Final = 4

GUARD_SIZE: Final = 4
_SPIKE, _WAITING = 0, 3  # places of the rate that waits for confirmation, and of whether one does

Admitted = tuple[int, float, float, float, float, float]
Held = tuple[bool, float, float, float, float, float, float]


@njit
def hold_spike(x: Floats, at: int, dt: float, gx: float, gy: float, gz: float) -> Held:
    """Hold back a rate that jumps; returns whether it was, the rate to use, and what must be made up for."""
    px, py, pz = x[RATE], x[RATE + 1], x[RATE + 2]
    jump = max(abs(gx - px), abs(gy - py), abs(gz - pz))
    if not jump > JUMP * dt or x[HELD] > 0.0:
        x[at + _WAITING] = 0.0
        return False, gx, gy, gz, 0.0, 0.0, 0.0
    if x[at + _WAITING] == 0.0:
        x[at + _SPIKE], x[at + _SPIKE + 1], x[at + _SPIKE + 2], x[at + _WAITING] = gx, gy, gz, 1.0
        return True, px, py, pz, 0.0, 0.0, 0.0
    x[at + _WAITING] = 0.0  # confirmed: what the held sample did not turn is made up for
    sx, sy, sz = x[at + _SPIKE], x[at + _SPIKE + 1], x[at + _SPIKE + 2]
    return False, gx, gy, gz, sx - px, sy - py, sz - pz


@njit
def missed_angle(x: Floats, seen: int, dt: float, px: float, py: float, pz: float) -> float:
    """Angle, rad, by which the step may be wrong because the rate was not known; p is the rate before."""
    held: float = x[HELD]
    if held > HOLD:
        return UNKNOWN_RATE * dt
    if held > 0.0:
        return UNKNOWN_CHANGE * held * dt
    speed = math.sqrt(x[RATE] * x[RATE] + x[RATE + 1] * x[RATE + 1] + x[RATE + 2] * x[RATE + 2])
    if seen & flags.GYR_CLIPPED:
        return 0.5 * speed * dt
    if dt > LONG_STEP:
        change = max(abs(x[RATE] - px), abs(x[RATE + 1] - py), abs(x[RATE + 2] - pz))
        return float(0.5 * change + 0.2 * speed) * dt
    return 0.0


@njit
def admit_rate(c: Floats, x: Floats, at: int, dt: float, seen: int, gx: float, gy: float, gz: float) -> Admitted:
    """Judge the rate and the step.

    Returns
    -------
    tuple
        Flags; the step, s, zero after a gap; the rate to turn with, rad/s; the angle that may have been missed, rad.
    """
    px, py, pz = x[RATE], x[RATE + 1], x[RATE + 2]
    spike, ox, oy, oz = False, 0.0, 0.0, 0.0
    if seen & (flags.GYR_STUCK | flags.GYR_INVALID):
        gx = math.nan
    elif dt > 0.0:
        spike, gx, gy, gz, ox, oy, oz = hold_spike(x, at, dt, gx, gy, gz)
    found, dt, gx, gy, gz = admit(c, x, dt, gx, gy, gz)
    if spike:
        found |= flags.GYR_HELD
    elif not found & flags.GYR_HELD:  # added after `admit`, which keeps the rate that the next one is compared with
        gx, gy, gz = gx + ox, gy + oy, gz + oz
    if dt > LONG_STEP:
        found |= flags.GAP
    return found, dt, gx, gy, gz, missed_angle(x, seen, dt, px, py, pz)


@njit
def may_be_gravity(ax: float, ay: float, az: float) -> bool:
    """True for a specific force that is near enough to g to begin with; not for NaN."""
    return off_gravity(ax, ay, az) <= START_BAND


@njit
def only_gravity(x: Floats, at: int, dt: float, ax: float, ay: float, az: float) -> bool:
    """True where the specific force has had the size of gravity for a while.

    An acceleration that makes the mean specific force lean by `LEAN` makes it longer too, by more than `LONGER`; a
    wrong attitude does not. Gravity's size as this sensor sees it is learned slowly: its scale does not matter.
    """
    size = math.sqrt(ax * ax + ay * ay + az * az)
    if x[at] == 0.0:
        x[at], x[at + 1] = G0, G0
    x[at] += dt / (dt + SIZE_TAU) * (size - x[at])
    x[at + 1] += dt / (dt + LEAN_TAU) * (size - x[at + 1])
    beyond = size - x[at]
    x[at + 2] += dt / (dt + STEADY_TAU) * (beyond * beyond - x[at + 2])
    return bool(abs(x[at + 1] - x[at]) < LONGER and x[at + 2] < STEADY * STEADY)


@njit
def keeps_accelerating(x: Floats, at: int, dt: float, mx: float, my: float, mz: float) -> bool:
    """True where the mean specific force m has been too long for some seconds: no wave or stroke does that."""
    beyond = math.sqrt(mx * mx + my * my + mz * mz) - x[at]
    x[at + 3] += dt / (dt + STEADY_TAU) * (beyond - x[at + 3])
    return bool(x[at + 3] > KEEPS_ON)


@njit
def trusted(x: Floats, triad: int, seen: int, bad: int, vx: float, vy: float, vz: float) -> Vec:
    """Vector, or NaN where one of the flags `bad` says that it is not to be used, or where it is of old.

    A vector that stays the same, bit for bit, while the body turns is an old one said again: a slow sensor, held.
    """
    turned = x[SAME + triad] * max(abs(x[RATE]), abs(x[RATE + 1]), abs(x[RATE + 2]))
    if seen & bad or turned > STALE:
        return math.nan, math.nan, math.nan
    return vx, vy, vz


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
