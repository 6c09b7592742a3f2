"""Sockets: a TCP server, and UDP datagrams."""

import socket
from collections.abc import Sequence

from plumbob.simulation.rigs.serving import TURN


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
