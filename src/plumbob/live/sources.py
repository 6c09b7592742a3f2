"""The source that a session asks for, opened; a recording or a capture as a source."""

import os
import select
import threading
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, closing, suppress
from dataclasses import replace
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Final, Protocol

from plumbob.core.errors import DecodeError, ParameterError
from plumbob.core.event import Event
from plumbob.core.files import existing_file
from plumbob.files.mcap import Log
from plumbob.live import rows
from plumbob.live.session import Session, SourceSpec
from plumbob.live.stream import device_counts, time_spec
from plumbob.live.timing.counter import CountedTime
from plumbob.live.transports.transport import Received, Source
from plumbob.protocols.decode import decode
from plumbob.protocols.format import Format

if TYPE_CHECKING:
    from plumbob.live.transports.iio import IioPollSource, IioSource

_PIECE: Final = 1 << 16
_PAUSE: Final = 0.02  # longest wait for one of several sources, s
_TOGETHER = 64  # frames that are handed on at a time


class CaptureSource:
    """A file of raw bytes as a line that is read as fast as it goes.

    No host was there, so each read is given the time that the frames themselves tell: the device's clock, else the
    frame counter and the rate (Hz), else their place and the rate. What only a host could tell is not known: how long
    the device was silent, where its counter went round more than half.
    """

    def __init__(self, path: str, form: Format, message: str, rate: float | None = None) -> None:
        self._path, self._form, self._message, self._rate = Path(path), form, message, rate
        self._items: list[Received] | None = None

    @property
    def name(self) -> str:
        """Name of the file."""
        return self._path.name

    @property
    def finished(self) -> bool:
        """Whether everything has been handed on."""
        return self._items == []

    def open(self) -> "CaptureSource":
        """Read the file."""
        try:
            data = existing_file(self._path).read_bytes()
        except OSError as error:
            raise DecodeError(f"{self._path} cannot be read: {error.strerror}.") from error
        by_message, counts = decode(data, self._form)
        if self._message not in by_message:
            what = f"no frame of {self._form.name}, message {self._message}, in {counts.received} bytes"
            raise DecodeError(f"{self._path} holds {what}; 'plumbob decode' tries other formats.")
        frames = by_message[self._message]
        spec = time_spec(self._form, frames.message)
        counted = CountedTime(replace(spec, rate=self._rate or spec.rate))
        t_ns = counted.after_first(frames.start, **device_counts(frames))
        ends = [int(frames.start[k]) for k in range(_TOGETHER, len(frames), _TOGETHER)] + [len(data)]
        lasts = [*range(_TOGETHER - 1, len(frames) - 1, _TOGETHER)][: len(ends) - 1] + [len(frames) - 1]
        begins = [0, *ends[:-1]]
        self._items = [
            Received(int(t_ns[last]), data[begin:end]) for begin, end, last in zip(begins, ends, lasts, strict=True)
        ]
        return self

    def read(self, timeout: float) -> list[Received | Event]:
        """Next bytes."""
        if self._items is None:
            self.open()
        assert self._items is not None
        return [self._items.pop(0)] if self._items else []

    def close(self) -> None:
        """Nothing is held open."""


class PipeSource:
    """What another program writes, until it ends: standard input (None), or a file as if it came so."""

    def __init__(self, path: str | None = None) -> None:
        self._path, self._fd = path, -1
        self.name, self.finished = "standard input" if path is None else Path(path).name, False

    def open(self) -> "PipeSource":
        """Open it; DecodeError where that is not possible."""
        try:
            self._fd = 0 if self._path is None else os.open(existing_file(self._path), os.O_RDONLY)
        except OSError as error:
            raise DecodeError(f"{self._path} cannot be read: {error.strerror}.") from error
        return self

    def read(self, timeout: float) -> list[Received | Event]:
        """Wait at most `timeout` s for something, and return it."""
        if self.finished or not select.select([self._fd], [], [], timeout)[0]:
            return []
        data = os.read(self._fd, _PIECE)
        self.finished = not data
        return [Received(time.monotonic_ns(), data)] if data else []

    def close(self) -> None:
        """Close the file; standard input stays."""
        if self._fd > 0:
            os.close(self._fd)
            self._fd = -1
        self.finished = True


KERNEL: Final = ("iio", "iio-poll")  # sources of which the kernel says what the bytes mean
GATHER: Final = 0.007  # s in which bytes are gathered before they go through the line, for fewer, fuller parts
_AT_ONCE: Final = 256


class Openable(Source, Protocol):
    """A source that is made, and then opened."""

    def open(self) -> Source:
        """Open it; LineError where that is not possible."""


def open_source(spec: SourceSpec | None) -> Source:
    """Open the source of a session."""
    if spec is None:
        raise ParameterError("the session names no [source]; add one, or give --port.")
    made = make_source(spec).open()
    return Stretched(made, spec.settings["speed"]) if "speed" in spec.settings else made


def open_sources(session: Session) -> Source:
    """Open the source of a session, or all that it has, as one."""
    if not session.beside:
        return open_source(session.source)
    with ExitStack() as opened:  # closes those that are open where another cannot be
        named = session.sources.items()
        sources = {name: opened.enter_context(closing(open_source(part.source))) for name, part in named}
        opened.pop_all()
    return Together(sources)


class Together:
    """Several sources as one: each is read in a thread of its own, so that none waits for another."""

    def __init__(self, sources: Mapping[str, Source]) -> None:
        self._sources, self.name = sources, next(iter(sources.values())).name
        self._items: SimpleQueue[Received | Event | Exception] = SimpleQueue()
        self._ending = threading.Event()
        self._threads = [threading.Thread(target=self._read, args=pair, daemon=True) for pair in sources.items()]
        for thread in self._threads:
            thread.start()

    @property
    def finished(self) -> bool:
        """Whether everything has been handed on."""
        return not any(thread.is_alive() for thread in self._threads) and self._items.empty()

    def read(self, timeout: float) -> list[Received | Event]:
        """Wait at most `timeout` s for something from any of them, and return it."""
        items = list[Received | Event]()
        with suppress(Empty):
            item = self._items.get(timeout=timeout)
            while not isinstance(item, Exception):
                items.append(item)
                item = self._items.get_nowait()
            raise item
        return items

    def close(self) -> None:
        """Close them all."""
        self._ending.set()
        for thread in self._threads:
            thread.join()
        for source in self._sources.values():
            source.close()

    def _read(self, name: str, source: Source) -> None:
        try:
            while not (source.finished or self._ending.is_set()):
                for item in source.read(_PAUSE):
                    self._items.put(replace(item, source=name) if name else item)
        except Exception as error:  # who reads all of them is to know
            self._items.put(error)


def make_source(spec: SourceSpec) -> Openable:
    """Source of a session, not yet open."""
    if spec.kind == "spi":
        from plumbob.live.transports.spi_bus import SpiSource

        return SpiSource(**spec.settings)
    if spec.kind in KERNEL:
        return _iio_source(spec)
    if spec.kind in ("file", "stdin"):
        bytes_of_file = spec.kind == "file" and "lines" not in spec.settings
        return CaptureSource(**spec.settings) if bytes_of_file else PipeSource(spec.settings.get("path"))
    of_time = {"speed", "time", "rate", "lines"}
    settings = {"gather": GATHER, **{key: value for key, value in spec.settings.items() if key not in of_time}}
    if spec.kind == "serial":
        from plumbob.live.transports.serial_line import SerialSource

        return SerialSource(**settings)
    from plumbob.live.transports import sockets

    kinds = {"udp": sockets.UdpSource, "tcp": sockets.TcpSource, "websocket": sockets.WebSocketSource}
    made: Openable = kinds[spec.kind](**settings)
    return made


def described(spec: SourceSpec) -> str:
    """What the kernel says of an IIO device, in JSON; LineError where it cannot be asked."""
    return _iio_source(spec).layout.to_json()


def _iio_source(spec: SourceSpec) -> "IioSource | IioPollSource":
    from plumbob.live.transports.iio import IioPollSource, IioSource

    settings = {key: value for key, value in spec.settings.items() if key != "mount"}
    if spec.kind == "iio":
        return IioSource(settings.pop("device"), **settings)
    return IioPollSource(settings.pop("device"), settings.pop("rate"), **settings)


class Stretched:
    """A source that runs `speed` times faster than time, as an emulated rig may.

    Its host times are stretched to what they stand for.
    """

    def __init__(self, source: Source, speed: float) -> None:
        self._source, self._speed = source, speed
        self._start = time.monotonic_ns()

    @property
    def name(self) -> str:
        """Name of the source."""
        return self._source.name

    @property
    def finished(self) -> bool:
        """Whether the source is."""
        return self._source.finished

    def read(self, timeout: float) -> list[Received | Event]:
        """Read the source, with every time stretched from the moment this was made."""
        return [replace(item, t_ns=self._start + round((item.t_ns - self._start) * self._speed))
                for item in self._source.read(timeout)]  # fmt: skip

    def close(self) -> None:
        """Close the source."""
        self._source.close()


class ReplaySource:
    """The raw reads and the events of a recording, `speed` times as fast as they came; None: as fast as it goes.

    Rows that are missing from a damaged recording become an event, so that the line does not take bytes for neighbours
    that are none.
    """

    def __init__(self, log: Log, speed: float | None = None) -> None:
        self._items = _due(self._all(log))
        self._speed = speed
        self._started: tuple[int, int] | None = None
        self.name = log.paths[0].name
        self.finished = False

    def read(self, timeout: float) -> list[Received | Event]:
        """Next items; at the recording's own pace, one at a time, where a speed is given."""
        items: list[Received | Event] = []
        for due_ns, item in self._items:
            if self._speed:
                self._started = self._started or (due_ns, time.monotonic_ns())
                due = self._started[1] + (due_ns - self._started[0]) / self._speed
                time.sleep(max(0.0, (due - time.monotonic_ns()) / 1e9))
                return [item]
            items.append(item)
            if len(items) == _AT_ONCE:
                return items
        self.finished = True
        return items

    def close(self) -> None:
        """Nothing is held open."""

    def _all(self, log: Log) -> Iterator[Received | Event]:
        expected = Counter[str]()  # next row of each source
        for message in log:
            kind, _, source = message.topic.partition("/")
            if kind == rows.EVENTS:
                yield replace(rows.parsed_event(message.data), t_ns=message.t_ns, source=source)
            if kind != rows.RAW:
                continue
            if message.sequence > expected[source]:
                missing = message.sequence - expected[source]
                text = f"{missing} reads are missing from the recording"
                yield Event(message.t_ns, "dropped", text, missing, source)
                yield Event(message.t_ns, "reopened", "the recording goes on", source=source)
            expected[source] = message.sequence + 1
            yield Received(message.t_ns, message.data, source)


def _due(items: Iterable[Received | Event]) -> Iterator[tuple[int, Received | Event]]:
    """Items with the time, ns, at which they are due: an event not later than the bytes behind it.

    The bytes of a file have times of their own, counted from their frames; what is said of a sink meanwhile has the
    host's, which may be hours or years apart.
    """
    events: list[Event] = []
    latest = 0
    for item in items:
        if isinstance(item, Event):
            events.append(item)
            continue
        yield from ((min(event.t_ns, item.t_ns), event) for event in events)
        events, latest = [], item.t_ns
        yield item.t_ns, item
    yield from ((min(event.t_ns, latest), event) for event in events)
