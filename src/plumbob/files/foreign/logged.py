"""What every reader of others' files yields, and the one place where a recording is made of it.

A reader fills a `SensorLog`: the stream of each sensor by its own clock, in the unit that the format says, an attitude
where there is one, what is known besides, and notes. `SensorLog.recording` converts, joins and checks it.

A log that keeps each sensor in a table of its own has no common rows. Rows of all stamps would hold a number of one
sensor and NaN of the others, and no filter could integrate them. Here the gyroscope's stamps are the rows:

- a field or a temperature whose stamps are those of rows, as in one table, has its values there;
- a stream of at least half its rate is interpolated linearly between its two neighbours, where these are not farther
  apart than a gap; one of more than 1.5 times its rate is averaged over each step first, as picking single samples
  would fold its vibration;
- a slower stream keeps its own values, each at the row that is nearest in time; the rows between are NaN, which the
  filters take as 'no new value'.

An attitude that a log holds has stamps of its own. It is brought to the rows of the samples along the shorter arc
between its two neighbours, where these are not farther apart than a gap; elsewhere it is NaN, 'not known'.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.constants import NOMINAL_FIELD
from plumbob.core.errors import ClockError, DecodeError, ParameterError, ShapeError, excerpt, one_line
from plumbob.core.findings import Finding, Note, info, warning
from plumbob.core.text import counted, first_words
from plumbob.core.time import GAP_FACTOR, LONGEST, interpolated, is_gap, longest_bridged
from plumbob.core.units import to_si
from plumbob.data import TRIADS, AttitudeTrack, ImuData, ImuMeta
from plumbob.data.array import ImuArray, named_unit
from plumbob.data.imu import known_rows
from plumbob.data.reading import read_rows
from plumbob.data.recording import Recording
from plumbob.files.profile import ColumnRef
from plumbob.files.stamps import time_line, without_leaps
from plumbob.rotations import Frame, North, quat_normalize

_SLOW, _FAST = 0.5, 1.5


@dataclass(frozen=True, eq=False)
class Readings:
    """What one sensor said, by its own clock."""

    t_ns: NDArray[np.int64]  # stamps (N,), ns, of a clock that all streams of a recording share
    values: Floats  # (N, 3) or (N,), SI: rad/s, m/s², µT, °C; NaN where there is none


class Joined(NamedTuple):
    """Samples on one time line, the stamps of its rows (N,), ns, by the streams' clock, and notes of what was done."""

    imu: ImuData
    rows_ns: NDArray[np.int64]
    notes: tuple[Finding, ...]


def joined(streams: Mapping[str, Readings], *, meta: ImuMeta, epoch_ns: int | None = None) -> Joined:
    """Samples of several sensors on the time line of the gyroscope, or of the fastest where there is none.

    `epoch_ns` is the UTC of the stamp 0, None where it is unknown. ClockError if the time of one begins again.
    """
    ordered, notes = dict[str, tuple[NDArray[np.int64], Floats]](), list[Finding]()
    for name, stream in streams.items():
        ordered[name] = _ordered(name, stream, notes)
    triads = [name for name in TRIADS if name in ordered and ordered[name][0].size]
    if not triads:
        raise ShapeError(f"a recording needs a stream of gyr, acc or mag, but it has {', '.join(streams) or 'none'}.")
    lead = "gyr" if "gyr" in triads else max(triads, key=lambda name: ordered[name][0].size)
    rows = ordered[lead][0]
    columns: dict[str, Any] = {}
    for name, (stamps, values) in ordered.items():
        if not stamps.size:
            notes.append(info("source.no_sample", name=name))
            continue
        columns[name], how = _resampled(name, rows, stamps, values)
        if not np.isfinite(columns[name]).any() and np.isfinite(values).any():
            raise ClockError(
                f"{name} does not overlap {lead} in time: one has stamps from {stamps[0] / 1e9:.6g} to "
                f"{stamps[-1] / 1e9:.6g} s, the other from {rows[0] / 1e9:.6g} to {rows[-1] / 1e9:.6g} s. They are on "
                "clocks that nothing relates; read each alone."
            )
        if how:
            notes.append(info("source.own_stamps", name=name, count=stamps.size, how=how, sensor=lead))
    t0_ns = 0 if epoch_ns is None else int(rows[0]) + epoch_ns
    imu = ImuData(t=(rows - rows[0]) / 1e9, meta=replace(meta, t0_ns=t0_ns), **columns)
    return Joined(imu, rows, tuple(notes))


def joined_recordings(parts: Sequence[Recording], name: str) -> Recording:
    """One recording of sensors that have a file, a topic or rows of their own, by UTC or the clock of their stamps.

    Only rows of the leading sensor between the first and the last sample of the others are kept.
    """
    samples = [part.imu for part in parts if part.imu is not None]
    absolute = all(imu.meta.t0_ns for imu in samples)
    streams: dict[str, Readings] = {}
    ranges: dict[str, Any] = {}
    for imu in samples:
        stamps = imu.t_ns + (imu.meta.t0_ns if absolute else 0)
        for triad in imu.triads:
            if triad in streams:
                raise ShapeError(f"{triad} occurs in two of the parts; leave one out, or read them one by one.")
            streams[triad] = Readings(stamps, getattr(imu, triad))
            ranges[f"{triad}_range"] = getattr(imu.meta, f"{triad}_range")
        if imu.temp_c is not None:
            streams.setdefault("temp_c", Readings(stamps, imu.temp_c))
    begin = max(int(stream.t_ns.min()) for stream in streams.values())
    end = min(int(stream.t_ns.max()) for stream in streams.values())
    if begin >= end:
        raise ClockError(
            f"the sensors do not overlap in time: one begins {(begin - end) / 1e9:.6g} s after another has ended. "
            "They are of different recordings, or on clocks that nothing relates."
        )
    together = joined(streams, meta=replace(samples[0].meta, **ranges), epoch_ns=0 if absolute else None)
    dense = [
        known_rows(getattr(together.imu, name)) for name in ("gyr", "acc") if getattr(together.imu, name) is not None
    ]
    first, last = np.flatnonzero(np.logical_and.reduce(dense) if dense else together.rows_ns >= begin)[[0, -1]]
    imu = together.imu[int(first) : int(last) + 1]
    t0_ns = int(together.rows_ns[first]) if absolute else 0
    imu = replace(imu, t=imu.t - imu.t[0], meta=replace(imu.meta, t0_ns=t0_ns))
    notes = dict.fromkeys((*(note for part in parts for note in part.notes), *together.notes))
    return Recording(imu=imu, name=name, notes=tuple(notes))


def _ordered(name: str, stream: Readings, notes: list[Finding]) -> tuple[NDArray[np.int64], Floats]:
    """Stamps that increase, with their values, and a note where they had to be made so."""
    stamps = np.asarray(stream.t_ns, dtype=np.int64)
    values = np.asarray(stream.values, dtype=np.float64)
    if stamps.ndim != 1 or values.shape[:1] != stamps.shape:
        raise ShapeError(f"{name} has values {values.shape} for stamps {stamps.shape}; each stamp needs one row.")
    if not stamps.size:
        return stamps, values
    stamps, leaps = without_leaps(stamps)
    if leaps:
        notes.append(warning("reading.clock_leaps", count=leaps).on(name))
    if (span := (int(stamps.max()) - int(stamps.min())) / 1e9) >= LONGEST:
        raise ClockError(
            f"{name}: its stamps span {span:.4g} s, but a recording has {LONGEST:.0f} s at most; some "
            "stamps are wrong, or they are not in the unit that the format says."
        )
    line = time_line(stamps)
    notes += (finding.on(name) for finding in line.notes)
    return line.t_ns, values


def _resampled(name: str, rows: NDArray[np.int64], stamps: NDArray[np.int64], values: Floats) -> tuple[Floats, str]:
    """Values at the rows, and how they came there; nothing where the stamps are the same."""
    if np.array_equal(rows, stamps):
        return values, ""
    place = np.minimum(np.searchsorted(rows, stamps), rows.size - 1)
    if name not in ("gyr", "acc") and np.array_equal(rows[place], stamps):
        sampled = np.full((rows.size, *values.shape[1:]), np.nan)
        sampled[place] = values
        return sampled, "each kept as it is"
    step, spacing = _step(rows), _step(stamps)
    if spacing * _SLOW > step:
        return _nearest(rows, stamps, values, step), "each at the nearest row"
    averaged = step > spacing * _FAST
    return (
        interpolated(rows, stamps, _averaged(stamps, values, step, spacing) if averaged else values),
        f"{'averaged over a step and ' if averaged else ''}interpolated linearly",
    )


def _step(stamps: NDArray[np.int64]) -> float:
    """Median step, ns."""
    return float(np.median(np.diff(stamps))) if stamps.size > 1 else np.inf


def _nearest(rows: NDArray[np.int64], stamps: NDArray[np.int64], values: Floats, step: float) -> Floats:
    """Each value at the row nearest in time, not farther than a gap's worth of rows; the last one of a row counts."""
    sampled = np.full((rows.size, *values.shape[1:]), np.nan)
    after = np.clip(np.searchsorted(rows, stamps), 0, rows.size - 1)
    before = np.maximum(after - 1, 0)
    place = np.where(np.abs(rows[before] - stamps) <= np.abs(rows[after] - stamps), before, after)
    near = np.abs(rows[place] - stamps) <= GAP_FACTOR * step
    sampled[place[near]] = values[near]
    return sampled


def _averaged(stamps: NDArray[np.int64], values: Floats, step: float, spacing: float) -> Floats:
    """Mean over a window of one step of the rows about each stamp; windows do not cross gaps."""
    width = max(3, 2 * round(step / spacing / 2) + 1)
    means = np.copy(values)
    breaks = np.flatnonzero(is_gap(np.diff(stamps))) + 1
    for start, stop in pairwise([0, *breaks.tolist(), stamps.size]):
        if stop - start >= width:
            windows = np.lib.stride_tricks.sliding_window_view(values[start:stop], width, axis=0)
            means[start + width // 2 : stop - width // 2] = windows.mean(axis=-1)
    return means


def seconds_to_ns(name: str, seconds: ArrayLike) -> NDArray[np.int64]:
    """Integer ns of seconds (N,), which float64 keeps to .24 µs since 1970; ClockError for another number."""
    values = check.column(name, seconds)
    if not np.isfinite(values).all() or np.abs(values).max(initial=0.0) > 9.2e9:
        raise ClockError(f"{name} holds numbers that are not times in seconds; check the column.")
    return np.round(values * 1e9).astype(np.int64)


MOST: Final = 2 << 30  # bytes of a log at most: it is kept in memory while it is searched
_PART: Final = 1 << 14
NORM: Final = 1e-3  # how far off 1 that of a rotation may be
RELATIVE_NOTE: Final = (
    f"mag is in arbitrary units, 1 at the place of calibration, which is taken for {NOMINAL_FIELD:g} µT"
)

Table = Mapping[str, NDArray[Any]]  # columns (N,) of one kind of record, by name


class LoggedAttitude(NamedTuple):
    """An attitude on stamps of its own (M,), ns: body to `frame` (M, 4), wxyz; not known where the norm is not 1."""

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

    def add(self, sensor: str, t_ns: NDArray[np.int64], values: Any, unit: str = "", *, valid: Any = None) -> None:
        """Add a sensor's stream, of rows that are `valid` alone, in a unit or in SI."""
        values = np.asarray(values, dtype=np.float64)
        if valid is not None:
            t_ns, values = t_ns[valid], values[valid]
        self.streams[sensor] = Readings(t_ns, to_si(values, unit) if unit else values)

    def require_gyroscope(self, where: str) -> None:
        """Refuse a log without angular rates, which lead the rows."""
        if "gyr" not in self.streams or not self.streams["gyr"].t_ns.size:
            raise DecodeError(f"it holds no samples of a gyroscope ({where}); log them, or take another file.")

    def joined(self) -> Joined:
        """Samples of all streams on one time line."""
        return joined(self.streams, meta=self.meta, epoch_ns=self.epoch_ns)

    def recording(
        self, name: str, *, none: str = "", flags: Callable[[NDArray[np.int64]], NDArray[np.uint32]] | None = None
    ) -> Recording:
        """Recording of it all; `none` is the note where no attitude is known, `flags` makes those of rows by stamps."""
        if self.attitudes and not self.streams:
            of = self.attitudes[0]
            line = time_line(of.t_ns)
            alone = AttitudeTrack((line.t_ns - line.t_ns[0]) / 1e9, of.q_nb, of.frame, of.north, source=of.source)
            return Recording(track=alone, name=name, notes=(*self.notes, *line.notes, *self.losses))
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
    taken = next(iter(counts)) if unit is None else named_unit([*counts], unit)
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


def numbers_in(words: Sequence[str | bytes], count: int, what: str) -> Floats:
    """So many numbers (count,); DecodeError where that is not what the words are."""
    try:
        numbers = np.array(words, dtype=np.float64)
    except ValueError:
        numbers = np.empty(0)
    if numbers.size != count or not np.isfinite(numbers).all():
        said = excerpt(" ".join(map(str, words)))
        raise DecodeError(
            f"{what} must hold {counted(count, 'number')}, but it holds {counted(len(words), 'word')}: {said}."
        )
    return numbers


def micro(stamps: NDArray[Any]) -> NDArray[np.int64]:
    """Integer ns of µs (N,), as flight controllers count them; what no clock of 64 bit ns holds becomes its end."""
    most = np.iinfo(np.int64).max // 1000
    return np.minimum(stamps.astype(np.uint64), np.uint64(most)).astype(np.int64) * 1000


def _attitude_at(rows_ns: NDArray[np.int64], logged: LoggedAttitude, notes: list[Note]) -> Floats | None:
    """Quaternions at the rows of the samples, NaN where the log has none; None where it has none at all."""
    (t_ns, _), q_nb = without_leaps(logged.t_ns), logged.q_nb
    valid = np.abs(np.sqrt(np.sum(q_nb * q_nb, axis=1)) - 1.0) < NORM
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
        unknown = int(np.count_nonzero(missing))
        count, samples = line.t_ns.size, rows_ns.size
        notes.append(info("source.attitude_interpolated", count=count, unknown=unknown, samples=samples))
    return attitude.q_nb


HEAD_BYTES: Final = 4096  # bytes of a file that are looked at to see what it is


def first_bytes(path: Path, count: int = HEAD_BYTES, at: int = 0) -> bytes:
    """So many bytes of a file, from a place on; none of what is not a regular file."""
    if not path.is_file():
        return b""
    with path.open("rb") as file:
        file.seek(at)
        return file.read(count)


def inside(folder: Path, *parts: str) -> Path:
    """Path of a file in a folder; DecodeError where a link leads out of it."""
    path = folder.joinpath(*parts)
    if not path.resolve().is_relative_to(folder.resolve()):
        raise DecodeError(f"{'/'.join(parts)} leads out of the folder; copy the data set with its files.")
    return path
