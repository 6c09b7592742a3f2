"""All five papers as a user runs them: every bar, and the figures of docs/papers.md."""

import json
import math
import re
import subprocess
import sys
from pathlib import Path

import pytest

from plumbob.papers.description import PAPERS
from plumbob.papers.reproduce import NAMES
from tests.helpers.papers import named
from website.papers import page

pytestmark = pytest.mark.long("some minutes; the parts of each paper are tested with few seeds")

PAGE = Path(__file__).parents[2] / "docs" / "papers.md"
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?")
SAME = 0.05
"""Relative difference that another processor may make of a figure, beside what rounding to three digits does."""
NOTHING = 1e-4
"""Smaller figures are rounding errors of one processor."""


def reproduced(folder, *words):
    """Papers that `plumbob reproduce` prints."""
    command = [sys.executable, "-m", "plumbob", "reproduce", *words, "--out", str(folder), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)["papers"]


def test_all_papers_as_a_user_runs_them(tmp_path):
    """One run for all of it: it takes minutes, and workers do not share what one of them made."""
    folder = tmp_path / "all"
    papers = reproduced(folder, "all")
    every_miss_is_told(papers)
    figures_are_those_of_the_page(papers)
    every_paper_has_its_page(papers, folder)


def every_miss_is_told(papers):
    """Every bar is met, or docs/papers.md says that it is missed."""
    told = PAGE.read_text(encoding="utf-8")
    for name in NAMES:
        keys = [one["key"] for one in papers[name]]
        assert len(set(keys)) == len(keys)
        assert named(PAPERS[name].items) <= set(keys), name
        missed = {one["key"] for one in papers[name] if not one["met"]}
        assert all(one["reason"] for one in papers[name] if not one["met"])
        own = told.partition(f"\n## {name}\n")[2].partition("\n## ")[0]
        assert missed == set(re.findall(r"^\| `([\w.-]+)` \|.*\| missed[^|]*\|[^|]*\|$", own, re.MULTILINE)), name


def figures_are_those_of_the_page(papers):
    """Otherwise: make papers."""
    made, told = page(papers).splitlines(), PAGE.read_text(encoding="utf-8").splitlines()
    assert len(made) == len(told)
    for ours, theirs in zip(made, told, strict=True):
        assert NUMBER.sub("#", ours) == NUMBER.sub("#", theirs)
        for a, b in zip(NUMBER.findall(ours), NUMBER.findall(theirs), strict=True):
            assert math.isclose(float(a), float(b), rel_tol=SAME, abs_tol=NOTHING), (ours, theirs)


def every_paper_has_its_page(papers, folder):
    index = (folder / "index.html").read_text(encoding="utf-8")
    for name in NAMES:
        text = (folder / f"{name}.html").read_text(encoding="utf-8")
        assert text.count("<figure>") >= 2
        assert f"href='{name}.html'" in index
        assert any((folder / name).glob("*.mcap"))
        assert papers[name]
    assert "track on its sphere" in (folder / "trackball.html").read_text(encoding="utf-8")
    assert (folder / "buoy" / "sea.mcap").is_file()
    programs = {f"program.{end}" for end in ("csv", "yaml", "mcap", "urdf", "script")}
    assert {path.name for path in (folder / "arm").glob("program.*")} == programs


@pytest.mark.parametrize("name", ["trackball", "buoy"])
def test_every_bar_is_met_with_another_seed(tmp_path, name):
    found = reproduced(tmp_path / "other", name, "--seed", "2")
    assert [one["key"] for one in found[name] if not one["met"]] == []
