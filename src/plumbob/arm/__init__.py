"""A body of segments with a unit on each: joints found from motion, angles and hand estimated, taught and replayed."""

from typing import TYPE_CHECKING

from plumbob.core.lazy import lazily

if TYPE_CHECKING:
    from plumbob.arm.angles import JointTrack

__getattr__, __dir__ = lazily(
    __name__,
    {
        "JointTrack": "angles",
    },
)

__all__ = [
    "JointTrack",
]
