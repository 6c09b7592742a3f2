"""The whole: recording, truth and cards of one simulation fit together."""

import math
from dataclasses import replace

import numpy as np
import pytest

from plumbob import apply_card, flags
from plumbob.core.constants import G0
from plumbob.core.errors import CalibrationError
from plumbob.core.units import deg
from plumbob.data.cards import NoiseCard, TriadNoise
from plumbob.rotations import Frame, North, euler_zyx_from_quat, quat_angle, quat_rotate
from plumbob.simulation import Module, TriadErrors, draw_module, simulate
from plumbob.simulation.signals import Polynomial

PARTS = "mpu6000+hmc5983"
SHORT = {"frame": Frame.NED, "unit": "calibrated", "seed": 3, "duration": 20.0}


def run(name="rod", sensors="ideal", **changes):
    return simulate(name, sensors=sensors, **{**SHORT, **changes})


def noiseless(sensors, seed):
    """Give a drawn unit with the errors that a card can hold, and no others."""
    quiet = {name: 0.0 for name in ("white_rpsd", "white_sd", "flicker", "lsb", "latency", "scale_per_k")}
    quiet |= {"g_sensitivity": np.zeros((3, 3)), "full_scale": np.inf, "rate": None}
    unit = draw_module(sensors, seed)
    return replace(unit, **{n: replace(getattr(unit, n), **quiet) for n in ("gyr", "acc", "mag") if getattr(unit, n)})


def test_ideal_sensors_say_the_truth():
    made = run()
    body = made.kinematics
    np.testing.assert_array_equal(made.imu.gyr, body.rate_b)
    np.testing.assert_array_equal(made.imu.acc, body.specific_force_b)
    np.testing.assert_array_equal(made.truth.q_nb, body.q_nb)
    np.testing.assert_array_equal(made.truth.t, made.imu.t)
    assert not made.imu.flags.any() and not made.truth.bias_b.any()


@pytest.mark.parametrize("frame", list(Frame))
def test_gravity_and_field_are_where_they_belong(frame):
    made = run("static", frame=frame, heading=0.8, pitch=0.3, roll=-0.5, strength=48.0, dip=1.1, declination=0.1)
    up = quat_rotate(made.truth.q_nb, made.imu.acc)
    field = quat_rotate(made.truth.q_nb, made.imu.mag)
    np.testing.assert_allclose(up, np.tile(G0 * frame.up, (len(made.imu), 1)), atol=1e-13)
    np.testing.assert_allclose(field @ frame.up, -48.0 * math.sin(1.1), atol=1e-12)
    np.testing.assert_allclose(field @ frame.north, 48.0 * math.cos(1.1) * math.cos(0.1), atol=1e-12)
    np.testing.assert_allclose(field @ frame.east, 48.0 * math.cos(1.1) * math.sin(0.1), atol=1e-12)


def test_truth_counts_from_true_north_and_the_magnetometer_from_magnetic():
    made = run("static", heading=0.8, declination=0.15)
    assert made.truth.north is North.TRUE
    np.testing.assert_allclose(euler_zyx_from_quat(made.truth.q_nb)[:, 0], 0.8, atol=1e-14)
    compass = np.arctan2(-made.imu.mag[:, 1], made.imu.mag[:, 0])  # level, forward-right-down
    np.testing.assert_allclose(compass, 0.8 - 0.15, atol=1e-14)  # magnetic North lies 0.15 east of true


@pytest.mark.parametrize("sensors", [PARTS, "adxrs290+adxrs453", "adis16355", "adis16355:allan", "mpu3050"])
def test_the_card_undoes_the_planted_errors(sensors):
    unit = noiseless(sensors, 7)
    warming = Polynomial((25.0, 1.0))
    made = run("rod", unit, unit="random", temp_c=warming)
    corrected = apply_card(made.calibration, made.imu)
    exact = run("rod", temp_c=warming).imu
    for triad in made.imu.triads:
        off = np.abs(getattr(made.imu, triad) - getattr(exact, triad)).max()
        left = np.abs(getattr(corrected, triad) - getattr(exact, triad)).max()
        assert left < 1e-9
        assert off > 1e-3  # there was something to undo


def test_a_calibrated_unit_says_so_and_its_card_changes_nothing():
    made = run(sensors=PARTS)
    assert made.imu.meta.calibration
    for triad in (made.calibration.gyr, made.calibration.acc, made.calibration.mag):
        np.testing.assert_array_equal(triad.matrix, np.eye(3))
        assert not triad.bias.any()
    with pytest.raises(CalibrationError, match="already"):
        apply_card(made.calibration, made.imu)
    assert run(sensors=PARTS, unit="random").imu.meta.calibration is None


def test_a_seed_is_repeatable_another_is_another_and_a_longer_recording_begins_like_a_shorter_one():
    first, again, other = (run(sensors=PARTS, unit="random", seed=s) for s in (5, 5, 6))
    for triad in ("gyr", "acc", "mag"):
        np.testing.assert_array_equal(getattr(first.imu, triad), getattr(again.imu, triad))
        assert np.nanmax(np.abs(getattr(first.imu, triad) - getattr(other.imu, triad))) > 1e-3
    np.testing.assert_array_equal(first.truth.q_nb, again.truth.q_nb)
    short, long = run("buoy", PARTS), run("buoy", PARTS, duration=60.0)
    step = short.module.gyr.lsb[0]
    # the flicker's Fourier transforms round differently, which may move a value by one count, rarely
    difference = np.abs(long.imu.gyr[: len(short.imu)] - short.imu.gyr)
    assert difference.max() <= step * 1.001 and np.mean(difference > 0.0) < 1e-3
    np.testing.assert_array_equal(long.truth.q_nb[: len(short.imu)], short.truth.q_nb)


def test_noise_does_not_depend_on_the_choice_of_module_or_on_losses():
    drawn, calibrated = run("static", PARTS, unit="random"), run("static", PARTS)
    step = calibrated.module.gyr.lsb[0]
    # static: what remains besides a constant is the same noise, but for two quantisations of half a step each
    residual = drawn.imu.gyr - calibrated.imu.gyr
    assert np.ptp(residual, axis=0).max() <= 2.0 * step * 1.001
    lossy = run("static", PARTS, lost=0.2)
    kept = np.isin(calibrated.imu.t, lossy.imu.t)
    np.testing.assert_array_equal(calibrated.imu.gyr[kept], lossy.imu.gyr)


def test_static_noise_is_what_the_card_says_the_true_bias_is_told_and_gravity_shifts_a_gyroscope():
    made = run("static", "mpu6000", duration=100.0)
    count = len(made.imu)
    for triad in ("gyr", "acc"):
        found = getattr(made.imu, triad).std(axis=0)
        card, lsb = getattr(made.noise, triad), getattr(made.module, triad).lsb
        white = card.n_rpsd * math.sqrt(100.0)
        # N √rate and LSB/√12 together; flicker adds 4.3 °/h, a hundredth of the scatter, squared
        expected = np.hypot(white, lsb / math.sqrt(12.0))
        np.testing.assert_allclose(found, expected, rtol=4.0 / math.sqrt(2.0 * count) + 1e-3)
    unit = Module("unit", "test", gyr=TriadErrors(bias=(0.1, -0.2, 0.3), flicker=0.01, walk_rpsd=0.01, ramp=1e-3))
    made = run("rod", unit, unit="random")
    np.testing.assert_allclose(made.imu.gyr - made.kinematics.rate_b, made.truth.bias_b, atol=1e-14)
    np.testing.assert_allclose(made.truth.bias_b[0], [0.1, -0.2, 0.3], atol=0.05)  # five times the first flicker
    s = np.arange(9.0).reshape(3, 3) * 1e-4
    made = run("static", Module("unit", "test", gyr=TriadErrors(g_sensitivity=s)), unit="random")
    np.testing.assert_allclose(made.imu.gyr, np.tile(s @ [0.0, 0.0, -G0], (len(made.imu), 1)), atol=1e-15)  # level, NED


def test_the_magnetometer_has_its_own_rate_and_each_gyroscope_its_own_range():
    made = run(sensors=PARTS)
    rows = np.isfinite(made.imu.mag).all(axis=1)
    assert rows.sum() == 75 * 20  # its 75 Hz for 20 s
    assert np.isnan(made.imu.mag[~rows]).all()
    np.testing.assert_array_equal((made.imu.flags & flags.MAG_ABSENT) != 0, ~rows)
    assert np.isfinite(run(sensors=PARTS, mag_rate=220.0).imu.mag).all()
    assert np.isfinite(run(sensors=PARTS, mag_rate=10.0).imu.mag).all(axis=1).sum() == 200
    made = run("fin", "adxrs290+adxrs453", frequency=1.0, duration=10.0)
    ends = np.array([100.0, 100.0, 300.0]) * math.pi / 180.0
    assert made.imu.meta.gyr_range == pytest.approx(tuple(ends))
    beyond = np.abs(made.kinematics.rate_b) > ends + 0.01  # by far more than the noise
    flagged = (made.imu.flags & flags.GYR_CLIPPED) != 0
    assert beyond[:, 0].any() and beyond[:, 1].any()
    assert flagged[beyond.any(axis=1)].all()
    assert not flagged[(np.abs(made.kinematics.rate_b) < ends - 0.01).all(axis=1)].any()
    np.testing.assert_array_equal(np.abs(made.imu.gyr).max(axis=0)[:2], ends[:2])


def test_lost_samples_leave_uneven_steps_and_jitter_moves_the_stamps_alone():
    made = run(lost=0.1)
    steps = np.diff(made.imu.t)
    assert len(made.imu) < 2000
    assert steps.min() == pytest.approx(0.01, abs=1e-9)
    assert steps.max() > 0.0199
    np.testing.assert_array_equal(made.truth.t, made.imu.t)
    np.testing.assert_array_equal(made.imu.gyr, made.kinematics.rate_b)
    plain, jittered = run(), run(jitter=1e-3)
    np.testing.assert_array_equal(plain.imu.gyr, jittered.imu.gyr)
    assert 5e-4 < np.std(jittered.imu.t - plain.imu.t) < 2e-3
    # truth is that of the stamps: between neighbours of the plain record, up to how far one stamp strays
    apart = quat_angle(plain.truth.q_nb, jittered.truth.q_nb)
    speed = np.linalg.norm(plain.kinematics.rate_b, axis=1).max()
    assert 0.0 < apart.max() <= 1.05 * speed * np.abs(jittered.imu.t - plain.imu.t).max()


def test_latency_shows_older_values():
    open_ = TriadErrors(latency=(0.0, 0.02, 0.05), full_scale=(90.0, 90.0, np.inf))
    late = Module("late", "test", gyr=open_, acc=TriadErrors(latency=0.02))
    plain, delayed = run("coning"), run("coning", late, unit="random")
    assert delayed.imu.meta.gyr_range is None  # an axis without an end has none
    # 2 and 5 samples of 10 ms
    np.testing.assert_allclose(delayed.imu.gyr[5:, 0], plain.imu.gyr[5:, 0], atol=1e-12)
    np.testing.assert_allclose(delayed.imu.gyr[5:, 1], plain.imu.gyr[3:-2, 1], atol=1e-7)  # times round to 1 ns
    np.testing.assert_allclose(delayed.imu.gyr[5:, 2], plain.imu.gyr[:-5, 2], atol=1e-7)
    np.testing.assert_allclose(delayed.imu.acc[5:], plain.imu.acc[3:-2], atol=1e-7)


def test_meta_says_what_was_made_and_gyroscopes_alone_make_a_recording():
    made = run(sensors=PARTS, rate=50.0)
    assert made.imu.meta.rate_nominal == 50.0
    assert made.imu.meta.frame is Frame.NED and made.imu.meta.north is North.TRUE
    assert made.imu.meta.device == made.calibration.device == made.noise.device
    assert (made.imu.meta.acc_range, made.imu.meta.mag_range) == (pytest.approx(4.0 * G0), pytest.approx(130.0))
    assert len(made.imu) == 1000
    assert "rod (roll_limit=20 deg" in made.truth.source and "hmc5983 mag.hard_iron" in made.noise.source
    made = simulate("turntable", frame=Frame.ENU, sensors="mpu3050", unit="random", seed=1)
    assert made.imu.triads == ("gyr",)
    assert made.calibration.acc is None
    assert len(made.imu) == 2000  # gyroscope paper: 1000 + 1000 points


CARD = NoiseCard("unit 7", "Allan analysis", gyr=TriadNoise(n_rpsd=[1e-3, 2e-3, 4e-3], b=[0.0] * 3, k_rpsd=[0.0] * 3))
DRIFTS = TriadNoise(n_rpsd=[0.0] * 3, b=[1e-3, 2e-3, 4e-3], k_rpsd=[2e-3, 4e-3, 8e-3])


def test_a_noise_card_replaces_the_noise_of_the_triads_that_it_has():
    plain, made = (run("static", sensors="mpu6000", noise=card) for card in (None, CARD))
    np.testing.assert_array_equal(made.noise.gyr.n_rpsd, CARD.gyr.n_rpsd)
    np.testing.assert_array_equal(made.noise.gyr.b, 0.0)
    drifting = run("static", noise=NoiseCard("unit 7", "told", gyr=DRIFTS)).module.gyr
    assert (*drifting.flicker, *drifting.walk_rpsd) == (*DRIFTS.b, *DRIFTS.k_rpsd)
    np.testing.assert_array_equal(made.noise.acc.n_rpsd, plain.noise.acc.n_rpsd)
    np.testing.assert_array_equal(made.imu.acc, plain.imu.acc)
    assert "noise of gyr from the card of unit 7 (Allan analysis)" in made.noise.source
    count, rate = len(made.imu), made.imu.meta.rate_nominal
    np.testing.assert_allclose(  # white noise scatters by N √rate; 4 standard deviations of a scatter are allowed
        made.imu.gyr.std(axis=0), CARD.gyr.n_rpsd * math.sqrt(rate), rtol=4.0 / math.sqrt(2.0 * count)
    )


@pytest.mark.parametrize("asked", ["15 K, 120 s", "15 degC, 2 min", "15,120", (15.0, 120.0), ("15 K", 120)])
def test_a_unit_warms_up_exponentially(asked):
    made = run("static", temp_c="20 degC", warm_up=asked)
    np.testing.assert_allclose(made.imu.temp_c, 20.0 + 15.0 * (1.0 - np.exp(-made.imu.t / 120.0)), atol=1e-12)
    falling = run("static", temp_c=Polynomial((25.0, -0.1)), warm_up=asked)  # added to any other course
    np.testing.assert_allclose(falling.imu.temp_c, made.imu.temp_c + 5.0 - 0.1 * made.imu.t, atol=1e-12)


def test_a_reference_says_angles_of_its_own():
    made, other = run("rod", "ahrs500ga"), run("rod", "mpu6000")
    off = made.angles - euler_zyx_from_quat(made.truth.q_nb)
    assert 0.0 < np.abs(off[:, 0]).max() < 6.0 * deg(0.2)
    assert 0.0 < np.abs(off[:, 1:]).max() < 6.0 * deg(0.03)
    assert other.angles is None
    np.testing.assert_array_equal(run("rod", "ahrs500ga", lost=0.3).angles[0], made.angles[0])
    assert len(run("rod", "ahrs500ga", lost=0.3).angles) < len(made.angles)
