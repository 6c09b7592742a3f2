"""The page of one or several evaluations: figures, tables and remarks in one file without network or scripts."""

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.errors import ShapeError
from plumbob.core.files import write_text
from plumbob.core.time import GAP_FACTOR
from plumbob.core.units import to_deg, to_dps
from plumbob.evaluation.metrics import NEEDS_HEADING, QUANTITIES, Stats
from plumbob.evaluation.report import (
    degrees,
    describe_alignment,
    describe_consistency,
    describe_samples,
    describe_track,
    left_out,
)
from plumbob.report import DASHES, SERIES, SHADE, SOFT, Rows, definitions_list, document, envelope, figure, runs, svg
from plumbob.rotations import euler_zyx_from_quat

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from plumbob.evaluation.evaluation import Evaluation

ESTIMATE, REFERENCE = SERIES[0], SOFT
COLOUR = dict(zip(("total", "heading", "inclination"), SERIES, strict=False))

_QUANTILES = np.linspace(0.0, 100.0, 401)


def attitude_figure(e: "Evaluation", columns: int, salt: str) -> str:
    """Yaw, pitch and roll of estimate and reference over time."""
    est, ref = euler_zyx_from_quat(e.estimate.q_nb), euler_zyx_from_quat(e.match.q_ref)

    def draw(figure: "Figure") -> None:
        axes = figure.subplots(3, 1, sharex=True)
        for i, name in enumerate(("yaw", "pitch", "roll")):
            _line(axes[i], e, ref[:, i], columns, color=REFERENCE, linewidth=2.4, jump=np.pi)
            _line(axes[i], e, est[:, i], columns, color=ESTIMATE, linewidth=0.7, jump=np.pi)
            _round_degrees(axes[i], 90 if name == "pitch" else 180)
            _shade(axes[i], e, columns)
            axes[i].set_ylabel(f"{name} [°]")
        axes[2].set_xlabel("time [s]")

    return svg(draw, height=3.9, salt=f"attitude {salt}")


def error_figure(e: "Evaluation", columns: int, salt: str) -> str:
    """Total, heading and inclination error over time; a figure of those that are scored."""
    names = [name for name in COLOUR if name in e.stats]

    def draw(figure: "Figure") -> None:
        axes = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
        for ax, name in zip(axes, names, strict=True):
            _line(ax, e, e.errors[name], columns, color=COLOUR[name], linewidth=0.7)
            _shade(ax, e, columns)
            ax.set_ylim(bottom=0.0)
            ax.set_ylabel(f"{name} [°]")
        axes[-1].set_xlabel("time [s]")

    return svg(draw, height=0.6 + 1.1 * len(names), salt=f"error {salt}")


def distribution_figure(e: "Evaluation", salt: str) -> str:
    """Share of samples whose error is at most so much, with the median and the 95th and 99th percentile."""
    values = {name: e.errors[name][e.match.scored] for name in COLOUR if name in e.stats}

    def draw(figure: "Figure") -> None:
        ax = figure.subplots()
        for name, error in values.items():
            _cumulative(ax, error, color=COLOUR[name], linestyle="solid")
            s = e.stats[name]
            marks = [to_deg(p) for p in (s.p50, s.p95, s.p99)]
            ax.plot(marks, (50, 95, 99), "o", color=COLOUR[name], markersize=3.0, clip_on=False)
        _finish_cumulative(ax, [e.stats[name] for name in values])

    return svg(draw, height=2.4, salt=f"distribution {salt}")


def comparison_figure(evaluations: Mapping[str, "Evaluation"], name: str) -> str:
    """Distribution of one quantity for several evaluations, in the order of `key_style`."""

    def draw(figure: "Figure") -> None:
        ax = figure.subplots()
        for i, e in enumerate(evaluations.values()):
            colour, dash = key_style(i)
            _cumulative(ax, e.errors[name][e.match.scored], color=colour, linestyle=dash)
        _finish_cumulative(ax, [e.stats[name] for e in evaluations.values()])

    return svg(draw, height=2.4, salt="comparison")


def key_style(i: int) -> tuple[str, str]:
    """Colour and dash of the i-th of several lines."""
    return SERIES[i % len(SERIES)], DASHES[(i // len(SERIES)) % len(DASHES)]


def shared_quantity(evaluations: Sequence["Evaluation"]) -> str:
    """The one quantity by which all of them can be compared: total, or inclination where a heading is free."""
    return "inclination" if any(NEEDS_HEADING[0] not in e.stats for e in evaluations) else NEEDS_HEADING[0]


def _line(ax: "Axes", e: "Evaluation", values: Floats, columns: int, *, jump: float = np.inf, **style: Any) -> None:
    gap = GAP_FACTOR * float(np.median(np.diff(e.t))) if e.t.size > 1 else np.inf
    t, y = envelope(e.t, values, columns, gap=gap, jump=jump)
    marker = "." if t.size < 3 else ""
    ax.plot(t, to_deg(y), marker=marker, **style)


def _shade(ax: "Axes", e: "Evaluation", columns: int) -> None:
    if e.t.size < 2:
        return
    ax.set_xlim(e.t[0], e.t[-1])
    stretches = runs(e.t, ~e.match.scored, columns)
    ax.broken_barh(stretches, (0.0, 1.0), transform=ax.get_xaxis_transform(), facecolors=SHADE, linewidth=0, zorder=0)


def _round_degrees(ax: "Axes", limit: int) -> None:
    """Round ticks and the whole range on an axis that shows more than half of what the angle can be."""
    low, high = ax.get_ylim()
    if high - low > limit:
        ax.set_ylim(min(low, -limit), max(high, limit))
        ax.set_yticks((-limit, -limit // 2, 0, limit // 2, limit))


def _cumulative(ax: "Axes", error: Floats, *, color: str, linestyle: str) -> None:
    known = np.abs(error[np.isfinite(error)])
    ax.plot(to_deg(np.percentile(known, _QUANTILES)), _QUANTILES, color=color, linestyle=linestyle, linewidth=1.1)


def _finish_cumulative(ax: "Axes", stats: Sequence[Stats]) -> None:
    """Axes up to the worst 99th percentile and a quarter; the tail beyond is in the table."""
    ax.set_ylim(0.0, 100.0)
    ax.set_yticks((0, 25, 50, 75, 95))
    ax.set_xlim(0.0, max(to_deg(max(min(s.max_abs, 1.25 * s.p99) for s in stats)), 1e-9))
    ax.set_xlabel("error [°]")
    ax.set_ylabel("cumulative share [%]")


_COLUMNS = 800
_ALL_COLUMNS = 3200  # shared by the evaluations of a page, so that many of them still make a small file
_HEAD = ("RMSE", "mean", "std", "max |e|", "max at", "median |e|", "95 % |e|", "99 % |e|")
_UNITS = ("deg", "deg", "deg", "deg", "s", "deg", "deg", "deg")
_DEFINITIONS = (
    "With e = q<sub>est</sub> ⊗ q<sub>ref</sub><sup>−1</sup> = (w, x, y, z) in the navigation frame: total 2 acos |w|, "
    "heading 2 atan |z / w|, inclination 2 acos √(w² + z²), as in the BROAD benchmark (Laidig et al. 2021, "
    "doi:10.3390/data6070072). Yaw, pitch and roll are signed differences of ZYX Euler angles, estimate minus "
    "reference. Percentiles are of the magnitude, and RMSE² = mean² + std²."
)


def write_html(
    path: str | Path,
    evaluations: Mapping[str, "Evaluation"],
    *,
    title: str,
    facts: Mapping[str, str],
    overwrite: bool = False,
) -> Path:
    """Write a self-contained page with tables and figures.

    Parameters
    ----------
    path : path_like
        File to write.
    evaluations : mapping of str to Evaluation
        By name, such as the filter's; several are compared.
    title : str
        Of the page.
    facts : mapping of str to str
        Provenance as name and value: device, recording, calibration, versions, date. Any text is safe.
    overwrite : bool
        Whether a file that lies there may be replaced.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    ShapeError
        If there is no evaluation.
    MissingExtraError
        If matplotlib is not installed.
    """
    if not evaluations:
        raise ShapeError("a report needs at least one evaluation, but evaluations is empty.")
    return write_text(path, page(evaluations, title=title, facts=facts), overwrite=overwrite)


def page(evaluations: Mapping[str, "Evaluation"], *, title: str, facts: Mapping[str, str]) -> str:
    """Text of the page that `write_html` writes."""
    columns = max(200, min(_COLUMNS, _ALL_COLUMNS // len(evaluations)))
    body = [_comparison(evaluations)] if len(evaluations) > 1 else []
    body += [_section(i, name, e, columns) for i, (name, e) in enumerate(evaluations.items())]
    return document(title, facts, body, footer=_DEFINITIONS)


def _comparison(evaluations: Mapping[str, "Evaluation"]) -> str:
    """Table and distribution of all evaluations of the page."""
    shared = shared_quantity(list(evaluations.values()))
    parts = ["<section><h2>Comparison</h2>", _comparison_table(evaluations)]
    differing = _differences(list(evaluations.values()))
    if differing:
        parts.append(f"<p class='note'>Not directly comparable: the rows differ in {differing}.</p>")
    keys = [(name, *key_style(i)) for i, name in enumerate(evaluations)]
    caption = f"Cumulative distribution of the {shared} error"
    parts.append(figure(caption, comparison_figure(evaluations, shared), keys))
    return "\n".join([*parts, "</section>"])


def _differences(evaluations: list["Evaluation"]) -> str:
    """In what the evaluations differ besides their estimates; empty where they can be compared."""
    judged: dict[str, set[object]] = {
        "the samples scored": {e.t[e.match.scored].tobytes() for e in evaluations},
        "what was aligned": {e.settings.align for e in evaluations},
        "the reference": {e.reference.source for e in evaluations},
    }
    return " and ".join(name for name, values in judged.items() if len(values) > 1)


def _comparison_table(evaluations: Mapping[str, "Evaluation"]) -> str:
    best = {
        name: min((e.stats[name].rmse for e in evaluations.values() if name in e.stats), default=None)
        for name in QUANTITIES
    }
    rows = []
    for name, e in evaluations.items():
        cells = [_best_cell(e, quantity, best[quantity]) for quantity in QUANTITIES]
        cells.append(f"<td>{e.match.scored.sum()}</td><td>{', '.join(e.settings.align) or 'nothing'}</td>")
        rows.append(f"<tr><th scope='row'>{escape(name)}</th>{''.join(cells)}</tr>")
    head = "".join(f"<th scope='col'>{name}</th>" for name in QUANTITIES)
    units = "<th></th>" + "<th>deg</th>" * len(QUANTITIES) + "<th></th><th></th>"
    return (
        "<div class='scroll'><table><caption>RMSE [°]; bold: smallest of the column</caption>"
        f"<thead><tr><th></th>{head}<th scope='col'>samples</th><th scope='col'>aligned</th></tr>"
        f"<tr class='units'>{units}</tr></thead>"
        f"<tbody>{''.join(rows)}</tbody></table></div>"
    )


def _best_cell(e: "Evaluation", name: str, best: float | None) -> str:
    if name not in e.stats:
        return "<td class='none'>not scored</td>"
    number = _number(e.stats[name].rmse)
    return f"<td><strong>{number}</strong></td>" if e.stats[name].rmse == best else f"<td>{number}</td>"


def _section(i: int, name: str, e: "Evaluation", columns: int) -> str:
    """Everything about one evaluation."""
    shade = ("not scored", SHADE, "block")
    attitude = [("estimate", ESTIMATE, "solid"), ("reference", REFERENCE, "solid"), shade]
    errors = [(k, colour, "solid") for k, colour in COLOUR.items() if k in e.stats]
    parts = [
        f"<section><h2>{escape(name)}</h2>",
        f"<p class='source'>{escape(e.estimate.source)} against {escape(e.reference.source)}</p>",
        _headline(e),
        _notes(e),
        _error_table(e),
        figure("Error over time", error_figure(e, columns, str(i)), [*errors, shade]),
        figure("Yaw, pitch and roll over time", attitude_figure(e, columns, str(i)), attitude),
        figure(
            "Cumulative distribution of the error; dots mark 50, 95 and 99 %",
            distribution_figure(e, str(i)),
            errors,
        ),
        "<div class='columns'>",
        f"<div><h3>Comparison</h3>{definitions_list(_compared(e))}</div>",
        f"<div><h3>Samples</h3>{_sample_table(e)}</div>",
        "</div>",
        _flag_table(e),
        "</section>",
    ]
    return "\n".join(part for part in parts if part)


def _headline(e: "Evaluation") -> str:
    """The three figures that are quoted."""
    cards = []
    for name in COLOUR:
        value = f"{degrees(e.stats[name].rmse)}°" if name in e.stats else "<small>not scored</small>"
        cards.append(f"<div><span>{name} RMSE</span><b>{value}</b></div>")
    return f"<div class='cards'>{''.join(cards)}</div>"


def _notes(e: "Evaluation") -> str:
    reasons = [
        f"{', '.join(name for name, why in e.not_scored.items() if why == reason)} not scored: {reason}"
        for reason in dict.fromkeys(e.not_scored.values())
    ]
    items = "".join(f"<li>{escape(note)}</li>" for note in (*reasons, *e.notes))
    return f"<ul class='note'>{items}</ul>" if items else ""


def _error_table(e: "Evaluation") -> str:
    rows = []
    for name in QUANTITIES:
        if name not in e.stats:
            rows.append(f"<tr><th scope='row'>{name}</th><td class='none' colspan='{len(_HEAD)}'>not scored</td></tr>")
            continue
        s = e.stats[name]
        cells = [_number(a) for a in (s.rmse, s.mean, s.std, s.max_abs, s.p50, s.p95, s.p99)]
        cells.insert(4, f"{s.max_at:.2f}")
        rows.append(f"<tr><th scope='row'>{name}</th>{''.join(f'<td>{c}</td>' for c in cells)}</tr>")
    head = "".join(f"<th scope='col'>{h}</th>" for h in _HEAD)
    units = "".join(f"<th>{u}</th>" for u in _UNITS)
    return (
        "<div class='scroll'><table><caption>Errors of the scored samples</caption>"
        f"<thead><tr><th></th>{head}</tr><tr class='units'><th></th>{units}</tr></thead>"
        f"<tbody>{''.join(rows)}</tbody></table></div>"
    )


def _compared(e: "Evaluation") -> Rows:
    s = e.settings
    yield from ((name, describe_track(e, name)) for name in ("estimate", "reference"))
    yield "scored", describe_samples(e)
    yield "align asked", ", ".join(s.align) or "nothing"
    yield from (("found", line) for line in describe_alignment(e))
    yield "largest gap bridged", f"{1e3 * e.match.max_gap:.4g} ms" + ("" if s.max_gap is not None else " (default)")
    if "time" in s.align:
        yield "offsets searched", f"±{s.max_offset:g} s"
    yield "settling left out", f"{s.settle:g} s"
    if s.declination is not None:
        yield "declination", f"{to_deg(s.declination):+.3f}° (east positive)"
    if e.reference_rate is not None:
        yield "reference turned at", f"{to_dps(e.reference_rate):.3g} °/s rms"
    yield "covariance", describe_consistency(e)


def _sample_table(e: "Evaluation") -> str:
    rows = [("scored", int(e.match.scored.sum())), *left_out(e).items()]
    cells = "".join(
        f"<tr><th scope='row'>{escape(k)}</th><td>{n}</td><td>{_share(n, e.t.size)}</td></tr>" for k, n in rows
    )
    total = f"<tr class='sum'><th scope='row'>all samples of the estimate</th><td>{e.t.size}</td><td>100 %</td></tr>"
    return f"<table><tbody>{cells}{total}</tbody></table>"


def _flag_table(e: "Evaluation") -> str:
    counts = e.flag_counts()
    if not counts:
        return ""
    meaning = dict(flags.MEANING.values())
    scored = int(e.match.scored.sum())
    rows = "".join(
        f"<tr><th scope='row'>{name}</th><td>{n}</td><td>{_share(n, scored)}</td>"
        f"<td class='text'>{meaning[name]}</td></tr>"
        for name, n in counts.items()
    )
    return f"<h3>Flags of the scored samples</h3><div class='scroll'><table><tbody>{rows}</tbody></table></div>"


def _number(angle: float) -> str:
    return degrees(angle).replace("-", "−")


def _share(n: int, of: int) -> str:
    percent = 100.0 * n / of
    return f"{percent:.1f} %" if percent >= 0.1 or not n else "< 0.1 %"
