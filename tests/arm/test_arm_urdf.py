"""URDF: read, written, and moved; our forward kinematics against pytransform3d's and against SciPy's by hand."""

import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from plumbob.arm import JointTrack, Program, chain_from_urdf, export, replay, taught, urdf_text
from plumbob.arm.urdf import hand_link, moved
from plumbob.core.errors import ClockError, MissingExtraError, ParameterError, PlumbobError
from plumbob.data.chain import Limits
from plumbob.rotations import dcm_from_quat
from tests.helpers import beside, examples
from tests.helpers.arm_samples import arm, pick_and_place, scipy_hand

ROBOT = beside(__file__, "two.urdf")

LAUGHS = "".join(f'<!ENTITY e{k + 1} "{f"&e{k};" * 10}">' for k in range(12))


def by_hand(shoulder: float, elbow: float) -> np.ndarray:
    """Pose of the tip, from the URDF's definition: origin, then the turn about the axis; rpy about fixed x, y, z."""

    def frame(xyz, rpy, axis, angle):
        turn = Rotation.from_euler("xyz", rpy) * Rotation.from_rotvec(np.array(axis) * angle)
        made = np.eye(4)
        made[:3, :3], made[:3, 3] = turn.as_matrix(), xyz
        return made

    upper = frame([0, 0, 1.2], [0, 0, np.pi / 2], [0, 1, 0], shoulder)
    return upper @ frame([0.4, 0, 0], [0.1, -0.2, 0.3], [0, 0, 1], elbow)


def test_a_robot_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "two.urdf"
    file.write_text(ROBOT)
    chain = chain_from_urdf(file, units={"upper": "imu1"})
    assert chain.angles == ("shoulder", "elbow") and chain.hand == "tip" and chain.base_fixed
    assert [one.unit for one in chain.segments] == ["", "imu1", ""]
    assert chain.limits == (Limits(), Limits(-1.5, 2.0, 3.5))
    assert chain.length == pytest.approx(0.4)
    for angles in ((0.0, 0.0), (0.7, -1.2), (-3.0, 1.9)):
        found = chain.postures(np.array([angles]))["tip"]
        np.testing.assert_allclose(dcm_from_quat(found.q_nb[0]), by_hand(*angles)[:3, :3], atol=1e-12)
        np.testing.assert_allclose(found.pos_n[0], by_hand(*angles)[:3, 3], atol=1e-12)
    monkeypatch.setitem(sys.modules, "pytransform3d", None)
    with pytest.raises(MissingExtraError, match=r"plumbob\[arm\]"):
        chain_from_urdf(file)


six = st.lists(st.floats(-2.4, 2.4), min_size=6, max_size=6)


@examples(0.4)
@given(six)
def test_our_kinematics_are_those_of_the_parser(angles: list[float]) -> None:
    chain, row = arm(), np.array([angles])
    ours = chain.hand_at(chain.postures(row))
    theirs = moved(urdf_text(chain), chain.angles, row, hand_link(chain))
    np.testing.assert_allclose(theirs[:, :3, 3], ours, atol=1e-12)
    turned = moved(urdf_text(chain), chain.angles, row, "hand")
    np.testing.assert_allclose(turned[:, :3, :3], dcm_from_quat(chain.postures(row)["hand"].q_nb), atol=1e-12)


@pytest.mark.parametrize(("units", "merge", "kinds"), [
    (None, False, ["hinge"] * 6 + ["fixed"]),
    (None, True, ["ball", "hinge", "universal", "fixed"]),
    ({"hand_1": "imu"}, True, ["ball", "hinge", "hinge", "hinge", "fixed"]),  # a unit lies between the last two
])  # fmt: skip
def test_a_chain_is_read_back_from_its_urdf(tmp_path: Path, units, merge: bool, kinds: list[str]) -> None:
    chain = arm()
    file = tmp_path / "arm.urdf"
    file.write_text(urdf_text(chain))
    units = units or {one.name: one.unit for one in chain.segments if one.unit}
    again = chain_from_urdf(file, units=units, hand="hand", hand_b=chain.hand_b, merge=merge)
    assert [joint.kind for joint in again.joints] == kinds
    assert again.angles == chain.angles
    assert again.limits == tuple(one._replace(acceleration=np.inf, jerk=np.inf) for one in chain.limits)
    angles = np.random.default_rng(1).uniform(-2.0, 2.0, (20, 6))
    hands = [one.hand_at(one.postures(angles)) for one in (again, chain)]
    np.testing.assert_allclose(*hands, atol=1e-12)
    if len(kinds) == 4:
        assert [joint.name for joint in again.joints][:3] == ["shoulder", "elbow", "wrist"]
        assert again.joints[0].axes == chain.joints[0].axes


@pytest.mark.parametrize(("old", "new", "match"), [
    ('type="continuous"', 'type="prismatic"', "'shoulder' is prismatic"),
    ('type="continuous"', 'type="floating"', "'shoulder' is floating"),
    ('<axis xyz="0 1 0"/>', '<axis xyz="0 1 0"/><mimic joint="elbow"/>', "mimics"),
    ('<parent link="upper"/>', '<parent link="arm"/>', "arm"),
    ('<parent link="base"/>', '<parent link="tip"/>', "must be the root|not connected"),
    ('velocity="3.5"', 'velocity="fast"', "not a number"),
    ('lower="-1.5"', 'lower="low"', "that can be read: .*low"),
    ('lower="-1.5"', 'lower="3"', "must increase"),
    ("</robot>", "", "not complete XML"),
    ("<robot", "<sdf", "XML"),
    # entities in entities, the 'billion laughs': expat (since 2.4.1) stops them
    ('<robot name="two">', f'<!DOCTYPE robot [<!ENTITY e0 "ha">{LAUGHS}]><robot name="&e12;">', "not complete XML"),
])  # fmt: skip
def test_what_a_chain_cannot_be_is_refused(tmp_path: Path, old: str, new: str, match: str) -> None:
    assert old in ROBOT
    file = tmp_path / "two.urdf"
    file.write_text(ROBOT.replace(old, new, 1))
    with pytest.raises(PlumbobError, match=match) as refused:
        chain_from_urdf(file)
    assert str(file) in str(refused.value)


def test_a_taught_program_moves_the_urdf_where_the_hand_truly_was(tmp_path: Path) -> None:
    """Truth is made by SciPy from the angles that were recorded, noise of 0.1° is added, and the URDF is moved."""
    chain = arm()
    poses = np.random.default_rng(4).uniform(-1.0, 1.0, (4, 6))
    clean = pick_and_place(poses, rest=0.6, move=1.4)
    noise = np.random.default_rng(5).normal(0.0, np.radians(0.1), clean.angles.shape)
    program = taught(JointTrack(clean.t, chain.angles, clean.angles + noise), chain)
    assert program.slowed > 1.2  # else the times of both would be the same
    assert all(share <= 1.0 for share in program.used(chain).values())
    truth = np.array([scipy_hand(row) for row in clean.angles])
    (tmp_path / "arm.urdf").write_text(urdf_text(chain))
    done = replay(program, tmp_path / "arm.urdf")
    error = done.against(clean.t, truth)
    assert done.length == pytest.approx(0.65 + np.hypot(0.1, 0.02) - 0.1)
    assert error.rms_share < 0.005 and error.max_share < 0.02
    ours = replay(program, chain)
    np.testing.assert_allclose(ours.hand, done.hand, atol=1e-12)
    assert set(ours.postures) == {"base", "upper", "lower", "hand"}
    again = replay(Program.load(export(program, tmp_path / "p.csv")), tmp_path / "arm.urdf")
    np.testing.assert_allclose(again.hand, done.hand, atol=1e-12)
    with pytest.raises(ClockError, match="give truth for all of it"):
        done.against(clean.t[:100], truth[:100])
    far = JointTrack(np.arange(5.0), chain.angles, np.full((5, 6), 2.6))
    other = JointTrack(np.arange(5.0), ("knee",), np.zeros((5, 1)))
    for track, model, match in (
        (far, tmp_path / "arm.urdf", r"shoulder1 goes from 2\.6 to 2\.6 rad, but the URDF allows"),
        (other, tmp_path / "arm.urdf", "no joint knee"),
        (other, chain, "moves knee"),
    ):
        with pytest.raises(ParameterError, match=match):
            replay(track, model)
