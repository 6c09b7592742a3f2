"""plumbob calibrate: from a capture to a calibration card, or to the reason why there is none."""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from plumbob.cli import capture, common

if TYPE_CHECKING:
    from plumbob.cli.engine import Verb
    from plumbob.data.recording import Recording
    from plumbob.papers.buoy.static_test import StaticTest
    from plumbob.reporting.report import Report

GUIDED: Final = ("accel", "gyro", "mag")
_ABSENT: Final = ("profile", "calibration", "start", "stop", "device", "port", "rate", "time", "iio", "format", "unit")
"""Options that capture asks for, whatever the kind."""


def calibrate(args: argparse.Namespace, verb: "Verb", call: Callable[..., Any]) -> int:
    """Do it; a refusal is a result, with its reasons."""
    from plumbob.calibration.fit import CaptureRefusedError
    from plumbob.core.errors import ParameterError

    args.told, args.guided = {}, args.kind if args.kind in GUIDED else None
    for name in ("live", "guide", "raw", *_ABSENT):
        setattr(args, name, getattr(args, name, None))
    for name in ("recording", "profile", "calibration", "out", "html", "plot", "raw"):
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
        if args.kind == "gyro":
            return _find_gyro(args)
        if args.kind == "mag" and args.live and hasattr(args, "in_use"):
            raise ParameterError(
                "--in-use takes a recording of a unit at work and does not go with --live; record first."
            )
        return capture.find(args, args.kind, **({"rates": _rates(args.rates)} if hasattr(args, "rates") else {}))
    except CaptureRefusedError as why:
        return capture.refused(args, why)


def _find_gyro(args: argparse.Namespace) -> int:
    _refuse_idle(args)
    if getattr(args, "method", "auto") != "ferraris":
        return capture.find(args, "gyro")
    from plumbob.files.text import read_labels

    labels = None if args.part_column is None else read_labels(args.file, args.part_column, args.profile)
    return capture.find(args, "ferraris", labels=labels)


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
    if hasattr(args, "parts") and args.part_column:
        raise ParameterError("--parts and --part-column both name the parts. Give one of them.")
    if args.part_column and (args.start is not None or args.stop is not None):
        raise ParameterError("--part-column names the part of every sample, so --from and --to are not for it.")


def _rates(text: str) -> list[float]:
    """Rates of a list whose last one carries the unit for all."""
    from plumbob.core.units import Quantity, parse, split

    *others, last = (word.strip() for word in text.split(","))
    unit = split(last)[1]
    return [parse(word if split(word)[1] else f"{word} {unit}".strip(), Quantity.RATE) for word in (*others, last)]


def static_test(
    recording: str | Path,
    *,
    calibration: str | Path,
    reference: str | Path | None = None,
    device: str | None = None,
    align: Sequence[str] = (),
    declination: float | str | None = None,
    profile: str | Path | None = None,
) -> "StaticTest":
    """Static test of the buoy paper.

    The unit rests in many poses, such as 36 steps of 10 degrees on a table that stands aslant ('plumbob sim table36').
    At each rest, tilt and compass are compared with a reference, as measured and with the card.

    Parameters
    ----------
    recording : path
        Recording with accelerometer and magnetometer.
    calibration : path
        Card of the unit.
    reference : path, optional
        Track, where the recording carries none itself.
    device : str, optional
        The unit, where the recording does not name it.
    align : sequence of str
        Remove first: heading, mounting; by default nothing.
    declination : float or str, optional
        Magnetic declination with unit, east positive, as 3.2deg.
    profile : path, optional
        What the columns of a CSV or text file mean.
    """
    from plumbob.calibration.calibration import capture
    from plumbob.core import check
    from plumbob.core.errors import CalibrationError, ShapeError
    from plumbob.core.units import Quantity, given
    from plumbob.data.cards import CalibrationCard
    from plumbob.papers.buoy.static_test import static_test

    for word in align:
        check.one_of("--align", word, ("heading", "mounting", "time"))
    measured = _read(recording, profile)
    if measured.imu is None:
        raise CalibrationError(f"{recording} holds an attitude but no sensor data, so there is nothing to test.")
    track = measured.track if reference is None else _read(reference).track
    if track is None:
        where = reference or recording
        raise ShapeError(f"{where} holds no attitude to compare with; name a track or recording with --reference.")
    return static_test(
        capture(measured.imu, triads=("acc", "mag"), device=device).imu,
        track,
        CalibrationCard.load(Path(calibration)),
        align=align,
        declination=given("declination", declination, Quantity.ANGLE),
    )


def _read(path: str | Path, profile: str | Path | None = None) -> "Recording":
    """Read a recording, and warn of what was found in its data."""
    from plumbob.data.recording import found_in
    from plumbob.door.reading import read

    recording = read(path, profile=None if profile is None else Path(profile)).of_unit(None)
    common.note(*(f"{Path(path).name}: {line}" for line in found_in(recording.notes)))
    return recording


def static_test_page(result: "StaticTest", args: argparse.Namespace) -> "Report":
    """Report of a static test, and where it comes from."""
    reference = Path(getattr(args, "reference", args.recording)).name
    facts = {
        "recording": Path(args.recording).name,
        "reference": f"{reference}: {result.before.reference.source}",
        "calibration": Path(args.calibration).name,
    }
    return result.report(facts=list(facts.items()))


def tested(args: argparse.Namespace, verb: "Verb", call: Callable[..., Any]) -> int:
    """Print the errors of all rests."""
    result = call()
    report = static_test_page(result, args)
    common.print_json({"file": args.recording, **result.summary()}) if args.json else print(report.text())
    common.write_pages(args, report)
    return 0
