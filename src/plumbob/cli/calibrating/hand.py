"""plumbob calibrate hand: accelerometer, gyroscope and magnetometer from one capture by hand."""

import argparse

from plumbob.cli import common
from plumbob.cli.calibrating import capture

EPILOG = """\
Away from iron, hold the unit still for 3 s in each of 18 poses, every face and every edge of its case once up, or in
40 any; turn it within a second or two in between, by a quarter or half a turn about another axis each time.
The accelerometer is calibrated by the poses, the gyroscope by the turns between them, the magnetometer by both. What
the recording lacks is left out. If one of them cannot be calibrated, no card is written; calibrate the others each.
"""


def add_parser(kinds: common.Adder) -> None:
    """Declare the kind."""
    p = kinds.add_parser(
        "hand",
        help="the whole unit: accelerometer, gyroscope and magnetometer from one capture by hand",
        description="Calibrate every triad of a unit from one capture of poses at rest with turns between them, as "
        "'plumbob sim poses' makes it: the accelerometer first, the others on what was found before.",
        epilog=common.more(
            "plumbob calibrate hand capture.parquet --out card.json --html card.html", "calibration.md", EPILOG
        ),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    capture.add_options(p)
    capture.add_gravity(p)
    capture.add_field(p)
    p.set_defaults(find=find)


def find(args: argparse.Namespace) -> int:
    """Do it."""
    found = capture.calibrated(
        args,
        "hand",
        gravity=args.gravity,
        latitude=args.latitude,
        height=args.height,
        strength=args.strength,
        place=args.place,
        force=args.force,
    )
    return capture.finish(args, found)
