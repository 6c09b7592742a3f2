"""A profile: what a file of numbers does not say about itself, as plain data. `profile_toml` reads it from a file."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from plumbob.core.findings import Finding
from plumbob.data import Range
from plumbob.rotations import Frame, North

ColumnRef = int | str
"""A column by its number, counted from 1, or by its name; one of an array as ``"imu/gyr[1]"``, counted from 1 too."""

NO_COLUMN: Final = "none"
"""Stands for the column of an axis that the sensor does not have."""

QUOTED: Final = "quoted"
"""Separator of cells in quotes with commas between them, as decimal commas need it."""

JSON: Final = "json"
"""Separator of objects of JSON, whose keys are the names of columns."""

BLANK: Final = "blank"
"""Separator of rows in which each single blank is one, so that cells may be empty."""

AS_MOUNTED: Final = "x y z"
"""Axes that change nothing."""


@dataclass(frozen=True, slots=True)
class TextLayout:
    """How the text is laid out.

    Attributes
    ----------
    separator : str
        Between cells: comma, semicolon, tab, a blank for runs of blanks and tabs, ``blank`` for each single one, or
        ``quoted`` or ``json``.
    decimal : str
        Point or comma.
    encoding : str
        Of the file, as Python names it.
    comment : str
        Lines that begin with it are left out; empty for none.
    missing : tuple of str
        Cells that stand for "no value".
    marker : str
        The table starts after this line; empty for none.
    occurrence : int
        Which one, where the marker comes more than once.
    end : str
        Line before which the table ends; empty for the end of the file.
    skip : int
        Lines to leave out after the marker, or at the top.
    names : bool
        Whether a row of column names follows.
    after_names : int
        Lines to leave out after that row, such as one of units.
    rows : int or None
        Rows of numbers that the file must have.
    mark : str
        What stands before the first name, as ``%`` or ``#``.
    words : bool
        Whether numbers stand among words, as in ``acc x = 0.1 y = 0.2`` and JSON. Then each number or clock time is a
        cell, and the words before the first number are one behind them.
    checksum : bool
        Whether a row ends with ``*`` and the exclusive or of its characters, as NMEA has it; else it cannot be read.
    where : tuple of (int or str, str), or empty
        A column and a word: only rows that have it there belong to the table.
    thousands : str
        Between groups of three digits; empty for none.
    cells : tuple of str
        What each cell of a row holds: ``[3]`` is a vector of three numbers, whose columns are then ``acc[1]`` to
        ``acc[3]``; a unit stands behind the number; empty is a number alone. Empty where all cells are so.
    """

    separator: str
    decimal: str = "."
    encoding: str = "utf-8"
    comment: str = ""
    missing: tuple[str, ...] = ("", "NaN")
    marker: str = ""
    occurrence: int = 1
    end: str = ""
    skip: int = 0
    names: bool = True
    after_names: int = 0
    rows: int | None = None
    mark: str = ""
    words: bool = False
    checksum: bool = False
    where: tuple[ColumnRef, str] | tuple[()] = ()
    thousands: str = ""
    cells: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class TimeColumn:
    """Time from a column.

    Attributes
    ----------
    column : int or str
        The column.
    unit : str
        Its unit.
    unix : bool
        Whether it counts from 1970 (UTC).
    unit_per_count : float
        What one count is worth in that unit; 1 where the file holds the unit itself.
    week, seconds : int or str or None
        Column with the number of the GPS week that the time is of, and then it is GPS time; or one with the whole
        seconds, of which the time is the rest.
    """

    column: ColumnRef
    unit: str
    unix: bool = False
    unit_per_count: float = 1.0
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

    Attributes
    ----------
    columns : tuple of int or str
        One column, or two: dates, and clock times.
    zone : int or None
        What the clock is ahead of UTC, ns, where the cells do not say so.
    """

    columns: tuple[ColumnRef, ...]
    zone: int | None = None


@dataclass(frozen=True, slots=True)
class TimeRate:
    """Time of a file that has none, from its declared rate, Hz."""

    rate: float


@dataclass(frozen=True, slots=True)
class GroupSource:
    """Columns of one vector.

    Attributes
    ----------
    columns : tuple of int or str
        One for each component.
    unit : str
        Their unit.
    unit_per_count : float
        What one count is worth in that unit; 1 where the file holds the unit itself.
    zero : tuple of float or None
        Counts that mean zero, one for each component; None for 0.
    axes : str
        Where the vector's own axes are not those of the sensor case: which of them the case's x, y and z are. They may
        be left-handed.
    gravity : bool
        Whether the columns point down at rest, as gravity does, instead of up.
    full_scale : float or tuple of 3 floats or None
        Measuring range, in the unit used inside; of each column where they differ.
    delay : float
        By how much the stamps of its rows are late, s; negative: early.
    plus : tuple of int or str
        Columns that are added, as gravity is to an acceleration without it; empty for none.
    """

    columns: tuple[ColumnRef, ...]
    unit: str
    unit_per_count: float = 1.0
    zero: tuple[float, ...] | None = None
    axes: str = AS_MOUNTED
    gravity: bool = False
    full_scale: Range = None
    delay: float = 0.0
    plus: tuple[ColumnRef, ...] = ()


@dataclass(frozen=True, slots=True)
class ReferenceSource:
    """Columns of a reference attitude.

    Attributes
    ----------
    columns : tuple of int or str
        Four for a quaternion, three for angles.
    order : str
        ``"wxyz"``, ``"xyzw"`` or ``"yaw pitch roll"``.
    frame : Frame
        Navigation frame.
    north : North
        What the heading counts from.
    unit : str or None
        Unit of the angles.
    of : str or None
        Whose attitude it is, ``"body"`` or ``"case"``; needed only where the body axes are remapped.
    source : str
        Where it comes from.
    score, flags, mag_weight : int, str or None
        Columns with the samples that count (1 or 0), with flags, and with how far the field was believed.
    bias : GroupSource or None
        Columns of the gyroscope bias.
    covariance : GroupSource or None
        Nine columns, row by row; `unit` is the angle's, whose square they are in.
    """

    columns: tuple[ColumnRef, ...]
    order: str
    frame: Frame
    north: North
    unit: str | None = None
    of: str | None = None
    source: str = ""
    score: ColumnRef | None = None
    flags: ColumnRef | None = None
    mag_weight: ColumnRef | None = None
    bias: GroupSource | None = None
    covariance: GroupSource | None = None

    @property
    def used(self) -> tuple[ColumnRef, ...]:
        """Every column that it uses."""
        single = [ref for ref in (self.score, self.flags, self.mag_weight) if ref is not None]
        groups = [group.columns for group in (self.bias, self.covariance) if group is not None]
        return (*self.columns, *single, *(ref for group in groups for ref in group))


@dataclass(frozen=True, slots=True)
class Profile:
    """Everything that a text file or a file of arrays does not say about itself.

    Attributes
    ----------
    layout : TextLayout
        How the text is laid out.
    time : TimeColumn, TimeStamps or TimeRate
        Where time comes from.
    triads : mapping of str to GroupSource
        ``gyr``, ``acc``, ``mag``, as far as the file has them.
    temperature : GroupSource or None
        Temperature, one column.
    flags : int, str or None
        Column of flags in Plumbob's own meaning.
    flag_words : bool
        Whether their names stand there, joined by ``+``, instead of their bits.
    reference : ReferenceSource or None
        Attitude.
    meta : mapping
        Fields of `ImuMeta` that the profile declares.
    notes : tuple of str
        Provenance.
    axes_applied : bool
        Whether the columns are in body axes already, and the axes are only kept.
    place, date : str or None
        Where it was recorded, as `data.earth_field.parse_place` reads it, and on which day, ISO 8601, where the file
        does not say.
    origin : str
        Name of the profile's file, for messages.
    arrays : bool
        Whether it describes named arrays; then `layout` means nothing.
    streams : tuple of (str, Profile)
        Sensors that have a file or rows of their own: how the names of their files look, as ``*_gyro.csv``, and their
        profiles. Then nothing above is used but `origin`.
    """

    layout: TextLayout
    time: TimeColumn | TimeStamps | TimeRate
    triads: Mapping[str, GroupSource] = field(default_factory=dict)
    temperature: GroupSource | None = None
    flags: ColumnRef | None = None
    flag_words: bool = False
    reference: ReferenceSource | None = None
    meta: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[Finding | str, ...] = ()
    axes_applied: bool = False
    place: str | None = None
    date: str | None = None
    origin: str = "profile"
    arrays: bool = False
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
