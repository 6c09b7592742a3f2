"""Each benchmark runs at its smallest, and its judge can fail; what it measures belongs to no test."""

import json
import math
import re
import sys
from importlib import import_module
from random import Random

import pytest

from plumbob import filter_names, flags
from tests.helpers import beside
from tests.helpers.commandline import call, start, table_of


def ended(name, *words):
    """A benchmark that ran in this process."""

    def main(arguments):
        before, sys.argv = sys.argv, [name, *arguments]
        try:
            return import_module(f"benchmarks.{name}").main()
        finally:
            sys.argv = before

    return call(*words, main=main)


def run(name, *words, alone=False):
    """Exit code and JSON of a benchmark; one that forks or measures memory runs in a process of its own."""
    program = {"program": (sys.executable, "-m", f"benchmarks.{name}")}
    done = start(*words, "--json", **program) if alone else ended(name, *words, "--json")
    return done.returncode, json.loads(done.stdout) if done.stdout else done.stderr


@pytest.mark.parametrize(("words", "says"), [
    pytest.param(words, says, marks=[pytest.mark.long(reason)] if reason else [], id=words.split()[0])
    for words, says, reason in table_of(beside(__file__, "smallest.txt"))
])  # fmt: skip
def test_the_smallest_run_ends_and_says_what_is_known(words, says):
    done = ended(*words.split())
    assert done.returncode in {0, 1}  # so short a run may miss a bar
    assert re.search(says, done.stdout), done.stdout + done.stderr


def test_arrangements_of_axes_and_faults_to_plant():
    axes = import_module("benchmarks.axes")
    (_, capture), ways = next(axes.simulated()), axes.every_axes()
    assert [axes.verdict(capture, "mag", way, "auto") for way in (ways[0], ways[7], ways[30])] == ["right"] * 3
    planted = start("--list", "--scale", "0.05", program=(sys.executable, "benchmarks/mutants"))
    assert len(re.findall(r"^\S+\.py:\d+ .* -> ", planted.stdout, re.MULTILINE)) > 10, planted.stderr


def test_a_serial_line_loses_nothing_and_calibrations_run():
    code, found = run("acquire_latency", "--seconds", "0.3")
    assert (code, found["frames"], found["lost"], found["events"]) == (0, 300, 0, 0)
    assert 0.0 < found["p50_ms"] <= found["p99_ms"] <= found["worst_ms"]
    assert found["reads_per_s"] > 0.0
    _, result = run("calibration_speed", "--samples", "3000", "--rounds", "1")
    assert min(result["seconds"].values()) > 0.0 and result["error_deg"]["whole"] < 1.0
    assert bool(result["ratio"]) == ("magcal" in result["seconds"])


@pytest.mark.long(reason="starts seven processes")
def test_allan_deviations():
    small = ("--samples", "2000,3000", "--every", "1000", "--alone", "1000", "--rows", "50000", "--rounds", "1")
    _, result = run("allan_speed", *small)
    assert len(result["versus"]) == (0 if result["absent"] else 3)
    for row in result["versus"]:
        assert row["met"] == (row["ratio"] >= float(row["bar"].split()[1]))
    file = result["file"]
    assert file["met"] == (max(file["megabytes"], file["megabytes_whole"]) <= 300.0)
    assert file["megabytes"] > 10.0
    assert min(file["times_reading"], file["wall"], result["alone"][0]["ours"]) > 0.0


def test_a_ratio_of_allan_deviations_is_taken_within_a_round(monkeypatch):
    """In the second of three rounds the machine was busy; each round's own ratio is 20, 10 and 15."""
    times = iter([1.0, 20.0, 100.0, 1000.0, 1.0, 15.0])
    monkeypatch.setattr("benchmarks.allan_speed.cpu", lambda call: next(times))
    row = import_module("benchmarks.allan_speed").versus("", lambda: None, lambda: None, 16.0, 3)
    assert row["ratio"] == pytest.approx(15.0)
    assert row["met"] is False


@pytest.mark.parametrize(
    "filters", ["mekf", pytest.param(",".join(filter_names()), marks=pytest.mark.long(reason="half a minute"))]
)
def test_filters_endure_a_few_blocks(filters):
    code, found = run("endurance", "--samples", "5e3", "--block", "1000", "--filters", filters)
    assert code == 0
    assert [one["name"] for one in found] == filters.split(",")
    for one in found:
        assert (one["samples"], one["finite"], one["met"]) == (5000, True, True)
        assert one["at_block_ends"] <= one["largest"] < 1e-12
        assert one["bias_dps"] >= 0.0


def test_blocks_of_endurance_have_no_gap_and_a_broken_limit_is_told():
    endurance = import_module("benchmarks.endurance")
    assert not (endurance.block(0, 500).flags & flags.GAP).any()
    good = {"name": "x", "samples": 1, "ns": 1.0, "at_block_ends": 0.0, "largest": 1e-13, "bias_dps": 0.0}
    assert endurance.Endured(**good, finite=True).met and not endurance.Endured(**good, finite=False).met
    assert not endurance.Endured(**good | {"largest": 1e-12}, finite=True).met


def test_a_case_of_damage_is_made_again_from_its_seed():
    """Of 100 cases every one is as it was, and most differ from what they were made of."""
    mutated = import_module("benchmarks.fuzz_mutations").mutated
    file = b'name = "a"\nvalue = [1, 2.5]\n' * 20
    cases = [[mutated(Random(f"1 {case}"), file, [file], text=case % 2 == 0) for case in range(100)] for _ in "ab"]
    assert cases[0] == cases[1]
    assert sum(case == file for case in cases[0]) < 10
    assert max(map(len, cases[0])) <= 1 << 20


@pytest.mark.parametrize(("change", "good"), [
    ({}, True),
    ({"code": 3}, True),
    ({"code": 70}, False),
    ({"code": 2}, False),
    ({"traceback": True}, False),
    ({"seconds": 11.0}, False),
    ({"mebibytes": 301}, False),
])  # fmt: skip
def test_what_is_a_bad_end_of_a_damaged_file(change, good):
    tally = import_module("benchmarks.fuzz").Tally("a")
    assert tally.take({"code": 0, "seconds": 0.1, "mebibytes": 20, "traceback": False} | change) == good
    assert (tally.row()["bad"], tally.row()["cases"]) == (not good, 1)


@pytest.mark.long(reason="40 formats of 60 files each, in a process each: three minutes")
def test_some_damaged_files_of_every_format(tmp_path):
    code, rows = run("fuzz", "--cases", "60", "--out", tmp_path, alone=True)
    assert code == 0, rows
    assert all(row["cases"] == 60 for row in rows)
    assert all(row["0"] < 60 or row["format"].startswith("raw") for row in rows)  # damage is met


@pytest.mark.long("nine seconds: writes a minute of sea in every form, and forks a process for every trial")
def test_no_file_is_torn_and_no_old_one_lost():
    verbs = "convert .tum,convert .mcap,emulate,repair"
    code, found = run("interrupted", "--trials", "4", "--verbs", verbs, alone=True)
    assert [one["wrong"] for one in found["verbs"].values()] == [[]] * 4
    assert (code, found["met"]) == (0, True)
    assert all(sum(one["stopped"].values()) > 0 for one in found["verbs"].values())  # it was the work that was met


def test_a_recorder_costs_is_killed_and_damaged(tmp_path):
    _, cost = run("recorder_cost", "--seconds", "0.5", "--folder", tmp_path)  # a busy machine may miss the limit
    assert (cost["rows"], cost["whole"]) == (600, True)  # 0.5 s of 1000 + 200 rows a second
    _, kill = run("recorder_kill", "--kills", "2", "--folder", tmp_path)
    assert (kill["acknowledged_lost"], kill["wrong_rows"], kill["repaired"]) == (0, 0, 2)
    code, damage = run("recorder_damage", "--flips", "20", "--others", "5")
    assert (code, damage["met"], damage["flips, plumbob"]["files"]) == (0, True, 20)
    assert damage["flips, mcap library"]["lost_mean"] > damage["flips, plumbob"]["lost_mean"]


@pytest.mark.long("starts the command line four times")
def test_a_recorder_starts_again(tmp_path):
    code, found = run("recorder_restart", "--seconds", "12", "--kills", "3", "--folder", tmp_path)
    assert (found["starts"], found["acknowledged_lost"], found["frames_twice_or_back"]) == (4, 0, 0)
    assert found["rows_acknowledged"] > 0
    assert (code, found["met"]) == (0, True)


@pytest.mark.parametrize(
    "only", [("mahony",), pytest.param((), marks=pytest.mark.long(reason="a process that loads every filter"))]
)
def test_speeds_have_a_row_for_every_filter_and_a_verdict_for_every_gate(only):
    _, result = run("speed", "--samples", "200", "--rounds", "1", *(("--only", *only) if only else ()))
    for table in ("batch", "stream"):
        ours = [row["name"] for row in result[table] if row["name"].startswith("plumbob ")]
        assert {name for name in filter_names() if any(f"plumbob {name}" in row for row in ours)} == set(
            only or filter_names()
        )
    assert all(row["best"] >= row["median"] > 0.0 for row in result["threads"])
    assert len(result["gates"]) == 4 + 4 * 3 + (len(only) or 3)
    for row in result["gates"]:
        judged = row["target"] is not None and row["measured"] is not None
        assert (row["met"] is not None) is judged


def test_a_gate_of_speeds_compares_within_rounds():
    """In the middle one of three rounds the machine was busy; each round's own ratio is 0.3, 0.5 and 0.4."""
    speed = import_module("benchmarks.speed")
    ours, theirs = "plumbob mekf (loop)", speed.VQF
    times = {"batch": {ours: [30.0, 500.0, 40.0], theirs: [100.0, 1000.0, 100.0]}, "stream": {}}
    assert speed.ratio_of(times["batch"], ours, "absent") is None
    gates = {(row["name"], row["base"]): row for row in speed.gates(times, [])}
    assert gates[ours, theirs]["measured"] == pytest.approx(0.4)
    assert (gates[ours, theirs]["target"], gates[ours, theirs]["met"]) == (0.42, True)
    assert gates["plumbob vqf (loop)", theirs]["met"] is None
    slow = {**times, "batch": {ours: [43.0], theirs: [100.0]}}
    assert next(speed.gates(slow, []))["met"] is False
    measured = ((speed.HASH, 1.9), ("a", 1.7), ("b", 1.5), (speed.VQF, 1.0))
    threads = [{"name": name, "median": gain} for name, gain in measured]
    gains = list(speed.gates({"batch": {}, "stream": {}}, threads))[-2:]
    assert [(row["name"], row["met"]) for row in gains] == [("a", True), ("b", False)]
    assert math.isfinite(gains[0]["measured"])
