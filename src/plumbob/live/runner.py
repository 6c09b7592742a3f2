"""Run a stream: read, keep, decode, estimate, hand on, until the source ends or somebody says stop."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final, Protocol

from plumbob.core.event import Event
from plumbob.live.sinks import Sink
from plumbob.live.stream import ItemResult, Stream
from plumbob.live.transports.transport import Received, Source, Stopping

_WAIT: Final = 0.02  # longest wait for the source, s; the recording's chunks close on time also where nothing comes


class Keeper(Protocol):
    """What keeps a run: a recording, or what starts and stops one; its methods are those of `RecordingSink`."""

    failures: list[Event]

    def start(self) -> Event | None:
        """Begin."""
        ...

    def on_item(self, item: Received | Event) -> None:
        """Keep what has come."""
        ...

    def on_part(self, part: ItemResult, now_ns: int) -> None:
        """Keep what the line made of it."""
        ...

    def tick(self, now_ns: int) -> list[Event]:
        """Send off what is due, and return what has happened."""
        ...

    def close(self) -> list[Event]:
        """End, and return what happened last."""
        ...


def run_stream(
    stream: Stream,
    source: Source,
    *,
    sinks: Sequence[Sink] = (),
    recording: Keeper | None = None,
    duration: float | None = None,
    until_lost: bool = False,
    stop: Stopping | None = None,
    each: Callable[[], None] | None = None,
    clock: Callable[[], int] = time.monotonic_ns,
) -> None:
    """Run until the source is finished, the time is over or `stop` is set; then end recording, sinks and source.

    Bytes are handed to the recording before anything else is done with them. A sink that the system refuses, as on a
    full disk, does not end a recording: it gets no more, and the recording and the other sinks are informed.
    `until_lost` ends with the line, instead of waiting for it; `each` is called after each read, also where nothing
    came.
    """
    end = None if duration is None else clock() + round(duration * 1e9)
    if recording:
        sinks = [_TolerantSink(sink, recording, clock) for sink in sinks]
    try:
        behind = recording.start() if recording else None
        while not source.finished and not (stop and stop.is_set()) and (end is None or clock() < end):
            items = source.read(_WAIT)
            if behind and items:
                items, behind = [replace(behind, t_ns=items[0].t_ns), *items], None
            for item in items:
                _feed(stream, item, sinks, recording)
            if each:
                each()
            if until_lost and any(isinstance(item, Event) and item.kind == "lost" for item in items):
                break
            if recording:
                _on_events(recording.tick(clock()), sinks)
        _hand_on(stream.finish(), clock(), sinks, recording)
    finally:
        source.close()
        if recording:
            _on_events(recording.close(), sinks)
        for sink in sinks:
            sink.close()


class _TolerantSink:
    """A sink beside a recording, which goes on when the sink fails."""

    def __init__(self, sink: Sink, recording: Keeper, clock: Callable[[], int]) -> None:
        self._sink: Sink | None = sink
        self._recording, self._clock = recording, clock

    def on_part(self, part: ItemResult) -> None:
        self._do(lambda sink: sink.on_part(part))

    def on_event(self, event: Event) -> None:
        self._do(lambda sink: sink.on_event(event))

    def close(self) -> None:
        self._do(lambda sink: sink.close())

    def _do(self, action: Callable[[Sink], None]) -> None:
        if self._sink is None:
            return
        try:
            action(self._sink)
        except OSError as error:
            what = f"{self._sink} cannot be written any more: {error.strerror or error}."
            self._sink = None
            self._recording.failures.append(Event(self._clock(), "failed", what))


def _feed(stream: Stream, item: Received | Event, sinks: Sequence[Sink], recording: Keeper | None) -> None:
    if recording:
        recording.on_item(item)
    _hand_on(stream.feed(item), item.t_ns, sinks, recording)
    if isinstance(item, Event):
        _on_events([item], sinks)


def _hand_on(part: ItemResult | None, now_ns: int, sinks: Sequence[Sink], recording: Keeper | None) -> None:
    if part is None:
        return
    for sink in sinks:
        sink.on_part(part)
    if recording:
        recording.on_part(part, now_ns)


def _on_events(events: Sequence[Event], sinks: Sequence[Sink]) -> None:
    for event in events:
        for sink in sinks:
            sink.on_event(event)
