"""Batteries: what every filter, decoder, format and page must pass, and what their tests share."""

import json
import os
import resource
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

from plumbob.core.kernels import is_plain

PATIENCE = 60.0  # s; never waited for on a machine that is not overloaded
slow_as_python = pytest.mark.skipif(is_plain(), reason="minutes in plain Python, whose bits are the same")


def examples(share: float, **more: Any) -> settings:
    """As many random cases as this share of those that the profile of the run asks for (100, or 1000 in a long run)."""
    return settings(max_examples=max(1, round(share * settings.default.max_examples)), **more)


def beside(test, name):
    """Text of a file that lies beside a test."""
    return Path(test).with_name(name).read_text(encoding="utf-8")


def until(condition, what="what was waited for did not come", patience=PATIENCE):
    """Wait for a condition, and fail where it does not come; what it gave."""
    end = time.monotonic() + patience
    while not (given := condition()):
        assert time.monotonic() < end, what() if callable(what) else what
        time.sleep(0.002)
    return given


class Clock:
    """Time that passes only where a test says so, and in `sleep`."""

    def __init__(self, now=1.0):
        self.ns, self.slept = round(now * 1e9), []

    def __call__(self):
        return self.ns

    monotonic_ns = __call__

    def on(self, seconds):
        assert seconds >= 0.0
        self.ns += round(seconds * 1e9)

    def sleep(self, seconds):
        self.slept.append(seconds)
        self.on(seconds)


@contextmanager
def full_disk(room=256):
    """Let no file of this process grow beyond `room` bytes: first a short write, then EFBIG, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, hard))  # Python ignores the signal of it
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def in_the_other_mode(code, warnings="ignore"):
    """What code makes of the name `given`, in a process that compiles kernels where this one does not, or does not."""
    environment = {**os.environ, "PLUMBOB_KERNELS": "" if is_plain() else "python"}
    words = [sys.executable, "-W", warnings, "-c", f"import json; {code}; print(json.dumps(given))"]
    root = Path(__file__).parents[2]
    return json.loads(
        subprocess.run(words, cwd=root, env=environment, capture_output=True, text=True, check=True).stdout
    )
