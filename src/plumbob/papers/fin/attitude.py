"""Page of the fin's attitude: real-time angles [Ou2017] (abstract, §1, §4), and what would spoil them."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.units import to_dps
from plumbob.noise.report import log_ticks
from plumbob.papers.fin import swimming as s
from plumbob.papers.outcome import Outcome, at_most
from plumbob.papers.workspace import Work
from plumbob.reporting.content import Figure, Table
from plumbob.reporting.report import Report
from plumbob.reporting.style import MUTED, SERIES, Both

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

Step = Callable[[str], None]

NAMES: Final = {"yaw": Both("yaw", "偏航角"), "pitch": Both("pitch", "俯仰角"), "roll": Both("roll", "滚转角")}
TIME: Final = "time [s]"
_COLUMNS = 900
_PAGE: Final = {"yaw": 1.23, "pitch": 0.38, "roll": 0.26}
"""Errors that an earlier prototype had with noise of its own, degrees, for comparison alone."""


def part(work: Work, step: Step, still: Path, seeds: int) -> tuple[Report, list[Outcome], s.Swum]:
    """Part of the page, its outcomes, and the swim.

    Parameters
    ----------
    work : Work
        Of the run.
    step : callable
        Called before each step with its name.
    still : Path
        Recording at rest, without a high-pass.
    seeds : int
        Of swims with noise, simulated directly.
    """
    step("attitude while swimming")
    swum, free = s.swim(work), s.without_noise()
    step("attitude over seeds")
    noisy, swinging = s.over_seeds(work, seeds), s.over_seeds(work, seeds, twist="0 deg")
    step("clipping")
    cut = s.clipped(work)
    step("high-pass")
    passed = s.high_passed(work, still)
    step("temperature compensation")
    warm = s.warmed_up(work)
    parts, outcomes = [], list[Outcome]()
    for report, scores in (
        _real_time(swum, free, noisy[0], seeds),
        _per_axis(free, noisy[1], swinging),
        _clipping(cut),
        _high_pass(passed),
        _temperature(warm),
    ):
        parts.append(report)
        outcomes += scores
    title = Both("Attitude in real time (abstract, §1, §4)", "姿态角实时测量（摘要、§1、§4）")
    return Report(title, parts=parts), outcomes, swum


def _real_time(swum: s.Swum, free: s.PerAxis, noisy: Floats, seeds: int) -> tuple[Report, list[Outcome]]:
    quiet, live = s.largest(free.quaternion), s.largest(swum.errors)
    cone = s.coning()
    outcomes = [
        Outcome(
            key="live.same",
            where="§1",
            what=Both("replay of the live attitude equal to the bit (1: yes)", "重放与实时姿态逐位一致（1：是）"),
            paper=Both("real-time", "实时"),
            faithful=float(swum.same_live),
            faithful_bar=(1.0, 1.0),
        ),
        Outcome(
            key="live.text",
            where="§1",
            what=Both("attitude of the rates from TXT equal to the bit (1: yes)", "TXT 读回后姿态逐位一致（1：是）"),
            paper="TXT",
            faithful=float(swum.same_text),
            faithful_bar=(1.0, 1.0),
        ),
    ]
    for axis, (name, value) in enumerate(live.items()):
        outcomes.append(
            Outcome(
                key=f"swim.{name}",
                where="§4",
                what=Both(
                    f"largest error of {name} in 220 s of swimming, one run through bytes",
                    f"游动 220 s {NAMES[name].zh}最大误差（经字节一次）",
                ),
                unit="°",
                paper=Both("no number", "无数据"),
                faithful=value,
                best=float(noisy[axis]),
            )
        )
        outcomes.append(
            Outcome(
                key=f"swim.free.{name}",
                where="§4",
                what=Both(f"the same for {name}, noise-free", f"{NAMES[name].zh}最大误差，无噪声"),
                unit="°",
                best=quiet[name],
                best_bar=at_most(5e-4),
            )
        )
    outcomes.append(
        Outcome(
            key="coning",
            where="-",
            what=Both("coning of 10° at 1 Hz for 220 s, noise-free", "10°、1 Hz 圆锥运动 220 s，无噪声"),
            unit="°",
            best=cone,
            best_bar=at_most(1e-3),
        )
    )
    rows = [
        [
            Both(f"{name}", NAMES[name].zh),
            f"{quiet[name]:.7f}",
            f"{live[name]:.3f}",
            f"{noisy[i]:.3f}",
            f"{_PAGE[name]:.2f}",
        ]
        for i, name in enumerate(s.ANGLES)
    ]
    head = (
        Both("angle", "姿态角"),
        Both("noise-free", "无噪声"),
        Both("through bytes", "经字节"),
        Both(f"median of {seeds} seeds", f"{seeds} 个种子中位数"),
        Both("prototype", "原型"),
    )
    title = Both(
        "Largest error in 220 s of swimming, quaternion from a level start [°]", "游动 220 s 四元数积分最大误差 [°]"
    )
    remarks = (
        Both(
            "A swing of ±30° and a twist of ±20° at 0.5 Hz, 90° apart. The session integrates while it records; the "
            "replay of its recording, and an estimate from the TXT file, give the same bits.",
            "摆动 ±30°、扭转 ±20°，0.5 Hz，相差 90°。会话边记录边积分；重放记录与由 TXT 文件估计所得逐位一致。",
        ),
        Both(
            "Noise and rounding are those of the two data sheets, after an ideal calibration. The prototype's noise "
            "is not known, so its errors have no bar; the bias instability of the ADXRS453 makes most of the yaw "
            "error.",
            "噪声与舍入取自两器件数据手册（理想标定后）。原型的噪声未知，故不设标准；偏航误差主要来自 ADXRS453 "
            "的零偏不稳定性。",
        ),
    )
    colours = dict(zip(s.ANGLES, SERIES, strict=False))
    key = [(NAMES[name], colour, "solid") for name, colour in colours.items()]
    figure = Figure(
        Both("Yaw, pitch and roll while swimming, and their errors", "游动时的偏航、俯仰、滚转角及其误差"),
        partial(_draw_swim, swum=swum),
        key,
        3.6,
    )
    report = Report(
        Both("Yaw, pitch and roll by quaternion", "四元数求偏航、俯仰与滚转角"),
        tables=[Table(title, head, rows)],
        remarks=remarks,
        figures=[figure],
    )
    return report, outcomes


def _draw_swim(canvas: "FigureBase", swum: s.Swum) -> None:
    top, bottom = canvas.subplots(2, 1)
    first = swum.t <= 6.0
    for axis, colour in zip(range(3), SERIES, strict=False):
        top.plot(swum.t[first], swum.live[first, axis], color=colour, linewidth=1.2)
        _line(bottom, swum.t, swum.errors[:, axis], colour)
    top.set_ylabel(Both("angle [°]", "姿态角 [°]"))
    bottom.set_ylabel(Both("error [°]", "误差 [°]"))
    bottom.set_xlabel(TIME)


def _line(ax: "Axes", t: Floats, y: Floats, colour: str, **how: Any) -> None:
    from plumbob.reporting.drawing import envelope

    ax.plot(*envelope(t, y, _COLUMNS), color=colour, **{"linewidth": 0.9, **how})


def _per_axis(free: s.PerAxis, noisy: Floats, swinging: tuple[Floats, Floats]) -> tuple[Report, list[Outcome]]:
    axis, quiet = s.largest(free.axis), s.largest(free.quaternion)
    outcomes = [
        Outcome(
            key=f"axis.{name}",
            where="§1",
            what=Both(
                f"{name} by integration of its body rate alone, largest error, noise-free",
                f"各轴直接积分的{NAMES[name].zh}最大误差，无噪声",
            ),
            unit="°",
            paper=Both("implied", "隐含"),
            faithful=axis[name],
            faithful_bar=(stated - 0.5, stated + 0.5),
            best=quiet[name],
            best_bar=at_most(5e-4),
            digits=5,
            reproducible=False,
            reason=Both(
                "rotations do not commute, so the integral of a body rate is not an angle",
                "转动不可交换，机体角速率的积分不是姿态角",
            ),
        )
        for name, stated in (("pitch", 3351.0), ("yaw", 1219.0))
    ]
    outcomes.append(
        Outcome(
            key="axis.swing",
            where="§1",
            what=Both(
                "yaw in a pure swing, largest error, with noise: one axis does commute",
                "仅摆动时偏航角最大误差（有噪声）：单轴可交换",
            ),
            unit="°",
            faithful=float(swinging[1][0]),
            best=float(swinging[0][0]),
            faithful_bar=at_most(2.0),
            best_bar=at_most(2.0),
        )
    )
    rows = [
        [Both("swing and twist, noise-free", "摆动加扭转，无噪声"), *(f"{axis[n]:.1f}" for n in s.ANGLES)],
        [Both("swing and twist, with noise", "摆动加扭转，有噪声"), *(f"{v:.1f}" for v in noisy)],
        [Both("pure swing, with noise", "仅摆动，有噪声"), *(f"{v:.2f}" for v in swinging[1])],
    ]
    table = Table(
        Both("Largest error when each axis is integrated on its own [°]", "各轴单独积分的最大误差 [°]"),
        (Both("motion", "运动"), *(NAMES[n] for n in s.ANGLES)),
        rows,
    )
    remark = Both(
        "The paper assigns one chip to each angle and writes of no attitude equation. Read so, pitch and yaw run away "
        "without any noise; the quaternion of the same rates stays within a millionth of a degree.",
        "论文将每个角度对应一个器件，未给出姿态方程。如此理解，俯仰与偏航在无噪声时也会发散；"
        "同样角速率的四元数积分误差在百万分之一度内。",
    )
    key = [
        (NAMES["yaw"], SERIES[0], "solid"),
        (NAMES["pitch"], SERIES[1], "solid"),
        (Both("all by quaternion", "四元数（各角）"), SERIES[2], "solid"),
    ]

    def draw(canvas: "FigureBase") -> None:
        ax = canvas.subplots()
        _line(ax, free.t, free.axis[:, 0], SERIES[0])
        _line(ax, free.t, free.axis[:, 1], SERIES[1])
        _line(ax, free.t, free.quaternion[:, 0], SERIES[2], linewidth=1.4)
        ax.set_xlabel(TIME)
        ax.set_ylabel(Both("error [°]", "误差 [°]"))

    caption = Both("Per-axis integration diverges, noise-free", "各轴单独积分发散，无噪声")
    title = Both("A warning: each axis on its own", "警示：各轴单独积分")
    return Report(title, tables=[table], remarks=[remark], figures=[Figure(caption, draw, key)]), outcomes


def _clipping(cut: s.Clipped) -> tuple[Report, list[Outcome]]:
    errors = s.largest(cut.errors)
    outcomes = [
        Outcome(
            key=f"clip.peak.{axis}",
            where="§1",
            what=Both(f"peak rate about {axis}, 1 Hz", f"1 Hz 时 {axis} 轴峰值角速率"),
            unit="°/s",
            paper=Both("range 100", "量程 100"),
            faithful=float(cut.peaks[i]),
            faithful_bar=(stated - 0.7, stated + 0.7),
        )
        for i, (axis, stated) in enumerate((("x", 126.0), ("y", 121.0)))
    ]
    outcomes += [
        Outcome(
            key="clip.missed",
            where="§1",
            what=Both("clipped samples without a flag", "未加标志的饱和样本数"),
            best=float(cut.missed),
            best_bar=(0.0, 0.0),
        ),
        Outcome(
            key="clip.share",
            where="§1",
            what=Both("samples flagged as clipped, 1 Hz", "1 Hz 时标记饱和的样本占比"),
            unit="%",
            best=100.0 * cut.share,
        ),
        Outcome(
            key="clip.error",
            where="§1",
            what=Both("largest error of an angle after 20 s of it", "20 s 后的最大姿态误差"),
            unit="°",
            faithful=max(errors.values()),
        ),
        Outcome(
            key="clip.limit",
            where="§1",
            what=Both("frequency at which the same swim reaches 100 °/s", "同样动作达到 100 °/s 的频率"),
            unit="Hz",
            best=s.longest_swim(),
        ),
    ]

    def draw(canvas: "FigureBase") -> None:
        axes = canvas.subplots(1, 2, sharey=True)
        first = cut.t <= 2.0
        for i, (ax, name) in enumerate(zip(axes, "xy", strict=True)):
            ax.plot(cut.t[first], cut.true[first, i], color=MUTED, linewidth=0.9, linestyle="--")
            ax.plot(cut.t[first], cut.said[first, i], color=SERIES[i], linewidth=1.2)
            ax.set_xlabel(TIME)
            ax.set_ylabel(Both(f"rate {name} [°/s]", f"{name} 轴角速率 [°/s]"))

    key = [
        (Both("true", "真值"), MUTED, "dashed"),
        (Both("ADXRS290 x", "ADXRS290 x"), SERIES[0], "solid"),
        (Both("ADXRS290 y", "ADXRS290 y"), SERIES[1], "solid"),
    ]
    caption = Both("Rates at 1 Hz, cut at ±100 °/s", "1 Hz 时的角速率，在 ±100 °/s 处饱和")
    remark = Both(
        "At 1 Hz the swim of this page is beyond the ADXRS290's ±100 °/s. The samples at the end of the range carry a "
        "flag, and what they lost is not in any later sample.",
        "1 Hz 时动作超出 ADXRS290 的 ±100 °/s 量程。达到量程端的样本带有标志，损失的角度无法由后续样本恢复。",
    )
    return Report(Both("Clipping", "量程饱和"), remarks=[remark], figures=[Figure(caption, draw, key)]), outcomes


def _high_pass(filtered: s.HighPassed) -> tuple[Report, list[Outcome]]:
    low, high = s.CORNERS
    chain = Both(
        "the band-pass has no figures in the paper; with a high-pass in it, an angle does not stay",
        "论文未给出带通参数；其中若含高通，角度无法保持",
    )
    outcomes = [
        Outcome(
            key="highpass.hold.free",
            where="§1",
            what=Both("turn of 90° and hold, 0.011 Hz high-pass, noise-free", "转 90° 后保持，0.011 Hz 高通，无噪声"),
            unit="°",
            paper=Both("band-pass", "带通滤波"),
            faithful=s.turned_without_noise(low),
            faithful_bar=(-0.005, 0.005),
            reason=chain,
            reproducible=False,
        ),
        Outcome(
            key="highpass.hold",
            where="§1",
            what=Both("the same through bytes; best: high-pass off", "同上，经字节；最佳：关闭高通"),
            unit="°",
            paper=Both("band-pass", "带通滤波"),
            faithful=filtered.at_end(low),
            best=filtered.at_end(0.0),
            best_bar=(88.0, 92.0),
            reason=chain,
            reproducible=False,
        ),
        Outcome(
            key="highpass.slope",
            where="Fig 5",
            what=Both("slope of σ from 2 to 20 s behind 0.5 Hz", "0.5 Hz 高通后 σ 在 2 至 20 s 的斜率"),
            faithful=filtered.slope(high),
            faithful_bar=(-1.05, -0.95),
            best=filtered.slope(0.0),
        ),
        Outcome(
            key="highpass.sigma",
            where="Fig 5",
            what=Both("σ(50 s), ADXRS453, behind 0.5 Hz; best: off", "σ(50 s)，ADXRS453，0.5 Hz 高通；最佳：关闭"),
            unit="°/s",
            faithful=filtered.at_fifty(high),
            best=filtered.at_fifty(0.0),
            faithful_bar=at_most(0.1 * filtered.at_fifty(0.0)),
        ),
    ]

    def draw(canvas: "FigureBase") -> None:
        yaw_ax, allan_ax = canvas.subplots(1, 2)
        for corner, colour in zip((0.0, low, high), SERIES, strict=False):
            _line(yaw_ax, filtered.t, filtered.yaw[corner], colour, linewidth=1.2)
        for corner, colour in ((0.0, SERIES[0]), (high, SERIES[2])):
            allan_ax.loglog(filtered.tau, filtered.dev[corner], color=colour, linewidth=1.2)
        for axis in (allan_ax.xaxis, allan_ax.yaxis):
            log_ticks(axis, (1,))
        yaw_ax.set_xlabel(TIME)
        yaw_ax.set_ylabel(Both("yaw [°]", "偏航角 [°]"))
        allan_ax.set_xlabel(Both("averaging time T [s]", "分组时间 T [s]"))
        allan_ax.set_ylabel(Both("σ, ADXRS453 [°/s]", "σ，ADXRS453 [°/s]"))

    key = [
        (Both("off", "关闭"), SERIES[0], "solid"),
        (Both("0.011 Hz", "0.011 Hz"), SERIES[1], "solid"),
        (Both("0.5 Hz", "0.5 Hz"), SERIES[2], "solid"),
    ]
    caption = Both(
        "What a high-pass costs: a turn of 90° and a hold; the Allan deviation at rest",
        "高通的代价：转 90° 后保持；静止时的 Allan 偏差",
    )
    remark = Both(
        "A high-pass removes the angle and the flat region: bias instability looks as if it were not there, and the "
        "slope −1 at long times looks like quantization. It must be off for integration and for an Allan analysis. "
        "The curve of 0.5 Hz on the left is simulated directly; everything else went through bytes.",
        "高通滤除角度与平坦段：零偏不稳定性似乎消失，长时间处斜率 −1 似为量化噪声。积分与 Allan 分析时必须旁路。左图 "
        "0.5 Hz 曲线为直接仿真，其余均经过字节。",
    )
    return Report(
        Both("What a high-pass costs", "高通滤波的代价"), remarks=[remark], figures=[Figure(caption, draw, key)]
    ), outcomes


def _temperature(warm: s.WarmedUp) -> tuple[Report, list[Outcome]]:
    before, after = warm.rates["before"], warm.rates["after"]
    outcomes = []
    for i, axis in enumerate("xyz"):
        last = {name: abs(float(np.mean(of[-10:, i]))) for name, of in (("before", before), ("after", after))}
        outcomes.append(
            Outcome(
                key=f"warm.{axis}",
                where="§1",
                what=Both(
                    f"mean rate about {axis} at rest in the last 50 s of a warm-up; best: compensated",
                    f"静止预热最后 50 s {axis} 轴平均角速率；最佳：补偿后",
                ),
                unit="°/s",
                paper=Both("clearly less", "明显减小"),
                faithful=last["before"],
                best=last["after"],
                best_bar=at_most(0.5 * last["before"]),
            )
        )
    rows = [
        [
            Both(f"{name}", NAMES[name].zh),
            *(f"{np.max(np.abs(warm.angles[which][:, i])):.3f}" for which in ("before", "after")),
        ]
        for i, name in enumerate(s.ANGLES)
    ]
    tables = [
        Table(
            Both("Largest error of an angle in the 220 s of a warm-up [°]", "预热 220 s 内的最大姿态误差 [°]"),
            (Both("angle", "姿态角"), Both("before", "补偿前"), Both("compensated", "补偿后")),
            rows,
        ),
        Table(
            Both("Bias per kelvin [°/s/K]", "零偏温度系数 [°/s/K]"),
            (Both("axis", "轴"), *"xyz"),
            [
                [Both("assumed", "设定"), *(f"{v:.4f}" for v in to_dps(s.TEMPCO))],
                [Both("found from the first warm-up", "由首次预热求得"), *(f"{v:.4f}" for v in warm.slopes)],
            ],
        ),
    ]
    remarks = (
        Both(
            "The unit warms up by 15 K with a time constant of 120 s, at rest. A first record of 600 s makes the card "
            "(calibrate temperature), a second one with other noise is scored. Both are at 100 Hz. The coefficients "
            "are assumed: the data sheets at hand state none.",
            "器件静止预热，升温 15 K，时间常数 120 s。首次 600 s 记录求取标定卡（calibrate "
            "temperature），第二次（另一噪声）用于评价，均为 100 Hz。温度系数为假设值：现有数据手册未给出。",
        ),
    )

    def draw(canvas: "FigureBase") -> None:
        rate_ax, error_ax = canvas.subplots(1, 2)
        middle = 5.0 * (np.arange(before.shape[0]) + 0.5)
        for i, colour in zip(range(3), SERIES, strict=False):
            for of, dash in ((before, "--"), (after, "-")):
                rate_ax.plot(middle, of[:, i], color=colour, linestyle=dash, linewidth=1.1)
            for which, dash in (("before", "--"), ("after", "-")):
                _line(error_ax, warm.t, warm.angles[which][:, 2 - i], colour, linestyle=dash, linewidth=1.1)
        rate_ax.set_ylabel(Both("mean rate over 5 s [°/s]", "5 s 平均角速率 [°/s]"))
        error_ax.set_ylabel(Both("error of the angle [°]", "姿态角误差 [°]"))
        for ax in (rate_ax, error_ax):
            ax.set_xlabel(TIME)

    axes = [Both("x, roll", "x，滚转角"), Both("y, pitch", "y，俯仰角"), Both("z, yaw", "z，偏航角")]
    key = [(name, colour, "solid") for name, colour in zip(axes, SERIES, strict=False)]
    key += [(Both("before", "补偿前"), MUTED, "dashed"), (Both("compensated", "补偿后"), MUTED, "solid")]
    caption = Both("Warm-up before and after temperature compensation", "温度补偿前后的预热过程")
    title = Both("Temperature compensation from a warm-up", "由预热求得的温度补偿")
    return Report(title, tables=tables, remarks=remarks, figures=[Figure(caption, draw, key)]), outcomes
