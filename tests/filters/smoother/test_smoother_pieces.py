"""What the smoother without a lag is made of: doubts, weights of a field, what proves one, rest, and the level."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from plumbob import ImuData
from plumbob.core.constants import G0
from plumbob.core.units import deg, dps
from plumbob.filters.smoother import causal as onward
from plumbob.filters.smoother import field as fields
from plumbob.filters.smoother import inertial, live
from plumbob.filters.smoother import stationary as standing
from plumbob.filters.smoother.field import Reference, bias_of_drift, follow, share_of_rest, weighted_median, weights
from plumbob.filters.smoother.inertial import calm, first_rest
from plumbob.filters.smoother.keyframes import Keyframes
from plumbob.filters.smoother.model import SIZE, Params
from plumbob.filters.smoother.passes import Smoothed
from plumbob.filters.smoother.sensor_fixed_field import attached_field
from plumbob.filters.smoother.sweeps import COUNT, FIELD, FORCE, MEANS, Last
from plumbob.rotations import quat_conjugate, quat_from_rotvec, quat_multiply, quat_rotate, rotvec_from_quat
from tests.helpers import slow_as_python
from tests.helpers.hand_motion import by_hand
from tests.helpers.smoother_pieces import arrived, place


def test_an_attitude_that_is_lost_takes_the_mean_force_for_up():
    """A level unit that is said to lean by 30° about north: the force that its memory holds is turned by as much."""
    p, learned, state, now = np.eye(SIZE), np.zeros(onward.LEARNED), standing.fresh(), np.ones(SIZE)
    attitude = quat_from_rotvec(np.array([0.0, deg(30.0), 0.0]))
    force = quat_rotate(attitude, [0.0, 0.0, G0]) - [0.0, 0.0, G0]
    learned[[onward.EAST_SPEED, onward.NORTH_SPEED, onward.RISE]] = inertial.LEAK * force
    onward.begin_anew(state, 7.0, attitude, now, p, learned)
    np.testing.assert_allclose(attitude, [1.0, 0.0, 0.0, 0.0], atol=1e-9)
    assert np.diag(p)[:3] == pytest.approx(1.0 + onward.LOST**2)
    assert not learned.any()
    assert not now[6:8].any()
    assert (state[standing.MISLED], state[standing.UNTIL]) == (7.0, 7.0 + standing.HOLDS)


LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


def compared(rate, turns, seconds=3.0, step=0.05):
    """What contradicts a rate (3,), rad/s, of a unit that turns at another one: angles, rad, over time."""
    state, angles = standing.fresh(), []
    for k in range(round(seconds / step)):
        back = quat_conjugate(quat_from_rotvec(np.asarray(turns) * (k + 0.5) * step))
        seen = np.concatenate((quat_rotate(back, [0.0, 0.0, 9.81]), quat_rotate(back, [0.0, 20.0, -40.0]), np.empty(3)))
        angles.append(math.sqrt(standing.stands(state, seen, LEVEL, np.asarray(rate), step, (k + 1) * step)))
    return np.array(angles)


def test_what_stands_still_contradicts_a_turn_by_what_that_would_have_moved():
    """About x gravity moves by the whole angle and the field (0, 20, −40) too: √2 of it."""
    none, rate = np.zeros(3), np.array([dps(4.0), 0.0, 0.0])
    lag = 0.5 * standing.FIRST + standing.LATEST  # from the middle of the first mean to that of a fading one
    assert compared(rate, none)[-1] == pytest.approx(math.sqrt(2.0) * dps(4.0) * (3.0 - lag), rel=0.02)
    assert not compared(rate, rate).any()
    assert not compared(rate, 0.8 * rate).any()  # it moved by more than a quarter
    assert compared(rate, 0.2 * rate).any()
    assert not compared(none, rate).any()


def test_a_large_level_velocity_may_be_gravity_in_a_wrong_attitude():
    """A tilt of ε adds g ε every second; with a memory of four seconds 1 m/s is usual."""
    learned = np.zeros(onward.LEARNED)
    learned[onward.EAST_SPEED] = 1.0
    assert onward.unlikely_tilt(learned) == 0.0
    learned[onward.EAST_SPEED] = 0.0
    for angle in (deg(30.0), deg(-40.0)):
        pushed = inertial.LEAK * G0 * math.tan(angle)
        learned[[onward.NORTH_SPEED, onward.RISE]] = pushed, 0.0  # a body that is pushed weighs as much as before
        assert onward.unlikely_tilt(learned) < 1e-6
        tilted = inertial.LEAK * G0 * np.array([math.sin(angle), math.cos(angle) - 1.0])
        learned[[onward.NORTH_SPEED, onward.RISE]] = tilted  # and the force of one that is not is as large as gravity
        sure = math.sqrt(math.sin(angle) ** 2 - (1.0 / inertial.LEAK / G0) ** 2)
        assert math.sqrt(onward.unlikely_tilt(learned)) == pytest.approx(sure, rel=1e-3)


def test_a_fast_body_keeps_its_speed_and_a_hand_comes_back():
    """A speed far above the usual one is forgotten within `LEAK`, a small one is not; peaks fade likewise."""
    step, still = np.full(800, 0.05), np.zeros(800, dtype=bool)
    fast = inertial.Speed(np.where(np.arange(800) < 200, 30.0, 0.0), step, still, step, 40.0 * step)
    assert fast.lasting(step, still)[199] == pytest.approx(math.exp(-0.05 / inertial.LEAK), rel=1e-4)
    half = 199 + round(inertial.LEAK * math.log(30.0**2) / 0.05)  # where the fading peak is 1 m/s
    assert fast.lasting(step, still)[half] == pytest.approx(math.exp(-0.5 * 0.05 / inertial.LEAK), rel=1e-3)
    rests = fast.lasting(step, np.arange(800) == 199)[199]  # what goes on at 2 m/s is what rests from there on
    assert rests == pytest.approx(fast.lasting(step, still)[199] / 2.0**4)
    hand = inertial.Speed(np.full(800, 0.05), step, still, step, step)
    assert hand.lasting(step, np.arange(800) == 199) == pytest.approx(np.ones(800), abs=1e-4)
    learned = np.zeros(onward.LEARNED)
    learned[onward.PEAK2] = 30.0**2
    assert onward.lasting(learned, 0.05) == pytest.approx(fast.lasting(step, still)[199])


def test_a_field_that_turns_and_keeps_its_size_speaks_against_the_attitude_and_another_size_does_not():
    """Odds of 4 d / π s (1 + g² / s²)² each time that it has moved by its spread s, d away and grown by g."""
    level, vertical, spread = 20.0, -40.0, 2.0
    turned, grown, still = np.zeros(fields.DOUBTS), np.zeros(fields.DOUBTS), np.zeros(fields.DOUBTS)
    expected = 0.0
    for k in range(1, 21):
        angle = deg(k * 8.0)
        seen = np.array([level * math.sin(angle), level * math.cos(angle), vertical])
        fields.contradict(turned, seen, 0.1, level, vertical, spread)
        expected += math.log(8.0 / math.pi * level * math.sin(0.5 * angle) / spread)
        fields.contradict(grown, seen * 1.2, 0.1, level, vertical, spread)
        fields.contradict(still, np.array([0.0, level, vertical - 15.0]), 0.1, level, vertical, spread)
        assert turned[fields.ODDS] == pytest.approx(min(expected, fields.SURE), rel=1e-9)
    assert grown[fields.ODDS] == still[fields.ODDS] == 0.0
    apart2 = (2.0 * level * math.sin(deg(80.0)) / spread) ** 2
    share = apart2 / (apart2 + 1.0) / (1.0 + 30.0 * math.exp(-fields.SURE))
    assert turned[fields.HEADING2] == pytest.approx(share * deg(160.0) ** 2, rel=1e-9)
    assert still[fields.HEADING2] == 0.0 and still[fields.TILT2] > 0.0
    for _ in range(200):
        fields.contradict(turned, np.array([0.0, level, vertical]), 0.1, level, vertical, spread)
    assert turned[fields.HEADING2] < deg(2.0) ** 2 and turned[fields.ODDS] < 0.1  # 20 s later


def test_a_field_weighs_what_it_weighs_in_a_smoothed_recording():
    """The same formula, step by step and for all at once."""
    p, reference = Params(), Reference(20.0, -40.0, 1.0)
    fields = np.array([0.0, 20.0, -40.0]) + np.random.default_rng(0).normal(0.0, [8.0, 8.0, 4.0], (200, 3))
    expected = weights(reference, p, fields, np.zeros(200, dtype=bool), directed=True)
    mean, field = np.zeros(MEANS), onward.LocalField.from_reference(reference, p, 0.0)
    mean[COUNT] = 5.0
    for vector, weight in zip(fields, expected, strict=True):
        mean[FIELD : FIELD + 3] = vector
        assert onward.field_weight(mean, field, 0.0, 0.0) == pytest.approx(weight, rel=1e-12)
    mean[COUNT] = 0.0
    assert onward.field_weight(mean, field, 0.0, 0.0) == 0.0
    assert onward.field_weight(mean, onward.LocalField.from_reference(None, p, 0.0), 0.0, 0.0) == 0.0


def test_dip_and_direction_say_nothing_against_a_field_where_the_attitude_is_unknown():
    """A tilt of 5° changes the level part by 40 sin 5° = 3.5 µT, a heading of 60° the direction, none the size."""
    field = onward.LocalField.from_reference(Reference(20.0, -40.0, 1.0), Params(), 0.0)
    mean = np.zeros(MEANS)
    mean[COUNT] = 5.0
    for tilt, heading in ((5.0, 0.0), (0.0, 60.0), (5.0, 60.0)):
        c, s = math.cos(deg(tilt)), math.sin(deg(tilt))
        level, up = 20.0 * c + 40.0 * s, 20.0 * s - 40.0 * c
        mean[FIELD : FIELD + 3] = level * math.sin(deg(heading)), level * math.cos(deg(heading)), up
        assert onward.field_weight(mean, field, 0.0, 0.0) < 0.1
        assert onward.field_weight(mean, field, deg(tilt) ** 2, deg(heading) ** 2) > 0.15
    mean[FIELD : FIELD + 3] = 0.0, 40.0, -80.0
    assert onward.field_weight(mean, field, deg(5.0) ** 2, deg(60.0) ** 2) < 0.01


def test_the_speed_of_a_swing_is_learned():
    """Of a cos(ωt) the speed is a/ω, here on one of two axes; it lasts about a period, 6 σ_v / σ_a = 6/ω."""
    dt, omega, force = 0.05, 2.0 * math.pi * 1.0, 3.0
    learned, mean, densities = np.zeros(onward.LEARNED), np.zeros(MEANS), []
    for k in range(2000):
        mean[FORCE] = dt * force * math.cos(omega * k * dt)
        densities.append(onward.velocity_density(learned, mean, dt, 0.05, False))
    speed2 = 0.25 * (force / omega) ** 2  # mean of ½ v²
    assert np.mean(densities[-200:]) == pytest.approx(2.0 * 6.0 / omega * speed2, rel=0.1)
    quiet = onward.velocity_density(np.zeros(onward.LEARNED), np.zeros(MEANS), dt, 0.05, False)
    assert quiet == pytest.approx(2.0 * inertial.SHORTEST * 0.05**2)


def test_what_proves_a_field_is_turning_in_it():
    reference = Reference(20.0, -40.0, 1.0)
    settled = live.Proven(reference, turning=30.0, rest=100.0)
    assert settled.settled
    assert settled.prior(None, 0.0, 0.0).weight == pytest.approx(2.0 * 130.0)  # nothing turns: all that was seen
    assert settled.prior(None, 5.0, 0.0).weight == pytest.approx(2.0 * (30.0 + 24.0 - 10.0))
    assert live.Proven(reference, turning=2.0, rest=100.0).prior(None, 5.0, 0.0).weight == 0.0
    lain = live.Proven(reference, turning=0.5, rest=100.0)
    assert not lain.settled
    lain.take(Reference(30.0, -30.0, 0.0), since=50.0)
    assert lain.settled
    assert lain.prior(None, 5.0, 20.0).weight == pytest.approx(0.8 * 5.0)  # as much as the rest in the other one counts
    assert lain.prior(None, 5.0, 60.0).weight == 0.0  # which is not asked any more
    assert Params().mag_spread * 3.0 < reference.apart(Reference(27.0, -40.0, 1.0))


def test_a_heading_from_elsewhere_turns_all_that_lies_in_the_level():
    rng = np.random.default_rng(1)
    root = rng.normal(size=(SIZE, SIZE))
    last = Last(quat_from_rotvec(np.array([0.1, -0.2, 0.3])), rng.normal(size=SIZE), root @ root.T)
    learned = rng.normal(size=onward.LEARNED)
    there, faster = Last(*(of.copy() for of in last)), learned.copy()
    onward.turn_heading_by(0.7, *there, faster)
    turn = rotvec_from_quat(quat_multiply(there.attitude, quat_conjugate(last.attitude)))
    assert turn == pytest.approx([0.0, 0.0, 0.7], abs=1e-12)
    level = slice(onward.EAST_SPEED, onward.NORTH_SPEED + 1)
    turned = quat_rotate(quat_from_rotvec(np.array([0.0, 0.0, 0.7])), [*learned[level], 0.0])
    np.testing.assert_allclose(faster[level], turned[:2], rtol=1e-12)
    assert there.cov[2, 2] == pytest.approx(last.cov[2, 2])
    assert np.trace(there.cov[:2, :2]) == pytest.approx(np.trace(last.cov[:2, :2]))
    assert math.hypot(*there.state[6:8]) == pytest.approx(math.hypot(*last.state[6:8]))
    onward.turn_heading_by(-0.7, *there, faster)
    for before, back in zip((*last, learned), (*there, faster), strict=True):
        np.testing.assert_allclose(before, back, rtol=0, atol=1e-10)


def test_a_calm_window_that_ends_now_is_calm_later_than_one_around_now():
    h = by_hand(20.0, rest=((5.0, 10.0),), seed=6)
    frames, p = Keyframes.from_imu(h.imu(), 0.049), Params()
    stream, _ = arrived(h.imu())
    around, (so_far, mean) = np.flatnonzero(calm(frames, p).quiet), stream.quiet(slice(0, stream.steps))
    ends = np.flatnonzero(so_far)
    for i in (0, -1):
        late = frames.time[around[i] + 1] + 0.5 * p.rest_time
        assert stream.time(ends[i] + 1) == pytest.approx(late, abs=0.11)
    now = stream.time(ends[-1] + 1)
    window = (h.t > now - p.rest_time) & (h.t <= now)
    np.testing.assert_allclose(mean[ends[-1]], h.gyr[window].mean(axis=0), atol=deg(0.1))


def still(seconds, rate_z, field):
    """A unit whose gyroscope shows an even rate about the vertical, and a field (N, 3) over time, or none."""
    t, rng = np.arange(0.0, seconds, 0.01), np.random.default_rng(7)
    gyr = np.array([0.0, 0.0, rate_z]) + rng.normal(0.0, dps(0.05), (t.size, 3))
    acc = np.array([0.0, 0.0, 9.81]) + rng.normal(0.0, 0.02, (t.size, 3))
    mag = None if field is None else field(t) + rng.normal(0.0, 0.2, (t.size, 3))
    return Keyframes.from_imu(ImuData(t=t, gyr=gyr, acc=acc, mag=mag), 0.049)


def test_a_field_that_jumps_at_rest_is_no_turn_and_one_that_goes_round_evenly_is():
    """9 °/s, or a magnet that is put beside the unit and turns its field by as much as that in ten seconds."""
    rate = dps(9.0)
    even = still(10.0, rate, lambda t: place(t, rate * t))
    jump = still(10.0, 0.0, lambda t: np.where(t[:, np.newaxis] < 6.0, place(t), place(t, 10.0 * rate)))
    assert not calm(even, Params()).quiet.any()
    assert calm(jump, Params()).quiet.mean() > 0.8


def swing(t):
    """A field that swings by 20° and is back after 3 s, as on a wave."""
    return place(t, deg(10.0) * (1.0 - np.cos(2.0 * np.pi * t / 3.0)))


@pytest.mark.parametrize(
    ("seconds", "field", "rests"), [(3, None, False), (12, None, True), (3, place, True), (3, swing, False)]
)
def test_a_calm_second_with_a_large_rate_about_gravity_is_a_turn_and_a_long_one_a_bias(seconds, field, rests):
    """8 °/s is 1.6 of the bias's standard deviations, each of which takes 3 s of rest where no field tells."""
    frames, p = still(seconds, dps(8.0), field), Params()
    resting, bias = first_rest(calm(frames, p), p, frames.step)
    assert resting.any() == rests
    assert bias[2] == pytest.approx(dps(8.0) if rests else 0.0, abs=dps(0.05))


@slow_as_python
def test_all_rest_counts_no_more_than_most_of_the_turning():
    frames = Keyframes.from_imu(by_hand(60.0, rest=((0.0, 40.0),), seed=8).imu(), 0.049)
    seen = inertial.Beginning.from_frames(frames, Params()).level(Params())
    share = share_of_rest(frames, seen)
    assert (share[~seen.resting] == 1.0).all()
    turning = live.turning_time(frames, seen.sweep.bias[1:], seen.resting).sum()
    assert (share * frames.step)[seen.resting].sum() == pytest.approx(0.8 * turning)


def test_a_field_far_off_is_another_one_however_far_all_are_off():
    """A reference that half of the fields miss by their own size is believed no wider than a fifth of it."""
    assert Reference(30.0, -40.0, 60.0).spread(Params()) == pytest.approx(10.0)
    assert Reference(30.0, -40.0, 2.0).spread(Params()) == pytest.approx(3.0)
    values = np.array([4.0, 1.0, 3.0, 2.0])
    middles = [weighted_median(values, np.array(of)) for of in ([1.0] * 4, [10.0, 1.0, 1.0, 1.0], [1.0, 1.0, 3.0, 1.0])]
    assert middles == [2.0, 4.0, 3.0]  # of their weight


@pytest.mark.parametrize(("seconds", "var"), [(10, 0.36 / 1e3), (60, 0.36 / 216e3), (240, dps(0.05) ** 2 / 4.0)])
def test_a_drift_shows_a_bias_as_well_as_the_slope_of_a_straight_line_and_as_a_minute_allows(seconds, var):
    """Information is the sum of both; variance of a slope: 12 σ² / T³, σ² = .03 rad² s."""
    frames, known = SimpleNamespace(step=np.ones(seconds), gap=np.zeros(seconds, dtype=bool)), dps(0.05) ** 2
    q, cov = np.tile([1.0, 0.0, 0.0, 0.0], (seconds + 1, 1)), np.tile(known * np.eye(6), (seconds + 1, 1, 1))
    inertial = SimpleNamespace(sweep=SimpleNamespace(q=q, cov=cov))
    bias = bias_of_drift(frames, inertial, dps(0.1) * np.arange(float(seconds)))
    assert bias == pytest.approx([0.0, 0.0, -dps(0.1) / (1.0 + var / known)])


def test_what_a_recording_did_not_show_of_the_gyroscope_stays_as_it_was():
    """The third number of the matrix is known to 0.6 of what it was, the others to 0.4."""
    cov = np.full((12, 12), 0.1) + 0.06 * np.eye(12)
    cov[5, 5] = 0.36
    sweep = SimpleNamespace(unit_cov=cov, matrix=np.ones(9), bias=np.ones((2, 3)))
    found = Smoothed(None, sweep, None, None, None, None, np.eye(21), None, None).learned
    assert found.matrix.ravel().tolist() == [1.0, 1.0, 0.0, *[1.0] * 6]
    assert found.cov[5].tolist() == found.cov[:, 5].tolist() == np.eye(12)[5].tolist()
    assert (np.delete(np.delete(found.cov, 5, 0), 5, 1) == np.delete(np.delete(cov, 5, 0), 5, 1)).all()


@pytest.mark.parametrize(("size", "taken_off"), [(8.0, True), (3.0, False)])
def test_a_field_that_all_windows_show_alike_is_the_unit_s_own(size, taken_off):
    """From 5 µT on it is taken off; less may be an uneven field of the place."""
    h = by_hand(20.0, seed=1, noise=None)
    own = np.array([0.0, size, 0.0])
    found = attached_field(Keyframes.from_imu(h.imu(mag=h.mag + own), 0.049), h.middle)
    for field, expected in ((found.iron, taken_off * own), (found.suspect, (not taken_off) * own)):
        np.testing.assert_allclose(field, expected, rtol=0.0, atol=0.1)


def test_an_angle_that_drifts_is_the_most_likely_one():
    """By least squares of all steps at once: angles, rates, and what changes both from step to step."""
    n, h, rate_sd, walk, noise, look = 30, 0.2, 0.1, 0.05, 0.3, 0.02
    angle, out = np.cumsum(np.random.default_rng(1).normal(0.0, 0.2, n)), np.empty(n)
    follow(
        np.full(n, h), angle, np.ones(n), np.zeros(n, dtype=bool), rate_sd, walk, noise, look, np.empty((n, 10)), out
    )
    rows, values = [np.eye(2 * n + 2)[n] / math.sqrt(10.0), np.eye(2 * n + 2)[2 * n + 1] / rate_sd], [0.0, 0.0]
    for k in range(n):  # unknowns: n angles and that before the first, and as many rates
        now, before, rate, last = (
            np.eye(2 * n + 2)[i] for i in (k, k - 1 if k else n, n + 1 + k, n + k if k else 2 * n + 1)
        )
        rows += [(now - before - h * last) / math.sqrt(noise * h), (rate - last) / (walk * math.sqrt(h))]
        rows += [now / math.sqrt(look / h)]
        values += [0.0, 0.0, angle[k] / math.sqrt(look / h)]
    assert out == pytest.approx(np.linalg.lstsq(np.array(rows), np.array(values))[0][:n], abs=1e-9)
