"""plumbob doctor: which units, axes, signs and delays are consistent with physics."""

import argparse
from pathlib import Path

from plumbob.cli import common


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "doctor",
        help="check units, axes, signs and delays of the sensors by the motion itself, with odds",
        description="Say which units, axes, signs and delays of the sensors are consistent with physics: gravity and "
        "the Earth's field turn in the body as the gyroscope says. Prints the lines of a profile that mend what is "
        "wrong, and what this motion cannot tell.",
        epilog=common.more("plumbob doctor log.csv --profile logger.toml --hemisphere north", "doctor.md"),
    )
    p.add_argument("file", type=Path)
    common.add_profile(p)
    common.add_unit(p)
    p.add_argument(
        "--hemisphere",
        choices=("north", "south"),
        help="side of the magnetic equator, which gives the sign of the magnetometer",
    )
    common.add_json(p)
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.door.doctor import doctor

    diagnosis = doctor(args.file, profile=args.profile, unit=args.unit, hemisphere=args.hemisphere)
    common.print_json(diagnosis.summary()) if args.json else print(diagnosis.text())
    return 3 if diagnosis.wrong else 0
