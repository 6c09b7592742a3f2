"""Files of plain numbers, text or binary: columns without names, units or time, in blocks of bounded memory.

They are what a logger, an oscilloscope or ``numpy.save`` leaves. What they do not say (rate, scale, and for raw bytes
the type and the columns) must be declared; a text that says more than numbers is a recording (`plumbob.files.read`).

A text is read as any table is, in blocks, but a cell without a number is refused with its place. A last number that
nothing follows, or a last row that was cut, is left out, and said so: ``9.8`` of ``9.81`` would read as a good number.
"""

import os
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, ParameterError, excerpt
from plumbob.core.files import existing_file, reading
from plumbob.core.findings import Finding, warning
from plumbob.files.arrow import intact, text_bytes
from plumbob.files.profile import GUIDE, TextLayout
from plumbob.files.sniff import READ, decoded
from plumbob.files.text_table import Body, Head, Reading, decode, split_row, text_blocks

_COMMENT: Final = re.compile(rb"^[ \t]*[#%].*", re.MULTILINE)
_TWO_OR_ONE: Final = re.compile(r"\s*[-+]?\d+,\d+\s*")
_ADVICE: Final = (
    f"A file of plain numbers holds only numbers and comment lines (# or %). A table with names, units or decimal "
    f"commas needs a profile: --profile FILE.toml, see {GUIDE}."
)


Blocks = Iterator[tuple[Floats, int]]  # of numbers, with the bytes of the file used so far


def open_text(file: Path, columns: int | None) -> "tuple[int, tuple[Finding, ...], Callable[[], Blocks]]":
    """Columns, what is left out, and blocks of a text; DecodeError if it can be read in two ways, or holds none."""
    text, encoding = decoded(text_bytes(file, READ))
    rows = [(line, row) for line, row in enumerate(_bare(text.encode(), "").decode().split("\n"), 1) if row.strip()][:2]
    if not rows:
        raise DecodeError(f"it holds no number. {_ADVICE}")
    number, first = rows[0]
    separator = next((sign for sign in ";," if sign in first), " ")
    _refuse_decimal_comma(first, separator, columns, number)
    layout = TextLayout(separator, encoding=encoding, missing=(), names=False)

    def body() -> Body:
        """Its lines, of which those of comments are blank, and none ends in a separator."""
        return Body(lambda: (_bare(some, separator) for some in text_blocks(file, encoding)), Head((), 0, 1), layout)

    if len(rows) == 1:
        is_cut = not decode(text_bytes(file), encoding).endswith((" ", "\t", "\n", separator))
        notes, count = (warning("reading.last_number_cut"),) * is_cut, columns or 1

        def alone() -> Blocks:
            yield _one_line(body(), number, count, is_cut), file.stat().st_size

        return count, notes, alone
    width = len(split_row(first.rstrip(" \t").removesuffix(separator), separator, number))
    if columns not in {None, width}:
        raise DecodeError(f"line {number} has {width} numbers, but {columns} columns are declared. {_ADVICE}")

    def blocks() -> Blocks:
        done = 0
        for block, line in body().blocks():
            done += len(block)
            yield _parsed(layout, block, line, width), done

    for _ in (looked_at := body()).blocks():
        pass
    return width, looked_at.cut, blocks


def _parsed(layout: TextLayout, block: bytes, line: int, columns: int) -> Floats:
    """Numbers of a block that begins with a line; DecodeError where one cannot be read."""
    refs = tuple(range(1, columns + 1))
    reading = Reading(layout, columns, {ref: ref - 1 for ref in refs}, None, {}, (refs,))
    if not reading.add_fast(block):
        rows = enumerate(block.decode().split("\n"), line)
        reading.add_slow((number, row) for number, row in rows if row.strip())
    for _, error in reading.left_out.values():
        raise DecodeError(f"{error} {_ADVICE}") from error
    return reading.tables[0].columns()[refs]


def _one_line(body: Body, line: int, columns: int, is_cut: bool) -> Floats:
    """Numbers of a text whose rows all stand on one line, the last of which may be cut and is left out."""
    (row, *others), separator = filter(str.strip, b"".join(body.again()).decode().split("\n")), body.layout.separator
    if others:
        raise DecodeError(f"line {line} has more than {READ} bytes, but others follow it. {_ADVICE}")
    cells = row.split() if separator == " " else [cell.strip() for cell in row.split(separator)]
    cells = cells[:-1] if is_cut else cells
    if "" in cells:  # which would be left out without a word, as an empty line is
        raise DecodeError(f"line {line}, value {1 + cells.index('')}: '' is not a number. {_ADVICE}")
    if len(cells) % columns:
        raise DecodeError(f"its {len(cells)} numbers do not fill rows of {columns} columns; it is cut.")
    try:
        return _parsed(body.layout, "\n".join(cells).encode(), 1, 1).reshape(-1, columns)
    except DecodeError as error:
        where = re.sub(r"line (\d+), column 1\b", rf"line {line}, value \1", str(error), count=1)
        raise DecodeError(where) from error


def _bare(text: bytes, separator: str) -> bytes:
    """Text whose comments are blank, and whose lines do not end in the separator."""
    text = _COMMENT.sub(b"", text) if b"#" in text or b"%" in text else text
    return re.sub(rf"{separator}[ \t]*$".encode(), b"", text, flags=re.MULTILINE) if separator.strip() else text


def _refuse_decimal_comma(first: str, separator: str, columns: int | None, number: int) -> None:
    row = excerpt(first[:80].strip())
    if separator == ";" and "," in first:
        raise DecodeError(f"line {number}, {row}, has semicolons and commas, so the commas may be decimal. {_ADVICE}")
    if columns is None and _TWO_OR_ONE.fullmatch(first):
        raise DecodeError(
            f"line {number}, {row}, may be two whole numbers or one with a decimal comma; declare columns = 2 if it is "
            f"two. {_ADVICE}"
        )


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
    shape: tuple[int, int]  # rows and columns
    order: Literal["C", "F"] = "C"  # whether the values of a row follow each other, or those of a column

    def blocks(self) -> Blocks:
        """Blocks with the bytes used so far; each is mapped alone, so that no more of the file counts as memory."""
        rows, columns = self.shape
        step = max(1, (1 << 16) // columns)
        for start in range(0, rows, step):
            stop = min(start + step, rows)
            try:
                table = np.memmap(self.path, self.dtype, "r", self.offset, self.shape, self.order)
            except ValueError as error:
                size = self.path.stat().st_size
                raise DecodeError(f"it ends after {size} bytes: it was cut while it was read.") from error
            yield np.array(table[start:stop], np.float64, order="C"), self.offset + stop * columns * self.dtype.itemsize


def open_raw(file: Path, kind: str, columns: int | None) -> Binary:
    """Open raw values of one of the types in `RAW`; DecodeError if the file does not hold whole rows."""
    if columns is None:
        raise ParameterError(f"raw {kind} values do not say how many make a row; declare the columns, 1 for one axis.")
    dtype = np.dtype(RAW[kind])
    rows, rest = divmod(file.stat().st_size, columns * dtype.itemsize)
    if rest:
        raise DecodeError(
            f"its {file.stat().st_size} bytes are {rows} rows of {columns} {kind} values and {rest} bytes more; it is "
            "cut, or the type or the number of columns is wrong."
        )
    return Binary(file, dtype, 0, (rows, columns))


def open_npy(file: Path, columns: int | None) -> Binary:
    """Open an array of one or two dimensions; DecodeError if it is not such an array, or is cut."""
    with intact("it is not a .npy file of numbers, or it"):
        array = np.load(file, mmap_mode="r", allow_pickle=False)
    if not isinstance(array, np.memmap) or array.dtype.kind not in "fiu" or array.ndim not in {1, 2}:
        raise DecodeError(
            "it must hold one array of real numbers, (N,) or (N, k), but it holds "
            f"{getattr(array, 'dtype', 'several arrays')} of shape {getattr(array, 'shape', 'unknown')}."
        )
    rows, width = shape = array.shape if array.ndim == 2 else (array.size, 1)
    if width > rows:
        raise DecodeError(
            f"its shape is {array.shape}: fewer rows than columns; a row is one instant, so save array.T."
        )
    if columns not in {None, width}:
        raise DecodeError(f"its rows have {width} values, but {columns} columns are declared.")
    return Binary(file, array.dtype, int(array.offset), shape, "C" if array.flags.c_contiguous else "F")


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
    columns: int  # numbers in a row
    notes: tuple[Finding, ...]  # what was left out
    source: Callable[[], Blocks] = field(repr=False)  # its blocks, opened again for each pass

    def blocks(self, progress: Callable[[int], None] | None = None) -> Iterator[Floats]:
        """Read the file from its start, some megabytes at a time; `progress` gets how many of `size` bytes are done."""
        blocks, rows = self.source(), 0
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

    def read(self) -> Floats:
        """All rows at once, (N, columns)."""
        return np.concatenate(list(self.blocks()))


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
        if kind == "text":
            return Numbers(file, kind, size, *open_text(file, columns))
        table = open_npy(file, columns) if kind == "npy" else open_raw(file, kind, columns)
        return Numbers(file, kind, size, table.shape[1], (), table.blocks)


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
