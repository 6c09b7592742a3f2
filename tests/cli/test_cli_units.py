"""record and replay of a rig whose frames hold several units: which one is estimated."""

import json

import numpy as np
import pytest

from tests.helpers.commandline import call

UNITS = ["u1", "u2", "u3", "u4", "u5", "u6"]  # of the teaching arm, as its format names them


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("arm")
    call("emulate", "arm", "--seed", "1", "--duration", "3s", "--write", "arm.bin", cwd=folder)
    return folder


def record(folder, *words):
    return call(
        "record", "--from", "arm.bin", "--format", "arm", "--filter", "mahony", "--frame", "NED", *words, cwd=folder
    )


def test_one_unit_is_estimated_by_name_or_number_and_replay_gives_the_others(folder):
    for name, unit in (("a", "u2"), ("b", "2"), ("c", "u3")):
        done = record(folder, "--unit", unit, "--out", f"{name}.mcap", "--json")
        assert done.returncode == 0, done.stderr
        call("replay", f"{name}.mcap", "--out", f"{name}.tum", cwd=folder)
    a, b, c = (np.loadtxt(folder / f"{name}.tum") for name in "abc")
    np.testing.assert_array_equal(a, b)
    assert np.abs(a - c).max() > 1e-3  # units move apart from each other
    done = call("replay", "a.mcap", "--unit", "3", "--out", "d.tum", "--json", cwd=folder)
    assert json.loads(done.stdout)["samples"] == len(c)
    np.testing.assert_array_equal(np.loadtxt(folder / "d.tum"), c)
    (folder / "s.toml").write_text("""
kind = "plumbob session"
version = 1
source = { kind = "file", path = "arm.bin" }
format = { name = "arm", unit = 2 }
imu = { frame = "NED" }
estimate = { filter = "mahony" }
record = { path = "s.mcap" }
""")
    assert call("record", "s.toml", cwd=folder).returncode == 0
    done = call("record", "s.toml", "--unit", "u3", cwd=folder)
    assert (done.returncode, "the session file already sets format, unit" in done.stderr) == (1, True)


@pytest.mark.parametrize("words", [(), ("--unit", "u7"), ("--unit", "0"), ("--unit", "7")])
def test_a_unit_that_is_not_there_is_an_error_that_lists_them(folder, words):
    done = record(folder, *words, "--out", "x.mcap")
    assert done.returncode == 1
    assert all(f"{name} ({number})" in done.stderr for number, name in enumerate(UNITS, 1))
    assert "--unit u1" in done.stderr
    assert not (folder / "x.mcap").exists()
