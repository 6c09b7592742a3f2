"""A line whose recorder was killed and started again: parts together, bits as live, a gap where it was away."""

import errno
from dataclasses import replace

import numpy as np
import pytest

from plumbob import Stream, flags, replay
from plumbob.core.errors import DecodeError
from plumbob.files.mcap import open_log, repair, writer
from plumbob.live.recorded import read_recorded
from plumbob.live.runner import run_stream
from plumbob.live.session import OutputSpec, RecordSpec
from plumbob.live.sinks import Collected, RecordingSink, named_at
from plumbob.live.transports.transport import Received
from tests.helpers.live_samples import OFFSET, Handed, reads, session, stream, through

HOUR = 3600 * 10**9
UTC = 1_773_500_966_123_456_789  # date -u -d @1773500966 is 2026-03-14 15:09:26


def start(path, items, offset=OFFSET):
    """One start of the recorder: a line of its own; gives what it made live."""
    return through(items, recording=path, next_part=True, offset=offset)[1]


def two_starts(path, monkeypatch, *, reboot):
    """Two starts, the second 2 s later, in the midst of a frame; after a reboot by a clock that began an hour later."""
    items = reads(stream(4.0))
    half = len(items) // 2
    later = 2 * 10**9 - (HOUR if reboot else 0)
    monkeypatch.setattr(writer, "boot_id", lambda: "first")
    first = start(path, items[:half])
    monkeypatch.setattr(writer, "boot_id", lambda: "second" if reboot else "first")
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
    np.testing.assert_array_equal(found.track().q_nb, np.vstack([start.track().q_nb for start in live]))
    assert (np.diff(found.track().t) > 0).all()
    away = found.track().t[first] - found.track().t[first - 1]
    assert 1.9 < away < 2.1  # 2 s, a frame cut in two, and the delays of two reads
    gaps = np.flatnonzero(found.imu(calibrated=False).flags & flags.GAP)
    assert gaps.tolist() == [first]
    assert (replayed.stream.report()["time"]["gap_count"], replayed.stream.report()["time"]["lost"]) == (1, 0)
    assert [event.kind for event in found.events] == ["restarted"]
    recording = read_recorded(tmp_path / "a.mcap")
    assert len(recording.imu) == first + len(live[1].t_ns)
    assert "recorded in 2 sessions; the recorder was off between them" in map(str, recording.notes)
    assert len(read_recorded(tmp_path / "a.0002.mcap").imu) == len(live[1].t_ns)
    repair(tmp_path / "a.mcap", tmp_path / "b.mcap")  # one file of both
    both = replay(tmp_path / "b.mcap").found
    np.testing.assert_array_equal(both.t_ns, found.t_ns)
    np.testing.assert_array_equal(both.track().q_nb, found.track().q_nb)


def test_outputs_get_the_names_of_a_start_and_a_text_goes_on_as_the_recording_does(tmp_path):
    path = f"{tmp_path}/a-{{utc}}"
    chosen = replace(session(), record=RecordSpec(f"{path}.mcap"), output=OutputSpec(text=f"{path}.txt"))
    named, stem = named_at(chosen, UTC), tmp_path / "a-20260314T150926Z"
    assert named.record == RecordSpec(f"{stem}.mcap", next_part=True)
    assert named.output.text == f"{stem}.txt"
    stem.with_suffix(".txt").touch()
    assert named_at(chosen, UTC).output.text == f"{stem}.0002.txt"
    (tmp_path / "a.txt").touch()
    asked = replace(session(), record=RecordSpec("a.mcap", next_part=True), output=OutputSpec(text=f"{tmp_path}/a.txt"))
    assert named_at(asked, UTC).output.text == f"{tmp_path}/a.0002.txt"
    fixed = replace(asked, record=RecordSpec("a.mcap"))
    assert named_at(fixed, UTC) == fixed


def test_another_session_goes_into_parts_of_its_own(tmp_path):
    start(tmp_path / "a.mcap", reads(stream(4.0))[:50])
    other = session(session().texts["session.toml"].replace("bench 7", "bench 8"))
    _, found = through(reads(stream(4.0))[:50], other, recording=tmp_path / "a.mcap", next_part=True)
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


class Full(Collected):
    """A sink whose disk is full after the third part."""

    def __str__(self):
        return "a.txt"

    def on_part(self, part):
        super().on_part(part)
        if len(self.parts) > 3:
            raise OSError(errno.ENOSPC, "No space left on device")


def test_a_sink_that_fails_does_not_end_the_recording(tmp_path):
    chosen, items, full, found = session(), reads(stream(4.0)), Full(), Collected()
    recording_sink = RecordingSink(chosen, RecordSpec(str(tmp_path / "a.mcap"), reserve=0))
    run_stream(Stream(chosen), Handed(items), sinks=[full, found], recording=recording_sink)
    assert len(full.parts) == 4
    text = "a.txt cannot be written any more: No space left on device."
    assert [(event.kind, event.text) for event in found.events] == [("failed", text)]
    assert [event.kind for event in recording_sink.failures] == ["failed"]
    topics = [row.topic for row in open_log(tmp_path / "a.mcap")]
    assert (topics.count("raw"), topics.count("recorder")) == (len(items), 1)
    with pytest.raises(OSError, match="No space"):  # without a recording nothing goes on
        run_stream(Stream(chosen), Handed(items), sinks=[Full()])
