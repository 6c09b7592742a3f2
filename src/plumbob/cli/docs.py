"""plumbob docs: the pages that messages name, from the installed package."""

import argparse

from plumbob.cli import common
from plumbob.core.errors import PlumbobError


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "docs",
        help="print or open a page of the documentation",
        description="Print a page of the documentation, which is installed with the package, or the list of pages.",
        epilog=common.more("plumbob docs time", "start.md"),
    )
    p.add_argument(
        "page", nargs="?", metavar="PAGE", help="the page, as a message names it or short: docs/time.md, time"
    )
    p.add_argument(
        "--open", action="store_true", help="open the page in the browser; without PAGE the first one, start"
    )
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.core.docs import docs

    if args.open:
        _open(args.page or "start")
    else:
        print(docs(args.page), end="")
    return 0


def _open(name: str) -> None:
    import webbrowser

    from plumbob.core.docs import page_path

    page = page_path(name)
    if not webbrowser.open(page.as_uri()):
        raise PlumbobError(f"No browser could be opened. The page is {page}.")
    print(f"opened       {page}")
