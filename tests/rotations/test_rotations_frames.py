"""Navigation frames and body axes, by cases worked out by hand."""

import itertools
from dataclasses import dataclass

import numpy as np
import pytest

from plumbob import Frame, North
from plumbob import rotations as rot
from plumbob.core.errors import FrameError

EPS = np.finfo(float).eps
HALF = np.sqrt(0.5)
PAIRS = list(itertools.product(Frame, Frame))


def test_letters_name_the_axes_of_a_right_handed_frame_and_rotations_between_them():
    """N, E, D, W, U in the name are the columns of the unit matrix, in order."""
    for frame in Frame:
        assert np.array_equal(np.cross(frame.east, frame.north), frame.up)
        assert np.linalg.det(np.stack((frame.east, frame.north, frame.up))) == 1.0
        named = {"N": frame.north, "E": frame.east, "U": frame.up, "S": -frame.north, "W": -frame.east, "D": -frame.up}
        assert np.array_equal([named[letter] for letter in frame.value], np.eye(3))
    # The half turn about the north-east bisector (x + y)/√2 exchanges E with N and turns U over: textbook ENU ↔ NED.
    np.testing.assert_allclose(rot.frame_rotation(Frame.NED, Frame.ENU), [0, HALF, HALF, 0], atol=EPS)
    np.testing.assert_allclose(rot.frame_rotation(Frame.NED, Frame.NWU), [0, 1, 0, 0], atol=EPS)
    np.testing.assert_allclose(rot.frame_rotation(Frame.NWU, Frame.ENU), [HALF, 0, 0, -HALF], atol=EPS)


# A level body with its nose to the north, forward-left-up (FLU) and forward-right-down (FRD).
NOSE_NORTH = {
    ("FLU", Frame.ENU): [HALF, 0, 0, HALF],  # x → y, y → −x: a quarter turn about up
    ("FLU", Frame.NWU): [1, 0, 0, 0],
    ("FLU", Frame.NED): [0, 1, 0, 0],  # x stays, y and z turn over
    ("FRD", Frame.ENU): [0, HALF, HALF, 0],  # x → y, y → x, z → −z: half a turn about the north-east
    ("FRD", Frame.NWU): [0, 1, 0, 0],
    ("FRD", Frame.NED): [1, 0, 0, 0],
}
AXES = {"FLU": ("north", "west", "up"), "FRD": ("north", "east", "down")}


def direction(frame, word):
    opposite = {"west": "east", "south": "north", "down": "up"}
    return -getattr(frame, opposite[word]) if word in opposite else getattr(frame, word)


@pytest.mark.parametrize(("body", "frame"), NOSE_NORTH)
def test_hand_cases_point_where_they_say(body, frame):
    q = NOSE_NORTH[body, frame]
    for axis, word in zip(np.eye(3), AXES[body], strict=True):
        np.testing.assert_allclose(rot.quat_rotate(q, axis), direction(frame, word), atol=2 * EPS)


@pytest.mark.parametrize(("to", "from_"), PAIRS)
def test_frame_rotations_form_a_group_and_keep_a_body_where_it_is(to, from_):
    for body in AXES:
        changed = rot.change_frame(NOSE_NORTH[body, from_], to=to, from_=from_)
        assert rot.quat_angle(changed, NOSE_NORTH[body, to]) <= 4 * EPS
    q = rot.frame_rotation(to, from_)
    for word in ("east", "north", "up"):
        np.testing.assert_allclose(rot.quat_rotate(q, getattr(from_, word)), getattr(to, word), atol=4 * EPS)
    assert rot.quat_angle(rot.quat_conjugate(q), rot.frame_rotation(from_, to)) <= 4 * EPS
    for via in Frame:
        chain = rot.quat_multiply(rot.frame_rotation(to, via), rot.frame_rotation(via, from_))
        assert rot.quat_angle(chain, q) <= 8 * EPS


def test_changing_frames_turns_the_world_and_not_the_body_and_the_same_frame_gives_a_copy(quats):
    """The up direction seen in the body is the same, from whichever frame it is computed."""
    for to, from_ in PAIRS:
        changed = rot.change_frame(quats, to=to, from_=from_)
        seen = rot.quat_rotate(rot.quat_conjugate(quats), from_.up)
        np.testing.assert_allclose(rot.quat_rotate(rot.quat_conjugate(changed), to.up), seen, atol=16 * EPS)
    same = rot.change_frame(quats, to="NED", from_=Frame.NED)
    assert np.array_equal(same, quats) and not np.shares_memory(same, quats)
    changed = rot.change_frame(quats, to="ENU", from_="NED")
    assert np.array_equal(changed, rot.change_frame(quats, to=Frame.ENU, from_=Frame.NED))
    for name in (" ned ", "NED", "Ned"):
        assert Frame.parse(name) is Frame.NED
    assert North.parse(" Magnetic") is North.MAGNETIC


@dataclass(frozen=True)
class Track:
    frame: Frame
    q_nb: tuple


def change(to, from_):
    return rot.change_frame([1, 0, 0, 0], to=to, from_=from_)


def same_as(frame, because):
    return rot.assert_same(Track(Frame.NWU, ()), frame, Frame.ENU, because=because)


AXES_LACK = ["", "x y", "x x z", "xyz", "x y z z", "--x y z", "+-x y z", "X Y Z", "1 2 3", "x −y −z", "x- y z"]
NO_FRAME = "is not a navigation frame; known: ENU, NED, NWU"
REFUSED = [
    *((change, pair, NO_FRAME) for pair in (("XYZ", "XYZ"), (None, Frame.NED), (Frame.NED, 3))),
    *((Frame.parse, (name,), r"known: ENU, NED, NWU\.") for name in ("", "NEU", "north", "ENU NED")),
    (North.parse, ("grid",), "'grid' is not a heading reference; known: true, magnetic, free"),
    (same_as, (Frame.NED, "a reason"), "frame is NWU, not NED; nothing was relabelled"),
    *((same_as, (Frame.NWU, because), "needs a reason") for because in ("", "  \n")),
    *((rot.body_axes, (spec,), "must name x, y and z once each") for spec in AXES_LACK),
]


@pytest.mark.parametrize(("call", "given", "says"), REFUSED)
def test_refused(call, given, says):
    with pytest.raises(FrameError, match=says):
        call(*given)


def test_a_relabelled_track_is_not_turned():
    track = Track(Frame.NWU, (1, 2, 3, 4))
    relabelled = rot.assert_same(track, Frame.NWU, Frame.ENU, because="the file says NWU, its paper ENU")
    assert relabelled == Track(Frame.ENU, (1, 2, 3, 4))
    assert track.frame is Frame.NWU


SPECS = [
    " ".join(sign + letter for sign, letter in zip(signs, order, strict=True))
    for order in itertools.permutations("xyz")
    for signs in itertools.product(("", "-"), repeat=3)
]


def right_handed(spec):
    """The third letter is the vector product of the first two."""
    x, y, z = (("-" in w, "xyz".index(w[-1])) for w in spec.split())
    cyclic = (y[1] - x[1]) % 3 == 1
    return (x[0] ^ y[0] ^ z[0]) != cyclic


def test_each_way_to_name_axes_has_its_letters_and_24_of_48_are_right_handed():
    assert len(set(SPECS)) == 48
    assert sum(map(right_handed, SPECS)) == 24
    for spec in SPECS:
        if not right_handed(spec):
            with pytest.raises(FrameError, match="left-handed"):
                rot.body_axes(spec)
            continue
        c = rot.body_axes(spec)
        assert set(np.abs(c).ravel()) == {0.0, 1.0}
        assert np.array_equal(c @ c.T, np.eye(3))
        assert np.linalg.det(c) == 1.0
        expected = [("xyz".index(w[-1]) + 1) * (-1 if "-" in w else 1) for w in spec.split()]
        assert np.array_equal(c @ [1.0, 2.0, 3.0], expected)
    for spec in ("+x +y +z", "x,y,z", " x, y , z", "x\ty\tz"):
        assert np.array_equal(rot.body_axes(spec), np.eye(3))
    assert np.array_equal(rot.body_axes("y -x z"), rot.dcm_from_quat([HALF, 0, 0, -HALF]).round())
    ways = rot.every_axes()
    assert np.array_equal(ways[0], np.eye(3)) and len({rot.axes_letters(way) for way in ways}) == 48
    assert all(np.array_equal(rot.signed_axes(rot.axes_letters(way)), way) for way in ways)
    assert sum(np.linalg.det(way) > 0.0 for way in ways) == 24
