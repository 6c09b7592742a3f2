"""plumbob batch: many recordings to one dataset."""

import argparse
import sys
from collections.abc import Callable

from plumbob.cli import common
from plumbob.cli.eval import alignments
from plumbob.cli.report import HOW, add_how, add_statistics

EXIT_SOME = 3
MANY = 50


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "batch",
        help="estimate the attitude of many recordings: one dataset, and a table of verdicts",
        description="Estimate the attitude of each recording, with statistics of tilt and heading, gaps, flags, "
        "quality and, where there is a reference, errors; write a partitioned Parquet dataset and a table with a "
        "verdict on each recording. A damaged one is a row of the table. Run it again to go on where it ended: what "
        "was made of the same input by the same settings is not made again.",
        epilog=common.more(
            "plumbob batch recordings --filter mekf --out dataset", "fleet.md",
            "exit codes: 0 all recordings done, 3 some are damaged or refused, 1 the message says why nothing ran",
        ),
    )  # fmt: skip
    p.add_argument("sources", nargs="+", metavar="FILE|FOLDER|PATTERN|URL", help="recordings; patterns may be quoted")
    p.add_argument("--out", required=True, metavar="DATASET", help="folder or URL of the dataset, new or to go on with")
    add_how(p, instead="", card="calibration card of all, or a folder of cards: each for the recordings of its device")
    add_statistics(p)
    p.add_argument("--align", default="", metavar="A,B", help="of the evaluation, as of 'plumbob eval'")
    p.add_argument(
        "--settle", default="0", metavar="S", help="leave out so much at the start of it, as 10s (default 0)"
    )
    p.add_argument("--pages", action="store_true", help="also write a page about each recording, as 'plumbob report'")
    which = p.add_mutually_exclusive_group()
    which.add_argument("--jobs", type=int, metavar="N", help="processes; default: one for each processor")
    which.add_argument("--cluster", metavar="ADDRESS", help="Dask scheduler whose workers do it, as tcp://host:8786")
    common.add_json(p)
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.fleet.batch import batch

    with common.progress_bars() as bars:
        done = batch(
            args.sources,
            args.out,
            **{name: getattr(args, name) for name in HOW},
            **common.filter_args(args),
            align=alignments(args.align),
            settle=args.settle,
            pages=args.pages,
            jobs=args.jobs,
            cluster=args.cluster,
            note=common.note,
            progress=_shown(bars),
        )
    common.print_json(done.summary()) if args.json else print(done.text())
    return 0 if done.counts["done"] == done.recordings else EXIT_SOME


def _shown(bars: Callable[[str, int, int], None]) -> Callable[[int, int | None], None]:
    """A bar on a terminal; elsewhere, of many recordings, a line for each tenth of them."""
    lines = not sys.stderr.isatty()

    def over(done: int, total: int | None) -> None:
        bars("recordings", done, total or done)
        if lines and total and total >= MANY and 10 * done // total > 10 * (done - 1) // total:
            common.note(f"{done} of {total} recordings")

    return over
