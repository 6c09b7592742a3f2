"""Truth: rates against the attitude, accelerations against the position, and the signs of the vocabulary page."""

import numpy as np
import pytest

from plumbob.core.constants import G0
from plumbob.rotations import Frame, quat_conjugate, quat_from_rotvec, quat_multiply, quat_rotate, rotvec_from_quat
from plumbob.simulation import ConingMotion, EulerMotion, GimbalMotion, PoseMotion, Truth
from plumbob.simulation.signals import Sinusoids, constant

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


def rate_by_differences(motion, t, h):
    before, after = motion.truth(t - h).q_nb, motion.truth(t + h).q_nb
    return rotvec_from_quat(quat_multiply(quat_conjugate(before), after)) / (2.0 * h)


@pytest.mark.parametrize("name", MOTIONS)
def test_rate_is_that_of_the_attitude_and_derivatives_of_rate_position_and_velocity(name, closes_in):
    motion = MOTIONS[name]
    exact = motion.truth(T).rate_b
    wide, narrow = (np.max(np.abs(rate_by_differences(motion, T, h) - exact)) for h in (2e-3, 1e-3))
    assert wide < 0.01 * np.max(np.abs(exact))
    assert 3.5 < wide / narrow < 4.5  # a central difference is of second order
    truth = MOTIONS[name].truth
    closes_in(lambda t: truth(t).rate_b, lambda t: truth(t).rate_dot_b, T)
    closes_in(lambda t: truth(t).pos_n, lambda t: truth(t).vel_n, T)
    closes_in(lambda t: truth(t).vel_n, lambda t: truth(t).acc_n, T)


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
