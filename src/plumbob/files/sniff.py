"""How an unknown text file is laid out, found by trying: the layout in which most rows are numbers.

What is found here is tested on every row of the first part of the file, so it is not a guess; what the columns mean is
asked by `plumbob.files.draft`.
"""

import codecs
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError
from plumbob.core.units import Quantity
from plumbob.files.column_names import canonical
from plumbob.files.columns import is_clocklike
from plumbob.files.profile import BLANK, TextLayout
from plumbob.files.text_head import QUOTES, split_row

READ: Final = 1 << 20
"""Bytes that are looked at."""
TRIED: Final = 1000
"""Lines with which every layout is tried."""
FEWEST: Final = 3
"""Rows that make a table."""
ROWS: Final = 4000
"""Rows of arrays that are looked at."""
MISSING: Final = ("", "NaN", "nan", "--", "null", "NULL", "N/A", "1.#QNAN")
_COMMENTS: Final = ("#", "%", "//")
_NUMBER: Final = {
    ".": re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?"),
    ",": re.compile(r"[-+]?(\d+(,\d+)?|,\d+)([eE][-+]?\d+)?"),
}
_LAYOUTS: Final = ((";", "."), (";", ","), ("\t", "."), ("\t", ","), (",", "."), (" ", "."), (" ", ","))
_NINE: Final = tuple(f"{sensor}_{axis}" for sensor in ("mag (gauss)", "acc (m/s2)", "gyr (rad/s)") for axis in "xyz")
SENTENCES: Final = {
    "VNYMR": ("yaw (deg)", "pitch (deg)", "roll (deg)", *_NINE),
    "VNQMR": ("q_x", "q_y", "q_z", "q_w", *_NINE),
    "VNIMU": (*_NINE, "temp (degC)", "pressure (kPa)"),
    "YPR": ("yaw (deg)", "pitch (deg)", "roll (deg)"),
}
"""Fields of sentences whose makers publish them: VectorNav's (UM001, output formats), and those of Razor's firmware."""
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
    facts : mapping of str to str
        What lines before the table say, by key, lower case; the lines themselves where they say no key.
    """

    layout: TextLayout
    names: tuple[str, ...]
    units: tuple[str, ...]
    by_name: bool
    rows: list[list[str]]
    facts: Mapping[str, str]

    @property
    def width(self) -> int:
        """Cells of a row."""
        return len(self.rows[0])

    def for_cells(self, words: Sequence[str]) -> tuple[str, ...]:
        """Names or units, one for each cell of a row; empty where the file has none."""
        return (*words, *[""] * self.width)[: self.width]

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
    if (sentences := _sentences(lines, encoding)) is not None:
        return sentences
    prefix = _prefix(lines[:TRIED])
    labels = _labels(lines[:TRIED], prefix)
    plain = [_unlabelled(line, prefix, labels) for line in lines] if prefix or labels else lines
    tried = plain[:TRIED]
    best = max((_table(tried, separator, decimal) for separator, decimal in _LAYOUTS), key=lambda table: table.score)
    if len(best.rows) < FEWEST:
        raise DecodeError(
            f"no separator makes a table of it, with at least {FEWEST} rows and 2 columns of numbers. Numbers of one "
            "axis at rest are for 'plumbob allan', with --rate and --scale."
        )
    table = _table(plain, best.separator, best.decimal)
    if not (prefix or labels):
        return _headed(lines, table, encoding)
    first = lines[table.first]
    cells_text = first.partition(prefix)[2] if prefix else first
    words = _cells(cells_text, best.separator, 0)
    names = tuple(word.rpartition(labels)[0].strip(QUOTES) for word in words) if labels else ("",) * len(words)
    names = ("", *names) if prefix else names
    rows = (
        [[lines[i].partition(prefix)[0].strip(), *row] for i, row in zip(table.lines, table.rows, strict=True)]
        if prefix
        else table.rows
    )
    missing = _missing(table.rows)
    layout = TextLayout(
        best.separator, best.decimal, encoding, missing=missing, names=False, prefix=prefix, labels=labels,
        skip=table.first,
    )  # fmt: skip
    return Sample(layout, names if labels else (), (), bool(labels), rows, {})


def _sentences(lines: Sequence[str], encoding: str) -> Sample | None:
    """Rows of the commonest sentence, as ``$VNYMR,…*5A`` and ``#YPR=…``, where most lines are sentences."""
    some = [line.strip() for line in lines if line.strip()]
    heads = Counter(match[0] for line in some if (match := re.match(r"[$#!][A-Za-z]\w*[,=]", line)))
    if not heads or heads.total() < 0.5 * len(some):
        return None
    head = heads.most_common(1)[0][0]
    word, mark = head[:-1], head[-1]
    chosen = [line for line in some if line.startswith(head)]
    checked = all(re.search(r"\*[0-9A-Fa-f]{2}$", line) for line in chosen)
    rows = [[word, *line[len(head) :].partition("*")[0].split(",")] for line in chosen]
    width = Counter(map(len, rows)).most_common(1)[0][0]
    rows = [row for row in rows if len(row) == width]
    if len(rows) < FEWEST or width < FEWEST:
        return None
    skip = next(i for i, line in enumerate(lines) if line.startswith(head))
    layout = TextLayout(
        ",", encoding=encoding, names=False, skip=skip, where=(1, word), prefix=mark.strip(","), checksum=checked
    )
    names = SENTENCES.get(word.strip("$#!"), ())
    return Sample(layout, ("", *names) if len(names) == width - 1 else (), (), False, rows, {})


def _prefix(lines: Sequence[str]) -> str:
    """What ends a time or a word before the numbers of each line, as a serial monitor's arrow; empty for none."""
    some = [line for line in lines if line.strip()]
    for mark, begin in (("->", r"\s*[\d:.,]+\s*->"), (":", r"\s*[A-Za-z_]\w*\s*:\s*[-+.\d]+[,;\t ]\s*[-+.\d]")):
        if some and sum(re.match(begin, line) is not None for line in some) > 0.8 * len(some):
            return mark
    return ""


def _labels(lines: Sequence[str], prefix: str) -> str:
    """What stands between the name and the number of each cell; empty where cells are numbers alone."""
    some = [line for line in lines if line.strip()] if not prefix else []
    for mark in (":", "="):
        pair = rf"[{{\"']*[^\W\d][\w .]*[\"']?\s*{mark}\s*[-+]?[\d.]+(e[-+]?\d+)?}}?"
        line = rf"(?i)\s*{pair}(\s*[,;\t ]\s*{pair})+\s*"
        if some and sum(re.fullmatch(line, text) is not None for text in some) > 0.8 * len(some):
            return mark
    return ""


def _unlabelled(line: str, prefix: str, labels: str) -> str:
    rest = line.partition(prefix)[2] if prefix else line
    return re.sub(rf"[{{\"']*[^\W\d][\w .]*?[\"']?\s*{labels}\s*|}}", "", rest) if labels else rest


@dataclass(slots=True)
class _SniffedTable:
    separator: str
    decimal: str
    first: int
    rows: list[list[str]]
    readable: int
    lines: list[int]

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
    """Longest run of rows with as many cells, most of them numbers; comments and single bad lines do not end it."""
    best = run = _SniffedTable(separator, decimal, 0, [], 0, [])
    bad = 0
    for i, line in enumerate(lines):
        if not line.strip() or line.startswith(_COMMENTS):
            continue
        cells = _cells(line, separator, i + 1)
        count = _known_cells(cells, decimal)
        if count and run.rows and len(cells) == len(run.rows[0]):
            bad = 0
        elif count and (not run.rows or len(run.rows) < FEWEST or bad >= FEWEST):
            run, bad = _SniffedTable(separator, decimal, i, [], 0, []), 0
        else:
            bad += 1
            continue
        run.rows.append(cells)
        run.lines.append(i)
        run.readable += count
        best = max(best, run, key=lambda table: table.score)
    return best


def _cells(line: str, separator: str, number: int) -> list[str]:
    try:
        return split_row(line, separator, number)
    except DecodeError:
        return []


def _known_cells(cells: Sequence[str], decimal: str) -> int:
    """Cells that are numbers, times or missing, in a row of which at least half of what is said are; else 0."""
    said = [cell.strip() for cell in cells if cell.strip()]
    numbers = sum(_NUMBER[decimal].fullmatch(cell) is not None for cell in said)
    readable = numbers + sum(cell in MISSING or is_clocklike(cell) for cell in said)
    is_row = numbers >= 1 and 2 * readable >= len(said) and readable + len(cells) - len(said) >= 2
    return readable + len(cells) - len(said) if is_row else 0


def _value(cell: str, decimal: str) -> float:
    return float(cell.replace(",", ".")) if _NUMBER[decimal].fullmatch(cell) else float("nan")


def _headed(lines: Sequence[str], table: _SniffedTable, encoding: str) -> Sample:
    """Add names and units, and what the lines before them say."""
    before = [(i, line) for i, line in enumerate(lines[: table.first]) if line.strip()]
    width = len(table.rows[0])
    units: tuple[str, ...] = ()
    if len(before) > 1 and _are_units(split := _cells(before[-1][1], table.separator, 0)):
        units = tuple(split)
    at, line = before[-2 if units else -1] if before else (0, "")
    bare = line.lstrip("#%/ ")
    if table.separator == " " and before and len(apart := bare.split(" ")) > width:
        rows = [lines[i].split(" ") for i in table.lines]
        if all(len(row) == len(apart) for row in rows):  # each blank separates, and cells are empty
            table, width = replace(table, separator=BLANK, rows=rows), len(apart)
    names = _names(bare, table.separator, width) if before else ()
    marked = names and bare != line
    skip = at if names else table.first if any(not line.startswith(_COMMENTS) for _, line in before) else 0
    layout = TextLayout(
        separator=table.separator,
        decimal=table.decimal,
        encoding=encoding,
        comment=_comment(lines[skip + 1 if marked else skip :]),
        missing=_missing(table.rows),
        skip=skip,
        names=bool(names),
        after_names=1 if units and names else 0,
        mark=line[: len(line) - len(bare)] if marked else "",
    )
    preamble = [line for i, line in before if i < at or not names]
    return Sample(layout, names, units, bool(names), table.rows, _facts(preamble))


def _facts(lines: Sequence[str]) -> dict[str, str]:
    """What lines of keys and values say, as ``OutputRate:,60Hz`` and ``tscale,0.004``."""
    facts: dict[str, str] = {}
    for line in lines:
        match = re.match(r"\W*([\w .()/-]+?)\s*[:=,]+[\s,]*(.*)", line.lstrip("#%/ ").strip())
        key, value = (match[1], match[2]) if match else (line.strip(), "")
        facts.setdefault(key.strip().lower(), re.sub(r"[,;\s]+", " ", value).strip())
    return facts


def _names(line: str, separator: str, width: int) -> tuple[str, ...]:
    cells = tuple(cell.strip() for cell in _cells(line, separator, 0))
    fits = len(cells) == width if separator == " " else len(cells) >= min(width, max(2, width - 1))
    enough = fits and any(re.search(r"[^\W\d]", cell) for cell in cells)
    return cells if enough else ()


def _are_units(cells: Sequence[str]) -> bool:
    """Whether a row is one of units: two known ones at least, and as many as there are other words; blanks are none."""
    words = [cell.strip() for cell in cells if cell.strip()]
    units = [word for word in words if _UNIT_CELL.fullmatch(word) or _is_unit(word)]
    return len(units) > 1 and 2 * len(units) >= len(words) and not any(map(is_clocklike, words))


def _is_unit(cell: str) -> bool:
    return any(canonical(cell, kind) for kind in Quantity)


def _comment(lines: Sequence[str]) -> str:
    return next((sign for sign in _COMMENTS if any(line.startswith(sign) for line in lines)), "")


def _missing(rows: Sequence[Sequence[str]]) -> tuple[str, ...]:
    markers = {cell.strip() for row in rows for cell in row} & set(MISSING)
    return tuple(dict.fromkeys((*TextLayout(separator=",").missing, *sorted(markers))))
