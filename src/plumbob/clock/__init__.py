"""Time: integer nanoseconds on the wire and on disk, float64 seconds since the start in mathematics."""

from plumbob.clock.counted import CountedTime
from plumbob.clock.hostfit import HostFit, HostReport
from plumbob.clock.report import Delays, Stamps, TimeReport
from plumbob.clock.seconds import to_ns, to_s
from plumbob.clock.spec import Counter, TimeSpec
from plumbob.clock.steps import GAP_FACTOR, Timing, after_gap, timing
from plumbob.clock.timebase import TimeBase

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
