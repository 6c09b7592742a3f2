"""Where a rig's bytes go, and the simplest of it: a file."""

from collections.abc import Sequence
from typing import BinaryIO, Final, Protocol

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
