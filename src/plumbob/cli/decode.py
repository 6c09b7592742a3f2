"""plumbob decode: bytes to a table of numbers with units."""

import argparse
import sys
from collections.abc import Iterator, Mapping
from contextlib import nullcontext
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from plumbob.cli import common
from plumbob.cli.engine import Call, Verb
from plumbob.core.errors import DecodeError
from plumbob.core.text import counted
from plumbob.core.units import Quantity, given

if TYPE_CHECKING:
    from plumbob.protocols.decode import Counts, Frames
    from plumbob.protocols.format import Format

_READ = 1 << 20
_HINT = 1 << 18
"""Bytes of a file of which other formats are tried."""


def run(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Print the table, or write it, and say what was not decoded."""
    from plumbob.data import UNCALIBRATED
    from plumbob.files.decoded import TEXTS, DecodedTable
    from plumbob.protocols.decode import decode, prefix_by_unit
    from plumbob.protocols.format_toml import find_format, unassigned_told
    from plumbob.protocols.page import not_decoded, other_format

    form, out = find_format(args.format).bind(args.given.get("options", {})), args.out and Path(args.out)
    if spare := unassigned_told(form, form.message(args.message or "")):
        common.note(spare)
    common.check_outputs(args, *common.with_profile(out, TEXTS), inputs=(Path(args.data),))
    table = DecodedTable(form, args.message or "", given("--rate", args.rate, Quantity.FREQUENCY))

    def take(frames: "Mapping[str, Frames]", _: "Counts") -> None:
        table.add(frames)
        if out is None:
            sys.stdout.writelines(table.csv())
            sys.stdout.flush()

    pieces = _chunks(args.data)
    head = next(pieces, b"")
    pieces = chain([head], pieces)
    counts = decode(_in_order(args.data, pieces, form) if args.ring else pieces, form, each=take).counts
    if not counts.received:
        raise DecodeError(f"{args.data} is empty. Give a file of raw bytes.")
    hint = other_format(form, head[:_HINT]) if 2 * counts.framed < counts.received or form.framing.transfers else ""
    if not sum(counts.frames.values()):
        frame = f"a {'transfer' if form.framing.transfers else 'frame'} of {form.name}{counts.why_rejected()}"
        raise DecodeError(f"{args.data}: none of its {counted(counts.received, 'byte')} is {frame}.{hint}")
    if out is not None:
        table.write(out, counts, args.unit, overwrite=args.force)
        units = prefix_by_unit(form.message(table.message))
        if len(units) > 1 and args.unit is None:
            common.note(f"the file is read as unit {units[0]} of {', '.join(units)}; ask for another with --unit")
    common.note(*not_decoded(form, counts, table.message))
    if hint:
        common.note(f"this may not be {form.name} at all.{hint}")
    if table.skipped:
        rows = "; t [s] counts rows, so it is early by that many periods after each gap" if args.rate else ""
        common.note(f"the frame counter skips {table.skipped}: that many frames are missing, or it jumped{rows}")
    common.note(f"calibration {UNCALIBRATED}")
    return 0


def _chunks(name: str) -> Iterator[bytes]:
    """Pieces of a file, or of standard input."""
    with nullcontext(sys.stdin.buffer) if name == "-" else Path(name).open("rb") as file:
        read = getattr(file, "read1", file.read)  # what is there already, where it comes through a pipe
        yield from iter(lambda: read(_READ), b"")


def _in_order(name: str, pieces: Iterator[bytes], form: "Format") -> Iterator[bytes]:
    """Frames of a ring in the order of their counter; tells what else is there."""
    from plumbob.protocols.ring import read_ring

    try:
        ring = read_ring(b"".join(pieces), form)
    except DecodeError as error:
        raise DecodeError(f"{name}: {error}") from error
    common.note(
        f"{counted(ring.records, 'record')}, {ring.missing} missing between the first and the last; beside them "
        f"{ring.blank} blank bytes and {ring.torn} torn"
    )
    yield ring.stream
