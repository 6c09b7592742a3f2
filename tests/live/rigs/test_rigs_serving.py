"""Real ports in real time: pace, replug, stop; what is sent is what is read."""

import os
import select
import socket
import termios
import threading
import time
from io import BytesIO

import numpy as np
import pytest

from plumbob import decode, find_format
from plumbob.core.errors import ParameterError
from plumbob.live.rigs.rig import PLANS, make_rig
from plumbob.live.rigs.serving import FilePort, PtyPort, TcpPort, UdpPort, serve

LONG = 30.0


class Reader(threading.Thread):
    """Reads a terminal behind a link until told to stop; opens it again when it goes away."""

    def __init__(self, path):
        super().__init__(daemon=True)
        self.path, self.data, self.times, self.opened = path, b"", [], 0
        self.done = threading.Event()

    def run(self):
        while not self.done.is_set():
            try:
                fd = os.open(self.path, os.O_RDWR | os.O_NOCTTY)
            except OSError:
                time.sleep(0.002)
                continue
            self.opened += 1
            try:
                while self._take(fd):
                    pass
            finally:
                os.close(fd)

    def _take(self, fd):
        if not select.select([fd], [], [], 0.05)[0]:
            return not self.done.is_set()
        try:
            data = os.read(fd, 65536)
        except OSError:
            return False
        self.data += data
        if data:
            self.times.append(time.monotonic())
        return bool(data)


@pytest.fixture
def line(tmp_path):
    port = PtyPort(tmp_path / "line")
    reader = Reader(str(tmp_path / "line"))
    reader.start()
    yield port, reader
    reader.done.set()
    reader.join(LONG)


def rig_of(duration, **faults):
    return make_rig(PLANS["buoy"], find_format("buoy"), seed=2, duration=duration, faults=faults)


def test_a_terminal_in_real_time_keeps_its_pace(line):
    port, reader = line
    rig = rig_of(2.0)
    served = serve(rig, port, speed=1.0, stop=threading.Event())
    port.close()
    reader.done.set()
    reader.join(LONG)
    assert (served.sent, served.lost, served.unheard) == (200, 0, 0)
    assert reader.data == rig.stream()
    took = reader.times[-1] - reader.times[0]
    assert 1.95 < took < 3.9 + 1e-9 * served.latest_ns  # the last frame is due 1.99 s after the first
    assert not os.path.lexists(reader.path)


def test_ten_times_real_time_takes_a_tenth(line):
    port, _ = line
    start = time.monotonic()
    served = serve(rig_of(5.0), port, speed=10.0, stop=threading.Event())
    assert time.monotonic() - start >= 0.499
    assert served.sent == 500
    port.close()


def test_a_stop_ends_it_soon(line):
    port, _ = line
    stop = threading.Event()
    threading.Timer(0.3, stop.set).start()
    start = time.monotonic()
    served = serve(rig_of(100.0), port, speed=1.0, stop=stop)
    assert time.monotonic() - start < LONG
    assert served.sent < 9_000
    port.close()


def test_as_fast_as_wanted_nothing_is_lost_and_a_replug_is_another_terminal(line):
    port, reader = line
    rig = rig_of(40.0, unplug=0.001, flip=0.01)
    names, seen = [port.name], []
    served = serve(rig, port, speed=None, stop=threading.Event(), on_fault=seen.append)
    names.append(port.name)
    port.close()
    reader.done.set()
    reader.join(LONG)
    unplugged = [f for f in rig.faults if f.kind == "unplug"]
    assert unplugged
    assert tuple(seen) == rig.faults
    assert reader.opened >= 1 + len(unplugged)
    assert reader.data == rig.stream()
    assert served.lost == sum(f.count for f in unplugged)
    assert served.sent + served.lost == len(rig)


def test_in_real_time_the_port_is_away_for_its_second(line):
    """At five times real time, a fifth of it; who opens the new terminal late misses frames, and they are counted."""
    port, reader = line
    rig = rig_of(10.0, unplug=0.002)
    away = [f for f in rig.faults if f.kind == "unplug"]
    assert away
    served = serve(rig, port, speed=5.0, stop=threading.Event())
    port.close()
    reader.done.set()
    reader.join(LONG)
    assert served.sent + served.lost + served.unheard == len(rig)
    assert served.lost == sum(f.count for f in away)
    assert np.diff(reader.times).max() >= 0.99 / 5.0
    frames = decode(reader.data, rig.form)[0]["buoy"]
    assert len(frames) == served.sent


def test_stalled_frames_come_late_but_all_of_them_and_without_a_reader_it_waits():
    rig = rig_of(3.0, stall=0.03)
    out = BytesIO()
    served = serve(rig, FilePort(out, "-"), speed=20.0, stop=threading.Event())
    assert any(f.kind == "stall" for f in rig.faults)
    assert (rig.damage.send_ns - rig.due_ns).max() == 500_000_000
    assert (np.diff(rig.damage.send_ns) >= 0).all()
    assert out.getvalue() == rig.stream()
    assert served.sent == 300
    port, stop = PtyPort(), threading.Event()
    threading.Timer(0.1, stop.set).start()
    assert serve(rig_of(1.0), port, speed=None, stop=stop).sent == 0
    port.close()


def test_what_nobody_hears_is_counted():
    rig = rig_of(2.0)
    port = PtyPort()
    fd = os.open(port.name, os.O_RDWR | os.O_NOCTTY)
    threading.Timer(0.8, os.close, (fd,)).start()  # 0.5 s may be for opening it
    served = serve(rig, port, speed=2.0, stop=threading.Event())
    assert served.unheard > 0
    assert served.sent + served.unheard == len(rig)
    port.close()


@pytest.mark.parametrize(("sets_up", "takes"), [(False, 0.2), (True, 0.8)])
def test_a_reader_that_empties_the_line_in_opening_it_misses_nothing(sets_up, takes):
    """As pyserial does: what is sent between the two would be lost; who has begun may be stalled for longer."""
    rig, port, stop = rig_of(2.0), PtyPort(), threading.Event()
    sender = threading.Thread(target=serve, args=(rig, port), kwargs={"speed": 20.0, "stop": stop})
    sender.start()
    fd = os.open(port.name, os.O_RDWR | os.O_NOCTTY)
    if sets_up:
        modes = termios.tcgetattr(fd)
        modes[6][termios.VMIN] = 0
        termios.tcsetattr(fd, termios.TCSANOW, modes)
    time.sleep(takes)
    termios.tcflush(fd, termios.TCIFLUSH)
    got = b""
    while len(got) < len(rig.stream()) and select.select([fd], [], [], LONG)[0]:
        got += os.read(fd, 65536)
    sender.join(LONG)
    os.close(fd)
    port.close()
    assert got == rig.stream()


def test_a_reader_that_stalls_at_the_end_gets_the_rest():
    """For longer than a line may take that vanishes, before and between its reads."""
    port, data = PtyPort(), bytes(range(256)) * 12
    fd = os.open(port.name, os.O_RDWR | os.O_NOCTTY)
    termios.tcflush(fd, termios.TCIFLUSH)
    assert port.heard()
    assert port.send([data]) == 1
    closing = threading.Thread(target=port.close)
    closing.start()
    got = b""
    for _ in range(2):
        time.sleep(1.2)
        got += os.read(fd, len(data) // 2)
    closing.join(LONG)
    os.close(fd)
    assert got == data


@pytest.mark.parametrize("leaves", [True, False], ids=["leaves", "stays"])
def test_nobody_waits_for_a_reader_that_leaves_or_once_stopped(leaves):
    stop = threading.Event()
    port = PtyPort(stop=stop)
    fd = os.open(port.name, os.O_RDWR | os.O_NOCTTY)
    termios.tcflush(fd, termios.TCIFLUSH)
    assert port.send([bytes(100)]) == 1
    closing = threading.Thread(target=port.close)
    closing.start()
    if leaves:
        os.close(fd)
    else:
        stop.set()
    closing.join(LONG)
    assert not closing.is_alive()
    if not leaves:
        os.close(fd)


def test_a_link_does_not_replace_a_file(tmp_path):
    (tmp_path / "log.bin").write_bytes(b"precious")
    with pytest.raises(ParameterError, match="would destroy it"):
        PtyPort(tmp_path / "log.bin")
    assert (tmp_path / "log.bin").read_bytes() == b"precious"


def test_tcp_serves_one_reader_to_the_last_byte():
    rig, port, got = rig_of(20.0), TcpPort("127.0.0.1", 0), []

    def read():
        with socket.create_connection(("127.0.0.1", int(port.name.rpartition(":")[2])), timeout=LONG) as caller:
            while data := caller.recv(65536):
                got.append(data)

    reader = threading.Thread(target=read)
    reader.start()
    serve(rig, port, speed=None, stop=threading.Event())
    port.close()
    reader.join(LONG)
    assert b"".join(got) == rig.stream()


def test_udp_sends_a_frame_in_a_datagram():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as inbox:
        inbox.bind(("127.0.0.1", 0))
        inbox.settimeout(LONG)
        rig, port = rig_of(0.5), UdpPort("127.0.0.1", inbox.getsockname()[1])
        serve(rig, port, speed=None, stop=threading.Event())
        port.close()
        assert [inbox.recv(2048) for _ in range(50)] == rig.payloads(0, 50)


def test_noise_of_a_million_bytes_passes_through_a_terminal(line):
    port, reader = line
    rig = rig_of(20.0, burst=0.001)
    assert len(rig.stream()) > 1_000_000
    serve(rig, port, speed=None, stop=threading.Event())
    port.close()
    reader.done.set()
    reader.join(LONG)
    assert reader.data == rig.stream()
    found, counts = decode(reader.data, rig.form)
    assert len(found["buoy"]) == len(rig)
    assert counts.junk == 1_000_000 * len(rig.faults)
