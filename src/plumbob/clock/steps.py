"""What the steps between time stamps say: rate, jitter, gaps."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from plumbob.check import Floats
from plumbob.clock.seconds import to_ns

GAP_FACTOR = 5.0
"""A step longer than this many median steps is a gap."""


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
    dt_ns = np.diff(to_ns(t))
    if not dt_ns.size:
        return Timing(t.size, 0.0, float("nan"), 0.0, 0, 0.0)
    gaps = _is_gap(dt_ns)
    return Timing(
        samples=t.size,
        duration=int(dt_ns.sum()) / 1e9,
        rate=1e9 / float(np.median(dt_ns)),
        jitter=float(np.std(dt_ns[~gaps])) / 1e9,
        gaps=int(np.count_nonzero(gaps)),
        longest=int(dt_ns.max()) / 1e9,
    )


def after_gap(t: Floats) -> NDArray[np.bool_]:
    """Mark the samples (N,) that come after a gap."""
    late = np.zeros(t.size, dtype=bool)
    late[1:] = _is_gap(np.diff(to_ns(t)))
    return late


def _is_gap(dt_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Decide on integers, so that rounding of t does not."""
    return np.asarray(dt_ns > GAP_FACTOR * np.median(dt_ns) if dt_ns.size else np.zeros(0, dtype=bool))
