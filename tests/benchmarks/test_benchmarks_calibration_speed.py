"""The benchmark of calibrations runs, with and without its peer; what it measures belongs to no test."""

import json
import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "calibration_speed.py"


def run(*words):
    command = [sys.executable, str(SCRIPT), "--samples", "3000", "--rounds", "2", *words]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_it_tells_seconds_errors_and_the_ratio():
    result = json.loads(run("--json"))
    assert min(result["seconds"].values()) > 0.0
    assert result["error_deg"]["whole"] < 1.0
    assert bool(result["ratio"]) == ("magcal" in result["seconds"])


def test_its_text():
    assert "magnetometer fit of 3000 samples" in run()
