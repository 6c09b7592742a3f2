"""The buoy paper's filter: its equations, its gate, and its start."""

import math

import numpy as np
import pytest

from plumbob import Filter, Frame, ImuData
from plumbob.core import flags
from plumbob.core.constants import G0
from plumbob.evaluation import attitude_errors
from plumbob.filters import mahony
from plumbob.filters.layout import BIAS, OWN
from plumbob.rotations import dcm_from_quat, quat_angle, quat_from_euler_zyx, quat_multiply, quat_normalize
from tests.helpers.filter_state import coefficients_of, fresh_state
from tests.helpers.motion import noisy_and_whole, seen_by


def by_the_paper(q, integral, dt, gyr, acc, mag, kp, ki, gate):
    """One step in NED as the corrected specification writes it, with matrices and NumPy."""
    c = dcm_from_quat(q)
    f = np.asarray(acc)
    down = c.T @ [0.0, 0.0, 1.0]
    error = np.cross(-f / np.linalg.norm(f), down) if abs(np.linalg.norm(f) - G0) < gate else np.zeros(3)
    m = np.asarray(mag) / np.linalg.norm(mag)
    h = c @ m  # turned level
    b = np.array([math.hypot(h[0], h[1]), 0.0, h[2]])
    error = error + np.cross(m, c.T @ b)
    integral = integral + ki * dt * error  # [Yu2018] (7)
    rate = np.asarray(gyr) + kp * error + integral
    return quat_normalize(q + 0.5 * dt * quat_multiply(q, [0.0, *rate])), integral  # [Yu2018] (3), corrected


def test_the_kernel_is_the_paper_step_by_step():
    data = noisy_and_whole(400, 100.0)
    f = Filter("mahony", frame=Frame.NED, params={"kp": 0.7, "ki": 0.2, "gate": 0.5})
    track = f.process(data)
    q, integral = track.q_nb[0], -track.bias_b[0]
    gated = 0
    for i in range(1, len(data)):
        q, integral = by_the_paper(q, integral, 0.01, data.gyr[i], data.acc[i], data.mag[i], 0.7, 0.2, 0.5)
        assert quat_angle(q, track.q_nb[i]) < 1e-12 * i
        assert np.abs(integral + track.bias_b[i]).max() < 1e-12 * i
        gated += bool(track.flags[i] & flags.ACC_GATED)
    assert 10 < gated < len(data) - 10  # both branches were walked


def test_errors_are_the_vector_products_of_measured_and_predicted_directions():
    """[Mahony2008] (48c): a small turn of the attitude shows up as minus that turn, for tilt and heading alike."""
    frame = Frame.ENU
    q = quat_from_euler_zyx([0.3, -0.4, 1.1])
    seen, c = seen_by(q, frame), coefficients_of(Filter("mahony", frame=frame))
    for axis in np.eye(3):
        x = np.zeros(OWN)
        x[:4] = quat_normalize(quat_multiply(q, [1.0, *(0.5e-6 * axis)]))
        tilt = mahony.tilt_error(c, x, *seen["acc"])[1:]
        up_b = seen["acc"] / G0
        level_turn = axis - up_b * (axis @ up_b)  # gravity does not show turns about itself
        assert np.abs(np.array(tilt) + 1e-6 * level_turn).max() < 1e-11


@pytest.mark.parametrize(
    ("excess_g", "used"), [(0.0, True), (0.079, True), (0.081, False), (-0.079, True), (-0.081, False)]
)
def test_the_gate_is_in_g_when_it_says_so(excess_g, used):
    q = quat_from_euler_zyx([0.0, 0.1, 0.2])
    seen = seen_by(np.tile(q, (2, 1)), Frame.NED)
    seen["acc"] = seen["acc"] * (1.0 + excess_g)
    data = ImuData(t=[0.0, 0.01], gyr=np.zeros((2, 3)), **seen)
    track = Filter("mahony", frame=Frame.NED, params={"gate": "0.08g"}).process(data)
    assert bool(track.flags[1] & flags.ACC_GATED) is not used


def test_a_constant_gyroscope_bias_is_learned():
    """Poles of s² + 2 Kp s + 2 Ki (two vectors, each of gain about 1 about the vertical): settled after 300 s."""
    q = np.tile(quat_from_euler_zyx([0.5, 0.1, -0.2]), (60_000, 1))
    bias = np.radians([1.0, -2.0, 0.5])
    data = ImuData(t=np.arange(60_000) / 100.0, gyr=np.tile(bias, (60_000, 1)), **seen_by(q, Frame.ENU))
    track = Filter("mahony", frame=Frame.ENU).process(data)
    assert np.abs(track.bias_b[-1] - bias).max() < 1e-6
    assert quat_angle(track.q_nb[-1], q[-1]) < 1e-5


@pytest.mark.parametrize(("quick", "fallen_at"), [(False, 0.0), (True, 1.0 / 0.41)])
def test_the_gain_of_a_quick_start_falls_to_kp_and_the_bias_waits_for_it(quick, fallen_at):
    """Gains 1/t and 0 until 1/t has fallen to Kp = 0.41 1/s, after 2.44 s; then Kp and Ki: the law by hand."""
    c = coefficients_of(Filter("mahony", frame=Frame.ENU, params={"kp": 0.41, "ki": 0.05, "quick_start": quick}))
    x, error, bias = fresh_state("mahony"), np.array([0.03, -0.02, 0.01]), np.zeros(3)
    for i in range(1, 101):
        t = 0.05 * i
        early = t < fallen_at
        if not early:
            bias -= 0.05 * 0.05 * error
        kp = 1.0 / t if early else 0.41
        assert mahony.regulate(c, x, 0.05, *error) == pytest.approx(kp * error - bias, rel=1e-9)
        assert x[BIAS : BIAS + 3] == pytest.approx(bias, rel=1e-9, abs=1e-15)


def test_quick_start_averages_a_bad_first_look_away():
    """With gain 1/t the n-th look has weight 1/n, so one wrong look of 5° among 100 leaves at most 5°/100 of tilt.

    Kp = 0.05 1/s alone leaves 5° exp(−0.05) = 4.76° after a second. Without the magnetometer, whose feedback of the
    heading, wrong too at first, would pull at the tilt.
    """
    q = np.tile(quat_from_euler_zyx([0.3, 0.0, 0.0]), (101, 1))
    seen = seen_by(q, Frame.NED)
    tilted = seen_by(quat_multiply(q[:1], quat_from_euler_zyx([0.0, math.radians(5.0), 0.0])), Frame.NED)
    acc = np.concatenate((tilted["acc"], seen["acc"][1:]))
    data = ImuData(t=np.arange(101) / 100.0, gyr=np.zeros((101, 3)), acc=acc, mag=seen["mag"])

    def tilt_left(**more):
        params = {"kp": 0.05, "ki": 0.0, "gate": None, "mag": False, **more}
        track = Filter("mahony", frame=Frame.NED, params=params).process(data)
        return np.degrees(attitude_errors(track.q_nb[-1:], q[-1:])["inclination"][0])

    assert tilt_left() == pytest.approx(4.76, abs=0.1)
    assert tilt_left(quick_start=True) < 0.05
