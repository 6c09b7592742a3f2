"""plumbob eval: an estimate against a reference."""

import argparse
from pathlib import Path
from typing import Any

from plumbob.cli import common

ALIGNMENTS = ("heading", "mounting", "time")


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "eval",
        help="errors of an estimate against a reference",
        description="Compare an estimated attitude with a reference: total, heading and inclination error, and each "
        "axis. Nothing is aligned unless asked for: a constant heading offset counts.",
    )
    p.add_argument("estimate", type=Path, help="track written by 'plumbob run'")
    p.add_argument("reference", type=Path, help="track, or a recording that carries a reference")
    p.add_argument("--align", default="", metavar="A,B", help=f"remove first: any of {', '.join(ALIGNMENTS)}")
    p.add_argument("--settle", type=float, default=0.0, metavar="S", help="leave out the first S seconds (default 0)")
    p.add_argument("--max-gap", type=float, metavar="S", help="do not interpolate across longer reference gaps, s")
    p.add_argument("--declination", metavar="ANGLE", help="magnetic declination with unit, east positive, as in 3.2deg")
    common.add_profile(p)
    p.add_argument("--html", type=Path, metavar="FILE", help="write a page with plots that opens offline")
    common.add_json(p)
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.evaluate import evaluate

    estimate = _track(args.estimate, None)
    reference = _track(args.reference, args.profile)
    result = evaluate(
        estimate,
        reference,
        align=alignments(args.align),
        max_gap=args.max_gap,
        declination=_angle(args.declination),
        settle=args.settle,
    )
    if args.html:
        from plumbob.evaluate import write_html

        facts = {"estimate": f"{args.estimate.name}: {estimate.source}", "reference": args.reference.name}
        write_html(
            args.html, {args.estimate.stem: result}, title=f"{args.estimate.name} against a reference", facts=facts
        )
    if args.json:
        common.print_json(result.summary())
    else:
        print(result.text())
        if args.html:
            print(f"page         {args.html}")
    return 0


def _track(path: Path, profile: Path | None) -> Any:
    from plumbob.errors import ShapeError

    recording = common.read(path, profile)
    if recording.track is None:
        raise ShapeError(f"{path} holds sensor data but no attitude; run a filter on it first: plumbob run {path} ...")
    return recording.track


def alignments(text: str) -> tuple[str, ...]:
    """Words of a comma list, each a known alignment."""
    from plumbob import check

    words = tuple(word.strip() for word in text.split(",") if word.strip())
    return tuple(check.one_of("--align", word, ALIGNMENTS) for word in words)


def _angle(text: str | None) -> float | None:
    from plumbob.units import Quantity, parse

    return None if text is None else parse(text, Quantity.ANGLE)
