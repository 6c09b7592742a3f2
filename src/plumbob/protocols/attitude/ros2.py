"""sensor_msgs/msg/Imu of ROS 2 in CDR, as it stands in an MCAP file: no ROS is needed to write it.

The message is of forward-left-up axes in ENU [REP 103, ros.org/reps/rep-0103.html], and the covariance of the
orientation is about the axes of ENU; the linear acceleration is specific force, which points up at rest; a first
covariance of −1 says that a quantity is absent, and covariances of 0 that they are not known [REP 145;
sensor_msgs/msg/Imu]. CDR here is little-endian, aligned behind its four bytes of representation [OMG DDS-XTypes].
"""

import struct
from typing import IO, Any, Final, cast

import numpy as np

from plumbob.core.resources import packaged
from plumbob.protocols.attitude import AttitudeSample
from plumbob.rotations import Frame, change_frame, dcm_from_quat, quat_from_rotvec, quat_multiply

CDR: Final = "cdr"
ROS1: Final = "ros1"
TYPE: Final = "sensor_msgs/msg/Imu"
DEFINITION: Final = packaged("protocols/attitude/imu.msg")
_ABSENT: Final = (-1.0, *(0.0,) * 8)
_UNKNOWN: Final = (0.0,) * 9
_FLU: Final = np.array([1.0, -1.0, -1.0])


def imu(a: AttitudeSample, frame_id: str = "imu_link") -> bytes:
    """The message; an attitude that is not reliable is absent from it."""
    values = [0.0, 0.0, 0.0, 1.0, *_ABSENT]
    if a.reliable and a.q_nb is not None:
        half = quat_from_rotvec(np.array([np.pi, 0.0, 0.0]))
        q = change_frame(a.q_nb, to=Frame.ENU, from_=Frame.NED)
        w, x, y, z = quat_multiply(q, half).tolist()
        c_nb = dcm_from_quat(q)
        cov = _UNKNOWN if a.cov_b is None else (c_nb @ np.reshape(a.cov_b, (3, 3)) @ c_nb.T).ravel().tolist()
        values = [x, y, z, w, *cov]
    for frd in (a.rates_b, a.acc_b):
        values += (0.0, 0.0, 0.0, *_ABSENT) if frd is None else (*(np.asarray(frd) * _FLU + 0.0).tolist(), *_UNKNOWN)
    return header_and_numbers(CDR, a.t_ns, frame_id, struct.pack(f"<{len(values)}d", *values))


def header_and_numbers(encoding: str, t_ns: int, frame_id: str, numbers: bytes) -> bytes:
    """A message of std_msgs/Header and float64, in `CDR`, or in `ROS1`: without padding, behind a counter."""
    name = frame_id.encode() + (b"\0" if encoding == CDR else b"")
    head = struct.pack("<iII", *divmod(t_ns, 1_000_000_000), len(name)) + name
    return b"\0\1\0\0" + head + bytes(-len(head) % 8) + numbers if encoding == CDR else bytes(4) + head + numbers


class _Drain:
    """Takes what is written, knows how much that was, and hands it on."""

    def __init__(self) -> None:
        self._found, self._at = bytearray(), 0

    def write(self, data: Any) -> int:
        self._found += data
        self._at += len(data)
        return len(data)

    def tell(self) -> int:
        return self._at

    def flush(self) -> None:
        """Nothing is held back."""

    def take(self) -> bytes:
        chunk = bytes(self._found)
        self._found.clear()
        return chunk


class Imus:
    """An MCAP file of Imu messages, in pieces: the file grows by one whole message after the other."""

    def __init__(self, topic: str = "/imu", frame_id: str = "imu_link") -> None:
        from mcap.writer import CompressionType, Writer

        self._drain, self._frame_id, self._count = _Drain(), frame_id, 0
        self._writer: Any = Writer(cast(IO[Any], self._drain), chunk_size=1, compression=CompressionType.NONE)
        self._writer.start(profile="ros2", library="plumbob")
        schema = self._writer.register_schema(name=TYPE, encoding="ros2msg", data=DEFINITION.encode())
        self._channel = self._writer.register_channel(topic=topic, message_encoding="cdr", schema_id=schema)

    def encode(self, a: AttitudeSample) -> bytes:
        """Bytes of the file with this attitude."""
        self._count += 1
        data = imu(a, self._frame_id)
        self._writer.add_message(
            self._channel, log_time=a.t_ns, publish_time=a.t_ns, data=data, sequence=self._count & 0xFFFFFFFF
        )
        return self._drain.take()

    def finish(self) -> bytes:
        """Bytes that end the file."""
        self._writer.finish()
        return self._drain.take()
