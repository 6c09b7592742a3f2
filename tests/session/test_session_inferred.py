"""Gaps that rest on the host's delays alone are named wherever their recording, or what is made of it, is read."""

import json
import shutil
from dataclasses import replace

import pytest

from plumbob import files
from plumbob.cli.main import main
from plumbob.session.reading import read
from plumbob.session.recorded import convert, read_recorded
from plumbob.session.recording_sink import RecordingSink
from plumbob.session.runner import run_stream
from plumbob.session.session import RecordSpec
from plumbob.session.stream import Stream
from plumbob.session.watch import Watch, report_lines, report_of
from tests.helpers.live_samples import SESSION, Handed, reads, session, stream

TELLS = "inferred gaps: 1 gap, 5 s in all, by the host's delays alone: a stall of the host looks the same"


def kept(path, *, late_ns=0, gone=0):
    """Record ten seconds, of which the second half is late or begins after a gap."""
    data, half = stream(), 1000 * 30
    before, after = reads(data[:half]), reads(data[half + 30 * gone :])
    shift = late_ns + 5_000_000 * (1000 + gone)
    items = [*before, *(replace(item, t_ns=item.t_ns + shift) for item in after)]
    chosen = session()
    line = Stream(chosen)
    watch = Watch(line)
    run_stream(line, Handed(items), sinks=[watch], recording=RecordingSink(chosen, RecordSpec(str(path))))
    return report_of(watch)


@pytest.fixture(scope="module")
def late(tmp_path_factory):
    """The device's clock and counter go on, and everything is five seconds late."""
    path = tmp_path_factory.mktemp("late") / "late.mcap"
    return path, kept(path, late_ns=5_000_000_000)


def test_record_says_it_at_its_end(late):
    _, report = late
    assert report["inferred_gaps"].startswith(TELLS)
    assert report["time"]["inferred"] == 1
    assert report["time"]["inferred_time"] == pytest.approx(5.0, abs=0.01)
    assert "inferred     1 gap, 5 s in all" in "\n".join(report_lines(report, ""))


@pytest.fixture(scope="module")
def track(late, tmp_path_factory):
    path = tmp_path_factory.mktemp("track") / "track.parquet"
    assert main(["run", str(late[0]), "--filter", "tilt_compass", "--out", str(path)]) == 0
    return path


def test_so_does_whoever_reads_it(late, track, tmp_path, capsys):
    copy = shutil.copy(track, tmp_path / "copy.parquet")
    for words in (["info", late[0]], ["run", late[0], "--filter", "tilt_compass"], ["eval", track, copy]):
        assert main([str(word) for word in words]) == 0
        assert f"note: {words[1].name}: {TELLS}" in capsys.readouterr().err
    assert main(["replay", str(late[0])]) == 0
    assert "inferred     1 gap, 5 s in all" in capsys.readouterr().out


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".mcap"])
def test_it_goes_from_file_to_file(late, tmp_path, suffix):
    out = tmp_path / f"out{suffix}"
    convert(late[0], out)
    assert [note for note in read(out).notes if note.startswith("inferred gaps")] == [
        note for note in read_recorded(late[0]).notes if note.startswith(TELLS)
    ]


def test_json_has_it(late, capsys):
    assert main(["info", str(late[0]), "--json"]) == 0
    assert any(note.startswith(TELLS) for note in json.loads(capsys.readouterr().out)["notes"])


@pytest.mark.parametrize("gone", [0, 100], ids=["whole", "half a second gone"])
def test_gaps_that_the_device_s_counts_show_are_not_inferred(tmp_path, gone):
    report = kept(tmp_path / "a.mcap", gone=gone)
    assert report["time"]["lost"] == gone
    assert report["inferred_gaps"] is None
    assert not files.inferred_in(read_recorded(tmp_path / "a.mcap").notes)


def test_what_to_do_depends_on_what_the_frames_have():
    def line_of(mode, drift):
        report = Stream(session(SESSION)).time.report()
        return files.inferred(replace(report, mode=mode, drift_ppm=drift, inferred=2, inferred_time=3.25))[0]

    assert "2 gaps, 3.25 s in all" in line_of("host", 0.0)
    assert "add a counter or a clock to the frame, or where" in line_of("host", 0.0)
    assert "to the frame, declare its rate, or where" in line_of("host", float("nan"))
    assert 'its frames\' counts go on; where the line waits for its reader set time = "count"' in line_of("clock", 0.0)
