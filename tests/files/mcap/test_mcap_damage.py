"""Whatever happens to a file: no wrong row, at most the damaged chunk lost, every lost row counted.

A repair keeps every whole row, says what is missing, and its output opens everywhere.
"""

import contextlib
import io
import random
import struct
import tracemalloc
import zlib
from dataclasses import replace

import lz4.frame
import pytest
import zstandard
from mcap import records
from mcap.writer import Writer

from plumbob.core.errors import DecodeError, ParameterError
from plumbob.files.mcap import layout, open_log, repair, verify
from plumbob.files.mcap.scan import FileBytes
from tests.helpers import record_samples as made
from tests.helpers.io_samples import put, refused

CHUNK_ROWS = 20  # 0.1 s of two channels at 100 Hz


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Bytes and rows of a small whole recording."""
    path = tmp_path_factory.mktemp("whole") / "a.mcap"
    rows = made.record(path, count=40)
    return path.read_bytes(), rows


def judge(path, raw, rows, most_lost=CHUNK_ROWS):
    """Read damaged bytes: rows that come are right, in order, and those that do not are few and counted."""
    log, got = made.read(put(path, raw))
    there = set(got)
    assert got == [row for row in rows if row in there]
    assert len(rows) - len(got) <= most_lost
    if log.clean:
        assert sum(log.lost.values()) == len(rows) - len(got)
    assert log.damage or log.lost or not log.clean
    return log, got


def test_a_cut_anywhere_leaves_a_readable_prefix(tmp_path):
    path = tmp_path / "a.mcap"
    rows = made.record(path, count=20)
    raw = path.read_bytes()
    ends = [at + length for at, length in made.chunks_of(raw)]
    for size in sorted({*range(0, len(raw), 7), *(end + k for end in ends for k in (-1, 0, 1)), len(raw) - 1}):
        log, got = made.read(put(path, raw[:size]))
        assert got == rows[: len(got)]
        assert len(got) == CHUNK_ROWS * sum(end <= size for end in ends)  # every chunk that is there as a whole
        assert not log.clean
    assert len(got) == len(rows)


def test_single_bit_flips_never_give_a_wrong_row(whole, tmp_path):
    """The header and 300 here; benchmarks/recorder_damage.py takes 10,000."""
    raw, rows = whole
    rng = random.Random(1)
    for bit in [*range(8 * 17, 8 * 45), *rng.sample(range(8 * len(raw)), 300)]:
        judge(tmp_path / "a.mcap", made.flipped(raw, bit // 8, 1 << bit % 8), rows)


BARE = layout.MESSAGE_HEAD.pack(layout.Opcode.MESSAGE, 22 + 3, 1, 10, made.OFFSET, made.OFFSET) + b"lie"
JUNK = (b"\0" * 5000, b"junk", random.Random(3).randbytes(5000))
SINGLE = [  # what is done to a file and its second chunk; whether that is lost; where damage begins, its size; words
    *((lambda raw, at, _, k=k: made.flipped(raw, at + k, 0xFF), True, 0, None, "") for k in range(9)),  # opcode, length
    (lambda raw, at, _: raw[: at + 33] + bytes(4) + raw[at + 37 :], True, 0, None, ""),  # an absent CRC is 0
    (lambda raw, at, _: raw[:at] + BARE + raw[at:], False, 0, len(BARE), ""),  # a message outside of chunks
    # its first time, then its last: no CRC of the chunk guards them
    *((lambda raw, at, _, k=k: made.flipped(raw, at + k, 2), False, 9, 16, "times at a chunk's head") for k in (9, 17)),
    (lambda raw, at, length: made.flipped(raw, at + length + 20, 4), False, None, None, "index"),
    (lambda raw, *_: raw.replace(b"recording 1", b"recording 3", 1), False, None, None, "the CRC of all data"),
    *((lambda raw, *_, junk=junk: raw + junk, False, "end", len(junk), "") for junk in JUNK),
]


@pytest.mark.parametrize("case", SINGLE, ids=range(len(SINGLE)))
def test_one_damage_loses_no_more_than_its_chunk_and_is_told(whole, tmp_path, case):
    (raw, rows), (damage, lost, begin, size, what) = whole, case
    at, length = made.chunks_of(raw)[1]
    log, got = judge(tmp_path / "a.mcap", damage(raw, at, length), rows)
    assert len(got) == len(rows) - CHUNK_ROWS * lost
    assert log.lost == ({made.RAW: 10, made.DECODED: 10} if lost else {})
    assert log.damage[0].lost == log.lost
    assert begin is None or log.damage[0].offset == (len(raw) if begin == "end" else at + begin)
    assert size is None or log.damage[0].size == size
    assert what in log.damage[0].what
    assert log.damage[0].certain or not what
    assert len(log.damage) == 1 or not what


@pytest.mark.parametrize("size", [1, 16, 512, 1500])
def test_zeroed_blocks(whole, tmp_path, size):
    raw, rows = whole
    for at in (25, *range(0, len(raw) - size, max(197, size // 2))):
        if raw[at : at + size].count(0) != size:
            damaged = raw[:at] + bytes(size) + raw[at + size :]
            hit = sum(a < at + size and at < a + length for a, length in made.chunks_of(raw))
            judge(tmp_path / "a.mcap", damaged, rows, most_lost=CHUNK_ROWS * hit)


def test_foreign_beginnings_and_appended_recordings(whole, tmp_path):
    raw, rows = whole
    first = made.chunks_of(raw)[0][0]
    for begin in (bytes(first), b""):
        log, got = judge(tmp_path / "a.mcap", begin + raw[first:], rows, most_lost=0)
        assert got == rows
        assert log.metadata == {"session": "[device]\nname = 'demo'\n"}  # it stands at the end once more
    made.record(tmp_path / "b.mcap")
    _, got = judge(tmp_path / "a.mcap", raw + (tmp_path / "b.mcap").read_bytes(), rows, most_lost=0)
    assert got == rows


def test_swapped_and_repeated_chunks_give_all_rows_once_and_a_finding(whole, tmp_path):
    raw, rows = whole
    (a, _), (b, _), (c, _), _ = made.chunks_of(raw)
    for damaged, order, what in (
        (raw[:a] + raw[b:c] + raw[a:b] + raw[c:], sorted(rows), "out of order"),
        (raw[:b] + raw[a:b] + raw[b:], rows, "is repeated"),
    ):
        log, got = made.read(put(tmp_path / "a.mcap", damaged))
        assert (sorted(got) if order != rows else got) == order
        assert log.lost == {}
        assert what in str(log.damage)


def test_swapped_disk_blocks(whole, tmp_path):
    raw, rows = whole
    rng = random.Random(2)
    for _ in range(30):
        i, j = sorted(rng.sample(range(len(raw) // 512), 2))
        blocks = [raw[k : k + 512] for k in range(0, len(raw), 512)]
        blocks[i], blocks[j] = blocks[j], blocks[i]
        log, got = made.read(put(tmp_path / "a.mcap", b"".join(blocks)))
        assert set(got) <= set(rows)
        assert len(got) == len(set(got))
        assert log.damage


def test_a_recording_inside_a_message_never_comes_out(whole, tmp_path):
    """A line may carry MCAP itself; when its chunk is damaged, the inner chunks are whole, but not of this file."""
    inner, _ = whole
    path = tmp_path / "a.mcap"
    r = made.recorder(path, compression="none")
    number = r.channel("raw", "x")
    with r:
        for i in range(3):
            r.write(number, i * 10**9, inner + bytes([i]))
    raw = path.read_bytes()
    log, got = made.read(put(path, made.flipped(raw, made.chunks_of(raw)[1][0] + 60)))
    assert [(row[0], row[1]) for row in got] == [("raw", 0), ("raw", 2)]
    assert log.lost == {"raw": 1}


def test_rows_need_not_come_in_the_order_of_their_times(tmp_path):
    """Two channels of which one is late: the head of a chunk holds the least and the greatest time."""
    path = tmp_path / "a.mcap"
    r = made.recorder(path)
    numbers = r.channel("late", "x"), r.channel("early", "x")
    with r:
        for t_ns in (50, 20, 90, 40):
            for number, late in zip(numbers, (7, 0), strict=True):
                r.write(number, t_ns + late, b"x")
    raw = path.read_bytes()
    ((at, _),) = made.chunks_of(raw)
    assert struct.unpack_from("<QQ", raw, at + layout.RECORD_HEAD.size) == (made.OFFSET + 20, made.OFFSET + 97)
    log, got = made.read(path)
    assert [row[2] for row in got] == [57, 50, 27, 20, 97, 90, 47, 40]
    assert log.damage == []
    assert log.clean


def test_lost_rows_of_a_rare_channel_are_counted_though_it_never_comes_again(tmp_path):
    path = tmp_path / "a.mcap"
    r = made.recorder(path)
    number, rare = r.channel("a", "x"), r.channel("rare", "x")
    with r:
        for i in range(50):
            r.write(number, i * 10**7, b"x")
            if i == 25:
                r.write(rare, i * 10**7, b"once")
    raw = path.read_bytes()
    log, _ = made.read(put(path, made.flipped(raw, made.chunks_of(raw)[2][0] + 70)))
    assert log.lost == {"a": 10, "rare": 1}


def read_within(path):
    """Log, its rows, and the most memory that this took, bytes."""
    tracemalloc.start()
    try:
        return *made.read(path), tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("claimed", [2**20, 2**26, 2**28 + 1, 2**40, 2**63])
@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_a_bomb_is_not_inflated(tmp_path, compression, claimed):
    """A gigabyte of zeros in a few kilobytes, whatever size it states."""
    zeros = bytes(1 << 26)
    stored = zstandard.compress(zeros) if compression == "zstd" else lz4.frame.compress(zeros)
    buffer = io.BytesIO()
    writer = Writer(buffer)
    writer.start(library="plumbob recording 1")
    chunk = layout.encode(records.Chunk(compression, stored, 0, 0, uncompressed_crc=1, uncompressed_size=claimed))
    log, got, peak = read_within(put(tmp_path / "a.mcap", buffer.getvalue() + chunk))
    assert got == []
    assert log.damage
    assert peak < 16 << 20


def whole_chunk(path):
    """A part's beginning, and its first chunk."""
    made.record(path, count=10)
    raw = path.read_bytes()
    at, size = made.chunks_of(raw)[0]
    return raw[:at], raw[at : at + size]


FALSE = {
    "footers whose summary is all before them": lambda rest: layout.encode(records.Footer(8, 0, 1)) + layout.MAGIC,
    "ends of the data": lambda rest: layout.encode(records.DataEnd(1)),
    "chunks up to the end of the file": lambda rest: (
        layout.RECORD_HEAD.pack(layout.Opcode.CHUNK, rest - 8) + struct.pack("<QQQIIQ", 0, 0, 1 << 20, 1, 0, rest - 48)
    ),
    "words of the part up to the end of the file": lambda rest: (
        layout.RECORD_HEAD.pack(layout.Opcode.METADATA, rest - 9) + struct.pack("<I", 7) + b"plumbob"
    ),
}


@pytest.mark.parametrize("between", [False, True])
@pytest.mark.parametrize("false", FALSE.values(), ids=FALSE)
def test_the_work_grows_with_the_file_and_not_with_its_square(tmp_path, monkeypatch, false, between):
    """Bytes read of a file of nothing but false records, chunks between them or not, and of a longer one."""
    begin, chunk = whole_chunk(tmp_path / "a.mcap")
    work = []

    def counted(source, offset, count, read=FileBytes.read):
        found = read(source, offset, count)
        work.append(len(found))
        return found

    def bytes_read(count):
        tail = b""
        for _ in range(count):
            tail = chunk * between + tail
            tail = false(len(false(100)) + len(tail)) + tail
        (tmp_path / "b.mcap").write_bytes(begin + tail)
        work.clear()
        for _ in open_log(tmp_path / "b.mcap").blocks():
            continue
        return sum(work) / (tmp_path / "b.mcap").stat().st_size

    monkeypatch.setattr(FileBytes, "read", counted)
    assert bytes_read(900) < 1.5 * bytes_read(300)
    assert bytes_read(900) < 2 * 40  # 32 times, for its name and for its rows


def test_what_is_no_recording_is_refused_by_name(tmp_path):
    path = tmp_path / "a.mcap"
    refused(open_log, path, match="no such file")
    refused(open_log, tmp_path, match=r"no \.mcap file in it")
    for content in (b"hello, world\n" * 100, bytes(4096), b"PK\x03\x04" + bytes(100), b"\x89MCAP1\r\n"):
        refused(open_log, put(path, content), match=r"a\.mcap is not an MCAP file: it begins with")


def chunk_in(record):
    return records.Chunk.read(layout.stream(record[layout.RECORD_HEAD.size :]))


def forged(raw, rng, share=0.7):
    """The file with bytes of some chunks' contents changed and every CRC made right again, and which those are."""
    out, changed = bytearray(raw[:8]), []
    for opcode, at, length in made.records_of(raw):
        record = raw[at : at + length]
        if opcode == layout.Opcode.CHUNK:
            changed.append(rng.random() < share)
        if opcode == layout.Opcode.CHUNK and changed[-1]:
            chunk = chunk_in(record)
            content = bytearray(zstandard.decompress(chunk.data))
            for _ in range(rng.randrange(1, 5)):
                content[rng.randrange(len(content))] = rng.choice([0, 1, 255, rng.randrange(256)])
            chunk = replace(chunk, data=zstandard.compress(content), uncompressed_crc=zlib.crc32(content))
            record = layout.encode(chunk)
        out += record
    return bytes(out) + raw[-8:], changed


def test_forged_files_raise_nothing_but_errors_of_ours(whole, tmp_path):
    """What chunks hold may be anything, with CRCs that hold; what is untouched comes through."""
    raw, rows = whole
    rng = random.Random(4)
    for _ in range(100):
        data, changed = forged(raw, rng)
        (tmp_path / "a.mcap").write_bytes(data)
        with contextlib.suppress(DecodeError):
            verify(tmp_path / "a.mcap")
        untouched = [row for i, row in enumerate(rows) if not changed[i // CHUNK_ROWS]]
        assert set(untouched) <= set(made.read(tmp_path / "a.mcap")[1])
    assert verify(put(tmp_path / "a.mcap", forged(raw, rng, share=0.0)[0])).whole
    assert made.read(tmp_path / "a.mcap")[1] == rows


def test_a_chunk_with_two_channels_of_one_topic_is_refused(tmp_path):
    """A forgery that fuzzing found: its rows would have been counted twice."""
    path = tmp_path / "a.mcap"
    r = made.recorder(path, compression="none")
    numbers = [r.channel(topic, "x") for topic in ("one", "two")]
    with r:
        for number in numbers:
            r.write(number, 0, b"x")
    raw = path.read_bytes()
    at, length = made.chunks_of(raw)[0]
    chunk = chunk_in(raw[at : at + length])
    content = chunk.data.replace(b"two", b"one")
    forgery = layout.encode(replace(chunk, data=content, uncompressed_crc=zlib.crc32(content)))
    path.write_bytes(raw[:at] + forgery + raw[at + length :])
    log, got = made.read(path)
    assert got == []
    assert "two channels of one topic" in log.damage[0].what


@pytest.mark.parametrize("left", [b"", bytes(3000)])
def test_a_recording_in_parts_survives_one_of_which_nothing_is_left(tmp_path, left):
    r = made.recorder(tmp_path / "a.mcap", rotate=0.2)
    with r:
        rows = made.fill(r, made.channels(r), 40)
    (tmp_path / "a.0002.mcap").write_bytes(left)
    log, got = made.read(tmp_path / "a.mcap")
    assert got == [row for row in rows if row[1] < 20]
    assert not log.clean
    assert log.damage


def check(path, out, rows):
    """Repair, and repair that once more; returns the verdict and the rows that are left."""
    verdict = repair(path, out)
    log, got = made.read(out)
    assert got == made.library_rows(out)
    assert set(got) <= set(rows)
    assert verify(out).whole
    assert log.missing == {topic: count for topic, count in verify(out).dropped.items() if count}
    again = out.with_name("again.mcap")
    again.unlink(missing_ok=True)
    assert not repair(out, again).lossy
    assert again.read_bytes() == out.read_bytes()
    out.unlink()
    return verdict, got


def test_a_whole_recording_stays_as_it_is(tmp_path):
    rows = made.record(tmp_path / "a.mcap")
    verdict = repair(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert verdict.whole
    assert (tmp_path / "b.mcap").read_bytes() == (tmp_path / "a.mcap").read_bytes()
    assert made.rows_of(open_log(tmp_path / "b.mcap")) == rows


def cuts(raw, rng):
    return (raw[:size] for size in [0, 4, 8, 20, *rng.sample(range(len(raw)), 20)])


def flips(raw, rng):
    return (made.flipped(raw, rng.randrange(len(raw)), 1 << rng.randrange(8)) for _ in range(25))


def zeroed(raw, rng):
    """From a byte to most of the file, as a disk that lost its cache leaves them."""
    for _ in range(25):
        at = rng.randrange(len(raw))
        size = min(len(raw) - at, int(len(raw) ** rng.random()))
        yield raw[:at] + bytes(size) + raw[at + size :]


@pytest.mark.parametrize("damaged", [cuts, flips, zeroed])
def test_a_damaged_recording(tmp_path, damaged):
    rows = made.record(tmp_path / "a.mcap", count=40)
    bad = tmp_path / "c" / "a.mcap"
    bad.parent.mkdir()
    for raw in damaged((tmp_path / "a.mcap").read_bytes(), random.Random(2)):
        verdict, got = check(put(bad, raw), tmp_path / "out.mcap", rows)
        assert verdict.lossy >= (len(got) < len(rows)) or damaged is cuts
        if damaged is cuts:
            assert got == rows[: len(got)]
            assert not verdict.whole
        elif damaged is flips:
            assert verdict.lossy == (len(got) < len(rows)) or any(not d.certain for d in verdict.damage)
            assert sum(verdict.lost.values()) == len(rows) - len(got)


def test_a_crash_between_chunks_loses_nothing(tmp_path):
    """Cut after the last index: no end, but no torn row either."""
    rows = made.record(tmp_path / "a.mcap", count=40)
    raw = (tmp_path / "a.mcap").read_bytes()
    end = [at for opcode, at, _ in made.records_of(raw) if opcode == layout.Opcode.METADATA][1]
    verdict, got = check(put(tmp_path / "c.mcap", raw[:end]), tmp_path / "out.mcap", rows)
    assert got == rows
    assert (verdict.clean, verdict.lossy, verdict.damage) == (False, False, [])


def test_parts_become_one_file(tmp_path):
    rows = made.record(tmp_path / "a.mcap", count=100, rotate=0.25)
    assert repair(tmp_path / "a.mcap", tmp_path / "out.mcap").whole
    assert made.read(tmp_path / "out.mcap")[1] == rows
    (tmp_path / "a.0002.mcap").unlink()
    verdict, got = check(tmp_path / "a.mcap", tmp_path / "b.mcap", rows)
    assert verdict.lossy
    assert len(got) == len(rows) - 60


def test_a_later_part_alone_is_repaired_alone(tmp_path):
    rows = made.record(tmp_path / "a.mcap", count=100, rotate=0.25)
    verdict, got = check(tmp_path / "a.0003.mcap", tmp_path / "b.mcap", rows)
    assert verdict.whole
    assert got == [row for row in rows if 60 <= row[1] < 90]


def test_a_part_whose_name_is_lost_has_one_of_as_many_digits_again(tmp_path):
    assert open_log(put(tmp_path / "a.mcap", layout.MAGIC)).recording == ""
    repair(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert len(open_log(tmp_path / "b.mcap").recording) == 32


def test_refusals(tmp_path):
    whole, out = tmp_path / "a.mcap", tmp_path / "b.mcap"
    made.record(whole)
    refused(repair, whole, whole, match=r"a\.mcap exists already", error=ParameterError)
    refused(repair, whole, tmp_path / "no" / "b.mcap", match="cannot be written")
    with (tmp_path / "f.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start(library="another")
        writer.finish()
    refused(repair, tmp_path / "f.mcap", out, match="written by another program")
    with made.recorder(tmp_path / "r.mcap") as r:
        made.fill(r, made.channels(r), 20)
        refused(repair, tmp_path / "r.mcap", out, match="still being recorded", error=ParameterError)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mcap", "f.mcap", "r.mcap"]


def test_a_verdict_names_rows_time_and_losses(tmp_path):
    made.record(tmp_path / "a.mcap", count=40)
    raw = (tmp_path / "a.mcap").read_bytes()
    verdict = verify(put(tmp_path / "a.mcap", made.flipped(raw, made.chunks_of(raw)[1][0] + 60)))
    assert verdict.lost == {made.RAW: 10, made.DECODED: 10}
    assert verdict.rows == {made.RAW: 30, made.DECODED: 30}
    assert verdict.duration == pytest.approx(0.39)
    assert (verdict.whole, verdict.lossy, verdict.clean) == (False, True, True)
    assert verdict.summary()["damage"][0]["lost"] == {made.RAW: 10, made.DECODED: 10}
