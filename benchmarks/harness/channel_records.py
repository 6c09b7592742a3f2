"""Records for the tests of the trackball paper: its unit at rest and on its turntable, and the filters that compete."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.units import dps, to_si
from plumbob.filters.channel import RateFilter
from plumbob.filters.channel_average import same_noise
from plumbob.filters.channel_scalar import params_of, steady_gain
from plumbob.rotations import Frame
from plumbob.simulation import Module, Scenario, TriadErrors, scenario, simulate

RATIOS = (1e-1, 1e-2, 1e-3, 1e-4, 1e-6)
"""Q/R of the scalar filter; the paper gives neither Q nor R."""
STEP = 0.1
"""Sampling time of both tests, s [Chen2013]."""
WHITE = dps(0.1)
"""White noise of one sample, rad/s: assumed, as the paper's figures are lost."""
FLICKER = to_si(36.0, "deg/h")
"""Bias instability, rad/s: assumed too."""


class Record(NamedTuple):
    """Time (N,), s, true and measured rates (N, 3), rad/s."""

    t: Floats
    true: Floats
    measured: Floats


class Contender(NamedTuple):
    """A filter that competes: its name, how many samples late a ramp comes in theory, and what it is called with."""

    name: str
    lag: float
    filter: str
    params: dict[str, float]

    def smooth(self, t: Floats, rate: Floats) -> Floats:
        """Rate (N, k) after the filter."""
        return RateFilter(self.filter, channels=rate.shape[1], params=self.params).process(t, rate).rate


def at_rest(seed: int, duration: float, *, flicker: float = FLICKER, walk: float = 0.0, bias: float = 0.0) -> Record:
    """Three channels of the unit at rest.

    Parameters
    ----------
    seed : int
        Of the noise.
    duration : float
        Length, s.
    flicker, walk, bias : float
        Bias instability, rad/s, random walk of the bias, rad/s/√s, and turn-on bias, rad/s.
    """
    errors = TriadErrors(white_sd=_each(WHITE), flicker=_each(flicker), walk_rpsd=_each(walk), bias=_each(bias))
    return _record(scenario("static"), errors, seed, duration)


def on_turntable(seed: int, *, scale: float, bias: float) -> Record:
    """Record the paper's turntable, up to 60 °/s in 100 s and 100 s at that rate; z is its axis.

    Parameters
    ----------
    seed : int
        Of the noise.
    scale, bias : float
        Relative error of the gain, and turn-on bias, rad/s.
    """
    errors = TriadErrors(white_sd=_each(WHITE), flicker=_each(FLICKER), scale=_each(scale), bias=_each(bias))
    return _record(scenario("turntable"), errors, seed, None)


def scalar_filter(ratio: float) -> Contender:
    """Scalar Kalman filter of that Q/R."""
    gain = steady_gain(ratio)
    own = params_of(ratio, noise=WHITE, dt=STEP)
    return Contender(f"scalar Q/R={ratio:g}", (1.0 - gain) / gain, "scalar", own._asdict())


def average_like(ratio: float) -> Contender:
    """Moving average that leaves as much white noise as the scalar filter of that Q/R."""
    length = same_noise(steady_gain(ratio))
    return Contender(f"average of {length}", 0.5 * (length - 1), "moving_average", {"samples": float(length)})


def contenders() -> Iterator[Contender]:
    """Every filter of the turntable: each scalar one, its moving average, and the one with two states."""
    for ratio in RATIOS:
        yield scalar_filter(ratio)
        yield average_like(ratio)
    yield Contender("two states", 0.0, "two_state", {"noise": WHITE})


def _each(size: float) -> Floats:
    return np.full(3, size)


def _record(plan: Scenario, errors: TriadErrors, seed: int, duration: float | None) -> Record:
    unit = Module("trackball gyroscope", "figures of the test", gyr=errors)
    run = simulate(plan, frame=Frame.NED, sensors=unit, unit="random", seed=seed, rate=1.0 / STEP, duration=duration)
    return Record(run.imu.t, run.kinematics.rate_b, np.asarray(run.imu.gyr))
