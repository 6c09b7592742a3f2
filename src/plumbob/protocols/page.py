"""A format as a page to read: framing, fields with units and marks, options, registers, facts and sources."""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from plumbob.core.errors import ParameterError
from plumbob.core.text import counted
from plumbob.core.units import unit
from plumbob.protocols.field import MARKS, Field, Provenance
from plumbob.protocols.format import Format, Message
from plumbob.protocols.overlap import passes_anything

if TYPE_CHECKING:
    from plumbob.protocols.decode import Counts

UNCHECKED: Final = "NONE: no sync, checksum or constant, so any {} bytes pass for a sample, even noise"
"""What is said of a format without any check, of its length."""


@dataclass(frozen=True, slots=True)
class PageTable:
    """Part of a page."""

    title: str  # its heading
    head: tuple[str, ...]  # what its columns are
    rows: tuple[tuple[str, ...], ...]  # cells


def tables(form: Format) -> list[PageTable]:
    """Return everything that is known of a format; parts without content are left out."""
    parts = [
        PageTable("Frame", ("what", "value"), tuple(_framing(form))),
        *(_message(form, message) for message in form.messages),
        PageTable("Options", ("name", "choices", "default", "meaning", "mark"), tuple(_options(form))),
        PageTable("Facts", ("about", "fact", "mark"), tuple((k, t, marked(o)) for k, (t, o) in form.facts.items())),
        PageTable(
            "Registers",
            ("address", "name", "meaning", "at reset", "mark"),
            tuple(
                (f"{r.address:02X}", r.name, r.meaning, "" if r.reset is None else f"{r.reset:X}", marked(r.origin))
                for r in form.registers
            ),
        ),
        PageTable("Sources", ("tag", "source"), tuple(form.sources.items())),
    ]
    return [table for table in parts if table.rows]


def mark_words(form: Format) -> str:
    """How many of a format's facts have which mark, as in ``"V 21, C 2"``."""
    origins = [f.origin for m in form.messages for f in m.fields]
    origins += [o.origin for o in form.options.values()]
    origins += [origin for _, origin in form.facts.values()] + [r.origin for r in form.registers]
    counts = Counter(origin.mark for origin in origins)
    return ", ".join(f"{mark} {counts[mark]}" for mark in MARKS if mark and counts[mark])


def framing_words(form: Format) -> str:
    """How frames are found, in a few words."""
    framing = form.framing
    size = f"{framing.length} bytes" if framing.length else f"up to {framing.most} bytes"
    if framing.transfers:
        return f"bus transfer, {size}{', NO CHECK' if passes_anything(form) else ''}"
    checked = f", {_check(form)}" if framing.checksum else ""
    return f"{_sync(form)}, {size}{checked}"


def marked(origin: Provenance) -> str:
    """Mark and source, and the note behind."""
    text = " ".join(part for part in (origin.mark, origin.source) if part)
    return f"{text}; {origin.note}" if origin.note and text else text or origin.note


def as_text(found: Iterable[PageTable]) -> str:
    """Tables as aligned text."""
    return "\n\n".join(f"{table.title}\n{_aligned(table)}" for table in found) + "\n"


def as_markdown(found: Iterable[PageTable], level: int) -> str:
    """Tables as Markdown, with headings of a level."""
    return "\n".join(f"{'#' * level} {table.title}\n\n{_piped(table)}" for table in found)


def _framing(form: Format) -> list[tuple[str, str]]:
    framing = form.framing
    rows = [("begins with", _sync(form) if framing.sync else "nothing: the bus cuts the frames")]
    if rule := framing.length_field:
        rows.append(("length", f"{rule.least} to {rule.most} bytes, said at byte {rule.at} less {rule.add}"))
    else:
        rows.append(("length", f"{framing.length} bytes"))
    if check := framing.checksum:
        where = f"{_place(check.at)}, over bytes {check.start} to {_place(check.stop)}, which it leaves out"
        rows.append(("check", f"{_check(form)} at {where}; {check.order}-endian"))
    if passes_anything(form):
        rows.append(("check", UNCHECKED.format(form.framing.length)))
    rows += [("odd parity", f"bytes {start} to {stop - 1}, by bit {bit}") for start, stop, bit in framing.parity]
    if framing.end:
        rows.append(("ends with", framing.end.hex(" ").upper()))
    if framing.confirm:
        rows.append(("after a disturbance", "a frame counts once another begins right behind it"))
    if framing.rate:
        rows.append(("rate", f"{framing.rate:g} Hz"))
    if framing.baud:
        rows.append(("line", f"{framing.baud} baud"))
    if form.noise:
        rows.append(("noise preset", f"--sensors {form.noise}"))
    if form.aliases:
        rows.append(("also called", ", ".join(form.aliases)))
    return rows


def _check(form: Format) -> str:
    """Kind of check, or the option that says it."""
    kind = form.framing.checksum.kind if form.framing.checksum else ""
    return f"by option {kind}" if kind in form.options else kind


def _place(at: int) -> str:
    return f"byte {at}" if at > 0 else f"{-at} bytes before the end" if at else "the end"


def _sync(form: Format) -> str:
    return " or ".join(word.hex(" ").upper() for word in form.framing.sync)


def _message(form: Format, message: Message) -> PageTable:
    title = "Fields" if len(form.messages) == 1 else f"Message {message.name}, {message.length} bytes"
    rows = tuple((str(f.at), f.name, _type(f), _value(f), marked(f.origin)) for f in message.fields)
    return PageTable(
        f"{title}: {message.title}" if message.title else title, ("byte", "name", "type", "value", "mark"), rows
    )


def _type(field: Field) -> str:
    if field.derived:
        return f"{field.type} of {field.size} bytes"
    bits = f" bits {field.bits[0]}:{field.bits[1]}" if field.bits else ""
    return f"{field.type}{' ' + field.order if field.size > 1 and field.type != 'bcd' else ''}{bits}"


def _value(field: Field) -> str:
    if field.role == "constant":
        return f"always {field.value:#x}"
    if field.role == "match":
        return f"1 where it is {field.value:#x} (0 = absent of {', '.join(field.of)})"
    if not field.physical:
        says = "; ".join(f"{code} = {word}" for code, word in field.says.items())
        of = f" ({says} of {', '.join(field.of)})" if says else ""
        return f"{field.role}{of}" + (f", {field.tick}" if field.unit else "")
    parts = [f"count{field.raw_offset:+g}" if field.raw_offset else "count"]
    parts += [f"× {field.lsb:.9g}"] if field.lsb != 1.0 else []
    parts += [f"× {_short(field.times)}"] if field.times != 1.0 else []
    parts += [f"/ {_short(field.counts)}"] if field.counts != 1.0 else []
    parts += [f"{field.offset:+g}"] if field.offset else []
    text = " ".join(parts) + ("" if unit(field.unit).quantity.value == "1" else f" {field.unit}")
    text += f"; ends at {field.clip[0]} and {field.clip[1]}" if field.clip else ""
    text += f"; {', '.join(map(str, field.overflow))} = beyond the range" if field.overflow else ""
    text += f"; believed from {field.range[0]} to {field.range[1]}" if field.range else ""
    return text + ("; goes round" if field.wrap else "")


def _short(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.9g}"


def _options(form: Format) -> list[tuple[str, ...]]:
    return [
        (name, ", ".join(o.choices) or "a number above 0", o.default or "must be given", o.meaning, marked(o.origin))
        for name, o in form.options.items()
    ]


def _aligned(table: PageTable) -> str:
    rows = [table.head, *table.rows]
    widths = [min(40, max(len(row[i]) for row in rows)) for i in range(len(table.head))]
    return "\n".join(
        "  " + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )


def _piped(table: PageTable) -> str:
    rows = [table.head, ("---",) * len(table.head), *table.rows]
    return "".join("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |\n" for row in rows)


def not_decoded(form: Format, counts: "Counts", message: str) -> Iterator[str]:
    """What was not decoded of bytes of which one kind of message is taken, and why, and what could not be checked."""
    if passes_anything(form):
        yield f"checks of {form.name}: {UNCHECKED.format(form.framing.length)}"
    if others := [f"{count} of {name}" for name, count in counts.frames.items() if count and name != message]:
        main = f"{counted(counts.frames[message], 'frame')} of {message}"
        yield f"{main}; also {', '.join(others)}: ask with --message"
    if counts.unknown:
        yield f"checked, but of no message that {form.name} describes: {counted(counts.unknown, 'frame')}"
    if counts.junk:
        yield f"{counted(counts.junk, 'byte')} of {counts.received} belong to no frame{counts.why_rejected()}"
    if form.framing.transfers and (over := counts.received % form.framing.length):
        yield (
            f"{counted(counts.received, 'byte')} are not a multiple of {form.framing.length}, the length of a transfer "
            f"of {form.name}: {over} too many. If the first transfer is incomplete, every row is wrong, and nothing in "
            "the bytes shows it"
        )


def other_format(form: Format | None, head: bytes) -> str:
    """Which known formats would fit the first bytes better; only those that cannot fit by chance."""
    from plumbob.protocols.decode import decode
    from plumbob.protocols.format_toml import EXTENSIBLE, device_names, rig_names

    fitting = []
    for name, other in EXTENSIBLE.usable((*device_names(), *rig_names())):
        if (form and name == form.name) or not (other.framing.sync and other.framing.checksum):
            continue
        try:
            counts = decode(head, other).counts
        except ParameterError:  # it has an option that only the user knows
            continue
        if sum(counts.frames.values()) >= 2 and 2 * counts.framed > counts.received:
            fitting.append(f"{name} ({sum(counts.frames.values())} frames)")
    return f" It looks like {', '.join(fitting)}." if fitting else ""
