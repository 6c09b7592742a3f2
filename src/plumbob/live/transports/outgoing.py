"""Where messages go: UDP, TCP to a server or as one, a serial port, a file, a pipe.

A `Target` writes one whole message at a time, and waits at most as long as it is allowed to; `Sender` writes from a
thread of its own behind a bounded queue, so that whoever hands over a message never waits.
"""

import contextlib
import errno
import os
import select
import socket
import stat
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from plumbob.core.errors import DecodeError, LineError, ParameterError
from plumbob.core.event import Event
from plumbob.core.files import require_place
from plumbob.core.text import counted
from plumbob.live.transports.transport import LOOPBACK, BackOff

CLIENT_QUEUE: Final = 256  # messages that wait for a client of a server at most; a slower one loses the oldest
QUEUE: Final = 1024  # messages that wait for a target at most
KINDS: Final = (
    "udp:HOST:PORT, udp-broadcast:HOST:PORT, tcp:HOST:PORT, tcp-listen:[HOST:]PORT, serial:DEVICE@BAUD, file:PATH or -"
)
_PIPE: Final = 4096  # what `select` calls writable takes so many bytes at once [POSIX, PIPE_BUF]
_CLOSED: Final = "it is not open"
_CONNECT: Final = 2.0


class Target:
    """Where whole messages are written."""

    __slots__ = ()

    def require(self) -> None:
        """Refuse what only this machine can be the reason for, with a LineError: it would not mend itself."""

    def open(self) -> None:
        """Open it; OSError where that is not possible now."""
        raise NotImplementedError

    def write(self, data: bytes, patience: float) -> int:
        """Write a message, wait at most `patience` s, and return how many messages were dropped; OSError: it broke."""
        raise NotImplementedError

    def tend(self) -> None:
        """Do what is due without a message."""

    def close(self) -> None:
        """Let go of it; more than once does no harm."""


@dataclass(slots=True)
class _Addressed(Target):
    """What has a socket to one address."""

    host: str
    port: int
    _socket: socket.socket | None = field(default=None, init=False)

    def write(self, data: bytes, patience: float) -> int:
        """Send it; a datagram for which nobody listens on this machine is sent all the same."""
        if self._socket is None:
            raise OSError(_CLOSED)
        self._socket.settimeout(patience)
        with contextlib.suppress(ConnectionRefusedError):
            self._socket.sendall(data)
        return 0

    def close(self) -> None:
        """Close the socket."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None


@dataclass(slots=True)
class Udp(_Addressed):
    """A datagram for each message."""

    broadcast: bool = False

    def open(self) -> None:
        """Resolve the address."""
        family, _, _, _, address = socket.getaddrinfo(self.host, self.port, type=socket.SOCK_DGRAM)[0]
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        if self.broadcast:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        try:
            self._socket.connect(address)
        except OSError:
            self.close()
            raise


@dataclass(slots=True)
class Tcp(_Addressed):
    """A client of a server; what a message could not be written whole to is closed, for its rest would be torn."""

    def open(self) -> None:
        """Connect."""
        self._socket = socket.create_connection((self.host, self.port), timeout=_CONNECT)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


class _ServerClient:
    """One client of a server, with the messages that wait for it."""

    def __init__(self, sock: socket.socket, name: str) -> None:
        self.sock, self.name = sock, name
        self.waiting: deque[bytes] = deque()
        self.rest = b""
        self.dropped = 0
        self.is_late = False
        """Whether it was waited for in vain, and nobody waits for it again until it has read half of its queue."""

    @property
    def is_full(self) -> bool:
        """Whether the next message costs it the oldest one."""
        return len(self.waiting) >= CLIENT_QUEUE

    def add(self, data: bytes) -> int:
        """Queue a message; drop the oldest where there are too many."""
        self.waiting.append(data)
        if len(self.waiting) <= CLIENT_QUEUE:
            return 0
        self.waiting.popleft()
        self.dropped += 1
        return 1

    def flush(self) -> None:
        """Write what the system takes now."""
        while self.rest or self.waiting:
            if not self.rest:
                self.rest = self.waiting.popleft()
            try:
                sent = self.sock.send(self.rest)
            except BlockingIOError:
                return
            self.rest = self.rest[sent:]
            self.is_late = self.is_late and 2 * len(self.waiting) > CLIENT_QUEUE


class TcpServer(Target):
    """A server that any number of clients can join; each has a queue of its own, and none waits for another."""

    def __init__(self, host: str, port: int) -> None:
        self.host, self.port = host, port
        self._listening: socket.socket | None = None
        self.clients: list[_ServerClient] = []

    def require(self) -> None:
        """Refuse an address that is not free."""
        try:
            self.open()
        except OSError as error:
            raise refused(f"tcp-listen:{self.host}:{self.port}", error) from error
        self.close()

    def open(self) -> None:
        """Listen."""
        family = socket.AF_INET6 if ":" in self.host else socket.AF_INET
        listening = socket.create_server((self.host, self.port), family=family)
        listening.setblocking(False)
        self._listening, self.port = listening, listening.getsockname()[1]

    def write(self, data: bytes, patience: float) -> int:
        """Queue it for every client, and write what they take; wait for room at most `patience` s."""
        self.tend()
        end = time.monotonic() + patience
        while full := [client for client in self.clients if client.is_full and not client.is_late]:
            remaining = end - time.monotonic()
            if remaining <= 0.0:
                for client in full:  # the others do not pay for it a second time
                    client.is_late = True
                break
            select.select([], [client.sock for client in full], [], remaining)
            self.tend()
        dropped = sum(client.add(data) for client in self.clients)
        self.tend()
        return dropped

    def tend(self) -> None:
        """Let clients in, write what they take, and part from those that left."""
        while self._listening is not None:
            try:
                sock, address = self._listening.accept()
            except OSError:
                break
            sock.setblocking(False)
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self.clients.append(_ServerClient(sock, f"{address[0]}:{address[1]}"))
        for client in list(self.clients):
            try:
                client.flush()
            except OSError:
                client.sock.close()
                self.clients.remove(client)

    def close(self) -> None:
        """Write what still waits, a moment long, and part from everybody."""
        end = time.monotonic() + 1.0
        while any(client.waiting or client.rest for client in self.clients) and time.monotonic() < end:
            select.select([], [client.sock for client in self.clients], [], 0.05)
            self.tend()
        for client in self.clients:
            client.sock.close()
        self.clients.clear()
        if self._listening is not None:
            self._listening.close()
            self._listening = None


@dataclass(slots=True)
class SerialPort(Target):
    """A serial port or a pseudo-terminal."""

    device: str
    baud: int
    _port: Any = None

    def open(self) -> None:
        """Open it for this program alone."""
        import termios

        import serial

        try:
            self._port = serial.Serial(self.device, self.baud, timeout=0, write_timeout=1.0, exclusive=True)
        except (ValueError, termios.error) as error:
            raise OSError(f"{self.device} cannot be opened: {error}") from error

    def write(self, data: bytes, patience: float) -> int:
        """Write it whole; a port that takes nothing drops it."""
        import termios

        import serial

        if self._port is None:
            raise OSError(_CLOSED)
        if not _is_writable(self._port.fileno(), patience):
            return 1
        try:
            self._port.write_timeout = max(patience, 0.1)
            self._port.write(data)
        except (serial.SerialException, termios.error, TypeError) as error:
            raise OSError(f"{self.device}: {error}") from error
        return 0

    def close(self) -> None:
        """Close the port."""
        if self._port is not None:
            with contextlib.suppress(Exception):
                self._port.close()
            self._port = None


@dataclass(slots=True)
class FileTarget(Target):
    """A file, a named pipe, or standard output where there is no path; each message is written at once."""

    path: Path | None
    overwrite: bool = False
    _fd: int = -1
    _made: bool = False

    def open(self) -> None:
        """Open it; a pipe that nobody reads is not there yet."""
        if self.path is None:
            sys.stdout.flush()
            self._fd = sys.stdout.fileno()
            return
        special = self.path.exists() and not stat.S_ISREG(self.path.stat().st_mode)
        how = os.O_WRONLY | os.O_NONBLOCK if special else os.O_WRONLY | os.O_CREAT
        if not special:
            how |= os.O_APPEND if self._made else os.O_TRUNC if self.overwrite else os.O_EXCL
        self._fd, self._made = os.open(self.path, how, 0o666), True

    def write(self, data: bytes, patience: float) -> int:
        """Write it whole; a pipe that is full drops it."""
        for start in range(0, len(data), _PIPE):
            if not _is_writable(self._fd, patience):
                if start:
                    raise OSError("it accepts no more data, and a message was cut off")
                return 1
            part = data[start : start + _PIPE]
            while part:
                try:
                    part = part[os.write(self._fd, part) :]
                except BlockingIOError:
                    if not start and len(part) == len(data[:_PIPE]):
                        return 1
                    _is_writable(self._fd, patience)
        return 0

    def discard(self) -> None:
        """Close it, and remove the file that it made: half of it is worth nothing."""
        made = self._made and self.path is not None and self._fd >= 0 and stat.S_ISREG(os.fstat(self._fd).st_mode)
        self.close()
        if made and self.path is not None:
            self.path.unlink(missing_ok=True)

    def close(self) -> None:
        """Close the file; standard output stays open."""
        if self.path is not None and self._fd >= 0:
            os.close(self._fd)
        self._fd = -1


def _is_writable(fd: int, patience: float) -> bool:
    poll = select.poll()
    poll.register(fd, select.POLLOUT)
    ready = poll.poll(patience * 1e3)
    if ready and ready[0][1] & (select.POLLERR | select.POLLNVAL):
        raise BrokenPipeError("the receiver has closed it")
    return bool(ready)


def require_writable(path: Path, *, overwrite: bool = False) -> None:
    """Refuse what `require_place` does, and a folder in which no file can be made; a full disk may have room later."""
    require_place(path, overwrite=overwrite)
    try:
        if not path.exists():
            tempfile.TemporaryFile(dir=path.parent).close()
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT):
            raise DecodeError(f"{path} cannot be written: {_reason(error)}. Choose another place.") from error


def parse_target(text: str, *, overwrite: bool = False) -> Target:
    """Target of its text, as ``udp:127.0.0.1:10110``."""
    kind, _, rest = text.partition(":")
    if text == "-":
        return FileTarget(None)
    if kind == "file" and rest:
        require_writable(path := Path(rest), overwrite=overwrite)
        return FileTarget(path, overwrite)
    if kind == "serial":
        device, at, baud = rest.rpartition("@")
        if not at or not device or not baud.isdecimal() or not int(baud):
            raise ParameterError(f"'{text}' needs a device and its speed, as serial:/dev/ttyUSB0@38400.")
        return SerialPort(device, int(baud))
    if kind in ("udp", "udp-broadcast", "tcp", "tcp-listen"):
        host, port = _address(text, rest, listens=kind == "tcp-listen")
        if kind == "tcp-listen":
            return TcpServer(host, port)
        return Tcp(host, port) if kind == "tcp" else Udp(host, port, broadcast=kind == "udp-broadcast")
    raise ParameterError(f"'{text}' is not a target; known: {KINDS}.")


def _address(text: str, rest: str, *, listens: bool) -> tuple[str, int]:
    host, _, port = rest.rpartition(":")
    host = host.strip("[]") or (LOOPBACK if listens else "")
    if not host or not port.isdecimal() or not (0 if listens else 1) <= int(port) < 2**16:
        raise ParameterError(f"'{text}' needs an address and a port, as {text.partition(':')[0]}:{LOOPBACK}:10110.")
    return host, int(port)


class Sender:
    """Writes messages to a target from a thread of its own, and opens the target again where it breaks.

    It counts those `sent`, and those `dropped`, because the target was away, or too slow.
    """

    def __init__(
        self, target: Target, name: str, *, backoff: BackOff | None = None, size: int = QUEUE,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:  # fmt: skip
        self._target, self._name, self._clock, self._size = target, name, clock, size
        self._back_off = backoff or BackOff(0.1, 2.0)
        self._waiting: deque[bytes] = deque()
        self._events: deque[Event] = deque(maxlen=1000)
        self._ready = threading.Condition()
        self._ending = False
        self.sent = self.dropped = 0
        self._thread = threading.Thread(target=self._run, name=f"send {name}", daemon=True)
        self._thread.start()

    def put(self, data: bytes) -> None:
        """Hand over a message; never waits, and drops the oldest where too many wait."""
        with self._ready:
            self._waiting.append(data)
            if len(self._waiting) > self._size:
                self._waiting.popleft()
                self.dropped += 1
            self._ready.notify()

    def take_events(self) -> list[Event]:
        """What has happened since the last call."""
        events = []
        while self._events:
            events.append(self._events.popleft())
        return events

    def close(self, patience: float = 2.0) -> None:
        """Send what still waits, for at most this time, and end."""
        with self._ready:
            self._ending = True
            self._ready.notify()
        self._thread.join(patience)
        with self._ready:
            self.dropped += len(self._waiting)
            self._waiting.clear()
        if self.dropped:
            text = f"{self._name}: {counted(self.dropped, 'message')} dropped, {self.sent} sent."
            self._tell("dropped", text, self.dropped)

    def _tell(self, kind: str, text: str, count: int = 0) -> None:
        self._events.append(Event(self._clock(), kind, text, count))

    def _run(self) -> None:
        wait, opened = self._back_off.first, False
        try:
            while not (self._ending and (not self._waiting or not opened)):
                if not opened:
                    opened, wait = self._open(wait)
                    continue
                data = self._next()
                try:
                    if data is None:
                        self._target.tend()
                        continue
                    dropped = self._target.write(data, 0.2)
                    self.dropped += dropped
                    self.sent += not dropped or isinstance(self._target, TcpServer)  # others have got it
                except OSError as error:
                    self.dropped += data is not None
                    opened, wait = False, self._back_off.first
                    self._target.close()
                    self._tell("lost", f"{self._name} is lost: {_reason(error)}. It is tried again.")
        finally:
            self._target.close()

    def _open(self, wait: float) -> tuple[bool, float]:
        try:
            self._target.open()
        except OSError as error:
            if wait == self._back_off.first:
                self._tell("absent", f"{self._name} cannot be opened now: {_reason(error)}. It is tried again.")
            with self._ready:
                if not self._ending:
                    self._ready.wait_for(lambda: self._ending, wait)
            return False, min(wait * 2.0, self._back_off.longest)
        self._tell("opened", f"{self._name} is open.")
        return True, self._back_off.first

    def _next(self) -> bytes | None:
        with self._ready:
            if not self._waiting and not self._ending:
                self._ready.wait(0.05)
            return self._waiting.popleft() if self._waiting else None


def _reason(error: OSError) -> str:
    return error.strerror or str(error)


def refused(name: str, error: OSError) -> LineError:
    """Why a target cannot be written."""
    return LineError(f"{name} cannot be written: {_reason(error)}.")
