"""What a reader of a smoothed track should know: fields that were not used, were of the sensor, or leave a doubt."""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core import check, flags
from plumbob.core.check import Floats
from plumbob.core.findings import Finding, warning
from plumbob.core.units import to_deg
from plumbob.data import ImuData
from plumbob.data.delay import gyr_delay
from plumbob.filters.smoother.keyframes import Bools
from plumbob.filters.smoother.model import M, Params
from plumbob.filters.smoother.passes import Smoothed
from plumbob.filters.smoother.samples import GATED

LASTING: Final = 3.0  # a field that is wrong for less than this, s, is not named
MOST: Final = 5  # spells that are named
TOLD: Final = 1.5  # smaller fields of the unit, µT, are not named
MOSTLY: Final = 0.5  # share of a recording above which a remark names the other causes that it may have


def remarks_before(imu: ImuData) -> list[Finding]:
    """Remarks on a recording before it is smoothed."""
    lag = gyr_delay(imu)
    if lag is None or not lag.found:
        return []
    late, early = ("gyroscope", "accelerometer") if lag.delay > 0.0 else ("accelerometer", "gyroscope")
    return [warning("estimate.delay", late=late, early=early, delay_ms=1e3 * abs(lag.delay), sd_ms=1e3 * lag.sd)]


def remarks_so_far(gaps: Floats, t: Floats, word: NDArray[np.uint32], *, mag: bool) -> list[Finding]:
    """Remarks on samples (N,) of which each knows only what came before, by their flags.

    `gaps` are the ends of the gaps before them, s, and `mag` says whether there is a field at all.
    """
    remarks = _gaps(gaps, float(t[0]), float(t[-1]))
    if not mag:
        return remarks
    if ((word & flags.HEADING_FREE) != 0).all():
        return [*remarks, warning("estimate.heading_free")]
    gated = (word[1:] & flags.MAG_GATED) != 0
    if when := _spells(t, gated, float(t[0]), float(t[-1])):
        remarks.append(_doubted("estimate.field_wrong", when, gated))
    return remarks


def _doubted(code: str, when: str, which: Bools) -> Finding:
    return warning(code, when=when, mostly="yes" if which.mean() > MOSTLY else "")


def unit_remarks(smoothed: Smoothed | None, p: Params) -> list[Finding]:
    """Remarks on the unit, by the last that was smoothed."""
    if smoothed is None or not (smoothed.delivered > 0.0 and smoothed.prior[M, M] > p.gyr_scale**2):
        return []
    return [warning("estimate.as_delivered", percent=100.0 * np.abs(smoothed.sweep.matrix[::4]).max())]


def stretch_remarks(smoothed: Smoothed, t: Floats) -> list[Finding]:
    """Remarks on a stretch of a recording, with the times (N,) at which its attitude is kept."""
    begin, end = float(t[0]), float(t[-1])
    remarks = _gaps(smoothed.frames.time[1:][smoothed.frames.gap], begin, end)
    if when := _spells(smoothed.frames.time, smoothed.weightless, begin, end):
        remarks.append(_doubted("estimate.weightless", when, smoothed.weightless))
    if smoothed.reference is None:
        if np.isfinite(smoothed.frames.mag[:, 0]).any():
            remarks.append(warning("estimate.heading_free"))
        return remarks
    if (attached := smoothed.attached) is not None:
        iron, suspect = float(np.linalg.norm(attached.iron)), float(np.linalg.norm(attached.suspect))
        if iron:  # taken off, where a suspect one is not
            remarks.append(warning("estimate.field_of_unit", field=iron))
        elif suspect >= TOLD:
            remarks.append(warning("estimate.field_suspect", field=suspect, heading_deg=to_deg(smoothed.iron_turn)))
        if attached.present and (
            when := _spells(smoothed.frames.time, np.asarray(attached.magnet.any(axis=1)), begin, end)
        ):
            size = float(np.linalg.norm(attached.magnet, axis=1).max())
            remarks.append(warning("estimate.field_of_sensor", field=size, when=when))
    gated = (smoothed.weight < GATED) & np.isfinite(smoothed.sweep.field[:, 0])
    if when := _spells(smoothed.frames.time, gated, begin, end):
        remarks.append(_doubted("estimate.field_wrong", when, gated))
    if (main := smoothed.reference).rival is not None:
        (level, up), turn = main.rival, float(to_deg(smoothed.rival_turn))
        remarks.append(warning(
            "estimate.two_fields", level=main.level, up=main.vertical, other_level=level, other_up=up, heading_deg=turn
        ))  # fmt: skip
    return remarks


def _gaps(time: Floats, begin: float, end: float) -> list[Finding]:
    inside = time[(time >= begin) & (time <= end)]
    ends = tuple(f"{x:.1f}" for x in inside[:MOST])
    return [warning("estimate.gaps", count=inside.size, ends=ends)] if ends else []


def _spells(time: Floats, which: Bools, begin: float, end: float) -> str:
    """Times, s, for which something lasted, the longest few of them; empty where none did for long."""
    spells = [(max(float(time[a]), begin), min(float(time[b]), end)) for a, b in check.runs(which)]
    long = sorted((s for s in spells if s[1] - s[0] >= LASTING), key=lambda s: s[0] - s[1])
    named = ", ".join(f"{a:.0f}–{b:.0f} s" for a, b in sorted(long[:MOST]))
    return named if len(long) <= MOST else f"{named} and more, {math.fsum(b - a for a, b in long):.0f} s in all"
