"""Figures of an evaluation; names of devices and filters never enter them, the page writes these, escaped."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from plumbob import clock
from plumbob.check import Floats
from plumbob.evaluate.metrics import NEEDS_HEADING
from plumbob.evaluate.statistics import Stats
from plumbob.page import DASHES, SERIES, SHADE, SOFT, envelope, runs, svg
from plumbob.rotations import euler_zyx_from_quat
from plumbob.units import to_deg

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from plumbob.evaluate.evaluation import Evaluation

ESTIMATE, REFERENCE = SERIES[0], SOFT
COLOUR = dict(zip(("total", "heading", "inclination"), SERIES, strict=False))

_QUANTILES = np.linspace(0.0, 100.0, 401)


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

    return svg(draw, height=3.9, salt=f"attitude {salt}")


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

    return svg(draw, height=0.6 + 1.1 * len(names), salt=f"error {salt}")


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

    return svg(draw, height=2.4, salt=f"distribution {salt}")


def comparison_figure(evaluations: Mapping[str, "Evaluation"], name: str) -> str:
    """Distribution of one quantity for several evaluations, in the order of `key_style`."""

    def draw(figure: "Figure") -> None:
        ax = figure.subplots()
        for i, e in enumerate(evaluations.values()):
            colour, dash = key_style(i)
            _cumulative(ax, e.errors[name][e.match.scored], color=colour, linestyle=dash)
        _finish_cumulative(ax, [e.stats[name] for e in evaluations.values()])

    return svg(draw, height=2.4, salt="comparison")


def key_style(i: int) -> tuple[str, str]:
    """Colour and dash of the i-th of several lines."""
    return SERIES[i % len(SERIES)], DASHES[(i // len(SERIES)) % len(DASHES)]


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
