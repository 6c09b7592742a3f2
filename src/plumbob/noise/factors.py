"""Averaging factors: how many samples are averaged, and which numbers of them a record allows.

Deviations of rates over averaging time: Allan, modified Allan, Hadamard and total [Riley2008].

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
from numpy.typing import ArrayLike, NDArray

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.noise.kernels import accumulate, modified_squares, second_squares, third_squares

Factors = NDArray[np.int64]
STREAMED: Final = 2**14
"""A stream takes every difference where fewer samples are averaged."""


def whole_factors(n: ArrayLike, longest: int, why: str) -> Factors:
    """Averaging factors n (m,) of the user; ParameterError where one is not a whole number from 1 to `longest`.

    `why` says what allows no more, for the message: ``"of 9 samples"``.
    """
    factors = check.column("n", n)
    if not factors.size:
        raise ParameterError("n must hold at least one averaging factor, but it is empty.")
    fit = (factors >= 1.0) & (factors <= longest) & (factors == np.floor(factors))
    if not fit.all():
        i = int(np.argmin(fit))
        raise ParameterError(f"n[{i}] = {factors[i]:g}, but {why} whole numbers from 1 to {longest} can be averaged.")
    return factors.astype(np.int64)


def log_factors(count: int, *, per_decade: int = 16) -> Factors:
    """Averaging factors that lie evenly on a logarithmic axis, from 1 to half the record.

    They are 10^(i / per_decade) rounded to whole numbers, each once, whatever the length of the record: so curves of
    different records share their averaging times.

    Parameters
    ----------
    count : int
        Samples N of the record.
    per_decade : int
        How many, where whole numbers lie close enough.

    Returns
    -------
    ndarray (m,) of int64
        Increasing, at most N / 2.

    Raises
    ------
    ParameterError
        If the record has less than two samples, or no factor is asked for.
    """
    if count < 2 or per_decade < 1:
        raise ParameterError(
            f"count = {count}, per_decade = {per_decade}, but an Allan deviation needs two samples or more, and a "
            "grid one factor per decade or more."
        )
    steps = np.arange(np.floor(per_decade * np.log10(count)) + 1.0)
    factors = np.unique(np.round(10.0 ** (steps / per_decade))).astype(np.int64)
    return factors[factors <= count // 2]


def stream_steps(n: Factors) -> Factors:
    """Every how many samples a stream takes a difference: the power of two that leaves n/step from 2¹³ to 2¹⁴."""
    return np.asarray(2 ** np.maximum(0, np.frexp(n / STREAMED)[1]), dtype=np.int64)


def stream_factors(n: ArrayLike) -> Factors:
    """Averaging factors that a stream can take: each rounded to a multiple of its step, by 1/16384 of it at most.

    Parameters
    ----------
    n : array_like (m,)
        Whole numbers from 1, as of `log_factors`.

    Returns
    -------
    ndarray (m,) of int64
        Increasing, each once.

    Raises
    ------
    ParameterError
        If a factor is not a whole number.
    """
    factors = whole_factors(n, 2**48, "for a stream")
    steps = stream_steps(factors)
    return np.unique(np.round(factors / steps).astype(np.int64) * steps)


class DeviationKind(NamedTuple):
    """How a deviation is made of the cumulative sum."""

    order: int  # of the differences: 2 for Allan's, 3 for Hadamard's
    averaged: bool  # whether the sum is averaged over n points first, as the modified deviation does
    overlapping: bool  # whether every difference is used, or every n-th

    @property
    def levels(self) -> tuple[int, ...]:
        """Exponents α of the noises for which the deviation is finite, and which it separates, increasing.

        Without the average, flicker of the angle (1) is as steep as its quantization (2), which is what sensors have.
        """
        return (*range(2 - 2 * self.order, 1), *((1, 2) if self.averaged else (2,)))

    def longest(self, count: int) -> int:
        """Longest averaging factor that `count` samples allow."""
        return (count + self.averaged) // (self.order + self.averaged)

    def terms(self, count: int, n: int) -> int:
        """How many differences `count` samples give at the factor n."""
        room = count + 1 - self.order * n - (n - 1 if self.averaged else 0)
        return room if self.overlapping else (room - 1) // n + 1


SHAPES: Final[dict[str, DeviationKind]] = {
    "oadev": DeviationKind(2, averaged=False, overlapping=True),
    "adev": DeviationKind(2, averaged=False, overlapping=False),
    "mdev": DeviationKind(2, averaged=True, overlapping=True),
    "ohdev": DeviationKind(3, averaged=False, overlapping=True),
    "hdev": DeviationKind(3, averaged=False, overlapping=False),
    "totdev": DeviationKind(2, averaged=False, overlapping=True),
}
"""By name of the deviation. The total deviation extends the record, and is Allan's overlapping one inside it."""

KINDS: Final = tuple(SHAPES)
"""Overlapping Allan, Allan, modified Allan (overlapping), overlapping Hadamard, Hadamard, total."""


def kind_named(name: str) -> DeviationKind:
    """Kind of that name, refusing unknown ones by a `ShapeError`."""
    return SHAPES[check.one_of("kind", name, KINDS)]


def checked_factors(kind: str, count: int, n: ArrayLike) -> Factors:
    """Averaging factors n as integers.

    ShapeError if the kind is unknown, ParameterError if one is not a whole number, or too long for `count` samples.
    """
    return whole_factors(n, kind_named(kind).longest(count), f"for {kind} of {count} samples")


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
            count = min(block.shape[0] // self.averaged, room)
            used = count * self.averaged
            means = block[:used].reshape(count, self.averaged, block.shape[1]).mean(axis=1)
            self._means[self._filled : self._filled + count] = means
            self._filled += count
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
    angles = running_sums(samples)
    factors = checked_factors(kind, samples.shape[0], n)
    increasing, places = np.unique(factors, return_inverse=True)
    deviations = np.array([np.sqrt(_variance(angle, increasing, kind)) for angle in angles]).T
    return np.ascontiguousarray(deviations[places].reshape(factors.size, *samples.shape[1:]))


def running_sums(rate: Floats) -> Iterator[Floats]:
    """For each channel of the rates (N,) or (N, k), its θ (N + 1,): the running sum about the mean, from 0.

    ShapeError if a sample is not finite.
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


def _mirrored(angle: Floats) -> Floats:
    """θ, continued beyond each end by its reflection in the end point: 3N − 1 points."""
    inner = angle[-2:0:-1]
    return np.concatenate((2.0 * angle[0] - inner, angle, 2.0 * angle[-1] - inner))  # [Riley2008] (25)


def _every_nth(points: Floats, n: int) -> tuple[Floats, int]:
    return np.ascontiguousarray(points[::n]), 1


def _centred(points: Floats, n: int) -> tuple[Floats, int]:
    """Those mirrored points whose differences have their middle on θ, its ends left out."""
    count = (points.size + 1) // 3
    return points[count - n : 2 * count - 1 + n], n


class _SumRule(NamedTuple):
    add_squares: Callable[[Floats, Factors, Floats], None]
    scale: float
    view: Callable[[Floats, int], tuple[Floats, int]] | None = None  # points and spacing at n; else all, n apart


_HOW: Final = {
    "oadev": _SumRule(second_squares, 2.0),  # [Riley2008] (11)
    "adev": _SumRule(second_squares, 2.0, _every_nth),  # [Riley2008] (7)
    "mdev": _SumRule(modified_squares, 2.0),  # [Riley2008] (14)
    "ohdev": _SumRule(third_squares, 6.0),  # [Riley2008] (20)
    "hdev": _SumRule(third_squares, 6.0, _every_nth),  # [Riley2008] (18)
    "totdev": _SumRule(second_squares, 2.0, _centred),  # [Riley2008] (25)
}


def _variance(angle: Floats, factors: Factors, kind: str) -> Floats:
    how, shape = _HOW[kind], SHAPES[kind]
    points = _mirrored(angle) if kind == "totdev" else angle
    sums, terms = np.zeros(factors.size), np.empty(factors.size)
    if how.view is None:
        how.add_squares(points, factors, sums)  # together, which is several times as fast
    for j, n in enumerate(factors.tolist()):
        strided, spacing = (points, n) if how.view is None else how.view(points, n)
        # the last point of a difference lies so far behind its first
        terms[j] = strided.size - ((shape.order + shape.averaged) * spacing - shape.averaged)
        if how.view is not None:
            how.add_squares(strided, np.array([spacing]), sums[j : j + 1])
    return np.asarray(sums / (how.scale * factors.astype(np.float64) ** 2 * terms))
