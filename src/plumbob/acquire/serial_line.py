"""Serial lines: UARTs, USB adapters, USB-CDC devices and pseudo-terminals, through pyserial on Linux and macOS."""

import contextlib
import errno
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Final

from plumbob.acquire.opened import BackOff, NoLine
from plumbob.acquire.overruns import Overruns
from plumbob.acquire.ports import ListPorts, check_port, find_port, list_ports
from plumbob.acquire.replug import TAKE_LIMIT, Replug
from plumbob.errors import ParameterError
from plumbob.link import Event, Received

if TYPE_CHECKING:
    import serial

GATHER: Final = 2e-3
"""Least time from one read to the next, s."""

_PARITIES: Final = ("N", "E", "O", "M", "S")
_CHUNK: Final = 1 << 16
_GROUP = "add yourself to the group that owns it, usually 'sudo usermod -aG dialout $USER', and log in again"
_BUSY = {errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK}  # the last two are how flock says so
_GONE = {errno.ENOENT, errno.ENXIO, errno.ENODEV, errno.EIO}


class SerialSource(Replug):
    """Bytes of a serial line, whatever happens to its plug.

    Each `Received` holds all that was there, stamped right after it was read. While nobody reads, the kernel keeps 4 kB
    at least; where the driver counts the bytes that it could not keep, they are told as ``dropped``.

    Parameters
    ----------
    port : str
        Path, link as in ``/dev/serial/by-id/``, pattern as ``/dev/ttyUSB*``, or ``auto:VID:PID[:SERIAL]``; resolved
        again at each opening, so a port that comes back with another number is found.
    baud : int
        Symbols per second. A wrong one gives wrong bytes, not an error; where the driver counts framing errors, they
        are told as ``damaged``.
    bytesize, parity, stopbits : int, str, float
        Form of a character: 5 to 8 bits; ``N``, ``E``, ``O``, ``M`` or ``S``; 1, 1.5 or 2.
    rtscts, xonxoff : bool
        Flow control by lines or by characters.
    exclusive : bool
        Lock the port, so that no second reader takes bytes away.
    wait, gather, back_off, clock, sleep
        As in `Replug`.
    ports : callable
        Lists the ports of the machine.

    Notes
    -----
    Events: ``opened``, ``lost``, ``reopened``, ``dropped``, ``damaged``, and, while a line cannot be opened,
    ``absent``, ``ambiguous``, ``busy``, ``denied`` or ``refused``, once for each reason.

    Raises
    ------
    ParameterError
        If an argument can never be right.
    """

    def __init__(
        self,
        port: str,
        baud: int,
        *,
        bytesize: int = 8,
        parity: str = "N",
        stopbits: float = 1,
        rtscts: bool = False,
        xonxoff: bool = False,
        exclusive: bool = True,
        wait: bool = False,
        gather: float = GATHER,
        back_off: BackOff | None = None,
        ports: ListPorts = list_ports,
        clock: Callable[[], int] = time.monotonic_ns,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        super().__init__(port, wait=wait, gather=gather, back_off=back_off, clock=clock, sleep=sleep)
        if baud <= 0 or bytesize not in {5, 6, 7, 8} or parity not in _PARITIES or stopbits not in {1, 1.5, 2}:
            raise ParameterError(
                f"A serial line needs baud > 0, 5 to 8 bits, parity {', '.join(_PARITIES)} and 1, 1.5 or 2 stop bits, "
                f"but got baud={baud}, bytesize={bytesize}, parity={parity!r}, stopbits={stopbits}."
            )
        self._port, self._ports = check_port(port), ports
        self._baud, self._bytesize, self._parity, self._stopbits = baud, bytesize, parity, stopbits
        self._rtscts, self._xonxoff, self._exclusive = rtscts, xonxoff, exclusive

    def _connect(self, patience: float) -> "SerialWire":
        import termios

        import serial

        path = self._port
        try:
            path = find_port(self._port, self._ports)
            port = serial.Serial(
                path, self._baud, self._bytesize, self._parity, self._stopbits, timeout=0,
                xonxoff=self._xonxoff, rtscts=self._rtscts, exclusive=self._exclusive or None,
            )  # fmt: skip
        except (OSError, ValueError, termios.error) as error:
            raise _refusal(path, error) from error
        return SerialWire(port, path, self._clock)


def _refusal(path: str, error: Exception) -> NoLine:
    number = error.errno if isinstance(error, OSError) else None
    if number in {errno.EACCES, errno.EPERM}:
        return NoLine("denied", f"No permission to open {path}: {_GROUP}.")
    if number in _BUSY:
        return NoLine(
            "busy", f"{path} is in use by another program, which would take a part of the bytes; end it first."
        )
    if number in _GONE:
        return NoLine("absent", f"{path} cannot be opened: {os.strerror(number or 0)}.")
    return NoLine("refused", f"{path} cannot be opened: {error}.")


class SerialWire:
    """An open serial port; opening has emptied its input buffer, so nothing from before is in it."""

    def __init__(self, port: "serial.Serial", path: str, clock: Callable[[], int]) -> None:
        real = str(Path(path).resolve())
        self.where = path if real == path else f"{path} ({real})"
        self._port, self._clock = port, clock
        self._overruns = Overruns(port.fileno(), path)

    def fileno(self) -> int:
        """Descriptor of the port."""
        return self._port.fileno()

    def take(self) -> list[Received | Event]:
        """All bytes that are there; OSError where a ready port has none, for that is how one that is gone looks."""
        data = os.read(self._port.fileno(), _CHUNK)
        if not data:
            raise OSError(errno.EIO, "the device is gone or has hung up")
        chunks, size = [data], len(data)
        while size < TAKE_LIMIT and (data := self._more()):
            chunks.append(data)
            size += len(data)
        now = self._clock()
        return [*self._overruns.ask(now), Received(now, b"".join(chunks))]

    def _more(self) -> bytes:
        try:
            return os.read(self._port.fileno(), _CHUNK)
        except OSError:  # the next `take` meets it again, when the bytes from before are delivered
            return b""

    def close(self) -> None:
        """Close the port, gone or not."""
        with contextlib.suppress(OSError):
            self._port.close()
