"""What a report is, and how it is written as text and as JSON; pages and pictures are written by the files beside."""

import math
import textwrap
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plumbob.core.text import WIDTH, Shown, listed

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

    from plumbob.reporting.scene import Scene

_NAME = 11  # letters of the name of a fact, at least


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
    draw: "Callable[[FigureBase], None]"
    key: Sequence[tuple[str, str, str]] = ()
    height: float = 2.4


@dataclass(frozen=True)
class Report:
    """What is to be said about something, in the order in which it is read.

    Attributes
    ----------
    title : str
        A noun.
    facts : sequence of (str, str)
        Names and values; a name may come again.
    tables : sequence of Table
        The numbers.
    remarks : sequence of str
        What a reader must know, each a sentence.
    figures : sequence of Figure
        Drawn only where they are shown.
    parts : sequence of Report
        One for each subject in it.
    definitions : sequence of str
        What the words and signs mean, for the foot of a page.
    scenes : sequence of Scene
        Bodies that move, on a page only.
    links : sequence of (str, str)
        Names and addresses of pages beside this one, on a page only.
    """

    title: str
    facts: Sequence[tuple[str, str]] = ()
    tables: Sequence[Table] = ()
    remarks: Sequence[str] = ()
    figures: Sequence[Figure] = ()
    parts: "Sequence[Report]" = ()
    definitions: Sequence[str] = ()
    scenes: "Sequence[Scene]" = ()
    links: Sequence[tuple[str, str]] = ()

    def text(self, *details: str) -> str:
        """Text for a terminal, with the tables that are always shown and those of the given details."""
        return "\n".join(_text(self, details, top=True))

    def page(self, *, lang: str = "en") -> str:
        """HTML of a page, self-contained, its labels in a language of `LANGUAGES`; needs matplotlib for figures."""
        from plumbob.reporting.page import page

        return page(self, lang=lang)

    def write_html(self, path: str | Path, *, lang: str = "en", overwrite: bool = False) -> Path:
        """Write the page, a single file that opens offline; errors as of `page` and of an output that exists."""
        from plumbob.core.files import write_text

        return write_text(path, self.page(lang=lang), overwrite=overwrite)

    def plot(self, path: str | Path, *, lang: str = "en", overwrite: bool = False) -> Path:
        """Write its own figures, or those of its parts where it has none, as SVG, PNG or PDF by the name's ending."""
        from plumbob.reporting.drawing import picture

        return picture(path, self._first_figures(), lang=lang, overwrite=overwrite)

    def _first_figures(self) -> list[Figure]:
        if self.figures or not self.parts:
            return list(self.figures)
        return [
            replace(figure, caption=f"{part.title}: {figure.caption}")
            for part in self.parts
            for figure in part._first_figures()
        ]


class Reported(Shown):
    """Mixin of a result that fills a `Report`: text, page and picture of it."""

    __slots__ = ()

    def report(self) -> Report:
        """What is to be said about it."""
        raise NotImplementedError

    def text(self, *details: str) -> str:
        """Report as text, with further tables where their names are given."""
        return self.report().text(*details)

    def write_html(self, path: str | Path, *, lang: str = "en", overwrite: bool = False) -> Path:
        """Write the report as a page, as `Report.write_html` does."""
        return self.report().write_html(path, lang=lang, overwrite=overwrite)

    def plot(self, path: str | Path, *, lang: str = "en", overwrite: bool = False) -> Path:
        """Write the figures as a picture, as `Report.plot` does."""
        return self.report().plot(path, lang=lang, overwrite=overwrite)


def _text(report: Report, details: Collection[str], *, top: bool) -> Iterator[str]:
    tables = [table for table in report.tables if not table.detail]
    more = [table for table in report.tables if table.detail and table.detail in details]
    parts = [text for part in report.parts if (text := list(_text(part, details, top=False)))]
    if not (top or tables or more or report.facts or report.remarks or parts):
        return
    yield from textwrap.wrap(report.title, WIDTH)
    if top:
        yield from _facts(report)
    for table in tables:
        yield from ["", *_titled(table)] if table.title or top else table.text()
    if not top:
        yield from _facts(report)
    elif tables and report.remarks:
        yield ""
    yield from listed(report.remarks)
    for block in (*map(_titled, more), *parts):
        yield from ("", *block)


def _titled(table: Table) -> list[str]:
    return [*textwrap.wrap(table.title, WIDTH), *table.text()]


def _facts(report: Report) -> Iterator[str]:
    width = 1 + max([_NAME, *(len(name) for name, _ in report.facts)])
    for name, value in report.facts:
        yield textwrap.fill(value, WIDTH, initial_indent=f"{name:<{width}}", subsequent_indent=" " * width)


def plain(value: Any) -> Any:
    """Numbers as JSON can hold them: None where one is not finite, lists for arrays, dictionaries for dataclasses."""
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if value is None or isinstance(value, str | bool | int):
        return value
    if isinstance(value, Mapping):
        return {key: plain(one) for key, one in value.items()}
    if is_dataclass(value):
        return {one.name: plain(getattr(value, one.name)) for one in fields(value)}
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    return [plain(one) for one in value]
