"""A recording as flat named columns, and back: the one list of names, units and types that files share.

Times in text are dates and clock times by ISO 8601, ``2024-05-01T12:30:05.120+08:00``, as loggers write it: a blank for
the T, slashes for the hyphens, one digit for two, a comma or a colon before the fraction, AM and PM, a clock time
without a date. The year comes first, or the day where the month has a name or dots stand between them. Of dates that
could all be read in two ways, as 5/8/2024, only the clock time is used; one that cannot, as 5/13/2024, says it for all.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from functools import cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import ClockError, DecodeError, excerpt
from plumbob.core.time import to_ns, to_s
from plumbob.data import TRIADS, AttitudeTrack, ImuData
from plumbob.data.cards import UNITS
from plumbob.data.recording import Recording
from plumbob.files.column_names import TABLES
from plumbob.rotations import Frame, North

FORM: Final = "ISO 8601"
_DAY_NS: Final = 86_400 * 10**9
_EPOCH: Final = date(1970, 1, 1).toordinal()
_MONTHS: Final[Sequence[str]] = TABLES["stamps"]["months"]
_ZONES: Final[Mapping[str, int]] = TABLES["stamps"]["zones"]
_MONTH: Final = rf"(?:{'|'.join(_MONTHS)})[^\W\d]*\.?"
_DATE: Final = (
    rf"(?P<date>\d{{4}}([-/])\d{{1,2}}\2\d{{1,2}}|\d{{4}}-\d{{3}}|\d{{1,2}}\.\d{{1,2}}\.\d{{4}}|"
    rf"\d{{1,2}}\.?[- ]{_MONTH}[- ]\d{{4}}|\d{{1,2}}([-/])\d{{1,2}}\3(?:\d{{4}}|\d\d))"
)
_CLOCK: Final = (
    r"(?:(?P<hour>\d{1,4}):(?P<minute>\d\d):(?P<second>\d\d)(?:(?:[.,:]| (?=(?:\d{3}){1,2}$))(?P<fraction>\d+))?|"
    r"(?P<minutes>\d{1,4}):(?P<seconds>\d\d)[.,](?P<parts>\d+))(?: *(?P<half>[ap])m)?"
)
_ZONE: Final = rf"(?P<zone>{'|'.join(_ZONES)}|(?:UTC|GMT)?[+-]\d\d?(?::?\d\d)?)(?:\[[\w/]+\])?"
_STAMP: Final = re.compile(
    rf"(?:(?:{_DATE}|(?P<days>\d+) days?,?)(?:[T_-]| +))?{_CLOCK} *(?:{_ZONE}|(?-i:[A-Z]{{3,4}}))?", re.IGNORECASE
)
_FORMS: Final = [
    (re.compile(form.replace("MONTH", _MONTH), re.IGNORECASE), extended) for form, extended in TABLES["stamps"]["forms"]
]
_CLOCKLIKE: Final = re.compile(
    r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}([T ].*)?|.*\d{1,2}:\d\d:\d\d.*|\d+:\d\d[.,]\d+|\d{8}[T _-]\d{6}.*"
)


def is_clocklike(cell: str) -> bool:
    """Tell whether a cell is a date or a clock time in some form, readable here or not."""
    return _CLOCKLIKE.fullmatch(cell.strip()) is not None


def is_stamp(cell: str) -> bool:
    """Tell whether a cell is a clock time, with a date or without, that can be read here; a number is none."""
    return not is_time_of_day(cell) and _matched(cell) is not None


def is_time_of_day(cell: str) -> bool:
    """Tell whether a number may be a clock time as hhmmss.sss: its minutes and seconds are below 60."""
    return _FORMS[0][0].fullmatch(cell.strip()) is not None


def _matched(cell: str) -> re.Match[str] | None:
    """A cell taken apart as of the extended form, in which every other one can be written."""
    cell = cell.strip()
    for form, extended in _FORMS:
        if said := form.fullmatch(cell):
            cell = said.expand(extended)
    return _STAMP.fullmatch(cell)


def has_zone(cell: str) -> bool:
    """Tell whether a time that can be read here names its zone."""
    match = _matched(cell)
    return match is not None and match["zone"] is not None


def zone_ns(text: str) -> int:
    """What a zone is ahead of UTC, ns, from ``"UTC"``, ``"Z"`` or ``"+08:00"``; DecodeError for another text."""
    if not re.fullmatch(_ZONE, text.strip(), re.IGNORECASE):
        raise DecodeError(f"{excerpt(text)} is not a time zone; write 'UTC' or the offset from it, as '+08:00'.")
    return _ahead(text.strip())


class StampError(DecodeError):
    """A cell that cannot be read; `row` counts from 0."""

    def __init__(self, what: str, row: int = 0) -> None:
        super().__init__(what)
        self.row = row


def to_seconds(columns: Sequence[Sequence[str]], zone: int | None) -> tuple[Floats, int]:
    """Times, s, by columns of stamps or of dates and clock times, and the start, ns since 1970 (UTC); 0: unknown."""
    times, absolute = stamps_ns([" ".join(cells) for cells in zip(*columns, strict=True)], zone)
    return np.array([ns - times[0] for ns in times]) / 1e9, times[0] if absolute else 0


def stamps_ns(cells: Sequence[str], zone: int | None) -> tuple[list[int], bool]:
    """Time of each cell, ns, since 1970 (UTC) or since some midnight of the clock, and whether it is since 1970.

    `zone` is what the clock is ahead of UTC, ns, where cells do not say so. StampError if a cell is not a clock time,
    or some have a date or a zone and others do not.
    """
    times: list[int] = []
    first: tuple[bool, bool] | None = None
    # whether the day stands before the month in dates with slashes and four digits of year; None if both can be
    dates = {date for cell in cells for date in re.findall(r"^(\d+)[-/](\d+)[-/]\d{4}\b", cell)}
    orders = {int(first) > 12 for first, second in dates if int(first) > 12 or int(second) > 12}
    day_first = orders.pop() if len(orders) == 1 else None
    for row, cell in enumerate(cells):
        ns, has = _parsed(row, cell, day_first)
        first = first or has
        if has != first:
            raise StampError(f"{excerpt(cell)} has a date or a zone and the first time has none, or the reverse.", row)
        times.append(ns)
    dated, zoned = first or (False, False)
    if zoned and zone is not None:
        raise StampError(f"{excerpt(cells[0])} names its zone itself; remove time.zone.", 0)
    absolute = dated and (zoned or zone is not None)
    return [ns - (zone or 0) for ns in times], absolute


def _parsed(row: int, cell: str, day_first: bool | None) -> tuple[int, tuple[bool, bool]]:
    match = _matched(cell)
    if match is None:
        raise StampError(f"{excerpt(cell)} is not a time in the form of {FORM}, as 2024-05-01T12:30:05.120Z.", row)
    zone, fraction = match["zone"], match["fraction"] or match["parts"]
    try:
        days = _days(match["date"], day_first) if match["date"] else None
    except ValueError:
        raise StampError(f"{excerpt(cell)} names a day that does not exist.", row) from None
    hour, minute = divmod(int(match["minutes"]), 60) if match["minutes"] else map(int, match.group("hour", "minute"))
    second = int(match["second"] or match["seconds"])
    if (days is not None and hour > 23) or minute > 59 or second > 59 or (match["half"] and not 1 <= hour <= 12):
        raise StampError(f"{excerpt(cell)} names a time that does not exist.", row)
    if match["half"]:
        hour = hour % 12 + (12 if match["half"] in "pP" else 0)
    seconds = int(match["days"] or 0) * 86_400 + hour * 3600 + minute * 60 + second
    ns = (days or 0) * _DAY_NS + seconds * 10**9 + (int(f"{fraction:0<9.9}") if fraction else 0)
    return ns - (_ahead(zone) if zone else 0), (days is not None, zone is not None)


@cache
def _days(text: str, day_first: bool | None) -> int | None:
    """Days since 1970; None where the date is ambiguous."""
    parts = re.findall(r"[^\W_]+", text)
    if len(parts) == len(("year", "day of it")):
        return date(int(parts[0]), 1, 1).toordinal() + int(parts[1]) - 1 - _EPOCH
    if len(parts[0]) == len("1970"):
        parts.reverse()
    elif "." not in text and parts[1].isdigit():
        if day_first is None or len(parts[2]) < len("1970"):
            return None
        parts = parts if day_first else [parts[1], parts[0], parts[2]]
    day, month, year = parts
    if not month.isdigit():
        month = str(1 + next(i for i, names in enumerate(_MONTHS) if re.match(names, month, re.IGNORECASE)))
    return date(int(year), int(month), int(day)).toordinal() - _EPOCH


@cache
def _ahead(zone: str) -> int:
    if zone.upper() in _ZONES:
        return _ZONES[zone.upper()] * 3600 * 10**9
    sign, hours, minutes = re.findall(r"([-+])(\d\d?):?(\d\d)?", zone)[0]
    return int(f"{sign}1") * (int(hours) * 60 + int(minutes or 0)) * 60 * 10**9


Columns = dict[str, NDArray[Any]]


@dataclass(frozen=True, slots=True)
class ColumnFormat:
    """Unit and NumPy type of a column."""

    unit: str
    dtype: str = "float64"


TIME: Final = "t_ns"
GROUPS: Final[dict[str, tuple[str, ...]]] = {
    **{name: tuple(f"{name}_{axis}" for axis in "xyz") for name in TRIADS},
    "q": ("q_w", "q_x", "q_y", "q_z"),
    "bias": ("bias_x", "bias_y", "bias_z"),
    "cov": tuple(f"cov_{row}{column}" for row in "xyz" for column in "xyz"),
}
COLUMNS: Final[dict[str, ColumnFormat]] = {
    TIME: ColumnFormat("ns", "int64"),
    **{name: ColumnFormat(UNITS[triad]) for triad in TRIADS for name in GROUPS[triad]},
    "temp_c": ColumnFormat("degC"),
    "flags": ColumnFormat("1", "uint32"),
    **{name: ColumnFormat("1") for name in GROUPS["q"]},
    **{name: ColumnFormat(UNITS["gyr"]) for name in GROUPS["bias"]},
    **{name: ColumnFormat("rad2") for name in GROUPS["cov"]},
    "track_flags": ColumnFormat("1", "uint32"),
    "score": ColumnFormat("1", "bool"),
    "mag_weight": ColumnFormat("1"),
}


OF_UNIT: Final = (*(name for triad in TRIADS for name in GROUPS[triad]), "temp_c", "flags")
"""Columns of a sensor unit; of one of several, each has the unit's name and a dot before its own."""


def column(name: str) -> ColumnFormat:
    """What a column of this name is; DecodeError if there is none such."""
    unit, dot, base = name.rpartition(".")
    if base not in COLUMNS or (dot and not (unit and base in OF_UNIT)):
        raise DecodeError(f"the column {name} is unknown; known: {', '.join(COLUMNS)}.")
    return COLUMNS[base]


def of_unit(columns: Mapping[str, NDArray[Any]], unit: str) -> Columns:
    """Columns of one of several units by their own names, and the time."""
    names = {name.removeprefix(f"{unit}."): name for name in columns if name.rpartition(".")[0] == unit}
    return {TIME: columns[TIME]} | {base: columns[name] for base, name in names.items()}


def to_columns(recording: Recording) -> Columns:
    """Columns of a recording, in the order of `COLUMNS`; ClockError if imu and track have different time stamps."""
    imu, track = recording.imu, recording.track
    columns: Columns = {}
    if imu is not None:
        columns |= _imu_columns(replace(imu))
    for unit, samples in {} if recording.array is None else recording.array.units.items():
        part = _imu_columns(replace(samples[:]))
        columns |= {TIME: part[TIME]} | {f"{unit}.{col}": part[col] for col in COLUMNS if col in part and col != TIME}
    if track is not None:
        t_ns = to_ns(track.t)
        if TIME in columns and not np.array_equal(columns[TIME], t_ns):
            raise ClockError(
                f"imu and track must share their time stamps in one file, but imu has {columns[TIME].size} and track "
                f"{t_ns.size}, and they differ; write them in two files."
            )
        columns[TIME] = t_ns
        cov = None if track.cov_b is None else track.cov_b.reshape(-1, 9)
        for group, table in (("q", track.q_nb), ("bias", track.bias_b), ("cov", cov)):
            if table is not None:
                columns |= zip(GROUPS[group], np.ascontiguousarray(table.T), strict=True)
        single = {"track_flags": track.flags, "score": track.score, "mag_weight": track.mag_weight}
        columns |= {name: values for name, values in single.items() if values is not None}
    ordered = [name for name in columns if "." in name]
    return {name: columns[name] for name in (TIME, *ordered, *COLUMNS) if name in columns}


def require(names: Iterable[str], *, imu: bool, track: bool, units: Sequence[str] = ()) -> None:
    """Refuse column names that no recording with these parts or units has: missing, unknown, or of another part."""
    groups: dict[str, set[str]] = {"": set()}
    for name in names:
        unit, _, base = name.rpartition(".")
        groups.setdefault(unit, set()).add(base)
    if extra := sorted(set(groups) - {"", *units}):
        raise DecodeError(f"it has columns of the units {', '.join(extra)}, which its header does not name.")
    for unit, has_imu, has_track in (("", imu, track), *((unit, True, False) for unit in units)):
        present = groups.get(unit, set()) | ({TIME} if unit else set())
        of = f" of the unit {unit}" if unit else ""
        needed = {TIME} | ({"flags"} if has_imu else set()) | (set(GROUPS["q"]) if has_track else set())
        for group in GROUPS.values():
            needed |= set(group) if present & set(group) else set()
        allowed = {name for name in COLUMNS if name == TIME or (has_imu if name in OF_UNIT else has_track)}
        if missing := sorted(needed - present):
            raise DecodeError(f"the columns {', '.join(missing)}{of} are missing; write the recording again.")
        if extra := sorted(present - allowed):
            raise DecodeError(f"the columns {', '.join(extra)}{of} do not belong here; known: {', '.join(COLUMNS)}.")


def track_from(columns: Mapping[str, NDArray[Any]], frame: Frame, north: North, source: str) -> AttitudeTrack:
    """Attitude from its columns."""
    cov = joined(columns, "cov")
    return AttitudeTrack(
        t=to_s(columns[TIME]),
        q_nb=np.stack([columns[name] for name in GROUPS["q"]], axis=1),
        frame=frame,
        north=north,
        bias_b=joined(columns, "bias"),
        cov_b=None if cov is None else cov.reshape(-1, 3, 3),
        flags=columns.get("track_flags"),
        score=columns.get("score"),
        mag_weight=columns.get("mag_weight"),
        source=source,
    )


def _imu_columns(imu: ImuData) -> Columns:
    columns: Columns = {TIME: imu.t_ns, "flags": imu.flags}
    for name in imu.triads:
        columns |= zip(GROUPS[name], np.ascontiguousarray(getattr(imu, name).T), strict=True)
    if imu.temp_c is not None:
        columns["temp_c"] = imu.temp_c
    return columns


def joined(columns: Mapping[str, NDArray[Any]], group: str) -> Floats | None:
    """Table (N, …) of a group of columns; None where they are not there."""
    names = GROUPS[group]
    return np.stack([columns[name] for name in names], axis=1) if names[0] in columns else None
