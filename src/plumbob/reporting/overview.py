"""The page of recordings: one HTML file with plots that are zoomed and read, which opens anywhere; and single figures.

One constant script draws them, which the page's policy names by its hash; nothing asks for a network. Values stand in
blocks of 16-bit codes.
"""

import math
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from plumbob.core import check, units
from plumbob.core.errors import ParameterError
from plumbob.core.resources import asset
from plumbob.core.result import Reported
from plumbob.core.time import GAP_FACTOR
from plumbob.core.units import Quantity, to_deg
from plumbob.data import ImuData
from plumbob.data.recording import Recording
from plumbob.overview.report_entry import Progress, Subject, duration, read_subject, subject_from
from plumbob.overview.streaming_stats import WHOLE, Gatherer
from plumbob.quality import quality
from plumbob.quality.grade import grade
from plumbob.quality.waves import WaveSettings
from plumbob.reporting import overview_tables as tables
from plumbob.reporting.content import Figure, said
from plumbob.reporting.drawing import inches, picture, picture_kind
from plumbob.reporting.overview_figures import SECTORS, WHATS, charts, figure, figures, shown_values
from plumbob.reporting.page import CSS, asset_text, render
from plumbob.reporting.report import Report
from plumbob.rotations import Frame

if TYPE_CHECKING:
    from plumbob.data.cards import CalibrationCard, NoiseCard
    from plumbob.door.estimate import Estimated

TITLE: Final = "Attitude report"
_NONE: Final = -32768
_CODES: Final = 65534  # steps that the range of a channel is divided in
_LONG: Final = 12  # bursts whose table is not folded away
_EVEN: Final = 1e-6  # s that times may depart from even ones and be written as such
_CHANNEL: Final = {"gyr": "Gyroscope", "acc": "Accelerometer", "mag": "Magnetometer", "temp": "Temperature",
                   "attitude": "Attitude"}  # fmt: skip
_SECTIONS: Final = {  # of a recording, and the tables, plots and others that stand in them
    "Tilt and heading": ("motion", "inclination", "rose"),
    "Attitude": ("hint", "roll", "pitch", "heading", "tilt"),
    "Spectra": ("angles", "heading rate", "vertical acceleration"),
    "Waves": ("wave spectrum", "wave height", "wave period", "wave direction", "wave table"),
    "Bursts": ("bursts", "burst tilt", "burst table"),
    "Sensors": ("rates", "forces", "field", "temperature", "bias", "sensors"),
    "Gaps and flags": ("flags", "gaps"),
    "Quality": ("grade", "grid", "quality", "thresholds"),
}

Source = str | PathLike[str] | Recording | ImuData
Block = tuple[str, Any]  # kind of a part of a section, as the template has it, and what is in it


@dataclass(frozen=True, eq=False, repr=False)
class Overview(Reported):
    """Recordings, each with its statistics and traces, in the order in which they were given."""

    subjects: tuple[Subject, ...]

    def facts(self) -> Mapping[str, str]:
        """Recordings, and the first one's tilt."""
        g = self.subjects[0].gathered
        facts = {"recordings": ", ".join(subject.name for subject in self.subjects), "duration": duration(g.duration)}
        if g.tilt is not None:
            facts["roll"] = f"std {to_deg(g.tilt.roll.sd):.2f}°"
            facts["pitch"] = f"std {to_deg(g.tilt.pitch.sd):.2f}°"
        return facts

    def summary(self) -> dict[str, Any]:
        """All numbers, as JSON can hold them."""
        return {"recordings": [subject.summary() for subject in self.subjects]}

    def report(self, *_: Any, **_about: Any) -> Report:
        """Description, with figures for a paper."""
        definitions = tables.definitions(self.subjects)
        parts = [
            RecordingsReport(
                subject.name, facts=subject.facts, tables=list(tables.tables(subject).values()),
                remarks=tables.remarks(subject), figures=partial(_drawings, subject), subjects=(subject,),
            )
            for subject in self.subjects
        ]  # fmt: skip
        if len(parts) == 1:
            return replace(parts[0], title=TITLE, definitions=definitions)
        beside = [tables.comparison_table(self.subjects)]
        return RecordingsReport(TITLE, tables=beside, parts=parts, definitions=definitions, subjects=self.subjects)


def _drawings(subject: Subject) -> list[Figure]:
    return list(figures(subject).values())


def report(
    files: Source | Sequence[Source],
    *,
    filter: str | None = None,
    causal: bool = False,
    lag: float | str | None = None,
    params: Mapping[str, Any] | None = None,
    frame: Frame | str | None = None,
    init: str | None = None,
    calibration: "CalibrationCard | str | Path | None" = None,
    noise: "NoiseCard | str | Path | None" = None,
    place: str | None = None,
    date: str | None = None,
    profile: str | Path | None = None,
    unit: str | None = None,
    burst: float | str = "20 min",
    tilt_limit: float | str = "15 deg",
    waves: bool = False,
    out: str | Path | None = None,
    pdf: str | Path | None = None,
    lang: str = "en",
    overwrite: bool = False,
    note: Callable[[str], object] | None = None,
    progress: Progress | None = None,
) -> Overview:
    """Say on one page what recordings hold: attitude with its statistics, sensors, spectra, gaps and quality.

    Parameters
    ----------
    files : path, Recording or ImuData, or a sequence of them
        Recordings of any format that `plumbob.read` takes. Several: a part for each, and a table beside each other.
    filter : str, optional
        As of `plumbob.estimate`, by default "smoother"; "track": the attitude that the file holds, of a recorded stream
        what was estimated live; "none": no attitude. A file that holds only an attitude is taken as it is.
    causal, lag, params, frame, init, calibration, noise, place, date, profile, unit : optional
        As of `plumbob.estimate`. Without `calibration`, a recorded stream takes the card of its session.
    burst : float or str
        Length of a burst, s, or text with a unit; statistics are given for each.
    tilt_limit : float or str
        Inclination that counts as large, rad, or text with a unit.
    waves : bool
        Whether sea states are computed, of recordings of something that floats; see `plumbob.waves`.
    out : path, optional
        Where to write the page, HTML.
    pdf : path, optional
        Where to write it as a PDF, which Chromium or Chrome prints.
    lang : {"en", "zh"}
        Language of the labels.
    overwrite : bool
        Whether files that lie there may be replaced.
    note : callable, optional
        Called with each remark as it is found.
    progress : callable, optional
        Called with the name of a recording, the number of its samples done, and of all.

    Returns
    -------
    Overview
        Its `text`, `summary`, `write_html`, `write_pdf` and `plot` give the same again.

    Raises
    ------
    ParameterError
        If an option is not known, two of them contradict each other, or the file lacks the attitude that was asked for.
    ShapeError, FrameError, CalibrationError, DecodeError
        As of `plumbob.estimate`.
    MissingExtraError
        If a page is asked for and those of Plumbob are not built, or a PDF and neither Chromium nor Chrome is there.
    """
    given = list(files) if isinstance(files, list | tuple) else [files]
    if not given:
        raise ParameterError("a report needs a recording, but none was given. Name one.")
    how = {
        "filter": filter, "causal": causal, "lag": lag, "params": params, "frame": frame, "init": init,
        "calibration": calibration, "noise": noise, "place": place, "date": date, "profile": profile, "unit": unit,
    }  # fmt: skip
    most = max(2, WHOLE // len(given))
    subjects = []
    for file in given:
        gatherer = make_gatherer(burst=burst, tilt_limit=tilt_limit, most=most, waves=waves)
        source = file if isinstance(file, Recording | ImuData) else check.path("files", file)
        subjects.append(read_subject(source, gatherer, how, note=note, progress=progress))  # type: ignore[arg-type]
    made = Overview(tuple(subjects))
    if out is not None:
        made.write_html(out, lang=lang, overwrite=overwrite)
    if pdf is not None:
        made.write_pdf(pdf, lang=lang, overwrite=overwrite)
    return made


def make_gatherer(
    *,
    burst: float | str = "20 min",
    tilt_limit: float | str = "15 deg",
    most: int = WHOLE,
    waves: bool | WaveSettings = False,
    **more: Any,
) -> Gatherer:
    """Gatherer with options that may be text with a unit."""
    length = units.given("burst", burst, Quantity.TIME)
    limit = units.given("tilt_limit", tilt_limit, Quantity.ANGLE)
    assert length is not None and limit is not None
    for name, value in (("burst", length), ("tilt_limit", limit)):
        if not 0.0 < value < math.inf:
            raise ParameterError(f"{name} must be above 0, but it is {value:g}. Give a positive one.")
    if limit >= math.pi:
        raise ParameterError(f"tilt_limit must be below 180°, but it is {to_deg(limit):g}°. Give a smaller one.")
    settings = (WaveSettings() if waves else None) if isinstance(waves, bool) else waves
    return Gatherer(burst=length, limit=limit, most=most, waves=settings, **more)


def of_estimate(result: "Estimated", gatherer: Gatherer, file: str | Path) -> Overview:
    """Overview of an estimate that a gatherer has followed; graded by the samples as the filter was given them."""
    graded = grade(result.imu, result.inferred)
    return Overview((subject_from(result, gatherer, (Path(file),), graded=graded),))


@dataclass(frozen=True)
class RecordingsReport(Report):
    """Description of recordings, with a page of its own: `subjects` are their statistics and traces."""

    subjects: Sequence[Subject] = ()

    def page(self, *, lang: str = "en") -> str:
        """HTML of the page, self-contained; MissingExtraError where the pages of Plumbob are not built here."""
        style = CSS + asset_text("recordings.css") + asset("report.css").read_text(encoding="utf-8")
        values: dict[str, str] = {}
        data, recordings = [], []
        for number, subject in enumerate(self.subjects):
            plots = []
            for chart in (chart for chart in charts(subject.gathered) if chart.on_page):
                rows = {
                    key: [part | {"label": said(part["label"], lang)} for part in chart.spec.get(key, ())]
                    for key in ("lines", "rows")
                }
                unit = chart.label.partition(" [")[2].rstrip("]")
                plots.append(chart.spec | rows | {"caption": said(chart.spec["caption"], lang), "unit": unit})
            data.append(_data(subject, plots, f"v{number}", values))
            recordings.append({
                "name": subject.name, "facts": subject.facts, "loud": "" if subject.calibrated else tables.BARE,
                "remarks": [line for line in tables.remarks(subject) if line != tables.BARE],
                "sections": _sections(subject, plots, number),
            })  # fmt: skip
        words = {"time": said("time [s]", lang), "clock": said("time [h:min:s]", lang), "utc": said("UTC", lang)}
        return render(
            "recordings.html.j2", lang, style,
            [asset("report.js").read_text(encoding="utf-8").replace("</script", "<\\/script")],
            title=self.title, names=", ".join(subject.name for subject in self.subjects),
            beside=self.tables[0] if self.parts else None, recordings=recordings, definitions=self.definitions,
            data={"subjects": data, "words": words}, values=values,
        )  # fmt: skip


def _sections(subject: Subject, plots: Sequence[dict[str, Any]], number: int) -> list[tuple[str, list[Block]]]:
    """Titles of the sections of a recording, and what it has for each."""
    g, made = subject.gathered, tables.tables(subject)
    blocks: dict[str, Block] = {plot["name"]: ("chart", (plot, f"{number}.{i}")) for i, plot in enumerate(plots)}
    if g.tilt is not None:
        blocks["hint"] = ("hint", number)
    if g.headings is not None and g.headings.samples:
        share = 100.0 * g.headings.sectors(SECTORS)
        power = 10.0 ** math.floor(math.log10(max(share.max(), 1e-3)))
        ends = (step * power for step in (1.0, 2.0, 4.0, 5.0, 8.0, 10.0))
        blocks["rose"] = "rose", {  # shares of the sectors, per cent, the end of their scale, and the mean vector
            "share": share.tolist(), "top": next(end for end in ends if end >= share.max() * (1.0 - 1e-9)),
            "mean": to_deg(g.headings.mean), "resultant": g.headings.resultant,
            "table": made["headings"], "sectors": made["sectors"],
        }  # fmt: skip
    if "quality" in made:
        rows = []
        for name in made["quality"].head[1:]:
            cells = []  # one for each burst
            for burst in g.bursts:
                verdict = burst.verdicts.get(name, quality.BurstVerdict(quality.MISSING))
                why = f" ({verdict.why})" if verdict.why else ""
                begin = subject.utc(burst.begin) or f"{burst.begin:g} s"
                words = f"{begin}: {quality.MEANING[verdict.flag]}, {100.0 * verdict.good:.1f} % good{why}"
                cells.append((verdict.flag, words))
            rows.append((_CHANNEL[name], cells))
        blocks["grid"] = "grid", {"rows": rows, "meaning": list(quality.MEANING.items())}
    for name, table in made.items():
        is_long = name in ("quality", "thresholds") or (
            name in ("burst table", "wave table") and len(table.rows) > _LONG
        )
        is_alone = name in ("sensors", "gaps", "burst table", "wave table")  # in a section that has its title
        blocks[name] = ("folded" if is_long else "untitled" if is_alone else "table", table)
    return [(title, [blocks[name] for name in names if name in blocks]) for title, names in _SECTIONS.items()]


def _data(subject: Subject, plots: list[dict[str, Any]], name: str, values: dict[str, str]) -> dict[str, Any]:
    """What the script is given of a recording; blocks of values are added to `values`."""
    g, t = subject.gathered, subject.gathered.traces.t
    step = float(t[-1] - t[0]) / (t.size - 1) if t.size > 1 else 1.0
    times: dict[str, Any] = {"first": float(t[0]), "step": step}
    if float(np.max(np.abs(t - t[0] - step * np.arange(t.size)))) > _EVEN:
        values[f"{name}t"] = b64encode(t.astype("<f8").tobytes()).decode()
        times = {"block": f"{name}t"}
    channels = {}
    lines = [line for plot in plots for line in plot["lines"]]
    for i, channel in enumerate(dict.fromkeys(line[key] for line in lines for key in ("channel", "sd") if key in line)):
        y = shown_values(g, channel)
        finite = np.isfinite(y)
        low, high = (float(y[finite].min()), float(y[finite].max())) if finite.any() else (0.0, 0.0)
        step, middle = (high - low) / _CODES or 1e-9, 0.5 * (low + high)
        codes = np.full(y.size, _NONE, dtype="<i2")
        codes[finite] = np.clip(np.rint((y[finite] - middle) / step), -_CODES // 2, _CODES // 2).astype("<i2")
        values[f"{name}{i}"] = b64encode(codes.tobytes()).decode()
        at = t[finite]
        usual = float(np.median(np.diff(at))) if at.size > 1 else g.step
        hold = max(GAP_FACTOR * usual, 1.01 * g.traces.each * g.step)
        channels[channel] = {"block": f"{name}{i}", "low": middle, "step": step, "hold": hold}
    return {
        "rows": int(t.size),
        "t": times,
        "breaks": np.flatnonzero(~np.isfinite(g.traces.values).any(axis=1)).tolist(),
        "begin": g.begin, "end": g.end,
        "epoch": subject.t0_ns / 1e9 if subject.t0_ns else None,
        "channels": channels,
        "charts": plots,
    }  # fmt: skip


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
        One of "angles", "tilt", "rates", "forces", "field", "temperature", "bias", "sd", "spectrum", "rose", "bursts",
        "flags" and, of something that floats, "waves", "wavespectrum" and "waverose".
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
    first, last = units.given("begin", begin, Quantity.TIME), units.given("end", end, Quantity.TIME)
    window = (-math.inf if first is None else first, math.inf if last is None else last)
    size = inches(width)
    gatherer = make_gatherer(burst=burst, tilt_limit=tilt_limit, window=window, waves=what.startswith("wave"))
    source = file if isinstance(file, Recording | ImuData) else check.path("file", file)
    subject = read_subject(source, gatherer, how, graded=False, note=note, progress=progress)  # type: ignore[arg-type]
    return picture(target, [figure(subject, what)], lang=lang, overwrite=overwrite, width=size)
