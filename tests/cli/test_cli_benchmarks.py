"""The benchmarks as a user meets them."""

import json

import pytest

from benchmarks.harness.__main__ import main
from benchmarks.harness.decoder_streams import HARMS, USER_FRAME
from benchmarks.harness.fault_cases import CASES
from benchmarks.harness.second_cases import CASES as SECOND
from plumbob import Frame, Recording, files, simulate
from tests.helpers.commandline import call, refused, typed

WORDS = "benchmark accuracy a.parquet --filters"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("accuracy")
    run = simulate("buoy", frame=Frame.ENU, sensors="ideal", unit="calibrated", seed=1, duration=10.0)
    files.write(folder / "a.parquet", Recording(imu=run.imu, track=run.truth, name="a"))
    return folder


def test_a_change_is_made_and_named_and_the_estimators_are_compared(folder):
    words = f"{WORDS} mekf,vqf --against mekf --bias 1dps --no-mag --align heading --calibrated"
    lines = typed(words, cwd=folder).stdout.splitlines()
    assert "changed     bias 1dps, no_mag, seed 1" in lines
    at = lines.index("Total RMSE of mekf, and what others have more [°]") + 1
    head, trial, _, better = lines[at : at + 4]
    assert head.split() == ["mekf", "vqf"]
    assert better.split() == ["better", "in", "1" if trial.split()[-1].startswith("-") else "0", "of", "1"]
    assert "there is no motion in it" in refused(*f"{WORDS} mahony --start 20s".split(), cwd=folder)


SMALL = ("--frames", "200", "--noise", "10000", "--fuzz", "5000")


def test_it_prints_a_table_or_json_of_formats_by_name_and_file(tmp_path):
    (tmp_path / "mine.toml").write_text(USER_FRAME)
    lines = call("decoders", "--formats", "rion,mpu6000", *SMALL, main=main).stdout.splitlines()
    rows = [line for line in lines if line.startswith("mpu6000")]
    assert [row.count("–") for row in rows] == [len(HARMS) - 1, 3]
    done = call("decoders", "--formats", tmp_path / "mine.toml", *SMALL, "--json", main=main)
    result = json.loads(done.stdout)
    mine = result["formats"]["user_crc16"]
    assert result["met"] and set(mine["harms"]) == set(HARMS) and mine["noise"]["size"] == 10_000
    assert mine["fuzzed"]["pending"] <= mine["fuzzed"]["bound"]


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
