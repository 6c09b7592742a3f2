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
MOSTLY: Final = 0.5
"""Share of a recording above which a remark names the other causes that it may have."""
PUSHED: Final = "; unless it was pushed or fell for that time, gyroscope or accelerometer"
IRON: Final = "; unless iron was near for that time, gyroscope or magnetometer"
OTHERWISE: Final = " has a wrong factor, rate, unit, axis or sign: plumbob doctor shows which"


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
    remarks = _gaps(gaps, float(t[0]), float(t[-1]))
    if not mag:
        return remarks
    if ((word & flags.HEADING_FREE) != 0).all():
        return [*remarks, FREE]
    gated = (word[1:] & flags.MAG_GATED) != 0
    if when := _spells(t, gated, float(t[0]), float(t[-1])):
        remarks.append(_doubted(WRONG.format(when), gated, IRON))
    return remarks


def _doubted(remark: str, which: Bools, unless: str) -> str:
    return f"{remark}{unless}{OTHERWISE}" if which.mean() > MOSTLY else remark


def stretch_remarks(smoothed: Smoothed, p: Params, t: Floats) -> list[str]:
    """Remarks on a stretch of a recording, with the times (N,) at which its attitude is kept; a line each."""
    begin, end = float(t[0]), float(t[-1])
    remarks = _gaps(smoothed.frames.time[1:][smoothed.frames.gap], begin, end)
    if when := _spells(smoothed.frames.time, smoothed.weightless, begin, end):
        remarks.append(_doubted(WEIGHTLESS.format(when), smoothed.weightless, PUSHED))
    if smoothed.reference is None:
        if np.isfinite(smoothed.frames.mag[:, 0]).any():
            remarks.append(FREE)
        return remarks
    remarks += _of_unit(smoothed)
    if smoothed.attached is not None and smoothed.attached.present:
        magnet = smoothed.attached.magnet
        size = float(np.linalg.norm(magnet, axis=1).max())
        when = _spells(smoothed.frames.time, np.asarray(magnet.any(axis=1)), begin, end)
        if when:
            remarks.append(f"a field of {size:.0f} µT turned with the sensor ({when}); it was taken off")
    gated = (smoothed.weight < GATED) & np.isfinite(smoothed.sweep.field[:, 0])
    if when := _spells(smoothed.frames.time, gated, begin, end):
        remarks.append(_doubted(WRONG.format(when), gated, IRON))
    if smoothed.reference.rival is not None:
        level, up = smoothed.reference.rival
        remarks.append(
            f"two fields have nearly equal weight, {smoothed.reference.level:.0f} µT level, "
            f"{smoothed.reference.vertical:.0f} up, and {level:.0f} level, {up:.0f} up: the heading may be off by "
            f"{to_deg(smoothed.rival_turn):.0f}°, which its standard deviation counts"
        )
    return remarks


def _of_unit(smoothed: Smoothed) -> list[str]:
    """A field of the unit itself, taken off or not."""
    if smoothed.attached is None:
        return []
    if size := float(np.linalg.norm(smoothed.attached.iron)):
        return [f"the unit has a field of {size:.1f} µT of its own; it was taken off: calibrate the magnetometer"]
    if (size := float(np.linalg.norm(smoothed.attached.suspect))) < TOLD:
        return []
    return [
        f"a field of {size:.1f} µT seems to turn with the unit, or that of the place is uneven; it was not taken off: "
        f"the heading may be off by {to_deg(smoothed.iron_turn):.0f}°, which its standard deviation counts"
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
