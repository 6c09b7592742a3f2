"""Page of the trackball paper: its parts in the paper's order, with tables, remarks and figures."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.units import deg, from_si, to_deg, to_dps
from plumbob.filters.channel_scalar import steady_gain
from plumbob.papers.trackball import figures, misprints
from plumbob.papers.trackball.recorded import Lapped, apart
from plumbob.papers.trackball.records import AT_REST, IN_MOTION, RATIOS, SAMPLES, STEP
from plumbob.papers.trackball.results import Found
from plumbob.papers.trackball.static import LONG, LONG_TAUS, TAUS, degrees_of_freedom, theory
from plumbob.papers.trackball.turntable import OnTurntable
from plumbob.reporting.content import Table
from plumbob.reporting.report import Report
from plumbob.reporting.scene import Scene
from plumbob.reporting.style import Both

TITLE: Final = Both(
    "Compensation of the drift of MEMS gyroscopes by a Kalman filter (Chen 2013)",
    "基于卡尔曼滤波的 MEMS 陀螺仪漂移补偿（陈晨 2013）",
)
_FREEDOM: Final = Both("degrees of freedom, white noise", "自由度（白噪声）")
_BEFORE: Final = Both("before [°/s]", "滤波前 [°/s]")


def page(found: Found, seed: int) -> Report:
    """The whole page.

    Parameters
    ----------
    found : Found
        What was computed.
    seed : int
        Of the recorded runs.
    """
    counts = found.seeds
    facts = [
        (
            Both("paper", "论文"),
            Both(
                "doi:10.3969/j.issn.1001-4551.2013.03.015",
                "机电工程 2013, 30(3): 311，doi:10.3969/j.issn.1001-4551.2013.03.015",
            ),
        ),
        (
            Both("device", "器件"),
            Both(
                "rig trackball: MPU-3050 at 10 Hz, 131 LSB/(°/s); bytes are emulated, recorded and read back",
                "trackball 模拟装置：MPU-3050，10 Hz，131 LSB/(°/s)；数据以真实字节流产生、记录、读回",
            ),
        ),
        (
            Both("noise", "噪声"),
            Both(
                "assumed: white 0.1 °/s per sample, bias instability 36 °/h",
                "假设：每采样白噪声 0.1 °/s，零偏不稳定性 36 °/h",
            ),
        ),
        (
            Both("statistics", "统计"),
            Both(
                f"simulated directly: {counts['short']} runs at rest, {counts['white']} of white noise, "
                f"{counts['long']} of 4 h, {counts['table']} on the turntable",
                f"直接仿真：静态 {counts['short']} 次，白噪声 {counts['white']} 次，4 h 记录 {counts['long']} 次，转台"
                f" {counts['table']} 次",
            ),
        ),
        (Both("seed", "随机种子"), f"{seed}"),
    ]
    remarks = [
        Both(
            "The Kalman filter of one rate takes white noise off, as the paper shows at rest. It reduces neither the "
            "bias instability nor the error of the integrated angle, which the track of the ball is made of.",
            "单轴角速率的卡尔曼滤波能减小白噪声，这与论文的静态结果一致；但它既不降低零偏不稳定性，也不减小积分角度误"
            "差，而球体轨迹正由积分得到。",
        ),
        Both(
            "On the ramp it lags. What makes the compensated rate more accurate there is the constant that is taken "
            "off.",
            "匀加速时滤波输出滞后；补偿后更准确的原因是去除了常值误差，而不是滤波。",
        ),
        Both(
            "The paper's figures are lost in the text at hand and state no numbers; what it claims of them is "
            "compared in words.",
            "论文插图未能保留且未给出数值，因此只与其文字结论比较。",
        ),
    ]
    parts = [
        _drift(found),
        _rest(found),
        _allan(found),
        _composition(found),
        _turntable(found),
        _ball(found),
        _switched(found),
    ]
    return Report(TITLE, facts=facts, remarks=remarks, parts=parts)


def _drift(run: Found) -> Report:
    rows = [
        [
            f"{part:+.2f}".replace("-", "−"),
            *(f"{to_dps(value):.3f}" for value in (warmed.raw, warmed.printed, warmed.own)),
            f"{to_dps(warmed.coefficient):+.4f}",
        ]
        for part, warmed in run.parts.items()
    ]
    parts = Table(
        Both(
            "Mean rate at rest at 45 °C, of parts whose bias was taken off at 25 °C [°/s]",
            "25 °C 去零偏后，45 °C 静止时的平均角速率 [°/s]",
        ),
        (
            Both("true coefficient [°/s/°C]", "真实系数 [°/s/°C]"),
            Both("measured", "未补偿"),
            Both("(3): 0.1 for all", "式（3）：统一取 0.1"),
            Both("own card", "本机标定卡"),
            Both("coefficient found", "求得系数"),
        ),
        rows,
    )
    soak = run.soaked
    ways = (
        (Both("measured", "未补偿"), soak.raw),
        (Both("(3): 0.1 for all", "式（3）：统一取 0.1"), soak.printed),
        (Both("own card of this soak", "由本次温升求得的标定卡"), soak.own),
    )
    recorded = Table(
        Both("Recorded soak of an hour, by 20 K: what is left at its end [°/s]", "实录 1 h、升温 20 K：末段剩余 [°/s]"),
        ("", "x", "y", "z"),
        [[name, *(f"{value:.3f}" for value in to_dps(change))] for name, change in ways],
    )
    return Report(
        Both("1  Drift model", "1  陀螺漂移模型建立"),
        facts=[
            (
                Both("model", "模型"),
                Both(
                    "N = A0 + k_T (T − 25 °C) + B ω + k_a a;  ω = measured − N",
                    "N = A0 + k_T (T − 25 °C) + B ω + k_a a；ω = 测量值 − N",
                ),
            ),
            (
                Both("by hand", "操作"),
                "plumbob run turn.mcap --filter scalar --drift chen2013 --rest 0s..100s --out rates.parquet",
            ),
        ],
        tables=[parts, recorded],
        remarks=[
            Both(
                "0.1 °/s/°C is the size of the type's coefficient. Taken off where the part has another one, it "
                "makes the rate worse than no compensation. 'plumbob calibrate temperature' finds that of each axis.",
                "0.1 °/s/°C 只是该型号系数的量级。器件的实际系数不同时，按 0.1 补偿反而比不补偿更差；“plumbob "
                "calibrate temperature” 可逐轴标定。",
            ),
            Both(
                "The rig has no accelerometer, as the paper names none: at rest and on a level table the term of the "
                "specific force is constant and goes with the constant error. Where one was recorded, it is taken "
                "off by a 3×3 matrix.",
                "装置中没有加速度计（论文也未提及）：静止和水平转台上比力项为常数，随常值误差一并去除；若记录了加速"
                "度，则以 3×3 矩阵补偿。",
            ),
        ],
    )


def _rest(run: Found) -> Report:
    rows = [
        [f"{q:g}", f"{steady_gain(q):.4f}", f"{theory(q):.5f}", f"{white:.5f}", f"{variance:.5f}", f"{angle:.2f}"]
        for q, white, variance, angle in zip(RATIOS, run.white, run.short.variance, run.short.angle, strict=True)
    ]
    table = Table(
        Both(
            f"At rest, {SAMPLES} samples: variance and integrated angle after/before, by Q/R",
            f"静态 {SAMPLES} 点：滤波后/前的方差与积分角度之比（按 Q/R）",
        ),
        (
            "Q/R",
            "K",
            "K/(2−K)",
            Both("white noise", "白噪声"),
            Both("this record", "本记录"),
            Both("angle, rms", "角度均方根"),
        ),
        rows,
    )
    constant = ", ".join(f"{value:.2f}".replace("-", "−") for value in to_dps(run.rest.raw.mean(axis=0)))
    return Report(
        Both("2  Bias at rest and the Kalman filter", "2  陀螺仪零点漂移分析与补偿"),
        facts=[(Both("constant error J", "常值误差 J"), f"{constant} °/s")],
        tables=[table],
        remarks=[
            Both(
                "Any small Q/R makes the sequence converge: the filter is a low-pass of the first order, no more. "
                "The angle keeps its error.",
                "只要 Q/R 足够小，序列都会“收敛”：该滤波器只是一阶低通；积分角度误差不变。",
            )
        ],
        figures=figures.rest_figures(run.rest),
    )


def _allan(run: Found) -> Report:
    def table(title: Both, taus: Sequence[float], count: int, before: Sequence[float], ratios: Floats) -> Table:
        rows = [
            [_FREEDOM, *(f"{degrees_of_freedom(count, tau):.1f}" for tau in taus)],
            [_BEFORE, *(f"{to_dps(value):.4f}" for value in before)],
            *([f"Q/R = {q:g}", *(f"{value:.3f}" for value in row)] for q, row in zip(RATIOS, ratios, strict=True)),
        ]
        return Table(title, ("τ [s]", *(f"{tau:g}" for tau in taus)), rows)

    short = table(
        Both("Allan deviation after/before, records of 100 s", "Allan 值滤波后/前之比，100 s 记录"),
        TAUS,
        SAMPLES,
        run.short.before.tolist(),
        run.short.adev,
    )
    long = table(
        Both("4 h at rest, with a random walk of the bias besides", "静置 4 h（另含零偏随机游走）"),
        LONG_TAUS,
        round(LONG / STEP),
        run.long.before.tolist(),
        run.long.adev,
    )
    return Report(
        Both("Allan variance", "Allan 方差分析"),
        tables=[short, long],
        remarks=[
            Both(
                f"Over four hours Q/R = {AT_REST:g} leaves {100 * run.long.adev[2, 3]:.1f} % of the Allan deviation "
                "at 100 s and all of it at 600 s: the bias instability is not reduced.",
                f"4 h 记录中，Q/R = {AT_REST:g} 时 100 s 处的 Allan 值仍保留 {100 * run.long.adev[2, 3]:.1f} %，600 "
                "s 处完全不变：零偏不稳定性没有降低。",
            ),
            Both(
                "In a record of 100 s, one difference is left at 50 s; its relative standard deviation is "
                f"{run.short.scatter[-1]:.2f}, so that a single pair of records may show any ratio there.",
                f"100 s 的记录在 50 s 处只有一个差分，相对标准差 {run.short.scatter[-1]:.2f}，单次对比在该处可出现任"
                "意比值。",
            ),
        ],
        figures=[figures.allan_figure(run.rest, run.short)],
    )


_TERMS: Final = (
    Both("A₋₂ = 3Q², quantization", "A₋₂ = 3Q²，量化噪声"),
    Both("A₋₁ = N², angle random walk", "A₋₁ = N²，角随机游走"),
    Both("A₀ = (2 ln 2/π) B², bias instability", "A₀ = (2 ln 2/π) B²，零偏不稳定性"),
    Both("A₁ = K²/3, rate random walk", "A₁ = K²/3，速率随机游走"),
    Both("A₂ = R²/2, rate ramp", "A₂ = R²/2，速率斜坡"),
)


def _composition(run: Found) -> Report:
    scale = to_dps(to_dps(1.0))
    rows = [
        [name, f"{plain * scale:.2e}", f"{weighted * scale:.2e}"]
        for name, plain, weighted in zip(_TERMS, run.fit.plain, run.fit.weighted, strict=True)
    ]
    table = Table(
        Both(
            "Coefficients of (14), record of x before the filter [(°/s)² · s⁻ⁿ]",
            "式（14）各系数，滤波前 x 轴记录 [(°/s)² · s⁻ⁿ]",
        ),
        ("", Both("plain", "普通最小二乘"), Both("weighted, ≥ 0", "加权非负")),
        rows,
    )
    return Report(
        Both("Composition of the noise", "噪声组成成分"),
        facts=[
            (
                Both("of 4 h", "4 h 记录"),
                f"N = {from_si(run.long.white, 'deg/rth'):.3f} °/√h, B = {from_si(run.long.flicker, 'deg/h'):.1f} °/h",
            ),
        ],
        tables=[table],
        remarks=[
            Both(
                "Plain least squares of five powers on eight times gave a negative coefficient in "
                f"{100 * run.negative[0]:.0f} % of {run.seeds['short']} records; weighted by degrees of freedom "
                f"and held at or above zero, in {100 * run.negative[1]:.0f} %.",
                f"{run.seeds['short']} 次记录中，普通最小二乘出现负系数的占 {100 * run.negative[0]:.0f} %；按自由"
                f"度加权并约束非负后为 {100 * run.negative[1]:.0f} %。",
            ),
            Both(
                "The paper's list names the rate random walk (RRW) twice; the second one is the rate ramp (RR). "
                "Sinusoidal noise is not a power of τ: 'plumbob allan' finds it as a line of the spectrum. No "
                "coefficient may be read off a curve that a filter has bent.",
                "论文列表中“RRW”出现两次，第二个应为速率斜坡（RR）；正弦噪声不是 τ 的幂次，“plumbob allan” 以谱线形式"
                "识别。滤波后弯曲的曲线上不能读取系数。",
            ),
        ],
        figures=[figures.fit_figure(run.fit)],
    )


_HEAD: Final = (
    "",
    Both("ramp, rms", "匀加速均方根"),
    Both("constant, rms", "匀速均方根"),
    Both("after 5 s", "5 s 之后"),
    Both("ramp, mean", "匀加速均值"),
    Both("constant, mean", "匀速均值"),
    Both("lag", "滞后"),
    Both("in theory", "理论值"),
    Both("angle [°]", "角度 [°]"),
)
_NAMES: Final = {"measured": "补偿前", "bias removed": "去除常值误差", "two states": "双状态滤波"}


def _named(name: str) -> str:
    if name in _NAMES:
        return Both(name, _NAMES[name])
    return Both(name, name.replace("scalar", "标量").replace("average of", "滑动平均，点数"))


def _row(row: OnTurntable) -> list[str]:
    rates = (row.ramp_rms, row.hold_rms, row.late_rms, row.ramp_mean, row.hold_mean, row.lag, row.lag_theory)
    return [_named(row.name), *(f"{round(to_dps(value), 3) + 0.0:.3f}" for value in rates), f"{to_deg(row.angle):.2f}"]


def _turntable(run: Found) -> Report:
    tables = [
        Table(
            Both(
                f"Turntable, 0 to 60 °/s in 100 s, then held; bias 1.5 °/s, gain wrong by {100 * scale:.0f} % [°/s]",
                f"转台：100 s 加速至 60 °/s，然后匀速；零偏 1.5 °/s，刻度误差 {100 * scale:.0f} % [°/s]",
            ),
            _HEAD,
            [_row(row) for row in rows.values()],
        )
        for scale, rows in run.table.items()
    ]
    end = {name: abs(float(to_deg(error[SAMPLES - 1]))) for name, error in run.turned.headings.items()}
    behind = end["calibrated, paper's filter"]
    return Report(
        Both("3  Turntable", "3  陀螺仪漂移补偿模型的实验验证"),
        tables=tables,
        remarks=[
            Both(
                "Every scalar filter of the table, and the moving average of the same bandwidth beside it, is worse "
                f"on the ramp than the rate without any filter; the best gain, K = {run.gain[0]:.2f}, leaves "
                f"{to_dps(run.gain[1]):.3f} °/s. The filter with two states has no lag.",
                f"匀加速时，表中所有标量滤波器以及同带宽的滑动平均都比不滤波更差；最佳增益 K = {run.gain[0]:.2f} 时"
                f"为 {to_dps(run.gain[1]):.3f} °/s。双状态（角速率、角加速度）滤波器没有滞后。",
            ),
            Both(
                "The axis of rotation is the rig's z axis; the paper names x.", "模拟装置的转轴为 z 轴，论文记为 x 轴。"
            ),
            Both(
                "An error of the gain passes every filter: 1 % is 0.6 °/s at 60 °/s. On the ramp a lag hides a part "
                "of it, which looks like an improvement. A rate table finds the gain, on another record than the one "
                "that is scored.",
                "刻度误差不受任何滤波影响：1 % 在 60 °/s 时为 0.6 °/s；匀加速时滞后抵消其一部分，看似改进。刻度须用速"
                "率转台另行标定，不能用被评价的记录。",
            ),
            Both(
                "Recorded run: the lag stands in the attitude. At the end of the ramp the heading that an attitude "
                f"filter makes of the filtered rate (Q/R = {IN_MOTION:g}) is {behind:.0f}° behind, of the unfiltered "
                f"one {end['calibrated']:.1f}°.",
                f"实录一次：滞后直接体现在姿态上。匀加速结束时，由滤波后角速率（Q/R = {IN_MOTION:g}）积分得到的航向落"
                f"后 {behind:.0f}°，不滤波时为 {end['calibrated']:.1f}°。",
            ),
        ],
        figures=[*figures.turn_figures(run.turned), figures.lag_figure(run.turned)],
    )


_TRACKS: Final = {
    "measured": Both("as measured", "补偿前"),
    "compensated": Both("paper's drift model and constant, not filtered", "论文漂移模型并去常值，不滤波"),
    "paper": Both("paper's drift model, constant and filter", "论文漂移模型、去常值并滤波"),
    "calibrated": Both("card of a rate table, not filtered (best)", "速率转台标定卡，不滤波（最佳）"),
    "calibrated, paper's filter": Both("card, paper's filter", "标定卡，论文滤波"),
    "best": Both("card, two states", "标定卡，双状态滤波"),
}


def _ball(run: Found) -> Report:
    tracks = run.lapped.tracks
    rows = []
    for name, shown in _TRACKS.items():
        off = to_deg(apart(tracks[name], tracks["true"]))
        rows.append([shown, *(f"{v:.1f}" for v in (np.sqrt(np.mean(off**2)), off.max(), off[-1]))])
    table = Table(
        Both("Error of the point that touches the lower plate, over 100 s [°]", "接触点在球面上的位置误差，100 s [°]"),
        ("", Both("rms", "均方根"), Both("largest", "最大"), Both("at the end", "末尾")),
        rows,
    )
    return Report(
        Both("The ball's track on its sphere", "轨迹球的球面轨迹"),
        facts=[
            (
                Both("motion", "运动"),
                Both(
                    "rolls at 60 °/s about its x axis, which leans by ±60° in 50 s; at rest before",
                    "绕自身 x 轴以 60 °/s 滚动，该轴在 50 s 内倾斜 ±60°；之前静止",
                ),
            )
        ],
        tables=[table],
        remarks=[
            Both(
                "The paper's application is this track, of which it shows nothing. Rates are integrated to an "
                "attitude, and the point that touches the plate is the vertical in axes of the ball. Integration "
                "smooths by itself: what helps is calibration, and a filter of the rates only adds its lag.",
                "这条轨迹正是论文的应用目标，但论文未给出。角速率积分得到姿态，接触点即竖直方向在球体坐标系中的指向。"
                "积分本身就是平滑：有效的是标定，对角速率滤波只会引入滞后。",
            )
        ],
        figures=[figures.ball_figure(run.lapped)],
        scenes=[_scene(run.lapped)],
    )


def _scene(lapped: Lapped) -> Scene:
    """The touching point on a ball of three circles: true, and, pale, by the paper's compensation and filter."""
    rows = slice(None, None, 2)
    t, true, paper = lapped.t[rows], lapped.tracks["true"][rows], lapped.tracks["paper"][rows]
    points = {"o": np.zeros((t.size, 3)), Both("true", "真实"): true}
    lines = [("o", "true")]
    turn = deg(np.arange(0.0, 360.0, 30.0))
    flat = np.stack((np.cos(turn), np.sin(turn), np.zeros(turn.size)), axis=1)
    for k, columns in enumerate(((0, 1, 2), (0, 2, 1), (2, 0, 1))):  # the circles in the planes of the axes
        names = [f".{k}.{i}" for i in range(turn.size)]
        points |= {name: np.tile(at, (t.size, 1)) for name, at in zip(names, flat[:, columns], strict=True)}
        lines += list(zip(names, [*names[1:], names[0]], strict=True))
    return Scene(
        Both(
            "Touching point on the ball: true, and, pale, by the paper's compensation and filter",
            "球面上的接触点：真实；浅色为论文补偿与滤波",
        ),
        t,
        points,
        lines,
        trail="true",
        values={Both("apart", "相差"): to_deg(apart(paper, true))},
        shadow={"o": points["o"], "true": paper},
    )


def _switched(run: Found) -> Report:
    printed, matrix = run.printed, run.matrix
    before, after = misprints.gain_error()
    plane, along = misprints.axis_in_the_plane(1)
    some, other = run.parts.values()
    card = max(abs(to_dps(part.own)) for part in (some, other))
    eq3, raw = (
        [f"{to_dps(value):.2f}".replace("-", "−") for value in pair]
        for pair in ((some.printed, other.printed), (some.raw, other.raw))
    )
    metres, twice, share = to_dps(misprints.in_metres()), to_dps(misprints.counted_twice()), 100 * run.negative[0]
    first, then, mean = (to_dps(value) for value in printed)
    nothing = "-"
    rows: list[list[str]] = [
        [
            "(2)",
            Both("last term ΔA_i for all axes", "最后一项写作 ΔA_i"),
            Both("ΔA_t, the temperature, common to all axes", "应为温度漂移 ΔA_t，三轴共用"),
            nothing,
        ],
        [
            "(3)",
            Both("0.1 °/s/°C for every part", "所有器件统一取 0.1 °/s/°C"),
            Both("a coefficient of each part and axis", "逐件逐轴的系数"),
            Both(
                f"{eq3[0]} and {eq3[1]} °/s left at 45 °C, uncompensated {raw[0]} and {raw[1]}, own card ≤ {card:.4f}",
                f"45 °C 剩余 {eq3[0]}、{eq3[1]} °/s；未补偿 {raw[0]}、{raw[1]}；本机标定卡 ≤ {card:.4f}",
            ),
        ],
        [
            "(4)",
            Both("0.1 a along each axis", "每轴 0.1 a"),
            Both("3×3 matrix; a in g", "3×3 矩阵；a 以 g 计"),
            Both(
                f"{to_dps(matrix[0]):.3f} °/s rms left on six faces; with a in m/s² {metres:.2f} °/s too much at 1 g",
                f"六面剩余 {to_dps(matrix[0]):.3f} °/s；a 以 m/s² 代入时 1 g 处多 {metres:.2f} °/s",
            ),
        ],
        [
            "(5)",
            Both("A_x, which holds temperature and i", "A_x（已含温度与随机误差）"),
            "A_x0",
            Both(
                f"temperature is taken off twice: −{abs(twice):.1f} °/s at 45 °C",
                f"温度被补偿两次：45 °C 时 −{abs(twice):.1f} °/s",
            ),
        ],
        [
            "(5)",
            "B_x = 0",
            Both("gain of each unit, from a rate table", "速率转台标定的刻度因子"),
            Both(
                f"1 % is {to_dps(before):.2f} °/s at 60 °/s, after the filter {to_dps(after):.2f}",
                f"1 % 在 60 °/s 时为 {to_dps(before):.2f} °/s，滤波后仍为 {to_dps(after):.2f}",
            ),
        ],
        [
            "(13)",
            "Σ η̄²",
            "Σ (η̄ⱼ₊₁ − η̄ⱼ)²",
            Both(
                f"white noise {first:.4f} instead of {then:.4f} °/s; with a mean of 1.5 °/s {mean:.2f}",
                f"白噪声 {first:.4f}（应为 {then:.4f}）°/s；含 1.5 °/s 均值时 {mean:.2f}",
            ),
        ],
        [
            "(14)",
            Both("plain least squares", "普通最小二乘"),
            Both("weighted, none below zero", "加权非负最小二乘"),
            Both(f"negative coefficients in {share:.0f} % of the records", f"{share:.0f} % 的记录出现负系数"),
        ],
        [
            "§2",
            Both("RRW twice; sinusoidal noise as a power of τ", "RRW 出现两次；正弦噪声当作幂次"),
            Both("rate ramp (RR); a line of the spectrum", "速率斜坡（RR）；谱线"),
            nothing,
        ],
        ["§1", "131 Lbs/(s), 0.1 °s/°C", "131 LSB/(°/s), 0.1 °/s/°C", nothing],
        [
            "§3",
            Both("x parallel to the table's plane", "x 轴与转台平面平行"),
            Both("parallel to the axis of rotation", "与转轴平行"),
            Both(f"it would measure {plane:.1f} instead of {along:.1f} °/s", f"测得 {plane:.1f} 而非 {along:.1f} °/s"),
        ],
    ]
    table = Table(
        Both("As printed, as it must be, and what the printed form gives", "原式、更正及原式的后果"),
        (Both("where", "出处"), Both("as printed", "原式"), Both("corrected", "更正"), Both("what it gives", "后果")),
        rows,
        words=(1, 2, 3),
    )
    return Report(Both("Misprints", "勘误"), tables=[table])
