"""Trials of BROAD, the Berlin robust orientation estimation data set [Laidig2021], CC BY 4.0.

A trial is recognised by its content, not by its name. It holds a 9-axis unit and an optical reference on one time
line; the same content comes as HDF5 and as MATLAB v5.

Arrays of a BROAD trial in MATLAB v5, with every length checked before it is used.

SciPy's reader of such files is not used, since damaged ones can end its process [MAT-File Format, level 5].
"""

import math
import mmap
import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, MissingExtraError, PlumbobError, one_line
from plumbob.core.files import existing_file, reading, require_room
from plumbob.data import AttitudeTrack, ImuData, ImuMeta
from plumbob.files.notes import Recording
from plumbob.rotations import Frame, North

SHAPES: Final[dict[str, tuple[int, ...]]] = {
    "imu_gyr": (3,),
    "imu_acc": (3,),
    "imu_mag": (3,),
    "opt_quat": (4,),
    "movement": (),
}
"""Shape of one row of each array; `sampling_rate` is a single number besides."""

RATE: Final = "sampling_rate"
MAX_ROWS: Final = 1_000_000
"""Rows beyond which a file is refused: the longest trial has 60 000, and a container can claim any number."""


def require_keys(found: Iterable[str]) -> None:
    """Refuse a container without the keys of a trial."""
    missing = [key for key in (*SHAPES, RATE) if key not in set(found)]
    if missing:
        raise DecodeError(
            f"it is not a BROAD trial: {', '.join(missing)} missing; export other data as CSV and describe that with a "
            "profile."
        )


def require_shapes(shapes: dict[str, tuple[int, ...]]) -> None:
    """Refuse arrays that do not belong together, or claim too many rows."""
    rows = max(shapes["imu_gyr"][:1], default=0)
    if not 1 <= rows <= MAX_ROWS:
        raise DecodeError(f"imu_gyr claims {rows} rows, but a trial has 1 to {MAX_ROWS}.")
    for key, row in SHAPES.items():
        if shapes[key] != (rows, *row):
            raise DecodeError(f"{key} must have shape {(rows, *row)}, but it has {shapes[key]}.")


_CHUNK_SLACK = 1_000_000  # values; a writer may choose chunks larger than a short data set


def load_hdf5(file: Path) -> dict[str, NDArray[Any]]:
    """Arrays of a trial.

    Raises
    ------
    MissingExtraError
        If h5py is not installed.
    DecodeError
        If keys are missing, data lie outside the file, or it is damaged.
    """
    try:
        import h5py
    except ImportError as error:
        raise MissingExtraError('HDF5 files need h5py; install it with: pip install "plumbob[hdf5]".') from error
    try:
        with h5py.File(file, "r") as hdf5:
            return _arrays(h5py, hdf5, file.stat().st_size)
    except PlumbobError:
        raise
    except Exception as error:  # h5py raises many types for damaged input
        raise DecodeError(f"it is cut or damaged ({one_line(error)[:160]}); take a copy that is whole.") from error


def _arrays(h5py: Any, hdf5: Any, size: int) -> dict[str, NDArray[Any]]:
    require_keys([*hdf5.keys(), *(key for key in hdf5.attrs if key == RATE)])
    sets = {key: _own_dataset(h5py, hdf5, key) for key in SHAPES}
    require_shapes({key: tuple(dataset.shape) for key, dataset in sets.items()})
    if RATE not in hdf5.attrs:
        sets[RATE] = _own_dataset(h5py, hdf5, RATE)
    require_room(sum(dataset.size * dataset.dtype.itemsize for dataset in sets.values()), size)
    for key, dataset in sets.items():
        _require_whole_chunks(h5py, key, dataset, size)
    content = {key: dataset[()] for key, dataset in sets.items()}
    rate = np.asarray(content[RATE] if RATE in content else hdf5.attrs[RATE])
    if rate.dtype.kind not in "fiu":
        raise DecodeError(f"{RATE} must be a number, but its type is {rate.dtype}.")
    return content | {RATE: rate}


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


def _own_dataset(h5py: Any, hdf5: Any, key: str) -> Any:
    """Return a plain numeric data set stored in this very file."""
    if hdf5.id.links.get_info(key.encode()).type != h5py.h5l.TYPE_HARD:  # asked without following it
        raise DecodeError(f"{key} is a link, which may lead to another file; links are refused.")
    dataset = hdf5[key]
    if not isinstance(dataset, h5py.Dataset) or dataset.shape is None or dataset.dtype.kind not in "fiub":
        raise DecodeError(f"{key} is not a numeric data set.")
    if dataset.external or dataset.is_virtual:
        raise DecodeError(f"{key} is stored in another file; external and virtual data are refused.")
    if dataset.chunks and math.prod(dataset.chunks) > _CHUNK_SLACK + dataset.size:
        raise DecodeError(f"{key} claims chunks of {dataset.chunks} for {dataset.shape} values, which cannot be.")
    return dataset


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


DEVICE: Final = "Myon aktos-t"
SOURCE: Final = "BROAD optical reference (OptiTrack)"
_PROVENANCE: Final = "from the BROAD data set, doi:10.3390/data6070072, CC BY 4.0"
_HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_MAT5_SIGNATURE = b"MATLAB 5.0"
_LOADERS = {_HDF5_SIGNATURE: load_hdf5, _MAT5_SIGNATURE: load_mat}


def read_broad(path: str | Path) -> Recording:
    """Read a trial: samples, and the reference in ENU with magnetic north.

    The reference's `score` marks the samples of the movement phase in which the reference is known.

    Raises
    ------
    DecodeError
        If the file is neither HDF5 nor MATLAB v5, is not a BROAD trial, is damaged, or refers to other files.
    MissingExtraError
        If it is HDF5 and h5py is not installed.
    """
    file = existing_file(path)
    with reading(file):
        content = _loader(file)(file)
        rate = _rate(content["sampling_rate"])
        t = np.arange(content["imu_gyr"].shape[0]) / rate
        return Recording(
            imu=_imu(content, t, rate), track=_track(content, t), name=file.stem, notes=(_PROVENANCE, _lost(content))
        )


def accepts(file: Path) -> bool:
    """Whether a file names an array of a trial; MATLAB v5 packs the names, so that any such file may be one."""
    with file.open("rb") as stream:
        start = stream.read(16)
        if not start.startswith(_HDF5_SIGNATURE):
            return start.startswith(_MAT5_SIGNATURE)
        with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as content:
            return any(content.find(key.encode()) >= 0 for key in SHAPES)


def _loader(file: Path) -> Any:
    with file.open("rb") as stream:
        start = stream.read(16)
    for signature, load in _LOADERS.items():
        if start.startswith(signature):
            return load
    raise DecodeError("it is neither HDF5 nor MATLAB v5; BROAD trials are one of these.")


def _rate(value: NDArray[Any]) -> float:
    rate = float(value.ravel()[0]) if value.size == 1 else float("nan")
    if not 0.0 < rate < 1e6:
        raise DecodeError(f"sampling_rate must be one number in Hz, but it is {rate:g} ({value.size} values).")
    return rate


def _imu(content: dict[str, NDArray[Any]], t: Floats, rate: float) -> ImuData:
    return ImuData(
        t=t,
        gyr=content["imu_gyr"],
        acc=content["imu_acc"],
        mag=content["imu_mag"],
        meta=ImuMeta(device=DEVICE, rate_nominal=rate, frame=Frame.ENU, north=North.MAGNETIC),
    )


def _track(content: dict[str, NDArray[Any]], t: Floats) -> AttitudeTrack:
    q_nb = content["opt_quat"]
    known = np.isfinite(q_nb).all(axis=1)
    return AttitudeTrack(
        t=t,
        q_nb=q_nb,
        frame=Frame.ENU,
        north=North.MAGNETIC,
        score=(content["movement"] != 0) & known,
        source=SOURCE,
    )


def _lost(content: dict[str, NDArray[Any]]) -> str:
    lost = int(np.count_nonzero(~np.isfinite(content["opt_quat"]).all(axis=1)))
    scored = int(np.count_nonzero(content["movement"]))
    rows = content["opt_quat"].shape[0]
    return f"reference lost in {lost} of {rows} samples; {scored} belong to the movement phase"
