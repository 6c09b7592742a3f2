"""plumbob allan: a record of a unit at rest, one deviation of it, or two records compared."""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from plumbob.cli import common

if TYPE_CHECKING:
    from plumbob.cli.engine import Verb
    from plumbob.noise.allan import Noise

Call = Callable[..., Any]
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


def allan(args: argparse.Namespace, verb: "Verb", call: Call) -> int:
    """Do what the options ask for."""
    from plumbob.data.cards import NoiseCard

    _refuse_what_does_not_go_together(args)
    if args.card is not None:
        NoiseCard.require_place(Path(args.card))
    cards = (Path(path) for path in (args.card, args.kalibr) if path is not None)
    common.check_pages(args, *cards, inputs=args.inputs)
    _refuse_what_is_for_recordings(
        args, Path(args.after or args.record if hasattr(args, "calibration") else args.record)
    )
    words = {"skip": _times(args.skip) if hasattr(args, "skip") else (), "taus": _taus(getattr(args, "taus", None))}
    if args.after is not None:
        return _compare(args, call, words)
    if args.deviation is not None:
        return _deviation_alone(args, call, words)
    noise = call(**words)
    _print(args, noise)
    _write(args, noise)
    return 0


def _refuse_what_does_not_go_together(args: argparse.Namespace) -> None:
    from plumbob.core.errors import ParameterError

    for name, (does, others) in ALONE.items():
        given = [f"--{other}" for other in others if getattr(args, other, None)]
        if getattr(args, name) and given:
            raise ParameterError(f"--{name} {does}, so it does not go with {', '.join(given)}.")
    for name, outputs in NEEDS.items():
        if getattr(args, name) and not any(getattr(args, output) for output in outputs):
            raise ParameterError(f"--{name} is for --{' or --'.join(outputs)}, which is not given; leave it out.")


def _times(text: str) -> list[tuple[float, float]]:
    """Times to skip, as "12s..14s, 1min..65s"."""
    from plumbob.core.errors import ParameterError
    from plumbob.core.units import Quantity, parse

    spans = []
    for word in text.split(","):
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

    named = [f"--{name}" for name in ("triads", "profile", "calibration") if hasattr(args, name)]
    if named and path.is_file() and not is_recording(path, getattr(args, "profile", None), getattr(args, "kind", None)):
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
        details = {"methods": args.methods, "curve": args.curve or hasattr(args, "taus")}
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
        noise.card(args.device).save(Path(args.card), overwrite=args.force)
    if args.kalibr is not None:
        from plumbob.noise.card import kalibr_yaml

        text = kalibr_yaml(noise.analyses, rostopic=args.topic or ROSTOPIC, source=noise.source)
        write_text(Path(args.kalibr), text, overwrite=args.force)
    for name in ("card", "kalibr"):
        if not args.json and getattr(args, name) is not None:
            print(f"{name:12} {getattr(args, name)}")


def _deviation_alone(args: argparse.Namespace, call: Call, words: dict[str, Any]) -> int:
    from plumbob.core import check
    from plumbob.door.allan import open_static
    from plumbob.noise import KINDS
    from plumbob.noise.allan import deviations
    from plumbob.noise.report import curve_numbers, curves_report

    kind = check.one_of("--deviation", args.deviation, KINDS)
    record, report, card = call(open_static, skip=words["skip"])
    curves = deviations(record, report, kind, taus=words["taus"])
    if args.json:
        about = {"file": str(record.path), "calibration": card, "deviation": kind}
        common.print_json({**about, **curve_numbers(curves)})
    else:
        print(curves_report(curves).text())
    return 0


def _compare(args: argparse.Namespace, call: Call, words: dict[str, Any]) -> int:
    from plumbob.core import __version__
    from plumbob.door.allan import open_static
    from plumbob.noise.allan import comparisons
    from plumbob.noise.report import comparison, comparison_numbers

    record, checked, _ = call(open_static, skip=words["skip"], calibration=None)
    after, judged, card = call(open_static, skip=words["skip"], record=args.after)
    pairs = comparisons((record, checked), (after, judged), taus=words["taus"])
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
