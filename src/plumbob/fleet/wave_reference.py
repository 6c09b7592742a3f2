"""Tables of other wave buoys, to compare with: Spotter, OpenMetBuoy, SFY, NDBC, or a table of `plumbob.waves` itself.

One reader by names: a column is what `COLUMNS` or its CF standard name says, whatever wrote it. Spotter's mean period
is Tm01 (m0/m1), NDBC's average period Tm02, and its MWD the direction at the dominant period.
"""

import csv
import json
import math
import re
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import numpy as np

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError
from plumbob.core.files import existing_file
from plumbob.core.series import needed
from plumbob.core.units import Quantity, to_deg, to_si
from plumbob.files.arrow import intact, text_bytes

COLUMNS: Final[Mapping[str, tuple[str, ...]]] = {  # names without blanks and signs, the best first
    "hm0_m": ("hm0", "phs0", "processedhs", "hs", "hsig", "hs0", "wvht", "vhm0", "significantwaveheight"),
    "tp_s": ("tp", "dpd", "peakperiod", "peakwaveperiod"),
    "tm01_s": ("tm01", "meanperiod", "tm"),
    "tm02_s": ("tm02", "pt02", "processedtz", "tz", "t02", "apd"),
    "tm_10_s": ("tm10", "te", "energyperiod"),
    "direction_deg": ("direction", "meandirection", "dm"),
    "spread_deg": ("spread", "meandirectionalspread", "meanspreading", "dmspr"),
    "peak_direction_deg": ("peakdirection", "dp", "mwd"),
    "peak_spread_deg": ("peakspread", "peakdirectionalspread", "peakspreading", "dpspr"),
}
_TIMES: Final = ("timewavesimu", "timeutc", "epochtime", "timestamp", "datetimefix", "datetime", "time")
_PARTS: Final = (("YY", "YYYY", "year"), ("MM", "month"), ("DD", "day"), ("hh", "hour"), ("mm", "min", "minute"))
_QUANTITIES: Final = {"m": Quantity.LENGTH, "s": Quantity.TIME}
_BEYOND: Final = {"m": 99.0, "s": 99.0, "deg": 361.0}  # 99, 999 and -9999 stand for what is missing; no wave is so high
_MILLISECONDS: Final = 1e11  # as seconds, a time behind the year 5000

Table = dict[str, tuple[str, list[Any]]]  # unit and cells by name


def read_reference(path: str | Path, standard_names: Mapping[str, str]) -> tuple[Floats, dict[str, Floats]]:
    """Times (N,), s since 1970 UTC, and numbers (N,) of a buoy's table by the names that `Waves.bursts` have.

    `standard_names` gives those names by CF standard names.

    Raises
    ------
    DecodeError
        If there is no table of waves with their times in the file, or it is cut or damaged.
    UnitError
        If a column's unit is not one of its quantity.
    MissingExtraError
        If it is NetCDF and xarray is not installed.
    """
    file = existing_file(check.path("reference", path))
    with intact(str(file)):
        if file.suffix.lower() in (".nc", ".nc4"):
            table = _of_netcdf(file, standard_names)
        else:
            text = text_bytes(file).decode("utf-8", "replace")
            table = _of_json(json.loads(text)) if text.lstrip()[:1] in ("{", "[") else _of_text(text)
    plain = {re.sub(r"[^a-z0-9]", "", name.lower()): column for name, column in table.items()}
    numbers = {}
    for name, aliases in COLUMNS.items():
        column = next((plain[alias] for alias in (name.replace("_", ""), *aliases) if alias in plain), None)
        if column is not None:
            numbers[name] = _numbers(*column, name.rpartition("_")[2])
    time = _time(table, plain)
    if time is None or not numbers:
        raise DecodeError(
            f"{file} has no table of waves with their UTC: it has {', '.join(list(table)[:12]) or 'no columns'}. Name "
            "columns as Spotter, OpenMetBuoy or NDBC do: time, Hs, Tp, Tz."
        )
    dated = np.isfinite(time)
    return time[dated], {name: values[dated] for name, values in numbers.items()}


def nearest(times: Floats, numbers: Mapping[str, Floats], middles: Floats, within: Floats) -> dict[str, Floats]:
    """Numbers (B,) nearest in time to the middles of bursts (B,), NaN where none is so near."""
    apart = np.abs(middles[:, np.newaxis] - times)
    at = np.argmin(apart, axis=1)
    near = apart[np.arange(at.size), at] <= within
    return {name: np.where(near, values[at], math.nan) for name, values in numbers.items()}


def _of_text(text: str) -> Table:
    """Columns of a table with commas, semicolons, tabs or blanks, whose second line may be units, as NDBC's is."""
    lines = [line for line in text.splitlines() if line.strip(" \t,;")]
    if not lines:
        return {}
    sign = next((sign for sign in ",;\t" if sign in lines[0]), None)
    rows = [
        [cell.strip() for cell in row] for row in (csv.reader(lines, delimiter=sign) if sign else map(str.split, lines))
    ]
    names, body = [re.fullmatch(r"#?\s*(.*?)\s*(?:[\[(](.*)[\])])?", cell) for cell in rows[0]], rows[1:]
    units = [match[2] or "" for match in names if match]
    if body and body[0][0].startswith("#"):
        units = [cell.lstrip("# ") for cell in body.pop(0)]
    full_rows = [row for row in body if len(row) == len(names)]
    columns = zip(*full_rows, strict=True) if full_rows else [()] * len(names)
    return {match[1]: (unit, list(cells)) for match, unit, cells in zip(names, units, columns, strict=False) if match}


def _of_json(content: Any) -> Table:
    """Columns of the largest list of like objects, at whatever depth."""
    rows = max(_lists(content), key=len, default=[])
    return {name: ("", [row.get(name) for row in rows]) for name in (rows[0] if rows else ())}


def _lists(content: Any) -> Iterator[list[dict[str, Any]]]:
    if isinstance(content, list) and content and all(isinstance(row, dict) for row in content):
        yield content
    parts = content.values() if isinstance(content, dict) else content if isinstance(content, list) else ()
    for part in parts:
        yield from _lists(part)


def _of_netcdf(file: Path, standard_names: Mapping[str, str]) -> Table:
    xarray = needed("xarray", "tables of buoys in NetCDF", "plumbob[netcdf]")
    with xarray.open_dataset(file) as data:
        times = [
            name
            for name in map(str, data.variables)
            if re.sub(r"[^a-z0-9]", "", name.lower()) in ("time", "timewavesimu")
        ]
        if not times:
            return {}
        axis = data[max(times, key=len)]
        if axis.squeeze().ndim > 1:
            raise DecodeError(f"{file} holds {axis.shape[0]} buoys; write one of them into a file of its own.")
        like = {name: data[name] for name in map(str, data.variables) if data[name].dims == axis.dims}
        seconds = axis.values.ravel().astype("datetime64[ns]")
        table: Table = {"time": ("", [None if np.isnat(t) else t.astype(np.int64) / 1e9 for t in seconds])}
        for name, array in like.items():
            if name == axis.name or array.dtype.kind not in "fiu":
                continue
            title = standard_names.get(array.attrs.get("standard_name", ""), name)
            table[title] = (str(array.attrs.get("units", "")), array.values.ravel().tolist())
        return table


def _numbers(unit: str, cells: list[Any], kind: str) -> Floats:
    """Numbers in the unit of their kind, NaN where they are missing."""
    values = np.array([_number(cell) for cell in cells])
    if kind in _QUANTITIES:
        values = to_si(values, unit or kind, _QUANTITIES[kind])
    elif not unit.lower().startswith(("deg", "°")) and unit:
        values = to_deg(to_si(values, unit, Quantity.ANGLE))
    return np.where((values >= 0.0) & (values < _BEYOND[kind]), values, math.nan)


def _number(cell: Any) -> float:
    try:
        return float(cell)
    except (TypeError, ValueError):
        return math.nan


def _time(table: Table, plain: Table) -> Floats | None:
    """UTC (N,), s since 1970, of one column or of the parts of a date; None without."""
    parts = [next((table[name][1] for name in names if name in table), []) for names in _PARTS]
    if all(parts[:4]):
        minutes = parts[4] or ["0"] * len(parts[3])
        return np.array([_of_parts(row) for row in zip(*parts[:4], minutes, strict=True)], dtype=np.float64)
    name = next((name for name in _TIMES if name in plain), None)
    return None if name is None else np.array([_seconds(cell) for cell in plain[name][1]], dtype=np.float64)


def _of_parts(row: tuple[Any, ...]) -> float:
    try:
        year, month, day, hour, minute = map(int, row)
        since = year + (1900 if year < 100 else 0)  # NDBC until 1998
        return datetime(since, month, day, hour, minute, tzinfo=UTC).timestamp()
    except ValueError:
        return math.nan


def _seconds(cell: Any) -> float:
    if math.isfinite(number := _number(cell)):
        return number / 1e3 if number > _MILLISECONDS else number
    try:
        moment = datetime.fromisoformat(str(cell))
    except ValueError:
        return math.nan
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
