"""Without a lag: right from the first seconds on, and what a few samples cannot tell is decided by all of them.

That nothing later changes an estimate is in test_smoother_keyframes, with the other lags.
"""

import math

import numpy as np
import pytest

from plumbob import ImuData, ImuMeta, estimate
from plumbob.core import flags
from plumbob.core._jit import jit_disabled
from plumbob.core.errors import ShapeError
from plumbob.core.units import deg, dps
from plumbob.filters.smoother import FixedLag, Smoother, arriving, inertial, live, onward, standing
from plumbob.filters.smoother.field import Reference, middle_of, share_of_rest, weights
from plumbob.filters.smoother.inertial import calm, first_rest
from plumbob.filters.smoother.keyframes import Keyframes
from plumbob.filters.smoother.model import BIAS_REPEATS, SIZE, Params
from plumbob.filters.smoother.sweeps import COUNT, FIELD, FORCE, MEANS, Last
from plumbob.rotations import quat_angle, quat_conjugate, quat_from_rotvec, quat_rotate
from tests.helpers.hand_motion import by_hand, error_n, rms_deg

slow = pytest.mark.skipif(jit_disabled(), reason="minutes in plain Python, whose bits are the same")

NOT_CONVERGED = np.uint32(flags.NOT_CONVERGED)


def followed(imu, **params):
    """Track without a lag, and what was remarked."""
    smoother = Smoother(frame="ENU", params={"lag": 0.0, **params})
    return smoother.process(imu), " ".join(smoother.remarks)


def converged(track):
    return (track.flags & NOT_CONVERGED) == 0


@slow
@pytest.mark.parametrize("rest", [(), ((0.0, 5.0),)], ids=["moved", "rested"])
@pytest.mark.parametrize("seed", range(3))
def test_a_hand_s_motion_is_followed_from_the_first_second_on(rest, seed):
    """And within what is claimed: 95 % of the samples inside 1.96 standard deviations would be 3.84 of each axis."""
    h = by_hand(seed=seed, rest=rest)
    track, _ = followed(h.imu())
    sure = converged(track)
    assert sure[h.t > 1.0].all()
    assert not sure[h.t < live.SOONEST].any()  # nothing has been looked at yet
    e = error_n(track.q_nb, h.q)
    assert rms_deg(e[h.t > 1.0]).max() < 3.0
    assert rms_deg(e[h.t > 10.0]).max() < 1.0
    body = np.einsum("nij,nj->ni", np.linalg.inv(np.linalg.cholesky(track.cov_b)), _body(track, e))
    assert np.mean(np.abs(body[h.t > 1.0]) < 1.96) > 0.9


def _body(track, e):
    return quat_rotate(quat_conjugate(track.q_nb), e)


@slow
def test_it_says_what_it_is_and_is_one_call():
    h = by_hand(20.0)
    result = estimate(h.imu(), lag="0 s")
    assert result.told.startswith("smoother (lag=0 s): the past smoothed now and then, and a filter on from there")
    assert (result.track.q_nb == followed(h.imu())[0].q_nb).all()
    assert result.filter.learned is not None  # a card can be made of it


@slow
def test_a_gap_makes_any_attitude_possible_until_the_motion_behind_it_shows_it():
    """The bias and the field of the place are kept: behind the gap nothing else is learned anew."""
    h = by_hand(40.0, rest=((0.0, 5.0),), seed=1)
    keep = (h.t < 20.0) | (h.t > 22.0)
    track, told = followed(h.rows(keep).imu())
    t, sure = h.t[keep], converged(track)
    assert not sure[(t > 22.0) & (t < 22.0 + live.SOONEST - 0.05)].any()
    assert sure[t > 25.0].all()
    assert rms_deg(error_n(track.q_nb, h.q[keep])[t > 25.0]).max() < 1.0
    assert "a gap in the samples (until 22.0 s)" in told
    bias = track.bias_b[(t > 22.0) & (t < 24.0)]
    assert np.abs(bias - track.bias_b[np.searchsorted(t, 19.9)]).max() < dps(0.1)


@slow
def test_a_heading_without_a_field_goes_on_over_looks_and_gaps(monkeypatch):
    """It counts from a free zero, which no look at the past may move: the rates explain each step."""
    monkeypatch.setattr(live, "MARGIN", 8.0)
    h = by_hand(40.0, rest=((0.0, 4.0),), seed=2)
    track, _ = followed(h.imu(mag=None))
    sure = h.t > 1.0
    assert (track.flags[sure] & np.uint32(flags.HEADING_FREE)).all()
    change = quat_angle(track.q_nb[:-1], track.q_nb[1:])
    turned = np.linalg.norm(h.gyr[1:], axis=1) * np.diff(h.t)
    assert np.abs(change - turned)[sure[1:]].max() < deg(1.5)  # what the tilt was off by in the second before, at most
    heading = error_n(track.q_nb, h.q)[:, 2]
    assert np.ptp(heading[h.t > 2.0]) < deg(3.0)


@slow
def test_a_field_that_begins_wrong_is_given_up_once_the_unit_turns_in_the_right_one():
    """The first one was seen at rest alone, which proves nothing; the claim says so as soon as there are two."""
    h = by_hand(60.0, rest=((0.0, 12.0),), seed=3)
    wrong = wrong_at_first(h, 14.0)
    track, _ = followed(h.imu(mag=wrong))
    heading = np.degrees(np.abs(error_n(track.q_nb, h.q)[:, 2]))
    assert heading[(h.t > 5.0) & (h.t < 12.0)].min() > 20.0  # nothing could have shown it
    assert not converged(track)[(h.t > 14.0 + 2.0 * onward.STEADY) & (h.t < 15.0)].any()
    assert heading[h.t > 16.5].max() < 1.0
    up = quat_rotate(quat_conjugate(track.q_nb), [0.0, 0.0, 1.0])
    sd = np.degrees(np.sqrt(np.einsum("ni,nij,nj->n", up, track.cov_b, up)))
    assert (heading < 1.96 * sd)[h.t > 16.5].all()


@slow
def test_the_field_is_unknown_until_the_unit_has_turned_in_it():
    """And where none was found though there is a magnetometer; without one nothing is missing."""
    unknown = np.uint32(flags.FIELD_UNKNOWN)
    h = by_hand(20.0, rest=((0.0, 8.0),), seed=1)
    track, _ = followed(h.imu())
    said = (track.flags & unknown) != 0
    assert said[h.t < 8.0].all()
    assert not said[h.t > 15.0].any()
    assert (followed(h.imu(mag=h.in_body([0.0, 0.0, -45.0])))[0].flags & unknown).all()
    assert not (followed(h.imu(mag=None))[0].flags & unknown).any()
    assert not (followed(h.imu(), mag=False)[0].flags & unknown).any()


@slow
def test_a_field_that_changes_at_rest_is_in_doubt_and_the_one_that_the_unit_turns_in_is_taken():
    """Which of the two is that of the place nobody knows before: both were seen at rest."""
    h = by_hand(40.0, rest=((0.0, 15.0),), seed=3)
    wrong = wrong_at_first(h, 8.0)
    track, _ = followed(h.imu(mag=wrong))
    heading = np.degrees(np.abs(error_n(track.q_nb, h.q)[:, 2]))
    taken = h.t[(h.t > 8.0) & (heading < 5.0)][0]
    assert not converged(track)[(h.t > 8.0 + 2.0 * onward.STEADY) & (h.t < taken)].any()
    turned = np.linalg.norm(h.gyr[(h.t > 14.0) & (h.t < taken)], axis=1).sum() * 0.01
    assert onward.TAKES < turned < 2.0 * onward.TAKES + deg(10.0)
    assert heading[h.t > taken].max() < 1.0


@slow
def test_a_proven_field_does_not_yield_to_another_one_in_which_the_unit_turns():
    h = by_hand(60.0, rest=((0.0, 5.0),), seed=3)
    foreign = (h.t > 30.0) & (h.t < 50.0)
    track, told = followed(
        h.imu(mag=h.mag + np.where(foreign[:, np.newaxis], 1.0, 0.0) * _in_body(h, [20.0, 0.0, 0.0]))
    )
    assert np.degrees(np.abs(error_n(track.q_nb, h.q)[h.t > 6.0, 2])).max() < 2.0
    assert "the field was not that of the place (30–50 s)" in told


@slow
def test_a_magnet_on_the_unit_is_known_after_two_seconds_of_turning():
    """58 µT, as in one trial of BROAD, on a unit that moves from its first sample on."""
    h = by_hand(12.0, seed=3)
    track, _ = followed(h.imu(mag=h.mag + np.array([0.0, 0.0, 58.0])))
    heading = np.degrees(np.abs(error_n(track.q_nb, h.q)[:, 2]))
    assert heading[h.t < 1.5].min() > 10.0
    assert heading[h.t > 3.0].max() < 2.0


@slow
@pytest.mark.parametrize("rate", [2.0, 5.0, 20.0])
def test_a_bias_that_jumps_at_rest_is_doubted_at_once_and_learned(rate):
    """The gyroscope turns by 3° within 0.8 s or less, or 1.5 s; gravity and field do not move."""
    imu = lying(60.0, lambda t: np.where(t < 30.0, 0.0, dps(rate)))
    track, _ = followed(imu)
    off, t = np.degrees(quat_angle(track.q_nb, track.q_nb[2500])), imu.t
    said = (track.flags & np.uint32(flags.INCONSISTENT)) != 0
    assert not said[t < 30.0].any()
    assert t[said][0] < 30.0 + max(3.0 / rate, 0.8) + 0.6
    assert off.max() < 3.5 * rate
    assert off[t > 40.0].max() < 1.5
    np.testing.assert_allclose(track.bias_b[-1], dps(rate) * np.array([1.0, 0.6, 1.0]), atol=dps(0.1))
    assert not said[t > 45.0].any()


@slow
def test_a_gyroscope_that_is_stuck_is_missing_until_it_says_something_new():
    h = by_hand(40.0, rest=((0.0, 5.0),), seed=1)
    stuck = (h.t > 20.0) & (h.t < 25.0)
    gyr = np.where(stuck[:, np.newaxis], h.gyr[np.flatnonzero(stuck)[0]], h.gyr)
    track, _ = followed(h.imu(gyr=gyr))
    said = (track.flags & np.uint32(flags.GYR_STUCK)) != 0
    assert said[(h.t > 20.3) & (h.t < 24.99)].all()
    assert not said[~stuck].any()
    assert not converged(track)[said & (h.t > 20.5)].any()  # nothing for 0.1 s is no gap yet
    assert rms_deg(error_n(track.q_nb, h.q)[h.t > 28.0]).max() < 1.0


@slow
def test_a_bias_that_jumps_in_motion_is_doubted_before_the_attitude_is_far_off():
    """It may take long until it is found; what is more than 30° off must not look as if it were known."""
    h = by_hand(60.0, rest=((0.0, 5.0),), seed=1)
    track, _ = followed(h.imu(gyr=h.gyr + np.where(h.t[:, np.newaxis] < 20.0, 0.0, dps(8.0))))
    off = np.degrees(np.linalg.norm(error_n(track.q_nb, h.q), axis=1))
    doubted = (track.flags & np.uint32(flags.INCONSISTENT | flags.NOT_CONVERGED)) != 0
    assert not doubted[(h.t > 1.0) & (h.t < 20.0)].any()
    assert doubted[(h.t > 20.0) & (off > 30.0)][:100].mean() > 0.5


@slow
@pytest.mark.parametrize("rate", [3.0, 8.0])
def test_a_bias_that_jumps_in_motion_is_found_by_the_seconds_that_contradict_all_before(rate):
    h = by_hand(80.0, rest=((0.0, 5.0),), seed=1)
    track, _ = followed(h.imu(gyr=h.gyr + np.where(h.t[:, np.newaxis] < 30.0, 0.0, dps(rate))))
    said = (track.flags & np.uint32(flags.INCONSISTENT)) != 0
    assert not said[h.t < 30.0].any()
    assert said[(h.t > 30.0) & (h.t < 50.0)].any()
    assert rms_deg(error_n(track.q_nb, h.q)[h.t > 60.0]).max() < 2.0
    np.testing.assert_allclose(track.bias_b[-1], dps(rate), atol=dps(0.5))


@slow
def test_a_field_that_no_place_has_is_not_believed_from_the_first_sample_on():
    """A level part of 60 µT for 4 s; the largest of the WMM 2025 is 42 µT."""
    h = by_hand(30.0, seed=2)
    magnet = h.in_body(np.where(h.t[:, np.newaxis] < 4.0, [50.0, 10.0, 0.0], 0.0) * np.ones((h.t.size, 3)))
    track, _ = followed(h.imu(mag=h.mag + magnet))
    free = (track.flags & np.uint32(flags.HEADING_FREE)) != 0
    assert free[h.t < 3.9].all()
    assert not free[h.t > 8.0].any()
    assert rms_deg(error_n(track.q_nb, h.q)[h.t > 10.0]).max() < 3.0


@slow
def test_the_first_samples_have_the_tilt_of_the_first_force():
    h = by_hand(1.0, rest=((0.0, 1.0),), seed=3)
    track, _ = followed(h.imu())
    first = h.t < live.SOONEST - 0.01
    up, seen = (quat_rotate(quat_conjugate(q[first]), [0.0, 0.0, 1.0]) for q in (track.q_nb, h.q))
    assert np.degrees(np.arccos(np.clip((up * seen).sum(axis=1), -1.0, 1.0))).max() < 3.0  # 0.1 m/s² of noise is 0.6°
    assert np.linalg.eigvalsh(track.cov_b[first]).min() > inertial.WIDE**2 * 0.99


def test_what_is_lost_may_be_anything():
    p, learned, state = np.eye(SIZE), np.ones(onward.LEARNED), standing.fresh()
    onward.begin_anew(state, 7.0, p, learned)
    assert (np.diag(p)[:3] == 1.0 + onward.ANY_ATTITUDE).all()
    assert not learned.any()
    assert (state[standing.JUMPED], state[standing.UNTIL]) == (7.0, 7.0 + standing.HOLDS)


def lying(seconds, bias):
    """A unit that lies, with a bias over time on its axes, rad/s, and noise."""
    t = np.arange(0.0, seconds, 0.01)
    rng = np.random.default_rng(2)
    gyr = bias(t)[:, np.newaxis] * [1.0, 0.6, 1.0] + rng.normal(0.0, dps(0.05), (t.size, 3))
    acc = np.array([0.0, 0.0, 9.81]) + rng.normal(0.0, 0.02, (t.size, 3))
    return ImuData(t=t, gyr=gyr, acc=acc, mag=place(t) + rng.normal(0.0, 0.2, (t.size, 3)))


def compared(rate, turns, seconds=3.0, step=0.05):
    """What contradicts a rate (3,), rad/s, of a unit that turns at another one: angles, rad, over time."""
    state, found = standing.fresh(), []
    for k in range(round(seconds / step)):
        back = quat_conjugate(quat_from_rotvec(np.asarray(turns) * (k + 0.5) * step))
        seen = np.concatenate((quat_rotate(back, [0.0, 0.0, 9.81]), quat_rotate(back, [0.0, 20.0, -40.0]), np.empty(3)))
        found.append(math.sqrt(standing.stands(state, seen, np.asarray(rate), step, (k + 1) * step)))
    return np.array(found)


def test_what_stands_still_contradicts_a_turn_by_what_that_would_have_moved():
    """About x gravity moves by the whole angle and the field (0, 20, −40) too: √2 of it."""
    none = np.zeros(3)
    rate = np.array([dps(4.0), 0.0, 0.0])
    angle = compared(rate, none)[-1]
    lag = 0.5 * standing.FIRST + standing.LATEST  # from the middle of the first mean to that of a fading one
    assert angle == pytest.approx(math.sqrt(2.0) * dps(4.0) * (3.0 - lag), rel=0.02)
    assert not compared(rate, rate).any()
    assert not compared(rate, 0.8 * rate).any()  # it moved by more than a quarter
    assert compared(rate, 0.2 * rate).any()
    assert not compared(none, rate).any()


def test_a_large_level_velocity_may_be_gravity_in_a_wrong_attitude():
    """A tilt of ε adds g ε every second; with a memory of four seconds 1 m/s is usual."""
    learned = np.zeros(onward.LEARNED)
    learned[onward.EAST_SPEED] = 1.0
    assert onward.unlikely_tilt(learned) == 0.0
    learned[onward.NORTH_SPEED] = 9.80665 * 4.0 * deg(5.0)
    assert math.sqrt(onward.unlikely_tilt(learned)) == pytest.approx(deg(5.0))


def wrong_at_first(h, until):
    """Field of a hand's motion with another one, µT, on it up to a time, s."""
    return h.mag + np.where(h.t[:, np.newaxis] < until, 1.0, 0.0) * _in_body(h, [20.0, -15.0, 10.0])


def _in_body(h, field):
    return quat_rotate(quat_conjugate(h.q), np.broadcast_to(field, (len(h.q), 3)))


def arrived(imu, size=1000):
    """Samples and steps of a stream in parts."""
    stream = arriving.Arriving(Params(), mag=True)
    kept = np.concatenate([stream.take(part) for part in imu.chunks(size)])
    return stream, kept


@slow
@pytest.mark.parametrize("size", [1, 1000])
def test_missing_values_are_held_and_made_up_for_by_the_next_ones(size):
    h = by_hand(20.0, seed=4)
    lost = np.random.default_rng(0).random(h.t.size) < 0.05
    gyr, acc = (np.where(lost[:, np.newaxis], np.nan, of) for of in (h.gyr, h.acc))
    imu = h.imu(gyr=gyr, acc=acc)
    stream, kept = arrived(imu, size)
    assert kept.all()
    ahead, held = Keyframes.of(imu, 0.049), stream.frames(slice(0, stream.steps))
    gone, n = lost[: held.t.size], held.t.size
    assert gone.sum() > 50
    for name in ("gyr", "acc"):
        one, other = (
            np.cumsum(getattr(of, name)[1:n] * np.diff(of.t[:n])[:, np.newaxis], axis=0) for of in (ahead, held)
        )
        assert np.abs(one - other)[gone[1:]].max() > 1e-4  # behind where the lines go
        np.testing.assert_allclose(
            one[~gone[1:]], other[~gone[1:]], rtol=0, atol=1e-12
        )  # and caught up by the next one
    np.testing.assert_array_equal(held.time, ahead.time[: stream.steps + 1])
    assert (held.missed > 0.0).sum() > 50
    track, _ = followed(imu)
    assert track.known.all()
    assert rms_deg(error_n(track.q_nb, h.q)[h.t > 5.0]).max() < 1.5


@slow
def test_a_hole_of_the_gyroscope_is_a_gap_and_what_lies_in_it_is_not_kept():
    """Held for as long as a step may last, 0.1 s; then the attitude stays, and may be any."""
    h = by_hand(20.0, rest=((0.0, 4.0),), seed=5)
    gyr = np.where(((h.t > 9.995) & (h.t < 10.495))[:, np.newaxis], np.nan, h.gyr)
    stream, kept = arrived(h.imu(gyr=gyr))
    gone = h.t[~kept]
    assert (gone[0], gone[-1]) == (pytest.approx(10.1), pytest.approx(10.49))
    gaps = np.flatnonzero(stream.gaps(slice(0, stream.steps)))
    assert [stream.time(int(k) + 1) for k in gaps] == [pytest.approx(10.5)]
    track, told = followed(h.imu(gyr=gyr))
    word = track.flags[~kept]
    assert (word & np.uint32(flags.GYR_HELD | flags.NOT_CONVERGED) == flags.GYR_HELD | flags.NOT_CONVERGED).all()
    assert (track.q_nb[~kept] == track.q_nb[~kept][0]).all()
    assert np.trace(track.cov_b[~kept][0]) > math.pi**2
    assert "a gap in the samples (until 10.5 s)" in told


@slow
def test_what_is_not_needed_is_let_go(monkeypatch):
    monkeypatch.setattr(live, "MARGIN", 3.0)
    h = by_hand(60.0, 50.0, seed=6)
    follower = live.Live(Params(lag=0.0), h.imu().meta, mag=True)
    held = []
    for part in h.imu().chunks(10):
        follower.take(part)
        held.append(follower._arriving.samples - follower._arriving._t.begin)
    assert max(held[len(held) // 2 :]) < 2 * 50.0 * (3.0 + 2.0 * live.LATE) + 20
    assert follower._arriving._t._rows.shape[0] < 1000


@slow
def test_a_recording_shorter_than_the_first_look_claims_nothing_and_one_rate_is_an_error():
    h = by_hand(0.2)
    track, _ = followed(h.imu())
    assert len(track) == h.t.size
    assert not converged(track).any()
    assert track.known.all()
    gyr = np.where(np.arange(h.t.size)[:, np.newaxis] < 1, h.gyr, np.nan)
    with pytest.raises(ShapeError, match="needs two samples with a rate"):
        followed(h.imu(gyr=gyr))


@slow
@pytest.mark.parametrize("calibrated", [True, False], ids=["calibrated", "uncalibrated"])
@pytest.mark.parametrize("mag", [True, False], ids=["field", "no field"])
@pytest.mark.parametrize("size", [1, 7, 1000])
def test_a_stream_in_parts_is_the_recording_to_the_bit(monkeypatch, size, mag, calibrated):
    """In parts of any size, with gaps, holes and missing values, and with looks that a thread takes meanwhile."""
    monkeypatch.setattr(live, "SHORT", 1.0)
    monkeypatch.setattr(live, "MARGIN", 8.0)
    h = by_hand(30.0, rest=((0.0, 3.0),), seed=5)
    lost = (np.random.default_rng(1).random(h.t.size) < 0.02) | ((h.t > 20.0) & (h.t < 20.4))
    keep = (h.t < 12.0) | (h.t > 13.0)
    imu = h.imu(gyr=np.where(lost[:, np.newaxis], np.nan, h.gyr))
    meta = imu.meta if calibrated else ImuMeta()
    imu = ImuData(t=imu.t[keep], gyr=imu.gyr[keep], acc=imu.acc[keep], mag=imu.mag[keep], meta=meta)
    params = {"lag": 0.0, "mag": mag, "latency": 0.003}
    whole, stream = Smoother(frame="NED", params=params).process(imu), FixedLag(frame="NED", params=params)
    parts = [stream.take(part) for part in imu.chunks(size)]
    assert stream.finish() is None
    for name in ("t", "q_nb", "bias_b", "cov_b", "flags", "mag_weight"):
        np.testing.assert_array_equal(np.concatenate([getattr(p, name) for p in parts]), getattr(whole, name))


@slow
@pytest.mark.parametrize("size", [1, 7])
def test_doubts_and_what_ends_them_do_not_depend_on_the_parts(size):
    """A field that changes at rest and is taken in motion; a bias that jumps at rest."""
    h = by_hand(25.0, rest=((0.0, 15.0),), seed=3)
    wrong = wrong_at_first(h, 8.0)
    for imu in (h.imu(mag=wrong), lying(25.0, lambda t: np.where(t < 12.0, 0.0, dps(5.0)))):
        whole, stream = followed(imu)[0], FixedLag(frame="ENU", params={"lag": 0.0})
        parts = [stream.take(part) for part in imu.chunks(size)]
        stream.finish()
        for name in ("q_nb", "bias_b", "cov_b", "flags"):
            np.testing.assert_array_equal(np.concatenate([getattr(p, name) for p in parts]), getattr(whole, name))


@slow
def test_a_free_heading_is_as_uncertain_as_what_nothing_shows_of_the_gyroscope():
    h = by_hand(60.0, seed=6)  # nothing rests
    track, _ = followed(h.imu(mag=None))
    up = quat_rotate(quat_conjugate(track.q_nb), [0.0, 0.0, 1.0])
    sd = np.sqrt(np.einsum("ni,nij,nj->n", up, track.cov_b, up))
    late = h.t > 20.0
    assert (sd[late] > BIAS_REPEATS * h.t[late]).all()
    turned = error_n(track.q_nb, h.q)[:, 2]
    assert (np.abs(turned - turned[100])[late] < 1.96 * sd[late]).all()


@slow
def test_what_is_remarked_at_the_end_does_not_depend_on_the_parts(monkeypatch):
    """A field that is wrong for the last ten seconds, in parts after which few samples are left."""
    h = by_hand(60.0, seed=8)
    wrong = h.mag + np.where(h.t[:, np.newaxis] > 50.0, 1.0, 0.0) * _in_body(h, [0.0, 25.0, 25.0])
    told = []
    for size in (10_000, 2500):
        monkeypatch.setattr("plumbob.filters.smoother.smoothing.AT_ONCE", size)
        told.append(followed(h.imu(mag=wrong))[1])
    assert told[0] == told[1]
    assert "the field was not that of the place (50–60 s)" in told[0]


# --- the pieces ---------------------------------------------------------------------------------------------


def test_a_field_weighs_what_it_weighs_in_a_smoothed_recording():
    """The same formula, step by step and for all at once."""
    p, reference = Params(), Reference(20.0, -40.0, 1.0)
    rng = np.random.default_rng(0)
    fields = np.array([0.0, 20.0, -40.0]) + rng.normal(0.0, [8.0, 8.0, 4.0], (200, 3))
    expected = weights(reference, p, fields, np.zeros(200, dtype=bool), directed=True)
    mean = np.zeros(MEANS)
    mean[COUNT] = 5.0
    for field, weight in zip(fields, expected, strict=True):
        mean[FIELD : FIELD + 3] = field
        assert onward.field_weight(mean, onward.Field.of(reference, p)) == pytest.approx(weight, rel=1e-12)
    mean[COUNT] = 0.0
    assert onward.field_weight(mean, onward.Field.of(reference, p)) == 0.0
    assert onward.field_weight(mean, onward.Field.of(None, p)) == 0.0


def test_the_speed_of_a_swing_is_learned():
    """Of a cos(ωt) the speed is a/ω, here on one of two axes; it lasts about a period, 6 σ_v / σ_a = 6/ω."""
    dt, omega, force = 0.05, 2.0 * math.pi * 1.0, 3.0
    learned, mean = np.zeros(onward.LEARNED), np.zeros(MEANS)
    densities = []
    for k in range(2000):
        mean[FORCE] = dt * force * math.cos(omega * k * dt)
        densities.append(onward.velocity_density(learned, mean, dt, 0.05, False))
    speed2 = 0.25 * (force / omega) ** 2  # mean of ½ v²
    assert np.mean(densities[-200:]) == pytest.approx(2.0 * 6.0 / omega * speed2, rel=0.1)
    quiet = onward.velocity_density(np.zeros(onward.LEARNED), np.zeros(MEANS), dt, 0.05, False)
    assert quiet == pytest.approx(2.0 * inertial.SHORTEST * 0.05**2)


def test_what_proves_a_field_is_turning_in_it():
    p = Params()
    place = live.Proven(Reference(20.0, -40.0, 1.0), turning=30.0, rest=100.0)
    assert place.settled
    assert place.known(None, 0.0, 0.0).seen == pytest.approx(2.0 * 130.0)  # nothing turns: all that was seen
    assert place.known(None, 5.0, 0.0).seen == pytest.approx(2.0 * (30.0 + 24.0 - 10.0))
    young = live.Proven(Reference(20.0, -40.0, 1.0), turning=2.0, rest=100.0)
    assert young.known(None, 5.0, 0.0).seen == 0.0
    lain = live.Proven(Reference(20.0, -40.0, 1.0), turning=0.5, rest=100.0)
    assert not lain.settled
    lain.take(Reference(30.0, -30.0, 0.0), since=50.0)
    assert lain.settled
    assert lain.known(None, 5.0, 20.0).seen == pytest.approx(0.8 * 5.0)  # as much as the rest in the other one counts
    assert lain.known(None, 5.0, 60.0).seen == 0.0  # which is not asked any more
    assert p.mag_spread * 3.0 < Reference(20.0, -40.0, 1.0).apart(Reference(27.0, -40.0, 1.0))


def test_a_heading_from_elsewhere_turns_all_that_lies_in_the_level():
    rng = np.random.default_rng(1)
    root = rng.normal(size=(SIZE, SIZE))
    last = Last(quat_from_rotvec(np.array([0.1, -0.2, 0.3])), rng.normal(size=SIZE), root @ root.T)
    learned = rng.normal(size=onward.LEARNED)
    there, faster = Last(*(of.copy() for of in last)), learned.copy()
    onward.turn_heading_by(0.7, *there, faster)
    assert live._heading_between(last.attitude, there.attitude) == pytest.approx(0.7)
    back, slower = Last(*(of.copy() for of in there)), faster.copy()
    onward.turn_heading_by(-0.7, *back, slower)
    for one, other in zip((*last, learned), (*back, slower), strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-10)
    level = slice(onward.EAST_SPEED, onward.NORTH_SPEED + 1)
    turned = quat_rotate(quat_from_rotvec(np.array([0.0, 0.0, 0.7])), [*learned[level], 0.0])
    np.testing.assert_allclose(faster[level], turned[:2], rtol=1e-12)
    assert there.cov[2, 2] == pytest.approx(last.cov[2, 2])
    assert np.trace(there.cov[:2, :2]) == pytest.approx(np.trace(last.cov[:2, :2]))
    assert math.hypot(*there.state[6:8]) == pytest.approx(math.hypot(*last.state[6:8]))


def test_a_calm_window_that_ends_now_is_calm_later_than_one_around_now():
    h = by_hand(20.0, rest=((5.0, 10.0),), seed=6)
    frames, p = Keyframes.of(h.imu(), 0.049), Params()
    stream, _ = arrived(h.imu())
    around, (so_far, mean) = calm(frames, p).quiet, stream.quiet(slice(0, stream.steps))
    begin, end = (frames.time[np.flatnonzero(around)[i] + 1] for i in (0, -1))
    assert stream.time(np.flatnonzero(so_far)[0] + 1) == pytest.approx(begin + 0.5 * p.rest_time, abs=0.11)
    assert stream.time(np.flatnonzero(so_far)[-1] + 1) == pytest.approx(end + 0.5 * p.rest_time, abs=0.11)
    last = np.flatnonzero(so_far)[-1]
    window = (h.t > stream.time(last + 1) - p.rest_time) & (h.t <= stream.time(last + 1))
    np.testing.assert_allclose(mean[last], h.gyr[window].mean(axis=0), atol=deg(0.1))


def still(seconds, rate_z, field):
    """A unit whose gyroscope shows an even rate about the vertical, and a field (N, 3) over time, or none."""
    t = np.arange(0.0, seconds, 0.01)
    rng = np.random.default_rng(7)
    gyr = np.array([0.0, 0.0, rate_z]) + rng.normal(0.0, dps(0.05), (t.size, 3))
    acc = np.array([0.0, 0.0, 9.81]) + rng.normal(0.0, 0.02, (t.size, 3))
    mag = None if field is None else field(t) + rng.normal(0.0, 0.2, (t.size, 3))
    return Keyframes.of(ImuData(t=t, gyr=gyr, acc=acc, mag=mag), 0.049)


def place(t, turned=0.0):
    return np.stack((20.0 * np.sin(turned + 0.0 * t), 20.0 * np.cos(turned + 0.0 * t), -40.0 + 0.0 * t), axis=1)


def test_a_field_that_jumps_at_rest_is_no_turn_and_one_that_goes_round_evenly_is():
    """9 °/s, or a magnet that is put beside the unit and turns its field by as much as that in ten seconds."""
    rate = dps(9.0)
    p = Params()
    even = still(10.0, rate, lambda t: place(t, rate * t))
    jump = still(10.0, 0.0, lambda t: np.where(t[:, np.newaxis] < 6.0, place(t), place(t, 10.0 * rate)))
    assert not calm(even, p).quiet.any()
    assert calm(jump, p).quiet.mean() > 0.8


@pytest.mark.parametrize(("seconds", "found"), [(3.0, False), (12.0, True)])
def test_a_calm_second_with_a_large_rate_about_gravity_is_a_turn_and_a_long_one_a_bias(seconds, found):
    """8 °/s is 1.6 of the bias's standard deviations, each of which takes 3 s of rest where no field tells."""
    frames, p = still(seconds, dps(8.0), None), Params()
    resting, bias = first_rest(calm(frames, p), p, frames.step)
    assert resting.any() == found
    assert bias[2] == pytest.approx(dps(8.0) if found else 0.0, abs=dps(0.05))


@slow
def test_all_rest_counts_no_more_than_most_of_the_turning():
    h = by_hand(60.0, rest=((0.0, 40.0),), seed=8)
    frames, p = Keyframes.of(h.imu(), 0.049), Params()
    seen = inertial.level(frames, p)
    share = share_of_rest(frames, seen)
    assert (share[~seen.resting] == 1.0).all()
    turning = live.turning_time(frames, seen.sweep.bias[1:], seen.resting).sum()
    assert (share * frames.step)[seen.resting].sum() == pytest.approx(0.8 * turning)


def test_a_field_far_off_is_another_one_however_far_all_are_off():
    """A reference that half of the fields miss by their own size is believed no wider than a fifth of it."""
    assert Reference(30.0, -40.0, 60.0).spread(Params()) == pytest.approx(10.0)
    assert Reference(30.0, -40.0, 2.0).spread(Params()) == pytest.approx(3.0)


def test_the_middle_of_values_is_that_of_their_weight():
    values = np.array([4.0, 1.0, 3.0, 2.0])
    assert middle_of(values, np.ones(4)) == 2.0
    assert middle_of(values, np.array([10.0, 1.0, 1.0, 1.0])) == 4.0
    assert middle_of(values, np.array([1.0, 1.0, 3.0, 1.0])) == 3.0
