"""plumbob calibrate mount: real processes, real files."""

import json

import numpy as np
import pytest

from plumbob import files as io
from plumbob.data.cards import CalibrationCard
from plumbob.rotations import Frame, quat_angle, quat_conjugate, quat_multiply, quat_rotate
from plumbob.simulation import simulate
from tests.helpers.commandline import ok, plumbob, refused
from tests.session.test_session_mounting import Q_BS, UNIT, Returning


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Recording of a mounted unit, its attitude, and that of the body."""
    folder = tmp_path_factory.mktemp("mount")
    sim = simulate(Returning(), frame=Frame.NED, sensors=UNIT, unit="random", seed=1)
    turned = {name: quat_rotate(quat_conjugate(Q_BS), getattr(sim.imu, name)) for name in ("gyr", "acc")}
    io.write(folder / "unit.parquet", sim.imu.corrected(meta=sim.imu.meta, **turned))
    io.write(folder / "estimate.parquet", sim.truth.with_attitude(quat_multiply(sim.truth.q_nb, Q_BS)))
    io.write(folder / "body.parquet", sim.truth)
    return folder


def test_poses_give_a_card_with_the_mounting(files, tmp_path):
    card = tmp_path / "card.json"
    done = ok("calibrate", "mount", files / "unit.parquet", "--frame", "NED", "--out", card)
    assert "- the accelerometer is not calibrated" in done.stdout
    found = CalibrationCard.load(card).mount
    assert quat_angle(found.q_bs, Q_BS) < 5.0 * np.linalg.norm(found.sd)
    assert found.method.startswith("level pose and nose raised by 30.0°, body axes of NED") and found.date
    spans = ("--level", "0s..5s", "--raised", "8s..13s")
    told = json.loads(ok("calibrate", "mount", files / "unit.parquet", "--frame", "NED", *spans, "--json").stdout)
    assert quat_angle(np.array(told["card"]["mount"]["q_bs"]), Q_BS) < 5.0 * np.linalg.norm(found.sd)
    assert told["remarks"]["mount"][0].startswith("the accelerometer is not calibrated")


def test_the_mounting_joins_a_card(files, tmp_path):
    first, second = tmp_path / "first.json", tmp_path / "second.json"
    ok("calibrate", "mount", files / "unit.parquet", "--frame", "NED", "--level-only", "--out", first)
    both = ("--estimate", files / "estimate.parquet", "--reference", files / "body.parquet")
    ok("calibrate", "mount", files / "unit.parquet", *both, "--calibration", first, "--out", second)
    assert quat_angle(CalibrationCard.load(second).mount.q_bs, Q_BS) < 1e-6


def test_what_is_missing_or_does_not_belong_together_is_said(files):
    unit = files / "unit.parquet"
    assert "Give one of ENU" in refused("calibrate", "mount", unit)
    assert "0s..5s" in refused("calibrate", "mount", unit, "--frame", "NED", "--level", "0s", "--raised", "1s..2s")
    assert "belong together" in refused("calibrate", "mount", unit, "--reference", unit)
    both = ("--reference", files / "body.parquet", "--estimate", unit)
    assert "needs no poses" in refused("calibrate", "mount", unit, *both, "--frame", "NED")
    assert "holds no attitude" in refused("calibrate", "mount", unit, *both)


def test_a_moving_body_is_refused(files):
    done = plumbob(
        "calibrate", "mount", files / "unit.parquet", "--frame", "NED", "--from", "5.3s", "--to", "7.7s", "--json"
    )
    assert done.returncode == 1
    assert json.loads(done.stdout)["refused"][0]["kind"] == "not-still"
