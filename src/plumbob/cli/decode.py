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
from plumbob.core.errors import DecodeError, ParameterError
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
    hint = _hint(form, head[:_HINT]) if 2 * counts.framed < counts.received or form.framing.transfers else ""
    if not sum(counts.frames.values()):
        frame = f"a {'transfer' if form.framing.transfers else 'frame'} of {form.name}{counts.why_rejected()}"
        raise DecodeError(f"{args.data}: none of its {_bytes(counts.received)} is {frame}.{hint}")
    if out is not None:
        table.write(out, counts, args.unit, overwrite=args.force)
        units = prefix_by_unit(form.message(table.message))
        if len(units) > 1 and args.unit is None:
            common.note(f"the file is read as unit {units[0]} of {', '.join(units)}; ask for another with --unit")
    _tell(form, counts, table.message)
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


def _tell(form: "Format", counts: "Counts", message: str) -> None:
    """Say on standard error what was not decoded, and why, and what could not be checked."""
    from plumbob.protocols.overlap import passes_anything
    from plumbob.protocols.page import UNCHECKED

    if passes_anything(form):
        common.note(f"checks of {form.name}: {UNCHECKED.format(form.framing.length)}")
    others = [f"{count} of {name}" for name, count in counts.frames.items() if count and name != message]
    if others:
        main = f"{counted(counts.frames[message], 'frame')} of {message}"
        common.note(f"{main}; also {', '.join(others)}: ask with --message")
    if counts.unknown:
        common.note(f"checked, but of no message that {form.name} describes: {counted(counts.unknown, 'frame')}")
    if counts.junk:
        common.note(f"{_bytes(counts.junk)} of {counts.received} belong to no frame{counts.why_rejected()}")
    if form.framing.transfers and (over := counts.received % form.framing.length):
        common.note(
            f"{_bytes(counts.received)} are not a multiple of {form.framing.length}, the length of a transfer of "
            f"{form.name}: {over} too many. If the first transfer is not whole, every row is wrong, and nothing in the "
            "bytes shows it"
        )


def _hint(form: "Format", head: bytes) -> str:
    """Which known formats would fit; only those that cannot fit by chance."""
    from plumbob.protocols.decode import decode
    from plumbob.protocols.format_toml import EXTENSIBLE, device_names, rig_names

    fitting = []
    for name, other in EXTENSIBLE.usable((*device_names(), *rig_names())):
        if name == form.name or not (other.framing.sync and other.framing.checksum):
            continue
        try:
            counts = decode(head, other).counts
        except ParameterError:  # it has an option that only the user knows
            continue
        if sum(counts.frames.values()) >= 2 and 2 * counts.framed > counts.received:
            fitting.append(f"{name} ({sum(counts.frames.values())} frames)")
    return f" It looks like {', '.join(fitting)}." if fitting else ""


def _bytes(count: int) -> str:
    return counted(count, "byte")
