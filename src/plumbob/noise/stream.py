"""The overlapping Allan deviation of records that do not fit into memory, or have not ended yet.

The running sum θ runs through a chain of levels. Each holds the latest points of it, of which the next level gets every
second: level i has steps of 2^i samples. Averages of fewer than 2¹⁴ samples are taken at the first level, where every
difference is found; longer ones at the level at which they span 2¹³ to 2¹⁴ points, where differences begin every 2^i
samples only. What this leaves out are differences that nearly repeat their neighbours: σ moves by 1e-4 to 3e-4 of its
own standard deviation for white noise (rms of 25 records of 10⁶), and by less for flicker and random walk.

The work is cut at fixed places of the record, so the result does not depend on how the samples were cut into blocks.
"""

import copy
import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.noise.factors import Factors, stream_factors, stream_steps, unusable
from plumbob.noise.kernels import accumulate, moments, second_squares_of_tile

_TILE: Final = 2**14  # samples that are worked on together; even, so that a level's tiles begin at points of the next


@dataclass(frozen=True, eq=False)
class StreamResult:
    """What a stream has found of each of its k channels."""

    count: int  # samples of each channel
    n: Factors  # (m,), averaging factors, increasing: those that fit twice into the record
    dev: Floats  # (m, k), overlapping Allan deviation, in the unit of the samples
    # mean, sd, low, high: (k,), mean, standard deviation (over N − 1), smallest and largest sample
    mean: Floats
    sd: Floats
    low: Floats
    high: Floats


class AllanStream:
    """Overlapping Allan deviation in one pass, from blocks of any size.

    Each channel takes less than 0.7 MB for each doubling of the longest average beyond 2¹⁴.

    Parameters
    ----------
    n : array_like (m,)
        Averaging factors, rounded as `stream_factors` says. They may be longer than the record turns out to be.
    channels : int
        Columns k of the blocks.

    Raises
    ------
    ParameterError
        If a factor is not a whole number, or `channels` is below 1.
    """

    def __init__(self, n: ArrayLike, *, channels: int) -> None:
        factors = stream_factors(n)
        if channels < 1:
            raise ParameterError(f"channels = {channels}, but a stream needs one or more.")
        self._n = factors
        self._tile = np.empty((channels, _TILE))
        self._waiting = 0  # samples in the tile
        self._done = 0  # samples before the tile
        self._channels = [_Channel(factors) for _ in range(channels)]

    @property
    def count(self) -> int:
        """Samples of each channel that have come so far."""
        return self._done + self._waiting

    def feed(self, block: ArrayLike) -> None:
        """Take the next samples.

        Parameters
        ----------
        block : array_like (rows, k), or (rows,) of a single channel
            Of any real type and of any length; a memory map is read piece by piece.

        Raises
        ------
        ShapeError
            If the block has another shape, or a sample is not finite; samples before it may have been taken.
        """
        rows = np.asanyarray(block)
        if rows.ndim == 1 and len(self._channels) == 1:
            rows = rows[:, np.newaxis]
        if rows.ndim != 2 or rows.shape[1] != len(self._channels):
            raise ShapeError(f"block must have shape (rows, {len(self._channels)}), but its shape is {rows.shape}.")
        taken = 0
        while taken < rows.shape[0]:
            taken += self._take(rows[taken : taken + _TILE - self._waiting])

    def result(self) -> StreamResult:
        """What the samples so far give; more may follow.

        Raises
        ------
        ShapeError
            If less than two samples came.
        """
        if self.count < 2:
            raise ShapeError(f"an Allan deviation needs at least 2 samples, but got {self.count}.")
        n = self._n[2 * self._n <= self.count]
        waiting = self._tile[:, : self._waiting]
        per_channel = [
            copy.deepcopy(channel).end(samples, n, self.count)
            for channel, samples in zip(self._channels, waiting, strict=True)
        ]
        dev, *moments_of = (np.stack(column, axis=-1) for column in zip(*per_channel, strict=True))
        return StreamResult(self.count, n, dev, *moments_of)

    def _take(self, rows: NDArray[Any]) -> int:
        piece = check.floats("block", rows)
        with np.errstate(all="ignore"):
            usable = np.isfinite(np.sum(piece))  # one sample that is not finite is enough for the sum
        if not usable:
            raise unusable(piece, self.count)
        stop = self._waiting + piece.shape[0]
        self._tile[:, self._waiting : stop] = piece.T
        self._waiting = stop
        if stop == _TILE:
            for channel, samples in zip(self._channels, self._tile, strict=True):
                channel.take(samples)
            self._done += _TILE
            self._waiting = 0
        return len(piece)


class _Channel:
    """One channel: moments, θ, and its levels."""

    def __init__(self, n: Factors) -> None:
        self._origin = math.nan  # near the mean: taken off before every sum
        self._total = self._squares = 0.0
        self._low, self._high = math.inf, -math.inf
        self._angle = 0.0  # θ, which begins with 0
        steps = stream_steps(n)
        self._levels = [_AveragingTime(2**i, n[steps == 2**i]) for i in range(int(steps.max()).bit_length())]

    def take(self, samples: Floats) -> None:
        """Take the samples (T,) of one tile."""
        if math.isnan(self._origin):
            self._origin = float(np.mean(samples))
            self._levels[0].append(np.zeros(1))
        total, squares = moments(samples, self._origin)
        self._total += total
        self._squares += squares
        self._low, self._high = min(self._low, float(samples.min())), max(self._high, float(samples.max()))
        points = np.empty(samples.size)
        self._angle = accumulate(samples, self._origin, self._angle, points)
        for level in self._levels:
            level.append(points)
            if level.waiting < _TILE:
                break
            points = level.advance(_TILE)

    def end(self, samples: Floats, n: Factors, count: int) -> tuple[Floats, float, float, float, float]:
        """Take the last samples; return the deviation at each n of those that fit, mean, sd, lowest and highest."""
        if samples.size:
            self.take(samples)
        points = np.empty(0)
        for level in self._levels:
            points = level.end(points)
        steps = stream_steps(n)
        sums = np.concatenate([level.sums for level in self._levels])[: n.size]
        terms = count // steps - 2 * (n // steps) + 1
        deviation = np.sqrt(sums / (2.0 * terms)) / n
        away = self._total / count
        sd = math.sqrt(max(0.0, self._squares - self._total * away) / (count - 1))
        return deviation, self._origin + away, sd, self._low, self._high


class _AveragingTime:
    """The latest points of θ that are `step` samples apart, and the squares of the differences that begin at them."""

    def __init__(self, step: int, n: Factors) -> None:
        self._n = n // step
        self._reach = 2 * int(self._n.max(initial=0))
        self._points = np.empty(self._reach + 3 * _TILE)
        self._begin = self._end = 0  # points whose differences are not taken yet
        self.sums = np.zeros(n.size)

    @property
    def waiting(self) -> int:
        """Points whose differences can all be taken, but are not yet."""
        return self._end - self._begin - self._reach

    def append(self, points: Floats) -> None:
        """Take the next points."""
        if self._end + points.size > self._points.size:
            pending = self._points[self._begin : self._end].copy()
            self._points[: pending.size] = pending
            self._begin, self._end = 0, pending.size
        self._points[self._end : self._end + points.size] = points
        self._end += points.size

    def advance(self, count: int) -> Floats:
        """Take the differences that begin at the next `count` points, and return every second of these points."""
        start, self._begin = self._begin, self._begin + count
        second_squares_of_tile(self._points[: self._end], self._n, start, self._begin, self.sums)
        return self._points[start : self._begin : 2]

    def end(self, points: Floats) -> Floats:
        """Take all differences that are left, the last points being these; return every second of them all."""
        remaining = np.concatenate((self._points[self._begin : self._end], points))
        second_squares_of_tile(remaining, self._n, 0, remaining.size, self.sums)
        return remaining[::2]
