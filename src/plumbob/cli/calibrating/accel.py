"""plumbob calibrate accel: the accelerometer by poses at rest, or by slow tumbling."""

import argparse

from plumbob.cli import common
from plumbob.cli.calibrating import capture

EPILOG = """\
Hold the unit still for 2 s or more in each of 18 poses, or in 40 any: every face and every edge of its case once up.
No pose has to be exact. Six faces give bias and scale only; nine poses and more give the misalignment of the axes too.
A capture that never rests is calibrated with --moving, where a gyroscope stands beside the accelerometer: turn the unit
slowly (20 to 30 deg/s) about all its axes for two minutes, close to the wrist. Poses at rest are several times better.
Gravity is the standard one unless --gravity or --latitude says better; it sets the scale, and moves no horizon.
"""


def add_parser(kinds: common.Adder) -> None:
    """Declare the kind."""
    p = kinds.add_parser(
        "accel",
        help="accelerometer: bias, scale and misalignment from poses at rest",
        description="Calibrate the accelerometer from a capture in which the unit rests in many poses; they are found.",
        epilog=common.more(
            "plumbob calibrate accel poses.parquet --calibration card.json --out card.json", "calibration.md", EPILOG
        ),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    capture.add_options(p, guide="accel")
    p.add_argument(
        "--shape",
        choices=("auto", "six", "axes", "ellipsoid"),
        default="auto",
        help="six or axes: bias and scale, from pairs of faces or any poses; ellipsoid: misalignment too",
    )
    p.add_argument("--moving", action="store_true", help="turned slowly without rests, beside a gyroscope")
    capture.add_gravity(p)
    p.set_defaults(find=find)


def find(args: argparse.Namespace) -> int:
    """Do it."""
    found = capture.calibrated(
        args,
        "accel",
        shape=args.shape,
        moving=args.moving,
        gravity=args.gravity,
        latitude=args.latitude,
        height=args.height,
    )
    return capture.finish(args, found)
