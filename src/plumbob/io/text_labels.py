"""Names of parts of a recording: a column of a text file that names the part of each sample, and tables of spans."""

import csv
import math
from pathlib import Path

from plumbob._files import existing_file, reading, text_of
from plumbob.errors import DecodeError, excerpt
from plumbob.io.profile import ColumnRef, Profile
from plumbob.io.text import profile_of
from plumbob.io.text_body import Body
from plumbob.io.text_head import decode, find_head, is_idle, split_row
from plumbob.io.text_table import place_of

SPANS = ("part", "from_s", "to_s")
"""Columns of a table of spans."""


def read_labels(path: str | Path, column: ColumnRef, profile: Profile | str | Path | None = None) -> list[str]:
    """Cells of one column, one for each sample that `plumbob.io.text.read_text` gives.

    Parameters
    ----------
    path : path
        The file.
    column : int or str
        The column.
    profile : Profile or path, optional
        As for `read_text`.

    Raises
    ------
    DecodeError
        If there is no such column, or as `read_text`.
    """
    file = existing_file(path)
    layout = profile_of(file, profile)[0].layout
    with reading(file):
        raw = file.read_bytes()
        text = decode(raw, layout.encoding)
        head = find_head(text, layout)
        body = Body(raw, text, head.start, text.rfind("\n") + 1, head.line)
        rows = [split_row(row, layout.separator, n) for n, row in body.rows() if not is_idle(row, layout.comment)]
        place = place_of(column, head.names, min(map(len, rows), default=0), layout)
        return [row[place].strip() for row in rows]


def read_spans(path: str | Path) -> dict[str, tuple[float, float]]:
    """Spans of time by name, s, from a CSV file with the columns `SPANS`.

    Raises
    ------
    DecodeError
        If it is no such table, a name comes twice or a span has no length.
    """
    file, text = Path(path), text_of(path)
    found: dict[str, tuple[float, float]] = {}
    with reading(file):
        rows = csv.reader(text.splitlines())
        if tuple(cell.strip() for cell in next(rows, [])) != SPANS:
            raise DecodeError(f"the first line must be {','.join(SPANS)}.")
        for line, row in enumerate(rows, start=2):
            name, span = _span(line, row)
            if name in found:
                raise DecodeError(f"line {line}: {excerpt(name)} comes twice.")
            found[name] = span
    return found


def _span(line: int, row: list[str]) -> tuple[str, tuple[float, float]]:
    try:
        name, first, last = row[0].strip(), float(row[1]), float(row[2])
    except (IndexError, ValueError):
        raise DecodeError(f"line {line}: {excerpt(','.join(row))} is not a name and two numbers of seconds.") from None
    if not (math.isfinite(first) and first < last < math.inf):
        raise DecodeError(f"line {line}: {name} goes from {first:g} to {last:g} s; a span needs a length.")
    return name, (first, last)
