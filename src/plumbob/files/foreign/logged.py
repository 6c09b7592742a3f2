"""What every reader of others' files yields, and the one place where a recording is made of it.

A reader fills a `SensorLog`: the stream of each sensor by its own clock, in the unit that the format says, an attitude
where there is one, what is known besides, and notes. `SensorLog.recording` converts, joins and checks it.

An attitude that a log holds has stamps of its own. It is brought to the rows of the samples along the shorter arc
between its two neighbours, where these are not farther apart than a gap; elsewhere it is NaN, 'not known'.
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core.check import Floats
from plumbob.core.constants import NOMINAL_FIELD
from plumbob.core.errors import ClockError, DecodeError, ParameterError, one_line
from plumbob.core.files import existing_file
from plumbob.core.findings import Note, info, warning
from plumbob.core.text import counted, first_words
from plumbob.core.time import longest_bridged
from plumbob.core.units import to_si
from plumbob.data import AttitudeTrack, ImuMeta
from plumbob.data.array import ImuArray
from plumbob.data.reading import read_rows
from plumbob.data.recording import Recording
from plumbob.files.foreign.join import Joined, Readings, joined
from plumbob.files.profile import ColumnRef
from plumbob.files.stamps import time_line, without_leaps
from plumbob.rotations import Frame, North, quat_normalize

MOST: Final = 2 << 30  # bytes of a log at most: it is kept in memory while it is searched
_PART: Final = 1 << 14
_NORM: Final = 1e-3

RELATIVE_NOTE: Final = (
    f"mag is in arbitrary units, 1 at the place of calibration, which is taken for {NOMINAL_FIELD:g} µT"
)

Table = Mapping[str, NDArray[Any]]  # columns (N,) of one kind of record, by name


class LoggedAttitude(NamedTuple):
    """An attitude on stamps of its own (M,), ns, by the clock of the samples: body to `frame` (M, 4), wxyz.

    What is not a rotation (a norm that is not 1 within 1e-3) is taken for 'not known'.
    """

    t_ns: NDArray[np.int64]
    q_nb: Floats
    source: str
    frame: Frame = Frame.NED
    north: North = North.TRUE
    note: str = ""  # is said where it is taken, behind its source
    kind: str = "attitude"


@dataclass
class SensorLog:
    """What a file holds."""

    notes: list[Note]  # what the format says of units, axes and clocks, and what was left out
    meta: ImuMeta  # what is known of the unit
    # UTC of the stamp 0, ns since 1970; 0 where stamps are UTC themselves; None where it is not known
    epoch_ns: int | None = None
    streams: dict[str, Readings] = field(default_factory=dict)  # by ``gyr``, ``acc``, ``mag`` and ``temp_c``, in SI
    # in the order in which they are preferred; the first that is known at the samples' times counts
    attitudes: list[LoggedAttitude] = field(default_factory=list)
    losses: list[Note] = field(default_factory=list)  # notes that come last: what of the file is cut or damaged

    def add(self, sensor: str, t_ns: ArrayLike, values: Any, unit: str = "", *, valid: Any = None) -> None:
        """Add a sensor's stream, of rows that are `valid` alone, in a unit or in SI."""
        t_ns, values = np.asarray(t_ns), np.asarray(values, dtype=np.float64)
        if valid is not None:
            t_ns, values = t_ns[valid], values[valid]
        self.streams[sensor] = Readings(t_ns, to_si(values, unit) if unit else values)

    def require_gyroscope(self, where: str) -> None:
        """Refuse a log without angular rates, which lead the rows."""
        if "gyr" not in self.streams or not np.asarray(self.streams["gyr"].t_ns).size:
            raise DecodeError(f"it holds no samples of a gyroscope ({where}); log them, or take another file.")

    def joined(self) -> Joined:
        """Samples of all streams on one time line."""
        return joined(self.streams, meta=self.meta, epoch_ns=self.epoch_ns)

    def recording(
        self, name: str, *, none: str = "", flags: Callable[[NDArray[np.int64]], NDArray[np.uint32]] | None = None
    ) -> Recording:
        """Recording of it all; `none` is the note where no attitude is known, `flags` makes those of rows by stamps."""
        imu, rows_ns, how = self.joined()
        notes = [*self.notes, *how]
        imu = imu if flags is None else imu.flagged(flags(rows_ns))
        track = None
        for attitude in self.attitudes:
            q_nb = _attitude_at(rows_ns, attitude, notes)
            if q_nb is not None:
                notes.append(info("source.attitude", kind=attitude.kind, source=attitude.note or attitude.source))
                track = AttitudeTrack(
                    t=imu.t, q_nb=q_nb, frame=attitude.frame, north=attitude.north, source=attitude.source
                )
                break
        else:
            notes += [none] if none else []
        return Recording(imu=imu, track=track, name=name, notes=(*notes, *self.losses))


def array_recording(units: Mapping[str, Joined], name: str, notes: Sequence[Note]) -> Recording:
    """Recording of several units that were sampled together; ParameterError if they have stamps of their own."""
    rows_ns = next(iter(units.values())).rows_ns
    if any(not np.array_equal(unit.rows_ns, rows_ns) for unit in units.values()):
        raise ParameterError(
            f"its units have stamps of their own: {first_words([*units], 20)}. Name one: --unit {next(iter(units))}."
        )
    how = [finding.on(unit) for unit, of in units.items() for finding in of.notes]
    return Recording(array=ImuArray({unit: of.imu for unit, of in units.items()}), name=name, notes=(*notes, *how))


def choose(
    notes: list[Note], counts: Mapping[str, int], unit: str | None, of: str = "samples", what: str = "record"
) -> str:
    """One of a log's units, with the counts of their records: by name (``IMU.1``, ``imu1``) or number, or the first."""
    taken = chosen([*counts], unit)
    others = {name: count for name, count in counts.items() if name != taken}
    listed = first_words([f"{name} ({count})" for name, count in others.items()], 20)
    records = counted(counts[taken], what)
    notes.append(
        info("source.chosen", of=of, taken=taken, records=records, others=listed, other=next(iter(others), ""))
    )
    return taken


def of_vehicle(t_ns: NDArray[np.int64], q_nb: Floats, name: str, whose: str, heading: str) -> LoggedAttitude:
    """Attitude, body to NED, that a flight controller estimated itself; its heading counts from true north."""
    note = (
        f"{name}, {whose} own estimate from the same sensors, not a reference: a comparison with it shows agreement, "
        f"not accuracy; its heading {heading}"
    )
    return LoggedAttitude(t_ns, q_nb, f"{whose} own estimate ({name}), not a reference", note=note)


def records(raw: NDArray[np.uint8], places: NDArray[np.int64], layout: "np.dtype[Any]") -> NDArray[Any]:
    """Records (N,) of one layout that begin at these places in a file's bytes."""
    rows = np.empty((places.size, layout.itemsize), dtype=np.uint8)
    within = np.arange(layout.itemsize)
    for start in range(0, places.size, _PART):
        rows[start : start + _PART] = raw[places[start : start + _PART, None] + within]
    return rows.view(layout)[:, 0] if layout.itemsize else np.empty(0, layout)


def vectors(table: Mapping[Any, NDArray[Any]] | NDArray[Any], *names: ColumnRef) -> Floats:
    """Columns as vectors (N, k); refused where a damaged layout makes words of them."""
    try:
        return np.column_stack([np.asarray(table[name], dtype=np.float64) for name in names])
    except ValueError as error:
        raise DecodeError(
            f"{', '.join(map(str, names))} are not numbers ({one_line(error)}); it is damaged."
        ) from error


def micro(stamps: NDArray[Any]) -> NDArray[np.int64]:
    """Integer ns of µs (N,), as flight controllers count them; what no clock of 64 bit ns holds becomes its end."""
    most = np.iinfo(np.int64).max // 1000
    return np.minimum(stamps.astype(np.uint64), np.uint64(most)).astype(np.int64) * 1000


def _attitude_at(rows_ns: NDArray[np.int64], logged: LoggedAttitude, notes: list[Note]) -> Floats | None:
    """Quaternions at the rows of the samples, NaN where the log has none; None where it has none at all."""
    (t_ns, _), q_nb = without_leaps(logged.t_ns), logged.q_nb
    valid = np.abs(np.sqrt(np.sum(q_nb * q_nb, axis=1)) - 1.0) < _NORM
    if not valid.any():
        return None
    if lost := valid.size - int(valid.sum()):
        notes.append(warning("reading.no_rotations", lost=lost, count=valid.size))
    if np.array_equal(t_ns, rows_ns):  # in one table with the samples: what is not known there stays so
        return np.where(valid[:, None], q_nb, np.nan)
    try:
        line = time_line(t_ns[valid])
    except ClockError as error:  # the samples have a clock of their own
        notes.append(warning("reading.attitude_left_out", error=error))
        return None
    notes += (finding.on("attitude") for finding in line.notes)
    attitude = read_rows(line.t_ns, quat_normalize(q_nb[valid]), rows_ns, max_gap=longest_bridged(line.t_ns))
    missing = attitude.outside | attitude.gap
    if missing.all():
        return None
    if not attitude.exact.all():
        notes.append(
            info(
                "source.attitude_interpolated",
                count=line.t_ns.size,
                unknown=int(np.count_nonzero(missing)),
                samples=rows_ns.size,
            )
        )
    return attitude.q_nb


def chosen(names: list[str], unit: str | None) -> str:
    """One of the names, as of `choose`."""
    if unit is None:
        return names[0]
    for alike in (str, _letters):
        for name in names:
            if alike(name) == alike(unit):
                return name
    if unit.isdecimal() and 1 <= int(unit) <= len(names):
        return names[int(unit) - 1]
    listed = ", ".join(f"{name} ({number})" for number, name in enumerate(names[:20], 1))
    raise ParameterError(f"there is no unit '{unit}' in the log; there are {listed}.")


def _letters(name: str) -> str:
    return "".join(letter for letter in name.casefold() if letter.isalnum())


def inside(folder: Path, *parts: str) -> Path:
    """Path of a file in a folder; DecodeError where a link leads out of it."""
    path = folder.joinpath(*parts)
    if not path.resolve().is_relative_to(folder.resolve()):
        raise DecodeError(f"{'/'.join(parts)} leads out of the folder; copy the data set with its files.")
    return path


def text_rows(
    path: Path, columns: int, *, stamps: str = "i8", blanks: str = "", **how: Any
) -> tuple[NDArray[Any], Floats]:
    """Stamps (N,), of a type, and the columns of numbers behind them (N, columns), of a text table.

    `blanks` also stands between cells; `how` is as `numpy.loadtxt` has it. DecodeError without such rows.
    """
    file = existing_file(path, MOST)
    layout = np.dtype([("t", stamps), ("values", "f8", (columns,))])
    try:
        with file.open(encoding="utf-8-sig") as text, warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # no rows, which is said below
            lines = (line.replace(blanks, " ") for line in text) if blanks else text
            rows = np.loadtxt(lines, dtype=layout, usecols=range(1 + columns), ndmin=1, **how)
    except (ValueError, UnicodeDecodeError, OverflowError) as error:
        raise DecodeError(f"{path.name} holds a row that is not {1 + columns} numbers: {one_line(error)}.") from error
    if not rows.size:
        raise DecodeError(f"{path.name} holds no rows; use an intact copy.")
    return rows["t"], rows["values"]
