"""Every filter against the battery, and the same bits as plain Python."""

import hashlib
import os
import subprocess
import sys

import pytest

from plumbob import Filter, Frame
from plumbob.filters import filter_names
from tests.battery.filters import FilterBattery, bits
from tests.battery.motion import noisy


class TestEveryFilter(FilterBattery):
    pass


def digest(name):
    return hashlib.sha256(bits(Filter(name, frame=Frame.ENU).process(noisy()))).hexdigest()


@pytest.mark.parametrize("name", filter_names())
def test_compiled_and_plain_python_give_the_same_bits(name):
    other = "0" if os.environ.get("NUMBA_DISABLE_JIT", "0") == "1" else "1"
    code = f"from tests.filters.test_filters_battery import digest; print(digest({name!r}))"
    environment = {**os.environ, "NUMBA_DISABLE_JIT": other}
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == digest(name)
