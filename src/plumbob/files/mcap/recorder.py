"""Write a recording: rows from the caller's loop, who never waits for the disk."""

import secrets
import threading
import time
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from operator import index
from os import PathLike
from pathlib import Path
from typing import Final, Self

from plumbob.core.errors import DecodeError, ParameterError
from plumbob.core.event import Event
from plumbob.files.mcap import layout, writer
from plumbob.files.mcap.layout import MESSAGE_BYTES, Channel, ChannelRecords, OpenChunk, Rules, Schema, State
from plumbob.files.mcap.scan import identify
from plumbob.files.mcap.writer import Backlog, Writer

BACKLOG: Final = 64 << 20  # bytes of rows that may wait for a slow or full disk
VERSION_KEY: Final = "plumbob"  # metadata with the version of the program, which may change between parts
COMPRESSIONS: Final = ("zstd", "none")


class Recorder:
    """A log of messages on channels, in MCAP, that survives a crash.

    Rows are gathered in chunks of at most `every` seconds; a thread writes each chunk whole, so that a killed process
    loses at most the last one. Parts are named ``name.mcap``, ``name.0002.mcap`` and so on. Sequence numbers count each
    channel's rows from 0 over all parts; a dropped row leaves a hole in them. One thread calls the methods.
    """

    def __init__(
        self,
        path: str | PathLike[str],  # first part; neither it nor a later part may exist, unless `next_part`
        *,
        epoch_offset_ns: int,  # what is added to the host's monotonic clock to get UTC, ns; fixed for the recording
        every: float = 0.1,  # longest time of a chunk, s
        rotate: float | None = None,  # a part ends after so many seconds of rows
        rotate_bytes: int | None = None,  # or at this size
        reserve: int | None = None,  # bytes that stay free; the smaller of 1 GiB and 5 % of the disk if not given
        fsync: float | None = 1.0,  # longest time until the disk is asked to confirm, s; None: at the end of a part
        compression: str = "zstd",  # of chunks, or "none"
        backlog: int = BACKLOG,  # bytes of rows that may wait for the disk; rows beyond are dropped and counted
        next_part: bool = False,  # go on behind parts of this name, which stay; `open_log` reads all if metadata agree
    ) -> None:
        self.metadata: dict[str, str] = {}  # what is to be said of the whole recording; fixed once it has started
        self.written = 0  # rows taken by `write`
        self.path = self._path = Path(path)  # first part that this recorder writes, once it has started
        self.follows: Path | None = None  # part behind which it goes on; None where it begins
        self.alone = False  # whether parts before it are of another kind, and not read together with its own
        self._next_part = next_part
        self._offset = epoch_offset_ns
        self._every_ns = round(every * 1e9)
        self._options = (rotate, rotate_bytes, reserve, fsync, compression)
        self._backlog = Backlog(backlog)
        self._recording = secrets.token_hex(16)
        self._channels: dict[int, ChannelRecords] = {}
        self._next: dict[int, int] = {}
        self._chunk: OpenChunk | None = None
        self._writer: Writer | None = None
        self._events: deque[Event] = deque()
        self._lost = 0
        self._drops: Counter[str] = Counter()
        self._drops_lock = threading.Lock()
        self._untold = 0
        self._overflowing = False

    @property
    def state(self) -> State:
        """Whether it writes: ``new``, ``recording``, ``stopped`` (the disk refuses; rows wait), ``closed``."""
        return "new" if self._writer is None else self._writer.state

    @property
    def acknowledged(self) -> int:
        """Rows whose chunk has been written; rows that a failed fsync puts in doubt are taken back and rewritten."""
        return 0 if self._writer is None else self._writer.acknowledged

    @property
    def dropped(self) -> int:
        """Rows that had no room, were too large, or were still unwritten at the end."""
        return self._lost + (0 if self._writer is None else self._writer.unwritten)

    def start(self) -> Self:
        """Create the first part and begin to write; on a full disk as ``stopped``, going on once there is room."""
        if self._writer is not None:
            raise ParameterError(f"the recording {self._path.name} has been started before; make another Recorder.")
        rules, existing = self.require()
        if existing:
            self.follows, self.path = existing[-1], layout.next_path(self._path)
        before, number = self._recording_before(existing), layout.part_number(self._path, self.path)
        self.alone = bool(existing) and before is None
        part = layout.PartInfo(
            self._recording, number, self._offset, metadata={**self.metadata}, follows=before, boot=writer.boot_id()
        )
        thread = Writer(rules, part, self._backlog, self._take_drops, self._tell)
        try:
            thread.start()
        except FileExistsError:
            self._refuse(layout.existing_parts(self._path))
            raise
        except OSError as error:
            raise DecodeError(f"{self._path} cannot be written: {error.strerror}. Choose another place.") from error
        self._writer = thread
        return self

    def require(self) -> tuple[Rules, Sequence[Path]]:
        """Refuse what cannot be written, as `start` does; gives its rules, and the parts that exist."""
        rules, existing = self._rules(), layout.existing_parts(self._path)
        self._refuse(existing)
        return rules, existing

    def channel(
        self, topic: str, encoding: str, schema: Schema | None = None, metadata: Mapping[str, str] | None = None
    ) -> int:
        """Declare a channel, before or after the start, and return its number; ParameterError if the topic is taken."""
        if any(other.topic == topic for other in self._channels.values()):
            raise ParameterError(f"the recording {self._path.name} has a channel '{topic}' already.")
        _refuse_reserved(metadata or {})
        number = len(self._next) + 1
        channel = Channel(topic, encoding, schema, metadata or {}, self._recording, self._offset)
        self._channels[number] = channel.declared(number)
        self._next[number] = 0
        return number

    def write(self, channel: int, t_ns: int, data: bytes) -> None:
        """Take a row of a channel, by the host's monotonic clock, ns; `data` must not change any more."""
        if channel not in self._next:
            raise ParameterError(f"the recording {self._path.name} has no channel {channel}; declare it first.")
        if not isinstance(data, bytes):  # the writing thread could not say whose fault it was
            raise ParameterError(f"a row of a recording must be bytes, but it is {type(data).__name__}; encode it.")
        t_ns = index(t_ns)
        declared, sequence = self._channels[channel], self._next[channel]
        self._next[channel] = sequence + 1
        self.written += 1
        log_time = t_ns + self._offset
        if len(data) > MESSAGE_BYTES or not 0 <= log_time < layout.TIMES:
            self._drop({declared.topic: 1}, f"a row of {len(data)} bytes at {log_time} ns cannot be stored")
            return
        chunk = self._chunk
        if chunk is None or chunk.is_due(t_ns, self._every_ns):
            self._hand_over()
            chunk = self._chunk = OpenChunk(t_ns)
        chunk.add(declared, sequence, log_time, data)

    def tick(self, t_ns: int) -> None:
        """Send off the rows gathered if they are due at this time; to be called often, also when nothing comes."""
        if self._chunk is not None and self._chunk.is_due(t_ns, self._every_ns):
            self._hand_over()

    def take_events(self) -> list[Event]:
        """What has happened since the last call, oldest first."""
        return [self._events.popleft() for _ in range(len(self._events))]

    def close(self, timeout: float = 10.0) -> None:
        """Write everything that waits, within `timeout` s, and end the part; more than once does no harm."""
        if self._writer is None or self.state == "closed":
            return
        self._hand_over()
        self._tell_drops("rows have been dropped")
        if not self._writer.close(timeout):
            waiting = self.written - self.acknowledged - self.dropped
            self._tell("unfinished", f"the disk did not take the last rows within {timeout:g} s", waiting)

    def __enter__(self) -> Self:
        return self if self._writer is not None else self.start()

    def __exit__(self, *error: object) -> None:
        self.close()

    def _rules(self) -> Rules:
        rotate, rotate_bytes, reserve, fsync, compression = self._options
        if compression not in COMPRESSIONS:
            raise ParameterError(f"compression must be one of {', '.join(COMPRESSIONS)}, but it is '{compression}'.")
        if self._path.suffix != layout.SUFFIX:
            raise ParameterError(f"a recording must be named *{layout.SUFFIX}, but it is '{self._path.name}'.")
        if not 0 < self._every_ns <= 10**10:
            raise ParameterError(f"every must be from 0 to 10 s, but it is {self._every_ns / 1e9:g} s.")
        for name, value in (("rotate", rotate), ("rotate_bytes", rotate_bytes)):
            if value is not None and not value > 0:
                raise ParameterError(f"{name} must be positive, or None for no such limit, but it is {value:g}.")
        _refuse_reserved(self.metadata)
        folder = self._path.parent
        if not folder.is_dir():
            raise DecodeError(f"{self._path} cannot be written: there is no folder {folder}; create it first.")
        reserve = writer.default_reserve(folder) if reserve is None else reserve
        return Rules(self._path, rotate, rotate_bytes, reserve, fsync, compression)

    def _refuse(self, existing: Sequence[Path]) -> None:
        for part in existing:
            if writer.is_locked(part):
                raise ParameterError(f"{part} is being recorded by another process or recorder; name another file.")
        if existing and not self._next_part:
            raise ParameterError(
                f"{existing[0]} exists already, and a recording never replaces a file. Name another file, one with "
                f"{layout.UTC_FIELD} for the time of the start, or ask for the next part."
            )

    def _recording_before(self, existing: Sequence[Path]) -> str | None:
        """Recording that this one goes on from: that of the last part that can be read, if it is of the same kind."""
        for part in reversed(existing):
            with suppress(DecodeError):
                before = identify(part)
                if before.info is not None:  # of the same kind if only the version of the program differs
                    said = (self.metadata, before.info.metadata)
                    mine, other = ({k: v for k, v in all_.items() if k != VERSION_KEY} for all_ in said)
                    return before.recording if mine == other else None
        return "" if existing else None

    def _hand_over(self) -> None:
        chunk, self._chunk = self._chunk, None
        if chunk is None or not chunk.rows:
            return
        if self._backlog.put(chunk):
            self._tell_drops("rows find room again")
        else:
            self._drop(chunk.counts(), "the disk is too slow or does not respond, and no more rows may wait")

    def _drop(self, counts: Mapping[str, int], why: str) -> None:
        """Count rows that are lost; say so at once, and how many more there were when rows find room again."""
        self._untold += sum(counts.values())
        self._lost += sum(counts.values())
        with self._drops_lock:
            self._drops.update(counts)
        if not self._overflowing:
            self._tell_drops(f"rows are dropped: {why}")
        self._overflowing = True

    def _tell_drops(self, text: str) -> None:
        if self._untold:
            self._tell("dropped", text, self._untold)
        self._untold = 0
        self._overflowing = False

    def _take_drops(self) -> dict[str, int]:
        with self._drops_lock:
            drops, self._drops = self._drops, Counter()
        return drops

    def _tell(self, kind: str, text: str, count: int) -> None:
        self._events.append(Event(time.monotonic_ns(), kind, text, count))


def _refuse_reserved(metadata: Mapping[str, str]) -> None:
    for key in metadata:
        if key.startswith(layout.RESERVED):
            raise ParameterError(
                f"metadata key '{key}' begins with '{layout.RESERVED}', which is kept for the recorder."
            )
