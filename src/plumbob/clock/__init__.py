"""Time: integer nanoseconds on the wire and on disk, float64 seconds since the start in mathematics."""

from typing import TYPE_CHECKING

from plumbob._lazy import lazily
from plumbob.clock.seconds import to_ns, to_s
from plumbob.clock.steps import GAP_FACTOR, Timing, after_gap, timing

if TYPE_CHECKING:
    from plumbob.clock.counted import CountedTime
    from plumbob.clock.hostfit import HostFit, HostReport
    from plumbob.clock.report import Delays, Stamps, TimeReport
    from plumbob.clock.spec import Counter, TimeSpec
    from plumbob.clock.timebase import TimeBase

__getattr__, __dir__ = lazily(
    __name__,
    {
        "CountedTime": "counted",
        "Counter": "spec",
        "Delays": "report",
        "HostFit": "hostfit",
        "HostReport": "hostfit",
        "Stamps": "report",
        "TimeBase": "timebase",
        "TimeReport": "report",
        "TimeSpec": "spec",
    },
)

__all__ = [
    "GAP_FACTOR",
    "CountedTime",
    "Counter",
    "Delays",
    "HostFit",
    "HostReport",
    "Stamps",
    "TimeBase",
    "TimeReport",
    "TimeSpec",
    "Timing",
    "after_gap",
    "timing",
    "to_ns",
    "to_s",
]
