"""Figures as SVG text to stand inside a page: no font, no link and no fixed colour is in them.

Colours are written as CSS variables, so that one figure serves a light page, a dark page and paper.
"""

import io
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from plumbob._files import replacing
from plumbob.errors import MissingExtraError
from plumbob.page.palette import GRID, INK, MUTED, VARIABLES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Draw = Callable[["Figure"], None]

_DPI = 200
_WIDTH = 7.5  # inches, 540 points: the page shows a point as 1.8 pixels at most
_STYLE: Final[dict[str, Any]] = {
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 7.0,
    "text.color": INK,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.5,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.xmargin": 0.0,
    "grid.color": GRID,
    "grid.linewidth": 0.5,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.major.width": 0.5,
    "ytick.major.width": 0.5,
    "lines.solid_joinstyle": "round",
    "path.simplify": False,
}


def svg(draw: Draw, *, height: float, salt: str) -> str:
    """Run a drawing function on a new figure and return its ``<svg>`` element.

    Parameters
    ----------
    draw : callable
        Draws on the matplotlib figure that it gets.
    height : float
        Inches.
    salt : str
        Told apart from that of every other figure of the page, so that no two share an identifier.
    """
    buffer = io.StringIO()
    _save(draw, height, buffer, format="svg", transparent=True, metadata={"Date": None}, salt=salt)
    return _for_page(buffer.getvalue())


def png(path: Path, draw: Draw, *, height: float, overwrite: bool = False) -> None:
    """Run a drawing function on a new figure and write it as a picture on white."""
    with replacing(path, overwrite=overwrite) as temporary:
        _save(draw, height, temporary, format="png", dpi=_DPI, facecolor="white")


def _save(draw: Draw, height: float, target: Any, *, salt: str | None = None, **options: Any) -> None:
    try:
        import matplotlib as mpl
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError('plots need matplotlib: pip install "plumbob[plot]".') from error
    with mpl.rc_context():
        mpl.rcdefaults()
        params: Any = mpl.rcParams
        params.update({**_STYLE, "svg.hashsalt": salt})
        figure = Figure(figsize=(_WIDTH, height), layout="constrained")
        draw(figure)
        figure.align_ylabels()
        figure.savefig(target, **options)


def _for_page(svg: str) -> str:
    """Strip what a page does not need: prologue, metadata, group names, needless digits; and free the colours."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r"<!--.*?-->", "", svg, flags=re.DOTALL)
    svg = re.sub(r'<g id="[^"]*"', "<g", svg)
    svg = re.sub(r" font-family: [^;]*;", "", svg)
    svg = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", svg, count=1)
    svg = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", svg, count=1)
    svg = re.sub(r"<[^>]*>", lambda tag: re.sub(r"(\.\d{2})\d+", r"\1", tag[0]), svg)  # labels keep their digits
    for colour, name in VARIABLES.items():
        svg = svg.replace(colour, f"var(--{name})")
    return re.sub(r"\s*\n\s*", "\n", svg).strip()
