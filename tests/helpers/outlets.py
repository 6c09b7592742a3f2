"""Outlets of tests, and servers that stand in for the real one."""

import sys
import threading
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from plumbob import emulate
from plumbob.live.transports.transport import Stop
from plumbob.viewer.child import Serving
from plumbob.viewer.commands import ClientCommand
from plumbob.viewer.messages import Command


class Kept:
    def __init__(self, *commands):
        self.hellos, self.batches, self.events, self.answers, self.resets = [], [], [], [], 0
        self.commands = list(commands)
        self.ready = True

    def hello(self, hello):
        self.hellos.append(hello)

    def batch(self, batch):
        self.batches.append((self.hellos[-1], batch))

    def event(self, t, kind, text):
        self.events.append((t, kind, text))

    def reset(self):
        self.resets += 1
        self.batches.clear()

    def answer(self, asked, ok, text):
        self.answers.append((asked.command.verb, ok, text))

    def take_commands(self):
        found, self.commands = self.commands, []
        return [ClientCommand(None, Command(id=1, **one)) for one in found]

    def column(self, key):
        """Values of a column of all rows; NaN where a batch has none."""
        found = []
        for hello, batch in self.batches:
            keys = [column.key for column in hello.columns]
            values = batch.rows["values"]
            found.append(values[:, keys.index(key)] if key in keys else np.full(len(values), np.nan))
        return np.concatenate(found)

    def rows(self, name):
        return np.concatenate([batch.rows[name] for _, batch in self.batches])

    @property
    def fields(self):
        return self.batches[-1][1].fields


@dataclass(frozen=True, slots=True, kw_only=True)
class StandIn(Serving):
    """Server that is none: it says that it is ready, and then reads or does not."""

    kind: str = "deaf"
    log: str = ""

    def words(self, number, port):
        return [sys.executable, str(Path(__file__).with_name("server_stand_in.py")), str(number), self.kind, self.log]


@contextmanager
def emulated(what="buoy", **options):
    """Rig in a thread; gives the name of its line."""
    stop, named, said = Stop(), threading.Event(), []

    def opened(name):
        said.append(name)
        named.set()

    thread = threading.Thread(target=lambda: emulate(what, stop=stop, opened=opened, seed=2, **options))
    thread.start()
    try:
        assert named.wait(60)
        yield said[0]
    finally:
        stop.set()
        thread.join(30)
        assert not thread.is_alive()
