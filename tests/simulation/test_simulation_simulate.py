"""The whole: recording, truth and cards of one simulation fit together."""

import math
from dataclasses import replace

import numpy as np
import pytest

from plumbob import apply_card, flags, simulate_chain
from plumbob.core.constants import G0
from plumbob.core.errors import CalibrationError, FrameError, ParameterError, PlumbobError, ShapeError
from plumbob.core.units import UNITS, deg, unit
from plumbob.data.cards import NoiseCard, TriadNoise
from plumbob.data.chain import Chain, Segment
from plumbob.rotations import Frame, North, euler_zyx_from_quat, quat_angle, quat_rotate
from plumbob.simulation import (
    CHAINS,
    Dipole,
    Module,
    PoseMotion,
    SoftTissue,
    TriadErrors,
    draw_module,
    earth_field,
    preset,
    preset_names,
    scenario,
    simulate,
    waypoints,
)
from plumbob.simulation.errors import AttitudeErrors, measure
from plumbob.simulation.presets import ANGLES, FIGURES, MARKS, DataSheetFigure
from plumbob.simulation.signals import Moves, Polynomial

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


TRIAD = TriadNoise(n_rpsd=[1e-3] * 3, b=[0.0] * 3, k_rpsd=[0.0] * 3)
NOISE = NoiseCard("unit 7", "Allan analysis", gyr=TRIAD)
WHOLE = {"frame": Frame.NED, "sensors": "ideal", "unit": "calibrated", "seed": 3}
LEVEL = [1.0, 0.0, 0.0, 0.0]
TWO_POSES = np.deg2rad([[0] * 6, [0, 120, 0, 0, 0, 0]])


def rod(name="rod", **changes):
    return simulate(name, **{**WHOLE, "duration": 20.0, **changes})


def chained(**changes):
    given = {"chain": "arm", "program": "slow", "frame": "NED", "unit": "calibrated", "seed": 1, "duration": 2.0}
    return simulate_chain(**(given | changes))


def without(left_out):
    return simulate("static", **{name: value for name, value in WHOLE.items() if name != left_out})


def field(**changes):
    return earth_field(Frame.NED, **({"strength": 50.0, "dip": 1.0, "declination": 0.0} | changes))


def angles(**changes):
    return AttitudeErrors(**({"heading": 0.1, "tilt": 0.1} | changes))


def poses(attitudes, dwell):
    return PoseMotion(Frame.NED, attitudes, dwell, 1.0)


def taught(attitudes):
    return waypoints(CHAINS["teach"], attitudes)


def moves(start, duration):
    return Moves(start, duration, (1.0,) * len(start))


def another_card(**changes):
    return apply_card(rod(sensors=PARTS, unit="random", seed=4).calibration, rod(sensors=PARTS, **changes).imu)


CASES = [
    # a recording of one unit
    (rod, {"frame": "north"}, FrameError, "ENU"),
    (rod, {"unit": "perfect"}, ParameterError, "random, calibrated"),
    (rod, {"sensors": "abc"}, ParameterError, "known:"),
    (rod, {"name": "abc"}, ParameterError, "known:"),
    (rod, {"frequncy": 1.0}, ParameterError, "no parameter 'frequncy'"),
    (rod, {"rate": -1.0}, ParameterError, "rate"),
    (rod, {"seed": -1}, ParameterError, "seed must be"),
    (rod, {"seed": 1.5}, ParameterError, "seed must be"),
    (rod, {"duration": 0.0}, ParameterError, "rate × duration"),
    (rod, {"lost": 1.0}, ParameterError, "lost"),
    (rod, {"dip": 2.0}, ParameterError, "dip"),
    (rod, {"sensors": PARTS, "mag_rate": -3.0}, ParameterError, "rate must be positive"),
    (rod, {"sensors": "mpu3050", "temp_c": -300.0}, ParameterError, r"-273\.15 °C, absolute zero"),
    (rod, {"sensors": "mpu3050", "temp_c": "-1 K"}, ParameterError, r"-273\.15 °C, absolute zero"),
    (rod, {"warm_up": "15 K"}, PlumbobError, "RISE, TIME, as '15 K, 120 s', but it is '15 K'"),
    (rod, {"warm_up": "15 m, 120 s"}, PlumbobError, "unit of temperature"),
    (rod, {"warm_up": "15 K, 120 m"}, PlumbobError, "unit of time"),
    (rod, {"warm_up": "15 K, 0 s"}, PlumbobError, "the time of warm_up must be above 0"),
    (rod, {"warm_up": (math.nan, 1.0)}, PlumbobError, "the rise of warm_up must be"),
    (rod, {"sensors": "mpu6000", "noise": replace(NOISE, mag=TRIAD)}, ParameterError, "gyr, mag, but mpu6000 has gyr"),
    (rod, {"noise": NoiseCard("unit 7", "empty")}, ParameterError, "has no triad"),
    (rod, {"name": scenario("coning"), "frequency": 2.0}, ParameterError, "given as an object"),
    *((without, {"left_out": name}, TypeError, name) for name in ("frame", "unit") if name in WHOLE),
    (another_card, {"unit": "random"}, CalibrationError, "device"),
    # a chain
    (chained, {"chain": "tail"}, ParameterError, "no chain"),
    (chained, {"program": "dance"}, ParameterError, "no program of a chain"),
    (chained, {"frame": "XYZ"}, FrameError, "XYZ"),
    (chained, {"jitter": 1e-4}, ParameterError, "one time line"),
    (chained, {"disturbances": [Dipole((0, 0, 0), (0, 0, 1), on="nose")]}, ParameterError, "'nose' is not a segment"),
    (chained, {"mounts": {}, "mount_angle": 0.1}, ParameterError, "either mounts"),
    (chained, {"mounts": {"foot": CHAINS["arm"].segments[-1].mount}}, ParameterError, "no unit 'foot'"),
    (chained, {"mount_angle": -0.1}, ParameterError, "mounting error"),
    (chained, {"sensors": {}}, ParameterError, "'upperarm' has none"),
    (chained, {"soft": "maybe"}, ParameterError, "yes or no"),
    (chained, {"bend": "20 uT", "bend_at": "base"}, ParameterError, "not at 'base'"),
    (chained, {"strenght": 3.0}, ParameterError, "no setting 'strenght'"),
    (chained, {"chain": "five", "base": (1, 0, 0, 0)}, ParameterError, "leave base out"),
    (chained, {"duration": -1.0}, ParameterError, "duration"),
    (chained, {"chain": Chain("bare", (Segment("a"),))}, ParameterError, "has a unit"),
    (SoftTissue, {"damping": 1.0}, ParameterError, "damping"),
    (taught, {"attitudes": TWO_POSES}, ParameterError, r"pose 1 takes j2 to 120\.0°, beyond its limits"),
    (taught, {"attitudes": np.zeros((1, 6))}, ParameterError, "at least two poses"),
    (taught, {"attitudes": np.zeros((2, 5))}, ShapeError, "poses"),
    # scenarios and what they are made of
    (scenario, {"name": "sailing"}, ParameterError, "known: static, turntable, ball"),
    (scenario, {"name": "slide", "speed": 1.0}, ParameterError, "no parameter 'speed'; known: peak_speed, stroke"),
    (scenario, {"name": "slide", "stroke": 0.0}, ParameterError, "stroke must be 0.05 to 60 s"),
    (scenario, {"name": "slide", "strokes": 2.5}, ParameterError, "whole number"),
    (scenario, {"name": "turntable", "peak_rate": "90"}, ParameterError, "needs a unit"),
    (scenario, {"name": "buoy", "peakedness": math.nan}, ParameterError, "peakedness must be"),
    (scenario, {"name": "buoy", "height": True}, ParameterError, "height must be"),
    (scenario, {"name": "rod", "fastest": 3.0, "slowest": 2.0}, ParameterError, "fastest must not exceed slowest"),
    (scenario, {"name": "rod", "vibration_low": 30.0}, ParameterError, "vibration_low must not exceed"),
    (scenario, {"name": "coning", "half_angle": 3.2}, ParameterError, "half_angle must be"),
    (poses, {"attitudes": np.empty((0, 4)), "dwell": 1.0}, ShapeError, "at least one pose"),
    (poses, {"attitudes": [LEVEL], "dwell": 0.0}, ParameterError, "must be positive"),
    (moves, {"start": (0.0, 1.0), "duration": (1.5, 1.0)}, ParameterError, "overlap"),
    (moves, {"start": (0.0,), "duration": (0.0,)}, ParameterError, "positive duration"),
    (field, {"strength": 0.0}, ParameterError, "field"),
    (field, {"strength": math.nan}, ParameterError, "field"),
    (field, {"dip": 1.6}, ParameterError, "field"),
    (field, {"declination": 4.0}, ParameterError, "field"),
    # sensors
    (draw_module, {"sensors": "mpu9999", "seed": 1}, ParameterError, "known: .*adxrs290.*mpu6000"),
    (draw_module, {"sensors": "adis16355:other", "seed": 1}, ParameterError, "no sensor"),
    (draw_module, {"sensors": "", "seed": 1}, ParameterError, "no sensor"),
    (draw_module, {"sensors": "adxrs290", "seed": 1}, ParameterError, "add a part with z"),
    (draw_module, {"sensors": "adxrs453", "seed": 1}, ParameterError, "add a part with xy"),
    (draw_module, {"sensors": "mpu6000+mpu3050", "seed": 1}, ParameterError, "both have gyr axis"),
    (draw_module, {"sensors": "ahrs500ga+dcm260b", "seed": 1}, ParameterError, "both have acc axis"),
    (TriadErrors, {"white_rpsd": -0.1}, ParameterError, "not below 0"),
    (TriadErrors, {"bias": np.nan}, ParameterError, "finite"),
    (TriadErrors, {"lsb": np.inf}, ParameterError, "finite"),
    (TriadErrors, {"full_scale": -1.0}, ParameterError, "not below 0"),
    (TriadErrors, {"bias": (1.0, 2.0)}, ParameterError, "shape"),
    (TriadErrors, {"misalignment": 0.1}, ParameterError, "shape"),
    (TriadErrors, {"misalignment": np.eye(3)}, ParameterError, "zero diagonal"),
    (TriadErrors, {"rate": 0.0}, ParameterError, "positive"),
    (TriadErrors, {"high_pass": 0.0}, ParameterError, "high_pass must be positive and finite, but it is 0 Hz"),
    (angles, {"heading": -1.0}, ParameterError, "must be 0 rad or more"),
    (angles, {"tilt": math.inf}, ParameterError, "must be 0 rad or more"),
    (angles, {"time": 0.0}, ParameterError, "must be 0 rad or more"),
]


@pytest.mark.parametrize(("make", "given", "error", "match"), CASES)
def test_what_cannot_be_is_refused(make, given, error, match):
    with pytest.raises(error, match=match):
        make(**given)


DEG = math.pi / 180.0


def si(name, triad, figure):
    return preset(name).triads[triad].figures[figure].si


@pytest.fixture(scope="module")
def drawn():
    return [draw_module("mpu6000+hmc5983", seed) for seed in range(300)]


@pytest.mark.parametrize("name", preset_names())
def test_every_figure_has_value_unit_source_and_mark(name):
    for figure, entry in (item for sheet in preset(name).triads.values() for item in sheet.figures.items()):
        assert figure in FIGURES
        assert entry.mark in MARKS
        assert preset(name).sources[entry.source].strip()
        assert (entry.si > 0.0).all() and np.isfinite(entry.si).all()
        numerator, *denominators = entry.unit.split(" per ")
        assert unit(numerator) in UNITS.values()
        assert all(d in {"rtHz", "rth"} or unit(d) in UNITS.values() for d in denominators)
        # a figure that nobody has read somewhere says so
        assert (entry.mark == "UNVERIFIED") == (entry.source in {"MEMORY", "BUOY", "ASSUMED", "DS-5883"})


@pytest.mark.parametrize(("name", "triad", "figure", "expected", "mark"), [
    # public projects that quote the data sheets, each in their own unit
    ("bmi088", "acc", "noise_density", (160e-6 * G0, 160e-6 * G0, 190e-6 * G0), "V1"),
    ("lis3mdl", "mag", "noise_sample", (0.32, 0.32, 0.41), "V1"),
    ("adis16470", "gyr", "bias_instability", 8 * DEG / 3600, "V1"),
    # survey of sensor noise, section 12, each in the survey's own unit
    ("adxrs290", "gyr", "scale_tolerance", 0.12, "UNVERIFIED"),
    ("adxrs453", "gyr", "g_sensitivity", 0.01 * DEG / G0, "V"),
    ("adxrs453", "gyr", "vibration_rectification", 0.0002 * DEG / G0**2, "V"),
    ("mpu6000", "gyr", "counts", 131.0 / DEG, "V"),
    ("mpu6000", "acc", "null_offset", np.array([0.05, 0.05, 0.08]) * G0, "V"),
    ("mpu6000", "acc", "scale_tempco", 2e-4, "V"),
    ("adis16355", "gyr", "bias_tempco", 0.01 * DEG, "V"),
    ("adis16355", "acc", "lsb", 2.522e-3 * G0, "V"),
    ("adis16355:allan", "gyr", "noise_density", 0.07 * DEG, "V"),  # 4.2 °/√h, "= 0.07" in the survey
    ("hmc5983", "mag", "noise_sample", 0.2, "V"),  # 2 mGa, 1 Ga = 100 µT
    ("hmc5983", "mag", "hard_iron", 8.0, "UNVERIFIED"),
    # page of the teaching-arm paper, noise that reproduces its tables: ±0.13 °/s at rest, ±0.25 °/s in the turn
    ("arm:rest", "gyr", "null_offset", 0.13 * DEG, "UNVERIFIED"),
    ("arm:turn", "gyr", "null_offset", 0.25 * DEG, "UNVERIFIED"),
])  # fmt: skip
def test_figures_are_those_of_the_survey(name, triad, figure, expected, mark):
    np.testing.assert_allclose(si(name, triad, figure), np.broadcast_to(expected, 3), rtol=1e-12)
    assert preset(name).triads[triad].figures[figure].mark == mark


def test_two_gyroscopes_make_one_triad_however_they_are_spelt_and_allan_is_a_variant():
    # survey: 2.0 m/s/√h = 3.4 mg/√Hz, two digits
    assert si("adis16355:allan", "acc", "noise_density")[0] / (1e-3 * G0) == pytest.approx(3.4, abs=0.05)
    assert [preset(name).name for name in ("mpu6050", "adis16355")] == ["mpu6000", "adis16355:density"]
    module = draw_module("adxrs290 + adxrs453", 3)
    assert module.name == "adxrs290+adxrs453"
    np.testing.assert_allclose(module.gyr.full_scale / DEG, [100.0, 100.0, 300.0])
    np.testing.assert_allclose(module.gyr.white_rpsd / DEG, [0.004, 0.004, 0.015])
    np.testing.assert_allclose(module.gyr.flicker / DEG * 3600.0, [0.0, 0.0, 16.0])
    assert module.acc is None and module.mag is None


@pytest.mark.parametrize(("sensors", "triad", "axis", "expected"), [
    # survey, row "quantisation sigma", LSB/√12, three digits: °/s for gyroscopes, µT for the magnetometer
    ("adxrs290+adxrs453", "gyr", 0, 0.00144 * DEG),
    ("adxrs290+adxrs453", "gyr", 2, 0.00361 * DEG),
    ("mpu6000", "gyr", 0, 0.00220 * DEG),
    ("mpu3050", "gyr", 1, 0.00220 * DEG),
    ("adis16355", "gyr", 2, 0.0211 * DEG),
    ("hmc5983", "mag", 0, 0.0265),
])  # fmt: skip
def test_quantisation_is_that_of_the_survey(sensors, triad, axis, expected):
    lsb = getattr(draw_module(sensors, 1), triad).lsb
    assert lsb[axis] / math.sqrt(12.0) == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize(("name", "heading", "tilt", "mark"), [
    ("dcm260b", 0.8, 0.2, "V1"),  # [Yu2018] section 4: heading 0.8°, roll and pitch 0.2°, at rest
    ("ahrs500ga", 0.2, 0.03, "UNVERIFIED"),  # [Li2012] section 3.1 claims 0.2° and 0.03° RMS
])  # fmt: skip
def test_references_have_the_accuracy_that_the_papers_state(name, heading, tilt, mark):
    assert {figure.mark for figure in preset(name).attitude.values()} == {mark}
    assert set(preset(name).attitude) == set(ANGLES)
    module = draw_module(name, 1)
    assert (module.attitude.heading, module.attitude.tilt) == pytest.approx((heading * DEG, tilt * DEG), rel=1e-12)
    assert module.calibrated().attitude == module.attitude
    assert ("attitude.heading" in module.source) == (mark == "UNVERIFIED")
    assert draw_module("mpu6000", 1).attitude is None


def test_ideal_has_no_errors_delays_are_those_of_the_filters_and_turned_triads_stay_orthogonal():
    module = draw_module("ideal", 1)
    for triad in (module.gyr, module.acc, module.mag):
        np.testing.assert_array_equal(triad.response, np.eye(3))
        assert not any(getattr(triad, name).any() for name in ("white_rpsd", "white_sd", "flicker", "bias", "lsb"))
        assert np.isinf(triad.full_scale).all()
    # survey: MPU-6000 with DLPF 2, gyroscope 2.8 ms, accelerometer 3.0 ms; ADXRS453 4 ms, ADXRS290 not given
    module = draw_module("mpu6000", 1)
    np.testing.assert_allclose(module.gyr.latency, 2.8e-3)
    np.testing.assert_allclose(module.acc.latency, 3.0e-3)
    np.testing.assert_allclose(draw_module("adxrs290+adxrs453", 1).gyr.latency, [0.0, 0.0, 4e-3])
    for seed in range(50):
        m = draw_module("adis16355", seed).gyr.misalignment
        symmetric = 0.5 * (m + m.T)
        # survey: misalignment 0.5°, non-orthogonality 0.05°; the antisymmetric part is a turn, the symmetric one a skew
        assert np.abs(m - symmetric).max() <= (0.5 + 0.05) * DEG
        assert np.abs(symmetric).max() <= 0.05 * DEG


def test_drawn_errors_and_pick_up_between_axes_fill_the_sheet_s_limits_evenly(drawn):
    limits = {
        ("acc", "bias"): np.array([0.05, 0.05, 0.08]) * G0, ("gyr", "bias"): 20.0 * DEG, ("gyr", "scale"): 0.03,
        ("mag", "hard_iron"): 8.0,
    }  # fmt: skip
    for (triad, name), limit in limits.items():
        values = np.array([getattr(getattr(m, triad), name) for m in drawn]) / limit
        assert np.abs(values).max() <= 1.0
        # uniform on ±1: standard deviation 1/√3, which scatters by ½ √(0.8/n); mean 0 ± 1/√(3n)
        np.testing.assert_allclose(values.std(axis=0), 1.0 / math.sqrt(3.0), rtol=4.0 * 0.5 * math.sqrt(0.8 / 300))
        np.testing.assert_allclose(values.mean(axis=0), 0.0, atol=4.0 / math.sqrt(3.0 * 300))
    m = np.array([module.gyr.misalignment for module in drawn])[:, ~np.eye(3, dtype=bool)]
    assert np.abs(m).max() <= 0.02  # survey: ±2 %
    np.testing.assert_allclose(m.std(), 0.02 / math.sqrt(3.0), rtol=4.0 * 0.5 * math.sqrt(0.8 / m.size))  # uniform


def test_a_unit_is_its_seed_its_magnetometer_can_sample_faster_and_figures_divide_units():
    alone, joined, other = draw_module("mpu6000", 5), draw_module("hmc5983+mpu6000", 5), draw_module("mpu6000", 6)
    np.testing.assert_array_equal(alone.gyr.bias, joined.gyr.bias)
    np.testing.assert_array_equal(alone.acc.misalignment, joined.acc.misalignment)
    assert (alone.gyr.bias != other.gyr.bias).all()
    module = draw_module("hmc5983", 1)
    assert module.mag.rate == 75.0  # of the rates in the survey
    assert module.with_mag_rate(220.0).mag.rate == 220.0
    assert draw_module("mpu6000", 1).with_mag_rate(10.0).mag is None
    rate = DataSheetFigure(3.0, "deg/s per g per g", "x", "V")
    np.testing.assert_allclose(rate.si, 3.0 * DEG / G0**2)
    np.testing.assert_allclose(replace(rate, unit="deg per rth").si, 3.0 * DEG / 60.0)  # √3600 s = 60 √s
    np.testing.assert_allclose(replace(rate, unit="1 per gauss").si, 0.03)


COUNT, RATE = 4000, 100.0
RNG = np.random.default_rng(11)
TRUTH = np.cumsum(RNG.normal(size=(COUNT, 3)), axis=0) * 0.01
FORCE = RNG.normal(size=(COUNT, 3))
WARM = 25.0 + 20.0 * np.linspace(0.0, 1.0, COUNT)
EVERYTHING = {
    "white_rpsd": 0.01, "white_sd": (0.02, 0.0, 0.03), "flicker": 0.05, "walk_rpsd": 0.02, "ramp": 1e-3,
    "bias": (0.3, -0.2, 0.1), "bias_per_k": (0.01, 0.0, -0.02), "g_sensitivity": RNG.normal(size=(3, 3)) * 0.01,
}  # fmt: skip


def readings(errors, truth=TRUTH, triad="gyr", seed=4):
    return measure(errors, truth, triad=triad, seed=seed, rate=RATE, temp_c=WARM, force_b=FORCE)


@pytest.mark.parametrize("name", [name for name in EVERYTHING if not name.startswith("white")])
def test_switching_one_error_off_leaves_the_others_as_they_are(name):
    with_it = readings(TriadErrors(**EVERYTHING)).values
    without = readings(TriadErrors(**{k: v for k, v in EVERYTHING.items() if k != name})).values
    alone = readings(TriadErrors(**{name: EVERYTHING[name]})).values - TRUTH
    # additive errors of independent streams: the difference is the error on its own, to rounding
    np.testing.assert_allclose(with_it - without, alone, atol=1e-13)
    assert np.abs(alone).max() > 1e-3


def test_white_noise_is_the_same_draw_whatever_else_is_on_and_another_for_triads_and_seeds():
    quiet = {k: v for k, v in EVERYTHING.items() if not k.startswith("white")}
    loud = {**quiet, "white_rpsd": 0.01}
    difference = readings(TriadErrors(**loud)).values - readings(TriadErrors(**quiet)).values
    np.testing.assert_allclose(difference, readings(TriadErrors(white_rpsd=0.01)).values - TRUTH, atol=1e-13)
    e = TriadErrors(white_rpsd=1.0)
    draws = [readings(e, 0.0 * TRUTH, t, s).values[:, 0] for t, s in (("gyr", 1), ("acc", 1), ("mag", 1), ("gyr", 2))]
    correlation = np.corrcoef(draws) - np.eye(4)
    assert np.abs(correlation).max() < 4.5 / np.sqrt(COUNT)  # sd 1/√N each; the largest of six pairs


def test_one_sample_scatters_by_density_times_root_rate_and_by_a_step_over_root_twelve():
    white = readings(TriadErrors(white_rpsd=0.01), 0.0 * TRUTH).values
    # N √rate; a standard deviation of n normal numbers scatters by 1/√(2n)
    np.testing.assert_allclose(white.std(axis=0), 0.01 * np.sqrt(RATE), rtol=4.0 / np.sqrt(2.0 * COUNT))
    both = readings(TriadErrors(white_rpsd=0.03, white_sd=0.4), 0.0 * TRUTH).values
    np.testing.assert_allclose(both.std(axis=0), 0.5, rtol=4.0 / np.sqrt(2.0 * COUNT))  # 3-4-5: √(0.3² + 0.4²)
    assert not readings(TriadErrors(walk_rpsd=1.0), 0.0 * TRUTH).values[0].any()  # from which a walk begins
    step = np.array([0.1, 0.02, 0.0])
    error = readings(TriadErrors(lsb=step), TRUTH * 37.0).values - TRUTH * 37.0
    # a uniform error of one step: variance step²/12, and the standard deviation found scatters by ½ √(0.8/n)
    np.testing.assert_allclose(error.std(axis=0), step / np.sqrt(12.0), rtol=4.0 * 0.5 * np.sqrt(0.8 / COUNT))
    assert (np.abs(error).max(axis=0) <= 0.5 * step + 1e-12).all()


def test_range_clips_each_axis_at_its_own_end():
    full = np.array([0.1, 0.2, np.inf])
    found = readings(TriadErrors(full_scale=full))
    np.testing.assert_array_equal(found.values, np.clip(TRUTH, -full, full))
    np.testing.assert_array_equal(found.clipped, np.abs(TRUTH) >= full)
    assert found.clipped[:, :2].any(axis=0).all()
    at_the_end = readings(TriadErrors(full_scale=1.0), np.tile([1.0, -1.0, 0.99], (COUNT, 1)))
    np.testing.assert_array_equal(at_the_end.clipped[0], [True, True, False])
    assert np.abs(readings(TriadErrors(full_scale=0.1, white_rpsd=1.0, lsb=0.03)).values).max() == 0.1


def test_scale_misalignment_and_iron_follow_their_equation():
    m, w = np.array([[0, 0.01, -0.02], [0.03, 0, 0.01], [0, 0.02, 0]]), np.eye(3) + 0.1 * RNG.normal(size=(3, 3))
    gain, h, b = np.array([0.02, -0.01, 0.03]), np.array([8.0, -5.0, 3.0]), np.array([0.4, 0.5, 0.6])
    found = readings(TriadErrors(scale=gain, misalignment=m, soft_iron=w, hard_iron=h, bias=b))
    for i in (0, 17, COUNT - 1):  # one row at a time: G (I + M) (W x + h) + b
        np.testing.assert_allclose(
            found.values[i], np.diag(1.0 + gain) @ ((np.eye(3) + m) @ (w @ TRUTH[i] + h)) + b, atol=1e-12
        )


def test_temperature_and_force_change_the_bias_that_is_told_which_is_all_but_white_noise():
    e = TriadErrors(bias=1.0, bias_per_k=0.1, scale=0.05, scale_per_k=1e-3, temp_ref_c=30.0)
    found = readings(e)
    dt = (WARM - 30.0)[:, np.newaxis]
    np.testing.assert_allclose(found.values, (1.05 + 1e-3 * dt) * TRUTH + 1.0 + 0.1 * dt, atol=1e-12)
    np.testing.assert_allclose(found.bias, np.tile(1.0 + 0.1 * dt, (1, 3)), atol=1e-12)
    s = RNG.normal(size=(3, 3))
    found = readings(TriadErrors(g_sensitivity=s))
    np.testing.assert_allclose(found.values - TRUTH, FORCE @ s.T, atol=1e-12)
    np.testing.assert_allclose(found.bias, FORCE @ s.T, atol=1e-12)
    e = TriadErrors(**EVERYTHING)
    found = readings(e)
    white = readings(TriadErrors(white_rpsd=0.01, white_sd=(0.02, 0.0, 0.03))).values - TRUTH
    np.testing.assert_allclose(found.values - TRUTH - white, found.bias, atol=1e-13)


def test_a_calibrated_triad_keeps_noise_range_and_rate_only():
    e = TriadErrors(**EVERYTHING, scale=0.1, soft_iron=2.0 * np.eye(3), hard_iron=5.0, lsb=0.01, full_scale=9.0,
                    latency=0.01, rate=20.0, high_pass=CORNER)  # fmt: skip
    c = e.calibrated()
    np.testing.assert_array_equal(c.response, np.eye(3))
    for gone in ("bias", "bias_per_k", "scale", "hard_iron", "g_sensitivity", "latency", "iron"):
        assert not getattr(c, gone).any(), gone
    for kept in ("white_rpsd", "white_sd", "flicker", "walk_rpsd", "ramp", "lsb", "full_scale", "rate", "high_pass"):
        np.testing.assert_array_equal(getattr(c, kept), getattr(e, kept))


def test_noise_card_gives_the_density_at_the_rate_of_the_triad_and_errors_cannot_be_changed():
    card = TriadErrors(white_rpsd=0.03, white_sd=0.4, flicker=0.2, walk_rpsd=0.1).noise_card(100.0)
    np.testing.assert_allclose(card.n_rpsd, 0.05)  # √(0.03² + (0.4/√100)²)
    np.testing.assert_allclose(card.b, 0.2)
    np.testing.assert_allclose(card.k_rpsd, 0.1)
    slower = TriadErrors(white_sd=0.4, rate=25.0).noise_card(100.0)
    np.testing.assert_allclose(slower.n_rpsd, 0.4 / 5.0)  # its own 25 Hz count
    e = TriadErrors(bias=0.1)
    with pytest.raises(ValueError, match="read-only"):
        e.bias[0] = 1.0
    np.testing.assert_array_equal(replace(e, scale=0.1).bias, [0.1, 0.1, 0.1])


CORNER = 0.5


def high_passed(truth, **more):
    return readings(TriadErrors(high_pass=CORNER, **more), truth)


def test_a_step_behind_a_high_pass_decays_with_its_corner_and_what_is_steady_is_gone():
    """A first-order high-pass answers a step by exp(-2π f t)."""
    step = np.zeros_like(TRUTH)
    step[1000:] = (1.0, -2.0, 3.0)
    t = np.arange(COUNT - 1000) / RATE
    found = high_passed(step).values
    assert not found[:1000].any()
    np.testing.assert_allclose(found[1000:], np.exp(-2.0 * np.pi * CORNER * t)[:, np.newaxis] * step[-1], atol=1e-12)
    still = np.full_like(TRUTH, 0.7)
    found = measure(
        TriadErrors(high_pass=CORNER, bias=0.3, bias_per_k=0.01), still, triad="gyr", seed=1, rate=RATE,
        temp_c=np.full(COUNT, 40.0), force_b=FORCE,
    )  # fmt: skip
    assert np.abs(found.values).max() < 1e-12 and np.abs(found.bias).max() < 1e-12
    card = TriadErrors(high_pass=CORNER, bias=0.3, bias_per_k=0.01, scale=0.1).card("rad/s")
    assert not card.bias.any() and not card.bias_per_k.any()
    np.testing.assert_allclose(np.diag(card.matrix), 1.0 / 1.1)


def test_white_noise_behind_a_high_pass_falls_with_one_over_tau():
    """Its integral is a first-order process of variance N²/(2 ω): far beyond 1/ω, σ(τ) = N √(3/(2 ω)) / τ."""
    count, n = 200_000, 0.01
    found = measure(
        TriadErrors(high_pass=CORNER, white_rpsd=n), np.zeros((count, 3)), triad="gyr", seed=1, rate=RATE,
        temp_c=np.full(count, 25.0), force_b=np.zeros((count, 3)),
    ).values  # fmt: skip
    theta = np.vstack((np.zeros(3), np.cumsum(found, axis=0))) / RATE
    m = int(20.0 * RATE)
    second = theta[2 * m :] - 2.0 * theta[m:-m] + theta[: -2 * m]
    sigma = np.sqrt(0.5 * (second**2).mean()) / 20.0
    assert sigma == pytest.approx(n * np.sqrt(3.0 / (4.0 * np.pi * CORNER)) / 20.0, rel=0.05)
