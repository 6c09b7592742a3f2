"""plumbob report: what recordings hold, on one page, without a reference."""

import argparse
from pathlib import Path
from typing import Any, Final

from plumbob.cli import common

PAGES = {"out": (".html", ".htm"), "pdf": (".pdf",)}
"""Endings of the names of what is written."""


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "report",
        help="one page about recordings: attitude, tilt statistics, spectra, gaps, quality",
        description="Say on one page what recordings hold, without a reference: where they come from, attitude with "
        "its claimed uncertainty, statistics of tilt and heading by burst, spectra, sensors, gaps, flags and quality. "
        "The page is one file that opens offline; its plots are zoomed by dragging.",
        epilog=common.more("plumbob report sea.parquet --out sea.html", "report.md"),
    )
    p.add_argument("files", type=Path, nargs="+", metavar="FILE", help="recordings, or tracks; several: side by side")
    add_how(p)
    add_statistics(p)
    p.add_argument("--out", type=Path, metavar="HTML", help="where to write the page")
    p.add_argument(
        "--pdf", type=Path, metavar="FILE", help="where to write it as a PDF, which Chromium or Chrome prints"
    )
    p.add_argument("--lang", choices=("en", "zh"), help="language of the page's labels (default en)")
    common.add_force(p)
    common.add_json(p)
    p.set_defaults(run=run)


HOW: Final = (
    "causal", "lag", "frame", "init", "place", "date", "profile", "unit", "calibration", "noise", "burst", "tilt_limit",
)  # fmt: skip
"""Names of the options of `add_how` and `add_statistics`, besides the filter and its parameters."""
INSTEAD: Final = "; track: the attitude that the file holds; none: no attitude"
CARD: Final = "calibration card to apply first; default: of a recorded stream that of its session"


def add_how(p: argparse.ArgumentParser, *, instead: str = INSTEAD, card: str = CARD) -> None:
    """Options of the estimate, as of run; and of what stands in for one."""
    which = p.add_mutually_exclusive_group()
    which.add_argument("--filter", metavar="NAME", help=f"one of 'plumbob filters', default: smoother{instead}")
    which.add_argument("--causal", action="store_true", help="as a live system knows it: nothing later is used")
    which.add_argument("--lag", metavar="T", help="smooth with a fixed lag, as 5s")
    p.add_argument("--params", metavar="P", help=common.PARAMS_HELP)
    common.add_frame(p, "navigation frame; needed where the recording names none")
    common.add_init(p)
    common.add_place(p)
    common.add_profile(p)
    common.add_unit(p)
    common.add_calibration(p, card)
    common.add_noise(p)


def add_statistics(p: argparse.ArgumentParser) -> None:
    """Options --burst and --tilt-limit."""
    p.add_argument("--burst", default="20 min", metavar="T", help="length of a burst (20 min)")
    p.add_argument("--tilt-limit", default="15 deg", metavar="ANGLE", help="inclination that counts as large (15 deg)")


def report_args(args: argparse.Namespace) -> dict[str, Any]:
    """What the options of `add_how` and `add_statistics` say, as `plumbob.report` takes it."""
    return {name: getattr(args, name) for name in HOW} | common.filter_args(args, instead=("track", "none"))


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.core.errors import ParameterError
    from plumbob.overview.overview import report

    for name, endings in PAGES.items():
        path: Path | None = getattr(args, name)
        if path is not None and path.suffix.lower() not in endings:
            raise ParameterError(f"--{name} needs a name that ends in {' or '.join(endings)}, but got {path}.")
    if args.lang and not (args.out or args.pdf):
        raise ParameterError("--lang is for --out or --pdf, which is not given; leave it out.")
    common.check_outputs(args, args.out, args.pdf, inputs=(*args.files, args.profile, args.calibration, args.noise))
    with common.progress_bars() as bars:
        overview = report(args.files, **report_args(args), note=common.note, progress=bars)
    written = {"page": (args.out, overview.write_html), "pdf": (args.pdf, overview.write_pdf)}
    for path, write in written.values():  # first: who reads the text may go away
        if path is not None:
            write(path, lang=args.lang or "en", overwrite=args.force)
    if args.json:
        common.print_json(overview.summary())
        return 0
    print(overview.text())
    for what, (path, _) in written.items():
        if path is not None:
            print(f"{what:12} {path}")
    return 0
