"""Ways to the rod's attitude over many seeds: what one run may owe to chance, and what each switch of the paper costs.

These runs are simulated without bytes; `plumbob.papers.rod.comparison` has the one that goes through them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.units import dps, g, to_deg
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.cards import NoiseCard
from plumbob.evaluation.metrics import attitude_errors, euler_errors
from plumbob.filters.offline import Stage, run_stage
from plumbob.papers.description import ROD
from plumbob.papers.outcome import Part
from plumbob.papers.rod import as_printed as literal
from plumbob.papers.rod.as_printed import Form
from plumbob.reporting.content import MUTED, SERIES, Both
from plumbob.reporting.report import Report
from plumbob.rotations import Frame, quat_conjugate, quat_multiply, quat_rotate
from plumbob.simulation import simulate
from plumbob.simulation.errors import stream

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

TURN_ON: Final = dps(0.2)
"""Standard deviation of the gyroscope's bias at turn-on, rad/s: assumed; the data sheet allows as much for 20 K."""
STARTS: Final = 500
"""Samples at rest at the begin, of which a fixed bias is taken: 5 s, as long as the rod waits."""
SHAKEN: Final = 400.0
"""When the vibration begins, s."""
SETTLE: Final = 1.0
"""Time from the start that is not scored, s: one look of the accelerometer is 1° off by its own noise."""
LIMIT: Final = 1.0
"""Largest error that the paper claims, °."""
REST_SD, MOTION_SD = g(0.03), g(0.1)
HARD: Final[Mapping[str, Any]] = {"hard_switch": True}
NARROW: Final[Mapping[str, Any]] = {"rest_rate": "1.7 deg/s", "rest_force": "0.08 g"}
"""Thresholds just above the noise of the sensors at rest, for the hard switch."""


@dataclass(frozen=True, eq=False)
class Case:
    """One seed.

    `imu`: samples of a unit whose gyroscope has a bias at turn-on; `started`: the same without the mean rate of the
    first 5 s; `truth`: true attitude; `noise`: noise of the unit; `soft`: what "ekf7" gives of `imu`, with the
    flags of its detector of rest.
    """

    imu: ImuData
    started: ImuData
    truth: AttitudeTrack
    noise: NoiseCard
    soft: AttitudeTrack

    @property
    def rest(self) -> NDArray[np.bool_]:
        """Samples at which the detector finds rest, (N,)."""
        assert self.soft.flags is not None
        return np.asarray((self.soft.flags & flags.AT_REST) != 0)


def case(seed: int, duration: float = 600.0) -> Case:
    """Rod of a seed: a factory-calibrated ADIS16355 with a bias at turn-on, NED."""
    made = simulate("rod", frame=Frame.NED, sensors="adis16355", unit="calibrated", seed=seed, duration=duration)
    assert made.imu.gyr is not None
    gyr = made.imu.gyr + TURN_ON * stream(seed, "rod", "turn-on").standard_normal(3)
    imu = with_rates(made.imu, gyr)
    soft = run_stage(imu, Stage("ekf7", {}), frame=Frame.NED)
    return Case(imu, with_rates(imu, gyr - gyr[:STARTS].mean(axis=0)), made.truth, made.noise, soft)


def with_rates(imu: ImuData, gyr: Floats) -> ImuData:
    """Samples with other rates (N, 3), rad/s."""
    return imu.corrected(meta=imu.meta, gyr=gyr)


Way = Callable[[Case], Floats]
"""From a seed to attitudes (N, 4)."""


def _filtered(
    filter: str, params: Mapping[str, Any] | None = None, *, started: bool = False, card: bool = False
) -> Way:
    """A filter of Plumbob, with a user's parameters or the unit's noise card."""

    def way(rod: Case) -> Floats:
        stage = Stage(filter, params or {}, noise=rod.noise if card else None)
        return run_stage(rod.started if started else rod.imu, stage, frame=Frame.NED).q_nb

    return way


def _literal(acc_g: float = 0.1, *, started: bool = False, **form: bool) -> Way:
    """The paper's equations with one noise of the accelerometer, g, and with switches."""
    return lambda rod: literal.literal(rod.started if started else rod.imu, g(acc_g), Form(**form)).q_nb


def _switched(rod: Case) -> Floats:
    """The paper's equations with two noises, at rest and in motion."""
    return literal.literal(rod.imu, np.where(rod.rest, REST_SD, MOTION_SD)).q_nb


@dataclass(frozen=True, eq=False)
class Method:
    """A way, and what it is called."""

    name: Both
    way: Way
    ours: bool = False


METHODS: Final[Mapping[str, Method]] = {
    "accel": Method(ROD.text("accelerometer_only"), _filtered("tilt_compass")),
    "gyro": Method(ROD.text("gyroscope_only_start_bias"), _filtered("integrate", started=True)),
    "gyro_kept": Method(ROD.text("gyroscope_only_bias_kept"), _filtered("integrate")),
    "r01": Method(ROD.text("7_state_filter_r"), _literal()),
    "r003": Method(ROD.text("7_state_filter_r_0"), _literal(0.03)),
    "r03": Method(ROD.text("7_state_filter_r_0_3"), _literal(0.3)),
    "r1": Method(ROD.text("7_state_filter_r_1"), _literal(1.0)),
    "hard": Method(ROD.text("hard_switch_p_kept"), _filtered("ekf7", HARD)),
    "hard_reset": Method(ROD.text("hard_switch_p_set"), _filtered("ekf7", {**HARD, "reset": True})),
    "narrow": Method(ROD.text("hard_switch_p_kept_1"), _filtered("ekf7", {**HARD, **NARROW})),
    "narrow_reset": Method(ROD.text("hard_switch_p_set_1"), _filtered("ekf7", {**HARD, **NARROW, "reset": True})),
    "soft": Method(ROD.text("soft_switch_r_0"), _switched),
    "ekf7": Method(ROD.text("ekf7_soft_switch_without"), lambda rod: rod.soft.q_nb, ours=True),
    "unpredicted": Method(ROD.text("no_prediction_of_p"), _literal(started=True, predicted=False)),
    "unpredicted_kept": Method(ROD.text("no_prediction_of_p_bias"), _literal(predicted=False)),
    "unnormalised": Method(ROD.text("no_normalisation_r_0"), _literal(0.3, normalised=False)),
    "whole_angle": Method(ROD.text("10_without_the_half"), _literal(half_angle=False)),
    "upside_down": Method(ROD.text("11_with_the_sign"), _literal(specific_force=False)),
    "mahony": Method(ROD.text("mahony"), _filtered("mahony")),
    "vqf": Method(ROD.text("vqf"), _filtered("vqf")),
    "mekf": Method(ROD.text("mekf"), _filtered("mekf"), ours=True),
    "mekf_card": Method(ROD.text("mekf_noise_card"), _filtered("mekf", card=True), ours=True),
    "smoother": Method(ROD.text("smoother_noise_card"), _filtered("smoother", card=True), ours=True),
}
"""Rows of the table: first what the paper compares, then its filter, its switches, its misprints, and other filters."""


def tilt_errors(q_est: Floats, q_true: Floats) -> Floats:
    """Errors of roll and pitch (2, N), °: differences of Euler angles, which hold for a heading that drifts."""
    return np.asarray(to_deg(euler_errors(q_est, q_true)[:, [2, 1]].T))


def leans(q_est: Floats, q_true: Floats) -> Floats:
    """Angle between the estimated and the true vertical, (N,), °, which knows no gimbal lock."""
    return np.asarray(to_deg(attitude_errors(q_est, q_true)["inclination"]))


class Score(NamedTuple):
    """What one way gives of one seed, °.

    `early`, `late` (2,): largest error of roll and pitch before and after the vibration begins; `rms` (2,): root
    mean square of both; `share`: share of the samples at which both are within 1°; `lean`: median angle of the
    vertical over the last tenth.
    """

    early: Floats
    late: Floats
    rms: Floats
    share: float
    lean: float

    @property
    def largest(self) -> float:
        """Largest error of both angles over all."""
        return float(max(self.early.max(), self.late.max(initial=0.0)))


def score(t: Floats, q_est: Floats, q_true: Floats) -> Score:
    """Score attitudes (N, 4) at times (N,), s, by the true ones."""
    since = t - t[0]
    e = np.abs(tilt_errors(q_est, q_true)[:, since >= SETTLE])
    early = since[since >= SETTLE] < SHAKEN
    lean = float(np.median(leans(q_est, q_true)[-len(t) // 10 :]))
    return Score(
        e[:, early].max(axis=1),
        e[:, ~early].max(axis=1, initial=0.0),
        np.sqrt((e**2).mean(axis=1)),
        float((e <= LIMIT).all(axis=0).mean()),
        lean,
    )


def jumps(q_est: Floats, q_true: Floats, rest: NDArray[np.bool_]) -> float:
    """Largest change of the tilt error from one sample to the next about each begin and end of rest, °."""
    error = quat_multiply(q_est, quat_conjugate(q_true))
    turned = np.linalg.norm(np.diff(quat_rotate(error, np.array([0.0, 0.0, -1.0])), axis=0), axis=1)
    switches = np.flatnonzero(np.diff(rest.astype(np.int64)))
    near = np.unique((switches[:, np.newaxis] + [-1, 0, 1]).ravel())
    near = near[(near >= 0) & (near < turned.size)]
    return float(to_deg(turned[near].max(initial=0.0)))


@dataclass(frozen=True, eq=False)
class MethodScores:
    """Scores of every way over the seeds, and the jumps of the soft and the hard switch, °."""

    scores: Mapping[str, Sequence[Score]]
    jumps: Mapping[str, Sequence[float]]
    rested: Sequence[float]

    def early(self, key: str) -> Floats:
        """Mean over the seeds of the largest error of roll and pitch before the vibration, (2,), °."""
        return np.asarray(np.mean([seed_score.early for seed_score in self.scores[key]], axis=0))

    def late(self, key: str) -> Floats:
        """The same after it has begun."""
        return np.asarray(np.mean([seed_score.late for seed_score in self.scores[key]], axis=0))

    def share(self, key: str) -> float:
        """Share of all samples within 1°."""
        return float(np.mean([seed_score.share for seed_score in self.scores[key]]))

    def rms(self, key: str) -> float:
        """Root mean square of roll and pitch over all seeds, the larger one, °."""
        return float(np.sqrt(np.mean([seed_score.rms**2 for seed_score in self.scores[key]], axis=0)).max())

    def largest(self, key: str) -> Floats:
        """Largest error of each seed, (seeds,), °."""
        return np.array([seed_score.largest for seed_score in self.scores[key]])

    def pass_rate(self, key: str) -> float:
        """Share of the seeds whose largest error is within 1°."""
        return float(np.mean(self.largest(key) <= LIMIT))


def measure(
    seeds: Sequence[int],
    *,
    keys: Sequence[str] = tuple(METHODS),
    duration: float = 600.0,
    progress: Callable[[int], None] = lambda done: None,
) -> MethodScores:
    """Run every way on every seed."""
    scores: dict[str, list[Score]] = {key: [] for key in keys}
    jump_sizes: dict[str, list[float]] = {"ekf7": [], "hard": [], "hard_reset": []}
    rested = []
    for done, seed in enumerate(seeds):
        progress(done)
        rod = case(seed, duration)
        for key in keys:
            q_nb = METHODS[key].way(rod)
            scores[key].append(score(rod.imu.t, q_nb, rod.truth.q_nb))
            if key in jump_sizes:
                jump_sizes[key].append(jumps(q_nb, rod.truth.q_nb, rod.rest))
        rested.append(float(rod.rest.mean()))
    return MethodScores(scores, jump_sizes, rested)


def part(table: MethodScores) -> Part:
    """The paper's claims over many seeds, with the bars: each sensor alone, both fused, and the switch at rest."""
    gyro, soft, smooth = (table.largest(key) for key in ("gyro", "ekf7", "smoother"))
    outcomes = ROD.rows(
        {
            "accel.early": float(table.early("accel").max()),
            "accel.late": min(float(score.late.max()) for score in table.scores["accel"]),
            "gyro.largest": float(gyro.mean()),
            "gyro.kept": float(table.largest("gyro_kept").min()),
            "gyro.beyond": 100.0 * float(np.mean(gyro > 5.0)),
            "fused.kept": (100.0 * table.pass_rate("ekf7"), 100.0 * table.pass_rate("smoother")),
            "fused.equations": 100.0 * table.pass_rate("r01"),
            "fused.causal": (None, 100.0 * table.pass_rate("mekf_card")),
            **{
                f"fused.{axis}.{name}": (float(of("ekf7")[i]), float(of("smoother")[i]))
                for i, axis in enumerate(("roll", "pitch"))
                for name, of in (("early", table.early), ("late", table.late))
            },
            "fused.worst": (float(soft.max()), float(smooth.max())),
            "fused.rms": (table.rms("ekf7"), table.rms("smoother")),
            "drift.ratio": (float(np.median(gyro / soft)), float(np.median(gyro / smooth))),
            "switch.jump": max(table.jumps["ekf7"]),
            "switch.hard.jump": (max(table.jumps["hard"]), max(table.jumps["ekf7"])),
            **{
                f"switch.{key}": (float(table.largest(key).mean()), float(soft.mean()))
                for key in ("hard", "hard_reset", "narrow", "narrow_reset")
            },
        }
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
    titles = (ROD.text("largest_errors_of_roll"), ROD.text("same_misprints_and_other"))
    tables = [
        ROD.table(
            "methods",
            [cells[key] for key in keys],
            title=title,
            strong=[(i, 0) for i, key in enumerate(keys) if METHODS[key].ours],
        )
        for title, keys in zip(titles, (first, [key for key in cells if key not in first]), strict=True)
    ]
    jumps = ", ".join(f"{max(table.jumps[key]):.2f}°" for key in ("ekf7", "hard", "hard_reset"))
    figures = [ROD.figure("largest_error_of", partial(_draw_seeds, table))]
    return ROD.part("methods", seeds=len(table.rested), jumps=jumps, tables=tables, figures=figures), outcomes


def _draw_seeds(table: MethodScores, canvas: "FigureBase") -> None:
    ax, keys = canvas.subplots(), list(table.scores)[::-1]
    for row, key in enumerate(keys):
        largest, colour = table.largest(key), SERIES[2] if METHODS[key].ours else SERIES[0]
        ax.text(-0.01, row, METHODS[key].name, transform=ax.get_yaxis_transform(), ha="right", va="center")
        ax.plot(largest, np.full(largest.size, row), "|", color=colour, markersize=6.0)
    ax.set_yticks(range(len(keys)), [""] * len(keys))
    ax.axvline(LIMIT, color=MUTED, linewidth=0.7, linestyle="--")
    ax.set_xscale("log")
    ax.set_xticks((0.3, 1.0, 3.0, 10.0, 30.0, 100.0), ("0.3", "1", "3", "10", "30", "100"))


Disturbance = Callable[[ImuData, AttitudeTrack], ImuData]
"""Something that the table's runs do not have, from samples and the true attitude."""


def _scaled(share: float, imu: ImuData, _: AttitudeTrack) -> ImuData:
    assert imu.acc is not None
    return imu.corrected(meta=imu.meta, acc=imu.acc * (1.0 + share))


def _driven(size: float, length: float, imu: ImuData, truth: AttitudeTrack) -> ImuData:
    """With a steady acceleration northward from 200 s on."""
    assert imu.acc is not None
    on = (imu.t - imu.t[0] >= 200.0) & (imu.t - imu.t[0] < 200.0 + length)
    pushed = quat_rotate(quat_conjugate(truth.q_nb), np.array([size, 0.0, 0.0]))
    return imu.corrected(meta=imu.meta, acc=imu.acc + on[:, np.newaxis] * pushed)


DISTURBANCES: Final[Mapping[Both, Disturbance]] = {
    ROD.text("as_in_the_table"): lambda imu, _: imu,
    ROD.text("accelerometer_reads_2_too"): partial(_scaled, 0.02),
    ROD.text("0_05_g_for"): partial(_driven, g(0.05), 5.0),
    ROD.text("0_1_g_for"): partial(_driven, g(0.1), 10.0),
}
"""What papers.md names as the limits of the test: sustained acceleration, and an error of scale."""
DISTURBED: Final[Mapping[str, Method]] = {
    "r01": METHODS["r01"],
    "length_free": Method(ROD.text("same_not_normalised"), _literal(normalised=False)),
    "carried": Method(ROD.text("same_p_carried_with"), _literal(carried=True)),
    "ekf7": METHODS["ekf7"],
    "mekf_card": METHODS["mekf_card"],
    "smoother": METHODS["smoother"],
}
"""Ways that are tried under them."""


def disturbed(one: Case) -> list[list[float]]:
    """Largest error of each of `DISTURBED`, °, under each disturbance."""
    errors = []
    for change in DISTURBANCES.values():
        imu = change(one.imu, one.truth)
        soft = run_stage(imu, Stage("ekf7", {}), frame=Frame.NED)
        changed = Case(imu, one.started, one.truth, one.noise, soft)
        errors.append([score(imu.t, way.way(changed), one.truth.q_nb).largest for way in DISTURBED.values()])
    return errors


def limits(errors: Sequence[Sequence[Sequence[float]]]) -> Report:
    """What `disturbed` gives of each seed, on average."""
    head = (ROD.text("method"), *DISTURBANCES)
    mean = np.mean(np.array(errors), axis=0)
    rows = [[method.name, *(f"{v:.2f}" for v in line)] for method, line in zip(DISTURBED.values(), mean.T, strict=True)]
    return ROD.part("limits", tables=[ROD.table("largest_error_of", rows, limits=len(errors), head=head)])
