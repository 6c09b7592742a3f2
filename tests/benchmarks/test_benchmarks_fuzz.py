"""Mutated files of every format end with 0, 1 or 3, in bounded time and memory; `make fuzz` makes 5000 of each."""

import json
import subprocess
import sys
from pathlib import Path
from random import Random

import pytest

SCRIPTS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture
def scripts(monkeypatch):
    monkeypatch.syspath_prepend(str(SCRIPTS))


def test_a_case_is_made_again_from_its_seed(scripts):
    """Of 100 cases every one is as it was, and most differ from what they were made of."""
    from fuzz_mutations import mutated

    whole = b'name = "a"\nvalue = [1, 2.5]\n' * 20
    cases = [[mutated(Random(f"1 {case}"), whole, [whole], text=case % 2 == 0) for case in range(100)] for _ in "ab"]
    assert cases[0] == cases[1]
    assert sum(case == whole for case in cases[0]) < 10
    assert max(map(len, cases[0])) <= 1 << 20


@pytest.mark.parametrize(
    ("change", "good"),
    [
        ({}, True),
        ({"code": 3}, True),
        ({"code": 70}, False),
        ({"code": 2}, False),
        ({"traceback": True}, False),
        ({"seconds": 11.0}, False),
        ({"mebibytes": 301}, False),
    ],
)
def test_what_is_a_bad_end(scripts, change, good):
    from fuzz import Tally

    tally = Tally("a")
    assert tally.take({"code": 0, "seconds": 0.1, "mebibytes": 20, "traceback": False} | change) == good
    assert tally.row()["bad"] == (not good)
    assert tally.row()["cases"] == 1


@pytest.mark.long(reason="40 formats of 60 files each, in a process each: three minutes")
def test_some_files_of_every_format(tmp_path):
    words = [sys.executable, str(SCRIPTS / "fuzz.py"), "--json", "--cases", "60", "--out", str(tmp_path)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = json.loads(done.stdout)
    assert all(row["cases"] == 60 for row in rows)
    assert all(row["0"] < 60 or row["format"].startswith("raw") for row in rows)  # damage is met
