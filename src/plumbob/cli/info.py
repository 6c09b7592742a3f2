"""plumbob info: what a file holds, and its grade."""

import argparse
from pathlib import Path

from plumbob.cli import common

BELOW = 3
"""Exit code of a grade below the one that is asked for."""


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "info",
        help="show what a recording, track or card holds: time, units, frames, flags; calibration; noise; a grade",
        description="Show what a recording or track holds: time line, ranges with units, frame, calibration and flags, "
        "and a grade from 0 to 100 with its reasons; of a calibration card its certificate, of a noise card its "
        "coefficients. Exit code 3 where the grade is below the one that --min-grade or --require asks for.",
        epilog=common.more("plumbob info sea.mcap --min-grade 70", "info.md"),
    )
    p.add_argument("file", type=Path, nargs="+", help="the file; or several of one recording, a sensor each")
    group = p.add_mutually_exclusive_group()
    group.add_argument("--min-grade", type=float, metavar="N", help="exit code 3 below this grade, 0 to 100")
    group.add_argument("--require", choices=("GOOD", "FAIR", "POOR"), help="exit code 3 where the grade is worse")
    p.add_argument("--grade", action="store_true", help="every criterion with its measurement, points, rule and advice")
    common.add_profile(p)
    common.add_unit(p)
    common.add_json(p)
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.core.errors import ParameterError
    from plumbob.overview.info import info

    if args.min_grade is not None and not 0.0 <= args.min_grade <= 100.0:
        raise ParameterError(f"--min-grade must be a number from 0 to 100, but it is {args.min_grade:g}.")
    facts = info(
        args.file if len(args.file) > 1 else args.file[0], profile=args.profile, unit=args.unit, note=common.note
    )
    common.print_json(facts.summary()) if args.json else print(facts.text(*(["grade"] if args.grade else [])))
    least = args.min_grade if args.require is None else args.require
    return 0 if least is None or facts.reaches(least) else BELOW
