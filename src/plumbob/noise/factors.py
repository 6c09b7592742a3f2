"""Averaging factors: how many samples are averaged, and which numbers of them a record allows."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core import check
from plumbob.core.errors import ParameterError

Factors = NDArray[np.int64]
STREAMED: Final = 2**14
"""A stream takes every difference where fewer samples are averaged."""


def whole_factors(n: ArrayLike, longest: int, why: str) -> Factors:
    """Return the averaging factors n (m,), refusing any that is not a whole number from 1 to `longest`.

    Parameters
    ----------
    n : array_like (m,)
        As the user gave them.
    longest : int
        The largest that the record allows.
    why : str
        What allows no more, for the message: ``"of 9 samples"``.

    Raises
    ------
    ParameterError
        Where one does not fit, or there is none.
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


class Kind(NamedTuple):
    """How a deviation is made of the cumulative sum.

    Attributes
    ----------
    order : int
        Of the differences: 2 for Allan's, 3 for Hadamard's.
    averaged : bool
        Whether the sum is averaged over n points first, as the modified deviation does.
    overlapping : bool
        Whether every difference is used, or every n-th.
    """

    order: int
    averaged: bool
    overlapping: bool

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


SHAPES: Final[dict[str, Kind]] = {
    "oadev": Kind(2, averaged=False, overlapping=True),
    "adev": Kind(2, averaged=False, overlapping=False),
    "mdev": Kind(2, averaged=True, overlapping=True),
    "ohdev": Kind(3, averaged=False, overlapping=True),
    "hdev": Kind(3, averaged=False, overlapping=False),
    "totdev": Kind(2, averaged=False, overlapping=True),
}
"""By name of the deviation. The total deviation extends the record, and is Allan's overlapping one inside it."""

KINDS: Final = tuple(SHAPES)
"""Overlapping Allan, Allan, modified Allan (overlapping), overlapping Hadamard, Hadamard, total."""


def kind_of(name: str) -> Kind:
    """Kind of that name, refusing unknown ones by a `ShapeError`."""
    return SHAPES[check.one_of("kind", name, KINDS)]


def factors_of(kind: str, count: int, n: ArrayLike) -> Factors:
    """Averaging factors n as integers, refusing those that `count` samples do not allow.

    Raises
    ------
    ShapeError
        If the kind is unknown.
    ParameterError
        If a factor is not a whole number, or too long for the record.
    """
    return whole_factors(n, kind_of(kind).longest(count), f"for {kind} of {count} samples")
