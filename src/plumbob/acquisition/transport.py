"""What comes over a line: bytes with the host's time, and what happened to the line itself."""

from dataclasses import dataclass
from typing import Protocol


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


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened to a line or to a recording; a gap is data.

    Attributes
    ----------
    t_ns : int
        Host's monotonic clock, ns.
    kind : str
        One word, such as ``"opened"``, ``"lost"``, ``"dropped"``, ``"stalled"``, ``"wall-clock"``.
    text : str
        What happened, in a sentence.
    count : int
        How many bytes, datagrams or rows it cost; 0 where that does not apply or is not known.
    """

    t_ns: int
    kind: str
    text: str
    count: int = 0


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
