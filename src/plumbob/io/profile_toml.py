"""Read a profile from TOML, strictly: an unknown key, a missing unit or a wrong type is an error that says so."""

import codecs
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from plumbob import forms
from plumbob._files import MAX_TEXT, existing_file, reading
from plumbob.data import TRIADS, Range
from plumbob.errors import DecodeError, FrameError, PlumbobError, UnitError, excerpt, guide
from plumbob.forms import Parse
from plumbob.io.profile import ColumnRef, GroupSource, Layout, Profile, ReferenceSource, TimeColumn, TimeRate
from plumbob.rotations import Frame, North, body_axes, in_body_axes
from plumbob.units import Quantity

GUIDE: Final = guide("file-formats.md")
VERSION: Final = 1

_EXAMPLE = {"gyr": "deg/s", "acc": "g", "mag": "uT", "temperature": "degC", "time": "s", "reference": "deg"}
_SEPARATORS = {",": ",", ";": ";", "tab": "\t", "\t": "\t", "\\t": "\t", " ": " "}  # TOML's '\t' is two characters
_ORDERS = {"wxyz": 4, "xyzw": 4, "yaw pitch roll": 3}
_META = ("device", "axes", "frame", "north", "declination", "rate_nominal", "t0_ns", "calibration", "unit_check")
_LAYOUT = ("separator", "decimal", "encoding", "comment", "missing", "rows")


def load_profile(path: str | Path) -> Profile:
    """Read a profile.

    Raises
    ------
    DecodeError
        If it is no TOML, or a key is unknown, missing or of the wrong type.
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
            raise DecodeError(f"a profile is UTF-8 text, but byte {error.start + 1} is not; save it so.") from error
        return parse_profile(text, origin=file.name)


def parse_profile(text: str, *, origin: str = "profile") -> Profile:
    """Profile from TOML text; errors as in `load_profile`."""
    raw = forms.toml(text, GUIDE)
    if isinstance(raw.get("kind"), str):
        raise DecodeError(f"it is a {raw['kind']}, not a profile of a text file; give the profile with --profile.")
    found = _section("profile", raw, _PROFILE, ("separator", "header", "time"))
    profile = Profile(
        layout=Layout(**{key: found[key] for key in _LAYOUT if key in found}, **found["header"]),
        time=found["time"],
        triads={name: found[name] for name in TRIADS if name in found},
        temperature=found.get("temperature"),
        flags=found.get("flags"),
        reference=found.get("reference"),
        meta={key: found[key] for key in _META if key in found}
        | {f"{name}_range": _in_body(found[name].full_scale, found) for name in TRIADS if name in found},
        notes=found.get("notes", ()),
        axes_applied=found.get("axes_applied", False),
        origin=origin,
    )
    _require_sense(profile)
    return profile


def _in_body(told: Range, found: Mapping[str, Any]) -> Range:
    """Range of body axes, where that of three columns differs."""
    if not isinstance(told, tuple) or found.get("axes_applied"):
        return told
    x, y, z = np.abs(in_body_axes(found.get("axes", "x y z"), np.array(told))).tolist()
    return x, y, z


def _require_sense(profile: Profile) -> None:
    layout, reference = profile.layout, profile.reference
    if layout.separator == layout.decimal:
        raise DecodeError(f"separator and decimal are both '{layout.decimal}', so cells cannot be told apart.")
    if not profile.triads and reference is None:
        raise DecodeError("it declares no data; add at least one of [gyr], [acc], [mag] and [reference].")
    if not profile.triads and (profile.temperature is not None or profile.flags is not None):
        raise DecodeError("[temperature] and [flags] belong to a triad; add [gyr], [acc] or [mag].")
    if isinstance(profile.time, TimeColumn) and profile.time.unix and "t0_ns" in profile.meta:
        raise DecodeError('time.epoch = "unix" already says when the recording starts; remove t0_ns.')
    if reference is not None and reference.of is None and profile.turn is not None:
        raise FrameError(
            f"axes = '{profile.turn}' turns the sensor axes, so reference needs 'of': \"case\" if its attitude is the "
            "sensor case's, \"body\" if it is already the body's."
        )
    repeated = [ref for i, ref in enumerate(profile.used) if ref in profile.used[:i]]
    if repeated:
        raise DecodeError(f"column {excerpt(str(repeated[0]))} is declared twice; each column has one meaning.")


def _section(where: str, raw: Any, known: Mapping[str, Parse], required: tuple[str, ...] = ()) -> dict[str, Any]:
    return forms.section(where, raw, known, required, top=where == "profile", missing=_absent)


def _absent(where: str, key: str) -> PlumbobError:
    if key in {"unit", "angle_unit"}:
        example = "rad" if key == "angle_unit" else _EXAMPLE.get(where, "rad/s")
        return UnitError(f'{where} needs its unit, because a bare number has none; add {key} = "{example}" or such.')
    if key in {"frame", "north"}:
        words = ", ".join(Frame if key == "frame" else North)
        return FrameError(f"{where} needs '{key}', because there is no default; known are {words}.")
    return DecodeError(f"{where} needs the key '{key}', because nothing is guessed; {GUIDE} explains it.")


def _separator(where: str, value: Any) -> str:
    if not isinstance(value, str) or value not in _SEPARATORS:
        raise DecodeError(f"{where} must be one of ',', ';', 'tab' and ' ' (blanks), but it is {excerpt(str(value))}.")
    return _SEPARATORS[value]


def _encoding(where: str, value: Any) -> str:
    try:
        codecs.lookup(forms.text(where, value))
        "".encode(value)  # refuses Python's codecs that are no text encodings
    except (LookupError, ValueError) as error:
        raise DecodeError(f"{where} = {excerpt(value)} is no text encoding; usual are utf-8, gbk, latin-1.") from error
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
        body_axes(forms.text(where, value))
    except FrameError as error:
        raise FrameError(f"{where}: {error}") from error
    return str(value)


def _frame(where: str, value: Any) -> Frame:
    return Frame.parse(forms.text(where, value))


def _north(where: str, value: Any) -> North:
    return North.parse(forms.text(where, value))


def _header(where: str, value: Any) -> dict[str, Any]:
    found = _section(where, value, _HEADER, ("names",))
    if "occurrence" in found and "marker" not in found:
        raise DecodeError(f"{where}.occurrence counts a marker, but none is declared; add {where}.marker.")
    if not found["names"] and "after_names" in found:
        raise DecodeError(f"{where}.after_names needs names = true; use {where}.skip instead.")
    return found


def _time(where: str, value: Any) -> TimeColumn | TimeRate:
    found = _section(where, value, _TIME)
    if ("column" in found) == ("rate" in found):
        raise DecodeError(f'{where} needs either column and unit, or a declared rate such as rate = "100 Hz".')
    if "rate" in found:
        if len(found) > 1:
            raise DecodeError(
                f"{where} has a rate, so it can have nothing else; remove {', '.join(set(found) - {'rate'})}."
            )
        return TimeRate(rate=found["rate"])
    if "unit" not in found:
        raise _absent(where, "unit")
    return TimeColumn(column=found["column"], unit=found["unit"], unix="epoch" in found)


def _group(kind: Quantity, extra: Mapping[str, Parse], required: tuple[str, ...] = ()) -> Parse:
    known = {"columns": _columns(3), "unit": forms.unit_of(kind), **_COUNTS, **extra}

    def parse(where: str, value: Any) -> GroupSource:
        found = _section(where, value, known, ("columns", "unit", *required))
        return GroupSource(
            columns=found["columns"],
            unit=found["unit"],
            unit_per_count=_per_count(where, found),
            gravity=found.get("sign") == "gravity",
            full_scale=found.get("range"),
        )

    return parse


def _range(kind: Quantity) -> Parse:
    """One size with its unit, or one for each of three columns."""
    one = forms.size(kind)

    def parse(where: str, value: Any) -> float | tuple[float, ...]:
        if not isinstance(value, list):
            return float(one(where, value))
        if len(value) != 3:
            raise DecodeError(f"{where} must be one range, or three in a list, but it has {len(value)}.")
        return tuple(one(f"{where}[{i}]", item) for i, item in enumerate(value))

    return parse


def _per_count(where: str, found: Mapping[str, Any]) -> float:
    if "counts_per_unit" in found and "unit_per_count" in found:
        raise DecodeError(f"{where} has both counts_per_unit and unit_per_count; keep the one from the data sheet.")
    return float(found.get("unit_per_count", 1.0 / found.get("counts_per_unit", 1.0)))


def _temperature(where: str, value: Any) -> GroupSource:
    found = _section(where, value, {"column": _column, "unit": forms.unit_of(Quantity.TEMPERATURE)}, ("column", "unit"))
    return GroupSource(columns=(found["column"],), unit=found["unit"])


def _flags(where: str, value: Any) -> ColumnRef:
    column: ColumnRef = _section(where, value, {"column": _column}, ("column",))["column"]
    return column


def _covariance(where: str, value: Any) -> GroupSource:
    known = {"columns": _columns(9), "angle_unit": forms.unit_of(Quantity.ANGLE)}
    found = _section(where, value, known, ("columns", "angle_unit"))
    return GroupSource(columns=found["columns"], unit=found["angle_unit"])


def _reference(where: str, value: Any) -> ReferenceSource:
    found = _section(where, value, _REFERENCE, ("columns", "order", "frame", "north"))
    size = _ORDERS[found["order"]]
    if len(found["columns"]) != size:
        raise DecodeError(f"{where}.order = '{found['order']}' needs {size} columns, but {len(found['columns'])} came.")
    if (size == 3) != ("unit" in found):
        if size == 3:
            raise _absent(where, "unit")
        raise DecodeError(f"{where}.unit is for angles, but a quaternion has none; remove it.")
    return ReferenceSource(**found)


_COUNTS: Final[dict[str, Parse]] = {"counts_per_unit": forms.positive, "unit_per_count": forms.positive}
_HEADER: Final[dict[str, Parse]] = {
    "marker": forms.text,
    "occurrence": forms.whole(1),
    "skip": forms.whole(0),
    "names": forms.truth,
    "after_names": forms.whole(0),
}
_TIME: Final[dict[str, Parse]] = {
    "column": _column,
    "unit": forms.unit_of(Quantity.TIME),
    "epoch": forms.one_of("unix"),
    "rate": forms.size(Quantity.FREQUENCY),
}
_REFERENCE: Final[dict[str, Parse]] = {
    "columns": _columns(3, 4),
    "order": forms.one_of(*_ORDERS),
    "unit": forms.unit_of(Quantity.ANGLE),
    "frame": _frame,
    "north": _north,
    "of": forms.one_of("body", "case"),
    "source": forms.text,
    "score": _column,
    "flags": _column,
    "bias": _group(Quantity.RATE, {}),
    "covariance": _covariance,
}
_PROFILE: Final[dict[str, Parse]] = {
    "format_version": forms.version(VERSION),
    "separator": _separator,
    "decimal": forms.one_of(".", ","),
    "encoding": _encoding,
    "comment": forms.text,
    "missing": forms.texts,
    "rows": forms.whole(1),
    "header": _header,
    "time": _time,
    "gyr": _group(Quantity.RATE, {"range": _range(Quantity.RATE)}),
    "acc": _group(
        Quantity.ACCELERATION,
        {"range": _range(Quantity.ACCELERATION), "sign": forms.one_of("specific-force", "gravity")},
        ("sign",),
    ),
    "mag": _group(Quantity.FIELD, {"range": _range(Quantity.FIELD)}),
    "temperature": _temperature,
    "flags": _flags,
    "reference": _reference,
    "device": forms.text,
    "axes": _axes,
    "axes_applied": forms.truth,
    "frame": _frame,
    "north": _north,
    "declination": forms.quantity(Quantity.ANGLE),
    "rate_nominal": forms.size(Quantity.FREQUENCY),
    "t0_ns": forms.whole(None),
    "calibration": forms.text,
    "unit_check": forms.truth,
    "notes": forms.texts,
}
