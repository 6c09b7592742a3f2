"""IIO devices from the tree of the kernel to the recording and back: same bits, honest time, nothing guessed."""

import json
import os
import shutil
import struct
from itertools import permutations

import numpy as np
import pytest

from plumbob import Stream, flags
from plumbob.core.errors import DecodeError, LineError, ParameterError, UnitError
from plumbob.core.event import Event
from plumbob.live.replay import open_recording, replay
from plumbob.live.runner import run_stream
from plumbob.live.session import RecordSpec
from plumbob.live.session_toml import parse_session
from plumbob.live.sinks import Collected, RecordingSink
from plumbob.live.sources import open_source
from plumbob.live.transports.iio_layout import IioChannel, IioLayout, IioType, iio_format
from plumbob.live.transports.transport import Received
from tests.helpers.iio_tree import ACCEL, GYRO, Tree, motion, scans
from tests.helpers.live_samples import joined

ESTIMATE = '[estimate]\nfilter = "mahony"\nparams = { kp = 0.5 }\n'


@pytest.fixture
def tree(tmp_path):
    return Tree(tmp_path)


def session(text):
    return parse_session(text, {}.__getitem__, name="bench")


def run(chosen, data, tree, path=None):
    """Let a line take what the kernel has, until the device goes; the bytes come in pieces that are no scans."""
    line, found = Stream(chosen), Collected()
    source = open_source(chosen.source)
    end = tree.hold()
    for at in range(0, len(data), 1003):
        os.write(end, data[at : at + 1003])
    os.close(end)
    recording_sink = None if path is None else RecordingSink(chosen, RecordSpec(str(path)), offset=lambda: 0)
    run_stream(line, source, sinks=[found], recording=recording_sink, until_lost=True)
    return line, found


def test_from_the_tree_to_the_recording_to_the_replay(tree, tmp_path):
    tree.add_imu()
    gyr, acc, temp, t_ns = motion(400)
    gyr[7] = [-2047, -1, 2046]
    chosen = session(tree.session(rest=ESTIMATE))
    _, live = run(chosen, scans(gyr, acc, temp, t_ns), tree, tmp_path / "a.mcap")
    shutil.rmtree(tree.sys)  # a replay needs no device
    log, again = open_recording(tmp_path / "a.mcap")
    replayed = replay(log, session=again, check=True)
    assert (replayed.comparison.equal, replayed.comparison.compared) == (True, 400)
    for found in (live, replayed.found):
        np.testing.assert_array_equal(found.t_ns, t_ns)  # the kernel's own, not those of the reads
        np.testing.assert_array_equal(joined(found.parts, "gyr"), gyr * GYRO)
        np.testing.assert_array_equal(joined(found.parts, "acc"), acc * ACCEL)
        np.testing.assert_allclose(joined(found.parts, "temp_c"), (temp + 12420) * 2.941176e-3, rtol=1e-14)
    assert again.form == chosen.form
    assert IioLayout.from_json(again.texts["iio.json"]).clock == "monotonic"
    assert json.loads(again.texts["iio.json"])["channels"][0] == {
        "name": "anglvel_x", "index": 0, "type": "le:s12/16>>4", "scale": GYRO, "offset": 0.0
    }  # fmt: skip


def test_clipped_counts_repeated_stamps_and_scans_that_a_full_buffer_lost(tree):
    tree.add_imu()
    gyr, acc, temp, t_ns = motion(50)
    gyr[3, 1], gyr[9, 2] = -2048, 2047  # the ends of 12 bits in two's complement
    t_ns[20] = t_ns[19]
    line, found = run(session(tree.session()), scans(gyr, acc, temp, t_ns), tree)
    assert np.flatnonzero(joined(found.parts, "flags") & flags.GYR_CLIPPED).tolist() == [3, 9]
    assert (line.faults, found.t_ns.size) == (1, 49)
    kept = np.r_[0:100, 117:300]
    line, found = run(session(tree.session()), scans(*(column[kept] for column in motion(300))), tree)
    assert np.flatnonzero(joined(found.parts, "flags") & flags.GAP).tolist() == [100]
    report = line.report()["time"]
    assert (report["mode"], report["lost"], report["gap_count"], report["drift_ppm"]) == ("kernel", 17, 1, None)
    assert report["rate"] == pytest.approx(100.0, rel=1e-3)


def test_a_device_that_comes_back_begins_behind_a_gap(tree):
    tree.add_imu()
    line, (gyr, acc, temp, t_ns) = Stream(session(tree.session())), motion(40)
    t_ns[20:] += 3_000_000_000
    first, second = (scans(gyr[p], acc[p], temp[p], t_ns[p]) for p in (slice(20), slice(20, 40)))
    line.feed(Received(int(t_ns[19]) + 50_000, first + second[:11]))
    line.feed(Event(int(t_ns[20]) - 20_000_000, "lost", "it is gone"))
    line.feed(Event(int(t_ns[20]) - 10_000_000, "reopened", "it is back"))
    part = line.feed(Received(int(t_ns[39]) + 50_000, second))
    np.testing.assert_array_equal(part.t_ns, t_ns[20:])
    assert np.flatnonzero(part.sensed.flags & flags.GAP).tolist() == [0]
    assert line.decoder.counts.junk == 11


def test_a_wall_clock_is_led_to_the_host_like_any_other(tree):
    """Linux before 4.5 has no current_timestamp_clock, and stamps with real time."""
    (tree.add_imu() / "current_timestamp_clock").unlink()
    chosen = session(tree.session())
    assert chosen.timed_by == "frames"
    assert "wall clock" in chosen.form.facts["clock"][0]
    gyr, acc, temp, t_ns = motion(100, start_ns=1_700_000_000_000_000_000)
    line, found = run(chosen, scans(gyr, acc, temp, t_ns), tree)
    assert line.report()["time"]["mode"] == "clock"
    np.testing.assert_array_equal(np.diff(found.t_ns), np.diff(t_ns))
    assert found.t_ns[0] < 1_000_000_000_000_000_000  # monotonic: since the machine was started


def test_the_mount_matrix_turns_and_the_axes_of_the_body_come_after_it(tree):
    tree.add_imu(in_anglvel_mount_matrix="0, 1, 0; -1, 0, 0; 0, 0, 1")
    gyr, acc, temp, t_ns = motion(30)
    data = scans(gyr, acc, temp, t_ns)
    board = np.stack([gyr[:, 1], -gyr[:, 0], gyr[:, 2]], axis=1) * GYRO  # rows of the matrix
    for words, turned in (
        ((), board),
        (("", 'axes = "x -y -z"\n'), board * [1, -1, -1]),
        (("mount = false",), gyr * GYRO),
    ):
        _, found = run(session(tree.session(*words)), data, tree)
        np.testing.assert_array_equal(joined(found.parts, "gyr"), turned)
        np.testing.assert_array_equal(joined(found.parts, "acc"), acc * ACCEL * ([1, -1, -1] if len(words) > 1 else 1))


SKEWED = "0.8, 0.6, 0; -0.6, 0.8, 0; 0, 0, 1"
WRONG = {  # of the source, behind it, the device, whose files are changed, and what is refused
    "a format beside the kernel's": ("", '[format]\nname = "buoy"\n', {}, DecodeError, r"\[format\] does not go with"),
    "rate without unit": ('rate = "100"', "", {}, UnitError, "has no unit"),
    "rate of another unit": ('rate = "100 deg"', "", {}, UnitError, "measures an angle|Hz"),
    "unknown key": ("baud = 9600", "", {}, DecodeError, "no key 'baud'"),
    "channel that is not there": ('channels = ["magn_x"]', "", {}, LineError, "has no magn_x"),
    "no scale": ("", "", {"in_accel_scale": ""}, LineError, "not a number"),
    "mount between the axes": ("", "", {"in_mount_matrix": SKEWED}, ParameterError, "mount = false"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_session_is_refused_before_anything_is_opened(tree, case):
    source, rest, files, error, word = WRONG[case]
    tree.add_imu(**files)
    with pytest.raises(error, match=word):
        session(tree.session(source, rest))


def test_what_a_session_needs_of_a_device(tree, tmp_path):
    folder = tree.add_imu(in_mount_matrix=SKEWED)
    chosen = session(tree.session("mount = false"))
    assert chosen.form.name == "imu"
    with pytest.raises(ParameterError, match="carries no gyr"):
        Stream(session(tree.session('mount = false\nchannels = ["temp", "timestamp"]')))
    (folder / "in_anglvel_scale").write_text("0.001")
    with pytest.raises(LineError, match="have changed since"):
        open_source(chosen.source)
    (folder / "in_anglvel_scale").write_text(f"{GYRO!r}\n")
    del chosen.texts["iio.json"]
    run(chosen, scans(*motion(3)), tree, tmp_path / "a.mcap")
    with pytest.raises(DecodeError, match=r"does not hold iio\.json"):
        open_recording(tmp_path / "a.mcap")


def polled(tree):
    """ADXRS453: 218166 nrad/s a count; temperature (raw + 225) × 200 m°C (Linux, drivers/iio/gyro/adxrs450.c)."""
    temperature = {"in_temp0_raw": -100, "in_temp0_scale": 200, "in_temp0_offset": 225}
    tree.add("adxrs453", {"in_anglvel_z_raw": -160, "in_anglvel_z_scale": "0.000218166"} | temperature)
    return session(tree.session('rate = "250 Hz"', kind="iio-poll", device="adxrs453"))


def test_a_driver_without_a_buffer_is_polled(tree, tmp_path):
    chosen = polled(tree)
    path, line, live = tmp_path / "a.mcap", Stream(chosen), Collected()
    source = open_source(chosen.source)
    run_stream(line, source, sinks=[live], recording=RecordingSink(chosen, RecordSpec(str(path))), duration=0.3)
    sensed = live.parts[-1].sensed
    assert np.degrees(sensed.gyr[-1, 2]) == pytest.approx(-2.0, rel=1e-4)
    assert sensed.temp_c[-1] == pytest.approx(25.0)
    assert (sensed.meta.rate_nominal, sensed.meta.gyr_range) == (250.0, None)  # 32 bits are no range
    shutil.rmtree(tree.sys)
    again = replay(path).found
    np.testing.assert_array_equal(again.t_ns, live.t_ns)
    np.testing.assert_array_equal(again.parts[-1].sensed.gyr, sensed.gyr)


def test_a_polls_time_is_its_own_and_missed_deadlines_are_a_gap(tree):
    line = Stream(polled(tree))
    t_ns = 1_000_000_000 + 4_000_000 * np.arange(500) + np.random.default_rng(1).integers(0, 300_000, 500)
    kept = np.r_[0:200, 203:500]
    parts = []
    for t in t_ns[kept].tolist():
        if t == t_ns[203]:
            line.feed(Event(t, "late", "3 deadlines have passed", 3))
        parts.append(line.feed(Received(t, struct.pack("<2i", -7, 0))))
    np.testing.assert_array_equal(np.concatenate([part.t_ns for part in parts]), t_ns[kept])
    assert np.flatnonzero(joined(parts, "flags") & flags.GAP).tolist() == [200]
    assert (line.report()["time"]["mode"], line.report()["time"]["lost"]) == ("poll", 3)


def test_every_turn_of_axes_is_taken_and_several_numbers_in_one_element_are_none():
    s16 = IioType("<", True, 16, 16)
    channels = tuple(IioChannel(f"anglvel_{a}", i, s16) for i, a in enumerate("xyz"))
    for order in permutations(range(3)):
        matrix = tuple(tuple(float(order[i] == j) for j in range(3)) for i in range(3))
        form = iio_format(IioLayout("any", channels, {"gyr": matrix}))
        assert [form.messages[0].fields[order[i]].name for i in range(3)] == ["gyr.x", "gyr.y", "gyr.z"]
    with pytest.raises(ParameterError, match="holds 4 numbers"):
        iio_format(IioLayout("any", (IioChannel("magn_x", 0, IioType("<", True, 16, 16, 4)),)))
