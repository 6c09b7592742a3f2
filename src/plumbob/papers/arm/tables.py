"""Tables 1 and 2 over many seeds, the control, the recovery from a wrong start, and the design of the rules."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from plumbob.arm.array import estimate
from plumbob.arm.array.monitoring import MonitoringSettings
from plumbob.arm.array.paper import Scheme, paper
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import deg, dps, to_deg
from plumbob.data.array import ImuArray
from plumbob.papers.arm.simulated import (
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
)
from plumbob.papers.description import ARM
from plumbob.papers.outcome import Outcome
from plumbob.reporting.style import Both
from plumbob.rotations import Frame, quat_from_euler_zyx, quat_multiply

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
ANGLES: Final = dict(zip(AXES, (ARM.text("roll"), ARM.text("pitch"), ARM.text("yaw_2")), strict=True))
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
RECOVERY_WORDS: Final[Mapping[str, Both]] = {
    "fuzzy": ARM.text("fuzzy_pi_the_papers"),
    "control": WORDS["control"],
    "sum": WORDS["sum"],
    "sum_alone": ARM.text("sum_table_one_set"),
    "ekf": ARM.text("fuzzy_pi_with_ekf"),
}
STARTS: Final[Mapping[str, tuple[Both, tuple[float, float, float]]]] = {
    "yaw": (ARM.text("yaw_10"), (10.0, 0.0, 0.0)),
    "roll": (ARM.text("roll_10"), (0.0, 0.0, 10.0)),
    "pitch": (ARM.text("pitch_10"), (0.0, 10.0, 0.0)),
    "each": (ARM.text("5_77_each"), (10.0 / 3**0.5,) * 3),
    "all": (ARM.text("10_each"), (10.0, 10.0, 10.0)),
}
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


def of_table(turns: bool, found: Mapping[str, Over], optimum: Floats) -> list[Outcome]:
    """Outcomes of a table, by angle: standard deviations, ranges, the control, ratios, and Plumbob's."""
    case, made = CASES[turns], []
    for key, field in (("{name}.{axis}", "std"), ("{name}.range.{axis}", "range")):
        for name in PAPER[turns]:
            for i, axis in enumerate(AXES):
                value, best = (getattr(found[scheme], field)[i] for scheme in (name, "six"))
                key_of_axis = f"{case}.{key.format(name=name, axis=axis)}"
                made.append(ARM.row(key_of_axis, faithful=value, best=best if name == "fuzzy" else None))
    made += [ARM.row(f"{case}.control.{axis}", faithful=found["control"].std[i]) for i, axis in enumerate(AXES)]
    for above, below in (("pi", "none"), ("fuzzy", "pi")):
        for axis, ratio in zip(AXES, found[above].std / found[below].std, strict=True):
            made.append(ARM.row(f"{case}.{above}_over_{below}.{axis}", faithful=ratio))
    made += [_two(turns, found["two"], optimum, i) for i in range(3)]
    made.append(ARM.row(f"{case}.none.rms", faithful=float(found["none"].rms.mean())))
    return made


def _two(turns: bool, two: Over, optimum: Floats, i: int) -> Outcome:
    row = ARM.row(f"{CASES[turns]}.two.{AXES[i]}", best=float(two.std[i]))
    values = {"limit": row.best_bar[1], "std": two.std[i], "error": two.standard_error[i], "optimum": optimum[i]}
    return row if row.met else replace(row, reason=ARM.text("best_causal_filter_of", **values))


def of_recovery(found: Mapping[str, Recovery]) -> list[Outcome]:
    """Outcomes of the recovery from 10° of yaw, and the closed form's for PI."""
    return [
        ARM.row(f"recovery.{name}", faithful=run.time, reason=_SLOW if name == "control" else None)
        for name, run in found.items()
    ]


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


_SLOW: Final = ARM.text("10_of_yaw_take", slow_mode=slow_mode())
