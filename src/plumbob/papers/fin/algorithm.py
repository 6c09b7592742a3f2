"""The algorithm of the fin paper [Ou2017] §2: its equations as printed and as corrected, and what eq 7 is worth."""

import math
from collections.abc import Callable, Iterator
from importlib import import_module
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from plumbob.core.check import Floats
from plumbob.core.units import dps
from plumbob.noise import curves, deviation, edf, every_adev
from plumbob.noise.report import log_ticks
from plumbob.papers.description import FIN
from plumbob.papers.fin.datasheet import TABLE, percent_error
from plumbob.papers.fin.records import COUNT, LENGTH, RATE, TABLE_1, drawn, printed
from plumbob.papers.outcome import Outcome
from plumbob.papers.workspace import Work
from plumbob.reporting.content import Figure, Table
from plumbob.reporting.report import Report
from plumbob.reporting.style import MUTED, SERIES
from plumbob.simulation import errors

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase


READINGS: Final = ("right", "moving", "disjoint")
"""Sums of (2): corrected; neighbouring moving averages; neighbouring groups of (1), divided by 2(N − 2n)."""
FACTORS: Final = (500, 750, 866, 1581)
"""Samples of 1, 1.5, √3 and √10 s."""


def allan_sum(rates: Floats, n: int, reading: str = "right") -> float:
    """Allan deviation at one averaging factor by the sum of (2), in the unit of the rates.

    Parameters
    ----------
    rates : ndarray (N,)
        Samples.
    n : int
        Averaging factor.
    reading : {"right", "moving", "disjoint"}
        ``right`` takes means n samples apart and N − 2n + 1 differences; the others are (2) as it is printed, with the
        means of moving windows, or with the groups of (1).

    Returns
    -------
    float
        NaN where a printed sum has no term.
    """
    theta = np.concatenate(([0.0], np.cumsum(rates - np.mean(rates))))
    count, terms = rates.size, rates.size - 2 * n
    means = (theta[n:] - theta[:-n]) / n
    if reading == "right":
        difference = means[n:] - means[:-n]
        return math.sqrt(float(difference @ difference) / (2.0 * (terms + 1)))  # departs from [Ou2017] (2): k + n
    if terms == 0:
        return math.nan
    groups = means[: (count // n) * n : n] if reading == "disjoint" else means[1 : terms + 2]  # [Ou2017] (1)
    difference = np.diff(groups)
    return math.sqrt(float(difference @ difference) / (2.0 * terms))  # [Ou2017] (2)


def slope(tau: Floats, dev: Floats) -> float:
    """Slope of a deviation in a log-log plot."""
    return float(np.polyfit(np.log(tau), np.log(dev), 1)[0])


class White(NamedTuple):
    """What each reading of (2) makes of white noise whose deviation is 1 at 1 s: root mean square over records."""

    n: Floats
    dev: dict[str, Floats]

    @property
    def tau(self) -> Floats:
        """Averaging times, s."""
        return self.n / RATE

    def slope(self, reading: str) -> float:
        """Up to 2 s, where a record of 220 s scatters by 5 % and less."""
        use = self.tau <= 2.0
        return slope(self.tau[use], self.dev[reading][use])

    def at_second(self, reading: str) -> float:
        """Deviation at 1 s."""
        return float(self.dev[reading][self.n == RATE][0])


def white_by_readings(rng: np.random.Generator, records: int = 16) -> White:
    """Records of white noise through each reading of the sum."""
    n = np.unique(np.append(np.geomspace(1, COUNT // 4, 36).astype(np.int64), int(RATE)))
    squares = {reading: np.zeros(n.size) for reading in READINGS}
    for _ in range(records):
        rates = math.sqrt(RATE) * rng.standard_normal(COUNT)
        for reading, sums in squares.items():
            squares[reading] = sums + np.array([allan_sum(rates, int(k), reading) for k in n]) ** 2
    return White(n.astype(float), {reading: np.sqrt(sums / records) for reading, sums in squares.items()})


def quantisation_integral(t0: float, big: float, upto: float = math.inf) -> float:
    """(4) of (3), over 3Q²/T², with t0 where (3) prints T; `upto` cuts it at a frequency, Hz.

    In closed form 1 without a cut, for T a multiple of t0 of 2 or more.
    """
    if upto == math.inf:
        return 1.0
    f = _midpoints(upto, 400_000)
    weight = 16.0 / t0 * np.sin(np.pi * f * t0) ** 2 * np.sin(np.pi * f * big) ** 4 / (np.pi * f * big) ** 2
    return float(np.sum(weight)) * upto / f.size * big**2 / 3.0


def white_integral(x: float, power: int) -> float:
    """∫ sin⁴u / u^power du from 0 to x: of (4) as printed (1) or corrected (2)."""
    u = _midpoints(x, 2_000_000)
    return float(np.sum(np.sin(u) ** 4 / u**power)) * x / u.size


def flicker_integral(x: float) -> float:
    """∫ sin⁴u / u³ du from 0 to x; ln 2 in the limit."""
    u = _midpoints(x, 2_000_000)
    return float(np.sum(np.sin(u) ** 4 / u**3)) * x / u.size


def _midpoints(end: float, count: int) -> Floats:
    return np.asarray((np.arange(count) + 0.5) * end / count)


class DensityRatios(NamedTuple):
    """Measured density of quantised angle over that of (3), with t0 and with the group's time T."""

    by_interval: float
    by_group: float


def quantised_spectrum(rng: np.random.Generator, low: float = 5.0, high: float = 15.0) -> DensityRatios:
    """Mean density of a differenced white angle error in a band, Hz, over (3)'s: with t0, and with T = √3 s."""
    rates = RATE * np.diff(rng.standard_normal(COUNT + 1))
    f = np.fft.rfftfreq(COUNT, 1.0 / RATE)
    inside = (f >= low) & (f <= high)
    density = float(np.mean(np.abs(np.fft.rfft(rates))[inside] ** 2)) / (COUNT * RATE)

    def printed(t: float) -> float:
        return float(np.mean(4.0 / t * np.sin(np.pi * f[inside] * t) ** 2))  # [Ou2017] (3): Q = 1

    return DensityRatios(density / printed(1.0 / RATE), density / printed(math.sqrt(3.0)))


class Slopes(NamedTuple):
    """Slopes of the Allan deviation: a rounded angle, a rounded rate, white noise, and a random walk of the rate."""

    angle: float
    rate: float
    rate_at_second: float
    white: float
    walk: float


def slopes(rng: np.random.Generator) -> Slopes:
    """Of what is called quantisation, and of what is called a random walk, in one record of each."""
    n = np.unique(np.geomspace(1, 1000, 40).astype(np.int64))
    white = errors.white_sd(np.array(dps(0.015)), RATE) * rng.standard_normal(COUNT)
    step = dps(1.0 / 80.0)
    rounded = step * np.rint(white / step) - white
    step = 15.2  # "; its rounding scatters by 4.4"
    angle = np.cumsum(rng.standard_normal(COUNT + 1) * 40.0)  # moves by more than a step, so that rounding is white
    quantised = RATE * np.diff(step * np.rint(angle / step) - angle)
    walk = errors.random_walk(np.ones(3), COUNT, RATE, rng)[:, 0]
    late = n >= 50
    devs = [deviation(rates, n) for rates in (quantised, rounded, white, walk)]
    return Slopes(
        slope(n / RATE, devs[0]),
        slope(n / RATE, devs[1]),
        float(deviation(rounded, [500])[0]) / step_density(dps(1.0 / 80.0)),
        slope(n / RATE, devs[2]),
        slope(n[late] / RATE, devs[3][late]),
    )


def step_density(step: float) -> float:
    """N of a rounded rate: a standard deviation of step/√12 in each of 500 samples a second."""
    return step / math.sqrt(12.0) / math.sqrt(RATE)


class Scatter(NamedTuple):
    """Relative standard deviation of σ at `FACTORS`: by eq 7, by theory for white noise, and of records."""

    formula: Floats
    theory: Floats
    white: Floats
    white_disjoint: Floats
    flicker: Floats


def scatter(rng: np.random.Generator, records: int) -> Iterator[Scatter]:
    """Of so many records of white noise and half as many of flicker; yields now and then, the last is whole."""
    devs: dict[str, list[Floats]] = {"white": [], "white_disjoint": [], "flicker": []}
    formula = np.array([percent_error(n / RATE, COUNT / RATE) for n in FACTORS])
    theory = 1.0 / np.sqrt(2.0 * edf("oadev", 0.0, COUNT, FACTORS))
    ones = np.ones(3)
    for i in range(-(-records // 6)):
        for _ in range(2):
            noise = errors.white(ones, COUNT, rng)
            devs["white"].append(deviation(noise, FACTORS))
            devs["white_disjoint"].append(deviation(noise, FACTORS, "adev"))
        devs["flicker"].append(deviation(errors.flicker(ones, 2 * COUNT, rng)[COUNT:], FACTORS))
        if i % 17 == 16 or 6 * (i + 1) >= records:
            by = {name: np.concatenate(of, axis=1) for name, of in devs.items()}
            yield Scatter(formula, theory, **{name: of.std(axis=1) / of.mean(axis=1) for name, of in by.items()})


def every_sum(rates: Floats, n: ArrayLike) -> float:
    """Largest relative difference of the curve at every factor from sums of the definition at some of them."""
    every = every_adev(rates)
    direct = np.array([allan_sum(rates, int(k)) for k in np.asarray(n)])
    return float(np.max(np.abs(every[np.asarray(n, int) - 1] / direct - 1.0)))


def peer(rates: Floats, n: ArrayLike) -> float | None:
    """Largest relative difference from AllanTools; None where it is not installed."""
    try:
        allantools = import_module("allantools")  # an extra of the benchmarks
    except ImportError:
        return None
    tau, theirs, *_ = allantools.oadev(rates, rate=1.0, data_type="freq", taus=np.asarray(n, float))
    ours = curves(rates[:, np.newaxis], 1.0, np.asarray(tau, np.int64))[0].dev
    return float(np.max(np.abs(ours / theirs - 1.0)))


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
    white, lines = white_by_readings(rng), slopes(rng)
    spectra = quantised_spectrum(rng)
    rates = np.ascontiguousarray(drawn(TABLE_1, rng)[:, 2])
    step("is eq 7 right?")
    measured = list(scatter(rng, records))[-1]
    outcomes = [
        *_sums(white, rates),
        *_integrals(spectra),
        *_terms(lines),
        *_percentages(),
        *_units(),
        *_scattered(measured),
    ]
    tables = [FIN.table("misprints_each_computed", of={row.key: row for row in outcomes}), _right(measured, records)]
    return FIN.part("algorithm", tables=tables, figures=[_figure(white)]), outcomes


def _sums(white: White, rates: Floats) -> list[Outcome]:
    """Steps 1 to 4."""
    n = np.unique(np.geomspace(1, COUNT // 2, 200).astype(np.int64))
    from_peer = peer(rates, n)
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
        FIN.row("allan.direct", best=every_sum(rates, n)),
        FIN.row(
            "allan.peer",
            best=every_sum(small, np.arange(1, 41)) if from_peer is None else from_peer,
            what=FIN.text("same_against_allantools") if from_peer is not None else FIN.text("same_at_n_1"),
        ),
        FIN.row("allan.last", faithful=float(small.size - 2 * (small.size // 2)), best=1.0),
    ]


def _integrals(spectra: DensityRatios) -> list[Outcome]:
    """(3), (4) and (6)."""
    late, later = 1e3, 1e4
    growth = (white_integral(later, 1) - white_integral(late, 1)) / math.log(later / late)
    return [
        FIN.row("eq3.density", faithful=spectra.by_group, best=spectra.by_interval),
        FIN.row("eq3.nyquist", faithful=quantisation_integral(1.0 / RATE, math.sqrt(3.0), RATE / 2.0), best=1.0),
        FIN.row("eq4.white", best=4.0 / math.pi * white_integral(late, 2)),
        FIN.row("eq4.growth", faithful=growth, best=white_integral(later, 2) - white_integral(late, 2)),
        FIN.row("eq6.flat", faithful=1.0, best=math.sqrt(2.0 / math.pi * flicker_integral(late))),
    ]


def _terms(lines: Slopes) -> list[Outcome]:
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


def _scattered(scatter: Scatter) -> list[Outcome]:
    """What (7) is worth at 1 s."""
    return [
        FIN.row(f"eq7.{name}", faithful=100.0 * float(scatter.formula[0]), best=100.0 * float(value[0]))
        for name, value in (
            ("white", scatter.white),
            ("disjoint", scatter.white_disjoint),
            ("flicker", scatter.flicker),
        )
    ]


def _right(scatter: Scatter, records: int) -> Table:
    names = (
        (FIN.text("eq_7"), scatter.formula),
        (FIN.text("overlapping_white_theory"), scatter.theory),
        (FIN.text("overlapping_white"), scatter.white),
        (FIN.text("disjoint_white"), scatter.white_disjoint),
        (FIN.text("overlapping_flicker"), scatter.flicker),
    )
    rows = [[name, *(f"{100.0 * v:.2f}" for v in values)] for name, values in names]
    return FIN.table("is_eq_7", rows, records=records, records_2=records // 2)


def _figure(white: White) -> Figure:
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
