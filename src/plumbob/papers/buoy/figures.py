"""Figures of the buoy paper, drawn again [Yu2018]."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from plumbob.calibration.ellipsoid.ellipsoid_fit import fit_axes
from plumbob.core.check import Floats
from plumbob.core.units import to_deg
from plumbob.data import AttitudeTrack
from plumbob.papers.buoy.bench import Sailed, Slid
from plumbob.papers.buoy.static_test import ANGLES, StaticTest
from plumbob.papers.description import BUOY
from plumbob.reporting.content import Figure
from plumbob.reporting.scene import Scene
from plumbob.reporting.style import INK, MUTED, SERIES, SOFT, Both
from plumbob.rotations import euler_zyx_from_quat, quat_rotate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

BLUE, RED, GREEN, PINK, AMBER = SERIES[:5]
ANGLE: Final = BUOY.texts("angle")
_PAIRS: Final = ((0, 1), (0, 2), (1, 2))


def fig4(calls: Mapping[str, tuple[Floats, Floats]], length: float) -> Figure:
    """Figure 4: what the main loop does in its first milliseconds.

    Parameters
    ----------
    calls : mapping of str to (ndarray (N,), ndarray (N,))
        Begin and end of each call, s, by task.
    length : float
        Time that is drawn, s.
    """
    names = BUOY.texts("tasks")

    def draw(canvas: "FigureBase") -> None:
        ax = canvas.subplots()
        for row, (name, colour) in enumerate(zip(names, (BLUE, GREEN, RED), strict=True)):
            begun, done = calls[name]
            mask = begun < length
            bars = list(zip(1e3 * begun[mask], 1e3 * (done - begun)[mask], strict=True))
            ax.broken_barh(bars, (1.7 - row, 0.6), facecolors=colour)
            ax.text(-0.015, 2.0 - row, names[name], transform=ax.get_yaxis_transform(), ha="right", va="center")
        ax.set_yticks([2.0, 1.0, 0.0], [""] * len(names))  # a tick's label would lose its Chinese
        ax.set_xlim(0.0, 1e3 * length)

    return BUOY.figure("figure_4", draw)


def fig5(counts: Floats, step: float) -> Figure:
    """Figure 5: readings of the magnetometer in 18 regions, before and after the fit; counts (18, 3), step in µT."""
    fit = fit_axes(counts)
    assert fit is not None
    after = (counts - fit.centre) @ fit.shape.T
    semi = 1.0 / np.diag(fit.shape)

    def draw(canvas: "FigureBase") -> None:
        axes = canvas.subplots(2, 3)
        limit = 1.15 * float(np.max(np.abs(fit.centre) + semi))
        for column, pair in enumerate(_PAIRS):
            i, j = pair
            _plane(axes[0, column], counts[:, pair], fit.centre[list(pair)], semi[list(pair)], limit, RED)
            _plane(axes[1, column], after[:, pair], np.zeros(2), np.ones(2), 1.3, BLUE)
            for row, unit in ((0, BUOY.text("counts")), (1, BUOY.text("dimensionless"))):
                axes[row, column].set_xlabel(BUOY.text("axis_and_unit", xyz="xyz"[i], unit_2=unit))
                axes[row, column].set_ylabel(BUOY.text("axis_and_unit", xyz="xyz"[j], unit_2=unit))

    return BUOY.figure("figure_5", draw, step=step * 10)


def _plane(ax: "Axes", points: Floats, centre: Floats, semi: Floats, limit: float, colour: str) -> None:
    """Points (N, 2), the outline of an ellipsoid, its centre, and the origin, on equal scales."""
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    ax.axhline(0.0, color=SOFT, linewidth=0.6)
    ax.axvline(0.0, color=SOFT, linewidth=0.6)
    ax.plot(centre[0] + semi[0] * np.cos(turn), centre[1] + semi[1] * np.sin(turn), color=colour, linewidth=0.8)
    ax.plot(*points.T, "o", color=colour, markersize=2.6)
    ax.plot(*centre, "+", color=INK, markersize=5.0, markeredgewidth=0.8)
    ax.set_xlim(-limit, limit)
    ax.set_ylim(-limit, limit)
    ax.set_aspect("equal")


def fig7(paper: StaticTest, best: StaticTest) -> Figure:
    """Figure 7: errors of three angles at 36 headings beside the DCM260B, before and after."""
    heading = np.mod(to_deg(paper.reference[:, 0]), 360.0)
    order = np.argsort(heading)
    lines = (
        (paper.errors("before"), RED, "--"),
        (paper.errors("after"), BLUE, "-"),
        (best.errors("after"), GREEN, "-"),
    )

    def draw(canvas: "FigureBase") -> None:
        axes = canvas.subplots(3, 1, sharex=True)
        for i, (ax, name) in enumerate(zip(axes, ANGLES, strict=True)):
            ax.axhline(0.0, color=SOFT, linewidth=0.5)
            for errors, colour, dash in lines:
                how = {"color": colour, "marker": "o", "markersize": 1.8, "linewidth": 0.8}
                ax.plot(heading[order], to_deg(errors[order, i]), dash, **how)
            for limit in (-5.0, 5.0):
                ax.axhline(limit, color=MUTED, linewidth=0.6, linestyle=":")
            ax.set_ylabel(BUOY.text("error", name=ANGLE[name]))
        axes[-1].set_xticks(range(0, 361, 45))

    return BUOY.figure("figure_7", draw)


def fig8(slid: Slid) -> Figure:
    """Figure 8: roll and pitch on a level desk, slid quickly, with and without the gate."""
    lines = {"no gate": (RED, (9.6, 6.1)), "gate 0.08 g": (BLUE, (3.3, 2.7)), "mekf": (GREEN, (np.nan, np.nan))}

    def draw(canvas: "FigureBase") -> None:
        axes = canvas.subplots(2, 1, sharex=True)
        for panel, (ax, name, column) in enumerate(zip(axes, ("roll", "pitch"), (2, 1), strict=True)):
            for key, (colour, printed) in lines.items():
                ax.plot(slid.t, slid.errors[key][:, column], color=colour, linewidth=0.8)
                for side in (-1.0, 1.0):
                    ax.axhline(side * printed[panel], color=colour, linewidth=0.6, linestyle=":")
            ax.set_ylabel(BUOY.text("angle_in_degrees", name=name, angle_name=ANGLE[name]))

    return BUOY.figure("figure_8", draw)


def waves(sailed: Sailed) -> Figure:
    """Roll at sea over the last minute, and the errors of four ways to find it."""
    rows = sailed.t >= sailed.t[-1] - 60.0
    lines = {"tilt_compass": SOFT, "gate 0.08 g": BLUE, "mekf": GREEN, "smoother": AMBER}

    def draw(canvas: "FigureBase") -> None:
        upper, lower = canvas.subplots(2, 1, sharex=True)
        upper.plot(sailed.t[rows], to_deg(euler_zyx_from_quat(sailed.truth.q_nb[rows])[:, 2]), color=INK, linewidth=0.9)
        for key, colour in lines.items():
            lower.plot(sailed.t[rows], sailed.errors[key][rows, 2], color=colour, linewidth=0.8)

    return BUOY.figure("roll_in_waves", draw)


def gains(kps: Sequence[float], scans: Mapping[Both, tuple[Floats, Floats]]) -> Figure:
    """Largest roll on a slide over Kp, without and with the gate, by strokes; and what the paper prints."""

    def draw(canvas: "FigureBase") -> None:
        ax = canvas.subplots()
        for (_, (free, gated)), colour in zip(scans.items(), (RED, BLUE, GREEN), strict=False):
            ax.plot(kps, free, "-o", color=colour, markersize=2.4, linewidth=0.9)
            ax.plot(kps, gated, "--o", color=colour, markersize=2.4, linewidth=0.9)
        for level in (9.6, 3.3):
            ax.axhline(level, color=MUTED, linewidth=0.7, linestyle=":")
        ax.axvline(0.5, color=SOFT, linewidth=0.7)

    key = [(name, colour, "solid") for name, colour in zip(scans, (RED, BLUE, GREEN), strict=False)]
    key += [(BUOY.text("same_with_the_gate"), INK, "dashed"), (BUOY.text("9_6_and_3"), MUTED, "dotted")]
    return BUOY.figure("largest_roll_on", draw, lines=key)


def model(track: AttitudeTrack, truth: AttitudeTrack) -> Scene:
    """The host program's model of Fig 6: axes and rim of the buoy in the last half minute, the truth beside it pale."""
    rows = np.flatnonzero(track.t >= track.t[-1] - 30.0)[::5]
    places = {
        "x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "−x": (-1.0, 0.0, 0.0), "−y": (0.0, -1.0, 0.0),
        "z": (0.0, 0.0, 0.9), "o": (0.0, 0.0, 0.0),
    }  # fmt: skip
    lines = [("x", "y"), ("y", "−x"), ("−x", "−y"), ("−y", "x"), ("o", "x"), ("o", "y"), ("o", "z")]
    yaw, pitch, roll = to_deg(euler_zyx_from_quat(track.q_nb[rows])).T
    points = partial(_points_nwu, places)
    return Scene(
        caption=BUOY.text("figure_6_the_host"),
        t=track.t[rows] - track.t[rows[0]],
        points=points(track.q_nb[rows]),
        lines=lines,
        values={"γ": roll, "θ": pitch, "φ": yaw},
        shadow=points(truth.q_nb[rows]),
    )


def _points_nwu(places: Mapping[str, tuple[float, float, float]], q_nb: Floats) -> dict[str, Floats]:
    """Places in axes of north, west and up, (N, 3) each."""
    return {name: quat_rotate(q_nb, np.array(place)) * [1.0, -1.0, -1.0] for name, place in places.items()}


def signed(value: float, digits: int) -> str:
    """Number with so many digits, and a minus as it is printed."""
    return f"{value:.{digits}f}".replace("-", "−")
