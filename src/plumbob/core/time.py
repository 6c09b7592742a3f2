"""Time: integer nanoseconds on the wire and on disk, float64 seconds since the start, steps, gaps, delays and repeats.

A time base has two delays in one array: of all frames, and of those that shaped its line. A transport that repeats a
block gives the same times and the same values again.
"""

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import ClockError
from plumbob.core.kernels import kernel

LONGEST: Final = float(2**23)  # s, 97 days: beyond, neighbouring float64 are more than a nanosecond apart
_PART: Final = 1 << 15  # times that are rounded at once


def to_ns(t: Floats) -> NDArray[np.int64]:
    """Round seconds to integer nanoseconds."""
    if t.size and not (np.min(t) > -LONGEST and np.max(t) < LONGEST):
        raise ClockError(
            f"t reaches {float(np.max(np.abs(t))):.6g} s, but seconds count from the start of the recording and end at "
            f"{LONGEST:.0f} s. For unix time use t - t[0] and put the start into meta.t0_ns."
        )
    t_ns = np.empty(t.shape, dtype=np.int64)
    for at in range(0, t.size, _PART):  # of which the processor keeps what it needs twice
        part = t[at : at + _PART]
        seconds = np.trunc(part)  # t * 1e9 would round twice, and miss by 1 ns from 48 days on
        t_ns[at : at + _PART] = seconds * 1e9 + np.rint((part - seconds) * 1e9)  # `LONGEST` has less than 2^53 ns
    return t_ns


def to_s(t_ns: NDArray[np.int64]) -> Floats:
    """Integer nanoseconds to seconds; exactly the float64 nearest to the decimal number."""
    return t_ns / 1e9


GAP_FACTOR = 5.0  # a step longer than this many median steps is a gap


@dataclass(frozen=True, slots=True)
class Timing:
    """What the time stamps of a recording say."""

    samples: int  # number of samples
    duration: float  # from the first to the last, s
    rate: float  # one over the `usual_step`, Hz; NaN for fewer than two samples
    jitter: float  # standard deviation of the steps that are not gaps, s
    gaps: int  # number of steps longer than `GAP_FACTOR` median steps
    longest: float  # longest step, s
    in_gaps: float = 0.0  # by how much the gaps are longer than a usual step, s, in all
    repeated: int = 0  # steps so short that they repeat a stamp
    wander: float = 0.0  # standard deviation of the other steps about whole numbers of the usual one, in steps
    lost: float = 0.0  # share of the rows that are missing one to four at a time


TINY: Final = 0.02  # a step shorter than this share of the usual one repeats a stamp


def timing(t: Floats) -> Timing:
    """Measure rate, jitter and gaps of increasing times (N,), s; a day of them leaves little room for copies."""
    dt_ns = np.diff(to_ns(t))
    if not dt_ns.size:
        return Timing(1, 0.0, float("nan"), 0.0, 0, 0.0)
    gaps, usual, count = is_gap(dt_ns), usual_step(dt_ns) / 1e9, dt_ns.size
    total, longest, jitter = int(dt_ns.sum()) / 1e9, int(dt_ns.max()) / 1e9, float(np.std(dt_ns, where=~gaps)) / 1e9
    steps, number = dt_ns / (1e9 * usual), int(np.count_nonzero(gaps))
    del dt_ns
    between = float(np.sum(steps, where=~gaps))
    tiny, even = steps < TINY, count - number
    multiples = np.maximum(np.rint(steps), 1.0)
    steady = ~(gaps | tiny)
    skipped = float(np.sum(multiples, where=steady)) - np.count_nonzero(steady)
    np.subtract(steps, multiples, out=steps)
    wander = float(np.std(steps, where=steady)) if steady.any() else 0.0
    missing = max(0.0, min(skipped, between - even - 3.0 * wander * np.sqrt(even)))  # by which jitter moves the mean
    return Timing(
        count + 1, total, 1.0 / usual, jitter, number, longest, total - usual * (between + number),
        int(np.count_nonzero(tiny)), wander, float(missing / (missing + even + 1.0)),
    )  # fmt: skip


def usual_step(dt_ns: NDArray[np.int64]) -> float:
    """Time from sample to sample, ns, by steps (N,): the mean of those about their median, since two may alternate."""
    middle, digit = float(np.median(dt_ns)), int(np.gcd.reduce(dt_ns[:: max(1, dt_ns.size // 100_000)]))
    off = np.abs(dt_ns - middle)
    near, close = off < 0.5 * middle, off <= digit
    # in whole ms they are 3 or 4 at 286 Hz, and at 850 Hz 1 or 2, of which the longer come evenly, or lack a sample
    if middle < 2.0 * digit:
        width = 2 * -(-dt_ns.size // max(int(np.count_nonzero(close & (off > 0.0))), 1))
        together = dt_ns[: dt_ns.size // width * width].reshape(-1, width).sum(axis=1)
        close &= together.size >= 4 and np.ptp(np.percentile(together, (2.0, 98.0), method="nearest")) <= digit
    return float(np.mean(dt_ns, where=near | close)) if (near | close).any() else middle


def longest_bridged(t_ns: NDArray[np.int64]) -> float:
    """Longest step between stamps (N,) that is not a gap, s: `GAP_FACTOR` median steps; 0 for a single stamp."""
    return GAP_FACTOR * float(np.median(np.diff(t_ns))) / 1e9 if t_ns.size > 1 else 0.0


class Neighbours(NamedTuple):
    """Where stamps (N,) lie on another time line: its rows on both sides, equal where it has the very stamp."""

    low: NDArray[np.intp]
    high: NDArray[np.intp]
    exact: NDArray[np.bool_]
    outside: NDArray[np.bool_]
    gap: NDArray[np.bool_]

    @property
    def known(self) -> NDArray[np.bool_]:
        """Neither beyond the ends nor in a gap."""
        return np.asarray(~(self.outside | self.gap))


def neighbours(own_ns: NDArray[np.int64], t_ns: NDArray[np.int64], max_gap: float) -> Neighbours:
    """Find stamps (N,), ns, on a time line (M,) that increases, whose steps longer than `max_gap`, s, are gaps."""
    last = own_ns.size - 1
    right = np.searchsorted(own_ns, t_ns)
    high = np.minimum(right, last)
    exact = np.asarray(own_ns[high] == t_ns)
    low = np.where(exact, high, np.maximum(right - 1, 0))
    outside = ~exact & ((right == 0) | (right > last))
    return Neighbours(low, high, exact, outside, ~outside & ((own_ns[high] - own_ns[low]) / 1e9 > max_gap))


def interpolated(rows: NDArray[np.int64], stamps: NDArray[np.int64], values: Floats) -> Floats:
    """Values (M, 3) or (M,), known at `stamps`, between neighbours that are not a gap apart; NaN elsewhere.

    That is also outside and beside a NaN; `rows` (N,) and `stamps` (M,) are ns.
    """
    at = neighbours(stamps, rows, longest_bridged(stamps))
    span, inside = stamps[at.high] - stamps[at.low], at.known
    share = np.divide(rows - stamps[at.low], span, out=np.zeros(rows.size), where=span > 0)
    interp = np.full((rows.size, *values.shape[1:]), np.nan)
    part, exact = (column[inside] if values.ndim == 1 else column[inside, None] for column in (share, at.exact))
    low, high = values[at.low[inside]], values[at.high[inside]]
    with np.errstate(invalid="ignore"):
        interp[inside] = np.where(exact, high, low + part * (high - low))
    return interp


def is_gap(dt_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Mark the steps (N,), ns, that are gaps; integers decide, so that rounding of t does not."""
    return np.asarray(dt_ns > GAP_FACTOR * np.median(dt_ns) if dt_ns.size else np.zeros(0, dtype=bool))


BINS: Final = 16 * 58  # up to 10¹⁸ ns; everything below 32 ns has a bin of its own


@kernel
def bin_index(delay: float) -> int:
    """Bin of a delay, ns."""
    value, octave = int(min(max(delay, 0.0), 1e18)), 0
    while value >= 32:
        value >>= 1
        octave += 1
    return 16 * octave + value


@kernel
def bin_middle(place: int) -> float:
    """Delay in the middle of a bin, ns."""
    octave = max(place // 16 - 1, 0)
    return (place - 16 * octave + 0.5) * 2.0**octave if octave else float(place)


@kernel
def quantile(histogram: NDArray[np.int64], first: int, share: float) -> float:
    """Delay that this share of the frames keeps, ns, in the histogram that begins there; 0 where there are none."""
    total, reached = 0, 0
    for place in range(BINS):
        total += histogram[first + place]
    for place in range(BINS):
        reached += histogram[first + place]
        if reached > 0 and reached >= share * total:
            return bin_middle(place)
    return 0.0


REMEMBERED: Final = 128  # rows that are known again: more than a second at 100 Hz
_PRIME: Final = np.uint64(0x100000001B3)  # of the 64-bit FNV hash: draft-eastlake-fnv-21, section 5
_HALF: Final = np.uint64(32)


class Repeats:
    """Knows the last rows of a stream, however it is cut.

    The rows must hold a time or a count: what merely stays the same was not sent twice.
    """

    def __init__(self) -> None:
        self._known, self._count = np.zeros(REMEMBERED, dtype=np.uint64), np.zeros(1, dtype=np.int64)

    def fresh(self, rows: Floats) -> NDArray[np.bool_]:
        """Mark the next rows (N, …) that are not among the last ones, bit by bit: NaN is equal to NaN."""
        fresh, bits = np.empty(len(rows), dtype=bool), np.ascontiguousarray(rows, dtype=np.float64).view(np.uint64)
        key = np.zeros(len(rows), dtype=np.uint64)
        for column in bits.T:  # the digits of a short number are in its upper half, and a product carries upwards only
            key = (key ^ column ^ (column >> _HALF)) * _PRIME
        _mark(self._known, self._count, key, fresh)
        return fresh


@kernel
def _mark(
    ring: NDArray[np.uint64], count: NDArray[np.int64], keys: NDArray[np.uint64], fresh: NDArray[np.bool_]
) -> None:  # fmt: skip
    for i in range(keys.size):
        fresh[i] = True
        for k in range(min(count[0], ring.size)):
            if ring[k] == keys[i]:
                fresh[i] = False
        if fresh[i]:
            ring[count[0] % ring.size] = keys[i]
            count[0] += 1
