"""The line: the same samples as the simulator made, whatever the cuts, and flagged where something is missing."""

import errno

import numpy as np
import pytest

from plumbob import find_format, flags
from plumbob.core.event import Event
from plumbob.data.cards import CalibrationCard, TriadCalibration
from plumbob.files.mcap import verify, writer
from plumbob.filters.offline import run_stage
from plumbob.live.runner import run_stream
from plumbob.live.session import RecordSpec
from plumbob.live.sinks import Collected, RecordingSink
from plumbob.live.stream import Stream, time_spec
from plumbob.live.transports.transport import Received
from plumbob.protocols.decode import values_by_field
from plumbob.protocols.encode import encode
from tests.helpers.live_samples import FORMAT, RATE, SESSION, Handed, form, motion, reads, session, stream, through


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
