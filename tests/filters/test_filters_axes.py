"""Single axes: stuck, with a last digit that flickers, at an end of range that nobody declared, wrapped around."""

import numpy as np
import pytest

from plumbob import Filter, Frame, ImuData, flags
from plumbob.core.units import dps
from plumbob.filters.input_checks import LONG
from plumbob.filters.smoother import Smoother
from tests.helpers.motion import consistent

N, BEGIN, END = 4000, 1500, 3000
DATA, _ = consistent(N, amplitude=2.0)
NOISE = {"gyr": dps(0.1), "acc": 0.03, "mag": 0.3}
STEP = {"gyr": dps(1.0) / 16.4, "acc": 9.80665 / 2048.0, "mag": 0.15}  # a digit of an MPU-9250 at its full range
STUCK = {"gyr": flags.GYR_STUCK, "acc": flags.ACC_STUCK, "mag": flags.MAG_STUCK}


def with_noise(seed=0):
    rng = np.random.default_rng(seed)
    return {k: STEP[k] * np.rint((getattr(DATA, k) + rng.normal(0.0, sd, (N, 3))) / STEP[k]) for k, sd in NOISE.items()}


def words_of(triads, name="mekf"):
    imu = ImuData(t=DATA.t, **triads)
    if name == "smoother":
        return Smoother(frame=Frame.ENU).process(imu).flags
    return Filter(name, frame=Frame.ENU).process(imu, look=False).flags


def test_what_is_well_is_not_flagged():
    sensed = sum(STUCK.values()) | flags.GYR_CLIPPED | flags.GYR_INVALID
    for seed in range(5):
        assert not (words_of(with_noise(seed)) & sensed).any()
    # vibration near half the sampling rate, as of a ringing phone on BROAD's table (trial 26), does not wrap
    triads = with_noise()
    triads["acc"] += 3.0 * np.where(np.arange(N) % 2, 1.0, -1.0)[:, np.newaxis]
    assert not (words_of(triads) & (flags.ACC_INVALID | flags.ACC_STUCK)).any()
    # zero, and never anything else, as of a unit with two gyroscopes: an axis that never moved measures nothing
    triads = with_noise()
    triads["gyr"][:, 2] = 0.0
    assert not (words_of(triads) & flags.GYR_STUCK).any()


@pytest.mark.parametrize("estimator", ["mekf", "vqf", "smoother"])
@pytest.mark.parametrize("flicker", [0, 1])
@pytest.mark.parametrize("triad", ["gyr", "acc", "mag"])
def test_an_axis_that_sticks_while_the_others_move(triad, flicker, estimator):
    """Flagged from a little after 0.25 s on, and right again with the third value."""
    triads = with_noise()
    bits = np.random.default_rng(1).integers(0, 1 + flicker, END - BEGIN)
    stuck = 0.3 * np.abs(triads[triad]).max()  # not at its largest, where it could be the end of a range
    triads[triad][BEGIN:END, 2] = STEP[triad] * (np.rint(stuck / STEP[triad]) + bits)
    found = (words_of(triads, estimator) & STUCK[triad]) != 0
    first = int(np.argmax(found))
    assert BEGIN + 100 * LONG - 1 <= first < BEGIN + 100 * LONG + 20
    assert found[first:END].all() and not found[END + 2 :].any()


def test_an_axis_at_rest_that_says_nothing_new_is_not_stuck():
    """A sensor whose noise is below its digit: only where the others move does it have to."""
    triads = with_noise()
    for values in triads.values():
        values[BEGIN:END] = values[BEGIN]
        values[BEGIN:END, 0] += 1e-3 * np.random.default_rng(2).normal(size=END - BEGIN)  # so that the triad is alive
    assert not (words_of(triads)[:END] & sum(STUCK.values())).any()


@pytest.mark.parametrize("estimator", ["mekf", "smoother"])
def test_an_end_of_range_that_nobody_declared_and_a_rate_that_wraps_around(estimator):
    """What stays the same for six samples at the largest rate is at the end, and so is all that comes there later.

    One that goes from one end to the other in a step, and back, is impossible in between.
    """
    triads, end = with_noise(), 1.5
    gyr = triads["gyr"]
    beyond, inside = (np.abs(gyr) >= end).any(axis=1), ~(np.abs(gyr) >= 0.99 * end).any(axis=1)
    assert np.count_nonzero(beyond) > 500
    clipped = (words_of({**triads, "gyr": np.clip(gyr, -end, end)}, estimator) & flags.GYR_CLIPPED) != 0
    assert not clipped[inside].any()
    assert np.mean(clipped[beyond]) > 0.9  # not those before the first six of an axis
    invalid = (words_of({**triads, "gyr": np.mod(gyr + end, 2.0 * end) - end}, estimator) & flags.GYR_INVALID) != 0
    assert np.mean(invalid[beyond]) > 0.9 and np.mean(invalid[~beyond]) < 0.02
