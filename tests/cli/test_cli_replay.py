"""plumbob replay in this process, and how a line's run is told."""

import json
import tracemalloc
from types import SimpleNamespace

import numpy as np
import pytest

from plumbob import files
from plumbob.cli.main import main
from plumbob.live import sources
from plumbob.live.runner import live_attitude, report_lines
from plumbob.protocols.page import UNCHECKED
from plumbob.rotations import Frame, euler_zyx_from_quat, quat_from_euler_zyx
from tests.helpers.live_samples import FORMAT, SESSION, reads, record, stream


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """Ten seconds of sea at 200 Hz, and what was estimated live."""
    path = tmp_path_factory.mktemp("replay") / "sea.mcap"
    return path, record(path, reads(stream()))


@pytest.fixture
def replay(recording, capsys):
    def call(*words, code=0, path=recording[0]):
        capsys.readouterr()
        assert main(["replay", str(path), *map(str, words)]) == code
        out, err = capsys.readouterr()
        return out, [line.removeprefix("note: ") for line in err.splitlines()]

    return call


def test_the_same_filter_gives_the_same_bits_and_exits_0(replay, recording, tmp_path):
    out, notes = replay("--check", "--out", tmp_path / "t.parquet")
    assert "check        EQUAL to the bit: 2000 attitudes compared, 0 different, 0 only live, 0 only replayed\n" in out
    assert notes == []
    assert out.endswith(f"written      {tmp_path / 't.parquet'}\n")
    live = recording[1].track()
    np.testing.assert_array_equal(files.read(tmp_path / "t.parquet").track.q_nb, live.q_nb)
    yaw, pitch, roll = np.degrees(euler_zyx_from_quat(live.q_nb[-1]))
    assert f"at the end   roll {roll:.2f}°, pitch {pitch:.2f}°, yaw {yaw:.2f}°\n" in out
    assert "frame        NED, heading from magnetic north\n" in out


def test_the_memory_of_a_check_does_not_grow_with_the_recording(replay, recording, tmp_path):
    """Ten times the samples: 1800 parts are two megabytes more; two windows of the file, of a MiB at most, are not."""
    record(tmp_path / "short.mcap", reads(stream()[: 200 * 30]))
    replay("--check", path=tmp_path / "short.mcap")  # what is loaded once

    def peak(path):
        tracemalloc.start()
        replay("--check", path=path)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    assert peak(recording[0]) - peak(tmp_path / "short.mcap") < 2 * recording[0].stat().st_size + 200_000


def test_another_filter_frame_or_parameter_goes_before_the_session_s(replay):
    words = ("--filter", "mahony", "--params", "kp=0.7,gate=off", "--frame", "ENU", "--check", "--json")
    report = json.loads(replay(*words, code=3)[0])
    assert report["filter"].startswith("mahony(kp=0.7 1/s")
    assert report["frame"] == "ENU"
    assert not report["check"]["equal"]
    assert report["check"]["different"] > 1900  # an axis that points elsewhere
    assert report["samples"] == 2000
    assert report["duration_s"] == pytest.approx(9.995, abs=1e-5)


@pytest.mark.parametrize("speed", [0.5, 4.0])
def test_the_speed_is_a_multiple_of_the_recording_s(replay, monkeypatch, speed):
    """Of a clock that passes only by sleeping: what took t live takes t / K."""
    clock = SimpleNamespace(now=10**9)
    clock.monotonic_ns = lambda: clock.now
    clock.sleep = lambda seconds: setattr(clock, "now", clock.now + round(seconds * 1e9))
    monkeypatch.setattr(sources, "time", clock)
    assert "2000 in 9.995 s" in replay("--speed", speed)[0]
    times = [item.t_ns for item in reads(stream())]
    assert clock.now - 10**9 == pytest.approx((times[-1] - times[0]) / speed, rel=1e-9)


def test_no_empty_track_is_written_and_what_a_recording_lacks_is_noted(replay, tmp_path, recording):
    (tmp_path / "imu9.toml").write_text(FORMAT, encoding="utf-8")
    (tmp_path / "s.toml").write_text(SESSION.split("[estimate]")[0], encoding="utf-8")
    _, (line,) = replay("--session", tmp_path / "s.toml", "--out", tmp_path / "t.parquet", code=1)
    assert "nothing was estimated, so there is no track to write" in line
    assert not (tmp_path / "t.parquet").exists()
    data = bytearray(recording[0].read_bytes())
    middle = len(data) // 2
    data[middle : middle + 1500] = bytes(1500)
    (tmp_path / "hurt.mcap").write_bytes(data)
    out, notes = replay("--json", path=tmp_path / "hurt.mcap")
    assert json.loads(out)["samples"] < 2000
    assert any("of raw missing" in note for note in notes)


def run_report(**changes):
    """A report without a fault."""
    time = {"rate": 199.99, "mode": "clock", "lost": 0, "gap_count": 0, "drift_ppm": -12.34} | changes.pop("time", {})
    counts = dict.fromkeys(("junk", "bad_checksum", "bad_content", "bad_length", "unknown"), 0)
    counts |= {"received": 6000, "framed": 6000} | changes.pop("bytes", {})
    given = {"samples": 200, "duration_s": 60.0, "not_usable": 0, "calibration": None,
             "notes": [], "unchecked_bytes": None}  # fmt: skip
    stage = dict.fromkeys(("filter", "frame", "north", "declination_deg"))
    return {"time": time, "bytes": counts} | stage | given | changes


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({}, "samples      200 in 60.000 s, rate 199.99 Hz by clock"),
        ({"time": {"rate": None, "mode": "host"}}, "samples      200 in 60.000 s, rate unknown by host"),
        ({"bytes": {"framed": 5970, "junk": 30}}, "bytes        6000, of frames 5970, junk 30"),
        ({"bytes": {"bad_checksum": 2, "unknown": 1}}, "rejected     bad checksum 2, unknown 1"),
        ({"time": {"lost": 3, "gap_count": 2}}, "lost         3 frames in 2 gaps; 0 repeated or late"),
        ({"not_usable": 4}, "lost         0 frames in 0 gaps; 4 repeated or late"),
        ({"notes": [{"text": "inferred gaps: 1 gap"}]}, "note         inferred gaps: 1 gap"),
        ({}, "device clock -12.3 ppm against this host"),
        ({"unchecked_bytes": 6}, f"checks       {UNCHECKED.format(6)}"),
        ({"filter": "mahony(kp=1)"}, "filter       mahony(kp=1)"),
        ({"north": "free", "frame": "ENU"}, "frame        ENU, heading from an arbitrary zero"),
        (
            {"north": "true", "frame": "NED", "declination_deg": -4.1239},
            "frame        NED, heading from true north (declination -4.124°)",
        ),
    ],
)
def test_every_line_of_a_report(changes, line):
    assert line in report_lines(run_report(**changes), "level")


def test_what_is_not_known_or_did_not_happen_is_not_told():
    q = quat_from_euler_zyx(np.radians([[1.0, 2.0, 3.0], [-40.0, 25.0, 170.0]]))
    shown = [live_attitude(SimpleNamespace(q_nb=q, frame=Frame.NED)), live_attitude(None)]  # the last one
    assert shown == ["roll 170.00°, pitch 25.00°, yaw -40.00°", ""]
    names = {line[:12].strip() for line in report_lines(run_report(), "level")}
    assert names == {"samples", "bytes", "device clock", "calibration"}
    for changes in ({"duration_s": 59.9}, {"time": {"mode": "host"}}, {"time": {"drift_ppm": None}}):
        assert names - {line[:12].strip() for line in report_lines(run_report(**changes), "level")} == {"device clock"}
