"""Mounting: a planted one comes back in every frame, within what is claimed; poses that do not tell it are refused."""

import numpy as np
import pytest

from plumbob import rotations as rot
from plumbob.calibration.mount import mount_from_attitudes, mount_from_level, mount_from_poses
from plumbob.core.constants import G0
from plumbob.core.errors import ShapeError
from plumbob.core.units import deg
from tests.helpers.refusals import reason_kinds, reasons

RNG = np.random.default_rng(11)
MOUNTINGS = [np.array(q / np.linalg.norm(q)) for q in RNG.normal(size=(4, 4))]
NOISE = 0.04  # m/s², one sample


def attitude(frame, pitch, roll=0.0, yaw=0.7):
    """q_nb of a body; nose up is a positive pitch about y in NED, and a negative one where y points left."""
    up = -1.0 if frame is not rot.Frame.NED else 1.0
    return rot.quat_from_euler_zyx(np.array([yaw, up * pitch, roll]))


def force(frame, q_bs, *, samples=400, noise=0.0, seed=0, **angles):
    """Specific force at rest (samples, 3) in the axes of the case."""
    up_b = rot.quat_rotate(rot.quat_conjugate(attitude(frame, **angles)), G0 * frame.up)
    clean = rot.quat_rotate(rot.quat_conjugate(q_bs), up_b)
    return clean + np.random.default_rng(seed).normal(0.0, noise, (samples, 3))


@pytest.mark.parametrize("frame", rot.Frame)
@pytest.mark.parametrize("q_bs", MOUNTINGS)
def test_two_poses_give_the_planted_mounting(frame, q_bs):
    found = mount_from_poses(force(frame, q_bs, pitch=0.0), force(frame, q_bs, pitch=deg(30.0)), frame=frame).mount
    # some roundings of a force of g, twice magnified by 1 / sin 30°; quat_angle is good to the square root of none
    assert np.abs(rot.rotvec_from_quat(rot.quat_multiply(found.q_bs, rot.quat_conjugate(q_bs)))).max() < 1e-14


def test_signs_are_those_of_forward_left_up_and_forward_right_down():
    # by hand: a case that sits as the body does reads +g along z when z is up, −g when it is down; nose up, +x
    raised = np.array([np.sin(deg(30.0)), 0.0, np.cos(deg(30.0))])
    for frame, z in ((rot.Frame.ENU, 1.0), (rot.Frame.NWU, 1.0), (rot.Frame.NED, -1.0)):
        level, nose_up = G0 * np.array([[0.0, 0.0, z]] * 2), G0 * np.array([raised * [1.0, 1.0, z]] * 2)
        assert rot.quat_angle(mount_from_poses(level, nose_up, frame=frame).mount.q_bs, [1.0, 0.0, 0.0, 0.0]) < 1e-7
        # lying on its nose-down pose instead, the same case points backward
        tail_up = nose_up * [-1.0, 1.0, 1.0]
        back = mount_from_poses(level, tail_up, frame=frame).mount.q_bs
        np.testing.assert_allclose(np.abs(back), [0.0, 0.0, 0.0, 1.0], atol=1e-15)


@pytest.mark.parametrize("frame", rot.Frame)
def test_errors_are_as_large_as_claimed(frame):
    trials, pulls = 100, []
    for seed in range(trials):
        level = force(frame, MOUNTINGS[0], pitch=0.0, noise=NOISE, seed=seed)
        raised = force(frame, MOUNTINGS[0], pitch=deg(25.0), noise=NOISE, seed=10_000 + seed)
        found = mount_from_poses(level, raised, frame=frame).mount
        pulls.append(rot.rotvec_from_quat(rot.quat_multiply(found.q_bs, rot.quat_conjugate(MOUNTINGS[0]))) / found.sd)
    # root mean square of 100 draws: 1 ± 1/√200; 4 of these
    np.testing.assert_allclose(np.sqrt(np.mean(np.square(pulls), axis=0)), 1.0, rtol=0, atol=4.0 / np.sqrt(2 * trials))


@pytest.mark.parametrize("frame", rot.Frame)
@pytest.mark.parametrize("q_bs", MOUNTINGS)
def test_the_level_pose_alone_makes_level_what_is_level(frame, q_bs):
    level = force(frame, q_bs, pitch=0.0)
    found = mount_from_level(level, frame=frame)
    np.testing.assert_allclose(rot.quat_rotate(found.mount.q_bs, level[0]), G0 * frame.up, rtol=0, atol=1e-14 * G0)
    ahead = rot.quat_rotate(found.mount.q_bs, np.array([1.0, 0.0, 0.0]))
    assert abs(ahead[1]) < 1e-14 and ahead[0] > 0.0  # x of the case ahead, up to its inclination
    assert found.mount.sd[2] > 1.0 and "heading was not measured" in str(found.remarks[0])


@pytest.mark.parametrize(("pitch", "more", "refused"), [
    (30.0, {"yaw": 0.7}, False),
    (30.0, {"yaw": 0.7 + deg(3.0)}, False),
    (30.0, {"yaw": 0.7 + deg(20.0)}, True),
    (40.0, {"roll": deg(40.0)}, True),
])  # fmt: skip
def test_a_turn_or_a_roll_while_raising_is_refused(pitch, more, refused):
    """The turn shows a roll, unless its axis stays level."""
    q_bs, frame = MOUNTINGS[2], rot.Frame.NED
    low, high = force(frame, q_bs, pitch=0.0), force(frame, q_bs, pitch=deg(pitch), **more)
    q_b = rot.quat_multiply(rot.quat_conjugate(attitude(frame, 0.0)), attitude(frame, deg(pitch), **more))
    turn = rot.rotvec_from_quat(rot.quat_multiply(rot.quat_multiply(rot.quat_conjugate(q_bs), q_b), q_bs))
    if refused:
        assert reason_kinds(mount_from_poses, low, high, frame=frame, turn=turn) == ["no-motion"]
    else:
        assert mount_from_poses(low, high, frame=frame, turn=turn).remarks == ()


def tracks(q_bs, *, count=2000):
    rng = np.random.default_rng(0)
    q_nb = rot.quat_from_rotvec(rng.normal(size=(count, 3)))
    return rot.quat_multiply(
        rot.quat_multiply(q_nb, rot.quat_from_rotvec(rng.normal(0.0, deg(1.0), (count, 3)))), q_bs
    ), q_nb


@pytest.mark.parametrize("q_bs", MOUNTINGS)
def test_a_reference_gives_the_planted_mounting_within_its_claim(q_bs):
    found = mount_from_attitudes(*tracks(q_bs)).mount
    error = rot.rotvec_from_quat(rot.quat_multiply(found.q_bs, rot.quat_conjugate(q_bs)))
    # Cauchy's weights at the scale of the median keep over half of the information: 1° / √2000 · √2. The claim comes
    # from ten parts, so that the ratio is Student's with 9 degrees of freedom: 6 is a chance of 2e-4.
    assert np.abs(error).max() < 5.0 * deg(1.0) * np.sqrt(2.0 / 2000.0)
    assert (np.abs(error) < 6.0 * found.sd).all()


def test_the_average_is_robust():
    ours, theirs = tracks(MOUNTINGS[0])
    # 15 % lost their heading
    ours[:300] = rot.quat_multiply(ours[:300], rot.quat_from_rotvec(np.array([0.0, 0.0, 1.0])))
    error = rot.quat_angle(mount_from_attitudes(ours, theirs).mount.q_bs, MOUNTINGS[0])
    # a mean is 15 % of 1 rad off, 8.6°; Cauchy's weight at 1 rad, with a scale of the median, about 2°: 0.1 % of it
    assert error < deg(0.3)


def poses(*angles):
    return [force(rot.Frame.NED, MOUNTINGS[1], pitch=deg(angle)) for angle in angles]


LOW, HIGH = poses(0.0, 30.0)
ON_END = force(rot.Frame.NED, rot.quat_from_rotvec(np.array([0.0, deg(85.0), 0.0])), pitch=0.0)
OURS, THEIRS = tracks(MOUNTINGS[0])


@pytest.mark.parametrize(("fit", "samples", "kind", "text"), [
    (mount_from_level, [ON_END], "ill-conditioned", "from the vertical"),
    (mount_from_poses, poses(0.0, 9.0), "ill-conditioned", "9.0°"),
    (mount_from_poses, [LOW, LOW], "ill-conditioned", ""),
    (mount_from_poses, [LOW, -LOW], "ill-conditioned", ""),
    (mount_from_poses, [LOW / G0, HIGH / G0], "wrong-gravity", ""),
    (mount_from_poses, [LOW * np.nan, HIGH], "too-few", ""),
    (mount_from_attitudes, [OURS[::-1], THEIRS], "implausible", ""),
    (mount_from_attitudes, [OURS[:99], THEIRS[:99]], "too-few", ""),
])  # fmt: skip
def test_what_tells_no_mounting_is_refused(fit, samples, kind, text):
    frame = {} if fit is mount_from_attitudes else {"frame": rot.Frame.NED}
    (reason, *_) = reasons(fit, *samples, **frame)
    assert reason.kind == kind and text in reason.text
    with pytest.raises(ShapeError):
        mount_from_poses(LOW[:, :2], HIGH, frame=rot.Frame.NED)
