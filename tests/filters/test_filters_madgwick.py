"""The 2010 report's filter: its gradient, its speed and its bias."""

import math

import numpy as np
import pytest

from plumbob import Filter, Frame, ImuData
from plumbob.filters.madgwick import gradient
from plumbob.rotations import quat_angle, quat_from_euler_zyx, quat_from_rotvec, quat_multiply
from tests.helpers.motion import seen_by


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
    """[Madgwick2010] (21), (22): half of d/dq ½|seen(q, d) − s|², without the common factor 2; central differences."""
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


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_bias_moves_at_twice_zeta_towards_what_explains_the_error(axis, sign):
    """[Madgwick2010] (47), (48): a unit quaternion's turn is twice its change, so the bias grows by 2ζΔt a step.

    The gyroscope says zero and the attitude stands 5° too far about an axis of the body, as after a positive rate that
    is none: a positive bias. Of the gradient's unit length the part along q, which turns nothing, is below
    1 − cos 5° = 0.4 %. At β = 0 the error stays.
    """
    count, turn = 21, np.zeros(3)
    turn[axis] = sign * math.radians(5.0)
    data = ImuData(
        t=np.arange(count) / 100.0,
        gyr=1e-12 * np.random.default_rng(0).normal(size=(count, 3)),
        acc=seen_by(np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)), Frame.ENU)["acc"],
    )
    f = Filter("madgwick", frame=Frame.ENU, init=quat_from_rotvec(turn), params={"beta": 0.0, "zeta": 0.002})
    learned = f.process(data).bias_b[-1]
    assert not Filter("madgwick", frame=Frame.ENU, init=quat_from_rotvec(turn)).process(data).bias_b.any()
    assert learned[axis] == pytest.approx(sign * 2.0 * 0.002 * 0.01 * (count - 1), rel=0.005)
    assert np.abs(np.delete(learned, axis)).max() < 1e-3 * abs(learned[axis])
