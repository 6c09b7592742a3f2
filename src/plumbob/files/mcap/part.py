"""One file of a recording while it is written, and the summary that closes it."""

import os
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from plumbob.files.mcap import disk, layout
from plumbob.files.mcap.layout import OpenChunk, PackedChunk, PartInfo


@dataclass(slots=True)
class Contents:
    """What has been written to a part so far."""

    counts: dict[int, int] = field(default_factory=dict)  # rows per channel
    ends: dict[int, int] = field(default_factory=dict)  # per channel, one more than the last sequence number
    chunk_indexes: bytearray = field(default_factory=bytearray)  # chunk index records
    infos: list[tuple[int, int]] = field(default_factory=list)  # offset and length of each metadata record
    chunks: int = 0
    rows: int = 0
    first: int = 1 << 64
    last: int = 0

    def note(self, chunk: OpenChunk, packed: PackedChunk, offset: int) -> None:
        """A chunk stands at `offset`, its message indexes behind it."""
        from mcap.records import ChunkIndex

        at, offsets = offset + len(packed.record), {}
        for channel, record in packed.indexes.items():
            offsets[channel] = at
            at += len(record)
        self.chunk_indexes += layout.encode(
            ChunkIndex(
                chunk_start_offset=offset,
                chunk_length=len(packed.record),
                message_start_time=chunk.first,
                message_end_time=chunk.last,
                message_index_offsets=offsets,
                message_index_length=at - offset - len(packed.record),
                compression=packed.compression,
                compressed_size=packed.stored_size,
                uncompressed_size=packed.plain_size,
            )
        )
        for channel, count in chunk.counts().items():
            self.counts[channel] = self.counts.get(channel, 0) + count
            self.ends[channel] = chunk.lows[channel] + count
        self.chunks += 1
        self.rows += chunk.rows
        self.first, self.last = min(self.first, chunk.first), max(self.last, chunk.last)


def closing(contents: Contents, channels: Mapping[int, tuple[bytes, bytes]], offset: int, data_crc: int) -> bytes:
    """Everything from the end of the data, at `offset`, to the end of the file; `channels` are records by number."""
    from mcap import records

    data_end = layout.encode(records.DataEnd(data_crc))
    start = offset + len(data_end)
    used = [channels[channel] for channel in sorted(contents.counts)]
    groups = {
        layout.SCHEMA: b"".join(schema for schema, _ in used),
        layout.CHANNEL: b"".join(channel for _, channel in used),
        layout.STATISTICS: _statistics(contents, used),
        layout.CHUNK_INDEX: bytes(contents.chunk_indexes),
        layout.METADATA_INDEX: b"".join(
            layout.encode(records.MetadataIndex(offset=at, length=length, name="plumbob"))
            for at, length in contents.infos
        ),
    }
    summary, offsets = b"", b""
    for opcode, group in groups.items():
        at = start + len(summary)
        offset_record = records.SummaryOffset(group_opcode=opcode, group_start=at, group_length=len(group))
        offsets += layout.encode(offset_record) if group else b""
        summary += group
    footer = layout.RECORD_HEAD.pack(layout.FOOTER, layout.FOOTER_BODY.size)
    places = layout.FOOTER_BODY.pack(start, start + len(summary), 0)[:-4]
    checked = summary + offsets + footer + places
    return data_end + checked + layout.CRC.pack(zlib.crc32(checked)) + layout.MAGIC


def _statistics(contents: Contents, used: list[tuple[bytes, bytes]]) -> bytes:
    from mcap.records import Statistics

    return layout.encode(
        Statistics(
            attachment_count=0,
            channel_count=len(used),
            channel_message_counts=dict(sorted(contents.counts.items())),
            chunk_count=contents.chunks,
            message_count=contents.rows,
            message_start_time=contents.first if contents.rows else 0,
            message_end_time=contents.last,
            metadata_count=len(contents.infos),
            schema_count=sum(bool(schema) for schema, _ in used),
        )
    )


LIBRARY = "plumbob recording 1"


class RecordingPart:
    """A file that holds whole chunks only, and says so at its end if it gets there; `create` gives its descriptor."""

    def __init__(self, path: Path, info: PartInfo, create: Callable[[Path], int] = disk.create) -> None:
        self.path = path
        self.info = info
        self._create = create
        self.contents = Contents()
        self.size = 0
        self._fd = -1
        self._crc = 0
        self._synced = (0, 0)  # size, rows

    def begin(self) -> None:
        """Create the file and write its beginning; leave none behind where the system refuses (OSError)."""
        from mcap.records import Header

        self._fd = self._create(self.path)
        header = layout.MAGIC + layout.encode(Header(profile="", library=LIBRARY))
        try:
            self._append(header)
            self._append_info(self.info)
            self.sync()
        except OSError:
            self.close(keep=False)
            raise

    def write(self, chunk: OpenChunk, packed: PackedChunk) -> None:
        """Append a chunk and its message indexes; on OSError the file ends as before."""
        offset = self.size
        self._append(packed.record + b"".join(packed.indexes.values()))
        self.contents.note(chunk, packed, offset)

    def finish(
        self, channels: Mapping[int, tuple[bytes, bytes]], ends: dict[str, int], dropped: dict[str, int]
    ) -> None:
        """Write what was said first once more, the index, the footer; on OSError it ends with its whole chunks."""
        size, crc = self.size, self._crc
        try:
            self._append_info(replace(self.info, ends=ends, dropped=dropped))
            self._append(closing(self.contents, channels, self.size, self._crc))
        except OSError:
            self.size, self._crc = size, crc
            self._cut()
            raise

    def sync(self) -> None:
        """Wait until the disk has everything; raises OSError if it does not take it."""
        disk.sync(self._fd)
        self._synced = (self.size, self.contents.rows)

    def cut_to_synced(self) -> None:
        """Leave in the file only what the disk has confirmed."""
        self.size, self.contents.rows = self._synced
        self._cut()

    def close(self, keep: bool) -> None:
        """Close the file, and remove it unless it is to be kept."""
        os.close(self._fd)
        self._fd = -1
        if not keep:
            self.path.unlink(missing_ok=True)

    def _append_info(self, info: PartInfo) -> None:
        record = info.record()
        offset = self.size
        self._append(record)
        self.contents.infos.append((offset, len(record)))

    def _append(self, data: bytes) -> None:
        try:
            disk.write_all(self._fd, data, self.size)
        except OSError:
            self._cut()
            raise
        self.size += len(data)
        self._crc = zlib.crc32(data, self._crc)

    def _cut(self) -> None:
        try:
            os.ftruncate(self._fd, self.size)
        except OSError:  # a disk that refuses this too keeps a torn end, which the reader knows how to leave out
            return
