"""Alignment: planted constants come back, unobservable ones are refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from plumbob import rotations as rot
from plumbob.core.errors import ClockError, ParameterError, ShapeError
from plumbob.door.evaluate import evaluate
from plumbob.evaluation.align import (
    MIN_TILT_SPREAD,
    find_heading,
    find_mounting,
    find_mounting_and_heading,
    find_time_offset,
    masked_correlation,
    turn_heading,
)
from tests.helpers import examples

FEW = examples(0.25)

EXACT = 1e-9
frames = st.sampled_from(list(rot.Frame))
headings = st.floats(-3.1, 3.1)
vectors = st.tuples(*[st.floats(-1.7, 1.7)] * 3).map(np.array)


def bearing(q_nb, frame):
    """Compass bearing of the body's x axis, clockwise from north seen from above, rad."""
    x_n = rot.quat_rotate(q_nb, [1.0, 0.0, 0.0])
    return np.arctan2(x_n @ frame.east, x_n @ frame.north)


def plant(q_ref, frame, heading, mounting):
    """Estimate that reads `heading` more and sits `mounting` otherwise; q_ref ⊗ q_re has the estimate's body."""
    return turn_heading(rot.quat_multiply(q_ref, rot.quat_from_rotvec(mounting)), heading, frame)


@pytest.mark.parametrize("frame", list(rot.Frame))
def test_a_heading_counts_clockwise_from_above(motion, frame):
    q = motion(np.array([0.3]))
    turned = turn_heading(q, 0.2, frame)
    assert bearing(turned, frame) - bearing(q, frame) == pytest.approx(0.2, abs=1e-12)


@FEW
@given(frames, headings, vectors)
def test_planted_constants_come_back_alone_and_together(motion, t, frame, heading, mounting):
    q_ref = motion(t)
    alone = find_heading(turn_heading(q_ref, heading, frame), q_ref, frame)
    assert alone == pytest.approx(heading, abs=EXACT)
    assert (
        rot.quat_angle(find_mounting(plant(q_ref, frame, 0.0, mounting), q_ref), rot.quat_from_rotvec(mounting)) < EXACT
    )
    found = find_mounting_and_heading(plant(q_ref, frame, heading, mounting), q_ref, frame)
    assert np.cos(found.heading - heading) == pytest.approx(1.0, abs=EXACT**2 + 1e-15)
    assert rot.quat_angle(found.mounting, rot.quat_from_rotvec(mounting)) < EXACT


def test_both_are_the_least_squares_of_noisy_tracks(motion, t):
    q_ref = motion(t)
    noise = rot.quat_from_rotvec(np.random.default_rng(5).normal(0.0, 0.02, (t.size, 3)))
    q_est = rot.quat_multiply(plant(q_ref, rot.Frame.ENU, 0.5, [0.1, 0.2, -0.3]), noise)
    found = find_mounting_and_heading(q_est, q_ref, rot.Frame.ENU)

    def misfit(heading, mounting):
        q = turn_heading(rot.quat_multiply(q_ref, mounting), heading, rot.Frame.ENU)
        return np.sum(np.sin(rot.quat_angle(q_est, q) / 2.0) ** 2)

    best = misfit(found.heading, found.mounting)
    for step in np.vstack((np.eye(4), -np.eye(4))) * 1e-4:
        assert misfit(found.heading + step[0], rot.quat_multiply(found.mounting, rot.quat_from_rotvec(step[1:]))) > best
    # one sd of the mean of 2000 draws of 0.02 rad is 4.5e-4 rad; the tilt spread, 0.53 rad, doubles it
    assert found.heading == pytest.approx(0.5, abs=5 * 4.5e-4 / found.tilt_spread)


def test_what_cannot_be_aligned_is_refused(motion, track, t):
    flat = track(t, rot.quat_from_euler_zyx(np.stack((0.5 * t, 0.2 + 0 * t, 0.01 * np.sin(t)), axis=1)))
    moving, still = track(t, motion(t)), track(t, np.tile([1.0, 0.0, 0.0, 0.0], (t.size, 1)))
    round_and_round = rot.quat_from_rotvec(np.multiply.outer(2 * np.pi * np.arange(t.size) / t.size, [0, 0, 1.0]))
    far, few = track(t, motion(t - 0.9)), [track(t[:n], motion(t[:n])) for n in (2, 10)]
    for call, error, words in (
        (lambda: evaluate(flat, flat, align={"mounting", "heading"}), ParameterError, r"0\.\d+° rms.*3° are needed"),
        (
            lambda: find_heading(rot.quat_multiply(round_and_round, moving.q_nb), moving.q_nb, rot.Frame.ENU),
            ShapeError,
            "over the full circle",
        ),
        (lambda: find_time_offset(still, still), ClockError, r"varies by 0 °/s, but 0\.5 °/s"),
        (lambda: find_time_offset(few[1], few[1]), ClockError, "needs 20 steps"),
        (lambda: find_time_offset(few[0], moving), ClockError, "three samples"),
        (lambda: find_time_offset(moving, moving, max_offset=0.0), ParameterError, "positive"),
        (lambda: find_time_offset(far, moving, max_offset=0.3), (ParameterError, ClockError), "max_offset|not match"),
    ):
        with pytest.raises(error, match=words):
            call()
    evaluate(flat, flat, align={"mounting"})
    assert find_time_offset(far, moving).offset == pytest.approx(0.9, abs=1e-5)


def test_tilt_spread_of_a_cone_has_a_closed_form_and_conjugates_do_not_align(motion, t):
    # the vertical, seen from a body that nods sinusoidally by a: 1 − |mean|² = 1 − J0(a)² ≈ a²/2
    nod = 0.3 * np.sin(2.0 * np.pi * np.arange(1000) / 1000.0)
    q_ref = rot.quat_from_euler_zyx(np.stack((0 * nod, nod, 0 * nod), axis=1))
    found = find_mounting_and_heading(q_ref, q_ref, rot.Frame.ENU).tilt_spread
    assert found == pytest.approx(np.sqrt(1.0 - 0.9776262465382961**2), rel=1e-9)  # J0(0.3), [DLMF] 10.2.2
    assert found > MIN_TILT_SPREAD
    # a track of body-from-navigation quaternions is a frequent mistake; no constant must hide it
    q_ref = motion(t)
    found = find_mounting_and_heading(rot.quat_conjugate(q_ref), q_ref, rot.Frame.ENU)
    left = rot.quat_angle(rot.quat_conjugate(q_ref), found.apply(q_ref, rot.Frame.ENU))
    assert np.sqrt(np.mean(left**2)) > 0.3


@pytest.mark.parametrize("offset", [-0.4031, -0.01, 0.0, 0.00123, 0.25])
@pytest.mark.parametrize(("rate_est", "rate_ref"), [(100.0, 100.0), (285.71, 60.0), (50.0, 240.0)])
def test_a_planted_time_offset_comes_back(motion, track, offset, rate_est, rate_ref):
    t_est, t_ref = np.arange(30 * rate_est) / rate_est, np.arange(30 * rate_ref) / rate_ref
    q_est = plant(motion(t_est - offset), rot.Frame.NED, 1.0, [0.3, -0.2, 1.1])
    found = find_time_offset(track(t_est, q_est, frame=rot.Frame.NED), track(t_ref, motion(t_ref)))
    assert found.offset == pytest.approx(offset, abs=2e-5)
    assert found.correlation > 0.99


def test_a_time_offset_comes_back_from_noise_and_holes(motion, track):
    rng = np.random.default_rng(7)
    t_est, t_ref = np.arange(6000) / 100.0, np.arange(7200) / 120.0
    noise = np.cumsum(rng.normal(0.0, 3.5e-5, (t_est.size, 3)), axis=0)  # 1.2 °/√h
    q_est = rot.quat_multiply(motion(t_est - 0.0372), rot.quat_from_rotvec(noise))
    q_ref = rot.quat_multiply(motion(t_ref), rot.quat_from_rotvec(rng.normal(0.0, 7e-4, (t_ref.size, 3))))  # 0.04°
    q_ref[1000:1500] = np.nan
    found = find_time_offset(
        track(t_est, q_est), track(np.delete(t_ref, slice(3000, 3600)), np.delete(q_ref, slice(3000, 3600), 0))
    )
    # rate noise of 3.5e-3 rad/s over 6000 samples against slopes of 1 rad/s² is 0.05 ms; five times that
    assert found.offset == pytest.approx(0.0372, abs=2.5e-4)


def test_time_mounting_and_heading_together_and_a_repeating_motion(motion, track, t):
    q_est = plant(motion(t - 0.0317), rot.Frame.ENU, 0.6, [0.4, -0.3, 0.8])
    fine = np.arange(5000) / 240.0
    result = evaluate(track(t, q_est), track(fine, motion(fine)), align=["heading", "time", "mounting"])
    assert result.settings.align == ("time", "mounting", "heading")
    assert result.alignment.time.offset == pytest.approx(0.0317, abs=1e-5)
    assert result.alignment.heading == pytest.approx(0.6, abs=1e-4)
    assert rot.quat_angle(result.alignment.mounting, rot.quat_from_rotvec([0.4, -0.3, 0.8])) < 1e-4
    assert result.stats["total"].max_abs < 1e-4
    t = np.arange(4000) / 100.0
    pitch = 0.3 * np.sin(2.5 * np.pi * t) + 0.1 * np.sin(5.0 * np.pi * t)  # |rate| has lower peaks between, too
    nod = rot.quat_from_euler_zyx(np.stack((0 * t, pitch, 0 * t), axis=1))
    result = evaluate(track(t, nod), track(t, nod), align="time")
    assert result.alignment.time.rival == pytest.approx(1.0, abs=1e-6)
    assert abs(result.alignment.time.rival_at) == pytest.approx(0.8, abs=0.011)
    assert any("motion repeats" in str(note) for note in result.notes)


def test_masked_correlation_against_numpy():
    rng = np.random.default_rng(2)
    a, b = rng.normal(size=300), rng.normal(size=300)
    b[5:] += 0.8 * a[:-5]
    a[rng.random(300) < 0.1] = np.nan
    b[100:130] = np.nan
    lags, r = masked_correlation(a, b, 8)
    for lag, value in zip(lags.astype(int), r, strict=True):
        x, y = (a[lag:], b[: 300 - lag]) if lag >= 0 else (a[:lag], b[-lag:])
        both = np.isfinite(x) & np.isfinite(y)
        assert value == pytest.approx(np.corrcoef(x[both], y[both])[0, 1], abs=1e-12)
    assert lags[np.argmax(r)] == -5
