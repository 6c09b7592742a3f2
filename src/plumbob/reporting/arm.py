"""Descriptions of chains in motion, with a stick figure to turn and play, and of arrays of units."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Final

import numpy as np

from plumbob.arm.angles import JointTrack
from plumbob.arm.array.monitoring import Monitored
from plumbob.arm.array.relative import ArrayInfo
from plumbob.arm.array.virtual_unit import Combined
from plumbob.arm.gait import PERCENT, Strides
from plumbob.arm.program import Program
from plumbob.arm.replayed import in_order
from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.errors import ShapeError
from plumbob.core.text import counted, measured, number
from plumbob.core.units import to_deg, to_dps
from plumbob.data import TRIADS
from plumbob.data.chain import Chain, Posture
from plumbob.reporting.content import SERIES, SOFT, Figure, Scene, Table
from plumbob.reporting.drawing import PlotLine, PlotPanel, draw_panels
from plumbob.reporting.report import Report
from plumbob.rotations import wrap

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

    `angles` (N, all) are those of `Chain.angles`, rad; `postures` may be known better; `shadow` are angles drawn pale.
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
    strides: Mapping[str, Strides] | None = None,
) -> Report:
    """Report of a motion: a stick figure, joint angles with their standard deviation, the hand, and a program.

    `truth` are true angles at the same times, drawn pale; `strides` are those of each leg that walks.
    """
    angles = in_order(chain, track)
    if truth is not None and not np.array_equal(truth.t, track.t):
        raise ShapeError("truth must have the times of the estimate; interpolate it at them first.")
    true = None if truth is None else in_order(chain, truth)
    tables = [_angles_table(chain, angles, track, true)]
    figures = [_angles_figure(chain, track, angles, program, true)]
    has_hand = track.hand is not None or bool(chain.hand or any(chain.hand_b))
    if strides:
        figures.insert(0, _strides_figure(strides))
        tables.insert(0, _strides_table(strides))
    if has_hand and (track.hand is not None or np.isfinite(angles).all()):
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


def _strides_figure(strides: Mapping[str, Strides]) -> Figure:
    """Mean of each angle over the stride, a panel each, both legs in it, with the band of a standard deviation."""
    names = list(dict.fromkeys(name[:-2] for walk in strides.values() for name in walk.names))
    key = [({"_r": "right", "_l": "left"}[side], SERIES[k], "solid") for k, side in enumerate(strides)]

    def panels() -> list[PlotPanel]:
        made, tables = list[PlotPanel](), {side: walk.columns() for side, walk in strides.items()}
        for name in names:
            lines = []
            for k, (side, columns) in enumerate(tables.items()):
                if name + side in strides[side].names:
                    mean, sd = (to_deg(columns[f"{name}{side}{end} [rad]"]) for end in ("", "_sd"))
                    lines.append(PlotLine(PERCENT, mean, SERIES[k], width=1.2,
                                          band=(mean - sd, mean + sd, SERIES[k], 0.25)))  # fmt: skip
            made.append(PlotPanel(f"{name.replace('_', ' ')} [°]", lines, "stride [%]", x=(0.0, 100.0)))
        return made

    return Figure("Mean stride, with the band of ± a standard deviation between strides", partial(draw_panels, panels),
                  key, height=0.6 + 1.3 * len(names))  # fmt: skip


def _strides_table(strides: Mapping[str, Strides]) -> Table:
    facts = {side: dict(walk.facts()) for side, walk in strides.items()}
    names = dict.fromkeys(name for texts in facts.values() for name in texts)
    rows = [[name, *(texts.get(name, "") for texts in facts.values())] for name in names]
    return Table("Strides", ["", *({"_r": "right", "_l": "left"}[side] for side in facts)], rows)


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
    draw = partial(draw_panels, partial(_angle_panels, chain, track, angles, program, true))
    band = ", with the band of ±σ" if track.sd is not None else ""
    return Figure(f"Joint angles over time{band}", draw, key, height=0.5 + 1.15 * count)


def _angle_panels(
    chain: Chain, track: JointTrack, angles: Floats, program: Program | None, true: Floats | None
) -> list[PlotPanel]:
    """A panel for each joint."""
    panels, places = [], {name: k for k, name in enumerate(chain.angles)}
    for joint in (joint for joint in chain.joints if joint.axes):
        lines: list[PlotLine] = []
        for n, name in enumerate(joint.angles):
            k = places[name]
            sd = None if track.sd is None else to_deg(track.sd[:, track.names.index(name)])
            lines += _lines(track.t, to_deg(angles[:, k]), None if true is None else to_deg(true[:, k]), sd, SERIES[n])
            if program is not None and name in program.names:
                values = to_deg(program.angles[:, program.names.index(name)])
                lines.append(PlotLine(np.asarray(program.recorded), values, SERIES[-1], "dashed", jump=180.0))
        panels.append(PlotPanel(f"{joint.name} [°]", lines, f"time{' of the recording' if program else ''} [s]"))
    return panels


def _lines(t: Floats, values: Floats, true: Floats | None, sd: Floats | None, colour: str) -> list[PlotLine]:
    """Truth, pale, and values with the band of ±σ, as far as they are there."""
    band = None if sd is None else (values - sd, values + sd, colour, 0.25)
    pale = [] if true is None else [PlotLine(t, true, SOFT, width=2.4, jump=180.0)]
    return [*pale, PlotLine(t, values, colour, width=0.9, jump=180.0, band=band)]


def _hand_figure(chain: Chain, track: JointTrack, angles: Floats, true: Floats | None) -> Figure:
    hand = chain.hand_at(chain.postures(angles)) if track.hand is None else track.hand
    there = None if true is None else chain.hand_at(chain.postures(true))

    def panels() -> list[PlotPanel]:
        rows = zip(hand.T, [None] * 3 if there is None else there.T,
                   [None] * 3 if track.hand_sd is None else track.hand_sd.T, strict=True)  # fmt: skip
        return [
            PlotPanel(f"{axis} [m]", _lines(track.t, *row, SERIES[0])) for axis, row in zip("xyz", rows, strict=True)
        ]

    band = ", with the band of ±σ" if track.hand_sd is not None else ""
    key = [("hand", SERIES[0], "solid"), *([("truth", SOFT, "solid")] if there is not None else [])]
    return Figure(f"Position of the hand over time{band}", partial(draw_panels, panels), key, height=3.4)


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
        draw = partial(draw_panels, partial(_use_panels, chain, program, bounded))
        figures = [Figure("Use of the limits over time", draw, key, height=0.5 + 1.1 * len(bounded))]
    return Report("Program", list(program.facts().items()), tables, program.notes, figures)


def _limits_table(chain: Chain, program: Program) -> Table:
    used = program.used(chain)
    bounds = {"position": chain.limits} | {
        name: tuple(limit for limit in chain.limits if np.isfinite(getattr(limit, name))) for name in _RATES
    }
    rows = [[name, f"{100.0 * used[name]:.1f}" if bounds[name] and used[name] else "without limit"] for name in used]
    return Table("Greatest use of the limits [%]", ["", "of the limit"], rows)


def _use_panels(chain: Chain, program: Program, names: Sequence[str]) -> list[PlotPanel]:
    """Differences of the samples over the limits."""
    bounds, panels = dict(zip(chain.angles, chain.limits, strict=True)), []
    for name in names:
        order, lines = 1 + _RATES.index(name), []
        for k, angle in enumerate(program.names):
            values = np.diff(program.angles[:, k], order) * program.rate**order / getattr(bounds[angle], name)
            style = SERIES[k % len(SERIES)], _DASHES[k // len(SERIES) % len(_DASHES)]
            lines.append(PlotLine(program.t[order:], 100.0 * values, *style, width=0.7))
        xlabel = "time of the program [s]"
        panels.append(PlotPanel(f"{name} [%]", lines, xlabel, y=(-105.0, 105.0), ticks=(-100, 0, 100)))
    return panels


def arrayinfo(info: ArrayInfo) -> Report:
    """Tables by unit."""
    tables = [
        Table("Rotation beyond the mount [°]", ("unit", "x", "y", "z"), [
            (unit.name, *_cells(to_deg(unit.rotation), to_deg(unit.rotation_sd))) for unit in info.units
        ])
    ]  # fmt: skip
    names = {"gyr": "gyroscope bias [°/s]", "acc": "accelerometer bias [m/s²]", "mag": "magnetometer bias [µT]"}
    for triad in TRIADS:
        if not any(triad in unit.bias for unit in info.units):
            continue
        turn = to_dps if triad == "gyr" else np.asarray
        rows = [(unit.name, *_cells(turn(unit.bias[triad]), turn(unit.bias_sd[triad]))) for unit in info.units]
        tables.append(Table(f"Relative {names[triad]}", ("unit", "x", "y", "z"), rows))
    rows = [
        (unit.name, *_cells(np.array([1e3 * unit.clock_offset]), np.array([1e3 * unit.clock_sd])))
        for unit in info.units
    ]
    tables.append(Table("Clock offset [ms]", ("unit", "later by"), rows))
    remarks = ["Every figure is relative to the mean of all units: what they have in common does not show."]
    if any(np.isnan(unit.clock_offset) for unit in info.units):
        remarks.append("The array hardly moved: clock offsets need rates well above the noise.")
    return Report("Array", list(info.facts().items()), tables, remarks)


def _cells(values: Floats, sds: Floats) -> tuple[str, ...]:
    pairs = zip(np.asarray(values).tolist(), np.asarray(sds).tolist(), strict=True)
    return tuple(measured(value, value - sd, value + sd) for value, sd in pairs)


def monitored(watched: Monitored) -> Report:
    """Faults and counts."""
    counts = flags.counts(watched.imu.flags)
    facts = [
        ("units", ", ".join(watched.names)),
        ("samples", f"{len(watched)}, {watched.imu.t[-1] - watched.imu.t[0]:.6g} s"),
    ]
    facts += [("flag", f"{name}: {counted(count, 'sample')}") for name, count in counts.items()]
    rows = [
        (f.unit, f.triad, f.kind, f"{f.begin:.2f}", "-" if np.isnan(f.end) else f"{f.end:.2f}") for f in watched.faults
    ]
    table = Table("Units left out", ("unit", "triad", "fault", "from [s]", "to [s]"), rows, words=(1, 2))
    unsolved = int(np.count_nonzero(watched.imu.flags & flags.CANNOT_ISOLATE))
    remarks = ["No unit contradicts the others."] if not (rows or unsolved) else []
    if unsolved:
        remarks.append(
            f"In {counted(unsolved, 'sample')} units contradict each other, and nothing says which one is wrong."
        )
    if 2 * unsolved > len(watched):
        remarks.append("This is most of the time: check how the units are mounted, and their calibration.")
    return Report("Array monitor", facts, (table,) if rows else (), remarks)


def combined(virtual: Combined) -> Report:
    """What each unit measures beyond the virtual one."""
    facts = [
        ("units", ", ".join(virtual.names)),
        ("samples", f"{len(virtual)}, {virtual.imu.t[-1] - virtual.imu.t[0]:.6g} s"),
    ]
    scale = {"gyr": float(to_dps(1.0)), "acc": 1.0, "mag": 1.0}
    names = {"gyr": "gyr [°/s]", "acc": "acc [m/s²]", "mag": "mag [µT]"}
    rms = virtual.parity_rms
    rows = [
        (name, *(number(scale[triad] * float(np.sqrt(np.mean(rms[triad][u] ** 2)))) for triad in rms))
        for u, name in enumerate(virtual.names)
    ]
    table = Table("Rms beyond the virtual unit", ("unit", *(names[triad] for triad in rms)), rows)
    return Report("Combined array", facts, (table,))
