"""The page of recordings: one HTML file with plots that are zoomed and read, which opens anywhere; and single figures.

One constant script draws them, which the page's policy names by its hash; nothing asks for a network. Values stand in
blocks of 16-bit codes.
"""

import math
from base64 import b64encode
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core import check, units
from plumbob.core.errors import ParameterError
from plumbob.core.resources import asset
from plumbob.core.time import GAP_FACTOR
from plumbob.core.units import Quantity, to_deg
from plumbob.data import ImuData
from plumbob.data.recording import Recording
from plumbob.overview.overview import Overview, Source, make_gatherer
from plumbob.overview.report_entry import Progress, Subject, read_subject
from plumbob.overview.streaming_stats import Gathered
from plumbob.quality import quality
from plumbob.quality.tilt import Headings
from plumbob.reporting import overview_tables as tables
from plumbob.reporting.content import said
from plumbob.reporting.drawing import picture, picture_kind
from plumbob.reporting.overview_figures import SECTORS, WHATS, Chart, charts, figure, figures, shown_values
from plumbob.reporting.page import CSS, asset_text, render
from plumbob.reporting.report import Report

TITLE: Final = "Attitude report"
_WIDTHS: Final = 0.03, 1.0  # least and greatest width of a picture, m
_NONE: Final = -32768
_CODES: Final = 65534
"""Steps that the range of a channel is divided in."""
_LONG: Final = 12  # bursts whose table is not folded away
_EVEN: Final = 1e-6  # s that times may depart from even ones and be written as such
_CHANNEL: Final = {"gyr": "Gyroscope", "acc": "Accelerometer", "mag": "Magnetometer", "temp": "Temperature",
                   "attitude": "Attitude"}  # fmt: skip

Block = tuple[str, Any]
"""Kind of a part of a section, as the template has it, and what is in it."""


@dataclass(frozen=True)
class RecordingsReport(Report):
    """Description of recordings, with a page of its own: `subjects` are their statistics and traces."""

    subjects: Sequence[Subject] = ()

    def page(self, *, lang: str = "en") -> str:
        """HTML of the page, self-contained; MissingExtraError where the pages of Plumbob are not built here."""
        return _page(self, lang)


def overview(o: Overview) -> Report:
    """Description of recordings, with figures for a paper."""
    definitions = tables.definitions(o.subjects)
    if len(o.subjects) == 1:
        return replace(_described(o.subjects[0]), title=TITLE, definitions=definitions)
    beside, parts = [tables.comparison_table(o.subjects)], [_described(subject) for subject in o.subjects]
    return RecordingsReport(TITLE, tables=beside, parts=parts, definitions=definitions, subjects=o.subjects)


def _described(subject: Subject) -> RecordingsReport:
    return RecordingsReport(
        subject.name,
        facts=subject.facts,
        tables=tables.tables(subject),
        remarks=tables.remarks(subject),
        figures=lambda: list(figures(subject).values()),
        subjects=(subject,),
    )


def _page(report: RecordingsReport, lang: str) -> str:
    script = asset("report.js").read_text(encoding="utf-8").replace("</script", "<\\/script")
    style = CSS + asset_text("recordings.css") + asset("report.css").read_text(encoding="utf-8")
    values: dict[str, str] = {}
    data, recordings = [], []
    for number, subject in enumerate(report.subjects):
        plots = [_in_language(chart, lang) for chart in charts(subject.gathered) if chart.on_page]
        data.append(_data(subject, plots, f"v{number}", values))
        lines = [line for line in tables.remarks(subject) if line != tables.BARE]
        sections = list(_sections(subject, plots, number))
        loud = "" if subject.calibrated else tables.BARE
        recordings.append(
            {"name": subject.name, "facts": subject.facts, "loud": loud, "remarks": lines, "sections": sections}
        )
    words = {"time": said("time [s]", lang), "clock": said("time [h:min:s]", lang), "utc": said("UTC", lang)}
    return render(
        "recordings.html.j2",
        lang,
        style,
        [script],
        title=report.title,
        names=", ".join(subject.name for subject in report.subjects),
        beside=report.tables[0] if report.parts else None,
        recordings=recordings,
        definitions=report.definitions,
        data={"subjects": data, "words": words},
        values=values,
    )


def _in_language(chart: Chart, lang: str) -> dict[str, Any]:
    """What the script takes of a plot."""
    rows = {
        key: [part | {"label": said(part["label"], lang)} for part in chart.spec.get(key, ())]
        for key in ("lines", "rows")
    }
    unit = chart.label.partition(" [")[2].rstrip("]")
    return chart.spec | rows | {"caption": said(chart.spec["caption"], lang), "unit": unit}


def _sections(subject: Subject, plots: Sequence[dict[str, Any]], number: int) -> Iterator[tuple[str, list[Block]]]:
    """Titles of the sections of a recording, and what it has for each."""
    g = subject.gathered

    def drawn(*names: str) -> list[Block]:
        places = {plot["name"]: i for i, plot in enumerate(plots)}
        return [("chart", (plots[i], f"{number}.{i}")) for name in names if (i := places.get(name)) is not None]

    tilt: list[Block] = []
    bursts: list[Block] = []
    if g.tilt is not None:
        tilt = [
            ("table", tables.motion_table(g.tilt.roll, g.tilt.pitch)),
            ("table", tables.inclination_table(g.tilt.inclination)),
        ]
        table = tables.burst_table(subject)
        is_long = len(table.rows) > _LONG
        bursts = [("folded", table) if is_long else ("table", replace(table, title=""))]
    yield "Tilt and heading", tilt + ([("rose", _rose(g.headings))] if g.headings and g.headings.samples else [])
    hint: list[Block] = [("hint", number)] if g.tilt is not None else []
    yield "Attitude", hint + drawn("roll", "pitch", "heading", "tilt")
    yield "Spectra", drawn("angles", "heading rate", "vertical acceleration")
    yield "Bursts", drawn("bursts", "burst tilt") + bursts
    sensors = drawn("rates", "forces", "field", "temperature", "bias")
    if g.triads or g.has("temp"):
        sensors.append(("table", replace(tables.sensor_table(g), title="")))
    yield "Sensors", sensors
    yield "Gaps and flags", [*drawn("flags"), ("table", replace(tables.flag_table(g), title=""))]
    grade: list[Block] = [] if subject.grade is None else [("table", tables.grade_table(subject.grade))]
    yield "Quality", grade + list(_quality(subject))


def _quality(subject: Subject) -> Iterator[Block]:
    """A cell for each burst and channel, and what did not pass below."""
    bursts = subject.gathered.bursts
    channels = [name for name in quality.CHANNELS if any(name in burst.verdicts for burst in bursts)]
    if channels:
        rows = []
        for name in channels:
            cells = []
            for burst in bursts:
                verdict = burst.verdicts.get(name, quality.BurstVerdict(quality.MISSING))
                why = f" ({verdict.why})" if verdict.why else ""
                begin = subject.utc(burst.begin) or f"{burst.begin:g} s"
                words = f"{begin}: {quality.MEANING[verdict.flag]}, {100.0 * verdict.good:.1f} % good{why}"
                cells.append((verdict.flag, words))
            rows.append((_CHANNEL[name], cells))
        yield "grid", {"rows": rows, "meaning": list(quality.MEANING.items())}
        yield "folded", tables.quality_table(subject)
        yield "folded", tables.threshold_table()


def _rose(headings: Headings) -> dict[str, Any]:
    """Shares of the sectors, per cent, the end of their scale, and the mean vector, degrees."""
    share = 100.0 * headings.sectors(SECTORS)
    power = 10.0 ** math.floor(math.log10(max(share.max(), 1e-3)))
    top = next(step * power for step in (1.0, 2.0, 4.0, 5.0, 8.0, 10.0) if step * power >= share.max() * (1.0 - 1e-9))
    return {
        "share": share.tolist(), "top": top, "mean": to_deg(headings.mean), "resultant": headings.resultant,
        "table": tables.heading_table(headings), "sectors": tables.sector_table(headings),
    }  # fmt: skip


def _data(subject: Subject, plots: list[dict[str, Any]], name: str, values: dict[str, str]) -> dict[str, Any]:
    """What the script is given of a recording; blocks of values are added to `values`."""
    g = subject.gathered
    lines = [line for plot in plots for line in plot["lines"]]
    wanted = dict.fromkeys(line[key] for line in lines for key in ("channel", "sd") if key in line)
    t = g.traces.t
    step = float(t[-1] - t[0]) / (t.size - 1) if t.size > 1 else 1.0
    times: dict[str, Any] = {"first": float(t[0]), "step": step}
    if float(np.max(np.abs(t - t[0] - step * np.arange(t.size)))) > _EVEN:
        values[f"{name}t"] = _encoded(t.astype("<f8"))
        times = {"block": f"{name}t"}
    return {
        "rows": int(t.size),
        "t": times,
        "breaks": np.flatnonzero(~np.isfinite(g.traces.values).any(axis=1)).tolist(),
        "begin": g.begin, "end": g.end,
        "epoch": subject.t0_ns / 1e9 if subject.t0_ns else None,
        "channels": {channel: _channel(g, channel, f"{name}{i}", values) for i, channel in enumerate(wanted)},
        "charts": plots,
    }  # fmt: skip


def _channel(g: Gathered, channel: str, name: str, values: dict[str, str]) -> dict[str, Any]:
    """Codes of a channel, and what they mean."""
    y = shown_values(g, channel)
    finite = np.isfinite(y)
    low, high = (float(y[finite].min()), float(y[finite].max())) if finite.any() else (0.0, 0.0)
    step = (high - low) / _CODES or 1e-9
    middle = 0.5 * (low + high)
    codes = np.full(y.size, _NONE, dtype="<i2")
    codes[finite] = np.clip(np.rint((y[finite] - middle) / step), -_CODES // 2, _CODES // 2).astype("<i2")
    values[name] = _encoded(codes)
    at = g.traces.t[finite]
    usual = float(np.median(np.diff(at))) if at.size > 1 else g.step
    return {"block": name, "low": middle, "step": step, "hold": max(GAP_FACTOR * usual, 1.01 * g.traces.each * g.step)}


def _encoded(values: NDArray[Any]) -> str:
    return b64encode(np.ascontiguousarray(values).tobytes()).decode()


def plot(
    file: Source,
    out: str | Path,
    *,
    what: str = "angles",
    begin: float | str | None = None,
    end: float | str | None = None,
    width: float | str | None = None,
    lang: str = "en",
    overwrite: bool = False,
    burst: float | str = "20 min",
    tilt_limit: float | str = "15 deg",
    note: Callable[[str], object] | None = None,
    progress: Progress | None = None,
    **how: Any,
) -> Path:
    """Draw one figure of a recording for a paper.

    Parameters
    ----------
    file : path, Recording or ImuData
        The recording.
    out : path
        The picture; its ending says whether it is SVG, PNG or PDF.
    what : str
        One of "angles", "tilt", "rates", "forces", "field", "temperature", "bias", "sd", "spectrum", "rose", "bursts"
        and "flags".
    begin, end : float or str, optional
        Times between which samples count, s, or text with a unit; the attitude is estimated of the whole recording.
    width : float or str, optional
        Of the picture, m, or text with a unit, as "85 mm" for a column.
    lang : {"en", "zh"}
        Language of the labels.
    overwrite : bool
        Whether a picture that lies there may be replaced.
    burst, tilt_limit, note, progress : optional
        As of `report`.
    **how
        As of `report`: `filter`, `calibration` and the others of `plumbob.estimate`.

    Returns
    -------
    Path
        Where it is.

    Raises
    ------
    ParameterError, ShapeError
        If the figure is not known, nothing of the recording can be drawn in it, or the file's name has another ending.
    MissingExtraError
        If matplotlib is not installed.
    """
    target = check.path("out", out)
    picture_kind(target)
    check.one_of("figure", what, WHATS)
    window = (units.given("begin", begin, Quantity.TIME), units.given("end", end, Quantity.TIME))
    low, high = (-math.inf if window[0] is None else window[0], math.inf if window[1] is None else window[1])
    inches = _inches(units.given("width", width, Quantity.LENGTH))
    gatherer = make_gatherer(burst=burst, tilt_limit=tilt_limit, window=(low, high))
    source = file if isinstance(file, Recording | ImuData) else check.path("file", file)
    subject = read_subject(source, gatherer, how, graded=False, note=note, progress=progress)  # type: ignore[arg-type]
    return picture(target, [figure(subject, what)], lang=lang, overwrite=overwrite, width=inches)


def _inches(width: float | None) -> float | None:
    """Width of a picture, m, in inches."""
    if width is None:
        return None
    if not _WIDTHS[0] <= width <= _WIDTHS[1]:
        raise ParameterError(
            f"the width of a picture must be {1e3 * _WIDTHS[0]:g} to {1e3 * _WIDTHS[1]:g} mm, but it is "
            f"{1e3 * width:g} mm. Give one in between, as 85mm."
        )
    return width / 0.0254
