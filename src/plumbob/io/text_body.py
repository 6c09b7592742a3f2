"""Rows of numbers in a text file.

A last line without a line end is left out and said so: a cut in its last cell (``9.81`` to ``9.8``) would read as a
good number, so it cannot be trusted, and one sample is the cheaper loss.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from plumbob.io.profile import Layout


@dataclass(frozen=True, slots=True)
class Body:
    """Rows of numbers in a text.

    Attributes
    ----------
    raw : bytes
        The file.
    text : str
        Its text.
    start, end : int
        Where the rows begin and, after the last line end, stop.
    line : int
        Number of the first line, counted from 1.
    """

    raw: bytes
    text: str
    start: int
    end: int
    line: int

    def rows(self) -> Iterator[tuple[int, str]]:
        """Give each line with its number."""
        place, line = self.start, self.line
        while place < self.end:
            stop = self.text.find("\n", place)
            yield line, self.text[place:stop]
            place, line = stop + 1, line + 1

    def packed(self, layout: Layout) -> bytes | memoryview:
        """UTF-8 without comments and with single blanks, as Arrow takes it; no copy where the file is that already."""
        if self._has(layout.comment):
            text = "".join(f"{row}\n" for _, row in self.rows() if not row.startswith(layout.comment))
        elif layout.separator != " " and self.text.isascii() and len(self.text) == len(self.raw):
            return memoryview(self.raw)[self.start : self.end]
        else:
            text = self.text[self.start : self.end]
        return (single_blanks(text) if layout.separator == " " else text).encode()

    def remark(self) -> tuple[str, ...]:
        """Say what of the text was left out."""
        if not self.text[self.end :].strip():
            return ()
        line = self.line + self.text.count("\n", self.start)
        return (f"line {line}, the last, has no line end and may be cut; it was left out",)

    def _has(self, comment: str) -> bool:
        if not comment:
            return False
        return self.text.startswith(comment, self.start) or self.text.find(f"\n{comment}", self.start, self.end) >= 0


def single_blanks(text: str) -> str:
    """Text with runs of blanks and tabs made one blank, and none at the ends of its lines."""
    text = text.replace("\t", " ")
    while "  " in text:
        text = text.replace("  ", " ")
    return text.replace("\n ", "\n").replace(" \n", "\n").removeprefix(" ")
