"""The room's own parts: outcomes, bars, verdicts, items, and what `reproduce` refuses."""

import copy
import math
import os
import re
import signal
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

import plumbob
from plumbob.core.errors import DecodeError, MissingExtraError, ParameterError, PlumbobError
from plumbob.papers.description import PAPERS, Outcome, table
from plumbob.papers.reproduce import NAMES, claims, reproduce
from plumbob.papers.studies import Study
from plumbob.reporting.content import Both, said
from plumbob.reporting.report import Report
from website.papers import README, items_lines, keys_of, readme

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "papers.md"
WHAT = Both("error", "误差")


def outcome(**how):
    return Outcome(**{"key": "a", "where": "Fig 8", "what": WHAT, "unit": "°", "paper": 9.6, "faithful": 3.0} | how)


@pytest.mark.parametrize(("how", "reached", "kept"), [
    ({"faithful": 10.0}, "no", "none"),
    ({"faithful_bar": (-math.inf, 3.0)}, "yes", "kept"),
    ({"faithful_bar": (-math.inf, 2.9)}, "yes", "missed"),
    ({"reach": ">="}, "no", "none"),
    ({"reach": 6.6}, "yes", "none"),
    ({"reach": 6.5}, "no", "none"),
    ({"paper": "grows"}, "not stated", "none"),
    ({"faithful": None, "best": 1.0}, "not stated", "none"),
    ({"faithful": math.nan, "faithful_bar": (-math.inf, 3.0)}, "no", "missed"),
    ({"best": 0.5, "best_bar": (1.0, math.inf)}, "yes", "missed"),
    ({"best": 0.5, "best_bar": (0.4, 0.6)}, "yes", "kept"),
    ({"reproducible": False, "reason": Both("it is bounded", "有界")}, "no", "none"),
])  # fmt: skip
def test_a_verdict_says_apart_whether_the_paper_is_reached_and_whether_our_bars_are_kept(how, reached, kept):
    assert outcome(**how).verdict[:2] == (reached, kept)


@pytest.mark.parametrize(("how", "claim"), [
    ({}, "reproduced"),
    ({"by": Both("arithmetic", "算术")}, "arithmetic holds"),
    ({"faithful": 10.0}, "not reached"),
    ({"faithful": 10.0, "reason": Both("it is bounded", "有界")}, "refuted"),
    ({"reproducible": False, "reason": Both("it is bounded", "有界")}, "cannot be had"),
    ({"paper": "grows"}, None),
])  # fmt: skip
def test_a_number_of_a_paper_is_reproduced_refuted_or_cannot_be_had(how, claim):
    made = outcome(**how)
    assert made.claim == claim == made.summary()["claim"]
    listed = claims([made])
    assert (listed and listed.rows[0][3]) == claim


def test_an_outcome_and_a_text_in_both_languages_reach_another_process_whole():
    for how in ({"faithful": None}, {"best_bar": (-math.inf, 1.0)}, {"reproducible": False}):
        with pytest.raises(ParameterError):
            outcome(**how)
    one = outcome(best=0.5, best_bar=(-math.inf, 1.0), reason=Both("noise", "噪声"))
    again = copy.deepcopy(one)  # by which it is pickled, too
    assert again == one
    assert (again.what.zh, again.reason.zh) == ("误差", "噪声")
    told = outcome(faithful=math.nan, best=math.inf).summary()
    assert (told["faithful"], told["best"]) == (None, None)
    both = copy.deepcopy(Both("error", "误差"))
    assert (both, said(both, "en"), said(both, "zh")) == ("error", "error", "误差")
    assert said(str(both), "zh") == "误差"  # a plot's label goes through str
    (row,) = table([outcome(best=0.5, best_bar=(-math.inf, 1.0), faithful=0.012345)]).rows
    assert row == ["error", "Fig 8", "°", "9.60", "0.0123", "0.500 (≤ 1)", "yes", "kept", ""]
    page = Report(both, facts=[(both, both)], remarks=[both], tables=[table([outcome()])]).page(lang="zh")
    assert "error" not in page.partition("</style>")[2]
    assert page.count("误差") == 6  # title twice, name and value, remark, row of the table


def test_what_cannot_be_run_is_refused_before_any_work_and_what_is_not_recorded_whole(tmp_path, monkeypatch):
    (tmp_path / "own.txt").write_text("mine")
    for name, how, says in (
        ("fish", {}, "there is no paper 'fish'; known: fin, buoy, trackball, arm, rod, all"),
        ("fin", {"jobs": 0}, "jobs must be a whole number of at least 1"),
        ("fin", {"seed": -1}, "seed must be a whole number"),
        ("fin", {"seed": 1.5}, r"seed must be a whole number of at least 0, but it is 1\.5"),
        ("fin", {}, "is not empty"),
    ):
        with pytest.raises(ParameterError, match=says):
            reproduce(name, **how, out=tmp_path)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(MissingExtraError, match="the pages' figures need matplotlib"):
        reproduce("fin", out=tmp_path / "pages")
    assert [path.name for path in tmp_path.iterdir()] == ["own.txt"]

    # As on a disk that is full: a figure of what is left would be wrong.
    def full(*_args, note, **_how):
        note("stopped: no space")
        return SimpleNamespace(lossy=True)

    monkeypatch.setattr("plumbob.papers.studies.record", full)
    with pytest.raises(DecodeError, match=r"x\.mcap was not recorded completely: stopped: no space\."):
        Study("rod", tmp_path).recorded("rod", "x", duration=0.1)


def refused(name, *_):
    if name == "arm":
        raise ParameterError("no room")
    time.sleep(60)


def killed(name, *_):
    if name == "arm":
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(60)


@pytest.mark.parametrize(("run", "told"), [
    (refused, "^no room"),
    (killed, "arm was lost: it was ended by SIGKILL, as the system does where memory runs out; try one job"),
])  # fmt: skip
def test_the_first_paper_that_fails_ends_all(tmp_path, monkeypatch, run, told):
    monkeypatch.setattr("plumbob.papers.reproduce.run_paper", run)
    begun = time.monotonic()
    with pytest.raises(PlumbobError, match=told):
        reproduce("all", out=tmp_path)
    assert time.monotonic() - begun < 30.0


@pytest.mark.parametrize("name", NAMES)
def test_every_item_is_done_or_has_its_reason(name):
    """The files that an item names exist, the outcomes are on the page of the papers."""
    page, content = PAGE.read_text(encoding="utf-8"), PAPERS[name].content
    for item in PAPERS[name].items:
        assert item.where
        assert item.by or item.reason, item
        assert set(re.findall(r"\[([\w.-]+)\]", item.by)) <= set(content["outcome"]), item
        for path in re.findall(r"`((?:src|tests|benchmarks|examples|website|docs)/[^\s`]*)`", item.by):
            assert (ROOT / path).exists(), (item.what, path)
    assert "\n".join(items_lines(name)) in page  # otherwise: make papers
    assert set(content["outcome"]) == keys_of(page, name)


def test_the_table_of_the_readme_has_figures_of_the_page_of_the_papers():
    """Otherwise: make papers."""
    text = README.read_text(encoding="utf-8")
    assert readme(text, PAGE.read_text(encoding="utf-8")) == text
    assert text.count("\n| rod | ") == 2
    assert plumbob.reproduce is reproduce
