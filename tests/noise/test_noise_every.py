"""Every averaging factor at once against direct sums, and against its own claim."""

import math
from fractions import Fraction

import numpy as np
import pytest

from plumbob.core.errors import ParameterError, ShapeError
from plumbob.noise import deviation, every_adev, factors, kernels
from tests.helpers import is_plain, slow_as_python
from tests.helpers.noise_records import drifting, exact_squares, exactly, flicker, walk, white, whole_numbers

EPS = np.finfo(float).eps


def wave(count):
    """A pure tone, whose deviation falls to nearly nothing at whole periods: there nothing may be left of products."""
    return np.sin(0.01 * np.arange(count)) + 1e-6 * white(count)


def steep(count):
    """A drift of a million times the noise: θ then has seven digits more than what is left without its parabola."""
    return white(count) + np.linspace(0.0, 1e6, count)


RECORDS = (white, flicker, walk, drifting, steep, wave)
COUNTS = (300,) if is_plain() else (1000, 9000)


def some(count):
    """200 factors, the short ones and the long ones, for which the exact sums are affordable."""
    return np.unique(np.append(np.geomspace(1, count // 2, 120), np.linspace(1, count // 2, 100)).astype(int))


@pytest.mark.parametrize("make", RECORDS)
@pytest.mark.parametrize("count", COUNTS)
def test_direct_sums_round_no_more_than_any_order_may(make, count):
    """With u = eps / 2, a sum of squares in tiles passes TILE roundings, and two more for each tile, in any order.

    Each difference d is off by u times itself and by u times the two first differences Δ that it is made of, so that
    the norm of all errors is at most u (2 |Δ| + |d|), and that of S = |d|² follows.
    """
    angle, n = whole_numbers(next(factors.running_sums(make(count)))), some(count)
    sums = np.zeros(n.size)
    kernels.second_squares(angle, n, sums)
    exact = [exact_squares(angle, k) for k in n.tolist()]
    error = np.array([abs(Fraction(ours) - other) for ours, other in zip(sums.tolist(), exact, strict=True)], float)
    first, exact = np.array([np.linalg.norm(angle[k:] - angle[:-k]) for k in n]), np.array(exact, dtype=float)
    norm = 0.5 * EPS * (2.0 * first + np.sqrt(exact))
    roundings = kernels.TILE + 2.0 * math.ceil(angle.size / kernels.TILE)
    bound = 0.5 * EPS * roundings * exact + norm * (2.0 * np.sqrt(exact) + norm)
    assert (error <= 1.001 * bound).all()  # of which 0.001 stands for products of two u


@pytest.mark.parametrize("make", RECORDS)
@pytest.mark.parametrize("count", COUNTS)
def test_within_the_accuracy_that_it_claims(make, count):
    """σ² is divided and its root is taken, which rounds by an eps or two on either side."""
    rate = make(count)
    made = every_adev(rate)
    directly = deviation(rate, np.arange(1, count // 2 + 1))
    assert np.abs(made / directly - 1.0).max() <= factors.ACCURACY + 4.0 * EPS


@pytest.mark.parametrize("count", [*range(2, 20), 255, 256, 257, 511, 512, 513])
def test_short_records_and_the_edges_of_triangles(count):
    """The edges lie at 256 points."""
    rate = white(count)
    made, n = every_adev(rate), np.arange(1, count // 2 + 1)
    expected = [exactly(rate, k) for k in n.tolist()] if count < 20 else deviation(rate, n)
    np.testing.assert_allclose(made, expected, rtol=2e-12, strict=True)


@slow_as_python
def test_few_factors_are_summed_directly(monkeypatch):
    """Else it is right, but no faster than one after the other: 1 in 1000 of white noise, 1 in 20 of a random walk."""
    directly, summed = factors.second_squares, []
    monkeypatch.setattr(factors, "second_squares", lambda *args: (summed.append(args[1].size), directly(*args))[1])
    for make, share in ((white, 1e-3), (drifting, 1e-3), (flicker, 0.02), (walk, 0.05)):
        every_adev(make(100_000))
        assert summed.pop() < share * 50_000, make.__name__


def test_ramps_constants_channels_and_offsets():
    """σ = R τ / √2; nothing wanders in a constant, though all of its products are rounding."""
    n = np.arange(1, 151)
    np.testing.assert_allclose(every_adev(0.3 * np.arange(300)), 0.3 * n / math.sqrt(2.0), rtol=1e-10)
    assert (every_adev(np.full(300, 7.3)) == 0.0).all()
    rate = np.stack((white(301), walk(301)), axis=1)
    both = every_adev(rate)
    assert both.shape == (150, 2)
    for axis in range(2):
        assert (both[:, axis] == every_adev(rate[:, axis])).all()
    np.testing.assert_allclose(every_adev(rate + 1e6), both, rtol=1e-7)
    for bad, error, text in (
        ([1.0], ParameterError, "rate holds 1 sample, but an Allan deviation needs two or more"),
        ([1.0, math.nan, 3.0], ShapeError, r"rate\[1\] is not finite"),
        (np.zeros((4, 2, 2)), ShapeError, "shape"),
    ):
        with pytest.raises(error, match=text):
            every_adev(bad)
