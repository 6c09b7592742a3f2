"""plumbob plot: one figure of a recording for a paper."""

import argparse
from pathlib import Path

from plumbob.cli import common
from plumbob.cli.report import add_how, add_statistics, report_args

WHATS = (
    "angles",
    "tilt",
    "rates",
    "forces",
    "field",
    "temperature",
    "bias",
    "sd",
    "spectrum",
    "rose",
    "bursts",
    "flags",
)


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "plot",
        help="one figure of a recording for a paper: angles, rates, spectrum, rose, flags …",
        description="Draw one figure of a recording, as SVG, PNG or PDF: values over time, spectra, the rose of "
        "headings, tilt by burst, or flags.",
        epilog=common.more("plumbob plot sea.parquet --what spectrum --out spectrum.pdf", "report.md"),
    )
    p.add_argument("file", type=Path, help="recording, or track")
    p.add_argument("--what", required=True, choices=WHATS, metavar="WHAT", help=f"one of {', '.join(WHATS)}")
    p.add_argument("--out", type=Path, required=True, metavar="FILE", help="the picture: .svg, .png or .pdf")
    p.add_argument("--from", dest="begin", metavar="T", help="leave out what comes before this time, as 60s")
    p.add_argument("--to", dest="end", metavar="T", help="leave out what comes after this time, as 5min")
    p.add_argument("--width", metavar="LENGTH", help="of the picture, as 85mm (190.5 mm)")
    p.add_argument("--lang", choices=("en", "zh"), default="en", help="language of the labels (default en)")
    add_how(p)
    add_statistics(p)
    common.add_force(p)
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.overview.overview import plot

    common.check_outputs(args, args.out, inputs=(args.file, args.profile, args.calibration, args.noise))
    with common.progress_bars() as bars:
        plot(
            args.file,
            args.out,
            what=args.what,
            begin=args.begin,
            end=args.end,
            width=args.width,
            lang=args.lang,
            overwrite=args.force,
            note=common.note,
            progress=bars,
            **report_args(args),
        )
    print(f"figure       {args.out}")
    return 0
