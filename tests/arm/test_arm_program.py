"""Teach-in: limits, stops and ends are kept whatever was recorded; what is smoothed and slowed is what must be."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from plumbob.arm import JointTrack, Program, taught
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.data.chain import Chain, Joint, Limits, Segment
from tests.helpers import examples
from tests.helpers.arm_samples import eased, pick_and_place

POSITIVE = ("rate", "smooth", "still", "dwell")
WIDE = Limits(-10.0, 10.0, 1e3, 1e5, 1e7)


@st.composite
def motions(draw):
    """Sums of sines, some of them held for a while, with noise, on a line of times with holes."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    joints, rate = draw(st.integers(1, 4)), draw(st.sampled_from((50.0, 100.0, 333.0)))
    t = np.arange(0.0, draw(st.floats(2.0, 8.0)), 1.0 / rate)
    held = np.maximum(0.0, np.sin(t * rng.uniform(0.3, 2.0) + rng.uniform(0, 6)))
    phase = np.cumsum(held) / rate
    angles = sum(
        rng.normal(0.0, 0.6, joints) * np.sin(np.outer(phase, rng.uniform(0.2, 12.0, joints))) for _ in range(4)
    )
    angles = angles + rng.normal(0.0, draw(st.sampled_from((0.0, 1e-3, 2e-2))), angles.shape)
    angles[rng.random(t.size) < draw(st.sampled_from((0.0, 0.05)))] = np.nan
    return JointTrack(t, tuple(f"j{i}" for i in range(joints)), angles)


size = st.one_of(st.just(np.inf), st.floats(0.05, 50.0))
limits = st.builds(Limits, st.floats(-2.0, -0.1), st.floats(0.1, 2.0), size, size, size)


@examples(0.6)
@given(motions(), limits, st.sampled_from((50.0, 100.0, 125.0, 1000.0)))
def test_limits_are_kept_by_differences_of_samples(track, bounds, rate):
    program = taught(track, bounds, rate=rate)
    for order, top in enumerate(bounds[2:], 1):
        most = np.abs(np.diff(program.angles, order, axis=0)).max() * rate**order
        assert most <= top, (order, most, top)
    assert program.angles.min() >= bounds.low and program.angles.max() <= bounds.high
    assert np.abs(program.velocities).max() <= bounds.velocity
    assert np.abs(program.accelerations).max() <= bounds.acceleration and np.isfinite(program.angles).all()
    np.testing.assert_allclose(np.diff(program.t), 1.0 / rate, rtol=1e-6)


@examples(0.4)
@given(motions(), size, size, size)
def test_stops_and_ends_are_kept(track, velocity, acceleration, jerk):
    program = taught(track, Limits(-10.0, 10.0, velocity, acceleration, jerk))
    for stop in program.stops:
        inside = (program.t >= stop.start) & (program.t <= stop.end)
        assert (program.angles[inside] == np.array(stop.angles)).all()
        assert (program.velocities[inside] == 0.0).all() and (program.accelerations[inside] == 0.0).all()
        assert stop.end - stop.start >= 0.3 - 1e-9
    known = np.flatnonzero(np.isfinite(track.angles).all(axis=1))
    for row, end, outer in ((0, known[0], 0.0), (-1, known[-1], program.t[-1])):
        at_stop = [stop for stop in program.stops if stop.start <= outer <= stop.end + 1.0 / program.rate]
        wanted = [stop.angles for stop in at_stop] or [tuple(track.angles[end])]
        wanted.append(tuple(track.angles[end]))  # where a motion of less than a sample follows the stop
        assert tuple(program.angles[row]) in wanted


def test_stops_are_those_of_the_recording_and_a_slow_motion_is_none():
    """Poses within the noise of their median: 100 samples of 0.1° give 0.0125° (1.25 σ/√n), four times that here."""
    poses = np.radians([[0, 10], [40, -20], [40, 30], [-10, 0]])
    program = taught(pick_and_place(poses, noise=np.radians(0.1)), WIDE)
    assert len(program.stops) == len(poses)
    for k, (stop, pose) in enumerate(zip(program.stops, poses, strict=True)):
        np.testing.assert_allclose(stop.angles, pose, atol=np.radians(0.05))
        # 20° in 2 s with rest at both ends leave the pose by half a degree within 0.3 s of their start.
        assert abs(stop.recorded - 3.0 * k) < 0.35 and 1.0 <= stop.end - stop.start < 1.7
    assert program.slowed == pytest.approx(1.0, abs=0.01)
    assert max(one.rms for one in program.deviations.values()) < np.radians(0.2)
    t = np.arange(0.0, 10.0, 0.01)
    slow = np.where(t < 2.0, 0.0, np.where(t < 8.0, (t - 2.0) * np.radians(2.0), np.radians(12.0)))  # 2 °/s
    program = taught(JointTrack(t, ("a",), slow[:, np.newaxis]), WIDE)
    assert [round(np.degrees(stop.angles[0])) for stop in program.stops] == [0, 12]


def test_only_what_is_too_fast_is_slowed_along_the_same_path():
    """A flick of 0.5 s in 20 s of slow motion: as a whole it would take three times as long."""
    t = np.arange(0.0, 20.0, 0.01)
    angles = 0.5 * np.sin(0.5 * t) + 0.5 * eased((t - 10.0) / 0.5)  # the flick's top speed is 1.875 · 0.5 / 0.5 rad/s
    program = taught(JointTrack(t, ("a",), angles[:, np.newaxis]), Limits(velocity=0.6, acceleration=20.0, jerk=400.0))
    assert program.used(Limits(velocity=0.6))["velocity"] <= 1.0 and program.t[-1] < 24.0
    recorded = np.interp(program.t, t, angles)
    np.testing.assert_allclose(program.angles[:700, 0], recorded[:700], atol=0.03)  # 7 s before it: as recorded
    track = pick_and_place(np.radians([[0, 10, 0], [40, -20, 5], [40, 30, -60], [-10, 0, 0]]))
    quick = taught(track, WIDE, rate=500.0)
    slow = taught(track, Limits(-10, 10, 0.3, 0.6, 2.0), rate=500.0)
    assert slow.t[-1] > 1.5 * quick.t[-1]
    nearest = [np.abs(quick.angles - pose).max(axis=1).min() for pose in slow.angles[::50]]
    # Between two samples of the quick one lie 0.65 rad/s · 2 ms at most.
    assert max(nearest) < 1.3e-3


def test_smoothing_removes_what_is_faster_than_its_knots():
    """A tremor of 8 Hz is removed, a motion of 0.3 Hz stays: within 2 % and 1 % of their amplitudes."""
    t = np.arange(0.0, 20.0, 0.01)
    slow, tremor = np.sin(2 * np.pi * 0.3 * t), 0.05 * np.sin(2 * np.pi * 8.0 * t)
    program = taught(JointTrack(t, ("a",), (slow + tremor)[:, np.newaxis]), Limits(), smooth=0.2)
    inner = slice(200, -200)
    left = program.angles[inner, 0] - slow[inner]
    assert np.abs(left).max() < 0.01 and abs(np.mean(left * tremor[inner])) / np.mean(tremor[inner] ** 2) < 0.02


def test_poses_beyond_the_range_are_brought_inside_turns_unwrapped_and_limits_by_name():
    program = taught(pick_and_place(np.radians([[0.0], [50.0]])), Limits(low=-1.0, high=np.radians(45.0)))
    assert program.stops[1].angles == (np.radians(45.0),)
    assert "5.00° beyond the range of j0" in str(program.notes[0])
    assert program.deviations["j0"].max == pytest.approx(np.radians(5.0), abs=1e-6)
    t = np.arange(0.0, 6.0, 0.01)
    turned = 4.0 * eased((t - 1.0) / 4.0)
    wrapped = (turned + np.pi) % (2.0 * np.pi) - np.pi
    program = taught(JointTrack(t, ("a",), wrapped[:, np.newaxis]), Limits(velocity=3.0))
    assert program.angles[-1, 0] - program.angles[0, 0] == pytest.approx(4.0, abs=1e-9)
    chain = Chain(
        "arm",
        (Segment("base"), Segment("upper"), Segment("lower")),
        (
            Joint("j1", "base", "upper", axes=((0, 0, 1.0),), limits=(Limits(velocity=0.2),)),
            Joint("j0", "upper", "lower", axes=((0, 0, 1.0),)),
        ),
    )
    program = taught(pick_and_place([[0.0, 0.0], [1.0, 1.0]]), chain)
    assert 0.99 < program.used(chain)["velocity"] <= 1.0
    with pytest.raises(ParameterError, match="no angle k; its angles are j1, j0"):
        taught(JointTrack(np.arange(20.0), ("k",), np.zeros((20, 1))), chain)


ONE = pick_and_place([[0.0], [1.0]])
NO_NUMBER = ([0.0, 1.0, 2.0], [[0.0], [np.nan], [0.0]], ("a",), np.zeros((3, 1)), np.zeros((3, 1)))


@pytest.mark.parametrize(("make", "error", "match"), [
    *((partial(taught, ONE, **{name: 0.0}), ParameterError, f"{name} must be above 0") for name in POSITIVE),
    (partial(taught, ONE[:5]), ShapeError, "8 samples"),
    (partial(taught, ONE, [Limits(), Limits()]), ParameterError, "1 angle need"),
    (partial(Program, *NO_NUMBER), ShapeError, "finite"),
])  # fmt: skip
def test_what_cannot_be_taught_is_refused(make, error, match):
    with pytest.raises(error, match=match):
        make()
