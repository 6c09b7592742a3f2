"""Tables and figures of a report."""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from plumbob.core.text import WIDTH

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase


_LONG = 20  # rows of a titled table that a page has folded away


@dataclass(frozen=True)
class Table:
    """Rows under a head; the first cell of each row is its name.

    Attributes
    ----------
    title : str
        A noun, with a unit where all columns have the same one; may be empty.
    head : sequence of str
        Names of the columns, with their units.
    rows : sequence of sequence of str
        Cells as they are shown.
    words : collection of int
        Columns of words, from 0; the others are numbers. The first one always is.
    strong : collection of (int, int)
        Row and column of the cells that a page sets in bold.
    detail : str
        What to ask for to have it in the text; a page has it folded away. Empty: always shown.
    """

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    words: Collection[int] = ()
    strong: Collection[tuple[int, int]] = ()
    detail: str = ""

    @property
    def long(self) -> bool:
        """Whether a page has it folded away."""
        return bool(self.detail or (self.title and len(self.rows) > _LONG))

    def text(self) -> Iterator[str]:
        """Lines with columns as wide as their longest cell; last words that are too long stand below their row."""
        lines = [list(row) for row in ([self.head] if any(self.head) else []) + list(self.rows)]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        last = len(widths) - 1
        below = last in self.words and sum(widths) + last > WIDTH
        shown = widths[:-1] if below else widths
        narrow = sum(shown) + len(shown) - 1 <= WIDTH < sum(shown) + 2 * len(shown) - 2
        gap = " " if narrow else "  "
        for line in lines:
            remark = line.pop() if below else ""
            cells = [
                f"{cell:<{width}}" if i == 0 or i in self.words else f"{cell:>{width}}"
                for i, (cell, width) in enumerate(zip(line, widths, strict=False))
            ]
            yield gap.join(cells).rstrip()
            if remark and line[1:] != list(self.head[1:-1]):
                yield f"     {remark}"


@dataclass(frozen=True)
class Figure:
    """A drawing.

    Attributes
    ----------
    caption : str
        A noun.
    draw : callable
        Draws on the matplotlib figure that it gets, in colours of this module.
    key : sequence of (str, str, str)
        Names of lines, their colours, and "solid", "dashed", "dotted" or "block".
    height : float
        Inches.
    """

    caption: str
    draw: "Callable[[FigureBase], object]"
    key: Sequence[tuple[str, str, str]] = ()
    height: float = 2.4
