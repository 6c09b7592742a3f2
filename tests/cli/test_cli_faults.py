"""The benchmark of faults as a user meets it."""

import json

import pytest

from benchmarks.harness.__main__ import main
from benchmarks.harness.fault_cases import CASES
from benchmarks.harness.second_cases import CASES as SECOND


def run(capsys, *words):
    """Exit code, standard output and standard error."""
    code = main(["faults", *words])
    return code, *capsys.readouterr()


def test_json_has_every_key(capsys):
    code, out, _ = run(capsys, "--filters", "mahony,integrate", "--cases", "nan_acc_1,dt_nan_1,F9", "--json")
    result = json.loads(out)
    assert code == 0
    assert set(result) == {"settings", "clean_rms_deg", "score", "cases", "arguments", "absent"}
    assert set(result["cases"]) == {"nan_acc_1", "dt_nan_1"}
    case = result["cases"]["dt_nan_1"]
    assert set(case) == {"group", "what", "results"}
    assert set(case["results"]) == set(result["settings"]) == set(result["arguments"]) == {"mahony", "integrate"}
    keys = {"verdict", "peak_deg", "recover_s", "end_deg", "flagged", "flags", "errors"}
    assert set(case["results"]["mahony"]) == keys
    assert case["results"]["mahony"]["verdict"] == "clear error"
    counts = {"ok", "clear error", "flagged, recovers", "recovers, silent", "wrong", "NaN for ever"}
    assert set(result["score"]["integrate"]) == {"cases", "pass_percent", "strict_percent"} | counts
    assert result["arguments"]["mahony"]["sample: float32"] == "accepted"


def test_list_needs_no_filter(capsys):
    code, out, _ = run(capsys, "--list")
    assert code == 0
    assert all(case.name in out and case.what in out for case in CASES)
    code, out, _ = run(capsys, "--battery", "second", "--list")
    assert code == 0
    assert all(case.name in out and case.what in out and case.unseen in out for case in SECOND)


def test_json_of_the_second_battery_has_every_key(capsys):
    words = ("--battery", "second", "--filters", "mekf,integrate", "--cases", "field_east_1s_none,S3", "--json")
    code, out, _ = run(capsys, *words)
    result = json.loads(out)
    assert code == 0
    assert set(result) == {"settings", "score", "cases", "absent"}
    assert len(result["cases"]) == 10
    case = result["cases"]["field_east_1s_none"]
    assert set(case) == {"group", "what", "unseen", "results"}
    assert set(case["results"]) == {"mekf", "integrate"}
    keys = {"by_flags", "by_flags_or_claims", "peak_deg", "end_deg", "off_s", "silent_by_flags_s", "silent_s"}
    assert set(case["results"]["mekf"]) == keys | {"error_in_sd"}
    assert case["results"]["integrate"]["error_in_sd"] is None
    score = result["score"]["mekf"]
    assert set(score) == {"cases", "by_flags", "by_flags_or_claims", "bars"}
    assert sum(score["by_flags"].values()) == sum(score["by_flags_or_claims"].values()) == score["cases"] == 10
    assert [len(result["score"][name]["bars"]) for name in ("mekf", "integrate")] == [4, 3]  # the last is of claims


def test_tables(capsys):
    first = ("--filters", "mahony", "--params", "kp=0.7", "--cases", "F6,dt_nan_1")
    second = ("--battery", "second", "--filters", "integrate", "--cases", "turn_1dps_60s,turn_1dps_60s_no_mag")
    for words, names in (
        (first, ["gyro_bias_step_5dps", "dt_nan_1"]),
        (second, ["turn_1dps_60s", "turn_1dps_60s_no_mag?"]),
    ):
        code, out, _ = run(capsys, *words)
        assert (code, [line.split()[0] for line in out.splitlines()[:3]]) == (0, ["fault", *names])


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["--filters", "mahony", "--cases", "nan_gps_1"], "there is no case or group 'nan_gps_1'"),
        (["--filters", "mahony", "--battery", "second", "--cases", "F1"], "there is no case or group 'F1'"),
        ([], "--filters is missing"),
    ],
)
def test_what_is_unknown_is_one_clear_line(capsys, words, line):
    code, out, err = run(capsys, *words)
    assert (code, out) == (1, "")
    assert line in err.splitlines()[-1]
