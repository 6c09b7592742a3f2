"""Figures of the buoy paper, drawn again [Yu2018]."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from plumbob.calibration.ellipsoid.ellipsoid_fit import fit_axes
from plumbob.core.check import Floats
from plumbob.core.units import to_deg
from plumbob.data import AttitudeTrack
from plumbob.papers.buoy.bench import Sailed, Slid
from plumbob.papers.buoy.static_test import ANGLES, StaticTest
from plumbob.reporting.content import Figure
from plumbob.reporting.scene import Scene
from plumbob.reporting.style import INK, MUTED, SERIES, SOFT, Both
from plumbob.rotations import euler_zyx_from_quat, quat_rotate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

BLUE, RED, GREEN, PINK, AMBER = SERIES[:5]
ANGLE: Final = {"yaw": Both("yaw", "航向角"), "pitch": Both("pitch", "俯仰角"), "roll": Both("roll", "横滚角")}
_PAIRS: Final = ((0, 1), (0, 2), (1, 2))


def fig4(calls: Mapping[str, tuple[Floats, Floats]], length: float) -> Figure:
    """Figure 4: what the main loop does in its first milliseconds.

    Parameters
    ----------
    calls : mapping of str to (ndarray (N,), ndarray (N,))
        Begin and end of each call, s, by task.
    length : float
        Time that is drawn, s.
    """
    names = {
        "sample": Both("3 ms: sample", "3 ms：采样"), "fuse": Both("10 ms: fuse", "10 ms：融合"),
        "send": Both("50 ms: store and send", "50 ms：存储、发送"),
    }  # fmt: skip

    def draw(canvas: "FigureBase") -> None:
        ax = canvas.subplots()
        for row, (name, colour) in enumerate(zip(names, (BLUE, GREEN, RED), strict=True)):
            begun, done = calls[name]
            mask = begun < length
            bars = list(zip(1e3 * begun[mask], 1e3 * (done - begun)[mask], strict=True))
            ax.broken_barh(bars, (1.7 - row, 0.6), facecolors=colour)
            ax.text(-0.015, 2.0 - row, names[name], transform=ax.get_yaxis_transform(), ha="right", va="center")
        ax.set_yticks([2.0, 1.0, 0.0], [""] * len(names))  # a tick's label would lose its Chinese
        ax.set_xlim(0.0, 1e3 * length)
        ax.set_ylim(-0.5, 2.5)
        ax.set_xlabel(Both("time [ms]; between the bars the processor sleeps", "时间 [ms]；条间为低功耗模式"))

    caption = Both(
        "Figure 4: events that the main loop serves, emulated (the paper draws the flow chart alone)",
        "图 4：系统主程序所处理的时间事件（仿真；原文仅给出流程图）",
    )
    return Figure(caption, draw, height=1.7)


def fig5(counts: Floats, step: float) -> Figure:
    """Figure 5: readings of the magnetometer in 18 regions, before and after the fit; counts (18, 3), step in µT."""
    fit = fit_axes(counts)
    assert fit is not None
    after = (counts - fit.centre) @ fit.shape.T
    semi = 1.0 / np.diag(fit.shape)

    def draw(canvas: "FigureBase") -> None:
        axes = canvas.subplots(2, 3)
        limit = 1.15 * float(np.max(np.abs(fit.centre) + semi))
        for column, pair in enumerate(_PAIRS):
            i, j = pair
            _plane(axes[0, column], counts[:, pair], fit.centre[list(pair)], semi[list(pair)], limit, RED)
            _plane(axes[1, column], after[:, pair], np.zeros(2), np.ones(2), 1.3, BLUE)
            for row, unit in ((0, Both("[counts]", "[计数]")), (1, Both("[1]", "[1]"))):
                axes[row, column].set_xlabel(Both(f"{'xyz'[i]} {unit[:]}", f"{'xyz'[i]} {unit.zh}"))
                axes[row, column].set_ylabel(Both(f"{'xyz'[j]} {unit[:]}", f"{'xyz'[j]} {unit.zh}"))

    caption = Both(
        f"Figure 5: magnetometer in 18 regions before and after the ellipsoid fit; steps of {step * 10:.3g} mG",
        f"图 5：磁阻传感器 18 个区域测量值，椭球拟合前后；刻度 {step * 10:.3g} mGauss",
    )
    key = [
        (Both("(a) before: readings and fitted ellipsoid", "(a) 拟合前：测量值与拟合椭球"), RED, "solid"),
        (Both("(b) after, normalised: unit sphere", "(b) 拟合并规范化后：单位球"), BLUE, "solid"),
    ]
    return Figure(caption, draw, key, height=4.9)


def _plane(ax: "Axes", points: Floats, centre: Floats, semi: Floats, limit: float, colour: str) -> None:
    """Points (N, 2), the outline of an ellipsoid, its centre, and the origin, on equal scales."""
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    ax.axhline(0.0, color=SOFT, linewidth=0.6)
    ax.axvline(0.0, color=SOFT, linewidth=0.6)
    ax.plot(centre[0] + semi[0] * np.cos(turn), centre[1] + semi[1] * np.sin(turn), color=colour, linewidth=0.8)
    ax.plot(*points.T, "o", color=colour, markersize=2.6)
    ax.plot(*centre, "+", color=INK, markersize=5.0, markeredgewidth=0.8)
    ax.set_xlim(-limit, limit)
    ax.set_ylim(-limit, limit)
    ax.set_aspect("equal")


def fig7(paper: StaticTest, best: StaticTest) -> Figure:
    """Figure 7: errors of three angles at 36 headings beside the DCM260B, before and after."""
    heading = np.mod(to_deg(paper.reference[:, 0]), 360.0)
    order = np.argsort(heading)
    lines = (
        (Both("before", "补偿前"), paper.errors("before"), RED, "dashed"),
        (Both("after, the paper's six parameters", "补偿后（论文 6 参数）"), paper.errors("after"), BLUE, "solid"),
        (Both("after, Plumbob's card", "补偿后（Plumbob 标定卡）"), best.errors("after"), GREEN, "solid"),
    )

    def draw(canvas: "FigureBase") -> None:
        axes = canvas.subplots(3, 1, sharex=True)
        for i, (ax, name) in enumerate(zip(axes, ANGLES, strict=True)):
            ax.axhline(0.0, color=SOFT, linewidth=0.5)
            for _, errors, colour, style in lines:
                kind = "--" if style == "dashed" else "-"
                ax.plot(heading[order], to_deg(errors[order, i]), kind, color=colour, marker="o", markersize=1.8,
                        linewidth=0.8)  # fmt: skip
            for limit in (-5.0, 5.0):
                ax.axhline(limit, color=MUTED, linewidth=0.6, linestyle=":")
            ax.set_ylabel(Both(f"{ANGLE[name]} error [°]", f"{ANGLE[name].zh}偏差 [°]"))
        axes[-1].set_xlim(0.0, 360.0)
        axes[-1].set_xticks(range(0, 361, 45))
        axes[-1].set_xlabel(Both("heading of the compass DCM260B [°]", "罗盘 DCM260B 航向角 [°]"))

    key = [(name, colour, style) for name, _, colour, style in lines]
    key.append((Both("the paper's ±5°", "论文 ±5°"), MUTED, "dotted"))
    caption = Both(
        "Figure 7: static errors before and after the ellipsoid compensation, 36 headings on a table tilted by 20°",
        "图 7：椭球补偿前后静态误差，转台倾斜 20°，每隔 10° 一组",
    )
    return Figure(caption, draw, key, height=4.4)


def fig8(slid: Slid) -> Figure:
    """Figure 8: roll and pitch on a level desk, slid quickly, with and without the gate."""
    lines = (
        ("no gate", Both("without the gate", "未经阀值滤波"), RED, (9.6, 6.1)),
        ("gate 0.08 g", Both("gate 0.08 g", "阀值滤波 0.08 g"), BLUE, (3.3, 2.7)),
        ("mekf", Both("recommended filter (mekf)", "推荐滤波器（mekf）"), GREEN, (np.nan, np.nan)),
    )

    def draw(canvas: "FigureBase") -> None:
        axes = canvas.subplots(2, 1, sharex=True)
        for panel, (ax, name, column) in enumerate(zip(axes, ("roll", "pitch"), (2, 1), strict=True)):
            for key, _, colour, printed in lines:
                ax.plot(slid.t, slid.errors[key][:, column], color=colour, linewidth=0.8)
                for side in (-1.0, 1.0):
                    ax.axhline(side * printed[panel], color=colour, linewidth=0.6, linestyle=":")
            ax.set_ylabel(Both(f"{name} [°]", f"{ANGLE[name].zh} [°]"))
        axes[-1].set_xlabel("time [s]")

    key = [(name, colour, "solid") for _, name, colour, _ in lines]
    key.append((Both("largest in the paper", "论文最大值"), MUTED, "dotted"))
    caption = Both(
        "Figure 8: roll and pitch while the level unit is slid, strokes of 2 m/s and 0.4 s (true angles are zero)",
        "图 8：外力加速度干扰测试，滑动行程 2 m/s、0.4 s（真值为零）",
    )
    return Figure(caption, draw, key, height=3.2)


def waves(sailed: Sailed) -> Figure:
    """Roll at sea over the last minute, and the errors of four ways to find it."""
    rows = sailed.t >= sailed.t[-1] - 60.0
    lines: Sequence[tuple[str, Both, str]] = (
        ("tilt_compass", Both("accelerometer and compass alone", "仅加速度计与磁阻传感器"), SOFT),
        ("gate 0.08 g", Both("the paper's filter, gate 0.08 g", "论文滤波器（阀值 0.08 g）"), BLUE),
        ("mekf", Both("recommended filter (mekf)", "推荐滤波器（mekf）"), GREEN),
        ("smoother", Both("smoother, knows the future", "平滑器（非因果）"), AMBER),
    )

    def draw(canvas: "FigureBase") -> None:
        upper, lower = canvas.subplots(2, 1, sharex=True)
        upper.plot(sailed.t[rows], to_deg(euler_zyx_from_quat(sailed.truth.q_nb[rows])[:, 2]), color=INK, linewidth=0.9)
        for key, _, colour in lines:
            lower.plot(sailed.t[rows], sailed.errors[key][rows, 2], color=colour, linewidth=0.8)
        upper.set_ylabel(Both("true roll [°]", "横滚角真值 [°]"))
        lower.set_ylabel(Both("roll error [°]", "横滚角误差 [°]"))
        lower.set_xlabel("time [s]")

    key = [(Both("truth", "真值"), INK, "solid"), *((name, colour, "solid") for _, name, colour in lines)]
    return Figure(Both("Roll in waves, beyond the paper", "波浪中的横滚角（论文之外）"), draw, key, height=3.2)


def gains(kps: Sequence[float], scans: Mapping[Both, tuple[Floats, Floats]]) -> Figure:
    """Largest roll on a slide over Kp, without and with the gate, by strokes; and what the paper prints."""

    def draw(canvas: "FigureBase") -> None:
        ax = canvas.subplots()
        for (_, (free, gated)), colour in zip(scans.items(), (RED, BLUE, GREEN), strict=False):
            ax.plot(kps, free, "-o", color=colour, markersize=2.4, linewidth=0.9)
            ax.plot(kps, gated, "--o", color=colour, markersize=2.4, linewidth=0.9)
        for level in (9.6, 3.3):
            ax.axhline(level, color=MUTED, linewidth=0.7, linestyle=":")
        ax.axvline(0.5, color=SOFT, linewidth=0.7)
        ax.set_ylim(0.0, 12.5)
        ax.set_xlabel("Kp [1/s]")
        ax.set_ylabel(Both("largest roll [°]", "最大横滚角误差 [°]"))

    key = [(name, colour, "solid") for name, colour in zip(scans, (RED, BLUE, GREEN), strict=False)]
    key += [
        (Both("the same with the gate", "同上，加阀值"), INK, "dashed"),
        (Both("9.6° and 3.3° of the paper", "论文 9.6° 与 3.3°"), MUTED, "dotted"),
    ]
    caption = Both("Largest roll on a slide over Kp; the paper's is 0.5", "滑动时最大横滚角误差与 Kp（论文取 0.5）")
    return Figure(caption, draw, key, height=2.6)


def model(track: AttitudeTrack, truth: AttitudeTrack) -> Scene:
    """The host program's model of Fig 6: axes and rim of the buoy in the last half minute, the truth beside it pale."""
    rows = np.flatnonzero(track.t >= track.t[-1] - 30.0)[::5]
    places = {
        "x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "−x": (-1.0, 0.0, 0.0), "−y": (0.0, -1.0, 0.0),
        "z": (0.0, 0.0, 0.9), "o": (0.0, 0.0, 0.0),
    }  # fmt: skip
    lines = [("x", "y"), ("y", "−x"), ("−x", "−y"), ("−y", "x"), ("o", "x"), ("o", "y"), ("o", "z")]
    yaw, pitch, roll = to_deg(euler_zyx_from_quat(track.q_nb[rows])).T
    points = partial(_points_nwu, places)
    return Scene(
        caption=Both(
            "Figure 6: the host program's model, at sea: estimate (blue) and truth (pale); γ roll, θ pitch, φ yaw",
            "图 6：上位机姿态三维模型（海上）：估计（蓝）与真值（浅色）；γ 横滚、θ 俯仰、φ 航向",
        ),
        t=track.t[rows] - track.t[rows[0]],
        points=points(track.q_nb[rows]),
        lines=lines,
        values={"γ": roll, "θ": pitch, "φ": yaw},
        shadow=points(truth.q_nb[rows]),
    )


def _points_nwu(places: Mapping[str, tuple[float, float, float]], q_nb: Floats) -> dict[str, Floats]:
    """Places in axes of north, west and up, (N, 3) each."""
    return {name: quat_rotate(q_nb, np.array(place)) * [1.0, -1.0, -1.0] for name, place in places.items()}


def signed(value: float, digits: int) -> str:
    """Number with so many digits, and a minus as it is printed."""
    return f"{value:.{digits}f}".replace("-", "−")
