"""When a simulated unit samples, which stamps it writes, and which samples get lost."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from plumbob import clock
from plumbob.check import Floats
from plumbob.errors import ParameterError
from plumbob.sim.noise import stream

_MOST_SAMPLES = 50_000_000


@dataclass(frozen=True, eq=False)
class TimeLine:
    """Instants of a recording.

    Attributes
    ----------
    sampled : ndarray (N,)
        When each sample was taken, s: evenly spaced.
    stamps : ndarray (N,)
        What its time stamp says, s.
    kept : ndarray (N,) of bool
        False for the samples that got lost on the way.
    rate : float
        Samples per second, Hz.
    """

    sampled: Floats
    stamps: Floats
    kept: NDArray[np.bool_]
    rate: float


def time_line(*, rate: float, duration: float, jitter: float = 0.0, lost: float = 0.0, seed: int) -> TimeLine:
    """Lay out a recording.

    Parameters
    ----------
    rate : float
        Samples per second, Hz.
    duration : float
        Number of samples over the rate, s.
    jitter : float
        Standard deviation of the time stamps about the instants of sampling, s; at most a tenth of a step. Stamps keep
        their order: none strays by more than 0.45 steps.
    lost : float
        Share of the samples that are missing from the recording, each by its own chance; the first is always there.
    seed : int
        Of the random streams.

    Raises
    ------
    ParameterError
        If a number is outside its domain.
    """
    count = _count(rate, duration)
    if not (0.0 <= jitter <= 0.1 / rate and 0.0 <= lost < 1.0):
        raise ParameterError(
            f"jitter must be 0 to {0.1 / rate:g} s (a tenth of a step) and lost 0 to below 1, "
            f"but they are {jitter:g} s and {lost:g}."
        )
    sampled = clock.to_s(clock.to_ns(np.arange(count) / rate))
    stray = np.clip(jitter * rate * stream(seed, "time", "jitter").standard_normal(count), -0.45, 0.45) / rate
    stray[0] = max(stray[0], 0.0)  # a recording starts at 0, not before
    kept = stream(seed, "time", "lost").random(count) >= lost
    kept[0] = True
    return TimeLine(sampled, clock.to_s(clock.to_ns(sampled + stray)), kept, rate)


def arrivals(count: int, rate: float, own_rate: float | None) -> NDArray[np.int64]:
    """Rows of a time line of `count` samples at `rate`, Hz, that hold a new value of a slower sensor.

    A value goes to the first row at or after its own instant; a sensor without own_rate, or a faster one, has a value
    in every row.
    """
    if own_rate is None or own_rate >= rate:
        return np.arange(count)
    place = np.ceil(np.arange(int(count * own_rate / rate) + 1) * (rate / own_rate) - 1e-9)
    rows: NDArray[np.int64] = place[place < count].astype(np.int64)
    return rows


def _count(rate: float, duration: float) -> int:
    samples = rate * duration
    if not (rate > 0.0 and duration > 0.0 and 2.0 <= samples <= _MOST_SAMPLES):
        raise ParameterError(
            f"rate × duration must give 2 to {_MOST_SAMPLES} samples, but {rate:g} Hz × {duration:g} s is {samples:g}."
        )
    return round(samples)
