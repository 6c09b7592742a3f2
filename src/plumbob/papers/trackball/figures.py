"""Figures 1 to 5 of the trackball paper, drawn again, and those that it lacks: lag and angle, fits, and the ball."""

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.units import deg, to_deg, to_dps
from plumbob.noise.terms import TERMS
from plumbob.papers.trackball.recorded import Lapped, Rest, Turned
from plumbob.papers.trackball.records import AT_REST, RATIOS, SAMPLES, STEP
from plumbob.papers.trackball.static import TAUS, PowerFits, Short, degrees_of_freedom, powers
from plumbob.reporting.content import Figure
from plumbob.reporting.style import GRID, INK, MUTED, SERIES, SOFT, Both

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import FigureBase

BLUE, RED, GREEN, PINK, AMBER, SKY, OLIVE = SERIES
BEFORE: Final = Both("before the filter", "滤波前")
PAPER: Final = Both("paper's filter", "论文滤波")
BEST: Final = Both("best: two states, calibrated", "最佳：双状态滤波、已标定")
TRUE: Final = Both("truth", "真值")
_TIME: Final = "time [s]"
_RATE: Final = Both("rate [°/s]", "角速率 [°/s]")
_ERROR: Final = Both("error [°/s]", "误差 [°/s]")
_TAU: Final = Both("averaging time τ [s]", "相关时间 τ [s]")
_ADEV: Final = Both("Allan deviation [°/s]", "Allan 标准差 [°/s]")
_VIEW: Final = np.array([0.55, 0.75, 0.36]) / np.linalg.norm([0.55, 0.75, 0.36])


def rest_figures(rest: Rest) -> list[Figure]:
    """Figures 1 and 2: the random sequence of x before and after the filter."""
    two = Both("two states, without lag", "双状态滤波（无滞后）")
    return [
        Figure(
            Both("Figure 1: random sequence of x before the Kalman filter", "图 1：卡尔曼滤波前陀螺仪 x 轴随机序列"),
            partial(_draw_series, rest.t, {BLUE: rest.before[:, 0]}),
            [(BEFORE, BLUE, "solid")],
            height=1.9,
        ),
        Figure(
            Both("Figure 2: random sequence of x after the Kalman filter", "图 2：卡尔曼滤波后陀螺仪 x 轴随机序列"),
            partial(_draw_series, rest.t, {GREEN: rest.best[:, 0], RED: rest.after[:, 0]}),
            [
                (Both(f"paper's filter, Q/R = {AT_REST:g}", f"论文滤波，Q/R = {AT_REST:g}"), RED, "solid"),
                (two, GREEN, "solid"),
            ],
            height=1.9,
        ),
    ]


def allan_figure(rest: Rest, short: Short) -> Figure:
    """Figure 3: deviations at the eight averaging times before and after, with intervals, and mean ratios."""
    key = [
        (BEFORE, BLUE, "solid"),
        (Both(f"after, Q/R = {AT_REST:g}", f"滤波后，Q/R = {AT_REST:g}"), RED, "dashed"),
        *((f"Q/R = {q:g}", colour, "solid") for q, colour in zip(RATIOS, _RATIO_COLOURS, strict=True)),
    ]
    return Figure(
        Both(
            "Figure 3: Allan deviation of x before and after the Kalman filter, with intervals of 68 %; and the "
            "ratio after/before over all records, by Q/R",
            "图 3：卡尔曼滤波前后 x 轴随机误差的 Allan 值及其 68 % 置信区间；右：全部记录的滤波后/前之比（按 Q/R）",
        ),
        partial(_draw_allan, rest, short),
        key,
        height=3.0,
    )


_RATIO_COLOURS: Final = (SKY, AMBER, RED, PINK, OLIVE)


def fit_figure(fit: PowerFits) -> Figure:
    """Fits of the five powers to the Allan variances of the record: the plain one, and the one that weighs."""
    return Figure(
        Both(
            "(14): fits of five powers of τ to eight Allan variances; where the plain fit is below zero it cannot be "
            "drawn",
            "式（14）：用 τ 的五个幂次拟合八个 Allan 方差；普通最小二乘为负处无法画出",
        ),
        partial(_draw_fit, fit),
        [
            (Both("measured", "测量值"), INK, "dotted"),
            (Both("plain least squares", "普通最小二乘"), RED, "solid"),
            (Both("weighted, none below zero", "加权非负最小二乘"), GREEN, "solid"),
            (Both("its terms", "各项"), MUTED, "dashed"),
        ],
        height=2.6,
    )


def turn_figures(turned: Turned) -> list[Figure]:
    """Figures 4 and 5: the rate while the table speeds up and while it holds, before and after compensation."""
    key = [
        (Both("measured", "补偿前"), MUTED, "solid"),
        (Both("paper's compensation and filter", "论文补偿与滤波"), RED, "solid"),
        (BEST, GREEN, "solid"),
        (TRUE, INK, "dashed"),
    ]
    names = (
        Both("Figure 4: x at uniform acceleration", "图 4：陀螺仪匀加速运动时所测时序图"),
        Both("Figure 5: x at uniform rate", "图 5：陀螺仪匀速转动时所测时序图"),
    )
    parts = (slice(0, SAMPLES), slice(SAMPLES, 2 * SAMPLES))
    return [
        Figure(name, partial(_draw_turn, turned, part), key, height=2.9)
        for name, part in zip(names, parts, strict=True)
    ]


def lag_figure(turned: Turned) -> Figure:
    """Lag of the rate, and what it does to the heading."""
    return Figure(
        Both(
            "Lag of the rate, and error of the heading that an attitude filter makes of it",
            "角速率的滞后及由此积分得到的航向误差",
        ),
        partial(_draw_lag, turned),
        [
            (Both("calibrated, not filtered", "已标定，不滤波"), BLUE, "solid"),
            (Both("calibrated, paper's filter", "已标定，论文滤波"), RED, "solid"),
            (BEST, GREEN, "solid"),
        ],
        height=2.6,
    )


BALLS: Final[Mapping[str, Both]] = {
    "true": Both("true", "真实轨迹"),
    "measured": Both("as measured", "补偿前"),
    "paper": Both("paper's compensation and filter", "论文补偿与滤波"),
    "calibrated": Both("best: calibrated, not filtered", "最佳：已标定，不滤波"),
}
"""Tracks that are drawn."""


def ball_figure(lapped: Lapped) -> Figure:
    """Track of the touching point on the ball, seen from one side: true, measured, by the paper, and best."""
    return Figure(
        Both(
            "Track of the lower plate on the ball, seen from one side; the far side is pale",
            "下研磨盘接触点在球面上的轨迹（正射投影，背面为浅色）",
        ),
        partial(_draw_balls, lapped),
        height=2.35,
    )


def _draw_series(t: Floats, lines: Mapping[str, Floats], canvas: "FigureBase") -> None:
    ax = canvas.subplots()
    for colour, rate in lines.items():
        ax.plot(t, to_dps(rate), color=colour, linewidth=0.8)
    ax.set_ylim(-0.42, 0.42)
    ax.set_xlim(0.0, 100.0)
    ax.set_xlabel(_TIME)
    ax.set_ylabel(_RATE)


def _draw_allan(rest: Rest, short: Short, canvas: "FigureBase") -> None:
    adev_ax, ratio_ax = canvas.subplots(1, 2)
    tau = np.array(TAUS)
    for curve, colour, dash in ((rest.compared.before, BLUE, "-"), (rest.compared.after, RED, "--")):
        dev = to_dps(curve.dev)
        bars = np.array([dev - to_dps(curve.lo), to_dps(curve.hi) - dev])
        adev_ax.errorbar(
            tau, dev, bars, color=colour, linestyle=dash, linewidth=1.1, marker="o", markersize=2.5, capsize=2
        )
    adev_ax.set_ylabel(_ADEV)
    adev_ax.set_yscale("log")
    adev_ax.set_ylim(1.2e-3, 0.2)
    for ratio, colour, values in zip(RATIOS, _RATIO_COLOURS, short.adev, strict=True):
        ratio_ax.plot(tau, values, color=colour, linewidth=1.1, marker="o", markersize=2.5, label=f"{ratio:g}")
    ratio_ax.axhline(1.0, color=MUTED, linewidth=0.6)
    ratio_ax.set_ylim(0.0, 1.1)
    ratio_ax.set_ylabel(Both("ratio after/before", "滤波后/前之比"))
    for ax in (adev_ax, ratio_ax):
        _over_tau(ax)
    _plain(adev_ax.yaxis)
    for time in TAUS:
        freedom = degrees_of_freedom(SAMPLES, time)
        adev_ax.annotate(f"{freedom:.0f}", (time, 0.03), xycoords=("data", "axes fraction"), ha="center", color=MUTED)
    adev_ax.annotate(Both("degrees of freedom", "自由度"), (0.02, 0.1), xycoords="axes fraction", color=MUTED)


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
    ax.set_ylim(1e-6, 0.1)
    _plain(ax.yaxis)
    ax.set_ylabel(Both("Allan variance [(°/s)²]", "Allan 方差 [(°/s)²]"))


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
    error_ax.set_ylabel(Both("error, mean of 1 s [°/s]", "误差（1 s 平均）[°/s]"))
    heading_ax.set_ylabel(Both("error of the heading [°]", "航向误差 [°]"))
    for ax in (error_ax, heading_ax):
        ax.axvline(SAMPLES * STEP, color=MUTED, linewidth=0.6, linestyle=":")
        ax.set_xlim(0.0, 200.0)
        ax.set_xlabel(_TIME)


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
