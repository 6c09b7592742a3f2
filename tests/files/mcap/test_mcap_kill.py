"""A process that is killed or stopped loses no acknowledged row; benchmarks/recorder_kill.py does it 50 times."""

import itertools
import os
import random
import signal
import subprocess
import sys
import time

import pytest

from plumbob.files.mcap import repair, verify
from tests.helpers.record_samples import library_rows, read

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
