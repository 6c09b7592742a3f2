"""What every source of bytes is: opened once, read until it is closed, patient in between; what it gives."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self

from plumbob.core.errors import ParameterError
from plumbob.core.event import Event


@dataclass(frozen=True, slots=True)
class Received:
    """Bytes as they arrived.

    Attributes
    ----------
    t_ns : int
        Host's monotonic clock when they were read, ns. Never the wall clock, which steps.
    data : bytes
        The bytes, unchanged.
    """

    t_ns: int
    data: bytes


class Source(Protocol):
    """Where bytes come from: a serial line, a socket, a device file, a recording."""

    @property
    def name(self) -> str:
        """Short name for messages and recordings."""
        ...

    @property
    def finished(self) -> bool:
        """Whether nothing will ever come again; a live line is never finished by itself."""
        ...

    def read(self, timeout: float) -> list[Received | Event]:
        """Wait at most `timeout` s for something, and return what has come, oldest first; empty where nothing has.

        A line that breaks raises nothing: it gives an `Event`, and later another when it is back.
        """
        ...

    def close(self) -> None:
        """Let go of the line; more than once does no harm."""
        ...


class Stopping(Protocol):
    """Something that says when to end, such as a `threading.Event`; it is asked, and never waited for."""

    def is_set(self) -> bool:
        """Whether it is time to end."""
        ...


class Stop:
    """Says when to end, and may be called by a signal: it takes no lock, on which a handler could wait for itself."""

    __slots__ = ("_set",)

    def __init__(self) -> None:
        self._set = False

    def set(self) -> None:
        """Say that it is time."""
        self._set = True

    def is_set(self) -> bool:
        """Whether it is time to end."""
        return self._set


class NoLine(Exception):  # noqa: N818  it is no error but an answer, and never leaves this package
    """Why a line cannot be opened now: one word for the `Event`, and a sentence."""

    def __init__(self, kind: str, text: str) -> None:
        super().__init__(text)
        self.kind, self.text = kind, text


@dataclass(frozen=True, slots=True)
class BackOff:
    """How long to wait before the next attempt to open a line.

    Attributes
    ----------
    first : float
        After the first failure, s.
    longest : float
        Never longer, s. A line that is there again is found this much later at most.
    factor : float
        From one wait to the next.
    """

    first: float = 0.05
    longest: float = 0.5
    factor: float = 2.0

    def __post_init__(self) -> None:
        if not (0.0 < self.first <= self.longest and self.factor >= 1.0):
            raise ParameterError(f"A back-off needs 0 < first <= longest and factor >= 1, but it is {self}.")

    def wait_ns(self, failures: int) -> int:
        """Wait after so many failures in a row, ns."""
        steps = min(failures - 1, 64)  # enough for any wait, and no overflow after a week without the line
        return round(min(self.longest, self.first * self.factor**steps) * 1e9)


class Opened(ABC):
    """A `Source` that is made, opened and read, as a context or without.

    Parameters
    ----------
    name : str
        For messages and recordings.
    back_off : BackOff
        Patience with what is not there.
    clock : callable
        Monotonic time, ns.
    sleep : callable
        Waits so many s.
    """

    def __init__(
        self, name: str, back_off: BackOff | None, clock: Callable[[], int], sleep: Callable[[float], None]
    ) -> None:
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
