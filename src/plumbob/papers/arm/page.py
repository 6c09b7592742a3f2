"""The paper's page: its scheme, misprints, tables and figures in its order, and what goes beyond."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import to_deg
from plumbob.papers.arm import drawings as drawn
from plumbob.papers.arm import faults, misprints, tables, teaching
from plumbob.papers.arm.drawings import Broken, BytesRun
from plumbob.papers.arm.simulated import MOUNTS, Over, UnitErrors, assumed_noise
from plumbob.papers.arm.tables import PAPER, WORDS
from plumbob.papers.outcome import Outcome
from plumbob.reporting.content import Table
from plumbob.reporting.report import Report
from plumbob.reporting.style import Both


@dataclass(frozen=True, slots=True)
class Findings:
    """Everything that was computed.

    Attributes
    ----------
    runs : mapping of bool to BytesRun
        Through bytes, at rest and in the turn.
    rest, turn, fast : mapping of str to Over
        Statistics of each scheme over seeds: at rest, in the turn, and in the turn at 100 Hz.
    printed, read, stated
        Of `plumbob.papers.arm.misprints`: wrong forms, both inferences, and the stated noise.
    recoveries, designs
        Of `plumbob.papers.arm.tables`.
    watched, parity, every
        Of `plumbob.papers.arm.faults`: arrays to draw, the test of a pair, and every fault.
    done : Taught
        The teach-in.
    few, seeds, broken : int
        How many seeds: beside the tables, of the tables, and of the fault with bars.
    """

    runs: Mapping[bool, BytesRun]
    rest: Mapping[str, Over]
    turn: Mapping[str, Over]
    fast: Mapping[str, Over]
    printed: Sequence[misprints.Misprint]
    read: misprints.Inference
    stated: Sequence[Outcome]
    recoveries: Mapping[str, tables.Recovery]
    designs: Sequence[tuple[float, float, Over, float]]
    watched: Sequence[Broken]
    parity: Mapping[float, faults.Parity]
    every: Sequence[tuple[bool, str, str, faults.Watched]]
    done: teaching.Taught
    few: int
    seeds: int
    broken: int


def report(whole: Findings, seed: int) -> Report:
    """The page of the paper; `seed` is that of its runs through bytes."""
    return Report(
        Both("Teaching arm: six units, fuzzy-PI and a Kalman filter", "示教机械臂：六单元、模糊 PI 与卡尔曼滤波"),
        facts=[
            (
                Both("paper", "论文"),
                Both(
                    "Huang, Jiang: attitude of a teaching arm by several sensors",
                    "黄洋、姜文刚：示教机械臂多传感器姿态解算",
                ),
            ),
            (Both("noise", "噪声"), _noise_fact()),
            (
                Both("seeds", "随机种子"),
                Both(
                    f"figures through bytes: {seed}; tables: {whole.seeds}, drawn "
                    f"directly; beside them: {whole.few}; faults: {whole.broken}",
                    f"经字节的图：{seed}；表：{whole.seeds} 个（直接生成）；其他：{whole.few}；故障：{whole.broken}",
                ),
            ),
            (
                Both("order of angles", "角度顺序"),
                Both(
                    "roll, pitch, yaw; the paper's text does not say it",
                    "横滚、俯仰、航向；论文文字未注明",
                ),
            ),
        ],
        parts=[
            _scheme(),
            _misprints(whole),
            _case(whole, turns=False),
            _case(whole, turns=True),
            _source(whole),
            _hundred(whole),
            _breaks(whole),
            teaching.part(whole.done),
        ],
    )


def _noise_fact() -> Both:
    def said(noise: UnitErrors, en: str, zh: str) -> tuple[str, str]:
        gyr, bias, acc = to_deg(noise.gyr), to_deg(noise.bias), noise.acc / G0
        text = f"{gyr:.2g} °/s, ±{bias:.2g} °/s, {acc:.2g} g, {noise.mag:g} µT"
        return f"{en} {text}", f"{zh} {text}"

    rest, turn = said(assumed_noise(False), "at rest", "静态"), said(assumed_noise(True), "in the turn", "动态")
    return Both(
        f"assumed, of a sample at 10 Hz: gyroscope, its bias, accelerometer, magnetometer; {rest[0]}; {turn[0]}",
        f"假设的 10 Hz 单次采样噪声：陀螺仪、零偏、加速度计、磁力计；{rest[1]}；{turn[1]}",
    )


def _scheme() -> Report:
    """Figures 1 and 2."""
    head = (Both("part", "部分"), Both("in the paper", "论文"), Both("in Plumbob", "Plumbob 中"))
    rows = [
        (
            Both("units 1 to 3, units 4 to 6", "传感器 1~3、4~6"),
            Both("± sets of three axes, opposite signs", "正负两组三轴，符号相反"),
            'plumbob.read_array(…, mounts="arm"); array.paper.sets_of',
        ),
        (
            Both("magnetic compass (7)–(11)", "磁罗盘算法 (7)–(11)"),
            Both("roll and pitch from the force, yaw from the levelled field", "由比力求俯仰、横滚，由调平磁场求航向"),
            "filters.start; filters.tilt_compass",
        ),
        (
            Both("quaternion, its start (12)", "四元数初值 (12)"),
            Both("from these angles", "由上述角度"),
            "filters.start",
        ),
        (
            Both("complementary filter (13), (14)", "互补滤波 (13)、(14)"),
            Both("u corrects the rate", "u 修正角速度"),
            "arm.array.paper.run; filters.fuzzy_pi",
        ),
        (
            Both("errors (15)–(17)", "误差 (15)–(17)"),
            Both("vector products of measured and predicted vectors", "测量与估计向量的叉积"),
            "arm.array.paper.error_of",
        ),
        (
            Both("fuzzy regulator (18)", "模糊调节器 (18)"),
            Both("7 × 7 rules on e1 and its integral, factors 3, 1, 1", "e1 与其积分的 7 × 7 规则，量化因子 3、1、1"),
            "filters.fuzzy_pi.regulate",
        ),
        (
            Both("PI regulator (19)", "PI 调节器 (19)"),
            Both("0.8 e2 + 0.02 ∫e2", "0.8 e2 + 0.02 ∫e2"),
            "arm.array.paper.law",
        ),
        (
            Both("mean rate (20)", "角速度均值 (20)"),
            Both("half the difference of raw signals", "原始信号之半差"),
            "arm.array.paper.run; array.combine",
        ),
        (
            Both("EKF (21)–(27)", "EKF (21)–(27)"),
            Both("quaternion; Q = 1e-4, R = 1e-3, P0 = 1e-3", "四元数；Q = 1e-4，R = 1e-3，P0 = 1e-3"),
            "filters.ekf_quaternion",
        ),
        (
            Both("Euler angles (3)", "欧拉角 (3)"),
            Both("yaw, pitch, roll", "航向、俯仰、横滚"),
            "rotations.euler_zyx_from_quat",
        ),
    ]
    mounting = [
        (name, f"{'+−'[k > 2]}{'xyz'[k % 3]}", " ".join(f"{v:g}" for v in mount.q_bs))
        for k, (name, mount) in enumerate(MOUNTS.items())
    ]
    places = (Both("unit", "单元"), Both("axis that is read", "所读轴"), Both("mount q_bs", "安装四元数 q_bs"))
    return Report(
        Both("The scheme", "算法结构"),
        tables=[
            Table(Both("Figure 1: parts of the scheme", "图 1：算法总体结构"), head, rows, words=(1, 2)),
            Table(Both("Figure 2: mounting of the units", "图 2：传感器安装位置"), places, mounting, words=(1, 2)),
        ],
        remarks=[
            Both(
                "Each unit is a whole nine-axis one, and no turn reverses "
                "all of its axes: x is read from units 1 and 4, y from "
                "2 and 5, z from 3 and 6, each along its own axis.",
                "每个单元都是完整九轴单元，任何转动都不能使三轴同时反向：x "
                "取自单元 1、4，y 取自 2、5，z 取自 3、6，各沿自身轴。",
            ),
            Both(
                "PI and EKF use the same measurements twice, and its "
                "covariance is not a covariance. A set that is used alone "
                "starts from its own first sample; two sets start from both.",
                "PI 与 EKF 两次使用同一测量，其协方差不再是协方差。"
                "单组方案以该组首个采样为初值，两组方案以两组之和为初值。",
            ),
        ],
    )


def _misprints(study: Findings) -> Report:
    rows = [(row.what, f"{row.paper:g}", f"{row.faithful:.2g}", row.reason or "") for row in study.stated]
    head = (
        Both("std [°]", "标准差 [°]"),
        Both("paper", "论文"),
        Both("with the stated noise", "论文所述噪声"),
        Both("why", "说明"),
    )
    return Report(
        Both("What is printed, and what is meant", "原文与更正"),
        tables=[
            misprints.table(list(study.printed)),
            Table(
                Both("Table 1 with 0.1 °/h, 0.1 mg and 50 nT", "0.1 °/h、0.1 mg、50 nT 下的表 1"),
                head,
                rows,
                words=(3,),
            ),
        ],
        remarks=[
            Both(
                "The same table of rules by Mamdani's minimum and centre of area has another gain near zero "
                f"({study.read.gain:.1f} instead of {study.read.gain_product:.1f} 1/s), reaches "
                f"{study.read.reach:.2f} of 9 and differs by up to {study.read.apart:.2f}.",
                "同一规则表用 Mamdani 取小与面积重心时零点增益为 "
                f"{study.read.gain:.1f}（而非 {study.read.gain_product:.1f}）1/s，"
                f"最大 {study.read.reach:.2f}（论域 9），差别至 {study.read.apart:.2f}。",
            )
        ],
        figures=[drawn.inference(study.read)],
    )


def _three(values: Sequence[float] | Floats) -> str:
    return "/".join(f"{value:.3f}" for value in values)


def _case(study: Findings, *, turns: bool) -> Report:
    """Table 1 or 2 with its figures."""
    stats, run = (study.turn, study.runs[True]) if turns else (study.rest, study.runs[False])
    head = (
        Both("roll/pitch/yaw [°]", "横滚/俯仰/航向 [°]"),
        Both("std, paper", "论文标准差"),
        Both("std", "标准差"),
        Both("± of mean", "标准误差"),
        Both("range", "误差范围"),
        Both("rms", "均方根"),
    )
    rows = []
    for name, over in stats.items():
        printed = PAPER[turns].get(name)
        rows.append(
            (
                WORDS.get(name, _COMMON),
                _three(printed) if printed else "-",
                _three(over.std),
                _three(over.standard_error),
                _three(over.range),
                _three(over.rms),
            )
        )
    title = Both(
        f"Table {1 + turns}: attitude errors, means over {study.seeds} seeds",
        f"表 {1 + turns}：姿态角误差，{study.seeds} 个种子平均",
    )
    name = (
        Both("In the turn of −90°: Table 2, Figures 6 to 9", "动态（航向 0° 至 −90°）：表 2、图 6～9")
        if turns
        else Both("At rest: Table 1, Figures 3 to 5", "静态：表 1、图 3～5")
    )
    return Report(
        name,
        tables=[Table(title, head, rows)],
        remarks=_case_remarks(stats),
        figures=[*([drawn.heading(run)] if turns else []), *drawn.errors(run, turns=turns)],
    )


_COMMON: Final = Both("PI that starts from both sets", "PI 调节，两组初值")


def _case_remarks(stats: Mapping[str, Over]) -> list[Both]:
    ratio = (stats["fuzzy"].std / stats["pi, common start"].std).max()
    std, rms = stats["none"].std.mean(), stats["none"].rms.mean()
    return [
        Both(
            "The figures are of one run through bytes; its own statistics stand beside its lines.",
            "各图为经字节的一次运行，其统计值列于曲线旁。",
        ),
        Both(
            "The ranges of the paper's tables are not in its text; the "
            "standard deviations are. A range grows with the number "
            "of samples.",
            "论文文字中没有表中误差范围的数值，只有标准差；误差范围随采样数增大。",
        ),
        Both(
            f"Standard deviation hides what is constant: without a regulator {std:.2f}° of std and {rms:.2f}° of rms.",
            f"标准差掩盖恒定误差：无调节时标准差 {std:.2f}°，均方根 {rms:.2f}°。",
        ),
        Both(
            "A single set with PI starts from its own first sample. If "
            "it started from both sets, the greatest ratio of fuzzy-PI "
            f"to PI would be {ratio:.3f}.",
            f"单组 PI 以该组首个采样为初值；若以两组为初值，模糊 PI 与 PI 标准差之比最大为 {ratio:.3f}。",
        ),
    ]


def _source(study: Findings) -> Report:
    """Control, recovery and design."""
    starts = [
        (
            tables.RECOVERY_WORDS[name],
            *(_time(tables.recovery(scheme, angles).time) for _, angles in tables.STARTS.values()),
        )
        for name, scheme in tables.RECOVERIES.items()
    ]
    head = (Both("time to below 0.5° [s]", "收敛到 0.5° 的时间 [s]"), *(words for words, _ in tables.STARTS.values()))
    rows = [(f"{c:g}", f"{far:g}", _three(over.std), f"{time:.1f}") for c, far, over, time in study.designs]
    trade = (
        Both("slope c [1/s]", "斜率 c [1/s]"),
        Both("far [°/s]", "远端修正 [°/s]"),
        Both("std at rest [°]", "静态标准差 [°]"),
        Both("recovery [s]", "收敛时间 [s]"),
    )
    return Report(
        Both("What the fuzzy rules add", "模糊规则的作用"),
        tables=[
            Table(Both("Recovery from a wrong start", "错误初值的收敛"), head, starts),
            Table(
                Both(
                    f"Design of the rules: quiet or quick, {study.few} seeds",
                    f"规则设计：低噪声或快速，{study.few} 个种子",
                ),
                trade,
                rows,
            ),
        ],
        remarks=[
            Both(
                "PI on both sets is the control: it is as quiet as "
                "fuzzy-PI. The step from PI to fuzzy-PI is that of averaging "
                "two sets, 1/√2; the rules add recovery alone, and only "
                "with another table than the one that comes near Table 1.",
                "两组 PI 为对照：其噪声与模糊 PI 相同。由 PI 到模糊 PI "
                "的改善来自两组平均（1/√2）；规则只加快收敛，且须采用与接近表 1 者不同的规则表。",
            ),
            Both(
                "Recovery is measured without the EKF: with it every "
                "regulator takes 1.5 s, which would hide a mistake of units.",
                "收敛试验不含 EKF：有 EKF 时任何调节器都约 1.5 s，会掩盖单位错误。",
            ),
        ],
        figures=[drawn.recovery(study.recoveries)],
    )


def _time(value: float) -> str:
    return f"{value:.1f}" if np.isfinite(value) else "> 120"


def _hundred(study: Findings) -> Report:
    head = (Both("std [°], roll / pitch / yaw", "标准差 [°]，横滚/俯仰/航向"), "10 Hz", "100 Hz")
    rows = [
        (WORDS[name], _three(study.turn[name].std), _three(over.std))
        for name, over in study.fast.items()
        if name in WORDS
    ]
    return Report(
        Both("The same at 100 Hz", "100 Hz 下的结果"),
        tables=[Table(Both(f"The turn, {study.few} seeds at 100 Hz", f"动态，100 Hz，{study.few} 个种子"), head, rows)],
        remarks=[
            Both(
                "Motion of the human arm below 15 Hz, as the paper has "
                "it, cannot be sampled at 10 Hz, whose half is 5 Hz. The "
                "scatter of a sample is that of 10 Hz, so that more samples know more.",
                "论文所说低于 15 Hz 的人体手臂运动不能用 10 Hz 采样（一半为 "
                "5 Hz）。单次采样噪声与 10 Hz 相同，采样越多信息越多。",
            )
        ],
    )


_TRIADS: Final = {
    "gyr": Both("gyroscope", "陀螺仪"),
    "acc": Both("accelerometer", "加速度计"),
    "mag": Both("magnetometer", "磁力计"),
}
_KINDS: Final = dict(
    zip(
        faults.KINDS,
        (
            Both("frozen", "卡滞"),
            Both("biased", "零偏突变"),
            Both("scaled by 3 %", "标度偏 3 %"),
            Both("noisy ×10", "噪声 ×10"),
            Both("swapped axes", "轴互换"),
            Both("dead", "无输出"),
        ),
        strict=True,
    )
)


def _breaks(study: Findings) -> Report:
    head = (
        Both("fault", "故障"),
        Both("at rest: isolated [%]", "静止：隔离 [%]"),
        Both("median [s]", "中位 [s]"),
        Both("moving: isolated [%]", "运动：隔离 [%]"),
        Both("median [s]", "中位 [s]"),
    )
    cells: dict[tuple[str, str], list[str]] = {}
    for _, triad, kind, stats in study.every:
        share = stats.detected * stats.isolated / 100.0
        cells.setdefault((triad, kind), []).extend([f"{share:.0f}", f"{stats.median:.1f}" if share else "-"])
    rows = [
        (Both(f"{_TRIADS[triad]} {_KINDS[kind]}", f"{_TRIADS[triad].zh}{_KINDS[kind].zh}"), *values)
        for (triad, kind), values in cells.items()
    ]
    parity = [
        (f"{step:g}", f"{row.found}", f"{row.median:.1f}" if row.found else "-") for step, row in study.parity.items()
    ]
    steps = (
        Both("step [°/s]", "阶跃 [°/s]"),
        Both("found of 200", "200 次检出"),
        Both("median time [s]", "中位时间 [s]"),
    )
    return Report(
        Both("A unit that breaks", "单元故障"),
        tables=[
            Table(Both("Test of the parity of one pair, 5σ", "一对轴的奇偶检验，5σ"), steps, parity),
            Table(Both("Every fault of every sensor, 10 arrays each", "各传感器各类故障，每类 10 个阵列"), head, rows),
        ],
        remarks=[
            Both(
                "Two sensors on an axis detect a fault and cannot say "
                "whose it is; six whole units say it. While the arm moves, "
                "scale errors of 0.3 % alone are 0.2 °/s at 60 °/s: "
                "the monitor learns each unit's scale and axes on line.",
                "每轴两个传感器只能检出故障，不能隔离；六个完整单元可以。手臂运动时，0.3 "
                "% 的标度误差在 60 °/s 下即为 0.2 °/s，监测器在线学习各单元标度与轴向。",
            ),
            Both(
                "At rest nothing shows a wrong scale of a rate that is zero, nor swapped axes of equal values.",
                "静止时零角速度的标度误差和等值轴的互换无法显现。",
            ),
        ],
        figures=[drawn.faults(study.watched)],
    )
