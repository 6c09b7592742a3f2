"""Descriptions of noise: data sheet, deviations alone, before and after, and the noise card."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from operator import itemgetter
from typing import TYPE_CHECKING, Final, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from plumbob.core import __version__
from plumbob.core.check import Floats
from plumbob.core.findings import Note, info, warning
from plumbob.core.text import measured, number
from plumbob.core.units import Quantity, from_si, written
from plumbob.data import TITLES
from plumbob.data.cards import UNITS, NoiseCard, TriadNoise
from plumbob.noise import findings
from plumbob.noise.allan import Noise
from plumbob.noise.compare import DeviationComparison, differences
from plumbob.noise.curve import Curve
from plumbob.noise.terms import DATASHEET, DEVIATION, SHEETS, TERMS, variance
from plumbob.reporting.content import INK, MUTED, SERIES, SHADE, SOFT, Figure, Table
from plumbob.reporting.drawing import PlotLine, PlotPanel, draw_panels
from plumbob.reporting.report import Report

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as CanvasFigure
    from matplotlib.figure import FigureBase

_ROWS = 40  # of a curve's table
_IMPLAUSIBLE = 10.0  # times the noisiest data sheet, or the tenth of the quietest: parts scatter by far less
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
    """Data sheet, or several records beside each other; further tables of its text are "methods" and "curve"."""
    if result.beside:
        return _several_records(result)
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


class _SensorGroup(NamedTuple):
    """Channels of several records that measure alike, by axis and then by the record's label."""

    title: str
    quantity: Quantity
    axes: dict[str, dict[str, findings.Analysis]]
    ratios: dict[str, DeviationComparison]  # by the label and axis of the later record


def _groups(result: Noise) -> list[_SensorGroup]:
    """Channels by their sensors; all in one where each record has a single channel, whatever it is called."""
    alone = all(len(each.analyses) == 1 for each in result.all)
    groups: dict[tuple[str, Quantity], _SensorGroup] = {}
    for each in result.all:
        for triad in findings.triads(each.analyses):
            for axis, a in triad.channels.items():
                name = "" if alone else triad.name
                title = TITLES[triad.name].capitalize() if name in TITLES else name or "Sensors"
                group = groups.setdefault((name, a.quantity), _SensorGroup(title, a.quantity, {}, {}))
                group.axes.setdefault("" if alone else axis, {})[each.label] = a
                if a.name in each.changes:
                    group.ratios[f"{each.label} {'' if alone else axis}".strip()] = each.changes[a.name]
    return list(groups.values())


def _several_records(result: Noise) -> Report:
    """Coefficients of several records beside each other, what differs by more than chance, and one figure a sensor."""
    sheets = {each.label: findings.triads(each.analyses) for each in result.all}
    facts = [(each.label, f"{each.named}, {findings.length_and_rate(sheets[each.label][0])}") for each in result.all]
    parts = []
    for group in _groups(result):
        shown = {id(a) for by_label in group.axes.values() for a in by_label.values()}
        remarks = [f"{label}: {remark}" for label, triads in sheets.items() for triad in triads
                   if id(triad.first) in shown for remark in _remarks(triad, beside=True)]  # fmt: skip
        table, differences = _coefficients_beside(group, result.label)
        tables = [table, *([_ratio_table(group.ratios)] if group.ratios else [])]
        figures = partial(_figures, group.axes)
        parts.append(Report(group.title, tables=tables, remarks=[*differences, *remarks], figures=figures))
    definitions = [info("page.allan"), info("page.filtered"), info("page.beside", label=result.label)]
    return Report(
        "Noise of several records", facts=[*facts, ("made by", f"plumbob {__version__}")],
        remarks=[info("page.limits")], parts=parts, definitions=definitions,
    )  # fmt: skip


def _coefficients_beside(group: _SensorGroup, first: str) -> tuple[Table, Sequence[Note]]:
    """Table of coefficients, those that differ from the first record's marked; what to say of them and of filters."""
    units, sample = DATASHEET[group.quantity], DEVIATION[group.quantity]
    every = [(axis, label, a) for axis, by_label in group.axes.items() for label, a in by_label.items()]
    letters = [k for k in TERMS if any(k in findings.shown(a) for *_, a in every)]
    among = len(letters) * (len(every) - len(group.axes)) or 1
    rows: list[list[str]] = []
    notes: list[Note] = []
    for axis, label, a in every:
        old, name = group.axes[axis].get(first, a), f"{label} {axis}".strip()
        unlike = {d.letter: d for d in differences(old, a, among=among)}
        least = findings.lowest(a)
        floor = "-" if least is None else f"{number(from_si(least.dev, sample))} at {number(least.tau)} s"
        cells = [findings.coefficient(a.terms.get(k), units[k]) + (" *" if k in unlike else "") for k in letters]
        rows.append([name, *cells, floor])
        factors = [f"{k} by a factor of {measured(d.ratio, d.lo, d.hi)}" if math.isfinite(d.lo)
                 else f"{k} ({'' if d.ratio else 'not '}observable)" for k, d in unlike.items()]  # fmt: skip
        if factors:
            notes.append(info("noise.differs", name=name, other=f"{first} {axis}".strip(), what=", ".join(factors)))
        if (ratio := group.ratios.get(name)) and ratio.is_filter:
            notes += [f"{name}: {note}" for note in ratio.notes]
    head = ["", *(f"{k}{_in_brackets(units[k])}" for k in letters), f"floor{_in_brackets(sample)}"]
    return Table("", head, rows), notes or [info("noise.no_difference")]


def _ratio_table(ratios: Mapping[str, DeviationComparison]) -> Table:
    """Deviation over that of the first record, at about one averaging time in each decade of the longest."""
    longest, rows = max(ratios.values(), key=lambda c: c.tau.size), []
    for i in thinned_rows(longest.before, _DECADES).tolist():
        n = longest.before.n[i]
        places = [np.flatnonzero(c.before.n == n) for c in ratios.values()]
        cells = [measured(*(float(v[k[0]]) for v in (c.ratio, c.lo, c.hi))) if k.size else "-"
                 for c, k in zip(ratios.values(), places, strict=True)]  # fmt: skip
        rows.append([number(float(longest.tau[i])), *cells])
    return Table("Allan deviation over that of the first record", ["τ [s]", *ratios], rows)


def _plausible(triad: findings.Triad) -> Iterator[Note]:
    """Where white noise lies among that of data sheets, or that it can hardly be that of such a sensor."""
    first = triad.first
    unit, sheets = DATASHEET[first.quantity]["N"], sorted(SHEETS.get(first.quantity, ()), key=itemgetter(1))
    sizes = [from_si(a.terms["N"].value, unit) for a in triad.channels.values() if "N" in findings.shown(a)]
    if not (sheets and sizes):
        return
    middle, texts = float(np.median(sizes)), [f"{number(value)} {written(unit)} ({part})" for part, value in sheets]
    for i, than, ratio in ((0, "quietest", sheets[0][1] / middle), (-1, "noisiest", middle / sheets[-1][1])):
        if ratio > _IMPLAUSIBLE:
            yield warning("noise.implausible", ratio=middle / sheets[i][1], than=than, sheet=texts[i])
            return
    near = texts[int(np.argmin([abs(math.log(value / middle)) for _, value in sheets]))]
    size = f"{number(middle)} {written(unit)}"
    yield info("noise.plausible", size=size, low=texts[0], high=texts[-1], near=near)


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
        figures=partial(_figures, {"": triad.channels}),
        parts=()
        if alone
        else [Report(a.name, details=partial(_details, a), figures=partial(_figures, {"": {"": a}})) for a in channels],
    )


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


def _remarks(triad: findings.Triad, *, beside: bool = False) -> list[Note]:
    """What a reader must know beside the coefficients, each remark once with the axes that it holds for."""
    axes_by_remark: dict[str, list[str]] = {}
    for axis, a in triad.channels.items():
        for remark in (*_extras(a), *map(str, a.notes)):
            axes_by_remark.setdefault(remark, []).append(axis)
    everywhere = len(triad.channels)
    rest = [r if len(axes) == everywhere else f"{', '.join(axes)}: {r}" for r, axes in axes_by_remark.items()]
    return [*_plausible(triad), *([] if beside else _verdicts(triad)), *rest]


def _coefficient_rows(triad: findings.Triad) -> list[list[str]]:
    """Rows of the table of a triad: name with unit, and one cell for each axis."""
    units, sample, channels = DATASHEET[triad.first.quantity], DEVIATION[triad.first.quantity], triad.channels.values()
    lowest = [findings.lowest(a) for a in channels]
    ends = [least and [from_si(value, sample) for value in (least.dev, least.lo, least.hi)] for least in lowest]
    late = ["-" if least is None else f"{number(least.tau)} s{'' if least.risen else ' or later'}" for least in lowest]
    return [
        *(
            [
                f"{k} {term.name} [{written(units[k])}]",
                *(findings.coefficient(a.terms.get(k), units[k]) for a in channels),
            ]
            for k, term in TERMS.items()
        ),
        [f"floor of the curve [{written(sample)}]", *(measured(*three) if three else "-" for three in ends)],
        ["at an averaging time of", *late],
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


HEIGHT = 3.3
_LOW = 2.0  # inches of one of several panels
_FADED = 0.35
_LISTED = 9  # channels whose values fit into a key
_LETTER = 6.5  # points of a value beside its mark
_MARK = 2.5  # points from the middle of a mark to its corners
_PLACES: Final = [  # offsets of a value from its mark, points
    (x, y) for k in (1, 2, 3) for x, y in ((0, -6 * k), (6, -4 * k), (-6, -4 * k), (0, 6 * k), (6, 4 * k), (-6, 4 * k))
]
_SIDES: Final = ({-1: "right", 0: "center", 1: "left"}, {-1: "top", 0: "center", 1: "bottom"})
_DECADES = 7  # rows of a table of ratios

Panels = Mapping[str, Mapping[str, findings.Analysis]]


def _figures(panels: Panels) -> list[Figure]:
    return [allan_figure(panels)]


def allan_figure(panels: Panels) -> Figure:
    """Deviations with their models, in panels by axis whose channels have a colour each, and a key with coefficients.

    Marks are where a coefficient is read off; its value stands there too, where it crosses no curve.
    """
    names = list(dict.fromkeys(name for channels in panels.values() for name in channels))
    colours = {name: SERIES[i % len(SERIES)] for i, name in enumerate(names)}
    every = [(name, axis, panels[axis][name]) for name in names for axis in panels if name in panels[axis]]
    units = DATASHEET[every[0][2].quantity]
    keys = [(name, colour, "solid") for name, colour in colours.items()]
    if len(every) <= _LISTED:
        words = [(name, [f"{name} {axis}".strip(), ", ".join(_values(a).values())]) for name, axis, a in every]
        keys = [(": ".join(filter(None, parts)) or "deviation", colours[name], "solid") for name, parts in words]
    keys += [("dots: deviation, line: model", MUTED, "solid"), ("68.3 % interval", SOFT, "block")]
    keys += [("masked", SHADE, "block")] if _masked(a for *_, a in every) else []
    letters = [k for k in TERMS if any(k in findings.shown(a) for *_, a in every)]
    caption = ", ".join(["Allan deviation", *(f"{k}{_in_brackets(units[k])}" for k in letters)])
    height = HEIGHT if len(panels) == 1 else _LOW * len(panels) + 0.3
    return Figure(caption, partial(_draw, panels=panels, colours=colours), keys, height)


def _values(a: findings.Analysis) -> dict[str, str]:
    """Coefficients that the record shows, by letter, each with its value in the unit of a data sheet."""
    units = DATASHEET[a.quantity]
    return {letter: f"{letter} {number(from_si(c.value, units[letter]))}" for letter, c in findings.shown(a).items()}


def _masked(channels: Iterable[findings.Analysis]) -> float | None:
    """Averaging time below which the mask leaves out what a channel has; None where none has one."""
    return max((a.mask.n * a.curve.dt for a in channels if a.mask.n > 1), default=None)


def _draw(canvas: "FigureBase", panels: Panels, colours: Mapping[str, str]) -> None:
    """A panel below the other, with the same scales."""
    every = [channel for channels in panels.values() for channel in channels.values()]
    made = [_panel(axis, channels, every, colours) for axis, channels in panels.items()]
    draw_panels(lambda: made, canvas)
    cast("CanvasFigure", canvas.figure).draw_without_rendering()  # that the places of the axes are known
    for ax, panel, channels in zip(cast("CanvasFigure", canvas).axes, made, panels.values(), strict=True):
        _write_values(ax, panel, {colours[name]: a for name, a in channels.items()})


def _panel(
    axis: str, channels: Mapping[str, findings.Analysis], every: Sequence[findings.Analysis], colours: Mapping[str, str]
) -> PlotPanel:
    """Deviations and models of an axis, on scales that hold every channel."""
    unit, masked = DEVIATION[every[0].quantity], _masked(channels.values())
    first, last = (min(a.curve.tau[0] for a in every) / 1.1, max(a.curve.tau[-1] for a in every) * 1.1)
    tau, (low, high) = np.geomspace(first, last, 400), _range(every)
    lines: list[PlotLine] = []
    for name, a in channels.items():
        lines += _curve_lines(a, colours[name], band=0.22 if len(channels) == 1 else 0.15)
        lines.append(PlotLine(tau, from_si(a.model(tau), unit), colours[name]))
        terms = findings.shown(a).items() if len(every) == 1 else ()
        dashed = [from_si(np.sqrt(variance(letter, c.value, tau)), unit) for letter, c in terms]
        lines += [PlotLine(tau, y, MUTED, "dashed", width=0.6) for y in dashed]
    return PlotPanel(
        f"{axis or 'Allan deviation'} [{written(unit)}]", lines, "averaging time [s]", log=True, x=(first, last),
        y=(from_si(low, unit), from_si(high, unit)), pale=[] if masked is None else [(first, masked - first)],
    )  # fmt: skip


def _curve_lines(a: findings.Analysis, colour: str, *, band: float) -> Iterator[PlotLine]:
    """Deviation and its interval, paler above a relative uncertainty of 50 %; a model lies over its dots."""
    curve, unit = a.curve, DEVIATION[a.quantity]
    dev, *ends = (from_si(np.where(np.isfinite(v), v, curve.dev), unit) for v in (curve.dev, curve.lo, curve.hi))
    until = int(np.count_nonzero(np.logical_and.accumulate(findings.trusted(curve))))
    pale = slice(max(0, until - 1), None if until < curve.n.size else 0)
    for part, alpha in ((slice(0, until), 1.0), (pale, _FADED)):
        filled = (ends[0][part], ends[1][part], colour, band * alpha)
        if curve.tau[part].size:
            yield PlotLine(curve.tau[part], dev[part], colour, width=0.0, mark=".", alpha=alpha, band=filled)


def _write_values(ax: "Axes", panel: PlotPanel, channels: Mapping[str, findings.Analysis]) -> None:
    """Marks where coefficients are read off, each with its value where that covers nothing that is drawn."""
    dpi, box = ax.figure.dpi / 72.0, ax.get_window_extent()
    marks = [(colour, a, letter, (tau, from_si(dev, DEVIATION[a.quantity]))) for colour, a in channels.items()
             for letter, tau, dev in findings.points(a)]  # fmt: skip
    marks = [mark for mark in marks if mark[3][1] > ax.get_ylim()[0]]
    middles = ax.transData.transform(np.reshape([mark for *_, mark in marks], (-1, 2)))
    corners = dpi * _MARK * (np.indices((3, 3)).reshape(2, -1).T - 1.0)  # of a mark, and places between them
    taken = np.concatenate([_covered_points(ax, panel.lines), *(middle + corners for middle in middles)])
    for middle, (colour, a, letter, mark) in zip(middles, marks, strict=True):
        ax.plot(*mark, "D", color=colour, markersize=3.5, markeredgecolor=INK, mew=0.5, zorder=4)
        value = _values(a)[letter]
        texts = (with_unit(value, DATASHEET[a.quantity][letter]), value)
        for text, offset in product(texts, _PLACES if len(channels) == 1 else _PLACES[:12]):
            size, sign = dpi * _LETTER * np.array([0.6 * len(text), 1.1]), np.sign(offset)
            corner = middle + dpi * np.array(offset) - 0.5 * (1.0 - sign) * size
            apart, others = (np.hypot(*(m - np.clip(m, corner, corner + size)).T) for m in (middle, middles))
            fits = (corner > box.min).all() and (corner + size < box.max).all() and apart <= others.min() + dpi
            if fits and not ((taken > corner) & (taken < corner + size)).all(axis=1).any():
                ax.annotate(
                    text, mark, xytext=offset, textcoords="offset points", color=colour, fontsize=_LETTER,
                    ha=_SIDES[0][sign[0]], va=_SIDES[1][sign[1]],
                )  # fmt: skip
                taken = np.concatenate([taken, corner + size * np.indices((40, 8)).reshape(2, -1).T / (39, 7)])
                break


def _covered_points(ax: "Axes", lines: Iterable[PlotLine]) -> Floats:
    """Points (N, 2) of the picture, pixels, that are covered by lines and their bands."""
    tau, places = np.geomspace(*ax.get_xlim(), 500), [np.empty((0, 2))]
    for line in lines:
        x = np.append(line.x[:1], tau[(tau >= line.x.min(initial=np.inf)) & (tau <= line.x.max(initial=0.0))])
        low, high = (np.interp(np.log(x), np.log(line.x), end) for end in (line.band or (line.y, line.y))[:2])
        heights = (low + (high - low) * part for part in np.linspace(0.0, 1.0, 12 if line.band else 1))
        places += [np.stack((x, np.maximum(y, 1e-300)), axis=-1) for y in heights]
    return np.asarray(ax.transData.transform(np.concatenate(places)))


def _range(analyses: Sequence[findings.Analysis]) -> tuple[float, float]:
    """Least and greatest deviation of the picture: those of trusted points, or of all where none can be trusted.

    Read-off points are in it too, if they are not far below the curves.
    """
    devs = [a.curve.dev[use if (use := findings.trusted(a.curve)).any() else slice(None)] for a in analyses]
    tops = [a.curve.hi[findings.trusted(a.curve) & np.isfinite(a.curve.hi)] for a in analyses]
    low = min(float(dev[dev > 0.0].min(initial=math.inf)) for dev in devs)
    high = max(float(values.max(initial=0.0)) for values in [*devs, *tops])
    marks = (point.dev for a in analyses for point in findings.points(a) if point.dev > low / 30.0)
    return min(low, *marks, low) / 1.7, high * 1.5


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
