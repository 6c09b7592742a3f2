"""The native recording: one Parquet file with units, a header and a checksum over everything it holds.

Parquet keeps every bit of a float, and any data-frame tool opens the file. What the format does not promise is added
here: the reader recomputes a CRC-32 over the header and all columns, so a flipped bit is refused, not used.
"""

import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.docs import guide
from plumbob.core.errors import DecodeError, one_line
from plumbob.core.files import existing_file, reading, replacing, require_room
from plumbob.files import header
from plumbob.files.arrow import column_of, numbers_of, unpacked_bytes
from plumbob.files.columns import COLUMNS, TIME, Columns, imu_from, require, to_columns, track_from
from plumbob.files.decoded import KEY as PROFILE
from plumbob.files.decoded import read_described
from plumbob.files.notes import Recording, read_notes

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


def write_parquet(path: Path, recording: Recording, overwrite: bool = False) -> None:
    """Write a native recording; the final name appears only when the file is complete.

    Raises
    ------
    ClockError
        If imu and track have different time stamps.
    ParameterError
        If the file exists and `overwrite` is false.
    DecodeError
        If the system refuses to write.
    """
    import pyarrow.parquet as pq

    columns = to_columns(recording)
    table = _table(columns, header.header_of(recording, list(columns)))
    with replacing(path, overwrite=overwrite, seeks=True) as temporary:
        pq.write_table(
            table,
            temporary,
            compression="zstd",
            use_dictionary=False,
            column_encoding=_encodings(columns),
            data_page_size=_PAGE_BYTES,
            write_statistics=False,
        )


def read_parquet(path: str | Path) -> Recording:
    """Read a native recording, to the bit.

    Raises
    ------
    DecodeError
        If the file is not Parquet, cut, damaged, foreign, or of a newer version; the message is one line.
    """
    file = existing_file(path)
    with reading(file):
        with _open(file) as parquet:
            if _is_described(parquet):
                return read_described(parquet, file)
            content, columns = _load(file, parquet)
        header.check_header(content)
        meta, track = content["imu"], content["track"]
        require(columns, imu=meta is not None, track=track is not None)
        imu = None if meta is None else imu_from(columns, header.meta_from(meta))
        return Recording(
            imu=imu,
            track=None if track is None else track_from(columns, *header.track_meta_from(track)),
            name=file.stem,
            notes=read_notes(content["notes"], imu),
        )


def _is_described(parquet: "pq.ParquetFile") -> bool:
    metadata = parquet.metadata.metadata or {}
    return KEY not in metadata and PROFILE in metadata


def _load(file: Path, parquet: "pq.ParquetFile") -> tuple[dict[str, Any], Columns]:
    content = header.load(_raw_header(parquet))
    crc = content.pop(_CRC, None)
    _check_schema(parquet, content.get("units"))
    _check_size(file, parquet)
    columns = _columns(parquet)
    if crc != _checksum(content, columns):
        raise DecodeError("its content does not fit its checksum: the file is damaged; take a copy that is whole.")
    return content, columns


def _open(file: Path) -> "pq.ParquetFile":
    import pyarrow.parquet as pq

    _check_contents(file)
    try:
        return pq.ParquetFile(file, thrift_string_size_limit=_CONTENTS_BYTES, thrift_container_size_limit=_THRIFT_ITEMS)
    except Exception as error:  # Arrow has a dozen types for damaged input
        raise DecodeError(
            f"it is not a Parquet file, or it is cut or damaged ({_short(error)}); take a copy that is whole."
        ) from error


def _raw_header(parquet: "pq.ParquetFile") -> bytes:
    metadata = parquet.metadata.metadata or {}
    if KEY not in metadata:
        raise DecodeError(
            "it is not a recording, but a Parquet file of another program (no 'plumbob' in its metadata); "
            f"export it as CSV and describe that with a profile, see {guide('file-formats.md')}."
        )
    return metadata[KEY]


def _check_schema(parquet: "pq.ParquetFile", units: Any) -> None:
    try:
        schema = parquet.schema_arrow
    except Exception as error:  # as in _open
        raise DecodeError(f"its schema is damaged ({_short(error)}); take a copy that is whole.") from error
    if not isinstance(units, dict) or sorted(units) != sorted(schema.names):
        raise DecodeError("its columns and the units in its header are not of the same names; write the file again.")
    for field in schema:
        known = COLUMNS.get(field.name)
        if known is None:
            raise DecodeError(f"the column {field.name} is unknown; known are {', '.join(COLUMNS)}.")
        if str(field.type) != _arrow_type(known.dtype):
            raise DecodeError(
                f"the column {field.name} must be {_arrow_type(known.dtype)}, but it is {field.type}; write the "
                "recording again with plumbob."
            )
        stated = (field.metadata or {}).get(_UNIT, b"").decode("utf-8", "replace")
        if not stated == units[field.name] == known.unit:
            raise DecodeError(
                f"the column {field.name} must be in {known.unit}, but its metadata says '{stated}' and the header "
                f"'{units[field.name]}'; convert the data and write the recording again with plumbob."
            )


def _check_contents(file: Path) -> None:
    """Refuse a table of contents that is larger than that of a year: its size stands before the last four bytes."""
    size = file.stat().st_size
    with file.open("rb") as stream:
        stream.seek(max(0, size - 8))
        stated = int.from_bytes(stream.read(4), "little")
    if _CONTENTS_BYTES < stated < size:
        raise DecodeError(
            f"its table of contents has {stated} bytes, but {_CONTENTS_BYTES} are allowed; write it with fewer row "
            "groups."
        )


def _check_size(file: Path, parquet: "pq.ParquetFile") -> None:
    """Refuse what needs more memory than a file of this size may, by its table of contents and by every page."""
    rows, stored = parquet.metadata.num_rows, file.stat().st_size
    if rows < 1:
        raise DecodeError(f"it claims {rows} rows in {stored} bytes, which cannot be; take a copy that is whole.")
    row = sum(np.dtype(COLUMNS[name].dtype).itemsize for name in parquet.schema_arrow.names)
    require_room(max(rows * row, unpacked_bytes(file, parquet.metadata)), stored)


def _columns(parquet: "pq.ParquetFile") -> Columns:
    """Columns one after the other, so that only one of them is in memory twice."""
    try:
        return {name: _array(name, parquet.read([name]).column(0)) for name in parquet.schema_arrow.names}
    except DecodeError:
        raise
    except Exception as error:  # as in _open
        raise DecodeError(f"its data are damaged ({_short(error)}); take a copy that is whole.") from error


def _array(name: str, column: "pa.ChunkedArray[Any]") -> NDArray[Any]:
    if column.null_count:
        raise DecodeError(f"the column {name} holds {column.null_count} nulls; a missing value is stored as NaN.")
    return np.ascontiguousarray(numbers_of(column), dtype=COLUMNS[name].dtype)


def _table(columns: Columns, content: dict[str, Any]) -> "pa.Table":
    import pyarrow as pa

    schema = pa.schema(
        [
            pa.field(name, pa.from_numpy_dtype(values.dtype), False, {_UNIT: COLUMNS[name].unit.encode()})
            for name, values in columns.items()
        ],
        metadata={KEY: header.dump(content | {_CRC: _checksum(content, columns)})},
    )
    return pa.Table.from_arrays([column_of(values) for values in columns.values()], schema=schema)


def _encodings(columns: Columns) -> dict[str, str]:
    floats = {name: "BYTE_STREAM_SPLIT" for name, values in columns.items() if values.dtype == np.float64}
    return floats | {TIME: "DELTA_BINARY_PACKED"}


def _checksum(content: dict[str, Any], columns: Columns) -> str:
    crc = zlib.crc32(header.dump(content))
    for name in sorted(columns):
        values = np.ascontiguousarray(columns[name], dtype=np.dtype(COLUMNS[name].dtype).newbyteorder("<"))
        crc = zlib.crc32(values.data, crc)
    return f"{crc:08x}"


def _arrow_type(dtype: str) -> str:
    return {"float64": "double"}.get(dtype, dtype)


def _short(error: Exception) -> str:
    return one_line(error)[:160].rstrip(".")
