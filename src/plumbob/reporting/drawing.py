"""Figures: as SVG text that stands inside a page, or as a picture in a file of its own.

In a page, no font, no link and no fixed colour is in them. Colours are written as CSS variables, so that one figure
serves a light page, a dark page and paper.
"""

import io
import logging
import re
import textwrap
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import MissingExtraError, ParameterError
from plumbob.core.files import replacing
from plumbob.core.series import needed
from plumbob.core.units import Quantity, given
from plumbob.reporting.content import GRID, INK, LANGUAGES, MUTED, SERIES, SHADE, VARIABLES, said

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

    from plumbob.reporting.content import Figure

PICTURES: Final = (".svg", ".png", ".pdf")  # endings of the names of pictures

_DPI = 200
_WIDTHS: Final = 0.03, 1.0  # least and greatest width of a picture, m
_WIDTH = 7.5  # inches, 540 points: the page shows a point as 1.8 pixels at most
_DASHES: Final[dict[str, Any]] = {"solid": "-", "dashed": "--", "dotted": ":"}
_RAISED: Final = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_ROW = 0.15  # inches of a further row of a key
_TITLE = 0.45  # inches for caption and key of a picture
_BOLD = 0.75  # letters of a caption beside those of a key
_LETTERS = 110  # that fit beside each other in a key, with its samples of lines
_STYLE: Final[dict[str, Any]] = {
    "svg.fonttype": "none", "pdf.fonttype": 42, "font.family": "sans-serif", "font.size": 7.0, "text.color": INK,
    "text.parse_math": False, "axes.edgecolor": MUTED, "axes.labelcolor": INK, "axes.linewidth": 0.5,
    "axes.grid": True, "axes.axisbelow": True, "axes.spines.top": False, "axes.spines.right": False,
    "axes.xmargin": 0.0, "grid.color": GRID, "grid.linewidth": 0.5, "xtick.color": MUTED, "ytick.color": MUTED,
    "xtick.labelcolor": INK, "ytick.labelcolor": INK, "xtick.major.width": 0.5, "ytick.major.width": 0.5,
    "lines.solid_joinstyle": "round", "path.simplify": False,
}  # fmt: skip
CHINESE: Final = (  # fonts that have the letters of Chinese labels, the first one found is taken
    "Noto Sans CJK SC", "Noto Sans SC", "Source Han Sans SC", "Source Han Sans CN", "WenQuanYi Micro Hei",
    "WenQuanYi Zen Hei", "Microsoft YaHei", "SimHei", "PingFang SC", "Hiragino Sans GB", "Heiti SC", "Arial Unicode MS",
)  # fmt: skip


def variable(colour: str) -> str:
    """CSS variable of a colour of this room."""
    return f"var(--{VARIABLES[colour]})"


def svg(figure: "Figure", *, lang: str = "en", salt: str) -> str:
    """``<svg>`` element of a figure; no two of a page share an identifier where each has another `salt`."""
    buffer = io.StringIO()
    with _canvas(figure.height, lang, salt=salt) as canvas:
        figure.draw(canvas)
        _finish(canvas, lang)
        canvas.savefig(buffer, format="svg", transparent=True, metadata={"Date": None})
    return _for_page(buffer.getvalue())


def picture(
    path: str | Path,
    figures: "Sequence[Figure]",
    *,
    lang: str = "en",
    overwrite: bool = False,
    width: float | None = None,
) -> Path:
    """Write figures one below the other on white, each with caption and key; the width is in inches."""
    target = Path(path)
    check.one_of("lang", lang, LANGUAGES)
    kind = picture_kind(target)
    if not figures:
        raise ParameterError(f"{target} would be empty: this report has no figure. Write the page instead.")
    letters = _LETTERS if width is None else round(_LETTERS * width / _WIDTH)
    heights = [figure.height + _TITLE + _ROW * (_key_rows(figure, letters) - 1) for figure in figures]
    with _canvas(sum(heights), lang, embedded=kind != "svg", width=width or _WIDTH) as canvas:
        panels = canvas.subfigures(len(figures), 1, squeeze=False, height_ratios=heights)[:, 0]
        for panel, figure in zip(panels, figures, strict=True):
            _explain(panel, figure, letters)  # first, as what is drawn may look for room
            figure.draw(panel)
            _finish(panel, lang)
        with replacing(target, overwrite=overwrite) as temporary:
            undated = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
            canvas.savefig(temporary, format=kind, dpi=_DPI, facecolor="white", metadata=undated)
    return target


def inches(width: float | str | None) -> float | None:
    """Width of a picture, given in m or as text with its unit; None where none is given."""
    metres = given("width", width, Quantity.LENGTH)
    if metres is not None and not _WIDTHS[0] <= metres <= _WIDTHS[1]:
        raise ParameterError(
            f"the width of a picture must be {1e3 * _WIDTHS[0]:g} to {1e3 * _WIDTHS[1]:g} mm, but it is "
            f"{1e3 * metres:g} mm. Give one in between, as 85mm."
        )
    return metres and metres / 0.0254


def picture_kind(path: Path) -> str:
    """Format of a picture by the ending of its name; ParameterError if it is not among `PICTURES`."""
    if path.suffix.lower() not in PICTURES:
        raise ParameterError(f"the name of a picture must end in {', '.join(PICTURES)}, but it is {path}.")
    return path.suffix.lower()[1:]


@contextmanager
def _canvas(
    height: float, lang: str, *, salt: str = "picture", embedded: bool = False, width: float = _WIDTH
) -> Iterator[Any]:
    """A figure of matplotlib in our style, which holds as long as it is drawn on."""
    mpl = needed("matplotlib", "plots", "plumbob[plot]")
    from matplotlib.figure import Figure as Canvas

    fonts = logging.getLogger("matplotlib.font_manager")
    level = fonts.level
    with mpl.rc_context(), warnings.catch_warnings():
        mpl.rcdefaults()
        params: Any = mpl.rcParams
        params.update({**_STYLE, "svg.hashsalt": salt})
        if lang == "zh":
            params["font.family"] = _chinese_font(embedded)
            warnings.filterwarnings("ignore", "Glyph .* missing from font")  # the reader of an SVG has another font
            fonts.setLevel(logging.ERROR)  # many of these fonts have one weight, which it would tell
        try:
            yield Canvas(figsize=(width, height), layout="constrained")
        finally:
            fonts.setLevel(level)


def _chinese_font(embedded: bool) -> list[str]:
    from matplotlib import font_manager

    installed = set(font_manager.get_font_names())
    fonts = [name for name in CHINESE if name in installed][:1]
    if embedded and not fonts:
        raise MissingExtraError(
            "Chinese labels in a PNG or PDF need a Chinese font, and none is installed. Install one, as "
            "'apt install fonts-noto-cjk' does, or write an .svg or the page."
        )
    return ["DejaVu Sans", *fonts]


def _explain(panel: "FigureBase", figure: "Figure", letters: int) -> None:
    """Caption and key of a figure without a page around it."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Any] = [
        Patch(color=colour, label=name)
        if dash == "block"
        else Line2D([], [], color=colour, linestyle=_DASHES[dash], linewidth=1.2, label=name)
        for name, colour, dash in figure.key
    ]
    caption = textwrap.fill(figure.caption, round(_BOLD * letters))
    panel.suptitle(caption, x=0.01, ha="left", fontsize=8.0, fontweight="bold")
    if handles:
        columns = -(-len(handles) // _key_rows(figure, letters))
        panel.legend(handles=handles, loc="outside lower left", ncols=columns, frameon=False)


def _key_rows(figure: "Figure", letters: int) -> int:
    """Rows of a key in which so many letters fit beside each other."""
    widths = [8 + len(name) for name, *_ in figure.key] or [0]
    return 1 if sum(widths) <= letters else -(-len(widths) // max(1, letters // max(widths)))


def _finish(canvas: "FigureBase", lang: str) -> None:
    """Labels in their language, and aligned."""
    from matplotlib.text import Text

    for text in canvas.findobj(Text) if lang != "en" else ():
        text.set_text(said(text.get_text(), lang))
    canvas.align_ylabels()


def _for_page(svg: str) -> str:
    """Strip what a page does not need: prologue, metadata, group names, needless digits; and free the colours."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->| font-family: [^;]*;", "", svg, flags=re.DOTALL)
    svg = re.sub(r'<g id="[^"]*"', "<g", svg)
    for size in ("width", "height"):
        svg = re.sub(rf'(<svg[^>]*?) {size}="[^"]*"', r"\1", svg, count=1)
    svg = re.sub(r"<[^>]*>", lambda tag: re.sub(r"(\.\d{2})\d+", r"\1", tag[0]), svg)  # labels keep their digits
    for colour, name in VARIABLES.items():
        svg = svg.replace(colour, f"var(--{name})")
    return re.sub(r"\s*\n\s*", "\n", svg).strip()


def envelope(t: Floats, y: Floats, columns: int, *, gap: float = np.inf, jump: float = np.inf) -> tuple[Floats, Floats]:
    """Points (M,) to draw instead of all N, with NaN where the line must break.

    `t` (N,) increases, `y` (N,) is NaN where not known; a series of at most twice as many values as pixel `columns` is
    kept whole. A longer step than `gap` in time breaks the line, and a larger one than `jump` in value: the wrap of an
    angle is not motion.
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
    start, stop = np.array(check.runs(mask), dtype=np.intp).reshape(-1, 2).T
    until = np.append(t[1:], t[-1])[stop - 1]
    length = until - t[start]
    wide = length >= (t[-1] - t[0]) / columns
    return [(float(a), float(n)) for a, n in zip(t[start[wide]], length[wide], strict=True)]


@dataclass(frozen=True, eq=False)
class PlotLine:
    """Values (N,), NaN where not known; a larger step than `gap` in x or `jump` in y breaks the line.

    A `band` has least and greatest values (N,), its colour, and how opaque it is; `size` is that of marks, points.
    """

    x: Floats
    y: Floats
    colour: str = SERIES[0]
    dash: str = "solid"
    width: float = 0.8
    mark: str = ""
    size: float = 2.5
    gap: float = np.inf
    jump: float = np.inf
    alpha: float = 1.0
    band: tuple[Floats, Floats, str, float] | None = None


@dataclass(frozen=True, eq=False)
class PlotPanel:
    """Axes with lines; `xlabel` stands below the last panel, an end of `x` or `y` is as the values are where None.

    `circle` is all that an angle can be, degrees, shown where the values fill more than half of it; `levels` are dashed
    lines across; `pale` stretches of x, start and length, are shaded; `bars` are rows of stretches from and to, each
    with label and colour; of more values than `columns` the least and the greatest of each are drawn; `room` is left
    above and below the values, a share of them.
    """

    label: str
    lines: Sequence[PlotLine] = ()
    xlabel: str = "time [s]"
    log: bool = False
    x: tuple[float | None, float | None] = (None, None)
    y: tuple[float | None, float | None] = (None, None)
    ticks: Sequence[float] = ()
    room: float = 0.05
    circle: tuple[float, float] | None = None
    compass: bool = False
    levels: Sequence[float] = ()
    pale: Sequence[tuple[float, float]] = ()
    bars: Sequence[tuple[str, str, Sequence[tuple[float, float]]]] = ()
    columns: int = 800


def draw_panels(make: Callable[[], Sequence[PlotPanel]], canvas: "FigureBase") -> None:
    """Draw the panels that `make` has, with one axis of x."""
    panels = make()
    axes = canvas.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for ax, panel in zip(axes, panels, strict=True):
        for line in panel.lines:
            _draw_line(ax, line, panel)
        for level in panel.levels:
            ax.axhline(level, color=SERIES[1], linewidth=0.8, linestyle="--")
        _scale(ax, panel)
    axes[-1].set_xlabel(panels[-1].xlabel)


def _draw_line(ax: "Axes", line: PlotLine, panel: PlotPanel) -> None:
    if line.band is not None and line.x.size:
        _draw_band(ax, line, panel)
    finite = np.isfinite(line.y) if np.isfinite(line.gap) else slice(None)
    x = np.log(line.x) if panel.log else line.x
    x, y = envelope(x[finite], line.y[finite], panel.columns, gap=line.gap, jump=line.jump)
    how: Any = {"linestyle": _DASHES[line.dash], "linewidth": line.width, "color": line.colour, "alpha": line.alpha}
    mark = line.mark or ("." if x.size < 3 else "")
    inside = mark != "x"  # outliers stand on the edge
    ax.plot(np.exp(x) if panel.log else x, y, marker=mark, markersize=line.size, clip_on=inside, **how)


def _draw_band(ax: "Axes", line: PlotLine, panel: PlotPanel) -> None:
    """Least and greatest values of each column; nothing across a gap, nor where the line turns over."""
    assert line.band is not None
    low, high, colour, alpha = line.band
    behind = np.flatnonzero(np.diff(line.x) > line.gap) + 1
    places = np.log(line.x) if panel.log else line.x
    edges = np.linspace(places[0], places[-1], panel.columns + 1)[:-1] if places.size > panel.columns else places
    starts = np.union1d(np.searchsorted(places, edges), behind)
    low, high = np.fmin.reduceat(low, starts), np.fmax.reduceat(high, starts)
    turned = np.fmax.reduceat(line.y, starts) - np.fmin.reduceat(line.y, starts) > line.jump
    low[turned] = high[turned] = np.nan
    places = np.searchsorted(starts, behind)
    low, high = (np.insert(edge, places, np.nan) for edge in (low, high))
    x = np.insert(line.x[starts], places, line.x[behind - 1])
    ax.fill_between(x, low, high, color=colour, alpha=alpha, linewidth=0.0, step=None if panel.log else "post")


def _scale(ax: "Axes", panel: PlotPanel) -> None:
    """Ends and ticks of the axes, and what stands along them."""
    from matplotlib.ticker import LogLocator

    scale: Any = "log" if panel.log else "linear"
    ax.set(xscale=scale, yscale=scale, ylabel=panel.label, ymargin=panel.room)
    ax.set(xlim=panel.x, ylim=panel.y)
    (low, high), (first, last) = ax.get_ylim(), panel.circle or (-np.inf, np.inf)
    if panel.bars:
        ax.set(yticks=range(len(panel.bars)), yticklabels=[label for label, *_ in panel.bars])
        ax.set_ylim(len(panel.bars) - 0.5, -0.5)
    elif 2.0 * (high - low) > last - first:
        ax.set(ylim=(min(low, first), max(high, last)), yticks=np.linspace(first, last, 5))
    elif panel.ticks:
        ax.set_yticks(panel.ticks)
    elif panel.log and high < 300.0 * low:  # few powers of ten: their multiples too
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=99))
    if panel.compass:
        ax.yaxis.set_major_formatter(lambda value, _: f"{value % 360.0:g}")
    ax.yaxis.label.set_fontsize(6.0 if panel.log else 7.0)  # units of densities are long
    for axis in (ax.xaxis, ax.yaxis) if panel.log else ():
        axis.set_major_formatter(lambda value, _: _power(value))
        axis.set_minor_formatter(lambda value, _: "")  # of a narrow range matplotlib writes formulas there
    for place, (_, colour, stretches) in enumerate(panel.bars):
        ax.broken_barh([(a, b - a) for a, b in stretches], (place - 0.35, 0.7), facecolors=colour, linewidth=0)
    across = ax.get_xaxis_transform()
    ax.broken_barh(panel.pale, (0.0, 1.0), transform=across, facecolors=SHADE, linewidth=0, zorder=0)


def _power(value: float) -> str:
    """Power of ten as a mark of an axis."""
    exponent = int(np.floor(np.log10(value) + 1e-9)) if value > 0.0 else 0
    times = "" if (digit := f"{value / 10.0**exponent:g}") == "1" else f"{digit}·"
    return f"{value:g}" if -2 <= exponent <= 4 else f"{times}10{str(exponent).translate(_RAISED)}"
