"""The speed benchmark runs, with and without its peers; what it measures belongs to no test."""

import json
import subprocess
import sys
from pathlib import Path

from plumbob.filters import filter_names

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "speed.py"


def test_it_prints_ratios_for_every_filter():
    words = [sys.executable, str(SCRIPT), "--samples", "200", "--rounds", "1", "--json"]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    result = json.loads(done.stdout)
    for table in ("batch", "stream"):
        ours = [row["name"] for row in result[table] if row["name"].startswith("plumbob ")]
        assert all(any(name in row for row in ours) for name in filter_names())
    peers = [row for row in result["batch"] if not row["name"].startswith("plumbob ")]
    assert peers or len(result["absent"]) == 3
