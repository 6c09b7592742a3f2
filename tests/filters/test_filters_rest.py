"""When rest begins and what ends it."""

import math

import numpy as np
import pytest

from plumbob.core.constants import G0
from plumbob.core.units import dps
from plumbob.filters.settling import REST_SIZE, TAU, at_rest, mean_rate

AT = 2
AFTER = 1.5
LIMITS = {"rate_limit": dps(2.0), "force_limit": 0.5, "bias_limit": dps(2.0)}
LEVEL = (0.0, 0.0, G0)


class Unit:
    """A unit that is asked sample by sample whether it rests."""

    def __init__(self, dt=0.01, after=AFTER, **limits):
        self.x = np.zeros(AT + REST_SIZE + 1)
        self.x[:AT] = self.x[-1] = -5.0
        self.dt, self.limits = dt, [*{**LIMITS, **limits}.values(), after]

    def take(self, gyr=(0.0, 0.0, 0.0), acc=LEVEL, dt=None):
        return at_rest.py_func(self.x, AT, self.dt if dt is None else dt, *self.limits, *gyr, *acc)

    def still(self, seconds, **sample):
        """Feed the same sample for some time; returns the last answer."""
        return [self.take(**sample) for _ in range(round(seconds / self.dt))][-1]

    def neighbours_are_untouched(self):
        """Nothing beside the block's own places was written."""
        return (self.x[:AT] == -5.0).all() and self.x[-1] == -5.0


@pytest.mark.parametrize(("dt", "after"), [(0.001, AFTER), (0.01, AFTER), (0.04, AFTER), (0.01, 0.0), (0.01, 4.0)])
def test_rest_begins_after_its_time_and_not_before(dt, after):
    """How long is the user's choice."""
    unit = Unit(dt, after)
    answers = [unit.take() for _ in range(round(6.0 / dt))]
    first = answers.index(True) + 1
    # a sum of steps may miss the limit by its rounding, which costs one
    assert abs(first * dt - max(after, dt)) <= 1.01 * dt
    assert all(answers[first:])
    assert unit.neighbours_are_untouched()


def test_at_rest_the_mean_rate_is_the_bias():
    """White noise of σ per sample leaves σ √(2 b dt) of it, where b = 1/(4τ) is the low-pass's noise bandwidth, Hz.

    ∫ df/(1 + (2πf/ω)⁴) = ω/(4 √2) over f > 0, with the corner ω = √2/τ.
    """
    rng = np.random.default_rng(0)
    bias, sd = np.radians([1.0, -1.5, 0.5]), np.radians(0.1)
    unit = Unit()
    found = []
    for k, noise in enumerate(rng.normal(size=(20_000, 6)) * [*[sd] * 3, *[0.02] * 3]):
        assert unit.take(gyr=bias + noise[:3], acc=LEVEL + noise[3:]) or k < 200
        found.append(mean_rate.py_func(unit.x, AT))
    left = np.array(found[1000:]) - bias
    expected = sd * math.sqrt(2.0 * 0.01 / (4.0 * TAU))
    # 190 s hold about 190/τ independent means on each axis
    assert left.std() == pytest.approx(expected, rel=4.0 / math.sqrt(2.0 * 3 * 190 / TAU))
    assert np.abs(left.mean(axis=0)).max() < 4.0 * sd / math.sqrt(19_000)


@pytest.mark.parametrize(
    "motion",
    [{"gyr": (0.0, dps(3.0), 0.0)}, {"acc": (0.8, 0.0, G0)}, {"acc": (0.0, 0.0, 1.1 * G0)}],
    ids=["turn", "push", "lift"],
)
def test_motion_ends_it_at_once_and_the_time_counts_again(motion):
    unit = Unit()
    assert unit.still(3.0) and not unit.take(**motion)
    assert not unit.take(dt=0.0)  # a repeated time is no sample
    assert not unit.still(AFTER - 0.05) and unit.still(4.0)


@pytest.mark.parametrize("triad", ["gyr", "acc"])
def test_a_missing_sample_ends_it(triad):
    unit = Unit()
    assert unit.still(3.0)
    before = mean_rate.py_func(unit.x, AT)
    assert not unit.take(**{triad: (math.nan,) * 3})
    assert mean_rate.py_func(unit.x, AT) == before
    assert not unit.still(AFTER - 0.02) and unit.still(0.1) and np.isfinite(unit.x).all()


def test_a_steady_turn_is_no_rest_where_it_is_too_fast_to_be_a_bias():
    """The mean follows any steady rate, so only its size tells; each axis counts by itself."""
    assert not Unit().still(20.0, gyr=(dps(2.1), 0.0, 0.0))
    assert Unit().still(20.0, gyr=(dps(1.9), dps(-1.9), dps(1.9)))
    assert not Unit().still(20.0, gyr=(0.0, 0.0, dps(-2.1)))


@pytest.mark.parametrize(("share", "rests"), [(0.95, True), (1.05, False)])
def test_the_limit_is_the_distance_from_the_mean(share, rests):
    """A deviation that flips its sign at every sample stays out of the mean, but for dt/τ of it."""
    for amplitude, triad in ((LIMITS["rate_limit"], "gyr"), (LIMITS["force_limit"], "acc")):
        unit, found = Unit(), False
        for k in range(1000):
            deviation = (-1) ** k * share * amplitude / math.sqrt(3.0) * np.ones(3)
            found = unit.take(**{triad: (LEVEL if triad == "acc" else 0.0) + deviation})
        assert found is rests
