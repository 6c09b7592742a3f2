"""plumbob calibrate mount: how the unit sits on its body."""

import argparse
from pathlib import Path

from plumbob.cli import common
from plumbob.cli.calibrating import capture


def add_parser(kinds: common.Adder) -> None:
    """Declare the kind."""
    p = kinds.add_parser(
        "mount",
        help="how the unit sits on its body, from two poses at rest or a reference",
        description="Find the rotation from the axes of the unit to those of its body: rest with the body level, raise "
        "its nose by 15° to 60° about the lateral axis, and rest again; or compare with a reference attitude.",
        epilog=common.more(
            "plumbob calibrate mount raise.parquet --frame NED --calibration card.json --out card.json",
            "calibration.md",
        ),
    )
    capture.add_options(p)
    common.add_frame(p, "body axes: z down in NED, z up in ENU and NWU; needed for poses")
    p.add_argument("--level", metavar="A..B", help="when the body was level, as 0s..5s (default: first rest)")
    p.add_argument("--raised", metavar="A..B", help="when its nose was raised (default: the rest that leans most)")
    p.add_argument(
        "--level-only", action="store_true", help="roll and pitch only; heading of the mounting taken as zero"
    )
    p.add_argument("--reference", type=Path, metavar="FILE", help="attitude of the body; with --estimate")
    p.add_argument(
        "--estimate", type=Path, metavar="FILE", help="attitude of the unit, as 'plumbob run --out' writes it"
    )
    p.set_defaults(find=find)


def find(args: argparse.Namespace) -> int:
    """Do it."""
    level, raised = (None if text is None else _span(text) for text in (args.level, args.raised))
    found = capture.calibrated(
        args,
        "mount",
        (args.reference, args.estimate),
        frame=args.frame,
        level=level,
        raised=raised,
        level_only=args.level_only,
        estimate=args.estimate,
        reference=args.reference,
    )
    return capture.finish(args, found)


def _span(text: str) -> tuple[float, float]:
    from plumbob.core.errors import ParameterError
    from plumbob.core.units import Quantity, parse

    first, dots, last = text.partition("..")
    if not dots:
        raise ParameterError(f"a span is written as 0s..5s, but it is '{text}'.")
    return parse(first, Quantity.TIME), parse(last, Quantity.TIME)
