"""Sensors behind UDP and TCP."""

import errno
import os
import re
import select
import socket
import struct
import sys
from collections.abc import Callable
from typing import Any, Final, Unpack

from plumbob.core.errors import MissingExtraError, ParameterError
from plumbob.core.event import Event
from plumbob.core.text import counted
from plumbob.live.transports.serial_line import GATHER
from plumbob.live.transports.transport import LOOPBACK, TAKE_LIMIT, NoLine, Patience, Received, Replug

KEEPALIVE: Final = 8.0  # s in which a machine that has gone is found: 5 without a byte, then 3 probes, one each second

_LARGEST: Final = 1 << 16  # no datagram is larger
_MANY: Final = 4096  # datagrams that one `take` is content with
_SO_RXQ_OVFL: Final = 40  # Linux, asm-generic/socket.h; Python has no name for it
_NOTHING = {errno.EAGAIN, errno.EWOULDBLOCK}


class UdpSource(Replug):
    """Datagrams, each a `Received` of its own, in the order in which they came; from loopback alone by default.

    The kernel keeps `buffer` bytes while nobody reads, but no more than ``net.core.rmem_max``; datagrams for which it
    had no room are reported as ``dropped`` before the next one that came through (Linux). Port 0 takes a free one.
    """

    def __init__(
        self, port: int, *, host: str = LOOPBACK, buffer: int = 1 << 22, gather: float = GATHER,
        **patience: Unpack[Patience],
    ) -> None:  # fmt: skip
        super().__init__(_name("udp", host, port, lowest=0), gather=gather, **patience)
        self._host, self._asked, self._buffer = host, port, buffer
        self._port = port

    @property
    def port(self) -> int:
        """Port that it listens to; where 0 was asked for, the one that was free, from the first opening on."""
        return self._port

    def _connect(self, patience: float) -> "UdpWire":
        family, address = _resolve(self._host, self._port, socket.SOCK_DGRAM)
        sock = socket.socket(family, socket.SOCK_DGRAM)
        try:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, self._buffer)
            if sys.platform == "linux":  # elsewhere drops show in the data only
                sock.setsockopt(socket.SOL_SOCKET, _SO_RXQ_OVFL, 1)
            sock.bind(address)
            sock.setblocking(False)
        except OSError as error:
            sock.close()
            raise _refusal(self._name, error) from error
        self._port = sock.getsockname()[1]
        return UdpWire(sock, self._clock)


class _SocketWire:
    """What the two kinds of sockets have in common."""

    _sock: socket.socket

    def fileno(self) -> int:
        """Descriptor of the socket."""
        return self._sock.fileno()

    def close(self) -> None:
        """Close the socket."""
        self._sock.close()


class UdpWire(_SocketWire):
    """A bound socket."""

    def __init__(self, sock: socket.socket, clock: Callable[[], int]) -> None:
        granted = sock.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
        host, port = sock.getsockname()[:2]
        self.where = f"udp {host}:{port} (buffer of {granted} bytes)"
        self._sock, self._clock, self._dropped = sock, clock, 0

    def take(self) -> list[Received | Event]:
        """All datagrams that are there, and how many were dropped before which."""
        items: list[Received | Event] = []
        while len(items) < _MANY:
            try:
                data, ancillary, *_ = self._sock.recvmsg(_LARGEST, socket.CMSG_SPACE(4))
            except OSError as error:
                if items or error.errno in _NOTHING:  # an error that is pending comes again
                    return items
                raise
            now = self._clock()
            items += self._drops(now, ancillary)
            items.append(Received(now, data))
        return items

    def _drops(self, now: int, ancillary: list[tuple[int, int, bytes]]) -> list[Event]:
        for level, kind, value in ancillary:
            if (level, kind) == (socket.SOL_SOCKET, _SO_RXQ_OVFL):
                total = struct.unpack("=I", value)[0]  # since the socket was made
                count, self._dropped = (total - self._dropped) % 2**32, total
                if count:
                    return [Event(now, "dropped", f"{self.where}: no room for {counted(count, 'datagram')}.", count)]
        return []


class TcpSource(Replug):
    """Bytes of a TCP server, connected again when it goes away.

    Without a byte for `silence`, s, the connection counts as half open, and is lost. Without it only the kernel's
    probes find that: they see a machine that has gone (in about `KEEPALIVE` s), not a program that hangs. A name is
    looked up before `connect_timeout` begins, which may take the system longer.
    """

    def __init__(
        self, host: str, port: int, *, silence: float | None = None, connect_timeout: float = 5.0,
        gather: float = GATHER, **patience: Unpack[Patience],
    ) -> None:  # fmt: skip
        name = _name("tcp", host, port, lowest=1)
        super().__init__(name, silence=silence, breaks_on_silence=True, gather=gather, **patience)
        self._host, self._port = host, port
        self._connect_ns = round(connect_timeout * 1e9)
        self._half: tuple[socket.socket, int] | None = None  # still connecting, until when

    def _connect(self, patience: float) -> "TcpWire | None":
        sock, until_ns = self._half or self._begin()
        self._half = None
        patience = min(patience, max(0.0, (until_ns - self._clock()) / 1e9))
        try:
            if not _writable(sock, patience):
                if self._clock() < until_ns:
                    self._half = sock, until_ns
                    return None
                raise TimeoutError(errno.ETIMEDOUT, "no answer")
            if number := sock.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
                raise OSError(number, os.strerror(number))
            _keep_alive(sock)
        except OSError as error:
            sock.close()
            raise _refusal(self._name, error) from error
        return TcpWire(sock, self._name, self._clock)

    def _begin(self) -> tuple[socket.socket, int]:
        family, address = _resolve(self._host, self._port, socket.SOCK_STREAM)
        sock = socket.socket(family, socket.SOCK_STREAM)
        sock.setblocking(False)
        number = sock.connect_ex(address)
        if number not in {0, errno.EINPROGRESS}:
            sock.close()
            raise _refusal(self._name, OSError(number, os.strerror(number)))
        return sock, self._clock() + self._connect_ns

    def close(self) -> None:
        """Let go of the connection, made or half made; more than once does no harm."""
        half, self._half = self._half, None
        if half is not None:
            half[0].close()
        super().close()


class TcpWire(_SocketWire):
    """A connection."""

    def __init__(self, sock: socket.socket, where: str, clock: Callable[[], int]) -> None:
        self.where, self._sock, self._clock = where, sock, clock

    def take(self) -> list[Received | Event]:
        """All bytes that are there."""
        try:
            data = self._sock.recv(TAKE_LIMIT)
        except BlockingIOError:
            return []
        if not data:
            raise ConnectionResetError(errno.ECONNRESET, "the other end has closed the connection")
        return [Received(self._clock(), data)]


class WebSocketSource(TcpSource):
    """Messages of a WebSocket server, a line each, connected again when it goes away; `url` is ``ws://HOST:PORT/PATH``."""

    def __init__(self, url: str, **patience: Any) -> None:
        if not re.fullmatch(r"ws://[\w.-]+(:\d+)?(/\S*)?", url):
            raise ParameterError(f"'{url}' is not an open WebSocket; give ws://HOST:PORT/PATH.")
        try:
            from websockets.uri import parse_uri
        except ImportError as error:
            raise MissingExtraError("a WebSocket needs websockets: pip install 'plumbob[view]'.") from error
        self._uri = parse_uri(url)
        super().__init__(self._uri.host, self._uri.port, **patience)

    def _connect(self, patience: float) -> "TcpWire | None":
        wire = super()._connect(patience)
        return wire and WebSocketWire(wire._sock, self._name, self._clock, self._uri)


class WebSocketWire(TcpWire):
    """A connection that speaks WebSocket; a message without a line end gets one."""

    def __init__(self, sock: socket.socket, where: str, clock: Callable[[], int], uri: Any) -> None:
        from websockets.client import ClientProtocol

        super().__init__(sock, where, clock)
        self._protocol = ClientProtocol(uri)
        self._protocol.send_request(self._protocol.connect())
        self._send()

    def _send(self) -> None:
        self._sock.sendall(b"".join(self._protocol.data_to_send()))

    def take(self) -> list[Received | Event]:
        """All messages that are there; pings are answered."""
        from websockets.frames import DATA_OPCODES, Frame

        for item in super().take():
            assert isinstance(item, Received)
            self._protocol.receive_data(item.data)
        self._send()
        if error := self._protocol.handshake_exc:
            raise ConnectionRefusedError(errno.ECONNREFUSED, str(error))
        text = b""
        for part in self._protocol.events_received():
            if isinstance(part, Frame) and part.opcode in DATA_OPCODES:
                text += part.data
                text += b"\n" * (part.fin and not text.endswith(b"\n"))
        return [Received(self._clock(), text)] if text else []


def _writable(sock: socket.socket, patience: float) -> bool:
    poll = select.poll()
    poll.register(sock, select.POLLOUT)
    return bool(poll.poll(patience * 1e3))


def _keep_alive(sock: socket.socket) -> None:
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for option, value in (("TCP_KEEPIDLE", 5), ("TCP_KEEPINTVL", 1), ("TCP_KEEPCNT", 3)):
        if hasattr(socket, option):  # each where the system has it
            sock.setsockopt(socket.IPPROTO_TCP, getattr(socket, option), value)


def _name(kind: str, host: str, port: int, *, lowest: int) -> str:
    if not host:
        raise ParameterError(f"An address must be named; {LOOPBACK} is this machine, 0.0.0.0 all of its networks.")
    if not lowest <= port < 2**16:
        raise ParameterError(f"A {kind} port must be a number from {lowest} to 65535, but got {port}.")
    return f"{kind} {host}:{port}"


def _resolve(host: str, port: int, kind: socket.SocketKind) -> tuple[socket.AddressFamily, Any]:
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=kind)[0]
    except OSError as error:
        raise NoLine("absent", f"There is no address {host}: {error.strerror}.") from error
    return family, address


def _refusal(name: str, error: OSError) -> NoLine:
    if error.errno == errno.EADDRINUSE:
        return NoLine("busy", f"{name} is in use by another program; end it, or take another port.")
    if error.errno in {errno.EACCES, errno.EPERM}:
        return NoLine("denied", f"No permission for {name}; ports below 1024 belong to the system.")
    if error.errno == errno.ECONNREFUSED:
        return NoLine("refused", f"{name}: nobody listens there.")
    return NoLine("absent", f"{name}: {error.strerror}.")
