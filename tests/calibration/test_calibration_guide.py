"""Guides of captures: the same however the stream is cut; who follows them gets to the end, who does not, does not."""

import copy
import pickle
from dataclasses import fields

import numpy as np
import pytest

from plumbob.calibration.predicted import REGIONS, region_index
from plumbob.data import ImuData, ImuMeta
from plumbob.live.guide.guide import (
    ENOUGH,
    LONG_ENOUGH,
    AccelGuide,
    AxisTurn,
    MagGuide,
    RestGuide,
    StopsGuide,
    nearest,
    pose_words,
    turn_to,
)
from plumbob.quality.static_periods import stills
from plumbob.rotations import Frame, quat_conjugate, quat_from_rotvec, quat_rotate
from plumbob.simulation import simulate
from tests.helpers.hand_capture import Hand, joined

HOLD = 2.5
SOFT_IRON = np.eye(3) + 0.1 * np.random.default_rng(0).normal(size=(3, 3))


def obedient(guide, hand, *, rest, most=60):
    """Parts of a capture by somebody who does what the guide says until it is done, every direction seen first."""
    parts = [hand.hold(rest)]
    progress = guide.feed(parts[0])
    while (progress.missing or not progress.done) and len(parts) < most:
        free = AxisTurn(0, 0.5) if progress.missing else AxisTurn(len(parts) % 3, np.pi)
        parts.append(joined(hand.turn(progress.turn or free), hand.hold(rest)))
        progress = guide.feed(parts[-1])
    return joined(*parts), progress


@pytest.fixture(scope="module")
def mag_capture():
    guide = MagGuide()
    imu, progress = obedient(guide, Hand(1, soft_iron=SOFT_IRON), rest=1.0)
    return imu, guide, progress


@pytest.fixture(scope="module")
def acc_capture():
    guide = AccelGuide()
    imu, progress = obedient(guide, Hand(2), rest=HOLD)
    return imu, guide, progress


def state(progress):
    """Everything that a progress says, comparable."""
    said = {f.name: getattr(progress, f.name) for f in fields(progress)}
    return said | {"filled": None if progress.filled is None else progress.filled.tolist()}


@pytest.mark.parametrize("kind", [MagGuide, AccelGuide, RestGuide, StopsGuide])
def test_it_does_not_matter_how_the_stream_was_cut(kind, mag_capture, acc_capture):
    imu = mag_capture[0][:500] if kind is MagGuide else acc_capture[0]
    if kind is StopsGuide:
        imu = simulate("stops", frame=Frame.NED, sensors="adxrs290+adxrs453", unit="random", seed=3).imu
    whole, cut = kind(), kind()
    first = whole.feed(imu)
    places = np.sort(np.random.default_rng(3).choice(np.arange(1, len(imu)), 25, replace=False))
    for a, b in zip([0, *places], [*places, len(imu)], strict=True):
        last = cut.feed(imu[int(a) : int(b)])
    assert state(last) == state(first)
    assert cut.timeline == whole.timeline != []


def test_who_follows_the_guide_of_the_magnetometer_sees_every_direction(mag_capture):
    _, guide, progress = mag_capture
    assert progress.filled.all() and progress.done  # more turning would not make it better
    assert progress.grade == "fair"  # by lengths alone
    assert any("18 of 18" in moment.text for moment in guide.timeline)


def test_who_follows_the_guide_of_the_accelerometer_holds_every_pose(acc_capture):
    imu, guide, progress = acc_capture
    assert progress.filled.all() and progress.done
    found = [imu.acc[one].mean(axis=0) for one in stills(imu.t, imu.acc, imu.gyr)]
    # the fit finds what was promised
    assert set(region_index(np.array(found) - 0.1).tolist()) == set(range(len(REGIONS)))
    enough = next(moment for moment in guide.timeline if "enough" in moment.text)
    seen = [moment for moment in guide.timeline if "seen" in moment.text and moment.t <= enough.t]
    assert f"{ENOUGH} of 18" in seen[-1].text


@pytest.mark.parametrize("rate", [20.0, 100.0, 1000.0])
def test_a_pose_of_two_seconds_and_a_bit_counts_at_any_rate(rate):
    guide, hand = AccelGuide(), Hand(4, rate=rate)
    progress = guide.feed(joined(hand.turn(AxisTurn(0, 2.0)), hand.hold(2.3), hand.turn(AxisTurn(1, 2.0))))
    assert progress.filled.sum() == 1


def test_poses_that_were_not_held_or_have_no_force_do_not_count(acc_capture):
    guide, hand = AccelGuide(), Hand(4)
    for _ in range(20):
        progress = guide.feed(joined(hand.hold(0.7), hand.turn(AxisTurn(hand.rng.integers(3), 1.0))))
    assert not progress.filled.any() and not guide.timeline
    acc = acc_capture[0].acc.copy()
    acc[::10] = np.nan
    assert not AccelGuide().feed(changed(acc_capture[0], acc=acc)).filled.any()


def test_a_ring_at_the_level_is_never_enough_and_is_told_to_tilt():
    guide, hand = MagGuide(), Hand(7, soft_iron=SOFT_IRON, level=True, trembling=0.005)
    for _ in range(20):
        progress = guide.feed(hand.turn(AxisTurn(2, np.pi)))
    assert not progress.done and progress.grade != "good"
    assert progress.turn.axis != 2 and "tilt it" in progress.next_step
    still = MagGuide().feed(Hand(8).hold(5.0))
    assert still.filled is None and still.missing == list(range(18))
    assert still.at_rest and "turn it" in still.next_step


def changed(imu, meta=None, **arrays):
    columns = {name: getattr(imu, name) for name in ("t", "gyr", "acc", "mag")} | arrays
    return ImuData(**columns, meta=meta or ImuMeta())


def test_what_is_wrong_is_said(mag_capture):
    imu = mag_capture[0]
    few = imu[:300]
    for wrong, warning in (
        (changed(few, ImuMeta(mag_range=float(np.abs(few.mag).max()))), "range"),
        (changed(few, mag=None), "no mag comes"),
        (Hand(1).turn(AxisTurn(0, 20.0), speed=5.0), "too fast"),
    ):
        assert warning in MagGuide().feed(wrong).warnings[0]
    mag = imu.mag.copy()
    mag[np.arange(len(imu)) % 3 > 0] = np.nan  # rows without a field are left out
    progress = MagGuide().feed(changed(imu, mag=mag))
    assert progress.filled.sum() >= 17 and not progress.warnings
    near = imu.mag + np.where(imu.t[:, np.newaxis] > imu.t[-1] - 3.0, [0.0, 0.0, 30.0], 0.0)  # a magnet comes
    progress = (guide := MagGuide()).feed(changed(imu, mag=near))
    assert any("not that of before" in text for text in progress.warnings)
    assert sum("not that of before" in moment.text for moment in guide.timeline) == 1


def test_memory_is_bounded(mag_capture):
    """Of two minutes at rest in a direction that is seen 6000 samples would be 144 kB; there may be 18 times 200."""
    imu, guide, _ = mag_capture
    guide, hand = copy.deepcopy(guide), Hand(1, soft_iron=SOFT_IRON)
    hand.t = imu.t[-1] + 0.02
    before = len(pickle.dumps(guide))
    guide.feed(hand.hold(120.0))
    assert len(pickle.dumps(guide)) < before + 24 * 18 * 200


def test_rest_is_counted_in_one_piece_and_without_an_accelerometer():
    guide, hand = RestGuide(), Hand(10)
    assert "7." in guide.feed(hand.hold(8.0)).next_step
    progress = guide.feed(joined(hand.turn(AxisTurn(0, 0.5)), hand.hold(LONG_ENOUGH - 5.0)))
    assert not progress.done
    assert guide.feed(hand.hold(6.0)).done
    texts = [moment.text for moment in guide.timeline]
    assert texts == ["at rest", "touched: the rest starts again", "at rest", "enough: the capture is good"]
    assert RestGuide().feed(changed(Hand(11).hold(LONG_ENOUGH + 1.0), acc=None)).done


def applied(turn, vector):
    """Vector in the axes of a unit that has turned."""
    return quat_rotate(quat_conjugate(quat_from_rotvec(np.eye(3)[turn.axis] * turn.angle)), vector)


def test_turns_lead_to_the_goal_and_between_neighbours_one_is_enough():
    for i, start in enumerate(REGIONS):
        goal = REGIONS[nearest(start, [j for j in range(18) if j != i])]
        turn = turn_to(start, goal)
        assert abs(turn.angle) == pytest.approx(0.25 * np.pi)
        np.testing.assert_allclose(applied(turn, start), goal, rtol=0, atol=1e-12)
    rng = np.random.default_rng(12)
    for goal in REGIONS:  # from anywhere, six turns lead there
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        for _ in range(6):
            direction = applied(turn_to(direction, goal), direction)
        assert np.degrees(np.arccos(np.clip(direction @ goal, -1.0, 1.0))) < 1.0
    # the x axis has come nearer to where z was, and the words say so
    assert quat_rotate(quat_from_rotvec(np.array([0.0, -0.8, 0.0])), np.array([1.0, 0.0, 0.0]))[2] > 0.7
    words = [str(AxisTurn(1, 0.8)), str(AxisTurn(1, -0.8)), pose_words(0), pose_words(11)]
    about = "turn it about its y axis by about 45°, "
    assert words == [
        about + "z towards x", about + "x towards z", "its x axis up", "its x axis 45° up and its z axis 45° down",
    ]  # fmt: skip
