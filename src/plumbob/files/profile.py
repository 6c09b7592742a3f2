"""A profile: what a file of numbers does not say about itself, as plain data, and read from TOML, strictly.

An unknown key, a missing unit or a wrong type is an error that says so.
"""

import codecs
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Final

import numpy as np

from plumbob.core import schema
from plumbob.core.errors import DecodeError, FrameError, PlumbobError, UnitError, excerpt
from plumbob.core.files import reading, sidecars, text_of
from plumbob.core.findings import TEXT, Finding, note
from plumbob.core.resources import guide
from plumbob.core.schema import Parse, toml_text
from plumbob.core.text import counted
from plumbob.core.units import Quantity
from plumbob.data import TRIADS, ImuMeta, Range
from plumbob.files.columns import FORM, zone_ns
from plumbob.rotations import Frame, North, body_axes, in_body_axes, signed_axes

COLUMN: Final = schema.plain(
    "a column's name or its number from 1",
    object,
    lambda value: value.strip() if isinstance(value, str) else value,
    passes=lambda value: bool(value.strip()) if isinstance(value, str) else type(value) is int and value >= 1,
    type=["string", "integer"],
)


def columns(*sizes: int) -> Parse:
    """Parser of a list of columns; those of an array may be named in one text."""
    parse = schema.listed(COLUMN, *sizes, of="columns")
    return schema.described(parse, **schema.json_schema(parse) | {"type": ["array", "string"]})


ColumnRef = Annotated[int | str, COLUMN]  # number, from 1, or name, as ``"imu/gyr[1]"`` of an array
NO_COLUMN: Final = "none"  # stands for the column of an axis that the sensor does not have
QUOTED: Final = "quoted"  # separator of cells in quotes with commas between them, as decimal commas need it
JSON: Final = "json"  # separator of objects of JSON, whose keys are the names of columns
BLANK: Final = "blank"  # separator of rows in which each single blank is one, so that cells may be empty
AS_MOUNTED: Final = "x y z"  # axes that change nothing
SEPARATORS: Final = {"tab": "\t", "\\t": "\t", **{word: word for word in (*",;| \t", BLANK, QUOTED, JSON)}}
EPOCHS: Final = {"unix": 0.0, "julian": 2_440_587.5, "modified-julian": 40_587.0}  # days from each until 1970 (UTC)
ORDERS: Final = {"wxyz": 4, "xyzw": 4, "yaw pitch roll": 3}  # of the columns of an attitude


def _encoding(name: str) -> str:
    try:
        codecs.lookup(name)
        "".encode(name)  # refuses Python's codecs that are no text encodings
    except (LookupError, ValueError) as error:
        raise DecodeError(f"{excerpt(name)} is not a text encoding; common ones are utf-8, gbk and latin-1.") from error
    return name


def _where(where: str, value: Any) -> tuple[ColumnRef, str]:
    if not isinstance(value, list) or len(value) != 2 or not isinstance(value[1], str):
        raise DecodeError(
            f'{where} must be a column and a word, as in ["sensor", "gyro"], but it is {excerpt(str(value))}.'
        )
    return COLUMN(f"{where}[1]", value[0]), value[1].strip()


_WHERE: Final = schema.described(_where, type="array", minItems=2, maxItems=2)


@dataclass(frozen=True, slots=True)
class TextLayout:
    """How the text is laid out."""

    # between cells: comma, semicolon, tab, a blank for runs of blanks and tabs, ``blank`` for each single one, or
    # ``quoted`` or ``json``
    separator: Annotated[str, schema.converted(lambda word: SEPARATORS[word], schema.one_of(*SEPARATORS))]
    decimal: Annotated[str, schema.one_of(".", ",")] = "."  # point or comma
    encoding: Annotated[str, schema.converted(_encoding)] = "utf-8"  # of the file, as Python names it
    comment: str = ""  # lines that begin with it are left out; empty for none
    missing: tuple[str, ...] = ("", "NaN")  # cells that stand for "no value"
    marker: str = ""  # the table starts after this line; empty for none
    occurrence: Annotated[int, schema.whole(1)] = 1  # which one, where the marker comes more than once
    skip: Annotated[int, schema.whole(0)] = 0  # lines to leave out after the marker, or at the top
    names: bool = True  # whether a row of column names follows
    after_names: Annotated[int, schema.whole(0)] = 0  # lines to leave out after that row, such as one of units
    end: str = ""  # line before which the table ends; empty for the end of the file
    rows: Annotated[int | None, schema.whole(1)] = None  # rows of numbers that the file must have
    mark: str = ""  # what stands before the first name, as ``%`` or ``#``
    # Whether numbers stand among words, as in ``acc x = 0.1 y = 0.2`` and JSON. Then each number or clock time is a
    # cell, and the words before the first number are one behind them.
    words: bool = False
    # whether a row ends with ``*`` and the exclusive or of its characters, as NMEA has it; else it cannot be read
    checksum: bool = False
    # a column and a word: only rows that have it there belong to the table
    where: Annotated[tuple[ColumnRef, str] | tuple[()], _WHERE] = ()
    thousands: Annotated[str, schema.one_of(",", ".", "'", " ")] = ""  # between groups of three digits; empty for none
    # What each cell of a row holds: ``[3]`` is a vector of three numbers, whose columns are then ``acc[1]`` to
    # ``acc[3]``; ``imu> #`` is a number behind these words; a unit stands behind the number; empty is a number alone.
    # Empty where all cells are so.
    cells: tuple[str, ...] = ()
    # Of a table with a row for each number: the columns of time, of the words that name its sensor and axis, and of the
    # number. Then the columns are called by these words, a unit among them in brackets, as ``acc x [g]``. Among words
    # those of time and of the number, by their places in the line.
    channels: Annotated[tuple[ColumnRef, ...], columns(2, 3, 4, 5)] = ()


@dataclass(frozen=True, slots=True)
class TimeSource:
    """Where time comes from: a column of numbers, dates and clock times (ISO 8601), or a declared rate alone."""

    # one column of numbers; one of stamps, or two: dates, and clock times; none with a rate
    columns: tuple[ColumnRef, ...] = ()
    unit: Annotated[str, schema.unit_of(Quantity.TIME)] = ""  # of the numbers; empty for others
    # what one count is worth in that unit; 1 where the file holds the unit itself
    unit_per_count: Annotated[float, schema.nonzero] = 1.0
    epoch: Annotated[str, schema.one_of(*EPOCHS)] = ""  # from when it counts; empty where nobody knows
    # week, seconds: column with the number of the GPS week that the time is of, and then it is GPS time; or one with
    # the whole seconds, of which the time is the rest
    week: ColumnRef | None = None
    seconds: ColumnRef | None = None
    # what the clock of stamps is ahead of UTC, ns, where the cells do not say so
    zone: Annotated[int | None, schema.converted(zone_ns)] = None
    rate: Annotated[float, schema.size(Quantity.FREQUENCY)] = 0.0  # Hz, of a file that has no time; 0 for others

    @property
    def used(self) -> tuple[ColumnRef, ...]:
        """Every column of it."""
        return (*self.columns, *(ref for ref in (self.week, self.seconds) if ref is not None))

    @property
    def are_stamps(self) -> bool:
        """Whether its columns hold texts."""
        return bool(self.columns) and not self.unit

    @property
    def exact(self) -> ColumnRef | None:
        """Column whose digits are more than float64 holds."""
        return self.columns[0] if self.epoch and self.seconds is None else None


@dataclass(frozen=True, slots=True)
class GroupSource:
    """Columns of one vector."""

    columns: tuple[ColumnRef, ...]  # one for each component
    unit: str  # their unit
    unit_per_count: float = 1.0  # what one count is worth in that unit; 1 where the file holds the unit itself
    zero: tuple[float, ...] | None = None  # counts that mean zero, one for each component; None for 0
    # Where the vector's own axes are not those of the sensor case: which of them the case's x, y and z are. They may be
    # left-handed.
    axes: str = AS_MOUNTED
    gravity: bool = False  # whether the columns point down at rest, as gravity does, instead of up
    full_scale: Range = None  # measuring range, in the unit used inside; of each column where they differ
    delay: float = 0.0  # by how much the stamps of its rows are late, s; negative: early
    # columns that are added, as gravity is to an acceleration without it; empty for none
    plus: tuple[ColumnRef, ...] = ()


@dataclass(frozen=True, slots=True)
class ReferenceSource:
    """Columns of a reference attitude."""

    columns: Annotated[tuple[ColumnRef, ...], columns(3, 4)]  # four for a quaternion, three for angles
    order: Annotated[str, schema.one_of(*ORDERS)]  # ``"wxyz"``, ``"xyzw"`` or ``"yaw pitch roll"``
    frame: Frame  # navigation frame
    north: North  # what the heading counts from
    unit: Annotated[str | None, schema.unit_of(Quantity.ANGLE)] = None  # unit of the angles
    # whose attitude it is, ``"body"`` or ``"case"``; needed only where the body axes are remapped
    of: Annotated[str | None, schema.one_of("body", "case")] = None
    source: str = ""  # where it comes from
    # score, flags, mag_weight: columns with the samples that count (1 or 0), with flags, and with how far the field was
    # believed
    score: ColumnRef | None = None
    flags: ColumnRef | None = None
    mag_weight: ColumnRef | None = None
    bias: GroupSource | None = None  # columns of the gyroscope bias
    covariance: GroupSource | None = None  # nine columns, row by row; `unit` is the angle's, whose square they are in

    @property
    def used(self) -> tuple[ColumnRef, ...]:
        """Every column that it uses."""
        single = [ref for ref in (self.score, self.flags, self.mag_weight) if ref is not None]
        groups = [group.columns for group in (self.bias, self.covariance) if group is not None]
        return (*self.columns, *single, *(ref for group in groups for ref in group))


@dataclass(frozen=True, slots=True)
class Profile:
    """Everything that a text file or a file of arrays does not say about itself."""

    layout: TextLayout  # how the text is laid out
    time: TimeSource  # where time comes from
    # ``gyr``, ``acc``, ``mag``, as far as the file has them
    triads: Mapping[str, GroupSource] = field(default_factory=dict)
    temperature: GroupSource | None = None  # temperature, one column
    flags: ColumnRef | None = None  # column of flags in Plumbob's own meaning
    flag_words: bool = False  # whether their names stand there, joined by ``+``, instead of their bits
    reference: ReferenceSource | None = None  # attitude
    meta: Mapping[str, Any] = field(default_factory=dict)  # fields of `ImuMeta` that the profile declares
    notes: tuple[Finding | str, ...] = ()  # provenance
    axes_applied: bool = False  # whether the columns are in body axes already, and the axes are only kept
    # place, date: where it was recorded, as `data.earth_field.parse_place` reads it, and on which day, ISO 8601, where
    # the file does not say
    place: str | None = None
    date: str | None = None
    origin: str = "profile"  # name of the profile's file, for messages
    arrays: bool = False  # whether it describes named arrays; then `layout` means nothing
    # Sensors that have a file or rows of their own: how the names of their files look, as ``*_gyro.csv``, and their
    # profiles. Then nothing above is used but `origin`.
    streams: "tuple[tuple[str, Profile], ...]" = ()

    @property
    def stamps(self) -> tuple[ColumnRef, ...]:
        """Columns of dates and clock times."""
        return self.time.columns if self.time.are_stamps else ()

    @property
    def texts(self) -> tuple[ColumnRef, ...]:
        """Columns that are not numbers."""
        return self.stamps if self.flags is None or not self.flag_words else (*self.stamps, self.flags)

    @property
    def turn(self) -> str | None:
        """Body axes that the columns must be turned to; None where they are in them."""
        axes = str(self.meta.get("axes", AS_MOUNTED))
        return None if self.axes_applied or axes.split() == AS_MOUNTED.split() else axes

    @property
    def vectors(self) -> tuple[tuple[ColumnRef, ...], ...]:
        """Columns of each triad that has all."""
        return tuple(group.columns for group in self.triads.values() if NO_COLUMN not in group.columns)

    @property
    def used(self) -> tuple[ColumnRef, ...]:
        """Every column that it uses, time included."""
        single = self.time.used if self.flags is None else (*self.time.used, self.flags)
        groups = [*self.triads.values(), *([self.temperature] if self.temperature else [])]
        reference = self.reference.used if self.reference else ()
        return (
            *single,
            *(ref for group in groups for ref in (*group.columns, *group.plus) if ref != NO_COLUMN),
            *reference,
        )


_MIRRORED: Final = 'axes and mirrored = true in its own table, as in [mag] axes = "x y -z"'
GUIDE: Final = guide("file-formats.md")
VERSION: Final = 1
_EXAMPLE = {"gyr": "deg/s", "acc": "g", "mag": "uT", "temperature": "degC", "time": "s", "reference": "deg"}
_META = schema.keys(ImuMeta, *(f"{name}_range" for name in TRIADS))
_OWN = ("time", "temperature", "reference", "notes", "axes_applied", "place", "date", "arrays")  # as they are
_SIZES = {**dict.fromkeys((*TRIADS, "bias"), 3), "covariance": 9, "reference": 4}  # columns of a table of an array
_LAYOUT = ("separator", "decimal", "thousands", "encoding", "comment", "missing", "rows", "cells")


def load_profile(path: str | Path) -> Profile:
    """Read a profile; DecodeError, UnitError or FrameError for what is unknown, missing or of the wrong type."""
    text = text_of(path, "profile")
    with reading(Path(path)):
        return parse_profile(text, origin=Path(path).name)


def profiles_beside(file: Path) -> list[Path]:
    """Profiles that lie beside a file under its name; a TOML of another kind, as a chain or a format, is none."""
    profiles = []
    for path in filter(Path.is_file, sidecars(file)):
        try:
            raw = tomllib.loads(path.read_text(encoding="utf-8-sig"))
        except (ValueError, OSError):  # so that its fault is said
            raw = {"header": ""}
        # keys of which a profile has one, and what lies beside a recording and is none has not
        if not isinstance(raw.get("kind"), str) and {"separator", "arrays", "stream", "header"} & set(raw):
            profiles.append(path)
    return profiles


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
    if open_ := questions(raw):
        raise DecodeError(
            f"{counted(len(open_), 'open question')}: {', '.join(open_)}. Open the file, and behind each '?' "
            "correct what is wrong and delete the '?'; a number or true loses its quotes."
        )
    arrays = raw.get("arrays") is True
    if arrays and (text := [key for key in (*_LAYOUT, "header") if key in raw]):
        raise DecodeError(f"arrays = true says that the file is not text; remove {', '.join(text)}.")
    table = PROFILE("", _of_arrays(raw)) if arrays else _TEXT_PROFILE("", raw)
    layout = {} if arrays else {key: table[key] for key in _LAYOUT if key in table} | table["header"]
    ranges = {f"{name}_range": _in_body(table[name], table) for name in TRIADS if name in table}
    flags = table.get("flags", {})
    profile = Profile(
        layout=TextLayout(**{"separator": ",", **layout}),
        triads={name: table[name] for name in TRIADS if name in table},
        flags=flags.get("column"),
        flag_words=flags.get("words", False),
        meta={key: table[key] for key in _META if key in table} | ranges,
        origin=origin,
        **{key: table[key] for key in _OWN if key in table},
    )
    _require_sense(profile)
    return profile


def _of_arrays(raw: Mapping[str, Any]) -> dict[str, Any]:
    """The same with ``columns = "gyr"`` written out, which are all columns of an array, in their order."""
    tables = {key: _of_arrays(value) if isinstance(value, dict) else value for key, value in raw.items()}
    for key, table in tables.items():
        name = table.get("columns") if key in _SIZES and isinstance(table, dict) else None
        if isinstance(name, str):
            size = ORDERS.get(str(table.get("order")), _SIZES[key])
            table["columns"] = [f"{name.strip()}[{k} of {size}]" for k in range(1, size + 1)]
    return tables


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
    absolute = f'time.epoch = "{profile.time.epoch}"' if profile.time.epoch else ""
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


def _time(where: str, table: dict[str, Any]) -> TimeSource:
    if "format" in table:
        if other := [key for key in table if key not in {"format", "column", "columns", "zone"}]:
            raise DecodeError(f"{where} has a format, so it can have no {' and no '.join(other)}; remove it.")
        if ("column" in table) == ("columns" in table):
            raise DecodeError(f"{where} needs column, or columns = [date, time] where these are two.")
        return TimeSource(table.get("columns") or (table["column"],), zone=table.get("zone"))
    if alone := [key for key in ("columns", "zone") if key in table]:
        raise DecodeError(f'{where}.{alone[0]} is for dates and clock times; add {where}.format = "{FORM}".')
    if ("column" in table) == ("rate" in table):
        raise DecodeError(
            f'{where} needs either column and unit (or format = "{FORM}" for dates and clock times), '
            'or a declared rate such as rate = "100 Hz".'
        )
    if "rate" in table and len(table) > 1:
        more = ", ".join(key for key in table if key != "rate")
        raise DecodeError(f"{where} has a rate, so it can have nothing else; remove {more}.")
    if "column" in table and "unit" not in table:
        raise _absent(where, "unit")
    if "week" in table and {"epoch", "seconds"} & set(table):
        raise DecodeError(f"{where} has week, so it can have no epoch and no seconds; remove them, or week.")
    columns = (table.pop("column"),) if "column" in table else ()
    return TimeSource(columns, **table)


def _group(kind: Quantity, extra: Mapping[str, Parse] = MappingProxyType({}), required: tuple[str, ...] = ()) -> Parse:
    keys = {"columns": columns(3), "unit": schema.unit_of(kind), **_COUNTS, **extra, **_MOUNT}
    return _form(keys, ("columns", "unit", *required), _group_source)


def _group_source(where: str, table: dict[str, Any]) -> GroupSource:
    scales = {"counts_per_unit", "unit_per_count"} & set(table)
    if len(scales) > 1:
        raise DecodeError(f"{where} has both counts_per_unit and unit_per_count; keep the one from the data sheet.")
    if "zero" in table and not scales:
        raise DecodeError(f"{where}.zero is in counts; add {where}.counts_per_unit or {where}.unit_per_count.")
    return GroupSource(
        **{key: table[key] for key in ("columns", "unit", "zero", "delay", "plus") if key in table},
        unit_per_count=float(table.get("unit_per_count", 1.0 / table.get("counts_per_unit", 1.0))),
        axes=_own_axes(where, table),
        gravity=table.get("sign") == "gravity",
        full_scale=table.get("range"),
    )


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
_TIME: Final = schema.table(
    TimeSource, _time, missing=_absent, column=COLUMN, format=schema.one_of(FORM), columns=columns(2)
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
    "frame": schema.converted(Frame.parse),
    "north": schema.converted(North.parse),
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


def toml_lines(tables: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Lines of TOML: keys by table, the outermost called ""; those without a value are left out."""
    for name, keys in tables.items():
        yield from ("", f"[{name}]") if name else ()
        yield from (f"{key} = {toml_value(value)}" for key, value in keys.items() if value is not None)


def toml_value(value: Any) -> str:
    """A value in TOML: of findings, a text that somebody wrote is a string, any other a table."""
    if isinstance(value, Finding) and value.code == TEXT:
        return toml_text(str(value))
    if isinstance(value, Finding):
        parts = ", ".join(f"{name} = {toml_value(v)}" for name, v in value.values.items() if v is not None)
        head = f"code = {toml_text(value.code)}, severity = {toml_text(value.severity)}"
        return f"{{ {head}, values = {{ {parts} }}, text = {toml_text(str(value))} }}"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{toml_text(key)} = {toml_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, tuple | list):
        return f"[{', '.join(map(toml_value, value))}]"
    return (
        str(value).lower() if isinstance(value, bool) else toml_text(value) if isinstance(value, str) else repr(value)
    )
