"""The head of a text file: markers, lines to skip, comments and the row of names; and the cells of a row."""

import csv
import re
from dataclasses import dataclass
from typing import Final

from plumbob.core.errors import DecodeError, excerpt, one_line
from plumbob.files.profile import BLANK, TextLayout

TOKEN: Final = re.compile(
    r"(?<![\w.^:-])(?:\d{4}[-/]\d{1,2}[-/]\d{1,2}[T ])?\d{1,2}:\d\d:\d\d(?:[.,:]\d+)?(?:Z\b)?|"
    r"(?<![\w.^+-])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\d.:x^])|\b(?:nan|NaN|null)\b"
)
"""A number or a clock time among words; not a digit of a name, an exponent or a code."""


def label(text: str) -> str:
    """Words of what stands before a number, without what separates, as in ``"accel":{"x":`` and ``], Gyr (dps) [``."""
    words = " ".join(re.sub(r":\s*\"[^\"]*\"|[\]\[{}\"':=,;|<>]|->", " ", text).split())
    return words if re.search(r"\w", words) else ""


def among_words(row: str) -> list[str]:
    """Numbers and clock times of a row of words and numbers, and behind them the words before the first number."""
    numbers = list(TOKEN.finditer(row))
    first = next((number for number in numbers if ":" not in number[0]), None)
    before = numbers[0].end() if first and numbers[0] is not first else 0
    return [*(number[0] for number in numbers), label(row[before : first.start()]) if first else ""]


def single_blanks(text: str) -> str:
    """Text with runs of blanks and tabs made one blank, and none at the ends of its lines."""
    text = text.replace("\t", " ")
    while "  " in text:
        text = text.replace("  ", " ")
    return text.replace("\n ", "\n").replace(" \n", "\n").removeprefix(" ")


_LONGEST_ROW = 1 << 20
"""Characters of a row; cells of a longer one, which no logger writes, would take ten times its size in memory."""


@dataclass(frozen=True, slots=True)
class Head:
    """What comes before the numbers.

    Attributes
    ----------
    names : tuple of str
        Column names; empty where the file has none.
    start : int
        Index of the first character after the head.
    line : int
        Number of the line that begins there, counted from 1.
    """

    names: tuple[str, ...]
    start: int
    line: int


def decode(raw: bytes, encoding: str) -> str:
    r"""Text of a file: without a byte order mark, its lines ended by ``\n``.

    Raises
    ------
    DecodeError
        If a byte does not belong to the encoding.
    """
    try:
        text = raw.decode(encoding)
    except UnicodeError as error:
        at = getattr(error, "start", 0)
        line = raw.count(b"\n", 0, at) + 1
        raise DecodeError(
            f"byte {at + 1} (line {line}) is not {encoding}; declare the file's own encoding, such as encoding = 'gbk'."
        ) from error
    text = text.removeprefix("\ufeff")
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def find_head(text: str, layout: TextLayout) -> Head:
    """Find where the numbers begin.

    Raises
    ------
    DecodeError
        If the marker does not come, or the file ends before.
    """
    place, line = _after_marker(text, layout) if layout.marker else (0, 1)
    place, line = _forward(text, place, line, layout.skip)
    names: tuple[str, ...] = ()
    if layout.names:
        place, line = _past_comments(text, place, line, "" if layout.mark else layout.comment)
        row = text[place : _end(text, place)].removeprefix(layout.mark)
        names = tuple(cell.strip() for cell in split_row(row, layout.separator, line))
        place, line = _forward(text, place, line, 1 + layout.after_names)
    if place >= len(text):
        raise DecodeError("the file ends before its first row of numbers; check the profile's [header].")
    return Head(names, place, line)


def split_row(row: str, separator: str, line: int) -> list[str]:
    """Cells of one row, which is line number `line`; quoted cells may hold the separator.

    Raises
    ------
    DecodeError
        If a quote is not closed, or the row or a cell is absurdly long.
    """
    if len(row) > _LONGEST_ROW:
        raise DecodeError(
            f"line {line} has {len(row)} characters, but a row of numbers has {_LONGEST_ROW} at most; is this the file?"
        )
    if separator == " ":
        return row.split()
    if separator == BLANK:
        return row.rstrip("\r").split(" ")
    if '"' not in row or row.lstrip().startswith("{"):
        return row.split(separator)
    try:
        return next(csv.reader([row], delimiter=separator, strict=True))
    except csv.Error as error:
        raise DecodeError(f"line {line}: {excerpt(row)} cannot be split in cells ({one_line(error)}).") from error


def _after_marker(text: str, layout: TextLayout) -> tuple[int, int]:
    place, line, remaining = 0, 1, layout.occurrence
    while place < len(text):
        end = _end(text, place)
        remaining -= text[place:end].rstrip(" \t,;") == layout.marker.rstrip(" \t,;")
        place, line = end + 1, line + 1
        if remaining == 0:
            return place, line
    raise DecodeError(
        f"the marker {excerpt(layout.marker)} comes {layout.occurrence - remaining} times, but the profile expects it "
        f"{layout.occurrence} times; check header.marker and header.occurrence."
    )


def _forward(text: str, place: int, line: int, lines: int) -> tuple[int, int]:
    for _ in range(lines):
        if place >= len(text):
            break
        place, line = _end(text, place) + 1, line + 1
    return place, line


def _past_comments(text: str, place: int, line: int, comment: str) -> tuple[int, int]:
    while place < len(text) and is_idle(text[place : _end(text, place)], comment):
        place, line = _end(text, place) + 1, line + 1
    return place, line


def is_idle(row: str, comment: str) -> bool:
    """Tell whether a line is blank or a comment."""
    return not row.strip(" ") or bool(comment and row.startswith(comment))


def _end(text: str, place: int) -> int:
    end = text.find("\n", place)
    return len(text) if end < 0 else end
