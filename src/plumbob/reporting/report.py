"""What a report is, and how it is written as text; pages and pictures are written by the files beside."""

import textwrap
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from plumbob.core.findings import Note
from plumbob.core.text import WIDTH, listed
from plumbob.reporting.content import Figure, Scene, Table

_NAME = 11  # letters of the name of a fact, at least


@dataclass(frozen=True)
class Report:
    """What is to be said about something, in the order in which it is read."""

    title: str  # a noun
    facts: Sequence[tuple[str, str]] = ()  # names and values; a name may come again
    tables: Sequence[Table] = ()  # the numbers
    remarks: Sequence[Note] = ()  # what a reader must know, each a sentence
    # drawn only where they are shown; a function is called only there
    figures: Sequence[Figure] | Callable[[], Sequence[Figure]] = ()
    parts: "Sequence[Report]" = ()  # one for each subject in it
    definitions: Sequence[Note] = ()  # what the words and signs mean, for the foot of a page
    scenes: Sequence[Scene] = ()  # bodies that move, on a page only
    links: Sequence[tuple[str, str]] = ()  # names and addresses of pages beside this one, on a page only
    # gives further tables with a `detail`; called only where they are shown
    details: Callable[[], Sequence[Table]] | None = None

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

    def plot(
        self, path: str | Path, *, lang: str = "en", overwrite: bool = False, width: float | str | None = None
    ) -> Path:
        """Write its own figures, or those of its parts where it has none, as SVG, PNG or PDF by the name's ending.

        The width is in m, or text with its unit.
        """
        from plumbob.reporting.drawing import inches, picture

        return picture(path, first_figures(self), lang=lang, overwrite=overwrite, width=inches(width))

    def write_pdf(self, path: str | Path, *, lang: str = "en", overwrite: bool = False) -> Path:
        """Write the page as a PDF; MissingExtraError where neither Chromium nor Chrome, which print it, is there."""
        from plumbob.reporting.page import print_pdf

        return print_pdf(self.page(lang=lang), Path(path), overwrite=overwrite)

    @property
    def all_tables(self) -> Sequence[Table]:
        """The tables, and the details."""
        return self.tables if self.details is None else [*self.tables, *self.details()]

    @property
    def drawings(self) -> Sequence[Figure]:
        """The figures."""
        return self.figures() if callable(self.figures) else self.figures

    @property
    def moves(self) -> bool:
        """Whether it has a scene, also in a part."""
        return bool(self.scenes) or any(part.moves for part in self.parts)


def first_figures(report: Report) -> list[Figure]:
    """Own figures, or those of the parts where there are none."""
    if (figures := report.drawings) or not report.parts:
        return list(figures)
    return [
        replace(figure, caption=f"{part.title}: {figure.caption}")
        for part in report.parts
        for figure in first_figures(part)
    ]


def _text(report: Report, details: Collection[str], *, top: bool) -> Iterator[str]:
    tables = [table for table in report.tables if not table.detail]
    more = [table for table in report.all_tables if table.detail in details] if details else []
    parts = [text for part in report.parts if (text := list(_text(part, details, top=False)))]
    if not (top or tables or more or report.facts or report.remarks or parts):
        return
    width = 1 + max([_NAME, *(len(name) for name, _ in report.facts)])
    wrap = partial(textwrap.fill, width=WIDTH, subsequent_indent=" " * width)
    facts = [wrap(value, initial_indent=f"{name:<{width}}") for name, value in report.facts]
    yield from textwrap.wrap(report.title, WIDTH)
    if top:
        yield from facts
    for table in tables:
        yield from ["", *table.text()] if table.title or top else table.text()
    if not top:
        yield from facts
    elif tables and report.remarks:
        yield ""
    yield from listed(map(str, report.remarks))
    for block in (*(table.text() for table in more), *parts):
        yield from ("", *block)
