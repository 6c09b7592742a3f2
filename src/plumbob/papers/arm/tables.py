"""Tables 1 and 2 over many seeds, the control, the recovery from a wrong start, and the design of the rules."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from plumbob.arm.array import estimate
from plumbob.arm.array.monitoring import MonitoringSettings
from plumbob.arm.array.paper import Scheme, paper
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import deg, dps, to_deg
from plumbob.data.array import ImuArray
from plumbob.door.calibrate import read_track
from plumbob.door.reading import read_array
from plumbob.papers.arm.simulated import (
    ALL,
    AXES,
    DURATION,
    FIELD,
    RATE,
    Over,
    UnitErrors,
    arm,
    assumed_noise,
    errors_deg,
    over_seeds,
    pair,
    quiet,
    statistics,
    time_axis,
    with_noise,
)
from plumbob.papers.description import ARM
from plumbob.papers.outcome import Outcome, Part
from plumbob.papers.workspace import Work
from plumbob.reporting.content import MUTED, SERIES, SHADE, Both
from plumbob.rotations import Frame, euler_zyx_from_quat, quat_from_euler_zyx, quat_multiply

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

SCHEMES: Final[Mapping[str, Scheme]] = {
    "none": Scheme(set1="none", sets=1, ekf=False),
    "pi": Scheme(set1="pi", sets=1),
    "fuzzy": Scheme(),
    "control": Scheme(set1="pi"),
    "ekf": Scheme(set1="none", sets=1),
    "bare": Scheme(ekf=False),
    "sum": Scheme(sum_table=True),
}
"""The paper's three contenders; the control, which has the same law on both sets; and what each part does alone."""
WORDS: Final[Mapping[str, Both]] = ARM.texts("words")
CASES: Final = {False: "static", True: "turn"}
PAPER: Final[Mapping[bool, Mapping[str, Sequence[float]]]] = {
    turns: {name: [ARM.printed(f"{case}.{name}.{axis}") for axis in AXES] for name in ("none", "pi", "fuzzy")}
    for turns, case in CASES.items()
}
"""Standard deviations that the paper prints at rest and in the turn, deg, in the order of `AXES`."""
SEEDS: Final = 600
"""So many that the standard error of a figure is about a tenth of what the seeds of one run scatter by."""


def settings(noise: UnitErrors) -> MonitoringSettings:
    """What is known of a unit's bias: how it is spread."""
    return MonitoringSettings(gyr_bias=noise.bias / np.sqrt(3.0))


def body_attitude(array: ImuArray, noise: UnitErrors) -> Floats:
    """Attitude (N, 4) of the body by the filter of directions of Plumbob's arrays."""
    return estimate(array, "directions", frame=Frame.NED, settings=settings(noise)).track.q_nb


def measured(
    turns: bool,
    seeds: int,
    *,
    rate: float = RATE,
    noise: UnitErrors | None = None,
    ours: bool = True,
    schemes: Mapping[str, Scheme] = SCHEMES,
) -> dict[str, Over]:
    """Statistics of every scheme over seeds 1, 2, …, and of two and six units by Plumbob's filter where `ours`."""
    stats: dict[str, list[Floats]] = {}
    noise = noise or assumed_noise(turns)
    for seed in range(1, seeds + 1):
        array, truth = arm(seed, turns=turns, rate=rate, noise=noise)
        tracks = {name: paper(array, frame=Frame.NED, scheme=scheme).q_nb for name, scheme in schemes.items()}
        if "pi" in tracks and "fuzzy" in tracks:
            start = tracks["fuzzy"][0]
            tracks["pi, common start"] = paper(array, frame=Frame.NED, scheme=schemes["pi"], start=start).q_nb
        if ours:
            tracks |= {"two": body_attitude(pair(array), noise), "six": body_attitude(array, noise)}
        for name, q_nb in tracks.items():
            stats.setdefault(name, []).append(statistics(errors_deg(q_nb, truth)))
    return {name: over_seeds(runs) for name, runs in stats.items()}


def least(turns: bool, units: int, runs: int = 2000, seed: int = 0) -> Floats:
    """Mean standard deviations (3,), deg, of the best linear causal filter of the same noise, from its first sample.

    A Kalman filter of the turn θ and the biases, which knows the motion's true rate, the field and all noises; no
    causal filter can be better by more than chance.
    """
    noise, dt, rng = assumed_noise(turns), 1.0 / RATE, np.random.default_rng([seed, turns, units])
    share, level = 1.0 / np.sqrt(units), float(FIELD[0])
    gyr, acc, mag = share * noise.gyr, share * noise.acc / G0, share * noise.mag / level
    x = np.zeros((runs, 6))
    x[:, 3:] = rng.uniform(-noise.bias, noise.bias, (units, runs, 3)).mean(axis=0)
    h = np.zeros((3, 6))
    h[0, 1], h[1, 0], h[2, 0], h[2, 2] = 1.0, 1.0, FIELD[2] / level, -1.0
    r = np.array([acc, acc, mag])
    p = np.diag([10.0] * 3 + [(share * noise.bias) ** 2 / 3.0] * 3)
    guess, errors = np.zeros_like(x), []
    for k in range(round(DURATION * RATE)):
        if k:
            heading = deg(-90.0) * (k - 0.5) * dt / DURATION if turns else 0.0
            c, s = np.cos(heading), np.sin(heading)
            f = np.eye(6)
            f[:3, 3:] = dt * np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            x, guess, p = x @ f.T, guess @ f.T, f @ p @ f.T
            x[:, :3] += gyr * dt * rng.normal(size=(runs, 3))
            p[:3, :3] += np.eye(3) * (gyr * dt) ** 2
        gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + np.diag(r**2))
        guess = guess + (x @ h.T + r * rng.normal(size=(runs, 3)) - guess @ h.T) @ gain.T
        p = (np.eye(6) - gain @ h) @ p
        errors.append(guess[:, :3] - x[:, :3])
    std: Floats = np.asarray(to_deg(np.std(errors, axis=0))).mean(axis=0)
    return std


class Recovery(NamedTuple):
    """How a scheme forgets a wrong start, without noise.

    `t` (N,): s; `error_deg` (N,): largest size of the errors of roll, pitch and yaw; `time`: from then on it stays
    below 0.5°, s; infinite where it does not.
    """

    t: Floats
    error_deg: Floats
    time: float


def recovery(scheme: Scheme, euler_deg: tuple[float, float, float] = (10.0, 0.0, 0.0)) -> Recovery:
    """Of a start that is wrong by yaw, pitch and roll, deg; 120 s."""
    array, truth = quiet()
    start = quat_multiply(quat_from_euler_zyx(deg(np.array(euler_deg))), truth[0])
    error = np.abs(errors_deg(paper(array, frame=Frame.NED, scheme=scheme, start=start).q_nb, truth)).max(axis=1)
    late = np.flatnonzero(error >= 0.5)
    after = int(late[-1]) + 1 if late.size else 0
    return Recovery(array.t, error, float(array.t[after]) if after < error.size else float("inf"))


RECOVERIES: Final[Mapping[str, Scheme]] = {
    "fuzzy": Scheme(ekf=False),
    "control": Scheme(set1="pi", ekf=False),
    "sum": Scheme(sum_table=True, ekf=False),
    "sum_alone": Scheme(sum_table=True, sets=1, ekf=False),
    "ekf": Scheme(),
}
STARTS: Final[Mapping[str, tuple[float, float, float]]] = {
    "yaw": (10.0, 0.0, 0.0),
    "roll": (0.0, 0.0, 10.0),
    "pitch": (0.0, 10.0, 0.0),
    "each": (10.0 / 3**0.5,) * 3,
    "all": (10.0, 10.0, 10.0),
}
"""Wrong starts: yaw, pitch and roll, deg."""
DESIGNS: Final = ((0.3, 3.0), (0.8, 9.0), (4.5, 9.0))
"""Slope, 1/s, and correction of large errors, deg/s, of rules that were compared."""


def designs(seeds: int) -> list[tuple[float, float, Over, float]]:
    """Slope, far correction, statistics at rest of fuzzy-PI, and recovery from 10° of yaw with it, of `DESIGNS`."""
    schemes = {f"{c} {far}": Scheme(slope=c, far=dps(far)) for c, far in DESIGNS}
    stats = measured(False, seeds, ours=False, schemes=schemes)
    return [
        (c, far, stats[name], recovery(scheme._replace(ekf=False)).time)
        for (c, far), (name, scheme) in zip(DESIGNS, schemes.items(), strict=True)
    ]


class BytesRun(NamedTuple):
    """One run through bytes.

    `t` (N,): s; `truth` (N, 4): attitude of the body in NED; `tracks` (N, 4): attitude by each scheme, and "six" by
    Plumbob's filter.
    """

    t: Floats
    truth: Floats
    tracks: Mapping[str, Floats]

    def errors(self, name: str) -> Floats:
        """Errors (N, 3), deg."""
        return errors_deg(self.tracks[name], self.truth)


def through_bytes(work: Work, *, turns: bool) -> BytesRun:
    """One run of every scheme, and of Plumbob's filter, on what a session recorded of the rig's bytes."""
    name = "turn" if turns else "rest"
    still = {} if turns else {"turn": "0 deg"}
    taken = work.recorded("arm", name, session=ALL, sensors=f"arm:{name}", scenario="arm", set=still)
    noise = assumed_noise(turns)
    array = with_noise(read_array(taken.recording, mounts="arm"), noise)
    track = read_track(taken.truth.with_stem(f"{taken.truth.stem}-u1"))  # u1 is aligned with the body
    tracks = {name: paper(array, frame=Frame.NED, scheme=scheme).q_nb for name, scheme in SCHEMES.items()}
    tracks["six"] = body_attitude(array, noise)
    return BytesRun(array.t, track.q_nb, tracks)


def of_table(turns: bool, found: Mapping[str, Over], optimum: Floats) -> list[Outcome]:
    """Outcomes of a table, by angle: standard deviations, ranges, the control, ratios, and Plumbob's."""
    case, six = CASES[turns], found["six"]
    figures: dict[str, float | tuple[float | None, float]] = {}
    for end, field in (("", "std"), (".range", "range")):
        for name in PAPER[turns]:
            for axis, value, best in zip(AXES, getattr(found[name], field), getattr(six, field), strict=True):
                figures[f"{case}.{name}{end}.{axis}"] = (value, best) if name == "fuzzy" else value
    figures |= {f"{case}.control.{axis}": value for axis, value in zip(AXES, found["control"].std, strict=True)}
    for above, below in (("pi", "none"), ("fuzzy", "pi")):
        ratios = zip(AXES, found[above].std / found[below].std, strict=True)
        figures |= {f"{case}.{above}_over_{below}.{axis}": ratio for axis, ratio in ratios}
    made, two = ARM.rows(figures), found["two"]
    for i, axis in enumerate(AXES):
        row = ARM.row(f"{case}.two.{axis}", best=float(two.std[i]))
        values = {"limit": row.best_bar[1], "std": two.std[i], "error": two.standard_error[i], "optimum": optimum[i]}
        made.append(row if row.met else replace(row, reason=ARM.text("best_causal_filter_of", **values)))
    return [*made, ARM.row(f"{case}.none.rms", faithful=float(found["none"].rms.mean()))]


def _three(values: Sequence[float] | Floats) -> str:
    return "/".join(f"{value:.3f}" for value in values)


def part(turns: bool, stats: Mapping[str, Over], run: BytesRun, seeds: int) -> Part:
    """Table 1 or 2 over seeds, with its figures: errors over time within the paper's standard deviation, ±."""
    rows = [
        [
            WORDS.get(name, ARM.text("pi_that_starts_from")),
            _three(PAPER[turns][name]) if name in PAPER[turns] else "-",
            *(_three(values) for values in (over.std, over.standard_error, over.range, over.rms)),
        ]
        for name, over in stats.items()
    ]
    name = "turn" if turns else "rest"
    figures = [ARM.figure("figure_6", partial(_draw_heading, run))] if turns else []
    for number, (scheme, what) in enumerate(ARM.texts("what").items(), 7 if turns else 3):
        draw = partial(_draw_errors, run.t, run.errors(scheme), run.errors("six"), PAPER[turns][scheme])
        figures.append(ARM.figure("errors", draw, number=number, how=ARM.texts("how")[name], what=what))
    report = ARM.part(
        name,
        tables=[ARM.table("table_attitude_errors", rows, turns=1 + turns, seeds=seeds)],
        figures=figures,
        std=stats["none"].std.mean(),
        rms=stats["none"].rms.mean(),
        ratio=(stats["fuzzy"].std / stats["pi, common start"].std).max(),
    )
    return report, of_table(turns, stats, least(turns, 2))


def _draw_errors(t: Floats, faithful: Floats, best: Floats, printed: Sequence[float], canvas: "FigureBase") -> None:
    panels, angles = canvas.subplots(3, 1, sharex=True), ARM.texts("angles")
    limit = 1.08 * max(float(np.abs(faithful).max()), float(np.abs(best).max()), *printed)
    for axis, (ax, (std, span, rms)) in enumerate(zip(panels, statistics(faithful).T.tolist(), strict=True)):
        ax.axhspan(-printed[axis], printed[axis], color=SHADE, linewidth=0)
        ax.axhline(0.0, color=MUTED, linewidth=0.5)
        ax.plot(t, faithful[:, axis], color=SERIES[0], linewidth=0.8)
        ax.plot(t, best[:, axis], color=SERIES[2], linewidth=0.8)
        ax.set_ylim(-limit, limit)
        ax.set_ylabel(ARM.text("angle_in_degrees", word=angles[AXES[axis]]))
        notes = (
            ("std", "标准差", std), ("range", "误差范围", span), ("rms", "均方根", rms),
            ("std, paper", "论文标准差", printed[axis]),
        )  # fmt: skip
        for line, (en, zh, value) in enumerate(notes):
            note = ARM.text("margin_note", en=en, value=value, zh=zh)
            ax.text(1.015, 0.95 - 0.22 * line, note, transform=ax.transAxes, va="top", color=MUTED)
    time_axis(panels[-1], t)


def _draw_heading(run: BytesRun, canvas: "FigureBase") -> None:
    """Figure 6: the heading in the turn, and what it is away from the truth."""
    ax, away = canvas.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
    true, *others = (
        to_deg(np.unwrap(euler_zyx_from_quat(q_nb)[:, 0]))
        for q_nb in (run.truth, run.tracks["fuzzy"], run.tracks["six"])
    )
    lines = zip((true, *others), (SERIES[4], SERIES[0], SERIES[2]), (2.8, 0.9, 0.9), ("-", "-", "--"), strict=True)
    for angle, colour, width, dash in lines:
        ax.plot(run.t, angle, color=colour, linewidth=width, linestyle=dash)
        away.plot(run.t, angle - true, color=colour, linewidth=width, linestyle=dash)
    ax.set_yticks((-90, -60, -30, 0))
    time_axis(away, run.t)


def source(few: int) -> Part:
    """Control, recovery from a wrong start, also in closed form, and the design of the rules."""
    words = ARM.texts("recoveries")
    runs = {name: recovery(scheme) for name, scheme in RECOVERIES.items()}
    slow = {"control": ARM.text("10_of_yaw_take", slow_mode=slow_mode())}
    outcomes = [ARM.row(f"recovery.{name}", faithful=run.time, reason=slow.get(name)) for name, run in runs.items()]
    starts = []
    for name, scheme in RECOVERIES.items():
        times = (recovery(scheme, angles).time for angles in STARTS.values())
        starts.append((words[name], *(f"{time:.1f}" if np.isfinite(time) else "> 120" for time in times)))
    head = (ARM.text("time_to_below_0"), *ARM.texts("starts").values())
    rows = [(f"{c:g}", f"{far:g}", _three(over.std), f"{time:.1f}") for c, far, over, time in designs(few)]

    def draw(canvas: "FigureBase") -> None:
        ax = canvas.subplots()
        for run, colour in zip(runs.values(), SERIES, strict=False):
            ax.semilogy(run.t, np.maximum(run.error_deg, 1e-3), color=colour, linewidth=1.1)
        ax.axhline(0.5, color=MUTED, linewidth=0.8, linestyle="--")
        ax.set_yticks((0.01, 0.1, 1.0, 10.0), labels=("0.01", "0.1", "1", "10"))

    key = [(words[name], colour, "solid") for name, colour in zip(runs, SERIES, strict=False)]
    report = ARM.part(
        "source",
        tables=[ARM.table("recovery_from_a", starts, head=head), ARM.table("design_of_the", rows, few=few)],
        figures=[ARM.figure("recovery_from_10", draw, lines=key)],
    )
    return report, outcomes


def hundred(few: int, turn: Mapping[str, Over]) -> Part:
    """The turn at 100 Hz, beside that at 10 Hz."""
    schemes = {name: SCHEMES[name] for name in ("none", "pi", "fuzzy", "control")}
    fast = measured(True, few, rate=100.0, schemes=schemes)
    rows = [(WORDS[name], _three(turn[name].std), _three(over.std)) for name, over in fast.items() if name in WORDS]
    stds = zip(AXES, fast["fuzzy"].std, fast["six"].std, strict=True)
    outcomes = ARM.rows({f"hundred.fuzzy.{axis}": (faithful, best) for axis, faithful, best in stds})
    return ARM.part("hundred", tables=[ARM.table("turn_seeds_at", rows, few=few)]), outcomes


def slow_mode(turn_deg: float = 10.0, kp: float = 0.8, ki: float = 0.02) -> float:
    """Time, s, after which the linear loop of PI on both sets keeps yaw below 0.5°, in closed form.

    A turn by yaw also leans the field: the products of both vectors are M θ with the matrix of roll and yaw
    M = [[1 + s², −c s], [−c s, c²]], c and s of the dip, whose smaller eigenvalue λ gives the poles of
    p² + λ Kp p + λ Ki = 0.
    """
    c, s = np.cos(deg(50.0)), np.sin(deg(50.0))
    values, vectors = np.linalg.eigh(np.array([[1.0 + s * s, -c * s], [-c * s, c * c]]))
    share = vectors[1, 0] ** 2 * turn_deg  # of yaw, in the slow eigenvector
    slow, fast = sorted(np.abs(np.roots([1.0, values[0] * kp, values[0] * ki])))
    amplitude = share * slow / (fast - slow)
    return float(np.log(amplitude / 0.5) / slow)
