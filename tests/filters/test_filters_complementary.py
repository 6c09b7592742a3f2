"""The classic complementary filter: the textbook's line about one axis, and what its form on quaternions adds."""

import math

import numpy as np
import pytest

from plumbob import Filter, Frame, ImuData, flags
from plumbob.core.constants import G0
from plumbob.evaluation.metrics import attitude_errors
from plumbob.filters.complementary import arc, share
from plumbob.rotations import quat_angle, quat_from_euler_zyx, quat_from_rotvec, quat_multiply
from tests.helpers.motion import consistent, seen_by

EPS = np.finfo(float).eps


def at_rest(t, q, gyr=(0.0, 0.0, 0.0)):
    """A unit at rest whose gyroscope says something all the same."""
    return ImuData(t=t, gyr=np.tile(gyr, (len(t), 1)), **seen_by(np.tile(q, (len(t), 1)), Frame.NED))


def degrees_off(data, truth, start, **params):
    """Errors of the filter, deg, that starts with a wrong attitude."""
    track = Filter("complementary", frame=Frame.NED, init=start, params=params).process(data)
    return {k: np.degrees(v) for k, v in attitude_errors(track.q_nb, np.tile(truth, (len(data), 1))).items()}


def test_about_one_axis_it_is_the_textbook_s_line():
    """[Higgins1975]: θ ← (1 − w)(θ + ωΔt) + w θₐ with w = 1 − exp(−Δt/τ), ω the mean of two samples."""
    rng = np.random.default_rng(1)
    n, tau = 400, 0.7
    t = np.cumsum(rng.uniform(0.005, 0.02, n))
    seen, rate = rng.uniform(-0.8, 0.8, n), rng.normal(size=n)  # what the two sensors say need not agree
    acc = G0 * np.stack((np.zeros(n), np.sin(seen), np.cos(seen)), axis=1)  # roll in a frame with z up
    data = ImuData(t=t, gyr=rate[:, np.newaxis] * [1.0, 0.0, 0.0], acc=acc)
    track = Filter("complementary", frame=Frame.ENU, params={"tau_tilt": tau}).process(data)
    roll = np.empty(n)
    roll[0] = seen[0]
    for i in range(1, n):
        dt = (data.t_ns[i] - data.t_ns[i - 1]) / 1e9
        w = 1.0 - math.exp(-dt / tau)
        roll[i] = (1.0 - w) * (roll[i - 1] + 0.5 * (rate[i - 1] + rate[i]) * dt) + w * seen[i]
    expected = quat_from_rotvec(roll[:, np.newaxis] * [1.0, 0.0, 0.0])
    assert quat_angle(track.q_nb, expected).max() < n * 16 * EPS  # some roundings a step


@pytest.mark.parametrize("rate", [5.0, 100.0, 1000.0])
def test_an_error_decays_with_its_time_constant_at_any_rate(rate):
    """exp(−t/τ) whatever the step: 5° of tilt and 8° of heading, over 180°, after 2 s, each with its own τ."""
    truth = quat_from_euler_zyx([math.radians(176.0), 0.4, -0.2])
    data = at_rest(np.arange(round(2.0 * rate) + 1) / rate, truth)
    tilted = quat_multiply(truth, quat_from_rotvec(np.radians(5.0) * np.array([0.6, 0.8, 0.0])))
    off = degrees_off(data, truth, tilted, tau_tilt=1.5, tau_heading=1e6)
    assert off["inclination"][-1] == pytest.approx(off["inclination"][0] * math.exp(-2.0 / 1.5), rel=1e-9)
    turned = quat_multiply(quat_from_euler_zyx([np.radians(8.0), 0.0, 0.0]), truth)
    off = degrees_off(data, truth, turned, tau_tilt=1.5, tau_heading=4.0)
    assert off["heading"][-1] == pytest.approx(8.0 * math.exp(-2.0 / 4.0), rel=1e-9)
    assert (share(0.0, 5.0), share(np.inf, 5.0)) == (0.0, 1.0)


def test_a_bias_leaves_its_product_with_the_time_constant():
    """Rest of e ← (1 − w)(e + bΔt) is bΔt (1 − w)/w, near b τ; level, so that axis z is the heading alone."""
    dt, b = 0.1, math.radians(0.5)
    t = np.arange(3000) * dt
    level = np.array([1.0, 0.0, 0.0, 0.0])
    for gyr, tau, what in (((b, 0.0, 0.0), 2.0, "inclination"), ((0.0, 0.0, b), 8.0, "heading")):
        off = degrees_off(at_rest(t, level, gyr=gyr), level, level, tau_tilt=2.0, tau_heading=8.0)
        assert off[what][-1] == pytest.approx(0.5 * dt / math.expm1(dt / tau), rel=1e-6)
        assert off[what][-1] == pytest.approx(0.5 * (tau - 0.5 * dt), rel=1e-3)


def test_there_is_no_singularity_at_pitch_90_degrees():
    """Two loops through pitch ±90° without noise: rate and steps are exact, so only rounding is left."""
    t = np.arange(2514) / 100.0
    rate = np.array([0.0, 0.5, 0.0])
    q = quat_multiply(quat_from_euler_zyx([0.4, 0.0, 0.0]), quat_from_rotvec(t[:, np.newaxis] * rate))
    data = ImuData(t=t, gyr=np.tile(rate, (t.size, 1)), **seen_by(q, Frame.NED))
    params = {"tau_tilt": 0.5, "tau_heading": 0.5}
    exact = Filter("complementary", frame=Frame.NED, params=params).process(data)
    assert quat_angle(exact.q_nb, q).max() < 1e-9
    wrong = Filter("complementary", frame=Frame.NED, init=quat_multiply(q[0], [0.995, 0.0, 0.0998, 0.0]), params=params)
    decay = quat_angle(wrong.process(data).q_nb, q)
    assert (np.diff(decay[decay > 1e-6]) <= 0.0).all()  # passing 90° after 3.1 s does not disturb it


def test_the_arc_is_the_shortest_and_ends_on_the_direction():
    rng = np.random.default_rng(4)
    for _ in range(50):
        s, u = rng.normal(size=(2, 3))
        u /= np.linalg.norm(u)
        r = np.array(arc(*s, *u))
        assert abs(r @ s) < 1e-12 * np.linalg.norm(s)  # about an axis at right angles to both
        assert abs(r @ u) < 1e-12
        # a turn of the body by r moves u, which stays in space, by −r in its axes
        turned = quat_multiply(quat_multiply(quat_from_rotvec(-r), [0.0, *u]), quat_from_rotvec(r))[1:]
        assert np.abs(turned - s / np.linalg.norm(s)).max() < 1e-12


def test_upside_down_without_any_noise_it_waits_and_with_some_it_recovers():
    assert arc(0.0, 0.0, 1.0, 0.0, 0.0, -1.0) == (0.0, 0.0, 0.0)
    truth, opposite = np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0, 0.0])
    data, params = at_rest(np.arange(2000) / 100.0, truth), {"tau_tilt": 1.0, "tau_heading": 1.0}
    noise = np.random.default_rng(0).normal(size=data.acc.shape) * 1e-3
    exact, shaken = (
        Filter("complementary", frame=Frame.NED, init=opposite, params=params).process(
            ImuData(t=data.t, gyr=data.gyr, acc=data.acc + of, mag=data.mag)
        )
        for of in (0.0, noise)
    )
    assert np.isfinite(exact.q_nb).all()
    assert quat_angle(shaken.q_nb[-1], truth) < 1e-3  # 180° e⁻²⁰ is nothing; 1e-3/g of noise, averaged, is left


def test_what_has_no_direction_is_flagged_and_not_used():
    data, _ = consistent(50)
    acc, mag = data.acc.copy(), data.mag.copy()
    acc[20], mag[30] = 0.0, acc[30]  # a field that stands vertical
    track = Filter("complementary", frame=Frame.ENU).process(ImuData(t=data.t, gyr=data.gyr, acc=acc, mag=mag))
    assert np.flatnonzero(track.flags & flags.ACC_GATED).tolist() == [20]
    assert np.flatnonzero(track.flags & flags.MAG_GATED).tolist() == [30]
