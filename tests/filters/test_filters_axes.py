"""Single axes: stuck, with a last digit that flickers, at an end of range that nobody declared, wrapped around."""

import numpy as np
import pytest

from plumbob import Filter, Frame, ImuData
from plumbob.core import flags
from plumbob.core.units import dps
from plumbob.filters.input_checks import LONG
from plumbob.filters.smoother import Smoother
from tests.helpers.motion import consistent

N, BEGIN, END = 4000, 1500, 3000
DATA, TRUTH = consistent(N, amplitude=2.0)
NOISE = {"gyr": dps(0.1), "acc": 0.03, "mag": 0.3}
STEP = {"gyr": dps(1.0) / 16.4, "acc": 9.80665 / 2048.0, "mag": 0.15}  # a digit of an MPU-9250 at its full range
STUCK = {"gyr": flags.GYR_STUCK, "acc": flags.ACC_STUCK, "mag": flags.MAG_STUCK}


def with_noise(seed=0):
    """Samples in whole digits."""
    rng = np.random.default_rng(seed)
    noisy = {name: getattr(DATA, name) + rng.normal(0.0, sd, (N, 3)) for name, sd in NOISE.items()}
    return {name: STEP[name] * np.rint(values / STEP[name]) for name, values in noisy.items()}


def words_of(triads, name="mekf"):
    imu = ImuData(t=DATA.t, **triads)
    if name == "smoother":
        return Smoother(frame=Frame.ENU).process(imu).flags
    return Filter(name, frame=Frame.ENU).process(imu, look=False).flags


@pytest.mark.parametrize("seed", range(5))
def test_what_is_well_is_not_flagged(seed):
    sensed = sum(STUCK.values()) | flags.GYR_CLIPPED | flags.GYR_INVALID
    assert not (words_of(with_noise(seed)) & sensed).any()


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
    assert found[first:END].all()
    assert not found[END + 2 :].any()


def test_an_axis_at_rest_that_says_nothing_new_is_not_stuck():
    """A sensor whose noise is below its digit: only where the others move does it have to."""
    triads = with_noise()
    for values in triads.values():
        values[BEGIN:END] = values[BEGIN]
        values[BEGIN:END, 0] += 1e-3 * np.random.default_rng(2).normal(size=END - BEGIN)  # so that the triad is alive
    assert not (words_of(triads)[:END] & sum(STUCK.values())).any()


def test_an_axis_that_never_moved_measures_nothing():
    """As of a unit with two gyroscopes: zero, and never anything else."""
    triads = with_noise()
    triads["gyr"][:, 2] = 0.0
    assert not (words_of(triads) & flags.GYR_STUCK).any()


@pytest.mark.parametrize("estimator", ["mekf", "smoother"])
def test_an_end_of_range_that_nobody_declared(estimator):
    """What stays the same for six samples at the largest rate is at the end, and so is all that comes there later."""
    triads, end = with_noise(), 1.5
    triads["gyr"] = np.clip(triads["gyr"], -end, end)
    beyond = (np.abs(triads["gyr"]) >= end).any(axis=1)
    found = (words_of(triads, estimator) & flags.GYR_CLIPPED) != 0
    assert not found[~(np.abs(triads["gyr"]) >= 0.99 * end).any(axis=1)].any()
    assert np.count_nonzero(beyond) > 500
    assert np.mean(found[beyond]) > 0.9  # not those before the first six of an axis


@pytest.mark.parametrize("estimator", ["mekf", "smoother"])
def test_a_rate_that_wraps_around(estimator):
    """From one end to the other in a step, and back: what lies between is impossible."""
    triads, end = with_noise(), 1.5
    wrapped = (np.abs(triads["gyr"]) > end).any(axis=1)
    triads["gyr"] = np.mod(triads["gyr"] + end, 2.0 * end) - end
    found = (words_of(triads, estimator) & flags.GYR_INVALID) != 0
    assert np.count_nonzero(wrapped) > 500
    assert np.mean(found[wrapped]) > 0.9
    assert np.mean(found[~wrapped]) < 0.02


def test_a_force_that_changes_its_sign_from_sample_to_sample_does_not_wrap():
    """Vibration near half the sampling rate, as of a ringing phone on BROAD's table (trial 26)."""
    triads = with_noise()
    triads["acc"] += 3.0 * np.where(np.arange(N) % 2, 1.0, -1.0)[:, np.newaxis]
    assert not (words_of(triads) & (flags.ACC_INVALID | flags.ACC_STUCK)).any()
