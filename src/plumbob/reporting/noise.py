"""Descriptions of noise: data sheet, deviations alone, before and after, and the noise card."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core import __version__
from plumbob.core.check import Floats
from plumbob.core.findings import info
from plumbob.core.text import measured, number
from plumbob.core.units import Quantity, from_si, written
from plumbob.data import TITLES
from plumbob.data.cards import UNITS, NoiseCard, TriadNoise
from plumbob.noise import findings
from plumbob.noise.allan import Noise
from plumbob.noise.compare import ChannelComparison
from plumbob.noise.curve import Curve
from plumbob.noise.terms import DATASHEET, DEVIATION, TERMS, variance
from plumbob.reporting.content import INK, SERIES, SHADE, Figure, Table
from plumbob.reporting.report import Report

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import FigureBase

_ROWS = 40  # of a curve's table
_COARSE = 0.05  # of N² from the rounding of the values: more is told


NOISE: Final = {  # kinds of noise by the exponent of their spectrum
    2: "quantization", 1: "flicker of the integral", 0: "white", -1: "flicker", -2: "random walk", -3: "flicker walk",
    -4: "random run",
}  # fmt: skip


def thinned_rows(curve: Curve, limit: int) -> NDArray[np.intp]:
    """Rows of a curve for a table of at most so many: all, or some evenly spaced in the logarithm of τ."""
    if curve.n.size <= limit:
        return np.arange(curve.n.size)
    wanted = np.geomspace(curve.n[0], curve.n[-1], limit)
    return np.unique(np.clip(np.searchsorted(curve.n, wanted), 0, curve.n.size - 1))


def noise_name(alpha: float) -> str:
    """Kind of noise in words."""
    return NOISE.get(round(alpha), f"f^{alpha:.0f}")


def with_unit(text: str, unit: str) -> str:
    """Number in a sentence, with its unit; nothing follows plain numbers, whose unit is 1."""
    return text if unit == Quantity.RATIO.value else f"{text} {written(unit)}"


def _in_brackets(unit: str) -> str:
    """What follows the name of a quantity in a title: `` [°/h]``; nothing for plain numbers."""
    return "" if unit == Quantity.RATIO.value else f" [{written(unit)}]"


def verdict(c: findings.Coefficient, unit: str) -> str:
    """The same in words, with the unit."""
    if c.observable:
        return with_unit(findings.coefficient(c, unit), unit)
    limit = from_si(c.upper, unit)
    bound = f"; < {with_unit(number(limit, 2), unit)} (95 %)" if math.isfinite(limit) else ""
    return f"not observable{bound}; to show half of it takes a record of {longer(c)}"


def longer(c: findings.Coefficient) -> str:
    """How long a record would have to be to show half of the limit of a coefficient that is not observable."""
    return "more than a year" if c.hours is None else findings.length(3600.0 * c.hours)


def noise(result: Noise, *, device: str | None = None) -> Report:
    """Data sheet; further tables of its text are "methods" and "curve"."""
    facts = {"device": device or result.record.path.stem, "record": result.named, "made by": f"plumbob {__version__}"}
    return datasheet(result.analyses, facts=list(facts.items()))


def datasheet(analyses: Sequence[findings.Analysis], *, facts: Sequence[tuple[str, str]] = ()) -> Report:
    """Data sheet: a part for each sensor, its axes side by side, with a figure and the details of each channel.

    Names of channels such as "gyr x" say which belong together.
    """
    parts = [_triad(triad) for triad in findings.triads(analyses)]
    return Report(
        "Noise data sheet", facts=facts, remarks=[info("page.limits")], parts=parts, definitions=[info("page.allan")]
    )


def curves_report(deviations: Sequence[findings.Deviation]) -> Report:
    """Deviations alone."""
    parts = [Report(d.name, tables=[_curve(d)]) for d in deviations]
    return Report("Deviation over averaging time", parts=parts)


def before_and_after(found: Sequence[ChannelComparison], *, facts: Sequence[tuple[str, str]] = ()) -> Report:
    """Deviations before and after at equal averaging times, their ratio with its interval, and what to make of it."""
    return Report(
        "Noise before and after", facts=facts, parts=[_compared(c) for c in found], definitions=[info("page.filtered")]
    )


def _triad(triad: findings.Triad) -> Report:
    first, channels = triad.first, list(triad.channels.values())
    title = TITLES[triad.name].capitalize() if triad.name in TITLES else triad.name
    alone = len(channels) == 1
    return Report(
        title,
        facts=[("record", findings.length_and_rate(triad))],
        tables=[Table("", ["", *triad.channels], _coefficient_rows(triad))],
        details=partial(_details, first) if alone else None,
        remarks=_remarks(triad),
        figures=lambda: [channel_figure(first) if alone else triad_figure(triad)],
        parts=() if alone else [_channel(a) for a in channels],
    )


def _channel(a: findings.Analysis) -> Report:
    """Details of a channel among others."""
    return Report(a.name, details=partial(_details, a), figures=lambda: [channel_figure(a)])


def _details(a: findings.Analysis) -> list[Table]:
    """Methods side by side, the models that were weighed, and the curve."""
    units, methods = DATASHEET[a.quantity], (a.lines, a.least_squares, a.likelihood)
    rows = [
        [
            f"{letter} [{written(units[letter])}]",
            *(findings.coefficient(e.terms.get(letter), units[letter]) for e in methods),
        ]
        for letter in TERMS
        if any(letter in e.terms for e in methods)
    ]
    tables = [Table("Coefficients by method", ["", *(e.method for e in methods)], rows, detail="methods")]
    if a.candidates:
        least = min(c.bic for c in a.candidates)
        models = [(c.terms, f"{c.bic - least:.1f}", "chosen" if c.chosen else "") for c in a.candidates]
        tables.append(Table("Candidate models", ["terms", "ΔBIC", ""], models, words=(2,), detail="methods"))
    return [*tables, replace(_curve(a), detail="curve")]


def _curve(a: findings.Analysis | findings.Deviation) -> Table:
    """Averaging time, deviation, ends of its interval, degrees of freedom, error of IEEE Std 952, kind of noise."""
    c, unit = a.curve, DEVIATION[a.quantity]
    use = thinned_rows(c, _ROWS)
    rows = [
        (
            number(float(c.tau[i])),
            *(number(from_si(float(v[i]), unit), 4) for v in (c.dev, c.lo, c.hi)),
            number(float(c.edf[i])),
            number(100.0 * float(c.ieee[i])),
            noise_name(float(c.alpha[i])),
        )
        for i in use.tolist()
    ]
    some = "" if use.size == c.n.size else f", {use.size} of {c.n.size} averaging times"
    head = ("τ [s]", "deviation", "from", "to", "edf", "IEEE Std 952 [%]", "noise")
    title = f"{c.kind}{_in_brackets(unit)}, {100.0 * c.confidence:.1f} % interval{some}"
    return Table(title, head, rows, words=(6,))


def _compared(pair: ChannelComparison) -> Report:
    c, unit = pair.comparison, DEVIATION[pair.quantity]
    rows = [
        (
            number(float(c.tau[i])),
            *(number(from_si(float(curve.dev[i]), unit), 4) for curve in (c.before, c.after)),
            *(number(float(v[i])) for v in (c.ratio, c.lo, c.hi)),
        )
        for i in thinned_rows(c.before, _ROWS).tolist()
    ]
    head = ("τ [s]", "before", "after", "ratio", "from", "to")
    title = f"{c.before.kind}{_in_brackets(unit)}, ratio with its 68.3 % interval"
    return Report(pair.name, tables=[Table(title, head, rows)], remarks=c.notes, figures=[_compared_figure(pair)])


def _remarks(triad: findings.Triad) -> list[str]:
    """What a reader must know beside the coefficients, each remark once with the axes that it holds for."""
    axes_by_remark: dict[str, list[str]] = {}
    for axis, a in triad.channels.items():
        for remark in (*_extras(a), *map(str, a.notes)):
            axes_by_remark.setdefault(remark, []).append(axis)
    everywhere = len(triad.channels)
    rest = [r if len(axes) == everywhere else f"{', '.join(axes)}: {r}" for r, axes in axes_by_remark.items()]
    return [*_verdicts(triad), *rest]


def _coefficient_rows(triad: findings.Triad) -> list[list[str]]:
    """Rows of the table of a triad: name with unit, and one cell for each axis."""
    units, sample, channels = DATASHEET[triad.first.quantity], DEVIATION[triad.first.quantity], triad.channels.values()
    floors, times = [], []
    for least in map(findings.lowest, channels):
        if least is None:
            floors.append("-")
            times.append("-")
        else:
            floors.append(measured(*(from_si(value, sample) for value in (least.dev, least.lo, least.hi))))
            times.append(f"{number(least.tau)} s" + ("" if least.risen else " or later"))
    return [
        *(
            [
                f"{k} {term.name} [{written(units[k])}]",
                *(findings.coefficient(a.terms.get(k), units[k]) for a in channels),
            ]
            for k, term in TERMS.items()
        ),
        [f"floor of the curve [{written(sample)}]", *floors],
        ["at an averaging time of", *times],
        [f"mean [{written(sample)}]", *(number(from_si(a.mean, sample), 4) for a in channels)],
        [f"standard deviation [{written(sample)}]", *(number(from_si(a.sd, sample), 4) for a in channels)],
    ]


def _verdicts(triad: findings.Triad) -> Iterator[str]:
    """Coefficients that this record does not show, and how long ones would."""
    for letter in TERMS:
        terms = {axis: a.terms[letter] for axis, a in triad.channels.items() if letter in a.terms}
        lacking = {axis: c for axis, c in terms.items() if not c.observable}
        if lacking:
            where = "" if len(lacking) == len(triad.channels) else f" on {', '.join(lacking)}"
            times = {axis: longer(c) for axis, c in lacking.items()}
            same = set(times.values())
            lengths = same.pop() if len(same) == 1 else ", ".join(f"{time} ({axis})" for axis, time in times.items())
            yield f"{letter} is not observable{where}: to show half of the limit takes a record of {lengths}"


def _extras(a: findings.Analysis) -> list[str]:
    """Sinusoids, bands, Gauss–Markov process, mask and step."""
    unit = DEVIATION[a.quantity]
    notes = []
    for s in a.sinusoids:
        size, sd = from_si(s.amplitude, unit), from_si(s.amplitude_sd, unit)
        at = measured(s.frequency, s.frequency - s.frequency_sd, s.frequency + s.frequency_sd)
        amplitude = with_unit(measured(size, size - sd, size + sd), unit)
        notes.append(f"sinusoid of {amplitude} at {at} Hz, or folded from another frequency: k × rate ± it")
    for b in a.bands:
        power = with_unit(number(from_si(b.sd, unit)), unit)
        limits = f"{number(b.low)} to {number(b.high)} Hz"
        notes.append(f"left out: a band of {power} rms about {number(b.middle)} Hz ({limits}): motion or interference")
    if a.markov is not None:
        sd_words, time = verdict(a.markov.sd, unit), verdict(a.markov.time, "s")
        notes.append(f"Gauss-Markov process: standard deviation {sd_words}, correlation time {time}")
    if a.mask.n > 1:
        above = "" if a.mask.frequency is None else f", above {number(a.mask.frequency)} Hz"
        notes.append(f"masked: averaging times below {number(a.mask.n * a.curve.dt)} s{above}: {a.mask.reason}")
    if a.step:
        step = with_unit(number(from_si(a.step, unit), 4), unit)
        notes.append(f"values are multiples of {step}{_rounding(a)}")
    return notes


def _rounding(a: findings.Analysis) -> str:
    """How much of the white noise is the rounding of the values to their step, which scatters by step/√12."""
    white = a.terms.get("N")
    density = a.step**2 / 12.0 * a.curve.dt
    if white is None or not white.observable or density <= _COARSE * white.value**2:
        return ""
    return f", whose rounding (step²/12 · Δt) is {number(100.0 * density / white.value**2, 2)} % of N²"


CURVE, MODEL, TERM = SERIES[0], INK, SERIES[1]
_SLOPES = {-2: "−1", -1: "−½", 0: "0", 1: "+½", 2: "+1"}
_COLUMNS = 600  # of a picture, for the thinning of long curves
HEIGHT = 3.3
_FADED = 0.35
_ROOM = 1.2  # between a letter and the ends of the scales, as a ratio


def triad_figure(triad: findings.Triad) -> Figure:
    """Deviations of all axes of a triad."""
    channels = list(triad.channels.values())
    axes = [(axis, colour, "solid") for axis, colour in zip(triad.channels, SERIES, strict=False)]
    keys = [*axes, ("models", MODEL, "solid"), *([("masked on an axis", SHADE, "block")] if _masked(channels) else [])]
    draw = partial(_draw_curves, curves=channels, shaded=_masked(channels))
    return Figure("Allan deviation of all axes", draw, keys, HEIGHT)


def channel_figure(analysis: findings.Analysis) -> Figure:
    """One channel with everything that was found in it: the terms with their values where they are read off."""
    keys = [
        (f"deviation, {100.0 * analysis.curve.confidence:.1f} % interval", CURVE, "solid"),
        ("model", MODEL, "solid"),
        ("terms, read off at the dots", TERM, "dashed"),
        *([("masked", SHADE, "block")] if _masked([analysis]) else []),
    ]
    return Figure("Allan deviation, model and terms", partial(_draw_channel, analysis=analysis), keys, HEIGHT)


def _compared_figure(pair: ChannelComparison) -> Figure:
    c = pair.comparison
    both = [findings.Deviation(pair.name, pair.quantity, curve) for curve in (c.before, c.after)]
    bent = [("bent by the filter", SHADE, "block")] if c.bent_below is not None else []
    keys = [("before", SERIES[0], "solid"), ("after", SERIES[1], "solid"), *bent]
    draw = partial(_draw_curves, curves=both, shaded=c.bent_below)
    return Figure("Allan deviation before and after", draw, keys, HEIGHT)


def _masked(channels: Sequence[findings.Analysis]) -> float | None:
    """Averaging time below which the mask leaves out what an axis has; None where no axis has one."""
    return max((a.mask.n * a.curve.dt for a in channels if a.mask.n > 1), default=None)


def _draw_curves(
    canvas: "FigureBase", curves: Sequence[findings.Analysis | findings.Deviation], shaded: float | None
) -> "Axes":
    """Deviations, each with its model where it has one; shaded below an averaging time."""
    ax = canvas.subplots()
    _frame(ax, curves)
    if shaded is not None:
        ax.axvspan(ax.get_xlim()[0], shaded, color=SHADE, linewidth=0, zorder=0)
    for curve, colour in zip(curves, SERIES, strict=False):
        _draw_curve(ax, curve, colour, band=0.22 if len(curves) == 1 else 0.15)
        if isinstance(curve, findings.Analysis):
            tau = np.geomspace(*ax.get_xlim(), 400)
            ax.plot(tau, from_si(curve.model(tau), DEVIATION[curve.quantity]), color=MODEL, linewidth=0.7)
    return ax


def _draw_channel(canvas: "FigureBase", analysis: findings.Analysis) -> None:
    ax = _draw_curves(canvas, [analysis], _masked([analysis]))
    sample, tau = DEVIATION[analysis.quantity], np.geomspace(*ax.get_xlim(), 200)
    for letter, c in findings.shown(analysis).items():
        line = from_si(np.sqrt(variance(letter, c.value, tau)), sample)
        ax.plot(tau, line, color=TERM, linewidth=0.7, linestyle=(0, (4, 3)))
        _name(ax, letter, tau, line)
    for letter, at, dev in findings.points(analysis):
        dot = (at, from_si(dev, sample))
        ax.plot(*dot, "o", color=TERM, markersize=3.5, zorder=4)
        name = DATASHEET[analysis.quantity][letter]
        value = with_unit(number(from_si(analysis.terms[letter].value, name)), name)
        power = TERMS[letter].power
        ax.annotate(
            f"{letter} = {value}", dot, xytext=(4 * np.sign(power), -5), textcoords="offset points", color=TERM,
            ha="right" if power < 0 else "left" if power else "center", va="top",
        )  # fmt: skip


def _draw_curve(ax: "Axes", analysis: findings.Analysis | findings.Deviation, colour: str, *, band: float) -> None:
    """Deviation and its interval, paler above a relative uncertainty of 50 %."""
    curve, unit = analysis.curve, DEVIATION[analysis.quantity]
    until = int(np.count_nonzero(np.logical_and.accumulate(findings.trusted(curve))))
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
    from plumbob.reporting.drawing import envelope

    x, y = envelope(np.log(tau), dev, _COLUMNS)
    return np.exp(x), y


def _frame(ax: "Axes", analyses: Sequence[findings.Analysis | findings.Deviation]) -> None:
    """Scales, limits and labels; what is drawn afterwards does not change them."""
    unit = DEVIATION[analyses[0].quantity]
    low, high = (from_si(end, unit) for end in _range(analyses))
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xlim(min(a.curve.tau[0] for a in analyses) / 1.1, max(a.curve.tau[-1] for a in analyses) * 1.1)
    ax.set_ylim(low, high)
    log_ticks(ax.xaxis, labels=(1,))
    log_ticks(ax.yaxis, labels=(1, 2, 5) if high / low < 300.0 else (1,))
    ax.set_xlabel("averaging time [s]")
    ax.set_ylabel(f"Allan deviation [{written(unit)}]")


def _range(analyses: Sequence[findings.Analysis | findings.Deviation]) -> tuple[float, float]:
    """Least and greatest deviation of the picture: those of trusted points, or of all where none can be trusted.

    A picture of one channel shows its read-off points too, if they are not far below the curve.
    """
    devs = [a.curve.dev[use if (use := findings.trusted(a.curve)).any() else slice(None)] for a in analyses]
    tops = [a.curve.hi[findings.trusted(a.curve) & np.isfinite(a.curve.hi)] for a in analyses]
    low = min(float(dev[dev > 0.0].min(initial=math.inf)) for dev in devs)
    high = max(float(values.max(initial=0.0)) for values in [*devs, *tops])
    if len(analyses) == 1 and isinstance(analyses[0], findings.Analysis):
        low = min([low, *(point.dev for point in findings.points(analyses[0]) if point.dev > low / 30.0)])
    return low / 1.7, high * 1.5


def log_ticks(axis: "Axis", labels: tuple[int, ...]) -> None:
    """Plain numbers at powers of ten, and at their multiples where there are few powers."""
    from matplotlib.ticker import LogLocator

    axis.set_major_locator(LogLocator(subs=labels, numticks=99))
    axis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.set_minor_formatter(lambda value, _: "")


def _name(ax: "Axes", letter: str, tau: Floats, line: Floats) -> None:
    """Put a term's letter and slope where its line is lowest in the picture, on the side that the line leaves."""
    (begin, end), (low, high) = ax.get_xlim(), ax.get_ylim()
    inside = np.flatnonzero(
        (line >= low * _ROOM) & (line <= high) & (tau >= begin * _ROOM) & (tau <= end / _ROOM**3)  # room for the label
    )
    if not inside.size:
        return
    power = TERMS[letter].power
    i, rises = int(inside[-1] if power < 0 else inside[0]), power > 0
    ax.annotate(
        f"{letter} {_SLOPES[power]}", (tau[i], line[i]), xytext=(-4 if rises else 4, 2), textcoords="offset points",
        color=TERM, fontsize=9, fontweight="bold", ha="right" if rises else "left", va="bottom",
    )  # fmt: skip


def card_report(card: NoiseCard) -> Report:
    """What a noise card holds, in the units of data sheets."""
    parts = [
        Report(TITLES[name].capitalize(), tables=[Table("", ["", *findings.AXES], _card_rows(name, triad))])
        for name in UNITS
        if (triad := getattr(card, name)) is not None
    ]
    return Report("Noise card", facts=[("device", card.device)], remarks=[card.source], parts=parts)


def _card_rows(name: str, triad: TriadNoise) -> list[list[str]]:
    units = DATASHEET[Quantity(UNITS[name])]
    terms = {
        "N": (triad.n_rpsd, triad.n_interval),
        "B": (triad.b, triad.b_interval),
        "K": (triad.k_rpsd, triad.k_interval),
    }
    rows = []
    for k, (values, ends) in terms.items():
        rows.append([f"{k} {TERMS[k].name} [{written(units[k])}]", *_card_cells(values, units[k])])
        if ends is not None:
            cells = (f"{lo} to {hi}" for lo, hi in zip(*(_card_cells(end, units[k]) for end in ends), strict=True))
            rows.append(["  68.3 %", *cells])
    return rows


def _card_cells(values: Floats, unit: str) -> list[str]:
    return [number(v) for v in from_si(values, unit).tolist()]
