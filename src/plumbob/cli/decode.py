"""plumbob decode: bytes to a table of numbers with units."""

import argparse
import json
import math
import sys
from collections.abc import Iterator, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plumbob.cli import common
from plumbob.cli.engine import Call, Verb
from plumbob.core.errors import DecodeError, ParameterError
from plumbob.core.files import profile_beside, replacing, replacing_all, write_text
from plumbob.core.text import counted
from plumbob.core.units import Quantity, given

if TYPE_CHECKING:
    from plumbob.protocols.decode import Counts, Frames
    from plumbob.protocols.format import Format

_READ = 1 << 20
TIME = "t [s]"
_TEXT = (".csv", ".txt")
_HINT = 1 << 18
"""Bytes of a file of which other formats are tried."""


def run(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Print the table, or write it, and say what was not decoded."""
    from plumbob.data import UNCALIBRATED
    from plumbob.protocols.decode import decode
    from plumbob.protocols.format_toml import find_format, unassigned_told

    form, out = find_format(args.format).bind(args.given.get("options", {})), args.out and Path(args.out)
    if spare := unassigned_told(form, form.message(args.message or "")):
        common.note(spare)
    common.check_outputs(args, *common.with_profile(out, _TEXT), inputs=(Path(args.data),))
    table = _MessageRows(args.message or "", given("--rate", args.rate, Quantity.FREQUENCY))

    def take(frames: "Mapping[str, Frames]", _: "Counts") -> None:
        table.add(frames)
        if out is None:
            sys.stdout.writelines(table.csv())
            sys.stdout.flush()

    pieces = _chunks(args.data, table)
    counts = decode(_in_order(args.data, pieces, form) if args.ring else pieces, form, each=take).counts
    if not counts.received:
        raise DecodeError(f"{args.data} is empty. Give a file of raw bytes.")
    if not sum(counts.frames.values()):
        frame = f"a {'transfer' if form.framing.transfers else 'frame'} of {form.name}{counts.why_rejected()}"
        raise DecodeError(f"{args.data}: none of its {_bytes(counts.received)} is {frame}.{_hint(form, table.head)}")
    if out is not None:
        table.write(out, counts, _profile(form, table, args.unit), overwrite=args.force)
    _tell(form, counts, table)
    if table.skipped:
        rows = "; t [s] counts rows, so it is early by that many periods after each gap" if args.rate else ""
        common.note(f"the frame counter skips {table.skipped}: that many frames are missing, or it jumped{rows}")
    common.note(f"calibration {UNCALIBRATED}")
    return 0


def _profile(form: "Format", table: "_MessageRows", unit: str | None) -> str:
    """Profile that reads the table as a recording; empty where the message has no triad."""
    from plumbob.files.decoded import profile_text
    from plumbob.protocols.decode import format_title, prefix_by_unit

    message = form.message(table.message)
    units = prefix_by_unit(message)
    if not units:
        return ""
    if len(units) > 1 and unit is None:
        common.note(f"the file is read as unit {units[0]} of {', '.join(units)}; ask for another with --unit")
    titles = {field.name: format_title(field) for field in message.fields}
    titles |= {name: name for name in (f"{u}.flags".lstrip(".") for u in units)}
    return profile_text(form, message, units[0] if unit is None else unit, titles, TIME if table.rate else "")


@dataclass
class _MessageRows:
    """Rows of one message, as they come."""

    message: str
    rate: float | None
    head: bytes = b""
    """First bytes of the stream, of which other formats are tried."""
    skipped: int = 0
    """How many frames the counter skips; a count that repeats skips nothing."""
    parts: "list[Frames]" = field(default_factory=list)
    rows: int = 0
    count: int | None = None

    def add(self, frames: "Mapping[str, Frames]") -> None:
        """Take frames of the message; of the first that comes, where none was asked for."""
        import numpy as np

        self.message = self.message or min(frames, key=lambda name: int(frames[name].start[0]), default="")
        if (part := frames.get(self.message)) is None:
            return
        self.parts.append(part)
        if (counter := part.message.of_role("counter")) is not None:
            counts = part.columns[counter.name].astype(np.int64)
            steps = np.diff(counts, prepend=counts[0] - 1 if self.count is None else self.count) % (1 << counter.width)
            self.count = int(counts[-1])
            self.skipped += int(np.maximum(steps - 1, 0).sum())

    def write(self, path: Path, counts: "Counts", profile: str, *, overwrite: bool) -> None:
        """Write all into a file whose suffix says the kind; text gets its profile beside it, Parquet inside."""
        from plumbob.data import UNCALIBRATED

        if path.suffix in _TEXT:
            beside = [profile_beside(path)] if profile else []
            with replacing_all(path, *beside, overwrite=overwrite) as (temporary, *described):
                for file in described:
                    file.write_text(profile, encoding="utf-8")
                with temporary.open("w", encoding="utf-8") as stream:
                    stream.writelines(self.csv())
            return
        columns: dict[str, list[Any]] = {}
        for block in self.blocks():
            for name, values in block.items():
                columns.setdefault(name, []).extend(values)
        if path.suffix == ".json":
            content = {"message": self.message, "calibration": UNCALIBRATED, "counts": counts.summary()}
            write_text(path, json.dumps(content | {"columns": columns}, allow_nan=False), overwrite=overwrite)
            return
        import pyarrow as pa
        import pyarrow.parquet as pq

        with replacing(path, overwrite=overwrite, seeks=True) as temporary:
            metadata = {"calibration": UNCALIBRATED} | ({"plumbob profile": profile} if profile else {})
            pq.write_table(pa.table(columns).replace_schema_metadata(metadata), temporary)

    def csv(self) -> Iterator[str]:
        """Lines of what has come since the last call."""
        titled = self.rows > 0
        for block in self.blocks():
            if not titled:
                yield ",".join(block) + "\n"
            titled = True
            yield from (",".join(map(_cell, row)) + "\n" for row in zip(*block.values(), strict=True))

    def blocks(self) -> "Iterator[dict[str, list[Any]]]":
        """Columns by name, block by block."""
        parts, self.parts = self.parts, []
        for frames in parts:
            times = {TIME: [(self.rows + i) / self.rate for i in range(len(frames))]} if self.rate else {}
            self.rows += len(frames)
            yield times | _columns(frames)


def _columns(frames: "Frames") -> dict[str, list[Any]]:
    """Columns by name with unit; None where there is no value, or it is beyond all numbers, by a scale of 1e-320."""
    from plumbob.core import flags
    from plumbob.protocols.decode import format_title

    columns: dict[str, list[Any]] = {"byte": frames.start.tolist()}
    for each in (f for f in frames.message.fields if f.name in frames.columns):
        values = frames.columns[each.name].tolist()
        columns[format_title(each)] = [
            None if isinstance(value, float) and not math.isfinite(value) else value for value in values
        ]
    for prefix, words in frames.flags.items():
        columns[f"{prefix}.flags" if prefix else "flags"] = ["+".join(flags.names(word)) for word in words.tolist()]
    return columns


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.12g}" if isinstance(value, float) else str(value)


def _chunks(name: str, table: _MessageRows) -> Iterator[bytes]:
    """Pieces of a file, or of standard input; the first stays with the table."""
    with nullcontext(sys.stdin.buffer) if name == "-" else Path(name).open("rb") as file:
        read = getattr(file, "read1", file.read)  # what is there already, where it comes through a pipe
        while data := read(_READ):
            table.head = table.head or data[:_HINT]
            yield data


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


def _tell(form: "Format", counts: "Counts", table: _MessageRows) -> None:
    """Say on standard error what was not decoded, and why, and what could not be checked."""
    from plumbob.protocols.overlap import passes_anything
    from plumbob.protocols.page import UNCHECKED

    if passes_anything(form):
        common.note(f"checks of {form.name}: {UNCHECKED.format(form.framing.length)}")
    others = [f"{count} of {name}" for name, count in counts.frames.items() if count and name != table.message]
    if others:
        main = f"{counted(counts.frames[table.message], 'frame')} of {table.message}"
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
    doubtful = form.framing.transfers or 2 * counts.framed < counts.received
    if doubtful and (hint := _hint(form, table.head)):
        common.note(f"this may not be {form.name} at all.{hint}")


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
