"""Seconds and nanoseconds: integers on the wire and on disk, float64 seconds since the start in mathematics."""

import numpy as np
from numpy.typing import NDArray

from plumbob.check import Floats
from plumbob.errors import ClockError

_LONGEST = float(2**23)  # 97 days: beyond, neighbouring float64 seconds are more than a nanosecond apart


def to_ns(t: Floats) -> NDArray[np.int64]:
    """Round seconds to integer nanoseconds.

    Raises
    ------
    ClockError
        If a time is 97 days or farther from the start, where seconds can no longer hold the nanosecond.
    """
    if t.size and not float(np.max(np.abs(t))) < _LONGEST:
        raise ClockError(
            f"t reaches {float(np.max(np.abs(t))):.6g} s, but seconds count from the start of the recording and end at "
            f"{_LONGEST:.0f} s. For unix time use t - t[0] and put the start into meta.t0_ns."
        )
    whole = np.trunc(t)  # t * 1e9 would round twice, and miss by 1 ns from 48 days on
    return whole.astype(np.int64) * 1_000_000_000 + np.rint((t - whole) * 1e9).astype(np.int64)


def to_s(t_ns: NDArray[np.int64]) -> Floats:
    """Integer nanoseconds to seconds; exactly the float64 nearest to the decimal number."""
    return t_ns / 1e9
