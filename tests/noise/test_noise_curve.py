"""Curves with intervals: the noise told from them, how often they hold the truth, and what is refused."""

import math

import numpy as np
import pytest
from scipy.special import psi
from scipy.stats import chi2

from plumbob.core.errors import ParameterError, ShapeError
from plumbob.noise import curve, curves, deviation, edf, interval, log_factors
from plumbob.noise.curve import ONE_SIGMA, identify, log_variance, make_curve, skew_edf
from plumbob.noise.factors import SHAPES
from tests.helpers import is_plain, slow_as_python

COMPILED = not is_plain()
SAMPLES = 2048
RATE = np.random.default_rng(8).standard_normal((SAMPLES, 3)) * [1.0, 2.0, 3.0]


def test_columns_are_channels_and_the_error_of_ieee_is_as_the_fin_paper_prints_it():
    """[Ou2017] (7): 220 s at 500 Hz, τ = √3 s: ± 6.299 %; n is whole, 866 of it, which makes it 6.2989 %."""
    one = make_curve([1.0, 0.9], [866, 900], 110_000, 0.002)
    assert (one.tau[0], 100.0 * one.ieee[0]) == (pytest.approx(1.732), pytest.approx(6.2989, abs=5e-5))
    assert 100.0 / math.sqrt(2.0 * (220.0 / math.sqrt(3.0) - 1.0)) == pytest.approx(6.2990, abs=5e-5)
    found = curves(RATE, 0.01)
    assert len(found) == 3
    for axis, one in enumerate(found):
        alone = curve(RATE[:, axis], 0.01)
        for name in ("n", "dev", "alpha", "edf", "lo", "hi"):
            assert (getattr(alone, name) == getattr(one, name)).all()
        assert (one.dev == deviation(RATE[:, axis], one.n)).all()
        assert (one.lo < one.dev).all() and (one.dev < one.hi).all()
    assert (found[0].n == log_factors(SAMPLES)).all()
    assert found[0].tau[-1] == pytest.approx(0.01 * found[0].n[-1])
    assert (found[0].kind, found[0].count, found[0].dt, found[0].confidence) == ("oadev", SAMPLES, 0.01, ONE_SIGMA)


def test_single_factors_get_what_they_get_among_others_and_from_a_stream():
    """The noise is told on the grid of the record: a factor of the grid comes out as it does without the argument."""
    whole = curve(RATE[:, 0], 1.0)
    for place in (0, 17, whole.n.size - 1):
        one = curve(RATE[:, 0], 1.0, [whole.n[place]])
        assert (one.lo[0], one.hi[0], one.alpha[0]) == (whole.lo[place], whole.hi[place], whole.alpha[place])
    some = curve(RATE[:, 0], 1.0, [5, 100, 777])
    assert some.n.tolist() == [5, 100, 777]
    assert some.edf[1] == pytest.approx(edf("oadev", 0.0, SAMPLES, [100])[0], rel=0.3)
    again = make_curve(whole.dev, whole.n, SAMPLES, 1.0)
    assert (again.lo == whole.lo).all() and (again.hi == whole.hi).all() and (again.alpha == whole.alpha).all()
    every = curve(RATE[:, 0], 1.0, np.arange(1, SAMPLES // 2 + 1))
    assert every.n.size == SAMPLES // 2 and (every.edf >= 1.0 - 1e-9).all() and np.isfinite(every.hi).all()
    wide = make_curve(whole.dev, whole.n, SAMPLES, 1.0, confidence=0.95)
    assert (wide.lo < whole.lo).all() and (wide.hi > whole.hi).all()


def test_intervals_are_those_of_chi_square():
    """Of equal weights; and n = N/2 is one square of a normal variable, between 0.0401 and 1.987 of its mean."""
    for freedom in (1.0, 2.5, 30.0):
        ends = np.ravel(interval(np.array([2.0]), np.array([freedom]), np.array([freedom]), 0.9))
        assert ends == pytest.approx(2.0 * np.sqrt(freedom / chi2.ppf([0.95, 0.05], freedom)))
    one = curve(RATE[:, 0], 1.0, [SAMPLES // 2])
    assert one.edf[0] == pytest.approx(1.0)
    ratios = [one.dev[0] / one.lo[0], one.dev[0] / one.hi[0]]
    assert ratios == pytest.approx(np.sqrt(chi2.ppf([0.5 + ONE_SIGMA / 2.0, 0.5 - ONE_SIGMA / 2.0], 1)).tolist())


def test_skewness_of_records_that_are_made_here():
    """White noise, n = 0.43 N: one weight outweighs all, and the distribution is as skewed as a single square's.

    The third moment of 20 000 values of it, relative to their variance, is known to 6 %, by halves that are compared;
    skew_edf goes with its square.
    """
    count, n = 100, 43
    records = 20_000 if COMPILED else 1000
    variance = deviation(np.random.default_rng(9).standard_normal((count, records)), [n])[0] ** 2
    centred = variance - variance.mean()
    found = 8.0 * np.mean(centred**2) ** 3 / np.mean(centred**3) ** 2
    expected = skew_edf("oadev", 0.0, count, [n])[0]
    assert expected < 0.8 * edf("oadev", 0.0, count, [n])[0]
    assert found == pytest.approx(expected, rel=0.25 if COMPILED else 0.9)


def sampled_flicker(n):
    """Allan deviation of white noise through the integrator of order 1/2, of standard deviation 1."""

    def s(k):
        return (k**2 - 0.25) * (psi(k + 1.5) + psi(k - 0.5)) / (4.0 * math.pi)

    return np.sqrt((3.0 * s(0.0) - 4.0 * s(n) + s(2.0 * n)) / n**2)


def records(noise, count, number):
    white = np.random.default_rng(77).standard_normal((5 * count, number))
    if noise == "white":
        return white[:count]
    if noise == "walk":
        return np.cumsum(white[:count], axis=0)
    k = np.arange(1, 5 * count)
    pulse = np.concatenate(([1.0], np.cumprod((k - 0.5) / k)))  # [Kasdin1995]
    size = 1 << (10 * count - 1).bit_length()
    response = np.fft.rfft(pulse, size)[:, np.newaxis]
    return np.fft.irfft(response * np.fft.rfft(white, size, axis=0), size, axis=0)[4 * count : 5 * count]


TRUTH = {
    "white": lambda n: 1.0 / np.sqrt(n),
    "flicker": sampled_flicker,
    "walk": lambda n: np.sqrt((2.0 * n**2 + 1.0) / (6.0 * n)),
}


@slow_as_python
@pytest.mark.parametrize("count", [100, pytest.param(400, marks=pytest.mark.long(reason="5 s for each noise"))])
@pytest.mark.parametrize("noise", TRUTH)
def test_intervals_hold_the_truth_as_often_as_they_say(noise, count):
    """At every averaging time, up to a single difference: 60 to 78 %, with the noise identified from each record.

    And two standard deviations of the share among the records to either side, as some of 40 averaging times are always
    out of luck; their mean stays within one, for neighbours share most of their samples. The whole benchmark, with
    longer records, is benchmarks/allan_coverage.py.
    """
    found = curves(records(noise, 1024, count), 1.0)
    sd = math.sqrt(0.6827 * 0.3173 / count)
    truth = TRUTH[noise](found[0].n.astype(float))
    share = np.mean([(one.lo <= truth) & (truth <= one.hi) for one in found], axis=0)
    assert share.min() >= 0.60 - 2.0 * sd and share.max() <= 0.78 + 2.0 * sd
    assert abs(share.mean() - 0.6827) <= sd + 0.03  # benchmarks/allan_coverage.py: means of 63 to 71 %


@pytest.mark.parametrize(("call", "error", "text"), [
    (lambda: curve(RATE[:, 0], 0.0), ParameterError, "dt must be"),
    (lambda: curve(RATE[:, 0], 1.0, [1025]), ParameterError, r"n\[0\] = 1025"),
    (lambda: curve(np.ones(100), 1.0), ShapeError, "is the record constant"),
    (lambda: curve([1.0, 2.0, 3.0], 1.0), ParameterError, "two averaging factors"),
    (lambda: curves(RATE[:, 0], 1.0), ShapeError, r"shape \(N, k\)"),
    (lambda: curve(RATE[:, 0], 1.0, kind="variance"), ShapeError, "kind"),
    (lambda: make_curve([1.0, 0.7], [10, 20], 1000, 1.0, confidence=68.3), ParameterError, "between 0 and 1"),
    (lambda: identify("oadev", 100, [4], [1.0]), ParameterError, "two averaging factors or more"),
    (lambda: identify("oadev", 100, [4, 4], [1.0, 1.0]), ParameterError, "increasing"),
    (lambda: identify("oadev", 100, [4, 8], [1.0, 0.0]), ShapeError, r"dev\[1\] = 0.0 \(1 such.*constant"),
    (lambda: identify("oadev", 100, [4, 8], [math.nan, 1.0]), ShapeError, r"dev\[0\] = nan"),
])  # fmt: skip
def test_what_is_no_noise_is_refused(call, error, text):
    with pytest.raises(error, match=text):
        call()


N = np.unique(np.round(np.geomspace(1, 10_000, 65)).astype(int))
LONG = 10**9  # samples, so that the values are known to 1e-4 and better


@pytest.mark.parametrize("kind", SHAPES)
def test_each_noise_by_its_own_deviation(kind):
    """The deviation of noise as it is sampled is no straight line at n < 8, where the slope is off by some tenths."""
    for level in SHAPES[kind].levels:
        alpha = identify(kind, LONG, N, np.exp(0.5 * log_variance(SHAPES[kind], level, N)))
        assert np.abs(alpha[N >= 16] - level).max() < 0.05, level
        assert np.abs(alpha - level).max() < 0.5, level


def test_straight_lines_two_points_and_where_two_noises_meet():
    """σ ∝ τ^(−1/2), 1, τ^(1/2): white noise, flicker and random walk [Riley2008]."""
    for slope, alpha in ((-0.5, 0.0), (0.0, -1.0), (0.5, -2.0), (0.25, -1.5)):
        assert identify("oadev", LONG, N, 0.3 * N**slope)[30:] == pytest.approx(alpha, abs=0.01)
    assert identify("oadev", LONG, [100, 200], [1.0, 1.0 / math.sqrt(2.0)]) == pytest.approx(0.0, abs=1e-3)
    # σ² = 1/τ + τ/T² bends from 0 to −2, at τ = T by half; a drift beyond a walk's slope counts as a walk.
    meeting = 100.0
    alpha = identify("oadev", LONG, N, np.sqrt(1.0 / N + N / meeting**2))
    assert (alpha[0], alpha[-1]) == (pytest.approx(0.0, abs=0.1), pytest.approx(-2.0, abs=0.1))
    assert np.interp(meeting, N, alpha) == pytest.approx(-1.0, abs=0.1)
    assert (np.diff(alpha[N >= 8]) < 0.01).all()
    assert (identify("oadev", LONG, N, N.astype(float)) == -2.0).all()
    # 3 Q²/τ² + N²/τ with equal parts at τ = 30: there the slope is −3/2 and both are half, α = 1.
    alpha = identify("oadev", LONG, N, np.sqrt(30.0 / N**2 + 1.0 / N))
    assert np.interp(30.0, N, alpha) == pytest.approx(1.0, abs=0.1)
    assert alpha[0] == pytest.approx(2.0 * 30.0 / 31.0, abs=0.15)


def test_scatter_on_white_noise_and_every_n_is_as_few_are():
    """Other noise is 1 away: where edf ≥ 50, at n ≤ 100, α is known to a quarter of that, at the end to half of it.

    The mean of 100 records whose α scatter by 1/2 is known to 1/20; 4 of them are 0.2.
    """
    n = np.unique(np.round(np.geomspace(1, 2048, 45)).astype(int))
    dev = deviation(np.random.default_rng(11).standard_normal((4096, 100)), n)
    alpha = np.array([identify("oadev", 4096, n, one) for one in dev.T])
    assert alpha.std(axis=0)[n <= 100].max() < 0.25 and alpha.std(axis=0).max() < 0.5
    assert np.abs(alpha.mean(axis=0)).max() < 0.2
    # A curve of every n is looked at in 16 places an octave: what the rest adds to these is little.
    n = np.arange(1, 2049)
    dev = np.sqrt(1.0 / n + n / 1e4)
    few = np.unique(np.round(np.geomspace(1, 2048, 177)).astype(int))
    every = identify("oadev", 4096, n, dev)
    assert every.shape == n.shape
    assert np.abs(every[few - 1] - identify("oadev", 4096, few, dev[few - 1])).max() < 0.05
