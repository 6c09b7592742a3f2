"""What may enter a filter: time steps, rates and samples are judged before they change any state.

Is a sensor stuck? Noise makes a working one say something new all the time; the same bits again and again do not.

This runs before every filter's step and only flags: what to make of it is the filter's choice. A slow magnetometer
whose value is repeated until the next one comes is not stuck, and neither is one that is absent in between.

What the modern filters let in: nothing stuck or clipped, no spike; and how far the attitude may have run off.

`admission` judges one sample by itself. Here the rate is also compared with the one before: a jump that no body makes
in one step is held back for one sample, and made up for if the next sample confirms it. And where the rate is not
known (absent, clipped, stuck, or skipped by a gap), the angle that may have been missed is counted, so that a filter
can open its gains or begin again instead of trusting a wrong attitude.

Only what says new values while nothing moves can be judged so: a part whose last digit is larger than its noise says
the same for as long as it rests, and a smooth turn of it stays at its peak for many samples.

A single axis is judged by what the two others of its triad do meanwhile. Where all three repeat themselves, a slow
sensor is held, and its time since says when that lasts too long.

Stuck: it has had two values at most, so that the last digit may flicker, while both others moved. In 80 recordings of
five kinds of units none that did so had two values for more than 13 samples.

Cut off: a rate stays the same at the largest value that it has had lately, in motion. That value is then its end of
range, until it is exceeded. Wrapped around: an integer that is too small jumps from one end of its range to the other,
and back. Both are for rates alone. A force that is cut off in the shocks of running still says more than none: left
out, attitudes of running phones were worse by 3 %; and shocks and vibrations reverse a force from sample to sample.
"""

import math
from typing import Final

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.kernels import kernel
from plumbob.core.units import deg, dps
from plumbob.filters.layout import AXES, BLIND, COUNT, DIGITS, HELD, LAST, MAX_GAP, RATE, SAME, STAGE
from plumbob.rotations.kernels import Vec

LONG: Final = 0.25  # what repeats itself for longer than this, s, and for `MANY` samples, is stuck
MANY: Final = 25.0
"""Three axes of noise that is small against the last digit repeat some times; 25 times at a stretch they do not."""

DIGIT: Final = (dps(0.125), 0.02, 0.3)
"""A larger last digit than this, rad/s, m/s², µT, may hide all noise: quiet parts have 0.03 °/s, 5 mm/s² and 0.1 µT at
100 Hz, and ±4000 °/s in 16 bits are 0.122 °/s."""
ROUNDING: Final = 1e-3  # a change that is a smaller share of that comes from arithmetic
NO_DIGIT: Final = 1e9  # last digit of what has said one value alone
ABRUPT: Final = 2.0  # an end of range is reached in steps of more digits than this; a peak is not

MOTION_TAU: Final = 1.0  # time over which an axis's mean and its deviation from that are taken, s
MOVES: Final = (dps(1.0), 0.3, 2.0)
"""An axis moves that deviates by more than this from its mean, on average: rad/s, m/s², µT."""
EQUAL: Final = 5.0  # an axis that stays the same for so many samples more, at the largest value that it has had
LATELY: Final = 10.0
"""in about this time, s, is at the end of its range. Healthy ones did so for 3."""
LEAST_RANGE: Final = dps(30.0)  # no part ends below this, rad/s: the ADIS16355 at ±75 °/s
NEAR: Final = 0.01  # the ends on both sides differ by less than this share, since an offset was taken off
LEAP: Final = 1.8  # a jump of so many times the largest value leads from one end of the range to the other
SMOOTH: Final = 0.125  # the step before it was smaller than this share of it
LARGE: Final = dps(6.0)  # smaller jumps, rad/s, are noise
APART: Final = 0.015  # between samples farther apart than this, s, a body may reverse

CLIPPED: Final = 1
STUCK: Final = 2
WRAPPED: Final = 4

WIDTH: Final = 13  # places of an axis
_LAST: Final = 0  # its last value, and the one other that it has had meanwhile
_OTHER: Final = 1
_TWO: Final = 2  # for how long these two, s
_STUCK: Final = 3  # 1 where it is stuck
_CHANGES: Final = 4  # how often it has changed: one that never did measures nothing
_MEAN: Final = 5
_DEVIATION: Final = 6
_SAME: Final = 7  # how many times the last value was repeated
_PEAK: Final = 8  # largest value lately
_END: Final = 9  # end of its range; 0 while that is not known
_STEP: Final = 10  # to the value before
_WRAPPED: Final = 11  # largest value when it wrapped around; 0 where it has not
_REACHED: Final = 12  # by what step it came to its value


@kernel
def axis_flags(x: Floats, triad: int, dt: float, vx: float, vy: float, vz: float) -> int:
    """What is wrong with an axis of a triad: `CLIPPED`, `STUCK`, `WRAPPED`, or 0."""
    i = AXES + 3 * WIDTH * triad
    j, k = i + WIDTH, i + 2 * WIDTH
    if math.isnan(vx + vy + vz):
        return 0
    if vx == x[i] and vy == x[j] and vz == x[k]:  # an old one, said again
        return STUCK if x[i + _STUCK] + x[j + _STUCK] + x[k + _STUCK] > 0.0 else 0
    digit = _digit(x, triad, vx - x[i], vy - x[j], vz - x[k])
    share = dt / (dt + MOTION_TAU)
    moves_x = _moves(x, i, share, vx, MOVES[triad])
    moves_y = _moves(x, j, share, vy, MOVES[triad])
    moves_z = _moves(x, k, share, vz, MOVES[triad])
    word = 0
    if triad == 0:
        word |= _range(x, i, dt, vx, digit, moves_y or moves_z)
        word |= _range(x, j, dt, vy, digit, moves_x or moves_z)
        word |= _range(x, k, dt, vz, digit, moves_x or moves_y)
    fine = digit < DIGIT[triad]
    stuck_x = _stuck(x, i, dt, vx, fine and moves_y and moves_z)
    stuck_y = _stuck(x, j, dt, vy, fine and moves_x and moves_z)
    stuck_z = _stuck(x, k, dt, vz, fine and moves_x and moves_y)
    return word | (STUCK if (stuck_x or stuck_y or stuck_z) and not word & CLIPPED else 0)


@kernel
def _digit(x: Floats, triad: int, cx: float, cy: float, cz: float) -> float:
    """Smallest change of an axis of a triad so far: its last digit; `NO_DIGIT` before."""
    if x[DIGITS + triad] == 0.0:
        x[DIGITS + triad] = NO_DIGIT
        return NO_DIGIT
    x[DIGITS + triad] = least_change(x[DIGITS + triad], triad, cx, cy, cz)
    return x[DIGITS + triad]  # type: ignore[no-any-return]


@kernel
def least_change(least: float, triad: int, cx: float, cy: float, cz: float) -> float:
    """The smaller of a change and those of the axes of a triad, beyond rounding."""
    for change in (abs(cx), abs(cy), abs(cz)):
        if ROUNDING * DIGIT[triad] < change < least:
            least = change
    return least


@kernel
def _moves(x: Floats, at: int, share: float, v: float, least: float) -> bool:
    """Whether an axis has moved in the last second, and says new values all the time."""
    if x[at + _CHANGES] == 0.0:
        x[at + _MEAN] = v
    x[at + _MEAN] += share * (v - x[at + _MEAN])
    x[at + _DEVIATION] += share * (abs(v - x[at + _MEAN]) - x[at + _DEVIATION])
    return bool(x[at + _DEVIATION] > least and x[at + _TWO] < 0.5 * LONG)


@kernel
def _stuck(x: Floats, at: int, dt: float, v: float, others_move: bool) -> bool:
    """Whether an axis has had two values at most for long while the others moved, until it has a third one."""
    before = x[at + _LAST]
    if v != before:
        x[at + _CHANGES] += 1.0
        if v != x[at + _OTHER]:
            x[at + _TWO], x[at + _STUCK] = 0.0, 0.0
        x[at + _OTHER] = before
    x[at + _TWO] += dt
    x[at + _LAST] = v
    if others_move and x[at + _CHANGES] > MANY and x[at + _TWO] > max(LONG, MANY * dt):
        x[at + _STUCK] = 1.0
    return bool(x[at + _STUCK] > 0.0)


@kernel
def _range(x: Floats, at: int, dt: float, v: float, digit: float, another_moves: bool) -> int:
    """Whether an axis is at the end of its range, or beyond, by its values so far."""
    size, step = abs(v), abs(v - x[at + _LAST])
    x[at + _PEAK] = max(size, x[at + _PEAK] * (1.0 - dt / (dt + LATELY)))
    x[at + _SAME] = x[at + _SAME] + 1.0 if step == 0.0 else 0.0
    x[at + _REACHED] = step if step > 0.0 else x[at + _REACHED]
    lived = x[at + _CHANGES] > MANY
    moves = another_moves and x[at + _DEVIATION] > MOVES[0] and x[at + _REACHED] > ABRUPT * digit
    if lived and moves and x[at + _SAME] >= EQUAL and size >= max(LEAST_RANGE, (1.0 - NEAR) * x[at + _PEAK]):
        x[at + _END] = size
    elif size > (1.0 + NEAR) * x[at + _END]:
        x[at + _END] = 0.0
    if lived and step > max(LARGE, LEAP * x[at + _PEAK]) and x[at + _STEP] < SMOOTH * step and dt < APART:
        x[at + _WRAPPED] = 0.0 if x[at + _WRAPPED] > 0.0 else x[at + _PEAK]
        step = 0.0
    elif size < 0.5 * x[at + _WRAPPED]:  # the true value would be 1.5 ranges: the jump back was missed
        x[at + _WRAPPED] = 0.0
    x[at + _STEP] = step
    clipped = x[at + _END] > 0.0 and size >= (1.0 - NEAR) * x[at + _END]
    return (WRAPPED if x[at + _WRAPPED] > 0.0 else 0) | (CLIPPED if clipped else 0)


_MIX_Y, _MIX_Z = math.sqrt(2.0), math.sqrt(3.0)  # no combination of whole steps of the axes gives the same sum


@kernel
def as_one(vx: float, vy: float, vz: float) -> float:
    """One number for the three axes; it stays the same where they do, and practically only there."""
    return vx + _MIX_Y * vy + _MIX_Z * vz


@kernel
def or_zero(value: float) -> float:
    """Zero for NaN."""
    return 0.0 if math.isnan(value) else value


@kernel
def _repeats(x: Floats, triad: int, dt: float, vx: float, vy: float, vz: float) -> bool:
    said = as_one(vx, vy, vz)
    if said != x[LAST + triad]:
        if math.isnan(said):  # absent: the clock goes on
            x[SAME + triad] += dt
        else:
            x[LAST + triad], x[SAME + triad] = said, 0.0
        return False
    x[SAME + triad] += dt
    coarse = DIGIT[triad] <= x[DIGITS + triad] < NO_DIGIT
    return bool(x[SAME + triad] > LONG and x[SAME + triad] > MANY * dt and not coarse)


@kernel
def watch(
    x: Floats, dt: float,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float, mx: float, my: float, mz: float,
) -> int:  # fmt: skip
    """Flags of the triads that are stuck, or that have an axis which is stuck or beyond its range."""
    word, gyr = 0, axis_flags(x, 0, dt, gx, gy, gz)
    if _repeats(x, 0, dt, gx, gy, gz) or gyr & STUCK:
        word |= flags.GYR_STUCK
    if _repeats(x, 1, dt, ax, ay, az) or axis_flags(x, 1, dt, ax, ay, az):
        word |= flags.ACC_STUCK
    if _repeats(x, 2, dt, mx, my, mz) or axis_flags(x, 2, dt, mx, my, mz):
        word |= flags.MAG_STUCK
    if gyr & CLIPPED:
        word |= flags.GYR_CLIPPED
    if gyr & WRAPPED:
        word |= flags.GYR_INVALID
    return word


JUMP: Final = 1000.0  # a rate that changes faster than this, rad/s², is a spike until the next sample confirms it
UNKNOWN_RATE: Final = 2.0  # how fast a body may turn, rad/s, of which nothing is known
UNKNOWN_CHANGE: Final = 20.0  # how fast a rate may change, rad/s², of which nothing is known
LONG_STEP: Final = 0.15  # in a step longer than this, s, the rate may have been anything between its ends

STALE: Final = deg(2.0)  # a vector that is the same after this turn, rad, is an old one

START_BAND: Final = 0.3 * G0  # an attitude is taken up only from a specific force this near to g, m/s²
JUMP_SD: Final = dps(5.0)  # standard deviation of a bias that has jumped, rad/s; a horizon that leans tells of it

LEAN: Final = 0.15 * G0  # a specific force whose mean is level by more than this, m/s²,
LEAN_TAU: Final = 1.0
"""over this, s, leans."""
LONGER: Final = 0.01 * G0
"""An acceleration that makes it lean makes it longer by √(1 + 0.15²) − 1 of g: more than this, m/s²."""
SIZE_TAU: Final = 30.0  # what the size of gravity is to this sensor is learned over this, s
STEADY: Final = 0.03 * G0  # a specific force whose size has varied by less than this, m/s²,
STEADY_TAU: Final = 3.0
"""over this, s, is that of a body which does not accelerate."""
KEEPS_ON: Final = 0.06 * G0
"""If its mean is longer than gravity by this, m/s², over the same time, the body keeps accelerating."""
GRAVITY_SIZE: Final = 4

GUARD_SIZE: Final = 4
_SPIKE, _WAITING = 0, 3  # places of the rate that waits for confirmation, and of whether one does

Admitted = tuple[int, float, float, float, float, float]
Held = tuple[bool, float, float, float, float, float, float]


@kernel
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


@kernel
def missed_angle(x: Floats, flags_in: int, dt: float, px: float, py: float, pz: float) -> float:
    """Angle, rad, by which the step may be wrong because the rate was not known; p is the rate before."""
    held: float = x[HELD]
    if held > HOLD:
        return UNKNOWN_RATE * dt
    if held > 0.0:
        return UNKNOWN_CHANGE * held * dt
    speed = math.sqrt(x[RATE] * x[RATE] + x[RATE + 1] * x[RATE + 1] + x[RATE + 2] * x[RATE + 2])
    if flags_in & flags.GYR_CLIPPED:
        return 0.5 * speed * dt
    if dt > LONG_STEP:
        change = max(abs(x[RATE] - px), abs(x[RATE + 1] - py), abs(x[RATE + 2] - pz))
        return float(0.5 * change + 0.2 * speed) * dt
    return 0.0


@kernel
def admit_rate(c: Floats, x: Floats, at: int, dt: float, flags_in: int, gx: float, gy: float, gz: float) -> Admitted:
    """Judge the rate and the step.

    Returns flags; the step, s, zero after a gap; the rate to turn with, rad/s; the angle that may have been missed,
    rad.
    """
    px, py, pz = x[RATE], x[RATE + 1], x[RATE + 2]
    spike, ox, oy, oz = False, 0.0, 0.0, 0.0
    if flags_in & (flags.GYR_STUCK | flags.GYR_INVALID):
        gx = math.nan
    elif dt > 0.0:
        spike, gx, gy, gz, ox, oy, oz = hold_spike(x, at, dt, gx, gy, gz)
    word, dt, gx, gy, gz = admit(c, x, dt, gx, gy, gz)
    if spike:
        word |= flags.GYR_HELD
    elif not word & flags.GYR_HELD:  # added after `admit`, which keeps the rate that the next one is compared with
        gx, gy, gz = gx + ox, gy + oy, gz + oz
    if dt > LONG_STEP:
        word |= flags.GAP
    return word, dt, gx, gy, gz, missed_angle(x, flags_in, dt, px, py, pz)


@kernel
def may_be_gravity(ax: float, ay: float, az: float) -> bool:
    """True for a specific force that is near enough to g to begin with; not for NaN."""
    return off_gravity(ax, ay, az) <= START_BAND


@kernel
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


@kernel
def keeps_accelerating(x: Floats, at: int, dt: float, mx: float, my: float, mz: float) -> bool:
    """True where the mean specific force m has been too long for some seconds: no wave or stroke does that."""
    beyond = math.sqrt(mx * mx + my * my + mz * mz) - x[at]
    x[at + 3] += dt / (dt + STEADY_TAU) * (beyond - x[at + 3])
    return bool(x[at + 3] > KEEPS_ON)


@kernel
def trusted(x: Floats, triad: int, flags_in: int, bad: int, vx: float, vy: float, vz: float) -> Vec:
    """Vector, or NaN where one of the flags `bad` says that it is not to be used, or where it is of old.

    A vector that stays the same, bit for bit, while the body turns is an old one said again: a slow sensor, held.
    """
    turned = x[SAME + triad] * max(abs(x[RATE]), abs(x[RATE + 1]), abs(x[RATE + 2]))
    if flags_in & bad or turned > STALE:
        return math.nan, math.nan, math.nan
    return vx, vy, vz


HOLD = 0.1
"""A missing rate is taken to go on as it was for this long, s; then it counts as zero. Lost packets are shorter."""

_MAX_ANGLE2 = math.pi * math.pi  # a turn of more than half a revolution in one step has no unique axis


@kernel
def admit(c: Floats, x: Floats, dt: float, gx: float, gy: float, gz: float) -> tuple[int, float, float, float, float]:
    """Judge one step.

    Returns flags, then the step, s, and the rate, rad/s, to integrate.
    """
    x[COUNT] += 1.0
    word = 0
    if dt > c[MAX_GAP]:  # what happened meanwhile is unknown: start again, never integrate a jump
        word = flags.GAP
        x[STAGE] = BLIND
        dt = 0.0
    size2 = gx * gx + gy * gy + gz * gz
    if size2 * (dt * dt) < _MAX_ANGLE2 and size2 < math.inf:
        x[RATE], x[RATE + 1], x[RATE + 2] = gx, gy, gz
        x[HELD] = 0.0
        return word, dt, gx, gy, gz
    x[HELD] += dt
    if x[HELD] > HOLD:
        x[RATE], x[RATE + 1], x[RATE + 2] = 0.0, 0.0, 0.0
    return word | flags.GYR_HELD, dt, x[RATE], x[RATE + 1], x[RATE + 2]


@kernel
def judge(
    flagged: int, vx: float, vy: float, vz: float, limit: float, absent: int, invalid: int
) -> tuple[int, float, float, float]:
    """Flags of one sample of a triad, and its values, NaN where they cannot be used; as `ImuData` judges them."""
    if math.isnan(vx) or math.isnan(vy) or math.isnan(vz):
        return absent, math.nan, math.nan, math.nan
    if flagged or abs(vx) > limit or abs(vy) > limit or abs(vz) > limit:
        return invalid, math.nan, math.nan, math.nan
    return 0, vx, vy, vz


@kernel
def refused(flag: int, vx: float, vy: float, vz: float) -> int:
    """Flag of a vector that is there but was not used; none for NaN, which other flags explain."""
    return 0 if math.isnan(vx) or math.isnan(vy) or math.isnan(vz) else flag


@kernel
def off_gravity(ax: float, ay: float, az: float) -> float:
    """By how much a specific force is longer or shorter than g, m/s²; NaN for NaN."""
    return abs(math.sqrt(ax * ax + ay * ay + az * az) - G0)


@kernel
def usable(vx: float, vy: float, vz: float) -> bool:
    """True for a vector that has a direction: finite and not zero."""
    size2 = vx * vx + vy * vy + vz * vz
    return size2 > 1e-12 and size2 < math.inf  # 1e-6 m/s² or µT is far below any sensor's last digit
