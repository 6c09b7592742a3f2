"""How random cases are drawn, the same on every machine; a file that a test leaves open is an error of that test."""

import gc
import os
import signal
import sys

import pytest
from hypothesis import settings

from tests.helpers.real_data import real

# No deadline, for a shared machine stalls now and then; the same cases each time, so that a red run can be repeated.
settings.register_profile("plumbob", deadline=None, derandomize=True)
settings.register_profile("long", deadline=None, derandomize=True, max_examples=1000)
settings.register_profile("search", deadline=None, max_examples=1000)  # new cases at each call
settings.load_profile("plumbob")

# A shell without job control lets what runs in its background ignore Ctrl-C, which programs started here would inherit.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


OPEN = pytest.StashKey[int]()


@pytest.fixture
def hang_up_ends():
    """SIGHUP as it is in a terminal, and not ignored as under nohup, for this process and what it starts."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.fixture(scope="session")
def broad_folder():
    return real("broad")


def _open_files():
    try:
        return len(os.listdir("/proc/self/fd"))  # noqa: PTH208 - the quickest way, after every test
    except OSError:  # a system without such a folder: whoever collects the file names it
        return 0


def pytest_collection_finish(session):
    """Count what is open before the first test."""
    session.config.stash[OPEN] = _open_files()


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown(item):
    """Collect where more files are open than before: what nobody closed is named here and not in a later test."""
    now = _open_files()
    if now > item.session.config.stash[OPEN]:
        left = []
        usual, sys.unraisablehook = sys.unraisablehook, lambda told: left.append(f"{told.exc_value!r}")
        try:
            gc.collect()
        finally:
            sys.unraisablehook = usual
        now = _open_files()
        if left:
            pytest.fail("This test left something open:\n" + "\n".join(left), pytrace=False)
    item.session.config.stash[OPEN] = now
