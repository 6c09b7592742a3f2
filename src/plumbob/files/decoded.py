"""Tables of `plumbob decode`, the profile by which they are recordings, and Parquet read by it."""

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from plumbob.core.errors import unknown_name
from plumbob.core.files import profile_beside, replacing, replacing_all, write_text
from plumbob.core.schema import toml_text
from plumbob.data import TRIADS, UNCALIBRATED
from plumbob.data.cards import UNITS
from plumbob.files.profile import NO_COLUMN, toml_lines

if TYPE_CHECKING:
    from plumbob.data.recording import Recording
    from plumbob.protocols.decode import Counts, Frames
    from plumbob.protocols.format import Format, Message

TEXTS: Final = (".csv", ".txt")  # suffixes of tables that get their profile beside them
TIME: Final = "t [s]"  # column of time
KEY: Final = b"plumbob profile"  # where a Parquet table keeps its profile among its metadata


class DecodedTable:
    """Rows of one message, empty for the first that comes, as its frames come; `rate`, Hz, adds a column of time."""

    def __init__(self, form: "Format", message: str, rate: float | None) -> None:
        self.form, self.message, self.rate = form, message, rate
        self.skipped = self._rows = 0  # how many frames the counter skips; a count that repeats skips nothing
        self._parts: list[Frames] = []
        self._count: int | None = None

    def add(self, frames: "Mapping[str, Frames]") -> None:
        """Take the frames of the message."""
        self.message = self.message or min(frames, key=lambda name: int(frames[name].start[0]), default="")
        if (part := frames.get(self.message)) is None:
            return
        self._parts.append(part)
        if (counter := part.message.of_role("counter")) is not None:
            counts = part.columns[counter.name].astype(np.int64)
            before = counts[0] - 1 if self._count is None else self._count
            steps = np.diff(counts, prepend=before) % (1 << counter.width)
            self._count = int(counts[-1])
            self.skipped += int(np.maximum(steps - 1, 0).sum())

    def csv(self) -> Iterator[str]:
        """Lines of what has come since the last call."""
        for block in self._blocks():
            if self._rows == len(next(iter(block.values()))):
                yield ",".join(block) + "\n"
            for row in zip(*block.values(), strict=True):
                cells = ("" if v is None else f"{v:.12g}" if isinstance(v, float) else str(v) for v in row)
                yield ",".join(cells) + "\n"

    def write(self, path: Path, counts: "Counts", unit: str | None, *, overwrite: bool) -> None:
        """Write all as the suffix says, described as a recording of a unit: beside a text, inside Parquet."""
        profile = profile_text(self.form, self.form.message(self.message), unit, TIME if self.rate else "")
        if path.suffix in TEXTS:
            beside = [profile_beside(path)] if profile else []
            with replacing_all(path, *beside, overwrite=overwrite) as (temporary, *described):
                for file in described:
                    file.write_text(profile, encoding="utf-8")
                with temporary.open("w", encoding="utf-8") as stream:
                    stream.writelines(self.csv())
            return
        columns: dict[str, list[Any]] = {}
        for block in self._blocks():
            for name, values in block.items():
                columns.setdefault(name, []).extend(values)
        if path.suffix == ".json":
            content = {"message": self.message, "calibration": UNCALIBRATED, "counts": counts.summary()}
            write_text(path, json.dumps(content | {"columns": columns}, allow_nan=False), overwrite=overwrite)
            return
        import pyarrow as pa
        import pyarrow.parquet as pq

        metadata = {b"calibration": UNCALIBRATED} | ({KEY: profile} if profile else {})
        with replacing(path, overwrite=overwrite, seeks=True) as temporary:
            pq.write_table(pa.table(columns).replace_schema_metadata(metadata), temporary)

    def _blocks(self) -> "Iterator[dict[str, list[Any]]]":
        """Columns by name with unit, block by block; None where a value is missing or not finite."""
        from plumbob.core import flags
        from plumbob.protocols.decode import format_title

        parts, self._parts = self._parts, []
        for frames in parts:
            rows = range(self._rows, self._rows + len(frames))
            self._rows = rows.stop
            columns: dict[str, list[Any]] = {TIME: [row / self.rate for row in rows]} if self.rate else {}
            columns["byte"] = frames.start.tolist()
            for each in (f for f in frames.message.fields if f.name in frames.columns):
                values = frames.columns[each.name].tolist()
                columns[format_title(each)] = [
                    None if isinstance(value, float) and not math.isfinite(value) else value for value in values
                ]
            for prefix, words in frames.flags.items():
                columns[f"{prefix}.flags".lstrip(".")] = ["+".join(flags.names(word)) for word in words.tolist()]
            yield columns


def profile_text(form: "Format", message: "Message", unit: str | None, time: str) -> str:
    """Profile of a decoded table whose time, s, is the column `time`; empty where there is no triad of a unit."""
    from plumbob.protocols.decode import format_title, prefix_by_unit

    units = prefix_by_unit(message)
    if not units:
        return ""
    unit = units[0] if unit is None else unit
    if unit not in units:
        raise unknown_name("unit", unit, units, of=message.name)
    titles = {field.name: format_title(field) for field in message.fields}
    titles |= {name: name for name in (f"{u}.flags".lstrip(".") for u in units)}
    prefix, what = (f"{unit}.", f"{message.name}, unit {unit}") if unit else ("", message.name)
    tables: dict[str, dict[str, Any]] = {}
    for triad in TRIADS:
        columns = [titles.get(f"{prefix}{triad}.{axis}", NO_COLUMN) for axis in "xyz"]
        if set(columns) != {NO_COLUMN}:
            tables[triad] = {"columns": columns, "unit": UNITS[triad]}
            tables[triad] |= {"sign": "specific-force"} if triad == "acc" else {}
    if f"{prefix}temp_c" in titles:
        tables["temperature"] = {"column": titles[f"{prefix}temp_c"], "unit": "degC"}
    if f"{prefix}flags" in titles:
        tables["flags"] = {"column": f"{prefix}flags", "words": True}
    top = {"separator": ",", "device": form.name, "unit_check": False}
    lines = [f"# Written by 'plumbob decode' for the table of the same name: {what}."]
    rate, device = form.framing.rate, "of the device; a lost frame makes all behind it early"
    hint = 'as in "100 Hz": the bytes do not say it, and decode --rate writes it here'
    clock = [f'rate = "?"  # frames per second, {hint}'] if rate is None else [f'rate = "{rate!r} Hz"  # {device}']
    clock = [f"column = {toml_text(time)}", 'unit = "s"'] if time else clock
    lines += [*toml_lines({"": top, "header": {"names": True}, "time": {}}), *clock]
    return "\n".join([*lines, *toml_lines(tables)]) + "\n"


def read_described(metadata: Mapping[bytes, bytes], file: Path) -> "Recording":
    """Recording of a Parquet table whose metadata carry its profile; errors as of `text.read_text`."""
    from plumbob.files.profile import parse_profile
    from plumbob.files.text import read_text

    profile = parse_profile(metadata[KEY].decode("utf-8", "replace"), origin="the profile in its metadata")
    return read_text(file, replace(profile, layout=replace(profile.layout, separator="\t")))
