"""One time line of whatever stamps a file has: they repeat, are coarse, jitter or wrap, and every sample is kept.

Samples come in the order in which they were taken; a stamp says when somebody wrote it down. Where stamps increase they
are taken as they are. Otherwise, in this order:

- a counter that begins again at a power of two, or a clock at midnight or at the end of the week, goes on; so does one
  that begins again at a power of a thousand, or at the hour, as where summer time ends, or at the minute, unless it
  comes back to its first stamp, for then it is a second recording as well;
- stamps that repeat or go back by less than they jitter become an even clock: the straight line through the stamps of
  each stretch without a gap, as long as no sample moves by more than a stamp's own coarseness allows; else the samples
  between two different stamps are spread evenly between these;
- a clock that begins again is another recording, and is refused with its row.

Rows without a stamp, as where only the first or the last one of each burst has one, lie evenly between those with one.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import ClockError
from plumbob.core.findings import Finding, warning
from plumbob.core.time import GAP_FACTOR, LONGEST

_COUNTERS: Final = tuple(float(1 << bits) for bits in (8, 12, 16, 24, 32))
_DECIMALS: Final = (1e3, 1e6, 1e9)  # counters of a part of a second
WEEK: Final = 604_800  # seconds
_PERIODS_NS: Final = {"midnight": 86_400e9, "the end of the week": WEEK * 1e9}
CENTURY: Final = (946_684_800.0, 4_102_444_800.0)  # unix time of 2000 and of 2100, s
_GPS_EPOCH: Final = 315_964_800
_LEAPS: Final = (  # GPS time, s, when a leap second was added (IERS Bulletin C; none since 2017)
    46828800, 78364801, 109900802, 173059203, 252028804, 315187205, 346723206, 393984007, 425520008, 457056009,
    504489610, 551750411, 599184012, 820108813, 914803214, 1025136015, 1119744016, 1167264017,
)  # fmt: skip

_JITTERING: Final = 0.25  # share of steps back where stamps jitter by a step (Gaussian deviation: 0.24)


class SampleTimes(NamedTuple):
    """Times (N,), ns, that increase, and what was done to have them."""

    t_ns: NDArray[np.int64]
    notes: tuple[Finding, ...]


def falls(times: Floats) -> bool:
    """Whether a clock goes back from the first row to the last, in several steps: the newest row stands first."""
    steps = np.diff(times if times.size and times[-1] < times[0] else times[:0])
    return bool(np.count_nonzero(steps < 0.0) > 1 and (steps <= 0.0).all())


def time_line(
    stamps: Floats | NDArray[np.int64], unit_ns: float = 1.0, place: Callable[[int], str] = lambda row: f"row {row + 1}"
) -> SampleTimes:
    """Times of samples by their stamps (N,), in units of `unit_ns` ns; ClockError if time begins again."""
    rows = np.flatnonzero(np.isfinite(stamps))
    if rows.size < stamps.size:
        if rows.size < len("ab") or np.isinf(stamps).any():
            raise ClockError(f"{place(int(np.argmin(np.isfinite(stamps))))} has no time stamp.")
        line = time_line(stamps[rows], unit_ns, lambda row: place(int(rows[row])))
        t_ns, how = _between(line.t_ns, rows, stamps.size)
        return SampleTimes(t_ns, (*line.notes, how))
    zero = stamps[0] if stamps.size else 0
    values = np.asarray(stamps - zero, dtype=np.float64)  # ns since 1970 are more than float64 holds
    notes: list[Finding] = []
    if not (np.diff(values) > 0.0).all():
        ahead, notes = _turns(values, float(zero), unit_ns, place)
        values = values + ahead
    t_ns = np.rint(values * unit_ns).astype(np.int64)
    if not (np.diff(t_ns) > 0).all():
        t_ns, how = _even(t_ns, place)
        notes.append(how)
    return SampleTimes(t_ns + (int(zero) if unit_ns == 1.0 else round(float(zero) * unit_ns)), tuple(notes))


def _between(t_ns: NDArray[np.int64], rows: NDArray[np.intp], count: int) -> tuple[NDArray[np.int64], Finding]:
    """Times of so many rows, of which some have these, and what was assumed; a burst before a gap does not reach it."""
    is_last = bool(rows[0] > 0 and rows[-1] == count - 1)
    t_ns, rows = (-t_ns[::-1], count - 1 - rows[::-1]) if is_last else (t_ns, rows)
    steps, counts = np.diff(t_ns), np.diff(rows)
    each = steps / counts
    are_gaps = each > GAP_FACTOR * np.median(each)
    usual = steps[~are_gaps].sum() / counts[~are_gaps].sum()
    each = np.append(np.where(are_gaps, usual, each), usual)
    place = np.maximum(np.searchsorted(rows, np.arange(count), side="right") - 1, 0)
    times = t_ns[place] + np.rint((np.arange(count) - rows[place]) * each[place]).astype(np.int64)
    which = {"last" if is_last else "first": True}
    how = warning("reading.clock_between", count=count - rows.size, rows=count, rate=1e9 / usual, **which)
    return -times[::-1] if is_last else times, how


def turn_lengths(largest: float, unit_ns: float) -> dict[str, float]:
    """After how much a clock begins again, by name: a counter at a power of two above what it has reached, or a day."""
    counters = {f"{length:.0f}": length for length in _COUNTERS if largest < length}
    return counters | {name: period / unit_ns for name, period in _PERIODS_NS.items()}


def _turns(values: Floats, zero: float, unit_ns: float, place: Callable[[int], str]) -> tuple[Floats, list[Finding]]:
    """What to add to the values of a counter that began again, where a length makes a step that the file has."""
    steps = np.diff(values)
    forward = steps[steps > 0.0]
    if not forward.size:
        which = (
            f"all {values.size} time stamps are {zero:g}"
            if not steps.any()
            else "no time stamp is later than the one before"
        )
        raise ClockError(
            f"{which}, so nothing says when a sample was taken. Check which column is time, or declare a rate."
        )
    longest = max(float(forward.max()), GAP_FACTOR * float(np.median(forward)))
    far = steps < -longest
    far[:-1] &= ~(steps[1:] > -0.5 * steps[:-1])  # a single stamp that is wrong, and the clock goes on behind it
    if not far.any():
        return np.zeros(values.size), []
    are_whole = bool((values == np.rint(values)).all()) and zero == np.rint(zero)
    lengths = turn_lengths(values.max() + zero if are_whole else np.inf, unit_ns)
    if abs(values[1 + int(np.argmax(far))]) > longest:
        lengths |= {f"{length:.0f}": length for length in _DECIMALS if are_whole and values.max() + zero < length}
        lengths |= {"the hour": 3600e9 / unit_ns, "the minute": 60e9 / unit_ns}
    for name, length in lengths.items():
        remaining = steps[far] + length
        if ((remaining > 0.0) & (remaining <= longest)).all():
            ahead = np.concatenate(([0.0], np.cumsum(far))) * length
            return ahead, [warning("reading.clock_turned", at=name, count=int(far.sum()))]
    row = 1 + int(np.argmax(far))
    raise ClockError(
        f"time begins again at {place(row)}: {values[row - 1] + zero:.10g} is followed by {values[row] + zero:.10g}. "
        "The file holds two recordings, or another column is time; put the rows from there on into a file of their own."
    )


def _even(t_ns: NDArray[np.int64], place: Callable[[int], str]) -> tuple[NDArray[np.int64], Finding]:
    """Times that increase, through stamps that repeat or go back a little, and how far they were moved."""
    forward = np.diff(t_ns)
    repeated = int(np.count_nonzero(forward <= 0))
    coarse = float(np.median(forward[forward > 0]))  # of stamps that repeat, what they are rounded to
    stamps, alone = without_leaps(t_ns)
    steps = np.diff(stamps)
    usual = max(float(np.mean(steps[np.abs(steps) <= GAP_FACTOR * coarse])), 1.0)
    room = GAP_FACTOR * max(coarse, usual)
    edges = [0, *(np.flatnonzero(steps > room) + 1).tolist(), stamps.size]
    even = np.empty(stamps.size)
    for first, end in pairwise(edges):
        even[first:end] = _stretch(stamps[first:end], usual, coarse)
    moved = np.abs(even - stamps)
    if moved.max() > room or np.count_nonzero(forward < 0) > _JITTERING * t_ns.size:
        row = int(np.argmax(moved))
        raise ClockError(
            f"{repeated} of {t_ns.size} time stamps repeat or go back, and not as a clock jitters: about {place(row)} "
            f"no even clock fits them within {moved[row] / 1e9:.3g} s. Check which column is the time of the samples."
        )
    times = np.rint(even).astype(np.int64)
    while (back := np.flatnonzero(np.diff(times) <= 0)).size:  # where two stretches meet
        times[back + 1] = times[back] + 1
    rate = 1e9 * (times.size - 1) / float(times[-1] - times[0])
    return times, warning(
        "reading.clock_fitted", repeated=repeated, stamps=t_ns.size, alone=alone or None, rate=rate,
        moved_ms=float(moved.max()) / 1e6,
    )  # fmt: skip


def without_leaps(stamps: NDArray[np.int64]) -> tuple[NDArray[np.int64], int]:
    """Stamps (N,) of which those that leap far off their neighbours lie between these, and how many do.

    Far is a gap off neighbours within a gap of each other, or half of the longest possible recording off the median.
    """
    if stamps.size < 3:
        return stamps, 0
    far = np.abs(stamps - np.median(stamps)) >= LONGEST / 2 * 1e9
    near = np.flatnonzero(~far)
    inner = stamps[near]
    if near.size > 2 and (steps := np.diff(inner)[np.diff(inner) > 0]).size:
        room = GAP_FACTOR * float(np.median(steps))
        before, at, behind = inner[:-2], inner[1:-1], inner[2:]
        far[near[1:-1]] = (np.abs(behind - before) <= room) & (np.maximum(before - at, at - behind) > room)
        near = np.flatnonzero(~far)
    if far.any() and near.size > 1:
        zero = stamps[near[0]]
        step = float(stamps[near[-1]] - zero) / (near[-1] - near[0])
        place, steps = np.arange(stamps.size), np.interp(np.arange(stamps.size), near, stamps[near] - zero)
        steps += np.minimum(place - near[0], 0) * step + np.maximum(place - near[-1], 0) * step
        stamps = np.where(far, zero + np.rint(steps).astype(np.int64), stamps)
    return stamps, int(np.count_nonzero(far))


def _stretch(t_ns: NDArray[np.int64], usual: float, coarse: float) -> Floats:
    """Times of samples without a gap: on a line, or between different stamps where the rate changes."""
    place = np.arange(t_ns.size, dtype=np.float64)
    offset = t_ns - float(t_ns[0])
    if t_ns.size < 3:
        return float(t_ns[0]) + usual * place
    highest = np.maximum.accumulate(offset)
    first = np.flatnonzero(np.diff(highest, prepend=-1.0) > 0.0)
    edges = first[1:] if first.size > 2 else place.astype(np.int64)  # a new stamp is late by less than a sample
    rate = np.polyfit(place[edges], offset[edges], 1)[0]
    line = rate * place + np.mean(offset - rate * place)
    if rate > 0.0 and np.abs(line - offset).max() <= 2.0 * max(coarse, usual):
        return np.asarray(float(t_ns[0]) + line)
    ends = np.append(highest[first], highest[-1] + usual)
    return np.asarray(float(t_ns[0]) + np.interp(place, np.append(first, t_ns.size), ends))


def utc_of_gps(week: int, tow_ns: int) -> int:
    """UTC, ns since 1970, of a time in a GPS week, ns, by the leap seconds that had been added then."""
    seconds = week * WEEK + tow_ns // 10**9
    return (_GPS_EPOCH + week * WEEK - sum(leap <= seconds for leap in _LEAPS)) * 10**9 + tow_ns
