"""Rows of a recording's decoded channels: JSON with a schema, as viewers plot it, every number exact to the bit."""

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain, repeat
from types import NoneType
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, one_line
from plumbob.core.event import Event
from plumbob.core.flags import names
from plumbob.core.resources import packaged
from plumbob.core.units import to_deg
from plumbob.data import TRIADS, AttitudeTrack, ImuData
from plumbob.files.mcap import Recorder, Schema

IMU: Final = "imu"
ATTITUDE: Final = "attitude"
JOINTS: Final = "joints"
EVENTS: Final = "events"
RECORDER: Final = "recorder"
RAW: Final = "raw"
TRANSFORMS: Final = "tf"


_ADVICE: Final = "the file is damaged, or was not made by Plumbob."
Whole = TypeVar("Whole", np.int64, np.uint32)
_SCHEMAS: Final[dict[str, Any]] = json.loads(packaged("live/rows.json"))
"""JSON Schema of the rows of each topic, and of what Foxglove's viewers get besides: transforms are theirs
(https://docs.foxglove.dev/docs/sdk/schemas/frame-transform)."""


def named_topic(kind: str, name: str) -> str:
    """Topic of one of several units or sources; that of the only one, or the first source, is the kind alone."""
    return f"{kind}/{name}" if name else kind


def unit_of_topic(topic: str) -> str | None:
    """Unit whose samples a topic holds, an empty one of the only unit; None where it holds something else."""
    kind, _, unit = topic.partition("/")
    return unit if kind == IMU else None


def line_of(t: float, degrees: Iterable[float], word: int) -> str:
    """Line of the text for angles: s, degrees, and the names of the flags."""
    return f"{t:.6f}\t{chr(9).join(f'{value:.4f}' for value in degrees)}\t{'+'.join(names(word))}"


def joint_lines(joints: Any, places: list[int] | slice = slice(None), *, head: bool) -> Iterator[str]:
    """Lines of joint angles as text, each angle with its standard deviation; with their names, if `head`."""
    if head:
        yield "\t".join(("t [s]", *(f"{name}{end} [deg]" for name in joints.names for end in ("", "_sd")), "flags\n"))
    degrees = to_deg(np.stack((joints.angles[places], joints.sd[places]), axis=2)).reshape(-1, 2 * len(joints.names))
    for t, row, word in zip(joints.t[places].tolist(), degrees.tolist(), joints.flags[places].tolist(), strict=True):
        yield line_of(t, row, word) + "\n"


def declare(recorder: Recorder, topic: str) -> int:
    """Declare a channel of rows, and return its number."""
    return recorder.channel(topic, *row_schema(topic))


def row_schema(topic: str) -> tuple[str, Schema]:
    """Encoding and schema of the rows of a topic."""
    kind = topic.partition("/")[0]
    schema = _SCHEMAS[EVENTS if kind == RECORDER else kind]
    return "json", Schema(schema["title"], "jsonschema", json.dumps(schema, ensure_ascii=False).encode())


def event_row(event: Event) -> bytes:
    """Row of an event."""
    fields = {"t_ns": event.t_ns, "kind": event.kind, "text": event.text, "count": event.count}
    return json.dumps(fields, ensure_ascii=False).encode()


def parsed_event(row: bytes) -> Event:
    """Event of a row; DecodeError where it is none."""
    event = Event(**parsed(EVENTS, row))
    if [type(value) for value in (event.t_ns, event.kind, event.text, event.count)] != [int, str, str, int]:
        raise DecodeError(f"a row of '{EVENTS}' is not an event with a time, two texts and a count; {_ADVICE}")
    return event


def parsed(topic: str, row: bytes) -> dict[str, Any]:
    """Row of a topic with the keys of its schema; what stands under them is judged by `table` and `whole`."""
    where = f"a row of '{topic}'"
    content = parsed_object(where, row)
    keys = _SCHEMAS[topic.partition("/")[0]]["properties"].keys()
    if not keys <= content.keys():
        raise DecodeError(f"{where} lacks {', '.join(sorted(keys - content.keys()))}; {_ADVICE}")
    return {key: content[key] for key in keys}


def row_ns(topic: str, row: bytes) -> int:
    """Time of a row of a topic, ns; DecodeError where it has none."""
    t_ns = parsed(topic, row)["t_ns"]
    if type(t_ns) is not int:
        raise DecodeError(f"a row of '{topic}' has no whole number of nanoseconds as its time; {_ADVICE}")
    return t_ns


def shifted(row: bytes, by_ns: int) -> bytes:
    """Row of ours with its own time later by so much, ns."""
    if not by_ns:
        return row
    head, _, rest = row.partition(b",")
    return b'{"t_ns":%d,%b' % (int(head.removeprefix(b'{"t_ns":')) + by_ns, rest)


def parsed_object(where: str, text: str | bytes) -> dict[str, Any]:
    """Object that a text in JSON says; DecodeError where it is none."""
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise DecodeError(f"{where} is not JSON ({one_line(error)[:80]}); {_ADVICE}") from error
    if not isinstance(content, dict):
        raise DecodeError(f"{where} is not a JSON object; {_ADVICE}")
    return content


def table(key: str, records: Sequence[Mapping[str, Any]], width: int | None = None) -> Floats:
    """Numbers of a column, (N,) or (N, width); null is NaN."""
    values = [row[key] for row in records]
    if width is not None:
        absent = [None] * width
        values = [absent if value is None else value for value in values]
        if set(map(type, values)) != {list} or set(map(len, values)) != {width}:
            raise DecodeError(f"'{key}' must hold {width} numbers in each row; {_ADVICE}")
    if not set(map(type, values if width is None else chain.from_iterable(values))) <= {int, float, NoneType}:
        raise DecodeError(f"'{key}' must hold numbers or null; {_ADVICE}")
    try:
        return np.array(values, dtype=np.float64)
    except OverflowError as error:  # an integer of hundreds of digits
        raise DecodeError(f"'{key}' holds a number that no sensor gives; {_ADVICE}") from error


def integers(key: str, records: Sequence[Mapping[str, Any]], dtype: type[Whole]) -> NDArray[Whole]:
    """Whole numbers of a column, (N,); DecodeError where one is none, or beyond the type."""
    values, limits = [row[key] for row in records], np.iinfo(dtype)
    if set(map(type, values)) != {int} or not limits.min <= min(values) <= max(values) <= limits.max:
        raise DecodeError(f"'{key}' must hold whole numbers from {limits.min} to {limits.max}; {_ADVICE}")
    return np.array(values, dtype=dtype)


def imu_rows(t_ns: list[int], imu: ImuData) -> Iterator[bytes]:
    """One row for each sample."""
    gyr, acc, mag = (_lists(getattr(imu, name), len(imu)) for name in TRIADS)
    temps = ["null"] * len(imu) if imu.temp_c is None else [_number(value) for value in imu.temp_c.tolist()]
    for t, g, a, m, temp, word in zip(t_ns, gyr, acc, mag, temps, imu.flags.tolist(), strict=True):
        yield f'{{"t_ns":{t},"gyr":{g},"acc":{a},"mag":{m},"temp_c":{temp},"flags":{word}}}'.encode()


def attitude_rows(t_ns: list[int], track: AttitudeTrack) -> Iterator[bytes]:
    """One row for each attitude."""
    q_nb, bias = _lists(track.q_nb, len(track)), _lists(track.bias_b, len(track))
    words = [0] * len(track) if track.flags is None else track.flags.tolist()
    for t, q, b, word in zip(t_ns, q_nb, bias, words, strict=True):
        yield f'{{"t_ns":{t},"q_nb":{q},"bias_b":{b},"flags":{word}}}'.encode()


def joint_rows(t_ns: list[int], joints: Any) -> Iterator[bytes]:
    """One row for each sample of a `plumbob.arm.JointTrack`."""
    keys, named = _SCHEMAS[JOINTS]["properties"], repeat(json.dumps(joints.names, ensure_ascii=False), len(joints))
    columns = [_lists(getattr(joints, name), len(joints)) for name in ("angles", "sd", "hand", "hand_sd")]
    for row in zip(t_ns, named, *columns, joints.flags.tolist(), strict=True):
        fields = (f'"{key}":{value}' for key, value in zip(keys, row, strict=True))
        yield b"{%b}" % ",".join(fields).encode()


def transform_row(utc_ns: int, parent: str, child: str, q: Sequence[float]) -> bytes:
    """Row of one frame in another, by a quaternion wxyz; a time of Foxglove is UTC."""
    sec, nsec = divmod(utc_ns, 1_000_000_000)
    content = {
        "timestamp": {"sec": sec, "nsec": nsec},
        "parent_frame_id": parent,
        "child_frame_id": child,
        "translation": {"x": 0.0, "y": 0.0, "z": 0.0},
        "rotation": dict(zip("wxyz", q, strict=True)),
    }
    return json.dumps(content, separators=(",", ":")).encode()


def _lists(table: Floats | None, count: int) -> list[str]:
    """JSON of each row (N, K); numbers are the shortest decimals that read back to the same bits."""
    if table is None:
        return ["null"] * count
    if table.size and np.isfinite(table).all():
        return [f"[{row}]" for row in json.dumps(table.tolist(), separators=(",", ":"))[2:-2].split("],[")]
    return [f"[{','.join(map(_number, row))}]" for row in table.tolist()]


def _number(value: float) -> str:
    """A number; JSON has no word for what is not finite."""
    return repr(value) if math.isfinite(value) else "null"
