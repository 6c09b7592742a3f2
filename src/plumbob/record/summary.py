"""End of a part: what it holds and where, so that other programs need not read all of it."""

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field

from plumbob.record import layout
from plumbob.record.chunk import OpenChunk, PackedChunk


@dataclass(slots=True)
class Contents:
    """What has been written to a part so far.

    Attributes
    ----------
    counts : dict of int to int
        Rows per channel.
    ends : dict of int to int
        Per channel, one more than the last sequence number.
    chunk_indexes : bytearray
        Chunk index records.
    infos : list of tuple of int
        Offset and length of each metadata record.
    """

    counts: dict[int, int] = field(default_factory=dict)
    ends: dict[int, int] = field(default_factory=dict)
    chunk_indexes: bytearray = field(default_factory=bytearray)
    infos: list[tuple[int, int]] = field(default_factory=list)
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
    """Everything from the end of the data to the end of the file.

    Parameters
    ----------
    contents : Contents
        What the data section holds.
    channels : mapping of int to (bytes, bytes)
        Schema and channel records of the channels.
    offset : int
        Where the data section ends.
    data_crc : int
        CRC of everything before `offset`.
    """
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
    summary = b"".join(groups.values())
    offsets = _offsets(groups, start)
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


def _offsets(groups: Mapping[int, bytes], at: int) -> bytes:
    from mcap.records import SummaryOffset

    found = bytearray()
    for opcode, group in groups.items():
        if group:
            found += layout.encode(SummaryOffset(group_opcode=opcode, group_start=at, group_length=len(group)))
        at += len(group)
    return bytes(found)
