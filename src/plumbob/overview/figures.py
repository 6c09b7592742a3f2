"""Figures of a recording for a paper: values over time, spectra, heading rose, bursts and flags."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.core.time import GAP_FACTOR
from plumbob.core.units import to_deg
from plumbob.overview.report_entry import Subject
from plumbob.overview.streaming_stats import SPECTRAL, Gathered
from plumbob.overview.tables import SPECTRAL_UNITS, heading_circle, shown_scale
from plumbob.reporting.content import Figure
from plumbob.reporting.style import INK, SERIES, SOFT

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

COLUMNS: Final = 1500
SECTORS: Final = 36
_XYZ: Final = tuple(zip("xyz", SERIES[:3], strict=True))
SD: Final = {"roll": "roll_sd", "pitch": "pitch_sd", "heading": "heading_sd"}
"""Channels with a claimed standard deviation, and where it is."""


def figures(subject: Subject) -> dict[str, Figure]:
    """Figures by the names that ``plumbob plot --what`` takes, as far as the recording has something for them."""
    g = subject.gathered
    drawings: dict[str, Figure] = {}
    if g.tilt is not None:
        keys = [
            ("estimate", SERIES[0], "solid"),
            *([("claimed ± 1 sd", SERIES[5], "block")] if g.has("roll_sd") else []),
        ]
        drawings["angles"] = Figure("Roll, pitch and heading", partial(_angles, g), keys, height=4.2)
        limit = ("limit", SERIES[1], "dashed")
        drawings["tilt"] = Figure("Inclination from the vertical", partial(_tilt, g), [limit], height=2.2)
    for what, (stem, caption, label) in _TRIADS.items():
        if g.has(f"{stem}_x"):
            draw = partial(_triad, g, stem, label)
            drawings[what] = Figure(caption, draw, [(axis, colour, "solid") for axis, colour in _XYZ], height=3.6)
    if g.has("temp"):
        drawings["temperature"] = Figure(
            "Temperature", partial(_lines, g, [("temp", INK)], "temperature [°C]"), height=2.0
        )
    if g.has("roll_sd"):
        names = [("roll_sd", SERIES[0]), ("pitch_sd", SERIES[1]), ("heading_sd", SERIES[2])]
        keys = [(name.removesuffix("_sd"), colour, "solid") for name, colour in names]
        drawings["sd"] = Figure("Claimed standard deviation", partial(_lines, g, names, "1 sd [°]"), keys)
    if g.spectra is not None:
        drawings["spectrum"] = Figure("Power spectral density", partial(_spectrum, g), height=4.2)
    if g.headings is not None and g.headings.samples:
        drawings["rose"] = Figure("Share of time by heading, sectors of 10°", partial(_rose, g), height=4.2)
    if g.tilt is not None:
        keys = [("roll", SERIES[0], "solid"), ("pitch", SERIES[1], "solid"), ("inclination", SERIES[2], "solid")]
        drawings["bursts"] = Figure("Bursts", partial(_bursts, g), keys, height=4.0)
    drawings["flags"] = Figure("Flags over time", partial(_flags, g), height=0.9 + 0.22 * (1 + len(g.flags)))
    return drawings


_TRIADS: Final = {
    "rates": ("gyr", "Angular rate", "rate {} [°/s]"),
    "forces": ("acc", "Specific force", "force {} [m/s²]"),
    "field": ("mag", "Magnetic flux density", "field {} [µT]"),
    "bias": ("bias", "Estimated gyroscope bias", "bias {} [°/s]"),
}
WHATS: Final = (
    "angles", "tilt", "rates", "forces", "field", "temperature", "bias", "sd", "spectrum", "rose", "bursts", "flags",
)  # fmt: skip
"""All names of figures."""


def figure(subject: Subject, what: str) -> Figure:
    """One figure by its name of `WHATS`.

    Raises
    ------
    ParameterError
        If the recording has nothing for it.
    """
    drawings = figures(subject)
    if what not in drawings:
        raise ParameterError(f"{subject.name} has nothing to draw for '{what}'. It has {', '.join(drawings)}.")
    return drawings[what]


def _gap(g: Gathered) -> float:
    """A step in time that breaks a line, s."""
    return max(GAP_FACTOR, 1.01 * g.traces.each) * g.step


def _end(g: Gathered) -> float:
    """End of the axis of time, s: of a single sample one step behind it."""
    return max(g.end, g.begin + g.step)


def _line(ax: "Axes", g: Gathered, channel: str, colour: str, *, jump: float = np.inf) -> None:
    from plumbob.reporting.drawing import envelope

    y = _shown(g, channel)
    finite = np.isfinite(y)
    t, values = g.traces.t[finite], y[finite]
    gap = max(_gap(g), GAP_FACTOR * float(np.median(np.diff(t)))) if t.size > 1 else np.inf
    ax.plot(*envelope(t, values, COLUMNS, gap=gap, jump=jump), color=colour, linewidth=0.6)
    ax.set_xlim(g.begin, _end(g))


def _shown(g: Gathered, channel: str) -> Floats:
    """Values of a channel in the unit that is shown; headings on the circle of `heading_circle`."""
    values = g.traces.channel(channel) * shown_scale(channel)
    start = heading_circle(g)[0]
    return (values - start) % 360.0 + start if channel == "heading" else values


def _band(ax: "Axes", g: Gathered, channel: str, *, circular: bool) -> None:
    """Value ± one claimed standard deviation, as far as both are known."""
    if not g.has(SD[channel]):
        return
    y, sd = (_shown(g, name) for name in (channel, SD[channel]))
    t, size = g.traces.t, -(-y.size // COLUMNS)
    behind = np.flatnonzero(np.diff(t) > _gap(g)) + 1
    starts = np.union1d(np.arange(0, y.size, size), behind)
    low, high = np.fmin.reduceat(y - sd, starts), np.fmax.reduceat(y + sd, starts)
    if circular:  # where it turns through North, from one edge to the other
        turned = np.fmax.reduceat(y, starts) - np.fmin.reduceat(y, starts) > 180.0
        low[turned] = high[turned] = np.nan
    places = np.searchsorted(starts, behind)  # nothing is claimed across a gap
    low, high = (np.insert(edge, places, np.nan) for edge in (low, high))
    shown = np.insert(t[starts], places, t[behind - 1] + g.step)
    ax.fill_between(shown, low, high, color=SERIES[5], alpha=0.5, linewidth=0.0, step="post")


def _angles(g: Gathered, canvas: "FigureBase") -> None:
    axes = canvas.subplots(3, 1, sharex=True)
    for ax, name in zip(axes, ("roll", "pitch", "heading"), strict=True):
        _band(ax, g, name, circular=name == "heading")
        _line(ax, g, name, SERIES[0], jump=180.0)
        ax.set_ylabel(f"{name} [°]")
    low, high = axes[2].get_ylim()
    if high - low > 180.0:
        start = heading_circle(g)[0]
        axes[2].set_ylim(start, start + 360.0)
        axes[2].set_yticks(start + np.arange(0.0, 361.0, 90.0))
    axes[2].yaxis.set_major_formatter(lambda value, _: f"{value % 360.0:g}")
    axes[2].set_xlabel("time [s]")


def _tilt(g: Gathered, canvas: "FigureBase") -> None:
    ax = canvas.subplots()
    _line(ax, g, "tilt", SERIES[0])
    assert g.tilt is not None
    ax.axhline(to_deg(g.tilt.inclination.limit), color=SERIES[1], linewidth=0.8, linestyle="--")
    ax.set_ylim(bottom=0.0)
    ax.set_ylabel("inclination [°]")
    ax.set_xlabel("time [s]")


def _triad(g: Gathered, stem: str, label: str, canvas: "FigureBase") -> None:
    axes = canvas.subplots(3, 1, sharex=True)
    for ax, (axis, colour) in zip(axes, _XYZ, strict=True):
        _line(ax, g, f"{stem}_{axis}", colour)
        ax.set_ylabel(label.format(axis))
    axes[2].set_xlabel("time [s]")


def _lines(g: Gathered, names: Sequence[tuple[str, str]], label: str, canvas: "FigureBase") -> None:
    ax = canvas.subplots()
    for name, colour in names:
        _line(ax, g, name, colour)
    ax.set_ylabel(label)
    ax.set_xlabel("time [s]")


_SPECTRA: Final = (
    (("roll", "pitch"), "roll, pitch"), (("heading_rate",), "heading rate"), (("vertical",), "vertical acceleration"),
)  # fmt: skip


def _spectrum(g: Gathered, canvas: "FigureBase") -> None:
    assert g.spectra is not None
    frequency, density = g.spectra.gathered()
    axes = canvas.subplots(3, 1, sharex=True)
    for ax, (names, label) in zip(axes, _SPECTRA, strict=True):
        for name, colour in zip(names, SERIES, strict=False):
            y = density[:, SPECTRAL.index(name)] * shown_scale(name) ** 2
            ax.loglog(frequency, np.where(y > 0.0, y, np.nan), color=colour, linewidth=0.8, label=name)
        if len(names) > 1:
            ax.legend(frameon=False, loc="upper right")
        ax.set_ylabel(f"{label} [{SPECTRAL_UNITS[names[0]]}]", fontsize=6.0)
        ax.yaxis.set_major_formatter(lambda value, _: _power(value))
    axes[-1].xaxis.set_major_formatter(lambda value, _: _power(value))
    axes[-1].xaxis.set_minor_formatter(lambda value, _: "")  # of a narrow band matplotlib writes formulas there
    axes[-1].set_xlabel("frequency [Hz]")
    axes[-1].set_xlim(frequency[0], frequency[-1])


_RAISED: Final = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def _power(value: float) -> str:
    """Power of ten as a mark of an axis."""
    exponent = round(np.log10(value)) if value > 0.0 else 0
    return f"{value:g}" if -2 <= exponent <= 3 else f"10{str(exponent).translate(_RAISED)}"


def _rose(g: Gathered, canvas: "FigureBase") -> None:
    assert g.headings is not None
    share = g.headings.sectors(SECTORS)
    ax: Any = canvas.add_subplot(projection="polar")
    ax.set_theta_zero_location("N")
    ax.set_theta_direction(-1)
    width = 2.0 * np.pi / SECTORS
    ax.bar(width * np.arange(SECTORS), 100.0 * share, width=0.94 * width, color=SERIES[0], linewidth=0.0)
    ax.plot([g.headings.mean] * 2, [0.0, 100.0 * float(share.max())], color=SERIES[1], linewidth=1.2)
    ax.set_xticks(np.radians(np.arange(0, 360, 30)))
    ax.set_xticklabels(["N", "30°", "60°", "E", "120°", "150°", "S", "210°", "240°", "W", "300°", "330°"])
    ax.yaxis.set_major_formatter(lambda value, _: f"{value:g} %")
    ax.set_rlabel_position(45.0)
    ax.tick_params(axis="y", labelsize=6.0)


def _bursts(g: Gathered, canvas: "FigureBase") -> None:
    axes = canvas.subplots(3, 1, sharex=True)
    t = np.array([0.5 * (burst.begin + burst.end) for burst in g.bursts])
    curves: list[tuple[Callable[..., float], int]] = [(lambda b: b.tilt.roll.significant, 0)]
    curves.append((lambda b: b.tilt.pitch.significant, 0))
    curves += [(lambda b: b.tilt.roll.tz, 1), (lambda b: b.tilt.pitch.tz, 1)]
    for number, (of, panel) in enumerate(curves):
        scale = to_deg(1.0) if panel == 0 else 1.0
        axes[panel].plot(
            t, [scale * of(b) for b in g.bursts], "o-", color=SERIES[number % 2], markersize=2.5, linewidth=0.8
        )
    for of, style in ((lambda b: b.tilt.inclination.mean, "o-"), (lambda b: b.tilt.inclination.greatest, "o--")):
        axes[2].plot(t, [to_deg(of(b)) for b in g.bursts], style, color=SERIES[2], markersize=2.5, linewidth=0.8)
    for ax, label in zip(axes, ("significant [°]", "Tz [s]", "mean, greatest [°]"), strict=True):
        ax.set_ylabel(label)
        ax.set_ylim(bottom=0.0)
    axes[2].set_xlabel("time [s]")
    axes[2].set_xlim(g.begin, _end(g))


def _flags(g: Gathered, canvas: "FigureBase") -> None:
    ax = canvas.subplots()
    rows = [("gap", g.gaps, SERIES[1])]
    others = ((name, runs) for name, runs in g.flags.items() if name != "gap")
    rows += [(name, runs.stretches, SOFT if runs.coarse else SERIES[0]) for name, runs in others]
    least = g.duration / COLUMNS
    for place, (_, stretches, colour) in enumerate(rows):
        bars = [(begin, max(end - begin, least)) for begin, end in stretches]
        ax.broken_barh(bars, (place - 0.35, 0.7), facecolors=colour, linewidth=0)
    ax.set_yticks(range(len(rows)), [name for name, *_ in rows])
    ax.set_ylim(len(rows) - 0.5, -0.5)
    ax.set_xlim(g.begin, _end(g))
    ax.grid(visible=True, axis="x")
    ax.set_xlabel("time [s]")
