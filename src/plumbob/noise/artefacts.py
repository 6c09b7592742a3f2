"""What no noise does: clipped, held, stuck, interleaved, periodic or spiked samples, steps, and motion.

Whether a channel was at rest all the time: what noise can do and motion does not.

White noise, flicker, random walk and their sums have stationary second differences of averages, at every averaging
time; a ramp has none. So the energy of these differences, summed over windows, is about the same all along the record.
A motion, a step or a bump multiplies it somewhere. The longest averages are a few seconds, for over minutes a warm-up
bends like a slow motion. Single wrong samples are not motion: a running median of three takes them out first.
"""

import math
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.kernels import kernel

Parts = list[tuple[float, float]]  # intervals, first and end

# Of runs of equal values that are alike: of coarse noise, whose runs halve in number with each length, 38 % last for
# two or three samples.
HELD_SHARE: Final = 0.8


def hold_length(values: Floats) -> int:
    """How often each value comes in a row, if nearly all come equally often, give or take one; else 1."""
    starts = np.flatnonzero(np.diff(values) != 0.0)
    if starts.size < 10:
        return 1
    runs = np.diff(starts)
    usual = int(np.median(runs))
    alike = max(np.mean((runs == usual) | (runs == other)) for other in (usual - 1, usual + 1))
    return usual if usual > 1 and alike >= HELD_SHARE else 1


LONGEST: Final = 12  # channels in turn that are looked for: three sensors of three axes, temperature, and two more
# Standard deviation of the means of the channels over that within them; a sinusoid at a whole fraction of the rate,
# such as mains folded down, would have to be that strong to look so.
APART: Final = 1.0

_AS_GOOD: Final = 0.8  # of the best: the smallest number of channels
_FEWEST: Final = 50  # values of each channel


def interleaved(values: Floats) -> int:
    """How many channels seem to take turns in a record (N,); 1 where it is one.

    Means of every k-th value differ from phase to phase by more than the values within a phase scatter. Of numbers that
    separate them as well, such as multiples of the true one, the smallest is taken.
    """
    apart = {1: APART}
    for k in range(2, LONGEST + 1):
        count = values.size // k
        if count < _FEWEST:
            break
        phases = values[: count * k].reshape(count, k)
        within = float(np.sqrt(np.mean(np.var(np.diff(phases, axis=0), axis=0)) / 2.0))  # of neighbours: without drift
        apart[k] = float(np.std(phases.mean(axis=0))) / max(within, 1e-300)
    most = max(apart.values())
    return 1 if most <= APART else next(k for k, ratio in apart.items() if ratio >= _AS_GOOD * most)


# Of the energy of all changes in a single line; of 200 equal lines, the largest five hold a tenth.
PERIODIC_SHARE: Final = 0.9
LINES: Final = 200  # spectra of fewer lines are not judged
_LOBE: Final = 3
_SLOWEST: Final = 10


class Oscillation(NamedTuple):
    """Frequency, Hz, and amplitude, in the unit of the samples."""

    frequency: float
    amplitude: float


def shaking(values: Floats, dt: float) -> Oscillation | None:
    """Oscillation that is nearly all the change between averages of some length of values (N,), every `dt` s.

    Differences of averages whiten a random walk and take out a ramp, so no noise of a sensor has a line there.
    """
    averages, n = values, 1
    while averages.size >= 2 * LINES:
        changes = np.diff(averages)
        centred = changes - changes.mean()
        spectrum = np.abs(np.fft.rfft(centred * np.hanning(changes.size))) ** 2
        peak = int(np.argmax(spectrum))
        inside = float(spectrum[max(0, peak - _LOBE) : peak + _LOBE + 1].sum())
        x, power = peak / changes.size, float(np.mean(centred * centred))
        if power > 0.0 and peak >= _SLOWEST and inside > PERIODIC_SHARE * spectrum.sum():
            averaging = math.sin(math.pi * x) / (n * math.sin(math.pi * x / n))
            difference = 2.0 * math.sin(math.pi * x)
            return Oscillation(x / (n * dt), math.sqrt(2.0 * power) / abs(averaging * difference))
        averages, n = averages[: averages.size // 2 * 2].reshape(-1, 2).mean(axis=1), 2 * n
    return None


FAR: Final = 9.0  # distance of a spike from the median of three, in sd of white noise with the same second differences
_CELL: Final = 256


@kernel
def distances(x: Floats, typical: Floats, largest: Floats, place: Floats) -> None:
    """Distances of samples (n,), of which the outermost are neighbours only, from the median of three, for each cell.

    Filled in: the standard deviation of white noise with the same second differences, the largest distance, and where.
    """
    for i in range(typical.shape[0]):
        cell = x[i * _CELL : i * _CELL + _CELL + 2]
        total, most, where = 0.0, -1.0, 0
        for k in range(_CELL):
            a, b, c = cell[k], cell[k + 1], cell[k + 2]
            off = abs(b - max(min(a, b), min(max(a, b), c)))
            total += (a - 2.0 * b + c) ** 2
            if off > most:
                most, where = off, k + 1
        typical[i] = math.sqrt(total / (6.0 * _CELL))
        largest[i] = most
        place[i] = i * _CELL + where


class Spikes:
    """Watches one channel, block by block; of a cell of 256 samples it keeps the typical distance and the largest."""

    def __init__(self) -> None:
        self._rest = np.empty(0)
        self._typical: list[Floats] = []
        self._largest: list[Floats] = []
        self._place: list[Floats] = []
        self._cells = 0

    def add(self, samples: Floats) -> None:
        """Take the next samples (n,), all finite."""
        x = np.append(self._rest, samples)
        cells = max(0, x.size - 2) // _CELL
        typical, largest, place = np.empty(cells), np.empty(cells), np.empty(cells)
        distances(x, typical, largest, place)
        self._typical.append(typical)
        self._largest.append(largest)
        self._place.append(self._cells * _CELL + place)
        self._cells += cells
        self._rest = x[cells * _CELL :].copy()

    def places(self, least: float) -> list[int]:
        """Indices of spikes farther off than `least`, at most one of a cell."""
        if not self._cells:
            return []
        largest = np.concatenate(self._largest)
        typical = float(np.median(np.concatenate(self._typical)))
        return [int(i) for i in np.concatenate(self._place)[largest > max(FAR * typical, least)]]


REPEATS: Final = 4  # values of a converter occur so often on average; what is not quantised hardly repeats
_ROUNDING: Final = 2e-7  # values that differ by less than this part of the largest are equal: float32 rounds to 1.2e-7
_RESIDUAL: Final = 0.2  # how far a value may lie from its multiple, in steps: a text of few digits rounds


def find_step(values: ArrayLike) -> float:
    """Step of which all values are whole multiples, up to an offset and rounding; 0 where there is none.

    The closest neighbours among the levels give a first guess, which a straight line through all of them makes exact:
    0.06, 0.12, 0.18, 0.24, 0.31 are multiples of 0.061 in a text of two decimals.
    """
    samples = check.column("values", values)
    levels = np.unique(samples[np.isfinite(samples)])
    if levels.size > 1:  # without those that differ from their neighbour by rounding only
        levels = levels[np.append(True, np.diff(levels) > _ROUNDING * np.max(np.abs(levels)))]
    if levels.size < 2 or samples.size < REPEATS * levels.size:
        return 0.0
    rise = np.diff(levels)
    step = float(np.median(rise[rise < 1.5 * rise.min()]))
    for _ in range(2):  # the first line may have counted a wide gap wrongly
        number = np.concatenate(([0.0], np.cumsum(np.round(rise / step))))
        step = float(np.polyfit(number, levels - levels[0], 1)[0])
    residual = levels - levels[0] - step * number
    return step if np.ptp(residual) < 2.0 * _RESIDUAL * step else 0.0


LEAST: Final = 10  # shorter runs are not kept
# With a share p of equal neighbours, N independent samples have N pᴸ runs of L more equal ones; so runs three times as
# long as the longest usual one, ln N / -ln p, come once in N² records.
MARGIN: Final = 3.0
FEWEST_CHANGES: Final = 8  # so many changes without one back are no noise
_RUN, _RISES, _FALLS, _EQUAL, _FOUND = range(5)


@kernel
def follow(x: Floats, state: Floats, ends: Floats, lengths: Floats) -> None:
    """Runs of equal neighbours that end within `x` (n,), whose first sample is the last of the block before.

    `state` (5,) counts the length of the run that goes on, rises, falls, equal neighbours, and runs found here; of each
    run longer than `LEAST`, `ends` has the index after it in x, and `lengths` its samples.
    """
    run, count, rises, equal = state[0], 0, 0, 0
    for i in range(1, x.shape[0]):
        rises += x[i] > x[i - 1]  # a sum, as of noise no branch is foreseen
        if x[i] == x[i - 1]:
            run += 1.0
            equal += 1
            continue
        if run > LEAST:
            ends[count], lengths[count] = i, run
            count += 1
        run = 1.0
    state[0] = run
    state[1] += rises
    state[2] += x.shape[0] - 1 - rises - equal
    state[3] += equal
    state[4] = count


class ChannelWatch:
    """Watches one channel, block by block."""

    def __init__(self) -> None:
        self.count = 0
        self._last = np.empty(0)
        self._state = np.array([1.0, 0.0, 0.0, 0.0, 0.0])
        self._ends: list[Floats] = []
        self._lengths: list[Floats] = []

    def add(self, samples: Floats) -> None:
        """Take the next samples (n,), all finite."""
        if not samples.size:
            return
        x = np.append(self._last, samples)
        ends = np.empty(x.size // LEAST + 1)
        lengths = np.empty_like(ends)
        follow(x, self._state, ends, lengths)
        count = int(self._state[_FOUND])
        self._ends.append(self.count - self._last.size + ends[:count])
        self._lengths.append(lengths[:count].copy())
        self.count += samples.size
        self._last = x[-1:].copy()

    @property
    def one_way(self) -> str | None:
        """How the values change, if they only do so in one way: "rises" or "falls"."""
        rises, falls = self._state[_RISES], self._state[_FALLS]
        if min(rises, falls) > 0.0 or max(rises, falls) < FEWEST_CHANGES:
            return None
        return "rises" if rises else "falls"

    def stuck(self) -> Parts:
        """Runs longer than those of noise with as many equal neighbours, as (first, end)."""
        equal = float(self._state[_EQUAL]) / max(1, self.count - 1)
        most = LEAST + (MARGIN * math.log(self.count) / -math.log(equal) if 0.0 < equal < 1.0 else 0.0)
        ends = np.append(np.concatenate([np.empty(0), *self._ends]), self.count).astype(int)
        lengths = np.append(np.concatenate([np.empty(0), *self._lengths]), self._state[_RUN]).astype(int)
        return [(int(end - length), int(end)) for end, length in zip(ends, lengths, strict=True) if length > most]


# Energy of a window over that of quiet ones; of noise, the extremes of a million windows stay below 10 (χ² of 8 degrees
# of freedom against its quantile of 20 %).
LOUDER: Final = 16.0

JUMP: Final = 100.0  # the same for one squared second difference: ten sd, seven where the quiet ones seem too quiet
LONGEST_AVERAGE: Final = 5.0  # s, to the next octave; over 10 s, a warm-up of 20 sd in 60 s moves at 1 kHz
HALF_WINDOW: Final = 8  # second differences in half a window, at least; they last a second at least
LONG_HALF_WINDOW: Final = 32  # the same for averages that are not Gaussian
FEWEST_WINDOWS: Final = 6
_QUIET: Final = 0.2
_GAUSSIAN: Final = 4  # samples of a Gaussian average: the running median takes the middle out of noise, not its tails


@kernel
def median_of_three(x: Floats, out: Floats) -> None:
    """Running median: out[i] is the one of x[i], x[i + 1], x[i + 2]."""
    for i in range(out.shape[0]):
        a, b, c = x[i], x[i + 1], x[i + 2]
        out[i] = max(min(a, b), min(max(a, b), c))


@kernel
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
    _rest: Floats = field(default_factory=partial(np.empty, 0))
    _odd: Floats = field(default_factory=partial(np.empty, 0))

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
        stop = pairs.size // 2 * 2
        self._odd = pairs[stop:].copy()
        return np.asarray(0.5 * (pairs[0:stop:2] + pairs[1:stop:2]))

    def loud(self, start: int, stop: int, step: float, limit: float) -> Parts:
        """Windows from sample `start` to `stop` that are louder than the quiet ones among them allow.

        `limit` is the part of `LOUDER` and `JUMP` that counts; the others as in `Stillness.moving`.
        """
        half = np.concatenate(self._energies) / self.hop
        begin = -(-start // (self.hop * self.n))
        end = max(begin, (stop // self.n - 2) // self.hop)
        half, largest = half[begin:end], np.concatenate(self._largest)[begin:end]
        energy = 0.5 * (half[:-1] + half[1:])
        if energy.size < FEWEST_WINDOWS:
            return []
        quiet = limit * max(float(np.quantile(energy, _QUIET)), step * step * (0.125 + 0.5 / self.n))
        hop, n = self.hop, self.n
        places = [(i, 2) for i in (begin + np.flatnonzero(energy > LOUDER * quiet)).tolist()]  # and how many halves
        if n >= _GAUSSIAN:
            places += [(i, 1) for i in (begin + np.flatnonzero(largest > JUMP * quiet)).tolist()]
        return [(i * hop * n, ((i + halves) * hop + 2) * n) for i, halves in places]


class Stillness:
    """Watches one channel, block by block."""

    def __init__(self, dt: float) -> None:
        self.count = 0
        self._last = np.empty(0)
        octaves = max(2, round(float(np.log2(LONGEST_AVERAGE / dt))))
        self._levels = [
            Level(n, max(LONG_HALF_WINDOW if n < _GAUSSIAN else HALF_WINDOW, round(1.0 / (n * dt))))
            for n in (1 << k for k in range(octaves + 1))
        ]

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

        Its own quiet windows are the measure. `step` is that of a converter that is coarser than the noise, which makes
        calm and lively stretches out of none, else 0; `limit` the part of `LOUDER` and `JUMP` above which something
        moved.
        """
        parts = Parts()
        for level in self._levels:  # what shorter averages have shown, longer ones only blur
            loud = level.loud(start, stop, step, limit)
            parts += [(a, b) for a, b in loud if not any(c < b and a < d for c, d in parts)]
        return parts


def joined(parts: Parts) -> Parts:
    """Union of intervals, in order."""
    union = Parts()
    for first, end in sorted(parts):
        if union and first <= union[-1][1]:
            union[-1] = (union[-1][0], max(union[-1][1], end))
        else:
            union.append((first, end))
    return union


def between(parts: Parts, start: float, stop: float) -> Parts:
    """What is left of the time from `start` to `stop` outside all the parts."""
    edges = [(start, start), *joined(parts), (stop, stop)]
    gaps = [(max(a[1], start), min(b[0], stop)) for a, b in pairwise(edges)]
    return [(first, end) for first, end in gaps if end > first]


def window_sums(rows: Floats, size: int) -> Floats:
    """Sums of each `size` neighbouring rows of (n,) or (n, k)."""
    total = np.concatenate((np.zeros_like(rows[:1]), np.cumsum(rows, axis=0)))
    return np.asarray(total[size:] - total[:-size])
