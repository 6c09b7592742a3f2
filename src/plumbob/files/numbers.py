"""Files of plain numbers, text or binary: columns without names, units or time, in blocks of bounded memory.

They are what a logger, an oscilloscope or ``numpy.save`` leaves. What they do not say (rate, scale, and for raw bytes
the type and the columns) must be declared; a text that says more than numbers is a recording (`plumbob.files.read`).
They are read, not mapped into memory, where every page that was touched would count as used.

Arrow parses a chunk of a text; what it refuses is gone through value by value, so that an error names its place. A last
number or row that nothing follows is left out, and said so: a cut (``9.81`` to ``9.8``) would read as a good number.
"""

import os
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, ParameterError, excerpt, one_line
from plumbob.core.files import existing_file, reading
from plumbob.core.findings import Finding, warning
from plumbob.files.arrow import column_numbers, parsed_csv
from plumbob.files.profile import GUIDE
from plumbob.files.text_table import single_blanks

CHUNK: Final = 1 << 20  # bytes that are read at once; a line longer than these must be the only one
_BOM: Final = b"\xef\xbb\xbf"
_TWO_OR_ONE = re.compile(rb"\s*[-+]?\d+,\d+\s*")
_ADVICE: Final = (
    f"a file of plain numbers holds only numbers and comment lines (# or %). A table with names, units or decimal "
    f"commas needs a profile: --profile FILE.toml, see {GUIDE}"
)


@dataclass(frozen=True)
class Text:
    """Numbers in a text."""

    path: Path
    separator: bytes  # between the numbers of a line: a comma, a semicolon, or empty for blanks and tabs
    columns: int  # numbers in a row
    one_line: bool  # whether all rows stand on one line
    start: int  # byte at which the first row begins
    line: int  # number of its line, from 1
    complete: bool  # whether something follows the last number (on several lines: a line end)

    @property
    def notes(self) -> tuple[Finding, ...]:
        """What is left out."""
        code = "reading.last_number_cut" if self.one_line else "reading.last_line_open"
        return () if self.complete else (warning(code),)

    def blocks(self) -> Iterator[tuple[Floats, int]]:
        """Blocks with the bytes used so far."""
        if self.one_line:
            yield from self._of_one_line()
            return
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
            # an empty line would be left out without a word
            parsed = _arrow(b"\n".join(cells) + b"\n", b",", 1) if cells and all(cells) else None
            new = _strict_cells(cells, self.line, count) if parsed is None else parsed[:, 0]
            values = np.append(rest, new)
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
                    raise DecodeError(f"after byte {done - len(rest)} no number ends in {len(rest)} bytes; {_ADVICE}.")
            if self.complete and rest.strip():
                yield rest, done


def open_text(file: Path, columns: int | None) -> Text:
    """Find the first row, and how it is laid out; DecodeError if it can be read in two ways, or there is none."""
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


def _arrow(packed: bytes, separator: bytes, columns: int) -> Floats | None:
    """Rows (N, columns), or None where Arrow refuses."""
    import pyarrow as pa

    types = {str(i): pa.float64() for i in range(columns)}
    table = parsed_csv(packed, separator.decode(), columns, types, quoted=False, null_values=[])
    return None if table is None else np.stack([column_numbers(column) for column in table.itercolumns()], axis=1)


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
    values: list[float] = []
    try:
        for cell in cells:
            if b"_" in cell:  # which Python takes, and no logger means
                raise ValueError(cell)
            values.append(float(cell))
    except ValueError:
        text = excerpt(cells[len(values)].decode("utf-8", "replace").strip())
        raise DecodeError(
            f"line {line}, value {before + len(values) + 1}: {text} is not a number; {_ADVICE}."
        ) from None
    return values


RAW: Final[dict[str, str]] = {  # types of raw values by names that are suffixes, too
    "f32": "<f4", "f64": "<f8", "i8": "<i1", "i16": "<i2", "i32": "<i4", "i64": "<i8", "u8": "<u1", "u16": "<u2",
    "u32": "<u4",
}  # fmt: skip


@dataclass(frozen=True)
class Binary:
    """A table in a file."""

    path: Path
    dtype: np.dtype[Any]  # of its values
    offset: int  # bytes before them
    rows: int
    columns: int
    by_column: bool = False  # whether the values of a column follow each other, instead of those of a row
    notes: tuple[Finding, ...] = ()

    def blocks(self) -> Iterator[tuple[Floats, int]]:
        """Blocks with the bytes used so far."""
        step = max(1, (1 << 16) // self.columns)
        row_bytes = self.columns * self.dtype.itemsize
        for start in range(0, self.rows, step):
            stop = min(start + step, self.rows)
            if self.by_column:
                places = (column * self.rows + start for column in range(self.columns))
                values = np.stack([self._values(place, stop - start) for place in places], axis=1)
            else:
                values = self._values(start * self.columns, (stop - start) * self.columns).reshape(-1, self.columns)
            yield np.ascontiguousarray(values, dtype=np.float64), self.offset + stop * row_bytes

    def _values(self, place: int, count: int) -> NDArray[Any]:
        offset = self.offset + place * self.dtype.itemsize
        values: NDArray[Any] = np.fromfile(self.path, self.dtype, count, offset=offset)
        if values.size < count:
            raise DecodeError(f"it ends after {offset + values.nbytes} bytes: it was cut while it was read.")
        return values


def open_raw(file: Path, kind: str, columns: int | None) -> Binary:
    """Open raw values of one of the types in `RAW`; DecodeError if the file does not hold whole rows."""
    if columns is None:
        raise ParameterError(f"raw {kind} values do not say how many make a row; declare the columns, 1 for one axis.")
    dtype = np.dtype(RAW[kind])
    size, row = file.stat().st_size, columns * dtype.itemsize
    if size % row:
        raise DecodeError(
            f"its {size} bytes are {size // row} rows of {columns} {kind} values and {size % row} bytes more; it is "
            "cut, or the type or the number of columns is wrong."
        )
    return Binary(file, dtype, 0, size // row, columns)


def open_npy(file: Path, columns: int | None) -> Binary:
    """Open an array of one or two dimensions; DecodeError if it is not such an array, or is cut."""
    try:
        array = np.load(file, mmap_mode="r", allow_pickle=False)
    except OSError:
        raise
    except Exception as error:  # NumPy has a dozen types for foreign, cut and pickled files, and for damaged headers
        raise DecodeError(f"it is not a .npy file of numbers, or it is cut short ({one_line(error)[:120]}).") from error
    if not isinstance(array, np.memmap) or array.dtype.kind not in "fiu" or array.ndim not in {1, 2}:
        raise DecodeError(
            "it must hold one array of real numbers, (N,) or (N, k), but it holds "
            f"{getattr(array, 'dtype', 'several arrays')} of shape {getattr(array, 'shape', 'unknown')}."
        )
    rows, width = array.shape if array.ndim == 2 else (array.size, 1)
    if width > rows:
        raise DecodeError(
            f"its shape is {array.shape}: fewer rows than columns; a row is one instant, so save array.T."
        )
    if columns not in {None, width}:
        raise DecodeError(f"its rows have {width} values, but {columns} columns are declared.")
    by_column = array.ndim == 2 and not array.flags.c_contiguous
    return Binary(file, array.dtype, int(array.offset), rows, width, by_column)


TEXT_SUFFIXES: Final = (".txt", ".csv", ".tsv", ".dat", ".log")
SUFFIXES: Final[dict[str, str]] = {
    ".npy": "npy",
    **{f".{kind}": kind for kind in RAW},
    **dict.fromkeys(TEXT_SUFFIXES, "text"),
}  # what kind of file of numbers a suffix tells; any other needs its kind declared
_LARGEST: Final = 1e30


@dataclass(frozen=True)
class Numbers:
    """An open file of numbers, which can be read again and again."""

    path: Path  # the file
    kind: str  # ``"npy"``, ``"text"`` or the type of raw values
    size: int  # length of the file, bytes
    source: Binary | Text = field(repr=False)  # how it is read
    columns: int  # numbers in a row
    notes: tuple[Finding, ...]  # what was left out

    def blocks(self, progress: Callable[[int], None] | None = None) -> Iterator[Floats]:
        """Read the file from its start, some megabytes at a time; `progress` gets how many of `size` bytes are done."""
        blocks, rows = self.source.blocks(), 0
        while True:
            with reading(self.path):  # only here, for what the caller does with a block is not this file's fault
                block, done = next(blocks, (None, self.size))
                if block is None and not rows:
                    raise DecodeError("it holds no complete row of numbers.")
            if progress is not None:
                progress(done)
            if block is None:
                return
            beyond = np.isfinite(block) & (np.abs(block) > _LARGEST)  # whose squares and their sums would overflow
            if beyond.any():
                row, column = (int(place[0]) for place in np.nonzero(beyond))
                raise DecodeError(
                    f"{self.path}: row {rows + row + 1}, column {column + 1} is {block[row, column]:g}, but no sensor "
                    f"gives more than {_LARGEST:g}; are the type, its byte order and the columns right?"
                )
            rows += len(block)
            if len(block):
                yield block

    def __iter__(self) -> Iterator[Floats]:
        """Blocks from the start, as `blocks` gives them."""
        return self.blocks()

    def read(self) -> Floats:
        """All rows at once, (N, columns)."""
        return np.concatenate(list(self))


def open_numbers(path: str | os.PathLike[str], *, kind: str | None = None, columns: int | None = None) -> Numbers:
    """Open a file of numbers; `kind` and `columns` as the suffix and the file do not say them.

    It is NumPy's ``.npy``; raw little-endian values, whose type the suffix (``.f32``, ``.i16``, …) or `kind` says; or
    text with a row a line or all on one line, which is one column unless `columns` are given, and comments (#, %).
    """
    file = existing_file(path)
    kind = _kind(file, kind)
    if columns is not None and columns < 1:
        raise ParameterError(f"columns must be a whole number of at least 1, but it is {columns}.")
    with reading(file):
        size = file.stat().st_size
        if size == 0:
            raise DecodeError("it is empty; there is no number in it.")
        source: Binary | Text
        if kind == "text":
            source = open_text(file, columns)
        else:
            source = open_npy(file, columns) if kind == "npy" else open_raw(file, kind, columns)
    return Numbers(file, kind, size, source, source.columns, source.notes)


def _kind(file: Path, kind: str | None) -> str:
    kinds = ("npy", "text", *RAW)
    chosen = SUFFIXES.get(file.suffix.lower()) if kind is None else kind
    if chosen in kinds:
        return chosen
    if kind is not None:
        raise ParameterError(f"the kind of numbers must be one of {', '.join(kinds)}, but it is '{kind}'.")
    raise ParameterError(
        f"{file}: the suffix '{file.suffix}' does not say what numbers it holds; declare the kind, one of "
        f"{', '.join(kinds)}, and for raw values the columns."
    )
