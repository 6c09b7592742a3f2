"""What stands first on the pages of the papers: what a paper is, its main figures, and what cannot be had."""

from collections.abc import Mapping, Sequence
from typing import Final

from plumbob.papers.outcome import CANNOT, HEAD, MISSED, PASS, SHOWN, Outcome
from plumbob.reporting import Table
from plumbob.reporting.style import Both

ABOUT: Final[Mapping[str, Both]] = {
    "fin": Both(
        "Three MEMS gyroscopes on a bionic fin give its yaw, pitch and roll in real time, and Allan variance gives "
        "their noise coefficients, Table 1. Both are done here, from emulated bytes of the same sensors.",
        "仿生鳍条上的三轴 MEMS 陀螺仪实时给出航向、俯仰、横滚角，并由 Allan 方差得到噪声系数（表 1）。"
        "本页由同型传感器的仿真字节流完成两者。",
    ),
    "buoy": Both(
        "The attitude unit of a drifting buoy: ellipsoid calibration, a PI filter with a gate, static test and slide. "
        "All are done here, from emulated bytes of the same sensors and of their firmware, and at sea besides.",
        "海洋漂流浮标的姿态模块：椭球拟合校准、带阀值的 PI 互补滤波、静态测试与滑动测试。"
        "本页由同型传感器及固件的仿真字节流完成全部内容，并增加海上试验。",
    ),
    "trackball": Both(
        "A drift model and a Kalman filter of one state for the rates of a trackball's gyroscope: at rest, by Allan "
        "variance, and on a turntable. All are done here, from emulated bytes of the same sensor.",
        "轨迹球陀螺仪的漂移模型与单状态卡尔曼滤波：静止、Allan 方差与转台试验。"
        "本页由同型传感器的仿真字节流完成全部内容。",
    ),
    "arm": Both(
        "Six units on a teaching arm, fuzzy-PI and a Kalman filter: attitude errors at rest, Table 1, and in a turn, "
        "Table 2. Both are done here, from emulated bytes, with noise that fits the first rows of the tables.",
        "示教机械臂上的六个传感器单元、模糊 PI 与卡尔曼滤波：静止（表 1）与转动（表 2）时的姿态误差。"
        "本页由仿真字节流完成两者，噪声按表中首行假设。",
    ),
    "rod": Both(
        "An ADIS16355 on a rod moved by hand, beside an AHRS500GA: accelerometer alone, gyroscope alone, and both "
        "fused by a Kalman filter, Figure 6. All are done here, from emulated bytes of both devices.",
        "手持杆上的 ADIS16355 与 AHRS500GA 对比：单独加速度计、单独陀螺仪及卡尔曼滤波融合（图 6）。"
        "本页由两种器件的仿真字节流完成全部内容。",
    ),
}
"""A paper in two sentences."""

MAIN: Final[Mapping[str, Sequence[str]]] = {
    "fin": (
        *(f"table1.{term}.{axis}" for term in "QNB" for axis in ("290x", "290y", "453z")), "eq7", "swim.yaw",
    ),
    "buoy": (
        "static.after.yaw", "static.after.pitch", "static.after.roll", "slide.open.roll", "slide.open.pitch",
        "slide.gated.roll", "slide.gated.pitch", "slide.reduction.roll", "slide.reduction.pitch", "claim",
    ),
    "trackball": (
        "drift.k_t", "rest.after", "allan.ratio.0.1", "allan.ratio.1", "allan.ratio.10", "allan.ratio.50", "ramp.rms",
        "hold.rms",
    ),
    "arm": tuple(
        f"{test}.{way}.{angle}" for test in ("static", "turn") for way in ("none", "pi", "fuzzy")
        for angle in ("roll", "pitch", "yaw")
    ),
    "rod": (
        "accel.early", "accel.late", "gyro.largest", "fused.kept", "fused.worst", "bytes.ahrs.roll",
        "bytes.ahrs.pitch", "drift.ratio",
    ),
}  # fmt: skip
"""Keys of the outcomes by which a paper is known."""


def main_figures(name: str, outcomes: Sequence[Outcome]) -> Table:
    """Table of a paper's main outcomes, with a word for each verdict."""
    known = {one.key: one for one in outcomes}
    rows = [[*known[key].row()[:-1], known[key].word] for key in MAIN[name] if key in known]
    return Table(Both("Main figures", "主要指标"), HEAD, rows, words=(1, 2, 6))


def not_had(outcomes: Sequence[Outcome]) -> Table | None:
    """Table of what is missed or cannot be reproduced, a row for each reason; None where there is nothing."""
    why: dict[Both, list[Outcome]] = {}
    for one in outcomes:
        if one.reason is not None and not (one.met and one.reproducible):
            why.setdefault(one.reason, []).append(one)
    rows = []
    for reason, group in why.items():
        first, more = group[0], len(group) - 1
        what = Both(f"{first.what}, and {more} more", f"{first.what.zh}，另 {more} 项") if more else first.what
        rows.append([first.where or "-", what, first.word, reason])
    head = (HEAD[0], HEAD[1], HEAD[6], Both("why", "原因"))
    title = Both("What cannot be had as the paper prints it, and why", "无法按论文原样复现的内容及原因")
    return Table(title, head, rows, words=(1, 2, 3)) if rows else None


def counts(outcomes: Sequence[Outcome]) -> Sequence[int]:
    """Of all outcomes: how many pass, are shown without a bar, are not reproducible, and are missed."""
    words = [one.word for one in outcomes]
    return [len(words), *(words.count(word) for word in (PASS, SHOWN, CANNOT, MISSED))]
