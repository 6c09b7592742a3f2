"""The scene, and what each edit does to the stream; expected values are the cases' own one-line descriptions."""

import math

import numpy as np
import pytest

from benchmarks.harness.fault_cases import CASES, GROUPS, choose, listing
from benchmarks.harness.fault_scene import FIELD_N, GRAVITY_N, RANGES, USUAL, Motion, record, truth_of
from benchmarks.harness.second_cases import CASES as SECOND
from plumbob.core import flags
from plumbob.core.errors import ParameterError
from plumbob.core.units import to_dps
from plumbob.rotations import quat_angle, quat_conjugate, quat_from_euler_zyx, quat_from_rotvec, quat_rotate

BY_NAME = {case.name: case for case in CASES}
CLEAN = record(USUAL, 15000)


def stream(name):
    return BY_NAME[name].stream()


def as_bytes(samples):
    return b"".join(getattr(samples, name).tobytes() for name in ("t", "gyr", "acc", "mag", "has_mag", "origin"))


def rows_of(name):
    return list(stream(name).rows())


def test_the_truth_follows_the_closed_form_of_a_constant_rate():
    motion = BY_NAME["start_moving_300dps"].motion
    q, rates = truth_of(motion)
    for second in (1, 2, 4):
        assert quat_angle(q[100 * second], quat_from_rotvec([0.0, 0.0, math.radians(300.0 * second)])) < 1e-9
    assert to_dps(rates[1]) == pytest.approx([0.0, 0.0, 300.0])


def test_turns_of_a_fine_grid_add_up_to_the_attitude():
    """Mean rates are angle increments; one step from them errs by the coning term |ω × ω̇| Δt³ / 12 at most."""
    q, rates = truth_of(USUAL)
    steps = quat_from_rotvec(rates[1:] / 100.0)
    turned = quat_angle(q[:-1], q[1:])
    speed = math.radians(math.sqrt(100.0**2 + 125.0**2 + 150.0**2))
    coning = speed * (speed * 2.0 * math.pi * 0.2 * math.sqrt(5.0)) * 0.01**3 / 12.0
    assert np.abs(turned - quat_angle(steps, np.array([1.0, 0.0, 0.0, 0.0]))).max() < 1.01 * coning


def test_the_scene_is_as_described():
    q, rates = truth_of(USUAL)
    assert (rates[:500] == 0.0).all()
    assert to_dps(np.abs(rates).max(axis=0)) == pytest.approx([100.0, 125.0, 150.0], rel=1e-3)
    assert math.degrees(math.asin(-FIELD_N[2] / np.linalg.norm(FIELD_N))) == pytest.approx(66.0)
    inverse = quat_conjugate(q)
    errors = {
        "gyr": to_dps(CLEAN.gyr - rates) - 0.1,
        "acc": CLEAN.acc - quat_rotate(inverse, GRAVITY_N),
        "mag": CLEAN.mag - quat_rotate(inverse, FIELD_N),
    }
    for name, sd in {"gyr": 0.1, "acc": 0.03, "mag": 0.3}.items():
        count = errors[name].size
        assert errors[name].std() == pytest.approx(sd, rel=5.0 / math.sqrt(2.0 * count))  # 5 sd of a sample's sd
        assert abs(errors[name].mean()) < 5.0 * sd / math.sqrt(count)


def test_every_case_of_both_tables_is_there_once():
    assert len({case.name for case in CASES}) == len(CASES) == 70
    assert sum(not case.counted for case in CASES) == 1
    assert sum(case.stamps for case in CASES) == 5
    assert {case.group for case in CASES} | {"F9"} == set(GROUPS)
    assert all(case.name in listing(CASES, GROUPS) and case.what in listing(CASES, GROUPS) for case in CASES)


def test_cases_are_chosen_by_name_or_group():
    chosen = choose(["gap_60s", "F6", "gap_60s"], CASES, GROUPS)
    assert [case.name for case in chosen] == ["gyro_bias_step_5dps", "gap_60s"]
    assert choose(["F9"], CASES, GROUPS) == []
    with pytest.raises(ParameterError, match="there is no case or group 'gap_9s'; groups are F1"):
        choose(["gap_9s"], CASES, GROUPS)


@pytest.mark.parametrize("case", (*CASES, *SECOND), ids=lambda case: case.name)
def test_outside_the_fault_the_stream_is_the_clean_one(case):
    """The same noise too; a case of its own motion is compared with that motion."""
    damaged, clean = case.stream(), record(case.motion, case.length)
    last = math.inf if math.isinf(case.end) else round(100.0 * case.end)
    outside = (damaged.origin < round(100.0 * case.begin)) | (damaged.origin >= last)
    for name in ("gyr", "acc", "mag"):
        assert np.array_equal(getattr(damaged, name)[outside], getattr(clean, name)[damaged.origin[outside]])
    before = damaged.origin < round(100.0 * case.begin)
    assert np.array_equal(damaged.t[before], clean.t[damaged.origin[before]])
    assert case.stream().gyr.tobytes() == damaged.gyr.tobytes()  # and the same again


def test_every_case_does_something():
    quiet = [case.name for case in CASES if as_bytes(case.stream()) == as_bytes(record(USUAL, case.length))]
    assert quiet == ["start_clean"]


def test_numbers_are_put_on_all_axes_of_the_fault_alone():
    assert np.isnan(stream("nan_gyr_1").gyr).sum() == 3
    assert np.isnan(stream("nan_all_1s").acc[3000:3100]).all()
    assert (stream("zero_mag_5s").mag[3000:3500] == 0.0).all()
    assert (stream("denormal32_acc_1").acc[3000] == 1e-40).all()
    assert np.isinf(stream("start_first_nan_mag").mag).sum() == 0
    assert np.isnan(stream("start_first_nan_mag").mag[0]).all()


def test_stuck_repeats_the_last_bits():
    damaged = stream("stuck_all_10s")
    for name in ("gyr", "acc", "mag"):
        assert (getattr(damaged, name)[2999:4000] == getattr(CLEAN, name)[2999]).all()


def test_ends_of_ranges_are_clipped_and_flagged_as_a_decoder_would():
    saturated = rows_of("gyro_saturated_1s")
    clipped = [i for i, row in enumerate(saturated) if row[4] & flags.GYR_CLIPPED]
    assert set(range(3006, 3095)) <= set(clipped) <= set(range(3000, 3102))  # 2000 of 3000 °/s lie in the 50 ms rises
    assert all(row[1][0] == RANGES["gyr"] for row in saturated[3006:3095])
    shock = rows_of("acc_clip_shock_50ms")
    assert [i for i, row in enumerate(shock) if row[4]] == [3000, 3001, 3002, 3003, 3004]
    assert shock[3000][2][0] == RANGES["acc"]
    assert rows_of("gyro_glitch_fullscale_1")[3000][4] == flags.GYR_CLIPPED
    assert rows_of("acc_glitch_fullscale_1")[3000][4] == flags.ACC_CLIPPED
    assert rows_of("huge1e30_gyr_1")[3000][4] == 0  # no code of a decoder
    assert np.abs(stream("mag_glitch_x100_1").mag[3000]).max() <= RANGES["mag"]


def test_disturbances_have_their_size_and_direction():
    damaged = stream("acc_lin_5ms2_10s")
    extra = quat_rotate(damaged.truth[3000:4000], damaged.acc[3000:4000] - CLEAN.acc[3000:4000])
    assert np.abs(extra - [5.0, 0.0, 0.0]).max() < 1e-12  # rounding of 10 m/s²
    damaged = stream("mag_parallel_gravity_5s")
    field = quat_rotate(damaged.truth[3000:3500], damaged.mag[3000:3500])
    assert field.mean(axis=0) == pytest.approx([0.0, 0.0, -np.linalg.norm(FIELD_N)], abs=5 * 0.3 / math.sqrt(500))
    assert np.abs(stream("freefall_noise_2s").acc[3000:3200]).max() < 6 * 0.03  # 600 normal numbers
    damaged = stream("mag_exact_antiparallel_1")
    acc, mag = damaged.acc[3000], damaged.mag[3000]
    assert np.dot(acc, mag) == pytest.approx(-np.linalg.norm(acc) * np.linalg.norm(mag))
    assert (stream("mag_hardiron_50uT_20s").mag - CLEAN.mag[:9000])[3500] == pytest.approx([50.0, 0.0, 0.0])
    assert to_dps(stream("gyro_bias_step_5dps").gyr - CLEAN.gyr[:9000])[[2999, 3000, 8999], 2] == pytest.approx(
        [0, 5, 5]
    )


def test_stamps():
    assert (stream("dt_zero_equal_stamps_1s").t[3000:3100] == 30.0).all()
    assert stream("dt_zero_equal_stamps_1s").t[3100] == 31.0
    assert np.diff(stream("dt_negative_step_0p5s").t)[2999] == pytest.approx(-0.49)
    assert np.diff(stream("dt_clock_jump_1e6s").t)[2999] == pytest.approx(1e6 + 0.01)
    assert math.isnan(rows_of("dt_nan_1")[3000][0])
    steps = np.diff(stream("dt_jitter_arrival_10s").t)
    assert steps.min() > 0.0
    assert steps[2999:4000].std() == pytest.approx(0.01 / math.sqrt(6.0), rel=0.2)  # of a difference of two uniforms


def test_a_gap_removes_samples_and_a_run_still_has_a_minute_after_it():
    damaged = stream("gap_0p5s")
    assert (damaged.t.size, damaged.origin[2999], damaged.origin[3000]) == (8950, 2999, 3050)
    damaged = stream("gap_60s")
    assert damaged.t[[2999, 3000, -1]].tolist() == [29.99, 90.0, 149.99]


def test_order():
    assert stream("duplicates_5s").origin[3000:3004].tolist() == [3000, 3000, 3001, 3001]
    damaged = stream("reordered_pairs_1s")
    assert damaged.origin[2999:3005].tolist() == [2999, 3001, 3000, 3003, 3002, 3005]
    assert damaged.newest[2999:3005].tolist() == [2999, 3001, 3001, 3003, 3003, 3005]
    assert (damaged.t == damaged.origin / 100.0).all()


def test_a_slow_magnetometer_in_four_forms():
    kept = [row[3] is not None for row in rows_of("mag10Hz_skip")]
    assert kept[3000:3011] == [True, *[False] * 9, True]
    assert sum(kept) == 9000 - 1350
    assert np.isnan(stream("mag10Hz_nanfill").mag).all(axis=1).sum() == 1350
    assert (stream("mag10Hz_zerofill").mag == 0.0).all(axis=1).sum() == 1350
    assert (stream("mag10Hz_hold").mag[3010:3020] == CLEAN.mag[3010]).all()
    assert all(row[3] is None for row in rows_of("mag_skipped_30s")[3000:6000])


@pytest.mark.parametrize(
    ("name", "yaw_pitch_roll"),
    [
        ("start_upside_down", (0.0, 0.0, 177.0)),
        ("start_upside_down_exact", (0.0, 0.0, 180.0)),
        ("start_pitch_90", (0.0, 90.0, 0.0)),
        ("start_heading_180_exact", (180.0, 0.0, 0.0)),
        ("start_no_mag_10s_then_mag", (70.0, 0.0, 0.0)),
    ],
)
def test_starts(name, yaw_pitch_roll):
    expected = quat_from_euler_zyx(np.radians(yaw_pitch_roll))
    assert quat_angle(stream(name).truth[0], expected) < 1e-12
    assert isinstance(BY_NAME[name].motion, Motion)
    assert BY_NAME[name].judged_from == 1.0
