"""plumbob array on files: what the functions of the same names say."""

import json

import numpy as np
import pytest

import plumbob
from plumbob.array import combine, info, monitor
from plumbob.core.units import dps
from tests.helpers.array_samples import as_array, moved
from tests.helpers.commandline import ok, refused
from tests.helpers.commandline import plumbob as plumbob_line


@pytest.fixture(scope="module")
def six(tmp_path_factory):
    """File of six units, of which the third is off for a while."""
    file = tmp_path_factory.mktemp("array") / "six.parquet"
    found = moved(3, 60.0, moving=True)
    found["u3"]["gyr"][300:400, 1] += dps(1.0)
    plumbob.write(file, as_array(found))
    return file


def test_monitor_says_which_unit_and_writes_the_rest(six, tmp_path):
    out = tmp_path / "one.parquet"
    printed = json.loads(ok("array", "monitor", six, "--out", out, "--json").stdout)
    seen = monitor(plumbob.read(six).array)
    assert printed == seen.summary()
    assert [(fault["unit"], fault["triad"]) for fault in printed["faults"]] == [("u3", "gyr")]
    assert np.array_equal(plumbob.read(out).imu.gyr, seen.imu.gyr)
    assert "Units left out" in ok("array", "monitor", six).stdout


def test_combine_and_info_print_what_their_functions_find(six, tmp_path):
    array, out = plumbob.read(six).array, tmp_path / "one.parquet"
    printed = json.loads(ok("array", "combine", six, "--weights", "equal", "--out", out, "--json").stdout)
    assert printed == combine(array, weights="equal").summary()
    assert np.array_equal(plumbob.read(out).imu.acc, combine(array, weights="equal").imu.acc)
    assert json.loads(ok("array", "info", six, "--json").stdout) == info(array).summary()
    assert "Clock offset [ms]" in ok("array", "info", six).stdout


def test_a_kind_is_needed_and_inputs_are_never_written(six):
    done = plumbob_line("array")
    assert (done.returncode, "name a KIND: info, combine, monitor" in done.stderr) == (2, True)
    assert "is an input" in refused("array", "combine", six, "--out", six)


def test_from_bytes_with_the_mounts_of_the_rig(tmp_path):
    """The rig's opposite units are turned by 180°: without their mounts, forces of ±1 g cancel."""
    binary, stream, table = (tmp_path / name for name in ("arm.bin", "arm.mcap", "arm.parquet"))
    ok("emulate", "arm", "--write", binary, "--duration", "20s", "--seed", "3")
    ok("record", "--from", binary, "--format", "arm", "--unit", "all", "--out", stream)
    ok("convert", stream, table)
    for source in (stream, table):
        out = tmp_path / f"{source.suffix[1:]}.mcap"
        ok("array", "combine", source, "--mounts", "arm", "--out", out)
        force = np.linalg.norm(plumbob.read(out).imu.acc, axis=1)
        assert force.mean() == pytest.approx(9.80665, rel=0.01)
        assert json.loads(ok("array", "monitor", source, "--mounts", "arm", "--json").stdout)["faults"] == []
    lost = plumbob_line("array", "monitor", stream)
    assert "no mount is known" in lost.stderr
    assert "check how the units are mounted" in " ".join(lost.stdout.split())
    assert "is written as .mcap" in refused("array", "combine", stream, "--out", tmp_path / "one.tum")
    assert "holds one unit" in refused("array", "info", tmp_path / "parquet.mcap")
    (tmp_path / "left.parquet").write_bytes(table.read_bytes()[:20000])
    assert "cut or damaged" in refused("array", "info", tmp_path / "left.parquet")
