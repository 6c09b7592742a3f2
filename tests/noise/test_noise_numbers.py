"""Two digits of the uncertainty; expected texts are worked out by hand from that rule."""

import math

import pytest

from plumbob.core.text import measured, number
from plumbob.core.units import to_si
from plumbob.noise import report
from plumbob.noise.findings import Coefficient


@pytest.mark.parametrize(
    ("value", "lo", "hi", "text"),
    [
        (1.2345, 1.2, 1.27, "1.234 ± 0.036"),  # sides 0.0345 and 0.0355 are alike: the larger counts
        (1.0, 0.9904, 1.0104, "1.000 ± 0.010"),  # the larger, 0.0104, says how many digits: 0.0096 would ask for more
        (1.0, 0.99995, 1.00005, "1.000000 ± 0.000050"),  # the value says whether a power of ten is written
        (57.03, 54.6, 60.1, "57.0 +3.1 -2.4"),
        (10.0, 9.95, 11.5, "10.000 +1.500 -0.050"),  # no side is rounded to nothing
        (0.0126, 0.01248, 0.01272, "0.01260 ± 0.00012"),
        (12345.0, 12000.0, 12700.0, "12340 ± 360"),
        (1.0, 0.9004, 1.0996, "1.00 ± 0.10"),  # 0.0996 has two digits as 0.10
        (3.2e-6, 3.1e-6, 3.3e-6, "(3.20 ± 0.10)e-6"),
        (2e7, 1.9e7, 2.2e7, "(2.00 +0.20 -0.10)e7"),
        (-3.0, -3.1, -2.9, "-3.00 ± 0.10"),
        (0.0, 0.0, 1.0, "0.0 +1.0 -0.0"),
        (0.5, math.nan, math.nan, "0.500"),
        (0.5, 0.5, 0.5, "0.500"),
        (0.5, 0.4, math.inf, "0.500"),
    ],
)
def test_a_value_has_the_digits_that_its_uncertainty_gives(value, lo, hi, text):
    assert measured(value, lo, hi) == text


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (0.0, 3, "0"),
        (123456.0, 3, "123000"),
        (0.000123, 3, "0.000123"),
        (0.05, 2, "0.050"),
        (1.5e-7, 2, "1.5e-7"),
        (math.nan, 3, "-"),
    ],
)
def test_a_bare_number_has_the_digits_asked_for(value, digits, text):
    assert number(value, digits) == text


def test_a_coefficient_is_written_in_the_unit_of_a_data_sheet():
    c = Coefficient(*(to_si(v, "deg/rth") for v in (0.3, 0.299, 0.301)))
    assert report.coefficient(c, "deg/rth") == "0.3000 ± 0.0010"
    assert report.verdict(c, "deg/rth") == "0.3000 ± 0.0010 °/√h"


def test_what_is_not_observable_is_a_limit_and_a_length_of_record():
    c = Coefficient(0.0, upper=to_si(3.2, "deg/h"), observable=False, hours=12.3)
    assert report.coefficient(c, "deg/h") == "< 3.2"
    longer = "to show half of it takes a record of"
    assert report.verdict(c, "deg/h") == f"not observable; < 3.2 °/h (95 %); {longer} 12 h"
    without = Coefficient(0.0, observable=False)
    assert report.coefficient(without, "deg/h") == "not observable"
    assert report.verdict(without, "deg/h") == f"not observable; {longer} more than a year"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.0, "0 s"), (3.0, "3.0 s"), (119.0, "120 s"), (200.0, "3.3 min"), (7200.0, "2.0 h"), (4.4e6, "1200 h")],
)
def test_lengths_of_time_have_two_digits(seconds, text):
    assert report.length(seconds) == text
