"""The page of recordings: one HTML file with plots that are zoomed and read, which opens anywhere; and as a PDF.

One constant script draws them, which the page's policy names by its hash; nothing asks for a network. Values stand in
blocks of 16-bit codes. The PDF is printed by Chromium or Chrome without a window.
"""

import math
import os
import shutil
import subprocess
from base64 import b64encode
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.errors import DecodeError, MissingExtraError, excerpt
from plumbob.core.files import replacing
from plumbob.core.resources import asset
from plumbob.core.time import GAP_FACTOR
from plumbob.core.units import to_deg
from plumbob.overview.figures import SECTORS, Chart, charts, shown_values
from plumbob.overview.report_entry import Subject
from plumbob.overview.streaming_stats import Gathered
from plumbob.overview.tables import (
    BARE,
    burst_table,
    comparison_table,
    flag_table,
    grade_table,
    heading_table,
    inclination_table,
    motion_table,
    quality_table,
    remarks,
    sector_table,
    sensor_table,
    threshold_table,
)
from plumbob.quality import quality
from plumbob.quality.tilt import Headings
from plumbob.reporting.content import said
from plumbob.reporting.page import CSS, asset_text, render

_NONE: Final = -32768
_CODES: Final = 65534
"""Steps that the range of a channel is divided in."""
_LONG: Final = 12  # bursts whose table is not folded away
_EVEN: Final = 1e-6  # s that times may depart from even ones and be written as such
_CHANNEL: Final = {"gyr": "Gyroscope", "acc": "Accelerometer", "mag": "Magnetometer", "temp": "Temperature",
                   "attitude": "Attitude"}  # fmt: skip

Block = tuple[str, Any]
"""Kind of a part of a section, as the template has it, and what is in it."""


def page(subjects: Sequence[Subject], title: str, definitions: Sequence[str], *, lang: str = "en") -> str:
    """HTML of the page; any text in it is safe.

    Raises
    ------
    MissingExtraError
        If the pages of Plumbob are not built here.
    """
    script = asset("report.js").read_text(encoding="utf-8").replace("</script", "<\\/script")
    style = CSS + asset_text("recordings.css") + asset("report.css").read_text(encoding="utf-8")
    values: dict[str, str] = {}
    data, recordings = [], []
    for number, subject in enumerate(subjects):
        plots = [_in_language(chart, lang) for chart in charts(subject.gathered) if chart.on_page]
        data.append(_data(subject, plots, f"v{number}", values))
        lines = [line for line in remarks(subject) if line != BARE]
        sections = list(_sections(subject, plots, number))
        loud = "" if subject.calibrated else BARE
        recordings.append(
            {"name": subject.name, "facts": subject.facts, "loud": loud, "remarks": lines, "sections": sections}
        )
    words = {"time": said("time [s]", lang), "clock": said("time [h:min:s]", lang), "utc": said("UTC", lang)}
    return render(
        "recordings.html.j2",
        lang,
        style,
        [script],
        title=title,
        names=", ".join(subject.name for subject in subjects),
        beside=comparison_table(subjects) if len(subjects) > 1 else None,
        recordings=recordings,
        definitions=definitions,
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
        tilt = [("table", motion_table(g.tilt.roll, g.tilt.pitch)), ("table", inclination_table(g.tilt.inclination))]
        table = burst_table(subject)
        is_long = len(table.rows) > _LONG
        bursts = [("folded", table) if is_long else ("table", replace(table, title=""))]
    yield "Tilt and heading", tilt + ([("rose", _rose(g.headings))] if g.headings and g.headings.samples else [])
    hint: list[Block] = [("hint", number)] if g.tilt is not None else []
    yield "Attitude", hint + drawn("roll", "pitch", "heading", "tilt")
    yield "Spectra", drawn("angles", "heading rate", "vertical acceleration")
    yield "Bursts", drawn("bursts", "burst tilt") + bursts
    sensors = drawn("rates", "forces", "field", "temperature", "bias")
    if g.triads or g.has("temp"):
        sensors.append(("table", replace(sensor_table(g), title="")))
    yield "Sensors", sensors
    yield "Gaps and flags", [*drawn("flags"), ("table", replace(flag_table(g), title=""))]
    grade: list[Block] = [] if subject.grade is None else [("table", grade_table(subject.grade))]
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
        yield "folded", quality_table(subject)
        yield "folded", threshold_table()


def _rose(headings: Headings) -> dict[str, Any]:
    """Shares of the sectors, per cent, the end of their scale, and the mean vector, degrees."""
    share = 100.0 * headings.sectors(SECTORS)
    power = 10.0 ** math.floor(math.log10(max(share.max(), 1e-3)))
    top = next(step * power for step in (1.0, 2.0, 4.0, 5.0, 8.0, 10.0) if step * power >= share.max() * (1.0 - 1e-9))
    return {
        "share": share.tolist(), "top": top, "mean": to_deg(headings.mean), "resultant": headings.resultant,
        "table": heading_table(headings), "sectors": sector_table(headings),
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


BROWSERS: Final = (
    "chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge", "microsoft-edge",
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
    "C:/Program Files/Google/Chrome/Application/chrome.exe",
    "C:/Program Files (x86)/Microsoft/Edge/Application/msedge.exe",
)  # fmt: skip
"""Programs that print a page, the first one found is taken."""

_PATIENCE: Final = 180.0  # s


def browser() -> str:
    """Path of a program that prints pages.

    Raises
    ------
    MissingExtraError
        If none is installed.
    """
    program = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if program is None:
        raise MissingExtraError(
            "a PDF is printed by Chromium or Chrome, and none was found. Install one, as 'apt install chromium' does, "
            "or write the page with --out and print it from your browser."
        )
    return program


def print_pdf(page: str, path: Path, *, overwrite: bool = False) -> Path:
    """Print a page to a file, which is there as a whole or not at all.

    Raises
    ------
    MissingExtraError
        If no browser is installed.
    DecodeError
        If the browser fails.
    """
    program = browser()
    with TemporaryDirectory(prefix="plumbob-") as folder, replacing(path, overwrite=overwrite) as temporary:
        html, made = Path(folder) / "page.html", Path(folder) / "page.pdf"
        html.write_text(page, encoding="utf-8")
        words = [program, "--headless", "--disable-gpu", "--disable-extensions", f"--user-data-dir={folder}/profile",
                 "--no-first-run", "--no-pdf-header-footer", "--virtual-time-budget=20000",
                 f"--print-to-pdf={made}"]  # fmt: skip
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            words.append("--no-sandbox")  # Chromium refuses its sandbox to the superuser
        try:
            done = subprocess.run(
                [*words, html.as_uri()],
                capture_output=True,
                text=True,
                errors="replace",
                timeout=_PATIENCE,
                check=False,
            )
        except subprocess.TimeoutExpired as error:
            raise DecodeError(
                f"{program} did not print the page within {_PATIENCE:g} s. Write the page with --out instead."
            ) from error
        if not made.is_file():
            raise DecodeError(f"{program} printed nothing ({excerpt(done.stderr.strip() or 'without a word', 160)}).")
        shutil.copyfile(made, temporary)
    return path
