"""One page: a self-contained HTML file with figures that opens anywhere, without network and without scripts."""

from plumbob.page.document import Key, Rows, definitions_list, document, figure, swatch
from plumbob.page.drawing import png, svg
from plumbob.page.envelope import envelope, runs
from plumbob.page.palette import DASHES, GRID, INK, MUTED, PALETTE, SERIES, SHADE, SOFT, variable
from plumbob.page.table import LABELS, html_table

__all__ = [
    "DASHES",
    "GRID",
    "INK",
    "LABELS",
    "MUTED",
    "PALETTE",
    "SERIES",
    "SHADE",
    "SOFT",
    "Key",
    "Rows",
    "definitions_list",
    "document",
    "envelope",
    "figure",
    "html_table",
    "png",
    "runs",
    "svg",
    "swatch",
    "variable",
]
