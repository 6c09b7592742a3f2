"""Ports and sockets, and the frames of a rig sent when they are due, without accumulated lateness."""

import socket
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from time import monotonic_ns, sleep
from typing import BinaryIO, Final, Protocol

import numpy as np

from plumbob.core.text import FactsText
from plumbob.live.rigs.faults import Fault
from plumbob.live.rigs.rig import Rig
from plumbob.live.transports.transport import Stopping


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
            self._reader.settimeout(TURN)
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


TURN: Final = 0.05
"""s; how long one wait lasts, so that a stop is noticed soon."""


class Port(Protocol):
    """One end of a line."""

    @property
    def name(self) -> str:
        """What a reader opens."""
        ...

    def heard(self) -> bool:
        """Whether somebody has the other end open, and is through with opening it."""
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


_BATCH: Final = 256
"""Frames that are handed to the port at a time."""
_LONGEST_WAIT: Final = 0.2
_GONE: Final = 0.05
"""s; how long a port stays away where nobody waits for the time of day."""


@dataclass(repr=False)
class Served(FactsText):
    """What became of the frames.

    Attributes
    ----------
    frames : int
        Frames that there were to send.
    sent : int
        Frames handed to the port, damaged ones included.
    lost : int
        Frames that a fault took away.
    unheard : int
        Frames that were due while nobody listened.
    latest_ns : int
        Longest delay of a frame behind its time, ns; 0 as fast as wanted.
    """

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

    Parameters
    ----------
    rig : Rig
        What to send.
    port : Port
        Where to; it is left open.
    speed : float or None
        Times real time; None sends as fast as the reader takes them.
    stop : Stopping
        Ends it early.
    on_fault : callable
        Called with each fault once it has happened.
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
