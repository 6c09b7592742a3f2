"""plumbob eval: an estimate against a reference."""

import argparse
from pathlib import Path

from plumbob.cli import common

ALIGNMENTS = ("heading", "mounting", "time")


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "eval",
        help="compare an estimate with a reference: errors of attitude, by axis",
        description="Compare an estimated attitude with a reference: total, heading and inclination error, and each "
        "axis. Nothing is aligned unless asked for: a constant heading offset counts.",
        epilog=common.more("plumbob eval track.parquet sea.parquet --settle 30s --html errors.html", "start.md"),
    )
    p.add_argument("estimate", type=Path, help="track written by 'plumbob run'")
    p.add_argument("reference", type=Path, help="track, or a recording that carries a reference")
    p.add_argument("--align", default="", metavar="A,B", help=f"remove first: any of {', '.join(ALIGNMENTS)}")
    p.add_argument("--settle", default="0", metavar="S", help="leave out so much at the start, as 10s (default 0)")
    p.add_argument("--max-gap", metavar="S", help="do not interpolate across longer reference gaps, as 0.5s")
    p.add_argument("--declination", metavar="ANGLE", help="magnetic declination with unit, east positive, as in 3.2deg")
    common.add_profile(p)
    common.add_page(p)
    common.add_force(p)
    common.add_json(p)
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.door.evaluate import evaluate

    _refuse_mixed_up_files(args)
    result = evaluate(
        args.estimate,
        args.reference,
        align=alignments(args.align),
        max_gap=args.max_gap,
        declination=args.declination,
        settle=args.settle,
        profile=args.profile,
        note=common.note,
    )
    common.print_json(result.summary()) if args.json else print(result.text())
    common.write_pages(args, result.report(facts=[("files", f"{args.estimate.name}, {args.reference.name}")]))
    return 0


def _refuse_mixed_up_files(args: argparse.Namespace) -> None:
    from plumbob.core.errors import ParameterError
    from plumbob.core.files import is_same_file

    if is_same_file(args.estimate, args.reference):
        raise ParameterError(f"{args.estimate} is both estimate and reference; name the track of 'plumbob run' first.")
    common.check_pages(args, inputs=(args.estimate, args.reference, args.profile))


def alignments(text: str) -> tuple[str, ...]:
    """Words of a comma list, each a known alignment."""
    from plumbob.core import check

    words = tuple(word.strip() for word in text.split(",") if word.strip())
    return tuple(check.one_of("--align", word, ALIGNMENTS) for word in words)
