"""Sources with a pace of their own: a recording at K times its speed, and a rig that runs faster than time."""

import pytest

from plumbob.core.event import Event
from plumbob.live import sources
from plumbob.live.replay import open_recording
from plumbob.live.transports.transport import Received
from tests.helpers import Clock
from tests.helpers.live_samples import Handed, record, session

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
