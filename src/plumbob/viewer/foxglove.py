"""The Foxglove WebSocket protocol, for Foxglove, Lichtblick and PlotJuggler: every sample, at its full rate.

https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md, and the same under the name of Foxglove's SDK. Channels
are JSON with a schema; time stamps are UTC.
"""

import asyncio
import json
import math
import struct
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from plumbob.core import __version__
from plumbob.core.check import Floats
from plumbob.core.errors import excerpt
from plumbob.core.text import counted
from plumbob.core.time import to_ns
from plumbob.core.units import deg, dps
from plumbob.data import TRIADS, AttitudeTrack, ImuData, ImuMeta
from plumbob.live.rows import ATTITUDE, IMU, TRANSFORMS, attitude_rows, imu_rows, row_schema, transform_row
from plumbob.rotations import Frame, North, frame_rotation, quat_from_euler_zyx
from plumbob.viewer.hub import Hub, delivered
from plumbob.viewer.messages import as_json
from plumbob.viewer.pipe import PipeMessage

if TYPE_CHECKING:
    from starlette.websockets import WebSocket

PROTOCOLS: Final = ("foxglove.websocket.v1", "foxglove.sdk.v1")  # a client names at least one of them
QUEUE: Final = 2000  # Messages that wait for a client at most; the oldest go

_DATA: Final = struct.Struct("<BIQ")
_MESSAGE_DATA: Final = 1
_INFO, _WARNING, _ERROR = 0, 1, 2
_LOG_INFO, _LOG_WARNING = 2, 3
_SPEAK_S: Final = 1.0  # after which a client is told again that it is too slow
_WARNED: Final = frozenset({"gap", "lost", "dropped", "rejected", "flag", "fault"})
_ANGLES: Final = ("roll", "pitch", "yaw")


class AdvertisedChannel(NamedTuple):
    """A channel as it is advertised."""

    topic: str
    name: str
    schema: str


def _described(kind: str, topic: str = "") -> AdvertisedChannel:
    """Channel with the rows of a recording's topic, or of another kind."""
    schema = row_schema(kind)[1]
    return AdvertisedChannel(f"/{topic or kind}", schema.name, schema.data.decode())


CHANNELS: Final = {
    1: _described(IMU), 2: _described(ATTITUDE), 3: _described(TRANSFORMS), 4: _described("log", "events"),
    5: _described("angles"),
}  # fmt: skip
"""Channels by their number."""
_IMU, _ATTITUDE, _TF, _EVENTS, _ANGLES_OF = CHANNELS

Sample = tuple[int, bytes]


class SampleMessages:
    """Messages of the samples of a batch, by channel."""

    def __init__(self, hub: Hub, message: PipeMessage) -> None:
        self._hub, self._hello = hub, hub.hello or {}
        self._arrays = message.arrays
        self._t = message.arrays["t"]
        since = to_ns(self._t - self._t[-1])
        started = self._hello.get("started_utc")
        now = time.time_ns() if started is None else round(1e9 * started) + int(to_ns(self._t[-1:])[0])
        arrived = message.content.get("arrived_ns")
        self._utc = (now + since).tolist()
        self._host = ((time.monotonic_ns() if arrived is None else arrived) + since).tolist()

    def on_channel(self, channel: int) -> list[Sample]:
        """Time stamps, ns, and messages of a channel."""
        made: dict[int, Callable[[], Iterator[Sample]]] = {
            _IMU: self._imu,
            _ATTITUDE: self._attitude,
            _TF: self._transforms,
            _ANGLES_OF: self._angles,
        }
        return list(made[channel]()) if channel in made else []

    def _imu(self) -> Iterator[Sample]:
        sensed = self._arrays["sensed"]
        triads = {name: sensed[:, 3 * i : 3 * i + 3] for i, name in enumerate(TRIADS)}
        measured = {name: values for name, values in triads.items() if np.isfinite(values).any()}
        temp = sensed[:, 9] if np.isfinite(sensed[:, 9]).any() else None
        imu = ImuData.live(to_ns(self._t), measured, temp_c=temp, flags=self._arrays["flags"], meta=ImuMeta())
        return zip(self._utc, imu_rows(self._host, imu), strict=True)

    def _attitude(self) -> Iterator[Sample]:
        name, frame = self._hub.primary, self._hello.get("frame")
        q_nb = None if name is None else self._q_nb(name)
        if q_nb is None or frame is None:
            return iter(())
        bias = self._columns(name, [f"bias.{axis}" for axis in "xyz"])
        track = AttitudeTrack(
            t=self._t,
            q_nb=q_nb,
            frame=Frame(frame),
            north=North(self._hello.get("north") or "free"),
            bias_b=None if bias is None else dps(bias),
            flags=self._arrays["flags"],
        )
        return zip(self._utc, attitude_rows(self._host, track), strict=True)

    def _transforms(self) -> Iterator[Sample]:
        frame = self._hello.get("frame")
        parent = f"navigation ({frame})"
        if frame == Frame.NED:  # viewers draw z upwards
            yield self._utc[-1], transform_row(self._utc[-1], "world (ENU)", parent, _NED.tolist())
        for name in [estimator["name"] for estimator in self._hello.get("estimators", ())]:
            q_nb = self._q_nb(name)
            child = "body" if name == self._hub.primary else f"body ({name})"
            for utc, q in zip(self._utc, [] if q_nb is None else q_nb.tolist(), strict=False):
                if q[0] == q[0]:
                    yield utc, transform_row(utc, parent, child, q)

    def _angles(self) -> Iterator[Sample]:
        angles = self._columns(self._hub.primary, _ANGLES)
        for utc, row in zip(self._utc, [] if angles is None else angles.tolist(), strict=False):
            if row[0] == row[0]:
                yield utc, as_json(dict(zip(_ANGLES, row, strict=True))).encode()

    def _q_nb(self, name: str) -> Floats | None:
        angles = self._columns(name, _ANGLES)
        return None if angles is None else quat_from_euler_zyx(deg(angles[:, ::-1]))

    def _columns(self, name: str | None, wanted: Sequence[str]) -> Floats | None:
        places = self._hub.places(name, wanted)
        columns: Floats | None = None if places is None else self._arrays["values"][:, places]
        return columns


_NED: Final = frame_rotation(Frame.ENU, Frame.NED)


class Viewer:
    """A client: what it has subscribed to, and what waits for it."""

    def __init__(self) -> None:
        self.wake = asyncio.Event()
        self._subscribed: dict[int, int] = {}  # channel by subscription
        self._queue: deque[tuple[int, int, bytes]] = deque()
        self._texts: deque[str] = deque(maxlen=20)
        self._lost = 0
        self._spoke = -math.inf

    @property
    def channels(self) -> set[int]:
        """What it gets."""
        return set(self._subscribed.values())

    def put(self, channel: int, samples: list[Sample]) -> None:
        """Let messages of a channel wait; the oldest go where there is no room."""
        for subscription, subscribed in self._subscribed.items():
            if subscribed == channel:
                self._queue.extend((subscription, utc, payload) for utc, payload in samples)
        while len(self._queue) > QUEUE:
            self._queue.popleft()
            self._lost += 1
        self.wake.set()

    def say(self, level: int, text: str) -> None:
        """Let a status wait."""
        self._texts.append(json.dumps({"op": "status", "level": level, "message": text}))
        self.wake.set()

    def next(self) -> str | bytes | None:
        """Message that it gets next; None where nothing waits."""
        if self._lost and time.monotonic() - self._spoke >= _SPEAK_S:
            self.say(_WARNING, f"You are too slow: {counted(self._lost, 'message')} left out.")
            self._lost, self._spoke = 0, time.monotonic()
        if self._texts:
            return self._texts.popleft()
        if not self._queue:
            return None
        subscription, utc, payload = self._queue.popleft()
        return _DATA.pack(_MESSAGE_DATA, subscription, utc) + payload

    def take(self, text: str) -> None:
        """Do what it asks for."""
        try:
            content = json.loads(text)
            operation = content["op"]
            if operation == "subscribe":
                for subscription in content["subscriptions"]:
                    self._subscribe(subscription["id"], subscription["channelId"])
            elif operation == "unsubscribe":
                for number in map(int, content["subscriptionIds"]):
                    self._subscribed.pop(number, None)
            else:
                self.say(_ERROR, f"This server does not do {excerpt(str(operation))}: it shows a stream, no more.")
        except (ValueError, KeyError, TypeError, RecursionError):
            self.say(_ERROR, "This is not a message of the Foxglove WebSocket protocol.")

    def _subscribe(self, number: Any, channel: Any) -> None:
        if type(number) is not int or not 0 <= number < 2**32 or type(channel) is not int or channel not in CHANNELS:
            self.say(_ERROR, f"There is no channel {excerpt(str(channel))} to subscribe to.")
        elif number in self._subscribed or channel in self.channels:
            self.say(_WARNING, f"{CHANNELS[channel].topic} is subscribed to already, or the number is in use.")
        else:
            self._subscribed[number] = channel


class Foxglove:
    """Serves clients of the protocol."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self._viewers: set[Viewer] = set()
        self._session = str(time.time_ns())
        hub.listeners.add(self._listen)
        hub.on_event = self._tell

    async def serve(self, socket: "WebSocket") -> None:
        """Serve a client until one of the two goes."""
        from starlette.responses import PlainTextResponse

        named = [protocol for protocol in socket.scope["subprotocols"] if protocol in PROTOCOLS]
        if not named:
            text = f"Name one of the subprotocols {', '.join(PROTOCOLS)}.\n"
            await socket.send_denial_response(PlainTextResponse(text, 400))
            return
        await socket.accept(named[0])
        viewer = Viewer()
        async with delivered(viewer, socket, self._viewers, self._info(), _advertised()):
            while (message := await socket.receive())["type"] != "websocket.disconnect":
                if message.get("text") is not None:
                    viewer.take(message["text"])
                else:
                    viewer.say(_WARNING, "This server takes no data.")

    def _info(self) -> dict[str, Any]:
        hello = self._hub.hello or {}
        metadata = {name: str(hello[name]) for name in ("session", "device", "format", "calibration") if name in hello}
        return {
            "op": "serverInfo",
            "name": f"Plumbob {__version__}",
            "capabilities": [],
            "metadata": metadata,
            "sessionId": self._session,
        }

    def _listen(self, message: PipeMessage) -> None:
        wanted = {channel for viewer in self._viewers for channel in viewer.channels}
        if message.kind != "batch" or not wanted or not self._hub.has_rows(message):
            return
        samples = SampleMessages(self._hub, message)
        for channel in wanted:
            messages = samples.on_channel(channel)
            for viewer in self._viewers:
                viewer.put(channel, messages)

    def _tell(self, kind: str, text: str, t: float | None) -> None:
        started = (self._hub.hello or {}).get("started_utc")
        utc = time.time_ns() if t is None or started is None else round(1e9 * (started + t))
        sec, nsec = divmod(utc, 1_000_000_000)
        level = _LOG_WARNING if kind in _WARNED else _LOG_INFO
        entry = {"timestamp": {"sec": sec, "nsec": nsec}, "level": level, "message": text, "name": kind, "file": "",
                 "line": 0}  # fmt: skip
        for viewer in self._viewers:
            viewer.put(_EVENTS, [(utc, as_json(entry).encode())])


def _advertised() -> dict[str, Any]:
    channels = [
        {"id": number, "topic": topic.topic, "encoding": "json", "schemaName": topic.name, "schema": topic.schema,
         "schemaEncoding": "jsonschema"}
        for number, topic in CHANNELS.items()
    ]  # fmt: skip
    return {"op": "advertise", "channels": channels}
