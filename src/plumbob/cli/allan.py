"""plumbob allan: a record of a unit at rest, one deviation of it, or two records compared."""

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plumbob.cli import common
from plumbob.core import __version__, check
from plumbob.core.errors import ParameterError
from plumbob.core.files import write_text

if TYPE_CHECKING:
    from plumbob.cli.engine import Verb
    from plumbob.reporting.report import Report

ROSTOPIC = "/imu0"


def allan(args: argparse.Namespace, verb: "Verb", call: Callable[..., Any]) -> int:
    """Print the noise, one deviation alone, or a comparison; write what was asked for after it."""
    from plumbob.data.cards import NoiseCard
    from plumbob.door.allan import is_recording

    if args.card is not None:
        NoiseCard.require_place(Path(args.card))
        files = (Path(path) for path in (args.card, args.kalibr) if path is not None)
        common.check_outputs(args, *common.pages(args), *files, inputs=args.inputs)
    path = Path(args.after or args.record if hasattr(args, "calibration") else args.record)
    named = [f"--{name}" for name in ("triads", "profile", "calibration") if hasattr(args, name)]
    if named and path.is_file() and not is_recording(path, getattr(args, "profile", None), getattr(args, "kind", None)):
        raise ParameterError(f"{path} holds plain numbers, but {', '.join(named)} is for recordings. Leave it out.")
    if args.after is not None:
        return _compare(args, call)
    if args.deviation is not None:
        return _deviation(args, call)
    noise = call()
    report: Report = noise.report(device=args.device)
    if args.paper == "fin":
        from plumbob.papers.fin.datasheet import fin_report

        table = fin_report(noise.analyses)
        report, text = replace(report, parts=[*report.parts, table]), table.text()
    else:
        details = {"methods": args.methods, "curve": args.curve or hasattr(args, "taus")}
        text = "" if args.json else noise.text(*(detail for detail, wanted in details.items() if wanted))
    common.print_json(noise.summary()) if args.json else print(text)
    common.write_pages(args, report)
    if args.card is not None:
        noise.card(args.device).save(Path(args.card), overwrite=args.force)
    if args.kalibr is not None:
        from plumbob.noise.card import kalibr_yaml

        yaml = kalibr_yaml(noise.analyses, rostopic=args.topic or ROSTOPIC, source=noise.source)
        write_text(Path(args.kalibr), yaml, overwrite=args.force)
    for name in ("card", "kalibr"):
        if not args.json and getattr(args, name) is not None:
            print(f"{name:12} {getattr(args, name)}")
    return 0


def _deviation(args: argparse.Namespace, call: Callable[..., Any]) -> int:
    from plumbob.door.allan import open_static
    from plumbob.noise import KINDS
    from plumbob.noise.allan import deviations
    from plumbob.noise.report import curve_numbers, curves_report

    kind = check.one_of("--deviation", args.deviation, KINDS)
    record, report, card = call(open_static)
    curves = deviations(record, report, kind, taus=args.given.get("taus"))
    about = {"file": str(record.path), "calibration": card, "deviation": kind}
    common.print_json(about | curve_numbers(curves)) if args.json else print(curves_report(curves).text())
    return 0


def _compare(args: argparse.Namespace, call: Callable[..., Any]) -> int:
    from plumbob.door.allan import open_static
    from plumbob.noise.allan import comparisons
    from plumbob.noise.report import comparison, comparison_numbers

    record, checked, _ = call(open_static, calibration=None)
    after, judged, card = call(open_static, record=args.after)
    pairs = comparisons((record, checked), (after, judged), taus=args.given.get("taus"))
    name = after.path.name if card is None else f"{after.path.name}, calibrated with {card}"
    facts = [("before", record.path.name), ("after", name), ("made by", f"plumbob {__version__}")]
    report = comparison(pairs, facts=facts)
    about = {"before": str(record.path), "after": str(after.path), "calibration": card}
    common.print_json(about | comparison_numbers(pairs)) if args.json else print(report.text())
    common.write_pages(args, report)
    return 0
