"""Can the magnetometer be trusted? The Earth's field keeps its size and dip; magnets and iron change them.

Size and dip of the field, seen with the present tilt, are compared with a reference that follows slowly while they
agree. Where they do not, the field is disturbed. But a pair that lasts while the unit turns (so not from a magnet that
turns with it) becomes the new reference, [Laidig2023]. The dip is kept as its sine, which costs no arcus function.
"""

import math
from typing import Final

from plumbob.core.check import Floats
from plumbob.core.kernels import kernel
from plumbob.core.units import deg, dps
from plumbob.filters.layout import kept_weights, smooth

TAU_NOW: Final = 0.05  # smoothing of the field now, s
TAU_REFERENCE: Final = 20.0  # how slowly the reference follows, s
SIZE_BAND: Final = 0.1  # largest relative deviation of the size
DIP_BAND: Final = deg(10.0)  # largest deviation of the dip, rad
SETTLED: Final = 0.5  # for so long, s, must the field agree again before it is trusted
TURNING: Final = dps(20.0)  # rate of turn, rad/s, above which a new field is taken to stand still in space
FIRST_AFTER: Final = 5.0  # the first reference is taken after so long of turning, s
NEW_AFTER: Final = 20.0  # and a new one after so long, s
UNKNOWN2: Final = deg(5.0) ** 2  # square of the deviation, rad, of a field that there is no reference for

FIELD_SIZE: Final = 16
_NOW, _REFERENCE, _AGREED, _CANDIDATE, _LASTED, _TRUSTED, _WEIGHTS = 0, 4, 6, 7, 9, 10, 11

_COS_BAND = math.cos(DIP_BAND)


@kernel
def near(size: float, dip: float, size0: float, dip0: float) -> bool:
    """True where a field agrees with another in size and dip, given as its sine; not with one of size zero."""
    if not abs(size - size0) < SIZE_BAND * size0:
        return False
    cos2 = (1.0 - dip * dip) * (1.0 - dip0 * dip0)
    return math.sqrt(max(0.0, cos2)) + dip * dip0 > _COS_BAND


@kernel
def _follow(x: Floats, place: int, gain: float, h: float, v: float) -> None:
    x[place] += gain * (h - x[place])
    x[place + 1] += gain * (v - x[place + 1])


@kernel
def _now(x: Floats, place: int, at: int, dt: float, size: float, dip: float) -> tuple[float, float]:
    """Size and sine of the dip as they are now, smoothed over `TAU_NOW`; `at` is the place of the weights."""
    if x[place] == 0.0:
        x[place], x[place + 2] = size, dip
    p, q, r, s = kept_weights(x, at, dt, TAU_NOW)
    x[place], x[place + 1] = smooth(p, q, r, s, x[place], x[place + 1], size)
    x[place + 2], x[place + 3] = smooth(p, q, r, s, x[place + 2], x[place + 3], dip)
    return x[place], x[place + 2]


@kernel
def has_ref(x: Floats, at: int) -> bool:
    """True where there is a reference to compare with."""
    return bool(x[at + _REFERENCE] > 0.0)


@kernel
def disturbed(x: Floats, at: int, dt: float, turning: float, h: float, v: float) -> bool:
    """Take the horizontal and vertical part of a field sample, µT, and say whether it is to be distrusted.

    `x`: state; `at`: place of the `FIELD_SIZE` numbers of this block in it; `dt`: time since the last field sample, s;
    `turning`: rate of turn, rad/s; `h`, `v`: parts of the field.
    """
    ref, new = at + _REFERENCE, at + _CANDIDATE
    size = math.sqrt(h * h + v * v)
    size, dip = _now(x, at + _NOW, at + _WEIGHTS, dt, size, v / size)
    slow = dt / (dt + TAU_REFERENCE)
    if near(size, dip, x[ref], x[ref + 1]):  # [Laidig2023]
        x[at + _AGREED] += dt
        if x[at + _AGREED] >= SETTLED:
            x[at + _TRUSTED] = 1.0
            _follow(x, ref, slow, size, dip)
    else:
        x[at + _AGREED], x[at + _TRUSTED] = 0.0, 0.0
    if not near(size, dip, x[new], x[new + 1]):
        x[at + _LASTED] = 0.0
        x[new], x[new + 1] = size, dip
        return bool(x[at + _TRUSTED] == 0.0)
    if turning >= TURNING:
        x[at + _LASTED] += dt
    _follow(x, new, slow, size, dip)
    if x[at + _TRUSTED] == 0.0 and x[at + _LASTED] >= (NEW_AFTER if has_ref(x, at) else FIRST_AFTER):  # [Laidig2023]
        x[ref], x[ref + 1] = x[new], x[new + 1]
        x[at + _TRUSTED], x[at + _AGREED] = 1.0, SETTLED
    return bool(x[at + _TRUSTED] == 0.0)


@kernel
def unlike2(x: Floats, at: int, noise: float) -> float:
    """Square of how far the field deviates from the reference, in rad as seen from the level plane.

    A disturbance has no reason to leave the heading alone: what it does to size and dip, it does to the heading too.
    Of the deviation, two parts of white noise, µT²/Hz, after the smoothing are taken off.
    """
    size, dip, size0, dip0 = x[at + _NOW], x[at + _NOW + 2], x[at + _REFERENCE], x[at + _REFERENCE + 1]
    if not size0 > 0.0:
        return UNKNOWN2
    level2 = max(1.0 - dip0 * dip0, 0.01)
    longer, steeper = size / size0 - 1.0, (dip - dip0) / math.sqrt(level2)
    expected = noise / (TAU_NOW * size0 * size0)
    beyond2: float = max(0.0, longer * longer + steeper * steeper - expected) / level2
    return beyond2
