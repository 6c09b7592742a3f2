"""plumbob calibrate mount: how the unit sits on its body."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from plumbob.cli import common
from plumbob.cli.calibrating import capture

if TYPE_CHECKING:
    from plumbob.calibration.calibration import Capture
    from plumbob.calibration.mount import Mounted
    from plumbob.data import AttitudeTrack


def add_parser(kinds: common.Adder) -> None:
    """Declare the kind."""
    p = kinds.add_parser(
        "mount",
        help="how the unit sits on its body, from two poses at rest or a reference",
        description="Find the rotation from the axes of the unit to those of its body: rest with the body level, raise "
        "its nose by 15° to 60° about the lateral axis, and rest again; or compare with a reference attitude.",
        epilog=common.more(
            "plumbob calibrate mount raise.parquet --frame NED --calibration card.json --out card.json",
            "calibration.md",
        ),
    )
    capture.add_options(p)
    common.add_frame(p, "body axes: z down in NED, z up in ENU and NWU; needed for poses")
    p.add_argument("--level", metavar="A..B", help="when the body was level, as 0s..5s (default: first rest)")
    p.add_argument("--raised", metavar="A..B", help="when its nose was raised (default: the rest that leans most)")
    p.add_argument(
        "--level-only", action="store_true", help="roll and pitch only; heading of the mounting taken as zero"
    )
    p.add_argument("--reference", type=Path, metavar="FILE", help="attitude of the body; with --estimate")
    p.add_argument(
        "--estimate", type=Path, metavar="FILE", help="attitude of the unit, as 'plumbob run --out' writes it"
    )
    p.set_defaults(find=find)


def find(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.core.errors import ParameterError

    if (args.reference is None) != (args.estimate is None):
        raise ParameterError("--reference and --estimate belong together: attitudes of the body and of the unit.")
    if args.reference is not None and (args.level or args.raised or args.level_only or args.frame):
        raise ParameterError("--reference needs no poses: leave out --level, --raised, --level-only and --frame.")
    unit = capture.opened(args, inputs=(args.reference, args.estimate))
    found = _by_poses(args, unit) if args.reference is None else _by_reference(args)
    return capture.finish(args, unit, {}, mounted=found)


def _by_poses(args: argparse.Namespace, unit: "Capture") -> "Mounted":
    from plumbob.calibration.calibrate_mount import mount_by_poses
    from plumbob.core.errors import FrameError
    from plumbob.rotations import Frame

    frame = common.frame_of(args)
    if frame is None:
        raise FrameError(f"the body's axes depend on the navigation frame. Give --frame {', --frame '.join(Frame)}.")
    level, raised = (None if text is None else _span(text) for text in (args.level, args.raised))
    return mount_by_poses(unit, frame=frame, level=level, raised=raised, level_only=args.level_only)


def _by_reference(args: argparse.Namespace) -> "Mounted":
    from plumbob.calibration.calibrate_mount import mount_by_reference

    return mount_by_reference(_track(args.estimate), _track(args.reference))


def _track(path: Path) -> "AttitudeTrack":
    from plumbob.core.errors import DecodeError
    from plumbob.session.reading import read_any

    track = read_any(path).track
    if track is None:
        raise DecodeError(f"{path} holds no attitude; make one with 'plumbob run --out'.")
    return track


def _span(text: str) -> tuple[float, float]:
    from plumbob.core.errors import ParameterError
    from plumbob.core.units import Quantity, parse

    first, dots, last = text.partition("..")
    if not dots:
        raise ParameterError(f"a span is written as 0s..5s, but it is '{text}'.")
    return parse(first, Quantity.TIME), parse(last, Quantity.TIME)
