"""Calibrations in rooms: a planted magnetometer is found by the reference, and errors are those of the truth."""

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.harness.room import room_of
from benchmarks.harness.rooms import Outcome, Rooms, Trial, measure_rooms
from plumbob.core.errors import DecodeError, ParameterError, ShapeError
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.cards import TriadCalibration
from plumbob.rotations import Frame, North, quat_conjugate, quat_from_rotvec, quat_rotate
from tests.helpers.mag_scene import FIELD_N, TURNED, field, tumbling, unit_of

LATE = 5  # samples of 2 ms


@pytest.fixture(scope="module")
def turned():
    """Unit, its measurements without noise, 10 ms late, and the attitude, from north, east and down."""
    rng = np.random.default_rng(31)
    unit = unit_of(rng)
    t, q_nb, _ = tumbling(rng, duration=20.0, rate=500.0)
    mag = field(rng, unit, q_nb, sd=0.0, step=0.0)
    track = AttitudeTrack(t=t[LATE:], q_nb=q_nb[LATE:], frame=Frame.NED, north=North.MAGNETIC)
    return unit, ImuData(t=t[LATE:], mag=mag[:-LATE]), track


def triad(matrix, bias):
    return TriadCalibration(matrix=matrix, bias=bias, unit_in="uT", unit_out="uT")


def test_a_planted_magnetometer_is_found_with_its_delay(turned):
    unit, imu, track = turned
    room = room_of(imu, track)
    size = np.cbrt(np.linalg.det(unit.matrix))
    assert (room.delay, room.bias) == (pytest.approx(0.01), pytest.approx(unit.bias, abs=0.01))
    assert room.matrix == pytest.approx(unit.matrix / size, abs=1e-3)
    assert room.field == pytest.approx(FIELD_N / size, abs=0.05)
    assert room.unevenness < 0.01


def test_heading_errors_are_those_of_the_truth(turned):
    """A hard iron b that is not found turns the level heading by |b × h| / h², on average over courses b / (h √2)."""
    _, imu, track = turned
    room = room_of(imu, track)
    assert room.heading_off(triad(room.matrix, room.bias)) == pytest.approx(0.0, abs=1e-12)
    assert room.heading_off(triad(3.0 * room.matrix, room.bias)) == pytest.approx(0.0, abs=1e-12)
    small = np.linalg.inv(room.matrix) @ np.array([0.1, 0.0, 0.0])
    level = np.linalg.norm(room.field[:2])
    off = room.heading_off(triad(room.matrix, room.bias + small), tilt_range=1e-6)
    assert off == pytest.approx(0.1 / level / np.sqrt(2.0), rel=1e-3)


def test_what_tells_no_room_is_refused(turned):
    _, imu, track = turned
    course = np.column_stack((np.zeros((1000, 2)), np.linspace(0.0, 6.0, 1000)))
    level = AttitudeTrack(t=imu.t[:1000], q_nb=quat_from_rotvec(course), frame=Frame.NED, north=North.MAGNETIC)
    seen = ImuData(t=level.t, mag=quat_rotate(quat_conjugate(level.q_nb), FIELD_N))
    few = AttitudeTrack(t=track.t[:50], q_nb=track.q_nb[:50], frame=Frame.NED, north=North.MAGNETIC)
    dead = "along one or more it always reads the same"
    for samples, reference, says in (
        (seen, level, "not turned enough"),
        (imu[:100], few, r"5[0-9] samples of the field have a reference; 100 are needed"),
        (ImuData(t=imu.t, mag=np.zeros(3) * imu.mag + 20.0), track, dead),
        (ImuData(t=imu.t, mag=np.array([1.0, 1.0, 0.0]) * imu.mag + 20.0), track, dead),
    ):
        with pytest.raises(ShapeError, match=says):
            room_of(samples, reference)
    with pytest.raises(ParameterError, match="window must be at least 1 s, but it is 0 s"):
        measure_rooms([Path("turned.parquet")], window=0.0)


def test_a_real_room(broad_folder, tmp_path):
    path = tmp_path / "nothing.csv"
    path.write_text("t\n0\n", encoding="utf-8")
    found = measure_rooms([broad_folder / TURNED[3], path])
    ((name, trial),) = found.trials.items()
    assert name == TURNED[3].removesuffix(".hdf5")
    assert trial.outcomes["alone"] == Outcome(refused="uneven-field")
    assert trial.outcomes["chosen"].off_deg < trial.raw_deg
    assert list(found.skipped) == ["nothing.csv"]
    assert json.loads(json.dumps(found.summary()))["trials"][name]["alone"]["refused"] == "uneven-field"
    with pytest.raises(DecodeError, match="no file holds both a magnetometer and a reference"):
        measure_rooms([path])


def test_windows_of_a_turned_unit_are_calibrated_each(turned, monkeypatch):
    """Errors of windows are those by the reference of the whole, and neighbours are compared."""
    _, imu, track = turned
    monkeypatch.setattr("benchmarks.harness.rooms.read_trial", lambda path: (imu, track))
    found = measure_rooms([Path("turned.parquet")], window=9.0)
    assert list(found.trials) == ["turned 0 s", "turned 9 s"]
    first, second = found.trials.values()
    assert first.apart is None
    assert set(second.apart) <= set(first.outcomes)
    assert found.summary()["window_s"] == 9.0


def test_grades_say_what_their_cards_are_worth():
    """Of two good cards one is off by more than 0.5° and one worse than none; √((0.5² + 3²)/2) = 2.15."""
    trials = {
        "a": Trial(0.5, 3.0, {"alone": Outcome(0.2, 0.4, grade="good"), "chosen": Outcome(refused="cone")}),
        "b": Trial(0.7, 1.0, {"alone": Outcome(1.2, 0.4, grade="good"), "chosen": Outcome(refused="cone")}),
        "c": Trial(0.7, 9.0, {"alone": Outcome(3.0, 3.0, grade="poor"), "chosen": Outcome(refused="no-gain")}),
    }
    rooms = Rooms(trials, {})
    good, every = rooms.shares("alone")["good"], rooms.shares("alone")["all"]
    assert (good.cards, good.beyond, good.worse) == (2, 1, 1)
    assert good.ratio == pytest.approx(2.15, abs=0.01)
    assert (every.cards, every.beyond, every.worst) == (3, 0, pytest.approx(3.0))
    assert (rooms.shares("chosen"), rooms.refusals("chosen")) == ({}, {"cone": 2, "no-gain": 1})
