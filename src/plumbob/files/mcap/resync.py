"""A file as windows of bytes, and the next place behind a damage from which reading can go on."""

import os
import re
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Final, Self

from plumbob.core.errors import DecodeError
from plumbob.files.mcap import layout

WINDOW: Final = 1 << 20
_SEARCHES: Final = 32


class FileBytes:
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

    def read(self, offset: int, count: int) -> bytes:
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
            yield start, self.read(start, min(WINDOW, end - start) + overlap)
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


_CHUNK: Final = rb"\x06[\s\S]{4}\x00{4}[\s\S]{28}(?:\x00{4}|\x04\x00{3}zstd|\x03\x00{3}lz4)"
_FOOTER: Final = rb"\x02\x14\x00{7}[\s\S]{20}\x89MCAP0\r\n"
_INFO: Final = rb"\x0c[\s\S]{4}\x00{4}\x07\x00{3}plumbob"
_LANDMARK: Final = re.compile(b"|".join((_CHUNK, _FOOTER, _INFO)))
_ONLY_FOOTER: Final = re.compile(_FOOTER)
_STEP: Final = 512
_OVERLAP: Final = 63  # no landmark is longer than one byte more


def next_landmark(
    source: FileBytes, start: int, is_good: Callable[[int], bool], checked: bool
) -> tuple[int, int | None]:
    """Offset, from `start` on, of the next good record or of the end of the data section; else the file's size.

    Where it is the end of the data, the second number shows where its summary begins.

    Parameters
    ----------
    is_good : callable
        Whether a whole chunk, or a whole word of the part about itself, stands at an offset.
    checked : bool
        Whether a summary must have a CRC.
    """
    for at, opcode in _candidates(source, start, _LANDMARK):
        if opcode != layout.FOOTER:
            if is_good(at):
                return at, None
        elif (summary := summary_start(source, at, checked)) is not None and summary >= start:
            data_end = summary - layout.DATA_END_SIZE
            return data_end if data_end >= start else summary, summary
    return source.size, None


def footer_after(source: FileBytes, start: int, checked: bool) -> int | None:
    """Offset of the footer whose summary starts at `start`; None where it or the summary is damaged."""
    for at, _ in _candidates(source, start, _ONLY_FOOTER):
        if summary_start(source, at, checked) == start:
            return at
    return None


def summary_start(source: FileBytes, footer: int, checked: bool) -> int | None:
    """Where the summary begins that a footer speaks of; None if its CRC does not hold."""
    body = source.read(footer + layout.RECORD_HEAD.size, layout.FOOTER_BODY.size)
    start, _, crc = layout.FOOTER_BODY.unpack(body)
    if start > footer or not source.may_search(footer - start):
        return None
    if crc == 0 and not checked:
        return start or footer
    end, checksum = footer + layout.RECORD_HEAD.size + layout.FOOTER_BODY.size - 4, 0
    for _, window in source.windows(start or footer, end):
        checksum = zlib.crc32(window, checksum)
    return (start or footer) if checksum == crc else None


def _candidates(source: FileBytes, start: int, pattern: re.Pattern[bytes]) -> Iterator[tuple[int, int]]:
    """Offsets and opcodes of what looks like a landmark; the next one is near in most files."""
    step = _STEP
    while start < source.size and source.may_search(min(step, source.size - start)):
        window, i = source.read(start, step + _OVERLAP), 0
        while (match := pattern.search(window, i)) and match.start() < step:
            yield start + match.start(), window[match.start()]
            i = match.start() + 1  # the next may begin within this one
        start, step = start + step, min(2 * step, WINDOW)
