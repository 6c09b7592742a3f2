"""What was found in a record that should be static: errors and warnings, and when it was still.

Disturbed seconds of a long record: which may be skipped, and what takes their place in an even row of samples.

A step that somebody takes, or a door, spoils a second of hours. What is left is as good as before, but an Allan
deviation and a spectrum need even samples, so each gap is filled with its neighbours: those before it, mirrored, for
its first half, and those after it for its second, on a straight line between the two levels. So it has the noise of its
surroundings at all but the longest times, and shows nothing of its own.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import ShapeError
from plumbob.core.findings import Finding
from plumbob.noise.static.artefacts import Parts, joined


@dataclass(frozen=True, slots=True)
class Remark:
    """One thing to know about a record: its channel, or the names of those that it concerns, and the finding."""

    channel: str
    finding: Finding

    @property
    def kind(self) -> str:
        """What it is: the code without its family, as ``"one_way"``."""
        return self.finding.code.partition(".")[2]

    @property
    def refuses(self) -> bool:
        """Whether an analysis of the channel would mislead."""
        return self.finding.severity == "error"

    def concerns(self, channel: str) -> bool:
        """Whether it is about a channel, alone or with others; a name may hold a comma."""
        return channel == self.channel or channel in self.channel.split(", ")

    def __str__(self) -> str:
        """Sentence with the channel."""
        return f"{self.channel}: {self.finding}"


@dataclass(frozen=True)
class StaticReport:
    """What was found in a record."""

    findings: tuple[Remark, ...]  # errors and warnings
    steps: Mapping[str, float]  # step of the values of each channel, in their unit; 0 where none was found
    moving: tuple[tuple[float, float], ...]  # when something moved or was stuck, s, in order
    still: tuple[float, float] | None  # longest stretch without, s, if it has enough samples
    # times, s, that an analysis of a channel leaves out, with their margins
    skipped: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)

    @property
    def errors(self) -> tuple[Remark, ...]:
        """Findings for which an analysis would mislead."""
        return tuple(finding for finding in self.findings if finding.refuses)

    @property
    def warnings(self) -> tuple[Remark, ...]:
        """Findings that a reader must know."""
        return tuple(finding for finding in self.findings if not finding.refuses)

    def refused(self, *channels: str) -> bool:
        """Whether an analysis of any of the channels would mislead."""
        return any(finding.concerns(channel) for finding in self.errors for channel in channels)

    def require(self, *sensors: Sequence[str]) -> None:
        """Refuse a record of which no sensor can be analysed.

        Parameters
        ----------
        *sensors : sequence of str
            Names of the channels of each sensor; without any, one error refuses the record.

        Raises
        ------
        ShapeError
            With the first error, and how many there are.
        """
        if self.errors and all(self.refused(*names) for names in sensors):
            more = f" ({len(self.errors) - 1} more)" if len(self.errors) > 1 else ""
            raise ShapeError(f"not a static record: {self.errors[0]}{more}")


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
    filled = samples.copy()
    begin, stop = 0, len(filled)
    for a, b in parts:
        first, end = max(0, round((a - start) / dt)), min(len(filled), round((b - start) / dt))
        if first <= begin:
            begin = end
        elif end >= len(filled):
            stop = first
        else:
            filled[first:end] = _filling(filled[begin:first], filled[end:], end - first)
    return filled[begin:stop]


def _filling(before: Floats, after: Floats, count: int) -> Floats:
    """Rows (count, k) between two stretches: each mirrored for its half, on a line between their levels."""
    reach = max(1, min(count, len(before), len(after)))
    tail, head = before[-reach:], after[:reach]
    low, high = tail.mean(axis=0), head.mean(axis=0)
    place = (np.arange(count) + 0.5) / count
    half = count // 2
    noise = np.empty((count, before.shape[1]))
    noise[:half] = (tail - low)[::-1][np.arange(half) % reach]
    noise[half:] = (head - high)[np.arange(count - half)[::-1] % reach]
    return np.asarray(noise + low + place[:, np.newaxis] * (high - low))
