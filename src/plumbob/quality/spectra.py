"""Power spectra by Welch's method [Welch1967], of stretches without a gap.

Segments of equal length, half of each the same as half of the next, are freed of their mean, multiplied by a Hann
window and transformed; the density is one-sided, and its integral over frequency is the variance.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.time import GAP_FACTOR

SEGMENT: Final = 256.0  # Length of a segment at most, s: the waves of a sea stand in steps of 0.004 Hz
FEWEST: Final = 4  # A stretch is cut in so many segments at least, so that a density is a mean of several
LEAST: Final = 16  # Samples of a segment at least
SHARED: Final = 1.0 / 36.0  # [Welch1967]: squared correlation of Hann windows that share half of their samples
UNEVEN: Final = 0.25  # Samples that depart from even times by more than this part of a step are interpolated


@dataclass(frozen=True, eq=False)
class Spectra:
    """Densities of several channels."""

    frequency: Floats  # (F,), from the resolution in steps of it to half the rate, Hz
    density: Floats  # (F, C), one-sided, unit²/Hz; NaN where a channel has no segment
    segments: NDArray[np.int64]  # (C,), how many segments of each channel were averaged
    step: float  # between samples, s
    length: int  # samples of a segment
    interpolated: int = 0  # segments whose samples were not even in time

    @classmethod
    def joined(cls, parts: "list[Self]") -> Self:
        """Mean of several, each by its number of segments."""
        first = parts[0]
        segments = np.sum([part.segments for part in parts], axis=0)
        total = np.sum([np.where(part.segments > 0, part.density * part.segments, 0.0) for part in parts], axis=0)
        density = np.divide(total, segments, out=np.full_like(total, np.nan), where=segments > 0)
        interpolated = sum(part.interpolated for part in parts)
        return cls(first.frequency, density, segments, first.step, first.length, interpolated)

    def gathered(self, per_decade: int = 60, single: int = 100) -> tuple[Floats, Floats]:
        """Frequencies (G,) and densities (G, C) for a picture: the lowest one by one, others as means of bands."""
        count = self.frequency.size
        decades = math.log10(max(count, 1) / single) if count > single else 0.0
        wide = np.rint(single * 10.0 ** np.linspace(0.0, decades, int(per_decade * decades) + 2)).astype(np.int64)
        starts = np.unique(np.concatenate((np.arange(min(single, count)), wide[wide < count])))
        sizes = np.diff(np.append(starts, count))
        frequency = np.add.reduceat(self.frequency, starts) / sizes
        return frequency, np.add.reduceat(self.density, starts, axis=0) / sizes[:, np.newaxis]


def segment_length(duration: float) -> float:
    """Length of the segments of a stretch of this duration, s."""
    return min(SEGMENT, duration / FEWEST)


def welch(
    t: Floats, values: Floats, *, step: float | None = None, segment: float | None = None, turns: tuple[int, ...] = ()
) -> Spectra:
    """Spectra of channels over a time.

    Parameters
    ----------
    t : ndarray (N,)
        Increasing times, s.
    values : ndarray (N, C)
        Channels; NaN where not known, which ends a stretch.
    step : float, optional
        Usual time between samples, s; the median step without it.
    segment : float, optional
        Length of a segment, s; that of `segment_length` without it.
    turns : tuple of int
        Channels that are angles, rad, which go on through ±180°.
    """
    segmented = _Segmented.cut(t, step, segment)
    total = np.zeros((segmented.frequency.size, values.shape[1]))
    segments = np.zeros(values.shape[1], dtype=np.int64)
    for channel in range(values.shape[1]):
        column = values[:, channel : channel + 1]
        for transform in segmented.transforms(t, column, unwrapped=channel in turns):
            total[:, channel] += np.abs(transform[:, 0]) ** 2
            segments[channel] += 1
    density = np.divide(total, segments, out=np.full_like(total, np.nan), where=segments > 0)
    return Spectra(segmented.frequency, density, segments, segmented.step, segmented.length, segmented.uneven)


@dataclass(frozen=True, eq=False)
class CrossSpectra:
    """Densities of channels with each other."""

    frequency: Floats  # (F,), Hz
    density: NDArray[np.complex128]  # (F, C, C), mean of conj(X_i) X_j, one-sided, unit²/Hz; NaN without a segment
    segments: int  # how many were averaged
    freedom: float  # [Welch1967]: degrees of freedom of each density
    effective: (
        float  # time that an integral over frequency is a mean of, s: less than that of the samples, by the taper
    )


def cross_spectra(t: Floats, values: Floats, *, step: float, segment: float) -> CrossSpectra:
    """Spectra of channels (N, C) with each other, by segments in which all are known; otherwise as of `welch`."""
    segmented = _Segmented.cut(t, step, segment)
    total = np.zeros((segmented.frequency.size, values.shape[1], values.shape[1]), dtype=np.complex128)
    count, length, weight = 0, segmented.length, np.zeros(t.size)
    starts = _starts(t, values.sum(axis=1), length, segmented.step)
    for start, transform in zip(starts, segmented.transforms(t, values), strict=True):
        total += transform.conj()[:, :, np.newaxis] * transform[:, np.newaxis, :]
        weight[start : start + length] += segmented.window**2
        count += 1
    if not count:
        return CrossSpectra(segmented.frequency, np.full_like(total, np.nan), 0, 0.0, 0.0)
    halves = np.count_nonzero(np.diff(starts) == max(1, length // 2))  # of neighbours that share half of their samples
    freedom = 2.0 * count / (1.0 + 2.0 * halves / count * SHARED)
    effective = float(np.sum(weight) ** 2 / np.sum(weight**2) * segmented.step)
    return CrossSpectra(segmented.frequency, total / count, count, freedom, effective)


@dataclass(eq=False)
class _Segmented:
    """How a record is cut into segments, and their transforms."""

    step: float
    length: int
    window: Floats
    frequency: Floats
    uneven: int = 0

    @classmethod
    def cut(cls, t: Floats, step: float | None, segment: float | None) -> Self:
        duration = float(t[-1] - t[0]) if t.size > 1 else 0.0
        if step is None:
            step = float(np.median(np.diff(t))) if t.size > 1 else 1.0
        length = max(LEAST, round((segment_length(duration) if segment is None else segment) / step))
        window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length)
        return cls(step, length, window, np.arange(1, length // 2 + 1) / (length * step))

    def transforms(self, t: Floats, values: Floats, *, unwrapped: bool = False) -> Iterator[NDArray[np.complex128]]:
        """Of each segment of channels (N, C), (F, C), so that squares are densities; those of angles `unwrapped`."""
        from scipy.fft import rfft

        for start in _starts(t, values.sum(axis=1), self.length, self.step):
            samples, at = values[start : start + self.length], t[start : start + self.length]
            samples = np.unwrap(samples, axis=0) if unwrapped else samples
            grid = at[0] + (at[-1] - at[0]) / (self.length - 1) * np.arange(self.length)
            if np.max(np.abs(at - grid)) > UNEVEN * self.step:
                samples = np.stack([np.interp(grid, at, column) for column in samples.T], axis=1)
                self.uneven += 1
            tapered = (samples - np.mean(samples, axis=0)) * self.window[:, np.newaxis]
            transform = rfft(tapered, axis=0)[1:] * math.sqrt(2.0 * self.step / np.sum(self.window**2))
            if self.length % 2 == 0:
                transform[-1] *= math.sqrt(0.5)  # half the rate has no partner
            yield np.asarray(transform, dtype=np.complex128)


def _starts(t: Floats, values: Floats, length: int, step: float) -> list[int]:
    """First sample of each segment: half-overlapping ones of every stretch without a gap or an unknown value."""
    finite = np.isfinite(values)
    broken = np.zeros(t.size + 1, dtype=bool)
    broken[0] = broken[-1] = True
    broken[1:-1] = (np.diff(t) > GAP_FACTOR * step) | (finite[1:] != finite[:-1])
    edges = np.flatnonzero(broken)
    starts: list[int] = []
    for start, stop in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        if stop - start >= length and finite[start]:
            starts += range(start, stop - length + 1, max(1, length // 2))
    return starts


def peak_period(spectra: Spectra, channel: int) -> float:
    """Period of the peak of a density, s: a parabola through the logarithms of the highest value and its neighbours.

    NaN where the density is not known.
    """
    density = spectra.density[:, channel]
    if not density.size or not np.isfinite(density).all() or not density.max() > 0.0:
        return math.nan
    top = int(np.argmax(density))
    shift = 0.0
    if 0 < top < density.size - 1 and density[top - 1 : top + 2].min() > 0.0:
        below, middle, above = np.log(density[top - 1 : top + 2])
        bend = below - 2.0 * middle + above
        shift = 0.5 * (below - above) / bend if bend < 0.0 else 0.0
    return float(1.0 / (spectra.frequency[top] + shift * spectra.frequency[0]))
