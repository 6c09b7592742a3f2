"""The benchmark of faults as a user meets it."""

import json

from benchmarks.harness.__main__ import main
from benchmarks.harness.fault_cases import CASES
from benchmarks.harness.second_cases import CASES as SECOND
from tests.helpers.commandline import call


def faults(words):
    return call("faults", *words.split(), main=main)


def test_json_and_lists_of_both_batteries():
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
    first, second = faults("--list").stdout, faults("--battery second --list").stdout
    assert all(case.name in first and case.what in first for case in CASES)
    assert all(case.name in second and case.what in second and case.unseen in second for case in SECOND)
