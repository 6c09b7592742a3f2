"""Page of the trackball paper: its parts in the paper's order, with tables, remarks and figures."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.units import deg, from_si, to_deg, to_dps
from plumbob.filters.channel_scalar import steady_gain
from plumbob.papers.description import TRACKBALL
from plumbob.papers.trackball import figures, misprints
from plumbob.papers.trackball.recorded import Lapped, apart
from plumbob.papers.trackball.records import AT_REST, IN_MOTION, RATIOS, SAMPLES, STEP
from plumbob.papers.trackball.results import Found
from plumbob.papers.trackball.seeds import LONG, LONG_TAUS, TAUS, OnTurntable, degrees_of_freedom, theory
from plumbob.reporting.content import Table
from plumbob.reporting.report import Report
from plumbob.reporting.scene import Scene
from plumbob.reporting.style import Both

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
    parts = [
        _drift(found),
        _rest(found),
        _allan(found),
        _composition(found),
        _turntable(found),
        _ball(found),
        _switched(found),
    ]
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
    return TRACKBALL.part("rest", constant=constant, tables=[table], figures=figures.rest_figures(run.rest))


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
        figures=[figures.allan_figure(run.rest, run.short)],
    )


_TERMS: Final = tuple(TRACKBALL.texts("terms").values())


def _composition(run: Found) -> Report:
    scale = to_dps(to_dps(1.0))
    rows = [
        [name, f"{plain * scale:.2e}", f"{weighted * scale:.2e}"]
        for name, plain, weighted in zip(_TERMS, run.fit.plain, run.fit.weighted, strict=True)
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
        figures=[figures.fit_figure(run.fit)],
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
        figures=[*figures.turn_figures(run.turned), figures.lag_figure(run.turned)],
    )


_TRACKS: Final = TRACKBALL.texts("tracks")


def _ball(run: Found) -> Report:
    tracks = run.lapped.tracks
    rows = []
    for name, shown in _TRACKS.items():
        off = to_deg(apart(tracks[name], tracks["true"]))
        rows.append([shown, *(f"{v:.1f}" for v in (np.sqrt(np.mean(off**2)), off.max(), off[-1]))])
    table = TRACKBALL.table("error_of_the", rows)
    return TRACKBALL.part(
        "ball", tables=[table], figures=[figures.ball_figure(run.lapped)], scenes=[_scene(run.lapped)]
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
