"""Named arrays in containers, with every length checked before it is used: MATLAB, HDF5, NetCDF-4 among it, NumPy.

An array is named by its path: ``imu/gyr`` is the data set of a group in HDF5, and the field of a struct in MATLAB, HDF5
or NumPy. SciPy's reader of MATLAB v5 is not used, since damaged files can end its process [MAT-File Format, level 5].
Links and data in other files are refused in HDF5, in which MATLAB v7.3 keeps its tables transposed; that is undone here
[MathWorks, MAT-File Versions].
"""

import io
import math
import struct
import zipfile
import zlib
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from itertools import islice
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.errors import DecodeError, excerpt
from plumbob.core.files import require_room
from plumbob.core.series import needed
from plumbob.core.text import first_words
from plumbob.files.arrow import intact
from plumbob.files.foreign.logged import first_bytes
from plumbob.files.foreign.parts import Parts

PROFILE: Final = "plumbob_profile"  # where a file keeps its profile: a text in MATLAB, an attribute in NetCDF
HDF5_SIGNATURE: Final = b"\x89HDF\r\n\x1a\n"
_MAT5_SIGNATURE: Final = b"MATLAB 5.0"
_MAT73: Final = b"MATLAB 7.3"
_MAX_BYTES: Final = 256 << 20  # bytes of a MATLAB v5 file, which is read as a whole
_MAX_ARRAYS: Final = 1000
MAX_VARIABLES: Final = 10_000
_NUMBERS: Final = "fiub"  # kinds of NumPy's types that are numbers
_HEADER_BYTES: Final = 128
_CHUNK_SLACK: Final = 1_000_000  # values; a writer may choose chunks larger than a short data set
_BEGINNING_BYTES: Final = 1024  # in which class, shape and name must end; of other variables no more is unpacked
_DEEPEST: Final = 6  # structs or groups in each other
_NO_NUMBERS: Final = "data set that is not of numbers"


class Arrays(ABC):
    """Arrays of one file by their names; subclasses list them without loading, and load some."""

    def __init__(self) -> None:
        self.shapes: dict[str, tuple[int, ...]] = {}  # of those of numbers
        self.others: dict[str, str] = {}  # and what the others are
        self.units: dict[str, str] = {}  # that attributes say
        self.profile = ""  # that the file holds itself; its tables then have a row for each sample, however few
        self._fields: dict[str, tuple[str, str]] = {}  # of structured arrays, with where each lies

    def load(self, names: list[str]) -> dict[str, NDArray[Any]]:
        """Load arrays, each in its own type."""
        places = {name: self._fields.get(name, (name, ())) for name in names}
        arrays = self._loaded(dict.fromkeys(path for path, _ in places.values()))
        return {name: arrays[path][part] for name, (path, part) in places.items()}

    @abstractmethod
    def _loaded(self, names: Iterable[str]) -> dict[str, NDArray[Any]]:
        """Load arrays that are no fields of others."""

    def summary(self) -> str:
        """Names and shapes for a message."""
        entries = [f"{name} {'×'.join(map(str, shape)) or '1'}" for name, shape in self.shapes.items()]
        entries += [f"{name} ({kind})" for name, kind in self.others.items()]
        return first_words(entries, 20) or "nothing"

    def _add_fields(self, name: str, shape: Sequence[int], dtype: np.dtype[Any]) -> None:
        """List the fields of a structured array as ``name/field``."""
        for field in dtype.names or ():
            self._fields[f"{name}/{field}"] = (name, field)
            if dtype[field].base.kind in _NUMBERS:
                self.shapes[f"{name}/{field}"] = (*shape, *dtype[field].shape)
            else:
                self.others[f"{name}/{field}"] = _NO_NUMBERS


def open_arrays(file: Path) -> Arrays:
    """Arrays of a file, by its first bytes."""
    start = first_bytes(file)
    if start.startswith(_MAT5_SIGNATURE):
        return _Mat5(file)
    if start.startswith(HDF5_SIGNATURE) or start[512:520] == HDF5_SIGNATURE:
        return Hdf5Arrays(file, transposed=start.startswith(_MAT73))
    if start.startswith((b"PK", b"\x93NUMPY")):
        return _Npz(file)
    raise DecodeError("it is neither MATLAB v5 or v7.3, nor HDF5, nor NumPy's .npy or .npz; save it as one of these.")


# Table 1-1: types of elements
_INT8, _INT32, _UINT32, _MATRIX, _COMPRESSED, _UTF8 = 1, 5, 6, 14, 15, 16
_OF_8_BITS = (_INT8, 2, _UTF8)
_DTYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}

# Table 1-3: classes of arrays
_NUMERIC: Final = dict(
    enumerate(("double", "single", *(f"{sign}int{bits}" for bits in (8, 16, 32, 64) for sign in ("", "u"))), 6)
)
_OTHER = {1: "cell", 2: "struct", 3: "object", 4: "char", 5: "sparse", 16: "function"}
_OPAQUE = 17  # of MATLAB's own classes; it has a name of another kind


class _Variable(NamedTuple):
    """A variable, of which no more than the beginning has been unpacked."""

    place: int  # in the file
    element: memoryview  # its packed or plain bytes
    packed: bool
    size: int  # what they state to unpack to
    name: str
    kind: str
    shape: tuple[int, ...]
    start: int  # where its numbers begin in those


class _Mat5(Arrays):
    """MATLAB v5: its variables, and the fields of structs of one element, inner ones as ``a/b``."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        if (size := file.stat().st_size) > _MAX_BYTES:
            raise DecodeError(f"it has {size} bytes, but such a file may have {_MAX_BYTES}; save it as v7.3.")
        raw = memoryview(file.read_bytes())
        order = {b"IM": "<", b"MI": ">"}.get(bytes(raw[_HEADER_BYTES - 2 : _HEADER_BYTES]))
        if order is None:
            raise DecodeError("its header is cut or damaged: it does not end in IM or MI; use an intact copy.")
        self._order, self._size = order, len(raw)
        variables: dict[str, _Variable] = {}
        place, count = _HEADER_BYTES, 0
        while place < len(raw):
            with _intact_variable(place):
                kind, content, _ = self._part(raw, place)
                packed = kind == _COMPRESSED
                variable = self._variable(place, content if packed else raw[place : place + 8 + len(content)], packed)
            if variable.name and variable.name in variables:
                raise DecodeError(f"{variable.name} occurs twice; use an intact copy.")
            variables[variable.name] = variable
            place, count = place + 8 + len(content), count + 1
            if count > MAX_VARIABLES:
                raise DecodeError(f"it has more than {MAX_VARIABLES} variables, which no recording does.")
        self._leaves: dict[str, _Variable] = {}
        for name, variable in variables.items():
            fields = self._inside(variable)
            self._leaves |= {f"{name}/{key}": field for key, field in fields.items()} or {name: variable}
        for name, leaf in self._leaves.items():
            if leaf.kind in _NUMERIC.values():
                self.shapes[name] = leaf.shape
            else:
                self.others[name] = leaf.kind
        if PROFILE in self._leaves and self._leaves[PROFILE].kind == "char":
            with _intact_variable(self._leaves[PROFILE].place):
                kind, text, _ = self._content(self._leaves[PROFILE])
                wide = "utf-16-le" if order == "<" else "utf-16-be"
                self.profile = str(text, "utf-8" if kind in _OF_8_BITS else wide, "replace")

    def _loaded(self, names: Iterable[str]) -> dict[str, NDArray[Any]]:
        require_room(sum(self._leaves[name].size for name in names), self._size)
        return {name: self._numbers(self._leaves[name]) for name in names}

    def _inside(self, variable: _Variable, depth: int = 0) -> dict[str, _Variable]:
        """Fields of a struct of one element, none of anything else."""
        if variable.kind != "struct" or math.prod(variable.shape) != 1 or depth > _DEEPEST:
            return {}
        require_room(variable.size, self._size)
        fields: dict[str, _Variable] = {}
        with _intact_variable(variable.place):
            content, _ = _unpacked(variable.element, variable.packed, variable.size + 1)
            _, width, at = self._part(content, variable.start)
            (longest,) = struct.unpack(f"{self._order}i", width)
            _, names, at = self._part(content, at)
            if not 0 < longest <= 64 or len(names) % longest or len(names) > longest * MAX_VARIABLES:
                raise ValueError("the names of its fields are not a list of names")
            for k in range(len(names) // longest):
                name = str(names[k * longest : (k + 1) * longest], "latin-1").split("\0")[0]
                _, part, after = self._part(content, at)
                if part:
                    fields[name] = self._variable(variable.place, content[at : at + 8 + len(part)], False)
                at = after
        for name, field in [*fields.items()]:
            fields |= {f"{name}/{key}": value for key, value in self._inside(field, depth + 1).items()}
        return fields

    def _variable(self, place: int, element: memoryview, packed: bool) -> _Variable:
        """Class, shape and name of a variable, which are its first three parts."""
        begin, _ = _unpacked(element, packed, _BEGINNING_BYTES)
        if len(begin) < 8:
            raise ValueError("it ends in its first tag")
        kind, size = struct.unpack_from(f"{self._order}II", begin)
        if kind != _MATRIX:
            raise ValueError(f"it is of type {kind} instead of {_MATRIX}, an array")
        kind, flags, at = self._part(begin, 8)
        if (kind, len(flags)) != (_UINT32, 8):
            raise ValueError("its flags are not two numbers of 32 bits")
        (word,) = struct.unpack_from(f"{self._order}I", flags)
        if word & 0xFF == _OPAQUE:
            return _Variable(place, element, packed, 8 + size, "", "opaque", (), at)
        kind, dimensions, at = self._part(begin, at)
        if kind != _INT32 or len(dimensions) < 8 or len(dimensions) % 4:
            raise ValueError("its dimensions are not two or more numbers of 32 bits")
        shape = struct.unpack(f"{self._order}{len(dimensions) // 4}i", dimensions)
        kind, name, at = self._part(begin, at)
        if kind not in (_INT8, _UTF8) or min(shape) < 0:
            raise ValueError("its name is not text, or it has a negative dimension")
        class_ = (_NUMERIC | _OTHER).get(word & 0xFF, f"{word & 0xFF}, which does not exist")
        class_ = f"complex {class_}" if word & 0x800 else class_
        return _Variable(place, element, packed, 8 + size, str(name, "latin-1"), class_, shape, at)

    def _numbers(self, variable: _Variable) -> NDArray[Any]:
        """Numbers of a variable, in its shape."""
        with _intact_variable(variable.place):
            kind, numbers, values = self._content(variable)
            dtype = np.dtype(self._order + _DTYPES.get(kind, "f8"))
            if kind not in _DTYPES or len(numbers) != values * dtype.itemsize:
                raise ValueError(f"its numbers, of type {kind}, have {len(numbers)} bytes, and not those of {values}")
        table = np.frombuffer(numbers, dtype).reshape(variable.shape, order="F")
        return np.ascontiguousarray(table, dtype.newbyteorder("="))

    def _content(self, variable: _Variable) -> tuple[int, memoryview, int]:
        """Type and bytes of the values of a variable, and how many values there are."""
        values = math.prod(variable.shape)
        if variable.size > variable.start + 16 + 8 * values:  # a tag, the widest numbers, and what fills 8 bytes
            raise ValueError(f"it states {variable.size} bytes for {values} numbers")
        content, complete = _unpacked(variable.element, variable.packed, variable.size + 1)
        if len(content) != variable.size or not complete:
            raise ValueError(f"it does not unpack to the {variable.size} bytes that it states")
        return *self._part(content, variable.start)[:2], values

    def _part(self, data: memoryview, at: int) -> tuple[int, memoryview, int]:
        """Type and content of the element at a place, and where the next begins inside an array."""
        if at + 8 > len(data):
            raise ValueError(f"it ends in the tag at its byte {at}")
        kind, size = struct.unpack_from(f"{self._order}II", data, at)
        begin = at + 8
        if kind >> 16:  # a small element: size and type in one word, up to 4 bytes in the other
            kind, size, begin = kind & 0xFFFF, kind >> 16, at + 4
        if begin + size > len(data) or (begin == at + 4 and size > 4):
            raise ValueError(f"the element at its byte {at} states {size} bytes and extends beyond its end")
        after = at + 8 if begin == at + 4 else begin + size + -size % 8
        return kind, data[begin : begin + size], after


def _unpacked(element: memoryview, packed: bool, most: int) -> tuple[memoryview, bool]:
    """At most so many bytes of an element, and whether that is all of it and its checksum holds."""
    if not packed:
        return element[:most], len(element) <= most
    inflate = zlib.decompressobj()
    return memoryview(inflate.decompress(element, most)), inflate.eof


def _intact_variable(place: int) -> AbstractContextManager[None]:
    return intact(f"the variable at byte {place}", (ValueError, struct.error, zlib.error))


@contextmanager
def opened_hdf5(file: Path) -> Iterator[tuple[Any, Any]]:
    """The module h5py and an open file; everything that goes wrong inside is an error of this package."""
    h5py = needed("h5py", "HDF5 files", "plumbob[hdf5]")
    with intact(), h5py.File(file, "r") as hdf5:
        yield h5py, hdf5


def _require_whole_chunks(h5py: Any, key: str, dataset: Any, size: int) -> None:
    """Refuse chunks that unpack to more than they state: the library would follow them as far as memory goes."""
    properties = dataset.id.get_create_plist()
    filters = [properties.get_filter(i)[0] for i in range(properties.get_nfilters())]
    if not set(filters) <= {h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_FLETCHER32}:
        raise DecodeError(f"{key} is packed by a filter other than gzip; write it with gzip or unpacked.")
    if filters.count(h5py.h5z.FILTER_DEFLATE) > 1:
        raise DecodeError(f"{key} is packed twice; write it with gzip once.")
    if h5py.h5z.FILTER_DEFLATE not in filters:
        return
    most = math.prod(dataset.chunks) * dataset.dtype.itemsize + 4  # of a checksum
    for i in range(dataset.id.get_num_chunks()):
        chunk = dataset.id.get_chunk_info(i)
        if chunk.size > size:
            raise DecodeError(f"a chunk of {key} claims {chunk.size} bytes in a file of {size}, which cannot be.")
        skipped, packed = dataset.id.read_direct_chunk(chunk.chunk_offset)
        if not skipped and len(zlib.decompressobj().decompress(packed, most + 1)) > most:
            raise DecodeError(f"a chunk of {key} unpacks to more than the {most} bytes that it states.")


def _is_numeric(h5py: Any, node: Any) -> bool:
    """Whether a node of HDF5 is a data set of numbers, or of structs, whose fields may be."""
    is_set = isinstance(node, h5py.Dataset) and node.shape is not None
    return is_set and (node.dtype.kind in _NUMBERS or bool(node.dtype.names))


def _own_dataset(h5py: Any, hdf5: Any, key: str) -> Any:
    """Return a plain numeric data set stored in this very file."""
    if hdf5.id.links.get_info(key.encode()).type != h5py.h5l.TYPE_HARD:  # asked without following it
        raise DecodeError(f"{key} is a link, which may lead to another file; links are refused.")
    dataset = hdf5[key]
    if not _is_numeric(h5py, dataset):
        raise DecodeError(f"{key} is not a numeric data set.")
    if dataset.external or dataset.is_virtual:
        raise DecodeError(f"{key} is stored in another file; external and virtual data are refused.")
    if dataset.chunks and math.prod(dataset.chunks) > _CHUNK_SLACK + dataset.size:
        raise DecodeError(f"{key} claims chunks of {dataset.chunks} for {dataset.shape} values, which cannot be.")
    return dataset


class Hdf5Arrays(Arrays):
    """Arrays of HDF5, by their paths; of MATLAB v7.3 transposed."""

    def __init__(self, file: Path, *, transposed: bool) -> None:
        self._file, self._transposed = file, transposed
        super().__init__()
        attributes: dict[str, NDArray[Any]] = {}
        with opened_hdf5(file) as (h5py, hdf5):
            for name, kind, node in islice(_walk(h5py, hdf5), _MAX_ARRAYS):
                if kind:
                    self.others[name] = kind
                elif node.dtype.names:
                    self._add_fields(name, node.shape, node.dtype)
                else:
                    self.shapes[name] = tuple(node.shape)[:: -1 if transposed else 1]
                    said = next((node.attrs[key] for key in ("unit", "units") if key in node.attrs), "")
                    rates = [key for key in node.attrs if key.lower().endswith(("rate", "frequency", "fs"))]
                    attributes |= {f"{name}/{key}": np.asarray(node.attrs[key]) for key in rates}
                    self.units[name] = said.decode("utf-8", "replace") if isinstance(said, bytes) else str(said)
            self.profile = str(hdf5.attrs.get(PROFILE, ""))
            attributes |= {key: np.asarray(hdf5.attrs[key]) for key in hdf5.attrs if key not in self.shapes}
        self._single = {
            key: value for key, value in attributes.items() if value.size == 1 and value.dtype.kind in "fiu"
        }
        self.shapes.update((key, value.shape) for key, value in self._single.items())

    def _loaded(self, names: Iterable[str]) -> dict[str, NDArray[Any]]:
        size = self._file.stat().st_size
        with opened_hdf5(self._file) as (h5py, hdf5):
            sets = {}
            for path in (name for name in names if name not in self._single):
                group, _, key = path.rpartition("/")
                sets[path] = _own_dataset(h5py, hdf5[group] if group else hdf5, key)
            require_room(sum(dataset.size * dataset.dtype.itemsize for dataset in sets.values()), size)
            for path, dataset in sets.items():
                _require_whole_chunks(h5py, path, dataset, size)
            return self._single | {
                path: dataset[()].T if self._transposed else dataset[()] for path, dataset in sets.items()
            }


def _walk(h5py: Any, group: Any, prefix: str = "") -> Iterator[tuple[str, str, Any]]:
    """What lies in this very file, by name: what it is if not numbers, and the data set; links are not followed."""
    for key in islice(group, _MAX_ARRAYS):
        name = f"{prefix}{key}"
        if group.id.links.get_info(key.encode()).type != h5py.h5l.TYPE_HARD:
            yield name, "link", None
        elif isinstance(node := group[key], h5py.Group):
            if prefix.count("/") < 6:
                yield from _walk(h5py, node, f"{name}/")
        elif _is_numeric(h5py, node):
            yield name, "", node
        else:
            yield name, _NO_NUMBERS, None


class _Npz(Arrays):
    def __init__(self, file: Path) -> None:
        self._parts = Parts(file)
        super().__init__()
        for name in self._parts.names:
            key = name.removesuffix(".npy")
            shape, dtype = _npy_head(name, self._parts.start(name))
            if dtype.names:
                self._add_fields(key, shape, dtype)
            elif dtype.kind in _NUMBERS:
                self.shapes[key] = shape
            else:
                self.others[key] = "array of objects or texts"

    def _loaded(self, names: Iterable[str]) -> dict[str, NDArray[Any]]:
        arrays: dict[str, NDArray[Any]] = {}
        require_room(sum(self._parts.size(f"{name}.npy") for name in names), self._parts.path.stat().st_size)
        for name in names:
            raw = self._parts.read(f"{name}.npy")
            shape, dtype = _npy_head(name, raw)
            if int(np.prod(shape, dtype=object)) * dtype.itemsize > len(raw):
                raise DecodeError(f"{name} claims {shape} values in {len(raw)} bytes, which cannot be.")
            with intact(name, (ValueError, EOFError)):
                arrays[name] = np.lib.format.read_array(io.BytesIO(raw), allow_pickle=False)
        return arrays


def _npy_head(name: str, raw: bytes) -> tuple[tuple[int, ...], Any]:
    """Shape and type of an array of NumPy [NEP 1]."""
    stream = io.BytesIO(raw)
    try:
        version = np.lib.format.read_magic(stream)
        head = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, dtype = head(stream)
    except (ValueError, EOFError, SyntaxError, TypeError, zipfile.BadZipFile) as error:
        raise DecodeError(f"{excerpt(name)} is not a NumPy array: {str(error)[:100]}") from error
    if any(side < 0 for side in shape):
        raise DecodeError(f"{excerpt(name)} claims the shape {shape}.")
    return shape, dtype
