"""Logs of PX4: ULog, whose messages `pyulog`, the format's own package, takes apart.

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

import contextlib
import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core import units
from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, excerpt
from plumbob.core.findings import Note, info, warning
from plumbob.data import ImuMeta
from plumbob.data.recording import Recording
from plumbob.files.arrow import intact
from plumbob.files.foreign.logged import SensorLog, Table, choose, first_bytes, micro, of_vehicle, vectors
from plumbob.rotations import Frame, North

_MAGIC: Final = b"ULog\x01\x12\x35"
_HEAD: Final = 3  # bytes of the head of a message
_UNKNOWN_STAMP: Final = 0x7FFFFFFF  # `RELATIVE_TIMESTAMP_INVALID` of `SensorCombined.msg`: no new acceleration
_LONGEST_RECORD: Final = 0xFFFF
_BUS: Final = 0xFFFF  # bits of a device identity that are bus type, bus and address; the rest is the device's type
_NEEDED: Final = {
    "sensor_combined": ("timestamp", "gyro_rad[0]", "accelerometer_m_s2[0]"),
    "vehicle_imu": ("timestamp", "delta_angle[0]", "delta_velocity[0]", "delta_angle_dt", "delta_velocity_dt"),
    "sensor_gyro": ("timestamp", "x", "y", "z"),
}  # topics that samples are of, and what they must have
_WANTED: Final = (*_NEEDED, "sensor_accel", "sensor_mag", "vehicle_magnetometer", "vehicle_attitude",
                  "vehicle_gps_position", "sensor_gps")  # fmt: skip


@dataclass(frozen=True)
class _Topics:
    """What a log says about itself, its records by topic and instance, and what of it was lost."""

    parameters: Mapping[str, Any]
    tables: Mapping[tuple[str, int], Table]
    losses: list[Note]

    def instances(self, name: str, *needed: str) -> dict[int, Table]:
        """Instances of a topic that have these columns."""
        return {i: table for (topic, i), table in self.tables.items() if topic == name and {*needed} <= table.keys()}


def accepts(path: Path) -> bool:
    """Whether a file begins as a ULog does."""
    return first_bytes(path).startswith(_MAGIC)


def read(path: Path, unit: str | None = None) -> Recording:
    """Read samples and PX4's attitude; a unit is one of its IMUs, by the name in the note that lists them."""
    return _recording(_topics(path), path.stem, unit)


class _Log(io.BufferedReader):
    """A log that knows whether its last message was cut."""

    cut = False

    def read(self, size: int | None = -1, /) -> bytes:
        """Read; what comes shorter than asked for is cut, but for the head of a message that is not there at all."""
        data = super().read(size)
        self.cut = len(data) < (size or 0) and (bool(data) or size != _HEAD)
        return data


def _topics(file: Path) -> _Topics:
    """Let pyulog read the log; its own warnings, which it prints, are what `losses` says."""
    from pyulog import ULog
    from pyulog.exceptions import ULogIncompatibleFlagException

    with intact(), contextlib.redirect_stdout(io.StringIO()), file.open("rb") as start, _Log(io.FileIO(file)) as log:
        try:
            head = ULog(start, parse_header_only=True)
            for name in _WANTED:
                _require_short(head.message_formats, name)
            content = ULog(log, [*_WANTED])
        except ULogIncompatibleFlagException as error:
            raise DecodeError("it has unknown incompatible flags; convert it with a newer PX4 tool.") from error
    tables: dict[tuple[str, int], Table] = {}
    for topic in content.data_list:
        if len(topic.data.get("timestamp", ())):
            tables.setdefault((topic.name, topic.multi_id), topic.data)
    losses: list[Note] = []
    if content.dropouts:
        seconds = sum(dropout.duration for dropout in content.dropouts) / 1000
        losses.append(warning("reading.dropouts", count=len(content.dropouts), seconds=seconds))
    if content.file_corruption:
        losses.append(warning("reading.damage_ulog"))
    if log.cut:
        losses.append(warning("reading.cut_message"))
    return _Topics({**content.msg_info_dict, **content.initial_parameters}, tables, losses)


def _require_short(formats: Mapping[str, Any], name: str) -> None:
    """Refuse a layout that holds itself, or whose records are longer than a message: pyulog would unfold it."""

    def length(kind: str, depth: int) -> int:
        if kind not in formats:
            return 1  # a number
        if depth > 8:
            raise DecodeError(f"the layout of {excerpt(kind)} holds itself; the log is damaged.")
        return sum(max(count, 1) * length(inner, depth + 1) for inner, count, _ in formats[kind].fields)

    if name in formats and length(name, 0) > _LONGEST_RECORD:
        raise DecodeError(f"the layout of {excerpt(name)} is longer than a message; the log is damaged.")


def _recording(topics: _Topics, name: str, unit: str | None) -> Recording:
    declination = topics.parameters.get("EKF2_MAG_DECL")
    needed = ("timestamp", "time_utc_usec", "fix_type")
    boots = (
        int(np.median(micro(gps["time_utc_usec"][fixes]) - micro(gps["timestamp"][fixes])))
        for topic in ("vehicle_gps_position", "sensor_gps")
        for _, gps in sorted(topics.instances(topic, *needed).items())
        if (fixes := (gps["time_utc_usec"] > 0) & (gps["fix_type"] >= 3)).any()
    )
    boot_ns = next(boots, None)  # UTC of boot, ns since 1970, by the first GPS that knew it and had a fix
    log = SensorLog(
        [
            "PX4 ULog: body axes forward, right, down; frame NED; rad/s, m/s², gauss as µT; clock in µs since boot "
            "(PX4 guide, ULog File Format, and PX4's message definitions)"
        ],
        ImuMeta(
            device=f"PX4 {topics.parameters.get('ver_hw', '')}".strip(),
            frame=Frame.NED,
            declination=units.deg(declination) if isinstance(declination, float) and abs(declination) < 180 else None,
            unit_check=False,
        ),
        boot_ns,
        losses=topics.losses,
    )
    imus = _units(topics)
    counts = {key: len(table["timestamp"]) for key, table in imus.items()}
    in_body = not imus or _sensors(topics, log, choose(log.notes, counts, unit))
    log.require_gyroscope("sensor_combined, vehicle_imu or sensor_gyro")
    if not in_body:
        rotation = topics.parameters["SENS_BOARD_ROT"]
        note = "left out: magnetic field and attitude, which are in body axes, as the board is turned in the vehicle "
        return log.recording(name, none=f"{note}(SENS_BOARD_ROT {rotation})")
    if boot_ns is None:
        log.notes.append(info("source.no_utc_without_fix"))
    _magnetometer(topics, log)
    if table := topics.instances("vehicle_attitude", "timestamp", "q[3]").get(0):
        north = North.MAGNETIC if boot_ns is None else North.TRUE
        why = "no GPS had a fix" if boot_ns is None else "a GPS had a fix, so PX4 adds the declination"
        heading = f"counts from {north} north ({why})"
        attitude = of_vehicle(_sampled(table), _array(table, "q", 4), "vehicle_attitude", "PX4's", heading)
        log.attitudes.append(attitude._replace(north=north))
    return log.recording(name, none="attitude: none in the log at the samples' times (vehicle_attitude)")


def _units(topics: _Topics) -> dict[str, Table]:
    """IMUs that samples can be of; first the one PX4 flew by, or that with most records."""
    imus = {
        topic if topic == "sensor_combined" else f"{topic}.{instance}": table
        for topic, needed in _NEEDED.items()
        for instance, table in sorted(topics.instances(topic, *needed).items())
    }
    first = max(imus, key=lambda name: (name == "sensor_combined", len(imus[name]["timestamp"])), default=None)
    return {} if first is None else {first: imus[first], **imus}


def _sensors(topics: _Topics, log: SensorLog, unit: str) -> bool:
    """Take the gyroscope and the accelerometer of a unit; whether they are in body axes."""
    topic, _, number = unit.partition(".")
    table = topics.tables[topic, int(number or 0)]
    if topic == "sensor_gyro":
        log.add("gyr", _sampled(table), vectors(table, *"xyz"))
        places = topics.instances("sensor_accel", "timestamp", *"xyz")
        instance, why = _accelerometer(table, int(number), places)
        log.notes.append(info("source.px4_accelerometer", why=why))
        if instance is not None:
            log.add("acc", _sampled(places[instance]), vectors(places[instance], *"xyz"))
        log.notes.append(info("source.px4_board_axes"))
        return not topics.parameters.get("SENS_BOARD_ROT", 0)
    if topic == "sensor_combined":
        t_ns = micro(table["timestamp"])
        log.add("gyr", t_ns, _array(table, "gyro_rad"))
        later = np.asarray(table.get("accelerometer_timestamp_relative", np.zeros(t_ns.size)), dtype=np.int64)
        log.add("acc", t_ns + later * 1000, _array(table, "accelerometer_m_s2"), valid=later != _UNKNOWN_STAMP)
    else:
        for sensor, column in (("gyr", "delta_angle"), ("acc", "delta_velocity")):
            span = table[f"{column}_dt"].astype(np.float64) / 1e6
            means = _array(table, column) / np.where(span > 0.0, span, np.nan)[:, None]
            log.add(sensor, _sampled(table), means, valid=span > 0.0)
    log.notes.append(info("source.px4_body_axes", topic=topic))
    return True


def _array(table: Table, name: str, count: int = 3) -> Floats:
    """Records (N, count) of a field that is an array."""
    return vectors(table, *(f"{name}[{i}]" for i in range(count)))


def _accelerometer(gyroscope: Table, instance: int, places: Mapping[int, Table]) -> tuple[int | None, str]:
    """Number of the accelerometer that belongs to a gyroscope, and how that is known."""
    for mask, what in ((~0, "of the same device"), (_BUS, "on the same bus and address")):
        device = _device(gyroscope) & mask
        alike = [number for number, table in places.items() if device and _device(table) & mask == device]
        if len(alike) == 1:
            return alike[0], f"sensor_accel.{alike[0]}, {what}"
    if instance in places:
        return instance, f"sensor_accel.{instance}, of the same number"
    return None, "none, as no sensor_accel is of the same device, bus and address, or number"


def _device(table: Table) -> int:
    """Identity of a sensor's device; 0 where it does not say one."""
    return int(table["device_id"][0]) if "device_id" in table else 0


def _sampled(table: Table) -> NDArray[np.int64]:
    """When records were sampled, ns since boot; older logs have the stamp of their publication alone."""
    return micro(table["timestamp_sample" if "timestamp_sample" in table else "timestamp"])


def _magnetometer(topics: _Topics, log: SensorLog) -> None:
    """Take the magnetometer that PX4 flew by, or the first one."""
    for topic in ("vehicle_magnetometer", "sensor_combined"):  # logs before 2018 have it in the latter
        if table := topics.instances(topic, "timestamp", "magnetometer_ga[0]").get(0):
            log.add("mag", _sampled(table), _array(table, "magnetometer_ga"), "gauss")
            return
    for instance, table in sorted(topics.instances("sensor_mag", "timestamp", *"xyz").items())[:1]:
        log.add("mag", _sampled(table), vectors(table, *"xyz"), "gauss")
        log.notes.append(info("source.px4_magnetometer", instance=instance))
