"""Values as lines in panels below each other: said as data, and drawn in one way."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.reporting.style import SERIES, SHADE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

_DASHES: Final[dict[str, Any]] = {"solid": "-", "dashed": "--", "dotted": ":"}
_RAISED: Final = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True, eq=False)
class PlotLine:
    """Values (N,), NaN where not known; a larger step than `gap` in x or `jump` in y breaks the line.

    A `band` has least and greatest values (N,), its colour, and how opaque it is.
    """

    x: Floats
    y: Floats
    colour: str = SERIES[0]
    dash: str = "solid"
    width: float = 0.8
    mark: str = ""
    gap: float = np.inf
    jump: float = np.inf
    band: tuple[Floats, Floats, str, float] | None = None


@dataclass(frozen=True, eq=False)
class PlotPanel:
    """Axes with lines; `xlabel` stands below the last panel, an end of `x` or `y` is as the values are where None.

    `circle` is all that an angle can be, degrees, shown where the values fill more than half of it; `levels` are dashed
    lines across; `pale` stretches of x, start and length, are shaded; `bars` are rows of stretches from and to, each
    with label and colour; of more values than `columns` the least and the greatest of each are drawn.
    """

    label: str
    lines: Sequence[PlotLine] = ()
    xlabel: str = "time [s]"
    log: bool = False
    x: tuple[float | None, float | None] = (None, None)
    y: tuple[float | None, float | None] = (None, None)
    ticks: Sequence[float] = ()
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
            _draw_line(ax, line, panel.columns)
        for level in panel.levels:
            ax.axhline(level, color=SERIES[1], linewidth=0.8, linestyle="--")
        _scale(ax, panel)
    axes[-1].set_xlabel(panels[-1].xlabel)


def _draw_line(ax: "Axes", line: PlotLine, columns: int) -> None:
    from plumbob.reporting.drawing import envelope

    if line.band is not None and line.x.size:
        _draw_band(ax, line, columns)
    finite = np.isfinite(line.y) if np.isfinite(line.gap) else slice(None)
    x, y = envelope(line.x[finite], line.y[finite], columns, gap=line.gap, jump=line.jump)
    mark = line.mark or ("." if x.size < 3 else "")
    ax.plot(x, y, color=line.colour, linestyle=_DASHES[line.dash], linewidth=line.width, marker=mark, markersize=2.5)


def _draw_band(ax: "Axes", line: PlotLine, columns: int) -> None:
    """Least and greatest values of each column; nothing across a gap, nor where the line turns over."""
    assert line.band is not None
    low, high, colour, alpha = line.band
    behind = np.flatnonzero(np.diff(line.x) > line.gap) + 1
    starts = np.union1d(np.arange(0, line.x.size, -(-line.x.size // columns)), behind)
    low, high = np.fmin.reduceat(low, starts), np.fmax.reduceat(high, starts)
    turned = np.fmax.reduceat(line.y, starts) - np.fmin.reduceat(line.y, starts) > line.jump
    low[turned] = high[turned] = np.nan
    places = np.searchsorted(starts, behind)
    low, high = (np.insert(edge, places, np.nan) for edge in (low, high))
    x = np.insert(line.x[starts], places, line.x[behind - 1])
    ax.fill_between(x, low, high, color=colour, alpha=alpha, linewidth=0.0, step="post")


def _scale(ax: "Axes", panel: PlotPanel) -> None:
    """Ends and ticks of the axes, and what stands along them."""
    scale: Any = "log" if panel.log else "linear"
    ax.set(xscale=scale, yscale=scale, ylabel=panel.label, xlim=panel.x, ylim=panel.y)
    (low, high), (first, last) = ax.get_ylim(), panel.circle or (-np.inf, np.inf)
    if panel.bars:
        ax.set(yticks=range(len(panel.bars)), yticklabels=[label for label, *_ in panel.bars])
        ax.set_ylim(len(panel.bars) - 0.5, -0.5)
    elif 2.0 * (high - low) > last - first:
        ax.set(ylim=(min(low, first), max(high, last)), yticks=np.linspace(first, last, 5))
    elif panel.ticks:
        ax.set_yticks(panel.ticks)
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
    exponent = round(np.log10(value)) if value > 0.0 else 0
    return f"{value:g}" if -2 <= exponent <= 3 else f"10{str(exponent).translate(_RAISED)}"
