"""Statistics of tilt and heading: closed forms, a Rayleigh sea, and a simulated buoy's truth."""

import math

import numpy as np
import pytest

import plumbob
from plumbob.core.errors import ShapeError
from plumbob.quality.tilt import Headings, Inclination, TiltMotion, tilt_statistics, waves

SIM = {"frame": "NED", "sensors": "mpu6000+hmc5983", "unit": "calibrated"}


def sine(amplitude_deg, period, duration=1200.0, rate=100.0, mean_deg=0.0, phase=0.3):
    t = np.arange(0.0, duration, 1.0 / rate)
    return t, np.radians(mean_deg + amplitude_deg * np.sin(2.0 * np.pi * t / period + phase))


@pytest.mark.parametrize("period", [3.0, 7.3, 11.0])
def test_a_sine_has_twice_its_amplitude_and_its_period(period):
    """Every wave has the double amplitude 2 A; std is A / √2; of 1200 s the last, incomplete wave is left out."""
    t, roll = sine(5.0, period, mean_deg=1.0)
    found = tilt_statistics(t, roll, 0.5 * roll).roll
    sampled = 1.0 - math.cos(np.pi * 0.01 / period)  # the crest lies half a step off a sample at most
    for double in (found.significant, found.largest):
        assert np.degrees(double) == pytest.approx(10.0, rel=sampled)
    assert found.tz == pytest.approx(period, rel=1e-6)
    assert found.tp == pytest.approx(period, rel=2e-3)  # a fifth of the step of frequency, 1 / 256 s, at most
    assert found.waves in (int(1200.0 / period) - 1, int(1200.0 / period))
    assert np.degrees(found.sd) == pytest.approx(5.0 / math.sqrt(2.0), rel=2e-3)
    assert np.degrees(found.mean) == pytest.approx(1.0, abs=5.0 * period / (np.pi * 1200.0))
    assert found.rms == pytest.approx(math.hypot(found.mean, found.sd), rel=1e-12)


def test_a_narrow_sea_has_four_standard_deviations():
    """Wave heights of a narrow-banded Gaussian process are Rayleigh distributed, and the mean of their highest third is
    4.004 standard deviations [LonguetHiggins1952].

    Twenty seas of an hour; their mean within three of its standard errors and 2 % for the width of the band.
    """
    t = np.arange(0.0, 3600.0, 0.2)
    frequency = np.arange(0.08, 0.12, 1.0 / 3600.0)
    density = np.exp(-0.5 * ((frequency - 0.1) / 0.004) ** 2)
    ratios = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        amplitude = rng.rayleigh(1.0, frequency.size) * np.sqrt(density)
        phase = rng.uniform(0.0, 2.0 * np.pi, frequency.size)
        wave = 0.01 * (amplitude[:, None] * np.cos(2.0 * np.pi * frequency[:, None] * t + phase[:, None])).sum(axis=0)
        found = tilt_statistics(t, wave, wave).roll
        ratios.append(found.significant / found.sd)
    error = np.std(ratios) / math.sqrt(len(ratios))
    assert np.mean(ratios) == pytest.approx(4.004, abs=3.0 * error + 0.02 * 4.004)
    assert error < 0.03


def test_the_significant_wave_is_the_mean_of_the_highest_third():
    none = np.empty(0)
    heights = np.radians([1.0, 2.0, 3.0, 4.0, 5.0, 9.0])
    one = TiltMotion(6, 0.0, 1.0, -1.0, 1.0, heights, np.ones(6))
    assert np.degrees(one.significant) == pytest.approx(7.0)
    assert np.degrees(one.largest) == pytest.approx(9.0)
    still = TiltMotion(6, 0.0, 0.0, 0.0, 0.0, none, none)
    assert math.isnan(still.significant) and math.isnan(still.tz) and still.waves == 0


def test_no_wave_is_made_of_ripples_or_across_a_gap_and_unknown_attitudes_are_left_out():
    t, roll = sine(5.0, 10.0)
    ripple = np.radians(0.05) * np.sin(2.0 * np.pi * t / 0.05)
    assert tilt_statistics(t, roll + ripple, roll).roll.waves == tilt_statistics(t, roll, roll).roll.waves
    t = np.arange(0.0, 100.0, 0.01)
    x = np.sin(2.0 * np.pi * t / 10.0 - 0.1)
    kept = (t < 42.0) | (t > 44.0)
    heights, periods = waves(t[kept], x[kept], gap=0.05)
    assert heights.size == waves(t, x, gap=0.05)[0].size - 1
    assert periods == pytest.approx(np.full(heights.size, 10.0), abs=1e-4)
    t, roll = sine(5.0, 10.0)
    roll[30_000:40_000] = np.nan
    found = tilt_statistics(t, roll, roll)
    assert found.roll.samples == 110_000
    assert np.degrees(found.roll.significant) == pytest.approx(10.0, rel=1e-4)
    nothing = tilt_statistics(t, np.full(t.size, np.nan), roll).roll
    assert nothing.samples == 0 and math.isnan(nothing.sd)


def test_a_body_that_rolls_over_has_no_mean_roll():
    t = np.arange(0.0, 10.0, 0.01)
    roll = (t + np.pi) % (2.0 * np.pi) - np.pi
    found = tilt_statistics(t, roll, 0.0 * t)
    assert found.roll.wrapped and math.isnan(found.roll.mean) and math.isnan(found.roll.tp)
    assert not found.pitch.wrapped


def test_inclination_is_that_of_the_body_s_axis():
    """cos i = cos φ cos θ; a third of the time at 20° is beyond 15°."""
    t = np.arange(0.0, 30.0, 0.1)
    roll = np.where(t < 10.0, np.radians(20.0), np.radians(3.0))
    pitch = np.where(t < 10.0, 0.0, np.radians(4.0))
    found = tilt_statistics(t, roll, pitch, limit=np.radians(15.0)).inclination
    low = math.degrees(math.acos(math.cos(math.radians(3.0)) * math.cos(math.radians(4.0))))
    assert np.degrees(found.mean) == pytest.approx((20.0 + 2.0 * low) / 3.0)
    assert found.share_beyond == pytest.approx(1.0 / 3.0)
    assert np.degrees(found.greatest) == pytest.approx(20.0)
    assert found.greatest_at < 10.0


def test_bursts_join_to_the_whole():
    rng = np.random.default_rng(3)
    t = np.arange(0.0, 90.0, 0.1)
    roll = np.radians(2.0 * np.sin(t) + rng.normal(0.0, 0.3, t.size) + 0.05 * t)
    whole = tilt_statistics(t, roll, roll)
    cuts = [slice(0, 100), slice(100, 450), slice(450, 900)]
    parts = [tilt_statistics(t[cut], roll[cut], roll[cut]) for cut in cuts]
    joined = TiltMotion.joined([part.roll for part in parts])
    inclined = Inclination.joined([part.inclination for part in parts])
    for name in ("mean", "sd", "rms", "least", "greatest"):
        assert getattr(joined, name) == pytest.approx(getattr(whole.roll, name), rel=1e-12)
    for name in ("mean", "sd", "greatest", "greatest_at", "beyond"):
        assert getattr(inclined, name) == pytest.approx(getattr(whole.inclination, name), rel=1e-12)
    assert joined.waves <= whole.roll.waves


def test_headings_are_directions_on_a_circle():
    """350° and 10°: the mean is North, and the resultant cos 10° [Mardia2000]."""
    found = Headings.of(np.radians([350.0, 10.0, np.nan]))
    assert math.cos(found.mean) == pytest.approx(1.0)
    assert found.resultant == pytest.approx(math.cos(math.radians(10.0)))
    assert found.spread == pytest.approx(math.sqrt(-2.0 * math.log(math.cos(math.radians(10.0)))))
    assert found.samples == 2
    turning = Headings.of(np.linspace(0.0, 2.0 * np.pi, 7200, endpoint=False) + 1e-6)
    assert turning.sectors(36) == pytest.approx(np.full(36, 1.0 / 36.0))
    assert turning.resultant == pytest.approx(0.0, abs=1e-12)


def test_sectors_stand_about_north_and_nothing_known_is_nothing_said():
    found = Headings.of(np.radians([356.0, 1.0, 4.0, 11.0, 100.0]))
    assert found.sectors(36)[[0, 1, 10]] == pytest.approx([0.6, 0.2, 0.2])
    assert found.sectors(16)[[0, 4]] == pytest.approx([0.8, 0.2])
    with pytest.raises(ShapeError, match=r"sectors of 2\.5° and multiples"):
        found.sectors(7)
    empty = Headings.of(np.full(3, np.nan))
    assert math.isnan(empty.mean) and math.isnan(empty.spread)
    assert math.isnan(Inclination.of(np.arange(3.0), np.full(3, np.nan), 0.1).share_beyond)


@pytest.fixture(scope="module")
def buoy():
    return plumbob.simulate("buoy", duration=1200.0, seed=4, **SIM)


def test_statistics_of_the_estimate_are_those_of_the_truth(buoy):
    """Of a simulated buoy within 3 %; an hour of five seeds: at most 1.9 %, as docs/report.md has it."""
    held = plumbob.Recording(imu=buoy.imu, track=buoy.truth, name="truth")
    truth = plumbob.report(held, filter="track").subjects[0].gathered
    found = plumbob.report(buoy.imu).subjects[0].gathered
    for name in ("roll", "pitch"):
        ours, theirs = getattr(found.tilt, name), getattr(truth.tilt, name)
        for number in ("sd", "rms", "significant", "largest", "tz", "tp"):
            assert getattr(ours, number) == pytest.approx(getattr(theirs, number), rel=0.03), (name, number)
    for number in ("mean", "rms", "greatest"):
        ours, theirs = found.tilt.inclination, truth.tilt.inclination
        assert getattr(ours, number) == pytest.approx(getattr(theirs, number), rel=0.03)
    assert math.remainder(found.headings.mean - truth.headings.mean, 2.0 * math.pi) == pytest.approx(0.0, abs=0.02)
