"""Colours of a report: each is a CSS variable of the page, so that it serves light, dark and paper."""

from typing import Final

# After Okabe and Ito, told apart by colour-blind readers; the names are CSS variables of the page.
PALETTE: Final = {
    "#0072b2": "blue",
    "#d55e00": "red",
    "#009e73": "green",
    "#cc79a7": "pink",
    "#e69f00": "amber",
    "#56b4e9": "sky",
    "#8a6d00": "olive",
}
INK, MUTED, GRID, SHADE, SOFT = "#1b1f24", "#5b6570", "#d8dde2", "#e9edf1", "#aab4be"
VARIABLES: Final = {**PALETTE, INK: "ink", MUTED: "muted", GRID: "grid", SHADE: "shade", SOFT: "soft"}
SERIES: Final = tuple(PALETTE)
DASHES: Final = ("solid", "dashed", "dotted")


def variable(colour: str) -> str:
    """CSS variable of a colour of this module."""
    return f"var(--{VARIABLES[colour]})"
