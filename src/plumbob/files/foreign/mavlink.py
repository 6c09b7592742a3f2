"""Telemetry logs: MAVLink packets, each after 8 bytes of the receiver's clock (``.tlog``).

Packets are those of the MAVLink guide, 'Packet Serialization', versions 1 and 2; each is checked by its CRC. Messages
are those of `common.xml`:

- ``HIGHRES_IMU``: rad/s, m/s², gauss; ``SCALED_IMU``, ``SCALED_IMU2``, ``SCALED_IMU3``: mrad/s, mg, mgauss;
- ``RAW_IMU`` has no units by the standard; ArduPilot sends it in those of ``SCALED_IMU``, so it is taken where the
  vehicle's heartbeat says ArduPilot, and refused otherwise;
- ``ATTITUDE_QUATERNION``: body to NED, scalar first; ``ATTITUDE``: roll, pitch, yaw in rad. They are the vehicle's own
  estimate, and **not a reference**;
- body axes forward, right, down; frame NED.

The receiver's stamps are µs since 1970 with the delay of the radio link in them. Rows have the vehicle's own stamps;
UTC is the receiver's, by the packet that came soonest.
"""

from array import array
from binascii import crc_hqx
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.errors import DecodeError
from plumbob.core.findings import info, warning
from plumbob.data import ImuMeta
from plumbob.data.recording import Recording
from plumbob.files.foreign.logged import LoggedAttitude, SensorLog, choose, micro, of_vehicle, vectors
from plumbob.files.known_logs import KNOWN_TABLES
from plumbob.rotations import Frame
from plumbob.rotations.quaternions import quat_from_euler_zyx


class _Kind(NamedTuple):
    """A message: name, what its CRC is closed with, layout on the wire (longest fields first), units."""

    name: str
    extra: int
    layout: "np.dtype[Any]"
    units: Mapping[str, str]


def _kind(name: str, extra: int, fields: Mapping[str, str], units: Mapping[str, str] = MappingProxyType({})) -> _Kind:
    """A message, whose field `imu` stands for nine."""
    nine = [f"{sensor}{axis}" for sensor in ("acc", "gyr", "mag") for axis in "xyz"]
    listed = [(part, form) for field, form in fields.items() for part in (nine if field == "imu" else [field])]
    return _Kind(name, extra, np.dtype(listed), units)


_KINDS: Final = {int(number): _kind(**of) for number, of in KNOWN_TABLES["mavlink"].items()}
_ANGLES: Final = ("yaw", "pitch", "roll")
_PREFERRED: Final = (105, 26, 27, 116, 129)
_VERSIONS: Final = {0xFE: (6, 3, 5), 0xFD: (10, 5, 7)}  # bytes of a head; where the system is in it, and the message
_EARLIEST_US, _LATEST_US = 946_684_800 * 10**6, 4_102_444_800 * 10**6
_BITS: Final = {"acc": 0x007, "gyr": 0x038, "mag": 0x1C0}  # `HIGHRES_IMU_UPDATED_FLAGS`


_Tables = dict[tuple[int, int], tuple[NDArray[Any], NDArray[np.int64]]]  # by system and message, and when each came, µs
_REVERSED: Final = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))  # bits of each byte


def starts(start: bytes) -> bool:
    """Whether these first bytes of a file are a stamp of this century, and a packet."""
    came = int.from_bytes(start[:8], "big")
    return len(start) >= 17 and start[8] in _VERSIONS and _EARLIEST_US < came < _LATEST_US


def recording(raw: bytes, name: str, unit: str | None = None) -> Recording:
    """Samples and the vehicle's own attitude of a telemetry log, of the first IMU or the one asked for."""
    tables, skipped, bad = _scanned(raw)
    log = SensorLog(
        [
            "MAVLink telemetry: body axes forward, right, down; frame NED; clock of the vehicle, UTC by the receiver's "
            "(MAVLink guide, Packet Serialization; common.xml)"
        ],
        ImuMeta(frame=Frame.NED, unit_check=False),
    )
    system, number = _chosen(tables, unit, log)
    table, came_us = tables[system, number]
    own_ns = _own_ns(table)
    for sensor, of in _KINDS[number].units.items():
        values = vectors(table, *(f"{sensor}{axis}" for axis in "xyz"))
        valid = (table["updated"] & _BITS[sensor]) > 0 if number == 105 else np.ones(own_ns.size, dtype=bool)
        if sensor == "mag":  # zeros stand for a compass that is not there
            valid &= values.any(axis=1)
        if valid.any():
            log.add(sensor, own_ns, values, of, valid=valid)
    log.require_gyroscope("HIGHRES_IMU, SCALED_IMU, or RAW_IMU of ArduPilot")
    log.epoch_ns = int(np.min(came_us * 1000 - own_ns))
    log.meta = replace(log.meta, device=f"MAVLink system {system}")
    for kind in (31, 30):
        if (system, kind) in tables:
            log.attitudes.append(_attitude(kind, *tables[system, kind], log))
    if skipped:
        log.losses.append(warning("reading.damage_no_packets", skipped=skipped))
    if bad:
        log.losses.append(warning("reading.damage_crc", bad=bad))
    return log.recording(name, none="attitude: none at the samples' times (ATTITUDE_QUATERNION, ATTITUDE)")


def _scanned(raw: bytes) -> tuple[_Tables, int, int]:
    """Packets of known kinds whose CRC is right, bytes that are not packets, and how many have another CRC."""
    messages: dict[tuple[int, int], tuple[bytearray, array[int]]] = {}
    at, size, skipped, bad = 0, len(raw), 0, 0
    while at + 17 <= size:
        begin, came = at + 8, int.from_bytes(raw[at : at + 8], "big")
        head, system, number_at = _VERSIONS.get(raw[begin], (0, 0, 0))
        start, length = begin + head, raw[begin + 1]
        end = start + length + (15 if head == 10 and raw[begin + 2] & 0x01 else 2)  # a signature, or a CRC alone
        follows = end == size or (end + 8 < size and raw[end + 8] in _VERSIONS) or size - end < 17
        if not head or not _EARLIEST_US < came < _LATEST_US or end > size or not follows:
            at, skipped = at + 1, skipped + 1
            continue
        number = int.from_bytes(raw[begin + number_at : start], "little")
        if (kind := _KINDS.get(number)) is not None:
            if _crc(raw[begin + 1 : start + length] + bytes([kind.extra])) == raw[start + length : start + length + 2]:
                rows, came_us = messages.setdefault((raw[begin + system], number), (bytearray(), array("q")))
                taken = min(length, kind.layout.itemsize)  # what is longer are extensions; zeros at the end are cut off
                rows += raw[start : start + taken].ljust(kind.layout.itemsize, b"\0")
                came_us.append(came)
            else:
                bad += 1
        at = end
    tables = {
        key: (np.frombuffer(rows, _KINDS[key[1]].layout), np.frombuffer(came_us, np.int64))
        for key, (rows, came_us) in messages.items()
    }
    return tables, skipped + size - at, bad


def _crc(data: bytes) -> bytes:
    """CRC-16/MCRF4XX as it is sent, low byte first: Python's CRC of the other order of bits, turned."""
    return crc_hqx(data.translate(_REVERSED), 0xFFFF).to_bytes(2, "big").translate(_REVERSED)


def _chosen(tables: _Tables, unit: str | None, log: SensorLog) -> tuple[int, int]:
    """System and message that the samples are of: the first of the preferred, or the one asked for by its name."""
    ardupilot = {key[0] for key, (rows, _) in tables.items() if key[1] == 0 and (rows["autopilot"] == 3).any()}
    listed_units = [
        (system, number)
        for system in sorted({system for system, _ in tables})
        for number in _PREFERRED
        if (system, number) in tables and (number != 27 or system in ardupilot)
    ]
    if not listed_units:
        raw = any(number == 27 for _, number in tables)
        why = " RAW_IMU is there, but its units are those of an unknown maker." if raw else ""
        raise DecodeError(f"it holds no message of an IMU with known units (HIGHRES_IMU, SCALED_IMU).{why}")
    several = len({system for system, _ in listed_units}) > 1
    names = {f"{_KINDS[number].name}{f'.{system}' * several}": (system, number) for system, number in listed_units}
    return names[choose(log.notes, {name: tables[key][0].size for name, key in names.items()}, unit, what="message")]


def _own_ns(table: NDArray[Any]) -> NDArray[np.int64]:
    """Stamps of the vehicle, ns."""
    if "us" in (table.dtype.names or ()):
        return micro(table["us"])
    return np.asarray(table["ms"].astype(np.int64) * 1_000_000)


def _attitude(number: int, table: NDArray[Any], came_us: NDArray[np.int64], log: SensorLog) -> LoggedAttitude:
    """The vehicle's own estimate; where its clock is another one, both are put on the receiver's."""
    t_ns = _own_ns(table)
    apart = int(np.min(came_us * 1000 - t_ns)) - (log.epoch_ns or 0)
    if abs(apart) > 10**9:
        t_ns = t_ns + apart
        log.notes.append(info("source.mavlink_attitude_clock"))
    q_nb = table["q"].astype(np.float64) if number == 31 else quat_from_euler_zyx(vectors(table, *_ANGLES))
    heading = "is taken to count from true north"
    return of_vehicle(t_ns, q_nb, _KINDS[number].name, "the vehicle's", heading)
