"""Every figure of the buoy paper, with its bars [Yu2018]."""

import math
from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import from_si, to_deg, to_dps
from plumbob.filters import mahony
from plumbob.papers.buoy.as_printed import RATES, Misprints, loop
from plumbob.papers.buoy.bench import KEPT, CalibratedUnit, Sailed, Slid
from plumbob.papers.buoy.device import PERIODS, Device
from plumbob.papers.buoy.figures import ANGLE
from plumbob.papers.buoy.modules import STEP, WIDE_STEP, ModuleStatistics, Refused
from plumbob.papers.buoy.static_test import ANGLES, StaticTest
from plumbob.papers.buoy.trials import SETTLE, STROKES, bound
from plumbob.papers.outcome import Outcome, at_least, at_most
from plumbob.reporting.style import Both

FIRST: Final = STROKES[0]
"""The set of strokes that the bars of the gate are about."""
KPS: Final = (0.1, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5)
"""Gains of the scan, 1/s."""
SCANNED: Final = ((3.0, 0.8), (1.5, 0.6))
"""Its strokes, m/s and s."""


_FIG: Final = {number: Both(f"Fig {number}", f"图 {number}") for number in (4, 7, 8)}


class Results(NamedTuple):
    """All that the run found.

    Attributes
    ----------
    unit : CalibratedUnit
        The unit that goes through bytes.
    device : Device
        Its own program.
    static : (StaticTest, StaticTest)
        Beside the DCM260B, with the paper's card and the best one.
    slid : mapping of (float, float) to Slid
        By strokes.
    sailed : Sailed
        At sea.
    rings : mapping of str to ModuleStatistics
        Static test of many modules, by row.
    refused : mapping of str to Refused
        Captures that calibrate nothing.
    slides : mapping of (float, float) to mapping of str to ndarray (seeds, 2)
        Largest roll and pitch, deg, of many units, by strokes and contender.
    sea : mapping of str to ndarray (seeds, 3)
        Rms of roll, pitch and yaw, deg, of several units, by contender.
    scan : mapping of (float, float) to ndarray (gains, 2, 2)
        Largest roll and pitch, deg, by strokes and Kp, without the gate and with it.
    strongest : float
        Largest roll of any stroke to 3 m/s with Kp 0.5 and without the gate, deg.
    misprints : Misprints
        What printed forms give.
    modules : int
        How many were turned on the table.
    """

    unit: CalibratedUnit
    device: Device
    static: tuple[StaticTest, StaticTest]
    slid: Mapping[tuple[float, float], Slid]
    sailed: Sailed
    rings: Mapping[str, ModuleStatistics]
    refused: Mapping[str, Refused]
    slides: Mapping[tuple[float, float], Mapping[str, Floats]]
    sea: Mapping[str, Floats]
    scan: Mapping[tuple[float, float], Floats]
    strongest: float
    misprints: Misprints
    modules: int


def outcomes(found: Results) -> list[Outcome]:
    """Every figure, in the order of the paper."""
    return [
        *_design(found),
        *_boot(found),
        *_events(found.device),
        *_capture(found),
        *_static(found),
        *_modules(found),
        *_slide(found),
        *_sea(found),
        _claim(found),
        *_literal(found),
    ]


def sea_rms(sailed: Sailed, name: str) -> Floats:
    """Rms of roll, pitch and yaw, deg, (3,), once a minute has passed."""
    errors = sailed.errors[name][sailed.t >= SETTLE]
    return np.asarray(np.sqrt(np.mean(errors**2, axis=0))[::-1])


def _design(results: Results) -> Iterator[Outcome]:
    """Constants that the paper states, as the filter and the simulated parts have them."""
    params = mahony.Params()
    assert params.gate is not None
    pairs = (
        ("kp", "§1.3", Both("proportional gain Kp", "比例系数 Kp"), "1/s", 0.5, params.kp),
        ("ki", "§1.3", Both("integral gain Ki", "积分系数 Ki"), "1/s²", 0.03, params.ki),
        ("gate", "(15)", Both("gate ε, read in g", "阀值 ε（单位取 g）"), "g", 0.08, params.gate / G0),
    )
    for key, where, what, unit, paper, value in pairs:
        exact = (paper - 1e-12, paper + 1e-12)
        yield Outcome(key=key, where=where, what=what, unit=unit, paper=paper, faithful=value, faithful_bar=exact)
    yield Outcome(
        key="mag.step", where="§2.1", what=Both("step of the magnetometer at ±8 Ga", "磁阻传感器 ±8 Ga 时的分辨率"),
        unit="mG", paper=0.73, faithful=float(from_si(WIDE_STEP, "mgauss")), reproducible=False,
        reason=Both(
            "0.73 mG belongs to ±0.88 Ga; at ±8.1 Ga the part has 4.35 mG",
            "0.73 mG 对应 ±0.88 Ga；±8.1 Ga 时为 4.35 mG"
        ),
    )  # fmt: skip


def _boot(results: Results) -> Iterator[Outcome]:
    """The start of the slide: what is removed of the rates, what it would do, and the first attitude."""
    slid, gyr = results.slid[FIRST], results.unit.paper.gyr
    assert gyr is not None
    bias = float(to_dps(np.abs(gyr.bias).max()))
    yield Outcome(
        key="boot.bias",
        where="§1.2",
        unit="°/s",
        faithful=bias,
        what=Both("zero-rate output that is removed at the start, largest axis", "启动时去除的陀螺零偏（最大轴）"),
    )
    tilt = float(np.abs(slid.errors[KEPT][:, 1:]).max())
    yield Outcome(
        key="boot.kept",
        where="§1.2",
        unit="°",
        faithful=tilt,
        what=Both("largest roll or pitch where it is kept", "不去除零偏时横滚、俯仰最大误差"),
    )
    first = (float(np.abs(slid.errors[name][0, 1:]).max()) for name in ("gate 0.08 g", "mekf"))
    faithful, best = first
    yield Outcome(
        key="boot.first",
        where="§1.2",
        unit="°",
        paper="≤ 5",
        faithful=faithful,
        best=best,
        faithful_bar=at_most(5.0),
        best_bar=at_most(1.2),
        what=Both(
            "roll or pitch error of the initial attitude, from one reading", "初始姿态横滚、俯仰误差（单次测量）"
        ),
    )


def _events(device: Device) -> Iterator[Outcome]:
    names = {
        "sample": Both("sampling events served", "采样事件频率"),
        "fuse": Both("attitude fusion", "姿态解算速率"),
        "send": Both("attitude on the line", "姿态信息串口输出速率"),
    }
    for task, what in names.items():
        rate = 1000.0 / PERIODS[task]
        paper: float | str = "3 ms" if task == "sample" else rate
        bar = (0.998 * rate, 1.002 * rate)
        yield Outcome(key=f"rate.{task}", where="§2.2", what=what, unit="Hz", paper=paper,
                      faithful=device.rates[task], faithful_bar=bar, digits=4)  # fmt: skip
    yield Outcome(
        key="events.missed", where=_FIG[4], what=Both("events missed", "未处理事件数"), unit="", faithful=float(
            sum(device.missed.values())), faithful_bar=(0.0, 0.0),
    )  # fmt: skip
    yield Outcome(
        key="events.idle", where=_FIG[4], what=Both("share of time in low power", "低功耗时间占比"), unit="%",
        faithful=100.0 * device.idle,
    )  # fmt: skip
    yield Outcome(
        key="log.same", where="§2.1", what=Both("records that the Flash log gives back to the bit",
                                                "Flash 存储逐位一致"),
        unit="%", faithful=100.0 * device.same, faithful_bar=at_least(100.0),
    )  # fmt: skip
    yield Outcome(
        key="log.years", where="§0", what=Both("life of the log at 20 Hz", "Flash 寿命（20 Hz）"), unit=Both("years",
                                                                                                             "年"),
        paper="≤ 1", faithful=device.years, faithful_bar=at_least(1.0),
    )  # fmt: skip
    for axis, limit in (("roll", 3.3), ("pitch", 2.7)):
        yield Outcome(
            key=f"device.{axis}", where=_FIG[8], paper=limit, unit="°", faithful=getattr(device, axis),
            faithful_bar=at_most(limit),
            what=Both(f"largest {axis} on the line at 20 Hz, gated", f"20 Hz 输出最大{ANGLE[axis].zh}误差（阀值）"),
        )  # fmt: skip


def _capture(results: Results) -> Iterator[Outcome]:
    yield Outcome(
        key="regions", where="§3.1", what=Both("regions of the capture that are filled", "已覆盖区域数"), unit="",
        paper=18.0, faithful=float(results.unit.regions), faithful_bar=(18.0, 18.0),
    )  # fmt: skip
    yield Outcome(
        key="fewest", where="§3.1", what=Both("fewest readings that determine the fit",
                                              "拟合所需最少测量组数"), unit="",
        paper=6.0, faithful=float(_fewest(results.unit.mag)), faithful_bar=(6.0, 6.0),
    )  # fmt: skip
    names = {
        "ring": Both("level ring", "水平旋转"),
        "unit": Both("cone, the unit tilted by 15°", "锥面（模块倾斜 15°）"),
        "table": Both("cone, the table tilted by 15°", "锥面（转台倾斜 15°）"),
    }
    for key, name in names.items():
        refused = results.refused[key]
        yield Outcome(
            key=f"refused.{key}", where="§3.1", unit="%", faithful=100.0 * refused.failed, best=100.0 * refused.rightly,
            best_bar=at_least(100.0), what=Both(f"capture refused: {name}", f"退化采集被拒绝：{name.zh}"),
        )  # fmt: skip


def _fewest(mag: Floats) -> int:
    """Least count of readings with which the matrix of equation (12) has rank six."""
    x, y, z = (mag / np.abs(mag).max()).T
    rows = np.column_stack((-y * y, -z * z, 2.0 * x, 2.0 * y, 2.0 * z, np.ones_like(x)))  # [Yu2018] (12)
    return next(n for n in range(1, len(rows) + 1) if np.linalg.matrix_rank(rows[:n]) == rows.shape[1])


def _static(results: Results) -> Iterator[Outcome]:
    paper, best = results.static
    for name in ANGLES:
        before, after, ours = (to_deg(e.stats[name].max_abs) for e in (paper.before, paper.after, best.after))
        zh = ANGLE[name].zh
        yield Outcome(key=f"static.before.{name}", where=_FIG[7], unit="°", faithful=before,
                      what=Both(f"largest {name} error before compensation", f"补偿前{zh}最大偏差"))  # fmt: skip
        yield Outcome(
            key=f"static.after.{name}", where=_FIG[7], unit="°", paper="≤ 5", faithful=after, best=ours,
            faithful_bar=at_most(5.0), best_bar=at_most(2.5 if name == "yaw" else 1.0),
            what=Both(f"largest {name} error after compensation, beside DCM260B", f"补偿后{zh}最大偏差（对 DCM260B）"),
        )  # fmt: skip


def _modules(results: Results) -> Iterator[Outcome]:
    rings = results.rings
    titles = {
        "pitch": Both("3 bands of pitch × 6 of heading", "3 俯仰带 × 6 航向扇区"),
        "roll": Both("3 bands of roll × 6 of heading", "3 横滚带 × 6 航向扇区"),
        "faces": Both("6 faces + 12 edges", "6 面 + 12 棱"),
    }
    for capture, title in titles.items():
        yield Outcome(
            key=f"modules.yaw.{capture}", where="§4.2", unit="°", paper="≤ 5", faithful=rings[capture].yaw95,
            best=rings[f"{capture}, chosen"].yaw95, faithful_bar=at_most(2.5), best_bar=at_most(2.5),
            what=Both(f"yaw that 95 % of random modules keep: {title}", f"95 % 随机模块的航向角偏差上限：{title.zh}"),
        )  # fmt: skip
    yield Outcome(
        key="modules.level", where="§4.2", unit="°", paper="≤ 5", faithful=rings["faces"].level95,
        best=rings["faces, chosen"].level95, faithful_bar=at_most(1.0), best_bar=at_most(1.0),
        what=Both("roll and pitch that 95 % of random modules keep: 6 faces + 12 edges",
                  "95 % 随机模块的横滚、俯仰角偏差上限：6 面 + 12 棱"),
    )  # fmt: skip
    yield Outcome(
        key="modules.all5", where="§5", unit="%", paper=100.0, faithful=100.0 * rings["faces"].all5,
        best=100.0 * rings["faces, chosen"].all5, faithful_bar=at_least(95.0), best_bar=at_least(95.0),
        what=Both("random modules whose three angles keep 5°", "三轴偏差均在 5° 以内的随机模块占比"),
    )  # fmt: skip
    yield Outcome(
        key="modules.iron", where="§3.1", unit="°", faithful=rings["c 0.1"].yaw95, best=rings["c 0.1, general"].yaw95,
        best_bar=at_most(5.0),
        what=Both("yaw that 95 % keep with soft iron c = 0.10 across the axes: 6 parameters, general fit",
                  "软铁交叉项 c = 0.10 时 95 % 模块的航向角偏差：6 参数、一般椭球"),
    )  # fmt: skip
    yield Outcome(
        key="modules.alone", where="§4.2", unit="°", faithful=rings["magnetometer alone"].yaw95,
        what=Both("yaw that 95 % keep with the magnetometer alone calibrated",
                  "仅校准磁阻传感器时 95 % 模块的航向角偏差"),
    )  # fmt: skip


_TOO_WEAK: Final = Both(
    "at most Kp v/g of inclination is fed in, so 9.6° with 6.1° needs 3.9 m/s on a desk at Kp 0.5, or Kp of 1 to 1.5",
    "可注入的倾角不超过 Kp·v/g，Kp = 0.5 时 9.6° 与 6.1° 需桌面速度 3.9 m/s，或 Kp 为 1 至 1.5",
)


def _slide(results: Results) -> Iterator[Outcome]:
    first, slid = results.slides[FIRST], results.slid[FIRST]
    printed = {"roll": (9.6, 3.3), "pitch": (6.1, 2.7)}
    for column, (axis, (free, gated)) in enumerate(printed.items()):
        zh = ANGLE[axis].zh
        open_, shut, new = (first[name][:, column] for name in ("no gate", "gate 0.08 g", "mekf"))
        yield Outcome(
            key=f"slide.open.{axis}", where=_FIG[8], unit="°", paper=free, faithful=float(np.median(open_)),
            reproducible=False, reason=_TOO_WEAK, what=Both(f"largest {axis} without the gate",
                                                            f"未经阀值滤波最大{zh}误差"),
        )  # fmt: skip
        yield Outcome(
            key=f"slide.gated.{axis}", where=_FIG[8], unit="°", paper=gated, faithful=float(shut.max()),
            best=float(new.max()), faithful_bar=at_most(gated), best_bar=at_most(1.2),
            what=Both(f"largest {axis} with the gate, any unit", f"阀值滤波后最大{zh}误差（全部模块）"),
        )  # fmt: skip
        yield Outcome(
            key=f"slide.reduction.{axis}", where=_FIG[8], unit="%", paper=100.0 * (1.0 - gated / free),
            faithful=float(np.median(100.0 * (1.0 - shut / open_))), faithful_bar=at_least(60.0),
            what=Both(f"{axis} that the gate takes away, median", f"阀值滤波对{zh}误差的削减（中位数）"),
        )  # fmt: skip
        largest = {name: slid.largest(name)[column] for name in ("no gate", "gate 0.08 g", "mekf")}
        yield Outcome(
            key=f"slide.unit.{axis}", where=_FIG[8], unit="°", paper=gated, faithful=largest["gate 0.08 g"],
            best=largest["mekf"], faithful_bar=at_most(gated), best_bar=at_most(1.2),
            what=Both(f"largest {axis} with the gate, the unit through bytes (without: {largest['no gate']:.2f}°)",
                      f"阀值滤波后最大{zh}误差，经字节流的模块（未滤波 {largest['no gate']:.2f}°）"),
        )  # fmt: skip
    for speed, stroke in STROKES:
        each = results.slides[speed, stroke]
        yield Outcome(
            key=f"slide.new.{speed:g}-{stroke:g}", where="§4.3", unit="°", faithful=float(each["gate 0.08 g"].max()),
            best=float(each["mekf"].max()), best_bar=at_most(1.2),
            what=Both(f"largest roll or pitch of any unit, strokes of {speed:g} m/s and {stroke:g} s",
                      f"最大横滚或俯仰角误差，行程 {speed:g} m/s、{stroke:g} s"),
        )  # fmt: skip
    yield Outcome(
        key="slide.bound", where="§4.3", unit="°", faithful=results.strongest,
        faithful_bar=at_most(round(bound(3.0), 2)), paper=9.6,
        reproducible=False, reason=_TOO_WEAK,
        what=Both(f"largest roll of any stroke to 3 m/s at Kp 0.5 (Kp v/g: {bound(3.0):.1f}°)",
                  f"Kp 0.5、3 m/s 各行程的最大横滚角误差（Kp·v/g：{bound(3.0):.1f}°）"),
    )  # fmt: skip


def _sea(results: Results) -> Iterator[Outcome]:
    for column, axis in enumerate(("roll", "pitch", "yaw")):
        faithful, best = (float(np.median(results.sea[name][:, column])) for name in ("gate 0.08 g", "mekf"))
        bar = at_most(0.2) if axis != "yaw" else at_most(math.inf)
        yield Outcome(
            key=f"sea.{axis}", unit="°", where="", faithful=faithful, best=best, best_bar=bar,
            what=Both(f"rms {axis} error in waves, median of the seas", f"波浪中{ANGLE[axis].zh}均方根误差（中位数）"),
        )  # fmt: skip
        rms = [float(sea_rms(results.sailed, name)[column]) for name in ("gate 0.08 g", "mekf")]
        yield Outcome(
            key=f"sea.unit.{axis}", unit="°", where="", faithful=rms[0], best=rms[1], best_bar=bar,
            what=Both(f"rms {axis} error in waves, the unit through bytes",
                      f"波浪中{ANGLE[axis].zh}均方根误差，经字节流的模块"),
        )  # fmt: skip
    yield Outcome(
        key="sea.output", where="§2.2", unit="Hz", paper=20.0,
        best=float(results.sailed.lines / results.sailed.t[-1]), best_bar=(19.9, 20.1),
        what=Both("lines of attitude that the host hands on", "上位机转发姿态速率"), digits=4,
    )  # fmt: skip
    yield Outcome(
        key="sea.replay", where="§4.1", unit="%", best=100.0 * results.sailed.equal, best_bar=at_least(100.0),
        what=Both("stored stream that gives the live attitude again to the bit", "存储数据回放与实时姿态逐位一致"),
    )  # fmt: skip


def _claim(results: Results) -> Outcome:
    """The largest error of any angle of the unit through bytes, at rest and sliding with the gate, and at sea."""
    worst = []
    for static, name in zip(results.static, ("gate 0.08 g", "mekf"), strict=True):
        at_rest = [to_deg(static.after.stats[angle].max_abs) for angle in ANGLES]
        moving = [float(np.abs(slid.errors[name]).max()) for slid in results.slid.values()]
        sailed = float(np.abs(results.sailed.errors[name][results.sailed.t >= SETTLE]).max())
        worst.append(max(*at_rest, *moving, sailed))
    return Outcome(
        key="claim", where="§5", unit="°", paper="±5", faithful=worst[0], best=worst[1], faithful_bar=at_most(5.0),
        best_bar=at_most(5.0),
        what=Both("largest error of any angle: 36 rests, four slides, ten minutes at sea",
                  "任一角最大误差：36 个静止位置、四组滑动、海上 10 分钟"),
    )  # fmt: skip


def _literal(results: Results) -> Iterator[Outcome]:
    """What the printed forms give; the bars are those of closed forms."""
    m, pi = results.misprints, loop()
    fast, slow = pi.poles
    rows: list[tuple[str, str, str, Both, float, tuple[float, float]]] = [
        ("rows", "(3)", "°", Both("turn of 150° by the printed rows",
                                  "按原式 (3) 转动 150° 的结果"), m.turned[0], (0, 0)),
        ("norm", "(3)", "", Both("norm of q after 600 s at 0.62 rad/s, not normalised",
                                  "0.62 rad/s、600 s 后 |q|（未归一化）"),
         m.norm, (1.325, 1.335)),
        *((f"lag.{rate:g}", "(3)", "°/s", Both(f"lag of the first-order step at {rate:g} °/s",
                                                f"一阶龙格库塔在 {rate:g} °/s 的滞后"), lag, (0.95 * want, 1.05 * want))
          for rate, lag, want in zip(RATES, m.lags, (0.013, 0.48, 20.0), strict=True)),
        ("arctan", "(6)", "rad", Both("yaw of 2 rad by arctan", "航向角 2 rad 按 arctan 的结果"), m.arctan[0],
         (-1.1417, -1.1415)),
        ("order", "§1.1", "rad", Both("roll of 0.4 rad by (4) where q is built Z-X-Y",
                                      "按 Z-X-Y 构造时式 (4) 对 0.4 rad 的结果"),
         m.orders[0][0], (-0.3245, -0.3235)),
        ("normalised", "(14)", "°", Both("largest yaw error by (14) without its /R", "式 (14) 首行缺 /R 的航向角误差"),
         m.normalised[0], at_least(5.0)),
        ("modulus", "§1.3", "°", Both("inclination left of 10° after 30 s by moduli",
                                      "按模值修正 10° 倾角 30 s 后的误差"),
         m.regulated[0], at_least(10.0)),
        ("gate.g", "(15)", "g", Both("level acceleration that 0.08 g lets pass", "ε = 0.08 g 可通过的水平加速度"),
         m.gates[0][0], (0.4075, 0.4085)),
        ("gate.si", "(15)", "g", Both("level acceleration that 0.08 m/s² lets pass",
                                      "ε = 0.08 m/s² 可通过的水平加速度"),
         m.gates[1][0], (0.1275, 0.1285)),
        ("gate.rest", "(15)", "%", Both("samples at rest with 20 mg of bias that 0.08 m/s² lets pass",
                                         "零偏 20 mg 时静止样本通过 ε = 0.08 m/s² 的比例"),
         100.0 * m.shares[1], at_most(0.5)),
        ("step", "§2.1", "°", Both(f"yaw that steps of {from_si(WIDE_STEP, 'mgauss'):.2f} mG cost over "
                                    f"{from_si(STEP, 'mgauss'):.2f} mG, median",
                                    "4.35 mG 相对 0.73 mG 分辨率的航向角代价（中位数）"),
         results.rings["step 4.35 mG"].yaw - results.rings["faces"].yaw, (-math.inf, math.inf)),
        ("pole.fast", "(7)", "rad/s", Both("fast pole of the PI loop", "PI 回路快极点"), fast, (-0.4305, -0.4295)),
        ("pole.slow", "(7)", "rad/s", Both("slow pole of the PI loop", "PI 回路慢极点"), slow, (-0.0698, -0.0696)),
        ("zero_rate", "(7)", "°", Both("inclination error that 5 °/s of zero-rate output gives",
                                       "5 °/s 零偏引起的倾角误差峰值"),
         m.zero_rate[0], (7.8, 8.4)),
    ]  # fmt: skip
    for key, where, unit, what, value, bar in rows:
        yield Outcome(key=f"literal.{key}", where=where, what=what, unit=unit, faithful=value, faithful_bar=bar)
