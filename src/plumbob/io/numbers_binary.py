"""Numbers as NumPy's .npy or as raw little-endian values, read in blocks.

They are read, not mapped into memory, where every page that was touched would count as used.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.check import Floats
from plumbob.errors import DecodeError, ParameterError, one_line

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
        If it is no such array, or is cut.
    """
    try:
        array = np.load(file, mmap_mode="r", allow_pickle=False)
    except OSError:
        raise
    except Exception as error:  # NumPy has a dozen types for foreign, cut and pickled files, and for damaged headers
        raise DecodeError(f"it is no .npy file of numbers, or it is cut ({one_line(error)[:120]}).") from error
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
