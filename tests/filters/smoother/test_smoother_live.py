"""Without a lag: right from the first seconds on, and what a few samples cannot tell is decided by all of them.

That nothing later changes an estimate is in test_smoother_keyframes, with the other lags; what it is made of has tests
of its own in test_smoother_pieces.
"""

import gc
import itertools
import math
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

from plumbob import ImuData, ImuMeta, flags
from plumbob.core.constants import G0
from plumbob.core.errors import ShapeError
from plumbob.core.units import deg, dps
from plumbob.data.cards.residuals import upper_half
from plumbob.filters.smoother import FixedLag, Smoother, inertial, live
from plumbob.filters.smoother import causal as onward
from plumbob.filters.smoother.keyframes import Keyframes
from plumbob.filters.smoother.model import BIAS_REPEATS, Params
from plumbob.rotations import (
    dcm_from_quat,
    quat_angle,
    quat_conjugate,
    quat_from_euler_zyx,
    quat_multiply,
    quat_rotate,
    rotvec_from_quat,
)
from tests.helpers import slow_as_python
from tests.helpers.hand_motion import by_hand, error_n, rms_deg
from tests.helpers.motion import heading_sd, tilt_between
from tests.helpers.smoother_pieces import arrived, place

pytestmark = slow_as_python

NOT_CONVERGED = np.uint32(flags.NOT_CONVERGED)


def followed(imu, **params):
    """Track without a lag, and what was remarked."""
    smoother = Smoother(frame="ENU", params={"lag": 0.0, **params})
    return smoother.process(imu), " ".join(map(str, smoother.remarks))


def converged(track):
    return (track.flags & NOT_CONVERGED) == 0


@pytest.mark.parametrize("rest", [(), ((0.0, 5.0),)], ids=["moved", "rested"])
@pytest.mark.parametrize("seed", range(3))
def test_a_hand_s_motion_is_followed_from_the_first_second_on(rest, seed):
    """And within what is claimed: 95 % of the samples inside 1.96 standard deviations would be 3.84 of each axis."""
    h = by_hand(25.0, seed=seed, rest=rest)
    track, _ = followed(h.imu())
    sure = converged(track)
    assert sure[h.t > 1.0].all()
    assert not sure[h.t < live.SOONEST].any()  # nothing has been looked at yet
    e = error_n(track.q_nb, h.q)
    assert rms_deg(e[h.t > 1.0]).max() < 3.0 and rms_deg(e[h.t > 10.0]).max() < 1.0
    in_body = quat_rotate(quat_conjugate(track.q_nb), e)
    body = np.einsum("nij,nj->ni", np.linalg.inv(np.linalg.cholesky(track.cov_b)), in_body)
    assert np.mean(np.abs(body[h.t > 1.0]) < 1.96) > 0.9


@pytest.mark.parametrize("field", [True, False], ids=["field", "no field"])
@pytest.mark.parametrize("scale", [1.08, 1.04, 0.93])
def test_a_scale_that_a_data_sheet_allows_is_found_by_what_was_moved(scale, field):
    """Taken for calibrated until a look shows it, the unit would be 2 to 7° off: 4 to 8 % of 0.9 rad to and fro."""
    h = by_hand(60.0, seed=2, rest=((0.0, 5.0),))
    track, _ = followed(h.imu(gyr=scale * h.gyr, mag=h.mag if field else None))
    e = error_n(track.q_nb, h.q)
    if not field:
        e[:, 2] -= np.median(e[:, 2])
    assert rms_deg(e[h.t > 10.0]).max() < 1.0


@pytest.mark.parametrize("field", [True, False], ids=["field", "no field"])
@pytest.mark.parametrize("seed", [2, 3])
def test_a_wrong_scale_that_loses_the_attitude_is_no_jump_of_the_bias(seed, field):
    """From rest into turns of 8 rad/s, by 8 % too large: the attitude is lost at once, and again and again.

    As long as each time was taken for another bias, no look saw enough to find the scale: 5 to 12° without a field.
    """
    h = by_hand(90.0, seed=seed, rest=((0.0, 30.0),), turn=6.0)
    track, _ = followed(h.imu(gyr=1.08 * h.gyr, mag=h.mag if field else None))
    tilt, heading = rms_deg(error_n(track.q_nb, h.q)[h.t > 45.0])
    assert tilt < (1.0 if field else 3.0)
    assert heading < 1.0 or not field


def test_a_gap_makes_any_attitude_possible_until_the_motion_behind_it_shows_it():
    """The bias and the field of the place are kept: behind the gap nothing else is learned anew."""
    h = by_hand(40.0, rest=((0.0, 5.0),), seed=1)
    keep = (h.t < 20.0) | (h.t > 22.0)
    track, told = followed(h.rows(keep).imu())
    t, sure = h.t[keep], converged(track)
    assert not sure[(t > 22.0) & (t < 22.0 + live.SOONEST - 0.05)].any() and sure[t > 25.0].all()
    assert rms_deg(error_n(track.q_nb, h.q[keep])[t > 25.0]).max() < 1.0
    assert "1 gap in the samples (until 22.0 s)" in told
    bias = track.bias_b[(t > 22.0) & (t < 24.0)]
    assert np.abs(bias - track.bias_b[np.searchsorted(t, 19.9)]).max() < dps(0.1)


@pytest.mark.parametrize("length", [1.0, 3.0, 10.0])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_first_force_behind_a_gap_shows_the_tilt_and_the_first_fields_the_heading(length, seed):
    """The tilt at once as well as at a start in motion, whatever was turned in the gap; both within the claim."""
    h = by_hand(60.0, rest=((0.0, 5.0),), seed=seed, turn=1.5)
    keep = (h.t < 30.0) | (h.t > 30.0 + length)
    track, _ = followed(h.rows(keep).imu())
    since, error = h.t[keep] - 30.0 - length, error_n(track.q_nb, h.q[keep])
    assert rms_deg(error[(since > 0.0) & (since < 0.5)])[0] < math.degrees(inertial.WIDE)
    assert rms_deg(error[(since > 1.0) & (since < 2.0)])[0] < 3.0
    assert rms_deg(error[since > 4.0]).max() < 1.5
    behind = (since > 0.0) & (since < 4.0)
    in_body = quat_rotate(quat_conjugate(track.q_nb[behind]), error[behind])
    claimed = np.linalg.inv(np.linalg.cholesky(track.cov_b[behind]))
    assert np.mean(np.einsum("nij,nj->ni", claimed, in_body) ** 2) < 4.0


@pytest.mark.parametrize("begin", [26, 31])
def test_a_look_that_falls_due_in_a_long_gap_has_no_seconds_before_it_to_doubt(begin):
    """Of the fifteen seconds in which a jump of the bias is sought nothing came."""
    h = by_hand(60.0, rest=((0.0, 5.0),), seed=1)
    keep = (h.t < begin) | (h.t > begin + 20.0)
    track, _ = followed(h.rows(keep).imu())
    assert rms_deg(error_n(track.q_nb, h.q[keep])[h.t[keep] > begin + 23.0]).max() < 1.5


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


def test_a_field_that_begins_wrong_is_given_up_once_the_unit_turns_in_the_right_one():
    """The first one was seen at rest alone, which proves nothing; the claim says so as soon as there are two."""
    h = by_hand(60.0, rest=((0.0, 12.0),), seed=3)
    wrong = wrong_at_first(h, 14.0)
    track, _ = followed(h.imu(mag=wrong))
    heading = np.degrees(np.abs(error_n(track.q_nb, h.q)[:, 2]))
    assert heading[(h.t > 5.0) & (h.t < 12.0)].min() > 20.0  # nothing could have shown it
    assert not converged(track)[(h.t > 14.0 + 2.0 * onward.STEADY) & (h.t < 15.0)].any()
    assert heading[h.t > 16.5].max() < 1.0
    assert (heading < 1.96 * np.degrees(heading_sd(track.q_nb, track.cov_b)))[h.t > 16.5].all()


def test_the_field_is_unknown_until_the_unit_has_turned_in_it():
    """And where none was found though there is a magnetometer; without one nothing is missing."""
    unknown = np.uint32(flags.FIELD_UNKNOWN)
    h = by_hand(20.0, rest=((0.0, 8.0),), seed=1)
    track, _ = followed(h.imu())
    said = (track.flags & unknown) != 0
    assert said[h.t < 8.0].all() and not said[h.t > 15.0].any()
    assert (followed(h.imu(mag=h.in_body([0.0, 0.0, -45.0])))[0].flags & unknown).all()
    assert not (followed(h.imu(mag=None))[0].flags & unknown).any()
    assert not (followed(h.imu(), mag=False)[0].flags & unknown).any()


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


def test_a_proven_field_does_not_yield_to_another_one_in_which_the_unit_turns():
    h = by_hand(40.0, rest=((0.0, 5.0),), seed=3)
    foreign = np.where(((h.t > 20.0) & (h.t < 35.0))[:, np.newaxis], [20.0, 0.0, 0.0], 0.0)
    track, told = followed(h.imu(mag=h.mag + h.in_body(foreign)))
    assert np.degrees(np.abs(error_n(track.q_nb, h.q)[h.t > 6.0, 2])).max() < 2.0
    assert "the field was not that of the place (20–35 s)" in told


def test_a_magnet_on_the_unit_is_known_after_two_seconds_of_turning():
    """58 µT, as in one trial of BROAD, on a unit that moves from its first sample on."""
    h = by_hand(12.0, seed=3)
    track, _ = followed(h.imu(mag=h.mag + np.array([0.0, 0.0, 58.0])))
    heading = np.degrees(np.abs(error_n(track.q_nb, h.q)[:, 2]))
    assert heading[h.t < 1.5].min() > 10.0 and heading[h.t > 3.0].max() < 2.0


@pytest.mark.parametrize("rate", [2.0, 5.0, 20.0])
def test_a_bias_that_jumps_at_rest_is_doubted_at_once_and_learned(rate):
    """The gyroscope turns by 3° within 0.8 s or less, or 1.5 s; gravity and field do not move."""
    imu = lying(50.0, lambda t: np.where(t < 30.0, 0.0, dps(rate)))
    track, _ = followed(imu)
    off, t = np.degrees(quat_angle(track.q_nb, track.q_nb[2500])), imu.t
    said = (track.flags & np.uint32(flags.INCONSISTENT)) != 0
    assert not said[t < 30.0].any()
    assert t[said][0] < 30.0 + max(3.0 / rate, 0.8) + 0.6
    assert off.max() < 3.5 * rate and off[t > 40.0].max() < 1.5
    np.testing.assert_allclose(track.bias_b[-1], dps(rate) * np.array([1.0, 0.6, 1.0]), atol=dps(0.1))
    assert not said[t > 45.0].any()


def test_a_gyroscope_that_is_stuck_is_missing_until_it_says_something_new():
    h = by_hand(40.0, rest=((0.0, 5.0),), seed=1)
    stuck = (h.t > 20.0) & (h.t < 25.0)
    gyr = np.where(stuck[:, np.newaxis], h.gyr[np.flatnonzero(stuck)[0]], h.gyr)
    track, _ = followed(h.imu(gyr=gyr))
    said = (track.flags & np.uint32(flags.GYR_STUCK)) != 0
    assert said[(h.t > 20.3) & (h.t < 24.99)].all() and not said[~stuck].any()
    assert not converged(track)[said & (h.t > 20.5)].any()  # nothing for 0.1 s is no gap yet
    assert rms_deg(error_n(track.q_nb, h.q)[h.t > 28.0]).max() < 1.0


@pytest.mark.parametrize("rate", [1.0, 3.0, 8.0])
@pytest.mark.parametrize("card", [False, True])
def test_a_bias_that_jumps_in_motion_is_found_by_the_seconds_that_contradict_all_before(rate, card):
    """It may take long until it is found; what is more than 30° off must not look as if it were known.

    A card says how well the bias was known, 0.02 °/s here, and nothing of one that has become another.
    """
    h = by_hand(70.0, rest=((0.0, 5.0),), seed=1)
    imu = h.imu(gyr=h.gyr + np.where(h.t[:, np.newaxis] < 30.0, 0.0, dps(rate)))
    if card:
        residual = np.diag([dps(0.02) ** 2] * 3 + [1e-6] * 9)
        imu = replace(imu, meta=replace(imu.meta, gyr_left=upper_half(residual)))
    track, _ = followed(imu)
    said = (track.flags & np.uint32(flags.INCONSISTENT)) != 0
    e = error_n(track.q_nb, h.q)
    assert not (said | ~converged(track))[(h.t > 1.0) & (h.t < 30.0)].any()
    assert said[(h.t > 30.0) & (h.t < 50.0)].any()
    far = (h.t > 30.0) & (np.degrees(np.linalg.norm(e, axis=1)) > 30.0)
    assert not far.any() or (said | ~converged(track))[far][:100].mean() > 0.5
    assert rms_deg(e[h.t > 50.0]).max() < 2.0
    np.testing.assert_allclose(track.bias_b[-1], dps(rate), atol=dps(0.1))


def test_the_first_samples_have_the_tilt_of_the_force_and_believe_no_field_that_no_place_has():
    """A level part of 60 µT for 4 s; the largest of the WMM 2025 is 42 µT."""
    h = by_hand(30.0, seed=2)
    magnet = h.in_body(np.where(h.t[:, np.newaxis] < 4.0, [50.0, 10.0, 0.0], 0.0) * np.ones((h.t.size, 3)))
    track, _ = followed(h.imu(mag=h.mag + magnet))
    free = (track.flags & np.uint32(flags.HEADING_FREE)) != 0
    assert free[h.t < 3.9].all() and not free[h.t > 8.0].any()
    assert rms_deg(error_n(track.q_nb, h.q)[h.t > 10.0]).max() < 3.0
    h = by_hand(1.0, rest=((0.0, 1.0),), seed=3)
    track, _ = followed(h.imu())
    first = h.t < live.SOONEST - 0.01
    assert np.degrees(tilt_between(track.q_nb, h.q)[first]).max() < 3.0  # 0.1 m/s² of noise is 0.6°
    assert np.linalg.eigvalsh(track.cov_b[first]).min() > inertial.WIDE**2 * 0.99


def lying(seconds, bias):
    """A unit that lies, with a bias over time on its axes, rad/s, and noise."""
    t = np.arange(0.0, seconds, 0.01)
    rng = np.random.default_rng(2)
    gyr = bias(t)[:, np.newaxis] * [1.0, 0.6, 1.0] + rng.normal(0.0, dps(0.05), (t.size, 3))
    acc = np.array([0.0, 0.0, 9.81]) + rng.normal(0.0, 0.02, (t.size, 3))
    return ImuData(t=t, gyr=gyr, acc=acc, mag=place(t) + rng.normal(0.0, 0.2, (t.size, 3)))


def banked(seconds):
    """A level turn at 20 m/s between straight flight, banked by 20°, so that no force leaves the sensor's z axis."""
    t = np.arange(0.0, seconds, 0.01)
    ramp = np.clip(np.minimum(t - 20.0, 50.0 - t) / 2.0, 0.0, 1.0)
    bank = deg(20.0) * (3.0 * ramp**2 - 2.0 * ramp**3)
    yaw = np.cumsum(G0 * np.tan(bank) / 20.0 * 0.01)
    q = quat_from_euler_zyx(np.stack((yaw, 0.0 * t, -bank), axis=1))
    gyr = rotvec_from_quat(quat_multiply(quat_conjugate(q), np.concatenate((q[1:], q[-1:])))) / 0.01
    gyr, rng = np.concatenate((gyr[:1], gyr[:-1])), np.random.default_rng(1)
    force = G0 * np.stack((-np.tan(bank) * np.sin(yaw), np.tan(bank) * np.cos(yaw), np.ones(t.size)), axis=1)
    acc, mag = (quat_rotate(quat_conjugate(q), of) for of in (force, np.tile([0.0, 20.0, -40.0], (t.size, 1))))
    noise = {"gyr": dps(0.05), "acc": 0.02, "mag": 0.2}
    triads = {k: v + rng.normal(0.0, noise[k], v.shape) for k, v in {"gyr": gyr, "acc": acc, "mag": mag}.items()}
    return ImuData(t=t, **triads, meta=ImuMeta(calibration="simulated")), q


@pytest.mark.parametrize("seconds", [51.9, 60.0, 90.0])
@pytest.mark.parametrize("lag", [None, 0.0])
def test_what_a_fast_body_rests_from_is_no_error_of_its_gyroscope(lag, seconds):
    """Behind a turn the level velocity is another one, for good: a scale of 60 % would explain that as well."""
    imu, q = banked(seconds)
    track = Smoother(frame="ENU", params={"lag": lag or 0.0} if lag is not None else {}).process(imu)
    assert rms_deg(error_n(track.q_nb, q))[0] < 0.3


@pytest.mark.parametrize("rate", [2.0, 5.0, 20.0])
@pytest.mark.parametrize("seed", [1, 2])
def test_an_attitude_that_a_field_of_the_right_size_contradicts_is_in_doubt(rate, seed):
    """A bias that jumps in motion is not silent for a second, beyond twice what 2 µT of spread turn 45 µT: 5°."""
    h = by_hand(45.0, rest=((0.0, 3.0),), seed=seed)
    track, _ = followed(h.imu(gyr=h.gyr + np.where(h.t[:, np.newaxis] > 30.0, dps(rate), 0.0)))
    error, up = np.abs(error_n(track.q_nb, h.q)), dcm_from_quat(track.q_nb)
    tilt, heading = np.hypot(error[:, 0], error[:, 1]), error[:, 2]
    cov = up @ track.cov_b @ np.swapaxes(up, 1, 2)
    said = (tilt < 3.0 * np.sqrt(cov[:, 0, 0] + cov[:, 1, 1])) & (heading < 3.0 * np.sqrt(cov[:, 2, 2]))
    assert 0.01 * np.sum((np.hypot(tilt, heading) > deg(5.0)) & ~said & converged(track)) < 1.0


def test_the_heading_is_in_doubt_as_the_rule_of_succession_has_it_where_fields_contradict():
    """In a wrong field for 20 s and then in the right one: one second in 22 at first, then one in two."""
    h = by_hand(45.0, seed=2)
    track, _ = followed(h.imu(mag=wrong_at_first(h, 20.0)))
    error = np.abs(error_n(track.q_nb, h.q)[:, 2])
    behind = (h.t > 20.3) & (h.t < 40.0)
    assert error[behind].max() > deg(20.0)
    assert (error[behind] < 5.0 * heading_sd(track.q_nb, track.cov_b)[behind]).mean() > 0.97


def wrong_at_first(h, until):
    """Field of a hand's motion with another one, µT, on it up to a time, s."""
    return h.mag + h.in_body(np.where(h.t[:, np.newaxis] < until, [20.0, -15.0, 10.0], 0.0))


@pytest.mark.parametrize("size", [1, 1000])
def test_missing_values_are_foreseen_and_made_up_for_by_the_next_ones(size):
    """Mean and spread are those of what came before, and of both sides where all is known: a thousandth of a turn."""
    h = by_hand(12.0, seed=4)
    lost = np.random.default_rng(0).random(h.t.size) < 0.05
    gyr, acc = (np.where(lost[:, np.newaxis], np.nan, of) for of in (h.gyr, h.acc))
    imu = h.imu(gyr=gyr, acc=acc)
    stream, kept = arrived(imu, size)
    assert kept.all()
    ahead, held = Keyframes.from_imu(imu, Params().keyframe), stream.frames(slice(0, stream.steps))
    gone, n = lost[: held.t.size], held.t.size
    assert gone.sum() > 30
    for name in ("gyr", "acc"):
        dt = np.diff(held.t)[:, np.newaxis]
        line, steps = (np.cumsum(getattr(of, name)[1:n] * dt, axis=0) for of in (ahead, held))
        assert np.abs(line - steps)[gone[1:]].max() > 1e-4  # behind where the lines go
        np.testing.assert_allclose(line[~gone[1:]], steps[~gone[1:]], rtol=0, atol=2e-3)  # caught up by the next one
    np.testing.assert_array_equal(held.time, ahead.time[: stream.steps + 1])
    assert (held.missed > 0.0).sum() > 30
    if size == 1000:
        track, _ = followed(imu)
        assert track.known.all() and rms_deg(error_n(track.q_nb, h.q)[h.t > 5.0]).max() < 1.5


def test_a_hole_of_the_gyroscope_is_a_gap_and_what_lies_in_it_is_not_kept():
    """Foreseen for as long as the tilt is known better so than from gravity; then the attitude may be any."""
    h = by_hand(20.0, rest=((0.0, 4.0),), seed=5)
    gyr = np.where(((h.t > 9.995) & (h.t < 12.995))[:, np.newaxis], np.nan, h.gyr)
    stream, kept = arrived(h.imu(gyr=gyr))
    gone = h.t[~kept]
    assert 10.1 < gone[0] < 11.0 and gone[-1] == pytest.approx(12.99)
    gaps = np.flatnonzero(stream.gaps(slice(0, stream.steps)))
    assert [stream.time(int(k) + 1) for k in gaps] == [pytest.approx(13.0)]
    track, told = followed(h.imu(gyr=gyr))
    word = track.flags[~kept]
    assert (word & np.uint32(flags.GYR_HELD | flags.NOT_CONVERGED) == flags.GYR_HELD | flags.NOT_CONVERGED).all()
    assert (track.q_nb[~kept] == track.q_nb[~kept][0]).all() and np.trace(track.cov_b[~kept][0]) > math.pi**2
    assert "1 gap in the samples (until 13.0 s)" in told


def test_a_gyroscope_that_is_silent_at_rest_leaves_the_attitude_as_it_is():
    """What came before says that nothing moved; gravity shows no other tilt."""
    h = by_hand(16.0, rest=((0.0, 14.0),), seed=5)
    gyr = np.where(((h.t > 7.995) & (h.t < 9.495))[:, np.newaxis], np.nan, h.gyr)
    track, _ = followed(h.imu(gyr=gyr))
    before, within = (np.trace(track.cov_b[int(100 * at)]) for at in (7.9, 9.4))
    assert within < before + deg(1.0) ** 2


@pytest.mark.parametrize("lag", [0.0, 5.0])
def test_a_bias_that_a_rest_has_shown_is_not_forgotten_when_no_look_sees_it_any_more(monkeypatch, lag):
    """In a window of 20 s without rest or field the bias may be any; its walk in 60 s allows 0.05 °/s."""
    monkeypatch.setattr(live, "MARGIN", 20.0)
    h = by_hand(80.0, 50.0, rest=((0.0, 10.0),), seed=2)
    bias = deg(np.array([0.8, -0.5, 0.6]))
    track, _ = followed(h.imu(gyr=h.gyr + bias, mag=None), lag=lag)
    assert np.degrees(np.abs(track.bias_b[h.t > 40.0] - bias)).max() < 0.006 * math.sqrt(60.0)


def test_what_is_not_needed_is_let_go(monkeypatch):
    """All arrays that it holds together, once the first samples lie behind what is looked at, and half a minute later.

    What is kept of 1500 samples more would be their times and values, 10 numbers of 8 bytes, at least.
    """
    monkeypatch.setattr(live, "MARGIN", 3.0)
    h = by_hand(60.0, 50.0, seed=6)
    follower, sizes = live.Live(Params(lag=0.0), h.imu().meta, mag=True), []
    for part in h.imu().chunks(50):
        follower.take(part)
        sizes.append(held_bytes(follower))
    assert max(sizes[45:]) < max(sizes[15:30]) + 0.5 * 1500 * 80


def held_bytes(holder):
    """Bytes of all arrays that an object of the package reaches."""
    known, ahead = {}, [holder]
    while ahead:
        part = ahead.pop()
        ours = type(part).__module__.split(".")[0] in {"plumbob", "builtins", "collections", "numpy"}
        if ours and not callable(part) and not isinstance(part, ModuleType) and id(part) not in known:
            known[id(part)] = part
            ahead += gc.get_referents(part)
    return sum(part.nbytes for part in known.values() if isinstance(part, np.ndarray) and part.base is None)


def test_a_recording_shorter_than_the_first_look_claims_nothing_and_one_rate_is_an_error():
    h = by_hand(0.2)
    track, _ = followed(h.imu())
    assert len(track) == h.t.size
    assert not converged(track).any() and track.known.all()
    gyr = np.where(np.arange(h.t.size)[:, np.newaxis] < 1, h.gyr, np.nan)
    with pytest.raises(ShapeError, match="needs two samples with a rate"):
        followed(h.imu(gyr=gyr))


@pytest.mark.parametrize("calibrated", [True, False], ids=["calibrated", "uncalibrated"])
@pytest.mark.parametrize("mag", [True, False], ids=["field", "no field"])
@pytest.mark.parametrize("lag", [0.0, 2.5])
def test_a_stream_in_parts_is_the_recording_to_the_bit(monkeypatch, lag, mag, calibrated):
    """In parts of any size, with gaps, holes and missing values, and with looks that a thread takes meanwhile."""
    monkeypatch.setattr(live, "SHORT", 1.0)
    monkeypatch.setattr(live, "MARGIN", 8.0)
    h = by_hand(30.0, rest=((0.0, 3.0),), seed=5)
    lost = (np.random.default_rng(1).random(h.t.size) < 0.02) | ((h.t > 20.0) & (h.t < 20.4))
    h = h._replace(gyr=np.where(lost[:, np.newaxis], np.nan, h.gyr)).rows((h.t < 12.0) | (h.t > 13.0))
    imu = h.imu() if calibrated else replace(h.imu(), meta=ImuMeta())
    params = {"lag": lag, "mag": mag, "latency": 0.003}
    same_in_parts(imu, Smoother(frame="NED", params=params).process(imu), FixedLag(frame="NED", params=params))


def same_in_parts(imu, whole, stream):
    ends = np.cumsum(np.random.default_rng(0).choice([1, 1, 1, 2, 7, 50, 400], imu.t.size))
    ends = [0, *ends[ends < imu.t.size], imu.t.size]
    parts = []
    for begin, end in itertools.pairwise(ends):
        parts += filter(None, [stream.take(imu[begin:end])])
        due = imu.t[min(sum(map(len, parts)), len(imu) - 1)]
        assert imu.t[end - 1] - due <= stream.params.lag + 1e-9  # no attitude waits for longer than it must
    parts += filter(None, [stream.finish()])
    assert stream.finish() is None
    for name in ("t", "q_nb", "bias_b", "cov_b", "flags", "mag_weight"):
        np.testing.assert_array_equal(np.concatenate([getattr(p, name) for p in parts]), getattr(whole, name))


@pytest.mark.parametrize("lag", [0.0, 3.0])
def test_doubts_and_what_ends_them_do_not_depend_on_the_parts(lag):
    """A field that changes at rest and is taken in motion; a bias that jumps at rest."""
    h = by_hand(25.0, rest=((0.0, 15.0),), seed=3)
    for imu in (h.imu(mag=wrong_at_first(h, 8.0)), lying(25.0, lambda t: np.where(t < 12.0, 0.0, dps(5.0)))):
        same_in_parts(imu, followed(imu, lag=lag)[0], FixedLag(frame="ENU", params={"lag": lag}))


@pytest.mark.parametrize("mag", [True, False], ids=["field", "no field"])
def test_what_comes_within_the_lag_counts_and_in_the_claim_too(mag):
    """Over looks at the past and a gap: the error of the tilt and its variance fall, and 95 % lie inside 95 %."""
    h = by_hand(60.0, rest=((0.0, 3.0),), seed=4)
    h = h.rows((h.t < 30.0) | (h.t > 31.0))
    error, variance = [], []
    for lag in (0.0, 1.0, 5.0, 20.0):
        track, _ = followed(h.imu() if mag else h.imu(mag=None), lag=lag)
        e, up = error_n(track.q_nb, h.q), dcm_from_quat(track.q_nb)
        cov = up @ track.cov_b @ np.swapaxes(up, 1, 2)
        error.append(rms_deg(e)[:2].max())
        variance.append(np.median(cov[:, 0, 0]))
        assert np.mean(np.abs(e[:, :2]) < 1.96 * np.sqrt(np.diagonal(cov, axis1=1, axis2=2)[:, :2])) > 0.9
    assert (np.diff(error) < 0.0).all() and (np.diff(variance) < 0.0).all()


def test_a_free_heading_is_as_uncertain_as_what_nothing_shows_of_the_gyroscope():
    h = by_hand(60.0, seed=6)  # nothing rests
    track, _ = followed(h.imu(mag=None))
    sd, late = heading_sd(track.q_nb, track.cov_b), h.t > 20.0
    assert (sd[late] > BIAS_REPEATS * h.t[late]).all()
    turned = error_n(track.q_nb, h.q)[:, 2]
    assert (np.abs(turned - turned[100])[late] < 1.96 * sd[late]).all()


def test_what_is_remarked_at_the_end_does_not_depend_on_the_parts(monkeypatch):
    """A field that is wrong for the last ten seconds, in parts after which few samples are left."""
    h = by_hand(60.0, seed=8)
    wrong = np.where(h.t[:, np.newaxis] > 50.0, [0.0, 25.0, 25.0], 0.0)
    told = []
    for size in (10_000, 2500):
        monkeypatch.setattr("plumbob.filters.smoother.smoothing.AT_ONCE", size)
        told.append(followed(h.imu(mag=h.mag + h.in_body(wrong)))[1])
    assert told[0] == told[1]
    assert "the field was not that of the place (50–60 s)" in told[0]
