"""From messages to a chunk: rows are gathered by the caller and packed by the writing thread."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from plumbob.files.mcap import layout

CHUNK_BYTES: Final = 1 << 20
"""A chunk is closed at this size, however short its time."""
MESSAGE_BYTES: Final = 8 << 20
"""Largest message that is taken."""
PLAIN_BYTES: Final = CHUNK_BYTES + MESSAGE_BYTES + (1 << 20)
"""No chunk of ours is larger than this before compression."""
ZSTD_LEVEL: Final = 3

Compress = Callable[[bytes], bytes]


@dataclass(slots=True)
class OpenChunk:
    """Rows gathered until they are due; self-contained, since it repeats the schemas and channels that it uses.

    Attributes
    ----------
    t_ns : int
        Time at which it was opened, ns.
    """

    t_ns: int
    pieces: list[bytes] = field(default_factory=list)
    size: int = 0
    rows: int = 0
    entries: dict[int, list[int]] = field(default_factory=dict)
    lows: dict[int, int] = field(default_factory=dict)

    def introduce(self, channel: int, sequence: int, records: tuple[bytes, bytes]) -> None:
        """Take in the schema and channel records of a channel, whose first row here has that sequence number."""
        self.entries[channel] = []
        self.lows[channel] = sequence
        self.pieces.extend(records)
        self.size += len(records[0]) + len(records[1])

    def add(self, channel: int, sequence: int, log_time: int, data: bytes) -> None:
        """Take in a row of a channel that has been introduced."""
        head = layout.MESSAGE_HEAD.pack(
            layout.MESSAGE, 22 + len(data), channel, sequence % layout.SEQUENCES, log_time, log_time
        )
        self.pieces += (head, data)
        self.entries[channel] += (log_time, self.size)
        self.size += 31 + len(data)
        self.rows += 1

    @property
    def first(self) -> int:
        """Earliest log time, ns."""
        return min(min(flat[::2]) for flat in self.entries.values())

    @property
    def last(self) -> int:
        """Latest log time, ns."""
        return max(max(flat[::2]) for flat in self.entries.values())

    def counts(self) -> dict[int, int]:
        """Rows per channel."""
        return {channel: len(flat) // 2 for channel, flat in self.entries.items()}


@dataclass(frozen=True, slots=True)
class PackedChunk:
    """A chunk as it goes to disk.

    Attributes
    ----------
    record : bytes
        The chunk record.
    indexes : dict of int to bytes
        Message index record of each channel, which follow it.
    """

    record: bytes
    indexes: dict[int, bytes]
    plain_size: int
    stored_size: int
    compression: str


def pack(chunk: OpenChunk, compression: str, compress: Compress) -> PackedChunk:
    """Join, check-sum and compress a chunk."""
    content = b"".join(chunk.pieces)
    stored = compress(content)
    record = layout.chunk_record(content, stored, compression, chunk.first, chunk.last)
    return PackedChunk(record, layout.index_records(chunk.entries), len(content), len(stored), compression)


def compressor(name: str) -> tuple[str, Compress]:
    """Name of a compression in MCAP, and the function that does it.

    A zstd frame carries a checksum of its own: a chunk that is damaged passes two.
    """
    if name == "none":
        return "", _as_is
    from zstandard import ZstdCompressor

    return "zstd", ZstdCompressor(level=ZSTD_LEVEL, write_checksum=True).compress


def _as_is(content: bytes) -> bytes:
    return content
