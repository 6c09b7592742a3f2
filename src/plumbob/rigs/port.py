"""Where a rig's bytes go: a pseudo-terminal, a socket or a file."""

import contextlib
import os
import select
import socket
import tty
from collections.abc import Sequence
from fcntl import ioctl
from pathlib import Path
from termios import FIONREAD
from time import monotonic, sleep
from typing import BinaryIO, Protocol

from plumbob.errors import ParameterError

_TURN = 0.05  # s; how long one wait lasts, so that a stop is noticed soon
_SHORTLY, _PATIENTLY = 1.0, 2.0  # s; how long a terminal's reader may take for the rest


class Port(Protocol):
    """One end of a line."""

    @property
    def name(self) -> str:
        """What a reader opens."""
        ...

    def heard(self) -> bool:
        """Whether somebody has the other end open."""
        ...

    def send(self, payloads: Sequence[bytes]) -> int:
        """Send what fits within a short time, and return how many payloads are gone; all of them if nobody hears."""
        ...

    def unplug(self) -> None:
        """Let the port vanish."""
        ...

    def replug(self) -> None:
        """Let it come back; a pseudo-terminal has another name then."""
        ...

    def close(self) -> None:
        """End the line, once what was sent has been read or nobody reads it."""
        ...


class PtyPort:
    """Pseudo-terminal: looks like a serial line to whoever opens it.

    Parameters
    ----------
    link : Path, optional
        Symbolic link that always leads to the present terminal.
    """

    def __init__(self, link: Path | None = None) -> None:
        self._link = link
        self._rest = b""
        self._open()

    @property
    def name(self) -> str:
        """Path of the terminal."""
        return self._name

    def _open(self) -> None:
        self._master, slave = os.openpty()
        tty.setraw(slave)
        self._name = os.ttyname(slave)
        os.close(slave)
        os.set_blocking(self._master, False)
        if self._link:
            _lead(self._link, self._name)

    def heard(self) -> bool:
        """Whether somebody has it open; what they write to the device is read and forgotten."""
        found = self._poll(select.POLLIN, 0.0)
        if found & select.POLLIN and not found & select.POLLHUP:
            with contextlib.suppress(OSError):  # it may have been closed just now
                os.read(self._master, 4096)
        return not found & select.POLLHUP

    def send(self, payloads: Sequence[bytes]) -> int:
        """Send; a payload that fits only in part is finished by the next call, which begins with it."""
        for done, payload in enumerate(payloads):
            data = self._rest or payload
            while data:
                if not self.heard():
                    self._rest = b""
                    return len(payloads)
                try:
                    data = data[os.write(self._master, data) :]
                except BlockingIOError:
                    if not self._poll(select.POLLOUT, _TURN) & select.POLLOUT:
                        self._rest = data
                        return done
            self._rest = b""
        return len(payloads)

    def _poll(self, what: int, timeout: float) -> int:
        poller = select.poll()
        poller.register(self._master, what)
        found = poller.poll(1e3 * timeout)
        return found[0][1] if found else 0

    def unplug(self) -> None:
        """Close the terminal: whoever reads it gets an error, once everything has been read."""
        self._settle(_SHORTLY)
        os.close(self._master)
        self._rest = b""

    def replug(self) -> None:
        """Open another one behind the same link."""
        self._open()

    def close(self) -> None:
        """Close it, once everything has been read or nobody reads on."""
        self._settle(_PATIENTLY)
        os.close(self._master)
        if self._link and self._link.is_symlink() and str(self._link.readlink()) == self._name:
            self._link.unlink()

    def _settle(self, most: float) -> None:
        """Wait until a reader has read everything; closing this end throws away what it has not."""
        if not self.heard():
            return
        slave = os.open(self._name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            end, quiet = monotonic() + most, 0
            while quiet < 2 and monotonic() < end:
                waiting = int.from_bytes(ioctl(slave, FIONREAD, bytes(4)), "little")
                quiet = 0 if waiting else quiet + 1
                sleep(0.01)
        finally:
            os.close(slave)


def _lead(link: Path, target: str) -> None:
    """Point a symbolic link to a target, without a moment in which there is none."""
    if link.exists() and not link.is_symlink():
        raise ParameterError(f"{link} is a file; a link there would destroy it. Name another path.")
    new = link.with_name(f".{link.name}.{os.getpid()}")
    new.unlink(missing_ok=True)
    new.symlink_to(target)
    new.replace(link)


class TcpPort:
    """TCP server for one reader at a time.

    Parameters
    ----------
    host : str
        Address to listen at.
    number : int
        Port; 0 takes a free one.
    """

    def __init__(self, host: str, number: int) -> None:
        self._host, self._number = host, number
        self._reader: socket.socket | None = None
        self._rest = b""
        self._listen()

    @property
    def name(self) -> str:
        """As in ``tcp://127.0.0.1:4000``."""
        return f"tcp://{self._host}:{self._number}"

    def _listen(self) -> None:
        self._server = socket.create_server((self._host, self._number))
        self._server.setblocking(False)
        self._number = self._server.getsockname()[1]

    def heard(self) -> bool:
        """Whether somebody is connected; takes the first who calls."""
        if self._reader is None:
            try:
                self._reader = self._server.accept()[0]
            except BlockingIOError:
                return False
            self._reader.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._reader.settimeout(_TURN)
        return True

    def send(self, payloads: Sequence[bytes]) -> int:
        """Send; a payload that fits only in part is finished by the next call, which begins with it."""
        for done, payload in enumerate(payloads):
            data = self._rest or payload
            while data:
                if not self.heard() or self._reader is None:
                    self._rest = b""
                    return len(payloads)
                try:
                    data = data[self._reader.send(data) :]
                except TimeoutError:
                    self._rest = data
                    return done
                except OSError:
                    self._hang_up()
            self._rest = b""
        return len(payloads)

    def _hang_up(self) -> None:
        if self._reader:
            self._reader.close()
        self._reader = None
        self._rest = b""

    def unplug(self) -> None:
        """Hang up, and stop to listen."""
        self._hang_up()
        self._server.close()

    def replug(self) -> None:
        """Listen again, at the same number."""
        self._listen()

    def close(self) -> None:
        """Hang up; what was sent arrives."""
        self.unplug()


class UdpPort:
    """UDP: one payload in one datagram, to whoever may listen.

    Parameters
    ----------
    host : str
        Address to send to.
    number : int
        Its port.
    """

    def __init__(self, host: str, number: int) -> None:
        self._to = (host, number)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    @property
    def name(self) -> str:
        """As in ``udp://127.0.0.1:4000``."""
        return f"udp://{self._to[0]}:{self._to[1]}"

    def heard(self) -> bool:
        """Nobody can know; so always."""
        return True

    def send(self, payloads: Sequence[bytes]) -> int:
        """Send each in one datagram, longer ones in several."""
        for payload in payloads:
            for at in range(0, len(payload), 1400):
                self._socket.sendto(payload[at : at + 1400], self._to)
        return len(payloads)

    def unplug(self) -> None:
        """Nothing to do: silence is all that a reader of datagrams would notice."""

    def replug(self) -> None:
        """Nothing to do."""

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class FilePort:
    """File or pipe: the bytes, and nothing else.

    Parameters
    ----------
    file : binary file
        Where to write; it is not closed.
    name : str
        What to call it.
    """

    def __init__(self, file: BinaryIO, name: str) -> None:
        self._file, self._name = file, name

    @property
    def name(self) -> str:
        """As given."""
        return self._name

    def heard(self) -> bool:
        """Say yes: a file always listens."""
        return True

    def send(self, payloads: Sequence[bytes]) -> int:
        """Write them."""
        self._file.write(b"".join(payloads))
        self._file.flush()
        return len(payloads)

    def unplug(self) -> None:
        """Nothing to do: a file only misses what is lost."""

    def replug(self) -> None:
        """Nothing to do."""

    def close(self) -> None:
        """Leave the file to its owner."""
