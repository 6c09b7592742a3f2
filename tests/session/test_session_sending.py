"""`plumbob.send`: a file to sockets, ports and files, at the pace that is asked for."""

import json
import os
import pty
import socket
import threading
import time
import tty
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pynmeagps import NMEAReader

import plumbob
from plumbob.acquisition import outgoing
from plumbob.acquisition.outgoing import FileTarget, Sender, SerialPort, Tcp, TcpServer, Udp, parse_target
from plumbob.acquisition.transport import BackOff
from plumbob.cli.main import main
from plumbob.core import flags, units
from plumbob.core.errors import DecodeError, FrameError, LineError, ParameterError, ShapeError
from plumbob.data import AttitudeTrack
from plumbob.rotations import Frame, North, quat_from_euler_zyx
from plumbob.session.send_spec import parse_send
from plumbob.session.sending import Due, send


def swinging(count: int, rate: float = 100.0, **more: Any) -> AttitudeTrack:
    """Heading of as many hundredths of a degree as the number of the sample, so that a receiver can count."""
    t = np.arange(count) / rate
    yaw = units.deg((np.arange(count) % 36000) / 100.0)
    q = quat_from_euler_zyx(np.stack([yaw, 0.0 * yaw, 0.0 * yaw], axis=1))
    return AttitudeTrack(**{"t": t, "q_nb": q, "frame": Frame.NED, "north": North.TRUE} | more)


def numbers(data: bytes) -> list[int]:
    """Hundredths of degrees of all HDT."""
    return [round(100 * float(line.split(b",")[1])) for line in data.split(b"\r\n") if line]


class Listening:
    """Reads datagrams from a thread until `ended` is called and nothing more has come for a while."""

    def __init__(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        self.socket.bind(("127.0.0.1", 0))
        self.to = f"udp:127.0.0.1:{self.socket.getsockname()[1]}"
        self.found, self.times = list[bytes](), list[float]()
        self.socket.settimeout(1.0)
        self._sent = threading.Event()
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        with self.socket:
            while True:
                sent = self._sent.is_set()
                try:
                    self.found.append(self.socket.recv(65536))
                    self.times.append(time.monotonic())
                except TimeoutError:
                    if sent:
                        return

    def ended(self) -> list[bytes]:
        self._sent.set()
        self._thread.join()
        return self.found


class Terminal:
    """A pseudo-terminal whose other end is read from a thread."""

    def __init__(self) -> None:
        self.master, slave = pty.openpty()
        tty.setraw(slave)
        self.device, self._slave = os.ttyname(slave), slave
        self.data = bytearray()
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        try:
            while data := os.read(self.master, 65536):
                self.data += data
        except OSError:
            return

    def wait(self, size: int) -> bytes:
        end = time.monotonic() + 5.0
        while len(self.data) < size and time.monotonic() < end:
            time.sleep(0.01)
        return bytes(self.data)


def test_udp_at_true_pace_in_sequence() -> None:
    reader = Listening()
    began = time.monotonic()
    result = send(swinging(100), "nmea", reader.to, sentences="HDT")
    assert 0.9 < time.monotonic() - began < 3.0
    assert numbers(b"".join(reader.ended())) == list(range(100)) and result.messages == result.attitudes == 100
    assert float(NMEAReader.parse(reader.found[41]).headingT) == 0.41


def test_rate_and_speed() -> None:
    reader = Listening()
    result = send(swinging(1000), "nmea", reader.to, sentences="HDT", rate="10Hz", speed=50)
    assert numbers(b"".join(reader.ended())) == list(range(0, 1000, 10)) and result.seconds < 5.0


def test_serial_port(tmp_path: Path) -> None:
    terminal = Terminal()
    send(swinging(300), "nmea", f"serial:{terminal.device}@38400", sentences="HDT", speed="max")
    assert numbers(terminal.wait(300 * len(b"$HEHDT,0.00,T*00\r\n"))) == list(range(300))


def test_file_is_written_and_never_replaced(tmp_path: Path) -> None:
    file = tmp_path / "out.nmea"
    send(swinging(20), "nmea", f"file:{file}", sentences=["HDT"], speed="max")
    assert numbers(file.read_bytes()) == list(range(20))
    with pytest.raises(ParameterError, match="exists already"):
        send(swinging(5), "nmea", f"file:{file}", sentences=["HDT"], speed="max")
    assert numbers(file.read_bytes()) == list(range(20))
    send(swinging(5), "nmea", f"file:{file}", sentences=["HDT"], speed="max", overwrite=True)
    assert numbers(file.read_bytes()) == list(range(5))
    with pytest.raises(DecodeError, match="no folder"):
        send(swinging(5), "nmea", f"file:{tmp_path}/none/x", speed="max")
    with pytest.raises(DecodeError, match="it is a folder"):
        send(swinging(5), "nmea", f"file:{tmp_path}", speed="max")
    (loop := tmp_path / "loop").symlink_to(loop)
    with pytest.raises(DecodeError, match="leads back to itself"):
        send(swinging(5), "nmea", f"file:{loop}", speed="max", overwrite=True)


def joining(port: int) -> bytes:
    with socket.create_connection(("127.0.0.1", port), timeout=5.0) as sock:
        found = b""
        while data := sock.recv(65536):
            found += data
    return found


def test_tcp_server_waits_for_a_client() -> None:
    found: dict[str, bytes] = {}
    threads = []

    def opened(target: Any) -> None:
        threads.append(threading.Thread(target=lambda: found.update(all=joining(target.port))))
        threads[0].start()

    result = send(swinging(2000), "nmea", "tcp-listen:0", sentences="HDT", speed="max", opened=opened)
    threads[0].join()
    assert numbers(found["all"]) == list(range(2000)) and result.dropped == 0


def test_tcp_client() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        found: dict[str, bytes] = {}

        def read() -> None:
            sock, _ = server.accept()
            data = b""
            while part := sock.recv(65536):
                data += part
            sock.close()
            found["all"] = data

        thread = threading.Thread(target=read)
        thread.start()
        send(swinging(500), "nmea", f"tcp:127.0.0.1:{port}", sentences="HDT", speed="max")
        thread.join()
    assert numbers(found["all"]) == list(range(500))
    with pytest.raises(LineError, match="refused"):
        send(swinging(5), "nmea", f"tcp:127.0.0.1:{port}", speed="max")


def test_flags_of_what_is_left_out_are_carried() -> None:
    words = np.zeros(20, dtype=np.uint32)
    words[3] = flags.GAP
    reader = Listening()
    send(swinging(20, flags=words), "json", reader.to, rate=10, speed="max")
    told = [json.loads(data) for data in reader.ended()]
    assert [one["t_s"] for one in told] == [0.0, 0.1] and [one["flags"] for one in told] == [[], ["gap"]]


def test_due_keeps_the_rate_with_jitter() -> None:
    rng = np.random.default_rng(3)
    t_ns = [int(i * 1e7 + rng.uniform(-1e6, 1e6)) for i in range(1000)]
    rows, _ = Due(100.0).rows(t_ns, [0] * 1000)
    assert len(rows) == 1000  # 100 Hz of 100 Hz leaves nothing out
    assert len(Due(30.0).rows(t_ns, [0] * 1000)[0]) in (299, 300, 301)
    late = Due(10.0)
    late.rows([0], [0])
    assert late.rows([10_000_000_000, 10_010_000_000, 10_100_000_000], [0] * 3)[0] == [0, 2]  # no burst after a gap


def test_what_has_no_attitude_or_heading_is_refused() -> None:
    free = swinging(3, north=North.FREE)
    with pytest.raises(FrameError, match="arbitrary zero"):
        send(free, "nmea", "udp:127.0.0.1:9", sentences="HDT")
    alone = plumbob.Recording(imu=plumbob.ImuData(t=[0.0], gyr=[[0, 0, 0]], acc=[[0, 0, 9.8]]), name="alone")
    with pytest.raises(ShapeError, match="no attitude"):
        send(alone, "nmea", "udp:127.0.0.1:9")


@pytest.mark.parametrize(
    ("text", "kind"),
    [("udp:127.0.0.1:5", Udp), ("tcp:[::1]:5", Tcp), ("tcp-listen:5", TcpServer), ("serial:/dev/ttyX@4800", SerialPort),
     ("file:x.nmea", FileTarget), ("-", FileTarget)],
)  # fmt: skip
def test_targets(text: str, kind: type) -> None:
    target = parse_target(text)
    assert isinstance(target, kind)
    if isinstance(target, TcpServer):
        assert target.host == "127.0.0.1"  # no other machine, unless it is asked for


@pytest.mark.parametrize(
    "text", ["", "udp", "udp:5", "udp::5", "udp:h:0", "tcp:h:99999", "serial:/dev/x", "serial:@5", "file:", "http://x"]
)
def test_what_is_not_a_target(text: str) -> None:
    with pytest.raises(ParameterError):
        parse_target(text)


def test_send_words() -> None:
    spec = parse_send("nmea udp:127.0.0.1:10110 10Hz hdt,PASHR flu")
    assert (spec.kind, spec.to, spec.rate, spec.sentences, spec.body) == (
        "nmea", "udp:127.0.0.1:10110", 10.0, ("HDT", "PASHR"), "FLU",
    )  # fmt: skip
    for wrong in (
        "nmea",
        "nmae udp:h:1",
        "json udp:h:1 HDT",
        "nmea udp:h:1 1Hz 2Hz",
        "ros2 udp:h:1",
        "nmea udp:h:1 GGA",
    ):
        with pytest.raises(ParameterError):
            parse_send(wrong)


def test_upside_down_is_said() -> None:
    notes: list[str] = []
    enu = AttitudeTrack(t=[0.0], q_nb=[[1, 0, 0, 0]], frame=Frame.NED, north=North.TRUE)
    turned = AttitudeTrack(t=[0.0], q_nb=[[0, 1, 0, 0]], frame=Frame.NED, north=North.TRUE)
    reader = Listening()
    send(enu, "json", reader.to, note=notes.append)
    assert not notes
    send(turned, "json", reader.to, note=notes.append)
    assert "--body FLU" in notes[0]
    notes.clear()
    send(turned, "json", reader.to, note=notes.append, body="FLU")
    assert not notes
    assert [json.loads(data)["roll_deg"] for data in reader.ended()] == [0.0, 180.0, 0.0]


# Targets that are slow, closed or away: who hands over a message never waits.


def until(test: Any, seconds: float = 5.0) -> bool:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if test():
            return True
        time.sleep(0.01)
    return False


def test_slow_client_is_left_behind_and_the_other_is_not() -> None:
    server = TcpServer("127.0.0.1", 0)
    server.open()
    slow = socket.socket()
    slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    slow.connect(("127.0.0.1", server.port))
    found: dict[str, bytes] = {}
    thread = threading.Thread(target=lambda: found.update(all=joining(server.port)))
    thread.start()
    assert until(lambda: server.tend() or len(server.clients) == 2)
    lost, count = 0, 60_000
    for i in range(count):
        began = time.monotonic()
        lost += server.write(b"%08d" % i + b"x" * 190 + b"\r\n", 0.0)
        assert time.monotonic() - began < 1.0
        if i % 50 == 0:
            time.sleep(0.0005)
    server.close()
    thread.join()
    slow.close()
    rows = [int(line[:8]) for line in found["all"].splitlines()]
    assert lost > 1000 and all(len(line) == 198 for line in found["all"].splitlines())
    assert rows == sorted(set(rows)) and len(rows) > 0.9 * count


def test_closed_client_is_no_end() -> None:
    server = TcpServer("127.0.0.1", 0)
    sender = Sender(server, "tcp-listen")
    assert until(lambda: server.port)
    with socket.create_connection(("127.0.0.1", server.port)):
        assert until(lambda: server.clients)
    for _ in range(50):
        sender.put(b"x" * 100)
        time.sleep(0.005)
    assert until(lambda: not server.clients)
    sender.close()
    assert sender.sent == 50


def test_refused_connection_is_tried_again() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    sender = Sender(Tcp("127.0.0.1", port), "tcp", backoff=BackOff(0.02, 0.1))
    assert until(lambda: sender._events)
    began = time.monotonic()
    for i in range(3 * outgoing.QUEUE):
        sender.put(b"%d\n" % i)
    assert time.monotonic() - began < 1.0 and sender.dropped == 2 * outgoing.QUEUE
    with socket.create_server(("127.0.0.1", port)) as server:
        sock, _ = server.accept()
        assert sock.recv(100).startswith(b"%d\n" % (2 * outgoing.QUEUE))
        sock.close()
    assert [event.kind for event in sender.take_events()][:2] == ["absent", "opened"]
    sender.close()


def test_unplugged_port_is_an_event_and_comes_back(tmp_path: Path) -> None:
    link = tmp_path / "port"
    first = Terminal()
    link.symlink_to(first.device)
    sender = Sender(SerialPort(str(link), 38400), "serial", backoff=BackOff(0.02, 0.1))
    sender.put(b"before\n")
    assert first.wait(7) == b"before\n"
    second = Terminal()
    link.unlink()
    link.symlink_to(second.device)
    os.close(first._slave)
    os.close(first.master)
    kinds: list[str] = []

    def back() -> bool:
        sender.put(b"after\n")
        kinds.extend(event.kind for event in sender.take_events())
        return b"after\n" in second.data

    assert until(back)
    sender.close()
    assert kinds[:2] == ["opened", "lost"] and "opened" in kinds[2:]


def test_full_pipe_drops_and_does_not_stall(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    sender = Sender(FileTarget(pipe), "pipe", backoff=BackOff(0.02, 0.1))
    assert until(lambda: sender._events)
    assert sender.take_events()[0].kind == "absent"  # nobody reads it yet
    fd = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    assert until(lambda: sender._events)
    began = time.monotonic()
    for i in range(3000):
        sender.put(b"%06d" % i + b"x" * 192 + b"\r\n")
    assert time.monotonic() - began < 1.0
    time.sleep(0.5)
    sender.close(0.5)
    assert sender.dropped > 1000
    data = os.read(fd, 1 << 20)
    os.close(fd)
    assert all(len(line) == 198 for line in data.split(b"\r\n") if line) and len(data) > 10_000


# The command line.


def saved(tmp_path: Path) -> Path:
    path = tmp_path / "track.parquet"
    plumbob.write(path, plumbob.Recording(track=swinging(50)))
    return path


def test_cli(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    track, out = saved(tmp_path), tmp_path / "out.nmea"
    words = [
        "send",
        str(track),
        "--as",
        "nmea",
        "--to",
        f"file:{out}",
        "--speed",
        "max",
        "--sentences",
        "HDT",
        "--json",
    ]
    assert main(words) == 0
    assert json.loads(capfd.readouterr().out)["messages"] == 50
    assert numbers(out.read_bytes()) == list(range(50))
    assert main(words) == 1 and "exists already" in capfd.readouterr().err
    assert main(["send", str(track), "--as", "json", "--to", "-", "--speed", "max", "--rate", "10Hz"]) == 0
    lines = capfd.readouterr().out.splitlines()
    assert [json.loads(line)["t_s"] for line in lines] == [0.0, 0.1, 0.2, 0.3, 0.4]


def test_cli_ros2_from_a_file(tmp_path: Path) -> None:
    out = tmp_path / "out.mcap"
    assert main(["send", str(saved(tmp_path)), "--as", "ros2", "--to", f"file:{out}", "--speed", "max"]) == 0
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    with AnyReader([out], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        assert sum(1 for _ in reader.messages()) == 50


@pytest.mark.long("an hour of 100 Hz, at 60 times its pace")
def test_an_hour_over_udp_without_loss() -> None:
    count = 360_000
    reader = Listening()
    result = send(swinging(count), "nmea", reader.to, sentences="HDT", speed=60)
    found = numbers(b"".join(reader.ended()))
    assert result.messages == count and found == [i % 36000 for i in range(count)]


@pytest.mark.long("an hour of 100 Hz over a pseudo-terminal")
def test_an_hour_over_a_terminal_without_loss() -> None:
    count, terminal = 360_000, Terminal()
    send(swinging(count), "nmea", f"serial:{terminal.device}@115200", sentences="HDT", speed="max")
    time.sleep(1.0)
    assert numbers(bytes(terminal.data)) == [i % 36000 for i in range(count)]


def test_a_file_on_a_disk_that_is_full_is_not_left_half_written(tmp_path: Path) -> None:
    """A limit of the size of files, as a full disk is none that a test may make; the interpreter ignores its signal."""
    import resource

    out = tmp_path / "half.jsonl"
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, before[1]))
    try:
        with pytest.raises(LineError, match=r"half\.jsonl"):
            send(swinging(2000), "json", f"file:{out}", speed=100)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert not out.exists()
