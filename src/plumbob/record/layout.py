"""Bytes of MCAP records, by the MCAP specification, version 0 (https://mcap.dev/spec).

Records that are written ten or more times a second are packed here; the others by the MCAP library.
"""

import struct
import zlib
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from mcap.records import McapRecord

MAGIC: Final = b"\x89MCAP0\r\n"

HEADER: Final = 0x01
FOOTER: Final = 0x02
SCHEMA: Final = 0x03
CHANNEL: Final = 0x04
MESSAGE: Final = 0x05
CHUNK: Final = 0x06
MESSAGE_INDEX: Final = 0x07
CHUNK_INDEX: Final = 0x08
STATISTICS: Final = 0x0B
METADATA: Final = 0x0C
METADATA_INDEX: Final = 0x0D
SUMMARY_OFFSET: Final = 0x0E
DATA_END: Final = 0x0F

RECORD_HEAD: Final = struct.Struct("<BQ")  # opcode, length of what follows
MESSAGE_HEAD: Final = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time
CHUNK_HEAD: Final = struct.Struct("<BQQQQII")  # opcode, length, first, last, plain size, CRC, length of compression
INDEX_HEAD: Final = struct.Struct("<BQHI")  # opcode, length, channel, bytes of entries
FOOTER_BODY: Final = struct.Struct("<QQI")  # start of the summary, start of its offsets, CRC
SIZE: Final = struct.Struct("<Q")
CRC: Final = struct.Struct("<I")

FOOTER_SIZE: Final = RECORD_HEAD.size + FOOTER_BODY.size
DATA_END_SIZE: Final = RECORD_HEAD.size + CRC.size
SEQUENCES: Final = 1 << 32
"""Sequence numbers of messages are 32 bits wide on disk, and start over."""


def encode(record: "McapRecord") -> bytes:
    """Bytes of a record of the MCAP library, with opcode and length."""
    from mcap.data_stream import RecordBuilder

    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


def chunk_record(content: bytes, stored: bytes, compression: str, first: int, last: int) -> bytes:
    """Chunk of `content`, which is `stored` compressed; `first` and `last` are log times, ns."""
    name = compression.encode()
    head = CHUNK_HEAD.pack(
        CHUNK,
        chunk_length(len(name), len(stored)),
        first,
        last,
        len(content),
        zlib.crc32(content),
        len(name),
    )
    return b"".join((head, name, SIZE.pack(len(stored)), stored))


def chunk_length(name: int, stored: int) -> int:
    """Length that a chunk record states: everything after opcode and length."""
    return CHUNK_HEAD.size - RECORD_HEAD.size + name + SIZE.size + stored


def index_records(entries: Mapping[int, Sequence[int]]) -> dict[int, bytes]:
    """Message index record of each channel.

    Parameters
    ----------
    entries : mapping of int to sequence of int
        Per channel, log time and offset in the chunk's content, in turn.
    """
    return {
        channel: INDEX_HEAD.pack(MESSAGE_INDEX, 6 + 8 * len(flat), channel, 8 * len(flat))
        + struct.pack(f"<{len(flat)}Q", *flat)
        for channel, flat in entries.items()
    }
