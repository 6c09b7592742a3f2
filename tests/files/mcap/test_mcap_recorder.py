"""What the recorder writes comes back exactly, in Plumbob's reader and in the MCAP library's own.

A recorder that is started again goes on with the next part; all parts are read as one recording.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader

from plumbob.core.errors import DecodeError, ParameterError
from plumbob.files.mcap import Recorder, Schema, layout, open_log, repair, verify, writer
from plumbob.files.mcap.log import UNKNOWN_NS, SequenceGaps
from plumbob.files.mcap.verdict import CHUNK_NS, write_rows
from tests.helpers import examples, until
from tests.helpers import record_samples as made
from tests.helpers.io_samples import put, refused
from tests.helpers.record_samples import RAW, channels, fill, payload, recorder, rows_of

FAST = examples(0.4)


@FAST
@given(
    rows=st.lists(
        st.tuples(st.integers(0, 2), st.integers(-(10**9), 10**9), st.binary(max_size=300)), min_size=0, max_size=60
    ),
    every=st.sampled_from([0.001, 0.1, 10.0]),
    compression=st.sampled_from(["zstd", "none"]),
)
def test_rows_come_back_exactly(tmp_path_factory, rows, every, compression):
    path = tmp_path_factory.mktemp("trip") / "a.mcap"
    r = made.recorder(path, every=every, compression=compression)
    r.metadata["words"] = "°/s\n"
    numbers = [r.channel(f"topic {i}", "x", Schema("S", "e", b"\x00") if i else None, {"i": str(i)}) for i in range(3)]
    t_ns, want, counts = 10**18, [], [0, 0, 0]
    with r:
        for which, step, data in rows:
            t_ns += step
            r.write(numbers[which], t_ns, data)
            want.append((f"topic {which}", counts[which], t_ns, data))
            counts[which] += 1
            r.tick(t_ns)
    log, got = made.read(path)
    assert got == want
    assert log.metadata == {"words": "°/s\n"}
    assert verify(path).whole
    assert made.library_rows(path) == want
    for message in log:
        i = message.topic[-1]
        assert (message.channel.encoding, message.channel.metadata) == ("x", {"i": i})
        assert message.channel.schema == (Schema("S", "e", b"\x00") if i != "0" else None)


def test_the_library_finds_index_summary_and_every_crc(tmp_path):
    path = tmp_path / "a.mcap"
    rows = made.record(path)
    with path.open("rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
    assert summary.statistics.message_count == len(rows) == 120
    assert summary.statistics.chunk_count == len(summary.chunk_indexes) == 6  # 0.6 s in chunks of 0.1 s
    assert (summary.statistics.message_start_time, summary.statistics.message_end_time) == (
        made.OFFSET,
        made.OFFSET + 59 * 10**7,
    )
    assert {c.topic for c in summary.channels.values()} == {made.RAW, made.DECODED}
    assert [s.data for s in summary.schemas.values()] == [made.SCHEMA.data]
    with path.open("rb") as file:  # validates the CRC of the data section, too
        records = list(StreamReader(file, emit_chunks=True, validate_crcs=True).records)
    assert sum(isinstance(one, Chunk) for one in records) == 6
    with path.open("rb") as file:  # the summary's index leads to the rows of one topic
        found = make_reader(file).iter_messages(topics=[made.DECODED], starting_at=made.OFFSET + 30 * 10**7)
        assert [m.sequence for _, _, m in found] == list(range(30, 60))


def test_a_waiting_chunk_is_sent_off_by_the_clock(tmp_path):
    path = tmp_path / "a.mcap"
    r = made.recorder(path)
    number = r.channel("a", "x")
    with r:
        r.write(number, 0, b"1")
        r.tick(99_999_999)
        r.write(number, 99_999_999, b"2")
        r.tick(100_000_000)
        until(lambda: r.acknowledged == 2)
        r.tick(10**12)
    assert r.written == 2
    assert len(made.chunks_of(path.read_bytes())) == 1


def test_a_channel_may_come_late_and_a_topic_only_once(tmp_path):
    r = made.recorder(tmp_path / "a.mcap")
    first = r.channel("a", "x")
    with r:
        r.write(first, 0, b"1")
        late = r.channel("b", "x")
        r.write(late, 1, b"2")
        refused(r.channel, "a", "x", match="has a channel 'a' already", error=ParameterError)
    assert [row[0] for row in made.read(tmp_path / "a.mcap")[1]] == ["a", "b"]


def test_an_empty_recording_is_whole_and_a_missing_part_is_told(tmp_path):
    with made.recorder(tmp_path / "a.mcap") as r:
        assert r.state == "recording"
    assert r.state == "closed"
    assert verify(tmp_path / "a.mcap").whole
    assert made.library_rows(tmp_path / "a.mcap") == []
    rows = made.record(tmp_path / "b.mcap", count=100, rotate=0.25)
    (tmp_path / "b.0002.mcap").unlink()
    verdict = verify(tmp_path / "b.mcap")
    assert verdict.lost == {made.RAW: 30, made.DECODED: 30}
    assert "part" in verdict.damage[0].what
    assert sum(verdict.rows.values()) == len(rows) - 60


def test_rotation_by_time_loses_and_doubles_nothing(tmp_path):
    path = tmp_path / "a.mcap"
    rows = made.record(path, count=100, rotate=0.25)
    parts = sorted(tmp_path.iterdir())
    assert [p.name for p in parts] == ["a.0002.mcap", "a.0003.mcap", "a.0004.mcap", "a.mcap"]  # 0.3 s in chunks of 0.1
    assert made.rows_of(open_log(path)) == rows
    assert made.rows_of(open_log(parts)) == rows
    assert made.rows_of(open_log(tmp_path)) == rows
    assert made.rows_of(open_log(parts[0])) == [row for row in rows if 30 <= row[1] < 60]
    assert all(verify(part).whole for part in [path, *parts, tmp_path])
    assert [row for part in (parts[3], *parts[:3]) for row in made.library_rows(part)] == rows


def test_rotation_by_size_and_a_recording_is_open_while_one_of_its_parts_is(tmp_path):
    rows, r = [], made.recorder(tmp_path / "a.mcap", rotate_bytes=4000)
    with r:
        numbers = made.channels(r)
        for i in range(200):
            rows += made.fill(r, numbers, i + 1, i)
            r.tick(i * 10_000_000)
        until(lambda: len(list(tmp_path.iterdir())) > 3)
        until(lambda: verify(tmp_path / "a.mcap").open)  # at a rotation there is a moment between two parts
    assert not verify(tmp_path / "a.mcap").open
    assert made.rows_of(open_log(tmp_path / "a.mcap")) == rows
    assert verify(tmp_path).whole


def test_rotation_goes_around_a_foreign_file_of_the_next_name(tmp_path):
    r = made.recorder(tmp_path / "a.mcap", rotate=0.2)
    numbers = made.channels(r)
    with r:
        made.fill(r, numbers, 10)
        (tmp_path / "a.0002.mcap").write_text("mine")
        made.fill(r, numbers, 60, start=10)
    assert (tmp_path / "a.0002.mcap").read_text() == "mine"
    assert (tmp_path / "a.0003.mcap").exists()


def test_a_second_writer_is_refused(tmp_path):
    path = tmp_path / "a.mcap"
    with made.recorder(path) as r:
        refused(made.recorder(path).start, match=r"a\.mcap is being recorded by another", error=ParameterError)
        code = (
            "import sys\nfrom plumbob.files.mcap import Recorder\n"
            "Recorder(sys.argv[1], epoch_offset_ns=0, reserve=0).start()"
        )
        done = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True, check=False)
        assert "is being recorded by another" in done.stderr
        made.fill(r, made.channels(r), 10)
    assert verify(path).rows == {made.RAW: 10, made.DECODED: 10}


def started(path, key=None, **options):
    r = made.recorder(path, **options)
    if key:
        r.metadata[key] = "7"
    r.start()


@pytest.mark.parametrize(
    ("name", "options", "match"),
    [
        ("a.mcap", {"compression": "gzip"}, "one of zstd, none"),
        ("a.mcap", {"every": 0.0}, "every must be from 0 to 10 s"),
        ("a.mcap", {"rotate": 0.0}, "rotate must be positive"),
        ("a.mcap", {"rotate_bytes": -1}, "rotate_bytes must be positive"),
        ("a.mcap", {"rotate": float("nan")}, "rotate must be positive"),
        ("a.mcap", {"key": "plumbob.part"}, r"plumbob\.part"),
        ("a.txt", {}, r"must be named \*\.mcap"),
        ("b.mcap", {}, r"b\.0007\.mcap exists already"),
        ("no/a.mcap", {}, "there is no folder"),
    ],
)
def test_what_has_no_meaning_no_place_or_a_file_already_is_refused(tmp_path, name, options, match):
    (tmp_path / "b.0007.mcap").write_text("mine")
    refused(started, tmp_path / name, **options, match=match, error=(ParameterError, DecodeError))
    reserved = {"metadata": {"plumbob.x": "1"}}
    refused(made.recorder(tmp_path / "a.mcap").channel, "a", "x", **reserved, match=r"plumbob\.x", error=ParameterError)
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("b.0007.mcap", "mine")]


def test_rows_that_cannot_be_stored_are_counted_and_cost_no_other(tmp_path):
    r = made.recorder(tmp_path / "a.mcap")
    number = r.channel("a", "x")
    with pytest.raises(ParameterError, match="has no channel 0"):
        r.write(0, 0, b"1")
    with r:
        r.write(number, -made.OFFSET - 1, b"before the epoch")
        r.write(number, 0, b"2")
        r.write(number, 1, bytes(9 << 20))
        r.write(number, 2**64, b"beyond 64 bits")
    assert [(event.kind, event.count) for event in r.take_events()] == [("dropped", 1), ("dropped", 2)]
    verdict = verify(tmp_path / "a.mcap")
    assert (verdict.whole, verdict.dropped, verdict.lost) == (True, {"a": 3}, {})
    r.write(number, 1, b"after the end")
    r.tick(10**12)
    assert (r.written, r.acknowledged, r.dropped) == (5, 1, 4)
    assert [row[1:] for row in made.read(tmp_path / "a.mcap")[1]] == [(1, 0, b"2")]


@FAST
@given(st.lists(st.tuples(st.integers(0, 40), st.integers(1, 5)), max_size=30))
def test_the_ledger_counts_like_a_set(ranges):
    """Oracle: a plain set of numbers, instead of intervals."""
    sequence, seen = SequenceGaps(0), set()
    for low, count in ranges:
        numbers = set(range(low, low + count))
        new = not numbers & seen and (low >= (max(seen) + 1 if seen else 0) or max(numbers) < max(seen))
        assert sequence.is_new(low, count) == new
        if new:
            sequence.take(low, count)
            seen |= numbers
    assert sequence.missing == (max(seen) + 1 - len(seen) if seen else 0)


def test_sequence_numbers_go_on_beyond_32_bits():
    sequence = SequenceGaps(2**32 - 2)
    assert sequence.place(2**32 - 2) == 2**32 - 2
    sequence.take(2**32 - 2, 4)
    assert sequence.place(2) == 2**32 + 2
    assert sequence.place(2**32 - 1) == 2**32 - 1


@pytest.mark.parametrize("row", ["text", bytearray(b"x"), 7])
def test_a_row_that_is_no_bytes_is_refused_and_costs_no_other(tmp_path, row):
    with made.recorder(tmp_path / "a.mcap") as recorder:
        channel = recorder.channel("a", "json")
        recorder.write(channel, 0, b"{}")
        with pytest.raises(ParameterError, match="a row of a recording must be bytes"):
            recorder.write(channel, 1, row)
        with pytest.raises(TypeError, match="integer"):
            recorder.write(channel, 0.5, b"{}")
        recorder.write(channel, 2, b"{}")
    assert (recorder.written, recorder.acknowledged, recorder.dropped) == (2, 2, 0)
    assert verify(tmp_path / "a.mcap").clean


TOPICS = {made.RAW: ("application/octet-stream", None), made.DECODED: ("json", made.SCHEMA)}


def rows(count, step_ns):
    return [(i * step_ns, topic, made.payload(i)) for i in range(count) for topic in TOPICS]


@pytest.mark.parametrize(("count", "step_ns"), [(0, 1), (1, 1), (500, CHUNK_NS // 100), (50, 3 * CHUNK_NS)])
def test_what_goes_in_comes_out_by_both_readers(tmp_path, count, step_ns):
    given = rows(count, step_ns)
    write_rows(tmp_path / "a.mcap", TOPICS, given, epoch_offset_ns=made.OFFSET, metadata={"owner": "x"})
    log, got = made.read(tmp_path / "a.mcap")
    assert [(topic, t_ns, data) for topic, _, t_ns, data in got] == [(topic, t_ns, data) for t_ns, topic, data in given]
    assert got == made.library_rows(tmp_path / "a.mcap")
    assert verify(tmp_path / "a.mcap").whole
    assert log.metadata == {"owner": "x"}
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]


def test_a_time_that_mcap_cannot_hold_is_refused_and_nothing_is_left(tmp_path):
    how = {"epoch_offset_ns": 0, "metadata": {}, "match": "a time of -1 s cannot be stored in MCAP"}
    refused(write_rows, tmp_path / "a.mcap", TOPICS, [(-(10**9), made.RAW, b"")], **how, error=ParameterError)
    assert list(tmp_path.iterdir()) == []


HOUR = 3600 * 10**9
UTC = 1_773_500_966_123_456_789  # date -u -d @1773500966 is 2026-03-14 15:09:26


@pytest.fixture
def boots(monkeypatch):
    """The machine is started anew; gives what does that."""

    def begin(word):
        monkeypatch.setattr(writer, "boot_id", lambda: word)

    begin("first")
    return begin


def start(path, begin, end, *, offset=HOUR, first_ns=0, session="s", crash=False):
    """Record the rows `begin` to `end` of 10 ms each, and perhaps die without an end; gives the recorder."""
    r = Recorder(path, epoch_offset_ns=offset, reserve=0, next_part=True)
    r.metadata |= {"session": session, "plumbob": f"version {begin}"}
    with r:
        number = r.channel(RAW, "application/octet-stream")
        for i in range(begin, end):
            r.write(number, first_ns + (i - begin) * 10_000_000, payload(i))
    if crash:  # whole chunks and no end, as a killed process leaves it
        raw = r.path.read_bytes()
        r.path.write_bytes(raw[: raw.index(b"\x07\x00\x00\x00plumbob", 200) - 9])
    return r


def data_of(path):
    rows = list(open_log(path))
    assert [row.sequence for row in rows] == list(range(len(rows)))
    return [row.data for row in rows]


def test_starts_are_one_recording(tmp_path, boots):
    path = tmp_path / "a.mcap"
    assert start(path, 0, 25, crash=True).follows is None
    before = path.read_bytes()
    second = start(path, 25, 60, first_ns=HOUR, crash=True)
    assert (second.path.name, second.follows, second.alone) == ("a.0002.mcap", path, False)
    start(path, 60, 80, first_ns=2 * HOUR)
    assert path.read_bytes() == before
    assert [p.name for p in layout.existing_parts(path)] == ["a.mcap", "a.0002.mcap", "a.0003.mcap"]
    assert data_of(path) == data_of(tmp_path) == [payload(i) for i in range(80)]
    assert open_log(path).starts == 3
    verdict = verify(path)
    assert (verdict.clean, verdict.lossy, verdict.rows) == (False, False, {RAW: 80})
    assert verdict.duration == pytest.approx(2 * 3600 + 0.19)  # the rows of the last start end .19 s after it


def test_a_rotated_recording_goes_on_behind_its_last_part(tmp_path, boots):
    path = tmp_path / "a.mcap"
    with recorder(path, rotate=0.2) as r:
        fill(r, channels(r), 60)
    count = len(layout.existing_parts(path))
    assert count == 3  # .6 s
    with recorder(path, rotate=0.2, next_part=True) as r:
        fill(r, channels(r), 60)
    assert len(layout.existing_parts(path)) == 2 * count
    log = open_log(path)
    assert [row[1] for row in rows_of(log) if row[0] == RAW] == list(range(120))
    assert (log.lost, log.damage, log.clean) == ({}, [], True)


def test_repair_makes_one_file_of_all_starts(tmp_path, boots):
    for begin, end in ((0, 25), (25, 60), (60, 80)):
        boots(f"boot {begin}")
        start(tmp_path / "a.mcap", begin, end, offset=HOUR + begin * 10**9, crash=True)
    rows = rows_of(open_log(tmp_path / "a.mcap"))
    repair(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert rows_of(open_log(tmp_path / "b.mcap")) == rows
    assert verify(tmp_path / "b.mcap").whole


@pytest.mark.parametrize(
    ("offset", "expected"),
    [
        (2 * HOUR, 2 * HOUR - HOUR),  # the monotonic clock of the second boot began an hour after that of the first
        (0, 24 * 10_000_000 + UNKNOWN_NS),  # wall clock not set at boot: behind the last row
    ],
)
def test_after_a_reboot_times_go_on_by_the_wall_clock(tmp_path, boots, offset, expected):
    start(tmp_path / "a.mcap", 0, 25)
    boots("second")
    start(tmp_path / "a.mcap", 25, 50, offset=offset)
    log = open_log(tmp_path / "a.mcap")
    times = [row.t_ns for row in log]
    assert times[:25] == [i * 10_000_000 for i in range(25)]
    assert times[25:] == [expected + i * 10_000_000 for i in range(25)]
    assert log.shift_ns == expected


def test_starts_of_one_boot_keep_their_distance_when_its_clock_is_set(tmp_path, boots):
    """A board without a clock: in 1970 and then in the present, in its first boot and in a later one."""
    start(tmp_path / "a.mcap", 0, 25, offset=0)
    start(tmp_path / "a.mcap", 25, 50, offset=UTC, first_ns=HOUR)
    boots("second")
    start(tmp_path / "a.mcap", 50, 75, offset=0)
    start(tmp_path / "a.mcap", 75, 100, offset=2 * UTC, first_ns=HOUR)
    times = [row.t_ns for row in open_log(tmp_path / "a.mcap")]
    assert times[25] == times[75] - times[50] == HOUR
    assert times[50] == times[49] + UNKNOWN_NS


@pytest.mark.parametrize("left", [b"", b"\x89MCAP0\r\n", b"no recording at all", None])
def test_a_damaged_part_is_left_as_it_is(tmp_path, boots, left):
    """Also one that a power cut left empty, or of which the beginning is gone."""
    path = tmp_path / "a.mcap"
    start(path, 0, 25)
    start(path, 25, 50)
    broken = tmp_path / "a.0002.mcap"
    raw = bytearray(broken.read_bytes())
    raw[:200] = bytes(200)
    broken.write_bytes(raw if left is None else left)
    before = broken.read_bytes()
    assert start(path, 50, 75).path.name == "a.0003.mcap"
    assert broken.read_bytes() == before
    log = open_log(path)
    found = [row.data for row in log]
    kept = range(75) if left is None else [*range(25), *range(50, 75)]
    assert found == [payload(i) for i in kept]
    assert log.damage  # of it, or behind it that nothing is left of it


def test_an_empty_first_part_is_followed(tmp_path, boots):
    start(put(tmp_path / "a.mcap", b""), 0, 25)
    assert data_of(tmp_path / "a.mcap") == [payload(i) for i in range(25)]


def test_another_session_is_recorded_but_not_read_together(tmp_path, boots):
    """A buoy goes on recording after its session was changed; nobody decodes both with one of them."""
    path = tmp_path / "a.mcap"
    start(path, 0, 25)
    other = start(path, 25, 50, session="another")
    assert other.alone
    again = start(path, 50, 75, session="another")
    assert not again.alone
    refused(open_log, path, match=r"a\.0002\.mcap does not go on from the part before it")
    assert data_of([other.path, again.path]) == [payload(i) for i in range(25, 75)]


def test_a_next_part_is_refused_as_the_first_is(tmp_path, boots):
    path = tmp_path / "a.mcap"
    start(path, 0, 25)
    refused(recorder(path).start, match=r"exists already.*ask for the next part", error=ParameterError)
    r = recorder(path, next_part=True, reserve=1 << 60).start()  # it waits for room
    assert r.state == "stopped"
    r.close()
    assert "has stopped" in r.take_events()[0].text
    assert layout.existing_parts(path) == [path]
    with recorder(tmp_path / "b.mcap"):
        second = recorder(tmp_path / "b.mcap", next_part=True)
        refused(second.start, match="is being recorded", error=ParameterError)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_the_next_part_needs_permission_as_the_first_does(tmp_path, boots):
    start(tmp_path / "a.mcap", 0, 25)
    tmp_path.chmod(0o500)
    refused(recorder(tmp_path / "a.mcap", next_part=True).start, match="Permission denied")
    tmp_path.chmod(0o700)
    assert layout.existing_parts(tmp_path / "a.mcap") == [tmp_path / "a.mcap"]


def test_parts_of_others_and_parts_that_are_not_there(tmp_path, boots):
    """Two recordings of several starts in one folder are not one."""
    for name in ("a.mcap", "b.mcap"):
        start(tmp_path / name, 0, 10)
        start(tmp_path / name, 10, 20)
    refused(open_log, tmp_path, match="several recordings")
    assert data_of(tmp_path / "a.mcap") == [payload(i) for i in range(20)]
    for begin in (0, 25, 50):
        start(tmp_path / "a.mcap", begin, begin + 25)
    (tmp_path / "a.0002.mcap").unlink()
    verdict = verify(tmp_path / "a.mcap")
    assert verdict.lossy
    assert "parts 2 to 2 of the recording are not here, or are empty" in verdict.damage[0].what


def test_names_of_parts_and_starts(tmp_path):
    assert layout.dated("logs/buoy-{utc}.mcap", UTC) == "logs/buoy-20260314T150926Z.mcap"
    assert layout.dated("{utc}.mcap", 0) == "19700101T000000Z.mcap"
    assert layout.dated("a.mcap", UTC) == "a.mcap"
    made = [layout.dated("{utc}", UTC + k * 10**9) for k in (0, 1, 40, 86400, 400 * 86400)]
    assert made == sorted(made)
    refused(layout.dated, "{time}.mcap", UTC, match=r"but not \{time\}", error=ParameterError)
    path = Path(tmp_path / "a.txt")
    assert layout.next_path(path) == path
    path.touch()
    assert layout.next_path(path).name == "a.0002.txt"
    (tmp_path / "a.0009.txt").touch()
    assert layout.next_path(path).name == "a.0010.txt"
