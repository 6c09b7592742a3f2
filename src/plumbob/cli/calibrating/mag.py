"""plumbob calibrate mag: hard iron, soft iron, scale and turn of a magnetometer."""

import argparse

from plumbob.cli import common
from plumbob.cli.calibrating import capture


def add_parser(kinds: common.Adder) -> None:
    """Declare the kind."""
    p = kinds.add_parser(
        "mag",
        help="magnetometer: hard iron, soft iron, scale, turn against the accelerometer",
        description="Calibrate a magnetometer from a capture in which the unit was turned slowly through all "
        "attitudes, away from iron: each face and each edge once up. A card that would more likely harm than help is "
        "refused; --force writes it anyway.",
        epilog=common.more(
            "plumbob calibrate mag capture.parquet --calibration card.json --out card.json", "calibration.md"
        ),
    )
    capture.add_options(p, guide="mag")
    p.add_argument(
        "--with", dest="helper", default="auto", metavar="none|acc|gyr|auto", help="sensors that help (default auto)"
    )
    p.add_argument(
        "--shape",
        default="auto",
        metavar="auto|sphere|axes|ellipsoid|level",
        help="model of the distortion; auto tests which is needed (default), level is for a unit that cannot tilt",
    )
    p.add_argument(
        "--in-use",
        action="store_true",
        help="a long record of a unit at work, which nobody turned for it: hard and soft iron by the gyroscope, from "
        "moment to moment",
    )
    capture.add_field(p)
    p.add_argument("--tilt", metavar="ANGLE", help="inclination up to which headings count (default 45deg)")
    p.set_defaults(find=find)


def find(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.core.errors import ParameterError

    if args.in_use and args.live:
        raise ParameterError("--in-use takes a recording of a unit at work and does not go with --live; record first.")
    found = capture.calibrated(
        args,
        "mag",
        with_=args.helper,
        shape=args.shape,
        strength=args.strength,
        place=args.place,
        tilt=args.tilt,
        in_use=args.in_use,
        force=args.force,
    )
    return capture.finish(args, found)
