"""What the buoy paper's page says of its misprints [Yu2018]."""

from collections.abc import Iterator, Sequence

from plumbob.core.units import from_si
from plumbob.papers.buoy.as_printed import RATES
from plumbob.papers.buoy.figures import signed
from plumbob.papers.buoy.modules import STEP, WIDE_STEP
from plumbob.papers.buoy.outcomes import Results
from plumbob.reporting.content import Table
from plumbob.reporting.report import Report
from plumbob.reporting.style import Both


def misprinted(found: Results) -> Report:
    """What the page says of the paper's misprints."""
    head = (
        Both("where", "出处"), Both("printed", "原文"), Both("corrected", "改正"), Both("the printed form gives",
                                                                                        "原式结果"),
        Both("the corrected form gives", "改正后结果"),
    )  # fmt: skip
    return Report(
        Both("Misprints, each computed as printed", "印刷错误（均按原式实际计算）"),
        tables=[Table("", head, [list(row) for row in _misprint_rows(found)], words=(1, 2, 3, 4))],
    )


def _misprint_rows(results: Results) -> Iterator[Sequence[str]]:
    m = results.misprints
    euler, zxy, zyx = "(0.400, −0.300, 1.100)", *(_triple(order) for order in m.orders)
    yield (
        "§1.1", Both("order Z-X-Y", "旋转顺序 Z-X-Y"), Both("(4) to (6) are Z-Y-X", "式 (4)–(6) 为 Z-Y-X"),
        Both(f"{zxy} rad of {euler}", f"{euler} 得 {zxy} rad"), f"{zyx} rad",
    )  # fmt: skip
    yield (
        "(3)", Both("rows 2 to 4 repeat q1, q2, q3", "第 2–4 行重复 q1、q2、q3"), Both("the product of quaternions",
                                                                                       "四元数乘积"),
        Both(f"from the identity {m.turned[0]:g}° in a turn of 150°: it never moves",
             f"自单位四元数转 150° 得 {m.turned[0]:g}°：始终不动"), f"{m.turned[1]:.2f}°",
    )  # fmt: skip
    yield (
        "(3)", Both("no normalising", "未归一化"), Both("normalised after each step", "每步归一化"),
        Both(f"|q| = {m.norm:.3f} after 600 s at 0.62 rad/s", f"0.62 rad/s、600 s 后 |q| = {m.norm:.3f}"), "1.000",
    )  # fmt: skip
    lags = ", ".join(f"{lag:.3g}" for lag in m.lags)
    rates = ", ".join(f"{rate:g}" for rate in RATES)
    yield (
        "(3)", Both("first-order step", "一阶龙格库塔"), Both("exact step of the rotation vector", "旋转矢量精确更新"),
        Both(f"slow by {lags} °/s at {rates} °/s", f"{rates} °/s 时滞后 {lags} °/s"), "0",
    )  # fmt: skip
    yield (
        "(4), (6)", "arctan", "atan2", Both(f"yaw of 2 rad: {signed(m.arctan[0], 2)} rad",
                                            f"航向 2 rad 得 {signed(m.arctan[0], 2)} rad"),
        f"{m.arctan[1]:.2f} rad",
    )  # fmt: skip
    yield (
        "§1.3", Both("e by the moduli of the products", "以叉积模值构造 e"), Both("sum of the two vectors",
                                                                                  "两矢量之和"),
        Both(f"10° of roll at rest become {m.regulated[0]:.0f}° in 30 s",
             f"静止 10° 横滚 30 s 后为 {m.regulated[0]:.0f}°"),
        f"{m.regulated[1]:.2f}°",
    )  # fmt: skip
    yield (
        "(14)", Both("first row without /R", "首行缺 /R"), Both("all rows by R", "各行均除以 R"),
        Both(f"yaw wrong by up to {m.normalised[0]:.0f}°", f"航向角误差达 {m.normalised[0]:.0f}°")
        , f"{m.normalised[1]:.1f}°",
    )  # fmt: skip
    g, si = m.gates
    yield (
        "(15)", Both("ε = 0.08, no unit", "ε = 0.08，无单位"), Both("0.08 g, as its reduction fits",
                                                                    "0.08 g，与其削减量相符"),
        Both(f"0.08 m/s²: passes {si[0]:.3f} g across ({si[1]:.1f}°), and {100 * m.shares[1]:.0f} % of the samples "
             "at rest with 20 mg of bias",
             f"0.08 m/s²：可通过水平 {si[0]:.3f} g（{si[1]:.1f}°），"
             f"零偏 20 mg 时静止样本通过 {100 * m.shares[1]:.0f} %"),
        Both(f"passes {g[0]:.3f} g across ({g[1]:.1f}°), and {100 * m.shares[0]:.0f} % at rest",
             f"可通过水平 {g[0]:.3f} g（{g[1]:.1f}°），静止通过 {100 * m.shares[0]:.0f} %"),
    )  # fmt: skip
    fine, wide = results.rings["faces"].yaw, results.rings["step 4.35 mG"].yaw
    yield (
        "§2.1", Both("±8 Ga with 0.73 mG", "±8 Ga、0.73 mG"),
        Both(f"{from_si(STEP, 'mgauss'):.2f} mG at ±0.88 Ga, {from_si(WIDE_STEP, 'mgauss'):.2f} mG at ±8.1 Ga",
             "±0.88 Ga 为 0.73 mG，±8.1 Ga 为 4.35 mG"),
        Both(f"yaw {wide:.2f}° at ±8.1 Ga", f"±8.1 Ga 时航向 {wide:.2f}°"),
        Both(f"{fine:.2f}° at ±0.88 Ga", f"±0.88 Ga 时 {fine:.2f}°"),
    )  # fmt: skip


def _triple(values: tuple[float, float, float]) -> str:
    return "(" + ", ".join(signed(v, 3) for v in values) + ")"
