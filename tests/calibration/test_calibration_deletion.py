"""Groups of outliers: closed form against fits without the group, masking pairs, and few false alarms."""

from itertools import combinations

import numpy as np
import pytest

from plumbob.calibration.ellipsoid.ellipsoid_fit import outlying


def line(seed, count=20, noise=1e-3):
    rng = np.random.default_rng(seed)
    rows = np.column_stack((np.ones(count), np.linspace(-1.0, 1.0, count)))
    return rows, rows @ [0.3, 2.0] + noise * rng.standard_normal(count)


def left_of(rows, values):
    return values - rows @ np.linalg.lstsq(rows, values, rcond=None)[0]


@pytest.mark.parametrize("planted", [(4,), (0, 1), (0, 19), (7, 8), (17, 18, 19), (0, 10, 19)])
def test_the_group_is_the_one_without_which_the_rest_fits_best(planted):
    """[Cook1982]: the same sign at one end: together they turn the line, and none stands out by itself."""
    rows, values = line(1)
    values[list(planted)] += 0.05
    found = outlying(rows, left_of(rows, values), false_alarm=1e-3, rounding=1e-13)
    assert found.tolist() == list(planted)

    def cost(group):
        return np.sum(left_of(np.delete(rows, group, axis=0), np.delete(values, group)) ** 2)

    assert min(combinations(range(20), len(planted)), key=cost) == planted


def test_normal_errors_lose_samples_as_rarely_as_promised():
    """At most 3 %: 200 draws give 6 ± 2.4, and no more than that plus three of these."""
    alarms = 0
    for seed in range(200):
        rows, values = line(seed, count=12)
        alarms += outlying(rows, left_of(rows, values), false_alarm=0.03, rounding=1e-13).size > 0
    assert alarms <= 13


def test_rounding_errors_are_no_outliers():
    rows, values = line(0, noise=0.0)
    assert outlying(rows, left_of(rows, values), false_alarm=1e-3, rounding=1e-13).size == 0


def test_too_few_to_tell_and_samples_that_alone_know_a_parameter_stay():
    rows, values = line(0, count=4)
    assert outlying(rows, left_of(rows, values + [0.0, 1.0, 0.0, 0.0]), false_alarm=1.0, rounding=1e-13).size == 0
    rows, values = line(0)
    alone = np.column_stack((rows, np.eye(20)[3]))
    values[3] += 1.0
    assert outlying(alone, left_of(alone, values), false_alarm=1e-3, rounding=1e-13).size == 0
