"""sim and emulate of a chain of bodies: recordings of its units, true joint angles, and the chain beside them."""

from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq

from plumbob import CalibrationCard, find_format, load_chain
from plumbob.files import read
from plumbob.live.rigs.rig import PLANS, make_rig
from plumbob.rotations import quat_angle
from plumbob.simulation import CHAINS, simulate_chain
from tests.helpers.commandline import typed


def test_sim_teach_writes_all_units_their_truth_and_the_chain_and_takes_ones_own(tmp_path):
    unit = "--sensors mpu6000+hmc5983 --unit random --seed 3 --duration 4s --set mount_angle=5deg,mount_shift=2cm"
    done = typed(f"sim teach --frame NED {unit} --out t.parquet --card c.json", cwd=tmp_path)
    made = simulate_chain(
        "teach", "teach", frame="NED", sensors="mpu6000+hmc5983", unit="random", seed=3, duration=4.0,
        mount_angle="5 deg", mount_shift="2 cm",
    )  # fmt: skip
    array = read(tmp_path / "t.parquet").array
    assert array.names == made.array.names
    for name in array.names:
        np.testing.assert_array_equal(array.units[name].gyr, made.array.units[name].gyr)
        card = CalibrationCard.load(tmp_path / f"c-{name}.json")
        assert card.device == array.units[name].meta.device
    table = pq.read_table(tmp_path / "t-angles.parquet")
    assert table.column_names == ["t [s]", *(f"j{k} [rad]" for k in range(1, 7)), *(f"hand_{a} [m]" for a in "xyz")]
    np.testing.assert_array_equal(np.array(table["j5 [rad]"]), made.angles[:, 4])
    # in the axes of the base, whose z axis is up: in NED, half a turn about x
    np.testing.assert_allclose(np.array(table["hand_z [m]"]), -made.hand_n[:, 2], atol=1e-12)
    assert load_chain(tmp_path / "t.chain.toml").joints == CHAINS["teach"].joints
    for known, true in zip(
        load_chain(tmp_path / "t.chain.toml").segments, load_chain(tmp_path / "t-true.chain.toml").segments, strict=True
    ):
        if known.unit:
            assert 0.0 < quat_angle(known.mount.q_bs, true.mount.q_bs) <= np.deg2rad(5.0) + 1e-9
    assert "t-true.chain.toml" in done.stdout
    for chain, out in (("arm", "a"), ("a.chain.toml", "b")):
        typed(f"sim slow --chain {chain} --frame ENU --duration 2s --out {out}.parquet", cwd=tmp_path)
    one, other = (read(tmp_path / f"{name}.parquet").array for name in "ab")
    assert one.names == other.names == ("upperarm", "forearm", "hand")
    np.testing.assert_array_equal(one.units["hand"].acc, other.units["hand"].acc)


def test_emulate_teach_sends_its_bytes_and_writes_the_truth(tmp_path):
    words = "--scenario calibration --set bend=20uT,soft=yes --write a.bin --truth t.csv"
    typed(f"emulate teach --seed 2 --duration 3s {words}", cwd=tmp_path)
    own = PLANS["teach"].scenario
    settings = {**own.settings, "bend": 20.0, "soft": True}
    plan = replace(PLANS["teach"], scenario=replace(own, program="calibration", settings=settings))
    rig = make_rig(plan, find_format("teach"), seed=2, duration=3.0)
    assert (tmp_path / "a.bin").read_bytes() == rig.stream()
    lines = (tmp_path / "t-angles.csv").read_text().splitlines()
    assert lines[0].split(",")[:2] == ["t [s]", "j1 [rad]"]
    table = np.array([line.split(",") for line in lines[1:]], dtype=float)
    np.testing.assert_array_equal(table[:, 1:7], rig.chain.angles)
    assert len(read(tmp_path / "t-u6.csv").track) == 300
    assert load_chain(tmp_path / "t.chain.toml").segments[1].unit == "u1"
