"""Gyroscopes at rest: their bias; and what passes for a rest and is none: turning, dead axes, absurd biases."""

from dataclasses import replace

import numpy as np
import pytest

from plumbob.calibration.gyr import fit_hand, fit_temperature, fit_trackball
from plumbob.calibration.gyr.rest import UNCALIBRATED, UNSEEN, Rates, fit_rest
from plumbob.core.constants import G0
from plumbob.core.errors import CalibrationError
from plumbob.core.units import dps
from tests.helpers.gyro_sessions import hand
from tests.helpers.refusals import reason_kinds, reasons

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
    assert (found.matrix == known.matrix).all() and (found.bias_per_k == known.bias_per_k).all()
    for missing, others in (("temp_c", {"acc": acc}), ("acc", {"temp_c": temp_c})):
        with pytest.raises(CalibrationError, match=f"record {missing} too"):
            fit_rest(Rates(t, drifted, known=known, **others))
    warm = fit_rest(Rates(t, gyr, temp_c=np.full(t.size, 31.0))).calibration
    assert warm.temp_ref_c == pytest.approx(31.0)


RATE = 100.0
BIAS = dps(np.array([0.5, -0.3, 0.2]))
HARD_IRON = np.array([30.0, -20.0, 10.0])


def turntable(speed, seconds=30.0, seed=0):
    """Level on a table that turns at a constant speed in °/s: time, rates, specific force, raw field in µT."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * RATE)) / RATE
    noise = rng.standard_normal((3, t.size, 3))
    angle = dps(speed) * t
    field = np.stack((25.0 * np.cos(angle), -25.0 * np.sin(angle), np.full(t.size, 43.3)), axis=1)
    gyr = BIAS + np.outer(np.full(t.size, dps(speed)), [0.0, 0.0, 1.0]) + dps(0.1) * noise[0]
    return t, gyr, [0.0, 0.0, -G0] + 0.02 * noise[1], field + HARD_IRON + 0.5 * noise[2]


def test_a_stretch_that_turned_is_left_out():
    t, gyr, acc, mag = turntable(0.0, 60.0)
    later, turning = t >= 31.0, turntable(0.8, 60.0)  # within what passes for the bias from block to block
    gyr[later], mag[later] = turning[1][later], turning[3][later]
    gyr[(t >= 30.0) & ~later] += dps(20.0)
    found = fit_rest(Rates(t, gyr, acc=acc, mag=mag))
    assert any("in which the field turned" in str(remark) for remark in found.remarks)
    assert found.calibration.bias == pytest.approx(BIAS, abs=dps(0.02))


def test_a_field_that_rests_is_rest_and_nothing_is_left_to_say():
    t, gyr, acc, mag = turntable(0.0)
    tilted = acc.copy()
    tilted[t > 15.0] = acc[t > 15.0][:, [2, 0, 1]]
    nothing = np.full_like(mag, np.nan)
    for triads in ({"acc": acc, "mag": mag}, {"acc": tilted}):
        assert UNSEEN not in fit_rest(Rates(t, gyr, **triads)).remarks
    for triads in ({"acc": acc}, {"acc": acc, "mag": nothing}):
        assert UNSEEN in fit_rest(Rates(t, gyr, **triads)).remarks
    coarse = mag + 10.0 * np.random.default_rng(1).standard_normal(mag.shape)  # 7° in a part, at 5 sd 35°: no turn
    assert fit_rest(Rates(t, gyr, acc=acc, mag=coarse)).calibration.bias == pytest.approx(BIAS, abs=dps(0.02))


def test_a_short_rest_is_fair_at_best_and_the_preset_is_poor_for_it_was_assumed():
    t, gyr, acc, _ = turntable(0.0)
    quiet = BIAS + 0.01 * (gyr - gyr.mean(axis=0))
    short, long = (fit_rest(Rates(t[:n], quiet[:n], acc=acc[:n])) for n in (500, t.size))
    assert [fit.calibration.quality.grade for fit in (short, long)] == ["fair", "good"]
    assert any("do not show how the bias wanders" in str(remark) for remark in short.remarks)
    preset = fit_trackball(Rates(t, gyr, acc=acc, temp_c=np.full(t.size, 25.0)))
    assert preset.calibration.quality.grade == "poor"


def test_what_swings_turns_or_is_clipped_is_no_rest():
    t, gyr, _ = still(3, 20.0)
    swing = dps(50.0) * np.sin(2.0 * np.pi * t)[:, None] * np.random.default_rng(1).normal(size=(t.size, 1))
    assert reason_kinds(fit_rest, Rates(t, gyr + swing))[0] == "not-still"
    assert reason_kinds(fit_rest, Rates(t, gyr, clipped=t < 1.0))[0] == "clipping"
    for speed in (0.5, 3.0, 11.6, -36.0):
        t, gyr, acc, mag = turntable(speed)
        warm = np.full(t.size, 25.0)
        assert "turned about the vertical" in reasons(fit_rest, Rates(t, gyr, acc=acc, mag=mag))[0].text
        for fit, options in ((fit_rest, {}), (fit_trackball, {"temp_c": warm}), (fit_hand, {"acc_calibrated": True})):
            assert reason_kinds(fit, Rates(t, gyr, acc=acc, mag=mag, **options))[0] == "not-still"
            beyond = gyr + dps(60.0 - speed) * np.array([0.0, 0.0, 1.0])  # a bias of no data sheet, nothing else seen
            assert reason_kinds(fit, Rates(t, beyond, acc=acc, **options))[0] == "implausible"


@pytest.mark.parametrize(("speed", "kind"), [(1.0, None), (60.0, "implausible")])
def test_a_soak_that_turns_is_refused(speed, kind):
    n = 4000
    t = np.arange(n) / 4.0
    noise = np.random.default_rng(0).standard_normal((2, n, 3))
    gyr, temp_c = dps(np.array([0.0, 0.0, speed])) + dps(0.02) * noise[0], np.linspace(20.0, 40.0, n)
    angle = dps(speed) * t
    mag = np.stack((25.0 * np.cos(angle), -25.0 * np.sin(angle), np.full(n, 43.3)), axis=1) + 0.5 * noise[1]
    assert reason_kinds(fit_temperature, Rates(t, gyr, temp_c=temp_c, mag=mag))[0] == "not-still"
    if kind:
        assert reason_kinds(fit_temperature, Rates(t, gyr, temp_c=temp_c))[0] == kind
    else:
        assert UNSEEN in fit_temperature(Rates(t, gyr, temp_c=temp_c)).remarks


@pytest.mark.parametrize("value", [0.0, 0.01])
def test_a_dead_axis_is_named(value):
    session = hand(1)
    t, gyr, later, acc = session.t, session.gyr.copy(), session.gyr.copy(), session.acc
    gyr[:, 0] = value
    later[1000:, 1] = later[999, 1]  # dies after the rest
    temp_c = np.linspace(20.0, 40.0, t.size)
    for fit, rates, axis in (
        (fit_hand, Rates(t, gyr, acc, acc_calibrated=True), "x"),
        (fit_hand, Rates(t, later, acc, acc_calibrated=True), "y"),
        (fit_rest, Rates(t[:1000], gyr[:1000]), "x"),
        (fit_temperature, Rates(t, gyr, temp_c=temp_c), "x"),
    ):
        (reason, *_) = reasons(fit, rates)
        assert reason.kind == "implausible" and f"about {axis}" in reason.text
