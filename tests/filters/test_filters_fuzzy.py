"""The fuzzy regulator: its rules by hand, its sets, its inference, and the units in which it thinks."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from plumbob.filters.fuzzy_pi import SPACING, conclusion, grades, regulate, wind
from tests.helpers import examples
from tests.helpers.fuzzy_rules import NUMBERS, PAPER, SUM, by_all_rules, memberships

EPS = np.finfo(float).eps
STEEP = (3.0, 9.0, 0.02)  # c = 4.5, far = 9
errors = st.floats(-5.0, 5.0)
integrals = st.floats(-8.0, 8.0)


def test_the_tables_by_hand():
    # page of the paper: U_i(E) = [−far, −2s, −s, 0, s, 2s, far] + 0.02 (j − 4), here far 3 and s = 0.2
    rows = {
        -3: [-3.06, -0.46, -0.26, -0.06, 0.14, 0.34, 2.94],
        0: [-3.0, -0.4, -0.2, 0.0, 0.2, 0.4, 3.0],
        3: [-2.94, -0.34, -0.14, 0.06, 0.26, 0.46, 3.06],
    }
    for i, row in rows.items():
        assert [conclusion(e, i, *PAPER) for e in NUMBERS] == pytest.approx(row, abs=4 * EPS * 3.0)
    # numbers of the sets added, from −9 to 9 by 3
    rows = {-3: [-9, -9, -9, -9, -6, -3, 0], 0: [-9, -6, -3, 0, 3, 6, 9], 2: [-3, 0, 3, 6, 9, 9, 9]}
    for i, row in rows.items():
        assert [conclusion(e, i, *SUM) for e in NUMBERS] == row


def test_conclusions_stay_in_their_universe():
    assert [conclusion(e, 3, *STEEP) for e in NUMBERS] == pytest.approx([-8.94, -5.94, -2.94, 0.06, 3.06, 6.06, 9.0])
    assert conclusion(3, 3, 0.0, 9.0, 3.0) == 9.0
    assert conclusion(-3, -3, 0.0, 9.0, 3.0) == -9.0


@pytest.mark.parametrize(("table", "gain", "integral_gain"), [
    # page of the paper: 4.5 and 3 for the sum table with the stated factors; from set to set U grows by 3 while E
    # grows by 2, that is the error by 2/3 deg: 3 / (2/3)
    (SUM, 4.5, 3.0),
    (STEEP, 4.5, 0.02),
    (PAPER, 0.3, 0.02),  # s / (2/3) = c
])  # fmt: skip
def test_gains_in_the_middle(table, gain, integral_gain):
    assert regulate(0.0, 0.0, *table) == 0.0
    for small in (1e-3, -0.2, 0.6):  # straight up to the next set, at 2/3 deg and 1 deg s
        assert regulate(small, 0.0, *table) == pytest.approx(gain * small, rel=1e-12)
        assert regulate(0.0, small, *table) == pytest.approx(integral_gain * small, rel=1e-12)
    assert pytest.approx(2.0 / 3.0) == SPACING
    # page of the paper: e in rad with u read as °/s has the gain 4.5 π/180 = 0.079
    assert regulate(math.radians(0.5), 0.0, *SUM) / 0.5 == pytest.approx(0.079, abs=5e-4)


@given(errors, integrals)
def test_memberships_add_up_to_one_and_two_of_them_say_it_all(error, integral):
    for value, end, all_grades in zip((3.0 * error, integral), (6.0, 3.0), memberships(error, integral), strict=True):
        assert np.sum(all_grades) == pytest.approx(1.0, abs=8 * EPS)
        lower, upper = grades(value, end)
        found = np.zeros(7)
        found[lower + 3], found[lower + 4] = 1.0 - upper, upper
        assert np.abs(found - all_grades).max() < 16 * EPS


@pytest.mark.parametrize("table", [PAPER, STEEP, SUM])
@given(error=errors, integral=integrals)
@examples(0.5)
def test_inference_is_by_product_and_the_weighted_mean_of_the_conclusions(table, error, integral):
    """Odd, bounded, and saturated at the ends."""
    u = regulate(error, integral, *table)
    assert u == pytest.approx(by_all_rules(error, integral, *table), abs=64 * EPS * 9.0)
    assert abs(u) <= 9.0 * (1.0 + 4 * EPS)
    assert regulate(-error, -integral, *table) == pytest.approx(-u, abs=64 * EPS * 9.0)
    assert u == regulate(min(max(error, -2.0), 2.0), min(max(integral, -3.0), 3.0), *table)


@given(st.lists(st.tuples(st.floats(-200.0, 200.0), st.floats(0.0, 1.0)), max_size=50))
def test_the_integral_never_leaves_its_universe(steps):
    integral = 0.0
    for error, dt in steps:
        integral = wind(integral, error, dt)
        assert abs(integral) <= 3.0
    # anti-windup: after an hour at the end of the universe, one second of 1° brings it to 2 deg s
    assert wind(wind(0.0, 50.0, 3600.0), -1.0, 1.0) == 2.0
