"""Figures of the rod's page: the paper's Figure 6, and what stands behind it."""

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.units import deg, to_deg, to_dps
from plumbob.papers.rod.comparison import Compared, permutation_error
from plumbob.papers.rod.equations import Grown
from plumbob.papers.rod.methods import LIMIT, METHODS, SHAKEN, MethodScores, tilt_errors
from plumbob.reporting.content import Figure
from plumbob.reporting.style import INK, MUTED, SERIES, SHADE, SOFT, Both
from plumbob.rotations import euler_zyx_from_quat

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

_BLUE, _RED, _GREEN, _, _AMBER = SERIES[:5]
_COLUMNS = 900
_TIME: Final = "time [s]"
_ROLL, _PITCH = Both("roll [°]", "横滚角 [°]"), Both("pitch [°]", "俯仰角 [°]")
ZOOM: Final = 380.0, 420.0
"""Window of the enlargements, s: the vibration begins in its middle."""
CLOSE: Final = 405.5, 409.5
"""Window in which the lines can be distinguished, s."""


def figures(run: Compared) -> list[Figure]:
    """Figure 6, errors, differences to the reference, and the state of motion, from the run through bytes."""
    key = [
        (Both("accelerometer only", "仅加速度计"), SOFT, "solid"),
        (Both("AHRS500GA", "AHRS500GA"), INK, "solid"),
        (Both("fused, faithful: ekf7", "融合，按论文：ekf7"), _BLUE, "solid"),
        (Both("best: smoother", "最佳：平滑器"), _GREEN, "dashed"),
    ]
    errors = [
        (Both("roll", "横滚角"), _BLUE, "solid"),
        (Both("pitch", "俯仰角"), _RED, "solid"),
        (Both("±1°", "±1°"), MUTED, "dashed"),
    ]
    return [
        Figure(
            Both(
                "Figure 6 a and b: roll, and enlarged where the vibration begins",
                "图 6（a）（b）：横滚角及振动起始处的局部放大",
            ),
            partial(_angles, run, 2, _ROLL),
            key,
            5.6,
        ),
        Figure(
            Both(
                "Figure 6 c and d: pitch, and enlarged where the vibration begins",
                "图 6（c）（d）：俯仰角及振动起始处的局部放大",
            ),
            partial(_angles, run, 1, _PITCH),
            key,
            5.6,
        ),
        Figure(
            Both("Errors against the truth: accelerometer, gyroscope, fused", "相对真值的误差：加速度计、陀螺仪、融合"),
            partial(_errors, run),
            errors,
            6.4,
        ),
        Figure(
            Both(
                "Differences to the AHRS500GA, as the paper compares, and its own errors",
                "与 AHRS500GA 之差（论文的比较方法）及其自身误差",
            ),
            partial(_differences, run),
            errors,
            4.2,
        ),
        Figure(
            Both("Motion state and gyroscope bias", "运动状态与陀螺漂移"),
            partial(_bias, run),
            [
                (Both("estimated bias, ekf7", "漂移估计（ekf7）"), _BLUE, "solid"),
                (Both("true bias with its flicker noise", "真值（含闪变噪声）"), SOFT, "solid"),
                (Both("at rest", "静止"), SHADE, "block"),
            ],
            3.6,
        ),
    ]


def _line(ax: "Axes", t: Floats, y: Floats, jump: float = np.inf, **style: Any) -> None:
    from plumbob.reporting.drawing import envelope

    ax.plot(*envelope(t, y, _COLUMNS, jump=jump), linewidth=0.8, **style)


def _angle(q_nb: Floats, column: int) -> Floats:
    return np.asarray(to_deg(euler_zyx_from_quat(q_nb)[:, column]))


def _angles(run: Compared, column: int, label: Both, canvas: "FigureBase") -> None:
    full, near, close = canvas.subplots(3, 1)
    lines: tuple[tuple[Floats, dict[str, Any]], ...] = (
        (run.tracks["accel"], {"color": SOFT}),
        (run.reference, {"color": INK}),
        (run.tracks["ekf7"], {"color": _BLUE}),
        (run.tracks["smoother"], {"color": _GREEN, "linestyle": "--"}),
    )
    for ax, window in ((full, (0.0, float(run.t[-1]))), (near, ZOOM), (close, CLOSE)):
        inside = (run.t >= window[0]) & (run.t <= window[1])
        for q_nb, style in lines:
            _line(ax, run.t[inside], _angle(q_nb[inside], column), **style)
        ax.set_xlim(*window)
        ax.set_ylabel(label)
        if window[0] <= SHAKEN <= window[1]:
            ax.axvline(SHAKEN, color=MUTED, linewidth=0.6, linestyle=":")
    inside = (run.t >= CLOSE[0]) & (run.t <= CLOSE[1])
    if inside.any():
        shown = _angle(run.reference[inside], column)
        close.set_ylim(float(shown.min()) - 2.0, float(shown.max()) + 2.0)
    close.set_xlabel(_TIME)


def _pair(ax: "Axes", t: Floats, errors: Floats, label: Both, most: float | None = None) -> None:
    for error, colour in zip(errors, (_BLUE, _RED), strict=True):
        _line(ax, t, error, jump=180.0, color=colour)
    for limit in (-LIMIT, LIMIT):
        ax.axhline(limit, color=MUTED, linewidth=0.7, linestyle="--")
    ax.axvline(SHAKEN, color=MUTED, linewidth=0.6, linestyle=":")
    ax.set_xlim(0.0, t[-1])
    ax.set_ylabel(label)
    if most is not None:
        ax.set_ylim(-most, most)


def _errors(run: Compared, canvas: "FigureBase") -> None:
    names = {
        "accel": (Both("accelerometer [°]", "加速度计 [°]"), None),
        "gyro": (Both("gyroscope [°]", "陀螺仪 [°]"), None),
        "ekf7": (Both("ekf7 [°]", "ekf7 [°]"), 1.4),
        "smoother": (Both("smoother [°]", "平滑器 [°]"), 1.4),
    }
    axes = canvas.subplots(len(names), 1, sharex=True)
    for ax, (key, (label, most)) in zip(axes, names.items(), strict=True):
        _pair(ax, run.t[run.scored], run.errors(run.tracks[key], run.truth.q_nb), label, most)
    axes[-1].set_xlabel(_TIME)


def _differences(run: Compared, canvas: "FigureBase") -> None:
    names = (
        (Both("ekf7 − AHRS [°]", "ekf7 − AHRS [°]"), run.errors(run.tracks["ekf7"], run.reference), 1.4),
        (Both("AHRS − truth [°]", "AHRS − 真值 [°]"), run.errors(run.reference, run.truth.q_nb), 1.4),
    )
    axes = canvas.subplots(len(names), 1, sharex=True)
    for ax, (label, errors, most) in zip(axes, names, strict=True):
        _pair(ax, run.t[run.scored], errors, label, most)
    axes[-1].set_xlabel(_TIME)


def _bias(run: Compared, canvas: "FigureBase") -> None:
    from plumbob.reporting.drawing import runs

    assert run.truth.bias_b is not None
    axes = canvas.subplots(3, 1, sharex=True)
    rests = runs(run.t, run.rest, _COLUMNS)
    for i, (ax, axis) in enumerate(zip(axes, "xyz", strict=True)):
        ax.broken_barh(rests, (0.0, 1.0), transform=ax.get_xaxis_transform(), facecolors=SHADE, linewidth=0, zorder=0)
        _line(ax, run.t, np.asarray(to_dps(run.truth.bias_b[:, i])), color=SOFT)
        _line(ax, run.t, np.asarray(to_dps(run.bias[:, i])), color=_BLUE)
        ax.set_ylabel(Both(f"bias {axis} [°/s]", f"漂移 {axis} [°/s]"))
        ax.set_xlim(0.0, run.t[-1])
        low, high = np.percentile(to_dps(run.bias[run.t > 10.0, i]), (0.5, 99.5))
        spread = max(high - low, 0.1)
        ax.set_ylim(low - spread, high + spread)
    axes[-1].set_xlabel(_TIME)


def seeds_figure(table: MethodScores) -> Figure:
    """Largest error of each seed, a row for each way."""
    return Figure(
        Both("Largest error of each seed", "各随机种子的最大误差"),
        partial(_seeds, table),
        [
            (
                Both("sensors alone, variants of the paper, other filters", "单一传感器、论文方法的变体、其他滤波器"),
                _BLUE,
                "solid",
            ),
            (Both("faithful (ekf7) and recommended", "按论文（ekf7）与推荐方法"), _GREEN, "solid"),
            (Both("1°", "1°"), MUTED, "dashed"),
        ],
        5.0,
    )


def _seeds(table: MethodScores, canvas: "FigureBase") -> None:
    ax = canvas.subplots()
    keys = list(table.scores)[::-1]
    for row, key in enumerate(keys):
        largest = table.largest(key)
        ax.text(-0.01, row, METHODS[key].name, transform=ax.get_yaxis_transform(), ha="right", va="center")
        ax.plot(largest, np.full(largest.size, row), "|", color=_GREEN if METHODS[key].ours else _BLUE, markersize=6.0)
    ax.set_yticks(range(len(keys)), [""] * len(keys))
    ax.axvline(LIMIT, color=MUTED, linewidth=0.7, linestyle="--")
    ax.set_xscale("log")
    ax.set_xlim(0.2, 200.0)
    ax.set_xticks((0.3, 1.0, 3.0, 10.0, 30.0, 100.0), ("0.3", "1", "3", "10", "30", "100"))
    ax.set_xlabel(Both("largest error of roll and pitch [°]", "横滚、俯仰角的最大误差 [°]"))


def exchange_figure(run: Compared) -> Figure:
    """Error of exchanged Euler angles against the tilt, and over the run."""
    return Figure(
        Both(
            "Exchanged Euler angles: error against tilt, and over the run",
            "互换欧拉角：误差随倾角的变化，以及整个试验中的误差",
        ),
        partial(_exchange, run),
        [
            (Both("roll", "横滚角"), _BLUE, "solid"),
            (Both("pitch", "俯仰角"), _RED, "solid"),
            (Both("±1°", "±1°"), MUTED, "dashed"),
            (Both("by the rotation", "由旋转换算"), _GREEN, "solid"),
        ],
        2.8,
    )


def _exchange(run: Compared, canvas: "FigureBase") -> None:
    from plumbob.papers.rod.comparison import mapped, permuted

    ax, run_ax = canvas.subplots(1, 2)
    tilt = np.linspace(0.0, 35.0, 141)
    for error, colour in zip(np.abs(permutation_error(deg(tilt), deg(tilt))), (_BLUE, _RED), strict=True):
        ax.plot(tilt, error, color=colour, linewidth=1.0)
    ax.plot(tilt, np.abs(permutation_error(deg(tilt), deg(tilt), by=mapped)).max(axis=0), color=_GREEN, linewidth=1.0)
    ax.axhline(LIMIT, color=MUTED, linewidth=0.7, linestyle="--")
    ax.set_xlabel(Both("roll = pitch [°]", "横滚角 = 俯仰角 [°]"))
    ax.set_ylabel(Both("error [°]", "误差 [°]"))
    errors = tilt_errors(permuted(run.ahrs_true), mapped(run.ahrs_true))
    _pair(run_ax, run.t, errors, Both("error [°]", "误差 [°]"))
    run_ax.set_xlabel(_TIME)


def covariance_figure(steps: Sequence[Grown]) -> Figure:
    """How the covariance of the paper's equations grows."""
    return Figure(
        Both("P over time: standard deviations of heading, tilt and |q|", "P 随时间的变化：航向、倾角与 |q| 的标准差"),
        partial(_covariance, steps),
        [
            (Both("heading", "航向角"), _RED, "solid"),
            (Both("tilt", "倾角"), _BLUE, "solid"),
            (Both("|q|", "|q|"), _GREEN, "solid"),
        ],
        2.6,
    )


def _covariance(steps: Sequence[Grown], canvas: "FigureBase") -> None:
    angle_ax, length_ax = canvas.subplots(1, 2)
    t = [step.t for step in steps]
    angle_ax.loglog(t, [step.heading for step in steps], color=_RED, marker=".", linewidth=1.0)
    angle_ax.loglog(t, [step.tilt for step in steps], color=_BLUE, marker=".", linewidth=1.0)
    angle_ax.set_ylabel(Both("standard deviation [°]", "标准差 [°]"))
    length_ax.loglog(t, [step.length for step in steps], color=_GREEN, marker=".", linewidth=1.0)
    length_ax.set_ylabel(Both("standard deviation of |q|", "|q| 的标准差"))
    angle_ax.set_yticks((0.2, 0.5, 1.0, 2.0, 5.0, 10.0), ("0.2", "0.5", "1", "2", "5", "10"))
    length_ax.set_yticks((5e-4, 1e-3, 2e-3), ("0.0005", "0.001", "0.002"))
    for ax in (angle_ax, length_ax):
        ax.set_xticks((3.0, 10.0, 30.0, 100.0, 300.0), ("3", "10", "30", "100", "300"))
        ax.minorticks_off()
        ax.set_xlabel(_TIME)
