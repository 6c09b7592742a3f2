"""The room's own parts: outcomes, bars, verdicts, items, and what `reproduce` refuses."""

import copy
import json
import math
import re
from pathlib import Path

import pytest

import plumbob
from plumbob.core.errors import ParameterError
from plumbob.papers.outcome import Outcome, at_least, at_most, restored, table
from plumbob.papers.reproduce import NAMES, TITLES, items, reproduce
from plumbob.reporting import Report
from plumbob.reporting.style import Both, said
from website.papers import README, items_lines, keys_of, readme

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "papers.md"
WHAT = Both("error", "误差")


def outcome(**how):
    return Outcome(**{"key": "a", "where": "Fig 8", "what": WHAT, "unit": "°", "paper": 9.6, "faithful": 3.0} | how)


@pytest.mark.parametrize(
    ("how", "verdict"),
    [
        ({}, "shown"),
        ({"faithful_bar": at_most(3.0)}, "pass"),
        ({"faithful_bar": at_most(2.9)}, "missed"),
        ({"faithful_bar": at_most(2.9), "reason": Both("noise", "噪声")}, "missed: noise"),
        ({"faithful": math.nan, "faithful_bar": at_most(3.0)}, "missed"),
        ({"best": 0.5, "best_bar": at_least(1.0)}, "missed"),
        ({"best": 0.5, "best_bar": (0.4, 0.6)}, "pass"),
        ({"reproducible": False, "reason": Both("it is bounded", "有界")}, "not reproducible: it is bounded"),
    ],
)
def test_a_verdict_follows_from_the_bars(how, verdict):
    assert outcome(**how).verdict == verdict


@pytest.mark.parametrize(
    "how", [{"faithful": None}, {"best_bar": at_most(1.0)}, {"reproducible": False}], ids=["value", "bar", "reason"]
)
def test_an_outcome_that_says_nothing_is_refused(how):
    with pytest.raises(ParameterError):
        outcome(**how)


def test_an_outcome_reaches_another_process_whole():
    one = outcome(best=0.5, best_bar=at_most(1.0), reason=Both("noise", "噪声"))
    again = restored(json.loads(json.dumps(one.stored())))
    assert again == one
    assert again.what.zh == "误差"
    assert again.reason.zh == "噪声"


def test_a_text_in_both_languages_is_read_in_each():
    both = copy.deepcopy(Both("error", "误差"))
    assert both == "error"
    assert said(both, "en") == "error"
    assert said(both, "zh") == "误差"
    assert said(str(both), "zh") == "误差"  # a plot's label goes through str
    page = Report(both, facts=[(both, both)], remarks=[both], tables=[table([outcome()])]).page(lang="zh")
    assert "error" not in page.partition("</style>")[2]
    assert page.count("误差") == 6  # title twice, name and value, remark, row of the table


def test_a_table_shows_values_with_their_bars():
    (row,) = table([outcome(best=0.5, best_bar=at_most(1.0), faithful=0.012345)]).rows
    assert row == ["Fig 8", "error", "°", "9.60", "0.0123", "0.500 (≤ 1)", "pass"]


def test_what_cannot_be_run_is_refused(tmp_path):
    with pytest.raises(ParameterError, match="'fish' is not a paper; known are fin, buoy, trackball, arm, rod, or all"):
        reproduce("fish")
    with pytest.raises(ParameterError, match="jobs must be at least 1"):
        reproduce("fin", jobs=0, out=tmp_path)
    with pytest.raises(ParameterError, match="seed must be a whole number"):
        reproduce("fin", seed=-1, out=tmp_path)
    (tmp_path / "own.txt").write_text("mine")
    with pytest.raises(ParameterError, match="is not empty"):
        reproduce("fin", out=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["own.txt"]


def test_it_is_the_same_function_by_every_name():
    assert plumbob.reproduce is reproduce
    assert set(TITLES) == set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_every_item_is_done_or_has_its_reason(name):
    """The files that an item names exist, and the outcomes are on the page of the papers."""
    known = keys_of(PAGE.read_text(encoding="utf-8"), name)
    for item in items(name):
        assert item.where
        assert item.by or item.reason, item
        assert set(re.findall(r"\[([\w.-]+)\]", item.by)) <= known, item
        for path in re.findall(r"`((?:src|tests|benchmarks|examples|website|docs)/[^\s`]*)`", item.by):
            assert (ROOT / path).exists(), (item.what, path)


@pytest.mark.parametrize("name", NAMES)
def test_the_page_of_the_papers_has_every_item(name):
    """Otherwise: make papers."""
    assert "\n".join(items_lines(name)) in PAGE.read_text(encoding="utf-8")


def test_the_table_of_the_readme_has_figures_of_the_page_of_the_papers():
    """Otherwise: make papers."""
    text = README.read_text(encoding="utf-8")
    assert readme(text, PAGE.read_text(encoding="utf-8")) == text
    assert text.count("\n| rod | ") == 2
