"""An attitude read at given times: interpolated at constant rate between stamps, never across a gap."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.time import longest_bridged, neighbours, to_ns
from plumbob.data.imu import AttitudeTrack
from plumbob.rotations import quat_slerp

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Reading:
    """A track read at given times."""

    q_nb: Floats  # (N, 4), attitude; NaN where the track does not tell it
    # low, high: (N,), rows of the track on both sides; equal where the stamp is the track's own
    low: NDArray[np.intp]
    high: NDArray[np.intp]
    exact: Mask  # (N,), the time is one of the track's own stamps
    # outside, gap: (N,), why it is not known: beyond the ends, or between stamps farther apart than the largest gap
    outside: Mask
    gap: Mask


def read_at(
    track: AttitudeTrack, t_ns: NDArray[np.int64], *, max_gap: float | None = None, offset: float = 0.0
) -> Reading:
    """Read a track at other times, integer ns (N,), with `offset` s added to its own stamps.

    Steps longer than `max_gap`, s, are not bridged; by default those longer than `GAP_FACTOR` of its median steps.
    """
    stamps = to_ns(track.t)
    limit = longest_bridged(stamps) if max_gap is None else max_gap
    return read_rows(to_ns(track.t + offset) if offset else stamps, track.q_nb, t_ns, max_gap=limit)


def read_rows(own_ns: NDArray[np.int64], q_nb: Floats, t_ns: NDArray[np.int64], *, max_gap: float) -> Reading:
    """Read attitudes (M, 4) with increasing stamps (M,), ns, at other times (N,), ns; `max_gap` is in s."""
    at = neighbours(own_ns, t_ns, max_gap)
    between = ~at.exact & at.known
    q = np.full((t_ns.size, 4), np.nan)
    q[at.exact] = q_nb[at.high[at.exact]]
    a, b = at.low[between], at.high[between]
    q[between] = quat_slerp(q_nb[a], q_nb[b], (t_ns[between] - own_ns[a]) / (own_ns[b] - own_ns[a]))
    return Reading(q, *at)
