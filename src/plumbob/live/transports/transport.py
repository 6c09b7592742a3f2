"""What every source of bytes is: opened once, read until it is closed, patient in between, and opened again."""

import select
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Final, Protocol, Self, TypedDict, Unpack

from plumbob.core.errors import LineError, ParameterError
from plumbob.core.event import Event

LOOPBACK: Final = "127.0.0.1"  # where no host is named: to be heard by other machines is asked for, as 0.0.0.0


@dataclass(frozen=True, slots=True)
class Received:
    """Bytes as they arrived."""

    t_ns: int  # Host's monotonic clock when they were read, ns. Never the wall clock, which steps.
    data: bytes  # the bytes, unchanged
    source: str = ""  # which of several sources they came from; empty for the first


class Source(Protocol):
    """Where bytes come from: a serial line, a socket, a device file, a recording."""

    @property
    def name(self) -> str:
        """Short name for messages and recordings."""

    @property
    def finished(self) -> bool:
        """Whether nothing will ever come again; a live line is never finished by itself."""

    def read(self, timeout: float) -> list[Received | Event]:
        """Wait at most `timeout` s for something, and return what has come, oldest first; empty where nothing has.

        A line that breaks raises nothing: it gives an `Event`, and later another when it is back.
        """

    def close(self) -> None:
        """Let go of the line; more than once does no harm."""


class Stopping(Protocol):
    """Something that says when to end, such as a `threading.Event`; it is asked, and never waited for."""

    def is_set(self) -> bool:
        """Whether it is time to end."""


class Stop:
    """Says when to end, as soon as it is set or `other` is; without a lock, for which a signal handler could wait."""

    __slots__ = ("_other", "_set")

    def __init__(self, other: Stopping | None = None) -> None:
        self._set, self._other = False, other

    def set(self) -> None:
        """Say that it is time."""
        self._set = True

    def is_set(self) -> bool:
        """Whether it is time to end."""
        return self._set or (self._other is not None and self._other.is_set())


class NoLine(Exception):  # noqa: N818  it is no error but an answer, and never leaves this package
    """Why a line cannot be opened now: one word for the `Event`, and a sentence."""

    def __init__(self, kind: str, text: str) -> None:
        super().__init__(text)
        self.kind, self.text = kind, text


@dataclass(frozen=True, slots=True)
class BackOff:
    """How long to wait before the next attempt to open a line."""

    first: float = 0.05  # after the first failure, s
    longest: float = 0.5  # Never longer, s. A line that is there again is found this much later at most.
    factor: float = 2.0  # from one wait to the next

    def __post_init__(self) -> None:
        if not (0.0 < self.first <= self.longest and self.factor >= 1.0):
            raise ParameterError(f"A back-off needs 0 < first <= longest and factor >= 1, but it is {self}.")

    def wait_ns(self, failures: int) -> int:
        """Wait after so many failures in a row, ns."""
        steps = min(failures - 1, 64)  # enough for any wait, and no overflow after a week without the line
        return round(min(self.longest, self.first * self.factor**steps) * 1e9)


class Pace(TypedDict, total=False):
    """What every source can be given: its patience with what is not there, its monotonic clock, ns, and its sleep."""

    back_off: BackOff | None
    clock: Callable[[], int]
    sleep: Callable[[float], None]


class Patience(Pace, total=False):
    """What every line can be given, too, as of `Replug`."""

    wait: bool


class Opened(ABC):
    """A `Source` that is made, opened and read, as a context or without."""

    def __init__(
        self, name: str, back_off: BackOff | None = None, clock: Callable[[], int] = time.monotonic_ns,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:  # fmt: skip
        self._name = name
        self._back_off = back_off or BackOff()
        self._clock, self._sleep = clock, sleep
        self._closed = False
        self._told: list[Received | Event] = []
        self._failures = self._next_try_ns = 0

    @abstractmethod
    def open(self) -> Self:
        """Open it now; `read` does where this was not called."""

    @abstractmethod
    def _more(self, until_ns: int) -> list[Received | Event]:
        """What has come, waiting until that time at most; it is open, or was and is sought again."""

    @abstractmethod
    def _let_go(self) -> None:
        """Close what is open; nothing may be."""

    @property
    def name(self) -> str:
        """Short name for messages and recordings."""
        return self._name

    @property
    def finished(self) -> bool:
        """Whether it was closed; it is never finished by itself."""
        return self._closed

    def read(self, timeout: float) -> list[Received | Event]:
        """Wait at most `timeout` s for something and return it, oldest first; see `transport.Source`."""
        if self._closed:
            return []
        until_ns = self._clock() + round(timeout * 1e9)
        self.open()
        if self._told:
            items, self._told = self._told, []
            return items
        return self._more(until_ns)

    def close(self) -> None:
        """Let go of it; more than once does no harm."""
        self._closed = True
        self._let_go()

    def __enter__(self) -> Self:
        return self.open()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self.close()

    def _try_later(self, now_ns: int) -> None:
        """Count a failure, and be patient before the next attempt."""
        self._failures += 1
        self._next_try_ns = now_ns + self._back_off.wait_ns(self._failures)


TAKE_LIMIT: Final = 1 << 20  # bytes that a `Wire.take` is content with, so that in a flood `read` returns


class Wire(Protocol):
    """An open line."""

    where: str  # what was opened, for people

    def fileno(self) -> int:
        """Descriptor that becomes readable when something has come."""

    def take(self) -> list[Received | Event]:
        """All that is there, asked only when something is; OSError where the line is gone and nothing was left."""

    def close(self) -> None:
        """Let go."""


class Replug(Opened):
    """A `Source` over a line that may break and come back.

    `wait`: at start, wait for a line that cannot be opened yet, instead of raising. `gather`: least time from one read
    to the next, s: what comes meanwhile is read in one go, so a fast stream wakes the process 1 / gather times a second
    at most, and is up to `gather` late for that; bytes after a silence are not. Without a byte for `silence`, s, an
    open line is lost (`breaks_on_silence`) or reported as stalled.
    """

    def __init__(
        self, name: str, *, wait: bool = False, gather: float = 0.0, silence: float | None = None,
        breaks_on_silence: bool = False, **pace: Unpack[Pace],
    ) -> None:  # fmt: skip
        if not 0.0 <= gather <= 1.0:
            raise ParameterError(f"gather must be from 0 to 1 s, but is {gather}.")
        if silence is not None and not silence > 0.0:
            raise ParameterError(f"The longest silence of a line must be above 0 s, but is {silence}.")
        super().__init__(name, **pace)
        self._wait, self._gather_ns = wait, round(gather * 1e9)
        self._silence_ns = None if silence is None else round(silence * 1e9)
        self._breaks_on_silence = breaks_on_silence
        self._wire: Wire | None = None
        self._poll: select.poll | None = None
        self._begun = self._stalled = False
        self._refusal = ""
        self._lost_ns: int | None = None
        self._taken_ns = self._heard_ns = 0

    @abstractmethod
    def _connect(self, patience: float) -> Wire | None:
        """Open the line; None where that needs more than `patience` s and is to be asked again; else NoLine."""

    def open(self) -> Self:
        """Open the line now; `read` does where this was not called."""
        if self._begun:
            return self
        wire = None
        while not self._wait and wire is None:
            try:
                wire = self._connect(0.5)
            except NoLine as no:
                raise LineError(no.text) from no.__cause__
        self._begun = True
        if wire is not None:
            self._told.append(self._opened(wire))
        return self

    def _more(self, until_ns: int) -> list[Received | Event]:
        return self._seek(until_ns) if self._wire is None else self._listen(self._wire, until_ns)

    def _seek(self, until_ns: int) -> list[Received | Event]:
        """Try to open the line, as often as the back-off allows, until the time is up or there is something to tell."""
        while True:
            now = self._clock()
            if now >= self._next_try_ns and (items := self._attempt((until_ns - now) / 1e9)):
                return items
            left_ns = min(self._next_try_ns, until_ns) - self._clock()
            if left_ns > 0:
                self._sleep(left_ns / 1e9)
            if self._clock() >= until_ns:
                return []

    def _attempt(self, patience: float) -> list[Received | Event]:
        try:
            wire = self._connect(max(patience, 0.0))
        except NoLine as no:
            self._try_later(self._clock())
            previous, self._refusal = self._refusal, no.text
            return [] if no.text == previous else [Event(self._clock(), no.kind, no.text)]
        return [] if wire is None else [self._opened(wire)]

    def _opened(self, wire: Wire) -> Event:
        now = self._clock()
        self._wire, self._poll = wire, select.poll()
        self._poll.register(wire.fileno(), select.POLLIN)
        self._refusal, self._stalled, self._heard_ns = "", False, now
        if self._lost_ns is None:
            return Event(now, "opened", f"{wire.where} is open.")
        gap = (now - self._lost_ns) / 1e9
        return Event(now, "reopened", f"{wire.where} is open again after {gap:.3f} s without it.")

    def _listen(self, wire: Wire, until_ns: int) -> list[Received | Event]:
        quiet_ns = self._quiet_ns()
        self._pause(until_ns)
        if not self._ready(until_ns if quiet_ns is None else min(until_ns, quiet_ns)):
            return self._fall_silent(wire, quiet_ns)
        try:
            items = wire.take()
        except OSError as error:
            return [self._lose(wire, error.strerror or str(error))]
        self._taken_ns = self._clock()
        return [*self._hear(wire), *items] if items else []

    def _pause(self, until_ns: int) -> None:
        left_ns = min(self._taken_ns + self._gather_ns, until_ns) - self._clock()
        if left_ns > 0:
            self._sleep(left_ns / 1e9)

    def _ready(self, until_ns: int) -> bool:
        assert self._poll is not None
        return bool(self._poll.poll(max(0.0, (until_ns - self._clock()) / 1e6)))

    def _quiet_ns(self) -> int | None:
        """When the silence of the line has lasted too long; None where that does not matter or was told."""
        return None if self._silence_ns is None or self._stalled else self._heard_ns + self._silence_ns

    def _fall_silent(self, wire: Wire, quiet_ns: int | None) -> list[Received | Event]:
        now = self._clock()
        if quiet_ns is None or now < quiet_ns:
            return []
        text = f"nothing has come for {(now - self._heard_ns) / 1e9:.3f} s"
        if self._breaks_on_silence:
            return [self._lose(wire, text)]
        self._stalled = True
        return [Event(now, "stalled", f"{wire.where}: {text}.")]

    def _hear(self, wire: Wire) -> list[Received | Event]:
        now, since, stalled = self._taken_ns, self._heard_ns, self._stalled
        self._heard_ns, self._stalled, self._failures = now, False, 0  # only now has opening it helped
        return [Event(now, "resumed", f"{wire.where} goes on after {(now - since) / 1e9:.3f} s.")] if stalled else []

    def _lose(self, wire: Wire, why: str) -> Event:
        self._lost_ns = self._clock()
        self._try_later(self._lost_ns)
        self._let_go()
        return Event(self._lost_ns, "lost", f"{wire.where} is lost: {why.rstrip('.')}.")

    def _let_go(self) -> None:
        wire, self._wire, self._poll = self._wire, None, None
        if wire is not None:
            wire.close()
