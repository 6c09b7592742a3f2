"""Mounting from whole recordings: planted, found, applied; the body's tilt is then that of the truth."""

import functools
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from plumbob.calibration.calibration import capture, card_of
from plumbob.calibration.mount import mount_by_poses, mount_by_reference
from plumbob.core.constants import G0
from plumbob.core.errors import FrameError, ParameterError
from plumbob.core.units import deg, dps
from plumbob.data.calibrated import apply_card
from plumbob.rotations import Frame, North, change_frame, quat_conjugate, quat_multiply, quat_rotate, rotvec_from_quat
from plumbob.simulation import EulerMotion, Module, Scenario, TriadErrors, simulate
from plumbob.simulation.signals import Moves, constant
from tests.helpers.refusals import reason_kinds

Q_BS = np.array([0.5, -0.7, 0.1, 0.4])
Q_BS = Q_BS / np.linalg.norm(Q_BS)
UNIT = Module("unit", "test", gyr=TriadErrors(white_rpsd=dps(0.005), bias=dps(1.0)), acc=TriadErrors(white_rpsd=4e-3))


class Raising(Scenario):
    """Level for 5 s, then moved by yaw, pitch and roll in 3 s each, with 5 s of rest after each move."""

    moves = ((0.0, deg(30.0), 0.0),)

    @property
    def duration(self):
        return 5.0 + 8.0 * len(self.moves)

    def motion(self, rng, duration):
        start = 5.0 + 8.0 * np.arange(len(self.moves))
        return EulerMotion(Frame.NED, Moves(start, np.full(start.size, 3.0), self.moves) + constant((0.5, 0.0, 0.0)))


class Turning(Raising):
    moves = ((deg(25.0), deg(30.0), 0.0),)


class Wandering(Raising):
    moves = ((0.0, deg(30.0), 0.0), (0.0, -deg(30.0), deg(25.0)))


class Returning(Raising):
    moves = ((0.0, deg(30.0), 0.0), (0.0, -deg(30.0), 0.0))


@functools.cache
def made(scenario=Raising, frame=Frame.NED, seed=2):
    """Simulation of a body, and the capture of a unit that is mounted on it by Q_BS."""
    sim = simulate(scenario(), frame=frame, sensors=UNIT, unit="random", seed=seed)
    turned = {name: quat_rotate(quat_conjugate(Q_BS), getattr(sim.imu, name)) for name in ("gyr", "acc")}
    return sim, capture(sim.imu.corrected(meta=sim.imu.meta, **turned), triads=())


def error(found):
    return rotvec_from_quat(quat_multiply(found.mount.q_bs, quat_conjugate(Q_BS)))


def kind_of(unit, **options):
    """Why a capture gives no mounting."""
    return reason_kinds(mount_by_poses, unit, frame=Frame.NED, **options)[0]


@pytest.mark.parametrize("frame", Frame)
@pytest.mark.parametrize("scenario", [Raising, Returning])
def test_rests_are_found_and_give_the_planted_mounting(frame, scenario):
    sim, unit = made(scenario, frame)
    found = mount_by_poses(unit, frame=frame)
    assert (np.abs(error(found)) < 4.5 * found.mount.sd).all()
    # 0.004 m/s²/√Hz over 4 s and more of rest: 0.002 m/s², a hundredth of a degree
    assert found.mount.sd.max() < 3.0 * deg(0.012)
    applied = apply_card(card_of(unit, {}, mounted=found), unit.imu)
    tilt = quat_rotate(quat_conjugate(sim.truth.q_nb), G0 * frame.up)
    still = slice(0, 450)
    np.testing.assert_allclose(applied.acc[still].mean(axis=0), tilt[still].mean(axis=0), rtol=0, atol=6.0 * 0.002)
    last = slice(-400, None)
    np.testing.assert_allclose(applied.acc[last].mean(axis=0), tilt[last].mean(axis=0), rtol=0, atol=12.0 * 0.002)


def test_spans_and_turns_are_seen():
    _, unit = made(Wandering)
    found = mount_by_poses(unit, frame=Frame.NED, level=(0.0, 5.0), raised=(8.0, 13.0))
    assert (np.abs(error(found)) < 4.5 * found.mount.sd).all()
    assert kind_of(unit) == "no-motion"  # three poses: which is raised?
    assert kind_of(unit, level=(5.5, 7.5), raised=(8.0, 13.0)) == "not-still"
    assert kind_of(unit, level=(0.0, 5.0), raised=(90.0, 99.0)) == "not-still"
    _, unit = made(Turning)
    assert kind_of(unit) == "no-motion"
    blind = replace(unit, imu=replace(unit.imu, gyr=None))
    found = mount_by_poses(blind, frame=Frame.NED)  # a turn about the vertical does not harm what forces say
    assert (np.abs(error(found)) < 4.5 * found.mount.sd).all()
    assert any("no gyroscope checked" in str(remark) for remark in found.remarks)


def test_what_is_refused_and_what_is_remarked():
    sim, unit = made()
    blind = replace(unit, imu=replace(unit.imu, acc=None))
    remarks = {
        key: " ".join(map(str, mount_by_poses(unit, frame=Frame.NED, level_only=key).remarks)) for key in (False, True)
    }
    assert "heading was not measured" in remarks[True] and "not calibrated" in remarks[False]
    assert kind_of(capture(unit.imu[:450], triads=())) == "no-motion"
    assert kind_of(capture(unit.imu[550:750], triads=())) == "not-still"
    assert kind_of(unit, level=(0.0, 4.0), raised=(1.0, 4.5)) == "ill-conditioned"
    poses, reference = partial(mount_by_poses, frame=Frame.NED), lambda t, **by: mount_by_reference(replace(t, **by), t)
    for mount, given, options, error, words in (
        (poses, unit, {"raised": (8.0, 13.0), "level_only": True}, ParameterError, "leave out one"),
        (poses, unit, {"raised": (8.0, 13.0)}, ParameterError, "belong together"),
        (poses, blind, {}, ParameterError, "no acc"),
        (reference, sim.truth, {"north": North.FREE}, FrameError, "arbitrary zero"),
        (reference, sim.truth, {"north": North.MAGNETIC}, FrameError, "magnetic north"),
    ):
        with pytest.raises(error, match=words):
            mount(given, **options)


@pytest.mark.parametrize("frame", Frame)
def test_a_reference_in_any_frame_gives_the_mounting(frame):
    sim, _ = made(Returning)
    ours = sim.truth.with_attitude(quat_multiply(sim.truth.q_nb, Q_BS))
    theirs = sim.truth.with_attitude(change_frame(sim.truth.q_nb, to=frame, from_=Frame.NED), frame=frame)
    assert np.abs(error(mount_by_reference(ours, theirs))).max() < 1e-12
