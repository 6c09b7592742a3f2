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
    p.add_argument("file", type=Path, help="CSV or text file of a logger")
    p.add_argument(
        "--out", type=Path, metavar="TOML", help="file to write (default NAME.profile.toml, where all verbs find it)"
    )
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.core.files import profile_beside
    from plumbob.core.text import counted, listed
    from plumbob.files.draft import profile

    out = args.out or profile_beside(args.file)
    draft = profile(args.file, out=out)
    print(f"{out}: {counted(len(draft.questions), 'question')} to answer in an editor")
    for line in listed(f"{key}: {why}" for key, why in draft.questions):
        print(line)
    return 0
