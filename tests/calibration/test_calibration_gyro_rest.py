"""Bias of a gyroscope at rest."""

from dataclasses import replace

import numpy as np
import pytest

from plumbob.calibration.fit import CaptureRefusedError
from plumbob.calibration.gyr.plausible import UNCALIBRATED, Rates
from plumbob.calibration.gyr.rest import fit_rest
from plumbob.core.errors import CalibrationError
from plumbob.core.units import dps

WHITE = float(dps(0.01))  # N, rad/s/√Hz


def still(seed, seconds=60.0, rate=100.0):
    rng = np.random.default_rng(seed)
    n = round(seconds * rate)
    bias = dps(rng.normal(0.0, 1.0, 3))
    return np.arange(n) / rate, bias + WHITE * np.sqrt(rate) * rng.standard_normal((n, 3)), bias


def test_bias_and_its_standard_deviation_are_those_of_white_noise():
    z, sd = [], []
    for seed in range(30):
        t, gyr, bias = still(seed)
        found = fit_rest(Rates(t, gyr)).calibration
        z.append((found.bias - bias) / found.bias_sd)
        sd.append(found.bias_sd)
    assert np.mean(sd) == pytest.approx(WHITE / np.sqrt(60.0), rel=0.1)  # N/√T; each from 10 blocks, 90 of them: 2.5 %
    assert 0.6 <= np.mean(np.abs(z) < 1.0) <= 0.8  # 66 % of Student's t with 9 degrees of freedom, ± 3 × 5 %


def test_what_the_card_has_already_is_kept_and_taken_off():
    t, gyr, bias = still(1)
    temp_c = np.linspace(20.0, 40.0, t.size)
    slope, coupling = dps(np.array([0.1, 0.0, 0.02])), dps(0.1) * np.eye(3)
    acc = np.tile([0.0, 0.0, 9.8], (t.size, 1))
    known = replace(UNCALIBRATED, matrix=1.02 * np.eye(3), bias_per_k=slope, g_sensitivity=coupling)
    drifted = gyr + np.outer(temp_c - 25.0, slope) + acc @ coupling.T
    found = fit_rest(Rates(t, drifted, acc=acc, temp_c=temp_c, known=known)).calibration
    assert np.abs(found.bias - bias).max() <= 5.0 * WHITE / np.sqrt(60.0)
    assert (found.matrix == known.matrix).all()
    assert (found.bias_per_k == known.bias_per_k).all()
    with pytest.raises(CalibrationError, match="record temp_c too"):
        fit_rest(Rates(t, drifted, acc=acc, known=known))
    with pytest.raises(CalibrationError, match="record acc too"):
        fit_rest(Rates(t, drifted, temp_c=temp_c, known=known))


def test_the_temperature_of_the_rest_is_kept():
    t, gyr, _ = still(2)
    assert fit_rest(Rates(t, gyr, temp_c=np.full(t.size, 31.0))).calibration.temp_ref_c == pytest.approx(31.0)


def test_motion_and_clipping_are_refused():
    t, gyr, _ = still(3, 20.0)
    swung = gyr + dps(50.0) * np.sin(2.0 * np.pi * t)[:, None] * np.random.default_rng(1).normal(size=(t.size, 1))
    with pytest.raises(CaptureRefusedError, match="not-still"):
        fit_rest(Rates(t, swung))
    with pytest.raises(CaptureRefusedError, match="clipping"):
        fit_rest(Rates(t, gyr, clipped=t < 1.0))
