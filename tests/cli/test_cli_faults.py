"""The benchmark of faults as a user meets it."""

import json

import pytest

from benchmarks.harness.__main__ import main
from benchmarks.harness.fault_cases import CASES
from benchmarks.harness.second_cases import CASES as SECOND
from tests.helpers.commandline import call


def faults(words):
    return call("faults", *words.split(), main=main)


def test_json_of_both_batteries():
    first = json.loads(faults("--filters mahony,integrate --cases nan_acc_1,dt_nan_1,F9 --json").stdout)
    assert set(first["cases"]) == {"nan_acc_1", "dt_nan_1"}
    results = first["cases"]["dt_nan_1"]["results"]
    assert set(results) == set(first["settings"]) == set(first["arguments"]) == {"mahony", "integrate"}
    assert results["mahony"]["verdict"] == "clear error"
    assert first["arguments"]["mahony"]["sample: float32"] == "accepted"
    words = "--battery second --filters mekf,integrate --cases field_east_1s_none,S3 --json"
    second = json.loads(faults(words).stdout)
    assert len(second["cases"]) == 10
    results = second["cases"]["field_east_1s_none"]["results"]
    assert [results[name]["error_in_sd"] is None for name in ("mekf", "integrate")] == [False, True]
    score = second["score"]["mekf"]
    assert sum(score["by_flags"].values()) == sum(score["by_flags_or_claims"].values()) == score["cases"] == 10
    assert [len(second["score"][name]["bars"]) for name in ("mekf", "integrate")] == [4, 3]  # the last is of claims


def test_list_needs_no_filter():
    first, second = faults("--list").stdout, faults("--battery second --list").stdout
    assert all(case.name in first and case.what in first for case in CASES)
    assert all(case.name in second and case.what in second and case.unseen in second for case in SECOND)


def test_tables():
    first = "--filters mahony --params kp=0.7 --cases F6,dt_nan_1"
    second = "--battery second --filters integrate --cases turn_1dps_60s,turn_1dps_60s_no_mag"
    for words, names in (
        (first, ["gyro_bias_step_5dps", "dt_nan_1"]),
        (second, ["turn_1dps_60s", "turn_1dps_60s_no_mag?"]),
    ):
        done = faults(words)
        assert (done.returncode, [line.split()[0] for line in done.stdout.splitlines()[:3]]) == (0, ["fault", *names])


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("--filters mahony --cases nan_gps_1", "there is no case or group 'nan_gps_1'"),
        ("--filters mahony --battery second --cases F1", "there is no case or group 'F1'"),
        ("", "--filters is missing"),
    ],
)
def test_what_is_unknown_is_one_clear_line(words, line):
    done = faults(words)
    assert (done.returncode, done.stdout, line in done.stderr.splitlines()[-1]) == (1, "", True)
