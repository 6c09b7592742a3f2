"""How an unknown text file is laid out, found by trying: the layout in which most rows are numbers.

What is found here is tested on every row of the first part of the file, so it is not a guess; what the columns mean is
asked by `plumbob.files.draft`.
"""

import codecs
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError
from plumbob.core.units import Quantity, is_name
from plumbob.files.columns import is_clocklike
from plumbob.files.profile import TextLayout
from plumbob.files.text_head import split_row

READ: Final = 1 << 20
"""Bytes that are looked at."""
TRIED: Final = 1000
"""Lines with which every layout is tried."""
FEWEST: Final = 3
"""Rows that make a table."""
MISSING: Final = ("", "NaN", "nan", "--", "null", "NULL", "N/A", "1.#QNAN")
_COMMENTS: Final = ("#", "%", "//")
_NUMBER: Final = {
    ".": re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?"),
    ",": re.compile(r"[-+]?(\d+(,\d+)?|,\d+)([eE][-+]?\d+)?"),
}
_LAYOUTS: Final = ((";", "."), (";", ","), ("\t", "."), ("\t", ","), (",", "."), (" ", "."), (" ", ","))
_UNIT_CELL: Final = re.compile(r"[\[(].*[\])]")


@dataclass(frozen=True, slots=True)
class Sample:
    """The first rows of a text file.

    Attributes
    ----------
    layout : TextLayout
        How the file is laid out.
    names, units : tuple of str
        Names of the columns, as far as the file has any, and the cells of a row of units below them.
    by_name : bool
        Whether a profile may name the columns so; otherwise it must number them.
    rows : list of list of str
        Cells.
    """

    layout: TextLayout
    names: tuple[str, ...]
    units: tuple[str, ...]
    by_name: bool
    rows: list[list[str]]

    @property
    def width(self) -> int:
        """Cells of a row."""
        return len(self.rows[0])

    def cells(self, column: int) -> list[str]:
        """Cells of a column, counted from 0."""
        return [row[column].strip() for row in self.rows]

    def numbers(self, column: int) -> Floats:
        """Numbers of a column, counted from 0; NaN where a cell is none."""
        return np.array([_value(cell, self.layout.decimal) for cell in self.cells(column)])


def read_sample(path: Path) -> Sample:
    """First rows of a text file, and how it is laid out.

    Raises
    ------
    DecodeError
        If no layout makes a table of numbers of it.
    """
    with path.open("rb") as stream:
        raw = stream.read(READ)
        complete = len(raw) < READ
    text, encoding = _decoded(raw)
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    lines = lines if complete else lines[:-1]
    tried = lines[:TRIED]
    best = max((_table(tried, separator, decimal) for separator, decimal in _LAYOUTS), key=lambda table: table.score)
    if len(best.rows) < FEWEST:
        raise DecodeError(
            f"no separator makes a table of it, with at least {FEWEST} rows and 2 columns of numbers. Numbers of one "
            "axis at rest are for 'plumbob allan', with --rate and --scale."
        )
    return _headed(lines, _table(lines, best.separator, best.decimal), encoding)


@dataclass(frozen=True, slots=True)
class _SniffedTable:
    separator: str
    decimal: str
    first: int
    rows: list[list[str]]
    readable: int

    @property
    def score(self) -> tuple[int, int]:
        """Rows, then cells in them that are numbers, times or missing."""
        return (len(self.rows), self.readable)


def _decoded(raw: bytes) -> tuple[str, str]:
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return raw.decode("utf-16", "ignore"), "utf-16"
    for encoding in ("utf-8", "gbk"):
        try:
            return codecs.getincrementaldecoder(encoding)().decode(raw).removeprefix("\ufeff"), encoding
        except UnicodeDecodeError:
            continue
    return raw.decode("latin-1"), "latin-1"


def _table(lines: Sequence[str], separator: str, decimal: str) -> _SniffedTable:
    """Longest run of rows with equally many cells, most of them numbers; comments and blank lines do not end it."""
    best = _SniffedTable(separator, decimal, 0, [], 0)
    first = readable = 0
    run: list[list[str]] = []
    for i, line in enumerate(lines):
        if not line.strip() or line.startswith(_COMMENTS):
            continue
        cells = _cells(line, separator, i + 1)
        count = _known_cells(cells, decimal)
        if not count or (run and len(cells) != len(run[0])):
            run, readable = [], 0
        if count:
            first = first if run else i
            run.append(cells)
            readable += count
        if (candidate := _SniffedTable(separator, decimal, first, run, readable)).score > best.score:
            best = candidate
    return best


def _cells(line: str, separator: str, number: int) -> list[str]:
    try:
        return split_row(line, separator, number)
    except DecodeError:
        return []


def _known_cells(cells: Sequence[str], decimal: str) -> int:
    """Cells that are numbers, times or missing, in a row of which at least half are; 0 in any other."""
    numbers = sum(_NUMBER[decimal].fullmatch(cell.strip()) is not None for cell in cells)
    readable = numbers + sum(cell.strip() in MISSING or is_clocklike(cell) for cell in cells)
    return readable if numbers >= 1 and readable >= 2 and 2 * readable >= len(cells) else 0


def _value(cell: str, decimal: str) -> float:
    return float(cell.replace(",", ".")) if _NUMBER[decimal].fullmatch(cell) else float("nan")


def _headed(lines: Sequence[str], table: _SniffedTable, encoding: str) -> Sample:
    """Add names, and say how many lines come before them."""
    before = [(i, line) for i, line in enumerate(lines[: table.first]) if line.strip()]
    plain = [(i, line) for i, line in before if not line.startswith(_COMMENTS)]
    width = len(table.rows[0])
    units: tuple[str, ...] = ()
    if len(plain) > 1 and _all_units(split := _cells(plain[-1][1], table.separator, 0)):
        units, plain = tuple(split), plain[:-1]
    names = _names(plain[-1][1], table.separator, width) if plain else ()
    in_comment = _names(_bare(before[-1][1]), table.separator, width) if before and not names else ()
    skip = plain[-1][0] if names and len(plain) > 1 else 0
    if not names and plain:
        skip = table.first
    layout = TextLayout(
        separator=table.separator,
        decimal=table.decimal,
        encoding=encoding,
        comment=_comment(lines[skip:]),
        missing=_missing(table.rows),
        skip=skip,
        names=bool(names),
        after_names=1 if units and names else 0,
    )
    return Sample(layout, names or in_comment, units, bool(names), table.rows)


def _bare(line: str) -> str:
    return line.lstrip("#%/ ")


def _names(line: str, separator: str, width: int) -> tuple[str, ...]:
    cells = tuple(cell.strip() for cell in _cells(line, separator, 0))
    enough = len(cells) >= min(width, max(2, width - 1)) and any(re.search(r"[^\W\d]", cell) for cell in cells)
    return cells if enough else ()


def _all_units(cells: Sequence[str]) -> bool:
    said = [cell.strip() for cell in cells if cell.strip()]
    return len(said) > 1 and all(_UNIT_CELL.fullmatch(cell) or _is_unit(cell) for cell in said)


def _is_unit(cell: str) -> bool:
    return any(is_name(cell, kind) for kind in (None, Quantity.FIELD, Quantity.TEMPERATURE))


def _comment(lines: Sequence[str]) -> str:
    return next((sign for sign in _COMMENTS if any(line.startswith(sign) for line in lines)), "")


def _missing(rows: Sequence[Sequence[str]]) -> tuple[str, ...]:
    markers = {cell.strip() for row in rows for cell in row} & set(MISSING)
    return tuple(dict.fromkeys((*TextLayout(separator=",").missing, *sorted(markers))))
