"""Outcomes of the rod's chain, of the run through bytes, and of the seeds."""

from typing import Final

import numpy as np

from plumbob.core.units import to_deg
from plumbob.papers.outcome import Outcome, at_least, at_most
from plumbob.papers.rod.comparison import Compared, budget
from plumbob.papers.rod.methods import LIMIT, MethodScores
from plumbob.protocols.format_toml import device
from plumbob.reporting.style import Both
from plumbob.rotations import euler_zyx_from_quat, quat_from_euler_zyx, wrap
from plumbob.simulation.presets import draw_module

BASE: Final = 0.61035e-3
"""Time base of the register SMPL_PRD, s, which the catalogue states in words."""
_AXES: Final = (("roll", "横滚角"), ("pitch", "俯仰角"))


def chain(run: Compared) -> list[Outcome]:
    """Figures of the measuring system: rates, packets, accuracy of the reference."""
    reset = next(register.reset for register in device("adis16355").registers if register.name == "SMPL_PRD")
    assert reset is not None
    packet = device("ahrs500ga")
    first = next(field.at for field in packet.messages[0].fields if field.name == "roll")
    step = float(np.median(np.diff(run.t)))
    heading, tilt = reference_rms()
    claim = Both("a claim of the paper, which no public text confirms", "论文所称，无公开资料可证实")
    return [
        Outcome(
            key="chain.sps",
            where="§1.1",
            unit="Hz",
            paper=819.2,
            faithful=1.0 / (BASE * (reset + 1)),
            faithful_bar=(819.1, 819.3),
            digits=4,
            what=Both(
                "internal sampling rate of the ADIS16355 after power-up, from its register SMPL_PRD",
                "ADIS16355 上电后的内部采样率（SMPL_PRD 寄存器）",
            ),
        ),
        Outcome(
            key="ref.heading",
            where="§3.1",
            unit="°",
            paper=0.2,
            faithful=heading,
            faithful_bar=(0.17, 0.23),
            reason=claim,
            what=Both(
                "heading of the emulated AHRS500GA, rms over 400 runs", "仿真 AHRS500GA 的航向角均方根误差（400 次）"
            ),
        ),
        Outcome(
            key="ref.tilt",
            where="§3.1",
            unit="°",
            paper=0.03,
            faithful=tilt,
            faithful_bar=(0.0255, 0.0345),
            reason=claim,
            what=Both(
                "roll and pitch of the emulated AHRS500GA, rms over 400 runs",
                "仿真 AHRS500GA 的横滚、俯仰角均方根误差（400 次）",
            ),
        ),
        Outcome(
            key="chain.ahrs_rate",
            where="§3.1",
            unit="Hz",
            paper=100.0,
            faithful=1.0 / step,
            faithful_bar=(99.9, 100.1),
            what=Both("attitudes of the AHRS500GA in a second, in the recording", "记录中 AHRS500GA 每秒的姿态数"),
        ),
        Outcome(
            key="chain.packet",
            where="§3.1",
            unit=Both("byte", "字节"),
            paper=26.0,
            faithful=float(packet.messages[0].length),
            faithful_bar=(26.0, 26.0),
            what=Both("length of a packet of the AHRS500GA", "AHRS500GA 数据包长度"),
        ),
        Outcome(
            key="chain.first",
            where="§3.1",
            paper=3.0,
            faithful=first + 1.0,
            faithful_bar=(3.0, 3.0),
            what=Both("byte of the packet at which the angles begin, from 1", "数据包中角度的起始字节（从 1 计）"),
        ),
        Outcome(
            key="chain.synchronous",
            where="§3.1",
            unit="%",
            faithful=100.0 * float(np.isfinite(run.ahrs).all(axis=1).mean()),
            faithful_bar=at_least(100.0),
            what=Both(
                "samples of the ADIS16355 that have an attitude of the AHRS500GA at their own time",
                "与 ADIS16355 同一时刻有 AHRS500GA 姿态的样本占比",
            ),
        ),
        Outcome(
            key="chain.step",
            where="§3.3",
            unit="s",
            paper=0.01,
            faithful=step,
            faithful_bar=(0.00999, 0.01001),
            what=Both("sample interval", "采样周期"),
        ),
        Outcome(
            key="chain.duration",
            where="Fig 6",
            unit="s",
            paper=600.0,
            faithful=float(run.t[-1]) + step,
            faithful_bar=(599.9, 600.1),
            what=Both("length of the experiment", "试验时长"),
        ),
    ]


def reference_rms(count: int = 400) -> tuple[float, float]:
    """Root mean square errors, °, of the heading and of the tilt that the emulated reference gives in runs of 60 s."""
    errors = draw_module("ahrs500ga", 1).attitude
    assert errors is not None
    at = np.tile([0.3, -0.1, 0.2], (60, 1))
    q_nb = quat_from_euler_zyx(at)
    every = np.array(
        [wrap(errors.said(q_nb, seed=seed, rate=1.0) - euler_zyx_from_quat(q_nb)) for seed in range(count)]
    )
    heading, *tilts = to_deg(np.sqrt((every**2).mean(axis=(0, 1))))
    return float(heading), float(np.sqrt(np.mean(np.square(tilts))))


def through_bytes(run: Compared) -> list[Outcome]:
    """What the paper's comparison gives on the recording, and what it is made of."""
    faithful, best = ({part.name[:]: part for part in budget(run, key)} for key in ("ekf7", "smoother"))
    names = list(faithful)
    outcomes = []
    for i, (axis, chinese) in enumerate(_AXES):
        for key, name, paper, what in (
            (
                "ahrs",
                names[0],
                LIMIT,
                Both(f"largest difference of {axis} to the AHRS500GA", f"{chinese}与 AHRS500GA 之差的最大值"),
            ),
            (
                "truth",
                names[2],
                None,
                Both(f"largest error of {axis} against the truth", f"{chinese}相对真值的最大误差"),
            ),
        ):
            values = (float(budgets[name].largest[i]) for budgets in (faithful, best))
            outcomes.append(
                Outcome(
                    key=f"bytes.{key}.{axis}",
                    where="§3.3 (2)" if paper else "",
                    what=what,
                    unit="°",
                    paper=paper,
                    faithful=next(values),
                    faithful_bar=at_most(LIMIT),
                    best=next(values),
                    best_bar=at_most(LIMIT),
                )
            )
    for key, what in (
        (
            "accel",
            Both("largest error of the accelerometer alone in the same recording", "同一记录中仅加速度计的最大误差"),
        ),
        ("gyro", Both("largest error of the gyroscope alone in the same recording", "同一记录中仅陀螺仪的最大误差")),
    ):
        size = float(np.abs(run.errors(run.tracks[key], run.truth.q_nb)).max())
        outcomes.append(
            Outcome(
                key=f"bytes.{key}",
                where="§3.3",
                what=what,
                unit="°",
                paper="> 5",
                faithful=size,
                faithful_bar=at_least(5.0),
            )
        )
    parts = [
        (
            Both(
                "mean square of AHRS − truth as a share of that of estimate − AHRS",
                "AHRS − 真值的均方占估计 − AHRS 均方的比例",
            ),
            "reference",
            names[3],
        ),
        (Both("of it the AHRS500GA itself", "其中 AHRS500GA 自身"), "own", names[4]),
        (Both("of it how it is mounted", "其中安装误差"), "mounted", names[5]),
    ]
    for what, key, name in parts:
        values = (
            100.0 * float((budgets[name].rms ** 2).sum() / (budgets[names[0]].rms ** 2).sum())
            for budgets in (faithful, best)
        )
        outcomes.append(
            Outcome(key=f"bytes.share.{key}", where="", what=what, unit="%", faithful=next(values), best=next(values))
        )
    assert run.truth.bias_b is not None
    late = run.t > run.t[-1] - 100.0
    bias_error = to_deg(np.sqrt(((run.bias - run.truth.bias_b)[late] ** 2).mean()))
    was = to_deg(np.sqrt((run.truth.bias_b[late] ** 2).mean()))
    outcomes.append(
        Outcome(
            key="bytes.bias",
            where="§3.3 (3)",
            unit="°/s",
            faithful=float(bias_error),
            faithful_bar=at_most(float(was)),
            what=Both(
                f"error of the estimated drift, rms of the last 100 s; the drift itself is {was:.3f} °/s",
                f"陀螺漂移估计误差，末 100 s 均方根；漂移本身 {was:.3f} °/s",
            ),
        )
    )
    return outcomes


def over_seeds(table: MethodScores) -> list[Outcome]:
    """The paper's claims over many seeds, with the bars."""
    return [*_alone(table), *_fused(table), *_switches(table)]


def _alone(table: MethodScores) -> list[Outcome]:
    """Each sensor alone, as the paper shows it."""
    late = [float(score.late.max()) for score in table.scores["accel"]]
    gyro = table.largest("gyro")
    by_hand = Both(
        "a hand moves the rod and a specific force of the ADIS16355 scatters by 0.02 g: it is right on the mean alone",
        "手动杆件且 ADIS16355 的比力噪声约 0.02 g，仅均值正确",
    )
    return [
        Outcome(
            key="accel.early",
            where="§3.3 (1)",
            unit="°",
            paper=Both("correct", "正确"),
            faithful=float(table.early("accel").max()),
            reproducible=False,
            reason=by_hand,
            what=Both("accelerometer only before 400 s: largest error", "400 s 前仅加速度计的最大误差"),
        ),
        Outcome(
            key="accel.late",
            where="§3.3 (1)",
            unit="°",
            paper="> 5",
            faithful=min(late),
            faithful_bar=at_least(5.0),
            what=Both(
                "accelerometer only after 400 s: largest error, least of all seeds",
                "400 s 后仅加速度计的最大误差，各种子中最小者",
            ),
        ),
        Outcome(
            key="gyro.largest",
            where="§3.3 (3)",
            unit="°",
            paper=Both("grows", "逐渐增大"),
            faithful=float(gyro.mean()),
            faithful_bar=at_least(5.0),
            what=Both(
                "gyroscope only, start bias removed: largest error, mean over the seeds",
                "仅陀螺仪（扣除初始零偏）的最大误差，各种子平均",
            ),
        ),
        Outcome(
            key="gyro.kept",
            where="§3.3 (3)",
            unit="°",
            paper=Both("grows", "逐渐增大"),
            faithful=float(table.largest("gyro_kept").min()),
            faithful_bar=at_least(5.0),
            what=Both(
                "gyroscope only, bias kept: largest error, least of all seeds",
                "仅陀螺仪（保留零偏）的最大误差，各种子中最小者",
            ),
        ),
        Outcome(
            key="gyro.beyond",
            where="§3.3 (3)",
            unit="%",
            faithful=100.0 * float(np.mean(gyro > 5.0)),
            what=Both(
                "seeds in which the gyroscope alone, start bias removed, is beyond 5°",
                "仅陀螺仪（扣除初始零偏）误差超过 5° 的种子占比",
            ),
        ),
    ]


def _fused(table: MethodScores) -> list[Outcome]:
    """Both fused, within ±1° and against the gyroscope alone."""
    gyro, soft, smooth = (table.largest(key) for key in ("gyro", "ekf7", "smoother"))
    return [
        Outcome(
            key="fused.kept",
            where="§3.3 (2)",
            unit="%",
            paper=100.0,
            faithful=100.0 * table.pass_rate("ekf7"),
            faithful_bar=at_least(95.0),
            best=100.0 * table.pass_rate("smoother"),
            best_bar=at_least(95.0),
            what=Both("seeds in which roll and pitch stay within ±1°", "横滚、俯仰角误差始终在 ±1° 内的种子占比"),
        ),
        Outcome(
            key="fused.equations",
            where="§2.4",
            unit="%",
            paper=100.0,
            faithful=100.0 * table.pass_rate("r01"),
            faithful_bar=at_least(95.0),
            what=Both(
                "the same for the corrected equations alone, R = (0.1 g)², no switch",
                "同上，仅用更正后的公式，R = (0.1 g)²，无切换",
            ),
        ),
        Outcome(
            key="fused.causal",
            where="",
            unit="%",
            best=100.0 * table.pass_rate("mekf_card"),
            best_bar=at_least(95.0),
            what=Both("the same for mekf with the unit's noise card, causal", "同上，mekf 配噪声卡，实时"),
        ),
        *(
            Outcome(
                key=f"fused.{axis}.{part}",
                where="§3.3 (2)",
                unit="°",
                paper=LIMIT,
                faithful=float(of("ekf7")[i]),
                faithful_bar=at_most(LIMIT),
                best=float(of("smoother")[i]),
                best_bar=at_most(0.7),
                what=Both(
                    f"largest error of {axis} {when}, mean over the seeds", f"{chinese}最大误差（{zh}），各种子平均"
                ),
            )
            for i, (axis, chinese) in enumerate(_AXES)
            for part, of, when, zh in (
                ("early", table.early, "before 400 s", "400 s 前"),
                ("late", table.late, "after 400 s", "400 s 后"),
            )
        ),
        Outcome(
            key="fused.worst",
            where="§3.3 (2)",
            unit="°",
            paper=LIMIT,
            faithful=float(soft.max()),
            faithful_bar=at_most(LIMIT),
            best=float(smooth.max()),
            best_bar=at_most(0.7),
            what=Both("largest error of roll and pitch over all seeds", "所有种子中横滚、俯仰角的最大误差"),
        ),
        Outcome(
            key="fused.rms",
            where="",
            unit="°",
            faithful=table.rms("ekf7"),
            faithful_bar=at_most(0.25),
            best=table.rms("smoother"),
            best_bar=at_most(0.25),
            what=Both("rms error of roll or pitch, the larger", "横滚、俯仰角均方根误差（较大者）"),
        ),
        Outcome(
            key="drift.ratio",
            where="§3.3 (3)",
            paper=10.0,
            faithful=float(np.median(gyro / soft)),
            faithful_bar=at_least(10.0),
            best=float(np.median(gyro / smooth)),
            best_bar=at_least(10.0),
            what=Both(
                "largest error of the gyroscope alone over that of the fusion, median of the seeds",
                "仅陀螺仪与融合的最大误差之比，种子中位数",
            ),
        ),
    ]


def _switches(table: MethodScores) -> list[Outcome]:
    """The switch at rest: hard as the paper's, and soft."""
    soft = table.largest("ekf7")
    hard = Both(
        "the thresholds are not given, and a mean of 100 samples is not the attitude at their end while the rod "
        "still creeps",
        "论文未给出阈值；杆件仍在缓慢运动时，100 个样本的均值不等于其末端时刻的姿态",
    )
    return [
        Outcome(
            key="switch.jump",
            where="§2.3",
            unit="°",
            faithful=max(table.jumps["ekf7"]),
            faithful_bar=at_most(0.3),
            what=Both(
                "largest step of the tilt error as rest begins or ends, soft switch",
                "软切换时进入、离开静止的倾角误差跳变最大值",
            ),
        ),
        Outcome(
            key="switch.hard.jump",
            where="§2.3",
            unit="°",
            faithful=max(table.jumps["hard"]),
            best=max(table.jumps["ekf7"]),
            reproducible=False,
            reason=hard,
            what=Both("the same with the paper's hard switch, 3 °/s and 0.1 g", "同上，论文的硬切换，3 °/s 与 0.1 g"),
        ),
        *(
            Outcome(
                key=f"switch.{key}",
                where="§2.3",
                unit="°",
                paper=LIMIT,
                faithful=float(table.largest(key).mean()),
                best=float(soft.mean()),
                reproducible=False,
                reason=hard,
                what=Both(f"largest error with the hard switch, {how}; soft", f"硬切换（{zh}）的最大误差；软切换"),
            )
            for key, how, zh in (
                ("hard", "P kept", "P 不重置"),
                ("hard_reset", "P set", "P 重置"),
                ("narrow", "P kept, thresholds just above the noise", "P 不重置，阈值略高于噪声"),
                ("narrow_reset", "P set, thresholds just above the noise", "P 重置，阈值略高于噪声"),
            )
        ),
    ]
