"""The benchmark of Allan deviations runs, with and without its peer; what it measures belongs to no test."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "allan_speed.py"
SMALL = ("--samples", "2000,3000", "--every", "1000", "--alone", "1000", "--rows", "50000", "--rounds", "1")


def load():
    spec = importlib.util.spec_from_file_location("allan_speed", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def result():
    words = [sys.executable, str(SCRIPT), *SMALL, "--json"]
    return json.loads(subprocess.run(words, capture_output=True, text=True, check=True).stdout)


@pytest.mark.long(reason="starts seven processes")
def test_it_tells_ratios_memory_and_whether_the_bars_are_met(result):
    assert len(result["versus"]) == (0 if result["absent"] else 3)
    for row in result["versus"]:
        assert row["met"] == (row["ratio"] >= float(row["bar"].split()[1]))
    file = result["file"]
    assert file["what"].endswith("n of a file of 50000 float32")
    assert file["met"] == (max(file["megabytes"], file["megabytes_whole"]) <= 300.0)
    assert file["megabytes"] > 10.0
    assert min(file["times_reading"], file["wall"], result["alone"][0]["ours"]) > 0.0


@pytest.mark.long(reason="starts seven processes")
def test_its_table(result, capsys):
    load().show(result)
    text = capsys.readouterr().out
    assert "every n of 1000 samples" in text
    assert "times as long" in text


def test_a_ratio_is_taken_within_a_round(monkeypatch):
    """In the second of three rounds the machine was busy; each round's own ratio is 20, 10 and 15."""
    module = load()
    times = iter([1.0, 20.0, 100.0, 1000.0, 1.0, 15.0])
    monkeypatch.setattr(module, "cpu", lambda call: next(times))
    row = module.versus("", lambda: None, lambda: None, 16.0, 3)
    assert row["ratio"] == pytest.approx(15.0)
    assert row["met"] is False
