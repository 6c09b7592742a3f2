"""The 2010 report's filter: its gradient, its speed and its bias."""

import math

import numpy as np
import pytest

from plumbob import Filter, Frame, ImuData
from plumbob.filters.madgwick import gradient
from plumbob.rotations import quat_angle, quat_from_euler_zyx, quat_multiply
from tests.battery.motion import seen_by


def seen(q, d):
    """Direction d in body axes, as the report's (21) writes it: homogeneous only on the unit sphere."""
    w, x, y, z = q
    dx, dy, dz = d
    return np.array(
        [
            2 * dx * (0.5 - y * y - z * z) + 2 * dy * (w * z + x * y) + 2 * dz * (x * z - w * y),
            2 * dx * (x * y - w * z) + 2 * dy * (0.5 - x * x - z * z) + 2 * dz * (w * x + y * z),
            2 * dx * (w * y + x * z) + 2 * dy * (y * z - w * x) + 2 * dz * (0.5 - x * x - y * y),
        ]
    )


def test_gradient_against_differences():
    """Half of d/dq ½|seen(q, d) − s|², the common factor 2 of the Jacobian left out; central differences, step 1e-6."""
    rng = np.random.default_rng(2)
    for _ in range(50):
        q, d, s = rng.normal(size=4), rng.normal(size=3), rng.normal(size=3)

        def cost(p, d=d, s=s):
            return 0.25 * np.sum((seen(p, d) - s) ** 2)

        steps = 1e-6 * np.eye(4)
        differences = [(cost(q + h) - cost(q - h)) / 2e-6 for h in steps]
        found = gradient(*q, *d, *s)
        assert np.allclose(found, differences, rtol=1e-6, atol=1e-6 * np.abs(differences).max())


@pytest.mark.parametrize("frame", list(Frame))
def test_an_error_is_taken_back_at_twice_beta(frame):
    """A quaternion that moves by βΔt a step turns by 2βΔt: 5° of tilt at β = 0.05 1/s are gone after 0.87 s."""
    q = np.tile(quat_from_euler_zyx([0.3, 0.0, 0.0]), (120, 1))
    data = ImuData(t=np.arange(120) / 100.0, gyr=np.zeros((120, 3)), acc=seen_by(q, frame)["acc"])
    start = quat_multiply(q[0], quat_from_euler_zyx([0.0, math.radians(5.0), 0.0]))
    track = Filter("madgwick", frame=frame, init=start, params={"beta": 0.05}).process(data)
    error = np.degrees(quat_angle(track.q_nb, q))
    # sample 0 has no step, so 50 steps have passed at sample 50; 1 % for the chord of the sphere
    assert error[50] == pytest.approx(5.0 - math.degrees(2 * 0.05 * 0.5), rel=0.01)
    assert error[110:].max() < math.degrees(2 * 0.05 * 0.01)  # it never rests


def test_the_bias_is_learned_when_asked_for():
    bias = np.radians([0.5, -0.3, 0.2])
    q = np.tile(quat_from_euler_zyx([0.5, 0.1, -0.2]), (60_000, 1))
    data = ImuData(t=np.arange(60_000) / 100.0, gyr=np.tile(bias, (60_000, 1)), **seen_by(q, Frame.ENU))
    track = Filter("madgwick", frame=Frame.ENU, params={"beta": 0.05, "zeta": 0.002}).process(data)
    assert np.abs(track.bias_b[-1000:].mean(axis=0) - bias).max() < 0.05 * np.linalg.norm(bias)
    off = Filter("madgwick", frame=Frame.ENU, params={"beta": 0.05}).process(data)
    assert not off.bias_b.any()
