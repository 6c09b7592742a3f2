"""Named arrays of MATLAB (v5 and v7.3), HDF5, NetCDF-4 and NumPy (.npz, .npy), described by a profile in TOML.

The container says names, shapes and types, and nothing of units, frames or clocks; the profile says these. An array is
named by its path: ``imu/gyr`` is the data set of a group in HDF5, and the field of a struct in MATLAB, HDF5 or NumPy.
MATLAB v7.3 keeps its tables transposed in HDF5, which is undone here [MathWorks, MAT-File Versions]. In a table of
several columns, its longer side is that of time.
"""

import io
import math
import re
import zipfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from itertools import islice
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.errors import DecodeError, UnknownFormatError, excerpt
from plumbob.core.files import existing_file, reading, require_room
from plumbob.core.resources import guide
from plumbob.core.text import counted, first_words
from plumbob.data.recording import Recording
from plumbob.files.arrays import (
    HDF5_SIGNATURE,
    MAT5_SIGNATURE,
    NUMBERS,
    NUMERIC,
    PROFILE,
    Variable,
    is_numeric,
    mat_array,
    mat_fields,
    mat_order,
    mat_text,
    mat_variables,
    opened_hdf5,
    own_dataset,
    require_whole_chunks,
)
from plumbob.files.foreign.parts import Parts
from plumbob.files.known_logs import KNOWN_ARRAYS
from plumbob.files.profile import ColumnRef, Profile, TextLayout, parse_profile, profiles_beside
from plumbob.files.sniff import FEWEST, ROWS, Sample
from plumbob.files.text import table_recording, text_profile
from plumbob.files.text_table import TextTable

MAX_BYTES: Final = 256 << 20  # bytes of a MATLAB v5 file, which is read as a whole
MAX_ARRAYS: Final = 1000
_MAT73: Final = b"MATLAB 7.3"
_COLUMN: Final = re.compile(r"(?P<name>.+?)\[(?P<number>[1-9]\d{0,3})(?: of (?P<count>\d+))?\]")
_NO_NUMBERS: Final = "data set that is not of numbers"
_INSIDE: Final = "in the file itself"  # origin of a profile that a file of Plumbob holds


@dataclass(frozen=True, slots=True)
class _Listed:
    """Arrays of a container: shapes of those of numbers, what the others are, and units that attributes say."""

    shapes: dict[str, tuple[int, ...]] = field(default_factory=dict)
    others: dict[str, str] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)

    def add_fields(self, name: str, shape: Sequence[int], dtype: np.dtype[Any]) -> dict[str, tuple[str, str]]:
        """Add the fields of a structured array as ``name/field``; where each lies."""
        for field_ in dtype.names or ():
            if dtype[field_].base.kind in NUMBERS:
                self.shapes[f"{name}/{field_}"] = (*shape, *dtype[field_].shape)
            else:
                self.others[f"{name}/{field_}"] = _NO_NUMBERS
        return {f"{name}/{field_}": (name, field_) for field_ in dtype.names or ()}

    def summary(self) -> str:
        """Names and shapes for a message."""
        entries = [f"{name} {'×'.join(map(str, shape)) or '1'}" for name, shape in self.shapes.items()]
        entries += [f"{name} ({kind})" for name, kind in self.others.items()]
        return first_words(entries, 20) or "nothing"


def read(path: Path, profile: Profile | str | Path | None = None) -> Recording:
    """Read named arrays as their profile, or that of arrays known by their names, describes them."""
    file = existing_file(path)
    with reading(file):
        container = _container(file)
        if profile is None and (container.profile or not profiles_beside(file)):
            profile = _profile_by_names(container)
    declared, note = text_profile(file, profile)
    with reading(file):
        if not declared.arrays:
            raise DecodeError(f"{declared.origin} describes a text file; for arrays, write arrays = true instead.")
        if declared.texts:
            raise DecodeError(f"{declared.origin} names columns of text, but arrays hold numbers; use time.unit.")
        return table_recording(declared, _table(declared, container), file.stem, note)


def _profile_by_names(container: "_Container") -> Profile:
    """Profile that the file holds, or that of a data set whose arrays are known by their names; refused without one."""
    if container.profile:
        return parse_profile(container.profile, origin=_INSIDE)
    for origin, data_set in KNOWN_ARRAYS.items():
        if not {*data_set["names"]} <= container.listed.shapes.keys():
            continue
        text = data_set["profile"]
        for key in re.findall(r"\{(\w+)\}", text):
            single = math.prod(container.listed.shapes.get(key, (0,))) == 1
            number = float(container.load([key])[key].ravel()[0]) if single else math.nan
            if not 0.0 < number < math.inf:
                raise DecodeError(f"{key} must be one number above 0; the file holds {container.listed.summary()}.")
            text = text.replace(f"{{{key}}}", repr(number))
        return parse_profile(text, origin=origin)
    raise UnknownFormatError(
        f"arrays do not say their units, so they need --profile FILE.toml with arrays = true; "
        f"{guide('vendor-files.md')} shows one. The file holds {container.listed.summary()}. Plain numbers of a unit "
        "at rest are for 'plumbob allan', with --rate and --scale."
    )


def array_sample(path: Path) -> Sample:
    """First rows of a file's arrays of one time line, by columns such as ``gyr[1]``, and what single numbers it has."""
    container = _container(path)
    shapes = container.listed.shapes
    sizes = Counter(max(shape) for shape in shapes.values() if shape and max(shape) >= FEWEST)
    if not sizes:
        raise DecodeError(f"it holds no array of samples; it holds {container.listed.summary()}.")
    rows = sizes.most_common(1)[0][0]
    chosen = sorted(name for name, shape in shapes.items() if len(shape) <= 2 and max(shape, default=0) == rows)
    single = sorted(name for name, shape in shapes.items() if np.prod(shape, dtype=np.int64) == 1)
    single = [name for name in single if (of := name.rpartition("/")[0]) in chosen or of not in shapes]
    content = container.load([*chosen, *single])
    columns: dict[str, list[str]] = {}
    for name in chosen:
        table = _upright(name, content[name])[0][:ROWS]
        for k in range(table.shape[1]):
            columns[name if table.shape[1] == 1 else f"{name}[{k + 1}]"] = [repr(float(v)) for v in table[:, k]]
    facts = {name.rpartition("/")[2].lower(): repr(float(content[name].ravel()[0])) for name in single}
    lines = [list(row) for row in zip(*columns.values(), strict=True)]
    units = [container.listed.units.get(re.sub(r"\[\d+\]$", "", name), "") for name in columns]
    return Sample(TextLayout(separator=""), tuple(columns), tuple(units), True, lines, facts)


def _table(profile: Profile, container: "_Container") -> TextTable:
    upright = profile.origin == _INSIDE
    places = {ref: _place(ref, container.listed, upright=upright) for ref in profile.used}
    content = container.load(sorted({name for name, _ in places.values()}))
    tables = {name: _upright(name, array, upright=upright) for name, array in content.items()}
    rows = {name: len(table) for name, (table, _) in tables.items()}
    if len(set(rows.values())) > 1:
        sizes = ", ".join(f"{name} {count}" for name, count in rows.items())
        raise DecodeError(f"its arrays have different lengths: {sizes}; a profile describes arrays of one time line.")
    columns: dict[ColumnRef, Any] = {}
    zero = Decimal(0)
    for ref, (name, number) in places.items():
        column = tables[name][0][:, number - 1]
        if ref == profile.time.exact and column.size:
            zero = Decimal(column[0].item())
            column = column - column[0]
        columns[ref] = np.asarray(column, dtype=np.float64)
    turned = tuple(f"{name} has its samples side by side, and was turned" for name, (_, was) in tables.items() if was)
    return TextTable(columns, zero, next(iter(rows.values()), 0), turned, {}, lambda row: row + 1)


def _place(ref: ColumnRef, listed: _Listed, *, upright: bool) -> tuple[str, int]:
    """Array and number of its column, from 1; a name alone has one column, ``[1 of 3]`` is of just three."""
    if not isinstance(ref, str):
        raise DecodeError(f"{ref} is the number of a column; an array has a name, as in 'gyr[{ref}]'.")
    match = _COLUMN.fullmatch(ref) if ref not in listed.shapes else None
    name, number, stated = (match["name"], int(match["number"]), match["count"]) if match else (ref, 1, "1")
    if name not in listed.shapes:
        kind = listed.others.get(name)
        why = f"is not an array of numbers but a {kind}" if kind else "is not in the file"
        raise DecodeError(f"{excerpt(name)} {why}; the file holds {listed.summary()}.")
    shape = listed.shapes[name]
    count = (shape[1] if upright else min(shape)) if len(shape) == 2 else 1
    if number > count or stated not in (None, str(count)):
        raise DecodeError(
            f"{name} has {counted(count, 'column')}, but needs {stated or number}; say which are meant, as in "
            f'columns = ["{name}[1]", ...].'
        )
    return name, number


def _upright(name: str, array: NDArray[Any], *, upright: bool = False) -> tuple[NDArray[Any], bool]:
    """Table of a row for each sample, and whether it lay on its side."""
    if array.ndim > 2 or array.ndim == 0 or array.size == 0:
        raise DecodeError(f"{name} has shape {array.shape}, but it must be samples, or samples and columns.")
    if array.ndim == 1:
        return array[:, np.newaxis], False
    aside = array.shape[0] < array.shape[1] and not upright
    return (array.T if aside else array), aside and array.shape[0] > 1


class _Container:
    """Arrays of one file; subclasses list them without loading, and load some."""

    listed: _Listed
    profile = ""
    """Profile that the file holds itself; its tables then have a row for each sample, however few there are."""

    def load(self, names: list[str]) -> dict[str, NDArray[Any]]:
        raise NotImplementedError


def _container(file: Path) -> _Container:
    with file.open("rb") as stream:
        start = stream.read(520)
    if start.startswith(MAT5_SIGNATURE):
        return _Mat5(file)
    if start.startswith(HDF5_SIGNATURE) or start[512:] == HDF5_SIGNATURE:
        return Hdf5Arrays(file, transposed=start.startswith(_MAT73))
    if start.startswith((b"PK", b"\x93NUMPY")):
        return _Npz(file)
    raise DecodeError("it is neither MATLAB v5 or v7.3, nor HDF5, nor NumPy's .npy or .npz; save it as one of these.")


class _Mat5(_Container):
    def __init__(self, file: Path) -> None:
        if (size := file.stat().st_size) > MAX_BYTES:
            raise DecodeError(f"it has {size} bytes, but such a file may have {MAX_BYTES}; save it as v7.3.")
        raw = memoryview(file.read_bytes())
        self._size, self._order = len(raw), mat_order(raw)
        leaves: dict[str, Variable] = {}
        for name, variable in mat_variables(raw, self._order).items():
            fields = mat_fields(variable, self._order, len(raw))
            leaves |= {f"{name}/{key}": field for key, field in fields.items()} or {name: variable}
        if PROFILE in leaves and leaves[PROFILE].kind == "char":
            self.profile = mat_text(leaves[PROFILE], self._order)
        self._found = {name: leaf for name, leaf in leaves.items() if leaf.kind in NUMERIC.values()}
        others = {name: leaf.kind for name, leaf in leaves.items() if name not in self._found}
        self.listed = _Listed({name: leaf.shape for name, leaf in self._found.items()}, others)

    def load(self, names: list[str]) -> dict[str, NDArray[Any]]:
        require_room(sum(self._found[name].size for name in names), self._size)
        return {name: mat_array(self._found[name], self._order) for name in names}


class Hdf5Arrays(_Container):
    """Arrays of HDF5, by their paths; of MATLAB v7.3 transposed."""

    def __init__(self, file: Path, *, transposed: bool) -> None:
        self._file, self._transposed = file, transposed
        self.listed, self._fields, attributes = _Listed(), dict[str, tuple[str, str]](), dict[str, NDArray[Any]]()
        with opened_hdf5(file) as (h5py, hdf5):
            for name, kind, node in islice(_walk(h5py, hdf5), MAX_ARRAYS):
                if kind:
                    self.listed.others[name] = kind
                elif node.dtype.names:
                    self._fields |= self.listed.add_fields(name, node.shape, node.dtype)
                else:
                    self.listed.shapes[name] = tuple(node.shape)[:: -1 if transposed else 1]
                    said = next((node.attrs[key] for key in ("unit", "units") if key in node.attrs), "")
                    rates = [key for key in node.attrs if key.lower().endswith(("rate", "frequency", "fs"))]
                    attributes |= {f"{name}/{key}": np.asarray(node.attrs[key]) for key in rates}
                    self.listed.units[name] = said.decode("utf-8", "replace") if isinstance(said, bytes) else str(said)
            self.profile = str(hdf5.attrs.get(PROFILE, ""))
            attributes |= {key: np.asarray(hdf5.attrs[key]) for key in hdf5.attrs if key not in self.listed.shapes}
        self._single = {
            key: value for key, value in attributes.items() if value.size == 1 and value.dtype.kind in "fiu"
        }
        self.listed.shapes.update((key, value.shape) for key, value in self._single.items())

    def load(self, names: list[str]) -> dict[str, NDArray[Any]]:
        """Load arrays, each in its own type."""
        size = self._file.stat().st_size
        with opened_hdf5(self._file) as (h5py, hdf5):
            places = {name: self._fields.get(name, (name, ())) for name in names if name not in self._single}
            sets = {}
            for path, _ in places.values():
                group, _, key = path.rpartition("/")
                sets[path] = own_dataset(h5py, hdf5[group] if group else hdf5, key)
            require_room(sum(dataset.size * dataset.dtype.itemsize for dataset in sets.values()), size)
            for path, dataset in sets.items():
                require_whole_chunks(h5py, path, dataset, size)
            arrays = {name: sets[path][part] for name, (path, part) in places.items()}
            arrays = {name: array.T if self._transposed else array for name, array in arrays.items()}
            return arrays | {name: self._single[name] for name in names if name in self._single}


def _walk(h5py: Any, group: Any, prefix: str = "") -> Iterator[tuple[str, str, Any]]:
    """What lies in this very file, by name: what it is if not numbers, and the data set; links are not followed."""
    for key in islice(group, MAX_ARRAYS):
        name = f"{prefix}{key}"
        if group.id.links.get_info(key.encode()).type != h5py.h5l.TYPE_HARD:
            yield name, "link", None
        elif isinstance(node := group[key], h5py.Group):
            if prefix.count("/") < 6:
                yield from _walk(h5py, node, f"{name}/")
        elif is_numeric(h5py, node):
            yield name, "", node
        else:
            yield name, _NO_NUMBERS, None


class _Npz(_Container):
    def __init__(self, file: Path) -> None:
        self._parts = Parts(file)
        self.listed, self._fields = _Listed(), dict[str, tuple[str, str]]()
        for name in self._parts.names:
            key = name.removesuffix(".npy")
            shape, dtype = _npy_head(name, self._parts.start(name))
            if dtype.names:
                self._fields |= self.listed.add_fields(key, shape, dtype)
            elif dtype.kind in NUMBERS:
                self.listed.shapes[key] = shape
            else:
                self.listed.others[key] = "array of objects or texts"

    def load(self, names: list[str]) -> dict[str, NDArray[Any]]:
        places = {name: self._fields.get(name, (name, ())) for name in names}
        arrays: dict[str, NDArray[Any]] = {}
        of_files = dict.fromkeys(path for path, _ in places.values())
        require_room(sum(self._parts.size(f"{name}.npy") for name in of_files), self._parts.path.stat().st_size)
        for name in of_files:
            raw = self._parts.read(f"{name}.npy")
            shape, dtype = _npy_head(name, raw)
            if int(np.prod(shape, dtype=object)) * dtype.itemsize > len(raw):
                raise DecodeError(f"{name} claims {shape} values in {len(raw)} bytes, which cannot be.")
            try:
                arrays[name] = np.lib.format.read_array(io.BytesIO(raw), allow_pickle=False)
            except (ValueError, EOFError) as error:
                raise DecodeError(f"{name} is cut or damaged: {error}") from error
        return {name: arrays[path][part] for name, (path, part) in places.items()}


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
