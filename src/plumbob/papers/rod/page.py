"""Page of the rod paper."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from plumbob.papers.rod.comparison import LINES, Compared, budget, mount_angles
from plumbob.papers.rod.equations import Grown, Numerics, numerics_table
from plumbob.papers.rod.figures import covariance_figure, exchange_figure, figures, seeds_figure
from plumbob.papers.rod.methods import DISTURBANCES, DISTURBED, METHODS
from plumbob.papers.rod.methods import MethodScores as Scores
from plumbob.reporting.content import Table
from plumbob.reporting.report import Report
from plumbob.reporting.style import Both

_CHAIN: Final = (
    (
        Both("Fig 1a: ADIS16355", "图 1（a）：ADIS16355"),
        Both(
            "three rates, three specific forces, temperature; calibrated at the factory",
            "三轴角速度、三轴加速度、温度，出厂校准",
        ),
        Both(
            "preset and catalogue adis16355; a random unit of the data sheet",
            "预设与目录 adis16355；按数据手册随机抽取的单元",
        ),
    ),
    (
        Both("Fig 1b: SPI", "图 1（b）：SPI"),
        Both("the Cortex-M3 reads ten words at 100 Hz", "Cortex-M3 以 100 Hz 读取十个字"),
        Both("bytes 8 to 27 of each frame of the rig rod", "rod 装置每帧的第 8 至 27 字节"),
    ),
    (
        Both("Fig 1b: SD card", "图 1（b）：SD 卡"),
        Both("the sensor's data are stored", "保存传感器数据"),
        Both("rod.bin and its session file, recorded as rod.mcap", "rod.bin 及会话文件，记录为 rod.mcap"),
    ),
    (
        Both("Fig 4a: RS232 from the AHRS500GA", "图 4（a）：AHRS500GA 的 RS232"),
        Both("packets of 26 bytes at 100 Hz", "100 Hz、26 字节的数据包"),
        Both("bytes 28 to 53 of each frame, checked by their own sum", "每帧的第 28 至 53 字节，按其自身校验和检查"),
    ),
    (
        Both("Fig 4a: RS232 to the PC", "图 4（a）：至 PC 的 RS232"),
        Both("all data on one time line", "全部数据处于同一时间轴"),
        Both("frames of 56 bytes with a counter and a clock", "56 字节的帧，含计数与时钟"),
    ),
    (
        Both("Fig 3: fusion", "图 3：融合"),
        Both("accelerometer and gyroscope, no magnetometer", "加速度计与陀螺仪，无磁力计"),
        Both("filter ekf7; best: smoother", "滤波器 ekf7；最佳：平滑器"),
    ),
    (
        Both("Fig 5: flow of the processing", "图 5：数据处理流程"),
        Both("MATLAB, offline", "MATLAB 离线处理"),
        Both("plumbob record, run, eval", "plumbob record、run、eval"),
    ),
)
_SLIPS: Final = (
    (
        Both("§2.1", "§2.1"),
        Both(
            "both matrices are called C_n^b, but the first is n → b and the second b → n",
            "两个矩阵均记作 C_n^b，但前者为 n → b，后者为 b → n",
        ),
        Both("they are transposes", "互为转置"),
    ),
    (
        Both("(1), (3)", "（1）（3）"),
        Both(
            "minus signs in atan2(2(q2q3−q0q1), …) and atan2(2(q1q2−q0q3), …)",
            "atan2(2(q2q3−q0q1), …) 与 atan2(2(q1q2−q0q3), …) 中的负号",
        ),
        Both("plus", "应为正号"),
    ),
    (Both("(2)", "（2）"), Both("asin(−2(q1q3−q0q2))", "asin(−2(q1q3−q0q2))"), Both("right", "正确")),
    (
        Both("(7)", "（7）"),
        Both("atan", "atan"),
        Both("atan2, or a roll beyond 90° folds back", "应为 atan2，否则横滚超过 90° 时折回"),
    ),
    (
        Both("(10)", "（10）"),
        Both("cos‖W‖ and sin‖W‖", "cos‖W‖ 与 sin‖W‖"),
        Both("cos(‖W‖/2) and sin(‖W‖/2)", "cos(‖W‖/2) 与 sin(‖W‖/2)"),
    ),
    (
        Both("(11)", "（11）"),
        Both("labelled fⁿ, and of the sign of gravity", "记作 fⁿ，且取重力的符号"),
        Both("−g_b, as a specific force is", "应为 −g_b，即比力的符号"),
    ),
    (
        Both("§2.4 (3)", "§2.4 (3)"),
        Both("last columns of H garbled in the text at hand", "所得文本中 H 的末几列有误"),
        Both("the form that agrees with differences", "取与数值差分一致的形式"),
    ),
    (
        Both("§2.4 (4)", "§2.4 (4)"),
        Both("the gain takes P of the step before", "增益使用前一步的 P"),
        Both("P⁻ = ΦPΦᵀ + Q", "P⁻ = ΦPΦᵀ + Q"),
    ),
    (
        Both("§2.4", "§2.4"),
        Both("no Q, R0, P0, thresholds; no normalisation", "未给出 Q、R0、P0 与阈值；无归一化"),
        Both(
            "noises of the data sheet; R = (0.1 g)²; q brought to length 1", "取数据手册的噪声；R = (0.1 g)²；q 归一化"
        ),
    ),
    (
        Both("§2.4", "§2.4"),
        Both("q_i with i = 1 … 4, X_j with j = x, y, j", "q_i，i = 1～4；X_j，j = x, y, j"),
        Both("i = 0 … 3; j = x, y, z", "i = 0～3；j = x, y, z"),
    ),
    (
        Both("§2.1, (7), (8)", "§2.1、（7）（8）"),
        Both("roll θ is about body y, pitch about body x", "横滚角 θ 绕体轴 y，俯仰角绕体轴 x"),
        Both("here roll is about x and pitch about y, as everywhere else", "本文横滚绕 x 轴、俯仰绕 y 轴"),
    ),
)


def page(
    run: Compared,
    table: Scores,
    limits: Sequence[Sequence[Sequence[float]]],
    forms: Sequence[Numerics],
    steps: Sequence[Grown],
) -> Report:
    """Page of all parts, in the order of the paper.

    Parameters
    ----------
    run : Compared
        The run through bytes.
    table : methods.Table
        Methods over seeds.
    limits : sequence
        Of each seed, of each disturbance, the largest error of each of `methods.DISTURBED`, °.
    forms : sequence of Numerics
        How the filter's numerics matter.
    steps : sequence of Grown
        Covariance over time.
    """
    return Report(
        Both(
            "Rod paper: ADIS16355 and AHRS500GA on a rod moved by hand", "杆件论文：手动杆件上的 ADIS16355 与 AHRS500GA"
        ),
        facts=[
            (
                Both("paper", "论文"),
                Both(
                    "Li Yongjian, Zhao Zuoxi, Gao Junwen 2012, Application of the MEMS inertial sensor ADIS16355 in "
                    "attitude measurement",
                    "黎永键、赵祚喜、高俊文 2012，MEMS 惯性传感器 ADIS16355 在姿态测量中的应用",
                ),
            ),
            (
                Both("motion", "运动"),
                Both(
                    "rod moved by hand to ±20° of roll and ±15° of pitch, 600 s; vibration of 0.08 g rms at 3 to 20 "
                    "Hz after 400 s",
                    "手动杆件，横滚 ±20°、俯仰 ±15°，600 s；400 s 后振动 0.08 g（均方根），3～20 Hz",
                ),
            ),
            (
                Both("through bytes", "经由字节"),
                Both(
                    "a random unit of the data sheet that warms up by 15 K, and an AHRS500GA that sits 0.2° (1 sd) "
                    "off its place",
                    "按数据手册随机抽取、升温 15 K 的单元，以及安装偏差 0.2°（1 倍标准差）的 AHRS500GA",
                ),
            ),
            (
                Both("over seeds", "多种子"),
                Both(
                    "a factory-calibrated unit with a bias of 0.2 °/s (1 sd) at turn-on, which is assumed; simulated "
                    "without bytes",
                    "出厂校准的单元，上电零偏 0.2 °/s（1 倍标准差，假定值）；不经字节直接仿真",
                ),
            ),
            (
                Both("heading", "航向"),
                Both("not scored: without a magnetometer nothing observes it", "不评定：无磁力计时不可观测"),
            ),
        ],
        parts=[_system(), _equations(forms, steps), _compared(run), _methods(table), _mounting(run), _limits(limits)],
    )


def _system() -> Report:
    head = (Both("stage", "环节"), Both("in the paper", "论文"), Both("here", "本文"))
    return Report(
        Both("System (Figures 1, 3, 4 and 5)", "系统（图 1、3、4、5）"),
        tables=[
            Table(
                Both("The chain, and what each stage is here", "测量链路及各环节在此的对应"), head, _CHAIN, words=(1, 2)
            )
        ],
        remarks=[
            Both(
                "The paper's drawings are of its hardware; what they say is this table.",
                "论文的图为其硬件示意，内容即此表。",
            )
        ],
    )


def _equations(forms: Sequence[Numerics], steps: Sequence[Grown]) -> Report:
    head = (Both("place", "位置"), Both("printed", "印刷"), Both("correct", "更正"))
    return Report(
        Both("Equations and misprints (§2)", "公式与印刷错误（§2）"),
        tables=[
            Table(
                Both(
                    "Misprints and gaps; what each does stands in the table of all figures, above",
                    "印刷错误与缺漏；其后果见上方指标",
                ),
                head,
                _SLIPS,
                words=(1, 2),
            ),
            numerics_table(forms),
        ],
        remarks=[
            Both(
                "P does not become singular: the magnitude of gravity observes |q|, because h grows with |q|². "
                "Joseph's form and single precision change nothing.",
                "P 不会奇异：h 随 |q|² 变化，重力的模值可观测 |q|。Joseph 形式与单精度均不改变结果。",
            ),
            Both(
                "Nothing observes the heading, so its standard deviation should only grow. Where it shrinks, P has not "
                "gone along when q was corrected: the filter believes what nobody measured. That of the tilt settles "
                "within a minute.",
                "航向不可观测，其标准差本应只增不减；其减小之处，是 q 被修正时 P 未随之转换，滤波器误认为获得了航向信"
                "息。"
                "倾角的标准差在一分钟内稳定。",
            ),
            Both(
                "Without the prediction of P the filter is fed with the start bias removed, as the paper's "
                "correction at rest would; with the bias of 0.2 °/s kept it is lost. A prototype with other noise had "
                "6.5° and 6.4° before 400 s, 10.5° and 9.4° after, and 13 % of the samples within 1°.",
                "无 P 预测时，输入已扣除初始零偏（相当于论文在静止时的重调）；若保留 0.2 °/s 的零偏，滤波器完全失效。"
                "另一噪声下的原型：400 s 前 6.5° 与 6.4°，400 s 后 10.5° 与 9.4°，13 % 的样本在 1° 内。",
            ),
        ],
        figures=[covariance_figure(steps)],
    )


def _compared(run: Compared) -> Report:
    head = (
        Both("difference", "差"),
        Both("roll, largest [°]", "横滚最大 [°]"),
        Both("pitch, largest [°]", "俯仰最大 [°]"),
        Both("roll rms [°]", "横滚均方根 [°]"),
        Both("pitch rms [°]", "俯仰均方根 [°]"),
    )
    rows = []
    for key, line in LINES.items():
        parts = budget(run, key)
        for part in parts[:3] if key in ("ekf7", "mekf", "smoother") else parts[2:3]:
            numbers = [f"{v:.3f}" for v in (*part.largest, *part.rms)]
            rows.append([Both(f"{line.name}: {part.name}", f"{line.name.zh}：{part.name.zh}"), *numbers])
    rows += [[part.name, *(f"{v:.3f}" for v in (*part.largest, *part.rms))] for part in budget(run, "ekf7")[3:]]
    estimated, true = (
        ", ".join(f"{v:.2f}".replace("-", "−") for v in mount_angles(q)) for q in (run.mounting, run.true_mounting)
    )
    return Report(
        Both("One experiment through bytes (§3, Figure 6)", "经由字节的一次试验（§3，图 6）"),
        facts=[
            (
                Both("files", "文件"),
                Both(
                    "rod.bin: bytes; rod.session.toml: what they mean; rod.mcap: the recording; rod.truth.parquet: "
                    "the truth",
                    "rod.bin：字节；rod.session.toml：其含义；rod.mcap：记录；rod.truth.parquet：真值",
                ),
            ),
            (
                Both("at rest", "静止"),
                Both(f"{100.0 * run.rest.mean():.0f} % of the samples", f"{100.0 * run.rest.mean():.0f} % 的样本"),
            ),
            (
                Both("mounting of the AHRS500GA", "AHRS500GA 安装误差"),
                Both(
                    f"found from gravity {estimated}°, true {true}° about x, y, z",
                    f"由重力求得 {estimated}°，真值 {true}°（绕 x、y、z）",
                ),
            ),
        ],
        tables=[Table(Both("What the paper compares, and what it is made of", "论文所比较的差及其组成"), head, rows)],
        remarks=[
            Both(
                "What the paper calls the error is the difference of two devices; the error of the reference and its "
                "mounting are in it.",
                "论文所称的误差是两台设备之差，其中含有参考设备自身的误差与安装误差。",
            ),
            Both(
                "The mounting that gravity shows is the rotation between the axes of the two devices: the "
                "misalignment of the uncalibrated accelerometer is in it, too.",
                "由重力求得的安装误差是两台设备坐标轴之间的旋转，也包含未标定加速度计的安装误差。",
            ),
            Both(
                "The unit warms up by 15 K, so its accelerometer's bias moves by up to 0.5 mg/K · 15 K = 7.5 mg, "
                "0.43° of "
                "tilt, which no filter can see.",
                "单元升温 15 K，加速度计零偏变化可达 0.5 mg/K × 15 K = 7.5 mg，相当于 0.43° 倾角，任何滤波器都无法察"
                "觉。",
            ),
            Both(
                "The paper's Figure 6 shows curves without numbers to read off; its axes, its 600 s and its "
                "vibration after 400 s are reproduced, not its samples.",
                "论文图 6 只有曲线，无可读取的数值；复现的是其坐标、600 s 时长与 400 s 后的振动，而非逐点数据。",
            ),
        ],
        figures=figures(run),
    )


def _methods(table: Scores) -> Report:
    seeds = len(table.rested)
    head = (
        Both("method", "方法"),
        Both("0–400 s [°]", "0–400 s [°]"),
        Both("400–600 s [°]", "400–600 s [°]"),
        Both("within 1° [%]", "1° 内 [%]"),
        Both("rms [°]", "均方根 [°]"),
        Both("worst [°]", "最差 [°]"),
        Both("seeds [%]", "种子 [%]"),
    )
    cells = {
        key: [
            METHODS[key].name,
            *("{:.2f} / {:.2f}".format(*of(key)) for of in (table.early, table.late)),
            f"{100.0 * table.share(key):.1f}",
            f"{table.rms(key):.3f}",
            f"{table.largest(key).max():.2f}",
            f"{100.0 * table.pass_rate(key):.0f}",
        ]
        for key in table.scores
    }
    first = list(cells)[: list(cells).index("unpredicted")]
    titles = (
        Both(
            "Largest errors of roll / pitch, means over the seeds: sensors alone, the paper's filter, its switches",
            "横滚 / 俯仰角最大误差（各种子平均）：单一传感器、论文滤波器及其切换",
        ),
        Both("The same: misprints, and other filters", "同上：印刷错误与其他滤波器"),
    )
    tables = [
        Table(
            title,
            head,
            [cells[key] for key in keys],
            strong=[(i, 0) for i, key in enumerate(keys) if METHODS[key].ours],
        )
        for title, keys in zip(titles, (first, [key for key in cells if key not in first]), strict=True)
    ]
    jumps = ", ".join(f"{max(table.jumps[key]):.2f}°" for key in ("ekf7", "hard", "hard_reset"))
    return Report(
        Both(f"Methods over {seeds} seeds", f"{seeds} 个随机种子下的各方法"),
        tables=tables,
        remarks=[
            Both(
                "Within 1°: share of the samples; worst: largest error of all seeds; seeds: share whose largest "
                "error is "
                "within 1°.",
                "1° 内：误差在 1° 内的样本占比；最差：所有种子的最大误差；种子：最大误差在 1° 内的种子占比。",
            ),
            Both(
                f"Largest steps as rest begins or ends: {jumps} with the soft switch, the hard one, and the hard one "
                "that sets P.",
                f"进入、离开静止时的最大跳变：软切换、硬切换、重置 P 的硬切换分别为 {jumps}。",
            ),
            Both(
                "The hard switch depends on its thresholds: with 3 °/s and 0.1 g a slow begin of a move counts as "
                "rest; just above the noise of the sensors it nearly keeps ±1°. The paper gives no thresholds.",
                "硬切换取决于阈值：取 3 °/s 与 0.1 g 时，缓慢起动被当作静止；阈值略高于传感器噪声时基本满足 ±1°。论文"
                "未给出阈值。",
            ),
            Both(
                "mahony and vqf lose some seeds in their first 15 s, in which they learn the bias at turn-on; the "
                "paper's filter does so, too, but with a gain that its covariance sets.",
                "mahony 与 vqf 在最初 15 s 内学习上电零偏时，部分种子超出 1°；论文滤波器同样需要学习，但增益由协方差"
                "决定。",
            ),
            Both(
                "The smoother knows the samples after each attitude, as the paper's offline processing might; ekf7 "
                "and mekf do not.",
                "平滑器利用每一时刻之后的数据（论文为离线处理，亦可如此）；ekf7 与 mekf 则不用。",
            ),
        ],
        figures=[seeds_figure(table)],
    )


def _mounting(run: Compared) -> Report:
    return Report(
        Both("Mounting: rotation against exchanged angles (§3.2)", "安装：旋转与互换欧拉角（§3.2）"),
        remarks=[
            Both(
                "The y axis of the AHRS500GA points along the x axis of the ADIS16355. Its pitch is then nearly the "
                "other's roll, but Euler angles cannot be exchanged: at 20° and 15° that costs nearly the whole ±1°.",
                "AHRS500GA 的 y 轴与 ADIS16355 的 x 轴一致，其俯仰角近似等于后者的横滚角，但欧拉角不可互换：在 20° 与"
                " 15° 时，误差几乎用尽 ±1°。",
            ),
            Both(
                "Attitude and gravity are compared through the rotation instead, which is exact.",
                "因此经由旋转比较姿态与重力，结果精确。",
            ),
        ],
        figures=[exchange_figure(run)],
    )


def _limits(limits: Sequence[Sequence[Sequence[float]]]) -> Report:
    mean = np.mean(np.array(limits), axis=0)
    head = (Both("method", "方法"), *(what.name for what in DISTURBANCES))
    rows = [[method.name, *(f"{v:.2f}" for v in line)] for method, line in zip(DISTURBED.values(), mean.T, strict=True)]
    return Report(
        Both("What the test leaves out", "试验未涉及的情况"),
        tables=[
            Table(
                Both(
                    f"Largest error of roll and pitch [°], mean over {len(limits)} seeds",
                    f"横滚、俯仰角最大误差 [°]，{len(limits)} 个种子平均",
                ),
                head,
                rows,
            )
        ],
        remarks=[
            Both(
                "A steady acceleration is gravity to every filter here; 0.05 g is 2.9° of tilt, of which the "
                "gyroscope holds back a part for some seconds.",
                "持续加速度对各滤波器均等同于重力；0.05 g 相当于 2.9° 倾角，陀螺仪只能在数秒内抑制其一部分。",
            ),
            Both(
                "An accelerometer that reads too much is read as |q| above 1. The paper's equations bear it while q "
                "is not normalised; normalised with P left as it is, they do not. ekf7 carries P along with the "
                "quaternion, and bears it.",
                "加速度计读数偏大时表现为 |q| 大于 1。论文公式在不归一化时不受影响；若只归一化而 P 不随之改变，则产生"
                "误差。ekf7 使 P 随四元数一同转换，故不受影响。",
            ),
        ],
    )
