"""plumbob arm: angles become a program, files for robots and a page; a replay says how far the hand is from truth."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

import plumbob
from plumbob.arm import ArmCard, JointTrack, Program, export, replay, run, taught
from plumbob.data.chain_toml import chain_text
from plumbob.simulation import simulate_chain
from tests.helpers.arm_samples import arm, pick_and_place
from tests.helpers.commandline import call, ok


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
    files = ["program.csv", "program.yaml", "program.mcap", "arm.urdf"]
    said = json.loads(
        ok("arm", "export", "angles.parquet", "--chain", "arm.toml", "--out", *files, "--html", "page.html",
           "--rate", "125Hz", "--json", cwd=folder).stdout
    )  # fmt: skip
    program = taught(JointTrack.load(folder / "angles.parquet"), arm(), rate=125.0)
    assert said["samples"] == len(program) and said["rate_hz"] == pytest.approx(125.0)
    assert [stop["recorded_s"] for stop in said["stops"]] == [stop.recorded for stop in program.stops]
    assert max(said["used"].values()) <= 1.0
    export(program, folder / "ours.csv", overwrite=True)
    assert (folder / "program.csv").read_bytes() == (folder / "ours.csv").read_bytes()
    assert yaml.safe_load((folder / "program.yaml").read_text())["joint_names"] == list(program.names)
    page = (folder / "page.html").read_text()
    assert "<canvas" in page and "Use of the limits over time" in page

    words = ("arm", "replay", "program.csv", "arm.urdf", "--truth", "truth.csv")
    found = json.loads(ok(*words, "--json", cwd=folder).stdout)
    truth = JointTrack.load(folder / "truth.csv")
    error = replay(Program.load(folder / "program.csv"), folder / "arm.urdf").against(truth.t, truth.hand)
    assert found["hand_rms"] == error.rms and found["hand_max_share"] == error.max_share < 0.02
    printed = ok(*words, "--out", "hand.csv", cwd=folder).stdout
    assert f"rms {1e3 * error.rms:.2f} mm" in printed
    assert (folder / "hand.csv").read_text().startswith('"t [s]"') or (folder / "hand.csv").read_text().startswith("t")


@pytest.mark.parametrize(
    ("words", "match"),
    [
        (("export", "angles.parquet", "--out", "p.bag"), "--out takes names"),
        (("export", "angles.parquet", "--out", "m.urdf"), "name its file with --chain"),
        (("export", "angles.parquet", "--out", "angles.parquet"), "is an input"),
        (("export", "angles.parquet", "--out", "p.csv", "--rate", "5 m"), "not a unit of frequency"),
        (("export", "angles.parquet", "--chain", "angles.parquet", "--out", "p.csv"), "UTF-8"),
        (("replay", "angles.parquet", "angles.parquet"), "a model is a chain"),
        (("replay", "angles.parquet", "arm.toml", "--truth", "angles.parquet"), "no place of the hand"),
        (("replay", "angles.parquet", "arm.toml", "--hand", "x"), "--hand names a link"),
    ],
)
def test_what_cannot_be_done_is_one_line(folder: Path, words: tuple[str, ...], match: str) -> None:
    done = call("arm", *words, cwd=folder)
    assert done.returncode == 1 and match in done.stderr and len(done.stderr.splitlines()) == 1


def test_without_a_kind_they_are_listed() -> None:
    done = call("arm")
    assert done.returncode == 2 and "align, run, export, replay" in done.stderr


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


UNITS = tuple(f"u{k}.parquet" for k in range(1, 6))


def test_align_and_run_are_align_and_run(recording: Path) -> None:
    given = ("--params", "mean_rate=off")
    text = ok("arm", "align", "five.toml", *UNITS, *given, "--out", "card.json", "--force", cwd=recording).stdout
    assert "j45" in text and "card.json" in text
    said = json.loads(
        ok("arm", "run", "card.json", *UNITS, *given, "--frame", "NED", "--out", "a.parquet", "--force", "--json",
           cwd=recording).stdout
    )  # fmt: skip
    card = ArmCard.load(recording / "card.json")
    ours = run(card, [recording / name for name in UNITS], frame="NED", params={"mean_rate": False})
    assert said["samples"] == len(ours.joints) and said["frame"] == "NED"
    again = JointTrack.load(recording / "a.parquet")
    np.testing.assert_array_equal(again.angles, ours.joints.angles)


@pytest.mark.parametrize(
    ("words", "match"),
    [
        (("align", "five.toml", *UNITS[:4], "--out", "x.json"), "Name the units"),
        (("align", "five.toml", *UNITS, "--out", "five.toml"), "input"),
        (("align", "five.toml", *UNITS, "--out", "x.json", "--pose", "0s"), "--pose takes"),
        (("align", "five.toml", *UNITS, "--out", "x.json", "--pose", "0s,99s"), "not in the recording"),
        (("align", "five.toml", *UNITS, "--out", "x.json", "--pose-sd", "0deg"), "above 0"),
        (("align", "u1.parquet", *UNITS, "--out", "x.json"), "UTF-8"),
        (("run", "five.toml", *UNITS, "--pose", "1deg"), "needs 6 finite angles"),
        (("run", "five.toml", *UNITS, "--params", "foo=1"), "no parameter"),
        (("run", "five.toml", "u1=u1.parquet", "u2.parquet"), "either every SOURCE"),
        (("run", "five.toml", *UNITS, "--out", "x.json"), "end"),
        (("run", "none.toml", *UNITS), "none.toml"),
    ],
)
def test_what_an_arm_cannot_do_is_one_line(recording: Path, words: tuple[str, ...], match: str) -> None:
    done = call("arm", *words, cwd=recording)
    assert done.returncode == 1 and match in done.stderr and len(done.stderr.splitlines()) == 1
    assert not (recording / "x.json").exists()
