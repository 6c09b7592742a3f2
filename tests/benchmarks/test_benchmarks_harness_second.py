"""The second battery: its motions and edits by what their descriptions say, and how an answer is measured."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.harness.contender import Answer, contender_of
from benchmarks.harness.fault_cases import listing
from benchmarks.harness.fault_scene import FIELD_N, LONGEST, RANGES, record, truth_of
from benchmarks.harness.second import compare, listen, measure_second
from benchmarks.harness.second_cases import CASES, GROUPS, MOTIONS, NONE, SLOW, turning
from benchmarks.harness.silence import Outcome
from plumbob.core import flags
from plumbob.core.constants import G0
from plumbob.core.units import deg, dps, to_deg, to_dps
from plumbob.filters.offline import Stage
from plumbob.rotations import quat_conjugate, quat_from_euler_zyx, quat_multiply, quat_rotate

BY_NAME = {case.name: case for case in CASES}
CLEAN = {name: record(motion, LONGEST) for name, motion in MOTIONS.items()}


def stream(name):
    return BY_NAME[name].stream()


def change(name, triad):
    """Of a stream that has lost no samples, from the clean one of its motion."""
    damaged = stream(name)
    return getattr(damaged, triad) - getattr(CLEAN[name.rpartition("_")[2]], triad)[: damaged.t.size]


def test_there_are_many_cases_with_names_of_their_own_in_every_group_and_motion():
    assert len({case.name for case in CASES}) == len(CASES) >= 100
    assert {case.group for case in CASES} == set(GROUPS)
    for name, motion in MOTIONS.items():
        ends = [case for case in CASES if case.name.endswith(f"_{name}")]
        assert len(ends) > 40
        assert all(case.motion is motion for case in ends)
        assert {case.group for case in ends} >= {f"S{i}" for i in (1, 2, 3, 4, 5, 6, 7, 9)}


def test_few_cases_cannot_be_seen_and_say_why():
    unseen = [case for case in CASES if case.unseen]
    assert 0 < len(unseen) <= 0.04 * len(CASES)
    assert all(f"unseen: {case.unseen}" in listing(CASES, GROUPS) for case in unseen)


def test_every_run_goes_on_behind_the_fault():
    for case in CASES:
        begin, last = case.judged_from, case.length / 100.0
        assert last - begin >= 30.0, case.name
        assert math.isinf(case.end) or last - case.end >= 30.0, case.name
        assert case.length <= LONGEST


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_every_case_does_something(case):
    damaged, clean = case.stream(), case.clean()
    n = case.length
    same = damaged.t.size == n and all(
        np.array_equal(getattr(damaged, name), getattr(clean, name)[:n]) for name in ("t", "gyr", "acc", "mag")
    )
    assert not same


# --- motions ------------------------------------------------------------------------------------------------


def test_motions_have_their_rates_and_accelerations():
    for name, most_dps, most in (("brisk", 220.0, 5.0), ("slow", 9.0, 0.8), ("none", 0.0, 0.0)):
        q, rates = truth_of(MOTIONS[name])
        assert to_dps(np.linalg.norm(rates, axis=1)).max() == pytest.approx(most_dps, rel=0.15)
        t = np.arange(LONGEST) / 100.0
        push = np.zeros((LONGEST, 3)) if MOTIONS[name].push is None else MOTIONS[name].push(t)
        assert np.linalg.norm(push, axis=1).max() == pytest.approx(most, rel=0.15)
        left = quat_rotate(q, CLEAN[name].acc) - push - [0.0, 0.0, G0]
        assert np.abs(left).max() < 6.0 * 0.03  # 45 000 normal numbers
        assert (push[:500] == 0.0).all()


def test_a_hand_comes_back():
    """The mean velocity over the run is that of sines that began at zero speed: below their peak, A / (2π f)."""
    speed = np.cumsum(MOTIONS["brisk"].push(np.arange(LONGEST) / 100.0), axis=0) / 100.0
    assert np.abs(speed).max() < 2.0 * 3.0 / (2.0 * math.pi * 1.1)


@pytest.mark.parametrize(("bank", "seconds"), [(20.0, 30.0), (45.0, 10.0)])
def test_in_a_coordinated_turn_the_specific_force_stays_on_z(bank, seconds):
    case = BY_NAME[f"turn_banked_{bank:g}deg_{seconds:g}s"]
    said, noise = case.stream(), CLEAN["none"].acc[: case.length] - [0.0, 0.0, G0]
    force = said.acc - noise
    middle = round(100.0 * (30.0 + 0.5 * seconds))
    assert np.abs(force[:, :2]).max() < 0.01
    assert force[middle, 2] == pytest.approx(G0 / math.cos(deg(bank)), rel=1e-3)
    assert force[-1, 2] == pytest.approx(G0, rel=1e-5)
    up = quat_rotate(quat_conjugate(truth_of(case.motion)[0][middle]), [0.0, 0.0, 1.0])
    assert to_deg(math.acos(up[2])) == pytest.approx(bank, abs=0.01)


def test_a_turn_ends_level_at_its_heading():
    """The rate rises and falls along cosines of 2 s: its mean over them is a half."""
    q, _ = truth_of(turning(dps(6.0), 10.0))
    assert q[-1] == pytest.approx(quat_from_euler_zyx([deg(6.0 * (10.0 - 2.0)), 0.0, 0.0]), abs=1e-6)
    q, _ = truth_of(BY_NAME["turn_1dps_60s"].motion)
    assert q[-1] == pytest.approx(quat_from_euler_zyx([deg(58.0), 0.0, 0.0]), abs=1e-6)


def test_a_flat_turn_pulls_inward():
    """To the left of where the unit points, x forward: along y."""
    said = stream("turn_flat_10s").acc - CLEAN["none"].acc[:9000]
    assert said[3500] == pytest.approx([0.0, 20.0 * dps(6.0), 0.0], abs=0.01)


def test_a_field_that_turns_with_the_body_stays_as_it_was():
    """But for the 2 s in which the body takes up its turn: 1° late."""
    said = stream("turn_1dps_60s_field_too").mag - CLEAN["none"].mag[:12000]
    assert np.abs(said[3200:8800]).max() < 1.01 * deg(1.0) * math.hypot(*FIELD_N[:2])


# --- edits --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "degrees"), [("field_east_10s_brisk", 56.4), ("field_weak_20s_slow", 26.7)])
def test_fields_turn_north_as_described(name, degrees):
    damaged = stream(name)
    rows = slice(3000, 3800)
    field = quat_rotate(damaged.truth[rows], damaged.mag[rows]).mean(axis=0)
    assert to_deg(math.atan2(field[0], field[1])) == pytest.approx(degrees, abs=0.5)
    assert (
        damaged.mag[4000 if "10s" in name else 5000 :].tobytes()
        == CLEAN[name.rpartition("_")[2]].mag[4000 if "10s" in name else 5000 : 9000].tobytes()
    )


def test_a_reversed_field_points_south_and_iron_turns_with_the_sensor():
    damaged = stream("field_reversed_20s_brisk")
    field = quat_rotate(damaged.truth[3000:5000], damaged.mag[3000:5000]).mean(axis=0)
    assert field == pytest.approx(FIELD_N - [0.0, 40.0, 0.0], abs=0.1)
    assert change("iron_20s_brisk", "mag")[3000:5000] == pytest.approx(np.tile([30.0, 0.0, 0.0], (2000, 1)))


def test_a_field_turns_about_the_vertical():
    damaged = stream("field_turns_30s_none")
    for second in (10, 29):
        field = damaged.mag[3000 + 100 * second : 3010 + 100 * second].mean(axis=0)
        assert to_deg(math.atan2(-field[0], field[1])) == pytest.approx(second, abs=1.0)
        assert field[2] == pytest.approx(FIELD_N[2], abs=0.5)


def test_dropouts_have_a_field_behind_them():
    damaged = stream("dropout_0.14s_field_none")
    assert (damaged.origin[2999], damaged.origin[3000]) == (2999, 3014)
    assert damaged.mag[3000:5000] - CLEAN["none"].mag[3014:5014] == pytest.approx(np.tile([30.0, 0.0, 0.0], (2000, 1)))
    assert damaged.mag[5000] == pytest.approx(CLEAN["none"].mag[5014])


def test_signs_and_axes():
    assert change("sign_acc_5s_slow", "acc")[3000:3500] == pytest.approx(-2.0 * CLEAN["slow"].acc[3000:3500])
    swapped = stream("swap_gyr_20s_brisk").gyr[3000:5000]
    assert (swapped == CLEAN["brisk"].gyr[3000:5000][:, [1, 0, 2]]).all()


def test_axes_that_die_stick_or_dither():
    dies = stream("dies_gyr_30s_brisk").gyr
    assert dies[4500, 2] == pytest.approx(0.5 * CLEAN["brisk"].gyr[4500, 2])
    assert (dies[6000:, 2] == 0.0).all()
    assert (dies[:, :2] == CLEAN["brisk"].gyr[: len(dies), :2]).all()
    assert (stream("fades_acc_30s_none").acc[6000:] == 0.0).all()
    sticks = stream("sticks_mag_20s_brisk").mag
    assert (sticks[3000:5000, 2] == CLEAN["brisk"].mag[2999, 2]).all()
    assert (sticks[3000:5000, :2] == CLEAN["brisk"].mag[3000:5000, :2]).all()
    dither = stream("dithers_acc_20s_slow").acc[2999:5000, 2]
    assert np.unique((dither - dither[0]) / (RANGES["acc"] / 32768.0)) == pytest.approx([0.0, 1.0])


def test_biases_step_and_grow():
    assert to_dps(change("bias_2dps_slow", "gyr")[[2999, 3000, 11999]]) == pytest.approx(
        np.array([[0.0] * 3, [2.0] * 3, [2.0] * 3])
    )
    ramp = to_dps(change("ramp_5dps_30s_none", "gyr"))
    assert ramp[[2999, 4500, 6000, 11999], 1] == pytest.approx([0.0, 2.5, 5.0, 5.0])
    assert to_dps(change("bias_1dps_no_mag_none", "gyr")[[5000, 9000]]) == pytest.approx(
        np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    )
    assert not stream("bias_1dps_no_mag_none").has_mag.any()
    assert not BY_NAME["bias_1dps_no_mag_none"].clean().has_mag.any()


def test_ends_of_range_that_no_flag_knows():
    said = stream("saturates_gyr_20s_brisk")
    assert to_dps(np.abs(said.gyr[3000:5000])).max() == pytest.approx(100.0)
    assert [row[4] for row in said.rows() if row[4]] == []
    wrapped = stream("wraps_acc_20s_none").acc[3000:5000, 2]
    assert wrapped == pytest.approx(CLEAN["none"].acc[3000:5000, 2] - 18.0)
    said, true = stream("wraps_mag_20s_slow").mag[3000:5000], CLEAN["slow"].mag[3000:5000]
    turns = (true - said) / 80.0
    assert turns == pytest.approx(np.round(turns))
    assert (np.abs(said) <= 40.0).all()


def test_times():
    t = stream("clock_half_20s_slow").t
    assert t[[3000, 4000, 4999]] == pytest.approx([30.0, 35.0, 39.995])
    assert np.diff(t)[5000:] == pytest.approx(0.01)
    slow = stream("rate_10Hz_20s_brisk")
    assert slow.origin[2999:3003].tolist() == [2999, 3000, 3010, 3020]
    assert slow.t.size == 9000 - 1800
    late = stream("late_gyr_50ms_brisk").gyr
    assert (late[3000:] == CLEAN["brisk"].gyr[2995 : len(late) - 5]).all()


@pytest.mark.parametrize("count", [3, 10, 50])
def test_blocks_come_twice(count):
    said = stream(f"twice_{count}_20s_brisk")
    block = list(range(3000, 3000 + count))
    assert said.origin[3000 : 3001 + 2 * count].tolist() == [*block, *block, 3000 + count]
    assert said.t.size == 9000 + 20 * count
    assert (said.t == said.origin / 100.0).all()


def test_shocks_reach_the_end_of_the_range():
    said = stream("shocks_20s_none")
    hit = np.flatnonzero(said.acc[:, 0] == RANGES["acc"])
    assert hit.tolist() == [3000 + 100 * i + k for i in range(20) for k in (0, 1)]
    assert all(row[4] & flags.ACC_CLIPPED for row, i in zip(said.rows(), range(9000), strict=True) if i in hit)


# --- answers ------------------------------------------------------------------------------------------------


class Told:
    """A contender that answers with the truth turned by some angles, degrees, at each sample."""

    name = settings = "told"
    timed, alarms = True, 1

    def __init__(self, yaw, roll=0.0, words=0, sd_deg=None):
        self.yaw, self.roll, self.words, self.sd_deg = yaw, roll, words, sd_deg

    def answer(self, given):
        n = given.t.size
        angles = np.zeros((n, 3))
        angles[:, 0], angles[:, 2] = np.broadcast_to(self.yaw, n), np.broadcast_to(self.roll, n)
        q = quat_multiply(quat_from_euler_zyx(np.radians(angles)), given.truth[given.newest])
        cov = None if self.sd_deg is None else np.tile(np.diag(np.radians(self.sd_deg) ** 2), (n, 1, 1))
        return Answer(q, np.broadcast_to(self.words, n).astype(np.int64), cov, {})


def test_errors_and_claims_are_of_heading_and_inclination():
    heard = listen(Told(6.0, sd_deg=[1.0, 1.0, 2.0]), CLEAN["none"], free=False)
    assert heard.error_deg == pytest.approx(6.0)
    assert heard.claimed.ratio == pytest.approx(3.0)
    heard = listen(Told(0.0, 6.0, sd_deg=[3.0, 4.0, 4.0]), CLEAN["none"], free=False)
    assert heard.claimed.error_deg[0] == pytest.approx([0.0, 6.0], abs=1e-6)
    assert heard.claimed.ratio == pytest.approx(6.0 / 5.0)  # of both tilts, 3° and 4°


def test_a_claim_in_body_axes_is_turned_into_those_of_the_vertical():
    """Upright on its x axis, the body's x is the vertical."""
    upright = replace(NONE, start=(0.0, -0.5 * math.pi, 0.0))
    heard = listen(Told(6.0, sd_deg=[2.0, 1.0, 1.0]), record(upright, 100), free=False)
    assert heard.claimed.ratio == pytest.approx(3.0)


def test_a_free_heading_counts_from_the_first_sample():
    yaw = np.full(LONGEST, 50.0)
    yaw[9000:] = 57.0
    heard = listen(Told(yaw, sd_deg=[2.0, 2.0, 2.0]), CLEAN["slow"], free=True)
    assert heard.error_deg[[0, 8999, 9000]] == pytest.approx([0.0, 0.0, 7.0], abs=1e-5)
    assert heard.claimed.ratio[9000] == pytest.approx(3.5, rel=1e-4)


def test_a_warning_that_the_clean_run_has_too_is_none():
    case = BY_NAME["field_east_10s_none"]
    given = case.stream()
    heard = listen(Told(9.0, words=0b11), given, free=False)
    outcomes = [
        compare(case, given, heard, listen(Told(0.0, words=before), case.clean(), free=False), alarms).by_both
        for before, alarms in ((0, 1), (0, 2), (0, 4), (1, 1))
    ]
    assert outcomes == [Outcome.SAID, Outcome.SAID, Outcome.WRONG, Outcome.WRONG]


def test_an_error_of_the_clean_run_is_not_counted():
    case = BY_NAME["field_east_10s_none"]
    given = case.stream()
    clean = listen(Told(5.0), case.clean(), free=False)
    assert compare(case, given, listen(Told(6.9), given, free=False), clean, 1).by_both == Outcome.RIGHT
    assert compare(case, given, listen(Told(7.1), given, free=False), clean, 1).by_both == Outcome.WRONG


@pytest.mark.parametrize("name", ["mekf", "smoother"])
def test_an_answer_has_the_bits_of_a_stream_that_comes_sample_by_sample(name):
    contender = contender_of(Stage(name, {}))
    given = record(SLOW, 900)
    answer, running = contender.answer(given), contender.start()
    for i, row in enumerate(given.rows()):
        assert running.take(row) == answer.words[i]
        assert np.array_equal(running.attitude(), answer.q_nb[i])
    assert answer.cov_b.shape == (900, 3, 3)


def test_the_smoother_keeps_its_attitude_where_a_session_drops_a_sample():
    given = stream("twice_3_20s_slow")
    given.take(np.arange(3100))
    answer = contender_of(Stage("smoother", {})).answer(given)
    assert [bool(word & flags.TIME_FAULT) for word in answer.words[3002:3007]] == [False, True, True, True, False]
    assert (answer.q_nb[3003:3006] == answer.q_nb[3002]).all()


def test_what_cannot_concern_a_contender_does_not_count():
    contender = Told(0.0)
    contender.timed = False
    found = measure_second([contender], [BY_NAME["clock_half_20s_slow"], BY_NAME["field_east_1s_none"]])
    assert found.found["told"]["clock_half_20s_slow"].by_both == Outcome.NOT_APPLICABLE
    assert list(found.judged("told")) == ["field_east_1s_none"]
    assert "n/a" in found.text()


def test_bars_count_what_could_be_seen_apart():
    wrong = Told(np.where(np.arange(LONGEST) < 3000, 0.0, 9.0), sd_deg=[1.0, 1.0, 1.0])
    wrong.answer = lambda given, whole=wrong: Told(
        np.where(given.newest < 3000, 0.0, 9.0 if given.t.size < LONGEST else 0.0), sd_deg=[1.0] * 3
    ).answer(given)
    names = ["turn_1dps_60s", "turn_1dps_60s_field_too", "field_east_1s_none", "field_east_3s_none"]
    found = measure_second([wrong], [BY_NAME[name] for name in names])
    assert [bar.value for bar in found.bars("told")] == [75.0, 100.0, 100.0, 100.0]
    assert re.search(r"^told +4 +0 % +0 % +0 % +100 % ", found.text(), re.MULTILINE)
    assert "turn_1dps_60s_field_too?" in found.text()
