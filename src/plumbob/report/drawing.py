"""Figures as SVG text to stand inside a page: no font, no link and no fixed colour is in them.

Colours are written as CSS variables, so that one figure serves a light page, a dark page and paper.
"""

import io
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import MissingExtraError
from plumbob.core.files import replacing
from plumbob.report.document import GRID, INK, MUTED, VARIABLES

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
        Distinguished from that of every other figure of the page, so that no two share an identifier.
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


def envelope(t: Floats, y: Floats, columns: int, *, gap: float = np.inf, jump: float = np.inf) -> tuple[Floats, Floats]:
    """Points (M,) to draw instead of all N, with NaN where the line must break.

    Parameters
    ----------
    t : ndarray (N,)
        Increasing times.
    y : ndarray (N,)
        Values; NaN where not known.
    columns : int
        Pixel columns of the plot; a series of at most twice as many values is kept whole.
    gap : float
        A longer step in time breaks the line.
    jump : float
        A larger step in value breaks the line: the wrap of an angle is not motion.
    """
    rows = np.flatnonzero(np.isfinite(y))
    if not rows.size:
        return np.empty(0), np.empty(0)
    t, y = t[rows], y[rows]
    begins = np.zeros(rows.size, dtype=bool)
    begins[1:] = (np.diff(rows) > 1) | (np.diff(t) > gap) | (np.abs(np.diff(y)) > jump)
    if rows.size <= 2 * columns:
        return _with_breaks(t, y, begins)
    width = (t[-1] - t[0]) / columns
    if np.count_nonzero(begins) > columns:  # more holes than pixels: only those that can be seen break the line
        begins[1:] &= np.diff(t) > width
    keep, first = _extremes(np.minimum(np.floor((t - t[0]) / width), columns - 1.0), y, begins)
    return _with_breaks(t[keep], y[keep], first)


def _extremes(column: Floats, y: Floats, begins: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Rows of the least and greatest value of each run in one column, in order of time, and which begin a line."""
    opens = begins.copy()
    opens[1:] |= np.diff(column) > 0.0
    opens[0] = True
    group = np.cumsum(opens) - 1
    by_value = np.lexsort((y, group))
    starts = np.flatnonzero(opens)
    ends = np.append(starts[1:], y.size) - 1
    pairs = np.sort(np.stack((by_value[starts], by_value[ends]), axis=1), axis=1)
    fresh = np.zeros_like(pairs, dtype=bool)
    fresh[:, 0] = begins[starts]
    single = pairs[:, 0] == pairs[:, 1]
    use = np.stack((np.ones_like(single), ~single), axis=1)
    return pairs[use], fresh[use]


def _with_breaks(t: Floats, y: Floats, begins: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    places = np.flatnonzero(begins)
    return np.insert(t, places, t[places]), np.insert(y, places, np.nan)


def runs(t: Floats, mask: NDArray[np.bool_], columns: int) -> list[tuple[float, float]]:
    """Stretches (start, length) of time over which the mask (N,) holds; those narrower than a column are left out.

    A stretch ends where the next sample begins, so that neighbours meet.
    """
    edges = np.diff(np.concatenate(([0], mask.astype(np.int8), [0])))
    start, stop = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    until = np.append(t[1:], t[-1])[stop - 1]
    length = until - t[start]
    wide = length >= (t[-1] - t[0]) / columns
    return [(float(a), float(n)) for a, n in zip(t[start[wide]], length[wide], strict=True)]
