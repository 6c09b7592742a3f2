"""The rod paper's whole run with all its bars."""

import pytest

from plumbob.papers.rod import run
from plumbob.papers.work import Work


@pytest.mark.long(reason="a minute: 600 s through bytes, and 24 seeds of 600 s by every method")
def test_the_whole_run_meets_its_bars(tmp_path):
    found = run(Work(tmp_path))
    assert {one.key for one in found.outcomes if not one.met} == set()
    cannot = {one.key for one in found.outcomes if not one.reproducible}
    assert cannot == {
        "accel.early", "switch.hard.jump", "switch.hard", "switch.hard_reset", "switch.narrow", "switch.narrow_reset"
    }  # fmt: skip
