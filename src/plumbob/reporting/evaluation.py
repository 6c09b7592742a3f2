"""Descriptions of evaluations and comparisons; degrees and seconds, units in every name."""

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Any, Final

import numpy as np

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.errors import ShapeError
from plumbob.core.findings import Note, info
from plumbob.core.text import counted
from plumbob.core.time import GAP_FACTOR
from plumbob.core.units import to_deg, to_dps
from plumbob.data import AttitudeTrack
from plumbob.data.sample import UNITS
from plumbob.evaluation.align import Fate
from plumbob.evaluation.compare import Comparison, TriadDifference
from plumbob.evaluation.evaluation import Evaluation, sample_counts
from plumbob.evaluation.metrics import CONFIDENCE, DOF, NEEDS_HEADING, QUANTITIES, Stats
from plumbob.reporting.content import SERIES, SHADE, SOFT, Figure, Table
from plumbob.reporting.drawing import PlotLine, PlotPanel, draw_panels, runs
from plumbob.reporting.report import Report
from plumbob.rotations import IDENTITY, North, euler_zyx_from_quat, quat_angle

ESTIMATE, REFERENCE = SERIES[0], SOFT
COLOUR: Final = dict(zip(("total", "heading", "inclination"), SERIES, strict=False))
_DASHES = ("solid", "dashed", "dotted")
_QUANTILES = np.linspace(0.0, 100.0, 401)
_COLUMNS = 800
_ALL_COLUMNS = 3200  # shared by the evaluations of a page, so that many of them still make a small file
_HEAD = ("", "rmse", "mean", "std", "max", "at [s]", "50 %", "95 %", "99 %")


def evaluation(e: Evaluation, *, facts: Sequence[tuple[str, str]] = ()) -> Report:
    """Error of an estimate; `facts` say more of where it comes from."""
    return Report(
        "Attitude error, estimate against reference",
        facts=[*facts, *_facts(e)],
        tables=_tables(e),
        remarks=_remarks(e),
        figures=partial(_figures, e, _COLUMNS),
        definitions=[info("page.errors")],
    )


def comparison(c: Comparison) -> Report:
    """How two recordings, or two attitudes, differ."""
    facts = [*c.facts().items()]
    if c.within is not None:
        facts.append(("tolerance", "kept" if c.within else "exceeded"))
    tables = [Table("Counts", ("", "a", "b"), c.counts)] if c.counts else []
    if c.evaluation is not None:
        parts = (evaluation(c.evaluation),)
        return Report("Comparison of attitudes", facts=facts, tables=tables, remarks=c.remarks, parts=parts)
    if (clock := c.clock) is not None:
        facts.append(("time offset", f"{1e3 * clock.offset:+.4g} ± {1e3 * clock.offset_sd:.2g} ms added to b's stamps"))
        facts.append(("drift", f"{1e6 * clock.drift:+.4g} ± {1e6 * clock.drift_sd:.2g} ppm"))
    if c.mounting is not None:
        angles, sd = ", ".join(f"{angle:+.3f}°" for angle in c.angles()), float(to_deg(c.mounting.sd.max()))
        facts.append(("mounting", f"yaw, pitch, roll of b's axes in a's: {angles}; ± {sd:.2g}°"))
    if c.triads:
        tables.append(_triad_table(c.triads))
    return Report("Comparison of recordings", facts=facts, tables=tables, remarks=c.remarks)


def _triad_table(triads: Mapping[str, TriadDifference]) -> Table:
    head = ("", "Unit", "Bias b − a", "Scale b / a", "RMS", "RMS, relative", "Residual", "Coherent to",
            "Spectrum b / a")  # fmt: skip
    rows = []
    for name, triad in triads.items():
        band = "-" if triad.bandwidth is None else f"{triad.bandwidth:.3g} Hz"
        ratio = "-" if triad.ratio_db is None else f"{triad.ratio_db:+.2f} dB"
        rows.append((name, UNITS[name], _three(triad.bias), _three(triad.scale, 6), f"{triad.rms:.4g}",
                     f"{100.0 * triad.relative:.3g} %", f"{triad.residual:.4g}", band, ratio))  # fmt: skip
    return Table("Difference of each triad, after alignment", head, rows, words=(1, 2, 3))


def _three(values: Floats, digits: int = 3) -> str:
    return " ".join("-" if not np.isfinite(value) else f"{value:.{digits}g}" for value in values)


def side_by_side(
    evaluations: Mapping[str, Evaluation], *, title: str = "Attitude errors", facts: Sequence[tuple[str, str]] = ()
) -> Report:
    """Evaluations beside each other, by the name of each, such as the filter's, and a part for each."""
    if not evaluations:
        raise ShapeError("a report needs at least one evaluation, but evaluations is empty.")
    columns = max(200, min(_COLUMNS, _ALL_COLUMNS // len(evaluations)))
    differing = _differences(list(evaluations.values()))
    return Report(
        title,
        facts=facts,
        tables=[_comparison_table(evaluations)],
        remarks=[f"Not directly comparable: the rows differ in {differing}."] if differing else [],
        figures=[comparison_figure(evaluations)],
        parts=[
            Report(name, _facts(e), _tables(e), _remarks(e), partial(_figures, e, columns))
            for name, e in evaluations.items()
        ],
        definitions=[info("page.errors")],
    )


def _facts(e: Evaluation) -> list[tuple[str, str]]:
    """What was compared, and how."""
    s = e.settings
    facts = [(name, _describe_track(track)) for name, track in (("estimate", e.estimate), ("reference", e.reference))]
    samples = sample_counts(e)
    span = f"{samples['first_s']:.3f} to {samples['last_s']:.3f} s"
    scored = (
        f"{samples['scored']} of {samples['estimate']} samples, {span}; {samples['exact']} at stamps of the "
        f"reference, {samples['interpolated']} interpolated (steps up to {1e3 * e.match.max_gap:.4g} ms)"
    )
    facts.append(("scored", scored))
    facts += [("left out", f"{n} {why}") for why, n in _left_out(e).items()]
    facts += [("aligned", line) for line in _describe_alignment(e)] or [("aligned", "nothing")]
    if "time" in s.align:
        facts.append(("searched", f"time offsets of ±{s.max_offset:g} s"))
    if s.settle:
        facts.append(("settling", f"{s.settle:g} s left out at the start"))
    if s.declination is not None:
        facts.append(("declination", f"{to_deg(s.declination):+.3f}° (east positive)"))
    if e.reference_rate is not None:
        facts.append(("motion", f"the reference turned at {to_dps(e.reference_rate):.3g} °/s rms"))
    if e.estimate.cov_b is not None:
        facts.append(("covariance", _describe_consistency(e)))
    return facts + [("flagged", f"{counted(n, 'scored sample')}: {name}") for name, n in e.flag_counts().items()]


def _tables(e: Evaluation) -> list[Table]:
    rows = [[name, *_cells(e.stats.get(name))] for name in QUANTITIES]
    _, params, _ = _source_parts(e.estimate)
    listed = [tuple(param.split("=", 1)) for param in params.split(", ") if "=" in param]
    scored, meaning = int(e.match.scored.sum()), dict(flags.MEANING.values())
    samples = [("scored", str(scored), _share(scored, e.t.size), "")]
    samples += [("left out", str(n), _share(n, e.t.size), why) for why, n in _left_out(e).items()]
    samples += [(name, str(n), _share(n, scored), meaning[name]) for name, n in e.flag_counts().items()]
    return [
        Table("Errors of the scored samples [°]", _HEAD, rows, strong=[(i, 1) for i in range(len(rows))]),
        Table("Samples", ["", "samples", "share", "meaning"], samples, words=(3,), detail="samples"),
        *([Table("Parameters", ["", "value"], listed, words=(1,), detail="parameters")] if listed else []),
    ]


def _cells(s: Stats | None) -> list[str]:
    if s is None:
        return ["not scored", *[""] * (len(_HEAD) - 2)]
    angles = [degrees(a) for a in (s.rmse, s.mean, s.std, s.max_abs, s.p50, s.p95, s.p99)]
    return [*angles[:4], f"{s.max_at:.2f}", *angles[4:]]


def _share(n: int, of: int) -> str:
    percent = 100.0 * n / of
    return f"{percent:.1f} %" if percent >= 0.1 or not n else "< 0.1 %"


def _remarks(e: Evaluation) -> list[Note]:
    reasons = [
        info("page.not_scored", what=[name for name, why in e.not_scored.items() if why == reason], reason=reason)
        for reason in dict.fromkeys(e.not_scored.values())
    ]
    return [info("page.magnitudes"), *reasons, *e.notes]


def _differences(evaluations: list[Evaluation]) -> str:
    """In what the evaluations differ besides their estimates; empty where they can be compared."""
    judged: dict[str, set[object]] = {
        "the samples scored": {e.t[e.match.scored].tobytes() for e in evaluations},
        "what was aligned": {e.settings.align for e in evaluations},
        "the reference": {e.reference.source for e in evaluations},
    }
    return " and ".join(name for name, values in judged.items() if len(values) > 1)


def _comparison_table(evaluations: Mapping[str, Evaluation]) -> Table:
    """RMSE of each, the smallest of each column in bold."""
    rows, strong = [], []
    aligned = any(e.settings.align for e in evaluations.values())
    for name, e in evaluations.items():
        errors = [degrees(e.stats[q].rmse) if q in e.stats else "not scored" for q in QUANTITIES]
        constants = [", ".join(e.settings.align) or "nothing"] if aligned else []
        rows.append([name, *errors, str(e.match.scored.sum()), *constants])
    for column, q in enumerate(QUANTITIES, start=1):
        scores = {i: e.stats[q].rmse for i, e in enumerate(evaluations.values()) if q in e.stats}
        strong += [(i, column) for i, rmse in scores.items() if rmse == min(scores.values())]
    head = ["", *QUANTITIES, "samples", *(["aligned"] if aligned else [])]
    return Table("RMSE [°]", head, rows, (len(QUANTITIES) + 2,) if aligned else (), strong)


def _left_out(e: Evaluation) -> dict[str, int]:
    """How many samples were left out, by the reason in words."""
    until = e.not_converged_until
    counts = {fate.meaning: n for fate, n in e.match.counts().items() if fate is not Fate.SCORED}
    if until is None:
        return counts
    name = Fate.NOT_CONVERGED.meaning
    return {f"{why}, the last at {until:.3f} s" if why == name else why: n for why, n in counts.items()}


def _describe_track(track: AttitudeTrack) -> str:
    """Source without its parameters, frame and heading reference."""
    heading = "free heading" if track.north is North.FREE else f"{track.north} north"
    name, _, more = _source_parts(track)
    return f"{name + more or 'unnamed'} ({track.frame}, {heading}, {counted(len(track), 'sample')})"


def _source_parts(track: AttitudeTrack) -> tuple[str, str, str]:
    """Name, parameters and the rest of what a filter says of its track; of another source all is its name."""
    match = re.match(r"(\w+)\(([^()]*)\)(.*)", track.source, re.DOTALL)
    return (match[1], match[2], match[3]) if match else (track.source, "", "")


def _describe_alignment(e: Evaluation) -> list[str]:
    """One line for each constant that was found."""
    a, lines = e.alignment, []
    if a.time is not None:
        later = "later" if a.time.offset >= 0.0 else "earlier"
        lines.append(
            f"time: the estimate is {abs(1e3 * a.time.offset):.3f} ms {later} (correlation {a.time.correlation:.4f})"
        )
    if a.mounting is not None:
        lines.append(
            f"mounting: {to_deg(float(quat_angle(IDENTITY, a.mounting))):.3f}°, estimate's body to reference's "
            f"wxyz {' '.join(f'{v:.5f}' for v in a.mounting)}"
        )
    if a.heading is not None:
        side = "right" if a.heading >= 0.0 else "left"
        lines.append(f"heading: the estimate reads {abs(to_deg(a.heading)):.3f}° {side} of the reference's")
    if a.tilt_spread is not None:
        lines.append(f"tilt of the body varied by {to_deg(a.tilt_spread):.1f}° rms, which separates the two")
    return lines


def _describe_consistency(e: Evaluation) -> str:
    """How the error fits the claimed covariance."""
    c = e.consistency
    if c is None:
        return f"claimed, but not judged: {e.not_scored.get('total', 'in no scored sample is it positive definite')}"
    left_out = f"; {counted(c.unusable, 'sample')} with an unusable covariance" if c.unusable else ""
    return (
        f"NEES {c.mean:.3g} on average ({DOF} expected), {100 * c.share_inside:.1f} % inside "
        f"{c.lower:.3g} to {c.upper:.3g} ({100 * CONFIDENCE:.0f} % expected){left_out}"
    )


def degrees(angle: float) -> str:
    """Angle in degrees with three decimals, or with two digits where that would show nothing."""
    value = to_deg(angle)
    return f"{value:.3f}" if value == 0.0 or abs(value) >= 0.0005 else f"{value:.0e}"


def _figures(e: Evaluation, columns: int) -> list[Figure]:
    shade = ("not scored", SHADE, "block")
    attitude = [("estimate", ESTIMATE, "solid"), ("reference", REFERENCE, "solid"), shade]
    errors = [(name, colour, "solid") for name, colour in COLOUR.items() if name in e.stats]
    caption = "Cumulative distribution of the error; dots mark 50, 95 and 99 %"
    over_time = partial(draw_panels, partial(_error_panels, e, columns))
    course = partial(draw_panels, partial(_attitude_panels, e, columns))
    return [
        Figure("Error over time", over_time, [*errors, shade], height=0.6 + 1.1 * max(1, len(errors))),
        Figure("Yaw, pitch and roll over time", course, attitude, height=3.9),
        Figure(caption, partial(draw_panels, partial(_distribution, e)), errors),
    ]


def _attitude_panels(e: Evaluation, columns: int) -> list[PlotPanel]:
    """Yaw, pitch and roll of estimate and reference over time."""
    est, ref = (to_deg(euler_zyx_from_quat(q)).T for q in (e.estimate.q_nb, e.match.q_ref))
    limits, styles = (180.0, 90.0, 180.0), ((REFERENCE, 2.4), (ESTIMATE, 0.7))
    return [
        _panel(e, columns, name, zip((ref[i], est[i]), styles, strict=True), jump=180.0, circle=(-limit, limit))
        for i, (name, limit) in enumerate(zip(("yaw", "pitch", "roll"), limits, strict=True))
    ]


def _error_panels(e: Evaluation, columns: int) -> list[PlotPanel]:
    """Total, heading and inclination error over time, those of them that are scored."""
    return [
        _panel(e, columns, name, [(to_deg(e.errors[name]), (COLOUR[name], 0.7))], y=(0.0, None))
        for name in COLOUR if name in e.stats
    ]  # fmt: skip


def _panel(
    e: Evaluation, columns: int, name: str, lines: Iterable[tuple[Floats, Any]], *, jump: float = np.inf, **how: Any
) -> PlotPanel:
    """Values in degrees, each with colour and width, over time; pale where samples are not scored."""
    several = e.t.size > 1
    gap = GAP_FACTOR * float(np.median(np.diff(e.t))) if several else np.inf
    drawn = [PlotLine(e.t, y, colour, width=width, gap=gap, jump=jump) for y, (colour, width) in lines]
    pale, ends = (runs(e.t, ~e.match.scored, columns), (e.t[0], e.t[-1])) if several else ([], (None, None))
    return PlotPanel(f"{name} [°]", drawn, x=ends, pale=pale, columns=columns, **how)


def _distribution(e: Evaluation) -> list[PlotPanel]:
    """Share of samples whose error is at most so much, with the median and the 95th and 99th percentile."""
    scored = {name: e.stats[name] for name in COLOUR if name in e.stats}
    lines = [_cumulative(e.errors[name][e.match.scored], COLOUR[name]) for name in scored]
    marks = {name: np.array([to_deg(p) for p in (s.p50, s.p95, s.p99)]) for name, s in scored.items()}
    share = np.array([50.0, 95.0, 99.0])
    lines += [PlotLine(x, share, COLOUR[name], width=0.0, mark="o") for name, x in marks.items()]
    return [_cumulative_panel(lines, list(scored.values()))]


def comparison_figure(evaluations: Mapping[str, Evaluation]) -> Figure:
    """Distribution of the one error that all have: total, or inclination where a heading is free."""
    shared = NEEDS_HEADING[0] if all(NEEDS_HEADING[0] in e.stats for e in evaluations.values()) else "inclination"
    styles = [(SERIES[i % len(SERIES)], _DASHES[i // len(SERIES) % len(_DASHES)]) for i in range(len(evaluations))]

    def panels() -> list[PlotPanel]:
        both = zip(evaluations.values(), styles, strict=True)
        lines = [_cumulative(e.errors[shared][e.match.scored], *style) for e, style in both]
        return [_cumulative_panel(lines, [e.stats[shared] for e in evaluations.values()])]

    keys = [(name, *style) for name, style in zip(evaluations, styles, strict=True)]
    return Figure(f"Cumulative distribution of the {shared} error", partial(draw_panels, panels), keys)


def _cumulative(error: Floats, colour: str, dash: str = "solid") -> PlotLine:
    sizes = np.abs(error[np.isfinite(error)])
    return PlotLine(to_deg(np.percentile(sizes, _QUANTILES)), _QUANTILES, colour, dash, width=1.1)


def _cumulative_panel(lines: Sequence[PlotLine], stats: Sequence[Stats]) -> PlotPanel:
    """Up to the worst 99th percentile and a quarter; the tail beyond is in the table."""
    end = max(to_deg(max(min(s.max_abs, 1.25 * s.p99) for s in stats)), 1e-9)
    ticks = (0, 25, 50, 75, 95)
    return PlotPanel("cumulative share [%]", lines, "error [°]", x=(0.0, end), y=(0.0, 100.0), ticks=ticks)
