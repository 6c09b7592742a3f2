"""Serial lines, on pseudo-terminals: real descriptors, real hang-ups."""

import errno
import itertools
import os
import signal
import struct
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import pytest

from plumbob.core.errors import LineError, ParameterError
from plumbob.core.event import Event
from plumbob.live.transports import serial_line
from plumbob.live.transports.transport import BackOff, NoLine, Received, Replug


@pytest.fixture
def opened(line, collect):
    with serial_line.SerialSource(str(line.link), 115200) as source:
        collect(source, lambda got: got.kinds == ["opened"])
        yield source


def frames(first, count):
    """Frames of 40 bytes that say their number."""
    return b"".join(b"%010d" % i + bytes(range(30)) for i in range(first, first + count))


def open_descriptors():
    return sum(1 for _ in Path("/proc/self/fd").iterdir())


def test_bytes_arrive_unchanged_with_the_monotonic_time_and_listening_costs_none(opened, line, collect):
    data = bytes(range(256)) * 4  # XON, XOFF, CR, NL, INTR and NUL among them
    before = time.monotonic_ns()
    line.write(data)
    got = collect(opened, lambda got: len(got.data) >= len(data))
    assert got.data == data
    times = [item.t_ns for item in got]
    assert before <= times[0] <= times[-1] <= time.monotonic_ns()
    assert times == sorted(times)
    assert opened.name == str(line.link)
    start, cpu = time.monotonic(), time.process_time()
    assert opened.read(0.3) == []
    took = time.monotonic() - start
    assert took >= 0.299
    assert time.process_time() - cpu < 0.25 * took


def test_unplugged_and_plugged_in_again_leaves_nothing_behind(opened, line, collect):
    line.write(b"before")
    collect(opened, lambda got: got.data == b"before")
    line.pull()
    got = collect(opened, lambda got: got.kinds == ["lost", "absent"])
    assert len(got) == 2
    line.plug(stale=b"stale")
    collect(opened, lambda got: got.kinds == ["reopened"])
    line.write(b"after")
    assert collect(opened, lambda got: got.data).data == b"after"
    descriptors = open_descriptors()
    for _ in range(5):
        line.pull()
        line.plug()
        collect(opened, lambda got: got.kinds[-1:] == ["reopened"])
        line.write(b"x")
        collect(opened, lambda got: got.data == b"x")
    assert open_descriptors() == descriptors


def test_a_renamed_port_is_found_by_its_pattern_and_an_absent_one_is_an_error_or_waited_for(line, tmp_path, collect):
    with serial_line.SerialSource(str(tmp_path / "tty*"), 9600) as source:
        collect(source, lambda got: got.kinds == ["opened"])
        line.pull()
        line.link = tmp_path / "ttyOTHER"
        line.plug()
        got = collect(source, lambda got: "reopened" in got.kinds)
        assert "ttyOTHER" in got.events[-1].text
    line.pull()
    with pytest.raises(LineError, match=r"There is no serial port .*; the ports of this machine: "):
        serial_line.SerialSource(str(line.link), 9600).open()
    with serial_line.SerialSource(str(line.link), 9600, wait=True) as waiting:
        assert [event.kind for event in waiting.read(0)] == ["absent"]
        start, cpu = time.monotonic(), time.process_time()
        while time.monotonic() - start < 0.5:
            waiting.read(0.2)
        assert time.process_time() - cpu < 0.25 * (time.monotonic() - start)  # waiting costs no time
        line.plug()
        collect(waiting, lambda got: got.kinds == ["opened"])


def test_bytes_come_before_the_loss_that_follows_them(opened, line, monkeypatch):
    """As a USB driver does it: a read gives bytes, the next one fails."""
    opened.read(0)
    answers = [b"abc", b"def", OSError(errno.EIO, "Input/output error")]

    def read(fd, size):
        answer = answers[0] if len(answers) == 1 else answers.pop(0)
        if isinstance(answer, OSError):
            raise answer
        return answer

    line.write(b"wake")
    with monkeypatch.context() as patch:
        patch.setattr(os, "read", read)
        received, lost = [*opened.read(1), *opened.read(1)]
    assert received.data == b"abcdef"
    assert lost.kind == "lost"
    assert "Input/output error" in lost.text


def test_a_second_reader_is_refused(opened, line):
    second = serial_line.SerialSource(str(line.link), 9600)
    with pytest.raises(LineError, match="in use by another program"):
        second.open()
    with serial_line.SerialSource(str(line.link), 9600, exclusive=False, gather=0) as third:
        assert [event.kind for event in third.read(0)] == ["opened"]
    opened.close()
    with second:
        assert [event.kind for event in second.read(0)] == ["opened"]
    assert opened.finished


@pytest.mark.parametrize(
    ("number", "said"), [(errno.EACCES, "dialout"), (errno.EIO, "Input/output"), (errno.EINVAL, "cannot be opened")]
)
def test_refusals_of_the_system_say_what_to_do(line, monkeypatch, number, said):
    import serial

    def refuse(*args, **options):
        raise serial.SerialException(number, "could not open port")

    monkeypatch.setattr(serial, "Serial", refuse)
    with pytest.raises(LineError, match=said):
        serial_line.SerialSource(str(line.link), 9600).open()


@pytest.mark.parametrize(("baud", "options"), [
    (9600, {"rtscts": True}),
    (115200, {"xonxoff": True}),
    (921600, {}),
    (250000, {"bytesize": 7, "parity": "E"}),
    (123456, {"bytesize": 7, "parity": "E", "stopbits": 2}),
])  # fmt: skip
def test_usual_and_odd_speeds_and_forms(line, baud, options):
    """A pseudo-terminal takes any, and has no modem lines, which pyserial would set."""
    with serial_line.SerialSource(str(line.link), baud, **options) as source:
        assert [event.kind for event in source.read(0)] == ["opened"]


def test_what_can_never_be_right():
    for wrong in ({"baud": 0}, {"bytesize": 9}, {"parity": "X"}, {"stopbits": 3}, {"gather": 5.0}):
        with pytest.raises(ParameterError):
            serial_line.SerialSource("/dev/ttyX", **{"baud": 9600, **wrong})


@pytest.mark.parametrize("pause", [0.0, 0.01], ids=["fast reader", "slow reader"])
def test_a_flood_arrives_whole(opened, line, pause):
    """2 MB as fast as they go (400 kB for the slow reader): all are there, in order."""
    data = frames(0, 10_000 if pause else 50_000)
    writer = threading.Thread(target=line.write, args=(data,))
    writer.start()
    received, until = bytearray(), time.monotonic() + 60
    while len(received) < len(data) and time.monotonic() < until:
        for item in opened.read(0.1):
            received += item.data
        time.sleep(pause)
    writer.join()
    assert len(received) == len(data)
    assert received == data


READER = """
import sys
from plumbob.live.transports.serial_line import SerialSource
from plumbob.live.transports.transport import Received
total, data = int(sys.argv[2]), b""
with SerialSource(sys.argv[1], 115200) as source:
    print(source.read(1)[0].kind, flush=True)
    while len(data) < total:
        for item in source.read(1.0):
            if not isinstance(item, Received):
                sys.exit(f"{item}")
            data += item.data
sys.stdout.buffer.write(data)
"""


def test_a_reader_that_was_stopped_goes_on(line):
    """1 kB meanwhile, less than a pseudo-terminal keeps."""
    data = frames(0, 50)
    child = subprocess.Popen([sys.executable, "-c", READER, str(line.link), str(len(data))], stdout=subprocess.PIPE)
    try:
        assert child.stdout.readline() == b"opened\n"
        line.write(data[:1000])
        os.kill(child.pid, signal.SIGSTOP)
        os.waitid(os.P_PID, child.pid, os.WSTOPPED)
        line.write(data[1000:])
        os.kill(child.pid, signal.SIGCONT)
        out, _ = child.communicate(timeout=60)
    finally:
        child.kill()
        child.wait()
    assert (child.returncode, out) == (0, data)


class Driver:
    """`struct serial_icounter_struct` of linux/serial.h: cts, dsr, rng, dcd, rx, tx, frame, overrun, parity, brk,
    buf_overrun, reserved[9]."""

    frame = overrun = parity = buf_overrun = asked = 0
    error = None

    def __call__(self, fd, request, argument):
        assert (fd, request, len(argument)) == (7, serial_line.TIOCGICOUNT, 80)
        self.asked += 1
        if self.error:
            raise self.error
        told = (self.frame, self.overrun, self.parity, 9, self.buf_overrun)
        return struct.pack("=20i", 1, 2, 3, 4, 1000, 6, *told, *range(9))


def test_only_what_is_new_is_told_by_a_driver_with_counters():
    driver = Driver()
    driver.overrun = driver.frame = 5  # from before the port was opened
    counters = serial_line.Overruns(7, "ttyX", ioctl=driver)
    assert counters.ask(0) == []
    driver.overrun, driver.buf_overrun, driver.parity = 7, 10, 3
    assert counters.ask(serial_line.EVERY_NS - 1) == []
    dropped, damaged = counters.ask(serial_line.EVERY_NS)
    assert (dropped.kind, dropped.count, dropped.text) == ("dropped", 12, "ttyX: the driver could not keep 12 bytes.")
    assert (damaged.kind, damaged.count) == ("damaged", 3)
    assert "baud" in damaged.text
    assert counters.ask(2 * serial_line.EVERY_NS) == []
    driver.error = OSError(errno.EIO, "gone")
    assert counters.ask(3 * serial_line.EVERY_NS) == []
    driver = Driver()
    driver.error = OSError(errno.ENOTTY, "no")
    counters = serial_line.Overruns(7, "pty", ioctl=driver)
    assert counters.ask(0) == counters.ask(serial_line.EVERY_NS) == []
    assert driver.asked == 1


@dataclass
class Port:
    device: str
    description: str = "n/a"
    vid: int | None = None
    pid: int | None = None
    serial_number: str | None = None


PORTS = [
    Port("/dev/ttyS0"), Port("/dev/ttyUSB0", "FT232R", 0x0403, 0x6001, "A1"),
    Port("/dev/ttyUSB1", "FT232R", 0x0403, 0x6001, "A2"), Port("/dev/ttyACM0", "Pico", 0x2E8A, 0x0005, "B"),
]  # fmt: skip


def find(port):
    return serial_line.find_port(port, lambda: PORTS)


def kind_of(port, ports, words):
    with pytest.raises(NoLine, match=words) as no:
        serial_line.find_port(port, lambda: ports)
    return no.value.kind


def test_by_path_pattern_and_usb_identity_and_ports_of_this_machine(tmp_path, monkeypatch):
    (tmp_path / "ttyX1").touch()
    path = str(tmp_path / "ttyX1")
    assert find(path) == find(str(tmp_path / "ttyX*")) == path
    monkeypatch.chdir(tmp_path)
    pico = "/dev/ttyACM0"
    ports = {"ttyX?": "ttyX1", "auto:2e8a:0005": pico, "auto:2E8A:0005:B": pico, "auto:0403:6001:A2": "/dev/ttyUSB1"}
    assert {port: find(port) for port in ports} == ports
    (tmp_path / "ttyX2").touch()
    listed = r"There is no serial port .*/dev/ttyUSB1 \(FT232R\), /dev/ttyACM0 \(Pico\)"
    for port, kind, words in (
        (str(tmp_path / "ttyX*"), "ambiguous", "2 serial ports match"),
        ("auto:0403:6001", "ambiguous", "/dev/ttyUSB0, /dev/ttyUSB1; name one"),
        *((port, "absent", listed) for port in ("auto:0403:6001:A3", "auto:ffff:0001", "/dev/ttyNONE*", "none")),
    ):
        assert kind_of(port, PORTS, words) == kind
    assert kind_of("none", [], "the ports of this machine: none") == "absent"
    assert all(port.device for port in serial_line.list_ports())
    for port in ("", "auto:", "auto:403:6001", "auto:0403", "auto:0403:6001:"):
        with pytest.raises(ParameterError):
            serial_line.check_port(port)


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


def test_patience_that_can_never_be_right(make):
    for options in ({"gather": -1}, {"gather": 2}, {"gather": float("nan")}, {"silence": 0}):
        with pytest.raises(ParameterError):
            make(**options)
    for args in ((0,), (0.5, 0.1), (0.05, 0.5, 0.5)):
        with pytest.raises(ParameterError):
            BackOff(*args)
