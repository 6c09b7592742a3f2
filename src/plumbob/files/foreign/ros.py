"""Bags of ROS: samples of sensor_msgs, and poses as attitudes.

Units, axes and frames are those of REP 103 (https://www.ros.org/reps/rep-0103.html), REP 145 (rep-0145.html, drivers of
inertial sensors) and the comments in sensor_msgs/Imu.msg and MagneticField.msg: rad/s, m/s² of specific force (at rest,
up and +g), tesla, °C, quaternions xyzw, a world with x East, y North, z up, or north, east, down where the name of the
frame ends in ``_ned``. Body axes are those of the frame that a message names, as the driver gave them; REP 103 asks for
forward, left, up. Yaw counts from magnetic north where the unit has a magnetometer and uses it, and from anywhere where
it has none (REP 145); no message says which, so headings are `North.FREE`. A first number of a covariance that is -1
(Imu.msg) or NaN (REP 145) says that a quantity is not there, and all zeros that the covariance is not known.

The stamp in a message's header is when it was measured, and leads; when the recorder took it counts only where no
stamp was set. Stamps are UTC where they lie behind the year 2001; earlier ones are of a simulation or since power-on.
"""

import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import takewhile
from pathlib import Path
from typing import Final

import numpy as np
from mcap.reader import SeekingReader

from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, ParameterError, UnitError
from plumbob.core.findings import Note, info, warning
from plumbob.core.text import first_words
from plumbob.core.units import to_si
from plumbob.data import AttitudeTrack, ImuData, ImuMeta
from plumbob.data.array import ImuArray, named_unit
from plumbob.data.recording import Recording
from plumbob.files.foreign import ros_bags
from plumbob.files.foreign.logged import SensorLog, first_bytes, joined_recordings
from plumbob.files.foreign.ros_bags import Bag, MessageTable, Topic
from plumbob.files.stamps import time_line
from plumbob.rotations import Frame, North, dcm_from_quat, quat_from_xyzw

IMU: Final = "sensor_msgs/Imu"
MAG: Final = "sensor_msgs/MagneticField"
TEMPERATURE: Final = "sensor_msgs/Temperature"
POSES: Final = {
    "geometry_msgs/PoseStamped": 3,
    "geometry_msgs/PoseWithCovarianceStamped": 3,
    "geometry_msgs/QuaternionStamped": 0,
    "geometry_msgs/TransformStamped": 3,
    "nav_msgs/Odometry": 3,
}  # types that hold an attitude, and the column at which its quaternion begins
UTC_FROM: Final = 10**18  # stamps from here on, ns, are taken for UTC: 2001-09-09
_WORLD: Final = (
    "; yaw counts from magnetic north if the unit uses a magnetometer (REP 145), which is not said: North is free"
)
_SENSOR: Final = re.compile(r"(gyro?(scope)?|accel(erometer)?)")


def accepts(path: Path) -> bool:
    """Whether a path is a bag, by its first bytes; an MCAP by its profile, or its summary's channels; none of ours."""
    if path.is_dir():
        return b"rosbag2_bagfile_information" in first_bytes(path / ros_bags.METADATA)
    suffix = path.suffix.lower()
    if suffix == ".mcap":
        return _is_ros_mcap(path)
    return first_bytes(path, 16).startswith(ros_bags.SQLITE if suffix == ".db3" else ros_bags.BAG)


def _is_ros_mcap(path: Path) -> bool:
    with path.open("rb") as file, suppress(Exception):  # a damaged one is none; each compression has errors of its own
        reader = SeekingReader(file, record_size_limit=path.stat().st_size)
        head = reader.get_header()
        if head.profile in {"ros1", "ros2"}:
            return True
        summary = None if "plumbob" in head.library else reader.get_summary()
        channels = [] if summary is None else summary.channels.values()
        return any(channel.message_encoding in {"cdr", "ros1"} for channel in channels)
    return False


def read(path: Path, unit: str | None = None) -> Recording:
    """Samples of the IMU of a bag, with its orientation as a track; or, where there is none, the attitudes of poses.

    Several IMUs on the same stamps are an array, called by their topics. Else `unit` chooses: a topic, or its number in
    the message that lists them. Poses beside an IMU are left out unless asked for: their body is seldom the IMU's.
    """
    bag = ros_bags.open_bag(path)
    recording = _recording(bag, path.stem, unit)
    return replace(recording, notes=(*recording.notes, *dict.fromkeys(bag.damage)))


def _recording(bag: Bag, name: str, unit: str | None) -> Recording:
    topics = [topic for topic in bag.topics.values() if topic.count]
    imus = [topic for topic in topics if topic.kind == IMU]
    poses = [topic for topic in topics if topic.kind in POSES]
    if not imus and not poses:
        content = f"it holds {_listed(topics)}" if topics else "it holds no message"
        raise DecodeError(
            f"{content}, but neither inertial data (sensor_msgs/Imu) nor poses. Record the IMU's topic, as /imu/data."
            + "".join(f" {damage}." for damage in bag.damage)
        )
    taken = _without_raw(imus) or poses
    if unit is not None:
        name_taken = named_unit([topic.name for topic in imus + poses], unit)
        taken = [topic for topic in imus + poses if topic.name == name_taken][:1]
    if taken[0].kind in POSES:
        if len(taken) > 1:
            raise ParameterError(
                f"it holds no inertial data (sensor_msgs/Imu), but poses, which can be read as attitudes: "
                f"{_listed(taken)}. Name one with --unit {taken[0].name} (in Python, unit='{taken[0].name}')."
            )
        return _of_pose(taken[0], topics, name)
    return _of_imus(taken, topics, name)


def _listed(topics: Sequence[Topic]) -> str:
    return first_words([str(topic) for topic in topics], 12)


def _without_raw(imus: list[Topic]) -> list[Topic]:
    """IMUs without those of which imu_tools' filter made another: it takes ``imu/data_raw`` and gives ``imu/data``."""
    names = {topic.name for topic in imus}
    return [topic for topic in imus if topic.name.removesuffix("_raw") not in names - {topic.name}]


def _left_out(topics: Iterable[Topic], used: Iterable[Topic]) -> list[Note]:
    taken = list(used)
    rest = [topic for topic in topics if topic not in taken]
    return [info("source.left_out", names=_listed(rest))] if rest else []


def _measured(table: MessageTable) -> dict[str, Floats]:
    """Triads that an IMU's messages hold: neither absent by their covariance nor zero in every one, as no sensor is."""
    triads = {}
    for key, at, said in (("gyr", 13, 16), ("acc", 25, 28)):
        values = _present(table.numbers[:, at : at + 3], table.numbers[:, said])
        if np.isfinite(values).any() and (np.nan_to_num(values).any() or len(values) < 3):
            triads[key] = values
    return triads


def _is_one(several: list[Topic], tables: list[MessageTable]) -> bool:
    """Whether topics are one IMU, whose triads come apart: none twice, in one frame or under one name."""
    measured = [_measured(table) for table in tables]
    triads = [triad for of_table in measured for triad in of_table]
    names = {_SENSOR.sub("", topic.name) for topic in several}
    frames = {_SENSOR.sub("", frame) for table in tables for frame in table.frames}
    is_complete = len(set(triads)) == len(triads) >= len(tables)
    return is_complete and all(measured) and (len(names) == 1 or len(frames) == 1)


def _of_imus(several: list[Topic], topics: list[Topic], name: str) -> Recording:
    tables = [ros_bags.table(topic) for topic in several]
    is_one = len(several) > 1 and _is_one(several, tables)
    if not is_one and any(not np.array_equal(table.t_ns, tables[0].t_ns) for table in tables):
        raise ParameterError(
            f"it holds several IMUs, whose stamps differ: {_listed(several)}. Name one with --unit "
            f"{several[0].name} (in Python, unit='{several[0].name}')."
        )
    units = [_unit(topic, table, topics) for topic, table in zip(several, tables, strict=True)]
    used = [topic for _, sources in units for topic in sources]
    omitted = _left_out(topics, used)
    if is_one:
        together = joined_recordings([unit for unit, _ in units if unit.imu is not None], name)
        why = info("source.ros_joined", topics=_listed(several))
        return replace(together, notes=(info("source.ros"), why, *together.notes, *omitted))
    notes = [info("source.ros"), *(line for unit, _ in units for line in unit.notes), *omitted]
    if any(topic.kind in {MAG, TEMPERATURE} and topic not in used for topic in topics):
        notes.append(info("source.ros_one_magnetometer"))
    if len(units) == 1:
        return replace(units[0][0], name=name, notes=tuple(dict.fromkeys(notes)))
    notes += [info("source.ros_orientation_left_out", name=sources[0].name) for unit, sources in units if unit.track]
    samples = {sources[0].name: unit.imu for unit, sources in units if unit.imu is not None}
    if not samples:
        raise ParameterError(f"it holds orientations alone, on {_listed(several)}. Name one with --unit.")
    return Recording(array=ImuArray(samples), name=name, notes=tuple(dict.fromkeys(notes)))


def _unit(topic: Topic, table: MessageTable, topics: list[Topic]) -> tuple[Recording, list[Topic]]:
    """Samples and orientation of one IMU, the magnetometer and thermometer in its frame too, and what they are of."""
    stamps, notes = table.t_ns, [*table.notes]
    if len(table.frames) > 1:
        raise DecodeError(f"{topic.name}: its messages are in the frames {', '.join(table.frames[:5])}, not in one.")
    meta, used = ImuMeta(device=next(iter(table.frames), topic.name), frame=_world(table)), [topic]
    is_utc = stamps.size > 0 and int(stamps[0]) >= UTC_FROM
    notes += [] if is_utc else [info("source.ros_no_utc", stamp=stamps[0])]
    log = SensorLog(notes, meta, 0 if is_utc else None)
    for key, values in _measured(table).items():
        log.add(key, stamps, values)
    for key in sorted({"gyr", "acc"} - set(log.streams)):
        notes.append(info("source.ros_absent", name=topic.name, key=key))
    track = _orientation(topic, table, notes)
    if not log.streams:
        if track is None:
            raise DecodeError(f"{topic.name} holds neither rates, accelerations nor orientations of norm 1.")
        return Recording(track=track, notes=tuple(notes)), used
    for key, kind in (("mag", MAG), ("temp_c", TEMPERATURE)):
        if beside := _in_frame(kind, topic, table, topics):
            _add(key, *beside, log, used)
    made = log.joined()
    return Recording(imu=made.imu, track=track, notes=(*notes, *made.notes)), used


def _present(values: Floats, said: Floats) -> Floats:
    """Values, NaN where the first number of their covariance says that there are none."""
    absent = (said == -1.0) | np.isnan(said)
    return np.where(absent[:, np.newaxis], np.nan, values) if absent.any() else values


def _in_frame(kind: str, imu: Topic, table: MessageTable, topics: list[Topic]) -> tuple[Topic, MessageTable] | None:
    """The topic of a type in the IMU's frame; of several, the one whose name begins most like the IMU's."""
    candidates = [(topic, ros_bags.table(topic)) for topic in topics if topic.kind == kind]
    candidates = [(topic, other) for topic, other in candidates if other.frames == table.frames]

    def alike(candidate: tuple[Topic, MessageTable]) -> int:
        """Parts of both names that are the same, from the first."""
        pairs = zip(candidate[0].name.strip("/").split("/"), imu.name.strip("/").split("/"), strict=False)
        return sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs))

    return max(candidates, key=alike, default=None)


def _add(key: str, topic: Topic, table: MessageTable, log: SensorLog, used: list[Topic]) -> None:
    """Take in a stream unless it cannot be in its unit."""
    numbers, notes = table.numbers, log.notes
    if key == "mag":
        values = to_si(_present(numbers[:, :3], numbers[:, 3]), "T")
    else:
        values = np.where(np.isfinite(numbers[:, 0]), numbers[:, 0], np.nan)
    if not np.isfinite(values.reshape(len(values), -1)).all(axis=1).any():
        notes.append(info("source.topic_empty", name=topic.name))
        return
    if key == "mag":
        try:
            ImuData(t=np.arange(len(values), dtype=np.float64), mag=values)
        except UnitError as error:
            notes.append(warning("reading.ros_no_tesla", name=topic.name, error=error))
            return
    used.append(topic)
    log.add(key, table.t_ns, values)


def _orientation(topic: Topic, table: MessageTable, notes: list[Note]) -> AttitudeTrack | None:
    """Orientation that an IMU tells, where it tells one."""
    numbers = table.numbers
    xyzw = _present(numbers[:, :4], numbers[:, 4])
    unset = (xyzw == 0.0).all(axis=1)  # as ROS 1 fills a message; ROS 2 with no turn
    xyzw = np.where(unset[:, np.newaxis], np.nan, xyzw)
    if unset.all() or ((xyzw == (0.0, 0.0, 0.0, 1.0)).all() and not numbers[:, 4:13].any()):
        notes.append(info("source.ros_orientation_default", name=topic.name))
        return None
    return _track(topic, table, xyzw, notes, cov_n=numbers[:, 4:13].reshape(-1, 3, 3))


def _world(table: MessageTable) -> Frame:
    """World of a message whose frame has this name (REP 103, REP 145)."""
    return Frame.NED if any(name.endswith("_ned") for name in table.frames) else Frame.ENU


def _track(
    topic: Topic,
    table: MessageTable,
    xyzw: Floats,
    notes: list[Note],
    *,
    cov_n: Floats | None = None,
    start: int | None = None,
) -> AttitudeTrack | None:
    """Track of quaternions, unknown where not of norm 1; None if all are. Time begins at `start`, ns, or the first."""
    norms = np.linalg.norm(xyzw, axis=1)
    wrong = ~(np.abs(norms - 1.0) <= 1e-3)
    if (some := norms[wrong & ~np.isnan(xyzw).all(axis=1)]).size:
        notes.append(warning("reading.ros_no_rotations", name=topic.name, count=some.size, norm=np.median(some)))
    if wrong.all():
        return None
    line = time_line(table.t_ns)
    notes += (finding.on(topic.name) for finding in line.notes)
    q_nb = quat_from_xyzw(np.where(wrong[:, np.newaxis], np.nan, xyzw))
    cov_b = None
    if cov_n is not None and cov_n.any():
        good = np.isfinite(cov_n).all(axis=(1, 2)) & cov_n.any(axis=(1, 2)) & (cov_n[:, 0, 0] != -1.0)
        covs = np.where(good[:, np.newaxis, np.newaxis], cov_n, np.nan)
        c_nb = dcm_from_quat(q_nb)
        cov_b = np.swapaxes(c_nb, 1, 2) @ covs @ c_nb
        notes.append(info("source.ros_covariance_axes", name=topic.name))
    frame = _world(table)
    axes = "north, east, down" if frame is Frame.NED else "east, north, up"
    notes.append(info("source.ros_world", name=topic.name, axes=axes, world=_WORLD))
    return AttitudeTrack(
        t=(line.t_ns - (line.t_ns[0] if start is None else start)) / 1e9,
        q_nb=q_nb,
        frame=frame,
        north=North.FREE,
        cov_b=cov_b,
        source=f"{topic.kind} of {topic.name}",
    )


def _of_pose(topic: Topic, topics: list[Topic], name: str) -> Recording:
    table = ros_bags.table(topic)
    notes = [*table.notes]
    imus = [other for other in topics if other.kind == IMU]
    leading = _without_raw(imus)[:1] or [other for other in topics if other.kind in POSES]
    start = min(int(ros_bags.table(lead).t_ns[0]) for lead in leading)
    track = _track(topic, table, table.numbers[:, POSES[topic.kind] :][:, :4], notes, start=start)
    if track is None:
        raise DecodeError(f"{topic.name} holds no quaternion of norm 1.")
    head = [] if imus else [info("source.ros_pose_alone")]
    frames = info("source.ros_pose", topic=topic.name, frames=", ".join(table.frames) or "a frame without a name")
    zero = info("source.ros_zero_of_imu" if imus else "source.ros_zero_of_poses", stamp=start)
    return Recording(track=track, name=name, notes=(*head, frames, *notes, zero, *_left_out(topics, [topic])))
