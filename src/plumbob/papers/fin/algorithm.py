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
from plumbob.papers.description import FIN
from plumbob.papers.fin.datasheet import TABLE, percent_error
from plumbob.papers.fin.records import COUNT, LENGTH, RATE, TABLE_1, drawn, printed
from plumbob.papers.outcome import Outcome, Part
from plumbob.papers.workspace import Work
from plumbob.reporting.content import MUTED, SERIES, Figure
from plumbob.reporting.noise import log_ticks
from plumbob.simulation import errors

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase


READINGS: Final = ("right", "moving", "disjoint")
"""Sums of (2): corrected; neighbouring moving averages; neighbouring groups of (1), divided by 2(N − 2n)."""
FACTORS: Final = (500, 750, 866, 1581)
"""Samples of 1, 1.5, √3 and √10 s."""


def allan_sum(rates: Floats, n: int, reading: str = "right") -> float:
    """Allan deviation of samples (N,) at the averaging factor n by the sum of (2), in their unit.

    "right" takes means n samples apart and N − 2n + 1 differences; the others are (2) as it is printed, "moving" with
    the means of moving windows, "disjoint" with the groups of (1); NaN where a printed sum has no term.
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


def quantisation_integral(t0: float, big: float, upto: float) -> float:
    """(4) of (3) up to a frequency, Hz, over 3Q²/T², with t0 where (3) prints T; 1 without an end, T ≥ 2 t0."""
    f = _midpoints(upto, 400_000)
    weight = 16.0 / t0 * np.sin(np.pi * f * t0) ** 2 * np.sin(np.pi * f * big) ** 4 / (np.pi * f * big) ** 2
    return float(np.sum(weight)) * upto / f.size * big**2 / 3.0


def white_integral(x: float, power: int) -> float:
    """∫ sin⁴u / u^power du from 0 to x: of (4) as printed (1) or corrected (2), and of (6) (3), ln 2 in the limit."""
    u = _midpoints(x, 2_000_000)
    return float(np.sum(np.sin(u) ** 4 / u**power)) * x / u.size


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
        float(deviation(rounded, [500])[0]) / (dps(1.0 / 80.0) / math.sqrt(12.0) / math.sqrt(RATE)),
        slope(n / RATE, devs[2]),
        slope(n[late] / RATE, devs[3][late]),
    )


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


def part(work: Work, step: Callable[[str], None], records: int) -> Part:
    """The algorithm; the scatter of σ is that of so many records of white noise, and half as many of flicker."""
    rng = np.random.default_rng([work.seed, 7])
    step("equations as printed")
    white, lines = white_by_readings(rng), slopes(rng)
    spectra = quantised_spectrum(rng)
    rates = np.ascontiguousarray(drawn(TABLE_1, rng)[:, 2])
    step("is eq 7 right?")
    measured = list(scatter(rng, records))[-1]
    late, later = (white_integral(end, 1) for end in (1e3, 1e4))
    flat = white_integral(1e3, 2), white_integral(1e4, 2)
    n, level = round(math.sqrt(3.0) * RATE), 0.664 * printed("B")
    q, cross = printed("Q")[2], (60.0 * printed("N") / level) ** 2
    fitting = (printed("N") / level) ** 2
    formula = 100.0 * float(measured.formula[0])
    outcomes = [
        *_sums(white, rates),
        *FIN.rows(
            {
                "eq3.density": (spectra.by_group, spectra.by_interval),
                "eq3.nyquist": (quantisation_integral(1.0 / RATE, math.sqrt(3.0), RATE / 2.0), 1.0),
                "eq4.white": (None, 4.0 / math.pi * flat[0]),
                "eq4.growth": ((later - late) / math.log(1e4 / 1e3), flat[1] - flat[0]),
                "eq6.flat": (1.0, math.sqrt(2.0 / math.pi * white_integral(1e3, 3))),
                "name.white": (lines.white, lines.walk),
                "quantised.angle": (None, lines.angle),
                "quantised.rate": (lines.rate, lines.angle),
                "eq7": 100.0 * percent_error(n / RATE, LENGTH),
                "eq7.n": float(n),
                **{f"interval.{entry.letter}.{entry.axis}": entry.tau[0] for entry in TABLE},
                "unit.Q": (math.sqrt(3.0) * q * RATE, math.sqrt(3.0) * q / 3600.0 * RATE),
                "unit.R.453z": (float(cross[2]), float(fitting[2])),
                "unit.R.290x": (float(cross[0]), float(fitting[0])),
                "unit.B.453z": float((printed("N")[2] / printed("B")[2]) ** 2),
                "eq7.white": (formula, 100.0 * float(measured.white[0])),
                "eq7.disjoint": (formula, 100.0 * float(measured.white_disjoint[0])),
                "eq7.flicker": (formula, 100.0 * float(measured.flicker[0])),
            }
        ),
    ]
    names = ("eq_7", "overlapping_white_theory", "overlapping_white", "disjoint_white", "overlapping_flicker")
    rows = [
        [FIN.text(name), *(f"{100.0 * v:.2f}" for v in values)] for name, values in zip(names, measured, strict=True)
    ]
    tables = [
        FIN.table("misprints_each_computed", of={row.key: row for row in outcomes}),
        FIN.table("is_eq_7", rows, records=records, records_2=records // 2),
    ]
    return FIN.part("algorithm", tables=tables, figures=[_figure(white)]), outcomes


def _sums(white: White, rates: Floats) -> list[Outcome]:
    """Steps 1 to 4."""
    n = np.unique(np.geomspace(1, COUNT // 2, 200).astype(np.int64))
    from_peer, small = peer(rates, n), rates[:1000]
    slope, second = white.slope("right"), white.at_second("right")
    low, high = (1.0 + 3.0 * side * percent_error(1.0, LENGTH) for side in (-1.0, 1.0))
    outcomes = FIN.rows({"allan.slope": (None, slope)})
    outcomes.append(FIN.row("allan.second", best=second, best_bar=(low, high)))
    for reading, known in (("moving", 0.045), ("disjoint", 0.041)):
        key, bar, of = f"misprint.eq2.{reading}", (known * low, known * high), white.at_second(reading)
        outcomes += FIN.rows({f"{key}.slope": (white.slope(reading), slope)})
        outcomes.append(FIN.row(f"{key}.second", faithful=of, best=second, faithful_bar=bar))
    against = FIN.text("same_at_n_1") if from_peer is None else FIN.text("same_against_allantools")
    ours = every_sum(small, np.arange(1, 41)) if from_peer is None else from_peer
    return [
        *outcomes,
        FIN.row("allan.direct", best=every_sum(rates, n)),
        FIN.row("allan.peer", best=ours, what=against),
        FIN.row("allan.last", faithful=float(small.size - 2 * (small.size // 2)), best=1.0),
    ]


def _figure(white: White) -> Figure:
    names = {
        "right": (FIN.text("corrected"), SERIES[0], "solid"),
        "moving": (FIN.text("as_printed_moving_averages"), SERIES[1], "dashed"),
        "disjoint": (FIN.text("as_printed_groups"), SERIES[2], "dotted"),
    }

    def draw(canvas: "FigureBase") -> None:
        ax = canvas.subplots()
        for reading, (_, colour, dash) in names.items():
            ax.loglog(white.tau, white.dev[reading], color=colour, linestyle=dash, linewidth=1.4)
        ax.loglog(white.tau, white.tau**-0.5, color=MUTED, linewidth=0.7)
        for axis in (ax.xaxis, ax.yaxis):
            log_ticks(axis, (1,))

    return FIN.figure("white_noise_by", draw, lines=[*names.values(), (FIN.text("truth"), MUTED, "solid")])
