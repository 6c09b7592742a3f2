"""plumbob verify: is every row of a recording there."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from plumbob.cli import common
from plumbob.core.text import counted, visible

if TYPE_CHECKING:
    from collections.abc import Mapping

    from plumbob.files.mcap import Verdict

DAMAGED = 3
"""Exit code for a recording that is not whole."""


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "verify",
        help="check that every row of an MCAP recording is there and undamaged",
        description="Read an MCAP recording from the first byte to the last and say what is missing or damaged.",
        epilog=common.more(
            "plumbob verify sea.mcap",
            "recordings.md",
            "exit codes: 0 whole, 3 damaged, not complete, or rows are missing, 1 it cannot be read\n",
        ),
    )
    p.add_argument("files", type=Path, nargs="+", metavar="FILE", help=PATH_HELP)
    common.add_json(p)
    p.set_defaults(run=run)


PATH_HELP = "recording (all its parts), one part, several parts, or a folder of parts"


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.files.mcap import verify

    verdict = verify(args.files[0] if len(args.files) == 1 else args.files)
    common.print_json(verdict.as_dict()) if args.json else print_verdict(verdict)
    if not verdict.whole and not verdict.open and verdict.recording is not None:
        common.note("'plumbob repair' writes what is whole to a new, complete file")
    return 0 if verdict.whole else DAMAGED


def print_verdict(verdict: "Verdict") -> None:
    """Print what a recording holds and lacks."""
    names = ", ".join(path.name for path in verdict.paths)
    print(f"{names}: {counted(sum(verdict.rows.values()), 'row')} in {verdict.duration:.3f} s")
    for topic, count in verdict.rows.items():
        print(f"rows         {visible(topic)}: {count}")
    if verdict.recording is None:
        print("written by   another program, so nobody knows how many rows there were")
    if verdict.unchecked:
        print(f"unchecked    {verdict.unchecked} without a CRC (chunks or messages); damage to them cannot be seen")
    for damage in verdict.damage:
        print(f"damage       {visible(str(damage))}")
    print(f"ended        {_end(verdict)}")
    _print_missing("dropped", verdict.dropped, "given up while recording, or lost before a repair")
    _print_missing("lost", verdict.lost, "missing")
    print(f"verdict      {verdict.in_words}")


def _end(verdict: "Verdict") -> str:
    if verdict.open:
        return "not yet: it is being recorded"
    return "properly" if verdict.clean else "NOT properly: a part has no end, or a damaged one, as after a crash"


def _print_missing(title: str, rows: "Mapping[str, int]", how: str) -> None:
    for topic, count in rows.items():
        print(f"{title:12} {visible(topic)}: {counted(count, 'row')} {how}")
