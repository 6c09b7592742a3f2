"""Programs of joint angles: limits are kept, and reached where nothing else holds the time."""

import numpy as np
import pytest

from plumbob.data.chain import Limits
from plumbob.simulation import CHAINS, waypoints
from plumbob.simulation.programs import move_times


def peaks(program, k):
    t = np.linspace(0.0, program.duration, 200_001)
    _, rate, acc = (part[:, k] for part in program.angles.at(t))
    return np.abs(rate).max(), np.abs(acc).max(), np.abs(np.gradient(acc, t)).max()


@pytest.mark.parametrize("which", range(3))
def test_the_tightest_limit_is_reached_and_not_passed(which):
    chain = CHAINS["teach"]
    numbers = [1e3, 1e3, 1e3]
    numbers[which] = 2.0
    limits = (Limits(-9, 9, *numbers),) * 6
    steps = np.zeros((1, 6))
    steps[0, 2] = 1.5
    time = move_times(steps, limits, speed=1e3)
    # peaks of 10u³ − 15u⁴ + 6u⁵ by differentiation: 15/8, 10/√3, 60
    closed = (15.0 / 8.0 * 1.5 / 2.0, np.sqrt(10.0 / np.sqrt(3.0) * 1.5 / 2.0), np.cbrt(60.0 * 1.5 / 2.0))
    assert time == pytest.approx([closed[which]])
    made = waypoints(chain, np.vstack((np.zeros(6), steps)), dwell=0.0, speed=0.5)
    assert peaks(made, 2)[0] == pytest.approx(0.5, rel=1e-6)


def test_waypoints_are_reached_with_their_stops():
    chain = CHAINS["teach"]
    poses = np.deg2rad([[0, 0, 0, 0, 0, 0], [40, 20, -30, 10, 50, -90], [-20, 0, 60, 0, 0, 0]])
    made = waypoints(chain, poses, dwell=(1.0, 0.5, 2.0))
    for pose, (start, end), long in zip(poses, made.stops, (1.0, 0.5, 2.0), strict=True):
        assert end - start == pytest.approx(long)
        jet = made.angles.at(np.array([start, 0.5 * (start + end), end]))
        np.testing.assert_allclose(jet.value, np.tile(pose, (3, 1)), atol=1e-12)
        np.testing.assert_allclose(jet.rate, 0.0, atol=1e-9)
    assert made.duration == made.stops[-1][1]
