"""Scenarios: each moves as its parameters say, and as the page of figures of its paper says."""

import math
from inspect import signature

import numpy as np
import pytest
from scipy.signal import welch
from scipy.special import j1

from plumbob.core.constants import G0
from plumbob.core.errors import ParameterError
from plumbob.core.params import describe
from plumbob.core.units import Quantity, deg, g
from plumbob.rotations import (
    Frame,
    euler_zyx_from_quat,
    quat_angle,
    quat_conjugate,
    quat_from_euler_zyx,
    quat_multiply,
    rotvec_from_quat,
)
from plumbob.simulation import SCENARIOS, GimbalMotion, PoseMotion, scenario, simulate
from plumbob.simulation.errors import stream
from plumbob.simulation.signals import constant

DEG = math.pi / 180.0


def truth(name, t, seed=1, duration=None, **parameters):
    plan = scenario(name, **parameters)
    return plan.motion(stream(seed, "scenario"), duration or plan.duration).truth(np.asarray(t))


def angles(body):
    return euler_zyx_from_quat(body.q_nb)


def grid(name, **parameters):
    plan = scenario(name, **parameters)
    return np.arange(round(plan.duration * plan.rate)) / plan.rate


BUSY = {"static": {"pitch": 0.3, "roll": -0.4, "heading": 1.0}, "turntable": {"radius": 0.3}, "rod": {"lead": 0.0}}


def by_differences(name, t, h, extra):
    """Rate, velocity and acceleration by central differences of attitude, position and velocity."""
    before, after = truth(name, t - h, **extra), truth(name, t + h, **extra)
    turned = rotvec_from_quat(quat_multiply(quat_conjugate(before.q_nb), after.q_nb))
    return (x / (2.0 * h) for x in (turned, after.pos_n - before.pos_n, after.vel_n - before.vel_n))


@pytest.mark.parametrize("name", SCENARIOS)
def test_rates_and_accelerations_belong_to_the_motion(name):
    extra = BUSY.get(name, {})
    t = np.random.default_rng(2).uniform(0.5, scenario(name, **extra).duration - 0.5, 300)
    body = truth(name, t, **extra)
    wide, narrow = (
        [np.abs(x - exact).max() for x, exact in zip(by_differences(name, t, h, extra), states, strict=True)]
        for h, states in ((h, (body.rate_b, body.vel_n, body.acc_n)) for h in (1e-3, 5e-4))
    )
    for a, b in zip(wide, narrow, strict=True):
        # second order divides by four, and still by two where an acceleration has a kink; exact to the rounding of a
        # heading of 100 rad over the step, 1e-14 / 1e-3
        assert b < 0.6 * a or b < 1e-9
        assert a < 0.05


@pytest.mark.parametrize("name", SCENARIOS)
def test_parameters_are_told_with_unit_domain_and_meaning_and_none_is_hidden_by_the_simulation(name):
    assert describe(SCENARIOS[name])
    for p in describe(SCENARIOS[name]):
        assert isinstance(p.spec.quantity, Quantity)
        assert p.spec.low <= p.default <= p.spec.high
        assert p.spec.meaning
    assert not {p.name for p in describe(SCENARIOS[name])} & set(signature(simulate).parameters)


def test_static_is_at_rest_coning_goes_round_and_every_scenario_is_told_in_ned():
    body = truth("static", [0.0, 9.0], heading=2.0, pitch=-0.3, roll=0.5)
    np.testing.assert_allclose(angles(body), [[2.0, -0.3, 0.5]] * 2, atol=1e-14)
    assert not body.rate_b.any() and not body.acc_n.any()
    body = truth("coning", [0.0, 0.25, 0.5], half_angle=0.2, frequency=1.0)
    # half angle of the rotation vector about north, then east, then south (frame NED)
    np.testing.assert_allclose(rotvec_from_quat(body.q_nb), [[0.2, 0, 0], [0, 0.2, 0], [-0.2, 0, 0]], atol=1e-15)
    for name in SCENARIOS:
        assert truth(name, [0.0, 1.0]).frame is Frame.NED


def test_turntable_is_the_gyroscope_paper_s_and_may_rest_before_it_starts():
    # page of the gyroscope paper: 0 to 60 °/s at 0.6 °/s² in 100 s, 1000 points, then 60 °/s for 100 s, 1000 points
    t = grid("turntable")
    rate = truth("turntable", t).rate_b
    assert t.size == 2000
    np.testing.assert_allclose(rate[:1000, 2], 0.6 * DEG * t[:1000], atol=1e-12)
    np.testing.assert_allclose(rate[1000:, 2], 60.0 * DEG, atol=1e-12)
    assert not rate[:, :2].any()
    # angle: the area under the rate, 3000° in the ramp
    yaw = np.unwrap(angles(truth("turntable", np.arange(0.0, 100.5, 0.5)))[:, 0])
    assert yaw[200] / DEG == pytest.approx(3000.0, rel=1e-12)
    t = np.array([0.0, 9.9, 60.0, 110.0, 200.0])
    rate = truth("turntable", t, lead=10.0).rate_b[:, 2]
    np.testing.assert_allclose(rate / DEG, [0.0, 0.0, 30.0, 60.0, 60.0], atol=1e-12)
    assert scenario("turntable", lead="10 s").duration == 210.0


def test_the_ball_rolls_about_its_own_axis_while_that_leans():
    """In one lean to and fro of 50 s it rolls round 8 1/3 times at 60 °/s; its track reaches 30° to its x axis."""
    t = np.arange(0.0, 100.0, 0.05)
    body = truth("ball", t, lead=0.0)
    down_b = body.in_body([0.0, 0.0, 1.0])
    assert math.degrees(np.arcsin(np.abs(down_b[:, 0]).max())) == pytest.approx(60.0, abs=0.1)
    np.testing.assert_allclose(body.rate_b[t > 5.0, 0] / DEG, 60.0, atol=1e-12)
    assert not truth("ball", [0.0, 3.0], lead=4.0).rate_b.any()


def test_ratetable_spins_each_face_both_ways_about_the_vertical():
    plan = scenario("ratetable", peak_rate="80 deg/s", hold="4 s", ramp="1 s", remount="3 s")
    # a face: 4 s at rest, six times ramp and hold, a ramp to rest; then it is turned to the next
    face = 4.0 + 6.0 * (1.0 + 4.0) + 1.0
    assert plan.duration == 6.0 * face + 5.0 * 3.0
    starts = np.arange(6) * (face + 3.0)
    middles = np.concatenate(([2.0], 7.0 + 5.0 * np.arange(6)))
    body = truth(
        "ratetable", (starts[:, np.newaxis] + middles).ravel(), peak_rate=80.0 * DEG, hold=4.0, ramp=1.0, remount=3.0
    )
    up = (body.specific_force_b / G0).reshape(6, 7, 3)
    np.testing.assert_allclose(np.abs(up).max(axis=2), 1.0, rtol=0, atol=1e-15)
    assert {tuple(np.rint(face[0]).astype(int)) for face in up} == {
        tuple(sign * row) for row in np.eye(3, dtype=int) for sign in (1, -1)
    }
    about_up = (body.rate_b.reshape(6, 7, 3) * up).sum(axis=2) / DEG
    # clockwise from above is negative about up
    np.testing.assert_allclose(about_up, [[0.0, -20.0, -40.0, -80.0, 80.0, 40.0, 20.0]] * 6, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(body.rate_b, axis=1), np.abs(about_up).ravel() * DEG, atol=1e-14)


@pytest.mark.parametrize(("speed", "stroke"), [(2.0, 0.4), (3.0, 0.8), (2.0, 0.8), (1.0, 0.6)])
def test_slide_has_the_four_stroke_sets_of_the_buoy_paper(speed, stroke):
    t = np.linspace(0.0, scenario("slide", peak_speed=speed, stroke=stroke).duration, 40_001)
    body = truth("slide", t, peak_speed=speed, stroke=stroke)
    spacing = t[1]
    velocity, acceleration = np.linalg.norm(body.vel_n, axis=1), np.linalg.norm(body.acc_n, axis=1)
    # closed form of a stroke v/2 (1 − cos 2πt/T): peaks v and πv/T, which the grid misses by (π dt/T)²/2 at most
    miss = 0.5 * (2.0 * math.pi * spacing / stroke) ** 2
    assert velocity.max() == pytest.approx(speed, rel=miss)
    assert acceleration.max() == pytest.approx(math.pi * speed / stroke, rel=miss)
    assert not angles(body).any()  # level throughout
    assert not body.acc_n[:, 2].any()
    np.testing.assert_allclose(body.pos_n[-1], 0.0, atol=1e-12)  # as many strokes back as forth


def test_slide_moves_obliquely_to_the_body_s_axes():
    body = truth("slide", np.linspace(10.0, 10.4, 101), heading=1.0, direction=0.6)
    force = body.specific_force_b
    np.testing.assert_allclose(force[:, 1], math.tan(0.6) * force[:, 0], atol=1e-12)
    assert np.abs(force[:, 1]).max() > 5.0


@pytest.mark.parametrize("seed", range(3))
def test_buoy_accelerates_as_the_buoy_paper_s_page_says(seed):
    t = np.arange(0.0, 600.0, 0.1)
    body = truth("buoy", t, seed)
    rms_g = np.sqrt(np.mean(body.acc_n**2, axis=0)) / G0
    assert (rms_g > 0.03).all()  # page: 0.03 to 0.07 g rms in a sea of 1.5 m and 6 s
    assert (rms_g < 0.07).all()
    # page: accelerometer alone wrong by 3.05°/2.64° rms; here at least by what the accelerations say, and far less than
    # the tilt would be if tilt and way cancelled
    f = body.specific_force_b
    roll = np.arctan2(-f[:, 1], -f[:, 2])
    error = np.sqrt(np.mean((roll - angles(body)[:, 2]) ** 2)) / DEG
    assert 1.5 < error < 4.0


def test_buoy_that_follows_the_water_feels_no_force_along_its_deck_and_its_yaw_wanders_as_asked():
    small = {"height": 1e-3, "way_period": 0.0, "tilt_period": 0.0, "yaw_wander": 0.0, "heading": 0.7}
    force = truth("buoy", np.arange(0.0, 100.0, 0.1), **small).specific_force_b
    # free surface: the force is along its normal; what remains is of second order in the slope, 1e-4 squared
    assert np.abs(force[:, :2]).max() / G0 < 1e-6
    tilt = angles(truth("buoy", np.arange(0.0, 100.0, 0.1), **small))[:, 1:]
    assert np.abs(tilt).max() > 1e-4
    t = np.arange(0.0, 20_000.0, 2.0)
    yaw = angles(truth("buoy", t, height=0.0, yaw_wander=0.2, heading=0.5))[:, 0]
    # five incommensurate sinusoids: rms as asked, mixing by a few parts in their hundreds of periods
    assert (yaw.std(), yaw.mean()) == (pytest.approx(0.2, rel=0.03), pytest.approx(0.5, abs=0.01))


def test_rod_keeps_to_its_limits_moves_and_rests_and_carries_its_sensors_at_the_lever():
    euler = angles(truth("rod", np.arange(0.0, 600.0, 0.1))) / DEG
    assert np.abs(euler[:, 2]).max() <= 20.0 + 1e-9  # page of the rod paper: ±20/±15°
    assert np.abs(euler[:, 1]).max() <= 15.0 + 1e-9 and np.abs(euler[:, 2]).max() > 15.0
    assert np.abs(euler[:, 1]).max() > 11.0
    t = np.arange(0.0, 400.0, 0.05)
    turning = np.abs(truth("rod", t).rate_b).max(axis=1) > 0.0
    edges = np.flatnonzero(np.diff(turning.astype(int)))
    assert t[edges[0]] == pytest.approx(5.0, abs=0.1)  # rest before the first move
    moves = np.diff(t[edges])[::2]
    assert moves.min() > 1.4  # page: moves of 1.5 to 4 s; a rest too short for the grid joins two
    assert np.median(moves) < 4.0
    t = np.array([30.0, 31.0, 32.0])
    low, high = truth("rod", t, lever=0.0), truth("rod", t, lever=0.5)
    np.testing.assert_allclose(np.linalg.norm(high.pos_n - low.pos_n, axis=1), 0.5, rtol=1e-12)
    assert (high.pos_n[:, 2] < -0.45).all()  # above the foot: down is positive


def test_rod_vibrates_from_400_s_on_as_strongly_as_said():
    still = {"roll_limit": 0.0, "pitch_limit": 0.0}
    t = np.arange(0.0, 600.0, 0.01)
    acc = truth("rod", t, **still).acc_n
    assert not acc[t < 400.0].any()
    late = acc[t > 402.0]
    # page: 0.08 g rms, 3 to 20 Hz; forty lines each 0.4 Hz apart mix by parts in their 80 beats
    np.testing.assert_allclose(np.sqrt(np.mean(late**2, axis=0)), g(0.08), rtol=0.03)
    f, power = welch(late, fs=100.0, nperseg=2000, axis=0)
    inside = (f > 2.9) & (f < 20.1)
    assert power[~inside].sum() < 0.01 * power.sum()


def test_fin_turns_as_the_fin_paper_s_page_says_and_at_one_hertz_exceeds_the_adxrs290():
    duration, swing, twist, omega = 220.0, 30.0 * DEG, 20.0 * DEG, math.pi
    t = np.arange(110_000) / 500.0
    total = truth("fin", t).rate_b.sum(axis=0) / 500.0
    # closed form over whole periods: the mean of ψ' sin φ and ψ' cos φ with φ = B (1 − cos) is a Bessel function
    mean = swing * omega * j1(twist) * duration
    np.testing.assert_allclose(total, [0.0, -mean * math.cos(twist), mean * math.sin(twist)], atol=1e-9)
    # page: integrating each rate by itself is wrong by 3351° in pitch and 1219° in yaw after 220 s
    np.testing.assert_allclose(np.abs(total[1:]) / DEG, [3351.0, 1219.0], rtol=1e-3)
    t = np.arange(0.0, 2.0, 0.001)
    peak = np.abs(truth("fin", t, frequency=1.0).rate_b).max(axis=0) / DEG
    np.testing.assert_allclose(peak[:2], [126.0, 121.0], atol=0.5)  # page: 126/121 °/s on x/y


def test_arm_turns_as_the_arm_paper_says():
    # page of the teaching-arm paper: heading 0 to −90° uniformly in 30 s, Ts = 0.1 s
    t = grid("arm")
    assert t.size == 300
    body = truth("arm", t)
    np.testing.assert_allclose(angles(body) / DEG, np.outer(-3.0 * t, [1.0, 0.0, 0.0]), atol=1e-12)
    np.testing.assert_allclose(body.rate_b / DEG, np.tile([0.0, 0.0, -3.0], (300, 1)), atol=1e-12)
    assert not body.acc_n.any()


@pytest.mark.parametrize("name", ["buoy", "rod"])
def test_chance_is_the_seed_s(name):
    t = np.linspace(0.0, 50.0, 100)
    np.testing.assert_array_equal(truth(name, t, 3).q_nb, truth(name, t, 3).q_nb)
    assert np.abs(truth(name, t, 3).q_nb - truth(name, t, 4).q_nb).max() > 1e-3


def test_a_longer_rod_record_begins_like_a_shorter_one():
    t = np.linspace(0.0, 50.0, 100)
    np.testing.assert_array_equal(truth("rod", t, duration=60.0).q_nb, truth("rod", t, duration=600.0).q_nb)


DOWN = np.array([0.0, 0.0, 1.0])


def capture_truth(name, t=None, seed=1, **parameters):
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
    np.testing.assert_allclose(capture_truth("raise").rate_b[:, [0, 2]], 0.0, atol=1e-15)


@pytest.mark.parametrize(("along_roll", "banded", "span"), [(False, 1, np.pi), (True, 2, 2.0 * np.pi)])
def test_bands_fill_every_region_once(along_roll, banded, span):
    angles = euler_zyx_from_quat(attitudes("bands", along_roll=along_roll))
    sector = np.floor((angles[:, 0] + np.pi) / (np.pi / 3.0))
    band = np.floor((angles[:, banded] + 0.5 * span) / (span / 3.0))
    assert sorted(6 * band + sector) == list(range(18))


@pytest.mark.parametrize("limit", [15.0, 25.0, 180.0])
def test_tumble_keeps_its_limit_and_reaches_it(limit):
    leaning = tilt(capture_truth("tumble", tilt_limit=deg(limit)))
    assert leaning.max() <= deg(limit) + 1e-9
    assert leaning.max() == pytest.approx(deg(limit), abs=1e-3)
    assert leaning[0] < 1e-7


def test_tumble_sees_every_octant_sway_reaches_its_limit_and_a_level_ring_goes_round():
    body = capture_truth("tumble")
    for vector in (-DOWN, np.array([1.0, 0.0, 0.0])):
        octants = (body.in_body(vector) > 0.0) @ [1, 2, 4]
        assert np.bincount(octants, minlength=8).min() > 0.04 * octants.size  # an eighth is 0.125
    assert np.linalg.norm(body.rate_b, axis=1).max() < deg(180.0)  # slow enough for a hand and any gyroscope
    angles = euler_zyx_from_quat(capture_truth("sway", limit=deg(15.0)).q_nb)
    np.testing.assert_allclose(np.abs(angles[:, 1:]).max(axis=0), deg(15.0), rtol=1e-4)
    assert np.unwrap(angles[:, 0])[-1] - angles[0, 0] == pytest.approx(8.0 * np.pi, rel=1e-9)
    body = capture_truth("levelring", wobble=deg(1.0))
    assert tilt(body).max() <= np.hypot(deg(1.0), deg(1.0))
    heading = np.unwrap(euler_zyx_from_quat(body.q_nb)[:, 0])
    assert heading[-1] - heading[0] == pytest.approx(4.0 * np.pi, abs=deg(0.1))


def test_cone_turns_about_the_vertical_or_a_slant_axis_and_table36_rests_36_times_on_its_slant():
    fixed, table = (capture_truth("cone", wobble=0.0, table=table) for table in (False, True))
    for body in (fixed, table):
        np.testing.assert_allclose(tilt(body), deg(15.0), atol=1e-7)
    assert np.ptp(up_in_body(fixed), axis=0).max() < 1e-12  # gravity stands still in the body
    assert np.ptp(up_in_body(table), axis=0)[:2] == pytest.approx([2.0 * np.sin(deg(15.0))] * 2, rel=1e-4)
    middle = 1.5 + 4.0 * np.arange(36)
    body = capture_truth("table36", middle)
    assert not body.rate_b.any()
    np.testing.assert_allclose(tilt(body), deg(20.0), atol=1e-7)
    step = quat_angle(body.q_nb[:-1], body.q_nb[1:])
    np.testing.assert_allclose(step, deg(10.0), atol=1e-12)
    roll, pitch = np.abs(euler_zyx_from_quat(body.q_nb)[:, [2, 1]]).max(axis=0)
    assert [roll, pitch] == pytest.approx([deg(20.0)] * 2, abs=1e-9)  # every tilt between the axes is seen
    assert scenario("table36").duration == 36 * 3 + 35 * 1
