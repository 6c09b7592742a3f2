"""Gyroscope integration: coning, order of convergence, and the known errors of the first-order step."""

import math

import numpy as np
import pytest

from plumbob import CalibrationCard, Filter, Frame, ImuData, ImuMeta, flags
from plumbob.data.cards import TriadCalibration
from plumbob.rotations import (
    IDENTITY,
    body_rate_from_euler_zyx,
    quat_angle,
    quat_conjugate,
    quat_from_euler_zyx,
    quat_from_rotvec,
    quat_multiply,
    rotvec_from_quat,
)


def coning(t, half_angle, speed):
    """Attitude and body rate of a body whose axis runs round a cone, in closed form.

    q = [cos a/2, 0, sin a/2 cos Ωt, sin a/2 sin Ωt]; ω = 2 q* q' = [−2Ω sin² a/2, −Ω sin a sin Ωt, Ω sin a cos Ωt].
    """
    c, s, zero = np.cos(speed * t), np.sin(speed * t), np.zeros_like(t)
    q = np.stack((zero + math.cos(half_angle / 2), zero, math.sin(half_angle / 2) * c, math.sin(half_angle / 2) * s), 1)
    side = speed * math.sin(half_angle)
    return q, np.stack((zero - 2 * speed * math.sin(half_angle / 2) ** 2, -side * s, side * c), 1)


def fin(t, phase=0.0):
    """Attitude and body rate of the fin paper's motion, the twist ahead by a phase."""
    w, size = math.pi, np.radians([0.0, 30.0, 20.0])
    angles = size * np.stack((0.0 * t, np.sin(w * t), np.cos(w * t + phase)), 1)
    rates = size * w * np.stack((0.0 * t, np.cos(w * t), -np.sin(w * t + phase)), 1)
    return quat_from_euler_zyx(angles), body_rate_from_euler_zyx(angles, rates)


def error_deg(name, t, q, rate, **params):
    track = Filter(name, frame=Frame.ENU, init=q[0], params=params).process(ImuData(t=t, gyr=rate))
    return np.degrees(quat_angle(track.q_nb, q))


def test_the_bar_of_the_fin_paper():
    """Coning of 5° at 1 Hz for ten minutes, sampled at 100 Hz, and 220 s of the paper's own motion at 500 Hz.

    Swing ±30° and twist ±20° at 0.5 Hz, 90° apart: per-axis integration is off by 3351° there.
    """
    t = np.arange(60_000) / 100.0
    q, rate = coning(t, math.radians(5.0), 2 * math.pi)
    assert error_deg("integrate", t, q, rate).max() < 1e-3
    assert error_deg("integrate_first_order", t, q, rate).max() > 0.1  # the test can tell them apart
    t = np.arange(110_000) / 500.0
    assert error_deg("integrate", t, *fin(t)).max() < 1e-3


@pytest.mark.parametrize(("rate_dps", "known_deg_per_s"), [(172.0, 0.013), (573.0, 0.48), (2000.0, 20.0)])
def test_known_errors_of_the_first_order_step_at_100_hz(rate_dps, known_deg_per_s):
    """[Yu2018] (3), corrected: each step turns by 2 atan(ωΔt/2) instead of ωΔt."""
    t = np.arange(101) / 100.0
    omega = math.radians(rate_dps) * np.array([0.0, 0.0, 1.0])
    q = quat_from_rotvec(t[:, None] * omega)
    lost = error_deg("integrate_first_order", t, q, np.tile(omega, (101, 1)))[-1]
    closed_form = math.degrees(100 * (math.radians(rate_dps) / 100 - 2 * math.atan(math.radians(rate_dps) / 200)))
    assert lost == pytest.approx(closed_form, rel=1e-9)
    assert lost == pytest.approx(known_deg_per_s, rel=0.10)
    assert error_deg("integrate", t, q, np.tile(omega, (101, 1)))[-1] < 1e-9


def test_mean_rates_are_integrated_exactly_when_they_are_declared():
    """A rate that turns about one axis only: its mean over each step is the angle difference over the step."""
    t = np.arange(500) / 100.0
    angle = 0.8 * np.sin(3.0 * t)
    mean = np.diff(angle, prepend=angle[0]) * 100.0
    q = quat_from_rotvec(np.outer(angle, [0.0, 1.0, 0.0]))
    rate = np.outer(mean, [0.0, 1.0, 0.0])
    assert error_deg("integrate", t, q, rate, mean_rate=True).max() < 1e-10
    assert error_deg("integrate", t, q, rate).max() > 0.1  # read as rates at their times they lag by half a step


def test_gyroscope_alone_starts_from_the_identity_and_says_that_it_does_not_know():
    t = np.arange(10) / 100.0
    track = Filter("integrate", frame=Frame.NED).process(ImuData(t=t, gyr=np.zeros((10, 3))))
    assert (track.q_nb == IDENTITY).all() and (track.flags & flags.NOT_CONVERGED).all()


@pytest.mark.parametrize("what", ["bias", "matrix", "delay"])
def test_the_claim_with_a_card_is_what_its_errors_turn_by(what):
    """By differences, of the fin's motion; of axes that are read late, by its closed form at other times."""
    t, size = np.arange(20_000) / 200.0, 1e-5
    (q, rate), (_, late) = fin(t, 1.0), fin(t - size, 1.0)
    wrong = {
        "bias": [rate + size * axis for axis in np.eye(3)],
        "matrix": [rate + size * np.outer(rate[:, i], np.eye(3)[k]) for k in range(3) for i in range(3)],
        "delay": [np.where(np.arange(3) == k, late, rate) for k in range(3)],
    }[what]
    variances = np.repeat((size**2 * (what == "bias"), size**2 if what == "matrix" else 1e-40), (3, 9))
    delay = {"delay_sd": size} if what == "delay" else {}
    gyr = TriadCalibration(np.eye(3), np.zeros(3), "rad/s", "rad/s", covariance=np.diag(variances), **delay)
    card = CalibrationCard(device="SN1", date="2026-01-01", method="test", gyr=gyr)
    unit = Filter("integrate", frame=Frame.NED, init=q[0], calibration=card)
    track = unit.process(ImuData(t=t, gyr=rate, meta=ImuMeta(device="SN1")), covariance=True)
    ends = [Filter("integrate", frame=Frame.NED, init=q[0]).process(ImuData(t=t, gyr=off)).q_nb[-1] for off in wrong]
    turns = rotvec_from_quat(quat_multiply(quat_conjugate(track.q_nb[-1]), np.array(ends)))
    expected = turns.T @ turns
    np.testing.assert_allclose(track.cov_b[-1], expected, atol=0.03 * np.abs(expected).max())
