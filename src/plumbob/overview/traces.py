"""Values over time for a plot: every sample of a short recording, smallest and largest values of a long one."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats

WHOLE: Final = 400_000
"""Up to so many samples every one is kept: an hour at 100 Hz has 360 000."""
BUCKETS: Final = 20_000
"""Of a longer recording, about so many stretches are kept, each with its smallest and largest value."""
HOLES: Final = 4_000
"""At most so many breaks of the line are kept in a long recording; shorter ones are in the counts alone."""

Singles = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Traces:
    """Channels over time.

    Attributes
    ----------
    t : ndarray (M,)
        Times, s; in a long recording two for each stretch.
    values : ndarray (M, C) of float32
        By channel, SI; a row of NaN where the line breaks.
    names : tuple of str
        Of the channels.
    each : int
        How many samples a pair of rows stands for; 1 where every row is a sample.
    """

    t: Floats
    values: Singles
    names: tuple[str, ...]
    each: int

    def channel(self, name: str) -> Floats:
        """One channel (M,)."""
        return self.values[:, self.names.index(name)].astype(np.float64)


NOTHING: Final = Traces(np.empty(0), np.empty((0, 0), dtype=np.float32), (), 1)
"""Of no samples."""


class Tracing:
    """Gathers traces of samples as they come.

    Parameters
    ----------
    names : tuple of str
        Channels.
    total : int
        Samples that will come.
    most : int
        Samples up to which every one is kept.
    circular : tuple of str
        Channels that are angles, rad, whose smallest and largest value are meant about the first.
    """

    def __init__(
        self, names: tuple[str, ...], total: int, *, most: int = WHOLE, circular: tuple[str, ...] = ()
    ) -> None:
        self._names = names
        self._each = 1 if total <= most else -(-total // max(1, min(BUCKETS, most // 2)))
        self._circular = [names.index(name) for name in circular if name in names]
        self._t: list[Floats] = []
        self._values: list[Singles] = []
        self._holes = 0
        self._odd = False
        self._left_t, self._left = np.empty(0), np.empty((0, len(names)))

    def add(self, t: Floats, values: Floats, broken: NDArray[np.bool_]) -> None:
        """Take samples (n,) and (n, C); `broken` (n,) marks those before which the line breaks."""
        if self._each == 1:
            self._add_all(t, values, broken)
            return
        begins = np.concatenate((np.zeros(self._left_t.size, dtype=bool), broken))
        t, values = np.concatenate((self._left_t, t)), np.concatenate((self._left, values))
        edges = [0, *np.flatnonzero(begins).tolist(), t.size]
        for start, stop in pairwise(edges):
            if start and stop > start:
                self._break(t[start - 1], t[start])
            last = stop == t.size
            full = start + (stop - start) // self._each * self._each if last else stop
            if full > start:
                self._add_extremes(t[start:full], values[start:full])
            if last:
                self._left_t, self._left = t[full:].copy(), values[full:].copy()

    def done(self) -> Traces:
        """All of them."""
        if self._left_t.size:
            self._add_extremes(self._left_t, self._left)
            self._left_t, self._left = self._left_t[:0], self._left[:0]
        return Traces(np.concatenate(self._t), np.concatenate(self._values), self._names, self._each)

    def _add_all(self, t: Floats, values: Floats, broken: NDArray[np.bool_]) -> None:
        places = np.flatnonzero(broken)
        before = np.concatenate(([self._t[-1][-1] if self._t else t[0]], t[:-1]))
        self._t.append(np.insert(t, places, 0.5 * (before[places] + t[places])))
        self._values.append(np.insert(values, places, np.nan, axis=0).astype(np.float32))

    def _break(self, before: float, after: float) -> None:
        self._holes += 1
        if self._holes <= HOLES:
            self._t.append(np.array([0.5 * (before + after)]))
            self._values.append(np.full((1, len(self._names)), np.nan, dtype=np.float32))

    def _add_extremes(self, t: Floats, values: Floats) -> None:
        starts = np.arange(0, t.size, self._each)
        sizes = np.diff(np.append(starts, t.size))
        zero = np.zeros((starts.size, len(self._names)))
        for c in self._circular:  # about the first one that is known
            column = values[:, c]
            zero[:, c] = np.nan_to_num(column[starts])
        off = values - np.repeat(zero, sizes, axis=0)
        for c in self._circular:
            off[:, c] = (off[:, c] + np.pi) % (2.0 * np.pi) - np.pi
        low = np.fmin.reduceat(off, starts, axis=0) + zero
        high = np.fmax.reduceat(off, starts, axis=0) + zero
        pairs = np.stack((low, high), axis=1)
        odd = (np.arange(starts.size) + self._odd) % 2 == 1
        pairs[odd] = pairs[odd, ::-1]  # so that a line goes up in one stretch and down in the next
        self._odd = bool((starts.size + self._odd) % 2)
        last = np.append(starts[1:], t.size) - 1
        self._t.append(np.stack((t[starts], 0.5 * (t[starts] + t[last])), axis=1).ravel())
        self._values.append(pairs.reshape(-1, len(self._names)).astype(np.float32))
