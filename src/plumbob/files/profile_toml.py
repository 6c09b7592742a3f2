"""Read a profile from TOML, strictly: an unknown key, a missing unit or a wrong type is an error that says so."""

import codecs
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from plumbob.core import schema
from plumbob.core.docs import guide
from plumbob.core.errors import DecodeError, FrameError, PlumbobError, UnitError, excerpt
from plumbob.core.files import MAX_TEXT, existing_file, reading
from plumbob.core.schema import Parse
from plumbob.core.text import counted
from plumbob.core.units import Quantity
from plumbob.data import TRIADS, Range
from plumbob.files.columns import FORM, zone_ns
from plumbob.files.profile import (
    AS_MOUNTED,
    BLANK,
    ColumnRef,
    GroupSource,
    Profile,
    ReferenceSource,
    TextLayout,
    TimeColumn,
    TimeRate,
    TimeStamps,
)
from plumbob.rotations import Frame, North, body_axes, in_body_axes, signed_axes

_MIRRORED: Final = 'axes and mirrored = true in its own table, as in [mag] axes = "x y -z"'
GUIDE: Final = guide("file-formats.md")
VERSION: Final = 1

_EXAMPLE = {"gyr": "deg/s", "acc": "g", "mag": "uT", "temperature": "degC", "time": "s", "reference": "deg"}
_SEPARATORS = {name: name for name in (",", ";", " ", "\t", BLANK)} | {"tab": "\t", "\\t": "\t"}
_ORDERS = {"wxyz": 4, "xyzw": 4, "yaw pitch roll": 3}
_META = ("device", "axes", "frame", "north", "declination", "rate_nominal", "t0_ns", "calibration", "unit_check")
_INNER = {"bias": 3, "covariance": 9}
_NO_LAYOUT = TextLayout(separator=",")
_LAYOUT = ("separator", "decimal", "encoding", "comment", "missing", "rows")


def load_profile(path: str | Path) -> Profile:
    """Read a profile.

    Raises
    ------
    DecodeError
        If it is not TOML, or a key is unknown, missing or of the wrong type.
    UnitError
        If a unit is missing or unknown.
    FrameError
        If body axes, a navigation frame or a heading reference is missing or unknown.
    """
    file = existing_file(path, MAX_TEXT)
    with reading(file):
        try:
            text = file.read_bytes().decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise DecodeError(
                f"a profile is UTF-8 text, but byte {error.start + 1} cannot be decoded. Save it as UTF-8."
            ) from error
        return parse_profile(text, origin=file.name)


def parse_profile(text: str, *, origin: str = "profile") -> Profile:
    """Profile from TOML text; errors as in `load_profile`."""
    raw = schema.toml(text, GUIDE)
    if isinstance(raw.get("kind"), str):
        raise DecodeError(f"it is a {raw['kind']}, not a profile of a text file; give the profile with --profile.")
    _refuse_questions(raw)
    return _streams(raw, origin) if "stream" in raw else _profile(raw, origin)


def _streams(raw: Mapping[str, Any], origin: str) -> Profile:
    """Profile of sensors that have a file or rows of their own; what stands above them is true of all."""
    tables = raw["stream"]
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise DecodeError("stream must be a list of tables, as in [[stream]].")
    common = {key: value for key, value in raw.items() if key != "stream"}
    streams: list[tuple[str, Profile]] = []
    for number, table in enumerate(tables, 1):
        table_alone = {key: value for key, value in table.items() if key != "file"}
        profile = _profile(common | table_alone, origin)
        if any(set(profile.triads) & set(other.triads) for _, other in streams):
            raise DecodeError(f"stream {number} declares {', '.join(profile.triads)}, which another one does too.")
        streams.append((schema.text(f"stream[{number}].file", table.get("file", "*")), profile))
    return replace(streams[0][1], streams=tuple(streams))


def _profile(raw: Mapping[str, Any], origin: str) -> Profile:
    arrays = raw.get("arrays") is True
    needed = ("time",) if arrays else ("separator", "header", "time")
    table = _section("profile", _columns_of_arrays(raw) if arrays else raw, _PROFILE, needed)
    profile = Profile(
        layout=_NO_LAYOUT
        if arrays
        else TextLayout(**{key: table[key] for key in _LAYOUT if key in table}, **table["header"]),
        time=table["time"],
        triads={name: table[name] for name in TRIADS if name in table},
        temperature=table.get("temperature"),
        flags=table.get("flags", {}).get("column"),
        flag_words=table.get("flags", {}).get("words", False),
        reference=table.get("reference"),
        meta={key: table[key] for key in _META if key in table}
        | {f"{name}_range": _in_body(table[name], table) for name in TRIADS if name in table},
        notes=table.get("notes", ()),
        axes_applied=table.get("axes_applied", False),
        place=table.get("place"),
        date=table.get("date"),
        origin=origin,
        arrays=arrays,
    )
    _require_sense(profile)
    return profile


def _columns_of_arrays(raw: Mapping[str, Any]) -> dict[str, Any]:
    """The same with ``columns = "gyr"`` written out, which are all columns of an array, in their order."""
    if text := [key for key in (*_LAYOUT, "header") if key in raw]:
        raise DecodeError(f"arrays = true says that the file is not text; remove {', '.join(text)}.")

    def spelled(value: Any, count: int) -> Any:
        if not isinstance(value, dict) or not isinstance(value.get("columns"), str):
            return value
        return value | {"columns": [f"{value['columns'].strip()}[{k}]" for k in range(1, count + 1)]}

    changed = dict(raw) | {name: spelled(raw[name], 3) for name in TRIADS if name in raw}
    reference = raw.get("reference")
    if isinstance(reference, dict):
        inner = {key: spelled(reference[key], count) for key, count in _INNER.items() if key in reference}
        order = reference.get("order")
        changed["reference"] = spelled(reference | inner, _ORDERS.get(order, 4) if isinstance(order, str) else 4)
    return changed


def questions(raw: Mapping[str, Any], where: str = "") -> list[str]:
    """Keys whose value is still a question: a text that begins with ``?``, or a list that begins with one."""
    keys = []
    for key, value in raw.items():
        first = value[0] if isinstance(value, list) and value else value
        if isinstance(value, dict):
            keys += questions(value, f"{where}{key}.")
        elif isinstance(first, dict):
            keys += [question for item in value for question in questions(item, where)]
        elif isinstance(first, str) and first.lstrip().startswith("?"):
            keys.append(f"{where}{key}")
    return keys


def _refuse_questions(raw: Mapping[str, Any]) -> None:
    if open_ := questions(raw):
        raise DecodeError(
            f"{counted(len(open_), 'open question')}: {', '.join(open_)}. Open the file, and behind each '?' "
            "correct what is wrong and delete the '?'; a number or true loses its quotes."
        )


def _in_body(group: GroupSource, table: Mapping[str, Any]) -> Range:
    """Range of body axes, where that of three columns differs."""
    full_scale = group.full_scale
    if not isinstance(full_scale, tuple):
        return full_scale
    in_case = in_body_axes(group.axes, np.array(full_scale))
    axes = AS_MOUNTED if table.get("axes_applied") else table.get("axes", AS_MOUNTED)
    x, y, z = np.abs(in_body_axes(axes, in_case)).tolist()
    return x, y, z


def _require_sense(profile: Profile) -> None:
    layout, reference = profile.layout, profile.reference
    if layout.separator == layout.decimal:
        raise DecodeError(
            f"separator and decimal are both '{layout.decimal}', so cells cannot be separated. Change one of them."
        )
    if not profile.triads and reference is None:
        raise DecodeError("it declares no data; add at least one of [gyr], [acc], [mag] and [reference].")
    if not profile.triads and (profile.temperature is not None or profile.flags is not None):
        raise DecodeError("[temperature] and [flags] belong to a triad; add [gyr], [acc] or [mag].")
    absolute = 'time.epoch = "unix"' if isinstance(profile.time, TimeColumn) and profile.time.unix else ""
    absolute = f'time.format = "{FORM}"' if profile.stamps else absolute
    if absolute and "t0_ns" in profile.meta:
        raise DecodeError(f"{absolute} already says when the recording starts; remove t0_ns.")
    if profile.axes_applied and any(group.axes != AS_MOUNTED for group in profile.triads.values()):
        raise DecodeError("axes_applied = true says that the columns are in body axes; remove the axes of the sensors.")
    if reference is not None and reference.of is None and profile.turn is not None:
        raise FrameError(
            f"axes = '{profile.turn}' turns the sensor axes, so reference needs 'of': \"case\" if its attitude is the "
            "sensor case's, \"body\" if it is already the body's."
        )
    if profile.place is None and profile.date is not None:
        raise DecodeError("date is the day of a place, which is missing; add place, or leave date out.")
    if profile.place is not None and "declination" in profile.meta:
        raise DecodeError("place says the declination too; keep one of place and declination.")
    repeated = [ref for i, ref in enumerate(profile.used) if ref in profile.used[:i]]
    if repeated:
        raise DecodeError(f"column {excerpt(str(repeated[0]))} is declared twice; each column has one meaning.")


def _section(where: str, raw: Any, parsers: Mapping[str, Parse], required: tuple[str, ...] = ()) -> dict[str, Any]:
    return schema.section(where, raw, parsers, required, top=where == "profile", missing=_absent)


def _absent(where: str, key: str) -> PlumbobError:
    if key in {"unit", "angle_unit"}:
        example = "rad" if key == "angle_unit" else _EXAMPLE.get(where, "rad/s")
        return UnitError(f'{where} needs a unit, because a plain number has none. Add {key} = "{example}" or similar.')
    if key in {"frame", "north"}:
        words = ", ".join(Frame if key == "frame" else North)
        return FrameError(f"{where} needs '{key}', because there is no default; known are {words}.")
    return DecodeError(f"{where} needs the key '{key}', because nothing is guessed; {GUIDE} explains it.")


def _separator(where: str, value: Any) -> str:
    if not isinstance(value, str) or value not in _SEPARATORS:
        raise DecodeError(
            f"{where} must be one of ',', ';', 'tab', ' ' (runs of blanks) and '{BLANK}' (each one), but it is "
            f"{excerpt(str(value))}."
        )
    return _SEPARATORS[value]


def _encoding(where: str, value: Any) -> str:
    try:
        codecs.lookup(schema.text(where, value))
        "".encode(value)  # refuses Python's codecs that are no text encodings
    except (LookupError, ValueError) as error:
        raise DecodeError(
            f"{where} = {excerpt(value)} is not a text encoding; common ones are utf-8, gbk and latin-1."
        ) from error
    return str(value)


def _column(where: str, value: Any) -> ColumnRef:
    if isinstance(value, str) and value.strip():
        return value.strip()
    if isinstance(value, int) and not isinstance(value, bool) and value >= 1:
        return value
    raise DecodeError(f"{where} must be a column's name or its number from 1, but it is {excerpt(str(value))}.")


def _columns(*sizes: int) -> Parse:
    def parse(where: str, value: Any) -> tuple[ColumnRef, ...]:
        if not isinstance(value, list) or len(value) not in sizes:
            many = " or ".join(map(str, sizes))
            raise DecodeError(f"{where} must be a list of {many} columns, but it is {excerpt(str(value))}.")
        return tuple(_column(where, item) for item in value)

    return parse


def _axes(where: str, value: Any) -> str:
    try:
        body_axes(schema.text(where, value))
    except FrameError as error:
        raise FrameError(f"{where}: {error} One sensor whose own axes are left-handed: {_MIRRORED}.") from error
    return str(value)


def _own_axes(where: str, table: Mapping[str, Any]) -> str:
    """Axes of one sensor; a left-handed set is said twice, so that no slip of a sign makes one."""
    words = " ".join(table.get("axes", AS_MOUNTED).replace(",", " ").split())
    try:
        left_handed = np.linalg.det(signed_axes(words)) < 0.0
    except FrameError as error:
        raise FrameError(f"{where}.axes: {error}") from error
    if left_handed != table.get("mirrored", False):
        which = "left-handed; if the sensor's own axes are, say" if left_handed else "right-handed; remove"
        raise FrameError(f"{where}.axes = '{words}' are {which} {where}.mirrored = true.")
    return words


def _frame(where: str, value: Any) -> Frame:
    return Frame.parse(schema.text(where, value))


def _north(where: str, value: Any) -> North:
    return North.parse(schema.text(where, value))


def _where(where: str, value: Any) -> tuple[ColumnRef, str]:
    if not isinstance(value, list) or len(value) != 2 or not isinstance(value[1], str):
        raise DecodeError(
            f'{where} must be a column and a word, as in ["sensor", "gyro"], but it is {excerpt(str(value))}.'
        )
    return _column(where, value[0]), value[1].strip()


def _header(where: str, value: Any) -> dict[str, Any]:
    table = _section(where, value, _HEADER, ("names",))
    if "occurrence" in table and "marker" not in table:
        raise DecodeError(f"{where}.occurrence counts a marker, but none is declared; add {where}.marker.")
    if not table["names"] and "after_names" in table:
        raise DecodeError(f"{where}.after_names needs names = true; use {where}.skip instead.")
    return table


def _time(where: str, value: Any) -> TimeColumn | TimeStamps | TimeRate:
    table = _section(where, value, _TIME)
    if "format" in table:
        return _time_stamps(where, table)
    if alone := [key for key in ("columns", "zone") if key in table]:
        raise DecodeError(f'{where}.{alone[0]} is for dates and clock times; add {where}.format = "{FORM}".')
    if ("column" in table) == ("rate" in table):
        raise DecodeError(
            f'{where} needs either column and unit (or format = "{FORM}" for dates and clock times), '
            'or a declared rate such as rate = "100 Hz".'
        )
    if "rate" in table:
        if len(table) > 1:
            raise DecodeError(
                f"{where} has a rate, so it can have nothing else; remove {', '.join(set(table) - {'rate'})}."
            )
        return TimeRate(rate=table["rate"])
    if "unit" not in table:
        raise _absent(where, "unit")
    if "week" in table and "epoch" in table:
        raise DecodeError(f"{where} has both week and epoch; keep the one that says what the numbers count from.")
    return TimeColumn(
        table["column"], table["unit"], "epoch" in table, table.get("unit_per_count", 1.0), table.get("week")
    )


def _time_stamps(where: str, table: Mapping[str, Any]) -> TimeStamps:
    if other := [key for key in ("unit", "epoch", "rate") if key in table]:
        raise DecodeError(f"{where} has a format, so it can have no {' and no '.join(other)}; remove it.")
    if ("column" in table) == ("columns" in table):
        raise DecodeError(f"{where} needs column, or columns = [date, time] where these are two.")
    return TimeStamps(columns=table.get("columns") or (table["column"],), zone=table.get("zone"))


def _zone(where: str, value: Any) -> int:
    try:
        return zone_ns(schema.text(where, value))
    except DecodeError as error:
        raise DecodeError(f"{where}: {error}") from error


def _group(kind: Quantity, extra: Mapping[str, Parse], required: tuple[str, ...] = ()) -> Parse:
    parsers = {"columns": _columns(3), "unit": schema.unit_of(kind), **_COUNTS, **extra, **_MOUNT}

    def parse(where: str, value: Any) -> GroupSource:
        table = _section(where, value, parsers, ("columns", "unit", *required))
        return GroupSource(
            columns=table["columns"],
            unit=table["unit"],
            unit_per_count=_per_count(where, table),
            zero=_zero_counts(where, table),
            axes=_own_axes(where, table),
            gravity=table.get("sign") == "gravity",
            full_scale=table.get("range"),
            delay=table.get("delay", 0.0),
        )

    return parse


def _range(kind: Quantity) -> Parse:
    """One size with its unit, or one for each of three columns."""
    parse_size = schema.size(kind)

    def parse(where: str, value: Any) -> float | tuple[float, ...]:
        if not isinstance(value, list):
            return float(parse_size(where, value))
        if len(value) != 3:
            raise DecodeError(f"{where} must be one range, or three in a list, but it has {len(value)}.")
        return tuple(parse_size(f"{where}[{i}]", item) for i, item in enumerate(value))

    return parse


def _per_count(where: str, table: Mapping[str, Any]) -> float:
    if "counts_per_unit" in table and "unit_per_count" in table:
        raise DecodeError(f"{where} has both counts_per_unit and unit_per_count; keep the one from the data sheet.")
    return float(table.get("unit_per_count", 1.0 / table.get("counts_per_unit", 1.0)))


def _zero_counts(where: str, table: Mapping[str, Any]) -> tuple[float, ...] | None:
    zero: tuple[float, ...] | None = table.get("zero")
    if zero is not None and not {"counts_per_unit", "unit_per_count"} & set(table):
        raise DecodeError(f"{where}.zero is in counts; add {where}.counts_per_unit or {where}.unit_per_count.")
    return zero


def _three_or_one(where: str, value: Any) -> tuple[float, ...]:
    if isinstance(value, list) and len(value) == 3:
        return tuple(schema.number(f"{where}[{i}]", item) for i, item in enumerate(value, 1))
    return (schema.number(where, value),) * 3


def _scale(where: str, value: Any) -> float:
    factor = schema.number(where, value)
    if factor == 0.0:
        raise DecodeError(f"{where} must not be 0; a negative number turns the sign.")
    return factor


def _temperature(where: str, value: Any) -> GroupSource:
    table = _section(
        where, value, {"column": _column, "unit": schema.unit_of(Quantity.TEMPERATURE)}, ("column", "unit")
    )
    return GroupSource(columns=(table["column"],), unit=table["unit"])


def _flags(where: str, value: Any) -> dict[str, Any]:
    return _section(where, value, {"column": _column, "words": schema.truth}, ("column",))


def _covariance(where: str, value: Any) -> GroupSource:
    parsers = {"columns": _columns(9), "angle_unit": schema.unit_of(Quantity.ANGLE)}
    table = _section(where, value, parsers, ("columns", "angle_unit"))
    return GroupSource(columns=table["columns"], unit=table["angle_unit"])


def _reference(where: str, value: Any) -> ReferenceSource:
    table = _section(where, value, _REFERENCE, ("columns", "order", "frame", "north"))
    size = _ORDERS[table["order"]]
    if len(table["columns"]) != size:
        raise DecodeError(f"{where}.order = '{table['order']}' needs {size} columns, but {len(table['columns'])} came.")
    if (size == 3) != ("unit" in table):
        if size == 3:
            raise _absent(where, "unit")
        raise DecodeError(f"{where}.unit is for angles, but a quaternion has none; remove it.")
    return ReferenceSource(**table)


_COUNTS: Final[dict[str, Parse]] = {
    "counts_per_unit": _scale,
    "unit_per_count": _scale,
    "zero": _three_or_one,
}
_MOUNT: Final[dict[str, Parse]] = {
    "axes": schema.text,
    "mirrored": schema.truth,
    "delay": schema.quantity(Quantity.TIME),
}
_HEADER: Final[dict[str, Parse]] = {
    "marker": schema.text,
    "occurrence": schema.whole(1),
    "skip": schema.whole(0),
    "names": schema.truth,
    "after_names": schema.whole(0),
    "mark": schema.text,
    "labels": schema.text,
    "prefix": schema.text,
    "where": _where,
}
_TIME: Final[dict[str, Parse]] = {
    "column": _column,
    "unit": schema.unit_of(Quantity.TIME),
    "unit_per_count": _scale,
    "week": _column,
    "epoch": schema.one_of("unix"),
    "rate": schema.size(Quantity.FREQUENCY),
    "format": schema.one_of(FORM),
    "columns": _columns(2),
    "zone": _zone,
}
_REFERENCE: Final[dict[str, Parse]] = {
    "columns": _columns(3, 4),
    "order": schema.one_of(*_ORDERS),
    "unit": schema.unit_of(Quantity.ANGLE),
    "frame": _frame,
    "north": _north,
    "of": schema.one_of("body", "case"),
    "source": schema.text,
    "score": _column,
    "flags": _column,
    "mag_weight": _column,
    "bias": _group(Quantity.RATE, {}),
    "covariance": _covariance,
}
_PROFILE: Final[dict[str, Parse]] = {
    "format_version": schema.version(VERSION),
    "separator": _separator,
    "decimal": schema.one_of(".", ","),
    "encoding": _encoding,
    "comment": schema.text,
    "missing": schema.texts,
    "rows": schema.whole(1),
    "arrays": schema.truth,
    "header": _header,
    "time": _time,
    "gyr": _group(Quantity.RATE, {"range": _range(Quantity.RATE)}),
    "acc": _group(
        Quantity.ACCELERATION,
        {"range": _range(Quantity.ACCELERATION), "sign": schema.one_of("specific-force", "gravity")},
        ("sign",),
    ),
    "mag": _group(Quantity.FIELD, {"range": _range(Quantity.FIELD)}),
    "temperature": _temperature,
    "flags": _flags,
    "reference": _reference,
    "device": schema.text,
    "axes": _axes,
    "axes_applied": schema.truth,
    "frame": _frame,
    "north": _north,
    "declination": schema.quantity(Quantity.ANGLE),
    "place": schema.text,
    "date": schema.text,
    "rate_nominal": schema.size(Quantity.FREQUENCY),
    "t0_ns": schema.whole(None),
    "calibration": schema.text,
    "unit_check": schema.truth,
    "notes": schema.texts,
}
