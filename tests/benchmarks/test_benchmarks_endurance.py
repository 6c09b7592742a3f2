"""The endurance benchmark runs, keeps time going forward over its blocks, and says where a limit is broken."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from plumbob import Filter
from plumbob.core import flags
from plumbob.filters import filter_names

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "endurance.py"


@pytest.fixture(scope="module")
def endurance():
    spec = importlib.util.spec_from_file_location("endurance", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules["endurance"] = module  # where its dataclass looks for itself
    spec.loader.exec_module(module)
    yield module
    del sys.modules["endurance"]


def run(*words):
    return subprocess.run([sys.executable, str(SCRIPT), *words], capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    "filters", ["mahony", pytest.param(",".join(filter_names()), marks=pytest.mark.long(reason="half a minute"))]
)
def test_filters_keep_the_norm_over_a_few_blocks(filters):
    done = run("--samples", "5e3", "--block", "1000", "--json", "--filters", filters)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert [one["name"] for one in found] == filters.split(",")
    for one in found:
        assert (one["samples"], one["finite"], one["met"]) == (5000, True, True)
        assert one["at_block_ends"] <= one["largest"] < 1e-12
        assert one["bias_dps"] >= 0.0
    text = run("--samples", "1", "--block", "1000", "--filters", "mahony").stdout
    assert "mahony" in text
    assert text.rstrip().endswith("met")


def test_blocks_are_plausible(endurance):
    """Rms of the smoothed noise is 1 rad/s in each axis by its making; |acc| and |mag| are those of Earth, with noise.

    A block of 20 000 holds some 400 independent rates per axis, so that the rms scatters by 1/√2400 or 2 %. Noise of
    0.3 m/s² leaves |acc| at g + 0.3²/g or 9.816 m/s², to 0.3/√20000 m/s².
    """
    data = endurance.block(0, 20_000)
    assert np.sqrt(np.mean(data.gyr**2)) == pytest.approx(1.0, abs=0.1)
    assert np.linalg.norm(data.acc, axis=1).mean() == pytest.approx(9.816, abs=0.01)
    assert np.isnan(data.mag[1::2]).all()
    assert np.linalg.norm(data.mag[::2], axis=1).mean() == pytest.approx(np.linalg.norm(endurance.FIELD_ENU), abs=0.05)
    assert data.acc[:, 2].min() < -8.0 < 8.0 < data.acc[:, 2].max()  # through all attitudes


def test_a_filter_does_not_start_anew_between_blocks(endurance, monkeypatch):
    """Blocks in turn are one recording: a step apart, so that no gap, late sample or start is flagged."""
    blocks = [endurance.block(seed, 500) for seed in (0, 1)]
    taken = []
    batch = Filter._batch

    def listen(self, t_ns, *args):
        found = batch(self, t_ns, *args)
        taken.append((t_ns, found))
        return found

    monkeypatch.setattr(Filter, "_batch", listen)
    endurance.endure("mekf", blocks, 1500)
    times, found = zip(*(one for one in taken if one[0].size), strict=True)
    assert (np.diff(np.concatenate(times)) == endurance.STEP_NS).all()
    words = np.concatenate([one[2] for one in found])
    assert not (words & (flags.GAP | flags.TIME_FAULT)).any()


def test_a_broken_limit_is_told_and_is_the_exit_status(endurance):
    good = endurance.Endured("x", 1, 1.0, 0.0, 1e-13, 0.0, True)
    assert good.met
    assert endurance.row(good).endswith("yes  met")
    for change in ({"largest": 1e-12}, {"finite": False}):
        bad = endurance.Endured(**{**vars(good), **change})
        assert not bad.met
        assert endurance.row(bad).endswith("MISSED")
    refused = run("--filters", "mahoney")
    assert refused.returncode == 1
    assert "there is no filter 'mahoney'" in refused.stderr
