"""Joint angles over time, as an estimate or a program has them, and the tables that they are written to."""

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, ParameterError, ShapeError, UnitError, excerpt
from plumbob.core.files import existing_file, reading, require_room
from plumbob.core.series import Series
from plumbob.core.text import counted
from plumbob.core.time import to_ns, to_s
from plumbob.core.units import Quantity, to_deg, to_si
from plumbob.files import arrow
from plumbob.files.arrow import column_numbers, unpacked_bytes

if TYPE_CHECKING:
    import pyarrow as pa

TIME: Final = "t [s]"
RECORDED: Final = "recorded [s]"  # column of a program: when each place of its path was recorded
_KEY: Final = b"plumbob joint angles"
_VERSION: Final = 1
_SD: Final = "_sd"
_HAND: Final = ("hand_x", "hand_y", "hand_z")


@dataclass(frozen=True, eq=False, repr=False)
class JointTrack(Series):
    """Joint angles of a chain over time.

    Parameters
    ----------
    t : array_like (N,)
        Time since the start of the recording, s, strictly increasing.
    names : sequence of str
        Names of the angles, in the order of `Chain.angles`.
    angles : array_like (N, K)
        rad; NaN where one is not known.
    sd : array_like (N, K), optional
        Standard deviation of each, rad.
    hand : array_like (N, 3), optional
        Position of the hand from the origin of the chain's root, m: in the axes of a root that stands still, in the
        navigation frame where the root moves.
    hand_sd : array_like (N, 3), optional
        Standard deviation of each of its coordinates, m.
    flags : array_like (N,), optional
        Flags, from `plumbob.core.flags`.
    source : str
        Where it comes from.

    Raises
    ------
    ShapeError
        If lengths or shapes differ, a name occurs twice, or a standard deviation is negative.
    ClockError
        If time is not finite and increasing.
    """

    t: Floats
    names: tuple[str, ...]
    angles: Floats
    sd: Floats | None = None
    hand: Floats | None = None
    hand_sd: Floats | None = None
    flags: NDArray[np.uint32] | None = None
    source: str = ""

    def __post_init__(self) -> None:
        """Validate."""
        t = to_s(to_ns(check.column("t", self.t)))
        check.increasing_time("t", t)
        names = tuple(self.names)
        _require_names(names)
        self._set("t", t)
        object.__setattr__(self, "names", names)
        self._set("angles", _no_infinity("angles", check.rows("angles", self.angles, len(names), t.size)))
        for name, width in (("sd", len(names)), ("hand", 3), ("hand_sd", 3)):
            if (value := getattr(self, name)) is not None:
                self._set(name, _no_infinity(name, check.rows(name, value, width, t.size)))
        for name in ("sd", "hand_sd"):
            if (value := getattr(self, name)) is not None and (value < 0.0).any():
                raise ShapeError(f"{name} must not be negative, but its least value is {np.nanmin(value):g}.")
        if self.hand_sd is not None and self.hand is None:
            raise ShapeError("hand_sd belongs to hand, which is not given.")
        if self.flags is not None:
            self._set("flags", check.bits("flags", self.flags, t.size))

    def _set(self, name: str, array: NDArray[Any]) -> None:
        object.__setattr__(self, name, check.read_only(array))

    def __len__(self) -> int:
        return int(self.t.size)

    def __getitem__(self, rows: slice) -> Self:
        """Samples of a slice."""
        parts = {name: getattr(self, name) for name in ("sd", "hand", "hand_sd", "flags")}
        cut = {name: None if value is None else value[rows] for name, value in parts.items()}
        return type(self)(self.t[rows], self.names, self.angles[rows], source=self.source, **cut)

    def facts(self) -> Mapping[str, str]:
        """Angles, samples and what else it has."""
        more = [name for name in ("sd", "hand", "hand_sd", "flags") if getattr(self, name) is not None]
        return {
            "angles": ", ".join(self.names),
            "samples": f"{len(self)} from {self.t[0]:.6g} to {self.t[-1]:.6g} s",
            "with": ", ".join(more) or "nothing else",
            "source": self.source or "not named",
        }

    def columns(self) -> Mapping[str, NDArray[Any]]:
        """Time, each angle and its standard deviation, the hand, and flags."""
        columns: dict[str, NDArray[Any]] = {TIME: self.t}
        columns |= {f"{name} [rad]": self.angles[:, k] for k, name in enumerate(self.names)}
        if self.sd is not None:
            columns |= {f"{name}{_SD} [rad]": self.sd[:, k] for k, name in enumerate(self.names)}
        for values, end in ((self.hand, ""), (self.hand_sd, _SD)):
            if values is not None:
                columns |= {f"{name}{end} [m]": values[:, k] for k, name in enumerate(_HAND)}
        if self.flags is not None:
            columns["flags"] = self.flags
        return columns

    def save(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write a table, ``.csv`` or ``.parquet``, which are read back to the bit, or OpenSim's motion, ``.mot``.

        Raises
        ------
        ParameterError
            If the suffix is another, or a file lies there and `overwrite` is false.
        DecodeError
            If the system refuses.
        """
        if (file := check.path("path", path)).suffix.lower() == ".mot":
            from plumbob.files.foreign.opensim import write_motion

            angles = dict(zip(self.names, to_deg(self.angles.T), strict=True))
            write_motion(file, {"time": self.t, **angles}, overwrite=overwrite)
            return file
        return write_table(path, self.columns(), source=self.source, overwrite=overwrite)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a table: a column ``t [s]``, and one for each angle, as ``elbow [rad]`` or ``elbow [deg]``.

        Columns of ``_sd`` behind the name of an angle are its standard deviations; ``hand_x [m]`` and so on are the
        hand's place, and ``flags`` are flags.

        Raises
        ------
        DecodeError
            If it is not such a table.
        UnitError
            If a column has no unit, or a wrong one.
        ShapeError, ClockError
            As of this class.
        """
        file = existing_file(path)
        columns, source = read_table(file)
        with reading(file):
            return cls(source=source or file.name, **_parts(columns))


def write_table(
    path: str | Path, columns: Mapping[str, NDArray[Any]], *, source: str = "", overwrite: bool = False
) -> Path:
    """Write columns of numbers as ``.csv`` or ``.parquet``; errors as of `JointTrack.save`."""
    file = check.path("path", path)
    about = json.dumps({"format_version": _VERSION, "source": source})
    arrow.write_table(file, columns, metadata={_KEY: about.encode()}, overwrite=overwrite)
    return file


def read_table(path: str | Path) -> tuple[dict[str, NDArray[Any]], str]:
    """Columns of such a table, and where it says that it comes from; errors as of `JointTrack.load`."""
    file = existing_file(path)
    readers = {".csv": _read_csv, ".parquet": _read_parquet, ".mcap": _read_line}
    if (reader := readers.get(file.suffix.lower())) is None:
        raise ParameterError(f"a table of joint angles ends in {' or '.join(readers)}, but it is {path}.")
    with reading(file):
        return reader(file)


def _require_names(names: Sequence[str]) -> None:
    for name in names:
        if not isinstance(name, str) or not name.strip() or not name.isprintable() or set("[]") & set(name):
            raise ShapeError(f"the name of an angle must be a word without brackets, but it is {check.said(name)}.")
        if names.count(name) > 1:
            raise ShapeError(f"the angle '{name}' occurs twice; each needs a name of its own.")
        if name.endswith(_SD) and name.removesuffix(_SD) in names:
            raise ShapeError(f"'{name}' would be the standard deviation of '{name.removesuffix(_SD)}'; rename it.")


def _no_infinity(name: str, values: Floats) -> Floats:
    if np.isinf(values).any():
        row, column = (int(indices[0]) for indices in np.nonzero(np.isinf(values)))
        raise ShapeError(f"{name}[{row}, {column}] is infinite; what is not known is NaN.")
    return values


def _read_csv(file: Path) -> tuple[dict[str, NDArray[Any]], str]:
    import pyarrow as pa
    from pyarrow import csv as arrow_csv

    with file.open(encoding="utf-8-sig", newline="") as stream:
        try:
            head = next(csv.reader(stream), [])
        except (UnicodeDecodeError, csv.Error) as error:
            raise DecodeError("it is not a table of joint angles in UTF-8 text.") from error
    if TIME not in head:
        raise DecodeError(f"its first line must name its columns, '{TIME}' first, but it is {excerpt(','.join(head))}.")
    types = {name: pa.uint32() if name == "flags" else pa.float64() for name in head}
    options = arrow_csv.ConvertOptions(column_types=types, null_values=["", "nan", "NaN"])
    try:
        table = arrow_csv.read_csv(file, arrow_csv.ReadOptions(column_names=head, skip_rows=1), convert_options=options)
    except pa.ArrowInvalid as error:
        raise DecodeError(f"a row is not numbers, one for each of {counted(len(head), 'column')}: {error}") from error
    return _columns(table), ""


def _read_line(file: Path) -> tuple[dict[str, NDArray[Any]], str]:
    """Joint angles that a line has given, of its recording."""
    from plumbob.files.mcap import open_log
    from plumbob.live import rows

    log = open_log(file)
    records = [
        rows.parsed(rows.JOINTS, rows.shifted(message.data, log.shift_ns))
        for message in log
        if message.topic == rows.JOINTS
    ]
    if not records:
        raise DecodeError("it holds no joint angles; a session with [chain] records them.")
    names, t_ns = records[0]["name"], rows.integers("t_ns", records, np.int64)
    angles, sd = (rows.table(key, records, len(names)) for key in ("position", "sd"))
    columns: dict[str, NDArray[Any]] = {TIME: to_s(t_ns - t_ns[0]), "flags": rows.integers("flags", records, np.uint32)}
    columns |= {f"{name}{end} [rad]": of[:, k] for of, end in ((angles, ""), (sd, _SD)) for k, name in enumerate(names)}
    for key, end in (("hand", ""), ("hand_sd", _SD)):
        columns |= {f"{name}{end} [m]": of for name, of in zip(_HAND, rows.table(key, records, 3).T, strict=True)}
    return columns, file.name


def _read_parquet(file: Path) -> tuple[dict[str, NDArray[Any]], str]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(file, page_checksum_verification=True) as parquet:
            require_room(unpacked_bytes(file), file.stat().st_size)
            table = parquet.read()
    except (pa.ArrowException, OSError) as error:
        raise DecodeError("it is not a complete Parquet file; use an intact copy.") from error
    about = (table.schema.metadata or {}).get(_KEY)
    if about is None:
        return _columns(table), ""
    try:
        said = json.loads(about)
        version, source = said["format_version"], str(said["source"])
    except (ValueError, TypeError, KeyError) as error:
        raise DecodeError("its metadata is damaged; use an intact copy.") from error
    if version != _VERSION:
        raise DecodeError(f"it has format_version {version}, but this program reads {_VERSION}; update Plumbob.")
    return _columns(table), source


def _columns(table: "pa.Table") -> dict[str, NDArray[Any]]:
    if len(set(table.column_names)) < table.num_columns:
        raise DecodeError("a column occurs twice; each needs a name of its own.")
    try:
        return {name: column_numbers(table.column(name)) for name in table.column_names}
    except Exception as error:  # columns of text, times and lists are refused by NumPy and Arrow, each in its own way
        raise DecodeError("every column of a table of joint angles must hold numbers, but one does not.") from error


def _parts(columns: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    """What columns by their titles are to a `JointTrack`."""
    if TIME not in columns:
        raise DecodeError(f"it has no column '{TIME}'; its columns are {', '.join(columns)}.")
    angles: dict[str, Floats] = {}
    lengths: dict[str, Floats] = {}
    for title, values in columns.items():
        if title in (TIME, RECORDED, "flags"):
            continue
        name, bracket, unit = title.partition(" [")
        if not bracket or not unit.endswith("]"):
            raise UnitError(f"the column {excerpt(title)} has no unit; name it as '{name} [rad]' or '{name} [deg]'.")
        is_hand = name.removesuffix(_SD) in _HAND
        quantity = Quantity.LENGTH if is_hand else Quantity.ANGLE
        (lengths if is_hand else angles)[name] = to_si(np.asarray(values, np.float64), unit[:-1], quantity)
    names = tuple(name for name in angles if not (name.endswith(_SD) and name.removesuffix(_SD) in angles))
    return {
        "t": columns[TIME],
        "names": names,
        "angles": _stacked(angles, names, len(columns[TIME])),
        "sd": _group(angles, [name + _SD for name in names]),
        "hand": _group(lengths, _HAND),
        "hand_sd": _group(lengths, [name + _SD for name in _HAND]),
        "flags": columns.get("flags"),
    }


def _stacked(columns: Mapping[str, Floats], names: Sequence[str], count: int) -> Floats:
    return np.stack([columns[name] for name in names], axis=1) if names else np.empty((count, 0))


def _group(columns: Mapping[str, Floats], names: Sequence[str]) -> Floats | None:
    """Columns that belong together, all or none."""
    lacking = [name for name in names if name not in columns]
    if len(lacking) == len(names):
        return None
    if lacking:
        raise DecodeError(f"the columns {', '.join(names)} belong together, but {', '.join(lacking)} are not there.")
    return _stacked(columns, names, 0)
