"""The whole analysis: mask, sinusoids, model choice, least squares, lines, comparison."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from plumbob.core.errors import ParameterError, ShapeError, UnitError
from plumbob.core.units import Quantity, unit
from plumbob.noise import Coefficient, analyse, compare, curve, deviation, edf
from plumbob.noise.bands import find_mask, least_squares, lines, mask_first_order
from plumbob.noise.findings import GaussMarkov, Mask, Sinusoid
from plumbob.noise.spectrum import find_sinusoids
from plumbob.noise.terms import DATASHEET, DEVIATION, TERMS, allan_transfer, variance
from tests.helpers import slow_as_python
from tests.helpers.noise_records import expected_spectrum, first_order


def white(seed, count=100_000, sd=0.2):
    return sd * np.random.default_rng(seed).standard_normal(count)


def test_variances_are_those_of_the_standard_of_the_transfer_and_of_a_gauss_markov_process():
    """[IEEE952] Annex C at each read-off point: σ = Q at √3, N at 1, 0.664 B, K at 3, R at √2."""
    for letter, term in TERMS.items():
        at = 7.0 if term.read_at is None else term.read_at
        expected = 0.6643 * 2.0 if letter == "B" else 2.0
        assert math.sqrt(variance(letter, 2.0, at)) == pytest.approx(expected, rel=1e-4)
    for quantity, by_letter in DATASHEET.items():
        assert list(by_letter) == list(TERMS) and all(map(unit, by_letter.values()))
        assert unit(DEVIATION[quantity]).quantity is quantity
    # σ² = N²/τ; a sampled walk's is K² τ/3 · (1 + 1/(2n²)), both closed forms of sums.
    ends = np.linspace(0.0, 50.0, 400_001)
    f, width = 0.5 * (ends[1:] + ends[:-1]), 50.0 / 400_000
    n = np.array([1, 3, 10, 50])
    weight = allan_transfer(n, f, 0.01) * width
    assert np.sum(weight, axis=1) == pytest.approx(1.0 / (n * 0.01), rel=1e-6)
    walk = (0.01 / (2.0 * np.sin(np.pi * f * 0.01))) ** 2
    assert weight @ walk == pytest.approx(n * 0.01 / 3.0 * (1.0 + 0.5 / n**2), rel=1e-5)
    # White noise of density 2 sd² t₀ far beyond its time, a random walk of K² = 2 sd² / t₀ far below it.
    process = GaussMarkov(Coefficient(0.3), Coefficient(20.0))
    assert float(process.variance(2e5)) == pytest.approx(2.0 * 0.09 * 20.0 / 2e5, rel=2e-4)
    assert float(process.variance(0.01)) == pytest.approx(2.0 * 0.09 / 20.0 * 0.01 / 3.0, rel=1e-3)
    below, above = process.variance(np.array([0.2 * (1 - 1e-9), 0.2 * (1 + 1e-9)]))
    assert below == pytest.approx(above, rel=1e-6)  # where the series meets the closed form


def test_a_sinusoid_is_measured_and_taken_out():
    """Against the bounds of its noise; its Allan variance against that of the bare samples."""
    t = np.arange(60_000) * 0.01
    wave = 0.02 * np.sin(2.0 * np.pi * 3.21 * t + 0.7)
    (found,), left = find_sinusoids(white(1, 60_000) + wave, 0.01)
    assert abs(found.amplitude - 0.02) <= 4.0 * found.amplitude_sd
    assert abs(found.frequency - 3.21) <= 4.0 * found.frequency_sd
    assert found.amplitude_sd == pytest.approx(0.2 * math.sqrt(2.0 / 60_000), rel=0.3)
    assert np.std(left - white(1, 60_000)) < 4.0 * found.amplitude_sd
    n = np.array([5, 20, 300])
    floor = 1e-4 * 0.02**2  # where sin is near 0, what counts is the sampling and the record's ends
    exact = Sinusoid(0.02, 0.0, 3.21, 0.0, 0.01).variance(n * 0.01)
    assert exact == pytest.approx(deviation(wave, n) ** 2, rel=0.02, abs=floor)
    t = np.arange(240_000) * 0.01  # through averages
    x = white(21, 240_000) + 0.03 * np.sin(2.0 * np.pi * 0.9 * t)
    (found,), _ = find_sinusoids(x.reshape(-1, 40).mean(axis=1), 0.4, 40)
    assert found.dt == pytest.approx(0.01)
    assert abs(found.amplitude - 0.03) <= 4.0 * found.amplitude_sd


@pytest.mark.parametrize(("count", "rises"), [(6000, False), (24_000, False), (6000, True)])
def test_a_sinusoid_is_known_as_well_as_the_bounds_say(count, rises):
    """[Rife1974] for a real sinusoid of amplitude a in white noise: sd(a) = σ √(2/N), sd(f) = √6 σ / (π a Δt N^1.5).

    Of noise whose density rises, as that of differences does by (2 sin πfΔt)², it is the density at the sinusoid.

    The floor is the median of 64 exponential values, over ln 2: known to 1 / (√64 ln 2) = 18 %, so σ to 9 %; the mean
    of 30 records to 1.7 %, and the amplitude, 1/10 of σ, to 11 % or less of itself. Of the 30 frequencies' errors the
    rms is known to 1 / √60.
    """
    t, sd, size = np.arange(count) * 0.01, 0.2, 0.04
    amplitudes, frequencies, off = [], [], []
    for seed in range(30):
        noise = np.diff(white(100 + seed, count + 1, sd)) if rises else white(100 + seed, count, sd)
        (found,), _ = find_sinusoids(noise + size * np.sin(2.0 * np.pi * 3.217 * t + seed), 0.01)
        amplitudes.append(found.amplitude_sd)
        frequencies.append(found.frequency_sd * found.amplitude)
        off.append((found.frequency - 3.217) / found.frequency_sd)
    sd *= 2.0 * math.sin(math.pi * 3.217 * 0.01) if rises else 1.0
    assert np.mean(amplitudes) == pytest.approx(sd * math.sqrt(2.0 / count), rel=4 * 0.017)
    bound = math.sqrt(6.0) * sd / (math.pi * 0.01 * count**1.5)
    assert np.mean(frequencies) == pytest.approx(bound, rel=4 * 0.017)
    assert np.sqrt(np.mean(np.square(off))) == pytest.approx(1.0, abs=4.0 / math.sqrt(60.0))


def test_a_sinusoid_near_half_the_rate_hides_no_quantization_and_noise_has_none():
    """49.98 Hz sampled at 100 Hz: its Allan variance at one sample is its power, and least squares know it."""
    t = np.arange(100_000) * 0.01
    found = analyse(white(20) + 0.05 * np.sin(2.0 * np.pi * 49.98 * t + 0.3), 0.01)
    assert found.sinusoids[0].variance(0.01) == pytest.approx(0.05**2, rel=0.05)
    q, n = (found.least_squares.terms[letter] for letter in "QN")
    assert not q.observable
    assert abs(n.value - 0.02) <= 4.0 * (n.hi - n.lo)
    # Once in a thousand records, whatever drifts in them; 2 of 100 would be a chance of 0.5 %.
    false = sum(
        bool(find_sinusoids(white(seed, 8192) + (seed % 2) * 0.02 * np.cumsum(white(900 + seed, 8192)), 0.01)[0])
        for seed in range(100)
    )
    assert false <= 1


@pytest.mark.parametrize("corner", [6.0, 9.0, 12.0, 20.0])
def test_a_mask_leaves_a_low_pass_less_than_one_percent(corner):
    """Of the density, f²/(f² + f_c²): at most about 6 % where the cut is found, and 2³ times less at the margin below.

    Between the cuts that are tried lie half octaves, a factor of 2: it is not less than a quarter of that, or more than
    need be would be thrown away.
    """
    n = np.unique(np.round(np.geomspace(1, 10_000, 100)).astype(int))
    mask, kept = find_mask(expected_spectrum(lambda f: 1.0 / (1.0 + (f / corner) ** 2), 2_000_000, 0.01), n)
    taken = mask.frequency**2 / (mask.frequency**2 + corner**2)
    assert 0.25 * 0.0075 < taken < 0.01
    assert kept.frequency.max() < mask.frequency
    assert "falls" in mask.reason
    assert find_mask(expected_spectrum(np.ones_like, 2_000_000, 0.01), n)[0] == Mask()


def test_the_mask_of_a_smoothed_record_that_is_too_short_ends_ten_time_constants_on():
    """3 s of smoothing in 60 s: below 3 % of loss there is not a single coefficient, so the curve alone is masked."""
    n = np.array([1, 10, 100, 1000, 2000, 2999, 3000, 3001, 5000])
    mask, kept = mask_first_order(expected_spectrum(np.ones_like, 6000, 0.01), 3.0, n)
    assert kept is None
    assert mask.n == 3000
    assert mask.frequency == pytest.approx(math.sqrt(0.03) / (2.0 * math.pi * 3.0))  # where (2πfτ)² is 3 %
    assert "too short" in mask.reason


@slow_as_python
@pytest.mark.parametrize(("corner", "order"), [(10.0, 1), (20.0, 2)])
def test_a_low_pass_is_masked_and_white_noise_found_all_the_same(corner, order):
    """Passing a first-order low-pass, white noise keeps its density at low frequencies, where N is what it was."""
    decay = math.exp(-2.0 * math.pi * corner * 0.01)
    x = white(2, 400_000)
    for _ in range(order):
        x = lfilter([1.0 - decay], [1.0, -decay], x)
    found = analyse(x, 0.01)
    n = found.terms["N"]
    assert found.mask.frequency < corner and found.mask.n * 0.01 > 1.0 / (2.0 * math.pi * corner)
    assert "falls there as none of the terms does" in found.mask.reason
    assert n.value == pytest.approx(0.02, rel=0.02)  # 3 % of the density is tolerated as no filter
    assert not found.terms["Q"].observable
    assert found.least_squares.terms["N"].value == pytest.approx(0.02, rel=0.02)


@slow_as_python
def test_a_gauss_markov_process_is_told_from_flicker_noise():
    x = white(4, 300_000) + 0.03 * first_order(white(5, 300_000, 1.0), 1.0, 0.01)
    found = analyse(x, 0.01)
    assert found.markov is not None
    assert found.markov.sd.lo * 0.9 <= 0.03 <= found.markov.sd.hi * 1.1
    assert found.markov.time.lo * 0.8 <= 1.0 <= found.markov.time.hi * 1.2
    assert found.candidates[1].chosen
    ratio = (found.model(found.curve.tau) / found.curve.dev)[found.curve.edf > 30.0]
    assert np.abs(ratio - 1.0).max() < 4.0 / math.sqrt(2.0 * 30.0)


def exact_curve(seed=0, **terms):
    """Curve of a long record whose deviations are exactly those of the terms."""
    base = curve(white(seed, 20_000), 0.01)
    return replace(base, dev=np.sqrt(sum(variance(letter, c, base.tau) for letter, c in terms.items())))


@slow_as_python
@pytest.mark.parametrize("letters", ["QNKR", "NK", "N", "QR"])
def test_least_squares_solve_exact_curves_exactly(letters):
    """Without flicker noise, whose sampled curve differs at few samples."""
    truth = {"Q": 1e-3, "N": 0.02, "K": 0.01, "R": 1e-3}
    terms = least_squares(exact_curve(**{letter: truth[letter] for letter in letters})).terms
    for letter in "QNBKR":
        expected = truth[letter] if letter in letters else 0.0
        assert terms[letter].value == pytest.approx(expected, rel=1e-6, abs=1e-6)


@slow_as_python
def test_least_squares_have_no_negative_coefficients():
    """White noise less a random walk that takes a quarter of it at the end: no K, and no R, which would be negative."""
    whole = exact_curve(N=0.02)
    walk = np.sqrt(0.25 * 3.0) * 0.02 / whole.tau[-1]
    less = replace(whole, dev=np.sqrt(whole.dev**2 - walk**2 * whole.tau / 3.0))
    terms = least_squares(less).terms
    assert (terms["K"].value, terms["R"].value) == (0.0, 0.0)
    assert terms["N"].value == pytest.approx(0.02, rel=1e-3)  # which the well-known short times tell


@slow_as_python
@pytest.mark.parametrize(("letter", "value"), [("Q", 1e-3), ("N", 0.02), ("B", 0.01), ("K", 0.3), ("R", 0.01)])
def test_lines_read_off_a_single_term_exactly(letter, value):
    found = lines(exact_curve(**{letter: value})).terms
    assert set(found) == {letter}
    assert found[letter].value == pytest.approx(value, rel=1e-9)
    samples = (math.sqrt(3.0) if letter == "B" else TERMS[letter].read_at) / 0.01
    percent = 1.0 / math.sqrt(2.0 * (20_000 / samples - 1.0))
    assert found[letter].hi == pytest.approx(value * (1.0 + percent), rel=1e-9)


@slow_as_python
def test_a_filter_is_recognised_and_its_curve_is_not_believed_and_none_is_without_one():
    """A scalar filter of gain 1 − exp(−0.01): 1 s. White noise keeps √(1 − (3 − 4e^−x + e^−2x) / 2x), x = τ/s."""
    keep = math.exp(-0.01)
    x = white(7, 200_000)
    found = compare(x, lfilter([1.0 - keep], [1.0, -keep], x), 0.01)
    assert found.time_constant == pytest.approx(1.0, rel=0.03)
    assert found.corner == pytest.approx(1.0 / (2.0 * math.pi), rel=0.2)
    ratio = found.tau / 1.0
    expected = np.sqrt(1.0 - (3.0 - 4.0 * np.exp(-ratio) + np.exp(-2.0 * ratio)) / (2.0 * ratio))
    there = (found.tau > 0.2) & (found.before.edf > 50.0)
    assert found.ratio[there] == pytest.approx(expected[there], rel=0.05)
    assert any(str(note).startswith("warning") and "no slope" in str(note) for note in found.notes)
    assert any("the records show no change" in str(note) for note in found.notes)
    assert compare(white(8), white(9), 0.01).notes[0].code == "noise.no_low_pass"
    halved = compare(white(8), 0.5 * white(8), 0.01)
    assert halved.time_constant is None
    assert str(halved.notes[-1]) == "the deviation has changed by a factor of 0.500"
    with pytest.raises(ParameterError, match="after is constant"):
        compare(white(8), np.ones(100), 0.01)


def smoothed(seed, count, time, dt=0.1):
    keep = math.exp(-dt / time)
    return lfilter([1.0 - keep], [1.0, -keep], white(seed, count, 0.1))


@slow_as_python
def test_a_smoothed_record_is_recognised_and_what_lies_below_its_filter_is_found():
    """White noise keeps its density at low frequencies: N = 0.1 √0.1. A line of +1/2, the filter's, is not read off."""
    found = analyse(smoothed(10, 400_000, 5.0), 0.1)
    assert "looks smoothed, as by a filter of first order with a time constant of" in found.mask.reason
    assert found.mask.n * 0.1 > 25.0
    n = found.terms["N"]
    assert abs(n.value - 0.1 * math.sqrt(0.1)) <= 3.0 * (n.hi - n.lo) + 0.015 * n.value  # 3 % of the density
    assert found.markov is None and "K" not in found.lines.terms
    short = analyse(smoothed(11, 20_000, 5.0), 0.1)
    assert "too short to show more" in short.mask.reason
    assert dict(short.terms) == short.lines.terms == {}
    assert short.markov.time.lo <= 5.5 and short.markov.time.hi >= 4.5


@slow_as_python
def test_intervals_are_of_the_noise_that_was_found():
    """A random walk under white noise: at the longest times its edf, however the end of the curve happens to bend."""
    x = white(12, 50_000, 0.05) + 0.01 * np.cumsum(white(13, 50_000, 1.0))
    found = analyse(x, 0.01)
    assert found.curve.alpha[-1] == pytest.approx(-2.0, abs=0.02)
    assert found.curve.alpha[0] > -1.0
    assert found.curve.edf[-1] == pytest.approx(edf("oadev", -2.0, 50_000, found.curve.n[-1:])[0], rel=0.05)


def test_lists_float32_and_large_offsets_are_analysed_alike():
    x = white(1, 5000)
    n = analyse(x, 0.01).terms["N"].value
    for same in (x.tolist(), x.astype(np.float32), np.repeat(x, 2)[::2]):
        assert analyse(same, 0.01).terms["N"].value == pytest.approx(n, rel=1e-6)
    assert analyse(x + 1e6, 0.01).terms["N"].value == pytest.approx(n, rel=1e-7)
    assert analyse(1e12 * x, 0.01).terms["N"].value == pytest.approx(1e12 * n, rel=1e-9)


@slow_as_python
def test_white_noise_is_not_masked_and_a_warm_up_is_no_noise():
    found = analyse(white(3), 0.01)
    assert (found.mask.n, found.notes, found.sinusoids, found.markov) == (1, (), (), None)
    assert found.terms["B"].hours > found.duration / 3600.0
    t = np.arange(200_000) * 0.01
    warming = analyse(white(6, 200_000, 0.02) + 0.1 * np.exp(-t / 300.0), 0.01)
    assert any("times the noise that the terms make" in str(note) for note in warming.notes)


@pytest.mark.parametrize(("values", "dt", "options", "error", "text"), [
    (white(0, 50), 0.01, {}, ParameterError, "needs 100 samples or more, but got 50"),
    (np.ones(500), 0.01, {}, ShapeError, "is the record constant"),
    (np.append(white(0, 500), np.nan), 0.01, {}, ShapeError, "not finite"),
    (white(0, 500), 0.01, {"quantity": Quantity.ANGLE}, UnitError, "one of rate, acceleration, field, ratio"),
    (white(0, 500), 0.0, {}, ParameterError, "above 0 s"),
])  # fmt: skip
def test_what_cannot_be_analysed_is_refused(values, dt, options, error, text):
    with pytest.raises(error, match=text):
        analyse(values, dt, **options)
