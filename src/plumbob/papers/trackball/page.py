"""Page of the trackball paper: its parts in the paper's order, with tables, remarks and figures."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.units import deg, from_si, to_deg, to_dps
from plumbob.filters.channel_scalar import steady_gain
from plumbob.noise.terms import TERMS
from plumbob.papers.description import TRACKBALL
from plumbob.papers.trackball import misprints
from plumbob.papers.trackball.recorded import Lapped, Rest, Turned, apart
from plumbob.papers.trackball.records import AT_REST, IN_MOTION, RATIOS, SAMPLES, STEP
from plumbob.papers.trackball.results import Found
from plumbob.papers.trackball.seeds import (
    LONG,
    LONG_TAUS,
    TAUS,
    OnTurntable,
    PowerFits,
    Short,
    degrees_of_freedom,
    powers,
    theory,
)
from plumbob.reporting.content import Figure, Table
from plumbob.reporting.report import Report
from plumbob.reporting.scene import Scene
from plumbob.reporting.style import GRID, INK, MUTED, SERIES, SOFT, Both

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import FigureBase


_FREEDOM: Final = TRACKBALL.text("degrees_of_freedom_white")
_BEFORE: Final = TRACKBALL.text("before_s")


def page(found: Found, seed: int) -> Report:
    """The whole page.

    Parameters
    ----------
    found : Found
        What was computed.
    seed : int
        Of the recorded runs.
    """
    parts = [part(found) for part in (_drift, _rest, _allan, _composition, _turntable, _ball, _switched)]
    return TRACKBALL.part("page", seed=seed, parts=parts, **found.seeds)


def _drift(run: Found) -> Report:
    rows = [
        [
            f"{part:+.2f}".replace("-", "−"),
            *(f"{to_dps(value):.3f}" for value in (warmed.raw, warmed.printed, warmed.own)),
            f"{to_dps(warmed.coefficient):+.4f}",
        ]
        for part, warmed in run.parts.items()
    ]
    parts = TRACKBALL.table("mean_rate_at", rows)
    soak = run.soaked
    ways = (
        (TRACKBALL.text("measured_2"), soak.raw),
        (TRACKBALL.text("3_0_1_for"), soak.printed),
        (TRACKBALL.text("own_card_of_this"), soak.own),
    )
    recorded = TRACKBALL.table(
        "recorded_soak_of", [[name, *(f"{value:.3f}" for value in to_dps(change))] for name, change in ways]
    )
    return TRACKBALL.part("drift", tables=[parts, recorded])


def _rest(run: Found) -> Report:
    rows = [
        [f"{q:g}", f"{steady_gain(q):.4f}", f"{theory(q):.5f}", f"{white:.5f}", f"{variance:.5f}", f"{angle:.2f}"]
        for q, white, variance, angle in zip(RATIOS, run.white, run.short.variance, run.short.angle, strict=True)
    ]
    table = TRACKBALL.table("at_rest_samples", rows, samples=SAMPLES)
    constant = ", ".join(f"{value:.2f}".replace("-", "−") for value in to_dps(run.rest.raw.mean(axis=0)))
    return TRACKBALL.part("rest", constant=constant, tables=[table], figures=rest_figures(run.rest))


def _allan(run: Found) -> Report:
    def table(title: Both, taus: Sequence[float], count: int, before: Sequence[float], ratios: Floats) -> Table:
        rows = [
            [_FREEDOM, *(f"{degrees_of_freedom(count, tau):.1f}" for tau in taus)],
            [_BEFORE, *(f"{to_dps(value):.4f}" for value in before)],
            *([f"Q/R = {q:g}", *(f"{value:.3f}" for value in row)] for q, row in zip(RATIOS, ratios, strict=True)),
        ]
        return Table(title, ("τ [s]", *(f"{tau:g}" for tau in taus)), rows)

    short = table(
        TRACKBALL.text("allan_deviation_after_before"), TAUS, SAMPLES, run.short.before.tolist(), run.short.adev
    )
    long = table(TRACKBALL.text("4_h_at_rest"), LONG_TAUS, round(LONG / STEP), run.long.before.tolist(), run.long.adev)
    return TRACKBALL.part(
        "allan",
        at_rest=AT_REST,
        adev=100 * run.long.adev[2, 3],
        scatter=run.short.scatter[-1],
        tables=[short, long],
        figures=[allan_figure(run.rest, run.short)],
    )


def _composition(run: Found) -> Report:
    scale = to_dps(to_dps(1.0))
    rows = [
        [name, f"{plain * scale:.2e}", f"{weighted * scale:.2e}"]
        for name, plain, weighted in zip(
            TRACKBALL.texts("terms").values(), run.fit.plain, run.fit.weighted, strict=True
        )
    ]
    table = TRACKBALL.table("coefficients_of_14", rows)
    return TRACKBALL.part(
        "composition",
        white=from_si(run.long.white, "deg/rth"),
        flicker=from_si(run.long.flicker, "deg/h"),
        negative=100 * run.negative[0],
        short=run.seeds["short"],
        run_negative=100 * run.negative[1],
        tables=[table],
        figures=[TRACKBALL.figure("14_fits_of", partial(_draw_fit, run.fit))],
    )


_NAMES: Final = {"measured": "补偿前", "bias removed": "去除常值误差", "two states": "双状态滤波"}


def _named(name: str) -> str:
    if name in _NAMES:
        return Both(name, _NAMES[name])
    return Both(name, name.replace("scalar", "标量").replace("average of", "滑动平均，点数"))


def _row(row: OnTurntable) -> list[str]:
    rates = (row.ramp_rms, row.hold_rms, row.late_rms, row.ramp_mean, row.hold_mean, row.lag, row.lag_theory)
    return [_named(row.name), *(f"{round(to_dps(value), 3) + 0.0:.3f}" for value in rates), f"{to_deg(row.angle):.2f}"]


def _turntable(run: Found) -> Report:
    tables = [
        TRACKBALL.table("turntable_0_to", [_row(row) for row in rows.values()], scale=100 * scale)
        for scale, rows in run.table.items()
    ]
    end = {name: abs(float(to_deg(error[SAMPLES - 1]))) for name, error in run.turned.headings.items()}
    behind = end["calibrated, paper's filter"]
    return TRACKBALL.part(
        "turntable",
        gain=run.gain[0],
        run_gain=to_dps(run.gain[1]),
        in_motion=IN_MOTION,
        behind=behind,
        calibrated=end["calibrated"],
        tables=tables,
        figures=[*turn_figures(run.turned), TRACKBALL.figure("lag_of_the", partial(_draw_lag, run.turned))],
    )


def _ball(run: Found) -> Report:
    tracks = run.lapped.tracks
    rows = []
    for name, shown in TRACKBALL.texts("tracks").items():
        off = to_deg(apart(tracks[name], tracks["true"]))
        rows.append([shown, *(f"{v:.1f}" for v in (np.sqrt(np.mean(off**2)), off.max(), off[-1]))])
    table = TRACKBALL.table("error_of_the", rows)
    return TRACKBALL.part(
        "ball",
        tables=[table],
        figures=[TRACKBALL.figure("track_of_the", partial(_draw_balls, run.lapped))],
        scenes=[_scene(run.lapped)],
    )


def _scene(lapped: Lapped) -> Scene:
    """The touching point on a ball of three circles: true, and, pale, by the paper's compensation and filter."""
    rows = slice(None, None, 2)
    t, true, paper = lapped.t[rows], lapped.tracks["true"][rows], lapped.tracks["paper"][rows]
    points = {"o": np.zeros((t.size, 3)), TRACKBALL.text("true_2"): true}
    lines = [("o", "true")]
    turn = deg(np.arange(0.0, 360.0, 30.0))
    flat = np.stack((np.cos(turn), np.sin(turn), np.zeros(turn.size)), axis=1)
    for k, columns in enumerate(((0, 1, 2), (0, 2, 1), (2, 0, 1))):  # the circles in the planes of the axes
        names = [f".{k}.{i}" for i in range(turn.size)]
        points |= {name: np.tile(at, (t.size, 1)) for name, at in zip(names, flat[:, columns], strict=True)}
        lines += list(zip(names, [*names[1:], names[0]], strict=True))
    return Scene(
        TRACKBALL.text("touching_point_on_the"),
        t,
        points,
        lines,
        trail="true",
        values={TRACKBALL.text("apart"): to_deg(apart(paper, true))},
        shadow={"o": points["o"], "true": paper},
    )


def _switched(run: Found) -> Report:
    table = TRACKBALL.table(
        "misprints",
        of={row.key: row for row in run.outcomes()},
        card=max(abs(to_dps(part.own)) for part in run.parts.values()),
        before=to_dps(misprints.gain_error()[0]),
        mean=to_dps(run.printed[2]),
    )
    return TRACKBALL.part("switched", tables=[table])


BLUE, RED, GREEN, PINK, AMBER, SKY, OLIVE = SERIES
BEFORE: Final = TRACKBALL.text("before_the_filter")
_TIME: Final = "time [s]"
_RATE: Final = TRACKBALL.text("rate_s")
_ERROR: Final = TRACKBALL.text("error_s")
_TAU: Final = TRACKBALL.text("averaging_time_s")
_VIEW: Final = np.array([0.55, 0.75, 0.36]) / np.linalg.norm([0.55, 0.75, 0.36])


def rest_figures(rest: Rest) -> list[Figure]:
    """Figures 1 and 2: the random sequence of x before and after the filter."""
    return [
        TRACKBALL.figure("figure_1", partial(_draw_series, rest.t, {BLUE: rest.before[:, 0]})),
        TRACKBALL.figure(
            "figure_2", partial(_draw_series, rest.t, {GREEN: rest.best[:, 0], RED: rest.after[:, 0]}), at_rest=AT_REST
        ),
    ]


def allan_figure(rest: Rest, short: Short) -> Figure:
    """Figure 3: deviations at the eight averaging times before and after, with intervals, and mean ratios."""
    key = [
        (BEFORE, BLUE, "solid"),
        (TRACKBALL.text("after_q_r", at_rest=AT_REST), RED, "dashed"),
        *((f"Q/R = {q:g}", colour, "solid") for q, colour in zip(RATIOS, _RATIO_COLOURS, strict=True)),
    ]
    return TRACKBALL.figure("figure_3", partial(_draw_allan, rest, short), lines=key)


_RATIO_COLOURS: Final = (SKY, AMBER, RED, PINK, OLIVE)


def turn_figures(turned: Turned) -> list[Figure]:
    """Figures 4 and 5: the rate while the table speeds up and while it holds, before and after compensation."""
    parts = {"figure_4": slice(0, SAMPLES), "figure_5": slice(SAMPLES, 2 * SAMPLES)}
    return [TRACKBALL.figure(key, partial(_draw_turn, turned, part)) for key, part in parts.items()]


def _draw_series(t: Floats, lines: Mapping[str, Floats], canvas: "FigureBase") -> None:
    ax = canvas.subplots()
    for colour, rate in lines.items():
        ax.plot(t, to_dps(rate), color=colour, linewidth=0.8)


def _draw_allan(rest: Rest, short: Short, canvas: "FigureBase") -> None:
    adev_ax, ratio_ax = canvas.subplots(1, 2)
    tau = np.array(TAUS)
    for curve, colour, dash in ((rest.compared.before, BLUE, "-"), (rest.compared.after, RED, "--")):
        dev = to_dps(curve.dev)
        bars = np.array([dev - to_dps(curve.lo), to_dps(curve.hi) - dev])
        adev_ax.errorbar(
            tau, dev, bars, color=colour, linestyle=dash, linewidth=1.1, marker="o", markersize=2.5, capsize=2
        )
    adev_ax.set_yscale("log")
    for ratio, colour, values in zip(RATIOS, _RATIO_COLOURS, short.adev, strict=True):
        ratio_ax.plot(tau, values, color=colour, linewidth=1.1, marker="o", markersize=2.5, label=f"{ratio:g}")
    ratio_ax.axhline(1.0, color=MUTED, linewidth=0.6)
    for ax in (adev_ax, ratio_ax):
        _over_tau(ax)
    _plain(adev_ax.yaxis)
    for time in TAUS:
        freedom = degrees_of_freedom(SAMPLES, time)
        adev_ax.annotate(f"{freedom:.0f}", (time, 0.03), xycoords=("data", "axes fraction"), ha="center", color=MUTED)
    adev_ax.annotate(TRACKBALL.text("degrees_of_freedom"), (0.02, 0.1), xycoords="axes fraction", color=MUTED)


def _over_tau(ax: "Axes") -> None:
    ax.set_xscale("log")
    ax.set_xlim(0.08, 65.0)
    ax.set_xlabel(_TAU)
    _plain(ax.xaxis)


def _plain(axis: "Axis") -> None:
    """Plain numbers on a logarithmic axis."""
    axis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.set_minor_formatter(lambda value, _: "")


def _draw_fit(fit: PowerFits, canvas: "FigureBase") -> None:
    ax = canvas.subplots()
    grid = np.geomspace(0.08, 65.0, 400)
    columns = powers(grid)
    ax.plot(TAUS, to_dps(to_dps(fit.measured)), color=INK, linestyle="none", marker="o", markersize=3.5, zorder=3)
    for coefficients, colour in ((fit.plain, RED), (fit.weighted, GREEN)):
        total = to_dps(to_dps(columns @ coefficients))
        ax.plot(grid, np.where(total > 0.0, total, np.nan), color=colour, linewidth=1.2)
    letters = sorted(TERMS, key=lambda letter: TERMS[letter].power)
    for letter, column, value in zip(letters, columns.T, fit.weighted, strict=True):
        if value > 0.0:
            ax.plot(grid, to_dps(to_dps(column * value)), color=MUTED, linewidth=0.7, linestyle="--")
            end = to_dps(to_dps(value * column[-1]))
            if end > 1e-6:
                ax.annotate(letter, (grid[-1], end), xytext=(3, 0), textcoords="offset points", color=MUTED)
    _over_tau(ax)
    ax.set_yscale("log")
    _plain(ax.yaxis)


def _draw_turn(turned: Turned, part: slice, canvas: "FigureBase") -> None:
    rate_ax, error_ax = canvas.subplots(1, 2)
    t, true = turned.t[part], turned.true[part]
    lines = ((turned.raw, MUTED), (turned.rates["paper"], RED), (turned.rates["best"], GREEN))
    for rate, colour in lines:
        rate_ax.plot(t, to_dps(rate[part]), color=colour, linewidth=0.9)
    rate_ax.plot(t, to_dps(true), color=INK, linewidth=0.9, linestyle="--")
    rate_ax.set_ylabel(_RATE)
    for rate, colour in lines[1:]:
        error_ax.plot(t, to_dps(rate[part] - true), color=colour, linewidth=0.8)
    error_ax.axhline(0.0, color=MUTED, linewidth=0.5)
    error_ax.set_ylim(-0.75, 0.35)
    error_ax.set_ylabel(_ERROR)
    for ax in (rate_ax, error_ax):
        ax.set_xlim(t[0], np.ceil(t[-1]))
        ax.set_xlabel(_TIME)


def _draw_lag(turned: Turned, canvas: "FigureBase") -> None:
    error_ax, heading_ax = canvas.subplots(1, 2)
    for name, colour in (("calibrated", BLUE), ("calibrated, paper's filter", RED), ("best", GREEN)):
        error = to_dps(turned.rates[name] - turned.true)
        smooth = np.convolve(error, np.ones(10) / 10.0, "same")
        error_ax.plot(turned.t, smooth, color=colour, linewidth=0.9)
        heading_ax.plot(turned.t, to_deg(turned.headings[name]), color=colour, linewidth=1.2)
    for ax in (error_ax, heading_ax):
        ax.axvline(SAMPLES * STEP, color=MUTED, linewidth=0.6, linestyle=":")


def _draw_balls(lapped: Lapped, canvas: "FigureBase") -> None:
    panels = zip(canvas.subplots(1, 4), TRACKBALL.texts("balls").items(), (BLUE, OLIVE, RED, GREEN), strict=True)
    for ax, (name, title), colour in panels:
        _draw_ball(ax, lapped.tracks[name], colour)
        ax.set_title(title, fontsize=7.0)


def _draw_ball(ax: "Axes", points: Floats, colour: str) -> None:
    """Ball with the circles about its x axis, and a track on it: near side over far side."""
    right = np.cross([0.0, 0.0, -1.0], _VIEW)
    right /= np.linalg.norm(right)
    up = np.cross(_VIEW, right)
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    ax.plot(np.cos(turn), np.sin(turn), color=MUTED, linewidth=0.8)
    for x in np.sin(deg(np.array([-60.0, -30.0, 0.0, 30.0, 60.0]))):
        r = np.sqrt(1.0 - x * x)
        circle = np.stack((np.full(turn.size, x), r * np.cos(turn), r * np.sin(turn)), axis=1)
        near = circle @ _VIEW > 0.0
        ax.plot(np.where(near, circle @ right, np.nan), np.where(near, circle @ up, np.nan), color=GRID, linewidth=0.6)
    fine = _between(points)
    near = fine @ _VIEW > 0.0
    for which, ink, width in ((~near, SOFT, 0.5), (near, colour, 0.9)):
        ax.plot(np.where(which, fine @ right, np.nan), np.where(which, fine @ up, np.nan), color=ink, linewidth=width)
    ax.set_aspect("equal")
    ax.set_axis_off()
    ax.set_xlim(-1.05, 1.05)
    ax.set_ylim(-1.05, 1.05)


def _between(points: Floats) -> Floats:
    """Points of the unit ball with three more between each two, (4N − 3, 3)."""
    at = np.arange(0.0, len(points) - 0.999, 0.25)
    wide = np.stack([np.interp(at, np.arange(len(points)), column) for column in points.T], axis=1)
    return np.asarray(wide / np.linalg.norm(wide, axis=1, keepdims=True))
