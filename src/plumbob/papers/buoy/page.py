"""The buoy paper's page [Yu2018]: its parts in the order of the paper, each with its outcomes, tables and figures."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from plumbob.calibration.ellipsoid_fit import fit_axes
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import from_si, to_deg, to_dps
from plumbob.data import AttitudeTrack
from plumbob.filters import mahony
from plumbob.papers.buoy import bench
from plumbob.papers.buoy.as_printed import KI, KP, loop
from plumbob.papers.buoy.bench import KEPT, PERIODS, SETTLE, STROKES, CalibratedUnit, Device, Sailed, Slid, bound
from plumbob.papers.buoy.modules import STEP, WIDE_STEP, ModuleStatistics, Refused
from plumbob.papers.buoy.static_test import ANGLES, StaticTest
from plumbob.papers.description import BUOY
from plumbob.papers.outcome import Outcome, Paper, Part
from plumbob.quality.quality import FAIL, MEANING
from plumbob.quality.tilt import tilt_statistics
from plumbob.reporting.content import INK, MUTED, SERIES, SOFT, Both, Figure, Scene, Table
from plumbob.rotations import euler_zyx_from_quat, quat_rotate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

FIRST: Final = STROKES[0]
"""The set of strokes that the bars of the gate are about."""
KPS: Final = (0.1, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5)
"""Gains of the scan, 1/s."""
SCANNED: Final = ((3.0, 0.8), (1.5, 0.6))
"""Its strokes, m/s and s."""
BLUE, RED, GREEN, PINK, AMBER = SERIES[:5]
ANGLE: Final = BUOY.texts("angle")
_PAIR: Final = ("gate 0.08 g", "mekf")
"""What figures are of: by the paper's method, and by Plumbob's."""


class Results(NamedTuple):
    """All that the run found.

    `unit`, `device`: the unit that goes through bytes, and its own program; `static`: beside the DCM260B, with the
    paper's card and the best one; `slid`: by strokes; `sailed`: at sea; `rings`: static test of many modules, by row;
    `refused`: captures that calibrate nothing; `slides` (seeds, 2): largest roll and pitch, deg, of many units, by
    strokes and contender; `sea` (seeds, 3): rms of roll, pitch and yaw, deg, of several units, by contender; `scan`
    (gains, 2, 2): largest roll and pitch, deg, by strokes and Kp, without the gate and with it; `strongest`: largest
    roll of any stroke to 3 m/s with Kp 0.5 and without the gate, deg; `misprints`: what printed forms give; `modules`:
    how many were turned on the table.
    """

    unit: CalibratedUnit
    device: Device
    static: tuple[StaticTest, StaticTest]
    slid: Mapping[tuple[float, float], Slid]
    sailed: Sailed
    rings: Mapping[str, ModuleStatistics]
    refused: Mapping[str, Refused]
    slides: Mapping[tuple[float, float], Mapping[str, Floats]]
    sea: Mapping[str, Floats]
    scan: Mapping[tuple[float, float], Floats]
    strongest: float
    misprints: Mapping[str, tuple[float, ...]]
    modules: int


def paper(results: Results, seed: int) -> Paper:
    """The page of a run, and every figure in the order of the paper."""
    parts = [part(results) for part in (_system, _events, _calibration, _static, _slide, _sea, _misprinted)]
    report = BUOY.part(
        "page",
        seed=seed,
        device=results.unit.best.device,
        modules=results.modules,
        units=len(results.slides[FIRST]["mekf"]),
        seas=len(results.sea["mekf"]),
        kp=KP,
        ki=KI,
        parts=[part for part, _ in parts],
        links=[(BUOY.text("report_of_the_sea"), f"buoy/{bench.REPORT}")] if results.sailed.page else [],
    )
    return Paper(report=report, outcomes=[row for _, rows in parts for row in rows])


def signed(value: float, digits: int) -> str:
    """Number with so many digits, and a minus as it is printed."""
    return f"{value:.{digits}f}".replace("-", "−")


def _largest(values: Floats) -> float:
    return float(np.abs(values).max())


def _system(results: Results) -> Part:
    """Constants that the paper states, and the start of the slide: what is removed of the rates, the first attitude."""
    params, slid, gyr = mahony.Params(), results.slid[FIRST], results.unit.paper.gyr
    assert params.gate is not None
    assert gyr is not None
    removed = _largest(slid.errors[KEPT][:, 1:])
    outcomes = BUOY.rows(
        {
            "kp": params.kp,
            "ki": params.ki,
            "gate": params.gate / G0,
            "mag.step": float(from_si(WIDE_STEP, "mgauss")),
            "boot.bias": float(to_dps(np.abs(gyr.bias).max())),
            "boot.kept": removed,
            "boot.first": (_largest(slid.errors[_PAIR[0]][0, 1:]), _largest(slid.errors[_PAIR[1]][0, 1:])),
        }
    )
    yaw, pitch, roll = (signed(v, 2) for v in slid.errors[_PAIR[0]][0])
    same = results.sailed.equal
    report = BUOY.part(
        "system",
        bias=", ".join(signed(v, 1) for v in to_dps(gyr.bias)),
        tilt=removed,
        roll=roll,
        pitch=pitch,
        yaw=yaw,
        lines=results.sailed.lines,
        same="the same attitude to the bit" if same else "ANOTHER attitude",
        same_zh="与实时结果逐位一致" if same else "与实时结果不一致",
        tables=[BUOY.table("stages_of_the")],
        scenes=[_model(results.sailed.live, results.sailed.truth)],
    )
    return report, outcomes


def _model(track: AttitudeTrack, truth: AttitudeTrack) -> Scene:
    """The host program's model of Fig 6: axes and rim of the buoy in the last half minute, the truth beside it pale."""
    rows = np.flatnonzero(track.t >= track.t[-1] - 30.0)[::5]
    places = {
        "x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "−x": (-1.0, 0.0, 0.0), "−y": (0.0, -1.0, 0.0),
        "z": (0.0, 0.0, 0.9), "o": (0.0, 0.0, 0.0),
    }  # fmt: skip
    lines = [("x", "y"), ("y", "−x"), ("−x", "−y"), ("−y", "x"), ("o", "x"), ("o", "y"), ("o", "z")]
    yaw, pitch, roll = to_deg(euler_zyx_from_quat(track.q_nb[rows])).T
    points, shadow = (  # in axes of north, west and up
        {name: quat_rotate(q_nb, np.array(place)) * [1.0, -1.0, -1.0] for name, place in places.items()}
        for q_nb in (track.q_nb[rows], truth.q_nb[rows])
    )
    return Scene(
        caption=BUOY.text("figure_6_the_host"),
        t=track.t[rows] - track.t[rows[0]],
        points=points,
        lines=lines,
        values={"γ": roll, "θ": pitch, "φ": yaw},
        shadow=shadow,
    )


def _events(results: Results) -> Part:
    """The device's own program; Figure 4: what its main loop does in its first milliseconds."""
    device = results.device
    outcomes = BUOY.rows(
        {
            **{f"rate.{task}": rate for task, rate in device.rates.items()},
            "events.missed": float(sum(device.missed.values())),
            "events.idle": 100.0 * device.idle,
            "log.same": 100.0 * device.same,
            "log.years": device.years,
            "device.roll": device.roll,
            "device.pitch": device.pitch,
        }
    )
    rows = [
        [
            name,
            f"{PERIODS[task]}",
            f"{device.rates[task]:.2f}",
            f"{device.missed[task]}",
            f"{1e3 * device.latest[task]:.2f}",
            f"{device.waiting[task]}",
        ]
        for task, name in BUOY.texts("events").items()
    ]
    names, length = BUOY.texts("tasks"), 0.16  # s

    def draw(canvas: "FigureBase") -> None:
        ax = canvas.subplots()
        for row, (name, colour) in enumerate(zip(names, (BLUE, GREEN, RED), strict=True)):
            begun, done = device.calls[name]
            mask = begun < length
            bars = list(zip(1e3 * begun[mask], 1e3 * (done - begun)[mask], strict=True))
            ax.broken_barh(bars, (1.7 - row, 0.6), facecolors=colour)
            ax.text(-0.015, 2.0 - row, names[name], transform=ax.get_yaxis_transform(), ha="right", va="center")
        ax.set_yticks([2.0, 1.0, 0.0], [""] * len(names))  # a tick's label would lose its Chinese
        ax.set_xlim(0.0, 1e3 * length)

    report = BUOY.part(
        "events",
        device=device,
        idle=100 * device.idle,
        same="the same bits" if device.same else "OTHER bits",
        same_zh="逐位一致" if device.same else "不一致",
        tables=[BUOY.table("emulated_program_on", rows)],
        figures=[BUOY.figure("figure_4", draw)],
    )
    return report, outcomes


def _calibration(results: Results) -> Part:
    """The capture and its fits, and captures that must be refused."""
    unit, card = results.unit, results.unit.paper.mag
    assert card is not None
    x, y, z = (unit.mag / np.abs(unit.mag).max()).T
    matrix = np.column_stack((-y * y, -z * z, 2.0 * x, 2.0 * y, 2.0 * z, np.ones_like(x)))  # [Yu2018] (12)
    fewest = next(n for n in range(1, len(matrix) + 1) if np.linalg.matrix_rank(matrix[:n]) == matrix.shape[1])
    refused = {key: (100.0 * of.failed, 100.0 * of.rightly) for key, of in results.refused.items()}
    outcomes = BUOY.rows(
        {
            "regions": float(unit.regions),
            "fewest": float(fewest),
            **{f"refused.{key}": shares for key, shares in refused.items()},
        }
    )
    rings = []
    for name, title in BUOY.texts("ring_rows").items():
        fit = results.rings[name]
        shares = [f"{100 * share:.0f}" for share in (fit.within, fit.yaw5, fit.all5, fit.failed)]
        rings.append([title, f"{fit.before:.1f}", f"{fit.yaw:.2f}", f"{fit.yaw95:.2f}", f"{fit.level95:.2f}", *shares])
    rows = []
    for key, name in BUOY.texts("captures").items():
        failed, rightly = refused[key]
        yaw = results.refused[key].yaw
        rows.append([name, f"{rightly:.0f}", f"{failed:.0f}", f"{yaw:.0f}" if math.isfinite(yaw) else "-"])
    sizes = (np.linalg.norm(mag, axis=1) for mag in (unit.mag, (unit.mag - card.bias) @ card.matrix.T))
    spread = [100.0 * float(np.std(size) / np.mean(size)) for size in sizes]
    report = BUOY.part(
        "calibration",
        regions=unit.regions,
        spread=spread[0],
        spread_2=spread[1],
        tables=[
            BUOY.table("ring", rings, title=BUOY.text("static_test_of_random", modules=results.modules)),
            BUOY.table("captures_that_calibrate", rows),
        ],
        figures=[_figure_5(unit.mag_counts, unit.step)],
    )
    return report, outcomes


def _figure_5(counts: Floats, step: float) -> Figure:
    """Readings of the magnetometer in 18 regions, before and after the fit; counts (18, 3), step in µT."""
    fit = fit_axes(counts)
    assert fit is not None
    after = (counts - fit.centre) @ fit.shape.T
    semi = 1.0 / np.diag(fit.shape)

    def draw(canvas: "FigureBase") -> None:
        axes = canvas.subplots(2, 3)
        limit = 1.15 * float(np.max(np.abs(fit.centre) + semi))
        for column, (i, j) in enumerate(((0, 1), (0, 2), (1, 2))):
            pair = [i, j]
            _plane(axes[0, column], counts[:, pair], fit.centre[pair], semi[pair], limit, RED)
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


def _static(results: Results) -> Part:
    """Figure 7: errors of three angles at 36 headings beside the DCM260B; the same of many modules."""
    paper, best = results.static
    three = (paper.before, paper.after, best.after)
    figures: dict[str, float | tuple[float | None, float]] = {}
    rows = []
    for name in ANGLES:
        largest, rms = ([to_deg(getattr(e.stats[name], kind)) for e in three] for kind in ("max_abs", "rmse"))
        figures |= {f"static.before.{name}": largest[0], f"static.after.{name}": (largest[1], largest[2])}
        rows.append([ANGLE[name], *(f"{value:.2f}" for value in (*largest, *rms))])
    rings = results.rings
    for capture in ("pitch", "roll", "faces"):
        figures[f"modules.yaw.{capture}"] = rings[capture].yaw95, rings[f"{capture}, chosen"].yaw95
    faces, chosen = rings["faces"], rings["faces, chosen"]
    figures["modules.level"] = faces.level95, chosen.level95
    figures["modules.all5"] = 100.0 * faces.all5, 100.0 * chosen.all5
    figures["modules.iron"] = rings["c 0.1"].yaw95, rings["c 0.1, general"].yaw95
    figures["modules.alone"] = rings["magnetometer alone"].yaw95
    heading = np.mod(to_deg(paper.reference[:, 0]), 360.0)
    order = np.argsort(heading)

    def draw(canvas: "FigureBase") -> None:
        axes = canvas.subplots(3, 1, sharex=True)
        lines = (
            (paper.errors("before"), RED, "--"), (paper.errors("after"), BLUE, "-"), (best.errors("after"), GREEN, "-")
        )  # fmt: skip
        for i, (ax, name) in enumerate(zip(axes, ANGLES, strict=True)):
            ax.axhline(0.0, color=SOFT, linewidth=0.5)
            for errors, colour, dash in lines:
                how = {"color": colour, "marker": "o", "markersize": 1.8, "linewidth": 0.8}
                ax.plot(heading[order], to_deg(errors[order, i]), dash, **how)
            for limit in (-5.0, 5.0):
                ax.axhline(limit, color=MUTED, linewidth=0.6, linestyle=":")
            ax.set_ylabel(BUOY.text("error", name=ANGLE[name]))
        axes[-1].set_xticks(range(0, 361, 45))

    report = BUOY.part("static", tables=[BUOY.table("errors_of_the", rows)], figures=[BUOY.figure("figure_7", draw)])
    return report, BUOY.rows(figures)


def _strokes(pair: tuple[float, float]) -> str:
    return f"{pair[0]:g} m/s, {pair[1]:g} s"


def _both(values: Sequence[float] | Floats, digits: int = 2) -> str:
    return " / ".join(f"{v:.{digits}f}" for v in values)


def _slide(results: Results) -> Part:
    first, slid = results.slides[FIRST], results.slid[FIRST]
    outcomes = []
    for column, axis in enumerate(("roll", "pitch")):
        open_, shut, new = (first[name][:, column] for name in ("no gate", *_PAIR))
        free, gated, ours = (slid.largest(name)[column] for name in ("no gate", *_PAIR))
        outcomes += BUOY.rows(
            {
                f"slide.open.{axis}": float(np.median(open_)),
                f"slide.gated.{axis}": (float(shut.max()), float(new.max())),
                f"slide.reduction.{axis}": float(np.median(100.0 * (1.0 - shut / open_))),
                f"slide.unit.{axis}": (gated, ours),
            },
            largest=free,
        )
    for pair in STROKES:
        worst = (float(results.slides[pair][name].max()) for name in _PAIR)
        outcomes.append(BUOY.row("slide.new.{:g}-{:g}".format(*pair), faithful=next(worst), best=next(worst)))
    outcomes += BUOY.rows({"slide.bound": results.strongest}, bound=bound(3.0))
    head = ("", *map(_strokes, results.slides))
    names, units = BUOY.texts("contenders"), len(first["mekf"])
    many, most = (
        [[names[name], *(_both(of(by[name], axis=0)) for by in results.slides.values())] for name in bench.SLIDE]
        for of in (np.median, np.max)
    )
    single = [
        [name, *(_both(results.slid[pair].largest(key)) for pair in results.slides)] for key, name in names.items()
    ]
    gains = [
        [f"{kp:g}", *(_both(results.scan[pair][k, :, gate], 1) for pair in SCANNED for gate in (0, 1))]
        for k, kp in enumerate(KPS)
    ]
    scanned = {BUOY.text("no_gate", pair=_strokes(pair)): results.scan[pair][:, 0] for pair in SCANNED}
    gain_head = ["Kp [1/s]", *(text for name in scanned for text in (name, BUOY.text("gate_0_08_g_2")))]
    pi = loop()
    report = BUOY.part(
        "slide",
        kp=KP,
        bound=bound(3.0),
        strongest=results.strongest,
        poles=signed(pi.poles[0], 3),
        pi_poles=signed(pi.poles[1], 4),
        damping=pi.damping,
        peak=5 * pi.peak,
        tables=[
            BUOY.table("largest_roll_pitch", many, units=units, head=head),
            BUOY.table("same_worst_of", most, units=units, head=head),
            BUOY.table("unit_through_bytes", single, head=head),
            BUOY.table("largest_roll_pitch_by", gains, head=gain_head),
        ],
        figures=[_figure_8(slid), _gains(scanned)],
    )
    return report, outcomes


def _figure_8(slid: Slid) -> Figure:
    """Roll and pitch on a level desk, slid quickly, with and without the gate."""
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


def _gains(scans: Mapping[Both, Floats]) -> Figure:
    """Largest roll on a slide over Kp, without and with the gate, by strokes; and what the paper prints."""

    def draw(canvas: "FigureBase") -> None:
        ax = canvas.subplots()
        for rolls, colour in zip(scans.values(), (RED, BLUE, GREEN), strict=False):
            for values, dash in zip(rolls.T, ("-o", "--o"), strict=True):
                ax.plot(KPS, values, dash, color=colour, markersize=2.4, linewidth=0.9)
        for level in (9.6, 3.3):
            ax.axhline(level, color=MUTED, linewidth=0.7, linestyle=":")
        ax.axvline(0.5, color=SOFT, linewidth=0.7)

    key = [(name, colour, "solid") for name, colour in zip(scans, (RED, BLUE, GREEN), strict=False)]
    key += [(BUOY.text("same_with_the_gate"), INK, "dashed"), (BUOY.text("9_6_and_3"), MUTED, "dotted")]
    return BUOY.figure("largest_roll_on", draw, lines=key)


def _sea(results: Results) -> Part:
    sailed, outcomes = results.sailed, list[Outcome]()
    settled = sailed.t >= SETTLE
    rms = {  # of roll, pitch and yaw, deg
        name: np.sqrt(np.mean(errors[settled] ** 2, axis=0))[::-1] for name, errors in sailed.errors.items()
    }
    for column, axis in enumerate(("roll", "pitch", "yaw")):
        many, one = ([float(np.median(results.sea[name][:, column])) for name in _PAIR],
                     [float(rms[name][column]) for name in _PAIR])  # fmt: skip
        outcomes += BUOY.rows({f"sea.{axis}": (many[0], many[1]), f"sea.unit.{axis}": (one[0], one[1])})
    worst = []  # of any angle of the unit through bytes, at rest and sliding, and at sea
    for static, name in zip(results.static, _PAIR, strict=True):
        at_rest = [to_deg(static.after.stats[angle].max_abs) for angle in ANGLES]
        moving = [_largest(slid.errors[name]) for slid in results.slid.values()]
        worst.append(max(*at_rest, *moving, _largest(sailed.errors[name][settled])))
    outcomes += BUOY.rows(
        {
            "sea.output": (None, float(sailed.lines / sailed.t[-1])),
            "sea.replay": (None, 100.0 * sailed.equal),
            "claim": (worst[0], worst[1]),
        }
    )
    rows = []
    for key, name in BUOY.texts("sea").items():
        median = np.median(results.sea[key], axis=0) if key in results.sea else np.full(3, np.nan)
        rows.append([name, *("-" if math.isnan(v) else f"{v:.3f}" for v in (*median, *rms[key]))])
    axes, seas = [ANGLE[name] for name in ("roll", "pitch", "yaw")], len(results.sea["mekf"])
    head = (
        "",
        *(BUOY.text("seas", seas=seas, axis=axis) for axis in axes),
        *(BUOY.text("bytes", axis=axis) for axis in axes),
    )
    last = sailed.t >= sailed.t[-1] - 60.0

    def draw(canvas: "FigureBase") -> None:
        upper, lower = canvas.subplots(2, 1, sharex=True)
        roll = to_deg(euler_zyx_from_quat(sailed.truth.q_nb[last])[:, 2])
        upper.plot(sailed.t[last], roll, color=INK, linewidth=0.9)
        for key, colour in {"tilt_compass": SOFT, "gate 0.08 g": BLUE, "mekf": GREEN, "smoother": AMBER}.items():
            lower.plot(sailed.t[last], sailed.errors[key][last, 2], color=colour, linewidth=0.8)

    report = BUOY.part(
        "sea",
        tables=[BUOY.table("rms_error_in", rows, head=head), _tilt_table(sailed), _quality_table(sailed)],
        figures=[BUOY.figure("roll_in_waves", draw)],
    )
    return report, outcomes


def _tilt_table(sailed: Sailed) -> Table:
    """Statistics of tilt by the report, whose filter is the smoother, beside the true ones."""
    _, pitch, roll = euler_zyx_from_quat(sailed.truth.q_nb).T
    true = tilt_statistics(sailed.truth.t, roll, pitch)
    ours = sailed.overview.subjects[0].gathered.tilt
    assert ours is not None
    rows = []
    for name in ("roll", "pitch"):
        for who, tilt in ((BUOY.text("report"), getattr(ours, name)), (BUOY.text("truth"), getattr(true, name))):
            label = BUOY.text("angle_by", name=name, who=who, angle_name=ANGLE[name])
            angles = [f"{to_deg(v):.2f}" for v in (tilt.sd, tilt.significant, tilt.largest)]
            rows.append([label, *angles, f"{tilt.tz:.2f}", f"{tilt.tp:.2f}", f"{tilt.waves}"])
    return BUOY.table("tilt_statistics_of", rows)


def _quality_table(sailed: Sailed) -> Table:
    """Quality flags by burst, and why where one is not a pass."""
    channels = BUOY.texts("channels")
    words = {1: "通过", 2: "未评估", 3: "可疑", FAIL: "不合格", 9: "缺失"}
    tests = {"gap": "缺样", "percent good": "有效率"}
    rows = []
    for burst in sailed.overview.subjects[0].gathered.bursts:
        cells = []
        for channel in channels:
            qc = burst.verdicts[channel]
            why, zh = (f": {qc.why}", f"：{tests.get(qc.why, qc.why)}") if qc.why else ("", "")
            cells.append(
                BUOY.text("flag_and_why", flag=qc.flag, qc_flag=MEANING[qc.flag], why=why, flag_2=words[qc.flag], zh=zh)
            )
        tilt = burst.tilt.inclination
        rows.append([f"{burst.begin:.0f} s", *cells, f"{to_deg(tilt.mean):.1f}", f"{to_deg(tilt.greatest):.1f}"])
    head = (BUOY.text("burst"), *channels.values(), BUOY.text("tilt_mean"), BUOY.text("greatest"))
    return BUOY.table("quality_flags_by", rows, head=head)


def _misprinted(results: Results) -> Part:
    step, wide_step = (from_si(value, "mgauss") for value in (STEP, WIDE_STEP))
    table = BUOY.table("misprints", forms=results.misprints, step=step, wide_step=wide_step)
    outcomes = BUOY.rows({f"literal.{key}": form[0] for key, form in results.misprints.items()})
    return BUOY.part("misprinted", tables=[table]), outcomes
