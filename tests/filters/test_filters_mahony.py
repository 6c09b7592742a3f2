"""The buoy paper's filter: its equations, its gate, and its start."""

import math

import numpy as np
import pytest

from plumbob import Filter, Frame, ImuData, flags
from plumbob.core.constants import G0
from plumbob.filters import mahony
from plumbob.filters.layout import BIAS
from plumbob.rotations import dcm_from_quat, quat_angle, quat_from_euler_zyx, quat_multiply, quat_normalize
from tests.helpers.filter_state import coefficients_of, fresh_state
from tests.helpers.motion import noisy_and_whole, seen_by


def by_the_paper(q, integral, dt, gyr, acc, mag, kp, ki, gate):
    """One step in NED as the corrected specification writes it, with matrices and NumPy.

    Errors are vector products of measured and predicted directions, [Mahony2008] (48c).
    """
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
