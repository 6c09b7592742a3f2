"""Lines of all kinds, without hardware."""

import os
import time

import pytest

from plumbob.core.event import Event
from plumbob.live.transports.transport import Received
from tests.helpers import Clock

PATIENCE = 30.0  # s; never waited for on a machine that is not overloaded


class Pty:
    """A pseudo-terminal behind a link, as udev links a serial port; plugged in, pulled out, plugged in again."""

    def __init__(self, folder):
        self.link = folder / "ttyLINK"
        self.master = self.slave = None

    def plug(self, stale=b""):
        self.master, self.slave = os.openpty()  # while the other end is open too, what is stale stays in it
        if stale:
            os.write(self.master, stale)
        self.link.symlink_to(os.ttyname(self.slave))
        return self

    def write(self, data):
        while data:
            data = data[os.write(self.master, data) :]

    def pull(self):
        if self.master is not None:
            self.link.unlink()
            os.close(self.master)
            os.close(self.slave)
            self.master = None


class Collected(list):
    """What a source has given."""

    @property
    def data(self):
        return b"".join(item.data for item in self if isinstance(item, Received))

    @property
    def events(self):
        return [item for item in self if isinstance(item, Event)]

    @property
    def kinds(self):
        return [event.kind for event in self.events]


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def line(tmp_path):
    pty = Pty(tmp_path).plug()
    yield pty
    pty.pull()


@pytest.fixture
def collect():
    def collect(source, enough, collected=None):
        """Read until there is enough; fails where that takes too long."""
        collected = Collected() if collected is None else collected
        until = time.monotonic() + PATIENCE
        while not enough(collected):
            assert time.monotonic() < until, collected[-5:]
            collected += source.read(0.1)
        return collected

    return collect
