"""What a UART's driver counts: bytes it could not keep, and characters that were malformed on the wire."""

import errno
import struct
import sys
from collections.abc import Callable
from typing import Any, Final

from plumbob.link import Event

TIOCGICOUNT: Final = 0x545D  # Linux, asm-generic/ioctls.h
EVERY_NS: Final = 1_000_000_000
"""How often the driver is asked, ns."""

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
        seen, counts = self._seen, self._counts()
        if counts is None:
            return []
        self._seen = counts
        lost, bad = counts[0] - seen[0], counts[1] - seen[1]
        events = [Event(now_ns, "dropped", f"{self._where}: the driver could not keep {lost} bytes.", lost)]
        text = f"{self._where}: {bad} characters had a wrong stop bit or parity; is the baud rate right?"
        return events * (lost > 0) + [Event(now_ns, "damaged", text, bad)] * (bad > 0)

    def _counts(self) -> tuple[int, int] | None:
        try:
            raw = self._ioctl(self._fd, TIOCGICOUNT, bytes(80))
        except OSError:  # a pseudo-terminal has no such counters
            return None
        counts = _COUNTS.unpack_from(raw)
        return counts[_OVERRUN] + counts[_BUFFER_OVERRUN], counts[_FRAME] + counts[_PARITY]
