"""plumbob cite: the publications behind a filter."""

import argparse

from plumbob.cli import common


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "cite",
        help="print the references of filters, as lines or as BibTeX",
        description="Print the publications behind filters, a line for each, or their BibTeX entries.",
        epilog=common.more("plumbob cite mahony --bib", "equations.md"),
    )
    p.add_argument("names", nargs="*", metavar="FILTER", help="filters; all where none is named")
    p.add_argument("--bib", action="store_true", help="print the BibTeX entries, each once")
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.filters.known import cite

    print(cite(*args.names, bib=args.bib), end="")
    return 0
