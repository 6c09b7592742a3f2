"""The demo: a table and a page from bytes, and a sentence instead where the recording is not what was sent."""

import re
from dataclasses import replace

import numpy as np
import pytest

from plumbob import Stream, files, find_format
from plumbob.cli import demo
from plumbob.cli.demo import require_as_sent
from plumbob.core.errors import DecodeError
from plumbob.core.event import Event
from plumbob.live import emulated
from plumbob.live.recorded import read_recorded
from plumbob.live.rigs.rig import PLANS, make_rig
from plumbob.live.session_toml import parse_session
from plumbob.live.sinks import Collected
from plumbob.live.transports.transport import Received
from tests.helpers.commandline import call, ok

SECONDS = 3.0


@pytest.fixture(scope="module")
def rig():
    return make_rig(PLANS["buoy"], find_format("buoy"), seed=demo.SEED, duration=SECONDS)


@pytest.fixture(scope="module")
def unit(rig):
    """The emulated unit's perfect card, for the time that calibrating it by hand takes."""
    return next(iter(rig.units.values())).calibration


@pytest.fixture
def small(unit, monkeypatch, tmp_path):
    """A few seconds of sea: the emulated hardware in a process, its terminal, recording, replays and page."""

    def calibrated(out, seed):
        unit.save(out / demo.CARD)
        return unit

    def run(seconds, *more):
        rig = emulated.running_rig
        monkeypatch.setattr(demo, "calibrate_unit", calibrated)
        monkeypatch.setattr(demo, "stages", list)  # no other filters
        monkeypatch.setattr(emulated, "running_rig", lambda *words: rig(*words, *more))
        return call("demo", "--duration", f"{seconds}s", "--out", tmp_path)

    return run


def test_the_unit_is_calibrated_as_it_was_drawn(unit, tmp_path):
    """Its true errors lie within five standard deviations of what two captures by hand find."""
    card = demo.calibrate_unit(tmp_path, seed=demo.SEED)
    for name in ("gyr", "acc", "mag"):
        found, true = getattr(card, name), getattr(unit, name)
        assert (np.abs(found.bias - true.bias) <= 5.0 * found.bias_sd).all(), name
    assert (tmp_path / demo.CARD).is_file()
    assert "<svg" in (tmp_path / demo.CERTIFICATE).read_text()


def test_a_small_sea_is_recorded_as_it_was_sent(small, tmp_path):
    done = small(20.0)  # a start in waves takes some seconds until it is scored
    assert done.returncode == 0, done.stderr
    assert "<svg" in (tmp_path / "report.html").read_text()
    assert "2000 live attitudes come out again, every bit" in done.stdout
    recorded, sent = read_recorded(tmp_path / "buoy.mcap").imu, files.read(tmp_path / "truth.parquet").imu
    np.testing.assert_array_equal(recorded.gyr, sent.gyr)
    np.testing.assert_array_equal(recorded.t_ns, sent.t_ns)


def test_what_was_lost_on_the_line_ends_the_demo_with_a_sentence(small, tmp_path):
    done = small(SECONDS, "--faults", "lose=3%")
    says = r"of \d+ bytes belong to no whole frame; recorded (2\d\d) of 300 samples; values differ in "
    assert re.search(f"the recording is not what was sent: .*{says}", done.stderr)
    assert (done.returncode, (tmp_path / "report.html").exists()) == (1, False)


def line_of(time="count"):
    source = f'source = {{ kind = "serial", port = "x", baud = 115200, speed = 60, time = "{time}" }}'
    return Stream(
        parse_session(f'kind = "plumbob session"\nversion = 1\n{source}\nformat = {{ name = "buoy" }}', str, name="x")
    )


def taken(items, line=None):
    """What a line makes of its items, and what became of the bytes."""
    line, found = line or line_of(), Collected()
    for part in filter(None, [*map(line.feed, items), line.finish()]):
        found.on_part(part)
    return found.imu(calibrated=False), line.decoder.counts


@pytest.fixture(scope="module")
def sent(rig):
    return next(iter(rig.units.values())).imu


def items_of(rig):
    return [Received(int(t), bytes(frame)) for t, frame in zip(rig.due_ns, rig.frames, strict=True)]


def wrong_count(sent):
    gyr = np.array(sent.gyr)
    gyr[100, 2] += np.radians(1.0 / 131.0)  # one count at ±250 °/s
    return replace(sent, gyr=gyr)


def stalled(items):
    """A stall of a second in the middle of a line at sixty times its speed, whose backlog never drains."""
    return items[:150] + [replace(item, t_ns=item.t_ns + 60 * 10**9 + 10**9 * k) for k, item in enumerate(items[150:])]


def test_what_was_sent_passes(rig, sent):
    imu, counts = taken(items_of(rig))
    for begin in (0.0, 5.0):  # a clock may begin anywhere
        require_as_sent(replace(imu, t=imu.t + begin), replace(sent, t=sent.t + 2.0 * begin), counts)


LOST = [  # what becomes of the samples and items that were sent, and how it is named
    (lambda s, of: (s, of[:100] + of[101:]), r"299 of 300 samples; values differ in 199 of 299, first at 1\.00"),
    (lambda s, of: (s, of[:100] + of[101:]), "times are wrong by up to .* flagged: 1 gap"),
    (lambda s, of: (s, of[:200]), r"recorded 200 of 300 samples; they last 1\.99 s instead of 2\.99 s\."),
    (lambda s, of: (wrong_count(s), of), r"sent: values differ in 1 of 300, first at 1\.00 s\."),
    (lambda s, of: (s, [Received(0, b"\x00\xa5"), *of]), r"2 of 9302 bytes belong to no whole frame\. No figure"),
    (lambda s, of: (s, [Event(0, "lost", "gone")]), r"not what was sent: no sample was recorded\."),
    (lambda s, of: (s, stalled(of)), r"times are wrong by up to \d+\.?\d* s; they last .*2\.99 s; flagged: \d+ gaps?"),
]


@pytest.mark.parametrize(("change", "says"), LOST)
def test_what_is_not_as_sent_is_named(rig, sent, change, says):
    sent, items = change(sent, items_of(rig))
    imu, counts = taken(items, line_of("host" if "last .*" in says else "count"))
    assert (imu is None) == ("no sample" in says)
    with pytest.raises(DecodeError, match=says):
        require_as_sent(imu, sent, counts)


@pytest.mark.long(reason="ten minutes of sea through five filters")
def test_demo_ends_in_a_table_and_a_page(tmp_path):
    done = ok("demo", "--out", tmp_path / "demo")
    assert "60000 live attitudes come out again, every bit" in done.stdout
    assert "Magnetometer: GOOD" in (tmp_path / "demo" / "certificate.html").read_text()
    errors = {name: [float(number) for number in re.findall(r"\d+\.\d+", row)]
              for name in ("error-state EKF (live)", "the same, uncalibrated")
              for row in done.stdout.splitlines() if row.startswith(name)}  # fmt: skip
    calibrated, uncalibrated = errors.values()
    assert len(calibrated) == 6  # total, heading, inclination, yaw, pitch, roll
    assert max(calibrated) < 0.24  # three times the filter's rms error of 0.08° with a perfect card (README)
    assert all(before > 5.0 * after for before, after in zip(uncalibrated, calibrated, strict=True))
