"""Files of plain numbers: columns without names, units or time, in blocks of bounded memory.

They are what a logger, an oscilloscope or ``numpy.save`` leaves. What they do not say (rate, scale, and for raw bytes
the type and the columns) must be declared; a text that says more than numbers is a recording (`plumbob.files.read`).

Numbers as NumPy's .npy or as raw little-endian values, read in blocks.

They are read, not mapped into memory, where every page that was touched would count as used.
"""

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, ParameterError, one_line
from plumbob.core.files import existing_file, reading
from plumbob.files.numbers_text import Text, open_text

RAW: Final[dict[str, str]] = {
    "f32": "<f4",
    "f64": "<f8",
    "i8": "<i1",
    "i16": "<i2",
    "i32": "<i4",
    "i64": "<i8",
    "u8": "<u1",
    "u16": "<u2",
    "u32": "<u4",
}
"""Types of raw values by their names, which are also suffixes."""

_BLOCK_VALUES: Final = 1 << 16


@dataclass(frozen=True)
class Binary:
    """A table in a file.

    Attributes
    ----------
    path : Path
        The file.
    dtype : dtype
        Of its values.
    offset : int
        Bytes before them.
    rows, columns : int
        Size of the table.
    by_column : bool
        Whether the values of a column follow each other, instead of those of a row.
    """

    path: Path
    dtype: np.dtype[Any]
    offset: int
    rows: int
    columns: int
    by_column: bool = False
    notes: tuple[str, ...] = ()

    def blocks(self) -> Iterator[tuple[Floats, int]]:
        """Blocks with the bytes used so far."""
        step = max(1, _BLOCK_VALUES // self.columns)
        row_bytes = self.columns * self.dtype.itemsize
        for start in range(0, self.rows, step):
            stop = min(start + step, self.rows)
            values = self._columnwise(start, stop) if self.by_column else self._rowwise(start, stop)
            yield np.ascontiguousarray(values, dtype=np.float64), self.offset + stop * row_bytes

    def _rowwise(self, start: int, stop: int) -> NDArray[Any]:
        return self._values(start * self.columns, (stop - start) * self.columns).reshape(-1, self.columns)

    def _columnwise(self, start: int, stop: int) -> NDArray[Any]:
        places = (column * self.rows + start for column in range(self.columns))
        return np.stack([self._values(place, stop - start) for place in places], axis=1)

    def _values(self, place: int, count: int) -> NDArray[Any]:
        offset = self.offset + place * self.dtype.itemsize
        values: NDArray[Any] = np.fromfile(self.path, self.dtype, count, offset=offset)
        if values.size < count:
            raise DecodeError(f"it ends after {offset + values.nbytes} bytes: it was cut while it was read.")
        return values


def open_raw(file: Path, kind: str, columns: int | None) -> Binary:
    """Open raw values of one of the types in `RAW`.

    Raises
    ------
    ParameterError
        If the columns are not declared.
    DecodeError
        If the file does not hold whole rows.
    """
    if columns is None:
        raise ParameterError(f"raw {kind} values do not say how many make a row; declare the columns, 1 for one axis.")
    dtype = np.dtype(RAW[kind])
    size, row = file.stat().st_size, columns * dtype.itemsize
    if size % row:
        raise DecodeError(
            f"its {size} bytes are {size // row} rows of {columns} {kind} values and {size % row} bytes more; it is "
            "cut, or the type or the columns are others."
        )
    return Binary(file, dtype, 0, size // row, columns)


def open_npy(file: Path, columns: int | None) -> Binary:
    """Open an array of one or two dimensions.

    Raises
    ------
    DecodeError
        If it is not such an array, or is cut.
    """
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
}
"""What kind of file of numbers a suffix tells; any other needs its kind declared."""
_LARGEST: Final = 1e30


@dataclass(frozen=True)
class Numbers:
    """An open file of numbers, which can be read again and again.

    Attributes
    ----------
    path : Path
        The file.
    kind : str
        ``"npy"``, ``"text"`` or the type of raw values.
    size : int
        Length of the file, bytes.
    source : Binary or Text
        How it is read.
    """

    path: Path
    kind: str
    size: int
    source: Binary | Text = field(repr=False)

    @property
    def columns(self) -> int:
        """Numbers in a row."""
        return self.source.columns

    @property
    def notes(self) -> tuple[str, ...]:
        """What was left out, in words."""
        return self.source.notes

    def blocks(self, progress: Callable[[int], None] | None = None) -> Iterator[Floats]:
        """Read the file from its start.

        Parameters
        ----------
        progress : callable, optional
            Is given after every block how many of `size` bytes are done.

        Yields
        ------
        ndarray (rows, columns)
            The next rows; some megabytes at most.

        Raises
        ------
        DecodeError
            If something is not a number, or beyond every sensor, or a row has another number of them.
        """
        blocks, rows = self.source.blocks(), 0
        while True:
            with reading(self.path):  # only here, for what the caller does with a block is not this file's fault
                block, done = next(blocks, (None, self.size))
                if block is None and not rows:
                    raise DecodeError("it holds no whole row of numbers.")
            if progress is not None:
                progress(done)
            if block is None:
                return
            self._require_measured(block, rows)
            rows += len(block)
            if len(block):
                yield block

    def _require_measured(self, block: Floats, rows: int) -> None:
        """Refuse numbers whose squares and their sums would overflow; NaN and infinity are judged by who knows them."""
        beyond = np.isfinite(block) & (np.abs(block) > _LARGEST)
        if beyond.any():
            row, column = (int(place[0]) for place in np.nonzero(beyond))
            raise DecodeError(
                f"{self.path}: row {rows + row + 1}, column {column + 1} is {block[row, column]:g}, but no sensor "
                f"gives more than {_LARGEST:g}; are the type, its byte order and the columns right?"
            )

    def __iter__(self) -> Iterator[Floats]:
        """Blocks from the start, as `blocks` gives them."""
        return self.blocks()

    def read(self) -> Floats:
        """All rows at once, (N, columns)."""
        return np.concatenate(list(self))


def open_numbers(path: str | os.PathLike[str], *, kind: str | None = None, columns: int | None = None) -> Numbers:
    """Open a file of numbers.

    Parameters
    ----------
    path : path
        NumPy's ``.npy``; raw little-endian values, where the suffix (``.f32``, ``.i16``, …) or `kind` says their type;
        or text: numbers between blanks, commas or semicolons, one row a line or all on one line, with lines of comment
        that begin with # or %.
    kind : str, optional
        ``"npy"``, ``"text"`` or a raw type, where the suffix does not say it.
    columns : int, optional
        Numbers in a row: needed for raw values; elsewhere the file must agree. A text of a single line is one column
        without it.

    Raises
    ------
    DecodeError
        If there is no such file, it is empty or cut, or is not what it claims to be.
    ParameterError
        If the kind or the columns must be declared and are not, or cannot be.
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
    return Numbers(file, kind, size, source)


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
