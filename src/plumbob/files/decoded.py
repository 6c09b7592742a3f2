"""Tables of `plumbob decode` as recordings: the profile that says what their columns are, and Parquet read by it."""

from collections.abc import Mapping
from decimal import Decimal
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from plumbob.core.errors import DecodeError, ParameterError
from plumbob.core.files import require_room
from plumbob.core.findings import info
from plumbob.core.schema import toml_text
from plumbob.data import TRIADS
from plumbob.data.cards import UNITS
from plumbob.files.arrow import column_numbers, unpacked_bytes
from plumbob.files.profile import NO_COLUMN

if TYPE_CHECKING:
    import pyarrow.parquet as pq

    from plumbob.data.recording import Recording
    from plumbob.protocols.format import Format, Message

KEY: Final = b"plumbob profile"
"""Where a Parquet table keeps its profile among its metadata."""
_MOST_BYTES: Final = 4096
"""Bytes of numbers that a byte of a Parquet file may hold, beyond what is free; a file that claims more lies."""
_FREE_BYTES: Final = 16 * 1024 * 1024


def profile_text(form: "Format", message: "Message", unit: str, titles: Mapping[str, str], time: str) -> str:
    """Profile of a decoded table.

    Raises ParameterError if the message lacks the unit.

    `form`, `message`: what was decoded; `unit`: prefix of the unit that it describes; `titles`: names of the columns,
    by field; ``flags`` with the unit's prefix too; `time`: name of the column of time, s; empty where the table has
    none.
    """
    from plumbob.protocols.decode import prefix_by_unit

    units = prefix_by_unit(message)
    if unit not in units:
        raise ParameterError(f"{message.name} has no unit '{unit}'; known are {', '.join(units)}.")
    prefix, what = (f"{unit}.", f"{message.name}, unit {unit}") if unit else ("", message.name)
    lines = [
        f"# Written by 'plumbob decode' for the table of the same name: {what}.",
        'separator = ","',
        f"device = {toml_text(form.name)}",
        "unit_check = false",
        *("", "[header]", "names = true", "", "[time]", *_time(time, form.framing.rate)),
    ]
    for triad in TRIADS:
        columns = [titles.get(f"{prefix}{triad}.{axis}", NO_COLUMN) for axis in "xyz"]
        if set(columns) != {NO_COLUMN}:
            lines += ["", f"[{triad}]", f"columns = [{', '.join(map(toml_text, columns))}]", f'unit = "{UNITS[triad]}"']
            lines += ['sign = "specific-force"'] if triad == "acc" else []
    if f"{prefix}temp_c" in titles:
        lines += ["", "[temperature]", f"column = {toml_text(titles[f'{prefix}temp_c'])}", 'unit = "degC"']
    if f"{prefix}flags" in titles:
        lines += ["", "[flags]", f"column = {toml_text(f'{prefix}flags')}", "words = true"]
    return "\n".join(lines) + "\n"


def _time(column: str, rate: float | None) -> list[str]:
    if column:
        return [f"column = {toml_text(column)}", 'unit = "s"']
    if rate is not None:
        return [f'rate = "{rate!r} Hz"  # of the device; a lost frame makes all behind it early']
    return [
        'rate = "?"  # frames per second, as in "100 Hz": the bytes do not say it, and decode --rate writes it here'
    ]


def read_described(parquet: "pq.ParquetFile", file: Path) -> "Recording":
    """Recording of a Parquet table that carries its profile.

    Raises PlumbobError as `plumbob.files.text.read_text`.
    """
    from plumbob.files.profile_toml import parse_profile
    from plumbob.files.text import table_recording
    from plumbob.files.text_table import TextTable

    text = (parquet.metadata.metadata or {})[KEY].decode("utf-8", "replace")
    profile = parse_profile(text, origin="in its metadata")
    refs = [str(ref) for ref in profile.used]
    if missing := [ref for ref in refs if ref not in parquet.schema_arrow.names]:
        raise DecodeError(f"it has no column {missing[0]}, which its own profile names; decode the bytes again.")
    rows = parquet.metadata.num_rows
    if rows < 1 or 8 * rows * len(refs) > _FREE_BYTES + _MOST_BYTES * file.stat().st_size:
        raise DecodeError(f"it claims {rows} rows in {file.stat().st_size} bytes, which cannot be; decode again.")
    require_room(unpacked_bytes(file, parquet.metadata), file.stat().st_size)
    table = parquet.read(columns=refs)
    words = [ref for ref in profile.texts if ref in refs]
    numbers: dict[Any, Any] = {
        ref: np.asarray(column_numbers(table.column(ref)), dtype=np.float64) for ref in refs if ref not in words
    }
    texts: dict[Any, Any] = {ref: table.column(ref).to_pylist() for ref in words}
    decoded = TextTable(numbers, Decimal(0), rows, (), texts, lambda row: row + 1)
    return table_recording(profile, decoded, file.stem, info("source.profile_inside"))
