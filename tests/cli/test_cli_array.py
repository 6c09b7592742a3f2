"""plumbob array on files: what the functions of the same names say."""

import numpy as np
import pytest

import plumbob
from plumbob.arm.array import combine, info, monitor
from plumbob.core.units import dps
from tests.helpers.arm_samples import as_array, moved
from tests.helpers.commandline import answer, typed


@pytest.fixture(scope="module")
def six(tmp_path_factory):
    """File of six units, of which the third is off for a while."""
    file = tmp_path_factory.mktemp("array") / "six.parquet"
    found = moved(3, 60.0, moving=True)
    found["u3"]["gyr"][300:400, 1] += dps(1.0)
    plumbob.write(file, as_array(found))
    return file


def test_verbs_print_and_write_what_their_functions_find(six, tmp_path):
    array, out = plumbob.read(six).array, tmp_path / "one.parquet"
    printed, seen = answer(f"array monitor {six} --out {out}"), monitor(array)
    assert printed == seen.summary()
    assert [(fault["unit"], fault["triad"]) for fault in printed["faults"]] == [("u3", "gyr")]
    assert np.array_equal(plumbob.read(out).imu.gyr, seen.imu.gyr)
    printed, made = answer(f"array combine {six} --weights equal --out {out} --force"), combine(array, weights="equal")
    assert printed == made.summary()
    assert np.array_equal(plumbob.read(out).imu.acc, made.imu.acc)
    assert answer(f"array info {six}") == info(array).summary()
    assert "mount" not in typed(f"array info {six}").stderr  # that of the first is along the axes, those of others not


def test_from_bytes_with_the_mounts_of_the_rig(tmp_path):
    """The rig's opposite units are turned by 180°: without their mounts, forces of ±1 g cancel."""
    typed("emulate arm --write arm.bin --duration 8s --seed 3", cwd=tmp_path)
    typed("record --from arm.bin --format arm --unit all --out arm.mcap", cwd=tmp_path)
    typed("convert arm.mcap arm.parquet", cwd=tmp_path)
    for source in ("mcap", "parquet"):
        typed(f"array combine arm.{source} --mounts arm --out {source}.mcap", cwd=tmp_path)
        force = np.linalg.norm(plumbob.read(tmp_path / f"{source}.mcap").imu.acc, axis=1)
        assert force.mean() == pytest.approx(9.80665, rel=0.01)
        assert answer(f"array monitor arm.{source} --mounts arm", cwd=tmp_path)["faults"] == []
    lost = typed("array monitor arm.mcap", cwd=tmp_path)
    assert "no mount is known" in lost.stderr
    assert "check how the units are mounted" in " ".join(lost.stdout.split())
