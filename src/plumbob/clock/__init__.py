"""Time: integer nanoseconds on the wire and on disk, float64 seconds since the start in mathematics."""

from plumbob.clock.seconds import to_ns, to_s
from plumbob.clock.steps import GAP_FACTOR, Timing, after_gap, timing

__all__ = ["GAP_FACTOR", "Timing", "after_gap", "timing", "to_ns", "to_s"]
