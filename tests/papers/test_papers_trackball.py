"""The trackball paper's tests: records are what they should be, figures keep their bars, and the text says so."""

import json
import math

import numpy as np
import pytest

from benchmarks.harness.__main__ import main
from benchmarks.harness.bar import Bar
from benchmarks.harness.channel import PARTS, measure_channel
from benchmarks.harness.channel_records import (
    FLICKER,
    RATIOS,
    STEP,
    WHITE,
    at_rest,
    average_like,
    contenders,
    on_turntable,
    scalar_filter,
)
from benchmarks.harness.channel_static import LONG_TAUS, TAUS, WALK, degrees_of_freedom, measure_static
from benchmarks.harness.channel_turntable import SLOPE, SPIN_UP
from plumbob.core.errors import ParameterError
from plumbob.core.units import deg, dps
from plumbob.filters.channel_scalar import ramp_lag, steady_gain
from plumbob.noise import deviation
from tests.battery.commandline import call

SEEDS = range(6)


@pytest.fixture(scope="module")
def result():
    return measure_channel(SEEDS)


@pytest.fixture(scope="module")
def exact(result):
    return {row["name"]: row for row in result.as_dict()["turntable"][0]["filters"]}


@pytest.fixture(scope="module")
def wrong_gain(result):
    return {row["name"]: row for row in result.as_dict()["turntable"][1]["filters"]}


def test_the_turntable_is_the_paper_s():
    """0 to 10 r/min in 100 s, 1000 samples, then 1000 at 60 °/s; an axis in the plane of the table measures nothing."""
    run = on_turntable(0, scale=0.0, bias=0.0)
    assert run.t.size == 2000
    assert np.diff(run.t) == pytest.approx(STEP)
    assert run.true[:, 2] == pytest.approx(np.minimum(deg(0.6) * run.t, dps(60.0)), abs=1e-12)
    assert np.abs(run.true[:, :2]).max() < 1e-12
    noise = (run.measured - run.true).std()
    assert noise == pytest.approx(WHITE, rel=0.05)  # flicker adds 2 %, and 6000 samples scatter by 1 %


def test_every_bar_is_kept(result):
    """But for the Allan deviation at 50 s, a single difference per record, for which six seeds are too few."""
    missed = {bar.name for bar in result.bars() if not bar.met}
    assert missed <= {"Q/R=0.001: Allan deviation ratio at 50 s"}
    assert len(result.bars()) == 8


def test_the_allan_deviation_at_50_s_stays():
    """180 single differences before and after. They differ by the filter's memory of one end, 3 s of 50, at most."""
    before, after = [], []
    for seed in range(60):
        rest = at_rest(seed, 100.0)
        before.append(deviation(rest.measured, [500]) ** 2)
        after.append(deviation(scalar_filter(1e-3).smooth(rest.t, rest.measured), [500]) ** 2)
    assert math.sqrt(np.mean(after) / np.mean(before)) == pytest.approx(1.0, abs=0.1)


def test_a_bar_is_missed_on_either_side():
    assert Bar("", 1.0, 1.0, 2.0).met
    assert not Bar("", 0.99, 1.0, 2.0).met
    assert not Bar("", 2.01, 1.0, 2.0).met
    assert not Bar("", math.nan, 1.0, 2.0).met


def test_white_noise_falls_as_theory_says(result):
    """Six seeds of three channels of 1e5 samples hold 6·3·1e5·K/2 independent values: 900 for the slowest, 4.7 %."""
    for one, ratio in zip(result.static.filters, RATIOS, strict=True):
        values = 0.5 * one.gain * len(SEEDS) * 3 * 95_000
        k = steady_gain(ratio)
        assert one.theory == k / (2.0 - k)  # Σ K² (1 − K)²ⁱ
        assert one.white == pytest.approx(one.theory, rel=4.0 * math.sqrt(2.0 / values))


def test_allan_deviation_falls_at_short_times_only(result):
    """Beyond the filter's memory Δt/K the ratio returns to 1; at its start it is that of the differences of the filter.

    For white noise the settled filter gives E[(x̂₂ − x̂₁)²] = 2 v (1 − (1 − K)) = 2 v K, v = K/(2 − K): a ratio of
    √(K v) at one sample; in the paper's record, its start adds to it.
    """
    for one in result.static.filters[:3]:
        white = math.sqrt(one.gain * one.theory)
        assert one.adev[0] > 0.95 * white
        assert list(one.adev[1:6]) == sorted(one.adev[1:6])
        assert one.adev_long[0] == pytest.approx(white, rel=0.05)
        assert one.adev_long[LONG_TAUS.index(600.0)] == pytest.approx(1.0, abs=0.01)
        assert one.adev_long[LONG_TAUS.index(100.0)] == pytest.approx(1.0, abs=0.02)
    assert result.static.filters[2].adev[TAUS.index(1.0)] < 0.2


def test_four_hours_hold_what_was_planted(result):
    """σ² = N²/τ + (0.6643 B)² + K² τ/3 at 600 s, from 18 records of some 25 degrees of freedom: 3.3 %, and 4 of it."""
    n, b, k = WHITE * math.sqrt(STEP), 0.6643 * FLICKER, WALK
    planted = math.sqrt(n**2 / 600.0 + b**2 + k**2 * 600.0 / 3.0)
    assert result.static.adev_long_before[LONG_TAUS.index(600.0)] == pytest.approx(planted, rel=0.13)


def test_the_angle_keeps_its_error(result):
    """A settled filter holds back Σ (y − x̂) = (1 − K)/K (x̂_end − x̂_start) and no more, however long the record is.

    For Q/R = 0.001 that is 31 samples of 0.013 °/s · √2, or 0.06°, against angles of √500 · 0.1 °/s · 0.1 s = 0.2° from
    white noise and more from flicker. Added as squares it is below 5 %.
    """
    for one in result.static.filters[:3]:
        assert one.angle == pytest.approx(1.0, abs=0.05)


def test_lags_are_those_of_theory(exact):
    """Over 400 samples the mean of y − x̂ scatters by √2 (1 − K)/K sd(x̂) / 400, 0.3 % of the lag; the bar is 5 %."""
    for ratio in RATIOS[:4]:
        k = steady_gain(ratio)
        row = exact[f"scalar Q/R={ratio:g}"]
        assert row["lag_theory_dps"] == pytest.approx(0.6 * STEP * (1.0 - k) / k)
        assert row["lag_dps"] == pytest.approx(row["lag_theory_dps"], rel=0.05)
        assert scalar_filter(ratio).lag == pytest.approx(ramp_lag(k, SLOPE, STEP) / (SLOPE * STEP))
        average = exact[average_like(ratio).name]
        assert average["lag_dps"] == pytest.approx(average["lag_theory_dps"], rel=0.05)
    assert abs(exact["two states"]["lag_dps"]) < 0.01


def test_what_helps_on_the_ramp_is_the_bias_and_not_the_filter(exact):
    """1.5 °/s of bias go; then no scalar filter or average beats the unfiltered rate, but the one with two states."""
    assert exact["measured"]["ramp_rms_dps"] == pytest.approx(1.5, abs=0.05)
    removed = exact["bias removed"]["ramp_rms_dps"]
    assert removed == pytest.approx(0.1, rel=0.1)
    names = [c.name for c in contenders()]
    assert len(names) == 11
    assert all(exact[name]["ramp_rms_dps"] > removed for name in names[:-1])
    assert exact["two states"]["ramp_rms_dps"] < 0.5 * removed
    assert exact["scalar Q/R=0.01"]["angle_deg"] == pytest.approx(0.5707 * 100.0, rel=0.05)  # lag over the ramp
    assert exact["two states"]["angle_deg"] < 1.1 * exact["bias removed"]["angle_deg"]


def test_a_gain_error_stays_and_a_lag_can_hide_it(wrong_gain):
    """1 % of 60 °/s is 0.6 °/s at constant rate, for everyone who has arrived there."""
    for name in ("bias removed", "scalar Q/R=0.01", "two states"):
        assert wrong_gain[name]["hold_mean_dps"] == pytest.approx(0.6, abs=0.02)
    assert wrong_gain["scalar Q/R=0.01"]["ramp_rms_dps"] < wrong_gain["bias removed"]["ramp_rms_dps"]


def test_degrees_of_freedom_stand_beside_the_allan_deviations(result):
    static = result.as_dict()["static"]
    assert static["taus_s"] == [0.1, 0.2, 0.4, 1.0, 2.0, 4.0, 10.0, 50.0]  # [Chen2013]
    assert static["degrees_of_freedom"][-1] == 1.0  # one difference in a record of twice its length
    assert degrees_of_freedom(SPIN_UP, 10.0) == pytest.approx(12.8, abs=0.1)  # scatter 0.29, as 400 simulations show
    assert len(static["long_degrees_of_freedom"]) == len(LONG_TAUS)


def test_the_text_says_what_the_figures_are(result):
    text = result.text()
    assert text.count("\n2  Turntable") == 2
    assert "MISSED" not in text
    for word in ("scalar Q/R=0.001", "average of 63", "two states", "Bias instability stays", "The integrated angle"):
        assert word in text
    missed = Bar("made up", 3.0, 1.0, 2.0)
    assert not missed.met


def test_same_seeds_same_figures_and_progress_is_told():
    told = []
    first = measure_static([3], told.append)
    assert told == [1]
    assert first == measure_static([3])
    assert PARTS == 3


def run(*words):
    return call("channel", *words, main=main)


def test_command_line():
    done = run("--seeds", "1", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert set(found) == {"seeds", "noise", "static", "turntable", "bars"}
    assert found["noise"] == {
        "white_dps": pytest.approx(0.1),
        "flicker_deg_per_h": pytest.approx(36.0),
        "walk_dps_per_rts": pytest.approx(5e-4),
        "bias_dps": pytest.approx(1.5),
        "step_s": 0.1,
    }
    assert [one["q_over_r"] for one in found["static"]["filters"]] == list(RATIOS)
    assert set(found["bars"][0]) == {"name", "value", "low", "high", "met"}
    assert [one["scale_error"] for one in found["turntable"]] == [0.0, 0.01]
    refused = run("--seeds", "0")
    assert (refused.returncode, refused.stdout) == (1, "")
    assert "--seeds must be at least 1, but it is 0." in refused.stderr


def test_a_gain_that_is_none_has_no_theory():
    with pytest.raises(ParameterError):
        scalar_filter(0.0)
