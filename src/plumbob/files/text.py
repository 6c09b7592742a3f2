"""Text files: read as their profile declares them (units to SI, signs, body axes, references, labels), and written.

A CSV has units in its header, and beside it lies the profile that reads it back to the bit. Of MATLAB and NetCDF, whose
arrays have names and units, `plumbob.files.foreign.tables` writes the same profile into the file.
"""

import codecs
import csv
import math
import shlex
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from decimal import Decimal
from fnmatch import fnmatch
from fractions import Fraction
from io import StringIO
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core import flags, units
from plumbob.core.check import Floats
from plumbob.core.constants import NOMINAL_FIELD
from plumbob.core.errors import ClockError, DecodeError, ParameterError, UnknownFormatError, excerpt, one_line
from plumbob.core.files import as_list, existing_file, reading, replacing_all, sidecars, text_of
from plumbob.core.findings import Finding, Note, as_findings, info, lasting, warning
from plumbob.core.text import visible
from plumbob.core.time import interpolated, to_ns, to_s
from plumbob.data import TRIADS, AttitudeTrack, ImuData, ImuMeta
from plumbob.data.cards import UNITS
from plumbob.data.imu import BLOCK, known_rows
from plumbob.data.recording import Recording, stored_notes
from plumbob.files.arrow import text_bytes, write_rows
from plumbob.files.columns import COLUMNS, GROUPS, TIME, Columns, StampError, to_columns, to_seconds
from plumbob.files.foreign.logged import NORM, Readings, joined, joined_recordings
from plumbob.files.header import plain_meta
from plumbob.files.profile import (
    AS_MOUNTED,
    EPOCHS,
    NO_COLUMN,
    ColumnRef,
    GroupSource,
    Profile,
    ReferenceSource,
    load_profile,
    profiles_beside,
    toml_lines,
)
from plumbob.files.stamps import CENTURY, WEEK, falls, time_line, utc_of_gps
from plumbob.files.text_table import LEFT_OUT_MOST, MOST_NAMED, TextTable, lines_left_out, read_table
from plumbob.rotations import (
    body_axes,
    in_body_axes,
    quat_conjugate,
    quat_from_dcm,
    quat_from_euler_zyx,
    quat_from_xyzw,
    quat_multiply,
)

_FIRST_LINE_BYTES = 4096
_ROUNDED = 0.01  # how far the norm of a quaternion of two decimals is off 1 at most
_Clock = tuple[Floats, int, tuple[Finding, ...], Floats, float]
"""Times, s, the UTC of the first, ns or 0, what was done to have them, and stamps as they are, with their unit, ns."""
_UPTIME = float(1 << 22)  # 48 days, s: multiples are left out of a clock that began at an unknown instant


def read_text(path: str | Path | Sequence[str | Path], profile: Profile | str | Path | None = None) -> Recording:
    """Read a CSV or TXT file, or several with a sensor each; without a profile, ``NAME.toml`` beside it is taken."""
    files = [existing_file(item) for item in as_list(path)]
    declared, note = text_profile(files[0], profile)
    if declared.arrays:
        raise DecodeError(f"{files[0]} is a text file, but {declared.origin} has arrays = true; declare its separator.")
    if not declared.streams:
        if len(files) > 1:
            raise DecodeError(f"{declared.origin} describes one file, but {len(files)} were given; read each alone.")
        return _read_one(files[0], declared, note)
    parts = []
    for pattern, stream in declared.streams:
        fitting = [file for file in files if fnmatch(file.name, pattern)]
        if len(fitting) != 1:
            raise DecodeError(f"{declared.origin}: {len(fitting)} of the files are named {pattern}, not one.")
        parts.append(_read_one(fitting[0], stream, note))
    return joined_recordings(parts, files[0].stem)


def _read_one(file: Path, declared: Profile, note: Note) -> Recording:
    with reading(file):
        # no name: the columns of a large file are in memory only while they are needed
        return table_recording(
            declared,
            read_table(file, declared.layout, declared.used, declared.time.exact, declared.texts, declared.vectors),
            file.stem,
            note,
        )


def table_recording(profile: Profile, table: TextTable, name: str, note: Note) -> Recording:
    """Recording of a table, whose columns are used up, by its profile; `note` says which. Errors as in `read_text`."""
    table = _without_events(profile, _oldest_first(profile, _with_times(profile, _without_end(profile, table))))
    t, t0_ns, clock, stamps, unit_ns = _time(profile, table)
    track, lost = _track(profile.reference, table, t, profile.turn) if profile.reference else (None, [])
    samples = _imu(profile, table, t, t0_ns, clock) if profile.triads else None
    imu, clock = (None, clock) if samples is None else _in_turns(*samples, stamps, unit_ns)
    changes = (*table.notes, *clock, *lost, *_changes(profile, t0_ns))
    notes = (*lasting(as_findings("notes", profile.notes)), note, *changes)
    return Recording(imu=imu, track=track, name=name, notes=notes)


def _without_end(profile: Profile, table: TextTable) -> TextTable:
    """The same table without rows at its end in which nothing stands, as where longer columns stand beside."""
    if table.texts or not profile.time.columns or not all(np.isnan(v[-1]).all() for v in table.columns.values()):
        return table
    filled = [np.argwhere(~np.isnan(values)) for values in table.columns.values()]
    return table.of_rows(slice(1 + max((int(some[-1, 0]) for some in filled if some.size), default=table.rows - 1)))


def _with_times(profile: Profile, table: TextTable) -> TextTable:
    """The same table without the few rows that lack a time stamp, which a note names; of many, without empty ones."""
    lacks = np.zeros(table.rows, dtype=bool)
    for ref in profile.time.used:
        lacks |= np.isnan(table.columns[ref]) if ref in table.columns else ~_stamped(profile, table, ref)
    if not (count := int(lacks.sum())):
        return table
    if count > LEFT_OUT_MOST * table.rows:
        for values in table.columns.values():
            lacks &= np.isnan(values).reshape(table.rows, -1).all(axis=1)
        return table.of_rows(np.flatnonzero(~lacks)) if lacks.any() else table
    lines = [table.line_of(int(row)) for row in np.flatnonzero(lacks)[:MOST_NAMED]]
    note = lines_left_out(lines, count, table.rows, f"line {lines[0]}: the time stamp is missing")
    return table.of_rows(np.flatnonzero(~lacks), note)


def _stamped(profile: Profile, table: TextTable, ref: ColumnRef) -> NDArray[np.bool_]:
    """Rows (N,) that have a stamp in a column of texts."""
    return np.array([cell.strip() not in profile.layout.missing for cell in table.texts[ref]])


def _oldest_first(profile: Profile, table: TextTable) -> TextTable:
    """The same table, or its rows in the order of time where the newest stands first."""
    source = profile.time
    if source.rate:
        return table
    if source.are_stamps:
        cells = [table.texts[ref] for ref in source.columns]
        try:
            is_back = to_seconds([column[:: table.rows - 1 or 1] for column in cells], source.zone)[0][-1] < 0.0
            is_back = is_back and falls(to_seconds(cells, source.zone)[0])
        except StampError:  # which is said with its line when time is made of them
            return table
    else:
        is_back = falls(table.columns[source.seconds or source.week or source.columns[0]])
    if not is_back:
        return table
    table = table.of_rows(slice(None, None, -1), warning("reading.newest_first"))
    if source.exact is None:
        return table
    first = table.columns[source.exact][0]
    table.columns[source.exact] = table.columns[source.exact] - first
    return replace(table, zero=table.zero + Decimal(float(first)))


def _without_events(profile: Profile, table: TextTable) -> TextTable:
    """The same table without the few rows close to others in which a time alone stands, as of a marker or a blink."""
    empty = np.ones(table.rows, dtype=bool)
    for ref in table.columns.keys() - {*profile.time.used, *((ref,) for ref in profile.time.used)}:
        empty &= np.isnan(table.columns[ref]).reshape(table.rows, -1).all(axis=1)
    if profile.time.rate or not 0 < np.count_nonzero(empty) <= LEFT_OUT_MOST * table.rows:
        return table
    with suppress(ClockError, DecodeError):  # which is said when time is made of them
        steps = np.diff(_time(profile, table)[3])
        close = steps < 0.5 * np.median(steps)
        rows = np.flatnonzero(empty & (np.append(close, False) | np.append(False, close)))
        if rows.size:
            lines = [table.line_of(int(row)) for row in rows[:MOST_NAMED]]
            note = lines_left_out(lines, rows.size, table.rows, f"line {lines[0]}: it has a time and no value")
            return table.of_rows(np.delete(np.arange(table.rows), rows), note)
    return table


def _in_turns(
    imu: ImuData, notes: tuple[Finding, ...], stamps: Floats, unit_ns: float
) -> tuple[ImuData, tuple[Finding, ...]]:
    """Samples on one time line where gyroscope and accelerometer have rows of their own; others as they are.

    Each has the clock that its own stamps give: two rows with one stamp are of one time.
    """
    rows = {name: known_rows(getattr(imu, name)) for name in imu.triads}
    both = rows["gyr"] & rows["acc"] if {"gyr", "acc"} <= set(rows) else np.ones(1, dtype=np.bool_)
    if 2 * np.count_nonzero(both) >= min(map(np.count_nonzero, (rows.get("gyr", both), rows.get("acc", both)))):
        return imu, notes
    t_ns = np.rint(stamps * unit_ns).astype(np.int64)
    streams = {name: Readings(t_ns[valid], getattr(imu, name)[valid]) for name, valid in rows.items()}
    made = joined(streams, meta=imu.meta, epoch_ns=imu.meta.t0_ns or None)
    of_rows = tuple(finding for finding in notes if not finding.code.startswith("reading.clock_"))
    return made.imu, (*of_rows, warning("reading.rows_in_turns"), *made.notes)


def text_profile(file: Path, given: Profile | str | Path | None) -> tuple[Profile, Finding]:
    """Profile that is given or lies beside a text file, and a note that says which; errors as in `read_text`."""
    if isinstance(given, Profile):
        return given, info("source.profile", name=given.origin)
    if given is not None:
        return load_profile(given), info("source.profile", name=Path(given).name)
    profiles = profiles_beside(file)
    if len(profiles) > 1:
        raise DecodeError(
            f"{file}: both {profiles[0].name} and {profiles[1].name} lie beside it; name one: --profile FILE.toml."
        )
    if not profiles:
        with reading(file):
            start = text_bytes(file, _FIRST_LINE_BYTES)
        is_text = b"\0" not in start or start[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
        first = excerpt(start.partition(b"\n")[0].decode("utf-8", "replace").strip())
        raise (UnknownFormatError if is_text else DecodeError)(
            f"{file}: a table does not say its frame and axes, and few say all units, so it needs --profile FILE.toml "
            f"(or {file.stem}.toml beside it); its first line is {first}. plumbob profile {shlex.quote(str(file))} "
            "drafts one, and asks. Plain numbers of a unit at rest are for 'plumbob allan', with --rate and --scale."
        )
    return load_profile(profiles[0]), info("source.profile_beside", name=profiles[0].name)


def _time(profile: Profile, table: TextTable) -> _Clock:
    source = profile.time
    if source.rate:
        places = np.arange(table.rows) if table.places is None else table.places
        t = places / source.rate
        return t, 0, (), t, 1e9
    if source.are_stamps:
        return _of_stamps(profile, table)
    factor = units.unit(source.unit).factor * source.unit_per_count
    nanoseconds = Fraction(factor).limit_denominator(10**9) * 10**9
    stamps = table.columns[source.columns[0]]
    t0_ns = round(Fraction(table.zero) * nanoseconds - Fraction(EPOCHS.get(source.epoch, 0.0)) * 86_400 * 10**9)
    larger = source.seconds if source.week is None else source.week
    if larger is not None:
        counts, is_gps = table.columns[larger], source.week is not None
        raw = (counts - counts[0]) * (WEEK if is_gps else 1) * 1e9 + stamps * 1e9 * factor
        line = time_line(raw, 1.0, table.place)
        first = int(line.t_ns[0])
        start = utc_of_gps(int(counts[0]), first) if is_gps else int(counts[0]) * 10**9 + first
        return (line.t_ns - first) / 1e9, start if is_gps or source.epoch else 0, line.notes, raw - first, 1.0
    first = stamps[0] * factor
    if not source.epoch and first >= _UPTIME and not CENTURY[0] < first < CENTURY[1]:  # no clock that somebody knows
        stamps = stamps - first // _UPTIME * _UPTIME / factor
    if (stamps[1:] > stamps[:-1]).all() and source.unit_per_count == 1.0:
        return inside(stamps, source.unit), t0_ns, (), stamps, 1e9 * factor
    line = time_line(stamps, 1e9 * factor, table.place)
    if np.isnan(stamps).any():
        return line.t_ns / 1e9, t0_ns, line.notes, line.t_ns / 1e9, 1e9
    return line.t_ns / 1e9, t0_ns, line.notes, stamps, 1e9 * factor


def _of_stamps(profile: Profile, table: TextTable) -> _Clock:
    source = profile.time
    rows = np.flatnonzero(np.logical_and.reduce([_stamped(profile, table, ref) for ref in source.columns]))
    try:
        since, t0_ns = to_seconds([[table.texts[ref][row] for row in rows] for ref in source.columns], source.zone)
    except StampError as error:
        raise DecodeError(f"line {table.line_of(int(rows[error.row]))}: {error}") from error
    t = np.full(table.rows, np.nan)
    t[rows] = since
    if (np.diff(t) > 0.0).all():
        return t, t0_ns, (), t, 1e9
    line = time_line(np.rint(t * 1e9), 1.0, table.place)
    return line.t_ns / 1e9, t0_ns, line.notes, t if rows.size == t.size else line.t_ns / 1e9, 1e9


def _imu(
    profile: Profile, table: TextTable, t: Floats, t0_ns: int, notes: tuple[Finding, ...]
) -> tuple[ImuData, tuple[Finding, ...]]:
    triads: dict[str, Any] = {
        name: _undelayed(t, to_vectors(group, table, profile.turn), group.delay)
        for name, group in profile.triads.items()
    }
    if (mag := triads.get("mag")) is not None and 0 < (zeros := int(np.sum(~mag.any(axis=1)))) < len(mag):
        triads["mag"] = np.where(mag.any(axis=1, keepdims=True), mag, np.nan)
        notes = (*notes, warning("reading.mag_zeros", zeros=zeros))
    temperature, time, bits = profile.temperature, profile.time, row_flags(profile, table)
    temp_c = None if temperature is None else inside(table.columns[temperature.columns[0]], temperature.unit)
    table.columns.clear()  # as large as the triads, which nobody else writes to
    for values in triads.values():
        values.flags.writeable = False
    implied = {"rate_nominal": time.rate} if time.rate else {"t0_ns": t0_ns}
    meta = ImuMeta(**{**implied, **profile.meta})
    imu = ImuData(t=t, temp_c=temp_c, flags=bits, meta=meta, **triads)  # type: ignore[arg-type]
    if profile.place is not None:
        from plumbob.data.earth_field import located

        imu = located(imu, profile.place, date=profile.date)[0]
    return imu, notes


def reference_attitudes(source: ReferenceSource, table: TextTable, turn: str | None) -> Floats:
    """Quaternions (N, 4) of a table's reference, wxyz; `turn`: of the profile."""
    q_nb = _stacked(source.columns, table)
    if source.unit is not None:
        q_nb = quat_from_euler_zyx(inside(q_nb, source.unit))
    elif source.order == "xyzw":
        q_nb = quat_from_xyzw(q_nb)
    if turn is not None and source.of == "case":
        q_nb = quat_multiply(q_nb, quat_conjugate(quat_from_dcm(body_axes(turn))))  # q_nb = q_ns ⊗ q_sb
    return q_nb


def _track(source: ReferenceSource, table: TextTable, t: Floats, turn: str | None) -> tuple[AttitudeTrack, list[Note]]:
    """Attitude, unknown where a quaternion among others is not a rotation."""
    q_nb, score, notes = reference_attitudes(source, table, turn), _optional(table, source.score), list[Note]()
    turn = turn if source.of == "case" else None
    norms = np.linalg.norm(q_nb, axis=1)
    off = np.abs(norms - 1.0)
    rounded, wrong = (off > NORM) & (off < _ROUNDED), off >= _ROUNDED
    q_nb[rounded] /= norms[rounded, np.newaxis]
    if 0 < (lost := int(wrong.sum())) < len(wrong) / 2:
        q_nb[wrong] = np.nan
        notes.append(warning("reading.no_rotations", lost=lost, count=len(wrong)))
    return AttitudeTrack(
        t=t,
        q_nb=q_nb,
        frame=source.frame,
        north=source.north,
        bias_b=None if source.bias is None else to_vectors(source.bias, table, turn),
        cov_b=None if source.covariance is None else _covariance(source.covariance, table, turn),
        flags=_optional(table, source.flags),  # type: ignore[arg-type]
        score=None if score is None else np.where(np.isfinite(q_nb).all(axis=1), score, 0.0),
        mag_weight=_optional(table, source.mag_weight),
        source=source.source,
    ), notes


def row_flags(profile: Profile, table: TextTable) -> Floats | NDArray[np.uint32] | None:
    """Flags (N,) of a table's rows; None where it has none."""
    if profile.flags is None or not profile.flag_words:
        return _optional(table, profile.flags)
    cells = table.texts[profile.flags]
    try:
        bits = {cell: flags.of_names(cell.split("+") if cell else ()) for cell in dict.fromkeys(cells)}
    except KeyError as error:
        row = next(i for i, cell in enumerate(cells) if error.args[0] in cell.split("+"))
        raise DecodeError(f"line {table.line_of(row)}: {excerpt(error.args[0])} is not the name of a flag.") from error
    return np.array([bits[cell] for cell in cells], dtype=np.uint32)


def _optional(table: TextTable, ref: ColumnRef | None) -> Floats | None:
    return None if ref is None else table.columns[ref]


def inside(values: Floats, unit: str) -> Floats:
    """Values in the unit used inside."""
    scale = units.unit(unit)
    # What is already in the unit used inside keeps every bit, the sign of zero included.
    return values if (scale.factor, scale.offset) == (1.0, 0.0) else units.to_si(values, unit)


def _stacked(columns: tuple[ColumnRef, ...], table: TextTable) -> Floats:
    if columns in table.columns:
        return table.columns[columns]
    stacked = np.empty((table.rows, len(columns)))
    for at in range(0, table.rows, BLOCK):
        for i, ref in enumerate(columns):
            stacked[at : at + BLOCK, i] = np.nan if ref == NO_COLUMN else table.columns[ref][at : at + BLOCK]
    return stacked


def to_vectors(group: GroupSource, table: TextTable, turn: str | None) -> Floats:
    """Vectors (N, 3) in the unit used inside, in the axes of the case or turned to the body's."""
    counts = _stacked(group.columns, table)
    if group.plus:
        counts = counts + _stacked(group.plus, table)
    if group.zero is not None:
        counts = counts - group.zero
    values = inside(counts if group.unit_per_count == 1.0 else counts * group.unit_per_count, group.unit)
    values = -values if group.gravity else values
    if group.axes != AS_MOUNTED:
        values = in_body_axes(group.axes, values)
    return values if turn is None else in_body_axes(turn, values)


def _undelayed(t: Floats, values: Floats, delay: float) -> Floats:
    """Values (N, 3) at the times of their rows, where they came `delay` late; NaN in a gap of an axis and outside."""
    if delay == 0.0:
        return values
    t_ns, shifted = to_ns(t), np.full_like(values, np.nan)
    for i, valid in enumerate(np.isfinite(values).T):
        if valid.any():
            shifted[valid, i] = interpolated(t_ns[valid] + round(delay * 1e9), t_ns[valid], values[valid, i])
    return shifted


def _covariance(group: GroupSource, table: TextTable, turn: str | None) -> Floats:
    cov = _stacked(group.columns, table).reshape(-1, 3, 3)
    if turn is not None:
        # which sensor axis each body axis is, and its sign; picking spoils no component where another is missing
        c_bs = body_axes(turn)
        place, sign = np.abs(c_bs).argmax(axis=1), c_bs.sum(axis=1)
        cov = cov[:, place][:, :, place] * np.outer(sign, sign)
    factor = units.unit(group.unit).factor
    return cov if factor == 1.0 else cov * factor**2


def _changes(profile: Profile, t0_ns: int) -> tuple[Note, ...]:
    notes: list[Note] = []
    if profile.stamps and not t0_ns and "t0_ns" not in profile.meta:
        notes.append(info("source.no_date"))
    for name, group in profile.triads.items():
        if group.axes != AS_MOUNTED:
            notes.append(info("source.case_axes", name=name, axes=group.axes))
        if group.plus:
            notes.append(info("source.columns_added", name=name, columns=tuple(map(str, group.plus))))
        if group.delay:
            notes.append(info("source.rows_late", name=name, delay_ms=1000.0 * group.delay))
    if any(group.gravity for group in profile.triads.values()):
        notes.append(info("source.acc_negated"))
    if "mag" in profile.triads and profile.triads["mag"].unit == "relative":
        notes.append(info("source.mag_relative", field=NOMINAL_FIELD))
    if profile.turn is not None:
        notes.append(info("source.body_axes", turn=profile.turn))
    return tuple(notes)


SPANS = ("part", "from_s", "to_s")  # columns of a table of spans


def read_labels(path: str | Path, column: ColumnRef, profile: Profile | str | Path | None = None) -> list[str]:
    """Cells of one column, one for each sample of `read_text`; errors as of that, and without such a column."""
    file = existing_file(path)
    declared = text_profile(file, profile)[0]
    with reading(file):
        texts = (*declared.texts, column)
        table = read_table(file, declared.layout, (*declared.used, column), None, texts)
        return [cell.strip() for cell in table.texts[column]]


def read_loads(path: str | Path, columns: Sequence[ColumnRef], profile: Profile | str | Path | None = None) -> Floats:
    """Numbers (N, K) of further columns, as throttle or current, NaN where a cell is empty; as `read_labels`."""
    try:
        return np.array([[float(cell or "nan") for cell in read_labels(path, ref, profile)] for ref in columns]).T
    except ValueError as error:
        raise DecodeError(f"{path}: the columns {', '.join(map(str, columns))} must hold numbers: {error}.") from error


def read_rows(path: str | Path, needed: Sequence[str], more: Sequence[str] = ()) -> list[dict[str, Any]]:
    """Rows of a CSV file that has the `needed` columns, and all or none of some `more`: numbers, but for ``part``.

    DecodeError where it has not, a cell holds none, or a row does not go from ``from_s`` to a later ``to_s``.
    """
    text = text_of(path)
    with reading(Path(path)):
        table = csv.DictReader(StringIO(text, newline=""), skipinitialspace=True, strict=True)
        try:
            columns = [name.strip() for name in table.fieldnames or ()]
            if {*columns} - {*more} != {*needed} or len({*columns} & {*more}) not in (0, len(more)):
                also = f", and all or none of {', '.join(more)}" if more else ""
                has = ", ".join(columns) or "none"
                raise DecodeError(f"line 1: the columns must be {', '.join(needed)}{also}, but they are {has}.")
            table.fieldnames = columns
            return [_checked_row(row, f"line {table.line_num}") for row in table]
        except csv.Error as error:
            raise DecodeError(f"it is not a CSV file: {one_line(error)}.") from error


def _checked_row(row: dict[Any, Any], where: str) -> dict[str, Any]:
    values: dict[str, Any] = {"part": row.pop("part").strip()} if "part" in row else {}
    for name, cell in row.items():
        try:
            values[name] = float(cell or "")
        except (TypeError, ValueError):
            words = f"{where}: {name or 'a column too many'} must be a number"
            raise DecodeError(f"{words}, but it is {excerpt(str(cell))}.") from None
    span = values["from_s"], values["to_s"]
    if not all(math.isfinite(values[name]) for name in row) or not span[0] < span[1]:
        raise DecodeError(f"{where}: numbers must be finite, and from_s before to_s, but they are {span}.")
    return values


def read_spans(path: str | Path) -> dict[str, tuple[float, float]]:
    """Spans of time by name, s, from a CSV file with the columns `SPANS`; errors as of `read_rows`."""
    rows = read_rows(path, SPANS)
    spans = {row["part"]: (row["from_s"], row["to_s"]) for row in rows}
    if len(spans) < len(rows):
        raise DecodeError(f"{path}: a part comes twice among {', '.join(row['part'] for row in rows)}.")
    return spans


_FORMULA: Final = ("=", "+", "-", "@")
ARRAY_NAMES: Final = {"q": "q_nb", "bias": "bias_b", "cov": "cov_b"}  # tables of groups among named arrays
_PLACES: Final = (
    dict(zip(COLUMNS, COLUMNS, strict=True))
    | {
        name: f"{ARRAY_NAMES.get(group, group)}[{k}]"
        for group, names in GROUPS.items()
        for k, name in enumerate(names, 1)
    }
    | {TIME: "time"}
)


def write_csv(path: Path, recording: Recording, overwrite: bool = False) -> None:
    """Write ``NAME.csv`` and ``NAME.profile.toml``; errors as of `plumbob.write`, and beside another profile."""
    columns = columns_of_unit(path, recording)
    other, profile = sidecars(path)
    if other.exists():
        raise DecodeError(f"{path} would have two profiles, {other.name} and {profile.name}; choose another name.")
    # The profile takes its name first: alone it reads nothing, where a table alone would be read by guess.
    with replacing_all(profile, path, overwrite=overwrite) as (profile_file, csv_file):
        profile_file.write_bytes(table_profile(recording, columns).encode("utf-8", "replace"))
        numbers = {name: v.astype(np.uint8) if v.dtype == bool else v for name, v in columns.items()}
        numbers[TIME] = to_s(columns[TIME])
        write_rows(csv_file, "".join(f"{line}\n" for line in _head(path, recording, columns)), numbers)


def columns_of_unit(path: Path, recording: Recording) -> Columns:
    """Columns of a recording of one unit; ParameterError if there are several."""
    if recording.array is not None:
        raise ParameterError(
            f"{path}: such a file holds one unit, and there are {', '.join(recording.array.names)}. Write .parquet "
            "instead, or choose one with --unit."
        )
    return to_columns(recording)


def text_cell(text: str) -> str:
    """Cell that neither a spreadsheet nor a terminal takes for a command, on one line, quoted where it must be."""
    words = visible(" ".join(text.split()))
    cell = f"'{words}" if words.startswith(_FORMULA) else words
    return '"' + cell.replace('"', '""') + '"' if any(sign in cell for sign in ',;\t"') else cell


def _head(path: Path, recording: Recording, columns: Columns) -> Iterator[str]:
    yield f"# recording,{text_cell(recording.name or path.stem)}"
    if recording.imu is not None:
        yield f"# device,{text_cell(recording.imu.meta.device)}"
    for note in stored_notes(recording):
        yield f"# note,{text_cell(str(note))}"
    yield ",".join(_title(name) for name in columns)


def _title(name: str) -> str:
    if name == TIME:
        return "t [s]"
    unit = COLUMNS[name].unit
    return name if unit == "1" else f"{name} [{unit}]"


def table_profile(recording: Recording, columns: Columns, *, arrays: bool = False) -> str:
    """Profile that reads columns back: from a CSV file, or from the named arrays that they are in."""
    imu, track, names = recording.imu, recording.track, _PLACES if arrays else {name: _title(name) for name in COLUMNS}
    listed = {group: [names[name] for name in of] for group, of in GROUPS.items()}
    layout = {"arrays": True} if arrays else {"separator": ",", "comment": "#", "rows": columns[TIME].size}
    top: dict[str, Any] = {"format_version": 1, **layout}
    tables: dict[str, dict[str, Any]] = {"": top} | ({} if arrays else {"header": {"names": True}})
    tables["time"] = {"column": names[TIME], "unit": "s"}
    if imu is not None:
        meta = plain_meta(imu.meta)
        top |= {"device": meta.device, "axes": meta.axes, "axes_applied": True, "t0_ns": meta.t0_ns}
        keys = ("unit_check", "frame", "north", "calibration", *(f"{name}_left" for name in TRIADS))
        top |= {key: getattr(meta, key) for key in keys}
        for key, unit in (("declination", "rad"), ("rate_nominal", "Hz")):
            top[key] = _sized(getattr(meta, key), unit)
        for name in imu.triads:
            full_scale = _sized(getattr(meta, f"{name}_range"), UNITS[name])
            tables[name] = {"columns": listed[name], "unit": UNITS[name], "range": full_scale}
            tables[name] |= {"sign": "specific-force"} if name == "acc" else {}
        if "temp_c" in columns:
            tables["temperature"] = {"column": names["temp_c"], "unit": "degC"}
        tables["flags"] = {"column": "flags"}
    top["notes"] = stored_notes(recording)
    if track is not None:
        reference = {"columns": listed["q"], "order": "wxyz", "frame": track.frame, "north": track.north}
        beside = {"flags": "track_flags", "score": "score", "mag_weight": "mag_weight"}
        tables["reference"] = reference | {"source": track.source}
        tables["reference"] |= {key: name for key, name in beside.items() if name in columns}
        if track.bias_b is not None:
            tables["reference.bias"] = {"columns": listed["bias"], "unit": UNITS["gyr"]}
        if track.cov_b is not None:
            tables["reference.covariance"] = {"columns": listed["cov"], "angle_unit": "rad"}
    head = f"# Reads the {'arrays' if arrays else 'CSV file'} of the same name. SI and radians, uT, degC."
    return "\n".join([head, *toml_lines(tables), ""])


def _sized(size: Any, unit: str) -> Any:
    """Sizes with their unit, as a profile has them; None for none."""
    if isinstance(size, tuple):
        return [_sized(axis, unit) for axis in size]
    return None if size is None else f"{size!r} {unit}"
