"""A body of segments with a unit on each: joints found from motion, angles and hand estimated, taught and replayed."""

from typing import TYPE_CHECKING

from plumbob.core import lazily

if TYPE_CHECKING:
    from plumbob.arm.alignment import ArmCard, align, opened_chain
    from plumbob.arm.angles import JointTrack
    from plumbob.arm.estimation import ArmEstimate, ArmStream, run
    from plumbob.arm.exported import export
    from plumbob.arm.program import PathDeviation, Program, Standstill, taught
    from plumbob.arm.replayed import HandError, Replay, replay
    from plumbob.arm.urdf import chain_from_urdf, urdf_text

__getattr__, __dir__ = lazily(__name__, {
    "ArmCard": "alignment", "ArmEstimate": "estimation", "ArmStream": "estimation", "HandError": "replayed",
    "JointTrack": "angles", "PathDeviation": "program", "Program": "program", "Replay": "replayed",
    "Standstill": "program", "align": "alignment", "chain_from_urdf": "urdf", "export": "exported",
    "opened_chain": "alignment", "replay": "replayed", "run": "estimation", "taught": "program", "urdf_text": "urdf",
})  # fmt: skip

__all__ = [
    "ArmCard", "ArmEstimate", "ArmStream", "HandError", "JointTrack", "PathDeviation", "Program", "Replay",
    "Standstill", "align", "chain_from_urdf", "export", "opened_chain", "replay", "run", "taught", "urdf_text",
]  # fmt: skip
