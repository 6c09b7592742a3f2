"""The benchmark of a serial line runs; what it measures belongs to no test, but nothing may be lost."""

import json
import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "acquire_latency.py"


def test_it_loses_nothing_and_prints_its_figures():
    words = [sys.executable, str(SCRIPT), "--seconds", "0.3", "--json"]
    found = json.loads(subprocess.run(words, capture_output=True, text=True, check=True, timeout=60).stdout)
    assert (found["frames"], found["lost"], found["events"]) == (300, 0, 0)
    assert 0.0 < found["p50_ms"] <= found["p99_ms"] <= found["worst_ms"]
    assert found["reads_per_s"] > 0.0
