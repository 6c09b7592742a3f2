"""What a time base gives, and what it has to say about the clocks behind it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.time import quantile


@dataclass(frozen=True, slots=True)
class Stamps:
    """Times of frames, one entry each.

    Attributes
    ----------
    t_ns : int64 (N,)
        Time on the host's monotonic clock, ns. Increases from frame to frame, except where TIME_FAULT is set.
    step : int64 (N,)
        Counts of the device clock, or frames, since the last frame that was used, with all turns of the counter; 0
        where there is no count.
    flags : uint32 (N,)
        `flags.GAP` where frames are missing before this one, or time starts again; `flags.TIME_FAULT`
        where the frame repeats or contradicts others: its time is that of the frame before, and must not be used.
    lost : int64 (N,)
        Frames missing before this one: exact where there is a counter, else what time has room for.
    kind : uint8 (N,)
        What became of the frame: bits named in `plumbob.live.timing.spec`, 0 for most.
    """

    t_ns: NDArray[np.int64]
    step: NDArray[np.int64]
    flags: NDArray[np.uint32]
    lost: NDArray[np.int64]
    kind: NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Delays:
    """How much later than the earliest ones frames arrive, s; quantiles are good to 6 %."""

    p50: float
    p99: float
    worst: float


@dataclass(frozen=True, slots=True)
class TimeReport:
    """What the stamps of one source have shown.

    Attributes
    ----------
    mode : str
        Where the time comes from: ``"clock"``, ``"frames"`` or ``"host"``.
    frames : int
        Frames that were stamped, with and without faults.
    rate : float
        Measured rate, Hz of the host's seconds; NaN while not known.
    drift_ppm : float
        Host seconds per device second, less one: positive for a device that runs slow; NaN where neither
        a device clock nor a nominal rate says how long its second is.
    delays : Delays
        Of the frames' arrivals.
    offset : float
        By how much the latest stamp is later than the earliest possible arrival of its frame, s.
    lost : int
        Frames that are missing.
    duplicates, late, ahead : int
        Frames that repeat the last, that come after their successor, or that claim a time to come; none is used.
    resets : int
        How often time began again, because counts no longer fit the host's time.
    wraps_by_host : int
        How often the host's time alone decided how many turns of a counter, or how many frames, had passed.
    suspects : int
        Frames so late that a turn of the counter, or a frame, may be missing before them.
    reopened : int
        How often the source was opened again, or the host's clock set back.
    unsure : int
        Frames stamped before the rate was known, that shared a read with others.
    inferred : int
        Gaps, or steps of time, that nothing but a lasting delay of the host spoke for: no count, no byte, no event.
    inferred_time : float
        Their length in all, s.
    gap_count : int
        How many gaps there were.
    gaps : tuple of (int, int, int)
        The latest of them: time before and after, ns, and frames lost.
    """

    mode: str
    frames: int
    rate: float
    drift_ppm: float
    delays: Delays
    offset: float
    lost: int
    duplicates: int
    late: int
    ahead: int
    resets: int
    wraps_by_host: int
    suspects: int
    reopened: int
    unsure: int
    inferred: int
    inferred_time: float
    gap_count: int
    gaps: tuple[tuple[int, int, int], ...]

    @classmethod
    def joined(cls, reports: Sequence["TimeReport"]) -> "TimeReport":
        """One report of a source that was started again and again: counts in all, the rest as the last has it."""
        counts: dict[str, Any] = {name: sum(getattr(report, name) for report in reports) for name in _COUNTS}
        gaps = tuple(gap for report in reports for gap in report.gaps)
        return replace(reports[-1], **counts, gaps=gaps)


_COUNTS: Final = (
    "frames", "lost", "duplicates", "late", "ahead", "resets", "wraps_by_host", "suspects", "reopened", "unsure",
    "inferred", "inferred_time", "gap_count",
)  # fmt: skip


def delays(histogram: NDArray[np.int64], worst: float) -> Delays:
    """Quantiles of a histogram of delays in ns, in seconds."""
    return Delays(
        min(quantile(histogram, 0, 0.5), worst) / 1e9, min(quantile(histogram, 0, 0.99), worst) / 1e9, worst / 1e9
    )
