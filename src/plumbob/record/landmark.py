"""Find the next place in a damaged file from which reading can go on."""

import re
import zlib
from collections.abc import Callable, Iterator
from typing import Final

from plumbob.record import layout
from plumbob.record.source import WINDOW, Source

_CHUNK: Final = rb"\x06[\s\S]{4}\x00{4}[\s\S]{28}(?:\x00{4}|\x04\x00{3}zstd|\x03\x00{3}lz4)"
_FOOTER: Final = rb"\x02\x14\x00{7}[\s\S]{20}\x89MCAP0\r\n"
_INFO: Final = rb"\x0c[\s\S]{4}\x00{4}\x07\x00{3}plumbob"
_LANDMARK: Final = re.compile(b"|".join((_CHUNK, _FOOTER, _INFO)))
_ONLY_FOOTER: Final = re.compile(_FOOTER)
_STEP: Final = 512
_OVERLAP: Final = 63  # no landmark is longer than one byte more


def next_landmark(source: Source, start: int, is_good: Callable[[int], bool], checked: bool) -> tuple[int, int | None]:
    """Offset, from `start` on, of the next good record or of the end of the data section; else the file's size.

    Where it is the end of the data, the second number tells where its summary begins.

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


def footer_after(source: Source, start: int, checked: bool) -> int | None:
    """Offset of the footer whose summary starts at `start`; None where it or the summary is damaged."""
    for at, _ in _candidates(source, start, _ONLY_FOOTER):
        if summary_start(source, at, checked) == start:
            return at
    return None


def summary_start(source: Source, footer: int, checked: bool) -> int | None:
    """Where the summary begins that a footer speaks of; None if its CRC does not hold."""
    body = source.at(footer + layout.RECORD_HEAD.size, layout.FOOTER_BODY.size)
    start, _, crc = layout.FOOTER_BODY.unpack(body)
    if start > footer or not source.may_search(footer - start):
        return None
    if crc == 0 and not checked:
        return start or footer
    end, found = footer + layout.RECORD_HEAD.size + layout.FOOTER_BODY.size - 4, 0
    for _, window in source.windows(start or footer, end):
        found = zlib.crc32(window, found)
    return (start or footer) if found == crc else None


def _candidates(source: Source, start: int, pattern: re.Pattern[bytes]) -> Iterator[tuple[int, int]]:
    """Offsets and opcodes of what looks like a landmark; the next one is near in most files."""
    step = _STEP
    while start < source.size and source.may_search(min(step, source.size - start)):
        window, i = source.at(start, step + _OVERLAP), 0
        while (found := pattern.search(window, i)) and found.start() < step:
            yield start + found.start(), window[found.start()]
            i = found.start() + 1  # the next may begin within this one
        start, step = start + step, min(2 * step, WINDOW)
