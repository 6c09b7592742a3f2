"""One Report for every subject: facts, tables, remarks and figures; as text, as JSON, as a page and as a picture."""

from plumbob.report.report import (
    GRID,
    INK,
    LANGUAGES,
    MUTED,
    PALETTE,
    SERIES,
    SHADE,
    SOFT,
    Figure,
    Report,
    Reported,
    Table,
    plain,
)

__all__ = [
    "GRID",
    "INK",
    "LANGUAGES",
    "MUTED",
    "PALETTE",
    "SERIES",
    "SHADE",
    "SOFT",
    "Figure",
    "Report",
    "Reported",
    "Table",
    "plain",
]
