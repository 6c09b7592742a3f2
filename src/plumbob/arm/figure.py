"""A chain's motion as a page: a stick figure to turn and play, joint angles, the hand's path, use of limits."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from plumbob.arm.angles import JointTrack
from plumbob.arm.program import Program
from plumbob.arm.replayed import in_order
from plumbob.core.check import Floats
from plumbob.core.errors import ShapeError
from plumbob.core.units import to_deg
from plumbob.data.chain import Chain, Posture
from plumbob.reporting.content import Figure, Scene, Table
from plumbob.reporting.report import Report
from plumbob.reporting.style import SERIES, SOFT
from plumbob.rotations import wrap

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

_COLUMNS: Final = 800
_HAND: Final = "hand"
_DASHES: Final = ("solid", "dashed", "dotted")


def stick_figure(
    chain: Chain,
    t: Floats,
    angles: Floats,
    *,
    postures: Mapping[str, Posture] | None = None,
    shadow: Floats | None = None,
    caption: str = "Motion of the chain",
) -> Scene:
    """Scene of a chain: lines from joint to joint, and the hand with its path.

    Parameters
    ----------
    chain : Chain
        The chain.
    t : ndarray (N,)
        Times, s.
    angles : ndarray (N, all angles)
        rad, in the order of `Chain.angles`.
    postures : mapping of str to Posture, optional
        Where the segments were, if that is known better than by the angles on a root that stands still.
    shadow : ndarray (N, all angles), optional
        Of a second, pale figure, such as truth.
    caption : str
        Of the figure.
    """
    points, lines = stick_points(chain, chain.postures(angles) if postures is None else postures)
    names = chain.angles
    return Scene(
        caption,
        t,
        points,
        lines,
        trail=_name_of_hand(chain),
        values={name: to_deg(angles[:, k]) for k, name in enumerate(names)},
        shadow={} if shadow is None else stick_points(chain, chain.postures(shadow))[0],
    )


def _name_of_hand(chain: Chain) -> str:
    at = chain.hand or chain.segments[-1].name
    return at if not any(chain.hand_b) else "tip" if at == _HAND else _HAND


def stick_points(chain: Chain, postures: Mapping[str, Posture]) -> tuple[dict[str, Floats], list[tuple[str, str]]]:
    """Origins of the segments, and the hand; and lines from each joint's parent to it."""
    points = {name: np.asarray(posture.pos_n) for name, posture in postures.items()}
    lines = [(joint.parent, joint.child) for joint in chain.joints]
    at, hand = chain.hand or chain.segments[-1].name, _name_of_hand(chain)
    if hand != at:
        points[hand] = chain.hand_at(postures)
        lines.append((at, hand))
    return points, lines


def arm_report(
    chain: Chain,
    track: JointTrack,
    *,
    program: Program | None = None,
    truth: JointTrack | None = None,
    postures: Mapping[str, Posture] | None = None,
    title: str = "",
    facts: Sequence[tuple[str, str]] = (),
    remarks: Sequence[str] = (),
) -> Report:
    """Report of a motion: a stick figure, joint angles with their standard deviation, the hand, and a program.

    Parameters
    ----------
    chain : Chain
        The chain.
    track : JointTrack
        Its angles, estimated or recorded.
    program : Program, optional
        What was taught from them.
    truth : JointTrack, optional
        True angles at the same times, drawn pale.
    postures : mapping of str to Posture, optional
        As of `stick_figure`.
    title : str
        Of the page.
    facts : sequence of (str, str)
        Where it comes from.
    remarks : sequence of str
        What a reader should know.

    Raises
    ------
    ParameterError
        If the angles are not those of the chain.
    ShapeError
        If truth has other times.
    """
    angles = in_order(chain, track)
    if truth is not None and not np.array_equal(truth.t, track.t):
        raise ShapeError("truth must have the times of the estimate; interpolate it at them first.")
    true = None if truth is None else in_order(chain, truth)
    tables = [_angles_table(chain, angles, track, true)]
    figures = [_angles_figure(chain, track, angles, program, true)]
    if track.hand is not None or np.isfinite(angles).all():
        figures.append(_hand_figure(chain, track, angles, true))
    parts = [] if program is None else [_program_part(chain, program)]
    return Report(
        title or f"Motion of {chain.name}",
        facts=[*facts, *chain.facts().items(), *track.facts().items()],
        tables=tables,
        remarks=remarks,
        figures=figures,
        parts=parts,
        scenes=[stick_figure(chain, track.t, angles, postures=postures, shadow=true)],
    )


def _angles_table(chain: Chain, angles: Floats, track: JointTrack, true: Floats | None) -> Table:
    """Range, standard deviation and error of each angle."""
    head = ["", "least", "greatest"]
    rows = []
    for name, values in zip(chain.angles, to_deg(angles.T), strict=True):
        finite = values[np.isfinite(values)]
        rows.append([name, *([f"{finite.min():.1f}", f"{finite.max():.1f}"] if finite.size else ["-", "-"])])
    if track.sd is not None:
        head.append("σ, median")
        for name, row in zip(chain.angles, rows, strict=True):
            row.append(_degrees(np.nanmedian(track.sd[:, track.names.index(name)])))
    if true is not None:
        head += ["error, rms", "error, max"]
        away = np.abs(wrap(angles - true))
        for errors, row in zip(away.T, rows, strict=True):
            row.extend([_degrees(np.sqrt(np.nanmean(errors**2))), _degrees(np.nanmax(errors))])
    return Table("Joint angles [°]", head, rows)


def _degrees(angle: float) -> str:
    return f"{to_deg(float(angle)):.2f}"


def _angles_figure(
    chain: Chain, track: JointTrack, angles: Floats, program: Program | None, true: Floats | None
) -> Figure:
    most = max(len(joint.axes) for joint in chain.joints)
    key = [(str(k + 1), SERIES[k], "solid") for k in range(most)] if most > 1 else [("angle", SERIES[0], "solid")]
    key = [("angle " + name if most > 1 else name, colour, dash) for name, colour, dash in key]
    key += [("truth", SOFT, "solid")] if true is not None else []
    key += [("program", SERIES[-1], "dashed")] if program is not None else []
    count = sum(bool(joint.axes) for joint in chain.joints)
    draw = partial(_draw_angles, chain, track, angles, program, true)
    band = ", with the band of ±σ" if track.sd is not None else ""
    return Figure(f"Joint angles over time{band}", draw, key, height=0.5 + 1.15 * count)


def _draw_angles(
    chain: Chain, track: JointTrack, angles: Floats, program: Program | None, true: Floats | None,
    canvas: "FigureBase",
) -> None:  # fmt: skip
    """A panel for each joint."""
    moving = [joint for joint in chain.joints if joint.axes]
    panels = canvas.subplots(len(moving), 1, sharex=True, squeeze=False)[:, 0]
    places = {name: k for k, name in enumerate(chain.angles)}
    for ax, joint in zip(panels, moving, strict=True):
        for n, name in enumerate(joint.angles):
            k = places[name]
            if true is not None:
                _line(ax, track.t, to_deg(true[:, k]), color=SOFT, linewidth=2.4)
            if track.sd is not None:
                sd = to_deg(track.sd[:, track.names.index(name)])
                _band(ax, track.t, to_deg(angles[:, k]), sd, SERIES[n])
            _line(ax, track.t, to_deg(angles[:, k]), color=SERIES[n], linewidth=0.9)
            if program is not None and name in program.names:
                values = to_deg(program.angles[:, program.names.index(name)])
                _line(ax, np.asarray(program.recorded), values, color=SERIES[-1], linewidth=0.8, linestyle="--")
        ax.set_ylabel(f"{joint.name} [°]")
    panels[-1].set_xlabel("time of the recording [s]" if program is not None else "time [s]")


def _line(ax: "Axes", t: Floats, values: Floats, **style: object) -> None:
    from plumbob.reporting.drawing import envelope

    ax.plot(*envelope(t, values, _COLUMNS, jump=180.0), **style)  # type: ignore[arg-type]


def _band(ax: "Axes", t: Floats, middle: Floats, sd: Floats, colour: str) -> None:
    rows = slice(None, None, max(1, t.size // _COLUMNS))
    ax.fill_between(t[rows], (middle - sd)[rows], (middle + sd)[rows], color=colour, alpha=0.25, linewidth=0)


def _hand_figure(chain: Chain, track: JointTrack, angles: Floats, true: Floats | None) -> Figure:
    hand = chain.hand_at(chain.postures(angles)) if track.hand is None else track.hand
    there = None if true is None else chain.hand_at(chain.postures(true))

    def draw(canvas: "FigureBase") -> None:
        panels = canvas.subplots(3, 1, sharex=True)
        for k, ax in enumerate(panels):
            if there is not None:
                _line(ax, track.t, there[:, k], color=SOFT, linewidth=2.4)
            if track.hand_sd is not None:
                _band(ax, track.t, hand[:, k], track.hand_sd[:, k], SERIES[0])
            _line(ax, track.t, hand[:, k], color=SERIES[0], linewidth=0.9)
            ax.set_ylabel(f"{'xyz'[k]} [m]")
        panels[-1].set_xlabel("time [s]")

    band = ", with the band of ±σ" if track.hand_sd is not None else ""
    key = [("hand", SERIES[0], "solid"), *([("truth", SOFT, "solid")] if there is not None else [])]
    return Figure(f"Position of the hand over time{band}", draw, key, height=3.4)


_RATES: Final = ("velocity", "acceleration", "jerk")


def _program_part(chain: Chain, program: Program) -> Report:
    """What was taught: stops, deviations, and how much of the limits it uses."""
    stops = [
        [
            str(k),
            f"{stop.recorded:.2f}",
            f"{stop.start:.2f}",
            f"{stop.end - stop.start:.2f}",
            *(f"{to_deg(angle):.2f}" for angle in stop.angles),
        ]
        for k, stop in enumerate(program.stops, 1)
    ]
    tables = [
        Table("Stops", ["", "recorded at [s]", "at [s]", "for [s]", *(f"{name} [°]" for name in program.names)], stops)
    ]
    if program.deviations:
        rows = [[name, _degrees(error.rms), _degrees(error.max)] for name, error in program.deviations.items()]
        tables.append(Table("Deviation of the program from the recording [°]", ["", "rms", "max"], rows))
    tables.append(_limits_table(chain, program))
    bounded = [name for name in _RATES if any(np.isfinite(getattr(limit, name)) for limit in chain.limits)]
    figures = []
    if bounded:
        key = [
            (name, SERIES[k % len(SERIES)], _DASHES[k // len(SERIES) % len(_DASHES)])
            for k, name in enumerate(program.names)
        ]
        draw = partial(_draw_use, chain, program, bounded)
        figures = [Figure("Use of the limits over time", draw, key, height=0.5 + 1.1 * len(bounded))]
    return Report("Program", list(program.facts().items()), tables, program.notes, figures)


def _limits_table(chain: Chain, program: Program) -> Table:
    used = program.used(chain)
    bounds = {"position": chain.limits} | {
        name: tuple(limit for limit in chain.limits if np.isfinite(getattr(limit, name))) for name in _RATES
    }
    rows = [[name, f"{100.0 * used[name]:.1f}" if bounds[name] and used[name] else "without limit"] for name in used]
    return Table("Greatest use of the limits [%]", ["", "of the limit"], rows)


def _draw_use(chain: Chain, program: Program, names: Sequence[str], canvas: "FigureBase") -> None:
    """Differences of the samples over the limits."""
    bounds = dict(zip(chain.angles, chain.limits, strict=True))
    panels = canvas.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for ax, name in zip(panels, names, strict=True):
        order = 1 + _RATES.index(name)
        for k, angle in enumerate(program.names):
            values = np.diff(program.angles[:, k], order) * program.rate**order / getattr(bounds[angle], name)
            style = {"color": SERIES[k % len(SERIES)], "linestyle": _DASHES[k // len(SERIES) % len(_DASHES)]}
            _line(ax, program.t[order:], 100.0 * values, linewidth=0.7, **style)
        ax.set_ylim(-105.0, 105.0)
        ax.set_yticks((-100, 0, 100))
        ax.set_ylabel(f"{name} [%]")
    panels[-1].set_xlabel("time of the program [s]")
