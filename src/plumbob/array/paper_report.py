"""Figures 3 to 9 of the teaching-arm paper [HuangJiang], by the scheme of `plumbob.array.paper` on simulated units.

The paper's Figures 3 to 5 are errors at rest, and 7 to 9 in a turn of −90°: of one set without a regulator, of one set
with a PI law, and of both sets with fuzzy rules and PI. Figure 6 is the heading in that turn. Figures 1 and 2 are
drawings of the scheme and of the mounting. The noise of the sensors is assumed: `plumbob.array.paper` gives with it
what the paper prints, and with the noise that the paper states nothing like it.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from plumbob.array.paper import Scheme, paper
from plumbob.core.check import Floats
from plumbob.core.units import deg, to_deg
from plumbob.data.array import ImuArray, Mount
from plumbob.reporting import Figure, Report, Table
from plumbob.reporting.style import MUTED, SERIES
from plumbob.rotations import Frame, euler_zyx_from_quat, quat_conjugate, quat_multiply

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

AXES: Final = ("roll", "pitch", "yaw")
SCHEMES: Final[Mapping[str, Scheme]] = {
    "none": Scheme(set1="none", sets=1, ekf=False),
    "PI": Scheme(set1="pi", sets=1),
    "fuzzy-PI": Scheme(),
    "PI on both sets": Scheme(set1="pi"),
}
"""The paper's three contenders, and the control: the same law on both sets."""
PAPER: Final[Mapping[bool, Mapping[str, tuple[float, float, float]]]] = {
    False: {"none": (0.507, 0.643, 0.519), "PI": (0.136, 0.157, 0.206), "fuzzy-PI": (0.096, 0.098, 0.142)},
    True: {"none": (0.792, 0.997, 1.135), "PI": (0.298, 0.275, 0.608), "fuzzy-PI": (0.193, 0.188, 0.308)},
}
"""Standard deviations that the paper prints at rest and in the turn, deg, in the order of `AXES`."""

_FIGURES: Final = {False: (3, 4, 5), True: (7, 8, 9)}
_WHAT: Final = {
    "none": "one set without a regulator",
    "PI": "one set with a PI law",
    "fuzzy-PI": "fuzzy-PI on two sets",
}
_NOISE: Final = {
    False: "gyroscopes 0.1 °/s and a bias within ±0.13 °/s, accelerometers 0.01 g, magnetometers 0.5 µT",
    True: "gyroscopes 0.2 °/s and a bias within ±0.25 °/s, accelerometers 0.02 g, magnetometers 1 µT",
}
_ESTIMATE, _TRUE = SERIES[0], SERIES[4]


class Errors(NamedTuple):
    """What one run of a scheme gives.

    Attributes
    ----------
    yaw_deg : ndarray (N,)
        Estimated yaw, continuous.
    errors_deg : ndarray (N, 3)
        Errors of roll, pitch and yaw.
    """

    yaw_deg: Floats
    errors_deg: Floats

    def statistics(self) -> Floats:
        """Standard deviation, range and rms (rows) of roll, pitch and yaw, deg."""
        return statistics(self.errors_deg)


def arm(seed: int, *, turns: bool, units: int = 6, rate: float = 10.0) -> tuple[ImuArray, Floats]:
    """The paper's array, simulated for 30 s, and the true attitude of its body.

    Parameters
    ----------
    seed : int
        Of the errors of all units.
    turns : bool
        In the turn of −90°, with the larger noise; otherwise at rest.
    units : int
        6, or 2 for the first of each set.
    rate : float
        Samples in a second.

    Returns
    -------
    array : ImuArray
        Units with their mounts and noise cards.
    q_nb : ndarray (N, 4)
        True attitude, in NED.
    """
    from plumbob.simulation import simulate
    from plumbob.simulation.rigs.plan import PLANS, Mounted
    from plumbob.simulation.scenarios import Arm

    imus, mounts, truth = {}, {}, np.empty(0)
    for k, unit in enumerate(PLANS["arm"].units):
        if units == 2 and k not in (0, 3):  # one of each set
            continue
        scenario = Mounted(plan=Arm(turn=deg(-90.0) if turns else 0.0), frame=Frame.NED, q_bs=unit.q_bs, seed=seed)
        made = simulate(
            scenario, frame=Frame.NED, sensors="arm:turn" if turns else "arm:rest", unit="random",
            seed=10 * seed + k, rate=rate, duration=30.0,
        )  # fmt: skip
        imus[unit.prefix] = replace(made.imu, meta=replace(made.imu.meta, declination=None))
        mounts[unit.prefix] = Mount(q_bs=unit.q_bs, noise=made.noise)
        if not truth.size:
            truth = quat_multiply(made.truth.q_nb, quat_conjugate(np.array(unit.q_bs)))
    return ImuArray(imus, mounts), truth


def errors_deg(q_nb: Floats, truth: Floats) -> Floats:
    """Errors (N, 3) of roll, pitch and yaw, deg: angles of the turn from the true to the estimated attitude."""
    e = euler_zyx_from_quat(quat_multiply(quat_conjugate(truth), q_nb))
    return np.asarray(to_deg(np.unwrap(e, axis=0)))[:, ::-1]


def statistics(e: Floats) -> Floats:
    """Standard deviation, range and rms (rows) of each column of errors (N, 3)."""
    return np.array([e.std(axis=0), np.ptp(e, axis=0), np.sqrt(np.mean(e**2, axis=0))])


def runs(array: ImuArray, truth: Floats) -> dict[str, Errors]:
    """Heading and errors of each of `SCHEMES` on one array, in NED."""
    tracks = {name: paper(array, frame=Frame.NED, scheme=scheme).q_nb for name, scheme in SCHEMES.items()}
    return {name: Errors(_yaw_deg(q_nb), errors_deg(q_nb, truth)) for name, q_nb in tracks.items()}


def paper_report(seed: int = 1, *, turns: bool) -> Report:
    """Figures 3 to 5 of the paper, or 6 to 9, from one simulated run, with its tables beside the paper's.

    Parameters
    ----------
    seed : int
        Of the simulated errors; 1 by default.
    turns : bool
        In the turn of −90° (Figures 6 to 9, Table 2); otherwise at rest (Figures 3 to 5, Table 1).
    """
    array, truth = arm(seed, turns=turns)
    contenders, t = runs(array, truth), array.t
    how = "in the turn" if turns else "at rest"
    figures = [
        Figure(
            f"Figure {number}: attitude error {how}, {what}",
            partial(_draw_errors, t, contenders[name], PAPER[turns][name], _limits(contenders, name)),
            height=3.3,
        )
        for number, (name, what) in zip(_FIGURES[turns], _WHAT.items(), strict=True)
    ]
    if turns:
        key = [("estimate", _ESTIMATE, "solid"), ("truth", _TRUE, "solid")]
        draw = partial(_draw_heading, t, contenders["fuzzy-PI"].yaw_deg, _yaw_deg(truth))
        figures.insert(0, Figure("Figure 6: heading in the turn, fuzzy-PI on two sets", draw, key))
    return Report(
        f"Teaching-arm paper {how}",
        facts=[
            ("motion", "turn of −90° about the vertical in 30 s" if turns else "at rest for 30 s"),
            ("sensors", f"six units, 10 Hz; {_NOISE[turns]}"),
            ("seed", str(seed)),
        ],
        tables=[_table(contenders, turns)],
        remarks=_remarks(turns),
        figures=figures,
    )  # fmt: skip


def _yaw_deg(q_nb: Floats) -> Floats:
    return np.asarray(to_deg(np.unwrap(euler_zyx_from_quat(q_nb)[:, 0])))


def _limits(contenders: Mapping[str, Errors], name: str) -> float:
    """End of the axes of a scheme's errors, deg: the same for both that have a regulator, so that they compare."""
    together = ("none",) if name == "none" else ("PI", "fuzzy-PI")
    return 1.08 * max(float(np.abs(contenders[one].errors_deg).max()) for one in together)


def _table(contenders: Mapping[str, Errors], turns: bool) -> Table:
    rows = []
    for name, run in contenders.items():
        printed = PAPER[turns].get(name)
        for axis, (std, span, rms) in enumerate(run.statistics().T.tolist()):
            mark = f"{printed[axis]:.3f}" if printed else "-"
            rows.append([f"{name}, {AXES[axis]}", f"{std:.3f}", mark, f"{span:.3f}", f"{rms:.3f}"])
    return Table(f"Table {1 + turns}: attitude errors [°]", ["", "std", "std in the paper", "range", "rms"], rows)


def _remarks(turns: bool) -> list[str]:
    return [
        "This is one run; 'python -m benchmarks.arrays tables' prints the means over 100 runs.",
        "The noise is assumed. The noise that the paper states would give errors 50 to 5000 times smaller than those "
        "that it prints.",
        "Without a regulator there is no Kalman filter either: the error is the integral of the gyroscopes' bias and "
        "noise. The standard deviation hides a constant error, and the rms holds it.",
        "The PI law on both sets is the control: fuzzy-PI is better than PI because two sets are averaged.",
        *(
            ["The paper's 0.608° of yaw with the PI law is not reached together with its other figures."]
            if turns
            else []
        ),
    ]


def _draw_errors(
    t: Floats, run: Errors, printed: tuple[float, float, float], limit: float, canvas: "FigureBase"
) -> None:
    """Errors of roll, pitch and yaw over time, and beside each its statistics."""
    panels = canvas.subplots(3, 1, sharex=True)
    for axis, (ax, figures) in enumerate(zip(panels, run.statistics().T.tolist(), strict=True)):
        ax.plot(t, run.errors_deg[:, axis], color=_ESTIMATE, linewidth=0.8)
        ax.axhline(0.0, color=MUTED, linewidth=0.5)
        ax.set_ylim(-limit, limit)
        ax.set_ylabel(f"{AXES[axis]} error [°]")
        _beside(ax, dict(zip(("std", "range", "rms"), figures, strict=True)) | {"std in the paper": printed[axis]})
    _time_axis(panels[-1], t)


def _draw_heading(t: Floats, yaw: Floats, true: Floats, canvas: "FigureBase") -> None:
    """Estimated and true yaw over time."""
    ax = canvas.subplots()
    ax.plot(t, true, color=_TRUE, linewidth=2.4)
    ax.plot(t, yaw, color=_ESTIMATE, linewidth=0.8)
    ax.set_ylim(-95.0, 5.0)
    ax.set_yticks((-90, -60, -30, 0))
    ax.set_ylabel("yaw [°]")
    _time_axis(ax, t)


def _time_axis(ax: "Axes", t: Floats) -> None:
    ax.set_xlim(float(t[0]), float(np.ceil(t[-1])))
    ax.set_xlabel("time [s]")


def _beside(ax: "Axes", figures: Mapping[str, float]) -> None:
    for line, (name, value) in enumerate(figures.items()):
        ax.text(
            1.015, 0.95 - 0.22 * line, f"{name}: {value:.3f}°", transform=ax.transAxes, va="top", color=MUTED
        )  # fmt: skip
