"""Page of the fin's algorithm [Ou2017] §2: each equation as printed and as corrected, and what eq 7 is worth."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from plumbob.core.check import Floats
from plumbob.noise.report import log_ticks
from plumbob.papers.description import FIN
from plumbob.papers.fin import forms
from plumbob.papers.fin.datasheet import TABLE, percent_error
from plumbob.papers.fin.records import COUNT, LENGTH, RATE, TABLE_1, drawn, printed
from plumbob.papers.outcome import Outcome
from plumbob.papers.workspace import Work
from plumbob.reporting.content import Figure, Table
from plumbob.reporting.report import Report
from plumbob.reporting.style import MUTED, SERIES

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

Step = Callable[[str], None]


def part(work: Work, step: Step, records: int) -> tuple[Report, list[Outcome]]:
    """Part of the page, and its outcomes.

    Parameters
    ----------
    work : Work
        Of the run.
    step : callable
        Called before each step with its name.
    records : int
        Of white noise for the scatter of σ, simulated directly; half as many are of flicker.
    """
    rng = np.random.default_rng([work.seed, 7])
    step("equations as printed")
    white, lines = forms.white_by_readings(rng), forms.slopes(rng)
    spectra = forms.quantised_spectrum(rng)
    rates = np.ascontiguousarray(drawn(TABLE_1, rng)[:, 2])
    step("is eq 7 right?")
    scatter = list(forms.scatter(rng, records))[-1]
    outcomes = [
        *_sums(white, rates),
        *_integrals(spectra),
        *_terms(lines),
        *_percentages(),
        *_units(),
        *_scattered(scatter),
    ]
    tables = [FIN.table("misprints_each_computed", of={row.key: row for row in outcomes}), _right(scatter, records)]
    return FIN.part("algorithm", tables=tables, figures=[_figure(white)]), outcomes


def _sums(white: forms.White, rates: Floats) -> list[Outcome]:
    """Steps 1 to 4."""
    n = np.unique(np.geomspace(1, COUNT // 2, 200).astype(np.int64))
    peer = forms.peer(rates, n)
    delta = percent_error(1.0, LENGTH)
    outcomes = [
        FIN.row("allan.slope", best=white.slope("right")),
        FIN.row("allan.second", best=white.at_second("right"), best_bar=(1.0 - 3.0 * delta, 1.0 + 3.0 * delta)),
    ]
    for reading, at_second in (("moving", 0.045), ("disjoint", 0.041)):
        outcomes += [
            FIN.row(f"misprint.eq2.{reading}.slope", faithful=white.slope(reading), best=white.slope("right")),
            FIN.row(
                f"misprint.eq2.{reading}.second",
                faithful=white.at_second(reading),
                best=white.at_second("right"),
                faithful_bar=(at_second * (1.0 - 3.0 * delta), at_second * (1.0 + 3.0 * delta)),
            ),
        ]
    small = rates[:1000]
    return [
        *outcomes,
        FIN.row("allan.direct", best=forms.every_sum(rates, n)),
        FIN.row(
            "allan.peer",
            best=forms.every_sum(small, np.arange(1, 41)) if peer is None else peer,
            what=FIN.text("same_against_allantools") if peer is not None else FIN.text("same_at_n_1"),
        ),
        FIN.row("allan.last", faithful=float(small.size - 2 * (small.size // 2)), best=1.0),
    ]


def _integrals(spectra: forms.DensityRatios) -> list[Outcome]:
    """(3), (4) and (6)."""
    late, later = 1e3, 1e4
    growth = (forms.white_integral(later, 1) - forms.white_integral(late, 1)) / math.log(later / late)
    return [
        FIN.row("eq3.density", faithful=spectra.by_group, best=spectra.by_interval),
        FIN.row("eq3.nyquist", faithful=forms.quantisation_integral(1.0 / RATE, math.sqrt(3.0), RATE / 2.0), best=1.0),
        FIN.row("eq4.white", best=4.0 / math.pi * forms.white_integral(late, 2)),
        FIN.row("eq4.growth", faithful=growth, best=forms.white_integral(later, 2) - forms.white_integral(late, 2)),
        FIN.row("eq6.flat", faithful=1.0, best=math.sqrt(2.0 / math.pi * forms.flicker_integral(late))),
    ]


def _terms(lines: forms.Slopes) -> list[Outcome]:
    """Step 6's name, and two kinds of quantisation."""
    return [
        FIN.row("name.white", faithful=lines.white, best=lines.walk),
        FIN.row("quantised.angle", best=lines.angle),
        FIN.row("quantised.rate", faithful=lines.rate, best=lines.angle),
    ]


def _percentages() -> list[Outcome]:
    """(7) and Table 1's ±."""
    n = round(math.sqrt(3.0) * RATE)
    outcomes = [FIN.row("eq7", faithful=100.0 * percent_error(n / RATE, LENGTH)), FIN.row("eq7.n", faithful=float(n))]
    for entry in TABLE:
        outcomes.append(FIN.row(f"interval.{entry.letter}.{entry.axis}", faithful=entry.tau[0]))
    return outcomes


def _units() -> list[Outcome]:
    """Table 1 read with the units that it prints."""
    q = printed("Q")[2]
    level = 0.664 * printed("B")
    cross = (60.0 * printed("N") / level) ** 2
    outcomes = [FIN.row("unit.Q", faithful=math.sqrt(3.0) * q * RATE, best=math.sqrt(3.0) * q / 3600.0 * RATE)]
    for axis, name in ((2, "453z"), (0, "290x")):
        outcomes.append(
            FIN.row(f"unit.R.{name}", faithful=float(cross[axis]), best=float((printed("N")[axis] / level[axis]) ** 2))
        )
    outcomes.append(FIN.row("unit.B.453z", faithful=float((printed("N")[2] / printed("B")[2]) ** 2)))
    return outcomes


def _scattered(scatter: forms.Scatter) -> list[Outcome]:
    """What (7) is worth at 1 s."""
    return [
        FIN.row(f"eq7.{name}", faithful=100.0 * float(scatter.formula[0]), best=100.0 * float(value[0]))
        for name, value in (
            ("white", scatter.white),
            ("disjoint", scatter.white_disjoint),
            ("flicker", scatter.flicker),
        )
    ]


def _right(scatter: forms.Scatter, records: int) -> Table:
    names = (
        (FIN.text("eq_7"), scatter.formula),
        (FIN.text("overlapping_white_theory"), scatter.theory),
        (FIN.text("overlapping_white"), scatter.white),
        (FIN.text("disjoint_white"), scatter.white_disjoint),
        (FIN.text("overlapping_flicker"), scatter.flicker),
    )
    rows = [[name, *(f"{100.0 * v:.2f}" for v in values)] for name, values in names]
    return FIN.table("is_eq_7", rows, records=records, records_2=records // 2)


def _figure(white: forms.White) -> Figure:
    names = {
        "right": (FIN.text("corrected"), SERIES[0], "solid"),
        "moving": (FIN.text("as_printed_moving_averages"), SERIES[1], "dashed"),
        "disjoint": (FIN.text("as_printed_groups"), SERIES[2], "dotted"),
    }

    def draw(canvas: "FigureBase") -> None:
        ax = canvas.subplots()
        for reading, (_, colour, dash) in names.items():
            style = {"solid": "-", "dashed": "--", "dotted": ":"}[dash]
            ax.loglog(white.tau, white.dev[reading], color=colour, linestyle=style, linewidth=1.4)
        ax.loglog(white.tau, white.tau**-0.5, color=MUTED, linewidth=0.7)
        for axis in (ax.xaxis, ax.yaxis):
            log_ticks(axis, (1,))

    key = [*names.values(), (FIN.text("truth"), MUTED, "solid")]
    return FIN.figure("white_noise_by", draw, lines=key)
