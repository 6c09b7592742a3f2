"""plumbob calibrate mount: real files."""

import numpy as np
import pytest

from plumbob import CalibrationCard
from plumbob import files as io
from plumbob.core.units import dps
from plumbob.rotations import quat_angle, quat_conjugate, quat_multiply, quat_rotate
from plumbob.simulation import Module, TriadErrors, simulate
from tests.helpers.commandline import answer, typed

Q_BS = np.array([0.5, -0.7, 0.1, 0.4]) / np.linalg.norm([0.5, -0.7, 0.1, 0.4])
UNIT = Module("unit", "test", gyr=TriadErrors(white_rpsd=dps(0.005), bias=dps(1.0)), acc=TriadErrors(white_rpsd=4e-3))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Recording of a mounted unit whose body is raised after 5 s, its attitude, and that of the body."""
    folder = tmp_path_factory.mktemp("mount")
    sim = simulate("raise", frame="NED", sensors=UNIT, unit="random", seed=1)
    turned = {name: quat_rotate(quat_conjugate(Q_BS), getattr(sim.imu, name)) for name in ("gyr", "acc")}
    io.write(folder / "unit.parquet", sim.imu.corrected(meta=sim.imu.meta, **turned))
    io.write(folder / "estimate.parquet", sim.truth.with_attitude(quat_multiply(sim.truth.q_nb, Q_BS)))
    io.write(folder / "body.parquet", sim.truth)
    return folder


def test_poses_give_a_card_with_the_mounting_which_joins_another_and_a_moving_body_none(folder, tmp_path):
    card = tmp_path / "card.json"
    done = typed(f"calibrate mount unit.parquet --frame NED --out {card}", cwd=folder)
    assert "- the accelerometer is not calibrated" in done.stdout
    mount = CalibrationCard.load(card).mount
    assert quat_angle(mount.q_bs, Q_BS) < 5.0 * np.linalg.norm(mount.sd)
    assert mount.method.startswith("level pose and nose raised by 30.0°, body axes of NED") and mount.date
    report = answer("calibrate mount unit.parquet --frame NED --level 0s..5s --raised 8s..13s", cwd=folder)
    assert quat_angle(np.array(report["card"]["mount"]["q_bs"]), Q_BS) < 5.0 * np.linalg.norm(mount.sd)
    assert report["remarks"]["mount"][0]["text"].startswith("the accelerometer is not calibrated")
    first, second = tmp_path / "first.json", tmp_path / "second.json"
    typed(f"calibrate mount unit.parquet --frame NED --level-only --out {first}", cwd=folder)
    tracks = "--estimate estimate.parquet --reference body.parquet"
    typed(f"calibrate mount unit.parquet {tracks} --calibration {first} --out {second}", cwd=folder)
    assert quat_angle(CalibrationCard.load(second).mount.q_bs, Q_BS) < 1e-6
    refusal = answer("calibrate mount unit.parquet --frame NED --from 5.3s --to 7.7s", cwd=folder, code=1)
    assert refusal["refused"][0]["kind"] == "not-still"
