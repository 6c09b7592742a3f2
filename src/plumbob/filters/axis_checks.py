"""Single axes that do not follow the motion: stuck, cut off at an end of range that nobody declared, wrapped around.

An axis is judged by what the two others of its triad do meanwhile. Where all three repeat themselves, a slow sensor is
held, and `input_checks` says when that lasts too long.

Stuck: it has had two values at most, so that the last digit may flicker, while both others moved. In 80 recordings of
five kinds of units none that did so had two values for more than 13 samples.

Cut off: a rate stays the same at the largest value that it has had lately, in motion. That value is then its end of
range, until it is exceeded. Wrapped around: an integer that is too small jumps from one end of its range to the other,
and back. Both are for rates alone. A force that is cut off in the shocks of running still says more than none: left
out, attitudes of running phones were worse by 3 %; and shocks and vibrations reverse a force from sample to sample.
"""

import math
from typing import Final

from plumbob.core._jit import njit
from plumbob.core.check import Floats
from plumbob.core.units import dps
from plumbob.filters.layout import AXES

LONG: Final = 0.25
"""What repeats itself for longer than this, s, and for `MANY` samples, is stuck."""
MANY: Final = 25.0
"""Three axes of noise that is small against the last digit repeat some times; 25 times at a stretch they do not."""

MOTION_TAU: Final = 1.0
"""Time over which an axis's mean and its deviation from that are taken, s."""
MOVES: Final = (dps(1.0), 0.3, 2.0)
"""An axis moves that deviates by more than this from its mean, on average: rad/s, m/s², µT."""
EQUAL: Final = 5.0
"""An axis that stays the same for so many samples more, at the largest value that it has had"""
LATELY: Final = 10.0
"""in about this time, s, is at the end of its range. Healthy ones did so for 3."""
LEAST_RANGE: Final = dps(30.0)
"""No part ends below this, rad/s: the ADIS16355 at ±75 °/s."""
NEAR: Final = 0.01
"""The ends on both sides differ by less than this share, since an offset was taken off."""
JUMP: Final = 1.8
"""A jump of so many times the largest value leads from one end of the range to the other."""
SMOOTH: Final = 0.125
"""The step before it was smaller than this share of it."""
LARGE: Final = dps(6.0)
"""Smaller jumps, rad/s, are noise."""
APART: Final = 0.015
"""Between samples farther apart than this, s, a body may reverse."""

CLIPPED: Final = 1
STUCK: Final = 2
WRAPPED: Final = 4

WIDTH: Final = 12  # places of an axis
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


@njit
def axis_flags(x: Floats, triad: int, dt: float, vx: float, vy: float, vz: float) -> int:
    """What is wrong with an axis of a triad: `CLIPPED`, `STUCK`, `WRAPPED`, or 0."""
    i = AXES + 3 * WIDTH * triad
    j, k = i + WIDTH, i + 2 * WIDTH
    if math.isnan(vx + vy + vz):
        return 0
    if vx == x[i] and vy == x[j] and vz == x[k]:  # an old one, said again
        return STUCK if x[i + _STUCK] + x[j + _STUCK] + x[k + _STUCK] > 0.0 else 0
    share = dt / (dt + MOTION_TAU)
    moves_x = _moves(x, i, share, vx, MOVES[triad])
    moves_y = _moves(x, j, share, vy, MOVES[triad])
    moves_z = _moves(x, k, share, vz, MOVES[triad])
    found = 0
    if triad == 0:
        found |= _range(x, i, dt, vx, moves_y or moves_z)
        found |= _range(x, j, dt, vy, moves_x or moves_z)
        found |= _range(x, k, dt, vz, moves_x or moves_y)
    stuck_x = _stuck(x, i, dt, vx, moves_y and moves_z)
    stuck_y = _stuck(x, j, dt, vy, moves_x and moves_z)
    stuck_z = _stuck(x, k, dt, vz, moves_x and moves_y)
    return found | (STUCK if (stuck_x or stuck_y or stuck_z) and not found & CLIPPED else 0)


@njit
def _moves(x: Floats, at: int, share: float, v: float, least: float) -> bool:
    """Whether an axis has moved in the last second, and says new values all the time."""
    if x[at + _CHANGES] == 0.0:
        x[at + _MEAN] = v
    x[at + _MEAN] += share * (v - x[at + _MEAN])
    x[at + _DEVIATION] += share * (abs(v - x[at + _MEAN]) - x[at + _DEVIATION])
    return bool(x[at + _DEVIATION] > least and x[at + _TWO] < 0.5 * LONG)


@njit
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


@njit
def _range(x: Floats, at: int, dt: float, v: float, another_moves: bool) -> int:
    """Whether an axis is at the end of its range, or beyond, by its values so far."""
    size, step = abs(v), abs(v - x[at + _LAST])
    x[at + _PEAK] = max(size, x[at + _PEAK] * (1.0 - dt / (dt + LATELY)))
    x[at + _SAME] = x[at + _SAME] + 1.0 if step == 0.0 else 0.0
    lived = x[at + _CHANGES] > MANY
    moves = another_moves and x[at + _DEVIATION] > MOVES[0]
    if lived and moves and x[at + _SAME] >= EQUAL and size >= max(LEAST_RANGE, (1.0 - NEAR) * x[at + _PEAK]):
        x[at + _END] = size
    elif size > (1.0 + NEAR) * x[at + _END]:
        x[at + _END] = 0.0
    if lived and step > max(LARGE, JUMP * x[at + _PEAK]) and x[at + _STEP] < SMOOTH * step and dt < APART:
        x[at + _WRAPPED] = 0.0 if x[at + _WRAPPED] > 0.0 else x[at + _PEAK]
        step = 0.0
    elif size < 0.5 * x[at + _WRAPPED]:  # the true value would be 1.5 ranges: the jump back was missed
        x[at + _WRAPPED] = 0.0
    x[at + _STEP] = step
    clipped = x[at + _END] > 0.0 and size >= (1.0 - NEAR) * x[at + _END]
    return (WRAPPED if x[at + _WRAPPED] > 0.0 else 0) | (CLIPPED if clipped else 0)
