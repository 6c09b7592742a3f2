"""plumbob calibrate statictest: what a card is worth, on a table that is turned step by step against a reference."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from plumbob.cli import common

if TYPE_CHECKING:
    from plumbob.calibration.static_test import StaticTest
    from plumbob.data import AttitudeTrack
    from plumbob.files import Recording


def add_parser(kinds: common.Adder) -> None:
    """Declare the kind."""
    p = kinds.add_parser(
        "statictest",
        help="errors at rest against a reference, before and after a card; writes no card",
        description="Static test of the buoy paper: the unit rests in many poses, such as 36 steps of 10 degrees on a "
        "table that stands aslant ('plumbob sim table36'). At each rest, tilt and compass are compared with a "
        "reference, as measured and with the card.",
        epilog=common.more(
            "plumbob calibrate statictest table36.parquet --calibration card.json --html statictest.html",
            "calibration.md",
        ),
    )
    p.add_argument("file", type=Path, metavar="INPUT", help="recording with accelerometer and magnetometer")
    p.add_argument("--calibration", type=Path, required=True, metavar="JSON", help="card of the unit")
    p.add_argument("--reference", type=Path, metavar="FILE", help="track, where INPUT carries none itself")
    p.add_argument("--device", metavar="ID", help="the unit, where the recording does not name it")
    p.add_argument("--align", default="", metavar="A,B", help="remove first: heading, mounting (default nothing)")
    p.add_argument("--declination", metavar="ANGLE", help="magnetic declination with unit, east positive, as 3.2deg")
    common.add_profile(p)
    p.add_argument("--html", type=Path, metavar="FILE", help="write a page with plots that opens offline")
    common.add_force(p)
    common.add_json(p)
    p.set_defaults(find=find)


def find(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.calibration.calibration import capture
    from plumbob.calibration.static_test import static_test
    from plumbob.cli.eval import alignments
    from plumbob.core.errors import CalibrationError
    from plumbob.core.units import Quantity, parse
    from plumbob.data.cards import CalibrationCard

    inputs = (args.file, args.reference, args.calibration, args.profile)
    common.check_outputs(args, args.html, inputs=inputs)
    recording = common.read(args.file, args.profile)
    if recording.imu is None:
        raise CalibrationError(f"{args.file} holds an attitude but no sensor data, so there is nothing to test.")
    result = static_test(
        capture(recording.imu, triads=("acc", "mag"), device=args.device).imu,
        _reference(args, recording),
        CalibrationCard.load(args.calibration),
        align=alignments(args.align),
        declination=None if args.declination is None else parse(args.declination, Quantity.ANGLE),
    )
    common.print_json({"file": str(args.file), **result.as_dict()}) if args.json else print(result.text())
    if args.html:
        _write_page(args, result)
    return 0


def _reference(args: argparse.Namespace, recording: "Recording") -> "AttitudeTrack":
    from plumbob.core.errors import ShapeError

    track = recording.track if args.reference is None else common.read(args.reference).track
    if track is None:
        where = args.reference or args.file
        raise ShapeError(f"{where} holds no attitude to compare with; name a track or recording with --reference.")
    return track


def _write_page(args: argparse.Namespace, result: "StaticTest") -> None:
    from plumbob.calibration.static_test_html import write_static_test

    facts = {
        "recording": args.file.name,
        "reference": f"{(args.reference or args.file).name}: {result.before.reference.source}",
        "calibration": args.calibration.name,
    }
    title = f"Static test of {args.file.name}"
    write_static_test(args.html, result, title=title, facts=facts, overwrite=args.force)
    if not args.json:
        print(f"page         {args.html}")
