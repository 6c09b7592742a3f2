"""Datagrams and connections on loopback."""

import errno
import socket
import sys
import threading
import time

import pytest

from plumbob.acquisition import TcpSource, UdpSource
from plumbob.acquisition.sockets import LOOPBACK, UdpWire, _refusal, _writable
from plumbob.acquisition.transport import Received
from plumbob.core.errors import LineError, ParameterError


@pytest.fixture
def sender():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        yield sock


@pytest.fixture
def udp(collect):
    with UdpSource(0) as source:
        collect(source, lambda got: got.kinds == ["opened"])
        yield source


def test_each_datagram_is_one_in_its_order(udp, sender, collect):
    sent = [b"%d" % i for i in range(100)] + [b"", b"x" * 65507]  # the smallest and the largest that there are
    for data in sent:
        sender.sendto(data, (LOOPBACK, udp.port))
    got = collect(udp, lambda got: len(got) >= len(sent))
    assert [item.data for item in got] == sent
    times = [item.t_ns for item in got]
    assert times == sorted(times)


def test_it_is_waited_for_until_a_socket_takes_more():
    """Its buffer is full until another thread reads; ten seconds of patience are far more than that takes."""
    one, other = socket.socketpair()
    with one, other:
        one.setblocking(False)
        sent = 0
        with pytest.raises(BlockingIOError):
            while True:
                sent += one.send(bytes(65536))

        def read():
            left = sent
            while left:
                left -= len(other.recv(left))

        reading = threading.Timer(0.05, read)
        reading.start()
        assert _writable(one, 10.0)
        reading.join()


def test_it_listens_to_this_machine_only(udp):
    assert udp._wire._sock.getsockname()[0] == "127.0.0.1"
    assert udp.name.startswith("udp 127.0.0.1:")


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


def test_a_flood_of_ten_megabytes_is_delivered_or_counted(udp, sender):
    count, done = 20_000, threading.Event()

    def flood():
        for _ in range(count):
            sender.sendto(bytes(500), (LOOPBACK, udp.port))
        done.set()

    thread = threading.Thread(target=flood)
    thread.start()
    seen = dropped = 0
    quiet = False
    while not quiet:
        over = done.is_set()
        got = udp.read(0.05)
        seen += sum(isinstance(item, Received) for item in got)
        dropped += sum(item.count for item in got if not isinstance(item, Received))
        quiet = over and not got
    thread.join()
    sender.sendto(b"", (LOOPBACK, udp.port))
    for item in udp.read(20):
        dropped += getattr(item, "count", 0)
    assert seen + dropped == count


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


def test_the_count_of_drops_is_cumulative_and_wraps():
    kernel = Kernel((b"a", 0), (b"b", 5), (b"c", 5), (b"d", 2**32 - 1), (b"e", 3), BlockingIOError(errno.EAGAIN, "no"))
    got = UdpWire(kernel, time.monotonic_ns).take()
    told = [item.data if isinstance(item, Received) else item.count for item in got]
    assert told == [b"a", 5, b"b", b"c", 2**32 - 6, b"d", 4, b"e"]


def test_datagrams_come_before_the_error_that_follows_them():
    down = OSError(errno.ENETDOWN, "Network is down")
    wire = UdpWire(Kernel((b"a", 0), down, down), time.monotonic_ns)
    assert [item.data for item in wire.take()] == [b"a"]
    with pytest.raises(OSError, match="Network is down"):
        wire.take()


def test_a_port_in_use_is_an_error_or_is_waited_for(udp, collect):
    with pytest.raises(LineError, match="in use by another program"):
        UdpSource(udp.port).open()
    with UdpSource(udp.port, wait=True) as second:
        collect(second, lambda got: got.kinds == ["busy"])
        udp.close()
        collect(second, lambda got: got.kinds == ["opened"])


def test_an_address_that_is_not_ours():
    with pytest.raises(LineError, match=r"192\.0\.2\.1"):  # TEST-NET-1, RFC 5737
        UdpSource(0, host="192.0.2.1").open()
    with pytest.raises(LineError, match="There is no address no-such-host"):
        TcpSource("no-such-host.invalid", 1).open()  # RFC 6761


@pytest.mark.parametrize(
    "make",
    [
        lambda: UdpSource(0, host=""),
        lambda: UdpSource(65536),
        lambda: UdpSource(-1),
        lambda: TcpSource("", 80),
        lambda: TcpSource("x", 0),
    ],
)
def test_what_can_never_be_right(make):
    with pytest.raises(ParameterError):
        make()


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


def test_last_words_come_before_the_loss(server, collect):
    with TcpSource(LOOPBACK, server.port) as source:
        server.accept().sendall(b"last words")
        server.stop()
        got = collect(source, lambda got: "lost" in got.kinds)
    assert [getattr(item, "kind", "bytes") for item in got] == ["opened", "bytes", "lost"]
    assert got.data == b"last words"


def test_a_server_that_hangs_is_left(server, collect):
    with TcpSource(LOOPBACK, server.port, silence=0.1) as source:
        server.accept()
        got = collect(source, lambda got: got.kinds == ["opened", "lost"])
        assert "nothing has come for 0.1" in got.events[-1].text
        collect(source, lambda got: got.kinds == ["reopened"])


def test_the_kernel_probes_the_connection(server):
    with TcpSource(LOOPBACK, server.port) as source:
        source.read(1)
        assert source._wire._sock.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)


def test_nobody_listens(server, collect):
    server.stop()
    with pytest.raises(LineError, match="nobody listens there"):
        TcpSource(LOOPBACK, server.port).open()
    with TcpSource(LOOPBACK, server.port, wait=True) as source:
        collect(source, lambda got: got.kinds == ["refused"])
        server.start()
        collect(source, lambda got: got.kinds == ["opened"])


def test_a_server_that_does_not_answer_keeps_nobody_waiting(collect):
    """A full queue of connections that nobody accepts: Linux then leaves a new one without an answer."""
    with socket.create_server((LOOPBACK, 0), backlog=0) as server:
        fill = [socket.socket() for _ in range(4)]
        for sock in fill:
            sock.setblocking(False)
            sock.connect_ex(server.getsockname())
        with TcpSource(*server.getsockname(), wait=True, connect_timeout=1.0) as source:
            start, cpu = time.monotonic(), time.process_time()
            assert source.read(0.05) == []
            assert time.monotonic() - start < 0.9
            got = collect(source, lambda got: got)
            assert time.process_time() - cpu < 0.2
        for sock in fill:
            sock.close()
    assert (got.kinds, "no answer" in got.events[0].text) == (["absent"], True)


def test_closing_while_it_connects_leaves_nothing_open():
    with socket.create_server((LOOPBACK, 0), backlog=0) as server:
        fill = [socket.create_connection(server.getsockname())]
        source = TcpSource(*server.getsockname(), wait=True)
        source.read(0)
        source.close()  # a socket left open would warn, which is an error here
        fill[0].close()


def test_ports_of_the_system_are_denied():
    """As root they are not, so the answer of the kernel is given here."""
    no = _refusal("udp 127.0.0.1:80", OSError(errno.EACCES, "Permission denied"))
    assert (no.kind, "below 1024" in no.text) == ("denied", True)
