"""Scenarios of captures: the directions that they show, what restricts them, and the table of the static test."""

import numpy as np
import pytest

from plumbob.core.errors import ParameterError
from plumbob.core.units import deg
from plumbob.rotations import Frame, euler_zyx_from_quat, quat_angle, quat_from_euler_zyx
from plumbob.simulation import GimbalMotion, PoseMotion, scenario
from plumbob.simulation.signals import constant

DOWN = np.array([0.0, 0.0, 1.0])


def truth(name, t=None, seed=1, **parameters):
    plan = scenario(name, **parameters)
    times = np.linspace(0.0, plan.duration, 4001) if t is None else np.asarray(t)
    return plan.motion(np.random.default_rng(seed), plan.duration).truth(times)


def attitudes(name, seed=1, **parameters):
    return scenario(name, **parameters).attitudes(np.random.default_rng(seed))


def up_in_body(body):
    return body.in_body(-DOWN)


def tilt(body):
    return np.arccos(np.clip(up_in_body(body) @ -DOWN, -1.0, 1.0))


def test_a_pose_motion_rests_in_each_pose_and_gimbals_are_euler_angles():
    poses = quat_from_euler_zyx(np.array([[0.0, 0.0, 0.0], [1.0, 0.4, -0.3], [-2.0, 0.1, 0.8]]))
    motion = PoseMotion(Frame.NED, poses, dwell=2.0, move=0.5)
    rests = np.array([0.0, 1.9, 2.6, 4.4, 5.1, 99.0])
    at_rest = motion.truth(rests)
    np.testing.assert_allclose(quat_angle(at_rest.q_nb, poses[[0, 0, 1, 1, 2, 2]]), 0.0, atol=4e-8)  # √eps of an angle
    assert not at_rest.rate_b.any()
    between = motion.truth(np.linspace(2.0, 2.5, 101))
    whole = float(quat_angle(poses[0], poses[1]))
    peak = 15.0 / 8.0 * whole / 0.5  # of the quintic, 30 u² (1 − u)² at u = 1/2
    assert np.linalg.norm(between.rate_b, axis=1).max() == pytest.approx(peak, rel=1e-12)
    angles = (0.7, -0.4, 1.9)
    motion = GimbalMotion(Frame.NED, tuple(zip((2, 1, 0), map(constant, angles), strict=True)))
    np.testing.assert_allclose(euler_zyx_from_quat(motion.truth(np.zeros(1)).q_nb), [angles], atol=1e-15)


@pytest.mark.parametrize("edges", [False, True])
def test_faces_and_edges_come_up_once_each(edges):
    up = PoseMotion(Frame.NED, attitudes("faces", edges=edges, wobble=0.0), 1.0, 1.0)
    seen = up_in_body(up.truth(2.0 * np.arange(18 if edges else 6)))
    number = np.count_nonzero(np.abs(seen) > 1e-9, axis=1)
    assert sorted(number) == [1] * 6 + [2] * (12 if edges else 0)
    assert np.unique(np.round(seen, 9), axis=0).shape == seen.shape  # no direction twice
    np.testing.assert_allclose(np.abs(seen).max(axis=1), 1.0 / np.sqrt(number), atol=1e-12)


def test_wobble_of_a_hand_poses_by_hand_and_a_raised_nose():
    one = attitudes("faces", edges=True, wobble=0.0)
    off = quat_angle(attitudes("faces", edges=True, wobble=deg(2.0)), one)
    # the seed draws the headings first, so that both sets differ by the wobble alone; 3 axes, 18 poses: 54 squares,
    # whose mean has a relative sd of √(2/54) = 0.19
    assert np.mean(np.square(off)) / (3.0 * deg(2.0) ** 2) == pytest.approx(1.0, abs=4 * 0.19)
    poses = attitudes("poses", number=2000)
    # of a uniform rotation each component of the quaternion has mean 0 and variance 1/4
    assert np.abs(poses.mean(axis=0)).max() < 4 * 0.5 / np.sqrt(2000)
    np.testing.assert_allclose(np.linalg.norm(poses, axis=1), 1.0, atol=4e-16)
    with pytest.raises(ParameterError, match="whole number"):
        scenario("poses", number=2.5)
    level, raised = euler_zyx_from_quat(attitudes("raise", angle=deg(25.0)))
    np.testing.assert_allclose(level[1:], 0.0, atol=1e-15)
    np.testing.assert_allclose(raised, [level[0], deg(25.0), 0.0], atol=1e-15)
    np.testing.assert_allclose(truth("raise").rate_b[:, [0, 2]], 0.0, atol=1e-15)


@pytest.mark.parametrize(("along_roll", "banded", "span"), [(False, 1, np.pi), (True, 2, 2.0 * np.pi)])
def test_bands_fill_every_region_once(along_roll, banded, span):
    angles = euler_zyx_from_quat(attitudes("bands", along_roll=along_roll))
    sector = np.floor((angles[:, 0] + np.pi) / (np.pi / 3.0))
    band = np.floor((angles[:, banded] + 0.5 * span) / (span / 3.0))
    assert sorted(6 * band + sector) == list(range(18))


@pytest.mark.parametrize("limit", [15.0, 25.0, 180.0])
def test_tumble_keeps_its_limit_and_reaches_it(limit):
    leaning = tilt(truth("tumble", tilt_limit=deg(limit)))
    assert leaning.max() <= deg(limit) + 1e-9
    assert leaning.max() == pytest.approx(deg(limit), abs=1e-3)
    assert leaning[0] < 1e-7


def test_tumble_sees_every_octant_sway_reaches_its_limit_and_a_level_ring_goes_round():
    body = truth("tumble")
    for vector in (-DOWN, np.array([1.0, 0.0, 0.0])):
        octants = (body.in_body(vector) > 0.0) @ [1, 2, 4]
        assert np.bincount(octants, minlength=8).min() > 0.04 * octants.size  # an eighth is 0.125
    assert np.linalg.norm(body.rate_b, axis=1).max() < deg(180.0)  # slow enough for a hand and any gyroscope
    angles = euler_zyx_from_quat(truth("sway", limit=deg(15.0)).q_nb)
    np.testing.assert_allclose(np.abs(angles[:, 1:]).max(axis=0), deg(15.0), rtol=1e-4)
    assert np.unwrap(angles[:, 0])[-1] - angles[0, 0] == pytest.approx(8.0 * np.pi, rel=1e-9)
    body = truth("levelring", wobble=deg(1.0))
    assert tilt(body).max() <= np.hypot(deg(1.0), deg(1.0))
    heading = np.unwrap(euler_zyx_from_quat(body.q_nb)[:, 0])
    assert heading[-1] - heading[0] == pytest.approx(4.0 * np.pi, abs=deg(0.1))


def test_cone_turns_about_the_vertical_or_a_slant_axis_and_table36_rests_36_times_on_its_slant():
    fixed, table = (truth("cone", wobble=0.0, table=table) for table in (False, True))
    for body in (fixed, table):
        np.testing.assert_allclose(tilt(body), deg(15.0), atol=1e-7)
    assert np.ptp(up_in_body(fixed), axis=0).max() < 1e-12  # gravity stands still in the body
    assert np.ptp(up_in_body(table), axis=0)[:2] == pytest.approx([2.0 * np.sin(deg(15.0))] * 2, rel=1e-4)
    middle = 1.5 + 4.0 * np.arange(36)
    body = truth("table36", middle)
    assert not body.rate_b.any()
    np.testing.assert_allclose(tilt(body), deg(20.0), atol=1e-7)
    step = quat_angle(body.q_nb[:-1], body.q_nb[1:])
    np.testing.assert_allclose(step, deg(10.0), atol=1e-12)
    roll, pitch = np.abs(euler_zyx_from_quat(body.q_nb)[:, [2, 1]]).max(axis=0)
    assert [roll, pitch] == pytest.approx([deg(20.0)] * 2, abs=1e-9)  # every tilt between the axes is seen
    assert scenario("table36").duration == 36 * 3 + 35 * 1
