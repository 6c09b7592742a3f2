"""Page of the fin's experiment [Ou2017] §3: Figures 4 and 5 and Table 1, from static records through bytes."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from plumbob.core import text
from plumbob.core.check import Floats
from plumbob.core.units import from_si, to_deg
from plumbob.noise import Analysis, Coefficient
from plumbob.noise.report import coefficient, log_ticks, lowest
from plumbob.papers.fin.datasheet import TABLE, fin_report
from plumbob.papers.fin.estimators import with_paper_interval
from plumbob.papers.fin.records import (
    AXES,
    LENGTH,
    RATE,
    SIGMA,
    TABLE_1,
    THREE,
    Analysed,
    TrueCoefficients,
    analysed,
    drawn,
    printed,
    sent,
)
from plumbob.papers.fin.swimming import AT_REST
from plumbob.papers.outcome import Outcome, at_most
from plumbob.papers.workspace import Taken, Work
from plumbob.reporting.content import Figure, Table
from plumbob.reporting.report import Report
from plumbob.reporting.style import MUTED, SERIES, Both

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

Step = Callable[[str], None]

UNITS: Final = {"Q": "arcsec", "N": "deg/h", "B": "deg/h"}
"""Units in which Table 1 fits together."""
SHOWN: Final = {"Q": "″", "N": Both("°/h at 1 s", "°/h（1 s）"), "B": "°/h"}
NAMES: Final = {
    "Q": Both("quantization Q", "量化噪声系数 Q"),
    "N": Both('"R", angle random walk N', "“R”，角度随机游走 N"),
    "B": Both("bias instability B", "零偏不稳定性系数 B"),
}
_TAU: Final = Both("averaging time T [s]", "分组时间 T [s]")
_SIGMA: Final = Both("σ(T) [°/h]", "σ(T) [°/h]")


class Records(dict[str, Analysed]):
    """Static records by name: "table", "parts" and "three"."""


def static_records(work: Work, step: Step) -> tuple[Records, Taken]:
    """Record and analyse the three static records; and the one of the parts' data sheets, as it was recorded.

    Each goes through bytes, a recording, and a TXT file, and is analysed at every averaging factor.
    """
    records = Records()
    step("static record, data sheets")
    parts = work.recorded("fin", "static-parts", **AT_REST)
    records["parts"] = analysed(parts.recording)
    for number, (name, of) in enumerate((("table", TABLE_1), ("three", THREE))):
        step(f"static record, {name}")
        rates = drawn(of, np.random.default_rng([work.seed, number]))
        records[name] = analysed(sent(work, f"static-{name}", rates).recording)
    return records, parts


def part(records: Mapping[str, Analysed]) -> tuple[Report, list[Outcome]]:
    """Part of the page, and its outcomes."""
    lost = max(record.lost for record in records.values())
    table = records["table"].noise.analyses
    outcomes = [
        Outcome(
            key="text.lost",
            where="§3",
            what=Both("largest change of a rate that was stored as TXT and read back", "TXT 存取后角速率的最大变化"),
            unit="rad/s",
            paper="TXT",
            faithful=lost,
            faithful_bar=at_most(0.0),
        ),
        Outcome(
            key="allan.n",
            where="4)",
            what=Both("averaging times of a curve: every n", "曲线上的分组时间数：连续 n"),
            paper="N/2",
            faithful=float(table[0].curve.n.size),
            faithful_bar=(55_000.0, 55_000.0),
            digits=5,
        ),
        *_table_outcomes(table),
        *_claims(table),
    ]
    report = fin_report(table)
    as_printed = next(candidate for candidate in report.tables if "printed" in candidate.title)
    tables = [
        _record_table(
            table,
            TABLE_1,
            Both("Table 1 from the record of a unit that has its coefficients", "表 1：具有该表系数的器件之记录"),
        ),
        _as_printed(),
        Table(
            Both("Table 1 as printed, and what its errors imply", "表 1 原值及其误差的含义"),
            _HEAD,
            _with_remarks(as_printed.rows),
            words=(5,),
        ),
        _record_table(
            records["three"].noise.analyses,
            THREE,
            Both("The same table from the record of three regimes", "三段噪声记录的同一表"),
        ),
        _forced(),
        _angles(table),
    ]
    remarks = (
        Both(
            "Three records of 220 s at rest: a unit with the coefficients of Table 1 in the units that fit (Q in "
            "seconds of arc, N = R/60, B = flat/0.664); the parts by their data sheets; and three regimes that 220 s "
            "can show on every axis (Q 4.4″, N 0.9 °/√h, B 51.5 °/h).",
            "三段静止记录各 220 s：具有表 1 系数的器件（单位取相互一致者：Q 为角秒，N = R/60，B = 平坦段/0.664）；"
            "按数据手册的器件；以及 220 s 可分辨三段的噪声（Q 4.4″，N 0.9 °/√h，B 51.5 °/h）。",
        ),
        Both(
            "A noise card has N, B and K alone. Q is drawn as the white error of an angle that is read and "
            "differenced, as (3) has it, and the rates are sent in the rig's frames; their rounding to 1/200 and 1/80 "
            "°/s stays below 0.2 % of the power of the noise of a sample.",
            "噪声卡仅含 N、B、K。Q 按式（3）以读角白误差差分生成，再放入帧中发送；1/200 与 1/80 °/s "
            "的舍入低于单样本噪声功率的 0.2 %。",
        ),
        Both(
            "The line of R of the 453z meets its flat at 0.07 s, and is read at 1 s, where the curve is four times as "
            "high: a value of the line, not of the curve. Yet a unit with these two gives both back within 10 %. The "
            "data sheet of the ADXRS453 has 54 °/h at 1 s and 16 °/h of bias instability, near the printed two in the "
            "other order.",
            "453z 的 R 直线与平坦段交于 0.07 s，却在 1 s 处读取，该处曲线高约四倍：所读为直线值而非曲线值；"
            "但具有这两项系数的器件仍能读回二者（10 % 内）。ADXRS453 数据手册为 1 s 处 54 °/h、零偏不稳定性 16 °/h，"
            "与所印两值相近而次序相反。",
        ),
        Both(
            "No axis shows a slope −1, so Q cannot be read; a line forced through σ(2 ms) takes white noise for it. "
            "White noise of the printed R alone would read 0.123″ on the 290x, where 0.125 is printed.",
            "各轴均无 −1 斜率段，Q 无从读取；强行过 σ(2 ms) 的直线把白噪声当作 Q。仅 R 的白噪声在 290x 上即读得 "
            "0.123″，原值为 0.125。",
        ),
        Both(
            "An angle is blurred by all three: after 220 s the flat of B makes more of the error than N on every axis "
            "of Table 1, and Q nothing. The paper ranks coefficients of different units.",
            "三项均影响姿态角：220 s 后，表 1 各轴 B 的贡献均大于 N，Q 可忽略。论文比较的是不同单位的系数。",
        ),
    )
    figures = [_figure_4(records), _figure_5(records)]
    title = Both("Experiment (§3)", "实验结果及分析（§3）")
    return Report(title, tables=tables, remarks=remarks, figures=figures), outcomes


_HEAD: Final = (
    "",
    Both("axis", "轴"),
    Both("printed", "原值"),
    Both("±/value", "相对误差"),
    Both("implied T [s]", "对应 T [s]"),
    Both("remark", "备注"),
)
_REMARKS: Final = (
    Both("ten times too large, and still off: √3 s gives 0.0079", "多一个数量级，且仍不符：√3 s 处应为 0.0079"),
    Both("ten times too large: 0.0083 is √3 s", "多一个数量级：0.0083 对应 √3 s"),
    Both("√3 s", "√3 s"),
    Both("1 s; cut off, not rounded: 0.2277", "1 s；截断而未舍入：0.2277"),
    Both("1 s", "1 s"),
    Both("1 s", "1 s"),
    Both("√10 s or π s, not 3 s, which gives 0.0946", "√10 s 或 π s；3 s 处为 0.0946，不符"),
    Both("1.5 s", "1.5 s"),
    Both("√3 s, as for Q", "√3 s，同 Q"),
)
"""What is to be said of each entry of `TABLE`."""


def _with_remarks(rows: Sequence[Sequence[str]]) -> list[list[str]]:
    return [
        [*(cell.replace(" to ", " … ") for cell in row[:-1]), remark]
        for row, remark in zip(rows, _REMARKS, strict=True)
    ]


def _true(of: TrueCoefficients, letter: str, axis: int) -> float:
    """True coefficient in Table 1's unit."""
    return from_si(float(getattr(of, letter)[axis]), UNITS[letter])


def _line(a: Analysis, letter: str) -> Coefficient | None:
    """As the paper reads it, with its ±; B divided by 0.664."""
    term = a.lines.terms.get(letter)
    return None if term is None else with_paper_interval(term.value, letter)


def _table_outcomes(analyses: Sequence[Analysis]) -> list[Outcome]:
    """Every entry of Table 1: printed, by lines, by likelihood; B as the flat that the paper prints."""
    outcomes = []
    for entry in TABLE:
        axis = ("290x", "290y", "453z").index(entry.axis)
        a, unit = analyses[axis], UNITS[entry.letter]
        best, flat = a.terms[entry.letter], SIGMA if entry.letter == "B" else 1.0
        name = "R" if entry.letter == "N" else entry.letter
        limit = Both("", "") if best.observable else Both("; best: limit, 95 %", "；最佳：95 % 上限")
        outcomes.append(
            Outcome(
                key=f"table1.{entry.letter}.{entry.axis}",
                where="Table 1",
                what=Both(f"{name}, {AXES[axis]}{limit}", f"{AXES[axis]} 轴 {name}{limit.zh}"),
                unit=unit.replace("deg", "°").replace("arcsec", "″"),
                paper=f"{entry.value} ± {entry.error}",
                faithful=from_si(flat * _read(a, entry.letter), unit),
                best=from_si(flat * (best.value if best.observable else best.upper), unit),
            )
        )
    return outcomes


def _read(a: Analysis, letter: str) -> float:
    """Coefficient as a reader of the paper must take it: by its line, or where none shows, by force.

    Q then by a line of slope −1 through the shortest averaging time, B by the floor of the curve.
    """
    term = a.lines.terms.get(letter)
    if term is not None:
        return term.value
    if letter == "Q":
        return float(a.curve.dev[0] * a.curve.tau[0] / math.sqrt(3.0))
    least = lowest(a)
    return math.nan if least is None else least.dev / SIGMA


def _forced() -> Table:
    """Q that a line of slope −1 reads at the shortest averaging time from white noise of the printed R alone."""
    alone = printed("N") * math.sqrt(1.0 / RATE / 3.0)
    rows = [
        [Both("Q as printed", "Q 原值"), *(f"{v:.3f}" for v in printed("Q"))],
        [Both("white noise of R alone", "仅有 R 的白噪声"), *(f"{v:.3f}" for v in alone)],
    ]
    title = Both("What a line of slope −1 through σ(2 ms) reads as Q [″]", "过 σ(2 ms) 的 −1 斜率直线读得的 Q [″]")
    return Table(title, ("", *AXES), rows)


def _claims(analyses: Sequence[Analysis]) -> list[Outcome]:
    """What the abstract and §3 say of the terms: shares of the angle's error after 220 s."""
    outcomes = []
    for axis, name in enumerate(("290x", "290y", "453z")):
        by = angle_errors(TABLE_1, axis)
        outcomes.append(
            Outcome(
                key=f"claim.{name}",
                where="§3",
                what=Both(
                    f"quantization's share of the angle's error after 220 s, {name}",
                    f"{name}：量化噪声占 220 s 姿态误差之比",
                ),
                unit="%",
                paper=Both("least", "相对最小"),
                faithful=100.0 * by["Q"] / math.hypot(*by.values()),
                faithful_bar=at_most(1.0),
            )
        )
    return outcomes


def angle_errors(of: TrueCoefficients, axis: int, t: float = LENGTH) -> dict[str, float]:
    """Error of an angle after t, s, that each term makes, degrees: Q√2, N√t, and 0.664 B t of the flat."""
    q, n, b = (float(getattr(of, letter)[axis]) for letter in "QNB")
    return {
        "Q": float(to_deg(math.sqrt(2.0) * q)),
        "N": float(to_deg(n * math.sqrt(t))),
        "B": float(to_deg(SIGMA * b * t)),
    }


def _record_table(analyses: Sequence[Analysis], of: TrueCoefficients, title: str) -> Table:
    """Coefficients of a record: true, by the paper's lines with its ±, and by likelihood with an honest interval."""
    rows = []
    for letter, unit in UNITS.items():
        name = Both(f"{NAMES[letter]} [{SHOWN[letter]}]", f"{NAMES[letter].zh} [{_zh(SHOWN[letter])}]")
        lines = [_line(a, letter) for a in analyses]
        rows += [
            [name, Both("true", "真值"), *(f"{_true(of, letter, i):.4g}" for i in range(3))],
            ["", Both("lines, ± of (7)", "直线法，± 按式（7）"), *(_said(c, unit) for c in lines)],
            ["", Both("likelihood, 68 %", "最大似然，68 %"), *(coefficient(a.terms[letter], unit) for a in analyses)],
        ]
    return Table(title, (Both("coefficient", "系数"), Both("by", "方法"), *AXES), rows, words=(1,))


def _zh(name: str) -> str:
    return name.zh if isinstance(name, Both) else name


def _said(c: Coefficient | None, unit: str) -> str:
    return "-" if c is None else text.measured(*(from_si(v, unit) for v in (c.value, c.lo, c.hi)))


def _as_printed() -> Table:
    """Table 1 as it is printed, and as it can be corrected."""
    rows = []
    for letter, heading, unit in (
        ("Q", Both("Q [°]", "Q [°]"), Both("Q [″]", "Q [″]")),
        ("N", Both("R [°/√h]", "R [°/√h]"), Both("N = R/60 [°/√h]", "N = R/60 [°/√h]")),
        ("B", Both("B [°/√h]", "B [°/√h]"), Both("B = flat/0.664 [°/h]", "B = 平坦段/0.664 [°/h]")),
    ):
        entries = [entry for entry in TABLE if entry.letter == letter]
        scale = {"Q": 1.0, "N": 1.0 / 60.0, "B": 1.0 / SIGMA}[letter]
        rows.append([heading, *(f"{entry.value} ± {entry.error}" for entry in entries)])
        rows.append([unit, *(_corrected(float(entry.value), float(entry.error), letter, scale) for entry in entries)])
    title = Both("Table 1 as printed, and below each row as it can be corrected", "表 1 原值，及各行下方的更正")
    return Table(title, (Both("coefficient", "系数"), *AXES), rows)


def _corrected(value: float, error: float, letter: str, scale: float) -> str:
    slip = letter == "Q" and error > 0.05
    half = 0.1 * error if slip else error
    return text.measured(scale * value, scale * (value - half), scale * (value + half))


def _angles(analyses: Sequence[Analysis]) -> Table:
    by = [angle_errors(TABLE_1, axis) for axis in range(len(analyses))]
    rows = [[NAMES[letter], *(text.number(errors[letter], 2) for errors in by)] for letter in "QNB"]
    title = Both("Error of an angle after 220 s by each term of Table 1 [°]", "表 1 各项在 220 s 后造成的姿态误差 [°]")
    return Table(title, (Both("term", "误差项"), *AXES), rows)


def _figure_4(records: Mapping[str, Analysed]) -> Figure:
    """Three axes, every n: a unit of Table 1, and the parts."""

    def draw(canvas: "FigureBase") -> None:
        axes = canvas.subplots(1, 2, sharey=True)
        titles = (Both("a unit of Table 1", "表 1 系数的器件"), Both("data sheets", "数据手册"))
        for ax, name, title in zip(axes, ("table", "parts"), titles, strict=True):
            for a, colour in zip(records[name].noise.analyses, SERIES, strict=False):
                _curve(ax, a.curve.tau, a.curve.dev, colour)
            ax.set_title(title, fontsize=7.5)
            for axis in (ax.xaxis, ax.yaxis):
                log_ticks(axis, (1,))
            ax.set_xlabel(_TAU)
        axes[0].set_ylabel(_SIGMA)

    key = [(name, colour, "solid") for name, colour in zip(AXES, SERIES, strict=False)]
    caption = Both("Figure 4: Allan deviation of the three axes, every n", "图 4：三轴 Allan 方差对数图，连续 n")
    return Figure(caption, draw, key, 3.2)


def _figure_5(records: Mapping[str, Analysed]) -> Figure:
    """The ADXRS453 with the paper's lines, and with the likelihood and its interval."""

    def draw(canvas: "FigureBase") -> None:
        axes = canvas.subplots(1, 2)
        titles = (Both("a unit of Table 1", "表 1 系数的器件"), Both("three regimes", "三段噪声"))
        for ax, name, title in zip(axes, ("table", "three"), titles, strict=True):
            a = records[name].noise.analyses[2]
            tau = np.geomspace(a.curve.tau[0], a.curve.tau[-1], 200)
            band = a.curve.edf >= 2.0
            lo, hi = (from_si(v[band], "deg/h") for v in (a.curve.lo, a.curve.hi))
            ax.fill_between(*_thin(a.curve.tau[band], lo, hi), color=SERIES[0], alpha=0.22, linewidth=0)
            _curve(ax, a.curve.tau, a.curve.dev, SERIES[0])
            ax.loglog(tau, from_si(a.model(tau), "deg/h"), color=SERIES[2], linewidth=1.0)
            bottom, top = ax.get_ylim()
            _paper_lines(ax, a, tau)
            ax.set_ylim(bottom, top)
            ax.set_title(title, fontsize=7.5)
            log_ticks(ax.xaxis, (1,))
            log_ticks(ax.yaxis, (1, 2, 5))
            ax.set_xlabel(_TAU)
        axes[0].set_ylabel(_SIGMA)

    key = [
        (Both("σ(T), 68 % interval", "σ(T)，68 % 区间"), SERIES[0], "solid"),
        (Both("lines of the paper", "论文的拟合直线"), SERIES[1], "dashed"),
        (Both("likelihood", "最大似然"), SERIES[2], "solid"),
        (Both("T = 1 s and √3 s", "T = 1 s 与 √3 s"), MUTED, "dotted"),
    ]
    caption = Both(
        "Figure 5: ADXRS453 z, lines of the paper and the likelihood",
        "图 5：ADXRS453 Allan 方差分析图，论文直线与最大似然",
    )
    return Figure(caption, draw, key, 3.2)


def _paper_lines(ax: "Axes", a: Analysis, tau: Floats) -> None:
    """Lines of slope −1, −1/2 and 0 where the curve has them, and where they are read."""
    for letter, power in (("Q", -1.0), ("N", -0.5), ("B", 0.0)):
        term = a.lines.terms.get(letter)
        if term is not None:
            at_one = term.value * {"Q": math.sqrt(3.0), "N": 1.0, "B": SIGMA}[letter]
            ax.plot(tau, from_si(at_one * tau**power, "deg/h"), color=SERIES[1], linewidth=0.9, linestyle="--")
    for at in (1.0, math.sqrt(3.0)):
        ax.axvline(at, color=MUTED, linewidth=0.7, linestyle=":")


def _curve(ax: "Axes", tau: Floats, dev: Floats, colour: str) -> None:
    from plumbob.reporting.drawing import envelope

    x, y = envelope(np.log(tau), from_si(dev, "deg/h"), 400)
    ax.loglog(np.exp(x), y, color=colour, linewidth=1.0)


def _thin(tau: Floats, *rows: Floats) -> tuple[Floats, ...]:
    """About 200 points of each, evenly in their logarithm."""
    at = np.unique(np.searchsorted(tau, np.geomspace(tau[0], tau[-1], 200)).clip(0, tau.size - 1))
    return (tau[at], *(row[at] for row in rows))
