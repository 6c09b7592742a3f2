"""Quality flags: a healthy burst passes, and each fault that is planted is found by its test."""

import numpy as np
import pytest

from plumbob.core import flags
from plumbob.core.constants import G0
from plumbob.quality.quality import FAIL, MISSING, NOT_EVALUATED, PASS, SUSPECT, THRESHOLDS, verdict

RATE, LENGTH = 50.0, 600.0
SPAN = (0.0, LENGTH)
OFFSETS = {"gyr": 0.0, "acc": G0, "mag": 26.0, "attitude": 0.0, "temp": 0.0}
T = np.arange(0.0, LENGTH, 1.0 / RATE)
AXES = {"attitude": 2, "temp": 1}
RNG = np.random.default_rng(0)
WAVES = np.sin(2.0 * np.pi * T[:, None] / 5.0 + RNG.uniform(0.0, 6.0, 3)) + RNG.normal(0.0, 0.1, (T.size, 3))


def judged(channel, change=None, *, keep=slice(None), span=SPAN, vertical=None, marks=(0, 0)):
    """Verdict of ten minutes of waves and noise, changed, or of some samples; marks are flags of the first so many."""
    values, words = WAVES + OFFSETS[channel], np.zeros(T.size, dtype=np.uint32)
    words[: marks[1]] = marks[0]
    values = values if change is None else change(values.copy())
    values = values[:, : AXES.get(channel, 3)]
    return verdict(channel, T[keep], values[keep], words[keep], span, vertical)


@pytest.mark.parametrize("channel", ["gyr", "acc", "mag", "attitude"])
def test_a_healthy_burst_passes(channel):
    found = judged(channel)
    assert (found.flag, found.why, found.good) == (PASS, "", pytest.approx(1.0, abs=1e-3))


def test_noise_at_rest_a_slow_magnetometer_and_a_short_burst_pass():
    """White noise alone: of 60 000 values of three axes few are beyond four standard deviations."""
    for seed in range(5):
        assert judged("gyr", lambda v, seed=seed: np.random.default_rng(seed).normal(size=v.shape)).flag == PASS
    assert "mean shift" not in judged("gyr", keep=slice(2000), span=(0.0, 40.0)).tests
    # three values in four samples: its own rate counts
    found = judged("mag", lambda values: np.where(np.arange(T.size)[:, None] % 4 == 3, np.nan, values))
    assert (found.flag, found.good) == (PASS, pytest.approx(1.0, abs=1e-3))


def spikes(count, size):
    def change(values):
        values[100 : 100 + 7 * count : 7, 1] += size
        return values

    return change


def stuck(seconds):
    def change(values):
        values[1000 : 1000 + round(seconds * RATE) + 1] = values[1000]
        return values

    return change


HALF = T[:, None] >= LENGTH / 2.0
FAULTS = [
    ("spike", "gyr", spikes(8, 30.0), SUSPECT),
    ("spike", "gyr", spikes(400, 40.0), FAIL),
    ("flat line", "acc", stuck(0.5), PASS),
    ("flat line", "acc", stuck(2.0), SUSPECT),
    ("flat line", "acc", stuck(8.0), FAIL),
    # a step large against the noise is two standard deviations; a ramp changes 0.43 of them from eighth to eighth
    ("mean shift", "gyr", lambda values: values + 20.0 * HALF, FAIL),
    ("mean shift", "gyr", lambda values: values + 1.5 * HALF, SUSPECT),
    ("mean shift", "gyr", lambda values: values + 20.0 * T[:, None] / LENGTH, PASS),
    ("field", "mag", lambda values: values + 34.0, SUSPECT),
]


@pytest.mark.parametrize(("test", "channel", "change", "flag"), FAULTS)
def test_a_planted_fault_is_found(test, channel, change, flag):
    assert judged(channel, change).tests[test] == flag


def test_a_hole_is_a_gap_clipped_samples_are_out_of_range_and_untrusted_attitudes_not_good():
    for seconds, gap, good in ((0.5, PASS, PASS), (5.0, SUSPECT, PASS), (45.0, FAIL, SUSPECT), (90.0, FAIL, FAIL)):
        found = judged("gyr", keep=~((T >= 100.0) & (T - seconds < 100.0)))
        assert (found.tests["gap"], found.tests["percent good"]) == (gap, good)
        assert found.good == pytest.approx(1.0 - seconds / LENGTH, abs=1e-3)
    assert judged("gyr", keep=slice(-250)).tests["gap"] == SUSPECT  # at the end
    for count, flag in ((2, PASS), (30, SUSPECT), (600, FAIL)):
        assert judged("gyr", marks=(flags.GYR_CLIPPED, count)).tests["range"] == flag
    found = judged("attitude", marks=(flags.NOT_CONVERGED, T.size // 5))
    assert (found.flag, found.good) == (FAIL, pytest.approx(0.8, abs=1e-3))


def test_hard_accelerations_are_found():
    vertical = np.zeros(T.size)
    vertical[10] = -0.51 * G0
    assert judged("acc", vertical=vertical).tests["acceleration"] == SUSPECT
    vertical[:400] = 0.51 * G0
    assert judged("acc", vertical=vertical).tests["acceleration"] == FAIL
    assert judged("acc", vertical=0.9 * vertical).tests["acceleration"] == PASS


def test_nothing_is_missing_little_is_not_evaluated_and_every_test_has_its_threshold_stated():
    assert judged("gyr", lambda values: np.full_like(values, np.nan)).flag == MISSING
    assert judged("gyr", keep=slice(20)).flag == NOT_EVALUATED
    made = {test for channel in OFFSETS for test in judged(channel, vertical=np.zeros(T.size)).tests}
    assert made == {name for name, *_ in THRESHOLDS}
