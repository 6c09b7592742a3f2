"""Deviations of rates over averaging time: Allan, modified Allan, Hadamard and total [Riley2008].

The running sum θ of N rates has N + 1 points. Every kind is a mean square of differences d of order 2 or 3, taken at
spacing n of points x that are θ or made of it::

    σ²(n) = Σ d² / (a n² terms)      d = x[k + 2n] − 2 x[k + n] + x[k]  or
                                     d = x[k + 3n] − 3 x[k + 2n] + 3 x[k + n] − x[k]

======  ===============================  ===================================  =====  =  ============
kind    name                             points x                             order  a  n at most
======  ===============================  ===================================  =====  =  ============
oadev   overlapping Allan                θ                                    2      2  N / 2
adev    Allan                            every n-th of θ                      2      2  N / 2
mdev    modified Allan, overlapping      running sum of θ, over n             3      2  (N + 1) / 3
ohdev   overlapping Hadamard             θ                                    3      6  N / 3
hdev    Hadamard                         every n-th of θ                      3      6  N / 3
totdev  total, without bias correction   θ and its reflections in both ends   2      2  N
======  ===============================  ===================================  =====  =  ============

So σ has the unit of the rates and needs no sampling time; its averaging time is τ = n Δt. The mean rate is removed
before the sum: it cancels in every difference, but would take its digits.

Rounding costs σ of 1e5 samples some 1e-14 for white noise, 1e-12 for a random walk and 1e-10 for a drift of a hundred
times the noise; mdev of a walk 1e-11 at n < 10.
"""

import math
from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ShapeError
from plumbob.noise.factors import KINDS, Factors, factors_of
from plumbob.noise.kernels import accumulate, modified_squares, second_squares, third_squares

KEPT: Final = 1 << 19
"""So many averages are kept; at twice as many, neighbours are averaged."""


class Averager:
    """Keeps means of 1, 2, 4, … consecutive samples, as many as it takes for all of them to fit.

    Parameters
    ----------
    channels : int
        Columns of the blocks.
    kept : int
        How many means are kept at most; an even number.
    """

    def __init__(self, channels: int, kept: int = KEPT) -> None:
        self.averaged = 1
        self._means = np.empty((kept, channels))
        self._filled = 0
        self._rest = np.empty((0, channels))

    def feed(self, block: Floats) -> None:
        """Add the next samples (rows, channels)."""
        block = np.concatenate((self._rest, block))
        while True:
            room = self._means.shape[0] - self._filled
            whole = min(block.shape[0] // self.averaged, room)
            used = whole * self.averaged
            means = block[:used].reshape(whole, self.averaged, block.shape[1]).mean(axis=1)
            self._means[self._filled : self._filled + whole] = means
            self._filled += whole
            block = block[used:]
            if block.shape[0] < self.averaged:
                break
            self._halve()
        self._rest = block.copy()

    def _halve(self) -> None:
        pairs = self._means.reshape(-1, 2, self._means.shape[1]).mean(axis=1)
        self._filled = pairs.shape[0]
        self._means[: self._filled] = pairs
        self.averaged *= 2

    def values(self) -> Floats:
        """Means so far (m, channels); samples at the end that fill no mean are left out."""
        return self._means[: self._filled]


def deviation(rate: ArrayLike, n: ArrayLike, kind: str = "oadev") -> Floats:
    """Deviation at some averaging factors.

    Parameters
    ----------
    rate : array_like (N,) or (N, k)
        Evenly spaced samples, without any missing; each column is a channel of its own.
    n : array_like (m,)
        How many samples are averaged: whole numbers from 1 to what the kind allows (see the module), in any order.
    kind : str
        One of `plumbob.noise.KINDS`.

    Returns
    -------
    ndarray (m,) or (m, k)
        In the unit of the rates.

    Raises
    ------
    ShapeError
        If a sample is not finite, or the kind is unknown.
    ParameterError
        If a factor is not a whole number, or the record is too short for it.
    """
    samples = check.floats("rate", rate)
    check.one_of("kind", kind, KINDS)
    how = _HOW[kind]
    angles = running_sums(samples)
    factors = factors_of(kind, samples.shape[0], n)
    increasing, places = np.unique(factors, return_inverse=True)
    found = np.array([np.sqrt(_variance(angle, increasing, how)) for angle in angles]).T
    return np.ascontiguousarray(found[places].reshape(factors.size, *samples.shape[1:]))


def running_sums(rate: Floats) -> Iterator[Floats]:
    """For each channel of the rates (N,) or (N, k), its θ (N + 1,): the running sum about the mean, from 0.

    Raises
    ------
    ShapeError
        If a sample is not finite.
    """
    if rate.ndim not in {1, 2} or rate.size == 0:
        raise ShapeError(f"rate must have shape (N,) or (N, k) and hold samples, but its shape is {rate.shape}.")
    return (_running_sum(rate, column) for column in rate.reshape(rate.shape[0], -1).T)


def _running_sum(rate: Floats, column: Floats) -> Floats:
    column = np.ascontiguousarray(column)
    with np.errstate(all="ignore"):
        mean = float(np.mean(column))
    if not math.isfinite(mean):  # as one sample is enough for; a test of every sample would be one more pass
        raise _unusable(rate)
    angle = np.zeros(column.size + 1)
    accumulate(column, mean, 0.0, angle[1:])
    return angle


def _unusable(rate: Floats) -> ShapeError:
    bad = np.argwhere(~np.isfinite(rate))
    if not bad.size:
        return ShapeError(f"rate holds numbers too large to be added, up to {np.max(np.abs(rate)):g}.")
    return ShapeError(
        f"rate[{', '.join(map(str, bad[0]))}] is not finite ({len(bad)} such values), but a deviation needs every "
        "sample: take a stretch without gaps."
    )


def _itself(angle: Floats) -> Floats:
    return angle


def _mirrored(angle: Floats) -> Floats:
    """θ, continued beyond each end by its reflection in the end point: 3N − 1 points."""
    inner = angle[-2:0:-1]
    return np.concatenate((2.0 * angle[0] - inner, angle, 2.0 * angle[-1] - inner))  # [Riley2008] (25)


def _whole(points: Floats, n: int) -> tuple[Floats, int]:
    return points, n


def _every_nth(points: Floats, n: int) -> tuple[Floats, int]:
    return np.ascontiguousarray(points[::n]), 1


def _centred(points: Floats, n: int) -> tuple[Floats, int]:
    """Those mirrored points whose differences have their middle on θ, its ends left out."""
    count = (points.size + 1) // 3
    return points[count - n : 2 * count - 1 + n], n


class _How(NamedTuple):
    prepare: Callable[[Floats], Floats]
    view: Callable[[Floats, int], tuple[Floats, int]]  # points and spacing at n
    add_squares: Callable[[Floats, Factors, Floats], None]
    reach: Callable[[int], int]  # how far the last point of a difference lies behind its first, by its spacing
    scale: float


_HOW: Final = {
    "oadev": _How(_itself, _whole, second_squares, lambda n: 2 * n, 2.0),  # [Riley2008] (11)
    "adev": _How(_itself, _every_nth, second_squares, lambda n: 2 * n, 2.0),  # [Riley2008] (7)
    "mdev": _How(_itself, _whole, modified_squares, lambda n: 3 * n - 1, 2.0),  # [Riley2008] (14)
    "ohdev": _How(_itself, _whole, third_squares, lambda n: 3 * n, 6.0),  # [Riley2008] (20)
    "hdev": _How(_itself, _every_nth, third_squares, lambda n: 3 * n, 6.0),  # [Riley2008] (18)
    "totdev": _How(_mirrored, _centred, second_squares, lambda n: 2 * n, 2.0),  # [Riley2008] (25)
}


def _variance(angle: Floats, factors: Factors, how: _How) -> Floats:
    points = how.prepare(angle)
    sums, terms = np.zeros(factors.size), np.empty(factors.size)
    if how.view is _whole:
        how.add_squares(points, factors, sums)  # together, which is several times as fast
    for j, n in enumerate(factors.tolist()):
        seen, spacing = how.view(points, n)
        terms[j] = seen.size - how.reach(spacing)
        if how.view is not _whole:
            how.add_squares(seen, np.array([spacing]), sums[j : j + 1])
    return np.asarray(sums / (how.scale * factors.astype(np.float64) ** 2 * terms))
