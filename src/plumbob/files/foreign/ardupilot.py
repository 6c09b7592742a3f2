"""Logs of ArduPilot: DataFlash as bytes (``.bin``) and as text (``.log``); telemetry (``.tlog``) is in `mavlink`.

The layout of each message is in the log itself, in its ``FMT`` messages; letters and multipliers are those of
ArduPilot's `libraries/AP_Logger/LogStructure.h`, units those of its page 'Onboard Message Log Messages':

- ``IMU``: body axes forward, right, down; GyrX rad/s, AccX m/s², corrected by ArduPilot's calibration; the navigation
  frame is NED, so at rest and level acc is −g about z;
- ``MAG``: MagX in milligauss, offsets taken off;
- ``XKQ``, ``XKQ1``, ``NKQ1``: quaternion of the filter's first core, body to NED, scalar first; ``ATT``: roll, pitch,
  yaw in degrees. Both are ArduPilot's own estimate from the same sensors, and **not a reference**;
- ``TimeUS`` in µs since boot, in logs before 2015 ``TimeMS``; UTC by the GPS week, less the leap seconds since 1980.

Of several units (``IMU`` and ``IMU2``, or the instances ``IMU.0`` and ``IMU.1``) the first is taken, or the one that is
asked for, and a note lists the others. The magnetometer and the attitude are the same beside each. ``all`` makes an
array of them, as ArduPilot logs them on the same stamps.
"""

from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core import units
from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, ParameterError
from plumbob.core.files import existing_file, reading
from plumbob.core.text import counted
from plumbob.data import AttitudeTrack, ImuMeta
from plumbob.data.array import ImuArray
from plumbob.data.recording import Recording
from plumbob.files.foreign import logged, mavlink
from plumbob.files.foreign.join import Readings, joined
from plumbob.files.stamps import utc_of_gps
from plumbob.rotations import Frame, North
from plumbob.rotations.quaternions import quat_from_euler_zyx

ALL: Final = "all"
_HEAD: Final = b"\xa3\x95"
_FMT, _FMT_LENGTH = 128, 89
_TEXT: Final = b"FMT,"
_LETTERS: Final[dict[str, tuple[str, float]]] = {
    "a": ("(32,)<i2", 1.0),
    "b": ("i1", 1.0),
    "B": ("u1", 1.0),
    "h": ("<i2", 1.0),
    "H": ("<u2", 1.0),
    "i": ("<i4", 1.0),
    "I": ("<u4", 1.0),
    "f": ("<f4", 1.0),
    "g": ("<f2", 1.0),
    "d": ("<f8", 1.0),
    "n": ("S4", 1.0),
    "N": ("S16", 1.0),
    "Z": ("S64", 1.0),
    "c": ("<i2", 0.01),
    "C": ("<u2", 0.01),
    "e": ("<i4", 0.01),
    "E": ("<u4", 0.01),
    "L": ("<i4", 1e-7),
    "M": ("u1", 1.0),
    "q": ("<i8", 1.0),
    "Q": ("<u8", 1.0),
}
"""Type and multiplier of each letter (`LogStructure.h`, 'Format characters in the format string')."""
_WANTED: Final = frozenset(("IMU", "IMU2", "IMU3", "MAG", "MAG2", "MAG3", "ATT", "XKQ", "XKQ1", "NKQ1", "GPS", "PARM"))
_QUATERNIONS: Final = ("XKQ", "XKQ1", "NKQ1")
_LINE: Final = 4096
"""Bytes of a line of text at most."""


@dataclass
class _DataFlashLog:
    """Layouts by name, and values of the wanted messages."""

    names: dict[int, str] = field(default_factory=dict)
    columns: dict[str, tuple[str, tuple[str, ...]]] = field(default_factory=dict)
    tables: dict[str, dict[str, NDArray[Any]]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def accepts(path: Path) -> bool:
    """Whether a file is a DataFlash log by its first message, or telemetry by its first packet."""
    if not path.is_file():
        return False
    with path.open("rb") as stream:
        start = stream.read(512)
    if path.suffix.lower() == ".tlog":
        return mavlink.starts(start)
    return start.startswith((_HEAD, _TEXT))


def read(path: Path, unit: str | None = None) -> Recording:
    """Read samples and ArduPilot's attitude; frames, units and clock are those of this module's description.

    Parameters
    ----------
    path : Path
        The log.
    unit : str, optional
        One of its IMUs, by the name in the note that lists them, or its number from 1; or ``all``.

    Raises
    ------
    DecodeError
        If it is not such a log, is larger than 2 GiB, or holds no gyroscope.
    ParameterError
        If there is no such unit.
    ClockError
        If more than 1 % of its stamps go back.
    """
    file = existing_file(path, logged.MOST)
    with reading(file):
        if not accepts(file):
            raise DecodeError("it begins neither as DataFlash, bytes or text, nor as MAVLink telemetry does.")
        if file.suffix.lower() == ".tlog":
            return mavlink.recording(file.read_bytes(), file.stem, unit)
        with file.open("rb") as stream:
            binary = stream.read(2) == _HEAD
        log = _of_bytes(file.read_bytes()) if binary else _of_text(file)
        return _recording(log, file.stem, unit)


def _of_bytes(raw: bytes) -> _DataFlashLog:
    """One walk along the messages: two bytes of head, a type, and as many bytes as its FMT says."""
    log, places, lengths = _DataFlashLog(), dict[int, "array[int]"](), {_FMT: _FMT_LENGTH}
    at, size, skipped = 0, len(raw), 0
    while at + 3 <= size:
        kind = raw[at + 2]
        length = lengths.get(kind, 0)
        if raw[at] != 0xA3 or raw[at + 1] != 0x95 or not length:
            resumed = raw.find(_HEAD, at + 1)
            resumed = size if resumed < 0 else resumed
            skipped, at = skipped + resumed - at, resumed
            continue
        if at + length > size:
            log.notes.append("cut: the file ends within a message")
            break
        if kind == _FMT:
            _defined(log, raw[at + 3 : at + _FMT_LENGTH], lengths, places)
        elif kind in places:
            places[kind].append(at + 3)
        at += length
    if skipped:
        log.notes.append(f"damage: {counted(skipped, 'byte')} skipped, which are not messages")
    data = np.frombuffer(raw, np.uint8)
    for kind, found_at in places.items():
        _decoded(log, log.names[kind], data, np.frombuffer(found_at, np.int64), lengths[kind])
    return log


def _defined(log: _DataFlashLog, body: bytes, lengths: dict[int, int], places: dict[int, "array[int]"]) -> None:
    """Take a FMT message: type, length, name (4), letters (16), columns (64); the first of a type and a name counts."""
    kind, length = body[0], body[1]
    name, letters, columns = (
        body[a:b].split(b"\0")[0].decode("ascii", errors="replace") for a, b in ((2, 6), (6, 22), (22, 86))
    )
    if kind in lengths or length < 3:
        return
    lengths[kind] = length
    if name in _WANTED and name not in log.columns:
        log.names[kind], log.columns[name] = name, (letters, tuple(columns.split(",")))
        places[kind] = array("q")


def _decoded(log: _DataFlashLog, name: str, data: NDArray[np.uint8], places: NDArray[np.int64], length: int) -> None:
    """Columns of one kind of message, with their multipliers."""
    letters, columns = log.columns[name]
    if not places.size:
        return
    try:
        layout = np.dtype([(column, _LETTERS[letter][0]) for letter, column in zip(letters, columns, strict=True)])
    except (ValueError, KeyError, TypeError):
        log.notes.append(f"damage: the definition of {name} is not one, so its {places.size} messages are left out")
        return
    if layout.itemsize + 3 != length:
        log.notes.append(f"damage: {name} has {length} bytes, but its letters need {layout.itemsize + 3}; left out")
        return
    table = logged.records(data, places, layout)
    log.tables[name] = {
        column: table[column] if _LETTERS[letter][1] == 1.0 else table[column] * _LETTERS[letter][1]
        for letter, column in zip(letters, columns, strict=True)
    }


@dataclass
class _KindRows:
    """Values of the lines of one kind: numbers one after another, and the columns of text."""

    texts: tuple[int, ...]
    numbers: "array[float]" = field(default_factory=lambda: array("d"))
    words: list[tuple[bytes, ...]] = field(default_factory=list)

    def taken(self, values: list[str]) -> bool:
        """Take a line, unless what should be a number is not."""
        try:
            numbers = [float(value) for i, value in enumerate(values) if i not in self.texts]
        except ValueError:
            return False
        self.numbers.extend(numbers)
        if self.texts:
            self.words.append(tuple(values[i].encode() for i in self.texts))
        return True


def _of_text(file: Path) -> _DataFlashLog:
    """Lines such as ``IMU, 1234, 0.01, …``; ArduPilot's tools write values that carry the multipliers already."""
    log, bad, rows = _DataFlashLog(), 0, dict[str, _KindRows]()
    for line in _lines(file):
        name, *values = [part.strip() for part in line.split(",")]
        if name in rows:
            bad += not (len(values) == len(log.columns[name][1]) and rows[name].taken(values))
        elif name == "FMT" and len(values) >= 5 and values[2] in _WANTED and values[2] not in log.columns:
            letters, columns = values[3], tuple(values[4:])
            if len(letters) == len(columns) == len(set(columns)):
                log.columns[values[2]] = (letters, columns)
                rows[values[2]] = _KindRows(tuple(i for i, letter in enumerate(letters) if letter in "nNZa"))
    for name, lines in rows.items():
        columns = log.columns[name][1]
        names = [column for i, column in enumerate(columns) if i not in lines.texts]
        if lines.numbers:
            table = np.frombuffer(lines.numbers, np.float64).reshape(-1, len(names))
            log.tables[name] = {column: table[:, i] for i, column in enumerate(names)}
            for i, place in enumerate(lines.texts):
                log.tables[name][columns[place]] = np.array([words[i] for words in lines.words])
    if bad:
        log.notes.append(f"damage: {counted(bad, 'line')} left out, which do not hold what their FMT says")
    return log


def _lines(file: Path) -> Iterator[str]:
    with file.open("rb") as stream:
        while line := stream.readline(_LINE):
            yield line.decode("utf-8", errors="replace")


def _recording(log: _DataFlashLog, name: str, unit: str | None) -> Recording:
    notes = [
        "ArduPilot DataFlash: body axes forward, right, down; frame NED; rad/s, m/s², milligauss as µT; clock in µs "
        "since boot (ArduPilot, Onboard Message Log Messages and LogStructure.h)"
    ]
    epoch = _epoch(log)
    if epoch is None:
        notes.append("UTC: not known, as no GPS with a fix is in the log")
    declination = _parameter(log, "COMPASS_DEC")  # rad (ArduPilot, Complete Parameter List)
    meta = ImuMeta(
        device="ArduPilot",
        frame=Frame.NED,
        declination=declination if declination is not None and abs(declination) <= np.pi else None,
        unit_check=False,
    )
    imus = _units(log, "IMU", "GyrX")
    if unit == ALL and len(imus) > 1:
        return _together(imus, meta, epoch, name, (*notes, *log.notes))
    streams = dict[str, Readings]()
    if imus:
        taken = logged.chosen(list(imus), unit if unit != ALL else None)
        table, t_ns = imus.pop(taken)
        others = {name: stamps.size for name, (_, stamps) in imus.items()}
        notes.append(logged.others_note(f"samples: {taken}, {counted(t_ns.size, 'message')}", others))
        streams = _inertial(table, t_ns, notes)
    logged.require_gyroscope(streams, "IMU messages with GyrX")
    compasses = _units(log, "MAG", "MagX")
    first, (table, t_ns) = next(iter(compasses.items()), ("", ({}, np.empty(0, np.int64))))
    if {"MagY", "MagZ"} <= table.keys():
        rest = "".join(f", not {other}" for other in compasses if other != first)
        notes.append(f"mag: {first}, {counted(t_ns.size, 'message')}{rest}")
        values = units.to_si(logged.triad(table, "MagX", "MagY", "MagZ"), "mgauss")
        streams["mag"] = logged.stream("mag", t_ns, values, notes)
    imu, rows_ns, how = joined(streams, meta=meta, epoch_ns=epoch)
    notes += how
    track = _attitude(log, rows_ns, imu.t, notes)
    return Recording(imu=imu, track=track, name=name, notes=(*notes, *log.notes))


def _inertial(table: dict[str, NDArray[Any]], t_ns: NDArray[np.int64], notes: list[str]) -> dict[str, Readings]:
    """Rates and specific forces of one unit."""
    return {
        key: logged.stream(key, t_ns, logged.triad(table, *columns), notes)
        for key, columns in (("gyr", ("GyrX", "GyrY", "GyrZ")), ("acc", ("AccX", "AccY", "AccZ")))
        if all(column in table for column in columns)
    }


def _together(
    imus: dict[str, tuple[dict[str, NDArray[Any]], NDArray[np.int64]]],
    meta: ImuMeta,
    epoch: int | None,
    name: str,
    notes: tuple[str, ...],
) -> Recording:
    """All units as an array, where ArduPilot logged them on the same stamps."""
    how: list[str] = []
    made = {key: joined(_inertial(table, t_ns, how), meta=meta, epoch_ns=epoch) for key, (table, t_ns) in imus.items()}
    rows = next(iter(made.values())).rows_ns
    if any(not np.array_equal(joint.rows_ns, rows) for joint in made.values()):
        raise ParameterError(
            "its units have stamps of their own, so that they are not an array; take one with --unit "
            f"{next(iter(made))}."
        )
    how += [f"{unit}: {note}" for unit, joint in made.items() for note in joint.notes]
    omitted = (
        "left out: magnetic field and attitude, which are of none of the units; --unit with the name of one keeps them"
    )
    array = ImuArray({unit: joint.imu for unit, joint in made.items()})
    return Recording(array=array, name=name, notes=(*notes, *dict.fromkeys(how), omitted))


def _stamps(table: dict[str, NDArray[Any]]) -> NDArray[np.int64] | None:
    """Stamps of messages, ns: µs, or ms in logs before 2015."""
    for column, factor in (("TimeUS", 1), ("TimeMS", 1000)):
        if column in table and table[column].dtype.kind in "iuf":
            stamps = np.clip(np.nan_to_num(table[column].astype(np.float64)), 0.0, 9e15 / factor)
            return logged.micro(stamps.astype(np.uint64) * np.uint64(factor))
    return None


def _units(log: _DataFlashLog, name: str, column: str) -> dict[str, tuple[dict[str, NDArray[Any]], NDArray[np.int64]]]:
    """Messages of each unit of a kind, and their stamps."""
    tables: dict[str, tuple[dict[str, NDArray[Any]], NDArray[np.int64]]] = {}
    for kind in (name, f"{name}2", f"{name}3"):
        table = log.tables.get(kind, {})
        t_ns = _stamps(table)
        if t_ns is None or column not in table:
            continue
        if "I" not in table:
            tables[kind] = (table, t_ns)
            continue
        for instance in np.unique(table["I"]).tolist():
            rows = table["I"] == instance
            tables[f"{kind}.{instance:g}"] = ({key: values[rows] for key, values in table.items()}, t_ns[rows])
    return tables


def _parameter(log: _DataFlashLog, name: str) -> float | None:
    """Value of a parameter, as logged last."""
    table = log.tables.get("PARM", {})
    if not {"Name", "Value"} <= table.keys():
        return None
    rows = np.flatnonzero(table["Name"] == name.encode())
    return float(table["Value"][rows[-1]]) if rows.size else None


def _epoch(log: _DataFlashLog) -> int | None:
    """UTC of boot, ns since 1970, by the GPS messages with a 3D fix; half of them agree with the median."""
    table = log.tables.get("GPS", {})
    t_ns = _stamps(table)
    names = next((pair for pair in (("GWk", "GMS"), ("Week", "TimeMS")) if set(pair) <= table.keys()), None)
    if t_ns is None or names is None or "Status" not in table:
        return None
    if "TimeMS" in names:  # there TimeMS is the GPS's, and T the boot's, in ms
        if "T" not in table:
            return None
        t_ns = logged.micro(table["T"].astype(np.uint64) * np.uint64(1000))
    week, milli = (table[column].astype(np.int64) for column in names)
    fixes = (table["Status"] >= 3) & (week > 1000) & (milli >= 0) & (milli < 604_800_000)
    if not fixes.any():
        return None
    stamps = zip(week[fixes].tolist(), milli[fixes].tolist(), strict=True)
    utc_ns = np.array([utc_of_gps(number, of_week * 10**6) for number, of_week in stamps])
    return int(np.median(utc_ns - t_ns[fixes]))


def _attitude(log: _DataFlashLog, rows_ns: NDArray[np.int64], t: Floats, notes: list[str]) -> AttitudeTrack | None:
    """ArduPilot's own estimate on the rows of the samples: a quaternion where it is logged, else angles."""
    for name in (*_QUATERNIONS, "ATT"):
        table = log.tables.get(name, {})
        q_nb = _quaternions(table)
        t_ns = _stamps(table)
        if q_nb is None or t_ns is None:
            continue
        first = table["C"] == table["C"].min() if "C" in table else np.ones(t_ns.size, dtype=bool)
        placed = logged.attitude_at(rows_ns, t_ns[first], q_nb[first], notes)
        if placed is not None:
            return _track(name, placed, t, notes)
    notes.append("attitude: none in the log at the samples' times (XKQ, XKQ1, NKQ1, ATT)")
    return None


def _track(name: str, q_nb: Floats, t: Floats, notes: list[str]) -> AttitudeTrack:
    notes.append(
        f"attitude: {name}, ArduPilot's own estimate from the same sensors, not a reference: a comparison with it "
        "shows agreement, not accuracy; its heading counts from true north, as ArduPilot adds the declination"
    )
    source = f"ArduPilot's own estimate ({name}), not a reference"
    return AttitudeTrack(t=t, q_nb=q_nb, frame=Frame.NED, north=North.TRUE, source=source)


def _quaternions(table: dict[str, NDArray[Any]]) -> Floats | None:
    """Body to NED (N, 4), wxyz."""
    if {"Q1", "Q2", "Q3", "Q4"} <= table.keys():
        return np.column_stack([table[f"Q{i}"] for i in (1, 2, 3, 4)]).astype(np.float64)
    if {"Yaw", "Pitch", "Roll"} <= table.keys():
        return quat_from_euler_zyx(units.deg(logged.triad(table, "Yaw", "Pitch", "Roll")))
    return None
