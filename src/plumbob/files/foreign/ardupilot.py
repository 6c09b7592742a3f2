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
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core import units
from plumbob.core.findings import Note, info, warning
from plumbob.data import ImuMeta
from plumbob.data.recording import Recording
from plumbob.files.foreign import logged, mavlink
from plumbob.files.foreign.logged import SensorLog, Table, array_recording, choose, micro, of_vehicle, vectors
from plumbob.files.known_logs import KNOWN_TABLES
from plumbob.files.stamps import utc_of_gps
from plumbob.rotations import Frame
from plumbob.rotations.quaternions import quat_from_euler_zyx

ALL: Final = "all"
_HEAD: Final = b"\xa3\x95"
_FMT, _FMT_LENGTH = 128, 89
_TEXT: Final = b"FMT,"
_LETTERS: Final[Mapping[str, tuple[str, float]]] = KNOWN_TABLES["dataflash"]  # type and multiplier
_WANTED: Final = frozenset(("IMU", "IMU2", "IMU3", "MAG", "MAG2", "MAG3", "ATT", "XKQ", "XKQ1", "NKQ1", "GPS", "PARM"))
_QUATERNIONS: Final = ("XKQ", "XKQ1", "NKQ1")
_TEXTS: Final = "nNZa"


@dataclass
class _DataFlashLog:
    """Layouts by name, and values of the wanted messages."""

    names: dict[int, str] = field(default_factory=dict)
    columns: dict[str, tuple[str, tuple[str, ...]]] = field(default_factory=dict)
    tables: dict[str, dict[str, NDArray[Any]]] = field(default_factory=dict)
    notes: list[Note] = field(default_factory=list)


def accepts(path: Path) -> bool:
    """Whether a file is a DataFlash log by its first message, or telemetry by its first packet."""
    start = logged.first_bytes(path)
    return mavlink.starts(start) if path.suffix.lower() == ".tlog" else start.startswith((_HEAD, _TEXT))


def read(path: Path, unit: str | None = None) -> Recording:
    """Read samples and ArduPilot's attitude; a unit is one of its IMUs, by the name in the note, or ``all``."""
    if path.suffix.lower() == ".tlog":
        return mavlink.recording(path.read_bytes(), path.stem, unit)
    is_binary = logged.first_bytes(path).startswith(_HEAD)
    return _recording(_of_bytes(path.read_bytes()) if is_binary else _of_text(path), path.stem, unit)


def _of_bytes(raw: bytes) -> _DataFlashLog:
    """One walk along the messages: two bytes of head, a type, and as many bytes as its FMT says."""
    log, bodies, lengths = _DataFlashLog(), dict[int, bytearray](), {_FMT: _FMT_LENGTH}
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
            log.notes.append(warning("reading.cut_message"))
            break
        if kind == _FMT:
            _defined(log, raw[at + 3 : at + _FMT_LENGTH], lengths, bodies)
        elif kind in bodies:
            bodies[kind] += raw[at + 3 : at + length]
        at += length
    if skipped:
        log.notes.append(warning("reading.damage_bytes", skipped=skipped))
    for kind, body in bodies.items():
        if body:
            _decoded(log, log.names[kind], body, lengths[kind] - 3)
    return log


def _defined(log: _DataFlashLog, body: bytes, lengths: dict[int, int], bodies: dict[int, bytearray]) -> None:
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
        bodies[kind] = bytearray()


def _decoded(log: _DataFlashLog, name: str, body: bytearray, length: int) -> None:
    """Columns of one kind of message, of `length` bytes each, with their multipliers."""
    letters, columns = log.columns[name]
    try:
        layout = np.dtype([(column, _LETTERS[letter][0]) for letter, column in zip(letters, columns, strict=True)])
    except (ValueError, KeyError, TypeError):
        log.notes.append(warning("reading.damage_definition", name=name, count=len(body) // length))
        return
    if layout.itemsize != length:
        needed = layout.itemsize + len(_HEAD) + 1
        log.notes.append(warning("reading.damage_definition_size", name=name, length=length + 3, needed=needed))
        return
    table = np.frombuffer(body, layout)
    log.tables[name] = {
        column: table[column] if _LETTERS[letter][1] == 1.0 else table[column] * _LETTERS[letter][1]
        for letter, column in zip(letters, columns, strict=True)
    }


def _of_text(file: Path) -> _DataFlashLog:
    """Lines such as ``IMU, 1234, 0.01, …``; ArduPilot's tools write values that carry the multipliers already."""
    log, bad, rows = _DataFlashLog(), 0, dict[str, "array[float]"]()
    words: dict[bytes, int] = {}
    with file.open("rb") as stream:
        for line in iter(lambda: stream.readline(4096), b""):  # none is longer
            name, *values = [part.strip() for part in line.decode("utf-8", errors="replace").split(",")]
            if name in rows:
                try:
                    rows[name].extend(
                        [
                            words.setdefault(value.encode()[:64], len(words)) if letter in _TEXTS else float(value)
                            for letter, value in zip(log.columns[name][0], values, strict=True)
                        ]
                    )
                except ValueError:
                    bad += 1
            elif name == "FMT" and len(values) >= 5 and values[2] in _WANTED and values[2] not in log.columns:
                letters, columns = values[3], tuple(values[4:])
                if len(letters) == len(columns) == len(set(columns)):
                    log.columns[values[2]], rows[values[2]] = (letters, columns), array("d")
    listed = np.array([*words])
    for name, numbers in rows.items():
        if numbers:
            letters, columns = log.columns[name]
            table = np.frombuffer(numbers, np.float64).reshape(-1, len(columns))
            log.tables[name] = {
                column: listed[table[:, i].astype(np.intp)] if letters[i] in _TEXTS else table[:, i]
                for i, column in enumerate(columns)
            }
    if bad:
        log.notes.append(warning("reading.damage_lines", bad=bad))
    return log


def _recording(flash: _DataFlashLog, name: str, unit: str | None) -> Recording:
    parameters, declination = flash.tables.get("PARM", {}), None
    if {"Name", "Value"} <= parameters.keys():  # as logged last, rad (ArduPilot, Complete Parameter List)
        values = parameters["Value"][parameters["Name"] == b"COMPASS_DEC"]
        declination = float(values[-1]) if values.size and abs(float(values[-1])) <= np.pi else None
    meta = ImuMeta(device="ArduPilot", frame=Frame.NED, declination=declination, unit_check=False)
    log = SensorLog(
        [
            "ArduPilot DataFlash: body axes forward, right, down; frame NED; rad/s, m/s², milligauss as µT; clock in "
            "µs since boot (ArduPilot, Onboard Message Log Messages and LogStructure.h)"
        ],
        meta,
        _epoch(flash),
        losses=flash.notes,
    )
    if log.epoch_ns is None:
        log.notes.append(info("source.no_utc_without_fix"))
    imus = _units(flash, "IMU", "GyrX")
    if unit == ALL and len(imus) > 1:
        return _together(imus, log, name)
    if imus:
        counts = {key: _stamps(table).size for key, table in imus.items()}
        taken = choose(log.notes, counts, None if unit == ALL else unit, what="message")
        _inertial(log, imus[taken])
    log.require_gyroscope("IMU messages with GyrX")
    compasses = _units(flash, "MAG", "MagX")
    for compass, table in list(compasses.items())[:1]:
        if {"MagY", "MagZ"} <= table.keys():
            rest = "".join(f", not {other}" for other in compasses if other != compass)
            log.notes.append(info("source.ardupilot_compass", compass=compass, count=_stamps(table).size, rest=rest))
            log.add("mag", _stamps(table), vectors(table, "MagX", "MagY", "MagZ"), "mgauss")
    for kind in (*_QUATERNIONS, "ATT"):
        table = flash.tables.get(kind, {})
        t_ns, q_nb = _stamps(table), None  # body to NED (N, 4), wxyz
        if {"Q1", "Q2", "Q3", "Q4"} <= table.keys():
            q_nb = vectors(table, "Q1", "Q2", "Q3", "Q4")
        elif {"Yaw", "Pitch", "Roll"} <= table.keys():
            q_nb = quat_from_euler_zyx(units.deg(vectors(table, "Yaw", "Pitch", "Roll")))
        if q_nb is not None and t_ns.size:
            first = table["C"] == table["C"].min() if "C" in table else slice(None)
            heading = "counts from true north, as ArduPilot adds the declination"
            log.attitudes.append(of_vehicle(t_ns[first], q_nb[first], kind, "ArduPilot's", heading))
    return log.recording(name, none="attitude: none in the log at the samples' times (XKQ, XKQ1, NKQ1, ATT)")


def _inertial(log: SensorLog, table: Table) -> None:
    """Take rates and specific forces of one unit."""
    for sensor, columns in (("gyr", ("GyrX", "GyrY", "GyrZ")), ("acc", ("AccX", "AccY", "AccZ"))):
        if {*columns} <= table.keys():
            log.add(sensor, _stamps(table), vectors(table, *columns))


def _together(imus: Mapping[str, Table], log: SensorLog, name: str) -> Recording:
    """All units as an array, where ArduPilot logged them on the same stamps."""
    made = {}
    for unit, table in imus.items():
        log.streams.clear()
        _inertial(log, table)
        made[unit] = log.joined()
    omitted = (
        "left out: magnetic field and attitude, which are of none of the units; --unit with the name of one keeps them"
    )
    return array_recording(made, name, [*log.notes, *log.losses, omitted])


def _stamps(table: Table) -> NDArray[np.int64]:
    """Stamps of messages, ns: µs, or ms in logs before 2015; empty where they have none."""
    for column, factor in (("TimeUS", 1), ("TimeMS", 1000)):
        if column in table and table[column].dtype.kind in "iuf":
            stamps = np.clip(np.nan_to_num(table[column].astype(np.float64)), 0.0, 9e15 / factor)
            return micro(stamps.astype(np.uint64) * np.uint64(factor))
    return np.empty(0, np.int64)


def _units(flash: _DataFlashLog, name: str, column: str) -> dict[str, Table]:
    """Messages of each unit of a kind that have stamps and a column."""
    tables: dict[str, Table] = {}
    for kind in (name, f"{name}2", f"{name}3"):
        table = flash.tables.get(kind, {})
        if column not in table or not _stamps(table).size:
            continue
        if "I" not in table:
            tables[kind] = table
            continue
        for instance in np.unique(table["I"]).tolist():
            rows = table["I"] == instance
            tables[f"{kind}.{instance:g}"] = {key: values[rows] for key, values in table.items()}
    return tables


def _epoch(flash: _DataFlashLog) -> int | None:
    """UTC of boot, ns since 1970, by the GPS messages with a 3D fix; half of them agree with the median."""
    table = flash.tables.get("GPS", {})
    t_ns = _stamps(table)
    names = next((pair for pair in (("GWk", "GMS"), ("Week", "TimeMS")) if set(pair) <= table.keys()), None)
    if not t_ns.size or names is None or "Status" not in table:
        return None
    if "TimeMS" in names:  # there TimeMS is the GPS's, and T the boot's, in ms
        if "T" not in table:
            return None
        t_ns = micro(table["T"].astype(np.uint64) * np.uint64(1000))
    week, milli = (table[column].astype(np.int64) for column in names)
    fixes = (table["Status"] >= 3) & (week > 1000) & (milli >= 0) & (milli < 604_800_000)
    if not fixes.any():
        return None
    stamps = zip(week[fixes].tolist(), milli[fixes].tolist(), strict=True)
    utc_ns = np.array([utc_of_gps(number, of_week * 10**6) for number, of_week in stamps])
    return int(np.median(utc_ns - t_ns[fixes]))
