"""What passes for a gyroscope at rest and is none: turning, dead axes, biases beyond any data sheet."""

import numpy as np
import pytest

from plumbob.calibration.fit import CaptureRefusedError
from plumbob.calibration.gyr.ferraris import fit_trackball
from plumbob.calibration.gyr.hand import fit_hand
from plumbob.calibration.gyr.plausible import UNSEEN, Rates
from plumbob.calibration.gyr.rest import fit_rest
from plumbob.calibration.gyr.temperature import fit_temperature
from plumbob.core.constants import G0
from plumbob.core.units import dps
from tests.helpers.gyro_sessions import hand

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


def refusal(fit, *args, **options):
    with pytest.raises(CaptureRefusedError) as refused:
        fit(Rates(*args, **options))
    return refused.value.reasons[0]


@pytest.mark.parametrize("speed", [0.5, 3.0, 11.6, -36.0])
def test_a_field_that_turns_is_no_rest(speed):
    t, gyr, acc, mag = turntable(speed)
    reason = refusal(fit_rest, t, gyr, acc=acc, mag=mag)
    assert reason.kind == "not-still" and "turned about the vertical" in reason.text
    preset = refusal(fit_trackball, t, gyr, acc=acc, mag=mag, temp_c=np.full(t.size, 25.0))
    assert preset.kind == "not-still"
    assert refusal(fit_hand, t, gyr, acc, acc_calibrated=True, mag=mag).kind == "not-still"


def test_a_field_that_rests_is_rest_and_nothing_is_left_to_say():
    t, gyr, acc, mag = turntable(0.0)
    assert UNSEEN not in fit_rest(Rates(t, gyr, acc=acc, mag=mag)).remarks
    assert UNSEEN in fit_rest(Rates(t, gyr, acc=acc)).remarks
    assert UNSEEN in fit_rest(Rates(t, gyr, acc=acc, mag=np.full_like(mag, np.nan))).remarks
    tilted = acc.copy()
    tilted[t > 15.0] = acc[t > 15.0][:, [2, 0, 1]]
    assert UNSEEN not in fit_rest(Rates(t, gyr, acc=tilted)).remarks


def test_noise_of_the_field_is_no_turn():
    t, gyr, acc, mag = turntable(0.0)
    coarse = mag + 10.0 * np.random.default_rng(1).standard_normal(mag.shape)  # 7° in a part, at 5 sd 35°
    assert fit_rest(Rates(t, gyr, acc=acc, mag=coarse)).calibration.bias == pytest.approx(BIAS, abs=dps(0.02))


def test_a_stretch_that_turned_is_left_out():
    t, gyr, acc, mag = turntable(0.0, 60.0)
    later, turning = t >= 31.0, turntable(0.8, 60.0)  # within what passes for the bias from block to block
    gyr[later], mag[later] = turning[1][later], turning[3][later]
    gyr[(t >= 30.0) & later.__invert__()] += dps(20.0)
    found = fit_rest(Rates(t, gyr, acc=acc, mag=mag))
    assert any("in which the field turned" in remark for remark in found.remarks)
    assert found.calibration.bias == pytest.approx(BIAS, abs=dps(0.02))


def test_a_bias_beyond_any_data_sheet_is_refused():
    t, gyr, acc, _ = turntable(60.0)
    warm = np.full(t.size, 25.0)
    for fit, options in ((fit_rest, {}), (fit_trackball, {"temp_c": warm})):
        assert refusal(fit, t, gyr, acc=acc, **options).kind == "implausible"
    assert refusal(fit_hand, t, gyr, acc, acc_calibrated=True).kind == "implausible"


@pytest.mark.parametrize("speed", [1.0, 60.0])
def test_a_soak_that_turns_is_refused(speed):
    n = 4000
    t = np.arange(n) / 4.0
    noise = np.random.default_rng(0).standard_normal((2, n, 3))
    gyr, temp_c = dps(np.array([0.0, 0.0, speed])) + dps(0.02) * noise[0], np.linspace(20.0, 40.0, n)
    angle = dps(speed) * t
    mag = np.stack((25.0 * np.cos(angle), -25.0 * np.sin(angle), np.full(n, 43.3)), axis=1) + 0.5 * noise[1]
    assert refusal(fit_temperature, t, gyr, temp_c=temp_c, mag=mag).kind == "not-still"
    if speed > 40.0:
        assert refusal(fit_temperature, t, gyr, temp_c=temp_c).kind == "implausible"
    else:
        assert UNSEEN in fit_temperature(Rates(t, gyr, temp_c=temp_c)).remarks


@pytest.mark.parametrize("value", [0.0, 0.01])
def test_a_dead_axis_is_named(value):
    session = hand(1)
    gyr = session.gyr.copy()
    gyr[:, 0] = value
    for reason in (
        refusal(fit_hand, session.t, gyr, session.acc, acc_calibrated=True),
        refusal(fit_rest, session.t[:1000], gyr[:1000]),
        refusal(fit_temperature, session.t, gyr, temp_c=np.linspace(20.0, 40.0, session.t.size)),
    ):
        assert reason.kind == "implausible" and "about x" in reason.text


def test_an_axis_that_dies_after_the_rest_is_named():
    session = hand(1)
    gyr = session.gyr.copy()
    gyr[1000:, 1] = gyr[999, 1]
    reason = refusal(fit_hand, session.t, gyr, session.acc, acc_calibrated=True)
    assert reason.kind == "implausible" and "about y" in reason.text


def test_a_short_rest_is_fair_at_best_and_says_so():
    t, gyr, acc, _ = turntable(0.0)
    quiet = BIAS + 0.01 * (gyr - gyr.mean(axis=0))
    assert fit_rest(Rates(t, quiet, acc=acc)).calibration.quality.grade == "good"
    short = fit_rest(Rates(t[:500], quiet[:500], acc=acc[:500]))
    assert short.calibration.quality.grade == "fair"
    assert any("do not show how the bias wanders" in remark for remark in short.remarks)


def test_the_preset_is_poor_for_it_was_assumed():
    t, gyr, acc, _ = turntable(0.0)
    found = fit_trackball(Rates(t, gyr, acc=acc, temp_c=np.full(t.size, 25.0)))
    assert found.calibration.quality.grade == "poor"
