"""How random cases are drawn: the same on every machine, slow or not."""

import signal

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


@pytest.fixture
def hang_up_ends():
    """SIGHUP as it is in a terminal, and not ignored as under nohup, for this process and what it starts."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.fixture(scope="session")
def broad_folder():
    return real("broad")
