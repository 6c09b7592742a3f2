"""Page of the rod paper."""

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.units import deg, to_deg, to_dps
from plumbob.papers.description import ROD
from plumbob.papers.rod.comparison import LINES, Compared, budget, mount_angles, permutation_error
from plumbob.papers.rod.equations import Grown, Numerics, numerics_table
from plumbob.papers.rod.methods import DISTURBANCES, DISTURBED, LIMIT, METHODS, SHAKEN, MethodScores, tilt_errors
from plumbob.papers.rod.methods import MethodScores as Scores
from plumbob.reporting.content import Figure
from plumbob.reporting.report import Report
from plumbob.reporting.style import INK, MUTED, SERIES, SHADE, SOFT
from plumbob.rotations import euler_zyx_from_quat

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase


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
    return ROD.part(
        "page",
        parts=[
            ROD.part("system", tables=[ROD.table("chain_and_what")]),
            _equations(forms, steps),
            _compared(run),
            _methods(table),
            ROD.part("mounting", figures=[ROD.figure("exchanged_euler_angles", partial(_exchange, run))]),
            _limits(limits),
        ],
    )


def _equations(forms: Sequence[Numerics], steps: Sequence[Grown]) -> Report:
    return ROD.part(
        "equations",
        tables=[ROD.table("misprints_and_gaps"), numerics_table(forms)],
        figures=[ROD.figure("p_over_time", partial(_covariance, steps))],
    )


def _compared(run: Compared) -> Report:
    rows = []
    for key, line in LINES.items():
        parts = budget(run, key)
        for part in parts[:3] if key in ("ekf7", "mekf", "smoother") else parts[2:3]:
            numbers = [f"{v:.3f}" for v in (*part.largest, *part.rms)]
            rows.append([ROD.text("line_and_part", name=line.name, part_name=part.name), *numbers])
    rows += [[part.name, *(f"{v:.3f}" for v in (*part.largest, *part.rms))] for part in budget(run, "ekf7")[3:]]
    estimated, true = (
        ", ".join(f"{v:.2f}".replace("-", "−") for v in mount_angles(q)) for q in (run.mounting, run.true_mounting)
    )
    return ROD.part(
        "compared",
        mean=100.0 * run.rest.mean(),
        estimated=estimated,
        true=true,
        tables=[ROD.table("what_the_paper", rows)],
        figures=figures(run),
    )


def _methods(table: Scores) -> Report:
    seeds = len(table.rested)
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
    return ROD.part(
        "methods",
        seeds=seeds,
        jumps=jumps,
        tables=tables,
        figures=[ROD.figure("largest_error_of", partial(_seeds, table))],
    )


def _limits(limits: Sequence[Sequence[Sequence[float]]]) -> Report:
    mean = np.mean(np.array(limits), axis=0)
    head = (ROD.text("method"), *(what.name for what in DISTURBANCES))
    rows = [[method.name, *(f"{v:.2f}" for v in line)] for method, line in zip(DISTURBED.values(), mean.T, strict=True)]
    return ROD.part("limits", tables=[ROD.table("largest_error_of", rows, limits=len(limits), head=head)])


_BLUE, _RED, _GREEN = SERIES[:3]
_COLUMNS = 900
ZOOM: Final = 380.0, 420.0
"""Window of the enlargements, s: the vibration begins in its middle."""
CLOSE: Final = 405.5, 409.5
"""Window in which the lines can be distinguished, s."""


def figures(run: Compared) -> list[Figure]:
    """Figure 6, errors, differences to the reference, and the state of motion, from the run through bytes."""
    draws = {
        "figure_6": partial(_angles, run, 2),
        "figure_6_c": partial(_angles, run, 1),
        "errors_against_the": partial(_errors, run),
        "differences_to_the": partial(_differences, run),
        "motion_state_and": partial(_bias, run),
    }
    return [ROD.figure(key, draw) for key, draw in draws.items()]


def _line(ax: "Axes", t: Floats, y: Floats, jump: float = np.inf, **style: Any) -> None:
    from plumbob.reporting.drawing import envelope

    ax.plot(*envelope(t, y, _COLUMNS, jump=jump), linewidth=0.8, **style)


def _angle(q_nb: Floats, column: int) -> Floats:
    return np.asarray(to_deg(euler_zyx_from_quat(q_nb)[:, column]))


def _angles(run: Compared, column: int, canvas: "FigureBase") -> None:
    full, near, close = canvas.subplots(3, 1)
    lines: tuple[tuple[Floats, dict[str, Any]], ...] = (
        (run.tracks["accel"], {"color": SOFT}),
        (run.reference, {"color": INK}),
        (run.tracks["ekf7"], {"color": _BLUE}),
        (run.tracks["smoother"], {"color": _GREEN, "linestyle": "--"}),
    )
    for ax, window in ((full, (0.0, float(run.t[-1]))), (near, ZOOM), (close, CLOSE)):
        inside = (run.t >= window[0]) & (run.t <= window[1])
        for q_nb, style in lines:
            _line(ax, run.t[inside], _angle(q_nb[inside], column), **style)
        ax.set_xlim(*window)
        if window[0] <= SHAKEN <= window[1]:
            ax.axvline(SHAKEN, color=MUTED, linewidth=0.6, linestyle=":")
    inside = (run.t >= CLOSE[0]) & (run.t <= CLOSE[1])
    if inside.any():
        shown = _angle(run.reference[inside], column)
        close.set_ylim(float(shown.min()) - 2.0, float(shown.max()) + 2.0)


def _pair(ax: "Axes", t: Floats, errors: Floats, most: float | None = None) -> None:
    for error, colour in zip(errors, (_BLUE, _RED), strict=True):
        _line(ax, t, error, jump=180.0, color=colour)
    for limit in (-LIMIT, LIMIT):
        ax.axhline(limit, color=MUTED, linewidth=0.7, linestyle="--")
    ax.axvline(SHAKEN, color=MUTED, linewidth=0.6, linestyle=":")
    ax.set_xlim(0.0, t[-1])
    if most is not None:
        ax.set_ylim(-most, most)


def _errors(run: Compared, canvas: "FigureBase") -> None:
    limits = {"accel": None, "gyro": None, "ekf7": 1.4, "smoother": 1.4}
    for ax, (key, most) in zip(canvas.subplots(len(limits), 1, sharex=True), limits.items(), strict=True):
        _pair(ax, run.t[run.scored], run.errors(run.tracks[key], run.truth.q_nb), most)


def _differences(run: Compared, canvas: "FigureBase") -> None:
    pairs = (run.tracks["ekf7"], run.reference), (run.reference, run.truth.q_nb)
    for ax, pair in zip(canvas.subplots(len(pairs), 1, sharex=True), pairs, strict=True):
        _pair(ax, run.t[run.scored], run.errors(*pair), 1.4)


def _bias(run: Compared, canvas: "FigureBase") -> None:
    from plumbob.reporting.drawing import runs

    assert run.truth.bias_b is not None
    axes = canvas.subplots(3, 1, sharex=True)
    rests = runs(run.t, run.rest, _COLUMNS)
    for i, (ax, axis) in enumerate(zip(axes, "xyz", strict=True)):
        ax.broken_barh(rests, (0.0, 1.0), transform=ax.get_xaxis_transform(), facecolors=SHADE, linewidth=0, zorder=0)
        _line(ax, run.t, np.asarray(to_dps(run.truth.bias_b[:, i])), color=SOFT)
        _line(ax, run.t, np.asarray(to_dps(run.bias[:, i])), color=_BLUE)
        ax.set_ylabel(ROD.text("bias_s", axis=axis))
        ax.set_xlim(0.0, run.t[-1])
        low, high = np.percentile(to_dps(run.bias[run.t > 10.0, i]), (0.5, 99.5))
        spread = max(high - low, 0.1)
        ax.set_ylim(low - spread, high + spread)


def _seeds(table: MethodScores, canvas: "FigureBase") -> None:
    ax = canvas.subplots()
    keys = list(table.scores)[::-1]
    for row, key in enumerate(keys):
        largest = table.largest(key)
        ax.text(-0.01, row, METHODS[key].name, transform=ax.get_yaxis_transform(), ha="right", va="center")
        ax.plot(largest, np.full(largest.size, row), "|", color=_GREEN if METHODS[key].ours else _BLUE, markersize=6.0)
    ax.set_yticks(range(len(keys)), [""] * len(keys))
    ax.axvline(LIMIT, color=MUTED, linewidth=0.7, linestyle="--")
    ax.set_xscale("log")
    ax.set_xticks((0.3, 1.0, 3.0, 10.0, 30.0, 100.0), ("0.3", "1", "3", "10", "30", "100"))


def _exchange(run: Compared, canvas: "FigureBase") -> None:
    from plumbob.papers.rod.comparison import mapped, permuted

    ax, run_ax = canvas.subplots(1, 2)
    tilt = np.linspace(0.0, 35.0, 141)
    for error, colour in zip(np.abs(permutation_error(deg(tilt), deg(tilt))), (_BLUE, _RED), strict=True):
        ax.plot(tilt, error, color=colour, linewidth=1.0)
    ax.plot(tilt, np.abs(permutation_error(deg(tilt), deg(tilt), by=mapped)).max(axis=0), color=_GREEN, linewidth=1.0)
    ax.axhline(LIMIT, color=MUTED, linewidth=0.7, linestyle="--")
    errors = tilt_errors(permuted(run.ahrs_true), mapped(run.ahrs_true))
    _pair(run_ax, run.t, errors)


def _covariance(steps: Sequence[Grown], canvas: "FigureBase") -> None:
    angle_ax, length_ax = canvas.subplots(1, 2)
    t = [step.t for step in steps]
    angle_ax.loglog(t, [step.heading for step in steps], color=_RED, marker=".", linewidth=1.0)
    angle_ax.loglog(t, [step.tilt for step in steps], color=_BLUE, marker=".", linewidth=1.0)
    length_ax.loglog(t, [step.length for step in steps], color=_GREEN, marker=".", linewidth=1.0)
    angle_ax.set_yticks((0.2, 0.5, 1.0, 2.0, 5.0, 10.0), ("0.2", "0.5", "1", "2", "5", "10"))
    length_ax.set_yticks((5e-4, 1e-3, 2e-3), ("0.0005", "0.001", "0.002"))
    for ax in (angle_ax, length_ax):
        ax.set_xticks((3.0, 10.0, 30.0, 100.0, 300.0), ("3", "10", "30", "100", "300"))
        ax.minorticks_off()
