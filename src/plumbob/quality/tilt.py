"""Statistics of roll, pitch, inclination and heading over a time, as papers on buoys and platforms give them.

Waves of roll and pitch are those between zero up-crossings: about the mean of the stretch, from one crossing upwards to
the next. The double amplitude of a wave is its highest value less its lowest one. The significant one is the mean of
the highest third of the waves, and for a narrow-banded Gaussian sea it is 4.00 standard deviations
[LonguetHiggins1952]. So that noise near zero makes no waves, the angle must have been below and above the mean by
`DEAD` standard deviations on the two sides of a crossing.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ShapeError
from plumbob.core.time import GAP_FACTOR
from plumbob.core.units import deg
from plumbob.quality.spectra import peak_period, welch

DEAD: Final = 0.05  # Band about the mean within which nothing crosses it, in standard deviations
THIRD: Final = 1.0 / 3.0  # Share of the waves, the highest ones, of which the significant double amplitude is the mean
LIMIT: Final = float(deg(15.0))  # Inclination that counts as large unless another is given, rad
_BINS = 288  # Of the histogram of headings, 1.25° each, so that sectors of 10° and of 22.5° can stand about North


def _pooled(parts: "Sequence[TiltMotion] | Sequence[Inclination]") -> tuple[int, float, float]:
    """Count, mean and standard deviation of the samples of several stretches, each with some."""
    count = np.array([part.samples for part in parts], dtype=np.float64)
    means = np.array([part.mean for part in parts])
    mean = float(np.sum(count * means) / np.sum(count))
    variance = np.array([part.sd**2 for part in parts]) + (means - mean) ** 2
    return int(np.sum(count)), mean, math.sqrt(float(np.sum(count * variance) / np.sum(count)))


@dataclass(eq=False)
class TiltMotion:
    """Roll or pitch over a time."""

    samples: int  # how many of them are known
    # mean, sd, least, greatest: of the angle, rad; the standard deviation is about the mean
    mean: float
    sd: float
    least: float
    greatest: float
    heights: Floats  # (W,), double amplitudes of the waves, rad
    periods: Floats  # (W,), their periods, s
    tp: float = math.nan  # period of the peak of the spectrum, s; NaN where there is none
    # whether the angle went through ±180°, so that its mean and all that follows from it mean nothing
    wrapped: bool = False
    rms: float = field(init=False)  # root mean square of the angle itself, about zero, rad
    waves: int = field(init=False)  # how many
    # mean double amplitude of the highest third of the waves, and the largest one, rad; NaN without waves
    significant: float = field(init=False)
    largest: float = field(init=False)
    tz: float = field(init=False)  # mean period between zero up-crossings, s; NaN without waves

    def __post_init__(self) -> None:
        self.rms, self.waves = math.hypot(self.mean, self.sd), int(self.heights.size)
        self.significant = self.largest = self.tz = math.nan
        if self.waves:
            below = self.waves - max(1, round(self.waves * THIRD))
            self.significant = float(np.mean(np.partition(self.heights, below)[below:]))
            self.largest, self.tz = float(np.max(self.heights)), float(np.mean(self.periods))

    @classmethod
    def of(cls, t: Floats, angle: Floats, tp: float = math.nan) -> Self:
        """Motion of an angle (N,), rad, at times (N,), s; NaN where not known; `tp` is that of one that moves."""
        finite = np.isfinite(angle)
        if not finite.any():
            return cls(0, math.nan, math.nan, math.nan, math.nan, np.empty(0), np.empty(0))
        at, theta = t[finite], angle[finite]
        mean, sd = float(np.mean(theta)), float(np.std(theta))
        step = float(np.median(np.diff(t))) if t.size > 1 else math.inf
        wrapped = bool(np.any((np.abs(np.diff(theta)) > np.pi) & (np.diff(at) <= GAP_FACTOR * step)))
        if wrapped:
            none = np.empty(0)
            return cls(theta.size, math.nan, math.nan, float(theta.min()), float(theta.max()), none, none, wrapped=True)
        heights, periods = waves(at, theta - mean, gap=GAP_FACTOR * step, dead=DEAD * sd)
        tp = tp if sd > 0.0 else math.nan
        return cls(theta.size, mean, sd, float(theta.min()), float(theta.max()), heights, periods, tp)

    @classmethod
    def joined(cls, parts: Sequence[Self], tp: float = math.nan) -> Self:
        """Motion over several stretches: moments of all samples, and the waves that each has about its own mean."""
        usable = [part for part in parts if part.samples]
        if not usable:
            return cls.of(np.zeros(1), np.full(1, np.nan))
        heights, periods = (np.concatenate([getattr(part, name) for part in usable]) for name in ("heights", "periods"))
        least, greatest = min(part.least for part in usable), max(part.greatest for part in usable)
        wrapped = any(part.wrapped for part in usable)
        return cls(*_pooled(usable), least, greatest, heights, periods, math.nan if wrapped else tp, wrapped)


@dataclass(eq=False)
class Inclination:
    """Angle between the body's vertical axis and the vertical over a time, whatever its direction."""

    samples: int  # how many of them are known
    # mean, sd, greatest: of the angle, rad
    mean: float
    sd: float
    greatest: float
    greatest_at: float  # when it was greatest, s
    limit: float  # what counts as large, rad
    beyond: int  # samples beyond the limit
    rms: float = field(init=False)  # root mean square, rad
    share_beyond: float = field(init=False)  # share of the samples beyond the limit; NaN where there are none

    def __post_init__(self) -> None:
        self.rms = math.hypot(self.mean, self.sd)
        self.share_beyond = self.beyond / self.samples if self.samples else math.nan

    @classmethod
    def of(cls, t: Floats, angle: Floats, limit: float) -> Self:
        """Of an inclination (N,), rad, at times (N,), s."""
        finite = np.isfinite(angle)
        if not finite.any():
            return cls(0, math.nan, math.nan, math.nan, math.nan, limit, 0)
        theta = angle[finite]
        top = int(np.argmax(theta))
        mean, sd, beyond = float(np.mean(theta)), float(np.std(theta)), int(np.count_nonzero(theta > limit))
        return cls(theta.size, mean, sd, float(theta[top]), float(t[finite][top]), limit, beyond)

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Of several stretches."""
        usable = [part for part in parts if part.samples]
        if not usable:
            return parts[0]
        samples, mean, sd = _pooled(usable)
        highest = max(usable, key=attrgetter("greatest"))
        return replace(highest, samples=samples, mean=mean, sd=sd, beyond=sum(part.beyond for part in usable))


@dataclass(eq=False)
class Headings:
    """Headings over a time, as directions on a circle [Mardia2000]."""

    counts: NDArray[np.int64]  # (288,), samples in sectors of 1.25°, clockwise from North
    # cosine, sine: sums over the samples; all three of several stretches add up
    cosine: float
    sine: float
    samples: int = field(init=False)  # how many are known
    # length of the mean direction vector: 1 where all headings are the same, near 0 where all occur alike
    resultant: float = field(init=False)
    mean: float = field(init=False)  # direction of the mean vector, rad, 0 to 2π clockwise from North
    spread: float = field(init=False)  # circular standard deviation √(−2 ln R), rad, of the resultant R

    def __post_init__(self) -> None:
        self.samples = int(np.sum(self.counts))
        self.resultant = self.mean = self.spread = math.nan
        if self.samples:
            self.resultant = r = math.hypot(self.cosine, self.sine) / self.samples
            self.mean = math.atan2(self.sine, self.cosine) % (2.0 * math.pi)
            self.spread = math.sqrt(max(0.0, -2.0 * math.log(r))) if r > 0.0 else math.inf

    def sectors(self, count: int) -> Floats:
        """Share of the samples in each of `count` equal sectors, the first about North: 36 of 10°, or 16 of 22.5°."""
        width = _BINS // count
        if width * count != _BINS or width % 2:
            raise ShapeError(
                f"headings are counted in sectors of 2.5° and multiples of it, but {count} sectors were asked for."
            )
        turned = np.roll(self.counts, width // 2).reshape(count, width).sum(axis=1)
        return np.asarray(turned / max(1, self.samples), dtype=np.float64)

    @classmethod
    def of(cls, heading: Floats) -> Self:
        """Of headings (N,), rad clockwise from North; NaN where not known."""
        headings = heading[np.isfinite(heading)]
        place = np.floor((headings % (2.0 * np.pi)) * (_BINS / (2.0 * np.pi))).astype(np.int64) % _BINS
        counts = np.bincount(place, minlength=_BINS).astype(np.int64)
        return cls(counts, float(np.sum(np.cos(headings))), float(np.sum(np.sin(headings))))


@dataclass(frozen=True, eq=False)
class TiltStatistics:
    """Roll, pitch and inclination over a time."""

    # roll, pitch: the two angles
    roll: TiltMotion
    pitch: TiltMotion
    inclination: Inclination  # angle from the vertical


def tilt_statistics(
    t: Floats, roll: Floats, pitch: Floats, *, limit: float = LIMIT, segment: float | None = None
) -> TiltStatistics:
    """Statistics of roll and pitch over a time.

    Parameters
    ----------
    t : ndarray (N,)
        Increasing times, s.
    roll, pitch : ndarray (N,)
        Angles, rad; NaN where not known.
    limit : float
        Inclination that counts as large, rad.
    segment : float, optional
        Length of the segments of the spectrum whose peak gives Tp, s; without it a quarter of the time, at most 256 s.

    Returns
    -------
    TiltStatistics

    Raises
    ------
    ShapeError
        If the three are not of one length.
    """
    t = check.column("t", t)
    roll, pitch = check.column("roll", roll, t.size), check.column("pitch", pitch, t.size)
    tilt = np.arccos(np.clip(np.cos(roll) * np.cos(pitch), -1.0, 1.0))
    spectra = welch(t, np.stack((roll, pitch), axis=1), segment=segment)
    motions = [TiltMotion.of(t, angle, peak_period(spectra, i)) for i, angle in enumerate((roll, pitch))]
    return TiltStatistics(motions[0], motions[1], Inclination.of(t, tilt, limit))


def waves(t: Floats, x: Floats, *, gap: float, dead: float = 0.0) -> tuple[Floats, Floats]:
    """Double amplitudes (W,) and periods (W,) of the waves between zero up-crossings.

    Parameters
    ----------
    t : ndarray (N,)
        Increasing times, s.
    x : ndarray (N,)
        Values about their mean, all known.
    gap : float
        A longer step in time ends a wave, which is left out, s.
    dead : float
        What `x` must go below and above zero on the two sides of a crossing.
    """
    side = np.where(x > dead, 1, np.where(x < -dead, -1, 0))
    clear = np.flatnonzero(side)
    rises = np.flatnonzero(np.diff(side[clear]) > 0)
    if rises.size < 2:
        return np.empty(0), np.empty(0)
    low = np.flatnonzero(x <= 0.0)
    last = low[np.searchsorted(low, clear[rises + 1]) - 1]  # the last sample at or below zero before each rise
    stretch = np.concatenate(([0], np.cumsum(np.diff(t) > gap)))
    unbroken = stretch[clear[rises]] == stretch[clear[rises + 1]]
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = t[last] + (t[last + 1] - t[last]) * (-x[last] / (x[last + 1] - x[last]))
    same = (stretch[last[:-1]] == stretch[last[1:]]) & unbroken[:-1] & unbroken[1:]
    begins = last + 1
    high = np.maximum.reduceat(x, begins)[:-1]
    deep = np.minimum.reduceat(x, begins)[:-1]
    return (high - deep)[same], np.diff(crossing)[same]
