"""Files that many of these tests read, made once; no test writes among them."""

from dataclasses import replace

import numpy as np
import pytest

import plumbob
from plumbob.arm import JointTrack
from plumbob.data.chain import chain_text
from tests.helpers.arm_samples import arm, pick_and_place

SIM = {"frame": "NED", "sensors": "mpu6000+hmc5983"}


@pytest.fixture(scope="session")
def samples(tmp_path_factory):
    """Recordings, their raw bytes and stream, a track, cards of two units, bare numbers, and an arm with its angles."""
    folder = tmp_path_factory.mktemp("samples")
    sea = plumbob.simulate("buoy", unit="calibrated", seed=1, duration=12.0, **SIM)
    plumbob.write(folder / "sea.parquet", plumbob.Recording(imu=sea.imu, track=sea.truth, name="sea"))
    plumbob.estimate(sea.imu, "mahony").save(folder / "track.parquet")
    rest = plumbob.simulate("static", unit="random", seed=4, duration=20.0, **SIM)
    imu = replace(rest.imu, meta=replace(rest.imu.meta, device="unit 7"))
    plumbob.write(folder / "rest.parquet", plumbob.Recording(imu=imu, track=rest.truth, name="rest"))
    card = replace(rest.calibration, device="unit 7", date="2026-11-21", method="table")
    card.save(folder / "card.json")
    replace(card, device="unit 8").save(folder / "other.json")
    rest.noise.save(folder / "noise.json")
    plumbob.emulate("buoy", seed=1, duration=5.0, write=folder / "sea.bin")
    plumbob.record(capture=folder / "sea.bin", format="buoy", frame="NED", filter="mahony", out=folder / "sea.mcap")
    white = 0.2 * np.random.default_rng(0).standard_normal((20_000, 3))
    np.savetxt(folder / "one.txt", white[:, 0], fmt="%.9f")
    np.save(folder / "three.npy", white)
    (folder / "arm.toml").write_text(chain_text(arm()))
    clean = pick_and_place(np.random.default_rng(4).uniform(-0.9, 0.9, (3, 6)), rest=0.6, move=1.4)
    JointTrack(clean.t, arm().angles, clean.angles).save(folder / "angles.parquet")
    (folder / "empty.bin").touch()
    (folder / "bad.txt").write_text("some words\n" * 30)
    return folder
