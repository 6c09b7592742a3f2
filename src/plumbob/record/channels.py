"""Channels of a recording and the schemas of their messages."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, Self

from plumbob.record import layout

if TYPE_CHECKING:
    from mcap.data_stream import ReadDataStream

RECORDING_KEY: Final = "plumbob.recording"
OFFSET_KEY: Final = "plumbob.epoch_offset_ns"


@dataclass(frozen=True, slots=True)
class Schema:
    """What the messages of a channel hold.

    Attributes
    ----------
    name : str
        Name of the type.
    encoding : str
        Language of the schema, such as ``"jsonschema"``.
    data : bytes
        The schema itself.
    """

    name: str
    encoding: str
    data: bytes


@dataclass(frozen=True, slots=True)
class Channel:
    """A channel as it stands in a file.

    Attributes
    ----------
    topic : str
        Name, unique in the recording.
    encoding : str
        Encoding of the messages, such as ``"json"``.
    schema : Schema or None
        What the messages hold.
    metadata : mapping of str to str
        What else the channel's owner said.
    recording : str
        The recording it belongs to; empty in a file that Plumbob has not written.
    epoch_offset_ns : int
        What was added to the monotonic clock to get the times in the file, ns.
    """

    topic: str
    encoding: str
    schema: Schema | None = None
    metadata: Mapping[str, str] = field(default_factory=dict)
    recording: str = ""
    epoch_offset_ns: int = 0

    def records(self, number: int) -> tuple[bytes, bytes]:
        """Schema record (empty without a schema) and channel record; schema and channel have the same number."""
        from mcap import records

        schema = b""
        if self.schema is not None:
            schema = layout.encode(
                records.Schema(
                    id=number, name=self.schema.name, encoding=self.schema.encoding, data=bytes(self.schema.data)
                )
            )
        own = {RECORDING_KEY: self.recording, OFFSET_KEY: str(self.epoch_offset_ns)}
        channel = records.Channel(
            id=number,
            topic=self.topic,
            message_encoding=self.encoding,
            metadata={**self.metadata, **own},
            schema_id=number if self.schema is not None else 0,
        )
        return schema, layout.encode(channel)

    @classmethod
    def parse(cls, body: bytes, schema: Schema | None) -> Self:
        """Channel from the body of its record.

        Raises
        ------
        ValueError, struct.error, mcap.exceptions.McapError
            If the body is damaged.
        """
        from mcap import records

        found = records.Channel.read(_stream(body))
        metadata = dict(found.metadata)
        return cls(
            topic=found.topic,
            encoding=found.message_encoding,
            schema=schema,
            recording=metadata.pop(RECORDING_KEY, ""),
            epoch_offset_ns=int(metadata.pop(OFFSET_KEY, "0")),
            metadata=metadata,
        )


def parse_schema(body: bytes) -> Schema:
    """Schema from the body of its record; raises as `Channel.parse` does."""
    from mcap import records

    found = records.Schema.read(_stream(body))
    return Schema(found.name, found.encoding, found.data)


def _stream(body: bytes) -> "ReadDataStream":
    from io import BytesIO

    from mcap.data_stream import ReadDataStream

    return ReadDataStream(BytesIO(body))
