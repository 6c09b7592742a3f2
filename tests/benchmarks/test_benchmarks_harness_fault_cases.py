"""The scenes of both batteries, and what each edit does; expected values are the cases' own one-line descriptions."""

import math

import numpy as np
import pytest

from benchmarks.harness.fault_cases import CASES, GROUPS, choose, listing
from benchmarks.harness.fault_scene import FIELD_N, GRAVITY_N, LONGEST, RANGES, USUAL, record, truth_of
from benchmarks.harness.second_cases import CASES as SECOND
from benchmarks.harness.second_cases import GROUPS as SECOND_GROUPS
from benchmarks.harness.second_cases import MOTIONS
from plumbob.core import flags
from plumbob.core.errors import ParameterError
from plumbob.core.units import to_dps
from plumbob.rotations import quat_conjugate, quat_rotate

BY_NAME = {case.name: case for case in (*CASES, *SECOND)}


@pytest.fixture(scope="module")
def clean():
    return record(USUAL, 15000)


def stream(name):
    return BY_NAME[name].stream()


def change(name, triad):
    """Of a stream of the second battery that has lost no samples, from the clean one of its motion; and that one."""
    damaged = stream(name)
    calm = getattr(record(MOTIONS[name.rpartition("_")[2]], damaged.t.size), triad)
    return getattr(damaged, triad) - calm, calm


def rows_of(name):
    return list(stream(name).rows())


def test_the_scene_is_as_described(clean):
    q, rates = truth_of(USUAL)
    assert (rates[:500] == 0.0).all()
    assert to_dps(np.abs(rates).max(axis=0)) == pytest.approx([100.0, 125.0, 150.0], rel=1e-3)
    assert math.degrees(math.asin(-FIELD_N[2] / np.linalg.norm(FIELD_N))) == pytest.approx(66.0)
    inverse = quat_conjugate(q)
    errors = {
        "gyr": to_dps(clean.gyr - rates) - 0.1,
        "acc": clean.acc - quat_rotate(inverse, GRAVITY_N),
        "mag": clean.mag - quat_rotate(inverse, FIELD_N),
    }
    for name, sd in {"gyr": 0.1, "acc": 0.03, "mag": 0.3}.items():
        count = errors[name].size
        assert errors[name].std() == pytest.approx(sd, rel=5.0 / math.sqrt(2.0 * count))  # 5 sd of a sample's sd
        assert abs(errors[name].mean()) < 5.0 * sd / math.sqrt(count)


def test_every_case_is_there_once_and_found_by_name_or_group():
    assert len({case.name for case in CASES}) == len(CASES) == 70
    assert (sum(not case.counted for case in CASES), sum(case.stamps for case in CASES)) == (1, 5)
    assert {case.group for case in CASES} | {"F9"} == set(GROUPS)
    assert len({case.name for case in SECOND}) == len(SECOND) >= 100
    assert {case.group for case in SECOND} == set(SECOND_GROUPS)
    unseen = [case for case in SECOND if case.unseen]
    assert 0 < len(unseen) <= 0.04 * len(SECOND)
    assert all(f"unseen: {case.unseen}" in listing(SECOND, SECOND_GROUPS) for case in unseen)
    for case in SECOND:  # every run goes on behind the fault
        assert case.length <= LONGEST
        assert case.length / 100.0 - case.judged_from >= 30.0, case.name
        assert math.isinf(case.end) or case.length / 100.0 - case.end >= 30.0, case.name
    chosen = choose(["gap_60s", "F6", "gap_60s"], CASES, GROUPS)
    assert [case.name for case in chosen] == ["gyro_bias_step_5dps", "gap_60s"]
    assert choose(["F9"], CASES, GROUPS) == []
    with pytest.raises(ParameterError, match="there is no case or group 'gap_9s'; groups are F1"):
        choose(["gap_9s"], CASES, GROUPS)


def test_outside_the_fault_the_stream_is_the_clean_one_and_inside_it_is_not():
    """The same noise too; a case of its own motion is compared with that motion. Half of the cases will do."""
    for case in [*CASES[::2], *SECOND[::2]]:
        damaged, clean = case.stream(), record(case.motion, case.length)
        last = math.inf if math.isinf(case.end) else round(100.0 * case.end)
        before = damaged.origin < round(100.0 * case.begin)
        outside = before | (damaged.origin >= last)
        for name in ("gyr", "acc", "mag"):
            assert np.array_equal(getattr(damaged, name)[outside], getattr(clean, name)[damaged.origin[outside]])
        assert np.array_equal(damaged.t[before], clean.t[damaged.origin[before]])
        usual = case.clean() if case in SECOND else record(USUAL, case.length)
        same = all(
            getattr(damaged, name).tobytes() == getattr(usual, name)[: case.length].tobytes()
            for name in ("t", "gyr", "acc", "mag", "has_mag", "origin")
        )
        assert same == (case.name == "start_clean")


def test_ends_of_ranges_are_clipped_and_flagged_as_a_decoder_would():
    saturated = rows_of("gyro_saturated_1s")
    clipped = [i for i, row in enumerate(saturated) if row[4] & flags.GYR_CLIPPED]
    assert set(range(3006, 3095)) <= set(clipped) <= set(range(3000, 3102))  # 2000 of 3000 °/s lie in the 50 ms rises
    assert all(row[1][0] == RANGES["gyr"] for row in saturated[3006:3095])
    shock = rows_of("acc_clip_shock_50ms")
    assert [i for i, row in enumerate(shock) if row[4]] == [3000, 3001, 3002, 3003, 3004]
    assert shock[3000][2][0] == RANGES["acc"]
    assert rows_of("huge1e30_gyr_1")[3000][4] == 0  # no code of a decoder
    assert np.abs(stream("mag_glitch_x100_1").mag[3000]).max() <= RANGES["mag"]


def test_disturbances_have_their_size_and_direction(clean):
    damaged = stream("acc_lin_5ms2_10s")
    extra = quat_rotate(damaged.truth[3000:4000], damaged.acc[3000:4000] - clean.acc[3000:4000])
    assert np.abs(extra - [5.0, 0.0, 0.0]).max() < 1e-12  # rounding of 10 m/s²
    damaged = stream("mag_parallel_gravity_5s")
    field = quat_rotate(damaged.truth[3000:3500], damaged.mag[3000:3500])
    assert field.mean(axis=0) == pytest.approx([0.0, 0.0, -np.linalg.norm(FIELD_N)], abs=5 * 0.3 / math.sqrt(500))
    assert np.abs(stream("freefall_noise_2s").acc[3000:3200]).max() < 6 * 0.03  # 600 normal numbers
    assert (stream("mag_hardiron_50uT_20s").mag - clean.mag[:9000])[3500] == pytest.approx([50.0, 0.0, 0.0])
    assert np.diff(stream("dt_negative_step_0p5s").t)[2999] == pytest.approx(-0.49)
    reversed_by, calm = change("sign_acc_5s_slow", "acc")
    assert reversed_by[3000:3500] == pytest.approx(-2.0 * calm[3000:3500])
    ramp = to_dps(change("ramp_5dps_30s_none", "gyr")[0])
    assert ramp[[2999, 4500, 6000, 11999], 1] == pytest.approx([0.0, 2.5, 5.0, 5.0])
    assert not stream("bias_1dps_no_mag_none").has_mag.any()
