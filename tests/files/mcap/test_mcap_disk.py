"""Full, failing and slow disks: the caller never waits and never sees an exception, and every lost row is counted.

Killed, stopped, or without power: acknowledged rows are there; benchmarks/recorder_kill.py kills 50 times. Of a power
cut: what was synced is there, what came after it may be missing, torn or in another order.
"""

import errno
import itertools
import os
import random
import shutil
import signal
import subprocess
import sys
import threading
import time

import pytest

from plumbob.core.errors import ParameterError
from plumbob.files.mcap import open_log, repair, verify, writer
from tests.helpers import until
from tests.helpers.io_samples import put, refused
from tests.helpers.record_samples import DECODED, RAW, channels, fill, library_rows, read, recorder, rows_of

LIMITED = """
import resource, signal, sys, time
from plumbob.files.mcap import Recorder
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
r = Recorder(sys.argv[1], epoch_offset_ns=0, reserve=0, compression="none")
n = r.channel("a", "x")
with r:
    for i in range(600):
        r.write(n, i * 10_000_000, bytes([i % 256]) * 100)
print(r.written, r.acknowledged, r.dropped, [e.kind for e in r.take_events()])
"""


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Look again after 20 ms instead of a second."""
    monkeypatch.setattr(writer, "RETRY", 0.02)


class Disk:
    """Takes the place of os.write and os.fsync until it is healed."""

    def __init__(self, monkeypatch, error=errno.ENOSPC, room=None, fails=("write",)):
        self.error, self.room, self.fails, self.ill, self.synced = error, room, fails, True, False
        self._write, self._fsync = os.write, os.fsync
        monkeypatch.setattr(writer.os, "write", self.write)
        monkeypatch.setattr(writer.os, "fsync", self.fsync)

    attempts = 0

    def write(self, fd, data):
        if self.ill and "write" in self.fails:
            self.attempts += 1
            if not self.room:
                raise OSError(self.error, os.strerror(self.error))
            data = data[: self.room]  # first a short write, as a real disk does
            self.room -= len(data)
        self.synced = False
        return self._write(fd, data)

    def fsync(self, fd):
        if self.ill and "fsync" in self.fails and not os.path.isdir(f"/proc/self/fd/{fd}"):  # noqa: PTH112
            raise OSError(self.error, os.strerror(self.error))
        self._fsync(fd)
        self.synced = True


@pytest.mark.parametrize("error", [errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EROFS, errno.EFBIG])
def test_a_refused_write_stops_once_and_goes_on_in_a_new_part(tmp_path, monkeypatch, error):
    r = recorder(tmp_path / "a.mcap")
    numbers = channels(r)
    with r:
        rows = fill(r, numbers, 30)
        until(lambda: r.acknowledged == 40)
        ill = Disk(monkeypatch, error, room=150)
        rows += fill(r, numbers, 60, start=30)
        r.tick(10**12)
        until(lambda: ill.attempts > 4)  # the first, and several to go on
        assert (r.state, r.acknowledged) == ("stopped", 40)  # 20 rows per chunk; the third chunk met the short write
        ill.ill = False
        until(lambda: r.acknowledged == len(rows))
        assert r.state == "recording"
    kinds = [e.kind for e in r.take_events() if e.kind != "unfinished"]
    assert kinds == ["stopped", "resumed"]
    assert r.dropped == 0
    assert [p.name for p in sorted(tmp_path.iterdir())] == ["a.0002.mcap", "a.mcap"]
    log, got = read(tmp_path / "a.mcap")
    assert got == rows
    assert log.lost == {}


def test_rows_that_never_find_room_are_counted(tmp_path, monkeypatch):
    r = recorder(tmp_path / "a.mcap", backlog=4000)
    numbers = channels(r)
    with r:
        rows = fill(r, numbers, 20)
        until(lambda: r.acknowledged == 20)
        Disk(monkeypatch)
        fill(r, numbers, 200, start=20)
    assert r.state == "closed"
    assert r.written == 400 == r.acknowledged + r.dropped
    assert r.acknowledged == 20
    events = r.take_events()
    assert sum(e.count for e in events if e.kind == "dropped") == r.dropped
    assert sum(e.kind == "stopped" for e in events) == 1
    log, got = read(tmp_path / "a.mcap")
    assert got == rows[:20]
    assert not log.clean


def test_a_slow_disk_costs_memory_then_counted_rows_but_never_the_callers_time(tmp_path, monkeypatch):
    gate = threading.Event()
    write = os.write
    r = recorder(tmp_path / "a.mcap", backlog=20_000, compression="none")
    numbers = channels(r)
    with r:
        monkeypatch.setattr(writer.os, "write", lambda fd, data: (gate.wait(30), write(fd, data))[1])
        fill(r, numbers, 1000)  # some 100 kB: returns though nothing can be written
        r.tick(10**12)
        dropped = r.dropped
        assert dropped > 0
        gate.set()
        until(lambda: r.acknowledged + dropped == r.written)
        fill(r, numbers, 1020, start=1000)
    assert r.dropped == dropped
    assert sum(e.count for e in r.take_events()) == dropped
    verdict = verify(tmp_path / "a.mcap")
    assert sum(verdict.rows.values()) == r.acknowledged == 2040 - dropped
    assert sum(verdict.dropped.values()) == dropped
    assert verdict.lost == {}
    assert verdict.whole  # the file is; the recorder itself says what it gave up


def test_a_failed_fsync_takes_back_and_writes_anew(tmp_path, monkeypatch):
    r = recorder(tmp_path / "a.mcap", fsync=0.01)
    numbers, ill = channels(r), Disk(monkeypatch, errno.EIO, fails=("fsync",))
    ill.ill = False
    with r:
        rows = fill(r, numbers, 30)
        until(lambda: r.acknowledged == 40 and ill.synced)
        ill.ill = True
        rows += fill(r, numbers, 60, start=30)
        until(lambda: r.state == "stopped")
        ill.ill = False
        r.tick(10**12)
        until(lambda: r.acknowledged == len(rows))
    assert r.dropped == 0
    assert "stopped" in {e.kind for e in r.take_events()}
    log, got = read(tmp_path / "a.mcap")
    assert got == rows
    assert log.lost == {}
    assert "once more" not in str(log.damage)  # cut off from the part whose fsync failed


def test_the_reserve_is_kept_and_the_part_ends_properly(tmp_path, monkeypatch):

    def more():
        rows.extend(fill(r, numbers, len(rows) // 2 + 10, start=len(rows) // 2))
        return r.state == "stopped"

    free, looks = [10**9], []
    monkeypatch.setattr(writer, "free_bytes", lambda folder: looks.append(free[0]) or free[0])
    r = recorder(tmp_path / "a.mcap", reserve=10**8)
    numbers = channels(r)
    with r:
        rows = fill(r, numbers, 20)
        until(lambda: r.acknowledged == 20)
        free[0] = 10**8 - 1
        until(more)  # it looks again after a while, when there is something to write
        assert verify(tmp_path / "a.mcap").clean
        free[0] = 10**8 + 1  # not yet: it would stop again at once
        until(lambda: looks.count(10**8 + 1) > 1)
        assert r.state == "stopped"
        free[0] = 10**9
        r.tick(10**12)
        until(lambda: r.acknowledged == len(rows))
    events = r.take_events()
    assert [e.kind for e in events] == ["stopped", "resumed"]
    assert "less than the reserve of 100 MB is free" in events[0].text
    assert verify(tmp_path / "a.mcap").whole
    assert rows_of(open_log(tmp_path / "a.mcap")) == rows


def test_a_disk_that_is_full_at_the_start_is_no_error(tmp_path, monkeypatch):
    free = [0]
    monkeypatch.setattr(writer, "free_bytes", lambda folder: free[0])
    r = recorder(tmp_path / "a.mcap", reserve=1000)
    numbers = channels(r)
    with r:
        assert r.state == "stopped"
        assert list(tmp_path.iterdir()) == []
        rows = fill(r, numbers, 30)
        free[0] = 10**9
    assert rows_of(open_log(tmp_path / "a.mcap")) == rows


def test_a_disk_that_refuses_the_first_bytes_is_no_error_either(tmp_path, monkeypatch):
    disk = Disk(monkeypatch)
    r = recorder(tmp_path / "a.mcap", reserve=0)
    numbers = channels(r)
    with r:
        assert r.state == "stopped"
        assert [(e.kind, "No space left" in e.text) for e in r.take_events()] == [("stopped", True)]
        rows = fill(r, numbers, 30)
        disk.ill = False
    assert rows_of(open_log(tmp_path / "a.mcap")) == rows


def test_the_default_reserve_is_the_smaller_of_a_gibibyte_and_a_twentieth(tmp_path):
    total = shutil.disk_usage(tmp_path).total
    assert writer.default_reserve(tmp_path) == pytest.approx(min(2**30, total / 20), rel=1e-6)


def test_a_disk_that_does_not_answer_at_the_end_is_told(tmp_path, monkeypatch):
    gate = threading.Event()
    write = os.write
    r = recorder(tmp_path / "a.mcap").start()
    numbers = channels(r)
    monkeypatch.setattr(writer.os, "write", lambda fd, data: (gate.wait(30), write(fd, data))[1])
    fill(r, numbers, 10)
    r.close(timeout=0.1)
    events = r.take_events()
    assert [(e.kind, e.count) for e in events] == [("unfinished", 20)]
    gate.set()
    until(lambda: r.state == "closed")
    assert verify(tmp_path / "a.mcap").rows == {RAW: 10, DECODED: 10}


def test_a_limit_on_the_size_of_files(tmp_path):
    """RLIMIT_FSIZE: the system writes a part of a chunk first, and refuses the rest with EFBIG."""
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, tmp_path / "a.mcap"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    written, acknowledged, dropped, *_ = done.stdout.split(maxsplit=3)
    assert (int(written), int(acknowledged), int(dropped)) == (600, 600, 0)
    log, got = read(tmp_path / "a.mcap")
    assert len(log.paths) >= 4  # 600 rows of 131 bytes and more in files of 20 kB
    assert [row[1] for row in got] == list(range(600))
    assert all(row[3] == bytes([row[1] % 256]) * 100 for row in got)


@pytest.fixture
def small_disk(tmp_path):
    """A tmpfs of 256 KiB."""
    folder = tmp_path / "small"
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=256k", "tmpfs", str(folder)], capture_output=True, text=True, check=False
    )
    if mounted.returncode:
        pytest.skip(f"no small disk can be mounted here: {mounted.stderr.strip()}")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.parametrize("reserve", [0, 64 * 1024])
def test_a_full_disk_loses_no_acknowledged_row(small_disk, reserve):
    r = recorder(small_disk / "a.mcap", reserve=reserve, compression="none", backlog=1 << 20)
    number = r.channel("a", "x")
    (small_disk / "ballast").write_bytes(bytes(100_000))
    with r:
        for i in range(2000):
            r.write(number, i * 10**7, bytes([i % 256]) * 80)
            if i % 100 == 0:
                time.sleep(0.005)
        until(lambda: r.state == "stopped")
        before = r.acknowledged
        assert 0 < before < r.written
        (small_disk / "ballast").unlink()
        until(lambda: r.acknowledged > before)
    log, got = read(small_disk / "a.mcap")
    assert len(got) == r.acknowledged
    assert r.written == r.acknowledged + r.dropped
    assert all(row[3] == bytes([row[1] % 256]) * 80 for row in got)
    assert log.damage == []


def test_a_recorder_starts_once(tmp_path):
    with recorder(tmp_path / "a.mcap") as r:
        refused(r.start, match="started before", error=ParameterError)
    r.close()
    r.close()
    assert r.state == "closed"


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
