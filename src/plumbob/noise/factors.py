"""Averaging factors: how many samples are averaged, and which numbers of them a record allows."""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob import check
from plumbob.errors import ParameterError

Factors = NDArray[np.int64]
STREAMED: Final = 2**14
"""A stream takes every difference where fewer samples are averaged."""


def whole_factors(n: ArrayLike, longest: int, why: str) -> Factors:
    """Return the averaging factors n (m,), refusing any that is no whole number from 1 to `longest`.

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
        If a factor is no whole number.
    """
    factors = whole_factors(n, 2**48, "for a stream")
    steps = stream_steps(factors)
    return np.unique(np.round(factors / steps).astype(np.int64) * steps)
