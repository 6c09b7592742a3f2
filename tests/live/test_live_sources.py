"""Sources with a pace of their own: a recording at K times its speed, and a rig that runs faster than time."""

import json
import os
import socket
import threading
import time
import tty
from pathlib import Path

import numpy as np
import pytest

import plumbob
from plumbob.core.errors import PlumbobError
from plumbob.core.event import Event
from plumbob.live import sources
from plumbob.live.replay import open_recording
from plumbob.live.stream import Stream
from plumbob.live.transports.transport import Received
from plumbob.rotations import quat_conjugate, quat_from_euler_zyx, quat_multiply, quat_rotate
from plumbob.viewer import playback
from plumbob.viewer.switch import Switch
from tests.helpers import Clock, commandline
from tests.helpers.live_samples import Handed, record, session
from tests.helpers.outlets import Kept

MS = 1_000_000


@pytest.fixture
def clock(monkeypatch):
    made = Clock()
    monkeypatch.setattr(sources, "time", made)
    return made


@pytest.fixture
def slow(tmp_path):
    """Four reads and an event, at 0, 100, 250, 400 and 1000 ms of the host's time."""
    items = [Received(5_000 * MS + t * MS, bytes([i])) for i, t in enumerate((0, 100, 250, 1000))]
    items.insert(3, Event(5_400 * MS, "damaged", "a character had a wrong stop bit", 1))
    record(tmp_path / "slow.mcap", items)
    return open_recording(tmp_path / "slow.mcap")[0], items


@pytest.mark.parametrize("speed", [0.5, 1.0, 4.0])
def test_a_recording_is_read_at_its_pace_times_the_speed(slow, clock, speed):
    """An item that came t after the first comes t / K after it; four times as fast is a quarter of the time."""
    log, items = slow
    source, start, came = sources.ReplaySource(log, speed), clock.ns, []
    while not source.finished:
        for item in source.read(0.1):
            came.append((item.t_ns, clock.ns - start))
    assert [t_ns for t_ns, _ in came] == [item.t_ns for item in items]  # the times themselves stay
    assert [waited for _, waited in came] == [round(t * MS / speed) for t in (0, 100, 250, 400, 1000)]


def test_an_event_of_another_clock_holds_nothing_up(tmp_path, clock):
    """A file's bytes count their own time; that a target was opened has the host's."""
    items = [Received(t * MS, bytes([i])) for i, t in enumerate((0, 100, 200))]
    host = [
        Event(42_302_000 * MS, "opened", "file:a.jsonl is open."),
        Event(42_302_001 * MS, "wall-clock", "it was set."),
    ]
    record(tmp_path / "file.mcap", [items[0], host[0], *items[1:], host[1]])
    source, start = sources.ReplaySource(open_recording(tmp_path / "file.mcap")[0], 1.0), clock.ns
    came = []
    while not source.finished:
        came += [(item, clock.ns - start) for item in source.read(0.1)]
    assert [item for item, _ in came] == [items[0], host[0], *items[1:], host[1]]
    assert [waited for _, waited in came] == [0, 100 * MS, 100 * MS, 200 * MS, 200 * MS]


def test_times_are_those_of_the_speed_and_a_late_reader_does_not_fall_further_behind(slow, clock):
    source, start = sources.ReplaySource(slow[0], 2.0), clock.ns
    source.read(0.1)
    clock.ns += 180 * MS  # the items of 50, 125 and 200 ms were due, or are soon
    came = [clock.ns - start for _ in range(4) if source.read(0.1)]
    assert came == [180 * MS, 180 * MS, 200 * MS, 500 * MS]
    source, start = sources.ReplaySource(slow[0]), clock.ns
    assert [item.t_ns for item in source.read(0.1)] == [item.t_ns for item in slow[1]]
    assert source.finished
    assert clock.ns == start
    # at 20 times the speed, 3 ms after the start stand for 60 ms
    start = clock.ns
    items = [Received(start, b"a"), Received(start + 3 * MS, b"b"), Event(start + 10 * MS, "damaged", "x", 1)]
    source = sources.Stretched(Handed(items), 20.0)
    assert [item.t_ns - start for item in source.read(0.0)] == [0, 60 * MS, 200 * MS]
    assert (source.name, source.finished) == ("handed", True)


@pytest.mark.parametrize(("speed", "stretched"), [("", False), ("speed = 20\n", True)])
def test_a_session_s_speed_stretches_its_source(monkeypatch, speed, stretched):
    chosen = session(
        'kind = "plumbob session"\nversion = 1\n[format]\nfile = "imu9.toml"\n'
        f'[source]\nkind = "udp"\nport = 5000\n{speed}'
    )

    class Opened:
        def open(self):
            return Handed([])

    monkeypatch.setattr(sources, "make_source", lambda spec: Opened())
    assert isinstance(sources.open_source(chosen.source), sources.Stretched) is stretched


class Printer:
    """A device on a pseudo-terminal, which sends each piece when it is due, s, or up to `late` s afterwards."""

    def __init__(self, pieces, *, late=0.0):
        self._pieces, self._late = pieces, late
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self._thread = threading.Thread(target=self._print, daemon=True)

    def begin(self, start=None):
        self._start = time.monotonic() if start is None else start
        self._thread.start()

    def _print(self):
        rng = np.random.default_rng(4)
        for due, piece in self._pieces:
            time.sleep(max(0.0, self._start + due + rng.uniform(0.0, self._late) - time.monotonic()))
            os.write(self._master, piece)

    def close(self):
        self._thread.join()
        os.close(self._master)
        os.close(self._slave)


def angles_at(t):
    return np.array([0.9 * np.sin(1.5 * t), 0.4 * np.sin(2.0 * t), 0.5 * np.sin(t + 1.0)])


ANGLES = """separator = ","
[header]
names = false
[time]
column = 1
unit = "us"
[reference]
columns = [2, 3, 4]
order = "yaw pitch roll"
unit = "deg"
frame = "NED"
north = "magnetic"
"""


def printed_angles(rate, duration, ppm=0.0):
    for k in range(round(rate * duration)):
        t = k / rate
        cells = ",".join(f"{angle:.4f}" for angle in np.degrees(angles_at(t)))
        yield t, f"{round((70.0 + t * (1.0 + 1e-6 * ppm)) * 1e6)},{cells}\n".encode()


def printed_samples(rate, duration, ppm=0.0):
    for k in range(round(rate * duration)):
        t = k / rate
        q_nb, before = (quat_from_euler_zyx(angles_at(at)) for at in (t, t - 1.0 / rate))
        turn = quat_multiply(quat_conjugate(before), q_nb)
        gyr = 2.0 * rate * turn[1:] * np.sign(turn[0])
        triads = (gyr, *(quat_rotate(quat_conjugate(q_nb), np.array(v)) for v in ((0, 0, -9.80665), (22.0, 0, 42.0))))
        cells = ",".join(f"{value:.5f}" for value in np.concatenate(triads))
        yield t, f"{round((5.0 + t * (1.0 + 1e-6 * ppm)) * 1e6)},{cells}\n".encode()


def test_text_of_angles_alone_is_recorded_sent_replayed_and_evaluated_as_the_file_of_it(tmp_path):
    (tmp_path / "angles.toml").write_text(ANGLES)
    device = Printer(printed_angles(50.0, 2.0))
    ran = plumbob.record(
        port=device.port, profile=tmp_path / "angles.toml", out=tmp_path / "a.mcap", duration=2.5, opened=device.begin,
        text=tmp_path / "a.txt", send=[f"nmea file:{tmp_path / 'sent.txt'} 10Hz HDG,PASHR"],
    )  # fmt: skip
    device.close()
    assert ran.samples > 90
    assert "uncalibrated" not in ran.text()
    assert plumbob.replay(tmp_path / "a.mcap", check=True).comparison.equal
    text = b"".join(line for _, line in printed_angles(50.0, 2.0))
    (tmp_path / "a.csv").write_bytes(text)
    recording, file = (plumbob.read(tmp_path / name, profile=profile) for name, profile in (
        ("a.mcap", None), ("a.csv", tmp_path / "angles.toml")))  # fmt: skip
    assert recording.imu is None
    np.testing.assert_array_equal(recording.track.q_nb, file.track.q_nb[-ran.samples :])
    assert (tmp_path / "sent.txt").read_text().count("$PASHR") == ran.summary()["sent"][0]["sent"] > 10
    assert len((tmp_path / "a.txt").read_text().splitlines()) > 10
    loaded = playback.load(tmp_path / "a.mcap")
    assert playback.Player(loaded, Kept()).batch(0, ran.samples).rows["values"].shape[0] == ran.samples
    np.testing.assert_array_equal(loaded.reference.q_nb, recording.track.q_nb)
    switch = Switch(Stream(open_recording(tmp_path / "a.mcap")[1]), tmp_path, None)
    assert Path(switch.write_text("angles")).stem in switch.stop_text()
    assert plumbob.evaluate(tmp_path / "a.mcap", tmp_path / "a.mcap").summary()["total_rmse_deg"] < 1e-12


@pytest.mark.parametrize(
    ("name", "frame"),
    [("rion", None), ("ahrs500ga", None), ("buoy_attitude", None), ("vectornav_ypr", "NED"), ("vectornav_ahrs", "NED")],
)
def test_attitude_of_a_device_is_kept_from_a_port_as_from_its_bytes(name, frame, tmp_path):
    raw = tmp_path / "raw.bin"
    rig = {} if name == "buoy_attitude" else {"scenario": "buoy", "rate": 20.0}
    plumbob.emulate(name, seed=1, duration=1.0, write=raw, **rig)
    data = raw.read_bytes()
    size = len(data) // 20 + 1
    device = Printer([(k / 20, data[k * size : (k + 1) * size]) for k in range(20)])
    how = {"format": name, "north": "magnetic", "frame": frame, "rate": rig.get("rate")}
    plumbob.record(port=device.port, out=tmp_path / "port.mcap", duration=1.3, opened=device.begin, **how)
    device.close()
    plumbob.record(capture=raw, out=tmp_path / "file.mcap", **how)
    port, file = (plumbob.read(tmp_path / f"{source}.mcap").track for source in ("port", "file"))
    assert len(port) == len(file) >= 19
    np.testing.assert_array_equal(port.q_nb, file.q_nb)
    topics = {message.topic for message in open_recording(tmp_path / "port.mcap")[0]}
    assert "attitude" in topics
    assert ("imu" in topics) == (name not in ("rion", "vectornav_ypr"))


def test_two_sources_are_on_one_clock_and_judged_by_one_command(tmp_path):
    """The clock of the angles gains 3 ms a second: without its drift their times would be 12 ms off at the end."""
    samples, angles = (
        Printer(printed_samples(100.0, 4.0, -500.0), late=0.002),
        Printer(printed_angles(40.0, 4.0, 2500.0)),
    )
    (tmp_path / "angles.toml").write_text(ANGLES)
    triads = "".join(
        f'[{name}]\ncolumns = [{k}, {k + 1}, {k + 2}]\nunit = "{unit}"\n'
        for name, k, unit in (("gyr", 2, "rad/s"), ("mag", 8, "uT"), ("acc", 5, "m/s2"))
    )
    profile = ANGLES.partition("[reference]")[0] + triads + 'sign = "specific-force"\n'
    (tmp_path / "imu.toml").write_text('frame = "NED"\nnorth = "magnetic"\n' + profile)
    serial = 'kind = "serial"\nbaud = 115200\n'
    text = (
        'kind = "plumbob session"\nversion = 1\n'
        f'[[source]]\n{serial}port = "{samples.port}"\nlines = "imu.toml"\n'
        f'[[source]]\nname = "ahrs"\n{serial}port = "{angles.port}"\nlines = "angles.toml"\n'
        f'[estimate]\nfilter = "mekf"\n[[send]]\nas = "json"\nto = "file:{tmp_path}/sent.json"\nof = "ahrs"\n'
    )
    (tmp_path / "two.toml").write_text(text)

    def begin():
        start = time.monotonic() + 0.1
        samples.begin(start)
        angles.begin(start)

    ran = plumbob.record(tmp_path / "two.toml", out=tmp_path / "two.mcap", duration=4.5, opened=begin)
    samples.close()
    angles.close()
    told = ran.summary()["sources"]["ahrs"]
    assert told["clock_ppm"] == pytest.approx(3000.0, abs=200.0)
    again = plumbob.replay(tmp_path / "two.mcap", check=True)
    main, other = plumbob.read(tmp_path / "two.mcap"), plumbob.read(tmp_path / "two.mcap", unit="ahrs")
    assert other.imu is None
    due = {rate: (np.arange(round(4 * rate)) / rate)[-count:] for rate, count in
           ((100, len(main.imu)), (40, len(other.track)))}  # fmt: skip
    inside = due[40] >= due[100][0]
    error = (other.track.t - np.interp(due[40], due[100], main.imu.t))[inside]
    assert np.abs(error).max() < 1e-3
    judged = json.loads(commandline.ok("eval", tmp_path / "two.mcap", "ahrs", "--align", "time", "--json").stdout)
    assert abs(judged["alignment"]["time"]["offset_s"]) < 1e-3
    assert judged["total_rmse_deg"] < 1.0
    live = [message.data for message in open_recording(tmp_path / "two.mcap")[0] if message.topic == "attitude/ahrs"]
    assert len(live) == len(other.track) > 150
    assert again.comparison.equal and again.comparison.compared == len(again.track) + len(live)
    sent = [json.loads(line) for line in (tmp_path / "sent.json").read_text().splitlines()]
    assert np.isclose(sent[0]["heading_deg"] % 360.0, np.degrees(other.track.yaw % (2 * np.pi)), atol=0.01).any()
    for change, words in ((('name = "ahrs"\n', ""), "needs a name of its own"), (('of = "ahrs"', 'of = "b"'), "ahrs")):
        (tmp_path / "bad.toml").write_text(text.replace(*change))
        with pytest.raises(PlumbobError, match=words):
            plumbob.load_session(tmp_path / "bad.toml")


@pytest.mark.parametrize(
    ("outputs", "words"),
    [
        ({"out": "/proc/a.mcap"}, "/proc/a.mcap cannot be written"),
        ({"out": "none/a.mcap"}, "there is no folder none"),
        ({"text": "/proc/a.txt"}, "/proc/a.txt cannot be written"),
        ({"send": ["nmea file:/proc/a.txt"]}, "/proc/a.txt cannot be written"),
        ({"send": ["nmea tcp-listen:{busy}"]}, "cannot be written: Address already in use"),
        ({"send": ["nmea udp:127.0.0.1:9 10Hz HDT"]}, "declination"),
        ({"duration": "5 parsec"}, "not a unit of time"),
    ],
)
def test_outputs_and_units_are_checked_before_the_port_opens(outputs, words, tmp_path):
    (tmp_path / "angles.toml").write_text(ANGLES)
    with socket.create_server(("127.0.0.1", 0)) as busy, pytest.raises(PlumbobError, match=words):
        named = {key: [part.format(busy=busy.getsockname()[1]) for part in value] if key == "send" else value
                 for key, value in outputs.items()}  # fmt: skip
        plumbob.record(port="/dev/no-such-port", profile=tmp_path / "angles.toml", **named)
    assert len(list(tmp_path.iterdir())) == 1
