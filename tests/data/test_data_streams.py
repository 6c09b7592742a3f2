"""A magnetometer on its own clock."""

import numpy as np
import pytest

from plumbob.core.errors import ClockError, ShapeError
from plumbob.data import ImuData, ImuMeta

T = 0.01 * np.arange(10)
GYR = np.zeros((10, 3))


def joined(t_mag, values=None, t=T):
    t_mag = np.asarray(t_mag, dtype=float)
    mag = np.arange(1.0, t_mag.size + 1)[:, np.newaxis] * [10.0, 0.0, 0.0] if values is None else values
    data = ImuData.from_streams(t, gyr=GYR[: len(t)], t_mag=t_mag, mag=mag)
    return {i: data.mag[i, 0] for i in np.flatnonzero(np.isfinite(data.mag[:, 0]))}


@pytest.mark.parametrize(("t_mag", "expected"), [
    ([0.0, 0.011, 0.029, 0.05], {0: 10.0, 2: 20.0, 3: 30.0, 5: 40.0}),  # each goes to the next inertial sample
    ([0.001, 0.002, 0.009, 0.02], {1: 30.0, 2: 40.0}),  # the last of several wins
    ([0.05, 0.0901, 5.0], {5: 10.0}),  # those after the end are left out
])  # fmt: skip
def test_each_goes_to_the_next_inertial_sample(t_mag, expected):
    assert joined(t_mag) == expected


def test_equal_stamps_meet_to_the_nanosecond_and_absent_values_do_not_win():
    """0.1 + 0.2 is not 0.3 in float64: the sample at 0.3 s must not wait for the next."""
    t = np.array([0.1, 0.2, 0.3, 0.4])
    assert joined([0.1 + 0.2], t=t) == {2: 10.0}
    assert joined([0.3 + 1e-9], t=t) == {3: 10.0}
    values = np.array([[10.0, 0, 0], [np.nan, 0, 0], [30.0, 0, 0]])
    assert joined([0.001, 0.002, 0.015], values) == {1: 10.0, 2: 30.0}
    data = ImuData.from_streams(T, gyr=GYR, acc=GYR + 9.81, t_mag=[0.0], mag=[[20, 0, 0]], meta=ImuMeta(device="x"))
    assert (data.meta.device, data.triads) == ("x", ("gyr", "acc", "mag"))
    assert np.array_equal(data.acc, GYR + 9.81)


CLOCKS = r"no sample of mag, at .* Put both on one clock"


@pytest.mark.parametrize(("t", "t_mag", "values", "error", "says"), [
    (T, [0.1, 0.2], None, ClockError, CLOCKS),
    (T, [0.01], np.full((1, 3), np.nan), ClockError, CLOCKS),
    (T[::-1], [0.01], None, ClockError, "t must strictly increase"),
    (T, [0.02, 0.01], None, ClockError, "t_mag must strictly increase"),
    (T, [np.nan], None, ClockError, r"t_mag\[0\] = nan"),
    (T, [], None, ShapeError, "t_mag is empty"),
    (T, [0.01, 0.02], np.zeros((3, 3)), ShapeError, r"mag must have one row per time stamp \(2\), but it has 3"),
])  # fmt: skip
def test_bad_clocks_and_lengths_are_named(t, t_mag, values, error, says):
    with pytest.raises(error, match=says):
        joined(t_mag, values, t=t)
