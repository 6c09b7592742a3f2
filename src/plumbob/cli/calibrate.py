"""plumbob calibrate: from a capture to a calibration card, or to the reason why there is none."""

import argparse
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from plumbob.cli import capture, common

if TYPE_CHECKING:
    from plumbob.data import AttitudeTrack
    from plumbob.data.recording import Recording

KINDS: tuple[str, ...] = ("hand", "mag", "accel", "gyro", "table", "temperature", "mount", "statictest")
"""What can be calibrated: `add_` declares it."""

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
    for add in (add_hand, add_mag, add_accel, add_gyro, add_table, add_temperature, add_mount, add_statictest):
        add(kinds)
    p.set_defaults(run=run, usage=p)


def run(args: argparse.Namespace) -> int:
    """Do it; a refusal is a result, with its reasons."""
    if args.kind is None or args.live_first:
        args.usage.error(LIVE if args.live_first else f"name a KIND: {', '.join(KINDS)}")
    from plumbob.calibration.fit import CaptureRefusedError

    try:
        code: int = args.find(args)
    except CaptureRefusedError as why:
        return capture.refused(args, why)
    return code


ACCEL = """\
Hold the unit still for 2 s or more in each of 18 poses, or in 40 any: every face and every edge of its case once up.
No pose has to be exact. Six faces give bias and scale only; nine poses and more give the misalignment of the axes too.
A capture that never rests is calibrated with --moving, where a gyroscope stands beside the accelerometer: turn the unit
slowly (20 to 30 deg/s) about all its axes for two minutes, close to the wrist. Poses at rest are several times better.
Gravity is the standard one unless --gravity or --latitude says better; it sets the scale, and moves no horizon.
"""


def add_accel(kinds: common.Adder) -> None:
    """Declare the kind."""
    p = kinds.add_parser(
        "accel",
        help="accelerometer: bias, scale and misalignment from poses at rest",
        description="Calibrate the accelerometer from a capture in which the unit rests in many poses; they are found.",
        epilog=common.more(
            "plumbob calibrate accel poses.parquet --calibration card.json --out card.json", "calibration.md", ACCEL
        ),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    capture.add_options(p, guide="accel")
    p.add_argument(
        "--shape",
        choices=("auto", "six", "axes", "ellipsoid"),
        default="auto",
        help="six or axes: bias and scale, from pairs of faces or any poses; ellipsoid: misalignment too",
    )
    p.add_argument("--moving", action="store_true", help="turned slowly without rests, beside a gyroscope")
    capture.add_gravity(p)
    p.set_defaults(find=partial(capture.find, kind="accel"))


GYRO = """\
rest      30 s at rest: bias.
hand      30 s at rest, then 20 quarter or half turns about all axes with 2 s of rest after each: bias, scale and axes
          against the accelerometer, whose card is given with --calibration.
ferraris  six faces at rest and a turn by --angle about each axis while it stands on end: accelerometer and gyroscope.
          The parts x_p x_a y_p y_a z_p z_a (axis up, axis down) and x_rot y_rot z_rot are looked for, or named by
          --parts FILE.csv (part,from_s,to_s) or by --part-column NAME of a text file.
"""


def add_gyro(kinds: common.Adder) -> None:
    """Declare the kind."""
    p = kinds.add_parser(
        "gyro",
        help="gyroscope: bias, scale and axes, without a table",
        description="Calibrate a gyroscope without a table.",
        epilog=common.more(
            "plumbob calibrate gyro rest.parquet --method rest --calibration card.json --out card.json",
            "calibration.md",
            GYRO,
        ),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    capture.add_options(p, guide="gyro")
    p.add_argument(
        "--method", choices=("auto", "rest", "hand", "ferraris"), default="auto", help="how; auto says which"
    )
    p.add_argument(
        "--preset", choices=("trackball",), help="bias at rest with a paper's coefficients, not measured ones"
    )
    p.add_argument("--parts", type=Path, metavar="CSV", help="where the parts of a Ferraris session lie")
    p.add_argument("--part-column", metavar="NAME", help="column of a text file that names the parts")
    p.add_argument("--angle", metavar="ANGLE", help="of each turn of a Ferraris session; 360deg if not given")
    p.set_defaults(find=find_gyro)


def find_gyro(args: argparse.Namespace) -> int:
    """Do it."""
    _refuse_idle(args)
    if args.method != "ferraris":
        return capture.find(args, "gyro")
    from plumbob.files.text import read_labels

    labels = None if args.part_column is None else read_labels(args.file, args.part_column, args.profile)
    angle = args.angle or "360 deg"
    return capture.find(args, "ferraris", (args.parts,), labels=labels, angle=angle)


def _refuse_idle(args: argparse.Namespace) -> None:
    """Refuse options that would have no effect."""
    from plumbob.core.errors import ParameterError

    if args.live and args.method not in ("auto", "rest"):
        raise ParameterError(f"--live guides a rest only; record for --method {args.method}, and give the recording.")
    if args.preset and args.method != "auto":
        raise ParameterError(f"--preset {args.preset} is a method of its own; leave --method {args.method} out.")
    given = [
        f"--{name.replace('_', '-')}" for name in ("parts", "part_column", "angle") if getattr(args, name) is not None
    ]
    if given and args.method != "ferraris":
        raise ParameterError(f"{given[0]} belongs to --method ferraris; name that, or leave it out.")
    if args.parts and args.part_column:
        raise ParameterError("--parts and --part-column both name the parts. Give one of them.")
    if args.part_column and (args.start is not None or args.stop is not None):
        raise ParameterError("--part-column names the part of every sample, so --from and --to are not for it.")


HAND = """\
Away from iron, hold the unit still for 3 s in each of 18 poses, every face and every edge of its case once up, or in
40 any; turn it within a second or two in between, by a quarter or half a turn about another axis each time.
The accelerometer is calibrated by the poses, the gyroscope by the turns between them, the magnetometer by both. What
the recording lacks is left out. If one of them cannot be calibrated, no card is written; calibrate the others each.
"""


def add_hand(kinds: common.Adder) -> None:
    """Declare the kind."""
    p = kinds.add_parser(
        "hand",
        help="the whole unit: accelerometer, gyroscope and magnetometer from one capture by hand",
        description="Calibrate every triad of a unit from one capture of poses at rest with turns between them, as "
        "'plumbob sim poses' makes it: the accelerometer first, the others on what was found before.",
        epilog=common.more(
            "plumbob calibrate hand capture.parquet --out card.json --html card.html", "calibration.md", HAND
        ),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    capture.add_options(p)
    capture.add_gravity(p)
    capture.add_field(p)
    p.set_defaults(find=partial(capture.find, kind="hand"))


def add_mag(kinds: common.Adder) -> None:
    """Declare the kind."""
    p = kinds.add_parser(
        "mag",
        help="magnetometer: hard iron, soft iron, scale, turn against the accelerometer",
        description="Calibrate a magnetometer from a capture in which the unit was turned slowly through all "
        "attitudes, away from iron: each face and each edge once up. A card that would more likely harm than help is "
        "refused; --force writes it anyway.",
        epilog=common.more(
            "plumbob calibrate mag capture.parquet --calibration card.json --out card.json", "calibration.md"
        ),
    )
    capture.add_options(p, guide="mag")
    p.add_argument(
        "--with", dest="with_", default="auto", metavar="none|acc|gyr|auto", help="sensors that help (default auto)"
    )
    p.add_argument(
        "--shape",
        default="auto",
        metavar="auto|sphere|axes|ellipsoid|level",
        help="model of the distortion; auto tests which is needed (default), level is for a unit that cannot tilt",
    )
    p.add_argument(
        "--in-use",
        action="store_true",
        help="a long record of a unit at work, which nobody turned for it: hard and soft iron by the gyroscope, from "
        "moment to moment",
    )
    capture.add_field(p)
    p.add_argument("--tilt", metavar="ANGLE", help="inclination up to which headings count (default 45deg)")
    p.set_defaults(find=find_mag)


def find_mag(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.core.errors import ParameterError

    if args.in_use and args.live:
        raise ParameterError("--in-use takes a recording of a unit at work and does not go with --live; record first.")
    return capture.find(args, "mag")


def add_mount(kinds: common.Adder) -> None:
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
    p.set_defaults(find=find_mount)


def find_mount(args: argparse.Namespace) -> int:
    """Do it."""
    level, raised = (None if text is None else common.span(text) for text in (args.level, args.raised))
    return capture.find(args, "mount", (args.reference, args.estimate), level=level, raised=raised)


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
    p.set_defaults(find=find_statictest)


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


def add_table(kinds: common.Adder) -> None:
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
    group = p.add_mutually_exclusive_group(required=True)
    group.add_argument("--rates", metavar="R,…", help="rates of the table, as '50,100,200 deg/s'; plateaus are found")
    group.add_argument("--plan", type=Path, metavar="CSV", help="plateaus: from_s,to_s,rate_x_dps,… [,acc_x_g,…]")
    p.add_argument("--model", choices=("auto", "12", "21"), default="auto", help="21 parameters have g-sensitivity")
    p.add_argument("--mounting", default="0.1 deg", metavar="ANGLE", help="tilt of the unit on the table (0.1 deg)")
    p.add_argument("--latitude", metavar="ANGLE", help="of a table with a vertical axis; takes the Earth's rate out")
    p.set_defaults(find=find_table)


def find_table(args: argparse.Namespace) -> int:
    """Do it."""
    rates = None if args.rates is None else _rates(args.rates)
    return capture.find(args, "table", (args.plan,), rates=rates)


def _rates(text: str) -> list[float]:
    """Rates of a list whose last one carries the unit for all."""
    from plumbob.core.units import Quantity, parse, split

    *others, last = (word.strip() for word in text.split(","))
    unit = split(last)[1]
    return [parse(word if split(word)[1] else f"{word} {unit}".strip(), Quantity.RATE) for word in (*others, last)]


TEMPERATURE = """\
Let the unit lie still while it warms up and cools down again, over 10 K or more in half an hour or longer, and record
its temperature. The degree of the polynomial, 1 to 3, is the lowest that the record does not contradict.
"""


def add_temperature(kinds: common.Adder) -> None:
    """Declare the kind."""
    p = kinds.add_parser(
        "temperature",
        help="gyroscope: bias over temperature, from a soak at rest",
        description="Calibrate how the gyroscope's bias depends on temperature.",
        epilog=common.more(
            "plumbob calibrate temperature soak.parquet --calibration card.json --out card.json",
            "calibration.md",
            TEMPERATURE,
        ),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    capture.add_options(p, file="recording at rest over changing temperature")
    p.set_defaults(find=partial(capture.find, kind="temperature"))
