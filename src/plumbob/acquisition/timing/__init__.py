"""Timing: from a device's clock and the time of arrival to one time of a host, with what it is worth."""

from typing import TYPE_CHECKING

from plumbob.core.lazy import lazily

if TYPE_CHECKING:
    from plumbob.acquisition.timing.counter import CountedTime
    from plumbob.acquisition.timing.report import Delays, Stamps, TimeReport
    from plumbob.acquisition.timing.spec import Counter, TimeSpec
    from plumbob.acquisition.timing.timebase import TimeBase

__getattr__, __dir__ = lazily(
    __name__,
    {
        "CountedTime": "counter",
        "Counter": "spec",
        "Delays": "report",
        "Stamps": "report",
        "TimeBase": "timebase",
        "TimeReport": "report",
        "TimeSpec": "spec",
    },
)

__all__ = [
    "CountedTime",
    "Counter",
    "Delays",
    "Stamps",
    "TimeBase",
    "TimeReport",
    "TimeSpec",
]
