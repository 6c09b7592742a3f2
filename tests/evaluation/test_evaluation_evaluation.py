"""Evaluation of an attitude: errors, claims, consistency, and the page of it."""

import json
import math
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from plumbob import Filter, ImuData, evaluate, flags
from plumbob.core.errors import FrameError, MissingExtraError, ParameterError, ShapeError, UnitError
from plumbob.core.units import deg
from plumbob.evaluation.metrics import BOUNDS, CONFIDENCE, DOF, QUANTITIES, attitude_errors
from plumbob.reporting.evaluation import side_by_side
from plumbob.rotations import (
    Frame,
    North,
    change_frame,
    dcm_from_quat,
    quat_conjugate,
    quat_from_euler_zyx,
    quat_from_rotvec,
    quat_multiply,
)
from plumbob.rotations.frames import claimed_sd, turn_heading
from tests.helpers.page_battery import HOSTILE, PageBattery

STATISTICS = {"rmse_deg", "mean_deg", "std_deg", "max_abs_deg", "max_at_s", "p50_deg", "p95_deg", "p99_deg", "count"}


@pytest.fixture(scope="module")
def tilted(reference):
    """The reference's attitude after a tilt of 0.03 rad about the navigation x axis."""
    return quat_multiply(quat_from_rotvec([0.03, 0.0, 0.0]), reference.q_nb)


def strict(result):
    """Summary through JSON, refusing NaN and infinity."""
    return json.loads(json.dumps(result.summary(), allow_nan=False))


def test_a_track_agrees_with_itself_and_summary_is_strict_json_in_degrees(reference, track, t, tilted):
    result = evaluate(reference, reference)
    assert all(result.stats[name].max_abs < 1e-15 for name in QUANTITIES)
    assert result.notes == ()
    named = evaluate(replace(reference, source="mekf (gain 2)"), reference).facts()
    assert named["source"] == "mekf"
    assert result.facts()["source"] == "truth"
    summary = strict(evaluate(track(t, tilted, source="unit"), reference))
    assert summary["inclination_rmse_deg"] == pytest.approx(np.degrees(0.03))
    assert summary["total_rmse_deg"] == summary["total"]["rmse_deg"]
    assert all(set(summary[name]) == STATISTICS for name in QUANTITIES)
    assert summary["samples"]["scored"] == summary["samples"]["exact"] == t.size
    assert summary["estimate"] == {
        "source": "unit", "frame": "ENU", "north": "magnetic", "samples": 2000, "mean_rate_hz": pytest.approx(100.0),
        "first_s": 0.0, "last_s": 19.99,
    }  # fmt: skip


@pytest.mark.parametrize("frame", list(Frame))
def test_the_reference_comes_to_the_frame_of_the_estimate(track, t, reference, tilted, frame):
    estimate = track(t, change_frame(tilted, to=frame, from_=Frame.ENU), frame=frame)
    result = evaluate(estimate, reference)
    assert result.stats["inclination"].rmse == pytest.approx(0.03, rel=1e-12)
    assert result.stats["heading"].rmse == pytest.approx(0.0, abs=1e-12)
    assert any("converted from ENU" in str(note) for note in result.notes) == (frame is not Frame.ENU)


@pytest.mark.parametrize("frame", list(Frame))
def test_declination_turns_magnetic_into_true(track, t, frame):
    # a body whose x axis points to magnetic north, 4° east of true north, has the true heading 4°
    at_rest = quat_from_euler_zyx([np.arctan2(*(frame.north @ np.eye(3)[[1, 0]].T)), 0.0, 0.0])
    magnetic = track(t, np.tile(at_rest, (t.size, 1)), frame=frame, north=North.MAGNETIC)
    true = track(t, turn_heading(magnetic.q_nb, deg(4.0), frame), frame=frame, north=North.TRUE)
    for estimate, reference in ((magnetic, true), (true, magnetic)):
        assert evaluate(estimate, reference, declination=deg(4.0)).stats["total"].rmse < 1e-12
        assert evaluate(estimate, reference, declination=deg(-4.0)).stats["heading"].rmse == pytest.approx(deg(8.0))


def test_a_declination_that_is_fitted_is_the_heading(track, t, reference):
    true = track(t, turn_heading(reference.q_nb, 0.1, Frame.ENU), north=North.TRUE)
    result = evaluate(true, reference, align="heading")
    assert result.settings.align == ("heading",)
    assert result.alignment.heading == pytest.approx(0.1, abs=1e-12)
    assert any("holds the declination" in str(note) for note in result.notes)


def test_what_cannot_be_judged_is_refused_in_words_for_python_and_for_the_command_line(track, t, reference):
    true, free = (track(t, reference.q_nb, north=north) for north in (North.TRUE, North.FREE))
    blind, masked = track(t, np.full((t.size, 4), np.nan)), track(t, reference.q_nb, score=np.zeros(t.size))
    gyro_only = at_rest("integrate", blind=1000)
    rolled = track(gyro_only.t, np.tile(ROLLED, (1000, 1)), north=North.FREE)
    for (estimate, truth), how, error, words in (
        ((true, reference), {}, FrameError, "true north, the reference's from magnetic north; give the declination"),
        ((true, reference), {}, FrameError, "--declination.*--align heading"),
        ((true, reference), {"declination": 4.0}, UnitError, "4 rad.*--declination 3.2deg"),
        ((reference, blind), {}, ShapeError, "2000 the reference lost the body"),
        ((reference, masked), {}, ShapeError, "2000 the reference says"),
        ((reference, reference), {"align": {"heading", "scale"}}, ParameterError, "but not 'scale'"),
        ((free, reference), {"align": {"mounting"}}, ParameterError, "full attitudes"),
        ((gyro_only, rolled), {}, ShapeError, r"did not converge.*init=.*accelerometer"),
    ):
        with pytest.raises(error, match=words) as refusal:
            evaluate(estimate, truth, **how)
        assert "{" not in str(refusal.value)
    assert evaluate(at_rest("integrate", blind=1000, init=ROLLED), rolled).stats["inclination"].count == 1000


def test_what_looks_like_a_mistake_is_pointed_out_and_what_is_honest_is_not(track, t, reference):
    """Of 2000 samples of an estimate that begins 15 s late, 500 lie within the reference's 20 s."""
    q, noise = reference.q_nb, np.random.default_rng(0).normal(0.0, 0.1, (t.size, 3))
    unsure = {"north": North.FREE, "flags": np.full(t.size, flags.HEADING_FREE)}
    for estimate, words in (
        (track(t + 15.0, q), "1500 of 2000 samples lie outside"),
        (track(t, turn_heading(q, np.pi / 2, Frame.ENU)), "constant heading of +90.0°"),
        (track(t, quat_multiply(q, quat_from_rotvec([np.pi, 0.0, 0.0]))), "constant turn of 180.0° between the two"),
        (track(t, q[:, [3, 0, 1, 2]]), "order x y z w that were read as w x y z"),
        (track(t, q[:, [1, 2, 3, 0]]), "order w x y z that were read as x y z w"),
        (track(t, q * [1.0, -1.0, -1.0, -1.0]), "the inverse"),
        (track(t, change_frame(q, to=Frame.ENU, from_=Frame.NED)), "in NED that was read as ENU"),
    ):
        assert any(words in str(note) for note in evaluate(estimate, reference).notes)
    assert evaluate(track(t, quat_multiply(q, quat_from_rotvec(noise))), reference).notes == ()
    assert not any("lie outside" in str(note) for note in evaluate(track(t + 5.0, q), reference).notes)
    aligned = evaluate(track(t, q, **unsure), reference, align={"heading"})
    assert not any("arbitrary zero" in str(note) for note in aligned.notes)


@pytest.mark.parametrize("swap", [False, True])
def test_a_free_heading_is_not_scored_but_the_tilt_is(track, t, reference, tilted, swap):
    free = track(t, turn_heading(tilted, 2.0, Frame.ENU), north=North.FREE)
    pair = (reference, free) if swap else (free, reference)
    result = evaluate(*pair)
    assert result.stats["inclination"].rmse == pytest.approx(0.03, rel=1e-12)
    assert set(result.stats) == {"inclination", "pitch", "roll"}
    assert set(result.errors) == set(result.stats)
    summary = strict(result)
    assert summary["total_rmse_deg"] is None and summary["heading"] is None
    assert "arbitrary zero" in summary["not_scored"]["total"]


def test_a_free_heading_is_scored_once_it_is_aligned(track, t, reference, tilted):
    free = track(t, turn_heading(tilted, 2.0, Frame.ENU), north=North.FREE)
    result = evaluate(free, reference, align={"heading"})
    assert result.alignment.heading == pytest.approx(2.0, abs=2e-3)
    assert set(result.stats) == set(QUANTITIES)
    assert result.stats["inclination"].rmse == pytest.approx(0.03, rel=1e-12)


def test_only_scored_samples_enter_statistics_alignment_and_counts_of_flags(track, t, reference):
    off = np.where(t < 5.0, 0.5, 0.01)
    q = quat_multiply(quat_from_rotvec(np.multiply.outer(off, [1.0, 0.0, 0.0])), reference.q_nb)
    masked = track(t, reference.q_nb, score=t >= 5.0)
    for result in (evaluate(track(t, q), masked), evaluate(track(t, q), reference, settle=5.0)):
        assert result.stats["total"].max_abs == pytest.approx(0.01, rel=1e-9)
        assert result.stats["total"].count == 1500
        assert result.errors["total"][0] == pytest.approx(0.5)  # kept for the plot, and shaded there
    q = np.where((t < 5.0)[:, np.newaxis], turn_heading(reference.q_nb, 2.0, Frame.ENU), reference.q_nb)
    result = evaluate(track(t, q), reference, settle=5.0, align={"heading"})
    assert result.alignment.heading == pytest.approx(0.0, abs=1e-12)
    raised = np.zeros(t.size, dtype=np.uint32)
    raised[:300] |= flags.MAG_GATED
    raised[250:260] |= flags.HEADING_FREE
    result = evaluate(track(t, reference.q_nb, flags=raised), reference, settle=2.0)
    assert result.flag_counts() == {"mag-gated": 100, "heading-free": 10}
    assert any("10 scored samples with heading-free" in str(note) for note in result.notes)


def test_gimbal_samples_are_counted(track):
    t = np.arange(100) / 10.0
    pitch = np.radians(np.linspace(0.0, 89.0, 100))
    q = quat_from_euler_zyx(np.stack((0 * t, pitch, 0 * t), axis=1))
    result = evaluate(track(t, q), track(t, q))
    steep = int(np.count_nonzero(np.degrees(pitch) > 85.0))
    assert strict(result)["samples"]["near_gimbal"] == steep == 5
    assert (result.stats["yaw"].count, result.stats["pitch"].count) == (95, 100)
    straight_up = track(t, np.tile(quat_from_euler_zyx([0.0, np.pi / 2, 0.0]), (100, 1)))
    assert "near ±90°" in evaluate(straight_up, straight_up).not_scored["yaw"]


ROLLED = quat_from_euler_zyx([0.0, 0.0, deg(40.0)])


def at_rest(name, *, blind, **settings):
    """Track of a filter on a unit at rest, rolled by 40°, whose accelerometer is silent for `blind` samples first."""
    t = np.arange(1000) / 100.0
    acc = np.tile(9.81 * np.array([0.0, np.sin(deg(40.0)), np.cos(deg(40.0))]), (t.size, 1))
    acc[:blind] = np.nan
    data = ImuData(t=t, gyr=np.zeros((t.size, 3)), acc=acc if blind < t.size else None)
    return Filter(name, frame=Frame.ENU, **settings).process(data)


@pytest.mark.parametrize("name", ["mahony", "integrate"])
def test_an_estimate_is_scored_once_it_has_started(track, name):
    estimate = at_rest(name, blind=500)
    result = evaluate(estimate, track(estimate.t, np.tile(ROLLED, (1000, 1)), north=North.FREE))
    assert result.stats["inclination"].max_abs < deg(0.1)  # 40° where the identity before the start is scored
    assert np.isnan(result.errors["inclination"][:500]).all() and "not-converged" not in result.flag_counts()
    assert strict(result)["samples"]["left_out"] == {"not_converged": 500}
    assert strict(result)["samples"]["not_converged_until_s"] == result.not_converged_until == 4.99


def test_the_step_of_a_start_is_no_motion_to_align_time_by(track, t, motion):
    early = t < 5.0
    q = np.where(early[:, np.newaxis], [1.0, 0.0, 0.0, 0.0], motion(t - 0.05))
    estimate = track(t, q, flags=np.where(early, flags.NOT_CONVERGED, 0))
    found = evaluate(estimate, track(t, motion(t)), align={"time"}).alignment.time
    assert found.offset == pytest.approx(0.05, abs=1e-4)
    assert found.correlation > 0.999


def test_the_motion_is_told_so_that_rest_cannot_flatter(track):
    """0.7 rad/s where it is scored, from 2 s to 6 s; ten times as much before and behind, which must not count."""
    t = np.arange(500) / 50.0
    scored = (t >= 2.0) & (t < 6.0)
    angle = np.concatenate(([0.0], np.cumsum(np.where(scored[1:] & scored[:-1], 0.7, 7.0) / 50.0)))
    spin = quat_from_rotvec(np.multiply.outer(angle, [0.6, 0.0, 0.8]))
    result = evaluate(track(t, spin), track(t, spin, score=scored))
    assert (result.stats["total"].count, result.reference_rate) == (200, pytest.approx(0.7, rel=1e-9))
    for size in (1, 2):
        tiny = evaluate(track(t[:size], spin[:size]), track(t, spin))
        assert strict(tiny)["samples"]["scored"] == size
        assert (tiny.reference_rate is None) == (size == 1)
        assert max(map(len, tiny.text().splitlines())) <= 80


N = 20_000
SD = np.array([0.004, 0.003, 0.02])  # about the level axes and the vertical, rad


def claimed(q):
    """Covariance in body axes of errors with the deviations `SD` about the navigation axes."""
    c_nb = dcm_from_quat(q)
    return np.swapaxes(c_nb, 1, 2) @ np.diag(SD**2) @ c_nb


def test_they_are_those_about_the_axes_of_the_navigation_frame_and_nothing_before_the_start():
    q = quat_from_euler_zyx(np.array([[0.0, 0.0, 0.0], [2.0, -1.2, 3.0], [-1.0, 1.5, 0.4]]))
    inclination, heading = claimed_sd(q, claimed(q))
    np.testing.assert_allclose(inclination, 0.005, rtol=1e-12)  # √(4² + 3²) = 5
    np.testing.assert_allclose(heading, 0.02, rtol=1e-12)
    # A state of zeros is no certainty.
    q = quat_from_euler_zyx(np.zeros((3, 3)))
    cov = np.stack((np.zeros((3, 3)), -np.eye(3), np.full((3, 3), np.nan)))
    for sd in claimed_sd(q, cov):
        assert np.isnan(sd).all()


def test_errors_have_the_rms_that_is_claimed(motion):
    """Of N errors as claimed, the rms scatters by 1/√(2N) or 0.5 %; to that come terms of second order, 0.02²."""
    q = motion(np.arange(N) / 100.0)
    about_n = np.random.default_rng(5).normal(size=(N, 3)) * SD
    found = attitude_errors(quat_multiply(quat_from_rotvec(about_n), q), q)
    inclination, heading = claimed_sd(q, claimed(q))
    for name, sd in (("inclination", inclination), ("heading", heading)):
        assert math.sqrt(np.mean(found[name] ** 2)) == pytest.approx(sd[0], rel=5.0 / math.sqrt(2 * N) + 4e-4)


COV = np.array([[4.0, 1.0, 0.0], [1.0, 2.0, -0.5], [0.0, -0.5, 1.0]]) * 1e-6


@pytest.fixture(scope="module")
def noisy(motion, track):
    t = np.arange(N) / 100.0
    errors = np.random.default_rng(11).multivariate_normal(np.zeros(3), COV, N)
    q = quat_multiply(motion(t), quat_from_rotvec(errors))
    return lambda scale, **fields: (
        track(t, q, cov_b=np.broadcast_to(COV * scale, (N, 3, 3)), **fields),
        track(t, motion(t)),
    )


def test_bounds_are_those_of_chi_square():
    tail = 0.5 * (1.0 - CONFIDENCE)
    np.testing.assert_allclose(BOUNDS, chi2.ppf((tail, 1.0 - tail), DOF), rtol=1e-12)


def test_a_true_covariance_is_found_consistent_too_much_trust_shows_and_no_claim_has_no_verdict(noisy):
    found = evaluate(*noisy(1.0)).consistency
    assert found.mean == pytest.approx(3.0, abs=5 * np.sqrt(6.0 / N))  # variance of chi-square with 3 degrees is 6
    assert found.share_inside == pytest.approx(0.95, abs=5 * np.sqrt(0.95 * 0.05 / N))
    assert (found.count, found.unusable) == (N, 0)
    found = evaluate(*noisy(0.25)).consistency
    assert found.mean == pytest.approx(12.0, rel=0.05)
    assert found.share_inside < 0.6
    _, reference = noisy(1.0)
    free = evaluate(*noisy(1.0, north=North.FREE))
    assert evaluate(reference, reference).consistency is free.consistency is None
    assert "covariance claimed, but not judged" in " ".join(free.text().split())


def test_unusable_covariances_are_counted(noisy, track):
    estimate, reference = noisy(1.0)
    cov = estimate.cov_b.copy()
    cov[:7] = np.nan
    cov[7:10] = -COV
    found = evaluate(track(estimate.t, estimate.q_nb, cov_b=cov), reference).consistency
    assert (found.count, found.unusable) == (N - 10, 10)
    cov[:] = 0.0
    assert evaluate(track(estimate.t, estimate.q_nb, cov_b=cov), reference).consistency is None


@pytest.fixture(scope="module")
def judged(track, motion):
    t = np.arange(6000) / 100.0
    error = np.random.default_rng(1).normal(0.0, 0.02, (t.size, 3))
    raised = np.where(t > 50.0, flags.MAG_GATED, 0)
    q_ref = motion(t)
    q_ref[2000:2500] = np.nan
    estimate = track(t, quat_multiply(motion(t), quat_from_rotvec(error)), source=HOSTILE, flags=raised)
    return evaluate(estimate, track(t, q_ref, source=HOSTILE), settle=3.0)


@pytest.fixture(scope="module")
def text(judged):
    facts = [("device", HOSTILE), (HOSTILE, "x")]
    return side_by_side({"first": judged, HOSTILE: judged}, title=HOSTILE, facts=facts).page()


class TestPage(PageBattery):
    def test_it_has_the_numbers_of_what_was_compared(self, judged, text):
        assert f"{np.degrees(judged.stats['total'].rmse):.3f}" in text
        assert flags.MEANING[flags.MAG_GATED][1] in text


def rows(table):
    """Cells of a table by the name of their row."""
    return {row[0]: row[1:] for row in table.rows}


def test_a_share_that_rounds_to_nothing_is_not_nothing_and_rows_that_cannot_be_compared(judged, track, monkeypatch):
    score = np.ones(judged.t.size)
    score[[1000]] = 0
    q = judged.estimate.q_nb
    _, samples = evaluate(track(judged.t, q), track(judged.t, q, score=score)).report().tables
    shares = [cells[1] for cells in rows(samples).values()]
    assert shares == ["100.0 %", "< 0.1 %"]
    other = evaluate(judged.estimate, judged.reference, settle=4.0)
    free = evaluate(track(judged.t, judged.estimate.q_nb, north=North.FREE), judged.reference)
    assert side_by_side({"a": judged, "b": judged}).remarks == []
    assert "the rows differ in the samples scored" in str(side_by_side({"a": judged, "b": other}).remarks[0])
    both = side_by_side({"free": free, "magnetic": judged}).page()  # with figures of the tilt alone
    assert both.count("not scored: the heading of the estimate counts from an arbitrary zero") == 1
    with pytest.raises(ShapeError, match="at least one evaluation"):
        side_by_side({})
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtraError, match=r'pip install "plumbob\[plot\]"'):
        side_by_side({"x": judged}).page()


@pytest.mark.parametrize("size", [1, 2, 3])
def test_numbers_of_tiny_tracks(track, judged, size):
    """Their errors by hand: of e = q_est q_ref⁻¹ = (w, x, y, z) the angle 2 acos |w|, and 2 acos √(w² + z²) of it."""
    few = slice(1000, 1000 + size)
    tiny = evaluate(track(judged.t[few], judged.estimate.q_nb[few]), judged.reference)
    errors, samples = side_by_side({"tiny": tiny}).parts[0].tables
    w, _, _, z = quat_multiply(judged.estimate.q_nb[few], quat_conjugate(judged.reference.q_nb[few])).T
    for name, cosine in (("total", np.abs(w)), ("inclination", np.hypot(w, z))):
        error = np.degrees(2.0 * np.arccos(cosine))
        rmse, mean, std, worst, at, *_ = (float(v.replace("−", "-")) for v in rows(errors)[name])
        by_hand = np.sqrt(np.mean(error**2)), error.mean(), error.std(), error.max()
        assert (rmse, mean, std, worst) == pytest.approx(by_hand, abs=6e-4)  # three decimals
        assert at == pytest.approx(judged.t[few][np.argmax(error)], abs=6e-3)
    assert rows(samples)["scored"][:2] == (str(size), "100.0 %")
    if size == 1:
        assert tiny.report().page().startswith("<!DOCTYPE html>")


@pytest.mark.parametrize("count", [100_000, pytest.param(1_000_000, marks=pytest.mark.long(reason="seconds"))])
def test_any_number_of_samples_makes_a_small_file(tmp_path, track, count):
    """Two numbers for each of 100 000 samples alone would be 2 MB of text or more."""
    t = np.arange(count) / 250.0
    q = quat_from_rotvec(np.random.default_rng(2).normal(0.0, 0.1, (t.size, 3)))
    level = np.tile([1.0, 0.0, 0.0, 0.0], (t.size, 1))
    path = evaluate(track(t, q), track(t, level)).write_html(tmp_path / "page.html")
    assert 50_000 < path.stat().st_size < 2_000_000
