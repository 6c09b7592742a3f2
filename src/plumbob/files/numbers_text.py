"""Numbers as text, read in chunks of bytes, so that neither the file nor a line of it must fit in memory.

Arrow parses a chunk; what it refuses is gone through value by value, so that an error names its place. A last number
or row that nothing follows is left out, and said so: a cut (``9.81`` to ``9.8``) would read as a good number.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, excerpt
from plumbob.data.recording import CUT
from plumbob.files.arrow import column_numbers
from plumbob.files.profile_toml import GUIDE
from plumbob.files.text_head import single_blanks

CHUNK: Final = 1 << 20
"""Bytes that are read at once; a line longer than these must be the only one."""

_BOM: Final = b"\xef\xbb\xbf"
_TWO_OR_ONE = re.compile(rb"\s*[-+]?\d+,\d+\s*")
_ADVICE: Final = (
    f"a file of plain numbers holds only numbers and comment lines (# or %). A table with names, units or decimal "
    f"commas needs a profile: --profile FILE.toml, see {GUIDE}"
)


@dataclass(frozen=True)
class Text:
    """Numbers in a text.

    Attributes
    ----------
    path : Path
        The file.
    separator : bytes
        Between the numbers of a line: a comma, a semicolon, or empty for blanks and tabs.
    columns : int
        Numbers in a row.
    one_line : bool
        Whether all rows stand on one line.
    start, line : int
        Byte at which the first row begins, and the number of its line, counted from 1.
    complete : bool
        Whether something follows the last number (on several lines: a line end).
    """

    path: Path
    separator: bytes
    columns: int
    one_line: bool
    start: int
    line: int
    complete: bool

    @property
    def notes(self) -> tuple[str, ...]:
        """What is left out."""
        what = "number has nothing after it" if self.one_line else "line has no line end"
        return () if self.complete else (f"{CUT}the last {what}, and was left out: the file may be incomplete",)

    def blocks(self) -> Iterator[tuple[Floats, int]]:
        """Blocks with the bytes used so far."""
        return self._of_one_line() if self.one_line else self._of_lines()

    def _of_lines(self) -> Iterator[tuple[Floats, int]]:
        line = self.line
        for chunk, done in self._chunks(b"\n"):
            rows = _parsed_lines(chunk, self.separator, self.columns)
            yield _strict_lines(chunk, self, line) if rows is None else rows, done
            line += chunk.count(b"\n")

    def _of_one_line(self) -> Iterator[tuple[Floats, int]]:
        count, rest = 0, np.empty(0)
        for chunk, done in self._chunks(self.separator or b" "):
            before, _, after = chunk.partition(b"\n")
            if after.strip():
                raise DecodeError(
                    f"line {self.line} has more than {CHUNK} bytes, so it must be the only one, but more follow."
                )
            cells = _cells(before, self.separator)
            parsed = _parsed_cells(cells)
            values = np.append(rest, _strict_cells(cells, self.line, count) if parsed is None else parsed)
            count += len(cells)
            size = values.size // self.columns * self.columns
            rest = values[size:]
            yield values[:size].reshape(-1, self.columns), done
        if rest.size:
            raise DecodeError(f"its {count} numbers do not fill rows of {self.columns} columns; it is cut.")

    def _chunks(self, end: bytes) -> Iterator[tuple[bytes, int]]:
        """Parts of the file that stop after an `end`, and the bytes used up to there."""
        with self.path.open("rb") as stream:
            stream.seek(self.start)
            done, rest = self.start, b""
            while data := stream.read(CHUNK):
                done += len(data)
                part, ending, rest = (rest + data).replace(b"\t", b" ").rpartition(end)
                if ending:
                    yield part + ending, done - len(rest)
                elif len(rest) > 2 * CHUNK:
                    raise DecodeError(f"after byte {done - len(rest)} no number ends for {len(rest)} bytes; {_ADVICE}.")
            if self.complete and rest.strip():
                yield rest, done


def open_text(file: Path, columns: int | None) -> Text:
    """Find the first row, and how it is laid out.

    Raises
    ------
    DecodeError
        If it holds no number, or its first row can be read in two ways.
    """
    with file.open("rb") as stream:
        start, number, first = _first_row(stream)
        one_line = not (first.endswith(b"\n") and _first_row(stream)[2])
        stream.seek(-1, 2)
        complete = stream.read(1) in ((b" ", b"\t", b"\r", b"\n", b",", b";") if one_line else (b"\n",))
    if not first:
        raise DecodeError(f"it holds no number; {_ADVICE}.")
    separator = b";" if b";" in first else b"," if b"," in first else b""
    _refuse_decimal_comma(first, separator, columns, number)
    width = 1 if one_line else len(_strict_cells(_cells(first, separator), number))
    if not one_line and columns not in {None, width}:
        raise DecodeError(f"line {number} has {width} numbers, but {columns} columns are declared; {_ADVICE}.")
    return Text(file, separator, columns or width, one_line, start, number, complete)


def _first_row(stream: BinaryIO) -> tuple[int, int, bytes]:
    """Place, line number and (at most the first `CHUNK` bytes of) the next line that is neither blank nor comment."""
    number, inside = 0, False
    while True:
        start = stream.tell()
        line = stream.readline(CHUNK)
        number += not inside
        if start == 0 and line.startswith(_BOM):
            start, line = len(_BOM), line.removeprefix(_BOM)
        if not line or not (inside or _is_idle(line)):
            return start, number, line
        inside = not line.endswith(b"\n")  # a comment longer than a chunk goes on


def _is_idle(line: bytes) -> bool:
    return line.lstrip()[:1] in {b"", b"#", b"%"}


def _refuse_decimal_comma(first: bytes, separator: bytes, columns: int | None, number: int) -> None:
    row = excerpt(first[:80].decode("utf-8", "replace").strip())
    if separator == b";" and b"," in first:
        raise DecodeError(f"line {number}, {row}, has semicolons and commas, so the commas may be decimal; {_ADVICE}.")
    if columns is None and _TWO_OR_ONE.fullmatch(first):
        raise DecodeError(
            f"line {number}, {row}, may be two whole numbers or one with a decimal comma; declare columns = 2 if it is "
            f"two; {_ADVICE}."
        )


def _cells(line: bytes, separator: bytes) -> list[bytes]:
    """Cells of a line; a separator at its end closes the last one."""
    if not separator:
        return line.split()
    return line.strip().removesuffix(separator).split(separator) if line.strip() else []


def _parsed_lines(chunk: bytes, separator: bytes, columns: int) -> Floats | None:
    if b"#" in chunk or b"%" in chunk:
        chunk = b"".join(line for line in chunk.splitlines(keepends=True) if not _is_idle(line))
    chunk = chunk.replace(b"\r\n", b"\n")
    if separator:
        packed = chunk.replace(separator + b"\n", b"\n")
    else:
        packed = single_blanks(chunk.decode("latin-1")).encode("latin-1")
    return _arrow(packed, separator or b" ", columns) if packed.strip() else np.empty((0, columns))


def _parsed_cells(cells: list[bytes]) -> Floats | None:
    if not all(cells):  # an empty line would be left out without a word
        return None
    values = _arrow(b"\n".join(cells) + b"\n", b",", 1) if cells else np.empty((0, 1))
    return None if values is None else values[:, 0]


def _arrow(packed: bytes, separator: bytes, columns: int) -> Floats | None:
    """Rows (N, columns), or None where Arrow refuses."""
    import pyarrow as pa
    from pyarrow import csv

    names = [str(i) for i in range(columns)]
    source: Any = pa.BufferReader(pa.py_buffer(packed))
    try:
        table = csv.read_csv(
            source,
            read_options=csv.ReadOptions(column_names=names, use_threads=False, block_size=len(packed) + 1),
            parse_options=csv.ParseOptions(delimiter=separator.decode(), quote_char=False),
            convert_options=csv.ConvertOptions(column_types=dict.fromkeys(names, pa.float64()), null_values=[]),
        )
    except (pa.ArrowException, OSError, ValueError):
        return None
    return np.stack([column_numbers(column) for column in table.itercolumns()], axis=1)


def _strict_lines(chunk: bytes, text: Text, first: int) -> Floats:
    """Rows of a chunk, line by line; `first` is the number of its first line."""
    rows = []
    for number, line in enumerate(chunk.split(b"\n"), first):
        if _is_idle(line):
            continue
        cells = _cells(line, text.separator)
        if len(cells) != text.columns:
            raise DecodeError(
                f"line {number} has {len(cells)} numbers, but line {text.line}, the first, has {text.columns}: "
                f"{excerpt(line.decode('utf-8', 'replace').strip())}; correct or delete it."
            )
        rows.append(_strict_cells(cells, number))
    return np.array(rows, dtype=np.float64).reshape(-1, text.columns)


def _strict_cells(cells: list[bytes], line: int, before: int = 0) -> list[float]:
    """Numbers of a line, of which `before` came before these."""
    return [_number(cell, line, place) for place, cell in enumerate(cells, before + 1)]


def _number(cell: bytes, line: int, place: int) -> float:
    try:
        if b"_" in cell:  # which Python takes, and no logger means
            raise ValueError(cell)
        return float(cell)
    except ValueError:
        text = excerpt(cell.decode("utf-8", "replace").strip())
        raise DecodeError(f"line {line}, value {place}: {text} is not a number; {_ADVICE}.") from None
