"""The paper's equations against what they must be, and each misprint computed as it is printed."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.units import deg, to_deg
from plumbob.live.rigs.plan import PLANS
from plumbob.papers.description import ROD
from plumbob.papers.outcome import Outcome, Part
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
from plumbob.reporting.content import SERIES, Both
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

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

ANGLES: Final = 0.3, -0.2, 0.9
"""Roll, pitch and yaw, rad, at which the printed forms are tried."""
STEP: Final = 1e-3
"""Of the central differences; all that is differentiated is quadratic, so it costs rounding alone."""
TILTS: Final = (5.0, 5.0), (10.0, 10.0), (20.0, 15.0), (30.0, 30.0)
"""Roll and pitch, °, at which exchanged angles are tried."""


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


def formulas(seed: int) -> list[Outcome]:
    """Outcomes of (1) to (8) and (10), of Φ and H, and of the mounting: closed forms, no simulation."""
    roll, pitch, yaw = ANGLES
    q = quat_from_euler_zyx(np.array([yaw, pitch, roll]))
    wrong, mirrored = printed_angles(q), printed_angles(quat_conjugate(q))
    right = np.abs(np.array(euler_zyx_from_quat(q))[::-1] - ANGLES)
    down, euler = dcm_from_quat(q), euler_matrix(roll, pitch, yaw)
    g170 = -observed(quat_from_euler_zyx(deg(np.array([0.0, 0.0, 170.0]))))
    level = [abs(float(a[0]) - b) for a, b in zip(level_angles(-observed(q)[np.newaxis]), (roll, pitch), strict=True)]
    atan2 = float(to_deg(level_angles(g170[np.newaxis])[0][0]))
    w = np.array([0.0, deg(54.0), 0.0])
    phi, h = worst_jacobians(seed)
    outcomes = ROD.rows(
        {
            "eq.euler": (None, float(right.max())),
            "misprint.eq1": (float(wrong[0]), roll),
            "misprint.eq2": float(wrong[1]),
            "misprint.eq3": (float(wrong[2]), yaw),
            "misprint.conjugate": (float(mirrored[1]), pitch),
            "misprint.matrices": (float(np.abs(euler - down).max()), float(np.abs(euler.T - down).max())),
            "eq.level": (None, float(max(level))),
            "misprint.eq7": (float(to_deg(math.atan(g170[1] / g170[2]))), atan2),
            "misprint.eq10": (turn_angle(w, half_angle=False), turn_angle(w, half_angle=True)),
            "jacobian.phi": phi,
            "jacobian.h": h,
            "mapping": (None, mapping_error(seed)),
        }
    )
    for (
        roll_deg,
        pitch_deg,
    ) in TILTS:  # what it costs to exchange Euler angles instead, and that the rotation costs none
        at = deg(np.array([[roll_deg], [pitch_deg]]))
        exchanged, rotated = (np.abs(permutation_error(at[0], at[1], by)[:, 0]) for by in (permuted, mapped))
        for axis, size, residual in zip(("roll", "pitch"), exchanged, rotated, strict=True):
            key = f"exchange.{roll_deg:g}.{pitch_deg:g}.{axis}"
            outcomes.append(ROD.row(key, faithful=float(size), best=float(residual)))
    return outcomes


def misprinted(table: methods.MethodScores) -> list[Outcome]:
    """Outcomes of the misprints that only a run shows."""
    lean, sane = (float(np.median([score.lean for score in table.scores[key]])) for key in ("upside_down", "ekf7"))
    mean = {key: float(table.largest(key).mean()) for key in ("whole_angle", "r01", "unnormalised", "r03")}
    return ROD.rows(
        {
            "misprint.eq11": (lean, sane),
            "misprint.half_angle": (mean["whole_angle"], mean["r01"]),
            "misprint.prediction.early": (float(table.early("unpredicted").max()), float(table.early("r01").max())),
            "misprint.prediction.late": (float(table.late("unpredicted").max()), float(table.late("r01").max())),
            "misprint.prediction.share": (100.0 * table.share("unpredicted"), 100.0 * table.share("r01")),
            "misprint.normalisation": (mean["unnormalised"], mean["r03"]),
        }
    )


class Grown(NamedTuple):
    """Covariance of the filter after a time.

    `t`: s; `length`, `tilt`, `heading`: standard deviations of |q|, and of tilt and heading, °; `condition`: of the
    covariance of the quaternion.
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

    `name`: the form; `largest`: largest error of roll and pitch, °; `lengths`: least and greatest |q| before
    normalisation; `least`: least eigenvalue of P at the end; `end`: the rest of P at the end.
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
        (ROD.text("i_kh_p_as"), Form()),
        (ROD.text("josephs_form"), Form(joseph=True)),
        (ROD.text("single_precision"), Form(single=True)),
        (ROD.text("no_normalisation"), Form(normalised=False)),
        (ROD.text("p_carried_with_q"), Form(carried=True)),
    ):
        run = literal(one.imu, form=form)
        size = methods.score(one.imu.t, run.q_nb, one.truth.q_nb).largest
        least = float(np.linalg.eigvalsh(0.5 * (run.p + run.p.T)).min())
        lengths = float(run.length[100:].min()), float(run.length[100:].max())
        per_form.append(Numerics(name, size, lengths, least, _grown(run.p, run.q_nb[-1], float(one.imu.t[-1]))))
    return per_form


def part(seed: int, table: methods.MethodScores, first: methods.Case) -> Part:
    """The equations: what each misprint does, and how the filter's numerics matter over the first run."""
    found, growth = forms(first), grown(first)
    printed, joseph, single, *_ = found  # P does not become singular; form and precision of the update do not matter
    numerics = {
        "covariance.least": printed.least,
        "covariance.joseph": abs(joseph.largest - printed.largest),
        "covariance.single": abs(single.largest - printed.largest),
    }
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
    report = ROD.part(
        "equations",
        tables=[ROD.table("misprints_and_gaps"), ROD.table("p_after_600", rows)],
        figures=[ROD.figure("p_over_time", partial(_draw_covariance, growth))],
    )
    return report, [*formulas(seed), *misprinted(table), *ROD.rows(numerics)]


def _draw_covariance(growth: Sequence[Grown], canvas: "FigureBase") -> None:
    angle_ax, length_ax = canvas.subplots(1, 2)
    t = [step.t for step in growth]
    angle_ax.loglog(t, [step.heading for step in growth], color=SERIES[1], marker=".", linewidth=1.0)
    angle_ax.loglog(t, [step.tilt for step in growth], color=SERIES[0], marker=".", linewidth=1.0)
    length_ax.loglog(t, [step.length for step in growth], color=SERIES[2], marker=".", linewidth=1.0)
    angle_ax.set_yticks((0.2, 0.5, 1.0, 2.0, 5.0, 10.0), ("0.2", "0.5", "1", "2", "5", "10"))
    length_ax.set_yticks((5e-4, 1e-3, 2e-3), ("0.0005", "0.001", "0.002"))
    for ax in (angle_ax, length_ax):
        ax.set_xticks((3.0, 10.0, 30.0, 100.0, 300.0), ("3", "10", "30", "100", "300"))
        ax.minorticks_off()
