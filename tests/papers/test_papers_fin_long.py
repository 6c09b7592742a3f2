"""The fin paper whole, with every bar."""

import re

import pytest

from plumbob.core import _jit
from plumbob.papers.fin import ITEMS, run
from plumbob.papers.work import Work
from tests.papers.test_papers_fin import without_chinese


@pytest.mark.long(reason="80 seconds")
@pytest.mark.skipif(_jit.jit_disabled(), reason="hours of plain Python")
def test_every_bar_is_met_and_every_item_names_outcomes_that_exist(tmp_path):
    """Bars of papers 000."""
    found = run(Work(tmp_path, 1))
    keys = [one.key for one in found.outcomes]
    assert len(set(keys)) == len(keys)
    assert not [one.key for one in found.outcomes if not one.met]
    named = {key for item in ITEMS for key in re.findall(r"\[([^\]]+)\]", item.by) if key != "estimate"}
    assert named <= set(keys)
    assert without_chinese(found.report) == set()
