"""Mutated files of every format end with 0, 1 or 3, in bounded time and memory; `make fuzz` makes 5000 of each."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "fuzz.py"


def fuzz(*words):
    words = [sys.executable, str(SCRIPT), "--json", *words]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stderr
    return json.loads(done.stdout)


def test_a_few_files_of_a_format(tmp_path):
    (row,) = fuzz("--only", "parquet", "--cases", "30", "--out", str(tmp_path))
    assert (row["format"], row["cases"], row["bad"]) == ("parquet", 30, 0)
    assert row["1"] > 0  # what is wrong is refused
    assert not any(tmp_path.iterdir())


@pytest.mark.long(reason="40 formats of 60 files each, in a process each: two minutes")
def test_some_files_of_every_format(tmp_path):
    bad = [row for row in fuzz("--cases", "60", "--out", str(tmp_path)) if row["bad"]]
    assert not bad
