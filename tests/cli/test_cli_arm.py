"""Chains and arrays of units: simulated, recorded by unit, combined, and taught programs for robots."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml

import plumbob
from plumbob import CalibrationCard, find_format, load_chain
from plumbob.arm import ArmCard, JointTrack, Program, export, replay, run, taught
from plumbob.arm.array import combine, info, monitor
from plumbob.core.units import dps
from plumbob.data.chain import chain_text
from plumbob.files import read
from plumbob.live.rigs.rig import PLANS, make_rig
from plumbob.rotations import quat_angle
from plumbob.simulation import CHAINS, simulate_chain
from tests.helpers import beside
from tests.helpers.arm_samples import arm, as_array, moved, pick_and_place
from tests.helpers.commandline import answer, call, refused, table_of, typed


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A chain, noisy angles of its motion, and the true path of the hand."""
    made = tmp_path_factory.mktemp("arm")
    chain = arm()
    (made / "arm.toml").write_text(chain_text(chain))
    clean = pick_and_place(np.random.default_rng(4).uniform(-0.9, 0.9, (3, 6)), rest=0.6, move=1.4)
    noise = np.random.default_rng(1).normal(0.0, np.radians(0.1), clean.angles.shape)
    JointTrack(clean.t, chain.angles, clean.angles + noise).save(made / "angles.parquet")
    hand = chain.hand_at(chain.postures(clean.angles))
    JointTrack(clean.t, chain.angles, clean.angles, hand=hand).save(made / "truth.csv")
    return made


def test_export_is_export_and_replay_is_replay(folder: Path) -> None:
    files = "program.csv program.yaml program.mcap arm.urdf --html page.html --rate 125Hz"
    said = answer(f"arm export angles.parquet --chain arm.toml --out {files}", cwd=folder)
    program = taught(JointTrack.load(folder / "angles.parquet"), arm(), rate=125.0)
    assert said["samples"] == len(program) and said["rate_hz"] == pytest.approx(125.0)
    assert [stop["recorded_s"] for stop in said["stops"]] == [stop.recorded for stop in program.stops]
    assert max(said["used"].values()) <= 1.0
    export(program, folder / "ours.csv", overwrite=True)
    assert (folder / "program.csv").read_bytes() == (folder / "ours.csv").read_bytes()
    assert yaml.safe_load((folder / "program.yaml").read_text())["joint_names"] == list(program.names)
    assert "<canvas" in (folder / "page.html").read_text()
    words = "arm replay program.csv arm.urdf --truth truth.csv"
    found = answer(words, cwd=folder)
    truth = JointTrack.load(folder / "truth.csv")
    error = replay(Program.load(folder / "program.csv"), folder / "arm.urdf").against(truth.t, truth.hand)
    assert found["hand_rms"] == error.rms and found["hand_max_share"] == error.max_share < 0.02
    assert f"rms {1e3 * error.rms:.2f} mm" in typed(words, "--out", "hand.csv", cwd=folder).stdout
    assert len((folder / "hand.csv").read_text().splitlines()) == 1 + len(program)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file for each unit of a chain of five bars, and the chain."""
    made = simulate_chain(
        "five", "calibration", frame="ENU", unit="calibrated", sensors="mpu6000+hmc5983", seed=2, rate=50.0,
        duration=15.0, gyr_range="1000 deg/s",
    )  # fmt: skip
    where = tmp_path_factory.mktemp("five")
    for name, one in made.array.units.items():
        plumbob.write(where / f"{name}.parquet", plumbob.Recording(imu=one))
    (where / "five.toml").write_text(chain_text(made.chain))
    return where


UNITS = "u1.parquet u2.parquet u3.parquet u4.parquet u5.parquet"


def test_align_and_run_are_align_and_run(recording: Path) -> None:
    given = f"{UNITS} --params mean_rate=off"
    card = answer(f"arm align five.toml {given} --out card.json", cwd=recording)
    assert "j45" in json.dumps(card)
    said = answer(f"arm run card.json {given} --frame NED --out a.parquet", cwd=recording)
    files = [recording / name for name in UNITS.split()]
    ours = run(ArmCard.load(recording / "card.json"), files, frame="NED", params={"mean_rate": False})
    assert said["samples"] == len(ours.joints) and said["frame"] == "NED"
    again = JointTrack.load(recording / "a.parquet")
    np.testing.assert_array_equal(again.angles, ours.joints.angles)


REFUSED = table_of(beside(__file__, "arm_refused.txt"))


@pytest.mark.parametrize(("words", "why"), REFUSED)
def test_what_an_arm_cannot_do_is_one_line(recording: Path, words: str, why: str) -> None:
    assert why in refused("arm", *words.format(UNITS).split(), cwd=recording)
    assert not (recording / "x.json").exists()


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


ARM_UNITS = ["u1", "u2", "u3", "u4", "u5", "u6"]  # of the teaching arm, as its format names them


@pytest.fixture(scope="module")
def rig_folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("arm")
    call("emulate", "arm", "--seed", "1", "--duration", "3s", "--write", "arm.bin", cwd=folder)
    return folder


def record(folder, *words):
    return call(
        "record", "--from", "arm.bin", "--format", "arm", "--filter", "mahony", "--frame", "NED", *words, cwd=folder
    )


def test_one_unit_is_estimated_by_name_or_number_and_replay_gives_the_others(rig_folder):
    for name, unit in (("a", "u2"), ("b", "2"), ("c", "u3")):
        done = record(rig_folder, "--unit", unit, "--out", f"{name}.mcap", "--json")
        assert done.returncode == 0, done.stderr
        call("replay", f"{name}.mcap", "--out", f"{name}.tum", cwd=rig_folder)
    a, b, c = (np.loadtxt(rig_folder / f"{name}.tum") for name in "abc")
    np.testing.assert_array_equal(a, b)
    assert np.abs(a - c).max() > 1e-3  # units move apart from each other
    done = call("replay", "a.mcap", "--unit", "3", "--out", "d.tum", "--json", cwd=rig_folder)
    assert json.loads(done.stdout)["samples"] == len(c)
    np.testing.assert_array_equal(np.loadtxt(rig_folder / "d.tum"), c)
    (rig_folder / "s.toml").write_text("""
kind = "plumbob session"
version = 1
source = { kind = "file", path = "arm.bin" }
format = { name = "arm", unit = 2 }
imu = { frame = "NED" }
estimate = { filter = "mahony" }
record = { path = "s.mcap" }
""")
    assert call("record", "s.toml", cwd=rig_folder).returncode == 0
    done = call("record", "s.toml", "--unit", "u3", cwd=rig_folder)
    assert (done.returncode, "the session file already sets format, unit" in done.stderr) == (1, True)


@pytest.mark.parametrize("words", [(), ("--unit", "u7"), ("--unit", "0"), ("--unit", "7")])
def test_a_unit_that_is_not_there_is_an_error_that_lists_them(rig_folder, words):
    done = record(rig_folder, *words, "--out", "x.mcap")
    assert done.returncode == 1
    assert all(f"{name} ({number})" in done.stderr for number, name in enumerate(ARM_UNITS, 1))
    assert "--unit u1" in done.stderr
    assert not (rig_folder / "x.mcap").exists()
