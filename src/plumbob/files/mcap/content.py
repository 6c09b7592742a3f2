"""From a chunk's bytes to its rows, believing nothing that has not been checked."""

import struct
from dataclasses import dataclass, field
from typing import Final

from plumbob.files.mcap import layout
from plumbob.files.mcap.layout import Channel, Schema, parse_schema

FOREIGN_BYTES: Final = 256 << 20  # larger chunks of other programs are not inflated
FREE_BYTES: Final = 16 << 20
MAX_RATIO: Final = 16
"""A chunk of another program may state `FREE_BYTES` and this many times its size; short rows take ten times that."""
_KEPT_BYTES: Final = 64 << 20  # schemas and channels that are kept of one file, in bytes
_STEP: Final = 1 << 20
_KINDS: Final = 4096

Row = tuple[int, int, int, bytes]  # channel number, sequence as on disk, log time in ns, data


class BrokenRecordError(ValueError):
    """A record is damaged; only the reader sees it, and makes a finding of it."""


@dataclass(slots=True)
class Content:
    """What a chunk holds, or a stretch of records outside chunks."""

    channels: dict[int, Channel] = field(default_factory=dict)  # that it declares
    rows: list[Row] = field(default_factory=list)  # messages, in order
    # the message index: per channel, log time and offset of its messages in turn
    entries: dict[int, list[int]] = field(default_factory=dict)


class RecordParser:
    """Parses stretches of records; a channel that is declared again and again is decoded once."""

    def __init__(self) -> None:
        self._known: dict[tuple[bytes, bytes], Channel] = {}
        self._kept = 0

    def parse(self, content: bytes, schemas: dict[int, bytes] | None = None) -> Content:
        """Schemas, channels and messages of whole records; others are passed over.

        `schemas` are bodies of schema records known from elsewhere, which grow. BrokenRecordError if a record reaches
        beyond the end, or cannot be read.
        """
        stay = schemas is not None
        parsed, schemas, at, end = Content(), {} if schemas is None else schemas, 0, len(content)
        head, message = layout.RECORD_HEAD.unpack_from, layout.MESSAGE_HEAD.unpack_from
        try:
            while at < end:
                opcode, length = head(content, at)
                after = at + 9 + length
                if after > end:
                    raise BrokenRecordError("a record in it extends beyond its end")
                if opcode == layout.MESSAGE:
                    if length < 22:
                        raise BrokenRecordError("a message in it is too short")
                    _, _, channel, sequence, log_time, _ = message(content, at)
                    parsed.rows.append((channel, sequence, log_time, content[at + 31 : after]))
                    parsed.entries.setdefault(channel, []).extend((log_time, at))
                elif opcode == layout.SCHEMA:
                    number, body = _number(content, at), content[at + 9 : after]
                    if stay and schemas.get(number) != body:
                        self._keep(len(body))
                    schemas[number] = body
                elif opcode == layout.CHANNEL:
                    parsed.channels[_number(content, at)] = self._channel(content[at + 9 : after], schemas)
                at = after
        except struct.error as error:
            raise BrokenRecordError("a record in it is cut off") from error
        return parsed

    def _keep(self, size: int) -> None:
        self._kept += size
        if self._kept > _KEPT_BYTES:
            raise BrokenRecordError(f"the schemas and channels before it have more than {_KEPT_BYTES >> 20} MiB")

    def _channel(self, body: bytes, schemas: dict[int, bytes]) -> Channel:
        from mcap.exceptions import McapError

        schema = schemas.get(int.from_bytes(body[2:4], "little"), b"")
        channel = self._known.get((schema, body))
        if channel is None:
            self._keep(len(schema) + len(body))
            try:
                channel = Channel.parse(body, _schema(schema))
            except (McapError, ValueError, struct.error) as error:
                raise BrokenRecordError("a channel in it cannot be read") from error
            if len(self._known) >= _KINDS:
                self._known.clear()
            self._known[schema, body] = channel
        return channel


def _schema(body: bytes) -> Schema | None:
    return parse_schema(body) if body else None


def _number(content: bytes, at: int) -> int:
    return int.from_bytes(content[at + 9 : at + 11], "little")


def inflate(stored: bytes, compression: bytes, size: int) -> bytes:
    """Content of a chunk; BrokenRecordError unless it is `size` bytes, and never more is unpacked."""
    if compression == b"":
        content = stored
    elif compression == b"zstd":
        content = _inflate_zstd(stored, size)
    elif compression == b"lz4":
        content = _inflate_lz4(stored, size)
    else:
        raise BrokenRecordError(f"the compression {compression!r} is not known")
    if len(content) != size:
        raise BrokenRecordError(f"the chunk does not inflate to the {size} bytes that it states")
    return content


def _inflate_zstd(stored: bytes, size: int) -> bytes:
    from zstandard import ZstdDecompressor, ZstdError

    pieces = []
    try:
        with ZstdDecompressor(max_window_size=1 << 27).stream_reader(stored, read_across_frames=True) as reader:
            while size >= 0 and (piece := reader.read(min(size + 1, _STEP))):
                pieces.append(piece)
                size -= len(piece)
    except (ZstdError, MemoryError) as error:
        raise BrokenRecordError("the chunk cannot be decompressed") from error
    return b"".join(pieces)


def _inflate_lz4(stored: bytes, size: int) -> bytes:
    from lz4.frame import LZ4FrameDecompressor

    pieces, reader, rest = [], LZ4FrameDecompressor(), stored
    try:
        while size >= 0 and not reader.eof and (piece := reader.decompress(rest, min(size + 1, _STEP))):
            pieces.append(piece)
            size -= len(piece)
            rest = b""
    except (RuntimeError, EOFError, MemoryError) as error:
        raise BrokenRecordError("the chunk cannot be decompressed") from error
    return b"".join(pieces)
