"""The overlapping Allan deviation against published tables, closed forms and another program."""

import math

import numpy as np
import pytest

from plumbob.errors import ParameterError, ShapeError
from plumbob.noise import independent_differences, overlapping_adev

EPS = np.finfo(float).eps
NBS14 = [892, 809, 823, 798, 671, 644, 883, 903, 677]  # [Riley2008] table 29


def riley_1000():
    """[Riley2008] sec. 12.4: n0 = 1234567890, n → 16807 n mod 2147483647, over 2147483647."""
    n, found = 1234567890, []
    for _ in range(1000):
        found.append(n / 2147483647)
        n = 16807 * n % 2147483647
    return np.array(found)


def as_the_standard_writes_it(rate, n):
    """By brute force: differences of neighbouring averages, every one that fits."""
    means = np.array([rate[k : k + n].mean() for k in range(len(rate) - n + 1)])
    return math.sqrt(0.5 * np.mean((means[n:] - means[:-n]) ** 2))


def test_published_tables():
    """[Riley2008] tables 30 and 31, to the last digit that they print."""
    assert overlapping_adev(NBS14, [1, 2]) == pytest.approx([91.22945, 85.95287], abs=5.1e-6)
    assert overlapping_adev(riley_1000(), [1, 10, 100]) == pytest.approx([2.922319e-1, 9.159953e-2, 3.241343e-2], 5e-7)


def test_another_program_on_1e5_samples():
    """allantools, the same definition: sums of up to 1e5 squares round by 1e5 eps at worst, 1e-12 is the target."""
    allantools = pytest.importorskip("allantools", reason="allantools is not installed; it comes with plumbob[bench]")
    rng = np.random.default_rng(1)
    n = np.unique(np.round(np.logspace(0, math.log10(33_000), 40)).astype(int))
    for offset in (0.0, 32768.0, 1e6):
        rate = rng.standard_normal(100_000) + offset
        theirs = [allantools.oadev(rate, rate=1.0, data_type="freq", taus=[float(k)])[1][0] for k in n]
        assert np.abs(overlapping_adev(rate, n) / theirs - 1.0).max() <= 1e-12


@pytest.mark.parametrize("n", [1, 2, 3, 49, 50])
def test_the_definition_by_brute_force(n):
    rate = np.random.default_rng(2).standard_normal(100) + 5.0
    assert overlapping_adev(rate, [n])[0] == pytest.approx(as_the_standard_writes_it(rate, n), rel=1e-12)


def test_a_steady_drift_gives_the_rate_ramp():
    """rate = R t: averages a time τ apart differ by R τ, so σ = R τ / √2 exactly."""
    n = np.array([1, 10, 100, 500])
    np.testing.assert_allclose(overlapping_adev(0.3 * np.arange(1000), n), 0.3 * n / math.sqrt(2.0), rtol=1e-11)


def test_differences_of_averages_and_not_the_averages():
    """[Chen2013] (13) as printed squares the averages: 0.707 of the truth on white noise, and anything with a mean.

    White noise of 0.1 has σ(Δt) = 0.1; over 1e5 samples σ scatters by 1/√(2 · 66 667) = 0.27 %, so 4 of them are 1.1 %.
    """
    rate = 0.1 * np.random.default_rng(3).standard_normal(100_000)
    assert overlapping_adev(rate, [1])[0] == pytest.approx(0.1, rel=0.011)
    assert math.sqrt(0.5 * np.mean(rate**2)) == pytest.approx(0.0707, rel=0.011)


def test_an_offset_does_not_cost_digits():
    """A million times the noise on top, as a converter's counts may have: only the samples' own rounding is lost."""
    rate = np.random.default_rng(4).standard_normal(100_000)
    n = [1, 100, 10_000, 50_000]
    shifted = overlapping_adev(
        (rate + 2.0**20) - 2.0**20, n
    )  # what is left of the samples after the offset rounded them
    assert np.abs(overlapping_adev(rate + 2.0**20, n) / shifted - 1.0).max() < 2.0**20 * EPS


def test_columns_are_channels():
    rate = np.random.default_rng(5).standard_normal((300, 3))
    found = overlapping_adev(rate, [1, 7])
    assert found.shape == (2, 3)
    for axis in range(3):
        assert (found[:, axis] == overlapping_adev(rate[:, axis], [1, 7])).all()
    assert overlapping_adev(rate[:, 0], [1, 7]).shape == (2,)


@pytest.mark.parametrize(
    ("n", "words"),
    [([0], "whole numbers from 1 to 4"), ([5], r"n\[0\] = 5"), ([1, 1.5], r"n\[1\] = 1.5"), ([math.nan], "n")],
)
def test_factors_that_do_not_fit_are_refused(n, words):
    with pytest.raises(ParameterError, match=words):
        overlapping_adev(NBS14, n)
    with pytest.raises(ParameterError):
        independent_differences(9, n[-1])


def test_a_missing_sample_is_refused_and_named():
    rate = np.zeros((10, 3))
    rate[4, 2] = math.nan
    with pytest.raises(ShapeError, match=r"rate\[4, 2\] is not finite \(1 such values\).*without gaps"):
        overlapping_adev(rate, [1])
    with pytest.raises(ShapeError, match="shape"):
        overlapping_adev(np.zeros((2, 3, 4)), [1])


def test_degrees_of_freedom_of_white_noise():
    """One difference is one; else what the simple formula of [Riley2008] gives, which is good to 2 %."""
    assert independent_differences(1000, 500) == 1.0
    for count, n in ((1000, 1), (1000, 10), (1000, 100), (100_000, 10_000)):
        points = count + 1
        table = (1.5 * (points - 1) / n - 2.0 * (points - 2) / points) * 4.0 * n**2 / (4.0 * n**2 + 5.0)
        assert independent_differences(count, n) == pytest.approx(table, rel=0.02)


def test_degrees_of_freedom_of_long_averages_are_greenhall_s():
    """allantools has his general formula, α = 0 and d = 2; it takes n for large, and is 6 % off at n = 2 itself."""
    allantools = pytest.importorskip("allantools", reason="allantools is not installed; it comes with plumbob[bench]")
    for count, n in ((1000, 100), (1000, 400), (100_000, 100), (100_000, 10_000)):
        theirs = allantools.edf_greenhall(alpha=0, d=2, m=n, N=count + 1, overlapping=True, modified=False)
        assert independent_differences(count, n) == pytest.approx(theirs, rel=1e-3)


def test_degrees_of_freedom_are_those_of_a_simulation():
    """A variance of 4000 values is known to √((kurtosis − 1) / 4000), 2.2 % or a little more; 4 of it are allowed."""
    rate = np.random.default_rng(6).standard_normal((200, 4000))
    for n in (1, 5, 40):
        variance = overlapping_adev(rate, [n])[0] ** 2
        edf = 2.0 * variance.mean() ** 2 / variance.var()
        kurtosis = 3.0 + 12.0 / edf  # of a χ² variable
        assert edf == pytest.approx(independent_differences(200, n), rel=4.0 * math.sqrt((kurtosis - 1.0) / 4000))
