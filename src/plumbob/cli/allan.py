"""plumbob allan: the noise of a sensor at rest, from a static record to the figures of a data sheet."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from plumbob.cli import common

if TYPE_CHECKING:
    from plumbob.noise.allan import Noise

KINDS = ("oadev", "adev", "mdev", "ohdev", "hdev", "totdev")
"""As `plumbob.noise.KINDS`, which a help text shall not import."""

RAW_TYPES = ("f32", "f64", "i8", "i16", "i32", "i64", "u8", "u16", "u32")
"""As `plumbob.files.numbers.RAW`."""

ALONE = {
    "after": (
        "compares deviations and finds no coefficients",
        ("card", "kalibr", "device", "paper", "deviation", "methods", "curve"),
    ),
    "deviation": (
        "prints that deviation and finds no coefficients",
        ("card", "kalibr", "device", "paper", "methods", "curve", "html", "plot"),
    ),
    "paper": ("prints that table", ("json", "methods", "curve")),
}
"""Options that do one thing only: what it is, and the options that would be ignored beside them."""

ROSTOPIC = "/imu0"

NEEDS = {"device": ("card", "html"), "topic": ("kalibr",)}
"""Options that say something about an output, and the outputs that say it."""

EPILOG = """\
A recording (.parquet, .csv with its profile, .mcap, BROAD) brings its time and units. Plain numbers (text, .npy, or raw
.f32, .f64, .i16, ...) need --rate and --scale; nothing is guessed:
  plumbob allan gyro.txt --rate 100Hz --scale '0.00875 deg/s'    counts of 0.00875 deg/s
  plumbob allan gyro.txt --rate 100Hz --scale '1 deg/s'          numbers in deg/s
  plumbob allan raw.txt --rate 10Hz --scale '1 deg/s' --after filtered.txt
  plumbob allan static.parquet --after static.parquet --calibration card.json    before and after the calibration
"""


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "allan",
        help="analyse the noise of a sensor at rest: Allan deviation, coefficients of a data sheet, noise card",
        description="Analyse the noise of a static record: Allan deviation with honest intervals, coefficients Q, N, "
        "B, K and R by likelihood, least squares and lines, and what the record is too short to show.",
        epilog=common.more("plumbob allan static.parquet --html noise.html --card noise.json", "noise.md", EPILOG),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    p.add_argument("file", type=Path, metavar="FILE", help="recording, or file of numbers")
    _add_input(p)
    p.add_argument("--taus", metavar="S,...|all", help="averaging times of the curve, s; or every one (default: log)")
    p.add_argument("--deviation", choices=KINDS, help="print this deviation alone, without coefficients")
    p.add_argument("--after", type=Path, metavar="FILE", help="the same channels filtered: compare before and after")
    p.add_argument("--methods", action="store_true", help="show the three methods side by side")
    p.add_argument("--curve", action="store_true", help="show the deviation itself, by averaging time")
    p.add_argument("--paper", choices=("fin",), help="report as the bionic-fin paper's table 1")
    common.add_page(p)
    p.add_argument("--card", type=Path, metavar="JSON", help="also write a noise card for the simulator and filters")
    p.add_argument("--kalibr", type=Path, metavar="YAML", help="also write Kalibr's imu.yaml")
    p.add_argument("--topic", metavar="NAME", help=f"rostopic of imu.yaml (default {ROSTOPIC})")
    p.add_argument("--device", metavar="NAME", help="the unit's name on card and page (default: the file's)")
    common.add_force(p)
    common.add_json(p)
    p.set_defaults(run=run)


def _add_input(p: argparse.ArgumentParser) -> None:
    p.add_argument("--rate", metavar="HZ", help="sampling rate of a file of plain numbers, as 100Hz")
    p.add_argument("--scale", metavar="LSB", help="unit of the plain numbers, as '0.00875 deg/s'; '1' for none")
    p.add_argument(
        "--type",
        metavar="TYPE",
        help=f"of numbers, where the suffix does not say it: {', '.join(RAW_TYPES)}, npy, text",
    )
    p.add_argument("--columns", type=int, metavar="K", help="numbers in a row of a raw file")
    common.add_profile(p)
    common.add_calibration(
        p, "calibration card to apply first; with --after to that file alone, which may be FILE itself"
    )
    p.add_argument("--triads", metavar="A,B", help="which sensors of a recording (default all)")
    p.add_argument("--from", dest="start", metavar="S", help="begin so far into the record, as 10s")
    p.add_argument("--to", dest="stop", metavar="S", help="end there, as 2h")
    p.add_argument("--skip", metavar="S..S,...", help="leave these seconds out, as 12s..14s; disturbed ones are anyway")


def run(args: argparse.Namespace) -> int:
    """Do it."""
    _refuse_what_does_not_go_together(args)
    _check_outputs(args)
    if args.after is not None:
        return _compare(args)
    if args.deviation is not None:
        return _deviation_alone(args)
    from plumbob.door.allan import allan

    with common.progress_bars() as bars:
        noise = allan(**_static(args, args.file, card=args.calibration), taus=_taus(args.taus), progress=bars)
    _print(args, noise)
    _write(args, noise)
    return 0


def _refuse_what_does_not_go_together(args: argparse.Namespace) -> None:
    from plumbob.core.errors import ParameterError

    for name, (does, others) in ALONE.items():
        given = [f"--{other}" for other in others if getattr(args, other)]
        if getattr(args, name) and given:
            raise ParameterError(f"--{name} {does}, so it does not go with {', '.join(given)}.")
    for name, outputs in NEEDS.items():
        if getattr(args, name) and not any(getattr(args, output) for output in outputs):
            raise ParameterError(f"--{name} is for --{' or --'.join(outputs)}, which is not given; leave it out.")


def _check_outputs(args: argparse.Namespace) -> None:
    """Refuse, before a long analysis, what could not be written or would be lost."""
    from plumbob.data.cards import NoiseCard

    if args.card is not None:
        NoiseCard.require_place(args.card)
    inputs = (args.file, args.after, args.profile, args.calibration)
    common.check_pages(args, args.card, args.kalibr, inputs=inputs)


def _static(args: argparse.Namespace, path: Path, *, card: Path | None) -> dict[str, Any]:
    """What the options say of a record, as `plumbob.allan` takes it."""
    from plumbob.data import TRIADS

    _refuse_what_is_for_recordings(args, path)
    triads = TRIADS if args.triads is None else tuple(w.strip() for w in args.triads.split(",") if w.strip())
    return {
        "record": path,
        "rate": args.rate,
        "scale": args.scale,
        "profile": args.profile,
        "calibration": card,
        "triads": triads,
        "start": args.start,
        "stop": args.stop,
        "skip": _times(args.skip),
        "kind": args.type,
        "columns": args.columns,
        "note": common.note,
    }


def _times(text: str | None) -> list[tuple[float, float]]:
    """Times to skip, as "12s..14s, 1min..65s"."""
    from plumbob.core.errors import ParameterError
    from plumbob.core.units import Quantity, parse

    spans = []
    for word in (text or "").split(","):
        if not word.strip():
            continue
        ends = word.split("..")
        if len(ends) != 2:
            raise ParameterError(f"--skip needs times as 12s..14s, separated by commas, but got '{word.strip()}'.")
        spans.append((parse(ends[0].strip(), Quantity.TIME), parse(ends[1].strip(), Quantity.TIME)))
    return spans


def _refuse_what_is_for_recordings(args: argparse.Namespace, path: Path) -> None:
    from plumbob.core.errors import ParameterError
    from plumbob.door.allan import is_recording

    named = [f"--{name}" for name in ("triads", "profile", "calibration") if getattr(args, name) is not None]
    if named and path.is_file() and not is_recording(path, args.profile, args.type):
        raise ParameterError(f"{path} holds plain numbers, but {', '.join(named)} is for recordings. Leave it out.")


def _taus(text: str | None) -> "Sequence[float] | Literal['all'] | None":
    from plumbob.core.errors import ParameterError
    from plumbob.core.units import Quantity, parse

    if text is None:
        return None
    if text.strip() == "all":
        return "all"
    times = [parse(word, Quantity.TIME) for word in text.split(",") if word.strip()]
    if not times or any(not t > 0.0 for t in times):
        raise ParameterError(
            f"--taus needs averaging times above 0 s, separated by commas, or 'all', but got '{text}'."
        )
    return times


def _print(args: argparse.Namespace, noise: "Noise") -> None:
    if args.json:
        common.print_json(noise.summary())
    elif args.paper == "fin":
        from plumbob.papers.fin.datasheet import fin_report

        print(fin_report(noise.analyses).text())
    else:
        details = {"methods": args.methods, "curve": args.curve or args.taus is not None}
        print(noise.text(*(detail for detail, wanted in details.items() if wanted)))


def _write(args: argparse.Namespace, noise: "Noise") -> None:
    """Write files after the figures, which need neither matplotlib nor a place to write."""
    from dataclasses import replace

    from plumbob.core.files import write_text

    report = noise.report(device=args.device)
    if args.paper == "fin":
        from plumbob.papers.fin.datasheet import fin_report

        report = replace(report, parts=[*report.parts, fin_report(noise.analyses)])
    common.write_pages(args, report)
    if args.card is not None:
        noise.card(args.device).save(args.card, overwrite=args.force)
    if args.kalibr is not None:
        from plumbob.noise.card import kalibr_yaml

        text = kalibr_yaml(noise.analyses, rostopic=args.topic or ROSTOPIC, source=noise.source)
        write_text(args.kalibr, text, overwrite=args.force)
    for name in ("card", "kalibr"):
        if not args.json and getattr(args, name) is not None:
            print(f"{name:12} {getattr(args, name)}")


def _deviation_alone(args: argparse.Namespace) -> int:
    from plumbob.door.allan import open_static
    from plumbob.noise.allan import deviations
    from plumbob.noise.report import curve_numbers, curves_report

    with common.progress_bars() as bars:
        record, report, card = open_static(**_static(args, args.file, card=args.calibration), progress=bars)
    curves = deviations(record, report, args.deviation, taus=_taus(args.taus))
    if args.json:
        about = {"file": str(record.path), "calibration": card, "deviation": args.deviation}
        common.print_json({**about, **curve_numbers(curves)})
    else:
        print(curves_report(curves).text())
    return 0


def _compare(args: argparse.Namespace) -> int:
    from plumbob.core.version import __version__
    from plumbob.door.allan import open_static
    from plumbob.noise.allan import comparisons
    from plumbob.noise.report import comparison, comparison_numbers

    with common.progress_bars() as bars:
        record, checked, _ = open_static(**_static(args, args.file, card=None), progress=bars)
        after, judged, card = open_static(**_static(args, args.after, card=args.calibration), progress=bars)
    pairs = comparisons((record, checked), (after, judged), taus=_taus(args.taus))
    facts = {
        "before": record.path.name,
        "after": after.path.name if card is None else f"{after.path.name}, calibrated with {card}",
        "made by": f"plumbob {__version__}",
    }
    report = comparison(pairs, facts=list(facts.items()))
    if args.json:
        about = {"before": str(record.path), "after": str(after.path), "calibration": card}
        common.print_json({**about, **comparison_numbers(pairs)})
    else:
        print(report.text())
    common.write_pages(args, report)
    return 0
