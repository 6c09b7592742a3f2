"""A recording that starts and stops while the line runs: whole, replayed to the bit, and never over another file."""

import itertools
import json
import sys
import threading

import numpy as np
import pytest

import plumbob
from plumbob.core.errors import ParameterError
from plumbob.core.event import Event
from plumbob.live.runner import run_stream
from plumbob.live.session import RecordSpec
from plumbob.live.sinks import Collected, RecordingSink, TextSink
from plumbob.live.stream import Stream
from plumbob.viewer.commands import checked_name
from plumbob.viewer.switch import Switch
from tests.helpers import live_samples

MEKF = live_samples.SESSION.partition("[estimate]")[0] + '[estimate]\nfilter = "mekf"\n'


def switched(tmp_path, actions, own=None, duration=10.0):
    """Run of a stream while a switch does what `actions` of it say at some reads; events, answers, and the switch."""
    session = live_samples.session(MEKF)
    stream = Stream(session, covariance=True)
    sink = None if own is None else RecordingSink(session, RecordSpec(str(tmp_path / own)))
    switch, found = Switch(stream, tmp_path, sink), Collected()
    reads, answers, at = itertools.count(1), [], actions(switch)

    def each():
        """As commands do between two reads."""
        if (action := at.get(next(reads))) is not None:
            answers.append(action())

    source = live_samples.Handed(live_samples.reads(live_samples.stream(duration)))
    run_stream(stream, source, sinks=[found], recording=switch, each=each)
    return switch, found, answers


def test_a_recording_made_on_the_way_or_with_the_session_is_whole_and_replays_to_the_bit(tmp_path):
    switch, found, answers = switched(
        tmp_path,
        lambda switch: {10: lambda: switch.record("pier"), 20: lambda: switch.mark("lee of the pier"), 40: switch.stop},
    )
    (told,) = switch.recordings
    path = tmp_path / told["path"].rpartition("/")[2]
    assert path.name.startswith("pier-20")  # years since 2000, not before 1970
    assert answers == [str(path), "marked: lee of the pier", f"{path.name} has ended: {told['rows']} of {told['rows']} "
                       "rows on disk"]  # fmt: skip
    assert told["acknowledged"] == told["rows"] > 500
    assert plumbob.verify(path).whole
    again = plumbob.replay(path, check=True)
    assert again.comparison.equal and again.comparison.compared > 200
    # the samples are those that the stream gave meanwhile
    gyr = found.imu(calibrated=True).gyr
    first = np.flatnonzero((gyr == again.imu.gyr[0]).all(axis=1))[0]
    np.testing.assert_array_equal(again.imu.gyr, gyr[first : first + len(again.imu)])
    assert [event.text for event in again.found.events if event.kind == "mark"] == ["lee of the pier"]
    assert [event.kind for event in found.events] == ["recording", "mark", "recording"]
    switch, found, _ = switched(tmp_path, lambda switch: {}, own="own.mcap")
    assert plumbob.verify(tmp_path / "own.mcap").whole
    again = plumbob.replay(tmp_path / "own.mcap", check=True)
    assert again.comparison.equal
    np.testing.assert_array_equal(again.track.q_nb, found.track().q_nb)
    assert switch.recordings[0]["acknowledged"] == switch.recordings[0]["rows"]


def test_two_recordings_of_one_second_have_two_names_and_a_text_is_written_while_it_is_asked_for(tmp_path):
    switch, _, answers = switched(
        tmp_path,
        lambda switch: {
            4: lambda: switch.write_text("t"),
            5: lambda: switch.record("a"),
            10: switch.stop,
            15: lambda: switch.record("a"),
            20: switch.stop,
            30: switch.stop_text,
        },
    )
    first, second = (one["path"] for one in switch.recordings)
    assert first != second
    assert all(plumbob.verify(path).whole for path in (first, second))
    lines = (tmp_path / answers[0].rpartition("/")[2]).read_text(encoding="utf-8").splitlines()
    assert lines[1].startswith("t [s]\troll [deg]") and len(lines) > 20
    assert switch.text is None


def test_what_cannot_be_done_is_refused_in_words(tmp_path):
    def actions(switch):
        def refused(action):
            with pytest.raises(ParameterError) as said:
                action()
            return str(said.value)

        return {
            1: lambda: refused(switch.stop), 2: switch.record, 3: lambda: refused(switch.record),
            4: lambda: refused(switch.stop_text), 5: lambda: refused(lambda: switch.mark("two\nlines")),
            6: lambda: refused(lambda: switch.mark(" ")), 7: lambda: refused(lambda: switch.mark("x" * 201)),
        }  # fmt: skip

    _, _, answers = switched(tmp_path, actions, duration=5.0)
    assert answers[0] == "nothing is being recorded."
    assert "stop it first" in answers[2]


@pytest.mark.parametrize("name", ["../a", "a/b", "a\\b", ".hidden", "", "a b", "ü", "x" * 65, "a\n", "-{utc}", "~"])
def test_a_name_is_never_a_path(name):
    with pytest.raises(ParameterError, match="never a path"):
        checked_name(name)
    for other in ("sea", "Sea-2_b.1", "x" * 64):
        assert checked_name(other) == other


def test_what_a_thread_marks_while_the_line_runs_is_never_lost(tmp_path):
    switch, interval, told = Switch(Stream(live_samples.session(MEKF)), tmp_path), sys.getswitchinterval(), 0
    teaching = threading.Thread(target=lambda: [switch.mark("x") for _ in range(50_000)])
    sys.setswitchinterval(1e-6)
    teaching.start()
    while teaching.is_alive():
        told += len(switch.tick(0))
    sys.setswitchinterval(interval)
    assert told + len(switch.tick(0)) == 50_000


def test_a_text_on_a_full_disk_ends_and_says_so_and_events_of_a_stream_are_kept(tmp_path, monkeypatch):
    class Full(TextSink):
        def on_part(self, part):
            raise OSError(28, "No space left on device")

    monkeypatch.setattr("plumbob.live.sinks.TextSink", Full)
    stream = Stream(live_samples.session(MEKF))
    switch = Switch(stream, tmp_path)
    switch.write_text("t")
    part = next(filter(None, map(stream.feed, live_samples.reads(live_samples.stream(5.0)))))
    switch.on_part(part, 0)
    assert switch.text is None
    (event,) = [one for one in switch.tick(0) if one.kind == "failed"]
    assert "No space left" in event.text
    switch.close()
    switch = Switch(Stream(live_samples.session(MEKF)), tmp_path)
    path = switch.record("e")
    switch.on_item(Event(5, "lost", "the line is lost"))
    switch.close()
    from plumbob.files.mcap import open_log

    told = [json.loads(one.data)["kind"] for one in open_log(path) if one.topic == "events"]
    assert told == ["lost"]
