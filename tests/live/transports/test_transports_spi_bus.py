"""Chips on a bus, emulated; and the polling that they share with IIO."""

import itertools
import sys
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plumbob.core.errors import LineError, MissingExtraError, ParameterError
from plumbob.live.transports.polled import Schedule
from plumbob.live.transports.spi_bus import SpiSource
from plumbob.live.transports.transport import Received

MS = 1_000_000
SENSOR, CHECK = bytes.fromhex("20000000"), bytes.fromhex("20000003")  # DS-453: commands of the ADXRS453, SQ 0 and CHK


class Chip:
    """Answers one transfer late, as the ADXRS453 does: its first reply is 00000001 (DS-453), then it says the number
    of the command that it answers."""

    def __init__(self, clock, cost_ns=0):
        self.clock, self.cost_ns = clock, cost_ns
        self.replies, self.commands = [bytes.fromhex("00000001")], []
        self.broken, self.closed = False, 0

    def transfer(self, data):
        if self.broken:
            raise OSError(110, "Connection timed out")
        self.clock.ns += self.cost_ns
        self.commands.append(data)
        self.replies.append(len(self.commands).to_bytes(4, "big"))
        return self.replies[-2]

    def close(self):
        self.closed += 1


@pytest.fixture
def chip(clock):
    return Chip(clock)


@pytest.fixture
def make(clock, chip):
    def make(exchange=(SENSOR,), rate=1000.0, **options):
        bus = {"mode": 0, "hz": 4_000_000, "open_bus": lambda: chip, "clock": clock, "sleep": clock.sleep}
        return SpiSource(0, 1, exchange, rate, **(bus | options))

    return make


def test_one_reply_for_each_poll_on_time_of_one_command_or_several_behind_a_start(make, clock, chip):
    with make() as source:
        (opened,) = source.read(1)
        start = clock()
        got = [item for _ in range(4) for item in source.read(1)]
    assert (opened.kind, source.name) == ("opened", "spi 0.1")
    assert [item.t_ns - start for item in got] == [0, MS, 2 * MS, 3 * MS]
    assert [item.data.hex() for item in got] == ["00000001", "00000001", "00000002", "00000003"]
    assert chip.commands == [SENSOR] * 4
    assert chip.closed == 1
    chip.__init__(clock)
    with make([SENSOR, CHECK]) as source:
        source.read(1)
        words = [int.from_bytes(source.read(1)[0].data, "big") for _ in range(2)]
    assert words == [0x00000001_00000001, 0x00000002_00000003]
    chip.__init__(clock)
    with make(skip=3, start=(CHECK,)) as source:
        assert "Hz, start answered 00000001) is open" in source.read(1)[0].text
        assert source.read(1)[0].data.hex() == "01"
    assert chip.commands == [CHECK, SENSOR]


def test_deadlines_do_not_drift_and_a_chip_that_is_too_slow_is_asked_as_often_as_it_can(make, clock, chip):
    chip.cost_ns = 300_000
    with make() as source:
        source.read(1)
        start = clock()
        times = [source.read(1)[0].t_ns - start for _ in range(1000)]
    assert times == [i * MS + 300_000 for i in range(1000)]
    chip.cost_ns = 2_500_000
    with make() as source:
        source.read(1)
        got = [item for _ in range(20) for item in source.read(1)]
    polls = sum(isinstance(item, Received) for item in got)
    missed = sum(item.count for item in got if not isinstance(item, Received))
    assert (polls, missed) == (20, (20 * 25 - 25) // 10 - 19)  # deadlines until the last question, less those met


def test_missed_deadlines_are_counted_and_not_made_up_for(make, clock):
    with make() as source:
        source.read(1)
        start = clock()
        source.read(1)
        clock.sleep(0.0105)
        late, answer = source.read(1)
        assert (late.kind, late.count) == ("late", 9)  # 1 to 9 ms; that of 10 ms is answered now
        assert answer.t_ns - start == 10_500_000
        (answer,) = source.read(1)
        assert answer.t_ns - start == 11 * MS


def test_read_waits_no_longer_than_it_may_and_closed_is_finished(make, clock):
    with make(rate=1.0) as source:
        source.read(1)
        source.read(1)
        start = clock()
        assert source.read(0.25) == []
        assert clock() - start == 250 * MS
    source = make().open()
    source.close()
    source.close()
    assert source.finished
    assert source.read(1) == []


def test_a_chip_that_fails_is_opened_again(make, clock, chip):
    with make() as source:
        source.read(1)
        chip.broken = True
        lost_ns = clock()
        (lost,) = source.read(1)
        assert (lost.kind, chip.closed) == ("lost", 1)
        assert "timed out" in lost.text
        assert source.read(0.01) == []
        chip.broken = False
        (back,) = source.read(1)
        assert (back.kind, back.t_ns - lost_ns) == ("reopened", 50 * MS)
        assert isinstance(source.read(1)[0], Received)


def test_a_chip_that_stays_away_is_asked_with_patience(make, clock, chip):
    opened = []

    with make(start=(CHECK,), open_bus=lambda: opened.append(clock()) or chip) as source:
        source.read(1)
        chip.broken = True
        source.read(1)
        for _ in range(10):
            assert source.read(0.5) == []
    steps = [b - a for a, b in itertools.pairwise(opened[1:])]
    assert steps[:4] == [100 * MS, 200 * MS, 400 * MS, 500 * MS]
    assert chip.closed == len(opened)


@pytest.mark.parametrize(
    ("error", "said"),
    [(FileNotFoundError(2, "no"), "dtparam"), (PermissionError(13, "no"), "group spi"), (OSError(5, "no"), "spi 0.1")],
)
def test_a_bus_that_cannot_be_opened(make, error, said):
    def refuse():
        raise error

    with pytest.raises(LineError, match=said):
        make(open_bus=refuse).open()


def test_spidev_is_used_as_it_wants(monkeypatch, make):
    class SpiDev:
        def open(self, bus, device):
            opened.append(self)
            self.address, self.sent, self.closed = (bus, device), [], False

        def xfer2(self, data):
            assert isinstance(data, list)
            self.sent.append(data)
            return data

        def close(self):
            self.closed = True

    opened = []
    monkeypatch.setitem(sys.modules, "spidev", SimpleNamespace(SpiDev=SpiDev))
    with make(mode=3, hz=5_000_000, open_bus=None) as source:
        source.read(0)
        assert source.read(1)[0].data == SENSOR
    (spi,) = opened
    assert (spi.address, spi.mode, spi.max_speed_hz, spi.closed) == ((0, 1), 3, 5_000_000, True)
    monkeypatch.setitem(sys.modules, "spidev", None)
    with pytest.raises(MissingExtraError, match=r"plumbob\[spi\]"):
        make(open_bus=None).open()


def test_what_can_never_be_right(make):
    for rate in (0.0, 1e6, float("nan")):
        with pytest.raises(ParameterError):
            make(rate=rate)
    for options in ({"mode": 4}, {"hz": 0}, {"exchange": ()}, {"exchange": (b"",)}):
        with pytest.raises(ParameterError):
            make(**options)


def test_deadlines_come_in_their_period_and_not_before():
    """Asked each ms for a second, 3 ms give so many deadlines, those at both ends included."""
    schedule = Schedule(3 * MS)
    assert (sum(schedule.due(t) for t in range(0, 1000 * MS + 1, MS)), schedule.missed) == (334, 0)
    schedule = Schedule(10, start_ns=100)
    assert (schedule.due(99), schedule.next_ns, schedule.due(135)) == (False, 100, True)
    assert not schedule.due(105)
    assert (schedule.missed, schedule.next_ns) == (3, 140)


@given(
    period=st.integers(1, 50),
    start=st.integers(-100, 100),
    steps=st.lists(st.integers(0, 200), min_size=1, max_size=60),
)
def test_every_deadline_is_met_once_or_counted(period, start, steps):
    schedule, t, met = Schedule(period, start_ns=start), start, 0
    for step in steps:
        t += step
        met += schedule.due(t)
        assert t < schedule.next_ns <= t + period
    assert met + schedule.missed == (t - start) // period + 1


@pytest.mark.parametrize("period", [0, -1])
def test_what_can_be_no_schedule(period):
    with pytest.raises(ParameterError):
        Schedule(period)
