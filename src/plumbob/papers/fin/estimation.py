"""Page of what estimators give for records whose truth is known, and of how long a record B needs."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.units import to_si
from plumbob.noise import TERMS, Analysis, Coefficient, Curve, analyse
from plumbob.papers.description import FIN
from plumbob.papers.fin.datasheet import percent_error
from plumbob.papers.fin.records import COUNT, RATE, SIGMA, THREE, drawn, truth
from plumbob.papers.outcome import Part
from plumbob.papers.workspace import Work
from plumbob.reporting.content import SERIES, Figure, Table
from plumbob.reporting.noise import log_ticks

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase


METHODS: Final = ("lines", "undivided", "nearest", "least squares", "likelihood")
"""Fixed-slope lines where the curve has their slope, B/0.664; the same, B not divided; lines through the point whose
own slope is nearest; non-negative least squares of σ²; and Plumbob's likelihood."""
AT: Final = {"Q": math.sqrt(3.0), "N": 1.0, "B": math.sqrt(3.0)}
"""Averaging time of each ± of the paper, s; B of 453z has that of Q."""


class CoefficientRow(NamedTuple):
    """A coefficient by an estimator: share of the runs that gave it, and of those bias, scatter and coverage, shares.

    `scatter` is the standard deviation of one run over the truth; `coverage` the share of the intervals of 68.3 %, or
    of the paper's ±, that hold the truth.
    """

    found: float
    bias: float
    scatter: float
    coverage: float


def nearest(curve: Curve, letter: str) -> float:
    """Coefficient of the line through the pair of neighbouring points whose slope is nearest to the term's."""
    x, y = np.log(curve.tau), np.log(curve.dev)
    term = TERMS[letter]
    i = int(np.argmin(np.abs(np.diff(y) / np.diff(x) - term.slope)))
    height = 0.5 * (y[i] + y[i + 1]) - 0.5 * term.slope * (x[i] + x[i + 1])
    return math.exp(height) / math.sqrt(term.share)


def with_paper_interval(value: float, letter: str) -> Coefficient:
    """A value ± the percent error of (7) at the time that the paper takes for it."""
    share = percent_error(AT[letter], COUNT / RATE)
    return Coefficient(value, value * (1.0 - share), value * (1.0 + share))


def by_method(found: Analysis, method: str, letter: str) -> Coefficient | None:
    """One coefficient of an analysis by one of `METHODS`; None where the method gives none."""
    if method == "nearest":
        return with_paper_interval(nearest(found.curve, letter), letter)
    if method in {"lines", "undivided"}:
        line = found.lines.terms.get(letter)
        scale = SIGMA if method == "undivided" and letter == "B" else 1.0
        return None if line is None else with_paper_interval(scale * line.value, letter)
    return (found.least_squares if method == "least squares" else found.likelihood).terms.get(letter)


def three_regimes(rng: np.random.Generator, runs: int) -> Iterator[Mapping[tuple[str, str], CoefficientRow]]:
    """Rows by method and letter over so many records of the three regimes; yields every 12 records, the last whole."""
    analyses: list[Analysis] = []
    for i in range(-(-runs // 3)):
        analyses += [analyse(np.ascontiguousarray(rates), 1.0 / RATE) for rates in drawn(THREE, rng).T]
        if i % 4 == 3 or 3 * (i + 1) >= runs:
            yield {(m, letter): _row(analyses, m, letter) for m in METHODS for letter in "QNB"}


def _row(analyses: Sequence[Analysis], method: str, letter: str) -> CoefficientRow:
    true = float(getattr(THREE, letter)[0])
    terms = [c for a in analyses if (c := by_method(a, method, letter)) is not None]
    if not terms:
        return CoefficientRow(0.0, math.nan, math.nan, math.nan)
    values = np.array([c.value for c in terms]) / true
    held = float(np.mean([c.lo <= true <= c.hi for c in terms]))
    return CoefficientRow(len(terms) / len(analyses), float(values.mean()) - 1.0, float(values.std()), held)


class Length(NamedTuple):
    """B over its truth, of records of a length: mean, scatter of one, how many, and in which share it shows."""

    seconds: float
    mean: float
    scatter: float
    runs: int
    observable: float


SLOW: Final = 50.0
"""Samples per second of the long records, Hz."""
LENGTHS: Final = ((220.0, 60), (3600.0, 18), (14_400.0, 6), (43_200.0, 3))
"""Lengths, s, and how many records of each."""


def lengths(rng: np.random.Generator) -> Iterator[Length]:
    """B of the ADXRS453's data sheet, 16 °/h beside 0.015 °/s/√Hz, from records of `LENGTHS`."""
    of = truth(0.0, 0.9, 16.0)
    true = float(to_si(16.0, "deg/h"))
    for seconds, runs in LENGTHS:
        terms = [
            analyse(np.ascontiguousarray(rates), 1.0 / SLOW).terms["B"]
            for _ in range(runs // 3)
            for rates in drawn(of, rng, round(seconds * SLOW), SLOW, past=1).T
        ]
        values: Floats = np.array([c.value for c in terms]) / true
        shown = float(np.mean([c.observable for c in terms]))
        yield Length(seconds, float(values.mean()), float(values.std()), len(terms), shown)


def part(work: Work, step: Callable[[str], None], runs: int, *, long: bool = True) -> Part:
    """Estimators over so many records of the three regimes, simulated directly; `long`: and B of long records."""
    step("estimators on three regimes")
    rows = list(three_regimes(np.random.default_rng([work.seed, 3]), runs))[-1]
    figures: dict[str, float | tuple[float | None, float]] = {}
    for letter in "QNB":
        line, best = rows["lines", letter], rows["likelihood", letter]
        figures[f"three.{letter}.bias"] = abs(100.0 * line.bias), abs(100.0 * best.bias)
        figures[f"three.{letter}.cover"] = line.coverage, best.coverage
    figures["three.B.scatter"] = 100.0 * rows["lines", "B"].scatter, 100.0 * rows["likelihood", "B"].scatter
    figures["misprint.undivided"] = 100.0 * rows["undivided", "B"].bias
    outcomes = FIN.rows(figures, runs=runs)
    cells = []
    for method, name in FIN.texts("methods").items():
        of = [rows[method, letter] for letter in "QNB"]
        columns = (
            [f"{round(100.0 * row.bias, 1) + 0.0:+.1f}" for row in of],
            [f"{100.0 * row.scatter:.1f}" for row in of],
            [f"{row.coverage:.2f}" for row in of],
            [f"{row.found:.2f}" for row in of],
        )
        cells.append([name, *map(" / ".join, columns)])
    tables, drawn = [FIN.table("estimators_on_records", cells, runs=runs)], []
    if long:
        step("record length for B")
        measured = list(lengths(np.random.default_rng([work.seed, 4])))
        tables.append(_lengths(measured))
        drawn.append(_figure(measured))
        outcomes += FIN.rows({f"length.{round(length.seconds)}": (None, length.mean) for length in measured})
    return FIN.part("estimation", tables=tables, figures=drawn), outcomes


def _lengths(lengths: Sequence[Length]) -> Table:
    rows = []
    for of in lengths:
        hours = of.seconds / 3600.0
        name = FIN.text("220_s") if hours < 1.0 else FIN.text("hours", hours=hours)
        rows.append([name, f"{of.runs}", f"{of.mean:.2f} ± {of.scatter:.2f}", f"{of.observable:.2f}"])
    return FIN.table("record_length_and", rows)


def _figure(lengths: Sequence[Length]) -> Figure:
    def draw(canvas: "FigureBase") -> None:
        ax = canvas.subplots()
        x, y, sd = (np.array(row) for row in zip(*((o.seconds, o.mean, o.scatter) for o in lengths), strict=True))
        ax.errorbar(x / 3600.0, y, sd, fmt="o", color=SERIES[0], capsize=3, linewidth=1.1, markersize=4)
        ax.axhline(1.0, color=SERIES[1], linewidth=0.8, linestyle="--")
        ax.set_xscale("log")
        log_ticks(ax.xaxis, (1,))

    return FIN.figure("bias_instability_against", draw)
