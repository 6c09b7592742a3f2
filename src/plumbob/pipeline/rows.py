"""Rows of a recording's decoded channels: JSON with a schema, as viewers plot it, every number exact to the bit."""

import json
from collections.abc import Iterator
from typing import Any, Final

from plumbob.data import TRIADS, AttitudeTrack, ImuData
from plumbob.link import Event

IMU: Final = "imu"
ATTITUDE: Final = "attitude"
EVENTS: Final = "events"
RECORDER: Final = "recorder"
RAW: Final = "raw"


def _numbers(count: int, meaning: str) -> dict[str, Any]:
    each = {"type": ["number", "null"]}
    return {"type": ["array", "null"], "items": each, "minItems": count, "maxItems": count, "description": meaning}


def _schema(title: str, properties: dict[str, Any]) -> bytes:
    return json.dumps({"title": title, "type": "object", "properties": properties}, ensure_ascii=False).encode()


_TIME: Final = {"t_ns": {"type": "integer", "description": "host's monotonic clock, ns"}}
_FLAGS: Final = {"flags": {"type": "integer", "description": "bits of plumbob.flags"}}
IMU_SCHEMA: Final = _schema(
    "plumbob.Imu",
    {
        **_TIME,
        "gyr": _numbers(3, "angular rate in body axes, rad/s, uncalibrated"),
        "acc": _numbers(3, "specific force in body axes, m/s², uncalibrated"),
        "mag": _numbers(3, "magnetic flux density in body axes, µT, uncalibrated"),
        "temp_c": {"type": ["number", "null"], "description": "temperature, °C"},
        **_FLAGS,
    },
)
ATTITUDE_SCHEMA: Final = _schema(
    "plumbob.Attitude",
    {
        **_TIME,
        "q_nb": _numbers(4, "body to navigation, wxyz"),
        "bias_b": _numbers(3, "estimated gyroscope bias, rad/s"),
        **_FLAGS,
    },
)
EVENT_SCHEMA: Final = _schema(
    "plumbob.Event",
    {**_TIME, "kind": {"type": "string"}, "text": {"type": "string"}, "count": {"type": "integer"}},
)


def event_row(event: Event) -> bytes:
    """Row of an event."""
    told = {"t_ns": event.t_ns, "kind": event.kind, "text": event.text, "count": event.count}
    return json.dumps(told, ensure_ascii=False).encode()


def event_of(row: bytes) -> Event:
    """Event of a row."""
    return Event(**json.loads(row))


def imu_rows(t_ns: list[int], imu: ImuData) -> Iterator[bytes]:
    """One row for each sample."""
    triads = [None if getattr(imu, name) is None else getattr(imu, name).tolist() for name in TRIADS]
    temps = None if imu.temp_c is None else imu.temp_c.tolist()
    words = imu.flags.tolist()
    for i, t in enumerate(t_ns):
        parts = ",".join(f'"{n}":{_list(v[i]) if v else "null"}' for n, v in zip(TRIADS, triads, strict=True))
        temp = _number(temps[i]) if temps else "null"
        yield f'{{"t_ns":{t},{parts},"temp_c":{temp},"flags":{words[i]}}}'.encode()


def attitude_rows(t_ns: list[int], track: AttitudeTrack) -> Iterator[bytes]:
    """One row for each attitude."""
    q_nb = track.q_nb.tolist()
    bias = None if track.bias_b is None else track.bias_b.tolist()
    words = [0] * len(t_ns) if track.flags is None else track.flags.tolist()
    for i, t in enumerate(t_ns):
        told = _list(bias[i]) if bias else "null"
        yield f'{{"t_ns":{t},"q_nb":{_list(q_nb[i])},"bias_b":{told},"flags":{words[i]}}}'.encode()


def _list(values: list[float]) -> str:
    return f"[{','.join(map(_number, values))}]"


def _number(value: float) -> str:
    """Shortest decimal that reads back to the same bits; JSON has no word for what is not finite."""
    return repr(value) if value - value == 0.0 else "null"
