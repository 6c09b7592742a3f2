"""Recordings of phone apps: phyphox, Sensor Logger (Kelvin Choi), SensorLog (Bernd Thomas), and plain Android folders.

Body axes are those of the phone: x to the right of the screen, y to its top, z out of it (Android's sensor event
coordinates, which CoreMotion shares). Specific force is what Android calls acceleration: lying face up, z measures +g.
CoreMotion measures the opposite, in g.

- phyphox: seconds of experiment, pauses left out; ``meta/time.csv`` says when it was started and paused (phyphox-docs,
  "Saved states"). Its iOS app turns CoreMotion's sign (ExperimentSensorInput.swift multiplies by -9.81), so both
  platforms write specific force in m/s².
- Sensor Logger: ns since 1970, columns z, y, x (awesome-sensor-logger, UNITS.md, COORDINATES.md, CROSSPLATFORM.md). Its
  Accelerometer is without gravity. On Android TotalAcceleration has it; on iOS it is Accelerometer and Gravity
  together, whose sign is turned unless 'Standardise Units & Frames' was on.
- SensorLog: one row of all sensors for each time of logging, each with a stamp of its own; CoreMotion's signs and g.
- Android folders: columns without names, as `android.hardware.SensorEvent` has the values; the rotation vector is the
  phone's own attitude, device to East-North-Up with magnetic north.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from decimal import Decimal, InvalidOperation
from pathlib import Path, PurePosixPath
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core import units
from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, excerpt
from plumbob.core.findings import Note, info, warning
from plumbob.core.resources import guide
from plumbob.core.time import interpolated
from plumbob.data import ImuMeta
from plumbob.data.recording import Recording
from plumbob.files.columns import has_zone, is_stamp, stamps_ns
from plumbob.files.foreign.logged import LoggedAttitude, Readings, SensorLog, seconds_to_ns, vectors
from plumbob.files.foreign.parts import Parts, Sheet, names_in, records, sheet, small_table, zipfile_like
from plumbob.files.known_logs import KNOWN_TABLES
from plumbob.files.profile import TextLayout
from plumbob.files.stamps import time_line
from plumbob.files.text_table import read_table
from plumbob.rotations import Frame, North, quat_from_xyzw

_TABLES: Final = (".csv", ".txt")
Headers = Mapping[str, tuple[str, ...]]  # names of the columns of each table, none where it is not one


def accepts(path: Path) -> bool:
    """Whether a path holds a recording of a phone app, by the names in it and the first line of its tables."""
    is_candidate = path.is_dir() or path.suffix.lower() in _TABLES or zipfile_like(path)
    return is_candidate and _app_reader(Parts(path)) is not None


def read(path: Path) -> Recording:
    """Read a recording of a phone app: an archive, a folder, or one table."""
    parts = Parts(path)
    app = _app_reader(parts)
    assert app is not None
    return app(parts, {name: names_in(parts.start(name)) for name in _tables(parts)})


def _app_reader(parts: Parts) -> Callable[[Parts, Headers], Recording] | None:
    """Reader of the app that wrote it; None where none is known."""
    if {"record.properties", "accelerometer.txt"} <= set(parts.names):
        return _android
    for name in _tables(parts):
        names = names_in(parts.start(name))
        if names[:2] == _LOGGER_CLOCKS and (PurePosixPath(name).stem in _WANTED or {*"xyz"} <= {*names}):
            return _sensor_logger
        if _SENSORLOG_MARKS & {*names}:
            return _sensorlog
        if _phyphox_triads(name, names):
            return _phyphox
    return None


def _tables(parts: Parts) -> list[str]:
    places = {name: PurePosixPath(name) for name in parts.names}
    return [name for name, at in places.items() if at.suffix.lower() in _TABLES and at.parent.name != "meta"]


def _require_one_place(tables: Mapping[str, Any]) -> None:
    """Refuse tables in several folders: they are several recordings."""
    places = sorted({str(PurePosixPath(name).parent) for name in tables})
    if len(places) > 1:
        raise DecodeError(
            f"it holds tables in {len(places)} folders ({excerpt(', '.join(places))}), which are recordings of their "
            "own; unpack it and read each folder."
        )


def _log(note: str) -> SensorLog:
    return SensorLog([note], ImuMeta(device="phone", frame=Frame.ENU, north=North.MAGNETIC, unit_check=False))


def _recording(parts: Parts, log: SensorLog, device: str) -> Recording:
    """Recording of the streams, without fields of zero."""
    if not {"gyr", "acc", "mag"} & set(log.streams):
        raise DecodeError(f"it holds no gyroscope, accelerometer or magnetometer; {'; '.join(map(str, log.notes))}.")
    log.meta = replace(log.meta, device=device or "phone")
    log.notes.append(info("source.phone_axes"))
    if mag := log.streams.get("mag"):
        measured = np.any(mag.values, axis=1)
        log.add("mag", mag.t_ns, mag.values, valid=measured)
        if zeros := int(np.sum(~measured)):
            log.notes.append(warning("reading.mag_zeros", zeros=zeros))
    return log.recording(parts.path.resolve().stem)


# phyphox --------------------------------------------------------------------------------------------------------------

_PHYPHOX_COLUMN: Final = re.compile(r"(?:(?P<what>.*) )?(?P<axis>[xyz]) \((?P<unit>[^)]*)\)", re.IGNORECASE)
_PHYPHOX_UNITS: Final = {"rad/s": "gyr", "m/s^2": "acc", "m/s²": "acc", "µt": "mag", "μt": "mag", "ut": "mag"}


def _phyphox_triads(name: str, names: tuple[str, ...]) -> list[tuple[str, list[str]]]:
    """Which triads the columns are, with their names; ``"acc?"`` where it is not known whether with gravity.

    None unless all names are as the app writes them: in its units, and axes behind a sensor's name in small letters. An
    experiment may keep its sensors in one table, or name columns plainly and say 'without g' in the table's name.
    """
    if not names or not names[0].endswith(" (s)"):
        return []
    groups: dict[tuple[str, str], dict[str, str]] = {}
    for match in filter(None, map(_PHYPHOX_COLUMN.fullmatch, names[1:])):
        what, axis, kind = match["what"] or "", match["axis"], _PHYPHOX_UNITS.get(match["unit"].lower())
        if kind is None or (what and not axis.islower()):
            return []
        groups.setdefault((what, kind), {})[axis.lower()] = match[0]
    triads, stem = [], PurePosixPath(name).stem
    for (what, kind), axes in groups.items():
        if len(axes) == 3:
            plain = re.match(r"(raw )?acc", (what or stem).lower()) is not None
            plain = plain and re.search("without|linear", f"{what} {stem}".lower()) is None
            triads.append((kind if kind != "acc" or plain else "acc?", [axes[letter] for letter in "xyz"]))
    return triads


def _phyphox(parts: Parts, headers: Headers) -> Recording:
    tables = {name: triads for name, names in headers.items() if (triads := _phyphox_triads(name, names))}
    _require_one_place(tables)
    events = _phyphox_events(parts)
    log = _log("phyphox: rad/s, m/s² with gravity (specific force) and µT, as its columns say")
    log.epoch_ns, notes = 0 if events else None, log.notes
    for name, kind, columns in ((name, *triad) for name, triads in tables.items() for triad in triads):
        if kind == "acc?":
            notes.append(info("source.acceleration_left_out", name=name))
        elif kind in log.streams:
            notes.append(info("source.second_sensor", columns=columns[0], name=name, kind=kind))
        elif table := sheet(name, parts.read(name)).table([clock := headers[name][0], *columns]):
            notes += [note for note in table.notes if note not in notes]
            stamps = seconds_to_ns(name, table.columns[clock])
            if events:  # as UTC, with the pauses that the time of the experiment leaves out
                starts, ahead = np.array(events, dtype=np.int64).T
                stamps += ahead[np.maximum(np.searchsorted(starts, stamps, side="right") - 1, 0)]
            log.add(kind, stamps, vectors(table.columns, *columns))
        else:
            notes.append(info("source.sensor_empty", kind=kind, name=name))
    if others := sorted(headers.keys() - tables):
        notes.append(info("source.left_out", names=excerpt(", ".join(others))))
    paused = f", with {len(events) - 1} of its pauses put back" if len(events) > 1 else ""
    clock = "clock: seconds of the experiment"
    unknown = f"{clock}; without meta/time.csv the start and any pauses are not known"
    notes.append(f"{clock} on UTC by meta/time.csv{paused}" if events else unknown)
    device = dict(row for row in _meta(parts, "device.csv") if len(row) == 2)
    model = " ".join(device[key] for key in ("deviceBrand", "deviceModel") if device.get(key))
    return _recording(parts, log, model)


def _meta(parts: Parts, which: str) -> list[list[str]]:
    """Rows of a table in ``meta``."""
    name = next((name for name in parts.names if f"/{name}".endswith(f"/meta/{which}")), None)
    return [] if name is None else small_table(parts.text(name))


def _phyphox_events(parts: Parts) -> list[tuple[int, int]]:
    """Start and each resume: ns of the experiment, and what UTC is ahead of them, ns."""
    events = []
    for row in records(_meta(parts, "time.csv")):
        if row.get("event") != "START":
            continue
        try:
            experiment, system = (
                round(Decimal(row[key].replace(",", ".")) * 10**9) for key in ("experiment time", "system time")
            )
        except (KeyError, InvalidOperation, OverflowError, ValueError) as error:
            raise DecodeError("meta/time.csv has a START without its times in seconds; export it again.") from error
        if not (0 <= experiment < 10**17 and 0 < system < 9 * 10**18):
            raise DecodeError("meta/time.csv has a START at a time that no clock has; export it again.")
        events.append((experiment, system - experiment))
    return sorted(events)


# Sensor Logger --------------------------------------------------------------------------------------------------------


def _sensor_logger(parts: Parts, headers: Headers) -> Recording:
    headers = {name: names for name, names in headers.items() if names[:2] == _LOGGER_CLOCKS}
    _require_one_place(headers)
    stems = {name: PurePosixPath(name).stem for name in _tables(parts)}
    texts = (parts.text(name) for name in parts.names if PurePosixPath(name).name == "Metadata.csv")
    meta = next(iter(records(small_table(next(texts, "")))), {})
    log = _log("Sensor Logger")
    log.epoch_ns, notes, data = 0, log.notes, dict[str, Readings]()
    for name, names in headers.items():
        if not {*"xyz"} <= {*names} or stems[name] not in _WANTED:
            continue
        if (table := sheet(name, parts.read(name)).table(["time", *"xyz"], "time")) is None:
            notes.append(info("source.part_empty", name=name))
            continue
        notes += table.notes
        stamps = int(table.zero) + np.round(table.columns["time"]).astype(np.int64)
        data[stems[name]] = Readings(stamps, vectors(table.columns, *"xyz"))
    for kind, title, unit in (("gyr", "Gyroscope", "rad/s"), ("mag", "Magnetometer", "µT")):
        for stem in [stem for stem in (title, f"{title}Uncalibrated") if stem in data][:1]:
            log.streams[kind] = data[stem]
            notes.append(info("source.logger_part", kind=kind, stem=stem, unit=unit))
    if force := _logger_force(data, meta, notes):
        log.streams["acc"] = force
    notes.append(info("source.clock_of_phone"))
    if others := sorted({*stems.values()} - {*_WANTED, "Metadata"}):
        notes.append(info("source.left_out", names=tuple(others)))
    return _recording(parts, log, meta.get("device name", ""))


_LOGGER_CLOCKS: Final = ("time", "seconds_elapsed")
_WANTED: Final = (
    *(f"{sensor}{kind}" for sensor in ("Gyroscope", "Magnetometer", "Accelerometer") for kind in ("", "Uncalibrated")),
    *("TotalAcceleration", "Gravity"),
)


def _logger_force(data: Mapping[str, Readings], meta: Mapping[str, str], notes: list[Note]) -> Readings | None:
    """Specific force, by the rule of the platform."""
    platform = meta.get("platform", "").strip().lower()
    if "TotalAcceleration" in data and platform != "ios":  # only Android has it [UNITS.md]
        notes.append(info("source.logger_total"))
        return data["TotalAcceleration"]
    user, gravity, raw = (data.get(stem) for stem in ("Accelerometer", "Gravity", "AccelerometerUncalibrated"))
    if user and not (gravity or raw):
        notes.append(warning("source.no_gravity"))
    if not (raw or (user and gravity)):
        return None
    sign, why = _logger_sign(platform, meta)
    if user and gravity:
        notes.append(info("source.logger_with_gravity", why=why))
        field = gravity.values
        if not np.array_equal(user.t_ns, gravity.t_ns):
            field = interpolated(user.t_ns, time_line(gravity.t_ns).t_ns, field)
        return Readings(user.t_ns, sign * (user.values + field))
    assert raw
    unit = "g" if sign < 0.0 else "m/s2"
    notes.append(info("source.logger_uncalibrated", unit=unit, why=why))
    return Readings(raw.t_ns, sign * units.to_si(raw.values, unit))


def _logger_sign(platform: str, meta: Mapping[str, str]) -> tuple[float, str]:
    """What acceleration is multiplied by to be specific force, and why."""
    if platform == "android":
        return 1.0, ""
    mode = meta.get("standardisation", "").strip().lower()
    if platform == "ios" and mode == "true":
        return 1.0, ", in Android's sign, as 'Standardise Units & Frames' was on"
    version = re.match(r"\s*(\d{1,4})\.(\d{1,4})", meta.get("appVersion", ""))
    is_older = not mode and version is not None and (int(version[1]), int(version[2])) < (1, 29)  # no such setting yet
    if platform == "ios" and (mode == "false" or is_older):
        return -1.0, ", negated: on iOS it points down at rest where 'Standardise Units & Frames' is off"
    raise DecodeError(
        f"Metadata.csv does not say the platform (ios or android) and standardisation (true or false): it has "
        f"{platform or 'no platform'} and {mode or 'no standardisation'}. The sign and unit of acceleration depend on "
        f"them; put the Metadata.csv of the export beside the tables. {guide('phones.md')} has the settings."
    )


# SensorLog ------------------------------------------------------------------------------------------------------------

_SENSORLOG: Final[list[tuple[str, str, str, str, float]]] = KNOWN_TABLES["sensorlog"]
"""CoreMotion's accelerometer measures user acceleration and gravity together (developer.apple.com, CMDeviceMotion)."""
_SENSORLOG_MARKS: Final = {"accelerometerAccelerationX(G)", "motionRotationRateX(rad/s)", "gyroRotationX(rad/s)"}


def _sensorlog(parts: Parts, headers: Headers) -> Recording:
    names = [name for name, columns in headers.items() if _SENSORLOG_MARKS & {*columns}]
    if len(names) > 1:
        raise DecodeError(f"it holds {len(names)} tables of SensorLog, each a recording of its own; read one of them.")
    raw = parts.read(names[0]).decode("utf-8-sig", "replace").replace("μ", "µ").encode()
    table = sheet(names[0], raw)
    log = _log("SensorLog (iOS): rad/s and µT; acceleration in g, negated: CoreMotion measures -1 g upwards at rest")
    notes = log.notes
    for kind, sensor, form, unit, sign in _SENSORLOG:
        columns = [column.format(letter) for column in form.split(" + ") for letter in "XYZ"]
        if kind in log.streams or not set(columns) <= set(table.names):
            continue
        stream, began = _sensorlog_stream(table, f"{sensor}Timestamp_sinceReboot(s)", columns, notes)
        if stream is None or (kind == "mag" and not np.any(stream.values)):
            notes.append(info("source.columns_empty", kind=kind, columns=columns[0]))
            continue
        log.epoch_ns = began if log.epoch_ns is None else log.epoch_ns
        log.add(kind, stream.t_ns, sign * stream.values, unit)
        notes.append(info("source.sensorlog_form", kind=kind, form=form.format("X, Y, Z")))
    notes.append(info("source.sensorlog_clock"))
    if any(name.startswith("motionQuaternion") for name in table.names):
        notes.append(info("source.sensorlog_attitude"))
    return _recording(parts, log, "iPhone")


def _sensorlog_stream(
    log: Sheet, stamp: str, columns: list[str], notes: list[Note]
) -> tuple[Readings | None, int | None]:
    """Samples of one sensor, each once: a row repeats what has not changed since the row before."""
    logged = "loggingTime(txt)"
    stamp = next((name for name in (stamp, *log.names) if name in log.names and name.endswith("Reboot(s)")), stamp)
    stamped, texts = stamp in log.names, [logged] if logged in log.names else []
    if not stamped and not texts:
        raise DecodeError(f"{log.title} has neither {stamp} nor {logged}, so {columns[0]} has no time.")
    table = log.table([*([stamp] if stamped else []), *columns, *texts], texts=texts)
    if table is None:
        return None, None
    notes += [note for note in table.notes if note not in notes]
    values = np.sum([vectors(table.columns, *columns[at : at + 3]) for at in range(0, len(columns), 3)], axis=0)
    valid = np.isfinite(values).all(axis=1)
    cells = table.texts.get(logged, [])
    if not stamped:
        times, absolute = stamps_ns(cells, None)
        return Readings(np.array(times, dtype=np.int64)[valid], values[valid]), 0 if absolute else None
    valid &= np.isfinite(table.columns[stamp])
    valid[1:] &= np.diff(table.columns[stamp]) != 0.0
    if not valid.any():
        return None, None
    stamps = seconds_to_ns(stamp, table.columns[stamp][valid])
    first = cells[int(np.argmax(valid))] if cells else ""
    if not (is_stamp(first) and has_zone(first)):
        return Readings(stamps, values[valid]), None
    return Readings(stamps, values[valid]), stamps_ns([first], None)[0][0] - int(stamps[0])


# Android --------------------------------------------------------------------------------------------------------------

_ANDROID: Final[Mapping[str, list[str]]] = KNOWN_TABLES["android"]
_BLANKS: Final = TextLayout(separator=" ", names=False, missing=("NaN",))
ATTITUDE_SOURCE: Final = "the phone's own rotation vector (Android), which is an estimate and not a reference"


def _android(parts: Parts, headers: Headers) -> Recording:
    properties = dict(re.findall(r"^\s*(\w+)\s*=\s*(.*?)\s*$", parts.text("record.properties"), re.MULTILINE))
    log = _log("Android sensor events: rad/s, m/s² (specific force), µT; clock: s since StartTime")
    for kind, stems in _ANDROID.items():
        present = [stem for stem in stems if f"{stem}.txt" in parts.names]
        if present:
            log.add(kind, *_android_stream(parts, present[0], 3, log.notes))
            log.notes.append(info("source.android_part", kind=kind, file=present[0]))
    start = properties.get("StartTime", "")
    log.epoch_ns = int(start) * 10**9 if re.fullmatch(r"[1-9]\d{0,9}", start) else None
    if "rotation-vector.txt" in parts.names:
        stamps, xyzw = _android_stream(parts, "rotation-vector", 4, log.notes)
        note = f"{ATTITUDE_SOURCE}; East-North-Up, magnetic north"
        of_phone = LoggedAttitude(stamps, quat_from_xyzw(xyzw), ATTITUDE_SOURCE, Frame.ENU, North.MAGNETIC, note)
        log.attitudes.append(of_phone)
    return _recording(parts, log, " ".join(properties[key] for key in ("Manufacturer", "Model") if properties.get(key)))


def _android_stream(parts: Parts, stem: str, count: int, notes: list[Note]) -> tuple[NDArray[np.int64], Floats]:
    """Stamps and so many values of a table without names."""
    table = read_table(parts.read(f"{stem}.txt"), _BLANKS, range(1, count + 2))
    notes += [finding.on(stem) for finding in table.notes]
    return seconds_to_ns(stem, table.columns[1]), vectors(table.columns, *range(2, count + 2))
