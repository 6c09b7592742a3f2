"""Numbers in sentences: counts that agree with their noun, probabilities, and ranges as they are declared."""

import math

import pytest

from plumbob.core.errors import ParameterError
from plumbob.core.params import Parameter, Spec, allowed, checked
from plumbob.core.text import counted, first_words, p_value
from plumbob.core.units import Quantity


def parameter(quantity, low=-math.inf, high=math.inf, **kind):
    return Parameter("p", Spec(quantity, "", low, high), 0.0, **{"optional": False, "switch": False, **kind})


def test_counts_agree_with_their_noun_and_probabilities_end_where_their_use_does():
    assert [counted(n, "sample") for n in (0, 1, 2)] == ["0 samples", "1 sample", "2 samples"]
    assert [counted(n, "stretch", "stretches") for n in (1, 2)] == ["1 stretch", "2 stretches"]
    assert [p_value(p) for p in (0.0321, 0.001, 1e-138)] == ["p = 0.032", "p = 0.001", "p < 0.001"]
    assert [first_words(["a", "b", "c"], n) for n in (2, 3)] == ["a, b and 1 more", "a, b, c"]


@pytest.mark.parametrize(("one", "text"), [
    (parameter(Quantity.ANGLE, -math.pi, math.pi, optional=True), "-180 to 180 deg, or off"),
    (parameter(Quantity.RATE, 1e-9, 1.0), "5.8e-08 to 57 deg/s"),  # 5.73e-8 and 57.3, rounded inward
    (parameter(Quantity.RATE, 0.0, 10.0), "0 to 570 deg/s"),
    (parameter(Quantity.RATIO, 0.0, 6.75), "0 to 6.75"),
    (parameter(Quantity.TIME, 0.0), "0 s or more"),
    (parameter(Quantity.TIME, high=1.0), "at most 1 s"),
    (parameter(Quantity.TIME), "any number"),
    (parameter(Quantity.RATIO, switch=True), "on or off"),
])  # fmt: skip
def test_a_range_is_printed_as_it_is_declared_or_inside(one, text):
    assert allowed(one) == text
    if one.spec.high == 10.0:
        with pytest.raises(ParameterError, match=r"^f: p must be 0 to 570 deg/s, but it is 859\.437 deg/s\.$"):
            checked("f", one, 15.0)  # 15 rad/s
