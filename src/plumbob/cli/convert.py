"""plumbob convert: a recording of any format as one of another."""

import argparse
from pathlib import Path

from plumbob.cli import common
from plumbob.core.text import counted

_LAYOUTS = ("ros2", "rosbag2", "euroc", "tum")
_FOLDERS = ("rosbag2", "euroc")


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "convert",
        help="write a recording of any format as CSV, Parquet, MCAP, TUM, text, or for ROS and EuRoC",
        description="Write what a recording or track holds for other programs: .csv, .parquet, .mcap (Foxglove, "
        "Lichtblick), .bag (ROS 1), .tum (evo), .txt (roll, pitch and yaw, degrees); with --as, for ROS 2 and EuRoC.",
        epilog=common.more("plumbob convert sea.mcap sea.csv", "file-formats.md"),
    )
    p.add_argument("file", type=Path, help="recording (.mcap, .parquet, .csv, .bag, ...) or track")
    p.add_argument(
        "new", type=Path, nargs="?", metavar="NEW", help="file to write, whose suffix says the format, or folder"
    )
    p.add_argument("--out", type=Path, metavar="FILE", help=argparse.SUPPRESS)
    p.add_argument(
        "--as",
        dest="layout",
        choices=_LAYOUTS,
        help="ros2: .mcap with messages of ROS 2; rosbag2: folder of a ROS 2 bag; euroc: folder with mav0/imu0; "
        "tum: attitude as .tum or .txt, for evo",
    )
    p.add_argument("--what", choices=("all", "samples", "attitude"), default="all", help="leave the rest out")
    common.add_profile(p)
    common.add_unit(p)
    common.add_force(p)
    common.add_calibration(p, "calibration card to apply to the samples")
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.core.errors import ParameterError
    from plumbob.live.recorded import convert, require_writer

    if (args.new is None) == (args.out is None):
        raise ParameterError("name one new file: plumbob convert FILE NEW.")
    new = args.out if args.new is None else args.new
    require_writer(new, args.layout)
    outputs = () if args.layout in _FOLDERS else common.with_profile(new)
    common.check_outputs(args, *outputs, inputs=(args.file, args.profile, args.calibration))
    written = convert(
        args.file,
        new,
        layout=args.layout,
        what=args.what,
        profile=args.profile,
        unit=args.unit,
        calibration=args.calibration,
        overwrite=args.force,
        note=common.note,
    )
    units = "" if written.array is None else f" of each of {counted(len(written.array.names), 'unit')}"
    parts = [(f"samples{units}", written.imu or written.array), ("attitudes", written.track)]
    counts = ", ".join(f"{len(part)} {word}" for word, part in parts if part is not None)
    print(f"{new}: of {args.file.name}, {counts}")
    return 0
