"""Recordings for the tests: made-up channels whose every row can be checked."""

import json

from mcap.reader import NonSeekingReader, SeekingReader

from plumbob.files.mcap import Recorder, Schema, layout, open_log

RAW, DECODED = "raw/imu", "imu"
OFFSET = 1_700_000_000_000_000_000
SCHEMA = Schema("Count", "jsonschema", b'{"type": "object", "properties": {"i": {"type": "number"}}}')


def recorder(path, **options):
    """A recorder that asks for no reserve: the machine that runs the tests may have a full disk."""
    return Recorder(path, epoch_offset_ns=OFFSET, **{"reserve": 0, **options})


def channels(r):
    return r.channel(RAW, "application/octet-stream"), r.channel(DECODED, "json", SCHEMA, {"unit": "rad/s"})


def payload(i):
    return bytes((i * k + k) % 256 for k in range(7))


def fill(r, numbers, count, start=0, step_ns=10_000_000):
    """Rows `start` to `count` on both channels; returns them as (topic, sequence, t_ns, data)."""
    rows = []
    for i in range(start, count):
        for number, topic, data in zip(
            numbers, (RAW, DECODED), (payload(i), json.dumps({"i": i}).encode()), strict=True
        ):
            r.write(number, i * step_ns, data)
            rows.append((topic, i, i * step_ns, data))
    return rows


def record(path, count=60, **options):
    r = recorder(path, **options)
    r.metadata["session"] = "[device]\nname = 'demo'\n"
    with r:
        rows = fill(r, channels(r), count)
    assert r.acknowledged == r.written == len(rows)
    assert r.take_events() == []
    return rows


def rows_of(log):
    return [(m.topic, m.sequence, m.t_ns, m.data) for m in log]


def read(path):
    log = open_log(path)
    return log, rows_of(log)


def library_rows(path, offset=OFFSET):
    """Rows by the MCAP library, whose two readers agree: by the index, and from the first byte to the last.

    Both check every CRC that they know of. Its own `mcap recover` writes files that they refuse (mcap #1474).
    """
    found = []
    for reader in (SeekingReader, NonSeekingReader):
        with path.open("rb") as file:
            messages = reader(file, validate_crcs=True).iter_messages(log_time_order=False)
            found.append([(c.topic, m.sequence, m.log_time - offset, m.data) for _, c, m in messages])
    assert found[0] == found[1]
    return found[0]


def records_of(raw):
    """Opcode, offset and length of each record of a whole file."""
    at, found = 8, []
    while at < len(raw) - 8:
        opcode, length = layout.RECORD_HEAD.unpack_from(raw, at)
        found.append((opcode, at, 9 + length))
        at += 9 + length
    return found


def chunks_of(raw):
    return [(at, length) for opcode, at, length in records_of(raw) if opcode == layout.Opcode.CHUNK]


def flipped(raw, place, bits=1):
    """These bytes with some bits of one other."""
    return raw[:place] + bytes([raw[place] ^ bits]) + raw[place + 1 :]
