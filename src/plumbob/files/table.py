"""A table of numbers over time as a file: columns by name with unit, ``.csv`` or ``.parquet``."""

import csv
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from numpy.typing import NDArray

from plumbob.core.errors import ParameterError
from plumbob.core.files import replacing
from plumbob.files.arrow import column_of

SUFFIXES: Final = (".csv", ".parquet")


def write_table(
    path: Path,
    columns: Mapping[str, NDArray[Any]],
    *,
    metadata: dict[bytes, bytes] | None = None,
    overwrite: bool = False,
) -> Path:
    """Write columns (N,) of numbers; the file appears whole or not at all, and keeps every bit.

    `metadata` goes into a ``.parquet`` file; a ``.csv`` has no place for it.

    Raises
    ------
    ParameterError
        If the suffix is another, or the file exists and `overwrite` is false.
    DecodeError
        If the system refuses to write.
    """
    kind = path.suffix.lower()
    if kind not in SUFFIXES:
        raise ParameterError(f"a table ends in {' or '.join(SUFFIXES)}, but it is {path}.")
    import pyarrow as pa

    table = pa.table({name: column_of(values) for name, values in columns.items()})
    with replacing(path, overwrite=overwrite, seeks=kind == ".parquet") as temporary:
        if kind == ".parquet":
            import pyarrow.parquet as pq

            pq.write_table(
                table.replace_schema_metadata(metadata),
                temporary,
                compression="zstd",
                use_dictionary=False,
                write_page_checksum=True,
            )
        else:
            from pyarrow import csv as arrow_csv

            head = io.StringIO()
            csv.writer(head, lineterminator="\n").writerow(columns)
            with temporary.open("wb") as stream:
                stream.write(head.getvalue().encode())
                arrow_csv.write_csv(table, stream, arrow_csv.WriteOptions(include_header=False, quoting_style="none"))
    return path
