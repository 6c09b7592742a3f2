"""The paper's equations against what they must be, and each misprint computed as it is printed."""

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.units import deg, to_deg
from plumbob.live.rigs.plan import PLANS
from plumbob.papers.outcome import Outcome, at_least, at_most
from plumbob.papers.rod import methods
from plumbob.papers.rod.as_printed import (
    Form,
    level_angles,
    literal,
    observation,
    observed,
    omega,
    printed_angles,
    transition,
)
from plumbob.papers.rod.comparison import mapped, permutation_error, permuted
from plumbob.reporting.content import Table
from plumbob.reporting.style import Both
from plumbob.rotations import (
    dcm_from_quat,
    euler_zyx_from_quat,
    quat_angle,
    quat_conjugate,
    quat_from_euler_zyx,
    quat_multiply,
    quat_normalize,
    quat_rotate,
)
from plumbob.simulation.errors import stream

_TINY: Final = at_most(1e-12)
ANGLES: Final = 0.3, -0.2, 0.9
"""Roll, pitch and yaw, rad, at which the printed forms are tried."""
STEP: Final = 1e-3
"""Of the central differences; all that is differentiated is quadratic, so it costs rounding alone."""
TILTS: Final = {
    (5.0, 5.0): ((0.019, 0.020), (0.018, 0.020)),
    (10.0, 10.0): ((0.15, 0.156), (0.148, 0.154)),
    (20.0, 15.0): ((0.70, 0.72), (0.905, 0.925)),
    (30.0, 30.0): ((4.3, 4.4), (3.65, 3.75)),
}
"""True roll and pitch, °, and what exchanged angles are wrong by there."""


def by_differences(f: Callable[[Floats], Floats], at: Floats) -> Floats:
    """Matrix of central differences of a function of a vector."""
    steps = STEP * np.eye(at.size)
    return np.array([(np.asarray(f(at + step)) - np.asarray(f(at - step))) / (2.0 * STEP) for step in steps]).T


def worst_jacobians(seed: int, count: int = 200) -> tuple[float, float]:
    """Largest departure of Φ and of H from central differences over random states, relative to their largest entry."""
    rng = stream(seed, "rod", "jacobians")
    phi, h, dt = 0.0, 0.0, 0.01
    for _ in range(count):
        q, w, bias = quat_normalize(rng.normal(size=4)), rng.normal(size=3), 0.1 * rng.normal(size=3)

        def stepped(v: Floats, w: Floats = w) -> Floats:
            return np.concatenate((v[:4] + 0.5 * dt * omega(w - v[4:]) @ v[:4], v[4:]))

        jacobian = transition(q, w - bias, dt)
        phi = max(phi, float(np.abs(jacobian - by_differences(stepped, np.concatenate((q, bias)))).max()))
        rows = observation(q)[:, :4]
        h = max(h, float(np.abs(rows - by_differences(observed, q)).max() / np.abs(rows).max()))
    return phi, h


def euler_matrix(roll: float, pitch: float, yaw: float) -> Floats:
    """Direction cosine matrix (3, 3) that the paper prints first: from navigation to body axes."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a), math.sin(a)) for a in (roll, pitch, yaw))
    return np.array(
        [
            [cp * cy, cp * sy, -sp],
            [-cr * sy + sr * sp * cy, cr * cy + sr * sp * sy, sr * cp],
            [sr * sy + cr * sp * cy, -sr * cy + cr * sp * sy, cr * cp],
        ]
    )


def turn_angle(w: Floats, *, half_angle: bool) -> float:
    """Angle, °, by which (10) turns for a rotation vector (3,), rad; as it is printed without the half angle."""
    size = float(np.linalg.norm(w))
    angle = 0.5 * size if half_angle else size
    q = np.concatenate(([math.cos(angle)], math.sin(angle) / size * w))
    return float(to_deg(quat_angle(q, np.array([1.0, 0.0, 0.0, 0.0]))))


def mapping_error(seed: int, count: int = 1000) -> float:
    """Largest error, rad, of attitude and gravity that come back from the reference's axes, random attitudes."""
    q_nb = quat_normalize(stream(seed, "rod", "mapping").normal(size=(count, 4)))
    back = mapped(quat_multiply(q_nb, np.array(PLANS["rod"].units[1].q_bs)))
    down = [quat_rotate(quat_conjugate(q), np.array([0.0, 0.0, 1.0])) for q in (back, q_nb)]
    return float(max(quat_angle(back, q_nb).max(), np.abs(down[0] - down[1]).max()))


def _near(value: float, by: float) -> tuple[float, float]:
    return value - by, value + by


def formulas(seed: int) -> list[Outcome]:
    """Outcomes of (1) to (8) and (10), of Φ and H, and of the mounting: closed forms, no simulation."""
    return [*_of_angles(), *_of_gravity(), *_of_matrices(seed), *permutations()]


def _of_angles() -> list[Outcome]:
    """Angles and matrices of a quaternion, (1) to (3), as printed and corrected."""
    roll, pitch, yaw = ANGLES
    q = quat_from_euler_zyx(np.array([yaw, pitch, roll]))
    wrong, mirrored = printed_angles(q), printed_angles(quat_conjugate(q))
    right = np.abs(np.array(euler_zyx_from_quat(q))[::-1] - ANGLES)
    down, euler = dcm_from_quat(q), euler_matrix(roll, pitch, yaw)
    printed = Both("as printed", "按印刷")
    return [
        Outcome(
            key="eq.euler",
            where="(1)–(3)",
            unit="rad",
            best=float(right.max()),
            best_bar=_TINY,
            what=Both(
                "angles of a quaternion, corrected: error at (0.3, −0.2, 0.9)",
                "四元数求姿态角（更正式）在 (0.3, −0.2, 0.9) 的误差",
            ),
        ),
        Outcome(
            key="misprint.eq1",
            where="(1)",
            unit="rad",
            faithful=float(wrong[0]),
            faithful_bar=_near(-0.341, 5e-4),
            best=roll,
            best_bar=_near(roll, 1e-3),
            what=Both("roll of a body at 0.3 rad, (1) as printed", "横滚角 0.3 rad 时按印刷的式（1）"),
            reason=printed,
        ),
        Outcome(
            key="misprint.eq2",
            where="(2)",
            unit="rad",
            faithful=float(wrong[1]),
            faithful_bar=_near(pitch, 1e-3),
            what=Both(
                "pitch of a body at −0.2 rad, (2) as printed, which is right",
                "俯仰角 −0.2 rad 时按印刷的式（2）（正确）",
            ),
        ),
        Outcome(
            key="misprint.eq3",
            where="(3)",
            unit="rad",
            faithful=float(wrong[2]),
            faithful_bar=_near(-0.911, 5e-4),
            best=yaw,
            best_bar=_near(yaw, 1e-3),
            what=Both("yaw of a body at 0.9 rad, (3) as printed", "航向角 0.9 rad 时按印刷的式（3）"),
            reason=printed,
        ),
        Outcome(
            key="misprint.conjugate",
            where="(1)–(3)",
            unit="rad",
            faithful=float(mirrored[1]),
            faithful_bar=_near(-0.114, 5e-4),
            best=pitch,
            what=Both(
                "pitch of a body at −0.2 rad, (2) of the conjugate, so that no convention saves all three",
                "对共轭四元数用式（2）求 −0.2 rad 的俯仰角：没有一种约定能使三式同时成立",
            ),
        ),
        Outcome(
            key="misprint.matrices",
            where="§2.1",
            faithful=float(np.abs(euler - down).max()),
            faithful_bar=at_least(0.1),
            best=float(np.abs(euler.T - down).max()),
            best_bar=_TINY,
            digits=2,
            what=Both(
                "largest difference of the two matrices called C_n^b; transposed",
                "两个记作 C_n^b 的矩阵之差的最大值；转置后",
            ),
        ),
    ]


def _of_gravity() -> list[Outcome]:
    """Angles at rest, (4) to (8), and the turn of (10)."""
    roll, pitch, yaw = ANGLES
    g_b = -observed(quat_from_euler_zyx(np.array([yaw, pitch, roll])))
    g170 = -observed(quat_from_euler_zyx(deg(np.array([0.0, 0.0, 170.0]))))
    atan, atan2 = math.atan(g170[1] / g170[2]), float(level_angles(g170[np.newaxis])[0][0])
    w = np.array([0.0, deg(54.0), 0.0])
    return [
        Outcome(
            key="eq.level",
            where="(4)–(8)",
            unit="rad",
            best=float(
                max(abs(float(a[0]) - b) for a, b in zip(level_angles(g_b[np.newaxis]), (roll, pitch), strict=True))
            ),
            best_bar=_TINY,
            what=Both("roll and pitch of gravity at rest: error", "静止时由重力求横滚、俯仰角的误差"),
        ),
        Outcome(
            key="misprint.eq7",
            where="(7)",
            unit="°",
            faithful=float(to_deg(atan)),
            faithful_bar=_near(-10.0, 0.01),
            best=float(to_deg(atan2)),
            best_bar=_near(170.0, 0.01),
            what=Both(
                "roll of a body at 170°, with atan as printed; with atan2", "横滚 170° 时按印刷的 atan；用 atan2"
            ),
        ),
        Outcome(
            key="misprint.eq10",
            where="(10)",
            unit="°",
            faithful=turn_angle(w, half_angle=False),
            faithful_bar=_near(108.0, 0.01),
            best=turn_angle(w, half_angle=True),
            best_bar=_near(54.0, 0.01),
            what=Both("turn for W = 54°, as printed; with the half angle", "W = 54° 时按印刷转过的角度；用半角"),
        ),
    ]


def _of_matrices(seed: int) -> list[Outcome]:
    """Φ and H against differences, and the mounting."""
    phi, h = worst_jacobians(seed)
    return [
        Outcome(
            key="jacobian.phi",
            where="§2.4 (1)",
            faithful=phi,
            faithful_bar=at_most(1e-8),
            digits=2,
            what=Both("Φ less central differences, 200 random states", "状态矩阵 Φ 与数值差分之差，200 个随机状态"),
        ),
        Outcome(
            key="jacobian.h",
            where="§2.4 (3)",
            faithful=h,
            faithful_bar=at_most(1e-8),
            digits=2,
            what=Both(
                "H less central differences, relative, 200 random states",
                "观测矩阵 H 与数值差分的相对差，200 个随机状态",
            ),
        ),
        Outcome(
            key="mapping",
            where="§3.2",
            unit="rad",
            best=mapping_error(seed),
            best_bar=at_most(1e-9),
            digits=2,
            what=Both(
                "attitude and gravity brought from the axes of the AHRS by the rotation: error",
                "由安装旋转将 AHRS 姿态与重力转到载体轴的误差",
            ),
        ),
    ]


def permutations() -> list[Outcome]:
    """What it costs to exchange Euler angles instead, and that the rotation costs nothing."""
    outcomes = []
    for (roll, pitch), bars in TILTS.items():
        at = deg(np.array([roll])), deg(np.array([pitch]))
        exchanged, rotated = (np.abs(permutation_error(*at, by=by)[:, 0]) for by in (permuted, mapped))
        for axis, size, residual, bar in zip(("roll", "pitch"), exchanged, rotated, bars, strict=True):
            chinese = {"roll": "横滚", "pitch": "俯仰"}[axis]
            what = Both(
                f"error of {axis} by exchanged angles at {roll:g}° of roll and {pitch:g}° of pitch",
                f"横滚 {roll:g}°、俯仰 {pitch:g}° 时互换欧拉角的{chinese}误差",
            )
            outcomes.append(
                Outcome(
                    key=f"exchange.{roll:g}.{pitch:g}.{axis}",
                    where="§3.2",
                    what=what,
                    unit="°",
                    faithful=float(size),
                    faithful_bar=bar,
                    best=float(residual),
                    best_bar=at_most(1e-7),
                )
            )
    return outcomes


def misprinted(table: methods.MethodScores) -> list[Outcome]:
    """Outcomes of the misprints that only a run shows."""
    early, late = (float(largest("unpredicted").max()) for largest in (table.early, table.late))
    lean = float(np.median([score.lean for score in table.scores["upside_down"]]))
    sane = float(np.median([score.lean for score in table.scores["ekf7"]]))
    whole_angle = float(table.largest("whole_angle").mean())
    fails = at_least(methods.LIMIT)
    return [
        Outcome(
            key="misprint.eq11",
            where="(11)",
            unit="°",
            faithful=lean,
            faithful_bar=(150.0, 180.0),
            best=sane,
            best_bar=at_most(1.0),
            what=Both(
                "angle between the estimated vertical and the true one, last minute, with +g_b as printed; with −g_b",
                "末一分钟估计铅垂线与真值之夹角：按印刷 +g_b；用 −g_b",
            ),
        ),
        Outcome(
            key="misprint.half_angle",
            where="(10)",
            unit="°",
            faithful=whole_angle,
            faithful_bar=fails,
            best=float(table.largest("r01").mean()),
            what=Both(
                "largest error of the filter without the half angle; with it", "滤波器缺半角时的最大误差；用半角"
            ),
        ),
        Outcome(
            key="misprint.prediction.early",
            where="§2.4",
            unit="°",
            faithful=early,
            faithful_bar=fails,
            best=float(table.early("r01").max()),
            what=Both(
                "largest error before 400 s without P⁻ = ΦPΦᵀ + Q, as listed; with it",
                "无 P⁻ = ΦPΦᵀ + Q（按列出的步骤）时 400 s 前的最大误差；有此步",
            ),
        ),
        Outcome(
            key="misprint.prediction.late",
            where="§2.4",
            unit="°",
            faithful=late,
            faithful_bar=fails,
            best=float(table.late("r01").max()),
            what=Both("the same after 400 s", "同上，400 s 后"),
        ),
        Outcome(
            key="misprint.prediction.share",
            where="§2.4",
            unit="%",
            faithful=100.0 * table.share("unpredicted"),
            faithful_bar=at_most(50.0),
            best=100.0 * table.share("r01"),
            what=Both(
                "share of samples within 1° without that step; with it", "无此步时误差在 1° 内的样本占比；有此步"
            ),
        ),
        Outcome(
            key="misprint.normalisation",
            where="§2.4",
            unit="°",
            faithful=float(table.largest("unnormalised").mean()),
            best=float(table.largest("r03").mean()),
            what=Both(
                "largest error without normalisation; with it, R = (0.3 g)²",
                "不归一化时的最大误差；归一化，R = (0.3 g)²",
            ),
        ),
    ]


class Grown(NamedTuple):
    """Covariance of the filter after a time.

    Attributes
    ----------
    t : float
        s.
    length, tilt, heading : float
        Standard deviations of |q|, and of tilt and heading, °.
    condition : float
        Of the covariance of the quaternion.
    """

    t: float
    length: float
    tilt: float
    heading: float
    condition: float


def grown(one: methods.Case) -> list[Grown]:
    """Follow the covariance of the paper's equations over a run, R = (0.1 g)²."""
    growth = []
    for count in np.unique(np.geomspace(200, len(one.imu), 16).astype(np.int64)):
        run = literal(one.imu[: int(count)])
        growth.append(_grown(run.p, run.q_nb[-1], float(one.imu.t[count - 1] - one.imu.t[0])))
    return growth


def _grown(p: Floats, q: Floats, t: float) -> Grown:
    pq = p[:4, :4]
    up = quat_multiply(np.array([0.0, 0.0, 0.0, 1.0]), q)  # 2 ∂q/∂heading
    level = [quat_multiply(np.array([0.0, *axis]), q) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))]
    angle = [2.0 * math.sqrt(float(v @ pq @ v)) for v in (up, *level)]
    heading, north, east = (float(to_deg(a)) for a in angle)
    return Grown(
        t, math.sqrt(float(q @ pq @ q)), math.hypot(north, east) / math.sqrt(2.0), heading, float(np.linalg.cond(pq))
    )


class Numerics(NamedTuple):
    """What one form of the filter gives of a run.

    Attributes
    ----------
    name : Both
        The form.
    largest : float
        Largest error of roll and pitch, °.
    lengths : (float, float)
        Least and greatest |q| before normalisation.
    least : float
        Least eigenvalue of P at the end.
    end : Grown
        The rest of P at the end.
    """

    name: Both
    largest: float
    lengths: tuple[float, float]
    least: float
    end: Grown


def forms(one: methods.Case) -> list[Numerics]:
    """Run the paper's equations in several forms: update, precision, normalisation; R = (0.1 g)²."""
    per_form = []
    for name, form in (
        (Both("(I−KH)P, as printed", "(I−KH)P，按印刷"), Form()),
        (Both("Joseph's form", "Joseph 形式"), Form(joseph=True)),
        (Both("single precision", "单精度"), Form(single=True)),
        (Both("no normalisation", "不归一化"), Form(normalised=False)),
        (Both("P carried with q", "P 随 q 转换"), Form(carried=True)),
    ):
        run = literal(one.imu, form=form)
        size = methods.score(one.imu.t, run.q_nb, one.truth.q_nb).largest
        least = float(np.linalg.eigvalsh(0.5 * (run.p + run.p.T)).min())
        lengths = float(run.length[100:].min()), float(run.length[100:].max())
        per_form.append(Numerics(name, size, lengths, least, _grown(run.p, run.q_nb[-1], float(one.imu.t[-1]))))
    return per_form


def numerics_table(found: Sequence[Numerics]) -> Table:
    """Table of forms."""
    head = (
        Both("form", "形式"),
        Both("largest [°]", "最大误差 [°]"),
        Both("|q|", "|q|"),
        Both("variance of |q|", "|q| 的方差"),
        Both("least eigenvalue", "最小特征值"),
        Both("condition", "条件数"),
        Both("heading sd [°]", "航向标准差 [°]"),
    )
    rows = [
        [
            form.name,
            f"{form.largest:.2f}",
            "{:.4f} … {:.4f}".format(*form.lengths),
            f"{form.end.length**2:.1e}",
            f"{form.least:.1e}",
            f"{form.end.condition:.1e}",
            f"{form.end.heading:.1f}",
        ]
        for form in found
    ]
    return Table(Both("P after 600 s, R = (0.1 g)²", "600 s 后的 P，R = (0.1 g)²"), head, rows)


def numerics(found: Sequence[Numerics]) -> list[Outcome]:
    """Outcomes of the forms: P does not become singular, and form and precision of the update do not matter."""
    printed, joseph, single, *_ = found
    same = at_most(0.01)
    return [
        Outcome(
            key="covariance.least",
            where="§2.4 (6)",
            faithful=printed.least,
            faithful_bar=at_least(1e-12),
            digits=2,
            what=Both(
                "least eigenvalue of P after 600 s, which would be 0 if P were singular",
                "600 s 后 P 的最小特征值（若 P 奇异则为 0）",
            ),
        ),
        Outcome(
            key="covariance.joseph",
            where="§2.4 (6)",
            unit="°",
            faithful=abs(joseph.largest - printed.largest),
            faithful_bar=same,
            digits=2,
            what=Both("what Joseph's form changes of the largest error", "Joseph 形式对最大误差的改变"),
        ),
        Outcome(
            key="covariance.single",
            where="§2.4 (6)",
            unit="°",
            faithful=abs(single.largest - printed.largest),
            faithful_bar=same,
            digits=2,
            what=Both("what single precision changes of it", "单精度对其的改变"),
        ),
    ]
