"""plumbob arm: angles become a program, files for robots and a page; a replay says how far the hand is from truth."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

import plumbob
from plumbob.arm import ArmCard, JointTrack, Program, export, replay, run, taught
from plumbob.data.chain import chain_text
from plumbob.simulation import simulate_chain
from tests.helpers import beside
from tests.helpers.arm_samples import arm, pick_and_place
from tests.helpers.commandline import answer, refused, table_of, typed


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
