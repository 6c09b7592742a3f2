"""Records for the trackball paper's tests: its unit at rest and on its turntable, and the filters that compete.

Statistics over many seeds are simulated directly; the same noise, as a card, goes into the rig that is recorded.
"""

from collections.abc import Callable, Iterator
from typing import Any, Final, NamedTuple

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.units import deg, dps, to_si
from plumbob.data.cards import NoiseCard, TriadNoise
from plumbob.filters import channel_scalar
from plumbob.filters.channel import RateFilter
from plumbob.filters.channel_average import same_noise
from plumbob.filters.channel_scalar import params_of, steady_gain
from plumbob.filters.layout import OWN
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
