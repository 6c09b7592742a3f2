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
from plumbob.core.errors import DecodeError, excerpt, one_line
from plumbob.core.files import existing_file, reading
from plumbob.core.text import counted
from plumbob.data import AttitudeTrack, ImuMeta
from plumbob.data.recording import Recording
from plumbob.files.foreign import logged
from plumbob.files.foreign.join import Readings, joined
from plumbob.rotations import Frame, North

Table = Mapping[str, NDArray[Any]]
"""Columns (N,) of a topic by the name of their field, ``q[0]`` for the first number of an array."""

_MAGIC: Final = b"ULog\x01\x12\x35"
_HEAD: Final = 3
"""Bytes of the head of a message."""
_UNKNOWN_STAMP: Final = 0x7FFFFFFF
"""`RELATIVE_TIMESTAMP_INVALID` of `SensorCombined.msg`: no new acceleration."""
_LONGEST_RECORD: Final = 0xFFFF
_BUS: Final = 0xFFFF
"""Bits of a device identity that are its bus type, bus and address; the rest is the type of the device."""
_NEEDED: Final = {
    "sensor_combined": ("timestamp", "gyro_rad[0]", "accelerometer_m_s2[0]"),
    "vehicle_imu": ("timestamp", "delta_angle[0]", "delta_velocity[0]", "delta_angle_dt", "delta_velocity_dt"),
    "sensor_gyro": ("timestamp", "x", "y", "z"),
}
"""Topics that samples are of, and what they must have."""
_WANTED: Final = (*_NEEDED, "sensor_accel", "sensor_mag", "vehicle_magnetometer", "vehicle_attitude",
                  "vehicle_gps_position", "sensor_gps")  # fmt: skip


@dataclass(frozen=True)
class _Topics:
    """What a log says about itself, its records by topic and instance, and what of it was lost."""

    parameters: Mapping[str, Any]
    tables: Mapping[tuple[str, int], Table]
    losses: tuple[str, ...]

    def instances(self, name: str, *needed: str) -> dict[int, Table]:
        """Instances of a topic that have these columns."""
        return {i: table for (topic, i), table in self.tables.items() if topic == name and {*needed} <= table.keys()}


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
        return _recording(_topics(file), file.stem, unit)


class _Log(io.BufferedReader):
    """A log that knows whether its last message was cut."""

    cut = False

    def read(self, size: int | None = -1, /) -> bytes:
        """Read; what comes shorter than asked for is cut, but for the head of a message that is not there at all."""
        data = super().read(size)
        self.cut = len(data) < (size or 0) and (bool(data) or size != _HEAD)
        return data


def _topics(file: Path) -> _Topics:
    """Let pyulog read the log; its own warnings, which it prints, are what `losses` says.

    Raises
    ------
    DecodeError
        If pyulog finds it damaged beyond reading, or a layout is longer than a message may be.
    """
    from pyulog import ULog
    from pyulog.exceptions import ULogIncompatibleFlagException

    with contextlib.redirect_stdout(io.StringIO()), file.open("rb") as start, _Log(io.FileIO(file)) as log:
        try:
            head = ULog(start, parse_header_only=True)
            for name in _WANTED:
                _require_short(head.message_formats, name)
            content = ULog(log, [*_WANTED])
        except DecodeError:
            raise
        except ULogIncompatibleFlagException as error:
            raise DecodeError(
                "it has incompatible flags that are not known; convert it by a newer tool of PX4."
            ) from error
        except Exception as error:  # a dozen types, by what is damaged
            raise DecodeError(f"it is damaged, or of a newer kind: {one_line(error)}; copy the log again.") from error
    tables: dict[tuple[str, int], Table] = {}
    for topic in content.data_list:
        if len(topic.data.get("timestamp", ())):
            tables.setdefault((topic.name, topic.multi_id), topic.data)
    losses = []
    if content.dropouts:
        seconds = sum(dropout.duration for dropout in content.dropouts) / 1000
        losses.append(
            f"dropouts: the logger lost data {counted(len(content.dropouts), 'time')}, {seconds:.3g} s in all"
        )
    if content.file_corruption:
        losses.append("damage: bytes that are not messages, or messages that do not fit their layout, were skipped")
    if log.cut:
        losses.append("cut: the file ends within a message")
    return _Topics({**content.msg_info_dict, **content.initial_parameters}, tables, tuple(losses))


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


def _recording(log: _Topics, name: str, unit: str | None) -> Recording:
    notes = [
        "PX4 ULog: body axes forward, right, down; frame NED; rad/s, m/s², gauss as µT; clock in µs since boot (PX4 "
        "guide, ULog File Format, and PX4's message definitions)"
    ]
    imus = _units(log)
    taken = logged.chosen([*imus], unit) if imus else ""
    streams, in_body = _sensors(log, imus, taken, notes) if taken else ({}, True)
    logged.require_gyroscope(streams, "sensor_combined, vehicle_imu or sensor_gyro")
    if in_body:
        _magnetometer(log, streams, notes)
    declination = log.parameters.get("EKF2_MAG_DECL")
    meta = ImuMeta(
        device=f"PX4 {log.parameters.get('ver_hw', '')}".strip(),
        frame=Frame.NED,
        declination=units.deg(declination) if isinstance(declination, float) and abs(declination) < 180 else None,
        unit_check=False,
    )
    gps = _gps(log)
    imu, rows_ns, how = joined(streams, meta=meta, epoch_ns=_epoch(gps, notes))
    counts = {key: len(table["timestamp"]) for key, table in imus.items()}
    samples = f"samples: {taken}, {counted(counts.pop(taken), 'record')}"
    notes += [logged.others_note(samples, counts), *how]
    track = None
    if in_body:
        track = _attitude(log, gps is not None, rows_ns, imu.t, notes)
    else:
        notes.append(
            f"left out: magnetic field and attitude, which are in body axes, as the board is turned in the vehicle "
            f"(SENS_BOARD_ROT {log.parameters['SENS_BOARD_ROT']})"
        )
    return Recording(imu=imu, track=track, name=name, notes=(*notes, *log.losses))


def _units(log: _Topics) -> dict[str, Table]:
    """IMUs that samples can be of; first the one PX4 flew by, or that with most records."""
    imus = {
        topic if topic == "sensor_combined" else f"{topic}.{instance}": table
        for topic, needed in _NEEDED.items()
        for instance, table in sorted(log.instances(topic, *needed).items())
    }
    first = max(imus, key=lambda name: (name == "sensor_combined", len(imus[name]["timestamp"])), default=None)
    return {} if first is None else {first: imus[first], **imus}


def _sensors(log: _Topics, imus: Mapping[str, Table], unit: str, notes: list[str]) -> tuple[dict[str, Readings], bool]:
    """Streams of a unit's gyroscope and accelerometer, and whether they are in body axes."""
    streams: dict[str, Readings] = {}
    topic, _, number = unit.partition(".")
    table = imus[unit]
    if topic == "sensor_combined":
        t_ns = logged.micro(table["timestamp"])
        streams["gyr"] = logged.stream("gyr", t_ns, _vectors(table, "gyro_rad"), notes)
        later = np.asarray(table.get("accelerometer_timestamp_relative", np.zeros(t_ns.size)), dtype=np.int64)
        valid = later != _UNKNOWN_STAMP
        acc = _vectors(table, "accelerometer_m_s2")[valid]
        streams["acc"] = logged.stream("acc", (t_ns + later * 1000)[valid], acc, notes)
    elif topic == "vehicle_imu":
        for key, column in (("gyr", "delta_angle"), ("acc", "delta_velocity")):
            span = table[f"{column}_dt"].astype(np.float64) / 1e6
            valid = span > 0.0
            values = _vectors(table, column)[valid] / span[valid, None]
            streams[key] = logged.stream(key, _sampled(table)[valid], values, notes)
    else:
        return _single(log, table, int(number), notes)
    notes.append(f"axes: {topic} is in body axes, corrected by PX4's calibration")
    return streams, True


def _vectors(table: Table, name: str, count: int = 3) -> NDArray[Any]:
    """Records (N, count) of a field that is an array."""
    return logged.triad(table, *(f"{name}[{i}]" for i in range(count)))


def _single(log: _Topics, gyroscope: Table, instance: int, notes: list[str]) -> tuple[dict[str, Readings], bool]:
    """Streams of one gyroscope and of the accelerometer on its bus and address, or of the same number."""
    streams = {"gyr": logged.stream("gyr", _sampled(gyroscope), logged.triad(gyroscope, "x", "y", "z"), notes)}
    places = log.instances("sensor_accel", "timestamp", "x", "y", "z")
    number, why = _accelerometer(gyroscope, instance, places)
    notes.append(f"acc: {why}")
    if number is not None:
        acc = places[number]
        streams["acc"] = logged.stream("acc", _sampled(acc), logged.triad(acc, "x", "y", "z"), notes)
    notes.append("axes: sensor_gyro is in axes of the board and without PX4's calibration")
    return streams, not log.parameters.get("SENS_BOARD_ROT", 0)


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
    return logged.micro(table["timestamp_sample" if "timestamp_sample" in table else "timestamp"])


def _magnetometer(log: _Topics, streams: dict[str, Readings], notes: list[str]) -> None:
    """The magnetometer that PX4 flew by, or the first one."""
    for topic in ("vehicle_magnetometer", "sensor_combined"):  # logs before 2018 have it in the latter
        if table := log.instances(topic, "timestamp", "magnetometer_ga[0]").get(0):
            field_ut = units.gauss(_vectors(table, "magnetometer_ga"))
            streams["mag"] = logged.stream("mag", _sampled(table), field_ut, notes)
            return
    for instance, table in sorted(log.instances("sensor_mag", "timestamp", "x", "y", "z").items())[:1]:
        values = units.gauss(logged.triad(table, "x", "y", "z"))
        streams["mag"] = logged.stream("mag", _sampled(table), values, notes)
        notes.append(f"mag: sensor_mag.{instance}, as the sensor gave it")


def _gps(log: _Topics) -> NDArray[np.int64] | None:
    """UTC of boot, ns since 1970, by each record of the first GPS that knew it and had a fix."""
    for topic in ("vehicle_gps_position", "sensor_gps"):
        for _, table in sorted(log.instances(topic, "timestamp", "time_utc_usec", "fix_type").items()):
            if (fixes := (table["time_utc_usec"] > 0) & (table["fix_type"] >= 3)).any():
                return logged.micro(table["time_utc_usec"][fixes]) - logged.micro(table["timestamp"][fixes])
    return None


def _epoch(boot_ns: NDArray[np.int64] | None, notes: list[str]) -> int | None:
    if boot_ns is None:
        notes.append("UTC: not known, as no GPS with a fix is in the log")
        return None
    return int(np.median(boot_ns))


def _attitude(
    log: _Topics, had_fix: bool, rows_ns: NDArray[np.int64], t: Any, notes: list[str]
) -> AttitudeTrack | None:
    """PX4's own estimate on the rows of the samples."""
    table = log.instances("vehicle_attitude", "timestamp", "q[3]").get(0)
    if table is None:
        notes.append("attitude: none in the log (vehicle_attitude)")
        return None
    q_nb = logged.attitude_at(rows_ns, _sampled(table), _vectors(table, "q", 4), notes)
    if q_nb is None:
        notes.append("attitude: vehicle_attitude holds none at the samples' times")
        return None
    north = North.TRUE if had_fix else North.MAGNETIC
    why = "a GPS had a fix, so PX4 adds the declination" if had_fix else "no GPS had a fix"
    notes.append(
        "attitude: vehicle_attitude, PX4's own estimate from the same sensors, not a reference: a comparison with it "
        f"shows agreement, not accuracy; its heading counts from {north} north ({why})"
    )
    return AttitudeTrack(
        t=t, q_nb=q_nb, frame=Frame.NED, north=north, source="PX4's own estimate (vehicle_attitude), not a reference"
    )
