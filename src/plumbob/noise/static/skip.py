"""Disturbed seconds of a long record: which may be skipped, and what takes their place in an even row of samples.

A step that somebody takes, or a door, spoils a second of hours. What is left is as good as before, but an Allan
deviation and a spectrum need even samples, so each gap is filled with its neighbours: those before it, mirrored, for
its first half, and those after it for its second, on a straight line between the two levels. So it has the noise of its
surroundings at all but the longest times, and tells nothing of its own.
"""

import math
from typing import Final

import numpy as np

from plumbob.check import Floats
from plumbob.noise.static.stillness import Parts, joined

MARGIN: Final = 1.0
"""What is skipped before and after a disturbance too, s."""
MOST: Final = 0.05
"""Share of a record that may be skipped because it was found to be disturbed; more is no static record."""
MOST_ASKED: Final = 0.2
"""Share that may be skipped because it was asked for."""
LONGEST: Final = 60.0
"""Longest part that may be skipped because it was found, s: somebody at work, not a step."""

_LEVEL: Final = 10  # seconds whose mean is a level
_JUMP: Final = 6.0  # standard deviations of what the record does by itself in the same time
_FEWEST: Final = 20  # of such changes that are known


def widened(parts: Parts, start: float, stop: float) -> Parts:
    """Parts with their margins, s, inside of a record from `start` to `stop`; those that then meet are one."""
    return joined([(max(start, a - MARGIN), min(stop, b + MARGIN)) for a, b in parts])


def total(parts: Parts) -> float:
    """Sum of their lengths."""
    return sum(b - a for a, b in parts)


def jumped(means: Floats, parts: Parts, start: float) -> float | None:
    """When, s, a part ends after which the level is another; None where the record drifts as much by itself.

    Parameters
    ----------
    means : ndarray (n, k)
        Average of each second of the record.
    parts : list of (float, float)
        Parts that are skipped, s.
    start : float
        Time of the first sample, s.
    """
    seconds = [(math.floor(a - start), math.ceil(b - start)) for a, b in parts]
    disturbed = np.zeros((len(means), 1))
    for first, end in seconds:
        disturbed[first:end] = 1.0
    levels = _sums(means, _LEVEL) / _LEVEL
    for begin, late in joined([(a, b + _LEVEL) for a, b in seconds]):  # those that share a level are judged together
        before, end = int(begin) - _LEVEL, int(late) - _LEVEL
        if before < 0 or end >= len(levels):
            continue
        apart = end - before
        quiet = _sums(disturbed, apart + _LEVEL)[:, 0] == 0.0
        changes = (levels[apart:] - levels[:-apart])[quiet]
        if len(changes) < _FEWEST:
            return start + end
        usual = np.median(changes, axis=0)
        sd = 1.4826 * np.median(np.abs(changes - usual), axis=0)  # of a normal distribution
        if (np.abs(levels[end] - levels[before] - usual) > _JUMP * sd).any():
            return start + end
    return None


def _sums(rows: Floats, size: int) -> Floats:
    total = np.concatenate((np.zeros((1, rows.shape[1])), np.cumsum(rows, axis=0)))
    return np.asarray(total[size:] - total[:-size])


def bridged(samples: Floats, dt: float, start: float, parts: Parts) -> Floats:
    """Samples (N, k), every `dt` s from `start` on, with their neighbours in place of the parts.

    A part at an end of the record is cut off.
    """
    found = samples.copy()
    begin, stop = 0, len(found)
    for a, b in parts:
        first, end = max(0, round((a - start) / dt)), min(len(found), round((b - start) / dt))
        if first <= begin:
            begin = end
        elif end >= len(found):
            stop = first
        else:
            found[first:end] = _filling(found[begin:first], found[end:], end - first)
    return found[begin:stop]


def _filling(before: Floats, after: Floats, count: int) -> Floats:
    """Rows (count, k) between two stretches: each mirrored for its half, on a line between their levels."""
    reach = max(1, min(count, len(before), len(after)))
    left, right = before[-reach:], after[:reach]
    low, high = left.mean(axis=0), right.mean(axis=0)
    place = (np.arange(count) + 0.5) / count
    half = count // 2
    noise = np.empty((count, before.shape[1]))
    noise[:half] = (left - low)[::-1][np.arange(half) % reach]
    noise[half:] = (right - high)[np.arange(count - half)[::-1] % reach]
    return np.asarray(noise + low + place[:, np.newaxis] * (high - low))
