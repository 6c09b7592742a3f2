"""Motions: attitudes, rates and positions belong together, on one time line, in programs and beside a field."""

import math

import numpy as np
import pytest

from plumbob.core.constants import G0
from plumbob.core.errors import ParameterError
from plumbob.core.units import deg
from plumbob.data.chain import Limits
from plumbob.rotations import (
    Frame,
    euler_zyx_from_quat,
    quat_angle,
    quat_from_euler_zyx,
    quat_from_rotvec,
    quat_rotate,
)
from plumbob.simulation import (
    CHAINS,
    ConingMotion,
    EulerMotion,
    GimbalMotion,
    PoseMotion,
    Truth,
    earth_field,
    waypoints,
)
from plumbob.simulation.errors import AttitudeErrors
from plumbob.simulation.programs import move_times
from plumbob.simulation.signals import Sinusoids, constant
from plumbob.simulation.simulation import arrivals, time_line

FRAMES = list(Frame)
T = np.linspace(0.1, 7.3, 150)
LEVER = (0.3, -0.2, 0.5)


def lively(frame, lever=LEVER, seed=3):
    rng = np.random.default_rng(seed)
    angles = Sinusoids(rng.uniform(0.5, 6.0, 5), rng.normal(size=(5, 3)) * 0.3, rng.normal(size=(5, 3)) * 0.3)
    place = Sinusoids(rng.uniform(0.5, 6.0, 5), rng.normal(size=(5, 3)), rng.normal(size=(5, 3)))
    return EulerMotion(frame, angles, place, lever)


def posed(frame, seed=4):
    poses = np.random.default_rng(seed).normal(size=(6, 4))
    # between rest and move the third derivative of the angle jumps; these times keep every instant of T 2.6 ms off
    return PoseMotion(frame, poses / np.linalg.norm(poses, axis=1, keepdims=True), dwell=0.33, move=1.1)


def gimballed(frame, seed=5):
    rng = np.random.default_rng(seed)
    angles = [Sinusoids(rng.uniform(0.5, 3.0, 3), rng.normal(size=3), rng.normal(size=3)) for _ in range(4)]
    return GimbalMotion(frame, tuple(zip((2, 0, 1, 2), angles, strict=True)))


MOTIONS = (
    {f"euler {frame}": lively(frame) for frame in FRAMES}
    | {f"coning {frame}": ConingMotion(frame, 0.4, 5.0) for frame in FRAMES}
    | {"poses": posed(Frame.NED), "gimbals": gimballed(Frame.NED)}
)


@pytest.mark.parametrize("name", MOTIONS)
def test_rate_is_that_of_the_attitude_and_derivatives_of_rate_position_and_velocity(name, moves_as_derived):
    moves_as_derived(MOTIONS[name].truth, T)


@pytest.mark.parametrize("frame", FRAMES)
def test_at_rest_specific_force_points_up_in_any_attitude(frame):
    attitude = constant((0.7, -0.4, 1.9))
    still = EulerMotion(frame, attitude).truth(T)
    np.testing.assert_allclose(
        quat_rotate(still.q_nb, still.specific_force_b), np.tile(G0 * frame.up, (T.size, 1)), atol=1e-14
    )
    assert not still.rate_b.any()


@pytest.mark.parametrize(("frame", "reading"), [(Frame.ENU, G0), (Frame.NWU, G0), (Frame.NED, -G0)])
def test_level_body_reads_as_the_vocabulary_page_says(frame, reading):
    level = EulerMotion(frame, constant((0.0, 0.0, 0.0))).truth(T[:1])
    np.testing.assert_array_equal(level.specific_force_b, [[0.0, 0.0, reading]])


@pytest.mark.parametrize("other", [Frame.ENU, Frame.NWU])
def test_another_frame_tells_the_same_motion(other):
    ned = lively(Frame.NED).truth(T)
    same = ned.in_frame(other)
    for direction in ("east", "north", "up"):  # components that both frames have by name
        a, b = getattr(Frame.NED, direction), getattr(other, direction)
        for name in ("pos_n", "vel_n", "acc_n"):
            np.testing.assert_allclose(getattr(same, name) @ b, getattr(ned, name) @ a, atol=1e-12)
        nose, top = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
        np.testing.assert_allclose(quat_rotate(same.q_nb, nose) @ b, quat_rotate(ned.q_nb, nose) @ a, atol=1e-14)
        np.testing.assert_allclose(quat_rotate(same.q_nb, top) @ b, quat_rotate(ned.q_nb, -top) @ a, atol=1e-14)
    # forward-right-down to forward-left-up: y and z change sign
    for name in ("rate_b", "rate_dot_b", "specific_force_b"):
        np.testing.assert_allclose(getattr(same, name), getattr(ned, name) * [1.0, -1.0, -1.0], atol=1e-12)


def test_coning_is_the_exponential_of_a_rotation_vector_that_goes_round_and_rows_keep_all_of_theirs():
    a, w = 0.4, 5.0
    cone = ConingMotion(Frame.NWU, a, w).truth(T)
    rotvec = a * np.stack((np.cos(w * T), np.sin(w * T), np.zeros(T.size)), axis=-1)
    np.testing.assert_allclose(cone.q_nb, quat_from_rotvec(rotvec), atol=1e-15)
    # closed form of the drift that an integrator of rates would see, −Ω (1 − cos a): the solid angle of the cone over
    # 2π per turn (Goodman and Robinson, 1958)
    np.testing.assert_allclose(cone.rate_b[:, 2], -w * (1.0 - np.cos(a)), rtol=1e-14)
    np.testing.assert_allclose(np.hypot(*cone.rate_b.T[:2]), w * np.sin(a), rtol=1e-14)
    truth = lively(Frame.ENU).truth(T)
    some = truth.rows(T > 4.0)
    assert isinstance(some, Truth)
    np.testing.assert_array_equal(some.t, T[T > 4.0])
    np.testing.assert_array_equal(some.acc_n, truth.acc_n[T > 4.0])
    assert some.frame is Frame.ENU


RATE, COUNT, RUNS = 10.0, 1000, 400
ERRORS = AttitudeErrors(heading=deg(0.8), tilt=deg(0.2))
ANGLES = np.tile([0.5, -0.3, 0.2], (COUNT, 1))
STATED = deg(np.array([0.8, 0.2, 0.2]))


@pytest.fixture(scope="module")
def off():
    """Errors (runs, N, 3), rad."""
    q_nb = quat_from_euler_zyx(ANGLES)
    return np.array([ERRORS.said(q_nb, seed=seed, rate=RATE) for seed in range(RUNS)]) - ANGLES


def test_root_mean_square_over_runs_is_what_is_stated_half_of_it_varies_and_angles_are_independent(off):
    rms = np.sqrt((off[:, ::100] ** 2).mean(axis=(0, 1)))
    # half of the square is drawn once a run, half ten times a run: 4 standard deviations of the mean square
    allowed = 4.0 * math.sqrt(2.0 * (0.25 / RUNS + 0.25 / (10 * RUNS)))
    np.testing.assert_allclose(rms**2, STATED**2, rtol=allowed)
    first = np.sqrt((off[:, 0] ** 2).mean(axis=0))  # no settling: the first value has it already
    np.testing.assert_allclose(first**2, STATED**2, rtol=4.0 * math.sqrt(2.0 / RUNS))
    apart = np.array([0, 100, 500])  # 0, 10 and 50 s
    found = [((off[:, k:] - off[:, : COUNT - k]) ** 2).mean(axis=(0, 1)) for k in apart]
    expected = STATED**2 * (1.0 - np.exp(-apart / RATE / 10.0))[:, np.newaxis]  # 2 · half · (1 - exp(-Δt/time))
    np.testing.assert_allclose(found, expected, rtol=0.2)
    assert np.abs(np.corrcoef(off[:, 0].T) - np.eye(3)).max() < 4.0 / math.sqrt(RUNS)


def test_a_pitch_beyond_the_vertical_is_one_from_the_other_side_and_no_errors_say_the_truth():
    steep = np.tile([0.5, deg(89.99), 0.2], (COUNT, 1))
    said = ERRORS.said(quat_from_euler_zyx(steep), seed=2, rate=RATE)
    assert (np.abs(said[:, 1]) <= 0.5 * math.pi).all()
    assert quat_angle(quat_from_euler_zyx(said), quat_from_euler_zyx(steep)).max() < deg(8.0)
    q_nb = quat_from_euler_zyx(ANGLES)
    np.testing.assert_allclose(AttitudeErrors(0.0, 0.0).said(q_nb, seed=1, rate=RATE), ANGLES, atol=1e-12)
    np.testing.assert_array_equal(*(ERRORS.said(q_nb, seed=1, rate=RATE) for _ in range(2)))
    short = ERRORS.said(q_nb[:500], seed=1, rate=RATE)
    np.testing.assert_array_equal(short, ERRORS.said(q_nb, seed=1, rate=RATE)[:500])
    assert euler_zyx_from_quat(q_nb).shape == short.shape[:0] + (COUNT, 3)


def test_a_plain_line_is_even_to_the_nanosecond_and_stamps_scatter_by_the_jitter_in_their_order():
    line = time_line(rate=75.0, duration=4.0, seed=1)
    assert line.sampled.size == 300
    np.testing.assert_allclose(line.sampled, np.arange(300) / 75.0, atol=0.5e-9)
    np.testing.assert_array_equal(line.stamps, line.sampled)
    assert line.received.all()
    line = time_line(rate=100.0, duration=200.0, jitter=1e-3, seed=3)
    stray = line.stamps - line.sampled
    np.testing.assert_allclose(stray.std(), 1e-3, rtol=4.0 / np.sqrt(2.0 * stray.size))  # sd of n normal numbers
    assert (np.diff(line.stamps) > 0.0).all()
    assert np.abs(stray).max() <= 0.45 / 100.0 + 1e-9  # to the nanosecond
    assert line.stamps[0] >= 0.0


def test_lost_samples_are_their_share_by_a_stream_of_their_own():
    received = np.array([time_line(rate=100.0, duration=20.0, lost=0.3, seed=s).received for s in range(20)])
    assert received[:, 0].all()
    share = 1.0 - received[:, 1:].mean()
    assert share == pytest.approx(0.3, abs=4.0 * np.sqrt(0.3 * 0.7 / received[:, 1:].size))  # binomial
    alone = time_line(rate=100.0, duration=20.0, lost=0.3, seed=5).received
    both = time_line(rate=100.0, duration=20.0, lost=0.3, jitter=1e-3, seed=5).received
    np.testing.assert_array_equal(alone, both)


def test_a_slower_sensor_fills_the_next_row_and_another_every_row():
    # 75 Hz on 100 Hz: its samples 0, 13.3, 26.7, 40 ms arrive in rows 0, 2, 3, 4 (0, 20, 30, 40 ms)
    np.testing.assert_array_equal(arrivals(10, 100.0, 75.0), [0, 2, 3, 4, 6, 7, 8])
    np.testing.assert_array_equal(arrivals(10, 100.0, 20.0), [0, 5])
    np.testing.assert_array_equal(arrivals(5, 100.0, None), np.arange(5))
    np.testing.assert_array_equal(arrivals(5, 100.0, 220.0), np.arange(5))


@pytest.mark.parametrize("own", [0.7, 3.0, 33.3, 75.0, 99.9])
def test_rows_of_a_slower_sensor_keep_its_rate(own):
    rows = arrivals(20_000, 100.0, own)
    assert (np.diff(rows) > 0).all()
    due = np.arange(rows.size) / own
    late = rows / 100.0 - due
    assert late.min() >= -1e-9  # never before its instant
    assert late.max() < 0.01  # and always within one row


@pytest.mark.parametrize(
    "wrong",
    [{"rate": 0.0}, {"rate": np.nan}, {"duration": -1.0}, {"duration": 0.01}, {"duration": np.inf}, {"jitter": 0.002},
     {"jitter": -1e-9}, {"lost": 1.0}, {"lost": -0.1}, {"rate": 1e9}],
)  # fmt: skip
def test_impossible_lines_are_refused(wrong):
    with pytest.raises(ParameterError):
        time_line(**{"rate": 100.0, "duration": 10.0, "seed": 0, **wrong})


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("dip", [-1.2, 0.0, 0.9])
@pytest.mark.parametrize("declination", [-0.3, 0.0, 0.2])
def test_strength_dip_and_declination_come_back(frame, dip, declination):
    field = earth_field(frame, strength=48.0, dip=dip, declination=declination)
    east, north, up = (field @ getattr(frame, name) for name in ("east", "north", "up"))
    assert np.linalg.norm(field) == pytest.approx(48.0, rel=1e-14)
    assert math.atan2(-up, math.hypot(east, north)) == pytest.approx(dip, abs=1e-14)  # positive down
    assert math.atan2(east, north) == pytest.approx(declination, abs=1e-14)  # positive to the east


def peaks(program, k):
    t = np.linspace(0.0, program.duration, 200_001)
    _, rate, acc = (part[:, k] for part in program.angles.jet(t))
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
        jet = made.angles.jet(np.array([start, 0.5 * (start + end), end]))
        np.testing.assert_allclose(jet.value, np.tile(pose, (3, 1)), atol=1e-12)
        np.testing.assert_allclose(jet.rate, 0.0, atol=1e-9)
    assert made.duration == made.stops[-1][1]
