"""plumbob reproduce: the five papers' systems, from emulated bytes to their tables and figures."""

import argparse
from pathlib import Path

from plumbob.cli import common


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "reproduce",
        help="run the five papers' systems whole, and set their figures beside the papers'",
        description="Run papers from emulated bytes to their tables and figures: what the paper prints, what its "
        "method gives, what Plumbob gives at its best, and whether the bar is met; where a figure cannot be had by the "
        "paper's method, why. Writes a page for each paper, with its bytes, sessions and recordings.",
        epilog=common.more("plumbob reproduce buoy --out buoy-paper", "papers.md"),
    )
    p.add_argument("papers", nargs="+", metavar="PAPER", help="fin, buoy, trackball, arm, rod, or all")
    p.add_argument("--out", type=Path, default=Path("reproduced"), metavar="DIR", help="folder of pages (reproduced)")
    p.add_argument("--seed", type=int, default=1, metavar="N", help="seed of everything random (default 1)")
    p.add_argument("--lang", choices=("en", "zh"), default="en", help="language of the pages (default en)")
    p.add_argument("--jobs", type=int, default=2, metavar="N", help="papers that run side by side (default 2)")
    common.add_force(p)
    common.add_json(p)
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.papers.reproduce import reproduce

    def show(what: str, done: int, of: int) -> None:
        common.note(f"{what} ({done}/{of})")

    how = {"seed": args.seed, "out": args.out, "lang": args.lang, "jobs": args.jobs, "overwrite": args.force}
    results = reproduce(*args.papers, **how, progress=show)
    if args.json:
        common.print_json(results.summary())
        return 0
    print(results.text())
    print(f"{'pages':12} {results.folder / 'index.html'}")
    return 0
