"""Pictures: deviation over averaging time with its interval, the model, its terms and where they are read off."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.units import from_si, written
from plumbob.noise.datasheet.numbers import Triad, points, shown, triads, trusted
from plumbob.noise.findings import Analysis, Deviation
from plumbob.noise.terms import DEVIATION, TERMS, variance
from plumbob.report import INK, SERIES, SHADE, Key, envelope, png, svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

CURVE, MODEL, TERM = SERIES[0], INK, SERIES[1]
_COLUMNS = 600  # of a picture, for the thinning of long curves
HEIGHT = 3.3
_FADED = 0.35
_ROOM = 1.2  # between a letter and the ends of the scales, as a ratio
BANDS = "bands: confidence intervals; pale: relative uncertainty above 50 %"


def triad_figure(triad: Triad, salt: str) -> str:
    """Deviations of all axes of a triad, as SVG."""
    return svg(lambda figure: _draw_triad(figure.subplots(), triad), height=HEIGHT, salt=f"triad {salt}")


def triad_key(triad: Triad) -> Key:
    """Key of `triad_figure`."""
    axes: Key = [(axis or triad.name, colour, "solid") for axis, colour in zip(triad.channels, SERIES, strict=False)]
    masked = any(a.mask.n > 1 for a in triad.channels.values())
    return [*axes, ("models", MODEL, "solid"), *([("masked on an axis", SHADE, "block")] if masked else [])]


def channel_figure(analysis: Analysis, salt: str) -> str:
    """One channel with everything that was found in it, as SVG."""
    return svg(lambda figure: _draw_channel(figure.subplots(), analysis), height=HEIGHT, salt=f"channel {salt}")


def channel_key(analysis: Analysis) -> Key:
    """Key of `channel_figure`."""
    share = f"{100.0 * analysis.curve.confidence:.1f} % interval"
    keys = [
        (f"deviation, {share}", CURVE, "solid"),
        ("model", MODEL, "solid"),
        ("terms, read off at the dots", TERM, "dashed"),
    ]
    return keys + ([("masked", SHADE, "block")] if analysis.mask.n > 1 else [])


def write_png(path: str | Path, analyses: Sequence[Analysis], *, overwrite: bool = False) -> Path:
    """Write the plot alone as a picture: the curves of each triad in a panel, or all about a channel that stands alone.

    Parameters
    ----------
    path : path_like
        File to write.
    analyses : sequence of Analysis
        Channels.
    overwrite : bool
        Whether a file that lies there may be replaced.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    ShapeError
        If there is no analysis, or two share a name.
    MissingExtraError
        If matplotlib is not installed.
    """
    return write_panels(path, [partial(_draw_panel, triad=triad) for triad in triads(analyses)], overwrite=overwrite)


def write_panels(path: str | Path, panels: Sequence[Callable[["Axes"], None]], *, overwrite: bool = False) -> Path:
    """Write a picture of panels one below the other, each drawn by a function of its axes."""
    target = Path(path)

    def draw(figure: "Figure") -> None:
        for ax, panel in zip(figure.subplots(len(panels), 1, squeeze=False)[:, 0], panels, strict=True):
            panel(ax)

    png(target, draw, height=HEIGHT * len(panels), overwrite=overwrite)
    return target


def _draw_panel(ax: "Axes", triad: Triad) -> None:
    """A triad, or a single channel, that explains itself without a page around it."""
    alone = len(triad.channels) == 1
    draw = partial(_draw_channel, analysis=triad.first) if alone else partial(_draw_triad, triad=triad)
    draw(ax)
    if alone:
        explain(ax, triad.first.name, channel_key(triad.first))
    else:
        explain(ax, f"{triad.title}: {BANDS}", triad_key(triad))


def explain(ax: "Axes", title: str, key: Key) -> None:
    """Title and key inside the picture, for one that stands alone."""
    for name, colour, dash in key:
        width = 6.0 if dash == "block" else 1.2
        ax.plot([], [], color=colour, linestyle="solid" if dash == "block" else dash, linewidth=width, label=name)
    ax.legend(frameon=False)
    ax.set_title(title, loc="left", parse_math=False)


def _draw_triad(ax: "Axes", triad: Triad) -> None:
    frame(ax, list(triad.channels.values()))
    _shade(ax, max(triad.channels.values(), key=lambda a: a.mask.n))
    for analysis, colour in zip(triad.channels.values(), SERIES, strict=False):
        draw_curve(ax, analysis, colour, band=0.15)
        _draw_model(ax, analysis)


def _draw_channel(ax: "Axes", analysis: Analysis) -> None:
    frame(ax, [analysis])
    draw_curve(ax, analysis, CURVE, band=0.22)
    _shade(ax, analysis)
    _draw_model(ax, analysis)
    unit, tau = DEVIATION[analysis.quantity], np.geomspace(*ax.get_xlim(), 200)
    for letter, c in shown(analysis).items():
        line = from_si(np.sqrt(variance(letter, c.value, tau)), unit)
        ax.plot(tau, line, color=TERM, linewidth=0.7, linestyle=(0, (4, 3)))
        _name(ax, letter, tau, line)
    for _, at, dev in points(analysis):
        ax.plot(at, from_si(dev, unit), "o", color=TERM, markersize=3.5, zorder=4)


def _shade(ax: "Axes", analysis: Analysis) -> None:
    """What the mask leaves out."""
    if analysis.mask.n > 1:
        ax.axvspan(ax.get_xlim()[0], analysis.mask.n * analysis.curve.dt, color=SHADE, linewidth=0, zorder=0)


def _draw_model(ax: "Axes", analysis: Analysis) -> None:
    tau = np.geomspace(*ax.get_xlim(), 400)
    ax.plot(tau, from_si(analysis.model(tau), DEVIATION[analysis.quantity]), color=MODEL, linewidth=0.7)


def draw_curve(ax: "Axes", analysis: Analysis | Deviation, colour: str, *, band: float) -> None:
    """Deviation and its interval, paler above a relative uncertainty of 50 %."""
    curve, unit = analysis.curve, DEVIATION[analysis.quantity]
    until = int(np.count_nonzero(np.logical_and.accumulate(trusted(curve))))
    pale = slice(max(0, until - 1), None if until < curve.n.size else 0)
    for part, alpha in ((slice(0, until), 1.0), (pale, _FADED)):
        tau = curve.tau[part]
        if tau.size == 0:
            continue
        dev, lo, hi = (from_si(a[part], unit) for a in (curve.dev, curve.lo, curve.hi))
        x, y = _thinned(tau, dev)
        ax.plot(x, y, color=colour, linewidth=1.2, alpha=alpha, marker="." if x.size == 1 else "")
        below, above = _thinned(tau, lo), _thinned(tau, hi)
        outline = [np.concatenate((a, b[::-1])) for a, b in zip(below, above, strict=True)]
        ax.fill(*outline, color=colour, alpha=band * alpha, linewidth=0)


def _thinned(tau: Floats, dev: Floats) -> tuple[Floats, Floats]:
    """Least and greatest value of each column of the picture, whose axis is logarithmic."""
    x, y = envelope(np.log(tau), dev, _COLUMNS)
    return np.exp(x), y


def frame(ax: "Axes", analyses: Sequence[Analysis] | Sequence[Deviation]) -> None:
    """Scales, limits and labels; what is drawn afterwards does not change them."""
    unit = DEVIATION[analyses[0].quantity]
    low, high = (from_si(end, unit) for end in _range(analyses))
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xlim(min(a.curve.tau[0] for a in analyses) / 1.1, max(a.curve.tau[-1] for a in analyses) * 1.1)
    ax.set_ylim(low, high)
    _ticks(ax.xaxis, labels=(1,))
    _ticks(ax.yaxis, labels=(1, 2, 5) if high / low < 300.0 else (1,))
    ax.set_xlabel("averaging time [s]")
    ax.set_ylabel(f"Allan deviation [{written(unit)}]")


def _range(analyses: Sequence[Analysis] | Sequence[Deviation]) -> tuple[float, float]:
    """Least and greatest deviation of the picture: those of trusted points, or of all where none can be trusted.

    A picture of one channel shows its read-off points too, if they are not far below the curve.
    """
    seen = [a.curve.dev[use if (use := trusted(a.curve)).any() else slice(None)] for a in analyses]
    tops = [a.curve.hi[trusted(a.curve) & np.isfinite(a.curve.hi)] for a in analyses]
    low = min(float(dev[dev > 0.0].min(initial=math.inf)) for dev in seen)
    high = max(float(values.max(initial=0.0)) for values in [*seen, *tops])
    if len(analyses) == 1 and isinstance(analyses[0], Analysis):
        low = min([low, *(point.dev for point in points(analyses[0]) if point.dev > low / 30.0)])
    return low / 1.7, high * 1.5


def _ticks(axis: "Axis", labels: tuple[int, ...]) -> None:
    """Plain numbers at powers of ten, and at their multiples where there are few powers."""
    from matplotlib.ticker import LogLocator

    axis.set_major_locator(LogLocator(subs=labels, numticks=99))
    axis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.set_minor_formatter(lambda value, _: "")


def _name(ax: "Axes", letter: str, tau: Floats, line: Floats) -> None:
    """Put a term's letter where its line is lowest in the picture, on the side that the line turns away from."""
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    inside = np.flatnonzero(
        (line >= low * _ROOM) & (line <= high) & (tau >= left * _ROOM) & (tau <= right / _ROOM)  # room for the letter
    )
    if not inside.size:
        return
    slope = TERMS[letter].slope
    i = int(inside[-1] if slope < 0.0 else inside[0])
    ax.annotate(
        letter, (tau[i], line[i]), xytext=(-4 if slope > 0.0 else 4, 2), textcoords="offset points",
        color=TERM, fontsize=9, fontweight="bold", ha="right" if slope > 0.0 else "left", va="bottom",
    )  # fmt: skip
