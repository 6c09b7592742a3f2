"""The noise told from a curve: on lines without scatter, where noises meet, and how it scatters."""

import math

import numpy as np
import pytest

from plumbob.core.errors import ParameterError, ShapeError
from plumbob.noise import deviation, identify
from plumbob.noise.curve import log_variance
from plumbob.noise.factors import SHAPES

N = np.unique(np.round(np.geomspace(1, 10_000, 65)).astype(int))
LONG = 10**9  # samples, so that the values are known to 1e-4 and better


@pytest.mark.parametrize("kind", SHAPES)
def test_each_noise_by_its_own_deviation(kind):
    """The deviation of noise as it is sampled is no straight line at n < 8, where the slope is off by some tenths."""
    for level in SHAPES[kind].levels:
        alpha = identify(kind, LONG, N, np.exp(0.5 * log_variance(SHAPES[kind], level, N)))
        assert np.abs(alpha[N >= 16] - level).max() < 0.05, level
        assert np.abs(alpha - level).max() < 0.5, level


def test_straight_lines():
    """σ ∝ τ^(−1/2), 1, τ^(1/2): white noise, flicker and random walk [Riley2008]."""
    for slope, alpha in ((-0.5, 0.0), (0.0, -1.0), (0.5, -2.0), (0.25, -1.5)):
        assert identify("oadev", LONG, N, 0.3 * N**slope)[30:] == pytest.approx(alpha, abs=0.01)


def test_where_two_noises_meet():
    """σ² = 1/τ + τ/T² bends from 0 to −2, at τ = T by half; a drift beyond a walk's slope counts as a walk."""
    meeting = 100.0
    alpha = identify("oadev", LONG, N, np.sqrt(1.0 / N + N / meeting**2))
    assert alpha[0] == pytest.approx(0.0, abs=0.1)
    assert alpha[-1] == pytest.approx(-2.0, abs=0.1)
    assert np.interp(meeting, N, alpha) == pytest.approx(-1.0, abs=0.1)
    assert (np.diff(alpha[N >= 8]) < 0.01).all()
    assert (identify("oadev", LONG, N, N.astype(float)) == -2.0).all()


def test_quantization_that_gives_way_to_white_noise():
    """3 Q²/τ² + N²/τ with equal parts at τ = 30: there the slope is −3/2 and both are half, α = 1."""
    alpha = identify("oadev", LONG, N, np.sqrt(30.0 / N**2 + 1.0 / N))
    assert np.interp(30.0, N, alpha) == pytest.approx(1.0, abs=0.1)
    assert alpha[0] == pytest.approx(2.0 * 30.0 / 31.0, abs=0.15)


def test_scatter_on_white_noise():
    """Other noise is 1 away: where edf ≥ 50, at n ≤ 100, α is known to a quarter of that, at the end to half of it.

    The mean of 100 records whose α scatter by 1/2 is known to 1/20; 4 of them are 0.2.
    """
    n = np.unique(np.round(np.geomspace(1, 2048, 45)).astype(int))
    dev = deviation(np.random.default_rng(11).standard_normal((4096, 100)), n)
    alpha = np.array([identify("oadev", 4096, n, one) for one in dev.T])
    assert alpha.std(axis=0)[n <= 100].max() < 0.25
    assert alpha.std(axis=0).max() < 0.5
    assert np.abs(alpha.mean(axis=0)).max() < 0.2


def test_every_n_is_as_few_are():
    """A curve of every n is looked at in 16 places an octave: what the rest adds to these is little."""
    n = np.arange(1, 2049)
    dev = np.sqrt(1.0 / n + n / 1e4)
    few = np.unique(np.round(np.geomspace(1, 2048, 177)).astype(int))
    every = identify("oadev", 4096, n, dev)
    assert every.shape == n.shape
    assert np.abs(every[few - 1] - identify("oadev", 4096, few, dev[few - 1])).max() < 0.05


def test_two_points_are_a_slope():
    assert identify("oadev", LONG, [100, 200], [1.0, 1.0 / math.sqrt(2.0)]) == pytest.approx(0.0, abs=1e-3)


def test_what_cannot_be_judged_is_refused():
    with pytest.raises(ParameterError, match="two averaging factors or more"):
        identify("oadev", 100, [4], [1.0])
    with pytest.raises(ParameterError, match="increasing"):
        identify("oadev", 100, [4, 4], [1.0, 1.0])
    with pytest.raises(ShapeError, match=r"dev\[1\] = 0.0 \(1 such values\).*constant"):
        identify("oadev", 100, [4, 8], [1.0, 0.0])
    with pytest.raises(ShapeError, match=r"dev\[0\] = nan"):
        identify("oadev", 100, [4, 8], [math.nan, 1.0])
