"""A power cut: what was synced is there, what came after it may be missing, torn or in another order."""

import os
import random

import pytest

from plumbob.files.mcap import disk, repair, verify
from tests.helpers.record_samples import channels, fill, read, recorder

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

        monkeypatch.setattr(disk.os, "write", logged_write)
        monkeypatch.setattr(disk.os, "fsync", logged_fsync)

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
        bad.write_bytes(content[:size])
        safe = read(bad)[1]
        bad.write_bytes(content)
        _, got = read(bad)
        assert got[: len(safe)] == safe == rows[: len(safe)]
        assert set(got) <= set(rows)
        out = tmp_path / f"{at}.mcap"
        verdict = repair(bad, out)
        assert verify(out).whole
        assert read(out)[1] == got
        assert verdict.rows == verify(out).rows
