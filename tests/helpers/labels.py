"""Labels of a report: what a page or a picture of it shows in words that are not sentences; and all its texts."""

from dataclasses import fields, is_dataclass

from matplotlib.figure import Figure
from matplotlib.text import Text

from plumbob.reporting.content import Both

SILENT = {"dash", "links", "lines", "trail", "unit", "points", "shadow"}
"""Fields of a report's parts that no reader sees as words."""


def labels(report, *, names=()):
    """Titles, names of facts, heads and words of tables, captions, keys and texts of figures; without given names."""
    found = {report.title, *(name for name, _ in report.facts)}
    for table in report.all_tables:
        found |= {table.title, *table.head, *(row[0] for row in table.rows)}
        found |= {cell for row in table.rows for cell in row if cell.startswith("not ")}
    for figure in report.drawings:
        found |= {figure.caption, *(name for name, *_ in figure.key)}
        drawn = Figure()
        figure.draw(drawn)
        found |= {text.get_text() for text in drawn.findobj(Text)}
    for part in report.parts:
        found |= labels(part)
    return {label for label in found if label.strip() and label not in names}


def texts(thing):
    """Every text of a report, sentences and cells too, with those of its figures' keys."""
    if isinstance(thing, str):
        yield thing
    elif isinstance(thing, dict):
        yield from (one for one in thing if isinstance(one, Both))
    elif isinstance(thing, (list, tuple)):
        for one in thing:
            yield from texts(one)
    elif is_dataclass(thing):
        for name in (f.name for f in fields(thing) if f.name not in SILENT):
            value = getattr(thing, name)
            yield from texts([said for said, *_ in value] if name == "key" else value)  # of lines: colours, styles
