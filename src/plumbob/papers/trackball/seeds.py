"""Both tests of the paper over many seeds: the unit at rest before and after the scalar filter, and on the turntable.

Ratios are root mean squares over all seeds and channels, after the filter over before it. The paper takes the mean of
the record off first, which changes nothing here: the filter passes a constant as it is, and neither a variance nor an
Allan deviation sees it. Only the integrated angle does, and there the mean is what the application suffers from. The
turntable speeds up evenly and then holds its rate.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from plumbob.calibration.gyr.drift import GyroDrift
from plumbob.core.check import Floats
from plumbob.filters.channel_scalar import steady_gain
from plumbob.noise import analyse, curve, deviation, edf
from plumbob.noise.bands import least_squares
from plumbob.noise.terms import TERMS
from plumbob.papers.trackball.records import (
    RATIOS,
    SAMPLES,
    SLOPE,
    STEP,
    WALK,
    at_rest,
    contenders,
    on_turntable,
    scalar_filter,
)

TAUS: Final = (0.1, 0.2, 0.4, 1.0, 2.0, 4.0, 10.0, 50.0)
"""Averaging times of the paper, s."""
LONG: Final = 4 * 3600.0
"""Length of the long record, s."""
LONG_TAUS: Final = (0.1, 1.0, 10.0, 100.0, 600.0)
"""Averaging times of the long record, s."""
WHITE_LENGTH: Final = 10_000.0
"""Length of the record of white noise alone, s: 50 times the memory of the slowest filter."""
MEMORIES: Final = 5.0
"""After so many samples over its gain a filter has settled to 1 %."""


class Short(NamedTuple):
    """What the filters do to the paper's record, by Q/R.

    `variance`, `angle` (k,): ratio of the variances, start included, and of the rms of the integrated angles, mean
    included; `adev` (k, 8): ratio of the Allan deviations at each of `TAUS`; `before` (8,): allan deviation of what
    they were given, rad/s; `scatter` (8,): relative standard deviation of one record's Allan deviation of disjoint
    averages.
    """

    variance: Floats
    angle: Floats
    adev: Floats
    before: Floats
    scatter: Floats


class Long(NamedTuple):
    """What the filters do to four hours: ratios (k, 5) and deviations before (5,), rad/s; N and B of one channel."""

    adev: Floats
    before: Floats
    white: float
    flicker: float


class PowerFits(NamedTuple):
    """Fits of five powers of τ to eight Allan variances of one channel.

    `measured` (8,): allan variances, (rad/s)²; `plain`, `weighted` (5,): A₋₂ to A₂, (rad/s)² times s to the
    opposite power: by plain least squares, and weighted, none below zero.
    """

    measured: Floats
    plain: Floats
    weighted: Floats


def theory(ratio: float) -> float:
    """Share K / (2 − K) of the variance of white noise that a settled scalar filter leaves, Σ K² (1 − K)²ⁱ."""
    gain = steady_gain(ratio)
    return gain / (2.0 - gain)


def degrees_of_freedom(count: int, tau: float, kind: str = "oadev") -> float:
    """Degrees of freedom of an Allan variance of white noise at `tau`, s, from a record of `count` samples."""
    return float(edf(kind, 0.0, count, [round(tau / STEP)])[0])


def factors(taus: Sequence[float]) -> list[int]:
    """Averaging factors of averaging times, s."""
    return [round(tau / STEP) for tau in taus]


def measure_short(seeds: Sequence[int]) -> Short:
    """The paper's record, one of three channels for each seed."""
    before, after, single = [], [], []
    for seed in seeds:
        rest = at_rest(seed, SAMPLES * STEP)
        single.append(deviation(rest.measured, factors(TAUS), "adev").T)
        before.append(_squares(rest.measured))
        after.append([_squares(scalar_filter(q).smooth(rest.t, rest.measured)) for q in RATIOS])
    raw, smoothed, adev = np.mean(before, axis=0), np.mean(after, axis=0), np.concatenate(single)
    ratio = smoothed / raw
    scatter = adev.std(axis=0) / adev.mean(axis=0)
    return Short(ratio[:, 0], np.sqrt(ratio[:, 1]), np.sqrt(ratio[:, 2:]), np.sqrt(raw[2:]), scatter)


def measure_white(seeds: Sequence[int]) -> Floats:
    """Ratio of the variances (k,) of white noise alone, once each filter has settled."""
    before, after = [], []
    for seed in seeds:
        rest = at_rest(seed, WHITE_LENGTH, flicker=0.0)
        before.append(np.mean(rest.measured**2))
        smooth = (scalar_filter(q).smooth(rest.t, rest.measured)[settled(q) :] for q in RATIOS)
        after.append([np.mean(rate**2) for rate in smooth])
    return np.asarray(np.mean(after, axis=0) / np.mean(before))


def settled(ratio: float) -> int:
    """Samples after which the scalar filter of that Q/R has settled to 1 %."""
    return math.ceil(MEMORIES / steady_gain(ratio))


def measure_long(seeds: Sequence[int]) -> Long:
    """Four hours with a random walk of the bias besides, and the noise that an analysis finds in the first record."""
    before, after = [], []
    analysis = None
    for seed in seeds:
        rest = at_rest(seed, LONG, walk=WALK)
        before.append(_allan_variance(rest.measured, LONG_TAUS))
        smooth = (scalar_filter(q).smooth(rest.t, rest.measured) for q in RATIOS)
        after.append([_allan_variance(rate, LONG_TAUS) for rate in smooth])
        analysis = analysis or analyse(np.ascontiguousarray(rest.measured[:, 0]), STEP)
    assert analysis is not None
    raw = np.mean(before, axis=0)
    terms = analysis.terms
    return Long(np.sqrt(np.mean(after, axis=0) / raw), np.sqrt(raw), terms["N"].value, terms["B"].value)


def powers(taus: ArrayLike = TAUS) -> Floats:
    """Columns τⁿ, n = −2 to 2, of the paper's least squares, (8, 5) [Chen2013] (14)."""
    return np.asarray(np.power.outer(np.asarray(taus), np.arange(-2.0, 3.0)))  # [Chen2013] (14)


def fit(rate: Floats) -> PowerFits:
    """Both fits of a channel (N,); the weights are those of the degrees of freedom."""
    measured = deviation(rate, factors(TAUS), "adev") ** 2
    plain = np.asarray(np.linalg.lstsq(powers(), measured, rcond=None)[0], dtype=np.float64)
    terms = least_squares(curve(rate, STEP, np.array(factors(TAUS)))).terms
    fitted = {term.power: terms[letter].value ** 2 * term.share for letter, term in TERMS.items() if letter in terms}
    return PowerFits(measured, plain, np.array([fitted.get(power, 0.0) for power in range(-2, 3)]))


def measure_fits(seeds: Sequence[int]) -> tuple[float, float]:
    """Share of the records in which a coefficient is negative, by the plain fit and by the weighted one."""
    fits = [fit(np.ascontiguousarray(at_rest(seed, SAMPLES * STEP).measured[:, 0])) for seed in seeds]
    plain, weighted = (
        float(np.mean([(coefficients < 0.0).any() for coefficients in kind]))
        for kind in ([fitted.plain for fitted in fits], [fitted.weighted for fitted in fits])
    )
    return plain, weighted


def _squares(rate: Floats) -> Floats:
    """Mean squares of a record about its mean, and of its angle; then its Allan variances."""
    angle = STEP * np.cumsum(rate, axis=0)
    level = [np.mean((rate - rate.mean(axis=0)) ** 2), np.mean(angle**2)]
    return np.concatenate((level, _allan_variance(rate, TAUS)))


def _allan_variance(rate: Floats, taus: Sequence[float]) -> Floats:
    return np.asarray(np.mean(deviation(rate, factors(taus)) ** 2, axis=1))


SCALES: Final = (0.0, 0.01)
"""Errors of the gain with which the test is run."""
SETTLED: Final = 600
"""Samples after which a filter's lag is measured, on the rest of the ramp."""
HELD: Final = 50
"""Samples of the constant rate, 5 s, that the second score of it leaves out: what the ramp left there."""
MEASURED: Final = "measured"
REMOVED: Final = "bias removed"
"""The raw rate, and what every filter gets."""


class OnTurntable(NamedTuple):
    """Errors of one channel on the turntable, over all seeds, rad/s; `name` is a filter's, or `MEASURED` or `REMOVED`.

    `ramp_rms`, `hold_rms`, `late_rms`: root mean square while it speeds up, while it holds, and there without the
    first 5 s; `ramp_mean`, `hold_mean`: mean, negative where the filter is behind; `angle`: largest error of the
    integrated angle while it speeds up, mean over the seeds, rad; `lag`, `lag_theory`: how far it stays behind what
    it is given, late on the ramp, and in theory, once it has settled.
    """

    name: str
    ramp_rms: float
    hold_rms: float
    late_rms: float
    ramp_mean: float
    hold_mean: float
    angle: float
    lag: float
    lag_theory: float


def measure_turntable(seeds: Sequence[int], scale: float) -> dict[str, OnTurntable]:
    """Run the test with each seed and a relative error of the gain; results by name."""
    competing = list(contenders())
    figures = []
    for seed in seeds:  # of the raw rate, of the compensated one, and of every filter after it
        (t, true, measured), given = _given(seed, scale)
        after = [given, *(c.smooth(t, given) for c in competing)]
        figures.append([_figures(measured, true, measured), *(_figures(rate, true, given) for rate in after)])
    mean = np.mean(figures, axis=0)
    names = [MEASURED, REMOVED, *(c.name for c in competing)]
    lags = [0.0, 0.0, *(SLOPE * STEP * c.lag for c in competing)]
    return {
        name: OnTurntable._make([name, *np.sqrt(row[:3]).tolist(), *row[3:].tolist(), lag])
        for name, row, lag in zip(names, mean, lags, strict=True)
    }


def best_gain(seeds: Sequence[int], gains: Sequence[float]) -> tuple[float, float]:
    """The settled gain K of a scalar filter with the least error on the ramp, and that error, rms, rad/s."""
    errors: Mapping[float, list[float]] = {gain: [] for gain in gains}
    for seed in seeds:
        run, given = _given(seed, 0.0)
        for gain, squares in errors.items():
            rate = scalar_filter(gain**2 / (1.0 - gain)).smooth(run[0], given)  # K = p/(1 + p), p² = Q/R (p + 1)
            squares.append(float(np.mean((rate - run[1])[:SAMPLES] ** 2)))
    means = {gain: float(np.mean(squares)) for gain, squares in errors.items()}
    gain = min(means, key=means.__getitem__)
    return gain, math.sqrt(means[gain])


def _given(seed: int, scale: float) -> tuple[tuple[Floats, Floats, Floats], Floats]:
    """Time, true and measured rate about the axis, and what is left of it without the bias of a rest, (N, 1)."""
    rest, run = on_turntable(seed, scale=scale)
    given = GyroDrift().at_rest(rest.measured).compensate(run.measured)[:, 2:]
    return (run.t, run.true[:, 2:], run.measured[:, 2:]), given


def _figures(rate: Floats, true: Floats, given: Floats) -> Floats:
    ramp, hold = (rate - true)[:SAMPLES], (rate - true)[SAMPLES:]
    angle = np.abs(STEP * np.cumsum(ramp)).max()
    lag = np.mean((given - rate)[SETTLED:SAMPLES])
    squares = [np.mean(part**2) for part in (ramp, hold, hold[HELD:])]
    return np.array([*squares, ramp.mean(), hold.mean(), angle, lag])
