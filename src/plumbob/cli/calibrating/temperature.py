"""plumbob calibrate temperature: bias of the gyroscope over temperature, from a soak at rest."""

import argparse

from plumbob.cli import common
from plumbob.cli.calibrating.capture import add_options, calibrated, finish

EPILOG = """\
Let the unit lie still while it warms up and cools down again, over 10 K or more in half an hour or longer, and record
its temperature. The degree of the polynomial, 1 to 3, is the lowest that the record does not contradict.
"""


def add_parser(kinds: common.Adder) -> None:
    """Declare the kind."""
    p = kinds.add_parser(
        "temperature",
        help="gyroscope: bias over temperature, from a soak at rest",
        description="Calibrate how the gyroscope's bias depends on temperature.",
        epilog=common.more(
            "plumbob calibrate temperature soak.parquet --calibration card.json --out card.json",
            "calibration.md",
            EPILOG,
        ),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_options(p, file="recording at rest over changing temperature")
    p.set_defaults(find=find)


def find(args: argparse.Namespace) -> int:
    """Do it."""
    return finish(args, calibrated(args, "temperature"))
