"""Two recordings of one motion: planted clocks, mountings, biases and scales are found within their stated errors."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from plumbob import AttitudeTrack, Frame, ImuData, North, Recording, compare, simulate, write
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.units import deg, to_deg
from plumbob.rotations import change_frame, quat_angle, quat_conjugate, quat_from_euler_zyx, quat_rotate
from tests.helpers.commandline import call, ok

OFFSET, DRIFT = 37.3e-3, 50e-6
Q_AB = quat_from_euler_zyx(np.array([deg(20.0), deg(-35.0), deg(110.0)]))
BIAS = {"gyr": np.array([0.01, -0.02, 0.03]), "acc": np.array([0.1, 0.0, -0.2]), "mag": np.array([5.0, -3.0, 0.0])}
SCALE = {"gyr": 1.01, "acc": 1.0, "mag": 1.0}
NOISE = {"gyr": 0.002, "acc": 0.03, "mag": 0.3}


@cache
def curves(scenario, duration):
    how = {"frame": "ENU", "sensors": "ideal", "unit": "calibrated", "seed": 1, "rate": 1000.0}
    imu = simulate(scenario, **how, duration=duration).imu
    return {name: CubicSpline(imu.t, getattr(imu, name)) for name in NOISE}


def pair(scenario="buoy", duration=60.0, rate_b=100.0, noise=1.0, shift=OFFSET):
    """Both read one motion, each at its own times; b's clock, axes, bias and scale differ from a's."""
    curve, rng = curves(scenario, duration), np.random.default_rng(0)
    t_a = np.arange(0.5, duration - 0.5, 0.01)
    t_b = np.arange(0.6, duration - 0.6, 1.0 / rate_b)  # by a's clock
    a = {name: of(t_a) for name, of in curve.items()}
    b = {name: quat_rotate(quat_conjugate(Q_AB), of(t_b) * SCALE[name] + BIAS[name]) for name, of in curve.items()}
    for one in (a, b):
        for name in one:
            one[name] = one[name] + rng.normal(0.0, noise * NOISE[name], one[name].shape)
    return ImuData(t=t_a, **a), ImuData(t=(t_b - shift) / (1.0 + DRIFT), **b)


def at_zero(clock):
    """Offset at b's t = 0: t_a = t_b (1 + drift) + this."""
    return clock.offset - clock.drift * clock.middle


def test_without_noise_everything_is_found_to_the_interpolation():
    a, b = pair(noise=0.0)
    found = compare(a, b)
    assert at_zero(found.clock) == pytest.approx(OFFSET, abs=2e-6)
    assert found.clock.drift == pytest.approx(DRIFT, abs=1e-7)
    assert quat_angle(found.mounting.q_ab, Q_AB) < deg(0.001)
    for name, one in found.triads.items():
        mean = np.mean(getattr(a, name), axis=0)
        np.testing.assert_allclose(one.bias, BIAS[name] + (SCALE[name] - 1.0) * mean, atol=2e-3 * NOISE[name] * 100)
        np.testing.assert_allclose(one.scale, SCALE[name], rtol=1e-3)
        assert one.bandwidth > 5.0


@pytest.mark.parametrize(("scenario", "duration", "rate_b"), [
    ("buoy", 60.0, 100.0),
    ("buoy", 15.0, 100.0),
    ("buoy", 60.0, 173.0),
    ("sway", 60.0, 100.0),
    ("ball", 60.0, 100.0),
    pytest.param("buoy", 600.0, 100.0, marks=pytest.mark.long),
    pytest.param("ball", 300.0, 50.0, marks=pytest.mark.long),
])  # fmt: skip
def test_planted_clock_and_mounting_are_found_within_their_stated_errors(scenario, duration, rate_b):
    a, b = pair(scenario, duration, rate_b)
    found = compare(a, b)
    clock, middle = found.clock, OFFSET + DRIFT * found.clock.middle
    assert abs(clock.offset - middle) < 4.0 * clock.offset_sd < 0.05
    assert abs(clock.drift - DRIFT) < 4.0 * clock.drift_sd
    error = quat_angle(found.mounting.q_ab, Q_AB)
    assert error < 4.0 * np.sqrt(np.sum(found.mounting.sd**2)) and error < deg(0.5)
    gyr = found.triads["gyr"]
    scaled = (SCALE["gyr"] - 1.0) * np.mean(a.gyr, axis=0)
    np.testing.assert_allclose(gyr.bias, BIAS["gyr"] + scaled, atol=1e-3)
    # what is left is the noise of both: √2 on each of three axes
    assert gyr.residual == pytest.approx(np.sqrt(6.0) * NOISE["gyr"], rel=0.15)
    assert abs(gyr.ratio_db - 20.0 * np.log10(SCALE["gyr"])) < 0.1


def test_a_negative_offset_has_its_sign_and_starts_of_two_files_count():
    assert at_zero(compare(*pair(shift=-2.5)).clock) == pytest.approx(-2.5, abs=2e-3)
    a, b = pair()
    later = replace(b, meta=replace(b.meta, t0_ns=1_000_003_000_000_000), t=b.t)
    early = replace(a, meta=replace(a.meta, t0_ns=1_000_000_000_000_000))
    moved = ImuData(t=later.t - 3.0 + 10.0, gyr=b.gyr, acc=b.acc, mag=b.mag, meta=later.meta)
    assert at_zero(compare(early, moved).clock) == pytest.approx(OFFSET - 7.0, abs=2e-3)


def test_of_a_rest_nothing_is_seen_and_a_turn_about_one_axis_does_not_show_the_mounting():
    found = compare(*pair("static", 30.0))
    assert found.clock is None and found.mounting is None
    assert "nothing of clocks and mounting can be seen" in found.text().replace("\n  ", " ").lower()
    assert not found.within
    t = np.arange(6000) / 100.0
    gyr = np.column_stack((np.zeros((6000, 2)), np.sin(0.7 * t) + 0.5 * np.sin(2.1 * t + 0.3 * np.sin(0.2 * t))))
    noise = np.random.default_rng(1).normal(0.0, 1e-3, (2, 6000, 3))
    found = compare(ImuData(t=t, gyr=gyr + noise[0]), ImuData(t=t - 0.25, gyr=gyr + noise[1]))
    assert found.clock.offset == pytest.approx(0.25, abs=1e-3)
    assert found.mounting is None and "single axis" in str(found.remarks[0])


def test_equal_to_the_bit_the_first_difference_and_what_cannot_be_compared():
    a, _ = pair(duration=15.0)
    assert compare(a, a, tolerance=0).equal and compare(a, a, tolerance=0).within
    assert [bool(compare(a[:count], a[:count]).triads) for count in (99, 100)] == [False, True]  # samples in common
    gyr = np.array(a.gyr)
    gyr[700, 1] = np.nextafter(gyr[700, 1], 1.0)
    found = compare(a, ImuData(t=a.t, gyr=gyr, acc=a.acc, mag=a.mag), tolerance=0)
    assert found.first.startswith("gyr in row 700") and found.within is False
    assert compare(a, ImuData(t=a.t, gyr=gyr, acc=a.acc, mag=a.mag), tolerance="0.1%").within
    assert "ends after 500 rows" in compare(a, a[:500]).first
    assert "mag in one" in compare(a, ImuData(t=a.t, gyr=a.gyr, acc=a.acc)).first
    for other, how, error, words in (
        (track(), {}, ShapeError, "nothing to compare"),
        (a, {"align": ["clock"]}, ParameterError, "align knows"),
        (a, {"tolerance": "1deg"}, ParameterError, "share"),
    ):
        with pytest.raises(error, match=words):
            compare(a, other, **how)


def track(turned=0.0, frame=Frame.ENU):
    t = np.arange(1000) / 100.0
    angles = np.column_stack((0.3 * t + turned, 0.2 * np.sin(t), 0.3 * np.cos(0.7 * t)))
    q = change_frame(quat_from_euler_zyx(angles), to=frame, from_=Frame.ENU)
    return AttitudeTrack(t=t, q_nb=q, frame=frame, north=North.TRUE)


def test_attitudes_are_judged_across_frames_with_tolerance():
    found = compare(track(float(deg(2.0))), track(frame=Frame.NED), tolerance="2.1 deg")
    assert to_deg(found.evaluation.stats["heading"].rmse) == pytest.approx(2.0, abs=1e-6)
    assert found.within
    assert compare(track(float(deg(2.0))), track(), tolerance="1.9 deg").within is False
    assert compare(track(float(deg(2.0))), track(), tolerance="1e-6 deg", align=["heading"]).within
    assert compare(track(), track(), tolerance=0).equal


def test_command_line(tmp_path):
    files = [write(tmp_path / f"{i}.parquet", Recording(imu=imu)) for i, imu in enumerate(pair(duration=15.0))]
    told = call("compare", *files, "--tolerance", "0", "--json")
    assert told.returncode == 3
    assert json.loads(told.stdout)["mounting"]["euler_zyx_deg"] == pytest.approx([20.0, -35.0, 110.0], abs=0.5)
    ok("compare", files[0], files[0], "--tolerance", "0")
    assert call("compare", *files, "--align", "none", "--tolerance", "1%").returncode == 3
    ok("compare", *files, "--html", tmp_path / "c.html")
    assert "Difference of each triad" in (tmp_path / "c.html").read_text()
