"""Serial lines: UARTs, USB adapters, USB-CDC devices and pseudo-terminals, through pyserial on Linux and macOS."""

import contextlib
import errno
import os
import re
import struct
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol, Unpack

from plumbob.core.errors import ParameterError
from plumbob.core.event import Event
from plumbob.core.text import counted
from plumbob.live.transports.transport import TAKE_LIMIT, NoLine, Patience, Received, Replug

if TYPE_CHECKING:
    import serial

TIOCGICOUNT: Final = 0x545D  # Linux, asm-generic/ioctls.h
EVERY_NS: Final = 1_000_000_000  # how often the driver is asked, ns

_COUNTS = struct.Struct("=11i")  # struct serial_icounter_struct, linux/serial.h: the first eleven, of twenty
_FRAME, _OVERRUN, _PARITY, _BUFFER_OVERRUN = 6, 7, 8, 10


def _ioctl(fd: int, request: int, argument: bytes) -> Any:
    import fcntl

    if sys.platform != "linux":  # where the number may mean anything
        raise OSError(errno.ENOTTY, "no such counters")
    return fcntl.ioctl(fd, request, argument)


class Overruns:
    """The driver's counters of one open port, asked now and then; a driver that has none is never asked again."""

    def __init__(self, fd: int, where: str, *, ioctl: Callable[[int, int, bytes], Any] = _ioctl) -> None:
        self._fd, self._where, self._ioctl = fd, where, ioctl
        self._next_ns = 0
        self._seen = self._counts()

    def ask(self, now_ns: int) -> list[Event]:
        """Events ``dropped`` and ``damaged`` with what was counted since the last question."""
        if self._seen is None or now_ns < self._next_ns:
            return []
        self._next_ns = now_ns + EVERY_NS
        before, counts = self._seen, self._counts()
        if counts is None:
            return []
        self._seen = counts
        lost, bad = counts[0] - before[0], counts[1] - before[1]
        events = [Event(now_ns, "dropped", f"{self._where}: the driver could not keep {counted(lost, 'byte')}.", lost)]
        text = f"{self._where}: {bad} characters had a wrong stop bit or parity; is the baud rate right?"
        return events * (lost > 0) + [Event(now_ns, "damaged", text, bad)] * (bad > 0)

    def _counts(self) -> tuple[int, int] | None:
        try:
            raw = self._ioctl(self._fd, TIOCGICOUNT, bytes(80))
        except OSError:  # a pseudo-terminal has no such counters
            return None
        counts = _COUNTS.unpack_from(raw)
        return counts[_OVERRUN] + counts[_BUFFER_OVERRUN], counts[_FRAME] + counts[_PARITY]


_USB = re.compile(r"auto:([0-9a-fA-F]{4}):([0-9a-fA-F]{4})(?::(.+))?")


class PortInfo(Protocol):
    """What is known of a serial port; pyserial's ``ListPortInfo`` is one."""

    device: str  # path
    description: str  # for people
    # numbers of its USB, where it has such
    vid: Any
    pid: Any
    serial_number: Any


ListPorts = Callable[[], Sequence[PortInfo]]


def list_ports() -> Sequence[PortInfo]:
    """Serial ports of this machine, in the order of their names."""
    from serial.tools.list_ports import comports

    return sorted(comports(), key=lambda port: port.device)


def check_port(port: str) -> str:
    """Refuse a name that can be no port."""
    if not port or (port.startswith("auto:") and not _USB.fullmatch(port)):
        raise ParameterError(
            f"{port!r} is not a serial port. Give a path, a pattern such as /dev/ttyUSB*, or auto:VID:PID[:SERIAL] "
            "with the USB numbers in four hexadecimal digits, as in auto:0403:6001."
        )
    return port


def find_port(port: str, ports: ListPorts = list_ports) -> str:
    """Path of the port that a name, pattern or USB identity stands for now."""
    if usb := _USB.fullmatch(port):
        return _single(port, [p.device for p in ports() if _is_usb(p, *usb.groups())], ports)
    if Path(port).exists():
        return port
    anchor = Path(Path(port).anchor)
    return _single(port, sorted(map(str, anchor.glob(str(Path(port).relative_to(anchor))))), ports)


def _is_usb(port: PortInfo, vid: str, pid: str, serial_number: str | None) -> bool:
    same = (port.vid, port.pid) == (int(vid, 16), int(pid, 16))
    return same and (serial_number is None or port.serial_number == serial_number)


def _single(port: str, matching: list[str], ports: ListPorts) -> str:
    if not matching:
        there = ", ".join(f"{p.device} ({p.description})" for p in ports()) or "none"
        raise NoLine("absent", f"There is no serial port {port}; the ports of this machine: {there}.")
    if len(matching) > 1:
        raise NoLine("ambiguous", f"{len(matching)} serial ports match {port}: {', '.join(matching)}; name one.")
    return matching[0]


GATHER: Final = 2e-3  # least time from one read to the next, s

_PARITIES: Final = ("N", "E", "O", "M", "S")
_CHUNK: Final = 1 << 16
_GROUP = "add yourself to the group that owns it, usually 'sudo usermod -aG dialout $USER', and log in again"
_BUSY = {errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK}  # the last two are how flock says so
_GONE = {errno.ENOENT, errno.ENXIO, errno.ENODEV, errno.EIO}


class SerialSource(Replug):
    """Bytes of a serial line, whatever happens to its plug.

    Each `Received` holds all that was there, stamped right after it was read. While nobody reads, the kernel keeps 4 kB
    at least; where the driver counts the bytes that it could not keep, they are reported as ``dropped``, and framing
    errors, as of a wrong baud, as ``damaged``. `port` is a path, a link as in ``/dev/serial/by-id/``, a pattern as
    ``/dev/ttyUSB*``, or ``auto:VID:PID[:SERIAL]``; resolved again at each opening, so a port that comes back with
    another number is found. `exclusive` locks it, so that no second reader takes bytes away.
    """

    def __init__(
        self, port: str, baud: int, *, bytesize: int = 8, parity: str = "N", stopbits: float = 1, rtscts: bool = False,
        xonxoff: bool = False, exclusive: bool = True, ports: ListPorts = list_ports, gather: float = GATHER,
        **patience: Unpack[Patience],
    ) -> None:  # fmt: skip
        super().__init__(port, gather=gather, **patience)
        if baud <= 0 or bytesize not in {5, 6, 7, 8} or parity not in _PARITIES or stopbits not in {1, 1.5, 2}:
            raise ParameterError(
                f"A serial line needs baud > 0, 5 to 8 bits, parity {', '.join(_PARITIES)} and 1, 1.5 or 2 stop bits, "
                f"but got baud={baud}, bytesize={bytesize}, parity={parity!r}, stopbits={stopbits}."
            )
        self._port, self._ports = check_port(port), ports
        self._baud, self._bytesize, self._parity, self._stopbits = baud, bytesize, parity, stopbits
        self._rtscts, self._xonxoff, self._exclusive = rtscts, xonxoff, exclusive

    def set_baud(self, baud: int) -> None:
        """Go on at another speed, without opening the port again, at which many boards restart."""
        self._baud = baud
        if isinstance(self._wire, SerialWire):
            self._wire.set_baud(baud)

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

    def set_baud(self, baud: int) -> None:
        """Go on at another speed; what came before is forgotten."""
        self._port.baudrate = baud
        self._port.reset_input_buffer()

    def take(self) -> list[Received | Event]:
        """All bytes that are there; OSError where a ready port has none, for that is how one that is gone looks."""
        data = os.read(self._port.fileno(), _CHUNK)
        if not data:
            raise OSError(errno.EIO, "the device is gone or has disconnected")
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
