"""plumbob calibrate: from a capture to a calibration card, or to the reason why there is none."""

import argparse
from importlib import import_module

from plumbob.cli import common

KINDS: tuple[str, ...] = ("hand", "mag", "accel", "gyro", "table", "temperature", "mount", "statictest")
"""What can be calibrated: each has its file in `plumbob.cli.calibrating`, which says how under `find`."""

LIVE = (
    "--live follows a KIND that has a guide: mag, accel or gyro, as in "
    "'plumbob calibrate mag --live --port /dev/ttyUSB0 --format buoy --device ID --out card.json'"
)

EPILOG = """\
A card grows: --calibration card.json applies what is known so far to the other triads, and --out gets it with the new
part added. Captures that cannot calibrate anything are refused with the reason, exit code 1, and no card is written.
"""


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb and its kinds."""
    p = verbs.add_parser(
        "calibrate",
        help="calibrate a unit from a capture by hand or in the laboratory",
        description="Calibrate a unit from a capture: the card corrects every later recording of this unit.",
        epilog=common.more("plumbob calibrate hand capture.parquet --out card.json", "calibration.md", EPILOG),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    p.add_argument("--live", dest="live_first", action="store_true", help=argparse.SUPPRESS)
    kinds = p.add_subparsers(dest="kind", metavar="KIND")
    for kind in KINDS:
        import_module(f"plumbob.cli.calibrating.{kind}").add_parser(kinds)
    p.set_defaults(run=run, usage=p)


def run(args: argparse.Namespace) -> int:
    """Do it; a refusal is a result, with its reasons."""
    if args.kind is None or args.live_first:
        args.usage.error(LIVE if args.live_first else f"name a KIND: {', '.join(KINDS)}")
    from plumbob.calibration.rejection import CaptureRefusedError
    from plumbob.cli.calibrating.capture import refused

    try:
        code: int = args.find(args)
    except CaptureRefusedError as why:
        return refused(args, why)
    return code
