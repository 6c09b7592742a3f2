"""Keyframes, the way back to samples, and stretches: nothing is lost or used twice, and a lag is kept."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as nps

from plumbob import ImuData, flags
from plumbob.filters.smoother import Smoother, keyframes, samples
from plumbob.filters.smoother.keyframes import Keyframes, between, bridge
from plumbob.filters.smoother.samples import MARGIN, stretches
from plumbob.rotations import quat_angle, quat_chained, quat_from_rotvec, quat_multiply, quat_rotate, quat_slerp
from tests.helpers import examples, slow_as_python
from tests.helpers.hand_motion import by_hand

EPS = np.finfo(float).eps


@st.composite
def stamps(draw, most=120):
    """Times of one of several rates, with jitter, some of whose steps are gaps."""
    n = draw(st.integers(2, most))
    usual = draw(st.sampled_from([0.001, 0.01, 0.02, 0.2, 1.0]))
    jitter = draw(nps.arrays(float, n - 1, elements=st.floats(0.2, 1.8)))
    gaps = draw(nps.arrays(bool, n - 1, elements=st.sampled_from([False] * 9 + [True])))
    return np.concatenate(([0.0], np.cumsum(usual * jitter + np.where(gaps, 50.0 * usual + 0.3, 0.0))))


@st.composite
def damaged(draw):
    """Samples of any stamps, with values missing in spells of each triad; and which samples have which."""
    t = draw(stamps())
    has = {}
    triads = {}
    for name, level in (("gyr", 0.1), ("acc", 9.8), ("mag", 45.0)):
        has[name] = np.repeat(draw(nps.arrays(bool, -(-t.size // 7), elements=st.sampled_from([True, True, False]))), 7)
        has[name] = has[name][: t.size]
        has[name][draw(st.integers(0, t.size - 1))] = True
        triads[name] = np.where(has[name][:, np.newaxis], level + 0.01 * np.arange(3 * t.size).reshape(-1, 3), np.nan)
        triads[name] /= np.maximum(np.linalg.norm(triads[name], axis=1, keepdims=True) / level, 1e-9)
    return ImuData(t=t, **triads), has


@given(damaged(), st.sampled_from([0.001, 0.049, 0.3]))
@examples(0.6)
def test_every_sample_with_a_rate_is_in_exactly_one_step(given_, spacing):
    """But those in a hole of the gyroscope; a step is as long as asked, unless a gap or the end cuts it."""
    imu, has = given_
    frames = Keyframes.from_imu(imu, spacing)
    known = np.flatnonzero(has["gyr"])
    if known.size < 2:
        assert frames is None
        return
    t = np.asarray(imu.t)
    assert set(known) <= set(frames.rows)
    assert (frames.t == t[frames.rows]).all()
    assert (frames.rows[0], frames.rows[-1]) == (known[0], known[-1])
    left_out = np.setdiff1d(np.arange(t.size), frames.rows)
    ends = np.searchsorted(frames.rows, [known[known > row][0] for row in left_out[left_out < known[-1]]])
    assert set(ends[ends > 0]) <= set(frames.first[1:][frames.gap])
    assert (frames.first[0], frames.first[-1]) == (0, frames.t.size - 1)
    count = np.diff(frames.first)
    assert (count > 0).all()
    assert (count[frames.gap] == 1).all()  # no sample is within a gap
    step = np.diff(frames.t)
    assert (frames.missed[frames.gap] > keyframes.LOST**2).all()
    beside_gap = np.append(frames.gap[1:], True) | np.insert(frames.gap[:-1], 0, False)
    assert (frames.step[~frames.gap & ~beside_gap] > spacing - 2e-6).all()
    at_least = np.maximum(spacing, np.delete(step, frames.first[:-1][frames.gap]).max(initial=0.0))
    assert (frames.step[~frames.gap] <= spacing + at_least + 1e-9).all()


@given(damaged())
@examples(0.6)
def test_missing_values_are_bridged_and_counted(given_):
    imu, has = given_
    frames = Keyframes.from_imu(imu, 0.049)
    if frames is None:
        return
    assert np.isfinite(frames.gyr).all() and np.isfinite(frames.acc).all()
    # a value is kept but where its step lacks samples
    step, usual = np.diff(frames.t, prepend=-np.inf), np.median(np.diff(imu.t[has["gyr"]]))
    whole = step <= 1.5 * usual
    kept = has["gyr"][frames.rows] & whole & np.insert(has["gyr"][frames.rows][:-1], 0, True)
    assert (frames.gyr[kept] == imu.gyr[frames.rows][kept]).all()
    assert not (np.isfinite(frames.mag[:, 0]) & ~has["mag"][frames.rows]).any()
    assert (frames.missed >= 0.0).all() and (frames.pushed >= 0.0).all()


@pytest.mark.parametrize("missing", [0.05, 0.3, 1.0, 4.0])
@pytest.mark.parametrize("rows", [False, True], ids=["no rows", "rows without values"])
def test_a_bridge_is_the_conditional_mean_of_a_gauss_markov_process(missing, rows):
    """By dense algebra on a fine grid: the integral of such a process between two ends that are known.

    Of its mean over T / 2 = 0.6 s each, a few of them, the share 1 − (3 − 2) σ̂² / |m|² of [JamesStein1961] stays, with
    σ̂² the variance of all three axes together over how many times that was seen.
    """
    dt = 0.01
    t = np.arange(4000) * dt
    rng = np.random.default_rng(1)
    values = rng.normal(0.6, 1.0, (t.size, 3))
    gone = (t > 20.0 + 1e-9) & (t < 20.0 + missing + dt - 1e-9)
    begin, end = 2000, 2000 + round(missing / dt) + 1
    near = (t >= 20.0 - max(3.0, missing + dt) - 1e-9) & (t <= t[end] + max(3.0, missing + dt) + 1e-9) & ~gone
    mean = values[near].mean(axis=0)
    times = (np.ptp(t[near]) - (t[end] - t[begin])) / (2.0 * keyframes.CORRELATED)
    mean *= 1.0 - np.mean(((values[near] - mean) ** 2).sum(axis=1)) / times / (mean @ mean)
    spread = (np.mean((of - mean) ** 2) for of in (values[near], values[[begin, end]]))
    variance = max(spread)  # the ends are part of what is known
    fine = np.linspace(0.0, missing, 2001)
    weight = np.full(fine.size, missing / 2000.0)
    weight[[0, -1]] *= 0.5

    def covariance(a, b):
        return np.exp(-np.abs(np.subtract.outer(a, b)) / keyframes.CORRELATED)

    ends = np.array([0.0, missing])
    gain = np.linalg.solve(covariance(ends, ends), covariance(ends, fine) @ weight)
    integral = mean * missing + gain @ (values[[begin, end]] - mean)
    left = weight @ covariance(fine, fine) @ weight - gain @ (covariance(ends, fine) @ weight)
    given = np.where(gone[:, np.newaxis], np.nan, values) if rows else values[~gone]
    scale, time = (0.002 if missing > 1.0 else 0.02), t if rows else t[~gone]  # so that each can be bridged
    found = bridge(time, scale * given)
    behind = (time > 20.0 + 1e-9) & (time < t[end] + 1e-9)
    step = np.diff(time, prepend=0.0)[behind]
    over = (step[:, np.newaxis] * found.values[behind]).sum(axis=0) - dt * scale * values[end]
    assert over == pytest.approx(scale * integral, rel=2e-3, abs=2e-5)
    assert found.variance[behind].sum() == pytest.approx(scale**2 * variance * left, rel=2e-3)
    assert not found.lost.any() and (found.blind[behind] == (missing > 2.0 * keyframes.CORRELATED)).all()


def test_the_mean_over_a_step_is_that_of_its_samples():
    h = by_hand(3.0, seed=1)
    frames = Keyframes.from_imu(h.imu(), 0.049)
    found = frames.mean(frames.acc)
    for k in range(frames.gap.size):
        own = slice(frames.first[k] + 1, frames.first[k + 1] + 1)
        assert found[k] == pytest.approx(h.acc[own].mean(axis=0), rel=1e-9)
    field = np.arange(3.0 * frames.gap.size).reshape(-1, 3)
    taken = frames.without(field)
    assert (taken.mag[0] == frames.mag[0]).all()
    k = np.searchsorted(frames.first, np.arange(1, frames.t.size)) - 1
    assert (taken.mag[1:] == frames.mag[1:] - field[k]).all()


@pytest.mark.parametrize("rate", [5.0, 20.0, 100.0, 400.0])
def test_the_tilt_starts_again_behind_a_gap_that_no_bridge_reaches_over(rate):
    """A usual step is none at any rate, nor a lost sample; a minute in motion is one, and the heading is bridged."""
    h = by_hand(20.0, rate)
    frames = Keyframes.from_imu(h.imu(), 0.049)
    assert not frames.gap.any() and frames.missed.max() < 1e-6
    assert np.median(frames.step) == pytest.approx(max(math.ceil(0.049 * rate) / rate, 1.0 / rate))
    for missing, gap in ((1.0 / rate, False), (60.0, True)):
        t = h.t.copy()
        t[30:] += missing
        frames = Keyframes.from_imu(h.imu(t=t), 0.049)
        assert frames.gap.any() == gap
        assert frames.missed.max() > (keyframes.LOST**2 if gap else 1e-9)


@pytest.mark.parametrize(("seconds", "gap"), [(0.08, False), (0.2, False), (2.0, True)])
def test_a_hole_of_the_gyroscope_is_a_gap_where_no_bridge_reaches_over_it(seconds, gap):
    h = by_hand(10.0)
    gyr = np.where(((h.t > 4.995) & (h.t < 4.995 + seconds))[:, np.newaxis], np.nan, h.gyr)
    frames = Keyframes.from_imu(h.imu(gyr=gyr), 0.049)
    assert frames.gap.any() == gap
    assert frames.t.size == h.t.size - (round(100 * seconds) if gap else 0)


def test_clipped_and_stuck_values_are_not_used():
    h = by_hand(3.0)
    word = np.zeros(h.t.size, dtype=np.uint32)
    word[100], word[150], word[200] = flags.GYR_CLIPPED, flags.ACC_STUCK, flags.MAG_CLIPPED
    imu = ImuData(t=h.t, gyr=h.gyr, acc=h.acc, mag=h.mag, flags=word)
    frames = Keyframes.from_imu(imu, 0.049)
    for added, row in ((frames.missed, 100), (frames.pushed, 150)):  # beside what the last digit hides
        step = np.searchsorted(frames.first, row) - 1
        assert np.delete(added, step).max() < 1e-6 * added[step]
    assert np.flatnonzero(np.isnan(frames.mag[:, 0])) == 200


# --- attitudes between keyframes ----------------------------------------------------------------------------


def test_between_keyframes_the_way_is_the_gyroscope_s():
    """Exact where the keyframes lie on it, a few ε for each of 500 products; and where they do not, it meets them."""
    h = by_hand(5.0, seed=2)
    frames = Keyframes.from_imu(h.imu(), 0.049)
    q = quat_multiply(h.q[0], quat_chained(np.diff(h.t)[:, np.newaxis] * h.gyr[1:]))
    moving = np.ones(frames.gap.size, dtype=bool)
    assert quat_angle(between(frames, moving, q[frames.first], h.gyr), q).max() < 500 * 4 * EPS
    rng = np.random.default_rng(0)
    off = quat_multiply(quat_from_rotvec(0.1 * rng.normal(size=(frames.first.size, 3))), q[frames.first])
    found = between(frames, moving, off, h.gyr)
    assert quat_angle(found[frames.first], off).max() < 500 * 4 * EPS
    # what the gyroscope misses is spread evenly, so that no sample is further from its way than the keyframes
    away = quat_angle(found, q)
    worst = np.maximum(away[frames.first[:-1]], away[frames.first[1:]])
    for k in range(frames.gap.size):
        # a straight way between two rotations bends by their square, here 0.3²/8 at most
        assert away[frames.first[k] : frames.first[k + 1] + 1].max() <= worst[k] + 0.3**2 / 8


def test_at_rest_the_way_is_the_shortest():
    h = by_hand(2.0)
    frames = Keyframes.from_imu(h.imu(), 0.049)
    q = np.tile([1.0, 0.0, 0.0, 0.0], (frames.first.size, 1))
    q[20:] = quat_from_rotvec([0.0, 0.0, 0.2])
    found = between(frames, np.zeros(frames.gap.size, dtype=bool), q, h.gyr)
    inside = slice(frames.first[19], frames.first[20] + 1)
    expected = np.linspace(0.0, 0.2, inside.stop - inside.start)
    assert quat_angle(found[inside], [1.0, 0.0, 0.0, 0.0]) == pytest.approx(expected, abs=1e-9)


# --- stretches ----------------------------------------------------------------------------------------------


@given(stamps(400))
def test_stretches_cover_each_sample_once(t):
    found = list(stretches(t))
    assert (found[0].core.start, found[-1].core.stop) == (0, t.size)
    for one, other in itertools.pairwise(found):
        assert one.core.stop == other.core.start
    for one in found:
        assert 0 <= one.span.start <= one.core.start < one.core.stop <= one.span.stop <= t.size
        assert t[one.core][one.inside.start - (one.core.start - one.span.start)] == t[one.core.start]
        assert (t[one.span][one.inside] == t[one.core]).all()
        assert one.span.start < one.core.start or one.core.start == 0  # no later sample is alone
        assert t[one.span.start] >= t[one.core.start] - MARGIN or one.span.start == one.core.start - 1


def test_a_long_recording_is_cut_and_a_usual_one_is_not(monkeypatch):
    t = np.arange(0.0, 1199.0)
    assert [(s.span, s.core) for s in stretches(t)] == [(slice(0, t.size), slice(0, t.size))]
    t = np.arange(0.0, 1501.0)
    assert [(s.span, s.core) for s in stretches(t)] == [
        (slice(0, 720), slice(0, 600)),  # 600 s kept, 120 s before and behind: the words of `CORE` and `MARGIN`
        (slice(480, 1320), slice(600, 1200)),
        (slice(1080, 1501), slice(1200, 1501)),
    ]
    monkeypatch.setattr(samples, "LONG", 100.0)
    assert len(list(stretches(t[:501]))) == 1


# --- lag ----------------------------------------------------------------------------------------------------


def with_later(h, cut, rng):
    """The recording up to a time; behind it other values, other stamps, and some that are missing."""
    later = h.t > cut
    t = np.where(later, cut + 1.7 * (h.t - cut), h.t)
    changed = {k: np.where(later[:, np.newaxis], rng.normal(size=h.gyr.shape), getattr(h, k)) for k in ("gyr", "mag")}
    changed["mag"][later] *= 30.0
    changed["gyr"][later & (rng.random(h.t.size) < 0.3)] = np.nan
    acc = np.where(later[:, np.newaxis], h.acc[::-1], h.acc)
    return h.imu(t=t, acc=acc, **changed)


@slow_as_python
@pytest.mark.parametrize("lag", [0.0, 0.1, 0.7, 2.0])
def test_a_lag_lets_nothing_later_change_an_estimate(lag):
    """To the bit, with declination; and what comes within the lag does change it, or the test could not fail."""
    h, cut = by_hand(6.0, 50.0, rest=((0.0, 1.5),), seed=5), 4.0
    smoother = Smoother(frame="NED", params={"lag": lag, "declination": 0.1})
    whole = smoother.process(h.imu())
    other = smoother.process(with_later(h, cut, np.random.default_rng(0)))
    known = h.t <= cut - lag
    for track in (other, smoother.process(h.rows(h.t <= cut).imu())):
        for name in ("q_nb", "bias_b", "cov_b", "flags"):
            assert (getattr(track, name)[: known.sum()] == getattr(whole, name)[known]).all(), name
    if lag > 0.5:
        assert (other.q_nb[~known & (h.t < cut)] != whole.q_nb[~known & (h.t < cut)]).any()


@slow_as_python
def test_a_field_that_comes_late_does_not_turn_what_was_before():
    """A heading that counts from a free zero is not turned by the declination of a field that nobody has seen yet."""
    h = by_hand(12.0, 50.0, seed=6)
    mag = np.where(h.t[:, np.newaxis] < 8.0, np.nan, h.mag)
    smoother = Smoother(frame="ENU", params={"lag": 1.0, "declination": 0.3})
    late, never = smoother.process(h.imu(mag=mag)), smoother.process(h.imu(mag=None))
    early = h.t < 6.5
    assert (late.q_nb[early] == never.q_nb[early]).all() and (late.flags[early] & flags.HEADING_FREE).all()
    assert not (late.flags[h.t > 11.0] & flags.HEADING_FREE).any()


@given(damaged(), st.sampled_from([0.049, 0.099, 0.3]))
@examples(0.6)
def test_samples_that_are_taken_together_turn_push_and_show_as_much(given_, spacing):
    """Attitude and integral of the force at each of them, and the sum of squares of the field, by definition."""
    imu, _ = given_
    if (frames := Keyframes.from_imu(imu, spacing)) is None:
        return
    few = frames.together()
    assert (few.time == frames.time).all()
    at = np.searchsorted(frames.rows, few.rows)

    def followed(of):
        q = np.empty((of.t.size, 4))
        keyframes.path(of.t, of.gyr, q)
        half = np.concatenate((q[:1], quat_slerp(q[:-1], q[1:], 0.5)))
        dt = np.diff(of.t, prepend=of.t[0])[:, np.newaxis]
        return q, np.cumsum(dt * quat_rotate(half, of.acc), axis=0)

    (q, force), (few_q, few_force) = followed(frames), followed(few)
    assert (quat_angle(q[at], few_q) < 1e-7).all()
    np.testing.assert_allclose(few_force, force[at], rtol=1e-9, atol=1e-6)
    if at.size < frames.t.size:
        square = np.cumsum(np.where(np.isfinite(frames.mag), frames.mag, 0.0)[1:] ** 2, axis=0).sum(axis=1)
        count = np.diff(np.cumsum(np.isfinite(frames.mag[:, 0]))[at])
        few_square = np.where(count > 0, np.nansum(few.mag[1:] ** 2, axis=1) + few.scatter[1:], 0.0)
        np.testing.assert_allclose(np.cumsum(count * few_square), square[at[1:] - 1], rtol=1e-9, atol=1e-6)
