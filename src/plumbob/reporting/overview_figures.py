"""Plots of a recording: values over time, spectra, bursts and flags; for the script of the page, and as pictures."""

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.core.time import GAP_FACTOR
from plumbob.core.units import to_deg
from plumbob.overview.report_entry import Subject
from plumbob.overview.streaming_stats import SHOWN_SCALE, SPECTRAL, SPECTRAL_UNITS, TRACED, Gathered
from plumbob.quality.tilt import Headings
from plumbob.quality.waves import LONGEST_WAVES
from plumbob.reporting.content import COLOURS, SERIES, Figure
from plumbob.reporting.drawing import PlotLine, PlotPanel, draw_panels
from plumbob.reporting.overview_tables import heading_circle

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

COLUMNS: Final = 1500
FAINT: Final = 1e-4  # of the highest density of waves: what is less, at high frequencies, is not drawn
SECTORS: Final = 36
_CAPTIONS: Final = {  # captions and heights of pictures
    "angles": ("Roll, pitch and heading", 4.2), "tilt": ("Inclination from the vertical", 2.2),
    "rates": ("Angular rate", 3.6), "forces": ("Specific force", 3.6), "field": ("Magnetic flux density", 3.6),
    "temperature": ("Temperature", 2.0), "bias": ("Estimated gyroscope bias", 3.6),
    "sd": ("Claimed standard deviation", 2.4), "spectrum": ("Power spectral density", 4.2),
    "waves": ("Waves by burst", 5.6), "wavespectrum": ("Wave spectrum, with its band of 95 %", 3.2),
    "waverose": ("Share of the waves' energy by the direction that they come from", 4.2),
    "rose": ("Share of time by heading, sectors of 10°", 4.2), "bursts": ("Bursts", 4.0),
    "flags": ("Flags over time", 1.1),
}  # fmt: skip
WHATS: Final = tuple(_CAPTIONS)  # all names of figures


_XYZ: Final = tuple(zip("xyz", COLOURS, strict=False))
# Picture, name on the page, caption where it is another than that of the picture, label, and lines with channels.
_TIMED: Final = (
    ("angles", "roll", "Roll", "roll [°]", (("roll", "roll", "blue"),)),
    ("angles", "pitch", "Pitch", "pitch [°]", (("pitch", "pitch", "blue"),)),
    ("angles", "heading", "Heading", "heading [°]", (("heading", "heading", "blue"),)),
    ("tilt", "tilt", "", "inclination [°]", (("inclination", "tilt", "blue"),)),
    ("rates", "rates", "", "rate {} [°/s]", tuple((axis, f"gyr_{axis}", colour) for axis, colour in _XYZ)),
    ("forces", "forces", "", "force {} [m/s²]", tuple((axis, f"acc_{axis}", colour) for axis, colour in _XYZ)),
    ("field", "field", "", "field {} [µT]", tuple((axis, f"mag_{axis}", colour) for axis, colour in _XYZ)),
    ("temperature", "temperature", "", "temperature [°C]", (("temperature", "temp", "blue"),)),
    ("bias", "bias", "", "bias {} [°/s]", tuple((axis, f"bias_{axis}", colour) for axis, colour in _XYZ)),
    ("sd", "", "", "1 sd [°]", tuple((angle, f"{angle}_sd", colour) for angle, colour in zip(
        ("roll", "pitch", "heading"), COLOURS, strict=False))),
)  # fmt: skip
_SPECTRA: Final = (
    ("angles", "roll and pitch", "roll, pitch", ("roll", "pitch")),
    ("heading rate", "the heading rate", "heading rate", ("heading_rate",)),
    ("vertical acceleration", "the vertical acceleration", "vertical acceleration", ("vertical",)),
)


class Chart(NamedTuple):
    """A plot, as a panel of a picture and on the page."""

    what: str  # name of the picture
    # of its axis there, with the unit; with a place for the name of a line, each line has a panel of its own
    label: str
    # what the script of the page takes, but for the unit; its kind is "time", "spectrum", "points" or "flags"
    spec: dict[str, Any]
    on_page: bool = True  # whether the page has it


def charts(g: Gathered) -> Iterator[Chart]:
    """Plots that a recording has values for."""
    more: dict[str, dict[str, Any]] = {}
    if g.tilt is not None:
        limit, greatest = to_deg(g.tilt.inclination.limit), to_deg(g.tilt.inclination.greatest)
        more = {
            "roll": {"period": (-180.0, 180.0)}, "pitch": {},
            "heading": {"period": heading_circle(g), "compass": True},
            "tilt": {"floor": 0.0} | ({"limit": limit} if limit <= 2.0 * greatest else {}),
        }  # fmt: skip
    for what, name, caption, label, traces in _TIMED:
        if name in more or g.has(traces[0][1]):
            lines = [{"label": text, "colour": colour, "channel": channel} for text, channel, colour in traces]
            if what == "angles" and g.has(f"{name}_sd"):
                lines[0]["sd"] = f"{name}_sd"
            spec: dict[str, Any] = {
                "name": name,
                "caption": caption or _CAPTIONS[what][0],
                "kind": "time",
                "lines": lines,
            }
            yield Chart(what, label, spec | more.get(name, {}), on_page=bool(name))
    if g.spectra is not None:
        frequency, density = g.spectra.gathered()
        x = [float(f"{f:.5g}") for f in frequency]
        for name, subject, label, channels in _SPECTRA:
            values = {channel: density[:, SPECTRAL.index(channel)] * SHOWN_SCALE[channel] ** 2 for channel in channels}
            densities: list[dict[str, Any]] = [
                {"label": channel.replace("_", " "), "colour": colour, "y": _digits(y)}
                for (channel, y), colour in zip(values.items(), COLOURS, strict=False)
                if np.isfinite(y).any()
            ]
            spec = {"name": name, "caption": f"Power spectral density of {subject}", "kind": "spectrum",
                    "lines": densities, "x": x, "xlabel": "f [Hz]"}  # fmt: skip
            yield Chart("spectrum", f"{label} [{SPECTRAL_UNITS[channels[0]]}]", spec, on_page=bool(densities))
    if g.tilt is not None:
        yield from _bursts(g)
        yield from _seas(g)
    rows = [("gaps", g.gaps, "red")]
    others = ((name, runs) for name, runs in g.flags.items() if name != "gap")
    rows += [(name, runs.stretches, "soft" if runs.coarse else "blue") for name, runs in others]
    flags = [
        {"label": name, "colour": colour, "runs": [[round(begin, 3), round(end, 3)] for begin, end in stretches]}
        for name, stretches, colour in rows
    ]
    yield Chart("flags", "", {"name": "flags", "caption": _CAPTIONS["flags"][0], "kind": "flags", "rows": flags})


def _digits(values: Floats) -> list[float | None]:
    """Five digits of each; None where not known or not above zero."""
    return [float(f"{v:.5g}") if math.isfinite(v) and v > 0.0 else None for v in values.tolist()]


def _bursts(g: Gathered) -> Iterator[Chart]:
    x = [round(0.5 * (burst.begin + burst.end), 3) for burst in g.bursts]
    tilts = [burst.tilt for burst in g.bursts]
    angles = [(t.roll.significant, t.pitch.significant, t.inclination.mean, t.inclination.greatest) for t in tilts]
    columns = [*np.degrees(angles).T, *np.array([(t.roll.tz, t.pitch.tz) for t in tilts]).T]
    for name, caption, label, drawn in (
        ("bursts", "Significant double amplitude by burst", "significant [°]",
         (("roll", "blue", 0), ("pitch", "red", 1))),
        ("", "Tz", "Tz [s]", (("roll", "blue", 4), ("pitch", "red", 5))),
        ("burst tilt", "Inclination by burst", "mean, greatest [°]", (("mean", "green", 2), ("greatest", "green", 3))),
    ):  # fmt: skip
        lines = [
            {"label": text, "colour": colour, "y": _digits(columns[k])} | ({"dash": True} if k == 3 else {})
            for text, colour, k in drawn
        ]
        spec = {"name": name, "caption": caption, "kind": "points", "lines": lines, "x": x, "floor": 0.0}
        yield Chart("bursts", label, spec, on_page=bool(name) and len(x) > 1)


def _seas(g: Gathered) -> Iterator[Chart]:
    """Spectrum of the waves, a mean of the bursts, with the band of one; and height, periods and direction by burst."""
    pairs = [(round(0.5 * (burst.begin + burst.end), 3), sea) for burst in g.bursts
             if (sea := burst.waves) is not None and np.isfinite(sea.hm0)]  # fmt: skip
    if not pairs:
        return
    at, states = zip(*pairs, strict=True)
    density = np.nanmean([np.nan_to_num(sea.density) for sea in states], axis=0)
    f, (below, above) = states[0].frequency, states[0].band
    top = max(float(density.max()), np.finfo(float).tiny)
    drawn = (f >= LONGEST_WAVES) & (f <= f[density > FAINT * top][-1])
    x = [float(f"{value:.5g}") for value in f[drawn]]
    lines: list[dict[str, Any]] = [
        {"label": text, "colour": "blue", "y": _digits(factor * density[drawn])} | ({"dash": True} if i else {})
        for i, (text, factor) in enumerate((("E(f)", 1.0), ("95 % low", below), ("95 % high", above)))
    ]
    spectrum = {"name": "wave spectrum", "caption": _CAPTIONS["wavespectrum"][0], "kind": "spectrum", "lines": lines,
                "x": x, "xlabel": "f [Hz]"}  # fmt: skip
    yield Chart("wavespectrum", "E(f) [m²/Hz]", spectrum)
    for name, caption, label, values in (
        ("wave height", "Significant wave height by burst, with its band of 95 %", "Hm0 [m]",
         [("Hm0", "blue", "hm0", ""), *((f"95 % {end}", "blue", f"hm0_{end}", "dash") for end in ("low", "high"))]),
        ("wave period", "Wave periods by burst", "period [s]", [("Tp", "red", "tp", ""), ("Tm02", "blue", "tm02", "")]),
        ("wave direction", "Direction that waves come from, by burst", "direction from [°]",
         [("mean", "green", "direction", "")]),
    ):  # fmt: skip
        scale = float(to_deg(1.0)) if name == "wave direction" else 1.0
        lines = [
            {"label": text, "colour": colour, "y": _digits(scale * np.array([getattr(sea, key) for sea in states]))}
            | ({"dash": True} if dash else {})
            for text, colour, key, dash in values
        ]
        if any(y is not None for line in lines for y in line["y"]):
            points: dict[str, Any] = {"name": name, "caption": caption, "kind": "points", "lines": lines, "x": [*at]}
            points |= {"period": (0.0, 360.0), "compass": True} if scale > 1.0 else {"floor": 0.0}
            yield Chart("waves", label, points, on_page=len(at) > 1)


def _wave_headings(g: Gathered) -> Headings | None:
    """Energy of all waves, in parts of 1e-4, by the direction that each frequency of each burst comes from."""
    parts = [(sea.density, np.arctan2(sea.b1, sea.a1)) for burst in g.bursts if (sea := burst.waves) is not None]
    energy = np.concatenate([part[0] for part in parts]) if parts else np.empty(0)
    angle = np.concatenate([part[1] for part in parts]) if parts else np.empty(0)
    usable = (energy > 0.0) & np.isfinite(angle)
    share = np.rint(1e4 * energy[usable] / max(float(energy[usable].sum()), np.finfo(float).tiny)).astype(np.int64)
    return Headings.of(np.repeat(angle[usable], share)) if share.any() else None


def shown_values(g: Gathered, channel: str) -> Floats:
    """Values (M,) of a channel in the unit that is shown; headings on the circle of `heading_circle`."""
    values = g.traces.values[:, TRACED.index(channel)].astype(np.float64) * SHOWN_SCALE[channel]
    start = heading_circle(g)[0]
    return (values - start) % 360.0 + start if channel == "heading" else values


# --- as pictures ------------------------------------------------------------------------------------------------------


def figures(subject: Subject) -> dict[str, Figure]:
    """Figures by the names that ``plumbob report --figure`` takes, as far as the recording has something for them."""
    g = subject.gathered
    panels: dict[str, list[Chart]] = {}
    for chart in charts(g):
        panels.setdefault(chart.what, []).append(chart)
    drawings = {}
    for what, (caption, height) in _CAPTIONS.items():
        if what == "rose" and g.headings is not None and g.headings.samples:
            drawings[what] = Figure(caption, partial(_draw_rose, g.headings), height=height)
        elif what == "waverose" and (waves := _wave_headings(g)) is not None:
            drawings[what] = Figure(caption, partial(_draw_rose, waves), height=height)
        elif what in panels:
            key = [
                (line["label"], COLOURS[line["colour"]], "dashed" if "dash" in line else "solid")
                for chart in panels[what] for line in chart.spec.get("lines", ()) if len(chart.spec["lines"]) > 1
            ]  # fmt: skip
            if what == "angles" and g.has("roll_sd"):
                key = [("estimate", SERIES[0], "solid"), ("claimed ± 1 sd", SERIES[5], "block")]
            if "limit" in panels[what][0].spec:
                key = [("limit", SERIES[1], "dashed")]
            more = 0.22 * len(g.flags) if what == "flags" else 0.0
            draw = partial(draw_panels, partial(_panels, g, panels[what]))
            drawings[what] = Figure(caption, draw, list(dict.fromkeys(key)), height + more)
    return drawings


def figure(subject: Subject, what: str) -> Figure:
    """One figure by its name of `WHATS`."""
    drawings = figures(subject)
    if what not in drawings:
        raise ParameterError(f"{subject.name} has nothing to draw for '{what}'. It has {', '.join(drawings)}.")
    return drawings[what]


def _panels(g: Gathered, drawn: Sequence[Chart]) -> list[PlotPanel]:
    """What is drawn of plots, those with a place for the name of a line as a panel for each."""
    ends, least = (g.begin, max(g.end, g.begin + g.step)), g.duration / COLUMNS  # of one sample, a step behind it
    panels = []
    for _, label, spec, _ in drawn:
        if spec["kind"] == "flags":
            bars = [(row["label"], COLOURS[row["colour"]], [(begin, max(end, begin + least)) for begin, end in
                     row["runs"]]) for row in spec["rows"]]  # fmt: skip
            return [PlotPanel("", x=ends, bars=bars)]
        lines = [(line["label"], _line(g, spec, line)) for line in spec["lines"]]
        if spec["kind"] == "spectrum":
            panels.append(PlotPanel(label, [line for _, line in lines], "frequency [Hz]", log=True,
                                x=(spec["x"][0], spec["x"][-1]), columns=COLUMNS))  # fmt: skip
            continue
        how: Any = {
            "x": ends, "y": (spec.get("floor"), None), "compass": "compass" in spec, "columns": COLUMNS,
            "circle": spec["period"] if "compass" in spec else None,
            "levels": [spec["limit"]] if "limit" in spec else [],
        }  # fmt: skip
        split = [(label.format(name), [line]) for name, line in lines] if "{}" in label else []
        panels += [PlotPanel(*part, **how) for part in split or [(label, [line for _, line in lines])]]
    return panels


def _line(g: Gathered, spec: Mapping[str, Any], line: Mapping[str, Any]) -> PlotLine:
    """Values over the whole; of a channel over time with a band of ± one claimed standard deviation, where it has."""
    colour, kind = COLOURS[line["colour"]], spec["kind"]
    if kind != "time":
        dash, mark = "dashed" if "dash" in line else "solid", "o" if kind == "points" else ""
        return PlotLine(np.array(spec["x"]), np.array(line["y"], dtype=float), colour, dash, mark=mark)
    t, y = g.traces.t, shown_values(g, line["channel"])
    steps = np.diff(t[np.isfinite(y)])
    gap = max(
        GAP_FACTOR * g.step, 1.01 * g.traces.each * g.step, GAP_FACTOR * float(np.median(steps)) if steps.size else 0.0
    )
    sd = shown_values(g, line["sd"]) if "sd" in line else None
    band = None if sd is None else (y - sd, y + sd, SERIES[5], 0.5)
    return PlotLine(t, y, colour, width=0.6, gap=gap, jump=180.0 if "period" in spec else np.inf, band=band)


def _draw_rose(headings: Headings, canvas: "FigureBase") -> None:
    share = 100.0 * headings.sectors(SECTORS)
    ax: Any = canvas.add_subplot(projection="polar")
    ax.set_theta_zero_location("N")
    ax.set_theta_direction(-1)
    width = 2.0 * np.pi / SECTORS
    ax.bar(width * np.arange(SECTORS), share, width=0.94 * width, color=SERIES[0], linewidth=0.0)
    ax.plot([headings.mean] * 2, [0.0, share.max()], color=SERIES[1], linewidth=1.2)
    ax.set_xticks(np.radians(np.arange(0, 360, 30)))
    ax.set_xticklabels(["N", "30°", "60°", "E", "120°", "150°", "S", "210°", "240°", "W", "300°", "330°"])
    ax.yaxis.set_major_formatter(lambda value, _: f"{value:g} %")
    ax.set_rlabel_position(45.0)
    ax.tick_params(axis="y", labelsize=6.0)
