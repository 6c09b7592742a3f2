"""Spectra by Welch's method: power, peaks, gaps, and samples that are not even in time."""

import math

import numpy as np
import pytest

from plumbob.quality.spectra import LEAST, Spectra, peak_period, welch

RATE = 50.0


def times(duration=1000.0):
    return np.arange(0.0, duration, 1.0 / RATE)


def test_the_integral_is_the_variance():
    """Of a sine A² / 2, of white noise σ²: the density is one-sided [Welch1967]."""
    t = times()
    rng = np.random.default_rng(1)
    noise = rng.normal(0.0, 0.3, t.size)
    found = welch(t, np.stack((2.0 * np.sin(2.0 * np.pi * 0.2 * t), noise), axis=1), segment=100.0)
    power = found.density.sum(axis=0) * found.frequency[0]
    assert power[0] == pytest.approx(2.0, rel=1e-3)
    assert power[1] == pytest.approx(0.09, rel=0.02)
    assert np.mean(found.density[:, 1]) == pytest.approx(2.0 * 0.09 / RATE, rel=0.02)
    assert found.frequency[0] == pytest.approx(0.01)
    assert found.segments.tolist() == [19, 19]


@pytest.mark.parametrize("period", [3.7, 5.0, 12.9])
def test_a_peak_is_found_between_the_steps_of_frequency(period):
    t = times()
    found = welch(t, np.sin(2.0 * np.pi * t / period)[:, None], segment=100.0)
    assert 1.0 / peak_period(found, 0) == pytest.approx(1.0 / period, abs=0.1 * found.frequency[0])


def test_no_segment_crosses_a_gap_or_an_unknown_value():
    """A jump at the gap would fill the spectrum."""
    t = times()
    x = np.sin(2.0 * np.pi * 0.2 * t)
    later = np.where(np.arange(t.size) >= 23_000, t + 5.0, t)
    jumps = np.where(np.arange(t.size) >= 23_000, x + 100.0, x)
    broken = welch(later, jumps[:, None], segment=100.0)
    assert broken.segments.tolist() == [8 + 9]
    assert broken.density.sum() * broken.frequency[0] == pytest.approx(0.5, rel=1e-3)
    hole = x.copy()
    hole[23_000:23_010] = np.nan
    assert welch(t, hole[:, None], segment=100.0).segments.tolist() == [8 + 9]
    assert math.isnan(peak_period(welch(t, np.full((t.size, 1), np.nan)), 0))


def test_an_angle_goes_on_through_the_half_turn_and_uneven_samples_are_interpolated():
    t = times()
    angle = np.pi + 0.3 * np.sin(2.0 * np.pi * 0.2 * t)
    wrapped = (angle + np.pi) % (2.0 * np.pi) - np.pi
    found = welch(t, wrapped[:, None], segment=100.0, turns=(0,))
    assert found.density.sum() * found.frequency[0] == pytest.approx(0.045, rel=1e-3)
    rng = np.random.default_rng(2)
    t = np.sort(times(400.0) + rng.uniform(-0.45, 0.45, times(400.0).size) / RATE)
    found = welch(t, np.sin(2.0 * np.pi * 0.2 * t)[:, None], segment=100.0)
    assert found.interpolated == found.segments.sum() == 7
    assert found.density.sum() * found.frequency[0] == pytest.approx(0.5, rel=0.01)


def test_parts_join_by_their_numbers_of_segments():
    t = times(400.0)
    rng = np.random.default_rng(5)
    x = rng.normal(size=(t.size, 1))
    one, two = welch(t[:10_000], x[:10_000], segment=40.0), welch(t[10_000:], x[10_000:], segment=40.0)
    joined = Spectra.joined([one, two])
    assert joined.segments.tolist() == [one.segments[0] + two.segments[0]]
    weighted = one.density * one.segments + two.density * two.segments
    assert joined.density == pytest.approx(weighted / joined.segments)


def test_bands_keep_the_power_and_a_short_stretch_has_short_segments():
    t = times()
    found = welch(t, np.random.default_rng(6).normal(size=(t.size, 1)), segment=200.0)
    frequency, density = found.gathered()
    assert frequency.size < found.frequency.size / 3
    assert frequency[:100] == pytest.approx(found.frequency[:100])
    assert np.mean(density) == pytest.approx(np.mean(found.density), rel=0.1)
    assert welch(np.arange(3.0), np.zeros((3, 1))).length == LEAST
