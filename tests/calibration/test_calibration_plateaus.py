"""Plateaus: found wherever the rate is constant, and matched with the rate that the table had."""

import numpy as np
import pytest

from plumbob.calibration.rate_table import match_rates, plateaus
from plumbob.core.units import dps

RATE = 100.0
NOISE = float(dps(0.05))  # 0.005 °/s/√Hz at 100 Hz


def recording(levels, *, hold=6.0, ramp=2.0, noise=NOISE, bias=(0.0, 0.0, 0.0), rate=RATE):
    """Rates about z, °/s, held and ramped; the true start and end of each plateau, s."""
    start = (hold + ramp) * np.arange(len(levels))
    knots = np.stack((start, start + hold), axis=1)
    t = np.arange(round((knots[-1, 1]) * rate)) / rate
    gyr = np.zeros((t.size, 3))
    gyr[:, 2] = dps(np.interp(t, knots.ravel(), np.repeat(levels, 2)))
    return t, gyr + np.asarray(bias) + np.random.default_rng(1).normal(0.0, noise, gyr.shape), knots


@pytest.mark.parametrize("rate", [10.0, 100.0, 1000.0])
@pytest.mark.parametrize("noise", [0.0, NOISE, 10.0 * NOISE])
def test_each_plateau_is_found_and_no_ramp(rate, noise):
    t, gyr, knots = recording([0.0, 50.0, 100.0, -200.0, 0.0], noise=noise, rate=rate)
    found = plateaus(t, gyr)
    assert len(found) == len(knots)
    block = max(0.25, 4.0 / rate)
    for one, (start, stop) in zip(found, knots, strict=True):
        assert start <= t[one.start] and t[one.stop - 1] <= stop
        # a block that a ramp shares at either end, and one more that is left out
        assert t[one.stop - 1] - t[one.start] > stop - start - 4.5 * block


def test_a_drift_of_rate_is_no_plateau():
    t = np.arange(3000) / RATE
    gyr = np.zeros((t.size, 3))
    gyr[:, 0] = dps(2.0) * t  # 2 °/s²: half a degree per second from block to block
    assert plateaus(t, gyr) == []


def test_a_plateau_ends_where_the_rate_leaves_it_slowly():
    t = np.arange(4000) / RATE
    gyr = np.zeros((t.size, 3))
    gyr[:, 0] = dps(100.0 + 0.3 * np.maximum(t - 20.0, 0.0))  # 0.075 °/s per block: below the step that ends a run
    (found,) = plateaus(t, gyr)
    # of the 0.15 °/s that 100 °/s may waver by, 0.3 °/s² takes half a second
    assert t[found.stop - 1] < 21.0
    assert np.abs(gyr[found, 0] - dps(100.0)).max() < dps(0.3)


def test_short_stretches_nan_and_short_recordings_are_none():
    t, gyr, _ = recording([0.0, 50.0], hold=1.5)
    assert plateaus(t, gyr) == []
    t, gyr, _ = recording([0.0, 50.0])
    gyr[:, 1] = np.nan
    assert plateaus(t, gyr) == []
    assert plateaus(t[:3], gyr[:3]) == []
    gyr[:, 1] = 0.0
    gyr[1100, 1] = np.nan  # in the second plateau, from 8 to 14 s
    assert len(plateaus(t, gyr)) == 3 and all(np.isfinite(gyr[one]).all() for one in plateaus(t, gyr))


def session(bias=(0.0, 0.0, 0.0)):
    signs = [s * r for r in (50.0, 100.0) for s in (1.0, -1.0)]
    true = np.vstack([np.zeros((3, 3)), *(rate * np.eye(3)[[axis]] for axis in range(3) for rate in signs)])
    return dps(true), dps(true) * 1.03 + np.asarray(bias)


def test_rates_are_matched_by_axis_sign_and_size_in_spite_of_a_bias():
    true, means = session(dps(np.array([20.0, -15.0, 8.0])))  # ±20 °/s is what sheets of consumer parts allow
    matched = match_rates(means, dps(np.array([100.0, 0.0, 50.0])))
    assert matched.found.all()
    np.testing.assert_allclose(matched.rate, true, rtol=0, atol=1e-15)


def test_what_fits_no_nominal_rate_or_no_axis_is_set_aside():
    _, means = session()
    wrong = dps(np.array([[70.0, 0.0, 0.0], [100.0, 30.0, 0.0], [0.0, 0.0, 6.0], [0.0, 111.0, 0.0]]))
    matched = match_rates(np.vstack((means, wrong)), dps(np.array([50.0, 100.0])))
    assert matched.found.tolist() == [True] * len(means) + [False] * len(wrong)
    assert not matched.rate[~matched.found].any()


def test_without_rates_or_plateaus_nothing_matches():
    _, means = session()
    assert not match_rates(means, np.zeros(1)).found.any()
    assert match_rates(means[:0], np.ones(1)).rate.shape == (0, 3)
