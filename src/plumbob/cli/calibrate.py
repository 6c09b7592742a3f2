"""plumbob calibrate: from a capture to a calibration card, or to the reason why there is none."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from plumbob.cli import capture, common

if TYPE_CHECKING:
    from plumbob.cli.engine import Verb
    from plumbob.data import AttitudeTrack
    from plumbob.data.recording import Recording

GUIDED: Final = ("accel", "gyro", "mag")
_ABSENT: Final = ("profile", "calibration", "start", "stop", "device", "port", "rate", "time", "iio", "format", "unit")
"""Options that capture asks for, whatever the kind."""


def calibrate(args: argparse.Namespace, verb: "Verb", call: Callable[..., Any]) -> int:
    """Do it; a refusal is a result, with its reasons."""
    from plumbob.calibration.fit import CaptureRefusedError

    args.told, args.guided = {}, args.kind if args.kind in GUIDED else None
    for name in ("live", "guide", "raw", *_ABSENT):
        setattr(args, name, getattr(args, name, None))
    for name in (
        "recording",
        "profile",
        "calibration",
        "out",
        "html",
        "plot",
        "raw",
        "plan",
        "parts",
        "reference",
        "estimate",
    ):
        value = getattr(args, name, None)
        setattr(args, name, None if value is None else Path(value))
    args.file = args.recording
    if getattr(args, "counts", False):
        from plumbob.cli.engine import show
        from plumbob.door.calibrate import calibrate_counts

        return show(
            args, verb._replace(pages=None), calibrate_counts(args.file, "acc" if args.kind == "accel" else args.kind)
        )
    try:
        return _find(args)
    except CaptureRefusedError as why:
        return capture.refused(args, why)


def _find(args: argparse.Namespace) -> int:
    from plumbob.core.errors import ParameterError

    if args.kind == "mag" and args.live and hasattr(args, "in_use"):
        raise ParameterError("--in-use takes a recording of a unit at work and does not go with --live; record first.")
    if args.kind == "gyro":
        return _find_gyro(args)
    rates = {"rates": _rates(args.rates)} if hasattr(args, "rates") else {}
    spans = {name: common.span(getattr(args, name)) for name in ("level", "raised") if hasattr(args, name)}
    return capture.find(args, args.kind, (args.plan, args.reference, args.estimate), **rates, **spans)


def _find_gyro(args: argparse.Namespace) -> int:
    _refuse_idle(args)
    if getattr(args, "method", "auto") != "ferraris":
        return capture.find(args, "gyro")
    from plumbob.files.text import read_labels

    labels = None if args.part_column is None else read_labels(args.file, args.part_column, args.profile)
    return capture.find(args, "ferraris", (args.parts,), labels=labels)


def _refuse_idle(args: argparse.Namespace) -> None:
    """Refuse options that would have no effect."""
    from plumbob.core.errors import ParameterError

    method, preset = getattr(args, "method", "auto"), getattr(args, "preset", None)
    if args.live and method not in ("auto", "rest"):
        raise ParameterError(f"--live guides a rest only; record for --method {method}, and give the recording.")
    if preset and method != "auto":
        raise ParameterError(f"--preset {preset} is a method of its own; leave --method {method} out.")
    given = [
        f"--{name.replace('_', '-')}"
        for name in ("parts", "part_column", "angle")
        if getattr(args, name, None) is not None
    ]
    if given and method != "ferraris":
        raise ParameterError(f"{given[0]} belongs to --method ferraris; name that, or leave it out.")
    if args.parts and args.part_column:
        raise ParameterError("--parts and --part-column both name the parts. Give one of them.")
    if args.part_column and (args.start is not None or args.stop is not None):
        raise ParameterError("--part-column names the part of every sample, so --from and --to are not for it.")


def _rates(text: str) -> list[float]:
    """Rates of a list whose last one carries the unit for all."""
    from plumbob.core.units import Quantity, parse, split

    *others, last = (word.strip() for word in text.split(","))
    unit = split(last)[1]
    return [parse(word if split(word)[1] else f"{word} {unit}".strip(), Quantity.RATE) for word in (*others, last)]


def add_statictest(kinds: common.Adder) -> None:
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
    common.add_page(p)
    common.add_force(p)
    common.add_json(p)
    p.set_defaults(run=find_statictest, parser=p)


def find_statictest(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.calibration.calibration import capture
    from plumbob.core.errors import CalibrationError
    from plumbob.core.units import Quantity, parse
    from plumbob.data.cards import CalibrationCard
    from plumbob.papers.buoy.static_test import static_test

    inputs = (args.file, args.reference, args.calibration, args.profile)
    common.check_pages(args, inputs=inputs)
    recording = common.read(args.file, args.profile)
    if recording.imu is None:
        raise CalibrationError(f"{args.file} holds an attitude but no sensor data, so there is nothing to test.")
    result = static_test(
        capture(recording.imu, triads=("acc", "mag"), device=args.device).imu,
        _reference(args, recording),
        CalibrationCard.load(args.calibration),
        align=common.alignments(args.align),
        declination=None if args.declination is None else parse(args.declination, Quantity.ANGLE),
    )
    facts = {
        "recording": args.file.name,
        "reference": f"{(args.reference or args.file).name}: {result.before.reference.source}",
        "calibration": args.calibration.name,
    }
    report = result.report(facts=list(facts.items()))
    common.print_json({"file": str(args.file), **result.as_dict()}) if args.json else print(report.text())
    common.write_pages(args, report)
    return 0


def _reference(args: argparse.Namespace, recording: "Recording") -> "AttitudeTrack":
    from plumbob.core.errors import ShapeError

    track = recording.track if args.reference is None else common.read(args.reference).track
    if track is None:
        where = args.reference or args.file
        raise ShapeError(f"{where} holds no attitude to compare with; name a track or recording with --reference.")
    return track
