"""Quality flags: a healthy burst passes, and each fault that is planted is found by its test."""

import numpy as np
import pytest

from plumbob.core import flags
from plumbob.core.constants import G0
from plumbob.overview.quality import FAIL, MISSING, NOT_EVALUATED, PASS, SUSPECT, thresholds, verdict

RATE, LENGTH = 50.0, 600.0
SPAN = (0.0, LENGTH)


def burst(seed=0):
    """Ten minutes of waves and noise: times, three axes, no flags."""
    t = np.arange(0.0, LENGTH, 1.0 / RATE)
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0.0, 6.0, 3)
    values = np.sin(2.0 * np.pi * t[:, None] / 5.0 + phase) + rng.normal(0.0, 0.1, (t.size, 3))
    return t, values, np.zeros(t.size, dtype=np.uint32)


def test_a_healthy_burst_passes():
    t, values, words = burst()
    for channel, offset in (("gyr", 0.0), ("acc", G0), ("mag", 26.0), ("attitude", 0.0)):
        own = values[:, :2] if channel == "attitude" else values + offset
        found = verdict(channel, t, own, words, SPAN)
        assert (found.flag, found.why) == (PASS, ""), channel
        assert found.good == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("seed", range(5))
def test_noise_at_rest_passes(seed):
    """White noise alone: of 60 000 values of three axes few are beyond four standard deviations."""
    t, values, words = burst()
    noise = np.random.default_rng(seed).normal(size=values.shape)
    assert verdict("gyr", t, noise, words, SPAN).flag == PASS


def test_spikes_are_found():
    t, values, words = burst()
    for count, flag in ((8, SUSPECT), (400, FAIL)):
        own = values.copy()
        own[100 : 100 + 7 * count : 7, 1] += 30.0 if count == 8 else 40.0
        assert verdict("gyr", t, own, words, SPAN).tests["spike"] == flag


def test_a_hole_is_a_gap_and_costs_good_samples():
    t, values, words = burst()
    for seconds, gap, good in ((0.5, PASS, PASS), (5.0, SUSPECT, PASS), (45.0, FAIL, SUSPECT), (90.0, FAIL, FAIL)):
        kept = (t < 100.0) | (t >= 100.0 + seconds)
        found = verdict("gyr", t[kept], values[kept], words[kept], SPAN)
        assert (found.tests["gap"], found.tests["percent good"]) == (gap, good)
        assert found.good == pytest.approx(1.0 - seconds / LENGTH, abs=1e-3)
    assert verdict("gyr", t[:-250], values[:-250], words[:-250], SPAN).tests["gap"] == SUSPECT  # at the end


def test_a_slow_magnetometer_is_whole():
    """Three values in four samples: its own rate counts."""
    t, values, words = burst()
    own = values + 26.0
    own[3::4] = np.nan
    found = verdict("mag", t, own, words, SPAN)
    assert found.flag == PASS
    assert found.good == pytest.approx(1.0, abs=1e-3)


def test_clipped_samples_are_out_of_range():
    t, values, words = burst()
    for count, flag in ((2, PASS), (30, SUSPECT), (600, FAIL)):
        marked = words.copy()
        marked[:count] = flags.GYR_CLIPPED
        assert verdict("gyr", t, values, marked, SPAN).tests["range"] == flag


def test_a_stuck_sensor_is_flat():
    t, values, words = burst()
    for seconds, flag in ((0.5, PASS), (2.0, SUSPECT), (8.0, FAIL)):
        own = values.copy()
        own[1000 : 1000 + round(seconds * RATE) + 1] = own[1000]
        assert verdict("acc", t, own + G0, words, SPAN).tests["flat line"] == flag


def test_a_step_of_the_mean_is_a_shift_and_a_ramp_is_none():
    """A step large against the noise is two standard deviations; a ramp changes 0.43 of them from eighth to eighth."""
    t, values, words = burst()
    half = t[:, None] >= LENGTH / 2.0
    assert verdict("gyr", t, values + 20.0 * half, words, SPAN).tests["mean shift"] == FAIL
    assert verdict("gyr", t, values + 1.5 * half, words, SPAN).tests["mean shift"] == SUSPECT
    assert verdict("gyr", t, values + 20.0 * t[:, None] / LENGTH, words, SPAN).tests["mean shift"] == PASS
    assert "mean shift" not in verdict("gyr", t[:2000], values[:2000], words[:2000], (0.0, 40.0)).tests


def test_hard_accelerations_are_found():
    t, values, words = burst()
    vertical = np.zeros(t.size)
    vertical[10] = -0.51 * G0
    assert verdict("acc", t, values + G0, words, SPAN, vertical).tests["acceleration"] == SUSPECT
    vertical[:400] = 0.51 * G0
    assert verdict("acc", t, values + G0, words, SPAN, vertical).tests["acceleration"] == FAIL
    assert verdict("acc", t, values + G0, words, SPAN, 0.9 * vertical).tests["acceleration"] == PASS


def test_fields_that_are_not_the_earth_s_and_attitudes_that_are_not_trusted_are_not_good():
    t, values, words = burst()
    assert verdict("mag", t, values + 60.0, words, SPAN).tests["field"] == SUSPECT
    words[: t.size // 5] = flags.NOT_CONVERGED
    found = verdict("attitude", t, values[:, :2], words, SPAN)
    assert found.good == pytest.approx(0.8, abs=1e-3)
    assert found.flag == FAIL


def test_nothing_is_missing_and_little_is_not_evaluated():
    t, values, words = burst()
    assert verdict("gyr", t, np.full_like(values, np.nan), words, SPAN).flag == MISSING
    assert verdict("gyr", t[:20], values[:20], words[:20], SPAN).flag == NOT_EVALUATED


def test_every_test_has_its_threshold_stated():
    t, values, words = burst()
    told = {name for name, *_ in thresholds()}
    found = set()
    for channel in ("gyr", "acc", "mag", "attitude"):
        own = values[:, :2] if channel == "attitude" else values
        found |= set(verdict(channel, t, own, words, SPAN, np.zeros(t.size)).tests)
    found |= set(verdict("temp", t, values[:, :1], words, SPAN).tests)
    assert found == told
