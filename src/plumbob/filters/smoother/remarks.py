"""What a reader of a smoothed track should know: fields that were not used, were of the sensor, or leave a doubt."""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core import check, flags
from plumbob.core.check import Floats
from plumbob.core.units import to_deg
from plumbob.data import ImuData
from plumbob.data.delay import gyr_delay
from plumbob.filters.smoother.keyframes import Bools
from plumbob.filters.smoother.model import Params
from plumbob.filters.smoother.passes import Smoothed
from plumbob.filters.smoother.samples import GATED

LASTING: Final = 3.0
"""A field that is wrong for less than this, s, is not named."""
MOST: Final = 5
"""Spells that are named."""
TOLD: Final = 1.5
"""Smaller fields of the unit, µT, are not named."""


FREE: Final = "no field of the recording gives a heading: it counts from a free zero"
WEIGHTLESS: Final = "no gravity shows in the specific force ({}): the attitude there may be any"
WRONG: Final = "the field was not that of the place ({}); the heading there is the gyroscope's"


def remarks_before(imu: ImuData) -> list[str]:
    """Remarks on a recording before it is smoothed; a line each."""
    lag = gyr_delay(imu)
    if lag is None or not lag.found:
        return []
    late, early = ("gyroscope", "accelerometer") if lag.delay > 0.0 else ("accelerometer", "gyroscope")
    return [
        f"the {late} seems to lag the {early} by {1e3 * abs(lag.delay):.0f} ± {1e3 * lag.sd:.0f} ms, and attitudes in "
        f"motion are off by what the unit turns meanwhile: give the {late} earlier times, and read it again"
    ]


def remarks_so_far(gaps: Floats, t: Floats, word: NDArray[np.uint32], *, mag: bool) -> list[str]:
    """Remarks on samples (N,) of which each knows only what came before, by their flags; a line each.

    `gaps` are the ends of the gaps before them, s, and `mag` says whether there is a field at all.
    """
    told = _gaps(gaps, float(t[0]), float(t[-1]))
    if not mag:
        return told
    if ((word & flags.HEADING_FREE) != 0).all():
        return [*told, FREE]
    gated = (word[1:] & flags.MAG_GATED) != 0
    if when := _spells(t, gated, float(t[0]), float(t[-1])):
        told.append(WRONG.format(when))
    return told


def remarks_of(found: Smoothed, p: Params, t: Floats) -> list[str]:
    """Remarks on a stretch of a recording, with the times (N,) at which its attitude is kept; a line each."""
    begin, end = float(t[0]), float(t[-1])
    told = _gaps(found.frames.time[1:][found.frames.gap], begin, end)
    if when := _spells(found.frames.time, found.weightless, begin, end):
        told.append(WEIGHTLESS.format(when))
    if found.reference is None:
        if np.isfinite(found.frames.mag[:, 0]).any():
            told.append(FREE)
        return told
    told += _of_unit(found)
    if found.attached is not None and found.attached.found:
        magnet = found.attached.magnet
        size = float(np.linalg.norm(magnet, axis=1).max())
        when = _spells(found.frames.time, np.asarray(magnet.any(axis=1)), begin, end)
        if when:
            told.append(f"a field of {size:.0f} µT turned with the sensor ({when}); it was taken off")
    gated = (found.weight < GATED) & np.isfinite(found.sweep.field[:, 0])
    if when := _spells(found.frames.time, gated, begin, end):
        told.append(WRONG.format(when))
    if found.reference.rival is not None:
        level, up = found.reference.rival
        told.append(
            f"two fields have nearly equal weight, {found.reference.level:.0f} µT level, "
            f"{found.reference.vertical:.0f} up, and {level:.0f} level, {up:.0f} up: the heading may be off by "
            f"{to_deg(found.rival_turn):.0f}°, which its standard deviation counts"
        )
    return told


def _of_unit(found: Smoothed) -> list[str]:
    """A field of the unit itself, taken off or not."""
    if found.attached is None:
        return []
    if size := float(np.linalg.norm(found.attached.iron)):
        return [f"the unit has a field of {size:.1f} µT of its own; it was taken off: calibrate the magnetometer"]
    if (size := float(np.linalg.norm(found.attached.left))) < TOLD:
        return []
    return [
        f"a field of {size:.1f} µT seems to turn with the unit, or that of the place is uneven; it was not taken off: "
        f"the heading may be off by {to_deg(found.iron_turn):.0f}°, which its standard deviation counts"
    ]


def _gaps(time: Floats, begin: float, end: float) -> list[str]:
    inside = time[(time >= begin) & (time <= end)]
    if not inside.size:
        return []
    count = "a gap" if inside.size == 1 else f"{inside.size} gaps"
    return [
        f"{count} in the samples (until {', '.join(f'{x:.1f}' for x in inside[:MOST])} s): the attitude starts again"
    ]


def _spells(time: Floats, which: Bools, begin: float, end: float) -> str:
    """Times, s, for which something lasted, the longest few of them; empty where none did for long."""
    spells = [(max(float(time[a]), begin), min(float(time[b]), end)) for a, b in check.runs(which)]
    long = sorted((s for s in spells if s[1] - s[0] >= LASTING), key=lambda s: s[0] - s[1])
    total = math.fsum(b - a for a, b in long)
    if not long:
        return ""
    named = ", ".join(f"{a:.0f}–{b:.0f} s" for a, b in sorted(long[:MOST]))
    return named if len(long) <= MOST else f"{named} and more, {total:.0f} s in all"
