"""Which channels belong together."""

from dataclasses import replace

import pytest

from plumbob.core.errors import ShapeError
from plumbob.core.units import Quantity
from plumbob.noise.report import triads


def test_axes_of_one_name_are_a_triad(analyses, bare):
    found = triads([*analyses, bare])
    assert [(t.name, t.title, list(t.channels)) for t in found] == [
        ("gyr", "gyroscope", ["x", "y", "z"]),
        ("acc", "accelerometer", ["x", "y", "z"]),
        ("column", "column", [""]),
    ]
    assert found[1].channels["y"] is analyses[4]


def test_nothing_and_namesakes_and_mixed_quantities_are_refused(analyses):
    with pytest.raises(ShapeError, match="at least one analysis"):
        triads([])
    with pytest.raises(ShapeError, match="two analyses are named 'gyr x'"):
        triads([analyses[0], analyses[0]])
    with pytest.raises(ShapeError, match="the axes of 'gyr' measure m/s2, rad/s"):
        triads([analyses[0], replace(analyses[1], quantity=Quantity.ACCELERATION)])
