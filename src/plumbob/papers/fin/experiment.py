"""Page of the fin's experiment [Ou2017] §3: Figures 4 and 5 and Table 1, from static records through bytes."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from plumbob.core import text
from plumbob.core.check import Floats
from plumbob.core.units import from_si, to_deg
from plumbob.noise import Analysis, Coefficient
from plumbob.noise.findings import coefficient, lowest
from plumbob.papers.description import FIN
from plumbob.papers.fin.attitude import AT_REST
from plumbob.papers.fin.datasheet import TABLE
from plumbob.papers.fin.estimation import with_paper_interval
from plumbob.papers.fin.records import (
    AXES,
    LENGTH,
    SIGMA,
    TABLE_1,
    THREE,
    Analysed,
    TrueCoefficients,
    analysed,
    drawn,
    sent,
)
from plumbob.papers.outcome import Part
from plumbob.papers.workspace import Taken, Work
from plumbob.reporting.content import MUTED, SERIES, Both, Figure, Table
from plumbob.reporting.noise import log_ticks

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

UNITS: Final = {"Q": "arcsec", "N": "deg/h", "B": "deg/h"}
"""Units in which Table 1 fits together."""
SHOWN: Final = {"Q": "″", "N": FIN.text("h_at_1_s"), "B": "°/h"}
NAMES: Final = FIN.texts("experiment_names")


def static_records(work: Work, step: Callable[[str], None]) -> tuple[dict[str, Analysed], Taken]:
    """Record and analyse the three static records; and the one of the parts' data sheets, as it was recorded.

    Each goes through bytes, a recording, and a TXT file, and is analysed at every averaging factor.
    """
    records: dict[str, Analysed] = {}
    step("static record, data sheets")
    parts = work.recorded("fin", "static-parts", **AT_REST)
    records["parts"] = analysed(parts.recording)
    for number, (name, of) in enumerate((("table", TABLE_1), ("three", THREE))):
        step(f"static record, {name}")
        rates = drawn(of, np.random.default_rng([work.seed, number]))
        records[name] = analysed(sent(work, f"static-{name}", rates).recording)
    return records, parts


def part(records: Mapping[str, Analysed]) -> Part:
    """Figures 4 and 5 and Table 1: every entry by lines and by likelihood, B as the flat that the paper prints.

    What the abstract and §3 say of the terms are shares of the angle's error after 220 s.
    """
    table = records["table"].noise.analyses
    lost = max(record.lost for record in records.values())
    outcomes = FIN.rows({"text.lost": lost, "allan.n": float(table[0].curve.n.size)})
    axes = ("290x", "290y", "453z")
    for entry in TABLE:
        a, unit = table[axes.index(entry.axis)], UNITS[entry.letter]
        term, flat = a.terms[entry.letter], SIGMA if entry.letter == "B" else 1.0
        faithful, best = _read(a, entry.letter), term.value if term.observable else term.upper
        values = {"faithful": from_si(flat * faithful, unit), "best": from_si(flat * best, unit)}
        limit = FIN.text("no_limit") if term.observable else FIN.text("best_limit_95")
        outcomes.append(FIN.row(f"table1.{entry.letter}.{entry.axis}", **values, limit=limit))
    angles = [angle_errors(TABLE_1, axis) for axis in range(3)]
    outcomes += FIN.rows(
        {f"claim.{axis}": 100.0 * by["Q"] / math.hypot(*by.values()) for axis, by in zip(axes, angles, strict=True)}
    )
    by_term = [[NAMES[letter], *(text.number(errors[letter], 2) for errors in angles)] for letter in "QNB"]
    tables = [
        _record_table(table, TABLE_1, FIN.text("table_1_from_the")),
        FIN.table("table_1_as_printed"),
        FIN.table("table_1_as"),
        _record_table(records["three"].noise.analyses, THREE, FIN.text("same_table_from_the")),
        FIN.table("what_a_line"),
        FIN.table("error_of_an", by_term, head=(FIN.text("term"), *AXES)),
    ]
    return FIN.part("experiment", tables=tables, figures=[_figure_4(records), _figure_5(records)]), outcomes


def _line(a: Analysis, letter: str) -> Coefficient | None:
    """As the paper reads it, with its ±; B divided by 0.664."""
    term = a.lines.terms.get(letter)
    return None if term is None else with_paper_interval(term.value, letter)


def _read(a: Analysis, letter: str) -> float:
    """Coefficient as a reader of the paper must take it: by its line, or where none shows, by force.

    Q then by a line of slope −1 through the shortest averaging time, B by the floor of the curve.
    """
    term = a.lines.terms.get(letter)
    if term is not None:
        return term.value
    if letter == "Q":
        return float(a.curve.dev[0] * a.curve.tau[0] / math.sqrt(3.0))
    least = lowest(a)
    return math.nan if least is None else least.dev / SIGMA


def angle_errors(of: TrueCoefficients, axis: int, t: float = LENGTH) -> dict[str, float]:
    """Error of an angle after t, s, that each term makes, degrees: Q√2, N√t, and 0.664 B t of the flat."""
    q, n, b = (float(getattr(of, letter)[axis]) for letter in "QNB")
    return {
        "Q": float(to_deg(math.sqrt(2.0) * q)),
        "N": float(to_deg(n * math.sqrt(t))),
        "B": float(to_deg(SIGMA * b * t)),
    }


def _record_table(analyses: Sequence[Analysis], of: TrueCoefficients, title: str) -> Table:
    """Coefficients of a record: true, by the paper's lines with its ±, and by likelihood with an honest interval."""
    rows = []
    for letter, unit in UNITS.items():
        shown = SHOWN[letter]
        zh = shown.zh if isinstance(shown, Both) else shown
        name = FIN.text("term_and_unit", letter=NAMES[letter], shown_letter=shown, letter_2=zh)
        lines = [_line(a, letter) for a in analyses]
        rows += [
            [name, FIN.text("true"), *(f"{from_si(float(v), unit):.4g}" for v in getattr(of, letter))],
            ["", FIN.text("lines_of_7"), *(_said(c, unit) for c in lines)],
            ["", FIN.text("likelihood_68"), *(coefficient(a.terms[letter], unit) for a in analyses)],
        ]
    return Table(title, (FIN.text("coefficient"), FIN.text("by"), *AXES), rows, words=(1,))


def _said(c: Coefficient | None, unit: str) -> str:
    return "-" if c is None else text.measured(*(from_si(v, unit) for v in (c.value, c.lo, c.hi)))


def _figure_4(records: Mapping[str, Analysed]) -> Figure:
    """Three axes, every n: a unit of Table 1, and the parts."""

    def draw(canvas: "FigureBase") -> None:
        axes = canvas.subplots(1, 2, sharey=True)
        titles = (FIN.text("unit_of_table_1"), FIN.text("data_sheets"))
        for ax, name, title in zip(axes, ("table", "parts"), titles, strict=True):
            for a, colour in zip(records[name].noise.analyses, SERIES, strict=False):
                _curve(ax, a.curve.tau, a.curve.dev, colour)
            ax.set_title(title, fontsize=7.5)
            for axis in (ax.xaxis, ax.yaxis):
                log_ticks(axis, (1,))

    key = [(name, colour, "solid") for name, colour in zip(AXES, SERIES, strict=False)]
    return FIN.figure("figure_4", draw, lines=key)


def _figure_5(records: Mapping[str, Analysed]) -> Figure:
    """The ADXRS453 with the paper's lines, and with the likelihood and its interval."""

    def draw(canvas: "FigureBase") -> None:
        axes = canvas.subplots(1, 2)
        titles = (FIN.text("unit_of_table_1"), FIN.text("three_regimes"))
        for ax, name, title in zip(axes, ("table", "three"), titles, strict=True):
            a = records[name].noise.analyses[2]
            tau = np.geomspace(a.curve.tau[0], a.curve.tau[-1], 200)
            band = a.curve.edf >= 2.0
            lo, hi = (from_si(v[band], "deg/h") for v in (a.curve.lo, a.curve.hi))
            ax.fill_between(*_thin(a.curve.tau[band], lo, hi), color=SERIES[0], alpha=0.22, linewidth=0)
            _curve(ax, a.curve.tau, a.curve.dev, SERIES[0])
            ax.loglog(tau, from_si(a.model(tau), "deg/h"), color=SERIES[2], linewidth=1.0)
            bottom, top = ax.get_ylim()
            _paper_lines(ax, a, tau)
            ax.set_ylim(bottom, top)
            ax.set_title(title, fontsize=7.5)
            log_ticks(ax.xaxis, (1,))
            log_ticks(ax.yaxis, (1, 2, 5))

    return FIN.figure("figure_5", draw)


def _paper_lines(ax: "Axes", a: Analysis, tau: Floats) -> None:
    """Lines of slope −1, −1/2 and 0 where the curve has them, and where they are read."""
    for letter, power in (("Q", -1.0), ("N", -0.5), ("B", 0.0)):
        term = a.lines.terms.get(letter)
        if term is not None:
            at_one = term.value * {"Q": math.sqrt(3.0), "N": 1.0, "B": SIGMA}[letter]
            ax.plot(tau, from_si(at_one * tau**power, "deg/h"), color=SERIES[1], linewidth=0.9, linestyle="--")
    for at in (1.0, math.sqrt(3.0)):
        ax.axvline(at, color=MUTED, linewidth=0.7, linestyle=":")


def _curve(ax: "Axes", tau: Floats, dev: Floats, colour: str) -> None:
    from plumbob.reporting.drawing import envelope

    x, y = envelope(np.log(tau), from_si(dev, "deg/h"), 400)
    ax.loglog(np.exp(x), y, color=colour, linewidth=1.0)


def _thin(tau: Floats, *rows: Floats) -> tuple[Floats, ...]:
    """About 200 points of each, evenly in their logarithm."""
    at = np.unique(np.searchsorted(tau, np.geomspace(tau[0], tau[-1], 200)).clip(0, tau.size - 1))
    return (tau[at], *(row[at] for row in rows))
