"""What the server knows of the stream, and what each of its clients is still to get.

Everything is encoded once and lies in rings that all clients share; a client is no more than places in them. Of what
supersedes itself, who is slow gets the newest.
"""

import asyncio
import time
from collections import deque
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, Final, Generic, Protocol, TypeVar

import numpy as np

from plumbob.core.flags import names
from plumbob.core.text import counted
from plumbob.viewer.charts import RowHistory, Rows, Tare, Thinner, shown_attitudes, tick
from plumbob.viewer.messages import Answer, Happened, Lines, as_json, numbers
from plumbob.viewer.pipe import PipeMessage

if TYPE_CHECKING:
    from starlette.websockets import WebSocket

TICK_S: Final = 1.0 / 50.0  # Time between two ticks at least, s
IDLE_S: Final = 0.25  # Time between two ticks at most, s: the age of the newest sample grows
PAST: Final = 100  # Events that a new client gets

_BEHIND: Final = 25  # ticks after which a client is given the newest one
_FRESH: Final = 1.0  # s, for which a column shows the last value that was not absent
_NO_LINK: Final = {"rate": None, "samples": 0, "lost": 0, "gaps": 0, "junk": 0, "rejected": 0, "unusable": 0,
                   "drift_ppm": None, "clock": "", "skipped": 0}  # fmt: skip
_STORM: Final = 100.0  # events that may come at once, and how many in a second for long
_EVENTS_PER_S: Final = 10.0
_QUIET_S: Final = 1.0  # without events, after which a storm is over
_PASSED: Final = ("gravity_b", "field_b", "points", "recording", "text", "playback")
_HIDDEN: Final = ("card",)  # what the feed says to the server alone: the path of the session's card

Item = TypeVar("Item")
Listener = Callable[[PipeMessage], None]


class NewestItems(Generic[Item]):
    """The newest of a queue, by the number of an item since the start."""

    def __init__(self, room: int) -> None:
        self._items: deque[Item] = deque(maxlen=room)
        self.end = 0  # number of the item that comes next

    @property
    def first(self) -> int:
        """Number of the oldest item that is still there."""
        return self.end - len(self._items)

    def add(self, item: Item) -> None:
        """Take the next item; the oldest goes where there is no room."""
        self._items.append(item)
        self.end += 1

    def __getitem__(self, number: int) -> Item:
        return self._items[number - self.first]

    def clear(self) -> None:
        """Forget all items, not their number."""
        self._items.clear()


class Client:
    """What a page has got so far, which knows the event of number `since`."""

    def __init__(self, hub: "Hub", since: int | None = None) -> None:
        self._hub = hub
        self.wake = asyncio.Event()
        self.wake.set()
        self._hello = self._layout = 0
        self._history: int | None = None
        self._tick = hub.ticks.end
        self._event = max(0, hub.events.end - PAST) if since is None or since >= hub.events.end else since + 1
        self._lines = hub.lines.end
        self._newest: dict[str, int] = {}
        self._answers: deque[str] = deque()
        self._is_ticks_turn = False

    def answer(self, answer: Answer) -> None:
        """Let it have an answer."""
        self._answers.append(as_json(asdict(answer)))
        self.wake.set()

    def next(self) -> str | bytes | None:
        """Message that it gets next, by turns of what queues and what supersedes itself; None where it has got all."""
        hub = self._hub
        if not hub.hello_text:
            return None
        if self._hello != hub.hellos:
            if self._layout != hub.layouts:
                self._history = hub.history.first
            self._hello, self._layout = hub.hellos, hub.layouts
            return hub.hello_text
        if self._history is not None:
            return self._next_history(self._history)
        if self._is_ticks_turn and (message := self._next_tick()) is not None:
            self._is_ticks_turn = False
            return message
        self._is_ticks_turn = True  # a queue that is long leaves every second message to the ticks
        return self._next_queued() or self._next_newest() or self._next_tick()

    def _next_history(self, start: int) -> bytes:
        message, stop = self._hub.history.chunk(max(start, self._hub.history.first), self._hub.epoch)
        self._history = stop if stop < self._hub.history.end else None
        self._tick = self._hub.ticks.end
        return message

    def _next_queued(self) -> str | None:
        if self._answers:
            return self._answers.popleft()
        if self._event < self._hub.events.end:
            number = max(self._event, self._hub.events.first)
            self._event = number + 1
            return self._hub.events[number]
        lines = self._hub.lines
        if self._lines < lines.end:
            unsent = [lines[number] for number in range(max(self._lines, lines.first), lines.end)]
            self._lines = lines.end
            return as_json(asdict(Lines(lines=unsent)))
        return None

    def _next_newest(self) -> str | None:
        for kind, (version, text) in self._hub.newest.items():
            if self._newest.get(kind) != version:
                self._newest[kind] = version
                return text
        return None

    def _next_tick(self) -> bytes | None:
        ticks = self._hub.ticks
        if self._tick >= ticks.end:
            return None
        number = ticks.end - 1 if ticks.end - self._tick > _BEHIND else max(self._tick, ticks.first)
        self._tick = number + 1
        return ticks[number]


class MessageSource(Protocol):
    """Where a client's messages come from."""

    wake: asyncio.Event

    def next(self) -> str | bytes | None:
        """Message that comes next; None where there is none yet."""


Source = TypeVar("Source", bound=MessageSource)


@asynccontextmanager
async def delivered(
    source: Source, socket: "WebSocket", connected: set[Source], *greetings: Mapping[str, Any]
) -> AsyncIterator[None]:
    """While what is inside runs, a client is among those that are connected, and gets its messages; until it goes."""
    from starlette.websockets import WebSocketDisconnect

    async def deliver() -> None:
        with suppress(WebSocketDisconnect):
            for greeting in greetings:
                await socket.send_text(as_json(greeting))
            while True:
                await source.wake.wait()
                source.wake.clear()
                while (message := source.next()) is not None:
                    await (socket.send_text(message) if isinstance(message, str) else socket.send_bytes(message))

    connected.add(source)
    sending = asyncio.create_task(deliver())
    try:
        with suppress(WebSocketDisconnect):
            yield
    finally:
        connected.discard(source)
        sending.cancel()


class Hub:
    """What the server knows of the stream."""

    def __init__(self, *, control: bool = False) -> None:
        self.control = control  # whether clients may give commands
        self.hello: dict[str, Any] | None = None  # newest `messages.Hello`
        self.hello_text = ""  # the same as it is sent
        self.hellos = self.layouts = 0  # how many there were, and how many with other columns than before
        self.epoch = 0  # rises when time begins again
        self.history, self._thinner = RowHistory(()), Thinner(0)
        self.ticks: NewestItems[bytes] = NewestItems(50)
        self.events: NewestItems[str] = NewestItems(1000)
        self.lines: NewestItems[str] = NewestItems(100)
        self.newest: dict[str, tuple[int, str]] = {}  # by kind, with a version: what supersedes what was before
        self.clients: set[Client] = set()
        self.listeners: set[Listener] = set()
        self.on_event: Callable[[str, str, float | None], None] = lambda kind, text, t: None
        self.tare = Tare()
        self.guide: str | None = None  # what is being calibrated
        self.fields: dict[str, Any] = {}
        self.t: float | None = None
        self._flags = 0
        self._values = self._known = np.zeros(0)
        self._waiting: list[Rows] = []
        self._latency: float | None = None
        self._is_new = False
        self._timer: asyncio.TimerHandle | None = None
        self._last = -1.0
        self._events_left, self._events_at, self._left_out = _STORM, time.monotonic(), 0

    @property
    def primary(self) -> str | None:
        """Name of the session's own estimator."""
        return next((entry["name"] for entry in (self.hello or {}).get("estimators", ()) if entry["primary"]), None)

    def places(self, name: str | None, columns: Sequence[str]) -> list[int] | None:
        """Places of an estimator's columns among all; None where one of them is not there."""
        keys, wanted = self.history.keys, [f"{name}.{column}" for column in columns]
        return [keys.index(key) for key in wanted] if all(key in keys for key in wanted) else None

    def take(self, message: PipeMessage) -> None:
        """Take a message of the pipe."""
        if message.kind == "hello":
            self._take_hello(message.content)
        elif message.kind == "batch":
            self._take_batch(message)
        elif message.kind == "event":
            self._take_event(message.content)
        elif message.kind == "reset":
            self._reset()
        for listener in tuple(self.listeners):
            listener(message)

    def tell(self, kind: str, text: str, t: float | None = None) -> None:
        """Let an event be known."""
        event = Happened(id=self.events.end, t=self.t if t is None else t, kind=kind, text=text)
        self.events.add(as_json(asdict(event)))
        self.on_event(kind, text, event.t)
        self.wake()

    def supersede(self, kind: str, message: Mapping[str, Any] | None) -> None:
        """Replace the newest message of a kind; None: there is none any more."""
        if message is None:
            self.newest.pop(kind, None)
            return
        self.newest[kind] = (time.monotonic_ns(), as_json(message))
        self.wake()

    def wake(self) -> None:
        """Let every client look for what it has not got yet."""
        for client in self.clients:
            client.wake.set()

    def state(self) -> dict[str, Any]:
        """What is the case now: `messages.State`."""
        fields, now = self.fields, time.monotonic_ns()
        arrived = fields.get("arrived_ns")
        age = None if arrived is None else 1e-9 * (now - arrived)
        if self._is_new:
            self._latency, self._is_new = age, False
        link = _NO_LINK | fields.get("link", {}) | {"latency": self._latency, "age": age}
        return {
            "type": "state",
            "epoch": self.epoch,
            "t": self.t,
            "sent": time.time(),
            "values": numbers(self._values),
            "raw": fields.get("raw", []),
            "flags": names(self._flags),
            "attitudes": shown_attitudes(fields.get("attitudes", {}), self.tare, self.hello or {}),
            **{name: fields.get(name) for name in _PASSED},
            "link": link,
            "tared": self.tare.is_set,
            "guide": self.guide,
        }

    def _take_hello(self, content: dict[str, Any]) -> None:
        keys = [column["key"] for column in content["columns"]]
        changed = self.hello is None or keys != list(self.history.keys)
        if changed:
            self._flush()
            self.history, self._thinner = self.history.with_columns(keys), Thinner(len(keys))
            self._values = self._known = np.full(len(keys), np.nan)
            self.ticks.clear()
            self.layouts += 1
        self.hello = content | {"control": self.control}
        self.hello_text = as_json({key: value for key, value in self.hello.items() if key not in _HIDDEN})
        self.hellos += 1
        self._schedule(0.0)
        self.wake()

    def _take_event(self, content: Mapping[str, Any]) -> None:
        """Let an event of the feed be known, unless a storm of them would drown all else."""
        now = time.monotonic()
        self._events_left = min(_STORM, self._events_left + _EVENTS_PER_S * (now - self._events_at))
        self._events_at = now
        if self._events_left < 1.0:
            self._left_out += 1
            return
        self._events_left -= 1.0
        self._tell_left_out()
        self.tell(content["kind"], content["text"], content.get("t"))

    def _tell_left_out(self) -> None:
        if self._left_out:
            self.tell("view", f"{counted(self._left_out, 'further event')} left out here; a recording has them all.")
            self._left_out = 0

    def has_rows(self, batch: PipeMessage) -> bool:
        """Whether a batch has samples, and the columns that are known."""
        is_known = self.hello is not None and batch.arrays["values"].shape[1] == len(self.history.keys)
        return is_known and len(batch.arrays["t"]) > 0

    def _take_batch(self, message: PipeMessage) -> None:
        if self.hello is None:
            return
        self.fields = message.content
        t, flags, values = (message.arrays[name] for name in ("t", "flags", "values"))
        if self.has_rows(message):
            self.t, self._flags = float(t[-1]), int(flags[-1])
            self._is_new = True
            self._note_values(t, values)
            self._waiting.append(Rows(t, flags, values))
        self._schedule(TICK_S)

    def _note_values(self, t: Any, values: Any) -> None:
        """Keep the newest number of each column for a while: sensors of one unit need not be equally fast."""
        last = values[-1]
        if np.isnan(last).any() and len(values) < _BEHIND * 40:
            place = len(values) - 1 - np.isfinite(values)[::-1].argmax(axis=0)
            last = values[place, np.arange(values.shape[1])]
            fresh = np.isfinite(last)
            last = np.where(fresh | (t[-1] - self._known > _FRESH), last, self._values)
            self._known = np.where(fresh, t[place], self._known)
        else:
            self._known = np.full(len(last), t[-1])
        self._values = last

    def _reset(self) -> None:
        self._waiting.clear()
        self._thinner.rest()
        self.history.forget()
        self.ticks.clear()
        self.epoch += 1
        self.t = None
        self._known = np.full(len(self._known), np.nan)
        self._values = np.full(len(self._values), np.nan)
        self._schedule(TICK_S)

    def _schedule(self, after: float) -> None:
        """Let a tick come, so long after the last one, and at once where that is over."""
        loop = asyncio.get_running_loop()
        due = max(loop.time(), self._last + after)
        if self._timer is not None:
            if self._timer.when() <= due and not self._timer.cancelled():
                return
            self._timer.cancel()
        self._timer = loop.call_at(due, self._beat)

    def _beat(self) -> None:
        loop = asyncio.get_running_loop()
        self._timer, self._last = None, loop.time()
        rows = self._flush()
        if time.monotonic() - self._events_at > _QUIET_S:
            self._tell_left_out()
        if self.clients:
            self.ticks.add(tick(self.state(), rows, self.epoch))
            self.wake()
        self._schedule(IDLE_S)

    def _flush(self) -> Rows:
        """Rows of what came since the last tick, which the history has from now on."""
        rate = self.fields.get("link", {}).get("rate") or (self.hello or {}).get("rate")
        speed = float((self.fields.get("playback") or {}).get("speed") or 1.0)
        rows = Rows.none(len(self.history.keys)) if self._waiting else self._thinner.rest()
        for some in self._waiting:
            part = self._thinner.take(some, rate=float("inf") if rate is None else float(rate), speed=speed)
            rows = rows.joined(part)
        self._waiting.clear()
        self.history.add(rows)
        return rows
