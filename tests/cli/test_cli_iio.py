"""record and replay from the command line, from an IIO device that is a tree of files and a pipe."""

import os
import shutil
import struct

import pytest

from tests.helpers.commandline import answer, typed
from tests.helpers.iio_tree import GYRO, Tree


@pytest.fixture
def folder(tmp_path):
    """Gyroscope of three axes, and time; its pipe holds 200 scans."""
    tree = Tree(tmp_path)
    kinds = {f"anglvel_{axis}": "le:s16/16>>0" for axis in "xyz"} | {"timestamp": "le:s64/64>>0"}
    tree.add_buffered("bench-gyro", kinds, {"in_anglvel_scale": repr(GYRO)})
    (tmp_path / "s.toml").write_text(tree.session(device="bench-gyro"))
    end = tree.hold()
    os.write(end, b"".join(struct.pack("<3h2xq", i, -i, 7, 10**10 + 10_000_000 * i) for i in range(200)))
    yield tmp_path
    os.close(end)


def test_record_then_convert_without_the_device(folder):
    report = answer("record s.toml --out a.mcap --duration 1s", cwd=folder)
    assert (report["samples"], report["format"], report["bytes"]["junk"]) == (200, "bench-gyro", 0)
    assert report["time"]["mode"] == "kernel"
    shutil.rmtree(folder / "sys")
    typed("convert a.mcap a.csv --what samples", cwd=folder)
    last = (folder / "a.csv").read_text().splitlines()[-1].split(",")
    assert [float(cell) for cell in last[1:4]] == pytest.approx([199 * GYRO, -199 * GYRO, 7 * GYRO], rel=1e-12)
    report = answer("replay a.mcap", cwd=folder)
    assert (report["samples"], report["time"]["mode"], report["duration_s"]) == (200, "kernel", pytest.approx(1.99))
