"""Loss, back-off and silence, on a clock that passes only in sleep and with lines that are pipes."""

import itertools
import os

import pytest

from plumbob.core.errors import LineError, ParameterError
from plumbob.core.event import Event
from plumbob.live.transports.transport import BackOff, NoLine, Received, Replug


class PipeWire:
    where = "pipe"

    def __init__(self, line):
        self.line = line
        self.reader, self.writer = os.pipe()
        self.closed = 0

    def fileno(self):
        return self.reader

    def take(self):
        data = os.read(self.reader, 100)
        if data == b"!":
            raise OSError(5, "pulled out")
        return [Received(self.line.now(), data)] if data != b"0" else []

    def close(self):
        self.closed += 1
        os.close(self.reader)
        os.close(self.writer)


class Stream(Replug):
    """Open where `answers` says so: None is yes, "soon" is not yet, a pair of words is no."""

    def __init__(self, clock, answers=(), **options):
        super().__init__("line", clock=clock, sleep=clock.sleep, **options)
        self.now, self.answers, self.asked, self.wires = clock, list(answers), [], []

    def _connect(self, patience):
        self.asked.append(self.now())
        answer = self.answers.pop(0) if self.answers else None
        if answer == "soon":
            self.now.sleep(patience)
            return None
        if answer is not None:
            raise NoLine(*answer)
        self.wires.append(PipeWire(self))
        return self.wires[-1]

    def say(self, data):
        os.write(self.wires[-1].writer, data)


@pytest.fixture
def make(clock):
    made = []

    def make(*answers, **options):
        made.append(Stream(clock, answers, **options))
        return made[-1]

    yield make
    for line in made:
        line.close()


ABSENT = ("absent", "not there")


def kinds(items):
    return [item.kind for item in items]


def test_it_opens_once_gives_what_comes_and_is_finished_once_closed(make, clock):
    line = make(gather=0.002)
    assert line.open() is line.open()
    assert kinds(line.read(0)) == ["opened"]
    assert line.read(0) == []
    line.say(b"abc")
    assert line.read(5) == [Received(clock(), b"abc")]
    line.say(b"0")  # nothing is no answer
    assert (line.read(1), len(line.asked)) == ([], 1)
    with make() as line:
        assert not line.finished
        line.read(0)
    line.close()
    assert line.finished
    assert (line.read(1), line.wires[0].closed) == ([], 1)


def test_read_opens_and_asks_again(make):
    assert kinds(make().read(0)) == ["opened"]
    line = make(ABSENT)
    with pytest.raises(LineError, match="not there"):
        line.read(0)
    assert line.wires == []
    assert kinds(line.read(0)) == ["opened"]
    line = make("soon", "soon", wait=True)
    assert [kinds(line.read(0.1)) for _ in range(3)] == [[], [], ["opened"]]
    assert kinds(make("soon").read(0.1)) == ["opened"]


def test_waiting_backs_off_and_tells_each_reason_once(make):
    line, items = make(*[ABSENT] * 6, ("denied", "no right"), ABSENT, wait=True), []
    while len(items) < 4:
        items += line.read(1.0)
    assert kinds(items) == ["absent", "denied", "absent", "opened"]
    steps = [round((b - a) / 1e9, 3) for a, b in itertools.pairwise(line.asked)]
    assert steps == [0.05, 0.1, 0.2, 0.4, 0.5, 0.5, 0.5, 0.5]
    assert BackOff().wait_ns(10**9) == 500_000_000  # it never overflows


def test_loss_is_told_with_both_times_and_mended(make, clock):
    line = make(None, ABSENT, ABSENT)
    line.read(0)
    line.say(b"x")
    line.read(1)
    line.say(b"!")
    lost_at = clock()
    (lost,) = line.read(1)
    assert lost == Event(lost_at, "lost", "pipe is lost: pulled out.")
    assert line.wires[0].closed == 1
    absent, back = line.read(1.0) + line.read(1.0)
    assert (absent.kind, back.kind) == ("absent", "reopened")
    assert back.t_ns - lost.t_ns == 350_000_000  # 50 ms after the loss, 100 and 200 ms more
    assert back.text == "pipe is open again after 0.350 s without it."


def test_a_line_that_breaks_whenever_it_is_opened_is_not_hammered_but_bytes_make_up_for_failures(make, clock):
    line, start = make(), clock()
    line.read(0)
    while clock() - start < 10_000_000_000:
        line.say(b"!")
        assert kinds(line.read(1) + line.read(1)) == ["lost", "reopened"]
    assert len(line.asked) < 25
    line = make(*[ABSENT] * 6, wait=True)
    while not any(e.kind == "opened" for e in line.read(1.0)):
        pass
    line.say(b"x")
    line.read(1)
    line.say(b"!")
    (lost,) = line.read(1)
    (back,) = line.read(1)
    assert (back.kind, back.t_ns - lost.t_ns) == ("reopened", 50_000_000)


def test_reads_are_gathered(make, clock):
    line = make(gather=0.002)
    line.read(0)
    clock.sleep(1.0)
    clock.slept.clear()
    for data in (b"a", b"b"):
        line.say(data)
        assert line.read(1)[0].data == data
    assert clock.slept == [0.002]  # none before the first, which came after a silence
    line.say(b"c")
    assert line.read(0)[0].data == b"c"  # who does not want to wait does not
    assert clock.slept == [0.002]


def test_silence_is_told_once_or_breaks_the_line(make, clock):
    line = make(silence=0.5)
    line.read(0)
    clock.sleep(0.6)
    (stalled,) = line.read(0)
    assert (stalled.kind, stalled.text) == ("stalled", "pipe: nothing has come for 0.600 s.")
    clock.sleep(0.6)
    assert line.read(0) == []
    line.say(b"x")
    resumed, received = line.read(0)
    assert (resumed.kind, resumed.text, received.data) == ("resumed", "pipe goes on after 1.200 s.", b"x")
    clock.sleep(0.4)
    assert line.read(0) == []
    line = make(silence=0.5, breaks_on_silence=True)
    line.read(0)
    clock.sleep(0.5)
    assert [kinds(line.read(wait)) for wait in (0, 1, 0)] == [["lost"], ["reopened"], []]


def test_what_can_never_be_right(make):
    for options in ({"gather": -1}, {"gather": 2}, {"gather": float("nan")}, {"silence": 0}):
        with pytest.raises(ParameterError):
            make(**options)
    for args in ((0,), (0.5, 0.1), (0.05, 0.5, 0.5)):
        with pytest.raises(ParameterError):
            BackOff(*args)
