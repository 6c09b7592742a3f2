"""Pseudo-terminals: what looks like a serial line to whoever opens it."""

import contextlib
import math
import os
import select
import termios
import tty
from collections.abc import Sequence
from fcntl import ioctl
from pathlib import Path
from time import monotonic, sleep
from typing import Final

from plumbob.core.errors import ParameterError
from plumbob.live.rigs.serving import TURN
from plumbob.live.transports.transport import Stopping

_OPENING: Final = 0.5
"""s; how long opening a line may take: programs set it up and then empty it, and what came before is gone."""

_SETTING_UP: Final = 3.0
"""s; the same for a program that has begun to set it up, however busy the host is."""

_SHORTLY: Final = 1.0
"""s; how long a terminal's reader may take for the rest, when the port vanishes or is stopped."""
_BARELY, _SURELY = 0.02, 0.2
"""s; how long a terminal must be empty when it vanishes, and at the end: a busy kernel brings the rest late."""


class PtyPort:
    """Pseudo-terminal: looks like a serial line to whoever opens it.

    Parameters
    ----------
    link : Path, optional
        Symbolic link that always leads to the present terminal.
    stop : Stopping, optional
        Ends the wait for a reader at the end early.
    """

    def __init__(self, link: Path | None = None, stop: Stopping | None = None) -> None:
        self._link, self._stop = link, stop
        self._rest = b""
        self._open()

    @property
    def name(self) -> str:
        """Path of the terminal."""
        return self._name

    def _open(self) -> None:
        self._master, slave = os.openpty()
        tty.setraw(slave)
        ioctl(self._master, termios.TIOCPKT, (1).to_bytes(4, "little"))  # tells when a reader empties the line
        self._since: float | None = None
        self._ready = False
        self._name, self._plain = os.ttyname(slave), termios.tcgetattr(slave)
        os.close(slave)
        os.set_blocking(self._master, False)
        if self._link:
            _lead(self._link, self._name)

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
                    if not self._poll(select.POLLOUT, TURN) & select.POLLOUT:
                        self._rest = data
                        return done
            self._rest = b""
        return len(payloads)

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

    def replug(self) -> None:
        """Open another one behind the same link."""
        self._open()

    def close(self) -> None:
        """Close it, once everything has been read or nobody has it open: a reader may be stalled for any time."""
        self._settle(math.inf, _SURELY)
        self._shut()

    def _shut(self) -> None:
        """Close it; a link that stayed could lead to a stranger's terminal, for names are used again."""
        if self._link and self._link.is_symlink() and str(self._link.readlink()) == self._name:
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
        slave = os.open(self._name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
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
