"""A file that is read in pieces, never mapped: it may be cut while it is read."""

import os
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Final, Self

from plumbob.errors import DecodeError

WINDOW: Final = 1 << 20
_SEARCHES: Final = 32


class Source:
    """Bytes of a file by offset; whatever lies beyond its end is missing from the answer.

    Parameters
    ----------
    path : Path
        The file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = _open(path)
        self.size = os.fstat(self._file.fileno()).st_size
        self._left = _SEARCHES * self.size + WINDOW

    def at(self, offset: int, count: int) -> bytes:
        """`count` bytes from `offset` on, fewer at the end of the file."""
        if offset >= self.size or count <= 0:
            return b""
        try:
            self._file.seek(offset)
            return self._file.read(min(count, self.size - offset))
        except OSError as error:
            raise DecodeError(f"{self.path} cannot be read at byte {offset}: {error.strerror}.") from error

    def may_search(self, count: int) -> bool:
        """Whether `count` more bytes may be searched for records, or read to judge one: 32 times the file in all.

        A whole file is read thrice at most. One that holds thousands of false records, each with much to check, must
        not be read for as many times.
        """
        self._left -= count
        return self._left >= 0

    def windows(self, start: int, end: int, overlap: int = 0) -> Iterator[tuple[int, bytes]]:
        """Offset and bytes of pieces from `start` to `end`; each goes on `overlap` bytes into the next."""
        while start < end:
            yield start, self.at(start, min(WINDOW, end - start) + overlap)
            start += WINDOW

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()


def _open(path: Path) -> BinaryIO:
    if not path.is_file():
        raise DecodeError(f"{path} is not a file that can be read; check the path.")
    try:
        return path.open("rb")
    except OSError as error:
        raise DecodeError(f"{path} cannot be read: {error.strerror}.") from error
