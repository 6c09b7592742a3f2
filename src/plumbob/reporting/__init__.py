"""One Report for every subject: facts, tables, remarks and figures; as text, as JSON, as a page and as a picture."""

from plumbob.reporting.report import Figure, Report, Reported, Table, plain
from plumbob.reporting.style import GRID, INK, LANGUAGES, MUTED, PALETTE, SERIES, SHADE, SOFT

__all__ = [
    "GRID", "INK", "LANGUAGES", "MUTED", "PALETTE", "SERIES", "SHADE", "SOFT", "Figure", "Report", "Reported", "Table",
    "plain",
]  # fmt: skip
