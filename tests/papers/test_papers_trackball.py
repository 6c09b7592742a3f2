"""The trackball paper's tests: records are what they should be, figures follow from theory, and misprints fail."""

import math

import numpy as np
import pytest

from plumbob.core.errors import ParameterError
from plumbob.core.units import deg, dps, to_dps
from plumbob.filters.channel_scalar import ramp_lag, steady_gain
from plumbob.noise import deviation
from plumbob.papers.description import TRACKBALL
from plumbob.papers.trackball import misprints, recorded, seeds
from plumbob.papers.trackball.page import Found, paper
from plumbob.papers.trackball.seeds import LONG_TAUS, SCALES, TAUS, best_gain, degrees_of_freedom, measure_turntable
from plumbob.papers.workspace import Work
from tests.helpers.papers import by_key, english_alone, named, unmet

SEEDS = range(6)


@pytest.fixture(scope="module")
def short():
    return seeds.measure_short(range(30))


@pytest.fixture(scope="module")
def white():
    return seeds.measure_white(range(2))


@pytest.fixture(scope="module")
def long():
    return seeds.measure_long(range(2))


@pytest.fixture(scope="module")
def table():
    return {scale: measure_turntable(SEEDS, scale) for scale in SCALES}


@pytest.fixture(scope="module")
def tests(tmp_path_factory):
    """The recorded tests, through real bytes."""
    work = Work(tmp_path_factory.mktemp("trackball"), seed=2)
    card = recorded.card(work)
    return recorded.rest(work), recorded.soaked(work), recorded.turntable_run(work, card), recorded.lapped(work, card)


@pytest.fixture(scope="module")
def found(short, white, long, table, tests):
    rest, soaked, turned, lapped = tests
    return Found(
        seeds={"short": 30, "white": 2, "long": 2, "table": len(SEEDS)}, soaked=soaked, rest=rest, turned=turned,
        parts={part: misprints.warmed(part, 5) for part in misprints.PARTS}, lapped=lapped, short=short, white=white,
        long=long, fit=seeds.fit(rest.before[:, 0]), negative=seeds.measure_fits(range(5)), table=table,
        gain=best_gain(range(2), [0.4, 0.6, 0.8]), printed=misprints.allan_of_white(1),
        matrix=misprints.one_number_for_a_matrix(1),
    )  # fmt: skip


def test_the_turntable_is_the_paper_s():
    """0 to 10 r/min in 100 s, 1000 samples, then 1000 at 60 °/s; an axis in the plane of the table measures nothing."""
    rest, run = seeds.on_turntable(0, scale=0.0)
    assert (run.t.size, np.diff(run.t)) == (2000, pytest.approx(seeds.STEP))
    assert run.true[:, 2] == pytest.approx(np.minimum(deg(0.6) * run.t, dps(60.0)), abs=1e-12)
    assert np.abs(run.true[:, :2]).max() < 1e-12
    noise = (run.measured - run.true).std()
    assert noise == pytest.approx(seeds.WHITE, rel=0.05)  # flicker adds 2 %, and 6000 samples scatter by 1 %
    assert rest.measured.mean(axis=0) == pytest.approx(dps(1.5), abs=dps(0.05))


def test_at_50_s_nothing_is_gained_neither_in_deviation_nor_in_angle_nor_in_scatter(short):
    """90 single differences before and after. They differ by the filter's memory of one end, 3 s of 50, at most."""
    assert short.adev[seeds.RATIOS.index(1e-3), -1] == pytest.approx(1.0, abs=0.1)
    # A settled filter holds back Σ (y − x̂) = (1 − K)/K (x̂_end − x̂_start) and no more, however long the record is.
    # For Q/R = 0.001 that is 31 samples of 0.013 °/s · √2, or 0.06°, against angles of √500 · 0.1 °/s · 0.1 s = 0.2°
    # from white noise and more from flicker. Added as squares it is below 5 %.
    assert short.angle[:3] == pytest.approx(1.0, abs=0.05)
    # √(π/2 − 1) = 0.756 at 50 s, where a record has one difference; degrees of freedom are told beside
    assert short.scatter[-1] == pytest.approx(math.sqrt(0.5 * math.pi - 1.0), abs=0.2)
    assert degrees_of_freedom(1000, 50.0) == 1.0
    assert degrees_of_freedom(1000, 10.0) == pytest.approx(12.8, abs=0.1)  # scatter 0.29, as 400 simulations show


def test_white_noise_falls_as_theory_says(white):
    """Two seeds of three channels of 1e5 samples hold 2·3·1e5·K/2 independent values: 300 for the slowest, 8 %."""
    for ratio, measured in zip(seeds.RATIOS, white, strict=True):
        k = steady_gain(ratio)
        assert seeds.theory(ratio) == k / (2.0 - k)  # Σ K² (1 − K)²ⁱ
        assert measured == pytest.approx(seeds.theory(ratio), rel=4.0 * math.sqrt(2.0 / (0.5 * k * 6 * 95_000)))


def test_allan_deviation_falls_at_short_times_only(short, long):
    """Beyond the filter's memory Δt/K the ratio returns to 1; at its start it is that of the differences of the filter.

    For white noise the settled filter gives E[(x̂₂ − x̂₁)²] = 2 v (1 − (1 − K)) = 2 v K, v = K/(2 − K): a ratio of
    √(K v) at one sample; in the paper's record, its start adds to it.
    """
    for k, ratio in enumerate(seeds.RATIOS[:3]):
        settled = math.sqrt(steady_gain(ratio) * seeds.theory(ratio))
        assert short.adev[k, 0] > 0.95 * settled
        assert list(short.adev[k, 1:6]) == sorted(short.adev[k, 1:6])
        assert long.adev[k, 0] == pytest.approx(settled, rel=0.05)
        assert long.adev[k, LONG_TAUS.index(600.0)] == pytest.approx(1.0, abs=0.01)
        assert long.adev[k, LONG_TAUS.index(100.0)] == pytest.approx(1.0, abs=0.02)
    assert short.adev[2, TAUS.index(1.0)] < 0.2


def test_four_hours_hold_what_was_planted(long):
    """σ² = N²/τ + (0.6643 B)² + K² τ/3 at 600 s, from 6 records of some 25 degrees of freedom: 6 %, and 4 of it."""
    n, b, k = seeds.WHITE * math.sqrt(seeds.STEP), 0.6643 * seeds.FLICKER, seeds.WALK
    planted = math.sqrt(n**2 / 600.0 + b**2 + k**2 * 600.0 / 3.0)
    assert long.before[LONG_TAUS.index(600.0)] == pytest.approx(planted, rel=0.23)
    assert long.white == pytest.approx(n, rel=0.02)


def test_lags_are_those_of_theory(table):
    """Over 400 samples the mean of y − x̂ scatters by √2 (1 − K)/K sd(x̂) / 400, 0.3 % of the lag; the bar is 5 %."""
    rows = table[0.0]
    for ratio in seeds.RATIOS[:4]:
        k = steady_gain(ratio)
        row = rows[f"scalar Q/R={ratio:g}"]
        assert row.lag_theory == pytest.approx(seeds.SLOPE * seeds.STEP * (1.0 - k) / k)
        assert row.lag == pytest.approx(row.lag_theory, rel=0.05)
        lag = ramp_lag(k, seeds.SLOPE, seeds.STEP) / (seeds.SLOPE * seeds.STEP)
        assert seeds.scalar_filter(ratio).lag == pytest.approx(lag)
        average = rows[seeds.average_like(ratio).name]
        assert average.lag == pytest.approx(average.lag_theory, rel=0.05)
    assert abs(to_dps(rows["two states"].lag)) < 0.01


def test_what_helps_on_the_ramp_is_the_bias_and_not_the_filter(table):
    """1.5 °/s of bias go; then no scalar filter or average beats the unfiltered rate, but the one with two states."""
    rows = table[0.0]
    assert to_dps(rows["measured"].ramp_rms) == pytest.approx(1.5, abs=0.05)
    removed = rows["bias removed"].ramp_rms
    assert to_dps(removed) == pytest.approx(0.1, rel=0.1)
    names = [c.name for c in seeds.contenders()]
    assert len(names) == 11
    assert all(rows[name].ramp_rms > removed for name in names[:-1])
    assert rows["two states"].ramp_rms < 0.5 * removed
    assert rows["scalar Q/R=0.01"].angle == pytest.approx(deg(0.5707 * 100.0), rel=0.05)  # lag over the ramp
    assert rows["two states"].angle < 1.1 * rows["bias removed"].angle


def test_a_gain_error_stays_and_a_lag_can_hide_it(table):
    """1 % of 60 °/s is 0.6 °/s at constant rate, for everyone who has arrived there."""
    rows = table[0.01]
    for name in ("bias removed", "scalar Q/R=0.01", "two states"):
        assert to_dps(rows[name].hold_mean) == pytest.approx(0.6, abs=0.02)
    assert rows["scalar Q/R=0.01"].ramp_rms < rows["bias removed"].ramp_rms


def test_fits_of_five_powers_points_of_the_ball_and_noise_of_the_rig():
    """A curve of N and B alone: its weights are found by both fits where nothing is random; cond as in papers.md."""
    assert np.linalg.cond(seeds.powers()) == pytest.approx(3141.0, abs=1.0)
    plain, weighted = seeds.measure_fits(range(20))
    assert (plain, weighted) == (1.0, 0.0)
    # A body whose nose points down touches with its nose: attitude 90° nose down, q = (√½, 0, −√½, 0)
    nose_down = np.array([[math.sqrt(0.5), 0.0, -math.sqrt(0.5), 0.0]])
    assert recorded.touching(nose_down) == pytest.approx(np.array([[1.0, 0.0, 0.0]]), abs=1e-15)
    assert recorded.apart(np.eye(3), np.roll(np.eye(3), 1, axis=0)) == pytest.approx(0.5 * math.pi)
    assert seeds.noise_card().gyr.n_rpsd == pytest.approx(seeds.WHITE * math.sqrt(seeds.STEP))
    still = seeds.at_rest(1, 1000.0, flicker=0.0).measured
    assert deviation(still, [1]) == pytest.approx(seeds.WHITE, rel=0.05)


def test_printed_forms_fail_as_they_must():
    """(13) as printed is √½ of white noise; with a mean m it is m/√2 [closed forms]. (5) takes 2 °/s twice off."""
    printed = misprints.allan_of_white(3)
    assert printed.printed / printed.corrected == pytest.approx(math.sqrt(0.5), rel=0.01)
    assert to_dps(printed.with_mean) == pytest.approx(1.5 / math.sqrt(2.0), rel=0.01)
    assert to_dps(misprints.counted_twice()) == pytest.approx(-2.0)
    assert to_dps(misprints.in_metres()) == pytest.approx(0.1 * 8.80665)
    assert to_dps(np.array(misprints.gain_error())) == pytest.approx([0.6, 0.6], abs=1e-6)
    assert misprints.axis_in_the_plane(1) == pytest.approx((0.0, 60.0), abs=1e-9)
    assert misprints.allan_as_printed(np.array([1.0, 1.0, 3.0, 3.0, 9.0]), 2) == math.sqrt(0.5 * 1.0)


@pytest.mark.parametrize(("part", "raw", "left"), [(0.03, 0.59, -1.39), (-0.05, -0.98, -2.95)])
def test_the_paper_s_temperature_makes_other_parts_worse(part, raw, left):
    """Figures of the corrected specification, from 25 to 45 °C; a card of the part itself leaves 0.002 °/s."""
    at = misprints.warmed(part, 7)
    assert (to_dps(at.raw), to_dps(at.printed)) == (pytest.approx(raw, abs=0.05), pytest.approx(left, abs=0.05))
    assert abs(to_dps(at.own)) < 0.002
    assert to_dps(at.coefficient) == pytest.approx(part, abs=5e-4)


def test_the_recorded_tests_are_the_paper_s_and_show_the_lag(tests):
    rest = tests[0]
    assert (rest.t.size, rest.temp_c) == (1000, 25.0)
    assert 1.0 / to_dps(rest.quantum) == pytest.approx(131.0)  # LSB/(°/s) [Chen2013]
    assert np.abs(rest.before.mean(axis=0)).max() < 1e-12  # J is taken off
    assert rest.after[:, 0].std() < 0.5 * rest.before[:, 0].std()
    assert rest.compared.tau == pytest.approx(TAUS)
    turned = tests[2]
    assert turned.t.size == 2000
    errors = {name: to_dps(rate - turned.true)[:1000] for name, rate in turned.rates.items()}
    assert np.sqrt(np.mean(errors["best"] ** 2)) < 0.05
    ends = {name: abs(math.degrees(error[999])) for name, error in turned.headings.items()}
    assert ends["calibrated, paper's filter"] - ends["calibrated"] == pytest.approx(57.0, abs=2.0)
    assert ends["calibrated"] < 5.0
    lapped = tests[3]
    off = {name: np.degrees(recorded.apart(at, lapped.tracks["true"])).max() for name, at in lapped.tracks.items()}
    assert off["calibrated"] < 10.0 and off["calibrated"] < min(off["best"], off["paper"], off["measured"])


def test_outcomes_are_whole_and_items_name_them(found):
    made = paper(found, 2)
    outcomes = by_key(made.outcomes)
    assert len(outcomes) > 55
    assert unmet(outcomes.values()) <= {"allan.ratio.50", "allan.scatter.50", "allan.scatter.10"}  # few seeds here
    assert named(TRACKBALL.items) <= outcomes.keys()
    scenes = [scene for part in made.report.parts for scene in part.scenes]
    circles = [at[0] for scene in scenes for name, at in scene.points.items() if str(name).startswith(".")]
    np.testing.assert_allclose(np.linalg.norm(circles, axis=1), np.ones(36), rtol=1e-12)  # three of 12 points
    assert "with a mean of 1.5 °/s 1.06" in str(made.report)  # √½ of it and of white noise: 1.063 [closed form of (13)]
    assert english_alone(made.report, r"plumbob .*|solid.*|dashed.*|dotted.*") == set()


def test_same_seeds_same_figures(tmp_path):
    assert measure_turntable([3], 0.0) == measure_turntable([3], 0.0)
    works = [Work(tmp_path / name, seed=4) for name in "ab"]
    for work in works:
        work.folder.mkdir()
    first, second = (recorded.rest(work) for work in works)
    assert first.after.tobytes() == second.after.tobytes()


def test_a_sample_of_the_scalar_filter_takes_nine_operations_and_a_gain_that_is_none_has_no_theory():
    """(9) three, (10) two for Q Δt, (11) two, (12) two [Chen2013]."""
    assert seeds.operations() == 9
    with pytest.raises(ParameterError):
        seeds.scalar_filter(0.0)
