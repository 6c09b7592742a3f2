"""Figures 1 to 5 of the trackball paper, drawn again, and those that it lacks: lag and angle, fits, and the ball."""

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.units import deg, to_deg, to_dps
from plumbob.noise.terms import TERMS
from plumbob.papers.description import TRACKBALL
from plumbob.papers.trackball.recorded import Lapped, Rest, Turned
from plumbob.papers.trackball.records import AT_REST, RATIOS, SAMPLES, STEP
from plumbob.papers.trackball.seeds import TAUS, PowerFits, Short, degrees_of_freedom, powers
from plumbob.reporting.content import Figure
from plumbob.reporting.style import GRID, INK, MUTED, SERIES, SOFT, Both

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import FigureBase

BLUE, RED, GREEN, PINK, AMBER, SKY, OLIVE = SERIES
BEFORE: Final = TRACKBALL.text("before_the_filter")
_TIME: Final = "time [s]"
_RATE: Final = TRACKBALL.text("rate_s")
_ERROR: Final = TRACKBALL.text("error_s")
_TAU: Final = TRACKBALL.text("averaging_time_s")
_VIEW: Final = np.array([0.55, 0.75, 0.36]) / np.linalg.norm([0.55, 0.75, 0.36])


def rest_figures(rest: Rest) -> list[Figure]:
    """Figures 1 and 2: the random sequence of x before and after the filter."""
    return [
        TRACKBALL.figure("figure_1", partial(_draw_series, rest.t, {BLUE: rest.before[:, 0]})),
        TRACKBALL.figure(
            "figure_2", partial(_draw_series, rest.t, {GREEN: rest.best[:, 0], RED: rest.after[:, 0]}), at_rest=AT_REST
        ),
    ]


def allan_figure(rest: Rest, short: Short) -> Figure:
    """Figure 3: deviations at the eight averaging times before and after, with intervals, and mean ratios."""
    key = [
        (BEFORE, BLUE, "solid"),
        (TRACKBALL.text("after_q_r", at_rest=AT_REST), RED, "dashed"),
        *((f"Q/R = {q:g}", colour, "solid") for q, colour in zip(RATIOS, _RATIO_COLOURS, strict=True)),
    ]
    return TRACKBALL.figure("figure_3", partial(_draw_allan, rest, short), lines=key)


_RATIO_COLOURS: Final = (SKY, AMBER, RED, PINK, OLIVE)


def fit_figure(fit: PowerFits) -> Figure:
    """Fits of the five powers to the Allan variances of the record: the plain one, and the one that weighs."""
    return TRACKBALL.figure("14_fits_of", partial(_draw_fit, fit))


def turn_figures(turned: Turned) -> list[Figure]:
    """Figures 4 and 5: the rate while the table speeds up and while it holds, before and after compensation."""
    parts = {"figure_4": slice(0, SAMPLES), "figure_5": slice(SAMPLES, 2 * SAMPLES)}
    return [TRACKBALL.figure(key, partial(_draw_turn, turned, part)) for key, part in parts.items()]


def lag_figure(turned: Turned) -> Figure:
    """Lag of the rate, and what it does to the heading."""
    return TRACKBALL.figure("lag_of_the", partial(_draw_lag, turned))


BALLS: Final[Mapping[str, Both]] = TRACKBALL.texts("balls")
"""Tracks that are drawn."""


def ball_figure(lapped: Lapped) -> Figure:
    """Track of the touching point on the ball, seen from one side: true, measured, by the paper, and best."""
    return TRACKBALL.figure("track_of_the", partial(_draw_balls, lapped))


def _draw_series(t: Floats, lines: Mapping[str, Floats], canvas: "FigureBase") -> None:
    ax = canvas.subplots()
    for colour, rate in lines.items():
        ax.plot(t, to_dps(rate), color=colour, linewidth=0.8)


def _draw_allan(rest: Rest, short: Short, canvas: "FigureBase") -> None:
    adev_ax, ratio_ax = canvas.subplots(1, 2)
    tau = np.array(TAUS)
    for curve, colour, dash in ((rest.compared.before, BLUE, "-"), (rest.compared.after, RED, "--")):
        dev = to_dps(curve.dev)
        bars = np.array([dev - to_dps(curve.lo), to_dps(curve.hi) - dev])
        adev_ax.errorbar(
            tau, dev, bars, color=colour, linestyle=dash, linewidth=1.1, marker="o", markersize=2.5, capsize=2
        )
    adev_ax.set_yscale("log")
    for ratio, colour, values in zip(RATIOS, _RATIO_COLOURS, short.adev, strict=True):
        ratio_ax.plot(tau, values, color=colour, linewidth=1.1, marker="o", markersize=2.5, label=f"{ratio:g}")
    ratio_ax.axhline(1.0, color=MUTED, linewidth=0.6)
    for ax in (adev_ax, ratio_ax):
        _over_tau(ax)
    _plain(adev_ax.yaxis)
    for time in TAUS:
        freedom = degrees_of_freedom(SAMPLES, time)
        adev_ax.annotate(f"{freedom:.0f}", (time, 0.03), xycoords=("data", "axes fraction"), ha="center", color=MUTED)
    adev_ax.annotate(TRACKBALL.text("degrees_of_freedom"), (0.02, 0.1), xycoords="axes fraction", color=MUTED)


def _over_tau(ax: "Axes") -> None:
    ax.set_xscale("log")
    ax.set_xlim(0.08, 65.0)
    ax.set_xlabel(_TAU)
    _plain(ax.xaxis)


def _plain(axis: "Axis") -> None:
    """Plain numbers on a logarithmic axis."""
    axis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.set_minor_formatter(lambda value, _: "")


def _draw_fit(fit: PowerFits, canvas: "FigureBase") -> None:
    ax = canvas.subplots()
    grid = np.geomspace(0.08, 65.0, 400)
    columns = powers(grid)
    ax.plot(TAUS, to_dps(to_dps(fit.measured)), color=INK, linestyle="none", marker="o", markersize=3.5, zorder=3)
    for coefficients, colour in ((fit.plain, RED), (fit.weighted, GREEN)):
        total = to_dps(to_dps(columns @ coefficients))
        ax.plot(grid, np.where(total > 0.0, total, np.nan), color=colour, linewidth=1.2)
    letters = sorted(TERMS, key=lambda letter: TERMS[letter].power)
    for letter, column, value in zip(letters, columns.T, fit.weighted, strict=True):
        if value > 0.0:
            ax.plot(grid, to_dps(to_dps(column * value)), color=MUTED, linewidth=0.7, linestyle="--")
            end = to_dps(to_dps(value * column[-1]))
            if end > 1e-6:
                ax.annotate(letter, (grid[-1], end), xytext=(3, 0), textcoords="offset points", color=MUTED)
    _over_tau(ax)
    ax.set_yscale("log")
    _plain(ax.yaxis)


def _draw_turn(turned: Turned, part: slice, canvas: "FigureBase") -> None:
    rate_ax, error_ax = canvas.subplots(1, 2)
    t, true = turned.t[part], turned.true[part]
    lines = ((turned.raw, MUTED), (turned.rates["paper"], RED), (turned.rates["best"], GREEN))
    for rate, colour in lines:
        rate_ax.plot(t, to_dps(rate[part]), color=colour, linewidth=0.9)
    rate_ax.plot(t, to_dps(true), color=INK, linewidth=0.9, linestyle="--")
    rate_ax.set_ylabel(_RATE)
    for rate, colour in lines[1:]:
        error_ax.plot(t, to_dps(rate[part] - true), color=colour, linewidth=0.8)
    error_ax.axhline(0.0, color=MUTED, linewidth=0.5)
    error_ax.set_ylim(-0.75, 0.35)
    error_ax.set_ylabel(_ERROR)
    for ax in (rate_ax, error_ax):
        ax.set_xlim(t[0], np.ceil(t[-1]))
        ax.set_xlabel(_TIME)


def _draw_lag(turned: Turned, canvas: "FigureBase") -> None:
    error_ax, heading_ax = canvas.subplots(1, 2)
    for name, colour in (("calibrated", BLUE), ("calibrated, paper's filter", RED), ("best", GREEN)):
        error = to_dps(turned.rates[name] - turned.true)
        smooth = np.convolve(error, np.ones(10) / 10.0, "same")
        error_ax.plot(turned.t, smooth, color=colour, linewidth=0.9)
        heading_ax.plot(turned.t, to_deg(turned.headings[name]), color=colour, linewidth=1.2)
    for ax in (error_ax, heading_ax):
        ax.axvline(SAMPLES * STEP, color=MUTED, linewidth=0.6, linestyle=":")


def _draw_balls(lapped: Lapped, canvas: "FigureBase") -> None:
    panels = zip(canvas.subplots(1, 4), BALLS.items(), (BLUE, OLIVE, RED, GREEN), strict=True)
    for ax, (name, title), colour in panels:
        _draw_ball(ax, lapped.tracks[name], colour)
        ax.set_title(title, fontsize=7.0)


def _draw_ball(ax: "Axes", points: Floats, colour: str) -> None:
    """Ball with the circles about its x axis, and a track on it: near side over far side."""
    right = np.cross([0.0, 0.0, -1.0], _VIEW)
    right /= np.linalg.norm(right)
    up = np.cross(_VIEW, right)
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    ax.plot(np.cos(turn), np.sin(turn), color=MUTED, linewidth=0.8)
    for x in np.sin(deg(np.array([-60.0, -30.0, 0.0, 30.0, 60.0]))):
        r = np.sqrt(1.0 - x * x)
        circle = np.stack((np.full(turn.size, x), r * np.cos(turn), r * np.sin(turn)), axis=1)
        near = circle @ _VIEW > 0.0
        ax.plot(np.where(near, circle @ right, np.nan), np.where(near, circle @ up, np.nan), color=GRID, linewidth=0.6)
    fine = _between(points)
    near = fine @ _VIEW > 0.0
    for which, ink, width in ((~near, SOFT, 0.5), (near, colour, 0.9)):
        ax.plot(np.where(which, fine @ right, np.nan), np.where(which, fine @ up, np.nan), color=ink, linewidth=width)
    ax.set_aspect("equal")
    ax.set_axis_off()
    ax.set_xlim(-1.05, 1.05)
    ax.set_ylim(-1.05, 1.05)


def _between(points: Floats) -> Floats:
    """Points of the unit ball with three more between each two, (4N − 3, 3)."""
    at = np.arange(0.0, len(points) - 0.999, 0.25)
    wide = np.stack([np.interp(at, np.arange(len(points)), column) for column in points.T], axis=1)
    return np.asarray(wide / np.linalg.norm(wide, axis=1, keepdims=True))
