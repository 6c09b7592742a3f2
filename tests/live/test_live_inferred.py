"""Gaps that rest on the host's delays alone are named wherever their recording, or what is made of it, is read."""

import json
import shutil
from dataclasses import replace

import pytest

from plumbob import Stream, read
from plumbob.data.recording import inferred
from plumbob.live.recorded import convert, read_recorded
from plumbob.live.runner import Watch, report_lines, run_report, run_stream
from plumbob.live.session import RecordSpec
from plumbob.live.sinks import RecordingSink
from tests.helpers.commandline import ok
from tests.helpers.live_samples import Handed, reads, session, stream

TELLS = "inferred gaps: 1 gap, 5 s in all, by the host's delays alone: a stall of the host looks the same"


def kept(path, *, late_ns=0, gone=0):
    """Record ten seconds, of which the second half is late or begins after a gap."""
    data, half = stream(), 1000 * 30
    shift = late_ns + 5_000_000 * (1000 + gone)
    after = (replace(item, t_ns=item.t_ns + shift) for item in reads(data[half + 30 * gone :]))
    line = Stream(session())
    watch = Watch(line)
    keeper = RecordingSink(line.session, RecordSpec(str(path)))
    run_stream(line, Handed([*reads(data[:half]), *after]), sinks=[watch], recording=keeper)
    return run_report(watch)


@pytest.fixture(scope="module")
def late(tmp_path_factory):
    """The device's clock and counter go on, and everything is five seconds late."""
    path = tmp_path_factory.mktemp("late") / "late.mcap"
    return path, kept(path, late_ns=5_000_000_000)


def test_it_is_said_and_goes_from_file_to_file(late, track, tmp_path):
    _, report = late
    assert report["notes"][0]["text"].startswith(TELLS)
    assert report["time"]["inferred"] == 1
    assert report["time"]["inferred_time"] == pytest.approx(5.0, abs=0.01)
    assert f"note         {TELLS}" in "\n".join(report_lines(report, ""))
    copy = shutil.copy(track, tmp_path / "copy.parquet")
    for words in (["info", late[0]], ["run", late[0], "--filter", "tilt_compass"], ["eval", track, copy]):
        assert f"note: {words[1].name}: {TELLS}" in ok(*words).stderr
    assert f"note         {TELLS}" in ok("replay", late[0]).stdout
    assert (
        sum(note["text"].startswith(TELLS) for note in json.loads(ok("info", late[0], "--json").stdout)["notes"]) == 1
    )


@pytest.fixture(scope="module")
def track(late, tmp_path_factory):
    path = tmp_path_factory.mktemp("track") / "track.parquet"
    ok("run", late[0], "--filter", "tilt_compass", "--out", path)
    return path


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".mcap"])
def test_it_goes_from_file_to_file(late, tmp_path, suffix):
    convert(late[0], tmp_path / f"out{suffix}")
    (note,) = [note for note in read_recorded(late[0]).notes if note.code.startswith("reading.inferred")]
    back = read(tmp_path / f"out{suffix}").notes
    assert [other for other in back if other.code.startswith("reading.inferred")] == [note]


@pytest.mark.parametrize("gone", [0, 100], ids=["whole", "half a second gone"])
def test_gaps_that_the_device_s_counts_show_are_not_inferred(tmp_path, gone):
    report = kept(tmp_path / "a.mcap", gone=gone)
    assert report["time"]["lost"] == gone
    assert report["notes"] == []
    assert not any(note.code.startswith("reading.") for note in read_recorded(tmp_path / "a.mcap").notes)


@pytest.mark.parametrize(("mode", "drift", "words"), [
    ("host", 0.0, "add a counter or a clock to the frame, or where"),
    ("host", float("nan"), "to the frame, declare its rate, or where"),
    ("clock", 0.0, 'the counter of the frames goes on; where the line waits for its reader set time = "count"'),
])  # fmt: skip
def test_what_to_do_depends_on_what_the_frames_have(mode, drift, words):
    report = Stream(session()).time.report()
    (finding,) = inferred(replace(report, mode=mode, drift_ppm=drift, inferred=2, inferred_time=3.25))
    assert "2 gaps, 3.25 s in all" in str(finding)
    assert words in str(finding)
