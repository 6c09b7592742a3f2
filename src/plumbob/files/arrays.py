"""Named arrays in containers, with every length checked before it is used: MATLAB v5 and HDF5, NetCDF-4 among it.

SciPy's reader of MATLAB v5 is not used, since damaged files can end its process [MAT-File Format, level 5]. Links and
data in other files are refused in HDF5.

A recording is written as MATLAB v5 or NetCDF-4: `time` in s, tables with a row for each sample, their units, and in
`PROFILE` the profile that reads them back. NetCDF follows the CF conventions 1.11; these know no name for what an IMU
measures, so only the time, the angles of a platform and flags have a standard_name. Discrete sampling geometries
(featureType) need a place in latitude and longitude, which a recording does not have.
"""

import io
import math
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core import flags
from plumbob.core.errors import DecodeError, PlumbobError, one_line
from plumbob.core.files import replacing, require_room
from plumbob.core.series import needed
from plumbob.core.time import to_s
from plumbob.core.units import to_deg
from plumbob.data.recording import Recording, stored_notes
from plumbob.files.columns import COLUMNS, GROUPS, TIME
from plumbob.files.text import ARRAY_NAMES, columns_of_unit, table_profile
from plumbob.rotations import Frame

PROFILE: Final = "plumbob_profile"  # where a file keeps its profile: a text in MATLAB, an attribute in NetCDF
HDF5_SIGNATURE: Final = b"\x89HDF\r\n\x1a\n"
MAT5_SIGNATURE: Final = b"MATLAB 5.0"
MAX_VARIABLES: Final = 10_000
NUMBERS: Final = "fiub"  # kinds of NumPy's types that are numbers
HEADER_BYTES: Final = 128
_CHUNK_SLACK: Final = 1_000_000  # values; a writer may choose chunks larger than a short data set
_BEGINNING_BYTES: Final = 1024  # in which class, shape and name must end; of other variables no more is unpacked
_DEEPEST: Final = 6  # structs or groups in each other


@contextmanager
def opened_hdf5(file: Path) -> Iterator[tuple[Any, Any]]:
    """The module h5py and an open file; everything that goes wrong inside is an error of this package."""
    h5py = needed("h5py", "HDF5 files", "plumbob[hdf5]")
    try:
        with h5py.File(file, "r") as hdf5:
            yield h5py, hdf5
    except PlumbobError:
        raise
    except Exception as error:  # h5py raises many types for damaged input
        raise DecodeError(f"it is cut or damaged ({one_line(error)[:160]}); use an intact copy.") from error


def require_whole_chunks(h5py: Any, key: str, dataset: Any, size: int) -> None:
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


def is_numeric(h5py: Any, node: Any) -> bool:
    """Whether a node of HDF5 is a data set of numbers, or of structs, whose fields may be."""
    is_set = isinstance(node, h5py.Dataset) and node.shape is not None
    return is_set and (node.dtype.kind in NUMBERS or bool(node.dtype.names))


def own_dataset(h5py: Any, hdf5: Any, key: str) -> Any:
    """Return a plain numeric data set stored in this very file."""
    if hdf5.id.links.get_info(key.encode()).type != h5py.h5l.TYPE_HARD:  # asked without following it
        raise DecodeError(f"{key} is a link, which may lead to another file; links are refused.")
    dataset = hdf5[key]
    if not is_numeric(h5py, dataset):
        raise DecodeError(f"{key} is not a numeric data set.")
    if dataset.external or dataset.is_virtual:
        raise DecodeError(f"{key} is stored in another file; external and virtual data are refused.")
    if dataset.chunks and math.prod(dataset.chunks) > _CHUNK_SLACK + dataset.size:
        raise DecodeError(f"{key} claims chunks of {dataset.chunks} for {dataset.shape} values, which cannot be.")
    return dataset


# Table 1-1: types of elements
_INT8, _INT32, _UINT32, _MATRIX, _COMPRESSED, _UTF8 = 1, 5, 6, 14, 15, 16
_OF_8_BITS = (_INT8, 2, _UTF8)
_DTYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}

# Table 1-3: classes of arrays
NUMERIC: Final = dict(
    enumerate(("double", "single", *(f"{sign}int{bits}" for bits in (8, 16, 32, 64) for sign in ("", "u"))), 6)
)
_OTHER = {1: "cell", 2: "struct", 3: "object", 4: "char", 5: "sparse", 16: "function"}
_OPAQUE = 17  # of MATLAB's own classes; it has a name of another kind


class Variable(NamedTuple):
    """A variable, of which no more than the beginning has been unpacked."""

    place: int  # in the file
    element: memoryview  # its packed or plain bytes
    packed: bool
    size: int  # what they state to unpack to
    name: str
    kind: str
    shape: tuple[int, ...]
    start: int  # where its numbers begin in those


def mat_variables(raw: memoryview, order: str) -> dict[str, Variable]:
    """Variables of a MATLAB v5 file by name; DecodeError if one is cut or damaged, or occurs twice."""
    variables: dict[str, Variable] = {}
    place, count = HEADER_BYTES, 0
    while place < len(raw):
        with _damage_at(place):
            kind, content, _ = _part(raw, place, order)
            packed = kind == _COMPRESSED
            element = content if packed else raw[place : place + 8 + len(content)]
            variable = _variable(place, element, packed, order)
        if variable.name and variable.name in variables:
            raise DecodeError(f"{variable.name} occurs twice; use an intact copy.")
        variables[variable.name] = variable
        place, count = place + 8 + len(content), count + 1
        if count > MAX_VARIABLES:
            raise DecodeError(f"it has more than {MAX_VARIABLES} variables, which no recording does.")
    return variables


def mat_order(raw: memoryview) -> str:
    """Byte order of a MATLAB v5 file, as `struct` writes it; DecodeError if its header does not say it."""
    order = {b"IM": "<", b"MI": ">"}.get(bytes(raw[HEADER_BYTES - 2 : HEADER_BYTES]))
    if order is None:
        raise DecodeError("its header is cut or damaged: it does not end in IM or MI; use an intact copy.")
    return order


def mat_fields(variable: Variable, order: str, room: int, depth: int = 0) -> dict[str, Variable]:
    """Fields of a struct of one element, inner ones as ``a/b``, none of anything else; the file has `room` bytes."""
    if variable.kind != "struct" or math.prod(variable.shape) != 1 or depth > _DEEPEST:
        return {}
    require_room(variable.size, room)
    fields: dict[str, Variable] = {}
    with _damage_at(variable.place):
        content, _ = _unpacked(variable.element, variable.packed, variable.size + 1)
        _, width, at = _part(content, variable.start, order)
        (longest,) = struct.unpack(f"{order}i", width)
        _, names, at = _part(content, at, order)
        if not 0 < longest <= 64 or len(names) % longest or len(names) > longest * MAX_VARIABLES:
            raise ValueError("the names of its fields are not a list of names")
        for k in range(len(names) // longest):
            name = str(names[k * longest : (k + 1) * longest], "latin-1").split("\0")[0]
            _, part, after = _part(content, at, order)
            if part:
                fields[name] = _variable(variable.place, content[at : at + 8 + len(part)], False, order)
            at = after
    for name, field in [*fields.items()]:
        inner = mat_fields(field, order, room, depth + 1)
        fields |= {f"{name}/{key}": value for key, value in inner.items()}
    return fields


def _variable(place: int, element: memoryview, packed: bool, order: str) -> Variable:
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
        return Variable(place, element, packed, 8 + size, "", "opaque", (), at)
    kind, dimensions, at = _part(begin, at, order)
    if kind != _INT32 or len(dimensions) < 8 or len(dimensions) % 4:
        raise ValueError("its dimensions are not two or more numbers of 32 bits")
    shape = struct.unpack(f"{order}{len(dimensions) // 4}i", dimensions)
    kind, name, at = _part(begin, at, order)
    if kind not in (_INT8, _UTF8) or min(shape) < 0:
        raise ValueError("its name is not text, or it has a negative dimension")
    class_ = (NUMERIC | _OTHER).get(word & 0xFF, f"{word & 0xFF}, which does not exist")
    class_ = f"complex {class_}" if word & 0x800 else class_
    return Variable(place, element, packed, 8 + size, str(name, "latin-1"), class_, shape, at)


def mat_array(variable: Variable, order: str) -> NDArray[Any]:
    """Numbers of a variable, in its shape; DecodeError if it is damaged, or does not unpack to what it states."""
    with _damage_at(variable.place):
        kind, numbers, values = _content(variable, order)
        dtype = np.dtype(order + _DTYPES.get(kind, "f8"))
        if kind not in _DTYPES or len(numbers) != values * dtype.itemsize:
            raise ValueError(f"its numbers, of type {kind}, have {len(numbers)} bytes, and not those of {values}")
    table = np.frombuffer(numbers, dtype).reshape(variable.shape, order="F")
    return np.ascontiguousarray(table, dtype.newbyteorder("="))


def mat_text(variable: Variable, order: str) -> str:
    """Text of a row of characters; errors as of `mat_array`."""
    with _damage_at(variable.place):
        kind, text, _ = _content(variable, order)
        return str(text, "utf-8" if kind in _OF_8_BITS else "utf-16-le" if order == "<" else "utf-16-be", "replace")


def _content(variable: Variable, order: str) -> tuple[int, memoryview, int]:
    """Type and bytes of the values of a variable, and how many values there are."""
    values = math.prod(variable.shape)
    if variable.size > variable.start + 16 + 8 * values:  # a tag, the widest numbers, and what fills 8 bytes
        raise ValueError(f"it states {variable.size} bytes for {values} numbers")
    content, complete = _unpacked(variable.element, variable.packed, variable.size + 1)
    if len(content) != variable.size or not complete:
        raise ValueError(f"it does not unpack to the {variable.size} bytes that it states")
    return *_part(content, variable.start, order)[:2], values


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
        raise ValueError(f"the element at its byte {at} states {size} bytes and extends beyond its end")
    after = at + 8 if begin == at + 4 else begin + size + -size % 8
    return kind, data[begin : begin + size], after


@contextmanager
def _damage_at(place: int) -> Iterator[None]:
    try:
        yield
    except (ValueError, struct.error, zlib.error) as error:
        raise DecodeError(f"the variable at byte {place} is cut or damaged: {error}. Use an intact copy.") from error


def _tables(path: Path, recording: Recording) -> tuple[dict[str, tuple[NDArray[Any], str]], str]:
    """Arrays of a recording with units, (N,) or (N, …) of a group of columns; and the profile that reads them."""
    columns = columns_of_unit(path, recording)
    tables = {"time": (to_s(columns[TIME]), "s")}
    single = dict.fromkeys(name for name in columns if name != TIME)
    for group, names in GROUPS.items():
        if names[0] in columns:
            table = np.stack([columns[name] for name in names], axis=1)
            tables[ARRAY_NAMES.get(group, group)] = table, COLUMNS[names[0]].unit
            single = {name: None for name in single if name not in names}
    tables |= {name: (columns[name], COLUMNS[name].unit) for name in single}
    tables = {name: (v.astype(np.uint8) if v.dtype == bool else v, unit) for name, (v, unit) in tables.items()}
    return tables, table_profile(recording, columns, arrays=True)


def write_mat(path: Path, recording: Recording, overwrite: bool = False) -> None:
    """Write named arrays as MATLAB v5: `time` (s), `gyr`, `acc`, `q_nb` and so on, and the struct `units`."""
    from scipy.io import savemat

    tables, profile = _tables(path, recording)
    content: dict[str, Any] = {name: table for name, (table, _) in tables.items()}
    content |= {"units": {name: unit for name, (_, unit) in tables.items()}, PROFILE: profile}
    stream: Any = io.BytesIO()
    savemat(stream, content, do_compression=True, oned_as="column")
    with replacing(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(stream.getvalue())


_LABELS: Final = {3: ("axis", "xyz"), 4: ("component", "wxyz"), 9: ("pair", [a + b for a in "xyz" for b in "xyz"])}
_LONG_NAMES: Final = {
    "time": "time on the clock of the recording",
    "gyr": "angular rate of the body in its axes",
    "acc": "specific force in body axes",
    "mag": "magnetic flux density in body axes",
    "temp_c": "temperature of the sensor",
    "bias_b": "bias of the gyroscope in body axes",
    "cov_b": "covariance of the attitude error as a rotation vector in body axes",
    "score": "whether a sample counts in an evaluation",
    "mag_weight": "how far the magnetic field was believed",
}


def write_netcdf(path: Path, recording: Recording, overwrite: bool = False) -> None:
    """Write named arrays as NetCDF-4 by the CF conventions 1.11; MissingExtraError without h5netcdf."""
    h5netcdf, h5py = (needed(name, "NetCDF files", "plumbob[netcdf]") for name in ("h5netcdf", "h5py"))
    tables, profile = _tables(path, recording)
    imu, track, stream = recording.imu, recording.track, io.BytesIO()
    t0_ns = 0 if imu is None else imu.meta.t0_ns
    since = f"seconds since {str(np.datetime64(t0_ns, 'ns')).replace('T', ' ')}"
    utc = {"units": since, "standard_name": "time", "axis": "T", "calendar": "standard"}
    utc["units_metadata"] = "leap_seconds: none"
    about: dict[str, dict[str, Any]] = {name: {"long_name": words} for name, words in _LONG_NAMES.items()}
    about |= {"time": utc} if t0_ns else {}
    for name in {"flags", "track_flags"} & tables.keys():
        masks, meanings = np.array([*flags.MEANING], np.uint32), " ".join(name for name, _ in flags.MEANING.values())
        about[name] = {"standard_name": "quality_flag", "flag_masks": masks, "flag_meanings": meanings}
    if track is not None:
        about["q_nb"] = {"long_name": f"rotation from body axes to {track.frame}, heading from {track.north} north"}
        senses = {"yaw": "starboard", "pitch": "up"} if track.frame is Frame.NED else {"yaw": "port", "pitch": "down"}
        for name, angle in zip(("yaw", "pitch", "roll"), to_deg(track.euler_zyx).T, strict=True):
            tables[name] = angle, "degree"
            sense = f"fore_{senses[name]}" if name in senses else "starboard_down"  # that of its frame's axes
            about[name] = {"standard_name": f"platform_{name}_{sense}"}
    with h5netcdf.File(stream, "w") as file:
        file.dimensions = {"time": len(tables["time"][0])} | {name: len(labels) for name, labels in _LABELS.values()}
        for name, labels in _LABELS.values():
            file.create_variable(name, (name,), h5py.string_dtype(), data=np.array([*labels], object))
        for name, (table, unit) in tables.items():
            fill = math.nan if table.dtype == np.float64 and name != "time" else None
            dimensions = ("time", *(_LABELS[width][0] for width in table.shape[1:]))
            variable = file.create_variable(name, dimensions, data=table, fillvalue=fill, compression="gzip")
            variable.attrs.update({"units": unit} | about.get(name, {}))
        made = {"device": imu.meta.device} if imu is not None else {}
        made |= {"source": track.source} if track is not None else {}
        made |= {"history": notes} if (notes := "\n".join(map(str, stored_notes(recording)))) else {}
        said = {"Conventions": "CF-1.11", "title": recording.name or path.stem, PROFILE: profile}
        file.attrs.update(said | made)
    with replacing(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(stream.getvalue())
