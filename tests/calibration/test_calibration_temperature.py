"""Bias of a gyroscope over temperature, from a soak at rest."""

from dataclasses import replace

import numpy as np
import pytest

from plumbob.calibration.gyr.rest import UNCALIBRATED, Rates
from plumbob.calibration.gyr.temperature import fit_temperature
from plumbob.core.units import dps, to_dps
from plumbob.data.calibrated import temperature_drift
from tests.helpers.refusals import reason_kinds

WHITE = float(dps(0.01))  # N, rad/s/√Hz
WALK = float(dps(2e-4))  # K, rad/s/√s: much, so that it shows within the hour


def curve(temp_c, slopes):
    warmer = np.asarray(temp_c) - 25.0
    return np.stack([warmer ** (k + 1) for k in range(len(slopes))], axis=1) @ slopes


def soak(seed, degree=1, *, walk=0.0, hours=1.0, rate=4.0, cycle=True, hysteresis=0.0):
    """An hour from 25 to 45 °C and back, or up only; what the bias does besides is white noise and a random walk."""
    rng = np.random.default_rng(seed)
    n = round(3600.0 * hours * rate)
    t = np.arange(n) / rate
    temp_c = 35.0 - 10.0 * np.cos(2.0 * np.pi * t / t[-1] / (1.0 if cycle else 2.0))
    sizes = dps(np.array([[0.1, -0.05, 0.03], [2e-3, -1e-3, 3e-3], [6e-5, 4e-5, -3e-5]]))[:degree]
    slopes = sizes * rng.uniform(0.7, 1.3, sizes.shape)
    bias = dps(rng.normal(0.0, 1.0, 3))
    wander = np.cumsum(walk / np.sqrt(rate) * rng.standard_normal((n, 3)), axis=0)
    gyr = bias + curve(temp_c, slopes) + wander + WHITE * np.sqrt(rate) * rng.standard_normal((n, 3))
    return t, gyr + hysteresis * np.sign(np.gradient(temp_c))[:, None], temp_c, slopes, bias


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_the_degree_is_the_one_that_is_there(degree):
    for seed in range(4):  # a power too many once in a thousand
        t, gyr, temp_c, slopes, _ = soak(seed, degree)
        found = fit_temperature(Rates(t, gyr, temp_c=temp_c)).calibration
        assert found.bias_per_k.shape == (degree, 3)
        left = temperature_drift(found, np.linspace(25.0, 45.0, 21)) - curve(np.linspace(25.0, 45.0, 21), slopes)
        assert to_dps(np.abs(left).max()) <= 0.005


def test_standard_deviations_hold_for_a_bias_that_wanders_or_may_wander():
    z = []
    for seed in range(16):
        t, gyr, temp_c, slopes, _ = soak(seed, 1, walk=WALK, cycle=False)
        found = fit_temperature(Rates(t, gyr, temp_c=temp_c)).calibration
        if len(found.bias_per_k) == 1:
            z.append((found.bias_per_k - slopes) / found.bias_per_k_sd)
    assert len(z) >= 15  # a power too many once in a hundred; plain least squares finds one in most of them
    assert 0.55 <= np.mean(np.abs(z) < 1.0) <= 0.86  # 68 to 73 % ± 2 × 6.7 %, of 48
    assert np.mean(np.square(z)) <= 1.6  # 1 + 3 × √(2/48)
    # Without one they are N/√T/σ of a slope over the temperature; the largest likely one is more than none.
    wider = []
    for seed in range(3):
        t, gyr, temp_c, *_ = soak(seed)
        found = fit_temperature(Rates(t, gyr, temp_c=temp_c)).calibration
        wider.append(found.bias_per_k_sd / (WHITE / np.sqrt(t[-1]) / temp_c.std()))
    assert np.mean(wider) > 1.2


def test_the_bias_is_that_at_the_reference_temperature():
    t, gyr, temp_c, _, bias = soak(1, 2)
    found = fit_temperature(Rates(t, gyr, temp_c=temp_c)).calibration
    assert found.temp_ref_c == 25.0
    assert found.temp_span_c == (temp_c.min(), temp_c.max())
    assert (np.abs(found.bias - bias) <= 4.0 * found.bias_sd).all()
    warm = fit_temperature(Rates(t, gyr, temp_c=temp_c + 30.0)).calibration
    assert warm.temp_ref_c == pytest.approx(65.0)  # the middle of a span that does not hold 25 °C


def test_the_card_is_kept_and_a_knock_cut_out():
    t, gyr, temp_c, _, bias = soak(2)
    coupling, acc = dps(0.1) * np.eye(3), np.tile([0.0, 0.0, 9.8], (t.size, 1))
    known = replace(UNCALIBRATED, matrix=1.02 * np.eye(3), g_sensitivity=coupling, bias=np.ones(3))
    found = fit_temperature(Rates(t, gyr + acc @ coupling.T, temp_c=temp_c, acc=acc, known=known)).calibration
    assert (found.matrix == known.matrix).all() and (found.g_sensitivity == coupling).all()
    assert (np.abs(found.bias - bias) <= 4.0 * found.bias_sd).all()
    t, gyr, temp_c, slopes, _ = soak(3)
    knocked = gyr.copy()
    knocked[5000:5040] += dps(30.0) * np.random.default_rng(1).standard_normal((40, 3))
    found = fit_temperature(Rates(t, knocked, temp_c=temp_c)).calibration
    assert (np.abs(found.bias_per_k - slopes) <= 5.0 * found.bias_per_k_sd).all()


def test_soaks_that_are_none_are_refused():
    t, gyr, temp_c, *_ = soak(4)
    swung = gyr + dps(20.0) * np.sin(t)[:, None] * (t > 2000.0)[:, None]
    for rates, kind in (
        (Rates(t, gyr), "no-temperature"),
        (Rates(t, gyr, temp_c=25.0 + 0.1 * (temp_c - 25.0)), "no-temperature"),
        (Rates(t, gyr, temp_c=np.where(t < 1.0, np.nan, temp_c)), "no-temperature"),
        (Rates(t, gyr, temp_c=temp_c, clipped=t > 3599.0), "clipping"),
        (Rates(t[:200], gyr[:200], temp_c=np.linspace(20.0, 40.0, 200)), "too-few"),
        (Rates(t, swung, temp_c=temp_c), "not-still"),
    ):
        assert reason_kinds(fit_temperature, rates)[0] == kind


def test_hysteresis_is_told_and_only_where_it_is():
    for seed in range(5):
        for soaked, expected in ((soak(seed, hysteresis=dps(0.02)), True), (soak(seed, walk=WALK), False)):
            remarks = fit_temperature(Rates(*soaked[:2], temp_c=soaked[2])).remarks
            assert any("hysteresis" in str(remark) for remark in remarks) is expected
