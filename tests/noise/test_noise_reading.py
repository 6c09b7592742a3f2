"""What is read off a curve: made-up curves, whose answers are seen at a glance."""

import math
from dataclasses import replace

import numpy as np
import pytest

from plumbob.noise.curve import Curve
from plumbob.noise.findings import Coefficient, Estimates, Mask
from plumbob.noise.report import lowest, noise_name, points, shown, thinned_rows


def curve(dev, half, n=None):
    dev, half = np.array(dev, dtype=float), np.array(half, dtype=float)
    n = 2 ** np.arange(dev.size) if n is None else np.asarray(n)
    return Curve("oadev", 0.5, 4 * int(n[-1]), n, dev, 0 * dev, 10 + 0 * dev, dev - half, dev + half)


@pytest.fixture
def channel(plain):
    return lambda c, **changes: replace(plain[0], curve=c, **changes)


def test_a_scattered_last_point_is_no_minimum(channel):
    found = lowest(channel(curve([8, 4, 3, 5, 2], [0.1, 0.1, 0.2, 0.5, 2.0])))
    assert (found.tau, found.dev, found.lo, found.hi) == (2.0, 3.0, 2.8, 3.2)
    assert found.risen


def test_a_curve_that_only_falls_has_not_risen(channel):
    assert not lowest(channel(curve([8, 4, 2, 1], [0.1] * 4))).risen
    assert not lowest(channel(curve([8, 4, 2, 2.1], [0.1, 0.1, 0.1, 0.5]))).risen


def test_the_floor_is_that_of_the_whole_curve_but_for_points_without_interval(channel):
    dips = curve([2, 4, 3, 1], [0.1, 0.1, 0.1, np.inf])
    assert lowest(channel(dips, mask=Mask(2))).dev == 2.0


def test_coefficients_are_read_at_the_places_of_the_standard(channel):
    terms = {k: Coefficient(2.0) for k in "QNBKR"} | {"Q": Coefficient(2.0, observable=False)}
    a = channel(curve([8, 4, 3, 5, 2], [0.1, 0.1, 0.2, 0.5, 2.0]), likelihood=Estimates("likelihood", terms))
    assert list(shown(a)) == ["N", "B", "K", "R"]
    # at its place, a line is as high as its coefficient; the flat of B is √(2 ln 2 / π) = 0.664 of it [Riley2008]
    assert [(p.letter, p.tau, pytest.approx(p.dev)) for p in points(a)] == [
        ("N", 1.0, 2.0),
        ("B", 2.0, 2.0 * math.sqrt(2.0 * math.log(2.0) / math.pi)),
        ("K", 3.0, 2.0),
        ("R", math.sqrt(2.0), 2.0),
    ]


def test_without_a_least_deviation_b_has_no_place(channel):
    a = channel(curve([4, 3], [np.inf, np.inf]))
    assert [p.letter for p in points(a)] == ["N", "K"]


def test_long_curves_are_cut_to_some_rows_spread_over_all(channel):
    n = np.arange(1, 50_001)
    long = curve(np.ones(n.size), np.ones(n.size), n=n)
    use = thinned_rows(long, 40)
    assert use.size <= 40
    assert (use[0], use[-1]) == (0, n.size - 1)
    assert np.diff(np.log(n[use])).max() <= math.log(2.0)
    assert np.array_equal(thinned_rows(curve([1, 2, 3], [1, 1, 1]), 40), [0, 1, 2])


def test_noise_has_names():
    assert [noise_name(a) for a in (2.0, 0.0, -1.0, -2.0, -7.0)] == [
        "quantization", "white", "flicker", "random walk", "f^-7",
    ]  # fmt: skip
