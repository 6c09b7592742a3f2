"""The buoy paper's whole run: every bar, with two seeds."""

import pytest

from plumbob.papers.buoy import run
from plumbob.papers.work import Work


@pytest.mark.long("a minute each; the parts are tested with few seeds")
@pytest.mark.parametrize("seed", [1, 2])
def test_every_bar_is_met(tmp_path, seed):
    steps = []
    found = run(Work(tmp_path, seed=seed, progress=lambda what, done, of: steps.append((done, of))))
    assert [one.key for one in found.outcomes if not one.met] == []
    assert steps == [(k, len(steps)) for k in range(len(steps))]
    assert (tmp_path / "sea.mcap").is_file()
