"""Plain text for a terminal: tables, remarks, names with their values."""

import re
import textwrap
from collections.abc import Iterable, Sequence

WIDTH = 80
_STEERING = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069]")
_LABEL, _CELL, _NAME = 26, 17, 12


def visible(text: str, keep: str = "") -> str:
    """Text of a file as it may be shown: what would steer a terminal, or turn the reading, is written as an escape.

    Parameters
    ----------
    text : str
        The text.
    keep : str
        Control characters that stay, as line breaks where the text has several lines.
    """
    if text.isprintable():
        return text
    return _STEERING.sub(lambda c: c[0] if c[0] in keep else c[0].encode("unicode_escape").decode("ascii"), text)


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
