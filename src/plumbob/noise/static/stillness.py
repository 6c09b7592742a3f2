"""Whether a channel was at rest all the time: what noise can do and motion does not.

White noise, flicker, random walk and their sums have stationary second differences of averages, at every averaging
time; a ramp has none. So the energy of these differences, summed over windows, is about the same all along the record.
A motion, a step or a bump multiplies it somewhere. The longest averages are a few seconds, for over minutes a warm-up
bends like a slow motion. Single wrong samples are not motion: a running median of three takes them out first.
"""

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core._jit import njit
from plumbob.core.check import Floats

Parts = list[tuple[float, float]]
"""Intervals, first and end."""

LOUDER: Final = 16.0
"""Energy of a window over that of the quiet ones from which on something moved; of noise, the extremes of a million
windows stay below 10 (χ² of 8 degrees of freedom against its quantile of 20 %)."""

JUMP: Final = 100.0
"""The same for one squared second difference: ten standard deviations, seven where the quiet ones seem too quiet."""

LONGEST_AVERAGE: Final = 5.0
"""Longest averages that are judged, s, to the next octave; over 10 s, a warm-up of 20 sd in 60 s moves at 1 kHz."""

HALF_WINDOW: Final = 8
"""Second differences in half a window, at least; they last a second at least."""

LONG_HALF_WINDOW: Final = 32
"""The same for averages that are not Gaussian."""

FEWEST_WINDOWS: Final = 6
_QUIET: Final = 0.2
_GAUSSIAN: Final = 4
"""Averages over fewer samples are not Gaussian: the running median takes the middle out of noise, not its tails."""


@njit
def median_of_three(x: Floats, out: Floats) -> None:
    """Running median: out[i] is the one of x[i], x[i + 1], x[i + 2]."""
    for i in range(out.shape[0]):
        a, b, c = x[i], x[i + 1], x[i + 2]
        out[i] = max(min(a, b), min(max(a, b), c))


@njit
def bend_energies(x: Floats, hop: int, total: Floats, largest: Floats) -> None:
    """Sums and largest of squared second differences, `hop` of them for each number of `total` and `largest`."""
    for i in range(total.shape[0]):
        part = x[i * hop : i * hop + hop + 2]
        energy, peak = 0.0, 0.0
        for k in range(hop):
            bend = part[k + 2] - 2.0 * part[k + 1] + part[k]
            energy += bend * bend
            peak = max(peak, bend * bend)
        total[i] = energy
        largest[i] = peak


@dataclass
class Level:
    """Averages over `n` samples: energies of their second differences, and the largest, in half windows of `hop`."""

    n: int
    hop: int
    _energies: list[NDArray[np.float32]] = field(default_factory=list)
    _largest: list[NDArray[np.float32]] = field(default_factory=list)
    _rest: Floats = field(default_factory=lambda: np.empty(0))
    _odd: Floats = field(default_factory=lambda: np.empty(0))

    def add(self, averages: Floats) -> Floats:
        """Take more averages; gives those over twice as many samples."""
        x = np.append(self._rest, averages)
        total = np.empty(max(0, (x.size - 2) // self.hop))
        largest = np.empty_like(total)
        bend_energies(x, self.hop, total, largest)
        self._energies.append(total.astype(np.float32))  # kept for each second of the record
        self._largest.append(largest.astype(np.float32))
        self._rest = x[total.size * self.hop :].copy()
        pairs = np.append(self._odd, averages) if self._odd.size else averages
        whole = pairs.size // 2 * 2
        self._odd = pairs[whole:].copy()
        return np.asarray(0.5 * (pairs[0:whole:2] + pairs[1:whole:2]))

    def loud(self, start: int, stop: int, step: float, limit: float) -> Parts:
        """Windows from sample `start` to `stop` that are louder than the quiet ones among them allow.

        Parameters
        ----------
        start, stop, step
            As in `Stillness.moving`.
        limit : float
            Part of `LOUDER` and `JUMP` that counts.
        """
        half = np.concatenate(self._energies) / self.hop
        begin = -(-start // (self.hop * self.n))
        end = max(begin, (stop // self.n - 2) // self.hop)
        half, largest = half[begin:end], np.concatenate(self._largest)[begin:end]
        energy = 0.5 * (half[:-1] + half[1:])
        if energy.size < FEWEST_WINDOWS:
            return []
        quiet = limit * max(float(np.quantile(energy, _QUIET)), step * step * (0.125 + 0.5 / self.n))
        loud = self._parts(begin + np.flatnonzero(energy > LOUDER * quiet), 2)
        if self.n < _GAUSSIAN:
            return loud
        return loud + self._parts(begin + np.flatnonzero(largest > JUMP * quiet), 1)

    def _parts(self, places: NDArray[np.int64], halves: int) -> Parts:
        hop, n = self.hop, self.n
        return [(i * hop * n, ((i + halves) * hop + 2) * n) for i in places.tolist()]


def _level(n: int, dt: float) -> Level:
    least = LONG_HALF_WINDOW if n < _GAUSSIAN else HALF_WINDOW
    return Level(n, max(least, round(1.0 / (n * dt))))


class Stillness:
    """Watches one channel, block by block.

    Parameters
    ----------
    dt : float
        Sampling time, s.
    """

    def __init__(self, dt: float) -> None:
        self.count = 0
        self._last = np.empty(0)
        octaves = max(2, round(float(np.log2(LONGEST_AVERAGE / dt))))
        self._levels = [_level(n, dt) for n in (1 << k for k in range(octaves + 1))]

    def add(self, samples: Floats) -> None:
        """Take the next samples (n,), all finite."""
        self.count += samples.size
        x = np.append(self._last, samples)
        averages = np.empty(max(0, x.size - 2))
        median_of_three(x, averages)
        self._last = x[averages.size :].copy()
        for level in self._levels:
            averages = level.add(averages)

    def moving(self, start: int, stop: int, step: float, *, limit: float = 1.0) -> Parts:
        """Parts of the samples from `start` to `stop` in which something moved, as (first, end), in no order.

        Parameters
        ----------
        start, stop : int
            What is judged: its own quiet windows are the measure.
        step : float
            Of a converter that is coarser than the noise, which makes calm and lively stretches out of none; else 0.
        limit : float
            Part of `LOUDER` and `JUMP` above which something moved.
        """
        found = Parts()
        for level in self._levels:  # what shorter averages have shown, longer ones only blur
            loud = level.loud(start, stop, step, limit)
            found += [(a, b) for a, b in loud if not any(c < b and a < d for c, d in found)]
        return found


def joined(parts: Parts) -> Parts:
    """Union of intervals, in order."""
    union = Parts()
    for first, end in sorted(parts):
        if union and first <= union[-1][1]:
            union[-1] = (union[-1][0], max(union[-1][1], end))
        else:
            union.append((first, end))
    return union


def longest_gap(parts: Parts, start: float, stop: float) -> tuple[float, float]:
    """Longest interval from `start` to `stop` outside all the parts."""
    return max(between(parts, start, stop), key=lambda gap: gap[1] - gap[0], default=(start, start))


def between(parts: Parts, start: float, stop: float) -> Parts:
    """What is left of the time from `start` to `stop` outside all the parts."""
    edges = [(start, start), *joined(parts), (stop, stop)]
    gaps = [(max(a[1], start), min(b[0], stop)) for a, b in pairwise(edges)]
    return [(first, end) for first, end in gaps if end > first]
