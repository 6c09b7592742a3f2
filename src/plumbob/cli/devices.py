"""plumbob devices: what is known of each device, and of any described frame."""

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING

from plumbob.cli import common
from plumbob.core.text import visible

if TYPE_CHECKING:
    from plumbob.protocols.format import Format

_HEAD = """\
# Devices

Made by `plumbob devices --markdown` from the catalogue. Marks: V read in the source named; V1 in one secondary source
only; C computed; UNVERIFIED in none.
"""


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "devices",
        help="list known devices: framing, fields with units and sources, options, registers; C header",
        description="List known devices and rigs, or all that is known of one, or of a frame described in TOML.",
        epilog=common.more("plumbob devices mpu6000", "formats.md"),
    )
    p.add_argument("name", nargs="?", metavar="NAME", help="device, rig, or TOML file")
    how = p.add_mutually_exclusive_group()
    how.add_argument("--markdown", action="store_true", help="print Markdown; without NAME, the page of the catalogue")
    how.add_argument("--c", action="store_true", help="print a C11 header for whoever sends or reads the frame")
    how.add_argument("--json", action="store_true", help="print one JSON object instead of text")
    common.add_option(p)
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.core.errors import ParameterError
    from plumbob.protocols.c_header import c_header
    from plumbob.protocols.find import find_format

    if args.name is None and (args.c or args.option):
        raise ParameterError("name a device; 'plumbob devices' lists them.")
    form = None if args.name is None else find_format(args.name)
    if args.c and form:
        print(c_header(form.bind(common.chosen_options(args))), end="")
    elif form:
        _print_one(form.bind(common.chosen_options(args)) if args.option else form, args)
    elif args.markdown:
        print(catalogue(), end="")
    else:
        _print_all(args.json)
    return 0


def catalogue() -> str:
    """Page of all devices of the catalogue, in Markdown."""
    from plumbob.protocols import catalog

    return "\n".join([_HEAD, *(_markdown(catalog.load(name), 2) for name in catalog.names())])


def _markdown(form: "Format", level: int) -> str:
    from plumbob.protocols.page import as_markdown, tables

    return f"{'#' * level} {form.name}\n\n{form.title}.\n\n{as_markdown(tables(form), level + 1)}"


def _print_one(form: "Format", args: argparse.Namespace) -> None:
    from plumbob.protocols.page import as_text, tables

    if args.json:
        common.print_json(asdict(form) | {"framing": _plain(form)})
    elif args.markdown:
        print(_markdown(form, 1), end="")
    else:
        print(f"{form.name}: {visible(form.title)}\n")
        print(as_text(tables(form)), end="")


def _plain(form: "Format") -> dict[str, object]:
    """Framing with its bytes in hexadecimal."""
    framing = form.framing
    return asdict(framing) | {"sync": [word.hex() for word in framing.sync], "end": framing.end.hex()}


def _print_all(as_json: bool) -> None:
    from plumbob.protocols import catalog
    from plumbob.protocols.find import find_format
    from plumbob.protocols.page import PageTable, as_text, framing_words, mark_words
    from plumbob.protocols.rigs import names

    kinds = {}
    for kind, listed in (("Devices", catalog.names()), ("Rigs", names())):
        forms = [find_format(name) for name in listed]
        kinds[kind] = [(form.name, form.title, framing_words(form), mark_words(form)) for form in forms]
    head = ("name", "title", "frame", "marks")
    if as_json:
        common.print_json({kind.lower(): [dict(zip(head, row, strict=True)) for row in kinds[kind]] for kind in kinds})
        return
    shown = [
        PageTable(kind, ("name", "frame", "marks", "title"), tuple((n, f, m, t) for n, t, f, m in rows))
        for kind, rows in kinds.items()
    ]
    print(as_text(shown), end="")
