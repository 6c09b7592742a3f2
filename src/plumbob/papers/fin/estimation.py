"""Page of what estimators give for records whose truth is known, and of how long a record B needs."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from plumbob.noise.report import log_ticks
from plumbob.papers.fin import estimators as e
from plumbob.papers.outcome import Outcome, at_least, at_most
from plumbob.papers.workspace import Work
from plumbob.reporting.content import Figure, Table
from plumbob.reporting.report import Report
from plumbob.reporting.style import SERIES, Both

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

Step = Callable[[str], None]

_METHODS: Final = {
    "lines": Both(
        "lines of the paper where the curve has their slope, B = flat/0.664",
        "论文直线法（限于斜率相符处），B = 平坦段/0.664",
    ),
    "undivided": Both("the same, B not divided", "同上，B 不除 0.664"),
    "nearest": Both("lines through the point of the nearest slope", "过斜率最接近点的直线"),
    "least squares": Both("least squares of σ², five terms, none negative", "σ² 五项非负最小二乘"),
    "likelihood": Both("likelihood (recommended)", "最大似然（推荐）"),
}
_LIMITS: Final = {"Q": 1.0, "N": 1.0, "B": 5.0}


def part(work: Work, step: Step, runs: int, *, long: bool = True) -> tuple[Report, list[Outcome]]:
    """Part of the page, and its outcomes.

    Parameters
    ----------
    work : Work
        Of the run.
    step : callable
        Called before each step with its name.
    runs : int
        Records of the three regimes, simulated directly.
    long : bool
        Whether long records of B are drawn too.
    """
    step("estimators on three regimes")
    rows = list(e.three_regimes(np.random.default_rng([work.seed, 3]), runs))[-1]
    outcomes = []
    for letter in "QNB":
        line, best = rows["lines", letter], rows["likelihood", letter]
        reason = Both("a line takes what the other terms add for its own", "直线法将其他项的贡献计入本项")
        outcomes += [
            Outcome(
                key=f"three.{letter}.bias",
                where=f"{'QNB'.index(letter) + 5})",
                what=Both(f"|mean error| of {letter}, {runs} records", f"{letter} 平均误差的绝对值，{runs} 条记录"),
                unit="%",
                faithful=abs(100.0 * line.bias),
                best=abs(100.0 * best.bias),
                best_bar=at_most(_LIMITS[letter]),
                reproducible=False,
                reason=reason,
            ),
            Outcome(
                key=f"three.{letter}.cover",
                where="8)",
                what=Both(f"share of the intervals of {letter} that hold the truth", f"{letter} 区间包含真值的比例"),
                paper=Both("all", "全部"),
                faithful=line.coverage,
                best=best.coverage,
                best_bar=at_least(0.6),
                reproducible=False,
                reason=Both(
                    "± of (7) is about the scatter of one σ(T), not the error of a coefficient",
                    "式（7）的 ± 是单个 σ(T) 的离散度，不是系数的误差",
                ),
            ),
        ]
    undivided = rows["undivided", "B"]
    outcomes += [
        Outcome(
            key="three.B.scatter",
            where="7)",
            what=Both("standard deviation of B, one run", "单次 B 的标准差"),
            unit="%",
            faithful=100.0 * rows["lines", "B"].scatter,
            best=100.0 * rows["likelihood", "B"].scatter,
            best_bar=at_most(15.0),
        ),
        Outcome(
            key="misprint.undivided",
            where="7)",
            what=Both("mean error of B that is not divided by 0.664", "B 不除 0.664 的平均误差"),
            unit="%",
            paper=Both("intersection with the y axis", "与 y 轴的交点"),
            faithful=100.0 * undivided.bias,
            faithful_bar=(-34.0, -12.0),
            reproducible=False,
            reason=Both(
                "the flat is 0.664 B; white noise on it adds some again", "平坦段为 0.664 B；其上的白噪声又使其偏高"
            ),
        ),
    ]
    tables, figures = [_table(rows, runs)], []
    if long:
        step("record length for B")
        lengths = list(e.lengths(np.random.default_rng([work.seed, 4])))
        tables.append(_lengths(lengths))
        figures.append(_figure(lengths))
        outcomes += [
            Outcome(
                key=f"length.{round(length.seconds)}",
                where="7)",
                what=Both(
                    f"B over its truth from {_long(length.seconds)}, 16 °/h beside 0.9 °/√h",
                    f"{_long(length.seconds).zh} 记录的 B 与真值之比（16 °/h，0.9 °/√h）",
                ),
                best=length.mean,
                best_bar=(0.9, 1.1) if length.seconds >= 3600.0 else (0.35, 1.25),
            )
            for length in lengths
        ]
    remarks = (
        Both(
            "Simulated directly with known truth, without bytes: Q 4.4″, N 0.9 °/√h, B 51.5 °/h, 110 000 samples at "
            "500 Hz. The paper's lines are drawn where a person would see their slope, which flatters them.",
            "直接仿真（未经字节），真值已知：Q 4.4″、N 0.9 °/√h、B 51.5 °/h，500 Hz 110 000 点。"
            "论文直线取在斜率可见处，对其有利。",
        ),
        Both(
            "220 s are too short for the ADXRS453's own B of 16 °/h: an estimate is then a limit rather than a value. "
            "The long records are at 50 Hz; longer ones than 12 h are not drawn.",
            "220 s 不足以测得 ADXRS453 的 16 °/h 零偏不稳定性，此时结果只是上限。长记录为 50 Hz，未计算 12 h 以上。",
        ),
    )
    title = Both("Estimators and their intervals (§2, 5 to 8)", "系数估计方法及其区间（§2，5 至 8）")
    return Report(title, tables=tables, remarks=remarks, figures=figures), outcomes


def _table(rows: Mapping[tuple[str, str], e.CoefficientRow], runs: int) -> Table:
    lines = []
    for method, name in _METHODS.items():
        of = [rows[method, letter] for letter in "QNB"]
        lines.append(
            [
                name,
                " / ".join(f"{round(100.0 * row.bias, 1) + 0.0:+.1f}" for row in of),
                " / ".join(f"{100.0 * row.scatter:.1f}" for row in of),
                " / ".join(f"{row.coverage:.2f}" for row in of),
                " / ".join(f"{row.found:.2f}" for row in of),
            ]
        )
    head = (
        Both("estimator", "估计方法"),
        Both("bias Q/N/B [%]", "偏差 Q/N/B [%]"),
        Both("scatter [%]", "离散度 [%]"),
        Both("intervals that hold the truth", "含真值的区间比例"),
        Both("found", "求得比例"),
    )
    title = Both(f"Estimators on {runs} records of three regimes", f"三段噪声 {runs} 条记录的估计方法比较")
    return Table(title, head, lines)


def _long(seconds: float) -> Both:
    hours = seconds / 3600.0
    return Both("220 s", "220 s") if hours < 1.0 else Both(f"{hours:.0f} h", f"{hours:.0f} h")


def _lengths(lengths: Sequence[e.Length]) -> Table:
    rows = [
        [_long(row.seconds), f"{row.runs}", f"{row.mean:.2f} ± {row.scatter:.2f}", f"{row.observable:.2f}"]
        for row in lengths
    ]
    head = (
        Both("length", "记录长度"),
        Both("records", "记录数"),
        Both("B/truth, one run", "B/真值，单次"),
        Both("share where B shows", "可观测的比例"),
    )
    return Table(Both("Record length and B, ADXRS453's data sheet", "记录长度与 B（ADXRS453 数据手册）"), head, rows)


def _figure(lengths: Sequence[e.Length]) -> Figure:
    def draw(canvas: "FigureBase") -> None:
        ax = canvas.subplots()
        x, y, sd = (np.array(row) for row in zip(*((o.seconds, o.mean, o.scatter) for o in lengths), strict=True))
        ax.errorbar(x / 3600.0, y, sd, fmt="o", color=SERIES[0], capsize=3, linewidth=1.1, markersize=4)
        ax.axhline(1.0, color=SERIES[1], linewidth=0.8, linestyle="--")
        ax.set_xscale("log")
        ax.set_xlim(0.03, 25.0)
        log_ticks(ax.xaxis, (1,))
        ax.set_ylim(0.0, 1.5)
        ax.set_xlabel(Both("length of the record [h]", "记录长度 [h]"))
        ax.set_ylabel(Both("B over its truth", "B 与真值之比"))

    key = [
        (Both("mean and standard deviation of one record", "均值与单次标准差"), SERIES[0], "solid"),
        (Both("truth", "真值"), SERIES[1], "dashed"),
    ]
    return Figure(Both("Bias instability against the length of the record", "零偏不稳定性与记录长度"), draw, key)
