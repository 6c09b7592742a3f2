"""The page of recordings: one HTML file with plots that are zoomed and read, which opens anywhere, without network.

One constant script draws them, which the page's policy names by its hash. Values stand in blocks of 16-bit codes.
"""

import json
import math
from base64 import b64encode
from collections.abc import Iterator, Sequence
from dataclasses import replace
from hashlib import sha256
from html import escape
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.text import visible
from plumbob.core.time import GAP_FACTOR
from plumbob.core.units import to_deg
from plumbob.core.web import asset
from plumbob.overview.figures import SD, SECTORS
from plumbob.overview.report_entry import Subject
from plumbob.overview.streaming_stats import SPECTRAL, Gathered
from plumbob.overview.tables import (
    SPECTRAL_UNITS,
    burst_table,
    comparison_table,
    flag_table,
    grade_table,
    heading_circle,
    heading_table,
    quality_table,
    sector_table,
    sensor_table,
    shown_scale,
    tables,
    threshold_table,
)
from plumbob.overview.wording import BARE, remarks
from plumbob.quality import quality
from plumbob.reporting.content import Table
from plumbob.reporting.page import CSS, facts_html, table_html
from plumbob.reporting.style import LANGUAGES, said

_NONE: Final = -32768
_CODES: Final = 65534
"""Steps that the range of a channel is divided in."""
_REMARKS: Final = 8
"""That are shown at once."""
_LONG: Final = 12  # bursts whose table is not folded away
_COLOURS: Final = ("blue", "red", "green")
_EVEN: Final = 1e-6  # s that times may depart from even ones and be written as such


def page(subjects: Sequence[Subject], title: str, definitions: Sequence[str], *, lang: str = "en") -> str:
    """HTML of the page; any text in it is safe.

    Raises
    ------
    MissingExtraError
        If the pages of Plumbob are not built here.
    """
    check.one_of("lang", lang, LANGUAGES)
    script = asset("report.js").read_text(encoding="utf-8").replace("</script", "<\\/script")
    style = CSS + STYLE + asset("report.css").read_text(encoding="utf-8")
    digest = b64encode(sha256(script.encode()).digest()).decode()
    policy = (
        "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'; "
        f"script-src 'sha256-{digest}'"
    )
    blocks: list[str] = []
    data: list[dict[str, Any]] = []
    body: list[str] = []
    for number, subject in enumerate(subjects):
        charts = _charts(subject, lang)
        data.append(_data(subject, charts, f"v{number}", blocks))
        body += _subject(subject, charts, number, lang, alone=len(subjects) == 1)
    words = {"time": said("time [s]", lang), "clock": said("time [h:min:s]", lang), "utc": said("UTC", lang)}
    text = json.dumps({"subjects": data, "words": words}, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    head = escape(said(title, lang))
    beside = [] if len(subjects) == 1 else [table_html(_named(comparison_table(subjects)), lang)]
    top = facts_html(_visible(subjects[0].facts), lang) if len(subjects) == 1 else ""
    foot = "".join(f"<p>{escape(definition)}</p>" for definition in definitions)
    return (
        f'<!DOCTYPE html>\n<html lang="{lang}">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{head}: {escape(visible(', '.join(subject.name for subject in subjects)))}</title>\n"
        f"<style>\n{style}</style>\n</head>\n<body>\n<main>\n"
        f"<header><h1>{head}</h1>{top}</header>\n"
        + "\n".join([*beside, *body, f"<footer><h2>{escape(said('Definitions', lang))}</h2>{foot}</footer>"])
        + f'\n</main>\n<script type="application/json" id="report-data">{_safe(text)}</script>\n'
        + "\n".join(blocks)
        + f"\n<script>{script}</script>\n</body>\n</html>\n"
    )


def _safe(text: str) -> str:
    """JSON that stands within a page."""
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _visible(facts: Sequence[tuple[str, str]]) -> list[tuple[str, str]]:
    return [(name, visible(value)) for name, value in facts]


def _named(table: Table) -> Table:
    return replace(table, rows=[[visible(cell) for cell in row] for row in table.rows])


# --- what is said ---------------------------------------------------------------------------------------------------


def _subject(
    subject: Subject, charts: Sequence[dict[str, Any]], number: int, lang: str, *, alone: bool
) -> Iterator[str]:
    """HTML of one recording."""
    level = "h2" if alone else "h3"
    if not alone:
        yield f"<section class='recording'><h2>{escape(visible(subject.name))}</h2>"
        yield facts_html(_visible(subject.facts), lang)
    if not subject.calibrated:
        yield f"<p class='loud'>{escape(said(BARE, lang))}</p>"
    lines = [f"<li>{escape(visible(line))}</li>" for line in remarks(subject) if line != BARE]
    if lines:
        yield f"<ul class='note'>{''.join(lines[:_REMARKS])}</ul>"
    if len(lines) > _REMARKS:
        title = escape(said(f"{len(lines) - _REMARKS} further remarks", lang))
        yield f"<details><summary>{title}</summary><ul class='note'>{''.join(lines[_REMARKS:])}</ul></details>"
    for title, kinds in _SECTIONS:
        inside = "".join(_block(kind, subject, charts, number, lang) for kind in kinds)
        if inside:
            yield f"<section><{level}>{escape(said(title, lang))}</{level}>{inside}</section>"
    if not alone:
        yield "</section>"


_SECTIONS: Final = (
    ("Tilt and heading", ("table:tilt", "rose")),
    ("Attitude", ("hint", "chart:roll", "chart:pitch", "chart:heading", "chart:tilt")),
    ("Spectra", ("chart:angles", "chart:heading rate", "chart:vertical acceleration")),
    ("Bursts", ("chart:bursts", "chart:burst tilt", "table:bursts")),
    ("Sensors", ("chart:rates", "chart:forces", "chart:field", "chart:temperature", "chart:bias", "table:sensors")),
    ("Gaps and flags", ("chart:flags", "table:flags")),
    ("Quality", ("table:grade", "quality")),
)


def _block(kind: str, subject: Subject, charts: Sequence[dict[str, Any]], number: int, lang: str) -> str:
    """HTML of a part of a section; empty where the recording has nothing for it."""
    what, _, name = kind.partition(":")
    g = subject.gathered
    if what == "chart":
        place = next((i for i, chart in enumerate(charts) if chart["name"] == name), None)
        return "" if place is None else _figure(charts[place], f"{number}.{place}", lang)
    if what == "hint":
        hint = "Drag to zoom; double-click or Escape for all; arrow keys, + and − move"
        words = f"<button type='button' data-reset='{number}'>{escape(said('show all', lang))}</button>"
        return f"<p class='hint'>{escape(said(hint, lang))} {words}</p>" if g.tilt is not None else ""
    if what == "rose":
        if g.headings is None or not g.headings.samples:
            return ""
        html = table_html(heading_table(g.headings), lang)
        return f"<div class='beside'><div>{html}{_folded(sector_table(g.headings), lang)}</div>{rose(g, lang)}</div>"
    if what == "quality":
        return _quality(subject, lang)
    return "".join(
        table_html(table, lang) if not folded else _folded(table, lang) for table, folded in _part_tables(name, subject)
    )


def _part_tables(name: str, subject: Subject) -> Iterator[tuple[Table, bool]]:
    """Tables of a section, and whether they are folded away."""
    g = subject.gathered
    if name == "tilt" and g.tilt is not None:
        yield from ((table, False) for table in tables(subject)[:2])
    elif name == "bursts" and g.tilt is not None:
        table = burst_table(subject)
        yield replace(table, title=table.title if len(table.rows) > _LONG else ""), len(table.rows) > _LONG
    elif name == "sensors" and (g.triads or g.has("temp")):
        yield replace(sensor_table(g), title=""), False
    elif name == "flags":
        yield replace(flag_table(g), title=""), False
    elif name == "grade" and subject.grade is not None:
        yield grade_table(subject.grade), False


def _folded(table: Table, lang: str) -> str:
    inside = table_html(replace(table, title=""), lang)
    return f"<details><summary>{escape(said(table.title, lang))}</summary>{inside}</details>"


def _figure(chart: dict[str, Any], place: str, lang: str) -> str:
    lines = chart["lines"] if len(chart["lines"]) > 1 or chart["kind"] in ("time", "points") else []
    key = "".join(
        f"<span><i class='{'dashed' if line.get('dash') else 'solid'}' style='color: var(--{line['colour']})'></i>"
        f"{escape(line['label'])} <b data-line='{i}' class='{'sd' if 'sd' in line else ''}'></b></span>"
        for i, line in enumerate(lines)
    )
    if any("sd" in line for line in chart["lines"]):
        band = escape(said("claimed ± 1 sd", lang))
        key += (
            f"<span><i class='block' style='color: color-mix(in srgb, var(--sky) 40%, transparent)'></i>{band}</span>"
        )
    label = escape(f"{chart['caption']} [{chart['unit']}]" if chart["unit"] else chart["caption"])
    caption = f"<figcaption>{label}<span class='key'>{key}</span></figcaption>"
    return (
        f"<figure class='chart' data-chart='{place}'>{caption}<div class='plot' tabindex='0' role='img' "
        f"aria-label='{label}'></div><noscript>This plot needs JavaScript.</noscript></figure>"
    )


def _quality(subject: Subject, lang: str) -> str:
    """A cell for each burst and channel, its number and colour the flag, and what did not pass below."""
    bursts = subject.gathered.bursts
    channels = [name for name in quality.CHANNELS if any(name in burst.verdicts for burst in bursts)]
    if not channels:
        return ""
    rows = []
    for name in channels:
        cells = "".join(
            f"<span class='q{verdict.flag}' title='{escape(_why(subject, burst, verdict))}'>{verdict.flag}</span>"
            for burst in bursts
            if (verdict := burst.verdicts.get(name, quality.BurstVerdict(quality.MISSING))) is not None
        )
        rows.append(f"<div><b>{escape(said(_CHANNEL[name], lang))}</b><span>{cells}</span></div>")
    key = "".join(
        f"<span><i class='q{flag}'>{flag}</i>{escape(said(word, lang))}</span>"
        for flag, word in quality.MEANING.items()
    )
    return (
        f"<div class='grid'>{''.join(rows)}</div><p class='grid key'>{key}</p>"
        + _folded(quality_table(subject), lang)
        + _folded(threshold_table(), lang)
    )


def _why(subject: Subject, burst: Any, verdict: quality.BurstVerdict) -> str:
    begin = subject.utc(burst.begin) or f"{burst.begin:g} s"
    text = f"{begin}: {quality.MEANING[verdict.flag]}, {100.0 * verdict.good:.1f} % good"
    return text + (f" ({verdict.why})" if verdict.why else "")


_CHANNEL: Final = {"gyr": "Gyroscope", "acc": "Accelerometer", "mag": "Magnetometer", "temp": "Temperature",
                   "attitude": "Attitude"}  # fmt: skip


def rose(g: Gathered, lang: str) -> str:
    """Share of time by heading as a drawing that follows the page's colours."""
    assert g.headings is not None
    share = g.headings.sectors(SECTORS)
    top = _round_up(100.0 * float(share.max()))
    size, radius = 170.0, 128.0
    parts = []
    for ring in (0.25, 0.5, 0.75, 1.0):
        parts.append(f"<circle r='{radius * ring:.1f}' class='ring'/>")
        if ring in (0.5, 1.0):
            text = f"{top * ring:g} %"
            parts.append(
                f"<text x='{radius * ring * 0.707 + 3:.1f}' y='{-radius * ring * 0.707 - 3:.1f}'>{text}</text>"
            )
    for k in range(12):
        x, y = _polar(radius, math.radians(30.0 * k))
        parts.append(f"<line x2='{x:.1f}' y2='{y:.1f}' class='ring'/>")
        x, y = _polar(radius + 16.0, math.radians(30.0 * k))
        name = {0: said("N", lang), 3: said("E", lang), 6: said("S", lang), 9: said("W", lang)}.get(k, f"{30 * k}°")
        parts.append(f"<text x='{x:.1f}' y='{y + 4.0:.1f}' class='{'name' if k % 3 == 0 else ''} mid'>{name}</text>")
    half = math.pi / SECTORS * 0.92
    for k, fraction in enumerate(share.tolist()):
        if fraction > 0.0:
            r, middle = radius * 100.0 * fraction / top, 2.0 * math.pi * k / SECTORS
            (ax, ay), (bx, by) = _polar(r, middle - half), _polar(r, middle + half)
            words = f"{10 * k}°: {100.0 * fraction:.2f} %"
            parts.append(
                f"<path d='M0 0L{ax:.2f} {ay:.2f}A{r:.2f} {r:.2f} 0 0 1 {bx:.2f} {by:.2f}Z' class='petal'>"
                f"<title>{words}</title></path>"
            )
    if math.isfinite(g.headings.mean):
        x, y = _polar(radius * g.headings.resultant, g.headings.mean)
        parts.append(f"<line x2='{x:.1f}' y2='{y:.1f}' class='mean'/>")
    caption = escape(said("Share of time by heading, sectors of 10°", lang))
    mean = escape(said("mean vector", lang))
    key = f"<span class='key'><span><i class='solid' style='color: var(--red)'></i>{mean}</span></span>"
    drawing = (
        f"<svg viewBox='{-size} {-size} {2 * size} {2 * size}' role='img' aria-label='{caption}'>{''.join(parts)}</svg>"
    )
    return f"<figure class='rose'><figcaption>{caption}{key}</figcaption>{drawing}</figure>"


def _polar(r: float, angle: float) -> tuple[float, float]:
    return r * math.sin(angle), -r * math.cos(angle)


def _round_up(value: float) -> float:
    power = 10.0 ** math.floor(math.log10(max(value, 1e-3)))
    return next(step * power for step in (1.0, 2.0, 4.0, 5.0, 8.0, 10.0) if step * power >= value * (1.0 - 1e-9))


# --- what is drawn --------------------------------------------------------------------------------------------------


def _charts(subject: Subject, lang: str) -> list[dict[str, Any]]:
    """Plots that the recording has values for, as the script takes them."""
    g = subject.gathered
    plots: list[dict[str, Any]] = []

    def add(name: str, caption: str, kind: str, unit: str, lines: list[dict[str, Any]], **more: Any) -> None:
        lines = [line | {"label": said(line["label"], lang)} for line in lines]
        plots.append({"name": name, "caption": said(caption, lang), "kind": kind, "unit": unit, "lines": lines, **more})

    if g.tilt is not None:
        for name in ("roll", "pitch", "heading"):
            sd = {"sd": SD[name]} if g.has(SD[name]) else {}
            circle: dict[str, Any] = {"period": (-180.0, 180.0)} if name == "roll" else {}
            if name == "heading":
                circle = {"period": heading_circle(g), "compass": True}
            add(
                name,
                name.capitalize(),
                "time",
                "°",
                [{"label": name, "colour": "blue", "channel": name} | sd],
                **circle,
            )
        limit = to_deg(g.tilt.inclination.limit)
        line = {"label": "inclination", "colour": "blue", "channel": "tilt"}
        add("tilt", "Inclination from the vertical", "time", "°", [line], floor=0.0,
            **({"limit": limit} if limit <= 2.0 * to_deg(g.tilt.inclination.greatest) else {}))  # fmt: skip
        _add_spectra(g, add)
        _add_bursts(g, add)
    for name, stem, caption, unit in _TRIADS:
        if g.has(f"{stem}_x"):
            lines = [
                {"label": axis, "colour": c, "channel": f"{stem}_{axis}"}
                for axis, c in zip("xyz", _COLOURS, strict=True)
            ]
            add(name, caption, "time", unit, lines)
    if g.has("temp"):
        line = {"label": "temperature", "colour": "blue", "channel": "temp"}
        add("temperature", "Temperature", "time", "°C", [line])
    rows = [("gaps", g.gaps, False)]
    rows += [(name, runs.stretches, runs.coarse) for name, runs in g.flags.items() if name != "gap"]
    add("flags", "Flags over time", "flags", "", [], rows=[
        {"label": said(name, lang), "colour": "red" if name == "gaps" else "soft" if coarse else "blue",
         "runs": _rounded(runs)} for name, runs, coarse in rows
    ])  # fmt: skip
    return plots


_TRIADS: Final = (
    ("rates", "gyr", "Angular rate", "°/s"), ("forces", "acc", "Specific force", "m/s²"),
    ("field", "mag", "Magnetic flux density", "µT"), ("bias", "bias", "Estimated gyroscope bias", "°/s"),
)  # fmt: skip


def _rounded(runs: Sequence[tuple[float, float]]) -> list[list[float]]:
    return [[round(begin, 3), round(end, 3)] for begin, end in runs]


def _add_spectra(g: Gathered, add: Any) -> None:
    if g.spectra is None:
        return
    frequency, density = g.spectra.gathered()
    x = [float(f"{f:.5g}") for f in frequency]
    for name, caption, channels in (
        ("angles", "Power spectral density of roll and pitch", ("roll", "pitch")),
        ("heading rate", "Power spectral density of the heading rate", ("heading_rate",)),
        ("vertical acceleration", "Power spectral density of the vertical acceleration", ("vertical",)),
    ):
        lines = []
        for channel, colour in zip(channels, _COLOURS, strict=False):
            y = density[:, SPECTRAL.index(channel)] * shown_scale(channel) ** 2
            if np.isfinite(y).any():
                lines.append({"label": channel.replace("_", " "), "colour": colour, "y": _digits(y)})
        if lines:
            add(name, caption, "spectrum", SPECTRAL_UNITS[channels[0]], lines, x=x, xlabel="f [Hz]")


def _digits(values: Floats) -> list[float | None]:
    """Five digits of each; None where not known or not above zero."""
    return [float(f"{v:.5g}") if math.isfinite(v) and v > 0.0 else None for v in values.tolist()]


def _add_bursts(g: Gathered, add: Any) -> None:
    if len(g.bursts) < 2:
        return
    x = [round(0.5 * (burst.begin + burst.end), 3) for burst in g.bursts]

    def line(label: str, colour: str, values: list[float], **more: Any) -> dict[str, Any]:
        return {"label": label, "colour": colour, "y": _digits(np.degrees(np.asarray(values))), **more}

    tilts = [burst.tilt for burst in g.bursts]
    add("bursts", "Significant double amplitude by burst", "points", "°", [
        line("roll", "blue", [tilt.roll.significant for tilt in tilts]),
        line("pitch", "red", [tilt.pitch.significant for tilt in tilts]),
    ], x=x, floor=0.0)  # fmt: skip
    add("burst tilt", "Inclination by burst", "points", "°", [
        line("mean", "green", [tilt.inclination.mean for tilt in tilts]),
        line("greatest", "green", [tilt.inclination.greatest for tilt in tilts], dash=True),
    ], x=x, floor=0.0)  # fmt: skip


def _data(subject: Subject, charts: list[dict[str, Any]], name: str, blocks: list[str]) -> dict[str, Any]:
    """What the script is given of a recording; blocks of values are added to `blocks`."""
    g = subject.gathered
    wanted = dict.fromkeys(
        channel for chart in charts for line in chart["lines"] for channel in (line.get("channel"), line.get("sd"))
        if channel
    )  # fmt: skip
    t = g.traces.t
    return {
        "rows": int(t.size),
        "t": _times(t, f"{name}t", blocks),
        "breaks": np.flatnonzero(~np.isfinite(g.traces.values).any(axis=1)).tolist(),
        "begin": g.begin, "end": g.end,
        "epoch": subject.t0_ns / 1e9 if subject.t0_ns else None,
        "channels": {channel: _channel(g, channel, f"{name}{i}", blocks) for i, channel in enumerate(wanted)},
        "charts": charts,
    }  # fmt: skip


def _times(t: Floats, name: str, blocks: list[str]) -> dict[str, Any]:
    step = float(t[-1] - t[0]) / (t.size - 1) if t.size > 1 else 1.0
    if float(np.max(np.abs(t - t[0] - step * np.arange(t.size)))) <= _EVEN:
        return {"first": float(t[0]), "step": step}
    blocks.append(_data_block(name, t.astype("<f8")))
    return {"block": name}


def _channel(g: Gathered, channel: str, name: str, blocks: list[str]) -> dict[str, Any]:
    """Codes of a channel, and what they mean."""
    values = g.traces.channel(channel) * shown_scale(channel)
    if channel == "heading":
        start = heading_circle(g)[0]
        values = (values - start) % 360.0 + start
    finite = np.isfinite(values)
    low, high = (float(values[finite].min()), float(values[finite].max())) if finite.any() else (0.0, 0.0)
    step = (high - low) / _CODES or 1e-9
    middle = 0.5 * (low + high)
    codes = np.full(values.size, _NONE, dtype="<i2")
    codes[finite] = np.clip(np.rint((values[finite] - middle) / step), -_CODES // 2, _CODES // 2).astype("<i2")
    blocks.append(_data_block(name, codes))
    at = g.traces.t[finite]
    usual = float(np.median(np.diff(at))) if at.size > 1 else g.step
    return {"block": name, "low": middle, "step": step, "hold": max(GAP_FACTOR * usual, 1.01 * g.traces.each * g.step)}


def _data_block(name: str, values: NDArray[Any]) -> str:
    text = b64encode(np.ascontiguousarray(values).tobytes()).decode()
    return f'<script type="application/octet-stream" id="{name}">{text}</script>'


STYLE: Final = """\
thead th { white-space: normal; vertical-align: bottom; }
tbody th[scope=row] { overflow-wrap: anywhere; max-width: 15rem; }
.beside { display: grid; grid-template-columns: minmax(0, 1fr) minmax(0, 1fr); gap: 0 2rem; align-items: start; }
.loud { margin: 1.25rem 0 0; padding: 0.5rem 0.9rem; border: 2px solid var(--red); color: var(--red);
  font-weight: 700; }
.hint { color: var(--muted); font-size: 0.85rem; margin: 0.6rem 0 0; }
.hint button { font: inherit; color: var(--ink); background: var(--band); border: 1px solid var(--muted);
  border-radius: 3px; padding: 0.1rem 0.6rem; cursor: pointer; }
figure.rose { max-width: 27rem; }
figure.rose svg { min-width: 0; max-width: 25rem; margin: 0.4rem auto 0; font-size: 11px; fill: var(--muted); }
.rose .ring { fill: none; stroke: var(--grid); }
.rose .petal { fill: var(--blue); }
.rose .mean { stroke: var(--red); stroke-width: 2; }
.rose .mid { text-anchor: middle; }
.rose .name { fill: var(--ink); font-weight: 600; font-size: 13px; }
.grid { margin-top: 1rem; font-size: 0.85rem; }
.grid > div { display: grid; grid-template-columns: 8rem 1fr; gap: 0 1rem; padding: 0.12rem 0; }
.grid > div > b { font-weight: 400; color: var(--muted); }
.grid > div > span { display: flex; flex-wrap: wrap; gap: 2px; }
.grid span span, .grid.key i { display: inline-block; min-width: 1.25rem; text-align: center; border-radius: 2px;
  font-style: normal; line-height: 1.35; height: auto; width: auto; border-top: 0; }
.grid.key { gap: 0.2rem 1.1rem; }
.q1 { background: color-mix(in srgb, var(--green) 30%, transparent); }
.q2 { background: var(--shade); color: var(--muted); }
.q3 { background: color-mix(in srgb, var(--amber) 55%, transparent); font-weight: 600; }
.q4 { background: var(--red); color: var(--paper); font-weight: 700; }
.q9 { border: 1px dashed var(--muted); color: var(--muted); }
section.recording { border-top: 1px solid var(--ink); margin-top: 2.5rem; }
footer h2 { font-size: 1rem; margin-top: 1.25rem; color: var(--ink); }
:root[data-paper] {
  --paper: #ffffff; --ink: #1b1f24; --muted: #5b6570; --soft: #aab4be;
  --grid: #d8dde2; --shade: #e9edf1; --band: #f5f7f9;
  --blue: #0072b2; --red: #d55e00; --green: #009e73; --pink: #cc79a7; --amber: #e69f00;
  --sky: #56b4e9; --olive: #8a6d00;
}
@media (max-width: 45rem) { .beside { display: block; } }
@media (max-width: 30rem) { .grid > div { display: block; padding: 0.3rem 0; } }
@media print {
  table, figcaption, .grid { font-size: 8pt; }
  figure.chart { break-inside: avoid; }
  .hint { display: none; }
  .grid span span, .q4, .loud { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
  figure.rose svg { width: 55%; }
  section, h2, h3 { break-inside: auto; }
}
"""
