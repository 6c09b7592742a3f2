"""Recordings as bags of ROS 1 and ROS 2, and as MCAP with the messages of ROS 2, for programs that know sensor_msgs.

What `ros` says of units and frames holds here, too: quaternions are turned into a world with x East, y North, z up.
REP 103 wants body axes that point forward, left and up: those of a unit whose world is NED point forward, right and
down, and are turned by half a turn about x, which changes signs and loses nothing; `plumbob send --as ros2` does the
same. Axes of several units stay, for the header names the frame of each. A triad without a value has a covariance that
begins with -1 (Imu.msg), and values of zero; a covariance that is not known is zero. The stamp of a message is the UTC
of its sample, or its time where UTC is not known; samples of the magnetometer and the thermometer are messages of their
own, where they have a value.

Bags are written by the package rosbags, which needs no ROS.
"""

import heapq
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import ClockError
from plumbob.core.files import replacing, replacing_folder
from plumbob.core.series import needed
from plumbob.core.time import to_ns
from plumbob.core.units import from_si
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.recording import Recording
from plumbob.files.foreign import ros
from plumbob.files.foreign.ros_bags import METADATA
from plumbob.protocols.attitude.ros2 import CDR, ROS1, header_and_numbers
from plumbob.rotations import Frame, change_frame, dcm_from_quat, quat_multiply, quat_to_xyzw

_LAST_NS: Final = (1 << 31) * 10**9  # stamps of ROS 2 have 32 bits with a sign for seconds
_SIGNS: Final = np.array([1.0, -1.0, -1.0])
_HALF_TURN: Final = np.array([0.0, 1.0, 0.0, 0.0])  # between forward-left-up and forward-right-down
_ABSENT: Final = np.array([-1.0, *[0.0] * 8])


class _Row(NamedTuple):
    """A message: when, on which topic, of which type, and its bytes."""

    t_ns: int
    topic: str
    kind: str
    data: bytes


def write_bag(path: Path, recording: Recording, overwrite: bool = False) -> None:
    """Write a bag of ROS 1; errors as in `plumbob.write`."""
    store = _store("ROS1_NOETIC")
    from rosbags.rosbag1 import Writer

    rows = _rows(recording, ROS1)
    with replacing(path, overwrite=overwrite, seeks=True) as temporary:
        temporary.unlink()  # the writer insists on a name that is free
        with Writer(temporary) as bag:
            _send(rows, partial(bag.add_connection, typestore=store), bag.write)


def write_rosbag2(path: Path, recording: Recording, overwrite: bool = False) -> None:
    """Write the folder of a ROS 2 bag, with MCAP as its storage; errors as in `plumbob.write`."""
    store = _store("ROS2_HUMBLE")
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    rows = _rows(recording)
    with replacing_folder(path, overwrite=overwrite, may_replace=is_rosbag2) as folder:
        bag = Writer(folder, version=8, storage_plugin=StoragePlugin.MCAP)
        bag.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        with bag:
            _send(rows, partial(bag.add_connection, typestore=store), bag.write)


def is_rosbag2(path: Path) -> bool:
    """Whether a folder is a ROS 2 bag and nothing besides."""
    names = [entry.name for entry in path.iterdir()]
    return ros.accepts(path) and all(re.fullmatch(rf"{METADATA}|.*\.(db3|mcap)(\.zstd)?", name) for name in names)


def write_mcap(path: Path, recording: Recording, overwrite: bool = False) -> None:
    """Write one MCAP whose messages and schemas are those of ROS 2; errors as in `plumbob.write`."""
    store = _store("ROS2_HUMBLE")
    from mcap.writer import Writer

    rows = _rows(recording)
    with replacing(path, overwrite=overwrite, seeks=True) as temporary, temporary.open("wb") as file:
        mcap = Writer(file)
        mcap.start(profile="ros2", library="plumbob")

        def add(topic: str, kind: str) -> int:
            text, _ = store.generate_msgdef(kind, ros_version=2)
            schema = mcap.register_schema(kind, "ros2msg", text.encode())
            return mcap.register_channel(topic, "cdr", schema, {"offered_qos_profiles": ""})

        def write(channel: int, t_ns: int, data: bytes) -> None:
            mcap.add_message(channel, t_ns, data, t_ns)

        _send(rows, add, write)
        mcap.finish()  # type: ignore[no-untyped-call]


def _store(name: str) -> Any:
    """Types of messages of a version of ROS."""
    types = needed("rosbags.typesys", "ROS bags", "plumbob[ros]")
    return types.get_typestore(types.Stores[name])


def _send(rows: Iterable[_Row], add: Callable[..., Any], write: Callable[..., Any]) -> None:
    channels: dict[str, Any] = {}
    for row in rows:
        if row.topic not in channels:
            channels[row.topic] = add(row.topic, row.kind)
        write(channels[row.topic], row.t_ns, row.data)


def turned(recording: Recording) -> tuple[Recording, list[str]]:
    """The recording in forward-left-up axes where its own are known to be forward-right-down; and what was done."""
    imu, track = recording.imu, recording.track
    frame = imu.meta.frame if imu is not None else None
    frame = track.frame if frame is None and track is not None else frame
    if recording.array is not None or frame is not Frame.NED:
        unknown = frame is None and recording.array is None
        note = "body axes stay as they are: nothing says whether they point forward, left and up, as in REP 103"
        return recording, [note] if unknown else []
    if imu is not None:
        imu = imu.corrected(meta=imu.meta, **{name: getattr(imu, name) * _SIGNS for name in imu.triads})
    if track is not None:
        cov_b = None if track.cov_b is None else track.cov_b * np.outer(_SIGNS, _SIGNS)
        track = replace(track, q_nb=quat_multiply(track.q_nb, _HALF_TURN), cov_b=cov_b)
    note = (
        "body axes that point forward, right and down are turned to forward, left and up (REP 103): y and z change sign"
    )
    return replace(recording, imu=imu, track=track), [note]


def _rows(recording: Recording, encoding: str = CDR) -> Iterator[_Row]:
    """Messages in the order of time; their stamps are judged before the first is made."""
    recording, _ = turned(recording)
    track = recording.track
    if recording.array is not None:
        track = None  # that of their body
        units = {f"/{_name(name)}/imu": (_name(name), imu) for name, imu in recording.array.units.items()}
    elif recording.imu is not None:
        # REP 145's where the device has no name, and none of those of a world with z down
        device = recording.imu.meta.device
        frame = "imu_link" if device == "unknown" else device.lstrip("/") + ("_enu" if device.endswith("_ned") else "")
        units = {"/imu": (frame, recording.imu)}
    else:
        assert track is not None
        return _messages(encoding, "/imu/data", "Imu", "imu_link", to_ns(track.t), _imu_numbers(None, track))
    streams = []
    for topic, (frame, imu) in units.items():
        stamps = imu.t_ns + imu.meta.t0_ns
        attitude = track if track is not None and np.array_equal(track.t, imu.t) else None
        name, numbers = f"{topic}/{'data_raw' if attitude is None else 'data'}", _imu_numbers(imu, attitude)
        streams.append(_messages(encoding, name, "Imu", frame, stamps, numbers))
        fields = None if imu.mag is None else from_si(imu.mag, "T")
        temperatures = None if imu.temp_c is None else imu.temp_c[:, np.newaxis]
        for name, kind, values, covs in (
            ("mag", "MagneticField", fields, 9),
            ("temperature", "Temperature", temperatures, 1),
        ):
            if values is not None:  # a message where there is a value; its covariance is not known
                some = ~np.isnan(values).all(axis=1)
                numbers = np.pad(values[some], ((0, 0), (0, covs)))
                streams.append(_messages(encoding, f"{topic}/{name}", kind, frame, stamps[some], numbers))
    return heapq.merge(*streams, key=lambda row: row.t_ns)


def _name(text: str) -> str:
    """A name as topics and frames of ROS take it: letters, digits and _, not a digit first."""
    name = re.sub(r"[^A-Za-z0-9_]+", "_", text)
    return name if re.match(r"[A-Za-z]", name) else f"u{name}"


def _messages(
    encoding: str, topic: str, kind: str, frame: str, stamps: NDArray[np.int64], numbers: Floats
) -> Iterator[_Row]:
    """A message of sensor_msgs for each row of numbers (N, K)."""
    if stamps.size and (int(stamps[0]) < 0 or int(stamps[-1]) >= _LAST_NS):
        raise ClockError("its times lie before 1970 or after 2038, which ROS stamps cannot hold.")
    rows = zip(stamps.tolist(), numbers.astype("<f8"), strict=True)
    return (
        _Row(t_ns, topic, f"sensor_msgs/msg/{kind}", header_and_numbers(encoding, t_ns, frame, row.tobytes()))
        for t_ns, row in rows
    )


def _imu_numbers(imu: ImuData | None, track: AttitudeTrack | None) -> Floats:
    """Quaternions xyzw in ENU, rates and specific forces, with their covariances about the axes of world and body."""
    count = len(imu if track is None else track)  # type: ignore[arg-type]
    parts: list[Floats] = []
    if track is None:
        parts += [np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)), np.tile(_ABSENT, (count, 1))]
    else:
        q_nb = change_frame(track.q_nb, to=Frame.ENU, from_=track.frame)
        covs = np.zeros((count, 9))
        if track.cov_b is not None:
            c_nb = dcm_from_quat(q_nb)
            covs = np.nan_to_num(c_nb @ track.cov_b @ np.swapaxes(c_nb, 1, 2)).reshape(-1, 9)
        valid = track.known[:, np.newaxis]
        parts += [np.where(valid, quat_to_xyzw(q_nb), [0.0, 0.0, 0.0, 1.0]), np.where(valid, covs, _ABSENT)]
    for triad in (None, None) if imu is None else (imu.gyr, imu.acc):
        values = np.full((count, 3), np.nan) if triad is None else triad
        absent = np.isnan(values).all(axis=1, keepdims=True)
        parts += [np.where(absent, 0.0, values), np.where(absent, _ABSENT, 0.0)]
    return np.concatenate(parts, axis=1)
