"""Arrow and Parquet: columns to and from NumPy, how large pages unpack, and tables of numbers over time; packed texts.

Columns go by their buffers, as Arrow's own conversions import pandas wherever it is installed. `unpacked_bytes` goes by
the headers in front of a file's pages: Arrow believes a page's own size, whatever the table of contents says of its
column, and 33 kB unpacked to a gigabyte. Both are in Thrift's compact protocol (parquet.thrift, FileMetaData and
PageHeader; thrift-compact-protocol.md). `write_table` names columns with their unit, as ``.csv`` or ``.parquet``.
"""

import csv
import errno
import io
import lzma
import math
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.errors import DecodeError, ParameterError, PlumbobError, one_line
from plumbob.core.files import replacing, require_room
from plumbob.core.series import needed
from plumbob.core.text import first_words

if TYPE_CHECKING:
    import pyarrow as pa

_OF_CONTENT: Final = (None, errno.EINVAL, errno.EOVERFLOW)  # a place that no file has is one that its content names


@contextmanager
def intact(what: str = "it", errors: type[Exception] | tuple[type[Exception], ...] = Exception) -> Iterator[None]:
    """Say of what cannot be read that it is damaged, whatever errors a library has for that.

    An error of the disk is not damage: the system gives it a number, which libraries' own have not.
    """
    try:
        yield
    except PlumbobError:
        raise
    except errors as error:
        if isinstance(error, OSError) and error.errno not in _OF_CONTENT:
            raise
        why = one_line(error)[:160].rstrip(".")
        raise DecodeError(f"{what} is cut or damaged ({why}); use an intact copy.") from error


def column_numbers(column: "pa.ChunkedArray[Any]") -> NDArray[Any]:
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


def parsed_csv(
    packed: bytes, separator: str, width: int, types: dict[str, Any], *, quoted: bool = True, **convert: Any
) -> "pa.Table | None":
    """Columns of rows of `width` cells, by their numbers from 0, as far as they have types; None if Arrow refuses."""
    import pyarrow as pa
    from pyarrow import csv

    source: Any = pa.BufferReader(pa.py_buffer(packed))
    try:
        return csv.read_csv(
            source,
            csv.ReadOptions(column_names=[str(i) for i in range(width)]),
            csv.ParseOptions(delimiter=separator, quote_char='"' if quoted else False),
            csv.ConvertOptions(column_types=types, include_columns=list(types), **convert),
        )
    except (pa.ArrowException, OSError, ValueError):
        return None


def arrow_column(values: NDArray[Any]) -> "pa.Array[Any]":
    """Arrow column of numbers (N,), which share its memory; of truths, eight to a byte."""
    import pyarrow as pa

    array = np.ascontiguousarray(values)
    stored = np.packbits(array, bitorder="little") if array.dtype == bool else array
    return pa.Array.from_buffers(pa.from_numpy_dtype(array.dtype), array.size, [None, pa.py_buffer(stored.data)])


_UNPACKED, _STORED = 2, 3  # fields of a PageHeader
_GROUPS, _COLUMNS, _CHUNK, _PACKED, _DATA, _DICTIONARY = 4, 1, 3, 7, 9, 11  # of FileMetaData to ColumnMetaData
_HEADER_BYTES: Final = 64 * 1024
_DEPTH: Final = 12
_BOOLEANS, _BYTE, _INTEGERS, _DOUBLE, _TEXT, _LIST, _STRUCT = (1, 2), 3, (4, 5, 6), 7, 8, 9, 12  # types of a field


def unpacked_bytes(file: Path) -> int:
    """Bytes that the pages of all columns say that they unpack to; DecodeError where one is outside or damaged.

    The table of contents is read here, as Arrow ends the process where it asks for a column that contradicts itself.
    """
    size, total = file.stat().st_size, 0
    with file.open("rb") as stream:
        stream.seek(max(0, size - 8))
        stream.seek(max(0, size - 8 - int.from_bytes(stream.read(4), "little")))
        try:
            contents, _ = _thrift(stream.read())
            columns = [column[_CHUNK] for group in contents[_GROUPS] for column in group[_COLUMNS]]
            starts = [min(filter(None, map(column.get, (_DICTIONARY, _DATA))), default=0) for column in columns]
            places = [(start, start + column[_PACKED]) for start, column in zip(starts, columns, strict=True)]
            is_whole = all(0 < start <= end <= size for start, end in places)
        except (LookupError, TypeError, AttributeError):
            is_whole = False
        if not is_whole:
            raise DecodeError("its table of contents is damaged, or names a place outside it; use an intact copy.")
        for start, end in places:
            stream.seek(start)
            chunk, at = stream.read(end - start), 0
            while at < len(chunk):
                try:
                    fields, after = _thrift(chunk[at : at + _HEADER_BYTES])
                except IndexError as error:
                    raise DecodeError("the header of a page is cut; use an intact copy.") from error
                unpacked, stored = (n if isinstance(n := fields.get(key), int) else -1 for key in (_UNPACKED, _STORED))
                at += after + stored
                if unpacked < 0 or stored < 0 or at > len(chunk):
                    raise DecodeError("a page of it is damaged; use an intact copy.")
                total += unpacked
    return total


def _thrift(data: bytes) -> tuple[dict[int, Any], int]:
    """Whole numbers, lists and structs of a struct by their field numbers, of others None; and where it ends.

    IndexError where it is cut, DecodeError where it holds what Parquet does not write.
    """
    fields: dict[int, Any] = {}
    at, around = 0, list[list[Any]]([[fields, 0, 0]])  # a struct and its latest field; a list, its kind, items to come
    while around:
        items, kind, number = inside = around[-1]
        if is_list := isinstance(items, list):
            number -= 1
        else:
            head, at = data[at], at + 1
            kind, number = (head & 15, number + (head >> 4)) if head else (0, -1)
            if 0 < head < 16:  # the number itself follows
                number, at = (coded := _varint(data, at))[0] >> 1, coded[1]
        if number < 0:
            around.pop()
            continue
        inside[2] = number
        value: Any = None
        if kind in _INTEGERS or kind == _TEXT:
            value, at = _varint(data, at)
            at, value = (at + value, None) if kind == _TEXT else (at, value >> 1 ^ -(value & 1))
        elif kind in (_LIST, _STRUCT) and len(around) < _DEPTH:
            head, at = (data[at], at + 1) if kind == _LIST else (0, at)
            size, at = (head >> 4, at) if head < 0xF0 else _varint(data, at)
            value = [] if kind == _LIST else {}
            around.append([value, head & 15, min(size, len(data))])
        elif kind not in (*_BOOLEANS, _BYTE, _DOUBLE):
            raise DecodeError(f"the header of a page holds a field of type {kind}; use an intact copy.")
        elif is_list or kind not in _BOOLEANS:  # a field's truth is its kind
            at += 8 if kind == _DOUBLE else 1
        if is_list:
            items.append(value)
        else:
            items[number] = value
    return fields, at


def _varint(data: bytes, at: int) -> tuple[int, int]:
    """Whole number in groups of seven bits, and where it ends."""
    value, shift = data[at] & 0x7F, 7
    while data[at] & 0x80 and shift < 64:
        at += 1
        value |= (data[at] & 0x7F) << shift
        shift += 7
    return value, at + 1


_WORKBOOK: Final = "xl/workbook.xml"
_PACKINGS: Final = {b"\x1f\x8b": "gzip", b"BZh": "bz2", b"(\xb5/\xfd": "zstd", b"\xfd7zXZ": "xz", b"PK\3\4": "zip"}
_TABLES: Final = {b"PAR1": "parquet", b"ARROW1": "feather", b"ORC": "orc"}
AT_ONCE: Final = 1 << 21


def text_bytes(path: Path, most: int | None = None) -> bytes:
    """Bytes of a text file as of `text_pieces`, or the first `most` of them."""
    return b"".join(text_pieces(path, most))[:most]


def text_pieces(path: Path, most: int | None = None) -> Iterator[bytes]:
    """Bytes of a text file, some at a time, or at least the first `most` of them.

    What is packed (gzip, bzip2, xz, Zstandard, a ZIP of one file) is unpacked, within `require_room`, and a table of
    other programs in Parquet, Feather or ORC is one with tabs: a vector in one column becomes columns ``name_x`` and so
    on.
    """
    with path.open("rb") as file:
        start = file.read(8)
        file.seek(0)
        packing = next((how for mark, how in _PACKINGS.items() if start.startswith(mark)), "")
        kind = next((kind for mark, kind in _TABLES.items() if start.startswith(mark)), "")
        with intact():
            if kind:
                yield _table_text(path, kind, most)
            elif packing:
                yield from _unpacked(path, file, packing, most)
        size = 0
        while not (packing or kind) and (most is None or size < most) and (piece := file.read(most or AT_ONCE)):
            yield piece
            size += len(piece)


def _unpacked(path: Path, file: IO[bytes], packing: str, most: int | None) -> Iterator[bytes]:
    import pyarrow as pa

    with ExitStack() as stack:
        if packing == "zip":
            archive = stack.enter_context(zipfile.ZipFile(file))
            names = [name for name in archive.namelist() if not name.endswith("/")]
            if _WORKBOOK in names:
                require_room(sum(info.file_size for info in archive.infolist()), path.stat().st_size)
                yield _sheets(path)
                return
            if len(names) != 1:
                raise DecodeError(
                    f"it holds {len(names)} files ({first_words(names, 3)}); unpack it, and name one of them."
                )
            stream: Any = stack.enter_context(archive.open(names[0]))
        else:
            unpacker: Any = lzma.LZMAFile if packing == "xz" else pa.CompressedInputStream
            stream = stack.enter_context(unpacker(file, *([] if packing == "xz" else [packing])))
        size = 0
        while (most is None or size < most) and (piece := stream.read(AT_ONCE)):
            size += len(piece)
            require_room(size, path.stat().st_size)
            yield piece


def _sheets(path: Path) -> bytes:
    """Sheets of a spreadsheet as text with tabs, each below its title; those without rows of numbers come first."""
    openpyxl = needed("openpyxl", "spreadsheets", "plumbob[excel]")
    book = openpyxl.load_workbook(path, read_only=True, data_only=True)
    sheets = []
    for sheet in book.worksheets:
        rows = [row for row in sheet.iter_rows(values_only=True) if any(cell is not None for cell in row)]
        is_table = sum(sum(isinstance(cell, int | float) for cell in row) > 1 for row in rows) > 2
        lines = ["\t".join("" if cell is None else " ".join(str(cell).split()) for cell in row) for row in rows]
        sheets.append((is_table, "\n".join([sheet.title, *lines])))
    book.close()
    return "\n\n".join([text for _, text in sorted(sheets, key=lambda sheet: sheet[0])] + [""]).encode()


def holds_recording(path: Path) -> bool:
    """Whether a file is a recording of Plumbob in Parquet, which describes itself; of a damaged one nobody knows."""
    import pyarrow as pa
    from pyarrow import parquet as pq

    with suppress(pa.ArrowException, OSError):
        return b"plumbob" in (pq.read_metadata(path).metadata or {})
    return False


def _table_text(path: Path, kind: str, most: int | None) -> bytes:
    import pyarrow as pa
    from pyarrow import compute, feather, orc
    from pyarrow import csv as arrow_csv
    from pyarrow import parquet as pq

    if kind == "parquet":
        if holds_recording(path):
            raise DecodeError("it is a recording of Plumbob: let its name end in .parquet, and give it no profile.")
        require_room(unpacked_bytes(path), path.stat().st_size)
    read: dict[str, Any] = {"parquet": pq.read_table, "feather": feather.read_table, "orc": orc.read_table}
    table = read[kind](path)
    require_room(table.nbytes, path.stat().st_size)
    while any(pa.types.is_struct(column.type) for column in table.columns):
        table = table.flatten()
    vectors = [pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind) for kind in table.schema.types]
    scalars = {name for name, vector in zip(table.column_names, vectors, strict=True) if not vector}
    wanted = None if most is None else most // max(len(scalars), 1) + 1  # rows: a number takes a byte at least
    columns: dict[str, Any] = {}
    for name, column, vector in zip(table.column_names, table.columns, vectors, strict=True):
        if not vector:
            columns[name] = column.slice(0, wanted)
            continue
        width = compute.max(compute.list_value_length(column)).as_py() or 0
        rows = column.slice(0, wanted).to_pylist()
        for k, axis in enumerate({3: "xyz", 4: "wxyz"}.get(width, map(str, range(1, width + 1)))):
            columns[f"{name}_{axis}"] = pa.array([None if row is None or len(row) <= k else row[k] for row in rows])
    text, options = pa.BufferOutputStream(), arrow_csv.WriteOptions(delimiter="\t", include_header=False)
    text.write("\t".join(" ".join(name.split()) for name in columns).encode() + b"\n")
    arrow_csv.write_csv(pa.table(columns), text, options)
    return text.getvalue().to_pybytes()[:most]


TABLES: Final = (".csv", ".parquet")  # endings of a table's file


def write_rows(path: Path, head: str, columns: Mapping[str, NDArray[Any]]) -> None:
    """Write rows of numbers with commas between them behind a head, to the bit."""
    import pyarrow as pa
    from pyarrow import csv as arrow_csv

    table = pa.table({name: arrow_column(values) for name, values in columns.items()})
    with path.open("wb") as stream:
        stream.write(head.encode("utf-8", "replace"))
        arrow_csv.write_csv(table, stream, arrow_csv.WriteOptions(include_header=False, quoting_style="none"))


def write_table(
    path: Path,
    columns: Mapping[str, NDArray[Any]],
    *,
    metadata: dict[bytes, bytes] | None = None,
    overwrite: bool = False,
) -> Path:
    """Write columns (N,) of numbers, whole or not at all and to the bit; only a ``.parquet`` takes `metadata`."""
    kind = path.suffix.lower()
    if kind not in TABLES:
        raise ParameterError(f"a table ends in {' or '.join(TABLES)}, but it is {path}.")
    with replacing(path, overwrite=overwrite, seeks=kind == ".parquet") as temporary:
        if kind == ".parquet":
            import pyarrow as pa
            import pyarrow.parquet as pq

            table = pa.table({name: arrow_column(values) for name, values in columns.items()}, metadata=metadata)
            pq.write_table(table, temporary, compression="zstd", use_dictionary=False, write_page_checksum=True)
        else:
            head = io.StringIO()
            csv.writer(head, lineterminator="\n").writerow(columns)
            write_rows(temporary, head.getvalue(), columns)
    return path
