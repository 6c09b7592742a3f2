"""What lies in the bags of ROS: topics, and the messages of the types that `ros` knows; ROS itself is not needed.

Containers: ROS 1 bags in their version 2.0 (https://wiki.ros.org/Bags/Format/2.0), MCAP (https://mcap.dev/spec), and
the SQLite tables of rosbag2; a folder of rosbag2 holds one or more of the last two. Messages: the serialisation of
ROS 1, which has no padding, and CDR (OMG DDSI-RTPS 2.3, 10), where a number lies at a multiple of its own size behind
the four bytes of the encapsulation. Index and summary are not needed, so what comes before a cut is read.
"""

import os
import re
import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple

import numpy as np
from mcap import records
from mcap.exceptions import EndOfFile
from mcap.stream_reader import StreamReader, breakup_chunk
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, one_line
from plumbob.core.files import MAX_TEXT, require_room
from plumbob.core.findings import Finding, Note, warning
from plumbob.core.text import counted
from plumbob.files.arrow import intact
from plumbob.files.known_logs import KNOWN_TABLES
from plumbob.files.mcap import layout
from plumbob.files.mcap.scan import BrokenRecordError, inflate

BAG: Final = b"#ROSBAG V"
SQLITE: Final = b"SQLite format 3\x00"
METADATA: Final = "metadata.yaml"
_ZSTD: Final = b"\x28\xb5\x2f\xfd"
_DATA, _BAG_HEADER, _CHUNK, _CONNECTION = 2, 3, 5, 7
_HEAD: Final = 1 << 20  # bytes that a record's own header may have


NUMBERS: Final[Mapping[str, int]] = KNOWN_TABLES["ros_numbers"]
_CHILDREN: Final = ("geometry_msgs/TransformStamped", "nav_msgs/Odometry")  # name a second frame before them


@dataclass(slots=True, eq=False)
class Topic:
    """A topic of one type, and what it said."""

    # name, kind: its name, and its type as in ``sensor_msgs/Imu``
    name: str
    kind: str
    encoding: str  # ``cdr`` or ``ros1``
    count: int = 0  # messages, read or not
    logged: list[int] = field(default_factory=list)  # when the recorder took each, ns
    messages: list[bytes] = field(default_factory=list)  # those of a type in `NUMBERS`

    def __str__(self) -> str:
        return f"{self.name} ({self.kind}, {self.count})"

    def take(self, log_ns: int, data: bytes) -> None:
        """Count a message, and keep it where its type is known."""
        self.count += 1
        if self.kind in NUMBERS:
            self.logged.append(log_ns)
            self.messages.append(data)


class MessageTable(NamedTuple):
    """Messages of a topic as arrays."""

    t_ns: NDArray[np.int64]  # when each was measured, or when the recorder took it where no stamp is set (N,)
    notes: list[Note]  # whether that is so
    numbers: Floats  # (N, K)
    frames: tuple[str, ...]  # names of all that are named


@dataclass(slots=True)
class Bag:
    """Topics of a bag, and what of it could not be read."""

    topics: dict[tuple[str, str], Topic] = field(default_factory=dict)
    damage: list[Finding] = field(default_factory=list)
    stored: int = 0
    unpacked: int = 0

    def topic(self, name: str, kind: str, encoding: str) -> Topic:
        """Topic of that name and type."""
        kind = kind.replace("/msg/", "/")
        if encoding not in {"cdr", "ros1"}:
            kind = f"{kind or 'no type'} as {encoding or 'no encoding'}"
        return self.topics.setdefault((name, kind), Topic(name, kind, encoding))

    def room(self, size: int) -> None:
        """Refuse what the file is about to unpack to, where that is too much for its size."""
        require_room(self.unpacked + size, self.stored)
        self.unpacked += size

    def cut(self, what: str, at: int) -> None:
        """Note the end of a file in the middle of something."""
        self.damage.append(warning("reading.cut_within", what=what, byte=at))


def open_bag(path: Path) -> Bag:
    """Topics and messages of a file or a folder; DecodeError if it is damaged other than by a cut, or too large."""
    bag = Bag()
    if path.is_dir():
        for file in _parts(path):
            _open_file(file, bag)
    else:
        _open_file(path, bag)
    return bag


def _parts(folder: Path) -> list[Path]:
    """Files of a rosbag2 folder that hold messages; each that its metadata name must be there."""
    metadata = folder / METADATA
    if not metadata.is_file() or metadata.stat().st_size > MAX_TEXT:
        raise DecodeError(f"it needs a {METADATA} of at most {MAX_TEXT} bytes; 'ros2 bag reindex' writes one.")
    text = metadata.read_bytes().decode("utf-8", "replace")
    named = re.findall(
        r"^\s*-\s+[\"']?(?:[^\n\"']*/)?([^\n/\"']+\.(?:db3|mcap)(?:\.zstd)?)[\"']?\s*$", text, re.MULTILINE
    )
    if not named:
        raise DecodeError(f"its {METADATA} names no .db3 or .mcap; other storages are not read.")
    parts = [folder / name for name in dict.fromkeys(named)]
    if missing := [part.name for part in parts if not part.is_file()]:
        raise DecodeError(f"its {METADATA} names {missing[0]}, which is not there; copy the whole folder.")
    return parts


def _open_file(path: Path, bag: Bag) -> None:
    bag.stored += path.stat().st_size
    with path.open("rb") as stream:
        is_packed = stream.read(len(_ZSTD)) == _ZSTD
        stream.seek(0)
        content = _zstd(stream, "a file", bag) if is_packed else None
        file, size = (stream, path.stat().st_size) if content is None else (BytesIO(content), len(content))
        start = file.read(len(SQLITE))
        file.seek(0)
        if start.startswith(SQLITE):
            _sqlite(path, bag, content)
        elif start.startswith(layout.MAGIC):
            _mcap(file, size, bag)
        elif start.startswith(BAG):
            _bag(file, size, bag)
        else:
            raise DecodeError(f"{path.name} begins with {start[:8]!r}, as neither a ROS bag, MCAP nor SQLite does.")


def _zstd(stream: BinaryIO, what: str, bag: Bag) -> bytes:
    """Content of what rosbag2 compressed; no more than is allowed for the size of the file."""
    import zstandard

    pieces = []
    unpacker = zstandard.ZstdDecompressor().stream_reader(stream, read_across_frames=True)
    with intact(f"{what} that is compressed with zstd"), unpacker as reader:
        while piece := reader.read(1 << 20):
            bag.room(len(piece))
            pieces.append(piece)
    return b"".join(pieces)


def _unpacked(data: bytes, how: str, size: int, bag: Bag) -> bytes:
    """Content of a chunk of ROS 1, which has `size` bytes by its own word, and by no more memory than that."""
    bag.room(size)
    try:
        return inflate(data, b"" if how == "none" else how.encode(), size)
    except BrokenRecordError as error:
        raise DecodeError(f"a chunk that is compressed with {how[:20]} is damaged: {error}.") from error


def _bag(file: BinaryIO, size: int, bag: Bag) -> None:
    """ROS 1: chunks, in which connections and messages lie."""
    if (version := file.readline(32)) != b"#ROSBAG V2.0\n":
        raise DecodeError(f"it is a ROS bag of {version[1:-1].decode('ascii', 'replace')}, but V2.0 is read.")
    connections: dict[int, Topic] = {}
    for operation, head, data in _bag_records(file, size, bag):
        if operation == _CHUNK:
            plain = _unpacked(data, _text(head, b"compression"), _number(head, b"size", "<I"), bag)
            for inner, inner_head, body in _bag_records(BytesIO(plain), len(plain), None):
                _bag_record(inner, inner_head, body, connections, bag)
        elif operation == _BAG_HEADER and head.get(b"encryptor"):
            raise DecodeError("it is encrypted; decrypt it first, with the plugin that wrote it.")
        else:
            _bag_record(operation, head, data, connections, bag)


def _bag_record(operation: int, head: dict[bytes, bytes], data: bytes, topics: dict[int, Topic], bag: Bag) -> None:
    if operation == _CONNECTION:
        about = _fields(data)
        topics[_number(head, b"conn", "<I")] = bag.topic(_text(head, b"topic"), _text(about, b"type"), "ros1")
    elif operation == _DATA:
        number = _number(head, b"conn", "<I")
        if number not in topics:
            raise DecodeError(f"a message belongs to the connection {number}, which is not declared; it is damaged.")
        seconds, rest = divmod(_number(head, b"time", "<Q"), 1 << 32)[::-1]
        topics[number].take(seconds * 10**9 + rest, data)


def _bag_records(file: BinaryIO, size: int, bag: Bag | None) -> Iterator[tuple[int, dict[bytes, bytes], bytes]]:
    """Operation, header and data of each record; data that nobody needs are empty."""
    at = file.tell()
    while at < size:
        start, length = at, int.from_bytes(file.read(4), "little")
        if size - at < 4 or length > min(size - file.tell(), _HEAD):
            break
        head = _fields(file.read(length))
        operation, rest = _number(head, b"op", "<B"), size - file.tell()
        length = int.from_bytes(file.read(4), "little")
        if rest < 4 or length > rest - 4:
            break
        if operation in {_CHUNK, _CONNECTION, _DATA}:
            yield operation, head, file.read(length)
        else:
            yield operation, head, b""
            file.seek(length, os.SEEK_CUR)
        at = file.tell()
    else:
        return
    if bag is None:
        raise DecodeError("a record of a chunk extends beyond its end; it is damaged.")
    bag.cut("the file ends within a record", start)


def _fields(head: bytes) -> dict[bytes, bytes]:
    """Fields of a header in ROS 1: each a length, and 'name=value'."""
    fields, at = dict[bytes, bytes](), 0
    while at < len(head):
        (length,) = struct.unpack_from("<I", head, at) if len(head) - at >= 4 else (len(head),)
        name, equals, value = head[at + 4 : at + 4 + length].partition(b"=")
        if not equals or length > len(head) - at - 4:
            raise DecodeError("a header of a record has a field that is not 'name=value'; it is damaged.")
        fields[name] = value
        at += 4 + length
    return fields


def _number(head: dict[bytes, bytes], name: bytes, form: str) -> int:
    value = head.get(name, b"")
    if len(value) != struct.calcsize(form):
        raise DecodeError(f"a header of a record has no valid '{name.decode()}'; it is damaged.")
    return int(struct.unpack(form, value)[0])


def _text(head: dict[bytes, bytes], name: bytes) -> str:
    if name not in head:
        raise DecodeError(f"a header of a record has no '{name.decode()}'; it is damaged.")
    return head[name].decode("utf-8", "replace")


def _mcap(file: BinaryIO, size: int, bag: Bag) -> None:
    """MCAP by the format's own library: chunk by chunk, without those that are damaged, up to a cut."""
    schemas, topics, orphans = dict[int, str](), dict[int, Topic](), 0
    try:
        for record in StreamReader(file, emit_chunks=True, record_size_limit=size).records:
            if isinstance(record, records.DataEnd | records.Footer):
                break
            try:
                of_chunk = _chunk_records(record, bag) if isinstance(record, records.Chunk) else [record]
            except layout.UNREADABLE as error:
                why = one_line(error).rstrip(".")
                bag.damage.append(warning("reading.damaged_chunk", byte=file.tell(), error=why))
                continue
            for item in of_chunk:
                if isinstance(item, records.Schema):
                    schemas[item.id] = item.name
                elif isinstance(item, records.Channel):
                    name = schemas.get(item.schema_id, "")
                    topics[item.id] = bag.topic(item.topic, name, item.message_encoding)
                elif isinstance(item, records.Message) and item.channel_id in topics:
                    topics[item.channel_id].take(min(item.log_time, (1 << 63) - 1), item.data)
                else:
                    orphans += isinstance(item, records.Message)
    except layout.UNREADABLE as error:
        how = "the file ends within a record" if isinstance(error, EndOfFile) else f"it is damaged ({one_line(error)})"
        bag.cut(how, file.tell())
    if orphans:
        bag.damage.append(warning("reading.orphan_messages", count=orphans))


def _chunk_records(chunk: records.Chunk, bag: Bag) -> "list[records.McapRecord]":
    """Records of a chunk, which unpacks to what it states and has no other CRC."""
    bag.room(chunk.uncompressed_size)
    plain = inflate(chunk.data, chunk.compression.encode(), chunk.uncompressed_size)
    return breakup_chunk(replace(chunk, compression="", data=plain), validate_crc=True)


def _sqlite(path: Path, bag: Bag, content: bytes | None) -> None:
    """SQLite tables of rosbag2: nothing in the file is run, and nothing beside it is opened or written."""
    import sqlite3
    from contextlib import closing
    from urllib.parse import quote

    source = f"file:{quote(str(path.absolute()))}?mode=ro&immutable=1" if content is None else ":memory:"
    if path.with_name(f"{path.name}-wal").exists():
        bag.damage.append(warning("reading.bag_open", file=path.name))
    with intact("its SQLite database"), closing(sqlite3.connect(source, uri=content is None)) as tables:
        if content is not None:
            tables.deserialize(content)
        tables.execute("PRAGMA trusted_schema = OFF")
        tables.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, max(_HEAD, 64 << 20))
        _query_messages(tables.execute, bag)


def _query_messages(ask: Callable[..., Iterator[tuple[Any, ...]]], bag: Bag) -> None:
    real = {name for (name,) in ask("SELECT name FROM sqlite_master WHERE type = 'table'")}
    if not {"topics", "messages"} <= real:  # a view could go on for ever
        raise DecodeError("it is a SQLite file without the tables 'topics' and 'messages' of rosbag2.")
    topics: dict[int, Topic] = {}
    for number, name, kind, encoding in ask("SELECT id, name, type, serialization_format FROM topics"):
        if not (type(number) is int and all(isinstance(word, str) for word in (name, kind, encoding))):
            raise DecodeError("its table 'topics' holds something that is not a name; it is damaged.")
        topics[number] = bag.topic(name, kind, encoding)
    for number, topic in topics.items():
        if topic.kind not in NUMBERS:
            topic.count += next(iter(ask("SELECT count(*) FROM messages WHERE topic_id = ?", (number,))))[0]
            continue
        rows = ask("SELECT timestamp, data FROM messages WHERE topic_id = ? ORDER BY timestamp, id", (number,))
        for log_ns, data in rows:
            if type(log_ns) is not int or not isinstance(data, bytes):
                raise DecodeError(f"a message of {topic.name} is invalid; the table is damaged.")
            bag.room(len(data))  # no encapsulation of CDR begins as zstd does
            topic.take(log_ns, _zstd(BytesIO(data), "a message", bag) if data.startswith(_ZSTD) else data)


def table(topic: Topic) -> MessageTable:
    """Numbers of a topic's messages; DecodeError if a message is not as its type says."""
    stamps, tails, frames = list[int](), list[bytes](), dict[str, None]()
    for message in topic.messages:
        stamp, frame, tail = _parsed(topic, message)
        stamps.append(stamp)
        frames[frame] = None
        tails.append(tail)
    numbers = np.frombuffer(b"".join(tails), dtype="<f8").reshape(-1, NUMBERS[topic.kind]).astype(np.float64)
    t_ns, notes = stamps, list[Note]()
    if stamps.count(0) >= max(2, len(stamps)):
        t_ns = topic.logged
        notes += [f"{topic.name}: no stamp is set; times are those at which the recorder took each message"]
    return MessageTable(np.array(t_ns, dtype=np.int64), notes, numbers, tuple(filter(None, frames)))


_ADVICE: Final = "the message is damaged, or its type was changed where the bag was recorded."


def _parsed(topic: Topic, message: bytes) -> tuple[int, str, bytes]:
    """Stamp, ns, name of the frame, and the numbers in little endian."""
    order, start = "<", 4
    cdr = topic.encoding == "cdr"
    if cdr:
        if message[:2] not in {b"\x00\x00", b"\x00\x01"}:
            raise DecodeError(f"{topic.name}: a message is not in plain CDR, but begins with {message[:2]!r}.")
        order, message, start = "<" if message[1] else ">", message[4:], 0  # ROS 1 has a counter before the stamp
    count = NUMBERS[topic.kind]
    try:
        seconds, rest = struct.unpack_from(f"{order}{'i' if cdr else 'I'}I", message, start)
        frame, at = _name(message, start + 8, order, cdr)
        if topic.kind in _CHILDREN:
            _, at = _name(message, at, order, cdr)
    except (struct.error, UnicodeDecodeError) as error:
        raise DecodeError(f"{topic.name}: a header has no valid frame; {_ADVICE}") from error
    if cdr:
        at += -at % 8
    tail = message[at : at + 8 * count]
    if len(tail) != 8 * count or len(message) - at - len(tail) > (7 if cdr else 0):
        raise DecodeError(
            f"{topic.name}: a message has {counted(len(message), 'byte')}, but one of {topic.kind} with this "
            f"header has {at + 8 * count}; {_ADVICE}"
        )
    if rest >= 10**9:
        raise DecodeError(f"{topic.name}: a stamp has {rest} ns beyond its second; {_ADVICE}")
    tail = tail if order == "<" else np.frombuffer(tail, dtype=">f8").astype("<f8").tobytes()
    return seconds * 10**9 + rest, frame, tail


def _name(message: bytes, at: int, order: str, cdr: bool) -> tuple[str, int]:
    """A text, and where it ends; in CDR its length counts the zero behind it."""
    if cdr:
        at += -at % 4
    (length,) = struct.unpack_from(f"{order}I", message, at)
    if length > len(message) - at - 4:
        raise struct.error("a text extends beyond the message")
    text = message[at + 4 : at + 4 + length]
    return (text.rstrip(b"\x00") if cdr else text).decode(), at + 4 + length
