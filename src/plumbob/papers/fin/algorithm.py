"""Page of the fin's algorithm [Ou2017] §2: each equation as printed and as corrected, and what eq 7 is worth."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.noise.report import log_ticks
from plumbob.papers.fin import forms
from plumbob.papers.fin.datasheet import TABLE, percent_error
from plumbob.papers.fin.records import COUNT, LENGTH, RATE, TABLE_1, drawn, printed
from plumbob.papers.outcome import Outcome, at_most
from plumbob.papers.workspace import Work
from plumbob.reporting.content import Figure, Table
from plumbob.reporting.report import Report
from plumbob.reporting.style import MUTED, SERIES, Both

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

Step = Callable[[str], None]

FLAT: Final = math.sqrt(2.0 * math.log(2.0) / math.pi)
_MASQUERADE: Final = Both(
    "the printed sum makes white noise fall as quantization noise does", "按原式求和，白噪声呈现量化噪声的斜率"
)


def part(work: Work, step: Step, records: int) -> tuple[Report, list[Outcome]]:
    """Part of the page, and its outcomes.

    Parameters
    ----------
    work : Work
        Of the run.
    step : callable
        Called before each step with its name.
    records : int
        Of white noise for the scatter of σ, simulated directly; half as many are of flicker.
    """
    rng = np.random.default_rng([work.seed, 7])
    step("equations as printed")
    white, lines = forms.white_by_readings(rng), forms.slopes(rng)
    spectra = forms.quantised_spectrum(rng)
    rates = np.ascontiguousarray(drawn(TABLE_1, rng)[:, 2])
    step("is eq 7 right?")
    scatter = list(forms.scatter(rng, records))[-1]
    outcomes = [
        *_sums(white, rates),
        *_integrals(spectra),
        *_terms(lines),
        *_percentages(),
        *_units(),
        *_scattered(scatter),
    ]
    tables = [_misprints({outcome.key: outcome for outcome in outcomes}), _right(scatter, records)]
    remarks = (
        Both(
            "Each printed form was computed, on 110 000 samples at 500 Hz whose noise is known; none of these went "
            "through bytes.",
            "各原式均按 500 Hz、110 000 个已知噪声样本实际计算；此处未经过字节。",
        ),
        Both(
            "The percent error (7) is a formula for σ of disjoint groups at one averaging time, whatever the noise. "
            "It is too small for disjoint groups in white noise, whose neighbouring differences are correlated, and "
            "too large for overlapping ones; and it is not the error of a coefficient.",
            "式（7）是不重叠分组在单个 T 处 σ 的公式，与噪声种类无关。对白噪声的不重叠分组偏小（相邻差相关），"
            "对重叠分组偏大；它也不是系数的误差。",
        ),
    )
    title = Both("Algorithm (§2)", "误差分析算法（§2）")
    return Report(title, tables=tables, remarks=remarks, figures=[_figure(white)]), outcomes


def _sums(white: forms.White, rates: Floats) -> list[Outcome]:
    """Steps 1 to 4."""
    n = np.unique(np.geomspace(1, COUNT // 2, 200).astype(np.int64))
    peer = forms.peer(rates, n)
    delta = percent_error(1.0, LENGTH)
    outcomes = [
        Outcome(
            key="allan.slope",
            where="(2)",
            what=Both("slope of σ, white noise, 2 ms to 2 s", "白噪声 σ 的斜率，2 ms 至 2 s"),
            best=white.slope("right"),
            best_bar=(-0.52, -0.48),
        ),
        Outcome(
            key="allan.second",
            where="(2)",
            what=Both("σ(1 s) of white noise whose N is 1", "N = 1 的白噪声 σ(1 s)"),
            best=white.at_second("right"),
            best_bar=(1.0 - 3.0 * delta, 1.0 + 3.0 * delta),
        ),
    ]
    for reading, en, zh, stated, at_second in (
        ("moving", "neighbouring moving averages", "相邻滑动平均", -1.00, 0.045),
        ("disjoint", "neighbouring groups of (1)", "式（1）的相邻分组", -1.01, 0.041),
    ):
        outcomes += [
            Outcome(
                key=f"misprint.eq2.{reading}.slope",
                where="(1), (2)",
                what=Both(f"the same by the printed sum, {en}", f"按原式，{zh}：斜率"),
                paper=Both("as printed", "原式"),
                faithful=white.slope(reading),
                faithful_bar=(stated - 0.02, stated + 0.02),
                best=white.slope("right"),
                reproducible=False,
                reason=_MASQUERADE,
            ),
            Outcome(
                key=f"misprint.eq2.{reading}.second",
                where="(1), (2)",
                what=Both(f"σ(1 s) by the printed sum, {en}", f"按原式，{zh}：σ(1 s)"),
                paper=Both("as printed", "原式"),
                faithful=white.at_second(reading),
                faithful_bar=(at_second * (1.0 - 3.0 * delta), at_second * (1.0 + 3.0 * delta)),
                best=white.at_second("right"),
                reproducible=False,
                reason=_MASQUERADE,
            ),
        ]
    small = rates[:1000]
    return [
        *outcomes,
        Outcome(
            key="allan.direct",
            where="4)",
            what=Both("every n at once against sums of the definition, relative", "连续 n 与定义求和之相对差"),
            best=forms.every_sum(rates, n),
            best_bar=at_most(1e-12),
        ),
        Outcome(
            key="allan.peer",
            where="4)",
            what=Both("the same against AllanTools", "与 AllanTools 之相对差")
            if peer is not None
            else Both(
                "the same at n = 1 to 40, 1000 samples; AllanTools is not installed",
                "同上，1000 点，n = 1 至 40；未安装 AllanTools",
            ),
            best=forms.every_sum(small, np.arange(1, 41)) if peer is None else peer,
            best_bar=at_most(1e-12),
        ),
        Outcome(
            key="allan.last",
            where="1), 4)",
            what=Both("differences at n = N/2; best: N − 2n + 1", "n = N/2 时的差分个数；最佳：N − 2n + 1"),
            paper=Both("n < N/2, then up to N/2", "n < N/2，又至 N/2"),
            faithful=float(small.size - 2 * (small.size // 2)),
            best=1.0,
            faithful_bar=(0.0, 0.0),
            best_bar=(1.0, 1.0),
            reproducible=False,
            reason=Both("the printed sum has no term at n = N/2", "n = N/2 时原式无项"),
        ),
    ]


def _integrals(spectra: forms.DensityRatios) -> list[Outcome]:
    """(3), (4) and (6)."""
    late, later = 1e3, 1e4
    growth = (forms.white_integral(later, 1) - forms.white_integral(late, 1)) / math.log(later / late)
    return [
        Outcome(
            key="eq3.density",
            where="(3)",
            what=Both(
                "density of a differenced angle error over (3) with t0", "差分角误差谱密度与式（3）（取 t0）之比"
            ),
            paper="T",
            faithful=spectra.by_group,
            best=spectra.by_interval,
            best_bar=(0.9, 1.1),
            faithful_bar=(5.0, math.inf),
            reproducible=False,
            reason=Both(
                "with the group's time T = √3 s a density would change with the analysis",
                "取分组时间 T = √3 s 时，谱密度随分析而变",
            ),
        ),
        Outcome(
            key="eq3.nyquist",
            where="(3), (4)",
            what=Both(
                "(4) of (3) over 3Q²/T², cut at 250 Hz; best: not cut",
                "式（4）代入（3）与 3Q²/T² 之比，截止 250 Hz；最佳：不截止",
            ),
            faithful=forms.quantisation_integral(1.0 / RATE, math.sqrt(3.0), RATE / 2.0),
            faithful_bar=(0.765, 0.782),
            best=1.0,
        ),
        Outcome(
            key="eq4.white",
            where="(4)",
            what=Both("(4) of white noise over N²/T, with the square", "式（4）白噪声与 N²/T 之比，分母取平方"),
            best=4.0 / math.pi * forms.white_integral(late, 2),
            best_bar=(0.998, 1.002),
        ),
        Outcome(
            key="eq4.growth",
            where="(4)",
            what=Both(
                "growth per ln f of (4) without the square; best: with it",
                "式（4）不取平方时随 ln f 的增长；最佳：取平方",
            ),
            paper=Both("as printed", "原式"),
            faithful=growth,
            faithful_bar=(0.370, 0.380),
            best=forms.white_integral(later, 2) - forms.white_integral(late, 2),
            best_bar=at_most(1e-3),
            reproducible=False,
            reason=Both("the printed integral has no limit: it grows as (3/8) ln f", "原积分发散，按 (3/8) ln f 增长"),
        ),
        Outcome(
            key="eq6.flat",
            where="(6), 7)",
            what=Both("flat of σ over B; best: √(2 ln 2/π)", "平坦段 σ 与 B 之比；最佳：√(2 ln 2/π)"),
            paper=1.0,
            faithful=1.0,
            best=math.sqrt(2.0 / math.pi * forms.flicker_integral(late)),
            best_bar=(0.6642, 0.6644),
            digits=4,
            reproducible=False,
            reason=Both(
                "the height of the flat is 0.664 B, so B as read is 34 % low", "平坦段高度为 0.664 B，直接读取偏低 34 %"
            ),
        ),
    ]


def _terms(lines: forms.Slopes) -> list[Outcome]:
    """Step 6's name, and two kinds of quantisation."""
    return [
        Outcome(
            key="name.white",
            where="(5), 6)",
            what=Both("slope of σ of rate white noise, the term read as R", "角速率白噪声 σ 的斜率（所读 R 项）"),
            paper=Both("rate random walk", "角速率随机游走"),
            faithful=lines.white,
            faithful_bar=(-0.52, -0.48),
            best=lines.walk,
            best_bar=(0.4, 0.6),
            reproducible=False,
            reason=Both(
                "a random walk of the rate has slope +1/2 (best); what is read is angle random walk N",
                "角速率随机游走斜率为 +1/2（最佳列）；所读为角度随机游走 N",
            ),
        ),
        Outcome(
            key="quantised.angle",
            where="5)",
            what=Both("slope of σ of a rounded angle", "量化角度的 σ 斜率"),
            best=lines.angle,
            best_bar=(-1.02, -0.98),
        ),
        Outcome(
            key="quantised.rate",
            where="5)",
            what=Both("slope of σ of a rounded rate with noise, 1/80 °/s", "含噪角速率量化（1/80 °/s）的 σ 斜率"),
            faithful=lines.rate,
            faithful_bar=(-0.52, -0.48),
            best=lines.angle,
            reason=Both(
                "rounding a noisy rate adds white noise; quantization noise is that of an angle",
                "含噪角速率的舍入为白噪声；量化噪声属于角度",
            ),
            reproducible=False,
        ),
    ]


def _percentages() -> list[Outcome]:
    """(7) and Table 1's ±."""
    n = round(math.sqrt(3.0) * RATE)
    outcomes = [
        Outcome(
            key="eq7",
            where="(7), 8)",
            what=Both("percent error of the example", "示例的百分比误差 δ"),
            unit="%",
            paper="6.299",
            faithful=100.0 * percent_error(n / RATE, LENGTH),
            faithful_bar=(6.298, 6.300),
            digits=5,
        ),
        Outcome(
            key="eq7.n",
            where="8)",
            what=Both("samples of a group of √3 s", "T = √3 s 的每组数据量 n"),
            paper=866.0,
            faithful=float(n),
            faithful_bar=(866.0, 866.0),
        ),
    ]
    stated = {
        ("Q", "453z"): "1.712",
        ("Q", "290y"): "97",
        ("Q", "290x"): "100",
        ("N", "453z"): "1.000",
        ("N", "290y"): "1.000",
        ("N", "290x"): "0.994",
        ("B", "453z"): "1.7321",
        ("B", "290y"): "1.491",
        ("B", "290x"): "3.151",
    }
    for entry in TABLE:
        expected, slip = float(stated[entry.letter, entry.axis]), entry.letter == "Q" and entry.axis != "453z"
        half = 0.5 * 10.0 ** -len(stated[entry.letter, entry.axis].partition(".")[2])
        name = "R" if entry.letter == "N" else entry.letter
        outcomes.append(
            Outcome(
                key=f"interval.{entry.letter}.{entry.axis}",
                where="Table 1",
                what=Both(
                    f"T behind ± {100.0 * entry.relative:.2f} % of {name}, {entry.axis}",
                    f"{entry.axis} 的 {name}：± {100.0 * entry.relative:.2f} % 对应 T",
                ),
                unit="s",
                paper=f"{entry.value} ± {entry.error}",
                faithful=entry.tau[0],
                faithful_bar=(expected - half, expected + half),
                digits=5,
                reproducible=not slip,
                reason=Both("the error is printed ten times too large", "误差多印一个数量级") if slip else None,
            )
        )
    return outcomes


def _units() -> list[Outcome]:
    """Table 1 read with the units that it prints."""
    q = printed("Q")[2]
    level = 0.664 * printed("B")
    cross = (60.0 * printed("N") / level) ** 2
    why = Both(
        "seconds of arc, °/h at 1 s and °/h are the only units that fit together",
        "仅角秒、1 s 处的 °/h 与 °/h 相互一致",
    )
    outcomes = [
        Outcome(
            key="unit.Q",
            where="Table 1",
            what=Both(
                "σ(2 ms) if Q of 453z were 0.107°; best: seconds of arc",
                "若 453z 的 Q 为 0.107°，则 σ(2 ms)；最佳：角秒",
            ),
            unit="°/s",
            paper="°",
            faithful=math.sqrt(3.0) * q * RATE,
            faithful_bar=(92.6, 92.8),
            best=math.sqrt(3.0) * q / 3600.0 * RATE,
            reproducible=False,
            reason=why,
        ),
    ]
    for axis, name, stated in ((2, "453z", 569.0), (0, "290x", 143_000.0)):
        outcomes.append(
            Outcome(
                key=f"unit.R.{name}",
                where="Table 1",
                what=Both(
                    f"T at which R in °/√h reaches 0.664 B, {name}; the record allows 110 s",
                    f"{name}：R 取 °/√h 时降至 0.664 B 的 T；记录最长 110 s",
                ),
                unit="s",
                paper="°/√h",
                faithful=float(cross[axis]),
                faithful_bar=(stated * 0.998, stated * 1.002),
                best=float((printed("N")[axis] / level[axis]) ** 2),
                digits=4,
                reproducible=False,
                reason=why,
            )
        )
    outcomes.append(
        Outcome(
            key="unit.B.453z",
            where="Table 1",
            what=Both(
                "T at which the line of R of 453z meets the flat; read at 1 s",
                "453z 的 R 直线与平坦段交点的 T；读取于 1 s",
            ),
            unit="s",
            paper=1.0,
            faithful=float((printed("N")[2] / printed("B")[2]) ** 2),
            faithful_bar=(0.0697, 0.0698),
        )
    )
    return outcomes


def _scattered(scatter: forms.Scatter) -> list[Outcome]:
    """What (7) is worth at 1 s."""
    return [
        Outcome(
            key=f"eq7.{name}",
            where="(7)",
            what=Both(f"scatter of σ(1 s), {en}; faithful: (7)", f"σ(1 s) 的离散度，{zh}；按论文：式（7）"),
            unit="%",
            paper=4.778,
            faithful=100.0 * float(scatter.formula[0]),
            best=100.0 * float(value[0]),
            faithful_bar=(4.775, 4.785),
        )
        for name, en, zh, value in (
            ("white", "white noise, overlapping", "白噪声，重叠", scatter.white),
            ("disjoint", "white noise, disjoint", "白噪声，不重叠", scatter.white_disjoint),
            ("flicker", "flicker, overlapping", "闪烁噪声，重叠", scatter.flicker),
        )
    ]


def _right(scatter: forms.Scatter, records: int) -> Table:
    names = (
        (Both("eq 7", "式（7）"), scatter.formula),
        (Both("overlapping, white, theory", "重叠，白噪声，理论"), scatter.theory),
        (Both("overlapping, white", "重叠，白噪声"), scatter.white),
        (Both("disjoint, white", "不重叠，白噪声"), scatter.white_disjoint),
        (Both("overlapping, flicker", "重叠，闪烁噪声"), scatter.flicker),
    )
    rows = [[name, *(f"{100.0 * v:.2f}" for v in values)] for name, values in names]
    head = (Both("T [s]", "T [s]"), "1", "1.5", "√3", "√10")
    title = Both(
        f"Is eq 7 right? Scatter of σ [%], {records} records of white noise and {records // 2} of flicker",
        f"式（7）是否正确：σ 的离散度 [%]，白噪声 {records} 条、闪烁噪声 {records // 2} 条记录",
    )
    return Table(title, head, rows)


def _misprints(by: dict[str, Outcome]) -> Table:
    """Every printed form, the corrected one, and what each gives."""

    def both(key: str) -> tuple[str, str]:
        outcome = by[key]
        return tuple("-" if v is None else f"{v:#.4g}" for v in (outcome.faithful, outcome.best))  # type: ignore[return-value]

    as_one = Both("names it rate random walk", "称角速率随机游走")
    slope = Both("slope of σ, white noise", "白噪声 σ 斜率")
    rows = [
        [
            "(2)",
            Both("V̄(k+1) − V̄(k), moving", "V̄(k+1) − V̄(k)，滑动"),
            Both("V̄(k+n) − V̄(k), N − 2n + 1 terms", "V̄(k+n) − V̄(k)，N − 2n + 1 项"),
            slope,
            *both("misprint.eq2.moving.slope"),
        ],
        [
            "(1), (2)",
            Both("index nk + i: groups, 2(N − 2n)", "下标 nk + i：分组，2(N − 2n)"),
            Both("index k + i", "下标 k + i"),
            slope,
            *both("misprint.eq2.disjoint.slope"),
        ],
        ["(3)", "T", "t0", Both("measured density over (3)", "实测谱密度与式（3）之比"), *both("eq3.density")],
        ["(4)", "/(πfT)", "/(πfT)²", Both("growth per ln f", "随 ln f 的增长"), *both("eq4.growth")],
        [
            "(5), 6)",
            as_one,
            Both("angle random walk N", "角度随机游走 N"),
            Both("slope; of a rate random walk", "斜率；角速率随机游走"),
            *both("name.white"),
        ],
        ["(6)", "f ≤ f", "f ≤ f0", Both("flat of σ over B", "平坦段 σ 与 B 之比"), "-", both("eq6.flat")[1]],
        [
            "7)",
            Both("B is the flat", "B 为平坦段"),
            Both("flat / 0.664", "平坦段 / 0.664"),
            Both("B over its truth", "B 与真值之比"),
            f"{FLAT:.4g}",
            "1",
        ],
        [
            "1), 4)",
            Both("n up to N/2", "n 至 N/2"),
            Both("N − 2n + 1 terms", "N − 2n + 1 项"),
            Both("terms at N/2", "n = N/2 时项数"),
            *both("allan.last"),
        ],
        [Both("Table 1", "表 1"), "Q [°]", "Q [″]", "σ(2 ms), 453z [°/s]", *both("unit.Q")],
        [
            Both("Table 1", "表 1"),
            "R [°/√h]",
            Both("R [°/h at 1 s]", "R [1 s 处 °/h]"),
            Both("T of the flat, 453z [s]", "453z 平坦段的 T [s]"),
            *both("unit.R.453z"),
        ],
        [Both("Table 1", "表 1"), "B [°/√h]", "B [°/h]", Both("a bias is a rate", "零偏为角速率"), "-", "-"],
        [
            "§1",
            Both("read as unsigned", "按无符号读取"),
            Both("two's complement", "二进制补码"),
            "0xFFFF [°/s]",
            "819.2",
            "−0.0125",
        ],
        [
            "5)",
            Both("rate in counts", "角速率计数"),
            Both("angle in counts", "角度计数"),
            Both("slope of σ", "σ 斜率"),
            *both("quantised.rate"),
        ],
    ]
    head = (
        Both("where", "出处"),
        Both("printed", "原式"),
        Both("corrected", "更正"),
        Both("figure", "指标"),
        Both("as printed", "按原式"),
        Both("corrected", "更正后"),
    )
    return Table(Both("Misprints, each computed both ways", "印刷错误及两种计算结果"), head, rows, words=(1, 2, 3))


def _figure(white: forms.White) -> Figure:
    names = {
        "right": (Both("corrected", "更正后"), SERIES[0], "solid"),
        "moving": (Both("as printed, moving averages", "原式，滑动平均"), SERIES[1], "dashed"),
        "disjoint": (Both("as printed, groups", "原式，分组"), SERIES[2], "dotted"),
    }

    def draw(canvas: "FigureBase") -> None:
        ax = canvas.subplots()
        for reading, (_, colour, dash) in names.items():
            style = {"solid": "-", "dashed": "--", "dotted": ":"}[dash]
            ax.loglog(white.tau, white.dev[reading], color=colour, linestyle=style, linewidth=1.4)
        ax.loglog(white.tau, white.tau**-0.5, color=MUTED, linewidth=0.7)
        for axis in (ax.xaxis, ax.yaxis):
            log_ticks(axis, (1,))
        ax.set_xlabel(Both("averaging time T [s]", "分组时间 T [s]"))
        ax.set_ylabel(Both("σ / N [1/√s]", "σ / N [1/√s]"))

    key = [*names.values(), (Both("truth", "真值"), MUTED, "solid")]
    caption = Both("White noise by the printed and the corrected sum", "白噪声：原式与更正式求和")
    return Figure(caption, draw, key)
