"""Page of the trackball paper: its parts in the paper's order, each with its outcomes, tables and figures."""

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.units import deg, from_si, to_deg, to_dps
from plumbob.filters.channel_scalar import steady_gain
from plumbob.noise.terms import TERMS
from plumbob.papers.description import TRACKBALL
from plumbob.papers.outcome import Outcome, Paper, Part
from plumbob.papers.trackball import misprints, seeds
from plumbob.papers.trackball.recorded import Lapped, Rest, Soaked, Turned, apart
from plumbob.papers.trackball.seeds import (
    AT_REST,
    IN_MOTION,
    LONG_TAUS,
    RATIOS,
    SAMPLES,
    STEP,
    TAUS,
    OnTurntable,
    PowerFits,
    degrees_of_freedom,
    operations,
    theory,
)
from plumbob.reporting.content import GRID, INK, MUTED, SERIES, SOFT, Both, Scene, Table
from plumbob.reporting.report import Report

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import FigureBase

BLUE, RED, GREEN, PINK, AMBER, SKY, OLIVE = SERIES
_RATIO_COLOURS: Final = (SKY, AMBER, RED, PINK, OLIVE)
_VIEW: Final = np.array([0.55, 0.75, 0.36]) / np.linalg.norm([0.55, 0.75, 0.36])
_NAMES: Final = {"measured": "补偿前", "bias removed": "去除常值误差", "two states": "双状态滤波"}


class Found(NamedTuple):
    """Results of all parts, in the order of the paper.

    `seeds`: how many runs each statistic is of; `parts`: by a part's true coefficient of temperature, °/s per °C;
    `soaked`, `rest`, `turned`, `lapped`: the recorded tests; `short`, `white`, `long`: at rest, over many seeds,
    `white` (k,) by Q/R; `fit`: of the recorded test at rest, before the filter; `negative`: shares of the records with
    a negative coefficient, by the plain and by the weighted fit; `table`: by the error of the gain, and by filter;
    `gain`: best gain of a scalar filter on the ramp, and its rms, rad/s; `printed`, `matrix`: of `misprints`.
    """

    seeds: Mapping[str, int]
    parts: Mapping[float, misprints.Warmed]
    soaked: Soaked
    rest: Rest
    short: seeds.Short
    white: Floats
    long: seeds.Long
    fit: PowerFits
    negative: tuple[float, float]
    turned: Turned
    table: Mapping[float, Mapping[str, OnTurntable]]
    gain: tuple[float, float]
    lapped: Lapped
    printed: misprints.PrintedAllan
    matrix: tuple[float, float]


def paper(run: Found, seed: int) -> Paper:
    """The whole page and every figure, of what was computed; `seed` is that of the recorded runs."""
    parts = [part(run) for part in (_drift, _rest, _allan, _composition, _turntable, _ball)]
    outcomes = [row for _, rows in parts for row in rows]
    outcomes += TRACKBALL.rows({"filter.operations": float(operations())})
    reports = [*(report for report, _ in parts), _switched(run, outcomes)]
    return Paper(report=TRACKBALL.part("page", seed=seed, parts=reports, **run.seeds), outcomes=outcomes)


def _signed(value: float, form: str) -> str:
    """A number with a minus as it is printed."""
    return f"{value:{form}}".replace("-", "−")


def _short(ratio: float) -> str:
    """Q/R of 1e-3 as q3, for keys."""
    return f"q{-round(math.log10(ratio))}"


def _drift(run: Found) -> Part:
    outcomes = TRACKBALL.rows({"drift.k_t": (0.1, to_dps(run.parts[0.03].coefficient))})
    for name, part in (("a", 0.03), ("b", -0.05)):
        at = run.parts[part]
        outcomes += TRACKBALL.rows(
            {f"drift.raw.{name}": to_dps(at.raw), f"drift.left.{name}": (to_dps(at.printed), to_dps(abs(at.own)))}
        )
    before, after = misprints.gain_error()
    outcomes += TRACKBALL.rows(
        {
            "drift.scale": 1.0 / to_dps(run.rest.quantum),
            "drift.k_a": (to_dps(run.matrix[0]), to_dps(run.matrix[1])),
            "drift.twice": (to_dps(misprints.counted_twice()), 0.0),
            "drift.metres": (to_dps(misprints.in_metres()), 0.0),
        }
    )
    held = abs(float(np.mean(to_dps(run.turned.rates["best"] - run.turned.true)[SAMPLES:])))
    bar = (to_dps(before) - 0.01, to_dps(before) + 0.01)
    outcomes.append(TRACKBALL.row("drift.gain", faithful=to_dps(after), best=held, faithful_bar=bar))
    rows = [
        [
            _signed(part, "+.2f"),
            *(f"{to_dps(value):.3f}" for value in (warmed.raw, warmed.printed, warmed.own)),
            f"{to_dps(warmed.coefficient):+.4f}",
        ]
        for part, warmed in run.parts.items()
    ]
    ways = [TRACKBALL.text(name) for name in ("measured_2", "3_0_1_for", "own_card_of_this")]
    soaks = [[way, *(f"{value:.3f}" for value in to_dps(change))] for way, change in zip(ways, run.soaked, strict=True)]
    tables = [TRACKBALL.table("mean_rate_at", rows), TRACKBALL.table("recorded_soak_of", soaks)]
    return TRACKBALL.part("drift", tables=tables), outcomes


def _rest(run: Found) -> Part:
    """What the test is, and Figures 1 and 2: the random sequence of x before and after the filter."""
    rest = run.rest
    before, after, best = (to_dps(float(part[:, 0].std())) for part in (rest.before, rest.after, rest.best))
    outcomes = TRACKBALL.rows(
        {
            "rest.step": float(np.median(np.diff(rest.t))),
            "rest.samples": float(rest.t.size),
            "rest.temperature": rest.temp_c,
            "filter.start": float(rest.after[0, 0] / rest.before[0, 0]),
            "filter.gain": steady_gain(AT_REST),
            "rest.before": before,
            "rest.after": (after, best),
            **{f"rest.variance.{_short(q)}": value / theory(q) for q, value in zip(RATIOS, run.white, strict=True)},
        },
        at_rest=AT_REST,
    )
    rows = [
        [f"{q:g}", f"{steady_gain(q):.4f}", f"{theory(q):.5f}", f"{white:.5f}", f"{variance:.5f}", f"{angle:.2f}"]
        for q, white, variance, angle in zip(RATIOS, run.white, run.short.variance, run.short.angle, strict=True)
    ]

    def draw(lines: Mapping[str, Floats], canvas: "FigureBase") -> None:
        ax = canvas.subplots()
        for colour, rate in lines.items():
            ax.plot(rest.t, to_dps(rate[:, 0]), color=colour, linewidth=0.8)

    figures = [
        TRACKBALL.figure("figure_1", partial(draw, {BLUE: rest.before})),
        TRACKBALL.figure("figure_2", partial(draw, {GREEN: rest.best, RED: rest.after}), at_rest=AT_REST),
    ]
    constant = ", ".join(_signed(value, ".2f") for value in to_dps(rest.raw.mean(axis=0)))
    table = TRACKBALL.table("at_rest_samples", rows, samples=SAMPLES)
    return TRACKBALL.part("rest", constant=constant, tables=[table], figures=figures), outcomes


def _allan(run: Found) -> Part:
    """Figure 3: deviations at the eight averaging times before and after, with intervals, and mean ratios."""
    row, short, long = RATIOS.index(AT_REST), run.short, run.long
    outcomes = TRACKBALL.rows(
        {
            **{f"allan.ratio.{tau:g}": value for tau, value in zip(TAUS, short.adev[row].tolist(), strict=True)},
            **{f"allan.scatter.{tau:g}": float(short.scatter[TAUS.index(tau)]) for tau in (10.0, 50.0)},
            "allan.freedom": degrees_of_freedom(SAMPLES, 50.0),
            **{f"allan.long.{tau:g}": float(long.adev[row, LONG_TAUS.index(tau)]) for tau in (100.0, 600.0)},
            "allan.angle": float(short.angle[row]),
            "allan.printed": (to_dps(run.printed.printed), to_dps(run.printed.corrected)),
        },
        at_rest=AT_REST,
    )

    def table(title: str, taus: Sequence[float], count: int, before: Floats, ratios: Floats) -> Table:
        rows = [
            [
                TRACKBALL.text("degrees_of_freedom_white"),
                *(f"{degrees_of_freedom(count, tau):.1f}" for tau in taus),
            ],
            [TRACKBALL.text("before_s"), *(f"{to_dps(value):.4f}" for value in before.tolist())],
            *([f"Q/R = {q:g}", *(f"{value:.3f}" for value in row)] for q, row in zip(RATIOS, ratios, strict=True)),
        ]
        return Table(TRACKBALL.text(title), ("τ [s]", *(f"{tau:g}" for tau in taus)), rows)

    key = [
        (TRACKBALL.text("before_the_filter"), BLUE, "solid"),
        (TRACKBALL.text("after_q_r", at_rest=AT_REST), RED, "dashed"),
        *((f"Q/R = {q:g}", colour, "solid") for q, colour in zip(RATIOS, _RATIO_COLOURS, strict=True)),
    ]
    report = TRACKBALL.part(
        "allan",
        at_rest=AT_REST,
        adev=100 * long.adev[2, 3],
        scatter=short.scatter[-1],
        tables=[
            table("allan_deviation_after_before", TAUS, SAMPLES, short.before, short.adev),
            table("4_h_at_rest", LONG_TAUS, round(seeds.LONG / STEP), long.before, long.adev),
        ],
        figures=[TRACKBALL.figure("figure_3", partial(_draw_allan, run.rest, short), lines=key)],
    )
    return report, outcomes


def _draw_allan(rest: Rest, short: seeds.Short, canvas: "FigureBase") -> None:
    adev_ax, ratio_ax = canvas.subplots(1, 2)
    tau = np.array(TAUS)
    how = {"linewidth": 1.1, "marker": "o", "markersize": 2.5}
    for curve, colour, dash in ((rest.compared.before, BLUE, "-"), (rest.compared.after, RED, "--")):
        dev = to_dps(curve.dev)
        bars = np.array([dev - to_dps(curve.lo), to_dps(curve.hi) - dev])
        adev_ax.errorbar(tau, dev, bars, color=colour, linestyle=dash, capsize=2, **how)
    adev_ax.set_yscale("log")
    for ratio, colour, values in zip(RATIOS, _RATIO_COLOURS, short.adev, strict=True):
        ratio_ax.plot(tau, values, color=colour, label=f"{ratio:g}", **how)
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
    ax.set_xlabel(TRACKBALL.text("averaging_time_s"))
    _plain(ax.xaxis)


def _plain(axis: "Axis") -> None:
    """Plain numbers on a logarithmic axis."""
    axis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.set_minor_formatter(lambda value, _: "")


def _composition(run: Found) -> Part:
    white, flicker = from_si(run.long.white, "deg/rth"), from_si(run.long.flicker, "deg/h")
    negative = (100.0 * run.negative[0], 100.0 * run.negative[1])
    outcomes = TRACKBALL.rows(
        {
            "fit.condition": float(np.linalg.cond(seeds.powers())),
            "fit.negative": negative,
            "noise.white": (None, white),
            "noise.flicker": (None, flicker),
        }
    )
    scale, names = to_dps(to_dps(1.0)), TRACKBALL.texts("terms").values()
    rows = [
        [name, f"{plain * scale:.2e}", f"{weighted * scale:.2e}"]
        for name, plain, weighted in zip(names, run.fit.plain, run.fit.weighted, strict=True)
    ]
    report = TRACKBALL.part(
        "composition",
        white=white,
        flicker=flicker,
        negative=negative[0],
        short=run.seeds["short"],
        run_negative=negative[1],
        tables=[TRACKBALL.table("coefficients_of_14", rows)],
        figures=[TRACKBALL.figure("14_fits_of", partial(_draw_fit, run.fit))],
    )
    return report, outcomes


def _draw_fit(fit: PowerFits, canvas: "FigureBase") -> None:
    ax, scale = canvas.subplots(), to_dps(to_dps(1.0))
    grid = np.geomspace(0.08, 65.0, 400)
    columns = scale * seeds.powers(grid)
    ax.plot(TAUS, scale * fit.measured, color=INK, linestyle="none", marker="o", markersize=3.5, zorder=3)
    for coefficients, colour in ((fit.plain, RED), (fit.weighted, GREEN)):
        total = columns @ coefficients
        ax.plot(grid, np.where(total > 0.0, total, np.nan), color=colour, linewidth=1.2)
    letters = sorted(TERMS, key=lambda letter: TERMS[letter].power)
    for letter, column, value in zip(letters, columns.T, fit.weighted, strict=True):
        if value > 0.0:
            ax.plot(grid, column * value, color=MUTED, linewidth=0.7, linestyle="--")
            if (end := value * column[-1]) > 1e-6:
                ax.annotate(letter, (grid[-1], end), xytext=(3, 0), textcoords="offset points", color=MUTED)
    _over_tau(ax)
    ax.set_yscale("log")
    _plain(ax.yaxis)


def _turntable(run: Found) -> Part:
    """The table over many seeds, and the recorded one: flicker noise alone moves its rms by a tenth from run to run."""
    rows, wrong = run.table.values()
    turned, name = run.turned, f"scalar Q/R={IN_MOTION:g}"
    scalar, two, removed = rows[name], rows["two states"], rows[seeds.REMOVED]
    plane, along = misprints.axis_in_the_plane(1)
    errors = {way: to_dps(turned.rates[way] - turned.true) for way in ("paper", "best")}
    ends = {way: abs(float(to_deg(error[SAMPLES - 1]))) for way, error in turned.headings.items()}
    settled = [q for q in RATIOS if seeds.MEMORIES / steady_gain(q) <= seeds.SETTLED]  # on this ramp
    outcomes = TRACKBALL.rows(
        {
            "turn.slope": float(np.polyfit(turned.t[:SAMPLES], to_dps(turned.true[:SAMPLES]), 1)[0]),
            "turn.rate": float(to_dps(turned.true[-1])) / 6.0,
            "turn.samples": float(turned.true.size) / 2.0,
            "turn.axis": (plane, along),
            "ramp.removed": to_dps(removed.ramp_rms),
            "ramp.rms": (to_dps(scalar.ramp_rms), to_dps(two.ramp_rms)),
            "ramp.mean": (to_dps(scalar.ramp_mean), to_dps(two.ramp_mean)),
            "hold.rms": (to_dps(scalar.hold_rms), to_dps(two.hold_rms)),
            "hold.late": (to_dps(scalar.late_rms), to_dps(two.late_rms)),
            "hold.mean": (to_dps(scalar.hold_mean), to_dps(two.hold_mean)),
            **{f"ramp.lag.{_short(q)}": to_dps(rows[f"scalar Q/R={q:g}"].lag) for q in settled},
            "ramp.lag": (None, to_dps(two.lag)),
            "ramp.angle": (to_deg(scalar.angle), to_deg(two.angle)),
            "ramp.gain": to_dps(run.gain[1]),
            "ramp.misled": to_dps(wrong[name].ramp_rms),
            "bytes.ramp": (_rms(errors["paper"][:SAMPLES]), _rms(errors["best"][:SAMPLES])),
            "bytes.hold": (_rms(errors["paper"][SAMPLES:]), _rms(errors["best"][SAMPLES:])),
            "bytes.heading": (ends["calibrated, paper's filter"], ends["calibrated"]),
        },
        in_motion=IN_MOTION,
        ramp_rms=to_dps(rows[seeds.MEASURED].ramp_rms),
        removed_ramp_rms=to_dps(removed.ramp_rms),
    )
    parts = {"figure_4": slice(0, SAMPLES), "figure_5": slice(SAMPLES, 2 * SAMPLES)}
    report = TRACKBALL.part(
        "turntable",
        gain=run.gain[0],
        run_gain=to_dps(run.gain[1]),
        in_motion=IN_MOTION,
        behind=ends["calibrated, paper's filter"],
        calibrated=ends["calibrated"],
        tables=[
            TRACKBALL.table("turntable_0_to", [_row(row) for row in by.values()], scale=100 * scale)
            for scale, by in run.table.items()
        ],
        figures=[
            *(TRACKBALL.figure(key, partial(_draw_turn, turned, part)) for key, part in parts.items()),
            TRACKBALL.figure("lag_of_the", partial(_draw_lag, turned)),
        ],
    )
    return report, outcomes


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _row(row: OnTurntable) -> list[str]:
    rates = (row.ramp_rms, row.hold_rms, row.late_rms, row.ramp_mean, row.hold_mean, row.lag, row.lag_theory)
    zh = _NAMES.get(row.name, row.name.replace("scalar", "标量").replace("average of", "滑动平均，点数"))
    cells = [f"{round(to_dps(value), 3) + 0.0:.3f}" for value in rates]
    return [Both(row.name, zh), *cells, f"{to_deg(row.angle):.2f}"]


def _draw_turn(turned: Turned, part: slice, canvas: "FigureBase") -> None:
    """Rate while the table speeds up, or holds, before and after compensation, and what is wrong with it."""
    rate_ax, error_ax = canvas.subplots(1, 2)
    t, true = turned.t[part], turned.true[part]
    lines = ((turned.raw, MUTED), (turned.rates["paper"], RED), (turned.rates["best"], GREEN))
    for rate, colour in lines:
        rate_ax.plot(t, to_dps(rate[part]), color=colour, linewidth=0.9)
    rate_ax.plot(t, to_dps(true), color=INK, linewidth=0.9, linestyle="--")
    rate_ax.set_ylabel(TRACKBALL.text("rate_s"))
    for rate, colour in lines[1:]:
        error_ax.plot(t, to_dps(rate[part] - true), color=colour, linewidth=0.8)
    error_ax.axhline(0.0, color=MUTED, linewidth=0.5)
    error_ax.set_ylim(-0.75, 0.35)
    error_ax.set_ylabel(TRACKBALL.text("error_s"))
    for ax in (rate_ax, error_ax):
        ax.set_xlim(t[0], np.ceil(t[-1]))
        ax.set_xlabel("time [s]")


def _draw_lag(turned: Turned, canvas: "FigureBase") -> None:
    error_ax, heading_ax = canvas.subplots(1, 2)
    for name, colour in (("calibrated", BLUE), ("calibrated, paper's filter", RED), ("best", GREEN)):
        smooth = np.convolve(to_dps(turned.rates[name] - turned.true), np.ones(10) / 10.0, "same")
        error_ax.plot(turned.t, smooth, color=colour, linewidth=0.9)
        heading_ax.plot(turned.t, to_deg(turned.headings[name]), color=colour, linewidth=1.2)
    for ax in (error_ax, heading_ax):
        ax.axvline(SAMPLES * STEP, color=MUTED, linewidth=0.6, linestyle=":")


def _ball(run: Found) -> Part:
    tracks = run.lapped.tracks
    away = {name: apart(track, tracks["true"]) for name, track in tracks.items()}
    outcomes = TRACKBALL.rows({"ball.track": (to_deg(_rms(away["paper"])), to_deg(_rms(away["calibrated"])))})
    off = {name: to_deg(angles) for name, angles in away.items()}
    rows = [
        [shown, *(f"{v:.1f}" for v in (_rms(off[name]), off[name].max(), off[name][-1]))]
        for name, shown in TRACKBALL.texts("tracks").items()
    ]

    def draw(canvas: "FigureBase") -> None:
        panels = zip(canvas.subplots(1, 4), TRACKBALL.texts("balls").items(), (BLUE, OLIVE, RED, GREEN), strict=True)
        for ax, (name, title), colour in panels:
            _draw_ball(ax, tracks[name], colour)
            ax.set_title(title, fontsize=7.0)

    report = TRACKBALL.part(
        "ball",
        tables=[TRACKBALL.table("error_of_the", rows)],
        figures=[TRACKBALL.figure("track_of_the", draw)],
        scenes=[_scene(run.lapped)],
    )
    return report, outcomes


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


def _draw_ball(ax: "Axes", points: Floats, colour: str) -> None:
    """Ball with the circles about its x axis, and a track on it: near side over far side."""
    right = np.cross([0.0, 0.0, -1.0], _VIEW)
    right /= np.linalg.norm(right)
    up = np.cross(_VIEW, right)

    def line(at: Floats, mask: NDArray[np.bool_], ink: str, width: float) -> None:
        ax.plot(np.where(mask, at @ right, np.nan), np.where(mask, at @ up, np.nan), color=ink, linewidth=width)

    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    ax.plot(np.cos(turn), np.sin(turn), color=MUTED, linewidth=0.8)
    for x in np.sin(deg(np.array([-60.0, -30.0, 0.0, 30.0, 60.0]))):
        r = np.sqrt(1.0 - x * x)
        circle = np.stack((np.full(turn.size, x), r * np.cos(turn), r * np.sin(turn)), axis=1)
        line(circle, circle @ _VIEW > 0.0, GRID, 0.6)
    at = np.arange(0.0, len(points) - 0.999, 0.25)  # three more points between each two, for the ball is round
    wide = np.stack([np.interp(at, np.arange(len(points)), column) for column in points.T], axis=1)
    fine = np.asarray(wide / np.linalg.norm(wide, axis=1, keepdims=True))
    near = fine @ _VIEW > 0.0
    line(fine, ~near, SOFT, 0.5)
    line(fine, near, colour, 0.9)
    ax.set_aspect("equal")
    ax.set_axis_off()
    ax.set_xlim(-1.05, 1.05)
    ax.set_ylim(-1.05, 1.05)


def _switched(run: Found, outcomes: Sequence[Outcome]) -> Report:
    table = TRACKBALL.table(
        "misprints",
        of={row.key: row for row in outcomes},
        card=max(abs(to_dps(part.own)) for part in run.parts.values()),
        before=to_dps(misprints.gain_error()[0]),
        mean=to_dps(run.printed[2]),
    )
    return TRACKBALL.part("switched", tables=[table])
