"""Bags that the package rosbags writes, which shares nothing with our reader."""

from functools import partial
from typing import NamedTuple

import numpy as np
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

T0 = 1_700_000_000_123_456_789
"""First stamp, ns: UTC in 2023."""
STEP = 10_000_000
LATE = 5_000_000
"""By how much later than its stamp the recorder took a message, ns."""
ROWS = 150
ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)


class Row(NamedTuple):
    """One message: when it was taken, where, of which type, and its fields."""

    log_ns: int
    topic: str
    kind: str
    fields: dict


def samples(seed=1, rows=ROWS):
    """Rates, forces about +g, fields, T, temperatures, and quaternions xyzw."""
    rng = np.random.default_rng(seed)
    xyzw = rng.normal(size=(rows, 4))
    return {
        "gyr": rng.normal(size=(rows, 3)), "acc": rng.normal(size=(rows, 3)) + [0.0, 0.0, 9.8],
        "mag": (rng.normal(size=(rows, 3)) + [0.0, 20.0, -40.0]) * 1e-6, "temp_c": 20.0 + rng.normal(size=rows),
        "xyzw": xyzw / np.linalg.norm(xyzw, axis=1, keepdims=True),
    }  # fmt: skip


def header(stamp_ns, frame):
    return {"stamp": stamp_ns, "frame_id": frame}


def _since(given, i):
    """Time of a row, ns: by its own stamps where there are some."""
    return int(given["t_ns"][i]) if "t_ns" in given else i * STEP


def imu_rows(given, topic="/imu/data", frame="imu_link", t0=T0, covs=(0.01, 0.0, 0.0), stamped=True):
    """Messages of an IMU, with the first numbers of its covariances: orientation, rate, acceleration."""
    for i in range(len(given["gyr"])):
        stamp = t0 + _since(given, i)
        cov = [np.diag([first, 0.02, 0.03]).ravel() for first in covs]
        fields = {
            "header": header(stamp if stamped else 0, frame), "orientation": given["xyzw"][i],
            "orientation_covariance": cov[0] if covs[0] else np.zeros(9), "angular_velocity": given["gyr"][i],
            "angular_velocity_covariance": cov[1], "linear_acceleration": given["acc"][i],
            "linear_acceleration_covariance": cov[2],
        }  # fmt: skip
        yield Row(stamp + LATE, topic, "sensor_msgs/msg/Imu", fields)


def mag_rows(given, topic="/imu/mag", frame="imu_link", every=1):
    for i in range(0, len(given["mag"]), every):
        stamp = T0 + _since(given, i)
        fields = {
            "header": header(stamp, frame),
            "magnetic_field": given["mag"][i],
            "magnetic_field_covariance": np.zeros(9),
        }
        yield Row(stamp + LATE, topic, "sensor_msgs/msg/MagneticField", fields)


def temperature_rows(given, topic="/imu/temperature", frame="imu_link", every=10):
    for i in range(0, len(given["temp_c"]), every):
        stamp = T0 + _since(given, i)
        fields = {"header": header(stamp, frame), "temperature": float(given["temp_c"][i]), "variance": 0.0}
        yield Row(stamp + LATE, topic, "sensor_msgs/msg/Temperature", fields)


def all_rows(given=None):
    """What a common driver records: IMU, a slow magnetometer, a thermometer, and a text."""
    given = samples() if given is None else given
    rows = [*imu_rows(given), *mag_rows(given, every=4), *temperature_rows(given)]
    rows.append(Row(T0, "/chatter", "std_msgs/msg/String", {"data": "hello"}))
    return sorted(rows, key=lambda row: row.log_ns)


def message(row, store):
    """The row as a message of a store's types."""
    of = store.types
    vectors = {
        "angular_velocity": "Vector3", "linear_acceleration": "Vector3", "magnetic_field": "Vector3",
        "translation": "Vector3", "position": "Point", "orientation": "Quaternion", "rotation": "Quaternion",
        "quaternion": "Quaternion",
    }  # fmt: skip

    def value(name, given):
        if name == "header":
            stamp = of["builtin_interfaces/msg/Time"](*divmod(given["stamp"], 10**9))
            counter = {"seq": 7} if store is ROS1 else {}
            return of["std_msgs/msg/Header"](stamp=stamp, frame_id=given["frame_id"], **counter)
        if name in vectors:
            return of[f"geometry_msgs/msg/{vectors[name]}"](*map(float, given))
        if isinstance(given, tuple):  # type, fields
            return of[given[0]](**{key: value(key, one) for key, one in given[1].items()})
        return given

    return of[row.kind](**{name: value(name, one) for name, one in row.fields.items()})


def _fill(bag, rows, store, serialize):
    connections = {}
    for row in rows:
        key = (row.topic, row.kind)
        if key not in connections:
            connections[key] = bag.add_connection(*key, typestore=store)
        bag.write(connections[key], row.log_ns, serialize(message(row, store), row.kind))


def write_1(path, rows, compression=None):
    bag = Writer1(path)
    if compression:
        bag.set_compression(Writer1.CompressionFormat[compression])
    with bag:
        _fill(bag, rows, ROS1, ROS1.serialize_ros1)
    return path


def write_2(path, rows, storage="SQLITE3", mode="NONE", **order):
    bag = Writer2(path, version=8, storage_plugin=StoragePlugin[storage])
    bag.set_compression(CompressionMode[mode], CompressionFormat.ZSTD)
    with bag:
        _fill(bag, rows, ROS2, partial(ROS2.serialize_cdr, **order))
    return path


def write_mcap(path, rows, profile="ros1", ros=1, **options):
    """By the library of MCAP, as `mcap convert a.bag` makes one of ROS 1."""
    store, words, encoding = ((ROS1, "ros1msg", "ros1"), (ROS2, "ros2msg", "cdr"))[ros - 1]
    with path.open("wb") as file:
        writer, channels = McapWriter(file, **options), {}
        writer.start(profile, "somebody")
        for row in rows:
            if row.topic not in channels:
                name = row.kind if ros == 2 else row.kind.replace("/msg/", "/")
                text = store.generate_msgdef(row.kind)[0].encode() if ros == 1 else b""
                schema = writer.register_schema(name, words, text)
                channels[row.topic] = writer.register_channel(row.topic, encoding, schema)
            serialize = store.serialize_ros1 if ros == 1 else store.serialize_cdr
            data = bytes(serialize(message(row, store), row.kind))
            writer.add_message(channels[row.topic], row.log_ns, data, row.log_ns)
        writer.finish()
    return path


CONTAINERS = {
    "bag": lambda folder, rows: write_1(folder / "a.bag", rows),
    "bag, bz2": lambda folder, rows: write_1(folder / "a.bag", rows, "BZ2"),
    "bag, lz4": lambda folder, rows: write_1(folder / "a.bag", rows, "LZ4"),
    "folder, db3": lambda folder, rows: write_2(folder / "a", rows),
    "folder, db3.zstd": lambda folder, rows: write_2(folder / "a", rows, mode="FILE"),
    "folder, db3 of zstd messages": lambda folder, rows: write_2(folder / "a", rows, mode="MESSAGE"),
    "folder, mcap": lambda folder, rows: write_2(folder / "a", rows, "MCAP"),
    "folder, mcap of zstd chunks": lambda folder, rows: write_2(folder / "a", rows, "MCAP", "STORAGE"),
    "db3": lambda folder, rows: write_2(folder / "a", rows) / "a.db3",
    "folder, db3, big-endian": lambda folder, rows: write_2(folder / "a", rows, little_endian=False),
    "mcap of ROS 1": lambda folder, rows: write_mcap(folder / "a.mcap", rows),
    "mcap of ROS 1, told by its channels": lambda folder, rows: write_mcap(folder / "a.mcap", rows, ""),
    "mcap": lambda folder, rows: write_2(folder / "a", rows, "MCAP", "STORAGE") / "a.mcap",
}
