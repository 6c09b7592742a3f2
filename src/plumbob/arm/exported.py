"""Programs as files for robots: tables, URScript, and ROS 2 trajectories as YAML, JSON and MCAP.

The trajectory is `trajectory_msgs/msg/JointTrajectory`: joint names and points with positions, velocities,
accelerations and the time from the start. MCAP holds it as one message, and each sample as a
`sensor_msgs/msg/JointState` for viewers, both in CDR, as ROS 2 records them: little-endian, each number aligned to its
size, counted from behind the head of four bytes (OMG DDSI-RTPS 2.3, 10.5; DDS-XTypes 1.3, 7.4.3).
"""

import json
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from plumbob.arm.angles import RECORDED, TIME, write_table
from plumbob.arm.program import Program
from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.core.files import write_text
from plumbob.core.resources import packaged
from plumbob.core.time import to_ns
from plumbob.core.units import from_si
from plumbob.files.mcap import Schema
from plumbob.files.mcap.verdict import write_rows

SUFFIXES: Final = (".csv", ".parquet", ".mcap", ".yaml", ".yml", ".json", ".script")
_UR_JOINTS: Final = 6  # of every robot of Universal Robots
TRAJECTORY, STATE = "joint_trajectory", "joint_states"  # topics in an MCAP file
_NS: Final = 1_000_000_000
_HEAD: Final = b"\x00\x01\x00\x00"  # plain CDR, little-endian

_TRAJECTORY_TEXT: Final = packaged("arm/joint_trajectory.msg")
_STATE_TEXT: Final = packaged("arm/joint_state.msg")


def export(program: Program, path: str | Path, *, unit: str = "rad", overwrite: bool = False) -> Path:
    """Write a program; the suffix says how.

    Parameters
    ----------
    program : Program
        What `taught` made.
    path : path
        ``.csv`` or ``.parquet``: a table of times and angles; ``.yaml`` or ``.json``: a ROS
        `trajectory_msgs/JointTrajectory`; ``.mcap``: the same, and a `sensor_msgs/JointState` for each sample;
        ``.script``: URScript of six joints, which moves to the start and then follows by ``servoj``.
    unit : {"rad", "deg"}
        Of a ``.csv`` file; the others are always in radians.
    overwrite : bool
        Whether a file that lies there may be replaced.

    Raises
    ------
    ParameterError
        If the suffix or unit is unknown, or a file lies there and `overwrite` is false.
    DecodeError
        If the system refuses.
    """
    file = check.path("path", path)
    suffix = file.suffix.lower()
    if suffix not in SUFFIXES:
        raise ParameterError(f"a program is written as {', '.join(SUFFIXES)}, but it is {file}.")
    check.one_of("unit", unit, ("rad", "deg"))
    if unit != "rad" and suffix != ".csv":
        raise ParameterError(f"{suffix} is always in radians; leave the unit {unit} out, or write a .csv file.")
    if suffix in (".csv", ".parquet"):
        write_table(file, _table(program, unit), source="program", overwrite=overwrite)
    elif suffix == ".mcap":
        _write_mcap(file, program, overwrite)
    elif suffix == ".script":
        write_text(file, "".join(_urscript(program)), overwrite=overwrite)
    elif suffix == ".json":
        write_text(file, json.dumps(trajectory(program), allow_nan=False) + "\n", overwrite=overwrite)
    else:
        write_text(file, "".join(_yaml(program)), overwrite=overwrite)
    return file


def trajectory(program: Program) -> dict[str, Any]:
    """Fields of `trajectory_msgs/JointTrajectory`; times from the start of the program."""
    return {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
        "joint_names": list(program.names),
        "points": [
            {
                "positions": q.tolist(),
                "velocities": v.tolist(),
                "accelerations": a.tolist(),
                "effort": [],
                "time_from_start": dict(zip(("sec", "nanosec"), divmod(ns, _NS), strict=True)),
            }
            for ns, q, v, a in _points(program)
        ],
    }


def _points(program: Program) -> Iterator[tuple[int, Floats, Floats, Floats]]:
    times = to_ns(program.t - program.t[0]).tolist()
    yield from zip(times, program.angles, program.velocities, program.accelerations, strict=True)


def _table(program: Program, unit: str) -> dict[str, Floats]:
    """Times, recorded times and angles; `Program.load` reads them."""
    angles = from_si(program.angles, unit)
    columns = {f"{name} [{unit}]": angles[:, k] for k, name in enumerate(program.names)}
    return {TIME: program.t, RECORDED: np.asarray(program.recorded), **columns}


def _yaml(program: Program) -> Iterator[str]:
    """YAML of the trajectory; JSON is YAML, except that YAML 1.1 wants a point in a number with a power of ten."""
    yield 'header: {stamp: {sec: 0, nanosec: 0}, frame_id: ""}\njoint_names:\n'
    yield from (f"  - {json.dumps(name, ensure_ascii=False)}\n" for name in program.names)
    yield "points:\n"
    for ns, q, v, a in _points(program):
        for k, (key, row) in enumerate((("positions", q), ("velocities", v), ("accelerations", a))):
            yield f"  {' ' if k else '-'} {key}: [{', '.join(map(_yaml_number, row.tolist()))}]\n"
        yield f"    effort: []\n    time_from_start: {{sec: {ns // _NS}, nanosec: {ns % _NS}}}\n"


def _urscript(program: Program) -> Iterator[str]:
    """A function that moves to the first angles, follows the others at the program's rate, stops, and is called."""
    if len(program.names) != _UR_JOINTS:
        raise ParameterError(
            f"URScript is for robots of {_UR_JOINTS} joints, but the program has {len(program.names)}: "
            f"{', '.join(program.names)}. Write .yaml for ROS, or .csv."
        )
    rows = [f"[{', '.join(f'{value:.6f}' for value in row)}]" for row in program.angles.tolist()]
    yield f"def taught():\n  # {json.dumps(program.names)} [rad]\n  movej({rows[0]}, a=0.5, v=0.5)\n"
    steps = np.diff(program.t, append=2.0 * program.t[-1] - program.t[-2])
    yield from (
        f"  servoj({row}, t={step:.4f}, lookahead_time=0.1, gain=300)\n" for row, step in zip(rows, steps, strict=True)
    )
    yield "  stopj(2.0)\nend\ntaught()\n"


def _yaml_number(value: float) -> str:
    text = repr(value)
    mantissa, e, power = text.partition("e")
    return text if not e or "." in mantissa else f"{mantissa}.0e{power}"


class _Cdr(bytearray):
    """Message from a stamp on, behind its head of four bytes, which does not count where numbers are aligned."""

    def __init__(self, ns: int) -> None:
        super().__init__()
        self.time(ns)
        self.texts("")

    def add(self, layout: str, *values: Any) -> None:
        """Numbers of one type; each is aligned to its size."""
        self.extend(bytes(-len(self) % struct.calcsize(f"<{layout[-1]}")) + struct.pack(f"<{layout}", *values))

    def time(self, ns: int) -> None:
        """Seconds, and nanoseconds of the next."""
        self.add("i", ns // _NS)
        self.add("I", ns % _NS)

    def texts(self, *values: str) -> None:
        """Texts, each with its length and closed by a zero."""
        for value in values:
            data = value.encode() + b"\0"
            self.add("I", len(data))
            self.extend(data)

    def doubles(self, *rows: Floats) -> None:
        """Lists of numbers; where one is empty, nothing follows its length."""
        for values in rows:
            self.add("I", len(values))
            if len(values):
                self.add(f"{len(values)}d", *values.tolist())


def _messages(program: Program) -> Iterator[tuple[int, str, bytes]]:
    """The trajectory, and then each state: time, topic and bytes."""
    made, none = _Cdr(0), np.empty(0)
    made.add("I", len(program.names))
    made.texts(*program.names)
    made.add("I", len(program))
    for ns, q, v, a in _points(program):
        made.doubles(q, v, a, none)
        made.time(ns)
    yield 0, TRAJECTORY, _HEAD + made
    for ns, q, v, _ in _points(program):
        made = _Cdr(ns)
        made.add("I", len(program.names))
        made.texts(*program.names)
        made.doubles(q, v, none)
        yield ns, STATE, _HEAD + made


def _write_mcap(file: Path, program: Program, overwrite: bool) -> None:
    schemas = {
        TRAJECTORY: Schema("trajectory_msgs/msg/JointTrajectory", "ros2msg", _TRAJECTORY_TEXT.encode()),
        STATE: Schema("sensor_msgs/msg/JointState", "ros2msg", _STATE_TEXT.encode()),
    }
    channels = {topic: ("cdr", schema) for topic, schema in schemas.items()}
    write_rows(file, channels, _messages(program), epoch_offset_ns=0, metadata={}, overwrite=overwrite)
