"""Logs of PX4: ULog, decoded from the format's own definitions, so that no package of PX4 is needed.

The format is that of the PX4 guide, 'ULog File Format', and the topics are those of PX4's message definitions
(`SensorCombined.msg`, `SensorGyro.msg`, `VehicleMagnetometer.msg`, `VehicleAttitude.msg`, `SensorGps.msg`):

- body axes are forward, right, down (FRD), the navigation frame is NED: at rest and level, acc is −g about z;
- rates in rad/s, specific force in m/s², magnetic field in gauss;
- stamps in µs since boot; UTC of boot is known where a GPS topic has both clocks.

The samples are those of `sensor_combined`, the unit that PX4 flew by, in body axes and corrected by its calibration.
Each of its IMUs has instances of its own, of which one can be asked for, as ``vehicle_imu.1`` or ``sensor_gyro.1``:

- `vehicle_imu`: increments over a time that each record says (`VehicleImu.msg`), in body axes and corrected, too; rates
  and specific forces are their means;
- `sensor_gyro` and `sensor_accel` as the board gave them, in its axes. A gyroscope and an accelerometer belong together
  whose device identities are the same, or name one bus and address (PX4 guide, Driver Development, Device IDs).

Where a log has no `sensor_combined`, the instance with most records is taken. The attitude beside them is
`vehicle_attitude`: PX4's own estimate from the same sensors, and **not a reference**.
"""

import struct
from array import array
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core import units
from plumbob.core.errors import DecodeError, excerpt
from plumbob.core.files import existing_file, reading
from plumbob.core.text import counted
from plumbob.data import AttitudeTrack, ImuMeta
from plumbob.data.recording import Recording
from plumbob.files.foreign import logged
from plumbob.files.foreign.join import Readings, joined
from plumbob.rotations import Frame, North

_MAGIC: Final = b"ULog\x01\x12\x35"
_HEAD: Final = 16
_SYNC: Final = b"\x08\x00S\x2f\x73\x13\x20\x25\x0c\xbb\x12"
"""A whole message of type S, with its header: where a reader finds its way again."""
_KINDS: Final = frozenset(b"BFIMPQARDLCSO")
_BASIC: Final = {
    "int8_t": "i1",
    "uint8_t": "u1",
    "int16_t": "<i2",
    "uint16_t": "<u2",
    "int32_t": "<i4",
    "uint32_t": "<u4",
    "int64_t": "<i8",
    "uint64_t": "<u8",
    "float": "<f4",
    "double": "<f8",
    "bool": "i1",
    "char": "i1",
}
_LONGEST_RECORD: Final = 0xFFFF
_CHAIN, _REACH = 8, 70_000
"""So many headers in a row are taken for the log's own again, and so far they are looked for: a message is shorter."""
_UNKNOWN_STAMP: Final = 0x7FFFFFFF
"""`RELATIVE_TIMESTAMP_INVALID` of `SensorCombined.msg`: no new acceleration."""
_MOST_FORMATS: Final = 10_000
_BUS: Final = 0xFFFF
"""Bits of a device identity that are its bus type, bus and address; the rest is the type of the device."""
_NEEDED: Final = {
    "sensor_combined": ("timestamp", "gyro_rad", "accelerometer_m_s2"),
    "vehicle_imu": ("timestamp", "delta_angle", "delta_velocity", "delta_angle_dt", "delta_velocity_dt"),
    "sensor_gyro": ("timestamp", "x", "y", "z"),
}
"""Topics that samples are of, and what they must have."""
_WANTED: Final = frozenset(
    (
        "sensor_combined",
        "vehicle_imu",
        "sensor_gyro",
        "sensor_accel",
        "sensor_mag",
        "vehicle_magnetometer",
        "vehicle_attitude",
        "vehicle_gps_position",
        "sensor_gps",
    )
)


@dataclass
class _UlogHead:
    """What a log says about itself, and where its records of each topic begin."""

    raw: bytes
    formats: dict[str, list[tuple[str, int, str]]] = field(default_factory=dict)
    info: dict[str, Any] = field(default_factory=dict)
    topics: dict[int, tuple[str, int]] = field(default_factory=dict)
    places: dict[tuple[str, int], "array[int]"] = field(default_factory=dict)
    ends: dict[tuple[str, int], "array[int]"] = field(default_factory=dict)
    dropouts: list[int] = field(default_factory=list)
    skipped: int = 0
    cut: bool = False
    short: int = 0

    def instances(self, name: str) -> list[int]:
        """Instances of a topic that has records."""
        return sorted(instance for topic, instance in self.places if topic == name)


def accepts(path: Path) -> bool:
    """Whether a file begins as a ULog does."""
    if not path.is_file():
        return False
    with path.open("rb") as stream:
        return stream.read(len(_MAGIC)) == _MAGIC


def read(path: Path, unit: str | None = None) -> Recording:
    """Read samples and PX4's attitude; frames, units and clock are those of this module's description.

    Parameters
    ----------
    path : Path
        The log.
    unit : str, optional
        One of its IMUs, by the name in the note that lists them, or its number from 1.

    Raises
    ------
    DecodeError
        If it is not a ULog, is larger than 2 GiB, or holds no gyroscope.
    ParameterError
        If there is no such unit.
    ClockError
        If more than 1 % of its stamps go back.
    """
    file = existing_file(path, logged.MOST)
    with reading(file):
        if not accepts(file):
            raise DecodeError("it does not begin as a ULog does; copy the log from the controller again.")
        raw = file.read_bytes()
        return _recording(_scanned(raw), np.frombuffer(raw, np.uint8), file.stem, unit)


def _scanned(raw: bytes) -> _UlogHead:
    """One walk along the messages."""
    log = _UlogHead(raw)
    at, size = _HEAD, len(raw)
    appended = _appended(raw)
    while at + 3 <= size:
        while appended and at >= appended[0]:
            appended.pop(0)
        length, kind = raw[at] | raw[at + 1] << 8, raw[at + 2]
        end = at + 3 + length
        if appended and end > appended[0]:  # the log before a crash is cut there, and the saved rest follows
            at = appended.pop(0)
        elif kind not in _KINDS:
            at = _resynced(log, at)
        elif end > size:
            resumed = _resynced(log, at)
            log.cut |= resumed >= size
            at = resumed
        else:
            if kind == 0x44:  # D, by far the most
                topic = log.topics.get(raw[at + 3] | raw[at + 4] << 8) if length >= 2 else None
                if topic is not None:
                    log.places[topic].append(at + 5)
                    log.ends[topic].append(end)
            else:
                _taken(log, kind, raw[at + 3 : end])
            at = end
    return log


def _appended(raw: bytes) -> list[int]:
    """Places where data were appended; refuses a log with features that this reader does not know."""
    if len(raw) < _HEAD + 43 or raw[_HEAD + 2] != 0x42:  # B comes first where it is
        return []
    flags = raw[_HEAD + 3 + 8 : _HEAD + 3 + 16]
    if flags[0] & ~1 or any(flags[1:]):
        raise DecodeError(
            f"its incompatible flags are {flags.hex()}, but this reader knows the first bit alone (appended data); "
            "convert it by a newer tool of PX4."
        )
    offsets = struct.unpack_from("<3Q", raw, _HEAD + 3 + 16)
    return sorted({offset for offset in offsets if _HEAD < offset < len(raw)}) if flags[0] & 1 else []


def _resynced(log: _UlogHead, at: int) -> int:
    """Where messages go on after damage: at a sync message, or where headers chain again; the end where nowhere."""
    size = len(log.raw)
    chained = next((p for p in range(at + 1, min(at + _REACH, size)) if _chains(log.raw, p, size)), size)
    synced = log.raw.find(_SYNC, at + 1, chained)
    resumed = synced if synced >= 0 else chained
    if resumed == size:  # beyond the reach, sync messages alone are looked for
        beyond = log.raw.find(_SYNC, at + 1)
        resumed = beyond if beyond >= 0 else size
    log.skipped += resumed - at
    return resumed


def _chains(raw: bytes, at: int, size: int) -> bool:
    """Whether headers follow one another from here."""
    for _ in range(_CHAIN):
        if at == size:
            return True
        if at + 3 > size or raw[at + 2] not in _KINDS:
            return False
        length = raw[at] | raw[at + 1] << 8
        if not length:
            return False
        at += 3 + length
    return at <= size


def _taken(log: _UlogHead, kind: int, body: bytes) -> None:
    """Take what a message defines; what is damaged beyond reading counts as skipped."""
    try:
        if kind == 0x46:  # F
            if len(log.formats) < _MOST_FORMATS:
                name, _, columns = body.decode("ascii").partition(":")
                log.formats[name] = [_column(column) for column in columns.split(";") if column]
        elif kind == 0x41:  # A
            name = body[3:].decode("ascii")
            message = body[1] | body[2] << 8
            log.topics.pop(message, None)
            if name in _WANTED:
                topic = log.topics[message] = (name, body[0])
                log.places.setdefault(topic, array("q"))
                log.ends.setdefault(topic, array("q"))
        elif kind in {0x49, 0x50}:  # I and P
            key, value = _value(body)
            log.info[key] = value
        elif kind == 0x4F:  # O
            log.dropouts.append(body[0] | body[1] << 8)
    except (ValueError, IndexError, struct.error, UnicodeDecodeError):
        log.skipped += 3 + len(body)


def _column(text: str) -> tuple[str, int, str]:
    """Type, count (0: not an array) and name of a field such as ``float[3] gyro_rad``."""
    kind, name = text.split(" ")
    base, bracket, count = kind.partition("[")
    number = int(count.rstrip("]")) if bracket else 0
    if not 0 <= number <= _LONGEST_RECORD:
        raise ValueError(text)
    return base, number, name


def _value(body: bytes) -> tuple[str, Any]:
    """Key and value of an information or a parameter."""
    kind, key = body[1 : 1 + body[0]].decode("ascii").split(" ")
    rest = body[1 + body[0] :]
    if kind.startswith("char"):
        return key, rest.decode("utf-8", errors="replace")
    return key, np.frombuffer(rest, _BASIC.get(kind, "u1"), 1)[0].item()


def _layout(log: _UlogHead, name: str, depth: int = 0) -> "np.dtype[Any]":
    """Layout of a topic's records; padding at the end, which is not written, is left out.

    Raises
    ------
    DecodeError
        If its definition is missing, holds itself, or is longer than a message.
    """
    if name not in log.formats or depth > 8:
        raise DecodeError(f"the layout of {excerpt(name)} is missing or holds itself; the log is damaged.")
    columns = log.formats[name]
    while columns and columns[-1][2].startswith("_padding"):
        columns = columns[:-1]
    parts: list[Any] = []
    for base, count, column in columns:
        part = np.dtype(_BASIC[base]) if base in _BASIC else _layout(log, base, depth + 1)
        parts.append((column, part, (count,)) if count else (column, part))
    try:
        layout = np.dtype(parts)
    except (ValueError, TypeError) as error:
        raise DecodeError(f"the layout of {excerpt(name)} is damaged: {error}.") from error
    if layout.itemsize > _LONGEST_RECORD:
        raise DecodeError(f"the layout of {excerpt(name)} has {layout.itemsize} bytes, more than a message holds.")
    return layout


def _table(log: _UlogHead, raw: NDArray[np.uint8], name: str, instance: int, *needed: str) -> NDArray[Any] | None:
    """Records of a topic, or None where there are none; refused where columns are missing that it must have."""
    topic = (name, instance)
    if topic not in log.places or not len(log.places[topic]):
        return None
    layout = _layout(log, name)
    missing = [column for column in needed if column not in (layout.names or ())]
    if missing:
        return None
    places = np.frombuffer(log.places[topic], np.int64)
    fits = np.frombuffer(log.ends[topic], np.int64) - places >= layout.itemsize
    log.short += int(np.count_nonzero(~fits))
    return logged.records(raw, places[fits], layout) if fits.any() else None


def _recording(log: _UlogHead, raw: NDArray[np.uint8], name: str, unit: str | None) -> Recording:
    notes = [
        "PX4 ULog: body axes forward, right, down; frame NED; rad/s, m/s², gauss as µT; clock in µs since boot (PX4 "
        "guide, ULog File Format, and PX4's message definitions)"
    ]
    counts = _units(log)
    taken = logged.chosen(list(counts), unit) if counts else ""
    streams, in_body = _sensors(log, raw, taken, notes)
    logged.require_gyroscope(streams, "sensor_combined, vehicle_imu or sensor_gyro")
    count = counts.pop(taken)
    if in_body:
        _magnetometer(log, raw, streams, notes)
    epoch = _epoch(log, raw, notes)
    declination = log.info.get("EKF2_MAG_DECL")
    meta = ImuMeta(
        device=f"PX4 {log.info.get('ver_hw', '')}".strip(),
        frame=Frame.NED,
        declination=None
        if not isinstance(declination, float) or not abs(declination) < 180
        else units.deg(declination),
        unit_check=False,
    )
    imu, rows_ns, how = joined(streams, meta=meta, epoch_ns=epoch)
    notes += [logged.others_note(f"samples: {taken}, {counted(count, 'record')}", counts), *how]
    if in_body:
        track = _attitude(log, raw, rows_ns, imu.t, notes)
    else:
        track = None
        notes.append(
            f"left out: magnetic field and attitude, which are in body axes, as the board is turned in the vehicle "
            f"(SENS_BOARD_ROT {log.info['SENS_BOARD_ROT']})"
        )
    return Recording(imu=imu, track=track, name=name, notes=(*notes, *_losses(log)))


def _units(log: _UlogHead) -> dict[str, int]:
    """IMUs that samples can be of, with their numbers of records; first the one PX4 flew by, or that with most.

    Raises
    ------
    DecodeError
        If there is none, and a layout is damaged.
    """
    counts: dict[str, int] = {}
    damage: list[DecodeError] = []
    for topic, needed in _NEEDED.items():
        instances = log.instances(topic)
        try:
            columns = _layout(log, topic).names or () if instances else ()
        except DecodeError as error:
            damage.append(error)
            continue
        for instance in instances:
            if (count := len(log.places[topic, instance])) and {*needed} <= {*columns}:
                counts[topic if topic == "sensor_combined" else f"{topic}.{instance}"] = count
    if not counts and damage:
        raise damage[0]
    first = "sensor_combined" if "sensor_combined" in counts else max(counts, key=lambda name: counts[name], default="")
    return {first: counts[first], **counts} if counts else {}


def _sensors(log: _UlogHead, raw: NDArray[np.uint8], unit: str, notes: list[str]) -> tuple[dict[str, Readings], bool]:
    """Streams of a unit's gyroscope and accelerometer, and whether they are in body axes."""
    streams: dict[str, Readings] = {}
    topic, _, number = unit.partition(".")
    table = _table(log, raw, topic, int(number or 0), *_NEEDED.get(topic, ()))
    if table is None:
        return streams, True
    if topic == "sensor_combined":
        t_ns = logged.micro(table["timestamp"])
        streams["gyr"] = logged.stream("gyr", t_ns, logged.triad(table, "gyro_rad"), notes)
        acc_ns, valid = t_ns, np.ones(t_ns.size, dtype=bool)
        if "accelerometer_timestamp_relative" in (table.dtype.names or ()):
            later = table["accelerometer_timestamp_relative"].astype(np.int64)
            valid = later != _UNKNOWN_STAMP
            acc_ns = t_ns + later * 1000
        acc = logged.triad(table, "accelerometer_m_s2")
        streams["acc"] = logged.stream("acc", acc_ns[valid], acc[valid], notes)
    elif topic == "vehicle_imu":
        for key, column in (("gyr", "delta_angle"), ("acc", "delta_velocity")):
            span = table[f"{column}_dt"].astype(np.float64) / 1e6
            valid = span > 0.0
            values = logged.triad(table, column)[valid] / span[valid, None]
            streams[key] = logged.stream(key, _sampled(table)[valid], values, notes)
    else:
        return _single(log, raw, table, int(number), notes)
    notes.append(f"axes: {topic} is in body axes, corrected by PX4's calibration")
    return streams, True


def _single(
    log: _UlogHead, raw: NDArray[np.uint8], gyroscope: NDArray[Any], instance: int, notes: list[str]
) -> tuple[dict[str, Readings], bool]:
    """Streams of one gyroscope and of the accelerometer on its bus and address, or of the same number."""
    streams = {"gyr": logged.stream("gyr", _sampled(gyroscope), logged.triad(gyroscope, "x", "y", "z"), notes)}
    places = {
        index: table
        for index in log.instances("sensor_accel")
        if (table := _table(log, raw, "sensor_accel", index, "timestamp", "x", "y", "z")) is not None
    }
    number, why = _accelerometer(gyroscope, instance, places)
    notes.append(f"acc: {why}")
    if number is not None:
        acc = places[number]
        streams["acc"] = logged.stream("acc", _sampled(acc), logged.triad(acc, "x", "y", "z"), notes)
    notes.append("axes: sensor_gyro is in axes of the board and without PX4's calibration")
    return streams, not log.info.get("SENS_BOARD_ROT", 0)


def _accelerometer(gyroscope: NDArray[Any], instance: int, places: dict[int, NDArray[Any]]) -> tuple[int | None, str]:
    """Number of the accelerometer that belongs to a gyroscope, and how that is known."""
    for mask, what in ((~0, "of the same device"), (_BUS, "on the same bus and address")):
        device = _device(gyroscope) & mask
        alike = [number for number, table in places.items() if device and _device(table) & mask == device]
        if len(alike) == 1:
            return alike[0], f"sensor_accel.{alike[0]}, {what}"
    if instance in places:
        return instance, f"sensor_accel.{instance}, of the same number"
    return None, "none, as no sensor_accel is of the same device, bus and address, or number"


def _device(table: NDArray[Any]) -> int:
    """Identity of a sensor's device; 0 where it does not say one."""
    return int(table["device_id"][0]) if "device_id" in (table.dtype.names or ()) else 0


def _sampled(table: NDArray[Any]) -> NDArray[np.int64]:
    """When records were sampled, ns since boot; older logs have the stamp of their publication alone."""
    return logged.micro(table["timestamp_sample" if "timestamp_sample" in (table.dtype.names or ()) else "timestamp"])


def _magnetometer(log: _UlogHead, raw: NDArray[np.uint8], streams: dict[str, Readings], notes: list[str]) -> None:
    """The magnetometer that PX4 flew by, or the first one."""
    for topic in ("vehicle_magnetometer", "sensor_combined"):  # logs before 2018 have it in the latter
        table = _table(log, raw, topic, 0, "timestamp", "magnetometer_ga")
        if table is not None:
            field_ut = units.gauss(logged.triad(table, "magnetometer_ga"))
            streams["mag"] = logged.stream("mag", _sampled(table), field_ut, notes)
            return
    for instance in log.instances("sensor_mag"):
        table = _table(log, raw, "sensor_mag", instance, "timestamp", "x", "y", "z")
        if table is not None:
            values = units.gauss(logged.triad(table, "x", "y", "z"))
            streams["mag"] = logged.stream("mag", _sampled(table), values, notes)
            notes.append(f"mag: sensor_mag.{instance}, as the sensor gave it")
            return


def _gps(log: _UlogHead, raw: NDArray[np.uint8]) -> NDArray[Any] | None:
    """Records of the first GPS that knew UTC and had a fix."""
    for topic in ("vehicle_gps_position", "sensor_gps"):
        for instance in log.instances(topic):
            table = _table(log, raw, topic, instance, "timestamp", "time_utc_usec", "fix_type")
            if table is not None and (fixes := (table["time_utc_usec"] > 0) & (table["fix_type"] >= 3)).any():
                return table[fixes]
    return None


def _epoch(log: _UlogHead, raw: NDArray[np.uint8], notes: list[str]) -> int | None:
    """UTC of boot, ns since 1970, where a GPS knew it."""
    table = _gps(log, raw)
    if table is None:
        notes.append("UTC: not known, as no GPS with a fix is in the log")
        return None
    differences = logged.micro(table["time_utc_usec"]) - logged.micro(table["timestamp"])
    return int(np.median(differences))


def _attitude(
    log: _UlogHead, raw: NDArray[np.uint8], rows_ns: NDArray[np.int64], t: Any, notes: list[str]
) -> AttitudeTrack | None:
    """PX4's own estimate on the rows of the samples."""
    table = _table(log, raw, "vehicle_attitude", 0, "timestamp", "q")
    if table is None or table["q"].shape[1:] != (4,):
        notes.append("attitude: none in the log (vehicle_attitude)")
        return None
    q_nb = logged.attitude_at(rows_ns, _sampled(table), table["q"].astype(np.float64), notes)
    if q_nb is None:
        notes.append("attitude: vehicle_attitude holds none at the samples' times")
        return None
    north = North.TRUE if _gps(log, raw) is not None else North.MAGNETIC
    why = "a GPS had a fix, so PX4 adds the declination" if north is North.TRUE else "no GPS had a fix"
    notes.append(
        "attitude: vehicle_attitude, PX4's own estimate from the same sensors, not a reference: a comparison with it "
        f"shows agreement, not accuracy; its heading counts from {north} north ({why})"
    )
    return AttitudeTrack(
        t=t, q_nb=q_nb, frame=Frame.NED, north=north, source="PX4's own estimate (vehicle_attitude), not a reference"
    )


def _losses(log: _UlogHead) -> list[str]:
    notes = []
    if log.dropouts:
        total = sum(log.dropouts) / 1000
        notes.append(f"dropouts: the logger lost data {counted(len(log.dropouts), 'time')}, {total:.3g} s in all")
    if log.skipped:
        notes.append(f"damage: {counted(log.skipped, 'byte')} skipped, which are not messages")
    if log.short:
        notes.append(f"damage: {counted(log.short, 'record')} left out, shorter than their layout")
    if log.cut:
        notes.append("cut: the file ends within a message")
    return notes
