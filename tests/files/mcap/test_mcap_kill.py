"""Killed, stopped, or without power: acknowledged rows are there; benchmarks/recorder_kill.py kills 50 times.

Of a power cut: what was synced is there, what came after it may be missing, torn or in another order.
"""

import itertools
import os
import random
import signal
import subprocess
import sys
import time

import pytest

from plumbob.files.mcap import repair, verify, writer
from tests.helpers.io_samples import put
from tests.helpers.record_samples import channels, fill, library_rows, read, recorder

CHILD = """
import sys, time
from plumbob.files.mcap import Recorder
r = Recorder(sys.argv[1], epoch_offset_ns=0, reserve=0)
n = r.channel("a", "x")
with r:
    told = 0
    while True:
        t_ns = time.monotonic_ns()
        r.write(n, t_ns, b"%d" % t_ns)
        r.tick(t_ns)
        if r.acknowledged != told:
            told = r.acknowledged
            print(r.acknowledged, r.written, flush=True)
        time.sleep(0.0005)
"""


@pytest.fixture
def child(tmp_path):
    with subprocess.Popen([sys.executable, "-c", CHILD, tmp_path / "a.mcap"], stdout=subprocess.PIPE, text=True) as one:
        one.stdout.readline()  # it runs
        yield one
        one.kill()


@pytest.mark.parametrize("seed", range(2))
def test_a_killed_recorder_keeps_what_it_acknowledged(child, tmp_path, seed):
    time.sleep(random.Random(seed).uniform(0.0, 0.5))
    os.kill(child.pid, signal.SIGKILL)
    *_, last = ["0 0", *child.stdout.read().split("\n")[:-1]]
    acknowledged = int(last.split()[0])
    log, rows = read(tmp_path / "a.mcap")
    assert len(rows) >= acknowledged
    assert [row[1] for row in rows] == list(range(len(rows)))
    assert all(row[3] == b"%d" % row[2] for row in rows)
    assert not log.clean
    assert not verify(tmp_path / "a.mcap").open
    assert repair(tmp_path / "a.mcap", tmp_path / "b.mcap").lost == {}
    assert library_rows(tmp_path / "b.mcap", offset=0) == rows


def test_a_stopped_recorder_goes_on_where_it_was(child, tmp_path):
    os.kill(child.pid, signal.SIGSTOP)
    time.sleep(0.5)
    assert verify(tmp_path / "a.mcap").open
    os.kill(child.pid, signal.SIGCONT)
    for _ in range(5):
        child.stdout.readline()
    os.kill(child.pid, signal.SIGKILL)
    child.wait()
    _, rows = read(tmp_path / "a.mcap")
    assert [row[1] for row in rows] == list(range(len(rows)))
    assert max(b[2] - a[2] for a, b in itertools.pairwise(rows)) > 0.4e9  # the pause is in the times


SECTOR = 512


class WriteLog:
    """What went to the disk, and in what order: ("write", offset, bytes) or ("fsync",)."""

    def __init__(self, monkeypatch):
        self.steps = []
        write, fsync = os.write, os.fsync

        def logged_write(fd, data):
            self.steps.append(("write", os.lseek(fd, 0, os.SEEK_CUR), bytes(data)))
            return write(fd, data)

        def logged_fsync(fd):
            self.steps.append(("fsync",))
            fsync(fd)

        monkeypatch.setattr(writer.os, "write", logged_write)
        monkeypatch.setattr(writer.os, "fsync", logged_fsync)

    def after_power_cut(self, at, rng):
        """File content if the power goes after step `at`: each sector written since the last fsync may be lost."""
        last = max((i for i, step in enumerate(self.steps[:at]) if step[0] == "fsync"), default=-1)
        content = bytearray()
        for i, step in enumerate(self.steps[:at]):
            if step[0] == "write":
                _, offset, data = step
                content.extend(bytes(max(0, offset + len(data) - len(content))))
                for k in range(0, len(data), SECTOR):
                    if i < last or rng.random() < 0.7:
                        piece = data[k : k + SECTOR]
                        content[offset + k : offset + k + len(piece)] = piece
        return bytes(content[: len(content) - (rng.randrange(SECTOR) if rng.random() < 0.3 else 0)]), last

    def synced_size(self, last):
        return max((s[1] + len(s[2]) for s in self.steps[:last] if s[0] == "write"), default=0)


@pytest.mark.parametrize("seed", range(2))
def test_everything_before_the_last_fsync_survives(tmp_path, monkeypatch, seed):
    log, rng = WriteLog(monkeypatch), random.Random(seed)
    r = recorder(tmp_path / "a.mcap", fsync=0.0 if seed == 0 else 0.003)
    numbers = channels(r)
    with r:
        rows = fill(r, numbers, 150)
    monkeypatch.undo()
    bad = tmp_path / "c" / "a.mcap"
    bad.parent.mkdir()
    for at in range(1, len(log.steps)):
        content, last = log.after_power_cut(at, rng)
        size = log.synced_size(last)
        if not size:  # not even the beginning has been confirmed
            continue
        safe = read(put(bad, content[:size]))[1]
        _, got = read(put(bad, content))
        assert got[: len(safe)] == safe == rows[: len(safe)]
        assert set(got) <= set(rows)
        out = tmp_path / f"{at}.mcap"
        verdict = repair(bad, out)
        assert verify(out).whole
        assert read(out)[1] == got
        assert verdict.rows == verify(out).rows
