"""Logs and data sets as their specifications have them, written by hand."""

import struct

import numpy as np

from plumbob.core.units import from_si, to_deg
from plumbob.rotations import euler_zyx_from_quat

G = 9.80665


def motion(count=400, rate=200.0):
    """Stamps (µs), and a body that is turned about its z axis at .5 rad/s, tilted by nothing, in FRD and NED."""
    t = np.arange(count) / rate
    t_us = (1_000_000 + t * 1e6).astype(np.uint64)
    gyr = np.tile([0.0, 0.0, 0.5], (count, 1))
    acc = np.tile([0.0, 0.0, -G], (count, 1))
    half = 0.25 * t
    q_nb = np.column_stack([np.cos(half), 0 * t, 0 * t, np.sin(half)])  # heading .5 t, clockwise: NED's z is down
    return t_us, gyr, acc, q_nb


def message(kind, body):
    return struct.pack("<HB", len(body), ord(kind)) + body


def ulog(*, topics, told=(), dropouts=(), flags=None, appended=b""):
    """ULog by the PX4 guide: topics of (name, instance, format, rows of bytes)."""
    out = bytearray(b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1_000_000))
    if flags is not None:
        out += message("B", flags)
    for name, columns in {name: columns for name, _, columns, _ in topics}.items():
        out += message("F", f"{name}:{columns}".encode())
    for kind, key, packed in told:
        head = f"{kind} {key}".encode()
        out += message("P" if kind == "float" else "I", bytes([len(head)]) + head + packed)
    for number, (name, instance, _, _) in enumerate(topics):
        out += message("A", struct.pack("<BH", instance, number) + name.encode())
    lengths = [len(rows) for *_, rows in topics]
    for row in range(max(lengths)):
        for number, (*_, rows) in enumerate(topics):
            if row < len(rows):
                out += message("D", struct.pack("<H", number) + rows[row])
    for milli in dropouts:
        out += message("O", struct.pack("<H", milli))
    return bytes(out) + appended


COMBINED = (
    "uint64_t timestamp;float[3] gyro_rad;uint32_t gyro_integral_dt;int32_t accelerometer_timestamp_relative;"
    "float[3] accelerometer_m_s2;uint8_t[4] _padding0;"
)
ATTITUDE = "uint64_t timestamp;float[4] q;"
MAG = "uint64_t timestamp;float[3] magnetometer_ga;"
SINGLE = "uint64_t timestamp;uint64_t timestamp_sample;uint32_t device_id;float x;float y;float z;"
INCREMENTS = (
    "uint64_t timestamp;uint64_t timestamp_sample;uint32_t accel_device_id;uint32_t gyro_device_id;"
    "float[3] delta_angle;float[3] delta_velocity;uint32_t delta_angle_dt;uint32_t delta_velocity_dt;"
)
GPS = "uint64_t timestamp;uint64_t time_utc_usec;uint8_t fix_type;"


def moved(moving):
    """A motion with its field, µT, in FRD and NED; without one, `motion` in a field of 20, 0, 40 µT."""
    t_us, gyr, acc, q_nb = motion()
    return (t_us, gyr, acc, np.tile([20.0, 0.0, 40.0], (t_us.size, 1)), q_nb) if moving is None else moving


def px4(moving=None, **more):
    t_us, gyr, acc, field, q_nb = moved(moving)
    combined = [struct.pack("<Q3fIi3f", t, *w, 5000, 0, *f) for t, w, f in zip(t_us.tolist(), gyr, acc, strict=True)]
    attitude = [struct.pack("<Q4f", t, *q) for t, q in zip(t_us.tolist(), q_nb, strict=True)]
    gauss = from_si(field[::10], "gauss")
    mag = [struct.pack("<Q3f", t, *one) for t, one in zip(t_us[::10].tolist(), gauss, strict=True)]
    gps = [struct.pack("<QQB", 2_000_000, 1_700_000_000_000_000, 3)]
    topics = [("sensor_combined", 0, COMBINED, combined), ("vehicle_attitude", 0, ATTITUDE, attitude)]
    topics += [("vehicle_magnetometer", 0, MAG, mag), ("vehicle_gps_position", 0, GPS, gps)]
    return ulog(topics=topics, **more)


def fmt(kind, name, letters, columns, length):
    body = struct.pack("<BB4s16s64s", kind, length, name.encode(), letters.encode(), columns.encode())
    return b"\xa3\x95\x80" + body


def dataflash(*, instances=False):
    """DataFlash by `LogStructure.h`: IMU at 200 Hz, MAG at 20 Hz, ATT with letters c and C, GPS, a parameter."""
    t_us, gyr, acc, _ = motion()
    out = fmt(128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns", 89)
    i, b = (",I", "B") if instances else ("", "")
    out += fmt(129, "IMU", f"Q{b}ffffff", f"TimeUS{i},GyrX,GyrY,GyrZ,AccX,AccY,AccZ", 35 + instances)
    out += fmt(130, "MAG", "Qhhh", "TimeUS,MagX,MagY,MagZ", 17)
    out += fmt(131, "ATT", "QccC", "TimeUS,Roll,Pitch,Yaw", 17)
    out += fmt(132, "GPS", "QBIH", "TimeUS,Status,GMS,GWk", 18)
    out += fmt(133, "PARM", "QNf", "TimeUS,Name,Value", 31)
    out += b"\xa3\x95\x85" + struct.pack("<Q16sf", 1_000_000, b"COMPASS_DEC", 0.2)
    out += b"\xa3\x95\x84" + struct.pack("<QBIH", 2_000_000, 3, 345_600_000, 2290)
    for row, t in enumerate(t_us.tolist()):
        if instances:
            for instance in (0, 1):
                out += b"\xa3\x95\x81" + struct.pack("<QB6f", t, instance, *(gyr[row] + instance), *acc[row])
        else:
            out += b"\xa3\x95\x81" + struct.pack("<Q6f", t, *gyr[row], *acc[row])
        yaw = round(np.rad2deg(0.5 * (t - 1_000_000) / 1e6) * 100)
        out += b"\xa3\x95\x83" + struct.pack("<QhhH", t, 0, 0, yaw)
        if row % 10 == 0:
            out += b"\xa3\x95\x82" + struct.pack("<Qhhh", t, 200, 0, 400)
    return out


def dataflash_text(t_us, gyr, acc, q_nb, field=None):
    """The same as text, as `mavlogdump` and old tools write it: angles with two digits."""
    lines = [
        "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns",
        "FMT, 129, 35, IMU, Qffffff, TimeUS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ",
        "FMT, 130, 17, MAG, Qhhh, TimeUS,MagX,MagY,MagZ", "FMT, 131, 17, ATT, QccC, TimeUS,Roll,Pitch,Yaw",
        "FMT, 133, 31, PARM, QNf, TimeUS,Name,Value", "PARM, 1000000, COMPASS_DEC, 0.2",
    ]  # fmt: skip
    angles = to_deg(euler_zyx_from_quat(q_nb)).tolist()
    for i, t in enumerate(t_us.tolist()):
        yaw, pitch, roll = angles[i]
        lines.append(", ".join(map(str, ["IMU", t, *gyr[i].tolist(), *acc[i].tolist()])))
        lines.append(f"ATT, {t}, {roll:.2f}, {pitch:.2f}, {yaw % 360.0:.2f}")
        if field is not None and i % 10 == 0:
            lines.append(", ".join(map(str, ["MAG", t, *np.round(10.0 * field[i]).astype(int).tolist()])))
    return "\n".join(lines)
