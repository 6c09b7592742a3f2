"""plumbob calibrate gyro: bias at rest, scale and axes by hand motion, a Ferraris session, the trackball preset."""

import argparse
from pathlib import Path

from plumbob.cli import common
from plumbob.cli.calibrating.capture import add_options, calibrated, finish

EPILOG = """\
rest      30 s at rest: bias.
hand      30 s at rest, then 20 quarter or half turns about all axes with 2 s of rest after each: bias, scale and axes
          against the accelerometer, whose card is given with --calibration.
ferraris  six faces at rest and a turn by --angle about each axis while it stands on end: accelerometer and gyroscope.
          The parts x_p x_a y_p y_a z_p z_a (axis up, axis down) and x_rot y_rot z_rot are looked for, or named by
          --parts FILE.csv (part,from_s,to_s) or by --part-column NAME of a text file.
"""


def add_parser(kinds: common.Adder) -> None:
    """Declare the kind."""
    p = kinds.add_parser(
        "gyro",
        help="gyroscope: bias, scale and axes, without a table",
        description="Calibrate a gyroscope without a table.",
        epilog=common.more(
            "plumbob calibrate gyro rest.parquet --method rest --calibration card.json --out card.json",
            "calibration.md",
            EPILOG,
        ),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_options(p, guide="gyro")
    p.add_argument(
        "--method", choices=("auto", "rest", "hand", "ferraris"), default="auto", help="how; auto says which"
    )
    p.add_argument(
        "--preset", choices=("trackball",), help="bias at rest with a paper's coefficients, not measured ones"
    )
    p.add_argument("--parts", type=Path, metavar="CSV", help="where the parts of a Ferraris session lie")
    p.add_argument("--part-column", metavar="NAME", help="column of a text file that names the parts")
    p.add_argument("--angle", metavar="ANGLE", help="of each turn of a Ferraris session; 360deg if not given")
    p.set_defaults(find=find)


def find(args: argparse.Namespace) -> int:
    """Do it."""
    _refuse_idle(args)
    if args.method != "ferraris":
        return finish(args, calibrated(args, "gyro", method=args.method, preset=args.preset))
    from plumbob.files.text import read_labels

    labels = None if args.part_column is None else read_labels(args.file, args.part_column, args.profile)
    angle = args.angle or "360 deg"
    return finish(args, calibrated(args, "ferraris", (args.parts,), parts=args.parts, labels=labels, angle=angle))


def _refuse_idle(args: argparse.Namespace) -> None:
    """Refuse options that would have no effect."""
    from plumbob.core.errors import ParameterError

    if args.live and args.method not in ("auto", "rest"):
        raise ParameterError(f"--live guides a rest only; record for --method {args.method}, and give the recording.")
    if args.preset and args.method != "auto":
        raise ParameterError(f"--preset {args.preset} is a method of its own; leave --method {args.method} out.")
    given = [
        f"--{name.replace('_', '-')}" for name in ("parts", "part_column", "angle") if getattr(args, name) is not None
    ]
    if given and args.method != "ferraris":
        raise ParameterError(f"{given[0]} belongs to --method ferraris; name that, or leave it out.")
    if args.parts and args.part_column:
        raise ParameterError("--parts and --part-column both name the parts. Give one of them.")
    if args.part_column and (args.start is not None or args.stop is not None):
        raise ParameterError("--part-column names the part of every sample, so --from and --to are not for it.")
