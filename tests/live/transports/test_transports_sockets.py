"""Datagrams and connections on loopback."""

import errno
import socket
import sys
import threading
import time

import pytest

from plumbob.core.errors import LineError, ParameterError
from plumbob.core.event import Event
from plumbob.live.transports.sockets import LOOPBACK, TcpSource, UdpSource, UdpWire
from plumbob.live.transports.transport import Received


@pytest.fixture
def sender():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        yield sock


@pytest.fixture
def udp(collect):
    with UdpSource(0) as source:
        (opened,) = collect(source, lambda got: got.kinds == ["opened"])
        assert opened.text.startswith(f"udp 127.0.0.1:{source.port} (")  # it listens to this machine only
        yield source


def test_each_datagram_is_one_in_its_order(udp, sender, collect):
    sent = [b"%d" % i for i in range(100)] + [b"", b"x" * 65507]  # the smallest and the largest that there are
    for data in sent:
        sender.sendto(data, (LOOPBACK, udp.port))
    got = collect(udp, lambda got: len(got) >= len(sent))
    assert [item.data for item in got] == sent
    times = [item.t_ns for item in got]
    assert times == sorted(times)


def test_every_datagram_is_delivered_or_counted(sender, collect):
    """A small buffer overflows while nobody reads; the next datagram tells how many there was no room for."""
    with UdpSource(0, buffer=1 << 14) as udp:
        udp.read(0)
        for i in range(2000):
            sender.sendto(i.to_bytes(4, "big") + bytes(496), (LOOPBACK, udp.port))
        got = collect(udp, lambda got: got)
        while more := udp.read(0.05):
            got += more
        sender.sendto(b"last", (LOOPBACK, udp.port))
        got = collect(udp, lambda got: got.data.endswith(b"last"), got)
    dropped = sum(event.count for event in got.events)
    received = [item for item in got if isinstance(item, Received)]
    assert set(got.kinds) == {"dropped"}
    assert dropped > 1000
    assert len(received) - 1 + dropped == 2000
    assert received[-2].data < received[-1].data


def test_a_flood_is_delivered_or_counted(udp, sender):
    count, done = 4_000, threading.Event()

    def flood():
        for _ in range(count):
            sender.sendto(bytes(500), (LOOPBACK, udp.port))
        done.set()

    thread = threading.Thread(target=flood)
    thread.start()
    items, quiet = [], False
    while not quiet:
        over = done.is_set()
        items += (got := udp.read(0.05))
        quiet = over and not got
    thread.join()
    sender.sendto(b"", (LOOPBACK, udp.port))
    *last, _ = udp.read(20)
    assert sum(item.count if isinstance(item, Event) else 1 for item in [*items, *last]) == count


class Kernel:
    """A socket whose answers are given: datagrams with the kernel's count of drops since it was made, or errors."""

    def __init__(self, *answers):
        self.answers = list(answers)

    def getsockopt(self, level, option):
        return 1000

    def getsockname(self):
        return (LOOPBACK, 9)

    def recvmsg(self, size, ancillary):
        answer = self.answers.pop(0)
        if isinstance(answer, OSError):
            raise answer
        data, drops = answer
        return data, [(socket.SOL_SOCKET, 40, drops.to_bytes(4, sys.byteorder))], 0, None


def test_drops_and_errors_of_the_kernel_in_their_order():
    kernel = Kernel((b"a", 0), (b"b", 5), (b"c", 5), (b"d", 2**32 - 1), (b"e", 3), BlockingIOError(errno.EAGAIN, "no"))
    got = UdpWire(kernel, time.monotonic_ns).take()
    told = [item.data if isinstance(item, Received) else item.count for item in got]
    assert told == [b"a", 5, b"b", b"c", 2**32 - 6, b"d", 4, b"e"]
    down = OSError(errno.ENETDOWN, "Network is down")
    wire = UdpWire(Kernel((b"a", 0), down, down), time.monotonic_ns)
    assert [item.data for item in wire.take()] == [b"a"]
    with pytest.raises(OSError, match="Network is down"):
        wire.take()


class Denying(socket.socket):
    """What the kernel answers to who is not root."""

    def bind(self, address):
        raise OSError(errno.EACCES, "Permission denied")


@pytest.mark.parametrize(("make", "words"), [
    (lambda used, _: UdpSource(used), "in use by another program"),
    (lambda _, free: UdpSource(0, host="192.0.2.1"), r"192\.0\.2\.1"),  # TEST-NET-1, RFC 5737
    (lambda _, free: TcpSource("no-such-host.invalid", 1), "There is no address no-such-host"),  # RFC 6761
    (lambda _, free: TcpSource(LOOPBACK, free), "nobody listens there"),
])  # fmt: skip
def test_refusals(udp, server, make, words):
    server.stop()
    with pytest.raises(LineError, match=words):
        make(udp.port, server.port).open()


def test_what_cannot_be_had_now_is_waited_for(udp, server, collect, monkeypatch):
    with UdpSource(udp.port, wait=True) as second:
        collect(second, lambda got: got.kinds == ["busy"])
        udp.close()
        collect(second, lambda got: got.kinds == ["opened"])
    server.stop()
    with TcpSource(LOOPBACK, server.port, wait=True) as source:
        collect(source, lambda got: got.kinds == ["refused"])
        server.start()
        collect(source, lambda got: got.kinds == ["opened"])
    monkeypatch.setattr(socket, "socket", Denying)
    with UdpSource(80, wait=True) as source:
        got = collect(source, lambda got: got.kinds == ["denied"])
    assert "below 1024" in got[0].text


@pytest.mark.parametrize(
    ("kind", "args"),
    [(UdpSource, (0, "")), (UdpSource, (65536,)), (UdpSource, (-1,)), (TcpSource, (80, "")), (TcpSource, (0, "x"))],
)
def test_what_can_never_be_right(kind, args):
    port, *host = args
    with pytest.raises(ParameterError):
        UdpSource(port, host=host[0] if host else LOOPBACK) if kind is UdpSource else TcpSource(host[0], port)


class Server:
    """A sensor behind TCP that can be switched off and on."""

    def __init__(self):
        self.port, self.socket, self.client = 0, None, None
        self.start()

    def start(self):
        self.socket = socket.create_server((LOOPBACK, self.port))
        self.socket.settimeout(30)
        self.port = self.socket.getsockname()[1]

    def accept(self):
        self.client, _ = self.socket.accept()
        return self.client

    def stop(self):
        for sock in (self.client, self.socket):
            if sock is not None:
                sock.close()
        self.client = None


@pytest.fixture
def server():
    server = Server()
    yield server
    server.stop()


def test_bytes_of_a_connection(server, collect):
    data = bytes(range(256)) * 40_000
    with TcpSource(LOOPBACK, server.port) as source:
        client = server.accept()
        sender = threading.Thread(target=client.sendall, args=(data,))
        sender.start()
        got = collect(source, lambda got: len(got.data) >= len(data))
        sender.join()
    assert got.data == data
    assert got.kinds == ["opened"]


@pytest.mark.parametrize("reset", [False, True], ids=["closed", "reset"])
def test_a_server_that_comes_back(server, collect, reset):
    with TcpSource(LOOPBACK, server.port) as source:
        server.accept().sendall(b"before")
        collect(source, lambda got: got.data == b"before")
        if reset:
            server.client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
        server.stop()
        assert collect(source, lambda got: len(got) == 2).kinds == ["lost", "refused"]
        server.start()
        collect(source, lambda got: got.kinds == ["reopened"])
        server.accept().sendall(b"after")
        assert collect(source, lambda got: got.data).data == b"after"


def test_last_words_come_before_the_loss_and_silence_is_left(server, collect):
    with TcpSource(LOOPBACK, server.port) as source:
        server.accept().sendall(b"last words")
        server.stop()
        got = collect(source, lambda got: "lost" in got.kinds)
    assert [getattr(item, "kind", "bytes") for item in got] == ["opened", "bytes", "lost"]
    assert got.data == b"last words"
    server.start()
    with TcpSource(LOOPBACK, server.port, silence=0.1) as source:
        server.accept()
        opened, lost = collect(source, lambda got: got.kinds == ["opened", "lost"])
        assert lost.t_ns - opened.t_ns >= 100_000_000
        collect(source, lambda got: got.kinds == ["reopened"])


def test_the_kernel_probes_the_connection(server, monkeypatch):
    """5 s without a byte, then 3 probes, one each second, as KEEPALIVE says."""
    options = []

    class Telling(socket.socket):
        def setsockopt(self, *option):
            options.append(option)
            super().setsockopt(*option)

    monkeypatch.setattr(socket, "socket", Telling)
    with TcpSource(LOOPBACK, server.port) as source:
        source.read(1)
    tcp = socket.IPPROTO_TCP
    assert options == [
        (socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1),
        *((tcp, socket.TCP_KEEPIDLE, 5), (tcp, socket.TCP_KEEPINTVL, 1), (tcp, socket.TCP_KEEPCNT, 3)),
    ]


def test_a_server_that_does_not_answer_keeps_nobody_waiting(collect):
    """A full queue of connections that nobody accepts: Linux then leaves a new one without an answer."""
    with socket.create_server((LOOPBACK, 0), backlog=0) as server:
        fill = [socket.socket() for _ in range(4)]
        for sock in fill:
            sock.setblocking(False)
            sock.connect_ex(server.getsockname())
        with TcpSource(*server.getsockname(), wait=True, connect_timeout=1.0) as source:
            cpu = time.process_time()
            assert source.read(0.05) == []
            got = collect(source, lambda got: got)
            assert time.process_time() - cpu < 0.2
        with TcpSource(*server.getsockname(), wait=True) as source:
            source.read(0)
            # left while it connects: a socket that stayed open would warn, which is an error here
        for sock in fill:
            sock.close()
    assert (got.kinds, "no answer" in got.events[0].text) == (["absent"], True)
