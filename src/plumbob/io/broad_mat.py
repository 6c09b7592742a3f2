"""Arrays of a BROAD trial in MATLAB v5, with bounds on what a file may unpack to."""

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob._files import require_room
from plumbob.errors import DecodeError, PlumbobError, one_line
from plumbob.io.broad_keys import RATE, SHAPES, require_keys, require_shapes

MAX_UNPACKED: Final = 256 * 1024 * 1024
"""Bytes that a file may unpack to; a trial of a million rows has 145 MB."""

_HEADER_BYTES = 128
_COMPRESSED = 15  # miCOMPRESSED, MAT-File Format, table 1-1
_STEP = 1024 * 1024
_NUMERIC = {"double", "single", "logical", "int8", "uint8", "int16", "uint16", "int32", "uint32"}


def load_mat(file: Path) -> dict[str, NDArray[Any]]:
    """Arrays of a trial; no other variable of the file is unpacked.

    Raises
    ------
    DecodeError
        If keys are missing or of another class, the file unpacks to too much, or it is damaged.
    """
    from scipy.io import loadmat, whosmat

    try:
        require_room(_unpacked_bytes(file), file.stat().st_size)
        found = {name: (shape, kind) for name, shape, kind in whosmat(str(file))}
        _require(found)
        content = loadmat(str(file), variable_names=[*SHAPES, RATE])
        return {key: _array(key, content[key]) for key in (*SHAPES, RATE)}
    except PlumbobError:
        raise
    except Exception as error:  # SciPy raises many types for damaged input
        raise DecodeError(f"it is cut or damaged ({one_line(error)[:160]}); take a copy that is whole.") from error


def _require(found: Mapping[str, tuple[tuple[int, ...], str]]) -> None:
    require_keys(found)
    for key in (*SHAPES, RATE):
        if found[key][1] not in _NUMERIC:
            raise DecodeError(f"{key} must be numeric, but its class is {found[key][1]}.")
    shapes = {key: shape for key, (shape, _) in found.items() if key in SHAPES}
    if shapes["movement"][1:] == (1,):  # MATLAB has no vectors, only tables of one column
        shapes["movement"] = shapes["movement"][:1]
    require_shapes(shapes)


def _array(key: str, value: NDArray[Any]) -> NDArray[Any]:
    rows = value.shape[:1] if key == "movement" else value.shape
    return np.ascontiguousarray(value).reshape(rows)


def _unpacked_bytes(file: Path) -> int:
    """Unpack every element in steps and throw it away, to know the size before anything is kept."""
    _require_budget(file.stat().st_size)
    raw = file.read_bytes()
    order = "<" if raw[126:128] == b"IM" else ">"
    place, total = _HEADER_BYTES, 0
    while place + 8 <= len(raw):
        kind, size = struct.unpack_from(f"{order}II", raw, place)
        element = memoryview(raw)[place + 8 : place + 8 + size]
        total += _unpacked(element, MAX_UNPACKED - total) if kind == _COMPRESSED else len(element)
        _require_budget(total)
        place += 8 + size
    return total


def _require_budget(size: int) -> None:
    if size > MAX_UNPACKED:
        raise DecodeError(f"it unpacks to more than {MAX_UNPACKED >> 20} MiB, which no trial does.")


def _unpacked(element: memoryview, budget: int) -> int:
    inflate, total, rest = zlib.decompressobj(), 0, bytes(element)
    while rest and total <= budget:
        total += len(inflate.decompress(rest, _STEP))
        rest = inflate.unconsumed_tail
    return total
