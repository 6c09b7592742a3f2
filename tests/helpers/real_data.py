"""Where the real recordings lie, and how a test that needs one is skipped, with the reason, where they are absent."""

import os
from functools import lru_cache
from pathlib import Path

import pytest

from benchmarks.harness.room import room_of
from plumbob.fleet.experiments.trials import read_trial

DATA = Path(os.environ.get("PLUMBOB_DATA") or Path(__file__).parents[3] / "shared" / "data")


def needs(*names: str) -> pytest.MarkDecorator:
    """Mark of a test that needs these files or folders below the recordings."""
    absent = [name for name in names if not (DATA / name).exists()]
    return pytest.mark.skipif(bool(absent), reason=f"no {', '.join(absent)} in {DATA}; set PLUMBOB_DATA")


def real(name: str) -> Path:
    """Path of a real recording; the test that asks for it is skipped where it is absent."""
    if not (DATA / name).exists():
        pytest.skip(f"no {name} in {DATA}; set PLUMBOB_DATA")
    return DATA / name


@lru_cache
def room_at(path):
    imu, reference = read_trial(path)
    return imu, room_of(imu, reference)
