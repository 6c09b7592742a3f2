"""plumbob calibrate table: gyroscope from a session on a rate table."""

import argparse
from pathlib import Path

from plumbob.cli import common
from plumbob.cli.calibrating import capture


def add_parser(kinds: common.Adder) -> None:
    """Declare the kind."""
    p = kinds.add_parser(
        "table",
        help="gyroscope on a rate table: bias, scale, misalignment, g-sensitivity",
        description="Calibrate the gyroscope from plateaus of known rates about known axes.",
        epilog=common.more(
            "plumbob calibrate table session.parquet --rates '50,100,200 deg/s' --out card.json", "calibration.md"
        ),
    )
    capture.add_options(p, file="recording of the session")
    told = p.add_mutually_exclusive_group(required=True)
    told.add_argument("--rates", metavar="R,…", help="rates of the table, as '50,100,200 deg/s'; plateaus are found")
    told.add_argument("--plan", type=Path, metavar="CSV", help="plateaus: from_s,to_s,rate_x_dps,… [,acc_x_g,…]")
    p.add_argument("--model", choices=("auto", "12", "21"), default="auto", help="21 parameters have g-sensitivity")
    p.add_argument("--mounting", default="0.1 deg", metavar="ANGLE", help="tilt of the unit on the table (0.1 deg)")
    p.add_argument("--latitude", metavar="ANGLE", help="of a table with a vertical axis; takes the Earth's rate out")
    p.set_defaults(find=find)


def find(args: argparse.Namespace) -> int:
    """Do it."""
    rates = None if args.rates is None else _rates(args.rates)
    found = capture.calibrated(
        args,
        "table",
        (args.plan,),
        rates=rates,
        plan=args.plan,
        model=args.model,
        mounting=args.mounting,
        latitude=args.latitude,
    )
    return capture.finish(args, found)


def _rates(text: str) -> list[float]:
    """Rates of a list whose last one carries the unit for all."""
    from plumbob.core.units import Quantity, parse, split

    *others, last = (one.strip() for one in text.split(","))
    unit = split(last)[1]
    return [parse(one if split(one)[1] else f"{one} {unit}".strip(), Quantity.RATE) for one in (*others, last)]
