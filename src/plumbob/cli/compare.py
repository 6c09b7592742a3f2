"""plumbob compare: two recordings of one motion, or two attitudes."""

import argparse
from pathlib import Path

from plumbob.cli import common

DIFFERENT = 3
"""Exit code where the two differ by more than the tolerance."""


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "compare",
        help="compare two recordings of one motion, or two attitudes: clocks, mounting, biases, what differs",
        description="Compare two recordings of one motion: offset and drift between their clocks, rotation between "
        "their bodies, and the difference of each triad; or two attitudes, as 'plumbob eval' does. With --tolerance, "
        "exit code 3 where they differ by more.",
        epilog=common.more("plumbob compare left.parquet right.parquet --tolerance 1%", "compare.md"),
    )
    p.add_argument("a", type=Path, help="recording or track")
    p.add_argument("b", type=Path, help="recording or track, seen from the first")
    p.add_argument(
        "--align",
        metavar="A,B",
        help="remove first: any of time, mounting, heading, or none; default: time and mounting of recordings, nothing "
        "of attitudes",
    )
    p.add_argument("--max-offset", default="10s", metavar="T", help="largest time offset sought (10s)")
    p.add_argument(
        "--tolerance",
        metavar="D",
        help="of attitudes an angle, as 0.1deg; of recordings a share, as 1%%; 0: equal to the bit",
    )
    p.add_argument("--settle", default="0", metavar="S", help="of attitudes: leave out so much at the start, as 10s")
    p.add_argument("--declination", metavar="ANGLE", help="magnetic declination with unit, east positive, as in 3.2deg")
    common.add_unit(p)
    common.add_profile(p)
    common.add_page(p)
    common.add_force(p)
    common.add_json(p)
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.door.compare import compare

    common.check_pages(args, inputs=(args.a, args.b, args.profile))
    words = None if args.align is None else [word.strip() for word in args.align.split(",") if word.strip()]
    comparison = compare(
        args.a,
        args.b,
        align=[] if words == ["none"] else words,
        max_offset=args.max_offset,
        tolerance=args.tolerance,
        settle=args.settle,
        declination=args.declination,
        unit=args.unit,
        profile=args.profile,
        note=common.note,
    )
    common.print_json(comparison.summary()) if args.json else print(comparison.text())
    common.write_pages(args, comparison.report())
    return DIFFERENT if comparison.within is False else 0
