"""Figures of an evaluation as SVG text to stand inside a page: no font, no link and no fixed colour is in them.

Colours are written as CSS variables, so that one figure serves a light page, a dark page and paper. Names of devices
and filters never enter a figure; the page writes them, escaped.
"""

import io
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from plumbob import clock
from plumbob.check import Floats
from plumbob.errors import MissingExtraError
from plumbob.evaluate.envelope import envelope, runs
from plumbob.evaluate.metrics import NEEDS_HEADING
from plumbob.evaluate.statistics import Stats
from plumbob.rotations import euler_zyx_from_quat
from plumbob.units import to_deg

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from plumbob.evaluate.evaluation import Evaluation

# After Okabe and Ito, told apart by colour-blind readers; the names are CSS variables of the page.
PALETTE = {
    "#0072b2": "blue",
    "#d55e00": "red",
    "#009e73": "green",
    "#cc79a7": "pink",
    "#e69f00": "amber",
    "#56b4e9": "sky",
    "#8a6d00": "olive",
}
INK, MUTED, GRID, SHADE = "#1b1f24", "#5b6570", "#d8dde2", "#e9edf1"
_VARIABLES = {**PALETTE, INK: "ink", MUTED: "muted", GRID: "grid", SHADE: "shade", "#aab4be": "soft"}
SERIES = tuple(PALETTE)
DASHES = ("solid", "dashed", "dotted")
ESTIMATE, REFERENCE = "#0072b2", "#aab4be"
COLOUR = {"total": "#0072b2", "heading": "#d55e00", "inclination": "#009e73"}

_WIDTH = 7.5  # inches, 540 points: the page shows a point as 1.8 pixels at most
_QUANTILES = np.linspace(0.0, 100.0, 401)
_STYLE: dict[str, Any] = {
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


def attitude_figure(e: "Evaluation", columns: int, salt: str) -> str:
    """Yaw, pitch and roll of estimate and reference over time."""
    est, ref = euler_zyx_from_quat(e.estimate.q_nb), euler_zyx_from_quat(e.match.q_ref)

    def draw(figure: "Figure") -> None:
        axes = figure.subplots(3, 1, sharex=True)
        for i, name in enumerate(("yaw", "pitch", "roll")):
            _line(axes[i], e, ref[:, i], columns, color=REFERENCE, linewidth=2.4, jump=np.pi)
            _line(axes[i], e, est[:, i], columns, color=ESTIMATE, linewidth=0.7, jump=np.pi)
            _round_degrees(axes[i], 90 if name == "pitch" else 180)
            _shade(axes[i], e, columns)
            axes[i].set_ylabel(f"{name} [°]")
        axes[2].set_xlabel("time [s]")

    return _svg(draw, height=3.9, salt=f"attitude {salt}")


def error_figure(e: "Evaluation", columns: int, salt: str) -> str:
    """Total, heading and inclination error over time; a figure of those that are scored."""
    names = [name for name in COLOUR if name in e.stats]

    def draw(figure: "Figure") -> None:
        axes = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
        for ax, name in zip(axes, names, strict=True):
            _line(ax, e, e.errors[name], columns, color=COLOUR[name], linewidth=0.7)
            _shade(ax, e, columns)
            ax.set_ylim(bottom=0.0)
            ax.set_ylabel(f"{name} [°]")
        axes[-1].set_xlabel("time [s]")

    return _svg(draw, height=0.6 + 1.1 * len(names), salt=f"error {salt}")


def distribution_figure(e: "Evaluation", salt: str) -> str:
    """Share of samples whose error is at most so much, with the median and the 95th and 99th percentile."""
    values = {name: e.errors[name][e.match.scored] for name in COLOUR if name in e.stats}

    def draw(figure: "Figure") -> None:
        ax = figure.subplots()
        for name, error in values.items():
            _cumulative(ax, error, color=COLOUR[name], linestyle="solid")
            s = e.stats[name]
            marks = [to_deg(p) for p in (s.p50, s.p95, s.p99)]
            ax.plot(marks, (50, 95, 99), "o", color=COLOUR[name], markersize=3.0, clip_on=False)
        _finish_cumulative(ax, [e.stats[name] for name in values])

    return _svg(draw, height=2.4, salt=f"distribution {salt}")


def comparison_figure(evaluations: Mapping[str, "Evaluation"], name: str) -> str:
    """Distribution of one quantity for several evaluations, in the order of `key_style`."""

    def draw(figure: "Figure") -> None:
        ax = figure.subplots()
        for i, e in enumerate(evaluations.values()):
            colour, dash = key_style(i)
            _cumulative(ax, e.errors[name][e.match.scored], color=colour, linestyle=dash)
        _finish_cumulative(ax, [e.stats[name] for e in evaluations.values()])

    return _svg(draw, height=2.4, salt="comparison")


def key_style(i: int) -> tuple[str, str]:
    """Colour and dash of the i-th of several lines."""
    return SERIES[i % len(SERIES)], DASHES[(i // len(SERIES)) % len(DASHES)]


def variable(colour: str) -> str:
    """CSS variable of a colour of this module."""
    return f"var(--{_VARIABLES[colour]})"


def shared_quantity(evaluations: Sequence["Evaluation"]) -> str:
    """The one quantity by which all of them can be compared: total, or inclination where a heading is free."""
    return "inclination" if any(NEEDS_HEADING[0] not in e.stats for e in evaluations) else NEEDS_HEADING[0]


def _line(ax: "Axes", e: "Evaluation", values: Floats, columns: int, *, jump: float = np.inf, **style: Any) -> None:
    gap = clock.GAP_FACTOR * float(np.median(np.diff(e.t))) if e.t.size > 1 else np.inf
    t, y = envelope(e.t, values, columns, gap=gap, jump=jump)
    marker = "." if t.size < 3 else ""
    ax.plot(t, to_deg(y), marker=marker, **style)


def _shade(ax: "Axes", e: "Evaluation", columns: int) -> None:
    if e.t.size < 2:
        return
    ax.set_xlim(e.t[0], e.t[-1])
    stretches = runs(e.t, ~e.match.scored, columns)
    ax.broken_barh(stretches, (0.0, 1.0), transform=ax.get_xaxis_transform(), facecolors=SHADE, linewidth=0, zorder=0)


def _round_degrees(ax: "Axes", limit: int) -> None:
    """Round ticks and the whole range on an axis that shows more than half of what the angle can be."""
    low, high = ax.get_ylim()
    if high - low > limit:
        ax.set_ylim(min(low, -limit), max(high, limit))
        ax.set_yticks((-limit, -limit // 2, 0, limit // 2, limit))


def _cumulative(ax: "Axes", error: Floats, *, color: str, linestyle: str) -> None:
    known = np.abs(error[np.isfinite(error)])
    ax.plot(to_deg(np.percentile(known, _QUANTILES)), _QUANTILES, color=color, linestyle=linestyle, linewidth=1.1)


def _finish_cumulative(ax: "Axes", stats: Sequence[Stats]) -> None:
    """Axes up to the worst 99th percentile and a quarter; the tail beyond is in the table."""
    ax.set_ylim(0.0, 100.0)
    ax.set_yticks((0, 25, 50, 75, 95))
    ax.set_xlim(0.0, max(to_deg(max(min(s.max_abs, 1.25 * s.p99) for s in stats)), 1e-9))
    ax.set_xlabel("error at most [°]")
    ax.set_ylabel("scored samples [%]")


def _svg(draw: Any, *, height: float, salt: str) -> str:
    """Run a drawing function on a new figure and return its ``<svg>`` element."""
    try:
        import matplotlib as mpl
        from matplotlib.backends.backend_svg import FigureCanvasSVG
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError('plots need matplotlib: pip install "plumbob[plot]".') from error
    with mpl.rc_context():
        mpl.rcdefaults()
        params: Any = mpl.rcParams
        params.update({**_STYLE, "svg.hashsalt": salt})
        figure = Figure(figsize=(_WIDTH, height), layout="constrained")
        FigureCanvasSVG(figure)
        draw(figure)
        figure.align_ylabels()
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None})
    return _for_page(buffer.getvalue())


def _for_page(svg: str) -> str:
    """Strip what a page does not need: prologue, metadata, group names, needless digits; and free the colours."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r"<!--.*?-->", "", svg, flags=re.DOTALL)
    svg = re.sub(r'<g id="[^"]*"', "<g", svg)
    svg = re.sub(r" font-family: [^;]*;", "", svg)
    svg = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", svg, count=1)
    svg = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", svg, count=1)
    svg = re.sub(r"(\.\d{2})\d+", r"\1", svg)
    for colour, name in _VARIABLES.items():
        svg = svg.replace(colour, f"var(--{name})")
    return re.sub(r"\s*\n\s*", "\n", svg).strip()
