"""A body of segments with a unit on each: joints found from motion, angles and hand estimated, taught and replayed."""

from typing import TYPE_CHECKING

from plumbob.core.lazy import lazily

if TYPE_CHECKING:
    from plumbob.arm.angles import JointTrack
    from plumbob.arm.exported import export
    from plumbob.arm.program import Deviation, Program, Stop, taught

__getattr__, __dir__ = lazily(
    __name__,
    {
        "Deviation": "program",
        "JointTrack": "angles",
        "Program": "program",
        "Stop": "program",
        "export": "exported",
        "taught": "program",
    },
)

__all__ = [
    "Deviation",
    "JointTrack",
    "Program",
    "Stop",
    "export",
    "taught",
]
