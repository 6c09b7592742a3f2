"""An attitude read at given times: interpolated at constant rate between stamps, never across a gap."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.time import GAP_FACTOR, to_ns
from plumbob.data.imu import AttitudeTrack
from plumbob.rotations import quat_slerp

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Reading:
    """A track read at given times.

    Attributes
    ----------
    q_nb : ndarray (N, 4)
        Attitude; NaN where the track does not tell it.
    low, high : ndarray (N,)
        Rows of the track on both sides; equal where the stamp is the track's own.
    exact : ndarray (N,) of bool
        The time is one of the track's own stamps.
    outside, gap : ndarray (N,) of bool
        Why it is not known: beyond the ends, or between stamps farther apart than the largest gap.
    """

    q_nb: Floats
    low: NDArray[np.intp]
    high: NDArray[np.intp]
    exact: Mask
    outside: Mask
    gap: Mask


def default_max_gap(track: AttitudeTrack) -> float:
    """Largest step of a track that is bridged by default, s: `plumbob.core.time.GAP_FACTOR` median steps, to the ns."""
    steps_ns = np.diff(to_ns(track.t))
    return GAP_FACTOR * float(np.median(steps_ns)) / 1e9 if steps_ns.size else 0.0


def read_at(track: AttitudeTrack, t_ns: NDArray[np.int64], *, max_gap: float, offset: float = 0.0) -> Reading:
    """Read a track at other times, integer ns (N,), with `offset` s added to its own stamps."""
    own_ns = to_ns(track.t + offset) if offset else to_ns(track.t)
    last = own_ns.size - 1
    right = np.searchsorted(own_ns, t_ns)
    high = np.minimum(right, last)
    exact: Mask = own_ns[high] == t_ns
    low = np.where(exact, high, np.maximum(right - 1, 0))
    outside: Mask = ~exact & ((right == 0) | (right > last))
    gap: Mask = ~outside & ((own_ns[high] - own_ns[low]) / 1e9 > max_gap)
    between = ~exact & ~outside & ~gap
    q_nb = np.full((t_ns.size, 4), np.nan)
    q_nb[exact] = track.q_nb[high[exact]]
    a, b = low[between], high[between]
    q_nb[between] = quat_slerp(track.q_nb[a], track.q_nb[b], (t_ns[between] - own_ns[a]) / (own_ns[b] - own_ns[a]))
    return Reading(q_nb, low, high, exact, outside, gap)
