"""The speed benchmark runs, with and without its peers; what it measures belongs to no test."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import pytest

from plumbob.filters import filter_names

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "speed.py"
FAST = ("--samples", "200", "--rounds", "1")


@pytest.fixture(scope="module")
def speed():
    spec = importlib.util.spec_from_file_location("speed", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def run(*words):
    done = subprocess.run([sys.executable, str(SCRIPT), *FAST, *words], capture_output=True, text=True, check=True)
    return done.stdout


@pytest.mark.long(reason="a process that loads every filter")
def test_it_prints_ratios_for_every_filter():
    result = json.loads(run("--json"))
    for table in ("batch", "stream"):
        ours = [row["name"] for row in result[table] if row["name"].startswith("plumbob ")]
        assert all(any(name in row for row in ours) for name in filter_names())
    peers = [row for row in result["batch"] if not row["name"].startswith("plumbob ")]
    assert peers or len(result["absent"]) == 3
    ours = [row["name"] for row in result["threads"] if row["name"].startswith("plumbob ")]
    assert ours == ["plumbob mahony.process", "plumbob mekf.process", "plumbob vqf.process"]
    assert all(row["best"] >= row["median"] > 0.0 for row in result["threads"])
    assert len(result["gates"]) == 4 + 4 * 3 + 3
    for row in result["gates"]:
        judged = row["target"] is not None and row["measured"] is not None
        assert (row["met"] is not None) is judged


def test_only_some_filters():
    text = run("--only", "mahony")
    assert "plumbob mahony.update + q_nb" in text
    assert "targets" in text
    assert "plumbob madgwick" not in text
    with pytest.raises(subprocess.CalledProcessError):
        run("--only", "mahoney")


def test_a_gate_compares_within_rounds(speed):
    """In the middle one of three rounds the machine was busy; each round's own ratio is 0.3, 0.5 and 0.4."""
    ours, theirs = "plumbob mekf (loop)", speed.VQF
    times = {"batch": {ours: [30.0, 500.0, 40.0], theirs: [100.0, 1000.0, 100.0]}, "stream": {}}
    assert speed.ratio_of(times["batch"], ours, theirs) == pytest.approx(0.4)
    assert speed.ratio_of(times["batch"], ours, "absent") is None
    found = {(row["name"], row["base"]): row for row in speed.gates(times, [])}
    first = found[ours, theirs]
    assert (first["target"], first["met"]) == (0.42, True)
    assert found["plumbob vqf (loop)", theirs]["met"] is None
    slow = {**times, "batch": {ours: [43.0], theirs: [100.0]}}
    assert next(speed.gates(slow, []))["met"] is False


def test_a_gain_must_be_at_least_so_large(speed):
    measured = ((speed.HASH, 1.9), ("a", 1.7), ("b", 1.5), (speed.VQF, 1.0))
    threads = [{"name": name, "median": gain} for name, gain in measured]
    found = list(speed.gates({"batch": {}, "stream": {}}, threads))[-2:]
    assert [(row["name"], row["met"]) for row in found] == [("a", True), ("b", False)]
