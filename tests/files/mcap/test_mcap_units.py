"""Recordings with a channel for each of several units: killed, damaged, and written for viewers."""

import json
import os
import signal
import subprocess
import time
from contextlib import ExitStack

import numpy as np
import pytest

import plumbob
from plumbob import ImuData, ImuMeta, find_format, read_array
from plumbob.data.array import ImuArray, UnitMount
from plumbob.files.header import array_told
from plumbob.files.mcap import open_log
from plumbob.protocols.decode import decode, triads_of
from tests.helpers.commandline import PLUMBOB
from tests.helpers.io_samples import put, refused
from tests.helpers.record_samples import flipped, recorder

UNITS = ("u1", "u2", "u3")


def array(rows=200):
    rng = np.random.default_rng(2)
    t = np.arange(rows) / 100.0
    meta = ImuMeta(device="d", unit_check=False, t0_ns=1_700_000_000_000_000_000)
    units = {name: ImuData(t=t, gyr=rng.normal(size=(rows, 3)), meta=meta) for name in UNITS}
    return ImuArray(units, {"u2": UnitMount((0.0, 1.0, 0.0, 0.0), (0.1, 0.2, 0.3), 1e-3)})


@pytest.mark.long(reason="two processes; of a killed recorder test_mcap_disk tells the same for one channel")
def test_a_killed_recorder_leaves_every_unit(tmp_path):
    """SIGKILL in the middle of a live line: all units have the same samples, those that the raw bytes hold."""
    link, file = tmp_path / "line", tmp_path / "a.mcap"
    emulate = [*PLUMBOB, "emulate", "arm", "--seed", "2", "--link", str(link), "--speed", "20", "--duration", "200s"]
    record = [*PLUMBOB, *f"record --port {link} --format arm --unit all --time count --out {file}".split()]
    with ExitStack() as stack:
        sender = stack.enter_context(subprocess.Popen(emulate, stdout=subprocess.PIPE, text=True))
        stack.callback(sender.kill)
        assert sender.stdout.readline().startswith("/dev/")
        child = stack.enter_context(subprocess.Popen(record, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
        stack.callback(child.kill)
        deadline = time.monotonic() + 60.0
        while not (file.exists() and file.stat().st_size > 20_000) and time.monotonic() < deadline:
            time.sleep(0.05)
        os.kill(child.pid, signal.SIGKILL)
        child.wait()
    verdict = plumbob.verify(file)
    assert not verdict.clean
    assert not verdict.lossy
    raw = b"".join(row.data for row in open_log(file) if row.topic == "raw")
    frames, found = decode(raw, find_format("arm")).frames["arm"], read_array(file)
    assert len(found) == len(frames) > 20
    for name in found.names:
        np.testing.assert_array_equal(found.units[name].acc, triads_of(frames, name)["acc"])
        rows = sum(row.topic == f"imu/{name}" for row in open_log(file))
        assert len(frames) - 20 <= rows <= len(frames)  # decoded samples are written behind their bytes


def test_a_file_for_viewers_holds_all_units(tmp_path):
    plumbob.convert(plumbob.Recording(array=array(), name="a"), tmp_path / "a.mcap")
    found = read_array(tmp_path / "a.mcap")
    for name in UNITS:
        assert found.units[name].gyr.tobytes() == array().units[name].gyr.tobytes()
        assert found.units[name].meta == array().units[name].meta
        assert found.mounts[name] == array().mounts[name]
    assert plumbob.read(tmp_path / "a.mcap", unit="2").imu.gyr.tobytes() == array().units["u2"].gyr.tobytes()
    assert plumbob.verify(tmp_path / "a.mcap").whole


def test_damage_of_a_file_for_viewers_costs_its_rows_only(tmp_path):
    """What is left is on one time line, and each row is a row of the whole."""
    whole, path = array(800), tmp_path / "a.mcap"
    plumbob.convert(plumbob.Recording(array=whole, name="a"), path)
    raw = path.read_bytes()
    for at in np.random.default_rng(0).integers(len(raw) // 10, len(raw) * 9 // 10, 6):
        found = read_array(put(path, flipped(raw, at, 16)))
        assert len(found) > 400
        rows = np.searchsorted(whole.t, found.t)
        for name in UNITS:
            assert found.units[name].gyr.tobytes() == whole.units[name].gyr[rows].tobytes()


def crafted(folder, rows, about):
    path = folder / "crafted.mcap"
    r = recorder(path)
    r.metadata["recording"] = json.dumps(about)
    numbers = {topic: r.channel(topic, "json") for topic in dict.fromkeys(topic for topic, _ in rows)}
    with r:
        for topic, t_ns in rows:
            row = {"t_ns": t_ns, "gyr": [0.1, 0.2, 0.3], "acc": None, "mag": None, "temp_c": None, "flags": 0}
            r.write(numbers[topic], t_ns, json.dumps(row).encode())
    return path


def told(*names):
    one = array_told(array())[0]
    return [one | {"name": name} for name in names]


def test_rows_that_some_units_lack_are_left_out(tmp_path):
    rows = [("imu/u1", 10), ("imu/u2", 10), ("imu/u1", 20), ("imu/u1", 30), ("imu/u2", 30)]
    assert read_array(crafted(tmp_path, rows, {"array": told("u1", "u2")})).t.tolist() == [10e-9, 30e-9]


WRONG = {
    "a unit without rows": (["u1", "u9"], "no samples of the unit u9"),
    "no time in common": (["u1", "u2"], "no time in common"),
    "no list": (5, "array must be a list of tables"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_does_not_go_together_is_refused(tmp_path, case):
    names, match = WRONG[case]
    about = {"array": told(*names) if isinstance(names, list) else names}
    refused(read_array, crafted(tmp_path, [("imu/u1", 10), ("imu/u2", 20)], about), match=match)
