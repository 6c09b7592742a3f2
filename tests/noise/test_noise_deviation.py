"""Deviations, and their degrees of freedom."""

import math

import numpy as np
import pytest

from plumbob.core.errors import ParameterError, ShapeError
from plumbob.noise import KINDS, deviation, edf, kernels
from plumbob.noise.factors import SHAPES
from tests.helpers import is_plain, slow_as_python
from tests.helpers.noise_records import NBS14, drifting, exactly, flicker, riley_1000, walk, white

EPS = np.finfo(float).eps
RECORDS = {"white": white, "flicker": flicker, "walk": walk, "drifting": drifting}
LONGEST = {"oadev": 2, "adev": 2, "mdev": 3, "ohdev": 3, "hdev": 3, "totdev": 2}


PUBLISHED = {  # of the nine rates at 1 and 2, and of the thousand at 1, 10 and 100
    "oadev": (91.22945, 85.95287, 2.922319e-1, 9.159953e-2, 3.241343e-2),
    "adev": (91.22945, 115.8082, 2.922319e-1, 9.965736e-2, 3.897804e-2),
    "mdev": (91.22945, 74.78849, 2.922319e-1, 6.172376e-2, 2.170921e-2),
    "ohdev": (70.80607, 85.61487, 2.943883e-1, 9.581083e-2, 3.237638e-2),
    "hdev": (70.80607, 116.7980, 2.943883e-1, 1.052754e-1, 3.910861e-2),
    "totdev": (91.22945, 93.90379, 2.922319e-1, 9.134743e-2, 3.406530e-2),
}


def test_published_rates():
    """[Riley2008] Tables 30 and 31, to the last of the seven digits that they print."""
    assert set(PUBLISHED) == set(KINDS)
    for kind, values in PUBLISHED.items():
        made = [*deviation(NBS14, [1, 2], kind), *deviation(riley_1000(), [1, 10, 100], kind)]
        assert made == pytest.approx(values, rel=5e-7), kind


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("n", [1, 2, 3, 7, 33])
def test_the_definitions_by_brute_force(kind, n):
    """[Riley2008] (7), (11), (14), (18), (20), (25): every difference that fits, and no other.

    Differences of averages, where [Chen2013] (13) as printed squares the averages. Sums of a hundred terms round by a
    hundred eps at worst.
    """
    rate = white(100) + 5.0
    assert deviation(rate, [n], kind)[0] == pytest.approx(exactly(rate, n, kind), rel=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_the_longest_average_is_one_difference(kind):
    """And one sample more is refused; the total deviation has its N − 1 differences at every n."""
    for count in (11, 12, 13):
        longest = (count + (kind == "mdev")) // LONGEST[kind]
        rate = white(count)
        assert deviation(rate, [longest], kind)[0] == pytest.approx(exactly(rate, longest, kind), rel=1e-12)
        with pytest.raises(ParameterError, match=f"{kind} of {count} samples whole numbers from 1 to {longest} can"):
            deviation(rate, [longest + 1], kind)


@slow_as_python
@pytest.mark.parametrize("kind", KINDS)
def test_a_drift_of_a_hundred_times_the_noise_costs_few_digits(kind):
    """Against extended precision. θ reaches N · 100 / 8 < 2²², so each of its sums rounds to multiples of 2^-31.

    That is white noise of 2^-31 / √12 = 1.3e-10 on the rates, whose own noise is 1, and σ changes by no more;
    4 of it are allowed.
    """
    if np.finfo(np.longdouble).eps > 2e-19:
        pytest.skip("this machine has no extended precision")
    rate = drifting(300_000)
    n = [1, 2, 10, 100, 1365, 1366, 5000]
    exact = rate.astype(np.longdouble)
    theta = np.concatenate((np.zeros(1, np.longdouble), np.cumsum(exact - exact.mean())))
    expected = []
    for k in n:
        if kind == "totdev":
            inner = theta[-2:0:-1]
            points = np.concatenate((2 * theta[0] - inner, theta, 2 * theta[-1] - inner))[300_000 - k : 599_999 + k]
        else:
            points = theta[::k] if kind in {"adev", "hdev"} else theta
        spacing = 1 if kind in {"adev", "hdev"} else k
        for _ in range(3 if kind in {"ohdev", "hdev"} else 2):
            points = points[spacing:] - points[:-spacing]
        if kind == "mdev":
            running = np.concatenate((np.zeros(1, np.longdouble), np.cumsum(points)))
            points = (running[k:] - running[:-k]) / k
        expected.append(float(np.sqrt(np.mean(points**2) / (6 if kind in {"ohdev", "hdev"} else 2)) / k))
    assert np.abs(deviation(rate, n, kind) / expected - 1.0).max() < 4 * 1.35e-10


def test_drifts_in_closed_form():
    """rate = R t: averages a time τ apart differ by R τ, so σ = R τ / √2 exactly; third differences do not see it.

    rate = c t²: third differences of θ = c t³ / 3 are 2 c τ³, so the Hadamard deviation is 2 c τ² / √6.
    """
    n = np.array([1, 10, 100, 300])
    rate, bent = 0.3 * np.arange(1000), 1e-3 * np.arange(1000.0) ** 2
    for kind in ("oadev", "adev", "mdev"):
        np.testing.assert_allclose(deviation(rate, n, kind), 0.3 * n / math.sqrt(2.0), rtol=1e-9)
    for kind in ("ohdev", "hdev"):
        assert deviation(rate, n, kind).max() < 1000.0**2 * EPS * 0.3 * 8.0
        np.testing.assert_allclose(deviation(bent, n, kind), 2e-3 * n.astype(float) ** 2 / math.sqrt(6.0), rtol=1e-7)


@pytest.mark.parametrize("kind", KINDS)
def test_an_offset_does_not_cost_digits(kind):
    """A million times the noise on top, as a converter's counts may have: only the samples' own rounding is lost."""
    rate = white(3000, seed=4)
    n = [1, 100, 1000]
    rounded = (rate + 2.0**20) - 2.0**20  # what is left of the samples after the offset rounded them
    found = deviation(rate + 2.0**20, n, kind)
    assert np.abs(found / deviation(rounded, n, kind) - 1.0).max() < 2.0**20 * EPS
    assert np.abs(found / deviation(rate, n, kind) - 1.0).max() < 1e-7


def test_factors_in_any_order_groups_and_tiles_channels_and_constants():
    rate = white(300)
    n = [7, 1, 150, 7, 2, 30, 90, 3]
    assert deviation(rate, n).tolist() == [deviation(rate, sorted(set(n)))[sorted(set(n)).index(k)] for k in n]
    # A tile is longer than most records here.
    count = 3000 if is_plain() else 5 * kernels.TILE // 2
    rate = white(count)
    theta = np.concatenate(([0.0], np.cumsum(rate - rate.mean())))
    for n in ([1, 2, 3], [5], [1, 40, count // 4, count // 2], [1, 2, 3, 5, 8, count // 3, count // 2 - 1]):
        expected = [math.sqrt(np.mean((theta[2 * k :] - 2 * theta[k:-k] + theta[: -2 * k]) ** 2) / 2) / k for k in n]
        np.testing.assert_allclose(deviation(rate, n), expected, rtol=1e-12)
    for n in ([1, count // 3], [7, count // 5]):
        third = [theta[3 * k :] - 3 * theta[2 * k : -k] + 3 * theta[k : -2 * k] - theta[: -3 * k] for k in n]
        expected = [math.sqrt(np.mean(d**2) / 6) / k for d, k in zip(third, n, strict=True)]
        np.testing.assert_allclose(deviation(rate, n, "ohdev"), expected, rtol=1e-12)
    rate = np.random.default_rng(5).standard_normal((300, 3))
    for kind in KINDS:
        both = deviation(rate, [1, 7], kind)
        assert both.shape == (2, 3) and deviation(rate[:, 0], [1, 7], kind).shape == (2,)
        for axis in range(3):
            assert (both[:, axis] == deviation(rate[:, axis], [1, 7], kind)).all()
        assert (deviation(np.full(30, 7.3), [1, 5, 10], kind) == 0.0).all()


GONE = np.zeros((10, 3))
GONE[4, 2] = math.nan


@pytest.mark.parametrize(("call", "error", "text"), [
    (lambda: deviation(NBS14, [0]), ParameterError, "whole numbers from 1 to 4"),
    (lambda: deviation(NBS14, [5]), ParameterError, r"n\[0\] = 5"),
    (lambda: deviation(NBS14, [1, 1.5]), ParameterError, r"n\[1\] = 1.5"),
    (lambda: deviation(NBS14, [math.nan]), ParameterError, "n"),
    (lambda: deviation(NBS14, [1], "theo1"), ShapeError, "kind must be one of oadev, adev, mdev, ohdev, hdev, totdev"),
    (lambda: deviation(GONE, [1]), ShapeError, r"rate\[4, 2\] is not finite \(1 such values\).*without gaps"),
    (lambda: deviation([1.0, 2.0, math.inf, -math.inf], [1]), ShapeError, r"rate\[2\] is not finite \(2 such"),
    (lambda: deviation([1.7e308, 1.7e308], [1]), ShapeError, r"too large to be added, up to 1.7e\+308"),
    (lambda: deviation(np.zeros((2, 3, 4)), [1]), ShapeError, "shape"),
    (lambda: deviation(np.zeros(0), [1]), ShapeError, "shape"),
    (lambda: deviation(np.zeros(()), [1]), ShapeError, "shape"),
    (lambda: edf("oadev", 0.0, 100, [1, 51]), ParameterError, r"n\[1\] = 51, but for oadev of 100 samples .* 1 to 50"),
    (lambda: edf("mdev", 0.0, 100, [34]), ParameterError, "from 1 to 33"),
    (lambda: edf("hdev", 0.0, 100, [1.5]), ParameterError, "from 1 to 33"),
    (lambda: edf("oadev", -2.5, 100, [1]), ParameterError, "alpha of oadev must lie between -2 and 2"),
    (lambda: edf("theo1", 0.0, 100, [1]), ShapeError, "kind"),
])  # fmt: skip
def test_what_cannot_be_analysed_or_does_not_exist_is_refused(call, error, text):
    with pytest.raises(error, match=text):
        call()


EDF_KINDS = ("oadev", "adev", "mdev", "ohdev", "hdev")
SUMMED = 3e-3  # what the straight lines between far lags cost, at most
CUT = 8e-3  # what the correlation of flicker noise beyond the lags that are summed is worth


def weights(kind, n):
    """Of the samples in one difference, by what the deviations are: differences of averages."""
    order, averaged = SHAPES[kind].order, SHAPES[kind].averaged
    found = np.ones(n)
    for _ in range(order - 1):
        found = np.convolve(found, np.concatenate(([-1.0], np.zeros(n - 1), [1.0])))
    return np.convolve(found, np.ones(n)) if averaged else found


def correlation_by_spectrum(kind, alpha, n, size=1 << 16):
    """Of differences at all lags, from the density |2 sin(ω/2)|^α and the response of the weights, by a long FFT."""
    response = np.abs(np.fft.rfft(weights(kind, n), size)) ** 2
    omega = 2.0 * math.pi * np.arange(response.size) / size
    density = np.zeros_like(omega)
    density[1:] = (2.0 * np.sin(omega[1:] / 2.0)) ** alpha
    found = np.fft.irfft(response * density, size)
    return found / found[0]


def direct(kind, alpha, count, n):
    shape = SHAPES[kind]
    stride = 1 if shape.overlapping else n
    terms = shape.terms(count, n)
    lag = np.arange(terms)
    rho = correlation_by_spectrum(kind, alpha, n)[lag * stride]
    total = 2.0 * np.sum((1.0 - lag / terms) * rho**2) - 1.0
    return terms / total


@pytest.mark.parametrize("kind", EDF_KINDS)
def test_against_the_spectrum(kind):
    """The correlation from the spectral density, summed lag by lag, for every exponent that the kind can tell.

    The FFT folds the correlation at a distance of 2^16, which is nothing; that its density is sampled costs a walk the
    square of its step at ω = 0, where the response of the weights is zero of order 2d − 2: 2e-5 is left.
    """
    for alpha in SHAPES[kind].levels:
        for count, n in ((500, 1), (500, 2), (500, 7), (500, 60), (500, 165)):
            assert edf(kind, alpha, count, [n])[0] == pytest.approx(direct(kind, alpha, count, n), rel=SUMMED + CUT)


@pytest.mark.parametrize(("alpha", "low", "high"), [(-1.3, -2, -1), (-0.5, -1, 0), (0.5, 0, 2), (1.0, 0, 2)])
def test_two_noises_together(alpha, low, high):
    """Correlations add by the shares of dev² that the noises have: α = 1 is half white noise and half quantization."""
    for n in (3, 20, 60, 120):
        share = (alpha - low) / (high - low)
        terms = 500 - 2 * n + 1
        lag = np.arange(terms)
        parts = [correlation_by_spectrum("oadev", level, n)[lag] for level in (low, high)]
        rho = (1.0 - share) * parts[0] + share * parts[1]
        exact = terms / (2.0 * np.sum((1.0 - lag / terms) * rho**2) - 1.0)
        assert edf("oadev", alpha, 500, [n])[0] == pytest.approx(exact, rel=SUMMED + CUT)


def test_white_noise_exactly_and_the_formulas_of_the_handbook():
    """Its differences fall in a straight line from 1 to −1/2 at a shift of n and return to 0 at 2n."""
    for count, n in ((1000, 1), (1000, 10), (1000, 100), (1000, 499), (1000, 500)):
        terms = count - 2 * n + 1
        shift = np.arange(1, min(terms, 2 * n))
        rho = np.where(shift <= n, 1.0 - 1.5 * shift / n, 0.5 * shift / n - 1.0)
        exact = terms / (1.0 + 2.0 * np.sum((1.0 - shift / terms) * rho**2))
        assert edf("oadev", 0.0, count, [n])[0] == pytest.approx(exact, rel=SUMMED if n > 16 else 1e-12)
    assert edf("oadev", 0.0, 1000, [500])[0] == 1.0
    # [Riley2008] Table 5: overlapping Allan, white noise and quantization, good to some per cent.
    for count, n in ((1000, 1), (1000, 10), (1000, 100), (100_000, 10_000)):
        points = count + 1
        white = (1.5 * (points - 1) / n - 2.0 * (points - 2) / points) * 4.0 * n**2 / (4.0 * n**2 + 5.0)
        assert edf("oadev", 0.0, count, [n])[0] == pytest.approx(white, rel=0.02)
    for n in (1, 10, 100):
        phase = (1001 + 1) * (1001 - 2 * n) / (2.0 * (1001 - n))
        assert edf("oadev", 2.0, 1000, [n])[0] == pytest.approx(phase, rel=0.05)
    # [Riley2008] Table 7: 1.5 T/τ, 1.17 T/τ − 0.22, 0.93 T/τ − 0.36; short averages are Allan's overlapping ones.
    for alpha, b, c in ((0, 1.5, 0.0), (1e-9, 1.5, 0.0), (-1, 1.17, 0.22), (-2, 0.93, 0.36)):
        assert edf("totdev", alpha, 1000, [250])[0] == pytest.approx(4.0 * b - c)
        assert edf("totdev", alpha, 1000, [2])[0] == edf("oadev", alpha, 1000, [2])[0]
    assert edf("totdev", 2.0, 1000, [250])[0] == edf("oadev", 2.0, 1000, [250])[0]


def test_many_factors_and_channels():
    n = np.arange(1, 501)
    every, some = (edf("oadev", -1.3, 1000, k) for k in (n, n[::7]))
    np.testing.assert_allclose(every[::7], some, rtol=1e-3)  # many are interpolated
    assert (edf("oadev", -1.3, 1000, n[::-7]) == edf("oadev", -1.3, 1000, np.sort(n[::-7]))[::-1]).all()
    with pytest.raises(ParameterError, match="must increase"):
        edf("oadev", -1.3, 1000, n[::-1])
    alpha = np.array([[0.0, -1.0], [-1.0, -2.0]])
    channels = edf("oadev", alpha, 100, [2, 20])
    assert channels.shape == (2, 2) and channels[1, 0] == edf("oadev", -1.0, 100, [2])[0]
