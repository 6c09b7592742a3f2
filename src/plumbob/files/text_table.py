"""The head of a text file and its numbers: fast with Arrow in blocks, line by line in a block that Arrow refuses.

The head has markers, lines to skip, comments and the row of names. A line that cannot be read is left out, counted and
named, as broken bytes of a live line are; so that an error can name its cell, a file of which more than `LEFT_OUT_MOST`
cannot be read is refused with the first of them.
"""

import csv
import json
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from decimal import Decimal, InvalidOperation
from functools import cache, partial
from itertools import chain, islice, pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, excerpt, one_line
from plumbob.core.findings import Finding, warning
from plumbob.core.text import sentence_checksum
from plumbob.files.arrow import AT_ONCE, column_numbers, parsed_csv, text_bytes, text_pieces
from plumbob.files.column_names import is_unit
from plumbob.files.columns import FORM, is_clocklike
from plumbob.files.profile import BLANK, JSON, QUOTED, ColumnRef, TextLayout

TOKEN: Final = re.compile(
    r"^\s*\d+(?=: )|"
    r"(?<![\w.^:-])(?:\d{4}[-/]\d{1,2}[-/]\d{1,2}[T ])?\d{1,2}:\d\d:\d\d(?:[.,:]\d+)?(?:Z\b|[-+]\d\d:?\d\d\b)?|"
    r"(?<![\w.^+-])(?<![a-z]/)(?!(?<=\w\[)\d+\]\s*[:=])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\d.:x^])|\b(?:nan|NaN|null)\b"
)  # A number or a clock time among words; not a digit of a name, its index, an exponent or a code


_NO_WORDS: Final = re.compile(
    r"</[^<>]*>|\b[A-Z]\w*\((?=\w+[=:])|:\s*\"[^\"]*\"|[\]\[{}\"':=,;|<>]|->|^\s*\)|\(\s*$"
)  # what separates, closes an element of XML or makes an object


def label(text: str) -> str:
    """Words of what stands before a number, without what separates, as in ``"accel":{"x":`` and ``], Gyr (dps) [``."""
    words = " ".join(_NO_WORDS.sub(" ", text).split())
    return words if re.search(r"\w", words) else ""


def among_words(row: str) -> list[str]:
    """Numbers and clock times of a row of words and numbers, and behind them the words before the first number."""
    numbers = list(TOKEN.finditer(row))
    first = next((number for number in numbers if ":" not in number[0]), None)
    before = numbers[0].end() if first and numbers[0] is not first else 0
    return [*(number[0] for number in numbers), label(row[before : first.start()]) if first else ""]


def all_words(row: str) -> str:
    """What a row of words and numbers says without these, by which lines differ that begin alike."""
    return label(TOKEN.sub(" ", row))


_AXIS_BELOW_AXIS: Final = re.compile(
    r"^([^\n\d:=]*?)(x)([ \t]*[:=][^\n:=]*)(\n+)\1(y)([ \t]*[:=][^\n:=]*)(\n+)\1(z)([ \t]*[:=][^\n:=]*)$",
    re.MULTILINE | re.IGNORECASE,
)  # whose line ends end the joined line, so that lines are counted as in the file
_GLUED: Final = re.compile(r"^(?:[A-Za-z]+[-+]?(?:\d+(?:\.\d*)?|\.\d+)[ \t,;]*){3,}$", re.MULTILINE)  # as AX0.1AY-0.2
_BELOW_TITLE: Final = re.compile(r"^([^\W\d][^\n]*?):?[ \t]*(\n+)(?=[ \t]*[xX] ?[:=])", re.MULTILINE)


def titled(text: str) -> str:
    """Text with three axes in one line, and their title, as ``Gyro:`` above ``X: 0.1 Y: 0.2 Z: 0.3``, before them."""
    text = _GLUED.sub(lambda row: re.sub(r"(?<=\d)(?=[A-Za-z])|(?<=[A-Za-z])(?=[-+.\d])", " ", row[0]), text)
    text = _AXIS_BELOW_AXIS.sub(r"\1\2\3 \1\5\6 \1\8\9\4\7", text)
    return _BELOW_TITLE.sub(lambda row: row[0] if TOKEN.search(row[1]) else f"{row[2]}{row[1]}: ", text)


_OPEN: Final = re.compile(r"[ \t]*|[^\W\d]\D*|[^\d:=]*[xyXY][ \t]*[:=][^:=]*")


def is_open(row: str) -> bool:
    """Whether `titled` may join the line that comes to this one: a title, the first or second axis, or nothing."""
    return _OPEN.fullmatch(row) is not None


def _single_blanks(text: bytes) -> bytes:
    """Text with runs of blanks and tabs made one blank, and none at the ends of its lines."""
    text = text.replace(b"\t", b" ")
    while b"  " in text:
        text = text.replace(b"  ", b" ")
    return text.replace(b"\n ", b"\n").replace(b" \n", b"\n").removeprefix(b" ")


def are_objects(text: str) -> bool:
    """Whether a text is meant as JSON: an object or an array, or an object in each line; or as printed messages."""
    return re.match(r"\s*(\[\s*)?\{\s*\"|\s*\[\s*\[[^][]*\]\s*,", text) is not None or len(_printed(text)) > 2


_BETWEEN: Final = re.compile(r"^---\s*$", re.MULTILINE)
_ENTRY: Final = re.compile(r"(?P<indent> *)(?:(?P<key>[\w.]+)(?:: *|(?= \{))|-)(?: *\{| *(?P<value>.*?)( \(.*\))?)")
_NESTED: Final = re.compile(r"^(\w+)(?::| \{)[^,;\t\n]*\n +\w+(?::| \{)", re.MULTILINE)


def _printed(text: str) -> list[str]:
    """Messages with indented lines between lines of ``---``, each from its first key on, or items of a list in YAML."""
    if items := re.findall(r"^ *- (?=\w+:)", text, re.MULTILINE):
        parts = re.split(rf"^{items[0]}", text, flags=re.MULTILINE)[1:]
        return [" " * len(items[0]) + part for part in parts] if not _BETWEEN.search(text) else []
    if (first := _NESTED.search(text)) is None:
        return []
    parts = _BETWEEN.split(text)
    return parts if len(parts) > len("---") else re.split(rf"^(?={first[1]}\b)", text, flags=re.MULTILINE)[1:]


def _documents(texts: Sequence[str]) -> list[dict[str, Any]]:
    """Messages as ``rostopic echo``, ``gz topic -e`` and PX4's ``listener`` print them: values and keys under keys."""
    documents: list[dict[str, Any]] = []
    for part in filter(str.strip, texts):
        open_keys: list[tuple[int, dict[str, Any]]] = [(-1, {})]
        for entry in filter(None, map(_ENTRY.fullmatch, map(str.rstrip, part.split("\n")))):
            indent, key, value = len(entry["indent"]), entry["key"], (entry["value"] or "").strip()
            while open_keys[-1][0] >= indent + (key is None):
                open_keys.pop()
            parent = open_keys[-1][1]
            key = key or str(1 + len(parent))
            if value:
                parent[key] = value[1:-1].split(",") if value[0] + value[-1] == "[]" else value.strip("'\"")
            else:
                parent[key] = {}
                open_keys.append((indent, parent[key]))
        documents.append(open_keys[0][1])
    return documents


def printed_as_objects(text: str) -> str:
    """Text in which an object of JSON stands for the ``---`` behind a printed message, and empty lines for the rest."""
    lines, begin = text.split("\n"), 0
    for i, line in enumerate(lines):
        if is_in_message(line):
            continue
        if _BETWEEN.fullmatch(line) and (message := _documents(["\n".join(lines[begin:i])])):
            lines[begin : i + 1] = [*[""] * (i - begin), json.dumps(message[0])]
        begin = i + 1
    return "\n".join(lines)


def is_in_message(row: str) -> bool:
    """Whether `printed_as_objects` may join the line that comes to this one."""
    return not row.startswith(("---", "{"))


class Joining(NamedTuple):
    """How lines of a text that make one row together become one line, the others of them empty."""

    join: Callable[[str], str]
    is_open: Callable[[str], bool]  # whether the line that comes may be joined to this one


def joining(layout: TextLayout) -> Joining | None:
    """How lines of a layout are joined; None where each is a row."""
    if layout.separator == JSON:
        return Joining(printed_as_objects, is_in_message)
    return Joining(titled, is_open) if layout.words else None


def _loaded(text: str, line: int = 1) -> Any:
    """Content of JSON that begins in a line of a file."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        at = f"line {line - 1 + getattr(error, 'lineno', 1)}, column {getattr(error, 'colno', 1)}"
        what = one_line(getattr(error, "msg", error))
        raise DecodeError(f"{at}: it is not JSON ({what}); complete or correct it there.") from error


def object_cells(text: str, line: int) -> dict[str, str]:
    """Cells of an object of JSON, which is a line, by their names; DecodeError where it is none."""
    content = _loaded(text, line)
    if not isinstance(content, dict):
        raise DecodeError(f"line {line}: {excerpt(text)} is not a JSON object.")
    return flat_cells("", content)


def objects_as_rows(text: str) -> str:
    """Objects of JSON as a table with tabs: lines of what it says once, a row of names, and a row for each object.

    Rows are the longest array of objects, or arrays beside each other; several with the same keys are one table, with a
    ``sensor``.
    """
    tables: dict[str, list[dict[str, str]]] = {}
    facts: dict[str, str] = {}
    if not text.lstrip().startswith(("{", "[")) and (messages := _printed(text)):
        content: Any = _documents(messages)
    elif _IN_LINES.match(text):
        content = [_loaded(line, number) for number, line in enumerate(text.split("\n"), 1) if line.strip()]
    else:
        content = _loaded(text)
    _collect("", content, tables, facts)
    rows = max(tables.values(), key=len, default=[])
    alike = {key: some for key, some in tables.items() if some and some[0].keys() == rows[0].keys()}
    short = {key.rpartition("/")[2]: some for key, some in alike.items()}
    if len(alike) > 1:
        alike = short if len(short) == len(alike) else alike
        rows = [{"sensor": key} | row for key, some in alike.items() for row in some]
    if not rows:
        raise DecodeError('no array in it holds samples; write an array of objects, as [{"t": 0.01, "ax": 0.1}].')
    names = dict.fromkeys(name for row in rows for name in row)
    if len(names) * len(rows) > _MOST_EMPTY * len(text):
        raise DecodeError(f"its objects have {len(names)} different keys, but those of a table share them.")
    lines = [f"# {key}: {value}" for key, value in facts.items()]
    lines += ["\t".join(names), *("\t".join(row.get(name, "") for name in names) for row in rows)]
    return "\n".join(lines) + "\n" * text.endswith(("\n", "}", "]", "-"))  # else the last number may be cut


_MOST_EMPTY: Final = 16  # cells of a table for each character of JSON: what other sensors' objects lack is empty
_IN_LINES: Final = re.compile(r"\s*\{.*\}[ \r]*\n\s*\{")


def _collect(key: str, value: Any, tables: dict[str, list[dict[str, str]]], facts: dict[str, str]) -> None:
    """Find arrays of rows in JSON, and what it says once."""
    entries = list(value.values()) if isinstance(value, dict) else []
    alike = len(entries) > 1 and all(isinstance(entry, dict) and entry.keys() == entries[0].keys() for entry in entries)
    if isinstance(value, list) and value and isinstance(value[0], dict | list):
        tables[key] = [row for item in value for row in _samples(item)]
    elif alike and all(map(str.isdigit, entries[0])) and len(entries[0]) > len("xyzw"):  # columns of numbered rows
        numbered = zip(*(entry.values() for entry in entries), strict=True)
        tables[key] = [flat_cells("", dict(zip(value, row, strict=True))) for row in numbered]
    elif alike and len(entries) > max(_FEWEST_ENTRIES, len(entries[0])):  # rows under a key each
        tables[key] = [row for entry in entries for row in _samples(entry)]
    elif isinstance(value, dict):
        lists = {name: item for name, item in value.items() if isinstance(item, list) and item}
        titles = []  # names of columns, with their units in brackets, in an array beside them
        for items in lists.values():
            entries = [item for item in items if isinstance(item, dict) and "name" in item]
            named = [f"{item['name']} [{item.get('units', item.get('unit', ''))}]" for item in entries]
            titles.append(items if all(isinstance(item, str) for item in items) else named)
        for name, item in lists.items():
            if isinstance(item[0], list) and (fitting := [words for words in titles if len(words) == len(item[0])]):
                tables[f"{key}/{name}"] = [flat_cells("", dict(zip(fitting[0], row, strict=False))) for row in item]
        columns = {name: item for name, item in lists.items() if not isinstance(item[0], dict)}
        columns = {name: item for name, item in columns.items() if f"{key}/{name}" not in tables}
        size = max(map(len, columns.values()), default=0)
        columns = {name: item for name, item in columns.items() if len(item) == size}
        tables[key] = [
            flat_cells("", dict(zip(columns, row, strict=True))) for row in zip(*columns.values(), strict=True)
        ]
        for name, item in value.items():
            if f"{key}/{name}" not in tables and name not in columns:
                _collect(f"{key}/{name}", item, tables, facts)
    elif not isinstance(value, list):
        facts |= flat_cells(key.rpartition("/")[2], value)


_FEWEST_ENTRIES: Final = 20  # of an object, above which they are rows and no sensors


def _samples(entry: Any) -> list[dict[str, str]]:
    """Cells of an object, of each sample where it holds arrays of several, which share what it says once."""
    counts = {*_counts(entry)}
    rows = [_single(entry, k) for k in range(counts.pop())] if len(counts) == 1 else [entry]
    return [flat_cells("", row) for row in rows]


def _counts(value: Any) -> Iterator[int]:
    """Lengths of the arrays of objects in an object."""
    if isinstance(value, list) and value and isinstance(value[0], dict):
        yield len(value)
    elif isinstance(value, dict):
        yield from chain.from_iterable(map(_counts, value.values()))


def _single(value: Any, k: int) -> Any:
    """An object with one entry of each array of objects in it."""
    if isinstance(value, dict):
        return {name: _single(item, k) for name, item in value.items()}
    return value[k] if isinstance(value, list) and value and isinstance(value[0], dict) else value


def flat_cells(name: str, value: Any) -> dict[str, str]:
    """Cells of an object, also of what lies in it, as ``acc.x`` and ``acc[1]``."""
    if isinstance(value, list) and value and isinstance(value[0], dict):
        raise DecodeError(f"{name} holds several samples in one object. Write an object for each sample.")
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else ((f"[{k}]", item) for k, item in enumerate(value, 1))
        keys = ((f"{name}.{key}" if name and isinstance(value, dict) else f"{name}{key}", item) for key, item in items)
        return {cell: text for key, item in keys for cell, text in flat_cells(key, item).items()}
    return {name: "" if value is None else " ".join(str(value).split())}


_LONGEST_ROW = 1 << 20  # characters; cells of a longer one would take ten times its size in memory


@dataclass(frozen=True, slots=True)
class Head:
    """What comes before the numbers."""

    names: tuple[str, ...]  # column names; empty where the file has none
    start: int  # index of the first character after the head
    line: int  # number of the line that begins there, counted from 1


def decode(raw: bytes, encoding: str) -> str:
    """Text of a file: without a byte order mark, its lines ended by one sign; DecodeError in another encoding."""
    try:
        text = raw.decode(encoding)
    except UnicodeError as error:
        at = getattr(error, "start", 0)
        line = raw.count(b"\n", 0, at) + 1
        raise DecodeError(
            f"byte {at + 1} (line {line}) is not {encoding}; declare the file's own encoding, such as encoding = 'gbk'."
        ) from error
    return normal(text)


_SIGNS: Final = {"\u00a0": " ", "\u202f": " ", "\u2009": " ", "\u2019": "'", "\u2212": "-"}


def normal(text: str) -> str:
    """Text without a byte order mark, with signs of one kind only."""
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    for sign, plain in () if text.isascii() else _SIGNS.items():
        text = text.replace(sign, plain)
    text = text.removeprefix("\ufeff")
    return re.sub(r"\x1b\[[\d;?]*[A-Za-z]", "", text) if "\x1b" in text else text


_ASCII: Final = bytes(range(128))


def text_blocks(source: bytes | Path, encoding: str) -> Iterator[bytes]:
    """Text in UTF-8 in blocks of whole lines, of a file as of `text_pieces`; errors and signs as of `decode`.

    Only the last block may end without a line end, and it holds the lines before as far as there are some.
    """
    has_ascii = _ASCII.decode(encoding, "ignore") == _ASCII.decode()  # else a line cannot be told before it is decoded

    def utf8(raw: bytes) -> bytes:
        is_same = has_ascii and raw.isascii() and b"\r" not in raw and b"\x1b" not in raw
        return raw if is_same else decode(raw, encoding).encode()

    pieces = (
        text_pieces(source)
        if isinstance(source, Path)
        else (source[place : place + AT_ONCE] for place in range(0, len(source), AT_ONCE))
    )
    before, rest = b"", b""
    try:
        for piece in pieces:
            end = piece.rfind(b"\n") + 1 if has_ascii else 0
            if end and before:
                yield before
            lines = b"".join((rest, memoryview(piece)[:end])) if end else b""
            before, rest = (utf8(lines), piece[end:]) if end else (before, rest + piece)
        yield before + utf8(rest)
    except DecodeError:
        decode(source if isinstance(source, bytes) else text_bytes(source), encoding)  # it names the place in the file
        raise


def channel(words: Sequence[str]) -> str:
    """Name of a channel by the words that name it, of which units stand in brackets."""
    return " ".join(f"[{word}]" if is_unit(word) else word for word in map(str.strip, words))


def _values_as_rows(text: str, layout: TextLayout) -> tuple[str, TextLayout]:
    """Time, words and number of each line that says one number among words; one time until a channel comes again."""
    places = [ref - 1 for ref in layout.channels if isinstance(ref, int)]
    rows, channels, first, time = list[str](), set[str](), "", ""
    for row in text.split("\n"):
        if len(cells := among_words(row)[:-1]) <= max(places):
            continue  # it says something else
        name = channel(all_words(row).split())
        if not channels or name == first or name in channels:
            first, time = first or name, cells[places[0]]
            channels.clear()
        channels.add(name)
        rows.append(f"{time}\t{name}\t{cells[places[1]]}\n")
    return "".join(rows), replace(layout, separator="\t", words=False, channels=(1, 2, 3))


def channels_as_columns(text: str, layout: TextLayout) -> tuple[str, TextLayout]:
    """Table with a row for each time of one with a row for each number (`TextLayout.channels`), and its layout."""
    text, layout = _values_as_rows(text, layout) if layout.words else (text, layout)
    head = find_head(text, layout)
    rows: dict[tuple[str, int], dict[str, str]] = {}
    counts, order, broken, places = Counter[tuple[str, str]](), list[str](), list[str](), list[int]()
    for line, row in enumerate(text[head.start :].split("\n"), head.line):
        if is_idle(row, layout.comment):
            continue
        cells = split_row(row, layout.separator, line)
        places = places or [column_index(ref, head.names, len(cells), layout) for ref in layout.channels]
        number = cells[places[-1]].strip() if len(cells) > max(places) else "cut"
        if not NUMBER[layout.decimal].fullmatch(number.replace(layout.thousands, "")) and number not in layout.missing:
            broken.append(row)
            continue
        time, *words = (cells[place].strip() for place in places[:-1])
        name = channel(words)
        rows.setdefault((time, counts[name, time]), {})[name] = number
        counts[name, time] += 1
        order.append(name)
    names = dict.fromkeys(order)
    entries = list(rows.items())
    if sum(name != other for name, other in pairwise(order)) < len(names):
        with suppress(ValueError):
            entries.sort(key=lambda entry: (0.0, *entry[0]) if is_clocklike(entry[0][0]) else (float(entry[0][0]),))
    lines = ["\t".join(("time", *names))]
    lines += ["\t".join((time, *(cells.get(name, "") for name in names))) for (time, _), cells in entries]
    plain = TextLayout("\t", layout.decimal, missing=("", *layout.missing), thousands=layout.thousands)
    return "\n".join((*lines, *broken, "")), plain


def find_head(text: str, layout: TextLayout) -> Head:
    """Find where the numbers begin; DecodeError if the marker does not come, or the file ends before."""
    lines = ((row[0].removesuffix("\n"), row.end(), k) for k, row in enumerate(re.finditer(r"[^\n]+\n?|\n", text), 2))
    last = ("", 0, 1)  # a line, and where the next one begins, and its number
    if layout.marker:
        remaining, marker = layout.occurrence, layout.marker.strip(" \t,;")
        for last in lines:
            remaining -= last[0].strip(" \t,;") == marker
            if remaining == 0:
                break
        else:
            raise DecodeError(
                f"the marker {excerpt(layout.marker)} comes {layout.occurrence - remaining} times, but the profile "
                f"expects it {layout.occurrence} times; check header.marker and header.occurrence."
            )
    last, names = [last, *islice(lines, layout.skip)][-1], list[str]()
    if layout.names:
        comment, end = "" if layout.mark else layout.comment, ("", len(text), last[2])
        last = row, _, line = next((line for line in lines if not is_idle(line[0], comment)), end)
        names = split_row(row.removeprefix(layout.mark), layout.separator, line - 1)
        last = [last, *islice(lines, layout.after_names)][-1]
    _, start, line = last
    if start >= len(text):
        raise DecodeError("the file ends before its first row of numbers; check the profile's [header].")
    names = [*names_apart(names, (*layout.cells, *[""] * len(names)))] if layout.cells else names
    return Head(tuple(map(str.strip, names)), start, line)


def split_row(row: str, separator: str, line: int) -> list[str]:
    """Cells of one row, which is line number `line`; quoted cells may hold the separator; DecodeError if too long."""
    if len(row) > _LONGEST_ROW:
        raise DecodeError(
            f"line {line} has {len(row)} characters, but a row of numbers has {_LONGEST_ROW} at most; is this the file?"
        )
    row = row.rstrip("; \r") if separator != ";" and row.rstrip().endswith(";") else row
    if separator == " ":
        return row.split()
    if separator == BLANK:
        return row.rstrip("\r").split(" ")
    separator = "," if separator == QUOTED else separator
    if '"' not in row or row.lstrip().startswith("{"):
        return row.split(separator)
    try:
        return next(csv.reader([row], delimiter=separator, strict='"|"' not in row))  # as of names beside their units
    except csv.Error as error:
        raise DecodeError(f"line {line}: {excerpt(row)} cannot be split into cells ({one_line(error)}).") from error


_IN_BRACKETS: Final = re.compile(r"[\[({][-+\d.,;\seEnaNxyzXYZ:=]*[\])}]")
_OF_AXIS: Final = re.compile(r"[\"']?\b([xyz])\b[\"']?\s*[=:]\s*", re.IGNORECASE)
_APART: Final = re.compile(r"[\s,;]")
_VECTOR: Final = re.compile(r"\[(\d+)\]")
_SAID_NUMBER: Final = re.compile(r"[-+]?(?:\d[\d.,]*|[.,]\d+)(?:[eE][-+]?\d+)?")
NUMBER: Final = {
    ".": re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?"),
    ",": re.compile(r"[-+]?(\d+(,\d+)?|,\d+)([eE][-+]?\d+)?"),
}  # A number by its decimal sign


def split_vectors(row: str, separator: str, line: int) -> list[str]:
    """Cells of a row as of `split_row`, but numbers in brackets are one."""
    inner = ";" if separator == " " else " "
    row = _IN_BRACKETS.sub(
        lambda match: re.sub(r"[,;\s]+" if separator == "," else rf"[{separator}\s]+", inner, match[0]), row
    )
    return split_row(row, separator, line)


def vector(cell: str, decimal: str) -> list[str]:
    """Numbers of a cell with two in brackets, as ``[0.1, -0.2, 9.8]``, or three without, or more; none of another.

    Axes may be named, as in ``x=0.1 y=-0.2 z=9.8``.
    """
    cell = cell.strip(" \t\"'")
    if "".join(_OF_AXIS.findall(cell)).lower() == "xyz":
        cell = _OF_AXIS.sub(" ", cell)
        cell = cell.strip() if cell[0] == " " else cell
    inner, fewest = cell.strip("[](){},; "), 2 if cell[:1] in {"[", "(", "{"} else 3
    if not _APART.search(inner):
        return []
    for sign in (r"\s*;\s*", r"\s+", *([r"\s*,\s*"] if decimal == "." else [])):
        numbers = re.split(sign, inner)
        if len(numbers) >= fewest and all(NUMBER[decimal].fullmatch(text) or text.lower() == "nan" for text in numbers):
            return numbers
    return []


def number_and_unit(cell: str) -> tuple[str, str]:
    """Number at the beginning of a cell, and what stands behind it; without a number, nothing and the cell."""
    match = _SAID_NUMBER.match(cell := cell.strip())
    return (match[0], cell[match.end() :].strip()) if match else ("", cell)


def names_apart(names: Sequence[str], forms: Sequence[str]) -> tuple[str, ...]:
    """Names of columns, or their units, of which those of a vector have numbers behind them."""
    sizes = [int(size[1]) if (size := _VECTOR.fullmatch(form)) else 0 for form in forms]
    numbered = [[f"{name}[{k}]" for k in range(1, n + 1)] or [name] for name, n in zip(names, sizes, strict=False)]
    return tuple(name for some in numbered for name in some)


def cells_apart(cells: Sequence[str], layout: TextLayout, line: int) -> list[str]:
    """Cells of a row with each number of a vector in one of its own, without units; another unit is refused."""
    numbers: list[str] = []
    for place, (cell, form) in enumerate(zip(cells, layout.cells, strict=True), 1):
        number, unit = number_and_unit(cell)
        if "#" in form:
            before, _, behind = form.rpartition("#")
            numbers.append((cell.strip().rpartition(before)[2] if before else cell.strip()).removesuffix(behind))
        elif size := _VECTOR.fullmatch(form):
            numbers += vector(cell, layout.decimal) or [cell.strip(" []()")] + [""] * (int(size[1]) - 1)
        elif form and number and unit != form and unit and not form.startswith(unit):
            raise DecodeError(
                f"line {line}, cell {place}: {excerpt(cell)} is in {unit}, but the column is in {form}. One unit is "
                "expected in each column: convert these cells."
            )
        elif form and number and not unit:
            numbers.append(f"{cell} without {form}")  # it may be cut, and is left out
        else:
            numbers.append(number if form and unit == form else cell)
    return numbers


def _before_end(text: str, start: int, end: str) -> str:
    match = re.compile(rf"^[ \t]*{re.escape(end)}[ \t,;]*$", re.MULTILINE).search(text, start)
    if match is None:
        raise DecodeError(f"the table ends before the line {excerpt(end)}, which is not there; check header.end.")
    return text[: match.start()]


def is_idle(row: str, comment: str) -> bool:
    """Tell whether a line is blank or a comment."""
    return not row.strip(" ") or bool(comment and row.startswith(comment))


_EXACT = (30, 9)  # digits, and digits after the point, of a decimal that keeps nanoseconds since 1970
_LOOKED_AT: Final = 200
_NO_ROWS: Final = "there is no row of numbers; check the profile's [header]."
_WORD: Final = 1 << 30
LEFT_OUT_MOST: Final = 0.05  # share of rows; a wrong separator, sign or column spoils most, a bad line few


@dataclass(frozen=True, slots=True)
class TextTable:
    """Columns of numbers."""

    # a vector (N,) for each column asked for, and a table (N, k) for those that are wanted side by side, by all of
    # them; NaN where missing
    columns: dict[Any, Floats]
    zero: Decimal  # what was taken from the exact column, so that its differences keep every digit; 0 without one
    rows: int  # N
    notes: tuple[Any, ...]  # what was left out
    texts: dict[ColumnRef, list[str]]  # cells of the columns that are not numbers
    line_of: Callable[[int], int]  # number of the line of a row that counts from 0
    # (N,), numbers of the rows, from 0, with those that were left out counted; None where none was
    places: Floats | None = None

    def place(self, row: int) -> str:
        """Where a row that counts from 0 stands, for messages."""
        return f"line {self.line_of(row)}"

    def of_rows(self, rows: "NDArray[np.intp] | slice", *notes: Finding) -> "TextTable":
        """The same with these rows alone, in this order, and more notes."""
        taken, line_of = np.arange(self.rows)[rows], self.line_of
        return replace(
            self,
            columns={ref: values[rows] for ref, values in self.columns.items()},
            texts={ref: [cells[row] for row in taken] for ref, cells in self.texts.items()},
            places=None if self.places is None else self.places[rows],
            line_of=lambda row: line_of(int(taken[row])),
            notes=(*self.notes, *notes),
            rows=taken.size,
        )


@dataclass(slots=True)
class _RowRoom:
    """Rows of columns side by side that become more, in room that doubles."""

    refs: tuple[ColumnRef, ...]
    room: Floats
    count: int = 0

    def add(self, columns: Sequence[Sequence[float] | NDArray[Any]]) -> None:
        """Add the rows that stand in columns."""
        before, self.count = self.count, self.count + len(columns[0])
        if self.count > len(self.room):
            room = np.empty((max(self.count, 2 * len(self.room)), len(self.refs)))
            room[:before] = self.room[:before]
            self.room = room
        for place, column in enumerate(columns):
            self.room[before : self.count, place] = column

    def columns(self) -> dict[Any, Floats]:
        """Each column, and all of them, which nobody writes to any more."""
        self.room.flags.writeable = False
        rows = self.room[: self.count]
        return dict(zip(self.refs, rows.T, strict=True)) | {self.refs: rows}


@dataclass(slots=True)
class Reading:
    """What has been read, block by block."""

    layout: TextLayout
    width: int
    places: dict[ColumnRef, int]
    exact: ColumnRef | None
    texts: dict[ColumnRef, list[str]]
    together: Sequence[tuple[ColumnRef, ...]] = ()
    expected: int = 0  # rows, about as many as there will be
    zero: Decimal | None = None
    tables: list[_RowRoom] = field(init=False)
    rows: int = 0  # so far, with those that were left out
    left_out: dict[int, tuple[int, DecodeError]] = field(default_factory=dict)  # by row: its line, and why

    def __post_init__(self) -> None:
        alone = self.places.keys() - {*self.texts, *chain(*self.together)}
        groups = (*self.together, *((ref,) for ref in self.places if ref in alone))
        self.tables = [_RowRoom(refs, np.empty((self.expected, len(refs)))) for refs in groups]

    def add_fast(self, block: bytes) -> bool:
        """Read a block by Arrow; False where it cannot."""
        import pyarrow as pa

        separator, mark = self.layout.separator, self.layout.comment.encode()
        types: dict[str, Any] = {str(place): pa.float64() for place in self.places.values()}
        types |= {str(self.places[ref]): pa.string() for ref in self.texts}
        if self.exact is not None:
            types[str(self.places[self.exact])] = pa.decimal128(*_EXACT)
        block = block if separator == ";" or b";" not in block else block.replace(b";\n", b"\n")
        if mark and mark in block and (block.startswith(mark) or b"\n" + mark in block):
            block = b"".join(row for row in block.splitlines(keepends=True) if not row.startswith(mark))
        table = parsed_csv(
            _single_blanks(block) if separator == " " else block,
            {BLANK: " ", QUOTED: ","}.get(separator, separator),
            self.width,
            types,
            null_values=list(self.layout.missing),
            decimal_point=self.layout.decimal,
        )
        if table is None:
            return False
        columns: dict[ColumnRef, Any] = {ref: table.column(str(place)) for ref, place in self.places.items()}
        if self.exact is not None:
            import pyarrow.compute as pc

            if self.zero is None and (stamps := columns[self.exact].drop_null()):
                self.zero = stamps[0].as_py()
            columns[self.exact] = pc.subtract(columns[self.exact], pa.scalar(self.zero or Decimal(0))).cast(
                pa.float64()
            )
        for ref in self.texts:
            self.texts[ref] += columns[ref].to_pylist()
        for rows in self.tables:
            rows.add([column_numbers(columns[ref]) for ref in rows.refs])
        self.rows += table.num_rows
        return True

    def add_slow(self, rows: Iterator[tuple[int, str]]) -> None:
        """Read lines one by one, and leave out those that cannot be read."""
        numbers: dict[ColumnRef, list[float]] = {ref: [] for table in self.tables for ref in table.refs}
        for line, row in rows:
            try:
                words = row_cells(row, self.layout, line)
                if len(words) != self.width:
                    raise DecodeError(
                        f"line {line} has {len(words)} cells, but most rows of numbers have {self.width}: "
                        f"{excerpt(row)}; correct the line, or the separator in the profile."
                    )
                self.add(words, line, numbers)
            except DecodeError as error:
                self.left_out[self.rows] = line, error
            self.rows += 1
        for table in self.tables:
            table.add([numbers[ref] for ref in table.refs])

    def add(self, words: Sequence[str], line: int, numbers: dict[ColumnRef, list[float]]) -> None:
        """Add the numbers and texts of a row in cells, all or none; DecodeError where a cell is not a number."""
        values = {ref: self._number(words[self.places[ref]], line, ref) for ref in numbers}
        for ref, value in values.items():
            numbers[ref].append(value)
        for ref, cells in self.texts.items():
            cells.append(words[self.places[ref]])

    def _number(self, cell: str, line: int, ref: ColumnRef) -> float:
        if cell.strip() in self.layout.missing:
            return float("nan")
        try:
            if ref != self.exact:
                return float(_plain(cell, self.layout))
            stamp = Decimal(_plain(cell, self.layout))
            if not abs(stamp) < 10**20:
                raise ValueError(cell)
        except (ValueError, InvalidOperation):
            raise _no_number(cell, line, ref, self.layout) from None
        self.zero = stamp if self.zero is None else self.zero
        return float(stamp - self.zero)

    def notes(self) -> tuple[Finding, ...]:
        """What was left out; a file of which too much cannot be read is refused."""
        if not self.left_out:
            return ()
        _, first = next(iter(self.left_out.values()))
        if len(self.left_out) > LEFT_OUT_MOST * self.rows or len(self.left_out) == self.rows:
            more = "" if len(self.left_out) == 1 else f" {len(self.left_out)} of {self.rows} rows cannot be read."
            raise DecodeError(f"{first}{more}") from first
        lines = [line for line, _ in islice(self.left_out.values(), MOST_NAMED)]
        return (lines_left_out(lines, len(self.left_out), self.rows, str(first)),)


MOST_NAMED: Final = 6  # lines that are left out and named


def lines_left_out(lines: Sequence[int], count: int, rows: int, error: str) -> Finding:
    """Note of how many lines of so many rows are left out, why the first of `lines` is, and the numbers of the next."""
    others = (*map(str, lines[1:]), *(["…"] if count > len(lines) > 1 else []))
    return warning("reading.lines_left_out", count=count, rows=rows, error=error.rstrip("."), lines=others)


def read_table(
    source: bytes | Path,
    layout: TextLayout,
    refs: Sequence[ColumnRef],
    exact: ColumnRef | None = None,
    texts: Sequence[ColumnRef] = (),
    together: Sequence[tuple[ColumnRef, ...]] = (),
) -> TextTable:
    """Read columns of a text file, by number from 1 or by name; `texts` are those that are not numbers.

    Those of a tuple in `together` are wanted side by side, too. Of the `exact` one its first value is subtracted before
    it is rounded to float64, as Unix time in ns needs.
    """
    body = _body(source, layout)
    layout = body.layout
    if layout.where and isinstance(layout.where[0], str) and layout.where[0] not in body.head.names:
        raise DecodeError(f"the column {excerpt(layout.where[0])} of header.where is nowhere in the row of names.")
    first = [row for _, row in islice(body.rows(), _LOOKED_AT)]
    if not first:
        raise DecodeError(_NO_ROWS)
    width = Counter(_size(row, layout)[0] for row in first).most_common(1)[0][0]
    size = len(source) if isinstance(source, bytes) else source.stat().st_size
    expected = round(1.05 * size * len(first) / sum(len(row) + 1 for row in first))
    places = {ref: column_index(ref, body.head.names, width, layout) for ref in refs}
    firsts = {ref: next(r for r, p in places.items() if p == place) for ref, place in places.items()}
    if twice := next((ref for ref, first in firsts.items() if ref != first), None):
        raise DecodeError(f"{firsts[twice]!r} and {twice!r} are the same column; declare it once.")
    reading = Reading(layout, width, places, exact, {ref: [] for ref in texts}, together, expected)
    plain = not (layout.words or layout.where or layout.checksum or layout.cells)
    for block, line in body.blocks():
        if not (plain and reading.add_fast(block)):
            reading.add_slow(body.block_rows(block, line))
    notes, count = (*body.cut, *reading.notes()), reading.rows - len(reading.left_out)
    if layout.rows not in (None, count):
        raise DecodeError(
            f"there are {count} complete rows of numbers, but the profile says rows = {layout.rows}; the file is cut, "
            "or is not the one that was described. If that is intended, correct the profile."
        )
    if not count:
        raise DecodeError(_NO_ROWS)
    columns = {ref: values for table in reading.tables for ref, values in table.columns().items()}
    places_read = np.delete(np.arange(float(reading.rows)), list(reading.left_out)) if reading.left_out else None
    lines = {line for line, _ in reading.left_out.values()}

    def line_number(row: int) -> int:
        return next(islice((line for line, _ in body.rows() if line not in lines), row, None))

    zero = reading.zero if reading.zero is not None else Decimal(0)
    return TextTable(columns, zero, count, notes, reading.texts, line_number, places_read)


def ended(text: str, layout: TextLayout, line: int = 1) -> tuple[str, tuple[Finding, ...]]:
    """Text from a line on that ends with a line end, and a note where its last line was cut and is left out.

    It is cut where the number of rows is declared, or a cell or a digit is missing that all rows before it have.
    """
    if text.endswith("\n"):
        return text, ()
    before, _, last = text.rpartition("\n")
    rows = [row for row in before.rsplit("\n", 20)[-20:] if not is_idle(row, layout.comment)]
    if not last.strip() or is_idle(last, layout.comment) or not rows:
        return f"{text}\n", ()
    sizes = [_size(row, layout) for row in (*rows, last)]
    width = Counter(cells for cells, _ in sizes[:-1]).most_common(1)[0][0]
    shortest = min((digits for cells, digits in sizes[:-1] if cells == width and digits != _WORD), default=-1)
    if layout.rows is None and sizes[-1][0] == width and sizes[-1][1] >= shortest:
        return f"{text}\n", ()
    return f"{before}\n", (warning("reading.last_line_cut", line=line + text.count("\n")),)


def _size(row: str, layout: TextLayout) -> tuple[int, int]:
    """Cells of a row, and digits behind the decimal sign of the last one."""
    try:
        cells = row_cells(row, layout, 0)
    except DecodeError:
        return 0, 0
    last = cells[-1].strip() if cells else ""
    if not last:
        return len(cells), -1
    return len(cells), len(last.partition(layout.decimal)[2]) if last[-1].isdigit() else _WORD


@dataclass(slots=True)
class Body:
    """Lines behind the head of a text, read as often as they are asked for."""

    again: Callable[[], Iterator[bytes]]  # blocks of the text, in UTF-8, from its beginning
    head: Head  # whose start is one of bytes
    layout: TextLayout
    cut: tuple[Finding, ...] = ()  # a note where the last line was cut and is left out

    def blocks(self) -> Iterator[tuple[bytes, int]]:
        """Blocks of whole lines, with the number of their first line."""
        line, skipped = self.head.line, self.head.start
        for block in self.again():
            skipped, lines = max(skipped - len(block), 0), block[skipped:]
            if lines and not lines.endswith(b"\n"):
                text, cut = ended(lines.decode(), self.layout, line)
                self.cut, lines = self.cut or cut, text.encode()
            if lines:
                yield lines, line
                line += lines.count(b"\n")

    def rows(self) -> Iterator[tuple[int, str]]:
        """Rows of numbers with the numbers of their lines."""
        return (item for block, line in self.blocks() for item in self.block_rows(block, line))

    def block_rows(self, block: bytes, line: int) -> Iterator[tuple[int, str]]:
        """Rows of numbers of a block."""
        for number, row in enumerate(block.decode().split("\n"), line):
            if not is_idle(row, self.layout.comment) and belongs(row, self.head.names, self.layout):
                yield number, row


def _body(source: bytes | Path, layout: TextLayout) -> Body:
    """Body of a text, which is in memory at once only where its form asks for it."""
    blocks = text_blocks(source, layout.encoding)
    first, has_more = next(blocks), next(blocks, None) is not None
    again = partial(text_blocks, source, layout.encoding) if has_more else partial(iter, (first,))
    text = first.decode()
    has_titles = layout.words and titled(text) != text
    if not (layout.separator == JSON or layout.channels or layout.end or has_titles):
        with suppress(DecodeError):  # the head may be longer than a block
            head = find_head(text, layout)
            return Body(again, replace(head, start=len(text[: head.start].encode())), layout)
    text = b"".join(again()).decode()
    text = titled(text) if has_titles else text
    if layout.separator == JSON:
        text, layout = objects_as_rows(text), replace(layout, separator="\t")
    text, cut = ended(text, layout)
    if layout.channels:
        text, layout = channels_as_columns(text, layout)
    head = find_head(text, layout)
    text = _before_end(text, head.start, layout.end) if layout.end else text
    rows = text[head.start :].encode("utf-8", "replace")
    return Body(partial(text_blocks, rows, "utf-8"), replace(head, start=0), layout, cut)


def belongs(row: str, names: Sequence[str], layout: TextLayout) -> bool:
    """Whether a row is of the sensor or the kind that is asked for."""
    if not layout.where:
        return True
    ref, word = layout.where
    place = names.index(ref) if isinstance(ref, str) else ref - 1
    body = row.split("*", 1)[0] if layout.checksum else row
    cells = among_words(body) if layout.words else body.split(None if layout.separator == " " else layout.separator)
    is_alike = cells[min(place, len(cells) - 1)].strip() == word  # words stand last, also in a row that lacks numbers
    return is_alike or (layout.words and all_words(body) == word)


def row_cells(row: str, layout: TextLayout, line: int) -> list[str]:
    """Cells of a row, without its checksum; errors as of `split_row`, and where the checksum is another."""
    row = _checked(row, line) if layout.checksum else row
    if layout.cells:
        cells = split_vectors(row, layout.separator, line)
        return cells_apart(cells, layout, line) if len(cells) == len(layout.cells) else cells
    return among_words(row) if layout.words else split_row(row, layout.separator, line)


def _checked(row: str, line: int) -> str:
    """A sentence without its checksum; DecodeError if that is missing or another."""
    text, _, digits = row.rstrip().rpartition("*")
    checksum = sentence_checksum(text[1:])
    if digits.upper() != checksum:
        raise DecodeError(f"line {line}: the checksum is {checksum}, but {excerpt(row[-8:])} stands there.")
    return text


def column_index(ref: ColumnRef, names: tuple[str, ...], width: int, layout: TextLayout) -> int:
    """Index of a column among the `width` cells of a row; DecodeError where it is not one of them."""
    if isinstance(ref, str):
        if names.count(ref) != 1:
            how = "twice or more" if ref in names else "nowhere"
            listed = excerpt(", ".join(names), 200) if names else "none, as header.names = false"
            raise DecodeError(f"the column {excerpt(ref)} is {how} in the row of names ({listed}); use its number.")
        ref = names.index(ref) + 1
    if ref > width:
        raise DecodeError(
            f"column {ref} is declared, but a row has {width} cells with the separator {layout.separator!r}; check "
            "separator and [header] in the profile."
        )
    return ref - 1


def _plain(cell: str, layout: TextLayout) -> str:
    """Number with a point; raises ValueError where Python would take what no logger means."""
    if layout.thousands and grouped(layout.thousands, layout.decimal).fullmatch(cell.strip()):
        cell = cell.replace(layout.thousands, "")
    if "_" in cell or not cell.isascii() or (layout.decimal == "," and "." in cell):
        raise ValueError(cell)
    return cell.replace(",", ".") if layout.decimal == "," else cell


@cache
def grouped(thousands: str, decimal: str) -> re.Pattern[str]:
    """Form of a number whose digits stand in groups of three."""
    return re.compile(rf"[-+]?[1-9]\d{{0,2}}({re.escape(thousands)}\d{{3}})+({re.escape(decimal)}\d*)?")


def _no_number(cell: str, line: int, ref: ColumnRef, layout: TextLayout) -> DecodeError:
    other = "," if layout.decimal == "." else "."
    if is_clocklike(cell):
        advice = f'it looks like a date or clock time: declare [time] format = "{FORM}" for the column of time'
    else:
        advice = (
            f"declare decimal = '{other}'" if other in cell else "correct it, or add it to 'missing' in the profile"
        )
    return DecodeError(
        f"line {line}, column {ref!r}: {excerpt(cell)} is not a number with decimal '{layout.decimal}'; {advice}."
    )
