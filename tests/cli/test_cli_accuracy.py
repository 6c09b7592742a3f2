"""plumbob benchmark accuracy with other libraries and changed recordings."""

import pytest

from plumbob import Frame, Recording, files, simulate
from tests.helpers.commandline import refused, typed

WORDS = "benchmark accuracy a.parquet --filters"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("accuracy")
    run = simulate("buoy", frame=Frame.ENU, sensors="ideal", unit="calibrated", seed=1, duration=10.0)
    files.write(folder / "a.parquet", Recording(imu=run.imu, track=run.truth, name="a"))
    return folder


def test_a_change_is_made_and_named_and_the_estimators_are_compared(folder):
    words = f"{WORDS} mekf,vqf --against mekf --bias 1dps --no-mag --align heading --calibrated"
    lines = typed(words, cwd=folder).stdout.splitlines()
    assert "changed     bias 1dps, no_mag, seed 1" in lines
    at = lines.index("Total RMSE of mekf, and what others have more [°]") + 1
    head, trial, _, better = lines[at : at + 4]
    assert head.split() == ["mekf", "vqf"]
    assert better.split() == ["better", "in", "1" if trial.split()[-1].startswith("-") else "0", "of", "1"]
    assert "there is no motion in it" in refused(*f"{WORDS} mahony --start 20s".split(), cwd=folder)
