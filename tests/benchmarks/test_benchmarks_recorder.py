"""The recorder's benchmarks run, and what they count is right on a small scale."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).parents[2] / "benchmarks"


def run(script, *words):
    done = subprocess.run(
        [sys.executable, str(SCRIPTS / script), *words, "--json"], capture_output=True, text=True, check=False
    )
    return done.returncode, json.loads(done.stdout)


def test_cost(tmp_path):
    _, found = run(
        "recorder_cost.py", "--seconds", "0.5", "--folder", str(tmp_path)
    )  # a busy machine may miss the limit
    assert found["rows"] == 600  # 0.5 s of 1000 + 200 rows a second
    assert found["whole"]
    assert found["core_percent"] < 100.0


def test_kill(tmp_path):
    _, found = run("recorder_kill.py", "--kills", "2", "--folder", str(tmp_path))
    assert (found["acknowledged_lost"], found["wrong_rows"], found["repaired"]) == (0, 0, 2)


@pytest.mark.long("starts the command line four times")
def test_restart(tmp_path):
    code, found = run("recorder_restart.py", "--seconds", "12", "--kills", "3", "--folder", str(tmp_path))
    assert (found["starts"], found["acknowledged_lost"], found["frames_twice_or_back"]) == (4, 0, 0)
    assert found["rows_acknowledged"] > 0
    assert (code, found["met"]) == (0, True)


def test_damage():
    code, found = run("recorder_damage.py", "--flips", "40", "--others", "10")
    assert code == 0
    assert found["met"]
    assert found["flips, plumbob"]["files"] == 40
    assert found["flips, mcap library"]["lost_mean"] > found["flips, plumbob"]["lost_mean"]
