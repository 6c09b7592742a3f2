"""A stream of samples cut in blocks of a quarter of a second, the same ones however the stream came in parts."""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.static_periods import BLOCK, FEWEST, Moments, at_rest
from plumbob.core.check import Floats, runs
from plumbob.data import TRIAD_FLAGS, TRIADS, ImuData

_COLUMNS: Final = 1 + 3 * len(TRIADS) + len(TRIADS)


class Block(NamedTuple):
    """Samples of a block.

    Attributes
    ----------
    t : ndarray (N,)
        Time, s.
    triads : mapping of str to ndarray (N, 3)
        Every triad; NaN where a sample is absent or invalid.
    clipped : mapping of str to ndarray (N,) of bool
        Samples at the end of the triad's range.
    """

    t: Floats
    triads: dict[str, Floats]
    clipped: dict[str, NDArray[np.bool_]]


class Blocks:
    """Cuts parts of a recording in blocks: each ends with the first sample that is `BLOCK` later than its first."""

    def __init__(self) -> None:
        self._pending = np.empty((0, _COLUMNS))

    def feed(self, part: ImuData) -> Iterator[Block]:
        """Take a part, and yield the blocks that it completes; what is left waits for the next."""
        rows = np.concatenate((self._pending, _rows(part)))
        first = 0
        while first < len(rows):
            stop = max(int(np.searchsorted(rows[:, 0], rows[first, 0] + BLOCK)), first + FEWEST)
            if stop >= len(rows):
                break
            yield _block(rows[first:stop])
            first = stop
        self._pending = rows[first:]


class Rest:
    """Say for every block of a stream whether the unit was at rest in it, by the rule of `still`.

    A mean or scatter over a NaN is NaN, and such a block is not at rest.

    All blocks are judged again with each, since quiet is relative to the rest; an hour of them takes 1.6 MB.
    """

    def __init__(self) -> None:
        self._told = np.empty((64, 14))
        self._count = 0
        self._runs: list[tuple[int, int]] = []
        self._has = {"acc": False, "gyr": False}

    def add(self, block: Block) -> None:
        """Take the next block."""
        if self._count == len(self._told):
            self._told = np.concatenate((self._told, np.empty_like(self._told)))
        acc, gyr = block.triads["acc"], block.triads["gyr"]
        for name in self._has:
            self._has[name] |= bool(np.isfinite(block.triads[name]).any())
        moments = (acc.mean(axis=0), acc.std(axis=0, ddof=1), gyr.mean(axis=0), gyr.std(axis=0, ddof=1))
        stop = block.t[-1] + (block.t[-1] - block.t[0]) / (len(block.t) - 1)
        self._told[self._count] = np.concatenate((*moments, (block.t[0], stop)))
        self._count += 1
        self._size = len(block.t)
        self._judge()

    @property
    def stretches(self) -> list[tuple[int, int]]:
        """First and stop of each run of blocks at rest."""
        return self._runs

    @property
    def lasting(self) -> float:
        """How long the unit has been at rest until now, s; 0 where it is not."""
        if not self._runs or self._runs[-1][1] != self._count:
            return 0.0
        return self.time_of(self._runs[-1])

    def time_of(self, stretch: tuple[int, int]) -> float:
        """Length of a run of blocks, s."""
        first, stop = stretch
        return float(self._told[stop - 1, 13] - self._told[first, 12])

    def mean_force(self, stretch: tuple[int, int]) -> Floats:
        """Mean specific force (3,) of a run of blocks, m/s²."""
        return np.asarray(self._told[slice(*stretch), :3].mean(axis=0))

    def _judge(self) -> None:
        told = self._told[: self._count]
        acc, gyr = Moments(told[:, :3], told[:, 3:6]), Moments(told[:, 6:9], told[:, 9:12])
        if not any(self._has.values()):
            return
        if not self._has["acc"]:  # which says nothing against rest
            acc = Moments(*np.zeros((2, self._count, 3)))
        self._runs = runs(at_rest(acc, gyr if self._has["gyr"] else None, self._size))


def _rows(part: ImuData) -> Floats:
    clipped = [(part.flags & np.uint32(TRIAD_FLAGS[name][1])) != 0 for name in TRIADS]
    return np.column_stack((part.t, *(part.usable(name) for name in TRIADS), *clipped))


def _block(rows: Floats) -> Block:
    return Block(
        rows[:, 0],
        {name: rows[:, 1 + 3 * i : 4 + 3 * i] for i, name in enumerate(TRIADS)},
        {name: rows[:, 10 + i] > 0.0 for i, name in enumerate(TRIADS)},
    )
