"""A gyroscope's bias at rest, over temperature, and its drift."""

from dataclasses import replace

import numpy as np
import pytest

import plumbob
from benchmarks.harness.calibration_temperature import measure_drift
from plumbob.calibration.gyr import fit_hand, fit_temperature, fit_trackball
from plumbob.calibration.gyr.drift import accumulate, chen2013, rotation_vectors
from plumbob.calibration.gyr.rest import UNCALIBRATED, UNSEEN, Rates, fit_rest, without_known
from plumbob.calibration.gyr.temperature import fit_drift
from plumbob.core.constants import G0
from plumbob.core.errors import CalibrationError
from plumbob.core.units import dps, to_dps
from plumbob.data.calibrated import temperature_drift
from plumbob.data.cards import TriadCalibration
from plumbob.rotations import quat_angle, quat_from_rotvec, quat_multiply
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


def test_drift_of_other_triads_is_the_planted_one_and_only_of_one_pose_with_a_card():
    assert all(bar.met for bar in measure_drift(range(3)).bars)
    t, gyr, temp_c, *_ = soak(5)
    rng = np.random.default_rng(0)
    acc = np.outer(np.ones(t.size), [0.0, 0.0, G0]) + np.outer(temp_c - 25.0, [1e-3, 0.0, -2e-3])
    acc = acc + 0.01 * rng.standard_normal(acc.shape)
    imu = plumbob.ImuData(t=t, gyr=gyr, acc=acc, temp_c=temp_c, meta=plumbob.ImuMeta(device="a"))
    with pytest.raises(CalibrationError, match="calibrate it first"):
        plumbob.calibrate(imu, "temperature", triad="acc")
    known = TriadCalibration(1.01 * np.eye(3), np.full(3, 0.1), "m/s2", "m/s2", method="poses")
    card = plumbob.CalibrationCard(device="a", date="", method="", acc=known)
    made = plumbob.calibrate(imu, "temperature", triad="acc", calibration=card).card.acc
    assert (np.abs(made.bias_per_k[0] - [1e-3, 0.0, -2e-3]) < 4.0 * made.bias_per_k_sd).all()
    assert made.bias_per_k_sd.max() < 1e-4
    assert (made.bias == known.bias).all() and (made.matrix == known.matrix).all()
    turned = acc + 2.0 * np.sin(0.5 * t)[:, None]
    for changed, kind in (({"acc": turned}, "not-still"), ({"temp_c": np.full(t.size, 20.0)}, "no-temperature")):
        arguments = {"acc": acc, "temp_c": temp_c} | changed
        arguments = ("acc", t, arguments["acc"], arguments["temp_c"], known), {"acc": arguments["acc"], "gyr": gyr}
        assert reason_kinds(fit_drift, *arguments[0], **arguments[1])[0] == kind


def test_hysteresis_is_told_and_only_where_it_is():
    for seed in range(5):
        for soaked, expected in ((soak(seed, hysteresis=dps(0.02)), True), (soak(seed, walk=WALK), False)):
            remarks = fit_temperature(Rates(*soaked[:2], temp_c=soaked[2])).remarks
            assert any("hysteresis" in str(remark) for remark in remarks) is expected


def test_paper_figures_in_the_paper_units():
    """[Chen2013] (3), (5): 0.1 °/s at 26 °C, and 0.1 °/s more at 1 g; a in m/s² would give 0.98 °/s.

    As its docstring says, on a part of −0.05 °/s/K (−0.05 − 0.1) · 20 K are left.
    """
    temp_c = np.array([26.0, 25.0, 25.0, 45.0])
    acc = G0 * np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, -2.0, 0.0], [0.0, 0.0, 0.0]])
    gyr = dps(np.array([[0.0] * 3, [0.0] * 3, [0.0] * 3, [-1.0] * 3]))
    rates = Rates(np.arange(4.0), gyr, acc=acc, temp_c=temp_c, known=chen2013())
    expected = [[-0.1, -0.1, -0.1], [0.0, 0.0, -0.1], [-0.1, 0.2, 0.0], [-3.0, -3.0, -3.0]]
    assert to_dps(without_known(rates)) == pytest.approx(np.array(expected), abs=1e-15)
    for missing in ("temp_c", "acc"):
        with pytest.raises(CalibrationError, match=f"record {missing} too"):
            without_known(rates._replace(**{missing: None}))


A, B, T = 3.0, 2.0, 1.5  # turning with a about the fixed z and with b about the body's x


def precessed(n):
    t = np.linspace(0.0, T, n + 1)
    rate = np.stack((np.full_like(t, B), A * np.sin(B * t), A * np.cos(B * t)), axis=1)
    q = np.empty((n + 1, 4))
    accumulate(rotation_vectors(rate, np.diff(t)), q)
    return q[-1]


def test_a_precession_and_a_constant_rate_end_where_their_closed_forms_do():
    true = quat_multiply(quat_from_rotvec([0.0, 0.0, A * T]), quat_from_rotvec([B * T, 0.0, 0.0]))
    for n in (50, 200):
        error = float(quat_angle(true, precessed(n)))
        bound = (T / n) ** 2 / 12.0 * T * A * B**2  # of the trapezoidal rule, |ω''| = a b²
        assert 1e-3 * bound < error <= bound
    rate = np.tile([0.3, -2.0, 1.0], (40, 1))
    q = np.empty((40, 4))
    accumulate(rotation_vectors(rate, np.full(39, 0.1)), q)
    true = quat_from_rotvec(3.9 * rate[0])
    assert abs(abs(float(q[-1] @ true)) - 1.0) <= 39 * 8 * np.finfo(float).eps
