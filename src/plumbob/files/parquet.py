"""The native recording: one Parquet file with units, a header and a checksum over everything it holds.

Parquet keeps every bit of a float, and any data-frame tool opens the file. What the format does not promise is added
here: the reader recomputes a CRC-32 over the header and all columns, so a flipped bit is refused, not used.
"""

import math
import zlib
from base64 import b64encode
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from copy import copy
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from plumbob.core import check, flags
from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError
from plumbob.core.files import existing_file, read_in_parts, reading, replacing, require_room
from plumbob.core.findings import lasting
from plumbob.core.time import is_gap, to_ns, to_s
from plumbob.data import TRIADS, ImuData, ImuMeta
from plumbob.data.array import ImuArray
from plumbob.data.recording import Recording
from plumbob.files import columns as layout
from plumbob.files import header
from plumbob.files.arrow import arrow_column, column_numbers, intact, unpacked_bytes
from plumbob.files.columns import GROUPS, TIME, Columns
from plumbob.files.decoded import KEY as PROFILE
from plumbob.files.decoded import read_described

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq

KEY: Final = b"plumbob"
_UNIT: Final = b"unit"
_CRC: Final = "crc32"
_PAGE_BYTES: Final = 64 * 1024
# A table of contents lists 15 columns for each million rows in less than 3 kB; Arrow takes a hundred times its size.
_CONTENTS_BYTES: Final = 1024 * 1024
_THRIFT_ITEMS: Final = 10_000
_BATCH: Final = 1 << 16  # rows that are read at a time
GROUP: Final = 1 << 15  # rows of the first row groups that are written: a writer holds one
ALIKE: Final = 300  # groups of a size; then they are four times as large, as the table of contents lists them all
LARGEST: Final = 1 << 20  # rows of a group at most
_ZEROS: Final = bytes(1 << 16)


def write_parquet(path: Path, parts: Recording | Iterable[Recording], overwrite: bool = False) -> None:
    """Write a native recording, or parts of it, none of which is kept; the last part's header is that of all."""
    with replacing(path, overwrite=overwrite, seeks=True) as temporary, closing(_RowGroupWriter(temporary)) as writer:
        for recording in (parts,) if isinstance(parts, Recording) else parts:
            columns = layout.to_columns(recording)
            said = header.file_header(recording, list(columns))
            writer.add(columns)
            del recording, columns  # the next one may need their room
        writer.end(said)


class _RowGroupWriter:
    """Columns that come in parts as row groups of a file whose sizes do not depend on the parts."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._room: Columns = {}
        self._count = 0
        self._sums: dict[str, tuple[int, int]] = {}
        self._groups = 0
        self._parquet: pq.ParquetWriter | None = None

    def add(self, columns: Columns) -> None:
        """Write the row groups that these rows complete."""
        done = 0
        while done < columns[TIME].size:
            rows = min(GROUP << 2 * (self._groups // ALIKE), LARGEST)
            if not self._count:
                self._room = {name: np.empty(rows, dtype=values.dtype) for name, values in columns.items()}
            count = min(rows - self._count, columns[TIME].size - done)
            for name, values in columns.items():
                self._room[name][self._count : self._count + count] = values[done : done + count]
            done, self._count = done + count, self._count + count
            if self._count == rows:
                self._write()

    def end(self, content: dict[str, Any]) -> None:
        """Write the rest, and the header of all."""
        if self._count:
            self._write()
        crc = zlib.crc32(header.dump(content))
        for name in sorted(self._sums):
            of_column, size = self._sums[name]
            crc = _zeros_behind(crc, size) ^ _zeros_behind(0, size) ^ of_column  # of the bytes before, and of these
        assert self._parquet is not None
        metadata = {KEY: header.dump(content | {_CRC: f"{crc:08x}"})}
        schema = _table(self._room, metadata).schema.serialize()  # as Arrow tells other tools of it
        both = metadata | {b"ARROW:schema": b64encode(schema)}
        self._parquet.add_key_value_metadata({key.decode(): text.decode() for key, text in both.items()})

    def close(self) -> None:
        """Close the file, complete or not."""
        if self._parquet is not None:
            self._parquet.close()

    def _write(self) -> None:
        columns = {name: values[: self._count] for name, values in self._room.items()}
        table = _table(columns)
        if self._parquet is None:
            import pyarrow.parquet as pq

            split = {name: "BYTE_STREAM_SPLIT" for name, values in columns.items() if values.dtype == np.float64}
            self._parquet = pq.ParquetWriter(
                self._file,
                table.schema,
                compression="zstd",
                use_dictionary=False,
                column_encoding=split | {TIME: "DELTA_BINARY_PACKED"},
                data_page_size=_PAGE_BYTES,
                write_statistics=False,
            )
        self._parquet.write_table(table)
        self._groups, self._count = self._groups + 1, 0
        for name, values in columns.items():
            crc, size = self._sums.get(name, (0, 0))
            little = values.astype(values.dtype.newbyteorder("<"), copy=False)
            self._sums[name] = zlib.crc32(little.data, crc), size + values.nbytes


def read_parquet(path: str | Path, in_memory: bool = True) -> Recording:
    """Read a native recording, whose samples may stay in the file, or a table that carries its profile or has one."""
    file = existing_file(path)
    with reading(file), _open(file) as parquet:
        metadata = parquet.metadata.metadata or {}
        is_own = KEY in metadata
        content, columns = _load(file, parquet, header.load(metadata[KEY]), in_memory) if is_own else ({}, {})
    if not is_own:
        from plumbob.files.formats import read_table

        return read_described(metadata, file) if PROFILE in metadata else read_table(file, None)
    with reading(file):
        content = header.parse_header(content)
        track, several = content["track"], content.get("array", {})
        layout.require(content["units"], imu=content["imu"] is not None, track=track is not None, units=list(several))
        metas = {name: meta for name, (meta, _) in several.items()}
        if content["imu"] is not None:
            metas[""] = content["imu"]
        units: dict[str, ImuData] = {}
        for name, meta in metas.items():
            if columns:
                part = layout.of_unit(columns, name) if name else columns
                triads = {triad: layout.joined(part, triad) for triad in TRIADS}
                temp_c, marks = part.get("temp_c"), part["flags"]
                units[name] = ImuData(to_s(part[TIME]), **triads, temp_c=temp_c, flags=marks, meta=meta)
            else:
                units[name] = Stored.open(file, meta, name)
        imu = units.pop("", None)
        mounts = {name: mount for name, (_, mount) in several.items()}
        return Recording(
            imu=imu,
            track=None if track is None else layout.track_from(columns, **track),
            name=file.stem,
            notes=lasting(content["notes"]),
            array=ImuArray(units, mounts) if units else None,
        )


def _of_all(name: str) -> property:
    """What an attribute of `ImuData` is for all samples that stay in a file."""

    def read(data: "Stored") -> NDArray[Any] | None:
        if {name, f"{name}_x"}.isdisjoint(data._names):
            return None
        values = data.only(*(TRIADS if name == "flags" else (name,))).gathered(lambda part: getattr(part, name))
        values.flags.writeable = False
        return values

    return property(read)


class Stored(ImuData):
    """Samples of a native recording that stay in their file: a part is in memory while it is looked at.

    Slices that follow each other are read once; flags too, which are small and asked for again and again.
    """

    _file: Path
    _meta: ImuMeta
    _unit: str
    _names: tuple[str, ...]
    _rows: int
    _late: NDArray[np.int64]
    _change: Callable[[ImuData], ImuData] | None
    _held: "_Held"
    _flags: NDArray[np.uint32] | None

    @classmethod
    def open(cls, file: Path, meta: ImuMeta, unit: str = "") -> Self:
        """Samples of a file whose content has been found to be whole, or of one of its units."""
        made = object.__new__(cls)
        with _open(file) as parquet:
            names = tuple(layout.of_unit(dict.fromkeys(parquet.schema_arrow.names), unit))  # type: ignore[arg-type]
            state = {"_file": file, "_unit": unit, "_names": names, "_rows": parquet.metadata.num_rows}
        state |= {"meta": meta, "_meta": meta, "_change": None, "_held": _Held(), "_flags": None}
        for name, value in state.items():
            object.__setattr__(made, name, value)
        check.increasing_time("t", made.t)
        object.__setattr__(made, "_late", np.flatnonzero(is_gap(np.diff(made.t_ns))) + 1)
        to_ns(made[made._rows - 1 :].t)
        made.require_possible()
        return made

    def __len__(self) -> int:
        return self._rows

    @property
    def triads(self) -> tuple[str, ...]:
        """Names of the triads that this recording has."""
        return tuple(name for name in TRIADS if GROUPS[name][0] in self._names)

    def each(self, change: Callable[[ImuData], ImuData]) -> ImuData:
        """Recording whose parts are those of this one after a change; see `ImuData.each`."""
        before = self._change
        after = change if before is None else lambda part: change(before(part))
        return self._with(meta=change(self[:1]).meta, _change=after)

    def only(self, *triads: str) -> ImuData:
        """Reader of these columns alone; of all where they are changed, for a change may ask for others."""
        if self._change is not None:
            return self
        others = {column for name in TRIADS if name not in triads for column in GROUPS[name]}
        others |= {"temp_c"} - set(triads)
        return self._with(_names=tuple(name for name in self._names if name not in others))

    def _with(self, **state: Any) -> Self:
        made = copy(self)
        for name, value in (state | {"_held": _Held(), "_flags": None}).items():
            object.__setattr__(made, name, value)
        return made

    def __getitem__(self, rows: slice) -> ImuData:
        start, stop = self._bounds(rows)
        if not self._held.begin <= start:
            change, parts = self._change, self._parts(start)
            self._held.restart(parts if change is None else ((at, change(part)) for at, part in parts))
        samples = self._held.between(start, stop)
        if stop == self._rows:
            self._held.restart(iter(()))  # who has read to the end needs the file no more
        return samples

    def _parts(self, start: int) -> Iterator[tuple[int, ImuData]]:
        """Parts from the row group on in which a row lies, with the rows that they begin with."""
        return read_in_parts(self._file, self._stored(start))

    def _stored(self, start: int) -> Iterator[tuple[int, ImuData]]:
        stored = {name if name == TIME or not self._unit else f"{self._unit}.{name}": name for name in self._names}
        for at, batch in _batches(self._file, list(stored), start):
            columns = {stored[name]: values for name, values in batch.items()}
            words = columns["flags"].copy()
            late = self._late[slice(*np.searchsorted(self._late, (at, at + words.size)))]
            words[late - at] |= np.uint32(flags.GAP)
            triads = {name: triad for name in TRIADS if (triad := layout.joined(columns, name)) is not None}
            part = ImuData.live(columns[TIME], triads, temp_c=columns.get("temp_c"), flags=words, meta=self._meta)
            yield at, part

    @property
    def t_ns(self) -> NDArray[np.int64]:
        """Time since the start, integer ns."""
        return self._times(np.empty(self._rows, dtype=np.int64), lambda stamps: stamps)

    @property
    def t(self) -> Floats:
        """Time since the start, s."""
        return self._times(np.empty(self._rows), to_s)

    def _times(self, times: NDArray[Any], convert: Callable[[NDArray[np.int64]], NDArray[Any]]) -> NDArray[Any]:
        """Times filled in from the file, part by part."""
        for at, columns in read_in_parts(self._file, _batches(self._file, (TIME,))):
            times[at : at + columns[TIME].size] = convert(columns[TIME])
        return times

    gyr: Any = _of_all("gyr")
    acc: Any = _of_all("acc")
    mag: Any = _of_all("mag")
    temp_c: Any = _of_all("temp_c")

    @property
    def flags(self) -> Any:
        """Flags of all samples, read once."""
        if self._flags is None:
            object.__setattr__(self, "_flags", _of_all("flags").fget(self))  # type: ignore[misc]
        return self._flags


class _Held:
    """Parts of a recording from a row on, as they come from its reader."""

    def __init__(self) -> None:
        self.restart(iter(()))

    def restart(self, parts: Iterator[tuple[int, ImuData]]) -> None:
        """Forget what was read, and go on with these."""
        self._parts, self._held = parts, list[tuple[int, ImuData]]()

    @property
    def begin(self) -> float:
        """First row that is held."""
        return self._held[0][0] if self._held else math.inf

    def between(self, start: int, stop: int) -> ImuData:
        """Samples of these rows; what lies before them is let go."""
        end = self._held[-1][0] + len(self._held[-1][1]) if self._held else 0
        while end < stop:
            at, part = next(self._parts)
            end = at + len(part)
            held = [(a, p) for a, p in (*self._held, (at, part)) if a + len(p) > start]
            self._held = [(max(a, start), p[max(start - a, 0) :]) for a, p in held]
        self._held = [(self._held[0][0], ImuData.joined([part for _, part in self._held]))]
        ((at, part),) = self._held
        return part[start - at : stop - at]


def _load(
    file: Path, parquet: "pq.ParquetFile", content: dict[str, Any], in_memory: bool
) -> tuple[dict[str, Any], Columns]:
    """Header and columns; no columns where they are to stay in the file and have been found to be whole."""
    crc, units, names = content.pop(_CRC, None), content.get("units"), parquet.schema_arrow.names
    if not isinstance(units, dict) or sorted(units) != sorted(names):
        raise DecodeError("its columns and the units in its header do not have the same names; write the file again.")
    for field in parquet.schema_arrow:
        spec = layout.column(field.name)
        expected = {"float64": "double"}.get(spec.dtype, spec.dtype)  # as Arrow calls it
        if str(field.type) != expected:
            raise DecodeError(
                f"the column {field.name} must be {expected}, but it is {field.type}; write the recording again with "
                "plumbob."
            )
        stated = (field.metadata or {}).get(_UNIT, b"").decode("utf-8", "replace")
        if not stated == units[field.name] == spec.unit:
            raise DecodeError(
                f"the column {field.name} must be in {spec.unit}, but its metadata says '{stated}' and the header "
                f"'{units[field.name]}'; convert the data and write the recording again with plumbob."
            )
    rows, stored = parquet.metadata.num_rows, file.stat().st_size
    if rows < 1:
        raise DecodeError(f"it claims {rows} rows in {stored} bytes, which cannot be; use an intact copy.")
    row = sum(np.dtype(layout.column(name).dtype).itemsize for name in names)
    require_room(max(rows * row, unpacked_bytes(file)), stored)  # by its contents, and by every page
    bare = {name.rpartition(".")[2] for name in names}
    columns: Columns = {}
    if in_memory or content.get("track") or bare.isdisjoint(GROUPS[name][0] for name in TRIADS):
        # one after the other, so that only one of them is in memory twice
        columns = {name: _array(name, parquet.read([name]).column(0)) for name in names}
    stored_columns: Iterable[tuple[str, NDArray[Any]]] = sorted(columns.items())
    if not columns:
        stored_columns = ((name, part[name]) for name in sorted(names) for _, part in _batches(file, (name,)))
    checksum = zlib.crc32(header.dump(content))
    for _, values in stored_columns:  # in the order of their names, each in one piece or several
        checksum = zlib.crc32(np.ascontiguousarray(values, values.dtype.newbyteorder("<")).data, checksum)
    if crc != f"{checksum:08x}":
        raise DecodeError("its content does not fit its checksum: the file is damaged; use an intact copy.")
    return content, columns


@contextmanager
def _open(file: Path, **how: Any) -> "Iterator[pq.ParquetFile]":
    """File whose table of contents, whose size stands before the last four bytes, is not larger than that of a year.

    Whatever Arrow finds wrong in it, when it opens the file or later, is said in one line; other errors stay what they
    are.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    size = file.stat().st_size
    with file.open("rb") as stream:
        stream.seek(max(0, size - 8))
        stated = int.from_bytes(stream.read(4), "little")
    allowed = max(_CONTENTS_BYTES, size >> 8)  # that of 64 units for an hour has a thousandth of all
    if allowed < stated < size:
        raise DecodeError(
            f"its table of contents has {stated} bytes, but {allowed} are allowed; write it with fewer row groups."
        )
    limits: Any = {"thrift_string_size_limit": _CONTENTS_BYTES, "thrift_container_size_limit": _THRIFT_ITEMS}
    errors = pa.ArrowException, OSError, UnicodeDecodeError  # of all of Arrow's, two are Python's own
    with intact("it is not a Parquet file, or it", errors), pq.ParquetFile(file, **limits, **how) as parquet:
        yield parquet


def _batches(file: Path, names: Sequence[str], start: int = 0) -> Iterator[tuple[int, Columns]]:
    """Rows of these columns, some at a time, from the row group on in which a row lies; and which is their first."""
    import pyarrow as pa

    with _open(file, buffer_size=_PAGE_BYTES, pre_buffer=False) as parquet:
        ends = np.cumsum([parquet.metadata.row_group(i).num_rows for i in range(parquet.num_row_groups)])
        first = int(np.searchsorted(ends, start, side="right"))
        at = int(ends[first - 1]) if first else 0
        for batch in parquet.iter_batches(_BATCH, list(range(first, ends.size)), list(names)):
            yield at, {name: _array(name, pa.chunked_array([batch.column(name)])) for name in names}
            at += batch.num_rows


def _array(name: str, values: "pa.ChunkedArray[Any]") -> NDArray[Any]:
    if values.null_count:
        raise DecodeError(f"the column {name} holds {values.null_count} nulls; a missing value is stored as NaN.")
    return np.ascontiguousarray(column_numbers(values), dtype=layout.column(name).dtype)


def _table(columns: Columns, metadata: Any = None) -> "pa.Table":
    import pyarrow as pa

    schema = pa.schema(
        [
            pa.field(name, pa.from_numpy_dtype(values.dtype), False, {_UNIT: layout.column(name).unit.encode()})
            for name, values in columns.items()
        ],
        metadata=metadata,
    )
    return pa.Table.from_arrays([arrow_column(values) for values in columns.values()], schema=schema)


@lru_cache(maxsize=64)  # the columns of a recording have two or three sizes
def _zeros_behind(crc: int, size: int) -> int:
    """CRC-32 of bytes whose own is `crc`, and of so many zeros behind them."""
    for at in range(0, size, len(_ZEROS)):
        crc = zlib.crc32(memoryview(_ZEROS)[: size - at], crc)
    return crc
