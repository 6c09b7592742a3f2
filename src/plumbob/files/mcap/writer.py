"""The thread that writes: chunks from the backlog to parts, through full and failing disks."""

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from plumbob.core.text import counted
from plumbob.files.mcap import disk, layout
from plumbob.files.mcap.layout import OpenChunk, PartInfo, Rules, State, compressor, pack
from plumbob.files.mcap.part import RecordingPart


class Backlog:
    """A queue of `limit` bytes between the recorder's caller, who never waits, and the thread that writes."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._chunks: deque[OpenChunk] = deque()
        self._bytes = 0
        self._changed = threading.Condition()
        self._closing = False

    @property
    def closing(self) -> bool:
        """Whether nothing more will come."""
        return self._closing

    def put(self, chunk: OpenChunk) -> bool:
        """Append a chunk; False, and nothing is done, where there is no room or it is closed."""
        with self._changed:
            if self._closing or self._bytes + chunk.size > self._limit:
                return False
            self._chunks.append(chunk)
            self._bytes += chunk.size
            self._changed.notify()
        return True

    def head(self, timeout: float) -> OpenChunk | None:
        """Oldest chunk, which stays; wait at most `timeout` s for one."""
        with self._changed:
            if not self._chunks and not self._closing:
                self._changed.wait(timeout)
            return self._chunks[0] if self._chunks else None

    def pause(self, timeout: float) -> None:
        """Wait `timeout` s, or until nothing more will come."""
        with self._changed:
            self._changed.wait_for(lambda: self._closing, timeout)

    def pop(self) -> None:
        """Remove the oldest chunk."""
        with self._changed:
            self._bytes -= self._chunks.popleft().size

    def put_back(self, chunks: list[OpenChunk]) -> None:
        """Put chunks before all others, whatever the limit: they have been taken once."""
        with self._changed:
            self._chunks.extendleft(reversed(chunks))
            self._bytes += sum(chunk.size for chunk in chunks)

    def clear(self) -> list[OpenChunk]:
        """Remove and return everything."""
        with self._changed:
            chunks = list(self._chunks)
            self._chunks.clear()
            self._bytes = 0
        return chunks

    def close(self) -> None:
        """Say that nothing more will come."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()


RETRY: Final = 1.0  # A stopped recording looks so often whether it can go on, s; also how often free space is looked at
INDEX_BYTES: Final = 16 << 20
"""A part ends when its index is as large as this, which takes some three hours: the index is kept in memory."""
MARGIN: Final = 16 << 20
"""So much more than the reserve must be free before a stopped recording goes on; a quarter of a small reserve."""


class Writer:
    """Writes chunks of the backlog, the only one who touches the disk; `info` is what each part says of itself.

    `channels` holds topic and records by number, and grows; `take_drops` gives rows per topic that had no room since it
    was last asked; `tell` takes kind, text and count of an event.
    """

    def __init__(
        self,
        rules: Rules,
        info: PartInfo,
        backlog: Backlog,
        channels: "dict[int, tuple[str, tuple[bytes, bytes]]]",
        take_drops: Callable[[], dict[str, int]],
        tell: Callable[[str, str, int], None],
    ) -> None:
        self.state: State = "new"
        self.acknowledged = 0
        self.unwritten = 0
        self._rules = rules
        self._info = info
        self._backlog = backlog
        self._channels = channels
        self._take_drops = take_drops
        self._tell = tell
        self._thread = threading.Thread(target=self._run, name="plumbob recorder", daemon=True)
        self._compression, self._compress = compressor(rules.compression)
        self._part: RecordingPart | None = None
        self._number = rules.first - 1
        self._part_t_ns: int | None = None
        self._next: dict[int, int] = {}
        self._unsynced: list[OpenChunk] = []
        self._sync_at = 0.0
        self._look_at = 0.0
        self._try_at = 0.0
        self._barren = False

    def start(self) -> None:
        """Open the first part, unless the disk is full, and begin to write; OSError where it cannot otherwise."""
        self.state = "recording"
        if self._is_low():
            self._stop(self._low_text())
        else:
            try:
                self._open_next()
            except OSError as error:
                if not disk.is_full(error):
                    raise
                self._stop(_reason(error))
        self._thread.start()

    def close(self, timeout: float) -> bool:
        """Write what waits, end the part, and say whether that was done within `timeout` s."""
        self._backlog.close()
        self._thread.join(timeout)
        return not self._thread.is_alive()

    # --- the thread ---------------------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            self._write_all()
        except BaseException:
            self._stop("the writing thread has failed")
            raise

    def _write_all(self) -> None:
        while True:
            if self._part is None and not self._reopen():
                if self._backlog.closing:
                    break
                self._backlog.pause(RETRY)
                continue
            chunk = self._backlog.head(self._patience())
            if chunk is not None:
                self._store(chunk)
            elif self._backlog.closing:
                break
            self._sync_if_due()
        self._end()

    def _end(self) -> None:
        chunks = self._backlog.clear()
        self.unwritten = sum(chunk.rows for chunk in chunks)
        if chunks:
            self._tell(
                "dropped", f"{counted(self.unwritten, 'row')} unwritten when the recording ended", self.unwritten
            )
        if self._part is not None:
            self._end_part(keep_empty=True)
        self.state = "closed"

    def _patience(self) -> float:
        """How long to wait for a chunk: until the next fsync is due, if there is something to sync."""
        if self._rules.fsync is None or not self._unsynced:
            return RETRY
        return max(0.0, min(RETRY, self._sync_at - time.monotonic()))

    def _store(self, chunk: OpenChunk) -> None:
        if self._looks_low():
            self._end_part()
            self._stop(self._low_text())
            return
        if self._is_over(chunk) and not self._rotate():
            return
        assert self._part is not None
        try:
            self._part.write(chunk, pack(chunk, self._compression, self._compress))
        except OSError as error:
            self._fail(error)
            return
        self._backlog.pop()
        self._acknowledge(chunk)

    def _acknowledge(self, chunk: OpenChunk) -> None:
        self.acknowledged += chunk.rows
        if self._part_t_ns is None:
            self._part_t_ns = chunk.t_ns
        for channel, count in chunk.counts().items():
            self._next[channel] = chunk.lows[channel] + count
        if self._rules.fsync is not None:
            if not self._unsynced:
                self._sync_at = time.monotonic() + self._rules.fsync
            self._unsynced.append(chunk)
        if self.state == "stopped":
            self.state = "recording"
            assert self._part is not None
            self._tell("resumed", f"recording goes on in {self._part.path.name}", 0)

    # --- parts --------------------------------------------------------------------------------------------------

    def _open_next(self) -> None:
        number = self._number + 1
        while layout.part_path(self._rules.path, number).exists():
            number += 1
        starts = {self._channels[channel][0]: count for channel, count in self._next.items()}
        info = replace(self._info, part=number, starts=starts)
        part = RecordingPart(layout.part_path(self._rules.path, number), info)
        part.begin()
        self._part, self._number, self._part_t_ns = part, number, None

    def _reopen(self) -> bool:
        """Try to go on after a stop, at most once in `RETRY` seconds unless the recording is closing."""
        now = time.monotonic()
        if (now < self._try_at and not self._backlog.closing) or (self._barren and self._backlog.closing):
            return False
        self._try_at = now + RETRY
        try:
            if disk.free(self._rules.path.parent) < self._rules.reserve + min(MARGIN, self._rules.reserve // 4):
                return False
            self._open_next()
        except OSError:
            return False
        return True

    def _rotate(self) -> bool:
        self._end_part()
        try:
            self._open_next()
        except OSError as error:
            self._stop(_reason(error))
            return False
        return True

    def _is_over(self, chunk: OpenChunk) -> bool:
        """Whether the part is to end before this chunk."""
        assert self._part is not None
        rules, part = self._rules, self._part
        if not part.contents.rows or self._part_t_ns is None:
            return False
        return (
            (rules.rotate is not None and chunk.t_ns - self._part_t_ns >= rules.rotate * 1e9)
            or (rules.rotate_bytes is not None and part.size >= rules.rotate_bytes)
            or len(part.contents.chunk_indexes) >= INDEX_BYTES
        )

    def _end_part(self, keep_empty: bool = False) -> None:
        """End the part as well as the disk allows; rows that the disk does not confirm go back to the backlog."""
        part, self._part = self._part, None
        assert part is not None
        records = {channel: records for channel, (_, records) in list(self._channels.items())}
        ends = {self._channels[channel][0]: end for channel, end in part.contents.ends.items()}
        try:
            part.finish(records, ends, self._take_drops())
        except OSError as error:
            self._tell(
                "unfinished", f"{part.path.name} has no index, since it could not be written: {_reason(error)}", 0
            )
        try:
            part.sync()
        except OSError as error:
            self._take_back(part, error)
        self._unsynced.clear()
        self._close(part, keep_empty)

    def _close(self, part: RecordingPart, keep_empty: bool) -> None:
        self._barren = not part.contents.rows
        part.close(keep=keep_empty or not self._barren)
        if self._barren and not keep_empty:
            self._number -= 1

    # --- trouble ------------------------------------------------------------------------------------------------

    def _sync_if_due(self) -> None:
        if self._part is None or not self._unsynced or time.monotonic() < self._sync_at:
            return
        try:
            self._part.sync()
            self._unsynced.clear()
        except OSError as error:
            part, self._part = self._part, None
            self._take_back(part, error)
            self._close(part, keep_empty=False)

    def _take_back(self, part: RecordingPart, error: OSError) -> None:
        """After a failed fsync nobody knows what the disk has: write those rows once more, elsewhere."""
        part.cut_to_synced()
        for chunk in self._unsynced:
            self.acknowledged -= chunk.rows
            for channel, low in chunk.lows.items():
                self._next[channel] = min(self._next[channel], low)
        self._backlog.put_back(self._unsynced)
        self._unsynced = []
        self._stop(_reason(error))

    def _fail(self, error: OSError) -> None:
        self._end_part()
        self._stop(_reason(error))

    def _stop(self, reason: str) -> None:
        """Say once that the recording stands still."""
        self._try_at = time.monotonic() + RETRY
        if self.state != "stopped":
            self.state = "stopped"
            self._tell("stopped", f"recording {self._rules.path.name} has stopped: {reason}", 0)

    def _looks_low(self) -> bool:
        """Whether the reserve is touched, looked at once in `RETRY` seconds."""
        if time.monotonic() < self._look_at:
            return False
        self._look_at = time.monotonic() + RETRY
        return self._is_low()

    def _is_low(self) -> bool:
        try:
            return disk.free(self._rules.path.parent) < self._rules.reserve
        except OSError:  # a folder that cannot be asked will refuse to be written to as well, and say why
            return False

    def _low_text(self) -> str:
        return f"less than the reserve of {self._rules.reserve / 1e6:.4g} MB is free"


def _reason(error: OSError) -> str:
    return error.strerror or type(error).__name__
