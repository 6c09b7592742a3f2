"""Equivalent degrees of freedom against direct sums, formulas of a handbook, and records that are made here."""

import math

import numpy as np
import pytest

from plumbob.core.errors import ParameterError, ShapeError
from plumbob.noise import edf
from plumbob.noise.factors import SHAPES

KINDS = ("oadev", "adev", "mdev", "ohdev", "hdev")
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


@pytest.mark.parametrize("kind", KINDS)
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


@pytest.mark.parametrize(("kind", "alpha", "n", "error", "text"), [
    ("oadev", 0.0, [1, 51], ParameterError, r"n\[1\] = 51, but for oadev of 100 samples .* from 1 to 50"),
    ("mdev", 0.0, [34], ParameterError, "from 1 to 33"),
    ("hdev", 0.0, [1.5], ParameterError, "from 1 to 33"),
    ("oadev", -2.5, [1], ParameterError, "alpha of oadev must lie between -2 and 2"),
    ("theo1", 0.0, [1], ShapeError, "kind"),
])  # fmt: skip
def test_what_does_not_exist_is_refused(kind, alpha, n, error, text):
    with pytest.raises(error, match=text):
        edf(kind, alpha, 100, n)
