"""plumbob profile: drafts what a text file does not say about itself."""

import argparse
from pathlib import Path

from plumbob.cli import common


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "profile",
        help="draft the profile of a logger's CSV or text file, with a question for every guess",
        description="Draft the profile that a text file needs to be read, from its header and first rows: separator, "
        "columns, units, time. Every guess begins with '?': answer them in an editor, and the file can be read.",
        epilog=common.more("plumbob profile log.csv --out log.profile.toml", "own-csv.md"),
    )
    p.add_argument("file", type=Path, nargs="+", help="CSV or text file of a logger; several of one recording")
    p.add_argument("--accept", action="store_true", help="take every guess for which the file has evidence")
    p.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="an answer, as frame=ENU; often")
    common.add_json(p)
    p.add_argument(
        "--out", type=Path, metavar="TOML", help="file to write (default NAME.profile.toml, where all verbs find it)"
    )
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.core.files import profile_beside
    from plumbob.core.text import counted, listed
    from plumbob.files.draft import answer, profile

    out = args.out or profile_beside(args.file[0])
    draft = profile(args.file, accept=args.accept, answers=dict(map(answer, args.set)), out=out)
    is_open = bool(args.accept and draft.questions)
    if args.json:
        common.print_json({"profile": None if is_open else str(out)} | draft.summary())
        return 1 if is_open else 0
    what = "not written" if is_open else str(out)
    print(
        f"{what}: {counted(len(draft.questions), 'question')} to answer{' with --set' if is_open else ' in an editor'}"
    )
    for line in listed(f"{key}: {why}" for key, why in draft.questions):
        print(line)
    return 1 if is_open else 0
