"""The paper's second test over many seeds: a turntable that speeds up evenly and then holds its rate, scored."""

import math
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from plumbob.calibration.gyr.drift import GyroDrift
from plumbob.core.check import Floats
from plumbob.papers.trackball.records import SAMPLES, SLOPE, STEP, RampFilter, contenders, on_turntable, scalar_filter

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
    """Errors of one channel on the turntable, over all seeds.

    Attributes
    ----------
    name : str
        Of the filter, or `MEASURED` or `REMOVED`.
    ramp_rms, hold_rms, late_rms : float
        Root mean square while it speeds up, while it holds, and there without the first 5 s, rad/s.
    ramp_mean, hold_mean : float
        Mean error, rad/s; negative where the filter is behind.
    angle : float
        Largest error of the integrated angle while it speeds up, mean over the seeds, rad.
    lag : float
        How far it stays behind what it is given, late on the ramp, rad/s.
    lag_theory : float
        The same in theory, once it has settled.
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
    """Run the test with each seed; results by name.

    Parameters
    ----------
    seeds : sequence of int
        One run each.
    scale : float
        Relative error of the gain.
    """
    competing = list(contenders())
    mean = np.mean([_one_run(seed, scale, competing) for seed in seeds], axis=0)
    names = [MEASURED, REMOVED, *(c.name for c in competing)]
    lags = [0.0, 0.0, *(SLOPE * STEP * c.lag for c in competing)]
    return {name: _result(name, row, lag) for name, row, lag in zip(names, mean, lags, strict=True)}


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


def _one_run(seed: int, scale: float, competing: Sequence[RampFilter]) -> Floats:
    """Figures (m, 7) of the raw rate, of the compensated one, and of every filter after it."""
    (t, true, measured), given = _given(seed, scale)
    after = [given, *(c.smooth(t, given) for c in competing)]
    return np.array([_figures(measured, true, measured), *(_figures(rate, true, given) for rate in after)])


def _figures(rate: Floats, true: Floats, given: Floats) -> Floats:
    ramp, hold = (rate - true)[:SAMPLES], (rate - true)[SAMPLES:]
    angle = np.abs(STEP * np.cumsum(ramp)).max()
    lag = np.mean((given - rate)[SETTLED:SAMPLES])
    squares = [np.mean(part**2) for part in (ramp, hold, hold[HELD:])]
    return np.array([*squares, ramp.mean(), hold.mean(), angle, lag])


def _result(name: str, row: Floats, lag: float) -> OnTurntable:
    ramp, hold, late = np.sqrt(row[:3]).tolist()
    ramp_mean, hold_mean, angle, measured = row[3:].tolist()
    return OnTurntable(name, ramp, hold, late, ramp_mean, hold_mean, angle, measured, lag)
