"""Read a file record by record, believing nothing unchecked, go on behind every damage, and tell whose it is.

The file is looked at through windows of bytes; behind a damage, the next place is sought from which reading can go on.
"""

import os
import re
import struct
import zlib
from bz2 import BZ2File
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from typing import Any, Final, Self

from mcap import records
from mcap.exceptions import McapError
from mcap.opcode import Opcode

from plumbob.core.errors import DecodeError
from plumbob.core.files import existing_file, reading
from plumbob.files.mcap import layout
from plumbob.files.mcap.layout import PLAIN_BYTES, Channel, PartInfo

_SUMMARY_BYTES: Final = 1 << 26  # largest summary whose statistics are looked at
Row = tuple[int, int, int, bytes]  # channel number, sequence as on disk, log time in ns, data


class BrokenRecordError(ValueError):
    """A record is damaged; only the reader sees it, and makes a finding of it."""


@dataclass(slots=True)
class RowBlock:
    """Rows of a chunk that is whole."""

    channels: dict[int, Channel] = field(default_factory=dict)  # that are declared there
    rows: list[Row] = field(default_factory=list)  # messages, in order
    # the message index: per channel, log time and offset of its messages in turn
    entries: dict[int, list[int]] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)  # rows per channel by the statistics of a summary
    offset: int = 0  # of a chunk
    after: int = 0  # and where it ends
    times_hold: bool = True  # whether the times at its head are those of its rows


def parse(content: bytes) -> RowBlock:
    """Schemas, channels and messages of whole records."""
    block, schemas, at, end = RowBlock(), dict[int, bytes](), 0, len(content)
    head, message = layout.RECORD_HEAD.unpack_from, layout.MESSAGE_HEAD.unpack_from
    try:
        while at < end:
            opcode, length = head(content, at)
            after = at + 9 + length
            if after > end:
                raise BrokenRecordError("a record in it extends beyond its end")
            if opcode == Opcode.MESSAGE:
                if length < 22:
                    raise BrokenRecordError("a message in it is too short")
                _, _, channel, sequence, log_time, _ = message(content, at)
                block.rows.append((channel, sequence, log_time, content[at + 31 : after]))
                block.entries.setdefault(channel, []).extend((log_time, at))
            elif opcode == Opcode.SCHEMA:
                schemas[_number(content, at)] = content[at + 9 : after]
            elif opcode == Opcode.CHANNEL:
                schema = schemas.get(int.from_bytes(content[at + 11 : at + 13], "little"), b"")
                block.channels[_number(content, at)] = _channel(content[at + 9 : after], schema)
            elif opcode == Opcode.STATISTICS:
                statistics = records.Statistics.read(layout.stream(content[at + 9 : after]))
                block.counts = statistics.channel_message_counts
            at = after
    except (struct.error, McapError) as error:
        raise BrokenRecordError("a record in it is cut off") from error
    return block


@lru_cache(maxsize=32)  # every chunk declares its channels again; of a hostile file each may have 10 MB
def _channel(body: bytes, schema: bytes) -> Channel:
    try:
        return Channel.parse(body, schema)
    except layout.UNREADABLE as error:
        raise BrokenRecordError("a channel in it cannot be read") from error


def _number(content: bytes, at: int) -> int:
    return int.from_bytes(content[at + 9 : at + 11], "little")


def inflate(stored: bytes, compression: bytes, size: int) -> bytes:
    """Content of a chunk; BrokenRecordError unless it is `size` bytes, and never more is unpacked."""
    pieces, remaining, reader = [], size, _reader(stored, compression)
    try:
        while remaining >= 0 and (piece := reader.read(min(remaining + 1, 1 << 20))):
            pieces.append(piece)
            remaining -= len(piece)
    except Exception as error:  # each compression has errors of its own
        raise BrokenRecordError("the chunk cannot be decompressed") from error
    if remaining:
        raise BrokenRecordError(f"the chunk does not inflate to the {size} bytes that it states")
    return b"".join(pieces)


def _reader(stored: bytes, compression: bytes) -> Any:
    """Stream of what a chunk unpacks to."""
    if compression == b"zstd":
        from zstandard import ZstdDecompressor

        return ZstdDecompressor(max_window_size=1 << 27).stream_reader(stored, read_across_frames=True)
    if compression == b"lz4":
        from lz4.frame import LZ4FrameFile

        return LZ4FrameFile(BytesIO(stored))
    if compression == b"bz2":  # of ROS 1
        return BZ2File(BytesIO(stored))
    if compression:
        raise BrokenRecordError(f"the compression {compression!r} is not known")
    return BytesIO(stored)


WINDOW: Final = 1 << 20
_SEARCHES: Final = 32


class FileBytes:
    """Bytes of a file by offset; what lies beyond its end is missing from the answer."""

    def __init__(self, path: Path) -> None:
        self.path = path
        file = existing_file(path)
        with reading(path):
            self._file = file.open("rb")
        self.size = self._file.seek(0, os.SEEK_END)
        self._left = _SEARCHES * self.size + WINDOW

    def read(self, offset: int, count: int) -> bytes:
        """`count` bytes from `offset` on, fewer at the end of the file."""
        if offset >= self.size or count <= 0:
            return b""
        try:
            self._file.seek(offset)
            return self._file.read(min(count, self.size - offset))
        except OSError as error:
            raise DecodeError(f"{self.path} cannot be read at byte {offset}: {error.strerror}.") from error

    def may_search(self, count: int) -> bool:
        """Whether `count` more bytes may be searched or read to judge a record: 32 times the file in all, not more."""
        self._left -= count
        return self._left >= 0

    def crc(self, start: int, end: int, before: int = 0) -> int:
        """CRC-32 of the bytes from `start` to `end`, where that of those in front of them is `before`."""
        while start < end:
            before = zlib.crc32(self.read(start, min(WINDOW, end - start)), before)
            start += WINDOW
        return before

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._file.close()


_CHUNK: Final = rb"\x06[\s\S]{4}\x00{4}[\s\S]{28}(?:\x00{4}|\x04\x00{3}zstd|\x03\x00{3}lz4)"
_FOOTER: Final = rb"\x02\x14\x00{7}[\s\S]{20}\x89MCAP0\r\n"
_INFO: Final = rb"\x0c[\s\S]{4}\x00{4}\x07\x00{3}plumbob"
_LANDMARK: Final = re.compile(b"|".join((_CHUNK, _FOOTER, _INFO)))
_ONLY_FOOTER: Final = re.compile(_FOOTER)
_STEP: Final = 512
_OVERLAP: Final = 63  # no landmark is longer than one byte more


def next_landmark(source: FileBytes, start: int, is_good: Callable[[int], bool]) -> tuple[int, int | None]:
    """Offset, from `start` on, of the next `is_good` record or the end of the data, with that of its summary."""
    for at, opcode in _candidates(source, start, _LANDMARK):
        if opcode != Opcode.FOOTER:
            if is_good(at):
                return at, None
        elif (summary := summary_start(source, at)) is not None and summary >= start:
            data_end = summary - layout.DATA_END_SIZE
            return data_end if data_end >= start else summary, summary
    return source.size, None


def summary_start(source: FileBytes, footer: int) -> int | None:
    """Where the summary begins that a footer speaks of; None if its CRC does not hold."""
    body = source.read(footer + layout.RECORD_HEAD.size, layout.FOOTER_BODY.size)
    start, _, crc = layout.FOOTER_BODY.unpack(body)
    if start > footer or not source.may_search(footer - start):
        return None
    end = footer + layout.FOOTER_SIZE - layout.CRC.size
    return (start or footer) if source.crc(start or footer, end) == crc else None


def _candidates(source: FileBytes, start: int, pattern: re.Pattern[bytes]) -> Iterator[tuple[int, int]]:
    """Offsets and opcodes of what looks like a landmark; the next one is near in most files."""
    step = _STEP
    while start < source.size and source.may_search(min(step, source.size - start)):
        window, i = source.read(start, step + _OVERLAP), 0
        while (match := pattern.search(window, i)) and match.start() < step:
            yield start + match.start(), window[match.start()]
            i = match.start() + 1  # the next may begin within this one
        start, step = start + step, min(2 * step, WINDOW)


@dataclass(frozen=True, slots=True)
class Damage:
    """A place where a file does not hold what was written."""

    path: Path  # the file
    # offset, size: where, bytes
    offset: int
    size: int
    what: str  # what is wrong
    # rows per topic that are missing there, as later sequence numbers tell
    lost: Mapping[str, int] = field(default_factory=dict)
    certain: bool = True  # false where rows may be missing and nothing later shows it, as at the torn end of a file

    def __str__(self) -> str:
        rows = ", ".join(f"{count} of {topic}" for topic, count in self.lost.items())
        cost = f"; rows lost: {rows}" if rows else ("" if self.certain else "; rows lost: not known")
        return f"{self.path.name}: {self.size} bytes at {self.offset}: {self.what}{cost}"


_DATA_END = layout.RECORD_HEAD.pack(Opcode.DATA_END, layout.CRC.size)


class Scan:
    """One pass over a file for the chunks of a recording, whose name is empty where it is not known."""

    def __init__(self, source: FileBytes, recording: str) -> None:
        self.clean = False  # whether the file has its end: a summary whose CRC holds
        self.info: PartInfo | None = None  # the last word of the part about itself, so far
        self.counts: dict[str, int] = {}  # rows per topic by the summary
        self._source = source
        self._recording = recording
        self._damaged = False
        self.summary_at: int | None = None  # where the summary begins; None until the end of the data has come
        self._crc, self._crc_end = 0, 0
        self._items: list[RowBlock | Damage] = []  # that are to be given next

    def items(self) -> Iterator[RowBlock | Damage]:
        """Blocks and damages in the order of the file."""
        source = self._source
        at = len(layout.MAGIC)
        if source.read(0, at) != layout.MAGIC:
            self._damage(0, min(at, source.size), "the first bytes are not those of MCAP")
            if source.read(at, 1) != bytes([Opcode.HEADER]):  # nothing says that records begin there
                at = 0
        while at < source.size:
            try:
                after = self._record(at)
            except BrokenRecordError as error:
                after, self.summary_at = next_landmark(source, at + 1, self._is_good)
                self._damage(at, after - at, str(error), certain=False)
            yield from self._items
            self._items, at = [], after
        yield from self._items  # of a file without a byte

    def _damage(self, offset: int, size: int, what: str, certain: bool = True) -> None:
        self._damaged = True
        self._items.append(Damage(self._source.path, offset, size, what, certain=certain))

    def _head(self, at: int) -> tuple[int, int]:
        """Opcode of the record at an offset, and the offset behind it; BrokenRecordError where the file ends before."""
        head = self._source.read(at, layout.RECORD_HEAD.size)
        if len(head) < layout.RECORD_HEAD.size:
            raise BrokenRecordError("the file ends within a record")
        opcode, length = layout.RECORD_HEAD.unpack(head)
        if (after := at + layout.RECORD_HEAD.size + length) > self._source.size:
            raise BrokenRecordError("a record extends beyond the end of the file")
        return opcode, after

    def _record(self, at: int) -> int:
        """Take in what stands at an offset; the offset behind it."""
        if at == self.summary_at:
            return self._summary(at)
        opcode, after = self._head(at)
        if opcode == Opcode.CHUNK:
            return self._block(at)
        if opcode == Opcode.DATA_END:
            self._data_end(at, after)
        elif opcode == Opcode.METADATA:
            self._metadata(at, after)
        elif not (opcode == Opcode.HEADER and at == len(layout.MAGIC)):
            raise BrokenRecordError("this is not a record that the recorder writes here")
        return after

    def _metadata(self, at: int, after: int) -> None:
        """What the part says about itself."""
        info = self.info_at(at)
        if info is not None:
            self.info = info
        elif not self._goes_on(after):
            raise BrokenRecordError("the part's metadata is damaged")
        else:
            self._damage(at, after - at, "the part's metadata is damaged; no row is lost")

    def info_at(self, at: int) -> PartInfo | None:
        """What a part says about itself at an offset; None without a whole word of the wanted recording."""
        with suppress(BrokenRecordError):
            opcode, after = self._head(at)
            body = at + layout.RECORD_HEAD.size
            if opcode == Opcode.METADATA and self._source.may_search(after - body):
                info = PartInfo.parse(self._source.read(body, after - body))
                return info if info and info.recording == (self._recording or info.recording) else None
        return None

    def _goes_on(self, at: int) -> bool:
        """Whether the file ends at an offset, or goes on with a record that can follow."""
        return at == self._source.size or self._source.read(at, 9) == _DATA_END or self._is_good(at)

    def _is_good(self, at: int) -> bool:
        return self.is_chunk(at) or self.info_at(at) is not None

    # --- rows ---------------------------------------------------------------------------------------------------

    def _block(self, at: int) -> int:
        chunk = self.chunk(at)
        self._items.append(chunk)
        if not chunk.times_hold:
            self._damage(at + 9, 16, "the times at a chunk's head are wrong; its rows are whole")
        return self._index(chunk)

    def _index(self, chunk: RowBlock) -> int:
        """Compare the message indexes behind a chunk with what they must be; they have no CRC. Where they end."""
        index = b"".join(layout.index_records(chunk.entries).values())
        there = self._source.read(chunk.after, len(index))
        end = chunk.after + len(there)
        if len(there) < len(index) and index.startswith(there):
            if there:
                self._damage(chunk.after, len(there), "the file ends within a message index; no row is torn")
        elif there != index:
            if not self._goes_on(end):
                return chunk.after
            self._damage(chunk.after, len(there), "a message index is damaged; no row is lost")
        return end

    def is_chunk(self, at: int) -> bool:
        """Whether a chunk that is wanted, and whole, stands at an offset."""
        try:
            return bool(self.chunk(at).rows)
        except BrokenRecordError:
            return False

    def chunk(self, at: int) -> RowBlock:
        """Read a chunk and check it; BrokenRecordError where it is not whole, or not of this recording."""
        opcode, after = self._head(at)
        body = at + layout.RECORD_HEAD.size
        if opcode != Opcode.CHUNK:
            raise BrokenRecordError("this is not a chunk")
        if not self._source.may_search(after - body):
            raise BrokenRecordError("it is not searched any further, because most that looks like a record is not one")
        record = self._source.read(body, min(after - body, PLAIN_BYTES))
        try:
            chunk = records.Chunk.read(layout.stream(record))
        except layout.UNREADABLE as error:
            raise BrokenRecordError("the head of a chunk is damaged") from error
        if chunk.uncompressed_size > PLAIN_BYTES:
            raise BrokenRecordError(f"a chunk claims {chunk.uncompressed_size} bytes, more than is plausible")
        if len(record) != after - body or layout.encode(chunk)[layout.RECORD_HEAD.size :] != record:
            raise BrokenRecordError("the lengths at a chunk's head contradict each other")
        content = inflate(chunk.data, chunk.compression.encode(), chunk.uncompressed_size)
        if zlib.crc32(content) != chunk.uncompressed_crc:
            raise BrokenRecordError("the CRC of a chunk does not match")
        block = parse(content)
        self._require_own(block)
        times = [row[2] for row in block.rows]
        said = chunk.message_start_time, chunk.message_end_time
        return replace(block, offset=at, after=after, times_hold=not times or said == (min(times), max(times)))

    def _require_own(self, block: RowBlock) -> None:
        of = block.channels.values()
        if not block.rows or not block.entries.keys() <= block.channels.keys():
            raise BrokenRecordError("a chunk is not self-contained")
        if len({channel.topic for channel in of}) < len(of):
            raise BrokenRecordError("a chunk has two channels of one topic")
        if self._recording and {channel.recording for channel in of} != {self._recording}:
            raise BrokenRecordError("a chunk belongs to another recording")

    # --- the end ------------------------------------------------------------------------------------------------

    def _data_end(self, at: int, after: int) -> None:
        if after - at != layout.DATA_END_SIZE:
            raise BrokenRecordError("the end of the data cannot be read")
        (crc,) = layout.CRC.unpack(self._source.read(after - layout.CRC.size, layout.CRC.size))
        self.summary_at = at + layout.DATA_END_SIZE
        self._crc = self._source.crc(self._crc_end, at, self._crc)  # of everything before, which only grows
        self._crc_end = at
        if self._crc != crc and not self._damaged:
            self._damage(0, at, "the CRC of all data does not hold, though that of every chunk does")

    def _summary(self, at: int) -> int:
        """Offset behind the end of the file proper, whose summary begins here."""
        candidates = (place for place, _ in _candidates(self._source, at, _ONLY_FOOTER))
        footers = (place for place in candidates if summary_start(self._source, place) == at)
        if (footer := next(footers, None)) is None:
            raise BrokenRecordError("the summary is damaged, or bytes follow the end")
        self.clean = True
        if footer - at <= _SUMMARY_BYTES:
            with suppress(BrokenRecordError):  # its CRC holds, but no recorder wrote that
                summary = parse(self._source.read(at, footer - at))
                self.counts = {channel.topic: summary.counts.get(i, 0) for i, channel in summary.channels.items()}
        return footer + layout.FOOTER_SIZE + len(layout.MAGIC)


_OWN: Final = b"plumbob "


@dataclass(frozen=True, slots=True)
class Identity:
    """Whose file it is."""

    path: Path
    # name of the recording; empty where a file of ours is too damaged to tell; None in files of other programs
    recording: str | None
    info: PartInfo | None = None  # what the part says about itself, at its end or at its beginning


def identify(path: Path) -> Identity:
    """Whose file this is; DecodeError if it cannot be read, or holds no MCAP."""
    with FileBytes(path) as source:
        magic = source.read(0, len(layout.MAGIC))
        if len(magic) < len(layout.MAGIC) and layout.MAGIC.startswith(magic):
            return Identity(path, "")
        scan, (library, end) = Scan(source, ""), _header(source)
        info = scan.info_at(end)
        if info is not None:
            return Identity(path, info.recording, info)
        # ours with a damaged letter or two, or zeros, is still ours
        is_complete = len(library) == len(_OWN) or source.size > len(layout.MAGIC) + 64
        is_other = sum(a in (b, 0) for a, b in zip(library, _OWN, strict=False)) < len(_OWN) - 2
        if magic == layout.MAGIC and library and is_complete and is_other:
            return Identity(path, None)
        at, summary = next_landmark(source, 0, scan.is_chunk)
        recording = None
        if at < source.size and summary is None:  # that of the first whole chunk
            recording = next(iter(scan.chunk(at).channels.values())).recording
        if recording is None and magic != layout.MAGIC:
            raise DecodeError(
                f"{path} is not an MCAP file: it begins with {magic!r}, not with {layout.MAGIC!r}, and holds no "
                "complete chunk of a recording."
            )
        if recording == "":  # chunks of another program, whose header is damaged
            return Identity(path, None)
        scan = Scan(source, recording or "")
        for _ in scan.items():  # to what the part says at its end, where its beginning is damaged
            continue
        return Identity(path, recording or "", scan.info)


def _header(source: FileBytes) -> tuple[bytes, int]:
    """First bytes of the library's name, and the offset behind the header record."""
    at = len(layout.MAGIC)
    head = source.read(at, layout.RECORD_HEAD.size + 8)
    if len(head) < layout.RECORD_HEAD.size + 8:
        return b"", source.size
    opcode, length = layout.RECORD_HEAD.unpack_from(head)
    body = source.read(at + layout.RECORD_HEAD.size, min(length, 1 << 16))
    profile = int.from_bytes(body[:4], "little")
    stated = int.from_bytes(body[profile + 4 : profile + 8], "little")  # a damaged length leaves another one
    valid = (opcode, length, stated) == (Opcode.HEADER, len(body), len(body) - profile - 8)
    return body[profile + 8 : profile + 8 + len(_OWN)] if valid else b"", at + layout.RECORD_HEAD.size + length
