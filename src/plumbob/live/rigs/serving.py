"""Ports, sockets and pseudo-terminals, and the frames of a rig sent when they are due, without accumulated lateness."""

import contextlib
import math
import os
import select
import socket
import termios
import tty
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fcntl import ioctl
from pathlib import Path
from time import monotonic, monotonic_ns, sleep
from typing import BinaryIO, Final

import numpy as np

from plumbob.core.errors import ParameterError
from plumbob.core.text import FactsText
from plumbob.live.rigs.faults import Fault
from plumbob.live.rigs.rig import Rig
from plumbob.live.transports.transport import Stopping

_OPENING: Final = 0.5  # s; opening a line may take it: programs set it up and empty it, and what came before is gone

_SETTING_UP: Final = 3.0  # s; the same for a program that has begun to set it up, however busy the host is

_SHORTLY: Final = 1.0  # s; how long a terminal's reader may take for the rest, when the port vanishes or is stopped
_BARELY, _SURELY = 0.02, 0.2  # s; a terminal is empty so long when it vanishes, and at the end: a busy kernel is late


TURN: Final = 0.05  # s; how long one wait lasts, so that a stop is noticed soon


class Port:
    """One end of a line, which by default hears everything and cannot vanish."""

    name: str  # what a reader opens; a pseudo-terminal that comes back has another one

    def heard(self) -> bool:
        """Whether somebody has the other end open, and is through with opening it."""
        return True

    def send(self, payloads: Sequence[bytes]) -> int:
        """Send what fits within a short time, and return how many payloads are gone; all of them if nobody hears."""
        raise NotImplementedError

    def unplug(self) -> None:
        """Let the port vanish."""

    def replug(self) -> None:
        """Let it come back."""

    def close(self) -> None:
        """End the line, once what was sent has been read or nobody reads it."""


class _StreamPort(Port):
    """A port of bytes without limits between them."""

    _rest = b""

    def _write(self, data: bytes) -> int | None:
        """Bytes of it that are gone, maybe none; None where no more is taken within a short time."""
        raise NotImplementedError

    def send(self, payloads: Sequence[bytes]) -> int:
        """Send; a payload that fits only in part is finished by the next call, which begins with it."""
        for done, payload in enumerate(payloads):
            data, self._rest = self._rest or payload, b""
            while data:
                if not self.heard():
                    return len(payloads)
                count = self._write(data)
                if count is None:
                    self._rest = data
                    return done
                data = data[count:]
        return len(payloads)


class PtyPort(_StreamPort):
    """Pseudo-terminal: looks like a serial line to whoever opens it.

    A symbolic `link` always leads to the present one; `stop` ends the wait for a reader at the end early.
    """

    def __init__(self, link: Path | None = None, stop: Stopping | None = None) -> None:
        self._link, self._stop = link, stop
        self.replug()

    def replug(self) -> None:
        """Open a terminal, another one each time, behind the link."""
        self._master, slave = os.openpty()
        tty.setraw(slave)
        ioctl(self._master, termios.TIOCPKT, (1).to_bytes(4, "little"))  # tells when a reader empties the line
        self._since: float | None = None
        self._ready = False
        self.name, self._plain = os.ttyname(slave), termios.tcgetattr(slave)
        os.close(slave)
        os.set_blocking(self._master, False)
        if self._link:
            _lead(self._link, self.name)

    def heard(self) -> bool:
        """Whether somebody has it open and emptied it, or had the time to; what they write is read and forgotten."""
        events = self._poll(select.POLLIN | select.POLLPRI, 0.0)
        if events & select.POLLHUP:
            self._since, self._ready, self._rest = None, False, b""
            return False
        if events:
            with contextlib.suppress(OSError):  # it may have been closed just now
                status = int.from_bytes(os.read(self._master, 4096)[:1], "little")
                self._ready |= bool(status & termios.TIOCPKT_FLUSHREAD)
        self._since = monotonic() if self._since is None else self._since
        return self._ready or self._has_had_time()

    def _has_had_time(self) -> bool:
        begun = termios.tcgetattr(self._master) != self._plain  # of a master, they are those of its terminal
        self._ready = monotonic() - (self._since or 0.0) > (_SETTING_UP if begun else _OPENING)
        return self._ready

    def _write(self, data: bytes) -> int | None:
        try:
            return os.write(self._master, data)
        except BlockingIOError:
            return 0 if self._poll(select.POLLOUT, TURN) & select.POLLOUT else None

    def _poll(self, what: int, timeout: float) -> int:
        poller = select.poll()
        poller.register(self._master, what)
        events = poller.poll(1e3 * timeout)
        return events[0][1] if events else 0

    def unplug(self) -> None:
        """Close the terminal: whoever reads it gets an error, once everything has been read."""
        self._settle(_SHORTLY, _BARELY)
        self._shut()
        self._rest = b""

    def close(self) -> None:
        """Close it, once everything has been read or nobody has it open: a reader may be stalled for any time."""
        self._settle(math.inf, _SURELY)
        self._shut()

    def _shut(self) -> None:
        """Close it; a link that stayed could lead to a stranger's terminal, for names are used again."""
        if self._link and self._link.is_symlink() and str(self._link.readlink()) == self.name:
            self._link.unlink()
        os.close(self._master)

    def _settle(self, most: float, quiet: float) -> None:
        """Wait until a reader has read everything; closing this end throws away what it has not."""
        end, empty = monotonic() + most, None
        while self.heard() and (now := monotonic()) < end:
            empty = None if self._unread() else empty or now
            if empty is not None and now - empty >= quiet:
                return
            if self._stop is not None and self._stop.is_set():
                end = min(end, now + _SHORTLY)
            sleep(0.01)

    def _unread(self) -> bool:
        """Whether bytes wait in the terminal; it is not kept open, so that its reader's leaving shows."""
        slave = os.open(self.name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            poller = select.poll()
            poller.register(slave, select.POLLIN)  # which also brings on what is on its way there
            return bool(poller.poll(0))
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


class TcpPort(_StreamPort):
    """TCP server for one reader at a time; port 0 takes a free one."""

    def __init__(self, host: str, number: int) -> None:
        self._host, self._number = host, number
        self._reader: socket.socket | None = None
        self.replug()

    def replug(self) -> None:
        """Listen, each time at the same number."""
        self._server = socket.create_server((self._host, self._number))
        self._server.setblocking(False)
        self._number = self._server.getsockname()[1]
        self.name = f"tcp://{self._host}:{self._number}"

    def heard(self) -> bool:
        """Whether somebody is connected; takes the first who calls."""
        if self._reader is None:
            try:
                self._reader = self._server.accept()[0]
            except BlockingIOError:
                return False
            self._reader.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._reader.settimeout(TURN)
        return True

    def _write(self, data: bytes) -> int | None:
        assert self._reader is not None
        try:
            return self._reader.send(data)
        except TimeoutError:
            return None
        except OSError:
            self._hang_up()
            return 0

    def _hang_up(self) -> None:
        if self._reader:
            self._reader.close()
        self._reader, self._rest = None, b""

    def unplug(self) -> None:
        """Hang up, and stop to listen."""
        self._hang_up()
        self._server.close()

    def close(self) -> None:
        """Hang up; what was sent arrives."""
        self.unplug()


class UdpPort(Port):
    """UDP: one payload in one datagram, to whoever may listen."""

    def __init__(self, host: str, number: int) -> None:
        self._to, self.name = (host, number), f"udp://{host}:{number}"
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def send(self, payloads: Sequence[bytes]) -> int:
        """Send each in one datagram, longer ones in several."""
        for payload in payloads:
            for at in range(0, len(payload), 1400):
                self._socket.sendto(payload[at : at + 1400], self._to)
        return len(payloads)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class FilePort(Port):
    """File or pipe: the bytes, and nothing else; it is not closed."""

    def __init__(self, file: BinaryIO, name: str) -> None:
        self._file, self.name = file, name

    def send(self, payloads: Sequence[bytes]) -> int:
        """Write them."""
        self._file.write(b"".join(payloads))
        self._file.flush()
        return len(payloads)


_BATCH: Final = 256  # frames that are handed to the port at a time
_LONGEST_WAIT: Final = 0.2
_GONE: Final = 0.05  # s; how long a port stays away where nobody waits for the time of day


@dataclass(repr=False)
class Served(FactsText):
    """What became of the frames."""

    frames: int = 0
    sent: int = 0
    lost: int = 0
    unheard: int = 0
    latest_ns: int = 0

    def facts(self) -> Mapping[str, str]:
        """Counts of frames."""
        counts = {"sent": self.sent, "lost by faults": self.lost, "due while nobody listened": self.unheard}
        return {name: str(count) for name, count in counts.items() if count or name == "sent"}


def serve(
    rig: Rig, port: Port, *, speed: float | None, stop: Stopping, on_fault: Callable[[Fault], None] = lambda fault: None
) -> Served:
    """Send every frame, from the moment that somebody listens; late frames are sent, not skipped.

    `speed` is times real time, None as fast as the reader takes them; `on_fault` gets each fault once it has happened.
    """
    served = Served(len(rig))
    if not _await_reader(port, stop):
        return served
    start, at, faults = monotonic_ns(), 0, list(rig.faults)
    while at < len(rig) and not stop.is_set():
        end = _due(rig, at, start, speed, served)
        if end == at:
            _sleep_until(start + int(rig.damage.send_ns[at] / (speed or 1.0)), stop)
            continue
        at = _send(rig, port, at, end, served)
        if at in rig.damage.unplugged:
            at = _replug(rig, port, at, start, speed, stop, served)
        while faults and faults[0].frame < at:
            on_fault(faults.pop(0))
    return served


def _await_reader(port: Port, stop: Stopping) -> bool:
    while not port.heard() and not stop.is_set():
        sleep(0.005)
    return not stop.is_set()


def _due(rig: Rig, at: int, start: int, speed: float | None, served: Served) -> int:
    """Frame up to which all may go out now, and at most up to where the port vanishes."""
    end = min(at + _BATCH, len(rig), *(first for first in rig.damage.unplugged if first > at))
    if speed is None:
        return end
    now = (monotonic_ns() - start) * speed
    end = min(end, int(np.searchsorted(rig.damage.send_ns, now, side="right")))
    if end > at:
        served.latest_ns = max(served.latest_ns, int((now - rig.damage.send_ns[at]) / speed))
    return max(at, end)


def _send(rig: Rig, port: Port, at: int, end: int, served: Served) -> int:
    """Hand frames to the port, and return the first that it has not taken."""
    heard = port.heard()  # asked once: who comes meanwhile hears what is due next
    done = at + port.send(rig.payloads(at, end)) if heard else end
    lost = int(rig.damage.lost[at:done].sum())
    served.lost += lost
    if heard:
        served.sent += done - at - lost
    else:
        served.unheard += done - at - lost
    return done


def _replug(rig: Rig, port: Port, at: int, start: int, speed: float | None, stop: Stopping, served: Served) -> int:
    back = rig.damage.unplugged[at]
    port.unplug()
    if speed is None or back == len(rig):
        sleep(_GONE)
    else:
        _sleep_until(start + int(rig.damage.send_ns[back] / speed), stop)
    port.replug()
    served.lost += back - at
    if speed is None and back < len(rig):
        _await_reader(port, stop)
    return back


def _sleep_until(when_ns: int, stop: Stopping) -> None:
    while not stop.is_set() and (rest := when_ns - monotonic_ns()) > 0:
        sleep(min(rest / 1e9, _LONGEST_WAIT))
