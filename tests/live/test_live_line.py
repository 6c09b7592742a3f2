"""Lines of frames: counted samples, repeats, what is inferred, and a line that starts again."""

import errno
import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import plumbob
from plumbob import ImuData, Recording, find_format, flags, replay
from plumbob.core.errors import ClockError, DecodeError, ParameterError, UnitError
from plumbob.core.event import Event
from plumbob.data import ImuMeta, imu, plausibility
from plumbob.data.cards import CalibrationCard, TriadCalibration
from plumbob.files import parquet, read
from plumbob.files.mcap import open_log, repair, verify, writer
from plumbob.filters import offline
from plumbob.filters.offline import run_stage
from plumbob.filters.smoother import samples
from plumbob.live.recorded import convert, read_recorded
from plumbob.live.runner import Watch, report_lines, run_report, run_stream
from plumbob.live.session import OutputSpec, RecordSpec
from plumbob.live.sinks import Collected, RecordingSink, named_at
from plumbob.live.stream import Stream, time_spec
from plumbob.live.transports.transport import Received
from plumbob.protocols.decode import values_by_field
from plumbob.protocols.encode import encode
from tests.helpers import full_disk, live_samples
from tests.helpers.commandline import ok
from tests.helpers.live_samples import (
    FORMAT,
    OFFSET,
    RATE,
    SESSION,
    Handed,
    form,
    motion,
    reads,
    session,
    stream,
    through,
)
from tests.helpers.motion import noisy


def test_samples_are_the_simulated_ones_within_half_a_count_and_the_attitude_is_the_batch_one_to_the_bit():
    _, found = through(reads(stream()))
    imu, truth = found.imu(calibrated=True), motion().imu
    assert len(imu) == len(truth)
    np.testing.assert_array_equal(imu.t_ns, truth.t_ns // 1000 * 1000)  # the device clock counts µs
    half_gyr, half_acc, half_mag = np.radians(0.5 / 65.5), 0.5 / 8192 * 9.80665, 0.5 / 10  # half a count each
    np.testing.assert_allclose(imu.gyr, truth.gyr, rtol=0, atol=half_gyr * 1.0001)
    np.testing.assert_allclose(imu.acc, truth.acc, rtol=0, atol=half_acc * 1.0001)
    np.testing.assert_allclose(imu.mag, truth.mag, rtol=0, atol=half_mag * 1.0001)
    line, found = through(reads(stream()))
    live = found.track()
    batch = run_stage(found.imu(calibrated=True), line.session.stage, frame=line.session.frame)
    np.testing.assert_array_equal(live.q_nb, batch.q_nb)
    np.testing.assert_array_equal(live.flags, batch.flags)
    _, other = through(reads(stream(), seed=1))
    np.testing.assert_array_equal(live.q_nb, other.track().q_nb)
    np.testing.assert_array_equal(np.diff(found.t_ns), np.diff(other.t_ns))


def test_lost_frames_leave_a_hole_in_time_and_a_flag():
    data = stream()
    line, found = through(reads(data[: 30 * 400] + data[30 * 440 :]))
    imu = found.imu(calibrated=True)
    assert len(imu) == len(motion().imu) - 40
    hole = int(np.argmax(np.diff(imu.t)))
    assert np.diff(imu.t)[hole] == pytest.approx(41 / RATE, abs=1e-6)  # 40 frames are missing between two
    assert imu.flags[hole + 1] & flags.GAP
    assert line.report()["time"]["lost"] == 40


def test_line_that_is_pulled_and_plugged_goes_on_behind_a_gap():
    data = stream()
    early, late = reads(data[: 30 * 600 + 13]), reads(data[30 * 1000 :])
    gone = early[-1].t_ns
    back = gone + 400 * 5_000_000
    late = [Received(item.t_ns + back - late[0].t_ns, item.data) for item in late]
    events = [Event(gone, "lost", "unplugged"), Event(back, "reopened", "plugged in")]
    line, found = through([*early, *events, *late])
    track = found.track()
    assert [event.kind for event in found.events] == ["lost", "reopened"]
    assert line.decoder.counts.junk == 13  # the frame that was cut
    assert (np.diff(found.t_ns) > 0).all()
    assert track.flags[600] & flags.GAP
    assert np.isfinite(track.q_nb).all()


def test_junk_is_counted_and_never_becomes_a_sample_and_bytes_that_wait_are_reported():
    data = bytes(np.random.default_rng(4).integers(0, 256, 20_000, dtype=np.uint8))
    line, found = through(reads(data))
    assert not found.parts
    assert line.decoder.counts.junk == line.decoder.counts.received == 20_000
    assert line.report()["bytes"]["junk"] == 20_000
    line = Stream(session())
    assert line.decoder.counts.received == 0
    assert line.t0_ns is None
    line.feed(Received(0, stream()[:40]))
    report = line.report()["bytes"]
    assert (report["received"], report["framed"], report["pending"]) == (40, 30, 10)


def test_time_comes_from_the_device_clock_where_there_is_one():
    spec = time_spec(form(), form().message())
    assert (spec.mode, spec.clock.tick, spec.clock.bits, spec.frames.bits, spec.rate) == ("clock", 1000, 32, 16, 200.0)
    ahrs = find_format("ahrs400").bind({"rr": "200", "gr": "4"})
    spec = time_spec(ahrs, ahrs.message())
    assert (spec.clock.down, spec.clock.tick, spec.clock.bits) == (True, 790, 16)  # 0.79 µs, counting down, [V1] fdas3


def test_full_disk_stops_the_recording_and_not_the_filter(tmp_path, monkeypatch):
    """From some chunk on the system has no room; the line goes on, and says so once."""
    chosen, found = session(), Collected()
    recording_sink = RecordingSink(chosen, RecordSpec(str(tmp_path / "a.mcap")))
    real, sizes = writer.write_all, []

    def limited(fd, data, offset):
        sizes.append(len(data))
        if sum(sizes) > 20_000:
            raise OSError(errno.ENOSPC, "No space left on device")
        real(fd, data, offset)

    monkeypatch.setattr(writer, "write_all", limited)
    run_stream(Stream(chosen), Handed(reads(stream())), sinks=[found], recording=recording_sink)
    assert len(found.imu(calibrated=True)) == len(motion().imu)
    assert [e.kind for e in found.events].count("stopped") == 1
    assert 0 < recording_sink.recorder.acknowledged < recording_sink.recorder.written
    monkeypatch.undo()
    told = verify(tmp_path / "a.mcap")
    assert sum(told.rows.values()) >= recording_sink.recorder.acknowledged


def test_card_that_needs_a_temperature_survives_one_that_is_missing(tmp_path):
    """The last known one stands in; before any, samples are absent instead of an error."""
    warm = TriadCalibration(np.eye(3), np.zeros(3), "rad/s", "rad/s", bias_per_k=np.full(3, 0.01))
    CalibrationCard("bench 7", "2026-01-01", "made up", gyr=warm).save(tmp_path / "c.json")
    text = SESSION + '[calibration]\ncard = "c.json"\n'
    files = {"c.json": (tmp_path / "c.json").read_text(), "imu9.toml": FORMAT + "overflow = [-32768]\n"}
    made = motion(0.1)
    temps = np.full(len(made.imu), 35.0)
    temps[:3] = temps[7] = np.nan
    clock = made.imu.t_ns // 1000
    chosen = session(text, **files)
    columns = {**values_by_field(made.imu, chosen.form.message()), "temp_c": temps, "clock": clock}
    data = encode(chosen.form, columns).tobytes()
    _, found = through([Received(i * 5_000_000, data[30 * i : 30 * i + 30]) for i in range(len(temps))], chosen)
    imu = np.concatenate([part.imu.gyr for part in found.parts])
    raw = np.concatenate([part.sensed.gyr for part in found.parts])
    assert np.isnan(imu[:3]).all()
    np.testing.assert_allclose(imu[3:], raw[3:] - 0.01 * (35.0 - 25.0), rtol=0, atol=1e-12)


SERIAL = '[source]\nkind = "serial"\nport = "/dev/null"\nbaud = 115200\nspeed = 60\n'
COUNTED = SESSION + SERIAL + 'time = "count"\n'
BARE = FORMAT.replace('role = "counter"', 'role = "status"').replace('role = "clock"\nunit = "us"', 'role = "status"')
"""The same frame with nothing that its line could tell time by."""


def through_counter(items, text=COUNTED, form=FORMAT):
    return live_samples.through(items, session(text, **{"imu9.toml": form}))


def stalling(data, seed):
    """Reads of any length at any time: a host that stalls for seconds of sixty each, and a line that bursts."""
    rng = np.random.default_rng(seed)
    items, at, t_ns = [], 0, 7_000_000_000
    while at < len(data):
        end = at + int(rng.choice([1, 29, 150, 4096, 9000]))
        t_ns += int(rng.choice([0, 10**6, 10**8, 10**10, 10**11]))
        items.append(Received(t_ns, data[at:end]))
        at = end
    return items


@pytest.mark.parametrize("form", [FORMAT, BARE], ids=["clock and counter", "neither"])
def test_no_stall_of_the_host_changes_a_bit(form):
    quiet, stalled = (through_counter(items, form=form) for items in (reads(stream()), stalling(stream(), 0)))
    truth = motion().imu
    for line, found in (quiet, stalled):
        assert found.t_ns.size == len(truth)
        np.testing.assert_array_equal(found.t_ns - found.t_ns[0], truth.t_ns)  # 5 ms are whole microseconds
        assert not (found.imu(calibrated=False).flags & np.uint32(flags.GAP | flags.TIME_FAULT)).any()
        assert (line.report()["time"]["mode"], line.time.report().inferred) == ("count", 0)
    np.testing.assert_array_equal(stalled[1].track().q_nb, quiet[1].track().q_nb)


def test_by_the_host_the_same_stalls_are_seconds_of_sea():
    """What counting is for: the same reads, led to the host, are minutes instead of ten seconds."""
    line, found = through_counter(stalling(stream(), 0), text=SESSION + SERIAL, form=BARE)
    assert line.time.report().inferred > 0
    assert found.t_ns[-1] - found.t_ns[0] > 60e9


@pytest.mark.parametrize("form", [FORMAT, BARE], ids=["clock and counter", "neither"])
def test_damaged_frames_keep_their_time(form):
    data = bytearray(stream())
    for k in (300, 301, 700):
        data[30 * k + 12] ^= 1
    line, found = through_counter(stalling(bytes(data), 1), form=form)
    np.testing.assert_array_equal(found.t_ns - found.t_ns[0], np.delete(motion().imu.t_ns, [300, 301, 700]))
    assert np.flatnonzero(found.imu(calibrated=False).flags & np.uint32(flags.GAP)).tolist() == [300, 698]
    assert (line.time.report().lost, line.time.report().inferred) == (3, 0)


@pytest.mark.parametrize("kind", ["dropped", "lost"])
def test_what_the_line_itself_lost_is_a_gap(kind):
    """Bytes are gone, and nothing in the frames says how long that was."""
    items = [Received(10**9, stream()[:3000]), Event(10**9, kind, "gone"), Received(2 * 10**9, stream()[6000:9000])]
    items[2:2] = [Event(10**9, "reopened", "back")] if kind == "lost" else []
    _, found = through_counter(items, form=BARE)
    assert np.flatnonzero(found.imu(calibrated=False).flags & np.uint32(flags.GAP)).tolist() == [100]
    assert (np.diff(found.t_ns) > 0).all()


def test_a_rate_may_stand_beside_the_port_and_datagrams_cannot_be_counted():
    bare = BARE.replace('rate = "200 Hz"\n', "")
    _, found = through_counter(reads(stream()), text=COUNTED + 'rate = "200 Hz"\n', form=bare)
    np.testing.assert_array_equal(found.t_ns - found.t_ns[0], motion().imu.t_ns)
    with pytest.raises(ParameterError, match=r"neither a clock nor a rate to count time by; give source\.rate"):
        session(COUNTED, **{"imu9.toml": bare})
    with pytest.raises(DecodeError, match="no key 'time'"):
        session(SESSION + '[source]\nkind = "udp"\nport = 4000\ntime = "count"\n')


FRAME, AT = 30, 900
COUNTED_SERIAL = '[source]\nkind = "serial"\nport = "/dev/null"\nbaud = 115200\ntime = "count"\n'


def through_serial(data, text=SESSION):
    return live_samples.through(reads(data), session(text))


@pytest.fixture(scope="module", params=[SESSION, SESSION + COUNTED_SERIAL], ids=["by the host", "counted"])
def once(request):
    return request.param, through_serial(stream(), request.param)[1]


def twice(count):
    data, block = stream(), slice(FRAME * AT, FRAME * (AT + count))
    return data[: block.stop] + data[block] + data[block.stop :]


@pytest.mark.parametrize("count", [2, 5, 50])
def test_a_block_that_comes_again_is_left_out(once, count):
    text, single = once
    line, found = through_serial(twice(count), text)
    imu, clean = found.imu(calibrated=False), single.imu(calibrated=False)
    assert len(imu) == len(clean) == 2000
    np.testing.assert_array_equal(imu.gyr, clean.gyr)
    np.testing.assert_array_equal(np.diff(found.t_ns), np.diff(single.t_ns))
    assert not (imu.flags & np.uint32(flags.GAP | flags.TIME_FAULT)).any()
    np.testing.assert_array_equal(found.track().q_nb, single.track().q_nb)
    time = line.time_report()
    assert (time.frames, time.duplicates, time.late, time.resets) == (2000 + count, count, 0, 0)
    assert line.report()["not_usable"] == count


def test_a_device_that_begins_again_is_not_a_block_sent_twice():
    """The counter and the clock go back, and the values are others."""
    data = stream()
    line, found = through_serial(data[FRAME * 1000 :] + data[: FRAME * 1000])
    assert line.time_report().resets == 1
    assert len(found.imu(calibrated=False)) > 1990


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
    back = plumbob.read(tmp_path / f"out{suffix}").notes
    assert [other for other in back if other.code.startswith("reading.inferred")] == [note]


@pytest.mark.parametrize("gone", [0, 100], ids=["whole", "half a second gone"])
def test_gaps_that_the_device_s_counts_show_are_not_inferred(tmp_path, gone):
    report = kept(tmp_path / "a.mcap", gone=gone)
    assert report["time"]["lost"] == gone
    assert report["notes"] == []
    assert not any(note.code.startswith("reading.") for note in read_recorded(tmp_path / "a.mcap").notes)


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


GYR = TriadCalibration(np.eye(3) * 1.01, np.full(3, 1e-3), "rad/s", "rad/s", g_sensitivity=np.full((3, 3), 1e-4))
CARD = CalibrationCard("unknown", "2026-01-01", "a test", gyr=GYR)


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Stretches, chunks, blocks and row groups of other sizes, so that all their borders differ."""
    monkeypatch.setattr("plumbob.filters.smoother.live.MARGIN", 2.0)  # first: what is imported later would keep it
    monkeypatch.setattr("plumbob.filters.smoother.smoothing.AT_ONCE", 700)
    for module, name, value in (
        *((samples, "LONG", 12.0), (samples, "CORE", 6.0), (samples, "MARGIN", 2.0), (offline, "CHUNK", 700)),
        *((imu, "BLOCK", 333), (plausibility, "BLOCK", 333), (parquet, "GROUP", 400), (parquet, "ALIKE", 3)),
    ):
        monkeypatch.setattr(module, name, value)


def sea(n=4000):
    """Forty seconds: a gap that begins at a row group's border, one within, a stuck magnetometer, values at the end of
    the range and impossible ones, a slow magnetometer, and flags that the source knew.
    """
    one = noisy(n, seed=5)
    t = one.t.copy()
    t[400:] += 0.7
    t[2111:] += 3.0
    gyr, acc, mag = one.gyr.copy(), one.acc.copy(), one.mag.copy()
    gyr[900:904], acc[1200, 1], mag[3000:3150], mag[::3] = 40.0, np.inf, mag[3000], np.nan
    known = np.zeros(n, dtype=np.uint32)
    known[50] = flags.TIME_FAULT
    return ImuData(
        t=t, gyr=gyr, acc=acc, mag=mag, flags=known, temp_c=np.linspace(20.0, 30.0, n), meta=ImuMeta(gyr_range=40.0)
    )


@pytest.fixture
def file(tmp_path):
    return plumbob.write(tmp_path / "sea.parquet", sea())


def numbers(track):
    return [None if a is None else a.tobytes() for a in (track.t, track.q_nb, track.bias_b, track.cov_b, track.flags)]


@pytest.mark.parametrize(
    "how", [{}, {"lag": "2 s"}, {"causal": True}, {"filter": "mahony"}, {"calibration": CARD}], ids=str
)
def test_to_a_file_it_is_the_estimate_in_memory(file, how, tmp_path):
    """To the bit, with the same notes, report and card; and the file is the one that is written of the whole."""
    whole = plumbob.estimate(file, frame="ENU", **how)
    done = []
    pieces = plumbob.estimate(file, frame="ENU", out=tmp_path / "a.parquet", progress=lambda *n: done.append(n), **how)
    assert numbers(pieces.track) == numbers(whole.track)
    assert pieces.notes == whole.notes
    assert pieces.summary() == whole.summary()
    assert pieces.text() == whole.text()
    assert how or pieces.card().text() == whole.card().text()
    assert (done[-1], len(done) > 4) == ((4000, 4000), True)
    whole.save(tmp_path / "b.parquet")
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()
    # what `sea` was given is found: else the comparisons above compare nothing
    for topic in ("clipped: gyr", "invalid: acc", "gaps: samples are missing before 2 of 4000", "stuck: mag"):
        assert any(topic in str(note) for note in whole.notes)


@pytest.mark.parametrize("suffix", [".parquet", ".csv"])
def test_what_is_in_memory_is_written_too(tmp_path, suffix):
    imu = sea()[:1500]
    result = plumbob.estimate(imu, "mahony", frame="ENU", out=tmp_path / f"a{suffix}")
    again = plumbob.estimate(imu, "mahony", frame="ENU").track
    for track in (result.track, plumbob.read(tmp_path / f"a{suffix}").track):
        assert track.q_nb == pytest.approx(again.q_nb, abs=1e-12)  # digits of a text


@pytest.mark.parametrize("error", [KeyboardInterrupt, SystemExit])
@pytest.mark.parametrize("lies", [False, True], ids=["new", "replaced"])
def test_an_interrupted_estimate_leaves_nothing(file, tmp_path, error, lies):
    """As SIGINT and SIGTERM come, while half is written: what lay there is as it was."""
    out = tmp_path / "a.parquet"
    if lies:
        out.write_bytes(b"old")

    def stop(done, total):
        if done > total // 2:
            raise error

    before = sorted(tmp_path.iterdir())
    with pytest.raises(error):
        plumbob.estimate(file, frame="ENU", out=out, overwrite=True, progress=stop)
    assert sorted(tmp_path.iterdir()) == before
    assert not lies or out.read_bytes() == b"old"


def test_a_full_disk_leaves_nothing(file, tmp_path):
    before = sorted(tmp_path.iterdir())
    match = r"a\.parquet cannot be written: .*Nothing was changed there"
    with full_disk(100_000), pytest.raises(DecodeError, match=match):  # the track has some 400 kB
        plumbob.estimate(file, "mekf", frame="ENU", out=tmp_path / "a.parquet")
    assert sorted(tmp_path.iterdir()) == before
    raw = bytearray(file.read_bytes())  # neither is anything left by a file that is refused before it is estimated
    with pytest.raises(plumbob.errors.ParameterError, match="exists already"):
        plumbob.estimate(file, "mahony", frame="ENU", out=file)
    assert file.read_bytes() == raw
    raw[len(raw) // 3] ^= 16
    file.write_bytes(raw)
    with pytest.raises(DecodeError, match=r"sea\.parquet: .*use an intact copy"):
        plumbob.estimate(file, frame="ENU", out=tmp_path / "a.parquet")
    assert sorted(tmp_path.iterdir()) == before


def held(imu):
    values = (imu.t, imu.gyr, imu.acc, imu.mag, imu.temp_c, imu.flags)
    return [None if a is None else a.tobytes() for a in values], imu.meta, imu.triads, len(imu)


def test_samples_that_stay_are_those_that_are_read(tmp_path):
    """More rows than are read at once."""
    file = plumbob.write(tmp_path / "sea.parquet", sea(66_000))
    whole, stays = read(file), read(file, whole=False)
    assert isinstance(stays.imu, parquet.Stored)
    assert held(stays.imu) == held(whole.imu)
    assert stays.notes == whole.notes
    rng = np.random.default_rng(1)
    for _ in range(10):  # forward and back
        low, high = np.sort(rng.choice(66_001, 2, replace=False))
        assert held(stays.imu[low:high]) == held(whole.imu[low:high])


def test_an_attitude_beside_the_samples_brings_both_to_memory(tmp_path):
    imu = sea()[:900]
    both = Recording(imu=imu, track=plumbob.estimate(imu, "mahony", frame="ENU").track)
    plumbob.write(tmp_path / "a.parquet", both)
    assert type(read(tmp_path / "a.parquet", whole=False).imu) is ImuData
    result = plumbob.estimate(tmp_path / "a.parquet", frame="ENU", out=tmp_path / "b.parquet")
    assert numbers(plumbob.read(tmp_path / "b.parquet").track) == numbers(result.track)


@pytest.mark.parametrize(("change", "error"), [
    (lambda c: c["t_ns"].__setitem__(1700, c["t_ns"][1699]), ClockError),
    (lambda c: c["acc_x"].__imul__(50.0), UnitError),
    (lambda c: c["gyr_y"].__setitem__(slice(None), 1e4), UnitError),
    (lambda c: [c[f"mag_{i}"].__setitem__(slice(None), np.nan) for i in "xyz"], plumbob.errors.ShapeError),
], ids=["time", "acc", "gyr", "mag"])  # fmt: skip
def test_the_whole_is_refused_in_the_same_words(tmp_path, monkeypatch, change, error):
    """A file with other columns, and a checksum that fits them."""
    to_columns, said = parquet.layout.to_columns, []

    def damaged(recording):
        columns = to_columns(recording)
        change(columns)
        return columns

    monkeypatch.setattr(parquet.layout, "to_columns", damaged)
    file = plumbob.write(tmp_path / "damaged.parquet", replace(sea(), meta=ImuMeta()))
    for whole in (True, False):
        with pytest.raises(error) as caught:
            read(file, whole=whole)
        said.append(str(caught.value))
    assert said[0] == said[1]


# ru_maxrss would not do: a child inherits that of the process that started it.
PEAK = """
import sys
from pathlib import Path
import pyarrow.parquet
from plumbob.cli.main import main
from plumbob.filters.smoother import Smoother
def most():
    return float(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0]) / 1024
libraries = most()
assert main(sys.argv[1:]) == 0
print(most() - libraries)
"""


def repeated(path, times, n=360_000):
    """An hour's samples at 100 Hz, again and again; their steps are uneven, so that they take a quarter longer."""
    one = noisy(n, seed=2)
    lasts = one.t[-1] + 0.01
    plumbob.files.parquet.write_parquet(
        path, (Recording(imu=replace(one, t=one.t + lasts * k)) for k in range(times)), overwrite=True
    )


@pytest.mark.long(reason="seven hours at 100 Hz are smoothed, 60 s")
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="only Linux says what a process took at most")
def test_memory_does_not_grow_with_the_recording(tmp_path, monkeypatch):
    """One, two and four hours; the whole, and its track, would take 90 MB an hour. The first call compiles kernels."""
    monkeypatch.undo()
    peak = []
    for hours in (1, 2, 4):
        repeated(tmp_path / "long.parquet", hours)
        words = ["run", tmp_path / "long.parquet", "--frame", "ENU", "--out", tmp_path / "track.parquet", "--force"]
        done = subprocess.run(
            [sys.executable, "-c", PEAK, *map(str, words)], check=False, capture_output=True, text=True, env=os.environ
        )
        assert done.returncode == 0, done.stderr
        peak.append(float(done.stdout.splitlines()[-1]))
        assert len(plumbob.read(tmp_path / "track.parquet").track) == hours * 360_000
    assert peak[2] < peak[1] + 15.0, peak
    assert peak[2] < 150.0, peak
