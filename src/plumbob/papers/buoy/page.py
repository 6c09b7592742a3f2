"""The buoy paper's page [Yu2018]: parts in the order of the paper."""

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from plumbob.core.units import to_deg, to_dps
from plumbob.papers.buoy import bench, figures, trials
from plumbob.papers.buoy.as_printed import KI, KP, loop
from plumbob.papers.buoy.device import PERIODS
from plumbob.papers.buoy.figures import ANGLE, signed
from plumbob.papers.buoy.misprinted import misprinted
from plumbob.papers.buoy.outcomes import FIRST, KPS, SCANNED, Results, sea_rms
from plumbob.papers.buoy.static_test import ANGLES
from plumbob.quality.quality import FAIL, MEANING
from plumbob.quality.tilt import tilt_statistics
from plumbob.reporting.content import Figure, Table
from plumbob.reporting.report import Report
from plumbob.reporting.style import Both
from plumbob.rotations import euler_zyx_from_quat


def page(found: Results, seed: int) -> Report:
    """The page of a run."""
    parts = [_system(found), _events(found), _calibration(found), _static(found), _slide(found), _sea(found)]
    modules, units, seas = found.modules, len(found.slides[FIRST]["mekf"]), len(found.sea["mekf"])
    facts = [
        (Both("seed", "随机种子"), f"{seed}"),
        (Both("unit", "模块"), Both(
            f"{found.unit.best.device}, drawn within the limits of the data sheets: one through bytes, recorded by a "
            "session, for Figs 4 to 8 and the sea",
            f"{found.unit.best.device}，按数据手册限值抽取；图 4 至 8 与海上试验均由该模块经字节流、会话记录得到")),
        (Both("beside it", "统计"), Both(
            f"simulated directly: {modules} modules on the table, {units} units slid, {seas} seas",
            f"直接仿真：转台 {modules} 个模块，滑动 {units} 个模块，海况 {seas} 个")),
        (Both("faithful", "按论文"), Both(
            "one reading in each of 18 regions, six parameters (13), zero-rate output removed at the start; PI filter "
            f"with Kp {KP:g}, Ki {KI:g}, gate 0.08 g; its misprints corrected",
            f"18 个区域各一组测量值，6 参数拟合（式 13），启动时去除陀螺零偏；PI 互补滤波 Kp {KP:g}、Ki {KI:g}、"
            "阀值 0.08 g；印刷错误已改正")),
        (Both("best", "最佳"), Both(
            "Plumbob's calibration of all three sensors and of the mounting; filter mekf, which knows no future",
            "Plumbob 对三种传感器及安装的标定；因果滤波器 mekf")),
    ]  # fmt: skip
    links = [(Both("report of the sea", "海上姿态报告"), f"buoy/{bench.REPORT}")] if found.sailed.page else []
    return Report(
        Both("Drifting buoy: attitude of a sea-going unit (Yu 2018)", "海洋漂流浮标运动姿态测量系统（余博嵩 2018）"),
        facts=facts,
        parts=[*parts, misprinted(found)],
        links=links,
        definitions=_DEFINITIONS,
    )


_DEFINITIONS: Final = (
    Both("Errors are differences of Z-Y-X Euler angles to the truth, or to the DCM260B where it says so.",
         "误差为 Z-Y-X 欧拉角与真值之差；注明处为与 DCM260B 之差。"),
    Both("Largest: of all samples of a run. 95 %: what 95 of 100 modules keep.",
         "最大：一次试验全部样本的最大值。95 %：100 个模块中 95 个不超过的值。"),
    Both("Headings are magnetic: the paper knows no declination.", "航向为磁航向：论文未考虑磁偏角。"),
)  # fmt: skip


def _system(results: Results) -> Report:
    rows = [
        (Both("sensors", "传感器"), "MPU6000, HMC5983", Both("rig buoy: parts of the data sheets, SPI registers",
         "rig buoy：按数据手册的器件与 SPI 寄存器")),
        (Both("controller", "主控单元"), "MSP430F5342", Both("rig buoy_attitude: its loop, timer and costs, emulated",
         "rig buoy_attitude：主循环、定时器与耗时仿真")),
        (Both("initial attitude", "初始姿态"), Both("accelerometer and compass", "加速度计、磁阻传感器"),
         "filters/start.py"),
        (Both("attitude update", "姿态更新"), "(2), (3)", "filters/integrate_first_order.py, filters/mahony.py"),
        (Both("data fusion", "数据融合"), Both("(7), Fig 2", "(7)，图 2"), "filters/mahony.py"),
        (Both("calibration", "校准"), "(8)–(14)", "calibration/ellipsoid/, plumbob calibrate accel, mag"),
        (Both("gate", "阀值滤波"), "(15)", "filters/mahony.py: gate"),
        (Both("storage", "存储"), "Flash", Both("emulated NOR Flash, read by plumbob decode --ring",
         "仿真 NOR Flash，由 plumbob decode --ring 读取")),
        (Both("line", "串口"), "UART, 20 Hz", Both("format buoy_attitude, 32 bytes a frame",
                                                   "buoy_attitude 帧，32 字节")),
        (Both("host program", "上位机"), "C#, SharpGL", "plumbob view, plumbob record"),
        (Both("later analysis", "后期处理"), "Matlab", "plumbob replay, eval, report"),
        (Both("static reference", "静态参考"), "DCM260B", Both("rig ring: emulated with 0.8° and 0.2°",
         "rig ring：按 0.8°、0.2° 仿真")),
    ]  # fmt: skip
    same, slid = results.sailed.equal, results.slid[FIRST]
    gyr = results.unit.paper.gyr
    assert gyr is not None
    bias = ", ".join(signed(v, 1) for v in to_dps(gyr.bias))
    tilt = float(np.abs(slid.errors[bench.KEPT][:, 1:]).max())
    yaw, pitch, roll = (signed(v, 2) for v in slid.errors["gate 0.08 g"][0])
    return Report(
        Both("The system (Figs 1, 2, 3, 6)", "系统（图 1、2、3、6）"),
        tables=[
            Table(
                Both("Stages of the paper, and what does them here", "论文各环节及本系统对应部分"),
                ("", Both("paper", "论文"), "Plumbob"), rows, words=(1, 2),
            )
        ],
        remarks=[
            Both(f"Boot: the zero-rate output at rest, ({bias}) °/s, is removed; kept, it would tilt the estimate by "
                 f"up to {tilt:.0f}°. The initial attitude, of one reading of accelerometer and compass, is off by "
                 f"{roll}° in roll, {pitch}° in pitch and {yaw}° in yaw.",
                 f"启动：去除静止时陀螺零偏（{bias}）°/s；若不去除，估计倾角误差可达 {tilt:.0f}°。"
                 f"由一次加速度、磁强测量所得初始姿态误差：横滚 {roll}°、俯仰 {pitch}°、航向 {yaw}°。"),
            Both("The live page with a model like that of Fig 6: plumbob view --emulate buoy opens it; at a real port, "
                 "plumbob view --port PORT --format buoy.",
                 "实时页面及三维模型：plumbob view --emulate buoy；"
                 "接实际串口时 plumbob view --port PORT --format buoy。"),
            Both(f"The sea was recorded live with {results.sailed.lines} lines of attitude at 20 Hz, and a replay of "
                 f"the stored bytes gives {'the same attitude to the bit' if same else 'ANOTHER attitude'}.",
                 f"海上试验实时记录，以 20 Hz 输出 {results.sailed.lines} 行姿态；由存储字节回放的姿态"
                 f"{'与实时结果逐位一致' if same else '与实时结果不一致'}。"),
        ],
        scenes=[figures.model(results.sailed.live, results.sailed.truth)],
    )  # fmt: skip


def _events(results: Results) -> Report:
    device = results.device
    names = {
        "sample": Both("sample both chips", "采样"), "fuse": Both("fuse and compute", "融合解算"),
        "send": Both("store and send", "存储、发送"),
    }  # fmt: skip
    rows = [
        [name, f"{PERIODS[task]}", f"{device.rates[task]:.2f}", f"{device.missed[task]}",
         f"{1e3 * device.latest[task]:.2f}", f"{device.waiting[task]}"]
        for task, name in names.items()
    ]  # fmt: skip
    head = (
        Both("event", "事件"), Both("period [ms]", "周期 [ms]"), Both("served [Hz]", "处理频率 [Hz]"), Both("missed",
                                                                                                            "遗漏"),
        Both("latest start [ms]", "最大延迟 [ms]"), Both("missed where the loop waits", "阻塞等待时遗漏"),
    )  # fmt: skip
    return Report(
        Both("Events of the main loop (Fig 4)", "主程序时间事件（图 4）"),
        tables=[Table(Both("Emulated program on a slide", "程序仿真（滑动试验）"), head, rows)],
        remarks=[
            Both(f"The processor sleeps for {100 * device.idle:.0f} % of the time. Durations of tasks are figures of "
                 "data sheets and assumptions: the paper gives periods only.",
                 f"处理器 {100 * device.idle:.0f} % 的时间处于低功耗模式。"
                 "任务耗时取自数据手册与假设：论文仅给出周期。"),
            Both("Where the loop waits for the line and for the Flash chip, events are missed: bytes must leave by "
                 "interrupt.", "若主循环等待串口与 Flash，则会遗漏事件：须以中断方式发送。"),
            Both(f"On the wire: {device.frames} frames, {device.junk} bytes of junk. The log in Flash gives back "
                 f"{device.stored} records, {'the same bits' if device.same else 'OTHER bits'} as went out; at 20 Hz "
                 f"it lives for {device.years:.1f} years.",
                 f"串口：{device.frames} 帧，杂字节 {device.junk}。Flash 循环存储读回 {device.stored} 条记录，"
                 "与发送内容"
                 f"{'逐位一致' if device.same else '不一致'}；20 Hz 下寿命 {device.years:.1f} 年。"),
        ],
        figures=[figures.fig4(device.calls, 0.16)],
    )  # fmt: skip


def _calibration(results: Results) -> Report:
    unit, card = results.unit, results.unit.paper.mag
    assert card is not None
    sizes = (np.linalg.norm(mag, axis=1) for mag in (unit.mag, (unit.mag - card.bias) @ card.matrix.T))
    spread = [100.0 * float(np.std(size) / np.mean(size)) for size in sizes]
    return Report(
        Both("Ellipsoid calibration (Fig 5)", "椭球拟合校准（图 5）"),
        tables=[_ring_table(results), _refused_table(results)],
        remarks=[
            Both(f"The capture fills {unit.regions} of 18 regions. The length of the field scatters by "
                 f"{spread[0]:.1f} % before the fit and by {spread[1]:.2f} % after it.",
                 f"采集覆盖 {unit.regions}/18 个区域。"
                 f"磁强模值离散度由拟合前 {spread[0]:.1f} % 降至 {spread[1]:.2f} %。"),
            Both("Off-diagonal soft iron is what six parameters cannot take up; the general ellipsoid can, and the "
                 "choice by test finds out which is needed.",
                 "6 参数无法补偿软铁交叉项，一般椭球可以；由检验自动选择所需模型。"),
            Both("The rig's HMC5983 has its gain of ±1.3 Ga, 0.92 mG a count; modules on the table have 0.73 mG.",
                 "仿真 HMC5983 增益为 ±1.3 Ga（0.92 mG/计数）；转台统计模块为 0.73 mG。"),
        ],
        figures=[figures.fig5(unit.mag_counts, unit.step)],
    )  # fmt: skip


_RING_ROWS: Final[Mapping[str, Both]] = {
    "pitch": Both("3 bands of pitch × 6 of heading, 6 parameters", "3 俯仰带 × 6 航向扇区，6 参数"),
    "roll": Both("3 bands of roll × 6 of heading, 6 parameters", "3 横滚带 × 6 航向扇区，6 参数"),
    "faces": Both("6 faces + 12 edges, 6 parameters", "6 面 + 12 棱，6 参数"),
    "pitch, chosen": Both("bands of pitch, chosen shape", "俯仰带，自动选择"),
    "roll, chosen": Both("bands of roll, chosen shape", "横滚带，自动选择"),
    "faces, chosen": Both("6 faces + 12 edges, chosen shape", "6 面 + 12 棱，自动选择"),
    "magnetometer alone": Both("accelerometer not calibrated", "加速度计未校准"),
    "tilt 40°": Both("table tilted by 40°", "转台倾斜 40°"),
    "step 4.35 mG": Both("steps of 4.35 mG", "分辨率 4.35 mG"),
    "c 0.02": Both("soft iron across the axes, c = 0.02", "软铁交叉项 c = 0.02"),
    "c 0.05": Both("soft iron across the axes, c = 0.05", "软铁交叉项 c = 0.05"),
    "c 0.1": Both("soft iron across the axes, c = 0.10", "软铁交叉项 c = 0.10"),
    "c 0.1, general": Both("c = 0.10, general ellipsoid", "c = 0.10，一般椭球 9 参数"),
}


def _ring_table(results: Results) -> Table:
    head = (
        Both("capture and fit", "采集与拟合"), Both("yaw before [°]", "航向补偿前 [°]"), Both("after", "补偿后")
        , "95 %",
        Both("roll, pitch 95 %", "横滚俯仰 95 %"), Both("yaw ≤ 2.5° [%]", "航向 ≤ 2.5° [%]"), "≤ 5°",
        Both("all ≤ 5°", "三轴 ≤ 5°"), Both("first capture refused", "首次采集被拒"),
    )  # fmt: skip
    rows = []
    for name, title in _RING_ROWS.items():
        fit = results.rings[name]
        shares = [f"{100 * share:.0f}" for share in (fit.within, fit.yaw5, fit.all5, fit.failed)]
        rows.append([title, f"{fit.before:.1f}", f"{fit.yaw:.2f}", f"{fit.yaw95:.2f}", f"{fit.level95:.2f}", *shares])
    title = Both(
        f"Static test of {results.modules} random modules: largest of 36 errors, medians over the modules",
        f"{results.modules} 个随机模块的静态测试：36 个位置最大偏差的中位数",
    )
    return Table(title, head, rows)


def _refused_table(results: Results) -> Table:
    head = (
        Both("capture", "采集方式"), Both("refused for the right reason [%]", "以正确理由拒绝 [%]"),
        Both("paper: no ellipsoid [%]", "论文：无椭球解 [%]"),
        Both("yaw error of its others [°]", "论文：有解时航向偏差 [°]"),
    )  # fmt: skip
    names = {
        "ring": Both("level ring, ±1° of the hand", "水平旋转，手抖 ±1°"),
        "unit": Both("cone of 15°, the unit tilted", "15° 锥面，模块倾斜"),
        "table": Both("cone of 15°, the table tilted", "15° 锥面，转台倾斜"),
    }
    rows = []
    for key, name in names.items():
        refused = results.refused[key]
        yaw = f"{refused.yaw:.0f}" if math.isfinite(refused.yaw) else "-"
        rows.append([name, f"{100 * refused.rightly:.0f}", f"{100 * refused.failed:.0f}", yaw])
    return Table(Both("Captures that calibrate nothing", "退化采集"), head, rows)


def _static(results: Results) -> Report:
    paper, best = results.static
    rows = []
    for name in ANGLES:
        cells = []
        for kind in ("max_abs", "rmse"):
            three = (getattr(e.stats[name], kind) for e in (paper.before, paper.after, best.after))
            cells += [f"{to_deg(value):.2f}" for value in three]
        rows.append([ANGLE[name], *cells])
    head = (
        Both("angle", "角"), Both("max before", "补偿前最大"), Both("max after", "补偿后最大"), Both("max best",
                                                                                                     "最佳最大"),
        Both("rms before", "补偿前均方根"), Both("rms after", "补偿后均方根"), Both("rms best", "最佳均方根"),
    )  # fmt: skip
    return Report(
        Both("Static test beside the DCM260B (Fig 7)", "静态测试，对比 DCM260B（图 7）"),
        tables=[Table(Both("Errors of the unit through bytes [°]", "经字节流模块的偏差 [°]"), head, rows)],
        remarks=[
            Both("The compass has errors of its own, 0.8° in heading and 0.2° in roll and pitch, root mean square: "
                 "most of what is left is the reference.",
                 "罗盘自身有误差（航向 0.8°，横滚、俯仰 0.2°，均方根）：剩余偏差大部分来自参考。"),
            Both("The paper's fit leaves the turn of the accelerometer's axes in the case; two poses of the mounting "
                 "remove it.", "论文拟合不能消除加速度计轴系在壳体中的偏转；两姿态安装标定可消除。"),
        ],
        figures=[figures.fig7(paper, best)],
    )  # fmt: skip


_CONTENDERS: Final[Mapping[str, Both]] = {
    "no gate": Both("paper, no gate", "论文，无阀值"),
    "gate 0.08 g": Both("paper, gate 0.08 g", "论文，阀值 0.08 g"),
    "gate 0.08 m/s²": Both("paper, gate 0.08 m/s²", "论文，阀值 0.08 m/s²"),
    "gate 0.08 g, best card": Both("paper's filter, best card", "论文滤波器，最佳标定卡"),
    "vqf": Both("vqf, best card", "vqf，最佳标定卡"),
    "mekf": Both("mekf, best card (recommended)", "mekf，最佳标定卡（推荐）"),
    "smoother": Both("smoother, best card (not causal)", "平滑器，最佳标定卡（非因果）"),
}


def _strokes(pair: tuple[float, float]) -> str:
    return f"{pair[0]:g} m/s, {pair[1]:g} s"


def _slide(results: Results) -> Report:
    sets = list(results.slides)
    head = ("", *(_strokes(pair) for pair in sets))
    many = [
        [
            _CONTENDERS[name],
            *(" / ".join(f"{v:.2f}" for v in np.median(results.slides[pair][name], axis=0)) for pair in sets),
        ]
        for name in trials.SLIDE
    ]
    worst = [
        [_CONTENDERS[name], *(" / ".join(f"{v:.2f}" for v in results.slides[pair][name].max(axis=0)) for pair in sets)]
        for name in trials.SLIDE
    ]
    single = [
        [name, *(" / ".join(f"{v:.2f}" for v in results.slid[pair].largest(key)) for pair in sets)]
        for key, name in _CONTENDERS.items()
    ]
    units = len(results.slides[FIRST]["mekf"])
    tables = [
        Table(
            Both(f"Largest roll / pitch of {units} units, median [°]", f"{units} 个模块最大横滚/俯仰误差中位数 [°]"),
            head,
            many,
        ),
        Table(Both(f"The same, worst of the {units} units [°]", f"同上，{units} 个模块中最差 [°]"), head, worst),
        Table(Both("The unit through bytes [°]", "经字节流的模块 [°]"), head, single),
        _gain_table(results),
    ]
    pi = loop()
    return Report(
        Both("Slide on a level desk (Fig 8)", "外力加速度干扰测试（图 8）"),
        tables=tables,
        remarks=[
            Both(f"9.6° and 6.1° cannot be had with Kp {KP:g}: a stroke to a speed v tilts the estimate by Kp v/g at "
                 f"most, {trials.bound(3.0):.1f}° at 3 m/s, and {results.strongest:.1f}° was the largest of all "
                 "strokes to 3 m/s. With Kp of 1 to 1.5 they can.",
                 f"Kp {KP:g} 时达不到 9.6° 与 6.1°：速度 v 的行程至多使估计倾斜 Kp·v/g，"
                 f"3 m/s 时为 {trials.bound(3.0):.1f}°，"
                 f"各 3 m/s 行程中最大为 {results.strongest:.1f}°。Kp 为 1 至 1.5 时可达到。"),
            Both("The gate looks at the length of the specific force, which a level acceleration changes in second "
                 "order only: slow strokes pass it.",
                 "阀值仅检验比力模值，水平加速度对其影响为二阶：慢行程可通过阀值。"),
            Both(f"Poles of the PI loop: {signed(pi.poles[0], 3)} and {signed(pi.poles[1], 4)} rad/s, damping ratio "
                 f"{pi.damping:.2f}. A zero-rate output of 5 °/s would peak at {5 * pi.peak:.1f}°, so it is "
                 "removed at the start.",
                 f"PI 回路极点 {signed(pi.poles[0], 3)}、{signed(pi.poles[1], 4)} rad/s，阻尼比 {pi.damping:.2f}。"
                 f"5 °/s 的零偏将引起 {5 * pi.peak:.1f}° 峰值误差，故启动时予以去除。"),
        ],
        figures=[figures.fig8(results.slid[FIRST]), _gain_figure(results)],
    )  # fmt: skip


def _gain_table(results: Results) -> Table:
    head = ["Kp [1/s]"]
    for pair in SCANNED:
        head += [Both(f"{_strokes(pair)}, no gate", f"{_strokes(pair)}，无阀值"), Both("gate 0.08 g", "阀值 0.08 g")]
    rows = []
    for k, kp in enumerate(KPS):
        cells = [" / ".join(f"{v:.1f}" for v in results.scan[pair][k, :, gate]) for pair in SCANNED for gate in (0, 1)]
        rows.append([f"{kp:g}", *cells])
    title = Both(
        "Largest roll / pitch by Kp, a unit without errors but noise [°]", "最大横滚/俯仰误差与 Kp（仅含噪声的模块）[°]"
    )
    return Table(title, head, rows)


def _gain_figure(results: Results) -> Figure:
    scans = {
        Both(f"{_strokes(pair)}, no gate", f"{_strokes(pair)}，无阀值"): (
            results.scan[pair][:, 0, 0],
            results.scan[pair][:, 0, 1],
        )
        for pair in SCANNED
    }
    return figures.gains(KPS, scans)


_SEA: Final[Mapping[str, Both]] = {
    "tilt_compass": Both("accelerometer and compass alone, best card", "仅加速度计与磁阻传感器，最佳标定卡"),
    "no gate": Both("paper, no gate", "论文，无阀值"),
    "gate 0.08 g": Both("paper, gate 0.08 g", "论文，阀值 0.08 g"),
    "no gate, best card": Both("paper's filter, no gate, best card", "论文滤波器，无阀值，最佳标定卡"),
    "gate 0.08 g, best card": Both("paper's filter, gate 0.08 g, best card", "论文滤波器，阀值 0.08 g，最佳标定卡"),
    "gate 0.08 m/s², best card": Both("gate 0.08 m/s², best card", "阀值 0.08 m/s²，最佳标定卡"),
    "Kp 0.05, Ki 0.001": Both("Kp 0.05, Ki 0.001, no gate, best card", "Kp 0.05、Ki 0.001，无阀值，最佳标定卡"),
    "vqf": Both("vqf, best card", "vqf，最佳标定卡"),
    "vqf, tau_acc 10 s": Both("vqf, tau_acc 10 s, best card", "vqf，tau_acc 10 s，最佳标定卡"),
    "mekf": Both("mekf, best card (recommended)", "mekf，最佳标定卡（推荐）"),
    "smoother": Both("smoother, best card (not causal)", "平滑器，最佳标定卡（非因果）"),
}


def _sea(results: Results) -> Report:
    rows = []
    for key, name in _SEA.items():
        many = np.median(results.sea[key], axis=0) if key in results.sea else np.full(3, np.nan)
        cells = [*many, *sea_rms(results.sailed, key)]
        rows.append([name, *("-" if math.isnan(v) else f"{v:.3f}" for v in cells)])
    seas = len(results.sea["mekf"])
    axes = [ANGLE[name] for name in ("roll", "pitch", "yaw")]
    head = (
        "", *(Both(f"{seas} seas: {axis}", f"{seas} 个海况：{axis.zh}") for axis in axes),
        *(Both(f"bytes: {axis}", f"字节流：{axis.zh}") for axis in axes),
    )  # fmt: skip
    title = Both("Rms error in waves, Hs 1.5 m, Tp 6 s [°]", "波浪中均方根误差，Hs 1.5 m、Tp 6 s [°]")
    return Report(
        Both("At sea", "海上试验"),
        tables=[Table(title, head, rows), _tilt_table(results), _quality_table(results)],
        remarks=[
            Both("The paper's Kp is ten times too high for waves: its corner, 0.08 Hz, lies just below the swell; the "
                 "gate helps little.", "论文的 Kp 对波浪约高十倍：其转折频率 0.08 Hz 恰低于涌浪频率；阀值作用不大。"),
            Both("Tilt by burst and the quality flags are what the sensors of the sea surface need for the quality "
                 "control, calibration and compensation that the paper names.",
                 "各段倾斜统计与质量标志即论文所述海面要素观测质控、校准、补偿之依据。"),
        ],
        figures=[figures.waves(results.sailed)],
    )  # fmt: skip


def _tilt_table(results: Results) -> Table:
    """Statistics of tilt by the report, whose filter is the smoother, beside the true ones."""
    truth = results.sailed.truth
    _, pitch, roll = euler_zyx_from_quat(truth.q_nb).T
    true = tilt_statistics(truth.t, roll, pitch)
    ours = results.sailed.overview.subjects[0].gathered.tilt
    assert ours is not None
    rows = []
    for name in ("roll", "pitch"):
        for who, tilt in ((Both("report", "报告"), getattr(ours, name)), (Both("truth", "真值"), getattr(true, name))):
            label = Both(f"{name}, {who}", f"{ANGLE[name].zh}，{who.zh}")
            angles = [f"{to_deg(v):.2f}" for v in (tilt.sd, tilt.significant, tilt.largest)]
            rows.append([label, *angles, f"{tilt.tz:.2f}", f"{tilt.tp:.2f}", f"{tilt.waves}"])
    head = (
        "", Both("std [°]", "标准差 [°]"), Both("significant [°]", "有效双幅值 [°]"), Both("largest [°]",
                                                                                           "最大双幅值 [°]"),
        "Tz [s]", "Tp [s]", Both("waves", "波数"),
    )  # fmt: skip
    return Table(Both("Tilt statistics of the sea through bytes", "海上试验（字节流）倾斜统计"), head, rows)


def _quality_table(results: Results) -> Table:
    """Quality flags by burst, and why where one is not a pass."""
    channels = {
        "gyr": Both("gyroscope", "陀螺仪"), "acc": Both("accelerometer", "加速度计"), "mag": Both("magnetometer",
                                                                                                  "磁力计"),
        "attitude": Both("attitude", "姿态"),
    }  # fmt: skip
    words = {1: "通过", 2: "未评估", 3: "可疑", FAIL: "不合格", 9: "缺失"}
    tests = {"gap": "缺样", "percent good": "有效率"}
    rows = []
    for burst in results.sailed.overview.subjects[0].gathered.bursts:
        cells = []
        for channel in channels:
            qc = burst.verdicts[channel]
            why = f": {qc.why}" if qc.why else ""
            zh = f"：{tests.get(qc.why, qc.why)}" if qc.why else ""
            cells.append(Both(f"{qc.flag} {MEANING[qc.flag]}{why}", f"{qc.flag} {words[qc.flag]}{zh}"))
        tilt = burst.tilt.inclination
        rows.append([f"{burst.begin:.0f} s", *cells, f"{to_deg(tilt.mean):.1f}", f"{to_deg(tilt.greatest):.1f}"])
    head = (
        Both("burst", "分段"), *channels.values(), Both("tilt mean [°]", "平均倾角 [°]"), Both("greatest [°]",
                                                                                               "最大 [°]"),
    )  # fmt: skip
    return Table(Both("Quality flags by burst of two minutes", "各 2 min 分段质量标志"), head, rows, words=(1, 2, 3, 4))
