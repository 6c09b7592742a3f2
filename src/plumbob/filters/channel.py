"""Filters of one rate channel: a rate goes in, a smoother rate comes out, and no attitude is known.

They are not attitude filters, and `filter_names` does not list them; `plumbob.filter_rates` runs one on a recording.
What they are for: to show what smoothing a gyroscope does (its noise falls), and what it does not (its bias, its drift
and its integral stay).

================  ==================================================================
name              file
================  ==================================================================
scalar            `channel_scalar`: a rate that wanders; lags behind every ramp
two_state         `channel_two_state`: a rate and its acceleration; no lag on a ramp
moving_average    `channel_average`: the control of the same bandwidth
================  ==================================================================

A channel's file holds ``Params``, ``coefficients``, ``own_state`` (how many own numbers evolve, given the parameters)
and ``step(c, x, dt, y)``, where y is NaN for a sample that is missing. Time steps and late samples are judged as
those of attitude filters are (`timing`).
"""

import math
from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple, Protocol, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core import check, flags
from plumbob.core.check import Floats
from plumbob.core.constants import IMPOSSIBLE_RATE
from plumbob.core.errors import ParameterError, ShapeError, unknown_name
from plumbob.core.kernels import Kernel, kernel, specialise
from plumbob.core.params import build, describe, shown
from plumbob.core.time import to_ns
from plumbob.filters.known import EXTENSIBLE, RATE_FILTERS
from plumbob.filters.layout import COUNT, OWN, RATE, tick


class ChannelEstimates(NamedTuple):
    """What a channel filter made of some samples."""

    rate: Floats  # (N,), rate at each sample, rad/s; NaN until a channel has had its first good one
    flags: NDArray[np.uint32]  # (N,), flags of each sample, of all channels together


class ChannelModule(Protocol):
    """What the file of a channel filter must hold."""

    SUMMARY: str
    REFERENCES: tuple[str, ...]
    NEEDS: tuple[str, ...]
    Params: Any
    step: Kernel[..., None]

    @staticmethod
    def coefficients(params: Any) -> tuple[float, ...]:
        """Coefficients of the kernel."""

    @staticmethod
    def own_state(params: Any) -> int:
        """How many own numbers evolve."""


@kernel
def step(c: Floats, x: Floats, dt: float, y: float) -> None:
    """Stand in for the step of a filter, which `RateFilter` puts here."""


@kernel
def _take(c: Floats, x: Floats, t_ns: int, y: float) -> int:
    dt = tick(x, t_ns, y)
    if dt < 0.0:
        return flags.TIME_FAULT
    x[COUNT] += 1.0
    if abs(y) <= IMPOSSIBLE_RATE:
        step(c, x, dt, y)
        return 0
    step(c, x, dt, math.nan)
    return flags.GYR_HELD | (flags.GYR_ABSENT if math.isnan(y) else flags.GYR_INVALID)


@kernel
def _batch(
    c: Floats, x: Floats, t_ns: NDArray[np.int64], rate: Floats, out: Floats, words: NDArray[np.uint32]
) -> None:  # fmt: skip
    for i in range(t_ns.shape[0]):
        word = 0
        for k in range(rate.shape[1]):
            word |= _take(c, x[k], t_ns[i], rate[i, k])
            out[i, k] = x[k, RATE]
        words[i] = word


class RateFilter:
    """A filter of rate channels with its parameters and its state.

    Parameters
    ----------
    name : str
        "scalar", "two_state" or "moving_average".
    channels : int, optional
        How many channels are filtered side by side; without it, one, and arrays have the shape (N,).
    params : Mapping, optional
        Parameters by name; numbers in SI, text with its unit. Unknown names are refused.
    state : array_like, optional
        State to go on from, as `state` gave it.

    Raises
    ------
    ParameterError
        If the filter or a parameter is unknown.
    ShapeError
        If the state is not one of this filter.

    Examples
    --------
    >>> from plumbob.filters.channel import RateFilter
    >>> RateFilter("moving_average", params={"samples": 2}).process([0.0, 0.1, 0.2], [1.0, 2.0, 4.0]).rate
    array([1. , 1.5, 3. ])
    """

    def __init__(
        self,
        name: str,
        *,
        channels: int | None = None,
        params: Mapping[str, Any] | None = None,
        state: ArrayLike | None = None,
    ) -> None:
        self.name = name
        self.channels = channels
        self.module = load(name)
        self.params = build(self.module.Params, params or {}, of=name)
        self._batch = batch_loop(name)
        self._c = np.array(self.module.coefficients(self.params), dtype=np.float64)
        self._x = np.empty((_count(channels), OWN + self.module.own_state(self.params)))
        self.reset()
        if state is not None:
            given = check.floats("state", state)
            if given.shape != self._x.shape:
                raise ShapeError(
                    f"state of {self.describe()} has shape {self._x.shape}, but its shape is {given.shape}."
                )
            self._x[:] = given

    def reset(self) -> None:
        """Forget every sample."""
        self._x[:] = 0.0
        self._x[:, RATE] = math.nan

    @property
    def state(self) -> Floats:
        """Everything that has evolved: a filter made with it goes on where this one stands."""
        return self._x.copy()

    @property
    def rate(self) -> Floats:
        """Rate of each channel now, rad/s; NaN before its first good sample."""
        return self._x[:, RATE].copy()

    def process(self, t: ArrayLike, rate: ArrayLike) -> ChannelEstimates:
        """Take a recording, or its next chunk.

        `t` (N,): time, s since the start of the recording, increasing; `rate` (N,): measured rate, rad/s; NaN where a
        sample is missing.
        """
        time = check.column("t", t)
        check.increasing_time("t", time)
        if self.channels is None:
            out, words = self._run(to_ns(time), check.column("rate", rate, time.size)[:, np.newaxis])
            return ChannelEstimates(out[:, 0], words)
        return ChannelEstimates(*self._run(to_ns(time), check.rows("rate", rate, self.channels, time.size)))

    def update(self, t_ns: int, *rate: float) -> int:
        """Take the next sample, one rate, rad/s, for each channel, and return its flags; `rate` is then the result."""
        if len(rate) != self._x.shape[0]:
            raise ShapeError(f"update needs {self._x.shape[0]} rates, one for each channel, but got {len(rate)}.")
        _, words = self._run(np.array([t_ns], dtype=np.int64), np.array([rate], dtype=np.float64))
        return int(words[0])

    def _run(self, t_ns: NDArray[np.int64], rate: Floats) -> tuple[Floats, NDArray[np.uint32]]:
        out, words = np.empty(rate.shape), np.empty(t_ns.size, dtype=np.uint32)
        self._batch(self._c, self._x, t_ns, check.read_only(rate), out, words)
        return out, words

    def describe(self) -> str:
        """Name and parameters in one line, for provenance."""
        settings = (f"{p.name}={shown(p, getattr(self.params, p.name))}" for p in describe(type(self.params)))
        return f"{self.name}({', '.join(settings)})"


def load(name: str) -> ChannelModule:
    """Module of a channel filter.

    Raises ParameterError if there is no channel filter of that name.
    """
    if name not in RATE_FILTERS:
        raise unknown_name("channel filter", name, RATE_FILTERS)
    return cast(ChannelModule, EXTENSIBLE.find(name))


@cache
def batch_loop(name: str) -> Kernel[..., None]:
    """Loop of a filter over a recording, with its step inlined."""
    take = specialise(_take, f"take_channel_{name}", step=load(name).step)
    return specialise(_batch, f"batch_channel_{name}", _take=take)


def specialised() -> list[Kernel[..., None]]:
    """Loops of all channel filters, of which C is made."""
    return [batch_loop(name) for name in RATE_FILTERS]


def _count(channels: int | None) -> int:
    if channels is None:
        return 1
    if channels < 1:
        raise ParameterError(f"channels must be at least 1, but it is {channels}.")
    return channels
