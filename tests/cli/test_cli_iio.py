"""record and replay from the command line, from an IIO device that is a tree of files and a pipe."""

import json
import os
import shutil
import struct

import numpy as np
import pytest

from plumbob.cli.main import main

SCALE = 0.5 * 2.0**-11 / np.pi  # rad/s a count, made up


@pytest.fixture
def folder(tmp_path):
    """Gyroscope of three axes, and time; its pipe holds 200 scans."""
    device = tmp_path / "sys" / "bus" / "iio" / "devices" / "iio:device3"
    attributes = {
        "name": "bench-gyro", "in_anglvel_scale": repr(SCALE), "buffer/enable": 0, "buffer/length": 2,
        "current_timestamp_clock": "realtime",
    }  # fmt: skip
    for i, channel in enumerate(("anglvel_x", "anglvel_y", "anglvel_z", "timestamp")):
        kind = "le:s64/64>>0" if channel == "timestamp" else "le:s16/16>>0"
        attributes |= {f"scan_elements/in_{channel}_{k}": v for k, v in (("en", 0), ("index", i), ("type", kind))}
    for name, text in attributes.items():
        (device / name).parent.mkdir(parents=True, exist_ok=True)
        (device / name).write_text(f"{text}\n")
    (tmp_path / "dev").mkdir()
    os.mkfifo(tmp_path / "dev" / device.name)
    (tmp_path / "s.toml").write_text(f"""
kind = "plumbob session"
version = 1
[source]
kind = "iio"
device = 3
sys_root = "{tmp_path}/sys"
dev_root = "{tmp_path}/dev"
""")
    end = os.open(tmp_path / "dev" / device.name, os.O_RDWR | os.O_NONBLOCK)
    os.write(end, b"".join(struct.pack("<3h2xq", i, -i, 7, 10**10 + 10_000_000 * i) for i in range(200)))
    yield tmp_path
    os.close(end)


def test_record_then_convert_without_the_device(folder, capsys):
    assert main(["record", str(folder / "s.toml"), "--out", str(folder / "a.mcap"), "--duration", "1s", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["samples"], told["format"], told["bytes"]["junk"]) == (200, "bench-gyro", 0)
    assert told["time"]["mode"] == "kernel"
    shutil.rmtree(folder / "sys")
    words = ["convert", str(folder / "a.mcap"), str(folder / "a.csv"), "--what", "samples"]
    assert main(words) == 0
    rows = (folder / "a.csv").read_text().splitlines()
    np.testing.assert_allclose(float(rows[-1].split(",")[1]), 199 * SCALE, rtol=1e-12)
    assert main(["replay", str(folder / "a.mcap")]) == 0
    assert "200 in 1.990 s, rate 100 Hz by kernel" in capsys.readouterr().out
