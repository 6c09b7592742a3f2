"""The thread that writes: chunks from the backlog to parts, through full and failing disks; one part; system calls."""

import errno
import os
import shutil
import sys
import threading
import time
import zlib
from collections import Counter, deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

from mcap import records
from mcap.opcode import Opcode

from plumbob.core.files import lock, sync_folder
from plumbob.core.text import counted
from plumbob.files.mcap import layout
from plumbob.files.mcap.layout import ChannelRecords, OpenChunk, PartInfo, Rules, State

if sys.platform != "win32":
    import fcntl

ZSTD_LEVEL: Final = 3


def create_locked(path: Path) -> int:
    """Create a file that is not there yet, locked against other recorders; return its descriptor."""
    fd = os.open(path, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o644)
    try:
        lock(fd)
        sync_folder(path.parent)
    except OSError:
        os.close(fd)
        path.unlink(missing_ok=True)
        raise
    return fd


def compressor(name: str) -> tuple[str, Callable[[bytes], bytes]]:
    """Name of a compression in MCAP, and the function that does it; a zstd frame has a checksum of its own."""
    if name == "none":
        return "", bytes
    from zstandard import ZstdCompressor

    return "zstd", ZstdCompressor(level=ZSTD_LEVEL, write_checksum=True).compress


def write_all(fd: int, data: bytes, offset: int) -> None:
    """Write all of `data` at `offset`, in as many calls as the system needs."""
    os.lseek(fd, offset, os.SEEK_SET)
    view = memoryview(data)
    while view:
        view = view[os.write(fd, view) :]


def is_locked(path: Path) -> bool:
    """Whether a recorder holds the file at this moment."""
    if sys.platform == "win32":
        return False
    with path.open("rb") as file:
        try:
            fcntl.flock(file.fileno(), fcntl.LOCK_SH | fcntl.LOCK_NB)
        except OSError:
            return True
    return False


def is_full(error: OSError) -> bool:
    """Whether an error says that there is no room, which may come back."""
    return error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def free_bytes(folder: Path) -> int:
    """Bytes that may still be written to the disk of a folder."""
    return shutil.disk_usage(folder).free


def boot_id() -> str:
    """Which start of this machine it is, a random word that the kernel made; empty where it makes none."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
    except OSError:
        return ""


def default_reserve(folder: Path) -> int:
    """The smaller of 1 GiB and 5 % of the disk, bytes."""
    return min(1 << 30, int(0.05 * shutil.disk_usage(folder).total))


class RecordingPart:
    """A file that holds whole chunks only, and says so at its end if it gets there; `create` gives its descriptor."""

    def __init__(
        self, path: Path, info: PartInfo, compression: str = "zstd", create: Callable[[Path], int] = create_locked
    ) -> None:
        self.path = path
        self.info = info
        self.size = 0
        self.synced = (0, 0)  # size, rows
        self.t_ns: int | None = None  # when its first chunk was opened
        self.ends: dict[str, int] = {}  # per topic, one more than the last sequence number
        self.chunk_indexes = bytearray()  # records of the chunks
        self.contents = records.Statistics(0, 0, {}, 0, 0, 0, 0, 0, 0)  # of what has been written so far
        self._channels: dict[int, ChannelRecords] = {}
        self._counts: Counter[int] = Counter()  # rows per channel
        self._infos: list[records.MetadataIndex] = []
        self._compression = compression
        self._create = create
        self._fd = -1
        self._crc = 0

    def begin(self) -> None:
        """Create the file and write its beginning; leave none behind where the system refuses (OSError)."""
        self._compression, self._compress = compressor(self._compression)
        self._fd = self._create(self.path)
        try:
            self._append(layout.MAGIC + layout.encode(records.Header(profile="", library="plumbob recording 1")))
            self._append_info(self.info)
            self.sync()
        except OSError:
            self.close(keep=False)
            raise

    def write(self, chunk: OpenChunk) -> None:
        """Append a chunk and its message indexes; on OSError the file ends as before."""
        content, offset = b"".join(chunk.pieces), self.size
        stored, first, last = self._compress(content), chunk.first, chunk.last
        of_chunk = records.Chunk(self._compression, stored, last, first, zlib.crc32(content), len(content))
        record = layout.encode(of_chunk)
        at, offsets, indexes = offset + len(record), {}, layout.index_records(chunk.entries)
        for channel, index in indexes.items():
            offsets[channel] = at
            at += len(index)
        self._append(b"".join((record, *indexes.values())))
        self.chunk_indexes += layout.encode(
            records.ChunkIndex(
                chunk_start_offset=offset,
                chunk_length=len(record),
                message_start_time=first,
                message_end_time=last,
                message_index_offsets=offsets,
                message_index_length=at - offset - len(record),
                compression=self._compression,
                compressed_size=len(stored),
                uncompressed_size=len(content),
            )
        )
        so_far = self.contents
        self._counts.update({channel: len(flat) // 2 for channel, flat in chunk.entries.items()})
        so_far.message_start_time = min(so_far.message_start_time, first) if so_far.message_count else first
        so_far.message_end_time = max(so_far.message_end_time, last)
        so_far.message_count += chunk.rows
        so_far.chunk_count += 1
        self._channels |= chunk.channels
        self.ends |= chunk.ends()
        self.t_ns = chunk.t_ns if self.t_ns is None else self.t_ns

    def finish(self, ends: Mapping[str, int], dropped: Mapping[str, int]) -> None:
        """Write what was said first once more, the index, the footer; on OSError it ends with its whole chunks."""
        size, crc = self.size, self._crc
        try:
            self._append_info(replace(self.info, ends=ends, dropped=dropped))
            self._append(self._closing())
        except OSError:
            self.size, self._crc = size, crc
            self.cut()
            raise

    def _closing(self) -> bytes:
        """Everything from the end of the data to the end of the file."""
        counts = dict(sorted(self._counts.items()))
        used = [self._channels[channel].records for channel in counts]
        statistics = replace(
            self.contents,
            channel_count=len(used),
            channel_message_counts=counts,
            metadata_count=len(self._infos),
            schema_count=sum(bool(schema) for schema, _ in used),
        )
        groups = {
            Opcode.SCHEMA: b"".join(schema for schema, _ in used),
            Opcode.CHANNEL: b"".join(channel for _, channel in used),
            Opcode.STATISTICS: layout.encode(statistics),
            Opcode.CHUNK_INDEX: bytes(self.chunk_indexes),
            Opcode.METADATA_INDEX: b"".join(map(layout.encode, self._infos)),
        }
        data_end = layout.encode(records.DataEnd(self._crc))
        start = self.size + len(data_end)
        summary, offsets = b"", b""
        for opcode, group in groups.items():
            place = records.SummaryOffset(opcode, group_start=start + len(summary), group_length=len(group))
            offsets += layout.encode(place) if group else b""
            summary += group
        footer = layout.encode(records.Footer(start, start + len(summary), 0))[: -layout.CRC.size]
        checked = summary + offsets + footer
        return data_end + checked + layout.CRC.pack(zlib.crc32(checked)) + layout.MAGIC

    def sync(self) -> None:
        """Wait until the disk has everything; raises OSError if it does not take it."""
        os.fsync(self._fd)
        self.synced = (self.size, self.contents.message_count)

    def close(self, keep: bool) -> None:
        """Close the file, and remove it unless it is to be kept."""
        os.close(self._fd)
        self._fd = -1
        if not keep:
            self.path.unlink(missing_ok=True)

    def _append_info(self, info: PartInfo) -> None:
        offset = self.size
        self._append(info.record())
        self._infos.append(records.MetadataIndex(offset, self.size - offset, layout.NAME))

    def _append(self, data: bytes) -> None:
        try:
            write_all(self._fd, data, self.size)
        except OSError:
            self.cut()
            raise
        self.size += len(data)
        self._crc = zlib.crc32(data, self._crc)

    def cut(self) -> None:
        """End the file at its size."""
        try:
            os.ftruncate(self._fd, self.size)
        except OSError:  # a disk that refuses this too keeps a torn end, which the reader knows how to leave out
            return


class Backlog:
    """A queue of `limit` bytes between the recorder's caller, who never waits, and the thread that writes."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._chunks: deque[OpenChunk] = deque()
        self._bytes = 0
        self._changed = threading.Condition()
        self.closing = False  # whether nothing more will come

    def put(self, chunk: OpenChunk) -> bool:
        """Append a chunk; False, and nothing is done, where there is no room or it is closed."""
        with self._changed:
            if self.closing or self._bytes + chunk.size > self._limit:
                return False
            self._chunks.append(chunk)
            self._bytes += chunk.size
            self._changed.notify()
        return True

    def head(self, timeout: float) -> OpenChunk | None:
        """Oldest chunk, which stays; wait at most `timeout` s for one."""
        with self._changed:
            if not self._chunks and not self.closing:
                self._changed.wait(timeout)
            return self._chunks[0] if self._chunks else None

    def pause(self, timeout: float) -> None:
        """Wait `timeout` s, or until nothing more will come."""
        with self._changed:
            self._changed.wait_for(lambda: self.closing, timeout)

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
            self.closing = True
            self._changed.notify_all()


RETRY: Final = 1.0  # A stopped recording looks so often whether it can go on, s; also how often free space is looked at
INDEX_BYTES: Final = 16 << 20  # a part ends when its index, which is in memory, is so large: after some 3 h
MARGIN: Final = 16 << 20  # more than the reserve before a stopped recording goes on; a quarter of a small one


class Writer:
    """Writes chunks of the backlog, the only one who touches the disk; `info` is what the first part says of itself.

    `take_drops` gives rows per topic that had no room since then.
    """

    def __init__(
        self,
        rules: Rules,
        info: PartInfo,
        backlog: Backlog,
        take_drops: Callable[[], dict[str, int]],
        tell: Callable[[str, str, int], None],
    ) -> None:
        self.state: State = "new"
        self.acknowledged = 0
        self.unwritten = 0
        self._rules = rules
        self._info = info
        self._backlog = backlog
        self._take_drops = take_drops
        self._tell = tell
        self._thread = threading.Thread(target=self._run, name="plumbob recorder", daemon=True)
        self._part: RecordingPart | None = None
        self._number = info.part - 1
        self._next: dict[str, int] = {}
        self._unsynced: list[OpenChunk] = []
        self._sync_at = 0.0
        self._look_at = 0.0
        self._try_at = 0.0
        self._barren = False

    def start(self) -> None:
        """Open the first part, unless the disk is full, and begin to write; OSError where it cannot otherwise."""
        self.state = "recording"
        if low := self._low():
            self._stop(low)
        else:
            try:
                self._open_next()
            except OSError as error:
                if not is_full(error):
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
            waits = self._rules.fsync is not None and bool(self._unsynced)  # for a chunk, until the next fsync is due
            chunk = self._backlog.head(max(0.0, min(RETRY, self._sync_at - time.monotonic())) if waits else RETRY)
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

    def _store(self, chunk: OpenChunk) -> None:
        if time.monotonic() >= self._look_at:
            self._look_at = time.monotonic() + RETRY
            if low := self._low():
                self._end_part()
                self._stop(low)
                return
        try:
            if self._is_over(chunk):
                self._end_part()
                self._open_next()
            assert self._part is not None
            self._part.write(chunk)
        except OSError as error:
            if self._part is not None:
                self._end_part()
            self._stop(_reason(error))
            return
        self._backlog.pop()
        self._acknowledge(chunk)

    def _acknowledge(self, chunk: OpenChunk) -> None:
        self.acknowledged += chunk.rows
        self._next |= chunk.ends()
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
        info = replace(self._info, part=number, starts=dict(self._next))
        part = RecordingPart(layout.part_path(self._rules.path, number), info, self._rules.compression)
        part.begin()
        self._part, self._number = part, number

    def _reopen(self) -> bool:
        """Try to go on after a stop, at most once in `RETRY` seconds unless the recording is closing."""
        now = time.monotonic()
        if (now < self._try_at and not self._backlog.closing) or (self._barren and self._backlog.closing):
            return False
        self._try_at = now + RETRY
        try:
            if free_bytes(self._rules.path.parent) < self._rules.reserve + min(MARGIN, self._rules.reserve // 4):
                return False
            self._open_next()
        except OSError:
            return False
        return True

    def _is_over(self, chunk: OpenChunk) -> bool:
        """Whether the part is to end before this chunk."""
        assert self._part is not None
        rules, part = self._rules, self._part
        if not part.contents.message_count or part.t_ns is None:
            return False
        return (
            (rules.rotate is not None and chunk.t_ns - part.t_ns >= rules.rotate * 1e9)
            or (rules.rotate_bytes is not None and part.size >= rules.rotate_bytes)
            or len(part.chunk_indexes) >= INDEX_BYTES
        )

    def _end_part(self, keep_empty: bool = False) -> None:
        """End the part as well as the disk allows; rows that the disk does not confirm go back to the backlog."""
        part, self._part = self._part, None
        assert part is not None
        try:
            part.finish(part.ends, self._take_drops())
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
        self._barren = not part.contents.message_count
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
        part.size, part.contents.message_count = part.synced  # what the disk has confirmed stays in the file
        part.cut()
        for chunk in self._unsynced:
            self.acknowledged -= chunk.rows
            for topic, start in chunk.starts.items():
                self._next[topic] = min(self._next[topic], start)
        self._backlog.put_back(self._unsynced)
        self._unsynced = []
        self._stop(_reason(error))

    def _stop(self, reason: str) -> None:
        """Say once that the recording stands still."""
        self._try_at = time.monotonic() + RETRY
        if self.state != "stopped":
            self.state = "stopped"
            self._tell("stopped", f"recording {self._rules.path.name} has stopped: {reason}", 0)

    def _low(self) -> str:
        """That the reserve is touched; empty where it is not."""
        try:
            is_low = free_bytes(self._rules.path.parent) < self._rules.reserve
        except OSError:  # a folder that cannot be asked will refuse to be written to as well, and say why
            return ""
        return f"less than the reserve of {self._rules.reserve / 1e6:.4g} MB is free" if is_low else ""


def _reason(error: OSError) -> str:
    return error.strerror or type(error).__name__
