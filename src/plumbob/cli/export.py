"""plumbob export: samples and attitudes for other programs."""

import argparse
from pathlib import Path

from plumbob.cli import common
from plumbob.core.text import counted


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "export",
        help="write samples and attitude as CSV, Parquet, MCAP, TUM or text",
        description="Write what a recording or track holds for other programs: .csv, .parquet, .mcap (Foxglove, "
        "Lichtblick), .tum (evo), .txt (roll, pitch and yaw, degrees).",
        epilog=common.more("plumbob export sea.mcap --out sea.csv", "file-formats.md"),
    )
    p.add_argument("file", type=Path, help="recording (.mcap, .parquet, .csv, ...) or track")
    p.add_argument("--out", type=Path, required=True, metavar="FILE", help="file to write; its suffix says the format")
    p.add_argument("--what", choices=("all", "samples", "attitude"), default="all", help="leave the rest out")
    common.add_profile(p)
    common.add_unit(p)
    common.add_force(p)
    common.add_calibration(p, "calibration card to apply to the samples")
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.session.recorded import export

    common.check_outputs(args, *common.with_profile(args.out), inputs=(args.file, args.profile, args.calibration))
    written = export(
        args.file,
        args.out,
        what=args.what,
        profile=args.profile,
        unit=args.unit,
        calibration=args.calibration,
        overwrite=args.force,
        note=common.note,
    )
    units = "" if written.array is None else f" of each of {counted(len(written.array.names), 'unit')}"
    parts = [(f"samples{units}", written.imu or written.array), ("attitudes", written.track)]
    told = ", ".join(f"{len(part)} {word}" for word, part in parts if part is not None)
    print(f"{args.out}: of {args.file.name}, {told}")
    return 0
