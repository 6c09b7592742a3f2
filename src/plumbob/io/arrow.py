"""Columns between Arrow and NumPy by their buffers: Arrow's own conversions import pandas wherever it is installed."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pyarrow as pa


def numbers_of(column: "pa.ChunkedArray[Any]") -> NDArray[Any]:
    """Numbers (N,) of a column; where some are missing, float64 with NaN."""
    import pyarrow as pa

    if column.null_count:
        column = column.cast(pa.float64()).fill_null(math.nan)  # type: ignore[arg-type]
    elif column.type == pa.bool_():
        column = column.cast(pa.uint8())
    parts = [np.from_dlpack(chunk) for chunk in column.chunks]
    if len(parts) == 1:
        return parts[0]
    return np.concatenate(parts) if parts else np.empty(0)


def column_of(values: NDArray[Any]) -> "pa.Array[Any]":
    """Arrow column of numbers (N,), which share its memory; of truths, eight to a byte."""
    import pyarrow as pa

    whole = np.ascontiguousarray(values)
    stored = np.packbits(whole, bitorder="little") if whole.dtype == bool else whole
    return pa.Array.from_buffers(pa.from_numpy_dtype(whole.dtype), whole.size, [None, pa.py_buffer(stored.data)])
