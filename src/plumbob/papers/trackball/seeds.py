"""Both tests of the paper simulated directly, over many seeds: the unit at rest, and on its turntable.

The same noise, as a card, goes into the rig that is recorded. Ratios are root mean squares over all seeds and channels,
after the filter over before it. The paper takes the mean of the record off first, which changes nothing here: the
filter passes a constant as it is, and neither a variance nor an Allan deviation sees it. Only the integrated angle
does, and there the mean is what the application suffers from. The turntable speeds up evenly and then holds its rate.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from plumbob.calibration.gyr.drift import GyroDrift
from plumbob.core.check import Floats
from plumbob.core.units import deg, dps, to_si
from plumbob.data.cards import NoiseCard, TriadNoise
from plumbob.filters import channel_scalar
from plumbob.filters.channel import RateFilter
from plumbob.filters.channel_average import same_noise
from plumbob.filters.channel_scalar import params_of, steady_gain
from plumbob.filters.layout import OWN
from plumbob.noise import analyse, curve, deviation, edf
from plumbob.noise.bands import least_squares
from plumbob.noise.terms import TERMS
from plumbob.rotations import Frame
from plumbob.simulation import Module, Scenario, TriadErrors, scenario, simulate

RATIOS: Final = (1e-1, 1e-2, 1e-3, 1e-4, 1e-6)
"""Q/R of the scalar filter; the paper gives neither Q nor R."""
AT_REST: Final = 1e-3
"""Q/R at which the bars of the test at rest are set, and Figures 1 to 3 are drawn."""
IN_MOTION: Final = 1e-2
"""Q/R with which Figures 4 and 5 are drawn: a smaller one lags by more."""
STEP: Final = 0.1
"""Sampling time of both tests, s [Chen2013]."""
SAMPLES: Final = 1000
"""Of each record, 100 s [Chen2013]."""
SLOPE: Final = deg(0.6)
"""Angular acceleration while the table speeds up, rad/s²: 10 r/min in 100 s [Chen2013]."""
PEAK: Final = dps(60.0)
"""Rate that is held, 10 r/min [Chen2013]."""
WHITE: Final = dps(0.1)
"""White noise of one sample, rad/s: assumed, as the paper's figures are lost."""
FLICKER: Final = to_si(36.0, "deg/h")
"""Bias instability, rad/s: assumed too."""
WALK: Final = dps(5e-4)
"""Random walk of the bias in the long record, rad/s/√s: assumed, it shows from some 100 s on."""
BIAS: Final = dps(1.5)
"""Turn-on bias of the simulated units, rad/s: what the paper's compensation takes off."""

_OTHER_SEEDS = 1_000_000  # the stretch at rest that gives the bias has noise of its own


class Record(NamedTuple):
    """Time (N,), s, true and measured rates (N, 3), rad/s."""

    t: Floats
    true: Floats
    measured: Floats


class RampFilter(NamedTuple):
    """A filter that competes: its name, how many samples late a ramp comes in theory, and what it is called with."""

    name: str
    lag: float
    filter: str
    params: dict[str, float]

    def smooth(self, t: Floats, rate: Floats) -> Floats:
        """Rate (N, k) after the filter."""
        return RateFilter(self.filter, channels=rate.shape[1], params=self.params).process(t, rate).rate


def noise_card() -> NoiseCard:
    """Noise of the rig's unit: white noise of `WHITE` per sample, and `FLICKER`."""
    noise = TriadNoise(_each(WHITE * np.sqrt(STEP)), _each(FLICKER), np.zeros(3))
    return NoiseCard("mpu3050", "assumed for the trackball paper: 0.1 °/s per sample at 10 Hz, 36 °/h", gyr=noise)


def at_rest(seed: int, duration: float, *, flicker: float = FLICKER, walk: float = 0.0, bias: float = 0.0) -> Record:
    """Three channels of the unit at rest for `duration`, s.

    `flicker`, `walk`, `bias`: bias instability, rad/s, random walk of the bias, rad/s/√s, and turn-on bias, rad/s.
    """
    errors = TriadErrors(white_sd=_each(WHITE), flicker=_each(flicker), walk_rpsd=_each(walk), bias=_each(bias))
    return _record(scenario("static"), errors, seed, duration)


def on_turntable(seed: int, *, scale: float) -> tuple[Record, Record]:
    """A rest, and then the paper's turntable: up to 60 °/s in 100 s and 100 s at that rate, z its axis.

    Both have the bias `BIAS`; `scale` is the relative error of the gain.
    """
    errors = TriadErrors(white_sd=_each(WHITE), flicker=_each(FLICKER), scale=_each(scale), bias=_each(BIAS))
    rest = at_rest(seed + _OTHER_SEEDS, SAMPLES * STEP, bias=BIAS)
    return rest, _record(scenario("turntable"), errors, seed, None)


def scalar_filter(ratio: float) -> RampFilter:
    """Scalar Kalman filter of that Q/R."""
    gain = steady_gain(ratio)
    params = params_of(ratio, noise=WHITE, dt=STEP)
    return RampFilter(f"scalar Q/R={ratio:g}", (1.0 - gain) / gain, "scalar", params._asdict())


def average_like(ratio: float) -> RampFilter:
    """Moving average that leaves as much white noise as the scalar filter of that Q/R."""
    length = same_noise(steady_gain(ratio))
    return RampFilter(f"average of {length}", 0.5 * (length - 1), "moving_average", {"samples": float(length)})


def two_state() -> RampFilter:
    """Filter with two states, as Plumbob recommends where a rate must be smooth."""
    return RampFilter("two states", 0.0, "two_state", {"noise": WHITE})


def unfiltered() -> RampFilter:
    """Moving average of a single sample, which changes nothing."""
    return RampFilter("unfiltered", 0.0, "moving_average", {"samples": 1.0})


def contenders() -> Iterator[RampFilter]:
    """Every filter of the turntable: each scalar one, its moving average, and the one with two states."""
    for ratio in RATIOS:
        yield scalar_filter(ratio)
        yield average_like(ratio)
    yield two_state()


class _Counting(float):
    """Number that counts how often it and what is made of it was added, multiplied or divided."""

    done = 0


def _counted(name: str) -> Callable[[_Counting, float], _Counting]:
    def operation(number: _Counting, other: float) -> _Counting:
        _Counting.done += 1
        return _Counting(getattr(float, name)(number, float(other)))

    return operation


for _name in ("add", "radd", "sub", "rsub", "mul", "rmul", "truediv"):
    setattr(_Counting, f"__{_name}__", _counted(f"__{_name}__"))


def operations() -> int:
    """How many additions, multiplications and divisions the scalar filter takes for a sample, the first one aside."""
    params = channel_scalar.Params()
    c = [_Counting(value) for value in channel_scalar.coefficients(params)]
    x = [_Counting(0.0) for _ in range(OWN + channel_scalar.own_state(params))]
    step: Any = getattr(channel_scalar.step, "py_func", channel_scalar.step)  # as it was before it was compiled
    step(c, x, _Counting(STEP), _Counting(0.1))
    _Counting.done = 0
    step(c, x, _Counting(STEP), _Counting(0.2))
    return _Counting.done


def _each(size: float) -> Floats:
    return np.full(3, size)


def _record(plan: Scenario, errors: TriadErrors, seed: int, duration: float | None) -> Record:
    unit = Module("trackball gyroscope", "figures of the test", gyr=errors)
    run = simulate(plan, frame=Frame.NED, sensors=unit, unit="random", seed=seed, rate=1.0 / STEP, duration=duration)
    return Record(run.imu.t, run.kinematics.rate_b, np.asarray(run.imu.gyr))


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
