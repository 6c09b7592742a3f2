"""What the paper prints and means otherwise, each computed as it stands, beside its corrected form."""

import math
from typing import Final, NamedTuple

import numpy as np

from plumbob.arm.array.paper import Scheme, sets_of
from plumbob.core.check import Floats
from plumbob.core.units import dps, to_dps
from plumbob.filters.fuzzy_pi import E_END, I_END, SETS, U_END, conclusion, regulate
from plumbob.papers.arm.simulated import RATE, REST, STATED, TURN, Over, UnitErrors, arm
from plumbob.papers.arm.tables import PAPER, measured, recovery
from plumbob.papers.outcome import Bar, Outcome, at_least, at_most
from plumbob.reporting.content import Table
from plumbob.reporting.style import Both

_PI: Final = Scheme(set1="pi", sets=1)
_SUM: Final = Scheme(sum_table=True)
_STD: Final = Both("std at rest, mean of the angles", "静态标准差，三角平均")
_RMS: Final = Both("rms", "均方根")


class Misprint(NamedTuple):
    """A printed form and the right one.

    Attributes
    ----------
    key : str
        Of its outcome.
    where : str
        Place in the paper.
    printed, what : Both
        The form that is wrong, and the figure that shows it.
    wrong, right : float
        That figure with both.
    unit : str
        Of the figure.
    bar : (float, float)
        Where the wrong one must be: its failure is known.
    remark : Both
        What to know.
    """

    key: str
    where: str
    printed: Both
    what: Both
    wrong: float
    right: float
    unit: str
    bar: Bar
    remark: Both


def mean(over: Over) -> float:
    """Mean of the standard deviations of the three angles, deg."""
    return float(over.std.mean())


def raw_mean_error(seed: int, amplitude_dps: float = 5.0) -> tuple[float, float]:
    """Rms error, deg/s, of the mean of raw signals and of half their difference, of a swing with this amplitude."""
    array, _ = arm(seed, turns=False)
    sets, t = sets_of(array), array.t
    swing = dps(amplitude_dps) * np.sin(2.0 * np.pi * 0.5 * t)
    plus, minus = sets.plus["gyr"][:, 2] + swing, -sets.minus["gyr"][:, 2] - swing
    both = 0.5 * (plus + minus) - swing, 0.5 * (plus - minus) - swing
    literal, right = (float(to_dps(np.sqrt(np.mean(e**2)))) for e in both)
    return literal, right


def mamdani(error: float, integral: float, points: int = 3601) -> float:
    """Correction, deg/s, of the sum table by minimum and centre of area, instead of products and heights.

    Triangles of the output are cut at the strength of their rules, and the largest counts at each place.
    """
    u = np.linspace(-U_END, U_END, points)
    step_e, step_i, step_u = E_END / SETS, I_END / SETS, U_END / SETS
    e, i = np.clip(3.0 * error, -E_END, E_END), np.clip(integral, -I_END, I_END)
    grade = np.zeros(points)
    for a in range(-SETS, SETS + 1):
        for b in range(-SETS, SETS + 1):
            strength = min(1.0 - abs(e / step_e - a), 1.0 - abs(i / step_i - b))
            if strength > 0.0:
                centre = conclusion(a, b, step_u, U_END, step_u)
                grade = np.maximum(grade, np.minimum(strength, np.clip(1.0 - np.abs(u - centre) / step_u, 0.0, 1.0)))
    return float((grade * u).sum() / grade.sum())


class Inference(NamedTuple):
    """Two ways to read the same table of rules.

    Attributes
    ----------
    gain, gain_product : float
        Of the error at zero, 1/s.
    reach : float
        Largest correction of Mamdani's, of ±9 deg/s.
    apart : float
        Largest difference of both, deg/s.
    e, mamdani, product : ndarray (N,)
        Error, deg, and both corrections without an integral, deg/s.
    """

    gain: float
    gain_product: float
    reach: float
    apart: float
    e: Floats
    mamdani: Floats
    product: Floats


def inference() -> Inference:
    """Both, over the universes of error and integral."""
    near = U_END / SETS
    e, i = np.linspace(-2.0, 2.0, 41), np.linspace(-I_END, I_END, 13)
    by_area = np.array([[mamdani(a, b, 901) for b in i] for a in e])
    by_height = np.array([[regulate(a, b, near, U_END, near) for b in i] for a in e])
    line = np.array([[mamdani(a, 0.0), regulate(a, 0.0, near, U_END, near)] for a in e])
    small = 0.01
    return Inference(
        gain=mamdani(small, 0.0) / small,
        gain_product=regulate(small, 0.0, near, U_END, near) / small,
        reach=float(np.abs(by_area).max()),
        apart=float(np.abs(by_area - by_height).max()),
        e=e,
        mamdani=line[:, 0],
        product=line[:, 1],
    )


def cut_off(gain: float) -> float:
    """Corner of a complementary filter with a gain K, 1/s: K / 2π, Hz."""
    return gain / (2.0 * math.pi)


def printed_forms(seeds: int, rest: dict[str, Over], turn: dict[str, Over]) -> list[Misprint]:
    """Every printed form that is wrong, computed over seeds; `rest` and `turn` are the right ones."""
    still = measured(
        False,
        seeds,
        ours=False,
        schemes={
            "deg": _SUM._replace(rule_units="deg as rad/s"),
            "rad": _SUM._replace(rule_units="rad as deg/s"),
            "down": Scheme(force_down=True),
            "steep": _PI._replace(kp=2.0 * math.pi * 15.0),
        },
    )
    return [*_of_rates(seeds, turn), *_of_units(still, rest), _of_time(seeds), *_of_loop(still, rest)]


def _of_rates(seeds: int, turn: dict[str, Over]) -> list[Misprint]:
    """Mean of raw signals in place of half their difference."""
    turned = measured(True, seeds, ours=False, schemes={"raw": Scheme(raw_mean=True)})
    literal, right = raw_mean_error(1)
    return [
        Misprint(
            "raw.rate",
            "(20)",
            Both("rate as the mean of the raw signals", "角速度取原始信号均值"),
            Both(f"{_RMS} of the rate, swing of ±5 °/s", f"角速度{_RMS.zh}，±5 °/s 摆动"),
            literal,
            right,
            "°/s",
            at_least(3.0),
            Both("5/√2 = 3.54: the signal cancels", "5/√2 = 3.54：信号相消"),
        ),
        Misprint(
            "raw.yaw",
            "(20)",
            Both("the same in the scheme", "同上，整个算法"),
            Both(f"{_RMS} of yaw in the turn", f"动态航向角{_RMS.zh}"),
            float(turned["raw"].rms[2]),
            float(turn["fuzzy"].rms[2]),
            "°",
            at_least(1.0),
            Both("the EKF alone follows the turn, and lags", "只有 EKF 跟随转动，且滞后"),
        ),
    ]


def _of_units(still: dict[str, Over], rest: dict[str, Over]) -> list[Misprint]:
    """Degrees and radians mixed at the rules."""
    slow, quick = recovery(_SUM._replace(rule_units="rad as deg/s", ekf=False)), recovery(_SUM._replace(ekf=False))
    return [
        Misprint(
            "units.deg",
            "(18)",
            Both("e in °, u taken as rad/s", "e 用度，u 当作 rad/s"),
            _STD,
            mean(still["deg"]),
            mean(rest["sum"]),
            "°",
            (11.0, 20.0),
            Both("gain 57 times too large", "增益大 57 倍"),
        ),
        Misprint(
            "units.rad",
            "(18)",
            Both("e in rad, u taken as °/s", "e 用弧度，u 当作 °/s"),
            _STD,
            mean(still["rad"]),
            mean(rest["sum"]),
            "°",
            at_most(0.5 * mean(rest["sum"])),
            Both(
                "gain 0.079 instead of 4.5 1/s: the table at rest even improves", "增益 0.079 而非 4.5：静态表反而更好"
            ),
        ),
        Misprint(
            "units.rad.recovery",
            "(18)",
            Both("the same", "同上"),
            Both("recovery from 10°, without EKF", "从 10° 收敛，无 EKF"),
            slow.time,
            quick.time,
            "s",
            at_least(30.0),
            Both("only this test finds it", "只有此测试能发现"),
        ),
    ]


def _of_time(seeds: int) -> Misprint:
    """Error at the attitude of one sample before."""
    quiet = measured(True, seeds, noise=STATED, ours=False, schemes={"right": _PI, "late": _PI._replace(late=True)})
    return Misprint(
        "late",
        "(15)",
        Both("e at the attitude of the sample before", "误差取上一采样的姿态"),
        Both(f"{_RMS} of yaw at 3 °/s, stated noise, PI", f"3 °/s 转动航向角{_RMS.zh}，论文噪声，PI"),
        float(quiet["late"].rms[2]),
        float(quiet["right"].rms[2]),
        "°",
        (0.16, 0.21),
        Both("a lag of one sample, 0.3°, of which the loop keeps a part", "滞后一个采样（0.3°），环路保留其一部分"),
    )


def _of_loop(still: dict[str, Over], rest: dict[str, Over]) -> list[Misprint]:
    """Sign of the specific force, and a gain beyond what the loop bears."""
    return [
        Misprint(
            "sign",
            "(5)",
            Both("specific force taken for gravity", "把比力当作重力"),
            Both(f"{_RMS} of roll at rest", f"静态横滚角{_RMS.zh}"),
            float(still["down"].rms[0]),
            float(rest["fuzzy"].rms[0]),
            "°",
            at_least(170.0),
            Both(
                "E-N-D is left-handed: det [E N D] = −1; NED, and the sign turned, is meant",
                "东北地为左手系，行列式 −1；应为北东地并取反号",
            ),
        ),
        Misprint(
            "gain",
            "§4",
            Both("K for 15 Hz: 2π·15 = 94 1/s", "15 Hz 对应的 K：2π·15 = 94 1/s"),
            _STD,
            mean(still["steep"]),
            mean(rest["pi"]),
            "°",
            at_least(5.0),
            Both("beyond 2/Ts = 20 1/s the loop does not settle", "超过 2/Ts = 20 1/s 环路不收敛"),
        ),
    ]


def table(rows: list[Misprint]) -> Table:
    """Printed and right, side by side."""
    head = (
        Both("where", "出处"),
        Both("as printed", "原文"),
        Both("figure", "指标"),
        Both("unit", "单位"),
        Both("printed", "按原文"),
        Both("right", "更正后"),
        Both("why", "原因"),
    )
    cells = [
        (row.where, row.printed, row.what, row.unit, f"{row.wrong:.3g}", f"{row.right:.3g}", row.remark) for row in rows
    ]
    return Table(Both("Printed forms, computed as they stand", "按原文计算的各式"), head, cells, words=(1, 2, 3, 6))


def outcomes(rows: list[Misprint], read: Inference) -> list[Outcome]:
    """Outcomes of `printed_forms`, the printed form beside the right one, and of both inferences."""
    made = [
        Outcome(
            key=f"misprint.{row.key}",
            where=row.where,
            unit=row.unit,
            faithful=row.right,
            paper=Both(f"{row.wrong:.3g} as printed", f"按原文 {row.wrong:.3g}"),
            what=Both(f"{row.printed}: {row.what}", f"{row.printed.zh}：{row.what.zh}"),
        )
        for row in rows
    ]
    for key, en, zh, value, right in (
        ("gain", "gain near zero", "零点增益", read.gain, read.gain_product),
        ("reach", "greatest correction of ±9", "最大修正（论域 ±9）", read.reach, U_END),
        ("apart", "greatest difference from products", "与乘积推理的最大差别", read.apart, 0.0),
    ):
        made.append(
            Outcome(
                key=f"inference.{key}",
                where="§4",
                unit="1/s" if key == "gain" else "°/s",
                faithful=right,
                paper=Both(f"{value:.3g} by Mamdani", f"Mamdani {value:.3g}"),
                what=Both(f"sum table by products, not by Mamdani: {en}", f"求和规则表用乘积推理而非 Mamdani：{zh}"),
            )
        )
    return made


def of_gain() -> list[Outcome]:
    """Outcomes of K, its corner, and the sampling interval."""
    human, step = 15.0, 1.0 / RATE
    return [
        Outcome(
            key="gain.corner",
            where="§4",
            unit="Hz",
            paper=15.0,
            faithful=cut_off(0.8),
            digits=3,
            what=Both("corner of the complementary filter with K = 0.8", "K = 0.8 的互补滤波截止频率"),
            reproducible=False,
            reason=Both(
                "K = 0.8 is 0.8 rad/s, and no usual discrete weight gives 0.8 at 15 Hz and 0.1 s either: τ/(τ + Ts) = "
                f"{1.0 / (1.0 + 2.0 * math.pi * human * step):.3f}",
                "K = 0.8 即 0.8 rad/s；15 Hz、0.1 s 下常用离散权重也得不到 0.8：τ/(τ+Ts) = "
                f"{1.0 / (1.0 + 2.0 * math.pi * human * step):.3f}",
            ),
        ),
        Outcome(
            key="gain.needed",
            where="§4",
            unit="1/s",
            paper=0.8,
            faithful=2.0 * math.pi * human,
            what=Both("K that has its corner at 15 Hz", "截止频率 15 Hz 所需的 K"),
            reproducible=False,
            reason=Both("the loop at 0.1 s ends at K = 2/Ts = 20", "采样周期 0.1 s 的环路上限为 K = 2/Ts = 20"),
        ),
        Outcome(
            key="gain.nyquist",
            where="§4",
            unit="Hz",
            paper=human,
            faithful=0.5 * RATE,
            what=Both("greatest frequency of motion that 0.1 s can show", "0.1 s 采样所能表示的最高运动频率"),
            reproducible=False,
            reason=Both(
                "motion of 15 Hz lies above half of 10 Hz; the page has the same at 100 Hz",
                "15 Hz 的运动高于 10 Hz 采样的一半；本页另给出 100 Hz 的结果",
            ),
        ),
    ]


def stated(seeds: int) -> list[Outcome]:
    """Outcomes of Table 1 with the noise that the paper states."""
    over, words = measured(False, seeds, noise=STATED, ours=True), dict(none="无调节", pi="PI", fuzzy="模糊 PI")
    made = []
    for name, chinese in words.items():
        value, printed = mean(over[name]), float(np.mean(PAPER[False][name]))
        made.append(
            Outcome(
                key=f"stated.{name}",
                where="Table 1",
                unit="°",
                paper=round(printed, 3),
                faithful=value,
                digits=2,
                best=mean(over["six"]) if name == "fuzzy" else None,
                what=Both(
                    f"std with the stated noise, {name.replace('pi', 'PI').replace('fuzzy', 'fuzzy-PI')}, mean of the "
                    "angles",
                    f"论文所述噪声下的标准差，{chinese}，三角平均",
                ),
                reproducible=False,
                reason=Both(
                    f"0.1 °/h, 0.1 mg and 50 nT give {printed / value:.0f} times less than the table",
                    f"0.1 °/h、0.1 mg、50 nT 的结果比表中小 {printed / value:.0f} 倍",
                ),
            )
        )
    return made


def once(rest: dict[str, Over]) -> list[Outcome]:
    """Outcomes of one set with the EKF alone: PI before it uses the same measurements a second time."""
    return [
        Outcome(
            key=f"once.{axis}",
            where="Fig 1",
            unit="°",
            faithful=rest["ekf"].std[i],
            what=Both(
                f"std at rest, EKF alone: the measurements are used once, {axis}",
                f"静态标准差，仅 EKF（测量只用一次），{chinese}",
            ),
        )
        for i, (axis, chinese) in enumerate((("roll", "横滚角"), ("pitch", "俯仰角"), ("yaw", "航向角")))
    ]


def iron(seeds: int) -> list[Outcome]:
    """Outcomes of Table 2's yaw with a hard iron of ±1.5 µT in each unit."""
    over = measured(
        True,
        seeds,
        noise=TURN._replace(iron=1.5),
        ours=False,
        schemes={"pi": _PI, "control": Scheme(set1="pi"), "fuzzy": Scheme()},
    )
    return [
        Outcome(
            key=f"iron.{name}",
            where="Table 2",
            unit="°",
            paper=printed,
            faithful=float(over[name].std[2]),
            what=Both(f"std of yaw with hard iron of ±1.5 µT, {en}", f"±1.5 µT 硬磁下航向角标准差，{zh}"),
            reproducible=name == "pi",
            reason=None if name == "pi" else _NOT_BOTH,
        )
        for name, en, zh, printed in (("pi", "PI", "PI", 0.608), ("control", "PI on both sets", "两组 PI", 0.308))
    ]


_NOT_BOTH: Final = Both("what brings 0.608° spoils 0.308°", "能得到 0.608° 的误差会破坏 0.308°")


def combination(seed: int = 1) -> list[Outcome]:
    """Outcomes of y⁺ and y⁻ put together: common bias, noise, and the parity."""
    common = dps(0.3)
    array, _ = arm(seed, turns=True, noise=UnitErrors(REST.gyr, REST.acc, REST.mag, dps(0.05)))
    sets = sets_of(array)
    plus, raw = sets.plus["gyr"] + common, -sets.minus["gyr"] + common  # both read 0.3 °/s too much
    true = np.array([0.0, 0.0, dps(-3.0)])
    residual = 0.5 * (plus - raw).mean(axis=0) - true
    single = (plus.mean(axis=0) - true)[0]
    noise = 0.5 * (plus - raw).std(axis=0).mean() / plus.std(axis=0).mean()
    cosine = np.corrcoef((0.5 * (plus + raw))[:, 2], np.sin(array.t))[0, 1]
    return [
        Outcome(
            key="pair.bias",
            where="(4)",
            unit="°/s",
            faithful=float(to_dps(np.abs(residual).max())),
            faithful_bar=at_most(0.06),
            what=Both(
                "what half the difference keeps of a common bias of 0.3 "
                f"°/s (one set: {to_dps(single):.2f}): own biases of ±0.05",
                f"共同零偏 0.3 °/s 在半差中的残余（单组 {to_dps(single):.2f}）：仅剩各自 ±0.05 的零偏",
            ),
        ),
        Outcome(
            key="pair.noise",
            where="(4)",
            faithful=float(noise),
            faithful_bar=(0.66, 0.76),
            what=Both("noise of half the difference over that of one unit (1/√2)", "半差噪声与单元噪声之比（1/√2）"),
        ),
        Outcome(
            key="pair.parity",
            where="",
            faithful=float(abs(cosine)),
            faithful_bar=at_most(0.15),
            what=Both("correlation of the parity with a signal", "奇偶残差与信号的相关系数"),
        ),
    ]
