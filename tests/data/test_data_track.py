"""AttitudeTrack: an attitude over time."""

import copy
import pickle
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from plumbob import AttitudeTrack, flags
from plumbob.core.errors import ClockError, FrameError, ShapeError
from plumbob.rotations import Frame, North, assert_same, quat_from_rotvec

N = 50
EPS = np.finfo(float).eps


def parts():
    t = 0.01 * np.arange(N)
    return {"t": t, "q_nb": quat_from_rotvec(np.outer(t, [0.3, -0.2, 1.0])), "frame": Frame.ENU, "north": North.TRUE}


def made(**changes):
    return AttitudeTrack(**(parts() | changes))


def test_rounded_digits_are_normalised_and_unknown_attitudes_are_nan():
    q = parts()["q_nb"]
    rounded = made(q_nb=np.round(q, 4)).q_nb
    assert np.abs(np.linalg.norm(rounded, axis=1) - 1).max() <= 2 * EPS
    assert np.array_equal(made(q_nb=rounded).q_nb, rounded)  # storing a track again changes nothing
    q[3], q[4, 2] = np.nan, np.nan
    track = made(q_nb=q)
    assert len(track) == N
    assert np.flatnonzero(~track.known).tolist() == [3, 4]
    assert np.isnan(track.q_nb[4]).all() and np.array_equal(track.q_nb[track.known], q[track.known])


def at(row, value):
    t = parts()["t"]
    t[row] = value
    return t


@pytest.mark.parametrize(("error", "name", "value", "says"), [
    (ShapeError, "q_nb", np.zeros((4, N)), r"q_nb must have shape \(N, 4\).*transposed"),
    (ShapeError, "q_nb", np.zeros((N, 3)), r"q_nb must have shape \(N, 4\)"),
    (ShapeError, "q_nb", np.zeros((N, 4)), r"q_nb\[0\] has norm 0, but"),
    (ShapeError, "q_nb", np.tile([1.0, 0.1, 0, 0], (N, 1)), "q_nb.*has norm 1.00498756"),
    (ShapeError, "q_nb", np.tile([np.inf, 0, 0, 0], (N, 1)), "q_nb.*has norm inf"),
    (ShapeError, "q_nb", np.ones((N + 1, 4)) / 2, "q_nb must have one row per time stamp"),
    (ShapeError, "bias_b", np.zeros((N, 4)), r"bias_b must have shape \(N, 3\)"),
    (ShapeError, "cov_b", np.zeros((N, 3)), r"cov_b must have shape \(50, 3, 3\), but its shape is \(50, 3\)"),
    (ShapeError, "cov_b", np.zeros((N - 1, 3, 3)), r"cov_b must have shape \(50, 3, 3\)"),
    (ShapeError, "flags", np.full(N, -1), "flags"),
    (ShapeError, "flags", np.zeros(N + 1), "flags must have one entry"),
    (ShapeError, "score", np.full(N, np.nan), r"score\[0\] = nan, but it must be True or False"),
    (ShapeError, "score", np.full(N, 2), "score"),
    (ShapeError, "t", np.zeros((N, 1)), "t must have shape"),
    (ClockError, "t", at(7, 0.01), "strictly increase"),
    (ClockError, "t", at(7, 0.06 + 1e-10), "rounded to nanoseconds"),
    *(
        (FrameError, name, bad, "known:")
        for name, bad in (("frame", None), ("frame", "XYZ"), ("north", "grid"), ("north", None))
    ),
])  # fmt: skip
def test_refused(error, name, value, says):
    with pytest.raises(error, match=says):
        made(**{name: value})


def test_frames_and_norths_are_needed_and_another_attitude_or_frame_is_a_new_track():
    track = made(frame="ENU", north="true")
    assert (track.frame, track.north) == (Frame.ENU, North.TRUE)
    with pytest.raises(TypeError):
        AttitudeTrack(t=[0.0], q_nb=[[1, 0, 0, 0]])
    track = made(**OPTIONAL)
    turned = track.with_attitude(track.q_nb[::-1], source="reversed")
    assert np.array_equal(turned.q_nb, track.q_nb[::-1])
    assert turned.source == "reversed"
    assert np.array_equal(turned.bias_b, track.bias_b)
    with pytest.raises(ShapeError, match="q_nb"):
        track.with_attitude(np.zeros((3, 4)))
    track = made()
    assert assert_same(track, Frame.ENU, Frame.NWU, because="test").frame is Frame.NWU
    assert np.array_equal(replace(track, north=North.FREE).q_nb, track.q_nb)
    with pytest.raises(FrameError):
        assert_same(track, Frame.ENU, "XYZ", because="test")


OPTIONAL = {
    "bias_b": np.zeros((N, 3)), "cov_b": np.tile(np.eye(3), (N, 1, 1)), "flags": np.arange(N),
    "score": np.arange(N) % 2 == 0, "mag_weight": np.linspace(0.0, 1.0, N),
}  # fmt: skip


def test_frozen_for_good():
    mine = parts() | {name: value.copy() for name, value in OPTIONAL.items()}
    track = AttitudeTrack(**mine)
    arrays = ("t", "q_nb", *OPTIONAL)
    before = {name: getattr(track, name).copy() for name in arrays}
    for name in arrays:
        mine[name][:] = 1
    with pytest.raises(FrozenInstanceError):
        track.frame = Frame.NED
    for twin in (track, copy.deepcopy(track), pickle.loads(pickle.dumps(track))):  # noqa: S301
        for name in arrays:
            assert np.array_equal(getattr(twin, name), before[name]) and not getattr(twin, name).flags.writeable
    assert track.flags.dtype == np.uint32
    assert track.score.dtype == bool


def test_the_distance_to_a_gap_is_to_the_nearer_of_its_ends():
    t = np.array([0.0, 1.0, 2.0, 7.0, 8.0, 9.0, 20.0])
    word = np.zeros(t.size, dtype=np.uint32)
    word[[3, 6]] = flags.GAP  # behind 2 s, and behind 9 s
    track = AttitudeTrack(t=t, q_nb=np.tile([1.0, 0.0, 0.0, 0.0], (t.size, 1)), frame="NED", north="free", flags=word)
    assert track.gap_distance.tolist() == [2.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0]
    assert np.isinf(AttitudeTrack(t=t, q_nb=track.q_nb, frame="NED", north="free").gap_distance).all()
    assert np.isinf(AttitudeTrack(t=t, q_nb=track.q_nb, frame="NED", north="free", flags=0 * word).gap_distance).all()
