"""How many rows a part has by its own summary."""

import struct
from io import BytesIO

from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError

from plumbob.record import layout
from plumbob.record.source import Source

_LARGEST = 1 << 24


def rows_by_topic(source: Source, summary: int, end: int) -> dict[str, int]:
    """Rows per topic by the statistics of a summary whose CRC holds, up to its end; empty where it has none."""
    try:
        return _read(source, summary, end)
    except (McapError, ValueError, struct.error):  # its CRC holds, but no recorder wrote that
        return {}


def _read(source: Source, at: int, end: int) -> dict[str, int]:
    topics: dict[int, str] = {}
    while True:
        opcode, length = layout.RECORD_HEAD.unpack(source.at(at, layout.RECORD_HEAD.size))
        if opcode not in (layout.SCHEMA, layout.CHANNEL, layout.STATISTICS) or length > min(_LARGEST, end - at):
            return {}
        body = ReadDataStream(BytesIO(source.at(at + layout.RECORD_HEAD.size, length)))
        if opcode == layout.CHANNEL:
            channel = records.Channel.read(body)
            topics[channel.id] = channel.topic
        elif opcode == layout.STATISTICS:
            counts = records.Statistics.read(body).channel_message_counts
            return {topics[channel]: count for channel, count in counts.items() if channel in topics}
        at += layout.RECORD_HEAD.size + length
