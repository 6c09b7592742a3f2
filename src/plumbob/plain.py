"""Plain text for a terminal: tables, remarks, names with their values."""

import textwrap
from collections.abc import Iterable, Sequence

WIDTH = 80
_LABEL, _CELL, _NAME = 26, 17, 12


def aligned(*lines: Sequence[str]) -> list[str]:
    """Lines of a table whose columns are as wide as their longest cell, and usually fill `WIDTH`."""
    width = max(_CELL, *(len(cell) for _, *cells in lines for cell in cells))
    return [(f"{label:<{_LABEL}}" + "".join(f" {cell:>{width}}" for cell in cells)).rstrip() for label, *cells in lines]


def listed(remarks: Iterable[str]) -> list[str]:
    """Remarks, each with a dash, broken at `WIDTH`."""
    return [line for r in remarks for line in textwrap.wrap(r, WIDTH, initial_indent="- ", subsequent_indent="  ")]


def pair(name: str, value: str) -> str:
    """Name and value, which goes on below itself at `WIDTH`."""
    return textwrap.fill(value, WIDTH, initial_indent=f"{name:<{_NAME}}", subsequent_indent=" " * _NAME)
