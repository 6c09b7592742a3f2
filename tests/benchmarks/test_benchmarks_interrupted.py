"""Verbs that are killed while they write, in a short form; `make wire` has all verbs and twenty trials of each kind."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "interrupted.py"


@pytest.mark.long("nine seconds: writes a minute of sea in every form, and forks a process for every trial")
def test_no_file_is_torn_and_no_old_one_lost():
    words = ["--trials", "4", "--verbs", "convert .tum,convert .mcap,emulate,repair", "--json"]
    done = subprocess.run([sys.executable, SCRIPT, *words], capture_output=True, text=True, check=False)
    found = json.loads(done.stdout)
    assert [one["wrong"] for one in found["verbs"].values()] == [[]] * 4
    assert (done.returncode, found["met"]) == (0, True)
    assert all(sum(one["stopped"].values()) > 0 for one in found["verbs"].values())  # it was the work that was met
