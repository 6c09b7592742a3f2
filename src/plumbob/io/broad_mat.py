"""Arrays of a BROAD trial in MATLAB v5, with every length checked before it is used.

SciPy's reader of such files is not used, since damaged ones can end its process [MAT-File Format, level 5].
"""

import math
import struct
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob._files import require_room
from plumbob.errors import DecodeError
from plumbob.io.broad_keys import RATE, SHAPES, require_keys, require_shapes

MAX_BYTES: Final = 256 * 1024 * 1024
"""Bytes of a file; a trial of a million rows has 145 MB, unpacked."""
MAX_VARIABLES: Final = 10_000

_KEYS = (*SHAPES, RATE)
_HEADER_BYTES = 128
_BEGINNING_BYTES = 1024
"""Bytes of a variable in which its class, shape and name must end; of other variables no more is unpacked."""

# Table 1-1: types of elements
_INT8, _INT32, _UINT32, _MATRIX, _COMPRESSED, _UTF8 = 1, 5, 6, 14, 15, 16
_DTYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}

# Table 1-3: classes of arrays
_NUMERIC = {6: "double", 7: "single", 8: "int8", 9: "uint8", 10: "int16", 11: "uint16", 12: "int32", 13: "uint32"}
_OTHER = {1: "cell", 2: "struct", 3: "object", 4: "char", 5: "sparse", 14: "int64", 15: "uint64", 16: "function"}
_OPAQUE = 17  # of MATLAB's own classes; it has a name of another kind
_COMPLEX_FLAG = 0x800


class _Variable(NamedTuple):
    """A variable, of which no more than the beginning has been unpacked.

    `element` is its packed or plain bytes at `place` in the file, `size` what they state to unpack to, and `start`
    where its numbers begin in those.
    """

    place: int
    element: memoryview
    packed: bool
    size: int
    name: str
    kind: str
    shape: tuple[int, ...]
    start: int


def load_mat(file: Path) -> dict[str, NDArray[Any]]:
    """Arrays of a trial; no other variable of the file is unpacked.

    Raises
    ------
    DecodeError
        If keys are missing or of another class, the file unpacks to too much, or it is damaged.
    """
    if (size := file.stat().st_size) > MAX_BYTES:
        raise DecodeError(f"it has {size} bytes, but a trial has {MAX_BYTES} at most; check the path.")
    raw = memoryview(file.read_bytes())
    order = {b"IM": "<", b"MI": ">"}.get(bytes(raw[_HEADER_BYTES - 2 : _HEADER_BYTES]))
    if order is None:
        raise DecodeError("its header is cut or damaged: it does not end in IM or MI; take a copy that is whole.")
    found = _variables(raw, order)
    _require(found)
    require_room(sum(found[key].size for key in _KEYS), len(raw))
    return {key: _array(found[key], order) for key in _KEYS}


def _variables(raw: memoryview, order: str) -> dict[str, _Variable]:
    """Variables by name."""
    found: dict[str, _Variable] = {}
    place, count = _HEADER_BYTES, 0
    while place < len(raw):
        with _damage_at(place):
            kind, content, _ = _part(raw, place, order)
            packed = kind == _COMPRESSED
            element = content if packed else raw[place : place + 8 + len(content)]
            variable = _variable(place, element, packed, order)
        if variable.name in found and variable.name in _KEYS:
            raise DecodeError(f"{variable.name} occurs twice; take a copy that is whole.")
        found[variable.name] = variable
        place, count = place + 8 + len(content), count + 1
        if count > MAX_VARIABLES:
            raise DecodeError(f"it has more than {MAX_VARIABLES} variables, which no trial does.")
    return found


def _variable(place: int, element: memoryview, packed: bool, order: str) -> _Variable:
    """Class, shape and name of a variable, which are its first three parts."""
    begin, _ = _unpacked(element, packed, _BEGINNING_BYTES)
    if len(begin) < 8:
        raise ValueError("it ends in its first tag")
    kind, size = struct.unpack_from(f"{order}II", begin)
    if kind != _MATRIX:
        raise ValueError(f"it is of type {kind} instead of {_MATRIX}, an array")
    kind, flags, at = _part(begin, 8, order)
    if (kind, len(flags)) != (_UINT32, 8):
        raise ValueError("its flags are not two numbers of 32 bits")
    (word,) = struct.unpack_from(f"{order}I", flags)
    if word & 0xFF == _OPAQUE:
        return _Variable(place, element, packed, 8 + size, "", "opaque", (), at)
    kind, dimensions, at = _part(begin, at, order)
    if kind != _INT32 or len(dimensions) < 8 or len(dimensions) % 4:
        raise ValueError("its dimensions are not two or more numbers of 32 bits")
    shape = struct.unpack(f"{order}{len(dimensions) // 4}i", dimensions)
    kind, name, at = _part(begin, at, order)
    if kind not in (_INT8, _UTF8) or min(shape) < 0:
        raise ValueError("its name is not text, or it has a negative dimension")
    return _Variable(place, element, packed, 8 + size, str(name, "latin-1"), _kind(word), shape, at)


def _kind(word: int) -> str:
    kind = (_NUMERIC | _OTHER).get(word & 0xFF, f"{word & 0xFF}, which does not exist")
    return f"complex {kind}" if word & _COMPLEX_FLAG else kind


def _require(found: Mapping[str, _Variable]) -> None:
    require_keys(found)
    for key in _KEYS:
        if found[key].kind not in _NUMERIC.values():
            raise DecodeError(f"{key} must be numeric, but its class is {found[key].kind}.")
    shapes = {key: found[key].shape for key in SHAPES}
    if shapes["movement"][1:] == (1,):  # MATLAB has no vectors, only tables of one column
        shapes["movement"] = shapes["movement"][:1]
    require_shapes(shapes)
    if (values := math.prod(found[RATE].shape)) != 1:
        raise DecodeError(f"{RATE} must be one number in Hz, but it is {values}.")


def _array(variable: _Variable, order: str) -> NDArray[Any]:
    """Numbers of a variable, in rows."""
    values = math.prod(variable.shape)
    with _damage_at(variable.place):
        if variable.size > variable.start + 16 + 8 * values:  # a tag, the widest numbers, and what fills 8 bytes
            raise ValueError(f"it states {variable.size} bytes for {values} numbers")
        content, whole = _unpacked(variable.element, variable.packed, variable.size + 1)
        if len(content) != variable.size or not whole:
            raise ValueError(f"it does not unpack to the {variable.size} bytes that it states")
        kind, numbers, _ = _part(content, variable.start, order)
        dtype = np.dtype(order + _DTYPES.get(kind, "f8"))
        if kind not in _DTYPES or len(numbers) != values * dtype.itemsize:
            raise ValueError(f"its numbers, of type {kind}, have {len(numbers)} bytes, and not those of {values}")
    table = np.frombuffer(numbers, dtype).reshape(variable.shape, order="F")
    rows = table.shape[:1] if variable.name == "movement" else table.shape
    return np.ascontiguousarray(table, dtype.newbyteorder("=")).reshape(rows)


def _unpacked(element: memoryview, packed: bool, most: int) -> tuple[memoryview, bool]:
    """At most so many bytes of an element, and whether that is all of it and its checksum holds."""
    if not packed:
        return element[:most], len(element) <= most
    inflate = zlib.decompressobj()
    return memoryview(inflate.decompress(element, most)), inflate.eof


def _part(data: memoryview, at: int, order: str) -> tuple[int, memoryview, int]:
    """Type and content of the element at a place, and where the next begins inside an array."""
    if at + 8 > len(data):
        raise ValueError(f"it ends in the tag at its byte {at}")
    kind, size = struct.unpack_from(f"{order}II", data, at)
    begin = at + 8
    if kind >> 16:  # a small element: size and type in one word, up to 4 bytes in the other
        kind, size, begin = kind & 0xFFFF, kind >> 16, at + 4
    if begin + size > len(data) or (begin == at + 4 and size > 4):
        raise ValueError(f"the element at its byte {at} states {size} bytes and goes beyond its end")
    return kind, data[begin : begin + size], max(at + 8, begin + size + -size % 8)


@contextmanager
def _damage_at(place: int) -> Iterator[None]:
    try:
        yield
    except (ValueError, zlib.error) as error:
        raise DecodeError(
            f"the variable at byte {place} is cut or damaged: {error}. Take a copy that is whole."
        ) from error
