"""Time: integer nanoseconds on the wire and on disk, float64 seconds since the start in mathematics."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from plumbob.check import Floats
from plumbob.errors import ClockError

GAP_FACTOR = 5.0
"""A step longer than this many median steps is a gap."""

_LONGEST = 2**53 / 1e9  # beyond 104 days, float64 seconds no longer hold every nanosecond


def to_ns(t: Floats) -> NDArray[np.int64]:
    """Round seconds to integer nanoseconds.

    Raises
    ------
    ClockError
        If a time is farther than 104 days from the start, where seconds can no longer hold the nanosecond.
    """
    if t.size and not float(np.max(np.abs(t))) < _LONGEST:
        raise ClockError(
            f"t reaches {float(np.max(np.abs(t))):.6g} s, but seconds count from the start of the recording and end at "
            f"{_LONGEST:.0f} s. For unix time use t - t[0] and put the start into meta.t0_ns."
        )
    return np.rint(t * 1e9).astype(np.int64)


def to_s(t_ns: NDArray[np.int64]) -> Floats:
    """Integer nanoseconds to seconds; exactly the float64 nearest to the decimal number."""
    return t_ns / 1e9


def steps(t: Floats, last_ns: int | None = None) -> Floats:
    """Measured time steps, s, from integer nanoseconds, so that cutting a recording in chunks keeps every bit.

    Parameters
    ----------
    t : ndarray (N,)
        Times since the start, s.
    last_ns : int, optional
        Time of the sample before the first one, ns; without it the first step is 0.
    """
    t_ns = to_ns(t)
    before = np.concatenate((t_ns[:1] if last_ns is None else [last_ns], t_ns[:-1]))
    if last_ns is not None:  # samples older than the last one taken do not turn the clock back
        before = np.maximum(before, last_ns)
    return (t_ns - before) / 1e9


@dataclass(frozen=True, slots=True)
class Timing:
    """What the time stamps of a recording say.

    Attributes
    ----------
    samples : int
        Number of samples.
    duration : float
        From the first to the last, s.
    rate : float
        One over the median step, Hz; NaN for fewer than two samples.
    jitter : float
        Standard deviation of the steps that are no gap, s.
    gaps : int
        Number of steps longer than `GAP_FACTOR` median steps.
    longest : float
        Longest step, s.
    """

    samples: int
    duration: float
    rate: float
    jitter: float
    gaps: int
    longest: float


def timing(t: Floats) -> Timing:
    """Measure rate, jitter and gaps of increasing times (N,), s."""
    dt = np.diff(t)
    if not dt.size:
        return Timing(t.size, 0.0, float("nan"), 0.0, 0, 0.0)
    median = float(np.median(dt))
    regular = dt[dt <= GAP_FACTOR * median]
    return Timing(
        samples=t.size,
        duration=float(t[-1] - t[0]),
        rate=1.0 / median,
        jitter=float(np.std(regular)),
        gaps=int(dt.size - regular.size),
        longest=float(dt.max()),
    )


def after_gap(t: Floats) -> NDArray[np.bool_]:
    """Mark the samples (N,) that come after a gap."""
    dt = np.diff(t)
    late = np.zeros(t.size, dtype=bool)
    if dt.size:
        late[1:] = dt > GAP_FACTOR * float(np.median(dt))
    return late
