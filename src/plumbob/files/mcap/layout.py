"""MCAP as this project writes it: records, names of parts, channels, chunks (https://mcap.dev/spec).

Records that are written ten or more times a second are packed here; the others by the MCAP library. Each part says
about itself, with a CRC, at its beginning and once more at its end, what it is.
"""

import json
import re
import struct
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple, Self

from mcap import records
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import McapError
from mcap.opcode import Opcode

from plumbob.core.errors import ParameterError

MAGIC: Final = b"\x89MCAP0\r\n"
RECORD_HEAD: Final = struct.Struct("<BQ")  # opcode, length of what follows
MESSAGE_HEAD: Final = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time
INDEX_HEAD: Final = struct.Struct("<BQHI")  # opcode, length, channel, bytes of entries
FOOTER_BODY: Final = struct.Struct("<QQI")  # start of the summary, start of its offsets, CRC
CRC: Final = struct.Struct("<I")
FOOTER_SIZE: Final = RECORD_HEAD.size + FOOTER_BODY.size
DATA_END_SIZE: Final = RECORD_HEAD.size + CRC.size
TIMES: Final = 1 << 64  # so many ns can a time be
SEQUENCES: Final = 1 << 32  # sequence numbers of messages are 32 bits wide on disk, and start over


def encode(record: records.McapRecord) -> bytes:
    """Bytes of a record of the MCAP library, with opcode and length."""
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


def index_records(entries: Mapping[int, Sequence[int]]) -> dict[int, bytes]:
    """Message index record of each channel, of log times and offsets in the chunk's content, in turn."""
    return {
        channel: INDEX_HEAD.pack(Opcode.MESSAGE_INDEX, 6 + 8 * len(flat), channel, 8 * len(flat))
        + struct.pack(f"<{len(flat)}Q", *flat)
        for channel, flat in entries.items()
    }


SUFFIX: Final = ".mcap"
UTC_FIELD: Final = "{utc}"  # what a name may hold for the time of the start


def dated(path: str, utc_ns: int) -> str:
    """Name with ``{utc}`` as 20260314T150926Z, which sorts by time and every file system takes."""
    for place in re.findall(r"\{[^{}]*\}", path):
        if place != UTC_FIELD:
            raise ParameterError(f"{path}: a name can hold {UTC_FIELD} for the time of the start, but not {place}.")
    return path.replace(UTC_FIELD, f"{datetime.fromtimestamp(utc_ns // 10**9, UTC):%Y%m%dT%H%M%SZ}")


def next_path(path: Path) -> Path:
    """The name itself where nothing has it, else the name of the next part."""
    parts = existing_parts(path)
    return part_path(path, part_number(path, parts[-1]) + 1) if parts else path


def part_number(path: Path, part: Path) -> int:
    """Number of a part that `existing_parts` found."""
    return 1 if part.name == path.name else int(part.stem.rpartition(".")[2])


def part_path(path: Path, part: int) -> Path:
    """Path of a part; the first has the name of the recording."""
    return path if part == 1 else path.with_name(f"{path.stem}.{part:04d}{path.suffix}")


def existing_parts(path: Path) -> list[Path]:
    """Parts of a recording that are there, in order of their numbers."""
    if not path.parent.is_dir():
        return []
    pattern = re.compile(rf"{re.escape(path.stem)}\.(\d{{4,}}){re.escape(path.suffix)}")
    files = {1: path} if path.exists() else {}
    for other in path.parent.iterdir():
        if (match := pattern.fullmatch(other.name)) and int(match[1]) > 1:
            files[int(match[1])] = other
    return [files[part] for part in sorted(files)]


def is_further_part(path: Path) -> bool:
    """Whether a file is a later part of a recording whose first part lies beside it."""
    first = re.fullmatch(r"(.+)\.\d{4,}", path.stem)
    return first is not None and path.with_name(f"{first[1]}{path.suffix}").is_file()


State = Literal["new", "recording", "stopped", "closed"]


@dataclass(frozen=True, slots=True)
class Rules:
    """How a recording is written; see `Recorder`, whose units these are."""

    path: Path
    rotate: float | None
    rotate_bytes: int | None
    reserve: int
    fsync: float | None
    compression: str


RECORDING_KEY: Final = "plumbob.recording"
OFFSET_KEY: Final = "plumbob.epoch_offset_ns"


@dataclass(frozen=True, slots=True)
class Schema:
    """What the messages of a channel hold."""

    name: str  # of the type
    encoding: str  # language of the schema, such as ``"jsonschema"``
    data: bytes  # the schema itself


@dataclass(frozen=True, slots=True)
class Channel:
    """A channel as it stands in a file."""

    topic: str  # name, unique in the recording
    encoding: str  # encoding of the messages, such as ``"json"``
    schema: Schema | None = None  # what the messages hold
    metadata: Mapping[str, str] = field(default_factory=dict)  # what else the channel's owner said
    recording: str = ""  # the recording it belongs to; empty in a file that Plumbob has not written
    epoch_offset_ns: int = 0  # what was added to the monotonic clock to get the times in the file, ns

    def declared(self, number: int) -> "ChannelRecords":
        """The channel as it is declared under a number, which is that of its schema, too."""
        schema, of = b"", self.schema
        if of is not None:
            schema = encode(records.Schema(id=number, name=of.name, encoding=of.encoding, data=bytes(of.data)))
        origin = {RECORDING_KEY: self.recording, OFFSET_KEY: str(self.epoch_offset_ns)}
        channel = records.Channel(
            id=number,
            topic=self.topic,
            message_encoding=self.encoding,
            metadata={**self.metadata, **origin},
            schema_id=number if of is not None else 0,
        )
        return ChannelRecords(number, self.topic, (schema, encode(channel)))

    @classmethod
    def parse(cls, body: bytes, schema: bytes) -> Self:
        """Channel from the bodies of its record and its schema's, empty without one; raises `UNREADABLE`."""
        record = records.Channel.read(stream(body))
        of = records.Schema.read(stream(schema)) if schema else None
        metadata = dict(record.metadata)
        return cls(
            topic=record.topic,
            encoding=record.message_encoding,
            schema=None if of is None else Schema(of.name, of.encoding, of.data),
            recording=metadata.pop(RECORDING_KEY, ""),
            epoch_offset_ns=int(metadata.pop(OFFSET_KEY, "0")),
            metadata=metadata,
        )


class ChannelRecords(NamedTuple):
    """A channel as chunks and the end of a file repeat it."""

    number: int
    topic: str
    records: tuple[bytes, bytes]  # of its schema, empty without one, and its own


UNREADABLE: Final = (McapError, ValueError, struct.error, OverflowError, MemoryError)
"""Errors of the MCAP library at the body of a record that is damaged; the last two where it states what no file has."""


def stream(body: bytes) -> ReadDataStream:
    """The body of a record as the MCAP library reads it."""
    return ReadDataStream(BytesIO(body))


CHUNK_BYTES: Final = 1 << 20  # A chunk is closed at this size, however short its time
MESSAGE_BYTES: Final = 8 << 20  # largest message that is taken
PLAIN_BYTES: Final = CHUNK_BYTES + MESSAGE_BYTES + (1 << 20)  # no chunk of ours is larger than this before compression


@dataclass(slots=True)
class OpenChunk:
    """Rows gathered until they are due; self-contained, since it repeats the schemas and channels that it uses."""

    t_ns: int  # when it was opened, ns
    pieces: list[bytes] = field(default_factory=list)
    size: int = 0
    rows: int = 0
    channels: dict[int, ChannelRecords] = field(default_factory=dict)
    entries: dict[int, list[int]] = field(default_factory=dict)  # per channel, log time and offset of each row in turn
    starts: dict[str, int] = field(default_factory=dict)  # per topic, the sequence number of its first row

    def is_due(self, t_ns: int, longest_ns: int) -> bool:
        """Whether it is to be written before a row of this time comes."""
        return abs(t_ns - self.t_ns) >= longest_ns or self.size >= CHUNK_BYTES

    def add(self, channel: ChannelRecords, sequence: int, log_time: int, data: bytes) -> None:
        """Take in a row; the first of a channel brings its schema and channel records."""
        number = channel.number
        if number not in self.channels:
            self.channels[number], self.starts[channel.topic], self.entries[number] = channel, sequence, []
            self.pieces += channel.records
            self.size += sum(map(len, channel.records))
        head = MESSAGE_HEAD.pack(Opcode.MESSAGE, 22 + len(data), number, sequence % SEQUENCES, log_time, log_time)
        self.pieces += (head, data)
        self.entries[number] += (log_time, self.size)
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

    def counts(self) -> dict[str, int]:
        """Rows per topic."""
        return {channel.topic: len(self.entries[number]) // 2 for number, channel in self.channels.items()}

    def ends(self) -> dict[str, int]:
        """Per topic, one more than the last sequence number."""
        return {topic: self.starts[topic] + count for topic, count in self.counts().items()}


NAME: Final = "plumbob"  # name of the metadata record
RESERVED: Final = "plumbob."  # keys that begin so are not the user's


@dataclass(frozen=True, slots=True)
class PartInfo:
    """What a part says about itself."""

    recording: str  # random name of the recording, the same in all its parts and chunks
    part: int  # which part this is, from 1
    epoch_offset_ns: int  # what was added to the monotonic clock to get the times in the file, ns
    # per topic, sequence number of the first row that this part can hold; 0 where a topic is not named
    starts: Mapping[str, int] = field(default_factory=dict)
    # per topic, one more than the last sequence number in this part; None in the record at the beginning
    ends: Mapping[str, int] | None = None
    # per topic, rows that the recorder itself gave up while it wrote this part
    dropped: Mapping[str, int] = field(default_factory=dict)
    metadata: Mapping[str, str] = field(default_factory=dict)  # what the recording's owner says of the whole recording
    # name of the recording that this one goes on from, after a restart; None where it stands alone
    follows: str | None = None
    # which start of the host this was, whose monotonic clock counts from it; empty where that is not known
    boot: str = ""

    def record(self) -> bytes:
        """Bytes of the metadata record."""
        fields = {key: getattr(self, key) for key in _FIELDS}
        said = {key: value for key, value in fields.items() if key not in _LATER or value != _LATER[key]}
        texts = {RESERVED + key: v if isinstance(v, str) else json.dumps(v, sort_keys=True) for key, v in said.items()}
        entries = {**self.metadata, **texts}
        return encode(records.Metadata(NAME, {**entries, f"{RESERVED}crc32": _checksum(entries)}))

    @classmethod
    def parse(cls, body: bytes) -> Self | None:
        """Info from the body of a metadata record; None if it is another's record or its CRC does not hold."""
        try:
            record = records.Metadata.read(stream(body))
            entries = dict(record.metadata)
            if record.name != NAME or entries.pop(f"{RESERVED}crc32", None) != _checksum(entries):
                return None
            texts = {key: entries.pop(RESERVED + key) for key in _FIELDS if RESERVED + key in entries}
            fields = {key: _FIELDS[key](text) for key, text in texts.items()}
        except (*UNREADABLE, RecursionError):
            return None
        return None if _FIELDS.keys() - _LATER - fields.keys() else cls(**fields, metadata=entries)


def _numbers(text: str) -> Any:
    """Numbers by name."""
    numbers = json.loads(text)
    if not isinstance(numbers, dict) or not all(type(value) is int and value >= 0 for value in numbers.values()):
        raise ValueError
    return numbers


_FIELDS: Final[dict[str, Callable[[str], Any]]] = {
    "recording": str, "part": int, "epoch_offset_ns": int, "starts": _numbers,
    "ends": lambda text: None if text == "null" else _numbers(text), "dropped": _numbers, "follows": str, "boot": str,
}  # fmt: skip
"""Fields of `PartInfo` besides the user's metadata, with what reads the text of each."""
_LATER: Final = {"follows": None, "boot": ""}  # which are left out where they have these values


def _checksum(entries: Mapping[str, str]) -> str:
    # Keys are sorted, since a program that copies the record may order them anew.
    return f"{zlib.crc32(json.dumps(sorted(entries.items())).encode()):08x}"
