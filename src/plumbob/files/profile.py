"""A profile: what a file of numbers does not say about itself, as plain data. `profile_toml` reads it from a file."""

import codecs
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Final

from plumbob.core import schema
from plumbob.core.errors import DecodeError, excerpt
from plumbob.core.findings import Finding
from plumbob.core.schema import Parse
from plumbob.core.units import Quantity
from plumbob.data import Range
from plumbob.rotations import Frame, North


def _is_column(value: Any) -> bool:
    return bool(value.strip()) if isinstance(value, str) else type(value) is int and value >= 1


COLUMN: Final = schema.plain(
    "a column's name or its number from 1",
    _is_column,
    lambda value: value.strip() if isinstance(value, str) else value,
    type=["string", "integer"],
)


def columns(*sizes: int) -> Parse:
    """Parser of a list of columns; those of an array may be named in one text."""
    parse = schema.listed(COLUMN, *sizes, of="columns")
    return schema.described(parse, **schema.json_schema(parse) | {"type": ["array", "string"]})


ColumnRef = Annotated[int | str, COLUMN]
"""A column by its number, counted from 1, or by its name; one of an array as ``"imu/gyr[1]"``, counted from 1 too."""

NO_COLUMN: Final = "none"  # stands for the column of an axis that the sensor does not have

QUOTED: Final = "quoted"  # separator of cells in quotes with commas between them, as decimal commas need it

JSON: Final = "json"  # separator of objects of JSON, whose keys are the names of columns

BLANK: Final = "blank"  # separator of rows in which each single blank is one, so that cells may be empty

AS_MOUNTED: Final = "x y z"  # axes that change nothing

SEPARATORS: Final = {"tab": "\t", "\\t": "\t", **{word: word for word in (*",;| \t", BLANK, QUOTED, JSON)}}
"""Separators by the names that a profile may give them."""

ORDERS: Final = {"wxyz": 4, "xyzw": 4, "yaw pitch roll": 3}
"""How the columns of an attitude are ordered, and how many there are."""


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
    # number. Then the columns are called by these words, a unit among them in brackets, as ``acc x [g]``.
    channels: Annotated[tuple[ColumnRef, ...], columns(3, 4, 5)] = ()


@dataclass(frozen=True, slots=True)
class TimeColumn:
    """Time from a column."""

    column: ColumnRef
    unit: str  # its unit
    unix: bool = False  # whether it counts from 1970 (UTC)
    unit_per_count: float = 1.0  # what one count is worth in that unit; 1 where the file holds the unit itself
    # week, seconds: column with the number of the GPS week that the time is of, and then it is GPS time; or one with
    # the whole seconds, of which the time is the rest
    week: ColumnRef | None = None
    seconds: ColumnRef | None = None

    @property
    def columns(self) -> tuple[ColumnRef, ...]:
        """Every column of it."""
        return tuple(ref for ref in (self.column, self.week, self.seconds) if ref is not None)

    @property
    def exact(self) -> ColumnRef | None:
        """Column whose digits are more than float64 holds."""
        return self.column if self.unix and self.seconds is None else None


@dataclass(frozen=True, slots=True)
class TimeStamps:
    """Time from dates and clock times (ISO 8601).

    `columns`: one column, or two: dates, and clock times; `zone`: what the clock is ahead of UTC, ns, where the cells
    do not say so.
    """

    columns: tuple[ColumnRef, ...]
    zone: int | None = None


@dataclass(frozen=True, slots=True)
class TimeRate:
    """Time of a file that has none, from its declared rate, Hz."""

    rate: float


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
    time: TimeColumn | TimeStamps | TimeRate  # where time comes from
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
        return self.time.columns if isinstance(self.time, TimeStamps) else ()

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
    def used(self) -> tuple[ColumnRef, ...]:
        """Every column that it uses, time included."""
        time: tuple[ColumnRef, ...] = self.stamps
        if isinstance(self.time, TimeColumn):
            time = self.time.columns
        single = time if self.flags is None else (*time, self.flags)
        groups = [*self.triads.values(), *([self.temperature] if self.temperature else [])]
        reference = self.reference.used if self.reference else ()
        return (
            *single,
            *(ref for group in groups for ref in (*group.columns, *group.plus) if ref != NO_COLUMN),
            *reference,
        )
