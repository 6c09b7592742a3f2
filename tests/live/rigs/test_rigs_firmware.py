"""The buoy's own program: events, fusion, frames outward, and its log."""

from dataclasses import replace

import numpy as np
import pytest

from plumbob import Filter, Frame, ImuData, decode, find_format, read
from plumbob.live.rigs.firmware import FirmwareTask, FlashLog, Processor, decoded, poll, run_firmware
from plumbob.live.rigs.rig import PLANS, make_rig
from plumbob.protocols.encode import encode
from plumbob.protocols.ring import read_ring
from plumbob.rotations import North, quat_angle
from plumbob.simulation import scenario
from tests.helpers import beside
from tests.helpers.commandline import ok, refused

FORM = find_format("buoy_attitude")
PLAN = PLANS["buoy_attitude"]


@pytest.fixture(scope="module")
def rig():
    return make_rig(PLAN, FORM, seed=3, duration=30.0, unit="calibrated")


@pytest.fixture(scope="module")
def imu(rig):
    return rig.units[""].imu


@pytest.fixture(scope="module")
def plain(imu):
    return run_firmware(imu)


def off(track, truth):
    """Error, °, at the times of a track, against the truth of the newest millisecond."""
    row = np.searchsorted(truth.t, track.t, side="right") - 1
    return np.degrees(quat_angle(track.q_nb, truth.q_nb[row]))


def test_events_come_at_the_papers_rates_and_the_processor_is_idle_for_what_they_leave(plain):
    """333⅓, 100 and 20 a second [Yu2018]; the last of 30 s, at 29.999 s, is that at 29.997, 29.99 and 29.95 s."""
    assert plain.served == {"sample": 9999, "fuse": 2999, "send": 599}
    assert plain.missed == {"sample": 0, "fuse": 0, "send": 0}
    # 23 bytes at 1 MHz, 45 000 and 15 000 cycles at 25 MHz, and 260 bytes at 8 MHz after each eighth frame.
    busy = 9999 * 184e-6 + 2999 * 1.8e-3 + 599 * 0.6e-3 + 599 // 8 * 260e-6
    assert plain.idle == pytest.approx(1.0 - busy / 29.999, abs=1e-6)
    assert plain.idle > 0.7


def test_samples_are_taken_at_3_ms_or_late_where_the_loop_is_busy_and_a_field_of_75_hz_once(imu, plain):
    late = plain.samples.t - np.arange(3, 30000, 3) * 1e-3
    assert late.min() > -1e-9
    assert late.max() == pytest.approx(0.8e-3, abs=1e-9)  # 21 ms, in a fusion of 1.8 ms that began at 20 ms
    row = np.searchsorted(imu.t, plain.samples.t + 1e-9, side="right") - 1
    assert np.array_equal(plain.samples.gyr, imu.gyr[row])
    fresh = np.flatnonzero(~np.isnan(imu.mag[:, 0]))
    read_ = plain.samples.mag[~np.isnan(plain.samples.mag[:, 0])]
    assert np.array_equal(read_, imu.mag[fresh][: len(read_)])
    assert len(read_) == pytest.approx(75.0 * 30.0, abs=2)


def test_each_sample_is_in_one_fusion(plain):
    """The mean of the rates, times the time since the last fusion, adds up to the turn of all samples."""
    dt = np.diff(plain.fused.t, prepend=0.0)
    turn = np.sum(plain.fused.gyr * dt[:, np.newaxis], axis=0)
    count = np.searchsorted(plain.samples.t, plain.fused.t[-1] + 1e-9)
    # Late samples shift by 0.8 ms at most, so that the weights of neighbours differ.
    assert turn == pytest.approx(0.003 * plain.samples.gyr[:count].sum(axis=0), abs=2e-3)
    assert dt[5:15].sum() == pytest.approx(0.1, abs=0.003)


def test_the_frames_say_what_the_filter_found(plain):
    """Half a count of 180°/32768 on three angles."""
    track = Filter("mahony", frame=Frame.NED).process(plain.fused, look=False)
    row = np.searchsorted(track.t, plain.track.t + 1e-7) - 1
    assert np.abs(track.t[row] - plain.track.t).max() < 1e-6
    error = np.degrees(quat_angle(track.q_nb[row], plain.track.q_nb))
    assert error.max() < 3.0 * 0.5 * 180.0 / 32768
    assert plain.track.north is North.MAGNETIC
    assert len(plain.frames) == 599 * 32


def test_the_attitude_is_that_of_the_buoy(rig, plain):
    """With the paper's gains in waves: 0.85, 0.75, 0.29° rms in the prototype (reference/papers.md, 001)."""
    error = off(plain.track, rig.units[""].truth)
    assert np.sqrt(np.mean(error[100:] ** 2)) < 2.0


def test_a_loop_that_waits_for_the_line_or_the_chip_or_has_a_slow_clock_misses_deadlines(imu):
    """At 100 ms fusion, then 0.6 ms and a frame of 2.78 ms: the flag of 102 ms is served behind 105 ms."""
    done = run_firmware(imu, processor=Processor(uart_waits=True))
    assert done.missed["sample"] == 29_999 // 150 + (29_999 % 150 > 105)
    assert done.missed["fuse"] == done.missed["send"] == 0
    said = decode(done.frames, FORM).frames["buoy_attitude"].columns
    assert said["deadline_missed"].sum() == pytest.approx(done.missed["sample"], abs=1)
    assert abs(int(said["missed"][-1]) - done.missed["sample"] % 256) <= 1
    # 128 records fill a sector: an erasure of 45 ms at 6.4 s, … 25.6 s.
    done = run_firmware(imu, processor=Processor(flash_waits=True))
    assert done.missed["sample"] == pytest.approx(4 * 45 / 3, abs=8)
    assert done.missed["fuse"] == pytest.approx(4 * 3.5, abs=4)
    assert done.latest["sample"] == pytest.approx(45e-3, abs=3e-3)
    assert np.diff(done.fused.t).max() == pytest.approx(45e-3, abs=8e-3)
    idle = [run_firmware(imu[:6000], processor=Processor(clock_hz=hz)).idle for hz in (25e6, 16e6, 8e6)]
    assert idle == sorted(idle, reverse=True)
    assert run_firmware(imu[:6000], processor=Processor(clock_hz=8e6)).missed["sample"] > 0


def test_the_log_holds_the_frames_that_went_out(plain):
    found = read_ring(plain.flash.image, FORM)
    assert found.stream == plain.frames[: 599 // 8 * 8 * 32]
    assert plain.flash.waiting == 599 % 8
    assert np.array_equal(decoded(found.stream).q_nb, plain.track.q_nb[: 599 // 8 * 8])


def test_a_full_log_is_said_and_a_second_run_goes_on_with_its_numbers(imu):
    log = FlashLog(size=2 * 4096)
    first = decode(run_firmware(imu, log=log).frames, FORM).frames["buoy_attitude"].columns
    assert np.flatnonzero(first["log_full"])[0] == 256
    second = decode(run_firmware(imu[:2000], log=log).frames, FORM).frames["buoy_attitude"].columns
    assert second["counter"][0] == 599
    assert second["log_full"].all()


def test_the_processors_card_is_applied_and_said():
    rig = make_rig(PLAN, FORM, seed=5, duration=10.0)
    raw = decode(rig.firmware.frames, FORM).frames["buoy_attitude"].columns
    done = make_rig(PLAN, FORM, seed=5, duration=10.0, calibration=rig.units[""].calibration)
    said = decode(done.stream(), FORM).frames["buoy_attitude"].columns
    assert not raw["calibrated"].any()
    assert said["calibrated"].all()
    truth = rig.units[""].truth
    assert np.median(off(done.firmware.track, truth)[100:]) < 0.3 * np.median(off(rig.firmware.track, truth)[100:])


def test_a_buoy_at_rest_says_its_rates_and_force():
    still = make_rig(replace(PLAN, scenario=scenario("static")), FORM, seed=1, duration=5.0, unit="calibrated")
    said = decode(still.stream(), FORM).frames["buoy_attitude"].columns
    # 400 µg/√Hz at 1 kHz are 0.088 m/s² a sample, and a mean of 16 has 0.022; 99 frames stay within 5 sd.
    assert np.abs(said["acc.z"] + 9.80665).max() < 0.11
    assert max(np.abs(said[f"gyr.{axis}"]).max() for axis in "xyz") < np.radians(0.3)


def test_faults_of_the_line_are_those_of_any_rig(rig):
    hurt = make_rig(PLAN, FORM, seed=3, duration=30.0, unit="calibrated", faults={"flip": 0.1, "jump": 0.01})
    counts = decode(hurt.stream(), FORM).counts
    flipped = sum(one.kind == "flip" for one in hurt.faults)
    assert counts.frames["buoy_attitude"] == len(hurt) - flipped
    assert hurt.firmware.frames == rig.firmware.frames


def test_what_its_sensors_are_is_what_it_computes_from(rig):
    """A gyroscope behind a high-pass says no steady rate; the chips are sampled at 1 kHz all the same."""
    other = make_rig(PLAN, FORM, seed=3, duration=5.0, unit="calibrated", high_pass=0.5)
    assert other.units[""].imu.meta.rate_nominal == rig.units[""].imu.meta.rate_nominal == 1000.0
    assert other.frames.shape == (99, 32)
    assert not np.array_equal(other.frames, rig.frames[:99])


def test_a_coarse_recording_is_fused_where_it_has_something_new():
    """At 100 Hz, of three or four reads one is new."""
    t = np.arange(500) / 100.0
    gyr = np.tile([0.0, 0.0, 0.1], (500, 1))
    acc = np.tile([0.0, 0.0, -9.80665], (500, 1))
    done = run_firmware(ImuData(t=t, gyr=gyr, acc=acc))
    assert done.served["sample"] == 1663
    assert np.isnan(done.samples.gyr[:, 2]).sum() == pytest.approx(1663 - 499, abs=2)
    assert np.abs(done.track.roll).max() < 1e-3


SESSION = beside(__file__, "said.session.toml")


def test_on_the_command_line_it_is_a_rig_with_a_log_and_records_like_an_ahrs(tmp_path):
    words = ("--seed", "3", "--duration", "10s", "--flash-log", "flash.bin", "--write", "said.bin")
    done = ok("emulate", "buoy_attitude", "--truth", "truth.parquet", *words, cwd=tmp_path)
    assert "send 199 served, 0 missed" in done.stderr
    table = ok("decode", "flash.bin", "--format", "buoy_attitude", "--ring", cwd=tmp_path)
    assert "192 records, 0 missing" in table.stderr
    assert len(table.stdout.splitlines()) == 193
    (tmp_path / "logger.toml").write_text(SESSION)
    ok("record", "logger.toml", cwd=tmp_path)
    recording = read(tmp_path / "said.mcap")
    assert len(recording.imu) == 199
    assert recording.track is not None
    want = decoded((tmp_path / "said.bin").read_bytes())
    assert np.degrees(quat_angle(recording.track.q_nb, want.q_nb)).max() < 1e-9
    ok("emulate", "buoy_attitude", "--calibration", "truth.card.json", *words, "--force", cwd=tmp_path)
    assert "no Flash log" in refused("emulate", "buoy", "--duration", "5s", *words[4:], "--force", cwd=tmp_path)
    assert "leave --rate out" in refused("emulate", "buoy_attitude", "--rate", "50Hz", "--write", "b.bin", cwd=tmp_path)


MS = 1_000_000


def polled(*tasks, ms):
    return poll([FirmwareTask(name, every, (takes,)) for name, every, takes in tasks], ms * MS)


def test_a_task_that_fits_is_served_at_each_event_and_one_of_4_ms_misses_one_of_four_of_3_ms():
    """Events at 3, 6, … 999 ms: 333 in a second [Yu2018]."""
    calls = polled(("sample", 3, MS), ms=1000)["sample"]
    assert len(calls) == 333
    assert np.array_equal(calls.begun_ns, np.arange(3, 1000, 3) * MS)
    assert calls.missed_ns.size == 0
    assert not calls.late_ns.any()
    # It is served every 4 ms, and an event comes every 3 ms: of 1000 in 3 s, 750 are served.
    calls = polled(("sample", 3, 4 * MS), ms=3000)["sample"]
    assert (len(calls), calls.missed_ns.size) == (pytest.approx(750, abs=1), pytest.approx(250, abs=1))
    assert calls.late_ns.max() <= 3 * MS  # a flag waits for the rest of a call of 4 ms that began at a tick


def test_calls_do_not_overlap_none_begins_before_its_event_and_each_event_is_served_or_missed():
    calls = polled(("sample", 3, 184_000), ("fuse", 10, 1_800_000), ("send", 50, 3_400_000), ms=6000)
    begun = np.concatenate([one.begun_ns for one in calls.values()])
    done = np.concatenate([one.done_ns for one in calls.values()])[np.argsort(begun)]
    assert (np.sort(begun)[1:] >= done[:-1]).all()
    for one in calls.values():
        assert (one.late_ns >= 0).all()
    calls = polled(("sample", 3, 2 * MS), ("fuse", 10, 7 * MS), ms=9001)
    for name, every in (("sample", 3), ("fuse", 10)):
        one = calls[name]
        assert 0 <= 9000 // every - len(one) - one.missed_ns.size <= 1  # one may wait at the end
        assert (one.due_ns % (every * MS) == 0).all()


def test_a_long_call_costs_the_others_all_events_but_the_one_that_waits_and_durations_take_turns():
    """From 50 ms on 46 ms are taken: events of 3 ms at 51, 54, … 93: the first waits, 14 more are missed."""
    calls = poll([FirmwareTask("sample", 3, (0,)), FirmwareTask("send", 50, (46 * MS, 0))], 99 * MS)
    assert calls["sample"].missed_ns.tolist() == [t * MS for t in range(54, 97, 3)]
    assert calls["sample"].late_ns.max() == 45 * MS
    calls = poll([FirmwareTask("send", 50, (MS, 2 * MS, 3 * MS))], 301 * MS)["send"]
    assert ((calls.done_ns - calls.begun_ns) // MS).tolist() == [1, 2, 3, 1, 2, 3]


SECTOR = 4096 // 32  # records of 32 bytes in a sector of 4096


def records(count, first=0):
    numbers = first + np.arange(count)
    return encode(FORM, {"counter": numbers, "roll": np.linspace(-1.0, 1.0, count)})


def counters(stream):
    return decode(stream, FORM).frames[FORM.name].columns["counter"].astype(int)


def test_what_was_written_is_read_in_its_order():
    log = FlashLog(size=4 * 4096)
    log.write(records(200))
    found = read_ring(log.image, FORM)
    assert (found.records, found.missing, found.torn) == (200, 0, 0)
    assert found.stream == records(200).tobytes()
    assert found.blank == 4 * 4096 - 200 * 32
    assert (log.written, log.lost, log.waiting) == (200, 0, 0)
    assert log.erases.sum() == 1  # the sector behind the full one


@pytest.mark.parametrize("sectors", [2, 5])
@pytest.mark.parametrize("count", [10_000, 7 * SECTOR, 7 * SECTOR + 9])
def test_a_ring_loses_whole_sectors_and_keeps_the_newest(sectors, count):
    """After each full sector one is erased: of k full ones, k − (sectors − 1) are gone, or none."""
    log = FlashLog(size=sectors * 4096)
    log.write(records(count))
    written = count // 8 * 8  # a page holds 8
    full = written // SECTOR
    assert log.waiting == count - written
    assert log.lost == SECTOR * max(full - (sectors - 1), 0)
    assert log.written == written
    found = read_ring(log.image, FORM)
    assert found.records == written - log.lost
    assert found.missing == 0
    assert counters(found.stream).tolist() == list(range(log.lost, written))
    assert log.erases.tolist() == [(full - (i or sectors)) // sectors + 1 for i in range(sectors)]


def test_the_way_in_which_it_is_written_does_not_matter():
    whole, parts = FlashLog(size=3 * 4096), FlashLog(size=3 * 4096)
    rows = records(1000)
    whole.write(rows)
    for i in range(0, 1000, 7):
        parts.write(rows[i : i + 7].tobytes())
    assert whole.image == parts.image
    assert whole.erases.tolist() == parts.erases.tolist()


def test_wear_of_days_is_even():
    """Three days at 20 Hz into 1 MiB: 5 184 000 records, 40 500 sectors of 256, 158 rounds and a part."""
    log = FlashLog()
    rows = records(20 * 3600)
    for _ in range(72):
        log.write(rows)
    assert log.written == 5_184_000
    assert (log.erases.min(), log.erases.max()) == (40_500 // 256, 40_500 // 256 + 1)
    assert log.erases.sum() == 40_500


@pytest.mark.parametrize("programmed", [0, 1, 31, 32, 100, 5 * 32])
def test_power_loss_costs_the_page_in_hand_alone(programmed):
    """16 records lie in two pages, and some bytes of 5 in a third; what comes after the loss begins in a new page.

    Of the 5 the first whole ones are there, and a torn one fails its check.
    """
    torn = records(5, first=16).tobytes()[:programmed]
    begun = records(16).tobytes() + (torn.ljust(256, b"\xff") if torn else b"")
    found = read_ring((begun + records(8, first=21).tobytes()).ljust(2 * 4096, b"\xff"), FORM)
    kept = programmed // 32
    assert counters(found.stream).tolist() == [*range(16 + kept), *range(21, 29)]
    assert found.missing == 5 - kept
    assert (found.torn > 0) == (programmed % 32 > 0)
    assert found.torn <= programmed % 32  # a byte that is FF cannot be told from a blank one


def test_the_seam_is_found_where_the_counter_wraps():
    log = FlashLog(size=2 * 4096)
    log.write(records(24, first=(1 << 32) - 10))
    seam = counters(read_ring(log.image, FORM).stream)[[0, 9, 10, -1]]
    assert seam.tolist() == [(1 << 32) - 10, (1 << 32) - 1, 0, 13]
