"""Labels of a report: what a page or a picture of it shows in words that are not sentences."""

from matplotlib.figure import Figure
from matplotlib.text import Text


def labels(report, *, names=()):
    """Titles, names of facts, heads and words of tables, captions, keys and texts of figures; without given names."""
    found = {report.title, *(name for name, _ in report.facts)}
    for table in report.tables:
        found |= {table.title, *table.head, *(row[0] for row in table.rows)}
        found |= {cell for row in table.rows for cell in row if cell.startswith("not ")}
    for figure in report.figures:
        found |= {figure.caption, *(name for name, *_ in figure.key)}
        drawn = Figure()
        figure.draw(drawn)
        found |= {text.get_text() for text in drawn.findobj(Text)}
    for part in report.parts:
        found |= labels(part)
    return {label for label in found if label.strip() and label not in names}
