"""Gyroscope integration: coning, order of convergence, and the known errors of the first-order step."""

import math

import numpy as np
import pytest

from plumbob import Filter, Frame, ImuData, flags
from plumbob.rotations import IDENTITY, body_rate_from_euler_zyx, quat_angle, quat_from_euler_zyx, quat_from_rotvec


def coning(t, half_angle, speed):
    """Attitude and body rate of a body whose axis runs round a cone, in closed form.

    q = [cos a/2, 0, sin a/2 cos Ωt, sin a/2 sin Ωt]; ω = 2 q* q' = [−2Ω sin² a/2, −Ω sin a sin Ωt, Ω sin a cos Ωt].
    """
    c, s, zero = np.cos(speed * t), np.sin(speed * t), np.zeros_like(t)
    q = np.stack((zero + math.cos(half_angle / 2), zero, math.sin(half_angle / 2) * c, math.sin(half_angle / 2) * s), 1)
    side = speed * math.sin(half_angle)
    return q, np.stack((zero - 2 * speed * math.sin(half_angle / 2) ** 2, -side * s, side * c), 1)


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
    t, w, size = np.arange(110_000) / 500.0, math.pi, np.radians([0.0, 30.0, 20.0])
    angles = size * np.stack((0.0 * t, np.sin(w * t), np.cos(w * t)), 1)
    rates = size * w * np.stack((0.0 * t, np.cos(w * t), -np.sin(w * t)), 1)
    fin = quat_from_euler_zyx(angles)
    assert error_deg("integrate", t, fin, body_rate_from_euler_zyx(angles, rates)).max() < 1e-3


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
