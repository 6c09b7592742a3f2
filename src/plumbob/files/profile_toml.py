"""Read a profile from TOML, strictly: an unknown key, a missing unit or a wrong type is an error that says so."""

import tomllib
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from plumbob.core import schema
from plumbob.core.errors import DecodeError, FrameError, PlumbobError, UnitError, excerpt
from plumbob.core.files import reading, sidecars, text_of
from plumbob.core.findings import note
from plumbob.core.resources import guide
from plumbob.core.schema import Parse
from plumbob.core.text import counted
from plumbob.core.units import Quantity
from plumbob.data import TRIADS, ImuMeta, Range
from plumbob.files.columns import FORM, zone_ns
from plumbob.files.profile import (
    AS_MOUNTED,
    COLUMN,
    ORDERS,
    GroupSource,
    Profile,
    ReferenceSource,
    TextLayout,
    TimeColumn,
    TimeRate,
    TimeStamps,
    columns,
)
from plumbob.rotations import Frame, North, body_axes, in_body_axes, signed_axes

_MIRRORED: Final = 'axes and mirrored = true in its own table, as in [mag] axes = "x y -z"'
GUIDE: Final = guide("file-formats.md")
VERSION: Final = 1
_MARKS: Final = {"separator", "arrays", "stream", "header"}
"""Keys of which a profile has one, and what lies beside a recording and is none has not."""

_EXAMPLE = {"gyr": "deg/s", "acc": "g", "mag": "uT", "temperature": "degC", "time": "s", "reference": "deg"}
_META = schema.keys(ImuMeta, *(f"{name}_range" for name in TRIADS))
"""Parsers of what a profile says of the samples as `ImuMeta` has it."""
_INNER = {"bias": 3, "covariance": 9}
_NO_LAYOUT = TextLayout(separator=",")
_LAYOUT = ("separator", "decimal", "thousands", "encoding", "comment", "missing", "rows", "cells")


def load_profile(path: str | Path) -> Profile:
    """Read a profile.

    DecodeError if it is not TOML, or a key is unknown, missing or of the wrong type; UnitError or FrameError if a unit,
    body axes, a frame or a heading reference is.
    """
    text = text_of(path, "profile")
    with reading(Path(path)):
        return parse_profile(text, origin=Path(path).name)


def profiles_beside(file: Path) -> list[Path]:
    """Profiles that lie beside a file under its name; a TOML of another kind, as a chain or a format, is none."""
    return [path for path in sidecars(file) if path.is_file() and _is_profile(path)]


def _is_profile(path: Path) -> bool:
    """Whether a TOML is meant as a profile; one that cannot be read is, so that its fault is said."""
    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (ValueError, OSError):
        return True
    return not isinstance(raw.get("kind"), str) and bool(_MARKS & set(raw))


def parse_profile(text: str, *, origin: str = "profile") -> Profile:
    """Profile from TOML text; errors as in `load_profile`."""
    profile: Profile = schema.document(text, GUIDE, lambda _, raw: _streams(raw, origin))
    return profile


def _streams(raw: Mapping[str, Any], origin: str) -> Profile:
    """Profile of sensors that have a file or rows of their own; what stands above them is true of all."""
    if "stream" not in raw:
        return _profile(raw, origin)
    common = {key: value for key, value in raw.items() if key != "stream"}
    streams: list[tuple[str, Profile]] = []
    for number, table in enumerate(_STREAMS("stream", raw["stream"]), 1):
        profile = _profile(common | {key: value for key, value in table.items() if key != "file"}, origin)
        if any(set(profile.triads) & set(other.triads) for _, other in streams):
            raise DecodeError(f"stream {number} declares {', '.join(profile.triads)}, which another one does too.")
        streams.append((schema.text(f"stream[{number}].file", table.get("file", "*")), profile))
    return replace(streams[0][1], streams=tuple(streams))


def _profile(raw: Mapping[str, Any], origin: str) -> Profile:
    if isinstance(raw.get("kind"), str):
        raise DecodeError(f"it is a {raw['kind']}, not a profile of a text file; give the profile with --profile.")
    _refuse_questions(raw)
    arrays = raw.get("arrays") is True
    table = PROFILE("", _columns_of_arrays(raw)) if arrays else _TEXT_PROFILE("", raw)
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
        return value | {"columns": [f"{value['columns'].strip()}[{k} of {count}]" for k in range(1, count + 1)]}

    changed = dict(raw) | {name: spelled(raw[name], 3) for name in TRIADS if name in raw}
    reference = raw.get("reference")
    if isinstance(reference, dict):
        inner = {key: spelled(reference[key], count) for key, count in _INNER.items() if key in reference}
        order = reference.get("order")
        changed["reference"] = spelled(reference | inner, ORDERS.get(order, 4) if isinstance(order, str) else 4)
    return changed


def questions(raw: Mapping[str, Any], where: str = "") -> list[str]:
    """Keys whose value is still a question: a text that begins with ``?``, or a list that begins with one."""
    keys = []
    for key, value in raw.items():
        first = value[0] if isinstance(value, list) and value else value
        if key == "notes":
            continue
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
        raise DecodeError("place already gives the declination; keep one of the two.")
    repeated = [ref for i, ref in enumerate(profile.used) if ref in profile.used[:i]]
    if repeated:
        raise DecodeError(f"column {excerpt(str(repeated[0]))} is declared twice; declare it once.")


def _absent(where: str, key: str) -> PlumbobError:
    if key in {"unit", "angle_unit"}:
        example = "rad" if key == "angle_unit" else _EXAMPLE.get(where, "rad/s")
        return UnitError(f'{where} needs a unit, because a plain number has none. Add {key} = "{example}" or similar.')
    if key in {"frame", "north"}:
        words = ", ".join(Frame if key == "frame" else North)
        return FrameError(f"{where} needs '{key}', because there is no default; known: {words}.")
    return DecodeError(f"{where} needs the key '{key}', because nothing is guessed; {GUIDE} explains it.")


def _axes(words: str) -> str:
    try:
        body_axes(words)
    except FrameError as error:
        raise FrameError(f"{error} One sensor whose own axes are left-handed: {_MIRRORED}.") from error
    return words


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


def _header(where: str, table: dict[str, Any]) -> dict[str, Any]:
    if "occurrence" in table and "marker" not in table:
        raise DecodeError(f"{where}.occurrence counts a marker, but none is declared; add {where}.marker.")
    if not table["names"] and "after_names" in table:
        raise DecodeError(f"{where}.after_names needs names = true; use {where}.skip instead.")
    return table


def _time(where: str, table: dict[str, Any]) -> TimeColumn | TimeStamps | TimeRate:
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
    if "week" in table and {"epoch", "seconds"} & set(table):
        raise DecodeError(f"{where} has week, so it can have no epoch and no seconds; remove them, or week.")
    larger = (table.get("week"), table.get("seconds"))
    return TimeColumn(table["column"], table["unit"], "epoch" in table, table.get("unit_per_count", 1.0), *larger)


def _time_stamps(where: str, table: Mapping[str, Any]) -> TimeStamps:
    if other := [key for key in ("unit", "epoch", "rate", "seconds") if key in table]:
        raise DecodeError(f"{where} has a format, so it can have no {' and no '.join(other)}; remove it.")
    if ("column" in table) == ("columns" in table):
        raise DecodeError(f"{where} needs column, or columns = [date, time] where these are two.")
    return TimeStamps(columns=table.get("columns") or (table["column"],), zone=table.get("zone"))


def _group(kind: Quantity, extra: Mapping[str, Parse] = MappingProxyType({}), required: tuple[str, ...] = ()) -> Parse:
    keys = {"columns": columns(3), "unit": schema.unit_of(kind), **_COUNTS, **extra, **_MOUNT}
    return _form(keys, ("columns", "unit", *required), _group_source)


def _group_source(where: str, table: dict[str, Any]) -> GroupSource:
    return GroupSource(
        columns=table["columns"],
        unit=table["unit"],
        unit_per_count=_per_count(where, table),
        zero=_zero_counts(where, table),
        axes=_own_axes(where, table),
        gravity=table.get("sign") == "gravity",
        full_scale=table.get("range"),
        delay=table.get("delay", 0.0),
        plus=table.get("plus", ()),
    )


def _per_count(where: str, table: Mapping[str, Any]) -> float:
    if "counts_per_unit" in table and "unit_per_count" in table:
        raise DecodeError(f"{where} has both counts_per_unit and unit_per_count; keep the one from the data sheet.")
    return float(table.get("unit_per_count", 1.0 / table.get("counts_per_unit", 1.0)))


def _zero_counts(where: str, table: Mapping[str, Any]) -> tuple[float, ...] | None:
    zero: tuple[float, ...] | None = table.get("zero")
    if zero is not None and not {"counts_per_unit", "unit_per_count"} & set(table):
        raise DecodeError(f"{where}.zero is in counts; add {where}.counts_per_unit or {where}.unit_per_count.")
    return zero


def _reference(where: str, table: dict[str, Any]) -> ReferenceSource:
    size = ORDERS[table["order"]]
    if len(table["columns"]) != size:
        raise DecodeError(f"{where}.order = '{table['order']}' needs {size} columns, but has {len(table['columns'])}.")
    if (size == 3) != ("unit" in table):
        if size == 3:
            raise _absent(where, "unit")
        raise DecodeError(f"{where}.unit is for angles, but a quaternion has none; remove it.")
    return ReferenceSource(**table)


def _range(kind: Quantity) -> dict[str, Parse]:
    """One size with its unit, or one for each of three columns."""
    return {"range": schema.either(list, schema.listed(schema.size(kind), 3, of="ranges, or one"), schema.size(kind))}


_form: Final = partial(schema.form, missing=_absent)
_FRAME: Final = schema.converted(Frame.parse)
_NORTH: Final = schema.converted(North.parse)
_COUNTS: Final = {
    "counts_per_unit": schema.nonzero,
    "unit_per_count": schema.nonzero,
    "zero": schema.either(
        list,
        schema.listed(schema.number, 3, of="numbers, or one"),
        schema.converted(lambda zero: (zero,) * 3, schema.number),
    ),
}
_MOUNT: Final = {"axes": schema.text, "mirrored": schema.truth, "delay": schema.quantity(Quantity.TIME)}
_TEXT: Final = schema.keys(TextLayout)
_HEADER: Final = _form({key: parse for key, parse in _TEXT.items() if key not in _LAYOUT}, ("names",), _header)
_TIME: Final = _form(
    {
        "column": COLUMN,
        "unit": schema.unit_of(Quantity.TIME),
        "unit_per_count": schema.nonzero,
        "week": COLUMN,
        "seconds": COLUMN,
        "epoch": schema.one_of("unix"),
        "rate": schema.size(Quantity.FREQUENCY),
        "format": schema.one_of(FORM),
        "columns": columns(2),
        "zone": schema.converted(zone_ns),
    },
    (),
    _time,
)
_COVARIANCE: Final = _form(
    {"columns": columns(9), "angle_unit": schema.unit_of(Quantity.ANGLE)},
    ("columns", "angle_unit"),
    lambda _, table: GroupSource(columns=table["columns"], unit=table["angle_unit"]),
)
_REFERENCE: Final = schema.table(
    ReferenceSource, _reference, missing=_absent, bias=_group(Quantity.RATE), covariance=_COVARIANCE
)
_TEMPERATURE: Final = _form(
    {"column": COLUMN, "unit": schema.unit_of(Quantity.TEMPERATURE)},
    ("column", "unit"),
    lambda _, table: GroupSource(columns=(table["column"],), unit=table["unit"]),
)
_SIGN: Final = {"sign": schema.one_of("specific-force", "gravity"), "plus": columns(3)}
_KEYS: Final = {
    "format_version": schema.version(VERSION),
    **{key: _TEXT[key] for key in _LAYOUT},
    "arrays": schema.truth,
    "header": _HEADER,
    "time": _TIME,
    "gyr": _group(Quantity.RATE, _range(Quantity.RATE)),
    "acc": _group(Quantity.ACCELERATION, _range(Quantity.ACCELERATION) | _SIGN, ("sign",)),
    "mag": _group(Quantity.FIELD, _range(Quantity.FIELD)),
    "temperature": _TEMPERATURE,
    "flags": _form({"column": COLUMN, "words": schema.truth}, ("column",)),
    "reference": _REFERENCE,
    **_META,
    "axes": schema.converted(_axes),
    "axes_applied": schema.truth,
    "frame": _FRAME,
    "north": _NORTH,
    "declination": schema.quantity(Quantity.ANGLE),
    "place": schema.text,
    "date": schema.text,
    "rate_nominal": schema.size(Quantity.FREQUENCY),
    "t0_ns": schema.whole(None),
    "notes": schema.listed(note, of="texts"),
}
_TEXT_PROFILE: Final = _form(_KEYS, ("separator", "header", "time"), name="profile")
_STREAMS: Final = schema.tables(schema.mapping(schema.anything))
PROFILE: Final = _form(_KEYS, ("time",), name="profile")
"""Parser of the outermost table of a profile of arrays, and what JSON Schema says of any profile."""
