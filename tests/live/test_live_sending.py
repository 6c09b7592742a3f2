"""`plumbob.send`: a file to sockets, ports and files, at the pace that is asked for."""

import json
import os
import pty
import re
import socket
import threading
import time
import tty
from contextlib import suppress

import numpy as np
import pytest
from pynmeagps import NMEAReader

import plumbob
from plumbob import AttitudeTrack, flags, send, units
from plumbob.cli.main import main
from plumbob.core.errors import DecodeError, FrameError, LineError, ParameterError, PlumbobError, ShapeError
from plumbob.live.sending import Due
from plumbob.live.session import parse_send
from plumbob.live.session_toml import load_session
from plumbob.live.transports import outgoing
from plumbob.live.transports.outgoing import FileTarget, Sender, SerialPort, Tcp, TcpServer, Udp, parse_target
from plumbob.live.transports.transport import BackOff
from plumbob.rotations import Frame, North, quat_from_euler_zyx
from tests.helpers import beside, full_disk, until
from tests.helpers.commandline import emulated

HDT = len(b"$HEHDT,0.00,T*00\r\n")
SOON = BackOff(0.02, 0.1)


def swinging(count, **more):
    """At 100 Hz, a heading of as many hundredths of a degree as the number of the sample, for a receiver to count."""
    yaw = units.deg((np.arange(count) % 36000) / 100.0)
    q_nb = quat_from_euler_zyx(np.stack([yaw, 0.0 * yaw, 0.0 * yaw], axis=1))
    return AttitudeTrack(
        **{"t": np.arange(count) / 100.0, "q_nb": q_nb, "frame": Frame.NED, "north": North.TRUE} | more
    )


def numbers(data):
    """Hundredths of degrees of all HDT."""
    return [round(100 * float(line.split(b",")[1])) for line in data.split(b"\r\n") if line]


class Reading:
    """What a reader gives, in a thread of its own, until it gives nothing."""

    def __init__(self, read):
        self.data, self.chunks = bytearray(), []
        self.thread = threading.Thread(target=self.run, args=(read,), daemon=True)
        self.thread.start()

    def run(self, read):
        with suppress(OSError):
            while data := read():
                self.chunks.append(data)
                self.data += data

    def all(self):
        self.thread.join()
        return bytes(self.data)


class Listening(Reading):
    """Reads datagrams until `ended` is called."""

    def __init__(self):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        self.socket.bind(("127.0.0.1", 0))
        self.to = f"udp:127.0.0.1:{self.socket.getsockname()[1]}"
        super().__init__(lambda: self.socket.recv(65536))

    def ended(self):
        self.socket.sendto(b"", self.socket.getsockname())
        self.thread.join()
        self.socket.close()
        return self.chunks


class Terminal(Reading):
    """A pseudo-terminal whose other end is read."""

    def __init__(self):
        self.master, self.slave = pty.openpty()
        tty.setraw(self.slave)
        self.device = os.ttyname(self.slave)
        super().__init__(lambda: os.read(self.master, 65536))

    def wait(self, size):
        until(lambda: len(self.data) >= size)
        return bytes(self.data)

    def close(self):
        os.close(self.slave)
        self.thread.join()
        os.close(self.master)


class Joining(Reading):
    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=30.0)
        super().__init__(lambda: self.socket.recv(65536))

    def all(self):
        data = super().all()
        self.socket.close()
        return data


def test_udp_at_its_pace_rate_and_speed_with_flags():
    reader, began = Listening(), time.monotonic()
    result = send(swinging(50), "nmea", reader.to, sentences="HDT")
    assert time.monotonic() - began > 0.45
    assert numbers(b"".join(reader.ended())) == list(range(50))
    assert result.messages == result.attitudes == 50
    assert float(NMEAReader.parse(reader.chunks[41]).headingT) == 0.41
    reader = Listening()
    result = send(swinging(1000), "nmea", reader.to, sentences="HDT", rate="10Hz", speed=50)
    assert numbers(b"".join(reader.ended())) == list(range(0, 1000, 10)) and result.seconds < 5.0
    words = np.zeros(20, dtype=np.uint32)
    words[3] = flags.GAP
    reader = Listening()
    send(swinging(20, flags=words), "json", reader.to, rate=10, speed="max")
    messages = [json.loads(data) for data in reader.ended()]
    assert [(message["t_s"], message["flags"]) for message in messages] == [(0.0, []), (0.1, ["gap"])]


def test_serial_port_and_tcp_client():
    terminal = Terminal()
    send(swinging(300), "nmea", f"serial:{terminal.device}@38400", sentences="HDT", speed="max")
    assert numbers(terminal.wait(300 * HDT)) == list(range(300))
    terminal.close()
    with socket.create_server(("127.0.0.1", 0)) as server:
        to = f"tcp:127.0.0.1:{server.getsockname()[1]}"
        send(swinging(500), "nmea", to, sentences="HDT", speed="max")
        sock, _ = server.accept()
        with sock:
            assert numbers(Reading(lambda: sock.recv(65536)).all()) == list(range(500))
    with pytest.raises(LineError, match="refused"):
        send(swinging(5), "nmea", to, speed="max")


def test_file_is_written_and_never_replaced(tmp_path):
    file, words = tmp_path / "out.nmea", {"sentences": ["HDT"], "speed": "max"}
    alone = plumbob.Recording(imu=plumbob.ImuData(t=[0.0], gyr=[[0, 0, 0]], acc=[[0, 0, 9.8]]), name="alone")
    (loop := tmp_path / "loop").symlink_to(loop)
    send(swinging(20), "nmea", f"file:{file}", **words)
    assert numbers(file.read_bytes()) == list(range(20))
    for what, path, overwrite, error, message in (
        (swinging(5), file, False, ParameterError, "exists already"),
        (swinging(5), tmp_path / "none" / "x", False, DecodeError, "no folder"),
        (swinging(5), tmp_path, False, DecodeError, "it is a folder"),
        (swinging(5), loop, True, DecodeError, "points to itself"),
        (swinging(5, north=North.FREE), file, True, FrameError, "arbitrary zero"),
        (alone, file, True, ShapeError, "no attitude"),
    ):
        with pytest.raises(error, match=message):
            send(what, "nmea", f"file:{path}", overwrite=overwrite, **words)
    assert numbers(file.read_bytes()) == list(range(20))
    send(swinging(5), "nmea", f"file:{file}", overwrite=True, **words)
    assert numbers(file.read_bytes()) == list(range(5))


def test_tcp_server_waits_for_a_client():
    clients, connecting = [], []

    def opened(target):
        connecting.append(threading.Thread(target=lambda: clients.append(Joining(target.port))))
        connecting[0].start()

    result = send(swinging(2000), "nmea", "tcp-listen:0", sentences="HDT", speed="max", opened=opened)
    connecting[0].join()
    assert numbers(clients[0].all()) == list(range(2000)) and result.dropped == 0


def test_due_keeps_the_rate_with_jitter_and_targets_have_their_words():
    rng = np.random.default_rng(3)
    t_ns = [int(i * 1e7 + rng.uniform(-1e6, 1e6)) for i in range(1000)]
    rows, _ = Due(100.0).rows(t_ns, [0] * 1000)
    assert len(rows) == 1000  # 100 Hz of 100 Hz leaves nothing out
    assert len(Due(30.0).rows(t_ns, [0] * 1000)[0]) in (299, 300, 301)
    late = Due(10.0)
    late.rows([0], [0])
    assert late.rows([10_000_000_000, 10_010_000_000, 10_100_000_000], [0] * 3)[0] == [0, 2]  # no burst after a gap
    kinds = {"udp:127.0.0.1:5": Udp, "tcp:[::1]:5": Tcp, "tcp-listen:5": TcpServer, "serial:/dev/ttyX@4800": SerialPort}
    kinds |= {"file:x.nmea": FileTarget, "-": FileTarget}
    assert {text: type(parse_target(text)) for text in kinds} == kinds
    assert parse_target("tcp-listen:5").host == "127.0.0.1"  # no other machine, unless it is asked for

    for text in ("", "udp:5", "udp::5", "udp:h:0", "tcp:h:99999", "serial:/dev/x", "serial:@5", "file:", "http://x"):
        with pytest.raises(ParameterError):
            parse_target(text)
    spec = parse_send("nmea udp:127.0.0.1:10110 10Hz hdt,PASHR flu")
    assert (spec.kind, spec.to, spec.rate) == ("nmea", "udp:127.0.0.1:10110", 10.0)
    assert (spec.sentences, spec.body) == (("HDT", "PASHR"), "FLU")
    for wrong in ("nmea", "nmae udp:h:1", "json udp:h:1 HDT", "nmea udp:h:1 1Hz 2Hz", "ros2 udp:h:1", "nmea udp:h:1 G"):
        with pytest.raises(ParameterError):
            parse_send(wrong)


def test_upside_down_is_said():
    level, turned = (swinging(1, q_nb=[q_nb]) for q_nb in ([1, 0, 0, 0], [0, 1, 0, 0]))
    notes, reader = [], Listening()
    for track, more in ((level, {}), (turned, {"body": "FLU"}), (turned, {})):
        assert not notes
        send(track, "json", reader.to, note=notes.append, **more)
    assert "--body FLU" in notes[0]
    assert [json.loads(data)["roll_deg"] for data in reader.ended()] == [0.0, 0.0, 180.0]


# Targets that are slow, closed or away: who hands over a message never waits.


def test_slow_client_is_left_behind_and_the_other_is_not():
    server, slow = TcpServer("127.0.0.1", 0), socket.socket()
    server.open()
    slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    slow.connect(("127.0.0.1", server.port))
    fast = Joining(server.port)
    until(lambda: server.tend() or len(server.clients) == 2)
    lost, count = 0, 4_000
    for i in range(count):
        lost += server.write(b"%08d" % i + b"x" * 1990 + b"\r\n", 0.0)
        if i % 200 == 199:  # fewer than wait for a client at most
            until(lambda size=2000 * (i + 1): server.tend() or len(fast.data) == size)
    server.close()
    slow.close()
    lines = fast.all().splitlines()
    assert lost > 1000 and {len(line) for line in lines} == {1998}
    assert [int(line[:8]) for line in lines] == list(range(count))


def test_closed_client_is_no_end_and_a_sender_with_nothing_to_send_waits_without_a_processor():
    server, count = TcpServer("127.0.0.1", 0), 0
    sender = Sender(server, "tcp-listen")
    until(lambda: server.port)
    with socket.create_connection(("127.0.0.1", server.port)):
        until(lambda: server.clients)
    while server.clients or count < 50:
        sender.put(b"x" * 100)
        count += 1
        time.sleep(0.005)
    sender.close()
    assert sender.sent == count
    sender = Sender(TcpServer("127.0.0.1", 0), "tcp-listen")
    begun = time.process_time()
    time.sleep(0.5)
    assert time.process_time() - begun < 0.05
    sender.close()


def test_refused_connection_is_tried_again():
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))  # nobody listens yet
        sender, events = Sender(Tcp("127.0.0.1", server.getsockname()[1]), "tcp", backoff=SOON), []
        until(lambda: events.extend(sender.take_events()) or events)
        for i in range(3 * outgoing.QUEUE):
            sender.put(b"%d\n" % i)
        assert sender.dropped == 2 * outgoing.QUEUE
        server.listen()
        sock, _ = server.accept()
        with sock:
            assert sock.recv(100).startswith(b"%d\n" % (2 * outgoing.QUEUE))
    assert [event.kind for event in events + sender.take_events()][:2] == ["absent", "opened"]
    sender.close()


def test_unplugged_port_is_an_event_and_comes_back(tmp_path):
    link, first, kinds = tmp_path / "port", Terminal(), []
    link.symlink_to(first.device)
    sender = Sender(SerialPort(str(link), 38400), "serial", backoff=SOON)
    sender.put(b"before\n")
    assert first.wait(7) == b"before\n"
    second = Terminal()
    link.unlink()
    link.symlink_to(second.device)
    os.close(first.slave)
    os.close(first.master)

    def back():
        sender.put(b"after\n")
        kinds.extend(event.kind for event in sender.take_events())
        return b"after\n" in second.data

    until(back)
    sender.close()
    second.close()
    assert kinds[:2] == ["opened", "lost"] and "opened" in kinds[2:]


def test_full_pipe_drops_and_does_not_stall(tmp_path):
    pipe, kinds = tmp_path / "pipe", []
    os.mkfifo(pipe)
    sender = Sender(FileTarget(pipe), "pipe", backoff=SOON)
    come = lambda kind: lambda: kinds.extend(e.kind for e in sender.take_events()) or kinds == kind  # noqa: E731
    until(come(["absent"]))  # nobody reads it yet
    fd = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    until(come(["absent", "opened"]))
    for i in range(3000):
        sender.put(b"%06d" % i + b"x" * 192 + b"\r\n")
    sender.close(0.5)
    assert sender.dropped > 1000
    data = os.read(fd, 1 << 20)
    os.close(fd)
    assert all(len(line) == 198 for line in data.split(b"\r\n") if line) and len(data) > 10_000


# The command line.


@pytest.fixture
def saved(tmp_path):
    plumbob.write(tmp_path / "track.parquet", plumbob.Recording(track=swinging(50)))
    return "send", str(tmp_path / "track.parquet"), "--speed", "max"


def test_cli(saved, tmp_path, capfd):
    out = tmp_path / "out.nmea"
    words = [*saved, "--as", "nmea", "--to", f"file:{out}", "--sentences", "HDT", "--json"]
    assert main(words) == 0
    assert json.loads(capfd.readouterr().out)["messages"] == 50
    assert numbers(out.read_bytes()) == list(range(50))
    assert main([*saved, "--as", "json", "--to", "-", "--rate", "10Hz"]) == 0
    lines = capfd.readouterr().out.splitlines()
    assert [json.loads(line)["t_s"] for line in lines] == [0.0, 0.1, 0.2, 0.3, 0.4]
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    assert main([*saved, "--as", "ros2", "--to", f"file:{tmp_path / 'out.mcap'}"]) == 0
    with AnyReader([tmp_path / "out.mcap"], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        assert sum(1 for _ in reader.messages()) == 50


@pytest.mark.long("an hour of 100 Hz, at 60 times its pace")
def test_an_hour_over_udp_without_loss():
    reader = Listening()
    result = send(swinging(360_000), "nmea", reader.to, sentences="HDT", speed=60)
    assert numbers(b"".join(reader.ended())) == [i % 36000 for i in range(360_000)]
    assert result.messages == 360_000


def test_a_file_on_a_disk_that_is_full_is_not_left_half_written(tmp_path):
    with full_disk(4096), pytest.raises(LineError, match=r"half\.jsonl"):
        send(swinging(2000), "json", f"file:{tmp_path / 'half.jsonl'}", speed=100)
    assert list(tmp_path.iterdir()) == []


BUOY = beside(__file__, "buoy.session.toml")


def session(folder, more):
    (folder / "s.toml").write_text(BUOY + more, encoding="utf-8")
    return folder / "s.toml"


def received(sock):
    sock.settimeout(0.3)
    messages = []
    with suppress(TimeoutError):
        while True:
            messages.append(json.loads(sock.recv(65536)))
    return messages


def test_live_and_replayed(tmp_path):
    """A target that refuses all the time costs the recording nothing; the other gets 10 a second."""
    sea, notes = tmp_path / "sea.mcap", []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock, emulated(tmp_path, "--duration 30s") as line:
        sock.bind(("127.0.0.1", 0))
        more = f'[source]\nkind = "serial"\nport = "{line}"\nbaud = 115200\n[record]\npath = "{sea}"\n'
        more += f'[[send]]\nas = "json"\nto = "udp:127.0.0.1:{sock.getsockname()[1]}"\nrate = "10 Hz"\n'
        path = session(tmp_path, more)
        assert load_session(path).send[0].rate == 10.0
        result = plumbob.record(path, duration=3.0, send=["nmea tcp:127.0.0.1:1 10Hz"], note=notes.append)
        messages = received(sock)
    assert not result.failed and not result.lossy
    assert result.recording is not None and result.recording["acknowledged"] == result.recording["rows"]
    assert any("tcp:127.0.0.1:1 cannot be opened now" in line for line in notes)
    assert 20 <= len(messages) <= 31 and messages[0]["utc"].startswith("20")
    assert messages[-1]["sigma_deg"].keys() == {"roll", "pitch", "heading"}
    assert messages[-1]["rate_dps"] is not None and abs(messages[-1]["acc_m_s2"][2] + 9.8) < 5.0  # forward-right-down

    file = tmp_path / "out.nmea"
    replayed = plumbob.replay(sea, send=[f"nmea file:{file} 10Hz XDR,PASHR"])
    lines = file.read_bytes().splitlines(keepends=True)
    assert {line[:6] for line in lines} == {b"$IIXDR", b"$PASHR"}
    assert len(lines) == pytest.approx(2 * 10 * replayed.track.t[-1], abs=4)
    assert all(NMEAReader.parse(line) is not None for line in lines)

    sent = plumbob.send(sea, "json", f"file:{tmp_path / 'again.jsonl'}", speed="max", rate="10Hz")
    again = [json.loads(line) for line in (tmp_path / "again.jsonl").read_text().splitlines()]
    apart = np.datetime64(again[0]["utc"][:-1]) - np.datetime64(messages[0]["utc"][:-1])
    assert abs(apart) < np.timedelta64(1, "ms")  # the clocks are compared once for the recording, once for the target
    assert sent.attitudes == len(again)
    assert again[-1]["sigma_deg"]["roll"] is not None


def test_what_does_not_go_together_and_a_file_read_faster_than_live_says_how_much_is_not_sent(tmp_path):
    port = {"port": str(tmp_path), "format": "buoy"}
    with pytest.raises(ParameterError, match="nothing estimates"):
        plumbob.record(**port, send=["json udp:127.0.0.1:9"])
    with pytest.raises(PlumbobError, match="needs a form and a target"):
        plumbob.record(**port, frame="NED", filter="mekf", send=["json"])
    with pytest.raises(PlumbobError, match="send"):
        load_session(session(tmp_path, '[[send]]\nas = "jsn"\nto = "udp:127.0.0.1:9"\n'))
    raw, sent, notes = tmp_path / "buoy.bin", tmp_path / "sent.jsonl", []
    plumbob.emulate("buoy", write=raw, duration="5 s", seed=1, unit="calibrated")
    path = session(tmp_path, f'[source]\nkind = "file"\npath = "{raw}"\n')
    plumbob.record(path, send=[f"json file:{sent} 10Hz"], note=notes.append)
    (missing,) = [int(found[1]) for line in notes if (found := re.search(r"(\d+) attitudes? not sent", line))]
    assert missing + len(sent.read_text().splitlines()) == 50
