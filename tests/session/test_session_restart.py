"""A line whose recorder was killed and started again: parts together, bits as live, a gap where it was away."""

import errno
from dataclasses import replace

import numpy as np
import pytest

from plumbob.acquisition.transport import Received
from plumbob.core import flags
from plumbob.core.errors import DecodeError
from plumbob.files.mcap import disk, open_log, repair
from plumbob.session.recorded import read_recorded
from plumbob.session.recording_sink import RecordingSink, named_at
from plumbob.session.replay import replay
from plumbob.session.runner import run_stream
from plumbob.session.session import OutputSpec, RecordSpec
from plumbob.session.sinks import Collected
from plumbob.session.stream import Stream
from tests.helpers.live_samples import OFFSET, Handed, reads, session, stream

HOUR = 3600 * 10**9
UTC = 1_773_500_966_123_456_789  # date -u -d @1773500966 is 2026-03-14 15:09:26


def start(path, items, offset=OFFSET):
    """One start of the recorder: a line of its own; gives what it made live."""
    chosen = session()
    line, found = Stream(chosen), Collected()
    recording_sink = RecordingSink(chosen, RecordSpec(str(path), reserve=0, next_part=True), offset=lambda: offset)
    run_stream(line, Handed(items), sinks=[found], recording=recording_sink)
    return found


def two_starts(path, monkeypatch, *, reboot):
    """Two starts, the second 2 s later, in the midst of a frame; after a reboot by a clock that began an hour later."""
    items = reads(stream())
    half = len(items) // 2
    later = 2 * 10**9 - (HOUR if reboot else 0)
    monkeypatch.setattr(disk, "boot", lambda: "first")
    first = start(path, items[:half])
    monkeypatch.setattr(disk, "boot", lambda: "second" if reboot else "first")
    again = [Received(item.t_ns + later, item.data) for item in items[half:]]
    return first, start(path, again, OFFSET + (HOUR if reboot else 0))


@pytest.mark.parametrize("reboot", [False, True])
def test_replay_of_two_starts_equals_live_to_the_bit(tmp_path, monkeypatch, reboot):
    live = two_starts(tmp_path / "a.mcap", monkeypatch, reboot=reboot)
    replayed = replay(tmp_path / "a.mcap", check=True)
    assert replayed.comparison.equal
    found = replayed.found
    first = len(live[0].t_ns)
    shift = HOUR if reboot else 0
    np.testing.assert_array_equal(found.t_ns, [*live[0].t_ns, *(live[1].t_ns + shift)])
    np.testing.assert_array_equal(found.track().q_nb, np.vstack([one.track().q_nb for one in live]))
    assert (np.diff(found.track().t) > 0).all()
    away = found.track().t[first] - found.track().t[first - 1]
    assert 1.9 < away < 2.1  # 2 s, a frame cut in two, and the delays of two reads
    gaps = np.flatnonzero(found.imu(calibrated=False).flags & flags.GAP)
    assert gaps.tolist() == [first]
    assert replayed.stream.report()["time"]["gap_count"] == 1
    assert replayed.stream.report()["time"]["lost"] == 0
    assert [event.kind for event in found.events] == ["restarted"]


def test_one_file_made_of_both_gives_the_same(tmp_path, monkeypatch):
    two_starts(tmp_path / "a.mcap", monkeypatch, reboot=True)
    repair(tmp_path / "a.mcap", tmp_path / "b.mcap")
    both = [replay(tmp_path / name).found for name in ("a.mcap", "b.mcap")]
    np.testing.assert_array_equal(both[0].t_ns, both[1].t_ns)
    np.testing.assert_array_equal(both[0].track().q_nb, both[1].track().q_nb)


def test_verbs_take_the_parts_together_and_say_so(tmp_path, monkeypatch):
    live = two_starts(tmp_path / "a.mcap", monkeypatch, reboot=False)
    recording = read_recorded(tmp_path / "a.mcap")
    assert len(recording.imu) == sum(len(one.t_ns) for one in live)
    assert "recorded in 2 starts; the recorder was away in between" in recording.notes
    assert len(read_recorded(tmp_path / "a.0002.mcap").imu) == len(live[1].t_ns)


def test_outputs_get_the_names_of_a_start(tmp_path):
    chosen = replace(
        session(),
        record=RecordSpec(str(tmp_path / "a-{utc}.mcap")),
        output=OutputSpec(text=str(tmp_path / "a-{utc}.txt")),
    )
    named = named_at(chosen, UTC)
    assert named.record == RecordSpec(str(tmp_path / "a-20260314T150926Z.mcap"), next_part=True)
    assert named.output.text == str(tmp_path / "a-20260314T150926Z.txt")
    (tmp_path / "a-20260314T150926Z.txt").touch()
    assert named_at(chosen, UTC).output.text == str(tmp_path / "a-20260314T150926Z.0002.txt")


def test_a_text_goes_on_as_the_recording_does(tmp_path):
    (tmp_path / "a.txt").touch()
    asked = replace(session(), record=RecordSpec("a.mcap", next_part=True), output=OutputSpec(text=f"{tmp_path}/a.txt"))
    assert named_at(asked, UTC).output.text == f"{tmp_path}/a.0002.txt"
    fixed = replace(asked, record=RecordSpec("a.mcap"))
    assert named_at(fixed, UTC) == fixed


def test_another_session_goes_into_parts_of_its_own(tmp_path):
    start(tmp_path / "a.mcap", reads(stream())[:50])
    other = session(session().texts["session.toml"].replace("bench 7", "bench 8"))
    found, recording_sink = (
        Collected(),
        RecordingSink(other, RecordSpec(str(tmp_path / "a.mcap"), reserve=0, next_part=True)),
    )
    run_stream(Stream(other), Handed(reads(stream())[:50]), sinks=[found], recording=recording_sink)
    assert "its session is another: parts from a.0002.mcap on are to be read apart" in found.events[0].text
    assert len(read_recorded(tmp_path / "a.0002.mcap").imu) > 0
    with pytest.raises(DecodeError, match="does not go on"):
        read_recorded(tmp_path / "a.mcap")


def test_a_wall_clock_that_is_set_is_told_once(tmp_path):
    """A board without a clock of its own begins in 1970 and learns the time from the network."""
    offsets = iter([0, 0, UTC, UTC, UTC])
    recording_sink = RecordingSink(
        session(), RecordSpec(str(tmp_path / "a.mcap"), reserve=0), offset=lambda: next(offsets)
    )
    recording_sink.start()
    told = [event for s in range(4) for event in recording_sink.tick(s * 10**9)]
    recording_sink.close()
    assert [(event.t_ns, event.kind) for event in told] == [(10**9, "wall-clock")]
    assert "set by +1773500966.123 s" in told[0].text


class Full:
    """A sink whose disk is full after the third part."""

    def __init__(self):
        self.parts = 0

    def __str__(self):
        return "a.txt"

    def on_part(self, part):
        self.parts += 1
        if self.parts > 3:
            raise OSError(errno.ENOSPC, "No space left on device")

    def on_event(self, event):
        pass

    def close(self):
        pass


def test_a_sink_that_fails_does_not_end_the_recording(tmp_path):
    chosen, items, full, found = session(), reads(stream()), Full(), Collected()
    recording_sink = RecordingSink(chosen, RecordSpec(str(tmp_path / "a.mcap"), reserve=0))
    run_stream(Stream(chosen), Handed(items), sinks=[full, found], recording=recording_sink)
    assert full.parts == 4
    assert [(e.kind, e.text) for e in found.events] == [
        ("failed", "a.txt cannot be written any more: No space left on device.")
    ]
    assert [e.kind for e in recording_sink.failures] == ["failed"]
    log = open_log(tmp_path / "a.mcap")
    topics = [row.topic for row in log]
    assert (topics.count("raw"), topics.count("recorder")) == (len(items), 1)
    with pytest.raises(OSError, match="No space"):  # without a recording nothing goes on
        run_stream(Stream(chosen), Handed(items), sinks=[Full()])
