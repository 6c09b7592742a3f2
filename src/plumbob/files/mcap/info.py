"""What each part of a recording says about itself, with a CRC, at its beginning and once more at its end."""

import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from io import BytesIO
from typing import Final, Self

from plumbob.files.mcap import layout

NAME: Final = "plumbob"
"""Name of the metadata record."""
RESERVED: Final = "plumbob."
"""Keys that begin so are not the user's."""


@dataclass(frozen=True, slots=True)
class PartInfo:
    """What a part says about itself.

    Attributes
    ----------
    recording : str
        Random name of the recording, the same in all its parts and chunks.
    part : int
        Which part this is, from 1.
    epoch_offset_ns : int
        What was added to the monotonic clock to get the times in the file, ns.
    starts : mapping of str to int
        Per topic, sequence number of the first row that this part can hold; 0 where a topic is not named.
    ends : mapping of str to int or None
        Per topic, one more than the last sequence number in this part; None in the record at the beginning.
    dropped : mapping of str to int
        Per topic, rows that the recorder itself gave up while it wrote this part.
    metadata : mapping of str to str
        What the recording's owner says of the whole recording.
    follows : str or None
        Name of the recording that this one goes on from, after a restart; None where it stands alone.
    boot : str
        Which start of the host this was, whose monotonic clock counts from it; empty where that is not known.
    """

    recording: str
    part: int
    epoch_offset_ns: int
    starts: Mapping[str, int] = field(default_factory=dict)
    ends: Mapping[str, int] | None = None
    dropped: Mapping[str, int] = field(default_factory=dict)
    metadata: Mapping[str, str] = field(default_factory=dict)
    follows: str | None = None
    boot: str = ""

    def record(self) -> bytes:
        """Bytes of the metadata record."""
        from mcap.records import Metadata

        fields = {
            "recording": self.recording,
            "part": str(self.part),
            "epoch_offset_ns": str(self.epoch_offset_ns),
            "starts": _text(self.starts),
            "ends": _text(self.ends),
            "dropped": _text(self.dropped),
            **({} if self.follows is None else {"follows": self.follows}),
            **({"boot": self.boot} if self.boot else {}),
        }
        entries = {**self.metadata, **{RESERVED + key: value for key, value in fields.items()}}
        crc = _checksum(entries)
        return layout.encode(Metadata(NAME, {**entries, f"{RESERVED}crc32": crc}))

    @classmethod
    def parse(cls, body: bytes) -> Self | None:
        """Info from the body of a metadata record; None if it is another's record or its CRC does not hold."""
        entries = _entries(body)
        if entries is None or entries.pop(f"{RESERVED}crc32", None) != _checksum(entries):
            return None
        fields = {key: entries.pop(RESERVED + key) for key in _KEYS if RESERVED + key in entries}
        if len(fields) != len(_KEYS):
            return None
        follows, boot = entries.pop(f"{RESERVED}follows", None), entries.pop(f"{RESERVED}boot", "")
        try:
            return cls(
                recording=fields["recording"],
                part=int(fields["part"]),
                epoch_offset_ns=int(fields["epoch_offset_ns"]),
                starts=_numbers(fields["starts"]),
                ends=None if fields["ends"] == "null" else _numbers(fields["ends"]),
                dropped=_numbers(fields["dropped"]),
                metadata=entries,
                follows=follows,
                boot=boot,
            )
        except ValueError:
            return None


_KEYS: Final = ("recording", "part", "epoch_offset_ns", "starts", "ends", "dropped")


def _text(numbers: Mapping[str, int] | None) -> str:
    return json.dumps(numbers if numbers is None else dict(sorted(numbers.items())))


def _numbers(text: str) -> dict[str, int]:
    try:
        numbers = json.loads(text)
    except RecursionError as error:
        raise ValueError from error
    if not isinstance(numbers, dict) or not all(type(value) is int and value >= 0 for value in numbers.values()):
        raise ValueError
    return numbers


def _checksum(entries: Mapping[str, str]) -> str:
    # Keys are sorted, since a program that copies the record may order them anew.
    return f"{zlib.crc32(json.dumps(sorted(entries.items())).encode()):08x}"


def _entries(body: bytes) -> dict[str, str] | None:
    import struct

    from mcap.data_stream import ReadDataStream
    from mcap.exceptions import McapError
    from mcap.records import Metadata

    try:
        record = Metadata.read(ReadDataStream(BytesIO(body)))
    except (McapError, ValueError, struct.error):
        return None
    return dict(record.metadata) if record.name == NAME else None
